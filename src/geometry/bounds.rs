//! Axis-aligned boxes in f32 and the one formula by which a ray crosses them.

use glam::{DVec3, Vec3};

use crate::geometry::ray::{Interval, PreparedRay};
use crate::math::float::{gamma, round_down_vec, round_up_vec};
use crate::math::transform::Transform;

/// A closed axis-aligned box. The empty box has `min > max`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bounds {
    /// The least corner.
    pub min: Vec3,
    /// The greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The box around nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around finite points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, p| bounds.with(p))
    }

    /// The smallest box around this one and a point.
    #[inline(always)]
    pub fn with(self, p: Vec3) -> Self {
        Self { min: lesser(self.min, p), max: greater(self.max, p) }
    }

    /// The smallest box around both.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self { min: lesser(self.min, other.min), max: greater(self.max, other.max) }
    }

    /// Whether nothing is inside.
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Whether `other` lies inside, boundaries included.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }

    /// Edge lengths, in f64 so that they cannot overflow; zero if empty.
    pub fn size(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { self.max.as_dvec3() - self.min.as_dvec3() }
    }

    /// The middle, in f64; the origin if empty.
    pub fn center(&self) -> DVec3 {
        if self.is_empty() { DVec3::ZERO } else { 0.5 * (self.max.as_dvec3() + self.min.as_dvec3()) }
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { self.max[axis] } else { self.min[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// A box in world space around everything in this object-space box, rounded outward.
    ///
    /// It allows for the rounding of the transform: 3 gamma of the magnitudes summed (Pharr et al. 2023, 6.8.6). A ray
    /// that is brought into object space is rounded as well, by up to an ulp of its own origin there; a hit which that
    /// moves out of the box is clamped back into it.
    pub fn to_world(&self, transform: &Transform) -> Self {
        if self.is_empty() || transform.is_identity() {
            return *self;
        }
        let m = transform.to_world();
        let columns = m.matrix3;
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in self.corners() {
            let c = corner.as_dvec3();
            let p = transform.point_to_world(c);
            let magnitude = columns.x_axis.abs() * c.x.abs()
                + columns.y_axis.abs() * c.y.abs()
                + columns.z_axis.abs() * c.z.abs()
                + m.translation.abs();
            let pad = magnitude * gamma(3);
            min = min.min(p - pad);
            max = max.max(p + pad);
        }
        Self { min: round_down_vec(min), max: round_up_vec(max) }
    }

    /// The part of `ray` inside this box, cut to `[near, far]`.
    ///
    /// Per axis the planes are crossed at `(b - o) * inverse`, the far one with the inverse padded by some ulp, without
    /// fused operations. Both are monotone in `b`: rounding is monotone, and so is multiplication by a fixed number.
    /// Hence a box that contains another is entered no later and left no earlier, **bit for bit**, and a search that
    /// skips boxes entered after its best hit can neither lose nor reorder a hit that lies within its own box's
    /// interval. The comparisons keep the running bound where a product is NaN (0 times infinity: the ray runs
    /// within the plane), which is what makes axis-parallel rays along faces hit.
    #[inline(always)]
    pub fn interval(&self, ray: &PreparedRay, near: f32, far: f32) -> Interval {
        let (mut near, mut far) = (near, far);
        for axis in 0..3 {
            let (entry, exit) =
                if ray.is_negative(axis) { (self.max[axis], self.min[axis]) } else { (self.min[axis], self.max[axis]) };
            let t_entry = (entry - ray.origin[axis]) * ray.inverse[axis];
            let t_exit = (exit - ray.origin[axis]) * ray.inverse_far[axis];
            near = if t_entry > near { t_entry } else { near };
            far = if t_exit < far { t_exit } else { far };
        }
        Interval { near, far }
    }
}

#[inline(always)]
fn lesser(a: Vec3, b: Vec3) -> Vec3 {
    let pick = |a: f32, b: f32| if b < a { b } else { a };
    Vec3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
}

#[inline(always)]
fn greater(a: Vec3, b: Vec3) -> Vec3 {
    let pick = |a: f32, b: f32| if b > a { b } else { a };
    Vec3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::Ray;

    fn interval(bounds: &Bounds, origin: Vec3, direction: Vec3) -> Interval {
        let ray = PreparedRay::new(&Ray::new(origin, direction)).unwrap();
        bounds.interval(&ray, 0.0, f32::INFINITY)
    }

    #[test]
    fn rays_within_a_face_cross_the_box() {
        let unit = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        for zero in [0.0, -0.0] {
            let along = interval(&unit, Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, zero, zero));
            assert_eq!(along.near, 1.0);
            assert!(!along.is_empty());
            let beside = interval(&unit, Vec3::new(-1.0, 1.0f32.next_up(), 0.5), Vec3::new(1.0, zero, zero));
            assert!(beside.is_empty());
        }
    }

    #[test]
    fn a_flat_box_is_crossed_at_its_plane() {
        let flat = Bounds { min: Vec3::new(0.0, 0.0, 0.3), max: Vec3::new(1.0, 1.0, 0.3) };
        let hit = interval(&flat, Vec3::new(0.5, 0.5, -1.0), Vec3::new(0.1, 0.0, 1.0));
        assert!(!hit.is_empty() && (hit.near - 1.3).abs() < 1e-6);
    }
}
