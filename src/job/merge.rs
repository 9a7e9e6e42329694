//! One picture of its parts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::formats::atomic_file::write_atomically;
use crate::job::{Header, Share, tile_file};
use crate::progress::Progress;
use crate::render::{Film, Tile};

/// Writes the tiles of a share to a file, whole or not at all.
///
/// # Errors
/// The system's.
pub fn write_part(path: &Path, header: &Header, tiles: &[Tile]) -> Result<()> {
    write_atomically(path, |sink| tile_file::write(sink, header, tiles).map_err(|cause| Error::system(path, cause)))
}

/// Puts parts together, in any order. A part that is there twice counts once.
///
/// # Errors
/// A file that is no part, or damaged; one of another scene, other settings or another number of parts, with what differs; parts that
/// are missing, by number.
pub fn merge(paths: &[PathBuf], progress: &dyn Progress) -> Result<Film> {
    progress.begin("merge", paths.len() as u64);
    let mut picture: Option<(Header, &Path, u32)> = None;
    let mut parts: BTreeMap<u32, Vec<Tile>> = BTreeMap::new();
    for path in paths {
        progress.check()?;
        let (header, share, tiles) = read_part(path)?;
        let (first, first_path, of) = match &mut picture {
            Some(picture) => picture,
            None => picture.insert((header.clone(), path, share.of)),
        };
        let foreign = |what: String| {
            Error::caller(format!("this part and `{}` are not of one picture: {what}", first_path.display()))
                .at_path(path)
                .remedy("give parts of one rendering")
        };
        if let Some(difference) = first.difference(&header) {
            return Err(foreign(difference));
        }
        if share.of != *of {
            return Err(foreign(format!("one of {} parts and one of {of}", share.of)));
        }
        parts.insert(share.number, tiles);
        progress.advance(1);
    }
    let Some((header, _, of)) = picture else {
        return Err(Error::caller("no parts were given").remedy("name the files that `whitted render --part` wrote"));
    };
    let missing: Vec<u32> = (1..=of).filter(|number| !parts.contains_key(number)).collect();
    if !missing.is_empty() {
        return Err(Error::caller(format!("of {of} parts {} missing", listed(&missing)))
            .remedy("render them, and give all parts"));
    }
    let mut film = header.blank()?;
    parts.values().flatten().for_each(|tile| film.put(tile));
    film.complete = true;
    Ok(film)
}

/// A part's header, which share it is, and all tiles of that.
fn read_part(path: &Path) -> Result<(Header, Share, Vec<Tile>)> {
    let bytes = std::fs::read(path).map_err(|cause| Error::system(path, cause))?;
    let content = tile_file::parse(&bytes, path)?;
    let header = content.header;
    let Some(share) = header.share else {
        return Err(Error::caller("this file keeps tiles of a picture that is not finished; it is no part")
            .at_path(path)
            .remedy("finish it with `whitted render --resume`"));
    };
    let damaged = |what: String| Error::file(what).at_path(path).remedy(format!("render part {share} again"));
    if let Some(at) = content.damaged {
        return Err(damaged(format!("part {share} is damaged: the record at byte {at} is not whole")));
    }
    let tiles = content.tiles;
    let wanted = header.wanted()?;
    if !tiles.iter().map(|tile| tile.number).eq(wanted.iter().copied()) {
        let (have, of) = (tiles.len(), wanted.len());
        return Err(damaged(format!("part {share} is not whole: it has {have} of {of} tiles")));
    }
    Ok((header, share, tiles))
}

/// Some numbers as a sentence's subject with its verb: "3 is", "3, 5 and 7 are".
fn listed(numbers: &[u32]) -> String {
    /// More are counted.
    const MOST: usize = 20;
    let text = |numbers: &[u32]| numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    match numbers {
        [one] => format!("{one} is"),
        [all @ .., last] if numbers.len() <= MOST => format!("{} and {last} are", text(all)),
        _ => format!("{} and {} others are", text(&numbers[..MOST]), numbers.len() - MOST),
    }
}
