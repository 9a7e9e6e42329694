//! A Whitted ray tracer for large triangle scenes.

pub mod accel;
#[cfg(feature = "cli")]
pub mod cli;
pub mod error;
pub mod formats;
pub mod geometry;
pub mod manual;
pub mod math;
pub mod progress;
pub mod render;
pub mod scene;

pub use error::{Error, Fault, Result};
