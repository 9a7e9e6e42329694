//! Sixteen rays through the tree together.
//!
//! Rays of a packet go into the same octant, along the same axis most, and parallel to none. A node's children are first
//! compared with the whole packet at once, by what the entry and exit of any of its rays can be at most (interval arithmetic; Boulos et
//! al., "Adaptive Ray Packet Reordering", 2008, and Wald et al., "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies",
//! 2007, have its history). Only when a child is next in turn are the sixteen rays compared with its box, with what
//! they have found by then. Where few rays are left, each goes on alone.

use std::mem::MaybeUninit;

use super::super::collapse::MOST_DEPTH;
use super::super::leaf::Room;
use super::super::node::{Child, NODE_SHIFT, Node, PLANE_BYTES, WIDTH};
use super::single::{Closest, Occluded, walk_from};
use super::{Rows, packet_leaf};
use crate::accel::wide::Tree;
use crate::geometry::ray::{Interval, PADDING, padded};
use crate::geometry::{Bounds, Hit, PreparedRay, Ray};

/// Rays of a packet.
pub const RAYS: usize = 16;

/// With no more rays than this in a box each goes on alone.
const FEW: u32 = 2;

/// Sixteen rays of one [`Signature`](super::batch::Signature), a lane each, and what they have found.
pub struct Packet<'a, L: Rows> {
    pub origin: [L::Row; 3],
    /// -1 / direction.
    pub inverse: [L::Row; 3],
    /// The same padded, for far planes.
    pub inverse_far: [L::Row; 3],
    /// Woop's shear; see [`PreparedRay`].
    pub shear: [L::Row; 2],
    /// The component of the direction along the last of `axes`.
    pub along: L::Row,
    pub t_min: L::Row,
    pub t_max: L::Row,
    /// The ray's part inside the instance's box, or all of it.
    pub clip_near: L::Row,
    pub clip_far: L::Row,
    /// The least t in the tree's space that can count.
    near: L::Row,
    /// The largest t in the tree's space that can count, given what was found.
    pub far: L::Row,
    pub best_t: L::Row,
    best_u: L::Row,
    best_v: L::Row,
    /// The rays whose best u and v are still to be computed, from the weights of B and C and the determinant of the first eight rays
    /// and of the last.
    pub unfinished: u32,
    pub best_weights: [[L::Double; 3]; 2],
    /// Integers.
    pub best_instance: L::Row,
    /// Integers.
    pub best_primitive: L::Row,
    /// A bit for each ray that still looks for something.
    pub alive: u32,
    /// Boxes that some of the rays met, and how many of these there were, all added up.
    pub boxes: u32,
    pub met: u32,
    pub axes: [usize; 3],
    /// The number that hits get.
    pub instance: u32,
    /// Whether rays have a clip interval.
    pub is_clipped: bool,
    /// In bytes from the lower plane of the first axis: the planes that rays enter and leave through.
    enter: [usize; 3],
    leave: [usize; 3],
    extremes: [Extremes; 3],
    asked: &'a Asked<'a>,
    /// The rays' places by lane.
    pub at: &'a [u16],
}

/// Rays, what they have found, and how.
pub struct Asked<'a> {
    pub rays: &'a [Ray],
    /// Of each ray, or empty.
    pub clips: &'a [Interval],
    /// The number that hits get.
    pub instance: u32,
}

/// Along an axis, of all rays: the origins whose distance to a plane ahead is least and largest, and the extremes of the
/// inverses.
#[derive(Clone, Copy)]
struct Extremes {
    origin_near: f32,
    origin_far: f32,
    inverse: [f32; 2],
    inverse_far: [f32; 2],
}

/// 32-bit words of a ray: origin, `t_min`, direction, `t_max`.
const WORDS_OF_RAY: i32 = (size_of::<Ray>() / 4) as i32;

/// The places of at most sixteen rays; lanes without a ray have the first one's.
#[inline(always)]
fn places(at: &[u16]) -> [i32; RAYS] {
    let mut places = [i32::from(at[0]); RAYS];
    for (place, &at) in places.iter_mut().zip(at) {
        *place = i32::from(at);
    }
    places
}

/// A lane of a row.
#[inline(always)]
fn lane<L: Rows>(row: &L::Row, lane: usize) -> f32 {
    const { assert!(size_of::<L::Row>() == RAYS * size_of::<f32>()) };
    assert!(lane < RAYS);
    // SAFETY: a row is sixteen numbers.
    unsafe { *(&raw const *row).cast::<f32>().add(lane) }
}

/// Sets a lane of a row.
#[inline(always)]
fn set_lane<L: Rows>(row: &mut L::Row, lane: usize, x: f32) {
    const { assert!(size_of::<L::Row>() == RAYS * size_of::<f32>()) };
    assert!(lane < RAYS);
    // SAFETY: as above.
    unsafe { *(&raw mut *row).cast::<f32>().add(lane) = x }
}

impl<'a, L: Rows> Packet<'a, L> {
    /// A packet of the at most sixteen rays at the places `at`, all of one signature.
    ///
    /// # Safety
    /// The processor has the instructions of `L`, and the places are within the rays.
    #[inline(always)]
    pub unsafe fn gather(asked: &'a Asked<'a>, at: &'a [u16], axes: [usize; 3], best: &[Hit]) -> Self {
        unsafe {
            let rows = L::row_gather(asked.rays.as_ptr().cast(), &places(at), WORDS_OF_RAY);
            Self::new(asked, at, axes, rows, best)
        }
    }

    /// The same with the rays' words.
    ///
    /// # Safety
    /// As for [`gather`](Self::gather).
    #[inline(always)]
    pub unsafe fn new(
        asked: &'a Asked<'a>,
        at: &'a [u16],
        axes: [usize; 3],
        [x, y, z, t_min, dx, dy, dz, t_max]: [L::Row; 8],
        best: &[Hit],
    ) -> Self {
        const HIT: i32 = (size_of::<Hit>() / 4) as i32;
        const CLIP: i32 = (size_of::<Interval>() / 4) as i32;
        unsafe {
            let (origin, direction) = ([x, y, z], [dx, dy, dz]);
            let one = L::row(1.0);
            let zero = L::row(0.0);
            // The same operations as in `PreparedRay`.
            let t_min = L::row_greater(t_min, zero);
            let [kx, ky, kz] = axes;
            let shear = [L::row_div(direction[kx], direction[kz]), L::row_div(direction[ky], direction[kz])];
            let mut inverse = [one; 3];
            let mut inverse_far = [one; 3];
            let mut extremes =
                [const { Extremes { origin_near: 0.0, origin_far: 0.0, inverse: [0.0; 2], inverse_far: [0.0; 2] } }; 3];
            let (mut enter, mut leave) = ([0; 3], [0; 3]);
            for axis in 0..3 {
                // Negated, since o - b is what can be computed straight from memory.
                inverse[axis] = L::row_sub(zero, L::row_div(one, direction[axis]));
                inverse_far[axis] = L::row_farther(inverse[axis], PADDING);
                let [least, most] = L::row_ends(origin[axis]);
                let negative = lane::<L>(&direction[axis], 0).is_sign_negative();
                let (origin_near, origin_far) = if negative { (least, most) } else { (most, least) };
                let inverse = L::row_ends(inverse[axis]);
                extremes[axis] = Extremes { origin_near, origin_far, inverse, inverse_far: inverse.map(padded) };
                let lower = 2 * axis * PLANE_BYTES;
                let side = if negative { PLANE_BYTES } else { 0 };
                (enter[axis], leave[axis]) = (lower + side, lower + (PLANE_BYTES - side));
            }
            let infinity = L::row(f32::INFINITY);
            let minus_infinity = L::row(f32::NEG_INFINITY);
            let miss = L::row(f32::from_bits(u32::MAX));
            let mut packet = Self {
                origin,
                inverse,
                inverse_far,
                shear,
                along: direction[kz],
                t_min,
                t_max,
                clip_near: minus_infinity,
                clip_far: infinity,
                near: t_min,
                far: t_max,
                best_t: infinity,
                best_u: zero,
                best_v: zero,
                unfinished: 0,
                best_weights: [[L::double(1.0); 3]; 2],
                best_instance: miss,
                best_primitive: miss,
                alive: (1 << at.len()) - 1,
                boxes: 0,
                met: 0,
                axes,
                instance: asked.instance,
                is_clipped: !asked.clips.is_empty(),
                enter,
                leave,
                extremes,
                asked,
                at,
            };
            if !best.is_empty() {
                let [t, u, v, instance, primitive] = L::row_gather(best.as_ptr().cast(), &places(at), HIT);
                (packet.best_t, packet.best_u, packet.best_v) = (t, u, v);
                (packet.best_instance, packet.best_primitive) = (instance, primitive);
            }
            if packet.is_clipped {
                let [near, far] = L::row_gather(asked.clips.as_ptr().cast(), &places(at), CLIP);
                (packet.clip_near, packet.clip_far) = (near, far);
                packet.near = L::row_select(L::row_at_most(t_min, near), t_min, minus_infinity);
            }
            packet.update_far();
            packet
        }
    }

    /// Through which planes of a box rays enter and leave along an axis.
    #[inline(always)]
    pub fn planes(&self, axis: usize, bounds: &Bounds) -> (f32, f32) {
        let (min, max) = (bounds.min[axis], bounds.max[axis]);
        if self.enter[axis] < self.leave[axis] { (min, max) } else { (max, min) }
    }

    /// Computes u and v where that was put off.
    ///
    /// # Safety
    /// The processor has the instructions of `L`.
    #[inline(always)]
    pub unsafe fn finish(&mut self) {
        unsafe {
            let mut halves = [[L::splat(0.0); 2]; 2];
            for (half, [weight_b, weight_c, determinant]) in self.best_weights.into_iter().enumerate() {
                halves[0][half] = L::narrow(L::double_div(weight_b, determinant));
                halves[1][half] = L::narrow(L::double_div(weight_c, determinant));
            }
            let [[first_u, last_u], [first_v, last_v]] = halves;
            // + 0 turns -0 into 0
            let u = L::row_add(L::join(first_u, last_u), L::row(0.0));
            let v = L::row_add(L::join(first_v, last_v), L::row(0.0));
            self.best_u = L::row_select(self.unfinished, self.best_u, u);
            self.best_v = L::row_select(self.unfinished, self.best_v, v);
            self.unfinished = 0;
        }
    }

    /// What a ray has found, once u and v are [finished](Self::finish).
    #[inline(always)]
    pub fn best(&self, number: usize) -> Hit {
        Hit {
            t: lane::<L>(&self.best_t, number),
            u: lane::<L>(&self.best_u, number),
            v: lane::<L>(&self.best_v, number),
            instance: lane::<L>(&self.best_instance, number).to_bits(),
            primitive: lane::<L>(&self.best_primitive, number).to_bits(),
        }
    }

    /// Instance and primitive of what a ray has found.
    #[inline(always)]
    pub fn best_place(&self, number: usize) -> (u32, u32) {
        (lane::<L>(&self.best_instance, number).to_bits(), lane::<L>(&self.best_primitive, number).to_bits())
    }

    /// Takes what a ray has found alone.
    #[inline(always)]
    fn set_best(&mut self, number: usize, best: &Hit) {
        self.unfinished &= !(1 << number);
        set_lane::<L>(&mut self.best_t, number, best.t);
        set_lane::<L>(&mut self.best_u, number, best.u);
        set_lane::<L>(&mut self.best_v, number, best.v);
        set_lane::<L>(&mut self.best_instance, number, f32::from_bits(best.instance));
        set_lane::<L>(&mut self.best_primitive, number, f32::from_bits(best.primitive));
    }

    /// As [`PreparedRay::far_bound`].
    ///
    /// # Safety
    /// The processor has the instructions of `L`.
    #[inline(always)]
    pub unsafe fn update_far(&mut self) {
        unsafe {
            let (mut within, mut best) = (self.t_max, self.best_t);
            if self.is_clipped {
                let infinity = L::row(f32::INFINITY);
                within = L::row_select(L::row_at_most(self.clip_far, within), within, infinity);
                best = L::row_select(L::row_at_most(self.clip_far, best), best, infinity);
            }
            self.far = L::row_lesser(best, within);
        }
    }

    /// The largest t at which any ray can still find something.
    #[inline(always)]
    unsafe fn farthest(&self) -> f32 {
        // SAFETY: as the caller promises.
        unsafe { L::row_ends(self.far)[1] }
    }

    fn prepared(&self, number: usize) -> Option<PreparedRay> {
        let at = usize::from(self.at[number]);
        PreparedRay::clipped(&self.asked.rays[at], self.asked.clips.get(at))
    }
}

/// A child to be visited, and where its box is.
#[derive(Clone, Copy)]
struct Pending {
    /// Where a ray may enter it at the earliest, then the child, as for single rays.
    entry: u64,
    /// The lane of the planes of the first axis.
    planes: *const f32,
}

/// Each node on the way down leaves at most all children behind, since the nearest is put on the stack as well.
const STACK: usize = (MOST_DEPTH + 1) * WIDTH + 1;

/// Searches the tree for the first hit of every ray, or for any if `ANY`; rays that have found one are no longer alive then.
///
/// # Safety
/// The processor has the instructions of `L`, and the children of `tree` are in range, at most [`MOST_DEPTH`] deep.
#[inline(always)]
pub unsafe fn walk<L: Rows, const ANY: bool>(tree: &Tree, packet: &mut Packet<'_, L>) {
    unsafe {
        if tree.root == Child::NONE {
            return;
        }
        let nodes: *const Node = tree.nodes.as_ptr();
        let mut room = Room::uninit();
        let [least, _] = L::row_ends(packet.near);
        let mut farthest = packet.farthest();
        let mut stack = [const { MaybeUninit::<Pending>::uninit() }; STACK];
        let stack: *mut Pending = stack.as_mut_ptr().cast();
        let mut height = 0;
        let mut current = tree.root;
        let mut lanes = packet.alive;
        loop {
            if current.is_leaf() {
                let numbers = tree.leaves.laid_out(current, &mut room);
                packet_leaf::meet::<L, ANY>(numbers, current.count(), packet, lanes);
                if ANY && packet.alive == 0 {
                    return;
                }
                farthest = packet.farthest();
            } else {
                let node: *const Node = nodes.byte_add(current.number() << NODE_SHIFT);
                let planes: *const f32 = (&raw const (*node).planes).cast();
                let mut first = L::splat(least);
                let mut last = L::splat(farthest);
                for axis in 0..3 {
                    let extremes = &packet.extremes[axis];
                    let entry = L::sub(L::splat(extremes.origin_near), L::load(planes.byte_add(packet.enter[axis])));
                    let [a, b] = extremes.inverse;
                    first = L::greater(L::lesser(L::mul(entry, L::splat(a)), L::mul(entry, L::splat(b))), first);
                    let exit = L::sub(L::splat(extremes.origin_far), L::load(planes.byte_add(packet.leave[axis])));
                    let [a, b] = extremes.inverse_far;
                    last = L::lesser(L::greater(L::mul(exit, L::splat(a)), L::mul(exit, L::splat(b))), last);
                }
                let mut crossed = L::at_most(first, last);
                let mut nears = MaybeUninit::<[f32; WIDTH]>::uninit();
                let nears: *mut f32 = nears.as_mut_ptr().cast();
                L::store(nears, first);
                let children = (&raw const (*node).children).cast::<Child>();
                let base = height;
                while crossed != 0 {
                    let lane = crossed.trailing_zeros() as usize;
                    crossed &= crossed - 1;
                    let entry = u64::from((*nears.add(lane)).to_bits()) << 32 | u64::from((*children.add(lane)).0);
                    // The nearest last.
                    let mut at = height;
                    height += 1;
                    while !ANY && at > base && (*stack.add(at - 1)).entry < entry {
                        *stack.add(at) = *stack.add(at - 1);
                        at -= 1;
                    }
                    stack.add(at).write(Pending { entry, planes: planes.add(lane) });
                }
            }
            // What is next that rays meet?
            loop {
                if height == 0 {
                    return;
                }
                height -= 1;
                let top = *stack.add(height);
                if f32::from_bits((top.entry >> 32) as u32) > farthest {
                    continue;
                }
                let (mut first, mut last) = (packet.near, packet.far);
                for axis in 0..3 {
                    let entry = L::row_sub(packet.origin[axis], L::row(*top.planes.byte_add(packet.enter[axis])));
                    first = L::row_greater(L::row_mul(entry, packet.inverse[axis]), first);
                    let exit = L::row_sub(packet.origin[axis], L::row(*top.planes.byte_add(packet.leave[axis])));
                    last = L::row_lesser(L::row_mul(exit, packet.inverse_far[axis]), last);
                }
                lanes = L::row_at_most(first, last) & packet.alive;
                if lanes == 0 {
                    continue;
                }
                current = Child(top.entry as u32);
                packet.boxes += 1;
                packet.met += lanes.count_ones();
                if lanes.count_ones() > FEW {
                    break;
                }
                alone::<L, ANY>(tree, current, packet, lanes);
                if ANY && packet.alive == 0 {
                    return;
                }
                farthest = packet.farthest();
            }
        }
    }
}

/// Lets some rays of a packet search below a child one by one.
///
/// # Safety
/// As for [`walk`].
#[inline(always)]
unsafe fn alone<L: Rows, const ANY: bool>(tree: &Tree, child: Child, packet: &mut Packet<'_, L>, mut lanes: u32) {
    unsafe {
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(ray) = packet.prepared(lane) else { continue };
            if ANY {
                let mut query = Occluded { found: false };
                walk_from::<L, Occluded>(tree, child, &ray, &mut query);
                packet.alive &= !(u32::from(query.found) << lane);
            } else {
                let before = packet.best(lane);
                let mut best = before;
                walk_from::<L, Closest<&mut Hit>>(
                    tree,
                    child,
                    &ray,
                    &mut Closest { instance: packet.instance, best: &mut best },
                );
                if best.key() != before.key() {
                    packet.set_best(lane, &best);
                }
            }
        }
        if !ANY {
            packet.update_far();
        }
    }
}
