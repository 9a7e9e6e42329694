//! Which meshes the nodes of a scene show, and in which shapes: each is read once.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::DAffine3;

use super::animation::{Pose, target_count};
use super::budget::Budget;
use super::document::Document;
use super::instancing;
use super::mesh::{MeshReader, Shape};
use super::nodes::PlacedNode;
use super::skin::Skin;
use crate::error::{Error, Fault, Result};
use crate::formats::{Ledger, Model, Scope, Treatment, UpAxis};
use crate::math::Transform;
use crate::math::transform::compose;
use crate::progress::Progress;
use crate::scene::{self, Object};

/// A mesh, how far it is morphed and by which skin it is posed: what makes a mesh of its own.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
struct Variant {
    mesh: usize,
    /// The bits of the weights; none if all are 0.
    weights: Vec<u64>,
    skin: Option<usize>,
}

/// What the nodes of a scene show.
pub(super) struct Shown<'a> {
    document: &'a Document,
    placed: &'a [PlacedNode<'a>],
    /// The skins that could be read, by number.
    skins: BTreeMap<usize, Skin>,
    /// Of each placed node that has a mesh.
    variants: Vec<Option<Variant>>,
}

impl<'a> Shown<'a> {
    /// Finds what is shown. Skins that cannot be read go to the ledger, and their meshes stand as if they had none.
    ///
    /// # Errors
    /// A limit.
    pub fn find(
        reader: &MeshReader<'a>,
        placed: &'a [PlacedNode<'a>],
        pose: &Pose,
        up: UpAxis,
        budget: &mut Budget,
        ledger: &mut Ledger,
    ) -> Result<Self> {
        let document = reader.document;
        let mut worlds = vec![None; document.root.nodes.len()];
        placed.iter().for_each(|node| worlds[node.number] = Some(node.to_world));
        let mut shown = Self { document, placed, skins: BTreeMap::new(), variants: Vec::new() };
        let mut broken = HashSet::new();
        for node in placed {
            let skin = node.node.skin.map(|skin| skin.value()).filter(|_| node.node.mesh.is_some());
            if let Some(number) = skin.filter(|number| !shown.skins.contains_key(number) && !broken.contains(number)) {
                match Skin::read(&document.root, reader.buffers, number, &worlds, up.to_y(), budget) {
                    Ok(skin) => drop(shown.skins.insert(number, skin)),
                    Err(error) if error.fault() == Fault::File => {
                        let text = format!("skins[{number}]: {}: shown unposed", error.message());
                        ledger.note(Treatment::Warning, text, 1);
                        broken.insert(number);
                    }
                    Err(error) => return Err(error),
                }
            }
            let Some(mesh) = node.node.mesh.map(|mesh| mesh.value()) else {
                shown.variants.push(None);
                continue;
            };
            let weights = shown.weights(node, mesh, pose, budget, ledger)?;
            let skin = skin.filter(|skin| shown.skins.contains_key(skin));
            shown.variants.push(Some(Variant { mesh, weights, skin }));
        }
        Ok(shown)
    }

    /// The bits of the weights of a node's mesh, up to the last that is not 0: those of an animation, else the node's,
    /// else the mesh's.
    fn weights(
        &self,
        node: &PlacedNode,
        mesh: usize,
        pose: &Pose,
        budget: &mut Budget,
        ledger: &mut Ledger,
    ) -> Result<Vec<u64>> {
        let count = target_count(self.document, mesh);
        let own = node.node.weights.as_ref().or(self.document.root.meshes[mesh].weights.as_ref());
        budget.take::<[u64; 2]>(own.map_or(0, Vec::len).max(pose.weights.get(&node.number).map_or(0, Vec::len)))?;
        let of_file = || own.into_iter().flatten().map(|&weight| f64::from(weight)).collect();
        let mut weights: Vec<f64> = pose.weights.get(&node.number).cloned().unwrap_or_else(of_file);
        if weights.len() > count || weights.iter().any(|weight| !weight.is_finite()) {
            ledger.note(Treatment::Warning, "weights without a morph target, or not finite: left out", 1);
        }
        weights.truncate(count);
        weights.iter_mut().filter(|weight| !weight.is_finite()).for_each(|weight| *weight = 0.0);
        let used = weights.iter().rposition(|&weight| weight != 0.0).map_or(0, |last| last + 1);
        weights.truncate(used);
        Ok(weights.into_iter().map(f64::to_bits).collect())
    }

    /// Reads every mesh in every shape in which it is shown, and adds the objects of all nodes to the model.
    ///
    /// # Errors
    /// As [`MeshReader::read`]; cancellation.
    pub fn read(
        &self,
        reader: &MeshReader,
        model: &mut Model,
        budget: &mut Budget,
        ledger: &mut Ledger,
        progress: &dyn Progress,
    ) -> Result<()> {
        let places = self.read_meshes(reader, &mut model.meshes, budget, ledger, progress)?;
        for (node, variant) in self.placed.iter().zip(&self.variants) {
            if let Some((variant, &place)) = variant.as_ref().and_then(|variant| Some((variant, places.get(variant)?)))
            {
                self.place_objects(reader, node, variant.skin.is_some(), place, model, budget, ledger)?;
            }
        }
        Ok(())
    }

    /// Reads the meshes, in the order of the file and, where one has several shapes, of the nodes; and by variant their
    /// places in the list. What has no triangles has none.
    fn read_meshes(
        &self,
        reader: &MeshReader,
        meshes: &mut Vec<crate::geometry::TriangleMesh>,
        budget: &mut Budget,
        ledger: &mut Ledger,
        progress: &dyn Progress,
    ) -> Result<HashMap<&Variant, u32>> {
        let mut seen = HashSet::new();
        let mut wanted: Vec<&Variant> =
            self.variants.iter().flatten().filter(|variant| seen.insert(*variant)).collect();
        wanted.sort_by_key(|variant| variant.mesh);
        let bytes = wanted.iter().map(|variant| reader.bytes(variant.mesh, !variant.weights.is_empty()));
        progress.begin("load", bytes.fold(0, u64::saturating_add));
        let mut places = HashMap::new();
        let mut shapes = vec![0; self.document.root.meshes.len()];
        for variant in wanted {
            progress.check()?;
            let weights: Vec<f64> = variant.weights.iter().map(|&bits| f64::from_bits(bits)).collect();
            let shape = Shape { weights: &weights, skin: variant.skin.map(|skin| &self.skins[&skin]) };
            let (mut mesh, features) = reader.read(variant.mesh, shape, budget, ledger)?;
            shapes[variant.mesh] += 1;
            if shapes[variant.mesh] > 1 {
                mesh.name = format!("{} ({})", mesh.name, shapes[variant.mesh]);
            }
            let place = u32::try_from(meshes.len()).map_err(|_| Error::limit("more than 4294967295 meshes"))?;
            if mesh.triangle_count() > 0 {
                features.iter().for_each(|&(treatment, text)| ledger.note_in(treatment, text, Scope::Mesh(place)));
                places.insert(variant, place);
                meshes.push(mesh);
            }
        }
        let unused = shapes.iter().filter(|&&shapes| shapes == 0).count() as u64;
        if unused > 0 {
            ledger.note(Treatment::Ignored, "mesh that no node of the scene shows", unused);
        }
        Ok(places)
    }

    /// Adds the objects of a node: one, or one an instance. A mesh with a skin stands in the world already.
    #[expect(clippy::too_many_arguments, reason = "two of them say what, the others with what and where to")]
    fn place_objects(
        &self,
        reader: &MeshReader,
        placed: &PlacedNode,
        is_skinned: bool,
        place: u32,
        model: &mut Model,
        budget: &mut Budget,
        ledger: &mut Ledger,
    ) -> Result<()> {
        let instances = match is_skinned {
            true => None,
            false => instancing::instances(&self.document.root, reader.buffers, placed.node, budget, ledger)
                .map_err(|error| error.within(format_args!("nodes[{}]", placed.number)))?,
        };
        if is_skinned && instancing::extension(placed.node).is_some() {
            let name = instancing::EXTENSION;
            let text = format!("{name} of a node with a skin, whose own place does not count: shown once");
            ledger.note_in(Treatment::Ignored, text, Scope::Mesh(place));
        }
        let transforms = match instances {
            Some(instances) => {
                ledger.note_in(Treatment::Honoured, "instances of a mesh", Scope::Mesh(place));
                instances.into_iter().map(|instance| compose(&placed.to_world, &instance)).collect()
            }
            None => {
                budget.take::<Object>(1)?;
                vec![if is_skinned { DAffine3::IDENTITY } else { placed.to_world }]
            }
        };
        let name = placed.name();
        for transform in transforms {
            // A scale of 0 is how exporters hide things.
            if Transform::new(transform).is_err() {
                ledger.note(Treatment::Warning, "object without extent (a scale of 0): left out", 1);
                continue;
            }
            let shape = scene::Shape::Mesh(place);
            model.objects.push(Object { name: name.clone(), shape, transform, material: None });
        }
        Ok(())
    }
}
