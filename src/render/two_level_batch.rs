//! Batches of rays through both levels: instance after instance, the nearest first, each asked all rays that meet its box.
//!
//! That lets meshes answer rays that go alike together. Instances that no ray of a chunk can meet are sorted out for all of them at once
//! by interval arithmetic; where many are left each ray finds its own way, since it passes most of them by.

use crate::accel::TriangleAccelerator;
use crate::geometry::ray::Interval;
use crate::geometry::{Hit, PreparedRay, Ray};
use crate::math::simd::Level;
use crate::render::chunk::{CHUNK, Chunk};
use crate::render::intersect::{Everything, Filter, Top, TwoLevel};
use crate::render::world::Instance;
use crate::scene::Shape;

/// Where a chunk may meet more instances than these its rays go by themselves.
const FEW: usize = 16;

/// In scenes of more instances rays always go by themselves: looking at all of them would take longer.
const MANY: usize = 2048;

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

    /// Takes the rays at its places of the chunk, brought into the instance's space.
    fn take(&mut self, instance: &Instance, chunk: &mut Chunk, rays: &[Ray]) {
        if instance.is_unmoved() {
            self.clips.clear();
            self.rays.extend(self.places.iter().map(|&place| rays[usize::from(place)]));
        } else if self.places.len() < rays.len() / 8 {
            // The loop is over all of them, eight at a time at most.
            self.rays.extend(self.places.iter().map(|&place| {
                let ray = rays[usize::from(place)];
                let (origin, direction) = instance.local_line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
                Ray { origin: origin.as_vec3(), direction: direction.as_vec3(), ..ray }
            }));
        } else {
            let local = chunk.local(&instance.transform);
            self.rays.extend(self.places.iter().map(|&place| {
                let (origin, direction) = local(usize::from(place));
                Ray { origin, direction, ..rays[usize::from(place)] }
            }));
        }
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
        let (mut group, mut chunk) = (Group::new(), Chunk::new(Level::chosen()));
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            if !chunk.fill(rays) {
                continue;
            }
            let Some(instances) = self.nearest_first::<Everything>(&chunk) else {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = PreparedRay::new(ray).map_or(Hit::MISS, |ray| self.search::<Everything>(&ray, None));
                }
                continue;
            };
            for number in instances {
                let instance = &self.world.instances[number as usize];
                self.gather(&mut chunk, rays, instance, &mut group, |place, near| {
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
        let (mut group, mut chunk) = (Group::new(), Chunk::new(Level::chosen()));
        for (rays, occluded) in rays.chunks(CHUNK).zip(occluded.chunks_mut(CHUNK)) {
            if !chunk.fill(rays) {
                continue;
            }
            let Some(instances) = self.nearest_first::<F>(&chunk) else {
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = PreparedRay::new(ray).is_some_and(|ray| self.any::<F>(&ray));
                }
                continue;
            };
            for number in instances {
                let instance = &self.world.instances[number as usize];
                self.gather(&mut chunk, rays, instance, &mut group, |place, _| (!occluded[place]).then_some(false));
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
        chunk: &mut Chunk,
        rays: &[Ray],
        instance: &Instance,
        group: &mut Group<T>,
        answer: impl Fn(usize, f32) -> Option<T>,
    ) {
        group.clear();
        for (place, clip) in chunk.meeting(instance.bounds.as_ref()) {
            if let Some(answer) = answer(place, clip.near) {
                group.places.push(place as u16);
                group.clips.push(clip);
                group.answers.push(answer);
            }
        }
        group.take(instance, chunk, rays);
    }

    /// The wanted instances that rays of the chunk may meet, in the order in which they may be entered first; `None` if they are
    /// too many to be asked one after the other.
    fn nearest_first<F: Filter>(&self, chunk: &Chunk) -> Option<Vec<u32>> {
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
