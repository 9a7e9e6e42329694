//! Structures that are kept in a file.

use std::ops::Range;
use std::sync::Arc;

use crate::array::Mapping;
use crate::geometry::Bounds;

/// The arrays of a structure over one mesh as they lie in memory, to be written to a file.
#[derive(Debug, Clone, Copy)]
pub struct TreeArrays<'a> {
    /// The nodes.
    pub nodes: &'a [u8],
    /// The leaves.
    pub leaves: &'a [u8],
    /// What the root is called.
    pub root: u32,
    /// The box around what rays meet.
    pub bounds: Bounds,
}

/// The same in a mapped file.
#[derive(Debug, Clone)]
pub struct KeptTree {
    /// The file.
    pub mapping: Arc<Mapping>,
    /// Where in it the nodes are, in bytes.
    pub nodes: Range<usize>,
    /// Where in it the leaves are, in bytes.
    pub leaves: Range<usize>,
    /// What the root is called.
    pub root: u32,
    /// The box around what rays meet.
    pub bounds: Bounds,
}
