//! The picture that fast pictures are measured against: the same scene, samples and shading, with f64 rays and exact hits.
//!
//! Rays are never rounded to f32. What they hit, and in which order, is decided by the exact [`Oracle`] on the f64 rays
//! as given: edges are inclusive, no ray passes between triangles that share an edge, ties go to the lowest instance
//! and primitive. Vertices are those that are stored in f32, since what reading rounded is no fault of the renderer
//! (`info` tells that loss); maps, cameras and lights are f64.
//!
//! # Where spawned rays start
//!
//! A ray that leaves a surface starts at its point, moved along the true normal by a bound on how far f64 may have put the
//! point off the surface: some 1e-15 of its coordinates, where the f32 path needs 1e-7 and more. Leaving out the surface
//! that was left, with no move, would be worse: a curved or concave surface may hit itself again and must be asked; and at
//! an edge the point lies on two triangles, of which the neighbour would be asked and hit at t = 0 by rounding's whim.
//! Contact shadows and leaks in corners are right to within the move.
//!
//! # Where shadow rays end
//!
//! Just before the light, by the same bound as in the f32 path ([`towards`]): a surface whose stored vertices may be at the
//! light but for their rounding to f32 does not shade it. That is a convention about the scene.

use std::time::Instant;

use glam::DVec3;

use crate::error::Result;
use crate::geometry::{Hit, Key};
use crate::math::vector::{dot, length, normalize};
use crate::measure::oracle::{Oracle, WideRay};
use crate::progress::Progress;
use crate::render::answers::{Answers, Meeting, towards};
use crate::render::ray_tracing::ray_tracing;
use crate::render::shadow::Illumination;
use crate::render::world::World;
use crate::render::{BuildStats, Film, RenderSettings, Tile};
use crate::scene::camera::ViewRay;
use crate::scene::{Camera, Light, Scene, Shape};

/// A scene that is rendered in f64 with exact hits.
pub struct ReferenceRenderer {
    scene: Scene,
    world: World,
    oracle: Oracle,
    stats: BuildStats,
}

impl ReferenceRenderer {
    /// Prepares a scene.
    ///
    /// # Errors
    /// As [`Oracle::new`], or a cancellation.
    pub fn build(scene: Scene, progress: &dyn Progress) -> Result<Self> {
        let start = Instant::now();
        progress.begin("build", 0);
        let world = World::new(&scene)?;
        let oracle = Oracle::new(&scene)?;
        progress.check()?;
        let stats = BuildStats {
            accelerator: "exact".into(),
            seconds: start.elapsed().as_secs_f64(),
            node_bytes: oracle.bytes() as u64,
            ..BuildStats::default()
        };
        Ok(Self { scene, world, oracle, stats })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What preparing took.
    pub fn build_stats(&self) -> &BuildStats {
        &self.stats
    }

    /// Puts another camera in the place of the active one.
    pub fn look_through(&mut self, camera: Camera) {
        self.scene.cameras[self.scene.active_camera].camera = camera;
        self.world.see(&self.scene);
    }

    /// Puts other lights in the place of the scene's.
    ///
    /// # Errors
    /// A light without direction.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<()> {
        self.scene.lights = lights;
        self.world.light(&self.scene)
    }

    /// Renders the scene through its active camera, as [`Renderer::render`](crate::render::Renderer::render) does.
    ///
    /// # Errors
    /// A degenerate camera, or a crop outside the picture.
    pub fn render(&self, settings: &RenderSettings, progress: &dyn Progress) -> Result<Film> {
        self.render_tiles(settings, progress, &|_| ())
    }

    /// [`render`](Self::render), with each tile shown to `finished` once it is, on the thread that rendered it.
    ///
    /// # Errors
    /// As `render`.
    pub fn render_tiles(
        &self,
        settings: &RenderSettings,
        progress: &dyn Progress,
        finished: &(dyn Fn(&Tile) + Sync),
    ) -> Result<Film> {
        let Self { scene, world, oracle, .. } = self;
        ray_tracing(scene, world, &Reference { scene, world, oracle }, settings, progress, finished)
    }
}

/// Forms and answers rays in f64.
struct Reference<'a> {
    scene: &'a Scene,
    world: &'a World,
    oracle: &'a Oracle,
}

impl Reference<'_> {
    /// A ray that starts beside the surface, on the side of `normal`.
    ///
    /// Where the bound is 0 (on a floor at height 0) it starts on the surface, exactly: then t = 0 does not count.
    fn leave(&self, from: &Meeting<'_>, normal: DVec3, direction: DVec3) -> WideRay {
        let origin = from.point.position + normal * self.displacement(from);
        WideRay { t_min: f64::MIN_POSITIVE, ..WideRay::new(origin, direction) }
    }

    /// A bound on the distance of a point from the surface that it was found on, along the normal.
    ///
    /// A point of a mesh is a mean of corners, whose weights add up to 1 within 2 roundings, which is 3 of the largest
    /// corner with that of the last weight; the products and sums lose 3 more, the map to the world 4 (three products
    /// and their sums), and adding the move itself 1. That is 11 roundings of the magnitudes, 5.5 epsilons; the rest of
    /// the 16 is for the normal's own rounding. A quadric tells its own bound, in object space, to which the map adds.
    fn displacement(&self, from: &Meeting<'_>) -> f64 {
        let Meeting { view, hit, point } = *from;
        let instance = &self.world.instances[hit.instance as usize];
        let (reach, own) = match instance.shape {
            Shape::Mesh(mesh) => {
                let corners = self.scene.meshes[mesh as usize].triangle(hit.primitive);
                let reach = corners.iter().fold(DVec3::ZERO, |reach, corner| reach.max(corner.as_dvec3().abs()));
                (reach, 0.0)
            }
            Shape::Quadric(quadric) => {
                let (origin, direction) = instance.local_line(view.origin, view.direction);
                let found = self.scene.quadrics[quadric as usize].point(origin, direction, hit.primitive);
                let normal = normalize(found.normal).unwrap_or(DVec3::ZERO);
                // Planes a distance 1 apart in object space are 1 / |M^-T n| apart in the world.
                let stretch = 1.0 / length(instance.transform.normal_to_world(normal));
                (found.position.abs(), if stretch.is_finite() { found.error * stretch } else { found.error })
            }
        };
        let map = instance.transform.to_world();
        let magnitude = map.matrix3.x_axis.abs() * reach.x
            + map.matrix3.y_axis.abs() * reach.y
            + map.matrix3.z_axis.abs() * reach.z
            + map.translation.abs()
            + point.position.abs();
        own + 16.0 * f64::EPSILON * dot(point.geometric_normal.abs(), magnitude)
    }
}

impl Answers for Reference<'_> {
    type Ray = WideRay;

    fn camera_ray(&self, view: &ViewRay) -> WideRay {
        WideRay::new(view.origin, view.direction)
    }

    fn ray_outside(&self, from: &Meeting<'_>, direction: DVec3) -> WideRay {
        self.leave(from, from.point.geometric_normal, direction)
    }

    fn ray_inside(&self, from: &Meeting<'_>, direction: DVec3) -> WideRay {
        self.leave(from, -from.point.geometric_normal, direction)
    }

    fn shadow_ray(&self, from: &Meeting<'_>, illumination: &Illumination) -> WideRay {
        let ray = self.ray_outside(from, illumination.to_light);
        match illumination.position {
            None => ray,
            Some(position) => {
                let (direction, t_max) = towards(position, ray.origin);
                WideRay { direction, t_max, ..ray }
            }
        }
    }

    fn first_hit(&self, ray: &WideRay) -> Hit {
        self.oracle.closest(ray).map_or(Hit::MISS, |found| found.hit())
    }

    fn next_until(&self, _: &WideRay, _: Key, _: f32) -> Hit {
        Hit::MISS
    }

    fn next_hit(&self, ray: &WideRay, after: Key) -> Hit {
        let all = self.oracle.all_among(ray, &|_| true).into_iter().map(|exact| exact.hit());
        let mut rest = all.skip_while(|hit| (hit.instance, hit.primitive) != (after.instance, after.primitive)).skip(1);
        rest.next().unwrap_or(Hit::MISS)
    }

    fn is_blocked_by_opaque(&self, ray: &WideRay) -> bool {
        self.oracle.occluded_by(ray, &|instance| self.world.instances[instance as usize].opaque)
    }

    fn visit_transmissive(&self, ray: &WideRay, mut visit: impl FnMut(&Hit) -> bool) {
        let found = self.oracle.all_among(ray, &|instance| !self.world.instances[instance as usize].opaque);
        for exact in found {
            if !visit(&exact.hit()) {
                break;
            }
        }
    }
}
