//! `[[object]]`: a shape, its material, and where it stands, once or several times.

use glam::DAffine3;

use crate::error::Result;
use crate::formats::model::Contents;
use crate::formats::scene_file::read::Reader;
use crate::formats::scene_file::shape::{SHAPES, read_quadric};
use crate::formats::scene_file::transform::read_transform;
use crate::formats::scene_file::value::{Fields, Value};
use crate::formats::{LoadOptions, NormalMode, UpAxis};
use crate::math::transform::compose;
use crate::scene::{Object, Shape};

/// Reads an object and adds it to the reader's scene; `number` counts from 1 and names objects without a name.
pub fn read_object(fields: &Fields<'_>, number: usize, reader: &mut Reader<'_>) -> Result<()> {
    let given: Vec<_> = SHAPES.iter().filter_map(|key| fields.get(key).map(|value| (*key, value))).collect();
    let (key, shape) = match given.as_slice() {
        [one] => *one,
        [] => {
            // An unknown key may be a misspelt shape: it is reported first.
            fields.accept(&[&SHAPES[..], &MESH_FIELDS[..]].concat())?;
            let shapes = SHAPES.map(|key| format!("`{key}`")).join(", ");
            return Err(fields.error("an object needs a shape").remedy(format!("one of {shapes}")));
        }
        [_, (second, value), ..] => {
            let message = format!("the object has a second shape, `{second}`");
            return Err(value.error(message).remedy("write it as an [[object]] of its own"));
        }
    };
    let name = fields.get("name").map(|value| reader.claim_name("object", &value)).transpose()?;
    let material = fields.get("material").map(|value| reader.material(&value)).transpose()?;
    let places = read_places(fields, &shape)?;
    let is_visible = fields.or("visible", true, Value::boolean)?;
    let is_builtin = key == "builtin";
    let contents = if is_builtin || key == "mesh" {
        fields.accept(&[&[key], &MESH_FIELDS[..]].concat())?;
        let options = read_load_options(fields, reader.options())?;
        let mut contents = reader.model(&shape, is_builtin, &options)?;
        for object in &mut contents.objects {
            object.name = joined_name(name, &object.name);
            object.material = material.or(object.material);
        }
        contents
    } else {
        fields.accept(&[&[key], &QUADRIC_FIELDS[..]].concat())?;
        let (quadric, transform) = read_quadric(key, &shape)?;
        let name = name.map_or_else(|| format!("{key} {number}"), str::to_owned);
        let shape = Shape::Quadric(reader.add_quadric(quadric));
        // Quadrics have no material of their own; the first of a scene is the neutral one.
        let object = Object { name, shape, transform, material: material.or(Some(0)) };
        Contents { objects: vec![object], ..Default::default() }
    };
    reader.check_extent(&contents.objects, &format!("the shape `{key}`"), &shape)?;
    for (index, (place, culprit)) in places.iter().enumerate() {
        let number = (places.len() > 1).then_some(index + 1);
        let placed = reader.placed(contents.clone(), place, number, culprit)?;
        if is_visible {
            reader.add(placed);
        }
    }
    Ok(())
}

/// What objects have beside a shape that is a quadric.
const QUADRIC_FIELDS: [&str; 5] = ["name", "material", "transform", "instances", "visible"];

/// What objects have beside `mesh` or `builtin`.
const MESH_FIELDS: [&str; 12] = [
    "name",
    "material",
    "transform",
    "instances",
    "visible",
    "normals",
    "up",
    "crease_angle",
    "scene",
    "time",
    "animation",
    "cull_back_faces",
];

/// The transform of every instance, first `transform`, then that of the instance, and the value that gave it: `shape`
/// where none did.
fn read_places<'a>(fields: &Fields<'a>, shape: &Value<'a>) -> Result<Vec<(DAffine3, Value<'a>)>> {
    let transform = fields.get("transform");
    let own = transform.as_ref().map_or(Ok(DAffine3::IDENTITY), read_transform)?;
    let Some(instances) = fields.get("instances") else { return Ok(vec![(own, transform.unwrap_or(*shape))]) };
    let list = instances.list()?;
    if list.is_empty() {
        return Err(instances.error("`instances` is empty").remedy("leave it out for a single object"));
    }
    list.into_iter().map(|instance| Ok((compose(&read_transform(&instance)?, &own), instance))).collect()
}

fn read_load_options(fields: &Fields<'_>, default: &LoadOptions) -> Result<LoadOptions> {
    let modes = [("file", NormalMode::File), ("flat", NormalMode::Flat), ("smooth", NormalMode::Smooth)];
    let axes = [("y", UpAxis::Y), ("z", UpAxis::Z)];
    let optional = |key, default: &Option<f64>, read: fn(&Value<'_>) -> Result<f64>| {
        fields.or(key, *default, |value: &Value<'_>| read(value).map(Some))
    };
    let optional_name = |key, default: &Option<String>| {
        fields.or(key, default.clone(), |value: &Value<'_>| value.name().map(|name| Some(name.to_owned())))
    };
    Ok(LoadOptions {
        normals: fields.or("normals", default.normals, |value: &Value<'_>| value.choice(&modes))?,
        up: fields.or("up", default.up, |value| value.choice(&axes))?,
        crease_angle: optional("crease_angle", &default.crease_angle, |value| {
            Ok(value.between(0.0..=180.0)?.to_radians())
        })?,
        scene: optional_name("scene", &default.scene)?,
        time: optional("time", &default.time, |value| value.number())?,
        animation: optional_name("animation", &default.animation)?,
        cull_back_faces: fields.or("cull_back_faces", default.cull_back_faces, Value::boolean)?,
        ..default.clone()
    })
}

/// An imported object's name under the name that the scene gives.
fn joined_name(given: Option<&str>, imported: &str) -> String {
    match (given, imported) {
        (None, imported) => imported.to_owned(),
        (Some(given), "") => given.to_owned(),
        (Some(given), imported) => format!("{given}/{imported}"),
    }
}
