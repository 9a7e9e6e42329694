//! Rays, and what is computed once per ray before it meets boxes and triangles.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec3A, Vec4};

/// A ray: the points `origin + t direction` for t in the closed interval `[t_min, t_max]`.
///
/// The direction need not have unit length; t is in its units. A negative `t_min` counts as 0: a ray starts at its
/// origin. A ray with a NaN anywhere, an infinite origin or direction, a zero direction, or `t_min > t_max` meets
/// nothing. A ray with a component of its direction that is not 0 and smaller than 2^-126, of which f32 has no reciprocal,
/// may miss what lies in its way. The layout is that of ray files: eight little-endian f32.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where the ray starts.
    pub origin: Vec3,
    /// The smallest t that counts.
    pub t_min: f32,
    /// Where the ray goes, of any length.
    pub direction: Vec3,
    /// The largest t that counts; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// The ray from `origin` along `direction` with t from 0 to infinity.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// Whether the ray can meet anything at all; see the type.
    #[inline(always)]
    pub fn is_valid(&self) -> bool {
        let [start, way] = self.halves();
        let finite = |v: Vec4| v.abs().cmple(Vec4::splat(f32::MAX)).bitmask();
        let nonzero = way.cmpne(Vec4::ZERO).bitmask() & 7;
        (finite(start) & finite(way) & 7 == 7) & (nonzero != 0) & (self.t_min <= self.t_max) & (self.t_max >= 0.0)
    }

    /// Origin and `t_min`, direction and `t_max`, as they lie in memory.
    #[inline(always)]
    fn halves(&self) -> [Vec4; 2] {
        bytemuck::cast(*self)
    }
}

/// The part of a ray inside something, as the ends of an interval of t; empty if `near > far`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Interval {
    /// Where the ray enters.
    pub near: f32,
    /// Where it leaves.
    pub far: f32,
}

impl Interval {
    /// All of t.
    pub const ALL: Self = Self { near: f32::NEG_INFINITY, far: f32::INFINITY };

    /// Whether nothing lies inside. NaN counts as empty.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        !(self.near <= self.far)
    }

    /// `t` moved into the interval, which must not be empty.
    #[inline(always)]
    pub fn clamp(&self, t: f32) -> f32 {
        let t = if t > self.near { t } else { self.near };
        if t < self.far { t } else { self.far }
    }
}

/// A valid ray with everything that boxes and triangles need of it, in the space of what it will meet.
#[derive(Debug, Clone, Copy)]
pub struct PreparedRay {
    /// Where the ray starts.
    pub origin: Vec3A,
    /// Where it goes.
    pub direction: Vec3A,
    /// 1 / direction per axis, not clamped: infinite, with the sign of the zero, where the direction is 0.
    pub inverse: Vec3A,
    /// `inverse` made [`PADDING`] ulp larger in magnitude, for the far planes of boxes.
    pub inverse_far: Vec3A,
    /// Woop's shear: `d[axes[0]] / d[axes[2]]`, `d[axes[1]] / d[axes[2]]`, `1 / d[axes[2]]`.
    pub shear: Vec3A,
    /// Woop's axis order: `axes[2]` is the direction's largest component.
    pub axes: [usize; 3],
    /// A bit an axis: whether the direction's sign bit is set. Then a box is entered through its upper plane.
    pub signs: u32,
    /// The smallest t that counts, at least 0.
    pub t_min: f32,
    /// The largest t that counts.
    pub t_max: f32,
    /// The ray's part inside the world box of the instance it was made for: every t is clamped into it. All of t in
    /// world space.
    pub clip: Interval,
}

impl PreparedRay {
    /// Prepares a ray in world space; `None` if it can meet nothing.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<Self> {
        let [origin, direction] = ray.halves().map(Vec3A::from_vec4);
        ray.is_valid().then(|| Self::with_clip(origin, direction, ray.t_min, ray.t_max, Interval::ALL))
    }

    /// Prepares a ray with its clip interval, if it has one; `None` if it can meet nothing.
    #[inline(always)]
    pub fn clipped(ray: &Ray, clip: Option<&Interval>) -> Option<Self> {
        let [origin, direction] = ray.halves().map(Vec3A::from_vec4);
        let clip = clip.copied().unwrap_or(Interval::ALL);
        ray.is_valid().then(|| Self::with_clip(origin, direction, ray.t_min, ray.t_max, clip))
    }

    /// Prepares a ray that was brought into an instance's space; `None` if rounding left it without a direction.
    #[inline]
    pub fn local(origin: Vec3, direction: Vec3, world: &Self, clip: Interval) -> Option<Self> {
        (origin.is_finite() && direction.is_finite() && direction != Vec3::ZERO)
            .then(|| Self::with_clip(origin.into(), direction.into(), world.t_min, world.t_max, clip))
    }

    #[inline(always)]
    fn with_clip(origin: Vec3A, direction: Vec3A, t_min: f32, t_max: f32, clip: Interval) -> Self {
        let inverse = Vec3A::ONE / direction;
        // The largest component becomes z. Woop et al. swap x and y for negative z to keep the winding; both sides count here,
        // so the order stays cyclic and only the sign of the determinant changes.
        let largest = largest_axis(direction.abs().to_array());
        let axes = AXES[largest];
        let d = direction.to_array();
        Self {
            origin,
            direction,
            inverse,
            inverse_far: Vec3A::from_array(inverse.to_array().map(padded)),
            shear: Vec3A::new(d[axes[0]], d[axes[1]], 1.0) / Vec3A::splat(d[largest]),
            axes,
            signs: direction.is_negative_bitmask(),
            t_min: if t_min > 0.0 { t_min } else { 0.0 },
            t_max,
            clip,
        }
    }

    /// Whether the direction's sign bit is set along an axis: then a box is entered through its upper plane.
    #[inline(always)]
    pub fn is_negative(&self, axis: usize) -> bool {
        self.signs >> axis & 1 != 0
    }

    /// Whether nothing before the origin can be clamped to where it counts.
    #[inline(always)]
    pub fn starts_at_origin(&self) -> bool {
        !(self.clip.near >= 0.0)
    }

    /// The smallest t at which something in this space can still give a hit at or after `t`, clamping considered.
    ///
    /// Where the clip interval starts no earlier than `t`, hits before it are clamped up to it and count, even those that
    /// rounding puts before the origin.
    #[inline(always)]
    pub fn lower_bound(&self, t: f32) -> f32 {
        if self.clip.near >= t { f32::NEG_INFINITY } else { t }
    }

    /// The largest t in this space that can still give a hit at or before `t`, clamping considered.
    #[inline(always)]
    pub fn upper_bound(&self, t: f32) -> f32 {
        if self.clip.far <= t { f32::INFINITY } else { t }
    }

    /// The largest t in this space at which a hit can still count: within the ray and no later than `best`.
    #[inline(always)]
    pub fn far_bound(&self, best: f32) -> f32 {
        let (within, best) = (self.upper_bound(self.t_max), self.upper_bound(best));
        if best < within { best } else { within }
    }
}

/// By how many ulp the far planes of boxes are padded.
///
/// Ize 2013 adds 2 for what the box test itself rounds. But the triangle test must not find what the box test passes by, and
/// its sheared coordinates are rounded as well: relative to t the crossing of a near plane may come out 5 u late (the shear
/// 2, the product 1, the box test's inverse and product 2) and that of a far plane 5 u early. An ulp of the inverse may be as
/// little as u of it; 12 leave room for the products of these terms. What is not relative to t is the matter of
/// [`hit_bounds`](crate::geometry::triangle::hit_bounds).
pub const PADDING: u32 = 12;

/// The value [`PADDING`] ulp farther from zero; infinities stay.
#[inline(always)]
pub fn padded(x: f32) -> f32 {
    const INFINITY_BITS: u32 = f32::INFINITY.to_bits();
    let sign = x.to_bits() & 0x8000_0000;
    let magnitude = (x.to_bits() & 0x7fff_ffff) + PADDING;
    f32::from_bits(sign | if magnitude < INFINITY_BITS { magnitude } else { INFINITY_BITS })
}

/// The cyclic orders of axes by their last one.
pub const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Which component of a direction's magnitudes is the largest, without branches, which random directions would mislead.
#[inline(always)]
pub fn largest_axis([x, y, z]: [f32; 3]) -> usize {
    let larger = if x > y { x } else { y };
    if larger > z { usize::from(x <= y) } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_rays_are_recognised() {
        let good = Ray::new(Vec3::ZERO, Vec3::X);
        assert!(good.is_valid());
        for bad in [
            Ray { origin: Vec3::new(f32::NAN, 0.0, 0.0), ..good },
            Ray { direction: Vec3::ZERO, ..good },
            Ray { direction: Vec3::new(f32::INFINITY, 1.0, 0.0), ..good },
            Ray { t_min: f32::NAN, ..good },
            Ray { t_max: f32::NAN, ..good },
            Ray { t_min: 2.0, t_max: 1.0, ..good },
            Ray { t_min: -2.0, t_max: -1.0, ..good },
        ] {
            assert!(!bad.is_valid(), "{bad:?}");
            assert!(PreparedRay::new(&bad).is_none());
        }
    }

    #[test]
    fn the_padded_inverse_is_farther_out_and_keeps_infinities() {
        assert_eq!(padded(1.0), 1.0 + 12.0 * f32::EPSILON);
        assert_eq!(padded(-1.0), -1.0 - 12.0 * f32::EPSILON);
        assert_eq!(padded(f32::INFINITY), f32::INFINITY);
        assert_eq!(padded(f32::NEG_INFINITY), f32::NEG_INFINITY);
        assert_eq!(padded(f32::MAX), f32::INFINITY);
    }
}
