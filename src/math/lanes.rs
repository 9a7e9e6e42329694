//! Arrays of numbers, one of each for some things that are computed together: loops over them become vectors.

use glam::{DVec3, Vec3};

/// Things that are computed together: enough for eight vectors of eight, few enough that a dozen arrays stay in the nearest cache.
pub const LANES: usize = 64;

/// Loops go over whole rows of this many, or their last rounds would be done one by one.
const ROW: usize = 8;

/// How far loops over so many things go.
#[inline(always)]
pub fn whole_rows(count: usize) -> usize {
    count.next_multiple_of(ROW).min(LANES)
}

/// A number each.
pub type Numbers = [f64; LANES];

/// A yes or no each, as 1 or 0: as wide as f32, which is how comparisons give them.
pub type Flags = [u32; LANES];

/// A vector each.
#[derive(Debug, Clone, Copy)]
pub struct Vectors {
    x: Numbers,
    y: Numbers,
    z: Numbers,
}

impl Vectors {
    /// Zeros.
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    /// One of them.
    #[inline(always)]
    pub fn get(&self, at: usize) -> DVec3 {
        DVec3::new(self.x[at], self.y[at], self.z[at])
    }

    /// Sets one.
    #[inline(always)]
    pub fn set(&mut self, at: usize, v: DVec3) {
        self.x[at] = v.x;
        self.y[at] = v.y;
        self.z[at] = v.z;
    }
}

/// A vector in f32 or a colour each.
#[derive(Debug, Clone, Copy)]
pub struct Vectors32 {
    x: [f32; LANES],
    y: [f32; LANES],
    z: [f32; LANES],
}

impl Vectors32 {
    /// Zeros.
    pub const ZERO: Self = Self { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES] };

    /// One of them.
    #[inline(always)]
    pub fn get(&self, at: usize) -> Vec3 {
        Vec3::new(self.x[at], self.y[at], self.z[at])
    }

    /// Sets one.
    #[inline(always)]
    pub fn set(&mut self, at: usize, v: Vec3) {
        self.x[at] = v.x;
        self.y[at] = v.y;
        self.z[at] = v.z;
    }
}
