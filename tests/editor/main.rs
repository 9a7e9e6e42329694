//! The editor's panels, without a window: what is clicked and typed, found by its label.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::{self, Key, Modifiers, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use whitted::editor::window::Editor;
use whitted::editor::window::settings::Settings;
use whitted::editor::{Item, Kind, Session};
use whitted::formats::LoadOptions;
use whitted::progress::Silent;

fn harness(session: Session) -> Harness<'static, Editor> {
    let editor = Editor::new(session, Settings::load_from(None), || ()).unwrap();
    let builder = Harness::builder().with_size([1280.0, 800.0]).with_max_steps(40);
    let mut harness = builder.build_ui_state(|ui, editor: &mut Editor| editor.show(ui), editor);
    harness.run_steps(4);
    harness
}

fn new_scene() -> Harness<'static, Editor> {
    harness(Session::new(Path::new("")).unwrap())
}

fn open(name: &str) -> Harness<'static, Editor> {
    let path = PathBuf::from("scenes").join(name);
    harness(Session::open(&path, &LoadOptions::default(), &Silent).unwrap())
}

/// Clicks what has a label.
fn click(harness: &mut Harness<'_, Editor>, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(4);
}

/// Calls an entry of a menu.
fn call(harness: &mut Harness<'_, Editor>, menu: &str, entry: &str) {
    click(harness, menu);
    click(harness, entry);
}

fn press(harness: &mut Harness<'_, Editor>, modifiers: Modifiers, key: Key) {
    harness.key_press_modifiers(modifiers, key);
    harness.run_steps(4);
}

/// Goes on until a condition holds.
fn wait(harness: &mut Harness<'_, Editor>, what: &str, mut done: impl FnMut(&Editor) -> bool) {
    let start = Instant::now();
    while !done(harness.state()) {
        assert!(start.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(10));
        harness.step();
    }
}

#[test]
fn objects_and_lights_are_added_from_the_menu_and_undone_by_keys() {
    let mut harness = new_scene();
    let start = harness.state().session().text().to_owned();
    for (entry, kind) in [("Sphere", Kind::Object), ("Teapot", Kind::Object), ("Spot light", Kind::Light)] {
        let before = harness.state().session().document().count(kind);
        call(&mut harness, "Add", entry);
        let session = harness.state().session();
        assert_eq!(session.document().count(kind), before + 1, "{entry}");
        assert_eq!(session.selection().iter().copied().collect::<Vec<_>>(), [Item::new(kind, before)], "{entry}");
    }
    for _ in 0..3 {
        press(&mut harness, Modifiers::COMMAND, Key::Z);
    }
    assert_eq!(harness.state().session().text(), start);
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(harness.state().session().document().count(Kind::Object), 2);
}

#[test]
fn every_object_of_the_add_menu_can_be_rendered() {
    let mut harness = new_scene();
    for entry in [
        "Sphere",
        "Ellipsoid",
        "Cylinder",
        "Cone",
        "Paraboloid",
        "Hyperboloid, one sheet",
        "Hyperboloid, two sheets",
        "Plane",
        "General quadric",
        "Box",
        "Torus",
        "Teapot",
    ] {
        call(&mut harness, "Add", entry);
    }
    assert_eq!(harness.state().session().document().count(Kind::Object), 13);
    press(&mut harness, Modifiers::NONE, Key::F5);
    wait(&mut harness, "the picture is finished", |editor| editor.picture().is_some());
}

#[test]
fn presets_make_a_material_for_what_is_selected() {
    let mut harness = new_scene();
    call(&mut harness, "Add", "Sphere");
    click(&mut harness, "gold");
    let session = harness.state().session();
    assert_eq!(session.document().string(Item::object(1), "material").as_deref(), Some("gold"));
    let scene = session.scene();
    let material = &scene.materials[scene.objects[1].material.unwrap() as usize];
    assert!(material.kr.x > material.kr.z, "gold mirrors in its colour");
    click(&mut harness, "glass");
    let session = harness.state().session();
    assert_eq!(session.document().count(Kind::Material), 2, "the same material becomes another");
    assert!(session.material(1).unwrap().is_transmissive());
}

#[test]
fn the_list_selects_hides_and_deletes() {
    let mut harness = open("mirrors.toml");
    let name = harness.state().session().document().names(Kind::Material)[0].clone();
    harness.get_all_by_label(&name).next().unwrap().click();
    harness.run_steps(4);
    assert!(harness.state().session().selection().iter().any(|item| item.kind == Kind::Material));
    press(&mut harness, Modifiers::COMMAND, Key::A);
    let count = harness.state().session().document().count(Kind::Object);
    assert_eq!(harness.state().session().selection().len(), count);
    press(&mut harness, Modifiers::NONE, Key::H);
    assert_eq!(harness.state().session().scene().objects.len(), 0);
    press(&mut harness, Modifiers::NONE, Key::H);
    press(&mut harness, Modifiers::NONE, Key::Delete);
    assert_eq!(harness.state().session().document().count(Kind::Object), 0);
}

#[test]
fn a_click_in_the_view_selects_what_is_there_by_the_tracers_own_rays() {
    let mut harness = new_scene();
    call(&mut harness, "Add", "Sphere");
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::A);
    assert!(harness.state().session().selection().is_empty());
    // The middle of the view, between the panels, is where new objects are.
    let place = Pos2::new(585.0, 420.0);
    harness.hover_at(place);
    harness.run_steps(1);
    harness.drag_at(place);
    harness.run_steps(1);
    harness.drop_at(place);
    wait(&mut harness, "the sphere is selected", |editor| editor.session().selection().contains(&Item::object(1)));
}

#[test]
fn a_drag_turns_the_view_and_is_one_step_of_undo() {
    let mut harness = new_scene();
    let before = *harness.state().session().scene().camera();
    let text = harness.state().session().text().to_owned();
    harness.hover_at(Pos2::new(600.0, 300.0));
    harness.run_steps(1);
    harness.drag_at(Pos2::new(600.0, 300.0));
    for step in 1..6 {
        harness.run_steps(1);
        harness.hover_at(Pos2::new(600.0 + 20.0 * step as f32, 300.0));
    }
    harness.run_steps(1);
    harness.drop_at(Pos2::new(700.0, 300.0));
    harness.run_steps(2);
    assert_ne!(*harness.state().session().scene().camera(), before);
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(harness.state().session().text(), text);
}

#[test]
fn the_picture_is_what_the_saved_scene_renders_to_byte_for_byte() {
    let mut harness = new_scene();
    call(&mut harness, "Add", "Torus");
    click(&mut harness, "chrome");
    press(&mut harness, Modifiers::NONE, Key::ArrowLeft);
    press(&mut harness, Modifiers::NONE, Key::F5);
    wait(&mut harness, "the picture is finished", |editor| editor.picture().is_some());
    let folder = tempfile::tempdir().unwrap();
    let (scene, ours, theirs) =
        (folder.path().join("s.toml"), folder.path().join("a.png"), folder.path().join("b.png"));
    whitted::formats::picture::save(harness.state().picture().unwrap(), &ours).unwrap();
    harness.state_mut().session_mut().save_as(&scene).unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_whitted"))
        .args(["render", "--quiet", "-o"])
        .args([&theirs, &scene])
        .status();
    assert!(run.unwrap().success());
    assert!(std::fs::read(ours).unwrap() == std::fs::read(theirs).unwrap());
}

#[test]
fn an_edit_while_rendering_begins_again_and_one_after_it_shows_the_view() {
    let mut harness = new_scene();
    press(&mut harness, Modifiers::NONE, Key::F5);
    press(&mut harness, Modifiers::NONE, Key::ArrowLeft);
    wait(&mut harness, "the picture of the new view is finished", |editor| editor.picture().is_some());
    press(&mut harness, Modifiers::NONE, Key::ArrowLeft);
    assert!(harness.state().picture().is_none());
    press(&mut harness, Modifiers::NONE, Key::F5);
    press(&mut harness, Modifiers::NONE, Key::Escape);
    wait(&mut harness, "it is stopped", |editor| !editor.is_rendering());
    assert!(harness.state().picture().is_none(), "what was stopped is no picture");
}

#[test]
fn paths_are_typed_and_a_scene_is_saved_and_opened_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("typed.toml");
    let mut harness = new_scene();
    call(&mut harness, "Add", "Cone");
    press(&mut harness, Modifiers::COMMAND, Key::S);
    let field = harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "Path");
    field.focus();
    harness.run_steps(2);
    press(&mut harness, Modifiers::COMMAND, Key::A);
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "Path").type_text(path.to_str().unwrap());
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    assert!(!harness.state().session().is_changed());
    let text = harness.state().session().text().to_owned();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    // A change, and a new scene: the editor asks.
    call(&mut harness, "Add", "Box");
    press(&mut harness, Modifiers::COMMAND, Key::N);
    click(&mut harness, "Discard");
    assert_eq!(harness.state().session().document().count(Kind::Object), 1);
    assert_eq!(harness.state().session().path(), None);
}

#[test]
fn an_image_is_chosen_by_its_path_for_what_is_selected() {
    let mut harness = new_scene();
    call(&mut harness, "Add", "Sphere");
    press(&mut harness, Modifiers::NONE, Key::T);
    let image = std::path::absolute("meshes/checker.png").unwrap();
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "Path").focus();
    harness.run_steps(2);
    press(&mut harness, Modifiers::COMMAND, Key::A);
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "Path").type_text(image.to_str().unwrap());
    harness.run_steps(2);
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let session = harness.state().session();
    let material = &session.scene().materials[session.scene().objects[1].material.unwrap() as usize];
    assert!(material.diffuse_texture.is_some(), "{}", session.text());
}

#[test]
fn every_kind_of_light_and_shape_shows_its_fields() {
    let mut harness = open("quadrics.toml");
    for kind in [Kind::Object, Kind::Light, Kind::Material, Kind::Camera] {
        for index in 0..harness.state().session().document().count(kind) {
            harness.state_mut().session_mut().select([Item::new(kind, index)]);
            harness.run_steps(2);
        }
    }
    harness.state_mut().session_mut().select([Item::light(0)]);
    harness.run_steps(2);
    assert!(harness.query_by_label("intensity").is_some());
}
