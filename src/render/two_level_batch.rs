//! Batches of rays through both levels: instance after instance, the nearest first, each asked all rays that meet its box.
//!
//! That lets meshes answer rays that go alike together. Instances that no ray of a chunk can meet are sorted out for all of them at once
//! by interval arithmetic; where many are left each ray finds its own way, since it passes most of them by.

use crate::accel::TriangleAccelerator;
use crate::geometry::ray::{Interval, padded};
use crate::geometry::{Bounds, Hit, PreparedRay, Ray};
use crate::render::intersect::{Everything, Filter, Top, TwoLevel};
use crate::render::world::Instance;
use crate::scene::Shape;

/// Rays that are asked together: what is prepared of them should stay in the nearest cache.
const CHUNK: usize = 256;

/// Where a chunk may meet more instances than these its rays go by themselves.
const FEW: usize = 16;

/// In scenes of more instances rays always go by themselves: looking at all of them would take longer.
const MANY: usize = 2048;

/// A number of each ray.
type Numbers = [f32; CHUNK];

/// Rays as their crossings with boxes need them, number by number, so that compilers make vectors of the loops.
struct Chunk<'a> {
    rays: &'a [Ray],
    /// Positions of those that can meet anything.
    valid: Vec<u16>,
    origin: [Numbers; 3],
    inverse: [Numbers; 3],
    inverse_far: [Numbers; 3],
    /// Per axis what all valid rays have in common, where they go to the same side of it.
    extremes: [Option<Extremes>; 3],
    /// The least t of all intervals, and the largest.
    ends: [f32; 2],
}

/// The ends of the origins and inverses along an axis.
#[derive(Clone, Copy)]
struct Extremes {
    negative: bool,
    origin: [f32; 2],
    inverse: [f32; 2],
    inverse_far: [f32; 2],
}

/// The parts of a chunk's rays inside a box.
struct Clips {
    near: Numbers,
    far: Numbers,
}

impl<'a> Chunk<'a> {
    fn new(rays: &'a [Ray]) -> Self {
        let nothing = [0.0; CHUNK];
        let mut chunk = Self {
            rays,
            valid: (0..rays.len() as u16).filter(|&at| rays[usize::from(at)].is_valid()).collect(),
            origin: [nothing; 3],
            inverse: [nothing; 3],
            inverse_far: [nothing; 3],
            extremes: [None; 3],
            ends: [f32::INFINITY, f32::NEG_INFINITY],
        };
        for axis in 0..3 {
            for (at, ray) in rays.iter().enumerate() {
                chunk.origin[axis][at] = ray.origin[axis];
                chunk.inverse[axis][at] = ray.direction[axis];
            }
            for (inverse, far) in chunk.inverse[axis].iter_mut().zip(&mut chunk.inverse_far[axis]) {
                *inverse = 1.0 / *inverse;
                *far = padded(*inverse);
            }
            chunk.extremes[axis] = chunk.extremes(axis);
        }
        for &at in &chunk.valid {
            let (t_min, t_max) = chunk.interval(usize::from(at));
            chunk.ends = [chunk.ends[0].min(t_min), chunk.ends[1].max(t_max)];
        }
        chunk
    }

    /// A ray's interval of t as [`PreparedRay`] has it.
    #[inline(always)]
    fn interval(&self, at: usize) -> (f32, f32) {
        let Ray { t_min, t_max, .. } = self.rays[at];
        (if t_min > 0.0 { t_min } else { 0.0 }, t_max)
    }

    fn extremes(&self, axis: usize) -> Option<Extremes> {
        let first = usize::from(*self.valid.first()?);
        let ends = |numbers: &Numbers| {
            let [mut least, mut most] = [numbers[first]; 2];
            for &at in &self.valid {
                let number = numbers[usize::from(at)];
                least = if number < least { number } else { least };
                most = if number > most { number } else { most };
            }
            [least, most]
        };
        let [inverse, inverse_far] = [&self.inverse, &self.inverse_far].map(|numbers| ends(&numbers[axis]));
        // Infinite where a ray runs parallel: then a product may be NaN.
        let [least, most] = inverse_far;
        let alike = (least > 0.0) == (most > 0.0) && least.is_finite() && most.is_finite();
        alike.then(|| Extremes { negative: most < 0.0, origin: ends(&self.origin[axis]), inverse, inverse_far })
    }

    /// Where any of the rays may enter a box at the earliest; `None` if none can meet what is in it.
    ///
    /// [`Bounds::interval`] is monotone in the origin and in the inverse, so that its ends for the extremes are ends for all rays.
    fn enters(&self, bounds: &Bounds) -> Option<f32> {
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for (axis, extremes) in self.extremes.iter().enumerate() {
            let Some(extremes) = extremes else { continue };
            let [least, most] = extremes.origin;
            let (enter, leave) = (bounds.min[axis], bounds.max[axis]);
            let (enter, leave) =
                if extremes.negative { (leave - least, enter - most) } else { (enter - most, leave - least) };
            let entry = (enter * extremes.inverse[0]).min(enter * extremes.inverse[1]);
            let exit = (leave * extremes.inverse_far[0]).max(leave * extremes.inverse_far[1]);
            near = if entry > near { entry } else { near };
            far = if exit < far { exit } else { far };
        }
        (near <= far && near <= self.ends[1] && far >= self.ends[0]).then_some(near)
    }

    /// [`Bounds::interval`] of the whole rays.
    fn clips(&self, bounds: &Bounds) -> Clips {
        let mut clips = Clips { near: [f32::NEG_INFINITY; CHUNK], far: [f32::INFINITY; CHUNK] };
        for axis in 0..3 {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            let rays = self.origin[axis].iter().zip(&self.inverse[axis]).zip(&self.inverse_far[axis]);
            for (((origin, inverse), inverse_far), (near, far)) in rays.zip(clips.near.iter_mut().zip(&mut clips.far)) {
                let negative = inverse.is_sign_negative();
                let t_entry = (if negative { max } else { min } - origin) * inverse;
                let t_exit = (if negative { min } else { max } - origin) * inverse_far;
                *near = if t_entry > *near { t_entry } else { *near };
                *far = if t_exit < *far { t_exit } else { *far };
            }
        }
        clips
    }
}

/// The rays that an instance is asked.
struct Group<T> {
    rays: Vec<Ray>,
    /// Their clip intervals; empty if the instance is unmoved.
    clips: Vec<Interval>,
    answers: Vec<T>,
    /// Their positions in the chunk.
    places: Vec<u16>,
}

impl<T> Group<T> {
    fn new() -> Self {
        Self { rays: Vec::new(), clips: Vec::new(), answers: Vec::new(), places: Vec::new() }
    }

    fn clear(&mut self) {
        self.rays.clear();
        self.clips.clear();
        self.answers.clear();
        self.places.clear();
    }

    /// Adds a ray of the chunk, brought into the instance's space; not where rounding left it without a direction.
    #[inline(always)]
    fn push(&mut self, instance: &Instance, ray: &Ray, clip: Interval, place: u16, answer: T) {
        let mut own = *ray;
        if !instance.is_unmoved() {
            let (origin, direction) = instance.local_line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
            (own.origin, own.direction) = (origin.as_vec3(), direction.as_vec3());
            self.clips.push(clip);
        }
        self.rays.push(own);
        self.answers.push(answer);
        self.places.push(place);
    }
}

impl<A: TriangleAccelerator> TwoLevel<A> {
    /// The first hit of each ray. Out of line, since the deepest recursion must not have what is prepared here on every level.
    #[inline(never)]
    pub(super) fn closest_all(&self, rays: &[Ray], hits: &mut [Hit]) {
        hits.fill(Hit::MISS);
        if let Top::Single = self.top {
            return self.meshes[0].closest_batch(rays, &[], 0, hits);
        }
        let mut group = Group::new();
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            let chunk = Chunk::new(rays);
            let Some(instances) = self.nearest_first::<Everything>(&chunk) else {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = PreparedRay::new(ray).map_or(Hit::MISS, |ray| self.search::<Everything>(&ray, None));
                }
                continue;
            };
            for number in instances {
                let instance = &self.world.instances[number as usize];
                self.gather(&chunk, instance, &mut group, |place, near| {
                    let best = hits[place];
                    (near <= best.t).then_some(best)
                });
                match instance.shape {
                    Shape::Mesh(mesh) => {
                        let mesh = &self.meshes[mesh as usize];
                        mesh.closest_batch(&group.rays, &group.clips, number, &mut group.answers);
                    }
                    Shape::Quadric(_) => {
                        for (&place, best) in group.places.iter().zip(&mut group.answers) {
                            if let Some(ray) = PreparedRay::new(&rays[usize::from(place)]) {
                                self.meet::<Everything>(number, &ray, None, best);
                            }
                        }
                    }
                }
                for (&place, hit) in group.places.iter().zip(&group.answers) {
                    hits[usize::from(place)] = *hit;
                }
            }
        }
    }

    /// Whether anything that is wanted is hit by each ray. Out of line as well.
    #[inline(never)]
    pub(super) fn occluded_all<F: Filter>(&self, rays: &[Ray], occluded: &mut [bool]) {
        occluded.fill(false);
        if let Top::Single = self.top {
            if F::wants(&self.world.instances[0]) {
                self.meshes[0].occluded_batch(rays, &[], occluded);
            }
            return;
        }
        let mut group = Group::new();
        for (rays, occluded) in rays.chunks(CHUNK).zip(occluded.chunks_mut(CHUNK)) {
            let chunk = Chunk::new(rays);
            let Some(instances) = self.nearest_first::<F>(&chunk) else {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = PreparedRay::new(ray).is_some_and(|ray| self.any::<F>(&ray));
                }
                continue;
            };
            for number in instances {
                let instance = &self.world.instances[number as usize];
                self.gather(&chunk, instance, &mut group, |place, _| (!occluded[place]).then_some(false));
                match instance.shape {
                    Shape::Mesh(mesh) => {
                        let mesh = &self.meshes[mesh as usize];
                        mesh.occluded_batch(&group.rays, &group.clips, &mut group.answers);
                    }
                    Shape::Quadric(_) => {
                        for (&place, answer) in group.places.iter().zip(&mut group.answers) {
                            let ray = PreparedRay::new(&rays[usize::from(place)]);
                            *answer = ray.is_some_and(|ray| self.blocks::<F>(number, &ray));
                        }
                    }
                }
                for (&place, answer) in group.places.iter().zip(&group.answers) {
                    occluded[usize::from(place)] = *answer;
                }
            }
        }
    }

    /// Collects the rays that meet an instance's box and are not settled: `answer` gives what a ray has until now, or nothing where what
    /// begins at a t does not matter to it.
    #[inline(always)]
    fn gather<T>(
        &self,
        chunk: &Chunk<'_>,
        instance: &Instance,
        group: &mut Group<T>,
        answer: impl Fn(usize, f32) -> Option<T>,
    ) {
        group.clear();
        let clips = instance.bounds.as_ref().map(|bounds| chunk.clips(bounds));
        for &place in &chunk.valid {
            let at = usize::from(place);
            let clip =
                clips.as_ref().map_or(Interval::ALL, |clips| Interval { near: clips.near[at], far: clips.far[at] });
            let (t_min, t_max) = chunk.interval(at);
            if clip.is_empty() || clip.near > t_max || clip.far < t_min {
                continue;
            }
            if let Some(answer) = answer(at, clip.near) {
                group.push(instance, &chunk.rays[at], clip, place, answer);
            }
        }
    }

    /// The wanted instances that rays of the chunk may meet, in the order in which they may be entered first; `None` if they are
    /// too many to be asked one after the other.
    fn nearest_first<F: Filter>(&self, chunk: &Chunk<'_>) -> Option<Vec<u32>> {
        let instances = &self.world.instances;
        if instances.len() > MANY {
            return None;
        }
        let mut order = Vec::with_capacity(FEW + 1);
        for (number, instance) in instances.iter().enumerate().filter(|(_, instance)| F::wants(instance)) {
            let near = match &instance.bounds {
                Some(bounds) => chunk.enters(bounds),
                None => Some(f32::NEG_INFINITY),
            };
            if let Some(near) = near {
                order.push((near, number as u32));
                if order.len() > FEW {
                    return None;
                }
            }
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        Some(order.into_iter().map(|(_, number)| number).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use glam::Vec3;

    /// Rays from about one place to about another; of some chunks one runs along an axis, or meets nothing.
    fn rays(random: &mut Random, chunk: usize) -> Vec<Ray> {
        let (origin, target, spread) = (random.in_cube() * 3.0, random.in_cube(), random.unit());
        let mut rays: Vec<Ray> = (0..CHUNK - chunk % 7)
            .map(|_| {
                let start = origin + random.in_cube() * (0.1 * spread);
                let ray = Ray::new(start.as_vec3(), (target + random.in_cube() * spread - start).as_vec3());
                Ray { t_min: random.unit() as f32 * 0.1, t_max: random.between(0.2, 2.0) as f32, ..ray }
            })
            .collect();
        match chunk % 4 {
            0 => rays[3].direction[chunk % 3] = [0.0, -0.0][chunk / 3 % 2],
            1 => rays[5].direction = Vec3::ZERO,
            _ => {}
        }
        rays
    }

    #[test]
    fn chunks_cross_boxes_as_their_rays_do() {
        let mut random = Random::new(8, 0x2b);
        let (mut passed_by, mut met) = (0, 0);
        for number in 0..400 {
            let rays = rays(&mut random, number);
            let chunk = Chunk::new(&rays);
            let (corner, size) = (random.in_cube() * 1.5, random.in_cube().abs());
            let flat = if number % 5 == 0 { 0.0 } else { 1.0 };
            let bounds = Bounds::of([corner.as_vec3(), (corner + size * glam::DVec3::new(1.0, flat, 1.0)).as_vec3()]);
            let (clips, enters) = (chunk.clips(&bounds), chunk.enters(&bounds));
            let mut valid = chunk.valid.iter();
            for (at, ray) in rays.iter().enumerate() {
                let Some(ray) = PreparedRay::new(ray) else { continue };
                assert_eq!(valid.next(), Some(&(at as u16)));
                let expected = bounds.interval(&ray, f32::NEG_INFINITY, f32::INFINITY);
                assert_eq!((clips.near[at], clips.far[at]), (expected.near, expected.far));
                let meets = !expected.is_empty() && expected.near <= ray.t_max && expected.far >= ray.t_min;
                assert!(!meets || enters.is_some_and(|near| near <= expected.near), "chunk {number}, ray {at}");
                met += usize::from(meets);
            }
            assert_eq!(valid.next(), None);
            passed_by += usize::from(enters.is_none());
        }
        assert!(passed_by > 50 && met > 1000, "{passed_by} chunks pass by, {met} rays meet");
    }
}
