//! `Trace`: what a ray sees.

use std::cell::Cell;
use std::time::Instant;

use glam::{DVec2, DVec3};

use crate::geometry::{Hit, Ray};
use crate::math::vector::dot;
use crate::render::answers::{Answers, Meeting};
use crate::render::settings::{RayCounts, ThreadSeconds};
use crate::render::surface::SurfacePoint;
use crate::render::witness::Witness;
use crate::render::world::World;
use crate::scene::camera::ViewRay;
use crate::scene::{Background, Rgb, Scene};

/// Traces rays through a scene and shades what they hit; one per thread, since it counts.
pub struct Tracer<'a, I> {
    /// The scene.
    pub(super) scene: &'a Scene,
    /// Its objects, prepared.
    pub(super) world: &'a World,
    /// What answers rays.
    pub(super) intersect: &'a I,
    pub(super) counts: Cell<RayCounts>,
    /// What its batches took; `rest` is not known here.
    pub(super) seconds: Cell<ThreadSeconds>,
}

/// A ray on its way: in the precision of what answers it, and in f64 for shading.
#[derive(Debug, Clone, Copy)]
pub struct TracedRay<R = Ray> {
    /// What is intersected.
    pub ray: R,
    /// The same ray before rounding, with unit direction, from the surface itself.
    pub view: ViewRay,
}

impl TracedRay {
    /// A camera ray.
    pub fn camera(view: ViewRay) -> Self {
        Self { ray: Ray::new(view.origin.as_vec3(), view.direction.as_vec3()), view }
    }
}

impl<'a, I: Answers> Tracer<'a, I> {
    /// A tracer that has counted nothing yet.
    pub fn new(scene: &'a Scene, world: &'a World, intersect: &'a I) -> Self {
        Self { scene, world, intersect, counts: Cell::default(), seconds: Cell::default() }
    }

    /// The linear colour that a ray sees; `depth` counts the reflections and refractions before it.
    ///
    /// The nearest hit is shaded; a ray that hits nothing sees the background.
    #[doc(alias = "Trace")]
    pub fn trace(&self, ray: &TracedRay<I::Ray>, depth: u32) -> Rgb {
        self.trace_hit(ray, depth, &mut ()).0
    }

    /// What a camera ray sees and what it hit.
    pub fn trace_camera(&self, view: ViewRay) -> (Rgb, Hit) {
        self.watch_camera(view, &mut ())
    }

    /// The same while someone looks on.
    pub(super) fn watch_camera(&self, view: ViewRay, witness: &mut impl Witness) -> (Rgb, Hit) {
        self.count(|counts| counts.camera += 1);
        self.follow(&TracedRay { ray: self.intersect.camera_ray(&view), view }, 0, witness)
    }

    /// What a ray that sets out sees and what it hit.
    pub(super) fn follow(&self, ray: &TracedRay<I::Ray>, depth: u32, witness: &mut impl Witness) -> (Rgb, Hit) {
        witness.begins(&ray.view, depth);
        let (color, hit) = self.trace_hit(ray, depth, witness);
        witness.ends(color);
        (color, hit)
    }

    fn trace_hit(&self, ray: &TracedRay<I::Ray>, depth: u32, witness: &mut impl Witness) -> (Rgb, Hit) {
        let mut found = self.intersect.first_hit(&ray.ray);
        if self.world.has_holes {
            found = self.beyond_holes(&ray.ray, ray.view.direction, found, |hole| witness.passes_hole(hole));
        }
        if !found.is_hit() {
            let color = background(&self.scene.background, ray.view.direction);
            witness.sees_background(color);
            return (color, found);
        }
        let (hit, point) = self.meet(ray, found);
        witness.meets(&found, &Meeting { view: &ray.view, hit: &hit, point: &point });
        (self.shade_point(&ray.view, &hit, &point, depth, witness), hit)
    }

    /// The surface that a ray comes upon where `hit` was found first, and where.
    #[inline(always)]
    pub(super) fn meet(&self, ray: &TracedRay<I::Ray>, hit: Hit) -> (Hit, SurfacePoint) {
        let point = SurfacePoint::of(self.scene, self.world, &ray.view, &hit);
        let entry = if point.from_outside { None } else { self.entry_before(ray, &hit, &point) };
        entry.unwrap_or((hit, point))
    }

    /// The rays traced so far.
    pub fn counts(&self) -> RayCounts {
        self.counts.get()
    }

    /// What [batches](Self::trace_cameras) took so far; single rays are not timed.
    pub fn seconds(&self) -> ThreadSeconds {
        self.seconds.get()
    }

    /// Does some work, whose time counts as `spent` on what it says.
    pub(super) fn timed<T>(&self, spent: impl FnOnce(&mut ThreadSeconds, f64), work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let done = work();
        let mut seconds = self.seconds.get();
        spent(&mut seconds, start.elapsed().as_secs_f64());
        self.seconds.set(seconds);
        done
    }

    pub(super) fn count(&self, add: impl FnOnce(&mut RayCounts)) {
        let mut counts = self.counts.get();
        add(&mut counts);
        self.counts.set(counts);
    }
}

/// What lies behind everything in a unit direction.
pub fn background(background: &Background, direction: DVec3) -> Rgb {
    match background {
        Background::Color(color) => *color,
        Background::Gradient { bottom, top, up } => {
            let height = (0.5 + 0.5 * dot(direction, *up)) as f32;
            *bottom * (1.0 - height) + *top * height
        }
        Background::Image { texture, intensity } => {
            let u = 0.5 + libm::atan2(direction.x, -direction.z) / std::f64::consts::TAU;
            let v = 0.5 + libm::asin(direction.y.clamp(-1.0, 1.0)) / std::f64::consts::PI;
            texture.sample(DVec2::new(u, v)) * *intensity
        }
        Background::Transparent => Rgb::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_go_from_bottom_to_top() {
        let gradient = Background::Gradient { bottom: Rgb::ZERO, top: Rgb::ONE, up: DVec3::Y };
        assert_eq!(background(&gradient, DVec3::Y), Rgb::ONE);
        assert_eq!(background(&gradient, -DVec3::Y), Rgb::ZERO);
        assert_eq!(background(&gradient, DVec3::X), Rgb::splat(0.5));
    }
}
