//! Leaves of the wide tree: their triangles as arrays of components, packed without gaps.
//!
//! A leaf of n triangles is nine runs of n coordinates (corner by corner, x, y, z) and one of n numbers. Vectors are loaded
//! from wherever a run begins and hold what follows it in their last lanes, which are masked. Blocks that are padded to full
//! vectors would take a third more memory: leaves hold 5 to 6 of at most 8 triangles on average.

use glam::Vec3;

use super::node::{TRIANGLE_WORDS, WIDTH};
use super::simd::prefer_huge_pages;
use crate::accel::leaf::LeafTriangle;

/// All leaves' triangles.
#[derive(Debug, Default)]
pub struct Leaves {
    /// [`TRIANGLE_WORDS`] a triangle, and some so that a vector may be loaded from the last run.
    words: Vec<u32>,
    triangles: usize,
}

impl Leaves {
    /// Without triangles, with room for some.
    pub fn with_capacity(triangles: usize) -> Self {
        let mut words = Vec::new();
        words.reserve_exact(triangles * TRIANGLE_WORDS + WIDTH);
        prefer_huge_pages(&mut words);
        Self { words, triangles: 0 }
    }

    /// Adds a leaf and returns the place of its first triangle.
    pub fn push(&mut self, leaf: &[LeafTriangle]) -> usize {
        let first = self.triangles;
        for corner in 0..3 {
            for axis in 0..3 {
                self.words.extend(leaf.iter().map(|triangle| triangle.vertices[corner][axis].to_bits()));
            }
        }
        self.words.extend(leaf.iter().map(|triangle| triangle.primitive));
        self.triangles += leaf.len();
        first
    }

    /// Adds the leaves of another, which are not ended yet.
    pub fn append(&mut self, other: &Self) {
        self.words.extend_from_slice(&other.words);
        self.triangles += other.triangles;
    }

    /// Ends the last leaf with what vectors loaded from it may hold beyond its end.
    pub fn finish(&mut self) {
        self.words.extend([0; WIDTH]);
    }

    /// All words.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.triangles
    }

    /// The triangles of the leaf from place `first` on.
    pub fn triangles(&self, first: usize, count: usize) -> impl Iterator<Item = LeafTriangle> + '_ {
        let words = &self.words[first * TRIANGLE_WORDS..(first + count) * TRIANGLE_WORDS];
        (0..count).map(move |lane| {
            let corner = |number: usize| {
                let coordinate = |axis: usize| f32::from_bits(words[(number * 3 + axis) * count + lane]);
                Vec3::new(coordinate(0), coordinate(1), coordinate(2))
            };
            LeafTriangle { vertices: [corner(0), corner(1), corner(2)], primitive: words[9 * count + lane] }
        })
    }
}
