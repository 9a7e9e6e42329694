//! What actions do.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::{self, Context};

use super::actions::{Action, ENTRIES, NewObject};
use super::canvas;
use super::dialogs::{After, Dialog, PathDialog, Purpose};
use super::{Editor, properties};
use crate::editor::navigate::Looking;
use crate::editor::{Command, Item, Kind, Session, numbers, presets};
use crate::formats::picture;
use crate::scene::Shape;

/// What the window is called: the file, whether there is something to save, and what part of a picture is rendered.
pub fn window_title(session: &Session, rendered: Option<f32>) -> String {
    let name = session.path().and_then(Path::file_name).map_or("untitled".into(), |name| name.to_string_lossy());
    let part = rendered.map_or_else(String::new, |part| format!("{:.0} % - ", part * 100.0));
    format!("{part}{}{name} - whitted", if session.is_changed() { "*" } else { "" })
}

impl Editor {
    /// Calls what keys call.
    pub(super) fn call_keys(&mut self, ctx: &Context) {
        if self.dialog.is_some() {
            return;
        }
        let types = ctx.egui_wants_keyboard_input();
        // Keys with Shift first: those without it are pressed then too.
        let with_shift = |wanted: bool| {
            ENTRIES.iter().filter(move |entry| entry.keys.is_some_and(|keys| keys.modifiers.shift == wanted))
        };
        for entry in with_shift(true).chain(with_shift(false)) {
            let Some(keys) = entry.keys else { continue };
            // While a field is typed into, plain keys are letters.
            if types && !keys.modifiers.command && !matches!(entry.action, Action::RenderFull | Action::ShowKeys) {
                continue;
            }
            if ctx.input_mut(|input| input.consume_shortcut(&keys)) && canvas::is_of_use(self, entry.action) {
                self.act(ctx, entry.action);
            }
        }
    }

    /// Does what a menu, the toolbar or a key asks for.
    pub(super) fn act(&mut self, ctx: &Context, action: Action) {
        self.session.end_movement();
        match action {
            Action::New => self.unless_changed(ctx, After::New),
            Action::Open => self.unless_changed(ctx, After::Open),
            Action::Save => {
                if self.session.path().is_none() {
                    self.ask_path(Purpose::SaveAs);
                } else {
                    self.save();
                }
            }
            Action::SaveAs => self.ask_path(Purpose::SaveAs),
            Action::Import => self.ask_path(Purpose::Import),
            Action::SavePicture => self.ask_path(Purpose::SavePicture),
            Action::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::Undo | Action::Redo => {
                let done = if action == Action::Undo { self.session.undo() } else { self.session.redo() };
                if let Err(error) = done {
                    self.tell_error(&error);
                }
            }
            Action::Duplicate => self.apply(&Command::Duplicate(self.selected())),
            Action::Delete => self.apply(&Command::Remove(self.selected())),
            Action::Hide => self.hide(),
            Action::SelectAll => {
                let count = self.session.document().count(Kind::Object);
                self.session.select((0..count).map(Item::object));
            }
            Action::SelectNone => self.session.select([]),
            Action::AddObject(object) => self.add_object(object),
            Action::AddLight(light) => {
                let looking = Looking::of(self.session.scene().camera());
                let distance = numbers::round_size(0.7 * looking.height());
                let fields = presets::light(self.session.document(), light, self.middle(), distance);
                match self.session.adding_light(fields) {
                    Ok(command) => self.apply(&command),
                    Err(error) => self.tell_error(&error),
                }
            }
            Action::Texture => {
                let objects = self.selected().into_iter().filter(|item| item.kind == Kind::Object).collect();
                self.ask_path(Purpose::Texture(objects));
            }
            Action::Tool(tool) => self.tool = tool,
            Action::FrameSelected => {
                let selected = self.session.selection().iter().filter(|item| item.kind == Kind::Object);
                self.frame(self.session.extent(selected.map(|item| item.index)));
            }
            Action::FrameAll => {
                let count = self.session.document().count(Kind::Object);
                self.frame(self.session.extent(0..count));
            }
            Action::Look(view) => {
                let mut looking = Looking::of(self.session.scene().camera());
                looking.look_from(view);
                self.look(looking);
            }
            Action::ToggleProjection => {
                let mut looking = Looking::of(self.session.scene().camera());
                looking.toggle_projection(crate::scene::auto::DEFAULT_FOV.to_radians());
                self.look(looking);
            }
            Action::ToggleGrid => self.grid = !self.grid,
            Action::ToggleWireframe => self.wireframe = !self.wireframe,
            Action::ToggleTheme => {
                self.settings.is_light = !self.settings.is_light;
                self.settings.save();
                self.use_theme(ctx);
            }
            Action::RenderFull => self.render(ctx, None),
            Action::RenderRegion => (self.region_mode, self.explain_mode) = (true, false),
            Action::StopRender => {
                (self.region_mode, self.explain_mode, self.restart) = (false, false, None);
                self.worker.cancel();
            }
            Action::ClearRender => {
                self.worker.cancel();
                (self.overlay, self.tree, self.restart) = (None, None, None);
            }
            Action::ExplainPixel => (self.explain_mode, self.region_mode) = (!self.explain_mode, false),
            Action::ShowKeys => self.shows_keys = true,
            Action::ShowAbout => self.shows_about = true,
        }
    }

    pub(super) fn use_theme(&self, ctx: &Context) {
        ctx.set_theme(if self.settings.is_light { egui::Theme::Light } else { egui::Theme::Dark });
    }

    fn selected(&self) -> Vec<Item> {
        self.session.selection().iter().copied().collect()
    }

    /// What the view looks at, to the digits that its size gives sense to.
    fn middle(&self) -> glam::DVec3 {
        let looking = Looking::of(self.session.scene().camera());
        let step = numbers::round_size(looking.height()) * 0.05;
        let parts = 1.0 / step;
        glam::DVec3::from_array(looking.target.to_array().map(|x| (x * parts).round() / parts))
    }

    fn add_object(&mut self, object: NewObject) {
        let looking = Looking::of(self.session.scene().camera());
        let size = numbers::round_size(0.15 * looking.height());
        let command = presets::add_object(self.session.document(), object, self.middle(), size);
        self.apply(&command);
    }

    fn hide(&mut self) {
        let objects: Vec<Item> = self.selected().into_iter().filter(|item| item.kind == Kind::Object).collect();
        let any_visible = objects.iter().any(|item| self.session.is_visible(item.index));
        let set = |item: &Item| match any_visible {
            true => Command::set(*item, &["visible"], false),
            false => Command::unset(*item, &["visible"]),
        };
        self.apply(&Command::All(objects.iter().map(set).collect()));
    }

    fn frame(&mut self, around: Option<(glam::DVec3, glam::DVec3)>) {
        let Some((min, max)) = around else { return self.tell("There is nothing of limited size to look at.") };
        let film = self.session.scene().film;
        let mut looking = Looking::of(self.session.scene().camera());
        looking.frame(min, max, f64::from(film.width) / f64::from(film.height));
        self.look(looking);
    }

    /// Saves to the scene's file; whether that was possible.
    pub(super) fn save(&mut self) -> bool {
        match self.session.save() {
            Ok(()) => {
                self.settings.forget_unsaved();
                self.tell("Saved.");
                true
            }
            Err(error) => {
                self.tell_error(&error);
                false
            }
        }
    }

    /// Goes on, or asks first where there are changes.
    fn unless_changed(&mut self, ctx: &Context, after: After) {
        if self.session.is_changed() {
            self.dialog = Some(Dialog::Changes(after));
        } else {
            self.go_on(ctx, after);
        }
    }

    pub(super) fn go_on(&mut self, ctx: &Context, after: After) {
        match after {
            After::New => match Session::new(self.session.suggested_path().parent().unwrap_or(Path::new(""))) {
                Ok(session) => self.show_session(session),
                Err(error) => self.tell_error(&error),
            },
            After::Open => self.ask_path(Purpose::Open),
            After::OpenFile(path) => self.open(ctx, &path),
            After::Quit => {
                self.may_close = true;
                self.settings.forget_unsaved();
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
        }
    }

    /// Opens a recent file.
    pub(super) fn open_recent(&mut self, ctx: &Context, path: PathBuf) {
        self.unless_changed(ctx, After::OpenFile(path));
    }

    pub(super) fn ask_path(&mut self, purpose: Purpose) {
        let suggested = self.session.suggested_path();
        let start = match purpose {
            Purpose::SaveAs => suggested.to_path_buf(),
            Purpose::SavePicture => suggested.with_extension("png"),
            _ => suggested.parent().map(|folder| folder.join("")).unwrap_or_default(),
        };
        self.dialog = Some(Dialog::Path(PathDialog::new(purpose, &start)));
    }

    /// Does with a path what it was asked for.
    pub(super) fn take_path(&mut self, ctx: &Context, purpose: &Purpose, path: &Path) {
        match purpose {
            Purpose::Open => self.open(ctx, path),
            Purpose::Import => self.import(ctx, path),
            Purpose::SaveAs => match self.session.save_as(path) {
                Ok(()) => {
                    self.settings.forget_unsaved();
                    self.settings.note(path);
                    self.tell(format!("Saved as {}.", path.display()));
                }
                Err(error) => self.tell_error(&error),
            },
            Purpose::SavePicture => {
                let saved = self
                    .overlay
                    .as_ref()
                    .and_then(|overlay| overlay.film.as_ref())
                    .map(|film| picture::save(film, path));
                match saved {
                    Some(Ok(())) => self.tell(format!("Saved the picture as {}.", path.display())),
                    Some(Err(error)) => self.tell_error(&error),
                    None => self.tell("There is no picture: render one first."),
                }
            }
            Purpose::Texture(items) => self.set_texture(items, path),
        }
    }

    /// Does with a file that was dropped what its kind suggests.
    pub(super) fn take_file(&mut self, ctx: &Context, path: &Path) {
        let suffix = path.extension().map(|suffix| suffix.to_string_lossy().to_ascii_lowercase());
        match suffix.as_deref() {
            Some("toml") => self.unless_changed(ctx, After::OpenFile(path.to_path_buf())),
            Some("obj" | "gltf" | "glb") => self.import(ctx, path),
            _ => {
                let objects: Vec<Item> = self.selected().into_iter().filter(|item| item.kind == Kind::Object).collect();
                if objects.is_empty() {
                    self.tell("Select an object first: the image becomes its texture.");
                } else {
                    self.set_texture(&objects, path);
                }
            }
        }
    }

    /// Gives an image to materials, or to the materials of objects, which get one of their own where they have none.
    fn set_texture(&mut self, items: &[Item], path: &Path) {
        let session = &self.session;
        let document = session.document();
        let file = session.relative(path);
        let set = |item: Item| match document.value(item, &["texture"]).is_some_and(|value| value.is_table()) {
            true => Command::set(item, &["texture", "file"], file.as_str()),
            false => Command::set(item, &["texture"], file.as_str()),
        };
        let names = document.names(Kind::Material);
        let mut commands = Vec::new();
        let mut bare = Vec::new();
        for &item in items {
            if item.kind != Kind::Object {
                commands.push(set(item));
                continue;
            }
            let own = document.string(item, "material").and_then(|own| names.iter().position(|name| *name == own));
            match own {
                Some(index) => commands.push(set(Item::material(index))),
                None => bare.push(item),
            }
        }
        if !bare.is_empty() {
            let fields = vec![
                ("diffuse".to_owned(), toml::Value::Float(0.9)),
                ("texture".to_owned(), toml::Value::from(file.as_str())),
            ];
            commands.push(properties::new_material(session, &bare, "textured", fields));
        }
        commands.dedup();
        self.apply(&Command::All(commands));
    }

    /// How many triangles and quadrics there are.
    pub(super) fn counts(&self) -> (usize, u64, usize) {
        let scene: &Arc<crate::scene::Scene> = self.session.scene();
        let quadrics = scene.objects.iter().filter(|object| matches!(object.shape, Shape::Quadric(_))).count();
        (scene.objects.len(), scene.instanced_triangles(), quadrics)
    }
}
