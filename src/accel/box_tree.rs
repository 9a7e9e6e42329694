//! A binary tree over boxes: the top level over instances and bounded quadrics.

use std::ops::ControlFlow;

use super::pair_tree::PairTree;
use super::topology::Topology;
use super::{Params, TreeStats};
use crate::error::Result;
use crate::geometry::{Bounds, PreparedRay};
use crate::progress::{Progress, Share};

/// A tree over the world boxes of things that it knows by number only.
pub struct BoxTree {
    tree: PairTree,
    /// The boxes' numbers, in the order of the leaves.
    numbers: Vec<u32>,
}

impl BoxTree {
    /// Builds a tree over boxes; their positions are their numbers. Empty boxes are left out. Boxes count no steps.
    ///
    /// # Errors
    /// When `progress` says to stop.
    pub fn build(boxes: &[Bounds], params: &Params, progress: &dyn Progress) -> Result<Self> {
        let live: Vec<u32> = (0..boxes.len() as u32).filter(|&number| !boxes[number as usize].is_empty()).collect();
        let live_boxes: Vec<Bounds> = live.iter().map(|&number| boxes[number as usize]).collect();
        let topology = Topology::build(&live_boxes, params.preset, 1, &mut Share::new(progress, 0))?;
        let numbers = topology.order.iter().map(|&at| live[at as usize]).collect();
        let tree = Self { tree: PairTree::new(&topology), numbers };
        debug_assert_eq!(tree.validate(boxes), Ok(()), "the tree over boxes");
        Ok(tree)
    }

    /// Calls `visit` with the number of every box that the ray crosses somewhere in `[near, far]`, roughly front to
    /// back.
    ///
    /// `visit` returns the new `far`, no larger than before, or breaks off the whole traversal, which then returns
    /// `Break`. A box that is entered exactly at `far` is visited: what it holds may tie.
    #[inline]
    pub fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        visit: impl FnMut(u32) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        self.traverse_and_tell(ray, near, far, |_| {}, visit)
    }

    /// [`traverse`](Self::traverse) that tells `compared` of how many boxes of nodes the ray is compared with.
    #[inline]
    pub fn traverse_and_tell(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        compared: impl FnMut(u32),
        mut visit: impl FnMut(u32) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        let mut bound = far;
        self.tree.traverse(ray, near, far, compared, |range| {
            for &number in &self.numbers[range] {
                bound = visit(number)?;
            }
            ControlFlow::Continue(bound)
        })
    }

    /// The box around all boxes.
    pub fn bounds(&self) -> Bounds {
        self.tree.bounds()
    }

    /// Counts and sizes; what they call triangles are boxes here.
    pub fn stats(&self) -> TreeStats {
        self.tree.stats(self.numbers.len(), size_of_val(self.numbers.as_slice()))
    }

    /// Audits the tree against the boxes that it was built from: exact boxes, and every box that is not empty in
    /// exactly one leaf.
    ///
    /// # Errors
    /// A description of the first violation.
    pub fn validate(&self, boxes: &[Bounds]) -> std::result::Result<(), String> {
        let mut numbers = self.numbers.clone();
        numbers.sort_unstable();
        if !numbers.into_iter().eq((0..boxes.len() as u32).filter(|&number| !boxes[number as usize].is_empty())) {
            return Err("the leaves do not hold every box once".into());
        }
        self.tree.validate(self.numbers.len(), |at| boxes[self.numbers[at] as usize])
    }
}
