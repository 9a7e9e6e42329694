//! What tracing asks of a scene: rays formed in some precision, and what they meet.
//!
//! Everything that [intersects](Intersect) answers in f32. A reference answers in f64; `ray_tracing`, `trace` and `shade`
//! are the same for both, and which it is is known when they are compiled.

use glam::{DVec3, Vec3};

use crate::geometry::{Hit, Key, Ray};
use crate::math::float::{gamma, round_down};
use crate::math::lanes::{Flags, LANES, Vectors, Vectors32, whole_rows};
use crate::math::simd::{Level, Task};
use crate::math::vector::length;
use crate::render::intersect::Intersect;
use crate::render::points::{Found, Points};
use crate::render::shadow::{Illumination, Illuminations};
use crate::render::surface::{SurfacePoint, moved_off};
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

/// Points on surfaces, and how they were met.
#[derive(Clone, Copy)]
pub struct Meetings<'a> {
    /// The unrounded rays of all.
    pub(super) views: &'a [ViewRay],
    /// Which of them found what.
    pub(super) found: &'a Found,
    /// The points.
    pub(super) points: &'a Points,
}

impl Meetings<'_> {
    /// Does something with one of them.
    #[inline(always)]
    pub(super) fn with<T>(&self, at: usize, work: impl FnOnce(&Meeting<'_>) -> T) -> T {
        let (view, hit) = (&self.views[self.found.rays[at] as usize], &self.found.hits[at]);
        work(&Meeting { view, hit, point: &self.points.get(at) })
    }
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

    /// [`ray_outside`](Self::ray_outside) in these directions, from those points that are `chosen`, in their order.
    fn rays_outside(&self, from: &Meetings<'_>, directions: &Vectors, chosen: &Flags, rays: &mut Vec<Self::Ray>) {
        for at in (0..from.found.count).filter(|&at| chosen[at] != 0) {
            rays.push(from.with(at, |here| self.ray_outside(here, directions.get(at))));
        }
    }

    /// [`shadow_ray`](Self::shadow_ray) for each point that a light shines at, in their order.
    fn shadow_rays(&self, from: &Meetings<'_>, illuminations: &Illuminations, rays: &mut Vec<Self::Ray>) {
        for at in 0..from.found.count {
            if let Some(illumination) = illuminations.get(at) {
                rays.push(from.with(at, |here| self.shadow_ray(here, &illumination)));
            }
        }
    }

    /// The first hit in the order of [`Key`].
    fn first_hit(&self, ray: &Self::Ray) -> Hit;

    /// The hit after another, no farther than `t_max`, where rounding may have put it behind that; an exact answer has it
    /// in its place and gives a miss.
    fn next_until(&self, ray: &Self::Ray, after: Key, t_max: f32) -> Hit;

    /// The first hit after another.
    fn next_hit(&self, ray: &Self::Ray, after: Key) -> Hit;

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
        shadow_ray(from.point.origin_outside(), illumination.to_light, illumination.position)
    }

    fn rays_outside(&self, from: &Meetings<'_>, directions: &Vectors, chosen: &Flags, rays: &mut Vec<Ray>) {
        let mut formed = Formed::NONE;
        let (lanes, points) = (whole_rows(from.found.count), from.points);
        Level::chosen().run(Spawned { lanes, points, directions, formed: &mut formed });
        formed.add(from.found.count, chosen, rays);
    }

    fn shadow_rays(&self, from: &Meetings<'_>, illuminations: &Illuminations, rays: &mut Vec<Ray>) {
        let mut formed = Formed::NONE;
        let (lanes, points) = (whole_rows(from.found.count), from.points);
        Level::chosen().run(ShadowRays { lanes, points, illuminations, formed: &mut formed });
        formed.add(from.found.count, &illuminations.is_lit, rays);
    }

    #[inline(always)]
    fn first_hit(&self, ray: &Ray) -> Hit {
        self.closest(ray)
    }

    fn next_hit(&self, ray: &Ray, after: Key) -> Hit {
        self.next_after(ray, after)
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

/// The ray from a point that was moved off a surface to a light.
#[inline(always)]
fn shadow_ray(origin: Vec3, to_light: DVec3, light: Option<DVec3>) -> Ray {
    let (direction, t_max) = match light {
        None => (to_light, f32::INFINITY),
        Some(position) => {
            let (offset, end) = towards(position.as_vec3().as_dvec3(), origin.as_dvec3());
            (offset, round_down(end))
        }
    };
    Ray { origin, t_min: SPAWNED_T_MIN, direction: direction.as_vec3(), t_max }
}

/// Rays number by number.
struct Formed {
    origin: Vectors32,
    direction: Vectors32,
    t_max: [f32; LANES],
}

impl Formed {
    const NONE: Self = Self { origin: Vectors32::ZERO, direction: Vectors32::ZERO, t_max: [0.0; LANES] };

    /// Adds those that are chosen.
    fn add(&self, count: usize, chosen: &Flags, rays: &mut Vec<Ray>) {
        rays.extend((0..count).filter(|&at| chosen[at] != 0).map(|at| Ray {
            origin: self.origin.get(at),
            t_min: SPAWNED_T_MIN,
            direction: self.direction.get(at),
            t_max: self.t_max[at],
        }));
    }

    #[inline(always)]
    fn set(&mut self, at: usize, ray: Ray) {
        self.origin.set(at, ray.origin);
        self.direction.set(at, ray.direction);
        self.t_max[at] = ray.t_max;
    }
}

struct Spawned<'a> {
    lanes: usize,
    points: &'a Points,
    directions: &'a Vectors,
    formed: &'a mut Formed,
}

impl Task for Spawned<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        spawn(self.lanes, self.points, self.directions, self.formed);
    }
}

#[inline(always)]
fn spawn(lanes: usize, points: &Points, directions: &Vectors, formed: &mut Formed) {
    for at in 0..lanes.min(LANES) {
        let origin = moved_off(points.position.get(at), points.geometric_normal.get(at), points.offset[at]);
        formed.set(at, spawned(origin, directions.get(at)));
    }
}

struct ShadowRays<'a> {
    lanes: usize,
    points: &'a Points,
    illuminations: &'a Illuminations,
    formed: &'a mut Formed,
}

impl Task for ShadowRays<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        // Known to the compiler in each of these, so that the loops have no branches.
        match self.illuminations.position {
            None => self.each(None),
            Some(position) => self.each(Some(position)),
        }
    }
}

impl ShadowRays<'_> {
    #[inline(always)]
    fn each(self, light: Option<DVec3>) {
        form(self.lanes, light, self.points, self.illuminations, self.formed);
    }
}

#[inline(always)]
fn form(lanes: usize, light: Option<DVec3>, points: &Points, illuminations: &Illuminations, formed: &mut Formed) {
    for at in 0..lanes.min(LANES) {
        let origin = moved_off(points.position.get(at), points.geometric_normal.get(at), points.offset[at]);
        formed.set(at, shadow_ray(origin, illuminations.to_light.get(at), light));
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
