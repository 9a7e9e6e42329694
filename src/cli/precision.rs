//! `--precision`: in what rays are traced.

use super::build::Plan;
use crate::error::Result;
use crate::measure::reference::ReferenceRenderer;
use crate::progress::Progress;
use crate::render::{BuildStats, Film, RenderSettings, Renderer, Tile};
use crate::scene::{Camera, Light, Scene};

/// In what rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// f32 rays through the acceleration structures.
    F32,
    /// f64 rays with exact hits.
    F64,
}

impl Precision {
    /// All of them with their names.
    pub const NAMES: [(&'static str, Self); 2] = [("f32", Self::F32), ("f64", Self::F64)];
}

/// A scene ready to be rendered in either.
pub enum AnyRenderer {
    /// In f32.
    F32(Box<Renderer>),
    /// In f64.
    F64(Box<ReferenceRenderer>),
}

impl AnyRenderer {
    /// Builds what the precision needs; the plan is for f32 alone.
    pub fn build(scene: Scene, precision: Precision, plan: &Plan<'_>, progress: &dyn Progress) -> Result<Self> {
        Ok(match precision {
            Precision::F32 => Self::F32(Box::new(plan.renderer(scene, progress)?)),
            Precision::F64 => Self::F64(Box::new(ReferenceRenderer::build(scene, progress)?)),
        })
    }

    /// Renders the scene; each tile is shown to `finished` once it is.
    pub fn render_tiles(
        &self,
        settings: &RenderSettings,
        progress: &dyn Progress,
        finished: &(dyn Fn(&Tile) + Sync),
    ) -> Result<Film> {
        match self {
            Self::F32(renderer) => renderer.render_tiles(settings, progress, finished),
            Self::F64(renderer) => renderer.render_tiles(settings, progress, finished),
        }
    }

    /// Puts another camera in the place of the active one.
    pub fn look_through(&mut self, camera: Camera) {
        match self {
            Self::F32(renderer) => renderer.look_through(camera),
            Self::F64(renderer) => renderer.look_through(camera),
        }
    }

    /// Puts other lights in the place of the scene's.
    pub fn set_lights(&mut self, lights: Vec<Light>) -> Result<()> {
        match self {
            Self::F32(renderer) => renderer.set_lights(lights),
            Self::F64(renderer) => renderer.set_lights(lights),
        }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        match self {
            Self::F32(renderer) => renderer.scene(),
            Self::F64(renderer) => renderer.scene(),
        }
    }

    /// What building took.
    pub fn build_stats(&self) -> &BuildStats {
        match self {
            Self::F32(renderer) => renderer.build_stats(),
            Self::F64(renderer) => renderer.build_stats(),
        }
    }
}
