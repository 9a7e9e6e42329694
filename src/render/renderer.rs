//! The public face: a scene built once, asked for hits and pictures.

use std::time::Instant;

use crate::accel::{Bvh2, Compact, CwBvh, KeptTree, Kind, Linear, Params, Tests, TreeArrays, Wide};
use crate::error::Result;
use crate::geometry::{Hit, Key, Ray};
use crate::progress::Progress;
use crate::render::explain::{self, Explanation, Samples};
use crate::render::film::Film;
use crate::render::intersect::{Intersect, Ready, TwoLevel};
use crate::render::ray_tracing::ray_tracing;
use crate::render::settings::RenderSettings;
use crate::render::tiles::Tile;
use crate::render::world::World;
use crate::scene::{Camera, FilmSettings, Light, Scene};

/// A scene with its acceleration structures.
pub struct Renderer {
    scene: Scene,
    intersect: AnyTwoLevel,
    stats: BuildStats,
}

/// What building took and how large it became.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct BuildStats {
    /// The accelerator that was chosen.
    pub accelerator: String,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Bytes of the bottom-level trees' nodes, all meshes together.
    pub node_bytes: u64,
    /// Bytes of the bottom-level leaves' triangles.
    pub leaf_bytes: u64,
    /// Bytes of the top level.
    pub top_level_bytes: u64,
    /// Nodes of the bottom-level trees.
    pub nodes: u64,
    /// Leaves of the bottom-level trees.
    pub leaves: u64,
    /// The deepest leaf.
    pub max_depth: u32,
}

/// What there is already of a scene's structures.
#[derive(Clone, Copy)]
enum Before<'a> {
    Nothing,
    /// Those of another state of the scene.
    State(&'a Scene, &'a AnyTwoLevel),
    /// The trees of all meshes, in a file.
    Kept(&'a [KeptTree]),
}

macro_rules! any_two_level {
    ({} $($name:ident $text:literal $description:literal;)+) => {
        /// A two-level structure over any kind of accelerator; the kind is matched once a call.
        enum AnyTwoLevel {
            $(#[doc = $description] $name(TwoLevel<$name>),)+
        }

        impl AnyTwoLevel {
            fn kind(&self) -> Kind {
                match self {
                    $(Self::$name(_) => Kind::$name,)+
                }
            }

            /// Builds what is not there before.
            fn build(scene: &Scene, before: Before<'_>, params: &Params, progress: &dyn Progress) -> Result<Self> {
                match params.kind.resolve() {
                    $(crate::accel::Kind::$name => {
                        let ready = match before {
                            Before::State(scene, Self::$name(structure)) => Ready::State(scene, structure),
                            Before::Kept(trees) => Ready::Kept(trees),
                            _ => Ready::Nothing,
                        };
                        Ok(Self::$name(TwoLevel::build(scene, &ready, params, progress)?))
                    })+
                    crate::accel::Kind::Auto => unreachable!("resolve never returns Auto"),
                }
            }
        }

        /// Evaluates an expression with the structure of whatever kind.
        macro_rules! with_structure {
            ($any:expr, $structure:ident => $body:expr) => {
                match $any {
                    $(AnyTwoLevel::$name($structure) => $body,)+
                }
            };
        }
    };
}
crate::for_each_accelerator!(any_two_level {});

impl Renderer {
    /// Builds the acceleration structures of a scene.
    ///
    /// # Errors
    /// A singular transform, a light without direction, a material that makes light, or a cancellation.
    pub fn build(scene: Scene, params: &Params, progress: &dyn Progress) -> Result<Self> {
        Self::build_on(scene, Before::Nothing, params, progress)
    }

    /// [`build`](Self::build) for a scene that is another state of this one's: trees of meshes that both share are not built
    /// again. `params` must be those of this one.
    ///
    /// # Errors
    /// As `build`.
    pub fn rebuild(&self, scene: Scene, params: &Params, progress: &dyn Progress) -> Result<Self> {
        Self::build_on(scene, Before::State(&self.scene, &self.intersect), params, progress)
    }

    /// A scene whose meshes' trees were kept, one each, and are of this kind; the rest is built.
    ///
    /// # Errors
    /// As [`build`](Self::build); a file's error where numbers in trees name what there is not.
    pub fn restore(scene: Scene, kind: Kind, trees: &[KeptTree], progress: &dyn Progress) -> Result<Self> {
        let params = Params { kind, ..Params::default() };
        Self::build_on(scene, Before::Kept(trees), &params, progress)
    }

    /// The arrays of the trees of the scene's meshes, to be kept; `None` where their kind [cannot be](Kind::can_be_kept).
    pub fn arrays(&self) -> Option<Vec<TreeArrays<'_>>> {
        with_structure!(&self.intersect, structure => structure.arrays())
    }

    fn build_on(scene: Scene, before: Before<'_>, params: &Params, progress: &dyn Progress) -> Result<Self> {
        let start = Instant::now();
        progress.begin("build", scene.meshes.iter().map(|mesh| mesh.live_count() as u64).sum());
        let intersect = AnyTwoLevel::build(&scene, before, params, progress)?;
        let mut stats = BuildStats {
            accelerator: params.kind.resolve().name().into(),
            seconds: start.elapsed().as_secs_f64(),
            ..BuildStats::default()
        };
        with_structure!(&intersect, structure => {
            for tree in structure.mesh_stats() {
                stats.node_bytes += tree.node_bytes;
                stats.leaf_bytes += tree.leaf_bytes;
                stats.nodes += tree.nodes;
                stats.leaves += tree.leaves;
                stats.max_depth = stats.max_depth.max(tree.max_depth);
            }
            stats.top_level_bytes = structure.top_level_bytes() as u64;
        });
        Ok(Self { scene, intersect, stats })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Renders other pictures from now on.
    pub fn set_film(&mut self, film: FilmSettings) {
        self.scene.film = film;
        with_structure!(&mut self.intersect, structure => structure.world.see(&self.scene));
    }

    /// Puts another camera in the place of the active one.
    pub fn look_through(&mut self, camera: Camera) {
        self.scene.cameras[self.scene.active_camera].camera = camera;
        with_structure!(&mut self.intersect, structure => structure.world.see(&self.scene));
    }

    /// Puts other lights in the place of the scene's.
    ///
    /// # Errors
    /// A light without direction.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<()> {
        self.scene.lights = lights;
        with_structure!(&mut self.intersect, structure => structure.world.light(&self.scene))
    }

    /// The objects as rays meet them.
    pub fn world(&self) -> &World {
        with_structure!(&self.intersect, structure => structure.world())
    }

    /// The closest hit: the first in the order of [`Key`]. Rays are relative to the scene's origin.
    pub fn closest(&self, ray: &Ray) -> Hit {
        with_structure!(&self.intersect, structure => structure.closest(ray))
    }

    /// Whether anything is hit, whatever its material.
    pub fn occluded(&self, ray: &Ray) -> bool {
        with_structure!(&self.intersect, structure => structure.occluded(ray))
    }

    /// What the search for the closest hit, or for any, compares a ray with.
    pub fn count(&self, ray: &Ray, any: bool) -> Tests {
        with_structure!(&self.intersect, structure => structure.count(ray, any))
    }

    /// The first hit after `key`; start from [`Key::BEFORE_ALL`] and go on from each hit's key to visit them all.
    pub fn next_after(&self, ray: &Ray, key: Key) -> Hit {
        with_structure!(&self.intersect, structure => structure.next_after(ray, key))
    }

    /// Every hit in order.
    pub fn hits(&self, ray: &Ray) -> impl Iterator<Item = Hit> + '_ {
        let ray = *ray;
        let next = move |key: Key| Some(self.next_after(&ray, key)).filter(Hit::is_hit);
        std::iter::successors(next(Key::BEFORE_ALL), move |hit| next(hit.key()))
    }

    /// [`closest`](Self::closest) for every ray of a slice.
    ///
    /// # Panics
    /// If `hits` has another length than `rays`.
    pub fn closest_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        with_structure!(&self.intersect, structure => structure.closest_batch(rays, hits));
    }

    /// [`occluded`](Self::occluded) for every ray of a slice.
    ///
    /// # Panics
    /// If `occluded` has another length than `rays`.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        with_structure!(&self.intersect, structure => structure.occluded_batch(rays, occluded));
    }

    /// Renders the scene through its active camera.
    ///
    /// A cancelled rendering returns what there is, with `complete` false.
    ///
    /// # Errors
    /// A degenerate camera, or a crop outside the picture.
    pub fn render(&self, settings: &RenderSettings, progress: &dyn Progress) -> Result<Film> {
        self.render_tiles(settings, progress, &|_| ())
    }

    /// [`render`](Self::render), with each tile shown to `finished` once it is, on the thread that rendered it.
    ///
    /// # Errors
    /// As `render`.
    pub fn render_tiles(
        &self,
        settings: &RenderSettings,
        progress: &dyn Progress,
        finished: &(dyn Fn(&Tile) + Sync),
    ) -> Result<Film> {
        with_structure!(&self.intersect, structure => {
            ray_tracing(&self.scene, structure.world(), structure, settings, progress, finished)
        })
    }

    /// Tells how one pixel of the picture gets its colour: column and row from the top left.
    ///
    /// # Errors
    /// A pixel outside the picture, a sample that it does not have, more than [`explain::MOST_RECORDS`] to tell, a degenerate
    /// camera, or a cancellation.
    pub fn explain(&self, x: u32, y: u32, samples: Samples, progress: &dyn Progress) -> Result<Explanation> {
        with_structure!(&self.intersect, structure => {
            explain::explain(&self.scene, structure.world(), structure, (x, y), samples, progress)
        })
    }

    /// The kind of the structures.
    pub fn kind(&self) -> Kind {
        self.intersect.kind()
    }

    /// What building took.
    pub fn build_stats(&self) -> &BuildStats {
        &self.stats
    }

    /// Checks every tree: each node's box contains its children's, every triangle is in exactly one leaf.
    ///
    /// # Errors
    /// Says what is wrong with the first tree that is.
    pub fn validate(&self) -> std::result::Result<(), String> {
        with_structure!(&self.intersect, structure => structure.validate())
    }
}

/// What the call graph of [`render`](crate::render) needs, so that single rays can be traced and shaded outside of a
/// picture: `Tracer::new(renderer.scene(), renderer.world(), &renderer)`.
impl Intersect for Renderer {
    fn closest(&self, ray: &Ray) -> Hit {
        Self::closest(self, ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        Self::occluded(self, ray)
    }

    fn occluded_by_opaque(&self, ray: &Ray) -> bool {
        with_structure!(&self.intersect, structure => structure.occluded_by_opaque(ray))
    }

    fn next_after(&self, ray: &Ray, key: Key) -> Hit {
        Self::next_after(self, ray, key)
    }

    fn closest_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        Self::closest_batch(self, rays, hits);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        Self::occluded_batch(self, rays, occluded);
    }

    fn occluded_by_opaque_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        with_structure!(&self.intersect, structure => structure.occluded_by_opaque_batch(rays, occluded));
    }

    fn next_transmissive_after(&self, ray: &Ray, key: Key) -> Hit {
        with_structure!(&self.intersect, structure => structure.next_transmissive_after(ray, key))
    }
}
