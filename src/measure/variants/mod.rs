//! Other ways to do what the renderer does, from their publications: what its choices are compared with.
//!
//! Nothing here is on the renderer's path. Each variant is an honest implementation of its paper: on rays that keep
//! away from edges all of them agree, and each has a test that shows what it is known to get wrong.
//!
//! | module | choice |
//! |---|---|
//! | [`moller_trumbore`], [`baldwin_weber`], [`woop`] | triangle test |
//! | [`slab`] | box test |
//! | [`tree`] | one plain binary tree and traversal that takes any of both |
//! | [`spawn`] | where a ray that leaves a surface starts |
//! | [`sphere`] | the quadratic of a ray and a sphere |

pub mod baldwin_weber;
pub mod moller_trumbore;
pub mod slab;
pub mod spawn;
pub mod sphere;
pub mod tree;
pub mod woop;

use glam::Vec3;

use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, Ray, TriangleHit};

/// A way to intersect a ray with a triangle: what is stored per triangle, what is computed per ray, and the test.
///
/// A hit's t lies within the ray's `[max(t_min, 0), t_max]`; both sides count; NaN means a miss.
pub trait TriangleTest: Send + Sync + Sized {
    /// What it is called in reports.
    const NAME: &'static str;

    /// A triangle as the test wants it.
    type Triangle: Copy + Send + Sync;

    /// A valid ray as the test wants it.
    type Ray: Copy;

    /// The test for triangles that lie within `bounds`.
    fn new(bounds: &Bounds) -> Self;

    /// Brings a triangle into the form that is tested.
    fn triangle(&self, corners: [Vec3; 3]) -> Self::Triangle;

    /// Prepares a valid ray.
    fn ray(&self, ray: &Ray) -> Self::Ray;

    /// The hit, if any.
    fn intersect(ray: &Self::Ray, triangle: &Self::Triangle) -> Option<TriangleHit>;
}

/// A way to intersect a ray with a box.
pub trait BoxTest: Send + Sync {
    /// What it is called in reports.
    const NAME: &'static str;

    /// Whether the boxes are those around what the renderer's triangle test may find
    /// ([`hit_bounds`](crate::geometry::triangle::hit_bounds)), not those of the corners.
    const ENLARGED: bool;

    /// A valid ray as the test wants it.
    type Ray: Copy;

    /// Prepares a valid ray.
    fn ray(ray: &Ray) -> Self::Ray;

    /// The part of the ray inside a box, cut to `[near, far]`.
    fn interval(ray: &Self::Ray, bounds: &Bounds, near: f32, far: f32) -> Interval;
}

/// Whether a ray parameter counts; NaN does not.
#[inline(always)]
fn counts(ray: &Ray, t: f32) -> bool {
    t >= ray.t_min && t >= 0.0 && t <= ray.t_max && t < f32::INFINITY
}

#[cfg(test)]
mod tests;
