//! Leaf triangles, and the three questions asked of any tree that has them in its leaves.

use std::ops::ControlFlow;

use glam::Vec3;

use super::Params;
use super::topology::Topology;
use crate::error::Result;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, TriangleMesh, intersect_triangle};
use crate::progress::Progress;

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
        Bounds::of(self.vertices)
    }

    /// The hit of a ray, if any.
    #[inline(always)]
    pub fn intersect(&self, ray: &PreparedRay, instance: u32) -> Option<Hit> {
        let [a, b, c] = self.vertices;
        let hit = intersect_triangle(ray, a, b, c)?;
        Some(Hit { t: hit.t, u: hit.u, v: hit.v, instance, primitive: self.primitive })
    }
}

/// Builds a tree over a mesh's live triangles with at most `max_leaf` of them a leaf, and puts the triangles into the
/// order of its leaves.
///
/// # Errors
/// When `progress` says to stop.
pub fn build_topology(
    mesh: &TriangleMesh,
    params: &Params,
    max_leaf: u32,
    progress: &dyn Progress,
) -> Result<(Topology, Vec<LeafTriangle>)> {
    progress.check()?;
    let live: Vec<u32> = mesh.live_triangles().collect();
    let boxes: Vec<Bounds> = live.iter().map(|&number| Bounds::of(mesh.triangle(number))).collect();
    progress.check()?;
    let topology = Topology::build(&boxes, params.preset, max_leaf);
    progress.check()?;
    let triangles = topology.order.iter().map(|&at| LeafTriangle::new(mesh, live[at as usize])).collect();
    Ok((topology, triangles))
}

/// A tree with triangles in its leaves.
pub trait TriangleTree {
    /// Visits every leaf whose box the ray crosses somewhere in `[near, far]`, roughly front to back.
    ///
    /// `visit` returns the new `far` after each leaf, no larger than before, or breaks off the whole traversal.
    fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        visit: impl FnMut(&[LeafTriangle]) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()>;
}

/// See [`TriangleAccelerator::closest`](super::TriangleAccelerator::closest).
#[inline(always)]
pub fn closest(tree: &impl TriangleTree, ray: &PreparedRay, instance: u32, best: &mut Hit) {
    let _ = tree.traverse(ray, ray.lower_bound(ray.t_min), far_bound(ray, best), |triangles| {
        for triangle in triangles {
            if let Some(hit) = triangle.intersect(ray, instance)
                && hit.key().is_before(&best.key())
            {
                *best = hit;
            }
        }
        ControlFlow::Continue(far_bound(ray, best))
    });
}

/// See [`TriangleAccelerator::occluded`](super::TriangleAccelerator::occluded).
#[inline(always)]
pub fn occluded(tree: &impl TriangleTree, ray: &PreparedRay) -> bool {
    let far = ray.upper_bound(ray.t_max);
    let search = tree.traverse(ray, ray.lower_bound(ray.t_min), far, |triangles| {
        let blocks = |triangle: &LeafTriangle| {
            let [a, b, c] = triangle.vertices;
            intersect_triangle(ray, a, b, c).is_some()
        };
        if triangles.iter().any(blocks) { ControlFlow::Break(()) } else { ControlFlow::Continue(far) }
    });
    search.is_break()
}

/// See [`TriangleAccelerator::next_after`](super::TriangleAccelerator::next_after).
#[inline(always)]
pub fn next_after(tree: &impl TriangleTree, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
    let near = ray.lower_bound(ray.t_min).max(ray.lower_bound(key.t));
    let _ = tree.traverse(ray, near, far_bound(ray, best), |triangles| {
        for triangle in triangles {
            if let Some(hit) = triangle.intersect(ray, instance)
                && key.is_before(&hit.key())
                && hit.key().is_before(&best.key())
            {
                *best = hit;
            }
        }
        ControlFlow::Continue(far_bound(ray, best))
    });
}

/// The largest t in the mesh's space at which a hit can still count: within the ray and no later than `best`.
#[inline(always)]
fn far_bound(ray: &PreparedRay, best: &Hit) -> f32 {
    let (within, best) = (ray.upper_bound(ray.t_max), ray.upper_bound(best.t));
    if best < within { best } else { within }
}

/// Checks that leaves, given as (first, count), hold every position of `0..total` exactly once.
///
/// # Errors
/// Names the first position that is missing or held twice.
pub fn check_partition(leaves: &mut [(u32, u32)], total: usize) -> std::result::Result<(), String> {
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
pub fn check_distinct(triangles: &[LeafTriangle]) -> std::result::Result<(), String> {
    let mut numbers: Vec<u32> = triangles.iter().map(|triangle| triangle.primitive).collect();
    numbers.sort_unstable();
    match numbers.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("triangle {} is in two leaves", pair[0])),
        None => Ok(()),
    }
}
