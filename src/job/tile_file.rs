//! Files of tiles: the bytes.
//!
//! ```text
//! "whitted tiles 1\n"  16 bytes
//! length of the header's JSON, u32
//! header, JSON
//! BLAKE3 of all above, 32 bytes: the file's key
//! then, for each tile:
//!   "TILE", its number, the number of bytes that follow without the checksum: u32
//!   rays: camera, shadow, reflected, refracted, u64; seconds: traversal, shading, rest, f64
//!   colours, 3 f32 a pixel; alpha, f32 a pixel, if there is any; extra values, f32 a pixel for each channel
//!   the first 16 bytes of the BLAKE3, keyed by the file's key, of all of the record above
//! ```
//!
//! All numbers are little-endian. A record's checksum is bound to its file's header, so that a record of another picture is as
//! foreign as a damaged one. Behind a damaged record the next whole one is found by its first word and its checksum.

use std::io::{self, Write};
use std::path::Path;

use crate::error::{Error, Result};
use crate::job::Header;
use crate::render::{RayCounts, ThreadSeconds, Tile};

const MAGIC: &[u8; 16] = b"whitted tiles 1\n";
const MARK: &[u8; 4] = b"TILE";
/// Mark, number and length.
const RECORD_HEAD: usize = 12;
/// Counts and seconds.
const STATS: usize = 7 * 8;
const CHECKSUM: usize = 16;
/// No header of ours is nearly as long.
const LONGEST_HEADER: u32 = 1 << 24;

/// What a file's records are checked with.
pub type Key = [u8; 32];

/// The bytes that a file begins with, and its key.
pub fn begin(header: &Header) -> (Vec<u8>, Key) {
    let json = serde_json::to_vec(header).expect("names and numbers have a JSON form");
    let mut bytes = MAGIC.to_vec();
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json);
    let key = *blake3::hash(&bytes).as_bytes();
    bytes.extend(key);
    (bytes, key)
}

/// A tile's record.
pub fn record(key: &Key, tile: &Tile) -> Vec<u8> {
    let mut bytes = MARK.to_vec();
    let floats = 3 * tile.color.len() + tile.alpha.len() + tile.aovs.iter().map(Vec::len).sum::<usize>();
    bytes.reserve(RECORD_HEAD + STATS + 4 * floats + CHECKSUM);
    bytes.extend(tile.number.to_le_bytes());
    bytes.extend(((STATS + 4 * floats) as u32).to_le_bytes());
    let RayCounts { camera, shadow, reflected, refracted } = tile.rays;
    bytes.extend([camera, shadow, reflected, refracted].map(u64::to_le_bytes).concat());
    let ThreadSeconds { traversal, shading, rest } = tile.seconds;
    bytes.extend([traversal, shading, rest].map(f64::to_le_bytes).concat());
    let values = tile.color.iter().flatten().chain(&tile.alpha).chain(tile.aovs.iter().flatten());
    values.for_each(|value| bytes.extend(value.to_le_bytes()));
    let checksum = blake3::keyed_hash(key, &bytes);
    bytes.extend(&checksum.as_bytes()[..CHECKSUM]);
    bytes
}

/// Writes a whole file.
///
/// # Errors
/// The system's.
pub fn write<'a>(out: &mut dyn Write, header: &Header, tiles: impl IntoIterator<Item = &'a Tile>) -> io::Result<()> {
    let (start, key) = begin(header);
    out.write_all(&start)?;
    tiles.into_iter().try_for_each(|tile| out.write_all(&record(&key, tile)))
}

/// What is in a file.
#[derive(Debug)]
pub struct Content {
    /// What its tiles are of.
    pub header: Header,
    /// What its records are checked with.
    pub key: Key,
    /// Its whole tiles, by their numbers, each once.
    pub tiles: Vec<Tile>,
    /// Where, in bytes, the first damaged record begins.
    pub damaged: Option<usize>,
    /// Where the last whole record ends.
    pub end: usize,
}

/// Reads a file's bytes; records that are damaged are left out and told.
///
/// # Errors
/// A file's error for what is no file of tiles, or has a header that is damaged or of another version of the format.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Content> {
    let flawed = |what: &str| Error::file(what).at_path(path);
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        let is_other = bytes.starts_with(&MAGIC[..14]);
        return Err(if is_other {
            flawed("this file of tiles was written by another version of whitted").remedy("render it again")
        } else {
            flawed("this is no file of tiles").remedy("give files that `whitted render --part` wrote")
        });
    };
    let damaged =
        || flawed("the header of this file of tiles is damaged").remedy("delete the file and render it again");
    let length = rest.first_chunk::<4>().map(|bytes| u32::from_le_bytes(*bytes)).filter(|&n| n <= LONGEST_HEADER);
    let start = MAGIC.len() + 4;
    let end = start + length.ok_or_else(damaged)? as usize;
    let (json, key) = bytes.get(start..end).zip(bytes.get(end..end + 32)).ok_or_else(damaged)?;
    let key: Key = key.try_into().map_err(|_| damaged())?;
    if *blake3::hash(&bytes[..end]).as_bytes() != key {
        return Err(damaged());
    }
    let header: Header = serde_json::from_slice(json)
        .map_err(|cause| flawed(&format!("the header of this file of tiles is not understood: {cause}")))?;
    header.check().map_err(|error| error.at_path(path))?;
    let mut content = Content { header, key, tiles: Vec::new(), damaged: None, end: end + 32 };
    content.read_records(bytes)?;
    content.tiles.sort_by_key(|tile| tile.number);
    content.tiles.dedup_by_key(|tile| tile.number);
    Ok(content)
}

impl Content {
    fn read_records(&mut self, bytes: &[u8]) -> Result<()> {
        let mut at = self.end;
        while at < bytes.len() {
            if let Some((tile, end)) = self.read_record(bytes, at)? {
                self.tiles.push(tile);
                (at, self.end) = (end, end);
                continue;
            }
            self.damaged.get_or_insert(at);
            // The next whole record, wherever it begins.
            let mut next = at + 1;
            at = loop {
                let Some(found) = bytes[next..].windows(MARK.len()).position(|word| word == MARK) else {
                    return Ok(());
                };
                next += found;
                if self.read_record(bytes, next)?.is_some() {
                    break next;
                }
                next += 1;
            };
        }
        Ok(())
    }

    /// The tile whose record begins at a place, and where that ends; `None` if it is not whole.
    fn read_record(&self, bytes: &[u8], at: usize) -> Result<Option<(Tile, usize)>> {
        let tiles = self.header.tiles()?;
        let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
        let (Some(number), Some(length)) = (word(at + 4), word(at + 8)) else { return Ok(None) };
        let Some(area) = tiles.tile(number).filter(|_| bytes[at..].starts_with(MARK)) else { return Ok(None) };
        let pixels = (area.width() * area.height()) as usize;
        let channels: usize = self.header.aovs.iter().map(|kind| kind.channels().len()).sum();
        let floats = pixels * (3 + usize::from(self.header.transparent) + channels);
        let end = at + RECORD_HEAD + length as usize;
        let Some(checksum) = bytes.get(end..end + CHECKSUM).filter(|_| length as usize == STATS + 4 * floats) else {
            return Ok(None);
        };
        if blake3::keyed_hash(&self.key, &bytes[at..end]).as_bytes()[..CHECKSUM] != *checksum {
            return Ok(None);
        }
        let (stats, values) = bytes[at + RECORD_HEAD..end].split_at(STATS);
        let stat = |k: usize| -> [u8; 8] { stats.as_chunks().0[k] };
        let [camera, shadow, reflected, refracted] = [0, 1, 2, 3].map(|k| u64::from_le_bytes(stat(k)));
        let [traversal, shading, rest] = [4, 5, 6].map(|k| f64::from_le_bytes(stat(k)));
        let mut values = values.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let color: Vec<f32> = values.by_ref().take(3 * pixels).collect();
        let alpha = values.by_ref().take(if self.header.transparent { pixels } else { 0 }).collect();
        let tile = Tile {
            number,
            area,
            color: color.as_chunks().0.to_vec(),
            alpha,
            aovs: (0..channels).map(|_| values.by_ref().take(pixels).collect()).collect(),
            rays: RayCounts { camera, shadow, reflected, refracted },
            seconds: ThreadSeconds { traversal, shading, rest },
        };
        Ok(Some((tile, end + CHECKSUM)))
    }
}
