//! Which acceleration structure suits a mesh: all contenders on the same rays, as `whitted bench` measures it.
//!
//! ```text
//! model -> reference -> rays -> contenders -> equal hits? -> interleaved rounds -> rows -> tables, JSON, SVG
//! ```
//!
//! The reference is `bvh2`, or a tree that is too slow to be wrong; itself it is compared with every triangle asked in turn. Nothing
//! is timed whose hits are not equal to it bit for bit, but for other programs, of which is told how often they differ.

mod contender;
mod document;
mod loose;
mod picture;
pub mod rays;
mod run;

use std::io::Write;
#[cfg(any(feature = "embree", feature = "peers"))]
use std::sync::Arc;

use crate::accel::{Kind, Params};
use crate::error::{Error, Result};
use crate::measure::environment::Environment;
#[cfg(any(feature = "embree", feature = "peers"))]
use crate::measure::peers::Surface;
#[cfg(feature = "embree")]
use crate::measure::peers::embree::Library;
use crate::measure::ray_set::RaySet;
use crate::progress::Progress;
use crate::render::Renderer;
use crate::scene::Scene;

pub use contender::Calls;
use contender::Entry;
use rays::{RayKind, RaySource, View};
use run::Reference;
pub use run::ReferenceKind;

/// The `schema` of the JSON: raised when a reader would break.
pub const SCHEMA: u32 = 1;

/// What to measure.
pub struct Options {
    /// The renderer's structures, and how they are built.
    pub structures: Vec<Params>,
    /// Which rays to make.
    pub kinds: Vec<RayKind>,
    /// From where; where it makes sense if there is none.
    pub views: Vec<View>,
    /// About how many primary rays.
    pub rays: usize,
    /// Rays a model on which the reference is compared with `linear`; as many as take seconds if that is left open.
    pub linear_rays: Option<usize>,
    /// How rays are handed over.
    pub calls: Vec<Calls>,
    /// With how many threads; rising, none twice.
    pub threads: Vec<usize>,
    /// How often everything is timed; 0 compares hits alone.
    pub rounds: u32,
    /// What hits are compared with.
    pub reference: ReferenceKind,
    /// Embree, if it takes part.
    #[cfg(feature = "embree")]
    pub embree: Option<Library>,
}

#[cfg(any(feature = "embree", feature = "peers"))]
impl Options {
    /// Whether other programs take part.
    fn has_peers(&self) -> bool {
        #[cfg(feature = "embree")]
        if self.embree.is_some() {
            return true;
        }
        cfg!(feature = "peers")
    }
}

/// Everything that was measured.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Bench {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Whether everything that was asked for is there.
    pub complete: bool,
    /// What it was measured on.
    pub environment: Environment,
    /// How often everything was timed.
    pub rounds: u32,
    /// What a reader has to know about single models.
    pub notes: Vec<String>,
    /// What was measured of which.
    pub models: Vec<ModelReport>,
    /// A row a model, set of rays, contender, way of calling and number of threads.
    pub rows: Vec<Row>,
}

/// What a model is.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ModelReport {
    /// What it is called.
    pub model: String,
    /// Triangles, instances counted.
    pub triangles: u64,
    /// What hits were compared with.
    pub reference: &'static str,
    /// Rays on which that was compared with `linear`.
    pub linear_rays: u64,
}

/// One contender on one set of rays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Row {
    /// What the model is called.
    pub model: String,
    /// What answers.
    pub accelerator: String,
    /// How it was built; `-` where there is no choice.
    pub preset: &'static str,
    /// Whether it is another program's.
    pub peer: bool,
    /// Where the camera stands; null for rays of a file.
    pub view: Option<View>,
    /// What kind of rays.
    pub ray_kind: String,
    /// How many.
    pub rays: usize,
    /// Fingerprint of the rays.
    pub ray_set_hash: String,
    /// How they are handed over.
    pub calls: Calls,
    /// With how many threads.
    pub threads: usize,
    /// Million rays a second, the median of the rounds; null if not timed.
    pub mrays_per_s: Option<f64>,
    /// Width of the median's 95 % interval, in parts of it; null if not timed.
    pub spread: Option<f64>,
    /// Times as fast as Embree's single rays, fast, with as many threads in the same rounds; null without.
    pub ratio_to_embree: Option<f64>,
    /// Boxes that a single call compares a ray with, on average over some of the rays; null of peers.
    pub boxes_per_ray: Option<f64>,
    /// The same of triangles.
    pub triangles_per_ray: Option<f64>,
    /// Rays that were answered by a hit.
    pub hits: u64,
    /// Fingerprint of the answers as `query` writes them.
    pub hit_hash: String,
    /// Answers that differ from the reference in any bit; of a peer those that differ in whether there is a hit.
    pub differing: u64,
    /// Of a peer: hits of another triangle than the reference's.
    pub other_triangle: Option<u64>,
    /// The first ray that `differing` counts, as `query` reads it.
    pub first_differing: Option<String>,
    /// Seconds of the build with as many threads.
    pub build_s: f64,
    /// Nodes and leaves, divided by the triangles.
    pub bytes_per_triangle: f64,
    /// Where the answers begin in the file of `--hits-out`, in bytes; null without.
    pub hits_at: Option<u64>,
}

/// A model with what is asked of it.
pub struct Model {
    /// What it is called.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// Further rays, relative to the scene's origin.
    pub given: Vec<RaySet>,
}

/// Where answers are written, one 32-bit word after the other, and how many bytes are there.
pub struct HitsOut<'a> {
    sink: &'a mut dyn Write,
    written: u64,
}

impl<'a> HitsOut<'a> {
    /// Begins with an empty file.
    pub fn new(sink: &'a mut dyn Write) -> Self {
        Self { sink, written: 0 }
    }

    /// Appends bytes; gives where they begin.
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<u64> {
        let start = self.written;
        self.sink.write_all(bytes)?;
        self.written += bytes.len() as u64;
        Ok(start)
    }
}

impl Bench {
    /// A bench with nothing in it yet.
    pub fn new(environment: Environment, rounds: u32) -> Self {
        let (notes, models, rows) = (Vec::new(), Vec::new(), Vec::new());
        Self { schema: SCHEMA, complete: false, environment, rounds, notes, models, rows }
    }

    /// A name for the next model that no other one has: `name`, or `name-2` and so on.
    pub fn unused_name(&self, name: &str) -> String {
        let used = |name: &str| self.models.iter().any(|model| model.model == name);
        let numbered = (2..).map(|number| format!("{name}-{number}"));
        std::iter::once(name.to_owned()).chain(numbered).find(|name| !used(name)).unwrap_or_default()
    }

    /// Answers of the renderer's structures that are not those of the reference.
    pub fn wrong(&self) -> u64 {
        self.rows.iter().filter(|row| !row.peer).map(|row| row.differing).sum()
    }

    /// Measures a model.
    ///
    /// # Errors
    /// A cancellation; a scene that has nothing to look at; a reference that is itself wrong; what cannot be written.
    pub fn measure(
        &mut self,
        model: Model,
        options: &Options,
        mut hits_out: Option<&mut HitsOut<'_>>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Model { name, mut scene, given } = model;
        let triangles = scene.instanced_triangles();
        (scene.film.width, scene.film.height) = rays::picture_size(options.rays);
        let origin = scene.origin;
        let mut reference = Reference::build(scene, options.reference, progress)?;
        let mut sets = made(reference.renderer(), options, progress)?;
        sets.extend(given.into_iter().map(|set| (None, set)));
        for (_, set) in sets.iter().filter(|(_, set)| set.rays.is_empty()) {
            self.notes.push(format!("{name}: there are no {} rays.", set.name));
        }
        sets.retain(|(_, set)| !set.rays.is_empty());
        let most = sets.iter().map(|(_, set)| set.rays.len()).max().unwrap_or(0);
        let entries = self.entries(&name, reference.renderer().scene(), most, options, progress)?;
        let linear_rays = options.linear_rays.unwrap_or_else(|| linear_rays(reference.renderer().scene()));
        reference.checked_a_set = linear_rays.div_ceil(sets.len().max(1));
        let checked = sets.iter().map(|(_, set)| reference.checked_rays(set) as u64).sum();
        let reference_name = options.reference.name();
        self.models.push(ModelReport {
            model: name.clone(),
            triangles,
            reference: reference_name,
            linear_rays: checked,
        });
        for (view, set) in &sets {
            let asked = run::Asked { set, view: *view, model: &name, origin };
            let rows = run::ask(&entries, &asked, &reference, options, hits_out.as_deref_mut(), progress)?;
            self.rows.extend(rows);
        }
        Ok(())
    }

    /// Everyone who takes part, built.
    fn entries(
        &mut self,
        name: &str,
        scene: &Scene,
        most_rays: usize,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Vec<Entry>> {
        /// More triangle tests a set of rays, and every turn would take many seconds.
        const MOST_LINEAR: u64 = 500_000_000;
        let mut entries = Vec::new();
        let triangles = scene.instanced_triangles();
        for params in &options.structures {
            if params.kind == Kind::Linear && triangles.saturating_mul(most_rays as u64) > MOST_LINEAR {
                self.notes.push(format!("{name}: linear is left out: it would take {triangles} tests a ray."));
                continue;
            }
            entries.push(contender::structure(scene, *params, &options.threads, progress)?);
        }
        #[cfg(any(feature = "embree", feature = "peers"))]
        entries.extend(self.peers(name, scene, options, progress)?);
        if entries.is_empty() {
            return Err(Error::caller("there is nothing to measure").remedy("choose other accelerators or fewer rays"));
        }
        Ok(entries)
    }

    /// Other programs with the triangles of the scene.
    #[cfg(any(feature = "embree", feature = "peers"))]
    fn peers(&mut self, name: &str, scene: &Scene, options: &Options, progress: &dyn Progress) -> Result<Vec<Entry>> {
        let mut all = Vec::new();
        let surfaces: Arc<[Surface]> = match Surface::all(scene)? {
            _ if !options.has_peers() => return Ok(all),
            none if none.is_empty() => {
                self.notes.push(format!("{name}: peers are left out: there are no triangles."));
                return Ok(all);
            }
            some => some.into(),
        };
        if !scene.quadrics.is_empty() {
            self.notes
                .push(format!("{name}: peers have the triangles alone, not the {} quadrics.", scene.quadrics.len()));
        }
        if scene.objects.len() > 1 {
            self.notes.push(format!("{name}: peers have the triangles of {} objects flattened.", surfaces.len()));
        }
        #[cfg(feature = "embree")]
        if let Some(library) = &options.embree {
            all.extend(contender::embree::all(library, &surfaces, &options.threads, progress)?);
        }
        #[cfg(feature = "peers")]
        all.extend(contender::crates(&surfaces, &options.threads, progress)?);
        Ok(all)
    }
}

/// How many rays may be asked of every triangle in turn: ten thousand, or as many as take a few seconds.
fn linear_rays(scene: &Scene) -> usize {
    const MOST_RAYS: u64 = 10_000;
    const MOST_TESTS: u64 = 300_000_000;
    let tests = scene.instanced_triangles() + scene.objects.len() as u64;
    (MOST_TESTS / tests.max(1)).clamp(1, MOST_RAYS) as usize
}

/// The rays that are made of a model.
fn made(renderer: &Renderer, options: &Options, progress: &dyn Progress) -> Result<Vec<(Option<View>, RaySet)>> {
    let mut sets = Vec::new();
    if options.kinds.is_empty() {
        return Ok(sets);
    }
    for view in View::ALL {
        let wanted = match (options.views.is_empty(), view) {
            (false, _) => options.views.contains(&view),
            (true, View::Outside) => true,
            (true, View::Inside) => rays::has_an_inside(renderer)?,
        };
        if wanted {
            let source = RaySource::new(renderer, view)?;
            for kind in &options.kinds {
                sets.push((Some(view), source.rays(*kind, progress)?));
            }
        }
    }
    Ok(sets)
}
