//! The geometry statements of an OBJ file, as flat arrays in the order of the file.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec3, Vec2, Vec3};

use super::lines::Statement;
use super::triangulate::MOST_CORNERS;
use crate::error::{Error, Result};
use crate::formats::{Ledger, Treatment};

/// Stands for a number that a corner does not have, or that cannot be in the file.
pub(super) const ABSENT: u32 = u32::MAX;

/// Unknown keywords that are told apart; a file that is not an OBJ at all has any number of them.
const MOST_KEYWORDS: usize = 40;

/// What the statements said, before anything refers to anything.
#[derive(Default)]
pub(super) struct Parsed {
    /// `v`, in f64.
    pub positions: Vec<DVec3>,
    /// `vt`.
    pub uvs: Vec<Vec2>,
    /// `vn`, as they are.
    pub normals: Vec<Vec3>,
    /// `f`.
    pub faces: Faces,
    /// The names that `usemtl` gave, each once.
    pub material_names: Vec<String>,
    /// Where the material changes: the face's number and the position of the material's name.
    pub material_runs: Vec<(usize, usize)>,
    /// The rest of each `mtllib` and its line.
    pub libraries: Vec<(String, usize)>,
    name_positions: HashMap<String, usize>,
    unused: BTreeMap<String, u64>,
    counts: Counts,
}

/// How often something was worked around or left out within a statement.
#[derive(Default)]
struct Counts {
    colors: u64,
    weights: u64,
    small_faces: u64,
    attributes_outside: u64,
    normals_not_finite: u64,
    uvs_not_finite: u64,
}

/// Polygons: 0-based numbers per corner, corners counted per face.
#[derive(Default)]
pub(super) struct Faces {
    /// How many there are.
    pub count: usize,
    /// Position number of each corner; [`ABSENT`] where it cannot be in the file.
    pub positions: Vec<u32>,
    /// Texture coordinate number of each corner or [`ABSENT`]; empty while no corner has one.
    pub uvs: Vec<u32>,
    /// Normal number of each corner or [`ABSENT`]; empty while no corner has one.
    pub normals: Vec<u32>,
    /// Corners of each face; empty while all are triangles.
    corner_counts: Vec<u32>,
    /// For each face that was left out, how many of those that were kept come before it.
    left_out: Vec<usize>,
}

impl Faces {
    /// How many corners each face has.
    pub fn corner_counts(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.count).map(|face| self.corner_counts.get(face).map_or(3, |&count| count as usize))
    }

    /// For each face the number that it has among all of the file's, those that were left out among them; from 0.
    pub fn numbers_in_file(&self) -> impl Iterator<Item = usize> + '_ {
        let mut before = 0;
        (0..self.count).map(move |face| {
            before += self.left_out[before..].iter().take_while(|&&kept| kept <= face).count();
            face + before
        })
    }

    /// The number of triangles: a face of n corners gives n - 2.
    pub fn triangle_count(&self) -> usize {
        self.positions.len() - 2 * self.count
    }

    /// Ends the face whose corners are those from `start` on.
    fn end(&mut self, start: usize) {
        let corners = self.positions.len() - start;
        if corners != 3 && self.corner_counts.is_empty() {
            self.corner_counts.resize(self.count, 3);
        }
        if corners != 3 || !self.corner_counts.is_empty() {
            self.corner_counts.push(corners as u32);
        }
        self.count += 1;
    }
}

impl Parsed {
    /// Takes in one statement.
    ///
    /// # Errors
    /// A file's error, without path and line, for a number that cannot be read, too few of them, or an index of 0; a
    /// limit for more than 4294967294 of anything that is numbered.
    pub fn statement(&mut self, statement: Statement<'_>) -> Result<()> {
        let Statement { keyword, rest, line } = statement;
        match keyword {
            "v" => self.position(rest),
            "vt" => self.uv(rest),
            "vn" => self.normal(rest),
            "f" | "fo" => self.face(rest),
            "usemtl" => {
                self.use_material(rest);
                Ok(())
            }
            "mtllib" => {
                self.libraries.push((rest.to_owned(), line));
                Ok(())
            }
            _ => {
                self.leave_out(keyword);
                Ok(())
            }
        }
    }

    fn position(&mut self, rest: &str) -> Result<()> {
        let mut words = rest.split_ascii_whitespace();
        let position = DVec3::new(number(words.next())?, number(words.next())?, number(words.next())?);
        match words.count() {
            0 => {}
            1 | 2 => self.counts.weights += 1,
            _ => self.counts.colors += 1,
        }
        self.positions.push(position);
        check_count(self.positions.len())
    }

    fn uv(&mut self, rest: &str) -> Result<()> {
        let mut words = rest.split_ascii_whitespace();
        let u = number(words.next())? as f32;
        let v = words.next().map_or(Ok(0.0), |word| number(Some(word)))? as f32;
        let uv = Vec2::new(u, v);
        self.counts.uvs_not_finite += u64::from(!uv.is_finite());
        self.uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO });
        check_count(self.uvs.len())
    }

    fn normal(&mut self, rest: &str) -> Result<()> {
        let mut words = rest.split_ascii_whitespace();
        let mut next = || Ok(number(words.next())? as f32);
        let normal = Vec3::new(next()?, next()?, next()?);
        self.counts.normals_not_finite += u64::from(!normal.is_finite());
        // Zero means the face's normal: one bad normal must not spoil the mesh.
        self.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
        check_count(self.normals.len())
    }

    fn face(&mut self, rest: &str) -> Result<()> {
        let start = self.faces.positions.len();
        for word in rest.split_ascii_whitespace() {
            self.corner(word)?;
        }
        if self.faces.positions.len() - start < 3 {
            self.counts.small_faces += 1;
            self.faces.left_out.push(self.faces.count);
            self.faces.positions.truncate(start);
            self.faces.uvs.truncate(start);
            self.faces.normals.truncate(start);
            return Ok(());
        }
        self.faces.end(start);
        check_count(self.faces.positions.len())
    }

    /// One corner: `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &str) -> Result<()> {
        let malformed = || {
            let remedy = "write `v`, `v/vt`, `v//vn` or `v/vt/vn` with whole numbers";
            Error::file(format!("`{}` is not a corner of a face", short(word))).remedy(remedy)
        };
        let mut parts = word.split('/');
        let mut index = |count: usize| match parts.next() {
            None | Some("") => Ok(None),
            Some(part) => match part.parse::<i64>().map_err(|_| malformed())? {
                0 => Err(Error::file(format!("`{}` has the index 0", short(word)))
                    .remedy("indices count from 1; negative ones count back from the last")),
                index => Ok(Some(resolve(index, count))),
            },
        };
        let position = index(self.positions.len())?.ok_or_else(malformed)?;
        let uv = index(self.uvs.len())?;
        let normal = index(self.normals.len())?;
        if parts.next().is_some() {
            return Err(malformed());
        }
        let before = self.faces.positions.len();
        self.faces.positions.push(position);
        self.counts.attributes_outside += put(&mut self.faces.uvs, before, uv);
        self.counts.attributes_outside += put(&mut self.faces.normals, before, normal);
        Ok(())
    }

    fn use_material(&mut self, name: &str) {
        let position = match self.name_positions.get(name) {
            Some(&position) => position,
            None => {
                let position = self.material_names.len();
                self.material_names.push(name.to_owned());
                self.name_positions.insert(name.to_owned(), position);
                position
            }
        };
        let face = self.faces.count;
        match self.material_runs.last_mut() {
            Some(last) if last.0 == face => last.1 = position,
            _ => self.material_runs.push((face, position)),
        }
    }

    fn leave_out(&mut self, keyword: &str) {
        match self.unused.get_mut(keyword) {
            Some(count) => *count += 1,
            None => {
                let known = self.unused.len() < MOST_KEYWORDS;
                *self.unused.entry(if known { short(keyword) } else { String::new() }).or_default() += 1;
            }
        }
    }

    /// To be called when all statements are read: clears attribute numbers that are not in the file, and writes down
    /// what was left out or worked around.
    pub fn finish(&mut self, ledger: &mut Ledger) {
        // Numbers beyond the last can only be told now: a face may come before its vertices.
        for (numbers, count) in [(&mut self.faces.uvs, self.uvs.len()), (&mut self.faces.normals, self.normals.len())] {
            for number in numbers.iter_mut().filter(|number| **number != ABSENT && **number as usize >= count) {
                *number = ABSENT;
                self.counts.attributes_outside += 1;
            }
        }
        let mut note = |treatment, feature: &str, count| {
            if count > 0 {
                ledger.note(treatment, feature, count);
            }
        };
        let outside = self.faces.positions.iter().filter(|&&number| number as usize >= self.positions.len()).count();
        let huge = self.faces.corner_counts.iter().filter(|&&corners| corners as usize > MOST_CORNERS).count();
        note(Treatment::Honoured, "faces (f)", self.faces.count as u64);
        note(Treatment::Approximated, "face with more than 65536 corners: cut as if it were convex", huge as u64);
        note(Treatment::Ignored, "vertex colours (v with 6 numbers or more)", self.counts.colors);
        note(Treatment::Ignored, "vertex weights (v with 4 numbers)", self.counts.weights);
        note(Treatment::Warning, "face with fewer than 3 corners: left out", self.counts.small_faces);
        note(Treatment::Warning, "corner whose vertex is not in the file: its triangles are dropped", outside as u64);
        note(
            Treatment::Warning,
            "corner whose vt or vn is not in the file: it has none",
            self.counts.attributes_outside,
        );
        note(Treatment::Warning, "vn that is not finite: face normal used", self.counts.normals_not_finite);
        note(Treatment::Warning, "vt that is not finite: (0, 0) used", self.counts.uvs_not_finite);
        for (keyword, count) in std::mem::take(&mut self.unused) {
            ledger.note(Treatment::Ignored, describe(&keyword), count);
        }
    }
}

/// A statement that is not used, in words.
fn describe(keyword: &str) -> String {
    let what = match keyword {
        "" => return "other unknown statements".to_owned(),
        "p" => "points",
        "l" => "lines",
        "o" => "object names",
        "g" => "group names",
        "s" => "smoothing groups",
        "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim" | "hole" | "scrv"
        | "sp" | "end" | "con" | "ctech" | "stech" => "free-form curves and surfaces",
        "mg" | "bevel" | "c_interp" | "d_interp" | "lod" | "shadow_obj" | "trace_obj" | "maplib" | "usemap" => {
            "display attributes"
        }
        _ => "unknown statement",
    };
    format!("{what} ({keyword})")
}

/// A 0-based number from a 1-based or negative one, or [`ABSENT`] where it lies before the first or beyond all limits.
fn resolve(index: i64, count: usize) -> u32 {
    let number = if index > 0 { index - 1 } else { count as i64 + index };
    u32::try_from(number).unwrap_or(ABSENT)
}

/// Appends a corner's attribute to an array that is empty until the first corner has one; the count of bad numbers.
fn put(numbers: &mut Vec<u32>, corners_before: usize, number: Option<u32>) -> u64 {
    if numbers.is_empty() && number.is_some() {
        numbers.resize(corners_before, ABSENT);
    }
    if number.is_some() || !numbers.is_empty() {
        numbers.push(number.unwrap_or(ABSENT));
    }
    u64::from(number == Some(ABSENT))
}

/// A coordinate. What C libraries print for NaN and infinity is read too.
fn number(word: Option<&str>) -> Result<f64> {
    let word = word.ok_or_else(|| Error::file("a number is missing").remedy("v and vn have three, vt one to three"))?;
    word.parse().or_else(|_| {
        let unsigned = word.trim_start_matches(['-', '+']).to_ascii_lowercase();
        if unsigned.starts_with("nan(") || unsigned.contains(".#") {
            let infinite = unsigned.contains(".#inf");
            let magnitude = if infinite { f64::INFINITY } else { f64::NAN };
            return Ok(if word.starts_with('-') { -magnitude } else { magnitude });
        }
        Err(Error::file(format!("`{}` is not a number", short(word))).remedy("write it like 1.5 or -2e-3"))
    })
}

fn check_count(count: usize) -> Result<()> {
    if count >= ABSENT as usize {
        Err(Error::limit("the file has more than 4294967294 vertices or corners"))
    } else {
        Ok(())
    }
}

/// The beginning of a word that may be of any length, for messages.
fn short(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &word[..end]),
        None => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Parsed> {
        let mut parsed = Parsed::default();
        for (number, line) in text.lines().enumerate() {
            let (keyword, rest) = line.split_once(' ').unwrap_or((line, ""));
            parsed.statement(Statement { keyword, rest, line: number + 1 })?;
        }
        Ok(parsed)
    }

    fn message(text: &str) -> String {
        parse(text).err().expect(text).message().to_owned()
    }

    #[test]
    fn attributes_may_be_missing_here_and_there() {
        let parsed = parse("v 0 0 0\nvt 1\nvn 0 0 1\nf 1 1 1\nf 1/1 1//1 1/1/1\nf 1/ 1// 1 1").unwrap();
        assert_eq!(parsed.faces.positions, [0; 10]);
        let a = ABSENT;
        assert_eq!(parsed.faces.uvs, [a, a, a, 0, a, 0, a, a, a, a]);
        assert_eq!(parsed.faces.normals, [a, a, a, a, 0, 0, a, a, a, a]);
        assert_eq!(parsed.faces.corner_counts().collect::<Vec<_>>(), [3, 3, 4]);
        assert_eq!(parsed.faces.triangle_count(), 4);
        assert_eq!(parsed.uvs, [Vec2::new(1.0, 0.0)]);
    }

    #[test]
    fn negative_indices_count_back_from_where_they_stand() {
        let parsed = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 9 9 9\nf -3 -2 -1\nf -5 1 99").unwrap();
        assert_eq!(parsed.faces.positions, [0, 1, 2, 1, 2, 3, ABSENT, 0, 98]);
    }

    #[test]
    fn numbers_are_read_in_every_spelling() {
        let parsed = parse("v 1e-3 .5 -5.\nv nan(ind) -1.#INF 1.#QNAN\nv +1 1E+02 0.1 1 0.5 0.5").unwrap();
        assert_eq!(parsed.positions[0], DVec3::new(1e-3, 0.5, -5.0));
        assert!(parsed.positions[1].x.is_nan() && parsed.positions[1].z.is_nan());
        assert_eq!(parsed.positions[1].y, f64::NEG_INFINITY);
        assert_eq!(parsed.positions[2], DVec3::new(1.0, 100.0, 0.1));
        assert_eq!(parsed.counts.colors, 1);
    }

    #[test]
    fn what_cannot_be_read_is_an_error() {
        assert_eq!(message("v 0 0"), "a number is missing");
        assert_eq!(message("v 0,5 0 0"), "`0,5` is not a number");
        assert_eq!(message("vn 0 x 0"), "`x` is not a number");
        assert_eq!(message("f 1 2 0"), "`0` has the index 0");
        assert_eq!(message("f 1/0 2 3"), "`1/0` has the index 0");
        for corner in ["/1", "1/2/3/4", "1.5", "x", "99999999999999999999"] {
            assert_eq!(message(&format!("f 1 2 {corner}")), format!("`{corner}` is not a corner of a face"));
        }
        assert!(message(&format!("v {} 0 0", "é".repeat(100))).len() < 120);
    }

    #[test]
    fn faces_too_large_to_cut_well_are_in_the_ledger() {
        let mut ledger = Ledger::default();
        let parse = |corners| parse(&format!("v 0 0 0\nf{}", " 1".repeat(corners))).unwrap();
        parse(MOST_CORNERS).finish(&mut ledger);
        assert!(ledger.entries().all(|entry| entry.0 == Treatment::Honoured));
        parse(MOST_CORNERS + 1).finish(&mut ledger);
        let note = format!("face with more than {MOST_CORNERS} corners: cut as if it were convex");
        assert!(ledger.entries().any(|entry| entry == (Treatment::Approximated, note.as_str(), 1)));
    }

    #[test]
    fn everything_left_out_is_in_the_ledger() {
        let mut text = "p 1\nl 1 2\nl 2 3\ns 1\nf 1 2\ncurv 1 2 3\n".to_owned();
        (0..100).for_each(|i| text += &format!("word{i}\n"));
        let mut ledger = Ledger::default();
        parse(&text).unwrap().finish(&mut ledger);
        let entries: Vec<_> = ledger.entries().collect();
        assert!(entries.contains(&(Treatment::Ignored, "lines (l)", 2)));
        assert!(entries.contains(&(Treatment::Ignored, "points (p)", 1)));
        assert!(entries.contains(&(Treatment::Ignored, "free-form curves and surfaces (curv)", 1)));
        assert!(entries.contains(&(Treatment::Warning, "face with fewer than 3 corners: left out", 1)));
        assert!(entries.len() < MOST_KEYWORDS + 5);
        assert_eq!(entries.iter().map(|entry| entry.2).sum::<u64>(), 106);
    }
}
