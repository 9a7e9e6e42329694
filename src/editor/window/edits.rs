//! What panels ask for: they read a session and never change it.

use eframe::egui;
use toml::Value;

use super::actions::Action;
use crate::editor::{Command, Item};

/// A change that is asked for.
#[derive(Debug)]
pub enum Ask {
    /// A step of its own.
    Do(Command),
    /// A step of a longer movement, such as dragging a number.
    Move(Command, u64),
    /// Selects an item alone, or, beside what is selected, no longer or too.
    Select(Item, bool),
    /// What menus do.
    Act(Action),
    /// Opens the dialog that chooses an image for a texture of a material or override.
    ChooseTexture(Item),
    /// Chooses the camera that is looked through.
    Camera(usize),
}

/// All that was asked for in a frame.
#[derive(Debug, Default)]
pub struct Edits {
    /// In order.
    pub list: Vec<Ask>,
}

impl Edits {
    /// A step of its own.
    pub fn apply(&mut self, command: Command) {
        self.list.push(Ask::Do(command));
    }

    /// What menus do.
    pub fn act(&mut self, action: Action) {
        self.list.push(Ask::Act(action));
    }

    /// A field that a widget has changed; what one drag changes is one step.
    pub fn set(&mut self, response: &egui::Response, item: Item, key: &[&str], value: impl Into<Value>) {
        self.list.push(Ask::Move(Command::set(item, key, value), response.id.value()));
    }

    /// A command of a widget that is being dragged.
    pub fn moving(&mut self, response: &egui::Response, command: Command) {
        self.list.push(Ask::Move(command, response.id.value()));
    }
}

/// The number that has the fewest digits among those that are this f32.
pub fn short(value: f32) -> f64 {
    let text = format!("{value:?}");
    text.parse().ok().filter(|&read: &f64| read as f32 == value).unwrap_or(f64::from(value))
}

/// A weight or colour as the scene file has it: one number for three that are the same.
pub fn weight(color: crate::scene::Rgb) -> Value {
    if color.x == color.y && color.y == color.z { Value::Float(short(color.x)) } else { self::color(color) }
}

/// A colour as the scene file has it.
pub fn color(color: crate::scene::Rgb) -> Value {
    Value::Array(color.to_array().map(|channel| Value::Float(short(channel))).to_vec())
}
