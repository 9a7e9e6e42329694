//! The choices that a report compares: combinations of tests in one plain tree, and the renderer's own structures.

use std::time::Instant;

use crate::accel::{Kind, Params, Preset};
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::measure::variants::baldwin_weber::BaldwinWeber;
use crate::measure::variants::moller_trumbore::{MollerTrumbore, MollerTrumboreF64};
use crate::measure::variants::slab::{Ize, Padded, Plain};
use crate::measure::variants::tree::{Skeleton, VariantTree};
use crate::measure::variants::woop::{Kahan, Narrow, Published, Wide, Woop, WoopClamped};
use crate::measure::variants::{BoxTest, TriangleTest};
use crate::progress::{Progress, Silent};
use crate::render::Renderer;
use crate::scene::Scene;

/// Above this many triangles `linear` is left out: a ray would take a millisecond and more.
const MOST_LINEAR: usize = 1000;

/// Something that answers rays.
pub trait Answers: Sync {
    /// The closest hit of each ray; the slices have equal lengths.
    fn closest(&self, rays: &[Ray], hits: &mut [Hit]);

    /// Whether each ray hits anything; the slices have equal lengths.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);
}

impl<T: TriangleTest, B: BoxTest> Answers for VariantTree<'_, T, B> {
    fn closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = VariantTree::closest(self, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = VariantTree::occluded(self, ray);
        }
    }
}

impl Answers for Renderer {
    fn closest(&self, rays: &[Ray], hits: &mut [Hit]) {
        self.closest_batch(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_batch(rays, occluded);
    }
}

/// What a choice is made of.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Label {
    /// What it is called in tables and plots.
    pub name: String,
    /// The triangle test.
    pub triangle_test: &'static str,
    /// The box test.
    pub box_test: &'static str,
    /// The tree: `plain` for the one that all combinations of tests share, else the accelerator.
    pub accelerator: &'static str,
    /// How the tree was built.
    pub preset: Preset,
    /// Whether this is what the renderer does unless told otherwise.
    pub default: bool,
    /// Seconds that building took; the shared tree's own time is in each combination's.
    pub build_s: f64,
    /// Bytes of nodes and triangles for each triangle.
    pub bytes_per_triangle: f64,
}

/// A choice that can be asked.
pub struct Choice<'a> {
    /// What it is.
    pub label: Label,
    /// What answers.
    pub answers: Box<dyn Answers + 'a>,
}

/// Builds the plain tree that combinations share; the seconds that it took.
///
/// # Errors
/// A cancellation.
pub fn skeleton(scene: &Scene, progress: &dyn Progress) -> Result<(Skeleton, f64)> {
    let start = Instant::now();
    let skeleton = Skeleton::build(&scene.meshes[0], &Params::default(), progress)?;
    Ok((skeleton, start.elapsed().as_secs_f64()))
}

/// All choices over a scene of one untransformed mesh.
///
/// # Errors
/// A cancellation.
pub fn all<'a>(
    scene: &Scene,
    skeleton: &'a Skeleton,
    skeleton_seconds: f64,
    progress: &dyn Progress,
) -> Result<Vec<Choice<'a>>> {
    let triangles = scene.meshes[0].live_count();
    let mut choices = Vec::new();
    macro_rules! combine {
        ($($test:ty: $($box_test:ty),+;)+) => {$($(
            choices.push(combination::<$test, $box_test>(skeleton, skeleton_seconds, triangles));
        )+)+};
    }
    combine!(
        WoopClamped: Padded, Ize, Plain;
        Woop<Published>: Padded, Ize, Plain;
        Woop<Narrow>: Padded, Plain;
        Woop<Wide>: Padded, Plain;
        Woop<Kahan>: Padded, Plain;
        MollerTrumbore: Padded, Plain;
        BaldwinWeber: Padded, Plain;
        MollerTrumboreF64: Padded, Plain;
    );
    for &kind in Kind::ALL {
        let presets = match kind {
            Kind::Linear if triangles > MOST_LINEAR => continue,
            Kind::Linear => &[Preset::Balanced],
            _ => Preset::ALL,
        };
        for &preset in presets {
            progress.check()?;
            choices.push(structure(scene, Params { kind, preset }, triangles)?);
        }
    }
    Ok(choices)
}

fn combination<'a, T: TriangleTest + 'a, B: BoxTest + 'a>(
    skeleton: &'a Skeleton,
    skeleton_seconds: f64,
    triangles: usize,
) -> Choice<'a> {
    let start = Instant::now();
    let tree = VariantTree::<T, B>::new(skeleton);
    let label = Label {
        name: format!("{}, {} boxes", T::NAME, B::NAME),
        triangle_test: T::NAME,
        box_test: B::NAME,
        accelerator: "plain",
        preset: Preset::default(),
        default: false,
        build_s: skeleton_seconds + start.elapsed().as_secs_f64(),
        bytes_per_triangle: tree.bytes() as f64 / triangles as f64,
    };
    Choice { label, answers: Box::new(tree) }
}

fn structure(scene: &Scene, params: Params, triangles: usize) -> Result<Choice<'static>> {
    let renderer = Renderer::build(scene.clone(), &params, &Silent)?;
    let stats = renderer.build_stats();
    let preset = serde_json::to_value(params.preset).ok().and_then(|name| name.as_str().map(str::to_owned));
    let label = Label {
        name: format!("{} {}", params.kind.name(), preset.unwrap_or_default()),
        triangle_test: WoopClamped::NAME,
        box_test: Padded::NAME,
        accelerator: params.kind.name(),
        preset: params.preset,
        default: params.kind == Kind::Auto.resolve() && params.preset == Preset::default(),
        build_s: stats.seconds,
        bytes_per_triangle: (stats.node_bytes + stats.leaf_bytes) as f64 / triangles as f64,
    };
    Ok(Choice { label, answers: Box::new(renderer) })
}
