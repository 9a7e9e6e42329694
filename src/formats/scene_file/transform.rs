//! `transform` and `instances`: where objects stand.

use std::path::Path;

use glam::{DAffine3, DMat3, DVec3};
use toml::de::DeTable;

use crate::error::Result;
use crate::formats::scene_file::value::{Fields, Source, Value};
use crate::math::Transform;
use crate::math::transform::{compose, rotation_about, rotation_xyz};
use crate::math::vector::normalize;

/// A step, or a list of steps in the order in which they are applied.
pub fn read_transform(value: &Value<'_>) -> Result<DAffine3> {
    let steps = if value.is_list() { value.list()? } else { vec![*value] };
    let mut transform = DAffine3::IDENTITY;
    for step in &steps {
        transform = compose(&read_step(step)?, &transform);
    }
    Transform::new(transform).map_err(|error| value.error(error.message()).remedy("scales must not be 0"))?;
    Ok(transform)
}

fn read_step(value: &Value<'_>) -> Result<DAffine3> {
    const KEYS: [&str; 4] = ["translate", "rotate", "scale", "matrix"];
    let fields = value.table("a transform step")?;
    fields.accept(&KEYS)?;
    let given: Vec<_> = KEYS.iter().filter_map(|key| fields.get(key).map(|value| (*key, value))).collect();
    let [(key, value)] = given.as_slice() else {
        let message = "a transform step has one of `translate`, `rotate`, `scale`, `matrix`";
        return Err(fields.error(message).remedy("write several steps as a list: [{ ... }, { ... }]"));
    };
    match *key {
        "translate" => Ok(DAffine3::from_translation(value.vector()?)),
        "rotate" => Ok(DAffine3::from_mat3(read_rotation(value)?)),
        "scale" => {
            let factors = if value.is_list() { value.vector()? } else { DVec3::splat(value.number()?) };
            Ok(DAffine3::from_scale(factors))
        }
        _ => read_matrix(value),
    }
}

/// `[x, y, z]` in degrees about the fixed axes, or `{ axis, angle }`.
fn read_rotation(value: &Value<'_>) -> Result<DMat3> {
    if !value.is_table() {
        let degrees = value.vector()?;
        return Ok(rotation_xyz(DVec3::new(degrees.x.to_radians(), degrees.y.to_radians(), degrees.z.to_radians())));
    }
    let fields = value.table("a rotation")?;
    fields.accept(&["axis", "angle"])?;
    let axis = fields.require("axis")?.direction()?;
    let angle = fields.require("angle")?.number()?;
    Ok(rotation_about(normalize(axis).unwrap_or(DVec3::Y), angle.to_radians()))
}

/// 16 numbers, column by column; the last row must be that of an affine map.
fn read_matrix(value: &Value<'_>) -> Result<DAffine3> {
    let m: [f64; 16] = value.numbers()?;
    if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
        let error = value.error("the matrix is not affine: its last row must be 0, 0, 0, 1");
        return Err(error.remedy("numbers are column by column, so that the translation is numbers 13 to 15"));
    }
    let column = |c: usize| DVec3::new(m[4 * c], m[4 * c + 1], m[4 * c + 2]);
    Ok(DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) })
}

/// The map that a text says of the form `transform = ...`.
///
/// # Errors
/// The first mistake, with its line and column.
pub fn parse_transform(text: &str) -> Result<DAffine3> {
    let source = Source { path: Path::new("transform"), text };
    let table = DeTable::parse(text).map_err(|cause| source.error(0, cause.message()))?;
    read_transform(&Fields::root(&source, table.get_ref()).require("transform")?)
}
