//! What differs from point to point of a surface beside its diffuse colour: images of alpha, of light, of what a microfacet
//! model says, and of normals.

use glam::Vec4;

use crate::scene::microfacet::Surface;
use crate::scene::{Material, Rgb, TextureRef, luminance};

/// What a material's terms are at each point.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Detail {
    /// By what rule the terms come from images.
    pub rule: Rule,
    /// Multiplies the emission.
    pub emission: Option<TextureRef>,
    /// Where the surface is there; `None` if it is everywhere.
    pub alpha: Option<Alpha>,
    /// Where the normal points to.
    pub normal: Option<NormalMap>,
}

/// How terms come from images.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Rule {
    /// They are the material's own, but for the highlight's weight, which an image may multiply.
    Phong {
        /// Multiplies ks.
        highlight: Option<TextureRef>,
    },
    /// Those of glTF's metallic-roughness model.
    MetallicRoughness(MetallicRoughness),
    /// Those of KHR_materials_pbrSpecularGlossiness.
    SpecularGlossiness(SpecularGlossiness),
    /// The colour is emitted, whatever the lights: KHR_materials_unlit.
    Unlit {
        /// The base colour, which the diffuse texture multiplies.
        color: Rgb,
    },
}

/// How much of a surface is there.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Alpha {
    /// What is done with it.
    pub mode: AlphaMode,
    /// Multiplies the alpha of the diffuse texture and of vertices.
    pub factor: f32,
    /// Multiplies it too.
    pub map: Option<(TextureRef, Channel)>,
}

/// What alpha means.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum AlphaMode {
    /// The surface is there where alpha is not below this, and nowhere else.
    Mask {
        /// From 0 to 1; above that there is no surface.
        cutoff: f32,
    },
    /// Alpha of the surface is seen, and the rest of what lies behind.
    Blend,
}

/// Which of an image's values is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Channel {
    /// The first.
    Red,
    /// The second.
    Green,
    /// The third.
    Blue,
    /// The fourth.
    Alpha,
    /// What the eye sees of the first three (Rec. 709).
    Luminance,
}

/// An image of normals: each texel's red, green and blue, from 0 to 1, stand for -1 to 1 along the tangent (growing u), the
/// bitangent (growing v, up) and the normal.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NormalMap {
    /// The image; its values are not colours.
    pub texture: TextureRef,
    /// Multiplies the first two.
    pub scale: f32,
}

/// glTF's metallic-roughness material with KHR_materials_ior, _specular and _transmission.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct MetallicRoughness {
    /// The base colour, which the diffuse texture multiplies.
    pub base: Rgb,
    /// From 0, a dielectric, to 1.
    pub metallic: f32,
    /// From 0 to 1.
    pub roughness: f32,
    /// Blue multiplies `metallic`, green `roughness`.
    pub metallic_roughness: Option<TextureRef>,
    /// Index of refraction, which gives the reflectance of dielectrics.
    pub ior: f32,
    /// Multiplies that reflectance.
    pub specular: f32,
    /// Alpha multiplies `specular`.
    pub specular_map: Option<TextureRef>,
    /// Tints that reflectance.
    pub specular_color: Rgb,
    /// Multiplies `specular_color`.
    pub specular_color_map: Option<TextureRef>,
    /// Share of the light that enters a dielectric and goes through.
    pub transmission: f32,
    /// Red multiplies `transmission`.
    pub transmission_map: Option<TextureRef>,
}

/// KHR_materials_pbrSpecularGlossiness.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SpecularGlossiness {
    /// The diffuse colour, which the diffuse texture multiplies.
    pub diffuse: Rgb,
    /// Reflectance at normal incidence.
    pub specular: Rgb,
    /// From 0 to 1: one less the roughness.
    pub glossiness: f32,
    /// Multiplies `specular`, and alpha `glossiness`.
    pub map: Option<TextureRef>,
}

impl Detail {
    /// Nothing, for a material to be given some.
    pub const NONE: Self = Self { rule: Rule::Phong { highlight: None }, emission: None, alpha: None, normal: None };

    /// Every use of a texture.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let alpha = self.alpha.iter().filter_map(|alpha| alpha.map.as_ref()).map(|(texture, _)| texture);
        let normal = self.normal.iter().map(|normal| &normal.texture);
        self.rule.textures().into_iter().flatten().chain(&self.emission).chain(alpha).chain(normal)
    }

    /// The same, to be changed.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        let alpha = self.alpha.iter_mut().filter_map(|alpha| alpha.map.as_mut()).map(|(texture, _)| texture);
        let normal = self.normal.iter_mut().map(|normal| &mut normal.texture);
        self.rule.textures_mut().into_iter().flatten().chain(&mut self.emission).chain(alpha).chain(normal)
    }

    /// A material's terms, in which only the diffuse colour is that of the point, made those of a point where `base` is
    /// the colour of vertices times that of the diffuse texture.
    pub(super) fn apply(&self, terms: Material, base: Vec4, texel: impl Fn(&TextureRef) -> Vec4) -> Material {
        let mut terms = match &self.rule {
            Rule::Phong { highlight } => {
                let weight = highlight.as_ref().map_or(Rgb::ONE, |texture| texel(texture).truncate());
                Material { ks: terms.ks * weight, ..terms }
            }
            Rule::MetallicRoughness(model) => terms.with_phong_of(&model.surface(base.truncate(), &texel)),
            Rule::SpecularGlossiness(model) => terms.with_phong_of(&model.surface(base.truncate(), &texel)),
            Rule::Unlit { color } => Material { emission: *color * base.truncate(), ..terms },
        };
        if let Some(texture) = &self.emission {
            terms.emission *= texel(texture).truncate();
        }
        match &self.alpha {
            Some(alpha) if alpha.mode == AlphaMode::Blend => terms.blended(alpha.at(base.w, texel)),
            _ => terms,
        }
    }
}

impl Material {
    /// This material with the terms that a microfacet surface has.
    pub fn with_phong_of(self, surface: &Surface) -> Self {
        let Material { diffuse, specular, ks, shininess, kr, kt, .. } = surface.phong();
        Self { diffuse, specular, ks, shininess, kr, kt, ..self }
    }
}

impl Rule {
    /// Whether light may go through at some points, even where it does not at the mean of all images.
    pub fn transmits(&self) -> bool {
        matches!(self, Self::MetallicRoughness(model) if model.transmission > 0.0)
    }

    /// The surface for images that are white throughout; `None` for rules that are no microfacet model.
    pub fn plain_surface(&self) -> Option<Surface> {
        let white = |_: &TextureRef| Vec4::ONE;
        match self {
            Self::MetallicRoughness(model) => Some(model.surface(Rgb::ONE, white)),
            Self::SpecularGlossiness(model) => Some(model.surface(Rgb::ONE, white)),
            Self::Phong { .. } | Self::Unlit { .. } => None,
        }
    }

    fn textures(&self) -> [Option<&TextureRef>; 4] {
        match self {
            Self::Phong { highlight } => [highlight.as_ref(), None, None, None],
            Self::MetallicRoughness(model) => {
                let MetallicRoughness {
                    metallic_roughness, specular_map, specular_color_map, transmission_map, ..
                } = model;
                [metallic_roughness, specular_map, specular_color_map, transmission_map].map(Option::as_ref)
            }
            Self::SpecularGlossiness(model) => [model.map.as_ref(), None, None, None],
            Self::Unlit { .. } => [None; 4],
        }
    }

    fn textures_mut(&mut self) -> [Option<&mut TextureRef>; 4] {
        match self {
            Self::Phong { highlight } => [highlight.as_mut(), None, None, None],
            Self::MetallicRoughness(model) => {
                let MetallicRoughness {
                    metallic_roughness, specular_map, specular_color_map, transmission_map, ..
                } = model;
                [metallic_roughness, specular_map, specular_color_map, transmission_map].map(Option::as_mut)
            }
            Self::SpecularGlossiness(model) => [model.map.as_mut(), None, None, None],
            Self::Unlit { .. } => [None, None, None, None],
        }
    }
}

impl Alpha {
    /// The share of the surface that is there, 0 for a hole, where the diffuse texture and vertices have this alpha.
    pub fn at(&self, alpha: f32, texel: impl Fn(&TextureRef) -> Vec4) -> f32 {
        let map = self.map.as_ref().map_or(1.0, |(texture, channel)| channel.of(texel(texture)));
        let alpha = (alpha * self.factor * map).clamp(0.0, 1.0);
        match self.mode {
            AlphaMode::Mask { cutoff } if alpha < cutoff => 0.0,
            AlphaMode::Mask { .. } => 1.0,
            AlphaMode::Blend => alpha,
        }
    }
}

impl Channel {
    /// Its value.
    pub fn of(self, texel: Vec4) -> f32 {
        match self {
            Self::Red => texel.x,
            Self::Green => texel.y,
            Self::Blue => texel.z,
            Self::Alpha => texel.w,
            Self::Luminance => luminance(texel.truncate()) as f32,
        }
    }
}

impl MetallicRoughness {
    /// glTF's default material: a white, rough metal.
    pub const DEFAULT: Self = Self {
        base: Rgb::ONE,
        metallic: 1.0,
        roughness: 1.0,
        metallic_roughness: None,
        ior: 1.5,
        specular: 1.0,
        specular_map: None,
        specular_color: Rgb::ONE,
        specular_color_map: None,
        transmission: 0.0,
        transmission_map: None,
    };

    /// The surface at a point where `color` multiplies the base.
    pub fn surface(&self, color: Rgb, texel: impl Fn(&TextureRef) -> Vec4) -> Surface {
        let texel = |map: &Option<TextureRef>| map.as_ref().map_or(Vec4::ONE, &texel);
        let base = (self.base * color).clamp(Rgb::ZERO, Rgb::ONE);
        let data = texel(&self.metallic_roughness);
        let metallic = (self.metallic * data.z).clamp(0.0, 1.0);
        // Fresnel's reflectance of a dielectric at normal incidence, weakened and tinted by KHR_materials_specular.
        let ratio = (self.ior - 1.0) / (self.ior + 1.0);
        let tint = self.specular_color * texel(&self.specular_color_map).truncate();
        let dielectric = (tint * (ratio * ratio)).min(Rgb::ONE) * (self.specular * texel(&self.specular_map).w);
        let transmission = (self.transmission * texel(&self.transmission_map).x).clamp(0.0, 1.0);
        Surface {
            matt: base * (1.0 - metallic),
            metal: base * metallic,
            f0: dielectric * (1.0 - metallic) + base * metallic,
            roughness: self.roughness * data.y,
            transmission: transmission * (1.0 - metallic),
            tint: base,
        }
    }
}

impl SpecularGlossiness {
    /// The surface at a point where `color` multiplies the diffuse colour: reflectance beyond a dielectric's counts as
    /// metal.
    pub fn surface(&self, color: Rgb, texel: impl Fn(&TextureRef) -> Vec4) -> Surface {
        let base = (self.diffuse * color).clamp(Rgb::ZERO, Rgb::ONE);
        let map = self.map.as_ref().map_or(Vec4::ONE, texel);
        let f0 = (self.specular * map.truncate()).clamp(Rgb::ZERO, Rgb::ONE);
        Surface {
            matt: base * (1.0 - f0.max_element()),
            metal: (f0 - 0.04).max(Rgb::ZERO),
            f0,
            roughness: 1.0 - self.glossiness * map.w,
            transmission: 0.0,
            tint: base,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn textured(detail: Detail) -> Material {
        let diffuse_texture = Some(TextureRef::new(0));
        Material { diffuse_texture, detail: Some(Box::new(detail)), ..Material::default() }
    }

    #[test]
    fn masks_are_holes_or_nothing_and_blends_are_shares() {
        let texel = |texture: &TextureRef| Vec4::new(1.0, 0.5, 0.25, [0.5, 0.0][texture.texture as usize]);
        let with = |mode, factor, map| textured(Detail { alpha: Some(Alpha { mode, factor, map }), ..Detail::NONE });
        let mask = |cutoff, factor| with(AlphaMode::Mask { cutoff }, factor, None);
        assert_eq!(mask(0.5, 1.0).alpha_at(Vec4::ONE, texel), 1.0);
        assert_eq!(mask(0.5, 0.99).alpha_at(Vec4::ONE, texel), 0.0);
        assert_eq!(mask(0.5, 1.0).alpha_at(Vec4::splat(0.9), texel), 0.0);
        assert_eq!(mask(0.0, 0.0).alpha_at(Vec4::ONE, texel), 1.0);
        assert_eq!(mask(0.5, 1.0).at(Vec4::ONE, texel).kt, Rgb::ZERO);
        assert!(mask(0.5, 1.0).lets_light_through() && !mask(0.5, 1.0).is_transmissive());

        let red = with(AlphaMode::Blend, 1.0, Some((TextureRef::new(1), Channel::Green)));
        assert_eq!(red.alpha_at(Vec4::ONE, texel), 0.25);
        let terms = red.at(Vec4::ONE, texel);
        assert_eq!((terms.kt, terms.ior), (Rgb::splat(0.75), 1.0));
        assert_eq!(terms.diffuse, Rgb::new(0.8, 0.4, 0.2));
        assert_eq!(textured(Detail::NONE).alpha_at(Vec4::ZERO, texel), 1.0);
    }

    #[test]
    fn images_of_metalness_and_roughness_are_read_by_channel() {
        let model = MetallicRoughness {
            metallic_roughness: Some(TextureRef::new(1)),
            base: Rgb::new(1.0, 0.5, 0.5),
            ..MetallicRoughness::DEFAULT
        };
        let metalness = |z: f32| move |_: &TextureRef| Vec4::new(9.0, 0.5, z, 9.0);
        let metal = model.surface(Rgb::new(1.0, 1.0, 0.5), metalness(1.0));
        assert_eq!((metal.f0, metal.matt, metal.roughness), (Rgb::new(1.0, 0.5, 0.25), Rgb::ZERO, 0.5));
        let plastic = model.surface(Rgb::ONE, metalness(0.0));
        assert!((plastic.f0 - 0.04).abs().max_element() < 1e-7 && plastic.metal == Rgb::ZERO);
        let detail = Detail { rule: Rule::MetallicRoughness(model), ..Detail::NONE };
        let material = Material { detail: Some(Box::new(detail)), ..Material::default() };
        let terms = material.at(Vec4::new(1.0, 1.0, 0.5, 1.0), metalness(1.0));
        assert_eq!((terms.kr, terms.shininess), (metal.phong().kr, metal.phong().shininess));
    }

    #[test]
    fn every_texture_is_listed_once() {
        let texture = |number| Some(TextureRef::new(number));
        let model = MetallicRoughness {
            metallic_roughness: texture(1),
            specular_map: texture(2),
            specular_color_map: texture(3),
            transmission_map: texture(4),
            ..MetallicRoughness::DEFAULT
        };
        let mut material = textured(Detail {
            rule: Rule::MetallicRoughness(model),
            emission: texture(5),
            alpha: Some(Alpha { mode: AlphaMode::Blend, factor: 1.0, map: Some((TextureRef::new(6), Channel::Red)) }),
            normal: Some(NormalMap { texture: TextureRef::new(7), scale: 1.0 }),
        });
        assert_eq!(material.textures().map(|texture| texture.texture).collect::<Vec<_>>(), (0..8).collect::<Vec<_>>());
        material.textures_mut().for_each(|texture| texture.texture += 10);
        assert_eq!(material.textures().map(|texture| texture.texture).sum::<u32>(), 28 + 80);
    }
}
