//! Where a pixel's samples lie: stratified, and a function of the pixel and the sample alone.

use glam::DVec2;

use crate::math::random::{hash2, unit};
use crate::math::simd::{Level, Task};
use crate::scene::film::MOST_SAMPLES;

/// The position of a sample within its pixel, both coordinates in [0, 1).
///
/// One sample lies at the centre. More are correlated multi-jittered (Kensler, "Correlated Multi-Jittered Sampling",
/// Pixar 2013): stratified on a grid and on both axes, for any number. The pattern is keyed by the pixel's position
/// in the full picture, so crops and tiles do not change it.
pub fn position(x: u32, y: u32, sample: u32, samples: u32) -> DVec2 {
    if samples == 1 { DVec2::splat(0.5) } else { Pattern::new(x, y, samples).position(sample) }
}

/// Where the samples of one pixel lie, more than one.
#[derive(Debug, Clone, Copy)]
struct Pattern {
    key: u32,
    samples: u32,
    columns: u32,
    rows: u32,
    order: Permutation,
    column: Permutation,
    row: Permutation,
}

impl Pattern {
    fn new(x: u32, y: u32, samples: u32) -> Self {
        let key = hash2(x, y);
        let columns = (f64::from(samples).sqrt() as u32).max(1);
        let rows = samples.div_ceil(columns);
        Self {
            key,
            samples,
            columns,
            rows,
            order: Permutation::new(samples, key ^ 0x51f1_5e5b),
            column: Permutation::new(columns, key ^ 0xa511_e9b3),
            row: Permutation::new(rows, key ^ 0x63d8_3595),
        }
    }

    /// The position of a sample within the pixel, both coordinates in [0, 1).
    fn position(&self, sample: u32) -> DVec2 {
        let shuffled = self.order.at(sample);
        self.within(shuffled, self.column.at(shuffled % self.columns), self.row.at(shuffled / self.columns))
    }

    /// The position of the sample that is so many in the shuffled order and lies in a column and, along x, in a row of it.
    #[inline(always)]
    fn within(&self, shuffled: u32, column: u32, row: u32) -> DVec2 {
        let jitter = |salt: u32| unit(hash2(shuffled, self.key ^ salt));
        let within = |index: f64, count: u32| (index / f64::from(count)).min(1.0f64.next_down());
        let across = f64::from(column) + (f64::from(row) + jitter(0xa399_d265)) / f64::from(self.rows);
        DVec2::new(within(across, self.columns), within(f64::from(shuffled) + jitter(0x711a_d6a5), self.samples))
    }
}

/// The most columns or rows of a grid of samples, as a power of two above: the grid has about as many of one as of the other.
const MOST_LINES: usize = 1 << (u32::BITS - MOST_SAMPLES.leading_zeros()).div_ceil(2);

/// The positions of all samples of one pixel after another, with what can be shared between them.
#[derive(Debug)]
pub struct Positions {
    samples: u32,
    /// The samples' numbers in the shuffled order.
    shuffled: Vec<u32>,
    columns: [u32; MOST_LINES],
    rows: [u32; MOST_LINES],
}

impl Positions {
    /// For so many samples a pixel.
    pub fn new(samples: u32) -> Self {
        assert!(samples <= MOST_SAMPLES, "no more than {MOST_SAMPLES} samples");
        let lines = [0; MOST_LINES];
        Self { samples, shuffled: vec![0; samples as usize], columns: lines, rows: lines }
    }

    /// Adds [`position`] of each of a pixel's samples to the pixel's corner, and the sums to two lists.
    pub fn add(&mut self, pixel: (u32, u32), x: &mut Vec<f64>, y: &mut Vec<f64>) {
        let (corner_x, corner_y) = (f64::from(pixel.0), f64::from(pixel.1));
        if self.samples == 1 {
            x.push(corner_x + 0.5);
            y.push(corner_y + 0.5);
            return;
        }
        let pattern = Pattern::new(pixel.0, pixel.1, self.samples);
        let lines = |lines: &mut [u32; MOST_LINES], permutation: &Permutation| {
            for (line, to) in (0..permutation.length).zip(lines) {
                *to = permutation.at(line);
            }
        };
        lines(&mut self.columns, &pattern.column);
        lines(&mut self.rows, &pattern.row);
        let (first, last) = (x.len(), x.len() + self.samples as usize);
        x.resize(last, 0.0);
        y.resize(last, 0.0);
        let Self { shuffled, columns, rows, .. } = self;
        let (x, y) = (&mut x[first..], &mut y[first..]);
        Level::chosen().run(Spread { pattern: &pattern, corner: (corner_x, corner_y), shuffled, columns, rows, x, y });
    }
}

struct Spread<'a> {
    pattern: &'a Pattern,
    corner: (f64, f64),
    shuffled: &'a mut [u32],
    columns: &'a [u32; MOST_LINES],
    rows: &'a [u32; MOST_LINES],
    x: &'a mut [f64],
    y: &'a mut [f64],
}

impl Task for Spread<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { pattern, corner, shuffled, columns, rows, x, y } = self;
        pattern.order.all(shuffled);
        // Divisions of integers are no vectors.
        if pattern.columns.is_power_of_two() {
            spread::<true>(pattern, corner, shuffled, columns, rows, x, y);
        } else {
            spread::<false>(pattern, corner, shuffled, columns, rows, x, y);
        }
    }
}

#[inline(always)]
fn spread<const POWER: bool>(
    pattern: &Pattern,
    corner: (f64, f64),
    shuffled: &[u32],
    columns: &[u32; MOST_LINES],
    rows: &[u32; MOST_LINES],
    x: &mut [f64],
    y: &mut [f64],
) {
    let shift = pattern.columns.trailing_zeros();
    for ((&shuffled, x), y) in shuffled.iter().zip(x).zip(y) {
        let row = if POWER { shuffled >> shift } else { shuffled / pattern.columns };
        let column = shuffled - row * pattern.columns;
        // Without a check of bounds.
        let line = |lines: &[u32; MOST_LINES], at: u32| lines[at as usize & (MOST_LINES - 1)];
        let within = pattern.within(shuffled, line(columns, column), line(rows, row));
        *x = corner.0 + within.x;
        *y = corner.1 + within.y;
    }
}

/// A pseudo-random permutation of `0..length`, chosen by a key.
///
/// Four rounds of multiply, add and xor-shift, each a bijection on the next power of two, repeated until the value
/// falls below `length` (cycle walking).
#[derive(Debug, Clone, Copy)]
struct Permutation {
    length: u32,
    mask: u32,
    shift: u32,
    /// What each round multiplies by and adds.
    rounds: [(u32, u32); 4],
}

impl Permutation {
    fn new(length: u32, key: u32) -> Self {
        let mask = length.next_power_of_two() - 1;
        let rounds = [0, 1, 2, 3].map(|round| {
            let mix = hash2(key, round);
            (mix | 1, mix >> 7)
        });
        Self { length, mask, shift: (mask.count_ones() / 2).max(1), rounds }
    }

    fn at(&self, index: u32) -> u32 {
        let mut i = index;
        loop {
            i = self.step(i);
            if i < self.length {
                return i;
            }
        }
    }

    /// All in order.
    #[inline(always)]
    fn all(&self, of: &mut [u32]) {
        if self.length == self.mask + 1 {
            for (index, to) in of.iter_mut().enumerate() {
                *to = self.step(index as u32);
            }
        } else {
            for (index, to) in of.iter_mut().enumerate() {
                *to = self.at(index as u32);
            }
        }
    }

    /// The bijection on the next power of two.
    #[inline(always)]
    fn step(&self, index: u32) -> u32 {
        let mut i = index;
        for (factor, term) in self.rounds {
            i = i.wrapping_mul(factor).wrapping_add(term) & self.mask;
            i ^= i >> self.shift;
        }
        i
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_visit_everything_once() {
        for length in [1, 2, 3, 5, 16, 17, 100] {
            for key in [0, 1, 0xdead_beef, 0x8000_0001] {
                let mut seen: Vec<u32> = (0..length).map(|i| Permutation::new(length, key).at(i)).collect();
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
    fn all_samples_of_a_pixel_lie_where_each_does() {
        for samples in [1, 2, 3, 16, 17, 100, 1000, MOST_SAMPLES] {
            let mut positions = Positions::new(samples);
            let (mut x, mut y) = (Vec::new(), Vec::new());
            let pixels = [(0, 0), (7, 11), (1023, 5)];
            pixels.iter().for_each(|&pixel| positions.add(pixel, &mut x, &mut y));
            let found: Vec<_> = x.into_iter().zip(y).map(|(x, y)| DVec2::new(x, y)).collect();
            let expected = pixels.iter().flat_map(|&(x, y)| {
                let corner = DVec2::new(f64::from(x), f64::from(y));
                (0..samples).map(move |sample| corner + position(x, y, sample, samples))
            });
            assert_eq!(found, expected.collect::<Vec<_>>(), "{samples}");
        }
    }

    #[test]
    fn one_sample_lies_at_the_centre() {
        assert_eq!(position(3, 4, 0, 1), DVec2::splat(0.5));
    }
}
