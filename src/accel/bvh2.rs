//! A binary tree over triangles.

use std::ops::ControlFlow;

use super::leaf::{self, LeafTriangle, TriangleTree, check_distinct};
use super::pair_tree::PairTree;
use super::{Params, TreeStats, TriangleAccelerator};
use crate::error::Result;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, TriangleMesh};
use crate::progress::Progress;

/// The most triangles in a leaf.
const MAX_LEAF: u32 = 4;

/// A binary tree with exact boxes; leaves are runs of triangles.
pub struct Bvh2 {
    tree: PairTree,
    triangles: Vec<LeafTriangle>,
}

impl TriangleTree for Bvh2 {
    #[inline(always)]
    fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        mut visit: impl FnMut(&[LeafTriangle]) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        self.tree.traverse(ray, near, far, |range| visit(&self.triangles[range]))
    }
}

impl TriangleAccelerator for Bvh2 {
    const NAME: &'static str = "bvh2";

    fn build(mesh: &TriangleMesh, params: &Params, progress: &dyn Progress) -> Result<Self> {
        let (topology, triangles) = leaf::build_topology(mesh, params, MAX_LEAF, progress)?;
        Ok(Self { tree: PairTree::new(&topology), triangles })
    }

    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit) {
        leaf::closest(self, ray, instance, best);
    }

    fn occluded(&self, ray: &PreparedRay) -> bool {
        leaf::occluded(self, ray)
    }

    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
        leaf::next_after(self, ray, instance, key, best);
    }

    fn stats(&self) -> TreeStats {
        self.tree.stats(self.triangles.len(), size_of_val(self.triangles.as_slice()))
    }

    fn validate(&self) -> std::result::Result<(), String> {
        check_distinct(&self.triangles)?;
        self.tree.validate(self.triangles.len(), |at| self.triangles[at].bounds())
    }

    fn bounds(&self) -> Bounds {
        self.tree.bounds()
    }
}
