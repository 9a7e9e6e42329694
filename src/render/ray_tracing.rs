//! `RayTracing`: the frame loop, tile by tile.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec2;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::progress::Progress;
use crate::render::answers::Answers;
use crate::render::film::{AovKind, Film};
use crate::render::sampling::{Positions, position};
use crate::render::settings::{Coverage, Crop, RayCounts, RenderSettings, RenderStats, ThreadSeconds};
use crate::render::surface::SurfacePoint;
use crate::render::tiles::{Tile, Tiles};
use crate::render::trace::Tracer;
use crate::render::wave::LARGEST;
use crate::render::world::World;
use crate::scene::camera::{CameraRays, ViewRay};
use crate::scene::{Background, Rgb, Scene, Shape};

/// Stack of a rendering thread: 16 KiB for each level of the deepest recursion,
/// [`LARGEST_DEPTH`](crate::scene::film::LARGEST_DEPTH), which a test goes to.
pub(super) const STACK: usize = 16 << 20;

/// Renders the scene through its active camera into a film.
///
/// The picture depends on the scene and its film settings alone. `finished` is called for each tile once it is, on the thread that
/// rendered it. Cancelled work returns the tiles that are finished,
/// with `complete` false.
///
/// # Errors
/// A degenerate camera, a film beyond its limits, a crop outside the picture, or no thread to be had.
#[doc(alias = "RayTracing")]
pub fn ray_tracing<I: Answers>(
    scene: &Scene,
    world: &World,
    intersect: &I,
    settings: &RenderSettings,
    progress: &dyn Progress,
    finished: &(dyn Fn(&Tile) + Sync),
) -> Result<Film> {
    let film = &scene.film;
    let tiles = Tiles::of(film, settings.crop)?;
    let camera = scene.camera().rays(film.width, film.height, scene.origin)?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .stack_size(STACK)
        .build()
        .map_err(|cause| Error::limit(format!("cannot start {} threads: {cause}", settings.threads)))?;

    keep_freed_memory();
    let counter = settings.coverage.then(|| Counter::new(scene));
    let wanted: Vec<(u32, Crop)> = match &settings.tiles {
        None => (0..tiles.count()).filter_map(|number| Some((number, tiles.tile(number)?))).collect(),
        Some(numbers) => numbers.iter().filter_map(|&number| Some((number, tiles.tile(number)?))).collect(),
    };
    progress.begin("render", wanted.len() as u64);
    let start = std::time::Instant::now();
    let render_tile = |&(number, area): &(u32, Crop)| {
        let tracer = Tracer::new(scene, world, intersect);
        let tile = tile_pixels(&tracer, &camera, (number, area), &settings.aovs, counter.as_ref(), progress)?;
        finished(&tile);
        progress.advance(1);
        Some(tile)
    };
    let finished: Vec<Option<Tile>> = pool.install(|| wanted.par_iter().map(render_tile).collect());
    let seconds = start.elapsed().as_secs_f64();

    let transparent = scene.background == Background::Transparent;
    let mut picture = Film::blank(*film, settings.crop, &settings.aovs, transparent)?;
    picture.complete = finished.iter().all(Option::is_some);
    picture.coverage = counter.map(Counter::finish);
    picture.stats = RenderStats { seconds, threads: pool.current_num_threads(), ..RenderStats::default() };
    finished.into_iter().flatten().for_each(|tile| picture.put(&tile));
    let ThreadSeconds { traversal, shading, rest } = &mut picture.stats.thread_seconds;
    *rest = (seconds * picture.stats.threads as f64 - *traversal - *shading).max(0.0);
    Ok(picture)
}

/// Lets the allocator keep what threads free. A batch of rays takes and frees some hundred kilobytes, which glibc returns to the system each time,
/// and which the system then clears, until something large is freed: from then on glibc keeps twice as much. Of a scene that is small, or mapped,
/// nothing large ever is; a dragon of 871 k triangles in a mapped file is rendered 1.2 times as fast with this.
fn keep_freed_memory() {
    /// A little less than the largest that glibc learns from.
    const LARGE: usize = 31 << 20;
    let mut large = Vec::<u8>::new();
    // Where there is not so much, nothing is lost.
    let _ = large.try_reserve_exact(LARGE);
    drop(std::hint::black_box(large));
}

/// Renders one tile; `None` once the work is cancelled.
fn tile_pixels<I: Answers>(
    tracer: &Tracer<'_, I>,
    camera: &CameraRays,
    (number, area): (u32, Crop),
    aovs: &[AovKind],
    counter: Option<&Counter>,
    progress: &dyn Progress,
) -> Option<Tile> {
    let pixels = (area.width() * area.height()) as usize;
    let channels = aovs.iter().map(|kind| kind.channels().len()).sum();
    let mut tile = Tile {
        number,
        area,
        color: Vec::new(),
        alpha: Vec::new(),
        aovs: vec![vec![0.0; pixels]; channels],
        rays: RayCounts::default(),
        seconds: ThreadSeconds::default(),
    };
    let samples = tracer.scene.film.samples;
    let transparent = tracer.scene.background == Background::Transparent;
    tile.color.resize(pixels, [0.0; 3]);
    if transparent {
        tile.alpha.resize(pixels, 0.0);
    }
    let width = area.x1 - area.x0;
    let order = block_order(area);
    // As many pixels as there are samples for a batch, or some of a pixel's samples.
    let together = (LARGEST / samples as usize).max(1);
    for some in order.chunks(together) {
        if progress.is_cancelled() {
            return None;
        }
        pixels_together(tracer, camera, some, |x, y, pixel| {
            let at = ((y - area.y0) * width + (x - area.x0)) as usize;
            tile.color[at] = pixel.color;
            if let Some(counter) = counter {
                counter.count(tracer.scene, &pixel.hit);
            }
            if transparent {
                tile.alpha[at] = pixel.alpha;
            }
            if !aovs.is_empty() {
                let first = DVec2::new(f64::from(x), f64::from(y)) + position(x, y, 0, samples);
                record(tracer, camera.ray(first).as_ref(), &pixel.hit, aovs, &mut tile.aovs, at);
            }
        });
    }
    tile.rays = tracer.counts();
    tile.seconds = tracer.seconds();
    Some(tile)
}

/// A tile's pixels in blocks of 4 x 4, so that rays that follow each other go alike.
fn block_order(area: Crop) -> Vec<(u32, u32)> {
    const SIDE: u32 = 4;
    let mut order = Vec::with_capacity(((area.x1 - area.x0) * (area.y1 - area.y0)) as usize);
    for y0 in (area.y0..area.y1).step_by(SIDE as usize) {
        for x0 in (area.x0..area.x1).step_by(SIDE as usize) {
            for y in y0..(y0 + SIDE).min(area.y1) {
                order.extend((x0..(x0 + SIDE).min(area.x1)).map(|x| (x, y)));
            }
        }
    }
    order
}

/// What is known of a pixel.
pub(super) struct Pixel {
    /// The mean of its samples.
    pub color: [f32; 3],
    /// The part of them that hit something.
    pub alpha: f32,
    /// What the first sample hit.
    pub hit: Hit,
}

/// Renders some pixels and hands them over in order.
fn pixels_together<I: Answers>(
    tracer: &Tracer<'_, I>,
    camera: &CameraRays,
    pixels: &[(u32, u32)],
    finished: impl FnMut(u32, u32, Pixel),
) {
    let mut positions = Positions::new(tracer.scene.film.samples);
    let mut samples = Samples {
        views: Vec::with_capacity(LARGEST),
        blind: Vec::new(),
        pixels: pixels.iter(),
        pixel: Sums::default(),
        samples: tracer.scene.film.samples,
        finished,
    };
    let (mut x, mut y) = (Vec::with_capacity(LARGEST), Vec::with_capacity(LARGEST));
    for &pixel in pixels {
        positions.add(pixel, &mut x, &mut y);
    }
    for (x, y) in x.chunks(LARGEST).zip(y.chunks(LARGEST)) {
        camera.rays(x, y, |view| samples.push(view));
        samples.trace(tracer);
    }
}

/// Samples that are traced together, and the pixels that they belong to.
struct Samples<'a, F> {
    views: Vec<ViewRay>,
    /// The positions among the samples of those that have no ray.
    blind: Vec<usize>,
    /// The pixels that are not finished.
    pixels: std::slice::Iter<'a, (u32, u32)>,
    /// The first of them.
    pixel: Sums,
    /// How many a pixel has.
    samples: u32,
    finished: F,
}

/// What is known of a pixel's samples so far.
#[derive(Default)]
pub(super) struct Sums {
    /// In f64, summed in their order.
    color: [f64; 3],
    covered: u32,
    count: u32,
    first: Option<Hit>,
}

impl Sums {
    /// Adds what the next sample saw.
    #[inline(always)]
    pub fn add(&mut self, color: Rgb, hit: Hit) {
        for (sum, value) in self.color.iter_mut().zip(color.to_array()) {
            *sum += f64::from(value);
        }
        self.covered += u32::from(hit.is_hit());
        self.first.get_or_insert(hit);
        self.count += 1;
    }

    /// The mean of all.
    #[inline(always)]
    pub fn mean(&self) -> Pixel {
        let samples = f64::from(self.count);
        let color = self.color.map(|sum| (sum / samples) as f32);
        let alpha = (f64::from(self.covered) / samples) as f32;
        Pixel { color, alpha, hit: self.first.unwrap_or(Hit::MISS) }
    }
}

impl<F: FnMut(u32, u32, Pixel)> Samples<'_, F> {
    fn count(&self) -> usize {
        self.views.len() + self.blind.len()
    }

    #[inline(always)]
    fn push(&mut self, view: Option<ViewRay>) {
        match view {
            Some(view) => self.views.push(view),
            None => self.blind.push(self.count()),
        }
    }

    /// Traces what there is.
    fn trace<I: Answers>(&mut self, tracer: &Tracer<'_, I>) {
        if self.count() == 0 {
            return;
        }
        let (colors, hits) = tracer.trace_cameras(std::mem::replace(&mut self.views, Vec::with_capacity(LARGEST)));
        let blind = std::mem::take(&mut self.blind);
        let mut blind = blind.into_iter().peekable();
        let mut position = 0;
        for (color, hit) in colors.into_iter().zip(hits) {
            while blind.next_if_eq(&position).is_some() {
                self.add(Rgb::ZERO, Hit::MISS);
                position += 1;
            }
            self.add(color, hit);
            position += 1;
        }
        blind.for_each(|_| self.add(Rgb::ZERO, Hit::MISS));
    }

    /// Adds what the next sample saw to its pixel.
    #[inline(always)]
    fn add(&mut self, color: Rgb, hit: Hit) {
        self.pixel.add(color, hit);
        if self.pixel.count == self.samples {
            let pixel = std::mem::take(&mut self.pixel);
            let &(x, y) = self.pixels.next().expect("each pixel has as many samples");
            (self.finished)(x, y, pixel.mean());
        }
    }
}

/// Counts what pixels show, on all threads at once.
struct Counter {
    materials: Vec<AtomicU64>,
    meshes: Vec<AtomicU64>,
}

impl Counter {
    fn new(scene: &Scene) -> Self {
        let zeros = |count: usize| (0..count).map(|_| AtomicU64::new(0)).collect();
        Self { materials: zeros(scene.materials.len()), meshes: zeros(scene.meshes.len()) }
    }

    fn count(&self, scene: &Scene, hit: &Hit) {
        if !hit.is_hit() {
            return;
        }
        self.materials[scene.material_of(hit.instance, hit.primitive) as usize].fetch_add(1, Ordering::Relaxed);
        if let Shape::Mesh(mesh) = scene.objects[hit.instance as usize].shape {
            self.meshes[mesh as usize].fetch_add(1, Ordering::Relaxed);
        }
    }

    fn finish(self) -> Coverage {
        let numbers = |counts: Vec<AtomicU64>| counts.into_iter().map(AtomicU64::into_inner).collect();
        Coverage { materials: numbers(self.materials), meshes: numbers(self.meshes) }
    }
}

/// Sets one pixel's extra values, channel by channel.
fn record<I: Answers>(
    tracer: &Tracer<'_, I>,
    view: Option<&ViewRay>,
    hit: &Hit,
    aovs: &[AovKind],
    channels: &mut [Vec<f32>],
    at: usize,
) {
    let found = view.filter(|_| hit.is_hit()).map(|view| SurfacePoint::of(tracer.scene, tracer.world, view, hit));
    let mut channels = channels.iter_mut();
    for kind in aovs {
        let values = match (&found, kind) {
            (None, AovKind::Depth) => [f32::INFINITY, 0.0, 0.0],
            (None, _) => [0.0; 3],
            (Some(_), AovKind::Depth) => [hit.t, 0.0, 0.0],
            (Some(point), AovKind::Normal) => point.normal.as_vec3().to_array(),
            (Some(point), AovKind::Position) => (point.position + tracer.scene.origin).as_vec3().to_array(),
            (Some(point), AovKind::Uv) => {
                let uv = point.texture_coordinates(tracer.scene, hit);
                [uv.x as f32, uv.y as f32, 0.0]
            }
            (Some(_), AovKind::Id) => [f32::from_bits(hit.instance + 1), f32::from_bits(hit.primitive + 1), 0.0],
            (Some(point), AovKind::Albedo) => tracer.colors(point, hit).diffuse.to_array(),
        };
        for (value, channel) in values.into_iter().zip(channels.by_ref().take(kind.channels().len())) {
            channel[at] = value;
        }
    }
}
