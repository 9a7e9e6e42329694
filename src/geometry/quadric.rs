//! Quadric surfaces.
/// Placeholder.
#[derive(Debug, Clone)]
pub struct Quadric;
