//! Pictures in: what textures and background images are made of.
//!
//! PNG, JPEG, WebP, TGA and BMP become 8-bit texels in sRGB, 16-bit channels rounded to the nearest; Radiance HDR and
//! OpenEXR become linear floats. Colour profiles and orientation tags are not looked at, as glTF prescribes.

use std::io::Cursor;
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude::{ReadChannels as _, ReadLayers as _};
use image::error::ImageError;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use crate::error::{Error, Result};
use crate::formats::Limits;
use crate::scene::Texture;
use crate::scene::texture::Texels;

/// Formats that are read, for messages.
const ACCEPTED: &str = "accepted are PNG, JPEG, WebP, TGA, BMP, HDR and EXR";

/// Most texels along a side.
const LARGEST_SIDE: u32 = 1 << 16;

/// What an infinite texel becomes: the largest finite half float, since halves that overflowed are where infinities in
/// EXR files come from. Mixed with its neighbours it stays finite.
const LARGEST_TEXEL: f32 = 65504.0;

/// Reads an image; it repeats along both axes and is filtered linearly.
///
/// The format is told by the content; TGA, which has no mark, by the suffix.
///
/// # Errors
/// Names the file and the cause: it cannot be read, is not an accepted format, is malformed, or is larger than 65536
/// texels along a side or than the limits.
pub fn read_texture(path: &Path, limits: &Limits) -> Result<Texture> {
    let bytes = read_bytes(path, limits)?;
    decode_texture(&bytes, &path.display().to_string(), limits).map_err(|error| error.at_path(path))
}

/// Reads an image file as it is, within the limit of size.
pub(super) fn read_bytes(path: &Path, limits: &Limits) -> Result<Vec<u8>> {
    if path.is_dir() {
        return Err(Error::file("is a folder, not an image").at_path(path).remedy(ACCEPTED));
    }
    limits.read_file(path)
}

/// Decodes an image that is in memory; `name` is for messages, and its suffix tells TGA.
///
/// # Errors
/// As [`read_texture`], without the path.
pub fn decode_texture(bytes: &[u8], name: &str, limits: &Limits) -> Result<Texture> {
    let (width, height, texels) = match format_of(bytes, name)? {
        ImageFormat::OpenExr => decode_exr(bytes, limits)?,
        format => decode_with_image(bytes, format, limits)?,
    };
    if width == 0 || height == 0 {
        return Err(Error::file("the image has no texels"));
    }
    Ok(Texture::new(name, width, height, texels))
}

/// The format by content, else by suffix.
pub(super) fn format_of(bytes: &[u8], name: &str) -> Result<ImageFormat> {
    use ImageFormat::{Bmp, Hdr, Jpeg, OpenExr, Png, Tga, WebP};
    match image::guess_format(bytes) {
        Ok(format @ (Png | Jpeg | WebP | Bmp | Hdr | OpenExr)) => Ok(format),
        _ if Path::new(name).extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("tga")) => Ok(Tga),
        // Some writers of HDR files begin with another word than the customary one.
        _ if bytes.starts_with(b"#?") => Ok(Hdr),
        Ok(other) => {
            let suffix = other.extensions_str().first().copied().unwrap_or("this").to_uppercase();
            Err(Error::unsupported(format!("{suffix} images are not supported")).remedy(ACCEPTED))
        }
        Err(_) if bytes.is_empty() => Err(Error::file("the image file is empty").remedy(ACCEPTED)),
        Err(_) => Err(Error::file("not an image of a known format").remedy(ACCEPTED)),
    }
}

/// Decodes any format but EXR, within the limits of size.
pub(super) fn decode_image(bytes: &[u8], format: ImageFormat, limits: &Limits) -> Result<DynamicImage> {
    let failed = |cause: ImageError| match cause {
        ImageError::Limits(_) => too_large(limits),
        ImageError::Unsupported(cause) => Error::unsupported(one_line(&cause.to_string())),
        cause => Error::file(format!("cannot decode the image: {}", one_line(&cause.to_string()))),
    };
    let mut decoder_limits = image::Limits::default();
    decoder_limits.max_image_width = Some(LARGEST_SIDE);
    decoder_limits.max_image_height = Some(LARGEST_SIDE);
    decoder_limits.max_alloc = Some(limits.texels.saturating_mul(Limits::BYTES_PER_TEXEL));
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(decoder_limits);
    let decoder = reader.into_decoder().map_err(failed)?;
    // Not every decoder heeds the limits.
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height), decoder.total_bytes(), limits)?;
    DynamicImage::from_decoder(decoder).map_err(failed)
}

fn decode_with_image(bytes: &[u8], format: ImageFormat, limits: &Limits) -> Result<(u32, u32, Texels)> {
    let image = decode_image(bytes, format, limits)?;
    let (width, height) = (image.width(), image.height());
    let texels = match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let values = image.into_rgb32f().into_raw();
            Texels::Linear32(values.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]].map(usable)).collect())
        }
        _ => {
            let values = image.into_rgba8().into_raw();
            Texels::Srgb8(values.chunks_exact(4).map(|rgba| [rgba[0], rgba[1], rgba[2], rgba[3]]).collect())
        }
    };
    Ok((width, height, texels))
}

/// What the EXR decoder says, as ours.
pub(super) fn exr_failed(cause: exr::error::Error) -> Error {
    match cause {
        exr::error::Error::NotSupported(what) => Error::unsupported(format!("EXR: {}", one_line(&what))),
        cause => Error::file(format!("cannot decode the EXR image: {}", one_line(&cause.to_string()))),
    }
}

/// Checks the sizes in the headers of an EXR file, before anything of that size is allocated.
pub(super) fn check_exr(bytes: &[u8], limits: &Limits) -> Result<()> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(exr_failed)?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
        let channels = header.channels.list.len() as u64;
        check_size(width, height, width.saturating_mul(height).saturating_mul(4 * channels), limits)?;
    }
    Ok(())
}

fn decode_exr(bytes: &[u8], limits: &Limits) -> Result<(u32, u32, Texels)> {
    check_exr(bytes, limits)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.x(), vec![[0.0f32; 3]; size.x() * size.y()]),
            |(width, texels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b, _): (f32, f32, f32, f32)| {
                texels[at.y() * *width + at.x()] = [r, g, b].map(usable);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(exr_failed)?;
    let size = image.layer_data.size;
    Ok((size.x() as u32, size.y() as u32, Texels::Linear32(image.layer_data.channel_data.pixels.1.into())))
}

fn check_size(width: u64, height: u64, bytes: u64, limits: &Limits) -> Result<()> {
    let side = u64::from(LARGEST_SIDE);
    if width > side || height > side {
        let text = format!("the image has {width}x{height} texels; {side} along a side are the most");
        return Err(Error::limit(text).remedy("make it smaller"));
    }
    limits.check_texels(width, height, bytes)
}

/// What a decoder that ran out of its limits means; it does not tell which.
fn too_large(limits: &Limits) -> Error {
    let most = limits.texels;
    Error::limit(format!(
        "the image is larger than {LARGEST_SIDE} texels along a side or the limit of texels, which is {most}"
    ))
    .remedy("make it smaller, or raise the limit with `--limit texels=N`")
}

/// A float texel without NaN (it becomes 0) and infinity: one bad texel must not spread through filtering.
fn usable(value: f32) -> f32 {
    if value.is_nan() {
        0.0
    } else if value.is_infinite() {
        LARGEST_TEXEL.copysign(value)
    } else {
        value
    }
}

/// Messages of the decoders may span lines; ours never do.
fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Fault;
    use exr::prelude::WritableImage as _;
    use image::{ImageBuffer, Rgb, Rgba};

    fn encoded(image: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn lossless_formats_of_eight_bits_keep_their_values_and_rows_start_at_the_top() {
        let pixels = |x: u32, y: u32| Rgba([x as u8 * 100, y as u8 * 50, 7, 255]);
        let image = DynamicImage::ImageRgba8(ImageBuffer::from_fn(2, 3, pixels));
        for (format, name) in [
            (ImageFormat::Png, "a"),
            (ImageFormat::WebP, "a.png"),
            (ImageFormat::Tga, "a.TGA"),
            (ImageFormat::Bmp, "a.jpg"),
        ] {
            let texture = decode_texture(&encoded(&image, format), name, &Limits::default()).unwrap();
            assert_eq!((texture.width, texture.height), (2, 3));
            let Texels::Srgb8(texels) = &texture.texels else { panic!("{format:?}") };
            assert_eq!(texels[1], [100, 0, 7, 255], "{format:?}: right of the top row");
            assert_eq!(texels[4], [0, 100, 7, 255], "{format:?}: left of the bottom row");
        }
    }

    #[test]
    fn sixteen_bits_are_rounded_to_the_nearest() {
        let image = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(1, 1, Rgb([128u16, 129, 65535])));
        let texture = decode_texture(&encoded(&image, ImageFormat::Png), "a.png", &Limits::default()).unwrap();
        // 128 * 255 / 65535 = 0.498, 129 * 255 / 65535 = 0.502.
        assert_eq!(texture.texels, Texels::Srgb8(vec![[0, 1, 255, 255]].into()));
    }

    #[test]
    fn exr_values_arrive_to_the_bit_and_are_made_finite() {
        let values = [[0.1f32, 2.5, -1.0], [f32::NAN, f32::INFINITY, 1e30]];
        let mut bytes = Cursor::new(Vec::new());
        exr::prelude::Image::from_channels(
            (2, 1),
            exr::prelude::SpecificChannels::rgb(|at: exr::prelude::Vec2<usize>| {
                <(f32, f32, f32)>::from(values[at.x()])
            }),
        )
        .write()
        .to_buffered(&mut bytes)
        .unwrap();
        let texture = decode_texture(bytes.get_ref(), "a", &Limits::default()).unwrap();
        assert_eq!(texture.texels, Texels::Linear32(vec![[0.1, 2.5, -1.0], [0.0, 65504.0, 1e30]].into()));
    }

    #[test]
    fn hdr_is_linear() {
        let image = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(8, 1, Rgb([0.5f32, 4.0, 0.25])));
        let texture = decode_texture(&encoded(&image, ImageFormat::Hdr), "sky", &Limits::default()).unwrap();
        assert_eq!(texture.texels, Texels::Linear32(vec![[0.5, 4.0, 0.25]; 8].into()));
    }

    #[test]
    fn a_decompression_bomb_is_a_limit() {
        let image = DynamicImage::new_rgb8(1, 1);
        let mut png = encoded(&image, ImageFormat::Png);
        // Width and height lie at bytes 16 to 23; the checksum of their chunk follows.
        png[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
        let checksum = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&checksum.to_be_bytes());
        assert_eq!(decode_texture(&png, "a.png", &Limits::default()).unwrap_err().fault(), Fault::Limit);
    }

    /// The checksum of PNG, bit by bit.
    fn crc32(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
        })
    }

    #[test]
    fn bad_files_are_named_errors() {
        let message = |bytes: &[u8], name| decode_texture(bytes, name, &Limits::default()).unwrap_err().to_string();
        assert!(message(b"", "a.png").starts_with("the image file is empty; accepted are PNG"));
        assert!(message(b"hello", "a.png").starts_with("not an image of a known format"));
        assert!(message(b"GIF89a...", "a.gif").starts_with("GIF images are not supported"));
        let mut cut = encoded(&DynamicImage::new_rgb8(9, 9), ImageFormat::Png);
        cut.truncate(40);
        assert!(message(&cut, "a.png").starts_with("cannot decode the image"));
        let missing = read_texture(Path::new("no/such.png"), &Limits::default()).unwrap_err();
        assert_eq!((missing.fault(), missing.path()), (Fault::System, Some(Path::new("no/such.png"))));
    }
}
