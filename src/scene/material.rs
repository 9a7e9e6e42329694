//! The terms of the shading formula that belong to a surface.

use glam::{DMat2, DVec2, Vec4};

use crate::scene::Rgb;
use crate::scene::detail::Detail;

/// A texture as a material uses it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TextureRef {
    /// Position in the scene's list of textures.
    pub texture: u32,
    /// Whether the mesh's second set of texture coordinates is used.
    pub second_uvs: bool,
    /// Texture coordinates, whose v goes up, are multiplied by this...
    pub matrix: DMat2,
    /// ...and moved by this.
    pub offset: DVec2,
}

impl TextureRef {
    /// The texture at this position of the scene's list, its coordinates as they are.
    pub fn new(texture: u32) -> Self {
        Self::scaled(texture, DVec2::ONE, DVec2::ZERO)
    }

    /// The same with coordinates `uv * scale + offset`.
    pub fn scaled(texture: u32, scale: DVec2, offset: DVec2) -> Self {
        Self { texture, second_uvs: false, matrix: DMat2::from_diagonal(scale), offset }
    }

    /// Where a point with these texture coordinates is in the image.
    #[inline(always)]
    pub fn place(&self, uv: DVec2) -> DVec2 {
        self.matrix.x_axis * uv.x + self.matrix.y_axis * uv.y + self.offset
    }
}

/// A Phong material with mirror and transmission:
/// `I = Oa + sum_i Si Ipi [(1 - kt) Od (N.Li) + ks Os (R.V)^n] + kr Ir + kt It`.
///
/// All colours and weights are linear, per channel. Where there is [`detail`](Self::detail) they are means, and
/// [`at`](Self::at) gives those of a point.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
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
    /// What is absorbed inside, per unit of length: over a distance d there remains `exp(-absorption d)` (Beer's law).
    pub absorption: Rgb,
    /// How much of the surface is there: multiplies the ambient colour where that is the scene's.
    pub coverage: f32,
    /// Shade with the face's normal even where the mesh has smooth ones.
    pub flat: bool,
    /// Whether the backs of triangles are not there.
    pub single_sided: bool,
    /// What else differs from point to point; `None` for most materials, which then cost nothing more.
    pub detail: Option<Box<Detail>>,
}

impl Default for Material {
    /// A matt light grey.
    fn default() -> Self {
        Self { name: "default".into(), diffuse: Rgb::splat(0.8), ks: Rgb::ZERO, ..Self::NAMELESS }
    }
}

impl Material {
    /// Black, for others to be made from without taking memory.
    pub(crate) const NAMELESS: Self = Self {
        name: String::new(),
        ambient: None,
        emission: Rgb::ZERO,
        diffuse: Rgb::ZERO,
        diffuse_texture: None,
        specular: Rgb::ONE,
        ks: Rgb::ZERO,
        shininess: 32.0,
        kr: Rgb::ZERO,
        kt: Rgb::ZERO,
        ior: 1.5,
        absorption: Rgb::ZERO,
        coverage: 1.0,
        flat: false,
        single_sided: false,
        detail: None,
    };

    /// Whether light passes through.
    pub fn is_transmissive(&self) -> bool {
        self.kt != Rgb::ZERO
    }

    /// Whether light may pass where the surface is.
    fn may_transmit(&self) -> bool {
        self.is_transmissive() || self.detail.as_ref().is_some_and(|detail| detail.rule.transmits())
    }

    /// Whether light may pass somewhere: then shadow rays are attenuated, not blocked.
    pub fn lets_light_through(&self) -> bool {
        self.may_transmit() || self.has_holes()
    }

    /// Whether the surface may not be there at some points.
    pub fn has_holes(&self) -> bool {
        self.single_sided || self.has_alpha()
    }

    /// Whether alpha may differ from 1.
    pub fn has_alpha(&self) -> bool {
        self.detail.as_ref().is_some_and(|detail| detail.alpha.is_some())
    }

    /// Whether it mirrors.
    pub fn is_reflective(&self) -> bool {
        self.kr != Rgb::ZERO
    }

    /// Whether anything is absorbed inside.
    pub fn is_absorbing(&self) -> bool {
        self.absorption != Rgb::ZERO
    }

    /// What is left of light that went so far inside.
    pub fn left_after(&self, distance: f64) -> Rgb {
        Rgb::from_array(self.absorption.to_array().map(|share| libm::exp(-f64::from(share) * distance) as f32))
    }

    /// Every use of a texture.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        self.diffuse_texture.iter().chain(self.detail.iter().flat_map(|detail| detail.textures()))
    }

    /// The same, to be changed.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        self.diffuse_texture.iter_mut().chain(self.detail.iter_mut().flat_map(|detail| detail.textures_mut()))
    }

    /// The terms at a point where vertices have a colour and `texel` gives what images have, both with alpha and linear;
    /// without name, texture and detail.
    pub fn at(&self, color: Vec4, texel: impl Fn(&TextureRef) -> Vec4) -> Self {
        let base = self.diffuse_texture.as_ref().map_or(color, |texture| color * texel(texture));
        let terms = Self {
            ambient: self.ambient,
            emission: self.emission,
            diffuse: self.diffuse * base.truncate(),
            specular: self.specular,
            ks: self.ks,
            shininess: self.shininess,
            kr: self.kr,
            kt: self.kt,
            ior: self.ior,
            absorption: self.absorption,
            coverage: self.coverage,
            flat: self.flat,
            single_sided: self.single_sided,
            ..Self::NAMELESS
        };
        match &self.detail {
            Some(detail) => detail.apply(terms, base, texel),
            None => terms,
        }
    }

    /// How much of the surface is there at a point, from 0 to 1, given as for [`at`](Self::at): 0 for a hole.
    pub fn alpha_at(&self, color: Vec4, texel: impl Fn(&TextureRef) -> Vec4) -> f32 {
        let Some(alpha) = self.detail.as_ref().and_then(|detail| detail.alpha.as_ref()) else { return 1.0 };
        let base = self.diffuse_texture.as_ref().map_or(1.0, |texture| texel(texture).w);
        alpha.at(color.w * base, texel)
    }

    /// kt of a point, given as for [`at`](Self::at), 1 for a hole: what [`at`](Self::at) says, without its other terms where
    /// they play no part.
    pub fn passes_at(&self, color: Vec4, texel: impl Fn(&TextureRef) -> Vec4) -> Rgb {
        let alpha = self.alpha_at(color, &texel);
        if alpha > 0.0 && self.may_transmit() { self.at(color, texel).kt } else { Rgb::splat(1.0 - alpha) }
    }

    /// The terms of a surface of which only a share is there and hides what lies behind, straight on: alpha blending.
    pub fn blended(self, alpha: f32) -> Self {
        let alpha = alpha.clamp(0.0, 1.0);
        if alpha == 1.0 {
            return self;
        }
        let kr = self.kr * alpha;
        Self {
            emission: self.emission * alpha,
            ambient: self.ambient.map(|ambient| ambient * alpha),
            ks: self.ks * alpha,
            kr,
            kt: (self.kt * alpha + Rgb::splat(1.0 - alpha)).min(Rgb::ONE - kr),
            ior: 1.0,
            coverage: self.coverage * alpha,
            ..self
        }
    }
}
