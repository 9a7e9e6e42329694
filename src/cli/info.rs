//! `whitted info`: what a scene holds, needs and costs. Its JSON is documented in the manual's page on the command
//! line, and stable: a change that breaks a reader raises `schema`.

use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::arguments::{CameraArguments, InfoArguments};
use super::build::{Plan, open_scene};
use super::camera;
use super::doctor::Diagnosis;
use super::estimate::Estimate;
use super::info_text;
use super::ledger::{self, Told};
use super::memory_limit::needed_bytes;
use super::stats_json::{SCHEMA, lossy, lossy_list, timed};
use super::terminal::{self, Terminal};
use crate::error::{Error, Result};
use crate::formats::ledger::Entry;
use crate::formats::reach::{Census, Reach};
use crate::formats::{Ledger, LoadOptions, Loaded, Treatment};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::{DroppedCounts, Materials, Rounding};
use crate::render::{BuildStats, Renderer};
use crate::scene::extent::Extents;
use crate::scene::needs::Needs;
use crate::scene::{FilmSettings, LightKind, Scene};

/// The whole document.
#[derive(Debug, Serialize)]
pub struct Info<'a> {
    pub schema: u32,
    #[serde(serialize_with = "lossy")]
    pub input: &'a Path,
    /// All files that were read.
    #[serde(serialize_with = "lossy_list")]
    pub files: Vec<&'a Path>,
    pub triangles: Triangles,
    pub meshes: usize,
    /// Names that the file gives to consecutive triangles of a mesh, in order.
    pub groups: Vec<GroupInfo>,
    pub instances: usize,
    pub quadrics: usize,
    pub materials: Vec<String>,
    pub textures: Vec<TextureInfo>,
    pub lights: Vec<LightInfo>,
    pub cameras: Vec<String>,
    /// Name of the camera that `render` uses.
    pub active_camera: Option<String>,
    pub film: FilmSettings,
    /// In the file's coordinates; null where there is nothing or nothing bounded.
    pub bounds: Option<BoundsInfo>,
    /// Where the renderer has its zero, in the file's coordinates.
    pub origin: [f64; 3],
    /// What storing coordinates in f32 lost; null without meshes.
    pub rounding: Option<RoundingInfo>,
    pub needs: Needs,
    pub bytes: Bytes,
    /// Geometry's bytes for each triangle in the meshes, dropped ones included; null without triangles.
    pub bytes_per_triangle: Option<PerTriangle>,
    pub ledger: Vec<LedgerEntry>,
    /// What is wrong with the meshes; null unless `--validate` was given.
    pub doctor: Option<Diagnosis>,
    /// Null unless `--tree`, `--validate` or `--estimate` was given.
    pub tree: Option<Tree>,
    /// What rendering will take; null unless `--estimate` was given.
    pub estimate: Option<Estimate>,
}

/// Numbers of triangles.
#[derive(Debug, Serialize)]
pub struct Triangles {
    /// That can be hit, every mesh counted once.
    pub unique: u64,
    /// That can be hit, every instance counted.
    pub instanced: u64,
    /// That cannot be hit, by reason, every mesh counted once.
    pub dropped: DroppedCounts,
}

/// Consecutive triangles with a name.
#[derive(Debug, Serialize)]
pub struct GroupInfo {
    pub name: String,
    /// The mesh, by its position among all.
    pub mesh: usize,
    pub first_triangle: u32,
    /// How many, dropped ones included.
    pub triangles: u32,
}

/// One image.
#[derive(Debug, Serialize)]
pub struct TextureInfo {
    pub name: String,
    pub width: u32,
    pub height: u32,
}

/// One light.
#[derive(Debug, Serialize)]
pub struct LightInfo {
    pub name: String,
    pub kind: &'static str,
}

/// A box.
#[derive(Debug, Serialize)]
pub struct BoundsInfo {
    pub min: [f64; 3],
    pub max: [f64; 3],
}

/// What storing coordinates in f32 lost, of the mesh where that is most for its finest edge; in its file's units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoundingInfo {
    /// The mesh.
    pub mesh: String,
    /// The largest distance of a stored coordinate from the file's.
    pub coordinate_loss: f64,
    /// The shortest edge of a face in the file; null if there is none.
    pub finest_edge: Option<f64>,
}

/// Bytes by part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Bytes {
    pub positions: u64,
    pub indices: u64,
    pub normals: u64,
    pub uvs: u64,
    /// Material numbers of triangles.
    pub materials: u64,
    pub textures: u64,
}

/// [`Bytes`] but for textures, over the number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PerTriangle {
    pub positions: f64,
    pub indices: f64,
    pub normals: f64,
    pub uvs: f64,
    pub materials: f64,
}

/// One line of the loader's ledger.
#[derive(Debug, Serialize)]
pub struct LedgerEntry {
    pub treatment: Treatment,
    pub feature: String,
    /// How often.
    pub count: u64,
    /// What of the scene it concerns.
    #[serde(flatten)]
    pub reach: Reach,
}

/// What building took.
#[derive(Debug, Serialize)]
pub struct Tree {
    #[serde(flatten)]
    pub stats: BuildStats,
    /// Bytes of nodes and leaves for each triangle that can be hit, every mesh counted once; null without triangles.
    pub bytes_per_triangle: Option<f64>,
    /// Whether the trees were checked and found sound.
    pub validated: bool,
}

/// Prints what a file holds.
///
/// # Errors
/// When the file cannot be read, when its trees cannot be built, or when they are not sound.
pub fn run(arguments: &InfoArguments) -> Result<()> {
    let terminal = Terminal::new(false)?;
    super::use_threads(arguments.build.threads)?;
    // Places are told by the faces of the file.
    let options = LoadOptions { faces: arguments.validate, ..arguments.load.options() };
    if arguments.tree || arguments.validate || arguments.estimate.estimate {
        arguments.build.refuse_what_does_not_fit(&arguments.input, &options)?;
    }
    let (loaded, load) = timed(|| open_scene(&arguments.input, &arguments.load, &options, &terminal));
    terminal.clear();
    let Loaded { mut scene, ledger, automatic, built } = loaded?;
    if arguments.estimate.values.size.is_some() {
        arguments.estimate.values.apply(&mut scene.film);
        camera::choose(&mut scene, automatic, &CameraArguments::default(), true, false)?;
    } else {
        arguments.estimate.values.apply(&mut scene.film);
    }
    ledger::report(&arguments.input, &ledger, &scene, Told::Warnings, arguments.load.strict)?;
    let mut info = Info::of(&arguments.input, &scene, &ledger);
    if arguments.validate {
        info.doctor = Some(Diagnosis::of(&scene, info.bounds.as_ref()));
    }
    if arguments.tree || arguments.validate || arguments.estimate.estimate {
        let plan = Plan::of(&arguments.build, &scene, built.as_deref(), 0)?;
        let needed = needed_bytes(&scene, plan.kind());
        let renderer = plan.renderer(scene, &terminal);
        terminal.clear();
        let mut renderer = renderer?;
        info.tree = Some(Tree::of(&renderer, arguments)?);
        if arguments.estimate.estimate {
            let threads = arguments.build.threads as usize;
            let estimate = Estimate::of(&mut renderer, load, needed, &arguments.estimate, threads, &terminal);
            terminal.clear();
            info.estimate = Some(estimate?);
        }
    }
    let text = if arguments.json {
        serde_json::to_string_pretty(&info).expect("names and numbers have a JSON form") + "\n"
    } else {
        info_text::of(&info)
    };
    terminal::print(text.as_bytes())
}

impl<'a> Info<'a> {
    /// Gathers everything but the tree.
    pub fn of(input: &'a Path, scene: &Scene, ledger: &'a Ledger) -> Self {
        let mut dropped = DroppedCounts::default();
        for counts in scene.meshes.iter().map(|mesh| mesh.dropped_counts) {
            dropped.non_finite += counts.non_finite;
            dropped.zero_area += counts.zero_area;
            dropped.bad_index += counts.bad_index;
        }
        let bytes = Bytes::of(scene);
        let all_triangles = scene.meshes.iter().map(|mesh| mesh.triangle_count()).sum();
        let texture = |texture: &crate::scene::Texture| TextureInfo {
            name: seen_from(input, &texture.name),
            width: texture.width,
            height: texture.height,
        };
        let light = |light: &crate::scene::Light| LightInfo { name: light.name.clone(), kind: light_kind(&light.kind) };
        let census = Census::of(scene);
        let entry = |(treatment, feature, entry): (_, &str, &Entry)| LedgerEntry {
            treatment,
            feature: feature.into(),
            count: entry.count,
            reach: census.reach(entry, None),
        };
        Self {
            schema: SCHEMA,
            input,
            files: ledger.files().collect(),
            triangles: Triangles { unique: live_triangles(scene), instanced: scene.instanced_triangles(), dropped },
            meshes: scene.meshes.len(),
            groups: groups(scene),
            instances: scene.objects.len(),
            quadrics: scene.quadrics.len(),
            materials: used_names(scene),
            textures: scene.textures.iter().map(texture).collect(),
            lights: scene.lights.iter().map(light).collect(),
            cameras: scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
            active_camera: scene.cameras.get(scene.active_camera).map(|camera| camera.name.clone()),
            film: scene.film,
            bounds: bounds(scene),
            origin: scene.origin.to_array(),
            rounding: rounding(scene),
            needs: Needs::of(scene),
            bytes,
            bytes_per_triangle: bytes.per_triangle(all_triangles),
            ledger: ledger.all().map(entry).collect(),
            doctor: None,
            tree: None,
            estimate: None,
        }
    }
}

impl Bytes {
    fn of(scene: &Scene) -> Self {
        let mut bytes = Self::default();
        for mesh in &scene.meshes {
            bytes.positions += size_of_val(mesh.positions.as_slice()) as u64;
            bytes.indices += size_of_val(mesh.indices.as_slice()) as u64;
            bytes.normals += mesh.normals.as_ref().map_or(0, |normals| size_of_val(normals.as_slice())) as u64;
            bytes.uvs += mesh.uvs.as_ref().map_or(0, |uvs| size_of_val(uvs.as_slice())) as u64;
            if let Materials::PerTriangle(materials) = &mesh.materials {
                bytes.materials += size_of_val(materials.as_slice()) as u64;
            }
        }
        bytes.textures = scene.textures.iter().map(|texture| texture.bytes() as u64).sum();
        bytes
    }

    fn per_triangle(&self, triangles: usize) -> Option<PerTriangle> {
        let share = |bytes: u64| bytes as f64 / triangles as f64;
        (triangles > 0).then(|| PerTriangle {
            positions: share(self.positions),
            indices: share(self.indices),
            normals: share(self.normals),
            uvs: share(self.uvs),
            materials: share(self.materials),
        })
    }
}

impl Tree {
    fn of(renderer: &Renderer, arguments: &InfoArguments) -> Result<Self> {
        if arguments.validate {
            renderer.validate().map_err(|flaw| {
                Error::limit(format!("a tree is not sound: {flaw}"))
                    .at_path(&arguments.input)
                    .remedy("this is a fault of the program: please report it")
            })?;
        }
        let stats = renderer.build_stats().clone();
        let triangles = live_triangles(renderer.scene());
        let bytes = (stats.node_bytes + stats.leaf_bytes) as f64;
        let bytes_per_triangle = (triangles > 0).then(|| bytes / triangles as f64);
        Ok(Self { stats, bytes_per_triangle, validated: arguments.validate })
    }
}

/// The name of a texture, where that is a path in the folder of `input`, as seen from there.
fn seen_from(input: &Path, name: &str) -> String {
    let folder = input.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let path = Path::new(name);
    let inner = path.strip_prefix(folder).ok().or_else(|| path.strip_prefix(std::path::absolute(folder).ok()?).ok());
    inner.and_then(Path::to_str).unwrap_or(name).to_owned()
}

/// Triangles that can be hit, every mesh counted once.
fn live_triangles(scene: &Scene) -> u64 {
    scene.meshes.iter().map(|mesh| mesh.live_count() as u64).sum()
}

fn light_kind(kind: &LightKind) -> &'static str {
    match kind {
        LightKind::Point { .. } => "point",
        LightKind::Directional { .. } => "directional",
        LightKind::Spot { .. } => "spot",
    }
}

/// The box around every object's own box, in the file's coordinates: tight unless an object is turned or sheared.
fn bounds(scene: &Scene) -> Option<BoundsInfo> {
    let extents = Extents::of(scene);
    let corners = scene.objects.iter().filter_map(|object| extents.corners(scene, object)).flatten();
    let (min, max) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), corner| (min.min(corner), max.max(corner)));
    min.cmple(max).all().then(|| BoundsInfo { min: min.to_array(), max: max.to_array() })
}

/// The mesh that lost most for its finest edge; of those that lost nothing, the first.
fn rounding(scene: &Scene) -> Option<RoundingInfo> {
    let share = |mesh: &TriangleMesh| mesh.rounding.largest_loss / mesh.rounding.finest_edge.unwrap_or(f64::INFINITY);
    let worst = scene.meshes.iter().rev().max_by(|a, b| share(a).total_cmp(&share(b)))?;
    let Rounding { largest_loss, finest_edge } = worst.rounding;
    Some(RoundingInfo { mesh: worst.name.clone(), coordinate_loss: largest_loss, finest_edge })
}

/// The names within all meshes.
fn groups(scene: &Scene) -> Vec<GroupInfo> {
    let mut groups = Vec::new();
    for (mesh, own) in scene.meshes.iter().enumerate() {
        groups.extend(own.named_runs().map(|(name, first_triangle, triangles)| GroupInfo {
            name: name.to_owned(),
            mesh,
            first_triangle,
            triangles,
        }));
    }
    groups
}

/// The names of the materials in use.
fn used_names(scene: &Scene) -> Vec<String> {
    let used = scene.used_materials();
    scene.materials.iter().zip(used).filter(|(_, used)| *used).map(|(material, _)| material.name.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::Group;
    use crate::geometry::shapes;
    use crate::scene::{NamedCamera, Object, Shape, auto};
    use glam::{DAffine3, Vec3};

    /// One triangle far from zero, placed twice, with a second that has no area, and a sphere of radius 3.
    fn scene() -> Scene {
        let mesh = TriangleMesh {
            origin: DVec3::new(100.0, 0.0, 0.0),
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y].into(),
            indices: vec![[0, 1, 2], [0, 1, 1]].into(),
            normals: Some(vec![Vec3::Z; 3].into()),
            ..Default::default()
        };
        let object = |shape, transform| Object { name: String::new(), shape, transform, material: Some(0) };
        let mut scene = Scene {
            meshes: vec![mesh.finish().unwrap().into()],
            quadrics: vec![shapes::sphere()],
            objects: vec![
                object(Shape::Mesh(0), DAffine3::IDENTITY),
                object(Shape::Mesh(0), DAffine3::from_translation(DVec3::new(0.0, 0.0, 7.0))),
                object(Shape::Quadric(0), DAffine3::from_scale(DVec3::splat(3.0))),
            ],
            ..Default::default()
        };
        let camera = auto::frame(&scene, 0.0, 0.0, 0.5);
        scene.cameras.push(NamedCamera::new("only", camera));
        scene
    }

    #[test]
    fn instances_count_once_for_bytes_and_each_for_triangles() {
        let ledger = Ledger::default();
        let info = Info::of(Path::new("a.obj"), &scene(), &ledger);
        assert_eq!((info.triangles.unique, info.triangles.instanced, info.triangles.dropped.zero_area), (1, 2, 1));
        assert_eq!((info.meshes, info.instances, info.quadrics), (1, 3, 1));
        let expected = Bytes { positions: 36, indices: 24, normals: 36, ..Default::default() };
        assert_eq!(info.bytes, expected);
        let share = info.bytes_per_triangle.unwrap();
        assert_eq!((share.positions, share.indices, share.uvs), (18.0, 12.0, 0.0));
    }

    #[test]
    fn bounds_are_those_of_the_file_and_of_every_instance() {
        let bounds = bounds(&scene()).unwrap();
        assert_eq!((bounds.min, bounds.max), ([-3.0, -3.0, -3.0], [101.0, 3.0, 7.0]));
    }

    #[test]
    fn groups_tell_their_mesh_and_their_triangles() {
        let group = |name: &str, first_triangle| Group { name: name.into(), first_triangle };
        let mut scene = scene();
        let mesh = TriangleMesh { groups: vec![group("a", 0), group("b", 1)], ..(*scene.meshes[0]).clone() };
        scene.meshes.push(mesh.into());
        let groups = groups(&scene);
        let found: Vec<_> = groups.iter().map(|g| (g.name.as_str(), g.mesh, g.first_triangle, g.triangles)).collect();
        assert_eq!(found, [("a", 1, 0, 1), ("b", 1, 1, 1)]);
    }

    #[test]
    fn an_empty_scene_has_no_bounds_and_no_share_of_bytes() {
        let ledger = Ledger::default();
        let info = Info::of(Path::new("a.obj"), &Scene::default(), &ledger);
        assert!(info.bounds.is_none() && info.bytes_per_triangle.is_none() && info.active_camera.is_none());
    }
}
