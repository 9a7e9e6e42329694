//! Images on surfaces: 8-bit or float texels, wrap modes, nearest, bilinear and trilinear lookup in linear light.

use std::sync::{Arc, LazyLock};

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use crate::scene::quantize::byte;
use crate::scene::{Rgb, Transfer};

/// What happens to texture coordinates outside [0, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every other time mirrored.
    Mirror,
    /// The border texel goes on.
    Clamp,
}

/// How texels are read between their centres.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Linear between the four nearest.
    #[default]
    Linear,
}

/// The texels of an image, rows from the top, shared between textures that read it differently.
#[derive(Debug, Clone, PartialEq)]
pub enum Texels {
    /// Red, green, blue, alpha; encoded in sRGB (alpha linear).
    Srgb8(Arc<[[u8; 4]]>),
    /// Numbers that are no colours, such as normals: 0 to 255 stand for 0 to 1.
    Data8(Arc<[[u8; 4]]>),
    /// Linear red, green, blue.
    Linear32(Arc<[[f32; 3]]>),
}

impl Texels {
    /// Whether both are one piece of memory; equal texels of two images are not.
    pub fn is_shared_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Srgb8(own), Self::Srgb8(other)) | (Self::Data8(own), Self::Data8(other)) => Arc::ptr_eq(own, other),
            (Self::Linear32(own), Self::Linear32(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
    }

    /// One of them, linear; with an alpha of 1 where there is none.
    #[inline(always)]
    pub(crate) fn get(&self, at: usize) -> Vec4 {
        match self {
            Self::Srgb8(texels) => {
                let [r, g, b, a] = texels[at].map(usize::from);
                Vec4::new(LINEAR[r], LINEAR[g], LINEAR[b], FRACTION[a])
            }
            Self::Data8(texels) => Vec4::from_array(texels[at].map(|byte| FRACTION[usize::from(byte)])),
            Self::Linear32(texels) => {
                let [r, g, b] = texels[at];
                Vec4::new(r, g, b, 1.0)
            }
        }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        match self {
            Self::Srgb8(texels) | Self::Data8(texels) => texels.len(),
            Self::Linear32(texels) => texels.len(),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Self::Srgb8(texels) | Self::Data8(texels) => std::mem::size_of_val::<[_]>(texels),
            Self::Linear32(texels) => std::mem::size_of_val::<[_]>(texels),
        }
    }
}

/// A smaller version of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Width in texels.
    width: u32,
    /// Height in texels.
    height: u32,
    texels: Texels,
}

impl Level {
    /// An image of this size that another one was made from.
    pub fn new(width: u32, height: u32, texels: Texels) -> Self {
        Self { width, height, texels }
    }

    /// Width, height and texels.
    pub fn parts(&self) -> (u32, u32, &Texels) {
        (self.width, self.height, &self.texels)
    }
}

/// An image and how to read it.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// Where it came from, for messages.
    pub name: String,
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// The texels; there are `width * height`.
    pub texels: Texels,
    /// How coordinates wrap, along u and along v.
    pub wrap: [Wrap; 2],
    /// How texels are read between their centres.
    pub filter: Filter,
    /// Smaller versions, each half as wide and high as the one before, for places where many texels fall into a pixel; none
    /// where the image shall be read as it is. Made by [`with_levels`](Self::with_levels).
    pub levels: Arc<[Level]>,
}

/// sRGB bytes to linear values.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_to_linear(byte as f64 / 255.0) as f32));

/// Bytes to fractions.
static FRACTION: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| (byte as f64 / 255.0) as f32));

/// The sRGB curve from encoded to linear (IEC 61966-2-1).
pub fn srgb_to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// The sRGB curve from linear to encoded.
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

impl Texture {
    /// An image that repeats along both axes and is filtered linearly, without smaller versions.
    pub fn new(name: impl Into<String>, width: u32, height: u32, texels: Texels) -> Self {
        let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Linear);
        Self { name: name.into(), width, height, texels, wrap, filter, levels: Arc::new([]) }
    }

    /// The linear colour at texture coordinates whose origin is the image's lower left corner, v up.
    ///
    /// Coordinates that are not finite read the texel at (0, 0).
    pub fn sample(&self, uv: DVec2) -> Rgb {
        self.sample_all(uv, self.width, self.height, &self.texels, self.filter).truncate()
    }

    /// The linear colour and alpha where a pixel covers so many texels along each axis.
    ///
    /// Between the two smaller versions whose texels are a little smaller and larger than that: trilinear filtering
    /// (Williams 1983, "Pyramidal Parametrics").
    pub fn sample_footprint(&self, uv: DVec2, texels: f32) -> Vec4 {
        let whole = || self.sample_all(uv, self.width, self.height, &self.texels, self.filter);
        if self.levels.is_empty() || !(texels > 1.0) {
            return whole();
        }
        let last = self.levels.len() as f32;
        let level = libm::log2f(texels).min(last);
        let base = level.floor();
        let at = |level: f32| {
            if level == 0.0 {
                return whole();
            }
            let level = &self.levels[level as usize - 1];
            self.sample_all(uv, level.width, level.height, &level.texels, Filter::Linear)
        };
        let share = level - base;
        let fine = at(base);
        if share == 0.0 { fine } else { fine * (1.0 - share) + at(base + 1.0) * share }
    }

    #[inline(always)]
    fn sample_all(&self, uv: DVec2, width: u32, height: u32, texels: &Texels, filter: Filter) -> Vec4 {
        let uv = if uv.is_finite() { uv } else { DVec2::ZERO };
        let texel = |x: u32, y: u32| texels.get(y as usize * width as usize + x as usize);
        let x = wrap(uv.x, self.wrap[0]) * f64::from(width);
        let y = wrap(1.0 - uv.y, self.wrap[1]) * f64::from(height);
        match filter {
            Filter::Nearest => {
                let index = |position: f64, size: u32| (position as u32).min(size - 1);
                texel(index(x, width), index(y, height))
            }
            Filter::Linear => {
                let (x0, x1, fx) = neighbours(x, width, self.wrap[0]);
                let (y0, y1, fy) = neighbours(y, height, self.wrap[1]);
                let top = texel(x0, y0) * (1.0 - fx) + texel(x1, y0) * fx;
                let bottom = texel(x0, y1) * (1.0 - fx) + texel(x1, y1) * fx;
                top * (1.0 - fy) + bottom * fy
            }
        }
    }

    /// The image with smaller versions of it: a third more memory.
    ///
    /// Texels are means of those that they cover, in linear light and weighted by alpha, so that what is not seen has no part.
    pub fn with_levels(self) -> Self {
        let has_colors = !matches!(self.texels, Texels::Data8(_));
        self.with_halves(has_colors)
    }

    /// The same without weights: for images whose alpha does not tell how much of a texel there is.
    pub fn with_plain_levels(self) -> Self {
        self.with_halves(false)
    }

    fn with_halves(mut self, by_alpha: bool) -> Self {
        let mut levels: Vec<Level> = Vec::new();
        let (mut width, mut height) = (self.width, self.height);
        while width > 1 || height > 1 {
            let texels = levels.last().map_or(&self.texels, |level| &level.texels);
            let texels = halved(texels, width, height, by_alpha);
            (width, height) = (half(width), half(height));
            levels.push(Level { width, height, texels });
        }
        self.levels = levels.into();
        self
    }

    /// Bytes of the texels, those of smaller versions among them.
    pub fn bytes(&self) -> usize {
        self.texels.bytes() + self.levels.iter().map(|level| level.texels.bytes()).sum::<usize>()
    }
}

/// Half of a side.
fn half(side: u32) -> u32 {
    (side / 2).max(1)
}

/// An image of half the width and height. Of an odd number of texels three make one, the outer two by what they share in it.
fn halved(texels: &Texels, width: u32, height: u32, by_alpha: bool) -> Texels {
    let (to_width, to_height) = (half(width), half(height));
    let row = |y: u32| {
        let (rows, row_weights) = covered(y, height);
        (0..to_width).map(move |x| {
            let (columns, column_weights) = covered(x, width);
            let (mut sum, mut plain) = (Vec4::ZERO, Vec4::ZERO);
            for (y, row_weight) in rows.clone().zip(row_weights) {
                for (x, column_weight) in columns.clone().zip(column_weights) {
                    let texel = texels.get(y as usize * width as usize + x as usize);
                    let weight = row_weight * column_weight;
                    sum += (texel.truncate() * texel.w).extend(texel.w) * weight;
                    plain += texel * weight;
                }
            }
            let color = if by_alpha && sum.w > 0.0 { sum.truncate() / sum.w } else { plain.truncate() };
            color.extend(plain.w)
        })
    };
    let srgb = |texel: Vec4| {
        let [r, g, b] = texel.truncate().to_array().map(|value| byte(value, Transfer::Srgb));
        [r, g, b, byte(texel.w, Transfer::Linear)]
    };
    let rows = (0..to_height).into_par_iter().flat_map_iter(row);
    match texels {
        Texels::Srgb8(_) => Texels::Srgb8(rows.map(srgb).collect::<Vec<_>>().into()),
        Texels::Data8(_) => {
            let data = |texel: Vec4| texel.to_array().map(|value| byte(value, Transfer::Linear));
            Texels::Data8(rows.map(data).collect::<Vec<_>>().into())
        }
        Texels::Linear32(_) => {
            Texels::Linear32(rows.map(|texel| texel.truncate().to_array()).collect::<Vec<_>>().into())
        }
    }
}

/// Which texels along a side of so many one of half as many covers, and the weight of each.
fn covered(at: u32, side: u32) -> (std::ops::Range<u32>, [f32; 3]) {
    if side == 1 {
        return (0..1, [1.0, 0.0, 0.0]);
    }
    let first = 2 * at;
    if side.is_multiple_of(2) {
        return (first..first + 2, [0.5, 0.5, 0.0]);
    }
    // Of side = 2 n + 1 texels each of n covers 2 + 1 / n, the first from its left edge on.
    let (n, at) = ((side / 2) as f32, at as f32);
    let whole = 2.0 * n + 1.0;
    (first..first + 3, [(n - at) / whole, n / whole, (at + 1.0) / whole])
}

/// Brings a coordinate into [0, 1].
fn wrap(t: f64, mode: Wrap) -> f64 {
    match mode {
        Wrap::Repeat => t - t.floor(),
        Wrap::Mirror => {
            let within = t - 2.0 * (0.5 * t).floor();
            if within > 1.0 { 2.0 - within } else { within }
        }
        Wrap::Clamp => t.clamp(0.0, 1.0),
    }
}

/// The two texels around a position in texels and the weight of the second.
fn neighbours(position: f64, size: u32, mode: Wrap) -> (u32, u32, f32) {
    let shifted = position - 0.5;
    let base = shifted.floor();
    let index = |i: i64| -> u32 {
        let last = i64::from(size) - 1;
        (match mode {
            Wrap::Repeat => i.rem_euclid(i64::from(size)),
            Wrap::Mirror | Wrap::Clamp => i.clamp(0, last),
        }) as u32
    };
    (index(base as i64), index(base as i64 + 1), (shifted - base) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Texture {
        let (black, white) = ([0, 0, 0, 255], [255, 255, 255, 255]);
        let texels = Texels::Srgb8(vec![black, white, white, black].into());
        Texture { filter: Filter::Nearest, ..Texture::new("checker", 2, 2, texels) }
    }

    #[test]
    fn v_goes_up_and_u_goes_right() {
        let t = checker();
        assert_eq!(t.sample(DVec2::new(0.25, 0.75)), Rgb::ZERO, "top left");
        assert_eq!(t.sample(DVec2::new(0.75, 0.75)), Rgb::ONE, "top right");
        assert_eq!(t.sample(DVec2::new(0.25, 0.25)), Rgb::ONE, "bottom left");
        assert_eq!(t.sample(DVec2::new(1.25, -0.25)), Rgb::ZERO, "repeats");
    }

    #[test]
    fn wrap_modes() {
        assert_eq!(wrap(-0.25, Wrap::Repeat), 0.75);
        assert_eq!(wrap(1.25, Wrap::Mirror), 0.75);
        assert_eq!(wrap(-0.25, Wrap::Mirror), 0.25);
        assert_eq!(wrap(2.5, Wrap::Clamp), 1.0);
    }

    #[test]
    fn linear_filtering_mixes_linear_light() {
        let t = Texture { filter: Filter::Linear, ..checker() };
        assert_eq!(t.sample(DVec2::new(0.5, 0.5)), Rgb::splat(0.5));
        assert_eq!(t.sample(DVec2::new(0.0, 0.75)), Rgb::splat(0.5), "wraps around the border");
        assert!(t.sample(DVec2::new(f64::NAN, f64::INFINITY)).is_finite());
    }

    #[test]
    fn smaller_versions_are_means() {
        // A ramp, whose mean over any texel is its value in the middle, for even and odd sides.
        for (width, height) in [(8, 4), (7, 5), (1, 6), (9, 1), (13, 13)] {
            let value = |x: u32, y: u32| {
                let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
                [x / width as f32, y / height as f32, 0.25]
            };
            let texels = (0..height).flat_map(|y| (0..width).map(move |x| value(x, y))).collect::<Vec<_>>();
            let texture = Texture::new("ramp", width, height, Texels::Linear32(texels.into())).with_levels();
            let last = texture.levels.last().unwrap();
            assert_eq!((last.width, last.height), (1, 1));
            let mean = last.texels.get(0).truncate();
            assert!((mean - Rgb::new(0.5, 0.5, 0.25)).abs().max_element() < 1e-6, "{width} {height}: {mean}");
            for level in texture.levels.iter() {
                for x in 0..level.width {
                    let middle = (x as f32 + 0.5) / level.width as f32;
                    // Steps of the ramp that are shared by two texels put each a little aside.
                    let aside = if width.is_power_of_two() { 1e-6 } else { 0.25 / width as f32 };
                    assert!((level.texels.get(x as usize).x - middle).abs() <= aside, "{width} {} {x}", level.width);
                }
            }
        }
    }

    #[test]
    fn small_footprints_see_texels_and_large_ones_their_mean() {
        let t = checker().with_levels();
        let uv = DVec2::new(0.25, 0.25);
        assert_eq!(t.sample_footprint(uv, 0.1), Vec4::ONE);
        assert_eq!(t.sample_footprint(uv, f32::NAN), Vec4::ONE);
        let mean = t.sample_footprint(uv, 2.0);
        assert!((mean.x - 0.5).abs() < 0.003 && mean.w == 1.0, "linear light: {mean}");
        assert_eq!(t.sample_footprint(uv, 1e9), mean);
        let between = t.sample_footprint(uv, std::f32::consts::SQRT_2);
        assert!((between - (Vec4::ONE + mean) * 0.5).abs().max_element() < 1e-6);
        assert_eq!(checker().sample_footprint(uv, 1e9), Vec4::ONE, "without smaller versions the texel");
    }

    #[test]
    fn what_is_not_seen_has_no_part_in_means() {
        let texels = Texels::Srgb8(vec![[255, 0, 0, 255], [0, 255, 0, 0], [255, 0, 0, 255], [0, 0, 255, 0]].into());
        let t = Texture::new("leaf", 2, 2, texels).with_levels();
        assert_eq!(t.levels[0].texels.get(0), Vec4::new(1.0, 0.0, 0.0, FRACTION[128]));
        // Unless alpha is something else.
        let plain = Texture { levels: [].into(), ..t }.with_plain_levels();
        let texel = plain.levels[0].texels.get(0);
        assert!((texel - Vec4::new(0.5, 0.25, 0.25, 0.5)).abs().max_element() < 0.005, "{texel}");
    }

    #[test]
    fn the_srgb_curve_is_its_own_inverse() {
        for byte in 0..=255u8 {
            let linear = srgb_to_linear(f64::from(byte) / 255.0);
            assert_eq!((linear_to_srgb(linear) * 255.0 + 0.5) as u8, byte);
        }
    }
}
