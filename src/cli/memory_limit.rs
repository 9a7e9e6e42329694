//! Which structure a scene can afford, by `--memory-limit` or what the machine has to spare; and whether it can be rendered at all,
//! found out before it is read.

use std::path::Path;

use super::info_text::readable;
use super::stats_json::{geometry_bytes, parse_kibibytes, resident_bytes, texture_bytes};
use super::terminal;
use crate::accel::Kind;
use crate::error::{Error, Result};
use crate::formats::{LoadOptions, Outline};
use crate::render::world::Instance;
use crate::render::{AovKind, Crop};
use crate::scene::{Background, Object, Scene};

/// What a picture takes while it is made: its values are in tiles and then in the film, and 8 bytes a pixel go to the file.
pub fn picture_bytes(scene: &Scene, crop: Option<Crop>, aovs: &[AovKind]) -> u64 {
    let film = &scene.film;
    let (width, height) = crop.map_or((film.width, film.height), |crop| (crop.x1 - crop.x0, crop.y1 - crop.y0));
    let values = if scene.background == Background::Transparent { 4 } else { 3 }
        + aovs.iter().map(|kind| kind.channels().len() as u64).sum::<u64>();
    (2 * 4 * values + 8) * u64::from(width) * u64::from(height)
}

/// Bytes that this process may take besides what it has: the system's word, and that of the group of processes (a container, a batch
/// job) that it belongs to. `None` where nobody says.
pub fn available_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let of_system = parse_kibibytes(&read("/proc/meminfo"), "MemAvailable:");
    let own_group = read("/proc/self/cgroup");
    let group = own_group.lines().find_map(|line| line.strip_prefix("0::")).unwrap_or("/");
    // Batch systems limit a group above the process's own.
    let of_groups = Path::new(group).ancestors().filter_map(|group| {
        let folder = format!("/sys/fs/cgroup{}", group.display());
        let most = read(&format!("{folder}/memory.max")).trim().parse::<u64>().ok()?;
        // What is kept of files in memory for speed gives way.
        let stat = read(&format!("{folder}/memory.stat"));
        let taken = stat.lines().find_map(|line| line.strip_prefix("anon ")?.parse().ok());
        Some(most.saturating_sub(taken.unwrap_or(0)))
    });
    of_system.into_iter().chain(of_groups).min()
}

/// Refuses a scene whose triangles alone take more while structures are built than `limit`, or else than the machine has to spare, before
/// it is read.
///
/// # Errors
/// Says how much is needed and what helps. What is wrong with the files is not told here.
pub fn refuse_what_does_not_fit(input: &Path, options: &LoadOptions, limit: Option<u64>) -> Result<()> {
    let Ok(outline) = Outline::of(input, options) else { return Ok(()) };
    let Some(room) = limit.or_else(available_bytes) else { return Ok(()) };
    let needed = |kind: Kind| {
        let triangles = outline.triangles.iter().copied();
        outline.geometry_bytes.saturating_add(kind.peak_bytes(triangles, rayon::current_num_threads()))
    };
    if needed(Kind::Compact) <= room {
        return Ok(());
    }
    let triangles: usize = outline.triangles.iter().sum();
    let (wide, compact) = (readable(needed(Kind::Wide)), readable(needed(Kind::Compact)));
    let whose = whose(limit);
    let error = Error::limit(format!(
        "rendering about {triangles} triangles takes {wide} with the fastest structure, {compact} with --accelerator compact, and \
         {whose} {}",
        readable(room)
    ));
    Err(error.at_path(input).remedy(if limit.is_some() {
        "raise the limit, or take a smaller model"
    } else {
        "take a smaller model or a larger machine; with --memory-limit or --accelerator it is tried all the same"
    }))
}

/// Bytes of a scene without its structures.
fn other_bytes(scene: &Scene) -> u64 {
    let instances = (scene.objects.len() * (size_of::<Object>() + size_of::<Instance>())) as u64;
    geometry_bytes(scene) + texture_bytes(scene) + instances
}

/// The most bytes that a scene and its structures take while these are built; about, and rather too many.
pub fn needed_bytes(scene: &Scene, kind: Kind) -> u64 {
    let triangles = scene.meshes.iter().map(|mesh| mesh.live_count());
    other_bytes(scene) + kind.resolve().peak_bytes(triangles, rayon::current_num_threads())
}

/// The fastest structure with which a scene that is loaded, its structures being built, and a picture of so many bytes fit in
/// `limit`, or else in what this process has and may take. Where the fast one does not fit in the latter, that is told.
///
/// # Errors
/// When the most compact one does not fit.
pub fn kind_within(limit: Option<u64>, scene: &Scene, picture: u64) -> Result<Kind> {
    let Some(room) = limit.or_else(|| Some(available_bytes()? + resident_bytes()?)) else { return Ok(Kind::Auto) };
    let triangles: Vec<usize> = scene.meshes.iter().map(|mesh| mesh.live_count()).collect();
    let structures = room.checked_sub(other_bytes(scene) + picture);
    let kind = structures.and_then(|room| Kind::within(room, &triangles, rayon::current_num_threads()));
    let [wide, compact] = [Kind::Wide, Kind::Compact].map(|kind| readable(needed_bytes(scene, kind) + picture));
    let (room, whose) = (readable(room), whose(limit));
    if limit.is_none() && kind == Some(Kind::Compact) {
        let note =
            format!("note: the compact structure is built, in {compact}: the fastest takes {wide}, and {whose} {room}");
        terminal::report(&note);
    }
    kind.ok_or_else(|| {
        let error = format!("the scene takes about {compact} with the most compact structure, and {whose} {room}");
        Error::limit(error).remedy(if limit.is_some() {
            "raise the limit, or take a smaller model or picture"
        } else {
            "take a smaller model or picture; with --memory-limit or --accelerator compact it is tried all the same"
        })
    })
}

fn whose(limit: Option<u64>) -> &'static str {
    if limit.is_some() { "--memory-limit allows" } else { "this machine has to spare" }
}
