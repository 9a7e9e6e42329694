//! `--memory-limit`: which structure a scene can afford.

use super::info_text::readable;
use super::stats_json::{geometry_bytes, texture_bytes};
use crate::accel::Kind;
use crate::error::{Error, Result};
use crate::scene::Scene;

/// Bytes a pixel of pictures: the film, and the file being made of it.
const PIXEL: u64 = 32;

/// The fastest structure with which a scene that is loaded, its structures being built, and its picture take at most so many bytes.
///
/// # Errors
/// When the most compact one takes more.
pub fn kind_within(limit: u64, scene: &Scene) -> Result<Kind> {
    let triangles: Vec<usize> = scene.meshes.iter().map(|mesh| mesh.live_count()).collect();
    let threads = rayon::current_num_threads();
    let picture = PIXEL * u64::from(scene.film.width) * u64::from(scene.film.height);
    let others = geometry_bytes(scene) + texture_bytes(scene) + picture;
    let room = limit.checked_sub(others);
    room.and_then(|room| Kind::within(room, &triangles, threads)).ok_or_else(|| {
        let needed = readable(others + Kind::Compact.peak_bytes(triangles, threads));
        let limit = readable(limit);
        Error::limit(format!(
            "the scene takes about {needed} with the most compact structure, more than the {limit} of --memory-limit"
        ))
        .remedy("raise the limit, or take a smaller model or picture")
    })
}
