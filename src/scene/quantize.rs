//! Linear values to bytes, exactly and quickly.

use std::sync::LazyLock;

use crate::scene::Transfer;
use crate::scene::texture::linear_to_srgb;

/// The least value that the sRGB curve maps to each byte from 1 on.
///
/// The curve needs a `pow` a value. Its bytes rise with the value: two neighbouring f32 differ by 6e-8 and their images
/// by 2e-8, each of which is computed to 1e-15. So a byte is the number of these bounds that are not above the value.
static SRGB_BOUNDS: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|index| {
        // Bits of floats from 0 to 1 are ordered as the floats are.
        let (mut below, mut reached) = (0f32.to_bits(), 1f32.to_bits());
        while below + 1 < reached {
            let middle = below.midpoint(reached);
            if usize::from(srgb_byte(f32::from_bits(middle))) > index {
                reached = middle;
            } else {
                below = middle;
            }
        }
        f32::from_bits(reached)
    })
});

/// The definition: `encoded * 255 + 0.5`, cut, for values in [0, 1].
fn srgb_byte(linear: f32) -> u8 {
    (linear_to_srgb(f64::from(linear)) * 255.0 + 0.5) as u8
}

/// A linear value as a byte: clamped to [0, 1], encoded, rounded to the nearest. NaN is 0.
pub fn byte(linear: f32, transfer: Transfer) -> u8 {
    match transfer {
        // Comparisons with NaN are false, so that NaN reaches no bound.
        Transfer::Srgb => SRGB_BOUNDS.partition_point(|&bound| bound <= linear) as u8,
        // The conversion saturates and makes NaN 0.
        Transfer::Linear => (f64::from(linear) * 255.0 + 0.5) as u8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_curve() {
        let at_bounds = SRGB_BOUNDS.iter().flat_map(|bound| [bound.next_down(), *bound, bound.next_up()]);
        let spread = (0..=0x3f80_0000u32).step_by(1021).map(f32::from_bits);
        for value in at_bounds.chain(spread).filter(|&value| value <= 1.0) {
            assert_eq!(byte(value, Transfer::Srgb), srgb_byte(value), "{value:e}");
        }
        assert_eq!(byte(0.5, Transfer::Srgb), 188, "the known value of middle grey");
    }

    #[test]
    fn out_of_range_and_nan() {
        for transfer in [Transfer::Srgb, Transfer::Linear] {
            for (value, expected) in [
                (f32::NAN, 0),
                (-0.0, 0),
                (-1.0, 0),
                (f32::NEG_INFINITY, 0),
                (1.0, 255),
                (7.0, 255),
                (f32::INFINITY, 255),
            ] {
                assert_eq!(byte(value, transfer), expected, "{value} {transfer:?}");
            }
        }
        assert_eq!(byte(0.5, Transfer::Linear), 128);
    }
}
