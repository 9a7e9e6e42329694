//! The watertight ray-triangle test.
//!
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013. Two deviations:
//!
//! - They evaluate edge functions again in f64 where one is exactly 0. Here f32 only sorts out what is certainly missed;
//!   what is left is decided, and its t and weights are computed, from edge functions in f64, where the product of two f32
//!   is exact. Otherwise the weights of a sliver seen at a grazing angle are a few units of rounding, and the hit lies
//!   beside the triangle by as much as it is wide; and numbers beyond 1e12 overflow.
//! - t is clamped into the interval in which the ray crosses the triangle's own f32 box ([`hit_bounds`]), so that no tree can
//!   cull a hit.

use glam::{Vec3, Vec3A};

use crate::geometry::bounds::Bounds;
use crate::geometry::ray::{Interval, PreparedRay};
use crate::math::float::UNIT_ROUNDOFF;

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
    let corners = [a, b, c].map(Vec3A::from);
    let [a_rel, b_rel, c_rel] = corners.map(|p| (p - ray.origin).to_array());
    let sheared = Sheared {
        x: [a_rel, b_rel, c_rel].map(|p| p[kx] - sx * p[kz]),
        y: [a_rel, b_rel, c_rel].map(|p| p[ky] - sy * p[kz]),
        z: [a_rel, b_rel, c_rel].map(|p| p[kz]),
    };

    // On which side of each edge does the ray pass? Two rounded products, never fused. Rounding is monotone: a sign may
    // become 0, never the opposite, so that triangles with both signs are missed. NaN, after an overflow, decides nothing.
    let ([ax, bx, cx], [ay, by, cy]) = (sheared.x, sheared.y);
    let weight_a = cx * by - cy * bx;
    let weight_b = ax * cy - ay * cx;
    let weight_c = bx * ay - by * ax;
    if both_signs(weight_a, weight_b, weight_c) {
        return None;
    }
    decide(ray, corners, &sheared)
}

/// The corners A, B and C of a triangle where the ray's origin is zero and the ray runs along z; `z` is not sheared, but
/// along the ray's largest axis.
#[derive(Debug, Clone, Copy)]
pub struct Sheared {
    /// Beside the ray.
    pub x: [f32; 3],
    /// Beside the ray.
    pub y: [f32; 3],
    /// Along the ray's largest axis.
    pub z: [f32; 3],
}

/// What follows the signs in f32, for triangles that these do not sort out; those that they do this sorts out as well.
#[inline(always)]
pub fn decide(ray: &PreparedRay, corners: [Vec3A; 3], sheared: &Sheared) -> Option<TriangleHit> {
    // The edge functions without rounding in the products. Each sign is that of the exact edge function, so that swapping
    // the ends of an edge flips it: what lies on one side of an edge for one triangle lies on the other for its neighbour.
    let ([ax, bx, cx], [ay, by, cy]) = (sheared.x.map(f64::from), sheared.y.map(f64::from));
    let weight_a = cx * by - cy * bx;
    let weight_b = ax * cy - ay * cx;
    let weight_c = bx * ay - by * ax;
    let least = lesser(lesser(weight_a, weight_b), weight_c);
    let most = greater(greater(weight_a, weight_b), weight_c);
    let determinant = weight_a + weight_b + weight_c;
    if ((least < 0.0) & (most > 0.0)) | !((determinant != 0.0) & (determinant.abs() < f64::INFINITY)) {
        return None;
    }

    // The distance is the weighted mean of the vertices' distances along the ray.
    let [az, bz, cz] = sheared.z.map(f64::from);
    let along = f64::from(ray.direction[ray.axes[2]]);
    let t = ((weight_a * az + weight_b * bz + weight_c * cz) / (determinant * along)) as f32;

    // Keep t where the ray crosses the triangle's box, then where it crosses the instance's.
    let [min, max] = hit_corners(corners);
    let own = interval(ray, min, max);
    if own.is_empty() {
        return None;
    }
    let t = ray.clip.clamp(own.clamp(t)) + 0.0; // + 0 turns -0 into 0
    if !(t >= ray.t_min && t <= ray.t_max && t < f32::INFINITY) {
        return None;
    }
    let share = |weight: f64| (weight / determinant) as f32 + 0.0;
    Some(TriangleHit { t, u: share(weight_b), v: share(weight_c) })
}

/// [`Bounds::interval`] of the whole ray, axes side by side; zeros may have another sign.
#[inline(always)]
fn interval(ray: &PreparedRay, min: Vec3A, max: Vec3A) -> Interval {
    // By the sign bit: -0 counts as negative.
    let negative = Vec3A::ONE.copysign(ray.direction).cmplt(Vec3A::ZERO);
    let entry = (Vec3A::select(negative, max, min) - ray.origin) * ray.inverse;
    let exit = (Vec3A::select(negative, min, max) - ray.origin) * ray.inverse_far;
    Interval {
        near: entry.to_array().into_iter().fold(f32::NEG_INFINITY, |near, t| greater(t, near)),
        far: exit.to_array().into_iter().fold(f32::INFINITY, |far, t| lesser(t, far)),
    }
}

/// a if it is greater, else b: b where either is NaN.
#[inline(always)]
fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// a if it is less, else b: b where either is NaN.
#[inline(always)]
fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The box in which the test looks for hits on a triangle: its own, made larger along axes along which it is not flat by
/// 2^-21 of its largest extent. Every box around the triangle must hold this one.
///
/// Let E be the largest extent and `w` weights with which the rounded sheared corners average to 0, as they do wherever the
/// edge functions say hit. A corner's `x - s z` is rounded by u times itself and by u |s z|, and the average of what is
/// rounded is 0, so that the averages of x and z obey `x = s z (1 + 2 u) + h` with `|h| <= u (e_x + 3 s e_z) <= 4 u E`: off by
/// something that does not shrink with t where corners lie before and behind the ray's origin, as those of a large triangle
/// beside the ray do. Enlarged by 8 u E = 2^-21 E the box holds the average of the corners as the box test sees it, up to
/// errors relative to t, which are the padding's. An axis along which the triangle is flat has `|h| <= 3 u s e_z`, in t no
/// more than the other axes were enlarged by, and stays flat: axis-aligned walls keep their exact place.
#[inline(always)]
pub fn hit_bounds(corners: [Vec3; 3]) -> Bounds {
    let [min, max] = hit_corners(corners.map(Vec3A::from));
    Bounds { min: min.into(), max: max.into() }
}

/// The same number by number, for loops that become vectors.
#[inline(always)]
pub fn hit_bounds_by_number([a, b, c]: [Vec3; 3]) -> Bounds {
    let lesser = |a: f32, b: f32| if a < b { a } else { b };
    let greater = |a: f32, b: f32| if a > b { a } else { b };
    let by_axis = |of: fn(Vec3) -> f32| {
        let (a, b, c) = (of(a), of(b), of(c));
        (lesser(lesser(a, b), c), greater(greater(a, b), c))
    };
    let ((min_x, max_x), (min_y, max_y), (min_z, max_z)) = (by_axis(|v| v.x), by_axis(|v| v.y), by_axis(|v| v.z));
    let (x, y, z) = (max_x - min_x, max_y - min_y, max_z - min_z);
    let margin = greater(z, greater(x, y)) * MARGIN + LEAST_MARGIN;
    let grown = |min: f32, max: f32, extent: f32| {
        let (lower, upper) = (min - (margin + min.abs() * STEP), max + (margin + max.abs() * STEP));
        if extent == 0.0 { (min, max) } else { (lower, upper) }
    };
    let (x, y, z) = (grown(min_x, max_x, x), grown(min_y, max_y, y), grown(min_z, max_z, z));
    Bounds { min: Vec3::new(x.0, y.0, z.0), max: Vec3::new(x.1, y.1, z.1) }
}

/// What the boxes of hits are enlarged by, in parts of the largest extent. Rounding of the sum is at most u of the coordinate: [`STEP`] of
/// it beside the margin cover that and, where the margin is finer than the coordinates, make a step. The least numbers stand in for both
/// where they underflow.
const MARGIN: f32 = 8.0 * UNIT_ROUNDOFF as f32;
const LEAST_MARGIN: f32 = f32::from_bits(8);
const STEP: f32 = 1.5 * UNIT_ROUNDOFF as f32;

#[inline(always)]
fn hit_corners([a, b, c]: [Vec3A; 3]) -> [Vec3A; 2] {
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let extent = max - min;
    let largest = if extent.x > extent.y { extent.x } else { extent.y };
    let largest = if extent.z > largest { extent.z } else { largest };
    let margin = Vec3A::splat(largest * MARGIN + LEAST_MARGIN);
    let step = Vec3A::splat(STEP);
    let flat = extent.cmpeq(Vec3A::ZERO);
    [
        Vec3A::select(flat, min, min - (margin + min.abs() * step)),
        Vec3A::select(flat, max, max + (margin + max.abs() * step)),
    ]
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
    fn boxes_of_hits_are_the_same_number_by_number() {
        use crate::math::random::Random;
        let mut random = Random::new(5, 0x7219);
        for number in 0..20_000 {
            let scale = libm::exp2(random.between(-140.0, 60.0)) as f32;
            let mut corners = [(); 3].map(|()| random.in_cube().as_vec3() * scale);
            match number % 5 {
                0 => corners[1][number % 3] = corners[0][number % 3],
                1 => corners.iter_mut().for_each(|corner| corner[number % 3] = scale),
                2 => corners.iter_mut().for_each(|corner| corner[number % 3] += 1e3),
                _ => {}
            }
            let (one, other) = (hit_bounds(corners), hit_bounds_by_number(corners));
            assert_eq!((one.min, one.max), (other.min, other.max), "{corners:?}");
        }
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
    fn a_shared_edge_is_hit_where_both_its_planes_are_sheared() {
        // The ray passes the edge within rounding: one triangle is passed by, and the other's box must not be.
        let hex = |bits: u32, exponent: i32| libm::ldexpf(bits as f32, exponent - 24);
        let direction = Vec3::new(hex(0x1ff_d242, -2), hex(0x100_194a, -2), hex(0x1fa_f268, 0));
        let (x, y) = (hex(0x145_8a6e, -2), hex(0x145_c7ae, -3));
        let (low, high) = (Vec3::new(x, y, hex(0x10f_3d88, 0)), Vec3::new(x, y, hex(0x114_6b90, 1)));
        let thirds = [
            Vec3::new(hex(0x13c_5ed0, -1), -hex(0x120_9eba, -3), hex(0x142_70bc, 0)),
            Vec3::new(hex(0x125_73a0, -6), hex(0x1d6_170c, -2), hex(0x142_70bc, 0)),
        ];
        let ray = PreparedRay::new(&Ray::new(Vec3::ZERO, direction)).unwrap();
        assert!(thirds.iter().any(|&third| intersect_triangle(&ray, low, high, third).is_some()));
    }

    #[test]
    fn boxes_grow_where_triangles_are_not_flat() {
        let flat = hit_bounds([A, B, C]);
        assert_eq!((flat.min.z, flat.max.z), (2.0, 2.0));
        let margin = 8.0 * UNIT_ROUNDOFF as f32;
        assert!(flat.min.x <= -margin && flat.min.x > -1.01 * margin);
        assert!(flat.max.y > 1.0 && flat.max.y < 1.0 + 2.0 * margin);
        // Far from zero a margin finer than the coordinates is a step of them.
        let far = hit_bounds([A, B, C].map(|p| p + Vec3::X * 1e6));
        assert_eq!((far.min.x, far.max.x), (1e6f32.next_down(), (1e6f32 + 1.0).next_up()));
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
