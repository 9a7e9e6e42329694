//! The rule by which an MTL material becomes one of ours.
//!
//! MTL describes a local shading model of 1995, and exporters fill it in by habits of their own. The rule reads it as
//! its specification (Wavefront, "MTL material format") says, except where the habits are stronger.
//!
//! | MTL | here |
//! |---|---|
//! | `Kd`, `map_Kd` | diffuse, and its texture, which it multiplies; a black `Kd` under a texture counts as white; the texture's own alpha is not used, as in Blender |
//! | `Ka` | not used: the ambient term is the scene's ambient factor times the base colour |
//! | `Ks` | `ks`, the highlight's weight, from `illum 2` on; without `illum` as for 2 |
//! | `Ns` | `shininess`, at least 1 |
//! | `map_Ks` | multiplies `ks`, but not the mirror; a `Ks` that is not given counts as white under it |
//! | `Ke`, `map_Ke` | `emission` and its texture: the surface is seen bright, but does not light others; a black `Ke` under a texture counts as white |
//! | `Pr`, `Pm`, `map_Pr`, `map_Pm` | glTF's metallic-roughness rule with the base `Kd`, instead of `Ks`, `Ns` and `illum`; not for glass |
//! | `norm`, `map_Bump`, `bump` | a normal map; heights become one |
//! | `illum 0` to `2` | no mirror |
//! | `illum 3`, `5`, `8` | `kr = Ks`; the Fresnel effect of 5 is left out, because Phong mirrors do not depend on the angle |
//! | `illum 6`, `7` | glass: see below |
//! | `illum 4`, `9` | a blend where `d` is below 1, glass where `Ni` is above 1, and otherwise as `illum 2`: Maya writes `illum 4`, `Ni 1.00` and no `d` for everything |
//! | `illum 10` | as 2: shadow catchers are not known here |
//! | `map_d` | a blend too, times `d`: by the image's alpha if it has one that varies, otherwise by its luminance |
//! | `d`, `Tr` (which is 1 - d) | below 1, other than for glass: a blend. `Tr 1` alone counts as opaque: some exporters mean that |
//!
//! **Glass** has `ior = Ni` (1.5 where that is not given) and `kr` = the lesser of `Ks` and what a surface of that index
//! mirrors head-on, `((Ni - 1) / (Ni + 1))^2`; 0 for `illum 9`, which has no reflections. Files put the highlight's
//! weight into `Ks`, often 1, and would be solid mirrors otherwise. What is not mirrored goes through:
//! `kt = (1 - kr) Tf / max(Tf)`. Of `Tf` only the hue counts, because half of the exporters write it as the share that is
//! held back.
//!
//! A **blend** shows `d` of the surface and `1 - d` of what is behind it, straight through: `kt = 1 - d`, `ior = 1`, and
//! `ks`, `kr` and `emission` times `d` (the formula itself weakens the diffuse term by `1 - kt`).
//!
//! In all cases `kr + kt` is at most 1.

use crate::scene::{Material, Rgb};

/// The index of refraction of glass that does not say its own.
const GLASS: f32 = 1.5;

/// A material by the rule, and what of it was approximated.
pub(super) struct Phong {
    /// Its terms, without images and as if all of it were there. Colours are taken as linear numbers.
    pub material: Material,
    /// How much of the surface is there, below 1; `None` for all of it, and for glass.
    pub opacity: Option<f32>,
    /// Whether light goes through it and is bent.
    pub is_glass: bool,
    /// What is not as the format says.
    pub approximations: Vec<&'static str>,
}

/// The material of a definition.
pub(super) fn material(source: &tobj::Material) -> Phong {
    let color = |values: Option<[f32; 3]>| values.map(Rgb::from_array);
    let mut approximations = Vec::new();
    let mut result = Material { name: source.name.clone(), ..Default::default() };
    let textured = source.diffuse_texture.is_some();
    result.diffuse = match color(source.diffuse) {
        Some(Rgb::ZERO) | None if textured => Rgb::ONE,
        Some(diffuse) => diffuse,
        None => result.diffuse,
    };
    result.emission = color(source.emissive).unwrap_or(Rgb::ZERO);
    result.shininess = source.shininess.unwrap_or(result.shininess).max(1.0);

    let model = source.illumination_model.unwrap_or(2);
    let unsaid = if source.specular_texture.is_some() { Rgb::ONE } else { Rgb::ZERO };
    let specular = color(source.specular).unwrap_or(unsaid);
    result.ks = if model >= 2 { specular } else { Rgb::ZERO };
    let index = source.optical_density.filter(|&index| index > 0.0);
    let opacity = opacity(source);
    let blends = opacity < 1.0 && !matches!(model, 6 | 7);
    let is_glass = match model {
        6 | 7 => true,
        4 | 9 => !blends && index.is_some_and(|index| index > 1.0),
        _ => false,
    };
    let mirror = specular.min(Rgb::ONE);
    let head_on = mirror.min(Rgb::splat(mirrored_head_on(index.unwrap_or(GLASS))));
    result.kr = match model {
        3 | 5 | 8 => mirror,
        4 | 6 | 7 if is_glass || blends => head_on,
        _ => Rgb::ZERO,
    };
    if is_glass {
        approximations.push("glass (illum 4, 6, 7, 9): mirrors as it does head-on, from every side");
        result.kt = (Rgb::ONE - result.kr) * hue(source.unknown_param.get("Tf"));
        result.ior = index.unwrap_or(GLASS);
    }
    match model {
        0 => approximations.push("illum 0: shaded like illum 1"),
        4 | 9 if !is_glass && !blends => approximations.push("illum 4 or 9 of an opaque material: shaded like illum 2"),
        5 => approximations.push("illum 5: mirrors the same from every side"),
        10 => approximations.push("illum 10: shaded like illum 2"),
        _ => {}
    }
    Phong { material: result, opacity: blends.then_some(opacity), is_glass, approximations }
}

/// The share of the surface that is there: `d`, or 1 - `Tr`.
fn opacity(source: &tobj::Material) -> f32 {
    let transparency = || source.unknown_param.get("Tr")?.parse::<f32>().ok().filter(|&tr| tr != 1.0);
    source.dissolve.or_else(|| Some(1.0 - transparency()?)).unwrap_or(1.0).clamp(0.0, 1.0)
}

/// Fresnel's reflectance at normal incidence, from outside.
fn mirrored_head_on(index: f32) -> f32 {
    let root = (index - 1.0) / (index + 1.0);
    root * root
}

/// The transmission filter scaled so that its greatest channel is 1; white for none.
fn hue(filter: Option<&String>) -> Rgb {
    let mut channels = filter.into_iter().flat_map(|text| text.split(' ')).filter_map(|word| word.parse::<f32>().ok());
    let mut next = || channels.next().unwrap_or(0.0);
    let filter = Rgb::new(next(), next(), next());
    let greatest = filter.max_element();
    if greatest > 0.0 { filter / greatest } else { Rgb::ONE }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convert(text: &str) -> Material {
        let text = format!("newmtl a\n{}\n", text.replace("; ", "\n"));
        let (materials, _) = tobj::load_mtl_buf(&mut text.as_bytes()).unwrap();
        let phong = material(&materials[0]);
        phong.material.blended(phong.opacity.unwrap_or(1.0))
    }

    #[test]
    fn plain_surfaces_do_not_mirror() {
        let plain = convert("Ka 1 1 1; Kd 0.1 0.2 0.3; Ks 0.5 0.5 0.5; Ns 0.2; illum 2");
        assert_eq!(plain.diffuse, Rgb::new(0.1, 0.2, 0.3));
        assert_eq!((plain.specular, plain.ks, plain.shininess), (Rgb::ONE, Rgb::splat(0.5), 1.0));
        assert_eq!((plain.kr, plain.kt, plain.ambient), (Rgb::ZERO, Rgb::ZERO, None));
        assert_eq!(convert("Ks 1 1 1").ks, Rgb::ONE);
        assert_eq!(convert("Ks 1 1 1; illum 1").ks, Rgb::ZERO);
        assert_eq!(convert("Kd 0 0 0; map_Kd a.png").diffuse, Rgb::ONE);
        assert_eq!(convert("Kd 0.5 0.5 0.5; map_Kd a.png").diffuse, Rgb::splat(0.5));
    }

    #[test]
    fn a_black_surface_with_a_white_ks_is_a_mirror() {
        for model in [3, 5, 8] {
            let mirror = convert(&format!("Kd 0 0 0; Ks 0.95 0.95 2; illum {model}"));
            assert_eq!((mirror.diffuse, mirror.kr), (Rgb::ZERO, Rgb::new(0.95, 0.95, 1.0)));
            assert_eq!(mirror.kt, Rgb::ZERO);
        }
    }

    #[test]
    fn glass_passes_what_it_does_not_mirror() {
        let glass = convert("Kd 0 0 0; Ks 1 1 1; Ni 1.5; Tf 0.1 0.05 0.1; d 1; illum 7");
        assert!((glass.kr - Rgb::splat(0.04)).abs().max_element() < 1e-7);
        assert!((glass.kt - Rgb::new(0.96, 0.48, 0.96)).abs().max_element() < 1e-6);
        assert_eq!(glass.ior, 1.5);
        assert_eq!(convert("Ks 0 0 0; illum 6; Tf 0 0 0").kt, Rgb::ONE);
        assert_eq!(convert("Ks 1 1 1; Ni 1.5; illum 9").kr, Rgb::ZERO);
        assert_eq!(convert("Ks 1 1 1; Ni 1.5; illum 9").kt, Rgb::ONE);
    }

    #[test]
    fn a_dissolved_surface_is_a_blend_without_bending() {
        for text in [
            "d 0.25; Ni 1.5; Ks 1 1 1; Ke 4 4 4",
            "Tr 0.75; Ks 1 1 1; Ke 4 4 4",
            "d 0.25; Tr 0.1; Ks 1 1 1; Ke 4 4 4; illum 9",
        ] {
            let blend = convert(text);
            assert_eq!((blend.kt, blend.ior), (Rgb::splat(0.75), 1.0));
            assert_eq!((blend.ks, blend.emission, blend.kr), (Rgb::splat(0.25), Rgb::ONE, Rgb::ZERO));
        }
        assert_eq!(convert("d 0.25; Ks 1 1 1; illum 3").kr, Rgb::splat(0.25));
        assert_eq!(convert("Tr 1").kt, Rgb::ZERO);
        assert_eq!(convert("d 0").kt, Rgb::ONE);
    }

    #[test]
    fn what_maya_writes_for_everything_is_opaque() {
        let lambert = convert("illum 4; Kd 0.5 0.5 0.5; Ka 0 0 0; Ks 0.5 0.5 0.5; Tf 1 1 1; Ni 1.00");
        assert_eq!((lambert.kr, lambert.kt, lambert.ks), (Rgb::ZERO, Rgb::ZERO, Rgb::splat(0.5)));
    }

    #[test]
    fn mirror_and_transmission_never_exceed_one() {
        for model in 0..=10 {
            for ks in ["0 0 0", "0.3 0.7 0.9", "5 5 5"] {
                for d in [0.0, 0.1, 0.3, 0.7, 0.999, 1.0, 7.0] {
                    for ni in [0.0, 0.3, 1.0, 1.33, 2.5, 1e9] {
                        let text = format!("Ks {ks}; d {d}; Ni {ni}; illum {model}; Tf 1 0.3 9");
                        let m = convert(&text);
                        assert!((m.kr + m.kt).max_element() <= 1.0 && m.kr.min_element() >= 0.0, "{text}");
                        assert!(m.kt.min_element() >= 0.0 && m.ior > 0.0, "{text}");
                    }
                }
            }
        }
    }
}
