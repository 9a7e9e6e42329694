//! The list of what is in the scene.

use eframe::egui::{self, Ui};

use super::edits::{Ask, Edits};
use crate::editor::{Command, Item, Kind, Session};

/// Shows the list. A click selects, with Ctrl or Shift beside what is selected; the box before an object hides and shows it.
pub fn show(ui: &mut Ui, session: &Session, edits: &mut Edits) {
    let lists =
        [(Kind::Object, "Objects"), (Kind::Light, "Lights"), (Kind::Material, "Materials"), (Kind::Camera, "Cameras")];
    egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
        for (kind, title) in lists {
            let count = session.document().count(kind);
            egui::CollapsingHeader::new(format!("{title} ({count})")).id_salt(title).default_open(true).show(
                ui,
                |ui| {
                    for index in 0..count {
                        entry(ui, session, edits, Item::new(kind, index));
                    }
                    if kind == Kind::Light && count == 0 && !session.scene().lights.is_empty() {
                        ui.weak(format!("{} of the model", session.scene().lights.len()));
                    }
                    if kind == Kind::Camera && count == 0 {
                        ui.weak("automatic");
                    }
                },
            );
        }
    });
}

/// What an item is called in lists.
pub fn title(session: &Session, item: Item) -> String {
    let name = session.document().string(item, "name").unwrap_or_default();
    if !name.is_empty() {
        return name;
    }
    let what = match item.kind {
        Kind::Object => super::shapes::shape_of(session.document(), item).unwrap_or("object"),
        Kind::Light => "light",
        kind => kind.key(),
    };
    format!("{} {}", what.replace('_', " "), item.index + 1)
}

fn entry(ui: &mut Ui, session: &Session, edits: &mut Edits, item: Item) {
    ui.horizontal(|ui| {
        if item.kind == Kind::Object {
            let is_visible = session.is_visible(item.index);
            let mut shown = is_visible;
            let about = if is_visible { "Hide" } else { "Show" };
            if ui.checkbox(&mut shown, "").on_hover_text(about).changed() {
                edits.apply(match is_visible {
                    true => Command::set(item, &["visible"], false),
                    false => Command::unset(item, &["visible"]),
                });
            }
        }
        let is_selected = session.selection().contains(&item);
        let label = ui.selectable_label(is_selected, title(session, item));
        if label.clicked() {
            let beside = ui.input(|input| input.modifiers.command || input.modifiers.shift);
            edits.list.push(Ask::Select(item, beside));
        }
        if item.kind == Kind::Camera {
            let is_active = session.scene().active_camera == item.index;
            if ui.radio(is_active, "").on_hover_text("Look through this camera").clicked() {
                edits.list.push(Ask::Camera(item.index));
            }
        }
    });
}
