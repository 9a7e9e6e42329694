//! KHR_lights_punctual: lights in candela and lux.

use ::gltf::json::Root;
use ::gltf::json::extensions::scene::khr_lights_punctual::Type;
use ::gltf::json::validation::Checked;

use super::nodes::PlacedNode;
use crate::formats::{Ledger, Treatment};
use crate::math::vector::normalize;
use crate::scene::{Falloff, Light, LightKind, Rgb};

/// The light at a node, which shines along the node's -Z.
pub(super) fn read(root: &Root, placed: &PlacedNode, ledger: &mut Ledger) -> Option<Light> {
    let index = placed.node.extensions.as_ref()?.khr_lights_punctual.as_ref()?.light;
    let light = root.get(index)?;
    let position = placed.to_world.translation;
    let direction = normalize(-placed.to_world.matrix3.z_axis);
    let falloff = Falloff::InverseSquare;
    let kind = match (light.type_, direction) {
        (Checked::Valid(Type::Point), _) => Some(LightKind::Point { position, falloff }),
        (Checked::Valid(Type::Directional), Some(direction)) => Some(LightKind::Directional { direction }),
        (Checked::Valid(Type::Spot), Some(direction)) => {
            let spot = light.spot.clone().unwrap_or_default();
            let outer_angle = f64::from(spot.outer_cone_angle).clamp(0.0, std::f64::consts::FRAC_PI_2);
            let inner_angle = f64::from(spot.inner_cone_angle).clamp(0.0, outer_angle);
            Some(LightKind::Spot { position, direction, inner_angle, outer_angle, falloff })
        }
        _ => None,
    };
    let color = Rgb::from_array(light.color) * light.intensity;
    let Some(kind) = kind.filter(|_| position.is_finite() && color.is_finite()) else {
        ledger.note(Treatment::Warning, "light without a direction, or with numbers out of range: left out", 1);
        return None;
    };
    if light.range.is_some() {
        ledger.note(Treatment::Ignored, "range of a light", 1);
    }
    let name = light.name.clone().unwrap_or_else(|| format!("light {}", index.value()));
    Some(Light { name, kind, color })
}
