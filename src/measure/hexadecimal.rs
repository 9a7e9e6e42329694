//! Hexadecimal floats: exact and short, for failures that shall be typed in again.

/// A number as `0x1.8p+1`: every bit of it, no more. `inf`, `-inf` and `nan` where it is not finite.
///
/// ```
/// use whitted::measure::hexadecimal::hexadecimal;
/// assert_eq!(hexadecimal(3.0), "0x1.8p+1");
/// assert_eq!(hexadecimal(-0.1), "-0x1.99999ap-4");
/// ```
pub fn hexadecimal(x: f32) -> String {
    if x.is_nan() {
        return "nan".into();
    }
    let sign = if x.is_sign_negative() { "-" } else { "" };
    if x.is_infinite() {
        return format!("{sign}inf");
    }
    let bits = x.to_bits();
    let (fraction, exponent) = (bits & 0x7f_ffff, (bits >> 23 & 0xff) as i32);
    let (first, exponent) = match (exponent, fraction) {
        (0, 0) => (0, 0),
        (0, _) => (0, -126),
        _ => (1, exponent - 127),
    };
    // 23 bits and one more make six digits.
    let digits = format!("{:06x}", fraction << 1);
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
        let drawn = (0..2000).map(|_| f32::from_bits(random.bits() as u32)).filter(|x| x.is_finite());
        for x in [0.0, -0.0, 1.0, f32::MAX, f32::MIN_POSITIVE, 1e-45, -1e-40].into_iter().chain(drawn) {
            let text = hexadecimal(x);
            let read = hexf_parse::parse_hexf32(&text, false).unwrap();
            assert_eq!(read.to_bits(), x.to_bits(), "{x:e}: {text}");
        }
        assert_eq!(hexadecimal(f32::INFINITY), "inf");
        assert_eq!(hexadecimal(-1e-45), "-0x0.000002p-126");
    }
}
