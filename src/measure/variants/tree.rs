//! One binary tree and one traversal for every combination of triangle test and box test.
//!
//! The tree is the renderer's own topology; the traversal is the plainest there is, so that what differs between two
//! combinations is the tests alone. It is slower than the renderer's trees, which are measured beside it.

use std::cell::RefCell;
use std::sync::Arc;

use glam::Vec3;

use super::{BoxTest, TriangleTest};
use crate::accel::{Node, Params, Topology};
use crate::error::Result;
use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, Hit, Ray, TriangleHit, TriangleMesh};
use crate::progress::{Progress, Share};

/// Triangles in a leaf at most: as in the renderer's binary tree.
const MAX_LEAF: u32 = 4;

/// A topology over a mesh's live triangles, shared by all combinations.
pub struct Skeleton {
    /// With boxes around all that the renderer's triangle test may find.
    enlarged: Vec<Node>,
    /// The same with boxes around the corners.
    tight: Vec<Node>,
    corners: Vec<[Vec3; 3]>,
    primitives: Vec<u32>,
}

impl Skeleton {
    /// Builds the topology.
    ///
    /// # Errors
    /// A cancellation.
    pub fn build(mesh: &Arc<TriangleMesh>, params: &Params, progress: &dyn Progress) -> Result<Self> {
        let mut share = Share::new(progress, 0);
        let live: Vec<u32> = mesh.live_triangles().collect();
        let boxes: Vec<Bounds> = live.iter().map(|&number| hit_bounds(mesh.triangle(number))).collect();
        let topology = Topology::build(&boxes, params.preset, MAX_LEAF, &mut share)?;
        let primitives: Vec<u32> = topology.order.iter().map(|&at| live[at as usize]).collect();
        let corners: Vec<[Vec3; 3]> = primitives.iter().map(|&number| mesh.triangle(number)).collect();
        let tight = with_tight_boxes(&topology.nodes, &corners);
        Ok(Self { enlarged: topology.nodes, tight, corners, primitives })
    }

    /// The nodes with the boxes that a box test wants.
    fn nodes<B: BoxTest>(&self) -> &[Node] {
        if B::ENLARGED { &self.enlarged } else { &self.tight }
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds {
        self.enlarged.first().map_or(Bounds::EMPTY, |root| root.bounds)
    }
}

/// The nodes with boxes around the corners of what is below them, which are in the order of the leaves.
fn with_tight_boxes(nodes: &[Node], corners: &[[Vec3; 3]]) -> Vec<Node> {
    let mut nodes = nodes.to_vec();
    // Children come after their parent.
    for number in (0..nodes.len()).rev() {
        let Node { first, count, .. } = nodes[number];
        let (first, count) = (first as usize, count as usize);
        nodes[number].bounds = if count > 0 {
            let inside = corners[first..first + count].iter().map(|&corners| Bounds::of(corners));
            inside.fold(Bounds::EMPTY, |all, own| all.union(own))
        } else {
            nodes[first].bounds.union(nodes[first + 1].bounds)
        };
    }
    nodes
}

/// The tree with one combination of tests.
pub struct VariantTree<'a, T: TriangleTest, B: BoxTest> {
    skeleton: &'a Skeleton,
    test: T,
    triangles: Vec<T::Triangle>,
    boxes: std::marker::PhantomData<B>,
}

thread_local! {
    /// What is yet to be visited: kept between rays, so that no ray pays for it.
    static PENDING: RefCell<Vec<(f32, u32)>> = const { RefCell::new(Vec::new()) };
}

impl<'a, T: TriangleTest, B: BoxTest> VariantTree<'a, T, B> {
    /// Brings the triangles into the form that the test wants.
    pub fn new(skeleton: &'a Skeleton) -> Self {
        let test = T::new(&skeleton.bounds());
        let triangles = skeleton.corners.iter().map(|&corners| test.triangle(corners)).collect();
        Self { skeleton, test, triangles, boxes: std::marker::PhantomData }
    }

    /// Bytes of nodes, triangles and their numbers.
    pub fn bytes(&self) -> usize {
        size_of_val(self.skeleton.nodes::<B>())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.skeleton.primitives.as_slice())
    }

    /// The closest hit; of equally close ones that of the lowest number. `instance` is 0.
    pub fn closest(&self, ray: &Ray) -> Hit {
        let mut best = Hit::MISS;
        self.traverse(ray, |primitive, hit| {
            if hit.t < best.t || (hit.t == best.t && primitive < best.primitive) {
                best = Hit { t: hit.t, u: hit.u, v: hit.v, instance: 0, primitive };
            }
            Some(if best.t < ray.t_max { best.t } else { ray.t_max })
        });
        best
    }

    /// Whether anything is hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut blocked = false;
        self.traverse(ray, |_, _| {
            blocked = true;
            None
        });
        blocked
    }

    /// Calls `found` for every hit in leaves that the ray crosses; it returns the new end of the ray, or stops.
    #[inline(always)]
    fn traverse(&self, ray: &Ray, mut found: impl FnMut(u32, TriangleHit) -> Option<f32>) {
        let nodes = self.skeleton.nodes::<B>();
        if !ray.is_valid() || nodes.is_empty() {
            return;
        }
        let (for_boxes, for_triangles) = (B::ray(ray), self.test.ray(ray));
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        let mut far = ray.t_max;
        let root = B::interval(&for_boxes, &nodes[0].bounds, t_min, far);
        if root.is_empty() {
            return;
        }
        PENDING.with_borrow_mut(|pending| {
            pending.clear();
            pending.push((root.near, 0));
            while let Some((near, mut number)) = pending.pop() {
                if !(near <= far) {
                    continue;
                }
                // Go down to a leaf, the nearer child first.
                while !nodes[number as usize].is_leaf() {
                    let first = nodes[number as usize].first;
                    let [a, b] =
                        [first, first + 1].map(|n| B::interval(&for_boxes, &nodes[n as usize].bounds, t_min, far));
                    number = match (!a.is_empty(), !b.is_empty()) {
                        (true, true) if b.near < a.near => {
                            pending.push((a.near, first));
                            first + 1
                        }
                        (true, true) => {
                            pending.push((b.near, first + 1));
                            first
                        }
                        (true, false) => first,
                        (false, true) => first + 1,
                        (false, false) => break,
                    };
                }
                let node = &nodes[number as usize];
                if !node.is_leaf() {
                    continue;
                }
                for at in node.first as usize..(node.first + node.count) as usize {
                    if let Some(hit) = T::intersect(&for_triangles, &self.triangles[at]) {
                        match found(self.skeleton.primitives[at], hit) {
                            Some(end) => far = end,
                            None => return,
                        }
                    }
                }
            }
        });
    }
}
