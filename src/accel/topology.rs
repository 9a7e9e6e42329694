//! Which boxes belong together: a plain binary tree from which every structure makes its own layout.

use super::Preset;
use super::ploc;
use crate::error::Result;
use crate::geometry::Bounds;
use crate::progress::Share;

/// A node: a leaf with items, or two children.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// The exact box around everything below.
    pub bounds: Bounds,
    /// For a leaf the position of its first item in [`Topology::order`]; else the number of the first child, which the
    /// second follows.
    pub first: u32,
    /// A leaf's number of items; 0 for an inner node.
    pub count: u32,
}

impl Node {
    /// Whether this is a leaf.
    pub fn is_leaf(&self) -> bool {
        self.count > 0
    }
}

/// A binary tree over boxes.
#[derive(Debug, Clone, Default)]
pub struct Topology {
    /// The root first, children after their parent, depth first; empty if there are no boxes.
    pub nodes: Vec<Node>,
    /// The positions of the boxes, in the order of the leaves.
    pub order: Vec<u32>,
}

impl Topology {
    /// Builds a tree over boxes that are not empty, with at most `max_leaf` of them a leaf. Reports all but the end of
    /// `share`, which is for the layout made from it.
    ///
    /// # Errors
    /// When `share` says to stop.
    pub fn build(boxes: &[Bounds], preset: Preset, max_leaf: u32, share: &mut Share) -> Result<Self> {
        let (source, source_order) = ploc::build(boxes, preset, max_leaf, share)?;
        if source.is_empty() {
            return Ok(Self::default());
        }

        // Copy the tree depth first: a subtree's nodes and leaf items end up side by side.
        let unset = Node { bounds: Bounds::EMPTY, first: 0, count: 0 };
        let mut nodes = Vec::with_capacity(source.len());
        let mut order = Vec::with_capacity(boxes.len());
        nodes.push(unset);
        let mut pending = vec![(0, 0)];
        while let Some((from, to)) = pending.pop() {
            let node = &source[from];
            if node.is_leaf() {
                let items = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                nodes[to] = Node { first: order.len() as u32, count: node.prim_count, ..unset };
                order.extend_from_slice(&source_order[items]);
            } else {
                let (child_from, child_to) = (node.first_index as usize, nodes.len());
                nodes[to] = Node { first: child_to as u32, ..unset };
                nodes.extend([unset; 2]);
                pending.extend([(child_from + 1, child_to + 1), (child_from, child_to)]);
            }
        }

        // Children come after their parent, so one pass from the end makes every box exact.
        for number in (0..nodes.len()).rev() {
            let node = nodes[number];
            let first = node.first as usize;
            nodes[number].bounds = if node.is_leaf() {
                let items = &order[first..first + node.count as usize];
                items.iter().fold(Bounds::EMPTY, |bounds, &item| bounds.union(boxes[item as usize]))
            } else {
                nodes[first].bounds.union(nodes[first + 1].bounds)
            };
        }
        Ok(Self { nodes, order })
    }
}

/// Half the surface of a box, f64 so that it neither overflows nor vanishes.
pub fn half_area(bounds: &Bounds) -> f64 {
    let size = bounds.size();
    size.x * size.y + size.y * size.z + size.z * size.x
}
