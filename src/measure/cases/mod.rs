//! The numerically hard cases: what each asks, of every structure, and what it found.
//!
//! A case makes rays whose answers are known (by construction, by a closed form or by the exact oracle), asks the
//! renderer, and counts what is wrong. Bars are fixed in the case; nothing is scaled to what was measured.

pub mod outcome;

use rayon::prelude::*;

pub use outcome::{Failure, Figure, Outcome};

use crate::accel::{Kind, Params, Preset};
use crate::error::Result;
use crate::math::random::Random;
use crate::progress::Progress;

/// A hard case.
pub struct Case {
    /// What it is called on the command line: `D1`, `D2`, ...
    pub id: &'static str,
    /// What it stands for, in a few words.
    pub title: &'static str,
    /// What must hold for it to pass, in words.
    pub bar: &'static str,
    /// Asks and counts.
    ///
    /// # Errors
    /// Only a cancellation, or a build that was refused; wrong answers are counted, not returned.
    pub run: fn(&Context<'_>) -> Result<Outcome>,
}

/// All cases, in their order.
pub const ALL: &[&[Case]] = &[];

/// How many rays a case may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effort {
    /// Seconds for all cases together, unoptimised: the form of `cargo test`.
    Quick,
    /// As many as the bars ask for.
    Full,
}

/// What a case is run with.
pub struct Context<'a> {
    /// How many rays.
    pub effort: Effort,
    /// The structures to ask.
    pub kinds: &'a [Kind],
    /// Where progress goes, and what says to stop.
    pub progress: &'a dyn Progress,
}

impl Context<'_> {
    /// One of two counts, by effort.
    pub fn count(&self, quick: u64, full: u64) -> u64 {
        match self.effort {
            Effort::Quick => quick,
            Effort::Full => full,
        }
    }

    /// Every structure with every preset that changes it; `linear` has none.
    pub fn params(&self) -> impl Iterator<Item = Params> + '_ {
        self.kinds.iter().flat_map(|&kind| {
            let presets = if kind == Kind::Linear { &Preset::ALL[..1] } else { Preset::ALL };
            presets.iter().map(move |&preset| Params { kind, preset })
        })
    }

    /// Runs `body` for 0 to `total` - 1 on all threads and adds up what it found, in order, whatever the threads.
    ///
    /// Each piece of the numbers draws from a stream of its own, which depends on `seed` and the piece alone.
    ///
    /// # Errors
    /// A cancellation.
    pub fn for_all(
        &self,
        seed: u64,
        total: u64,
        body: impl Fn(&mut Random, u64, &mut Outcome) + Sync,
    ) -> Result<Outcome> {
        // Long enough to pay for the bookkeeping, short enough to share among threads.
        const PIECE: u64 = 4096;
        (0..total.div_ceil(PIECE))
            .into_par_iter()
            .map(|piece| {
                self.progress.check()?;
                let mut random = Random::new(seed, piece);
                let mut outcome = Outcome::default();
                for number in piece * PIECE..((piece + 1) * PIECE).min(total) {
                    body(&mut random, number, &mut outcome);
                }
                Ok(outcome)
            })
            .try_reduce(Outcome::default, |a, b| Ok(a.and(b)))
    }
}

/// The case of that name, in upper or lower case.
pub fn find(id: &str) -> Option<&'static Case> {
    all().find(|case| case.id.eq_ignore_ascii_case(id))
}

/// All cases one after the other.
pub fn all() -> impl Iterator<Item = &'static Case> {
    ALL.iter().flat_map(|cases| cases.iter())
}
