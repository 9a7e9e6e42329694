//! Box tests: the textbook's, Ize's, and the renderer's.

use glam::Vec3;

use super::BoxTest;
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, PreparedRay, Ray};

/// Kay and Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986, as it is usually written (Williams et al. 2005): both
/// planes of an axis are crossed at `(b - o) / d`, nothing is padded. Rounding may put the exit before the entry, so
/// that a ray through a flat box or along a box's edge misses it.
pub struct Plain;

/// What the plain test needs of a ray.
#[derive(Debug, Clone, Copy)]
pub struct PlainRay {
    origin: Vec3,
    inverse: Vec3,
}

impl BoxTest for Plain {
    const NAME: &'static str = "plain";
    const ENLARGED: bool = false;
    type Ray = PlainRay;

    fn ray(ray: &Ray) -> PlainRay {
        PlainRay { origin: ray.origin, inverse: Vec3::ONE / ray.direction }
    }

    #[inline(always)]
    fn interval(ray: &PlainRay, bounds: &Bounds, near: f32, far: f32) -> Interval {
        let (mut near, mut far) = (near, far);
        for axis in 0..3 {
            let lower = (bounds.min[axis] - ray.origin[axis]) * ray.inverse[axis];
            let upper = (bounds.max[axis] - ray.origin[axis]) * ray.inverse[axis];
            // `min` and `max` of std give the other number for NaN.
            near = near.max(lower.min(upper));
            far = far.min(lower.max(upper));
        }
        Interval { near, far }
    }
}

/// Ize, "Robust BVH Ray Traversal", JCGT 2013: far planes are crossed with the inverse made 2 ulp larger, which covers
/// what the box test itself rounds. What the triangle test rounds is not considered.
pub struct Ize;

impl BoxTest for Ize {
    const NAME: &'static str = "padded (Ize 2013)";
    const ENLARGED: bool = false;
    type Ray = PreparedRay;

    fn ray(ray: &Ray) -> PreparedRay {
        let prepared = PreparedRay::new(ray).expect("the ray is valid");
        let inverse_far = prepared.inverse.to_array().map(two_ulp_farther);
        PreparedRay { inverse_far: inverse_far.into(), ..prepared }
    }

    #[inline(always)]
    fn interval(ray: &PreparedRay, bounds: &Bounds, near: f32, far: f32) -> Interval {
        bounds.interval(ray, near, far)
    }
}

/// The value 2 ulp farther from zero; infinities stay.
fn two_ulp_farther(x: f32) -> f32 {
    if x > 0.0 { x.next_up().next_up() } else { x.next_down().next_down() }
}

/// The renderer's: Ize's with more ulp, for what the triangle test rounds as well ([`Bounds::interval`]), around
/// triangles whose boxes are [enlarged](crate::geometry::triangle::hit_bounds).
pub struct Padded;

impl BoxTest for Padded {
    const NAME: &'static str = "padded (ours)";
    const ENLARGED: bool = true;
    type Ray = PreparedRay;

    fn ray(ray: &Ray) -> PreparedRay {
        PreparedRay::new(ray).expect("the ray is valid")
    }

    #[inline(always)]
    fn interval(ray: &PreparedRay, bounds: &Bounds, near: f32, far: f32) -> Interval {
        bounds.interval(ray, near, far)
    }
}
