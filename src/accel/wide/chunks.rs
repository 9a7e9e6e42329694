//! A mesh's triangles cut into chunks that are built one by one, and the tree over the chunks.
//!
//! From the root down triangles are cut in two where the surface area heuristic, for a sample of them and at the borders of bins, is
//! least (Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", RT 2007), until a chunk is small enough to stay in a
//! core's cache while it is built. Where the cuts lie depends on the triangles alone, not on the number of threads.

use std::cmp::Ordering;
use std::mem;

use glam::Vec3;
use rayon::prelude::*;

use super::collapse::EVEN_DEPTH;
use super::node::{Child, Node, WIDTH};
use crate::accel::ONE_THREAD;
use crate::accel::topology::half_area;
use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, TriangleMesh};

/// The most triangles of a chunk. Chunks of 4,096 make rays in Sponza cost up to 11 % more; with 65,536 a dragon of 871 k triangles is built
/// as fast, within what was told apart, but less evenly on many threads.
pub const MOST: usize = ONE_THREAD;

/// From this depth on triangles are cut in equal halves, so that the tree over 2^28 triangles' chunks stays less deep than
/// [`EVEN_DEPTH`].
const EQUAL_DEPTH: usize = 20;

/// Halving ends at one chunk, and rounding may add a level.
const _: () = assert!(EVEN_DEPTH > EQUAL_DEPTH + (Child::MOST / MOST).ilog2() as usize);

/// A triangle is large whose box has this part of the whole surface, turned over.
const LARGE: f64 = 10.0;

/// So many large triangles find room beside the other parts of the root. In a space ship of 257 k triangles among 6 that make a room
/// shadow rays were compared with 14.4 boxes and 5.1 triangles on average; with this they are with 9.4 and 0.7, in half the time.
const MOST_LARGE: usize = WIDTH - 2;

/// Bins an axis.
const BINS: usize = 32;

/// About how many references are looked at for a cut.
const SAMPLE: usize = 1 << 14;

/// So many triangles a task.
const TASK: usize = 1 << 15;

/// A triangle to be put into a tree.
#[derive(Debug, Clone, Copy)]
pub struct Reference {
    /// The box in which hits lie.
    pub bounds: Bounds,
    /// Its number in the mesh.
    pub primitive: u32,
}

impl Reference {
    /// Those of a mesh's live triangles.
    pub fn all(mesh: &TriangleMesh) -> Vec<Self> {
        let live: Vec<u32> = mesh.live_triangles().collect();
        let reference = |&primitive: &u32| Self { bounds: hit_bounds(mesh.triangle(primitive)), primitive };
        live.par_iter().with_min_len(TASK).map(reference).collect()
    }

    /// The middle of the box, finite.
    #[inline(always)]
    fn center(&self) -> Vec3 {
        let largest = Vec3::splat(f32::MAX);
        let half = |corner: Vec3| corner.max(-largest).min(largest) * 0.5;
        half(self.bounds.min) + half(self.bounds.max)
    }
}

/// A chunk of references.
#[derive(Debug)]
pub struct Chunk<'a> {
    /// What it holds; at least one.
    pub references: &'a [Reference],
    /// Where its root goes: a node of the top and a place in it. None where it is all there is.
    pub place: Option<(usize, usize)>,
    /// How deep its root is.
    pub depth: usize,
}

/// Chunks and the nodes over them.
#[derive(Debug)]
pub struct Chunks<'a> {
    /// The box around all.
    pub bounds: Bounds,
    /// The nodes over the chunks, the root first, without the chunks' own; none if there is one chunk.
    pub top: Vec<Node>,
    /// In the order in which their places are met, depth first.
    pub chunks: Vec<Chunk<'a>>,
}

impl<'a> Chunks<'a> {
    /// Cuts references into chunks, which changes their order.
    pub fn cut(references: &'a mut [Reference]) -> Self {
        let mut chunks = Self { bounds: Bounds::EMPTY, top: Vec::new(), chunks: Vec::new() };
        if !references.is_empty() {
            let part = cut_all(references);
            chunks.bounds = part.bounds;
            chunks.add(part, None, 0);
        }
        chunks
    }

    /// Adds what is below a part, whose depth is given.
    fn add(&mut self, part: Part<'a>, place: Option<(usize, usize)>, depth: usize) {
        let pair = match part.content {
            Content::Chunk(references) => return self.chunks.push(Chunk { references, place, depth }),
            Content::Pair(pair) => *pair,
        };
        let number = self.top.len();
        self.top.push(Node::EMPTY);
        if let Some((node, place)) = place {
            self.top[node].children[place] = Child::inner(number);
        }
        for (place, part) in open(pair).into_iter().enumerate() {
            self.top[number].set(place, &part.bounds, Child::NONE);
            self.add(part, Some((number, place)), depth + 1);
        }
    }
}

/// References and the box around them.
struct Part<'a> {
    bounds: Bounds,
    content: Content<'a>,
}

enum Content<'a> {
    Chunk(&'a [Reference]),
    Pair(Box<[Part<'a>; 2]>),
}

/// Makes two parts as many as a node holds: the largest box is replaced by what is in it.
fn open(pair: [Part<'_>; 2]) -> Vec<Part<'_>> {
    let mut parts = Vec::from(pair);
    while parts.len() < WIDTH {
        let area = |part: &Part<'_>| match part.content {
            Content::Chunk(_) => f64::NEG_INFINITY,
            Content::Pair(_) => half_area(&part.bounds),
        };
        let largest = (0..parts.len()).max_by(|&a, &b| area(&parts[a]).total_cmp(&area(&parts[b])));
        let Some(largest) = largest else { break };
        match mem::replace(&mut parts[largest].content, Content::Chunk(&[])) {
            Content::Pair(pair) => {
                parts.splice(largest..=largest, *pair);
            }
            chunk @ Content::Chunk(_) => {
                parts[largest].content = chunk;
                break;
            }
        }
    }
    parts
}

/// Cuts all references. A few that are as large as the model, its ground and backdrop, become chunks of their own: the box of a chunk
/// that held one would be met by every ray.
fn cut_all(references: &mut [Reference]) -> Part<'_> {
    if references.len() > MOST {
        let bounds = references.par_iter().map(|reference| reference.bounds).reduce(|| Bounds::EMPTY, Bounds::union);
        let is_large = |reference: &Reference| half_area(&reference.bounds) * LARGE > half_area(&bounds);
        let count = references.iter().filter(|reference| is_large(reference)).take(MOST_LARGE + 1).count();
        if (1..=MOST_LARGE).contains(&count) {
            let mut front = 0;
            for at in 0..references.len() {
                if is_large(&references[at]) {
                    references.swap(at, front);
                    front += 1;
                }
            }
            let (large, others) = references.split_at_mut(front);
            let pair = [each(large), cut(others, 1)];
            return Part { bounds, content: Content::Pair(Box::new(pair)) };
        }
    }
    cut(references, 0)
}

/// A chunk for each reference, of which there is at least one.
fn each(references: &[Reference]) -> Part<'_> {
    if let [one] = references {
        return Part { bounds: one.bounds, content: Content::Chunk(references) };
    }
    let (first, second) = references.split_at(references.len() / 2);
    let pair = [each(first), each(second)];
    Part { bounds: pair[0].bounds.union(pair[1].bounds), content: Content::Pair(Box::new(pair)) }
}

fn cut(references: &mut [Reference], depth: usize) -> Part<'_> {
    if references.len() <= MOST {
        let bounds = references.iter().fold(Bounds::EMPTY, |bounds, reference| bounds.union(reference.bounds));
        return Part { bounds, content: Content::Chunk(references) };
    }
    let at = if depth < EQUAL_DEPTH { cut_by_cost(references) } else { None };
    let at = at.unwrap_or_else(|| cut_in_half(references));
    let (first, second) = references.split_at_mut(at);
    let (first, second) = rayon::join(|| cut(first, depth + 1), || cut(second, depth + 1));
    Part { bounds: first.bounds.union(second.bounds), content: Content::Pair(Box::new([first, second])) }
}

/// Brings the references on one side of a plane to the front and returns how many they are; none if all boxes
/// have one middle.
fn cut_by_cost(references: &mut [Reference]) -> Option<usize> {
    let step = references.len().div_ceil(SAMPLE);
    let sample = || references.iter().step_by(step);
    let grid = Grid::new(&Bounds::of(sample().map(Reference::center)));
    let mut bins = Bins::default();
    sample().for_each(|reference| bins.add(&grid, reference));
    let (axis, plane) = bins.best_plane()?;
    // Without branches, which would be mispredicted half of the time: each reference is swapped with the first of those
    // that stay behind, but the place of the first moves on only where it belongs to the front.
    let mut front = 0;
    for at in 0..references.len() {
        let is_first = grid.bin(&references[at], axis) < plane;
        references.swap(at, front);
        front += usize::from(is_first);
    }
    Some(front)
}

/// Brings the lesser half along the longest axis to the front.
fn cut_in_half(references: &mut [Reference]) -> usize {
    let middles = Bounds::of(references.iter().map(Reference::center));
    let size = middles.size();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    let order = |one: &Reference, other: &Reference| -> Ordering {
        one.center()[axis].total_cmp(&other.center()[axis]).then(one.primitive.cmp(&other.primitive))
    };
    let half = references.len() / 2;
    references.select_nth_unstable_by(half, order);
    half
}

/// Where bins lie.
struct Grid {
    min: Vec3,
    scale: Vec3,
}

impl Grid {
    fn new(middles: &Bounds) -> Self {
        // An axis without extent, or beyond what f32 holds, has one bin.
        let scale = (BINS as f32 / (middles.max - middles.min)).to_array();
        let scale = scale.map(|scale| if scale.is_finite() { scale } else { 0.0 });
        Self { min: middles.min, scale: Vec3::from_array(scale) }
    }

    #[inline(always)]
    fn bin(&self, reference: &Reference, axis: usize) -> usize {
        // What is not finite, or too large, ends in some bin.
        (((reference.center()[axis] - self.min[axis]) * self.scale[axis]) as usize).min(BINS - 1)
    }
}

/// How many boxes have their middle in each bin, and the boxes around them.
struct Bins([[(Bounds, usize); BINS]; 3]);

impl Default for Bins {
    fn default() -> Self {
        Self([[(Bounds::EMPTY, 0); BINS]; 3])
    }
}

impl Bins {
    #[inline(always)]
    fn add(&mut self, grid: &Grid, reference: &Reference) {
        for (axis, bins) in self.0.iter_mut().enumerate() {
            let bin = &mut bins[grid.bin(reference, axis)];
            *bin = (bin.0.union(reference.bounds), bin.1 + 1);
        }
    }

    /// The axis and the first bin of the second side for which the sum of areas times numbers is least.
    fn best_plane(&self) -> Option<(usize, usize)> {
        let mut best = (f64::INFINITY, None);
        for (axis, bins) in self.0.iter().enumerate() {
            let join = |(bounds, count): (Bounds, usize), bin: &(Bounds, usize)| (bounds.union(bin.0), count + bin.1);
            let cost = |(bounds, count): (Bounds, usize)| half_area(&bounds) * count as f64;
            let mut behind = [(Bounds::EMPTY, 0); BINS];
            let mut sum = (Bounds::EMPTY, 0);
            for (at, bin) in bins.iter().enumerate().rev() {
                sum = join(sum, bin);
                behind[at] = sum;
            }
            sum = (Bounds::EMPTY, 0);
            for plane in 1..BINS {
                sum = join(sum, &bins[plane - 1]);
                let total = cost(sum) + cost(behind[plane]);
                if sum.1 > 0 && behind[plane].1 > 0 && total < best.0 {
                    best = (total, Some((axis, plane)));
                }
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn reference(primitive: u32, center: Vec3) -> Reference {
        let half = Vec3::splat(1e-3);
        Reference { bounds: Bounds { min: center - half, max: center + half }, primitive }
    }

    /// Cuts and checks what must hold of every cut; returns the chunks' sizes and depths.
    fn cut_and_check(references: &mut [Reference]) -> Vec<(usize, usize)> {
        let count = references.len();
        let chunks = Chunks::cut(references);
        let mut primitives = Vec::new();
        for chunk in &chunks.chunks {
            assert!((1..=MOST).contains(&chunk.references.len()));
            let (node, place) = chunk.place.unwrap();
            let bounds = chunks.top[node].bounds(place);
            assert!(chunk.references.iter().all(|reference| bounds.contains(&reference.bounds)));
            primitives.extend(chunk.references.iter().map(|reference| reference.primitive));
        }
        primitives.sort_unstable();
        assert!(primitives.into_iter().eq(0..count as u32));
        for node in &chunks.top {
            for inner in node.children.iter().filter(|child| **child != Child::NONE) {
                assert!(!inner.is_leaf() && inner.number() < chunks.top.len());
            }
        }
        chunks.chunks.iter().map(|chunk| (chunk.references.len(), chunk.depth)).collect()
    }

    #[test]
    fn chunks_hold_every_triangle_once_whatever_the_number_of_threads() {
        let cut_on = |threads: usize| {
            let mut random = Random::new(3, 0x51d);
            let mut references: Vec<_> =
                (0..10 * MOST as u32).map(|number| reference(number, random.in_cube().as_vec3())).collect();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let sizes = pool.install(|| cut_and_check(&mut references));
            (sizes, references.iter().map(|reference| reference.primitive).collect::<Vec<_>>())
        };
        let alone = cut_on(1);
        assert!(alone.0.len() >= 10 && alone.0.iter().all(|&(_, depth)| depth <= 4), "{:?}", alone.0);
        assert!(alone == cut_on(3));
    }

    #[test]
    fn a_few_large_triangles_are_chunks_of_their_own() {
        for large in [1, 3, MOST_LARGE, MOST_LARGE + 1] {
            let mut random = Random::new(4, 0x51d);
            let mut references: Vec<_> =
                (0..4 * MOST as u32).map(|number| reference(number, random.in_cube().as_vec3())).collect();
            for number in 0..large {
                let half = Vec3::new(3.0, 0.0, 3.0 + number as f32);
                references[number * 1000].bounds = Bounds { min: -half, max: half };
            }
            let sizes = cut_and_check(&mut references);
            let alone = sizes.iter().filter(|&&(count, depth)| count == 1 && depth == 1).count();
            assert_eq!(alone, if large <= MOST_LARGE { large } else { 0 }, "{sizes:?}");
        }
    }

    #[test]
    fn triangles_that_no_plane_divides_are_cut_in_half() {
        for center in [Vec3::ZERO, Vec3::splat(f32::MAX)] {
            let mut references: Vec<_> = (0..5 * MOST as u32).map(|number| reference(number, center)).collect();
            let sizes = cut_and_check(&mut references);
            assert_eq!(sizes.len(), 8);
        }
    }

    #[test]
    fn ever_smaller_triangles_do_not_make_the_tree_deep() {
        fn depth(part: &Part<'_>) -> usize {
            match &part.content {
                Content::Chunk(_) => 0,
                Content::Pair(pair) => 1 + pair.iter().map(depth).max().unwrap_or(0),
            }
        }
        // 16 in each octave from 2^120 to 2^-120 and many in the next, so that each cut that costs least leaves all but some on one side.
        let octaves = (0..240).flat_map(|octave| [octave; 16]).chain([240; 4 * MOST]);
        let mut references: Vec<_> = octaves
            .enumerate()
            .map(|(number, octave)| {
                let size = libm::exp2f((120 - octave) as f32);
                let min = Vec3::X * (size * (1.0 + number as f32 / 1e6));
                Reference { bounds: Bounds { min, max: min + Vec3::splat(0.1 * size) }, primitive: number as u32 }
            })
            .collect();
        let deep = depth(&cut(&mut references, 0));
        assert!((EQUAL_DEPTH + 1..=EQUAL_DEPTH + 3).contains(&deep), "{deep}");
    }
}
