//! Files of rays, read piece by piece: text, one ray a line, or eight little-endian f32 a ray.
//!
//! Text is `ox oy oz dx dy dz [t_min t_max]`, separated by blanks; what follows a `#` is a comment. Numbers are decimal
//! or hexadecimal floats (`0x1.8p+1`), `inf` and `nan`. Each is read to the nearest f64 (a hexadecimal one must be exact);
//! directions and ends of intervals are then rounded to f32, origins once they are relative to the scene's origin.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::geometry::Ray;
use crate::measure::hexadecimal::{hexadecimal, hexadecimal_f64};

/// How rays and answers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordFormat {
    /// A line of text.
    Text,
    /// 32-bit little-endian words.
    F32,
}

/// A ray in a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FileRay {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes.
    pub direction: Vec3,
    /// The smallest t that counts.
    pub t_min: f32,
    /// The largest t that counts.
    pub t_max: f32,
}

impl FileRay {
    /// The ray as the renderer takes it: its origin made relative in f64, then rounded.
    pub fn relative_to(&self, origin: DVec3) -> Ray {
        let Self { direction, t_min, t_max, .. } = *self;
        Ray { origin: (self.origin - origin).as_vec3(), t_min, direction, t_max }
    }
}

/// A ray in a file's coordinates as it is written: every number exactly, and read back as the same ray.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RayText {
    /// Where it starts.
    pub origin: [String; 3],
    /// Where it goes.
    pub direction: [String; 3],
    /// The smallest t that counts.
    pub t_min: String,
    /// The largest t that counts.
    pub t_max: String,
}

impl RayText {
    /// A ray that is relative to `origin`.
    pub fn of(ray: &Ray, origin: DVec3) -> Self {
        let own = ray.origin.as_dvec3();
        // Nothing is added where there is nothing to add: -0 stays.
        let placed = |axis: usize| if origin[axis] == 0.0 { own[axis] } else { own[axis] + origin[axis] };
        Self {
            origin: [0, 1, 2].map(|axis| hexadecimal_f64(placed(axis))),
            direction: ray.direction.to_array().map(hexadecimal),
            t_min: hexadecimal(ray.t_min),
            t_max: hexadecimal(ray.t_max),
        }
    }
}

impl std::fmt::Display for RayText {
    /// The line of a file.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} {} {}", self.origin.join(" "), self.direction.join(" "), self.t_min, self.t_max)
    }
}

/// Bytes of a ray.
const RAY_BYTES: usize = 32;

/// Longer lines are no rays: the longest f64 has some 1100 digits.
const LONGEST_LINE: u64 = 1 << 16;

/// Bytes that are read at once.
const BUFFER_BYTES: usize = 1 << 20;

/// Reads rays in the order of the file, with constant memory.
pub struct RayReader<R> {
    reader: BufReader<R>,
    format: RecordFormat,
    path: PathBuf,
    /// Lines read, of text.
    line: usize,
    /// Bytes read.
    bytes: u64,
    text: Vec<u8>,
    /// What is wrong with what comes next.
    failed: Option<Error>,
}

impl<R: Read> RayReader<R> {
    /// A reader; `path` is for messages.
    pub fn new(source: R, format: RecordFormat, path: &Path) -> Self {
        let reader = BufReader::with_capacity(BUFFER_BYTES, source);
        Self { reader, format, path: path.to_path_buf(), line: 0, bytes: 0, text: Vec::new(), failed: None }
    }

    /// Bytes read so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Replaces `rays` by the next `most` at most; none are left if it stays empty.
    ///
    /// What has arrived already is not kept waiting for what has not: a pipe is answered as it is filled. Rays before
    /// something that is none are given first; the error comes with the next call.
    ///
    /// # Errors
    /// A line that is no ray, with line and column; a ray cut short, with the byte where it begins; the system's.
    pub fn read(&mut self, rays: &mut Vec<FileRay>, most: usize) -> Result<()> {
        rays.clear();
        if let Some(error) = self.failed.take() {
            return Err(error);
        }
        while rays.len() < most && (rays.is_empty() || !self.reader.buffer().is_empty()) {
            let next = match self.format {
                RecordFormat::Text => self.read_line(),
                RecordFormat::F32 => self.read_record(),
            };
            match next {
                Ok(Some(ray)) => rays.extend(ray),
                Ok(None) => break,
                Err(error) if rays.is_empty() => return Err(error),
                Err(error) => {
                    self.failed = Some(error);
                    break;
                }
            }
        }
        Ok(())
    }

    /// The ray of the next line, if it has one; `None` at the end.
    fn read_line(&mut self) -> Result<Option<Option<FileRay>>> {
        self.text.clear();
        let line = (&mut self.reader).take(LONGEST_LINE).read_until(b'\n', &mut self.text);
        let length = line.map_err(|cause| Error::system(&self.path, cause))?;
        if length == 0 {
            return Ok(None);
        }
        self.line += 1;
        self.bytes += length as u64;
        let at = |error: Error, column: usize| error.at_path(&self.path).at_line_column(self.line, column);
        if length as u64 == LONGEST_LINE {
            return Err(at(Error::file("the line is longer than 65535 bytes").remedy(EXPECTED), 1));
        }
        // A mark that some editors put before UTF-8 is no part of the line.
        let mark = if self.line == 1 && self.text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        parse_line(&self.text[mark..])
            .map_err(|(column, message)| at(Error::file(message).remedy(EXPECTED), column))
            .map(Some)
    }

    /// The next record; `None` at the end.
    fn read_record(&mut self) -> Result<Option<Option<FileRay>>> {
        let mut bytes = [0; RAY_BYTES];
        let mut have = 0;
        while have < RAY_BYTES {
            match self.reader.read(&mut bytes[have..]) {
                Ok(0) => break,
                Ok(more) => have += more,
                Err(cause) if cause.kind() == std::io::ErrorKind::Interrupted => {}
                Err(cause) => return Err(Error::system(&self.path, cause)),
            }
        }
        if have == 0 {
            return Ok(None);
        }
        if have < RAY_BYTES {
            let start = self.bytes;
            let message = format!("the last ray, at byte {start}, has {have} of its {RAY_BYTES} bytes");
            return Err(Error::file(message).remedy("a ray is eight little-endian f32").at_path(&self.path));
        }
        self.bytes += RAY_BYTES as u64;
        let at = |k: usize| f32::from_le_bytes(std::array::from_fn(|byte| bytes[4 * k + byte]));
        let origin = DVec3::new(at(0).into(), at(1).into(), at(2).into());
        Ok(Some(Some(FileRay { origin, t_min: at(3), direction: Vec3::new(at(4), at(5), at(6)), t_max: at(7) })))
    }
}

const EXPECTED: &str = "a line is `ox oy oz dx dy dz [t_min t_max]`";

/// The ray of a line, if it has one; an error has the 1-based column where it is.
fn parse_line(line: &[u8]) -> std::result::Result<Option<FileRay>, (usize, String)> {
    let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
    let mut numbers = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY];
    let (mut count, mut start) = (0, 0);
    while let Some(skip) = line[start..].iter().position(|byte| !byte.is_ascii_whitespace()) {
        start += skip;
        let length = line[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(line.len() - start);
        let word = String::from_utf8_lossy(&line[start..start + length]);
        let column = start + 1;
        if count == numbers.len() {
            return Err((column, "more than 8 numbers".into()));
        }
        numbers[count] = parse_number(&word).map_err(|message| (column, message))?;
        count += 1;
        start += length;
    }
    match count {
        0 => Ok(None),
        6 | 8 => {
            let [ox, oy, oz, dx, dy, dz, t_min, t_max] = numbers;
            let direction = DVec3::new(dx, dy, dz).as_vec3();
            let (t_min, t_max) = (t_min as f32, t_max as f32);
            Ok(Some(FileRay { origin: DVec3::new(ox, oy, oz), direction, t_min, t_max }))
        }
        _ => Err((line.trim_ascii_end().len() + 1, format!("{count} numbers where 6 or 8 are expected"))),
    }
}

/// A decimal or hexadecimal number, `inf` or `nan`.
fn parse_number(word: &str) -> std::result::Result<f64, String> {
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word);
    // Names and digits that do not end must not fill the terminal.
    let shown = || {
        if word.chars().count() > 40 { word.chars().take(37).chain("...".chars()).collect() } else { word.to_owned() }
    };
    if unsigned.starts_with("0x") || unsigned.starts_with("0X") {
        hexf_parse::parse_hexf64(word, false).map_err(|error| format!("`{}`: {error}", shown()))
    } else {
        word.parse().map_err(|_| format!("`{}` is not a number", shown()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], format: RecordFormat) -> Result<Vec<FileRay>> {
        let mut reader = RayReader::new(bytes, format, Path::new("rays"));
        let (mut all, mut some) = (Vec::new(), Vec::new());
        loop {
            reader.read(&mut some, 3)?;
            if some.is_empty() {
                assert_eq!(reader.bytes(), bytes.len() as u64);
                return Ok(all);
            }
            all.append(&mut some);
        }
    }

    #[test]
    fn text_is_read_exactly() {
        let text =
            "# rays\n\n 1 2e0 -3.5  0.1 +0x1.8p-1 .5\r\n1 2 3 4 5 6 0x1p-149 inf # comment\nnan 0 0 1 0 0 -1 1e400";
        let rays = read(text.as_bytes(), RecordFormat::Text).unwrap();
        assert_eq!(rays.len(), 3);
        assert_eq!(rays[0].origin, DVec3::new(1.0, 2.0, -3.5));
        assert_eq!(rays[0].direction, Vec3::new(0.1, 0.75, 0.5));
        assert_eq!((rays[0].t_min, rays[0].t_max), (0.0, f32::INFINITY));
        assert_eq!((rays[1].t_min, rays[1].t_max), (1e-45, f32::INFINITY));
        assert!(rays[2].origin.x.is_nan() && rays[2].t_max == f32::INFINITY);
        // Made relative in f64: nothing of what is beside the origin gets lost.
        let far = read(b"5000000.001 0 0 1 0 0", RecordFormat::Text).unwrap()[0];
        assert_eq!(far.relative_to(DVec3::new(5e6, 0.0, 0.0)).origin.x, (5000000.001f64 - 5e6) as f32);
    }

    #[test]
    fn what_is_no_ray_is_told_with_line_and_column() {
        for (text, line, column, told) in [
            ("1 2 3 4 5 6\n1 2 x 4 5 6\n", 2, 5, "`x`"),
            ("\n  1 2 3 4 5\n", 2, 12, "5 numbers"),
            ("1 2 3 4 5 6 7", 1, 14, "7 numbers"),
            ("1 2 3 4 5 6 7 8 9", 1, 17, "more than 8"),
            ("1 2 3 4 5 0x1.8", 1, 11, "0x1.8"),
            ("0x1.0000000000001p0 2 3 4 5 0x1.00000000000001p0", 1, 29, "exactly"),
            ("1,2,3 4 5 6", 1, 1, "1,2,3"),
            ("1 2 3 4 5 6\n\u{fffd}\n", 2, 1, "number"),
        ] {
            let error = read(text.as_bytes(), RecordFormat::Text).unwrap_err();
            assert_eq!((error.line(), error.column()), (Some(line), Some(column)), "{text}: {error}");
            assert!(error.message().contains(told) && error.path() == Some(Path::new("rays")), "{text}: {error}");
        }
        // Rays before it are given.
        let mut reader = RayReader::new(&b"1 2 3 4 5 6\n1 2 3 4 5 6\nx"[..], RecordFormat::Text, Path::new("rays"));
        let mut rays = Vec::new();
        reader.read(&mut rays, 9).unwrap();
        assert_eq!(rays.len(), 2);
        assert_eq!(reader.read(&mut rays, 9).unwrap_err().line(), Some(3));
        assert_eq!(read(b"\xef\xbb\xbf.5 2 3 4 5 6", RecordFormat::Text).unwrap()[0].origin.x, 0.5);
        let endless = vec![b'1'; 1 << 20];
        assert!(read(&endless, RecordFormat::Text).unwrap_err().message().contains("longer"));
        assert!(read(b"\xff\xfe 1 2", RecordFormat::Text).is_err());
    }

    #[test]
    fn records_are_read_and_cut_ones_refused() {
        let values = [1.0f32, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0, f32::INFINITY];
        let bytes: Vec<u8> = values.iter().cycle().take(32).flat_map(|x| x.to_le_bytes()).collect();
        let rays = read(&bytes, RecordFormat::F32).unwrap();
        let expected = FileRay {
            origin: DVec3::new(1.0, 2.0, 3.0),
            direction: Vec3::new(4.0, 5.0, 6.0),
            t_min: 0.5,
            t_max: f32::INFINITY,
        };
        assert_eq!(rays, [expected; 4]);
        assert_eq!(bytemuck::bytes_of(&expected.relative_to(DVec3::ZERO)), &bytes[..32]);
        let cut = read(&bytes[..70], RecordFormat::F32).unwrap_err();
        assert!(cut.message().contains("byte 64") && cut.message().contains("6 of its 32"), "{cut}");
        assert_eq!(read(b"", RecordFormat::F32).unwrap(), []);
    }
}
