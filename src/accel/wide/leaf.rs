//! Leaves of the wide tree: their triangles as arrays of components, packed without gaps, or only their numbers.
//!
//! A leaf of n triangles is nine runs of n coordinates (corner by corner, x, y, z) and one of n numbers. Vectors are loaded
//! from wherever a run begins and hold what follows it in their last lanes, which are masked. Blocks that are padded to full
//! vectors would take a third more memory: leaves hold 5 to 6 of at most 8 triangles on average.
//!
//! Compact leaves are the runs of numbers alone. Searches lay out the rest when they come to a leaf, from the mesh, which
//! they share.

use std::mem::MaybeUninit;
use std::sync::Arc;

use glam::Vec3;

use super::node::{Child, TRIANGLE_WORDS, WIDTH};
use super::simd::prefer_huge_pages;
use crate::accel::leaf::LeafTriangle;
use crate::geometry::TriangleMesh;

/// All leaves' triangles.
#[derive(Debug, Default)]
pub struct Leaves {
    /// [`TRIANGLE_WORDS`] a triangle, or one; and some so that a vector may be loaded from the last run.
    words: Vec<u32>,
    triangles: usize,
    /// Where compact leaves have their triangles from.
    mesh: Option<Arc<TriangleMesh>>,
}

/// Room for a leaf that is laid out, and for what vectors loaded from it may hold beyond its end.
pub type Room = MaybeUninit<[u32; ROOM]>;

const ROOM: usize = (TRIANGLE_WORDS + 1) * WIDTH;

impl Leaves {
    /// Without triangles, with room for some; compact if there is a mesh.
    pub fn with_capacity(triangles: usize, mesh: Option<Arc<TriangleMesh>>) -> Self {
        let mut leaves = Self { mesh, ..Self::default() };
        leaves.words.reserve_exact(triangles * leaves.triangle_words() + WIDTH);
        prefer_huge_pages(&mut leaves.words);
        leaves
    }

    fn triangle_words(&self) -> usize {
        if self.mesh.is_some() { 1 } else { TRIANGLE_WORDS }
    }

    /// Adds a leaf and returns the place of its first triangle.
    pub fn push(&mut self, leaf: &[LeafTriangle]) -> usize {
        let first = self.triangles;
        if self.mesh.is_none() {
            for corner in 0..3 {
                for axis in 0..3 {
                    self.words.extend(leaf.iter().map(|triangle| triangle.vertices[corner][axis].to_bits()));
                }
            }
        }
        self.words.extend(leaf.iter().map(|triangle| triangle.primitive));
        self.triangles += leaf.len();
        first
    }

    /// Adds the leaves of another of the same form, which are not ended yet.
    pub fn append(&mut self, other: &Self) {
        self.words.extend_from_slice(&other.words);
        self.triangles += other.triangles;
    }

    /// Ends the last leaf with what vectors loaded from it may hold beyond its end.
    pub fn finish(&mut self) {
        self.words.extend([0; WIDTH]);
    }

    /// All words.
    #[cfg(test)]
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Bytes of all leaves, without the mesh that compact ones share.
    pub fn bytes(&self) -> usize {
        size_of_val(self.words.as_slice())
    }

    /// Bytes that searches read: those of the mesh too.
    pub fn bytes_read(&self) -> usize {
        let arrays =
            |mesh: &TriangleMesh| size_of_val(mesh.positions.as_slice()) + size_of_val(mesh.indices.as_slice());
        self.bytes() + self.mesh.as_deref().map_or(0, arrays)
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.triangles
    }

    /// The words of a leaf and their number, as they lie in memory.
    #[inline(always)]
    pub fn stored(&self, leaf: Child) -> (*const u32, usize) {
        let words = self.triangle_words();
        (self.words.as_ptr().wrapping_add(leaf.first() * words), leaf.count() * words)
    }

    /// A leaf of these, laid out as above: where it lies, or in the room.
    #[inline(always)]
    pub fn laid_out(&self, leaf: Child, room: &mut Room) -> *const f32 {
        match &self.mesh {
            None => self.words.as_ptr().wrapping_add(leaf.first() * TRIANGLE_WORDS).cast(),
            Some(mesh) => lay_out(mesh, &self.words[leaf.first()..][..leaf.count()], room).as_ptr().cast(),
        }
    }

    /// The triangles of a leaf.
    pub fn triangles(&self, leaf: Child) -> impl Iterator<Item = LeafTriangle> + '_ {
        let count = leaf.count();
        let words = &self.words[leaf.first() * self.triangle_words()..][..count * self.triangle_words()];
        (0..count).map(move |lane| {
            if let Some(mesh) = &self.mesh {
                return LeafTriangle::new(mesh, words[lane]);
            }
            let corner = |number: usize| {
                let coordinate = |axis: usize| f32::from_bits(words[(number * 3 + axis) * count + lane]);
                Vec3::new(coordinate(0), coordinate(1), coordinate(2))
            };
            LeafTriangle { vertices: [corner(0), corner(1), corner(2)], primitive: words[9 * count + lane] }
        })
    }
}

/// Lays out a leaf of these triangles. Out of line, since the searches' loops need the registers.
#[inline(never)]
fn lay_out<'a>(mesh: &TriangleMesh, primitives: &[u32], room: &'a mut Room) -> &'a [u32] {
    let words = room.write([0; ROOM]);
    let count = primitives.len();
    for (lane, &primitive) in primitives.iter().enumerate() {
        for (corner, vertex) in mesh.triangle(primitive).into_iter().enumerate() {
            words[3 * corner * count + lane] = vertex.x.to_bits();
            words[(3 * corner + 1) * count + lane] = vertex.y.to_bits();
            words[(3 * corner + 2) * count + lane] = vertex.z.to_bits();
        }
        words[9 * count + lane] = primitive;
    }
    words
}
