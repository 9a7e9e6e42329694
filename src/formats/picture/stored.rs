//! Pictures read back with every value that is in the file: what two of them are compared by.
//!
//! Unlike [textures](crate::formats::image_file), values keep their bits: NaN and infinity stay, alpha stays, 16-bit
//! channels stay, and all layers of an EXR file are read.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{FlatSamples, ReadChannels as _, ReadLayers as _};
use image::{DynamicImage, ImageFormat};

use crate::error::{Error, Result};
use crate::formats::Limits;
use crate::formats::image_file::{check_exr, decode_image, exr_failed, format_of, read_bytes};
use crate::scene::texture::srgb_to_linear;

/// A picture as its file has it, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredPicture {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Whether the colour is in linear floats (EXR, HDR) rather than in encoded whole numbers.
    pub is_linear: bool,
    /// Red, green, blue, and alpha if the file has it. Grey is three times the same.
    pub color: Layer,
    /// What else an EXR file holds, in its order.
    pub layers: Vec<Layer>,
}

/// Channels that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// What stands before the channels' names in the file; empty for the colour of files that have no layers.
    pub name: String,
    /// At least one.
    pub channels: Vec<Channel>,
}

/// One number a pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// `R`, `G`, `B`, `A`, or what the file says.
    pub name: String,
    /// Rows from the top.
    pub samples: Samples,
}

/// Numbers as the file has them.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Stand for 0 to 1.
    Bytes(Vec<u8>),
    /// Stand for 0 to 1.
    Words(Vec<u16>),
    /// Stand for themselves; half floats are here too.
    Floats(Vec<f32>),
    /// Stand for themselves: ids.
    Whole(Vec<u32>),
}

impl Samples {
    /// What the number of a pixel stands for.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn value(&self, pixel: usize) -> f64 {
        match self {
            Self::Bytes(values) => f64::from(values[pixel]) / 255.0,
            Self::Words(values) => f64::from(values[pixel]) / 65535.0,
            Self::Floats(values) => f64::from(values[pixel]),
            Self::Whole(values) => f64::from(values[pixel]),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Bytes(values) => values.len(),
            Self::Words(values) => values.len(),
            Self::Floats(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }
}

impl StoredPicture {
    /// Reads a picture of any format that is written here; it is told by the content, TGA by the suffix.
    ///
    /// # Errors
    /// Names the file and the cause: it cannot be read, is no picture, is malformed, is larger than 65536 pixels along
    /// a side or 2 GiB, or is an EXR file without colour.
    pub fn read(path: &Path) -> Result<Self> {
        let limits = Limits::default();
        let bytes = read_bytes(path, &limits)?;
        let name = path.display().to_string();
        let decode = || match format_of(&bytes, &name)? {
            ImageFormat::OpenExr => Self::from_exr(&bytes),
            format => Ok(Self::from_image(&decode_image(&bytes, format, &limits)?)),
        };
        decode().map_err(|error| error.at_path(path))
    }

    fn from_image(image: &DynamicImage) -> Self {
        use image::ColorType::{L16, La16, Rgb16, Rgb32F, Rgba16, Rgba32F};
        let kind = image.color();
        let names = if kind.has_alpha() { &["R", "G", "B", "A"][..] } else { &["R", "G", "B"] };
        let lane = |lane: usize| match kind {
            Rgb32F | Rgba32F => Samples::Floats(every_fourth(image.to_rgba32f().as_raw(), lane)),
            L16 | La16 | Rgb16 | Rgba16 => Samples::Words(every_fourth(image.to_rgba16().as_raw(), lane)),
            _ => Samples::Bytes(every_fourth(image.to_rgba8().as_raw(), lane)),
        };
        let channels = names.iter().enumerate().map(|(i, &name)| Channel { name: name.into(), samples: lane(i) });
        Self {
            width: image.width() as usize,
            height: image.height() as usize,
            is_linear: matches!(kind, Rgb32F | Rgba32F),
            color: Layer { name: String::new(), channels: channels.collect() },
            layers: Vec::new(),
        }
    }

    fn from_exr(bytes: &[u8]) -> Result<Self> {
        check_exr(bytes, &Limits::default())?;
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .map_err(exr_failed)?;
        let mut size = None;
        let mut layers: Vec<Layer> = Vec::new();
        for part in image.layer_data {
            // Parts may be of different sizes; those of the first's are one picture.
            if *size.get_or_insert(part.size) != part.size {
                continue;
            }
            let part_name = part.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
            for channel in part.channel_data.list {
                let full = channel.name.to_string();
                let (inner, name) = full.rsplit_once('.').unwrap_or(("", &full));
                let layer = [part_name.as_str(), inner].into_iter().filter(|part| !part.is_empty());
                let layer = layer.collect::<Vec<_>>().join(".");
                let samples = match channel.sample_data {
                    FlatSamples::F16(values) => Samples::Floats(values.iter().map(|value| value.to_f32()).collect()),
                    FlatSamples::F32(values) => Samples::Floats(values),
                    FlatSamples::U32(values) => Samples::Whole(values),
                };
                let channel = Channel { name: name.to_owned(), samples };
                match layers.iter_mut().find(|known| known.name == layer) {
                    Some(known) => known.channels.push(channel),
                    None => layers.push(Layer { name: layer, channels: vec![channel] }),
                }
            }
        }
        let size = size.ok_or_else(|| Error::file("the EXR file has no layers"))?;
        // The nameless layer if it has colour, else the first that has.
        let color = layers
            .iter()
            .position(|layer| layer.name.is_empty() && color_of(layer).is_some())
            .or_else(|| layers.iter().position(|layer| color_of(layer).is_some()))
            .ok_or_else(|| Error::unsupported("the EXR file has no channels R, G and B, and no Y"))?;
        let picture = layers.remove(color);
        let color = color_of(&picture).expect("it was found by its colour");
        Ok(Self { width: size.x(), height: size.y(), is_linear: true, color, layers })
    }

    /// Makes encoded colours linear by the sRGB curve and weighs them by alpha, as linear files have them.
    #[must_use]
    pub fn into_linear(self) -> Self {
        if self.is_linear {
            return self;
        }
        let channels = &self.color.channels;
        let alpha = channels.iter().find(|channel| channel.name == "A");
        let linear = |channel: &Channel| {
            let samples = &channel.samples;
            let value = |pixel| match alpha {
                Some(_) if channel.name == "A" => samples.value(pixel),
                Some(alpha) => srgb_to_linear(samples.value(pixel)) * alpha.samples.value(pixel),
                None => srgb_to_linear(samples.value(pixel)),
            };
            let values = (0..samples.len()).map(|pixel| value(pixel) as f32).collect();
            Channel { name: channel.name.clone(), samples: Samples::Floats(values) }
        };
        let channels = channels.iter().map(linear).collect();
        Self { is_linear: true, color: Layer { channels, ..self.color }, ..self }
    }
}

/// One of four interleaved channels.
fn every_fourth<T: Copy>(values: &[T], lane: usize) -> Vec<T> {
    values.iter().skip(lane).step_by(4).copied().collect()
}

/// The colour that a layer's channels make, if they do: R, G and B, or Y for all of them, and A if it is there.
fn color_of(layer: &Layer) -> Option<Layer> {
    let find = |name: &str| layer.channels.iter().find(|channel| channel.name == name);
    let grey = find("Y");
    let mut channels = Vec::new();
    for name in ["R", "G", "B"] {
        let samples = find(name).or(grey)?.samples.clone();
        channels.push(Channel { name: name.to_owned(), samples });
    }
    channels.extend(find("A").cloned());
    Some(Layer { name: layer.name.clone(), channels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::picture::save;
    use crate::render::{Aov, AovKind, Film, RenderStats};
    use crate::scene::FilmSettings;

    fn film() -> Film {
        Film {
            width: 2,
            height: 1,
            crop: None,
            color: vec![[0.25, 0.5, 1.0], [f32::INFINITY, f32::NAN, -2.0]],
            alpha: Some(vec![1.0, 0.5]),
            aovs: vec![Aov { kind: AovKind::Id, channels: vec![vec![f32::from_bits(7); 2], vec![0.0; 2]] }],
            settings: FilmSettings { width: 2, height: 1, ..Default::default() },
            complete: true,
            coverage: None,
            stats: RenderStats::default(),
        }
    }

    fn stored(film: &Film, name: &str) -> StoredPicture {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        save(film, &path).unwrap();
        StoredPicture::read(&path).unwrap()
    }

    fn names(layer: &Layer) -> Vec<&str> {
        layer.channels.iter().map(|channel| channel.name.as_str()).collect()
    }

    #[test]
    fn exr_keeps_every_bit_and_every_layer() {
        let picture = stored(&film(), "a.exr");
        assert_eq!((picture.width, picture.height, picture.is_linear), (2, 1, true));
        assert_eq!(names(&picture.color), ["R", "G", "B", "A"]);
        assert_eq!(picture.color.channels[0].samples, Samples::Floats(vec![0.25, f32::INFINITY]));
        assert!(picture.color.channels[1].samples.value(1).is_nan());
        assert_eq!(picture.color.channels[3].samples, Samples::Floats(vec![1.0, 0.5]));
        assert_eq!((picture.layers.len(), picture.layers[0].name.as_str()), (1, "id"));
        assert_eq!(picture.layers[0].channels[0].samples, Samples::Whole(vec![7, 7]));
    }

    #[test]
    fn every_format_comes_back_with_its_size_and_alpha() {
        for (name, alpha, linear) in [
            ("a.png", true, false),
            ("a.webp", true, false),
            ("a.tga", true, false),
            ("a.bmp", false, false),
            ("a.jpg", false, false),
            ("a.hdr", false, true),
        ] {
            let picture = stored(&film(), name);
            assert_eq!((picture.width, picture.height), (2, 1), "{name}");
            assert_eq!((picture.color.channels.len() == 4, picture.is_linear), (alpha, linear), "{name}");
        }
    }

    #[test]
    fn encoded_colours_become_linear_and_weighted() {
        let film = Film { color: vec![[0.25, 0.5, 1.0], [0.25, 0.125, 0.0]], aovs: Vec::new(), ..film() };
        let (from_bytes, floats) = (stored(&film, "a.png").into_linear(), stored(&film, "a.exr"));
        for (a, b) in from_bytes.color.channels.iter().zip(&floats.color.channels) {
            for pixel in 0..2 {
                // Half a byte's step on the steepest part of the curve that is met here is 0.0045.
                let difference = (a.samples.value(pixel) - b.samples.value(pixel)).abs();
                assert!(difference < 0.0045, "{} of {pixel}: {difference}", a.name);
            }
        }
    }
}
