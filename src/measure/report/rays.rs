//! The sets of rays that a report asks about.

use glam::{DVec2, DVec3};

use crate::error::Result;
use crate::geometry::{Ray, TriangleMesh};
use crate::math::random::Random;
use crate::math::vector::{dot, length};
use crate::measure::ray_set::{Group, Question, RaySet};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::render::surface::SurfacePoint;
use crate::scene::camera::ViewRay;
use crate::scene::{LightKind, Scene};

/// Every random number of a report comes from this.
pub const SEED: u64 = 0x7265_706f_7274;

/// A way to make rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera through random places of the picture.
    Primary,
    /// From what primary rays hit to the lights.
    Shadow,
    /// From what primary rays hit, mirrored.
    Reflection,
    /// From random places in and around the box of the scene, in random directions.
    Random,
    /// At vertices, from random places in and around the box.
    Vertex,
    /// At points of edges, from the same.
    Edge,
    /// Within a thousandth of a triangle's plane, at a point inside it.
    Grazing,
    /// At random points of triangles, from a thousand times the scene's size away.
    Distant,
}

impl RayKind {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Primary,
        Self::Shadow,
        Self::Reflection,
        Self::Random,
        Self::Vertex,
        Self::Edge,
        Self::Grazing,
        Self::Distant,
    ];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Reflection => "reflection",
            Self::Random => "random",
            Self::Vertex => "vertex",
            Self::Edge => "edge",
            Self::Grazing => "grazing",
            Self::Distant => "distant",
        }
    }

    /// Whether pictures have such rays.
    pub fn group(self) -> Group {
        match self {
            Self::Primary | Self::Shadow | Self::Reflection | Self::Random => Group::Generic,
            Self::Vertex | Self::Edge | Self::Grazing | Self::Distant => Group::Adversarial,
        }
    }

    /// Makes `count` rays, or fewer where the scene gives no more: a camera that sees nothing has no shadows.
    ///
    /// `renderer` holds a scene of one untransformed mesh.
    ///
    /// # Errors
    /// A degenerate camera, or a cancellation.
    pub fn rays(self, renderer: &Renderer, count: usize, progress: &dyn Progress) -> Result<RaySet> {
        let scene = renderer.scene();
        let mut random = Random::new(SEED, self as u64);
        let rays = match self {
            Self::Primary => views(scene, count, &mut random)?.iter().map(ray_of).collect(),
            Self::Shadow | Self::Reflection => self.spawned(renderer, count, &mut random, progress)?,
            Self::Random => {
                let place = Places::of(&scene.meshes[0]);
                let ray = |_| Ray::new(place.around(&mut random).as_vec3(), random.direction().as_vec3());
                (0..count).map(ray).collect()
            }
            _ => self.aimed(&scene.meshes[0], count, &mut random),
        };
        let question = if self == Self::Shadow { Question::Occluded } else { Question::Closest };
        Ok(RaySet { name: self.name().into(), group: self.group(), question, rays })
    }

    /// Rays that leave what primary rays hit.
    fn spawned(
        self,
        renderer: &Renderer,
        count: usize,
        random: &mut Random,
        progress: &dyn Progress,
    ) -> Result<Vec<Ray>> {
        let scene = renderer.scene();
        let mut rays = Vec::with_capacity(count);
        // A camera may see little of the scene: give up after this many rounds.
        const ROUNDS: usize = 16;
        for _ in 0..ROUNDS {
            for view in views(scene, count, random)? {
                if rays.len() == count {
                    return Ok(rays);
                }
                progress.check()?;
                let hit = renderer.closest(&ray_of(&view));
                if !hit.is_hit() {
                    continue;
                }
                let point = SurfacePoint::of(scene, renderer.world(), &view, &hit);
                let origin = point.origin_outside();
                let spawned = |direction: DVec3, t_max: f32| Ray {
                    origin,
                    t_min: f32::MIN_POSITIVE,
                    direction: direction.as_vec3(),
                    t_max,
                };
                if self == Self::Reflection {
                    let mirrored = view.direction - point.normal * (2.0 * dot(point.normal, view.direction));
                    rays.push(spawned(mirrored, f32::INFINITY));
                } else if !scene.lights.is_empty() {
                    let light = &scene.lights[random.below(scene.lights.len() as u64) as usize];
                    let (to_light, t_max) = match light.kind {
                        LightKind::Directional { direction } => (-direction, f32::INFINITY),
                        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => {
                            (position - origin.as_dvec3(), 1.0f32.next_down())
                        }
                    };
                    if dot(point.normal, to_light) > 0.0 {
                        rays.push(spawned(to_light, t_max));
                    }
                }
            }
        }
        Ok(rays)
    }

    /// Rays aimed at what is hard about a mesh.
    fn aimed(self, mesh: &TriangleMesh, count: usize, random: &mut Random) -> Vec<Ray> {
        let live: Vec<u32> = mesh.live_triangles().collect();
        let place = Places::of(mesh);
        let ray = |_| {
            let corners = mesh.triangle(live[random.below(live.len() as u64) as usize]).map(|corner| corner.as_dvec3());
            let [a, b, c] = corners;
            let inside = {
                let (u, v) = (random.unit(), random.unit());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                a * (1.0 - u - v) + b * u + c * v
            };
            let (origin, target) = match self {
                Self::Vertex => (place.around(random), a),
                Self::Edge => (place.around(random), a + (b - a) * random.unit()),
                Self::Grazing => {
                    let along = (b - a) * random.between(-1.0, 1.0) + (c - a) * random.between(-1.0, 1.0);
                    let tilt = random.direction() * (length(along) * 1e-3 * random.unit());
                    let away = place.size / length(along).max(f64::MIN_POSITIVE);
                    (inside + (along + tilt) * away, inside)
                }
                _ => (inside + random.direction() * (place.size * 1e3), inside),
            };
            let origin = origin.as_vec3();
            Ray::new(origin, (target - origin.as_dvec3()).as_vec3())
        };
        (0..count).map(ray).filter(Ray::is_valid).collect()
    }
}

/// Camera rays through random places of the picture.
fn views(scene: &Scene, count: usize, random: &mut Random) -> Result<Vec<ViewRay>> {
    let (width, height) = (scene.film.width, scene.film.height);
    let camera = scene.camera().rays(width, height, scene.origin)?;
    let place = |_| DVec2::new(random.unit() * f64::from(width), random.unit() * f64::from(height));
    Ok((0..count).map(place).filter_map(|place| camera.ray(place)).collect())
}

fn ray_of(view: &ViewRay) -> Ray {
    Ray::new(view.origin.as_vec3(), view.direction.as_vec3())
}

/// Where rays at a mesh may start.
struct Places {
    center: DVec3,
    half: DVec3,
    /// Length of the box's diagonal.
    size: f64,
}

impl Places {
    fn of(mesh: &TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        Self { center: bounds.center(), half: bounds.size() * 0.5, size: length(bounds.size()) }
    }

    /// In a box one and a half times as large as the mesh's.
    fn around(&self, random: &mut Random) -> DVec3 {
        self.center + random.in_cube() * (self.half * 1.5 + DVec3::splat(0.05 * self.size))
    }
}
