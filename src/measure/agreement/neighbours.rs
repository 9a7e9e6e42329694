//! Which triangles of a mesh meet at a point, by the positions of their corners.

use std::collections::HashMap;

use glam::Vec3;

use crate::geometry::TriangleMesh;

/// The triangles around each position. Vertices at one position are one: seams of texture coordinates are no borders.
#[derive(Debug, Default)]
pub(super) struct Neighbours {
    around: HashMap<[u32; 3], Vec<u32>>,
}

impl Neighbours {
    /// Looks through a mesh; triangles that cannot be hit have no say.
    pub fn of(mesh: &TriangleMesh) -> Self {
        let mut around: HashMap<_, Vec<u32>> = HashMap::new();
        for number in mesh.live_triangles() {
            for corner in mesh.triangle(number) {
                around.entry(key(corner)).or_default().push(number);
            }
        }
        Self { around }
    }

    /// The triangles that have a corner there.
    pub fn at(&self, position: Vec3) -> &[u32] {
        self.around.get(&key(position)).map_or(&[], Vec::as_slice)
    }

    /// The triangles that have both corners.
    pub fn along(&self, a: Vec3, b: Vec3) -> impl Iterator<Item = u32> + '_ {
        self.at(a).iter().copied().filter(move |number| self.at(b).contains(number))
    }
}

/// The bits of a position, 0 and -0 as one.
fn key(position: Vec3) -> [u32; 3] {
    position.to_array().map(|k| (k + 0.0).to_bits())
}
