//! What tracing asks of a scene: rays formed in some precision, and what they meet.
//!
//! Everything that [intersects](Intersect) answers in f32. A reference answers in f64; `ray_tracing`, `trace` and `shade`
//! are the same for both, and which it is is known when they are compiled.

use glam::{DVec3, Vec3};

use crate::geometry::{Hit, Key, Ray};
use crate::math::float::{gamma, round_down};
use crate::math::vector::length;
use crate::render::intersect::Intersect;
use crate::render::shadow::Illumination;
use crate::render::surface::SurfacePoint;
use crate::render::trace::TracedRay;
use crate::scene::camera::ViewRay;

/// A point on a surface, and how it was met.
#[derive(Debug, Clone, Copy)]
pub struct Meeting<'a> {
    /// The unrounded ray that came.
    pub view: &'a ViewRay,
    /// What it hit.
    pub hit: &'a Hit,
    /// The point.
    pub point: &'a SurfacePoint,
}

/// What forms rays and answers them.
pub trait Answers: Sync {
    /// A ray in the precision of the answers.
    type Ray: Copy;

    /// A camera ray.
    fn camera_ray(&self, view: &ViewRay) -> Self::Ray;

    /// A ray that leaves a surface on the side that it was met from, in a unit direction.
    fn ray_outside(&self, from: &Meeting<'_>, direction: DVec3) -> Self::Ray;

    /// A ray that goes on through a surface in a unit direction.
    fn ray_inside(&self, from: &Meeting<'_>, direction: DVec3) -> Self::Ray;

    /// The ray from a point to a light, which ends just before the light.
    fn shadow_ray(&self, from: &Meeting<'_>, illumination: &Illumination) -> Self::Ray;

    /// The first hit in the order of [`Key`].
    fn first_hit(&self, ray: &Self::Ray) -> Hit;

    /// The hit after another, no farther than `t_max`, where rounding may have put it behind that; an exact answer has it
    /// in its place and gives a miss.
    fn next_until(&self, ray: &Self::Ray, after: Key, t_max: f32) -> Hit;

    /// Whether anything is hit that is known to be opaque as a whole.
    fn is_blocked_by_opaque(&self, ray: &Self::Ray) -> bool;

    /// [`first_hit`](Self::first_hit) of each ray; the slices have equal lengths.
    fn first_hits(&self, rays: &[Self::Ray], hits: &mut [Hit]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.first_hit(ray);
        }
    }

    /// [`is_blocked_by_opaque`](Self::is_blocked_by_opaque) for each ray; the slices have equal lengths.
    fn are_blocked_by_opaque(&self, rays: &[Self::Ray], blocked: &mut [bool]) {
        for (ray, blocked) in rays.iter().zip(blocked) {
            *blocked = self.is_blocked_by_opaque(ray);
        }
    }

    /// Visits the hits on what is not opaque as a whole, in order, until `visit` returns false.
    fn visit_transmissive(&self, ray: &Self::Ray, visit: impl FnMut(&Hit) -> bool);
}

/// Spawned rays begin at the smallest normal number, not at 0: a ray whose rounded origin still lies on its own
/// surface must not find it.
const SPAWNED_T_MIN: f32 = f32::MIN_POSITIVE;

impl<I: Intersect> Answers for I {
    type Ray = Ray;

    #[inline(always)]
    fn camera_ray(&self, view: &ViewRay) -> Ray {
        TracedRay::camera(*view).ray
    }

    #[inline(always)]
    fn ray_outside(&self, from: &Meeting<'_>, direction: DVec3) -> Ray {
        spawned(from.point.origin_outside(), direction)
    }

    #[inline(always)]
    fn ray_inside(&self, from: &Meeting<'_>, direction: DVec3) -> Ray {
        spawned(from.point.origin_inside(), direction)
    }

    /// Its direction has any length. The light's place is rounded to f32, as vertices are.
    #[inline(always)]
    fn shadow_ray(&self, from: &Meeting<'_>, illumination: &Illumination) -> Ray {
        let origin = from.point.origin_outside();
        let (direction, t_max) = match illumination.position {
            None => (illumination.to_light, f32::INFINITY),
            Some(position) => {
                let (offset, end) = towards(position.as_vec3().as_dvec3(), origin.as_dvec3());
                (offset, round_down(end))
            }
        };
        Ray { origin, t_min: SPAWNED_T_MIN, direction: direction.as_vec3(), t_max }
    }

    #[inline(always)]
    fn first_hit(&self, ray: &Ray) -> Hit {
        self.closest(ray)
    }

    fn next_until(&self, ray: &Ray, after: Key, t_max: f32) -> Hit {
        self.next_after(&Ray { t_min: after.t, t_max, ..*ray }, after)
    }

    #[inline(always)]
    fn is_blocked_by_opaque(&self, ray: &Ray) -> bool {
        self.occluded_by_opaque(ray)
    }

    fn first_hits(&self, rays: &[Ray], hits: &mut [Hit]) {
        self.closest_batch(rays, hits);
    }

    fn are_blocked_by_opaque(&self, rays: &[Ray], blocked: &mut [bool]) {
        self.occluded_by_opaque_batch(rays, blocked);
    }

    #[inline(always)]
    fn visit_transmissive(&self, ray: &Ray, mut visit: impl FnMut(&Hit) -> bool) {
        let mut hit = self.next_transmissive_after(ray, Key::BEFORE_ALL);
        while hit.is_hit() && visit(&hit) {
            hit = self.next_transmissive_after(ray, hit.key());
        }
    }
}

/// A ray that starts at `origin`, which was moved off a surface.
#[inline(always)]
fn spawned(origin: Vec3, direction: DVec3) -> Ray {
    Ray { origin, t_min: SPAWNED_T_MIN, direction: direction.as_vec3(), t_max: f32::INFINITY }
}

/// From a point to a light's place: the direction, and the t at which the ray ends.
///
/// The end is shortened by a bound like that which moves the start of a ray off a surface, on how far f32 vertices are
/// from where they should be: a lamp whose coordinates are those of a ceiling shines, at grazing angles too.
#[inline(always)]
pub fn towards(position: DVec3, origin: DVec3) -> (DVec3, f64) {
    let offset = position - origin;
    let distance = length(offset);
    let error = gamma(7) * (position.abs().max_element() + distance);
    (offset, 1.0 - error / distance)
}
