//! Bytes of a file: in memory, or left on disk until they are wanted.
//!
//! A large `.glb` is as large as the meshes made of it. It stays on disk, and its arrays are read piece by piece, so
//! that loading takes little more memory than its result. Reading was chosen over mapping: pages of a mapping count as
//! memory too, and a file that shrinks while it is mapped ends the program where here it is an error.

use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::{Error, Result};
use crate::formats::Limits;

/// A run of bytes.
#[derive(Debug, Clone)]
pub(super) enum Bytes<'a> {
    /// In memory.
    Memory(Cow<'a, [u8]>),
    /// A part of a file.
    File(Arc<OpenFile>, Range<u64>),
}

/// A file that several threads read from.
#[derive(Debug)]
pub(super) struct OpenFile {
    path: PathBuf,
    file: Mutex<File>,
}

impl<'a> Bytes<'a> {
    /// No bytes.
    pub const EMPTY: Self = Self::Memory(Cow::Borrowed(&[]));

    /// All bytes of a file. What is no regular file, such as a pipe, is read at once.
    ///
    /// # Errors
    /// A limit, or the system's, both with the path.
    pub fn open(path: &Path, limits: &Limits) -> Result<Self> {
        let failed = |error| Error::system(path, error);
        let metadata = std::fs::metadata(path).map_err(failed)?;
        if !metadata.is_file() {
            return Ok(Self::Memory(Cow::Owned(limits.read_file(path)?)));
        }
        limits.check_file_bytes(metadata.len()).map_err(|error| error.at_path(path))?;
        let file = File::open(path).map_err(failed)?;
        Ok(Self::File(Arc::new(OpenFile { path: path.to_path_buf(), file: Mutex::new(file) }), 0..metadata.len()))
    }

    /// How many they are.
    pub fn len(&self) -> u64 {
        match self {
            Self::Memory(bytes) => bytes.len() as u64,
            Self::File(_, range) => range.end - range.start,
        }
    }

    /// A part; `None` if it reaches beyond the end.
    pub fn slice(&self, part: Range<u64>) -> Option<Self> {
        if part.start > part.end || part.end > self.len() {
            return None;
        }
        Some(match self {
            Self::Memory(Cow::Borrowed(bytes)) => Self::Memory(Cow::Borrowed(&bytes[usize_range(&part)])),
            Self::Memory(Cow::Owned(bytes)) => Self::Memory(Cow::Owned(bytes[usize_range(&part)].to_vec())),
            Self::File(file, range) => Self::File(file.clone(), range.start + part.start..range.start + part.end),
        })
    }

    /// Reads a part that lies within, into `scratch` if it is not in memory.
    ///
    /// # Errors
    /// The system's, as where the file has been cut off meanwhile; a limit where memory does not suffice.
    pub fn read<'s>(&'s self, part: Range<u64>, scratch: &'s mut Vec<u8>) -> Result<&'s [u8]> {
        match self {
            Self::Memory(bytes) => Ok(&bytes[usize_range(&part)]),
            Self::File(file, range) => {
                let length = usize::try_from(part.end - part.start).unwrap_or(usize::MAX);
                if length > scratch.capacity() {
                    let more = length - scratch.len();
                    let full = |_| Error::limit(format!("not enough memory for {length} bytes"));
                    scratch.try_reserve_exact(more).map_err(full)?;
                }
                scratch.resize(length, 0);
                file.read(range.start + part.start, scratch)?;
                Ok(scratch)
            }
        }
    }

    /// All of them at once.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn all(&self) -> Result<Cow<'_, [u8]>> {
        self.part(0..self.len())
    }

    /// A range of them, which must not reach beyond the end.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn part(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>> {
        match self {
            Self::Memory(bytes) => Ok(Cow::Borrowed(&bytes[usize_range(&range)])),
            Self::File(..) => {
                let mut bytes = Vec::new();
                self.read(range, &mut bytes)?;
                Ok(Cow::Owned(bytes))
            }
        }
    }
}

impl OpenFile {
    fn read(&self, start: u64, bytes: &mut [u8]) -> Result<()> {
        // Whoever panicked while it held the file left at most another place in it, which is set here.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let outcome = file.seek(SeekFrom::Start(start)).and_then(|_| file.read_exact(bytes));
        outcome.map_err(|error| Error::system(&self.path, error))
    }
}

/// The same range; only for what lies in memory.
fn usize_range(range: &Range<u64>) -> Range<usize> {
    range.start as usize..range.end as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_file_and_of_memory_are_the_same() {
        let content: Vec<u8> = (0..=255).collect();
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        std::fs::write(&path, &content).unwrap();
        let both = [Bytes::open(&path, &Limits::default()).unwrap(), Bytes::Memory(Cow::Borrowed(&content))];
        for bytes in both {
            assert_eq!(bytes.len(), 256);
            assert_eq!(bytes.all().unwrap(), content);
            let part = bytes.slice(16..32).unwrap();
            assert_eq!(part.read(2..5, &mut Vec::new()).unwrap(), [18, 19, 20]);
            assert_eq!(part.slice(4..8).unwrap().all().unwrap().as_ref(), [20, 21, 22, 23]);
            assert!(part.slice(0..17).is_none() && bytes.slice(0..257).is_none());
        }
        assert_eq!(Bytes::EMPTY.len(), 0);
    }

    #[test]
    fn a_file_that_shrinks_is_an_error() {
        let path = tempfile::NamedTempFile::new().unwrap().into_temp_path();
        std::fs::write(&path, [0; 64]).unwrap();
        let bytes = Bytes::open(&path, &Limits::default()).unwrap();
        std::fs::write(&path, [0; 8]).unwrap();
        assert_eq!(bytes.all().unwrap_err().fault(), crate::error::Fault::System);
    }
}
