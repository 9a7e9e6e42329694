//! A binary tree over triangles.

use std::ops::ControlFlow;

use super::TreeStats;
use super::leaf::LeafTriangle;
use super::pair_tree::PairTree;
use super::topology::Topology;
use super::triangle_tree::TriangleTree;
use crate::geometry::{Bounds, PreparedRay};

/// A binary tree with exact boxes; leaves are runs of triangles.
pub struct Bvh2 {
    tree: PairTree,
    triangles: Vec<LeafTriangle>,
}

impl TriangleTree for Bvh2 {
    const NAME: &'static str = "bvh2";
    const MAX_LEAF: u32 = 4;

    fn lay_out(topology: &Topology, triangles: Vec<LeafTriangle>) -> Self {
        Self { tree: PairTree::new(topology), triangles }
    }

    fn triangles(&self) -> &[LeafTriangle] {
        &self.triangles
    }

    #[inline(always)]
    fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        compared: impl FnMut(u32),
        mut visit: impl FnMut(&[LeafTriangle]) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        self.tree.traverse(ray, near, far, compared, |range| visit(&self.triangles[range]))
    }

    fn stats(&self) -> TreeStats {
        self.tree.stats(self.triangles.len(), size_of_val(self.triangles.as_slice()))
    }

    fn validate_nodes(&self) -> Result<(), String> {
        self.tree.validate(self.triangles.len(), |at| self.triangles[at].bounds())
    }

    fn bounds(&self) -> Bounds {
        self.tree.bounds()
    }
}
