//! The rule that makes a Phong material from a microfacet surface. The manual's page on materials states it for users.

use crate::scene::{Material, Rgb};

/// What a glTF material says about a surface, metallic-roughness or specular-glossiness alike.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// Colour of light that enters the surface and comes back; with its texture.
    pub matt: Rgb,
    /// Colour of light that bounces off microfacets too steep to mirror; with the base texture too.
    pub metal: Rgb,
    /// Reflectance at normal incidence.
    pub f0: Rgb,
    /// glTF's roughness, from 0 to 1; GGX's alpha is its square.
    pub roughness: f32,
    /// Share of the light that enters the surface and goes on through it.
    pub transmission: f32,
    /// Colour of light that goes through.
    pub tint: Rgb,
}

/// A mirror weaker than this in every channel is left out: half of what glass reflects. It keeps rough dielectrics,
/// the commonest material by far, from costing a ray per hit that nobody could see. On surfaces darker than
/// [`DARK`] the bar is lower in proportion, since there is little else to be seen.
const WEAKEST_MIRROR: f32 = 0.02;

/// Where every channel of the diffuse colour is below this, weaker mirrors count.
const DARK: f32 = 0.25;

/// What no screen shows, whatever stands beside it.
const INVISIBLE: f32 = 1.0 / 512.0;

/// The largest exponent of a highlight: its half-width is then below one degree.
const SHARPEST: f32 = 10_000.0;

impl Surface {
    /// The terms of the shading formula; all else is the caller's.
    ///
    /// - **Diffuse**: `matt (1 - transmission) + metal (1 - fade)`, where `fade = (1 - roughness)^2` is what the surface
    ///   still mirrors. A rough metal reflects its whole surroundings, which neither a highlight nor one mirror ray can
    ///   show; without the second term it would look black. Divided by `1 - kt`, since the shading formula multiplies by it.
    /// - **Highlight**: the microfacet lobe's height at its centre over a Lambertian surface's, `F0 / (4 alpha^2)`
    ///   with `alpha = roughness^2`, at most 1. The exponent is that of Walter et al. (2007, "Microfacet Models for
    ///   Refraction"), `2 / alpha^2 - 2`, over 4: theirs is for the half vector, whose angle is half of that between
    ///   the reflected ray and the viewer (Fisher and Woo 1994, "R.E versus N.H specular highlights").
    /// - **Mirror**: `kr = F0 fade`, left out below a threshold. **Transmission**: `kt = transmission tint (1 - F0)`,
    ///   at most `1 - kr`.
    pub fn phong(&self) -> Material {
        let roughness = self.roughness.clamp(0.0, 1.0);
        let f0 = self.f0.clamp(Rgb::ZERO, Rgb::ONE);
        let fade = (1.0 - roughness) * (1.0 - roughness);
        let width = roughness * roughness;

        let strongest = f0.max_element();
        let height = if strongest > 0.0 { (strongest / (4.0 * width * width)).min(1.0) } else { 0.0 };
        let exponent = (0.5 * (1.0 / (width * width) - 1.0)).clamp(1.0, SHARPEST);

        let mirror = f0 * fade;
        let diffuse = self.matt * (1.0 - self.transmission) + self.metal * (1.0 - fade);
        let weakest = (WEAKEST_MIRROR * (diffuse.max_element() / DARK).min(1.0)).max(INVISIBLE);
        let kr = if mirror.max_element() < weakest { Rgb::ZERO } else { mirror };
        let through = (self.tint * self.transmission * (Rgb::ONE - f0)).clamp(Rgb::ZERO, Rgb::ONE - kr);

        // The shading formula weakens the diffuse term by 1 - kt. That is undone, since the diffuse colour already is
        // what remains.
        let undone = Rgb::ONE - through;
        let scaled = |colour: f32, undone: f32| if undone > 0.0 { (colour / undone).min(1.0) } else { 0.0 };
        let diffuse = Rgb::new(scaled(diffuse.x, undone.x), scaled(diffuse.y, undone.y), scaled(diffuse.z, undone.z));
        Material {
            diffuse,
            specular: if strongest > 0.0 { f0 / strongest } else { Rgb::ONE },
            ks: Rgb::splat(height),
            shininess: exponent,
            kr,
            kt: through,
            ..Material::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLASTIC: Surface = Surface {
        matt: Rgb::new(0.8, 0.4, 0.2),
        metal: Rgb::ZERO,
        f0: Rgb::splat(0.04),
        roughness: 1.0,
        transmission: 0.0,
        tint: Rgb::ONE,
    };

    #[test]
    fn a_rough_dielectric_is_nearly_lambertian_and_costs_no_mirror_ray() {
        let m = PLASTIC.phong();
        assert_eq!(m.diffuse, PLASTIC.matt);
        assert_eq!((m.kr, m.kt, m.shininess), (Rgb::ZERO, Rgb::ZERO, 1.0));
        assert!((m.ks - 0.01).abs().max_element() < 1e-7);
        assert!(Surface { roughness: 0.3, ..PLASTIC }.phong().kr == Rgb::ZERO);
        assert!(Surface { roughness: 0.2, ..PLASTIC }.phong().kr != Rgb::ZERO);
        let black = Surface { matt: Rgb::ZERO, f0: Rgb::splat(0.01), roughness: 0.2, ..PLASTIC };
        assert!(black.phong().kr != Rgb::ZERO, "nothing else is to be seen of it");
    }

    #[test]
    fn a_smooth_metal_mirrors_its_colour_and_a_rough_one_scatters_it() {
        let gold = Rgb::new(1.0, 0.77, 0.34);
        let metal = |roughness| Surface { matt: Rgb::ZERO, metal: gold, f0: gold, roughness, ..PLASTIC }.phong();
        assert_eq!((metal(0.0).kr, metal(0.0).diffuse), (gold, Rgb::ZERO));
        assert_eq!((metal(1.0).kr, metal(1.0).diffuse), (Rgb::ZERO, gold));
        let half = metal(0.5);
        assert!((half.kr + half.diffuse - gold).abs().max_element() < 1e-6, "nothing is lost between");
        assert_eq!(half.specular, gold);
        // alpha = 1/4: (1/alpha^2 - 1) / 2.
        assert_eq!(half.shininess, 7.5);
    }

    #[test]
    fn mirror_and_transmission_never_exceed_one() {
        let steps = [0.0, 0.25, 0.5, 0.75, 1.0f32];
        for roughness in steps {
            for transmission in steps {
                for f0 in steps {
                    for alpha in steps {
                        let f0 = Rgb::new(f0, 0.04, 1.0);
                        let m = Surface { roughness, transmission, f0, ..PLASTIC }.phong().blended(alpha);
                        assert!((m.kr + m.kt).max_element() <= 1.0, "{m:?}");
                        assert!(m.kt.min_element() >= 0.0 && m.diffuse.max_element() <= 1.0, "{m:?}");
                        assert!(m.ks.max_element() <= 1.0 && m.shininess >= 1.0 && m.diffuse.is_finite(), "{m:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_the_formula_takes_from_the_diffuse_term_is_what_goes_through() {
        let half = Surface { transmission: 0.5, f0: Rgb::ZERO, ..PLASTIC }.phong();
        assert!(((Rgb::ONE - half.kt) * half.diffuse - 0.5 * PLASTIC.matt).abs().max_element() < 1e-6);
        let blended = PLASTIC.phong().blended(0.25);
        assert_eq!(blended.kt, Rgb::splat(0.75));
        assert!(((Rgb::ONE - blended.kt) * blended.diffuse - 0.25 * PLASTIC.matt).abs().max_element() < 1e-6);
    }
}
