//! The public face: a scene built once, asked for hits and pictures.

use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Hit, Key, Ray};
use crate::progress::Progress;
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::scene::Scene;

/// A scene with its acceleration structures.
#[derive(Debug)]
pub struct Renderer {
    scene: Scene,
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

impl Renderer {
    /// Builds the acceleration structures of a scene.
    ///
    /// # Errors
    /// A singular transform, a degenerate camera or light, or a cancellation.
    pub fn build(scene: Scene, params: &Params, progress: &dyn Progress) -> Result<Self> {
        let _ = (params, progress);
        Ok(Self { scene })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The closest hit: the first in the order of [`Key`]. Rays are relative to the scene's origin.
    pub fn closest(&self, _ray: &Ray) -> Hit {
        todo!()
    }

    /// Whether anything is hit, whatever its material.
    pub fn occluded(&self, _ray: &Ray) -> bool {
        todo!()
    }

    /// The first hit after `key`.
    pub fn next_after(&self, _ray: &Ray, _key: Key) -> Hit {
        todo!()
    }

    /// [`closest`](Self::closest) for every ray of a slice; `hits` has the same length.
    pub fn closest_batch(&self, _rays: &[Ray], _hits: &mut [Hit]) {
        todo!()
    }

    /// [`occluded`](Self::occluded) for every ray of a slice; `occluded` has the same length.
    pub fn occluded_batch(&self, _rays: &[Ray], _occluded: &mut [bool]) {
        todo!()
    }

    /// Renders the scene through its active camera.
    ///
    /// A cancelled rendering returns what there is, with `complete` false.
    ///
    /// # Errors
    /// A degenerate camera, or a crop outside the picture.
    pub fn render(&self, _settings: &RenderSettings, _progress: &dyn Progress) -> Result<Film> {
        todo!()
    }

    /// What building took.
    pub fn build_stats(&self) -> &BuildStats {
        todo!()
    }

    /// Checks every tree: each node's box contains its children's, every triangle is in exactly one leaf.
    ///
    /// # Errors
    /// Says what is wrong with the first tree that is.
    pub fn validate(&self) -> std::result::Result<(), String> {
        todo!()
    }
}
