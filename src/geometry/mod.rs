//! Shapes and what a ray does with each: rays, boxes, triangles, meshes and quadrics.

pub mod bounds;
pub mod doctor;
pub mod hit;
pub mod mesh;
pub(crate) mod numbering;
pub mod quadric;
pub mod quadric_form;
pub mod ray;
pub mod shapes;
mod smoothing;
mod tangents;
pub mod triangle;

pub use bounds::Bounds;
pub use hit::{Hit, Key};
pub use mesh::TriangleMesh;
pub use quadric::Quadric;
pub use ray::{PreparedRay, Ray};
pub use triangle::{TriangleHit, intersect_triangle};
