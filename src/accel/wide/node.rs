//! A node of the wide tree, and how children are named.

use glam::Vec3;

use crate::geometry::Bounds;

/// Children of a node, and the most triangles of a leaf: the lanes of a vector.
pub const WIDTH: usize = 8;

/// 32-bit words of a triangle in a leaf: nine coordinates and its number.
pub const TRIANGLE_WORDS: usize = 10;

/// A node or a leaf, in 32 bits: an inner node's number, or [`Child::LEAF`], the number of triangles less 1 in the three bits
/// below, and the place of the first triangle among all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Child(pub u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    const COUNT_SHIFT: u32 = 28;

    /// The most triangles in all leaves together, and more than inner nodes can be.
    pub const MOST: usize = 1 << Self::COUNT_SHIFT;

    /// Where there is no child. Never read: its box is empty.
    pub const NONE: Self = Self(u32::MAX);

    /// The inner node with a number.
    pub fn inner(number: usize) -> Self {
        debug_assert!(number < Self::LEAF as usize);
        Self(number as u32)
    }

    /// The leaf of `count` triangles, 1 to 8, from place `first` on.
    pub fn leaf(first: usize, count: usize) -> Self {
        debug_assert!((1..=WIDTH).contains(&count) && first < Self::MOST);
        Self(Self::LEAF | (count as u32 - 1) << Self::COUNT_SHIFT | first as u32)
    }

    /// Whether it is a leaf.
    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// An inner node's number.
    #[inline(always)]
    pub fn number(self) -> usize {
        self.0 as usize
    }

    /// The same child where so many nodes and triangles come before those that it was numbered among.
    pub fn moved(self, nodes: usize, triangles: usize) -> Self {
        match self {
            Self::NONE => self,
            leaf if leaf.is_leaf() => Self::leaf(leaf.first() + triangles, leaf.count()),
            inner => Self::inner(inner.number() + nodes),
        }
    }

    /// A leaf's first place.
    #[inline(always)]
    pub fn first(self) -> usize {
        (self.0 & (Self::MOST as u32 - 1)) as usize
    }

    /// A leaf's number of triangles.
    #[inline(always)]
    pub fn count(self) -> usize {
        (self.0 >> Self::COUNT_SHIFT & 7) as usize + 1
    }
}

/// A node: eight boxes as arrays of planes, ready to be loaded into vectors. 256 bytes: four cache lines, and a number becomes
/// an address by a shift.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(256))]
pub struct Node {
    /// `planes[axis][side][child]`; side 0 is the lower plane. Where there is no child the box is empty.
    pub planes: [[[f32; WIDTH]; 2]; 3],
    /// What is in the boxes.
    pub children: [Child; WIDTH],
    /// Fills the last cache line.
    pub unused: [u32; 8],
}

impl Node {
    /// Without children.
    pub const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child::NONE; WIDTH],
        unused: [0; 8],
    };

    /// Sets a child.
    pub fn set(&mut self, at: usize, bounds: &Bounds, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0][at] = bounds.min[axis];
            self.planes[axis][1][at] = bounds.max[axis];
        }
        self.children[at] = child;
    }

    /// A child's box.
    pub fn bounds(&self, at: usize) -> Bounds {
        let corner = |side: usize| Vec3::from_array(std::array::from_fn(|axis| self.planes[axis][side][at]));
        Bounds { min: corner(0), max: corner(1) }
    }

    /// The children that there are, with their boxes.
    pub fn children(&self) -> impl Iterator<Item = (Child, Bounds)> + '_ {
        (0..WIDTH).map(|at| (self.children[at], self.bounds(at))).filter(|(child, _)| *child != Child::NONE)
    }
}

/// A node's bytes, as a power of two.
pub const NODE_SHIFT: u32 = size_of::<Node>().trailing_zeros();

/// A plane of all children.
pub const PLANE_BYTES: usize = WIDTH * size_of::<f32>();
