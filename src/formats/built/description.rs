//! What a built scene says beside its arrays.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::accel;
use crate::error::{Error, Result};
use crate::formats::atomic_file::{folder_of, relative_to};
use crate::formats::fingerprint::{self, Fingerprint};
use crate::formats::{Ledger, LoadOptions};
use crate::geometry::mesh::{DroppedCounts, Rounding};
use crate::geometry::{Bounds, Quadric};
use crate::scene::auto::Automatic;
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{FilmSettings, Light, Material, NamedCamera, Object, Rgb};

/// A scene without its arrays, how it was read, and from what.
#[derive(Serialize, Deserialize)]
pub struct Description {
    pub origin: DVec3,
    pub ambient: Rgb,
    pub background: Background,
    pub cameras: Vec<NamedCamera>,
    pub active_camera: usize,
    pub film: FilmSettings,
    pub lights: Vec<Light>,
    pub materials: Vec<Material>,
    pub quadrics: Vec<Quadric>,
    pub objects: Vec<Object>,
    pub meshes: Vec<Mesh>,
    pub textures: Vec<Texture>,
    pub automatic: Automatic,
    pub ledger: Ledger,
    pub options: LoadOptions,
    pub structure: String,
    pub preset: accel::Preset,
    pub scene: Fingerprint,
    pub sources: Vec<SourceFile>,
}

/// [`scene::Background`](crate::scene::Background).
#[derive(Serialize, Deserialize)]
pub enum Background {
    Color(Rgb),
    Gradient { bottom: Rgb, top: Rgb, up: DVec3 },
    Image { texture: Texture, intensity: f32 },
    Transparent,
}

/// A mesh and its tree without their arrays.
#[derive(Serialize, Deserialize)]
pub struct Mesh {
    pub name: String,
    pub origin: DVec3,
    pub exponent: i32,
    /// The material of all triangles, where they have no list.
    pub material: u32,
    /// Names and first triangles.
    pub groups: Vec<(String, u32)>,
    pub dropped_counts: DroppedCounts,
    pub rounding: Rounding,
    pub root: u32,
    pub bounds: Bounds,
}

/// An image without its texels.
#[derive(Serialize, Deserialize)]
pub struct Texture {
    pub name: String,
    pub wrap: [Wrap; 2],
    pub filter: Filter,
    /// The image itself and its smaller versions.
    pub levels: Vec<Level>,
}

/// The size of an image and the number of its texels' section.
#[derive(Serialize, Deserialize)]
pub struct Level {
    pub width: u32,
    pub height: u32,
    pub kind: TexelKind,
    pub section: u32,
}

/// [`Texels`](crate::scene::texture::Texels).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum TexelKind {
    Srgb8,
    Data8,
    Linear32,
}

/// A file that a scene was built from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceFile {
    /// Seen from the folder of the built scene.
    path: RawPath,
    bytes: u64,
    /// When it was changed last, since 1970; `None` where that was so shortly before the scene was built that a later change may have the
    /// same time.
    modified: Option<Duration>,
    content: [u8; 32],
}

/// Files whose times are nearer to the present may be changed again without another time.
const COARSEST_CLOCK: Duration = Duration::from_secs(2);

impl SourceFile {
    /// A file that was read after a moment, for a built scene at `target`.
    ///
    /// # Errors
    /// A file that was changed since; the system's.
    pub fn of(path: &Path, since: SystemTime, target: &Path) -> Result<Self> {
        let system = |cause| Error::system(path, cause);
        let (bytes, modified) = state(path).map_err(system)?;
        let content = fingerprint::content(path)?;
        let since = since.duration_since(UNIX_EPOCH).unwrap_or_default();
        let now = UNIX_EPOCH.elapsed().unwrap_or_default();
        // A time that is yet to come says nothing.
        let is_changed = modified.is_some_and(|modified| (since..=now).contains(&modified));
        if is_changed || state(path).map_err(system)? != (bytes, modified) {
            return Err(Error::file("the file was changed while the scene was built")
                .at_path(path)
                .remedy("build it again"));
        }
        let is_old = |time: &Duration| *time + COARSEST_CLOCK < now;
        let path = RawPath::of(&relative_to(path, &where_it_is(target)));
        Ok(Self { path, bytes, modified: modified.filter(is_old), content })
    }

    /// The hash of its content.
    pub fn content(&self) -> [u8; 32] {
        self.content
    }

    /// The file, seen from where this process is, if it is there still; a built scene without its sources is whole.
    ///
    /// # Errors
    /// When it has changed.
    pub fn check(&self, target: &Path) -> Result<Option<PathBuf>> {
        let path = folder_of(&where_it_is(target)).join(self.path.path());
        let Ok(metadata) = std::fs::metadata(&path) else { return Ok(None) };
        let (bytes, modified) = state_of(&metadata);
        let is_same = metadata.is_file()
            && bytes == self.bytes
            && ((modified.is_some() && modified == self.modified) || fingerprint::content(&path)? == self.content);
        if is_same {
            return Ok(Some(path));
        }
        Err(Error::file(format!("`{}` is not what this scene was built from any more", path.display()))
            .at_path(target)
            .remedy("build it again with `whitted build`, or, if that is another file, move one of them"))
    }
}

/// Where a built scene is, or will be: where a link to it leads, or as the path says.
fn where_it_is(target: &Path) -> PathBuf {
    let is_link = std::fs::symlink_metadata(target).is_ok_and(|metadata| metadata.is_symlink());
    let real = if is_link { std::fs::canonicalize(target).ok() } else { None };
    real.unwrap_or_else(|| target.to_path_buf())
}

/// A file's size and the time of its last change, where that is known.
fn state(path: &Path) -> std::io::Result<(u64, Option<Duration>)> {
    Ok(state_of(&std::fs::metadata(path)?))
}

fn state_of(metadata: &std::fs::Metadata) -> (u64, Option<Duration>) {
    let modified = metadata.modified().ok().and_then(|time: SystemTime| time.duration_since(UNIX_EPOCH).ok());
    (metadata.len(), modified)
}

/// A path as the system has it, which need not be text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RawPath(Vec<u8>);

impl RawPath {
    #[cfg(unix)]
    fn of(path: &Path) -> Self {
        Self(std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str()).to_vec())
    }

    #[cfg(unix)]
    fn path(&self) -> PathBuf {
        PathBuf::from(<std::ffi::OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(&self.0))
    }

    #[cfg(not(unix))]
    fn of(path: &Path) -> Self {
        Self(path.to_string_lossy().into_owned().into_bytes())
    }

    #[cfg(not(unix))]
    fn path(&self) -> PathBuf {
        PathBuf::from(String::from_utf8_lossy(&self.0).into_owned())
    }
}
