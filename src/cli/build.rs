//! `whitted build`, and what other commands do with what it made.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::{Args, ValueHint};

use super::arguments::{BuildArguments, LoadArguments};
use super::info_text::readable;
use super::ledger::{self, Told};
use super::outputs;
use super::stats_json::timed;
use super::terminal::{self, Terminal};
use crate::accel::{Kind, Params, Preset};
use crate::error::{Error, Result};
use crate::formats::atomic_file::check_writable;
use crate::formats::built::{self, Origin};
use crate::formats::{self, Built, LoadOptions, Loaded};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::Scene;

/// Flags of `build`.
#[derive(Debug, Args)]
pub struct BuildSceneArguments {
    /// Scene file or model.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,
    /// Built scene to write. Without it: the input's name with .whb, in the current folder.
    #[arg(short, long = "output", value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub output: Option<PathBuf>,
    /// Refuse to replace a file that exists.
    #[arg(long)]
    pub no_clobber: bool,
    /// Print nothing but errors.
    #[arg(long)]
    pub quiet: bool,
    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
    /// How trees are built.
    #[command(flatten)]
    pub build: BuildArguments,
}

/// Reads a scene or model, builds its trees and keeps all in a file.
///
/// # Errors
/// Those of reading, building and writing; the file is then as it was.
pub fn run(arguments: &BuildSceneArguments) -> Result<()> {
    let BuildSceneArguments { input, output, no_clobber, quiet, load, build } = arguments;
    let output = match output {
        Some(output) => output.clone(),
        None => outputs::named_after(input, ".whb")?,
    };
    outputs::refuse_clobber(&output, *no_clobber)?;
    if formats::is_built(input)? {
        return Err(Error::caller("this scene is built already").at_path(input));
    }
    if output.extension().is_none_or(|suffix| !suffix.eq_ignore_ascii_case("whb")) {
        let error = Error::caller("the name of a built scene ends in .whb");
        return Err(error.at_path(&output).remedy("name it so"));
    }
    outputs::refuse_inputs(&output, [input.as_path()])?;
    check_writable(&output)?;
    let terminal = Terminal::new(*quiet)?;
    super::use_threads(build.threads)?;
    // Who asks for faces later finds them; they take no room where all are triangles.
    let options = LoadOptions { faces: true, ..load.options() };
    build.refuse_what_does_not_fit(input, &options)?;
    let since = SystemTime::now();
    let (loaded, load_seconds) = timed(|| formats::open(input, &options, &terminal));
    terminal.clear();
    let Loaded { scene, ledger, automatic, .. } = loaded?;
    let told = if *quiet { Told::Nothing } else { Told::Warnings };
    ledger::report(input, &ledger, &scene, told, load.strict)?;
    outputs::refuse_inputs(&output, ledger.files())?;
    let params = build.params(&scene, 0)?;
    built::check_kind(params.kind)?;
    let renderer = Renderer::build(scene, &params, &terminal);
    terminal.clear();
    let renderer = renderer?;
    let origin = Origin { input, options: &options, since, ledger: &ledger, automatic, preset: params.preset };
    let (bytes, write_seconds) = timed(|| built::save(&renderer, &origin, &output, &terminal));
    terminal.clear();
    let bytes = bytes?;
    if *quiet {
        return Ok(());
    }
    terminal::report(&format!(
        "{}, read in {load_seconds:.1} s, built in {:.1} s, written in {write_seconds:.1} s",
        readable(bytes),
        renderer.build_stats().seconds,
    ));
    terminal::print(format!("{}\n", output.display()).as_bytes())
}

/// Opens a scene, a model or a built scene; the last was read with options of its own, and no others may be given.
///
/// # Errors
/// As [`formats::open`].
pub fn open_scene(
    input: &Path,
    load: &LoadArguments,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let loaded = formats::open(input, options, progress)?;
    let Some(built) = &loaded.built else { return Ok(loaded) };
    let own = &built.options;
    let is_other = load.normals.is_some_and(|normals| normals != own.normals)
        || load.up.is_some_and(|up| up != own.up)
        || (load.crease_angle.is_some() && load.crease_angle != own.crease_angle)
        || (load.scene.is_some() && load.scene != own.scene)
        || (load.animation.is_some() && load.animation != own.animation)
        || (load.time.is_some() && load.time != own.time)
        || (load.cull_back_faces && !own.cull_back_faces);
    if is_other {
        return Err(Error::caller("this scene was built with other flags of reading")
            .at_path(input)
            .remedy("leave them out, or say them to `whitted build`"));
    }
    Ok(loaded)
}

/// How a renderer comes to its trees.
#[derive(Debug, Clone, Copy)]
pub enum Plan<'a> {
    /// They are built.
    Build(Params),
    /// A built scene has them.
    Restore(&'a Built),
}

impl<'a> Plan<'a> {
    /// For a scene that was read, and a picture that takes so many bytes.
    ///
    /// # Errors
    /// When nothing fits the limit of memory.
    pub fn of(arguments: &BuildArguments, scene: &Scene, built: Option<&'a Built>, picture: u64) -> Result<Self> {
        let BuildArguments { accelerator, preset, memory_limit, .. } = *arguments;
        let Some(built) = built else { return Ok(Self::Build(arguments.params(scene, picture)?)) };
        let is_kind = accelerator == Kind::Auto || accelerator == built.kind;
        if !(is_kind && preset.is_none_or(|preset| preset == built.preset)) {
            return Ok(Self::Build(arguments.params(scene, picture)?));
        }
        let needed = built.bytes + picture;
        match memory_limit {
            Some(limit) if needed > limit => Err(Error::limit(format!(
                "the built scene and the picture take {}, and --memory-limit allows {}",
                readable(needed),
                readable(limit)
            ))
            .remedy("raise the limit, or build the scene with --accelerator compact")),
            _ => Ok(Self::Restore(built)),
        }
    }

    /// Of which kind they are.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Build(params) => params.kind,
            Self::Restore(built) => built.kind,
        }
    }

    /// How they are or were built.
    pub fn preset(&self) -> Preset {
        match self {
            Self::Build(params) => params.preset,
            Self::Restore(built) => built.preset,
        }
    }

    /// The renderer.
    ///
    /// # Errors
    /// As [`Renderer::build`] and [`Built::renderer`].
    pub fn renderer(&self, scene: Scene, progress: &dyn Progress) -> Result<Renderer> {
        match self {
            Self::Build(params) => Renderer::build(scene, params, progress),
            Self::Restore(built) => built.renderer(scene, progress),
        }
    }
}
