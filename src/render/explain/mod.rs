//! Why a pixel has its colour: its samples, the rays of each, and every term of the shading formula in the order in which
//! they are summed.
//!
//! The code that shades tells what it does to a recorder, so that nothing here is computed a second time or in another way;
//! [replaying](Explanation::replay) the terms in their order gives the colours again, bit for bit. All of it is plain data
//! with numbers as the renderer has them: places are in the file's coordinates, colours linear, before exposure and
//! encoding.

mod node;
mod recorder;
mod replay;
mod serial;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::Hit;
use crate::progress::Progress;
use crate::render::answers::Answers;
use crate::render::ray_tracing::{STACK, Sums};
use crate::render::sampling::position;
use crate::render::trace::Tracer;
use crate::render::world::World;
use crate::scene::{Background, Rgb, Scene};

pub use node::{
    Arrival, BackgroundKind, Crossing, Dark, End, Found, LightTerm, Lighting, RayNode, Stop, Surface, Term, Way,
};
use recorder::Recorder;
pub use replay::replay;

/// The most that is recorded of a pixel: rays, lights at points and surfaces between them, all samples together. That many
/// take about 100 MB.
pub const MOST_RECORDS: usize = 1 << 18;

/// Which samples are explained; the others are rendered, and their colours listed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Samples {
    /// All of them.
    All,
    /// This one, counted from 0.
    One(u32),
}

/// A pixel and what it is the mean of.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Explanation {
    /// Column, from the left.
    pub x: u32,
    /// Row, from the top.
    pub y: u32,
    /// The pixel: the samples' colours in f64, added one after another to 0, divided by their number, rounded to f32.
    #[serde(serialize_with = "serial::color")]
    pub color: Rgb,
    /// The share of the samples that hit something, where the background is transparent.
    pub alpha: Option<f32>,
    /// All samples, in the order of their sum.
    pub samples: Vec<Sample>,
}

/// One sample of a pixel.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Sample {
    /// From 0.
    pub number: u32,
    /// Where it lies in the pixel, from 0 to 1, to the right and down.
    #[serde(serialize_with = "serial::place")]
    pub position: DVec2,
    /// What it saw.
    #[serde(serialize_with = "serial::color")]
    pub color: Rgb,
    /// Whether its camera ray hit something.
    pub hit: bool,
    /// The camera ray, then those that came of it, each after the one that it came of. `None` if this sample was not to be
    /// explained; empty if the camera has no ray there, which is black.
    pub rays: Option<Vec<RayNode>>,
}

/// Explains one pixel of the active camera's picture.
///
/// # Errors
/// A pixel outside the picture, a sample that it does not have, more than [`MOST_RECORDS`] to tell, a degenerate camera, a film
/// beyond its limits, a cancellation.
pub(super) fn explain<I: Answers>(
    scene: &Scene,
    world: &World,
    intersect: &I,
    pixel: (u32, u32),
    samples: Samples,
    progress: &dyn Progress,
) -> Result<Explanation> {
    check(scene, pixel, samples)?;
    // As deep a recursion as when pictures are rendered.
    std::thread::scope(|scope| {
        let work = || explain_here(scene, world, intersect, pixel, samples, progress);
        let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, work);
        let thread = thread.map_err(|cause| Error::limit(format!("cannot start a thread: {cause}")))?;
        thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Whether there is such a pixel with such samples.
fn check(scene: &Scene, (x, y): (u32, u32), samples: Samples) -> Result<()> {
    let film = &scene.film;
    film.check()?;
    if x >= film.width || y >= film.height {
        let message = format!("the pixel {x},{y} does not lie within the {}x{} picture", film.width, film.height);
        let remedy = format!("X can be {} and Y {} at most", film.width - 1, film.height - 1);
        return Err(Error::caller(message).remedy(remedy));
    }
    match samples {
        Samples::One(number) if number >= film.samples => {
            let message = format!("there is no sample {number}: pixels have {}", film.samples);
            Err(Error::caller(message).remedy(format!("samples are numbered from 0 to {}", film.samples - 1)))
        }
        _ => Ok(()),
    }
}

fn explain_here<I: Answers>(
    scene: &Scene,
    world: &World,
    intersect: &I,
    (x, y): (u32, u32),
    which: Samples,
    progress: &dyn Progress,
) -> Result<Explanation> {
    let film = &scene.film;
    let camera = scene.camera().rays(film.width, film.height, scene.origin)?;
    let tracer = Tracer::new(scene, world, intersect);
    let mut sums = Sums::default();
    let mut samples = Vec::new();
    let mut room = MOST_RECORDS;
    for number in 0..film.samples {
        progress.check()?;
        let position = position(x, y, number, film.samples);
        let view = camera.ray(DVec2::new(f64::from(x), f64::from(y)) + position);
        let is_explained = which == Samples::All || which == Samples::One(number);
        let mut recorder = Recorder::new(scene, room);
        let (color, hit) = match view {
            Some(view) if is_explained => tracer.watch_camera(view, &mut recorder),
            Some(view) => tracer.trace_camera(view),
            None => (Rgb::ZERO, Hit::MISS),
        };
        if recorder.room == 0 {
            return Err(Error::limit(format!("there are more than {MOST_RECORDS} rays and lights to tell of"))
                .remedy("ask for one sample, or for a smaller depth"));
        }
        room = recorder.room;
        sums.add(color, hit);
        samples.push(Sample {
            number,
            position,
            color,
            hit: hit.is_hit(),
            rays: is_explained.then_some(recorder.rays),
        });
    }
    let pixel = sums.mean();
    let alpha = (scene.background == Background::Transparent).then_some(pixel.alpha);
    Ok(Explanation { x, y, color: Rgb::from_array(pixel.color), alpha, samples })
}
