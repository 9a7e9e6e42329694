//! Vertices that are one point.

use crate::geometry::TriangleMesh;
use crate::geometry::mesh::is_usable;
use crate::geometry::smoothing::places;

/// The points of a mesh's vertices: each is called by its first vertex.
pub(super) struct Weld {
    /// By vertex number.
    points: Vec<u32>,
}

impl Weld {
    /// Joins vertices whose coordinates are equal; the zeros are equal whatever their sign.
    pub fn new(mesh: &TriangleMesh) -> Self {
        Self { points: places(&mesh.positions) }
    }

    /// One more than the largest number of a point.
    pub fn end(&self) -> usize {
        self.points.len()
    }

    /// The points of a triangle's corners; `None` where they are not three, or one of them is missing or not finite.
    pub fn triangle(&self, mesh: &TriangleMesh, number: u32) -> Option<[u32; 3]> {
        let point = |vertex: u32| {
            mesh.positions.get(vertex as usize).filter(|&&position| is_usable(position))?;
            Some(self.points[vertex as usize])
        };
        let [a, b, c] = mesh.indices[number as usize].map(point);
        let (a, b, c) = (a?, b?, c?);
        (a != b && b != c && c != a).then_some([a, b, c])
    }
}
