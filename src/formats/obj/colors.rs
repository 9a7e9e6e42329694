//! Colours of vertices: `v x y z r g b`.

use rayon::prelude::*;

use crate::formats::{Ledger, Treatment};
use crate::scene::texture::srgb_to_linear;

/// The colour of vertices that have none.
pub(super) const WHITE: [u16; 4] = [u16::MAX; 4];

/// The colours of positions as the mesh has them; `None` where there are none. A colour of NaN is one that is missing or
/// could not be read.
///
/// They are encoded in sRGB, as Blender and MeshLab write them, from 0 to 1. Where one is above 1 and none above 255 all are
/// taken for bytes.
pub(super) fn linear(colors: Vec<[f32; 3]>, ledger: &mut Ledger) -> Option<Vec<[u16; 4]>> {
    if colors.is_empty() {
        return None;
    }
    let largest = colors.as_flattened().iter().copied().fold(0.0, f32::max);
    let has_bytes = largest > 1.0 && largest <= 255.0;
    let whole = if has_bytes { 255.0 } else { 1.0 };
    let is_missing = |color: &&[f32; 3]| color.iter().any(|value| value.is_nan());
    let is_outside = |color: &&[f32; 3]| color.iter().any(|value| *value < 0.0 || *value > whole);
    let missing = colors.iter().filter(is_missing).count() as u64;
    let outside = colors.iter().filter(is_outside).count() as u64;
    ledger.note(Treatment::Honoured, "vertex colours (v with 6 numbers)", colors.len() as u64 - missing);
    if has_bytes {
        ledger.note(Treatment::Approximated, "vertex colours up to 255: taken for bytes", 1);
    }
    if missing > 0 {
        ledger.note(Treatment::Warning, "v without a colour that can be read beside others: white", missing);
    }
    if outside > 0 {
        ledger.note(Treatment::Warning, "vertex colour outside 0 to 1: brought within", outside);
    }
    let fraction = |value: f32| {
        let encoded = f64::from(value / whole).clamp(0.0, 1.0);
        (srgb_to_linear(encoded) * f64::from(u16::MAX) + 0.5) as u16
    };
    let color = |color: &[f32; 3]| {
        let [r, g, b] = color.map(fraction);
        if is_missing(&color) { WHITE } else { [r, g, b, u16::MAX] }
    };
    Some(colors.par_iter().map(color).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_srgb() {
        let mut ledger = Ledger::default();
        let linear = linear(vec![[0.0, 0.5, 1.0], [f32::NAN; 3], [-1.0, 0.02, 0.04]], &mut ledger).unwrap();
        // IEC 61966-2-1: 0.5 is ((0.5 + 0.055) / 1.055)^2.4 = 0.21404114, and up to 0.04045 the curve is x / 12.92.
        assert_eq!(linear[0], [0, 14_027, 65_535, 65_535]);
        assert_eq!(linear[1], WHITE);
        assert_eq!(linear[2], [0, 101, 203, 65_535]);
        assert_eq!(ledger.entries().map(|entry| entry.2).collect::<Vec<_>>(), [2, 1, 1]);
    }

    #[test]
    fn colours_up_to_255_are_bytes() {
        let mut ledger = Ledger::default();
        let bytes = linear(vec![[255.0, 127.5, 0.0], [1.0, 2.0, 3.0]], &mut ledger).unwrap();
        assert_eq!(bytes[0], [65_535, 14_027, 0, 65_535]);
        assert!(ledger.entries().any(|entry| entry.0 == Treatment::Approximated));
        // Beyond 255 they are neither.
        let large = linear(vec![[256.0, 0.5, 0.0]], &mut ledger).unwrap();
        assert_eq!(large[0], [65_535, 14_027, 0, 65_535]);
        assert_eq!(linear(vec![], &mut ledger), None);
    }
}
