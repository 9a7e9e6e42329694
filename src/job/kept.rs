//! The tiles of a picture that is being rendered, kept beside it.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::formats::atomic_file::write_atomically;
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
    /// Its whole tiles, each once.
    pub tiles: Vec<Tile>,
    /// Where, in bytes, each run of damaged records begins: their tiles are to be rendered again.
    pub damaged: Vec<usize>,
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
        if !path.exists() {
            write_atomically(path, |sink| sink.write_all(&start).map_err(system))?;
        }
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(system)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                return Err(Error::caller("another process keeps the tiles of this picture here")
                    .at_path(path)
                    .remedy("wait until it ends, or write to another file"));
            }
            // Some file systems have no locks.
            Ok(()) | Err(TryLockError::Error(_)) => {}
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(system)?;
        let content = tile_file::parse(&bytes, path)?;
        drop(bytes);
        if let Some(difference) = header.difference(&content.header) {
            return Err(Error::caller(format!("the tiles that are kept here are of another picture: {difference}"))
                .at_path(path)
                .remedy("delete the file to begin again, or write to another one"));
        }
        if content.key != key {
            return Err(Error::caller("the tiles that are kept here are of another share of the picture")
                .at_path(path)
                .remedy("delete the file to begin again, or write to another one"));
        }
        // What a killed process did not finish is written over.
        file.set_len(content.end as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(system)?;
        let mut found = Found { tiles: content.tiles, damaged: content.damaged };
        found.tiles.sort_by_key(|tile| tile.number);
        found.tiles.dedup_by_key(|tile| tile.number);
        let growing = Growing { file, synced: Instant::now(), failed: None };
        Ok((Self { path: path.to_path_buf(), key, file: Mutex::new(growing) }, found))
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
