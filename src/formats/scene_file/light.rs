//! `[[light]]`.

use glam::DVec3;

use crate::error::Result;
use crate::formats::scene_file::value::{Fields, Value};
use crate::scene::{Falloff, Light, LightKind, Rgb};

#[derive(Clone, Copy)]
enum Kind {
    Point,
    Directional,
    Spot,
}

/// A light; `name` is for one that gives none.
pub fn read_light(fields: &Fields<'_>, name: String) -> Result<Light> {
    let words = [("point", Kind::Point), ("directional", Kind::Directional), ("spot", Kind::Spot)];
    let kind = match fields.require("kind")?.choice(&words)? {
        Kind::Point => {
            fields.accept(&["name", "kind", "color", "intensity", "position", "falloff"])?;
            LightKind::Point { position: fields.require("position")?.vector()?, falloff: read_falloff(fields)? }
        }
        Kind::Directional => {
            fields.accept(&["name", "kind", "color", "intensity", "direction"])?;
            LightKind::Directional { direction: fields.require("direction")?.direction()? }
        }
        Kind::Spot => read_spot(fields)?,
    };
    let color = fields.or("color", Rgb::ONE, Value::color)?;
    let intensity = fields.or("intensity", 1.0, Value::non_negative)?;
    let color = color.to_array().map(|channel| (f64::from(channel) * intensity) as f32);
    if !color.iter().all(|channel| channel.is_finite()) {
        return Err(fields.error("`color` times `intensity` is too large"));
    }
    let name = fields.or("name", name, |value| value.name().map(str::to_owned))?;
    Ok(Light { name, kind, color: Rgb::from_array(color) })
}

fn read_spot(fields: &Fields<'_>) -> Result<LightKind> {
    let keys = ["name", "kind", "color", "intensity", "position", "direction", "target", "falloff", "inner_angle"];
    fields.accept(&[&keys[..], &["outer_angle"]].concat())?;
    let position = fields.require("position")?.vector()?;
    let direction = match (fields.get("direction"), fields.get("target")) {
        (Some(direction), None) => direction.direction()?,
        (None, Some(target)) => {
            let direction = target.vector()? - position;
            if direction == DVec3::ZERO {
                return Err(target.error("the spot's `target` is its `position`"));
            }
            direction
        }
        (None, None) => return Err(fields.error("a spot needs `direction` or `target`")),
        (Some(_), Some(target)) => {
            return Err(target.error("the spot has two directions").remedy("keep one of `direction`, `target`"));
        }
    };
    let outer = fields.or("outer_angle", 45.0, |value| value.between(0.0..=90.0))?;
    let inner = fields.or("inner_angle", 0.0, |value| {
        let degrees = value.between(0.0..=90.0)?;
        let ordered = degrees <= outer;
        ordered.then_some(degrees).ok_or_else(|| value.error("`inner_angle` must not exceed `outer_angle`"))
    })?;
    Ok(LightKind::Spot {
        position,
        direction,
        inner_angle: inner.to_radians(),
        outer_angle: outer.to_radians(),
        falloff: read_falloff(fields)?,
    })
}

fn read_falloff(fields: &Fields<'_>) -> Result<Falloff> {
    let words = [("none", Falloff::None), ("inverse_square", Falloff::InverseSquare)];
    fields.or("falloff", Falloff::None, |value| value.choice(&words))
}
