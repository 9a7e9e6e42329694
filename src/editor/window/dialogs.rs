//! Questions that the window asks: paths, what becomes of changes, what was left over.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use eframe::egui::{self, Context, Key};

use super::settings::Unsaved;
use crate::editor::Item;

/// What a path is asked for.
#[derive(Debug, Clone, PartialEq)]
pub enum Purpose {
    /// A scene or model to open.
    Open,
    /// A model to add.
    Import,
    /// Where the scene is saved.
    SaveAs,
    /// Where the picture is saved.
    SavePicture,
    /// An image for a texture of these materials, overrides or objects.
    Texture(Vec<Item>),
}

impl Purpose {
    fn title(&self) -> &'static str {
        match self {
            Self::Open => "Open a scene or a model",
            Self::Import => "Import a model",
            Self::SaveAs => "Save the scene as",
            Self::SavePicture => "Save the picture as",
            Self::Texture(_) => "Choose an image",
        }
    }

    fn suffixes(&self) -> &'static [&'static str] {
        match self {
            Self::Open => &["toml", "obj", "gltf", "glb"],
            Self::Import => &["obj", "gltf", "glb"],
            Self::SaveAs => &["toml"],
            Self::SavePicture => &["png", "exr", "jpg", "webp", "tga", "bmp", "hdr"],
            Self::Texture(_) => &["png", "jpg", "jpeg", "webp", "tga", "bmp", "hdr", "exr"],
        }
    }

    fn saves(&self) -> bool {
        matches!(self, Self::SaveAs | Self::SavePicture)
    }
}

/// What follows once changes are saved or given up.
#[derive(Debug, Clone, PartialEq)]
pub enum After {
    /// A new scene.
    New,
    /// A file is asked for.
    Open,
    /// A file that is known.
    OpenFile(PathBuf),
    /// The end.
    Quit,
}

/// A question.
pub enum Dialog {
    /// For a path.
    Path(PathDialog),
    /// What becomes of changes.
    Changes(After),
    /// Whether to go on with what was left over.
    Recover(Unsaved),
}

/// An answer.
#[derive(Debug, PartialEq)]
pub enum Answer {
    /// A path.
    Path(Purpose, PathBuf),
    /// Save first.
    Save(After),
    /// Give changes up.
    Discard(After),
    /// Go on with what was left over.
    Recover(Unsaved),
    /// Nothing.
    Cancel,
}

/// A path that is typed, chosen from a folder's files, or found with the system's own dialog.
pub struct PathDialog {
    purpose: Purpose,
    text: String,
    found: Option<Receiver<Option<PathBuf>>>,
    is_new: bool,
    /// The files of the folder that was looked into last.
    listing: Option<(PathBuf, Vec<(bool, String)>)>,
}

impl PathDialog {
    /// Asks for a path, beginning at one.
    pub fn new(purpose: Purpose, start: &Path) -> Self {
        Self { purpose, text: start.display().to_string(), found: None, is_new: true, listing: None }
    }

    fn show(&mut self, ctx: &Context) -> Option<Answer> {
        let mut answer = None;
        let modal = egui::Modal::new(egui::Id::unique("path dialog")).show(ctx, |ui| {
            ui.set_width(480.0);
            ui.heading(self.purpose.title());
            let label = ui.label("Path");
            let edit = egui::TextEdit::singleline(&mut self.text).desired_width(f32::INFINITY);
            let response = ui.add(edit).labelled_by(label.id);
            if std::mem::take(&mut self.is_new) {
                response.request_focus();
            }
            self.files(ui);
            let is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            ui.horizontal(|ui| {
                let confirm = if self.purpose.saves() { "Save" } else { "Open" };
                let is_given = !self.text.trim().is_empty();
                if ui.add_enabled(is_given, egui::Button::new(confirm)).clicked() || is_entered && is_given {
                    answer = Some(Answer::Path(self.purpose.clone(), PathBuf::from(self.text.trim())));
                }
                if ui.button("Cancel").clicked() {
                    answer = Some(Answer::Cancel);
                }
                let browse = egui::Button::new("Browse…");
                if ui.add_enabled(self.found.is_none(), browse).on_hover_text("The system's own dialog").clicked() {
                    self.found = Some(browse_for(&self.purpose, Path::new(&self.text), ctx.clone()));
                }
            });
        });
        if let Some(found) = &self.found {
            match found.try_recv() {
                Ok(Some(path)) => answer = Some(Answer::Path(self.purpose.clone(), path)),
                Ok(None) | Err(TryRecvError::Disconnected) => self.found = None,
                Err(TryRecvError::Empty) => {}
            }
        }
        if answer.is_none() && modal.should_close() {
            answer = Some(Answer::Cancel);
        }
        answer
    }

    /// Files of the folder that is typed that begin as the name does.
    fn files(&mut self, ui: &mut egui::Ui) {
        let typed = PathBuf::from(&self.text);
        let is_folder = self.text.is_empty() || self.text.ends_with(std::path::is_separator);
        let folder = if is_folder { typed.clone() } else { typed.parent().map(Path::to_path_buf).unwrap_or_default() };
        let begin = if is_folder { String::new() } else { file_name(&typed) };
        if self.listing.as_ref().is_none_or(|(known, _)| *known != folder) {
            self.listing = Some((folder.clone(), files_of(&folder, self.purpose.suffixes())));
        }
        let Some((_, files)) = &self.listing else { return };
        let begins = |(_, name): &&(bool, String)| name.starts_with(&begin);
        let shown: Vec<&(bool, String)> = match files.iter().any(|file| begins(&file)) {
            true => files.iter().filter(begins).collect(),
            false => files.iter().collect(),
        };
        egui::ScrollArea::vertical().max_height(220.0).auto_shrink([false, true]).show(ui, |ui| {
            for (is_dir, name) in shown {
                let label = if *is_dir { format!("{name}/") } else { name.clone() };
                if ui.selectable_label(false, &label).clicked() {
                    self.text = folder.join(&label).display().to_string();
                }
            }
        });
    }
}

/// Folders, and files of these suffixes, in a folder: whether each is a folder, and its name.
fn files_of(folder: &Path, suffixes: &[&str]) -> Vec<(bool, String)> {
    /// More are not looked at.
    const MOST: usize = 4096;
    let place = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(place).into_iter().flatten().take(MOST).flatten();
    let files = entries.map(|entry| (entry.path().is_dir(), entry.file_name().to_string_lossy().into_owned()));
    let fits = |name: &str| {
        let suffix = Path::new(name).extension().map(|suffix| suffix.to_string_lossy().to_ascii_lowercase());
        suffix.is_some_and(|suffix| suffixes.contains(&suffix.as_str()))
    };
    let mut files: Vec<_> = files.filter(|(is_dir, name)| !name.starts_with('.') && (*is_dir || fits(name))).collect();
    files.sort_by(|a, b| (!a.0, &a.1).cmp(&(!b.0, &b.1)));
    files
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Opens the system's dialog beside the window; nothing comes where there is none.
fn browse_for(purpose: &Purpose, start: &Path, ctx: Context) -> Receiver<Option<PathBuf>> {
    let (send, receive) = channel();
    let mut dialog = rfd::FileDialog::new().set_title(purpose.title()).add_filter("files", purpose.suffixes());
    if let Some(folder) = start.parent().and_then(|folder| std::path::absolute(folder).ok()) {
        dialog = dialog.set_directory(folder);
    }
    let saves = purpose.saves();
    let name = file_name(start);
    let ask = move || {
        let found = if saves { dialog.set_file_name(name).save_file() } else { dialog.pick_file() };
        // The window may have gone on without it.
        let _ = send.send(found);
        ctx.request_repaint();
    };
    // macOS has dialogs on the main thread alone.
    if cfg!(target_os = "macos") {
        ask();
    } else {
        std::thread::spawn(ask);
    }
    receive
}

impl Dialog {
    /// Shows the question; its answer, once there is one.
    pub fn show(&mut self, ctx: &Context) -> Option<Answer> {
        match self {
            Self::Path(dialog) => dialog.show(ctx),
            Self::Changes(after) => {
                let title = "Save the changes to the scene?";
                let [save, discard] = ["Save", "Discard"];
                question(ctx, title, "They are lost otherwise.", save, discard).map(|answer| match answer {
                    Some(true) => Answer::Save(after.clone()),
                    Some(false) => Answer::Discard(after.clone()),
                    None => Answer::Cancel,
                })
            }
            Self::Recover(unsaved) => {
                let name = unsaved.path.as_ref().unwrap_or(&unsaved.place).display().to_string();
                let text = format!("The editor ended before it was saved: {name}");
                question(ctx, "Go on with a scene that was not saved?", &text, "Recover", "Discard").map(|answer| {
                    match answer {
                        Some(true) => Answer::Recover(unsaved.clone()),
                        _ => Answer::Cancel,
                    }
                })
            }
        }
    }
}

/// A question with two answers, or none.
fn question(ctx: &Context, title: &str, text: &str, yes: &str, no: &str) -> Option<Option<bool>> {
    let mut answer = None;
    let modal = egui::Modal::new(egui::Id::unique("question")).show(ctx, |ui| {
        ui.set_width(360.0);
        ui.heading(title);
        ui.label(text);
        ui.horizontal(|ui| {
            if ui.button(yes).clicked() {
                answer = Some(Some(true));
            }
            if ui.button(no).clicked() {
                answer = Some(Some(false));
            }
            if ui.button("Cancel").clicked() {
                answer = Some(None);
            }
        });
    });
    if answer.is_none() && modal.should_close() { Some(None) } else { answer }
}
