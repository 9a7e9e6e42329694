//! The menu bar, the toolbar, the status bar and the windows of Help.

use eframe::egui::{self, Context, Ui};

use super::Editor;
use super::actions::{Action, ENTRIES, Entry, Menu, NewLight, NewObject};
use super::canvas::is_of_use;
use super::edits::Edits;

/// The menu bar.
pub fn bar(ui: &mut Ui, editor: &mut Editor, edits: &mut Edits) {
    let mut recent = None;
    egui::MenuBar::new().ui(ui, |ui| {
        for (menu, title) in Menu::ALL {
            ui.menu_button(title, |ui| {
                if menu == Menu::Add {
                    add_menu(ui, edits);
                }
                for entry in ENTRIES.iter().filter(|entry| entry.menu == menu) {
                    item(ui, editor, entry, edits);
                    if entry.action == Action::Open {
                        ui.menu_button("Open recent", |ui| {
                            if editor.settings.recent.is_empty() {
                                ui.weak("none");
                            }
                            for path in &editor.settings.recent {
                                if ui.button(path.display().to_string()).clicked() {
                                    recent = Some(path.clone());
                                    ui.close();
                                }
                            }
                        });
                    }
                }
            });
        }
    });
    if let Some(path) = recent {
        let ctx = ui.ctx().clone();
        editor.open_recent(&ctx, path);
    }
}

fn add_menu(ui: &mut Ui, edits: &mut Edits) {
    for (object, title) in NewObject::ALL {
        if ui.button(title).clicked() {
            edits.act(Action::AddObject(object));
            ui.close();
        }
    }
    ui.separator();
    for (light, title) in NewLight::ALL {
        if ui.button(title).clicked() {
            edits.act(Action::AddLight(light));
            ui.close();
        }
    }
}

fn item(ui: &mut Ui, editor: &Editor, entry: &Entry, edits: &mut Edits) {
    let label = match entry.action {
        Action::Undo => label_of("Undo", editor.session.undo_label()),
        Action::Redo => label_of("Redo", editor.session.redo_label()),
        _ => entry.label.to_owned(),
    };
    let keys = entry.keys.map_or_else(String::new, |keys| ui.ctx().format_shortcut(&keys));
    let button = egui::Button::new(label).shortcut_text(keys);
    if ui.add_enabled(is_of_use(editor, entry.action), button).on_hover_text(entry.about).clicked() {
        edits.act(entry.action);
        ui.close();
    }
}

fn label_of(verb: &str, what: Option<&str>) -> String {
    what.map_or_else(|| verb.to_owned(), |what| format!("{verb}: {}", what.to_lowercase()))
}

/// The toolbar: every action that has a word for it.
pub fn toolbar(ui: &mut Ui, editor: &Editor, edits: &mut Edits) {
    ui.horizontal_wrapped(|ui| {
        ui.menu_button("Add…", |ui| add_menu(ui, edits)).response.on_hover_text("Add an object or a light");
        let light = ui.button("Light").on_hover_text("Add a point light");
        if light.clicked() {
            edits.act(Action::AddLight(NewLight::Point));
        }
        let mut menu = None;
        for entry in ENTRIES.iter().filter(|entry| !entry.short.is_empty()) {
            if menu.replace(entry.menu) != Some(entry.menu) {
                ui.separator();
            }
            let is_on = match entry.action {
                Action::Tool(tool) => editor.tool == tool,
                Action::RenderRegion => editor.region_mode,
                Action::ExplainPixel => editor.explain_mode,
                _ => false,
            };
            let keys = entry.keys.map_or_else(String::new, |keys| format!(" ({})", ui.ctx().format_shortcut(&keys)));
            let button = egui::Button::new(entry.short).selected(is_on);
            let response = ui.add_enabled(is_of_use(editor, entry.action), button);
            if response.on_hover_text(format!("{}: {}{keys}", entry.label, entry.about)).clicked() {
                edits.act(entry.action);
            }
        }
    });
}

/// The status bar: what there is, what is being done, what was done.
pub fn status(ui: &mut Ui, editor: &mut Editor, edits: &mut Edits) {
    ui.horizontal(|ui| {
        let (objects, triangles, quadrics) = editor.counts();
        ui.label(format!("{objects} objects, {triangles} triangles, {quadrics} quadrics"));
        ui.separator();
        if let Some(loading) = &editor.loading {
            let (_, part) = loading.watch.so_far();
            ui.label(&loading.what);
            ui.add(egui::ProgressBar::new(part).desired_width(120.0).show_percentage());
            if ui.button("Cancel").clicked() {
                loading.watch.cancel();
            }
        } else if let Some((stage, part, spent)) = editor.worker.rendering() {
            ui.add(egui::ProgressBar::new(part).desired_width(160.0).show_percentage());
            // Before a part is done nobody knows.
            let left = (part > 0.02).then(|| spent.as_secs_f32() * (1.0 - part) / part);
            ui.label(left.map_or_else(|| format!("{stage}…"), |left| format!("{stage}, {left:.0} s left")));
            if ui.button("Cancel").clicked() {
                edits.act(Action::StopRender);
            }
        } else if let Some((spent, rays)) = editor.last_render {
            let rate = rays as f64 / spent.as_secs_f64().max(1e-9) / 1e6;
            ui.label(format!("rendered in {:.2} s, {rate:.1} million rays a second", spent.as_secs_f64()));
        }
        if editor.region_mode {
            ui.strong("Drag a rectangle in the view; Escape gives up.");
        }
        if editor.explain_mode {
            ui.strong("Click a pixel to see why it has its colour; Escape ends this.");
        }
        if let Some((text, is_error)) = &editor.message {
            let color = if *is_error { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
            ui.colored_label(color, text.as_str());
        }
    });
}

/// The windows of Help.
pub fn windows(ctx: &Context, editor: &mut Editor) {
    egui::Window::new("Keys").open(&mut editor.shows_keys).default_size([380.0, 480.0]).show(ctx, |ui| {
        egui::ScrollArea::vertical().show(ui, |ui| {
            egui::Grid::new("keys").striped(true).show(ui, |ui| {
                for entry in ENTRIES {
                    if let Some(keys) = entry.keys {
                        ui.monospace(ui.ctx().format_shortcut(&keys));
                        ui.label(entry.about);
                        ui.end_row();
                    }
                }
                for (keys, about) in [
                    ("Arrows", "Turn the view; with Shift shift it, with Ctrl fly"),
                    ("+ and -", "Come nearer, go away; the wheel too"),
                    ("Drag", "Turn the view; with Shift or the right button shift it, with Alt look about"),
                    ("Tab, Enter", "From field to field; numbers are typed as well as dragged"),
                ] {
                    ui.monospace(keys);
                    ui.label(about);
                    ui.end_row();
                }
            });
        });
    });
    egui::Window::new("About").open(&mut editor.shows_about).resizable(false).show(ctx, |ui| {
        ui.heading(format!("whitted {}", env!("CARGO_PKG_VERSION")));
        ui.label("A Whitted ray tracer for large triangle scenes and quadrics.");
        ui.label("What is seen is the scene file: it renders to the same bytes with `whitted render`.");
    });
}
