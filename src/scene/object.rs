//! Placed shapes.

use glam::DAffine3;

/// What an object is made of, as a position in the scene's list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Shape {
    /// A position in `Scene::meshes`.
    Mesh(u32),
    /// A position in `Scene::quadrics`.
    Quadric(u32),
}

/// A shape in the scene: an instance.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Object {
    /// For messages, `info` and `explain`.
    pub name: String,
    /// What is placed.
    pub shape: Shape,
    /// From the shape's coordinates to the file's world, f64. A mesh vertex `p` stands at
    /// `transform * mesh.file_position(p)`.
    pub transform: DAffine3,
    /// Replaces the shape's own material; quadrics must have one.
    pub material: Option<u32>,
}
