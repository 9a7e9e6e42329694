//! The tree builder of the crate obvhs, kept away from what it does badly.
//!
//! PLOC (Meister and Bittner 2018) merges neighbours on a space-filling curve that choose each other, then parallel
//! reinsertion (Meister and Bittner 2018b) improves the tree. Where choices tie, only one pair a round agrees: boxes
//! that coincide, or a strip of equal squares, take quadratic time and become a chain. The trees made here are refitted
//! to the exact boxes, so the builder may be shown slightly different ones: each is moved by a pseudo-random thousandth
//! of its size, which breaks ties, and they are dealt out in 64 passes, so that runs along the curve are short.

use std::ops::Range;

use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::Preset;
use crate::error::Result;
use crate::geometry::Bounds;
use crate::math::random::{hash2, unit};
use crate::progress::Share;

/// How far boxes are moved, in parts of their size: enough to break ties, too little to matter to the tree.
const NUDGE: f64 = 1.0 / 1024.0;

/// The same in units of the last place of the coordinates, for boxes that are small where coordinates are coarse.
const NUDGE_ULP: f64 = 4.0 * f32::EPSILON as f64;

/// In how many passes boxes are dealt out.
const PASSES: usize = 64;

/// Trees deeper than this are not optimised further: every node's search goes up to the root.
const OPTIMIZED_DEPTH: usize = 100;

/// The depth that the optimiser is told. It sizes its stack by twice of this and searches on an array up to here, which
/// forgets places when it is full; beyond, it allocates exactly what it is told and panics where the tree is deeper.
/// What the trees above need fits, and a tree that became deeper on the way is merely optimised less.
const SEARCH_DEPTH: usize = 96;

/// The optimiser's rounds; round `i` tries a part of the nodes that is 1 over `2 i + 1` (obvhs's own choice).
const OPTIMIZER_ROUNDS: u32 = 16;

/// What a leaf costs beside its items, in items.
const LEAF_NODES: f32 = 3.0;

/// How much time is spent.
struct Effort {
    /// How far along the curve partners are looked for, from the first round on. obvhs's own presets look farther (6, 14 and 24
    /// for 2, 6 and 14), but at the next neighbours only in the first two or three rounds, which take longest. Balanced wide trees
    /// cost by the surface area heuristic 29.97 so on a dragon of 871 k triangles, and 29.14 with what is here; on the bunny 20.71 and 20.07.
    search: PlocSearchDistance,
    precision: SortPrecision,
    /// Which part of the nodes is tried elsewhere in the first round.
    reinsertion: f32,
    /// The same as a multiple of it, after leaves were collapsed.
    once_more: f32,
}

impl Effort {
    fn of(preset: Preset) -> Self {
        let (search, precision, reinsertion, once_more) = match preset {
            Preset::Fast => (PlocSearchDistance::VeryLow, SortPrecision::U64, 0.02, 0.0),
            Preset::Balanced => (PlocSearchDistance::Low, SortPrecision::U64, 0.05, 2.0),
            Preset::Best => (PlocSearchDistance::Medium, SortPrecision::U128, 0.2, 2.0),
        };
        Self { search, precision, reinsertion, once_more }
    }
}

/// Builds nodes over boxes that are not empty, and the boxes' positions in the order of the leaves.
///
/// The boxes in the nodes are approximate. Reports up to 95 % of `share`; how the stages divide it is a guess, and the
/// merging is one stage that cannot be stopped.
///
/// # Errors
/// When `share` says to stop.
pub fn build(boxes: &[Bounds], preset: Preset, max_leaf: u32, share: &mut Share) -> Result<(Vec<Bvh2Node>, Vec<u32>)> {
    let effort = Effort::of(preset);
    let dealt = deal(boxes.len());
    let nudged = nudge(boxes, &dealt);
    share.reach(5)?;
    let mut tree = PlocBuilder::with_capacity(nudged.len()).build(
        effort.search,
        &nudged,
        (0..nudged.len() as u32).collect(),
        effort.precision,
        0,
    );
    drop(nudged);
    share.reach(35)?;

    // A second time only where leaves were collapsed in between.
    let once = max_leaf == 1;
    optimize(&mut tree, effort.reinsertion, 35..if once { 95 } else { 60 }, share)?;
    if !once {
        collapse(&mut tree, max_leaf, LEAF_NODES);
        share.reach(65)?;
        optimize(&mut tree, effort.reinsertion * effort.once_more, 65..95, share)?;
    }

    let order = tree.primitive_indices.iter().map(|&position| dealt[position as usize]).collect();
    Ok((tree.nodes, order))
}

/// Moves nodes to better places, `ratio` of them in the first round, and reports `percent` of `share` on the way.
fn optimize(tree: &mut Bvh2, ratio: f32, percent: Range<u32>, share: &mut Share) -> Result<()> {
    if ratio <= 0.0 {
        return Ok(());
    }
    let mut optimizer = ReinsertionOptimizer::default();
    for round in 0..OPTIMIZER_ROUNDS {
        // Nested boxes were seen to become 5 times as deep in the first round, which is by far the largest: look at the depth before
        // it and after it.
        if round < 2 && depth(tree) > OPTIMIZED_DEPTH {
            break;
        }
        optimize_round(&mut optimizer, tree, ratio, round);
        share.reach(percent.start + (percent.end - percent.start) * (round + 1) / OPTIMIZER_ROUNDS)?;
    }
    Ok(())
}

/// One round of the optimiser, which may be given a tree of any depth.
fn optimize_round(optimizer: &mut ReinsertionOptimizer, tree: &mut Bvh2, ratio: f32, round: u32) {
    tree.max_depth = SEARCH_DEPTH;
    optimizer.run(tree, ratio, Some(vec![1.0 / (2 * round + 1) as f32]));
}

/// The numbers below `count`, every 64th part in turn.
fn deal(count: usize) -> Vec<u32> {
    let stride = count.div_ceil(PASSES).max(1);
    (0..stride).flat_map(|start| (start..count).step_by(stride)).map(|number| number as u32).collect()
}

/// The boxes in the given order, scaled by a power of two so that areas neither overflow nor vanish, and moved a little.
/// Boxes without end are cut off where f32 ends.
fn nudge(boxes: &[Bounds], order: &[u32]) -> Vec<Aabb> {
    let largest_f32 = DVec3::splat(f64::from(f32::MAX));
    let finite = |corner: Vec3| corner.as_dvec3().clamp(-largest_f32, largest_f32);
    let total = boxes.iter().fold(Bounds::EMPTY, |total, &bounds| total.union(bounds));
    let largest = (finite(total.max) - finite(total.min)).max_element();
    let scale = if largest > 0.0 { libm::exp2(-libm::floor(libm::log2(largest))) } else { 1.0 };
    let nudged = |&number: &u32| {
        let bounds = &boxes[number as usize];
        let (min, max) = (finite(bounds.min) * scale, finite(bounds.max) * scale);
        let reach = (max - min).max_element() * NUDGE + min.abs().max(max.abs()) * NUDGE_ULP;
        let random = |axis| 2.0 * unit(hash2(number, axis)) - 1.0;
        let shift = DVec3::new(random(0), random(1), random(2)) * reach;
        Aabb::new((min + shift).as_vec3a(), (max + shift).as_vec3a())
    };
    order.iter().map(nudged).collect()
}

/// Inner nodes on the longest way down.
fn depth(tree: &Bvh2) -> usize {
    let nodes = &tree.nodes;
    if tree.children_are_ordered_after_parents {
        let mut depths = vec![0; nodes.len()];
        for (number, node) in nodes.iter().enumerate().filter(|(_, node)| !node.is_leaf()) {
            let below = depths[number] + 1;
            depths[node.first_index as usize..][..2].fill(below);
        }
        return depths.into_iter().max().unwrap_or(0);
    }
    let mut deepest = 0;
    let mut pending = vec![(0usize, 0usize)];
    while let Some((number, depth)) = pending.pop() {
        match nodes.get(number) {
            Some(node) if !node.is_leaf() => {
                let first = node.first_index as usize;
                pending.extend([(first, depth + 1), (first + 1, depth + 1)]);
            }
            _ => deepest = deepest.max(depth),
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of boxes within boxes, the smallest of all on top: its search for a better place goes down all the way.
    fn chain(leaves: usize) -> Bvh2 {
        let around = |item: usize| {
            let size = if item == 0 { 0.5 } else { (leaves - item) as f32 };
            Aabb::new(glam::Vec3A::splat(-size), glam::Vec3A::splat(size))
        };
        let mut nodes = vec![Bvh2Node::new(around(1), 0, 1)];
        for item in 0..leaves - 1 {
            nodes.push(Bvh2Node::new(around(item), 1, item as u32));
            let below = nodes.len() as u32 + 1;
            let (count, first) = if item + 2 < leaves { (0, below) } else { (1, item as u32 + 1) };
            nodes.push(Bvh2Node::new(around(item + 1), count, first));
        }
        Bvh2 { nodes, primitive_indices: (0..leaves as u32).collect(), ..Bvh2::default() }
    }

    /// The items in the leaves that are reached from the root, sorted.
    fn items(tree: &Bvh2) -> Vec<u32> {
        let mut items = Vec::new();
        let mut pending = vec![0];
        while let Some(number) = pending.pop() {
            let node = &tree.nodes[number as usize];
            if node.is_leaf() {
                items.extend(&tree.primitive_indices[node.first_index as usize..][..node.prim_count as usize]);
            } else {
                pending.extend([node.first_index, node.first_index + 1]);
            }
        }
        items.sort_unstable();
        items
    }

    #[test]
    fn the_optimizer_survives_trees_far_deeper_than_it_is_told() {
        const LEAVES: usize = 3000;
        let mut tree = chain(LEAVES);
        assert_eq!(depth(&tree), LEAVES - 1);
        let mut optimizer = ReinsertionOptimizer::default();
        for round in 0..4 {
            optimize_round(&mut optimizer, &mut tree, 1.0, round);
            assert!(items(&tree).into_iter().eq(0..LEAVES as u32), "round {round}");
        }
    }
}
