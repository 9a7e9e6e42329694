//! A limit on how much a file may unfold to.

use crate::error::{Error, Result};
use crate::formats::Limits;

/// Memory that a file may still take.
///
/// Meshes and instances may share arrays, so that a small file can name the same bytes over and over and unfold to
/// more than any machine has. Sane files reuse some; this stops the others before memory runs out.
#[derive(Debug)]
pub(super) struct Budget {
    left: u64,
    vertices: u64,
    limits: Limits,
}

impl Budget {
    /// What any file may take: 64 MiB, since trees take several times what meshes do.
    const FLOOR: u64 = 64 << 20;
    /// What a file may take for each of its bytes. Quantised vertices unfold 5 times, strips of byte indices 12 times;
    /// the rest is for arrays that are shared.
    const PER_BYTE: u64 = 256;

    /// The budget of a file whose buffers have this many bytes.
    pub fn new(file_bytes: u64, limits: Limits) -> Self {
        Self { left: file_bytes.saturating_mul(Self::PER_BYTE).max(Self::FLOOR), vertices: 0, limits }
    }

    /// Takes `count` items of type `T`.
    ///
    /// # Errors
    /// A limit once the budget is used up.
    pub fn take<T>(&mut self, count: usize) -> Result<()> {
        let bytes = (count as u64).saturating_mul(size_of::<T>() as u64);
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            Error::limit(format!("the file unfolds to more than {} times its size", Self::PER_BYTE))
                .remedy("share meshes between nodes instead of repeating them")
        })?;
        Ok(())
    }

    /// Takes the memory of `count` vertices of positions, normals and texture coordinates, and counts them.
    ///
    /// # Errors
    /// A limit once the budget is used up, or there are more vertices in all meshes together than may be.
    pub fn take_vertices(&mut self, count: usize) -> Result<()> {
        self.vertices = self.vertices.saturating_add(count as u64);
        self.limits.check_vertices(self.vertices)?;
        self.take::<[f32; 8]>(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_ends() {
        let budget = |bytes| Budget::new(bytes, Limits::default());
        let mut small = budget(0);
        assert!(small.take::<u64>(1 << 23).is_ok());
        assert!(small.take::<u8>(1).is_err());
        assert!(budget(1 << 30).take::<u8>(1 << 37).is_ok());
        assert!(budget(0).take::<u64>(usize::MAX).is_err());
    }

    #[test]
    fn vertices_of_all_meshes_are_counted() {
        let mut budget = Budget::new(0, Limits { vertices: 5, ..Limits::default() });
        assert!(budget.take_vertices(3).is_ok() && budget.take_vertices(2).is_ok());
        let error = budget.take_vertices(1).unwrap_err();
        assert!(error.to_string().ends_with("raise it with `--limit vertices=6`"), "{error}");
    }
}
