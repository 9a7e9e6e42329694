//! How to render, and what it took.

use crate::render::film::AovKind;

/// A part of the picture in pixels: origin top left, half-open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Crop {
    /// First column.
    pub x0: u32,
    /// First row.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Crop {
    /// Columns.
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }
}

/// What does not change a pixel's value, only which pixels are rendered and by whom.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RenderSettings {
    /// Number of threads; 0 takes one per processor.
    pub threads: usize,
    /// Render this part alone.
    pub crop: Option<Crop>,
    /// Extra values to record.
    pub aovs: Vec<AovKind>,
    /// Render these of the picture's [`Tiles`](crate::render::tiles::Tiles) alone, by number; the others stay black.
    pub tiles: Option<Vec<u32>>,
    /// Whether to count the pixels that show each material and each mesh.
    pub coverage: bool,
}

/// How many pixels show what: of each, the first sample counts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Coverage {
    /// Of each of the scene's materials.
    pub materials: Vec<u64>,
    /// Of each of the scene's meshes.
    pub meshes: Vec<u64>,
}

/// Rays traced, by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct RayCounts {
    /// Camera rays.
    pub camera: u64,
    /// Shadow rays, one a light that faces the point.
    pub shadow: u64,
    /// Mirror rays, total internal reflection included.
    pub reflected: u64,
    /// Rays that went through a surface.
    pub refracted: u64,
}

impl RayCounts {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.camera + self.shadow + self.reflected + self.refracted
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.shadow += other.shadow;
        self.reflected += other.reflected;
        self.refracted += other.refracted;
    }
}

/// What threads did with their time, in seconds, all threads together.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct ThreadSeconds {
    /// Finding what rays hit, and whether lights are seen.
    pub traversal: f64,
    /// Finding surface points and colours, and making the rays that leave them. Light that passes through transparent surfaces and
    /// the entries of edges are followed here.
    pub shading: f64,
    /// The rest: sample positions, camera rays, extra values, sums over pixels, and waiting for the last tiles.
    pub rest: f64,
}

impl std::ops::AddAssign for ThreadSeconds {
    fn add_assign(&mut self, other: Self) {
        self.traversal += other.traversal;
        self.shading += other.shading;
        self.rest += other.rest;
    }
}

/// What a rendering took.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct RenderStats {
    /// Rays by kind.
    pub rays: RayCounts,
    /// Wall-clock seconds from the first camera ray to the finished linear film.
    pub seconds: f64,
    /// What threads did in that time.
    pub thread_seconds: ThreadSeconds,
    /// Threads that were used.
    pub threads: usize,
}
