//! The reader under OBJ and MTL files: statements with their line numbers, cleaned of everything that is layout.

use std::io::{BufRead, Read};
use std::path::Path;

use crate::error::{Error, Result};

/// The longest statement with its continuations, in bytes: a face of some six million corners. What is longer is no OBJ file,
/// and would be read into memory as a whole.
const MOST_BYTES: usize = 64 << 20;

/// Reads statements one by one into one buffer that is used again.
///
/// It takes away: a UTF-8 byte order mark, LF and CRLF line ends, white space at both ends, comments, and the
/// backslash by which a line continues on the next. Empty lines are passed over.
pub(super) struct Lines<'a, R> {
    path: &'a Path,
    reader: R,
    /// Physical lines read so far.
    line: usize,
    /// Bytes read so far.
    bytes: u64,
    text: Vec<u8>,
}

/// A statement: its first word, the rest, and where it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Statement<'a> {
    /// The first word.
    pub keyword: &'a str,
    /// What follows the first word, without white space at its ends.
    pub rest: &'a str,
    /// The 1-based number of the physical line on which it begins.
    pub line: usize,
}

impl<'a, R: BufRead> Lines<'a, R> {
    /// Reads from `reader`; `path` is for messages.
    pub fn new(path: &'a Path, reader: R) -> Self {
        Self { path, reader, line: 0, bytes: 0, text: Vec::new() }
    }

    /// How many bytes were read.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The next statement, or `None` at the end.
    ///
    /// # Errors
    /// A system's error where reading fails; a file's error with its line for text that is not UTF-8; a limit for a statement
    /// of more than 64 MiB.
    pub fn read(&mut self) -> Result<Option<Statement<'_>>> {
        self.text.clear();
        let mut first_line = None;
        loop {
            let start = self.text.len();
            // One byte more than fits tells that there is more.
            let mut reader = self.reader.by_ref().take((MOST_BYTES + 1 - start) as u64);
            let count = reader.read_until(b'\n', &mut self.text).map_err(|cause| Error::system(self.path, cause))?;
            if count == 0 {
                break;
            }
            self.line += 1;
            self.bytes += count as u64;
            if self.text.len() > MOST_BYTES {
                let error = Error::limit("the statement is longer than 64 MiB").remedy("is this an OBJ or MTL file?");
                return Err(error.at_path(self.path).at_line(first_line.unwrap_or(self.line)));
            }
            if self.line == 1 {
                self.check_encoding()?;
            }
            first_line.get_or_insert(self.line);
            let comment = comment_start(&self.text[start..]);
            if let Some(comment) = comment {
                self.text.truncate(start + comment);
            }
            self.text.truncate(self.text.trim_ascii_end().len());
            // A backslash at the end of a comment is a folder's name more often than a wish to go on.
            if comment.is_none() && self.text.len() > start && self.text.ends_with(b"\\") {
                self.text.pop();
                self.text.push(b' ');
            } else if self.text.trim_ascii().is_empty() {
                self.text.clear();
                first_line = None;
            } else {
                break;
            }
        }
        let Some(line) = first_line else { return Ok(None) };
        let text = std::str::from_utf8(&self.text)
            .map_err(|_| {
                Error::file("the text is not UTF-8").remedy("save it as UTF-8").at_path(self.path).at_line(line)
            })?
            .trim();
        let (keyword, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
        Ok((!keyword.is_empty()).then_some(Statement { keyword, rest: rest.trim_start(), line }))
    }

    /// Looks at the first line for the marks of other encodings, and takes away the mark of UTF-8.
    fn check_encoding(&mut self) -> Result<()> {
        if self.text.starts_with(b"\xFF\xFE") || self.text.starts_with(b"\xFE\xFF") {
            return Err(Error::file("the text is UTF-16").remedy("save it as UTF-8").at_path(self.path));
        }
        if self.text.contains(&0) {
            let error = Error::file("the first line contains zero bytes: a binary file, or text in UTF-16 or UTF-32");
            return Err(error.remedy("save it as UTF-8 text").at_path(self.path));
        }
        if self.text.starts_with(b"\xEF\xBB\xBF") {
            self.text.drain(..3);
        }
        Ok(())
    }
}

/// Where a comment begins.
///
/// A `#` begins one anywhere among numbers, except in `1.#IND` and its like, which are old spellings of NaN. Among
/// names it must follow white space and not precede a digit, since 3ds Max calls its materials `Material #25`.
fn comment_start(line: &[u8]) -> Option<usize> {
    if !line.contains(&b'#') {
        return None;
    }
    let mut hashes = line.iter().enumerate().filter(|&(_, &byte)| byte == b'#').map(|(at, _)| at);
    let named = ends_with_a_name(line.trim_ascii_start());
    hashes.find(|&at| {
        let before = at.checked_sub(1).map(|at| line[at]);
        let after = line.get(at + 1);
        if named {
            before.is_none_or(|byte| byte.is_ascii_whitespace()) && !after.is_some_and(u8::is_ascii_digit)
        } else {
            !(before == Some(b'.') && after.is_some_and(u8::is_ascii_uppercase))
        }
    })
}

/// Whether the statement's last part is a name or a path.
fn ends_with_a_name(line: &[u8]) -> bool {
    let keyword = line.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    let names: [&[u8]; 10] =
        [b"usemtl", b"newmtl", b"mtllib", b"o", b"g", b"bump", b"disp", b"decal", b"refl", b"norm"];
    names.iter().any(|name| keyword.eq_ignore_ascii_case(name))
        || keyword.get(..4).is_some_and(|start| start.eq_ignore_ascii_case(b"map_"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(bytes: &[u8]) -> Result<Vec<(usize, String, String)>> {
        let mut lines = Lines::new(Path::new("a.obj"), bytes);
        let mut all = Vec::new();
        while let Some(statement) = lines.read()? {
            all.push((statement.line, statement.keyword.into(), statement.rest.into()));
        }
        assert_eq!(lines.bytes(), bytes.len() as u64);
        Ok(all)
    }

    fn expect(bytes: &[u8], expected: &[(usize, &str, &str)]) {
        let expected: Vec<_> = expected.iter().map(|&(line, k, r)| (line, k.to_owned(), r.to_owned())).collect();
        assert_eq!(statements(bytes).unwrap(), expected, "{}", String::from_utf8_lossy(bytes));
    }

    #[test]
    fn layout_is_taken_away_and_lines_are_counted() {
        expect(
            b"\xEF\xBB\xBFv 1 2\r\n\r\n  \t\n\tvt\t3   4  \r\nend",
            &[(1, "v", "1 2"), (4, "vt", "3   4"), (5, "end", "")],
        );
        expect(b"", &[]);
        expect(b"\n \n", &[]);
    }

    #[test]
    fn a_backslash_continues_a_line() {
        expect(b"f 1 2 \\\r\n 3\\\n4\nv", &[(1, "f", "1 2   3 4"), (4, "v", "")]);
        expect(b"f 1 \\", &[(1, "f", "1")]);
        expect(b"# in C:\\\nv 1", &[(2, "v", "1")]);
        expect(b"\\\n\\\nv 1", &[(1, "v", "1")]);
    }

    #[test]
    fn comments_end_statements_but_not_names() {
        expect(b"#v\nf 1 2 #3\nf 1 2#x\nv 1.#IND 1 #c", &[(2, "f", "1 2"), (3, "f", "1 2"), (4, "v", "1.#IND 1")]);
        expect(
            b"usemtl Material #25\nusemtl a#b # c\nmap_Kd x#1.png",
            &[(1, "usemtl", "Material #25"), (2, "usemtl", "a#b"), (3, "map_Kd", "x#1.png")],
        );
    }

    #[test]
    fn statements_of_absurd_length_are_a_limit() {
        let endless = |line: &'static [u8]| {
            let reader = std::io::BufReader::new(b"v 1\n".chain(Cycle { line, at: 0 }));
            let mut lines = Lines::new(Path::new("a.obj"), reader);
            assert!(lines.read().unwrap().is_some());
            lines.read().unwrap_err().to_string()
        };
        let expected = "a.obj:2: the statement is longer than 64 MiB; is this an OBJ or MTL file?";
        assert_eq!(endless(b"f 1 2 3 "), expected);
        assert_eq!(endless(b"f 1 2 3 \\\n"), expected);
    }

    /// The same bytes over and over.
    struct Cycle {
        line: &'static [u8],
        at: usize,
    }

    impl Read for Cycle {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            for byte in bytes.iter_mut() {
                *byte = self.line[self.at];
                self.at = (self.at + 1) % self.line.len();
            }
            Ok(bytes.len())
        }
    }

    #[test]
    fn other_encodings_are_named() {
        let message = |bytes: &[u8]| statements(bytes).unwrap_err().to_string();
        assert_eq!(message(b"\xFF\xFEv\0"), "a.obj: the text is UTF-16; save it as UTF-8");
        assert_eq!(message(b"v 1\no \xE9t\xE9\n"), "a.obj:2: the text is not UTF-8; save it as UTF-8");
        assert!(message(b"v\0 \0").contains("zero bytes"));
        expect(b"# \xE9t\xE9\nv 1", &[(2, "v", "1")]);
    }
}
