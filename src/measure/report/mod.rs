//! Speed against error, on a scene's triangles: what `whitted report` measures and writes.
//!
//! ```text
//! subject -> rays -> choices -> ask (exact answers, answers, speeds) -> judge -> rows -> Markdown, JSON, SVG
//! ```
//!
//! Bars and rules are fixed before anything is measured: one configuration for all scenes; a speed has its error
//! beside it; every case is printed; what is dominated stays.

pub mod accuracy;
pub mod choices;
mod document;
pub mod image;
pub mod judge;
mod own_scenes;
mod pictures;
pub mod query;
pub mod rays;
pub mod spawn;
pub mod spheres;
pub mod subject;

use std::path::PathBuf;

use crate::accel::Params;
use crate::error::Result;
use crate::measure::features::{self, FeatureCost};
use crate::measure::light_paths::{self, DISTANCES, LightPaths, SCALES};
use crate::measure::oracle::Oracle;
use crate::progress::Progress;
use crate::render::Renderer;

use crate::measure::environment::Environment;
use crate::measure::ray_set::{Group, Question, RaySet};
use accuracy::{Accuracy, AccuracyRow};
use image::ImageRow;
use judge::Judge;
use query::{Effort, QueryRow};
use rays::RayKind;
use spawn::SpawnRow;
use spheres::SphereRow;
use subject::Subject;

/// The `schema` of the JSON: raised when a reader would break.
pub const SCHEMA: u32 = 1;

/// A part of a report: one kind of speed against one kind of error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// Rays a second against wrong answers, and time a ray against the error of hits.
    Query,
    /// Where rays leave a surface: time against self-hits.
    Spawn,
    /// The time of a picture against its error.
    Image,
    /// Formulas for quadrics, on a sphere of the report's own.
    Quadric,
    /// Shadows and mirrors against closed forms, on scenes of the report's own.
    Light,
    /// Bytes and instructions of each feature, present and absent, on scenes of the report's own. Needs valgrind.
    Features,
}

impl Plane {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Query, Self::Spawn, Self::Image, Self::Quadric, Self::Light, Self::Features];

    /// Those that need nothing but this program.
    pub const USUAL: &[Self] = &[Self::Query, Self::Spawn, Self::Image, Self::Quadric, Self::Light];

    /// Whether it measures a scene of the user's or a hard set; others have scenes of their own.
    pub fn needs_subject(self) -> bool {
        matches!(self, Self::Query | Self::Spawn | Self::Image)
    }

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Query => "query",
            Self::Spawn => "spawn",
            Self::Image => "image",
            Self::Quadric => "quadric",
            Self::Light => "light",
            Self::Features => "features",
        }
    }
}

/// Points for acne and for leaks at each scale and distance.
const LIGHT_POINTS: u64 = 1000;

/// Passes on a cancellation and no progress: for many small builds in a row.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

/// What to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Which parts.
    pub planes: Vec<Plane>,
    /// Which rays to make.
    pub kinds: Vec<RayKind>,
    /// How many of each kind.
    pub rays: usize,
    /// How many of them are timed, and how often.
    pub effort: Effort,
    /// What instructions are counted of.
    pub programs: Programs,
}

/// The programs whose instructions are counted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Programs {
    /// `whitted` itself.
    pub whole: PathBuf,
    /// Builds without a feature, by its name.
    pub without: Vec<(String, PathBuf)>,
}

/// Everything that was measured.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Whether everything that was asked for is there.
    pub complete: bool,
    /// What it was measured on.
    pub environment: Environment,
    /// Rays of each kind that were judged.
    pub rays: usize,
    /// Rays of each kind that were timed.
    pub rays_timed: usize,
    /// How often they were timed.
    pub repetitions: u32,
    /// The parts, one a scene.
    pub subjects: Vec<SubjectReport>,
    /// The accuracy of quadrics.
    pub spheres: Vec<SphereRow>,
    /// Shadows and mirrors at several scales and distances from zero.
    pub light_paths: Vec<LightPaths>,
    /// What features cost, present and absent.
    pub features: Vec<FeatureCost>,
}

/// What was measured on one scene.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SubjectReport {
    /// What the scene is called.
    pub name: String,
    /// Triangles, instances counted.
    pub triangles: usize,
    /// Quadrics of the scene, which the query and accuracy planes leave out.
    pub quadrics_left_out: usize,
    /// The sets of rays.
    pub ray_sets: Vec<RaySetReport>,
    /// The query plane: a row a set and choice.
    pub query: Vec<QueryRow>,
    /// The accuracy plane: a row a choice and group.
    pub accuracy: Vec<AccuracyRow>,
    /// Where rays leave surfaces: a row a place and way.
    pub spawn: Vec<SpawnRow>,
    /// The image plane: a row an error and number of samples.
    pub image: Vec<ImageRow>,
}

/// What a set of rays is.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct RaySetReport {
    /// What kind of rays.
    pub ray_kind: String,
    /// Whether they are aimed at what is hard.
    pub group: Group,
    /// What is asked of them.
    pub question: Question,
    /// How many.
    pub rays: usize,
    /// How many of them hit something, exactly.
    pub exact_hits: usize,
    /// Fingerprint of the rays.
    pub ray_set_hash: String,
}

impl RaySetReport {
    fn new(set: &RaySet, exact_hits: usize) -> Self {
        let RaySet { name, group, question, rays } = set;
        let (ray_kind, rays) = (name.clone(), rays.len());
        Self { ray_kind, group: *group, question: *question, rays, exact_hits, ray_set_hash: set.hash() }
    }
}

/// A file of a report.
#[derive(Debug, Clone, PartialEq)]
pub struct File {
    /// Its name within the report's folder.
    pub name: String,
    /// What is in it.
    pub text: String,
}

impl Report {
    /// A report with nothing in it yet.
    pub fn new(environment: Environment, options: &Options) -> Self {
        let Effort { rays_timed, repetitions } = options.effort;
        Self {
            schema: SCHEMA,
            complete: false,
            environment,
            rays: options.rays,
            rays_timed: rays_timed.min(options.rays),
            repetitions,
            subjects: Vec::new(),
            spheres: Vec::new(),
            light_paths: Vec::new(),
            features: Vec::new(),
        }
    }

    /// Whether nothing was measured yet.
    pub fn is_empty(&self) -> bool {
        self.subjects.is_empty() && self.spheres.is_empty() && self.light_paths.is_empty() && self.features.is_empty()
    }

    /// A name for the next subject under which no other one's pictures are: `name`, or `name-2` and so on.
    pub fn unused_name(&self, name: &str) -> String {
        // Some file systems take large and small letters for the same.
        let file = |name: &str| pictures::plain(name).to_lowercase();
        let used = |name: &str| self.subjects.iter().any(|subject| file(&subject.name) == file(name));
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        std::iter::once(name.to_owned()).chain(numbered).find(|name| !used(name)).unwrap_or_default()
    }

    /// Measures what needs no scene of the user's.
    ///
    /// # Errors
    /// A cancellation; where instructions are counted, what [`features::count`] says.
    pub fn measure_own_scenes(&mut self, options: &Options, progress: &dyn Progress) -> Result<()> {
        if options.planes.contains(&Plane::Quadric) {
            self.spheres = spheres::measure(options.rays, options.effort, progress)?;
        }
        if options.planes.contains(&Plane::Light) {
            progress.begin("light", (SCALES.len() * DISTANCES.len()) as u64);
            for (scale, distance) in SCALES.into_iter().flat_map(|s| DISTANCES.map(|d| (s, d))) {
                let params = Params::default();
                self.light_paths.push(light_paths::measure(&params, scale, distance, LIGHT_POINTS, &Quiet(progress))?);
                progress.advance(1);
            }
        }
        if options.planes.contains(&Plane::Features) {
            self.features = features::count(&options.programs.whole, &options.programs.without, progress)?;
        }
        Ok(())
    }

    /// The report as JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("names and numbers have a JSON form") + "\n"
    }

    /// All files of the report: Markdown, JSON, and the pictures that the Markdown shows.
    pub fn files(&self) -> Vec<File> {
        let mut files = pictures::all(self);
        let markdown = document::markdown(self, &files);
        files.push(File { name: "report.json".into(), text: self.json() });
        files.push(File { name: "report.md".into(), text: markdown });
        files
    }
}

/// Measures one scene; `given` are further sets of rays in the coordinates of its triangles.
///
/// # Errors
/// A cancellation, a degenerate camera, or a limit.
pub fn measure(
    subject: &Subject,
    given: &[RaySet],
    options: &Options,
    progress: &dyn Progress,
) -> Result<SubjectReport> {
    let mut report = SubjectReport {
        name: subject.name.clone(),
        triangles: subject.mesh().live_count(),
        quadrics_left_out: subject.quadrics,
        ray_sets: Vec::new(),
        query: Vec::new(),
        accuracy: Vec::new(),
        spawn: Vec::new(),
        image: Vec::new(),
    };
    for plane in &options.planes {
        match plane {
            Plane::Query => measure_query(subject, given, options, &mut report, progress)?,
            Plane::Spawn => {
                report.spawn = spawn::measure(subject, options.rays, options.effort, progress)?;
            }
            Plane::Image => report.image = image::measure(subject, options.effort.repetitions, progress)?,
            Plane::Quadric | Plane::Light | Plane::Features => {}
        }
    }
    Ok(report)
}

/// The query and the accuracy plane.
fn measure_query(
    subject: &Subject,
    given: &[RaySet],
    options: &Options,
    report: &mut SubjectReport,
    progress: &dyn Progress,
) -> Result<()> {
    let mesh = subject.mesh();
    let oracle = Oracle::new(&subject.scene)?;
    let judge = Judge::new(mesh, &oracle);
    let (skeleton, seconds) = choices::skeleton(&subject.scene, progress)?;
    let choices = choices::all(&subject.scene, &skeleton, seconds, progress)?;
    let renderer = Renderer::build(subject.scene.clone(), &Params::default(), progress)?;

    let mut accuracy = Accuracy::new(mesh, &judge, choices.len());
    let made =
        options.kinds.iter().map(|kind| kind.rays(&renderer, options.rays, progress)).collect::<Result<Vec<_>>>()?;
    for set in made.iter().chain(given) {
        if set.rays.is_empty() {
            report.ray_sets.push(RaySetReport::new(set, 0));
            continue;
        }
        let asked = query::ask(&choices, set, &judge, options.effort, progress)?;
        report.query.extend(query::rows(&choices, &asked, &judge, progress)?);
        accuracy.add(&asked);
        report.ray_sets.push(RaySetReport::new(set, asked.truths.iter().flatten().count()));
    }
    report.accuracy = accuracy.rows(&choices, &report.query);
    Ok(())
}
