//! The real roots of a quadratic, with every special case; D30 of the hard cases asks for them.

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
