//! The bytes of every buffer, and checked slices of them.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use ::gltf::json::{Index, Root, buffer};

use super::document::missing_extension;
use super::uri::{self, Target};
use crate::error::{Error, Fault, Result};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Limits};

/// Extensions whose views have uncompressed bytes only where the file was made to have them.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// All buffers of a file, loaded.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    bytes: Vec<Cow<'a, [u8]>>,
}

impl<'a> Buffers<'a> {
    /// Reads every buffer: the binary chunk, data URIs, and files in `folder`. No more memory is taken than the
    /// sources have bytes.
    ///
    /// # Errors
    /// A file's error that names the buffer, where its source is missing or shorter than it says.
    pub fn read(
        root: &Root,
        binary: Option<&'a [u8]>,
        surroundings: &Surroundings,
        ledger: &mut Ledger,
    ) -> Result<Self> {
        let mut bytes = Vec::new();
        for (number, buffer) in root.buffers.iter().enumerate() {
            let in_buffer = |error: Error| {
                error.within(format_args!("buffers[{number}]")).remedy("keep the files of a model together")
            };
            let length = usize::try_from(buffer.byte_length.0)
                .map_err(|_| in_buffer(Error::limit(format!("{} bytes are too many", buffer.byte_length.0))))?;
            let source = match (&buffer.uri, binary) {
                (Some(uri), _) => match uri::resolve(uri, surroundings).map_err(in_buffer)? {
                    Target::Data(bytes) => Cow::Owned(bytes),
                    Target::File(path) => {
                        ledger.note_file(&path);
                        Cow::Owned(read_exactly(&path, length, &surroundings.limits).map_err(in_buffer)?)
                    }
                },
                (None, Some(binary)) if number == 0 => Cow::Borrowed(binary),
                // A buffer without a source is legal: an extension may fill it. Whoever reads from it gets an error.
                (None, _) => Cow::Borrowed([].as_slice()),
            };
            let without_source = buffer.uri.is_none() && source.is_empty();
            if source.len() < length && !without_source {
                let text = format!("has {} bytes where its byteLength is {length}", source.len());
                return Err(in_buffer(Error::file(text)));
            }
            bytes.push(match source {
                Cow::Borrowed(bytes) => Cow::Borrowed(bytes.get(..length).unwrap_or(bytes)),
                Cow::Owned(mut bytes) => {
                    bytes.truncate(length);
                    Cow::Owned(bytes)
                }
            });
        }
        Ok(Self { bytes })
    }

    /// Bytes of all buffers together.
    pub fn total_bytes(&self) -> u64 {
        self.bytes.iter().map(|bytes| bytes.len() as u64).sum()
    }

    /// The bytes of a buffer view.
    ///
    /// # Errors
    /// A file's error that names the view, if it does not exist or reaches beyond its buffer.
    pub fn view(&self, root: &Root, view: Index<buffer::View>) -> Result<&[u8]> {
        let number = view.value();
        let missing = || Error::file(format!("bufferViews[{number}] does not exist"));
        let view = root.buffer_views.get(number).ok_or_else(missing)?;
        let buffer = view.buffer.value();
        let bytes = self
            .bytes
            .get(buffer)
            .ok_or_else(|| Error::file(format!("bufferViews[{number}].buffer: buffers[{buffer}] does not exist")))?;
        let compressed = view.extensions.as_ref().and_then(|extensions| {
            MESHOPT.into_iter().find(|name| bytes.is_empty() && extensions.others.contains_key(*name))
        });
        if let Some(name) = compressed {
            return Err(missing_extension(name).within(format_args!("bufferViews[{number}]")));
        }
        let start = view.byte_offset.unwrap_or_default().0;
        let beyond = || {
            let (length, have) = (view.byte_length.0, bytes.len());
            Error::file(format!(
                "bufferViews[{number}]: {length} bytes from {start} reach beyond buffers[{buffer}], which has {have}"
            ))
        };
        let end = start.checked_add(view.byte_length.0).ok_or_else(beyond)?;
        let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
        range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(beyond)
    }
}

/// The first `length` bytes of a file, or all it has if it has fewer.
///
/// Only regular files are read: a device or pipe may never end.
fn read_exactly(path: &Path, length: usize, limits: &Limits) -> Result<Vec<u8>> {
    let failed = |error: io::Error| {
        let fault = if error.kind() == io::ErrorKind::NotFound { Fault::File } else { Fault::System };
        Error::new(fault, format!("`{}`: {error}", path.display()))
    };
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if !metadata.is_file() {
        return Err(Error::file(format!("`{}` is not a file", path.display())));
    }
    limits.check_file_bytes(metadata.len()).map_err(|error| error.within(format_args!("`{}`", path.display())))?;
    let mut bytes = Vec::new();
    let size = usize::try_from(metadata.len()).unwrap_or(usize::MAX).min(length);
    bytes.try_reserve_exact(size).map_err(|_| Error::limit(format!("not enough memory for {size} bytes")))?;
    file.take(length as u64).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}
