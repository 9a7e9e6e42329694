//! Hexadecimal floats: exact and short, for failures that shall be typed in again.

/// A number as `0x1.8p+1`: every bit of it, no more. `inf`, `-inf` and `nan` where it is not finite.
///
/// ```
/// use whitted::measure::hexadecimal::hexadecimal;
/// assert_eq!(hexadecimal(3.0), "0x1.8p+1");
/// assert_eq!(hexadecimal(-0.1), "-0x1.99999ap-4");
/// ```
pub fn hexadecimal(x: f32) -> String {
    let bits = x.to_bits();
    let (fraction, exponent) = (bits & 0x7f_ffff, (bits >> 23 & 0xff) as i32);
    let (first, exponent) = match (exponent, fraction) {
        (0, 0) => (0, 0),
        (0, _) => (0, -126),
        _ => (1, exponent - 127),
    };
    // 23 bits and one more make six digits.
    text(x.into(), first, &format!("{:06x}", fraction << 1), exponent)
}

/// The same of an f64, as [`ray_file`](super::ray_file) reads it.
///
/// ```
/// use whitted::measure::hexadecimal::hexadecimal_f64;
/// assert_eq!(hexadecimal_f64(-0.1), "-0x1.999999999999ap-4");
/// ```
pub fn hexadecimal_f64(x: f64) -> String {
    let bits = x.to_bits();
    let (fraction, exponent) = (bits & 0xf_ffff_ffff_ffff, (bits >> 52 & 0x7ff) as i32);
    let (first, exponent) = match (exponent, fraction) {
        (0, 0) => (0, 0),
        (0, _) => (0, -1022),
        _ => (1, exponent - 1023),
    };
    text(x, first, &format!("{fraction:013x}"), exponent)
}

/// A number by its digits, unless it is not finite.
fn text(x: f64, first: u32, digits: &str, exponent: i32) -> String {
    if x.is_nan() {
        return "nan".into();
    }
    let sign = if x.is_sign_negative() { "-" } else { "" };
    if x.is_infinite() {
        return format!("{sign}inf");
    }
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x{first}{point}{digits}p{exponent:+}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    #[test]
    fn every_number_reads_back() {
        let mut random = Random::new(3, 0);
        let drawn: Vec<f32> =
            (0..2000).map(|_| f32::from_bits(random.bits() as u32)).filter(|x| x.is_finite()).collect();
        for x in [0.0, -0.0, 1.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, -1e-40].into_iter().chain(drawn) {
            let text = hexadecimal(x);
            let read = hexf_parse::parse_hexf32(&text, false).unwrap();
            assert_eq!(read.to_bits(), x.to_bits(), "{x:e}: {text}");
        }
        for x in (0..2000).map(|_| f64::from_bits(random.bits())).filter(|x| x.is_finite()).chain([0.0, 5e-324]) {
            let text = hexadecimal_f64(x);
            assert_eq!(hexf_parse::parse_hexf64(&text, false).unwrap().to_bits(), x.to_bits(), "{x:e}: {text}");
        }
        assert_eq!((hexadecimal(f32::INFINITY), hexadecimal_f64(-f64::INFINITY)), ("inf".into(), "-inf".into()));
        assert_eq!(hexadecimal(-1e-45), "-0x0.000002p-126");
    }
}
