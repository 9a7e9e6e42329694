//! The tiles of a picture that is being rendered, kept beside it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::job::Header;
use crate::job::tile_file::{self, Key};
use crate::render::Tile;

/// A power cut loses no more than what was finished in this time.
const SYNC: Duration = Duration::from_secs(5);

/// A file of tiles that grows as they are finished. Another process cannot open it meanwhile.
#[derive(Debug)]
pub struct Kept {
    path: PathBuf,
    key: Key,
    file: Mutex<Growing>,
}

#[derive(Debug)]
struct Growing {
    file: File,
    synced: Instant,
    failed: Option<Error>,
}

/// What was in a file of an earlier process.
#[derive(Debug, Default)]
pub struct Found {
    /// Its whole tiles, by their numbers, each once.
    pub tiles: Vec<Tile>,
    /// Where, in bytes, the first damaged record begins: the tiles of such are to be rendered again.
    pub damaged: Option<usize>,
}

/// Opens a file, or creates it, and locks it against other processes.
fn open_locked(path: &Path) -> Result<File> {
    let system = |cause| Error::system(path, cause);
    loop {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(system)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(Error::caller("another process keeps the tiles of this picture here")
                    .at_path(path)
                    .remedy("wait until it ends, or write to another file"));
            }
            // Some file systems have no locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        // Another process may have deleted it before it was locked.
        if is_at(&file, path) {
            return Ok(file);
        }
    }
}

/// Whether a path leads to an open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    let (own, there) = (file.metadata().map(identity), std::fs::metadata(path).map(identity));
    own.is_ok_and(|own| there.is_ok_and(|there| own == there))
}

/// Elsewhere open files are not deleted.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

impl Kept {
    /// Opens the file of a picture and reads its tiles, or begins one.
    ///
    /// # Errors
    /// A file of another picture, with what differs; one whose header is damaged; one that another process has open; the
    /// system's.
    pub fn open(path: &Path, header: &Header) -> Result<(Self, Found)> {
        let system = |cause| Error::system(path, cause);
        let (start, key) = tile_file::begin(header);
        let mut file = open_locked(path)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(system)?;
        // A file that is new, or whose process was killed before it was more than begun.
        if bytes.len() < start.len() && start.starts_with(&bytes) {
            let begun = file.rewind().and_then(|()| file.write_all(&start)).and_then(|()| file.sync_all());
            begun.map_err(system)?;
            bytes = start;
        }
        let content = tile_file::parse(&bytes, path)?;
        drop(bytes);
        if content.key != key {
            let what = match header.difference(&content.header) {
                Some(difference) => format!("picture: {difference}"),
                None => "share of the picture".into(),
            };
            return Err(Error::caller(format!("the tiles that are kept here are of another {what}"))
                .at_path(path)
                .remedy("delete the file to begin again, or write to another one"));
        }
        // What a killed process did not finish is written over.
        file.set_len(content.end as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(system)?;
        let found = Found { tiles: content.tiles, damaged: content.damaged };
        let growing = Growing { file, synced: Instant::now(), failed: None };
        Ok((Self { path: path.to_path_buf(), key, file: Mutex::new(growing) }, found))
    }

    /// Deletes the file, once what was made of its tiles is on the disk.
    ///
    /// # Errors
    /// The system's.
    pub fn remove(self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => Err(Error::system(&self.path, cause)),
            _ => Ok(()),
        }
    }

    /// Appends a tile. After a failure nothing more is kept; [`failure`](Self::failure) tells of it.
    pub fn keep(&self, tile: &Tile) {
        let record = tile_file::record(&self.key, tile);
        let mut growing = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        if growing.failed.is_some() {
            return;
        }
        let mut written = growing.file.write_all(&record);
        if growing.synced.elapsed() >= SYNC {
            written = written.and_then(|()| growing.file.sync_data());
            growing.synced = Instant::now();
        }
        growing.failed = written.err().map(|cause| Error::system(&self.path, cause));
    }

    /// What stopped tiles from being kept, if anything did.
    pub fn failure(&self) -> Option<Error> {
        self.file.lock().unwrap_or_else(PoisonError::into_inner).failed.clone()
    }

    /// Brings everything to the disk.
    ///
    /// # Errors
    /// The system's.
    pub fn sync(&self) -> Result<()> {
        let growing = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        growing.file.sync_data().map_err(|cause| Error::system(&self.path, cause))
    }
}
