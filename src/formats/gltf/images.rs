//! Images, each decoded once, and the textures that read them.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;
use std::sync::Arc;

use ::gltf::json::texture::{MagFilter, MinFilter, WrappingMode};
use ::gltf::json::validation::Checked;
use ::gltf::json::{self, Index, Root, texture};
use glam::{DMat2, DVec2, Vec4};
use rayon::prelude::*;

use super::buffers::Buffers;
use super::uri::{self, Target};
use crate::error::{Error, Result};
use crate::formats::image_file::{decode_texture, read_texture};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Limits, Treatment};
use crate::scene::texture::{Filter, Level, Texels, Wrap, srgb_to_linear};
use crate::scene::{Rgb, Texture, TextureRef};

/// The images of a file and the textures made of them so far.
#[derive(Debug)]
pub(super) struct Textures<'a> {
    root: &'a Root,
    /// By image number; `None` where it was not asked for or could not be read.
    images: Vec<Option<Texture>>,
    /// What materials refer to, in order of first use.
    made: Vec<Texture>,
    /// The mean of each, once it was asked for.
    means: Vec<OnceCell<Vec4>>,
    /// Smaller versions by image number: textures share them, however they read the image.
    levels: HashMap<(usize, Encoding), Arc<[Level]>>,
    /// From a texture's number in the file to its place in `made`.
    places: HashMap<(usize, Encoding), u32>,
}

/// What an image's bytes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    /// Colours in sRGB, whose alpha is none or something of its own.
    Srgb,
    /// Colours in sRGB, whose alpha tells how much of them there is.
    SrgbWithAlpha,
    /// Numbers.
    Numbers,
}

impl<'a> Textures<'a> {
    /// Decodes the images behind the textures that are `wanted`, each once, on all threads. What cannot be read goes
    /// to the ledger, and materials do without it.
    pub fn decode(
        root: &'a Root,
        buffers: &Buffers,
        surroundings: &Surroundings,
        wanted: impl Iterator<Item = Index<json::Texture>>,
        ledger: &mut Ledger,
    ) -> Self {
        let numbers: BTreeSet<usize> = wanted.filter_map(|texture| image_of(root, texture)).collect();
        let numbers: Vec<usize> = numbers.into_iter().collect();
        let read = |&number: &usize| -> (Option<PathBuf>, Result<Texture>) {
            match find(root, buffers, surroundings, number) {
                Ok(source) => (source.path(), source.decode(&image_name(root, number), &surroundings.limits)),
                Err(error) => (None, Err(error)),
            }
        };
        let outcomes: Vec<_> = numbers.par_iter().map(read).collect();
        let mut images = vec![None; root.images.len()];
        for (number, (path, outcome)) in numbers.into_iter().zip(outcomes) {
            if let Some(path) = path {
                ledger.note_file(&path);
            }
            match outcome {
                Ok(texture) => images[number] = Some(texture),
                Err(error) => {
                    let text = format!("images[{number}]: {}: plain colour used", error.message());
                    ledger.note(Treatment::Warning, text, 1);
                }
            }
        }
        Self { root, images, made: Vec::new(), means: Vec::new(), levels: HashMap::new(), places: HashMap::new() }
    }

    /// How a material refers to a texture, its transform included; `None` if its image could not be read.
    pub fn refer(&mut self, info: &texture::Info, encoding: Encoding, ledger: &mut Ledger) -> Option<TextureRef> {
        let number = info.index.value();
        let place = match self.places.get(&(number, encoding)) {
            Some(&place) => place,
            None => {
                let image_number = image_of(self.root, info.index)?;
                let image = self.images[image_number].as_ref()?;
                let place = u32::try_from(self.made.len()).ok()?;
                let (mut texture, has_levels) = sampled(self.root, number, image, encoding);
                if has_levels {
                    let levels = self.levels.entry((image_number, encoding));
                    texture.levels = levels.or_insert_with(|| levels_of(texture.clone(), encoding)).clone();
                }
                self.means.push(OnceCell::new());
                self.made.push(texture);
                self.places.insert((number, encoding), place);
                place
            }
        };
        Some(transformed(place, info, ledger))
    }

    /// The mean of what a texture has, linear.
    pub fn mean(&self, texture: &TextureRef) -> Vec4 {
        let number = texture.texture as usize;
        *self.means[number].get_or_init(|| mean(&self.made[number]))
    }

    /// The textures that materials refer to.
    pub fn into_textures(self) -> Vec<Texture> {
        self.made
    }
}

/// The image of a texture: its own, or the WebP that EXT_texture_webp names instead.
fn image_of(root: &Root, texture: Index<json::Texture>) -> Option<usize> {
    let texture = root.textures.get(texture.value())?;
    let webp = || {
        let extension = texture.extensions.as_ref()?.others.get("EXT_texture_webp")?;
        usize::try_from(extension.get("source")?.as_u64()?).ok()
    };
    let exists = |number: &usize| *number < root.images.len();
    Some(texture.source.value()).filter(exists).or_else(|| webp().filter(exists))
}

/// Where an image's bytes are.
enum Source<'a> {
    File(PathBuf),
    Data(Cow<'a, [u8]>),
}

fn find<'a>(root: &Root, buffers: &'a Buffers, surroundings: &Surroundings, number: usize) -> Result<Source<'a>> {
    let image = &root.images[number];
    match (&image.uri, image.buffer_view) {
        (Some(uri), _) => match uri::resolve(uri, surroundings)? {
            Target::Data(bytes) => Ok(Source::Data(Cow::Owned(bytes))),
            // A device or pipe may never end.
            Target::File(path) if path.is_file() => Ok(Source::File(path)),
            Target::File(path) => Err(Error::file(format!("`{}` is missing", path.display()))),
        },
        (None, Some(view)) => Ok(Source::Data(buffers.view(root, view)?)),
        (None, None) => Err(Error::file("has neither uri nor bufferView")),
    }
}

impl Source<'_> {
    fn path(&self) -> Option<PathBuf> {
        match self {
            Self::File(path) => Some(path.clone()),
            Self::Data(_) => None,
        }
    }

    fn decode(&self, name: &str, limits: &Limits) -> Result<Texture> {
        match self {
            Self::File(path) => read_texture(path, limits),
            Self::Data(bytes) => decode_texture(bytes, name, limits),
        }
    }
}

fn image_name(root: &Root, number: usize) -> String {
    root.images[number].name.clone().unwrap_or_else(|| format!("image {number}"))
}

/// The image as a texture's sampler reads it, without smaller versions; and whether it wants them.
fn sampled(root: &Root, texture: usize, image: &Texture, encoding: Encoding) -> (Texture, bool) {
    let sampler = root.textures[texture].sampler.and_then(|sampler| root.samplers.get(sampler.value()));
    let wrap = |mode: Option<Checked<WrappingMode>>| match mode {
        Some(Checked::Valid(WrappingMode::ClampToEdge)) => Wrap::Clamp,
        Some(Checked::Valid(WrappingMode::MirroredRepeat)) => Wrap::Mirror,
        _ => Wrap::Repeat,
    };
    let filter = match sampler.and_then(|sampler| sampler.mag_filter) {
        Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
        _ => Filter::Linear,
    };
    let has_levels = !matches!(
        sampler.and_then(|sampler| sampler.min_filter),
        Some(Checked::Valid(MinFilter::Nearest | MinFilter::Linear))
    );
    let wrap = [wrap(sampler.map(|sampler| sampler.wrap_s)), wrap(sampler.map(|sampler| sampler.wrap_t))];
    let texels = match (&image.texels, encoding) {
        (Texels::Srgb8(texels), Encoding::Numbers) => Texels::Data8(texels.clone()),
        (texels, _) => texels.clone(),
    };
    (Texture { wrap, filter, texels, ..image.clone() }, has_levels)
}

/// The smaller versions of an image.
fn levels_of(texture: Texture, encoding: Encoding) -> Arc<[Level]> {
    let texture = match encoding {
        Encoding::SrgbWithAlpha => texture.with_levels(),
        Encoding::Srgb | Encoding::Numbers => texture.with_plain_levels(),
    };
    texture.levels
}

/// KHR_texture_transform, which is for coordinates whose v goes down, for those whose v goes up: with `F (u, v) = (u, 1 - v)`
/// it is `F T F`.
fn transformed(place: u32, info: &texture::Info, ledger: &mut Ledger) -> TextureRef {
    let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref());
    let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
    if set > 1 {
        ledger.note(Treatment::Approximated, "texture coordinates beyond TEXCOORD_1: that is used", 1);
    }
    let own = TextureRef { second_uvs: set > 0, ..TextureRef::new(place) };
    let Some(transform) = transform else { return own };
    let (sin, cos) = libm::sincos(f64::from(transform.rotation.0));
    let [sx, sy] = transform.scale.0.map(f64::from);
    let [x, y] = transform.offset.0.map(f64::from);
    // Translation, rotation counter-clockwise as seen with v down, scale.
    let (a, b, c, d) = (cos * sx, sin * sy, -sin * sx, cos * sy);
    let matrix = DMat2::from_cols(DVec2::new(a, -c), DVec2::new(-b, d));
    TextureRef { matrix, offset: DVec2::new(b + x, 1.0 - d - y), ..own }
}

fn mean(image: &Texture) -> Vec4 {
    let (bytes, curve): (_, fn(f64) -> f64) = match &image.texels {
        Texels::Srgb8(texels) => (texels, srgb_to_linear),
        Texels::Data8(texels) => (texels, |value| value),
        Texels::Linear32(texels) => {
            let sum = texels.iter().fold([0.0f64; 3], |sum, texel| {
                std::array::from_fn(|channel| sum[channel] + f64::from(texel[channel]))
            });
            return Rgb::from_array(sum.map(|sum| (sum / texels.len() as f64) as f32)).extend(1.0);
        }
    };
    // Counting the 256 values of each channel makes the sum exact and the curve cheap.
    let mut counts = [[0u64; 256]; 4];
    for texel in bytes.iter() {
        for (channel, &byte) in counts.iter_mut().zip(texel) {
            channel[usize::from(byte)] += 1;
        }
    }
    Vec4::from_array(std::array::from_fn(|channel| {
        let curve = if channel == 3 { |value| value } else { curve };
        let sum: f64 =
            (0u8..=255).map(|byte| counts[channel][usize::from(byte)] as f64 * curve(f64::from(byte) / 255.0)).sum();
        (sum / bytes.len() as f64) as f32
    }))
}
