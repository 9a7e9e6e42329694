//! A limit on how much a file may unfold to.

use crate::error::{Error, Result};

/// Memory that a file may still take.
///
/// Meshes and instances may share arrays, so that a small file can name the same bytes over and over and unfold to
/// more than any machine has. Sane files reuse some; this stops the others before memory runs out.
#[derive(Debug)]
pub(super) struct Budget {
    left: u64,
}

impl Budget {
    /// What any file may take: 1 GiB.
    const FLOOR: u64 = 1 << 30;
    /// What a file may take for each of its bytes. Quantised vertices unfold 5 times, strips of byte indices 12 times;
    /// the rest is for arrays that are shared.
    const PER_BYTE: u64 = 256;

    /// The budget of a file whose buffers have this many bytes.
    pub fn new(file_bytes: u64) -> Self {
        Self { left: file_bytes.saturating_mul(Self::PER_BYTE).max(Self::FLOOR) }
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_ends() {
        let mut budget = Budget::new(0);
        assert!(budget.take::<u64>(1 << 27).is_ok());
        assert!(budget.take::<u8>(1).is_err());
        assert!(Budget::new(1 << 30).take::<u8>(1 << 37).is_ok());
        assert!(Budget::new(0).take::<u64>(usize::MAX).is_err());
    }
}
