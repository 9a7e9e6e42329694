//! The ray tree of a pixel, to be opened branch by branch.

use eframe::egui::{self, Ui};
use serde_json::Value;

use crate::error::Result;
use crate::progress::Silent;
use crate::render::Renderer;
use crate::render::explain::Samples;

/// Why a pixel has its colour.
pub struct Tree {
    pixel: (u32, u32),
    value: Value,
}

impl Tree {
    /// Finds out why a pixel has its colour.
    ///
    /// # Errors
    /// As [`Renderer::explain`].
    pub fn new(renderer: &Renderer, pixel: (u32, u32)) -> Result<Self> {
        let explanation = renderer.explain(pixel.0, pixel.1, Samples::All, &Silent)?;
        let value = serde_json::to_value(&explanation);
        Ok(Self { pixel, value: value.unwrap_or_default() })
    }

    /// Shows it in a window of its own; false once that is closed.
    pub fn show(&self, ctx: &egui::Context) -> bool {
        let mut is_open = true;
        let title = format!("Pixel {}, {}", self.pixel.0, self.pixel.1);
        egui::Window::new(title)
            .id(egui::Id::unique("explanation"))
            .open(&mut is_open)
            .default_size([420.0, 480.0])
            .show(ctx, |ui| {
                egui::ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| branch(ui, &self.value, 0));
            });
        is_open
    }
}

/// The fields of a branch: plain ones in a line each, others to be opened. What matters most is open at first.
fn branch(ui: &mut Ui, value: &Value, depth: usize) {
    let entries: Vec<(String, &Value)> = match value {
        Value::Object(fields) => fields.iter().map(|(key, value)| (key.replace('_', " "), value)).collect(),
        Value::Array(items) => items.iter().enumerate().map(|(at, item)| (title(at, item), item)).collect(),
        _ => return,
    };
    for (name, value) in entries {
        match plain(value) {
            Some(text) => {
                ui.horizontal(|ui| {
                    ui.label(name);
                    ui.monospace(text);
                });
            }
            None => {
                let header = egui::CollapsingHeader::new(&name).id_salt((depth, &name)).default_open(depth < 3);
                header.show(ui, |ui| branch(ui, value, depth + 1));
            }
        }
    }
}

/// What an item of a list is called: by its name if it has one.
fn title(at: usize, item: &Value) -> String {
    let name = ["name", "light", "object", "kind"].iter().find_map(|key| item.get(key)?.as_str());
    name.map_or_else(|| format!("{}", at + 1), |name| format!("{}: {name}", at + 1))
}

/// A value that fits a line.
fn plain(value: &Value) -> Option<String> {
    match value {
        Value::Object(fields) if fields.is_empty() => Some("none".into()),
        Value::Object(_) => None,
        Value::Array(items) if items.is_empty() => Some("none".into()),
        Value::Array(items) if items.len() <= 3 && items.iter().all(Value::is_number) => {
            Some(items.iter().map(Value::to_string).collect::<Vec<_>>().join("  "))
        }
        Value::Array(_) => None,
        Value::String(text) => Some(text.clone()),
        Value::Null => Some("none".into()),
        other => Some(other.to_string()),
    }
}
