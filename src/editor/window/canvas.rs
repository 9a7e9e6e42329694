//! The view in the middle: the scene as it is edited, and the picture over it as it is rendered.

use std::sync::Arc;

use eframe::egui::{self, Color32, PointerButton, Pos2, Rect, Sense, Stroke, TextureOptions, Ui, Vec2};
use glam::{DVec2, DVec3};

use super::Editor;
use super::actions::Action;
use crate::editor::gizmo::{Gizmo, Handle, Tool};
use crate::editor::navigate::Looking;
use crate::editor::viewport::camera::View;
use crate::editor::{Command, Item, Kind};
use crate::geometry::Ray;
use crate::render::{Crop, Film};
use crate::scene::LightKind;

/// The movement that all navigation belongs to, so that undo takes a whole walk back at once.
pub const NAVIGATION: u64 = 1;

/// A picture over the view.
pub struct Overlay {
    /// The part of the picture that is rendered.
    pub area: Crop,
    /// What is there so far.
    texture: egui::TextureHandle,
    /// Pixels of the picture along a side of one of the texture's.
    step: u32,
    /// The picture, once it is finished.
    pub film: Option<Box<Film>>,
}

impl Overlay {
    /// An empty one, for a picture of a size.
    pub fn new(ctx: &egui::Context, size: (u32, u32), area: Crop) -> Self {
        let most = ctx.input(|input| input.max_texture_side).max(1) as u32;
        let step = size.0.max(size.1).div_ceil(most).max(1);
        let side = |pixels: u32| pixels.div_ceil(step) as usize;
        let image = egui::ColorImage::filled([side(size.0), side(size.1)], Color32::TRANSPARENT);
        let texture = ctx.load_texture("picture", image, TextureOptions::LINEAR);
        Self { area, texture, step, film: None }
    }

    /// Shows a tile.
    pub fn put(&mut self, area: Crop, pixels: &[[u8; 4]]) {
        let step = self.step;
        let first = |start: u32| start.div_ceil(step) * step;
        let columns: Vec<u32> = (first(area.x0)..area.x1).step_by(step as usize).collect();
        let rows: Vec<u32> = (first(area.y0)..area.y1).step_by(step as usize).collect();
        let (Some(x), Some(y)) = (columns.first(), rows.first()) else { return };
        let width = area.x1 - area.x0;
        let at = |x: u32, y: u32| {
            let [r, g, b, a] = pixels[((y - area.y0) * width + (x - area.x0)) as usize];
            Color32::from_rgba_unmultiplied(r, g, b, a)
        };
        let colors = rows.iter().flat_map(|&y| columns.iter().map(move |&x| (x, y))).map(|(x, y)| at(x, y)).collect();
        let image = egui::ColorImage::new([columns.len(), rows.len()], colors);
        self.texture.set_partial([(x / step) as usize, (y / step) as usize], image, TextureOptions::LINEAR);
    }
}

/// What is being dragged in the view. There is one at most, so that its size is of no interest.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, Copy)]
pub enum Drag {
    /// A handle, from where in the picture it was taken.
    Handle {
        /// Which.
        handle: Handle,
        /// Pixels of the picture.
        from: DVec2,
        /// As it was.
        gizmo: Gizmo,
        /// What one undo takes back.
        movement: u64,
    },
    /// Turns, shifts or comes nearer.
    Orbit,
    /// Shifts.
    Pan,
    /// Turns the head.
    Look,
    /// A rectangle to render, from a place of the window.
    Region(Pos2),
}

/// Where the picture is in the window.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// In points of the window.
    pub rect: Rect,
    /// Pixels of the screen to a point.
    pub scale: f32,
    /// Size of the picture.
    pub film: (u32, u32),
}

impl Frame {
    /// As large as can be.
    fn within(space: Rect, film: (u32, u32), scale: f32) -> Self {
        let size = Vec2::new(film.0 as f32, film.1 as f32);
        let factor = (space.width() / size.x).min(space.height() / size.y).max(0.0);
        Self { rect: Rect::from_center_size(space.center(), size * factor), scale, film }
    }

    /// Its size on the screen, in pixels.
    pub fn pixels(&self) -> (u32, u32) {
        let side = |points: f32| ((points * self.scale).round() as u32).max(1);
        (side(self.rect.width()), side(self.rect.height()))
    }

    /// A place of the window, in pixels of the screen from the picture's corner.
    fn on_screen(&self, place: Pos2) -> DVec2 {
        let offset = (place - self.rect.min) * self.scale;
        DVec2::new(offset.x.into(), offset.y.into())
    }

    fn in_window(&self, place: DVec2) -> Pos2 {
        self.rect.min + Vec2::new(place.x as f32, place.y as f32) / self.scale
    }

    /// A place of the window, in pixels of the picture.
    fn in_film(&self, place: Pos2) -> DVec2 {
        let share = (place - self.rect.min) / self.rect.size();
        DVec2::new(f64::from(share.x) * f64::from(self.film.0), f64::from(share.y) * f64::from(self.film.1))
    }

    /// The pixels of the picture that a rectangle of the window touches.
    fn crop(&self, a: Pos2, b: Pos2) -> Option<Crop> {
        let (min, max) = (self.in_film(a.min(b)), self.in_film(a.max(b)));
        let low = |value: f64, most: u32| value.floor().clamp(0.0, f64::from(most)) as u32;
        let high = |value: f64, most: u32| value.ceil().clamp(0.0, f64::from(most)) as u32;
        let (width, height) = self.film;
        let crop =
            Crop { x0: low(min.x, width), y0: low(min.y, height), x1: high(max.x, width), y1: high(max.y, height) };
        (crop.x0 < crop.x1 && crop.y0 < crop.y1).then_some(crop)
    }
}

/// Shows the view and does what is asked for in it.
pub fn show(ui: &mut Ui, editor: &mut Editor) {
    let (space, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    let film = editor.session.scene().film;
    let frame = Frame::within(space, (film.width, film.height), ui.ctx().pixels_per_point());
    let Ok(view) = View::new(editor.session.scene().camera(), frame.pixels().0, frame.pixels().1) else { return };
    let gizmo = gizmo(editor, view, frame.scale);

    navigate(ui, editor, &response, &frame, gizmo.as_ref());
    keys(ui, editor, &response);
    if response.clicked()
        && let Some(place) = response.interact_pointer_pos()
    {
        click(ui, editor, &frame, &view, place);
    }
    pick_later(editor);
    paint(ui, editor, space, &frame, &view, gizmo.as_ref());
}

/// The handles at the middle of what is selected.
fn gizmo(editor: &Editor, view: View, scale: f32) -> Option<Gizmo> {
    if editor.tool == Tool::Select {
        return None;
    }
    let session = &editor.session;
    let scene = session.scene();
    let mut places = Vec::new();
    for item in session.selection() {
        match item.kind {
            Kind::Object => match session.extent(std::iter::once(item.index)) {
                Some((min, max)) => places.push(min + (max - min) * 0.5),
                None => places
                    .extend(session.instances(item.index).map(|number| scene.objects[number].transform.translation)),
            },
            Kind::Light => {
                places.extend(scene.lights.get(item.index).and_then(|light| light_place(editor, &light.kind)))
            }
            _ => {}
        }
    }
    let count = places.len() as f64;
    let sum = places.into_iter().reduce(|a, b| a + b)?;
    Some(Gizmo { tool: editor.tool, pivot: sum / count, view, pixels_per_point: scale.into() })
}

/// Where a light's sign is shown: one far away is shown beside what the camera looks at.
fn light_place(editor: &Editor, kind: &LightKind) -> Option<DVec3> {
    match *kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } => Some(position),
        LightKind::Directional { direction } => {
            let looking = Looking::of(editor.session.scene().camera());
            let back = crate::math::vector::normalize(-direction)?;
            Some(looking.target + back * (0.35 * looking.height()))
        }
    }
}

/// Turning, shifting, coming nearer; handles; the rectangle to render.
fn navigate(ui: &Ui, editor: &mut Editor, response: &egui::Response, frame: &Frame, gizmo: Option<&Gizmo>) {
    let modifiers = ui.input(|input| input.modifiers);
    if response.drag_started()
        && let Some(place) = ui.input(|input| input.pointer.press_origin())
    {
        let handle = gizmo.and_then(|gizmo| Some((gizmo.pick(frame.on_screen(place))?, *gizmo)));
        let left = response.drag_started_by(PointerButton::Primary);
        editor.drag = Some(if left && editor.region_mode {
            Drag::Region(place)
        } else if let (true, Some((handle, gizmo))) = (left, handle) {
            editor.movements += 1;
            Drag::Handle { handle, from: frame.on_screen(place), gizmo, movement: editor.movements }
        } else if response.drag_started_by(PointerButton::Secondary) || modifiers.shift {
            Drag::Pan
        } else if modifiers.alt {
            Drag::Look
        } else {
            Drag::Orbit
        });
    }
    let delta = response.drag_delta();
    let mut looking = Looking::of(editor.session.scene().camera());
    let before = looking;
    let (right, up) = (f64::from(delta.x), f64::from(delta.y));
    // A drag across the picture's height turns by half a circle.
    let turn = std::f64::consts::PI / f64::from(frame.rect.height().max(1.0));
    match editor.drag {
        Some(Drag::Orbit) => looking.orbit(right * turn, up * turn),
        Some(Drag::Look) => looking.look(-right * 0.5 * turn, up * 0.5 * turn),
        Some(Drag::Pan) => {
            let height = f64::from(frame.rect.height().max(1.0));
            looking.pan(-right / height, up / height);
        }
        Some(Drag::Handle { handle, from, gizmo, movement }) if delta != Vec2::ZERO => {
            if let Some(place) = response.interact_pointer_pos() {
                let by = gizmo.drag(handle, from, frame.on_screen(place), modifiers.command);
                let items = movable(editor);
                editor.apply_moving(&Command::moving(items, &by), movement);
            }
        }
        _ => {}
    }
    if response.drag_stopped() {
        if let (Some(Drag::Region(from)), Some(to)) = (editor.drag, response.interact_pointer_pos()) {
            editor.region_mode = false;
            if let Some(crop) = frame.crop(from, to) {
                editor.render(ui.ctx(), Some(crop));
            }
        }
        editor.drag = None;
        editor.session.end_movement();
    }
    if response.hovered() {
        let (scroll, zoom) =
            ui.input(|input| (f64::from(input.smooth_scroll_delta().y), f64::from(input.zoom_delta())));
        if scroll != 0.0 || zoom != 1.0 {
            looking.dolly(libm::exp(-scroll * 0.003) / zoom);
        }
    }
    if looking != before {
        editor.look(looking);
    }
}

/// What handles move.
fn movable(editor: &Editor) -> Vec<Item> {
    let is_movable = |item: &&Item| matches!(item.kind, Kind::Object | Kind::Light);
    editor.session.selection().iter().filter(is_movable).copied().collect()
}

/// Navigation without the mouse: arrows turn, with Shift they shift, with Ctrl they fly; + and - come nearer and go away.
fn keys(ui: &Ui, editor: &mut Editor, response: &egui::Response) {
    use egui::Key;
    if ui.ctx().egui_wants_keyboard_input() || editor.dialog.is_some() {
        return;
    }
    let _ = response;
    let mut looking = Looking::of(editor.session.scene().camera());
    let before = looking;
    ui.input(|input| {
        let pressed = |key: Key| f64::from(u8::from(input.key_pressed(key)));
        let right = pressed(Key::ArrowRight) - pressed(Key::ArrowLeft);
        let up = pressed(Key::ArrowUp) - pressed(Key::ArrowDown);
        if right != 0.0 || up != 0.0 {
            if input.modifiers.shift {
                looking.pan(right * 0.05, up * 0.05);
            } else if input.modifiers.command {
                looking.fly(DVec3::new(right, 0.0, up) * 0.05);
            } else {
                looking.orbit(-right * 0.1, up * 0.1);
            }
        }
        let nearer = pressed(Key::Plus) + pressed(Key::Equals) - pressed(Key::Minus);
        if nearer != 0.0 {
            looking.dolly(libm::exp(-0.15 * nearer));
        }
    });
    if looking != before {
        editor.look(looking);
    }
}

fn click(ui: &Ui, editor: &mut Editor, frame: &Frame, view: &View, place: Pos2) {
    if editor.explain_mode {
        explain(editor, frame, place);
        return;
    }
    let beside = ui.input(|input| input.modifiers.command || input.modifiers.shift);
    let at = frame.on_screen(place);
    let scene = std::sync::Arc::clone(editor.session.scene());
    if !editor.session.reading().imports_lights {
        for (index, light) in scene.lights.iter().enumerate() {
            let near = light_place(editor, &light.kind).and_then(|place| view.project(place)).is_some_and(|shown| {
                let off = DVec2::new(shown.x, shown.y) - at;
                off.abs().max_element() < 10.0 * f64::from(frame.scale)
            });
            if near {
                editor.select(Item::light(index), beside);
                return;
            }
        }
    }
    editor.pick = Some((frame.in_film(place), beside));
}

/// Asks the scene what the pointer is on, once it can be asked.
fn pick_later(editor: &mut Editor) {
    let Some((place, beside)) = editor.pick else { return };
    let revision = editor.session.revision();
    let Some(renderer) = editor.worker.renderer(revision).map(Arc::clone) else { return };
    editor.pick = None;
    let scene = editor.session.scene();
    let rays = scene.camera().rays(scene.film.width, scene.film.height, scene.origin);
    let Some(view) = rays.ok().and_then(|rays| rays.ray(place)) else { return };
    let hit = renderer.closest(&Ray::new(view.origin.as_vec3(), view.direction.as_vec3()));
    let entry = hit.is_hit().then(|| editor.session.reading().entries[hit.instance as usize] as usize);
    match entry {
        Some(entry) => editor.select(Item::object(entry), beside),
        None if !beside => editor.session.select([]),
        None => {}
    }
}

fn explain(editor: &mut Editor, frame: &Frame, place: Pos2) {
    let pixel = frame.in_film(place).floor();
    let is_inside = pixel.cmpge(DVec2::ZERO).all() && pixel.x < frame.film.0.into() && pixel.y < frame.film.1.into();
    let revision = editor.session.revision();
    let Some(renderer) = editor.worker.renderer(revision).filter(|_| is_inside) else { return };
    match super::tree::Tree::new(renderer, (pixel.x as u32, pixel.y as u32)) {
        Ok(tree) => editor.tree = Some(tree),
        Err(error) => editor.tell_error(&error),
    }
}

fn paint(ui: &Ui, editor: &mut Editor, space: Rect, frame: &Frame, view: &View, gizmo: Option<&Gizmo>) {
    let painter = ui.painter().with_clip_rect(space);
    painter.rect_filled(space, 0.0, ui.visuals().extreme_bg_color);
    let is_covered = editor.overlay.as_ref().is_some_and(|overlay| {
        let whole = Crop { x0: 0, y0: 0, x1: frame.film.0, y1: frame.film.1 };
        overlay.film.is_some() && overlay.area == whole
    });
    if !is_covered {
        editor.paint_scene(&painter, frame);
    }
    if let Some(overlay) = &editor.overlay {
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        painter.image(overlay.texture.id(), frame.rect, whole, Color32::WHITE);
    }
    if editor.overlay.is_none() {
        lights(editor, &painter, frame, view);
    }
    if let Some(gizmo) = gizmo.filter(|_| editor.overlay.is_none()) {
        handles(editor, &painter, frame, gizmo, ui.input(|input| input.pointer.hover_pos()));
    }
    if let (Some(Drag::Region(from)), Some(to)) = (editor.drag, ui.input(|input| input.pointer.hover_pos())) {
        let rect = Rect::from_two_pos(from, to).intersect(frame.rect);
        painter.rect_stroke(rect, 0.0, Stroke::new(1.5, Color32::WHITE), egui::StrokeKind::Inside);
        painter.rect_stroke(rect.expand(1.5), 0.0, Stroke::new(1.0, Color32::BLACK), egui::StrokeKind::Inside);
    }
    if editor.region_mode || editor.explain_mode {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Crosshair);
    }
}

fn lights(editor: &Editor, painter: &egui::Painter, frame: &Frame, view: &View) {
    for (index, light) in editor.session.scene().lights.iter().enumerate() {
        let Some(shown) = light_place(editor, &light.kind).and_then(|place| view.project(place)) else { continue };
        let place = frame.in_window(DVec2::new(shown.x, shown.y));
        let is_selected = editor.session.selection().contains(&Item::light(index));
        let color = if is_selected { Color32::from_rgb(255, 170, 40) } else { Color32::from_rgb(255, 240, 150) };
        painter.circle(place, 5.0, color, Stroke::new(1.0, Color32::BLACK));
        for step in 0..8 {
            let direction = Vec2::angled(step as f32 * std::f32::consts::TAU / 8.0);
            painter.line_segment([place + direction * 7.0, place + direction * 10.0], Stroke::new(1.5, color));
        }
    }
}

fn handles(editor: &Editor, painter: &egui::Painter, frame: &Frame, gizmo: &Gizmo, pointer: Option<Pos2>) {
    let hovered = match editor.drag {
        Some(Drag::Handle { handle, .. }) => Some(handle),
        _ => pointer.and_then(|place| gizmo.pick(frame.on_screen(place))),
    };
    let colors = [Color32::from_rgb(230, 60, 60), Color32::from_rgb(80, 190, 70), Color32::from_rgb(70, 120, 240)];
    for handle in gizmo.handles().into_iter().rev() {
        let color = match handle {
            _ if hovered == Some(handle) => Color32::from_rgb(255, 220, 60),
            Handle::Axis(axis) => colors[axis],
            Handle::Middle => Color32::WHITE,
        };
        let line: Vec<Pos2> = gizmo.line(handle).into_iter().map(|place| frame.in_window(place)).collect();
        if let (Handle::Axis(_), [from, to]) = (handle, line.as_slice()) {
            match gizmo.tool {
                Tool::Scale => {
                    painter.line_segment([*from, *to], Stroke::new(2.5, color));
                    painter.rect_filled(Rect::from_center_size(*to, Vec2::splat(9.0)), 1.0, color);
                }
                _ => painter.arrow(*from, *to - *from, Stroke::new(2.5, color)),
            }
        } else {
            painter.line(line, Stroke::new(2.5, color));
        }
    }
}

/// Whether an action is of use now; others are grey.
pub fn is_of_use(editor: &Editor, action: Action) -> bool {
    match action {
        Action::Undo => editor.session.undo_label().is_some(),
        Action::Redo => editor.session.redo_label().is_some(),
        Action::Duplicate | Action::Delete => !editor.session.selection().is_empty(),
        Action::Hide | Action::FrameSelected | Action::Texture => {
            editor.session.selection().iter().any(|item| item.kind == Kind::Object)
        }
        Action::StopRender => editor.worker.rendering().is_some() || editor.region_mode || editor.explain_mode,
        Action::ClearRender => editor.overlay.is_some(),
        Action::SavePicture => editor.overlay.as_ref().is_some_and(|overlay| overlay.film.is_some()),
        _ => true,
    }
}
