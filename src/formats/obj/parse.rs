//! The geometry statements of an OBJ file, as flat arrays in the order of the file.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec3, Vec2, Vec3};

use super::faces::Faces;
use super::lines::Statement;
use super::names::Names;
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
    /// The colours of `v` statements, as they are; empty while none has one, NaN for one without.
    pub colors: Vec<[f32; 3]>,
    /// `vt`.
    pub uvs: Vec<Vec2>,
    /// `vn`, as they are.
    pub normals: Vec<Vec3>,
    /// `f`.
    pub faces: Faces,
    /// Names of objects and groups.
    pub names: Names,
    /// The names that `usemtl` gave, each once.
    pub material_names: Vec<String>,
    /// Where the material changes: the face's number and the position of the material's name.
    pub material_runs: Vec<(usize, usize)>,
    /// Where the smoothing group changes: the face's number and the group, 0 for none; empty without `s` statements.
    pub smoothing_runs: Vec<(usize, u32)>,
    /// The rest of each `mtllib` and its line.
    pub libraries: Vec<(String, usize)>,
    /// Whether corners have no normals, whatever the file says.
    without_normals: bool,
    name_positions: HashMap<String, usize>,
    unused: BTreeMap<String, u64>,
    counts: Counts,
    /// The corners of the face being read: numbers of position, texture coordinate and normal.
    corners: Vec<[u32; 3]>,
}

/// How often something was worked around or left out within a statement.
#[derive(Default)]
struct Counts {
    weights: u64,
    further_numbers: u64,
    small_faces: u64,
    attributes_outside: u64,
    normals_not_finite: u64,
    uvs_not_finite: u64,
    smoothing: u64,
    smoothing_unknown: u64,
}

impl Parsed {
    /// Nothing yet; normals of corners will be passed over.
    pub fn without_normals() -> Self {
        Self { without_normals: true, ..Self::default() }
    }

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
            "s" => {
                self.smoothing_group(rest);
                Ok(())
            }
            "o" => {
                self.names.object(rest, self.faces.count());
                Ok(())
            }
            "g" => {
                self.names.group(rest, self.faces.count());
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
        self.positions.push(position);
        check_count(self.positions.len())?;
        let Some(first) = words.next() else {
            if !self.colors.is_empty() {
                self.colors.push([f32::NAN; 3]);
            }
            return Ok(());
        };
        self.after_position(first, words)
    }

    /// What stands in a `v` statement after the coordinates: a weight, a colour, or more.
    fn after_position<'a>(&mut self, first: &str, mut words: impl Iterator<Item = &'a str>) -> Result<()> {
        let mut color = None;
        match (words.next(), words.next(), words.next()) {
            (Some(second), Some(third), None) => {
                let value = |word: &str| word.parse::<f64>().map_or(f32::NAN, |value| value as f32);
                color = Some([first, second, third].map(value));
            }
            (_, None, _) => self.counts.weights += 1,
            _ => self.counts.further_numbers += 1,
        }
        if color.is_some() && self.colors.is_empty() {
            self.colors.resize(self.positions.len() - 1, [f32::NAN; 3]);
        }
        if color.is_some() || !self.colors.is_empty() {
            self.colors.push(color.unwrap_or([f32::NAN; 3]));
        }
        Ok(())
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
        // Zero means none: one bad normal must not spoil the mesh.
        self.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
        check_count(self.normals.len())
    }

    fn face(&mut self, rest: &str) -> Result<()> {
        self.corners.clear();
        for word in rest.split_ascii_whitespace() {
            self.corner(word)?;
        }
        if self.corners.len() < 3 {
            self.counts.small_faces += 1;
            self.faces.leave_out();
            return Ok(());
        }
        self.faces.push(&self.corners, self.positions.len());
        check_count(self.faces.corner_count())
    }

    /// One corner: `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &str) -> Result<()> {
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let indices = plain_indices(word).map_or_else(|| careful_indices(word), Ok)?;
        let mut corner = [ABSENT; 3];
        for part in (0..3).filter(|&part| indices[part] != 0) {
            corner[part] = resolve(indices[part], counts[part]);
            self.counts.attributes_outside += u64::from(part > 0 && corner[part] == ABSENT);
        }
        if self.without_normals {
            corner[2] = ABSENT;
        }
        self.corners.push(corner);
        Ok(())
    }

    /// `s`: the group in which the faces that follow are smooth; `off` and 0 for none.
    fn smoothing_group(&mut self, rest: &str) {
        self.counts.smoothing += 1;
        let group = match rest {
            "off" | "" => 0,
            "on" => 1,
            word => word.parse().unwrap_or_else(|_| {
                self.counts.smoothing_unknown += 1;
                0
            }),
        };
        let face = self.faces.count();
        match self.smoothing_runs.last_mut() {
            Some(last) if last.0 == face => last.1 = group,
            _ => self.smoothing_runs.push((face, group)),
        }
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
        let face = self.faces.count();
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
        self.counts.attributes_outside += self.faces.clear_outside(self.uvs.len(), self.normals.len());
        let mut note = |treatment, feature: &str, count| {
            if count > 0 {
                ledger.note(treatment, feature, count);
            }
        };
        let outside = self.faces.positions().filter(|&number| number as usize >= self.positions.len()).count();
        let huge = self.faces.corner_counts().filter(|&corners| corners > MOST_CORNERS).count();
        let counts = &self.counts;
        note(Treatment::Honoured, "faces (f)", self.faces.count() as u64);
        note(Treatment::Approximated, "face with more than 65536 corners: cut as if it were convex", huge as u64);
        note(Treatment::Ignored, "numbers after the colour (v with 7 numbers or more)", counts.further_numbers);
        note(Treatment::Ignored, "vertex weights (v with 4 numbers)", counts.weights);
        if self.without_normals {
            note(Treatment::Ignored, "smoothing groups (s): --normals says otherwise", counts.smoothing);
        } else {
            note(Treatment::Honoured, "smoothing groups (s)", counts.smoothing);
            note(Treatment::Warning, "smoothing group that is not a number: flat", counts.smoothing_unknown);
        }
        note(Treatment::Honoured, "object names (o)", self.names.objects);
        note(Treatment::Honoured, "group names (g)", self.names.groups);
        note(Treatment::Warning, "face with fewer than 3 corners: left out", counts.small_faces);
        note(Treatment::Warning, "corner whose vertex is not in the file: its triangles are dropped", outside as u64);
        note(Treatment::Warning, "corner whose vt or vn is not in the file: it has none", counts.attributes_outside);
        note(Treatment::Warning, "vn that is not finite: as if there were none", counts.normals_not_finite);
        note(Treatment::Warning, "vt that is not finite: (0, 0) used", counts.uvs_not_finite);
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

/// The indices of a corner, 0 for what is not there, where they are written as nearly all are: `None` for anything else.
fn plain_indices(word: &str) -> Option<[i64; 3]> {
    let (mut indices, mut part) = ([0i64; 3], 0);
    let (mut digits, mut sign) = (0, 1);
    for &byte in word.as_bytes() {
        match byte {
            b'0'..=b'9' if digits < 18 => {
                indices[part] = 10 * indices[part] + i64::from(byte - b'0');
                digits += 1;
            }
            b'-' if digits == 0 && sign == 1 => sign = -1,
            b'/' if part < 2 && (digits > 0) == (indices[part] != 0) && (digits > 0 || sign == 1) => {
                indices[part] *= sign;
                (part, digits, sign) = (part + 1, 0, 1);
            }
            _ => return None,
        }
    }
    let is_whole = (digits > 0) == (indices[part] != 0) && (digits > 0 || sign == 1);
    indices[part] *= sign;
    (is_whole && indices[0] != 0).then_some(indices)
}

/// The same for any spelling.
///
/// # Errors
/// A file's error for what is no corner, and for an index of 0.
fn careful_indices(word: &str) -> Result<[i64; 3]> {
    let mut indices = [0; 3];
    let mut parts = word.split('/');
    for (number, index) in indices.iter_mut().enumerate() {
        *index = match parts.next() {
            None | Some("") if number == 0 => return Err(malformed(word)),
            None | Some("") => continue,
            Some(part) => part.parse().map_err(|_| malformed(word))?,
        };
        if *index == 0 {
            return Err(Error::file(format!("`{}` has the index 0", short(word)))
                .remedy("indices count from 1; negative ones count back from the last"));
        }
    }
    if parts.next().is_some() { Err(malformed(word)) } else { Ok(indices) }
}

/// A corner that cannot be read.
#[cold]
fn malformed(word: &str) -> Error {
    let remedy = "write `v`, `v/vt`, `v//vn` or `v/vt/vn` with whole numbers";
    Error::file(format!("`{}` is not a corner of a face", short(word))).remedy(remedy)
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
        let a = ABSENT;
        let corners: Vec<_> = (0..10).map(|corner| parsed.faces.corner(corner)).collect();
        let pairs = [[a, a], [a, a], [a, a], [0, a], [a, 0], [0, 0], [a, a], [a, a], [a, a], [a, a]];
        assert_eq!(corners, pairs.map(|[uv, normal]| [0, uv, normal]));
        assert_eq!(parsed.faces.corner_counts().collect::<Vec<_>>(), [3, 3, 4]);
        assert_eq!(parsed.faces.triangle_count(), 4);
        assert_eq!(parsed.uvs, [Vec2::new(1.0, 0.0)]);
    }

    #[test]
    fn both_readers_of_corners_agree() {
        let words =
            ["1", "1/2", "1//3", "1/2/3", "-1/-22/-333", "1/", "1//", "123456789012345678/1", "/1", "1/2/3/4", "1/0"];
        let odd =
            ["0", "-0", "1/-", "-", "", "/", "--1", "1-2", "1.5", "x", "1/x", "1/2/-0", "1234567890123456789", "+1"];
        for word in words.into_iter().chain(odd) {
            if let Some(plain) = plain_indices(word) {
                assert_eq!(careful_indices(word).unwrap(), plain, "{word}");
            }
        }
        assert!(words[..8].iter().all(|word| plain_indices(word).is_some()));
        assert!(odd.iter().all(|word| plain_indices(word).is_none()));
        assert_eq!(careful_indices("+1/1234567890123456789").unwrap(), [1, 1_234_567_890_123_456_789, 0]);
    }

    #[test]
    fn negative_indices_count_back_from_where_they_stand() {
        let parsed = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 9 9 9\nf -3 -2 -1\nf -5 1 99").unwrap();
        assert_eq!(parsed.faces.positions().collect::<Vec<_>>(), [0, 1, 2, 1, 2, 3, ABSENT, 0, 98]);
    }

    #[test]
    fn numbers_are_read_in_every_spelling() {
        let parsed = parse("v 1e-3 .5 -5.\nv nan(ind) -1.#INF 1.#QNAN\nv +1 1E+02 0.1 1 0.5 0.5").unwrap();
        assert_eq!(parsed.positions[0], DVec3::new(1e-3, 0.5, -5.0));
        assert!(parsed.positions[1].x.is_nan() && parsed.positions[1].z.is_nan());
        assert_eq!(parsed.positions[1].y, f64::NEG_INFINITY);
        assert_eq!(parsed.positions[2], DVec3::new(1.0, 100.0, 0.1));
        assert_eq!(parsed.colors.len(), 3);
        assert!(parsed.colors[0][0].is_nan() && parsed.colors[2] == [1.0, 0.5, 0.5]);
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
        let mut text = "p 1\nl 1 2\nl 2 3\nbevel on\nf 1 2\ncurv 1 2 3\nv 0 0 0 1\nfo 1 1 1\n".to_owned();
        (0..100).for_each(|i| text += &format!("word{i}\n"));
        let mut ledger = Ledger::default();
        parse(&text).unwrap().finish(&mut ledger);
        let entries: Vec<_> = ledger.entries().collect();
        assert!(entries.contains(&(Treatment::Ignored, "lines (l)", 2)));
        assert!(entries.contains(&(Treatment::Ignored, "points (p)", 1)));
        assert!(entries.contains(&(Treatment::Ignored, "display attributes (bevel)", 1)));
        assert!(entries.contains(&(Treatment::Ignored, "vertex weights (v with 4 numbers)", 1)));
        assert!(entries.contains(&(Treatment::Honoured, "faces (f)", 1)));
        assert!(entries.contains(&(Treatment::Ignored, "free-form curves and surfaces (curv)", 1)));
        assert!(entries.contains(&(Treatment::Warning, "face with fewer than 3 corners: left out", 1)));
        assert!(entries.len() < MOST_KEYWORDS + 7);
        assert_eq!(entries.iter().map(|entry| entry.2).sum::<u64>(), 108);
    }
}
