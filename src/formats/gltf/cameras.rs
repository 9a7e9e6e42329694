//! Cameras, placed by their nodes.

use std::collections::HashMap;

use ::gltf::json::Root;
use ::gltf::json::camera;
use ::gltf::json::validation::Checked;
use glam::DVec3;

use super::nodes::PlacedNode;
use crate::formats::{Ledger, Treatment};
use crate::math::vector::normalize;
use crate::scene::{Camera, NamedCamera, Projection};

/// The cameras read so far.
#[derive(Debug, Default)]
pub(super) struct Cameras {
    list: Vec<NamedCamera>,
    /// How often a name was wanted, made-up names included.
    wanted: HashMap<String, u64>,
}

impl Cameras {
    /// Adds the camera at a node, which looks along the node's -Z with +Y up. The node's scale plays no part.
    ///
    /// Its name is the file's, or "camera" and its number; names that come again get a count.
    pub fn add(&mut self, root: &Root, placed: &PlacedNode, ledger: &mut Ledger) {
        let Some(index) = placed.node.camera else { return };
        let source = &root.cameras[index.value()];
        let Some(camera) = placed_camera(source, placed) else {
            ledger.note(Treatment::Warning, "camera with an impossible view: left out", 1);
            return;
        };
        let name = source.name.clone().unwrap_or_else(|| format!("camera {}", index.value()));
        let name = self.unique(name);
        self.list.push(NamedCamera::new(name, camera));
    }

    /// All of them, in the order of their nodes.
    pub fn into_list(self) -> Vec<NamedCamera> {
        self.list
    }

    fn unique(&mut self, name: String) -> String {
        let count = self.wanted.entry(name.clone()).or_insert(0);
        *count += 1;
        if *count == 1 {
            return name;
        }
        let counted = format!("{name} ({count})");
        self.unique(counted)
    }
}

fn placed_camera(source: &camera::Camera, placed: &PlacedNode) -> Option<Camera> {
    let axes = &placed.to_world.matrix3;
    let eye = placed.to_world.translation;
    let (forward, up) = (normalize(-axes.z_axis)?, normalize(axes.y_axis)?);
    let camera = Camera::LookAt { eye, target: eye + forward, up, projection: projection(source)? };
    camera.rays(1, 1, DVec3::ZERO).is_ok().then_some(camera)
}

fn projection(source: &camera::Camera) -> Option<Projection> {
    match source.type_ {
        Checked::Valid(camera::Type::Perspective) => {
            Some(Projection::Perspective { fov_y: f64::from(source.perspective.as_ref()?.yfov) })
        }
        Checked::Valid(camera::Type::Orthographic) => {
            // `ymag` reaches from the middle to the upper edge.
            Some(Projection::Orthographic { height: 2.0 * f64::from(source.orthographic.as_ref()?.ymag).abs() })
        }
        Checked::Invalid => None,
    }
}
