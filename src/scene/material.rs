//! The terms of the shading formula that belong to a surface.

use glam::DVec2;

use crate::scene::Rgb;

/// A texture as a material uses it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextureRef {
    /// Position in the scene's list of textures.
    pub texture: u32,
    /// Texture coordinates are multiplied by this...
    pub scale: DVec2,
    /// ...and moved by this: `uv * scale + offset`.
    pub offset: DVec2,
}

impl TextureRef {
    /// The texture at this position of the scene's list, its coordinates as they are.
    pub fn new(texture: u32) -> Self {
        Self { texture, scale: DVec2::ONE, offset: DVec2::ZERO }
    }
}

/// A Phong material with mirror and transmission:
/// `I = Oa + sum_i Si Ipi [(1 - kt) Od (N.Li) + ks Os (R.V)^n] + kr Ir + kt It`.
///
/// All colours and weights are linear, per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// For messages, overrides and `info`.
    pub name: String,
    /// Oa. `None` is the scene's ambient factor times the diffuse colour.
    pub ambient: Option<Rgb>,
    /// Added to Oa: what the surface emits.
    pub emission: Rgb,
    /// Od.
    pub diffuse: Rgb,
    /// Multiplies Od (and Oa, unless that is set apart).
    pub diffuse_texture: Option<TextureRef>,
    /// Os.
    pub specular: Rgb,
    /// ks, the weight of the highlight.
    pub ks: Rgb,
    /// n, the exponent of the highlight.
    pub shininess: f32,
    /// kr, the weight of the mirror; in the seed it equals `ks`.
    pub kr: Rgb,
    /// kt, the weight of what is seen through the surface.
    pub kt: Rgb,
    /// Index of refraction inside, relative to outside.
    pub ior: f32,
    /// Shade with the face's normal even where the mesh has smooth ones.
    pub flat: bool,
}

impl Default for Material {
    /// A matt light grey.
    fn default() -> Self {
        Self {
            name: "default".into(),
            ambient: None,
            emission: Rgb::ZERO,
            diffuse: Rgb::splat(0.8),
            diffuse_texture: None,
            specular: Rgb::ONE,
            ks: Rgb::ZERO,
            shininess: 32.0,
            kr: Rgb::ZERO,
            kt: Rgb::ZERO,
            ior: 1.5,
            flat: false,
        }
    }
}

impl Material {
    /// Whether light passes through: then shadow rays are attenuated, not blocked.
    pub fn is_transmissive(&self) -> bool {
        self.kt != Rgb::ZERO
    }

    /// Whether it mirrors.
    pub fn is_reflective(&self) -> bool {
        self.kr != Rgb::ZERO
    }
}
