//! Batches of rays through both levels: instance after instance, the nearest first, each asked all rays that meet its box.
//!
//! That lets meshes answer rays that go alike together. Where there are many instances each ray finds its way to those that it
//! meets by itself, since most rays pass most of them by.

use crate::accel::TriangleAccelerator;
use crate::geometry::ray::Interval;
use crate::geometry::{Hit, PreparedRay, Ray};
use crate::render::intersect::{Everything, Filter, Top, TwoLevel};
use crate::render::world::Instance;
use crate::scene::Shape;

/// Rays that are asked together: what is prepared of them should stay in the nearest cache.
const CHUNK: usize = 256;

/// With more instances than these rays go by themselves.
const FEW: usize = 16;

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
    fn push(&mut self, instance: &Instance, ray: &PreparedRay, clip: Interval, place: usize, answer: T) {
        let mut own =
            Ray { origin: ray.origin.into(), t_min: ray.t_min, direction: ray.direction.into(), t_max: ray.t_max };
        if !instance.is_unmoved() {
            let (origin, direction) = instance.local_line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
            (own.origin, own.direction) = (origin.as_vec3(), direction.as_vec3());
            self.clips.push(clip);
        }
        self.rays.push(own);
        self.answers.push(answer);
        self.places.push(place as u16);
    }
}

impl<A: TriangleAccelerator> TwoLevel<A> {
    /// The first hit of each ray.
    pub(super) fn closest_all(&self, rays: &[Ray], hits: &mut [Hit]) {
        hits.fill(Hit::MISS);
        if let Top::Single = self.top {
            return self.meshes[0].closest_batch(rays, &[], 0, hits);
        }
        let mut group = Group::new();
        for (rays, hits) in rays.chunks(CHUNK).zip(hits.chunks_mut(CHUNK)) {
            let prepared: Vec<_> = rays.iter().map(PreparedRay::new).collect();
            if self.world.instances.len() > FEW {
                for (ray, hit) in prepared.iter().zip(hits) {
                    *hit = ray.as_ref().map_or(Hit::MISS, |ray| self.search::<Everything>(ray, None));
                }
                continue;
            }
            for number in self.nearest_first(&prepared) {
                let instance = &self.world.instances[number as usize];
                let rays = prepared.iter().enumerate().filter_map(|(place, ray)| Some((place, ray.as_ref()?)));
                let Shape::Mesh(mesh) = instance.shape else {
                    rays.for_each(|(place, ray)| self.meet::<Everything>(number, ray, None, &mut hits[place]));
                    continue;
                };
                group.clear();
                for (place, ray) in rays {
                    let (clip, best) = (instance.clip(ray), hits[place]);
                    if !(clip.is_empty() || clip.near > best.t || clip.near > ray.t_max || clip.far < ray.t_min) {
                        group.push(instance, ray, clip, place, best);
                    }
                }
                self.meshes[mesh as usize].closest_batch(&group.rays, &group.clips, number, &mut group.answers);
                for (&place, hit) in group.places.iter().zip(&group.answers) {
                    hits[usize::from(place)] = *hit;
                }
            }
        }
    }

    /// Whether anything that is wanted is hit by each ray.
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
            let prepared: Vec<_> = rays.iter().map(PreparedRay::new).collect();
            if self.world.instances.len() > FEW {
                for (ray, occluded) in prepared.iter().zip(occluded) {
                    *occluded = ray.as_ref().is_some_and(|ray| self.any::<F>(ray));
                }
                continue;
            }
            for number in self.nearest_first(&prepared) {
                let instance = &self.world.instances[number as usize];
                if !F::wants(instance) {
                    continue;
                }
                let rays = prepared.iter().enumerate().filter_map(|(place, ray)| Some((place, ray.as_ref()?)));
                let Shape::Mesh(mesh) = instance.shape else {
                    for (place, ray) in rays {
                        occluded[place] = occluded[place] || self.blocks::<F>(number, ray);
                    }
                    continue;
                };
                group.clear();
                for (place, ray) in rays.filter(|(place, _)| !occluded[*place]) {
                    let clip = instance.clip(ray);
                    if !(clip.is_empty() || clip.near > ray.t_max || clip.far < ray.t_min) {
                        group.push(instance, ray, clip, place, false);
                    }
                }
                self.meshes[mesh as usize].occluded_batch(&group.rays, &group.clips, &mut group.answers);
                for (&place, answer) in group.places.iter().zip(&group.answers) {
                    occluded[usize::from(place)] = *answer;
                }
            }
        }
    }

    /// The instances in the order in which the first ray enters their boxes; those that it passes by come last.
    fn nearest_first(&self, rays: &[Option<PreparedRay>]) -> Vec<u32> {
        let instances = &self.world.instances;
        let mut order: Vec<u32> = (0..instances.len() as u32).collect();
        if let Some(ray) = rays.iter().flatten().next() {
            let near = |number: &u32| {
                let clip = instances[*number as usize].clip(ray);
                if clip.is_empty() { f32::INFINITY } else { clip.near }
            };
            order.sort_by(|a, b| near(a).total_cmp(&near(b)));
        }
        order
    }
}
