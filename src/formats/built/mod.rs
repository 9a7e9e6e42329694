//! Scenes that are kept as they were built: geometry, trees, images and materials in one file, which is mapped into memory instead of
//! being read and built.
//!
//! Its head tells of every section where it is and what its checksum is. Opening a file checks all of them, and every
//! number that names something else, whatever its checksum says; that boxes of trees contain what is below them is left to checksums. Of
//! the files that the scene was built from, those that are still there must be the same.

mod container;
mod description;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use container::{Container, Section};
use description::{Description, SourceFile, TexelKind};

use crate::accel::{KeptTree, Kind, Preset};
use crate::error::{Error, Fault, Result};
use crate::formats::atomic_file::write_durably;
use crate::formats::fingerprint::Fingerprint;
use crate::formats::{Ledger, LoadOptions, Loaded};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{Group, Materials};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::auto::Automatic;
use crate::scene::texture::{Level, Texels};
use crate::scene::{Background, Scene, Texture};

pub use container::is_built;

/// What helps where a file is damaged or old.
const AGAIN: &str = "build it again with `whitted build`";

/// What a file of a built scene has beside the scene.
#[derive(Debug, Clone)]
pub struct Built {
    /// Of which kind the trees are.
    pub kind: Kind,
    /// How they were built.
    pub preset: Preset,
    /// One a mesh.
    pub trees: Vec<KeptTree>,
    /// How the files were read that it was built from.
    pub options: LoadOptions,
    /// What tells their scene from others.
    pub fingerprint: Fingerprint,
    /// Those of them that are still there.
    pub sources: Vec<PathBuf>,
    /// The file.
    pub path: PathBuf,
    /// Its bytes.
    pub bytes: u64,
    /// Seconds that checking them took.
    pub check_seconds: f64,
}

/// How the scene of a renderer was read.
#[derive(Debug)]
pub struct Origin<'a> {
    /// The file that was opened.
    pub input: &'a Path,
    /// How.
    pub options: &'a LoadOptions,
    /// When reading began.
    pub since: SystemTime,
    /// What was met, and which files were read.
    pub ledger: &'a Ledger,
    /// What the scene lacked and was given.
    pub automatic: Automatic,
    /// How the trees were built.
    pub preset: Preset,
}

impl Built {
    /// The renderer of the scene, which was read with this.
    ///
    /// # Errors
    /// As [`Renderer::restore`], with the file.
    pub fn renderer(&self, scene: Scene, progress: &dyn Progress) -> Result<Renderer> {
        let renderer = Renderer::restore(scene, self.kind, &self.trees, progress);
        renderer
            .map_err(|error| if error.fault() == Fault::File { error.at_path(&self.path).remedy(AGAIN) } else { error })
    }
}

/// Whether structures of a kind can be kept.
///
/// # Errors
/// When they cannot.
pub fn check_kind(kind: Kind) -> Result<()> {
    if kind.can_be_kept() {
        return Ok(());
    }
    let kept: Vec<_> = Kind::ALL.iter().filter(|kind| kind.can_be_kept()).map(|kind| kind.name()).collect();
    Err(Error::caller(format!("the structure `{}` cannot be kept", kind.name()))
        .remedy(format!("choose one of {}", kept.join(", "))))
}

/// Writes a scene and its trees to a file, whole or not at all, and returns its bytes. Each byte of them is two steps.
///
/// # Errors
/// A structure that cannot be kept; sources that were changed since, or cannot be read again; the system's; a cancellation.
pub fn save(renderer: &Renderer, origin: &Origin<'_>, path: &Path, progress: &dyn Progress) -> Result<u64> {
    check_kind(renderer.kind())?;
    let trees = renderer.arrays().expect("structures of such a kind have arrays");
    let scene = renderer.scene();
    let files: Vec<&Path> = origin.ledger.files().filter(|file| *file != origin.input).collect();
    let input = SourceFile::of(origin.input, origin.since, path)?;
    let others = files.iter().map(|file| SourceFile::of(file, origin.since, path)).collect::<Result<Vec<_>>>()?;
    let fingerprint = Fingerprint::of_contents(
        input.content(),
        files.iter().zip(&others).map(|(file, source)| (*file, source.content())),
    );
    let mut ledger = origin.ledger.clone();
    ledger.forget_files();

    let mut sections = Vec::new();
    let mut images = Images::default();
    let background = match &scene.background {
        Background::Color(color) => description::Background::Color(*color),
        &Background::Gradient { bottom, top, up } => description::Background::Gradient { bottom, top, up },
        Background::Image { texture, intensity } => {
            description::Background::Image { texture: images.add(texture), intensity: *intensity }
        }
        Background::Transparent => description::Background::Transparent,
    };
    let textures = scene.textures.iter().map(|texture| images.add(texture)).collect();
    for (item, texels) in (0..).zip(&images.texels) {
        let bytes = match texels {
            Texels::Srgb8(texels) | Texels::Data8(texels) => bytemuck::cast_slice(texels),
            Texels::Linear32(texels) => bytemuck::cast_slice(texels),
        };
        sections.push(Section { kind: container::Kind::Texels, item, bytes });
    }
    let mut meshes = Vec::with_capacity(scene.meshes.len());
    for ((item, mesh), tree) in (0..).zip(&scene.meshes).zip(&trees) {
        for (kind, bytes) in arrays(mesh) {
            sections.push(Section { kind, item, bytes });
        }
        sections.push(Section { kind: container::Kind::Nodes, item, bytes: tree.nodes });
        sections.push(Section { kind: container::Kind::Leaves, item, bytes: tree.leaves });
        meshes.push(description::Mesh {
            name: mesh.name.clone(),
            origin: mesh.origin,
            exponent: mesh.exponent,
            material: match mesh.materials {
                Materials::One(material) => material,
                Materials::PerTriangle(_) => 0,
            },
            groups: mesh.groups.iter().map(|group| (group.name.to_string(), group.first_triangle)).collect(),
            dropped_counts: mesh.dropped_counts,
            rounding: mesh.rounding,
            root: tree.root,
            bounds: tree.bounds,
        });
    }
    let description = Description {
        origin: scene.origin,
        ambient: scene.ambient,
        background,
        cameras: scene.cameras.clone(),
        active_camera: scene.active_camera,
        film: scene.film,
        lights: scene.lights.clone(),
        materials: scene.materials.clone(),
        quadrics: scene.quadrics.clone(),
        objects: scene.objects.clone(),
        meshes,
        textures,
        automatic: origin.automatic,
        ledger,
        options: origin.options.clone(),
        structure: renderer.kind().name().into(),
        preset: origin.preset,
        scene: fingerprint,
        sources: std::iter::once(input).chain(others).collect(),
    };
    let description = postcard::to_stdvec(&description).expect("lists of names and numbers can be written");
    sections.insert(0, Section { kind: container::Kind::Description, item: 0, bytes: &description });
    let mut bytes = 0;
    write_durably(path, |sink| {
        bytes = container::write(sink, path, &sections, progress)?;
        Ok(())
    })?;
    Ok(bytes)
}

/// The arrays of a mesh that there are.
fn arrays(mesh: &TriangleMesh) -> impl Iterator<Item = (container::Kind, &[u8])> {
    use container::Kind;
    fn bytes<T: bytemuck::Pod>(array: &crate::array::Array<T>) -> &[u8] {
        bytemuck::cast_slice(array)
    }
    let materials = match &mesh.materials {
        Materials::One(_) => None,
        Materials::PerTriangle(materials) => Some(materials),
    };
    [
        Some((Kind::Positions, bytes(&mesh.positions))),
        Some((Kind::Indices, bytes(&mesh.indices))),
        mesh.normals.as_ref().map(|normals| (Kind::Normals, bytes(normals))),
        mesh.uvs.as_ref().map(|uvs| (Kind::Uvs, bytes(uvs))),
        mesh.second_uvs.as_ref().map(|uvs| (Kind::SecondUvs, bytes(uvs))),
        mesh.colors.as_ref().map(|colors| (Kind::Colors, bytes(colors))),
        mesh.tangents.as_ref().map(|tangents| (Kind::Tangents, bytes(tangents))),
        materials.map(|materials| (Kind::Materials, bytes(materials))),
        mesh.source_faces.as_ref().map(|faces| (Kind::SourceFaces, bytes(faces))),
        Some((Kind::Dropped, bytes(&mesh.dropped))).filter(|_| !mesh.dropped.is_empty()),
    ]
    .into_iter()
    .flatten()
}

/// Texels, each piece of memory once.
#[derive(Default)]
struct Images {
    texels: Vec<Texels>,
}

impl Images {
    fn add(&mut self, texture: &Texture) -> description::Texture {
        let image = (texture.width, texture.height, &texture.texels);
        let levels = std::iter::once(image).chain(texture.levels.iter().map(Level::parts));
        let levels = levels.map(|(width, height, texels)| {
            let known = self.texels.iter().position(|known| known.is_shared_with(texels));
            let section = known.unwrap_or_else(|| {
                self.texels.push(texels.clone());
                self.texels.len() - 1
            });
            let kind = match texels {
                Texels::Srgb8(_) => TexelKind::Srgb8,
                Texels::Data8(_) => TexelKind::Data8,
                Texels::Linear32(_) => TexelKind::Linear32,
            };
            description::Level { width, height, kind, section: section as u32 }
        });
        let levels = levels.collect();
        description::Texture { name: texture.name.clone(), wrap: texture.wrap, filter: texture.filter, levels }
    }
}

/// Maps a file of a built scene and checks it.
///
/// # Errors
/// A file that is damaged, was written by another version, or whose sources have changed; a cancellation.
pub fn open(path: &Path, progress: &dyn Progress) -> Result<Loaded> {
    let start = Instant::now();
    let container = Container::open(path)?;
    container.verify(progress)?;
    let check_seconds = start.elapsed().as_secs_f64();
    let bytes = container.mapping.bytes().len() as u64;
    let description = container.bytes(container::Kind::Description, 0)?;
    let flawed = |what: &str| {
        Error::file(format!("the description of this built scene is damaged: {what}")).at_path(path).remedy(AGAIN)
    };
    let damaged = |error: Error| error.at_path(path).remedy(AGAIN);
    let description: Description = postcard::from_bytes(description).map_err(|cause| flawed(&cause.to_string()))?;
    let sources = description.sources.iter().map(|source| source.check(path)).collect::<Result<Vec<_>>>()?;
    let sources: Vec<PathBuf> = sources.into_iter().flatten().collect();
    let mut ledger = description.ledger;
    ledger.note_file(path);
    sources.iter().for_each(|source| ledger.note_file(source));
    let kind = Kind::ALL.iter().copied().find(|kind| kind.name() == description.structure);
    let kind = kind.filter(|kind| kind.can_be_kept()).ok_or_else(|| flawed("it has trees of no known kind"))?;

    let mut images = ReadImages { container: &container, texels: Vec::new() };
    let textures = description.textures.into_iter().map(|texture| images.texture(texture)).collect::<Result<_>>();
    let background = match description.background {
        description::Background::Color(color) => Ok(Background::Color(color)),
        description::Background::Gradient { bottom, top, up } => Ok(Background::Gradient { bottom, top, up }),
        description::Background::Image { texture, intensity } => {
            images.texture(texture).map(|texture| Background::Image { texture, intensity })
        }
        description::Background::Transparent => Ok(Background::Transparent),
    };
    let mut meshes = Vec::with_capacity(description.meshes.len());
    let mut trees = Vec::with_capacity(description.meshes.len());
    for (item, mesh) in (0..).zip(description.meshes) {
        let range = |kind| container.range(kind, item).ok_or_else(|| flawed("it has meshes without a tree"));
        trees.push(KeptTree {
            mapping: Arc::clone(&container.mapping),
            nodes: range(container::Kind::Nodes)?,
            leaves: range(container::Kind::Leaves)?,
            root: mesh.root,
            bounds: mesh.bounds,
        });
        meshes.push(Arc::new(read_mesh(&container, item, mesh).map_err(damaged)?));
    }
    let scene = Scene {
        origin: description.origin,
        ambient: description.ambient,
        background: background.map_err(damaged)?,
        cameras: description.cameras,
        active_camera: description.active_camera,
        film: description.film,
        lights: description.lights,
        materials: description.materials,
        textures: textures.map_err(damaged)?,
        meshes,
        quadrics: description.quadrics,
        objects: description.objects,
    };
    scene.check_numbers().map_err(|what| flawed(&what))?;
    let built = Built {
        kind,
        preset: description.preset,
        trees,
        options: description.options,
        fingerprint: description.scene,
        sources,
        path: path.to_path_buf(),
        bytes,
        check_seconds,
    };
    Ok(Loaded { scene, ledger, automatic: description.automatic, built: Some(Box::new(built)) })
}

/// A mesh whose arrays are in the file; its numbers are checked.
fn read_mesh(container: &Container, item: u32, mesh: description::Mesh) -> Result<TriangleMesh> {
    use container::Kind;
    let groups = mesh.groups.into_iter().map(|(name, first_triangle)| Group { name: name.into(), first_triangle });
    let read = TriangleMesh {
        name: mesh.name,
        origin: mesh.origin,
        exponent: mesh.exponent,
        positions: container.array(Kind::Positions, item)?,
        indices: container.array(Kind::Indices, item)?,
        normals: container.optional_array(Kind::Normals, item)?,
        uvs: container.optional_array(Kind::Uvs, item)?,
        second_uvs: container.optional_array(Kind::SecondUvs, item)?,
        colors: container.optional_array(Kind::Colors, item)?,
        tangents: container.optional_array(Kind::Tangents, item)?,
        materials: match container.optional_array(Kind::Materials, item)? {
            Some(materials) => Materials::PerTriangle(materials),
            None => Materials::One(mesh.material),
        },
        groups: groups.collect(),
        source_faces: container.optional_array(Kind::SourceFaces, item)?,
        dropped: container.optional_array(Kind::Dropped, item)?.unwrap_or_default(),
        dropped_counts: mesh.dropped_counts,
        rounding: mesh.rounding,
    };
    read.check_numbers()?;
    Ok(read)
}

/// Texels that were read, by their sections.
struct ReadImages<'a> {
    container: &'a Container,
    texels: Vec<((TexelKind, u32), Texels)>,
}

impl ReadImages<'_> {
    fn texture(&mut self, texture: description::Texture) -> Result<Texture> {
        let flawed = || Error::file(format!("the image `{}` is damaged", texture.name));
        let levels = texture.levels.iter().map(|level| Some((level.width, level.height, self.texels(level)?)));
        let mut levels = levels.collect::<Option<Vec<_>>>().ok_or_else(flawed)?.into_iter();
        let (width, height, texels) = levels.next().ok_or_else(flawed)?;
        Ok(Texture {
            name: texture.name,
            width,
            height,
            texels,
            wrap: texture.wrap,
            filter: texture.filter,
            levels: levels.map(|(width, height, texels)| Level::new(width, height, texels)).collect(),
        })
    }

    /// The texels of an image of its size; `None` where there are none.
    fn texels(&mut self, level: &description::Level) -> Option<Texels> {
        let key = (level.kind, level.section);
        let count = (level.width as usize).checked_mul(level.height as usize).filter(|&count| count > 0)?;
        if let Some((_, texels)) = self.texels.iter().find(|(known, _)| *known == key) {
            return Some(texels.clone()).filter(|texels| texels.count() == count);
        }
        let section = (container::Kind::Texels, level.section);
        let texels = match level.kind {
            TexelKind::Srgb8 => Texels::Srgb8(self.container.array(section.0, section.1).ok()?.as_slice().into()),
            TexelKind::Data8 => Texels::Data8(self.container.array(section.0, section.1).ok()?.as_slice().into()),
            TexelKind::Linear32 => Texels::Linear32(self.container.array(section.0, section.1).ok()?.as_slice().into()),
        };
        self.texels.push((key, texels.clone()));
        Some(texels).filter(|texels| texels.count() == count)
    }
}
