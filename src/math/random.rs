//! Hashes for sample positions: a function of pixel and sample alone, so that tiles and threads cannot matter.

/// A well-mixed 32-bit hash (the finaliser `lowbias32` found by C. Wellons' search, bias 0.17).
#[inline]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of two numbers.
#[inline]
pub fn hash2(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b).wrapping_mul(0x9e37_79b9))
}

/// Maps a hash to [0, 1).
#[inline]
pub fn unit(h: u32) -> f64 {
    f64::from(h) / 4_294_967_296.0
}
