//! Embree 4 (Wald et al. 2014), loaded when it is named: single rays fast and robust, and packets.
//!
//! Its answers are its own: it interpolates t otherwise, and misses where edges meet. Vertex and index buffers are shared with
//! it and not counted as its memory.

mod library;

pub use library::{EmbreeScene, Library};
