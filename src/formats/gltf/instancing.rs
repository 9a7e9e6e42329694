//! EXT_mesh_gpu_instancing: one node, many copies of its mesh.

use ::gltf::json::{Index, Node, Root};
use glam::{DAffine3, DVec3, DVec4, Vec3, Vec4};
use serde_json::Value;

use super::accessor::Accessor;
use super::budget::Budget;
use super::buffers::Buffers;
use super::nodes::scale_rotate_translate;
use crate::error::{Error, Result};
use crate::formats::Ledger;
use crate::scene::Object;

/// The name of the extension.
pub(super) const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// What a node has of it.
pub(super) fn extension(node: &Node) -> Option<&Value> {
    node.extensions.as_ref()?.others.get(EXTENSION)
}

/// The transforms of a node's instances relative to the node, or `None` if it is not instanced.
///
/// # Errors
/// A file's error if attributes are missing, of the wrong type, or of different counts.
pub(super) fn instances(
    root: &Root,
    buffers: &Buffers,
    node: &Node,
    budget: &mut Budget,
    ledger: &mut Ledger,
) -> Result<Option<Vec<DAffine3>>> {
    let Some(extension) = extension(node) else { return Ok(None) };
    let attributes = extension.get("attributes");
    let open = |name: &str| -> Result<Option<Accessor<'_>>> {
        let Some(value) = attributes.and_then(|attributes| attributes.get(name)) else { return Ok(None) };
        let wrong = || Error::file(format!("{EXTENSION}.attributes.{name} is not the number of an accessor"));
        let number = value.as_u64().and_then(|number| u32::try_from(number).ok()).ok_or_else(wrong)?;
        Accessor::open(root, buffers, Index::new(number)).map(Some)
    };
    let (translation, rotation, scale) = (open("TRANSLATION")?, open("ROTATION")?, open("SCALE")?);
    let mut counts = [&translation, &rotation, &scale].into_iter().flatten().map(Accessor::count);
    let count = counts.next().ok_or_else(|| {
        let has = attributes.and_then(Value::as_object).map_or(0, serde_json::Map::len);
        Error::file(format!("{EXTENSION} has none of TRANSLATION, ROTATION, SCALE among its {has} attributes"))
    })?;
    if counts.any(|other| other != count) {
        return Err(Error::file(format!("the attributes of {EXTENSION} have different counts")));
    }
    budget.take::<(Object, DAffine3)>(count)?;
    let translations: Option<Vec<Vec3>> = translation.as_ref().map(|t| t.vectors::<3, _>(None)).transpose()?;
    let rotations: Option<Vec<Vec4>> = rotation.as_ref().map(|r| r.vectors::<4, _>(None)).transpose()?;
    let scales: Option<Vec<Vec3>> = scale.as_ref().map(|s| s.vectors::<3, _>(None)).transpose()?;
    let instance = |i: usize| {
        scale_rotate_translate(
            translations.as_ref().map_or(DVec3::ZERO, |all| all[i].as_dvec3()),
            rotations.as_ref().map_or(DVec4::W, |all| all[i].as_dvec4()),
            scales.as_ref().map_or(DVec3::ONE, |all| all[i].as_dvec3()),
            ledger,
        )
    };
    Ok(Some((0..count).map(instance).collect()))
}
