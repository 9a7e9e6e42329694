//! The real roots of a quadratic, with every special case.

use crate::math::float::difference_of_products;

/// The real roots of an equation, in ascending order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Roots {
    /// No real root, or infinitely many (all coefficients zero): no crossing either way.
    None,
    /// One root: a linear equation, or a tangent.
    One(f64),
    /// Two distinct roots, ascending.
    Two(f64, f64),
}

/// Solves `a t^2 + 2 b t + c = 0`; note the factor 2.
///
/// The discriminant `b^2 - a c` is evaluated without cancellation (Kahan), and the root that would cancel is found
/// through the product of the roots: `q = -(b + copysign(sqrt D, b))`, roots `q / a` and `c / q`. A root that
/// overflows is dropped. NaN in any coefficient gives no root.
pub fn solve(a: f64, b: f64, c: f64) -> Roots {
    if a == 0.0 {
        return if b == 0.0 { Roots::None } else { finite(-0.5 * c / b) };
    }
    let discriminant = difference_of_products(b, b, a, c);
    if discriminant > 0.0 {
        let q = -(b + discriminant.sqrt().copysign(b));
        // b = 0 gives q = -sqrt(D), never 0, since D > 0.
        let (r, s) = (q / a, c / q);
        match (r.is_finite(), s.is_finite()) {
            (true, true) if r < s => Roots::Two(r, s),
            (true, true) if s < r => Roots::Two(s, r),
            (true, _) => Roots::One(r),
            (false, true) => Roots::One(s),
            (false, false) => Roots::None,
        }
    } else if discriminant == 0.0 {
        finite(-b / a)
    } else {
        Roots::None
    }
}

fn finite(t: f64) -> Roots {
    if t.is_finite() { Roots::One(t + 0.0) } else { Roots::None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_cases_of_the_hard_case_list() {
        // (1e-17, 1, -1): roots near -2e17 and 0.5; the naive formula returns 0 for the second.
        let Roots::Two(far, near) = solve(1e-17, 1.0, -1.0) else { panic!() };
        assert!((near - 0.5).abs() < 1e-15 && (far / -2e17 - 1.0).abs() < 1e-15);
        assert_eq!(solve(0.0, 1.0, -1.0), Roots::One(0.5));
        assert_eq!(solve(0.0, 0.0, 1.0), Roots::None);
        assert_eq!(solve(1.0, 0.0, 0.0), Roots::One(0.0));
        assert_eq!(solve(1.0, 0.0, -4.0), Roots::Two(-2.0, 2.0));
        assert_eq!(solve(0.0, 0.0, 0.0), Roots::None);
        assert_eq!(solve(f64::NAN, 1.0, 1.0), Roots::None);
        assert_eq!(solve(1.0, -1.0, 1.0), Roots::One(1.0));
    }

    #[test]
    fn the_sign_of_a_nearly_tangent_discriminant_is_exact() {
        // c is the rounded square of b: what remains is the rounding error, which naive f64 takes for 0.
        for k in 1..1000u32 {
            let b = -1.0 - f64::from(k) / 1024.0 - f64::EPSILON;
            let c = b * b;
            let (square, error) = crate::math::float::two_product(b, b);
            assert_eq!(square, c);
            match solve(1.0, b, c) {
                Roots::Two(r, s) => assert!(error > 0.0 && r <= s, "{b}"),
                Roots::One(_) => assert!(error == 0.0 || (error > 0.0 && error.sqrt() < 1e-15), "{b}"),
                Roots::None => assert!(error < 0.0, "{b}"),
            }
        }
    }
}
