//! Numbers as people like them.

use glam::DVec3;

/// The number with few digits that rounding has moved by some ulps; else itself.
pub fn tidy(x: f64) -> f64 {
    let near = format!("{x:.12e}").parse().unwrap_or(x);
    // -0 is of no use to people.
    if f64::abs(near - x) <= 16.0 * f64::EPSILON * x.abs().max(1.0) { near + 0.0 } else { x }
}

/// [`tidy`] for each number.
pub fn tidy_vector(v: DVec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(tidy))
}

/// A length of one digit, 1, 2 or 5, near to another.
pub fn round_size(size: f64) -> f64 {
    if !(size.is_finite() && size > 0.0) {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(size)));
    let digit = [1.0, 2.0, 5.0, 10.0].into_iter().min_by(|a, b| {
        let off = |digit: f64| libm::log(size / (digit * power)).abs();
        off(*a).total_cmp(&off(*b))
    });
    digit.unwrap_or(1.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_noise_goes_and_digits_stay() {
        assert_eq!(tidy(0.1 + 0.2), 0.3);
        assert_eq!(tidy(29.999_999_999_999_996), 30.0);
        assert_eq!(tidy(1.0 / 3.0), 1.0 / 3.0);
        assert_eq!(tidy(1e-17).to_bits(), 1e-17f64.to_bits());
    }

    #[test]
    fn sizes_are_round() {
        for (size, round) in
            [(1.2, 1.0), (1.8, 2.0), (4.0, 5.0), (8.0, 10.0), (0.012, 0.01), (0.0, 1.0), (f64::NAN, 1.0)]
        {
            assert!((round_size(size) / round - 1.0).abs() < 1e-12, "{size}: {}", round_size(size));
        }
    }
}
