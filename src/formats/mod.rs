//! Files in and pictures out. Readers return plain scene data; nothing here knows how rays are traced.

pub mod atomic_file;
pub mod gltf;
pub mod image_file;
pub mod ledger;
pub mod obj;
pub mod picture;

use std::path::Path;

use crate::error::Result;
use crate::geometry::TriangleMesh;
use crate::progress::Progress;
use crate::scene::{Light, Material, NamedCamera, Object, Scene, Texture};

pub use ledger::{Ledger, Treatment};

/// Which shading normals a mesh gets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// +Y: glTF always, OBJ mostly.
    #[default]
    Y,
    /// +Z: the model is turned about the x axis so that +Z becomes +Y.
    Z,
}

/// How a file is read.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadOptions {
    /// Shading normals of meshes.
    pub normals: NormalMode,
    /// The axis that points up.
    pub up: UpAxis,
}

/// What a model file holds. Positions in its lists are local to it; [`Material`]s, [`Texture`]s and meshes are appended
/// to a scene's lists by [`Model::append_to`].
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// Meshes, finished.
    pub meshes: Vec<TriangleMesh>,
    /// Materials that meshes refer to; never empty.
    pub materials: Vec<Material>,
    /// Images that materials refer to.
    pub textures: Vec<Texture>,
    /// Placed meshes, in file order.
    pub objects: Vec<Object>,
    /// Cameras, in file order.
    pub cameras: Vec<NamedCamera>,
    /// Lights, in file order.
    pub lights: Vec<Light>,
    /// Whether the lights are in physical units (candela, lux), so that a picture needs an exposure.
    pub physical_lights: bool,
    /// What was honoured, approximated and ignored.
    pub ledger: Ledger,
}

/// A scene and how its files were read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What was honoured, approximated and ignored.
    pub ledger: Ledger,
}

/// Opens a scene file (`.toml`) or a model (`.obj`, `.gltf`, `.glb`), chosen by suffix and, failing that, by content.
///
/// A model alone becomes a scene with an automatic camera, lights and background.
///
/// # Errors
/// Names the file, and line and column where there are such, and what would mend it.
pub fn open(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    let _ = (path, options, progress);
    Err(crate::error::Error::unsupported("not yet"))
}
