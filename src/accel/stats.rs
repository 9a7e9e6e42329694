//! What a structure is made of, in numbers.

/// What a ray was compared with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tests {
    /// Boxes of nodes and of instances.
    pub boxes: u64,
    /// Triangles.
    pub triangles: u64,
}

/// Counts and sizes of an acceleration structure.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct TreeStats {
    /// Triangles (or boxes, at the top level) in the leaves.
    pub triangles: u64,
    /// Inner nodes.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Inner nodes on the longest way from the root to a leaf.
    pub max_depth: u32,
    /// Bytes of the inner nodes.
    pub node_bytes: u64,
    /// Bytes of the leaves' own copies of triangles and numbers.
    pub leaf_bytes: u64,
    /// Expected inner nodes plus triangles that a random line through the root's box meets (MacDonald and Booth 1990);
    /// the number of triangles where there is no tree.
    pub sah_cost: f64,
}
