//! Files in and pictures out. Readers return plain scene data; nothing here knows how rays are traced.

pub mod atomic_file;
pub mod built;
pub mod fingerprint;
pub mod gltf;
pub mod image_file;
pub mod ledger;
pub mod limits;
pub mod model;
pub mod obj;
pub mod outline;
pub mod picture;
pub mod reach;
mod rounding;
pub mod scene_file;
mod surroundings;

use std::io::Read as _;
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};

use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::scene::auto::{self, Automatic};
use crate::scene::{Camera, LightKind, Projection, Scene, exposure, origin};

pub use built::Built;
pub use fingerprint::Fingerprint;
pub use ledger::{Ledger, Scope, Treatment};
pub use limits::Limits;
pub use model::Model;
pub use outline::Outline;

/// Which shading normals a mesh gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NormalMode {
    /// Those of the file; where it has none, what its format prescribes (flat).
    #[default]
    File,
    /// None: every triangle is flat.
    Flat,
    /// Computed from the faces, whatever the file has.
    Smooth,
}

/// Which axis of a model file points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// +Y: glTF always, OBJ mostly.
    #[default]
    Y,
    /// +Z: the model is turned about the x axis so that +Z becomes +Y.
    Z,
}

impl UpAxis {
    /// The rotation that makes this axis +Y, exact.
    pub fn to_y(self) -> DAffine3 {
        match self {
            Self::Y => DAffine3::IDENTITY,
            Self::Z => DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)),
        }
    }
}

/// How a file is read.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct LoadOptions {
    /// Shading normals of meshes.
    pub normals: NormalMode,
    /// The axis that points up.
    pub up: UpAxis,
    /// Whether meshes keep which face of the file each triangle was cut from: 4 bytes a triangle.
    pub faces: bool,
    /// The angle between faces, in radians, from which on the edge between them is sharp, where an OBJ file has neither normals
    /// nor smoothing groups; `None` leaves such files flat.
    pub crease_angle: Option<f64>,
    /// Which of a glTF file's scenes is read, by name or number; `None` for its default.
    pub scene: Option<String>,
    /// Which of a glTF file's animations is applied, by name or number; `None` for the first. Without a time there is none.
    pub animation: Option<String>,
    /// The time at which animations are evaluated, in seconds; `None` leaves everything where the file has it.
    pub time: Option<f64>,
    /// Whether what the file calls single-sided is not seen from behind.
    pub cull_back_faces: bool,
    /// Whether files outside the model's folder are read.
    pub allow_external: bool,
    /// How much a file may ask for.
    pub limits: Limits,
}

/// A scene and how its files were read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What was honoured, approximated and ignored.
    pub ledger: Ledger,
    /// What the scene lacked and was given.
    pub automatic: Automatic,
    /// What is built of it already, where it was read from a file of a built scene.
    pub built: Option<Box<Built>>,
}

/// Formats that [`open`] reads, for messages.
const ACCEPTED: &str = "accepted are .toml (scene), .obj, .gltf and .glb (models) and .whb (built scene)";

/// Formats of scenes and models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Scene,
    Obj,
    Gltf,
    Built,
}

/// Opens a scene file (`.toml`), a model (`.obj`, `.gltf`, `.glb`) or a built scene (`.whb`), chosen by suffix and, failing that, by
/// content. A built scene was read with options of its own.
///
/// A model alone becomes a scene with an automatic camera, lights and background; lights of its own in physical units
/// set the film's exposure.
///
/// # Errors
/// Names the file, and line and column where there are such, and what would mend it.
pub fn open(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    match format_of(path)? {
        Format::Scene => {
            let mut loaded = scene_file::read(path, options, progress)?;
            loaded.scene.origin = origin::choose(&loaded.scene);
            return Ok(loaded);
        }
        Format::Built => return built::open(path, progress),
        Format::Obj | Format::Gltf => {}
    }
    let model = load_model(path, options, progress)?;
    let mut scene = Scene::default();
    let physical_lights = model.physical_lights;
    let ledger = model.append_to(&mut scene);
    scene.origin = origin::choose(&scene);
    hold_angles_in_degrees(&mut scene);
    if physical_lights {
        scene.film.exposure = exposure::automatic(&scene);
    }
    let automatic = auto::complete(&mut scene);
    Ok(Loaded { scene, ledger, automatic, built: None })
}

/// Whether [`open`] takes the file for a scene file rather than a model.
///
/// # Errors
/// A file that cannot be read, or that is neither.
pub fn is_scene(path: &Path) -> Result<bool> {
    Ok(format_of(path)? == Format::Scene)
}

/// Whether [`open`] takes the file for a built scene.
///
/// # Errors
/// As [`is_scene`].
pub fn is_built(path: &Path) -> Result<bool> {
    Ok(format_of(path)? == Format::Built)
}

/// Loads a model file on its own.
///
/// # Errors
/// As [`open`]; a scene file is not a model.
pub fn load_model(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Model> {
    match format_of(path)? {
        Format::Obj => obj::load(path, options, progress),
        Format::Gltf => gltf::load(path, options, progress),
        Format::Scene => Err(Error::unsupported("a scene file cannot be used as a mesh").at_path(path)),
        Format::Built => Err(Error::unsupported("a built scene cannot be used as a mesh")
            .at_path(path)
            .remedy("name the model that it was built from")),
    }
}

/// The format by suffix; where that is unknown, by content.
fn format_of(path: &Path) -> Result<Format> {
    let metadata = std::fs::metadata(path).map_err(|cause| match cause.kind() {
        std::io::ErrorKind::NotFound => Error::caller("there is no such file").at_path(path),
        _ => Error::system(path, cause),
    })?;
    if metadata.is_dir() {
        return Err(Error::caller("is a folder").at_path(path).remedy("name a scene or model file in it"));
    }
    let suffix = path.extension().and_then(|suffix| suffix.to_str()).unwrap_or_default().to_ascii_lowercase();
    match suffix.as_str() {
        "toml" => return Ok(Format::Scene),
        "obj" => return Ok(Format::Obj),
        "gltf" | "glb" => return Ok(Format::Gltf),
        "whb" => return Ok(Format::Built),
        _ => {}
    }
    let mut start = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(4096).read_to_end(&mut start))
        .map_err(|cause| Error::system(path, cause))?;
    sniff(&start).ok_or_else(|| {
        let what =
            if suffix.is_empty() { "the format is not known".into() } else { format!(".{suffix} is not supported") };
        Error::unsupported(what).at_path(path).remedy(ACCEPTED)
    })
}

/// The format by the first bytes of a file.
fn sniff(start: &[u8]) -> Option<Format> {
    if built::is_built(start) {
        return Some(Format::Built);
    }
    if start.starts_with(b"glTF") {
        return Some(Format::Gltf);
    }
    let text = String::from_utf8_lossy(start);
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('{') {
        return text.contains("\"asset\"").then_some(Format::Gltf);
    }
    let is_obj = |line: &str| {
        let mut words = line.split_ascii_whitespace();
        matches!(words.next(), Some("v" | "f" | "vn" | "vt")) && words.next().is_some_and(|w| !w.starts_with('='))
    };
    let is_scene = |line: &str| {
        let section = line.trim_start_matches('[');
        line.starts_with('[')
            && ["camera]", "film]", "object]", "material]", "light]"].iter().any(|s| section.starts_with(s))
    };
    text.lines().map(str::trim).find_map(|line| match line {
        line if is_obj(line) => Some(Format::Obj),
        line if is_scene(line) => Some(Format::Scene),
        _ => None,
    })
}

/// Rounds the angles of cameras and spots to the nearest that degrees can express, at most 2 ulp away, so that a scene
/// file written for this scene holds them exactly.
fn hold_angles_in_degrees(scene: &mut Scene) {
    let round = |radians: &mut f64| *radians = radians.to_degrees().to_radians();
    for named in &mut scene.cameras {
        if let Camera::LookAt { projection: Projection::Perspective { fov_y }, .. } = &mut named.camera {
            round(fov_y);
        }
    }
    for light in &mut scene.lights {
        if let LightKind::Spot { inner_angle, outer_angle, .. } = &mut light.kind {
            round(inner_angle);
            round(outer_angle);
        }
    }
}
