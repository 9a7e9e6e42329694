//! Work beside the window: building what rays are asked of, and rendering, on a thread that can be told to stop.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::accel::Params;
use crate::error::{Error, Result};
use crate::formats::picture::{exposure_factor, pixel_bytes};
use crate::progress::Progress;
use crate::render::{Crop, Film, RenderSettings, Renderer, Tile};
use crate::scene::{FilmSettings, Scene};

/// What there is to do with a scene.
struct Task {
    number: u64,
    revision: u64,
    scene: Arc<Scene>,
    /// Rendered, or built only.
    render: Option<RenderSettings>,
    watch: Arc<Watch>,
}

/// What a thread reports.
pub enum Event {
    /// A scene can be asked for hits.
    Built {
        /// Which.
        revision: u64,
        /// Its structures.
        renderer: Arc<Renderer>,
    },
    /// Some of the picture is there.
    Tile {
        /// Where it is in the picture.
        area: Crop,
        /// Red, green, blue and alpha, as a PNG would have them.
        pixels: Vec<[u8; 4]>,
    },
    /// The picture is there, or what there is of one that was stopped.
    Rendered(Box<Film>),
    /// It could not be done.
    Failed(Error),
}

/// How far the work is.
#[derive(Default)]
pub struct Watch {
    stage: Mutex<&'static str>,
    total: AtomicU64,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Watch {
    /// What is being done, and what part of it is, from 0 to 1.
    pub fn so_far(&self) -> (&'static str, f32) {
        let stage = *self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let total = self.total.load(Ordering::Relaxed);
        let done = self.done.load(Ordering::Relaxed).min(total);
        (stage, if total == 0 { 0.0 } else { done as f32 / total as f32 })
    }

    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }
}

impl Progress for Watch {
    fn begin(&self, stage: &'static str, total: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = stage;
        self.total.store(total, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

/// A thread that works on one thing at a time.
pub struct Worker {
    /// None once the thread is to end.
    tasks: Option<Sender<Task>>,
    events: Receiver<(u64, Event)>,
    thread: Option<JoinHandle<()>>,
    current: Option<Current>,
    /// The latest that was built.
    renderer: Option<(u64, Arc<Renderer>)>,
    /// How many tasks were given: the number of the last.
    given: u64,
}

/// What the thread is asked for.
struct Current {
    watch: Arc<Watch>,
    revision: u64,
    renders: bool,
    started: Instant,
}

impl Worker {
    /// Starts the thread. `wake` is called when there is an event.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Result<Self> {
        let (tasks, received) = channel::<Task>();
        let (report, events) = channel();
        let run = move || {
            let mut before = None;
            for task in received {
                let send = |event| {
                    // Nobody waits for it any more once the window is closed.
                    let _ = report.send((task.number, event));
                    wake();
                };
                if let Err(error) = work(&task, &mut before, &send) {
                    send(Event::Failed(error));
                }
            }
        };
        let thread = std::thread::Builder::new().name("render".into()).spawn(run);
        let thread = thread.map_err(|cause| Error::limit(format!("cannot start a thread: {cause}")))?;
        Ok(Self { tasks: Some(tasks), events, thread: Some(thread), current: None, renderer: None, given: 0 })
    }

    /// Builds a scene so that it can be asked for hits, unless it is built or being built.
    pub fn build(&mut self, revision: u64, scene: &Arc<Scene>) {
        let is_known = self.renderer.as_ref().is_some_and(|(known, _)| *known == revision);
        if !is_known && self.current.as_ref().is_none_or(|current| current.revision != revision) {
            self.start(revision, scene, None);
        }
    }

    /// Renders a scene, or a part of its picture; whatever was being done is stopped.
    pub fn render(&mut self, revision: u64, scene: &Arc<Scene>, crop: Option<Crop>) {
        self.start(revision, scene, Some(RenderSettings { crop, ..Default::default() }));
    }

    fn start(&mut self, revision: u64, scene: &Arc<Scene>, render: Option<RenderSettings>) {
        self.cancel();
        self.given += 1;
        let watch = Arc::new(Watch::default());
        let renders = render.is_some();
        let task = Task { number: self.given, revision, scene: Arc::clone(scene), render, watch: Arc::clone(&watch) };
        if self.tasks.as_ref().is_some_and(|tasks| tasks.send(task).is_ok()) {
            self.current = Some(Current { watch, revision, renders, started: Instant::now() });
        }
    }

    /// Stops what is being done.
    pub fn cancel(&mut self) {
        if let Some(current) = self.current.take() {
            current.watch.cancel();
        }
    }

    /// The next event of the latest task; those of earlier ones are passed over.
    pub fn poll(&mut self) -> Option<Event> {
        loop {
            let (number, event) = self.events.try_recv().ok()?;
            if let Event::Built { revision, renderer } = &event {
                self.renderer = Some((*revision, Arc::clone(renderer)));
            }
            let is_latest = number == self.given;
            let ends = match &event {
                Event::Built { .. } => self.current.as_ref().is_some_and(|current| !current.renders),
                Event::Rendered(_) | Event::Failed(_) => true,
                Event::Tile { .. } => false,
            };
            if is_latest && ends {
                self.current = None;
            }
            if is_latest {
                return Some(event);
            }
        }
    }

    /// A scene's structures, if they are built.
    pub fn renderer(&self, revision: u64) -> Option<&Arc<Renderer>> {
        self.renderer.as_ref().filter(|(known, _)| *known == revision).map(|(_, renderer)| renderer)
    }

    /// How far a rendering is: what is being done, what part of it is done, and for how long.
    pub fn rendering(&self) -> Option<(&'static str, f32, Duration)> {
        let current = self.current.as_ref().filter(|current| current.renders)?;
        let (stage, part) = current.watch.so_far();
        Some((stage, part, current.started.elapsed()))
    }

    /// Whether anything is being done.
    pub fn is_busy(&self) -> bool {
        self.current.is_some()
    }
}

impl Drop for Worker {
    /// Stops the work and waits for the thread.
    fn drop(&mut self) {
        self.cancel();
        self.tasks = None;
        if let Some(thread) = self.thread.take() {
            // A panic has been reported by then.
            let _ = thread.join();
        }
    }
}

/// Does a task. A scene that was built before is not built again, and neither are the trees of meshes that it shares.
fn work(task: &Task, before: &mut Option<(u64, Arc<Renderer>)>, send: &(dyn Fn(Event) + Sync)) -> Result<()> {
    let watch = &*task.watch;
    watch.check()?;
    let renderer = match before {
        Some((revision, renderer)) if *revision == task.revision => Arc::clone(renderer),
        _ => {
            let (scene, params) = (Scene::clone(&task.scene), Params::default());
            let built = match before {
                Some((_, renderer)) => renderer.rebuild(scene, &params, watch)?,
                None => Renderer::build(scene, &params, watch)?,
            };
            Arc::new(built)
        }
    };
    *before = Some((task.revision, Arc::clone(&renderer)));
    send(Event::Built { revision: task.revision, renderer: Arc::clone(&renderer) });
    let Some(settings) = &task.render else { return Ok(()) };
    let film = &renderer.scene().film;
    let finished = |tile: &Tile| {
        send(Event::Tile { area: tile.area, pixels: encoded(tile, film) });
    };
    let film = renderer.render_tiles(settings, watch, &finished)?;
    send(Event::Rendered(Box::new(film)));
    Ok(())
}

/// A tile's pixels as a PNG would have them.
fn encoded(tile: &Tile, film: &FilmSettings) -> Vec<[u8; 4]> {
    let exposure = exposure_factor(film);
    let pixel = |(at, color)| pixel_bytes(color, tile.alpha.get(at).copied(), exposure, film.transfer);
    tile.color.iter().enumerate().map(pixel).collect()
}
