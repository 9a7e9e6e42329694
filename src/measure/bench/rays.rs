//! The rays that are timed: those of pictures, in the order in which a renderer asks them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::{Bounds, Ray};
use crate::math::random::Random;
use crate::math::vector::{dot, length, normalize};
use crate::measure::ray_set::{Group, Question, RaySet};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::render::surface::SurfacePoint;
use crate::scene::camera::{CameraRays, ViewRay};
use crate::scene::{Camera, Projection, auto};

/// Every random number of a bench comes from this.
pub const SEED: u64 = 0x62_656e_6368;

/// Pixels along the side of the squares in which primary rays come.
const TILE: u32 = 8;

/// A way to make rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayKind {
    /// Through the middles of a picture's pixels, square by square of 8 x 8.
    Primary,
    /// From what primary rays hit to a point light, where the surface faces it: is there anything between?
    Shadow,
    /// From what primary rays hit, mirrored.
    Reflect,
    /// From what primary rays hit, as a matt surface scatters light: by the cosine to its normal.
    Diffuse,
}

impl RayKind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Reflect, Self::Diffuse];

    /// The name on the command line, in names of files and in rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Reflect => "reflect",
            Self::Diffuse => "diffuse",
        }
    }

    /// What is asked of such rays.
    pub fn question(self) -> Question {
        if self == Self::Shadow { Question::Occluded } else { Question::Closest }
    }
}

/// Where the camera stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum View {
    /// Before the model, which fills the picture.
    Outside,
    /// In the middle of the model's box, looking along its longer side.
    Inside,
}

impl View {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Outside, Self::Inside];

    /// The name on the command line and in rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Outside => "outside",
            Self::Inside => "inside",
        }
    }
}

/// Makes rays of one model from one place.
pub struct RaySource<'a> {
    renderer: &'a Renderer,
    camera: CameraRays,
    width: u32,
    height: u32,
    /// Relative to the scene's origin.
    light: DVec3,
}

impl<'a> RaySource<'a> {
    /// Places a camera for pictures of the film's size, which [`picture_size`] gave, and a light.
    ///
    /// # Errors
    /// A scene of which nothing is bounded.
    pub fn new(renderer: &'a Renderer, view: View) -> Result<Self> {
        let scene = renderer.scene();
        let (center, size) = extent(renderer)?;
        let (camera, light) = match view {
            View::Outside => {
                let (azimuth, elevation) = (30f64.to_radians(), 18f64.to_radians());
                let camera = auto::frame(scene, azimuth, elevation, auto::DEFAULT_FOV.to_radians());
                (camera, center + DVec3::new(-0.5, 1.0, 0.4) * length(size))
            }
            View::Inside => {
                let along = if size.x > size.z { DVec3::X } else { DVec3::Z };
                let eye = center + scene.origin;
                let target = eye + along * length(size);
                let projection = Projection::Perspective { fov_y: 60f64.to_radians() };
                let camera = Camera::LookAt { eye, target, up: DVec3::Y, projection };
                (camera, center + (along * 0.2 + DVec3::Y * 0.35) * size)
            }
        };
        let (width, height) = (scene.film.width, scene.film.height);
        Ok(Self { renderer, camera: camera.rays(width, height, scene.origin)?, width, height, light })
    }

    /// Makes the rays of a kind: one a pixel for primary ones, else one where a primary ray hits.
    ///
    /// # Errors
    /// A cancellation.
    pub fn rays(&self, kind: RayKind, progress: &dyn Progress) -> Result<RaySet> {
        let views = self.views();
        let rays = if kind == RayKind::Primary {
            views.iter().map(ray_of).collect()
        } else {
            let numbered: Vec<(u64, ViewRay)> = (0..).zip(views).collect();
            let spawn = |&(number, view): &(u64, ViewRay)| {
                progress.check()?;
                Ok(self.spawned(kind, &view, &mut Random::new(SEED, number)))
            };
            let spawned = numbered.par_iter().map(spawn).collect::<Result<Vec<Option<Ray>>>>()?;
            spawned.into_iter().flatten().collect()
        };
        Ok(RaySet { name: kind.name().into(), group: Group::Generic, question: kind.question(), rays })
    }

    /// The camera's rays, square by square, row by row within.
    fn views(&self) -> Vec<ViewRay> {
        let (across, down) = (self.width / TILE, self.height / TILE);
        let corners = (0..down).flat_map(|y| (0..across).map(move |x| (x * TILE, y * TILE)));
        let pixels = corners.flat_map(|(x, y)| (0..TILE * TILE).map(move |i| (x + i % TILE, y + i / TILE)));
        pixels.filter_map(|(x, y)| self.camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5))).collect()
    }

    /// The ray that leaves what a camera ray hits.
    fn spawned(&self, kind: RayKind, view: &ViewRay, random: &mut Random) -> Option<Ray> {
        let hit = self.renderer.closest(&ray_of(view));
        if !hit.is_hit() {
            return None;
        }
        let point = SurfacePoint::of(self.renderer.scene(), self.renderer.world(), view, &hit);
        let (normal, origin) = (point.geometric_normal, point.origin_outside());
        let (direction, t_max) = match kind {
            RayKind::Primary => return None,
            RayKind::Reflect => (view.direction - normal * (2.0 * dot(normal, view.direction)), f32::INFINITY),
            // A point on the sphere that touches the surface from above is met by the cosine.
            RayKind::Diffuse => (normalize(normal + random.direction()).unwrap_or(normal), f32::INFINITY),
            // The light itself is beyond the ray's end.
            RayKind::Shadow => (self.light - origin.as_dvec3(), 1.0f32.next_down()),
        };
        let faces = kind != RayKind::Shadow || dot(normal, direction) > 0.0;
        // As in a renderer, where rays that leave a surface do not begin at 0.
        let ray = Ray { origin, t_min: f32::MIN_POSITIVE, direction: direction.as_vec3(), t_max };
        (faces && ray.is_valid()).then_some(ray)
    }
}

/// Width and height of a picture of about `count` pixels, 4 by 3, in whole squares of 8 x 8.
pub fn picture_size(count: usize) -> (u32, u32) {
    let tiles = (count / (TILE * TILE) as usize).max(1) as f64;
    let across = libm::round((tiles * 4.0 / 3.0).sqrt()).max(1.0);
    let down = libm::round(tiles / across).max(1.0);
    (TILE * across as u32, TILE * down as u32)
}

/// Whether a model is a place to be in: from its middle there is something in at least two of three directions, and at
/// least half of that turns its front.
///
/// # Errors
/// A scene of which nothing is bounded.
pub fn has_an_inside(renderer: &Renderer) -> Result<bool> {
    const TRIES: u64 = 600;
    let (center, _) = extent(renderer)?;
    let (mut hits, mut fronts) = (0, 0);
    for number in 0..TRIES {
        let view = ViewRay { origin: center, direction: Random::new(SEED, number).direction() };
        let hit = renderer.closest(&ray_of(&view));
        if hit.is_hit() {
            hits += 1;
            fronts += u64::from(SurfacePoint::of(renderer.scene(), renderer.world(), &view, &hit).from_outside);
        }
    }
    Ok(3 * hits >= 2 * TRIES && 2 * fronts >= hits)
}

/// Middle and size of all that is bounded, relative to the scene's origin.
fn extent(renderer: &Renderer) -> Result<(DVec3, DVec3)> {
    let bounded = renderer.world().instances.iter().filter_map(|instance| instance.bounds);
    let all = bounded.fold(Bounds::EMPTY, Bounds::union);
    if all.is_empty() {
        return Err(Error::unsupported("there is nothing with an end to look at").remedy("choose a scene with a mesh"));
    }
    Ok((all.center(), all.size()))
}

fn ray_of(view: &ViewRay) -> Ray {
    Ray::new(view.origin.as_vec3(), view.direction.as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Params;
    use crate::measure::cases::meshes;
    use crate::progress::Silent;

    /// A sphere about the origin, faces outward or inward.
    fn renderer(outward: bool) -> Renderer {
        let mut mesh = meshes::sphere(48, 96, 2.0, DVec3::ZERO);
        if !outward {
            mesh.indices.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        }
        let mut scene = meshes::scene(vec![mesh]);
        (scene.film.width, scene.film.height) = picture_size(3072);
        Renderer::build(scene, &Params::default(), &Silent).unwrap()
    }

    #[test]
    fn pictures_are_four_by_three_in_whole_squares() {
        assert_eq!(picture_size(1_228_800), (1280, 960));
        assert_eq!(picture_size(307_200), (640, 480));
        assert_eq!(picture_size(1), (8, 8));
    }

    #[test]
    fn rays_leave_what_is_seen_as_their_names_say() {
        let renderer = renderer(true);
        let source = RaySource::new(&renderer, View::Outside).unwrap();
        let made = RayKind::ALL.map(|kind| source.rays(kind, &Silent).unwrap());
        let [primary, shadow, reflect, diffuse] = &made;
        assert_eq!((primary.rays.len(), primary.question), (3072, Question::Closest));
        let hits = primary.rays.iter().filter(|ray| renderer.closest(ray).is_hit()).count();
        assert!(hits > 1000 && reflect.rays.len() == hits && diffuse.rays.len() == hits);
        // The sphere is convex: nothing that leaves it meets it again, and half of it is lit.
        assert!(made[1..].iter().all(|set| set.rays.iter().all(|ray| !renderer.occluded(ray))));
        assert!(shadow.question == Question::Occluded && shadow.rays.len() > hits / 3 && shadow.rays.len() < hits);
        // Lambert: the mean cosine is 2/3.
        let cosine = |ray: &Ray| dot(normalize(ray.origin.as_dvec3()).unwrap(), ray.direction.as_dvec3());
        let mean = diffuse.rays.iter().map(cosine).sum::<f64>() / hits as f64;
        assert!((mean - 2.0 / 3.0).abs() < 0.02, "{mean}");
        assert_eq!(source.rays(RayKind::Diffuse, &Silent).unwrap(), *diffuse);
    }

    #[test]
    fn only_what_faces_inward_is_a_place_to_be_in() {
        assert!(!has_an_inside(&renderer(true)).unwrap());
        let room = renderer(false);
        assert!(has_an_inside(&room).unwrap());
        let source = RaySource::new(&room, View::Inside).unwrap();
        let [primary, shadow] = [RayKind::Primary, RayKind::Shadow].map(|kind| source.rays(kind, &Silent).unwrap());
        assert!(primary.rays.iter().all(|ray| room.closest(ray).is_hit()));
        assert_eq!(shadow.rays.len(), primary.rays.len());
        assert!(!shadow.rays.iter().any(|ray| room.occluded(ray)));
    }
}
