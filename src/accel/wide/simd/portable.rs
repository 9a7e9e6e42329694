//! Eight lanes as an array: what every processor can do, and what the other sets are compared with.

use super::packet::{self, Packet};
use super::single::{self, Query};
use super::{Lanes, Rows, leaf};
use crate::accel::wide::Tree;
use crate::geometry::ray::Interval;
use crate::geometry::{PreparedRay, Ray};

/// The instructions that the crate was compiled for.
pub struct Portable;

#[inline(always)]
fn zip<T: Copy, const N: usize>(a: [T; N], b: [T; N], f: impl Fn(T, T) -> T) -> [T; N] {
    std::array::from_fn(|lane| f(a[lane], b[lane]))
}

#[inline(always)]
fn bits<T, const N: usize>(a: [T; N], b: [T; N], f: impl Fn(&T, &T) -> bool) -> u32 {
    (0..N).fold(0, |bits, lane| bits | u32::from(f(&a[lane], &b[lane])) << lane)
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

    #[inline(always)]
    unsafe fn prefetch(_: *const u8) {}

    #[inline(never)]
    unsafe fn search<Q: Query>(tree: &Tree, ray: &Ray, clip: Option<&Interval>, query: &mut Q) {
        // SAFETY: as the caller promises.
        unsafe { single::prepare_and_walk::<Self, Q>(tree, ray, clip, query) }
    }

    #[inline(never)]
    unsafe fn meet_leaf<Q: Query>(numbers: *const f32, count: usize, ray: &PreparedRay, query: &mut Q) -> bool {
        // SAFETY: as the caller promises.
        unsafe { leaf::meet_leaf::<Self, Q>(numbers, count, ray, query) }
    }
}

impl Rows for Portable {
    type Row = [f32; 16];
    type Double = [f64; 8];

    #[inline(always)]
    unsafe fn row(x: f32) -> [f32; 16] {
        [x; 16]
    }

    const ORDER: [u16; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

    #[inline(always)]
    unsafe fn row_records(records: *const f32) -> [[f32; 16]; 8] {
        // SAFETY: the caller points to sixteen records.
        std::array::from_fn(|word| std::array::from_fn(|lane| unsafe { *records.add(8 * lane + word) }))
    }

    #[inline(always)]
    unsafe fn row_gather<const N: usize>(records: *const f32, places: &[i32; 16], size: i32) -> [[f32; 16]; N] {
        // SAFETY: the caller points to records, of which the places are.
        std::array::from_fn(|word| places.map(|place| unsafe { *records.add((place * size) as usize + word) }))
    }

    #[inline(always)]
    unsafe fn row_div(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    unsafe fn row_farther(a: [f32; 16], steps: u32) -> [f32; 16] {
        a.map(|x| f32::from_bits(x.to_bits() + steps))
    }

    #[inline(always)]
    unsafe fn row_ends(a: [f32; 16]) -> [f32; 2] {
        a.iter().fold([a[0]; 2], |[least, most], &x| [least.min(x), most.max(x)])
    }

    #[inline(always)]
    unsafe fn row_sub(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    unsafe fn row_mul(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    unsafe fn row_add(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    unsafe fn row_greater(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    unsafe fn row_lesser(a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    unsafe fn row_at_most(a: [f32; 16], b: [f32; 16]) -> u32 {
        bits(a, b, f32::le)
    }

    #[inline(always)]
    unsafe fn row_less(a: [f32; 16], b: [f32; 16]) -> u32 {
        bits(a, b, f32::lt)
    }

    #[inline(always)]
    unsafe fn row_select(bits: u32, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|lane| if bits >> lane & 1 != 0 { b[lane] } else { a[lane] })
    }

    #[inline(always)]
    unsafe fn half(row: [f32; 16], last: bool) -> [f32; 8] {
        std::array::from_fn(|lane| row[lane + if last { 8 } else { 0 }])
    }

    #[inline(always)]
    unsafe fn join(first: [f32; 8], last: [f32; 8]) -> [f32; 16] {
        std::array::from_fn(|lane| if lane < 8 { first[lane] } else { last[lane - 8] })
    }

    #[inline(always)]
    unsafe fn widen(v: [f32; 8]) -> [f64; 8] {
        v.map(f64::from)
    }

    #[inline(always)]
    unsafe fn narrow(v: [f64; 8]) -> [f32; 8] {
        v.map(|x| x as f32)
    }

    #[inline(always)]
    unsafe fn double(x: f64) -> [f64; 8] {
        [x; 8]
    }

    #[inline(always)]
    unsafe fn double_sub(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    unsafe fn double_mul(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    unsafe fn double_add(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    unsafe fn double_div(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    unsafe fn double_greater(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    unsafe fn double_lesser(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    unsafe fn double_select(bits: u32, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        std::array::from_fn(|lane| if bits >> lane & 1 != 0 { b[lane] } else { a[lane] })
    }

    #[inline(always)]
    unsafe fn double_less(a: [f64; 8], b: [f64; 8]) -> u32 {
        bits(a, b, f64::lt)
    }

    #[inline(never)]
    unsafe fn walk_packet<const ANY: bool>(tree: &Tree, packet: &mut Packet<'_, Self>) {
        // SAFETY: as the caller promises.
        unsafe { packet::walk::<Self, ANY>(tree, packet) }
    }
}
