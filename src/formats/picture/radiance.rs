//! Radiance HDR: three mantissas of 8 bits that share an exponent.
//!
//! G. Ward, "Real Pixels", Graphics Gems II, 1991, with the run lengths of Radiance 2.0. Mantissas are rounded to the
//! nearest, since most readers take them as they are; Radiance itself cuts them and adds half a step when it reads.

use std::io::{Result, Write};

/// Writes linear colours, rows from the top. Negative values and NaN become 0, values beyond 1.7e38 that.
pub fn write(out: &mut dyn Write, width: usize, height: usize, colors: &[[f32; 3]]) -> Result<()> {
    write!(out, "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")?;
    // Readers know rows of run lengths by their first four bytes, which rows of other widths cannot have.
    let has_runs = (8..0x8000).contains(&width);
    let mut row = Vec::new();
    for colors in colors.chunks_exact(width) {
        let pixels: Vec<[u8; 4]> = colors.iter().map(|&color| rgbe(color)).collect();
        row.clear();
        if has_runs {
            row.extend([2, 2, (width >> 8) as u8, width as u8]);
            for channel in 0..4 {
                let bytes: Vec<u8> = pixels.iter().map(|pixel| pixel[channel]).collect();
                encode_runs(&bytes, &mut row);
            }
        } else {
            row.extend_from_slice(pixels.as_flattened());
        }
        out.write_all(&row)?;
    }
    Ok(())
}

/// A colour as mantissas and exponent: a channel is `mantissa / 256 * 2^(exponent - 128)`.
fn rgbe(color: [f32; 3]) -> [u8; 4] {
    /// 255 / 256 * 2^127.
    const LARGEST: f32 = 1.694_742_7e38;
    let color = color.map(|value| if value > 0.0 { value.min(LARGEST) } else { 0.0 });
    let largest = color[0].max(color[1]).max(color[2]);
    // Exponent 1 is the least that is not black; its largest mantissa stands for less than 2^-127.
    if largest < f32::MIN_POSITIVE {
        return [0; 4];
    }
    // `largest` lies in [2^(e - 1), 2^e): its mantissa is at least 128. Rounding may need one power more.
    let mut exponent = (largest.to_bits() >> 23) as i32 - 126;
    let mantissa = |value: f32, exponent: i32| libm::floor(libm::scalbn(f64::from(value), 8 - exponent) + 0.5);
    if mantissa(largest, exponent) > 255.0 {
        exponent += 1;
    }
    let [r, g, b] = color.map(|value| mantissa(value, exponent) as u8);
    [r, g, b, (exponent + 128) as u8]
}

/// Appends runs (128 + length, value) and stretches of other values (length, values).
fn encode_runs(bytes: &[u8], out: &mut Vec<u8>) {
    let run_at = |at: usize| bytes[at..].iter().take(127).take_while(|&&byte| byte == bytes[at]).count();
    let mut at = 0;
    while at < bytes.len() {
        let run = run_at(at);
        // A run of two takes as much room as it saves.
        if run > 2 {
            out.extend([128 + run as u8, bytes[at]]);
            at += run;
        } else {
            let start = at;
            while at < bytes.len() && at - start < 128 && run_at(at) <= 2 {
                at += 1;
            }
            out.push((at - start) as u8);
            out.extend_from_slice(&bytes[start..at]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_keep_eight_bits_of_the_largest_channel() {
        for color in [[1.0, 0.5, 0.25], [0.1, 0.7, 123.4], [1e-30, 3e-31, 0.0], [1.6e38, 1.0, 1.0], [0.999_9, 0.0, 0.5]]
        {
            let [r, g, b, e] = rgbe(color);
            let largest = color.iter().copied().fold(0.0, f32::max);
            for (mantissa, value) in [r, g, b].into_iter().zip(color) {
                let decoded = f64::from(mantissa) / 256.0 * 2f64.powi(i32::from(e) - 128);
                assert!((decoded - f64::from(value)).abs() <= f64::from(largest) / 256.0, "{color:?}: {decoded}");
            }
        }
        assert_eq!(rgbe([1.0, 0.5, 0.25]), [128, 64, 32, 129]);
        assert_eq!(rgbe([f32::NAN, -1.0, 0.0]), [0; 4]);
        assert_eq!(rgbe([f32::INFINITY, 0.0, 0.0]), [255, 0, 0, 255]);
    }

    #[test]
    fn runs_and_stretches_are_read_back() {
        for width in [1usize, 7, 8, 300] {
            // Powers of two are exact; some columns repeat, some do not.
            let color = |x: usize| if x % 50 < 30 { [2.0, 1.0, 0.0] } else { [(1 << (x % 7)) as f32, 64.0, 0.0] };
            let colors: Vec<_> = (0..2 * width).map(|i| color(i % width)).collect();
            let mut bytes = Vec::new();
            write(&mut bytes, width, 2, &colors).unwrap();
            let decoded = image::load_from_memory_with_format(&bytes, image::ImageFormat::Hdr).unwrap().into_rgb32f();
            assert_eq!(decoded.as_raw().as_slice(), colors.as_flattened(), "{width}");
        }
    }
}
