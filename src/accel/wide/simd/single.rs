//! One ray through the tree.

use std::borrow::BorrowMut;
use std::mem::MaybeUninit;

use super::super::collapse::MOST_DEPTH;
use super::super::leaf::Room;
use super::super::node::{Child, NODE_SHIFT, Node, PLANE_BYTES, WIDTH};
use super::{Lanes, Level, Portable, Set};
use crate::accel::wide::Tree;
use crate::geometry::ray::Interval;
use crate::geometry::{Hit, Key, PreparedRay, Ray, TriangleHit};

/// What a search looks for. The ends of the interval of t are in the space of the tree.
pub trait Query {
    /// Whether nearer children should come first.
    const NEAR_FIRST: bool;

    /// The least t that counts.
    fn near(&self, ray: &PreparedRay) -> f32;

    /// The largest t that still counts.
    fn far(&self, ray: &PreparedRay) -> f32;

    /// Takes note of a hit; true ends the search.
    fn offer(&mut self, hit: TriangleHit, primitive: u32) -> bool;
}

/// The first hit.
pub struct Closest<B> {
    /// The number to put into hits.
    pub instance: u32,
    /// The best so far, here or elsewhere.
    pub best: B,
}

impl<B: BorrowMut<Hit>> Query for Closest<B> {
    const NEAR_FIRST: bool = true;

    #[inline(always)]
    fn near(&self, ray: &PreparedRay) -> f32 {
        ray.lower_bound(ray.t_min)
    }

    #[inline(always)]
    fn far(&self, ray: &PreparedRay) -> f32 {
        ray.far_bound(self.best.borrow().t)
    }

    #[inline(always)]
    fn offer(&mut self, hit: TriangleHit, primitive: u32) -> bool {
        let hit = Hit { t: hit.t, u: hit.u, v: hit.v, instance: self.instance, primitive };
        let best = self.best.borrow_mut();
        if hit.key().is_before(&best.key()) {
            *best = hit;
        }
        false
    }
}

/// The first hit after a key.
pub struct NextAfter<'a> {
    /// What comes before the hit.
    pub key: Key,
    /// The search among the others.
    pub closest: Closest<&'a mut Hit>,
}

impl Query for NextAfter<'_> {
    const NEAR_FIRST: bool = true;

    #[inline(always)]
    fn near(&self, ray: &PreparedRay) -> f32 {
        self.closest.near(ray).max(ray.lower_bound(self.key.t))
    }

    #[inline(always)]
    fn far(&self, ray: &PreparedRay) -> f32 {
        self.closest.far(ray)
    }

    #[inline(always)]
    fn offer(&mut self, hit: TriangleHit, primitive: u32) -> bool {
        let key = Key { t: hit.t, instance: self.closest.instance, primitive };
        self.key.is_before(&key) && self.closest.offer(hit, primitive)
    }
}

/// Whether there is a hit.
pub struct Occluded {
    /// The answer.
    pub found: bool,
}

impl Query for Occluded {
    const NEAR_FIRST: bool = false;

    #[inline(always)]
    fn near(&self, ray: &PreparedRay) -> f32 {
        ray.lower_bound(ray.t_min)
    }

    #[inline(always)]
    fn far(&self, ray: &PreparedRay) -> f32 {
        ray.upper_bound(ray.t_max)
    }

    #[inline(always)]
    fn offer(&mut self, _: TriangleHit, _: u32) -> bool {
        self.found = true;
        true
    }
}

/// Searches the tree with the instructions of a level.
#[inline(always)]
pub fn search<Q: Query>(level: Level, tree: &Tree, ray: &PreparedRay, query: &mut Q) {
    // SAFETY: the processor has the level's instructions, and the tree's children are in range.
    unsafe {
        match level.set() {
            Set::Portable => walk::<Portable, Q>(tree, ray, query),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => walk_avx2(tree, ray, query),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => walk_avx512(tree, ray, query),
        }
    }
}

/// The same for a ray that is not prepared: that is done with the level's instructions as well, and what is prepared stays in
/// registers.
#[inline(always)]
pub fn search_alone<Q: Query>(level: Level, tree: &Tree, ray: &Ray, query: &mut Q) {
    // SAFETY: as above.
    unsafe {
        match level.set() {
            Set::Portable => prepare_and_walk::<Portable, Q>(tree, ray, None, query),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => prepare_and_walk_avx2(tree, ray, query),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => prepare_and_walk_avx512(tree, ray, query),
        }
    }
}

/// # Safety
/// As for [`walk`].
#[inline(always)]
pub unsafe fn prepare_and_walk<L: Lanes, Q: Query>(tree: &Tree, ray: &Ray, clip: Option<&Interval>, query: &mut Q) {
    if let Some(ray) = PreparedRay::clipped(ray, clip) {
        // SAFETY: as the caller promises.
        unsafe { walk::<L, Q>(tree, &ray, query) }
    }
}

/// The searches compiled for an instruction set.
#[cfg(target_arch = "x86_64")]
macro_rules! compile {
    ($lanes:ty, $features:literal, $walk:ident, $prepare_and_walk:ident) => {
        #[target_feature(enable = $features)]
        unsafe fn $walk<Q: Query>(tree: &Tree, ray: &PreparedRay, query: &mut Q) {
            // SAFETY: as the caller promises.
            unsafe { walk::<$lanes, Q>(tree, ray, query) }
        }

        #[target_feature(enable = $features)]
        unsafe fn $prepare_and_walk<Q: Query>(tree: &Tree, ray: &Ray, query: &mut Q) {
            // SAFETY: as the caller promises.
            unsafe { prepare_and_walk::<$lanes, Q>(tree, ray, None, query) }
        }
    };
}
#[cfg(target_arch = "x86_64")]
compile!(super::avx::Avx2, "avx2,bmi1", walk_avx2, prepare_and_walk_avx2);
#[cfg(target_arch = "x86_64")]
compile!(super::avx::Avx512, "avx512f,avx512vl,avx512dq,bmi1", walk_avx512, prepare_and_walk_avx512);

/// A child to be visited, with where the ray enters it in the upper half: larger is farther, for what is not negative.
type Entry = u64;

#[inline(always)]
fn entry(near: f32, child: Child) -> Entry {
    u64::from(near.to_bits()) << 32 | u64::from(child.0)
}

#[inline(always)]
fn entry_near(entry: Entry) -> f32 {
    f32::from_bits((entry >> 32) as u32)
}

#[inline(always)]
fn entry_child(entry: Entry) -> Child {
    Child(entry as u32)
}

/// Each node on the way down leaves at most all children but one behind.
const STACK: usize = (MOST_DEPTH + 1) * (WIDTH - 1) + 1;

/// # Safety
/// The processor has the instructions of `L`, and the children of `tree` are in range, at most [`MOST_DEPTH`] deep.
#[inline(always)]
pub unsafe fn walk<L: Lanes, Q: Query>(tree: &Tree, ray: &PreparedRay, query: &mut Q) {
    // SAFETY: as the caller promises.
    unsafe {
        // Without an infinite inverse no product can be NaN: 0 times infinity does not occur.
        if ray.inverse.is_finite() {
            walk_nodes::<L, Q, false>(tree, tree.root, ray, query);
        } else {
            walk_nodes::<L, Q, true>(tree, tree.root, ray, query);
        }
    }
}

/// The same from a child on, for a ray that is parallel to no axis.
///
/// # Safety
/// As for [`walk`]; the child is one of the tree's.
#[inline(always)]
pub unsafe fn walk_from<L: Lanes, Q: Query>(tree: &Tree, child: Child, ray: &PreparedRay, query: &mut Q) {
    // SAFETY: as the caller promises.
    unsafe { walk_nodes::<L, Q, false>(tree, child, ray, query) }
}

/// A ray as boxes are compared with it, spread over lanes.
struct Spread<L: Lanes> {
    near: L::Vector,
    origin: [L::Vector; 3],
    /// (o - b) (-1/d) is (b - o) (1/d) but for the sign of a zero, and subtracts straight from memory.
    inverse: [L::Vector; 3],
    inverse_far: [L::Vector; 3],
    sides: Sides,
}

/// In bytes from a node's first: the planes that a ray enters and leaves through.
#[derive(Clone, Copy)]
pub struct Sides {
    enter: [usize; 3],
    leave: [usize; 3],
}

impl Sides {
    /// Those of a ray.
    #[inline(always)]
    pub fn new(ray: &PreparedRay) -> Self {
        let mut sides = Self { enter: [0; 3], leave: [0; 3] };
        for axis in 0..3 {
            let lower = 2 * axis * PLANE_BYTES;
            let side = if ray.is_negative(axis) { PLANE_BYTES } else { 0 };
            (sides.enter[axis], sides.leave[axis]) = (lower + side, lower + (PLANE_BYTES - side));
        }
        sides
    }
}

impl<L: Lanes> Spread<L> {
    #[inline(always)]
    unsafe fn new(ray: &PreparedRay, near: f32, sides: Sides) -> Self {
        // SAFETY: as the caller promises.
        unsafe {
            let (inverse, inverse_far) = (-ray.inverse, -ray.inverse_far);
            Self {
                near: L::splat(near),
                origin: [L::splat(ray.origin.x), L::splat(ray.origin.y), L::splat(ray.origin.z)],
                inverse: [L::splat(inverse.x), L::splat(inverse.y), L::splat(inverse.z)],
                inverse_far: [L::splat(inverse_far.x), L::splat(inverse_far.y), L::splat(inverse_far.z)],
                sides,
            }
        }
    }
}

/// Compares a ray with the boxes of a node's children: returns the nearest that it meets, or [`Child::NONE`], and puts the others on
/// the stack, in order if the query wants that. `PARALLEL` tells that the ray may run along an axis.
///
/// # Safety
/// As for [`walk`]; the stack has room for [`WIDTH`] more.
#[inline(always)]
unsafe fn visit<L: Lanes, Q: Query, const PARALLEL: bool>(
    node: &Node,
    ray: &Spread<L>,
    far: f32,
    stack: *mut Entry,
    height: &mut usize,
) -> Child {
    unsafe {
        let planes: *const f32 = node.planes.as_ptr().cast();
        let mut entries = [ray.near; 3];
        let mut exits = [ray.near; 3];
        for axis in 0..3 {
            let entry = L::sub(ray.origin[axis], L::load(planes.byte_add(ray.sides.enter[axis])));
            let exit = L::sub(ray.origin[axis], L::load(planes.byte_add(ray.sides.leave[axis])));
            entries[axis] = L::mul(entry, ray.inverse[axis]);
            exits[axis] = L::mul(exit, ray.inverse_far[axis]);
        }
        let ([x, y, z], [u, v, w]) = (entries, exits);
        let far_lanes = L::splat(far);
        let (first, last) = if PARALLEL {
            // One by one, since a NaN must leave the running bound as it is.
            (L::greater(z, L::greater(y, L::greater(x, ray.near))), L::lesser(w, L::lesser(v, L::lesser(u, far_lanes))))
        } else {
            // In pairs, which is sooner done.
            (L::greater(L::greater(x, y), L::greater(z, ray.near)), L::lesser(L::lesser(u, v), L::lesser(w, far_lanes)))
        };
        let mut crossed = L::at_most(first, last);
        if crossed == 0 {
            return Child::NONE;
        }
        let children = node.children.as_ptr();
        let lane = crossed.trailing_zeros() as usize;
        crossed &= crossed - 1;
        let child = *children.add(lane);
        if crossed == 0 {
            return child;
        }
        let mut nears = MaybeUninit::<[f32; WIDTH]>::uninit();
        let nears: *mut f32 = nears.as_mut_ptr().cast();
        L::store(nears, first);
        let one = entry(*nears.add(lane), child);
        let lane = crossed.trailing_zeros() as usize;
        crossed &= crossed - 1;
        let other = entry(*nears.add(lane), *children.add(lane));
        if !Q::NEAR_FIRST {
            stack.add(*height).write(other);
            *height += 1;
            while crossed != 0 {
                let lane = crossed.trailing_zeros() as usize;
                crossed &= crossed - 1;
                stack.add(*height).write(entry(*nears.add(lane), *children.add(lane)));
                *height += 1;
            }
            return entry_child(one);
        }
        // The nearest is next; the others go on the stack in order.
        let (mut next, farther) = (one.min(other), one.max(other));
        let base = *height;
        stack.add(*height).write(farther);
        *height += 1;
        while crossed != 0 {
            let lane = crossed.trailing_zeros() as usize;
            crossed &= crossed - 1;
            let one = entry(*nears.add(lane), *children.add(lane));
            let farther = one.max(next);
            next = one.min(next);
            let mut at = *height;
            *height += 1;
            while at > base && *stack.add(at - 1) < farther {
                *stack.add(at) = *stack.add(at - 1);
                at -= 1;
            }
            stack.add(at).write(farther);
        }
        entry_child(next)
    }
}

/// Takes the next child that may still count from the stack; [`Child::NONE`] if there is none.
///
/// # Safety
/// The stack holds `height` entries.
#[inline(always)]
unsafe fn pop(stack: *const Entry, height: &mut usize, far: f32) -> Child {
    while *height > 0 {
        *height -= 1;
        // SAFETY: as the caller promises.
        let top = unsafe { *stack.add(*height) };
        if entry_near(top) <= far {
            return entry_child(top);
        }
    }
    Child::NONE
}

/// The search; `PARALLEL` tells that the ray may run along an axis.
///
/// # Safety
/// As for [`walk`].
#[inline(always)]
unsafe fn walk_nodes<L: Lanes, Q: Query, const PARALLEL: bool>(
    tree: &Tree,
    start: Child,
    ray: &PreparedRay,
    query: &mut Q,
) {
    unsafe {
        let nodes: *const Node = tree.nodes.as_ptr();
        let mut room = Room::uninit();
        let spread = Spread::<L>::new(ray, query.near(ray), Sides::new(ray));
        let mut far = query.far(ray);
        let mut stack = [const { MaybeUninit::<Entry>::uninit() }; STACK];
        let stack: *mut Entry = stack.as_mut_ptr().cast();
        let mut height = 0;
        let mut current = start;
        while current != Child::NONE {
            if current.is_leaf() {
                if L::meet_leaf(tree.leaves.laid_out(current, &mut room), current.count(), ray, query) {
                    return;
                }
                far = query.far(ray);
            } else {
                let node = &*nodes.byte_add(current.number() << NODE_SHIFT);
                current = visit::<L, Q, PARALLEL>(node, &spread, far, stack, &mut height);
                if current != Child::NONE {
                    continue;
                }
            }
            current = pop(stack, &mut height, far);
        }
    }
}

/// A search on its way, in turns with others: what it found, its ray and where it is.
pub struct Flight<Q> {
    /// What it looks for.
    pub query: Q,
    ray: PreparedRay,
    near: f32,
    far: f32,
    sides: Sides,
    /// [`Child::NONE`] once it has ended.
    current: Child,
    height: usize,
    stack: [MaybeUninit<Entry>; STACK],
}

impl<Q: Query> Flight<Q> {
    /// Puts a search at the root of a tree. The ray must not run along an axis.
    #[inline(always)]
    pub fn begin(place: &mut MaybeUninit<Self>, tree: &Tree, ray: PreparedRay, query: Q) {
        debug_assert!(ray.inverse.is_finite());
        let (near, far, sides) = (query.near(&ray), query.far(&ray), Sides::new(&ray));
        let place = place.as_mut_ptr();
        // SAFETY: all but the stack, which needs none, gets a value.
        unsafe {
            (&raw mut (*place).query).write(query);
            (&raw mut (*place).ray).write(ray);
            (&raw mut (*place).near).write(near);
            (&raw mut (*place).far).write(far);
            (&raw mut (*place).sides).write(sides);
            (&raw mut (*place).current).write(tree.root);
            (&raw mut (*place).height).write(0);
        }
    }

    /// Goes on by one node or leaf, and asks memory for the next; false once the search has ended.
    ///
    /// # Safety
    /// As for [`walk`].
    #[inline(always)]
    pub unsafe fn step<L: Lanes>(&mut self, tree: &Tree) -> bool {
        unsafe {
            let nodes: *const Node = tree.nodes.as_ptr();
            let stack: *mut Entry = self.stack.as_mut_ptr().cast();
            if self.current == Child::NONE {
                return false;
            }
            let mut next = Child::NONE;
            if self.current.is_leaf() {
                let mut room = Room::uninit();
                let numbers = tree.leaves.laid_out(self.current, &mut room);
                if L::meet_leaf(numbers, self.current.count(), &self.ray, &mut self.query) {
                    return false;
                }
                self.far = self.query.far(&self.ray);
            } else {
                let node = &*nodes.byte_add(self.current.number() << NODE_SHIFT);
                let spread = Spread::<L>::new(&self.ray, self.near, self.sides);
                next = visit::<L, Q, false>(node, &spread, self.far, stack, &mut self.height);
            }
            if next == Child::NONE {
                next = pop(stack, &mut self.height, self.far);
            }
            self.current = next;
            if next == Child::NONE {
                return false;
            }
            let (from, lines) = if next.is_leaf() {
                let (from, words) = tree.leaves.stored(next);
                (from.cast::<u8>(), (words * size_of::<u32>()).div_ceil(LINE))
            } else {
                (nodes.byte_add(next.number() << NODE_SHIFT).cast(), size_of::<Node>() / LINE)
            };
            for line in 0..lines {
                L::prefetch(from.add(line * LINE));
            }
            true
        }
    }
}

/// Bytes that memory is asked for at once.
const LINE: usize = 64;
