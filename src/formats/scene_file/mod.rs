//! The scene file: TOML that says what there is to see, from where, and how it becomes a picture.
//!
//! The format is described in the manual's page on it. Every mistake is an error with line and column; nothing is
//! skipped in silence.

mod assets;
mod light;
mod material;
mod object;
mod read;
mod shape;
#[cfg(test)]
mod tests;
mod transform;
mod value;
mod view;
mod write;

pub use assets::{Assets, builtin_names};
pub use read::{Parsed, parse, parse_with, read};
pub use shape::SHAPES;
pub use transform::parse_transform;
pub use write::{camera_text, light_text, model_scene, save_model_scene};
