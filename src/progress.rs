//! How long work reports how far it is, and learns that it should stop.

use crate::error::{Error, Result};

/// Receives progress and says when to stop. Called from many threads.
pub trait Progress: Sync {
    /// A stage begins ("load", "build", "render", ...) that has `total` steps; 0 if that is not known.
    fn begin(&self, stage: &'static str, total: u64) {
        let _ = (stage, total);
    }

    /// `steps` more of the current stage are done.
    fn advance(&self, steps: u64) {
        let _ = steps;
    }

    /// Whether the work should stop as soon as it can.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// An [`Error::cancelled`] if the work should stop.
    ///
    /// # Errors
    /// When [`is_cancelled`](Self::is_cancelled).
    fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::cancelled()) } else { Ok(()) }
    }
}

/// Reports nothing and never stops.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
