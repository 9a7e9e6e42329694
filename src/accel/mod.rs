//! Acceleration structures: obvhs finds which boxes belong together; boxes, box test, triangle test and traversal are
//! ours, and every structure gives the same hits bit for bit.
//!
//! ```text
//! boxes -> Topology (ploc) -> PairTree -> Bvh2     (triangles of one mesh)
//!                          |          `-> BoxTree  (instances)
//!                          |-> CwBvh               (triangles of one mesh)
//!                          `-> Wide, Compact       (triangles of one mesh, SIMD chosen at run time)
//! ```
//!
//! Why trees cannot disagree: a hit's t lies within the interval in which the ray crosses the triangle's own box, and
//! [`Bounds::interval`](crate::geometry::Bounds::interval) is monotone, so every box around the triangle is entered no
//! later than t and left no earlier. A traversal that skips only what is entered after its best hit, or left before its
//! first admissible t, meets every hit that could win.
//!
//! To add a structure, write its file and add its line to [`for_each_accelerator!`](crate::for_each_accelerator).

mod box_tree;
mod budget;
mod bvh2;
mod cwbvh;
mod kept;
mod leaf;
mod linear;
mod pair_tree;
mod ploc;
mod stack;
mod stats;
#[cfg(test)]
mod tests;
mod topology;
mod triangle_tree;
pub(crate) mod wide;

pub use box_tree::BoxTree;
pub use bvh2::Bvh2;
pub use cwbvh::CwBvh;
pub use kept::{KeptTree, TreeArrays};
pub use linear::Linear;
pub use stats::{Tests, TreeStats};
/// For `measure`, which compares formulas within one and the same tree.
#[cfg(feature = "measure")]
pub(crate) use topology::{Node, Topology};
pub use wide::{Compact, Wide};

use std::sync::Arc;

use crate::error::Result;
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, Ray, TriangleMesh};
use crate::progress::Progress;

/// Calls the macro `$callback!` with `{ $arguments }` and then, per structure, `Type "name" "description";`.
///
/// This is the one list of structures: [`Kind`] and [`dispatch_kind!`](crate::dispatch_kind) are made from it.
#[macro_export]
macro_rules! for_each_accelerator {
    ($($callback:tt)::+ { $($arguments:tt)* }) => {
        $($callback)::+! {
            { $($arguments)* }
            Linear "linear" "Every triangle, no tree: the reference.";
            Bvh2 "bvh2" "Binary tree.";
            CwBvh "cwbvh" "Compressed 8-wide tree.";
            Wide "wide" "8-wide tree searched with SIMD: the fastest.";
            Compact "compact" "The same with leaves that refer to the mesh: the least memory.";
        }
    };
}

/// Evaluates an expression with a type name bound to the structure of a [`Kind`], `Auto` resolved.
///
/// ```
/// use whitted::accel::{Kind, TriangleAccelerator};
/// assert_eq!(whitted::dispatch_kind!(Kind::CwBvh, A => A::NAME), "cwbvh");
/// ```
#[macro_export]
macro_rules! dispatch_kind {
    ({ @list ($kind:expr) $accelerator:ident $body:block } $($name:ident $text:literal $description:literal;)+) => {
        match $crate::accel::Kind::resolve($kind) {
            $($crate::accel::Kind::$name => {
                type $accelerator = $crate::accel::$name;
                $body
            })+
            $crate::accel::Kind::Auto => unreachable!("resolve never returns Auto"),
        }
    };
    ($kind:expr, $accelerator:ident => $body:expr) => {
        $crate::for_each_accelerator!($crate::dispatch_kind { @list ($kind) $accelerator { $body } })
    };
}
pub use crate::dispatch_kind;

macro_rules! define_kind {
    ({} $($name:ident $text:literal $description:literal;)+) => {
        /// Which acceleration structure to use for triangles.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize)]
        #[serde(rename_all = "lowercase")]
        pub enum Kind {
            /// The fastest one.
            #[default]
            Auto,
            $(#[doc = $description] $name,)+
        }

        impl Kind {
            /// Every structure, without `Auto`; the reference comes first.
            pub const ALL: &[Self] = &[$(Self::$name),+];

            /// What the structure is called on the command line and in reports.
            pub fn name(self) -> &'static str {
                match self {
                    Self::Auto => "auto",
                    $(Self::$name => $text,)+
                }
            }

            /// One line about the structure.
            pub fn description(self) -> &'static str {
                match self {
                    Self::Auto => "The fastest one.",
                    $(Self::$name => $description,)+
                }
            }
        }
    };
}
for_each_accelerator!(define_kind {});

impl Kind {
    /// Whether the structure can be kept in a file.
    pub fn can_be_kept(self) -> bool {
        dispatch_kind!(self, A => <A as TriangleAccelerator>::CAN_BE_KEPT)
    }

    /// The structure itself: `Auto` becomes the one that measures fastest.
    pub fn resolve(self) -> Self {
        if self == Self::Auto { Self::Wide } else { self }
    }
}

/// How much time a build may take for faster rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Quickest build, slower rays.
    Fast,
    /// Between the two.
    #[default]
    Balanced,
    /// Slowest build, fastest rays.
    Best,
}

impl Preset {
    /// Every preset, quickest build first.
    pub const ALL: &[Self] = &[Self::Fast, Self::Balanced, Self::Best];
}

/// The most triangles that one thread builds a tree over; more are shared among all.
pub const ONE_THREAD: usize = 1 << 14;

/// How to build acceleration structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Params {
    /// Which structure.
    pub kind: Kind,
    /// How much time the build may take.
    pub preset: Preset,
}

/// A structure that tells what its searches compare rays with.
pub trait Counting: TriangleAccelerator {
    /// [`closest`](TriangleAccelerator::closest), or the search of [`occluded`](TriangleAccelerator::occluded), which puts the hit that ends it
    /// into `best`; and adds what that compares the ray with. The searches themselves do not count.
    fn count(&self, ray: &PreparedRay, any: bool, best: &mut Hit, tests: &mut Tests);
}

/// A bottom-level structure over one mesh's triangles that owns its leaf layout.
///
/// Callers are generic over it and match the [`Kind`] once per batch. All implementations return the same bits. Rays
/// are in the mesh's space; triangles that the mesh dropped are never hit; an empty mesh is valid.
pub trait TriangleAccelerator: Sized + Send + Sync {
    /// What the structure is called on the command line and in reports.
    const NAME: &'static str;

    /// Builds the structure over the mesh's live triangles, each of which is a step of `progress`. Structures that do not have
    /// copies of the triangles share the mesh.
    ///
    /// # Errors
    /// When `progress` says to stop.
    fn build(mesh: &Arc<TriangleMesh>, params: &Params, progress: &dyn Progress) -> Result<Self>;

    /// Replaces `best` by the ray's first hit in the order of [`Key`]s if that comes before it.
    ///
    /// `instance` is the number to put into hits.
    fn closest(&self, ray: &PreparedRay, instance: u32, best: &mut Hit);

    /// Whether the ray has any hit at all.
    fn occluded(&self, ray: &PreparedRay) -> bool;

    /// Replaces `best` by the ray's first hit strictly after `key` if that comes before it.
    fn next_after(&self, ray: &PreparedRay, instance: u32, key: Key, best: &mut Hit);

    /// The first hit of a ray in the structure's own space where that is the only object, number 0.
    #[inline(always)]
    fn closest_alone(&self, ray: &Ray) -> Hit {
        let mut best = Hit::MISS;
        if let Some(ray) = PreparedRay::new(ray) {
            self.closest(&ray, 0, &mut best);
        }
        best
    }

    /// Whether a ray in the structure's own space hits anything.
    #[inline(always)]
    fn occluded_alone(&self, ray: &Ray) -> bool {
        PreparedRay::new(ray).is_some_and(|ray| self.occluded(&ray))
    }

    /// [`closest`](Self::closest) for each ray and the hit at the same position. `clips` are the rays' clip intervals, or
    /// empty for rays in world space.
    ///
    /// # Panics
    /// If the slices have different lengths.
    fn closest_batch(&self, rays: &[Ray], clips: &[Interval], instance: u32, best: &mut [Hit]) {
        assert!(rays.len() == best.len() && (clips.is_empty() || clips.len() == rays.len()), "one of each a ray");
        for (at, (ray, best)) in rays.iter().zip(best).enumerate() {
            if let Some(ray) = PreparedRay::clipped(ray, clips.get(at)) {
                self.closest(&ray, instance, best);
            }
        }
    }

    /// Sets the flags of those rays that are [`occluded`](Self::occluded); as [`closest_batch`](Self::closest_batch). Rays
    /// whose flag is set already are left out.
    ///
    /// # Panics
    /// If the slices have different lengths.
    fn occluded_batch(&self, rays: &[Ray], clips: &[Interval], occluded: &mut [bool]) {
        assert!(rays.len() == occluded.len() && (clips.is_empty() || clips.len() == rays.len()), "one of each a ray");
        for (at, (ray, occluded)) in rays.iter().zip(occluded).enumerate().filter(|(_, (_, occluded))| !**occluded) {
            *occluded = PreparedRay::clipped(ray, clips.get(at)).is_some_and(|ray| self.occluded(&ray));
        }
    }

    /// Counts and sizes.
    fn stats(&self) -> TreeStats;

    /// Audits the structure: every node's box contains the boxes of its children and triangles exactly, as the
    /// traversal sees them, and every triangle is in exactly one leaf.
    ///
    /// # Errors
    /// A description of the first violation.
    fn validate(&self) -> std::result::Result<(), String>;

    /// The box around what rays meet of all triangles ([`TriangleMesh::hit_bounds`]), exact; empty for an empty mesh.
    fn bounds(&self) -> Bounds;

    /// Whether the structure can be kept in a file.
    const CAN_BE_KEPT: bool = false;

    /// The arrays to be kept; `None` where the structure [cannot be](Self::CAN_BE_KEPT).
    fn arrays(&self) -> Option<TreeArrays<'_>> {
        None
    }

    /// The structure whose arrays were kept, over the same mesh. All numbers that name nodes and triangles are checked, whoever wrote
    /// them; that boxes contain what is below them is not.
    ///
    /// # Errors
    /// Says what is wrong with them.
    fn restore(mesh: &Arc<TriangleMesh>, kept: &KeptTree) -> std::result::Result<Self, String> {
        let _ = (mesh, kept);
        Err(format!("the structure `{}` cannot be kept", Self::NAME))
    }
}
