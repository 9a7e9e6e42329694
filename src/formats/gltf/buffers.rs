//! The bytes of every buffer, and checked slices of them.

use std::borrow::Cow;
use std::ops::Range;
use std::path::Path;

use ::gltf::json::{Index, Root, buffer};

use super::bytes::Bytes;
use super::document::missing_extension;
use super::uri::{self, Target};
use crate::error::{Error, Result};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Limits};
use crate::progress::Progress;

/// Extensions whose views have uncompressed bytes only where the file was made to have them.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// All buffers of a file.
pub(super) struct Buffers<'a> {
    bytes: Vec<Bytes<'a>>,
    /// Who is told of the bytes that accessors read.
    pub progress: &'a dyn Progress,
}

impl<'a> Buffers<'a> {
    /// Finds every buffer: the binary chunk, data URIs, and files in `folder`. Files stay on disk.
    ///
    /// # Errors
    /// A file's error that names the buffer, where its source is missing or shorter than it says.
    pub fn find(
        root: &Root,
        binary: Option<Bytes<'a>>,
        surroundings: &Surroundings,
        ledger: &mut Ledger,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let mut bytes = Vec::new();
        for (number, buffer) in root.buffers.iter().enumerate() {
            let in_buffer = |error: Error| {
                error.within(format_args!("buffers[{number}]")).remedy("keep the files of a model together")
            };
            let source = match (&buffer.uri, &binary) {
                (Some(uri), _) => match uri::resolve(uri, surroundings).map_err(in_buffer)? {
                    Target::Data(bytes) => Bytes::Memory(Cow::Owned(bytes)),
                    Target::File(path) => {
                        ledger.note_file(&path);
                        open(&path, &surroundings.limits).map_err(in_buffer)?
                    }
                },
                (None, Some(binary)) if number == 0 => binary.clone(),
                // A buffer without a source is legal: an extension may fill it. Whoever reads from it gets an error.
                (None, _) => Bytes::EMPTY,
            };
            let length = buffer.byte_length.0;
            let without_source = buffer.uri.is_none() && source.len() == 0;
            if source.len() < length && !without_source {
                let text = format!("has {} bytes where its byteLength is {length}", source.len());
                return Err(in_buffer(Error::file(text)));
            }
            bytes.push(if source.len() > length { source.slice(0..length).unwrap_or(Bytes::EMPTY) } else { source });
        }
        Ok(Self { bytes, progress })
    }

    /// Bytes of all buffers together.
    pub fn total_bytes(&self) -> u64 {
        self.bytes.iter().map(Bytes::len).sum()
    }

    /// The bytes of a buffer view.
    ///
    /// # Errors
    /// As [`locate`](Self::locate); the system's.
    pub fn view(&self, root: &Root, view: Index<buffer::View>) -> Result<Cow<'_, [u8]>> {
        let (buffer, range) = self.locate(root, view)?;
        buffer.part(range)
    }

    /// The buffer that a view is of, and which of its bytes.
    ///
    /// # Errors
    /// A file's error that names the view, if it does not exist or reaches beyond its buffer.
    pub fn locate(&self, root: &Root, view: Index<buffer::View>) -> Result<(&Bytes<'a>, Range<u64>)> {
        let number = view.value();
        let missing = || Error::file(format!("bufferViews[{number}] does not exist"));
        let view = root.buffer_views.get(number).ok_or_else(missing)?;
        let buffer = view.buffer.value();
        let bytes = self
            .bytes
            .get(buffer)
            .ok_or_else(|| Error::file(format!("bufferViews[{number}].buffer: buffers[{buffer}] does not exist")))?;
        let compressed = view.extensions.as_ref().and_then(|extensions| {
            MESHOPT.into_iter().find(|name| bytes.len() == 0 && extensions.others.contains_key(*name))
        });
        if let Some(name) = compressed {
            return Err(missing_extension(name).within(format_args!("bufferViews[{number}]")));
        }
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0).filter(|&end| end <= bytes.len());
        let end = end.ok_or_else(|| {
            let (length, have) = (view.byte_length.0, bytes.len());
            Error::file(format!(
                "bufferViews[{number}]: {length} bytes from {start} reach beyond buffers[{buffer}], which has {have}"
            ))
        })?;
        Ok((bytes, start..end))
    }
}

/// Opens a file that a buffer names. Only regular files are read: a device or pipe may never end.
fn open(path: &Path, limits: &Limits) -> Result<Bytes<'static>> {
    let missing = |what: &str| Error::file(format!("`{}` {what}", path.display()));
    match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => {
            let in_file = |error: Error| error.within(format_args!("`{}`", path.display()));
            limits.check_file_bytes(metadata.len()).map_err(in_file)?;
            Bytes::open(path, limits)
        }
        Ok(_) => Err(missing("is not a file")),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(missing("is missing")),
        Err(error) => Err(Error::system(path, error)),
    }
}
