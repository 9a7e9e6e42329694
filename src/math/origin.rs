//! The point that a file's positions are stored relative to, so that f32 loses as little as it can.

use glam::DVec3;

/// The origin for these positions, chosen for each axis apart; 0 wherever that loses nothing, or no less.
///
/// Take an axis whose values all lie in an interval at least as far from 0 as it is long, and let `g` be the power of
/// two next above the length. The origin is the interval's middle, rounded to a multiple of `g`. Then
///
/// - `x - origin` is exact in f64, and at most `g <= |x|`: rounding it to f32 loses no more than rounding `x` does;
/// - a number that f32 holds stays exact: it and the origin are multiples of the spacing of f32 at the least `|x|`,
///   which is at least `g / 2^23`, so their difference is a multiple of that spacing and below 2^24 times it.
///
/// Values that are not finite have no say.
pub fn choose_origin(positions: &[DVec3]) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|axis| choose(positions.iter().map(|p| p[axis]))))
}

fn choose(values: impl Iterator<Item = f64>) -> f64 {
    let (mut min, mut max, mut exact) = (f64::INFINITY, f64::NEG_INFINITY, true);
    for x in values.filter(|x| x.is_finite()) {
        min = min.min(x);
        max = max.max(x);
        exact &= f64::from(x as f32) == x;
    }
    // No value at all leaves `exact` true.
    if exact {
        return 0.0;
    }
    let nearest = min.abs().min(max.abs());
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
        choose(values.iter().copied())
    }

    #[test]
    fn zero_is_kept_where_it_loses_nothing_or_no_less() {
        assert_eq!(origin(&[]), 0.0);
        assert_eq!(origin(&[f64::NAN, f64::INFINITY]), 0.0);
        assert_eq!(origin(&[4_500_000.5, 4_500_001.0]), 0.0, "exact in f32");
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
