//! What shading needs of a hit point, made once for the winner, in f64.

use glam::{DAffine3, DVec2, DVec3, Vec3};

use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, Hit, Quadric};
use crate::math::Transform;
use crate::math::float::{gamma, round_down, round_up};
use crate::math::vector::{cross, dot, normal_and_length, normalize};
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
    offset: f64,
    place: Place,
}

/// Where a point is on its own surface.
#[derive(Debug, Clone, Copy)]
enum Place {
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
                let corners = mesh.triangle(hit.primitive).map(|p| p.as_dvec3());
                let weights = refined_weights(instance, ray, hit, corners);
                let [_, wb, wc] = weights;
                let [a, b, c] = corners;
                // From one corner, so that a triangle in a plane along two axes has its points exactly there.
                let position = a + (b - a) * wb + (c - a) * wc;
                let face = normal_and_length(cross(b - a, c - a));
                let error = face.map_or(0.0, |face| test_error(position, weights, corners, face));
                let normal = face.map(|(normal, _)| normal);
                let local = LocalPoint { position, normal, error, from_outside: None, place: Place::Weights(weights) };
                let mut point = Self::placed(instance, ray, local, material);
                if compiled::NORMALS
                    && let Some(normals) = &mesh.normals
                    && !scene.materials[material as usize].flat
                {
                    let corners = mesh.indices[hit.primitive as usize].map(|i| normals[i as usize]);
                    point.set_shading_normal(instance, corners, weights);
                }
                point
            }
            Shape::Quadric(_) if !compiled::QUADRICS => unreachable!("this build has no quadrics"),
            Shape::Quadric(quadric) => {
                Self::on_quadric(&scene.quadrics[quadric as usize], instance, ray, hit, material)
            }
        }
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
    fn set_shading_normal(&mut self, instance: &Instance, [a, b, c]: [Vec3; 3], [wa, wb, wc]: [f64; 3]) {
        if a == Vec3::ZERO || b == Vec3::ZERO || c == Vec3::ZERO {
            return;
        }
        let local = a.as_dvec3() * wa + b.as_dvec3() * wb + c.as_dvec3() * wc;
        let world = if instance.is_unmoved() { local } else { instance.transform.normal_to_world(local) };
        if let Some(normal) = normalize(world) {
            self.normal = if dot(normal, self.geometric_normal) < 0.0 { -normal } else { normal };
        }
    }

    /// Texture coordinates of this point, which `hit` found; the origin if its mesh has none.
    pub fn texture_coordinates(&self, scene: &Scene, hit: &Hit) -> DVec2 {
        match (scene.objects[hit.instance as usize].shape, self.place) {
            (Shape::Mesh(mesh), Place::Weights([wa, wb, wc])) => {
                let mesh = &scene.meshes[mesh as usize];
                let Some(uvs) = &mesh.uvs else { return DVec2::ZERO };
                let [a, b, c] = mesh.indices[hit.primitive as usize].map(|i| uvs[i as usize].as_dvec2());
                a * wa + b * wb + c * wc
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
        let moved = self.position + normal * self.offset;
        let away = |x: f64, n: f64| {
            if n > 0.0 {
                round_up(x)
            } else if n < 0.0 {
                round_down(x)
            } else {
                x as f32
            }
        };
        Vec3::new(away(moved.x, normal.x), away(moved.y, normal.y), away(moved.z, normal.z))
    }
}

/// What bringing a point of an object to the world and a ray's origin from there back to the object may lose, per axis of
/// the object: 64 roundings in f64 of all magnitudes that take part.
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
fn test_error(position: DVec3, weights: [f64; 3], [a, b, c]: [DVec3; 3], (normal, twice_area): (DVec3, f64)) -> f64 {
    let squared = |corner: DVec3| dot(corner - position, corner - position);
    let reach_squared = squared(a).max(squared(b)).max(squared(c));
    // How far the box reaches above and below the triangle's plane.
    let Bounds { min, max } = hit_bounds([a, b, c].map(|corner| corner.as_vec3()));
    let (min, max) = (min.as_dvec3(), max.as_dvec3());
    let (half, middle) = (0.5 * (max - min), 0.5 * (max + min));
    let box_reach = dot(normal.abs(), half) + dot(normal, middle - position).abs();
    let place = (a.abs() * weights[0] + b.abs() * weights[1] + c.abs() * weights[2]) * gamma(2);
    (gamma(4) * reach_squared.sqrt() * (1.0 + reach_squared / twice_area)).min(box_reach) + dot(normal.abs(), place)
}

/// The weights of a triangle's corners where the f64 ray meets it, kept inside the triangle.
///
/// Möller and Trumbore's test in f64 serves as a solver here: that the triangle is hit is already decided. A ray that
/// runs within the plane keeps the weights of the f32 hit.
fn refined_weights(instance: &Instance, ray: &ViewRay, hit: &Hit, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (origin, direction) = instance.local_line(ray.origin, ray.direction);
    let (ab, ac) = (b - a, c - a);
    let p = cross(direction, ac);
    let determinant = dot(ab, p);
    let from_a = origin - a;
    let u = dot(from_a, p) / determinant;
    let v = dot(direction, cross(from_a, ab)) / determinant;
    let (u, v) = if u.is_finite() && v.is_finite() { (u, v) } else { (f64::from(hit.u), f64::from(hit.v)) };
    let u = u.clamp(0.0, 1.0);
    let v = v.clamp(0.0, 1.0 - u);
    [1.0 - u - v, u, v]
}
