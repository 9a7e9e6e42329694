//! What takes part: the renderer's structures and those of other programs.

#[cfg(feature = "embree")]
use std::sync::Arc;
use std::time::Instant;

use crate::accel::{Kind, Params, Preset, Tests, TriangleAccelerator};
use crate::error::{Error, Result};
use crate::geometry::{Hit, Ray};
#[cfg(feature = "embree")]
use crate::measure::peers::embree::{EmbreeScene, Library};
#[cfg(any(feature = "embree", feature = "peers"))]
use crate::measure::peers::{Built, Peer, Surface};
use crate::measure::statistics::median;
use crate::progress::Progress;
use crate::render::Renderer;
use crate::render::intersect::{Intersect, TwoLevel};
use crate::scene::Scene;

/// How rays are handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Calls {
    /// One public call a ray, set-up included.
    Single,
    /// One call for many rays.
    Batch,
}

impl Calls {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Single, Self::Batch];

    /// The name on the command line and in rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Batch => "batch",
        }
    }
}

/// Answers rays.
pub trait Contender: Sync {
    /// The closest hit of each ray; the slices have equal lengths.
    fn closest(&self, calls: Calls, rays: &[Ray], hits: &mut [Hit]);

    /// Whether each ray hits anything; the slices have equal lengths.
    fn occluded(&self, calls: Calls, rays: &[Ray], occluded: &mut [bool]);

    /// What a single call for the closest hit, or for any, compares a ray with; `None` if it does not tell.
    fn tests(&self, _ray: &Ray, _any: bool) -> Option<Tests> {
        None
    }
}

/// A contender with all that was found out about it while it was built.
pub struct Entry {
    /// What answers.
    pub contender: Box<dyn Contender>,
    /// What it is called.
    pub accelerator: String,
    /// How it was built.
    pub preset: &'static str,
    /// Whether it is another program's, whose answers may differ.
    pub peer: bool,
    /// The calls that it has.
    pub calls: Vec<Calls>,
    /// Seconds of its build, by number of threads.
    pub builds: Vec<(usize, f64)>,
    /// Nodes and leaves, divided by the triangles that it holds.
    pub bytes_per_triangle: f64,
}

impl Entry {
    /// Seconds of the build with this many threads.
    pub fn build_s(&self, threads: usize) -> f64 {
        self.builds.iter().find(|(number, _)| *number == threads).map_or(f64::NAN, |(_, seconds)| *seconds)
    }
}

impl Contender for Renderer {
    fn closest(&self, calls: Calls, rays: &[Ray], hits: &mut [Hit]) {
        match calls {
            Calls::Single => rays.iter().zip(hits).for_each(|(ray, hit)| *hit = closest(self, ray)),
            Calls::Batch => self.closest_batch(rays, hits),
        }
    }

    fn occluded(&self, calls: Calls, rays: &[Ray], flags: &mut [bool]) {
        match calls {
            Calls::Single => rays.iter().zip(flags).for_each(|(ray, flag)| *flag = occluded(self, ray)),
            Calls::Batch => self.occluded_batch(rays, flags),
        }
    }

    fn tests(&self, ray: &Ray, any: bool) -> Option<Tests> {
        Some(self.count(ray, any))
    }
}

/// The reference, which has no calls of its own for batches.
impl<A: TriangleAccelerator> Contender for TwoLevel<A> {
    fn closest(&self, _: Calls, rays: &[Ray], hits: &mut [Hit]) {
        rays.iter().zip(hits).for_each(|(ray, hit)| *hit = Intersect::closest(self, ray));
    }

    fn occluded(&self, _: Calls, rays: &[Ray], flags: &mut [bool]) {
        rays.iter().zip(flags).for_each(|(ray, flag)| *flag = Intersect::occluded(self, ray));
    }
}

/// A call that the compiler cannot take out of a loop: what a user of the library pays for each ray.
#[inline(never)]
fn closest(renderer: &Renderer, ray: &Ray) -> Hit {
    renderer.closest(ray)
}

/// The same of whether there is a hit.
#[inline(never)]
fn occluded(renderer: &Renderer, ray: &Ray) -> bool {
    renderer.occluded(ray)
}

/// The name of a preset in rows.
pub fn preset_name(preset: Preset) -> &'static str {
    match preset {
        Preset::Fast => "fast",
        Preset::Balanced => "balanced",
        Preset::Best => "best",
    }
}

/// Builds one of the renderer's structures with each number of threads.
///
/// # Errors
/// As [`Renderer::build`].
pub fn structure(scene: &Scene, params: Params, threads: &[usize], progress: &dyn Progress) -> Result<Entry> {
    let build = |threads: usize| {
        let scene = scene.clone();
        let start = Instant::now();
        let renderer = in_pool(threads, || Renderer::build(scene, &params, progress))??;
        Ok((renderer, start.elapsed().as_secs_f64()))
    };
    let (renderer, builds) = build_each(threads, progress, build)?;
    let stats = renderer.build_stats();
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.live_count()).sum();
    Ok(Entry {
        accelerator: params.kind.name().into(),
        preset: if params.kind == Kind::Linear { "-" } else { preset_name(params.preset) },
        peer: false,
        calls: Calls::ALL.into(),
        builds,
        bytes_per_triangle: (stats.node_bytes + stats.leaf_bytes) as f64 / triangles as f64,
        contender: Box::new(renderer),
    })
}

/// Builds with each number of threads, quick builds a few times, of which the median counts; keeps the last one.
fn build_each<T>(
    threads: &[usize],
    progress: &dyn Progress,
    build: impl Fn(usize) -> Result<(T, f64)>,
) -> Result<(T, Vec<(usize, f64)>)> {
    /// Builds that take longer than this many seconds together are not repeated.
    const PATIENCE: f64 = 0.5;
    let mut kept = None;
    let mut builds = Vec::new();
    for &threads in threads {
        let mut seconds = Vec::new();
        while seconds.is_empty() || (seconds.len() < 5 && seconds.iter().sum::<f64>() < PATIENCE) {
            progress.check()?;
            // One at a time in memory.
            drop(kept.take());
            let (built, taken) = build(threads)?;
            kept = Some(built);
            seconds.push(taken);
        }
        builds.push((threads, median(&seconds).value));
    }
    let kept = kept.ok_or_else(|| Error::caller("no number of threads was given"))?;
    Ok((kept, builds))
}

/// Runs parallel work with this many threads.
fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Error::limit(format!("{threads} threads cannot be started: {error}")))?;
    Ok(pool.install(work))
}

/// A peer that is asked one call a ray.
#[cfg(any(feature = "embree", feature = "peers"))]
struct Singles<P>(P);

#[cfg(any(feature = "embree", feature = "peers"))]
impl<P: std::ops::Deref<Target: Peer> + Sync> Contender for Singles<P> {
    fn closest(&self, _: Calls, rays: &[Ray], hits: &mut [Hit]) {
        rays.iter().zip(hits).for_each(|(ray, hit)| *hit = self.0.closest(ray));
    }

    fn occluded(&self, _: Calls, rays: &[Ray], flags: &mut [bool]) {
        rays.iter().zip(flags).for_each(|(ray, flag)| *flag = self.0.occluded(ray));
    }
}

#[cfg(feature = "embree")]
pub mod embree {
    use super::*;

    /// A call a packet.
    struct Packets(Arc<EmbreeScene>);

    impl Contender for Packets {
        fn closest(&self, _: Calls, rays: &[Ray], hits: &mut [Hit]) {
            self.0.closest_in_packets(rays, hits);
        }

        fn occluded(&self, _: Calls, rays: &[Ray], flags: &mut [bool]) {
            self.0.occluded_in_packets(rays, flags);
        }
    }

    /// Builds Embree's fast and robust scenes: three contenders, the first of which others are compared with.
    pub fn all(
        library: &Library,
        surfaces: &Arc<[Surface]>,
        threads: &[usize],
        progress: &dyn Progress,
    ) -> Result<Vec<Entry>> {
        let scene = |robust: bool| {
            let build = |threads: usize| {
                let Built { peer, seconds, bytes } = EmbreeScene::build(library, surfaces, robust, threads)?;
                Ok(((peer, bytes), seconds))
            };
            let ((scene, bytes), builds) = build_each(threads, progress, build)?;
            Ok::<_, Error>((Arc::new(scene), builds, bytes))
        };
        let entry = |name: &str, calls, contender, builds: &[(usize, f64)], bytes| {
            peer(name, "medium", calls, contender, builds, bytes, surfaces)
        };
        let (fast, builds, bytes) = scene(false)?;
        let mut all = vec![entry(EMBREE, Calls::Single, Box::new(Singles(Arc::clone(&fast))), &builds, bytes)];
        if library.packet_width().is_some() {
            all.push(entry("embree-packet", Calls::Batch, Box::new(Packets(fast)), &builds, bytes));
        }
        let (robust, builds, bytes) = scene(true)?;
        all.insert(1, entry("embree-robust", Calls::Single, Box::new(Singles(robust)), &builds, bytes));
        Ok(all)
    }
}

/// Builds the other crates' structures.
///
/// # Errors
/// A cancellation, or what a crate does not take.
#[cfg(feature = "peers")]
pub fn crates(surfaces: &[Surface], threads: &[usize], progress: &dyn Progress) -> Result<Vec<Entry>> {
    use crate::measure::peers::bounding_volumes::BoundingVolumes;
    use crate::measure::peers::obvhs::Obvhs;
    use crate::measure::peers::parry::Parry;
    let mut all = Vec::new();
    let mut add = |name: &str, preset, build: &(dyn Fn() -> Result<Built<Box<dyn Peer>>> + Sync)| {
        let build = |threads: usize| {
            let Built { peer, seconds, bytes } = in_pool(threads, build)??;
            Ok(((peer, bytes), seconds))
        };
        let ((contender, bytes), builds) = build_each(threads, progress, build)?;
        all.push(peer(name, preset, Calls::Single, Box::new(Singles(contender)), &builds, bytes, surfaces));
        Ok::<(), Error>(())
    };
    fn boxed<P: Peer + 'static>(Built { peer, seconds, bytes }: Built<P>) -> Built<Box<dyn Peer>> {
        Built { peer: Box::new(peer), seconds, bytes }
    }
    add("obvhs-bvh2", "medium", &|| Ok(boxed(Obvhs::<::obvhs::bvh2::Bvh2>::build(surfaces))))?;
    add("obvhs-cwbvh", "medium", &|| Ok(boxed(Obvhs::<::obvhs::cwbvh::CwBvh>::build(surfaces))))?;
    add("parry3d", "-", &|| Parry::build(surfaces).map(boxed))?;
    add("bvh", "-", &|| Ok(boxed(BoundingVolumes::build(surfaces))))?;
    Ok(all)
}

/// A peer as it takes part.
#[cfg(any(feature = "embree", feature = "peers"))]
fn peer(
    name: &str,
    preset: &'static str,
    calls: Calls,
    contender: Box<dyn Contender>,
    builds: &[(usize, f64)],
    bytes: u64,
    surfaces: &[Surface],
) -> Entry {
    let triangles: usize = surfaces.iter().map(|surface| surface.indices.len()).sum();
    Entry {
        contender,
        accelerator: name.into(),
        preset,
        peer: true,
        calls: vec![calls],
        builds: builds.to_vec(),
        bytes_per_triangle: bytes as f64 / triangles as f64,
    }
}

/// The contender that others are compared with: Embree's single rays, fast.
pub const EMBREE: &str = "embree";
