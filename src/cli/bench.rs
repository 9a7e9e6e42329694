//! `whitted bench`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use super::build::open_scene;
use super::commit::commit;
use super::ledger::Told;
use super::outputs::{refuse_inputs, write_text};
use super::query::FORMATS;
use super::ray_input::{MOST_RAYS, read_rays, stem};
use super::terminal::{self, Terminal};
use super::values::{self, one_of};
use super::{arguments, ledger};
use crate::accel::{Kind, Params, Preset};
use crate::error::{Error, Result};
use crate::formats::atomic_file::{check_writable, write_atomically};
use crate::formats::{self, Loaded};
use crate::measure::bench::rays::{RayKind, SEED, View};
use crate::measure::bench::{Bench, Calls, HitsOut, Model, Options, ReferenceKind};
use crate::measure::environment::Environment;
use crate::measure::generated::Generated;
#[cfg(feature = "embree")]
use crate::measure::peers::embree::Library;
use crate::measure::ray_file::{FileRay, RecordFormat};
use crate::measure::ray_set::{Group, Question, RaySet};
use crate::measure::report::subject::of_mesh;
use crate::scene::{Scene, auto};

/// Flags of `bench`.
#[derive(Debug, Args)]
pub struct BenchArguments {
    /// Scene files or models.
    #[arg(value_hint = ValueHint::FilePath, required_unless_present = "generate")]
    pub input: Vec<PathBuf>,
    /// Built-in models, with commas between, after the inputs.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = one_of(generated()))]
    pub generate: Vec<Generated>,
    /// Structures that take part, with commas between.
    #[arg(long, value_name = "all|KINDS", value_delimiter = ',', value_parser = one_of(accelerators()),
        default_value = "all")]
    pub accelerators: Vec<Accelerators>,
    /// How they are built, with commas between.
    #[arg(long, value_name = "all|PRESETS", value_delimiter = ',', value_parser = one_of(presets()),
        default_value = "balanced")]
    pub presets: Vec<Presets>,
    /// Rays to make, with commas between; without it all kinds, or none where --ray-file is given.
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = one_of(RayKind::ALL.map(|k| (k.name(), k))))]
    pub ray_kinds: Vec<RayKind>,
    /// Where the camera stands, with commas between; without it outside, and inside what is a place to be in.
    #[arg(long, value_name = "VIEWS", value_delimiter = ',', value_parser = one_of(View::ALL.map(|v| (v.name(), v))))]
    pub views: Vec<View>,
    /// About how many primary rays are made; of other kinds there is one where a primary ray hits.
    #[arg(long, value_name = "N", value_parser = values::count(1..=MOST_RAYS), default_value_t = 307_200)]
    pub rays: u32,
    /// Also ask the rays of these files, in the coordinates of each input. The kind is the last but one suffix, as in
    /// x.shadow.rays; shadow rays are asked for any hit, others for the closest.
    #[arg(long, value_name = "FILE", num_args = 1.., value_hint = ValueHint::FilePath)]
    pub ray_file: Vec<PathBuf>,
    /// How ray files are written: text, one ray a line, or little-endian 32-bit words, eight a ray. Without it that is told by
    /// what they begin with.
    #[arg(long, value_name = "FORMAT", value_parser = one_of(FORMATS), requires = "ray_file")]
    pub format: Option<RecordFormat>,
    /// How rays are handed over, with commas between: one public call a ray, or one for all.
    #[arg(long, value_name = "CALLS", value_delimiter = ',', value_parser = one_of(Calls::ALL.map(|c| (c.name(), c))),
        default_value = "single,batch")]
    pub calls: Vec<Calls>,
    /// Numbers of threads, with commas between.
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = values::count(1..=arguments::MOST_THREADS),
        default_value = "1")]
    pub threads: Vec<u32>,
    /// Embree 4's library, which takes part; without it the one that the variable WHITTED_EMBREE names, if any.
    #[arg(long, value_name = "PATH", value_hint = ValueHint::FilePath)]
    pub embree: Option<PathBuf>,
    /// How often everything is timed, in turn; 0 compares hits alone.
    #[arg(long, value_name = "N", value_parser = values::count(0..=1000), default_value_t = 5)]
    pub rounds: u32,
    /// Rays of each model on which the reference is compared with every triangle asked in turn; without it as many as take
    /// seconds, at most 10000.
    #[arg(long, value_name = "N", value_parser = values::count(1..=MOST_RAYS))]
    pub linear_rays: Option<u32>,
    /// What all hits are compared with: the binary tree, or a slower one with larger boxes that culls nothing.
    #[arg(long, value_name = "REFERENCE", default_value = "bvh2",
        value_parser = one_of(ReferenceKind::ALL.map(|kind| (kind.name(), kind))))]
    pub reference: ReferenceKind,
    /// Print one JSON document instead of tables.
    #[arg(long)]
    pub json: bool,
    /// Also draw rays a second against seconds to build.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub svg: Option<PathBuf>,
    /// Also write all hits, as `query --format f32` does: contender by contender for each set of rays.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub hits_out: Option<PathBuf>,
    /// How the inputs are read.
    #[command(flatten)]
    pub load: arguments::LoadArguments,
}

/// Structures by one name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accelerators {
    /// Every one.
    All,
    /// This one.
    One(Kind),
}

/// Presets by one name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presets {
    /// Every one.
    All,
    /// This one.
    One(Preset),
}

fn generated() -> impl Iterator<Item = (&'static str, Generated)> {
    Generated::ALL.into_iter().map(|model| (model.name(), model))
}

fn accelerators() -> impl Iterator<Item = (&'static str, Accelerators)> {
    let kinds = arguments::accelerators().map(|(name, kind)| (name, Accelerators::One(kind)));
    std::iter::once(("all", Accelerators::All)).chain(kinds)
}

fn presets() -> impl Iterator<Item = (&'static str, Presets)> {
    let presets = arguments::PRESETS.into_iter().map(|(name, preset)| (name, Presets::One(preset)));
    std::iter::once(("all", Presets::All)).chain(presets)
}

/// Measures all models and prints what was found.
///
/// # Errors
/// An input that cannot be read or measured, a library that is not Embree, a structure whose hits are wrong;
/// [`Error::cancelled`] after Ctrl-C. Models that were finished until then are printed.
pub fn run(arguments: &BenchArguments) -> Result<()> {
    for input in &arguments.input {
        formats::is_scene(input)?;
    }
    let outputs = [&arguments.svg, &arguments.hits_out];
    for output in outputs.into_iter().flatten() {
        refuse_inputs(output, arguments.input.iter().chain(&arguments.ray_file).map(PathBuf::as_path))?;
        check_writable(output)?;
    }
    let options = options(arguments)?;
    super::use_threads(0)?;
    let terminal = Terminal::new(false)?;
    let rays = arguments.ray_file.iter().map(|path| FileRays::read(path, arguments.format, &terminal));
    let rays = rays.collect::<Result<Vec<_>>>()?;
    let mut bench = Bench::new(Environment::detect(commit(), SEED), options.rounds);
    #[cfg(feature = "embree")]
    bench.notes.extend(options.embree.as_ref().map(|library| format!("{}.", library.description())));
    let measured = match &arguments.hits_out {
        None => measure_all(arguments, &options, &rays, &mut bench, None, &terminal),
        Some(path) => write_atomically(path, |sink| {
            measure_all(arguments, &options, &rays, &mut bench, Some(&mut HitsOut::new(sink)), &terminal)
        }),
    };
    terminal.clear();
    bench.complete = measured.is_ok();
    if bench.rows.is_empty() {
        return measured;
    }
    let text = if arguments.json { bench.json() } else { bench.tables() };
    terminal::print(text.as_bytes())?;
    if let Some(path) = &arguments.svg {
        write_text(path, &bench.picture())?;
    }
    measured?;
    match bench.wrong() {
        0 => Ok(()),
        wrong => Err(Error::limit(format!("{wrong} answers differ from those of the reference"))
            .remedy("do not rely on this build; the rows tell which")),
    }
}

/// Measures the inputs, then the models that are made.
fn measure_all(
    arguments: &BenchArguments,
    options: &Options,
    rays: &[FileRays],
    bench: &mut Bench,
    mut hits_out: Option<&mut HitsOut<'_>>,
    terminal: &Terminal,
) -> Result<()> {
    let mut measure = |name: &str, scene: Scene| {
        let given = rays.iter().map(|rays| rays.relative_to(&scene)).collect();
        let model = Model { name: bench.unused_name(name), scene, given };
        bench.measure(model, options, hits_out.as_deref_mut(), terminal)
    };
    for path in &arguments.input {
        let loaded = open_scene(path, &arguments.load, &arguments.load.options(), terminal);
        terminal.clear();
        let Loaded { scene, ledger, .. } = loaded?;
        ledger::report(path, &ledger, &scene, Told::Warnings, arguments.load.strict)?;
        measure(&stem(path), scene).map_err(|error| error.at_path(path))?;
    }
    for model in Generated::ALL.into_iter().filter(|model| arguments.generate.contains(model)) {
        let mut scene = of_mesh(model.mesh()?);
        auto::complete(&mut scene);
        measure(model.name(), scene)?;
    }
    Ok(())
}

fn options(arguments: &BenchArguments) -> Result<Options> {
    let kind_is_wanted = |kind: &Kind| {
        let wanted = |one: &Accelerators| match one {
            Accelerators::All => true,
            Accelerators::One(wanted) => wanted.resolve() == *kind,
        };
        arguments.accelerators.iter().any(wanted)
    };
    let preset_is_wanted =
        |preset: &Preset| arguments.presets.iter().any(|one| *one == Presets::All || *one == Presets::One(*preset));
    let presets: Vec<Preset> = Preset::ALL.iter().copied().filter(preset_is_wanted).collect();
    let structures = Kind::ALL.iter().filter(|kind| kind_is_wanted(kind)).flat_map(|&kind| {
        // No tree, no presets.
        let count = if kind == Kind::Linear { 1 } else { presets.len() };
        presets[..count].iter().map(move |&preset| Params { kind, preset })
    });
    let structures = structures.collect();
    let all = arguments.ray_kinds.is_empty() && arguments.ray_file.is_empty();
    let mut threads: Vec<usize> = arguments.threads.iter().map(|&threads| threads as usize).collect();
    threads.sort_unstable();
    threads.dedup();
    let library = arguments.embree.clone().or_else(|| {
        let named = std::env::var_os("WHITTED_EMBREE").filter(|name| !name.is_empty());
        named.map(PathBuf::from)
    });
    #[cfg(not(feature = "embree"))]
    if let Some(path) = library {
        let message = "cannot be loaded: this build is without the feature `embree`";
        return Err(Error::unsupported(message).at_path(&path).remedy("build with it, or unset WHITTED_EMBREE"));
    }
    Ok(Options {
        structures,
        kinds: RayKind::ALL.into_iter().filter(|kind| all || arguments.ray_kinds.contains(kind)).collect(),
        views: arguments.views.clone(),
        rays: arguments.rays as usize,
        linear_rays: arguments.linear_rays.map(|rays| rays as usize),
        calls: arguments.calls.clone(),
        threads,
        rounds: arguments.rounds,
        reference: arguments.reference,
        #[cfg(feature = "embree")]
        embree: library.map(|path| Library::load(&path)).transpose()?,
    })
}

/// The rays of a file.
struct FileRays {
    kind: String,
    rays: Vec<FileRay>,
}

impl FileRays {
    fn read(path: &Path, format: Option<RecordFormat>, terminal: &Terminal) -> Result<Self> {
        Ok(Self { kind: kind_of(path), rays: read_rays(path, format, terminal)? })
    }

    /// The rays as the renderer takes them.
    fn relative_to(&self, scene: &Scene) -> RaySet {
        let question = if self.kind == RayKind::Shadow.name() { Question::Occluded } else { Question::Closest };
        let rays = self.rays.iter().map(|ray| ray.relative_to(scene.origin)).collect();
        RaySet { name: self.kind.clone(), group: Group::Generic, question, rays }
    }
}

/// The last but one suffix of a file's name; `file` if there is none.
fn kind_of(path: &Path) -> String {
    let suffix = path.file_stem().map(Path::new).and_then(Path::extension);
    suffix.map_or_else(|| "file".into(), |suffix| suffix.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_the_last_but_one_suffix() {
        let kind = |name: &str| kind_of(Path::new(name));
        assert_eq!(kind("a/x.shadow.rays"), "shadow");
        assert_eq!(kind("a.b/x.y.diffuse.bin"), "diffuse");
        assert_eq!((kind("a.b/x.rays"), kind("x")), ("file".into(), "file".into()));
    }
}
