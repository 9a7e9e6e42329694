//! The tree builder of the crate obvhs, kept away from what it does badly.
//!
//! PLOC (Meister and Bittner 2018) merges neighbours on a space-filling curve that choose each other, then parallel
//! reinsertion (Meister and Bittner 2018b) improves the tree. Where choices tie, only one pair a round agrees: boxes
//! that coincide, or a strip of equal squares, take quadratic time and become a chain. The trees made here are refitted
//! to the exact boxes, so the builder may be shown slightly different ones: each is moved by a pseudo-random thousandth
//! of its size, which breaks ties, and they are dealt out in 64 passes, so that runs along the curve are short.

use glam::DVec3;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;

use super::Preset;
use crate::geometry::Bounds;
use crate::math::random::{hash2, unit};

/// How far boxes are moved, in parts of their size: enough to break ties, too little to matter to the tree.
const NUDGE: f64 = 1.0 / 1024.0;

/// The same in units of the last place of the coordinates, for boxes that are small where coordinates are coarse.
const NUDGE_ULP: f64 = 4.0 * f32::EPSILON as f64;

/// In how many passes boxes are dealt out.
const PASSES: usize = 64;

/// Trees deeper than this are not optimised further.
const OPTIMIZED_DEPTH: usize = 100;

/// By how much the optimiser may deepen a tree before the depth is looked at again: it sizes its stack by the depth that
/// it is told, and panics beyond. Nested boxes were seen to become 5 times as deep in one round.
const DEEPENING: usize = 20;

/// The optimiser's rounds, each on a part of the nodes that is 1 over the number (obvhs's own choice), in groups after
/// which the depth is looked at: often while the rounds are large.
const OPTIMIZER_ROUNDS: [&[f32]; 5] =
    [&[1.0], &[3.0], &[5.0, 7.0], &[9.0, 11.0, 13.0, 15.0], &[17.0, 19.0, 21.0, 23.0, 25.0, 27.0, 29.0, 31.0]];

/// Builds nodes over boxes that are not empty, and the boxes' positions in the order of the leaves.
///
/// The boxes in the nodes are approximate.
pub fn build(boxes: &[Bounds], preset: Preset, max_leaf: u32) -> (Vec<Bvh2Node>, Vec<u32>) {
    let params = match preset {
        Preset::Fast => BvhBuildParams::fast_build(),
        Preset::Balanced => BvhBuildParams::medium_build(),
        Preset::Best => BvhBuildParams::slow_build(),
    };
    let dealt = deal(boxes.len());
    let nudged = nudge(boxes, &dealt);
    let mut tree = PlocBuilder::with_capacity(nudged.len()).build(
        params.ploc_search_distance,
        &nudged,
        (0..nudged.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    drop(nudged);

    let mut optimizer = ReinsertionOptimizer::default();
    let mut optimize = |tree: &mut Bvh2, ratio: f32| {
        for rounds in OPTIMIZER_ROUNDS {
            let depth = depth(&tree.nodes);
            if depth > OPTIMIZED_DEPTH {
                return;
            }
            tree.max_depth = DEEPENING * depth;
            optimizer.run(tree, ratio, Some(rounds.iter().map(|round| 1.0 / round).collect()));
        }
    };
    optimize(&mut tree, params.reinsertion_batch_ratio);
    collapse(&mut tree, max_leaf, params.collapse_traversal_cost);
    optimize(&mut tree, params.reinsertion_batch_ratio * params.post_collapse_reinsertion_batch_ratio_multiplier);

    let order = tree.primitive_indices.iter().map(|&position| dealt[position as usize]).collect();
    (tree.nodes, order)
}

/// The numbers below `count`, every 64th part in turn.
fn deal(count: usize) -> Vec<u32> {
    let stride = count.div_ceil(PASSES).max(1);
    (0..stride).flat_map(|start| (start..count).step_by(stride)).map(|number| number as u32).collect()
}

/// The boxes in the given order, scaled by a power of two so that areas neither overflow nor vanish, and moved a little.
fn nudge(boxes: &[Bounds], order: &[u32]) -> Vec<Aabb> {
    let total = boxes.iter().fold(Bounds::EMPTY, |total, &bounds| total.union(bounds));
    let largest = total.size().max_element();
    let scale = if largest > 0.0 { libm::exp2(-libm::floor(libm::log2(largest))) } else { 1.0 };
    let nudged = |&number: &u32| {
        let bounds = &boxes[number as usize];
        let (min, max) = (bounds.min.as_dvec3() * scale, bounds.max.as_dvec3() * scale);
        let reach = (max - min).max_element() * NUDGE + min.abs().max(max.abs()) * NUDGE_ULP;
        let random = |axis| 2.0 * unit(hash2(number, axis)) - 1.0;
        let shift = DVec3::new(random(0), random(1), random(2)) * reach;
        Aabb::new((min + shift).as_vec3a(), (max + shift).as_vec3a())
    };
    order.iter().map(nudged).collect()
}

/// Inner nodes on the longest way down.
fn depth(nodes: &[Bvh2Node]) -> usize {
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
