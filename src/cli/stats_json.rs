//! What `--stats-json` writes: rays by kind, seconds by stage, memory by part. Documented in the manual's page on the
//! command line, and stable: a change that breaks a reader raises `schema`.

use std::path::Path;
use std::time::Instant;

use serde::{Serialize, Serializer};

use super::precision::Precision;
use crate::accel::Preset;
use crate::render::{AovKind, BuildStats, Crop, Film, RayCounts, ThreadSeconds};
use crate::scene::{FilmSettings, Scene};

/// Version of the documents that `--json` and `--stats-json` write.
pub const SCHEMA: u32 = 1;

/// Writes a path as text; what is not UTF-8 in it as replacement characters, since JSON holds nothing else.
pub fn lossy<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// The same, or null.
fn lossy_if_any<S: Serializer>(path: &Option<&Path>, serializer: S) -> Result<S::Ok, S::Error> {
    path.map(|path| path.to_string_lossy()).serialize(serializer)
}

/// The same of a list.
pub fn lossy_list<S: Serializer>(paths: &[&Path], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.to_string_lossy()))
}

/// The whole document.
#[derive(Debug, Serialize)]
pub struct Stats<'a> {
    /// Version of this document.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// The file that was rendered.
    #[serde(serialize_with = "lossy")]
    pub input: &'a Path,
    /// The picture; null if it was streamed.
    #[serde(serialize_with = "lossy_if_any")]
    pub output: Option<&'a Path>,
    /// What it was rendered with.
    pub settings: Settings<'a>,
    /// Rays by kind.
    pub rays: Rays,
    /// All rays through the time of rendering.
    pub rays_per_second: f64,
    /// Wall-clock seconds by stage.
    pub seconds: Seconds,
    /// What the rendering's threads did with their time.
    pub thread_seconds: ThreadSeconds,
    /// Bytes by part.
    pub bytes: Bytes,
}

/// What a picture was rendered with, defaults filled in.
#[derive(Debug, Serialize)]
pub struct Settings<'a> {
    /// Size, samples, depth and encoding.
    #[serde(flatten)]
    pub film: FilmSettings,
    /// Name of the camera.
    pub camera: &'a str,
    /// The part that was rendered; null for all of it.
    pub crop: Option<Crop>,
    /// Extra values.
    pub aov: &'a [AovKind],
    /// In what rays were traced.
    pub precision: Precision,
    /// The acceleration structure, chosen if it was left open.
    pub accelerator: &'a str,
    /// How it was built.
    pub preset: Preset,
    /// Threads that traced rays.
    pub threads: usize,
}

/// Rays by kind, and all of them.
#[derive(Debug, Serialize)]
pub struct Rays {
    #[serde(flatten)]
    kinds: RayCounts,
    total: u64,
}

/// Wall-clock seconds by stage.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Seconds {
    /// Reading files.
    pub load: f64,
    /// Building acceleration structures.
    pub build: f64,
    /// Tracing and shading.
    pub render: f64,
    /// Encoding and writing pictures.
    pub write: f64,
}

/// Bytes by part.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Bytes {
    geometry: u64,
    textures: u64,
    tree_nodes: u64,
    tree_leaves: u64,
    top_level: u64,
    film: u64,
    /// The most memory that the process ever had, where the system tells.
    peak_resident: Option<u64>,
}

impl From<RayCounts> for Rays {
    fn from(kinds: RayCounts) -> Self {
        Self { kinds, total: kinds.total() }
    }
}

impl Bytes {
    /// Adds up what a picture took.
    pub fn of(scene: &Scene, build: &BuildStats, film: &Film) -> Self {
        Self {
            geometry: geometry_bytes(scene),
            textures: texture_bytes(scene),
            tree_nodes: build.node_bytes,
            tree_leaves: build.leaf_bytes,
            top_level: build.top_level_bytes,
            film: film_bytes(film),
            peak_resident: peak_resident_bytes(),
        }
    }
}

/// What `work` gives, and the wall-clock seconds it took.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let value = work();
    (value, start.elapsed().as_secs_f64())
}

/// Bytes of a scene's meshes.
pub fn geometry_bytes(scene: &Scene) -> u64 {
    scene.meshes.iter().map(|mesh| mesh.bytes() as u64).sum()
}

/// Bytes of its images.
pub fn texture_bytes(scene: &Scene) -> u64 {
    scene.textures.iter().map(|texture| texture.bytes() as u64).sum()
}

fn film_bytes(film: &Film) -> u64 {
    let alpha = film.alpha.as_ref().map_or(0, |alpha| size_of_val(alpha.as_slice()));
    let channels = film.aovs.iter().flat_map(|aov| &aov.channels);
    (size_of_val(film.color.as_slice()) + alpha + channels.map(|c| size_of_val(c.as_slice())).sum::<usize>()) as u64
}

/// The most memory that this process ever had resident; `None` where the system has no `/proc/self/status`.
pub fn peak_resident_bytes() -> Option<u64> {
    parse_kibibytes(&std::fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// The memory that this process has resident now; `None` where the system does not say.
pub fn resident_bytes() -> Option<u64> {
    parse_kibibytes(&std::fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// Reads a line such as `VmHWM: N kB`, whose kB are 1024 bytes.
pub fn parse_kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Aov, RenderStats};

    #[test]
    fn the_peak_is_read_in_bytes() {
        let status = "Name:\tx\nVmHWM:\t    1234 kB\nVmRSS:\t 9 kB\n";
        assert_eq!(parse_kibibytes(status, "VmHWM:"), Some(1_263_616));
        assert_eq!(parse_kibibytes(status, "VmRSS:"), Some(9216));
        assert_eq!(parse_kibibytes("Name:\tx\n", "VmHWM:"), None);
        assert_eq!(parse_kibibytes("VmHWM:\tmuch\n", "VmHWM:"), None);
    }

    #[test]
    fn a_films_bytes_count_every_channel() {
        let mut film = Film {
            width: 3,
            height: 2,
            crop: None,
            color: vec![[0.0; 3]; 6],
            alpha: None,
            aovs: Vec::new(),
            settings: FilmSettings::default(),
            complete: true,
            coverage: None,
            stats: RenderStats::default(),
        };
        assert_eq!(film_bytes(&film), 6 * 12);
        film.alpha = Some(vec![0.0; 6]);
        film.aovs.push(Aov { kind: AovKind::Uv, channels: vec![vec![0.0; 6]; 2] });
        assert_eq!(film_bytes(&film), 6 * (12 + 4 + 8));
    }

    #[test]
    fn rays_carry_their_sum() {
        let rays = Rays::from(RayCounts { camera: 1, shadow: 2, reflected: 3, refracted: 4 });
        let json = serde_json::to_value(&rays).unwrap();
        assert_eq!(json, serde_json::json!({"camera": 1, "shadow": 2, "reflected": 3, "refracted": 4, "total": 10}));
    }
}
