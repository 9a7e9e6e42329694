//! glTF 2.0, as text (`.gltf`) and binary (`.glb`).
//!
//! The crate `gltf` gives the JSON its types and finds dangling references. All else is here: the container, the
//! buffers, accessors that check every count against the bytes there are, and what the scene makes of them.
//!
//! ```text
//! container -> document -> buffers -> accessor -> mesh (topology), instancing
//!                             |-> images -> material (phong)
//!              document -> nodes -> objects, cameras, lights
//! ```

mod accessor;
mod budget;
mod buffers;
mod cameras;
mod container;
mod document;
mod images;
mod instancing;
mod lights;
mod material;
mod mesh;
mod nodes;
mod topology;
mod uri;

#[cfg(test)]
mod tests;

use std::path::Path;

use ::gltf::json::Root;

use crate::error::Result;
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, LoadOptions, Model, Treatment};
use crate::geometry::TriangleMesh;
use crate::math::Transform;
use crate::math::transform::compose;
use crate::progress::Progress;
use crate::scene::{Object, Shape};
use budget::Budget;
use buffers::Buffers;
use cameras::Cameras;
use container::Container;
use document::Document;
use images::Textures;
use material::MaterialReader;
use mesh::MeshReader;
use nodes::PlacedNode;

/// Reads a `.gltf` or `.glb` file: the default scene, or the first, or all nodes if there are no scenes.
///
/// Lengths are metres and +Y is up, as the format says; [`LoadOptions::up`] turns the whole scene if it says otherwise.
/// A glTF mesh becomes one [`TriangleMesh`](crate::geometry::TriangleMesh) however many nodes show it, its primitives
/// one after the other. Texture coordinates are turned so that v goes up. Lights keep their physical units.
///
/// # Errors
/// Each names the file and, where there is one, the place in the JSON: a file's error for what is malformed, missing or
/// out of bounds; unsupported for required extensions that are not read; a limit for what does not fit memory.
pub fn load(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let file = options.limits.read_file(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut model = read(&file, folder, options, progress).map_err(|error| error.at_path(path))?;
    model.ledger.note_file(path);
    Ok(model)
}

/// Reads a file that is in memory; `folder` is where its relative URIs start from.
///
/// # Errors
/// As [`load`], without the path.
pub fn read(file: &[u8], folder: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let mut ledger = Ledger::default();
    let container = Container::split(file)?;
    let document = Document::parse(container.json, &mut ledger)?;
    let root = &document.root;
    let surroundings = Surroundings::new(folder, options);
    let buffers = Buffers::read(root, container.binary, &surroundings, &mut ledger)?;
    let placed = nodes::place(&document, options.up, &options.limits, &mut ledger)?;
    note_unread_parts(root, &placed, &mut ledger);
    progress.check()?;

    let mut model = Model::default();
    let wanted = root.materials.iter().flat_map(material::textures_of);
    let mut textures = Textures::decode(root, &buffers, &surroundings, wanted, &mut ledger);
    progress.check()?;
    let mut materials = MaterialReader {
        textures: &mut textures,
        ledger: &mut ledger,
        colored: &material::colored(root),
        cull_back_faces: options.cull_back_faces,
    };
    for (number, source) in root.materials.iter().enumerate() {
        model.materials.push(materials.read(number, source));
    }
    if needs_default_material(root) {
        let source = ::gltf::json::Material { name: Some("default".into()), ..Default::default() };
        model.materials.push(materials.read(root.materials.len(), &source));
    }
    model.textures = textures.into_textures();

    let mut budget = Budget::new(file.len() as u64 + buffers.total_bytes(), options.limits);
    let reader = MeshReader {
        root,
        buffers: &buffers,
        materials: &model.materials,
        default_material: root.materials.len() as u32,
        normals: options.normals,
    };
    let (meshes, places) = read_meshes(&reader, &placed, &mut budget, &mut ledger, progress)?;
    model.meshes = meshes;
    let mut cameras = Cameras::default();
    for node in &placed {
        place_objects(root, &buffers, node, &places, &mut model, &mut budget, &mut ledger)?;
        cameras.add(root, node, &mut ledger);
        model.lights.extend(lights::read(root, node, &mut ledger));
    }
    model.cameras = cameras.into_list();
    model.physical_lights = !model.lights.is_empty();
    model.ledger = ledger;
    Ok(model)
}

/// Whether some primitive has no material, or there is none at all.
fn needs_default_material(root: &Root) -> bool {
    let mut primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    root.materials.is_empty() || primitives.any(|primitive| primitive.material.is_none())
}

/// Reads the meshes that placed nodes show, in file order; and by mesh number their places among these, `None` for
/// meshes that are not shown or have no triangles.
fn read_meshes(
    reader: &MeshReader,
    placed: &[PlacedNode],
    budget: &mut Budget,
    ledger: &mut Ledger,
    progress: &dyn Progress,
) -> Result<(Vec<TriangleMesh>, Vec<Option<u32>>)> {
    let mut is_shown = vec![false; reader.root.meshes.len()];
    for mesh in placed.iter().filter_map(|node| node.node.mesh) {
        is_shown[mesh.value()] = true;
    }
    progress.begin("load", is_shown.iter().filter(|&&shown| shown).count() as u64);
    let mut meshes = Vec::new();
    let mut places = vec![None; is_shown.len()];
    for number in (0..is_shown.len()).filter(|&number| is_shown[number]) {
        progress.check()?;
        let mesh = reader.read(number, budget, ledger)?;
        if mesh.triangle_count() > 0 {
            places[number] = u32::try_from(meshes.len()).ok();
            meshes.push(mesh);
        }
        progress.advance(1);
    }
    let unused = is_shown.iter().filter(|&&shown| !shown).count() as u64;
    if unused > 0 {
        ledger.note(Treatment::Ignored, "mesh that no node of the scene shows", unused);
    }
    Ok((meshes, places))
}

/// Adds the objects of a node: one, or one an instance.
fn place_objects(
    root: &Root,
    buffers: &Buffers,
    placed: &PlacedNode,
    places: &[Option<u32>],
    model: &mut Model,
    budget: &mut Budget,
    ledger: &mut Ledger,
) -> Result<()> {
    let Some(mesh) = placed.node.mesh.and_then(|mesh| places[mesh.value()]) else { return Ok(()) };
    let instances = instancing::instances(root, buffers, placed.node, budget, ledger)
        .map_err(|error| error.within(format_args!("nodes[{}]", placed.number)))?;
    let transforms = match instances {
        Some(instances) => instances.into_iter().map(|instance| compose(&placed.to_world, &instance)).collect(),
        None => {
            budget.take::<Object>(1)?;
            vec![placed.to_world]
        }
    };
    let name = placed.name();
    for transform in transforms {
        // A scale of 0 is how exporters hide things.
        if Transform::new(transform).is_err() {
            ledger.note(Treatment::Warning, "object without extent (a scale of 0): left out", 1);
            continue;
        }
        model.objects.push(Object { name: name.clone(), shape: Shape::Mesh(mesh), transform, material: None });
    }
    Ok(())
}

fn note_unread_parts(root: &Root, placed: &[PlacedNode], ledger: &mut Ledger) {
    let skinned = placed.iter().filter(|node| node.node.skin.is_some()).count();
    let other_scenes = root.scenes.len().saturating_sub(1);
    for (count, feature) in
        [(root.animations.len(), "animation"), (skinned, "skinned mesh: shown unposed"), (other_scenes, "other scene")]
    {
        if count > 0 {
            ledger.note(Treatment::Ignored, feature, count as u64);
        }
    }
}
