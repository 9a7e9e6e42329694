//! Eight lanes in a 256-bit register, with AVX2, and with the masks and the 32 registers of AVX-512.

use std::arch::x86_64::*;

use super::packet::{self, Packet};
use super::single::{self, Query};
use super::{Lanes, Rows, leaf};
use crate::accel::wide::Tree;
use crate::geometry::ray::Interval;
use crate::geometry::{PreparedRay, Ray};

/// AVX2, BMI1 and POPCNT.
pub struct Avx2;

/// AVX-512 (F, VL, DQ), for single rays in vectors of 256 bits, BMI1 and POPCNT.
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

            #[inline(always)]
            unsafe fn prefetch(from: *const u8) {
                unsafe { _mm_prefetch::<_MM_HINT_T0>(from.cast()) }
            }

            #[inline(never)]
            #[target_feature(enable = $features)]
            unsafe fn search<Q: Query>(tree: &Tree, ray: &Ray, clip: Option<&Interval>, query: &mut Q) {
                // SAFETY: as the caller promises.
                unsafe { single::prepare_and_walk::<Self, Q>(tree, ray, clip, query) }
            }

            #[inline(never)]
            #[target_feature(enable = $features)]
            unsafe fn meet_leaf<Q: Query>(numbers: *const f32, count: usize, ray: &PreparedRay, query: &mut Q) -> bool {
                // SAFETY: as the caller promises.
                unsafe { leaf::meet_leaf::<Self, Q>(numbers, count, ray, query) }
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

// SAFETY, of each block: as above.
impl Rows for Avx512 {
    type Row = __m512;
    type Double = __m512d;

    #[inline(always)]
    unsafe fn row(x: f32) -> __m512 {
        unsafe { _mm512_set1_ps(x) }
    }

    // The evens and then the odds of eight.
    const ORDER: [u16; 16] = [0, 2, 4, 6, 1, 3, 5, 7, 8, 10, 12, 14, 9, 11, 13, 15];

    #[inline(always)]
    unsafe fn row_records(records: *const f32) -> [__m512; 8] {
        unsafe {
            // Two records a register; four by four words are transposed in each quarter of four registers.
            let mut quarters = [[_mm512_setzero_ps(); 4]; 2];
            for (half, quarters) in quarters.iter_mut().enumerate() {
                let first = records.add(64 * half);
                let (a, b) = (_mm512_loadu_ps(first), _mm512_loadu_ps(first.add(16)));
                let (c, d) = (_mm512_loadu_ps(first.add(32)), _mm512_loadu_ps(first.add(48)));
                let (ab, cd) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
                let (ef, gh) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
                *quarters = [
                    _mm512_shuffle_ps::<0b01_00_01_00>(ab, cd),
                    _mm512_shuffle_ps::<0b11_10_11_10>(ab, cd),
                    _mm512_shuffle_ps::<0b01_00_01_00>(ef, gh),
                    _mm512_shuffle_ps::<0b11_10_11_10>(ef, gh),
                ];
            }
            let mut rows = [_mm512_setzero_ps(); 8];
            for word in 0..4 {
                let (first, last) = (quarters[0][word], quarters[1][word]);
                rows[word] = _mm512_shuffle_f32x4::<0b10_00_10_00>(first, last);
                rows[word + 4] = _mm512_shuffle_f32x4::<0b11_01_11_01>(first, last);
            }
            rows
        }
    }

    #[inline(always)]
    unsafe fn row_gather<const N: usize>(records: *const f32, places: &[i32; 16], size: i32) -> [__m512; N] {
        unsafe {
            let words = _mm512_mullo_epi32(_mm512_loadu_si512(places.as_ptr().cast()), _mm512_set1_epi32(size));
            let mut rows = [_mm512_setzero_ps(); N];
            for (word, row) in rows.iter_mut().enumerate() {
                *row = _mm512_i32gather_ps::<4>(words, records.add(word));
            }
            rows
        }
    }

    #[inline(always)]
    unsafe fn row_div(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_div_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_farther(a: __m512, steps: u32) -> __m512 {
        unsafe { _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), _mm512_set1_epi32(steps as i32))) }
    }

    #[inline(always)]
    unsafe fn row_ends(a: __m512) -> [f32; 2] {
        unsafe { [_mm512_reduce_min_ps(a), _mm512_reduce_max_ps(a)] }
    }

    #[inline(always)]
    unsafe fn row_sub(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_mul(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_add(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_greater(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_max_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_lesser(a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_min_ps(a, b) }
    }

    #[inline(always)]
    unsafe fn row_at_most(a: __m512, b: __m512) -> u32 {
        unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b)) }
    }

    #[inline(always)]
    unsafe fn row_less(a: __m512, b: __m512) -> u32 {
        unsafe { u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b)) }
    }

    #[inline(always)]
    unsafe fn row_select(bits: u32, a: __m512, b: __m512) -> __m512 {
        unsafe { _mm512_mask_mov_ps(a, bits as u16, b) }
    }

    #[inline(always)]
    unsafe fn half(row: __m512, last: bool) -> __m256 {
        unsafe { if last { _mm512_extractf32x8_ps::<1>(row) } else { _mm512_castps512_ps256(row) } }
    }

    #[inline(always)]
    unsafe fn join(first: __m256, last: __m256) -> __m512 {
        unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(first), last) }
    }

    #[inline(always)]
    unsafe fn widen(v: __m256) -> __m512d {
        unsafe { _mm512_cvtps_pd(v) }
    }

    #[inline(always)]
    unsafe fn narrow(v: __m512d) -> __m256 {
        unsafe { _mm512_cvtpd_ps(v) }
    }

    #[inline(always)]
    unsafe fn double(x: f64) -> __m512d {
        unsafe { _mm512_set1_pd(x) }
    }

    #[inline(always)]
    unsafe fn double_sub(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_sub_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_mul(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_mul_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_add(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_add_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_div(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_div_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_greater(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_max_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_lesser(a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_min_pd(a, b) }
    }

    #[inline(always)]
    unsafe fn double_select(bits: u32, a: __m512d, b: __m512d) -> __m512d {
        unsafe { _mm512_mask_mov_pd(a, bits as u8, b) }
    }

    #[inline(always)]
    unsafe fn double_less(a: __m512d, b: __m512d) -> u32 {
        unsafe { u32::from(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b)) }
    }

    #[inline(never)]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,bmi1,popcnt")]
    unsafe fn walk_packet<const ANY: bool>(tree: &Tree, packet: &mut Packet<'_, Self>) {
        // SAFETY: as the caller promises.
        unsafe { packet::walk::<Self, ANY>(tree, packet) }
    }
}

/// Eight records of eight words, a register a word: of the records the evens and then the odds.
///
/// # Safety
/// The processor has AVX2, and the records can be read.
#[inline(always)]
unsafe fn eight_records(records: *const f32) -> [__m256; 8] {
    unsafe {
        // A record a register, the evens and then the odds; four by four words are transposed in each half of four registers.
        let mut halves = [[_mm256_setzero_ps(); 4]; 2];
        for (odd, halves) in halves.iter_mut().enumerate() {
            let first = records.add(8 * odd);
            let (a, b) = (_mm256_loadu_ps(first), _mm256_loadu_ps(first.add(16)));
            let (c, d) = (_mm256_loadu_ps(first.add(32)), _mm256_loadu_ps(first.add(48)));
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (ef, gh) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            *halves = [
                _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
                _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
                _mm256_shuffle_ps::<0b01_00_01_00>(ef, gh),
                _mm256_shuffle_ps::<0b11_10_11_10>(ef, gh),
            ];
        }
        let mut words = [_mm256_setzero_ps(); 8];
        for word in 0..4 {
            let (evens, odds) = (halves[0][word], halves[1][word]);
            words[word] = _mm256_permute2f128_ps::<0x20>(evens, odds);
            words[word + 4] = _mm256_permute2f128_ps::<0x31>(evens, odds);
        }
        words
    }
}

// SAFETY, of each block: as above.
impl Rows for Avx2 {
    type Row = [__m256; 2];
    type Double = [__m256d; 2];

    #[inline(always)]
    unsafe fn row(x: f32) -> [__m256; 2] {
        unsafe { [_mm256_set1_ps(x); 2] }
    }

    const ORDER: [u16; 16] = [0, 2, 4, 6, 1, 3, 5, 7, 8, 10, 12, 14, 9, 11, 13, 15];

    #[inline(always)]
    unsafe fn row_records(records: *const f32) -> [[__m256; 2]; 8] {
        unsafe {
            let (first, last) = (eight_records(records), eight_records(records.add(64)));
            let mut rows = [[_mm256_setzero_ps(); 2]; 8];
            for (row, halves) in rows.iter_mut().zip(first.into_iter().zip(last)) {
                *row = halves.into();
            }
            rows
        }
    }

    #[inline(always)]
    unsafe fn row_gather<const N: usize>(records: *const f32, places: &[i32; 16], size: i32) -> [[__m256; 2]; N] {
        unsafe {
            let places: *const __m256i = places.as_ptr().cast();
            let size = _mm256_set1_epi32(size);
            let first = _mm256_mullo_epi32(_mm256_loadu_si256(places), size);
            let last = _mm256_mullo_epi32(_mm256_loadu_si256(places.add(1)), size);
            let mut rows = [[_mm256_setzero_ps(); 2]; N];
            for (word, row) in rows.iter_mut().enumerate() {
                let records = records.add(word);
                *row = [_mm256_i32gather_ps::<4>(records, first), _mm256_i32gather_ps::<4>(records, last)];
            }
            rows
        }
    }

    #[inline(always)]
    unsafe fn row_div(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_div_ps(a[0], b[0]), _mm256_div_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_farther(a: [__m256; 2], steps: u32) -> [__m256; 2] {
        unsafe {
            let steps = _mm256_set1_epi32(steps as i32);
            let first = _mm256_add_epi32(_mm256_castps_si256(a[0]), steps);
            let last = _mm256_add_epi32(_mm256_castps_si256(a[1]), steps);
            [_mm256_castsi256_ps(first), _mm256_castsi256_ps(last)]
        }
    }

    #[inline(always)]
    unsafe fn row_ends([first, last]: [__m256; 2]) -> [f32; 2] {
        unsafe {
            let (least, most) = (_mm256_min_ps(first, last), _mm256_max_ps(first, last));
            let least = _mm_min_ps(_mm256_castps256_ps128(least), _mm256_extractf128_ps::<1>(least));
            let most = _mm_max_ps(_mm256_castps256_ps128(most), _mm256_extractf128_ps::<1>(most));
            let least = _mm_min_ps(least, _mm_movehl_ps(least, least));
            let most = _mm_max_ps(most, _mm_movehl_ps(most, most));
            let least = _mm_min_ss(least, _mm_shuffle_ps::<1>(least, least));
            let most = _mm_max_ss(most, _mm_shuffle_ps::<1>(most, most));
            [_mm_cvtss_f32(least), _mm_cvtss_f32(most)]
        }
    }

    #[inline(always)]
    unsafe fn row_sub(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_mul(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_add(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_greater(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_max_ps(a[0], b[0]), _mm256_max_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_lesser(a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe { [_mm256_min_ps(a[0], b[0]), _mm256_min_ps(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn row_at_most(a: [__m256; 2], b: [__m256; 2]) -> u32 {
        unsafe { Self::at_most(a[0], b[0]) | Self::at_most(a[1], b[1]) << 8 }
    }

    #[inline(always)]
    unsafe fn row_less(a: [__m256; 2], b: [__m256; 2]) -> u32 {
        unsafe { Self::less(a[0], b[0]) | Self::less(a[1], b[1]) << 8 }
    }

    #[inline(always)]
    unsafe fn row_select(bits: u32, a: [__m256; 2], b: [__m256; 2]) -> [__m256; 2] {
        unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let first = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes);
            let last = _mm256_and_si256(_mm256_set1_epi32((bits >> 8) as i32), lanes);
            let first = _mm256_castsi256_ps(_mm256_cmpeq_epi32(first, lanes));
            let last = _mm256_castsi256_ps(_mm256_cmpeq_epi32(last, lanes));
            [_mm256_blendv_ps(a[0], b[0], first), _mm256_blendv_ps(a[1], b[1], last)]
        }
    }

    #[inline(always)]
    unsafe fn half(row: [__m256; 2], last: bool) -> __m256 {
        row[usize::from(last)]
    }

    #[inline(always)]
    unsafe fn join(first: __m256, last: __m256) -> [__m256; 2] {
        [first, last]
    }

    #[inline(always)]
    unsafe fn widen(v: __m256) -> [__m256d; 2] {
        unsafe { [_mm256_cvtps_pd(_mm256_castps256_ps128(v)), _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(v))] }
    }

    #[inline(always)]
    unsafe fn narrow(v: [__m256d; 2]) -> __m256 {
        unsafe { _mm256_set_m128(_mm256_cvtpd_ps(v[1]), _mm256_cvtpd_ps(v[0])) }
    }

    #[inline(always)]
    unsafe fn double(x: f64) -> [__m256d; 2] {
        unsafe { [_mm256_set1_pd(x); 2] }
    }

    #[inline(always)]
    unsafe fn double_sub(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_sub_pd(a[0], b[0]), _mm256_sub_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_mul(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_mul_pd(a[0], b[0]), _mm256_mul_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_add(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_add_pd(a[0], b[0]), _mm256_add_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_div(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_div_pd(a[0], b[0]), _mm256_div_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_greater(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_max_pd(a[0], b[0]), _mm256_max_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_lesser(a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe { [_mm256_min_pd(a[0], b[0]), _mm256_min_pd(a[1], b[1])] }
    }

    #[inline(always)]
    unsafe fn double_select(bits: u32, a: [__m256d; 2], b: [__m256d; 2]) -> [__m256d; 2] {
        unsafe {
            let lanes = _mm256_setr_epi64x(1, 2, 4, 8);
            let first = _mm256_and_si256(_mm256_set1_epi64x(i64::from(bits)), lanes);
            let last = _mm256_and_si256(_mm256_set1_epi64x(i64::from(bits >> 4)), lanes);
            let first = _mm256_castsi256_pd(_mm256_cmpeq_epi64(first, lanes));
            let last = _mm256_castsi256_pd(_mm256_cmpeq_epi64(last, lanes));
            [_mm256_blendv_pd(a[0], b[0], first), _mm256_blendv_pd(a[1], b[1], last)]
        }
    }

    #[inline(always)]
    unsafe fn double_less(a: [__m256d; 2], b: [__m256d; 2]) -> u32 {
        unsafe {
            let first = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a[0], b[0])) as u32;
            let last = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a[1], b[1])) as u32;
            first | last << 4
        }
    }

    #[inline(never)]
    #[target_feature(enable = "avx2,bmi1,popcnt")]
    unsafe fn walk_packet<const ANY: bool>(tree: &Tree, packet: &mut Packet<'_, Self>) {
        // SAFETY: as the caller promises.
        unsafe { packet::walk::<Self, ANY>(tree, packet) }
    }
}
