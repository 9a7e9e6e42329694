//! The picture's size, samples, and how values become bytes.

use crate::error::{Error, Result};

/// The longest side of a picture, in pixels.
pub const LONGEST_SIDE: u32 = 1 << 16;

/// Samples a pixel beyond which nothing visible changes any more.
pub const MOST_SAMPLES: u32 = 1 << 20;

/// The largest `max_depth`: what fits the stack of a rendering thread with room to spare.
pub const LARGEST_DEPTH: u32 = 1000;

/// The largest exposure either way: 2 to it stays a normal f32.
pub const LARGEST_EXPOSURE: f32 = 126.0;

/// When colours are clamped to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Clamp {
    /// After every shade, so that a mirror never shows more than 1: the seed.
    Shade,
    /// Never while shading; formats of whole numbers clamp when they are written, float formats keep the value.
    #[default]
    Output,
}

/// How linear values become the bytes of PNG and JPEG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transfer {
    /// The sRGB curve.
    #[default]
    Srgb,
    /// Values as they are.
    Linear,
}

/// Everything about the picture that is not in the scene.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct FilmSettings {
    /// Width in pixels, from 1 to [`LONGEST_SIDE`].
    pub width: u32,
    /// Height in pixels, from 1 to [`LONGEST_SIDE`].
    pub height: u32,
    /// Samples a pixel, from 1 to [`MOST_SAMPLES`]; 1 is the pixel's centre.
    pub samples: u32,
    /// How often a ray may be reflected or refracted, to [`LARGEST_DEPTH`]; 0 is direct light alone.
    pub max_depth: u32,
    /// When colours are clamped.
    pub clamp: Clamp,
    /// How PNG and JPEG are encoded.
    pub transfer: Transfer,
    /// Values are multiplied by 2 to this when the picture is written; to [`LARGEST_EXPOSURE`] either way.
    pub exposure: f32,
}

impl Default for FilmSettings {
    /// 1280x720, 16 samples, depth 5, clamped on output, sRGB, exposure 0.
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            samples: 16,
            max_depth: 5,
            clamp: Clamp::Output,
            transfer: Transfer::Srgb,
            exposure: 0.0,
        }
    }
}

impl FilmSettings {
    /// Whether every field is within its limits.
    ///
    /// # Errors
    /// A caller's error for a picture without pixels or samples, or an exposure that is NaN; a limit for what exceeds
    /// the constants above.
    pub fn check(&self) -> Result<()> {
        if self.width == 0 || self.height == 0 || self.samples == 0 {
            return Err(Error::caller("the picture needs at least one pixel and one sample"));
        }
        if self.exposure.is_nan() {
            return Err(Error::caller("the exposure is not a number"));
        }
        let beyond = |what: &str, value: f64, most: f64| match value > most {
            true => Err(Error::limit(format!("{what} of {value} is more than the {most} supported"))),
            false => Ok(()),
        };
        beyond("a width", self.width.into(), LONGEST_SIDE.into())?;
        beyond("a height", self.height.into(), LONGEST_SIDE.into())?;
        beyond("a number of samples", self.samples.into(), MOST_SAMPLES.into())?;
        beyond("a depth", self.max_depth.into(), LARGEST_DEPTH.into())?;
        beyond("an exposure", self.exposure.abs().into(), LARGEST_EXPOSURE.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exceeds_a_limit_is_told_by_its_name() {
        let film = FilmSettings::default();
        assert!(film.check().is_ok());
        for (film, expected) in [
            (FilmSettings { samples: 0, ..film }, "at least one pixel and one sample"),
            (FilmSettings { width: LONGEST_SIDE + 1, ..film }, "a width of 65537 is more than the 65536 supported"),
            (FilmSettings { height: u32::MAX, ..film }, "a height of 4294967295"),
            (FilmSettings { samples: MOST_SAMPLES + 1, ..film }, "a number of samples of 1048577"),
            (FilmSettings { max_depth: LARGEST_DEPTH + 1, ..film }, "a depth of 1001 is more than the 1000 supported"),
            (FilmSettings { exposure: -126.5, ..film }, "an exposure of 126.5"),
            (FilmSettings { exposure: f32::NAN, ..film }, "the exposure is not a number"),
        ] {
            let message = film.check().unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
