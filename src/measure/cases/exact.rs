//! What answers are held against where only exact arithmetic knows, and how far off an answer may be.

use glam::{DVec3, Vec3};

use crate::geometry::{Hit, Ray};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::vector::{cross, dot, length, normalize};
use crate::measure::oracle::Oracle;
use crate::measure::oracle::triangle::{distance, meet_line};

/// How far a ray may pass from a triangle that it is said to hit, in parts of the distance of the farthest vertex from the
/// ray's origin: 8 u.
pub const TIGHTNESS: f64 = 8.0 * UNIT_ROUNDOFF;

/// How far a hit may be from where it is, as [`t_error`] counts.
pub const T_TIGHTNESS: f64 = 4.0;

/// The largest distance of a vertex from the ray's origin, at least the least normal number: f32 tells no points apart that
/// are nearer than u times that.
pub fn reach(ray: &Ray, corners: [Vec3; 3]) -> f64 {
    let least = f64::from(f32::MIN_POSITIVE);
    corners.map(|p| length(p.as_dvec3() - ray.origin.as_dvec3())).into_iter().fold(least, f64::max)
}

/// The distance of a ray's line from the nearest edge of a triangle, in parts of the [`reach`].
pub fn from_edges(ray: &Ray, [a, b, c]: [Vec3; 3]) -> f64 {
    let nearest = [[a, b], [b, c], [c, a]].map(|edge| distance(ray, edge)).into_iter().fold(f64::INFINITY, f64::min);
    nearest / reach(ray, [a, b, c])
}

/// The distance of a ray's line from a triangle, in parts of the [`reach`]; 0 if they meet.
pub fn apart(ray: &Ray, corners: [Vec3; 3]) -> f64 {
    if meet_line(ray, corners).is_some() { 0.0 } else { from_edges(ray, corners) }
}

/// The error of a t, as a distance across the triangle's plane, in units of u times the [`reach`]: what is left of it at a
/// right angle, since at grazing angles a rounded vertex alone moves t by more.
pub fn t_error(ray: &Ray, corners: [Vec3; 3], t: f32, exact: f64) -> f64 {
    let d = ray.direction.as_dvec3();
    let along = dot(d, normal(corners)).abs();
    (f64::from(t) - exact).abs() * along / (UNIT_ROUNDOFF * reach(ray, corners))
}

/// The unit normal of a triangle with area.
pub fn normal(corners: [Vec3; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    normalize(cross(b - a, c - a)).unwrap_or(DVec3::ZERO)
}

/// The distance of a point from a triangle.
pub fn point_to_triangle(p: DVec3, corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|q| q.as_dvec3());
    let n = normal(corners);
    let beside = |from: DVec3, to: DVec3| dot(cross(n, to - from), p - from);
    if beside(a, b) >= 0.0 && beside(b, c) >= 0.0 && beside(c, a) >= 0.0 {
        return dot(n, p - a).abs();
    }
    let to_edge = |from: DVec3, to: DVec3| {
        let edge = to - from;
        let at = (dot(p - from, edge) / dot(edge, edge)).clamp(0.0, 1.0);
        length(p - from - edge * at)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

/// What is wrong with a closest hit on meshes that stand where they are, if anything is: `None` where it is the exact one,
/// or where the ray passes an edge of the exact one within [`TIGHTNESS`], or one of this, in its plane and before the exact
/// one, or begins or ends at one within [`T_TIGHTNESS`].
pub fn objection(oracle: &Oracle, ray: &Ray, hit: &Hit) -> Option<String> {
    let exact = oracle.closest(ray);
    let corners = |instance, primitive| oracle.triangle(instance, primitive).map(|(corners, _)| corners);
    let borderline = |instance, primitive| {
        let Some(corners) = corners(instance, primitive) else { return false };
        let at_an_end =
            |t: f64| [ray.t_min.max(0.0), ray.t_max].iter().any(|&end| t_error(ray, corners, end, t) <= T_TIGHTNESS);
        from_edges(ray, corners) <= TIGHTNESS
            || oracle.on_line(ray, instance, primitive).iter().any(|hit| at_an_end(hit.t.to_f64()))
    };
    match exact {
        None if !hit.is_hit() => None,
        None if borderline(hit.instance, hit.primitive) => None,
        None => Some(format!("triangle {} is hit, exactly there is none", hit.primitive)),
        Some(exact) if (exact.instance, exact.primitive) == (hit.instance, hit.primitive) => None,
        Some(exact) if borderline(exact.instance, exact.primitive) => None,
        Some(exact) if is_in_front(oracle, ray, hit, exact.t.to_f64()) && borderline(hit.instance, hit.primitive) => {
            None
        }
        Some(exact) if hit.is_hit() => {
            // Another triangle may lie as near as rounding can tell: both may be off.
            let (near, here) = (exact.t.to_f64(), f64::from(hit.t));
            let same_t = corners(hit.instance, hit.primitive).is_some_and(|corners| {
                apart(ray, corners) <= TIGHTNESS && t_error(ray, corners, hit.t, near) <= 2.0 * T_TIGHTNESS
            });
            let message = || format!("triangle {} at {here}, exactly {} at {near}", hit.primitive, exact.primitive);
            (!same_t).then(message)
        }
        Some(exact) => Some(format!("no hit, exactly triangle {} at {}", exact.primitive, exact.t.to_f64())),
    }
}

/// Whether a hit lies before a t, and in its triangle's plane within twice [`T_TIGHTNESS`].
fn is_in_front(oracle: &Oracle, ray: &Ray, hit: &Hit, t: f64) -> bool {
    let Some((corners, None)) = oracle.triangle(hit.instance, hit.primitive) else { return false };
    f64::from(hit.t) <= t && off_plane(ray, corners, hit.t) <= 2.0 * T_TIGHTNESS
}

/// The distance of a ray's point from a triangle's plane, in units of u times the [`reach`].
pub fn off_plane(ray: &Ray, corners: [Vec3; 3], t: f32) -> f64 {
    let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(t);
    dot(normal(corners), point - corners[0].as_dvec3()).abs() / (UNIT_ROUNDOFF * reach(ray, corners))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::cases::meshes;

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn distances_are_those_of_closed_forms() {
        let ray = Ray::new(Vec3::new(-0.5, 0.25, 2.0), Vec3::NEG_Z);
        let reach = (1.5f64 * 1.5 + 0.25 * 0.25 + 4.0).sqrt();
        assert!((super::reach(&ray, CORNERS) - reach).abs() < 1e-12);
        assert!((apart(&ray, CORNERS) - 0.5 / reach).abs() < 1e-12);
        let inside = Ray::new(Vec3::new(0.125, 0.25, 2.0), Vec3::NEG_Z);
        assert_eq!(apart(&inside, CORNERS), 0.0);
        assert!((from_edges(&inside, CORNERS) * super::reach(&inside, CORNERS) - 0.125).abs() < 1e-12);
        assert!(
            (t_error(&inside, CORNERS, 2.0, 2.0 + UNIT_ROUNDOFF) - 1.0 / super::reach(&inside, CORNERS)).abs() < 1e-6
        );
        for (p, d) in
            [(DVec3::new(0.2, 0.2, 3.0), 3.0), (DVec3::new(1.0, 1.0, 0.0), 0.5f64.sqrt()), (DVec3::NEG_X, 1.0)]
        {
            assert!((point_to_triangle(p, CORNERS) - d).abs() < 1e-12, "{p}");
        }
    }

    #[test]
    fn wrong_hits_are_objected_to() {
        let scene = meshes::scene(vec![meshes::soup([CORNERS, CORNERS.map(|p| p - Vec3::Z)])]);
        let oracle = Oracle::new(&scene).unwrap();
        let ray = Ray::new(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z);
        let hit = |t, primitive| Hit { t, u: 0.25, v: 0.25, instance: 0, primitive };
        assert_eq!(objection(&oracle, &ray, &hit(2.0, 0)), None);
        assert!(objection(&oracle, &ray, &hit(3.0, 1)).is_some());
        assert!(objection(&oracle, &ray, &Hit::MISS).is_some());
        // From the upper triangle itself, and from an ulp above it, it may be missed.
        for height in [0.0, f32::EPSILON / 8.0] {
            let start = Ray::new(Vec3::new(0.25, 0.25, height), Vec3::NEG_Z);
            assert_eq!(objection(&oracle, &start, &hit(1.0, 1)), None);
        }
        // Past an edge by less than rounding: the upper or the lower, and the lower may not be passed over.
        let wide = [Vec3::new(-9.0, -9.0, -1.0), Vec3::new(9.0, -9.0, -1.0), Vec3::new(0.0, 9.0, -1.0)];
        let scene = meshes::scene(vec![meshes::soup([CORNERS, wide])]);
        let oracle_of_both = Oracle::new(&scene).unwrap();
        let past = Ray::new(Vec3::new(-1e-8, 0.25, 2.0), Vec3::NEG_Z);
        for (hit, fine) in [(hit(2.0, 0), true), (hit(3.0, 1), true), (hit(2.5, 0), false), (Hit::MISS, false)] {
            assert_eq!(objection(&oracle_of_both, &past, &hit).is_none(), fine, "{hit:?}");
        }
        let beside = Ray::new(Vec3::new(-0.25, 0.25, 2.0), Vec3::NEG_Z);
        assert_eq!(objection(&oracle, &beside, &Hit::MISS), None);
        assert!(objection(&oracle, &beside, &hit(2.0, 0)).is_some());
    }
}
