//! Families of rays for any scene: those of pictures, and those aimed at what is hard.

use glam::{DVec2, DVec3, Vec3};

use crate::error::Result;
use crate::geometry::Ray;
use crate::math::random::Random;
use crate::math::vector::{basis, normalize};
use crate::render::world::World;
use crate::scene::camera::CameraRays;
use crate::scene::{Scene, Shape};

/// A way to draw rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RayFamily {
    /// Between random points in and around the scene's box.
    Random,
    /// From the camera through random points of the picture.
    Camera,
    /// From random points on surfaces into random directions, as reflected light goes.
    Bounce,
    /// Aimed at vertices, directions not normalised.
    Vertex,
    /// Aimed at points of edges.
    Edge,
    /// Segments from surface to surface that begin and end there.
    Segment,
    /// Along an axis, past vertices.
    Axis,
    /// In the plane of a triangle, as nearly as f32 holds it.
    Plane,
    /// Along tangents of quadrics.
    Tangent,
}

impl RayFamily {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Random,
        Self::Camera,
        Self::Bounce,
        Self::Vertex,
        Self::Edge,
        Self::Segment,
        Self::Axis,
        Self::Plane,
        Self::Tangent,
    ];

    /// Those of pictures.
    pub fn generic() -> &'static [Self] {
        &Self::ALL[..3]
    }

    /// Those aimed at what is hard.
    pub fn adversarial() -> &'static [Self] {
        &Self::ALL[3..]
    }

    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Camera => "camera",
            Self::Bounce => "bounce",
            Self::Vertex => "vertex",
            Self::Edge => "edge",
            Self::Segment => "segment",
            Self::Axis => "axis",
            Self::Plane => "plane",
            Self::Tangent => "tangent",
        }
    }
}

/// Draws rays for one scene, relative to its origin.
pub struct RaySource<'a> {
    scene: &'a Scene,
    world: World,
    camera: Option<CameraRays>,
    /// Around all that is bounded.
    min: DVec3,
    max: DVec3,
    /// Instances of meshes, and how many triangles those before and including them have.
    meshes: Vec<(u32, u64)>,
    /// Instances of quadrics.
    quadrics: Vec<u32>,
}

impl<'a> RaySource<'a> {
    /// Looks the scene over.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn new(scene: &'a Scene) -> Result<Self> {
        let world = World::new(scene)?;
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for bounds in world.instances.iter().filter_map(|instance| instance.bounds).filter(|bounds| !bounds.is_empty())
        {
            (min, max) = (min.min(bounds.min.as_dvec3()), max.max(bounds.max.as_dvec3()));
        }
        if !(min.is_finite() && max.is_finite()) {
            (min, max) = (DVec3::NEG_ONE, DVec3::ONE);
        }
        let (mut meshes, mut quadrics, mut triangles) = (Vec::new(), Vec::new(), 0);
        for (number, instance) in (0..).zip(&world.instances) {
            match instance.shape {
                Shape::Quadric(_) => quadrics.push(number),
                Shape::Mesh(mesh) if scene.meshes[mesh as usize].live_count() > 0 => {
                    triangles += scene.meshes[mesh as usize].indices.len() as u64;
                    meshes.push((number, triangles));
                }
                Shape::Mesh(_) => {}
            }
        }
        let (width, height) = (scene.film.width, scene.film.height);
        let camera = scene.cameras.get(scene.active_camera);
        let camera = camera.and_then(|named| named.camera.rays(width, height, scene.origin).ok());
        Ok(Self { scene, world, camera, min, max, meshes, quadrics })
    }

    /// Whether the scene has what the family is about.
    pub fn has(&self, family: RayFamily) -> bool {
        match family {
            RayFamily::Random => true,
            RayFamily::Camera => self.camera.is_some(),
            RayFamily::Bounce | RayFamily::Segment => !(self.meshes.is_empty() && self.quadrics.is_empty()),
            RayFamily::Vertex | RayFamily::Edge | RayFamily::Axis | RayFamily::Plane => !self.meshes.is_empty(),
            RayFamily::Tangent => !self.quadrics.is_empty(),
        }
    }

    /// Ray `number` of a family: a function of seed and number alone. A random one where the scene lacks what the family
    /// is about.
    pub fn ray(&self, family: RayFamily, seed: u64, number: u64) -> Ray {
        let random = &mut Random::new(seed ^ (family as u64) << 56, number);
        self.draw(family, random).unwrap_or_else(|| {
            let (from, to) = (self.around(random), self.around(random));
            between(from, to)
        })
    }

    /// The first rays of a family.
    pub fn rays(&self, family: RayFamily, seed: u64, count: u64) -> Vec<Ray> {
        (0..count).map(|number| self.ray(family, seed, number)).collect()
    }

    fn draw(&self, family: RayFamily, random: &mut Random) -> Option<Ray> {
        match family {
            RayFamily::Random => None,
            RayFamily::Camera => {
                let film = &self.scene.film;
                let (x, y) = (random.unit() * f64::from(film.width), random.unit() * f64::from(film.height));
                let view = self.camera.as_ref()?.ray(DVec2::new(x, y))?;
                Some(Ray::new(view.origin.as_vec3(), view.direction.as_vec3()))
            }
            RayFamily::Bounce => {
                let from = self.on_surface(random)?;
                Some(Ray::new(from.as_vec3(), random.direction().as_vec3()))
            }
            RayFamily::Vertex => {
                let target = self.corners(random)?[0];
                Some(between(self.around(random), target))
            }
            RayFamily::Edge => {
                let [a, b, _] = self.corners(random)?;
                Some(between(self.around(random), a + (b - a) * random.unit()))
            }
            RayFamily::Segment => {
                let (from, to) = (self.on_surface(random)?, self.on_surface(random)?);
                Some(Ray { t_max: 1.0, ..between(from, to) })
            }
            RayFamily::Axis => {
                let [a, b, _] = self.corners(random)?;
                let axis = random.below(3) as usize;
                // Half of the rays run past the middle of an edge, the others past its end.
                let mut origin = if random.below(2) == 0 { a } else { 0.5 * (a + b) };
                let upward = random.below(2) == 0;
                let size = self.max - self.min;
                origin[axis] = if upward { self.min[axis] - size[axis] } else { self.max[axis] + size[axis] };
                let direction = Vec3::AXES[axis] * (if upward { 1.0 } else { -1.0 });
                Some(Ray::new(origin.as_vec3(), direction))
            }
            RayFamily::Plane => {
                let [a, b, c] = self.corners(random)?;
                let (x, y) = (random.between(-1.0, 2.0), random.between(-1.0, 2.0));
                let target = a + (b - a) * x + (c - a) * y;
                let along = (b - a) * random.between(-1.0, 1.0) + (c - a) * random.between(-1.0, 1.0);
                let away = normalize(along)? * (self.max - self.min).max_element();
                Some(between(target - away, target))
            }
            RayFamily::Tangent => {
                let (point, normal) = self.on_quadric(random)?;
                let (across, up) = basis(normal);
                let turn = random.unit() * std::f64::consts::TAU;
                let (sin, cos) = libm::sincos(turn);
                let along = across * cos + up * sin;
                Some(between(point - along * (self.max - self.min).max_element(), point))
            }
        }
    }

    /// A point in or around the scene's box, which is made half as large again on each side.
    fn around(&self, random: &mut Random) -> DVec3 {
        let (middle, half) = (0.5 * (self.min + self.max), 0.5 * (self.max - self.min));
        middle + half * random.in_cube() * 2.0
    }

    /// The corners of a random triangle that can be hit, world space.
    fn corners(&self, random: &mut Random) -> Option<[DVec3; 3]> {
        let &(_, total) = self.meshes.last()?;
        // A few triangles of a mesh cannot be hit: draw again.
        (0..64).find_map(|_| {
            let drawn = random.below(total);
            let place = self.meshes.partition_point(|&(_, end)| end <= drawn);
            let (number, end) = self.meshes[place];
            let instance = &self.world.instances[number as usize];
            let Shape::Mesh(mesh) = instance.shape else { return None };
            let mesh = &self.scene.meshes[mesh as usize];
            let triangle = (drawn + mesh.indices.len() as u64 - end) as u32;
            let live = mesh.dropped.binary_search(&triangle).is_err();
            live.then(|| mesh.triangle(triangle).map(|p| instance.transform.point_to_world(p.as_dvec3())))
        })
    }

    fn on_surface(&self, random: &mut Random) -> Option<DVec3> {
        let quadric_turn = self.meshes.is_empty() || (!self.quadrics.is_empty() && random.below(2) == 0);
        if quadric_turn {
            return self.on_quadric(random).map(|(point, _)| point);
        }
        let [a, b, c] = self.corners(random)?;
        let (x, y) = (random.unit(), random.unit());
        let (x, y) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
        Some(a + (b - a) * x + (c - a) * y)
    }

    /// A point of a random quadric and the unit normal there, world space: where a random line meets it.
    fn on_quadric(&self, random: &mut Random) -> Option<(DVec3, DVec3)> {
        let number = *self.quadrics.get(random.below(self.quadrics.len().max(1) as u64) as usize)?;
        let instance = &self.world.instances[number as usize];
        let Shape::Quadric(quadric) = instance.shape else { return None };
        let quadric = &self.scene.quadrics[quadric as usize];
        (0..64).find_map(|_| {
            let (from, to) = match instance.bounds {
                Some(bounds) => {
                    let (min, size) = (bounds.min.as_dvec3(), bounds.size());
                    let mut inside = || min + size * (random.in_cube() * 0.5 + 0.5);
                    (inside(), inside())
                }
                None => (self.around(random), self.around(random)),
            };
            let (origin, direction) = instance.local_line(from, to - from);
            let crossing = quadric.intersect_quadratic(origin, direction).iter().next()?;
            let point = quadric.point(origin, direction, crossing.surface);
            let normal = normalize(instance.transform.normal_to_world(point.normal))?;
            Some((instance.transform.point_to_world(point.position), normal))
        })
    }
}

/// The ray whose t is 0 at one point and about 1 at another: the origin is rounded first, then the direction.
fn between(from: DVec3, to: DVec3) -> Ray {
    let origin = from.as_vec3();
    Ray::new(origin, (to - origin.as_dvec3()).as_vec3())
}

/// FNV-1a, 64 bits (Fowler, Noll and Vo), of little-endian 32-bit words: a fingerprint of rays or of answers.
pub fn fingerprint(words: impl IntoIterator<Item = u32>) -> u64 {
    let step = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    words.into_iter().flat_map(u32::to_le_bytes).fold(0xcbf2_9ce4_8422_2325, step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use crate::measure::oracle::Oracle;
    use crate::measure::scenes;
    use crate::scene::{Camera, NamedCamera, Projection};
    use glam::DAffine3;

    fn scene() -> Scene {
        let (points, triangles) = scenes::cube_points();
        let mut scene = scenes::empty();
        let projection = Projection::Perspective { fov_y: 1.0 };
        let camera = Camera::LookAt { eye: DVec3::Z * 9.0, target: DVec3::ZERO, up: DVec3::Y, projection };
        scene.cameras = vec![NamedCamera::new("", camera)];
        let cube = scenes::mesh_at(&points, triangles).unwrap();
        scenes::add_mesh(&mut scene, cube, DAffine3::from_translation(DVec3::new(4.0, 0.3, 0.0)), scenes::white());
        scenes::add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, scenes::white());
        scene
    }

    #[test]
    fn rays_are_valid_and_do_not_depend_on_how_many_are_drawn() {
        let scene = scene();
        let source = RaySource::new(&scene).unwrap();
        for family in RayFamily::ALL {
            assert!(source.has(family), "{family:?}");
            let rays = source.rays(family, 7, 200);
            assert!(rays.iter().all(Ray::is_valid), "{family:?}");
            assert_eq!(rays[..50], source.rays(family, 7, 50), "{family:?}");
            assert_ne!(rays, source.rays(family, 8, 200), "{family:?}");
        }
    }

    #[test]
    fn rays_go_where_their_names_say() {
        let scene = scene();
        let source = RaySource::new(&scene).unwrap();
        let oracle = Oracle::new(&scene).unwrap();
        let share = |family, what: &dyn Fn(&Ray) -> bool| {
            source.rays(family, 1, 400).iter().filter(|ray| what(ray)).count() as f64 / 400.0
        };
        assert!(share(RayFamily::Vertex, &|ray| oracle.occluded(ray)) > 0.4);
        assert!(share(RayFamily::Random, &|ray| oracle.occluded(ray)) > 0.1);
        // Of tangents about half pass just outside, as rounding has it.
        let on_sphere = |ray: &Ray| !oracle.on_line(ray, 1, 0).is_empty();
        let touching = share(RayFamily::Tangent, &on_sphere);
        assert!((0.2..0.8).contains(&touching), "{touching}");
        assert!(share(RayFamily::Axis, &|ray| ray.direction.abs().max_element() == 1.0) == 1.0);
    }

    #[test]
    fn fingerprints_are_those_of_fnv() {
        // The authors' test vectors: nothing, and "foob".
        assert_eq!(fingerprint([]), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fingerprint([u32::from_le_bytes(*b"foob")]), 0xdd12_0e79_0c25_12af);
    }
}
