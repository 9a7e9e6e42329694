//! What counted errors and timed repeats say: exact bounds on rates, quantiles, medians with intervals.

use crate::math::random::Random;

/// The upper end of the one-sided 95 % interval of a rate of which `wrong` cases in `total` were seen (Clopper and
/// Pearson 1934): about 3 / total where none was. 1 if nothing was tried.
pub fn rate_bound(wrong: u64, total: u64) -> f64 {
    upper_bound(wrong, total, 0.05)
}

/// The 95 % interval of a rate (Clopper and Pearson 1934): two-sided; where none was wrong, from 0 to the one-sided
/// [`rate_bound`].
pub fn rate_interval(wrong: u64, total: u64) -> (f64, f64) {
    if wrong == 0 {
        return (0.0, rate_bound(0, total));
    }
    (1.0 - upper_bound(total - wrong, total, 0.025), upper_bound(wrong, total, 0.025))
}

/// The rate at which seeing `wrong` or fewer has probability `tail`.
fn upper_bound(wrong: u64, total: u64, tail: f64) -> f64 {
    if wrong >= total {
        return 1.0;
    }
    if wrong == 0 {
        // (1 - p)^n = tail.
        return -libm::expm1(libm::log(tail) / total as f64);
    }
    // P(X <= k) = I_{1-p}(n - k, k + 1) falls as p rises: bisect.
    let (mut low, mut high) = (wrong as f64 / total as f64, 1.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        let at_most = incomplete_beta((total - wrong) as f64, wrong as f64 + 1.0, 1.0 - middle, middle);
        if at_most > tail { low = middle } else { high = middle }
    }
    high
}

/// The regularised incomplete beta function I_x(a, b), given x and 1 - x (continued fraction by Lentz's method).
fn incomplete_beta(a: f64, b: f64, x: f64, one_minus_x: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    if one_minus_x <= 0.0 {
        return 1.0;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(b, a, one_minus_x, x);
    }
    let log_front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * libm::log(x) + b * libm::log1p(-x);
    const TINY: f64 = 1e-300;
    let nonzero = |v: f64| if v.abs() < TINY { TINY } else { v };
    let (mut c, mut d) = (1.0, 1.0 / nonzero(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for step in 1..100_000u32 {
        let m = f64::from(step);
        for term in [
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0)),
        ] {
            d = 1.0 / nonzero(1.0 + term * d);
            c = nonzero(1.0 + term / c);
            fraction *= d * c;
        }
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    libm::exp(log_front) * fraction / a
}

/// The value below which a share `q` of the values lies: the smallest value of rank at least `q n`. NaN if there are
/// none. Sorts the values; NaN counts as largest.
pub fn quantile(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_by(f64::total_cmp);
    let rank = (q * values.len() as f64).ceil() as usize;
    values[rank.clamp(1, values.len()) - 1]
}

/// A median and the ends of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Median {
    /// The median itself.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Median {
    /// In another unit: everything times a number above 0.
    pub fn times(self, factor: f64) -> Self {
        Self { value: self.value * factor, low: self.low * factor, high: self.high * factor }
    }
}

/// The median of repeated measurements with its bootstrap interval (Efron 1979; 1000 resamples, percentiles).
pub fn median(values: &[f64]) -> Median {
    let middle = |values: &mut [f64]| {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
    };
    let mut own = values.to_vec();
    let value = middle(&mut own);
    if values.len() < 2 {
        return Median { value, low: value, high: value };
    }
    let mut random = Random::new(0x6d65_6469, 0);
    let mut resampled: Vec<f64> = (0..1000)
        .map(|_| {
            for slot in &mut own {
                *slot = values[random.below(values.len() as u64) as usize];
            }
            middle(&mut own)
        })
        .collect();
    Median { value, low: quantile(&mut resampled, 0.025), high: quantile(&mut resampled, 0.975) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_agree_with_tables() {
        // Rule of three, and values of the Clopper-Pearson interval for small n from binomial sums.
        assert!((rate_bound(0, 100_000_000) * 1e8 - 2.9957).abs() < 1e-3);
        assert_eq!(rate_bound(5, 5), 1.0);
        assert_eq!(rate_bound(0, 0), 1.0);
        for (k, n) in [(1u64, 10u64), (3, 20), (50, 100), (90, 100), (7, 5000)] {
            let at_most = |p: f64| {
                let mut term = libm::pow(1.0 - p, n as f64);
                let mut sum = term;
                for i in 0..k {
                    term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
                    sum += term;
                }
                sum
            };
            let bound = rate_bound(k, n);
            assert!((at_most(bound) - 0.05).abs() < 1e-9, "{k} of {n}: {bound}");
            let (low, high) = rate_interval(k, n);
            assert!((at_most(high) - 0.025).abs() < 1e-9 && low < k as f64 / n as f64 && high > bound);
        }
        assert_eq!(rate_interval(0, 1000), (0.0, rate_bound(0, 1000)));
        // 2 of 10: the textbook interval.
        let (low, high) = rate_interval(2, 10);
        assert!((low - 0.02521).abs() < 1e-4 && (high - 0.55610).abs() < 1e-4, "{low} {high}");
    }

    #[test]
    fn large_counts_keep_their_digits() {
        // 10^9 rays, 1000 wrong: the normal approximation is good to a percent of the deviation.
        let bound = rate_bound(1000, 1_000_000_000) * 1e9;
        assert!((bound - (1000.0 + 1.645 * 31.62)).abs() < 5.0, "{bound}");
    }

    #[test]
    fn quantiles_and_medians() {
        let mut values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(quantile(&mut values, 0.5), 3.0);
        assert_eq!(quantile(&mut values, 1.0), 5.0);
        assert_eq!(quantile(&mut values, 0.0), 1.0);
        let found = median(&[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(found.value, 2.5);
        assert!(found.low >= 1.0 && found.low <= 2.5 && found.high >= 2.5 && found.high <= 4.0);
        assert!(median(&[]).value.is_nan());
    }
}
