//! The rendered picture, linear and in floats.

use crate::render::settings::{Coverage, Crop, RenderStats};
use crate::scene::FilmSettings;

/// Extra values a pixel, beside its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AovKind {
    /// Distance along the camera ray of the pixel's first sample; infinity for a miss. Channel `Z`.
    Depth,
    /// World-space shading normal, facing the camera. Channels `X`, `Y`, `Z`.
    Normal,
    /// World-space position in the file's coordinates. Channels `X`, `Y`, `Z`.
    Position,
    /// Texture coordinates. Channels `U`, `V`.
    Uv,
    /// Instance and primitive number plus one; 0 for a miss. Channels `instance`, `primitive`, as 32-bit unsigned.
    Id,
    /// Diffuse colour with its texture. Channels `R`, `G`, `B`.
    Albedo,
}

impl AovKind {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Depth, Self::Normal, Self::Position, Self::Uv, Self::Id, Self::Albedo];

    /// The name on the command line and of the EXR layer.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::Uv => "uv",
            Self::Id => "id",
            Self::Albedo => "albedo",
        }
    }

    /// The names of the channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Depth => &["Z"],
            Self::Normal | Self::Position => &["X", "Y", "Z"],
            Self::Uv => &["U", "V"],
            Self::Id => &["instance", "primitive"],
            Self::Albedo => &["R", "G", "B"],
        }
    }
}

/// One kind of extra values for all pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Aov {
    /// What it is.
    pub kind: AovKind,
    /// Per channel of [`AovKind::channels`] one value a pixel, rows from the top. For [`AovKind::Id`] the bits are
    /// those of a u32.
    pub channels: Vec<Vec<f32>>,
}

/// A picture: linear colours, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    /// Width in pixels: the crop's, if there is one.
    pub width: u32,
    /// Height in pixels: the crop's, if there is one.
    pub height: u32,
    /// Which part of the full picture this is.
    pub crop: Option<Crop>,
    /// Linear red, green, blue, not clamped unless `settings.clamp` says so; exposure not applied.
    pub color: Vec<[f32; 3]>,
    /// Share of the samples that hit something, where the background is transparent.
    pub alpha: Option<Vec<f32>>,
    /// Extra values.
    pub aovs: Vec<Aov>,
    /// The settings it was rendered with.
    pub settings: FilmSettings,
    /// Whether every pixel was rendered; false after a cancellation, when missing pixels are black.
    pub complete: bool,
    /// What pixels show, where that was asked for.
    pub coverage: Option<Coverage>,
    /// Counts and times.
    pub stats: RenderStats,
}
