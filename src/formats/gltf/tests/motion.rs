//! Animations, morph targets and skins, against values computed by hand.

use glam::{DVec3, Vec3};
use serde_json::json;

use super::*;
use crate::error::Fault;
use crate::formats::Scope;
use crate::geometry::mesh::Materials;

/// Where the first object's point (1, 0, 0) is at a time.
fn moved(file: &File, rest: &Value, time: f64) -> DVec3 {
    at(file, rest, time).objects[0].transform.transform_point3(DVec3::X)
}

fn at(file: &File, rest: &Value, time: f64) -> Model {
    load_json(&file.json(rest.clone()), &LoadOptions { time: Some(time), ..Default::default() }).unwrap()
}

/// A file whose one node's property an animation moves.
fn animated(file: &mut File, path: &str, interpolation: &str, times: &[f32], output: usize) -> Value {
    let times: Vec<[f32; 1]> = times.iter().map(|&time| [time]).collect();
    let input = file.floats(&times);
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}}));
    rest["animations"] = json!([{"samplers": [{"input": input, "output": output, "interpolation": interpolation}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}]}]);
    rest
}

fn near(a: DVec3, b: DVec3) -> bool {
    (a - b).abs().max_element() < 1e-6
}

#[test]
fn translations_are_interpolated_in_all_three_ways() {
    let values = [[0.0f32, 0.0, 0.0], [4.0, 8.0, 0.0], [0.0, 0.0, 2.0]];
    for (interpolation, at_2, at_5) in
        [("LINEAR", [1.0, 2.0, 0.0], [2.0, 4.0, 1.0]), ("STEP", [0.0; 3], [4.0, 8.0, 0.0])]
    {
        let mut file = File::default();
        let output = file.floats(&values);
        let rest = animated(&mut file, "translation", interpolation, &[1.0, 5.0, 5.5], output);
        for (time, expected) in [(-9.0, [0.0; 3]), (1.0, [0.0; 3]), (2.0, at_2), (5.25, at_5), (99.0, [0.0, 0.0, 2.0])]
        {
            let found = moved(&file, &rest, time) - DVec3::X;
            assert_eq!(found.to_array(), expected, "{interpolation} at {time}");
        }
        let still = file.load(rest).unwrap();
        assert_eq!(still.objects[0].transform, glam::DAffine3::IDENTITY);
        assert!(has_note(&still, Treatment::Ignored, "not applied without a time (see --time)"));
    }
    // Incoming slope, value, outgoing slope at 0 s and 4 s: slopes count a second, so times 4. In the middle of two
    // values a and b with slopes m and n a cubic has (a + b) / 2 + (m - n) / 8.
    let mut file = File::default();
    let output =
        file.floats(&[[9.0f32; 3], [1.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [3.0, 2.0, 2.0], [9.0; 3]]);
    let rest = animated(&mut file, "translation", "CUBICSPLINE", &[0.0, 4.0], output);
    let expected = DVec3::new(2.0 + 4.0 * 1.0 / 8.0, 1.0 + 4.0 * 1.0 / 8.0, 2.0);
    assert_eq!(moved(&file, &rest, 2.0) - DVec3::X, expected);
    assert_eq!(moved(&file, &rest, 0.0) - DVec3::X, DVec3::new(1.0, 0.0, 2.0));
    assert_eq!(moved(&file, &rest, 7.0) - DVec3::X, DVec3::new(3.0, 2.0, 2.0));
}

#[test]
fn rotations_turn_evenly_and_by_the_shorter_way() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // From 0 to 90 degrees about z, the second with the opposite sign of all: the same rotation.
    let mut file = File::default();
    let output = file.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -half, -half]]);
    let rest = animated(&mut file, "rotation", "LINEAR", &[0.0, 3.0], output);
    for (time, degrees) in [(0.0, 0.0f64), (1.0, 30.0), (2.0, 60.0), (3.0, 90.0)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        assert!(near(moved(&file, &rest, time), DVec3::new(cos, sin, 0.0)), "{time}");
    }
    // In the file's normalised shorts, stepwise, and scaled by another channel.
    let mut file = File::default();
    let bytes: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 32767, 0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let output = file.accessor(&bytes, 5122, "VEC4", 2);
    file.accessors[output]["normalized"] = json!(true);
    let mut rest = animated(&mut file, "rotation", "STEP", &[0.0, 3.0], output);
    let scale = file.floats(&[[1.0f32, 1.0, 1.0], [3.0, 1.0, 1.0]]);
    let input = rest["animations"][0]["samplers"][0]["input"].clone();
    let animation = &mut rest["animations"][0];
    animation["samplers"].as_array_mut().unwrap().push(json!({"input": input, "output": scale}));
    animation["channels"].as_array_mut().unwrap().push(json!({"sampler": 1, "target": {"node": 0, "path": "scale"}}));
    assert!(near(moved(&file, &rest, 1.5), DVec3::new(2.0, 0.0, 0.0)));
    assert!(near(moved(&file, &rest, 3.0), DVec3::new(-3.0, 0.0, 0.0)));
}

#[test]
fn broken_channels_are_left_out_and_told() {
    let mut file = File::default();
    let output = file.floats(&[[0.0f32, 0.0, 0.0], [4.0, 8.0, 0.0]]);
    let good = animated(&mut file, "translation", "LINEAR", &[0.0, 1.0], output);
    let with = |pointer: &str, value: Value| {
        let mut rest = good.clone();
        *rest.pointer_mut(pointer).unwrap() = value;
        rest
    };
    let rotation = file.floats(&[[0.0f32, 0.0, 0.0, 1.0]]);
    let falling = file.floats(&[[1.0f32], [0.0]]);
    for rest in [
        with("/animations/0/samplers/0/input", json!(falling)),
        with("/animations/0/samplers/0/input", json!(output)),
        with("/animations/0/samplers/0/input", json!(99)),
        with("/animations/0/samplers/0/output", json!(rotation)),
        with("/animations/0/samplers/0/interpolation", json!("CUBICSPLINE")),
        with("/animations/0/samplers/0/interpolation", json!("BEZIER")),
        with("/animations/0/channels/0/sampler", json!(7)),
        with("/animations/0/channels/0/target/node", json!(7)),
        with("/animations/0/channels/0/target/path", json!("weights")),
        with("/nodes/0", json!({"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]})),
    ] {
        let model = at(&file, &rest, 0.5);
        assert_eq!(model.objects[0].transform, glam::DAffine3::IDENTITY, "{rest}");
        assert!(has_note(&model, Treatment::Warning, "animation channel 0"), "{rest}");
    }
    // Of an extension: no node at all, and what it means elsewhere.
    let pointer = with(
        "/animations/0/channels/0/target",
        json!({"path": "pointer",
        "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0/alphaCutoff"}}}),
    );
    assert!(has_note(&at(&file, &pointer, 0.5), Treatment::Ignored, "something else than a node"));
    assert!(has_note(
        &at(&file, &with("/animations/0", json!({"channels": 3})), 0.5),
        Treatment::Warning,
        "broken animation"
    ));
    assert_eq!(at(&file, &good, 0.5).objects[0].transform.translation, DVec3::new(2.0, 4.0, 0.0));
}

#[test]
fn animations_are_chosen_by_name_or_number() {
    let mut file = File::default();
    let output = file.floats(&[[1.0f32, 0.0, 0.0]]);
    let mut rest = animated(&mut file, "translation", "STEP", &[0.0], output);
    let second = file.floats(&[[2.0f32, 0.0, 0.0]]);
    let mut other = rest["animations"][0].clone();
    other["samplers"][0]["output"] = json!(second);
    other["name"] = json!("walk");
    rest["animations"].as_array_mut().unwrap().push(other);
    let load = |rest: &Value, animation: Option<&str>, time| {
        let options = LoadOptions { animation: animation.map(str::to_owned), time: Some(time), ..Default::default() };
        load_json(&file.json(rest.clone()), &options)
    };
    for (animation, x) in [(None, 1.0), (Some("0"), 1.0), (Some("1"), 2.0), (Some("walk"), 2.0)] {
        let model = load(&rest, animation, 0.0).unwrap();
        assert_eq!(model.objects[0].transform.translation.x, x, "{animation:?}");
        assert!(has_note(&model, Treatment::Ignored, "other animation (see --animation)"));
    }
    let error = load(&rest, Some("run"), 0.0).unwrap_err();
    assert!(error.fault() == Fault::Caller && error.to_string().contains("0, 1 `walk`"), "{error}");
    assert_eq!(load(&rest, None, f64::NAN).unwrap_err().fault(), Fault::Caller);
    rest["animations"] = json!([]);
    assert!(has_note(&load(&rest, None, 0.0).unwrap(), Treatment::Warning, "no animation"));
    for named in ["0", "walk"] {
        assert_eq!(load(&rest, Some(named), 0.0).unwrap_err().fault(), Fault::Caller);
    }
}

/// A triangle with two morph targets; the second is sparse, and in bytes.
fn morphing(file: &mut File) -> Value {
    let (position, normal) = (file.triangle(), file.floats(&[[0.0f32, 0.0, 1.0]; 3]));
    let uv = file.floats(&[[0.0f32, 0.0]; 3]);
    let lift = file.floats(&[[0.0f32, 0.0, 2.0]; 3]);
    let tilt = file.floats(&[[4.0f32, 0.0, 0.0]; 3]);
    let shift = file.floats(&[[0.5f32, 0.25]; 3]);
    let (numbers, values) = (file.view(&[1]), file.view(&[127, 0, 129]));
    let push = file.accessors.len();
    file.accessors
        .push(json!({"componentType": 5120, "normalized": true, "type": "VEC3", "count": 3, "sparse": {"count": 1,
        "indices": {"bufferView": numbers, "componentType": 5121}, "values": {"bufferView": values}}}));
    one(json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv},
        "targets": [{"POSITION": lift, "NORMAL": tilt, "TEXCOORD_0": shift}, {"POSITION": push}]}))
}

#[test]
fn morph_targets_add_up_with_the_weights_of_node_mesh_or_animation() {
    let mut file = File::default();
    let mut rest = morphing(&mut file);
    let plain = file.load(rest.clone()).unwrap();
    assert_eq!(plain.meshes[0].triangle(0), [Vec3::ZERO, Vec3::X, Vec3::Y], "weights are 0 where nobody gives any");
    assert!(!has_note(&plain, Treatment::Honoured, "morph"));

    rest["meshes"][0]["weights"] = json!([0.5, 0.25]);
    let mesh = file.load(rest.clone()).unwrap().meshes.remove(0);
    assert_eq!(mesh.triangle(0), [Vec3::Z, Vec3::new(1.25, 0.0, 0.75), Vec3::new(0.0, 1.0, 1.0)]);
    assert_eq!(mesh.normals.unwrap(), [Vec3::new(2.0, 0.0, 1.0); 3]);
    assert_eq!(mesh.uvs.unwrap(), [glam::Vec2::new(0.25, 1.0 - 0.125); 3]);

    // Nodes with equal weights share a mesh; others do not. Weights that are missing are 0, those beyond are no one's.
    rest["nodes"] = json!([{"mesh": 0, "weights": [1, 0]}, {"mesh": 0}, {"mesh": 0, "weights": [1, 0]},
        {"mesh": 0, "weights": [0, 0]}, {"mesh": 0, "weights": [1]}, {"mesh": 0, "weights": [0.5, 0.25, 9]}]);
    rest["scenes"] = json!([{"nodes": [0, 1, 2, 3, 4, 5]}]);
    let model = file.load(rest.clone()).unwrap();
    let shown: Vec<_> = model.objects.iter().map(|object| format!("{:?}", object.shape)).collect();
    assert_eq!(shown, [0, 1, 0, 2, 0, 1].map(|mesh| format!("Mesh({mesh})")));
    assert_eq!(model.meshes.iter().map(|mesh| mesh.triangle(0)[0].z).collect::<Vec<_>>(), [2.0, 1.0, 0.0]);
    assert_eq!(model.meshes[1].name, "mesh 0 (2)");
    let (_, _, morphed) = model.ledger.all().find(|(_, feature, _)| *feature == "morph targets").unwrap();
    assert_eq!(morphed.scopes.iter().copied().collect::<Vec<_>>(), [0, 1].map(Scope::Mesh));
    assert!(has_note(&model, Treatment::Warning, "weights without a morph target"));

    // From 0 to (1, 0), half way.
    let (input, output) = (file.floats(&[[0.0f32], [2.0]]), file.floats(&[[0.0f32], [0.0], [1.0], [0.0]]));
    rest["nodes"] = json!([{"mesh": 0}]);
    rest["scenes"] = json!([{"nodes": [0]}]);
    rest["animations"] = json!([{"samplers": [{"input": input, "output": output}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]);
    assert_eq!(at(&file, &rest, 1.0).meshes[0].triangle(0)[0], Vec3::Z);
}

/// A strip of two squares along y, from (0, 0) to (1, 2), on two bones: one at its foot, one at (0, 1, 0) that turns it.
/// The lower vertices follow the first, the upper ones the second, those between both by half.
fn bent(file: &mut File, turn: [f64; 4]) -> Value {
    let corners =
        [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]];
    let (position, normal) = (file.floats(&corners), file.floats(&[[0.0f32, 0.0, 1.0]; 6]));
    let indices = file.accessor(&[0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4], 5121, "SCALAR", 12);
    let mut joints = [[0u8, 0, 0, 0]; 6];
    joints[2..].fill([0, 1, 0, 0]);
    let joints = file.accessor(joints.as_flattened(), 5121, "VEC4", 6);
    let mut weights = [[1.0f32, 0.0, 0.0, 0.0]; 6];
    // These need not add up to 1.
    weights[2..4].fill([0.25, 0.25, 0.0, 0.0]);
    weights[4..].fill([0.0, 1.0, 0.0, 0.0]);
    let weights = file.floats(&weights);
    let identity = |down: f32| [1.0f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -down, 0.0, 1.0];
    let matrices: Vec<u8> =
        [identity(0.0), identity(1.0)].as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    let inverse = file.accessor(&matrices, 5126, "MAT4", 2);
    json!({
        "meshes": [{"primitives": [{"attributes": {"POSITION": position, "NORMAL": normal, "JOINTS_0": joints,
            "WEIGHTS_0": weights}, "indices": indices}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": inverse}],
        "nodes": [{"mesh": 0, "skin": 0, "translation": [100, 100, 100]}, {"children": [2]},
            {"translation": [0, 1, 0], "rotation": turn}],
    })
}

#[test]
fn two_bones_bend_a_strip() {
    // The upper bone turns by 90 degrees about z: (x, y) goes to (1 - y, 1 + x).
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut file = File::default();
    let rest = bent(&mut file, [0.0, 0.0, half, half]);
    let model = file.load(rest.clone()).unwrap();
    let expected = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        // The mean of where it stays, (0, 1), and where the upper bone takes it, (0, 1).
        [0.0, 1.0, 0.0],
        // The mean of (1, 1) and (0, 2).
        [0.5, 1.5, 0.0],
        [-1.0, 1.0, 0.0],
        [-1.0, 2.0, 0.0],
    ];
    let mesh = &model.meshes[0];
    for (&position, expected) in mesh.positions.iter().zip(expected) {
        assert!((position - Vec3::from_array(expected)).abs().max_element() < 1e-6, "{position} {expected:?}");
    }
    assert_eq!(model.objects[0].transform, glam::DAffine3::IDENTITY, "the node's own place does not count");
    assert!(mesh.normals.as_ref().unwrap().iter().all(|n| n.z > 0.0 && n.x.abs() + n.y.abs() < 1e-6));
    assert!(has_note(&model, Treatment::Honoured, "skin"));
    assert!(!model.ledger.entries().any(|(treatment, ..)| treatment == Treatment::Warning));

    // Turned up, the whole stands in the world already.
    let options = LoadOptions { up: crate::formats::UpAxis::Z, ..Default::default() };
    let up = load_json(&file.json(rest), &options).unwrap();
    assert_eq!(up.objects[0].transform, glam::DAffine3::IDENTITY);
    assert!((up.meshes[0].positions[5] - Vec3::new(-1.0, 0.0, -2.0)).abs().max_element() < 1e-6);
}

#[test]
fn normals_stay_perpendicular_to_what_joints_stretch_and_mirror() {
    let mut file = File::default();
    let mut rest = bent(&mut file, [0.0, 0.0, 0.0, 1.0]);
    // A slope: normals of (-1, 0, 1) on the plane z = x, whose x is then stretched by 4 and turned over.
    let corners =
        [[0.0f32, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 2.0, 0.0], [1.0, 2.0, 1.0]];
    let (position, normal) = (file.floats(&corners), file.floats(&[[-1.0f32, 0.0, 1.0]; 6]));
    let attributes = &mut rest["meshes"][0]["primitives"][0]["attributes"];
    (attributes["POSITION"], attributes["NORMAL"]) = (json!(position), json!(normal));
    for (scale, direction) in [(4.0, Vec3::new(-1.0, 0.0, 4.0)), (-4.0, Vec3::new(1.0, 0.0, 4.0))] {
        rest["nodes"][1]["scale"] = json!([scale, 1, 1]);
        let mesh = file.load(rest.clone()).unwrap().meshes.remove(0);
        for (number, indices) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.triangle(number as u32);
            let face = (b - a).cross(c - a);
            for &corner in indices {
                let n = mesh.normals.as_ref().unwrap()[corner as usize];
                assert!((n.normalize() - direction.normalize()).abs().max_element() < 1e-6, "{scale}: {n}");
                assert!((n.normalize() - face.normalize()).abs().max_element() < 1e-6, "the front stays the front");
            }
        }
        assert_eq!(mesh.indices[0], if scale < 0.0 { [0, 2, 1] } else { [0, 1, 2] });
        assert_eq!(mesh.materials, Materials::One(0));
    }
}

#[test]
fn skins_with_faults_are_worked_around_and_told() {
    let mut file = File::default();
    let good = bent(&mut file, [0.0, 0.0, 1.0, 0.0]);
    let none = file.floats(&[[0.0f32; 4]; 6]);
    let far = file.accessor(&[9; 24], 5121, "VEC4", 6);
    let with = |pointer: &str, value: Value| {
        let mut rest = good.clone();
        *rest.pointer_mut(pointer).unwrap() = value;
        let model = file.load(rest).unwrap();
        let object = model.objects[0].transform.translation.x;
        (model.meshes[0].positions[5], object, model)
    };
    let attributes = "/meshes/0/primitives/0/attributes";
    // Without weights the first joint counts, which for the last vertex is the one that stands still.
    let (position, _, model) = with(&format!("{attributes}/WEIGHTS_0"), json!(none));
    assert!(position == Vec3::new(1.0, 2.0, 0.0) && has_note(&model, Treatment::Warning, "no weight"));
    let (position, _, model) = with(&format!("{attributes}/JOINTS_0"), json!(far));
    assert!(position == Vec3::new(1.0, 2.0, 0.0) && has_note(&model, Treatment::Warning, "does not have"));
    let (position, _, model) = with(attributes, json!({"POSITION": 0}));
    assert!(position == Vec3::new(1.0, 2.0, 0.0) && has_note(&model, Treatment::Warning, "without joints"));
    // A skin that cannot be used at all leaves its mesh to the node.
    for (pointer, value) in [
        ("/skins/0/joints", json!([1, 77])),
        ("/skins/0/joints", json!([1, 2, 1])),
        ("/skins/0/inverseBindMatrices", json!(0)),
        ("/skins/0/inverseBindMatrices", json!(99)),
    ] {
        let (position, x, model) = with(pointer, value.clone());
        assert_eq!((position, x), (Vec3::new(1.0, 2.0, 0.0), 100.0), "{value}");
        assert!(has_note(&model, Treatment::Warning, "shown unposed"), "{value}");
    }
    // Without matrices joints are where the mesh is modelled: the upper one turns by half a turn, then lifts by 1.
    let mut rest = good.clone();
    rest["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    let position = file.load(rest).unwrap().meshes[0].positions[5];
    assert!((position - Vec3::new(-1.0, -1.0, 0.0)).abs().max_element() < 1e-6, "{position}");
}

#[test]
fn one_mesh_with_two_skins_is_two_meshes() {
    let mut file = File::default();
    let mut rest = bent(&mut file, [0.0, 0.0, 0.0, 1.0]);
    let skin = rest["skins"][0].clone();
    rest["skins"] = json!([skin, {"joints": [3, 4]}]);
    let instanced = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}});
    rest["nodes"] = json!([{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 1, 0]},
        {"translation": [0, 0, 5]}, {"translation": [0, 0, 5]}, {"mesh": 0, "skin": 1, "extensions": instanced},
        {"mesh": 0, "skin": 0}]);
    let model = file.load(rest).unwrap();
    let shown: Vec<_> = model.objects.iter().map(|object| format!("{:?}", object.shape)).collect();
    assert_eq!(shown, ["Mesh(0)", "Mesh(1)", "Mesh(0)"]);
    let heights: Vec<f32> = model.meshes.iter().map(|mesh| mesh.file_position(mesh.positions[4]).z as f32).collect();
    assert_eq!(heights, [0.0, 5.0]);
    assert!(has_note(&model, Treatment::Ignored, "EXT_mesh_gpu_instancing of a node with a skin"));
}
