//! The rendered picture, linear and in floats.

use crate::error::Result;
use crate::render::settings::{Coverage, Crop, RenderStats};
use crate::render::tiles::{Tile, Tiles};
use crate::scene::FilmSettings;

/// Extra values a pixel, beside its colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
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
    /// Whether every tile that was asked for was rendered; false after a cancellation, when missing pixels are black.
    pub complete: bool,
    /// What pixels show, where that was asked for.
    pub coverage: Option<Coverage>,
    /// Counts and times.
    pub stats: RenderStats,
}

impl Film {
    /// A black picture, or part of one, that waits for its tiles.
    ///
    /// # Errors
    /// As [`Tiles::of`].
    pub fn blank(settings: FilmSettings, crop: Option<Crop>, aovs: &[AovKind], transparent: bool) -> Result<Self> {
        let area = Tiles::of(&settings, crop)?.area();
        let (width, height) = (area.width(), area.height());
        let pixels = width as usize * height as usize;
        let aov = |&kind: &AovKind| Aov { kind, channels: vec![vec![0.0; pixels]; kind.channels().len()] };
        Ok(Self {
            width,
            height,
            crop,
            color: vec![[0.0; 3]; pixels],
            alpha: transparent.then(|| vec![0.0; pixels]),
            aovs: aovs.iter().map(aov).collect(),
            settings,
            complete: false,
            coverage: None,
            stats: RenderStats::default(),
        })
    }

    /// Copies a tile to its place, and counts its rays.
    ///
    /// # Panics
    /// If the tile is not one of this picture.
    pub fn put(&mut self, tile: &Tile) {
        let (left, top) = self.crop.map_or((0, 0), |crop| (crop.x0, crop.y0));
        let tile_width = tile.area.width() as usize;
        for (row, y) in (tile.area.y0..tile.area.y1).enumerate() {
            let from = row * tile_width..(row + 1) * tile_width;
            let start = (y - top) as usize * self.width as usize + (tile.area.x0 - left) as usize;
            let to = start..start + tile_width;
            self.color[to.clone()].copy_from_slice(&tile.color[from.clone()]);
            if let Some(alpha) = &mut self.alpha {
                alpha[to.clone()].copy_from_slice(&tile.alpha[from.clone()]);
            }
            let channels = self.aovs.iter_mut().flat_map(|aov| &mut aov.channels);
            for (channel, values) in channels.zip(&tile.aovs) {
                channel[to.clone()].copy_from_slice(&values[from.clone()]);
            }
        }
        self.stats.rays += tile.rays;
        self.stats.thread_seconds += tile.seconds;
    }
}
