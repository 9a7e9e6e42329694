//! How often values occurred, counted from many threads at once.

use std::sync::atomic::{AtomicU64, Ordering};

/// Bins of width 1 / 64, the last of which has no end: for errors in ulp.
const BINS: usize = 64 * 64;
const BINS_A_UNIT: f64 = 64.0;

/// Counts of values from 0 up to 64, and of those beyond.
pub struct Histogram {
    counts: Vec<AtomicU64>,
}

impl Default for Histogram {
    /// Nothing counted.
    fn default() -> Self {
        Self { counts: (0..=BINS).map(|_| AtomicU64::new(0)).collect() }
    }
}

impl Histogram {
    /// Counts a value; NaN is beyond all.
    pub fn add(&self, value: f64) {
        let bin = if value < BINS as f64 / BINS_A_UNIT { (value * BINS_A_UNIT) as usize } else { BINS };
        self.counts[bin].fetch_add(1, Ordering::Relaxed);
    }

    /// The upper end of the bin below whose end a share `q` of the values lies; infinite if that is the last. NaN if nothing
    /// was counted.
    pub fn quantile(&self, q: f64) -> f64 {
        let counts: Vec<u64> = self.counts.iter().map(|count| count.load(Ordering::Relaxed)).collect();
        let total: u64 = counts.iter().sum();
        let mut below = 0;
        for (bin, count) in counts.into_iter().enumerate() {
            below += count;
            if total > 0 && below as f64 >= q * total as f64 {
                return if bin == BINS { f64::INFINITY } else { (bin + 1) as f64 / BINS_A_UNIT };
            }
        }
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_upper_ends_of_bins() {
        let histogram = Histogram::default();
        assert!(histogram.quantile(0.5).is_nan());
        (0..100).for_each(|i| histogram.add(f64::from(i) / 10.0));
        assert!((histogram.quantile(0.5) - 4.9).abs() <= 1.0 / 64.0 + 1e-12);
        histogram.add(f64::NAN);
        assert_eq!(histogram.quantile(1.0), f64::INFINITY);
    }
}
