//! `--memory-limit`: which structure a scene can afford.

use super::info_text::readable;
use super::stats_json::{geometry_bytes, texture_bytes};
use crate::accel::Kind;
use crate::error::{Error, Result};
use crate::render::world::Instance;
use crate::render::{AovKind, Crop};
use crate::scene::{FilmSettings, Object, Scene};

/// What a picture takes while it is made: its values are in tiles and then in the film, and 8 bytes a pixel go to the file.
pub fn picture_bytes(film: &FilmSettings, crop: Option<Crop>, aovs: &[AovKind]) -> u64 {
    let (width, height) = crop.map_or((film.width, film.height), |crop| (crop.x1 - crop.x0, crop.y1 - crop.y0));
    let values = 4 + aovs.iter().map(|kind| kind.channels().len() as u64).sum::<u64>();
    (2 * 4 * values + 8) * u64::from(width) * u64::from(height)
}

/// The fastest structure with which a scene that is loaded, its structures being built, and a picture of so many bytes take at
/// most so many.
///
/// # Errors
/// When the most compact one takes more.
pub fn kind_within(limit: u64, scene: &Scene, picture: u64) -> Result<Kind> {
    let triangles: Vec<usize> = scene.meshes.iter().map(|mesh| mesh.live_count()).collect();
    let threads = rayon::current_num_threads();
    let instances = (scene.objects.len() * (size_of::<Object>() + size_of::<Instance>())) as u64;
    let others = geometry_bytes(scene) + texture_bytes(scene) + instances + picture;
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
