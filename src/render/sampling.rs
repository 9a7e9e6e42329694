//! Where a pixel's samples lie: stratified, and a function of the pixel and the sample alone.

use glam::DVec2;

use crate::math::random::{hash2, unit};

/// The position of a sample within its pixel, both coordinates in [0, 1).
///
/// One sample lies at the centre. More are correlated multi-jittered (Kensler, "Correlated Multi-Jittered Sampling",
/// Pixar 2013): stratified on a grid and on both axes, for any number. The pattern is keyed by the pixel's position
/// in the full picture, so crops and tiles do not change it.
pub fn position(x: u32, y: u32, sample: u32, samples: u32) -> DVec2 {
    if samples == 1 {
        return DVec2::splat(0.5);
    }
    let pattern = hash2(x, y);
    let columns = (f64::from(samples).sqrt() as u32).max(1);
    let rows = samples.div_ceil(columns);
    let shuffled = permute(sample, samples, pattern ^ 0x51f1_5e5b);
    let column = permute(shuffled % columns, columns, pattern ^ 0xa511_e9b3);
    let row = permute(shuffled / columns, rows, pattern ^ 0x63d8_3595);
    let jitter = |salt: u32| unit(hash2(shuffled, pattern ^ salt));
    let within = |index: f64, count: u32| (index / f64::from(count)).min(1.0f64.next_down());
    DVec2::new(
        within(f64::from(column) + (f64::from(row) + jitter(0xa399_d265)) / f64::from(rows), columns),
        within(f64::from(shuffled) + jitter(0x711a_d6a5), samples),
    )
}

/// A pseudo-random permutation of `0..length`, chosen by `key`.
///
/// Four rounds of multiply, add and xor-shift, each a bijection on the next power of two, repeated until the value
/// falls below `length` (cycle walking).
fn permute(index: u32, length: u32, key: u32) -> u32 {
    let mask = length.next_power_of_two() - 1;
    let shift = (mask.count_ones() / 2).max(1);
    let mut i = index;
    loop {
        for round in 0..4 {
            let mix = hash2(key, round);
            i = i.wrapping_mul(mix | 1).wrapping_add(mix >> 7) & mask;
            i ^= i >> shift;
        }
        if i < length {
            return i;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_visit_everything_once() {
        for length in [1, 2, 3, 5, 16, 17, 100] {
            for key in [0, 1, 0xdead_beef, 0x8000_0001] {
                let mut seen: Vec<u32> = (0..length).map(|i| permute(i, length, key)).collect();
                seen.sort_unstable();
                assert!(seen.iter().copied().eq(0..length), "{length} {key}");
            }
        }
    }

    #[test]
    fn samples_are_stratified_on_the_grid_and_on_the_y_axis() {
        for samples in [4u32, 9, 16, 64] {
            let side = (samples as f64).sqrt() as u32;
            let mut cells = vec![0; samples as usize];
            let mut rows = vec![0; samples as usize];
            for sample in 0..samples {
                let p = position(7, 11, sample, samples);
                assert!((0.0..1.0).contains(&p.x) && (0.0..1.0).contains(&p.y));
                cells[((p.x * side as f64) as u32 + side * (p.y * side as f64) as u32) as usize] += 1;
                rows[(p.y * samples as f64) as usize] += 1;
            }
            assert!(rows.iter().all(|&n| n == 1), "{samples}: one sample a row");
            assert!(cells.iter().all(|&n| n == 1), "{samples}: one sample a cell: {cells:?}");
        }
    }

    #[test]
    fn one_sample_lies_at_the_centre() {
        assert_eq!(position(3, 4, 0, 1), DVec2::splat(0.5));
    }
}
