//! The viewport: a preview of a scene by OpenGL, shaded by the formula of the renderer at vertices, without shadows,
//! mirrors and refraction.

pub mod camera;
pub mod decimate;
pub mod piece;
pub mod preview;
pub mod terms;
pub mod tessellate;

pub use camera::View;
