//! Trees that come from a file: searches trust every number in them, so each is checked first.

use std::sync::Arc;

use rayon::prelude::*;

use super::Tree;
use super::collapse::MOST_DEPTH;
use super::leaf::Leaves;
use super::node::{Child, Node};
use crate::accel::KeptTree;
use crate::array::Array;
use crate::geometry::TriangleMesh;

/// Nodes a task.
const TASK: usize = 1 << 12;

/// The tree of a mesh that was kept, its leaves compact or not.
///
/// # Errors
/// Says which number is not such as a build makes.
pub fn restore(mesh: &Arc<TriangleMesh>, compact: bool, kept: &KeptTree) -> Result<Tree, String> {
    let nodes = Array::mapped(&kept.mapping, kept.nodes.clone()).ok_or("the nodes are not whole")?;
    let words = Array::mapped(&kept.mapping, kept.leaves.clone());
    let leaves = words.and_then(|words| Leaves::kept(words, compact.then(|| Arc::clone(mesh))));
    let tree = Tree::new(nodes, leaves.ok_or("the leaves are not whole")?, Child(kept.root));
    Links::new(&tree).check()?;
    check_leaves(&tree, mesh)?;
    Ok(tree)
}

/// What leads from node to node.
struct Links<'a> {
    tree: &'a Tree,
    /// How deep each node is, 1 for the root; 0 for those that nothing led to.
    depths: Vec<u8>,
}

impl<'a> Links<'a> {
    fn new(tree: &'a Tree) -> Self {
        Self { tree, depths: vec![0; tree.nodes.len()] }
    }

    /// Whether every node has one parent, which comes before it, none is too deep, and leaves are within what there is.
    fn check(mut self) -> Result<(), String> {
        self.follow(self.tree.root, 1)?;
        if self.tree.root == Child::NONE && self.tree.leaves.len() > 0 {
            return Err("the tree has triangles and no root".into());
        }
        for (number, node) in self.tree.nodes.iter().enumerate() {
            // Parents come first in what a build makes, so that this node's depth is known by now.
            let depth = self.depths[number];
            if depth == 0 {
                return Err(format!("node {number} does not follow a parent"));
            }
            for (at, &child) in node.children.iter().enumerate() {
                // A search that entered such a box would take what it finds there for a leaf.
                if child == Child::NONE && !has_empty_box(node, at) {
                    return Err(format!("node {number} has a box without a child"));
                }
                self.follow(child, depth + 1)?;
            }
        }
        Ok(())
    }

    fn follow(&mut self, child: Child, depth: u8) -> Result<(), String> {
        if child == Child::NONE {
            return Ok(());
        }
        if child.is_leaf() {
            let is_there = child.first() + child.count() <= self.tree.leaves.len();
            return is_there.then_some(()).ok_or_else(|| format!("the leaf at {} is out of range", child.first()));
        }
        match self.depths.get_mut(child.number()) {
            Some(own @ 0) if usize::from(depth) <= MOST_DEPTH => *own = depth,
            _ => return Err(format!("node {} is out of range, too deep or has two parents", child.number())),
        }
        Ok(())
    }
}

fn has_empty_box(node: &Node, at: usize) -> bool {
    node.planes
        .iter()
        .zip(&Node::EMPTY.planes)
        .all(|(own, empty)| own[0][at] == empty[0][at] && own[1][at] == empty[1][at])
}

/// Whether all triangles in leaves are such of the mesh as can be hit.
fn check_leaves(tree: &Tree, mesh: &TriangleMesh) -> Result<(), String> {
    let is_live = |primitive: u32| {
        (primitive as usize) < mesh.triangle_count()
            && (mesh.dropped.is_empty() || mesh.dropped.binary_search(&primitive).is_err())
    };
    let check = |&child: &Child| {
        let primitives = || tree.leaves.primitives(child).iter();
        match primitives().find(|&&primitive| !is_live(primitive)) {
            Some(primitive) => Err(format!("a leaf has triangle {primitive}, which the mesh has not")),
            None => Ok(()),
        }
    };
    let is_leaf = |child: &&Child| **child != Child::NONE && child.is_leaf();
    std::iter::once(&tree.root).filter(is_leaf).try_for_each(check)?;
    tree.nodes
        .par_iter()
        .with_min_len(TASK)
        .try_for_each(|node| node.children.iter().filter(is_leaf).try_for_each(check))
}
