//! The fields of the shapes, by which objects are edited.

use eframe::egui::Ui;
use glam::DVec3;
use toml::Value;

use super::edits::Edits;
use super::widgets::{Number, flag, point, row};
use crate::editor::document::Document;
use crate::editor::placement::{number, read_vector};
use crate::editor::{Command, Item};

/// What a field of a shape is, and what it is unless given.
enum Field {
    Point([f64; 3]),
    Positive(f64),
    Any(f64),
    Flag,
    /// A number greater than 0, or none.
    Optional(f64),
    Coefficients,
    Clip,
}

/// The shapes and their fields, as the scene format has them.
const SHAPES: &[(&str, &[(&str, Field)])] = &[
    ("sphere", &[("center", Field::Point([0.0; 3])), ("radius", Field::Positive(1.0))]),
    ("ellipsoid", &[("center", Field::Point([0.0; 3])), ("radii", Field::Point([1.0; 3]))]),
    (
        "cylinder",
        &[
            ("base", Field::Point([0.0; 3])),
            ("top", Field::Point([0.0, 1.0, 0.0])),
            ("radius", Field::Positive(1.0)),
            ("open", Field::Flag),
        ],
    ),
    (
        "cone",
        &[
            ("base", Field::Point([0.0; 3])),
            ("apex", Field::Point([0.0, 1.0, 0.0])),
            ("radius", Field::Positive(1.0)),
            ("open", Field::Flag),
        ],
    ),
    (
        "paraboloid",
        &[
            ("apex", Field::Point([0.0; 3])),
            ("base", Field::Point([0.0, 1.0, 0.0])),
            ("radius", Field::Positive(1.0)),
            ("open", Field::Flag),
        ],
    ),
    (
        "hyperboloid_one_sheet",
        &[
            ("center", Field::Point([0.0; 3])),
            ("axis", Field::Point([0.0, 1.0, 0.0])),
            ("radius", Field::Positive(1.0)),
            ("height", Field::Positive(1.0)),
            ("from", Field::Any(-1.0)),
            ("to", Field::Any(1.0)),
            ("open", Field::Flag),
        ],
    ),
    (
        "hyperboloid_two_sheets",
        &[
            ("center", Field::Point([0.0; 3])),
            ("axis", Field::Point([0.0, 1.0, 0.0])),
            ("radius", Field::Positive(1.0)),
            ("height", Field::Positive(1.0)),
            ("limit", Field::Optional(2.0)),
            ("open", Field::Flag),
        ],
    ),
    ("saddle", &[("center", Field::Point([0.0; 3])), ("half_size", Field::Positive(1.0))]),
    (
        "plane",
        &[
            ("point", Field::Point([0.0; 3])),
            ("normal", Field::Point([0.0, 1.0, 0.0])),
            ("size", Field::Optional(10.0)),
        ],
    ),
    ("quadric", &[("coefficients", Field::Coefficients), ("clip", Field::Clip), ("solid", Field::Flag)]),
    ("mesh", &[]),
    ("builtin", &[]),
];

/// The key of an object's shape.
pub fn shape_of(document: &Document, object: Item) -> Option<&'static str> {
    let fields = document.fields(object)?;
    SHAPES.iter().map(|(key, _)| *key).find(|key| fields.contains_key(key))
}

/// The fields of an object's shape.
pub fn show(ui: &mut Ui, document: &Document, object: Item, edits: &mut Edits) {
    let Some(shape) = shape_of(document, object) else { return };
    if let Some(file) = document.string(object, shape) {
        row(ui, if shape == "mesh" { "file" } else { "mesh" }, |ui, _| ui.label(file));
        return;
    }
    let fields = SHAPES.iter().find(|(key, _)| *key == shape).map_or(&[][..], |(_, fields)| fields);
    for (name, field) in fields {
        let key = [shape, name];
        let value = document.value(object, &key);
        let label = name.replace('_', " ");
        let given = value.as_ref().and_then(number);
        match field {
            Field::Point(default) => {
                let value = value.as_ref().and_then(read_vector).unwrap_or(DVec3::from_array(*default));
                point(ui, edits, &label, object, &key, value);
            }
            Field::Positive(default) => {
                Number::positive(given.unwrap_or(*default)).show(ui, edits, &label, object, &key);
            }
            Field::Any(default) => {
                Number::any(given.unwrap_or(*default)).show(ui, edits, &label, object, &key);
            }
            Field::Flag => flag(ui, edits, &label, object, &key, value == Some(Value::Boolean(true))),
            Field::Optional(default) => {
                row(ui, &label, |ui, id| {
                    let mut is_given = given.is_some();
                    if ui.checkbox(&mut is_given, "limited").labelled_by(id).changed() {
                        edits.apply(match is_given {
                            true => Command::set(object, &key, *default),
                            false => Command::unset(object, &key),
                        });
                    }
                });
                if let Some(value) = given {
                    Number::positive(value).show(ui, edits, "", object, &key);
                }
            }
            Field::Coefficients => coefficients(ui, value.as_ref(), object, edits),
            Field::Clip => {
                for (end, infinite) in [("min", f64::NEG_INFINITY), ("max", f64::INFINITY)] {
                    let key = [shape, name, end];
                    let value = document.value(object, &key).as_ref().and_then(read_vector);
                    let value = value.unwrap_or(DVec3::splat(infinite));
                    point(ui, edits, &format!("clip {end}"), object, &key, value);
                }
            }
        }
    }
}

/// The ten numbers of a general quadric, with the terms that they belong to.
fn coefficients(ui: &mut Ui, value: Option<&Value>, object: Item, edits: &mut Edits) {
    const TERMS: [&str; 10] = ["x²", "y²", "z²", "2xy", "2yz", "2xz", "2x", "2y", "2z", "1"];
    let Some(Value::Array(numbers)) = value else {
        row(ui, "matrix", |ui, _| ui.label("16 numbers in the scene file"));
        return;
    };
    let before: Vec<f64> = numbers.iter().filter_map(number).collect();
    for (at, term) in TERMS.iter().enumerate().take(before.len()) {
        row(ui, term, |ui, id| {
            let mut new = before.clone();
            let drag = eframe::egui::DragValue::new(&mut new[at]).speed(0.01).update_while_editing(false);
            let response = ui.add(drag).labelled_by(id);
            if response.changed() && new != before {
                let value = Value::Array(new.into_iter().map(Value::Float).collect());
                edits.set(&response, object, &["quadric", "coefficients"], value);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_of_the_scene_format_has_fields_here() {
        for shape in crate::formats::scene_file::SHAPES {
            assert!(SHAPES.iter().any(|(key, _)| *key == shape), "{shape}");
        }
    }
}
