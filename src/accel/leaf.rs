//! Triangles as leaves hold them, and what must hold for all leaves of a tree.

use glam::Vec3;

use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, Hit, PreparedRay, TriangleMesh, intersect_triangle};

/// A triangle as leaves hold it: all that a test needs, in one place.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct LeafTriangle {
    /// The corners.
    pub vertices: [Vec3; 3],
    /// The triangle's number in the mesh.
    pub primitive: u32,
}

impl LeafTriangle {
    /// Copies a live triangle out of its mesh.
    pub fn new(mesh: &TriangleMesh, primitive: u32) -> Self {
        Self { vertices: mesh.triangle(primitive), primitive }
    }

    /// The exact box.
    pub fn bounds(&self) -> Bounds {
        hit_bounds(self.vertices)
    }

    /// The hit of a ray, if any.
    #[inline(always)]
    pub fn intersect(&self, ray: &PreparedRay, instance: u32) -> Option<Hit> {
        let [a, b, c] = self.vertices;
        let hit = intersect_triangle(ray, a, b, c)?;
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, instance, primitive: self.primitive })
    }
}

/// Checks that leaves, given as (first, count), hold every position of `0..total` exactly once.
///
/// # Errors
/// Names the first position that is missing or held twice.
pub fn check_partition(leaves: &mut [(u32, u32)], total: usize) -> Result<(), String> {
    leaves.sort_unstable();
    let mut next = 0u64;
    for &mut (first, count) in leaves {
        if u64::from(first) != next || count == 0 {
            return Err(format!("the leaf at {first} with {count} items should start at {next} and not be empty"));
        }
        next += u64::from(count);
    }
    if next == total as u64 { Ok(()) } else { Err(format!("leaves hold {next} items of {total}")) }
}

/// Checks that no triangle is held twice.
///
/// # Errors
/// Names the first that is.
pub fn check_distinct(triangles: &[LeafTriangle]) -> Result<(), String> {
    let mut numbers: Vec<u32> = triangles.iter().map(|triangle| triangle.primitive).collect();
    numbers.sort_unstable();
    match numbers.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("triangle {} is in two leaves", pair[0])),
        None => Ok(()),
    }
}
