//! Fields of the panels: numbers, vectors, colours.

use eframe::egui::{self, Response, Ui};
use glam::DVec3;
use toml::Value;

use super::edits::{Edits, color, short, weight};
use crate::editor::Item;
use crate::editor::placement::vector;
use crate::scene::Rgb;
use crate::scene::Transfer;
use crate::scene::quantize::byte;
use crate::scene::texture::srgb_to_linear;

/// A labelled row of a panel's grid.
pub fn row<R>(ui: &mut Ui, label: &str, add: impl FnOnce(&mut Ui, egui::Id) -> R) -> R {
    let label = ui.label(label);
    let result = ui.horizontal(|ui| add(ui, label.id)).inner;
    ui.end_row();
    result
}

/// A panel's grid of labelled rows.
pub fn grid(ui: &mut Ui, name: impl std::hash::Hash + std::fmt::Debug, add: impl FnOnce(&mut Ui)) {
    egui::Grid::new(name).num_columns(2).spacing([8.0, 4.0]).show(ui, add);
}

/// How fast a number changes when it is dragged: in proportion to itself, but not slower than the least.
fn speed(value: f64, least: f64) -> f64 {
    (value.abs() * 0.01).max(least)
}

fn drag(value: &mut f64, least_speed: f64, range: std::ops::RangeInclusive<f64>) -> egui::DragValue<'_> {
    let speed = speed(*value, least_speed);
    egui::DragValue::new(value).speed(speed).range(range).update_while_editing(false).max_decimals(6)
}

/// A number of a scene file's field.
#[derive(Debug, Clone, Copy)]
pub struct Number {
    /// What it is now.
    pub value: f64,
    /// Dragged by a point, it changes by this or by a hundredth of itself.
    pub speed: f64,
    /// The least.
    pub min: f64,
    /// The most.
    pub max: f64,
}

impl Number {
    /// Any number.
    pub fn any(value: f64) -> Self {
        Self { value, speed: 0.01, min: f64::NEG_INFINITY, max: f64::INFINITY }
    }

    /// Greater than 0.
    pub fn positive(value: f64) -> Self {
        Self { min: 1e-9, ..Self::any(value) }
    }

    /// Between two numbers.
    pub fn between(value: f64, min: f64, max: f64) -> Self {
        Self { value, speed: 0.005 * (max - min).min(2.0), min, max }
    }

    /// Shows it; changes become edits.
    pub fn show(self, ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str]) -> Response {
        let mut value = self.value;
        row(ui, label, |ui, id| {
            let response = ui.add(drag(&mut value, self.speed, self.min..=self.max)).labelled_by(id);
            if response.changed() && value != self.value {
                edits.set(&response, item, key, value);
            }
            response
        })
    }
}

/// A whole number of a scene file's field.
pub fn whole(
    ui: &mut Ui,
    edits: &mut Edits,
    label: &str,
    item: Item,
    key: &[&str],
    value: u32,
    range: std::ops::RangeInclusive<u32>,
) {
    row(ui, label, |ui, id| {
        let mut new = value;
        let drag = egui::DragValue::new(&mut new).range(range).update_while_editing(false);
        let response = ui.add(drag).labelled_by(id);
        if response.changed() && new != value {
            edits.set(&response, item, key, i64::from(new));
        }
    });
}

/// Three numbers, changed by `set`.
pub fn three(ui: &mut Ui, label: &str, value: DVec3, least_speed: f64, mut set: impl FnMut(&Response, DVec3)) {
    row(ui, label, |ui, id| {
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let mut new = value;
            let drag = drag(&mut new[axis], least_speed, f64::NEG_INFINITY..=f64::INFINITY).prefix(format!("{name} "));
            let response = ui.add_sized([62.0, ui.spacing().interact_size.y], drag).labelled_by(id);
            if response.changed() && new != value {
                set(&response, new);
            }
        }
    });
}

/// A point or vector of a scene file's field.
pub fn point(ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str], value: DVec3) {
    three(ui, label, value, 0.01, |response, new| edits.set(response, item, key, vector(new)));
}

/// Yes or no.
pub fn flag(ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str], value: bool) {
    row(ui, label, |ui, id| {
        let mut new = value;
        if ui.checkbox(&mut new, "").labelled_by(id).changed() {
            edits.apply(crate::editor::Command::set(item, key, new));
        }
    });
}

/// A colour of up to any brightness: a button with the colour, and how bright it is.
pub fn colored(ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str], value: Rgb) {
    show_color(ui, label, value, |response, new| edits.set(response, item, key, color(new)));
}

/// A weight of the shading formula: a colour or one number.
pub fn weighted(ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str], value: Rgb) {
    row(ui, label, |ui, id| {
        let mut level = f64::from(value.max_element());
        let response = ui.add(drag(&mut level, 0.005, 0.0..=1e6)).labelled_by(id);
        if response.changed() {
            edits.set(&response, item, key, weight(scaled(value, level as f32)));
        }
        color_button(ui, value, |response, new| edits.set(response, item, key, weight(new)));
    });
}

/// The colour with another largest channel.
fn scaled(value: Rgb, largest: f32) -> Rgb {
    let before = value.max_element();
    if before > 0.0 {
        Rgb::from_array(value.to_array().map(|channel| short(tidied(channel / before * largest)) as f32))
    } else {
        Rgb::splat(largest)
    }
}

/// With at most six digits.
fn tidied(value: f32) -> f32 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

fn show_color(ui: &mut Ui, label: &str, value: Rgb, mut set: impl FnMut(&Response, Rgb)) {
    row(ui, label, |ui, id| {
        let mut level = f64::from(value.max_element());
        color_button(ui, value, &mut set);
        let response = ui.add(drag(&mut level, 0.005, 0.0..=1e9)).labelled_by(id);
        if response.changed() {
            set(&response, scaled(value, level as f32));
        }
    });
}

/// A button in a colour's hue that opens a picker; what is brighter than 1 keeps its brightness.
fn color_button(ui: &mut Ui, value: Rgb, mut set: impl FnMut(&Response, Rgb)) {
    let largest = value.max_element().max(1.0);
    let mut bytes = value.to_array().map(|channel| byte(channel / largest, Transfer::Srgb));
    let before = bytes;
    let response = ui.color_edit_button_srgb(&mut bytes);
    if bytes != before {
        let linear = bytes.map(|byte| tidied(srgb_to_linear(f64::from(byte) / 255.0) as f32) * largest);
        set(&response, Rgb::from_array(linear));
    }
}

/// One of some words.
pub fn choice(ui: &mut Ui, edits: &mut Edits, label: &str, item: Item, key: &[&str], value: &str, words: &[&str]) {
    row(ui, label, |ui, _| {
        egui::ComboBox::from_id_salt((label, item)).selected_text(value.replace('_', " ")).show_ui(ui, |ui| {
            for word in words {
                if ui.selectable_label(*word == value, word.replace('_', " ")).clicked() && *word != value {
                    edits.apply(crate::editor::Command::set(item, key, Value::from(*word)));
                }
            }
        });
    });
}
