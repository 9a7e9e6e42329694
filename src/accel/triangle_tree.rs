//! What all trees with triangles in their leaves share: how they are built, and the three questions asked of them.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::leaf::{LeafTriangle, check_distinct};
use super::topology::Topology;
use super::{Counting, Params, Tests, TreeStats, TriangleAccelerator};
use crate::error::Result;
use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, TriangleMesh};
use crate::progress::{Progress, Share};

/// A tree with triangles in its leaves; being one makes it a [`TriangleAccelerator`].
pub trait TriangleTree: Sized + Send + Sync {
    /// What the structure is called on the command line and in reports.
    const NAME: &'static str;

    /// The most triangles in a leaf.
    const MAX_LEAF: u32;

    /// Makes the structure's own layout of a topology; `triangles` are in the order of its leaves.
    fn lay_out(topology: &Topology, triangles: Vec<LeafTriangle>) -> Self;

    /// The triangles in the order of the structure's own leaves.
    fn triangles(&self) -> &[LeafTriangle];

    /// Visits every leaf whose box the ray crosses somewhere in `[near, far]`, roughly front to back.
    ///
    /// `compared` is told of how many boxes the ray is compared with. `visit` returns the new `far` after each leaf, no larger than
    /// before, or breaks off the whole traversal.
    fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        compared: impl FnMut(u32),
        visit: impl FnMut(&[LeafTriangle]) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()>;

    /// See [`TriangleAccelerator::stats`].
    fn stats(&self) -> TreeStats;

    /// Audits nodes and leaves; that no triangle is held twice is known already.
    ///
    /// # Errors
    /// A description of the first violation.
    fn validate_nodes(&self) -> std::result::Result<(), String>;

    /// The exact box around all boxes of triangles.
    fn bounds(&self) -> Bounds;
}

impl<T: TriangleTree> TriangleAccelerator for T {
    const NAME: &'static str = <T as TriangleTree>::NAME;

    fn build(mesh: &Arc<TriangleMesh>, params: &Params, progress: &dyn Progress) -> Result<Self> {
        progress.check()?;
        let mut share = Share::new(progress, mesh.live_count() as u64);
        let live: Vec<u32> = mesh.live_triangles().collect();
        let boxes: Vec<Bounds> = live.iter().map(|&number| hit_bounds(mesh.triangle(number))).collect();
        let topology = Topology::build(&boxes, params.preset, T::MAX_LEAF, &mut share)?;
        drop(boxes);
        let triangles = topology.order.iter().map(|&at| LeafTriangle::new(mesh, live[at as usize])).collect();
        let tree = T::lay_out(&topology, triangles);
        share.reach(100)?;
        debug_assert_eq!(tree.validate(), Ok(()), "{}", <T as TriangleTree>::NAME);
        Ok(tree)
    }

    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit) {
        let _ = self.traverse(
            ray,
            ray.lower_bound(ray.t_min),
            ray.far_bound(best.t),
            |_| {},
            |triangles| {
                for triangle in triangles {
                    if let Some(hit) = triangle.intersect(ray, instance)
                        && hit.key().is_before(&best.key())
                    {
                        *best = hit;
                    }
                }
                ControlFlow::Continue(ray.far_bound(best.t))
            },
        );
    }

    fn occluded(&self, ray: &PreparedRay) -> bool {
        let far = ray.upper_bound(ray.t_max);
        let search = self.traverse(
            ray,
            ray.lower_bound(ray.t_min),
            far,
            |_| {},
            |triangles| {
                let blocked = triangles.iter().any(|triangle| triangle.intersect(ray, 0).is_some());
                if blocked { ControlFlow::Break(()) } else { ControlFlow::Continue(far) }
            },
        );
        search.is_break()
    }

    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
        let near = ray.lower_bound(ray.t_min).max(ray.lower_bound(key.t));
        let _ = self.traverse(
            ray,
            near,
            ray.far_bound(best.t),
            |_| {},
            |triangles| {
                for triangle in triangles {
                    if let Some(hit) = triangle.intersect(ray, instance)
                        && key.is_before(&hit.key())
                        && hit.key().is_before(&best.key())
                    {
                        *best = hit;
                    }
                }
                ControlFlow::Continue(ray.far_bound(best.t))
            },
        );
    }

    fn stats(&self) -> TreeStats {
        TriangleTree::stats(self)
    }

    fn validate(&self) -> std::result::Result<(), String> {
        check_distinct(self.triangles())?;
        self.validate_nodes()
    }

    fn bounds(&self) -> Bounds {
        TriangleTree::bounds(self)
    }
}

impl<T: TriangleTree> Counting for T {
    fn count(&self, ray: &PreparedRay, any: bool, best: &mut Hit, tests: &mut Tests) {
        let far = |best: &Hit| if any { ray.upper_bound(ray.t_max) } else { ray.far_bound(best.t) };
        let (mut boxes, mut met) = (0, 0);
        let _ = self.traverse(
            ray,
            ray.lower_bound(ray.t_min),
            far(best),
            |more| boxes += u64::from(more),
            |triangles| {
                for triangle in triangles {
                    met += 1;
                    if let Some(hit) = triangle.intersect(ray, 0).filter(|hit| hit.key().is_before(&best.key())) {
                        *best = hit;
                        if any {
                            return ControlFlow::Break(());
                        }
                    }
                }
                ControlFlow::Continue(far(best))
            },
        );
        tests.boxes += boxes;
        tests.triangles += met;
    }
}
