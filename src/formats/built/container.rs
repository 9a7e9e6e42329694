//! The bytes of a file of a built scene.
//!
//! ```text
//! "whitted built 1\n"  16 bytes
//! the version of the program that wrote it, 32 bytes, filled with 0
//! 0x0102030405060708 in the byte order of all that follows, u64
//! bytes of the file, u64
//! the number of sections, u64
//! for each section:
//!   kind, item: u32; where it begins, its bytes: u64; the BLAKE3 of them, 32 bytes
//! the BLAKE3 of all above, 32 bytes
//! sections, each at a multiple of 256 bytes, or of 2 MiB if it has 8 MiB or more, with 0 between them
//! ```

use std::collections::HashMap;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::AGAIN;
use crate::array::{Array, Mapping};
use crate::error::{Error, Result};
use crate::progress::Progress;

/// With a number that is another one wherever sections or the description are: a test tells when.
const MAGIC: &[u8; 16] = b"whitted built 1\n";
/// What all versions of the format begin with.
const FAMILY: &[u8] = b"whitted built ";
const VERSION_BYTES: usize = 32;
const ORDER: u64 = 0x0102_0304_0506_0708;
/// Magic, version, order, size, number of sections.
const HEAD: usize = 16 + VERSION_BYTES + 3 * 8;
const ENTRY: usize = 2 * 4 + 2 * 8 + HASH;
const HASH: usize = 32;
/// Small sections begin at multiples of this: where nodes may lie.
const ALIGNMENT: usize = 256;
/// Large ones begin at multiples of this, so that a system that keeps files in huge pages maps them by such.
const HUGE_PAGE: usize = 2 << 20;
/// Bytes that are hashed, or written, between two looks at whether to stop.
const PIECE: usize = 16 << 20;

/// Whether a file begins as one of a built scene does, of any version.
pub fn is_built(start: &[u8]) -> bool {
    start.starts_with(FAMILY)
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident $text:literal)+) => {
        /// What a section holds.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum Kind {
            $($(#[$doc])* $name,)+
        }

        impl Kind {
            const ALL: &[(Self, &str)] = &[$((Self::$name, $text)),+];
        }
    };
}

kinds! {
    /// All but arrays.
    Description "description"
    /// [`TriangleMesh::positions`](crate::geometry::TriangleMesh::positions); so with the following.
    Positions "positions"
    Indices "indices"
    Normals "normals"
    Uvs "texture coordinates"
    SecondUvs "second texture coordinates"
    Colors "colours"
    Tangents "tangents"
    Materials "materials"
    SourceFaces "source faces"
    Dropped "dropped triangles"
    /// Nodes of a mesh's tree.
    Nodes "nodes"
    /// Leaves of a mesh's tree.
    Leaves "leaves"
    /// An image, or a smaller version of one.
    Texels "texels"
}

impl Kind {
    fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// An array, and what it is.
pub struct Section<'a> {
    /// What it holds.
    pub kind: Kind,
    /// Of which mesh or image.
    pub item: u32,
    /// Its bytes.
    pub bytes: &'a [u8],
}

/// Writes a file. Each byte is a step of `progress`, twice.
///
/// # Errors
/// The system's, or a cancellation.
pub fn write(out: &mut dyn Write, path: &Path, sections: &[Section<'_>], progress: &dyn Progress) -> Result<u64> {
    let mut size = HEAD + sections.len() * ENTRY + HASH;
    let mut places = Vec::with_capacity(sections.len());
    for section in sections {
        let place = size.next_multiple_of(alignment(section.bytes.len()));
        places.push(place);
        size = place + section.bytes.len();
    }
    let total: usize = sections.iter().map(|section| section.bytes.len()).sum();
    progress.begin("write", 2 * total as u64);
    let mut head = MAGIC.to_vec();
    head.extend(own_version());
    head.extend([ORDER, size as u64, sections.len() as u64].map(u64::to_ne_bytes).concat());
    for (section, &place) in sections.iter().zip(&places) {
        head.extend([section.kind as u32, section.item].map(u32::to_ne_bytes).concat());
        head.extend([place as u64, section.bytes.len() as u64].map(u64::to_ne_bytes).concat());
        head.extend(hash(section.bytes, progress)?);
    }
    head.extend(blake3::hash(&head).as_bytes());
    let mut put = |bytes: &[u8]| out.write_all(bytes).map_err(|cause| Error::system(path, cause));
    put(&head)?;
    let mut end = head.len();
    for (section, &place) in sections.iter().zip(&places) {
        put(&vec![0; place - end])?;
        for piece in section.bytes.chunks(PIECE) {
            progress.check()?;
            put(piece)?;
            progress.advance(piece.len() as u64);
        }
        end = place + section.bytes.len();
    }
    Ok(size as u64)
}

/// What a section of so many bytes begins at a multiple of.
fn alignment(bytes: usize) -> usize {
    if bytes >= 4 * HUGE_PAGE { HUGE_PAGE } else { ALIGNMENT }
}

fn own_version() -> [u8; VERSION_BYTES] {
    let mut bytes = [0; VERSION_BYTES];
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    bytes[..version.len()].copy_from_slice(version);
    bytes
}

/// The BLAKE3 of some bytes, each of which is a step.
fn hash(bytes: &[u8], progress: &dyn Progress) -> Result<[u8; HASH]> {
    let mut hasher = blake3::Hasher::new();
    for piece in bytes.chunks(PIECE) {
        progress.check()?;
        hasher.update_rayon(piece);
        progress.advance(piece.len() as u64);
    }
    Ok(*hasher.finalize().as_bytes())
}

/// A file whose head is sound.
pub struct Container {
    /// Its bytes.
    pub mapping: Arc<Mapping>,
    path: PathBuf,
    entries: Vec<Entry>,
    by_content: HashMap<(Kind, u32), usize>,
}

struct Entry {
    kind: Kind,
    item: u32,
    range: Range<usize>,
    hash: [u8; HASH],
}

impl Container {
    /// Maps a file and checks its head and its table of sections.
    ///
    /// # Errors
    /// A file that cannot be read, is cut off or damaged there, or was written by another version.
    pub fn open(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(|cause| Error::system(path, cause))?;
        let mapping = Mapping::of(&file).map_err(|cause| Error::system(path, cause))?;
        let bytes = mapping.bytes();
        let flawed = |what: String| Error::file(what).at_path(path).remedy(AGAIN);
        if !bytes.starts_with(MAGIC) {
            return Err(match is_built(bytes) {
                true => flawed("this scene was built in another version of the format".into()),
                false => Error::file("this is no built scene").at_path(path).remedy("make one with `whitted build`"),
            });
        }
        let cut = || flawed(format!("the file is cut off: it has {} bytes", bytes.len()));
        let version = bytes.get(16..16 + VERSION_BYTES).ok_or_else(cut)?;
        if version != own_version() {
            let theirs = String::from_utf8_lossy(version);
            let theirs = theirs.trim_end_matches('\0');
            let is_version =
                !theirs.is_empty() && theirs.chars().all(|c| c.is_ascii_alphanumeric() || ".-+".contains(c));
            return Err(flawed(if is_version {
                format!("this scene was built by whitted {theirs}, and this is {}", env!("CARGO_PKG_VERSION"))
            } else {
                "the head of this built scene is damaged".into()
            }));
        }
        let number = |at: usize| -> Option<u64> { Some(u64::from_ne_bytes(*bytes.get(at..)?.first_chunk()?)) };
        let start = 16 + VERSION_BYTES;
        let order = number(start).ok_or_else(cut)?;
        if order == ORDER.swap_bytes() {
            return Err(flawed("this scene was built on a machine with another order of bytes".into()));
        }
        let (size, count) = number(start + 8).zip(number(start + 16)).ok_or_else(cut)?;
        let damaged = || flawed("the head of this built scene is damaged".into());
        // Without a sum that overflows, whatever the number is.
        let table = usize::try_from(count).ok().and_then(|count| count.checked_mul(ENTRY)?.checked_add(HEAD));
        let table = table
            .filter(|&table| table <= bytes.len())
            .ok_or_else(|| if size == bytes.len() as u64 { damaged() } else { cut() })?;
        let sum = bytes.get(table..table + HASH).ok_or_else(cut)?;
        if order != ORDER || blake3::hash(&bytes[..table]).as_bytes() != sum {
            return Err(damaged());
        }
        if size != bytes.len() as u64 {
            let what = format!("the file has {} bytes instead of {size}", bytes.len());
            return Err(flawed(what));
        }
        let mut entries = Vec::new();
        let mut end = table + HASH;
        for entry in bytes[HEAD..table].chunks_exact(ENTRY) {
            let entry = Entry::parse(entry).ok_or_else(damaged)?;
            let is_next = entry.range.start == end.next_multiple_of(alignment(entry.range.len()))
                && entry.range.end <= bytes.len();
            if !is_next || bytes[end..entry.range.start].iter().any(|&byte| byte != 0) {
                return Err(flawed(format!("the bytes before {} are damaged", entry.name())));
            }
            end = entry.range.end;
            entries.push(entry);
        }
        if end != bytes.len() {
            return Err(damaged());
        }
        let by_content = entries.iter().enumerate().map(|(at, entry)| ((entry.kind, entry.item), at)).collect();
        Ok(Self { mapping: Arc::new(mapping), path: path.to_path_buf(), entries, by_content })
    }

    /// Checks all sections, side by side; each byte is a step.
    ///
    /// # Errors
    /// Names the first section that is damaged; or a cancellation.
    pub fn verify(&self, progress: &dyn Progress) -> Result<()> {
        self.mapping.expect_all();
        progress.begin("check", self.entries.iter().map(|entry| entry.range.len() as u64).sum());
        let sound = self
            .entries
            .par_iter()
            .with_max_len(1)
            .map(|entry| Ok(hash(&self.mapping.bytes()[entry.range.clone()], progress)? == entry.hash));
        let sound = sound.collect::<Result<Vec<bool>>>()?;
        match sound.iter().position(|is_sound| !is_sound) {
            None => Ok(()),
            Some(at) => {
                let entry = &self.entries[at];
                let Range { start, end } = entry.range;
                let what = format!("{}, bytes {start} to {end}: damaged, the checksum is another", entry.name());
                Err(Error::file(what).at_path(&self.path).remedy(AGAIN))
            }
        }
    }

    /// Where a section is.
    pub fn range(&self, kind: Kind, item: u32) -> Option<Range<usize>> {
        self.by_content.get(&(kind, item)).map(|&at| self.entries[at].range.clone())
    }

    /// All sections.
    #[cfg(test)]
    pub fn sections(&self) -> impl Iterator<Item = (Kind, u32, Range<usize>)> + '_ {
        self.entries.iter().map(|entry| (entry.kind, entry.item, entry.range.clone()))
    }

    /// The bytes of a section.
    ///
    /// # Errors
    /// A file's where there is none.
    pub fn bytes(&self, kind: Kind, item: u32) -> Result<&[u8]> {
        let range = self.range(kind, item).ok_or_else(|| self.lacks(kind, item))?;
        Ok(&self.mapping.bytes()[range])
    }

    /// The values of a section that must be there.
    ///
    /// # Errors
    /// A file's where it is not, or has no whole number of them.
    pub fn array<T: bytemuck::Pod>(&self, kind: Kind, item: u32) -> Result<Array<T>> {
        self.optional_array(kind, item)?.ok_or_else(|| self.lacks(kind, item))
    }

    /// The values of a section that may be there.
    ///
    /// # Errors
    /// A file's where it has no whole number of them.
    pub fn optional_array<T: bytemuck::Pod>(&self, kind: Kind, item: u32) -> Result<Option<Array<T>>> {
        let Some(range) = self.range(kind, item) else { return Ok(None) };
        let array = Array::mapped(&self.mapping, range);
        array
            .map(Some)
            .ok_or_else(|| Error::file(format!("{} of {item} are not whole", kind.name())).at_path(&self.path))
    }

    fn lacks(&self, kind: Kind, item: u32) -> Error {
        Error::file(format!("{} of {item} are missing", kind.name())).at_path(&self.path)
    }
}

impl Entry {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let word = |at: usize| Some(u32::from_ne_bytes(*bytes[at..].first_chunk()?));
        let number = |at: usize| usize::try_from(u64::from_ne_bytes(*bytes[at..].first_chunk()?)).ok();
        let (kind, _) = *Kind::ALL.get(word(0)? as usize)?;
        let (start, length) = (number(8)?, number(16)?);
        Some(Self {
            kind,
            item: word(4)?,
            range: start..start.checked_add(length)?,
            hash: bytes[24..].try_into().ok()?,
        })
    }

    fn name(&self) -> String {
        match self.kind {
            Kind::Description => "the description".into(),
            Kind::Texels => format!("the texels of image {}", self.item),
            kind => format!("the {} of mesh {}", kind.name(), self.item),
        }
    }
}

/// Makes all checksums of a file right.
#[cfg(test)]
pub fn reseal(bytes: &mut [u8]) {
    let number = |bytes: &[u8], at: usize| u64::from_ne_bytes(bytes[at..][..8].try_into().unwrap()) as usize;
    let table = HEAD + number(bytes, HEAD - 8) * ENTRY;
    for entry in (HEAD..table).step_by(ENTRY) {
        let (start, length) = (number(bytes, entry + 8), number(bytes, entry + 16));
        let sum = *blake3::hash(&bytes[start..start + length]).as_bytes();
        bytes[entry + 24..entry + ENTRY].copy_from_slice(&sum);
    }
    let sum = *blake3::hash(&bytes[..table]).as_bytes();
    bytes[table..table + HASH].copy_from_slice(&sum);
}
