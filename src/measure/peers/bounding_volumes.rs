//! The crate bvh: its tree and iterators. Its own triangle test culls back faces and misses what is small, so that of
//! obvhs is asked. Candidates are visited box by box, nearest children first, without an end at the best hit: it has none.

use std::time::Instant;

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::{Bvh, BvhNode};
use bvh::ray::Ray as TheirBoxRay;
use nalgebra::{Point3, Vector3};
use obvhs::ray::Ray as TheirRay;
use obvhs::rt_triangle::RtTriangle;

use super::{Built, Peer, Surface};
use crate::geometry::{Hit, Ray};

/// A tree of all triangles.
pub struct BoundingVolumes {
    tree: Bvh<f32, 3>,
    triangles: Vec<Leaf>,
}

struct Leaf {
    bounds: Aabb<f32, 3>,
    node: usize,
    triangle: RtTriangle,
    instance: u32,
    primitive: u32,
}

impl Bounded<f32, 3> for Leaf {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Leaf {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl BoundingVolumes {
    /// Builds a tree with the threads of the current pool.
    pub fn build(surfaces: &[Surface]) -> Built<Self> {
        let start = Instant::now();
        let leaf = |(instance, primitive, [a, b, c]): (u32, u32, [glam::Vec3; 3])| {
            let (min, max) = (a.min(b).min(c), a.max(b).max(c));
            let bounds = Aabb::with_bounds(Point3::new(min.x, min.y, min.z), Point3::new(max.x, max.y, max.z));
            let triangle = RtTriangle::new(a.into(), b.into(), c.into());
            Leaf { bounds, node: 0, triangle, instance, primitive }
        };
        let mut triangles: Vec<Leaf> = surfaces.iter().flat_map(Surface::triangles).map(leaf).collect();
        let tree = Bvh::build_par(&mut triangles);
        let bytes = tree.nodes.len() * size_of::<BvhNode<f32, 3>>() + size_of_val(triangles.as_slice());
        Built { peer: Self { tree, triangles }, seconds: start.elapsed().as_secs_f64(), bytes: bytes as u64 }
    }
}

impl Peer for BoundingVolumes {
    fn closest(&self, ray: &Ray) -> Hit {
        let (boxes, mut ray) = theirs(ray);
        let mut best = Hit::MISS;
        for leaf in self.tree.nearest_child_traverse_iterator(&boxes, &self.triangles) {
            let t = leaf.triangle.intersect(&ray);
            if t < best.t {
                ray.tmax = t;
                best = Hit { t, u: 0.0, v: 0.0, instance: leaf.instance, primitive: leaf.primitive };
            }
        }
        best
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let (boxes, ray) = theirs(ray);
        self.tree.traverse_iterator(&boxes, &self.triangles).any(|leaf| leaf.triangle.intersect(&ray) < f32::INFINITY)
    }
}

#[inline(always)]
fn theirs(ray: &Ray) -> (TheirBoxRay<f32, 3>, TheirRay) {
    let Ray { origin: o, direction: d, .. } = *ray;
    let boxes = TheirBoxRay::new(Point3::new(o.x, o.y, o.z), Vector3::new(d.x, d.y, d.z));
    (boxes, TheirRay::new(o.into(), d.into(), ray.t_min.max(0.0), ray.t_max))
}
