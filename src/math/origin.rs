//! The point that a file's positions are stored relative to, so that f32 loses as little as it can.

use glam::DVec3;

/// What is this many times farther from zero than it is large is far away: what is nearer loses at most four bits.
pub const FAR: f64 = 16.0;

/// The origin for these positions, chosen for each axis apart; 0 wherever that loses nothing, or no less.
///
/// Take an axis whose values all lie in an interval at least as far from 0 as it is long, and let `g` be the power of
/// two next above the length. The origin is the interval's middle, rounded to a multiple of `g`. Then
///
/// - `x - origin` is exact in f64, and at most `g <= |x|`: rounding it to f32 loses no more than rounding `x` does;
/// - a number that f32 holds stays exact: it and the origin are multiples of the spacing of f32 at the least `|x|`,
///   which is at least `g / 2^23`, so their difference is a multiple of that spacing and below 2^24 times it.
///
/// Values that f32 holds lose nothing at 0, but the rays that meet them would: where all of an axis are such, the origin
/// is 0 unless they are [`FAR`] from it, measured by the greatest length of all axes.
///
/// Values that are not finite have no say.
pub fn choose_origin(positions: impl Iterator<Item = DVec3>) -> DVec3 {
    let mut ranges = [Range::EMPTY; 3];
    for position in positions {
        for (range, x) in ranges.iter_mut().zip(position.to_array()) {
            range.add(x);
        }
    }
    let size = ranges.iter().fold(0.0, |size: f64, range| size.max(range.max - range.min));
    DVec3::from_array(ranges.map(|range| range.origin(size)))
}

/// The values of an axis.
#[derive(Clone, Copy)]
struct Range {
    min: f64,
    max: f64,
    /// Whether f32 holds all of them.
    exact: bool,
}

impl Range {
    const EMPTY: Self = Self { min: f64::INFINITY, max: f64::NEG_INFINITY, exact: true };

    #[inline(always)]
    fn add(&mut self, x: f64) {
        if x.is_finite() {
            self.min = self.min.min(x);
            self.max = self.max.max(x);
            self.exact &= f64::from(x as f32) == x;
        }
    }

    /// The origin of this axis; `size` is the greatest length of all.
    fn origin(self, size: f64) -> f64 {
        let Self { min, max, exact } = self;
        let nearest = min.abs().min(max.abs());
        // No value at all leaves the interval inside out.
        if min > max || (exact && nearest <= FAR * size) {
            return 0.0;
        }
        let spacing = power_of_two_below(nearest) * f64::from(f32::EPSILON);
        let length = max - min;
        let grid = if length > spacing { power_of_two_above(length) } else { spacing };
        let beside_zero = min <= 0.0 && max >= 0.0;
        if beside_zero || !(grid > 0.0 && grid <= nearest) {
            return 0.0;
        }
        // Halved before they are added, so that the sum cannot overflow; `rint` is exact on every machine.
        libm::rint((0.5 * min + 0.5 * max) / grid) * grid
    }
}

/// The greatest power of two that is not above a positive normal number; 0 for a subnormal one.
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7FF0_0000_0000_0000)
}

/// The least power of two that is not below a positive normal number.
fn power_of_two_above(x: f64) -> f64 {
    let below = power_of_two_below(x);
    if below == x { below } else { 2.0 * below }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash, unit};

    fn origin(values: &[f64]) -> f64 {
        choose_origin(values.iter().map(|&x| DVec3::new(x, 0.0, 0.0))).x
    }

    #[test]
    fn zero_is_kept_where_it_loses_nothing_or_no_less() {
        assert_eq!(origin(&[]), 0.0);
        assert_eq!(origin(&[f64::NAN, f64::INFINITY]), 0.0);
        assert_eq!(origin(&[20.5, 22.0]), 0.0, "exact in f32 and near");
        assert_eq!(origin(&[-0.1, 0.1]), 0.0, "around zero");
        assert_eq!(origin(&[0.1, 3.0]), 0.0, "nearer to zero than its length");
        assert_eq!(origin(&[1e-320, 1.1e-320]), 0.0, "below what f32 and the grid can hold");
    }

    #[test]
    fn far_away_values_get_an_origin_on_a_power_of_two() {
        assert_eq!(origin(&[4_512_345.123, 4_512_999.877]), 4_512_768.0);
        assert_eq!(origin(&[-10.1, -11.0]), -11.0);
        let alone = origin(&[0.1]);
        assert_eq!(f64::from(alone as f32), alone);
        assert!((alone - 0.1).abs() < 1e-8 && alone != 0.0);
    }

    #[test]
    fn exact_values_move_where_they_are_far_for_their_size() {
        assert_eq!(origin(&[4_500_000.5, 4_500_001.0]), 4_500_001.0);
        // A flat face at a height of 5 is not far away from its own width; one at 5000 is.
        let face = |y| choose_origin([DVec3::new(-2.0, y, 0.0), DVec3::new(2.0, y, 3.0)].into_iter());
        assert_eq!(face(5.0), DVec3::ZERO);
        assert_eq!(face(5000.0), DVec3::new(0.0, 5000.0, 0.0));
    }

    #[test]
    fn what_f32_holds_stays_exact_and_the_rest_gets_no_worse() {
        let mut counter = 0;
        let mut random = || {
            counter += 1;
            unit(hash(counter))
        };
        let mut moved = 0;
        for round in 0..2000 {
            let middle = (random() - 0.5) * f64::powi(2.0, round % 50 - 20);
            let length = middle.abs() * random();
            let sample = |i| {
                let x = middle + length * (random() - 0.5);
                if i % 2 == 0 { f64::from(x as f32) } else { x }
            };
            let values: Vec<f64> = (0..20).map(sample).collect();
            let origin = origin(&values);
            moved += i32::from(origin != 0.0);
            for &x in &values {
                let loss = |relative: f64| (f64::from(relative as f32) - relative).abs();
                assert_eq!((x - origin) + origin, x);
                assert!(loss(x - origin) <= loss(x), "{x:e} {origin:e}");
            }
        }
        assert!(moved > 500, "{moved}");
    }
}
