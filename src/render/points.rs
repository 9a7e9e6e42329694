//! Surface points of many hits at once, array by array, in loops that become vectors.

use glam::{DVec3, Vec3};

use crate::geometry::{Hit, TriangleMesh};
use crate::math::Transform;
use crate::math::lanes::{Flags, LANES, Numbers, Vectors, Vectors32, whole_rows};
use crate::math::simd::{Level, Task};
use crate::math::vector::{dot, is_safe};
use crate::render::surface::{Place, SurfacePoint, interpolated, on_side_of, solve};
use crate::render::world::{Instance, World};
use crate::scene::camera::ViewRay;
use crate::scene::{Scene, Shape, compiled};

/// Up to [`LANES`] hits on one instance, or on any that are not many, with the rays that found them.
pub struct Found {
    /// How many there are.
    pub count: usize,
    /// The numbers of their rays.
    pub rays: [u32; LANES],
    /// The hits.
    pub hits: [Hit; LANES],
}

/// Their points, as [`SurfacePoint`] has them.
pub struct Points {
    /// Unit directions of the rays that came.
    pub(super) direction: Vectors,
    pub(super) position: Vectors,
    pub(super) geometric_normal: Vectors,
    pub(super) normal: Vectors,
    pub(super) offset: Numbers,
    pub(super) from_outside: Flags,
    pub(super) materials: [u32; LANES],
    /// Weights of a triangle's corners, or a quadric's point in object space.
    place: Vectors,
    on_triangle: [bool; LANES],
}

impl Found {
    /// Nothing.
    pub const NONE: Self = Self { count: 0, rays: [0; LANES], hits: [Hit::MISS; LANES] };

    /// Adds a hit; there must be room.
    #[inline(always)]
    pub fn push(&mut self, ray: u32, hit: Hit) {
        self.rays[self.count] = ray;
        self.hits[self.count] = hit;
        self.count += 1;
    }

    /// Whether there is no room.
    pub fn is_full(&self) -> bool {
        self.count == LANES
    }
}

impl Points {
    /// Without meaning.
    pub const NONE: Self = Self {
        direction: Vectors::ZERO,
        position: Vectors::ZERO,
        geometric_normal: Vectors::ZERO,
        normal: Vectors::ZERO,
        offset: [0.0; LANES],
        from_outside: [0; LANES],
        materials: [0; LANES],
        place: Vectors::ZERO,
        on_triangle: [false; LANES],
    };

    /// One of them.
    #[inline(always)]
    pub fn get(&self, at: usize) -> SurfacePoint {
        let place = self.place.get(at);
        SurfacePoint {
            position: self.position.get(at),
            geometric_normal: self.geometric_normal.get(at),
            normal: self.normal.get(at),
            from_outside: self.from_outside[at] != 0,
            material: self.materials[at],
            offset: self.offset[at],
            place: if self.on_triangle[at] { Place::Weights(place.to_array()) } else { Place::Point(place) },
        }
    }

    /// Sets one.
    pub fn set(&mut self, at: usize, point: &SurfacePoint) {
        self.position.set(at, point.position);
        self.geometric_normal.set(at, point.geometric_normal);
        self.normal.set(at, point.normal);
        self.offset[at] = point.offset;
        self.from_outside[at] = u32::from(point.from_outside);
        self.materials[at] = point.material;
        self.on_triangle[at] = point.is_on_triangle();
        let place = match point.place {
            Place::Weights(weights) => DVec3::from_array(weights),
            Place::Point(place) => place,
        };
        self.place.set(at, place);
    }

    /// Finds the points of hits that lie on one instance: [`SurfacePoint::of`] for each.
    #[inline(never)]
    pub fn solve(&mut self, level: Level, scene: &Scene, world: &World, views: &[ViewRay], found: &Found) {
        let Some(first) = found.hits[..found.count].first() else { return };
        let instance = &world.instances[first.instance as usize];
        let Shape::Mesh(mesh) = instance.shape else { return self.solve_each(scene, world, views, found) };
        let mesh = &*scene.meshes[mesh as usize];
        let mut given = Given::NONE;
        // What is left to be found one by one.
        let mut odd = [0; LANES];
        for (at, (hit, &ray)) in found.hits[..found.count].iter().zip(&found.rays).enumerate() {
            let view = &views[ray as usize];
            given.origin.set(at, view.origin);
            given.direction.set(at, view.direction);
            let [a, b, c] = mesh.triangle(hit.primitive);
            given.corners[0].set(at, a);
            given.corners[1].set(at, b);
            given.corners[2].set(at, c);
            (given.u[at], given.v[at]) = (hit.u, hit.v);
            self.materials[at] = scene.material_of(hit.instance, hit.primitive);
            self.on_triangle[at] = true;
        }
        self.direction = given.direction;
        let transform = &instance.transform;
        let lanes = whole_rows(found.count);
        if instance.is_unmoved() {
            level.run(OnTriangles::<false> { lanes, transform, given: &given, points: self, odd: &mut odd });
        } else {
            level.run(OnTriangles::<true> { lanes, transform, given: &given, points: self, odd: &mut odd });
        }
        if compiled::NORMALS
            && let Some(normals) = &mesh.normals
        {
            self.shade_smoothly(level, scene, instance, mesh, normals, found, &mut given, &mut odd);
        }
        if instance.has_normal_maps {
            let has_map = |material: u32| scene.materials[material as usize].detail.as_ref()?.normal.as_ref();
            for at in 0..found.count {
                odd[at] |= u32::from(has_map(self.materials[at]).is_some());
            }
        }
        self.solve_odd(scene, world, views, found, &odd);
    }

    #[expect(clippy::too_many_arguments, reason = "the second half of `solve`")]
    fn shade_smoothly(
        &mut self,
        level: Level,
        scene: &Scene,
        instance: &Instance,
        mesh: &TriangleMesh,
        normals: &[Vec3],
        found: &Found,
        given: &mut Given,
        odd: &mut Flags,
    ) {
        for (at, hit) in found.hits[..found.count].iter().enumerate() {
            let is_flat = scene.materials[self.materials[at] as usize].flat;
            // Corners without normals leave the face's.
            let [a, b, c] =
                mesh.indices[hit.primitive as usize].map(|i| if is_flat { Vec3::ZERO } else { normals[i as usize] });
            given.corners[0].set(at, a);
            given.corners[1].set(at, b);
            given.corners[2].set(at, c);
        }
        let transform = &instance.transform;
        let lanes = whole_rows(found.count);
        if instance.is_unmoved() {
            level.run(Smooth::<false> { lanes, transform, given, points: self, odd });
        } else {
            level.run(Smooth::<true> { lanes, transform, given, points: self, odd });
        }
    }

    /// Those one by one that loops leave, since lengths are extreme or normals are mapped.
    fn solve_odd(&mut self, scene: &Scene, world: &World, views: &[ViewRay], found: &Found, odd: &Flags) {
        for at in (0..found.count).filter(|&at| odd[at] != 0) {
            let view = &views[found.rays[at] as usize];
            self.set(at, &SurfacePoint::of(scene, world, view, &found.hits[at]));
        }
    }

    /// Finds the points of hits on whatever instances.
    pub fn solve_each(&mut self, scene: &Scene, world: &World, views: &[ViewRay], found: &Found) {
        for (at, (hit, &ray)) in found.hits[..found.count].iter().zip(&found.rays).enumerate() {
            let view = &views[ray as usize];
            self.direction.set(at, view.direction);
            self.set(at, &SurfacePoint::of(scene, world, view, hit));
        }
    }
}

/// What points are found from.
struct Given {
    origin: Vectors,
    direction: Vectors,
    /// Positions of the triangles' corners, then their normals.
    corners: [Vectors32; 3],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Given {
    const NONE: Self = Self {
        origin: Vectors::ZERO,
        direction: Vectors::ZERO,
        corners: [Vectors32::ZERO; 3],
        u: [0.0; LANES],
        v: [0.0; LANES],
    };
}

struct OnTriangles<'a, const MOVED: bool> {
    lanes: usize,
    transform: &'a Transform,
    given: &'a Given,
    points: &'a mut Points,
    odd: &'a mut Flags,
}

impl<const MOVED: bool> Task for OnTriangles<'_, MOVED> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        on_triangles::<MOVED>(self.lanes, self.transform, self.given, self.points, self.odd);
    }
}

#[inline(always)]
fn on_triangles<const MOVED: bool>(
    lanes: usize,
    transform: &Transform,
    given: &Given,
    points: &mut Points,
    odd: &mut Flags,
) {
    for at in 0..lanes.min(LANES) {
        let view = ViewRay { origin: given.origin.get(at), direction: given.direction.get(at) };
        let corners = [given.corners[0].get(at), given.corners[1].get(at), given.corners[2].get(at)];
        let (solved, is_regular) = solve::<MOVED>(transform, &view, [given.u[at], given.v[at]], corners);
        let normal = solved.geometric_normal();
        points.position.set(at, solved.position);
        points.geometric_normal.set(at, normal);
        points.normal.set(at, normal);
        points.offset[at] = solved.offset;
        points.from_outside[at] = u32::from(solved.from_outside);
        points.place.set(at, DVec3::new(solved.weights[0], solved.weights[1], solved.weights[2]));
        odd[at] = u32::from(!is_regular);
    }
}

struct Smooth<'a, const MOVED: bool> {
    lanes: usize,
    transform: &'a Transform,
    given: &'a Given,
    points: &'a mut Points,
    odd: &'a mut Flags,
}

impl<const MOVED: bool> Task for Smooth<'_, MOVED> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        smooth::<MOVED>(self.lanes, self.transform, self.given, self.points, self.odd);
    }
}

#[inline(always)]
fn smooth<const MOVED: bool>(lanes: usize, transform: &Transform, given: &Given, points: &mut Points, odd: &mut Flags) {
    for at in 0..lanes.min(LANES) {
        let corners = [given.corners[0].get(at), given.corners[1].get(at), given.corners[2].get(at)];
        let place = points.place.get(at);
        let (local, is_given) = interpolated(corners, [place.x, place.y, place.z]);
        let world = if MOVED { transform.normal_to_world(local) } else { local };
        let squared = dot(world, world);
        let is_regular = is_safe(squared);
        let face = points.geometric_normal.get(at);
        let normal = on_side_of(world / squared.sqrt(), face);
        let pick = |smooth: f64, flat: f64| if is_given { smooth } else { flat };
        let normal = DVec3::new(pick(normal.x, face.x), pick(normal.y, face.y), pick(normal.z, face.z));
        points.normal.set(at, normal);
        odd[at] |= u32::from(is_given & !is_regular);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::scene::{Material, Object};
    use glam::DAffine3;
    use std::sync::Arc;

    /// Triangles with normals, some of which are not given.
    fn mesh(random: &mut Random) -> TriangleMesh {
        let positions: Vec<_> = (0..3 * LANES).map(|_| random.in_cube().as_vec3()).collect();
        let indices = (0..LANES as u32).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
        let normals = (0..positions.len()).map(|number| match number % 11 {
            0 => Vec3::ZERO,
            1 => random.direction().as_vec3() * 1e-20,
            _ => random.direction().as_vec3(),
        });
        let normals = Some(normals.collect());
        TriangleMesh { positions: positions.into(), indices, normals, ..TriangleMesh::default() }.finish().unwrap()
    }

    #[test]
    fn points_of_many_hits_are_those_of_each() {
        let mut random = Random::new(9, 0x9017);
        let mesh = Arc::new(mesh(&mut random));
        // At the last scales the squares of normals leave f64, and points are found one by one.
        for scale in [1.0, -0.75, 1e-3, 1e101, 1e-101] {
            let transform = DAffine3::from_scale(DVec3::new(scale, scale.abs(), scale));
            let object = Object { name: String::new(), shape: Shape::Mesh(0), transform, material: Some(0) };
            let materials = vec![Material::default()];
            let scene = Scene { meshes: vec![mesh.clone()], objects: vec![object], materials, ..Scene::default() };
            let world = World::new(&scene).unwrap();
            for count in [1, 7, 8, 9, LANES] {
                let mut found = Found::NONE;
                let views: Vec<_> = (0..count)
                    .map(|_| ViewRay { origin: random.in_cube() * scale, direction: random.direction() })
                    .collect();
                for ray in 0..count as u32 {
                    let primitive = random.below(LANES as u64) as u32;
                    found.push(ray, Hit { t: 1.0, u: 0.25, v: 0.5, instance: 0, primitive });
                }
                for level in Level::available() {
                    let mut points = Points::NONE;
                    points.solve(level, &scene, &world, &views, &found);
                    for at in 0..count {
                        let expected = SurfacePoint::of(&scene, &world, &views[at], &found.hits[at]);
                        let [one, other] = [points.get(at), expected].map(|point| format!("{point:?}"));
                        assert_eq!(one, other, "{}, scale {scale}", level.name());
                        assert_eq!(points.direction.get(at), views[at].direction);
                    }
                }
            }
        }
    }
}
