//! Features that a measuring build can leave out.
//!
//! Ordinary builds have them all. With `RUSTFLAGS='--cfg whitted_without="textures"'` the code behind one is not
//! compiled: what a scene that does not use it pays for its presence is the difference between the two builds. Pictures
//! of scenes that do use it are then wrong; such a build is for counting only.

/// Shading normals of meshes.
pub const NORMALS: bool = !cfg!(whitted_without = "normals");
/// Image textures, and the coordinates that they need.
pub const TEXTURES: bool = !cfg!(whitted_without = "textures");
/// Objects that are moved, turned or scaled.
pub const TRANSFORMS: bool = !cfg!(whitted_without = "transforms");
/// Quadrics.
pub const QUADRICS: bool = !cfg!(whitted_without = "quadrics");
/// Mirrors.
pub const REFLECTION: bool = !cfg!(whitted_without = "reflection");
/// Surfaces that let light through.
pub const REFRACTION: bool = !cfg!(whitted_without = "refraction");
/// More lights than one.
pub const MANY_LIGHTS: bool = !cfg!(whitted_without = "lights");
