//! Speed against error: what a row of a sweep says, and which rows are dominated.

use crate::measure::statistics::{Median, rate_interval};

/// A counted error with its exact 95 % interval (Clopper and Pearson 1934); where none was counted, the one-sided bound.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Rate {
    /// Answers that are wrong.
    pub wrong: u64,
    /// Answers checked.
    pub total: u64,
    /// Wrong answers in 1e9.
    pub per_1e9: f64,
    /// Lower end of the interval, in 1e9.
    pub low: f64,
    /// Upper end of the interval, in 1e9.
    pub high: f64,
}

impl Rate {
    /// The rate of `wrong` in `total`.
    pub fn new(wrong: u64, total: u64) -> Self {
        let (low, high) = rate_interval(wrong, total);
        let per_1e9 = if total == 0 { f64::NAN } else { wrong as f64 / total as f64 * 1e9 };
        Self { wrong, total, per_1e9, low: low * 1e9, high: high * 1e9 }
    }
}

impl std::fmt::Display for Rate {
    /// `1.2e5 (0.9e5 to 1.6e5; 12 of 100000)`, or `0 (below 3.0e4; 0 of 100000)`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { wrong, total, per_1e9, low, high } = *self;
        if total == 0 {
            write!(f, "not measured")
        } else if wrong == 0 {
            write!(f, "0 (below {high:.1e}; 0 of {total})")
        } else {
            write!(f, "{per_1e9:.1e} ({low:.1e} to {high:.1e}; {wrong} of {total})")
        }
    }
}

/// Where an error certainly lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// At least this.
    pub low: f64,
    /// At most this.
    pub high: f64,
}

impl Range {
    /// The interval that is printed with a rate.
    pub fn of_rate(rate: &Rate) -> Self {
        Self { low: rate.low, high: rate.high }
    }

    /// A number that is known.
    pub fn exactly(error: f64) -> Self {
        Self { low: error, high: error }
    }
}

/// What one choice costs and what it gets wrong: numbers that are never made one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Larger is better.
    pub speed: Median,
    /// Two kinds of errors, the same twice where there is but one; smaller is better.
    pub errors: [Range; 2],
}

impl Cost {
    /// What takes some time each; the shorter the better. Times that were not measured are all alike.
    pub fn of_time(time: Option<Median>, errors: [Range; 2]) -> Self {
        let rate = |seconds: f64| 1.0 / seconds;
        let untimed = Median { value: 0.0, low: 0.0, high: 0.0 };
        let speed =
            time.map_or(untimed, |time| Median { value: rate(time.value), low: rate(time.high), high: rate(time.low) });
        Self { speed, errors }
    }
}

/// Which choices are dominated: another one is no worse in speed and in both kinds of errors, and better in one of them.
///
/// What has overlapping intervals is equal, speeds and errors alike, so that noise dominates nobody. NaN errors dominate
/// nothing and are dominated by every other choice that is no slower.
pub fn dominated(costs: &[Cost]) -> Vec<bool> {
    let faster = |a: &Cost, b: &Cost| a.speed.low > b.speed.high;
    let unknown = |error: &Range| error.low.is_nan() || error.high.is_nan();
    let smaller = |a: &Range, b: &Range| a.high < b.low || (unknown(b) && !unknown(a));
    let beats = |a: &Cost, b: &Cost| {
        let kinds = || a.errors.iter().zip(&b.errors);
        let no_less_right = kinds().all(|(a, b)| !unknown(a) && !smaller(b, a));
        let more_right = kinds().any(|(a, b)| smaller(a, b));
        no_less_right && !faster(b, a) && (more_right || faster(a, b))
    };
    costs.iter().map(|own| costs.iter().any(|other| beats(other, own))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(speed: f64, error: f64) -> Cost {
        Cost {
            speed: Median { value: speed, low: speed * 0.95, high: speed * 1.05 },
            errors: [Range::exactly(error); 2],
        }
    }

    #[test]
    fn slower_and_less_right_is_dominated() {
        let costs = [cost(4.0, 9.0), cost(2.0, 0.0), cost(1.0, 0.0), cost(2.05, 5.0), cost(3.0, f64::NAN)];
        assert_eq!(dominated(&costs), [false, false, true, true, true]);
    }

    #[test]
    fn equal_choices_do_not_dominate_each_other() {
        assert_eq!(dominated(&[cost(2.0, 1.0), cost(2.01, 1.0)]), [false, false]);
        assert_eq!(dominated(&[]), [] as [bool; 0]);
    }

    #[test]
    fn errors_that_cannot_be_told_apart_are_equal_and_kinds_are_not_added() {
        let counted = |speed: f64, wrong: [u64; 2]| Cost {
            errors: wrong.map(|wrong| Range::of_rate(&Rate::new(wrong, 50_000))),
            ..cost(speed, 0.0)
        };
        // One in 50,000 may be none in the next; ten more misses are not made good by ten fewer false hits.
        assert_eq!(dominated(&[counted(1.0, [0, 0]), counted(1.0, [1, 0])]), [false, false]);
        assert_eq!(dominated(&[counted(1.0, [0, 0]), counted(1.0, [10, 0])]), [false, true]);
        assert_eq!(dominated(&[counted(1.0, [0, 20]), counted(2.0, [20, 0])]), [false, false]);
    }

    #[test]
    fn rates_print_what_they_were_counted_from() {
        assert_eq!(Rate::new(0, 100_000).to_string(), "0 (below 3.0e4; 0 of 100000)");
        assert_eq!(Rate::new(0, 0).to_string(), "not measured");
        assert_eq!(Rate::new(2, 10).to_string(), "2.0e8 (2.5e7 to 5.6e8; 2 of 10)");
    }
}
