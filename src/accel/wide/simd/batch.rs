//! Many rays at once: those that go alike together in packets, the others one by one.

use std::cell::Cell;
use std::mem::MaybeUninit;

use super::packet::{Asked, Packet, RAYS};
use super::single::{Closest, Flight, Occluded, Query};
use super::{Lanes, Level, Portable, Rows, Set};
use crate::accel::wide::Tree;
use crate::geometry::ray::{AXES, Interval, largest_axis};
use crate::geometry::{Hit, PreparedRay, Ray};

/// Rays among which those that go alike are looked for.
const CHUNK: usize = 1024;

/// Searches that take turns, each while the others wait for memory.
const FLIGHTS: usize = 8;

/// Fewer rays that go alike are no packet.
const LEAST: usize = 4;

/// Which packets a ray may be in: the octant that it goes into, and the axis along which it goes most; [`ALONE`] for rays that
/// go parallel to an axis or nearly so, or meet nothing.
type Signature = u8;

/// For no packet.
const ALONE: Signature = 24;

/// A component of the direction that is smaller has no place in a packet: no product with its inverse must be NaN.
const PARALLEL: f32 = f32::from_bits((127 - 100) << 23);

#[inline(always)]
fn signature(ray: &Ray) -> Signature {
    let d = ray.direction.abs().to_array();
    let goes = (d[0] >= PARALLEL) & (d[1] >= PARALLEL) & (d[2] >= PARALLEL) & ray.is_valid();
    let packet = 3 * ray.direction.is_negative_bitmask() as u8 + largest_axis(d) as u8;
    if goes { packet } else { ALONE }
}

/// Whether packets are worth their while: told by how many of their rays meet a box together, tried again from time to time.
struct Coherence {
    /// Packets whose rays go alone before the next one is tried.
    alone: u32,
    /// The last packet was not worth it.
    failed: bool,
}

impl Coherence {
    /// A packet whose rays meet boxes with fewer than this many together is slower than they are alone.
    const LEAST_MET: u32 = 6;

    /// Packets whose rays go alone after two in a row that were not worth it.
    const PAUSE: u32 = 30;

    fn new() -> Self {
        Self { alone: 0, failed: false }
    }

    /// Whether to try a packet.
    #[inline(always)]
    fn tries(&mut self) -> bool {
        let tries = self.alone == 0;
        self.alone = self.alone.saturating_sub(1);
        tries
    }

    /// Takes note of a packet.
    #[inline(always)]
    fn saw(&mut self, boxes: u32, met: u32) {
        let fails = met < Self::LEAST_MET * boxes;
        let pauses = fails && self.failed;
        if pauses {
            self.alone = Self::PAUSE;
        }
        self.failed = fails && !pauses;
    }
}

/// The first hits of rays: each replaces the one at the same place in `best` if it comes before that.
#[inline(always)]
pub fn closest_batch(level: Level, tree: &Tree, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
    assert!(rays.len() == best.len() && (clips.is_empty() || clips.len() == rays.len()), "one of each a ray");
    // SAFETY: the processor has the level's instructions, and the tree's children are in range.
    unsafe {
        match level.set() {
            Set::Portable => closest::<Portable>(tree, rays, clips, instance, best),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => closest_avx2(tree, rays, clips, instance, best),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => closest_avx512(tree, rays, clips, instance, best),
        }
    }
}

/// Sets the flags of rays that hit anything; rays whose flag is set already are left out.
#[inline(always)]
pub fn occluded_batch(level: Level, tree: &Tree, rays: &[Ray], clips: &[Interval], found: &mut [bool]) {
    assert!(rays.len() == found.len() && (clips.is_empty() || clips.len() == rays.len()), "one of each a ray");
    // SAFETY: as above.
    unsafe {
        match level.set() {
            Set::Portable => occluded::<Portable>(tree, rays, clips, found),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => occluded_avx2(tree, rays, clips, found),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => occluded_avx512(tree, rays, clips, found),
        }
    }
}

#[cfg(target_arch = "x86_64")]
macro_rules! compile {
    ($lanes:ty, $features:literal, $closest:ident, $occluded:ident) => {
        #[target_feature(enable = $features)]
        unsafe fn $closest(tree: &Tree, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
            // SAFETY: as the caller promises.
            unsafe { closest::<$lanes>(tree, rays, clips, instance, best) }
        }

        #[target_feature(enable = $features)]
        unsafe fn $occluded(tree: &Tree, rays: &[Ray], clips: &[Interval], found: &mut [bool]) {
            // SAFETY: as the caller promises.
            unsafe { occluded::<$lanes>(tree, rays, clips, found) }
        }
    };
}
#[cfg(target_arch = "x86_64")]
compile!(super::avx::Avx2, "avx2,bmi1,popcnt", closest_avx2, occluded_avx2);
#[cfg(target_arch = "x86_64")]
compile!(super::avx::Avx512, "avx512f,avx512vl,avx512dq,bmi1,popcnt", closest_avx512, occluded_avx512);

/// # Safety
/// The processor has the instructions of `L`, and the tree's children are in range.
#[inline(always)]
unsafe fn closest<L: Rows>(tree: &Tree, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
    let mut coherence = Coherence::new();
    for (number, (rays, best)) in rays.chunks(CHUNK).zip(best.chunks_mut(CHUNK)).enumerate() {
        let clips = if clips.is_empty() { clips } else { &clips[number * CHUNK..number * CHUNK + rays.len()] };
        let asked = Asked { rays, clips, instance };
        // SAFETY, of each block: as the caller promises; places are within the chunk.
        let mut rest = Places::new();
        for start in (0..rays.len()).step_by(RAYS) {
            let together = unsafe { Together::<L>::new(rays, start).filter(|_| coherence.tries()) };
            let Some(Together { at, axes, rows }) = together else {
                rest.extend(start, rays.len());
                continue;
            };
            let fresh = best[start..start + RAYS].iter().all(|hit| !hit.is_hit());
            unsafe {
                let packet = Packet::<L>::new(&asked, &at, axes, rows, if fresh { &[] } else { best });
                find_first(tree, packet, best, &mut coherence);
            }
        }
        let sorted = Sorted::new(rays, &rest);
        let mut scattered = Marks::new();
        for (signature, at) in sorted.packets() {
            if signature == ALONE {
                for &at in at {
                    let at = usize::from(at);
                    unsafe { L::search(tree, &rays[at], clips.get(at), &mut Closest { instance, best: &mut best[at] }) }
                }
                continue;
            }
            if at.len() < LEAST || !coherence.tries() {
                scattered.extend(at);
                continue;
            }
            unsafe {
                let packet = Packet::<L>::gather(&asked, at, AXES[usize::from(signature % 3)], best);
                find_first(tree, packet, best, &mut coherence);
            }
        }
        let best = Cell::from_mut(best).as_slice_of_cells();
        let searches = scattered.iter().map(|at| (at, Closest { instance, best: best[at].get() }));
        unsafe {
            search_scattered::<L, Closest<Hit>>(tree, rays, clips, searches, |at, query| best[at].set(query.best));
        }
    }
}

/// # Safety
/// As for [`closest`].
#[inline(always)]
unsafe fn occluded<L: Rows>(tree: &Tree, rays: &[Ray], clips: &[Interval], found: &mut [bool]) {
    let mut coherence = Coherence::new();
    for (number, (rays, found)) in rays.chunks(CHUNK).zip(found.chunks_mut(CHUNK)).enumerate() {
        let clips = if clips.is_empty() { clips } else { &clips[number * CHUNK..number * CHUNK + rays.len()] };
        let asked = Asked { rays, clips, instance: 0 };
        // SAFETY, of each block: as the caller promises; places are within the chunk.
        let mut rest = Places::new();
        for start in (0..rays.len()).step_by(RAYS) {
            let end = (start + RAYS).min(rays.len());
            let together = if found[start..end].contains(&true) {
                None
            } else {
                unsafe { Together::<L>::new(rays, start).filter(|_| coherence.tries()) }
            };
            match together {
                Some(Together { at, axes, rows }) => {
                    let packet = unsafe { Packet::<L>::new(&asked, &at, axes, rows, &[]) };
                    unsafe { find_any(tree, packet, found, &mut coherence) }
                }
                None => (start..end).filter(|&at| !found[at]).for_each(|at| rest.push(at)),
            }
        }
        let sorted = Sorted::new(rays, &rest);
        let mut scattered = Marks::new();
        for (signature, at) in sorted.packets() {
            if signature == ALONE {
                for &at in at {
                    let at = usize::from(at);
                    let mut query = Occluded { found: false };
                    unsafe { L::search(tree, &rays[at], clips.get(at), &mut query) }
                    found[at] = query.found;
                }
                continue;
            }
            if at.len() < LEAST || !coherence.tries() {
                scattered.extend(at);
                continue;
            }
            unsafe {
                let packet = Packet::<L>::gather(&asked, at, AXES[usize::from(signature % 3)], &[]);
                find_any(tree, packet, found, &mut coherence);
            }
        }
        let searches = scattered.iter().map(|at| (at, Occluded { found: false }));
        unsafe {
            search_scattered::<L, Occluded>(tree, rays, clips, searches, |at, query| found[at] = query.found);
        }
    }
}

/// # Safety
/// As for [`closest`]; the packet's places are within `best`.
#[inline(always)]
unsafe fn find_first<L: Rows>(tree: &Tree, mut packet: Packet<'_, L>, best: &mut [Hit], coherence: &mut Coherence) {
    // SAFETY: as the caller promises.
    unsafe {
        L::walk_packet::<false>(tree, &mut packet);
        packet.finish();
    }
    coherence.saw(packet.boxes, packet.met);
    for (lane, &at) in packet.at.iter().enumerate() {
        best[usize::from(at)] = packet.best(lane);
    }
}

/// # Safety
/// As for [`closest`]; the packet's places are within `found`.
#[inline(always)]
unsafe fn find_any<L: Rows>(tree: &Tree, mut packet: Packet<'_, L>, found: &mut [bool], coherence: &mut Coherence) {
    // SAFETY: as the caller promises.
    unsafe { L::walk_packet::<true>(tree, &mut packet) }
    coherence.saw(packet.boxes, packet.met);
    for (lane, &at) in packet.at.iter().enumerate() {
        found[usize::from(at)] = packet.alive >> lane & 1 == 0;
    }
}

/// Searches for rays that go their own ways: in turns where the tree is so large that each would wait for memory.
///
/// # Safety
/// As for [`closest`]; the places are within the rays, none of which runs along an axis.
#[inline(always)]
unsafe fn search_scattered<L: Lanes, Q: Query>(
    tree: &Tree,
    rays: &[Ray],
    clips: &[Interval],
    searches: impl Iterator<Item = (usize, Q)>,
    mut finished: impl FnMut(usize, &Q),
) {
    if !tree.is_large {
        for (at, mut query) in searches {
            // SAFETY: as the caller promises.
            unsafe { L::search(tree, &rays[at], clips.get(at), &mut query) }
            finished(at, &query);
        }
        return;
    }
    let mut prepared =
        searches.filter_map(|(at, query)| Some((at, PreparedRay::clipped(&rays[at], clips.get(at))?, query)));
    let mut flights = [const { MaybeUninit::<Flight<Q>>::uninit() }; FLIGHTS];
    let mut places = [0; FLIGHTS];
    let mut under_way: [usize; FLIGHTS] = std::array::from_fn(|number| number);
    let mut count = 0;
    for (at, ray, query) in prepared.by_ref().take(FLIGHTS) {
        Flight::begin(&mut flights[count], tree, ray, query);
        places[count] = at;
        count += 1;
    }
    while count > 0 {
        let mut turn = 0;
        while turn < count {
            let number = under_way[turn];
            // SAFETY: those under way have begun; else as the caller promises.
            let flight = unsafe { flights[number].assume_init_mut() };
            if unsafe { flight.step::<L>(tree) } {
                turn += 1;
                continue;
            }
            finished(places[number], &flight.query);
            if let Some((at, ray, query)) = prepared.next() {
                Flight::begin(&mut flights[number], tree, ray, query);
                places[number] = at;
                turn += 1;
            } else {
                count -= 1;
                under_way.swap(turn, count);
            }
        }
    }
}

/// Sixteen rays that follow each other and are of one signature.
struct Together<L: Rows> {
    /// The rays' places by lane.
    at: [u16; RAYS],
    axes: [usize; 3],
    /// The rays' words.
    rows: [L::Row; 8],
}

impl<L: Rows> Together<L> {
    /// The rays from `start` on, if there are as many and they have the same [`signature`], other than [`ALONE`].
    ///
    /// # Safety
    /// The processor has the instructions of `L`.
    #[inline(always)]
    unsafe fn new(rays: &[Ray], start: usize) -> Option<Self> {
        const ALL: u32 = (1 << RAYS) - 1;
        let own = rays.get(start..start + RAYS)?;
        unsafe {
            let rows = L::row_records(own.as_ptr().cast());
            let [x, y, z, t_min, dx, dy, dz, t_max] = rows;
            let (zero, largest, least) = (L::row(0.0), L::row(f32::MAX), L::row(PARALLEL));
            let mut good = L::row_at_most(t_min, t_max) & L::row_at_most(zero, t_max);
            let mut alike = true;
            let mut magnitudes = [zero; 3];
            for (axis, (origin, direction)) in [(x, dx), (y, dy), (z, dz)].into_iter().enumerate() {
                // Of a NaN both are NaN.
                let from_zero = L::row_greater(origin, L::row_sub(zero, origin));
                let magnitude = L::row_greater(direction, L::row_sub(zero, direction));
                good &= L::row_at_most(from_zero, largest);
                good &= L::row_at_most(magnitude, largest) & L::row_at_most(least, magnitude);
                let negative = L::row_less(direction, zero);
                alike &= negative == 0 || negative == ALL;
                magnitudes[axis] = magnitude;
            }
            // As `largest_axis`.
            let [x, y, z] = magnitudes;
            let first = L::row_less(y, x);
            let not_last = L::row_less(z, L::row_greater(x, y));
            let axis = match (not_last, first) {
                (0, _) => 2,
                (ALL, ALL) => 0,
                (ALL, 0) => 1,
                _ => return None,
            };
            if good != ALL || !alike {
                return None;
            }
            let mut at = [start as u16; RAYS];
            for (at, place) in at.iter_mut().zip(L::ORDER) {
                *at += place;
            }
            Some(Self { at, axes: AXES[axis], rows })
        }
    }
}

/// Places in a chunk, in order.
struct Marks([u64; CHUNK / 64]);

impl Marks {
    fn new() -> Self {
        Self([0; CHUNK / 64])
    }

    #[inline(always)]
    fn extend(&mut self, places: &[u16]) {
        for &place in places {
            self.0[usize::from(place / 64)] |= 1 << (place % 64);
        }
    }

    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = usize> {
        self.0.iter().enumerate().flat_map(|(word, &marks)| {
            let left = |&marks: &u64| Some(marks & marks.wrapping_sub(1)).filter(|left| *left != 0);
            let first = Some(marks).filter(|marks| *marks != 0);
            std::iter::successors(first, left).map(move |marks| 64 * word + marks.trailing_zeros() as usize)
        })
    }
}

/// Places in a chunk.
struct Places {
    places: [u16; CHUNK],
    count: usize,
}

impl Places {
    fn new() -> Self {
        Self { places: [0; CHUNK], count: 0 }
    }

    #[inline(always)]
    fn push(&mut self, place: usize) {
        self.places[self.count] = place as u16;
        self.count += 1;
    }

    /// Adds as many as a packet may have, and no more than there are rays.
    #[inline(always)]
    fn extend(&mut self, start: usize, rays: usize) {
        (start..(start + RAYS).min(rays)).for_each(|place| self.push(place));
    }

    fn as_slice(&self) -> &[u16] {
        &self.places[..self.count]
    }
}

/// Places of rays by their signature, in order within each.
struct Sorted {
    places: [u16; CHUNK],
    /// Where each signature begins, and the end.
    starts: [u16; ALONE as usize + 2],
}

impl Sorted {
    #[inline(always)]
    fn new(rays: &[Ray], of: &Places) -> Self {
        let mut signatures = [0; CHUNK];
        let mut starts = [0u16; ALONE as usize + 2];
        for (signature_of, &place) in signatures.iter_mut().zip(of.as_slice()) {
            *signature_of = signature(&rays[usize::from(place)]);
            starts[usize::from(*signature_of)] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum - *start;
        }
        let mut places = [0; CHUNK];
        let mut next = starts;
        for (signature, &place) in signatures.iter().zip(of.as_slice()) {
            let at = &mut next[usize::from(*signature)];
            places[usize::from(*at)] = place;
            *at += 1;
        }
        Self { places, starts }
    }

    /// At most [`RAYS`] places each, of one signature.
    #[inline(always)]
    fn packets(&self) -> impl Iterator<Item = (Signature, &[u16])> {
        (0..=ALONE).flat_map(move |signature| {
            let range = self.starts[usize::from(signature)]..self.starts[usize::from(signature) + 1];
            let run = &self.places[usize::from(range.start)..usize::from(range.end)];
            run.chunks(RAYS).map(move |together| (signature, together))
        })
    }
}
