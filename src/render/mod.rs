//! From a scene to hits and pictures: the seed's call graph, one file a step.
//!
//! ```text
//! ray_tracing -> trace -> intersect
//!                  ^  \-> shade -> shadow -> intersect
//!                  \--------/
//! ```
//!
//! Pictures take the same steps for many rays at once (`wave`), and give the same bytes.

pub mod answers;
mod chunk;
mod detail;
pub mod explain;
pub mod film;
pub mod intersect;
mod points;
pub mod ray_tracing;
pub mod renderer;
pub mod sampling;
pub mod settings;
pub mod shade;
pub mod shadow;
mod silhouette;
pub mod surface;
pub mod tiles;
pub mod trace;
mod two_level_batch;
mod wave;
mod witness;
pub mod world;

pub use answers::Answers;
pub use film::{Aov, AovKind, Film};
pub use intersect::Intersect;
pub use renderer::{BuildStats, Renderer};
pub use settings::{Coverage, Crop, RayCounts, RenderSettings, RenderStats, ThreadSeconds};
pub use tiles::{Tile, Tiles};
