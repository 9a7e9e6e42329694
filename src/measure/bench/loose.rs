//! A tree that is too slow to be wrong: what hits are compared with where there are too many rays for asking every triangle.
//!
//! Its boxes are larger than they need be, by thousands of roundings, and are compared in f64 with the whole line: none is passed
//! by for what was hit before it, or for where a ray starts and ends. It shares the triangle test with the renderer's
//! structures, which is what decides hits, and nothing else: neither builder, nor layout, nor box test. Where a scene has several
//! instances those are asked in turn, each in its own box, as [`Linear`](crate::accel::Linear) is.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::accel::{Params, TreeStats, TriangleAccelerator};
use crate::error::Result;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, TriangleMesh, intersect_triangle};
use crate::progress::{Progress, Share};

/// The most triangles of a leaf.
const LEAF: usize = 4;

/// How much larger boxes are, in parts of their largest extent.
const MARGIN: f64 = 1.0 / 1024.0;

/// The same in parts of their largest coordinate.
const MARGIN_AT: f64 = 1.0 / 65536.0;

/// A binary tree with large boxes, cut in halves by the middles of triangles.
pub struct Loose {
    /// The root first; a node's first child follows it.
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
    bounds: Bounds,
}

struct Node {
    min: DVec3,
    max: DVec3,
    /// The second child, or the first of a leaf's triangles.
    first: u32,
    /// A leaf's triangles; 0 for an inner node.
    count: u32,
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [Vec3; 3],
    primitive: u32,
}

impl Triangle {
    fn middle(&self, axis: usize) -> f64 {
        self.corners.iter().map(|corner| f64::from(corner[axis])).sum()
    }
}

impl Loose {
    /// Adds the nodes over a run of triangles.
    fn add(&mut self, first: usize, end: usize) {
        let run = &mut self.triangles[first..end];
        let bounds = Bounds::of(run.iter().flat_map(|triangle| triangle.corners));
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let size = max - min;
        let margin = size.max_element() * MARGIN + min.abs().max(max.abs()).max_element() * MARGIN_AT;
        let margin = DVec3::splat(margin + f64::from(f32::MIN_POSITIVE));
        let number = self.nodes.len();
        let node = Node { min: min - margin, max: max + margin, first: first as u32, count: (end - first) as u32 };
        self.nodes.push(node);
        if end - first <= LEAF {
            return;
        }
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let half = run.len() / 2;
        run.select_nth_unstable_by(half, |one, other| one.middle(axis).total_cmp(&other.middle(axis)));
        self.add(first, first + half);
        (self.nodes[number].first, self.nodes[number].count) = (self.nodes.len() as u32, 0);
        self.add(first + half, end);
    }

    /// Visits every triangle whose boxes the ray's line crosses, until `visit` returns true; whether it did.
    fn visit(&self, ray: &PreparedRay, mut visit: impl FnMut(&Triangle) -> bool) -> bool {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut pending = Vec::from_iter((!self.nodes.is_empty()).then_some(0usize));
        while let Some(number) = pending.pop() {
            let node = &self.nodes[number];
            if !crosses(origin, direction, node) {
                continue;
            }
            if node.count == 0 {
                pending.extend([node.first as usize, number + 1]);
            } else if self.triangles[node.first as usize..][..node.count as usize].iter().any(&mut visit) {
                return true;
            }
        }
        false
    }
}

/// Whether a line crosses a node's box.
fn crosses(origin: DVec3, direction: DVec3, node: &Node) -> bool {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let [lower, upper] = [node.min, node.max].map(|corner| corner[axis] - origin[axis]);
        if direction[axis] == 0.0 {
            if lower > 0.0 || upper < 0.0 {
                return false;
            }
        } else {
            let (one, other) = (lower / direction[axis], upper / direction[axis]);
            near = near.max(one.min(other));
            far = far.min(one.max(other));
        }
    }
    near <= far
}

impl TriangleAccelerator for Loose {
    const NAME: &'static str = "loose";

    fn build(mesh: &Arc<TriangleMesh>, _: &Params, progress: &dyn Progress) -> Result<Self> {
        let mut share = Share::new(progress, mesh.live_count() as u64);
        let triangle = |primitive: u32| Triangle { corners: mesh.triangle(primitive), primitive };
        let triangles: Vec<_> = mesh.live_triangles().map(triangle).collect();
        let mut tree = Self { nodes: Vec::new(), bounds: mesh.hit_bounds(), triangles };
        if !tree.triangles.is_empty() {
            tree.add(0, tree.triangles.len());
        }
        share.reach(100)?;
        Ok(tree)
    }

    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit) {
        self.next_after(ray, instance, Key::BEFORE_ALL, best);
    }

    fn occluded(&self, ray: &PreparedRay) -> bool {
        self.visit(ray, |triangle| {
            let [a, b, c] = triangle.corners;
            intersect_triangle(ray, a, b, c).is_some()
        })
    }

    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
        self.visit(ray, |&Triangle { corners: [a, b, c], primitive }| {
            if let Some(hit) = intersect_triangle(ray, a, b, c) {
                let hit = Hit { t: hit.t, u: hit.u, v: hit.v, instance, primitive };
                if key.is_before(&hit.key()) && hit.key().is_before(&best.key()) {
                    *best = hit;
                }
            }
            false
        });
    }

    fn stats(&self) -> TreeStats {
        TreeStats {
            triangles: self.triangles.len() as u64,
            nodes: self.nodes.iter().filter(|node| node.count == 0).count() as u64,
            leaves: self.nodes.iter().filter(|node| node.count > 0).count() as u64,
            node_bytes: size_of_val(self.nodes.as_slice()) as u64,
            leaf_bytes: size_of_val(self.triangles.as_slice()) as u64,
            ..TreeStats::default()
        }
    }

    fn validate(&self) -> std::result::Result<(), String> {
        Ok(())
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Linear;
    use crate::geometry::Ray;
    use crate::math::random::Random;
    use crate::measure::cases::meshes;
    use crate::progress::Silent;

    #[test]
    fn hits_are_those_of_every_triangle() {
        let mut random = Random::new(1, 0x0001_005e);
        for (center, size) in [(DVec3::ZERO, 1.0), (DVec3::new(1e6, -3e5, 20.0), 40.0), (DVec3::ZERO, 1e-12)] {
            let mesh = Arc::new(meshes::sphere(12, 24, size, center));
            let (loose, linear) = (
                Loose::build(&mesh, &Params::default(), &Silent).unwrap(),
                Linear::build(&mesh, &Params::default(), &Silent).unwrap(),
            );
            let mut hits = 0;
            for number in 0..2000 {
                let origin = center + random.in_cube() * (2.0 * size);
                let mut direction = (center + random.in_cube() * size - origin).as_vec3();
                if number % 7 == 0 {
                    direction[number % 3] = 0.0;
                }
                let mut ray = Ray::new(origin.as_vec3(), direction);
                if number % 5 == 0 {
                    (ray.t_min, ray.t_max) = (0.3, 1.1);
                }
                let expected = linear.closest_alone(&ray);
                assert_eq!(loose.closest_alone(&ray), expected, "{ray:?}");
                assert_eq!(loose.occluded_alone(&ray), expected.is_hit(), "{ray:?}");
                hits += usize::from(expected.is_hit());
            }
            assert!(hits > 800, "{hits}");
        }
    }
}
