//! Timing that can be compared: interleaved repetitions, one clock, medians with intervals.

use std::time::Instant;

use crate::error::Result;
use crate::measure::statistics::{Median, median};
use crate::progress::Progress;

/// The fewest repetitions of which a median with an interval is worth printing.
pub const FEWEST_REPETITIONS: u32 = 10;

/// Runs every piece of work `repetitions` times and gives the seconds of one run, piece by piece.
///
/// The pieces take turns, forward and then backward (A B C C B A ...), so that a machine which gets slower in the
/// meantime, or whose clock rises, does so for all of them alike. One round before the first is not counted: it fills
/// caches and lets branch predictors learn. Advances by one step a run, that round included.
///
/// # Errors
/// A cancellation.
pub fn interleaved(pieces: &mut [&mut dyn FnMut()], repetitions: u32, progress: &dyn Progress) -> Result<Vec<Median>> {
    let mut seconds = vec![Vec::with_capacity(repetitions as usize); pieces.len()];
    for round in 0..=repetitions {
        for turn in 0..pieces.len() {
            let number = if round % 2 == 0 { turn } else { pieces.len() - 1 - turn };
            progress.check()?;
            let start = Instant::now();
            pieces[number]();
            let taken = start.elapsed().as_secs_f64();
            if round > 0 {
                seconds[number].push(taken);
            }
            progress.advance(1);
        }
    }
    Ok(seconds.iter().map(|taken| median(taken)).collect())
}

/// A rate in millions a second from the seconds that `count` took; the interval's ends change places.
pub fn millions_per_second(count: usize, seconds: Median) -> Median {
    let rate = |seconds: f64| count as f64 / 1e6 / seconds.max(f64::MIN_POSITIVE);
    Median { value: rate(seconds.value), low: rate(seconds.high), high: rate(seconds.low) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use std::cell::RefCell;

    #[test]
    fn pieces_take_turns_forward_and_backward() {
        let order = RefCell::new(String::new());
        let mut a = || order.borrow_mut().push('a');
        let mut b = || order.borrow_mut().push('b');
        let found = interleaved(&mut [&mut a, &mut b], 3, &Silent).unwrap();
        assert_eq!(order.into_inner(), "abbaabba");
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|m| m.low <= m.value && m.value <= m.high));
    }

    #[test]
    fn longer_work_takes_longer_and_rates_turn_the_interval() {
        let spin = |rounds: u64| (0..rounds).fold(0u64, |sum, i| std::hint::black_box(sum ^ i));
        let mut short = || {
            std::hint::black_box(spin(20_000));
        };
        let mut long = || {
            std::hint::black_box(spin(400_000));
        };
        let found = interleaved(&mut [&mut short, &mut long], FEWEST_REPETITIONS, &Silent).unwrap();
        assert!(found[1].value > 4.0 * found[0].value, "{found:?}");
        let rate = millions_per_second(1_000_000, Median { value: 0.5, low: 0.25, high: 1.0 });
        assert_eq!((rate.value, rate.low, rate.high), (2.0, 1.0, 4.0));
    }
}
