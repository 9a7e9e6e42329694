//! The fastest structure: an 8-wide tree with exact boxes, leaves of up to 8 triangles met at once, and SIMD chosen at run
//! time.
//!
//! ```text
//! Chunks -> Topology (ploc) -> Collapse -> Node, Leaves -> Tree -> simd::{single, packet, batch}
//! ```

mod build;
mod chunks;
mod collapse;
mod count;
mod kept;
mod leaf;
mod node;
pub mod simd;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use collapse::MOST_DEPTH;
use leaf::Leaves;
use node::{Child, Node};
use simd::{Closest, NextAfter, Occluded};

use super::leaf::{check_distinct, check_partition};
use super::topology::half_area;
use super::{Counting, KeptTree, Params, Tests, TreeArrays, TreeStats, TriangleAccelerator};
use crate::array::Array;
use crate::error::{Error, Result};
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, Ray, TriangleMesh};
use crate::math::simd::Level;
use crate::progress::Progress;

/// Nodes and leaves. Only ever made by [`build`], or by [`kept`] and tests, which check them, so that children are in range.
#[derive(Debug)]
pub struct Tree {
    nodes: Array<Node>,
    leaves: Leaves,
    root: Child,
    /// Whether a search waits for memory at every step, so that scattered rays had better take turns.
    is_large: bool,
}

impl Tree {
    /// Bytes of a tree that does not stay in the caches: turns made scattered rays 1.37 times as fast in 208 MB, and 0.95 times in 44 MB.
    const LARGE: usize = 64 << 20;

    fn new(nodes: Array<Node>, leaves: Leaves, root: Child) -> Self {
        let is_large = nodes.bytes() + leaves.bytes_read() >= Self::LARGE;
        Self { nodes, leaves, root, is_large }
    }
}

/// An 8-wide tree with exact boxes, whose leaves have copies of their triangles or, compact, only their numbers in the mesh,
/// which the tree then shares.
pub struct WideTree<const COMPACT: bool> {
    tree: Tree,
    bounds: Bounds,
    level: Level,
}

/// The fastest.
pub type Wide = WideTree<false>;

/// The smallest: a third of the memory, beside the mesh.
pub type Compact = WideTree<true>;

impl<const COMPACT: bool> WideTree<COMPACT> {
    /// The same tree searched with another instruction set.
    #[cfg(test)]
    fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// The same tree taken for a large one.
    #[cfg(test)]
    fn with_turns(mut self) -> Self {
        self.tree.is_large = true;
        self
    }
}

impl<const COMPACT: bool> TriangleAccelerator for WideTree<COMPACT> {
    const NAME: &'static str = if COMPACT { "compact" } else { "wide" };

    fn build(mesh: &Arc<TriangleMesh>, params: &Params, progress: &dyn Progress) -> Result<Self> {
        if mesh.live_count() >= Child::MOST {
            let message =
                format!("mesh `{}` has {} triangles; a wide tree holds {}", mesh.name, mesh.live_count(), Child::MOST);
            return Err(Error::limit(message));
        }
        let (tree, bounds) = build::build(mesh, COMPACT, params.preset, progress)?;
        let wide = Self { tree, bounds, level: Level::chosen() };
        debug_assert_eq!(wide.validate(), Ok(()), "{}", Self::NAME);
        Ok(wide)
    }

    #[inline(always)]
    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit) {
        simd::search(self.level, &self.tree, ray, &mut Closest { instance, best });
    }

    #[inline(always)]
    fn closest_alone(&self, ray: &Ray) -> Hit {
        let mut best = Hit::MISS;
        simd::search_alone(self.level, &self.tree, ray, &mut Closest { instance: 0, best: &mut best });
        best
    }

    #[inline(always)]
    fn occluded_alone(&self, ray: &Ray) -> bool {
        let mut query = Occluded { found: false };
        simd::search_alone(self.level, &self.tree, ray, &mut query);
        query.found
    }

    #[inline(always)]
    fn occluded(&self, ray: &PreparedRay) -> bool {
        let mut query = Occluded { found: false };
        simd::search(self.level, &self.tree, ray, &mut query);
        query.found
    }

    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit) {
        simd::search(self.level, &self.tree, ray, &mut NextAfter { key, closest: Closest { instance, best } });
    }

    #[inline(always)]
    fn closest_batch(&self, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
        simd::closest_batch(self.level, &self.tree, rays, clips, instance, best);
    }

    #[inline(always)]
    fn occluded_batch(&self, rays: &[Ray], clips: &[Interval], occluded: &mut [bool]) {
        simd::occluded_batch(self.level, &self.tree, rays, clips, occluded);
    }

    fn stats(&self) -> TreeStats {
        let area = half_area(&self.bounds);
        let relative = |bounds: &Bounds| if area > 0.0 { half_area(bounds) / area } else { 1.0 };
        let mut stats = TreeStats {
            triangles: self.tree.leaves.len() as u64,
            nodes: self.tree.nodes.len() as u64,
            node_bytes: self.tree.nodes.bytes() as u64,
            leaf_bytes: self.tree.leaves.bytes() as u64,
            sah_cost: if self.tree.nodes.is_empty() { 0.0 } else { 1.0 },
            ..TreeStats::default()
        };
        let mut pending = vec![(self.tree.root, self.bounds, 0)];
        while let Some((child, bounds, depth)) = pending.pop() {
            if child == Child::NONE {
                continue;
            }
            if child.is_leaf() {
                stats.leaves += 1;
                stats.sah_cost += relative(&bounds) * child.count() as f64;
                continue;
            }
            stats.sah_cost += if depth > 0 { relative(&bounds) } else { 0.0 };
            stats.max_depth = stats.max_depth.max(depth + 1);
            let node = &self.tree.nodes[child.number()];
            pending.extend(node.children().map(|(child, bounds)| (child, bounds, depth + 1)));
        }
        stats
    }

    fn validate(&self) -> std::result::Result<(), String> {
        let mut triangles = Vec::with_capacity(self.tree.leaves.len());
        let mut leaves = Vec::new();
        let mut parents = vec![0u32; self.tree.nodes.len()];
        let mut pending = vec![(self.tree.root, self.bounds, 0)];
        while let Some((child, bounds, depth)) = pending.pop() {
            if child == Child::NONE {
                continue;
            }
            if child.is_leaf() {
                leaves.push((child.first() as u32, child.count() as u32));
                if child.first() + child.count() > self.tree.leaves.len() {
                    return Err(format!("the leaf at {} is out of range", child.first()));
                }
                for triangle in self.tree.leaves.triangles(child) {
                    if !bounds.contains(&triangle.bounds()) {
                        return Err(format!("the box around triangle {} is too small", triangle.primitive));
                    }
                    triangles.push(triangle);
                }
                continue;
            }
            let Some(node) = self.tree.nodes.get(child.number()) else {
                return Err(format!("node {} is out of range", child.number()));
            };
            parents[child.number()] += 1;
            if depth >= MOST_DEPTH || parents[child.number()] > 1 {
                return Err(format!("node {} at depth {depth} is too deep or has two parents", child.number()));
            }
            if let Some((_, inner)) = node.children().find(|(_, inner)| !bounds.contains(inner)) {
                return Err(format!("node {} has a child {inner:?} beyond its box {bounds:?}", child.number()));
            }
            pending.extend(node.children().map(|(child, bounds)| (child, bounds, depth + 1)));
        }
        if parents.contains(&0) {
            return Err("a node has no parent".into());
        }
        check_partition(&mut leaves, self.tree.leaves.len())?;
        check_distinct(&triangles)
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }

    const CAN_BE_KEPT: bool = true;

    fn arrays(&self) -> Option<TreeArrays<'_>> {
        Some(TreeArrays {
            nodes: bytemuck::cast_slice(&self.tree.nodes),
            leaves: bytemuck::cast_slice(self.tree.leaves.words()),
            root: self.tree.root.0,
            bounds: self.bounds,
        })
    }

    fn restore(mesh: &Arc<TriangleMesh>, kept: &KeptTree) -> std::result::Result<Self, String> {
        let tree = kept::restore(mesh, COMPACT, kept)?;
        Ok(Self { tree, bounds: kept.bounds, level: Level::chosen() })
    }
}

impl<const COMPACT: bool> Counting for WideTree<COMPACT> {
    fn count(&self, ray: &PreparedRay, any: bool, best: &mut Hit, tests: &mut Tests) {
        count::count(&self.tree, ray, any, best, tests);
    }
}
