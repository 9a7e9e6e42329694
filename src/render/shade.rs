//! `Shade`: the colour of a point,
//! `I = Oa + sum_i Si Ipi [(1 - kt) Od (N.Li) + ks Os (R.V)^n] + kr Ir + kt It`, term by term.

use glam::DVec3;

use crate::geometry::Hit;
use crate::math::lanes::{Flags, LANES, Vectors, whole_rows};
use crate::math::simd::{Level, Task};
use crate::math::vector::{dot, is_safe, length, normalize};
use crate::render::answers::{Answers, Meeting};
use crate::render::detail::ImagePlace;
use crate::render::explain::Way;
use crate::render::points::Points;
use crate::render::shadow::{Illumination, PreparedLight};
use crate::render::surface::SurfacePoint;
use crate::render::trace::{TracedRay, Tracer};
use crate::render::witness::Witness;
use crate::scene::camera::ViewRay;
use crate::scene::{Clamp, Material, Rgb, TextureRef, compiled};

/// A material's terms at a point, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceColors {
    /// Oa.
    pub ambient: Rgb,
    /// What the surface emits.
    pub emission: Rgb,
    /// Od.
    pub diffuse: Rgb,
}

impl SurfaceColors {
    /// What is seen without any light.
    #[inline(always)]
    pub fn own(&self) -> Rgb {
        self.ambient + self.emission
    }
}

/// What one light adds where all of it arrives, before it is multiplied by the light's colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Direct {
    /// `(1 - kt) Od (N.L)`
    pub diffuse: Rgb,
    /// `R.V`, where the material has a highlight.
    pub r_dot_v: Option<f64>,
    /// `ks Os (R.V)^n`, where R.V is positive.
    pub specular: Option<Rgb>,
}

impl Direct {
    #[inline(always)]
    fn sum(&self) -> Rgb {
        self.specular.map_or(self.diffuse, |specular| self.diffuse + specular)
    }
}

/// Where a ray goes that passes through a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refraction {
    /// Through, in this unit direction.
    Through(DVec3),
    /// Nothing passes: all is reflected inside.
    Total,
}

impl<I: Answers> Tracer<'_, I> {
    /// The linear colour of the point that `hit` found along `view`.
    #[doc(alias = "Shade")]
    pub fn shade(&self, view: &ViewRay, hit: &Hit, depth: u32) -> Rgb {
        self.shade_point(view, hit, &SurfacePoint::of(self.scene, self.world, view, hit), depth, &mut ())
    }

    /// [`shade`](Self::shade) with the point that was found, while someone looks on.
    pub(super) fn shade_point(
        &self,
        view: &ViewRay,
        hit: &Hit,
        point: &SurfacePoint,
        depth: u32,
        witness: &mut impl Witness,
    ) -> Rgb {
        let material = &*self.terms(point, hit);
        let colors = self.material_colors(material, || (*point, *hit));
        let here = Meeting { view, hit, point };

        // Ambient, then each light: diffuse and highlight.
        witness.begins_sum(&colors);
        let mut color = colors.own();
        for (number, light) in self.lights().iter().enumerate() {
            let Some(illumination) = Illumination::at(light, point) else {
                witness.is_dark(number, || light.darkness(point));
                continue;
            };
            witness.shines(number, &illumination, || self.direct(&illumination, material, colors.diffuse, point, view));
            let visible = self.watch_visibility(&here, &illumination, witness);
            witness.arrives(visible);
            if visible != Rgb::ZERO {
                color += self.lit(visible, &illumination, material, colors.diffuse, point, view);
            }
        }

        // Mirror and transmission.
        let goes_on = depth < self.scene.film.max_depth && witness.has_room();
        if compiled::REFLECTION && material.is_reflective() {
            witness.branches(|| Way::Reflected, material.kr);
            if goes_on {
                color += material.kr * self.follow(&self.reflected(&here), depth + 1, witness).0;
            }
        }
        if !self.is_opaque() && material.is_transmissive() {
            witness.branches(|| way_through(&here, material), material.kt);
            if goes_on {
                color += material.kt * self.follow(&self.transmitted(&here, material), depth + 1, witness).0;
            }
        }

        // What the ray came through, and the seed's clamp.
        if let Some((length, left)) = self.way_inside(material, point, view) {
            witness.absorbs(length, left);
            color *= left;
        }
        let clamped = self.clamp(color);
        witness.clamps(color, clamped);
        clamped
    }

    /// How far a ray came through what absorbs, and what that left of the light; `None` where nothing absorbs.
    #[inline(always)]
    pub(super) fn way_inside(&self, material: &Material, point: &SurfacePoint, view: &ViewRay) -> Option<(f64, Rgb)> {
        if point.from_outside || !material.is_absorbing() {
            return None;
        }
        let length = length(point.position - view.origin);
        Some((length, material.left_after(length)))
    }

    /// What is done to a colour after each Shade.
    #[inline(always)]
    pub(super) fn clamp(&self, color: Rgb) -> Rgb {
        match self.scene.film.clamp {
            Clamp::Shade => color.min(Rgb::ONE),
            Clamp::Output => color,
        }
    }

    /// The lights, in the scene's order.
    #[inline(always)]
    pub(super) fn lights(&self) -> &[PreparedLight] {
        let lights = &self.world.lights;
        if compiled::MANY_LIGHTS { lights } else { &lights[..1] }
    }

    /// What a light adds of which so much is visible from a point: all, in a scene that lets no light through.
    #[inline(always)]
    pub(super) fn lit(
        &self,
        visible: Rgb,
        illumination: &Illumination,
        material: &Material,
        diffuse: Rgb,
        point: &SurfacePoint,
        view: &ViewRay,
    ) -> Rgb {
        let direct = self.direct(illumination, material, diffuse, point, view).sum();
        if self.is_opaque() { illumination.color * direct } else { visible * illumination.color * direct }
    }

    /// The diffuse and specular terms of a light.
    #[inline(always)]
    fn direct(
        &self,
        illumination: &Illumination,
        material: &Material,
        diffuse: Rgb,
        point: &SurfacePoint,
        view: &ViewRay,
    ) -> Direct {
        let diffuse = if self.is_opaque() { diffuse } else { (Rgb::ONE - material.kt) * diffuse };
        let r_dot_v = (material.ks != Rgb::ZERO)
            .then(|| r_dot_v(illumination.n_dot_l, point.normal, illumination.to_light, view.direction));
        Direct {
            diffuse: diffused(diffuse, illumination.n_dot_l),
            r_dot_v,
            specular: r_dot_v.filter(|&r_dot_v| r_dot_v > 0.0).map(|r_dot_v| glossy(material, r_dot_v)),
        }
    }

    /// Whether nothing in the scene lets light through.
    #[inline(always)]
    pub(super) fn is_opaque(&self) -> bool {
        self.world.all_opaque || !compiled::REFRACTION
    }

    /// The colours of the point that `hit` found.
    #[inline(always)]
    pub fn colors(&self, point: &SurfacePoint, hit: &Hit) -> SurfaceColors {
        self.material_colors(&self.terms(point, hit), || (*point, *hit))
    }

    /// The colours of a material at the point that a hit found, which is asked for only if there is an image.
    #[inline(always)]
    pub(super) fn material_colors(
        &self,
        material: &Material,
        point: impl FnOnce() -> (SurfacePoint, Hit),
    ) -> SurfaceColors {
        let diffuse = match &material.diffuse_texture {
            Some(reference) if compiled::TEXTURES => {
                let (point, hit) = point();
                material.diffuse * self.texel(reference, &point, &hit)
            }
            _ => material.diffuse,
        };
        let ambient = material.ambient.unwrap_or(self.scene.ambient * diffuse * material.coverage);
        SurfaceColors { ambient, emission: material.emission, diffuse }
    }

    /// What an image has at a point. Out of line, since scenes without images need not pay.
    #[inline(never)]
    fn texel(&self, reference: &TextureRef, point: &SurfacePoint, hit: &Hit) -> Rgb {
        ImagePlace::of(self.scene, self.world, point, hit).texel(reference).truncate()
    }

    /// The mirror ray of a point, counted.
    pub(super) fn reflected(&self, from: &Meeting<'_>) -> TracedRay<I::Ray> {
        self.count(|counts| counts.reflected += 1);
        let direction = reflect(from.point, from.view.direction);
        let view = ViewRay { origin: from.point.position, direction };
        TracedRay { ray: self.intersect.ray_outside(from, direction), view }
    }

    /// The ray that goes on through a surface, or is reflected within, counted. Out of line, as [`texel`](Self::texel) is.
    #[inline(never)]
    pub(super) fn transmitted(&self, from: &Meeting<'_>, material: &Material) -> TracedRay<I::Ray> {
        match refract(from.point, f64::from(material.ior), from.view.direction) {
            Refraction::Through(direction) => {
                self.count(|counts| counts.refracted += 1);
                let view = ViewRay { origin: from.point.position, direction };
                TracedRay { ray: self.intersect.ray_inside(from, direction), view }
            }
            Refraction::Total => self.reflected(from),
        }
    }
}

/// Whether a ray that meets a surface goes through it or is reflected within.
fn way_through(here: &Meeting<'_>, material: &Material) -> Way {
    match refract(here.point, f64::from(material.ior), here.view.direction) {
        Refraction::Through(_) => Way::Refracted,
        Refraction::Total => Way::TotalReflection,
    }
}

/// `R.V`
#[inline(always)]
pub(super) fn r_dot_v(n_dot_l: f64, normal: DVec3, to_light: DVec3, view: DVec3) -> f64 {
    -dot(normal * (2.0 * n_dot_l) - to_light, view)
}

/// `ks Os (R.V)^n`
#[inline(always)]
pub(super) fn glossy(material: &Material, r_dot_v: f64) -> Rgb {
    material.ks * material.specular * (highlight(r_dot_v, material.shininess) as f32)
}

/// `D (N.L)`
#[inline(always)]
pub(super) fn diffused(diffuse: Rgb, n_dot_l: f64) -> Rgb {
    diffuse * (n_dot_l as f32)
}

/// `x^n` for x in (0, 1]; whole exponents by repeated squaring, others by `libm`. At most 1: R.V of unit vectors may
/// exceed 1 by rounding. Out of line, since most materials have no highlight.
#[inline(never)]
fn highlight(x: f64, n: f32) -> f64 {
    let x = x.min(1.0);
    if (0.0..=65536.0).contains(&n) && n.fract() == 0.0 {
        let (mut base, mut exponent, mut product) = (x, n as u32, 1.0);
        while exponent > 0 {
            if exponent & 1 == 1 {
                product *= base;
            }
            base *= base;
            exponent >>= 1;
        }
        product
    } else {
        libm::pow(x, f64::from(n))
    }
}

/// The mirror direction, never below the surface.
///
/// An interpolated normal may send the mirror ray into the surface it leaves. It is then lifted along the true normal
/// to just above the horizon: `min(0.9 V.Ng, 0.01)`, the threshold of Cycles' `ensure_valid_specular_reflection`,
/// which tilts the normal instead.
fn reflect(point: &SurfacePoint, direction: DVec3) -> DVec3 {
    let mirrored = mirrored(direction, point.normal, point.geometric_normal);
    normalize(mirrored).unwrap_or(point.geometric_normal)
}

/// The same, of any length.
#[inline(always)]
fn mirrored(direction: DVec3, normal: DVec3, geometric_normal: DVec3) -> DVec3 {
    let along = dot(direction, normal);
    let mirrored = direction - normal * (2.0 * along);
    let threshold = (-0.9 * dot(direction, geometric_normal)).clamp(0.0, 0.01);
    raised(mirrored, geometric_normal, threshold)
}

/// The unit direction, lifted along `normal` where it does not rise above the surface by at least `threshold`.
fn keep_above(direction: DVec3, normal: DVec3, threshold: f64) -> DVec3 {
    normalize(raised(direction, normal, threshold)).unwrap_or(normal)
}

/// The same, of any length.
#[inline(always)]
fn raised(direction: DVec3, normal: DVec3, threshold: f64) -> DVec3 {
    let height = dot(direction, normal);
    // For a view within the surface the threshold is 0: any positive height will do.
    let lifted = direction + normal * (threshold.max(1e-6) - height);
    let is_above = (height >= threshold) & (height > 0.0);
    let pick = |direction: f64, lifted: f64| if is_above { direction } else { lifted };
    DVec3::new(pick(direction.x, lifted.x), pick(direction.y, lifted.y), pick(direction.z, lifted.z))
}

/// [`reflect`] for each of some points.
pub(super) fn reflect_all(level: Level, points: &Points, count: usize, directions: &mut Vectors) {
    let mut odd = [0; LANES];
    level.run(Reflect { lanes: whole_rows(count), points, directions, odd: &mut odd });
    for at in (0..count).filter(|&at| odd[at] != 0) {
        directions.set(at, reflect(&points.get(at), points.direction.get(at)));
    }
}

struct Reflect<'a> {
    lanes: usize,
    points: &'a Points,
    directions: &'a mut Vectors,
    odd: &'a mut Flags,
}

impl Task for Reflect<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        reflect_lanes(self.lanes, self.points, self.directions, self.odd);
    }
}

#[inline(always)]
fn reflect_lanes(lanes: usize, points: &Points, directions: &mut Vectors, odd: &mut Flags) {
    for at in 0..lanes.min(LANES) {
        let (normal, geometric) = (points.normal.get(at), points.geometric_normal.get(at));
        let mirrored = mirrored(points.direction.get(at), normal, geometric);
        let squared = dot(mirrored, mirrored);
        directions.set(at, mirrored / squared.sqrt());
        odd[at] = u32::from(!is_safe(squared));
    }
}

/// Snell's law at a point whose inside has index of refraction `ior` relative to the outside.
pub fn refract(point: &SurfacePoint, ior: f64, direction: DVec3) -> Refraction {
    let ratio = if point.from_outside { 1.0 / ior } else { ior };
    // An interpolated normal may face away from the ray: then the true one decides.
    let cosine = -dot(direction, point.normal);
    let (normal, cosine) = if cosine > 0.0 {
        (point.normal, cosine)
    } else {
        (point.geometric_normal, (-dot(direction, point.geometric_normal)).max(0.0))
    };
    let sine_squared = ratio * ratio * (1.0 - cosine * cosine).max(0.0);
    if sine_squared > 1.0 {
        return Refraction::Total;
    }
    let through = direction * ratio + normal * (ratio * cosine - (1.0 - sine_squared).sqrt());
    Refraction::Through(keep_above(through, -point.geometric_normal, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_exponents_agree_with_pow() {
        for n in [0.0, 1.0, 2.0, 7.0, 32.0, 500.0] {
            for x in [0.1, 0.5, 0.99, 1.0] {
                let expected = libm::pow(x, f64::from(n));
                assert!((highlight(x, n) - expected).abs() <= 1e-13 * expected, "{x}^{n}");
            }
        }
        assert!((highlight(0.5, 2.5) - libm::pow(0.5, 2.5)).abs() < 1e-15);
    }

    #[test]
    fn lifted_directions_are_above_the_surface_and_of_unit_length() {
        for angle in [-80.0f64, -10.0, -1e-9, 0.0, 1e-9, 0.1, 45.0] {
            let (sin, cos) = libm::sincos(angle.to_radians());
            for threshold in [0.0, 1e-3, 0.01] {
                let lifted = keep_above(DVec3::new(cos, sin, 0.0), DVec3::Y, threshold);
                assert!(lifted.y > 0.0 && (lifted.length() - 1.0).abs() < 1e-12, "{angle} {threshold}: {lifted}");
            }
        }
    }
}
