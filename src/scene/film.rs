//! The picture's size, samples, and how values become bytes.

/// When colours are clamped to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clamp {
    /// After every shade, so that a mirror never shows more than 1: the seed.
    Shade,
    /// Never while shading; formats of whole numbers clamp when they are written, float formats keep the value.
    #[default]
    Output,
}

/// How linear values become the bytes of PNG and JPEG.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Transfer {
    /// The sRGB curve.
    #[default]
    Srgb,
    /// Values as they are.
    Linear,
}

/// Everything about the picture that is not in the scene.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct FilmSettings {
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// Samples a pixel, at least 1; 1 is the pixel's centre.
    pub samples: u32,
    /// How often a ray may be reflected or refracted; 0 is direct light alone.
    pub max_depth: u32,
    /// When colours are clamped.
    pub clamp: Clamp,
    /// How PNG and JPEG are encoded.
    pub transfer: Transfer,
    /// Values are multiplied by 2 to this when the picture is written.
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
