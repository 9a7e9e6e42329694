//! What can be said on the command line: one entry a flag, which feeds the parser, the help and the completions.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueHint};
use clap_complete::Shell;

use super::bench::BenchArguments;
use super::build::BuildSceneArguments;
use super::check::CheckArguments;
use super::diff::DiffArguments;
use super::edit::EditArguments;
use super::estimate::EstimateArguments;
use super::explain::ExplainArguments;
use super::job::{JobArguments, MergeArguments};
use super::memory_limit::{kind_within, refuse_what_does_not_fit};
use super::precision::Precision;
use super::query::QueryArguments;
use super::report::ReportArguments;
use super::values::{self, Orbit, one_of};
use crate::accel::{Kind, Params, Preset};
use crate::error::{Error, Result};
use crate::formats::{Limits, LoadOptions, NormalMode, UpAxis};
use crate::render::{AovKind, Crop, RenderSettings};
use crate::scene::auto::View;
use crate::scene::film::{LARGEST_DEPTH, MOST_SAMPLES};
use crate::scene::{Clamp, FilmSettings, Scene, Transfer};

/// Far more threads than any machine has processors.
pub const MOST_THREADS: u32 = 4096;

/// Everything on the command line.
#[derive(Debug, Parser)]
#[command(name = "whitted", version, about = "A Whitted ray tracer for large triangle scenes and quadrics")]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene file (.toml), a model (.obj, .gltf, .glb) or a built scene (.whb) to a picture.
    Render(Box<RenderArguments>),
    /// Keep a scene with its trees in a file (.whb) that later commands need not read and build.
    Build(Box<BuildSceneArguments>),
    /// Make one picture of the parts that several processes or machines rendered.
    Merge(MergeArguments),
    /// Tell what a scene or model holds and needs, without rendering it.
    Info(InfoArguments),
    /// Tell how far two pictures are apart.
    Diff(DiffArguments),
    /// Ask the numerically hard cases, to know that this build is sound on this machine.
    Check(CheckArguments),
    /// Answer rays from a file: what each hits, and where.
    Query(Box<QueryArguments>),
    /// Tell why a pixel has its colour: its rays, what they hit, and every term that was added.
    Explain(Box<ExplainArguments>),
    /// Measure speed against error on models, scenes or built-in hard meshes, as tables and plots.
    Report(ReportArguments),
    /// Compare acceleration structures, and Embree, on the same rays: which suits this model?
    Bench(Box<BenchArguments>),
    /// Edit a scene or a model in a window, and render it there. Needs a build with the feature `editor`.
    Edit(Box<EditArguments>),
    /// Print a shell's completion script to standard output.
    Completions {
        /// The shell.
        shell: Shell,
    },
}

/// Flags of `render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// Scene file, model or built scene.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,

    /// Picture to write: .png, .jpg, .exr, .hdr and others, by suffix; `-` streams a PNG to standard output.
    /// Without it: the input's name with .png, in the current folder.
    #[arg(short, long = "output", value_name = "OUT", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Extra values a pixel, with commas between: layers of an .exr picture, else of `<stem>.aov.exr` beside it.
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = one_of(aovs()), help_heading = "Output")]
    pub aov: Vec<AovKind>,
    /// Also write the automatic camera, lights and film of a model as a scene file.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub save_scene: Option<PathBuf>,
    /// Also write rays, times and memory as JSON.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Output")]
    pub stats_json: Option<PathBuf>,
    /// Refuse to replace a file that exists.
    #[arg(long, help_heading = "Output")]
    pub no_clobber: bool,
    /// Print everything that was noted while reading, and the time of every stage, to standard error.
    #[arg(long, help_heading = "Output")]
    pub verbose: bool,
    /// Print nothing but errors.
    #[arg(long, conflicts_with = "verbose", help_heading = "Output")]
    pub quiet: bool,

    /// f32: rays in f32 through the acceleration structures. f64: the reference that such pictures are measured
    /// against, rays in f64 with exact hits, a hundred times slower.
    #[arg(long, value_name = "TYPE", value_parser = one_of(Precision::NAMES), default_value = "f32",
        help_heading = "Picture")]
    pub precision: Precision,

    /// What the picture is like.
    #[command(flatten)]
    pub film: FilmArguments,
    /// Where it is seen from.
    #[command(flatten)]
    pub camera: CameraArguments,
    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
    /// How trees are built.
    #[command(flatten)]
    pub build: BuildArguments,
    /// What of it is rendered here, and until when.
    #[command(flatten)]
    pub job: JobArguments,
}

/// Flags that replace those fields of the scene's film on which linear values depend.
#[derive(Debug, Args)]
#[command(next_help_heading = "Picture")]
pub struct ValueArguments {
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub size: Option<(u32, u32)>,
    /// Samples a pixel; 1 is the pixel's centre.
    #[arg(long, value_name = "N", value_parser = values::count(1..=MOST_SAMPLES))]
    pub spp: Option<u32>,
    /// How often a ray may be reflected or refracted, up to 1000; 0 is direct light alone.
    #[arg(long, value_name = "N", value_parser = values::count(0..=LARGEST_DEPTH))]
    pub max_depth: Option<u32>,
    /// When colours are clamped to 1: after every shade (the seed's rule) or when they are written.
    #[arg(long, value_name = "WHEN", value_parser = one_of(CLAMPS))]
    pub clamp: Option<Clamp>,
}

/// Flags that replace fields of the scene's film, or choose what of it is rendered.
#[derive(Debug, Args)]
#[command(next_help_heading = "Picture")]
pub struct FilmArguments {
    /// What linear values depend on.
    #[command(flatten)]
    pub values: ValueArguments,
    /// Render this part alone: pixels from the top left corner, X1 and Y1 excluded.
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = values::crop, allow_hyphen_values = true)]
    pub crop: Option<Crop>,
    /// How linear values become those of PNG and JPEG.
    #[arg(long, value_name = "CURVE", value_parser = one_of(TRANSFERS))]
    pub transfer: Option<Transfer>,
    /// Multiply the picture by 2 to this.
    #[arg(long, value_name = "EV", value_parser = values::exposure, allow_hyphen_values = true)]
    pub exposure: Option<f32>,
}

/// Flags that choose the camera.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Camera")]
pub struct CameraArguments {
    /// Use this camera of the input; `whitted info` lists them.
    #[arg(long, value_name = "NAME", group = "viewpoint")]
    pub camera: Option<String>,
    /// Look at the whole scene from this side.
    #[arg(long, value_name = "SIDE", value_parser = one_of(VIEWS), group = "viewpoint")]
    pub view: Option<View>,
    /// Look at the whole scene from this direction: degrees from the front towards the right, degrees up.
    #[arg(long, value_name = "AZ,EL", value_parser = values::orbit, allow_hyphen_values = true, group = "viewpoint")]
    pub orbit: Option<Orbit>,
    /// Vertical field of view in degrees, for perspective cameras.
    #[arg(long, value_name = "DEGREES", value_parser = values::field_of_view, allow_hyphen_values = true)]
    pub fov: Option<f64>,
}

/// Flags for reading models.
#[derive(Debug, Args)]
#[command(next_help_heading = "Reading")]
pub struct LoadArguments {
    /// The axis of a model that points up; without it y.
    #[arg(long, value_name = "AXIS", value_parser = one_of(UP_AXES))]
    pub up: Option<UpAxis>,
    /// Shading normals: those of the file, as without it, none, or computed from the faces.
    #[arg(long, value_name = "MODE", value_parser = one_of(NORMAL_MODES))]
    pub normals: Option<NormalMode>,
    /// Where an OBJ file has neither normals nor smoothing groups: smooth edges between faces that meet at less than this angle.
    #[arg(long, value_name = "DEGREES", value_parser = values::angle)]
    pub crease_angle: Option<f64>,
    /// Which scene of a glTF file, by name or number from 0; without it the file's default.
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<String>,
    /// The time in seconds at which a glTF file's animation is shown; without it nothing is animated.
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds, allow_hyphen_values = true)]
    pub time: Option<f64>,
    /// Which animation of a glTF file, by name or number from 0; without it the first.
    #[arg(long, value_name = "ANIMATION", requires = "time")]
    pub animation: Option<String>,
    /// Do not show the back of what a glTF file calls single-sided.
    #[arg(long)]
    pub cull_back_faces: bool,
    /// Fail where something in a file is ignored, approximated or wrong, instead of doing without it.
    #[arg(long)]
    pub strict: bool,
    /// Also read files outside the model's folder that the model names.
    #[arg(long)]
    pub allow_external: bool,
    /// Change how much a file may ask for: file-bytes, vertices, texels (of an image), depth (of nodes), data-uri-bytes. May be
    /// given several times.
    #[arg(long, value_name = "NAME=N", value_parser = values::limit)]
    pub limit: Vec<(String, u64)>,
}

/// Flags for acceleration structures and threads. None of them changes a pixel.
#[derive(Debug, Args)]
#[command(next_help_heading = "Speed (the picture stays the same)")]
pub struct BuildArguments {
    /// Acceleration structure for triangles.
    #[arg(long, value_name = "KIND", value_parser = one_of(accelerators()), default_value = "auto")]
    pub accelerator: Kind,
    /// The most memory that scene, structures and picture together may take, such as 800M or 4G: where the fastest structure would
    /// take more, the compact one is built.
    #[arg(long, value_name = "SIZE", value_parser = values::bytes, conflicts_with = "accelerator")]
    pub memory_limit: Option<u64>,
    /// How much time its build may take for faster rays; without it balanced.
    #[arg(long, value_name = "PRESET", value_parser = one_of(PRESETS))]
    pub preset: Option<Preset>,
    /// Number of threads; 0 is one per processor.
    #[arg(long, value_name = "N", value_parser = values::count(0..=MOST_THREADS), default_value_t = 0)]
    pub threads: u32,
}

/// Flags of `info`.
#[derive(Debug, Args)]
pub struct InfoArguments {
    /// Scene file or model.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Also build the acceleration structures and tell their size.
    #[arg(long)]
    pub tree: bool,
    /// Also build the acceleration structures and check them, and tell what is wrong with the meshes.
    #[arg(long)]
    pub validate: bool,
    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
    /// How trees are built.
    #[command(flatten)]
    pub build: BuildArguments,
    /// What rendering will take.
    #[command(flatten)]
    pub estimate: EstimateArguments,
}

fn aovs() -> impl Iterator<Item = (&'static str, AovKind)> {
    AovKind::ALL.into_iter().map(|kind| (kind.name(), kind))
}

/// The structures by name, `auto` among them.
pub fn accelerators() -> impl Iterator<Item = (&'static str, Kind)> {
    std::iter::once(&Kind::Auto).chain(Kind::ALL).map(|kind| (kind.name(), *kind))
}

const TRANSFERS: [(&str, Transfer); 2] = [("srgb", Transfer::Srgb), ("linear", Transfer::Linear)];
const CLAMPS: [(&str, Clamp); 2] = [("shade", Clamp::Shade), ("output", Clamp::Output)];
const VIEWS: [(&str, View); 7] = [
    ("front", View::Front),
    ("back", View::Back),
    ("left", View::Left),
    ("right", View::Right),
    ("top", View::Top),
    ("bottom", View::Bottom),
    ("iso", View::Iso),
];
const UP_AXES: [(&str, UpAxis); 2] = [("y", UpAxis::Y), ("z", UpAxis::Z)];
const NORMAL_MODES: [(&str, NormalMode); 3] =
    [("file", NormalMode::File), ("flat", NormalMode::Flat), ("smooth", NormalMode::Smooth)];
/// The presets by name.
pub const PRESETS: [(&str, Preset); 3] =
    [("fast", Preset::Fast), ("balanced", Preset::Balanced), ("best", Preset::Best)];

impl ValueArguments {
    /// Replaces those fields that were given.
    pub fn apply(&self, film: &mut FilmSettings) {
        if let Some((width, height)) = self.size {
            (film.width, film.height) = (width, height);
        }
        film.samples = self.spp.unwrap_or(film.samples);
        film.max_depth = self.max_depth.unwrap_or(film.max_depth);
        film.clamp = self.clamp.unwrap_or(film.clamp);
    }
}

impl FilmArguments {
    /// Replaces those fields that were given.
    pub fn apply(&self, film: &mut FilmSettings) {
        self.values.apply(film);
        film.transfer = self.transfer.unwrap_or(film.transfer);
        film.exposure = self.exposure.unwrap_or(film.exposure);
    }
}

impl LoadArguments {
    /// As the readers take them.
    pub fn options(&self) -> LoadOptions {
        let mut limits = Limits::default();
        for (name, value) in &self.limit {
            limits.by_name().into_iter().filter(|(known, _)| known == name).for_each(|(_, limit)| *limit = *value);
        }
        LoadOptions {
            normals: self.normals.unwrap_or_default(),
            up: self.up.unwrap_or_default(),
            faces: false,
            crease_angle: self.crease_angle,
            scene: self.scene.clone(),
            animation: self.animation.clone(),
            time: self.time,
            cull_back_faces: self.cull_back_faces,
            allow_external: self.allow_external,
            limits,
        }
    }
}

impl BuildArguments {
    /// As the builders take them, for a scene and a picture that takes so many bytes.
    ///
    /// # Errors
    /// When nothing fits the limit of memory.
    pub fn params(&self, scene: &Scene, picture: u64) -> Result<Params> {
        let kind = match self.accelerator {
            Kind::Auto => kind_within(self.memory_limit, scene, picture)?,
            kind => kind,
        };
        Ok(Params { kind, preset: self.preset.unwrap_or_default() })
    }
}

impl BuildArguments {
    /// Refuses a scene that does not fit in memory before it is read, as far as its files tell.
    ///
    /// # Errors
    /// How much is needed and what helps.
    pub fn refuse_what_does_not_fit(&self, input: &Path, options: &LoadOptions) -> Result<()> {
        // Who names a structure wants it whatever it takes.
        if self.accelerator != Kind::Auto {
            return Ok(());
        }
        refuse_what_does_not_fit(input, options, self.memory_limit)
    }

    /// Says that nothing keeps a limit of memory with a flag that leaves no choice of structures.
    pub fn refuse_limit(&self, flag: &str) -> Result<()> {
        match self.memory_limit {
            Some(_) => Err(Error::caller(format!("--memory-limit chooses a structure, and {flag} has its own"))
                .remedy(format!("leave out --memory-limit or {flag}"))),
            None => Ok(()),
        }
    }
}

impl RenderArguments {
    /// As the renderer takes them; a kind of extra values that was named twice counts once.
    pub fn settings(&self) -> RenderSettings {
        let aovs = AovKind::ALL.into_iter().filter(|kind| self.aov.contains(kind)).collect();
        RenderSettings {
            threads: self.build.threads as usize,
            crop: self.film.crop,
            aovs,
            tiles: None,
            coverage: self.verbose,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    fn render(flags: &str) -> std::result::Result<Box<RenderArguments>, clap::Error> {
        let words = ["whitted", "render", "in.obj"].into_iter().chain(flags.split_whitespace());
        Arguments::try_parse_from(words).map(|arguments| match arguments.command {
            Command::Render(render) => render,
            _ => unreachable!(),
        })
    }

    #[test]
    fn the_parser_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn given_flags_replace_fields_of_the_film_and_no_others() {
        let scene = FilmSettings { samples: 9, exposure: 2.0, ..Default::default() };
        let mut film = scene;
        render("").unwrap().film.apply(&mut film);
        assert_eq!(film, scene);
        render("--size 7x5 --spp 4 --max-depth 0 --transfer linear --clamp shade --exposure -1")
            .unwrap()
            .film
            .apply(&mut film);
        let expected = FilmSettings {
            width: 7,
            height: 5,
            samples: 4,
            max_depth: 0,
            clamp: Clamp::Shade,
            transfer: Transfer::Linear,
            exposure: -1.0,
        };
        assert_eq!(film, expected);
    }

    #[test]
    fn extra_values_come_once_and_in_one_order() {
        let settings = render("--aov normal,depth,normal --aov id").unwrap().settings();
        assert_eq!(settings.aovs, [AovKind::Depth, AovKind::Normal, AovKind::Id]);
    }

    #[test]
    fn names_are_those_that_json_uses() {
        fn check<T: serde::Serialize + Copy>(names: impl IntoIterator<Item = (&'static str, T)>) {
            for (name, value) in names {
                assert_eq!(serde_json::to_value(value).unwrap(), name);
            }
        }
        check(aovs());
        check(accelerators());
        check(PRESETS);
        check(CLAMPS);
        check(TRANSFERS);
        check(UP_AXES);
        check(NORMAL_MODES);
        check(Precision::NAMES);
    }

    #[test]
    fn only_one_camera_can_be_asked_for() {
        assert!(render("--view left --fov 20").is_ok());
        for both in ["--view left --orbit 1,2", "--camera a --view top", "--camera a --orbit 1,2"] {
            assert_eq!(render(both).unwrap_err().kind(), clap::error::ErrorKind::ArgumentConflict, "{both}");
        }
    }

    #[test]
    fn the_manual_explains_every_flag() {
        let page = include_str!("../manual/command_line.md");
        for command in Arguments::command().get_subcommands() {
            for flag in command.get_arguments().filter_map(|argument| argument.get_long()) {
                assert!(page.contains(&format!("`--{flag}")), "--{flag} of {}", command.get_name());
            }
        }
    }

    #[test]
    fn limits_are_told() {
        for (flags, told) in [("--max-depth 1001", "1000"), ("--spp 0", "1.."), ("--accelerator kd", "bvh2")] {
            let message = render(flags).unwrap_err().to_string();
            assert!(message.contains(told), "{flags}: {message}");
        }
    }
}
