//! Vertices that are one point.

use std::collections::HashMap;

use super::is_usable;
use crate::geometry::TriangleMesh;

/// Stands for a vertex that is no point: unused, or not finite.
pub(super) const NO_POINT: u32 = u32::MAX;

/// The points of a mesh's vertices, numbered from 0 in the order of the vertices.
pub(super) struct Weld {
    /// By vertex number.
    points: Vec<u32>,
    /// How many points there are.
    pub count: usize,
}

impl Weld {
    /// Joins those vertices that are `referenced` and whose coordinates are equal; the zeros are equal whatever their sign.
    pub fn new(mesh: &TriangleMesh, referenced: &[bool]) -> Self {
        let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(mesh.positions.len());
        let point = |(&position, &referenced)| {
            if !(referenced && is_usable(position)) {
                return NO_POINT;
            }
            let next = known.len() as u32;
            *known.entry((position + glam::Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(next)
        };
        let points = mesh.positions.iter().zip(referenced).map(point).collect();
        Self { points, count: known.len() }
    }

    /// The points of a triangle's corners; `None` where they are not three.
    pub fn triangle(&self, mesh: &TriangleMesh, number: u32) -> Option<[u32; 3]> {
        let point = |vertex: u32| self.points.get(vertex as usize).copied().unwrap_or(NO_POINT);
        let [a, b, c] = mesh.indices[number as usize].map(point);
        let is_triangle = a != b && b != c && c != a && ![a, b, c].contains(&NO_POINT);
        is_triangle.then_some([a, b, c])
    }
}
