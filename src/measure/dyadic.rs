//! Exact numbers: integers times powers of two, which is what floating-point numbers are.
//!
//! Sums, differences and products of such numbers are again such numbers, so that any polynomial of floating-point
//! inputs has an exact value and an exact sign. Quotients stay pairs of numbers and are compared by multiplying out.

use std::cmp::Ordering;
use std::ops::{Add, Mul, Neg, Sub};

use dashu_int::IBig;
use dashu_int::ops::{BitTest, SquareRoot, UnsignedAbs};

/// `mantissa * 2^exponent`, exact.
#[derive(Debug, Clone)]
pub struct Dyadic {
    mantissa: IBig,
    exponent: i64,
}

impl Dyadic {
    /// Zero.
    pub const ZERO: Self = Self { mantissa: IBig::ZERO, exponent: 0 };

    /// The exact value of a finite f64; an f32 converts to f64 first without loss.
    ///
    /// # Panics
    /// If `x` is NaN or infinite.
    pub fn new(x: f64) -> Self {
        assert!(x.is_finite(), "{x} has no exact value");
        let bits = x.to_bits();
        let fraction = (bits & ((1 << 52) - 1)) as i64;
        let (mantissa, exponent) = match (bits >> 52 & 0x7ff) as i64 {
            0 => (fraction, -1074),
            biased => (fraction | 1 << 52, biased - 1075),
        };
        // Trailing zeros go into the exponent: most inputs are short numbers, and products stay short.
        let zeros = if mantissa == 0 { 0 } else { mantissa.trailing_zeros() };
        let mantissa = IBig::from(mantissa >> zeros);
        Self { mantissa: if x < 0.0 { -mantissa } else { mantissa }, exponent: exponent + i64::from(zeros) }
    }

    /// Less, equal or greater than zero.
    pub fn sign(&self) -> Ordering {
        self.mantissa.cmp(&IBig::ZERO)
    }

    /// The absolute value.
    pub fn abs(&self) -> Self {
        if self.sign() == Ordering::Less { -self } else { self.clone() }
    }

    /// `self * 2^power`, exact.
    pub fn scaled(&self, power: i64) -> Self {
        Self { mantissa: self.mantissa.clone(), exponent: self.exponent + power }
    }

    /// The nearest f64, ties to even.
    pub fn to_f64(&self) -> f64 {
        quotient(self, &Self::new(1.0))
    }

    /// The length of the mantissa in bits; 0 for zero.
    pub fn bits(&self) -> usize {
        self.mantissa.bit_len()
    }

    /// The square root rounded down to `bits` bits or more.
    ///
    /// # Panics
    /// If the number is negative.
    pub fn square_root(&self, bits: usize) -> Self {
        assert!(self.sign() != Ordering::Less, "the root of a negative number");
        // Twice the bits under the root, and an even exponent.
        let shift = (2 * bits).saturating_sub(self.bits()) as i64;
        let shift = shift + (self.exponent - shift).rem_euclid(2);
        let radicand = (&self.mantissa << shift as usize).unsigned_abs();
        Self { mantissa: radicand.sqrt().into(), exponent: (self.exponent - shift) / 2 }
    }

    /// Both mantissas at the smaller of the exponents.
    fn aligned(&self, other: &Self) -> (IBig, IBig, i64) {
        let exponent = if self.mantissa.is_zero() {
            other.exponent
        } else if other.mantissa.is_zero() {
            self.exponent
        } else {
            self.exponent.min(other.exponent)
        };
        let at = |number: &Self| {
            if number.mantissa.is_zero() {
                IBig::ZERO
            } else {
                &number.mantissa << (number.exponent - exponent) as usize
            }
        };
        (at(self), at(other), exponent)
    }
}

/// `numerator / denominator` correctly rounded to f64, ties to even; infinite if too large.
///
/// # Panics
/// If the denominator is zero.
pub fn quotient(numerator: &Dyadic, denominator: &Dyadic) -> f64 {
    assert!(denominator.sign() != Ordering::Equal, "division by zero");
    if numerator.sign() == Ordering::Equal {
        return 0.0;
    }
    let negative = numerator.sign() != denominator.sign();
    let magnitude =
        |number: &Dyadic| if number.sign() == Ordering::Less { -&number.mantissa } else { number.mantissa.clone() };
    let (top, bottom) = (magnitude(numerator), magnitude(denominator));
    // At least 66 bits of quotient, of which the last says whether anything was left over.
    let shift = 66 + bottom.bit_len() as i64 - top.bit_len() as i64;
    let (top, bottom) = if shift >= 0 { (top << shift as usize, bottom) } else { (top, bottom << (-shift) as usize) };
    let whole = &top / &bottom;
    let sticky = whole.clone() * &bottom != top;
    let exponent = numerator.exponent - denominator.exponent - shift;
    let rounded = round_to_f64(whole, sticky, exponent);
    if negative { -rounded } else { rounded }
}

/// `whole * 2^exponent`, and a little more if `sticky`, rounded to the nearest f64; `whole` is positive.
fn round_to_f64(whole: IBig, sticky: bool, exponent: i64) -> f64 {
    let length = whole.bit_len() as i64;
    // The last bit that f64 can hold here: 53 bits, or fewer below the normal range.
    let last = (exponent + length - 53).max(-1074);
    let drop = last - exponent;
    if drop > length + 1 {
        return 0.0;
    }
    let (kept, up) = if drop <= 0 {
        (whole << (-drop) as usize, false)
    } else {
        let drop = drop as usize;
        let kept = &whole >> drop;
        let rest = whole - (kept.clone() << drop);
        let half = IBig::ONE << (drop - 1);
        let odd = kept.bit(0);
        let up = rest > half || (rest == half && (sticky || odd));
        (kept, up)
    };
    let kept = u64::try_from(kept).expect("at most 53 bits are kept") + u64::from(up);
    if last > 971 {
        return f64::INFINITY;
    }
    // Exact: `kept` has at most 54 bits of which the last is 0 if there are 54, and both factors are powers of two.
    let scaled = kept as f64;
    if last < -1022 {
        scaled * f64::from_bits(1u64 << (last + 1074))
    } else {
        scaled * f64::from_bits(((last + 1023) as u64) << 52)
    }
}

impl Add for &Dyadic {
    type Output = Dyadic;
    fn add(self, other: Self) -> Dyadic {
        let (a, b, exponent) = self.aligned(other);
        Dyadic { mantissa: a + b, exponent }
    }
}

impl Sub for &Dyadic {
    type Output = Dyadic;
    fn sub(self, other: Self) -> Dyadic {
        let (a, b, exponent) = self.aligned(other);
        Dyadic { mantissa: a - b, exponent }
    }
}

impl Mul for &Dyadic {
    type Output = Dyadic;
    fn mul(self, other: Self) -> Dyadic {
        Dyadic { mantissa: &self.mantissa * &other.mantissa, exponent: self.exponent + other.exponent }
    }
}

impl Neg for &Dyadic {
    type Output = Dyadic;
    fn neg(self) -> Dyadic {
        Dyadic { mantissa: -&self.mantissa, exponent: self.exponent }
    }
}

macro_rules! by_value {
    ($($operation:ident $method:ident),+) => {
        $(impl $operation for Dyadic {
            type Output = Dyadic;
            fn $method(self, other: Self) -> Dyadic {
                (&self).$method(&other)
            }
        })+
    };
}
by_value!(Add add, Sub sub, Mul mul);

impl Neg for Dyadic {
    type Output = Self;
    fn neg(self) -> Self {
        -&self
    }
}

impl PartialEq for Dyadic {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Dyadic {}

impl PartialOrd for Dyadic {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Dyadic {
    fn cmp(&self, other: &Self) -> Ordering {
        let (a, b, _) = self.aligned(other);
        a.cmp(&b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn every_f64_comes_back() {
        let mut random = Random::new(1, 0);
        let special = [0.0, 1.0, -1.5, f64::MAX, f64::MIN_POSITIVE, 5e-324, -2.5e-310, 0.1];
        let drawn = (0..2000).map(|_| f64::from_bits(random.bits())).filter(|x| x.is_finite());
        for x in special.into_iter().chain(drawn) {
            assert_eq!(Dyadic::new(x).to_f64(), x, "{x:e}");
        }
    }

    #[test]
    fn sums_and_products_are_exact_where_f64_is_not() {
        let [big, small] = [1e300, 1e-300].map(Dyadic::new);
        assert_eq!(&(&big + &small) - &big, small);
        // (1 + 2^-52)^2 - 1 - 2^-51 = 2^-104.
        let x = Dyadic::new(1.0 + f64::EPSILON);
        let rest = &x * &x - Dyadic::new(1.0) - Dyadic::new(f64::EPSILON).scaled(1);
        assert_eq!(rest, Dyadic::new(1.0).scaled(-104));
        assert!(Dyadic::new(-1.0) < Dyadic::ZERO && Dyadic::new(0.1) > Dyadic::new(0.1f32.next_down().into()));
    }

    #[test]
    fn square_roots_are_rounded_down_at_the_bits_asked_for() {
        for (x, bits) in [(2.0, 10), (3.0, 200), (0.1, 64), (4.0, 5), (5e-324, 80), (1e300, 8), (0.0, 9)] {
            let (x, root) = (Dyadic::new(x), Dyadic::new(x).square_root(bits));
            assert!(&root * &root <= x);
            // The next number of that many bits is too large.
            let step = &root + &root.scaled(-(bits as i64) + 1);
            assert!(&step * &step > x || x == Dyadic::ZERO, "{x:?}");
        }
        assert_eq!(Dyadic::new(6.25).square_root(3), Dyadic::new(2.5));
    }

    #[test]
    fn quotients_round_as_f64_division_does() {
        let mut random = Random::new(2, 0);
        for _ in 0..5000 {
            // Exponents near the ends reach the subnormal range and infinity.
            let mut draw = || f64::from_bits(random.bits());
            let (a, b) = (draw(), draw());
            if a.is_finite() && b.is_finite() && b != 0.0 {
                let ours = quotient(&Dyadic::new(a), &Dyadic::new(b));
                assert_eq!(ours.to_bits() << 1, (a / b).to_bits() << 1, "{a:e} / {b:e}: {ours:e}");
            }
        }
        for (a, b) in [(1.0, 3.0), (-2.0, 3.0), (5e-324, 2.0), (1.5e-323, 2.0), (f64::MAX, 0.5)] {
            assert_eq!(quotient(&Dyadic::new(a), &Dyadic::new(b)), a / b, "{a:e} / {b:e}");
        }
    }
}
