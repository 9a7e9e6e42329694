//! Hashes for sample positions, functions of pixel and sample alone so that tiles and threads cannot matter, and
//! sequences for drawing test rays.

use glam::DVec3;

/// A well-mixed 32-bit hash (the finaliser `lowbias32` found by C. Wellons' search, bias 0.17).
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of two numbers.
#[inline(always)]
pub fn hash2(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b).wrapping_mul(0x9e37_79b9))
}

/// Maps a hash to [0, 1).
#[inline(always)]
pub fn unit(h: u32) -> f64 {
    f64::from(h) / 4_294_967_296.0
}

/// A sequence of numbers that are as good as random for drawing samples: SplitMix64 (Steele, Lea and Flood 2014).
///
/// The sequence depends on the seed and the stream alone; streams of one seed are independent, so that work can be cut
/// into pieces anywhere.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream of that number under a seed.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { state: mix(mix(seed).wrapping_add(stream.wrapping_mul(GOLDEN))) }
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in [0, 1), a multiple of 2^-53.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [low, high).
    #[inline]
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform among 0 to `count` - 1; `count` must not be 0.
    #[inline]
    pub fn below(&mut self, count: u64) -> u64 {
        // Multiplying beats a remainder; the bias of 2^-64 count does not matter to samples.
        ((u128::from(self.bits()) * u128::from(count)) >> 64) as u64
    }

    /// Uniform on the unit sphere (Marsaglia 1972).
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let (x, y) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
            let s = x * x + y * y;
            if s < 1.0 {
                let root = 2.0 * (1.0 - s).sqrt();
                return DVec3::new(x * root, y * root, 1.0 - 2.0 * s);
            }
        }
    }

    /// Uniform in the cube [-1, 1)^3.
    pub fn in_cube(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

/// 2^64 divided by the golden ratio, made odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

#[inline]
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequences_repeat_and_streams_differ() {
        let take = |seed, stream| {
            let mut random = Random::new(seed, stream);
            std::array::from_fn::<u64, 4, _>(|_| random.bits())
        };
        assert_eq!(take(1, 2), take(1, 2));
        assert_ne!(take(1, 2), take(1, 3));
        assert_ne!(take(1, 2), take(2, 2));
    }

    #[test]
    fn samples_fill_their_ranges_evenly() {
        let mut random = Random::new(7, 0);
        let mut counts = [0u32; 10];
        let (mut mean, n) = (DVec3::ZERO, 20_000);
        for _ in 0..n {
            counts[random.below(10) as usize] += 1;
            let direction = random.direction();
            assert!((direction.length() - 1.0).abs() < 1e-14);
            mean += direction / f64::from(n);
        }
        // 2000 each with a standard deviation of 42; the mean of n unit vectors has 0.004 per axis.
        assert!(counts.iter().all(|c| (1790..2210).contains(c)), "{counts:?}");
        assert!(mean.abs().max_element() < 0.02, "{mean}");
    }
}
