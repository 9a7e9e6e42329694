//! `Trace` and `Shade` for many rays at once, depth by depth: the frame loop's way.
//!
//! What the recursion of [`Tracer::trace`] does ray by ray is done here step by step for all rays of a batch, by the same
//! functions in the same order for each ray, so that colours are equal bit for bit: first hits, then light after light a batch of
//! shadow rays, then all reflected and refracted rays as the next batch. What these see is added on the way back, so that clamping
//! comes where it does in the recursion.

use crate::geometry::Hit;
use crate::render::answers::{Answers, Meeting};
use crate::render::settings::ThreadSeconds;
use crate::render::shade::SurfaceColors;
use crate::render::shadow::Illumination;
use crate::render::surface::SurfacePoint;
use crate::render::trace::{TracedRay, Tracer, background};
use crate::scene::camera::ViewRay;
use crate::scene::{Rgb, compiled};

/// Rays that are traced together. More make packets of rays that go alike, but what is known of them leaves the cache.
pub const LARGEST: usize = 1024;

/// Rays of a batch: in the precision of what answers them, and in f64 for shading.
struct Rays<R> {
    rays: Vec<R>,
    views: Vec<ViewRay>,
}

/// A hit that is being shaded.
struct Shading {
    /// The number of its ray.
    ray: u32,
    hit: Hit,
    point: SurfacePoint,
    colors: SurfaceColors,
    /// What has been summed up.
    color: Rgb,
}

/// What a ray's colour still lacks.
struct Pending {
    ray: u32,
    material: u32,
    /// Positions among the rays of the next depth.
    reflected: Option<u32>,
    transmitted: Option<u32>,
}

impl<I: Answers> Tracer<'_, I> {
    /// [`trace_camera`](Self::trace_camera) for each ray: what it sees and what it hit.
    pub fn trace_cameras(&self, views: Vec<ViewRay>) -> (Vec<Rgb>, Vec<Hit>) {
        self.count(|counts| counts.camera += views.len() as u64);
        // Traversal is timed within.
        let before = self.seconds().traversal;
        let all = |seconds: &mut ThreadSeconds, all: f64| seconds.shading += all - (seconds.traversal - before);
        self.timed(all, || {
            let mut rays = Vec::with_capacity(views.len());
            for view in &views {
                rays.push(self.intersect.camera_ray(view));
            }
            self.trace_wave(Rays { rays, views }, 0)
        })
    }

    fn trace_all(&self, all: Rays<I::Ray>, depth: u32) -> Vec<Rgb> {
        if all.rays.len() <= LARGEST {
            return self.trace_wave(all, depth).0;
        }
        let mut colors = Vec::with_capacity(all.rays.len());
        for (rays, views) in all.rays.chunks(LARGEST).zip(all.views.chunks(LARGEST)) {
            colors.extend(self.trace_wave(Rays { rays: rays.into(), views: views.into() }, depth).0);
        }
        colors
    }

    /// The colours that rays see, and what they hit first.
    fn trace_wave(&self, traced: Rays<I::Ray>, depth: u32) -> (Vec<Rgb>, Vec<Hit>) {
        let mut hits = vec![Hit::MISS; traced.rays.len()];
        self.timed(traversal, || self.intersect.first_hits(&traced.rays, &mut hits));
        let mut colors = vec![Rgb::ZERO; hits.len()];
        let mut shadings = Vec::with_capacity(hits.len());
        for (number, (first, color)) in hits.iter_mut().zip(&mut colors).enumerate() {
            let (ray, view) = (traced.rays[number], traced.views[number]);
            if !first.is_hit() {
                *color = background(&self.scene.background, view.direction);
                continue;
            }
            let (hit, point) = self.meet(&TracedRay { ray, view }, *first);
            *first = hit;
            let colors = self.colors(&point, &hit);
            shadings.push(Shading { ray: number as u32, hit, point, colors, color: colors.ambient });
        }
        self.add_lights(&traced.views, &mut shadings);

        // Mirror and transmission.
        let mut next = Rays { rays: Vec::new(), views: Vec::new() };
        let mut pending = Vec::new();
        let deeper = depth < self.scene.film.max_depth;
        for shading in &shadings {
            let here = shading.meeting(&traced.views);
            let material = &self.scene.materials[here.point.material as usize];
            let reflects = deeper && compiled::REFLECTION && material.is_reflective();
            let transmits = deeper && !self.is_opaque() && material.is_transmissive();
            if !reflects && !transmits {
                colors[shading.ray as usize] = self.clamp(shading.color);
                continue;
            }
            colors[shading.ray as usize] = shading.color;
            let reflected = reflects.then(|| next.push(self.reflected(&here)));
            let transmitted = transmits.then(|| next.push(self.transmitted(&here, material)));
            pending.push(Pending { ray: shading.ray, material: here.point.material, reflected, transmitted });
        }
        // The deepest recursion has this batch's colours and hits on every level, but not the rest.
        drop((traced, shadings));
        if !pending.is_empty() {
            let seen = self.trace_all(next, depth + 1);
            for one in pending {
                let material = &self.scene.materials[one.material as usize];
                let color = &mut colors[one.ray as usize];
                if let Some(at) = one.reflected {
                    *color += material.kr * seen[at as usize];
                }
                if let Some(at) = one.transmitted {
                    *color += material.kt * seen[at as usize];
                }
                *color = self.clamp(*color);
            }
        }
        (colors, hits)
    }

    /// Adds each light's diffuse and specular terms where it is seen.
    fn add_lights(&self, views: &[ViewRay], shadings: &mut [Shading]) {
        let mut lit: Vec<(u32, Illumination)> = Vec::with_capacity(shadings.len());
        let mut rays = Vec::with_capacity(shadings.len());
        let mut blocked = Vec::new();
        for light in self.lights() {
            lit.clear();
            rays.clear();
            for (number, shading) in shadings.iter().enumerate() {
                if let Some(illumination) = Illumination::at(light, &shading.point) {
                    rays.push(self.intersect.shadow_ray(&shading.meeting(views), &illumination));
                    lit.push((number as u32, illumination));
                }
            }
            self.count(|counts| counts.shadow += rays.len() as u64);
            blocked.clear();
            blocked.resize(rays.len(), false);
            self.timed(traversal, || self.intersect.are_blocked_by_opaque(&rays, &mut blocked));
            for (((number, illumination), ray), blocked) in lit.iter().zip(&rays).zip(&blocked) {
                if *blocked {
                    continue;
                }
                let visible = self.visible_through(ray);
                if self.is_opaque() || visible != Rgb::ZERO {
                    let shading = &mut shadings[*number as usize];
                    let view = &views[shading.ray as usize];
                    shading.color += self.lit(visible, illumination, &shading.colors, &shading.point, view);
                }
            }
        }
    }
}

fn traversal(seconds: &mut ThreadSeconds, spent: f64) {
    seconds.traversal += spent;
}

impl<R> Rays<R> {
    /// Adds a ray and returns its position.
    fn push(&mut self, ray: TracedRay<R>) -> u32 {
        self.rays.push(ray.ray);
        self.views.push(ray.view);
        self.rays.len() as u32 - 1
    }
}

impl Shading {
    fn meeting<'a>(&'a self, views: &'a [ViewRay]) -> Meeting<'a> {
        Meeting { view: &views[self.ray as usize], hit: &self.hit, point: &self.point }
    }
}
