//! The file around the JSON: text as it is, or binary glTF ("GLB") with its chunks.
//!
//! Written here because the crate's splitter overflows on a header length below 12 and refuses unknown chunks, which
//! the format tells readers to skip (glTF 2.0, section 4.4).

use crate::error::{Error, Result};

/// The parts of a file.
#[derive(Debug, PartialEq)]
pub(super) struct Container<'a> {
    /// The JSON text, without a byte order mark.
    pub json: &'a [u8],
    /// The binary chunk, which the first buffer may stand for.
    pub binary: Option<&'a [u8]>,
}

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

impl<'a> Container<'a> {
    /// Finds the parts of a `.gltf` or `.glb` file, told apart by content.
    ///
    /// # Errors
    /// A file's error for a binary file that is cut off, of another version, or without JSON.
    pub fn split(file: &'a [u8]) -> Result<Self> {
        if !file.starts_with(MAGIC) {
            return Ok(Self { json: file.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(file), binary: None });
        }
        let truncated = || Error::file("the binary glTF is cut off").remedy("fetch or export the file again");
        let version = word(file, 4).ok_or_else(truncated)?;
        if version != 2 {
            return Err(Error::unsupported(format!("binary glTF of version {version}; only version 2 is read"))
                .remedy("convert it with `gltf-pipeline -i in.glb -o out.glb`"));
        }
        let length = word(file, 8).ok_or_else(truncated)? as usize;
        if length < HEADER_BYTES {
            return Err(Error::file(format!("the header of the binary glTF gives a length of {length} bytes")));
        }
        let mut rest = file.get(HEADER_BYTES..length).ok_or_else(truncated)?;
        let (mut json, mut binary) = (None, None);
        while rest.len() >= CHUNK_HEADER_BYTES {
            let (header, body) = rest.split_at(CHUNK_HEADER_BYTES);
            let length = word(header, 0).ok_or_else(truncated)? as usize;
            let chunk = body.get(..length).ok_or_else(truncated)?;
            match &header[4..] {
                kind if kind == JSON_CHUNK => json = json.or(Some(chunk)),
                kind if kind == BINARY_CHUNK => binary = binary.or(Some(chunk)),
                _ => {}
            }
            rest = &body[length..];
        }
        let json = json.ok_or_else(|| Error::file("the binary glTF has no JSON chunk"))?;
        Ok(Self { json, binary })
    }
}

/// The little-endian number at a byte offset.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().copied().map(u32::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, bytes) in chunks {
            body.extend((bytes.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*bytes);
        }
        let mut file = b"glTF\x02\0\0\0".to_vec();
        file.extend((body.len() as u32 + 12).to_le_bytes());
        file.extend(body);
        file
    }

    #[test]
    fn text_and_binary_are_told_apart() {
        assert_eq!(Container::split(b"\xEF\xBB\xBF{}").unwrap(), Container { json: b"{}", binary: None });
        let file = glb(&[(b"JSON", b"{}  "), (b"ODD!", b"skip"), (b"BIN\0", b"data")]);
        assert_eq!(Container::split(&file).unwrap(), Container { json: b"{}  ", binary: Some(b"data") });
    }

    #[test]
    fn every_truncation_is_an_error_and_no_panic() {
        let file = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"data")]);
        for end in 4..file.len() {
            assert!(Container::split(&file[..end]).is_err(), "{end}");
        }
        for length in 0..file.len() as u32 {
            let mut lying = file.clone();
            lying[8..12].copy_from_slice(&length.to_le_bytes());
            let _ = Container::split(&lying);
        }
        assert!(Container::split(&glb(&[(b"BIN\0", b"data")])).is_err());
        assert!(Container::split(b"glTF\x01\0\0\0\x20\0\0\0").is_err());
    }
}
