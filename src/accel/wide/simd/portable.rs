//! Eight lanes as an array: what every processor can do, and what the other sets are compared with.

use super::single::Query;
use super::{Lanes, leaf};
use crate::accel::wide::node::Child;
use crate::geometry::PreparedRay;

/// The instructions that the crate was compiled for.
pub struct Portable;

#[inline(always)]
fn zip(a: [f32; 8], b: [f32; 8], f: impl Fn(f32, f32) -> f32) -> [f32; 8] {
    std::array::from_fn(|lane| f(a[lane], b[lane]))
}

#[inline(always)]
fn bits(a: [f32; 8], b: [f32; 8], f: impl Fn(&f32, &f32) -> bool) -> u32 {
    (0..8).fold(0, |bits, lane| bits | u32::from(f(&a[lane], &b[lane])) << lane)
}

impl Lanes for Portable {
    type Vector = [f32; 8];

    #[inline(always)]
    unsafe fn splat(x: f32) -> [f32; 8] {
        [x; 8]
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> [f32; 8] {
        // SAFETY: the caller points to eight numbers.
        unsafe { from.cast::<[f32; 8]>().read_unaligned() }
    }

    #[inline(always)]
    unsafe fn store(to: *mut f32, v: [f32; 8]) {
        // SAFETY: the caller points to room for eight numbers.
        unsafe { to.cast::<[f32; 8]>().write_unaligned(v) }
    }

    #[inline(always)]
    unsafe fn sub(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    unsafe fn mul(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    unsafe fn add(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    unsafe fn abs(a: [f32; 8]) -> [f32; 8] {
        a.map(f32::abs)
    }

    #[inline(always)]
    unsafe fn greater(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    unsafe fn lesser(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    unsafe fn at_most(a: [f32; 8], b: [f32; 8]) -> u32 {
        bits(a, b, f32::le)
    }

    #[inline(always)]
    unsafe fn less(a: [f32; 8], b: [f32; 8]) -> u32 {
        bits(a, b, f32::lt)
    }

    #[inline(never)]
    unsafe fn meet_leaf<Q: Query>(words: *const u32, leaf: Child, ray: &PreparedRay, query: &mut Q) -> bool {
        // SAFETY: as the caller promises.
        unsafe { leaf::meet_leaf::<Self, Q>(words, leaf, ray, query) }
    }
}
