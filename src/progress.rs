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

/// Some of the current stage's steps, reported piece by piece by work that knows only roughly how far it is.
pub struct Share<'a> {
    progress: &'a dyn Progress,
    steps: u64,
    reported: u64,
}

impl<'a> Share<'a> {
    /// `steps` of the stage, none of them done.
    pub fn new(progress: &'a dyn Progress, steps: u64) -> Self {
        Self { progress, steps, reported: 0 }
    }

    /// Reports that `percent` of the share, at most 100, are done. All steps are reported once 100 is reached.
    ///
    /// # Errors
    /// When the work should stop.
    pub fn reach(&mut self, percent: u32) -> Result<()> {
        self.progress.check()?;
        let reached = (u128::from(self.steps) * u128::from(percent.min(100)) / 100) as u64;
        if reached > self.reported {
            self.progress.advance(reached - self.reported);
            self.reported = reached;
        }
        Ok(())
    }
}

/// Reports nothing and never stops.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {}
