//! From a scene to hits and pictures: the seed's call graph, one file a step.

pub mod film;
pub mod renderer;
pub mod settings;

pub use film::{Aov, AovKind, Film};
pub use renderer::{BuildStats, Renderer};
pub use settings::{Crop, RayCounts, RenderSettings, RenderStats};
