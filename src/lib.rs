//! A Whitted ray tracer for large triangle scenes.

pub mod accel;
pub mod error;
pub mod formats;
pub mod geometry;
pub mod math;
pub mod progress;
pub mod render;
pub mod scene;

pub use error::{Error, Fault, Result};
