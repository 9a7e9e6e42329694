//! The watertight triangle test in the renderer's form, as published, and with other arithmetic for its edge functions.
//!
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013.

use glam::Vec3;

use super::TriangleTest;
use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, PreparedRay, Ray, TriangleHit, intersect_triangle};

/// The renderer's own: f32 edge functions sort out what is certainly missed, f64 ones decide the rest and give t and the
/// weights; t is clamped into the triangle's box.
pub struct WoopClamped;

impl TriangleTest for WoopClamped {
    const NAME: &'static str = "Woop (ours)";
    type Triangle = [Vec3; 3];
    type Ray = PreparedRay;

    fn new(_: &Bounds) -> Self {
        Self
    }

    fn triangle(&self, corners: [Vec3; 3]) -> [Vec3; 3] {
        corners
    }

    fn ray(&self, ray: &Ray) -> PreparedRay {
        PreparedRay::new(ray).expect("the ray is valid")
    }

    #[inline(always)]
    fn intersect(ray: &PreparedRay, &[a, b, c]: &[Vec3; 3]) -> Option<TriangleHit> {
        intersect_triangle(ray, a, b, c)
    }
}

/// A way to find `a b - c d` for f32 numbers.
pub trait EdgeFunction: Send + Sync {
    /// What the triangle test with it is called in reports.
    const NAME: &'static str;
    /// Whether t is clamped into the triangle's box, as the renderer does.
    const CLAMPED: bool;
    /// Three edge functions of sheared corners, each given as (a, b, c, d).
    fn evaluate(edges: [[f32; 4]; 3]) -> [f32; 3];
}

/// As published: f32, and f64 where one of the three is 0; nothing is clamped.
pub struct Published;

impl EdgeFunction for Published {
    const NAME: &'static str = "Woop 2013";
    const CLAMPED: bool = false;

    #[inline(always)]
    fn evaluate(edges: [[f32; 4]; 3]) -> [f32; 3] {
        let found = edges.map(|[a, b, c, d]| a * b - c * d);
        if found.contains(&0.0) { Wide::evaluate(edges) } else { found }
    }
}

/// In f32 alone, clamped: what remains of the published test without its second look. Where all three are rounded to 0, on
/// slivers, a hit is lost.
pub struct Narrow;

impl EdgeFunction for Narrow {
    const NAME: &'static str = "Woop f32 edges";
    const CLAMPED: bool = true;

    #[inline(always)]
    fn evaluate(edges: [[f32; 4]; 3]) -> [f32; 3] {
        edges.map(|[a, b, c, d]| a * b - c * d)
    }
}

/// In f64, where products of f32 numbers are exact, from the start; rounded to f32 afterwards, as t and the weights are.
pub struct Wide;

impl EdgeFunction for Wide {
    const NAME: &'static str = "Woop f64 edges";
    const CLAMPED: bool = true;

    #[inline(always)]
    fn evaluate(edges: [[f32; 4]; 3]) -> [f32; 3] {
        edges.map(|edge| {
            let [a, b, c, d] = edge.map(f64::from);
            (a * b - c * d) as f32
        })
    }
}

/// Kahan's difference of products, the rounding errors of the products found by Dekker's splitting in f32.
pub struct Kahan;

impl EdgeFunction for Kahan {
    const NAME: &'static str = "Woop Kahan";
    const CLAMPED: bool = true;

    #[inline(always)]
    fn evaluate(edges: [[f32; 4]; 3]) -> [f32; 3] {
        edges.map(|[a, b, c, d]| {
            let (ab, ab_error) = two_product_f32(a, b);
            let (cd, cd_error) = two_product_f32(c, d);
            (ab - cd) + (ab_error - cd_error)
        })
    }
}

/// `a b` as `product + error`, exact unless something over- or underflows (Dekker 1971).
#[inline(always)]
fn two_product_f32(a: f32, b: f32) -> (f32, f32) {
    #[inline(always)]
    fn split(x: f32) -> (f32, f32) {
        const SPLITTER: f32 = (1 << 12) as f32 + 1.0;
        let scaled = SPLITTER * x;
        let high = scaled - (scaled - x);
        (high, x - high)
    }
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    (product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low)
}

/// The test with another edge function.
pub struct Woop<E>(std::marker::PhantomData<E>);

impl<E: EdgeFunction> TriangleTest for Woop<E> {
    const NAME: &'static str = E::NAME;
    type Triangle = [Vec3; 3];
    type Ray = PreparedRay;

    fn new(_: &Bounds) -> Self {
        Self(std::marker::PhantomData)
    }

    fn triangle(&self, corners: [Vec3; 3]) -> [Vec3; 3] {
        corners
    }

    fn ray(&self, ray: &Ray) -> PreparedRay {
        PreparedRay::new(ray).expect("the ray is valid")
    }

    #[inline(always)]
    fn intersect(ray: &PreparedRay, corners: &[Vec3; 3]) -> Option<TriangleHit> {
        let [kx, ky, kz] = ray.axes;
        let (sx, sy, sz) = (ray.shear.x, ray.shear.y, ray.shear.z);
        let relative = corners.map(|p| (p - Vec3::from(ray.origin)).to_array());
        let [[ax, ay], [bx, by], [cx, cy]] = relative.map(|p| [p[kx] - sx * p[kz], p[ky] - sy * p[kz]]);

        let [u, v, w] = E::evaluate([[cx, by, cy, bx], [ax, cy, ay, cx], [bx, ay, by, ax]]);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let [az, bz, cz] = relative.map(|p| sz * p[kz]);
        let mut t = (u * az + v * bz + w * cz) / determinant;
        if E::CLAMPED {
            let own = hit_bounds(*corners).interval(ray, f32::NEG_INFINITY, f32::INFINITY);
            if own.is_empty() {
                return None;
            }
            t = own.clamp(t);
        }
        let in_range = t >= ray.t_min && t <= ray.t_max && t < f32::INFINITY;
        in_range.then_some(TriangleHit { t, u: v / determinant, v: w / determinant })
    }
}
