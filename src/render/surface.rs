//! What shading needs of a hit point, made once for the winner, in f64.

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};

use crate::geometry::triangle::hit_bounds_by_number;
use crate::geometry::{Bounds, Hit, Quadric, TriangleMesh};
use crate::math::Transform;
use crate::math::float::{gamma, round_down, round_up};
use crate::math::vector::{cross, dot, is_safe, normal_and_length, normalize};
use crate::render::world::{Instance, World};
use crate::scene::camera::ViewRay;
use crate::scene::{Scene, Shape, compiled};

/// A point on a surface, in the renderer's world.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// Where it is, f64.
    pub position: DVec3,
    /// Unit normal of the true surface, on the side that the ray came from.
    pub geometric_normal: DVec3,
    /// Unit shading normal, on the same side as `geometric_normal`.
    pub normal: DVec3,
    /// Whether the ray came from outside: against the front of the triangle, from where a quadric's F is positive.
    pub from_outside: bool,
    /// Position of the material in the scene's list.
    pub material: u32,
    /// How far intersections with this surface may be off along its normal.
    pub(super) offset: f64,
    pub(super) place: Place,
}

/// Where a point is on its own surface.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// The weights of a triangle's corners.
    Weights([f64; 3]),
    /// A quadric's point in object space.
    Point(DVec3),
}

/// A point in object space, before it is placed in the world.
struct LocalPoint {
    position: DVec3,
    /// Unit normal of the true surface, outward, where there is one.
    normal: Option<DVec3>,
    /// How far along the normal an intersection may be off.
    error: f64,
    /// Whether the ray came from outside, where that is known better than by the normal.
    from_outside: Option<bool>,
    place: Place,
}

impl SurfacePoint {
    /// Solves for the point where `ray` meets the surface that `hit` found.
    ///
    /// The hit was decided in f32; the point is solved again in f64 from the surface and the unrounded ray, so that
    /// its error does not depend on how far the ray has come.
    pub fn of(scene: &Scene, world: &World, ray: &ViewRay, hit: &Hit) -> Self {
        let instance = &world.instances[hit.instance as usize];
        let material = scene.material_of(hit.instance, hit.primitive);
        match instance.shape {
            Shape::Mesh(mesh) => {
                let mesh = &scene.meshes[mesh as usize];
                let mut point = Self::on_triangle(instance, ray, hit, mesh.triangle(hit.primitive), material);
                if compiled::NORMALS
                    && let Some(normals) = &mesh.normals
                    && !scene.materials[material as usize].flat
                {
                    let corners = mesh.indices[hit.primitive as usize].map(|i| normals[i as usize]);
                    point.set_shading_normal(instance, corners);
                }
                if compiled::NORMALS
                    && instance.has_normal_maps
                    && let Some(map) =
                        scene.materials[material as usize].detail.as_ref().and_then(|d| d.normal.as_ref())
                {
                    point.map_normal(scene, world, instance, hit, map);
                }
                point
            }
            Shape::Quadric(_) if !compiled::QUADRICS => unreachable!("this build has no quadrics"),
            Shape::Quadric(quadric) => {
                Self::on_quadric(&scene.quadrics[quadric as usize], instance, ray, hit, material)
            }
        }
    }

    #[inline(always)]
    fn on_triangle(instance: &Instance, ray: &ViewRay, hit: &Hit, corners: [Vec3; 3], material: u32) -> Self {
        let uv = [hit.u, hit.v];
        let (solved, is_regular) = if instance.is_unmoved() {
            solve::<false>(&instance.transform, ray, uv, corners)
        } else {
            solve::<true>(&instance.transform, ray, uv, corners)
        };
        if is_regular {
            solved.point(material)
        } else {
            Self::on_extreme_triangle(instance, ray, hit, corners, material)
        }
    }

    /// The same where a normal has no length, or one whose square f64 does not hold.
    #[cold]
    fn on_extreme_triangle(instance: &Instance, ray: &ViewRay, hit: &Hit, corners: [Vec3; 3], material: u32) -> Self {
        let (origin, direction) = instance.local_line(ray.origin, ray.direction);
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let weights = refined_weights(origin, direction, [hit.u, hit.v], [a, b, c]);
        let position = at_weights([a, b, c], weights);
        let face = normal_and_length(cross(b - a, c - a));
        let error = face.map_or(0.0, |face| test_error(position, weights, corners, face));
        let normal = face.map(|(normal, _)| normal);
        let local = LocalPoint { position, normal, error, from_outside: None, place: Place::Weights(weights) };
        Self::placed(instance, ray, local, material)
    }

    /// Kept out of the function above, which is smaller and faster without it where there are only meshes.
    #[inline(never)]
    fn on_quadric(quadric: &Quadric, instance: &Instance, ray: &ViewRay, hit: &Hit, material: u32) -> Self {
        let (origin, direction) = instance.local_line(ray.origin, ray.direction);
        let point = quadric.point(origin, direction, hit.primitive);
        let local = LocalPoint {
            position: point.position,
            normal: normalize(point.normal),
            error: point.error,
            from_outside: point.from_outside,
            place: Place::Point(point.position),
        };
        Self::placed(instance, ray, local, material)
    }

    /// Brings a point with its normals and error into the world.
    #[inline(always)]
    fn placed(instance: &Instance, ray: &ViewRay, local: LocalPoint, material: u32) -> Self {
        let LocalPoint { position, normal, error, from_outside, place } = local;
        let against = -ray.direction;
        let (position, outward, offset) = if instance.is_unmoved() {
            (position, normal.unwrap_or(against), error)
        } else {
            let (transform, local) = (&instance.transform, normal.unwrap_or(DVec3::ZERO));
            let error = error + dot(local.abs(), there_and_back(transform, position));
            let (outward, length) = normal_and_length(transform.normal_to_world(local)).unwrap_or((against, 1.0));
            // Planes a distance 1 apart in object space are 1 / |M^-T n| apart in the world.
            (transform.point_to_world(position), outward, error / length)
        };
        let from_outside = from_outside.unwrap_or_else(|| dot(outward, against) >= 0.0);
        let geometric_normal = if from_outside { outward } else { -outward };
        let normal = geometric_normal;
        Self { position, geometric_normal, normal, from_outside, material, offset, place }
    }

    /// Interpolates the corners' normals, of any length, where all are given. Out of line, since meshes without normals need not pay.
    #[inline(never)]
    fn set_shading_normal(&mut self, instance: &Instance, corners: [Vec3; 3]) {
        let Place::Weights(weights) = self.place else { return };
        let (local, is_given) = interpolated(corners, weights);
        let world = if instance.is_unmoved() { local } else { instance.transform.normal_to_world(local) };
        if let Some(normal) = normalize(world).filter(|_| is_given) {
            self.normal = on_side_of(normal, self.geometric_normal);
        }
    }

    /// Texture coordinates of this point, which `hit` found; the origin if its mesh has none.
    pub fn texture_coordinates(&self, scene: &Scene, hit: &Hit) -> DVec2 {
        match (scene.objects[hit.instance as usize].shape, self.place) {
            (Shape::Mesh(mesh), Place::Weights(weights)) => {
                let mesh = &scene.meshes[mesh as usize];
                mesh.uvs.as_ref().map_or(DVec2::ZERO, |uvs| uv_at(mesh, uvs, hit.primitive, weights))
            }
            (Shape::Quadric(quadric), Place::Point(position)) => {
                scene.quadrics[quadric as usize].uv(position, hit.primitive)
            }
            _ => unreachable!("the point is of another hit"),
        }
    }

    /// Whether it is on a triangle, not on a quadric.
    pub(super) fn is_on_triangle(&self) -> bool {
        matches!(self.place, Place::Weights(_))
    }

    /// Where a ray that leaves on the side of the incoming ray starts, rounded to f32 away from the surface.
    pub fn origin_outside(&self) -> Vec3 {
        self.origin_along(self.geometric_normal)
    }

    /// Where a ray that goes through the surface starts.
    pub fn origin_inside(&self) -> Vec3 {
        self.origin_along(-self.geometric_normal)
    }

    fn origin_along(&self, normal: DVec3) -> Vec3 {
        moved_off(self.position, normal, self.offset)
    }
}

/// Texture coordinates, of one of a mesh's sets, at a point given by the weights of a triangle's corners.
pub(super) fn uv_at(mesh: &TriangleMesh, uvs: &[Vec2], primitive: u32, [wa, wb, wc]: [f64; 3]) -> DVec2 {
    let [a, b, c] = mesh.indices[primitive as usize].map(|i| uvs[i as usize].as_dvec2());
    a * wa + b * wb + c * wc
}

/// A point a distance along a normal, rounded to f32 away from where it was.
#[inline(always)]
pub(super) fn moved_off(position: DVec3, normal: DVec3, offset: f64) -> Vec3 {
    let moved = position + normal * offset;
    let away = |x: f64, n: f64| {
        let (up, down, nearest) = (round_up(x), round_down(x), x as f32);
        if n > 0.0 {
            up
        } else if n < 0.0 {
            down
        } else {
            nearest
        }
    };
    Vec3::new(away(moved.x, normal.x), away(moved.y, normal.y), away(moved.z, normal.z))
}

/// A point on a triangle, in the world.
pub(super) struct Solved {
    pub position: DVec3,
    /// Unit normal of the front.
    pub outward: DVec3,
    pub from_outside: bool,
    pub offset: f64,
    pub weights: [f64; 3],
}

impl Solved {
    /// Unit normal on the side that the ray came from.
    #[inline(always)]
    pub fn geometric_normal(&self) -> DVec3 {
        if self.from_outside { self.outward } else { -self.outward }
    }

    #[inline(always)]
    fn point(&self, material: u32) -> SurfacePoint {
        let normal = self.geometric_normal();
        SurfacePoint {
            position: self.position,
            geometric_normal: normal,
            normal,
            from_outside: self.from_outside,
            material,
            offset: self.offset,
            place: Place::Weights(self.weights),
        }
    }
}

/// Solves for the point where a ray meets a triangle, of an object that is `MOVED` or stands in the world as it is; `uv` are the hit's.
///
/// Without a branch, so that a loop over many becomes vectors; where a length leaves [`SAFE`] the second value is false, and the first
/// is not to be used.
#[inline(always)]
pub(super) fn solve<const MOVED: bool>(
    transform: &Transform,
    ray: &ViewRay,
    uv: [f32; 2],
    corners: [Vec3; 3],
) -> (Solved, bool) {
    let mut line = (ray.origin, ray.direction);
    if MOVED {
        line = (transform.point_to_object(ray.origin), transform.vector_to_object(ray.direction));
    }
    let [a, b, c] = [corners[0].as_dvec3(), corners[1].as_dvec3(), corners[2].as_dvec3()];
    let weights = refined_weights(line.0, line.1, uv, [a, b, c]);
    let mut position = at_weights([a, b, c], weights);
    let face = cross(b - a, c - a);
    let squared = dot(face, face);
    let length = squared.sqrt();
    let mut is_regular = is_safe(squared);
    let mut outward = face / length;
    let mut offset = test_error(position, weights, corners, (outward, length));
    if MOVED {
        let error = offset + dot(outward.abs(), there_and_back(transform, position));
        let normal = transform.normal_to_world(outward);
        let squared = dot(normal, normal);
        let length = squared.sqrt();
        is_regular &= is_safe(squared);
        position = transform.point_to_world(position);
        // Planes a distance 1 apart in object space are 1 / |M^-T n| apart in the world.
        (outward, offset) = (normal / length, error / length);
    }
    let from_outside = dot(outward, -ray.direction) >= 0.0;
    (Solved { position, outward, from_outside, offset, weights }, is_regular)
}

/// From one corner, so that a triangle in a plane along two axes has its points exactly there.
#[inline(always)]
fn at_weights([a, b, c]: [DVec3; 3], [_, wb, wc]: [f64; 3]) -> DVec3 {
    a + (b - a) * wb + (c - a) * wc
}

/// The corners' normals, interpolated, of any length; and whether all are given.
#[inline(always)]
pub(super) fn interpolated([a, b, c]: [Vec3; 3], [wa, wb, wc]: [f64; 3]) -> (DVec3, bool) {
    let is_given = |n: Vec3| (n.x != 0.0) | (n.y != 0.0) | (n.z != 0.0);
    let local = a.as_dvec3() * wa + b.as_dvec3() * wb + c.as_dvec3() * wc;
    (local, is_given(a) & is_given(b) & is_given(c))
}

/// A normal, or its opposite, on the side of another.
#[inline(always)]
pub(super) fn on_side_of(normal: DVec3, other: DVec3) -> DVec3 {
    if dot(normal, other) < 0.0 { -normal } else { normal }
}

/// What bringing a point of an object to the world and a ray's origin from there back to the object may lose, per axis of
/// the object: 64 roundings in f64 of all magnitudes that take part.
#[inline(always)]
fn there_and_back(transform: &Transform, position: DVec3) -> DVec3 {
    let magnitude = |m: &DAffine3, p: DVec3| {
        m.matrix3.x_axis.abs() * p.x.abs()
            + m.matrix3.y_axis.abs() * p.y.abs()
            + m.matrix3.z_axis.abs() * p.z.abs()
            + m.translation.abs()
    };
    let world = magnitude(transform.to_world(), position);
    magnitude(transform.to_object(), world) * (64.0 * f64::EPSILON)
}

/// How far along the normal the f32 triangle test may place a hit of a ray that starts at `position` on the triangle.
///
/// The edge functions are off by some roundings of the squared distance to the corners; divided by twice the area that
/// is the error of the barycentrics, and times the distance that of the place: it grows as a triangle gets thinner,
/// and along the normal does not depend on the ray's direction. But t is clamped to where the ray crosses the
/// triangle's box, so that a start above all of the box is enough, from where no ray that leaves the triangle meets it: on
/// an axis-aligned triangle that is no distance at all, and contact shadows stay attached. Two roundings of the point's
/// coordinates are for the start of a ray that is rounded in the mesh's own space.
#[inline(always)]
fn test_error(position: DVec3, weights: [f64; 3], corners: [Vec3; 3], (normal, twice_area): (DVec3, f64)) -> f64 {
    let [a, b, c] = [corners[0].as_dvec3(), corners[1].as_dvec3(), corners[2].as_dvec3()];
    let squared = |corner: DVec3| dot(corner - position, corner - position);
    let reach_squared = larger(larger(squared(a), squared(b)), squared(c));
    // How far the box reaches above and below the triangle's plane.
    let Bounds { min, max } = hit_bounds_by_number(corners);
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let (half, middle) = (0.5 * (max - min), 0.5 * (max + min));
    let box_reach = dot(normal.abs(), half) + dot(normal, middle - position).abs();
    let place = (a.abs() * weights[0] + b.abs() * weights[1] + c.abs() * weights[2]) * gamma(2);
    let reach = gamma(4) * reach_squared.sqrt() * (1.0 + reach_squared / twice_area);
    (if reach < box_reach { reach } else { box_reach }) + dot(normal.abs(), place)
}

#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The weights of a triangle's corners where the f64 ray meets it, kept inside the triangle.
///
/// Möller and Trumbore's test in f64 serves as a solver here: that the triangle is hit is already decided. A ray that
/// runs within the plane keeps the weights of the f32 hit.
#[inline(always)]
fn refined_weights(origin: DVec3, direction: DVec3, uv: [f32; 2], [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let p = cross(direction, ac);
    let determinant = dot(ab, p);
    let from_a = origin - a;
    let u = dot(from_a, p) / determinant;
    let v = dot(direction, cross(from_a, ab)) / determinant;
    let is_finite = (u.abs() < f64::INFINITY) & (v.abs() < f64::INFINITY);
    let (u, v) = if is_finite { (u, v) } else { (f64::from(uv[0]), f64::from(uv[1])) };
    let within = |x: f64, end: f64| {
        let x = if x < 0.0 { 0.0 } else { x };
        if x > end { end } else { x }
    };
    let u = within(u, 1.0);
    let v = within(v, 1.0 - u);
    [1.0 - u - v, u, v]
}
