//! `whitted render`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::arguments::RenderArguments;
use super::ledger::{self, Told};
use super::memory_limit::picture_bytes;
use super::outputs::{Outputs, Picture};
use super::precision::{AnyRenderer, Precision};
use super::stats_json::{Bytes, SCHEMA, Seconds, Settings, Stats, timed};
use super::terminal::{self, Terminal};
use super::{camera, outputs};
use crate::error::{Error, Result};
use crate::formats::reach::PixelCounts;
use crate::formats::{self, Ledger, picture};
use crate::progress::Progress;
use crate::render::{Crop, Film};
use crate::scene::{FilmSettings, Scene};

/// Renders a picture and writes all that was asked for.
///
/// # Errors
/// Whatever stops it; [`Error::cancelled`] after Ctrl-C, when the picture's file is left as it was.
pub fn run(arguments: &RenderArguments) -> Result<()> {
    let outputs = Outputs::plan(arguments)?;
    if outputs.scene.is_some() && formats::is_scene(&arguments.input)? {
        return Err(Error::caller("this is a scene file already; only what was chosen for a model can be saved")
            .at_path(&arguments.input)
            .remedy("leave out --save-scene"));
    }
    let terminal = Terminal::new(arguments.quiet)?;
    super::use_threads(arguments.build.threads)?;
    let mut seconds = Seconds::default();
    let report_time = |stage: &str, seconds: f64| {
        if arguments.verbose {
            terminal::report(&format!("{stage:8} {seconds:9.3} s"));
        }
    };

    let options = arguments.load.options();
    let loaded;
    (loaded, seconds.load) = timed(|| formats::open(&arguments.input, &options, &terminal));
    terminal.clear();
    let formats::Loaded { mut scene, ledger, automatic } = loaded?;
    // With --verbose they come with all else, once it is known in how many pixels they are seen.
    let told = if arguments.quiet || arguments.verbose { Told::Nothing } else { Told::Warnings };
    ledger::report(&arguments.input, &ledger, &scene, told, arguments.load.strict)?;
    outputs.refuse_inputs(ledger.files())?;
    report_time("load", seconds.load);
    terminal.check()?;
    arguments.film.apply(&mut scene.film);
    if let Some(crop) = arguments.film.crop {
        check_crop(crop, &scene.film)?;
    }
    let resized = arguments.film.values.size.is_some();
    camera::choose(&mut scene, automatic, &arguments.camera, resized)?;
    if let Some(path) = &outputs.scene {
        formats::scene_file::save_model_scene(&scene, &arguments.input, &options, path)?;
    }

    let settings = arguments.settings();
    if arguments.precision == Precision::F64 {
        arguments.build.refuse_limit("--precision f64")?;
    }
    let picture = picture_bytes(&scene.film, settings.crop, &settings.aovs);
    let params = arguments.build.params(&scene, picture)?;
    let renderer;
    (renderer, seconds.build) = timed(|| AnyRenderer::build(scene, arguments.precision, &params, &terminal));
    terminal.clear();
    let renderer = renderer?;
    report_time("build", seconds.build);

    let film;
    (film, seconds.render) = timed(|| renderer.render(&settings, &terminal));
    terminal.clear();
    let film = film?;
    report_time("render", seconds.render);
    if arguments.verbose {
        report_ledger(&ledger, renderer.scene(), &film);
    }
    if !film.complete {
        return Err(save_partial(&film, &outputs, arguments.quiet));
    }

    let written;
    (written, seconds.write) = timed(|| write(&film, &outputs));
    written?;
    report_time("write", seconds.write);
    if arguments.verbose {
        report_rays(&film, seconds.render);
    }
    if let Some(path) = &outputs.stats {
        let scene = renderer.scene();
        let build = renderer.build_stats();
        let stats = Stats {
            schema: SCHEMA,
            version: env!("CARGO_PKG_VERSION"),
            input: &arguments.input,
            output: outputs.picture.path(),
            settings: Settings {
                film: scene.film,
                camera: &scene.cameras[scene.active_camera].name,
                crop: settings.crop,
                aov: &settings.aovs,
                precision: arguments.precision,
                accelerator: &build.accelerator,
                preset: arguments.build.preset,
                threads: film.stats.threads,
            },
            rays: film.stats.rays.into(),
            rays_per_second: film.stats.rays.total() as f64 / seconds.render.max(f64::MIN_POSITIVE),
            seconds,
            thread_seconds: film.stats.thread_seconds,
            bytes: Bytes::of(scene, build, &film),
        };
        let text = serde_json::to_string_pretty(&stats).expect("names and numbers have a JSON form");
        outputs::write_text(path, &(text + "\n"))?;
    }
    match &outputs.picture {
        Picture::File(path) if !arguments.quiet => terminal::print(format!("{}\n", path.display()).as_bytes()),
        _ => Ok(()),
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

fn write(film: &Film, outputs: &Outputs) -> Result<()> {
    match &outputs.picture {
        Picture::Stdout => write_to_stdout(film)?,
        Picture::File(path) => picture::save(film, path)?,
    }
    outputs.aov_file.as_deref().map_or(Ok(()), |path| picture::save(film, path))
}

/// Unlike text, a picture that its reader cut short is a failure: it did not arrive.
fn write_to_stdout(film: &Film) -> Result<()> {
    let mut stdout = BufWriter::new(io::stdout().lock());
    picture::write_png(film, &mut stdout)?;
    stdout.flush().map_err(|error| Error::system(Path::new("standard output"), error))
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
