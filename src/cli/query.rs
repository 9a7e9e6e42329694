//! `whitted query`: rays in, hits out.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Read, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use rayon::prelude::*;

use super::arguments::{BuildArguments, LoadArguments};
use super::build::{Plan, open_scene};
use super::ledger::{self, Told};
use super::outputs::refuse_inputs;
use super::stream::Stream;
use super::terminal::Terminal;
use super::values::one_of;
use crate::error::{Error, Result};
use crate::formats::atomic_file::{check_writable, write_atomically};
use crate::formats::{Built, LoadOptions, Loaded};
use crate::geometry::{Hit, Ray};
use crate::measure::hit_file::HitWriter;
use crate::measure::oracle::Oracle;
use crate::measure::ray_file::{FileRay, RayReader, RecordFormat};
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::Scene;

/// Flags of `query`.
#[derive(Debug, Args)]
pub struct QueryArguments {
    /// Scene file or model.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,
    /// Rays, in the coordinates of the input; `-` reads standard input.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub ray_file: PathBuf,
    /// How rays and answers are written: text, one ray a line, or little-endian 32-bit words, eight a ray.
    #[arg(long, value_name = "FORMAT", value_parser = one_of(FORMATS), default_value = "text")]
    pub format: RecordFormat,
    /// What is asked: the closest hit, whether there is any, or every hit in order.
    #[arg(long, value_name = "MODE", value_parser = one_of(MODES), default_value = "closest")]
    pub mode: Mode,
    /// Who answers: the renderer, or exact arithmetic, rounded to f32 once.
    #[arg(long, value_name = "PRECISION", value_parser = one_of(PRECISIONS), default_value = "f32")]
    pub precision: Precision,
    /// Also tell the face of the file that each triangle was cut from.
    #[arg(long)]
    pub faces: bool,
    /// Where answers go instead of standard output; written whole or not at all.
    #[arg(short, long = "output", value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub output: Option<PathBuf>,
    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
    /// How trees are built.
    #[command(flatten)]
    pub build: BuildArguments,
}

/// What is asked of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The first hit.
    Closest,
    /// Whether there is any.
    Occluded,
    /// Every hit.
    All,
}

/// Who answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// The renderer.
    F32,
    /// The oracle.
    Exact,
}

/// The formats of rays.
pub(super) const FORMATS: [(&str, RecordFormat); 2] = [("text", RecordFormat::Text), ("f32", RecordFormat::F32)];
const MODES: [(&str, Mode); 3] = [("closest", Mode::Closest), ("occluded", Mode::Occluded), ("all", Mode::All)];
const PRECISIONS: [(&str, Precision); 2] = [("f32", Precision::F32), ("exact", Precision::Exact)];

/// Rays that are answered before more are read: a bound on memory.
const RAYS_AT_ONCE: usize = 1 << 16;

/// Rays that one thread answers before it looks for others to share with.
const RAYS_A_PIECE: usize = 256;

/// Answers all rays of a file in their order.
///
/// # Errors
/// Whatever stopped it: the first line that is no ray among them. Answers to rays before it may have been printed; a file
/// of `--output` stays as it was.
pub fn run(arguments: &QueryArguments) -> Result<()> {
    let from_stdin = arguments.ray_file.as_os_str() == "-";
    let to_file = arguments.output.as_deref().filter(|path| path.as_os_str() != "-");
    if let Some(path) = to_file {
        let rays = Some(arguments.ray_file.as_path()).filter(|_| !from_stdin);
        refuse_inputs(path, [arguments.input.as_path()].into_iter().chain(rays))?;
        check_writable(path)?;
    }
    // Answers and a bar on one terminal would be in each other's way.
    let terminal = Terminal::new(to_file.is_none() && io::stdout().is_terminal())?;
    super::use_threads(arguments.build.threads)?;
    let (source, length) = if from_stdin {
        let stdin: Box<dyn Read + '_> = Box::new(Stream::new(|| Ok(io::stdin()), &terminal));
        (stdin, 0)
    } else {
        open(&arguments.ray_file, &terminal)?
    };

    let options = LoadOptions { faces: arguments.faces, ..arguments.load.options() };
    let loaded = open_scene(&arguments.input, &arguments.load, &options, &terminal);
    terminal.clear();
    let Loaded { scene, ledger, built, .. } = loaded?;
    ledger::report(&arguments.input, &ledger, &scene, Told::Warnings, arguments.load.strict)?;
    if let Some(path) = to_file {
        refuse_inputs(path, ledger.files())?;
    }
    let answerer = Answerer::build(scene, built.as_deref(), arguments, &terminal);
    terminal.clear();
    let answerer = answerer?;

    let shown = if from_stdin { Path::new("standard input") } else { &arguments.ray_file };
    let mut reader = RayReader::new(source, arguments.format, shown);
    terminal.begin("query", length);
    let answered = match to_file {
        Some(path) => write_atomically(path, |file| {
            answer_all(&answerer, &mut reader, arguments, &terminal, |bytes| {
                file.write_all(bytes).map(|()| true).map_err(|cause| Error::system(path, cause))
            })
        }),
        None => answer_all(&answerer, &mut reader, arguments, &terminal, write_to_stdout),
    };
    terminal.clear();
    answered
}

/// A file of rays, and how long it is; 0 for what has no length, such as a pipe, for which an interrupt need not wait.
pub(super) fn open<'a>(path: &Path, progress: &'a dyn Progress) -> Result<(Box<dyn Read + 'a>, u64)> {
    let system = |cause: io::Error| match cause.kind() {
        ErrorKind::NotFound => Error::caller("there is no such file").at_path(path),
        _ => Error::system(path, cause),
    };
    // Asked before it is opened: opening a pipe waits for someone to write.
    let metadata = std::fs::metadata(path).map_err(system)?;
    if metadata.is_dir() {
        return Err(Error::caller("is a folder").at_path(path).remedy("name a file of rays in it"));
    }
    if !metadata.is_file() {
        let name = path.to_path_buf();
        return Ok((Box::new(Stream::new(move || File::open(name), progress)), 0));
    }
    Ok((Box::new(File::open(path).map_err(system)?), metadata.len()))
}

/// Writes on; false if the reader went away and wants no more.
fn write_to_stdout(bytes: &[u8]) -> Result<bool> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Error::system(Path::new("standard output"), error)),
    }
}

/// Reads, answers and writes until there are no more rays, or `write` says that there is no more to do.
fn answer_all(
    answerer: &Answerer,
    reader: &mut RayReader<impl Read>,
    arguments: &QueryArguments,
    progress: &dyn Progress,
    mut write: impl FnMut(&[u8]) -> Result<bool>,
) -> Result<()> {
    let writer = HitWriter::new(arguments.format, arguments.faces.then_some(answerer.scene()));
    let origin = answerer.scene().origin;
    let mut rays = Vec::new();
    let mut done = 0;
    loop {
        let read = reader.read(&mut rays, RAYS_AT_ONCE);
        // An interrupted reading fails, too; that it was interrupted is what matters.
        progress.check()?;
        read?;
        if rays.is_empty() {
            return Ok(());
        }
        let answer = |piece: &[FileRay]| -> Result<Vec<u8>> {
            progress.check()?;
            let mut out = Vec::new();
            for ray in piece {
                answerer.answer(&ray.relative_to(origin), arguments.mode, &writer, &mut out);
            }
            Ok(out)
        };
        let pieces = rays.par_chunks(RAYS_A_PIECE).map(answer).collect::<Result<Vec<_>>>()?;
        if !write(&pieces.concat())? {
            return Ok(());
        }
        progress.advance(reader.bytes() - done);
        done = reader.bytes();
    }
}

/// Who answers, ready.
enum Answerer {
    F32(Box<Renderer>),
    Exact(Box<Scene>, Box<Oracle>),
}

impl Answerer {
    fn build(scene: Scene, built: Option<&Built>, arguments: &QueryArguments, progress: &dyn Progress) -> Result<Self> {
        match arguments.precision {
            Precision::F32 => {
                let plan = Plan::of(&arguments.build, &scene, built, 0)?;
                Ok(Self::F32(Box::new(plan.renderer(scene, progress)?)))
            }
            Precision::Exact => {
                arguments.build.refuse_limit("--precision exact")?;
                let oracle = Box::new(Oracle::new(&scene)?);
                Ok(Self::Exact(Box::new(scene), oracle))
            }
        }
    }

    fn scene(&self) -> &Scene {
        match self {
            Self::F32(renderer) => renderer.scene(),
            Self::Exact(scene, _) => scene,
        }
    }

    fn answer(&self, ray: &Ray, mode: Mode, writer: &HitWriter<'_>, out: &mut Vec<u8>) {
        match (self, mode) {
            (Self::F32(renderer), Mode::Closest) => writer.hit(&renderer.closest(ray), out),
            (Self::F32(renderer), Mode::Occluded) => writer.occluded(renderer.occluded(ray), out),
            (Self::F32(renderer), Mode::All) => writer.all(&renderer.hits(ray).collect::<Vec<_>>(), out),
            (Self::Exact(_, oracle), Mode::Closest) => {
                writer.hit(&oracle.closest(ray).map_or(Hit::MISS, |hit| hit.hit()), out);
            }
            (Self::Exact(_, oracle), Mode::Occluded) => writer.occluded(oracle.occluded(ray), out),
            (Self::Exact(_, oracle), Mode::All) => {
                let hits: Vec<Hit> = oracle.all(ray).iter().map(|hit| hit.hit()).collect();
                writer.all(&hits, out);
            }
        }
    }
}
