//! Cameras, placed by their nodes.

use ::gltf::json::Root;
use ::gltf::json::camera;
use ::gltf::json::validation::Checked;
use glam::DVec3;

use super::nodes::PlacedNode;
use crate::formats::{Ledger, Treatment};
use crate::math::vector::normalize;
use crate::scene::{Camera, NamedCamera, Projection};

/// The camera at a node, which looks along the node's -Z with +Y up. The node's scale plays no part.
///
/// Its name is the file's, or "camera" and its number; a name that `taken` has gets a number too.
pub(super) fn read(
    root: &Root,
    placed: &PlacedNode,
    taken: &[NamedCamera],
    ledger: &mut Ledger,
) -> Option<NamedCamera> {
    let index = placed.node.camera?;
    let source = root.cameras.get(index.value())?;
    let axes = &placed.to_world.matrix3;
    let eye = placed.to_world.translation;
    let camera = projection(source).and_then(|projection| {
        let (forward, up) = (normalize(-axes.z_axis)?, normalize(axes.y_axis)?);
        let camera = Camera::LookAt { eye, target: eye + forward, up, projection };
        camera.rays(1, 1, DVec3::ZERO).is_ok().then_some(camera)
    });
    let Some(camera) = camera else {
        ledger.note(Treatment::Warning, "camera with an impossible view: left out", 1);
        return None;
    };
    let name = source.name.clone().unwrap_or_else(|| format!("camera {}", index.value()));
    let is_free = |name: &String| taken.iter().all(|other| other.name != *name);
    let name = if is_free(&name) { name } else { (2u64..).map(|copy| format!("{name} ({copy})")).find(is_free)? };
    Some(NamedCamera { name, camera })
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
