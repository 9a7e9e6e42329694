//! A scene that is being edited, without a window: its text, what the text says, what is selected, and what was done.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use toml::Value;

use crate::editor::command::{Command, same};
use crate::editor::document::Document;
use crate::editor::history::{History, State};
use crate::editor::item::{Item, Kind};
use crate::error::{Error, Result};
use crate::formats::atomic_file::write_atomically;
use crate::formats::scene_file::{Assets, Parsed, camera_text, light_text, model_scene, parse_with};
use crate::formats::{self, LoadOptions};
use crate::progress::{Progress, Silent};
use crate::scene::extent::Extents;
use crate::scene::{Camera, NamedCamera, Scene, origin};

/// What a new scene is.
const NEW: &str = include_str!("new_scene.toml");

/// What the text of a scene says.
pub struct Reading {
    /// The scene, with its origin.
    pub scene: Arc<Scene>,
    /// Of each of the scene's objects, the number of its `[[object]]`.
    pub entries: Vec<u32>,
    /// The number in the scene of the first `[[material]]`.
    pub first_material: usize,
    /// Whether the lights are those of models.
    pub imports_lights: bool,
    /// The boxes of the scene's meshes.
    pub extents: Extents,
}

/// A scene that is being edited.
pub struct Session {
    /// The file it is saved to; a new scene has none.
    path: Option<PathBuf>,
    /// Where its relative paths start from: the file itself, or one that it could be saved to.
    place: PathBuf,
    options: LoadOptions,
    document: Document,
    text: Arc<str>,
    reading: Reading,
    assets: Assets,
    selection: BTreeSet<Item>,
    history: History,
    /// The text that is in the file.
    saved: Arc<str>,
    /// Counts the changes of the scene.
    revision: u64,
    /// The camera that is looked through, as long as it is there.
    active_camera: usize,
}

impl Session {
    /// A new scene: a floor, a sphere and a light. `folder` is where it would be saved.
    ///
    /// # Errors
    /// None that is known of: the text is part of the program.
    pub fn new(folder: &Path) -> Result<Self> {
        Self::of_text(NEW, None, folder.join("untitled.toml"), LoadOptions::default(), &Silent)
    }

    /// Opens a scene file, or a bare model as a new scene that shows it.
    ///
    /// # Errors
    /// Those of reading it.
    pub fn open(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Self> {
        if formats::is_scene(path)? {
            let text = std::fs::read_to_string(path).map_err(|cause| Error::system(path, cause))?;
            return Self::of_text(&text, Some(path.to_path_buf()), path.to_path_buf(), options.clone(), progress);
        }
        if formats::is_built(path)? {
            return Err(Error::unsupported("a built scene cannot be edited")
                .at_path(path)
                .remedy("open the scene or model that it was built from"));
        }
        let scene = formats::open(path, options, progress)?.scene;
        let place = path.with_extension("toml");
        let text = model_scene(&scene, path, options, &place)?;
        drop(scene);
        let own = LoadOptions { allow_external: options.allow_external, limits: options.limits, ..Default::default() };
        let mut session = Self::of_text(&text, None, place, own, progress)?;
        // It is in no file.
        session.saved = Arc::from("");
        Ok(session)
    }

    /// A scene given by its text, that lies, or would lie, at `place`.
    ///
    /// # Errors
    /// Those of reading it.
    pub fn of_text(
        text: &str,
        path: Option<PathBuf>,
        place: PathBuf,
        options: LoadOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut assets = Assets::default();
        let reading = read(text, &place, &options, 0, &mut assets, progress)?;
        let document = Document::parse(text).map_err(|error| error.at_path(&place))?;
        let text: Arc<str> = Arc::from(text);
        Ok(Self {
            path,
            place,
            options,
            document,
            saved: Arc::clone(&text),
            text,
            reading,
            assets,
            selection: BTreeSet::new(),
            history: History::default(),
            revision: 0,
            active_camera: 0,
        })
    }

    /// The file it is saved to.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The file it is saved to, or could be.
    pub fn suggested_path(&self) -> &Path {
        self.path.as_deref().unwrap_or(&self.place)
    }

    /// The text of the scene file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The text with its structure.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// What the text says.
    pub fn reading(&self) -> &Reading {
        &self.reading
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.reading.scene
    }

    /// A number that changes whenever the scene does.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Counts changes from another number on.
    pub fn begin_at(&mut self, revision: u64) {
        self.revision = revision;
    }

    /// Looks through another of the scene's cameras, until it is opened again. Nothing of the text changes.
    ///
    /// # Errors
    /// A camera that is not there.
    pub fn choose_camera(&mut self, index: usize) -> Result<()> {
        if index >= self.reading.scene.cameras.len() {
            return Err(Error::caller(format!("there is no camera {}", index + 1)));
        }
        self.active_camera = index;
        Arc::make_mut(&mut self.reading.scene).active_camera = index;
        self.revision += 1;
        Ok(())
    }

    /// Whether there is something to save.
    pub fn is_changed(&self) -> bool {
        self.text != self.saved
    }

    /// What is selected.
    pub fn selection(&self) -> &BTreeSet<Item> {
        &self.selection
    }

    /// Selects items that are there and nothing else.
    pub fn select(&mut self, items: impl IntoIterator<Item = Item>) {
        self.selection = items.into_iter().filter(|item| item.index < self.document.count(item.kind)).collect();
    }

    /// Selects an item, or no longer, beside what is.
    pub fn toggle(&mut self, item: Item) {
        if !self.selection.remove(&item) && item.index < self.document.count(item.kind) {
            self.selection.insert(item);
        }
    }

    /// The material that `[[material]]` number `index` says.
    pub fn material(&self, index: usize) -> Option<&crate::scene::Material> {
        self.reading.scene.materials.get(self.reading.first_material + index)
    }

    /// Whether an object is shown.
    pub fn is_visible(&self, object: usize) -> bool {
        self.document.value(Item::object(object), &["visible"]) != Some(Value::Boolean(false))
    }

    /// The numbers in the scene of the objects that an `[[object]]` makes.
    pub fn instances(&self, object: usize) -> Range<usize> {
        // In the file's order, so that those of one stand together.
        let entries = &self.reading.entries;
        let first = entries.partition_point(|&entry| (entry as usize) < object);
        first..entries.partition_point(|&entry| entry as usize <= object)
    }

    /// The box around what some `[[object]]`s make, that without end left out, in the file's coordinates; `None` if nothing is left.
    pub fn extent(&self, objects: impl Iterator<Item = usize>) -> Option<(DVec3, DVec3)> {
        let Reading { scene, extents, .. } = &self.reading;
        let instances = objects.flat_map(|object| self.instances(object));
        let corners = instances.filter_map(|number| extents.corners(scene, &scene.objects[number])).flatten();
        corners.fold(None, |around: Option<(DVec3, DVec3)>, corner| {
            let (min, max) = around.unwrap_or((corner, corner));
            Some((min.min(corner), max.max(corner)))
        })
    }

    /// The materials of its file that an object has, as positions in the scene's list, ascending. Looks at all of its triangles.
    pub fn imported_materials(&self, object: usize) -> Vec<usize> {
        let scene = &self.reading.scene;
        let used = scene.materials_used_by(self.instances(object).map(|number| &scene.objects[number]));
        used.iter().enumerate().filter(|(_, used)| **used).map(|(number, _)| number).collect()
    }

    /// Changes the scene. What the scene file may not say is refused, and nothing is changed.
    ///
    /// # Errors
    /// What is wrong with the command, or with the scene that it would make.
    pub fn apply(&mut self, command: &Command) -> Result<()> {
        self.apply_as(command, None)
    }

    /// Changes the scene as part of a longer movement, such as a drag: one undo takes all of it back. The command starts from what
    /// was before the movement, so each one takes the place of the one before.
    ///
    /// # Errors
    /// As [`apply`](Self::apply); the movement stays where it was.
    pub fn apply_instead(&mut self, command: &Command, movement: u64) -> Result<()> {
        self.apply_as(command, Some(movement))
    }

    fn apply_as(&mut self, command: &Command, movement: Option<u64>) -> Result<()> {
        let is_going_on = movement.is_some() && self.history.movement() == movement;
        let before = if is_going_on { self.history.before().cloned() } else { None };
        let mut document = match &before {
            Some(state) => Document::parse(&state.text)?,
            None => self.document.clone(),
        };
        let counts = Kind::LISTS.map(|kind| document.count(kind));
        command.apply(&mut document)?;
        let text = document.text();
        if before.is_none() && *text == *self.text {
            return Ok(());
        }
        let reading = read(&text, &self.place, &self.options, self.active_camera, &mut self.assets, &Silent)?;
        let state = self.state();
        if before.is_none() {
            self.history.push(state, command.label(), movement);
        } else {
            self.history.go_on();
        }
        self.document = document;
        self.text = Arc::from(text);
        self.reading = reading;
        self.revision += 1;
        self.follow(command, counts);
        Ok(())
    }

    /// Selects what a command added, and nothing that it took away.
    fn follow(&mut self, command: &Command, counts: [usize; Kind::LISTS.len()]) {
        let added: Vec<Item> = Kind::LISTS
            .iter()
            .zip(counts)
            .flat_map(|(&kind, count)| (count..self.document.count(kind)).map(move |index| Item::new(kind, index)))
            .filter(|item| matches!(item.kind, Kind::Object | Kind::Light))
            .collect();
        if !added.is_empty() {
            self.selection = added.into_iter().collect();
        } else if removes(command) {
            self.selection.clear();
        }
    }

    /// Ends a longer movement: the next command is a step of its own.
    pub fn end_movement(&mut self) {
        self.history.end_movement();
    }

    /// What undo would take back.
    pub fn undo_label(&self) -> Option<&str> {
        self.history.undo_label()
    }

    /// What redo would do again.
    pub fn redo_label(&self) -> Option<&str> {
        self.history.redo_label()
    }

    /// Takes the last change back; false if there is none.
    ///
    /// # Errors
    /// Those of reading the scene as it was, whose files may have changed.
    pub fn undo(&mut self) -> Result<bool> {
        let Some(state) = self.history.before() else { return Ok(false) };
        self.restore(&state.clone())?;
        Ok(true)
    }

    /// Does again what was taken back; false if there is nothing.
    ///
    /// # Errors
    /// As [`undo`](Self::undo).
    pub fn redo(&mut self) -> Result<bool> {
        let Some(state) = self.history.peek_redo() else { return Ok(false) };
        let state = state.clone();
        let (document, reading) = self.read_state(&state)?;
        self.history.redo(self.state());
        self.put(state, document, reading);
        Ok(true)
    }

    fn restore(&mut self, state: &State) -> Result<()> {
        let (document, reading) = self.read_state(state)?;
        self.history.undo(self.state());
        self.put(state.clone(), document, reading);
        Ok(())
    }

    fn read_state(&mut self, state: &State) -> Result<(Document, Reading)> {
        let reading = read(&state.text, &self.place, &self.options, self.active_camera, &mut self.assets, &Silent)?;
        Ok((Document::parse(&state.text)?, reading))
    }

    fn put(&mut self, state: State, document: Document, reading: Reading) {
        self.text = state.text;
        self.selection = state.selection;
        self.document = document;
        self.reading = reading;
        self.revision += 1;
    }

    fn state(&self) -> State {
        State { text: Arc::clone(&self.text), selection: self.selection.clone() }
    }

    /// Looks through the scene's camera from elsewhere. Cameras that the text does not have, since they are automatic or of models,
    /// are written into it.
    ///
    /// # Errors
    /// A camera that sees nothing.
    pub fn set_camera(&mut self, camera: Camera, movement: Option<u64>) -> Result<()> {
        let scene = &self.reading.scene;
        let named = |index: usize, named: &NamedCamera| {
            if index == scene.active_camera { NamedCamera { camera, ..named.clone() } } else { named.clone() }
        };
        let command = if self.document.count(Kind::Camera) == 0 {
            let cameras = scene.cameras.iter().enumerate().map(|(index, camera)| named(index, camera));
            Command::All(cameras.map(|camera| add_text(Kind::Camera, &camera_text(&camera))).collect::<Result<_>>()?)
        } else {
            let index = scene.active_camera;
            let text = camera_text(&named(index, &scene.cameras[index]));
            self.changes(Item::new(Kind::Camera, index), &text)?
        };
        self.apply_as(&command, movement)
    }

    /// What makes an item say what a text of its own does; fields that mean the same stay as they are written.
    fn changes(&self, item: Item, text: &str) -> Result<Command> {
        let wanted = fields_of(item.kind, text)?;
        let document = &self.document;
        let mut commands = Vec::new();
        if let Some(fields) = document.fields(item) {
            let gone = fields.iter().map(|(key, _)| key).filter(|&key| key != "name");
            let gone = gone.filter(|&key| wanted.iter().all(|(wanted, _)| wanted != key));
            commands.extend(gone.map(|key| Command::unset(item, &[key])));
        }
        for (key, value) in wanted.into_iter().filter(|(key, _)| key != "name") {
            let before = document.value(item, &[&key]);
            if !before.is_some_and(|before| same(&before, &value)) {
                commands.push(Command::set(item, &[&key], value));
            }
        }
        Ok(Command::All(commands))
    }

    /// What adds a light: those of models, which the scene's own would take the place of, are written into the text first.
    ///
    /// # Errors
    /// None that is known of.
    pub fn adding_light(&self, fields: Vec<(String, Value)>) -> Result<Command> {
        let mut commands = Vec::new();
        if self.reading.imports_lights {
            for light in &self.reading.scene.lights {
                commands.push(add_text(Kind::Light, &light_text(light))?);
            }
        }
        commands.push(Command::Add { kind: Kind::Light, fields });
        Ok(Command::All(commands))
    }

    /// Saves to the scene's file.
    ///
    /// # Errors
    /// A caller's error if it has none; the system's.
    pub fn save(&mut self) -> Result<()> {
        let Some(path) = self.path.clone() else {
            return Err(Error::caller("the scene has no file yet").remedy("save it under a name"));
        };
        self.write(&path)?;
        self.saved = Arc::clone(&self.text);
        Ok(())
    }

    /// Saves to another file, which becomes the scene's.
    ///
    /// # Errors
    /// A name that does not end in .toml; the system's.
    pub fn save_as(&mut self, path: &Path) -> Result<()> {
        if !path.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("toml")) {
            return Err(Error::caller("a scene file's name must end in .toml").at_path(path));
        }
        let folder = |path: &Path| path.parent().map(Path::to_path_buf);
        if folder(path) != folder(&self.place) {
            self.rebase(path)?;
        }
        self.place = path.to_path_buf();
        self.write(path)?;
        self.path = Some(path.to_path_buf());
        self.saved = Arc::clone(&self.text);
        Ok(())
    }

    /// Makes the paths in the text, and in all that can be undone, lead from another file.
    fn rebase(&mut self, to: &Path) -> Result<()> {
        let from = self.place.clone();
        let rebased = |text: &str| {
            let mut document = Document::parse(text)?;
            document.rebase(&from, to);
            Ok::<_, Error>(document)
        };
        let document = rebased(&self.text)?;
        let text = document.text();
        let reading = read(&text, to, &self.options, self.active_camera, &mut self.assets, &Silent)?;
        self.history.each(|text| rebased(text).map(|document| Arc::from(document.text())))?;
        self.document = document;
        self.text = Arc::from(text);
        self.reading = reading;
        Ok(())
    }

    fn write(&self, path: &Path) -> Result<()> {
        let text = self.text.as_bytes();
        write_atomically(path, |sink| sink.write_all(text).map_err(|cause| Error::system(path, cause)))
    }

    /// Takes over models that were read elsewhere, so that adding them to the scene takes no time.
    pub fn adopt(&mut self, assets: Assets) {
        self.assets.adopt(assets);
    }

    /// How models are read.
    pub fn options(&self) -> &LoadOptions {
        &self.options
    }

    /// Makes the text one that was found elsewhere, such as after a crash: there is something to save.
    pub fn mark_unsaved(&mut self) {
        self.saved = Arc::from("");
    }

    /// A path as the scene file would name it.
    pub fn relative(&self, path: &Path) -> String {
        formats::atomic_file::relative_to(path, &self.place).to_string_lossy().replace('\\', "/")
    }
}

fn removes(command: &Command) -> bool {
    match command {
        Command::Remove(_) => true,
        Command::All(commands) => commands.iter().any(removes),
        _ => false,
    }
}

fn read(
    text: &str,
    place: &Path,
    options: &LoadOptions,
    camera: usize,
    assets: &mut Assets,
    progress: &dyn Progress,
) -> Result<Reading> {
    let Parsed { loaded, entries, imported_materials, imports_lights, extents } =
        parse_with(text, place, options, assets, progress)?;
    let mut scene = loaded.scene;
    scene.origin = origin::choose_within(&scene, &extents);
    scene.active_camera = if camera < scene.cameras.len() { camera } else { 0 };
    Ok(Reading { scene: Arc::new(scene), entries, first_material: imported_materials, imports_lights, extents })
}

/// The fields of a text that is one table.
fn fields_of(kind: Kind, text: &str) -> Result<Vec<(String, Value)>> {
    let document = Document::parse(text)?;
    let item = Item::new(kind, 0);
    let keys: Vec<String> =
        document.fields(item).map_or_else(Vec::new, |fields| fields.iter().map(|(key, _)| key.to_owned()).collect());
    Ok(keys.into_iter().filter_map(|key| document.value(item, &[&key]).map(|value| (key, value))).collect())
}

fn add_text(kind: Kind, text: &str) -> Result<Command> {
    Ok(Command::Add { kind, fields: fields_of(kind, text)? })
}
