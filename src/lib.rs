//! A Whitted ray tracer for large triangle scenes: OBJ and glTF models, analytic quadrics, watertight hits.
//!
//! ```no_run
//! use whitted::accel::Params;
//! use whitted::formats::{LoadOptions, open, picture};
//! use whitted::progress::Silent;
//! use whitted::render::{RenderSettings, Renderer};
//!
//! # fn main() -> whitted::Result<()> {
//! let loaded = open("model.glb".as_ref(), &LoadOptions::default(), &Silent)?;
//! let renderer = Renderer::build(loaded.scene, &Params::default(), &Silent)?;
//! let film = renderer.render(&RenderSettings::default(), &Silent)?;
//! picture::save(&film, "model.png".as_ref())?;
//! # Ok(())
//! # }
//! ```
//!
//! # Goals
//!
//! - **Right without set-up**: a model alone becomes a good picture.
//! - **One answer**: hits and pictures are the same bytes for every accelerator, thread count, instruction set and
//!   machine. Nothing that decides a hit or a pixel is fused, reordered or left to a platform's `pow`.
//! - **Watertight**: no ray passes between triangles that share an edge, in the triangle test and in every tree.
//! - **Pay for what is used**: attributes that a model lacks are arrays that do not exist; scenes without transparency
//!   have yes-or-no shadow rays; a scene of one untransformed mesh has one level.
//!
//! # How it fits together
//!
//! ```text
//! formats (load) -> scene -> accel (build) -> render: intersect -> trace / shade -> film -> formats (picture)
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`mod@array`], [`math`], [`error`], [`progress`] | values in memory or in a mapped file; arithmetic with a fixed order of sums; one error type; progress and cancellation |
//! | [`geometry`] | rays, boxes, the triangle test, meshes, quadrics |
//! | [`scene`] | plain data: cameras, lights, materials, textures, objects |
//! | [`accel`] | structures over triangles, and the tree over instances |
//! | [`render`] | the seed's call graph: ray_tracing, trace, intersect, shade |
//! | [`formats`] | OBJ, glTF, scene files and built scenes in, pictures out |
//! | [`job`] | tiles that are kept, shared and merged |
//! | `measure` | exact answers, the hard cases, speed against error, the bench, behind the feature `measure` |
//! | `editor` | a scene edited by commands, and the window that shows it, behind the feature `editor` |
//! | `cli` | the command line, behind the feature `cli` |
//!
//! Imports go one way: `array, math, error, progress -> geometry -> {scene, accel} -> render -> formats -> job -> measure ->
//! editor -> cli`; a test reads the source and fails on a backward one. `scene` and `accel` do not know each other and meet in
//! [`render::intersect`]. Below `editor` nothing prints, reads arguments or exits.
//!
//! # Designs that were rejected
//!
//! - *obvhs's own traversal*: its box and triangle tests leak at shared vertices. It builds the trees; every test that
//!   decides a hit is ours.
//! - *An epsilon for spawned rays*: any fixed one is wrong for some scene. Rays start at a point solved again in f64,
//!   moved by a bound on the error of the test that they will meet ([`render::surface`]).
//! - *Shading in f32*: highlights amplify the error of the hit point by their exponent. What a pixel shows is computed
//!   from the unrounded ray in f64 and rounded once; f32 decides only what is hit.
//! - *Culling by the best t alone*: a computed t may lie before its triangle's box, and trees then disagree. Every t is
//!   clamped into its own box's interval first ([`geometry::triangle`]).
//! - *World-space f32 matrices for quadrics*: far from the origin the discriminant's sign is rounding noise. Quadrics
//!   are solved in f64 in object space.

pub mod accel;
pub mod array;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "editor")]
pub mod editor;
pub mod error;
pub mod formats;
pub mod geometry;
pub mod job;
pub mod manual;
pub mod math;
#[cfg(feature = "measure")]
pub mod measure;
pub mod progress;
pub mod render;
pub mod scene;

pub use error::{Error, Fault, Result};
/// The vectors of the public interface, in the version that it uses.
pub use glam;

/// The README's examples are compiled with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
