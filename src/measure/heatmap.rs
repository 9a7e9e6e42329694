//! Differences as a picture in false colours.

use crate::measure::picture_difference::PictureDifference;
use crate::render::{Film, RenderStats};
use crate::scene::{FilmSettings, Transfer};

/// The difference that has the first colour; smaller ones have it too. Six decades below the whole range of a picture.
pub const SMALLEST: f64 = 1e-6;

/// What is equal.
const EQUAL: [f32; 3] = [0.0, 0.0, 0.0];
/// What is not finite in one of the pictures.
const NOT_FINITE: [f32; 3] = [1.0, 0.0, 1.0];
/// One colour a decade from [`SMALLEST`] to 1, ever lighter, so that the order is seen without colours too.
const DECADES: [[f32; 3]; 7] = [
    [0.10, 0.10, 0.44],
    [0.13, 0.30, 0.66],
    [0.10, 0.52, 0.55],
    [0.25, 0.68, 0.30],
    [0.88, 0.68, 0.12],
    [0.98, 0.55, 0.42],
    [1.00, 1.00, 1.00],
];

/// The colour of a difference, values as PNG stores them: black where nothing differs, then by the logarithm from dark
/// blue at 1e-6 over teal, green and yellow to white at 1; magenta where it is NaN.
///
/// The scale is the same for all pictures, so that they can be laid side by side.
pub fn color(difference: f64) -> [f32; 3] {
    if difference.is_nan() {
        return NOT_FINITE;
    }
    if difference <= 0.0 {
        return EQUAL;
    }
    let last = (DECADES.len() - 1) as f64;
    let decade = libm::log10(difference / SMALLEST).clamp(0.0, last);
    let below = (decade.floor() as usize).min(DECADES.len() - 2);
    let share = (decade - below as f64) as f32;
    std::array::from_fn(|i| DECADES[below][i] * (1.0 - share) + DECADES[below + 1][i] * share)
}

/// The map of a difference as a picture to save; formats of whole numbers hold its colours as they are.
pub fn picture(difference: &PictureDifference) -> Film {
    let (width, height) = (difference.width as u32, difference.height as u32);
    Film {
        width,
        height,
        crop: None,
        color: difference.map.iter().map(|&value| color(f64::from(value))).collect(),
        alpha: None,
        aovs: Vec::new(),
        settings: FilmSettings { width, height, transfer: Transfer::Linear, ..FilmSettings::default() },
        coverage: None,
        complete: true,
        stats: RenderStats::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_get_lighter_with_the_difference() {
        let light = |x: f64| color(x).iter().sum::<f32>();
        assert_eq!((color(0.0), color(f64::NAN), color(2.0)), (EQUAL, NOT_FINITE, DECADES[6]));
        assert_eq!((color(1e-9), color(1e-6)), (DECADES[0], DECADES[0]));
        let steps: Vec<f32> = (0..=60).map(|i| light(10f64.powf(-6.0 + 0.1 * f64::from(i)))).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]), "{steps:?}");
        assert!(light(1e-6) > light(0.0));
    }
}
