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
use crate::array::Array;
use crate::geometry::TriangleMesh;

/// All leaves' triangles.
#[derive(Debug)]
pub struct Leaves {
    /// [`TRIANGLE_WORDS`] a triangle, or one; and some so that a vector may be loaded from the last run.
    words: Array<u32>,
    triangles: usize,
    /// Where compact leaves have their triangles from.
    mesh: Option<Arc<TriangleMesh>>,
}

/// Leaves that are being made, which have no room behind the last run yet.
#[derive(Debug, Default)]
pub struct GrowingLeaves {
    words: Vec<u32>,
    triangles: usize,
    mesh: Option<Arc<TriangleMesh>>,
}

/// Room for a leaf that is laid out, and for what vectors loaded from it may hold beyond its end.
pub type Room = MaybeUninit<[u32; ROOM]>;

const ROOM: usize = (TRIANGLE_WORDS + 1) * WIDTH;

impl GrowingLeaves {
    /// Without triangles, with room for some; compact if there is a mesh.
    pub fn with_capacity(triangles: usize, mesh: Option<Arc<TriangleMesh>>) -> Self {
        let mut leaves = Self { mesh, ..Self::default() };
        leaves.words.reserve_exact(triangles * triangle_words(leaves.mesh.is_some()) + WIDTH);
        prefer_huge_pages(&mut leaves.words);
        leaves
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

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.triangles
    }

    /// Ends the last leaf with what vectors loaded from it may hold beyond its end.
    pub fn finish(mut self) -> Leaves {
        self.words.extend([0; WIDTH]);
        Leaves { words: self.words.into(), triangles: self.triangles, mesh: self.mesh }
    }
}

/// Words of a triangle.
fn triangle_words(is_compact: bool) -> usize {
    if is_compact { 1 } else { TRIANGLE_WORDS }
}

impl Leaves {
    /// Those whose words have been kept: of a mesh's compact leaves if there is one. `None` where they are not whole triangles and the
    /// room behind the last.
    pub fn kept(words: Array<u32>, mesh: Option<Arc<TriangleMesh>>) -> Option<Self> {
        let of_triangles = words.len().checked_sub(WIDTH)?;
        let each = triangle_words(mesh.is_some());
        let triangles = of_triangles / each;
        (triangles * each == of_triangles && triangles <= Child::MOST).then_some(Self { words, triangles, mesh })
    }

    fn triangle_words(&self) -> usize {
        triangle_words(self.mesh.is_some())
    }

    /// All words.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Bytes of all leaves, without the mesh that compact ones share.
    pub fn bytes(&self) -> usize {
        self.words.bytes()
    }

    /// Bytes that searches read: those of the mesh too.
    pub fn bytes_read(&self) -> usize {
        let arrays = |mesh: &TriangleMesh| mesh.positions.bytes() + mesh.indices.bytes();
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

    /// The numbers of a leaf's triangles in the mesh.
    pub fn primitives(&self, leaf: Child) -> &[u32] {
        let each = self.triangle_words();
        &self.words[leaf.first() * each..][..leaf.count() * each][leaf.count() * (each - 1)..]
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
