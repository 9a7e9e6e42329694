//! How the tree is built: chunk by chunk on all threads, each put in its place as soon as those before it are.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use super::Tree;
use super::chunks::{Chunk, Chunks, Reference};
use super::collapse::Collapse;
use super::leaf::GrowingLeaves;
use super::node::{Child, Node};
use super::simd::prefer_huge_pages;
use crate::accel::Preset;
use crate::accel::leaf::LeafTriangle;
use crate::accel::topology::Topology;
use crate::error::Result;
use crate::geometry::{Bounds, TriangleMesh};
use crate::progress::{Progress, Share};

/// Builds the tree of a mesh, with compact leaves or not, and returns it with the box around it. Each live triangle is a step of
/// `progress`.
///
/// # Errors
/// When `progress` says to stop.
pub fn build(
    mesh: &Arc<TriangleMesh>,
    compact: bool,
    preset: Preset,
    progress: &dyn Progress,
) -> Result<(Tree, Bounds)> {
    progress.check()?;
    let mut references = Reference::all(mesh);
    let Chunks { bounds, top, chunks } = Chunks::cut(&mut references);
    progress.check()?;
    let leaves = |triangles: usize| GrowingLeaves::with_capacity(triangles, compact.then(|| mesh.clone()));
    let assembly = Mutex::new(Assembly::new(top, leaves(mesh.live_count()), mesh.live_count()));
    let next = AtomicUsize::new(0);
    let work = || -> Result<()> {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(chunk) = chunks.get(number) else { return Ok(()) };
            let built = Built::new(mesh, chunk, leaves(chunk.references.len()), preset, progress)?;
            assembly.lock().expect("no thread panics with it").accept(&chunks, number, built);
        }
    };
    // As many takers as threads; one that finds no thread free finds nothing left when it begins.
    let takers = rayon::current_num_threads().min(chunks.len());
    (0..takers).into_par_iter().with_max_len(1).try_for_each(|_| work())?;
    let assembly = assembly.into_inner().expect("no thread panics with it");
    // Before the finished nodes are copied.
    drop(chunks);
    drop(references);
    Ok((assembly.finish(), bounds))
}

/// A chunk's nodes and leaves, numbered from 0.
struct Built {
    nodes: Vec<Node>,
    leaves: GrowingLeaves,
    root: Child,
}

impl Built {
    fn new(
        mesh: &TriangleMesh,
        chunk: &Chunk<'_>,
        leaves: GrowingLeaves,
        preset: Preset,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut share = Share::new(progress, chunk.references.len() as u64);
        let boxes: Vec<Bounds> = chunk.references.iter().map(|reference| reference.bounds).collect();
        let topology = Topology::build(&boxes, preset, 1, &mut share)?;
        let triangle = |&at: &u32| LeafTriangle::new(mesh, chunk.references[at as usize].primitive);
        let triangles: Vec<_> = topology.order.iter().map(triangle).collect();
        let mut collapse = Collapse::new(&topology, &triangles, leaves);
        let root = collapse.run(chunk.depth);
        share.reach(100)?;
        Ok(Self { nodes: collapse.nodes, leaves: collapse.leaves, root })
    }
}

/// The tree as far as it is built.
struct Assembly {
    nodes: Vec<Node>,
    leaves: GrowingLeaves,
    root: Child,
    /// The chunk that comes next.
    next: usize,
    /// Chunks that were built before their turn.
    waiting: BTreeMap<usize, Built>,
}

impl Assembly {
    /// Fewer triangles than a node has below it in most trees, so that the room suffices: 25 on a dragon of 871 k.
    const TRIANGLES_A_NODE: usize = 16;

    /// With the top and room for the leaves of all chunks.
    fn new(top: Vec<Node>, leaves: GrowingLeaves, triangles: usize) -> Self {
        let root = if top.is_empty() { Child::NONE } else { Child::inner(0) };
        let mut nodes = top;
        nodes.reserve(triangles.div_ceil(Self::TRIANGLES_A_NODE));
        Self { nodes, leaves, root, next: 0, waiting: BTreeMap::new() }
    }

    /// Takes what was built of a chunk.
    fn accept(&mut self, chunks: &[Chunk<'_>], number: usize, built: Built) {
        self.waiting.insert(number, built);
        while let Some(built) = self.waiting.remove(&self.next) {
            let (nodes, triangles) = (self.nodes.len(), self.leaves.len());
            match chunks[self.next].place {
                Some((node, place)) => self.nodes[node].children[place] = built.root.moved(nodes, triangles),
                None => self.root = built.root,
            }
            self.nodes.extend(
                built
                    .nodes
                    .into_iter()
                    .map(|node| Node { children: node.children.map(|child| child.moved(nodes, triangles)), ..node }),
            );
            self.leaves.append(&built.leaves);
            self.next += 1;
        }
    }

    fn finish(mut self) -> Tree {
        // Their number is known only now, and room that grows moves.
        let mut nodes = Vec::with_capacity(self.nodes.len());
        prefer_huge_pages(&mut nodes);
        nodes.append(&mut self.nodes);
        Tree::new(nodes.into(), self.leaves.finish(), self.root)
    }
}
