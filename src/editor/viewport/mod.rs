//! The viewport: a preview of a scene by OpenGL, shaded by the formula of the renderer at vertices, without shadows,
//! mirrors and refraction.

pub mod camera;

pub use camera::View;
