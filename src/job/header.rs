//! What tiles in a file are of.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{Error, Result};
use crate::formats::Fingerprint;
use crate::job::Share;
use crate::render::{AovKind, Crop, Film, Tiles};
use crate::scene::FilmSettings;

/// Of which picture of which scene tiles are, and who was to render them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// The version of this program, which may change pixels.
    pub version: String,
    /// The files of the scene.
    pub scene: Fingerprint,
    /// How the scene was read and seen, as names and values: whatever changes pixels and is not named below.
    pub settings: serde_json::Map<String, Value>,
    /// The picture.
    pub film: FilmSettings,
    /// The part of it that was asked for.
    pub crop: Option<Crop>,
    /// Extra values.
    pub aovs: Vec<AovKind>,
    /// Whether pixels have alpha.
    pub transparent: bool,
    /// The frame of the camera's path.
    pub frame: Option<i32>,
    /// Which tiles were asked for; all of them if there is none.
    pub share: Option<Share>,
}

impl Header {
    /// The picture's tiles.
    ///
    /// # Errors
    /// As [`Tiles::of`].
    pub fn tiles(&self) -> Result<Tiles> {
        Tiles::of(&self.film, self.crop)
    }

    /// The numbers of those that were asked for, ascending.
    ///
    /// # Errors
    /// As [`Tiles::of`].
    pub fn wanted(&self) -> Result<Vec<u32>> {
        let tiles = self.tiles()?;
        Ok(match self.share {
            Some(share) => tiles.share(share.number - 1, share.of),
            None => (0..tiles.count()).collect(),
        })
    }

    /// The picture without its tiles.
    ///
    /// # Errors
    /// As [`Tiles::of`].
    pub fn blank(&self) -> Result<Film> {
        Film::blank(self.film, self.crop, &self.aovs, self.transparent)
    }

    /// Whether all numbers are such as this program writes.
    ///
    /// # Errors
    /// Says what is not.
    pub fn check(&self) -> Result<()> {
        self.tiles()?;
        let places: Vec<_> = self.aovs.iter().map(|kind| AovKind::ALL.iter().position(|known| known == kind)).collect();
        if !places.is_sorted_by(|one, next| one < next) {
            return Err(Error::file("a kind of extra values is there twice, or not in its place"));
        }
        match self.share {
            Some(Share { number, of }) if !(1..=of).contains(&number) || of > Share::MOST => {
                Err(Error::file(format!("there is no share {number} of {of}")))
            }
            _ => Ok(()),
        }
    }

    /// What of another header's picture differs from this one's, the share apart: a name and both values.
    pub fn difference(&self, other: &Self) -> Option<String> {
        let value = |header: &Self| {
            let alike = Self { share: None, ..header.clone() };
            serde_json::to_value(alike).expect("names and numbers have a JSON form")
        };
        difference("", &value(self), &value(other))
    }
}

/// The first value that differs, by the names that lead to it.
fn difference(name: &str, one: &Value, other: &Value) -> Option<String> {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => one.keys().chain(other.keys()).find_map(|key| {
            let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
            difference(&name, one.get(key).unwrap_or(&Value::Null), other.get(key).unwrap_or(&Value::Null))
        }),
        _ => (one != other).then(|| format!("{name} is {other} here and {one} there")),
    }
}
