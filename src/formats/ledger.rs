//! What a loader did with each feature of a file: nothing is skipped in silence.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What became of a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Treatment {
    /// Used as the format says.
    Honoured,
    /// Used, but not exactly as the format says.
    Approximated,
    /// Not used.
    Ignored,
    /// Something is wrong with the file; it was worked around.
    Warning,
}

/// What of a scene a feature belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub enum Scope {
    /// All triangles of a material, by its position in the list of materials.
    Material(u32),
    /// All triangles of a mesh, by its position in the list of meshes.
    Mesh(u32),
}

/// One feature, as it was met.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Entry {
    /// How often.
    pub count: u64,
    /// What it belongs to; nothing for what belongs to the file as a whole.
    pub scopes: BTreeSet<Scope>,
}

/// Features met in a file, with counts, and the files that were read for it.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Ledger {
    entries: BTreeMap<(Treatment, String), Entry>,
    files: BTreeSet<PathBuf>,
}

impl Ledger {
    /// Adds `count` occurrences of a feature. The text is one line, such as "map_bump" or
    /// "material library `a.mtl` is missing: neutral material used".
    pub fn note(&mut self, treatment: Treatment, feature: impl Into<String>, count: u64) {
        self.entries.entry((treatment, feature.into())).or_default().count += count;
    }

    /// Adds an occurrence of a feature that belongs to a material or a mesh.
    pub fn note_in(&mut self, treatment: Treatment, feature: impl Into<String>, scope: Scope) {
        let entry = self.entries.entry((treatment, feature.into())).or_default();
        entry.count += 1;
        entry.scopes.insert(scope);
    }

    /// Moves what features belong to, when a model's lists are appended to a scene's that have so many materials and meshes.
    pub fn shift(&mut self, materials: u32, meshes: u32) {
        for entry in self.entries.values_mut() {
            entry.scopes = entry
                .scopes
                .iter()
                .map(|scope| match scope {
                    Scope::Material(number) => Scope::Material(number + materials),
                    Scope::Mesh(number) => Scope::Mesh(number + meshes),
                })
                .collect();
        }
    }

    /// Records a file that is read, so that nothing is written over it.
    pub fn note_file(&mut self, path: &Path) {
        self.files.insert(path.to_path_buf());
    }

    /// What was read came from no file.
    pub fn forget_files(&mut self) {
        self.files.clear();
    }

    /// All files that were read, once each, sorted.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// Adds all of another ledger.
    pub fn merge(&mut self, other: Self) {
        self.files.extend(other.files);
        for (key, other) in other.entries {
            let entry = self.entries.entry(key).or_default();
            entry.count += other.count;
            entry.scopes.extend(other.scopes);
        }
    }

    /// All entries: treatment, feature, count; sorted.
    pub fn entries(&self) -> impl Iterator<Item = (Treatment, &str, u64)> {
        self.all().map(|(treatment, feature, entry)| (treatment, feature, entry.count))
    }

    /// The same with what they belong to.
    pub fn all(&self) -> impl Iterator<Item = (Treatment, &str, &Entry)> {
        self.entries.iter().map(|((treatment, feature), entry)| (*treatment, feature.as_str(), entry))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merging_adds_counts_and_joins_files() {
        let ledger = |count, file| {
            let mut ledger = Ledger::default();
            ledger.note(Treatment::Ignored, "map_bump", count);
            ledger.note_file(Path::new(file));
            ledger.note_file(Path::new("shared.png"));
            ledger
        };
        let mut all = ledger(2, "b.obj");
        all.merge(ledger(3, "a.obj"));
        assert_eq!(all.entries().collect::<Vec<_>>(), [(Treatment::Ignored, "map_bump", 5)]);
        assert_eq!(all.files().collect::<Vec<_>>(), ["a.obj", "b.obj", "shared.png"].map(Path::new));
    }

    #[test]
    fn scopes_move_with_the_lists_that_they_refer_to() {
        let mut ledger = Ledger::default();
        ledger.note_in(Treatment::Ignored, "a", Scope::Material(1));
        ledger.note_in(Treatment::Ignored, "a", Scope::Mesh(0));
        let mut other = ledger.clone();
        other.shift(10, 20);
        ledger.merge(other);
        let (_, _, entry) = ledger.all().next().unwrap();
        assert_eq!(entry.count, 4);
        let expected = [Scope::Material(1), Scope::Material(11), Scope::Mesh(0), Scope::Mesh(20)];
        assert_eq!(entry.scopes.iter().copied().collect::<Vec<_>>(), expected);
    }
}
