//! Eight lanes in a 256-bit register, with AVX2, and with the masks and the 32 registers of AVX-512.

use std::arch::x86_64::*;

use super::single::Query;
use super::{Lanes, leaf};
use crate::accel::wide::node::Child;
use crate::geometry::PreparedRay;

/// AVX2 and BMI1.
pub struct Avx2;

/// AVX-512 (F, VL, DQ) in vectors of 256 bits, and BMI1.
pub struct Avx512;

/// The sets differ in how lanes are compared.
macro_rules! lanes_of_256_bits {
    ($name:ident, $features:literal, |$a:ident, $b:ident| $at_most:expr, $less:expr) => {
        // SAFETY, of each block: the caller knows that the processor has the instructions and that pointers are good.
        impl Lanes for $name {
            type Vector = __m256;

            #[inline(always)]
            unsafe fn splat(x: f32) -> __m256 {
                unsafe { _mm256_set1_ps(x) }
            }

            #[inline(always)]
            unsafe fn load(from: *const f32) -> __m256 {
                unsafe { _mm256_loadu_ps(from) }
            }

            #[inline(always)]
            unsafe fn store(to: *mut f32, v: __m256) {
                unsafe { _mm256_storeu_ps(to, v) }
            }

            #[inline(always)]
            unsafe fn sub(a: __m256, b: __m256) -> __m256 {
                unsafe { _mm256_sub_ps(a, b) }
            }

            #[inline(always)]
            unsafe fn mul(a: __m256, b: __m256) -> __m256 {
                unsafe { _mm256_mul_ps(a, b) }
            }

            #[inline(always)]
            unsafe fn add(a: __m256, b: __m256) -> __m256 {
                unsafe { _mm256_add_ps(a, b) }
            }

            #[inline(always)]
            unsafe fn abs(a: __m256) -> __m256 {
                unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
            }

            #[inline(always)]
            unsafe fn greater(a: __m256, b: __m256) -> __m256 {
                unsafe { _mm256_max_ps(a, b) }
            }

            #[inline(always)]
            unsafe fn lesser(a: __m256, b: __m256) -> __m256 {
                unsafe { _mm256_min_ps(a, b) }
            }

            #[inline(always)]
            unsafe fn at_most($a: __m256, $b: __m256) -> u32 {
                unsafe { $at_most }
            }

            #[inline(always)]
            unsafe fn less($a: __m256, $b: __m256) -> u32 {
                unsafe { $less }
            }

            #[inline(never)]
            #[target_feature(enable = $features)]
            unsafe fn meet_leaf<Q: Query>(words: *const u32, leaf: Child, ray: &PreparedRay, query: &mut Q) -> bool {
                // SAFETY: as the caller promises.
                unsafe { leaf::meet_leaf::<Self, Q>(words, leaf, ray, query) }
            }
        }
    };
}

lanes_of_256_bits!(
    Avx2,
    "avx2,bmi1",
    |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32,
    _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u32
);
lanes_of_256_bits!(
    Avx512,
    "avx512f,avx512vl,avx512dq,bmi1",
    |a, b| u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b)),
    u32::from(_mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b))
);
