//! Many rays at once: those that go alike together in packets, the others one by one.

use super::packet::{self, Asked, Packet, RAYS};
use super::single::{Closest, Occluded, Query, walk};
use super::{Level, Portable, Rows, Set};
use crate::accel::wide::Tree;
use crate::geometry::ray::{AXES, Interval, largest_axis};
use crate::geometry::{Hit, PreparedRay, Ray};

/// Rays among which those that go alike are looked for.
const CHUNK: usize = 1024;

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
    const LEAST_MET: u32 = 5;

    /// Packets that go alone after two that were not worth it.
    const PAUSE: u32 = 14;

    fn new() -> Self {
        Self { alone: 0, failed: false }
    }

    /// Whether to try a packet.
    #[inline(always)]
    fn tries(&mut self) -> bool {
        self.alone = self.alone.saturating_sub(1);
        self.alone == 0
    }

    /// Takes note of a packet.
    #[inline(always)]
    fn saw(&mut self, boxes: u32, met: u32) {
        let fails = met < Self::LEAST_MET * boxes;
        if fails && self.failed {
            self.alone = Self::PAUSE;
        }
        self.failed = fails;
    }
}

/// The first hits of rays: each replaces the one at the same place in `best` if it comes before that.
#[inline(always)]
pub fn closest_batch(level: Level, tree: &Tree, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
    assert!(rays.len() == best.len() && (clips.is_empty() || clips.len() == rays.len()), "one of each a ray");
    // SAFETY: the processor has the level's instructions, and the tree's children are in range.
    unsafe {
        match level.0 {
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
        match level.0 {
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
        let sorted = Sorted::new(rays, |_| true);
        for (signature, together) in sorted.packets() {
            if signature == ALONE || together.len() < LEAST || !coherence.tries() {
                for &at in together {
                    let at = usize::from(at);
                    let mut query = Closest { instance, best: &mut best[at] };
                    // SAFETY: as the caller promises.
                    unsafe { one::<L, _>(tree, &rays[at], clips.get(at), &mut query) }
                }
                continue;
            }
            // SAFETY: as the caller promises; the places are within the chunk.
            let packet = unsafe {
                let mut packet = Packet::<L>::new(&asked, together, AXES[usize::from(signature % 3)], best);
                packet::walk::<L, false>(tree, &mut packet);
                packet.finish();
                packet
            };
            coherence.saw(packet.boxes, packet.met);
            for (lane, &at) in together.iter().enumerate() {
                best[usize::from(at)] = packet.best(lane);
            }
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
        let sorted = Sorted::new(rays, |at| !found[at]);
        for (signature, together) in sorted.packets() {
            if signature == ALONE || together.len() < LEAST || !coherence.tries() {
                for &at in together {
                    let at = usize::from(at);
                    let mut query = Occluded { found: false };
                    // SAFETY: as the caller promises.
                    unsafe { one::<L, _>(tree, &rays[at], clips.get(at), &mut query) }
                    found[at] = query.found;
                }
                continue;
            }
            // SAFETY: as the caller promises; the places are within the chunk.
            let packet = unsafe {
                let mut packet = Packet::<L>::new(&asked, together, AXES[usize::from(signature % 3)], &[]);
                packet::walk::<L, true>(tree, &mut packet);
                packet
            };
            coherence.saw(packet.boxes, packet.met);
            for (lane, &at) in together.iter().enumerate() {
                found[usize::from(at)] = packet.alive >> lane & 1 == 0;
            }
        }
    }
}

/// # Safety
/// As for [`closest`].
#[inline(always)]
unsafe fn one<L: Rows, Q: Query>(tree: &Tree, ray: &Ray, clip: Option<&Interval>, query: &mut Q) {
    if let Some(ray) = PreparedRay::clipped(ray, clip) {
        // SAFETY: as the caller promises.
        unsafe { walk::<L, Q>(tree, &ray, query) }
    }
}

/// The places of a chunk.
const IN_ORDER: [u16; CHUNK] = {
    let mut places = [0; CHUNK];
    let mut at = 0;
    while at < CHUNK {
        places[at] = at as u16;
        at += 1;
    }
    places
};

/// The places of rays by their signature, in order within each.
struct Sorted {
    places: [u16; CHUNK],
    /// Where each signature begins, and the end.
    starts: [u16; ALONE as usize + 2],
}

impl Sorted {
    #[inline(always)]
    fn new(rays: &[Ray], wanted: impl Fn(usize) -> bool) -> Self {
        let mut signatures = [0; CHUNK];
        let mut differs = 0;
        for (at, ray) in rays.iter().enumerate() {
            // Those that are not wanted come after the last.
            signatures[at] = if wanted(at) { signature(ray) } else { ALONE + 1 };
            differs |= signatures[at] ^ signatures[0];
        }
        let mut starts = [0u16; ALONE as usize + 2];
        if differs == 0 {
            starts[usize::from(signatures[0]) + 1..].fill(rays.len() as u16);
            return Self { places: IN_ORDER, starts };
        }
        for signature in &signatures[..rays.len()] {
            starts[usize::from(*signature)] += 1;
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum - *start;
        }
        let mut places = [0; CHUNK];
        let mut next = starts;
        for (at, signature) in signatures[..rays.len()].iter().enumerate() {
            let place = &mut next[usize::from(*signature)];
            places[usize::from(*place)] = at as u16;
            *place += 1;
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
