//! What a loader did with each feature of a file: nothing is skipped in silence.

use std::collections::BTreeMap;

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

/// Features met in a file, with counts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Ledger {
    entries: BTreeMap<(Treatment, String), u64>,
}

impl Ledger {
    /// Adds `count` occurrences of a feature. The text is one line, such as "map_bump" or
    /// "material library `a.mtl` is missing: neutral material used".
    pub fn note(&mut self, treatment: Treatment, feature: impl Into<String>, count: u64) {
        *self.entries.entry((treatment, feature.into())).or_default() += count;
    }

    /// Adds all of another ledger.
    pub fn merge(&mut self, other: Self) {
        for ((treatment, feature), count) in other.entries {
            self.note(treatment, feature, count);
        }
    }

    /// All entries: treatment, feature, count; sorted.
    pub fn entries(&self) -> impl Iterator<Item = (Treatment, &str, u64)> {
        self.entries.iter().map(|((treatment, feature), &count)| (*treatment, feature.as_str(), count))
    }
}
