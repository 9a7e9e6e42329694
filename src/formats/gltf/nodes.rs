//! The node hierarchy: where everything stands, in f64.

use ::gltf::json::{Index, Node, Root};
use glam::{DAffine3, DMat3, DVec3, DVec4};

use super::choice::choose;
use super::document::Placement;
use super::sampler::length;
use crate::error::{Error, Result};
use crate::formats::{Ledger, Limits, Treatment, UpAxis};
use crate::math::transform::{compose, rotation_by};

/// A node of the scene with its place in the world.
#[derive(Debug)]
pub(super) struct PlacedNode<'a> {
    /// Its number in the file.
    pub number: usize,
    /// The node.
    pub node: &'a Node,
    /// From the node's space to the world.
    pub to_world: DAffine3,
}

impl PlacedNode<'_> {
    /// The name in the file, or one made from the number.
    pub fn name(&self) -> String {
        self.node.name.clone().unwrap_or_else(|| format!("node {}", self.number))
    }
}

/// All nodes of a scene, standing as `placements` says; parents before children, in the order of the file's lists.
///
/// # Errors
/// A file's error that names a node which has two parents or is its own ancestor; a limit for one too deep.
pub(super) fn place<'a>(
    root: &'a Root,
    placements: &[Placement],
    scene: Option<usize>,
    up: UpAxis,
    limits: &Limits,
    ledger: &mut Ledger,
) -> Result<Vec<PlacedNode<'a>>> {
    let mut seen = vec![false; root.nodes.len()];
    let mut placed = Vec::with_capacity(root.nodes.len());
    // A stack of our own: a hierarchy may be deeper than the program's.
    let mut waiting: Vec<(Index<Node>, DAffine3, u64)> =
        roots(root, scene).into_iter().rev().map(|node| (node, up.to_y(), 0)).collect();
    while let Some((index, parent, depth)) = waiting.pop() {
        let number = index.value();
        limits.check_depth(depth).map_err(|error| error.within(format_args!("nodes[{number}]")))?;
        if std::mem::replace(&mut seen[number], true) {
            let text = format!("nodes[{number}] has two parents, or is its own ancestor");
            return Err(Error::file(text).remedy("glTF wants a tree: export the file again"));
        }
        let (node, placement) = (&root.nodes[number], &placements[number]);
        let to_world = compose(&parent, &local(placement, ledger));
        waiting.extend(node.children.iter().flatten().rev().map(|&child| (child, to_world, depth + 1)));
        placed.push(PlacedNode { number, node, to_world });
    }
    Ok(placed)
}

/// The scene that is read: the one of this name or number; else the file's default; else its first. `None` if the file
/// has no scenes.
///
/// # Errors
/// A caller's error if there is no such scene.
pub(super) fn scene(root: &Root, wanted: Option<&str>, ledger: &mut Ledger) -> Result<Option<usize>> {
    let names = root.scenes.iter().map(|scene| scene.name.as_deref());
    let chosen = wanted.map(|wanted| choose("scene", wanted, names)).transpose()?;
    if root.scenes.len() > 1 && chosen.is_none() {
        ledger.note(Treatment::Ignored, "other scene (see --scene)", root.scenes.len() as u64 - 1);
    }
    let default = root.scene.map(|scene| scene.value()).filter(|&scene| scene < root.scenes.len());
    Ok(chosen.or(default).or((!root.scenes.is_empty()).then_some(0)))
}

/// Where to start: at the nodes of a scene, or at all that are no other's child.
fn roots(root: &Root, scene: Option<usize>) -> Vec<Index<Node>> {
    if let Some(scene) = scene {
        return root.scenes[scene].nodes.clone();
    }
    let mut is_child = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        is_child[child.value()] = true;
    }
    (0..root.nodes.len()).filter(|&number| !is_child[number]).map(|number| Index::new(number as u32)).collect()
}

/// A column-major matrix, whose last row, which glTF demands to be 0 0 0 1, is not read.
pub(super) fn affine(m: &[f64; 16]) -> DAffine3 {
    let column = |i: usize| DVec3::new(m[4 * i], m[4 * i + 1], m[4 * i + 2]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// From the node's space to its parent's.
fn local(placement: &Placement, ledger: &mut Ledger) -> DAffine3 {
    if let Some(matrix) = &placement.matrix {
        return affine(matrix);
    }
    let rotation = DVec4::from(placement.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    scale_rotate_translate(
        DVec3::from(placement.translation.unwrap_or([0.0; 3])),
        rotation,
        DVec3::from(placement.scale.unwrap_or([1.0; 3])),
        ledger,
    )
}

/// Scale, then rotation by a quaternion (scalar last, of any length), then translation.
pub(super) fn scale_rotate_translate(
    translation: DVec3,
    rotation: DVec4,
    scale: DVec3,
    ledger: &mut Ledger,
) -> DAffine3 {
    let length = length(rotation);
    let unit = if length > 0.0 && length < f64::INFINITY {
        rotation / length
    } else {
        ledger.note(Treatment::Warning, "rotation by a quaternion of length 0: not rotated", 1);
        DVec4::W
    };
    let r = rotation_by(unit);
    let matrix3 = DMat3::from_cols(r.x_axis * scale.x, r.y_axis * scale.y, r.z_axis * scale.z);
    DAffine3 { matrix3, translation }
}
