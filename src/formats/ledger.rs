//! What a loader did with each feature of a file: nothing is skipped in silence.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What became of a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
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

/// Features met in a file, with counts, and the files that were read for it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Ledger {
    entries: BTreeMap<(Treatment, String), u64>,
    files: BTreeSet<PathBuf>,
}

impl Ledger {
    /// Adds `count` occurrences of a feature. The text is one line, such as "map_bump" or
    /// "material library `a.mtl` is missing: neutral material used".
    pub fn note(&mut self, treatment: Treatment, feature: impl Into<String>, count: u64) {
        *self.entries.entry((treatment, feature.into())).or_default() += count;
    }

    /// Records a file that is read, so that nothing is written over it.
    pub fn note_file(&mut self, path: &Path) {
        self.files.insert(path.to_path_buf());
    }

    /// All files that were read, once each, sorted.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(PathBuf::as_path)
    }

    /// Adds all of another ledger.
    pub fn merge(&mut self, other: Self) {
        self.files.extend(other.files);
        for ((treatment, feature), count) in other.entries {
            self.note(treatment, feature, count);
        }
    }

    /// All entries: treatment, feature, count; sorted.
    pub fn entries(&self) -> impl Iterator<Item = (Treatment, &str, u64)> {
        self.entries.iter().map(|((treatment, feature), &count)| (*treatment, feature.as_str(), count))
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
}
