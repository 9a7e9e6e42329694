//! The triangle test that most programs use.
//!
//! Möller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", Journal of Graphics Tools 1997, with edges
//! stored beside the first corner. Deviation: the paper's threshold on the determinant is 0. Each triangle computes the
//! edge functions of its own two edges, so that neighbours round differently: rays pass between them.

use glam::{DVec3, Vec3};

use super::{TriangleTest, counts};
use crate::geometry::{Bounds, Ray, TriangleHit};
use crate::math::vector::{cross, dot, dot_f32};

/// In f32 throughout.
pub struct MollerTrumbore;

/// A corner and the edges that leave it.
#[derive(Debug, Clone, Copy)]
pub struct Edges {
    corner: Vec3,
    to_b: Vec3,
    to_c: Vec3,
}

impl TriangleTest for MollerTrumbore {
    const NAME: &'static str = "Möller-Trumbore";
    type Triangle = Edges;
    type Ray = Ray;

    fn new(_: &Bounds) -> Self {
        Self
    }

    fn triangle(&self, [a, b, c]: [Vec3; 3]) -> Edges {
        Edges { corner: a, to_b: b - a, to_c: c - a }
    }

    fn ray(&self, ray: &Ray) -> Ray {
        *ray
    }

    #[inline(always)]
    fn intersect(ray: &Ray, triangle: &Edges) -> Option<TriangleHit> {
        let Edges { corner, to_b, to_c } = *triangle;
        let p = cross_f32(ray.direction, to_c);
        let determinant = dot_f32(to_b, p);
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let from_corner = ray.origin - corner;
        let u = dot_f32(from_corner, p) * inverse;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = cross_f32(from_corner, to_b);
        let v = dot_f32(ray.direction, q) * inverse;
        if !(v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        let t = dot_f32(to_c, q) * inverse;
        counts(ray, t).then_some(TriangleHit { t, u, v })
    }
}

/// Cross product, f32, every product rounded.
#[inline(always)]
pub(super) fn cross_f32(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// The same in f64 from the f32 ray and corners; the hit is rounded at the end.
pub struct MollerTrumboreF64;

/// A ray in f64, and its interval.
#[derive(Debug, Clone, Copy)]
pub struct WideRay {
    origin: DVec3,
    direction: DVec3,
    ray: Ray,
}

impl TriangleTest for MollerTrumboreF64 {
    const NAME: &'static str = "Möller-Trumbore f64";
    type Triangle = [DVec3; 3];
    type Ray = WideRay;

    fn new(_: &Bounds) -> Self {
        Self
    }

    fn triangle(&self, corners: [Vec3; 3]) -> [DVec3; 3] {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        [a, b - a, c - a]
    }

    fn ray(&self, ray: &Ray) -> WideRay {
        WideRay { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3(), ray: *ray }
    }

    #[inline(always)]
    fn intersect(ray: &WideRay, triangle: &[DVec3; 3]) -> Option<TriangleHit> {
        let [corner, to_b, to_c] = *triangle;
        let p = cross(ray.direction, to_c);
        let determinant = dot(to_b, p);
        if determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let from_corner = ray.origin - corner;
        let u = dot(from_corner, p) * inverse;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = cross(from_corner, to_b);
        let v = dot(ray.direction, q) * inverse;
        if !(v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        let t = (dot(to_c, q) * inverse) as f32;
        counts(&ray.ray, t).then_some(TriangleHit { t, u: u as f32, v: v as f32 })
    }
}
