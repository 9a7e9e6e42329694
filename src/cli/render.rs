//! `whitted render`.

use std::path::Path;

use super::arguments::RenderArguments;
use super::build::{Plan, open_scene};
use super::ledger::{self, Told};
use super::memory_limit::picture_bytes;
use super::outputs::Outputs;
use super::precision::{AnyRenderer, Precision};
use super::stats_json::{Bytes, SCHEMA, Seconds, Settings, Stats, timed};
use super::terminal::{self, Terminal};
use super::{camera, job, outputs};
use crate::accel::Preset;
use crate::error::{Error, Result};
use crate::formats::atomic_file::sync;
use crate::formats::reach::PixelCounts;
use crate::formats::{self, Ledger, picture};
use crate::job::Header;
use crate::progress::Progress;
use crate::render::{Crop, Film, RenderSettings};
use crate::scene::auto::Automatic;
use crate::scene::{FilmSettings, NamedCamera, Scene};

/// Renders a picture and writes all that was asked for.
///
/// # Errors
/// Whatever stops it; [`Error::cancelled`] after Ctrl-C, when the picture's file is left as it was.
pub fn run(arguments: &RenderArguments) -> Result<()> {
    if let Some(limit) = arguments.job.time_limit {
        terminal::set_time_limit(limit);
    }
    let outputs = Outputs::plan(arguments)?;
    if outputs.scene.is_some() && formats::is_built(&arguments.input)? {
        return Err(Error::unsupported("a built scene cannot be saved as a scene file")
            .at_path(&arguments.input)
            .remedy("say --save-scene with the model that it was built from"));
    }
    if outputs.scene.is_some() && formats::is_scene(&arguments.input)? {
        return Err(Error::caller("this is a scene file already; only what was chosen for a model can be saved")
            .at_path(&arguments.input)
            .remedy("leave out --save-scene"));
    }
    let mut pictures: Vec<(Option<i32>, Outputs)> = match arguments.job.frames_here() {
        None => vec![(None, outputs)],
        Some(frames) => frames.map(|frame| Ok((Some(frame), outputs.for_frame(frame)?))).collect::<Result<_>>()?,
    };
    let is_there = |outputs: &Outputs| outputs.pictures().next().is_some() && outputs.pictures().all(Path::exists);
    pictures.retain(|(_, outputs)| !(arguments.job.skip_existing && is_there(outputs)));
    if pictures.is_empty() {
        return Ok(());
    }
    let terminal = Terminal::new(arguments.quiet)?;
    super::use_threads(arguments.build.threads)?;
    let mut seconds = Seconds::default();

    let options = arguments.load.options();
    if arguments.precision == Precision::F32 {
        arguments.build.refuse_what_does_not_fit(&arguments.input, &options)?;
    }
    let loaded;
    (loaded, seconds.load) = timed(|| open_scene(&arguments.input, &arguments.load, &options, &terminal));
    terminal.clear();
    let formats::Loaded { mut scene, ledger, automatic, built } = loaded?;
    // With --verbose they come with all else, once it is known in how many pixels they are seen.
    let told = if arguments.quiet || arguments.verbose { Told::Nothing } else { Told::Warnings };
    ledger::report(&arguments.input, &ledger, &scene, told, arguments.load.strict)?;
    pictures.iter().try_for_each(|(_, outputs)| outputs.refuse_inputs(ledger.files()))?;
    report_time(arguments, "load", seconds.load);
    if let Some(built) = built.as_deref().filter(|_| arguments.verbose) {
        let rate = built.bytes as f64 / 1e9 / built.check_seconds.max(f64::MIN_POSITIVE);
        terminal::report(&format!("check    {:9.3} s, {rate:.2} GB a second", built.check_seconds));
    }
    terminal.check()?;
    arguments.film.apply(&mut scene.film);
    if let Some(crop) = arguments.film.crop {
        check_crop(crop, &scene.film)?;
    }
    let resized = arguments.film.values.size.is_some();
    let turns = arguments.job.turntable.is_some();
    camera::choose(&mut scene, automatic, &arguments.camera, resized, turns)?;
    arguments.job.move_camera(&mut scene)?;
    if let Some(path) = &pictures[0].1.scene {
        formats::scene_file::save_model_scene(&scene, &arguments.input, &options, path)?;
    }

    let settings = arguments.settings();
    if arguments.precision == Precision::F64 {
        arguments.build.refuse_limit("--precision f64")?;
    }
    let header = if arguments.job.writes_tiles() {
        let origin = job::Origin::of(arguments, &ledger, built.as_deref())?;
        Some(job::header(origin, &scene, &settings, arguments.precision))
    } else {
        None
    };
    let camera = scene.cameras[scene.active_camera].clone();
    let picture = picture_bytes(&scene, settings.crop, &settings.aovs);
    let plan = Plan::of(&arguments.build, &scene, built.as_deref(), picture)?;
    let renderer;
    (renderer, seconds.build) = timed(|| AnyRenderer::build(scene, arguments.precision, &plan, &terminal));
    terminal.clear();
    let renderer = renderer?;
    report_time(arguments, "build", seconds.build);

    let mut work = Work {
        arguments,
        ledger,
        settings,
        preset: plan.preset(),
        header,
        camera,
        automatic,
        renderer,
        seconds,
        terminal: &terminal,
    };
    pictures.iter().try_for_each(|(frame, outputs)| work.picture(*frame, outputs))
}

/// A scene that is built, and what its pictures have in common.
struct Work<'a> {
    arguments: &'a RenderArguments,
    ledger: Ledger,
    settings: RenderSettings,
    /// How the trees were built.
    preset: Preset,
    /// Without a frame and a share.
    header: Option<Header>,
    /// The camera, and how it moves.
    camera: NamedCamera,
    /// Whether lights follow it.
    automatic: Automatic,
    renderer: AnyRenderer,
    seconds: Seconds,
    terminal: &'a Terminal,
}

impl Work<'_> {
    /// Renders one picture, or a share of it, and writes all that belongs to it.
    fn picture(&mut self, frame: Option<i32>, outputs: &Outputs) -> Result<()> {
        let Self { arguments, ledger, settings, header, camera, automatic, renderer, seconds, terminal, .. } = self;
        if let Some(frame) = frame {
            let camera = camera.in_frame(frame);
            renderer.look_through(camera);
            if automatic.lights {
                renderer.set_lights(automatic.lights_of(&camera))?;
            }
        }
        let share = outputs.part.as_ref().and(arguments.job.part);
        let header = header.as_ref().filter(|_| share.is_some() || arguments.job.resume);
        let header = header.map(|header| Header { frame, share, ..header.clone() });
        let resume = arguments.job.resume;
        let film;
        (film, seconds.render) = timed(|| match (&header, outputs.target()) {
            (Some(header), Some(target)) => job::render(renderer, header, settings, target, resume, terminal),
            _ => Ok((renderer.render_tiles(settings, *terminal, &|_| ())?, None)),
        });
        terminal.clear();
        let (film, kept) = film?;
        report_time(arguments, "render", seconds.render);
        if arguments.verbose {
            report_ledger(ledger, renderer.scene(), &film);
        }
        if !film.complete {
            return Err(save_partial(&film, outputs, arguments.quiet));
        }
        if outputs.part.is_none() {
            let written;
            (written, seconds.write) = timed(|| outputs.write(&film));
            written?;
        }
        if let Some(kept) = kept {
            outputs.pictures().try_for_each(sync)?;
            kept.remove()?;
        }
        report_time(arguments, "write", seconds.write);
        if arguments.verbose {
            report_rays(&film, seconds.render);
        }
        if let Some(path) = &outputs.stats {
            outputs::write_text(path, &self.stats(&film, outputs))?;
        }
        match outputs.target() {
            Some(path) if !self.arguments.quiet => terminal::print(format!("{}\n", path.display()).as_bytes()),
            _ => Ok(()),
        }
    }

    /// Rays, times and memory as JSON.
    fn stats(&self, film: &Film, outputs: &Outputs) -> String {
        let Self { arguments, settings, preset, renderer, seconds, .. } = self;
        let scene = renderer.scene();
        let build = renderer.build_stats();
        let stats = Stats {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            input: &arguments.input,
            output: outputs.target(),
            settings: Settings {
                film: scene.film,
                camera: &scene.cameras[scene.active_camera].name,
                crop: settings.crop,
                aov: &settings.aovs,
                precision: arguments.precision,
                accelerator: &build.accelerator,
                preset: *preset,
                threads: film.stats.threads,
            },
            rays: film.stats.rays.into(),
            rays_per_second: film.stats.rays.total() as f64 / seconds.render.max(f64::MIN_POSITIVE),
            seconds: *seconds,
            thread_seconds: film.stats.thread_seconds,
            bytes: Bytes::of(scene, build, film),
        };
        serde_json::to_string_pretty(&stats).expect("names and numbers have a JSON form") + "\n"
    }
}

/// The time of a stage, where that is asked for.
fn report_time(arguments: &RenderArguments, stage: &str, seconds: f64) {
    if arguments.verbose {
        terminal::report(&format!("{stage:8} {seconds:9.3} s"));
    }
}

/// A crop must lie within the picture.
fn check_crop(crop: Crop, film: &FilmSettings) -> Result<()> {
    if crop.x1 <= film.width && crop.y1 <= film.height {
        return Ok(());
    }
    let Crop { x0, y0, x1, y1 } = crop;
    let FilmSettings { width, height, .. } = film;
    Err(Error::caller(format!(
        "the crop {x0},{y0},{x1},{y1} reaches beyond the picture, which has {width}x{height} pixels"
    ))
    .remedy(format!("X1 can be {width} and Y1 {height} at most")))
}

/// Writes what an interrupted rendering finished. The error it gives is that of the interrupt, or of the writing.
fn save_partial(film: &Film, outputs: &Outputs, quiet: bool) -> Error {
    let Some(path) = &outputs.partial else {
        return Error::cancelled();
    };
    match outputs.refuse_clobber(path).and_then(|()| picture::save(film, path)) {
        Ok(()) if quiet => {}
        Ok(()) => terminal::report(&format!("interrupted: {} has what was finished", path.display())),
        Err(error) => terminal::report(&format!("error: {error}")),
    }
    Error::cancelled()
}

/// All that was noted while reading, with the pixels in which it is seen.
fn report_ledger(ledger: &Ledger, scene: &Scene, film: &Film) {
    let pixels = film
        .coverage
        .as_ref()
        .map(|coverage| PixelCounts { by_material: &coverage.materials, by_mesh: &coverage.meshes });
    ledger::lines(ledger, scene, pixels, |_| true).iter().for_each(|line| terminal::report(line));
}

fn report_rays(film: &Film, seconds: f64) {
    let rays = film.stats.rays;
    let rate = rays.total() as f64 / 1e6 / seconds.max(f64::MIN_POSITIVE);
    terminal::report(&format!(
        "rays     {}: {} camera, {} shadow, {} reflected, {} refracted; {rate:.2} million a second on {} threads",
        rays.total(),
        rays.camera,
        rays.shadow,
        rays.reflected,
        rays.refracted,
        film.stats.threads
    ));
}
