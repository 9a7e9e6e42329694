//! Sessions without a window.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use proptest::prelude::*;
use toml::Value;

use super::{Command, Item, Kind, Session};
use crate::formats::LoadOptions;
use crate::math::transform::{compose, point, rotation_about};
use crate::progress::Silent;
use crate::scene::{Camera, Projection, Scene};

fn scenes() -> Vec<PathBuf> {
    let names = ["quadrics", "mirrors", "teapot", "textured_crate", "seed_camera", "cornell_box"];
    names.iter().map(|name| Path::new("scenes").join(name).with_extension("toml")).collect()
}

fn open(path: &Path) -> Session {
    Session::open(path, &LoadOptions::default(), &Silent).unwrap()
}

fn session(text: &str) -> Session {
    Session::of_text(text, None, PathBuf::from("s.toml"), LoadOptions::default(), &Silent).unwrap()
}

/// All that decides a picture.
fn assert_same(a: &Scene, b: &Scene) {
    assert_eq!((a.origin, a.ambient, a.film, a.active_camera), (b.origin, b.ambient, b.film, b.active_camera));
    assert!(a.background == b.background);
    assert_eq!(a.lights, b.lights);
    assert_eq!(a.materials, b.materials);
    assert_eq!(a.objects, b.objects);
    assert_eq!(a.quadrics, b.quadrics);
    let cameras = |scene: &Scene| scene.cameras.iter().map(|named| named.camera).collect::<Vec<_>>();
    assert_eq!(cameras(a), cameras(b));
    let meshes = |scene: &Scene| scene.meshes.iter().map(|mesh| mesh.positions.clone()).collect::<Vec<_>>();
    assert_eq!(meshes(a), meshes(b));
    assert_eq!(a.textures.len(), b.textures.len());
}

/// A command, of numbers whose meaning depends on the scene.
fn command(session: &Session, kind: u8, a: usize, b: usize, x: f64) -> Command {
    let document = session.document();
    let pick = |kind: Kind, number: usize| Item::new(kind, number % document.count(kind).max(1));
    let map = DAffine3 {
        matrix3: rotation_about(DVec3::new(0.0, 0.6, 0.8), if a.is_multiple_of(2) { 0.0 } else { x }),
        translation: DVec3::new(x, -x, 0.5),
    };
    let item = pick([Kind::Object, Kind::Light][a % 2], b);
    let shapes = ["sphere", "plane", "cone", "cylinder", "ellipsoid", "saddle"];
    match kind {
        0 => {
            let shape = match shapes[a % shapes.len()] {
                "cone" => ("cone", "base = [0, 0, 0]\napex = [0, 1, 0]"),
                "cylinder" => ("cylinder", "base = [0, 0, 0]\ntop = [0, 1, 0]"),
                "ellipsoid" => ("ellipsoid", "radii = [1, 2, 3]"),
                other => (other, ""),
            };
            let fields: toml::Table = shape.1.parse().unwrap();
            let name = document.free_name(Kind::Object, shape.0);
            let fields = vec![("name".into(), Value::from(name)), (shape.0.into(), Value::Table(fields))];
            Command::Add { kind: Kind::Object, fields }
        }
        1 => {
            let fields = vec![
                ("kind".into(), Value::from("point")),
                ("position".into(), Value::Array(vec![Value::Float(x), Value::Float(1.0), Value::Float(2.0)])),
            ];
            session.adding_light(fields).unwrap()
        }
        2 => {
            let name = document.free_name(Kind::Material, "material");
            Command::All(vec![
                Command::Add { kind: Kind::Material, fields: vec![("name".into(), Value::from(name.clone()))] },
                Command::set(pick(Kind::Object, b), &["material"], name),
            ])
        }
        3 => Command::set(pick(Kind::Material, a), &["diffuse"], x.abs()),
        4 => Command::set(pick(Kind::Material, a), &["kt"], x.abs().min(1.0)),
        5 => Command::Remove(vec![item]),
        6 => Command::Duplicate(vec![item]),
        7 => Command::Rename { item: pick(Kind::Material, a), name: format!("name {}", b % 5) },
        8 => Command::moving(vec![item], &map),
        9 => Command::set(pick(Kind::Object, a), &["visible"], b.is_multiple_of(2)),
        10 => Command::set(Item::only(Kind::Film), &["samples"], (b % 7) as i64),
        11 => Command::set(pick(Kind::Light, a), &["color"], "#4080c0"),
        12 => Command::Remove(vec![pick(Kind::Material, a)]),
        13 => Command::unset(pick(Kind::Object, a), &["material"]),
        14 => Command::set(Item::only(Kind::Scene), &["ambient"], x.abs().min(1.0)),
        _ => Command::set(Item::only(Kind::Background), &["color"], "#123"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn any_commands_are_undone_and_redone_exactly_and_saved_as_they_are(
        file in 0usize..6,
        steps in prop::collection::vec((0u8..16, 0usize..100, 0usize..100, -2.0f64..2.0), 1..25),
    ) {
        let mut session = open(&scenes()[file]);
        let (start, start_scene) = (session.text().to_owned(), session.scene().clone());
        let mut texts = vec![start.clone()];
        for &(kind, a, b, x) in &steps {
            let command = command(&session, kind, a, b, x);
            // As it is written into a log.
            let json = serde_json::to_string(&command).unwrap();
            let command: Command = serde_json::from_str(&json).unwrap();
            let (before, revision) = (session.text().to_owned(), session.revision());
            match session.apply(&command) {
                Err(_) => prop_assert_eq!((session.text(), session.revision()), (before.as_str(), revision)),
                Ok(()) if session.revision() > revision => texts.push(session.text().to_owned()),
                Ok(()) => prop_assert_eq!(session.text(), before.as_str()),
            }
            let read = Session::of_text(session.text(), None, scenes()[file].clone(), LoadOptions::default(), &Silent);
            assert_same(session.scene(), read.unwrap().scene());
        }
        let (end, end_scene) = (session.text().to_owned(), session.scene().clone());
        for expected in texts.iter().rev().skip(1) {
            prop_assert!(session.undo().unwrap());
            prop_assert_eq!(session.text(), expected.as_str());
        }
        prop_assert!(!session.undo().unwrap());
        prop_assert!(!session.is_changed());
        assert_same(session.scene(), &start_scene);
        for expected in &texts[1..] {
            prop_assert!(session.redo().unwrap());
            prop_assert_eq!(session.text(), expected.as_str());
        }
        prop_assert!(!session.redo().unwrap());
        prop_assert_eq!(session.text(), end.as_str());
        assert_same(session.scene(), &end_scene);

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("saved.toml");
        session.save_as(&path).unwrap();
        prop_assert!(!session.is_changed());
        let saved = open(&path);
        prop_assert_eq!(saved.text(), session.text());
        assert_same(saved.scene(), &end_scene);
    }
}

const COMMENTED: &str = "\
# My scene.
[camera] # the only one
eye = [0, 2, 6]   # where I stand
target = [0, 0.8, 0]

[[light]]
kind = \"point\"
position = [3, 5, 4]
color = [1, 1, 1] # white

[[material]]
name = \"red\"
diffuse = \"#c03020\"   # like bricks

[[object]]
# A ball.
sphere = { center = [0, 1, 0], radius = 1 } # round
material = \"red\"
";

/// The lines that differ, of texts with as many.
fn changed_lines<'a>(a: &'a str, b: &'a str) -> Vec<(&'a str, &'a str)> {
    assert_eq!(a.lines().count(), b.lines().count(), "{a}\n{b}");
    a.lines().zip(b.lines()).filter(|(a, b)| a != b).collect()
}

#[test]
fn one_change_is_one_line() {
    let mut session = session(COMMENTED);
    session.apply(&Command::set(Item::light(0), &["color"], "#ff0000")).unwrap();
    assert_eq!(
        changed_lines(COMMENTED, session.text()),
        [("color = [1, 1, 1] # white", "color = \"#ff0000\" # white")]
    );
    session.undo().unwrap();
    session.apply(&Command::set(Item::object(0), &["sphere", "radius"], 2.5)).unwrap();
    let line = "sphere = { center = [0, 1, 0], radius = 2.5 } # round";
    assert_eq!(changed_lines(COMMENTED, session.text())[0].1, line);
    session.undo().unwrap();
    let camera = |x: f64| Camera::LookAt {
        eye: DVec3::new(x, 2.0, 6.0),
        target: DVec3::new(0.0, 0.8, 0.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y: 40f64.to_radians() },
    };
    session.set_camera(camera(1.0), Some(1)).unwrap();
    session.set_camera(camera(2.0), Some(1)).unwrap();
    session.set_camera(camera(3.0), Some(1)).unwrap();
    assert!(session.text().contains("eye = [3.0, 2.0, 6.0]   # where I stand\ntarget = [0, 0.8, 0]\n"));
    assert!(session.undo().unwrap(), "a movement is one step");
    assert_eq!(session.text(), COMMENTED);
    assert!(!session.undo().unwrap());
}

#[test]
fn what_a_scene_file_may_not_say_is_refused_and_changes_nothing() {
    let mut session = session(COMMENTED);
    for (command, message) in [
        (Command::set(Item::object(0), &["sphere", "radius"], -1.0), "must be a number greater than 0"),
        (Command::set(Item::material(0), &["kt"], 2.0), "kr"),
        (Command::Rename { item: Item::object(7), name: "x".into() }, "there is no object 8"),
        (Command::Add { kind: Kind::Film, fields: vec![] }, "only one"),
        (Command::set(Item::object(0), &["material"], "blue"), "there is no [[material]] called `blue`"),
        (Command::moving(vec![Item::object(0)], &DAffine3::from_scale(DVec3::ZERO)), "singular"),
    ] {
        let error = session.apply(&command).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
        assert_eq!(session.text(), COMMENTED);
    }
    assert_eq!(session.undo_label(), None);
}

#[test]
fn a_renamed_material_keeps_its_objects_and_a_removed_one_leaves_them_grey() {
    let mut session = session(COMMENTED);
    session.apply(&Command::Rename { item: Item::material(0), name: "brick".into() }).unwrap();
    assert_eq!(session.document().string(Item::object(0), "material").as_deref(), Some("brick"));
    session.apply(&Command::Remove(vec![Item::material(0)])).unwrap();
    assert_eq!(session.document().string(Item::object(0), "material"), None);
    assert_eq!(session.scene().objects[0].material, Some(0));
    assert!(!session.text().contains("[[material]]"));
}

#[test]
fn copies_are_added_with_names_of_their_own_and_selected() {
    let mut session = session(
        "[[object]]\nsphere = {}\nname = \"ball\"\n[[light]]\nkind = \"directional\"\ndirection = [0, -1, 0]\n",
    );
    session.apply(&Command::Duplicate(vec![Item::object(0), Item::object(0), Item::light(0)])).unwrap();
    assert_eq!(session.document().names(Kind::Object), ["ball", "ball 2", "ball 3"]);
    assert_eq!(session.document().names(Kind::Light), ["", ""]);
    let selected: Vec<Item> = session.selection().iter().copied().collect();
    assert_eq!(selected, [Item::light(1), Item::object(1), Item::object(2)]);
    session.apply(&Command::Remove(selected)).unwrap();
    assert!(session.selection().is_empty());
    session.undo().unwrap();
    assert_eq!(session.selection().len(), 3, "what was selected is again");
}

#[test]
fn objects_move_in_the_scene_whatever_their_transform_is() {
    let transforms = [
        "",
        "transform = { translate = [1, 2, 3] }\n",
        "transform = [{ scale = [1, 2, 3] }, { rotate = [10, 20, 30] }, { translate = [0, 1, 0] }]\n",
        "transform = [{ translate = [1, 0, 0] }, { rotate = { axis = [1, 1, 0], angle = 50 } }, { scale = [1, 2, 1] }]\n",
        "transform = { scale = 2 }\ninstances = [{ rotate = [0, 90, 0] }, { translate = [5, 0, 0] }]\n",
    ];
    let turn =
        DAffine3 { matrix3: rotation_about(DVec3::new(0.36, 0.48, 0.8), 0.7), translation: DVec3::new(-1.0, 0.5, 2.0) };
    for transform in transforms {
        for by in [DAffine3::from_translation(DVec3::new(0.5, -1.0, 0.25)), turn] {
            let mut session = session(&format!("[[object]]\nsphere = {{}}\n{transform}"));
            let before = session.scene().objects[0].transform;
            session.apply(&Command::moving(vec![Item::object(0)], &by)).unwrap();
            let (expected, after) = (compose(&by, &before), session.scene().objects[0].transform);
            for corner in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                let off = (point(&expected, corner) - point(&after, corner)).abs().max_element();
                assert!(off < 1e-13, "{transform} {off}");
            }
        }
    }
    let mut session = session("[[object]]\nsphere = {}\ntransform = { translate = [0.1, 0, 0] }\n");
    let by = DAffine3::from_translation(DVec3::new(0.2, 0.0, 0.0));
    session.apply(&Command::moving(vec![Item::object(0)], &by)).unwrap();
    assert!(session.text().contains("transform = { translate = [0.3, 0.0, 0.0] }"), "{}", session.text());
}

#[test]
fn lights_and_cameras_of_models_are_written_before_the_first_of_the_scenes_own() {
    let folder = tempfile::tempdir().unwrap();
    let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let model = serde_json::json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "point", "name": "lamp", "intensity": 3, "color": [1, 0.5, 0.25]},
            {"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.3}}
        ]}},
        "scenes": [{"nodes": [0, 1, 2, 3, 4]}],
        "nodes": [
            {"mesh": 0},
            {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"translation": [0, 2, 0], "extensions": {"KHR_lights_punctual": {"light": 1}}},
            {"camera": 0, "translation": [0, 0, 4], "name": "front"},
            {"camera": 0, "translation": [0, 0, 9]}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": 36, "uri": data}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    });
    std::fs::write(folder.path().join("m.gltf"), model.to_string()).unwrap();
    let text = "[[object]]\nmesh = \"m.gltf\"\n";
    let open = || Session::of_text(text, None, folder.path().join("s.toml"), LoadOptions::default(), &Silent).unwrap();
    let mut session = open();
    let lights = session.scene().lights.clone();
    assert_eq!(lights.len(), 2);
    let fields =
        vec![("kind".into(), Value::from("point")), ("position".into(), "[1, 2, 3]".parse::<Value>().unwrap())];
    session.apply(&session.adding_light(fields.clone()).unwrap()).unwrap();
    let shines = |light: &crate::scene::Light| (light.kind, light.color);
    let after: Vec<_> = session.scene().lights.iter().map(shines).collect();
    assert_eq!(after[..2], lights.iter().map(shines).collect::<Vec<_>>(), "those of the model still shine");
    session.apply(&session.adding_light(fields).unwrap()).unwrap();
    assert_eq!((after.len(), session.scene().lights.len()), (3, 4), "once");

    let mut session = open();
    let cameras: Vec<Camera> = session.scene().cameras.iter().map(|named| named.camera).collect();
    assert_eq!(cameras.len(), 2);
    session.set_camera(cameras[1], None).unwrap();
    let after: Vec<Camera> = session.scene().cameras.iter().map(|named| named.camera).collect();
    assert_eq!(after, [cameras[1], cameras[1]], "the first is moved, the other stays");
}

#[test]
fn a_model_becomes_a_scene_that_is_in_no_file_yet() {
    let session = open(Path::new("meshes/metal_roughness.glb"));
    assert!(session.is_changed() && session.path().is_none());
    assert_eq!(session.suggested_path(), Path::new("meshes/metal_roughness.toml"));
}

#[test]
fn an_objects_materials_of_its_file_are_those_that_its_triangles_have() {
    let session = session(
        "[[material]]\nname = \"own\"\n[[object]]\nmesh = \"meshes/cornell_box.obj\"\n[[object]]\nsphere = {}\nmaterial = \"own\"\n",
    );
    let names: Vec<_> =
        session.imported_materials(0).iter().map(|&number| session.scene().materials[number].name.clone()).collect();
    assert_eq!(names, ["white", "red", "green", "lamp"], "as its usemtl lines say, without the neutral one");
    assert_eq!(session.instances(1), 1..2);
}

#[test]
fn a_scene_saved_elsewhere_finds_its_files_also_after_undo() {
    let folder = tempfile::tempdir().unwrap();
    let model = std::path::absolute("meshes/box.obj").unwrap();
    let image = std::path::absolute("meshes/checker.png").unwrap();
    let text = format!(
        "[background]\nimage = {image:?}\n[[material]]\nname = \"a\"\ntexture = {image:?}\n[[material]]\nname = \"b\"\ntexture = {{ file = {image:?}, scale = 2 }}\n[[object]]\nmesh = {model:?} # a box\nmaterial = \"b\"\n"
    );
    let place = folder.path().join("a.toml");
    let mut session = Session::of_text(&text, None, place, LoadOptions::default(), &Silent).unwrap();
    assert!(session.save().unwrap_err().to_string().contains("has no file yet"));
    session.apply(&Command::set(Item::material(0), &["kr"], 0.25)).unwrap();
    std::fs::create_dir(folder.path().join("deeper")).unwrap();
    let path = folder.path().join("deeper/b.toml");
    assert!(session.save_as(&path.with_extension("txt")).is_err());
    session.save_as(&path).unwrap();
    let opened = open(&path);
    assert_eq!(opened.text(), session.text());
    assert_same(opened.scene(), session.scene());
    assert!(session.text().contains("../") && session.text().contains("# a box"), "{}", session.text());
    session.undo().unwrap();
    assert_eq!(session.scene().materials.iter().find(|m| m.name == "a").unwrap().kr, crate::scene::Rgb::ZERO);
    session.save().unwrap();
    assert_same(open(&path).scene(), session.scene());
}

#[test]
fn the_new_scene_is_a_good_start() {
    let session = Session::new(Path::new("")).unwrap();
    assert!(!session.is_changed() && session.path().is_none());
    assert_eq!((session.scene().objects.len(), session.scene().lights.len()), (1, 1));
}
