//! `whitted explain`: why a pixel has its colour. Its JSON is documented in the manual's page on the command line, and
//! stable: a change that breaks a reader raises `schema`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use serde::Serialize;

use super::arguments::{BuildArguments, CameraArguments, LoadArguments, ValueArguments};
use super::build::{Plan, open_scene};
use super::ledger::{self, Told};
use super::stats_json::{SCHEMA, lossy};
use super::terminal::{self, Terminal};
use super::{camera, explain_text, values};
use crate::error::Result;
use crate::formats::Loaded;
use crate::render::explain::{Explanation, Samples};
use crate::scene::FilmSettings;

/// Flags of `explain`.
#[derive(Debug, Args)]
pub struct ExplainArguments {
    /// Scene file or model.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,
    /// The pixel: column and row from the top left corner, from 0.
    #[arg(long, value_name = "X,Y", value_parser = values::pixel, allow_hyphen_values = true)]
    pub pixel: (u32, u32),
    /// Explain this sample, from 0. Without it the first one; with --json all.
    #[arg(long, value_name = "N")]
    pub sample: Option<u32>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,

    /// What the picture is like.
    #[command(flatten)]
    pub film: ValueArguments,
    /// Where it is seen from.
    #[command(flatten)]
    pub camera: CameraArguments,
    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
    /// How trees are built.
    #[command(flatten)]
    pub build: BuildArguments,
}

/// The whole document.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    /// Version of this document.
    pub schema: u32,
    /// Version of the program.
    pub version: &'static str,
    /// The file that is seen.
    #[serde(serialize_with = "lossy")]
    pub input: &'a Path,
    /// Name of the camera.
    pub camera: &'a str,
    /// Size, samples, depth, clamp and encoding.
    pub film: FilmSettings,
    /// The pixel.
    #[serde(flatten)]
    pub pixel: &'a Explanation,
}

/// Prints why a pixel has its colour.
///
/// # Errors
/// When the file cannot be read or built, or has no such camera, pixel or sample.
pub fn run(arguments: &ExplainArguments) -> Result<()> {
    let terminal = Terminal::new(false)?;
    super::use_threads(arguments.build.threads)?;
    let loaded = open_scene(&arguments.input, &arguments.load, &arguments.load.options(), &terminal);
    terminal.clear();
    let Loaded { mut scene, ledger, automatic, built } = loaded?;
    ledger::report(&arguments.input, &ledger, &scene, Told::Warnings, arguments.load.strict)?;
    arguments.film.apply(&mut scene.film);
    camera::choose(&mut scene, automatic, &arguments.camera, arguments.film.size.is_some(), false)?;

    let renderer =
        Plan::of(&arguments.build, &scene, built.as_deref(), 0).and_then(|plan| plan.renderer(scene, &terminal));
    terminal.clear();
    let renderer = renderer?;
    let samples = match arguments.sample {
        Some(number) => Samples::One(number),
        None if arguments.json => Samples::All,
        None => Samples::One(0),
    };
    let (x, y) = arguments.pixel;
    let explanation = renderer.explain(x, y, samples, &terminal)?;
    let scene = renderer.scene();
    let document = Document {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        input: &arguments.input,
        camera: &scene.cameras[scene.active_camera].name,
        film: scene.film,
        pixel: &explanation,
    };
    let text = if arguments.json {
        serde_json::to_string_pretty(&document).expect("names and numbers have a JSON form") + "\n"
    } else {
        explain_text::of(&document)
    };
    terminal::print(text.as_bytes())
}
