//! `RayTracing`: the frame loop, tile by tile.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec2;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::progress::Progress;
use crate::render::answers::Answers;
use crate::render::film::{Aov, AovKind, Film};
use crate::render::sampling::{Positions, position};
use crate::render::settings::{Coverage, Crop, RayCounts, RenderSettings, RenderStats, ThreadSeconds};
use crate::render::surface::SurfacePoint;
use crate::render::trace::Tracer;
use crate::render::wave::LARGEST;
use crate::render::world::World;
use crate::scene::camera::{CameraRays, ViewRay};
use crate::scene::{Background, Rgb, Scene, Shape};

/// Side of a tile in pixels: 32 x 32 pixels keep a thread busy for long enough and share well.
const TILE: u32 = 32;

/// Stack of a rendering thread: 16 KiB for each level of the deepest recursion,
/// [`LARGEST_DEPTH`](crate::scene::film::LARGEST_DEPTH), which a test goes to.
pub(super) const STACK: usize = 16 << 20;

/// The most pixels that are rendered at once: 2^28, which take 6 GiB while tiles are put together.
const LARGEST_PICTURE: u64 = 1 << 28;

/// One tile's pixels, rows from the top.
#[derive(Debug, Clone)]
pub struct Tile {
    /// Where it is in the picture.
    pub area: Crop,
    /// Linear colours.
    pub color: Vec<[f32; 3]>,
    /// How much of each pixel is covered; empty unless the background is transparent.
    pub alpha: Vec<f32>,
    aovs: Vec<Vec<f32>>,
    counts: RayCounts,
    seconds: ThreadSeconds,
}

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
    film.check()?;
    let camera = scene.camera().rays(film.width, film.height, scene.origin)?;
    let area = settings.crop.unwrap_or(Crop { x0: 0, y0: 0, x1: film.width, y1: film.height });
    if !(area.x0 < area.x1 && area.y0 < area.y1 && area.x1 <= film.width && area.y1 <= film.height) {
        return Err(Error::caller(format!(
            "the crop {},{},{},{} does not lie within the {}x{} picture",
            area.x0, area.y0, area.x1, area.y1, film.width, film.height
        )));
    }
    if u64::from(area.x1 - area.x0) * u64::from(area.y1 - area.y0) > LARGEST_PICTURE {
        return Err(Error::limit(format!("a picture of more than {LARGEST_PICTURE} pixels does not fit in memory"))
            .remedy("render parts of it with a crop"));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(settings.threads)
        .stack_size(STACK)
        .build()
        .map_err(|cause| Error::limit(format!("cannot start {} threads: {cause}", settings.threads)))?;

    let counter = settings.coverage.then(|| Counter::new(scene));
    let tiles = tiles_of(area);
    progress.begin("render", tiles.len() as u64);
    let start = std::time::Instant::now();
    let render_tile = |&tile: &Crop| {
        let tracer = Tracer::new(scene, world, intersect);
        let tile = tile_pixels(&tracer, &camera, tile, &settings.aovs, counter.as_ref(), progress)?;
        finished(&tile);
        progress.advance(1);
        Some(tile)
    };
    let finished: Vec<Option<Tile>> = pool.install(|| tiles.par_iter().map(render_tile).collect());
    let seconds = start.elapsed().as_secs_f64();

    let (width, height) = (area.x1 - area.x0, area.y1 - area.y0);
    let pixels = width as usize * height as usize;
    let transparent = scene.background == Background::Transparent;
    let mut picture = Film {
        width,
        height,
        crop: settings.crop,
        color: vec![[0.0; 3]; pixels],
        alpha: transparent.then(|| vec![0.0; pixels]),
        aovs: settings
            .aovs
            .iter()
            .map(|&kind| Aov { kind, channels: vec![vec![0.0; pixels]; kind.channels().len()] })
            .collect(),
        settings: *film,
        complete: finished.iter().all(Option::is_some),
        coverage: counter.map(Counter::finish),
        stats: RenderStats { seconds, threads: pool.current_num_threads(), ..RenderStats::default() },
    };
    for tile in finished.into_iter().flatten() {
        picture.stats.rays += tile.counts;
        picture.stats.thread_seconds += tile.seconds;
        copy_tile(&mut picture, area, &tile);
    }
    let ThreadSeconds { traversal, shading, rest } = &mut picture.stats.thread_seconds;
    *rest = (seconds * picture.stats.threads as f64 - *traversal - *shading).max(0.0);
    Ok(picture)
}

/// The tiles of an area, row by row. They lie on the grid of the full picture, so that a crop traces the same tiles.
fn tiles_of(area: Crop) -> Vec<Crop> {
    let mut tiles = Vec::new();
    let first = |start: u32| start / TILE * TILE;
    for y in (first(area.y0)..area.y1).step_by(TILE as usize) {
        for x in (first(area.x0)..area.x1).step_by(TILE as usize) {
            tiles.push(Crop {
                x0: x.max(area.x0),
                y0: y.max(area.y0),
                x1: x.saturating_add(TILE).min(area.x1),
                y1: y.saturating_add(TILE).min(area.y1),
            });
        }
    }
    tiles
}

/// Renders one tile; `None` once the work is cancelled.
fn tile_pixels<I: Answers>(
    tracer: &Tracer<'_, I>,
    camera: &CameraRays,
    area: Crop,
    aovs: &[AovKind],
    counter: Option<&Counter>,
    progress: &dyn Progress,
) -> Option<Tile> {
    let pixels = ((area.x1 - area.x0) * (area.y1 - area.y0)) as usize;
    let channels = aovs.iter().map(|kind| kind.channels().len()).sum();
    let mut tile = Tile {
        area,
        color: Vec::new(),
        alpha: Vec::new(),
        aovs: vec![vec![0.0; pixels]; channels],
        counts: RayCounts::default(),
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
    tile.counts = tracer.counts();
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

fn copy_tile(picture: &mut Film, area: Crop, tile: &Tile) {
    let tile_width = (tile.area.x1 - tile.area.x0) as usize;
    for (row, y) in (tile.area.y0..tile.area.y1).enumerate() {
        let from = row * tile_width..(row + 1) * tile_width;
        let start = (y - area.y0) as usize * picture.width as usize + (tile.area.x0 - area.x0) as usize;
        let to = start..start + tile_width;
        picture.color[to.clone()].copy_from_slice(&tile.color[from.clone()]);
        if let Some(alpha) = &mut picture.alpha {
            alpha[to.clone()].copy_from_slice(&tile.alpha[from.clone()]);
        }
        let channels = picture.aovs.iter_mut().flat_map(|aov| &mut aov.channels);
        for (channel, values) in channels.zip(&tile.aovs) {
            channel[to.clone()].copy_from_slice(&values[from.clone()]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_an_area_once() {
        for area in [Crop { x0: 0, y0: 0, x1: 70, y1: 33 }, Crop { x0: 31, y0: 5, x1: 65, y1: 6 }] {
            let mut seen = std::collections::HashSet::new();
            for tile in tiles_of(area) {
                for y in tile.y0..tile.y1 {
                    for x in tile.x0..tile.x1 {
                        assert!(seen.insert((x, y)));
                    }
                }
            }
            assert_eq!(seen.len() as u32, (area.x1 - area.x0) * (area.y1 - area.y0));
        }
    }
}
