//! The window: shows a session, and sends it commands.

pub mod actions;
mod ball;
mod canvas;
mod dialogs;
pub mod edits;
mod menus;
mod outliner;
mod perform;
mod properties;
pub mod settings;
mod shapes;
mod tree;
mod widgets;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use eframe::egui::{self, Context, Ui};
use eframe::{egui_glow, glow};
use glam::DVec2;

use crate::editor::gizmo::Tool;
use crate::editor::job::{Event, Watch, Worker};
use crate::editor::navigate::Looking;
use crate::editor::viewport::{Options, Viewport};
use crate::editor::{Command, Item, Session};
use crate::error::{Error, Fault, Result};
use crate::formats::LoadOptions;
use crate::formats::scene_file::Assets;
use crate::render::Crop;
use canvas::{Drag, Overlay};
use dialogs::{Answer, Dialog};
use edits::{Ask, Edits};
use settings::{Settings, Unsaved};

/// A change that is not saved is kept elsewhere after so long.
const AUTOSAVE: Duration = Duration::from_secs(5);
/// A rendering that an edit stopped begins again after so long without another.
const RESTART: Duration = Duration::from_millis(200);

/// What a thread reads of files.
enum Read {
    Scene(Box<Session>),
    Model(PathBuf, Assets),
}

/// Files that are being read.
struct Loading {
    what: String,
    watch: Arc<Watch>,
    read: Receiver<Result<Read>>,
}

/// The editor's window.
pub struct Editor {
    session: Session,
    settings: Settings,
    worker: Worker,
    viewport: Option<Arc<Mutex<Viewport>>>,
    /// Whether the viewport still makes what it draws of large meshes.
    is_preparing: Arc<AtomicBool>,
    /// Why the scene is not seen while it is edited.
    no_view: Option<String>,
    tool: Tool,
    grid: bool,
    wireframe: bool,
    overlay: Option<Overlay>,
    /// A rendering that begins again once edits rest: its part of the picture, and when.
    restart: Option<(Option<Crop>, Instant)>,
    region_mode: bool,
    explain_mode: bool,
    drag: Option<Drag>,
    /// Counts drags.
    movements: u64,
    pick: Option<(DVec2, bool)>,
    tree: Option<tree::Tree>,
    memory: properties::Memory,
    dialog: Option<Dialog>,
    loading: Option<Loading>,
    message: Option<(String, bool)>,
    shows_keys: bool,
    shows_about: bool,
    last_render: Option<(Duration, u64)>,
    changed_at: Instant,
    seen_revision: u64,
    kept_revision: u64,
    may_close: bool,
    times: FrameTimes,
    title: String,
    /// Kept as long as the window is open.
    claim: Option<settings::Claim>,
}

impl Editor {
    /// A window's content for a session. `wake` is called when there is something new to show.
    ///
    /// # Errors
    /// When there is no thread to be had.
    pub fn new(session: Session, settings: Settings, wake: impl Fn() + Send + Sync + 'static) -> Result<Self> {
        let revision = session.revision();
        Ok(Self {
            session,
            settings,
            worker: Worker::new(wake)?,
            viewport: None,
            is_preparing: Arc::default(),
            no_view: Some("no OpenGL".into()),
            tool: Tool::Select,
            grid: true,
            wireframe: false,
            overlay: None,
            restart: None,
            region_mode: false,
            explain_mode: false,
            drag: None,
            movements: canvas::NAVIGATION,
            pick: None,
            tree: None,
            memory: properties::Memory::default(),
            dialog: None,
            loading: None,
            message: None,
            shows_keys: false,
            shows_about: false,
            last_render: None,
            changed_at: Instant::now(),
            seen_revision: revision,
            kept_revision: revision,
            may_close: false,
            times: FrameTimes::default(),
            title: String::new(),
            claim: None,
        })
    }

    /// The scene that is edited.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// The scene that is edited, to be changed.
    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Whether a picture is being rendered.
    pub fn is_rendering(&self) -> bool {
        self.worker.rendering().is_some() || self.restart.is_some()
    }

    /// The finished picture, if one is shown.
    pub fn picture(&self) -> Option<&crate::render::Film> {
        self.overlay.as_ref()?.film.as_deref()
    }

    /// Uses OpenGL to show the scene.
    fn attach(&mut self, gl: Option<&Arc<glow::Context>>) {
        let made = gl.map(|gl| Viewport::new(Arc::clone(gl)));
        match made {
            Some(Ok(viewport)) => (self.viewport, self.no_view) = (Some(Arc::new(Mutex::new(viewport))), None),
            Some(Err(error)) => self.no_view = Some(error.to_string()),
            None => self.no_view = Some("the window has no OpenGL".into()),
        }
    }

    fn tell(&mut self, text: impl Into<String>) {
        self.message = Some((text.into(), false));
    }

    fn tell_error(&mut self, error: &Error) {
        if error.fault() != Fault::Cancelled {
            self.message = Some((error.to_string(), true));
        }
    }

    /// Changes the scene, or tells why that cannot be.
    fn apply(&mut self, command: &Command) {
        match self.session.apply(command) {
            Ok(()) => self.message = None,
            Err(error) => self.tell_error(&error),
        }
    }

    fn apply_moving(&mut self, command: &Command, movement: u64) {
        match self.session.apply_instead(command, movement) {
            Ok(()) => self.message = None,
            Err(error) => self.tell_error(&error),
        }
    }

    fn select(&mut self, item: Item, beside: bool) {
        if beside { self.session.toggle(item) } else { self.session.select([item]) }
    }

    fn look(&mut self, looking: Looking) {
        if let Err(error) = self.session.set_camera(looking.camera(), Some(canvas::NAVIGATION)) {
            self.tell_error(&error);
        }
    }

    /// Begins to render the picture or a part of it.
    fn render(&mut self, ctx: &Context, crop: Option<Crop>) {
        let (revision, scene) = (self.session.revision(), Arc::clone(self.session.scene()));
        let size = (scene.film.width, scene.film.height);
        let area = crop.unwrap_or(Crop { x0: 0, y0: 0, x1: size.0, y1: size.1 });
        self.overlay = Some(Overlay::new(ctx, size, area));
        self.restart = None;
        self.tree = None;
        self.message = None;
        self.worker.render(revision, &scene, crop);
    }

    /// Takes in what threads have done since.
    fn receive(&mut self, ctx: &Context) {
        while let Some(event) = self.worker.poll() {
            match event {
                Event::Built { .. } => {}
                Event::Tile { area, pixels } => {
                    if let Some(overlay) = &mut self.overlay {
                        overlay.put(area, &pixels);
                    }
                }
                Event::Rendered(film) => {
                    self.last_render = Some((Duration::from_secs_f64(film.stats.seconds), film.stats.rays.total()));
                    if let Some(overlay) = self.overlay.as_mut().filter(|_| film.complete) {
                        overlay.film = Some(film);
                    }
                }
                Event::Failed(error) => {
                    self.overlay = None;
                    self.tell_error(&error);
                }
            }
        }
        let read = self.loading.as_ref().map(|loading| loading.read.try_recv());
        match read {
            Some(Ok(read)) => {
                self.loading = None;
                match read {
                    Ok(Read::Scene(session)) => self.show_session(*session),
                    Ok(Read::Model(path, assets)) => self.add_model(&path, assets),
                    Err(error) => self.tell_error(&error),
                }
            }
            Some(Err(TryRecvError::Disconnected)) => self.loading = None,
            Some(Err(TryRecvError::Empty)) => ctx.request_repaint_after(Duration::from_millis(100)),
            None => {}
        }
    }

    /// Follows changes of the scene: pictures of what it was go, renderings begin again, it can be asked again for hits.
    fn follow(&mut self, ctx: &Context) {
        let revision = self.session.revision();
        if revision != self.seen_revision {
            self.seen_revision = revision;
            self.changed_at = Instant::now();
            self.tree = None;
            let area = self.overlay.take().map(|overlay| (overlay.area, overlay.film.is_none()));
            if let Some((area, true)) = area {
                let film = self.session.scene().film;
                let is_whole = area == Crop { x0: 0, y0: 0, x1: film.width, y1: film.height };
                let fits = area.x1 <= film.width && area.y1 <= film.height;
                self.restart = Some(((!is_whole && fits).then_some(area), Instant::now() + RESTART));
            } else if let Some((_, when)) = &mut self.restart {
                *when = Instant::now() + RESTART;
            }
            self.worker.cancel();
        }
        if let Some((crop, when)) = self.restart {
            match when.checked_duration_since(Instant::now()) {
                Some(left) if !left.is_zero() => ctx.request_repaint_after(left),
                _ => self.render(ctx, crop),
            }
        }
        if self.drag.is_none() && self.restart.is_none() && self.worker.rendering().is_none() {
            let scene = Arc::clone(self.session.scene());
            self.worker.build(revision, &scene);
        }
        self.keep(ctx);
    }

    /// Keeps what is not saved, in case the editor ends.
    fn keep(&mut self, ctx: &Context) {
        let revision = self.session.revision();
        if revision == self.kept_revision || !self.session.is_changed() {
            return;
        }
        let waited = self.changed_at.elapsed();
        if waited < AUTOSAVE {
            ctx.request_repaint_after(AUTOSAVE - waited);
            return;
        }
        self.kept_revision = revision;
        let unsaved = Unsaved {
            path: self.session.path().map(Path::to_path_buf),
            place: std::path::absolute(self.session.suggested_path()).unwrap_or_default(),
            text: self.session.text().to_owned(),
        };
        if let Err(error) = self.settings.keep(&unsaved) {
            self.tell_error(&error);
        }
    }

    /// Reads files on a thread.
    fn load(&mut self, ctx: &Context, what: String, work: impl FnOnce(&Watch) -> Result<Read> + Send + 'static) {
        let watch = Arc::new(Watch::default());
        let (send, read) = channel();
        let (progress, ctx) = (Arc::clone(&watch), ctx.clone());
        std::thread::spawn(move || {
            // The window may have gone on without it.
            let _ = send.send(work(&progress));
            ctx.request_repaint();
        });
        self.loading = Some(Loading { what, watch, read });
    }

    fn open(&mut self, ctx: &Context, path: &Path) {
        let (path, options) = (path.to_path_buf(), LoadOptions::default());
        let what = format!("Opening {}", path.display());
        self.load(ctx, what, move |watch| {
            Session::open(&path, &options, watch).map(|session| Read::Scene(Box::new(session)))
        });
    }

    fn import(&mut self, ctx: &Context, path: &Path) {
        let (path, options) = (path.to_path_buf(), self.session.options().clone());
        let what = format!("Reading {}", path.display());
        self.load(ctx, what, move |watch| {
            let mut assets = Assets::default();
            assets.model(&path, &options, watch)?;
            Ok(Read::Model(path, assets))
        });
    }

    fn show_session(&mut self, session: Session) {
        self.worker.cancel();
        self.settings.forget_unsaved();
        if let Some(path) = session.path() {
            self.settings.note(path);
        }
        let revision = self.session.revision().wrapping_add(1);
        self.session = session;
        // Revisions go on, so that nothing of the scene before is taken for this one's.
        self.session.begin_at(revision);
        (self.overlay, self.restart, self.tree) = (None, None, None);
        (self.seen_revision, self.kept_revision) = (revision, revision);
        self.message = None;
    }

    fn add_model(&mut self, path: &Path, assets: Assets) {
        self.session.adopt(assets);
        let name = path.file_stem().map_or_else(|| "model".into(), |stem| stem.to_string_lossy().into_owned());
        let name = self.session.document().free_name(crate::editor::Kind::Object, &name);
        let fields = vec![("name".to_owned(), name.into()), ("mesh".to_owned(), self.session.relative(path).into())];
        self.apply(&Command::Add { kind: crate::editor::Kind::Object, fields });
    }

    /// Draws the scene as it is edited into the view.
    fn paint_scene(&self, painter: &egui::Painter, frame: &canvas::Frame) {
        let Some(viewport) = &self.viewport else {
            let why = self.no_view.as_deref().unwrap_or_default();
            let text = format!("The scene cannot be shown while it is edited: {why}.\nRendering works (F5).");
            let font = egui::FontId::proportional(15.0);
            painter.text(frame.rect.center(), egui::Align2::CENTER_CENTER, text, font, egui::Color32::GRAY);
            return;
        };
        let selected: Vec<u32> = self
            .session
            .selection()
            .iter()
            .filter(|item| item.kind == crate::editor::Kind::Object)
            .flat_map(|item| self.session.instances(item.index))
            .map(|number| number as u32)
            .collect();
        let moving = self.drag.is_some() && !matches!(self.drag, Some(Drag::Region(_)))
            || self.changed_at.elapsed() < Duration::from_millis(150);
        let options = Options { moving, grid: self.grid, wireframe: self.wireframe, selected };
        if moving {
            // The full mesh follows once the view rests.
            painter.ctx().request_repaint_after(Duration::from_millis(160));
        }
        let (viewport, scene, size) = (Arc::clone(viewport), Arc::clone(self.session.scene()), frame.pixels());
        let (is_preparing, ctx) = (Arc::clone(&self.is_preparing), painter.ctx().clone());
        let draw = move |info: egui::PaintCallbackInfo, _: &egui_glow::Painter| {
            let mut viewport = viewport.lock().unwrap_or_else(PoisonError::into_inner);
            let at = info.viewport_in_pixels();
            // A camera that sees nothing shows nothing; the panels tell.
            if let Ok(stats) = viewport.draw(&scene, scene.camera(), size, &options) {
                if is_preparing.swap(!stats.is_whole, Ordering::Relaxed) || !stats.is_whole {
                    ctx.request_repaint_after(Duration::from_millis(30));
                }
                viewport.blit([at.left_px, at.from_bottom_px, at.width_px, at.height_px]);
            }
        };
        let callback = Arc::new(egui_glow::CallbackFn::new(draw));
        painter.add(egui::PaintCallback { rect: frame.rect, callback });
        if self.is_preparing.load(Ordering::Relaxed) {
            let font = egui::FontId::proportional(15.0);
            let text = painter.layout_no_wrap("Preparing the view".into(), font, egui::Color32::WHITE);
            let place = egui::Align2::CENTER_CENTER.anchor_size(frame.rect.center(), text.size());
            painter.rect_filled(place.expand(8.0), 4.0, egui::Color32::from_black_alpha(160));
            painter.galley(place.min, text, egui::Color32::WHITE);
        }
    }

    /// Everything in the window.
    pub fn show(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.receive(&ctx);
        self.follow(&ctx);
        self.dropped(&ctx);
        self.call_keys(&ctx);
        let mut edits = Edits::default();
        egui::Panel::top("menus").show(ui, |ui| menus::bar(ui, self, &mut edits));
        egui::Panel::top("toolbar").show(ui, |ui| menus::toolbar(ui, self, &mut edits));
        egui::Panel::bottom("status").show(ui, |ui| menus::status(ui, self, &mut edits));
        egui::Panel::left("list").default_size(190.0).show(ui, |ui| outliner::show(ui, &self.session, &mut edits));
        egui::Panel::right("fields").default_size(310.0).show(ui, |ui| {
            properties::show(ui, &self.session, &mut edits, &mut self.memory);
        });
        egui::CentralPanel::no_frame().show(ui, |ui| canvas::show(ui, self));
        menus::windows(&ctx, self);
        if self.tree.as_ref().is_some_and(|tree| !tree.show(&ctx)) {
            self.tree = None;
        }
        self.carry_out(&ctx, edits);
        self.answer(&ctx);
        self.close(&ctx);
        if self.worker.is_busy() {
            ctx.request_repaint_after(Duration::from_millis(50));
        }
        // What a mouse or a key went on with ends when it is let go.
        if self.drag.is_none() && ctx.input(|input| input.pointer.any_released()) {
            self.session.end_movement();
        }
    }

    /// Files that were dropped on the window.
    fn dropped(&mut self, ctx: &Context) {
        let files = ctx.input(|input| input.raw.dropped_files.clone());
        for path in files.iter().map(|file| file.path().to_path_buf()) {
            self.take_file(ctx, &path);
        }
    }

    fn carry_out(&mut self, ctx: &Context, edits: Edits) {
        for ask in edits.list {
            match ask {
                Ask::Do(command) => {
                    self.session.end_movement();
                    self.apply(&command);
                }
                Ask::Move(command, movement) => self.apply_moving(&command, movement),
                Ask::Select(item, beside) => self.select(item, beside),
                Ask::Act(action) => self.act(ctx, action),
                Ask::ChooseTexture(item) => self.ask_path(dialogs::Purpose::Texture(vec![item])),
                Ask::Camera(index) => {
                    if let Err(error) = self.session.choose_camera(index) {
                        self.tell_error(&error);
                    }
                }
            }
        }
    }

    fn answer(&mut self, ctx: &Context) {
        let Some(answer) = self.dialog.as_mut().and_then(|dialog| dialog.show(ctx)) else { return };
        self.dialog = None;
        match answer {
            Answer::Cancel => {}
            Answer::Path(purpose, path) => self.take_path(ctx, &purpose, &path),
            Answer::Recover(unsaved) => self.recover(&unsaved),
            Answer::Discard(after) => self.go_on(ctx, after),
            Answer::Save(after) => {
                if self.session.path().is_none() {
                    self.ask_path(dialogs::Purpose::SaveAs);
                } else if self.save() {
                    self.go_on(ctx, after);
                }
            }
        }
    }

    fn recover(&mut self, unsaved: &Unsaved) {
        let (path, place) = (unsaved.path.clone(), unsaved.place.clone());
        let session = Session::of_text(&unsaved.text, path, place, LoadOptions::default(), &crate::progress::Silent);
        match session {
            Ok(mut session) => {
                session.mark_unsaved();
                self.show_session(session);
            }
            Err(error) => self.tell_error(&error),
        }
    }

    /// Asks before the window closes over changes.
    fn close(&mut self, ctx: &Context) {
        if !ctx.input(|input| input.viewport().close_requested()) || self.may_close {
            return;
        }
        if self.session.is_changed() {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.dialog.get_or_insert(Dialog::Changes(dialogs::After::Quit));
        } else {
            self.settings.forget_unsaved();
        }
    }
}

/// How far apart frames begin while a picture is rendered, where the variable `WHITTED_EDITOR_TIMES` asks for it. At least every
/// 50 ms one is due: what is more is how long input waits.
#[derive(Default)]
struct FrameTimes {
    last: Option<Instant>,
    apart: Vec<Duration>,
}

impl FrameTimes {
    /// A frame begins.
    fn note(&mut self, is_rendering: bool) {
        let before = std::mem::replace(&mut self.last, is_rendering.then(Instant::now));
        if std::env::var_os("WHITTED_EDITOR_TIMES").is_some() {
            self.apart.extend(before.filter(|_| is_rendering).map(|before| before.elapsed()));
        }
    }

    /// Tells it on standard error.
    fn tell(&mut self) {
        self.apart.sort_unstable();
        if let [.., longest] = self.apart.as_slice() {
            let (count, middle) = (self.apart.len(), self.apart[self.apart.len() / 2]);
            eprintln!("{count} frames while rendering, {middle:.1?} apart in the median, {longest:.1?} at most");
        }
    }
}

impl eframe::App for Editor {
    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        self.times.note(self.worker.rendering().is_some());
        self.show(ui);
        let rendered = self.worker.rendering().map(|(_, part, _)| part);
        let title = perform::window_title(&self.session, rendered);
        // Each command makes another frame.
        if title != self.title {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    fn on_exit(&mut self, _gl: Option<&glow::Context>) {
        self.times.tell();
        if let Some(viewport) = self.viewport.take().and_then(Arc::into_inner) {
            viewport.into_inner().unwrap_or_else(PoisonError::into_inner).destroy();
        }
    }
}

/// Opens the window and returns when it is closed.
///
/// # Errors
/// Those of reading the input; a system's error where there is no window system or no OpenGL.
pub fn run(input: Option<&Path>, options: &LoadOptions) -> Result<()> {
    let mut settings = Settings::load();
    let session = match input {
        Some(path) => Session::open(path, options, &crate::progress::Silent)?,
        None => Session::new(Path::new(""))?,
    };
    if let Some(path) = session.path() {
        settings.note(path);
    }
    let viewport = egui::ViewportBuilder::default()
        .with_title(perform::window_title(&session, None))
        .with_app_id("whitted")
        .with_inner_size([1280.0, 800.0])
        .with_min_inner_size([640.0, 400.0]);
    let native = eframe::NativeOptions { viewport, renderer: eframe::Renderer::Glow, ..Default::default() };
    let create = move |context: &eframe::CreationContext<'_>| {
        let ctx = context.egui_ctx.clone();
        let wake = ctx.clone();
        let mut editor = Editor::new(session, settings, move || wake.request_repaint())?;
        editor.attach(context.gl.as_ref());
        editor.use_theme(&ctx);
        editor.claim = editor.settings.claim();
        if let Some(unsaved) = editor.settings.take_left_over() {
            editor.dialog = Some(Dialog::Recover(unsaved));
        }
        Ok(Box::new(editor) as Box<dyn eframe::App>)
    };
    eframe::run_native("whitted", native, Box::new(create)).map_err(|cause| {
        Error::new(Fault::System, format!("the window cannot be opened: {cause}"))
            .remedy("the editor needs a window system with OpenGL 3.3 or OpenGL ES 3.0; `whitted render` needs neither")
    })
}
