//! Small pictures: rectangles, a few letters, PNG.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};

/// Red, green, blue, sRGB-encoded.
pub type Color = [u8; 3];

/// Width and height of a glyph, in dots.
pub const GLYPH: (u32, u32) = (5, 7);

/// A picture; rows from the top.
pub struct Picture {
    image: RgbImage,
}

impl Picture {
    /// A picture of one colour.
    pub fn new(width: u32, height: u32, color: Color) -> Self {
        Self { image: RgbImage::from_pixel(width, height, Rgb(color)) }
    }

    /// A picture from a function of column and row.
    pub fn from_fn(width: u32, height: u32, mut color: impl FnMut(u32, u32) -> Color) -> Self {
        Self { image: RgbImage::from_fn(width, height, |x, y| Rgb(color(x, y))) }
    }

    /// Fills a rectangle whose upper left corner is (x, y).
    pub fn fill(&mut self, [x, y]: [u32; 2], [width, height]: [u32; 2], color: Color) {
        for row in y..y + height {
            for column in x..x + width {
                self.image.put_pixel(column, row, Rgb(color));
            }
        }
    }

    /// Writes text with its upper left corner at (x, y); every dot is a square of `dot` pixels.
    pub fn text(&mut self, [x, y]: [u32; 2], dot: u32, text: &str, color: Color) {
        for (number, letter) in (0..).zip(text.chars()) {
            for (row, bits) in (0..).zip(glyph(letter)) {
                for column in (0..GLYPH.0).filter(|column| bits >> (GLYPH.0 - 1 - column) & 1 == 1) {
                    let left = x + (number * (GLYPH.0 + 1) + column) * dot;
                    self.fill([left, y + row * dot], [dot; 2], color);
                }
            }
        }
    }

    /// The picture as a PNG file.
    pub fn png(&self) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        self.image.write_to(&mut bytes, ImageFormat::Png).expect("writing to memory does not fail");
        bytes.into_inner()
    }
}

/// Squares of two colours, eight by eight: one repeat makes a floor.
pub fn checker() -> Picture {
    const LIGHT: Color = [226, 222, 212];
    const DARK: Color = [58, 62, 70];
    Picture::from_fn(256, 256, |x, y| if (x / 32 + y / 32) % 2 == 0 { LIGHT } else { DARK })
}

/// Seven rows of five dots, the leftmost in the highest of five bits.
///
/// # Panics
/// For characters that no picture here needs.
fn glyph(letter: char) -> [u8; 7] {
    match letter {
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
        '3' => [0b11110, 0b00001, 0b00001, 0b01110, 0b00001, 0b00001, 0b11110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        'A' => [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'B' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10001, 0b10001, 0b11110],
        'C' => [0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110],
        'E' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111],
        'F' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000],
        'G' => [0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110],
        'H' => [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        'I' => [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'K' => [0b10001, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0b10001],
        'L' => [0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111],
        'N' => [0b10001, 0b11001, 0b10101, 0b10101, 0b10011, 0b10001, 0b10001],
        'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
        'R' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001],
        'S' => [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110],
        'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
        _ => panic!("no glyph for {letter:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_f_has_its_bars_at_the_top_and_its_stem_on_the_left() {
        let mut picture = Picture::new(16, 16, [0; 3]);
        picture.text([1, 1], 2, "F", [255; 3]);
        let lit = |x: u32, y: u32| picture.image.get_pixel(x, y).0 == [255; 3];
        assert!(lit(1, 1) && lit(10, 2) && lit(1, 14), "corners of the glyph");
        assert!(!lit(10, 14) && !lit(0, 0) && !lit(11, 1) && !lit(1, 15), "beside it");
    }

    #[test]
    fn the_checker_is_a_png_of_sixty_four_squares() {
        let image = image::load_from_memory(&checker().png()).unwrap().to_rgb8();
        assert_eq!(image.dimensions(), (256, 256));
        assert_ne!(image.get_pixel(0, 0), image.get_pixel(32, 0));
        assert_eq!(image.get_pixel(0, 0), image.get_pixel(255, 255));
    }
}
