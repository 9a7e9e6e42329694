//! Eight numbers at a time: the instruction sets, chosen at run time, and the searches written for all of them.
//!
//! Every set gives the same bits: no operation here is fused, and comparisons with NaN come out as in [`Portable`], which is
//! the scalar twin of the others. This is the one place of the accelerators with `unsafe` code: searches read nodes and
//! leaves without checks, instructions are used that not every processor has, and the system is asked for large pages. What makes it sound: a [`Level`] is only
//! ever one that the processor has, and [`Tree`](super::Tree) is only made of nodes whose children are in range.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx;
mod batch;
mod leaf;
mod memory;
mod packet;
mod packet_leaf;
mod portable;
mod single;

pub use batch::{closest_batch, occluded_batch};
pub use memory::prefer_huge_pages;
pub use single::{Closest, NextAfter, Occluded, search, search_alone};

use packet::Packet;
use portable::Portable;
use single::Query;

use super::Tree;

use crate::geometry::ray::Interval;
use crate::geometry::{PreparedRay, Ray};
use crate::math::simd::{Level, Set};

/// Eight f32 and what searches do with them.
///
/// # Safety
/// All functions require the processor to have the instruction set, and pointers to point to eight readable (or
/// writable) numbers.
trait Lanes {
    /// Eight numbers.
    type Vector: Copy;

    /// The same number eight times.
    unsafe fn splat(x: f32) -> Self::Vector;
    /// Eight numbers from memory, however aligned.
    unsafe fn load(from: *const f32) -> Self::Vector;
    /// Eight numbers to memory, however aligned.
    unsafe fn store(to: *mut f32, v: Self::Vector);
    /// `a - b`
    unsafe fn sub(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a b`
    unsafe fn mul(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a + b`
    unsafe fn add(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Without the sign.
    unsafe fn abs(a: Self::Vector) -> Self::Vector;
    /// `if a > b { a } else { b }`: b where either is NaN.
    unsafe fn greater(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `if a < b { a } else { b }`: b where either is NaN.
    unsafe fn lesser(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// A bit a lane: `a <= b`.
    unsafe fn at_most(a: Self::Vector, b: Self::Vector) -> u32;
    /// A bit a lane: `a < b`.
    unsafe fn less(a: Self::Vector, b: Self::Vector) -> u32;

    /// Asks memory for a line that will be needed soon; any address will do.
    unsafe fn prefetch(from: *const u8);

    /// Prepares a ray and searches the tree, compiled for the set.
    unsafe fn search<Q: Query>(tree: &Tree, ray: &Ray, clip: Option<&Interval>, query: &mut Q);

    /// [`leaf::meet_leaf`] compiled for the set, and kept out of the loop over nodes, which needs the registers.
    unsafe fn meet_leaf<Q: Query>(numbers: *const f32, count: usize, ray: &PreparedRay, query: &mut Q) -> bool;
}

/// Sixteen f32 in rows, a lane a ray of a packet, and eight f64 at a time for what decides hits.
///
/// # Safety
/// As for [`Lanes`].
trait Rows: Lanes {
    /// Sixteen numbers.
    type Row: Copy;
    /// Eight f64.
    type Double: Copy;

    /// The same number sixteen times.
    unsafe fn row(x: f32) -> Self::Row;
    /// In which order [`row_records`](Self::row_records) puts records into lanes.
    const ORDER: [u16; 16];

    /// Sixteen records of eight words that follow each other, a row a word.
    unsafe fn row_records(records: *const f32) -> [Self::Row; 8];
    /// The first N words of sixteen records, a row a word: those at `places`, each of `size` words.
    unsafe fn row_gather<const N: usize>(records: *const f32, places: &[i32; 16], size: i32) -> [Self::Row; N];
    /// `a - b`
    unsafe fn row_sub(a: Self::Row, b: Self::Row) -> Self::Row;
    /// `a b`
    unsafe fn row_mul(a: Self::Row, b: Self::Row) -> Self::Row;
    /// `a + b`
    unsafe fn row_add(a: Self::Row, b: Self::Row) -> Self::Row;
    /// `a / b`
    unsafe fn row_div(a: Self::Row, b: Self::Row) -> Self::Row;
    /// So many representable numbers farther from zero; not for what would become infinite.
    unsafe fn row_farther(a: Self::Row, steps: u32) -> Self::Row;
    /// The least and the largest number; none is NaN.
    unsafe fn row_ends(a: Self::Row) -> [f32; 2];
    /// `if a > b { a } else { b }`: b where either is NaN.
    unsafe fn row_greater(a: Self::Row, b: Self::Row) -> Self::Row;
    /// `if a < b { a } else { b }`: b where either is NaN.
    unsafe fn row_lesser(a: Self::Row, b: Self::Row) -> Self::Row;
    /// A bit a lane: `a <= b`.
    unsafe fn row_at_most(a: Self::Row, b: Self::Row) -> u32;
    /// A bit a lane: `a < b`.
    unsafe fn row_less(a: Self::Row, b: Self::Row) -> u32;
    /// `b` where a lane's bit is set, else `a`; bits are passed on as they are.
    unsafe fn row_select(bits: u32, a: Self::Row, b: Self::Row) -> Self::Row;
    /// The first eight lanes, or the last.
    unsafe fn half(row: Self::Row, last: bool) -> Self::Vector;
    /// Both halves.
    unsafe fn join(first: Self::Vector, last: Self::Vector) -> Self::Row;

    /// The same numbers in f64.
    unsafe fn widen(v: Self::Vector) -> Self::Double;
    /// Rounded to the nearest f32, ties to even.
    unsafe fn narrow(v: Self::Double) -> Self::Vector;
    /// The same number eight times.
    unsafe fn double(x: f64) -> Self::Double;
    /// `a - b`
    unsafe fn double_sub(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `a b`
    unsafe fn double_mul(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `a + b`
    unsafe fn double_add(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `a / b`
    unsafe fn double_div(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `if a > b { a } else { b }`: b where either is NaN.
    unsafe fn double_greater(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `if a < b { a } else { b }`: b where either is NaN.
    unsafe fn double_lesser(a: Self::Double, b: Self::Double) -> Self::Double;
    /// `b` where a lane's bit is set, else `a`.
    unsafe fn double_select(bits: u32, a: Self::Double, b: Self::Double) -> Self::Double;
    /// A bit a lane: `a < b`.
    unsafe fn double_less(a: Self::Double, b: Self::Double) -> u32;

    /// [`packet::walk`] compiled for the set, and only once.
    unsafe fn walk_packet<const ANY: bool>(tree: &Tree, packet: &mut Packet<'_, Self>)
    where
        Self: Sized;
}
