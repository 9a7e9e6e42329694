//! Images on surfaces: 8-bit or float texels, wrap modes, nearest and bilinear lookup in linear light.

use std::sync::{Arc, LazyLock};

use glam::DVec2;

use crate::scene::Rgb;

/// What happens to texture coordinates outside [0, 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
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
    /// Linear red, green, blue.
    Linear32(Arc<[[f32; 3]]>),
}

impl Texels {
    /// Whether both are one piece of memory; equal texels of two images are not.
    pub fn is_shared_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Srgb8(own), Self::Srgb8(other)) => Arc::ptr_eq(own, other),
            (Self::Linear32(own), Self::Linear32(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
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
}

/// sRGB bytes to linear values.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_to_linear(byte as f64 / 255.0) as f32));

/// The sRGB curve from encoded to linear (IEC 61966-2-1).
pub fn srgb_to_linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// The sRGB curve from linear to encoded.
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

impl Texture {
    /// One texel, linear.
    #[inline]
    fn texel(&self, x: u32, y: u32) -> Rgb {
        let at = y as usize * self.width as usize + x as usize;
        match &self.texels {
            Texels::Srgb8(texels) => {
                let [r, g, b, _] = texels[at];
                Rgb::new(LINEAR[r as usize], LINEAR[g as usize], LINEAR[b as usize])
            }
            Texels::Linear32(texels) => Rgb::from_array(texels[at]),
        }
    }

    /// The linear colour at texture coordinates whose origin is the image's lower left corner, v up.
    ///
    /// Coordinates that are not finite read the texel at (0, 0).
    pub fn sample(&self, uv: DVec2) -> Rgb {
        let uv = if uv.is_finite() { uv } else { DVec2::ZERO };
        let x = wrap(uv.x, self.wrap[0]) * f64::from(self.width);
        let y = wrap(1.0 - uv.y, self.wrap[1]) * f64::from(self.height);
        match self.filter {
            Filter::Nearest => {
                let index = |position: f64, size: u32| (position as u32).min(size - 1);
                self.texel(index(x, self.width), index(y, self.height))
            }
            Filter::Linear => {
                let (x0, x1, fx) = neighbours(x, self.width, self.wrap[0]);
                let (y0, y1, fy) = neighbours(y, self.height, self.wrap[1]);
                let top = self.texel(x0, y0) * (1.0 - fx) + self.texel(x1, y0) * fx;
                let bottom = self.texel(x0, y1) * (1.0 - fx) + self.texel(x1, y1) * fx;
                top * (1.0 - fy) + bottom * fy
            }
        }
    }

    /// Bytes of the texels.
    pub fn bytes(&self) -> usize {
        match &self.texels {
            Texels::Srgb8(texels) => std::mem::size_of_val::<[_]>(texels),
            Texels::Linear32(texels) => std::mem::size_of_val::<[_]>(texels),
        }
    }
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
        Texture {
            name: "checker".into(),
            width: 2,
            height: 2,
            texels: Texels::Srgb8(vec![black, white, white, black].into()),
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Nearest,
        }
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
    fn the_srgb_curve_is_its_own_inverse() {
        for byte in 0..=255u8 {
            let linear = srgb_to_linear(f64::from(byte) / 255.0);
            assert_eq!((linear_to_srgb(linear) * 255.0 + 0.5) as u8, byte);
        }
    }
}
