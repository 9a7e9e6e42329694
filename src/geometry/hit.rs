//! The smallest record of a hit, and the order in which hits come.

use bytemuck::{Pod, Zeroable};

/// A position in the order of hits along a ray: by t, then instance, then primitive.
///
/// No two hits of one ray share a key, so "the first hit after a key" visits every hit once, in one order, whatever
/// the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Ray parameter, in units of the ray's direction.
    pub t: f32,
    /// Object number, in the order of the file.
    pub instance: u32,
    /// Triangle number within its mesh, or surface number within its quadric.
    pub primitive: u32,
}

impl Key {
    /// Comes before every hit.
    pub const BEFORE_ALL: Self = Self { t: f32::NEG_INFINITY, instance: 0, primitive: 0 };

    /// Whether `self` comes strictly before `other`. False if either t is NaN.
    #[inline(always)]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && (self.instance, self.primitive) < (other.instance, other.primitive))
    }
}

/// Where a ray meets the scene.
///
/// For a triangle `primitive` is its number in the mesh and the point is `(1 - u - v) A + u B + v C`. For a quadric u
/// and v are 0 and `primitive` says which part was met: 0 or 1 for the first or second root of the equation along the
/// ray, 2 to 7 for the cap on the -x, +x, -y, +y, -z, +z side of its clip box.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Hit {
    /// Ray parameter in units of the ray's direction; positive infinity for a miss.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
    /// Object number, in the order of the file; `u32::MAX` for a miss.
    pub instance: u32,
    /// Triangle or surface number; `u32::MAX` for a miss.
    pub primitive: u32,
}

impl Hit {
    /// No hit; comes after every hit.
    pub const MISS: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, instance: u32::MAX, primitive: u32::MAX };

    /// Whether this is a hit.
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.instance != u32::MAX
    }

    /// Where the hit stands in the order of hits.
    #[inline(always)]
    pub fn key(&self) -> Key {
        Key { t: self.t, instance: self.instance, primitive: self.primitive }
    }
}
