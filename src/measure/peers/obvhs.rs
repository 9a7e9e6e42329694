//! obvhs's own traversals and triangle test, as shipped: what its trees do without ours.

use std::time::{Duration, Instant};

use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray as TheirRay, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::{Built, Peer, Surface};
use crate::geometry::{Hit, Ray};

/// One of obvhs's trees with its triangles in the order of the leaves.
pub struct Obvhs<T> {
    tree: T,
    triangles: Vec<RtTriangle>,
    /// Instance and number of each triangle.
    numbers: Vec<[u32; 2]>,
}

/// A tree of obvhs's.
pub trait Tree: Send + Sync + Sized {
    /// Builds it with its medium preset.
    fn build(triangles: &[Triangle]) -> Self;

    /// The triangles in the order of the leaves.
    fn order(&self) -> &[u32];

    /// Bytes of the nodes.
    fn node_bytes(&self) -> usize;

    /// The closest hit among triangles that are in the order of the leaves.
    fn traverse(&self, ray: TheirRay, hit: &mut RayHit, triangles: &[RtTriangle]) -> bool;

    /// Whether nothing is hit.
    fn misses(&self, ray: TheirRay, triangles: &[RtTriangle]) -> bool;
}

macro_rules! tree {
    ($tree:ident, $build:ident) => {
        impl Tree for $tree {
            fn build(triangles: &[Triangle]) -> Self {
                $build(triangles, BvhBuildParams::medium_build(), &mut Duration::default())
            }

            fn order(&self) -> &[u32] {
                &self.primitive_indices
            }

            fn node_bytes(&self) -> usize {
                size_of_val(self.nodes.as_slice())
            }

            #[inline]
            fn traverse(&self, ray: TheirRay, hit: &mut RayHit, triangles: &[RtTriangle]) -> bool {
                self.ray_traverse(ray, hit, |ray, place| triangles[place].intersect(ray))
            }

            #[inline]
            fn misses(&self, ray: TheirRay, triangles: &[RtTriangle]) -> bool {
                self.ray_traverse_miss(ray, |ray, place| triangles[place].intersect(ray))
            }
        }
    };
}
tree!(Bvh2, build_bvh2_from_tris);
tree!(CwBvh, build_cwbvh_from_tris);

impl<T: Tree> Obvhs<T> {
    /// Builds a tree of all triangles, with the threads of the current pool.
    pub fn build(surfaces: &[Surface]) -> Built<Self> {
        let start = Instant::now();
        let all = || surfaces.iter().flat_map(Surface::triangles);
        let corners: Vec<Triangle> =
            all().map(|(.., [v0, v1, v2])| Triangle { v0: v0.into(), v1: v1.into(), v2: v2.into() }).collect();
        let tree = T::build(&corners);
        let own: Vec<[u32; 2]> = all().map(|(instance, number, _)| [instance, number]).collect();
        let order = tree.order();
        let triangles: Vec<RtTriangle> = order.iter().map(|&place| (&corners[place as usize]).into()).collect();
        let numbers: Vec<[u32; 2]> = order.iter().map(|&place| own[place as usize]).collect();
        let bytes = (tree.node_bytes() + size_of_val(triangles.as_slice()) + size_of_val(numbers.as_slice())) as u64;
        Built { peer: Self { tree, triangles, numbers }, seconds: start.elapsed().as_secs_f64(), bytes }
    }
}

impl<T: Tree> Peer for Obvhs<T> {
    #[inline]
    fn closest(&self, ray: &Ray) -> Hit {
        let (ray, mut hit) = (theirs(ray), RayHit::none());
        if !self.tree.traverse(ray, &mut hit, &self.triangles) {
            return Hit::MISS;
        }
        let place = hit.primitive_id as usize;
        let RtTriangle { v0, e1, e2, ng } = self.triangles[place];
        // The weights as its triangle test has them, which gives t alone.
        let crossed = ray.direction.cross(v0 - ray.origin);
        let inverse = 1.0 / (ng.x * ray.direction.x + ng.y * ray.direction.y + ng.z * ray.direction.z);
        let u = (crossed.x * e2.x + crossed.y * e2.y + crossed.z * e2.z) * inverse;
        let v = (crossed.x * e1.x + crossed.y * e1.y + crossed.z * e1.z) * inverse;
        let [instance, primitive] = self.numbers[place];
        Hit { t: hit.t, u, v, instance, primitive }
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        !self.tree.misses(theirs(ray), &self.triangles)
    }
}

#[inline(always)]
fn theirs(ray: &Ray) -> TheirRay {
    TheirRay::new(ray.origin.into(), ray.direction.into(), ray.t_min.max(0.0), ray.t_max)
}
