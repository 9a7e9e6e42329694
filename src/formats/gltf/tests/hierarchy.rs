//! Nodes, instances, cameras and lights.

use glam::DVec3;
use serde_json::json;

use super::*;
use crate::error::Fault;
use crate::formats::UpAxis;
use crate::scene::{Camera, Falloff, LightKind, Projection, Rgb};

fn near(a: DVec3, b: DVec3) -> bool {
    (a - b).abs().max_element() < 1e-12
}

#[test]
fn nodes_compose_scale_rotation_translation_and_matrices() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut file = File::default();
    let position = file.triangle();
    let model = file
        .load(json!({
            "meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}],
            "scenes": [{"nodes": []}, {"nodes": [0]}], "scene": 1,
            "nodes": [
                // A quarter turn about z, the quaternion not normalised.
                {"translation": [10, 0, 0], "rotation": [0, 0, 3.0 * half, 3.0 * half], "scale": [2, 3, 4],
                 "children": [1, 2], "mesh": 0},
                {"matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1, 5, 7, 1], "mesh": 0, "name": "mirrored"},
                {"scale": [1, 0, 1], "mesh": 0},
                {"mesh": 0},
            ],
        }))
        .unwrap();
    assert_eq!(model.meshes.len(), 1);
    assert_eq!(model.objects.len(), 2, "the flattened one and the one outside of the scene are left out");
    let (parent, child) = (&model.objects[0].transform, &model.objects[1].transform);
    assert!(near(parent.transform_point3(DVec3::ONE), DVec3::new(10.0 - 3.0, 2.0, 4.0)));
    // (1, 1, 1) -> (-0.9, 6, 8) -> scaled (-1.8, 18, 32) -> turned (-18, -1.8, 32).
    assert!(near(child.transform_point3(DVec3::ONE), DVec3::new(-8.0, -1.8, 32.0)));
    assert!(child.matrix3.determinant() < 0.0);
    assert!((child.translation.y - 0.2).abs() < 1e-12, "0.1 is read as f64, not as f32");
    assert_eq!(model.objects[1].name, "mirrored");
}

#[test]
fn scenes_are_chosen_by_name_or_number() {
    let mut file = File::default();
    let position = file.triangle();
    let rest = json!({
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}],
        "nodes": [{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}],
        "scenes": [{"nodes": [0], "name": "hall"}, {"nodes": [1]}], "scene": 1,
    });
    let load = |scene: Option<&str>| {
        load_json(&file.json(rest.clone()), &LoadOptions { scene: scene.map(str::to_owned), ..Default::default() })
    };
    for (scene, shown) in [(None, "b"), (Some("hall"), "a"), (Some("0"), "a"), (Some("1"), "b")] {
        let model = load(scene).unwrap();
        assert_eq!(model.objects[0].name, shown, "{scene:?}");
        assert_eq!(has_note(&model, Treatment::Ignored, "other scene (see --scene)"), scene.is_none());
    }
    let error = load(Some("attic")).unwrap_err();
    assert!(error.fault() == Fault::Caller && error.to_string().contains("0 `hall`, 1"), "{error}");
}

#[test]
fn the_up_axis_turns_everything_exactly() {
    let mut file = File::default();
    let position = file.triangle();
    let json = file.json(one(json!({"attributes": {"POSITION": position}})));
    let model = load_json(&json, &LoadOptions { up: UpAxis::Z, ..Default::default() }).unwrap();
    let transform = model.objects[0].transform;
    assert_eq!(transform.transform_point3(DVec3::Z), DVec3::Y);
    assert_eq!(transform.transform_point3(DVec3::Y), DVec3::NEG_Z);
}

#[test]
fn cycles_and_shared_nodes_are_errors() {
    for nodes in [
        json!([{"children": [1]}, {"children": [0]}]),
        json!([{"children": [1, 2]}, {"children": [2]}, {}]),
        json!([{"children": [0]}]),
    ] {
        let error = File::default().load(json!({"nodes": nodes, "scenes": [{"nodes": [0]}]})).unwrap_err();
        assert!(error.to_string().contains("nodes["), "{error}");
    }
    // A chain deeper than a stack could follow.
    let count = 200_000;
    let nodes: Vec<Value> =
        (0..count).map(|i| if i + 1 < count { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    assert!(File::default().load(json!({"nodes": nodes})).is_ok());
}

#[test]
fn instances_stand_on_top_of_their_node() {
    let mut file = File::default();
    let position = file.triangle();
    let translation = file.floats(&[[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let scale = file.floats(&[[1.0f32; 3], [3.0; 3]]);
    // Half a turn about x, in normalised bytes.
    let rotation = file.accessor(&[0, 0, 0, 127, 127, 0, 0, 0], 5120, "VEC4", 2);
    file.accessors[rotation]["normalized"] = json!(true);
    let extension = |attributes: Value| {
        json!({"extensionsRequired": ["EXT_mesh_gpu_instancing"],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position}}]}],
            "nodes": [{"mesh": 0, "translation": [0, 0, 5],
                "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}]})
    };
    let attributes = json!({"TRANSLATION": translation, "ROTATION": rotation, "SCALE": scale});
    let model = file.load(extension(attributes)).unwrap();
    let places: Vec<DVec3> = model.objects.iter().map(|object| object.transform.transform_point3(DVec3::ONE)).collect();
    assert!(near(places[0], DVec3::new(2.0, 1.0, 6.0)) && near(places[1], DVec3::new(3.0, -1.0, 2.0)), "{places:?}");
    for bad in [
        json!({}),
        json!({"TRANSLATION": 99}),
        json!({"TRANSLATION": "x"}),
        json!({"SCALE": rotation}),
        json!({"TRANSLATION": position, "SCALE": scale}),
    ] {
        let error = file.load(extension(bad)).unwrap_err();
        assert!(error.to_string().contains("nodes[0]"), "{error}");
    }
}

#[test]
fn cameras_look_along_minus_z_of_their_node() {
    let camera = |yfov: f32| json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}});
    let model = File::default()
        .load(json!({
            "cameras": [camera(0.5), {"name": "plan", "type": "orthographic",
                "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}}, camera(4.0)],
            "nodes": [{"camera": 0, "rotation": [0, 1, 0, 0], "translation": [1, 2, 3]}, {"camera": 1}, {"camera": 0},
                {"camera": 2}],
        }))
        .unwrap();
    let names: Vec<_> = model.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["camera 0", "plan", "camera 0 (2)"], "an impossible field of view is left out");
    let Camera::LookAt { eye, target, up, projection } = model.cameras[0].camera else { panic!() };
    assert!(near(eye, DVec3::new(1.0, 2.0, 3.0)) && near(target - eye, DVec3::Z) && near(up, DVec3::Y));
    assert_eq!(projection, Projection::Perspective { fov_y: 0.5 });
    let Camera::LookAt { projection, .. } = model.cameras[1].camera else { panic!() };
    assert_eq!(projection, Projection::Orthographic { height: 4.0 });
}

#[test]
fn lights_keep_their_physical_units() {
    let model = File::default()
        .load(json!({
            "extensions": {"KHR_lights_punctual": {"lights": [
                {"type": "point", "color": [1, 0.5, 0.25], "intensity": 40, "name": "lamp"},
                {"type": "directional", "range": 3},
                {"type": "spot", "spot": {"innerConeAngle": 0.25}},
            ]}},
            "nodes": [
                {"translation": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
                {"rotation": [0, 1, 0, 0], "extensions": {"KHR_lights_punctual": {"light": 1}}},
                {"extensions": {"KHR_lights_punctual": {"light": 2}}},
            ],
        }))
        .unwrap();
    assert!(model.physical_lights);
    let falloff = Falloff::InverseSquare;
    assert_eq!(model.lights[0].kind, LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), falloff });
    assert_eq!((model.lights[0].color, model.lights[0].name.as_str()), (Rgb::new(40.0, 20.0, 10.0), "lamp"));
    let LightKind::Directional { direction } = model.lights[1].kind else { panic!() };
    assert!(near(direction, DVec3::Z) && model.lights[1].color == Rgb::ONE);
    let LightKind::Spot { inner_angle, outer_angle, .. } = model.lights[2].kind else { panic!() };
    assert_eq!((inner_angle, outer_angle as f32), (0.25, std::f32::consts::FRAC_PI_4));
}
