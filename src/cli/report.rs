//! `whitted report`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use super::build::open_scene;
use super::commit::commit;
use super::ledger::Told;
use super::query::FORMATS;
use super::ray_input::{MOST_RAYS, read_rays, stem};
use super::terminal::{self, Terminal};
use super::values::{self, one_of};
use super::{arguments, ledger};
use crate::error::{Error, Result};
use crate::formats::atomic_file::{check_writable, write_atomically};
use crate::formats::{self, Loaded};
use crate::measure::environment::Environment;
use crate::measure::ray_file::RecordFormat;
use crate::measure::ray_set::{Group, Question, RaySet};
use crate::measure::report::query::Effort;
use crate::measure::report::rays::{RayKind, SEED};
use crate::measure::report::subject::{HardSet, Subject};
use crate::measure::report::{self, Options, Plane, Programs, Report};
use crate::measure::speed::FEWEST_REPETITIONS;

/// Flags of `report`.
#[derive(Debug, Args)]
pub struct ReportArguments {
    /// Scene files or models, each a part of the report.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present_any = ["hard_set", "planes"])]
    pub input: Vec<PathBuf>,
    /// Built-in meshes that are made to be hard, with commas between; parts of the report after the inputs.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = one_of(hard_sets()))]
    pub hard_set: Vec<HardSet>,
    /// Folder to write report.md, report.json and the plots to; made if it is not there.
    /// Without it: `report-` and the name of the first part, in the current folder.
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,
    /// Print the report as one JSON document and write no files, unless --out is given.
    #[arg(long)]
    pub json: bool,
    /// What to measure, with commas between; everything but `features`, which needs valgrind, if it is not given.
    /// `quadric`, `light` and `features` have scenes of their own and need no input.
    #[arg(long, value_name = "PLANES", value_delimiter = ',', value_parser = one_of(planes()))]
    pub planes: Vec<Plane>,
    /// A program to compare with that was built without a feature, for the plane `features`; may be given for each.
    #[arg(long, value_name = "FEATURE=PROGRAM", value_parser = program_without, requires = "planes")]
    pub without: Vec<(String, PathBuf)>,
    /// Rays to make, with commas between; without it all kinds, or none where --ray-file is given.
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = one_of(ray_kinds()))]
    pub ray_kinds: Vec<RayKind>,
    /// Also ask these rays, in the coordinates of each input.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub ray_file: Option<PathBuf>,
    /// How the ray file is written: text, one ray a line, or little-endian 32-bit words, eight a ray.
    #[arg(long, value_name = "FORMAT", value_parser = one_of(FORMATS), default_value = "text", requires = "ray_file")]
    pub format: RecordFormat,
    /// Rays of each kind whose answers are judged; the smallest rate that can be told from 0 is about 3 over this, at 95 %.
    #[arg(long, value_name = "N", value_parser = values::count(1..=MOST_RAYS), default_value_t = 50_000)]
    pub rays: u32,
    /// Rays of each kind that are timed.
    #[arg(long, value_name = "N", value_parser = values::count(1..=MOST_RAYS), default_value_t = 10_000)]
    pub timed_rays: u32,
    /// How often each choice is timed: 10 at least, or 0 for errors without speeds.
    #[arg(long, value_name = "N", value_parser = repetitions, default_value_t = FEWEST_REPETITIONS)]
    pub repeat: u32,
    /// Threads that find exact answers and render pictures; 0 is one per processor. Rays a second are those of one thread.
    #[arg(long, value_name = "N", value_parser = values::count(0..=arguments::MOST_THREADS), default_value_t = 0)]
    pub threads: u32,
    /// How the inputs are read.
    #[command(flatten)]
    pub load: arguments::LoadArguments,
}

fn hard_sets() -> impl Iterator<Item = (&'static str, HardSet)> {
    HardSet::ALL.into_iter().map(|set| (set.name(), set))
}

fn planes() -> impl Iterator<Item = (&'static str, Plane)> {
    Plane::ALL.into_iter().map(|plane| (plane.name(), plane))
}

fn ray_kinds() -> impl Iterator<Item = (&'static str, RayKind)> {
    RayKind::ALL.into_iter().map(|kind| (kind.name(), kind))
}

fn program_without(text: &str) -> std::result::Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((feature, program)) if !feature.is_empty() && !program.is_empty() => Ok((feature.into(), program.into())),
        _ => Err("expected a feature, `=` and the program that was built without it".into()),
    }
}

fn repetitions(text: &str) -> std::result::Result<u32, String> {
    match text.parse::<u32>() {
        Ok(0) => Ok(0),
        Ok(count) if (FEWEST_REPETITIONS..=1000).contains(&count) => Ok(count),
        _ => Err(format!("expected 0, or a number between {FEWEST_REPETITIONS} and 1000")),
    }
}

/// Measures all parts and writes the report.
///
/// # Errors
/// An input that cannot be read or measured, a folder that cannot be written to; [`Error::cancelled`] after Ctrl-C. What
/// was finished until then is written.
pub fn run(arguments: &ReportArguments) -> Result<()> {
    let folder = match &arguments.out {
        Some(folder) => Some(folder.clone()),
        None if arguments.json => None,
        None => Some(PathBuf::from(format!("report-{}", first_name(arguments)))),
    };
    for input in &arguments.input {
        formats::is_scene(input)?;
    }
    if let Some(folder) = &folder {
        check_folder(folder)?;
    }
    let options = options(arguments)?;
    super::use_threads(arguments.threads)?;
    let terminal = Terminal::new(false)?;
    let file_rays =
        arguments.ray_file.as_deref().map(|path| read_rays(path, Some(arguments.format), &terminal)).transpose()?;
    let mut report = Report::new(Environment::detect(commit(), SEED), &options);
    let mut stopped = None;
    for part in parts(arguments) {
        let measured = part.load(arguments, &terminal).and_then(|mut subject| {
            let given = file_rays.as_ref().map(|rays| RaySet {
                name: "file".into(),
                group: Group::Generic,
                question: Question::Closest,
                rays: rays.iter().map(|ray| subject.ray(ray)).collect(),
            });
            subject.name = report.unused_name(&subject.name);
            report::measure(&subject, given.as_slice(), &options, &terminal)
        });
        terminal.clear();
        match measured {
            Ok(part) => report.subjects.push(part),
            Err(error) => {
                stopped = Some(error);
                break;
            }
        }
    }
    if stopped.is_none() {
        stopped = report.measure_own_scenes(&options, &terminal).err();
        terminal.clear();
    }
    report.complete = stopped.is_none();
    if let Some(error) = stopped.take_if(|_| report.is_empty()) {
        return Err(error);
    }
    if arguments.json {
        terminal::print(report.json().as_bytes())?;
    }
    if let Some(folder) = &folder {
        write(&report, folder)?;
        if !arguments.json {
            terminal::print(format!("{}\n", folder.join("report.md").display()).as_bytes())?;
        }
    }
    stopped.map_or(Ok(()), Err)
}

/// What is measured, before it is read.
enum Part<'a> {
    File(&'a Path),
    Hard(HardSet),
}

fn parts(arguments: &ReportArguments) -> impl Iterator<Item = Part<'_>> {
    let files = arguments.input.iter().map(|path| Part::File(path));
    let given = |set: &HardSet| arguments.hard_set.contains(set);
    files.chain(HardSet::ALL.into_iter().filter(given).map(Part::Hard))
}

impl Part<'_> {
    fn load(&self, arguments: &ReportArguments, terminal: &Terminal) -> Result<Subject> {
        match self {
            Self::Hard(set) => Ok(Subject::hard(*set)),
            Self::File(path) => {
                let loaded = open_scene(path, &arguments.load, &arguments.load.options(), terminal);
                terminal.clear();
                let Loaded { scene, ledger, .. } = loaded?;
                ledger::report(path, &ledger, &scene, Told::Warnings, arguments.load.strict)?;
                Subject::of_scene(stem(path), scene).map_err(|error| error.at_path(path))
            }
        }
    }
}

fn first_name(arguments: &ReportArguments) -> String {
    match (arguments.input.first(), arguments.hard_set.first()) {
        (Some(path), _) => stem(path),
        (None, Some(set)) => set.name().into(),
        (None, None) => "own-scenes".into(),
    }
}

fn options(arguments: &ReportArguments) -> Result<Options> {
    let all = arguments.ray_kinds.is_empty() && arguments.ray_file.is_none();
    let wanted = |kind: &RayKind| all || arguments.ray_kinds.contains(kind);
    let planes = if arguments.planes.is_empty() { Plane::USUAL } else { &arguments.planes };
    let measured = |plane: &Plane| planes.contains(plane);
    if let Some(plane) = planes.iter().find(|plane| plane.needs_subject())
        && arguments.input.is_empty()
        && arguments.hard_set.is_empty()
    {
        return Err(Error::caller(format!("the plane `{}` measures a scene, and there is none", plane.name()))
            .remedy("give an input or --hard-set"));
    }
    let whole = std::env::current_exe().map_err(|cause| Error::system(Path::new("whitted"), cause))?;
    Ok(Options {
        planes: Plane::ALL.into_iter().filter(measured).collect(),
        kinds: RayKind::ALL.into_iter().filter(wanted).collect(),
        rays: arguments.rays as usize,
        effort: Effort { rays_timed: arguments.timed_rays as usize, repetitions: arguments.repeat },
        programs: Programs { whole, without: arguments.without.clone() },
    })
}

/// Finds out whether a folder is there or can be made, and whether files can be written to it, without making it.
fn check_folder(folder: &Path) -> Result<()> {
    let nearest = folder.ancestors().find(|ancestor| ancestor.as_os_str().is_empty() || ancestor.exists());
    match nearest {
        Some(there) if there.is_dir() || there.as_os_str().is_empty() => check_writable(&there.join("report.md")),
        _ => Err(Error::caller("is not a folder")
            .at_path(nearest.unwrap_or(folder))
            .remedy("give another name with --out")),
    }
}

/// Writes the files, the page last: where it is new, all that it shows is there.
fn write(report: &Report, folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|cause| Error::system(folder, cause))?;
    for file in report.files() {
        let path = folder.join(&file.name);
        write_atomically(&path, |sink| {
            sink.write_all(file.text.as_bytes()).map_err(|cause| Error::system(&path, cause))
        })?;
    }
    Ok(())
}
