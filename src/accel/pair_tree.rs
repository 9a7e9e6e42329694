//! A binary tree whose nodes hold the boxes of both their children, so that one cache line decides about two.

use std::ops::{ControlFlow, Range};

use super::stack::{self, Entry, Stack};
use super::stats::TreeStats;
use super::topology::{Node, Topology, half_area};
use crate::geometry::{Bounds, PreparedRay};

/// A node: the boxes of two children and where to find them. 64 bytes.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Pair {
    /// `planes[axis][side][child]`: side 0 is the lower plane.
    planes: [[[f32; 2]; 2]; 3],
    /// Per child its node number, or the first item of the leaf.
    first: [u32; 2],
    /// Per child the leaf's number of items; 0 for an inner node.
    count: [u32; 2],
}

impl Pair {
    pub(super) fn new(children: [Node; 2]) -> Self {
        let [a, b] = children.map(|child| child.bounds);
        let planes = std::array::from_fn(|axis| [[a.min[axis], b.min[axis]], [a.max[axis], b.max[axis]]]);
        Self { planes, first: children.map(|child| child.first), count: children.map(|child| child.count) }
    }

    fn bounds(&self, child: usize) -> Bounds {
        let corner = |side: usize| self.planes.map(|axis| axis[side][child]).into();
        Bounds { min: corner(0), max: corner(1) }
    }

    /// Where the ray enters and leaves the two boxes, cut to `[near, far]`: [`Bounds::interval`], two at a time.
    #[inline(always)]
    pub(super) fn intervals(&self, ray: &PreparedRay, near: f32, far: f32) -> [[f32; 2]; 2] {
        let (mut near, mut far) = ([near; 2], [far; 2]);
        for axis in 0..3 {
            let [lower, upper] = self.planes[axis];
            let (entry, exit) = if ray.is_negative(axis) { (upper, lower) } else { (lower, upper) };
            for child in 0..2 {
                let t_entry = (entry[child] - ray.origin[axis]) * ray.inverse[axis];
                let t_exit = (exit[child] - ray.origin[axis]) * ray.inverse_far[axis];
                near[child] = if t_entry > near[child] { t_entry } else { near[child] };
                far[child] = if t_exit < far[child] { t_exit } else { far[child] };
            }
        }
        [near, far]
    }
}

/// A binary tree over items that are somebody else's: triangles or boxes, in the order of the leaves.
#[derive(Debug, Clone)]
pub struct PairTree {
    /// The root first, depth first. Never empty: a tree without items has two empty children.
    nodes: Vec<Pair>,
    bounds: Bounds,
}

impl PairTree {
    /// Lays out a topology.
    pub fn new(topology: &Topology) -> Self {
        const NOTHING: Node = Node { bounds: Bounds::EMPTY, first: 0, count: 1 };
        let source = &topology.nodes;
        let root = source.first().copied().unwrap_or(NOTHING);
        if root.is_leaf() {
            // A box that is empty is never entered.
            return Self { nodes: vec![Pair::new([root, NOTHING])], bounds: root.bounds };
        }
        // Inner nodes keep their order, leaves go away: number the inner ones.
        let mut numbers = Vec::with_capacity(source.len());
        let mut inner = 0;
        for node in source {
            numbers.push(inner);
            inner += u32::from(!node.is_leaf());
        }
        let child = |number: usize| {
            let node = source[number];
            if node.is_leaf() { node } else { Node { first: numbers[number], ..node } }
        };
        let pair = |node: &Node| Pair::new([child(node.first as usize), child(node.first as usize + 1)]);
        Self { nodes: source.iter().filter(|node| !node.is_leaf()).map(pair).collect(), bounds: root.bounds }
    }

    /// The exact box around all items.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Visits every leaf whose box the ray crosses somewhere in `[near, far]`, the nearer child of a node first; for
    /// `visit` see [`stack::traverse`]. `compared` is told of how many boxes the ray is compared with.
    #[inline(always)]
    pub fn traverse(
        &self,
        ray: &PreparedRay,
        near: f32,
        far: f32,
        mut compared: impl FnMut(u32),
        visit: impl FnMut(Range<usize>) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        let expand = |number: u32, far: f32, stack: &mut Stack| {
            let node = &self.nodes[number as usize];
            let [entry, exit] = node.intervals(ray, near, far);
            compared(2);
            let child = |i: usize| Entry { near: entry[i], first: node.first[i], count: node.count[i] };
            match (entry[0] <= exit[0], entry[1] <= exit[1]) {
                (true, true) => {
                    let nearer = usize::from(entry[1] < entry[0]);
                    stack.push(child(1 - nearer));
                    Some(child(nearer))
                }
                (true, false) => Some(child(0)),
                (false, true) => Some(child(1)),
                (false, false) => None,
            }
        };
        stack::traverse(far, expand, visit)
    }

    /// Every leaf as (box, first, count), in no particular order.
    fn leaves(&self) -> impl Iterator<Item = (Bounds, u32, u32)> {
        self.nodes
            .iter()
            .flat_map(|node| [0, 1].map(|child| (node.bounds(child), node.first[child], node.count[child])))
            .filter(|(bounds, _, count)| *count > 0 && !bounds.is_empty())
    }

    /// Counts over `items` items of `item_bytes` bytes in all.
    pub fn stats(&self, items: usize, item_bytes: usize) -> TreeStats {
        let area = half_area(&self.bounds);
        let relative = |bounds: &Bounds| if area > 0.0 { half_area(bounds) / area } else { 1.0 };
        let mut stats = TreeStats {
            triangles: items as u64,
            nodes: self.nodes.len() as u64,
            node_bytes: size_of_val(self.nodes.as_slice()) as u64,
            leaf_bytes: item_bytes as u64,
            sah_cost: 1.0,
            ..TreeStats::default()
        };
        let mut pending = vec![(0, 1)];
        while let Some((number, depth)) = pending.pop() {
            let node: &Pair = &self.nodes[number as usize];
            stats.max_depth = stats.max_depth.max(depth);
            for child in [0, 1] {
                let bounds = node.bounds(child);
                match node.count[child] {
                    _ if bounds.is_empty() => {}
                    0 => {
                        stats.sah_cost += relative(&bounds);
                        pending.push((node.first[child], depth + 1));
                    }
                    count => {
                        stats.sah_cost += relative(&bounds) * f64::from(count);
                        stats.leaves += 1;
                    }
                }
            }
        }
        stats
    }

    /// Audits boxes and leaves; `item` gives the exact box of the item at a position.
    ///
    /// # Errors
    /// Describes the first violation.
    pub fn validate(&self, items: usize, item: impl Fn(usize) -> Bounds) -> Result<(), String> {
        let mut leaves: Vec<_> = self.leaves().map(|(_, first, count)| (first, count)).collect();
        super::leaf::check_partition(&mut leaves, items)?;
        let mut reached = 0;
        let mut pending = vec![(0, self.bounds)];
        while let Some((number, bounds)) = pending.pop() {
            reached += 1;
            let node = self.nodes.get(number as usize).ok_or(format!("node {number} is out of range"))?;
            for child in [0, 1] {
                let inside = node.bounds(child);
                if !bounds.contains(&inside) {
                    return Err(format!("child {child} of node {number} leaves its parent's box"));
                }
                if inside.is_empty() {
                    continue;
                }
                let first = node.first[child] as usize;
                if node.count[child] == 0 {
                    pending.push((node.first[child], inside));
                } else if !(first..first + node.count[child] as usize).all(|at| inside.contains(&item(at))) {
                    return Err(format!("an item of child {child} of node {number} leaves its box"));
                }
            }
            if reached > self.nodes.len() {
                break;
            }
        }
        let total = self.nodes.len();
        if reached == total { Ok(()) } else { Err(format!("{reached} visits reach {total} nodes")) }
    }
}
