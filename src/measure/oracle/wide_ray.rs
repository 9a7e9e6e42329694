//! Rays in f64.

use glam::DVec3;

use crate::geometry::Ray;

/// A ray in f64: the points `origin + t direction` for t in the closed interval `[t_min, t_max]`, relative to the scene's
/// origin. What [`Ray`] says of directions, intervals and bad rays holds here too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WideRay {
    /// Where the ray starts.
    pub origin: DVec3,
    /// Where it goes, of any length.
    pub direction: DVec3,
    /// The smallest t that counts; what is negative counts as 0.
    pub t_min: f64,
    /// The largest t that counts; may be infinite.
    pub t_max: f64,
}

impl WideRay {
    /// The ray with t from 0 to infinity.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    }

    /// Whether the ray can meet anything at all.
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != DVec3::ZERO
            && self.t_min <= self.t_max
            && self.t_max >= 0.0
    }

    /// The ends of the interval, of which what is negative does not count.
    pub(super) fn interval(&self) -> (f64, f64) {
        (self.t_min.max(0.0), self.t_max)
    }
}

impl From<&Ray> for WideRay {
    /// The same ray: f32 convert without loss.
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.as_dvec3(),
            direction: ray.direction.as_dvec3(),
            t_min: ray.t_min.into(),
            t_max: ray.t_max.into(),
        }
    }
}

impl From<&Self> for WideRay {
    fn from(ray: &Self) -> Self {
        *ray
    }
}
