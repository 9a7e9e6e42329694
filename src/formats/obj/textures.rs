//! The images that an MTL file names, each decoded once.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec2;

use super::find_file::{absence, find_file};
use crate::formats::image_file::read_texture;
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Treatment};
use crate::scene::texture::Wrap;
use crate::scene::{Texture, TextureRef};

/// The textures of a model.
#[derive(Default)]
pub(super) struct Textures {
    surroundings: Surroundings,
    list: Vec<Texture>,
    /// By file and whether it is clamped; `None` for an image that could not be read.
    known: HashMap<(PathBuf, bool), Option<u32>>,
}

impl Textures {
    /// None yet; images are read from the surroundings.
    pub fn new(surroundings: Surroundings) -> Self {
        Self { surroundings, ..Self::default() }
    }

    /// The texture of a `map_` statement, relative to `folder`; `None`, with a warning, for an image that is missing or
    /// cannot be read.
    pub fn get(&mut self, folder: &Path, statement: &str, ledger: &mut Ledger) -> Option<TextureRef> {
        let map = MapStatement::parse(statement);
        for option in &map.unused {
            ledger.note(Treatment::Ignored, format!("texture option {option}"), 1);
        }
        let Some(path) = find_file(folder, map.file, &self.surroundings) else {
            let why = absence(folder, map.file, &self.surroundings);
            ledger.note(Treatment::Warning, format!("texture `{}` {why}: plain colour used", map.file), 1);
            return None;
        };
        let texture = match self.known.get(&(path.clone(), map.clamp)) {
            Some(&known) => known,
            None => {
                let texture = self.read(&path, map.clamp, ledger);
                self.known.insert((path, map.clamp), texture);
                texture
            }
        }?;
        Some(TextureRef::scaled(texture, map.scale, map.offset))
    }

    /// All textures, in the order of their first use.
    pub fn into_list(self) -> Vec<Texture> {
        self.list
    }

    fn read(&mut self, path: &Path, clamp: bool, ledger: &mut Ledger) -> Option<u32> {
        ledger.note_file(path);
        // The same image wrapped otherwise shares its texels.
        let mut texture = match self.known.get(&(path.to_path_buf(), !clamp)) {
            Some(&other) => self.list[other? as usize].clone(),
            None => read_texture(path, &self.surroundings.limits)
                .map_err(|error| ledger.note(Treatment::Warning, format!("{error}: plain colour used"), 1))
                .ok()?,
        };
        texture.wrap = [if clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        self.list.push(texture);
        Some((self.list.len() - 1) as u32)
    }
}

/// The options and the file of a `map_` statement.
#[derive(Debug, PartialEq)]
struct MapStatement<'a> {
    file: &'a str,
    scale: DVec2,
    offset: DVec2,
    clamp: bool,
    /// Options that are not used.
    unused: Vec<&'a str>,
}

impl<'a> MapStatement<'a> {
    /// Options come first, and the file is all that follows them: its name may contain spaces.
    fn parse(statement: &'a str) -> Self {
        let mut map = Self { file: "", scale: DVec2::ONE, offset: DVec2::ZERO, clamp: false, unused: Vec::new() };
        let mut rest = statement.trim();
        while let Some((option, after)) = split_word(rest).filter(|(word, _)| word.starts_with('-')) {
            match option {
                "-s" => (map.scale, rest) = vector(after, DVec2::ONE),
                "-o" => (map.offset, rest) = vector(after, DVec2::ZERO),
                "-clamp" => {
                    let (value, after) = split_word(after).unwrap_or(("", ""));
                    map.clamp = value == "on";
                    rest = after;
                }
                "-t" => {
                    map.unused.push(option);
                    rest = vector(after, DVec2::ZERO).1;
                }
                "-mm" => {
                    map.unused.push(option);
                    rest = numbers(after, 2).1;
                }
                "-blendu" | "-blendv" | "-cc" | "-texres" | "-imfchan" | "-bm" | "-boost" | "-type" | "-colorspace" => {
                    map.unused.push(option);
                    rest = split_word(after).map_or("", |(_, after)| after);
                }
                // A file whose name begins with a dash.
                _ => break,
            }
        }
        map.file = rest;
        map
    }
}

fn split_word(text: &str) -> Option<(&str, &str)> {
    let (word, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
    (!word.is_empty()).then_some((word, rest.trim_start()))
}

/// One to three numbers, of which the third is for volumes; `default` for the second if it is not there.
fn vector(text: &str, default: DVec2) -> (DVec2, &str) {
    let (numbers, rest) = numbers(text, 3);
    let component = |i: usize| numbers.get(i).copied().unwrap_or(default[i]);
    (DVec2::new(component(0), component(1)), rest)
}

/// Up to `most` numbers and what follows them.
fn numbers(text: &str, most: usize) -> (Vec<f64>, &str) {
    let (mut numbers, mut rest) = (Vec::new(), text);
    while numbers.len() < most
        && let Some((word, after)) = split_word(rest)
        && let Ok(number) = word.parse::<f64>()
        && number.is_finite()
    {
        numbers.push(number);
        rest = after;
    }
    (numbers, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_a_name_with_spaces() {
        let map = MapStatement::parse("-s 2 3 1 -o 0.5 -blendu off -clamp on  -mm 0 1 -t 1 a b -s 1.png");
        assert_eq!(map.file, "a b -s 1.png");
        assert_eq!((map.scale, map.offset, map.clamp), (DVec2::new(2.0, 3.0), DVec2::new(0.5, 0.0), true));
        assert_eq!(map.unused, ["-blendu", "-mm", "-t"]);
        assert_eq!(MapStatement::parse("-s 2 a.png").scale, DVec2::new(2.0, 1.0));
        assert_eq!(MapStatement::parse("-a.png").file, "-a.png");
        assert_eq!(MapStatement::parse("-s").file, "");
    }

    #[test]
    fn an_image_is_decoded_once() {
        let folder = tempfile::tempdir().unwrap();
        image::RgbImage::new(2, 3).save(folder.path().join("a.png")).unwrap();
        std::fs::write(folder.path().join("bad.png"), "x").unwrap();
        let (mut textures, mut ledger) =
            (Textures::new(Surroundings::new(folder.path(), &Default::default())), Ledger::default());
        let mut get = |statement: &str| textures.get(folder.path(), statement, &mut ledger).map(|found| found.texture);
        assert_eq!(get("a.png"), Some(0));
        assert_eq!(get("-clamp on A.png"), Some(1));
        assert_eq!(get("-s 2 2 .\\a.png"), Some(0));
        assert_eq!(get("bad.png"), None);
        assert_eq!(get("-clamp on bad.png"), None);
        assert_eq!(get("none.png"), None);
        let list = textures.into_list();
        assert_eq!((list.len(), list[0].height), (2, 3));
        assert_eq!((list[0].wrap, list[1].wrap), ([Wrap::Repeat; 2], [Wrap::Clamp; 2]));
        let warnings: Vec<_> = ledger.entries().filter(|entry| entry.0 == Treatment::Warning).collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings.contains(&(Treatment::Warning, "texture `none.png` is missing: plain colour used", 1)));
    }
}
