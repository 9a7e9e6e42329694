//! The two kinds of numbers that the oracle's formulas are evaluated in: exact ones, and f64 with a bound on what
//! rounding has done to it. One formula serves both, so that a filter can never disagree with what it filters for.

use std::cmp::Ordering;

use crate::measure::dyadic::Dyadic;

/// Numbers with sums, differences and products.
pub(super) trait Number: Clone {
    /// The number itself; `x` is finite.
    fn exact(x: f64) -> Self;
    /// The sum.
    fn plus(&self, other: &Self) -> Self;
    /// The difference.
    fn minus(&self, other: &Self) -> Self;
    /// The product.
    fn times(&self, other: &Self) -> Self;
    /// The sign of the true value, if it is certain.
    fn sign(&self) -> Option<Ordering>;
}

impl Number for Dyadic {
    fn exact(x: f64) -> Self {
        Self::new(x)
    }
    fn plus(&self, other: &Self) -> Self {
        self + other
    }
    fn minus(&self, other: &Self) -> Self {
        self - other
    }
    fn times(&self, other: &Self) -> Self {
        self * other
    }
    fn sign(&self) -> Option<Ordering> {
        Some(Self::sign(self))
    }
}

/// A true value known to lie within `error` of `value` (running error analysis: Wilkinson 1986).
///
/// A sum's rounding error is found exactly (Knuth's two-sum), so that sums which f64 holds stay exact; a product's is
/// bounded by half an ulp. The bound itself is computed in f64 from terms that are not negative: at most seven
/// operations in a row, whose rounding [`Self::MARGIN`] covers, and [`Self::TINY`] covers underflow. Overflow makes the
/// bound infinite or NaN, and then nothing is certain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounded {
    value: f64,
    error: f64,
}

impl Rounded {
    /// Unit roundoff of f64.
    const UNIT: f64 = f64::EPSILON / 2.0;
    /// More than what seven roundings take off a sum of positive terms.
    const MARGIN: f64 = 1.0 + 16.0 * Self::UNIT;
    /// More than what underflow takes off a product and its bound: each loses at most the least subnormal, 5e-324.
    const TINY: f64 = 1e-300;

    /// The least and the greatest that the true value can be; infinite where nothing is known.
    pub(super) fn range(&self) -> (f64, f64) {
        if !(self.error < f64::INFINITY) {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        ((self.value - self.error).next_down(), (self.value + self.error).next_up())
    }

    /// The quotient; nothing is known of it where the divisor may be 0.
    pub(super) fn over(&self, divisor: &Self) -> Self {
        let least = (divisor.value.abs() - divisor.error).next_down();
        if !(least > 0.0) {
            return Self { value: 0.0, error: f64::INFINITY };
        }
        // |n/d - q| <= (|n - n'| + |q| |d - d'|) / |d|, and q is rounded once.
        let value = self.value / divisor.value;
        let error = (self.error + value.abs() * divisor.error) / least + Self::UNIT * value.abs();
        Self { value, error: error * Self::MARGIN + Self::TINY }
    }
}

impl Number for Rounded {
    #[inline]
    fn exact(x: f64) -> Self {
        Self { value: x, error: 0.0 }
    }
    #[inline]
    fn plus(&self, other: &Self) -> Self {
        let value = self.value + other.value;
        let shared = value - self.value;
        let lost = (self.value - (value - shared)) + (other.value - shared);
        Self { value, error: (self.error + other.error + lost.abs()) * Self::MARGIN }
    }
    #[inline]
    fn minus(&self, other: &Self) -> Self {
        self.plus(&Self { value: -other.value, error: other.error })
    }
    #[inline]
    fn times(&self, other: &Self) -> Self {
        let is_zero = |x: &Self| x.value == 0.0 && x.error == 0.0;
        if is_zero(self) || is_zero(other) {
            return Self { value: 0.0, error: 0.0 };
        }
        let value = self.value * other.value;
        let inherited = self.value.abs() * other.error + other.value.abs() * self.error + self.error * other.error;
        Self { value, error: (inherited + Self::UNIT * value.abs()) * Self::MARGIN + Self::TINY }
    }
    #[inline]
    fn sign(&self) -> Option<Ordering> {
        if self.value > self.error {
            Some(Ordering::Greater)
        } else if -self.value > self.error {
            Some(Ordering::Less)
        } else if self.error == 0.0 {
            Some(Ordering::Equal)
        } else {
            None
        }
    }
}

/// Three numbers.
pub(super) type Vector<N> = [N; 3];

/// The vector itself; the components are finite.
pub(super) fn vector<N: Number>(v: impl Into<glam::DVec3>) -> Vector<N> {
    v.into().to_array().map(N::exact)
}

/// `a + b`.
pub(super) fn sum<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    std::array::from_fn(|k| a[k].plus(&b[k]))
}

/// `a - b`.
pub(super) fn difference<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    std::array::from_fn(|k| a[k].minus(&b[k]))
}

/// The dot product.
pub(super) fn dot<N: Number>(a: &Vector<N>, b: &Vector<N>) -> N {
    a[0].times(&b[0]).plus(&a[1].times(&b[1])).plus(&a[2].times(&b[2]))
}

/// The cross product.
pub(super) fn cross<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    let component = |i: usize, j: usize| a[i].times(&b[j]).minus(&a[j].times(&b[i]));
    [component(1, 2), component(2, 0), component(0, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn rounded_numbers_enclose_the_exact_ones() {
        let mut random = Random::new(11, 0);
        let (mut certain, mut total) = (0, 0);
        for round in 0..3000 {
            // Numbers of a few bits cancel often, others hardly ever; exponents far apart lose digits.
            let mut draw = || {
                let x = if round % 2 == 0 { random.between(-4.0, 4.0).round() } else { random.between(-1.0, 1.0) };
                libm::ldexp(x, random.below(60) as i32 - 30)
            };
            let inputs: [f64; 9] = std::array::from_fn(|_| draw());
            fn volume<N: Number>(k: &[f64; 9]) -> N {
                let at = |i: usize| -> Vector<N> { [k[i], k[i + 1], k[i + 2]].map(N::exact) };
                dot(&at(0), &cross(&sum(&at(3), &at(0)), &difference(&at(6), &at(0))))
            }
            let (truth, rounded) = (volume::<Dyadic>(&inputs), volume::<Rounded>(&inputs));
            let (low, high) = rounded.range();
            assert!(Dyadic::new(low) <= truth && truth <= Dyadic::new(high), "{inputs:?}");
            total += 1;
            if let Some(sign) = rounded.sign() {
                assert_eq!(sign, truth.sign(), "{inputs:?}");
                certain += 1;
            }
        }
        assert!(certain * 2 > total, "{certain} of {total}");
    }

    #[test]
    fn quotients_are_enclosed_and_never_divide_by_what_may_be_zero() {
        let third = Rounded::exact(1.0).over(&Rounded::exact(3.0));
        let (low, high) = third.range();
        assert!(low < high && low * 3.0 <= 1.0 && high * 3.0 >= 1.0 && high - low < 1e-15);
        let vague = Rounded { value: 1e-20, error: 1e-19 };
        assert_eq!(Rounded::exact(1.0).over(&vague).range(), (f64::NEG_INFINITY, f64::INFINITY));
        assert_eq!(vague.sign(), None);
        assert_eq!(Rounded::exact(f64::MAX).times(&Rounded::exact(2.0)).sign(), None);
    }
}
