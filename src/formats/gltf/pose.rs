//! A primitive's vertices, morphed and posed: positions in f64, for the world where a skin moves them.

use ::gltf::json::Index;
use ::gltf::json::mesh::Semantic;
use glam::{DVec3, Vec3, Vec4};

use super::accessor::Accessor;
use super::builder::Builder;
use super::mesh::{Part, Shape};
use super::skin::{Faults, Influences, Motion, Skin};
use crate::error::{Error, Result};
use crate::formats::Treatment;

/// What moves the vertices of a primitive.
pub(super) struct Posing<'a> {
    /// Morph targets that count, and how much.
    targets: Vec<(&'a std::collections::BTreeMap<String, serde_json::Value>, f64)>,
    /// For each vertex; empty without a skin.
    motions: Vec<Motion>,
    /// Whether the mesh is neither morphed nor posed, in any of its primitives.
    is_plain: bool,
}

impl<'a> Posing<'a> {
    /// What moves a primitive that is shown in a shape. Faults of its joints go to the ledger.
    pub fn of(part: &mut Part<'a, '_>, shape: Shape<'_>) -> Result<Self> {
        let weights = shape.weights.iter().copied();
        let targets: Vec<_> = part.targets.iter().zip(weights).filter(|&(_, weight)| weight != 0.0).collect();
        let is_plain = shape.weights.is_empty() && shape.skin.is_none();
        if !is_plain {
            part.budget.take::<[[f64; 16]; 2]>(part.vertex_count())?;
        }
        let motions = match shape.skin {
            Some(skin) => motions(part, skin)?,
            None => Vec::new(),
        };
        Ok(Self { targets, motions, is_plain })
    }

    /// Whether attributes are those of the file.
    pub fn is_plain(&self) -> bool {
        self.is_plain
    }

    /// Whether some target changes an attribute.
    pub fn morphs(&self, name: &str) -> bool {
        self.targets.iter().any(|(target, _)| target.contains_key(name))
    }

    /// An attribute of `N` numbers, with the targets' changes of `D` numbers added.
    pub fn morphed<const N: usize, const D: usize>(
        &self,
        part: &mut Part<'a, '_>,
        base: &Accessor,
        name: &str,
    ) -> Result<Vec<[f64; N]>> {
        let mut values = Vec::new();
        base.extend_vectors(part.selection.as_deref(), &mut values, |value: [f32; N]| value.map(f64::from))?;
        for &(target, weight) in &self.targets {
            let Some(index) = target.get(name) else { continue };
            let named = |error: Error| error.within(format_args!("targets of {name}"));
            let index = index.as_u64().and_then(|index| u32::try_from(index).ok());
            let index = index.ok_or_else(|| named(Error::file("not the number of an accessor")))?;
            let changes = part.open(Index::new(index)).map_err(named)?;
            if !part.fits(&format!("morph target of {name}"), &changes) {
                continue;
            }
            part.budget.take::<[f32; D]>(part.vertex_count())?;
            let changes: Vec<[f32; D]> = changes.vectors(part.selection.as_deref()).map_err(named)?;
            for (value, change) in values.iter_mut().zip(changes) {
                for lane in 0..D {
                    value[lane] += weight * f64::from(change[lane]);
                }
            }
        }
        Ok(values)
    }

    /// Adds the positions, and tells which vertices were mirrored; nothing where none can be.
    pub fn add_positions(
        &self,
        part: &mut Part<'a, '_>,
        builder: &mut Builder,
        positions: &Accessor,
    ) -> Result<Vec<bool>> {
        if self.is_plain {
            let selection = part.selection.as_deref();
            positions.extend_vectors(selection, &mut builder.positions, Vec3::from_array)?;
            return Ok(Vec::new());
        }
        if !self.targets.is_empty() {
            builder.features.insert((Treatment::Honoured, "morph targets"));
        }
        if !self.motions.is_empty() {
            builder.features.insert((Treatment::Honoured, "skin"));
        }
        let values = self.morphed::<3, 3>(part, positions, "POSITION")?;
        let points = values.into_iter().map(DVec3::from_array).enumerate();
        builder.posed.extend(points.map(|(vertex, p)| self.motion(vertex).map_or(p, |motion| motion.point(p))));
        Ok(self.motions.iter().map(|motion| motion.is_mirroring).collect())
    }

    /// Adds the normals.
    pub fn add_normals(&self, part: &mut Part<'a, '_>, out: &mut Vec<Vec3>, normals: &Accessor) -> Result<()> {
        let values = self.morphed::<3, 3>(part, normals, "NORMAL")?;
        out.extend(
            values
                .into_iter()
                .map(DVec3::from_array)
                .enumerate()
                .map(|(vertex, n)| self.motion(vertex).map_or(n, |motion| motion.normal(n)).as_vec3()),
        );
        Ok(())
    }

    /// Adds the tangents. Where the surface is mirrored the bitangent is on the other side of normal and tangent.
    pub fn add_tangents(&self, part: &mut Part<'a, '_>, out: &mut Vec<Vec4>, tangents: &Accessor) -> Result<()> {
        let values = self.morphed::<4, 3>(part, tangents, "TANGENT")?;
        out.extend(values.into_iter().enumerate().map(|(vertex, [x, y, z, w])| {
            let tangent = DVec3::new(x, y, z);
            let (tangent, w) = match self.motion(vertex) {
                Some(motion) => (motion.vector(tangent), if motion.is_mirroring { -w } else { w }),
                None => (tangent, w),
            };
            tangent.extend(w).as_vec4()
        }));
        Ok(())
    }

    /// Turns the triangles of which two or three corners were mirrored, so that what was their front is so again, as it
    /// is under a node that mirrors. `first` is the number of the primitive's first vertex.
    pub fn turn_triangles(&self, triangles: &mut [[u32; 3]], first: usize, mirrored: &[bool]) {
        if !mirrored.contains(&true) {
            return;
        }
        let is_mirrored = |&corner: &u32| mirrored.get((corner as usize).wrapping_sub(first)).copied().unwrap_or(false);
        for triangle in triangles {
            if triangle.iter().filter(|corner| is_mirrored(corner)).count() >= 2 {
                triangle.swap(1, 2);
            }
        }
    }

    fn motion(&self, vertex: usize) -> Option<&Motion> {
        self.motions.get(vertex)
    }
}

/// How a skin moves each vertex of a primitive.
fn motions(part: &mut Part<'_, '_>, skin: &Skin) -> Result<Vec<Motion>> {
    let mut sets = Vec::new();
    for set in 0.. {
        let (joints, weights) = (part.attribute(Semantic::Joints(set))?, part.attribute(Semantic::Weights(set))?);
        let (Some(joints), Some(weights)) = (joints, weights) else { break };
        let fit = part.fits(&format!("JOINTS_{set}"), &joints) && part.fits(&format!("WEIGHTS_{set}"), &weights);
        if !fit {
            break;
        }
        part.budget.take::<([u16; 4], [f32; 4])>(part.vertex_count())?;
        let selection = part.selection.as_deref();
        sets.push(Influences { joints: joints.joints(selection)?, weights: weights.vectors::<4, _>(selection)? });
    }
    if sets.is_empty() {
        part.ledger.note(Treatment::Warning, "primitive without joints in a mesh with a skin: not moved", 1);
        return Ok(vec![skin.unmoved(); part.vertex_count()]);
    }
    let mut faults = Faults::default();
    let motions = (0..part.vertex_count()).map(|vertex| skin.motion(&sets, vertex, &mut faults)).collect();
    for (count, text) in [
        (faults.missing_joints, "vertex of a joint that its skin does not have: not moved"),
        (faults.without_weights, "vertex whose joints have no weight: moved by the first of them"),
    ] {
        if count > 0 {
            part.ledger.note(Treatment::Warning, text, count);
        }
    }
    Ok(motions)
}
