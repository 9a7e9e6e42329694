//! Material libraries: MTL files, cleaned line by line and then read by tobj.
//!
//! tobj gives up a whole file at the first value that it cannot read, without its line, and panics at a colour of
//! fewer than three numbers. It gets only statements that it can read and that are used here; all others are
//! written down with their lines.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::find_file::{absence, find_file};
use super::lines::{Lines, Statement};
use crate::error::{Error, Result};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Limits, Treatment};

/// The materials of all libraries that a file names.
#[derive(Default)]
pub(super) struct Libraries {
    /// By name; the first definition counts.
    definitions: HashMap<String, Definition>,
    /// Whether a library could not be found or read: then names that are not defined are no news.
    pub incomplete: bool,
}

/// What became of the statements of a material, in words.
pub(super) type Statements = Vec<(Treatment, String)>;

/// A material as a library defines it.
pub(super) struct Definition {
    /// What tobj made of its statements.
    pub source: tobj::Material,
    /// The folder that its images are relative to.
    pub folder: PathBuf,
    /// What became of each statement.
    pub statements: Statements,
}

impl Libraries {
    /// Reads the libraries that `mtllib` statements name, relative to the model's folder, each once. What is wrong with them
    /// becomes warnings: a picture in neutral colours is better than none.
    pub fn read(surroundings: &Surroundings, statements: &[(String, usize)], ledger: &mut Ledger) -> Self {
        let folder = &surroundings.folder;
        let mut libraries = Self::default();
        let mut known = HashSet::new();
        for (names, line) in statements {
            let names = names.replace("\\ ", " ");
            let whole = find_file(folder, &names, surroundings);
            let pieces = if whole.is_some() { vec![names.as_str()] } else { split_names(&names) };
            for name in pieces {
                let Some(path) = find_file(folder, name, surroundings) else {
                    let why = absence(folder, name, surroundings);
                    let warning = format!("material library `{name}` {why} (line {line}): neutral material used");
                    ledger.note(Treatment::Warning, warning, 1);
                    libraries.incomplete = true;
                    continue;
                };
                if !known.insert(path.clone()) {
                    continue;
                }
                if let Err(error) = libraries.read_file(&path, &surroundings.limits, ledger) {
                    ledger.note(Treatment::Warning, error.to_string(), 1);
                    libraries.incomplete = true;
                }
            }
        }
        libraries
    }

    /// The material of this name.
    pub fn get(&self, name: &str) -> Option<&Definition> {
        self.definitions.get(name)
    }

    fn read_file(&mut self, path: &Path, limits: &Limits, ledger: &mut Ledger) -> Result<()> {
        ledger.note_file(path);
        let system = |cause| Error::system(path, cause);
        let file = File::open(path).map_err(system)?;
        limits.check_file_bytes(file.metadata().map_err(system)?.len()).map_err(|error| error.at_path(path))?;
        let (text, statements) = clean(path, BufReader::new(file), ledger)?;
        let (materials, _) =
            tobj::load_mtl_buf(&mut text.as_bytes()).map_err(|cause| Error::file(cause.to_string()).at_path(path))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for (source, statements) in materials.into_iter().zip(statements) {
            let name = source.name.clone();
            let definition = || Definition { source, folder: folder.to_path_buf(), statements };
            self.definitions.entry(name).or_insert_with(definition);
        }
        Ok(())
    }
}

/// Several names in one statement: they end in `.mtl`, or else at white space.
fn split_names(names: &str) -> Vec<&str> {
    let lower = names.to_ascii_lowercase();
    let ends: Vec<usize> = lower
        .match_indices(".mtl")
        .map(|(at, end)| at + end.len())
        .filter(|&end| lower[end..].is_empty() || lower[end..].starts_with(|c: char| c.is_ascii_whitespace()))
        .collect();
    if ends.last() != Some(&names.len()) {
        return names.split_ascii_whitespace().collect();
    }
    let starts = std::iter::once(0).chain(ends.iter().copied());
    starts.zip(&ends).map(|(start, &end)| names[start..end].trim()).collect()
}

/// The statements that tobj shall read, each checked, in the spelling that it knows, and for each material what became of
/// its statements.
fn clean(path: &Path, reader: impl BufRead, ledger: &mut Ledger) -> Result<(String, Vec<Statements>)> {
    let mut lines = Lines::new(path, reader);
    let mut text = String::new();
    let mut materials: Vec<Statements> = Vec::new();
    while let Some(statement) = lines.read()? {
        let cleaned = clean_statement(statement);
        let outcome = match cleaned {
            Ok(Cleaned::Use("newmtl", name)) => {
                text += &format!("newmtl {name}\n");
                materials.push(Vec::new());
                continue;
            }
            Ok(_) if materials.is_empty() => Err(Error::file("a statement before the first newmtl")),
            Ok(Cleaned::Use(keyword, value)) => {
                text += &format!("{keyword} {value}\n");
                Ok((Treatment::Honoured, format!("MTL {keyword}")))
            }
            Ok(Cleaned::LeaveOut(feature)) => Ok((Treatment::Ignored, feature)),
            Err(error) => Err(error),
        };
        match (outcome, materials.last_mut()) {
            (Ok(note), Some(material)) => material.push(note),
            (Ok(_), None) => {}
            (Err(error), _) => {
                let error = error.at_path(path).at_line(statement.line);
                ledger.note(Treatment::Warning, format!("{error}: left out"), 1);
            }
        }
    }
    Ok((text, materials))
}

enum Cleaned {
    Use(&'static str, String),
    LeaveOut(String),
}

/// Statements that name an image, by their keyword in lower case, in the spelling in which they are read.
const MAPS: [(&str, &str); 9] = [
    ("map_kd", "map_Kd"),
    ("map_ks", "map_Ks"),
    ("map_ke", "map_Ke"),
    ("map_d", "map_d"),
    ("map_bump", "map_Bump"),
    ("bump", "map_Bump"),
    ("norm", "norm"),
    ("map_pr", "map_Pr"),
    ("map_pm", "map_Pm"),
];

fn clean_statement(Statement { keyword, rest, .. }: Statement<'_>) -> Result<Cleaned> {
    let number = |keyword, word: Option<&str>| Ok(Cleaned::Use(keyword, finite(word)?.to_string()));
    let first = rest.split_ascii_whitespace().next();
    let lower = keyword.to_ascii_lowercase();
    if let Some(&(_, map)) = MAPS.iter().find(|map| map.0 == lower) {
        return if rest.is_empty() {
            Err(Error::file(format!("{map} without a file")))
        } else {
            Ok(Cleaned::Use(map, rest.to_owned()))
        };
    }
    match lower.as_str() {
        "newmtl" if rest.is_empty() => Err(Error::file("a material without a name")),
        "newmtl" => Ok(Cleaned::Use("newmtl", rest.to_owned())),
        "kd" => color("Kd", rest),
        "ks" => color("Ks", rest),
        "ke" => color("Ke", rest),
        "tf" | "kt" => color("Tf", rest),
        "ns" => number("Ns", first),
        "ni" => number("Ni", first),
        "pr" => number("Pr", first),
        "pm" => number("Pm", first),
        // `d -halo 0.5`: the number comes last.
        "d" => number("d", rest.split_ascii_whitespace().next_back()),
        "tr" => number("Tr", first),
        "illum" => {
            let model = finite(first)?;
            if model.fract() != 0.0 || !(0.0..=10.0).contains(&model) {
                return Err(Error::file(format!("`{model}` is not an illumination model from 0 to 10")));
            }
            Ok(Cleaned::Use("illum", model.to_string()))
        }
        "ka" | "map_ka" => Ok(Cleaned::LeaveOut(format!("MTL {keyword}: ambient comes from the scene"))),
        "map_tr" => Ok(Cleaned::LeaveOut("MTL map_Tr: exporters disagree whether white is opaque; use map_d".into())),
        _ => Ok(Cleaned::LeaveOut(format!("MTL {}", keyword.chars().take(40).collect::<String>()))),
    }
}

/// A colour of three numbers, or of one for all channels.
fn color(keyword: &'static str, rest: &str) -> Result<Cleaned> {
    let words: Vec<&str> = rest.split_ascii_whitespace().take(4).collect();
    if let Some(kind @ ("spectral" | "xyz")) = words.first().copied() {
        return Ok(Cleaned::LeaveOut(format!("MTL {keyword} {kind}")));
    }
    let channel = |i: usize| Ok(finite(words.get(i).copied())?.max(0.0));
    let [r, g, b] = if words.len() == 1 { [channel(0)?; 3] } else { [channel(0)?, channel(1)?, channel(2)?] };
    Ok(Cleaned::Use(keyword, format!("{r} {g} {b}")))
}

/// A finite number, read in f64 and then rounded.
fn finite(word: Option<&str>) -> Result<f32> {
    let word = word.ok_or_else(|| Error::file("a number is missing"))?;
    let number = word.parse::<f64>().ok().map(|number| number as f32).filter(|number| number.is_finite());
    number.ok_or_else(|| Error::file(format!("`{}` is not a number", word.chars().take(40).collect::<String>())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Libraries, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.mtl"), text).unwrap();
        let mut ledger = Ledger::default();
        let libraries = Libraries::read(
            &Surroundings::new(folder.path(), &Default::default()),
            &[("a.mtl".into(), 1)],
            &mut ledger,
        );
        let ignored =
            |(treatment, text): &(Treatment, String)| (*treatment == Treatment::Ignored).then(|| text.clone());
        let of_a = libraries.get("a").into_iter().flat_map(|definition| &definition.statements).filter_map(ignored);
        let warnings = ledger.entries().map(|(_, feature, _)| feature.replace(folder.path().to_str().unwrap(), ""));
        let notes = of_a.chain(warnings).collect();
        (libraries, notes)
    }

    #[test]
    fn values_are_read_in_every_spelling() {
        let (libraries, notes) = read(
            "newmtl a b\r\n\tKD 1 0.5 .25 # c\r\nKs 0.5\nNs 1e2\nd -halo 0.5\nillum 7\nTf 1 0 0\nmap_kd -s 2 2 a b.png\n",
        );
        assert_eq!(notes, [""; 0]);
        let material = &libraries.get("a b").unwrap().source;
        assert_eq!(material.diffuse, Some([1.0, 0.5, 0.25]));
        assert_eq!(material.specular, Some([0.5; 3]));
        assert_eq!(material.shininess, Some(100.0));
        assert_eq!(material.dissolve, Some(0.5));
        assert_eq!(material.illumination_model, Some(7));
        assert_eq!(material.unknown_param["Tf"], "1 0 0");
        assert_eq!(material.diffuse_texture.as_deref(), Some("-s 2 2 a b.png"));
    }

    #[test]
    fn trouble_is_a_warning_with_its_line_and_the_rest_is_read() {
        let (libraries, notes) = read(
            "newmtl a\nKd 1 0\nKs x 0 0\nillum 2.5\nNs nan\nnewmtl\nmap_Kd\nKa 1 1 1\nPc 1\nKe spectral a 1\nmap_tr x\nKd 1 1 1",
        );
        assert_eq!(libraries.get("a").unwrap().source.diffuse, Some([1.0; 3]));
        assert_eq!(
            notes,
            [
                "MTL Ka: ambient comes from the scene",
                "MTL Pc",
                "MTL Ke spectral",
                "MTL map_Tr: exporters disagree whether white is opaque; use map_d",
                "/a.mtl:2: a number is missing: left out",
                "/a.mtl:3: `x` is not a number: left out",
                "/a.mtl:4: `2.5` is not an illumination model from 0 to 10: left out",
                "/a.mtl:5: `nan` is not a number: left out",
                "/a.mtl:6: a material without a name: left out",
                "/a.mtl:7: map_Kd without a file: left out",
            ]
        );
    }

    #[test]
    fn statements_before_the_first_material_are_warned_of() {
        let (libraries, notes) = read("Kd 1 1 1\nnewmtl a\nKd 0.1 0.2 0.3\n");
        assert_eq!(notes, ["/a.mtl:1: a statement before the first newmtl: left out"]);
        // 0.1 as the nearest f32 to the f64, which is what the f32 reader of tobj gives as well.
        assert_eq!(libraries.get("a").unwrap().source.diffuse, Some([0.1, 0.2, 0.3]));
    }

    #[test]
    fn a_statement_may_name_several_libraries() {
        assert_eq!(split_names("a b.mtl c.MTL"), ["a b.mtl", "c.MTL"]);
        assert_eq!(split_names("a b.txt"), ["a", "b.txt"]);
        assert_eq!(split_names("a.mtl.mtl"), ["a.mtl.mtl"]);
        assert!(split_names("").is_empty());
    }

    #[test]
    fn the_first_definition_counts() {
        let (libraries, _) = read("newmtl a\nKd 1 1 1\nnewmtl a\nKd 0 0 0\n");
        assert_eq!(libraries.get("a").unwrap().source.diffuse, Some([1.0; 3]));
    }
}
