//! The file around the JSON: text as it is, or binary glTF ("GLB") with its chunks.
//!
//! Written here because the crate's splitter overflows on a header length below 12 and refuses unknown chunks, which
//! the format tells readers to skip (glTF 2.0, section 4.4).

use super::bytes::Bytes;
use crate::error::{Error, Result};

/// The parts of a file.
#[derive(Debug)]
pub(super) struct Container<'a> {
    /// The JSON text, without a byte order mark.
    pub json: Bytes<'a>,
    /// The binary chunk, which the first buffer may stand for.
    pub binary: Option<Bytes<'a>>,
}

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
const BYTE_ORDER_MARK: &[u8; 3] = b"\xEF\xBB\xBF";
const HEADER_BYTES: u64 = 12;
const CHUNK_HEADER_BYTES: u64 = 8;

impl<'a> Container<'a> {
    /// Finds the parts of a `.gltf` or `.glb` file, told apart by content.
    ///
    /// # Errors
    /// A file's error for a binary file that is cut off, of another version, or without JSON; the system's.
    pub fn split(file: &Bytes<'a>) -> Result<Self> {
        if !starts_with(file, MAGIC)? {
            let start = if starts_with(file, BYTE_ORDER_MARK)? { BYTE_ORDER_MARK.len() as u64 } else { 0 };
            return Ok(Self { json: file.slice(start..file.len()).unwrap_or(Bytes::EMPTY), binary: None });
        }
        let truncated = || Error::file("the binary glTF is cut off").remedy("fetch or export the file again");
        let version = word(file, 4)?.ok_or_else(truncated)?;
        if version != 2 {
            return Err(Error::unsupported(format!("binary glTF of version {version}; only version 2 is read"))
                .remedy("convert it with `gltf-pipeline -i in.glb -o out.glb`"));
        }
        let end = u64::from(word(file, 8)?.ok_or_else(truncated)?);
        if end < HEADER_BYTES {
            return Err(Error::file(format!("the header of the binary glTF gives a length of {end} bytes")));
        }
        if end > file.len() {
            return Err(truncated());
        }
        let (mut json, mut binary) = (None, None);
        let mut at = HEADER_BYTES;
        while end - at >= CHUNK_HEADER_BYTES {
            let (length, kind) = (word(file, at)?.ok_or_else(truncated)?, word(file, at + 4)?.ok_or_else(truncated)?);
            let start = at + CHUNK_HEADER_BYTES;
            at = start + u64::from(length);
            if at > end {
                return Err(truncated());
            }
            match &kind.to_le_bytes() {
                JSON_CHUNK => json = json.or(file.slice(start..at)),
                BINARY_CHUNK => binary = binary.or(file.slice(start..at)),
                _ => {}
            }
        }
        let json = json.ok_or_else(|| Error::file("the binary glTF has no JSON chunk"))?;
        Ok(Self { json, binary })
    }
}

fn starts_with(file: &Bytes, start: &[u8]) -> Result<bool> {
    let length = start.len() as u64;
    Ok(file.len() >= length && file.read(0..length, &mut Vec::new())? == start)
}

/// The little-endian number at a byte offset; `None` beyond the end.
fn word(file: &Bytes, at: u64) -> Result<Option<u32>> {
    if at + 4 > file.len() {
        return Ok(None);
    }
    let mut scratch = Vec::new();
    Ok(file.read(at..at + 4, &mut scratch)?.first_chunk().copied().map(u32::from_le_bytes))
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

    /// The JSON and the binary chunk of a file in memory.
    fn split(file: &[u8]) -> Result<(Vec<u8>, Option<Vec<u8>>)> {
        let parts = Container::split(&Bytes::Memory(file.into()))?;
        let all = |bytes: &Bytes| bytes.all().unwrap().to_vec();
        Ok((all(&parts.json), parts.binary.as_ref().map(all)))
    }

    #[test]
    fn text_and_binary_are_told_apart() {
        assert_eq!(split(b"\xEF\xBB\xBF{}").unwrap(), (b"{}".to_vec(), None));
        assert_eq!(split(b"{").unwrap(), (b"{".to_vec(), None));
        let file = glb(&[(b"JSON", b"{}  "), (b"ODD!", b"skip"), (b"BIN\0", b"data")]);
        assert_eq!(split(&file).unwrap(), (b"{}  ".to_vec(), Some(b"data".to_vec())));
    }

    #[test]
    fn every_truncation_is_an_error_and_no_panic() {
        let file = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"data")]);
        for end in 4..file.len() {
            assert!(split(&file[..end]).is_err(), "{end}");
        }
        for length in 0..file.len() as u32 {
            let mut lying = file.clone();
            lying[8..12].copy_from_slice(&length.to_le_bytes());
            let _ = split(&lying);
        }
        assert!(split(&glb(&[(b"BIN\0", b"data")])).is_err());
        assert!(split(b"glTF\x01\0\0\0\x20\0\0\0").is_err());
    }
}
