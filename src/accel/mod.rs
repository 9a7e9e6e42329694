//! Acceleration structures: obvhs builds the trees; box test, triangle test and traversal are ours.

/// Which acceleration structure to use for triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The fastest one.
    #[default]
    Auto,
    /// Every triangle, no tree: the reference.
    Linear,
    /// Binary tree.
    Bvh2,
    /// Compressed 8-wide tree.
    CwBvh,
}

/// How much time a build may take for faster rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Quickest build, slower rays.
    Fast,
    /// Between the two.
    #[default]
    Balanced,
    /// Slowest build, fastest rays.
    Best,
}

/// How to build acceleration structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Params {
    /// Which structure.
    pub kind: Kind,
    /// How much time the build may take.
    pub preset: Preset,
}
