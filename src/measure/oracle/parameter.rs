//! The t of a hit, exact: a rational number, or one with a square root in it.

use std::cmp::Ordering;

use crate::measure::dyadic::{Dyadic, quotient};

/// The number `(rational + sign sqrt(radicand)) / divisor`, exact.
///
/// Two of them are compared by squaring, which decides every case; no digit is ever guessed.
#[derive(Debug, Clone)]
pub struct Parameter {
    rational: Dyadic,
    /// Not negative; zero for a rational number.
    radicand: Dyadic,
    /// Whether the root is subtracted.
    negative: bool,
    /// Positive.
    divisor: Dyadic,
}

impl Parameter {
    /// `numerator / denominator`.
    ///
    /// # Panics
    /// If the denominator is zero.
    pub fn ratio(numerator: Dyadic, denominator: Dyadic) -> Self {
        Self::root(numerator, Dyadic::ZERO, false, denominator)
    }

    /// `(rational - sqrt(radicand)) / divisor` where `negative`, else the sum; the radicand must not be negative.
    ///
    /// # Panics
    /// If the divisor is zero.
    pub(super) fn root(rational: Dyadic, radicand: Dyadic, negative: bool, divisor: Dyadic) -> Self {
        assert!(divisor.sign() != Ordering::Equal, "division by zero");
        debug_assert!(radicand.sign() != Ordering::Less);
        if divisor.sign() == Ordering::Less {
            Self { rational: -rational, radicand, negative: !negative, divisor: -divisor }
        } else {
            Self { rational, radicand, negative, divisor }
        }
    }

    /// A floating-point number; f32 convert to f64 without loss.
    ///
    /// # Panics
    /// If it is NaN or infinite.
    pub fn new(x: f64) -> Self {
        Self::ratio(Dyadic::new(x), Dyadic::new(1.0))
    }

    /// How the number compares with one that may be infinite, but not NaN.
    pub fn compare(&self, x: f64) -> Ordering {
        if x == f64::INFINITY {
            Ordering::Less
        } else if x == f64::NEG_INFINITY {
            Ordering::Greater
        } else {
            self.cmp(&Self::new(x))
        }
    }

    /// The nearest f64, ties to even.
    pub fn to_f64(&self) -> f64 {
        if self.radicand.sign() == Ordering::Equal {
            return quotient(&self.rational, &self.divisor);
        }
        // Of |p - sqrt q| at least 1 / (2 p) is left in units of the last bit: with twice the bits of both, and 64
        // more, the quotient below is off by one place at most.
        let bits = 2 * (self.rational.bits() + self.radicand.bits()) + 64;
        let root = self.radicand.square_root(bits);
        let numerator = if self.negative { &self.rational - &root } else { &self.rational + &root };
        let mut nearest = quotient(&numerator, &self.divisor);
        let half_way = |a: f64, b: f64| Self::ratio((Dyadic::new(a) + Dyadic::new(b)).scaled(-1), Dyadic::new(1.0));
        while nearest.is_finite() && nearest.next_up().is_finite() && *self > half_way(nearest, nearest.next_up()) {
            nearest = nearest.next_up();
        }
        while nearest.is_finite() && nearest.next_down().is_finite() && *self < half_way(nearest, nearest.next_down()) {
            nearest = nearest.next_down();
        }
        nearest
    }

    /// The nearest f32, ties to even; not rounded by way of f64.
    pub fn to_f32(&self) -> f32 {
        let near = self.to_f64();
        round_once(near, |middle| self.compare(middle))
    }
}

/// The f32 nearest to a number whose nearest f64 is `near`; `compare` compares the number with an f64.
///
/// Rounding twice goes wrong only where the f64 lies exactly between two f32, and the number beside it.
fn round_once(near: f64, compare: impl Fn(f64) -> Ordering) -> f32 {
    let nearest = near as f32;
    if !nearest.is_finite() || f64::from(nearest) == near {
        return nearest;
    }
    let other = if f64::from(nearest) < near { nearest.next_up() } else { nearest.next_down() };
    // Exact: two neighbouring f32.
    let middle = 0.5 * (f64::from(nearest) + f64::from(other));
    let (lower, upper) = if nearest < other { (nearest, other) } else { (other, nearest) };
    match compare(middle) {
        _ if near != middle => nearest,
        Ordering::Less => lower,
        Ordering::Equal => nearest,
        Ordering::Greater => upper,
    }
}

/// `numerator / denominator` rounded to the nearest f32 once, ties to even.
///
/// # Panics
/// If the denominator is zero.
pub fn quotient_f32(numerator: &Dyadic, denominator: &Dyadic) -> f32 {
    let positive = denominator.sign() == Ordering::Greater;
    round_once(quotient(numerator, denominator), |middle| {
        let order = numerator.cmp(&(&Dyadic::new(middle) * denominator));
        if positive { order } else { order.reverse() }
    })
}

/// The sign of `a + x sqrt(b) - y sqrt(c)`, where x and y are 1 or -1 (`true` is -1), b and c not negative.
fn sign_of_sum(a: &Dyadic, (x, b): (bool, &Dyadic), (y, c): (bool, &Dyadic)) -> Ordering {
    // The sign of the roots' part, r = x sqrt b - y sqrt c.
    let signed = |negative: bool, value: &Dyadic| if negative { value.sign().reverse() } else { value.sign() };
    let roots = match (signed(x, b), signed(!y, c)) {
        (Ordering::Equal, other) | (other, Ordering::Equal) => other,
        (one, other) if one == other => one,
        // Of different signs: the larger wins.
        (one, _) => {
            let larger = b.cmp(c);
            if one == Ordering::Greater { larger } else { larger.reverse() }
        }
    };
    let whole = a.sign();
    if roots == Ordering::Equal || whole == roots {
        return whole;
    }
    if whole == Ordering::Equal {
        return roots;
    }
    // Of different signs: a^2 against r^2 = b + c - 2 x y sqrt(b c).
    let rest = &(&(a * a) - b) - c;
    let product = &(b * c).scaled(2);
    let cross_negative = x == y;
    // a^2 - r^2 = rest + 2 x y sqrt(b c).
    let square_root_sign = if product.sign() == Ordering::Equal {
        Ordering::Equal
    } else if cross_negative {
        Ordering::Greater
    } else {
        Ordering::Less
    };
    let larger = if square_root_sign == Ordering::Equal || rest.sign() == square_root_sign {
        if rest.sign() == Ordering::Equal { square_root_sign } else { rest.sign() }
    } else if rest.sign() == Ordering::Equal {
        square_root_sign
    } else {
        let order = (&rest * &rest).cmp(product);
        if rest.sign() == Ordering::Greater { order } else { order.reverse() }
    };
    match larger {
        Ordering::Equal => Ordering::Equal,
        Ordering::Greater => whole,
        Ordering::Less => roots,
    }
}

impl PartialEq for Parameter {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Parameter {}

impl PartialOrd for Parameter {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Parameter {
    fn cmp(&self, other: &Self) -> Ordering {
        // p/r + sqrt(q)/r against the other, times both divisors, which are positive.
        let (r, s) = (&self.divisor, &other.divisor);
        let rational = &(&self.rational * s) - &(&other.rational * r);
        let square = |x: &Dyadic| x * x;
        let (b, c) = (&self.radicand * &square(s), &other.radicand * &square(r));
        sign_of_sum(&rational, (self.negative, &b), (other.negative, &c))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    /// `(p + sign sqrt q) / r` from small integers.
    fn root(p: i32, q: u32, negative: bool, r: i32) -> Parameter {
        let [p, q, r] = [f64::from(p), f64::from(q), f64::from(r)].map(Dyadic::new);
        Parameter::root(p, q, negative, r)
    }

    #[test]
    fn comparisons_agree_with_f64_where_that_is_certain_and_equal_numbers_are_equal() {
        let mut random = Random::new(3, 0);
        let mut equal = 0;
        for _ in 0..20_000 {
            let mut draw = || {
                let (p, q) = (random.below(9) as i32 - 4, random.below(10) as u32);
                let (negative, r) = (random.below(2) == 1, [1, 2, 3, -1, -2][random.below(5) as usize]);
                let value = (f64::from(p) + if negative { -1.0 } else { 1.0 } * f64::from(q).sqrt()) / f64::from(r);
                (root(p, q, negative, r), value)
            };
            let ((a, x), (b, y)) = (draw(), draw());
            if (x - y).abs() > 1e-12 {
                assert_eq!(a.cmp(&b), x.partial_cmp(&y).unwrap(), "{a:?} {b:?}");
            } else {
                // Differences of such small numbers are 0 or more than 1e-6 (their norm is a whole number).
                assert_eq!(a, b);
                equal += 1;
            }
            assert_eq!(b.cmp(&a), a.cmp(&b).reverse());
            assert!((a.to_f64() - x).abs() <= 1e-15 * (1.0 + x.abs()));
        }
        assert!(equal > 100, "{equal}");
        // (1 + sqrt 8) / 2 = (2 + sqrt 32) / 4; sqrt 2 - sqrt 2 = 0.
        assert_eq!(root(1, 8, false, 2), root(2, 32, false, 4));
        assert_eq!(root(3, 9, true, 1), Parameter::new(0.0));
    }

    #[test]
    fn roots_round_correctly() {
        // sqrt is correctly rounded in hardware: an independent reference.
        let mut random = Random::new(4, 0);
        for _ in 0..500 {
            let q = f64::from_bits(random.bits() >> 2 | 1 << 60);
            let root = Parameter::root(Dyadic::ZERO, Dyadic::new(q), false, Dyadic::new(1.0));
            assert_eq!(root.to_f64(), q.sqrt(), "{q:e}");
        }
        // 2^60 - sqrt(2^120 - 1) = 2^-61 (1 + ...): everything cancels in f64.
        let large = Dyadic::new(1.0).scaled(60);
        let under = &(&large * &large) - &Dyadic::new(1.0);
        let small = Parameter::root(large, under, true, Dyadic::new(1.0));
        assert_eq!(small.to_f64(), 0.5f64.powi(61));
    }

    #[test]
    fn f32_is_rounded_once() {
        // 1 + 2^-24 lies between two f32, and a little beside it decides.
        let (middle, little) = (1.0 + 0.5f64.powi(24), Dyadic::new(1.0).scaled(-200));
        let one = Dyadic::new(1.0);
        let above = Dyadic::new(middle) + little.clone();
        assert_eq!(quotient_f32(&above, &one), 1.0f32.next_up());
        assert_eq!(quotient_f32(&Dyadic::new(middle), &one), 1.0);
        let next = 1.0 + 3.0 * 0.5f64.powi(24);
        assert_eq!(quotient_f32(&(Dyadic::new(next) - little.clone()), &one), 1.0f32.next_up());
        assert_eq!(quotient_f32(&-above.clone(), &one), -1.0f32.next_up());
        assert_eq!(quotient_f32(&above, &-one.clone()), -1.0f32.next_up());
        assert_eq!(Parameter::ratio(above, one.clone()).to_f32(), 1.0f32.next_up());
        assert_eq!(quotient_f32(&Dyadic::new(1e300), &one), f32::INFINITY);
    }
}
