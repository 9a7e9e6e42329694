//! An 8-wide tree whose nodes hold their children's boxes in 8 bits a plane.
//!
//! Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017. Three
//! deviations: planes are restored to f32 before the box test instead of folding the scale into the ray, since only
//! then is the test the monotone one that all structures share; quantised boxes are rounded outward *as restored*, so
//! that they contain the exact ones; children are visited by distance instead of by octant.

use std::ops::ControlFlow;

use super::TreeStats;
use super::leaf::{LeafTriangle, check_partition};
use super::stack::{self, Entry, Stack};
use super::topology::{Topology, half_area};
use super::triangle_tree::TriangleTree;
use crate::geometry::{Bounds, PreparedRay};

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Marks a child's tag as an inner node's.
const INNER: u8 = 0x80;

/// A node. 80 bytes.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct WideNode {
    /// The lower corner of the grid.
    origin: [f32; 3],
    /// Per axis the biased exponent of the grid's step, a power of two.
    exponents: [u8; 3],
    /// How many of the children exist; they are the first ones.
    count: u8,
    /// The number of the first inner child; the others follow.
    first_node: u32,
    /// The position of the first triangle of all leaf children; they are side by side.
    first_triangle: u32,
    /// Per child: [`INNER`] plus its place among the inner children, or 4 times the place of its first triangle among
    /// the node's triangles, plus its number of triangles less 1.
    tags: [u8; WIDTH],
    /// `planes[axis][side][child]` in steps from the origin; side 0 is the lower plane.
    planes: [[[u8; WIDTH]; 2]; 3],
}

/// The grid line `steps` steps from `origin`. Not decreasing in `steps`: the product is exact and one rounding follows.
#[inline(always)]
fn restore(origin: f32, step: f32, steps: u8) -> f32 {
    origin + f32::from(steps) * step
}

/// The power of two with a biased exponent from 1 to 254.
#[inline(always)]
fn power_of_two(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

impl WideNode {
    /// A node whose grid covers `bounds`, without children.
    pub(super) fn covering(bounds: &Bounds) -> Self {
        let exponents = std::array::from_fn(|axis| {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            // A 255th of the size, rounded down to a power of two, is at most one doubling too small.
            let guess = (f64::from(max) - f64::from(min)) / 255.0;
            let mut exponent = ((guess as f32).to_bits() >> 23).clamp(1, 253) as u8;
            while restore(min, power_of_two(exponent), u8::MAX) < max && exponent < 254 {
                exponent += 1;
            }
            exponent
        });
        Self {
            origin: bounds.min.to_array(),
            exponents,
            count: 0,
            first_node: 0,
            first_triangle: 0,
            tags: [0; WIDTH],
            planes: [[[0; WIDTH]; 2]; 3],
        }
    }

    /// Adds a child whose box lies within the grid.
    pub(super) fn push(&mut self, bounds: &Bounds, tag: u8) {
        let child = usize::from(self.count);
        for axis in 0..3 {
            let (origin, step) = (self.origin[axis], power_of_two(self.exponents[axis]));
            let steps = |plane: f32| ((f64::from(plane) - f64::from(origin)) / f64::from(step)).clamp(0.0, 255.0);
            // Correct the real quotient by what restoring it gives: the sum is rounded.
            let mut lower = libm::floor(steps(bounds.min[axis])) as u8;
            while lower > 0 && restore(origin, step, lower) > bounds.min[axis] {
                lower -= 1;
            }
            let mut upper = libm::ceil(steps(bounds.max[axis])) as u8;
            while upper < u8::MAX && restore(origin, step, upper) < bounds.max[axis] {
                upper += 1;
            }
            self.planes[axis][0][child] = lower;
            self.planes[axis][1][child] = upper;
        }
        self.tags[child] = tag;
        self.count += 1;
    }

    /// A child's box as the traversal sees it.
    pub(super) fn bounds(&self, child: usize) -> Bounds {
        let corner = |side: usize| {
            let plane = |axis: usize| {
                restore(self.origin[axis], power_of_two(self.exponents[axis]), self.planes[axis][side][child])
            };
            glam::Vec3::new(plane(0), plane(1), plane(2))
        };
        Bounds { min: corner(0), max: corner(1) }
    }

    /// The inner node or leaf behind a child, entered at `near`.
    #[inline(always)]
    fn entry(&self, child: usize, near: f32) -> Entry {
        let tag = u32::from(self.tags[child]);
        if tag & u32::from(INNER) != 0 {
            Entry { near, first: self.first_node + (tag & 0x7f), count: 0 }
        } else {
            Entry { near, first: self.first_triangle + (tag >> 2), count: (tag & 3) + 1 }
        }
    }

    /// Where the ray enters and leaves the children's boxes, cut to `[near, far]`: [`Bounds::interval`], eight at a
    /// time.
    #[inline(always)]
    pub(super) fn intervals(&self, ray: &PreparedRay, near: f32, far: f32) -> [[f32; WIDTH]; 2] {
        let (mut near, mut far) = ([near; WIDTH], [far; WIDTH]);
        for axis in 0..3 {
            let (origin, step) = (self.origin[axis], power_of_two(self.exponents[axis]));
            let [lower, upper] = &self.planes[axis];
            let (entry, exit) = if ray.is_negative(axis) { (upper, lower) } else { (lower, upper) };
            for child in 0..WIDTH {
                let t_entry = (restore(origin, step, entry[child]) - ray.origin[axis]) * ray.inverse[axis];
                near[child] = if t_entry > near[child] { t_entry } else { near[child] };
            }
            for child in 0..WIDTH {
                let t_exit = (restore(origin, step, exit[child]) - ray.origin[axis]) * ray.inverse_far[axis];
                far[child] = if t_exit < far[child] { t_exit } else { far[child] };
            }
        }
        [near, far]
    }
}

/// An 8-wide tree with quantised boxes; leaves are runs of at most 4 triangles.
pub struct CwBvh {
    /// The root first; empty for an empty mesh.
    nodes: Vec<WideNode>,
    triangles: Vec<LeafTriangle>,
    bounds: Bounds,
}

impl TriangleTree for CwBvh {
    const NAME: &'static str = "cwbvh";
    // A child's tag has 2 bits for it.
    const MAX_LEAF: u32 = 4;

    /// Merges the nodes of a binary tree into wide ones, opening the child with the largest surface first.
    fn lay_out(topology: &Topology, in_order: Vec<LeafTriangle>) -> Self {
        let source = &topology.nodes;
        let Some(root) = source.first() else {
            return Self { nodes: Vec::new(), triangles: Vec::new(), bounds: Bounds::EMPTY };
        };
        let mut nodes = vec![WideNode::covering(&root.bounds)];
        let mut triangles = Vec::with_capacity(in_order.len());
        let mut pending = vec![(0usize, 0usize)];
        while let Some((from, to)) = pending.pop() {
            let mut children = vec![from];
            while children.len() < WIDTH {
                let area = |child: &usize| half_area(&source[*child].bounds);
                let inner = children.iter().enumerate().filter(|(_, child)| !source[**child].is_leaf());
                let Some((at, _)) = inner.max_by(|a, b| area(a.1).total_cmp(&area(b.1))) else { break };
                let first = source[children[at]].first as usize;
                children[at] = first;
                children.push(first + 1);
            }

            let mut node = WideNode::covering(&source[from].bounds);
            node.first_node = nodes.len() as u32;
            node.first_triangle = triangles.len() as u32;
            let opened = pending.len();
            for child in children {
                let bounds = source[child].bounds;
                if source[child].is_leaf() {
                    let (first, count) = (source[child].first as usize, source[child].count as usize);
                    let place = (triangles.len() as u32 - node.first_triangle) as u8;
                    node.push(&bounds, place << 2 | (count as u8 - 1));
                    triangles.extend_from_slice(&in_order[first..first + count]);
                } else {
                    node.push(&bounds, INNER | (pending.len() - opened) as u8);
                    pending.push((child, nodes.len()));
                    nodes.push(WideNode::covering(&bounds));
                }
            }
            nodes[to] = node;
        }
        Self { nodes, triangles, bounds: root.bounds }
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
        mut compared: impl FnMut(u32),
        mut visit: impl FnMut(&[LeafTriangle]) -> ControlFlow<(), f32>,
    ) -> ControlFlow<()> {
        if self.nodes.is_empty() {
            return ControlFlow::Continue(());
        }
        let expand = |number: u32, far: f32, stack: &mut Stack| {
            let node = &self.nodes[number as usize];
            let [entry, exit] = node.intervals(ray, near, far);
            compared(u32::from(node.count));
            let mut crossed = 0u32;
            for child in 0..WIDTH {
                crossed |= u32::from(entry[child] <= exit[child]) << child;
            }
            crossed &= (1 << node.count) - 1;
            // Insert each into what this node puts on the stack, the nearest on top.
            let base = stack.len();
            while crossed != 0 {
                let child = (crossed.trailing_zeros() & 7) as usize;
                crossed &= crossed - 1;
                stack.insert(base, node.entry(child, entry[child]));
            }
            None
        };
        stack::traverse(far, expand, |range| visit(&self.triangles[range]))
    }

    fn stats(&self) -> TreeStats {
        let area = half_area(&self.bounds);
        let relative = |bounds: &Bounds| if area > 0.0 { half_area(bounds) / area } else { 1.0 };
        let mut stats = TreeStats {
            triangles: self.triangles.len() as u64,
            nodes: self.nodes.len() as u64,
            node_bytes: size_of_val(self.nodes.as_slice()) as u64,
            leaf_bytes: size_of_val(self.triangles.as_slice()) as u64,
            sah_cost: if self.nodes.is_empty() { 0.0 } else { 1.0 },
            ..TreeStats::default()
        };
        let mut pending: Vec<(u32, u32)> = self.nodes.first().map(|_| (0, 1)).into_iter().collect();
        while let Some((number, depth)) = pending.pop() {
            let node = &self.nodes[number as usize];
            stats.max_depth = stats.max_depth.max(depth);
            for child in 0..usize::from(node.count) {
                let entry = node.entry(child, 0.0);
                stats.sah_cost += relative(&node.bounds(child)) * f64::from(entry.count.max(1));
                if entry.count == 0 {
                    pending.push((entry.first, depth + 1));
                } else {
                    stats.leaves += 1;
                }
            }
        }
        stats
    }

    fn validate_nodes(&self) -> Result<(), String> {
        // From the leaves up: the exact box of each node, which its parent's quantised one must contain. Children come
        // after their parents.
        let mut exact = vec![Bounds::EMPTY; self.nodes.len()];
        let mut parents = vec![0u32; self.nodes.len()];
        let mut leaves = Vec::new();
        for (number, node) in self.nodes.iter().enumerate().rev() {
            for child in 0..usize::from(node.count) {
                let entry = node.entry(child, 0.0);
                let first = entry.first as usize;
                let bounds = if entry.count == 0 {
                    let below = exact.get(first).filter(|_| first > number);
                    parents[first.min(self.nodes.len() - 1)] += 1;
                    *below.ok_or(format!("child {child} of node {number} does not come after it"))?
                } else {
                    leaves.push((entry.first, entry.count));
                    let run = self.triangles.get(first..first + entry.count as usize);
                    let run = run.ok_or(format!("child {child} of node {number} is out of range"))?;
                    run.iter().fold(Bounds::EMPTY, |bounds, triangle| bounds.union(triangle.bounds()))
                };
                if !node.bounds(child).contains(&bounds) {
                    return Err(format!("the quantised box of child {child} of node {number} is too small"));
                }
                exact[number] = exact[number].union(bounds);
            }
        }
        check_partition(&mut leaves, self.triangles.len())?;
        if parents.iter().skip(1).any(|&count| count != 1) {
            return Err("a node does not have exactly one parent".into());
        }
        if exact.first().is_some_and(|root| *root != self.bounds) {
            return Err("the bounds are not those of the triangles".into());
        }
        Ok(())
    }

    fn bounds(&self) -> Bounds {
        self.bounds
    }
}
