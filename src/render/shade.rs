//! `Shade`: the colour of a point,
//! `I = Oa + sum_i Si Ipi [(1 - kt) Od (N.Li) + ks Os (R.V)^n] + kr Ir + kt It`, term by term.

use glam::DVec3;

use crate::geometry::Hit;
use crate::math::lanes::{Flags, LANES, Vectors, whole_rows};
use crate::math::simd::{Level, Task};
use crate::math::vector::{dot, is_safe, length, normalize};
use crate::render::answers::{Answers, Meeting};
use crate::render::detail::ImagePlace;
use crate::render::points::Points;
use crate::render::shadow::{Illumination, PreparedLight};
use crate::render::surface::SurfacePoint;
use crate::render::trace::{TracedRay, Tracer};
use crate::scene::camera::ViewRay;
use crate::scene::{Clamp, Material, Rgb, TextureRef, compiled};

/// A material's terms at a point, textures looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceColors {
    /// Oa, emission included.
    pub ambient: Rgb,
    /// Od.
    pub diffuse: Rgb,
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
        self.shade_point(view, hit, &SurfacePoint::of(self.scene, self.world, view, hit), depth)
    }

    /// [`shade`](Self::shade) with the point that was found.
    pub(super) fn shade_point(&self, view: &ViewRay, hit: &Hit, point: &SurfacePoint, depth: u32) -> Rgb {
        let material = &*self.terms(point, hit);
        let colors = self.material_colors(material, || (*point, *hit));
        let here = Meeting { view, hit, point };

        // Ambient, then each light: diffuse and highlight.
        let mut color = colors.ambient;
        for light in self.lights() {
            let Some(illumination) = Illumination::at(light, point) else { continue };
            let visible = self.visibility(&here, &illumination);
            if visible != Rgb::ZERO {
                color += self.lit(visible, &illumination, material, colors.diffuse, point, view);
            }
        }

        // Mirror and transmission.
        if depth < self.scene.film.max_depth {
            if compiled::REFLECTION && material.is_reflective() {
                color += material.kr * self.trace(&self.reflected(&here), depth + 1);
            }
            if !self.is_opaque() && material.is_transmissive() {
                color += material.kt * self.trace(&self.transmitted(&here, material), depth + 1);
            }
        }

        self.clamp(self.after_way_inside(color, material, point, view))
    }

    /// What is left of a colour at the end of a ray's way, which may have led through what absorbs.
    #[inline(always)]
    pub(super) fn after_way_inside(
        &self,
        color: Rgb,
        material: &Material,
        point: &SurfacePoint,
        view: &ViewRay,
    ) -> Rgb {
        if point.from_outside || !material.is_absorbing() {
            return color;
        }
        color * material.left_after(length(point.position - view.origin))
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
        if self.is_opaque() {
            return illumination.color * direct(material, diffuse, point, view, illumination);
        }
        let diffuse = (Rgb::ONE - material.kt) * diffuse;
        visible * illumination.color * direct(material, diffuse, point, view, illumination)
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
        SurfaceColors { ambient: ambient + material.emission, diffuse }
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

/// `D (N.L) + ks Os (R.V)^n` for one light, where D is `(1 - kt) Od`.
#[inline(always)]
fn direct(material: &Material, diffuse: Rgb, point: &SurfacePoint, view: &ViewRay, illumination: &Illumination) -> Rgb {
    let mut sum = diffused(diffuse, illumination.n_dot_l);
    if material.ks != Rgb::ZERO {
        let r_dot_v = r_dot_v(illumination.n_dot_l, point.normal, illumination.to_light, view.direction);
        if r_dot_v > 0.0 {
            sum += glossy(material, r_dot_v);
        }
    }
    sum
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
