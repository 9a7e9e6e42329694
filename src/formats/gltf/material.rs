//! glTF materials, as the Phong terms that come closest.

use ::gltf::json::material::{AlphaMode, Material as Source};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Texture, texture};

use super::images::{Textures, uv_set};
use super::phong::Surface;
use crate::formats::{Ledger, Treatment};
use crate::scene::{Material, Rgb};

/// Reads a material. One whose numbers overflow becomes the neutral one, with a warning.
pub(super) fn read(number: usize, source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> Material {
    let name = source.name.clone().unwrap_or_else(|| format!("material {number}"));
    note_unread_parts(source, ledger);
    let material = if is_unlit(source) { unlit(source, textures, ledger) } else { shaded(source, textures, ledger) };
    let colors = [material.emission, material.diffuse, material.specular, material.ks, material.kr, material.kt];
    if colors.iter().all(|color| color.is_finite()) && material.ior.is_finite() {
        return Material { name, ..material };
    }
    ledger.note(Treatment::Warning, "material with numbers out of range: neutral material used", 1);
    Material { name, ..Material::default() }
}

fn shaded(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> Material {
    let emission = emission(source, textures, ledger);
    let (mut surface, ior) = match specular_glossiness(source) {
        Some(_) => (from_specular_glossiness(source, textures, ledger), 1.5),
        None => from_metallic_roughness(source, textures, ledger),
    };
    surface.alpha = alpha(source, textures, ledger);
    let material = surface.phong();
    // What is blended, and what is thin, lets rays through unbent.
    let bends = surface.alpha == 1.0 && is_solid(source, ledger);
    Material {
        emission: emission * surface.alpha,
        diffuse_texture: base_texture(source).and_then(|info| textures.refer(info, ledger)),
        ior: if bends || !material.is_transmissive() { ior.max(1.0) } else { 1.0 },
        ..material
    }
}

/// The textures that [`read`] will ask for.
pub(super) fn textures_of(source: &Source) -> impl Iterator<Item = Index<Texture>> {
    let data = match specular_glossiness(source) {
        Some(specular) => specular.specular_glossiness_texture.as_ref(),
        None => source.pbr_metallic_roughness.metallic_roughness_texture.as_ref(),
    };
    [base_texture(source), data, source.emissive_texture.as_ref()].into_iter().flatten().map(|info| info.index)
}

/// The texture coordinate set of the base colour.
pub(super) fn base_uv_set(source: &Source) -> u32 {
    base_texture(source).map_or(0, uv_set)
}

fn specular_glossiness(source: &Source) -> Option<&::gltf::json::extensions::material::PbrSpecularGlossiness> {
    source.extensions.as_ref()?.pbr_specular_glossiness.as_ref()
}

fn base_texture(source: &Source) -> Option<&texture::Info> {
    match specular_glossiness(source) {
        Some(specular) => specular.diffuse_texture.as_ref(),
        None => source.pbr_metallic_roughness.base_color_texture.as_ref(),
    }
}

/// Base colour and alpha factors.
fn base_factor(source: &Source) -> [f32; 4] {
    match specular_glossiness(source) {
        Some(specular) => specular.diffuse_factor.0,
        None => source.pbr_metallic_roughness.base_color_factor.0,
    }
}

/// The base colour: its factor alone, and with the mean of its texture.
fn base_color(source: &Source, textures: &mut Textures) -> (Rgb, Rgb) {
    let [r, g, b, _] = base_factor(source);
    let factor = Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE);
    let mean = base_texture(source).and_then(|info| textures.mean(info.index));
    (factor, mean.map_or(factor, |mean| factor * mean.color))
}

fn from_metallic_roughness(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> (Surface, f32) {
    let pbr = &source.pbr_metallic_roughness;
    let (factor, base) = base_color(source, textures);
    let (mut metallic, mut roughness) = (pbr.metallic_factor.0, pbr.roughness_factor.0);
    if let Some(info) = &pbr.metallic_roughness_texture {
        ledger.note(Treatment::Approximated, "metallicRoughnessTexture: its mean is used", 1);
        if let Some(mean) = textures.mean(info.index) {
            roughness *= mean.values.y;
            metallic *= mean.values.z;
        }
    }
    let metallic = metallic.clamp(0.0, 1.0);
    let extensions = source.extensions.as_ref();
    let ior = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
    let transmission = extensions.and_then(|e| e.transmission.as_ref()).map_or(0.0, |t| t.transmission_factor.0);

    // Fresnel's reflectance of a dielectric at normal incidence, weakened and tinted by KHR_materials_specular.
    let ratio = (ior - 1.0) / (ior + 1.0);
    let mut dielectric = Rgb::splat(ratio * ratio);
    if let Some(specular) = extensions.and_then(|e| e.specular.as_ref()) {
        let tint = Rgb::from_array(specular.specular_color_factor.0);
        dielectric = (dielectric * tint).min(Rgb::ONE) * specular.specular_factor.0;
    }
    let surface = Surface {
        matt: factor * (1.0 - metallic),
        metal: factor * metallic,
        f0: dielectric * (1.0 - metallic) + base * metallic,
        roughness,
        transmission: transmission.clamp(0.0, 1.0) * (1.0 - metallic),
        tint: base,
        alpha: 1.0,
    };
    (surface, ior)
}

/// KHR_materials_pbrSpecularGlossiness: reflectance beyond a dielectric's counts as metal.
fn from_specular_glossiness(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> Surface {
    let (factor, base) = base_color(source, textures);
    let (mut f0, mut glossiness) = (Rgb::splat(0.04), 0.0);
    if let Some(specular) = specular_glossiness(source) {
        f0 = Rgb::from_array(specular.specular_factor.0);
        glossiness = specular.glossiness_factor.0;
        if let Some(info) = &specular.specular_glossiness_texture {
            ledger.note(Treatment::Approximated, "specularGlossinessTexture: its mean is used", 1);
            if let Some(mean) = textures.mean(info.index) {
                f0 *= mean.color;
                glossiness *= mean.values.w;
            }
        }
    }
    let f0 = f0.clamp(Rgb::ZERO, Rgb::ONE);
    Surface {
        matt: factor * (1.0 - f0.max_element()),
        metal: (f0 - 0.04).max(Rgb::ZERO),
        f0,
        roughness: 1.0 - glossiness,
        transmission: 0.0,
        tint: base,
        alpha: 1.0,
    }
}

fn emission(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> Rgb {
    let strength = source.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
    let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
    let factor = Rgb::from_array(source.emissive_factor.0).max(Rgb::ZERO) * strength;
    let Some(info) = source.emissive_texture.as_ref().filter(|_| factor != Rgb::ZERO) else { return factor };
    ledger.note(Treatment::Approximated, "emissiveTexture: its mean is emitted evenly", 1);
    // Such a texture is black but for a few spots: without it nothing can be said of where the light is.
    textures.mean(info.index).map_or(Rgb::ZERO, |mean| factor * mean.color)
}

fn is_unlit(source: &Source) -> bool {
    source.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some())
}

/// KHR_materials_unlit: the base colour as it is, whatever the lights. Emission has no texture here.
fn unlit(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> Material {
    if base_texture(source).is_some() {
        ledger.note(Treatment::Approximated, "KHR_materials_unlit: the mean of the base texture is emitted", 1);
    }
    let kt = Rgb::splat(1.0 - alpha(source, textures, ledger));
    let emission = base_color(source, textures).1 * (Rgb::ONE - kt);
    Material { ambient: Some(Rgb::ZERO), emission, diffuse: Rgb::ZERO, kt, ior: 1.0, ..Material::default() }
}

/// How much of the surface is there.
fn alpha(source: &Source, textures: &mut Textures, ledger: &mut Ledger) -> f32 {
    match source.alpha_mode {
        Checked::Valid(AlphaMode::Blend) => {
            let mean =
                base_texture(source).and_then(|info| textures.mean(info.index)).map_or(1.0, |mean| mean.values.w);
            if mean == 1.0 {
                ledger.note(Treatment::Honoured, "alphaMode BLEND", 1);
            } else {
                ledger.note(Treatment::Approximated, "alphaMode BLEND: the mean of the texture's alpha is used", 1);
            }
            (base_factor(source)[3] * mean).clamp(0.0, 1.0)
        }
        Checked::Valid(AlphaMode::Mask) => {
            ledger.note(Treatment::Ignored, "alphaMode MASK", 1);
            1.0
        }
        _ => 1.0,
    }
}

/// Whether the surface bounds a solid that bends light: KHR_materials_volume with a thickness. Without, glTF means a
/// thin wall, through which light goes straight.
fn is_solid(source: &Source, ledger: &mut Ledger) -> bool {
    let Some(volume) = source.extensions.as_ref().and_then(|extensions| extensions.volume.as_ref()) else {
        return false;
    };
    if volume.attenuation_distance.0.is_finite() {
        ledger.note(Treatment::Ignored, "KHR_materials_volume: absorption", 1);
    }
    volume.thickness_factor.0 > 0.0
}

fn note_unread_parts(source: &Source, ledger: &mut Ledger) {
    let extensions = source.extensions.as_ref();
    let specular = extensions.and_then(|extensions| extensions.specular.as_ref());
    let transmission = extensions.and_then(|extensions| extensions.transmission.as_ref());
    let has_specular = specular.is_some_and(|s| s.specular_texture.is_some() || s.specular_color_texture.is_some());
    let has_transmission = transmission.is_some_and(|t| t.transmission_texture.is_some());
    for (present, feature) in [
        (source.normal_texture.is_some(), "normalTexture"),
        (source.occlusion_texture.is_some(), "occlusionTexture"),
        (has_specular, "specularTexture, specularColorTexture"),
        (has_transmission, "transmissionTexture"),
    ] {
        if present {
            ledger.note(Treatment::Ignored, feature, 1);
        }
    }
}
