//! The watertight ray-triangle test.
//!
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Two deviations: there is no f64 fallback
//! for edge functions that are exactly 0 (inclusive edges leave no gap without it), and t is clamped into the
//! interval in which the ray crosses the triangle's own f32 box, so that no tree can cull a hit.

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
    let (sx, sy, sz) = (ray.shear.x, ray.shear.y, ray.shear.z);

    // Move the origin to zero and shear the ray onto the z axis: the question becomes two-dimensional.
    let [a_rel, b_rel, c_rel] = [a, b, c].map(|p| (p - ray.origin).to_array());
    let (ax, ay) = (a_rel[kx] - sx * a_rel[kz], a_rel[ky] - sy * a_rel[kz]);
    let (bx, by) = (b_rel[kx] - sx * b_rel[kz], b_rel[ky] - sy * b_rel[kz]);
    let (cx, cy) = (c_rel[kx] - sx * c_rel[kz], c_rel[ky] - sy * c_rel[kz]);

    // On which side of each edge does the ray pass? Two rounded products, never fused: swapping the ends of an edge
    // must flip the sign exactly.
    let weight_a = cx * by - cy * bx;
    let weight_b = ax * cy - ay * cx;
    let weight_c = bx * ay - by * ax;
    let inside_front = weight_a >= 0.0 && weight_b >= 0.0 && weight_c >= 0.0;
    let inside_back = weight_a <= 0.0 && weight_b <= 0.0 && weight_c <= 0.0;
    if !(inside_front || inside_back) {
        return None;
    }
    let determinant = weight_a + weight_b + weight_c;
    if determinant == 0.0 {
        return None;
    }

    // The distance is the weighted mean of the vertices' distances along the ray.
    let scaled_t = weight_a * (sz * a_rel[kz]) + weight_b * (sz * b_rel[kz]) + weight_c * (sz * c_rel[kz]);
    let t = scaled_t / determinant;

    // Keep t where the ray crosses the triangle's box, then where it crosses the instance's.
    let own = Bounds::of([a, b, c]).interval(ray, f32::NEG_INFINITY, f32::INFINITY);
    if own.is_empty() {
        return None;
    }
    let t = ray.clip.clamp(own.clamp(t)) + 0.0; // + 0 turns -0 into 0
    if !(t >= ray.t_min && t <= ray.t_max && t < f32::INFINITY) {
        return None;
    }
    Some(TriangleHit { t, u: weight_b / determinant, v: weight_c / determinant })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::Ray;

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
}
