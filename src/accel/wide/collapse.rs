//! Which nodes of a binary tree become nodes of a wide one, and which subtrees become leaves: the choice that costs rays
//! least, found by dynamic programming.
//!
//! Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017, section 3.1.
//! `cost(n, i)` is the least expected cost of what is below binary node n if at most i places of a wide node are spent on
//! it. One deviation: deep ends of degenerate trees are cut in eight equal parts instead, so that the depth is bounded.

use super::leaf::GrowingLeaves;
use super::node::{Child, Node, WIDTH};
use crate::accel::leaf::LeafTriangle;
use crate::accel::topology::{self, Topology, half_area};
use crate::geometry::Bounds;

/// What a ray pays for a leaf, in visits of a node, whatever it holds. Rays on the bunny do not mind much: from 0.3 to 1 here and
/// from 0 to 0.1 for a triangle all are within 3 %, but fuller leaves take less memory.
const LEAF_COST: f32 = 0.8;

/// What it pays for each triangle in it.
const TRIANGLE_COST: f32 = 0.02;

/// At this depth subtrees begin to be cut evenly.
pub const EVEN_DEPTH: usize = 36;

/// The deepest node: [`EVEN_DEPTH`] and what an even tree over 2^28 triangles takes.
pub const MOST_DEPTH: usize = EVEN_DEPTH + 10;

/// The costs of a binary node for 1 to 7 places.
type Costs = [f32; WIDTH - 1];

/// A wide tree being made of a binary one over single triangles.
pub struct Collapse<'a> {
    source: &'a [topology::Node],
    /// The triangles in the order of the binary leaves.
    triangles: &'a [LeafTriangle],
    costs: Vec<Costs>,
    /// Per binary node the triangles below, as places in `triangles`.
    ranges: Vec<(u32, u32)>,
    /// The finished nodes, the root first.
    pub nodes: Vec<Node>,
    /// The finished leaves.
    pub leaves: GrowingLeaves,
}

impl<'a> Collapse<'a> {
    /// Finds the costs. The topology must have leaves of one triangle; the wide tree's will go to `leaves`, which are empty.
    pub fn new(topology: &'a Topology, triangles: &'a [LeafTriangle], leaves: GrowingLeaves) -> Self {
        let source = topology.nodes.as_slice();
        let mut costs = vec![[0.0; WIDTH - 1]; source.len()];
        let mut ranges = vec![(0, 0); source.len()];
        for (number, node) in source.iter().enumerate().rev() {
            let area = area(source, number);
            let first = node.first as usize;
            if node.is_leaf() {
                ranges[number] = (node.first, node.first + node.count);
                costs[number] = [leaf_cost(area, ranges[number]); WIDTH - 1];
                continue;
            }
            ranges[number] = (ranges[first].0, ranges[first + 1].1);
            let (left, right) = (&costs[first], &costs[first + 1]);
            let shared = |places: usize| shared(left, right, places).0;
            let mut cost = [0.0; WIDTH - 1];
            cost[0] = (area + shared(WIDTH)).min(leaf_cost(area, ranges[number]));
            for places in 2..WIDTH {
                cost[places - 1] = shared(places).min(cost[places - 2]);
            }
            costs[number] = cost;
        }
        Self { source, triangles, costs, ranges, nodes: Vec::new(), leaves }
    }

    /// Makes the nodes and leaves, depth first, and returns the root, which is at `depth` of what it will be part of.
    pub fn run(&mut self, depth: usize) -> Child {
        if self.source.is_empty() {
            return Child::NONE;
        }
        let mut pending = Vec::new();
        let child = self.child(0, depth, &mut pending);
        while let Some((at, part, depth)) = pending.pop() {
            let parts = self.split(&part, depth);
            let opened = pending.len();
            for (place, part) in parts.into_iter().enumerate() {
                let bounds = self.bounds(&part);
                let child = match part {
                    Part::Subtree(number) => self.child(number, depth + 1, &mut pending),
                    Part::Range(first, end) => self.range(first, end, depth + 1, &mut pending),
                };
                self.nodes[at].set(place, &bounds, child);
            }
            pending[opened..].reverse();
        }
        child
    }

    /// A leaf, or a node whose children are left for later.
    fn child(&mut self, number: usize, depth: usize, pending: &mut Vec<(usize, Part, usize)>) -> Child {
        let (first, end) = self.ranges[number];
        let is_leaf = self.source[number].is_leaf() || {
            leaf_cost(area(self.source, number), (first, end)) <= self.costs[number][0]
        };
        if is_leaf || depth >= EVEN_DEPTH {
            return self.range(first, end, depth, pending);
        }
        self.nodes.push(Node::EMPTY);
        pending.push((self.nodes.len() - 1, Part::Subtree(number), depth));
        Child::inner(self.nodes.len() - 1)
    }

    fn range(&mut self, first: u32, end: u32, depth: usize, pending: &mut Vec<(usize, Part, usize)>) -> Child {
        let count = (end - first) as usize;
        if count <= WIDTH {
            return Child::leaf(self.leaves.push(&self.triangles[first as usize..end as usize]), count);
        }
        self.nodes.push(Node::EMPTY);
        pending.push((self.nodes.len() - 1, Part::Range(first, end), depth));
        Child::inner(self.nodes.len() - 1)
    }

    /// What a node's places are spent on.
    fn split(&self, part: &Part, depth: usize) -> Vec<Part> {
        debug_assert!(depth < MOST_DEPTH);
        let mut parts = Vec::with_capacity(WIDTH);
        match *part {
            Part::Subtree(number) => self.spend(number, WIDTH, true, &mut parts),
            Part::Range(first, end) => {
                let cut = |i: usize| first + ((end - first) as usize * i / WIDTH) as u32;
                parts.extend((0..WIDTH).map(|i| Part::Range(cut(i), cut(i + 1))));
            }
        }
        parts
    }

    /// Spends places on what is below a binary node, on its children if it `opens`.
    fn spend(&self, number: usize, places: usize, opens: bool, parts: &mut Vec<Part>) {
        let mut places = places;
        if !opens {
            let costs = &self.costs[number];
            while places > 1 && costs[places - 1] == costs[places - 2] {
                places -= 1;
            }
            if places == 1 {
                parts.push(Part::Subtree(number));
                return;
            }
        }
        let first = self.source[number].first as usize;
        let (_, left) = shared(&self.costs[first], &self.costs[first + 1], places);
        self.spend(first, left, false, parts);
        self.spend(first + 1, places - left, false, parts);
    }

    fn bounds(&self, part: &Part) -> Bounds {
        match *part {
            Part::Subtree(number) => self.source[number].bounds,
            Part::Range(first, end) => {
                let run = &self.triangles[first as usize..end as usize];
                run.iter().fold(Bounds::EMPTY, |bounds, triangle| bounds.union(triangle.bounds()))
            }
        }
    }
}

/// What a node is made of.
enum Part {
    /// A node of the binary tree.
    Subtree(usize),
    /// Triangles, without regard to the binary tree.
    Range(u32, u32),
}

/// The surface of a binary node's box in parts of the root's: how likely a random line through the root's meets it.
fn area(source: &[topology::Node], number: usize) -> f32 {
    let root = half_area(&source[0].bounds).max(f64::MIN_POSITIVE);
    (half_area(&source[number].bounds) / root) as f32
}

/// The cost of all triangles below as one leaf; infinite if they are too many.
fn leaf_cost(area: f32, (first, end): (u32, u32)) -> f32 {
    let count = end - first;
    if count as usize <= WIDTH { area * (LEAF_COST + TRIANGLE_COST * count as f32) } else { f32::INFINITY }
}

/// The least cost of two subtrees that share some places, and how many of them the first gets.
#[inline(always)]
fn shared(left: &Costs, right: &Costs, places: usize) -> (f32, usize) {
    let cost = |k: usize| left[k - 1] + right[places - k - 1];
    (1..places).map(|k| (cost(k), k)).fold((f32::INFINITY, 1), |best, one| if one.0 < best.0 { one } else { best })
}
