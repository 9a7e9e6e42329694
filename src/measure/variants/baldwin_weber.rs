//! A triangle test that looks up where the ray meets the plane in the triangle's own coordinates.
//!
//! Baldwin and Weber, "Fast Ray-Triangle Intersections by Coordinate Transformation", JCGT 2016: nine numbers a
//! triangle, of which the column of the normal's largest component is fixed. Deviation: corners and ray are taken
//! relative to the middle of the mesh, without which the constants of the transform lose all digits away from the
//! origin. Neighbours have unrelated transforms, so that rays pass between them.

use glam::Vec3;

use super::moller_trumbore::cross_f32;
use super::{TriangleTest, counts};
use crate::geometry::{Bounds, Ray, TriangleHit};
use crate::math::vector::dot_f32;

/// In f32 throughout, relative to the mesh's middle.
pub struct BaldwinWeber {
    center: Vec3,
}

/// The rows that give a point's weight of B, its weight of C, and its height over the plane (scaled).
///
/// `free` is the axis of the normal's largest component: its coefficient is 0, 0 and 1.
#[derive(Debug, Clone, Copy)]
pub struct Rows {
    free: u32,
    /// Per row the coefficients of the two axes after `free`, and the constant.
    rows: [[f32; 3]; 3],
}

impl Rows {
    /// A row's value for the coordinates (free, next, last), the constant times `one`.
    #[inline(always)]
    fn apply(&self, row: usize, [_, y, z]: [f32; 3], one: f32) -> f32 {
        let [cy, cz, constant] = self.rows[row];
        cy * y + cz * z + constant * one
    }
}

/// A vector's components, starting with an axis.
#[inline(always)]
fn turned(v: Vec3, free: u32) -> [f32; 3] {
    match free {
        0 => [v.x, v.y, v.z],
        1 => [v.y, v.z, v.x],
        _ => [v.z, v.x, v.y],
    }
}

impl TriangleTest for BaldwinWeber {
    const NAME: &'static str = "Baldwin-Weber";
    type Triangle = Rows;
    type Ray = Ray;

    fn new(bounds: &Bounds) -> Self {
        Self { center: bounds.center().as_vec3() }
    }

    fn triangle(&self, corners: [Vec3; 3]) -> Rows {
        let [a, b, c] = corners.map(|corner| corner - self.center);
        let (to_b, to_c) = (b - a, c - a);
        let normal = cross_f32(to_b, to_c);
        let size = normal.abs();
        let free = if size.x > size.y && size.x > size.z { 0 } else { if size.y > size.z { 1 } else { 2 } };
        let [_, ay, az] = turned(a, free);
        let [_, by, bz] = turned(to_b, free);
        let [_, cy, cz] = turned(to_c, free);
        let [nx, ny, nz] = turned(normal, free);
        let weight_b = [cz / nx, -cy / nx, (az * cy - ay * cz) / nx];
        let weight_c = [-bz / nx, by / nx, (ay * bz - az * by) / nx];
        let height = [ny / nx, nz / nx, -dot_f32(normal, a) / nx];
        Rows { free, rows: [weight_b, weight_c, height] }
    }

    fn ray(&self, ray: &Ray) -> Ray {
        Ray { origin: ray.origin - self.center, ..*ray }
    }

    #[inline(always)]
    fn intersect(ray: &Ray, triangle: &Rows) -> Option<TriangleHit> {
        let origin = turned(ray.origin, triangle.free);
        let direction = turned(ray.direction, triangle.free);
        let height = origin[0] + triangle.apply(2, origin, 1.0);
        let slope = direction[0] + triangle.apply(2, direction, 0.0);
        let t = -height / slope;
        if !counts(ray, t) {
            return None;
        }
        let point = [0.0, origin[1] + t * direction[1], origin[2] + t * direction[2]];
        let u = triangle.apply(0, point, 1.0);
        let v = triangle.apply(1, point, 1.0);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(TriangleHit { t, u, v })
    }
}
