//! Files of rays that are read as a whole, for what asks them more than once.

use std::io::{Cursor, Read};
use std::path::Path;

use super::query::open;
use crate::error::{Error, Result};
use crate::measure::ray_file::{FileRay, RayReader, RecordFormat};
use crate::progress::Progress;

/// The answers of all that are compared are held at once: 20 bytes a ray each.
pub const MOST_RAYS: u32 = 10_000_000;

/// All rays of a file; without a format it is told by what the file begins with.
///
/// # Errors
/// As [`RayReader::read`]; a file of more than [`MOST_RAYS`].
pub fn read_rays(path: &Path, format: Option<RecordFormat>, progress: &dyn Progress) -> Result<Vec<FileRay>> {
    let mut source = open(path, progress)?.0;
    let mut head = Vec::new();
    if format.is_none() {
        let read = (&mut source).take(4096).read_to_end(&mut head);
        progress.check()?;
        read.map_err(|cause| Error::system(path, cause))?;
    }
    let format = format.unwrap_or_else(|| told_by(&head));
    let mut reader = RayReader::new(Cursor::new(head).chain(source), format, path);
    let (mut all, mut some) = (Vec::new(), Vec::new());
    loop {
        let read = reader.read(&mut some, 1 << 16);
        progress.check()?;
        read?;
        if some.is_empty() {
            return Ok(all);
        }
        all.append(&mut some);
        if all.len() > MOST_RAYS as usize {
            let message = format!("there are more than the {MOST_RAYS} rays that are held at once");
            return Err(Error::limit(message).at_path(path).remedy("split the file"));
        }
    }
}

/// Text has no control characters but white space; of eight f32 a ray some byte is one.
fn told_by(head: &[u8]) -> RecordFormat {
    let is_text = |byte: &u8| !byte.is_ascii_control() || byte.is_ascii_whitespace();
    if head.iter().all(is_text) { RecordFormat::Text } else { RecordFormat::F32 }
}

/// What a file is called in reports.
pub fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "scene".into(), |stem| stem.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_their_bytes() {
        assert_eq!(told_by("# Größe\n\t1 2 3 0 0 -1 0x0p+0 inf\r\n".as_bytes()), RecordFormat::Text);
        let ray = [1.5f32, 2.25, 3.125, 0.0, 1.0, 0.0, 0.0, f32::INFINITY];
        assert_eq!(told_by(bytemuck::cast_slice(&ray)), RecordFormat::F32);
    }
}
