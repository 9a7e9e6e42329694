//! Pictures out: a film becomes a file in the format that the file's suffix names.
//!
//! Formats of whole numbers (PNG, JPEG, WebP, TGA, BMP) are clamped to [0, 1] and encoded by the film's transfer
//! function; EXR and HDR hold linear floats. The film's exposure applies to all. The bytes depend on the film alone.

mod layers;
mod radiance;
pub mod stored;

use std::io::Write;
use std::path::Path;

use image::codecs::bmp::BmpEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::tga::TgaEncoder;
use image::codecs::webp::WebPEncoder;
use image::error::ImageError;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use crate::error::{Error, Fault, Result};
use crate::formats::atomic_file::{Sink, write_atomically};
use crate::render::Film;
use crate::scene::quantize::byte;
use crate::scene::{FilmSettings, Transfer};

/// At this quality the loss is hard to see, and files are a third of those at 100.
const JPEG_QUALITY: u8 = 95;

/// On a noisy 1280x720 picture this level took a quarter of the default's time for 3 % more bytes; the fastest one made
/// files half as large again.
const PNG_COMPRESSION: CompressionType = CompressionType::Level(3);

/// A format that pictures are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PictureFormat {
    /// 8 bits a channel, with alpha if the film has it.
    Png,
    /// 8 bits a channel, quality 95, never alpha.
    Jpeg,
    /// 8 bits a channel, lossless, with alpha if the film has it.
    WebP,
    /// 8 bits a channel, with alpha if the film has it.
    Tga,
    /// 8 bits a channel, never alpha.
    Bmp,
    /// OpenEXR: 32-bit floats, alpha and all extra values as layers.
    Exr,
    /// Radiance: 8 bits a channel and a common exponent.
    Hdr,
}

impl PictureFormat {
    /// The format that a path's suffix names, in capitals or not.
    ///
    /// # Errors
    /// A caller's error that lists the suffixes.
    pub fn of(path: &Path) -> Result<Self> {
        let suffix = path.extension().and_then(|suffix| suffix.to_str()).unwrap_or_default().to_ascii_lowercase();
        Ok(match suffix.as_str() {
            "png" => Self::Png,
            "jpg" | "jpeg" => Self::Jpeg,
            "webp" => Self::WebP,
            "tga" => Self::Tga,
            "bmp" => Self::Bmp,
            "exr" => Self::Exr,
            "hdr" => Self::Hdr,
            _ => {
                let message = match suffix.as_str() {
                    "" => "the picture's name has no suffix to tell its format".to_owned(),
                    other => format!("pictures cannot be written as `.{other}`"),
                };
                return Err(Error::caller(message)
                    .at_path(path)
                    .remedy("accepted are .png, .jpg, .jpeg, .exr, .hdr, .webp, .tga and .bmp"));
            }
        })
    }

    /// Whether it can hold a film's extra values.
    pub fn has_layers(self) -> bool {
        self == Self::Exr
    }

    fn has_alpha(self) -> bool {
        matches!(self, Self::Png | Self::WebP | Self::Tga | Self::Exr)
    }
}

/// Writes a film as the format that the suffix of `path` names.
///
/// The file is there whole or not at all; an existing one is replaced. Extra values are written where the format
/// [has layers](PictureFormat::has_layers). A format without alpha shows a transparent background black.
///
/// # Errors
/// A caller's error for an unknown suffix, a limit where the picture is too large for the format, the system's.
pub fn save(film: &Film, path: &Path) -> Result<()> {
    let format = PictureFormat::of(path)?;
    write_atomically(path, |sink| write(film, format, sink))
}

/// Writes a film as PNG to a stream.
///
/// # Errors
/// The system's.
pub fn write_png(film: &Film, out: &mut impl Write) -> Result<()> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    write(film, PictureFormat::Png, &mut bytes)?;
    out.write_all(bytes.get_ref()).and_then(|()| out.flush()).map_err(cannot_write)
}

/// What the film's values are multiplied by when they are written.
pub fn exposure_factor(settings: &FilmSettings) -> f32 {
    libm::exp2(f64::from(settings.exposure)) as f32
}

/// A pixel as formats of bytes have it, not weighted by alpha, given [`exposure_factor`].
pub fn pixel_bytes(color: &[f32; 3], alpha: Option<f32>, exposure: f32, transfer: Transfer) -> [u8; 4] {
    // Films hold colours that are already weighted by alpha, as EXR does; these formats do not.
    let weight = match alpha {
        None => exposure,
        Some(alpha) if alpha > 0.0 => exposure / alpha,
        Some(_) => 0.0,
    };
    let [r, g, b] = color.map(|value| byte(value * weight, transfer));
    [r, g, b, alpha.map_or(255, |alpha| byte(alpha, Transfer::Linear))]
}

fn write(film: &Film, format: PictureFormat, mut out: &mut dyn Sink) -> Result<()> {
    let exposure = exposure_factor(&film.settings);
    match format {
        PictureFormat::Png => encode_bytes(
            film,
            format,
            exposure,
            PngEncoder::new_with_quality(out, PNG_COMPRESSION, FilterType::Adaptive),
        ),
        PictureFormat::Jpeg => encode_bytes(film, format, exposure, JpegEncoder::new_with_quality(out, JPEG_QUALITY)),
        PictureFormat::WebP => encode_bytes(film, format, exposure, WebPEncoder::new_lossless(out)),
        PictureFormat::Tga => encode_bytes(film, format, exposure, TgaEncoder::new(out)),
        PictureFormat::Bmp => encode_bytes(film, format, exposure, BmpEncoder::new(&mut out)),
        PictureFormat::Exr => layers::write(film, exposure, out).map_err(exr_error),
        PictureFormat::Hdr => {
            let colors: Vec<_> = film.color.iter().map(|color| color.map(|value| value * exposure)).collect();
            radiance::write(out, film.width as usize, film.height as usize, &colors).map_err(cannot_write)
        }
    }
}

/// Writes a film in a format of whole numbers.
fn encode_bytes(film: &Film, format: PictureFormat, exposure: f32, encoder: impl ImageEncoder) -> Result<()> {
    let (bytes, color_type) = match &film.alpha {
        Some(alpha) if format.has_alpha() => (rgba_bytes(film, alpha, exposure), ExtendedColorType::Rgba8),
        _ => (rgb_bytes(film, exposure), ExtendedColorType::Rgb8),
    };
    let (width, height) = (film.width, film.height);
    encoder.write_image(&bytes, width, height, color_type).map_err(|cause| match cause {
        ImageError::IoError(cause) => cannot_write(cause),
        cause => Error::limit(format!("a picture of {width}x{height} does not fit the format: {cause}"))
            .remedy("PNG and EXR hold larger ones"),
    })
}

fn rgb_bytes(film: &Film, exposure: f32) -> Vec<u8> {
    let transfer = film.settings.transfer;
    let pixel = |color: &[f32; 3]| color.map(|value| byte(value * exposure, transfer));
    film.color.par_iter().map(pixel).collect::<Vec<_>>().into_flattened()
}

fn rgba_bytes(film: &Film, alpha: &[f32], exposure: f32) -> Vec<u8> {
    let transfer = film.settings.transfer;
    let pixel = |(color, &alpha): (&[f32; 3], &f32)| pixel_bytes(color, Some(alpha), exposure, transfer);
    film.color.par_iter().zip(alpha).map(pixel).collect::<Vec<_>>().into_flattened()
}

fn cannot_write(cause: std::io::Error) -> Error {
    Error::new(Fault::System, format!("cannot write the picture: {cause}"))
}

fn exr_error(cause: exr::error::Error) -> Error {
    match cause {
        exr::error::Error::Io(cause) => cannot_write(cause),
        cause => Error::limit(format!("the picture does not fit EXR: {cause}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::Limits;
    use crate::formats::image_file::read_texture;
    use crate::render::{Aov, AovKind, RenderStats};
    use crate::scene::FilmSettings;
    use crate::scene::texture::Texels;

    /// 3 x 2 pixels with values that formats find hard.
    fn film() -> Film {
        Film {
            width: 3,
            height: 2,
            crop: None,
            color: vec![
                [0.0, 0.5, 1.0],
                [2.0, -1.0, f32::NAN],
                [0.1, 0.2, 0.3],
                [1e-6, 0.9, 1e6],
                [0.25, 0.25, 0.25],
                [0.75, 0.0, 0.125],
            ],
            alpha: None,
            aovs: Vec::new(),
            settings: FilmSettings { width: 3, height: 2, ..Default::default() },
            complete: true,
            coverage: None,
            stats: RenderStats::default(),
        }
    }

    /// What the sRGB curve makes of the film, from its definition.
    const ENCODED: [[u8; 3]; 6] =
        [[0, 188, 255], [255, 0, 0], [89, 124, 149], [0, 243, 255], [137, 137, 137], [225, 0, 99]];

    fn saved(film: &Film, name: &str) -> image::DynamicImage {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        save(film, &path).unwrap();
        image::open(path).unwrap()
    }

    #[test]
    fn lossless_formats_hold_the_encoded_bytes() {
        for name in ["a.png", "a.PNG", "a.webp", "a.tga", "a.bmp"] {
            let decoded = saved(&film(), name);
            assert!(!decoded.color().has_alpha(), "{name}");
            assert_eq!(decoded.into_rgb8().as_raw().as_slice(), ENCODED.as_flattened(), "{name}");
        }
        let mut streamed = Vec::new();
        write_png(&film(), &mut streamed).unwrap();
        let decoded = image::load_from_memory(&streamed).unwrap().into_rgb8();
        assert_eq!(decoded.as_raw().as_slice(), ENCODED.as_flattened());
    }

    #[test]
    fn jpeg_is_close() {
        let uniform = Film { color: vec![[0.5, 0.5, 0.5]; 6], ..film() };
        for name in ["a.jpg", "a.jpeg"] {
            assert!(saved(&uniform, name).into_rgb8().as_raw().iter().all(|byte| byte.abs_diff(188) <= 1));
        }
    }

    #[test]
    fn transfer_and_exposure() {
        let mut film = film();
        film.settings.transfer = Transfer::Linear;
        film.settings.exposure = 1.0;
        let decoded = saved(&film, "a.png").into_rgb8();
        assert_eq!(decoded.get_pixel(2, 0).0, [51, 102, 153], "2 * (0.1, 0.2, 0.3) * 255");
        let decoded = saved(&film, "a.hdr").into_rgb32f();
        assert_eq!(decoded.get_pixel(1, 1).0, [0.5; 3]);
    }

    #[test]
    fn alpha_is_straight_in_png_and_absent_in_jpeg() {
        let mut film = film();
        film.color = vec![[0.25, 0.125, 0.0]; 6];
        film.alpha = Some(vec![0.0, 0.5, 1.0, 0.25, 0.5, 0.5]);
        film.settings.transfer = Transfer::Linear;
        let decoded = saved(&film, "a.png").into_rgba8();
        assert_eq!(decoded.get_pixel(0, 0).0, [0, 0, 0, 0]);
        assert_eq!(decoded.get_pixel(1, 0).0, [128, 64, 0, 128]);
        assert_eq!(decoded.get_pixel(2, 0).0, [64, 32, 0, 255]);
        assert!(!saved(&film, "a.jpg").color().has_alpha());
    }

    #[test]
    fn exr_holds_every_value_to_the_bit_in_named_layers() {
        let mut film = film();
        film.alpha = Some(vec![0.0, 0.1, 0.2, 0.3, 0.4, 1.0]);
        let ids = [0u32, 1, 7, u32::MAX, 0x7fc0_0001, 12];
        film.aovs = vec![
            Aov { kind: AovKind::Depth, channels: vec![vec![1.0, f32::INFINITY, 0.1, 3.0, 4.0, 5.0]] },
            Aov { kind: AovKind::Id, channels: vec![ids.map(f32::from_bits).to_vec(), vec![0.0; 6]] },
            Aov { kind: AovKind::Normal, channels: vec![vec![0.1; 6], vec![0.2; 6], vec![-0.3; 6]] },
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        save(&film, &path).unwrap();
        let read = exr::prelude::read_first_flat_layer_from_file(&path).unwrap().layer_data;
        assert_eq!(read.size, exr::prelude::Vec2(3, 2));
        let names: Vec<_> = read.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
        let expected =
            ["A", "B", "G", "R", "depth.Z", "id.instance", "id.primitive", "normal.X", "normal.Y", "normal.Z"];
        assert_eq!(names, expected);
        let samples = |name: &str| {
            let channel = read.channel_data.list.iter().find(|channel| channel.name.eq(name)).unwrap();
            match &channel.sample_data {
                exr::prelude::FlatSamples::F32(values) => values.iter().map(|value| value.to_bits()).collect(),
                exr::prelude::FlatSamples::U32(values) => values.clone(),
                exr::prelude::FlatSamples::F16(_) => panic!("{name} lost bits"),
            }
        };
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<u32>>();
        assert_eq!(samples("id.instance"), ids);
        assert_eq!(samples("depth.Z"), bits(&film.aovs[0].channels[0]));
        assert_eq!(samples("normal.Z"), bits(&film.aovs[2].channels[2]));
        assert_eq!(samples("A"), bits(film.alpha.as_ref().unwrap()));
        assert_eq!(samples("B"), bits(&film.color.iter().map(|color| color[2]).collect::<Vec<_>>()));
        let Texels::Linear32(texels) = read_texture(&path, &Limits::default()).unwrap().texels else { panic!() };
        assert_eq!(texels[5], film.color[5], "other readers find the colour");
    }

    #[test]
    fn unknown_suffixes_list_the_accepted_ones() {
        let message = |name: &str| save(&film(), Path::new(name)).unwrap_err().to_string();
        let expected =
            "pictures cannot be written as `.gif`; accepted are .png, .jpg, .jpeg, .exr, .hdr, .webp, .tga and .bmp";
        assert_eq!(message("a.gif"), format!("a.gif: {expected}"));
        assert!(message("a").contains("no suffix"));
    }
}
