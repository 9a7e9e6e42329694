//! glTF 2.0, as text (`.gltf`) and binary (`.glb`).
//!
//! The crate `gltf` gives the JSON its types and finds dangling references. All else is here: the container, the
//! buffers, accessors that check every count against the bytes there are, and what the scene makes of them.
//!
//! ```text
//! container -> document -> buffers -> accessor (bytes)
//! animation (sampler) -> nodes -> shown -> mesh (topology, pose, skin, builder), instancing -> objects
//!                          |-> cameras, lights        images -> material
//! ```

mod accessor;
mod animation;
mod budget;
mod buffers;
mod builder;
mod bytes;
mod cameras;
mod choice;
mod container;
mod document;
mod images;
mod instancing;
mod lights;
mod material;
mod mesh;
mod nodes;
mod pose;
mod sampler;
mod shown;
mod skin;
mod topology;
mod uri;

#[cfg(test)]
mod tests;

use std::path::Path;

use ::gltf::json::mesh::{Mode, Semantic};
use ::gltf::json::validation::Checked::Valid;
use ::gltf::json::{self, Index, Root};

use crate::error::Result;
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, LoadOptions, Model, Outline};
use crate::progress::Progress;
use budget::Budget;
use buffers::Buffers;
use bytes::Bytes;
use cameras::Cameras;
use container::Container;
use document::Document;
use images::Textures;
use material::MaterialReader;
use mesh::MeshReader;
use shown::Shown;

/// Reads a `.gltf` or `.glb` file: the scene that is asked for, or the default one, or the first, or all nodes if there
/// are no scenes; at [`LoadOptions::time`] of an animation, or as everything stands in the file.
///
/// Lengths are metres and +Y is up, as the format says; [`LoadOptions::up`] turns the whole scene if it says otherwise.
/// A glTF mesh becomes one [`TriangleMesh`](crate::geometry::TriangleMesh) however many nodes show it, its primitives
/// one after the other; shown in several shapes, by morph targets or skins, it becomes one for each. Texture coordinates
/// are turned so that v goes up. Lights keep their physical units.
///
/// The file stays on disk and is read piece by piece, so that little more memory is taken than what becomes of it.
///
/// # Errors
/// Each names the file and, where there is one, the place in the JSON: a file's error for what is malformed, missing or
/// out of bounds; unsupported for required extensions that are not read; a limit for what does not fit memory; a caller's
/// for a scene or animation that does not exist.
pub fn load(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let read = || read_bytes(&Bytes::open(path, &options.limits)?, folder, options, progress);
    let mut model = read().map_err(|error| error.at_path(path))?;
    model.ledger.note_file(path);
    Ok(model)
}

/// How large the meshes of a file are, by the counts in its JSON: whether a node shows them or not, each once.
///
/// # Errors
/// As [`load`], for what is wrong with the container and the JSON.
pub fn outline(path: &Path, options: &LoadOptions) -> Result<Outline> {
    let read = || -> Result<Outline> {
        let file = Bytes::open(path, &options.limits)?;
        let document = Document::parse(&Container::split(&file)?.json.all()?, &mut Ledger::default())?;
        Ok(outline_of(&document.root))
    };
    read().map_err(|error| error.at_path(path))
}

fn outline_of(root: &Root) -> Outline {
    let count = |accessor: Option<Index<json::Accessor>>| {
        let accessor = accessor.and_then(|index| root.get(index));
        // A count that its bytes cannot hold is a mistake, which the reader tells.
        let most = |accessor: &json::Accessor| {
            let view = accessor.buffer_view.and_then(|view| root.get(view));
            view.map_or(u64::from(u32::MAX), |view| view.byte_length.0)
        };
        accessor.map_or(0, |accessor| if accessor.count.0 <= most(accessor) { accessor.count.0 } else { 0 })
    };
    let mut outline = Outline::default();
    for mesh in &root.meshes {
        let (mut triangles, mut vertices, mut bytes) = (0, 0, 12);
        for primitive in &mesh.primitives {
            let of = |wanted: Semantic| {
                let found = primitive.attributes.iter().find(|(name, _)| **name == Valid(wanted.clone()));
                found.map(|(_, accessor)| *accessor)
            };
            let positions = count(of(Semantic::Positions));
            let corners = if primitive.indices.is_some() { count(primitive.indices) } else { positions };
            triangles += match primitive.mode {
                Valid(Mode::Triangles) => corners / 3,
                Valid(Mode::TriangleStrip | Mode::TriangleFan) => corners.saturating_sub(2),
                _ => continue,
            };
            vertices += positions;
            // An attribute that one primitive has is an array for all.
            let sizes = [(Semantic::Normals, 12), (Semantic::TexCoords(0), 8), (Semantic::TexCoords(1), 8)];
            let own = sizes.into_iter().chain([(Semantic::Colors(0), 8), (Semantic::Tangents, 16)]);
            bytes =
                bytes.max(12 + own.filter(|(name, _)| of(name.clone()).is_some()).map(|(_, size)| size).sum::<u64>());
        }
        outline.add(triangles, vertices, bytes);
    }
    outline
}

/// Reads a file that is in memory; `folder` is where its relative URIs start from.
///
/// # Errors
/// As [`load`], without the path.
pub fn read(file: &[u8], folder: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    read_bytes(&Bytes::Memory(file.into()), folder, options, progress)
}

/// Reads a file, wherever its bytes are.
fn read_bytes(file: &Bytes, folder: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    let mut ledger = Ledger::default();
    let container = Container::split(file)?;
    let document = Document::parse(&container.json.all()?, &mut ledger)?;
    let root = &document.root;
    let surroundings = Surroundings::new(folder, options);
    let buffers = Buffers::find(root, container.binary, &surroundings, &mut ledger, progress)?;
    let mut budget = Budget::new(file.len() + buffers.total_bytes(), options.limits);
    let scene = nodes::scene(root, options.scene.as_deref(), &mut ledger)?;
    let pose = animation::pose(&document, &buffers, options, &mut budget, &mut ledger)?;
    let placed = nodes::place(root, &pose.placements, scene, options.up, &options.limits, &mut ledger)?;
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

    let materials = std::mem::take(&mut model.materials);
    let reader = MeshReader {
        document: &document,
        buffers: &buffers,
        materials: &materials,
        default_material: root.materials.len() as u32,
        normals: options.normals,
    };
    let shown = Shown::find(&reader, &placed, &pose, options.up, &mut budget, &mut ledger)?;
    shown.read(&reader, &mut model, &mut budget, &mut ledger, progress)?;
    model.materials = materials;
    let mut cameras = Cameras::default();
    for node in &placed {
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
