//! The watertight ray-triangle test.
//!
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Two deviations:
//!
//! - They evaluate edge functions again in f64 where one is exactly 0. Here f32 only sorts out what is certainly missed;
//!   what is left is decided, and its t and weights are computed, from edge functions in f64, where the product of two f32
//!   is exact. Otherwise the weights of a sliver seen at a grazing angle are a few units of rounding, and the hit lies
//!   beside the triangle by as much as it is wide; and numbers beyond 1e12 overflow.
//! - t is clamped into the interval in which the ray crosses the triangle's own f32 box, so that no tree can cull a hit.

use glam::Vec3;

use crate::geometry::bounds::Bounds;
use crate::geometry::ray::PreparedRay;

/// Where a ray meets a triangle: the point is `(1 - u - v) A + u B + v C`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter, within the ray's `[t_min, t_max]`.
    pub t: f32,
    /// Weight of B.
    pub u: f32,
    /// Weight of C.
    pub v: f32,
}

/// Meets a ray with the closed triangle `a b c` from either side.
///
/// Vertices are in the ray's space and finite. A ray in the triangle's plane misses, and so does a triangle without
/// area. NaN anywhere in the computation means a miss. For a mesh whose triangles share vertices bit for bit no ray
/// passes between neighbours: the edge functions of a shared edge are exact negatives of each other.
#[inline(always)]
#[doc(alias = "IntersectTriangle")]
pub fn intersect_triangle(ray: &PreparedRay, a: Vec3, b: Vec3, c: Vec3) -> Option<TriangleHit> {
    let [kx, ky, kz] = ray.axes;
    let (sx, sy) = (ray.shear.x, ray.shear.y);

    // Move the origin to zero and shear the ray onto the z axis: the question becomes two-dimensional.
    let [a_rel, b_rel, c_rel] = [a, b, c].map(|p| (p - ray.origin).to_array());
    let (ax, ay) = (a_rel[kx] - sx * a_rel[kz], a_rel[ky] - sy * a_rel[kz]);
    let (bx, by) = (b_rel[kx] - sx * b_rel[kz], b_rel[ky] - sy * b_rel[kz]);
    let (cx, cy) = (c_rel[kx] - sx * c_rel[kz], c_rel[ky] - sy * c_rel[kz]);

    // On which side of each edge does the ray pass? Two rounded products, never fused. Rounding is monotone: a sign may
    // become 0, never the opposite, so that triangles with both signs are missed. NaN, after an overflow, decides nothing.
    let weight_a = cx * by - cy * bx;
    let weight_b = ax * cy - ay * cx;
    let weight_c = bx * ay - by * ax;
    if both_signs(weight_a, weight_b, weight_c) {
        return None;
    }

    // The same without rounding in the products. Each sign is that of the exact edge function, so that swapping the ends
    // of an edge flips it: what lies on one side of an edge for one triangle lies on the other for its neighbour.
    let [ax, ay, az, bx, by, bz, cx, cy, cz] = [ax, ay, a_rel[kz], bx, by, b_rel[kz], cx, cy, c_rel[kz]].map(f64::from);
    let weight_a = cx * by - cy * bx;
    let weight_b = ax * cy - ay * cx;
    let weight_c = bx * ay - by * ax;
    if both_signs(weight_a, weight_b, weight_c) {
        return None;
    }
    let determinant = weight_a + weight_b + weight_c;
    if !(determinant.abs() > 0.0 && determinant.abs() < f64::INFINITY) {
        return None;
    }

    // The distance is the weighted mean of the vertices' distances along the ray.
    let along = f64::from(ray.direction[kz]);
    let t = ((weight_a * az + weight_b * bz + weight_c * cz) / (determinant * along)) as f32;

    // Keep t where the ray crosses the triangle's box, then where it crosses the instance's.
    let own = Bounds::of([a, b, c]).interval(ray, f32::NEG_INFINITY, f32::INFINITY);
    if own.is_empty() {
        return None;
    }
    let t = ray.clip.clamp(own.clamp(t)) + 0.0; // + 0 turns -0 into 0
    if !(t >= ray.t_min && t <= ray.t_max && t < f32::INFINITY) {
        return None;
    }
    Some(TriangleHit { t, u: (weight_b / determinant) as f32, v: (weight_c / determinant) as f32 })
}

/// Whether some of the three are negative and some positive.
#[inline(always)]
fn both_signs<T: PartialOrd + Default>(a: T, b: T, c: T) -> bool {
    let zero = T::default();
    (a < zero || b < zero || c < zero) && (a > zero || b > zero || c > zero)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::Ray;
    use glam::DVec3;

    const A: Vec3 = Vec3::new(0.0, 0.0, 2.0);
    const B: Vec3 = Vec3::new(1.0, 0.0, 2.0);
    const C: Vec3 = Vec3::new(0.0, 1.0, 2.0);

    fn hit(ray: Ray) -> Option<TriangleHit> {
        PreparedRay::new(&ray).and_then(|ray| intersect_triangle(&ray, A, B, C))
    }

    #[test]
    fn barycentrics_weigh_b_and_c() {
        for direction in [Vec3::Z, Vec3::Z * 4.0] {
            let found = hit(Ray::new(Vec3::new(0.25, 0.5, 0.0), direction)).unwrap();
            assert_eq!((found.t * direction.z, found.u, found.v), (2.0, 0.25, 0.5));
        }
        let back = hit(Ray::new(Vec3::new(0.25, 0.5, 3.0), -Vec3::Z)).unwrap();
        assert_eq!((back.t, back.u, back.v), (1.0, 0.25, 0.5));
    }

    #[test]
    fn edges_vertices_and_interval_ends_are_inclusive() {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.5, 0.0), (0.0, 0.5)] {
            assert!(hit(Ray::new(Vec3::new(x, y, 0.0), Vec3::Z)).is_some(), "{x} {y}");
        }
        let ray = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);
        assert!(hit(Ray { t_min: 2.0, ..ray }).is_some());
        assert!(hit(Ray { t_max: 2.0, ..ray }).is_some());
        assert!(hit(Ray { t_min: 2.0f32.next_up(), ..ray }).is_none());
        assert!(hit(Ray { t_max: 2.0f32.next_down(), ..ray }).is_none());
    }

    #[test]
    fn rays_in_the_plane_and_flat_triangles_miss() {
        assert!(hit(Ray::new(Vec3::new(-1.0, 0.25, 2.0), Vec3::X)).is_none());
        let ray = PreparedRay::new(&Ray::new(Vec3::ZERO, Vec3::Z)).unwrap();
        assert!(intersect_triangle(&ray, A, B, B).is_none());
        assert!(intersect_triangle(&ray, A, B, Vec3::new(2.0, 0.0, 2.0)).is_none());
    }

    #[test]
    fn small_triangles_are_hit_at_every_scale() {
        for scale in [1.0f32, 2e-4, 1e-6, 1e-9, 1e-15] {
            let ray = Ray::new(Vec3::new(scale / 3.0, scale / 3.0, -1.0), Vec3::Z);
            let ray = PreparedRay::new(&ray).unwrap();
            let found = intersect_triangle(&ray, Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale);
            assert!((found.unwrap().t - 1.0).abs() <= 4.0 * f32::EPSILON, "{scale}");
        }
    }

    #[test]
    fn hits_on_grazed_slivers_lie_on_them() {
        // 11 long, 0.1 wide, 500 from the origin; the ray runs along it at 1e-4 radians. With weights in f32 the point
        // lies 0.006 beside it.
        let corners = [
            Vec3::new(486.99084, -325.1229, 465.88452),
            Vec3::new(493.32382, -334.3395, 465.2622),
            Vec3::new(487.85803, -326.4927, 465.7365),
        ];
        let ray = Ray::new(Vec3::new(473.53973, -329.49658, 453.25323), Vec3::new(0.8087095, -0.032456554, 0.5873121));
        let [a, b, c] = corners;
        let found = intersect_triangle(&PreparedRay::new(&ray).unwrap(), a, b, c).unwrap();
        let point = |t: f64| ray.origin.as_dvec3() + ray.direction.as_dvec3() * t;
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let weights = DVec3::new(1.0 - f64::from(found.u) - f64::from(found.v), found.u.into(), found.v.into());
        let off = point(found.t.into()) - (a * weights.x + b * weights.y + c * weights.z);
        assert!(off.abs().max_element() < 1e-4, "{off}");
    }

    #[test]
    fn numbers_may_be_as_large_and_small_as_f32_holds() {
        for exponent in [-140, -100, -62, 0, 62, 100, 124] {
            let size = libm::ldexpf(1.0, exponent);
            let ray = Ray::new(Vec3::new(0.25 * size, 0.5 * size, -size), Vec3::Z);
            let ray = PreparedRay::new(&ray).unwrap();
            let found = intersect_triangle(&ray, Vec3::ZERO, Vec3::X * size, Vec3::Y * size);
            assert_eq!(found, Some(TriangleHit { t: size, u: 0.25, v: 0.5 }), "2^{exponent}");
        }
    }
}
