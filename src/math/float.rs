//! Rounding: directed conversions, error bounds, and products that do not cancel.

use glam::{DVec3, Vec3};

/// Unit roundoff of f32: a correctly rounded operation has a relative error of at most this.
pub const UNIT_ROUNDOFF: f64 = 1.0 / (1u64 << 24) as f64;

/// Higham's bound on the relative error of `n` f32 operations in a row: `n u / (1 - n u)`.
pub const fn gamma(n: u32) -> f64 {
    let nu = n as f64 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// The largest f32 that is not above `x`.
#[inline]
pub fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

/// The smallest f32 that is not below `x`.
#[inline]
pub fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) < x { nearest.next_up() } else { nearest }
}

/// Component-wise [`round_down`].
pub fn round_down_vec(v: DVec3) -> Vec3 {
    Vec3::new(round_down(v.x), round_down(v.y), round_down(v.z))
}

/// Component-wise [`round_up`].
pub fn round_up_vec(v: DVec3) -> Vec3 {
    Vec3::new(round_up(v.x), round_up(v.y), round_up(v.z))
}

/// `a b` as an unevaluated sum `product + error`, exact unless it over- or underflows (Dekker 1971).
///
/// Veltkamp's splitting stands in for a fused multiply-add, so that every machine gives the same bits at the same cost.
#[inline]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    #[inline(always)]
    fn split(x: f64) -> (f64, f64) {
        const SPLITTER: f64 = (1u64 << 27) as f64 + 1.0;
        let scaled = SPLITTER * x;
        let high = scaled - (scaled - x);
        (high, x - high)
    }
    let product = a * b;
    let (a_high, a_low) = split(a);
    let (b_high, b_low) = split(b);
    let error = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, error)
}

/// `a b - c d` to within 1.5 ulp, however much the products cancel (Kahan's method on [`two_product`]).
#[inline]
pub fn difference_of_products(a: f64, b: f64, c: f64, d: f64) -> f64 {
    let (ab, ab_error) = two_product(a, b);
    let (cd, cd_error) = two_product(c, d);
    (ab - cd) + (ab_error - cd_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directed_rounding_brackets_the_value() {
        for x in [0.1f64, -0.1, 1.0, 1e-46, -1e-46, 16777217.0, 1e300, -1e300] {
            assert!(f64::from(round_down(x)) <= x && x <= f64::from(round_up(x)), "{x}");
        }
        assert_eq!((round_down(0.5), round_up(0.5)), (0.5, 0.5));
    }

    #[test]
    fn cancelling_products_keep_their_digits() {
        // (2^27 + 1)^2 - 2^27 (2^27 + 2) = 1: both products need 55 bits.
        let x = (1u64 << 27) as f64;
        assert_eq!(difference_of_products(x + 1.0, x + 1.0, x, x + 2.0), 1.0);
        assert_eq!(two_product(x + 1.0, x + 1.0), (x * x + 2.0 * x, 1.0));
    }
}
