//! Materials and lights as the shaders take them.

use glam::{DVec2, DVec3, Vec3, Vec4};

use crate::math::vector::normalize;
use crate::scene::detail::{AlphaMode, Rule};
use crate::scene::{Falloff, Light, LightKind, Material, Rgb, Scene, Texture, TextureRef, luminance};

/// Lights that shaders have room for; of more, the brightest count.
pub const MOST_LIGHTS: usize = 16;

/// Glass stays visible: the least share that it hides of what is behind.
const LEAST_OPACITY: f32 = 0.15;

/// The terms of a material that do not differ from point to point but for its images.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// Added as it is.
    pub steady: Rgb,
    /// What the diffuse texture multiplies: ambient light on the diffuse colour, and the colour of what is unlit.
    pub tinted: Rgb,
    /// (1 - kt) Od.
    pub diffuse: Rgb,
    /// ks Os.
    pub shine: Rgb,
    /// n.
    pub exponent: f32,
    /// kr, which the background multiplies.
    pub mirror: Rgb,
    /// What the emission's image multiplies.
    pub glow: Rgb,
    /// Multiplies the diffuse colour.
    pub texture: Option<TextureRef>,
    /// Multiplies the glow.
    pub glow_texture: Option<TextureRef>,
    /// Multiplies the alpha of vertices and of the texture.
    pub alpha: f32,
    /// Below which alpha there is no surface; 0 where alpha means something else.
    pub cutoff: f32,
    /// Whether vertices' and the texture's alpha count.
    pub has_alpha: bool,
    /// Whether what is behind is seen.
    pub is_blended: bool,
    /// Whether backs are not there.
    pub single_sided: bool,
}

impl Terms {
    /// Those of one of the scene's materials.
    pub fn of(scene: &Scene, material: &Material) -> Self {
        let mut white = Material { diffuse_texture: None, ..material.clone() };
        let detail = material.detail.as_deref();
        let alpha = detail.and_then(|detail| detail.alpha);
        let glow_texture = detail.and_then(|detail| detail.emission);
        if let Some(detail) = &mut white.detail {
            (detail.alpha, detail.emission) = (None, None);
        }
        // Of all images but those that the shaders read, the mean.
        let point = white.at(Vec4::ONE, |texture| mean(&scene.textures[texture.texture as usize]));
        let is_unlit = detail.is_some_and(|detail| matches!(detail.rule, Rule::Unlit { .. }));
        let (emission, tinted) = if is_unlit { (Rgb::ZERO, point.emission) } else { (point.emission, Rgb::ZERO) };
        let ambient = if point.ambient.is_none() { scene.ambient * point.diffuse } else { Rgb::ZERO };
        let steady = point.ambient.unwrap_or(Rgb::ZERO);
        let mode = alpha.map(|alpha| alpha.mode);
        let cutoff = if let Some(AlphaMode::Mask { cutoff }) = mode { cutoff } else { 0.0 };
        let through = luminance(point.kt).clamp(0.0, 1.0) as f32;
        Self {
            steady: if glow_texture.is_some() { steady } else { steady + emission },
            tinted: tinted + ambient,
            diffuse: point.diffuse * (Rgb::ONE - point.kt),
            // Metals tint it by their image's mean.
            shine: material.ks * material.specular,
            exponent: point.shininess,
            mirror: material.kr,
            glow: if glow_texture.is_some() { emission } else { Rgb::ZERO },
            texture: material.diffuse_texture,
            glow_texture,
            alpha: alpha.map_or(1.0, |alpha| alpha.factor) * (1.0 - through).max(LEAST_OPACITY),
            cutoff,
            has_alpha: alpha.is_some(),
            is_blended: mode == Some(AlphaMode::Blend) || point.is_transmissive(),
            single_sided: material.single_sided,
        }
    }

    /// Whether everything behind it is hidden.
    pub fn hides(&self) -> bool {
        !self.is_blended && self.cutoff == 0.0 && !self.single_sided
    }
}

/// The mean of an image, or of a choice of its texels.
fn mean(texture: &Texture) -> Vec4 {
    const SIDE: u32 = 8;
    if !texture.levels.is_empty() {
        return texture.sample_footprint(DVec2::splat(0.5), f32::MAX);
    }
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(SIDE);
    let texels = (0..SIDE * SIDE).map(|i| texture.sample_footprint(DVec2::new(at(i % SIDE), at(i / SIDE)), 0.0));
    texels.sum::<Vec4>() / (SIDE * SIDE) as f32
}

/// The lights as arrays.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lights {
    /// Position, or the unit vector to the light; then 1 for a position.
    pub places: Vec<Vec4>,
    /// Colour, then 1 for a light that weakens with the square of the distance.
    pub colors: Vec<Vec4>,
    /// A spot's axis, then the cosine of its inner angle; -2 for lights without a cone.
    pub cones: Vec<Vec4>,
    /// The cosine of the outer angle.
    pub rims: Vec<f32>,
}

impl Lights {
    /// The brightest of a scene's lights, relative to `origin`.
    pub fn of(scene: &Scene, origin: DVec3) -> Self {
        let mut order: Vec<&Light> = scene.lights.iter().collect();
        order.sort_by(|a, b| luminance(b.color).total_cmp(&luminance(a.color)));
        let mut lights = Self::default();
        order.into_iter().take(MOST_LIGHTS).for_each(|light| lights.add(light, origin));
        lights
    }

    fn add(&mut self, light: &Light, origin: DVec3) {
        let (place, falloff, cone) = match light.kind {
            LightKind::Directional { direction } => {
                // What has no direction is told by the renderer.
                let Some(to_light) = normalize(-direction) else { return };
                (to_light.as_vec3().extend(0.0), Falloff::None, None)
            }
            LightKind::Point { position, falloff } => ((position - origin).as_vec3().extend(1.0), falloff, None),
            LightKind::Spot { position, direction, inner_angle, outer_angle, falloff } => {
                let Some(axis) = normalize(direction) else { return };
                let cone = (axis.as_vec3().extend(libm::cos(inner_angle) as f32), libm::cos(outer_angle) as f32);
                ((position - origin).as_vec3().extend(1.0), falloff, Some(cone))
            }
        };
        let (cone, rim) = cone.unwrap_or((Vec3::ZERO.extend(-2.0), -2.0));
        self.places.push(place);
        self.colors.push(light.color.extend(if falloff == Falloff::InverseSquare { 1.0 } else { 0.0 }));
        self.cones.push(cone);
        self.rims.push(rim);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_lights_count() {
        let light = |i: u32| Light {
            name: String::new(),
            kind: LightKind::Point { position: DVec3::X * f64::from(i), falloff: Falloff::None },
            color: Rgb::splat(i as f32),
        };
        let scene = Scene { lights: (0..40).map(light).collect(), ..Scene::default() };
        let lights = Lights::of(&scene, DVec3::ZERO);
        assert_eq!(lights.places.len(), MOST_LIGHTS);
        assert!(lights.places.iter().all(|place| place.x >= 24.0));
    }

    #[test]
    fn terms_are_those_of_the_formula() {
        let scene = Scene { ambient: Rgb::splat(0.25), ..Scene::default() };
        let material = Material { kt: Rgb::splat(0.5), ks: Rgb::splat(0.5), ..Material::default() };
        let terms = Terms::of(&scene, &material);
        assert_eq!((terms.tinted, terms.diffuse), (Rgb::splat(0.2), Rgb::splat(0.4)));
        assert_eq!((terms.shine, terms.steady), (Rgb::splat(0.5), Rgb::ZERO));
        assert!(terms.is_blended && !terms.hides());
        let own = Material { ambient: Some(Rgb::X), emission: Rgb::Y, ..Material::default() };
        assert_eq!(Terms::of(&scene, &own).steady, Rgb::new(1.0, 1.0, 0.0));
        assert_eq!(Terms::of(&scene, &own).tinted, Rgb::ZERO);
    }
}
