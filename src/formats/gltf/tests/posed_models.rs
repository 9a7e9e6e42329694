//! Models of `shared/data` with colours, morph targets, skins and animations, against what is computed here from the
//! arrays as the crate `gltf` hands them out.

use ::gltf::animation::util::ReadOutputs;
use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};

use super::models::{open, shared};
use super::*;

#[test]
fn a_box_has_the_colours_of_its_file() {
    let Some(folder) = shared("gltf/BoxVertexColors") else { return };
    let path = folder.join("BoxVertexColors.glb");
    let file = ::gltf::Gltf::open(&path).unwrap();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let expected: Vec<[u16; 4]> =
        primitive.reader(|_| file.blob.as_deref()).read_colors(0).unwrap().into_rgba_u16().collect();
    let model = open(&path).unwrap();
    let colors = model.meshes[0].colors.as_ref().unwrap();
    assert_eq!(colors.len(), 24);
    for (color, expected) in colors.iter().zip(&expected) {
        // The crate cuts fractions off where they are rounded here.
        assert!(color.iter().zip(expected).all(|(&a, &b)| a.abs_diff(b) <= 1), "{color:?} {expected:?}");
    }
}

#[test]
fn simple_models_are_morphed_and_replaced_as_they_say() {
    let Some(folder) = shared("gltf") else { return };
    let path = folder.join("SimpleMorph/SimpleMorph.gltf");
    // Of (0, 0, 0), (1, 0, 0), (0.5, 0.5, 0) the last is moved by (-1, 1, 0) and (1, 1, 0), by half of each.
    let still = open(&path).unwrap();
    assert_eq!(still.meshes[0].triangle(0)[2], Vec3::new(0.5, 1.5, 0.0));
    // The weights go from (0, 0) by (0, 1), (1, 1) and (1, 0) back to (0, 0), a second each.
    for (time, tip) in [(0.0, [0.5, 0.5]), (0.5, [1.0, 1.0]), (1.0, [1.5, 1.5]), (2.5, [0.0, 2.0]), (9.0, [0.5, 0.5])] {
        let options = LoadOptions { time: Some(time), ..Default::default() };
        let mesh = super::super::load(&path, &options, &Silent).unwrap().meshes.remove(0);
        assert_eq!(mesh.triangle(0)[2], Vec3::new(tip[0], tip[1], 0.0), "{time}");
    }
    let sparse = open(&folder.join("SimpleSparseAccessor/SimpleSparseAccessor.gltf")).unwrap();
    assert!(has_note(&sparse, Treatment::Honoured, "sparse accessors"));
    assert_eq!(sparse.meshes[0].positions[8], Vec3::new(1.0, 2.0, 0.0));
    let meshes = open(&folder.join("SimpleMeshes/SimpleMeshes.gltf")).unwrap();
    assert_eq!((meshes.meshes.len(), meshes.objects.len()), (1, 2));
    assert_eq!(meshes.objects[1].transform.translation, DVec3::X);
    let coordinates = open(&folder.join("TextureCoordinateTest/TextureCoordinateTest.gltf")).unwrap();
    let with_uvs = coordinates.meshes.iter().filter(|mesh| mesh.uvs.is_some()).count();
    assert_eq!((with_uvs, coordinates.meshes.len()), (4, 5), "all but the plane behind them");
    let engine = open(&folder.join("2CylinderEngine.glb")).unwrap();
    assert!(engine.objects.len() > engine.meshes.len() && !engine.cameras.is_empty());
}

/// Where a sampler's keys place a node: the two keys around a time, and which share of the way has passed.
fn around(times: &[f32], time: f64) -> (usize, usize, f64) {
    let next = times.iter().position(|&key| f64::from(key) > time).unwrap_or(times.len());
    let (a, b) = (next.saturating_sub(1), next.min(times.len() - 1));
    let (start, end) = (f64::from(times[a]), f64::from(times[b]));
    (a, b, if end > start { (time - start) / (end - start) } else { 0.0 })
}

/// The vertices of the first skinned mesh at a time, each through all of its joints' matrices.
fn skinned(path: &Path, time: Option<f64>) -> Vec<DVec3> {
    let file = ::gltf::Gltf::open(path).unwrap();
    let buffer = std::fs::read(path.with_file_name("CesiumMan0.bin")).unwrap();
    let bytes = |_| Some(buffer.as_slice());
    let mut local: Vec<DMat4> = Vec::new();
    for node in file.nodes() {
        let (t, r, s) = match node.transform() {
            ::gltf::scene::Transform::Matrix { matrix } => {
                local.push(DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from))));
                continue;
            }
            ::gltf::scene::Transform::Decomposed { translation, rotation, scale } => (translation, rotation, scale),
        };
        let (mut t, mut r, mut s) =
            (Vec3::from(t).as_dvec3(), DQuat::from_vec4(DVec4::from_array(r.map(f64::from))), Vec3::from(s).as_dvec3());
        for channel in file.animations().next().unwrap().channels().filter(|_| time.is_some()) {
            if channel.target().node().index() != node.index() {
                continue;
            }
            let reader = channel.reader(bytes);
            let times: Vec<f32> = reader.read_inputs().unwrap().collect();
            let (a, b, share) = around(&times, time.unwrap());
            let mix = |values: Vec<[f32; 3]>| {
                Vec3::from(values[a]).as_dvec3() * (1.0 - share) + Vec3::from(values[b]).as_dvec3() * share
            };
            match reader.read_outputs().unwrap() {
                ReadOutputs::Translations(values) => t = mix(values.collect()),
                ReadOutputs::Scales(values) => s = mix(values.collect()),
                ReadOutputs::Rotations(values) => {
                    let values: Vec<_> = values.into_f32().collect();
                    let key = |i: usize| DQuat::from_vec4(DVec4::from_array(values[i].map(f64::from))).normalize();
                    r = key(a).slerp(key(b), share);
                }
                ReadOutputs::MorphTargetWeights(_) => unreachable!("it has none"),
            }
        }
        local.push(DMat4::from_scale_rotation_translation(s, r.normalize(), t));
    }
    let mut world = local.clone();
    let mut waiting: Vec<_> = file.scenes().next().unwrap().nodes().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = waiting.pop() {
        world[node.index()] = parent * local[node.index()];
        waiting.extend(node.children().map(|child| (child, world[node.index()])));
    }
    let skin = file.skins().next().unwrap();
    let inverse = skin.reader(bytes).read_inverse_bind_matrices().unwrap();
    let joints: Vec<DMat4> = skin
        .joints()
        .zip(inverse)
        .map(|(joint, m)| world[joint.index()] * DMat4::from_cols_array_2d(&m.map(|column| column.map(f64::from))))
        .collect();
    let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(bytes);
    let influences = reader.read_joints(0).unwrap().into_u16().zip(reader.read_weights(0).unwrap().into_f32());
    let vertices = reader.read_positions().unwrap().zip(influences);
    let place = |(p, (joint, weight)): ([f32; 3], ([u16; 4], [f32; 4]))| {
        let p = Vec3::from(p).as_dvec3();
        let parts = (0..4).map(|i| joints[usize::from(joint[i])].transform_point3(p) * f64::from(weight[i]));
        parts.sum::<DVec3>() / weight.iter().map(|&w| f64::from(w)).sum::<f64>()
    };
    vertices.map(place).collect()
}

#[test]
fn a_man_walks_as_his_bones_do() {
    let Some(folder) = shared("gltf/CesiumMan") else { return };
    let path = folder.join("CesiumMan.gltf");
    for time in [None, Some(0.0), Some(0.31), Some(1.0), Some(77.0)] {
        let options = LoadOptions { time, ..Default::default() };
        let model = super::super::load(&path, &options, &Silent).unwrap();
        let mesh = &model.meshes[0];
        let expected = skinned(&path, time);
        assert_eq!(mesh.positions.len(), expected.len());
        for (&stored, expected) in mesh.positions.iter().zip(&expected) {
            let off = (mesh.file_position(stored) - *expected).abs().max_element();
            assert!(off < 1e-6, "{off} at {time:?}");
        }
        // He stands upright, with his feet on the ground, 1.5 m tall.
        let (low, high) =
            expected.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
        assert!(low.y.abs() < 0.1 && (1.4..1.6).contains(&high.y), "{low} {high}");
        assert_eq!(has_note(&model, Treatment::Ignored, "see --time"), time.is_none());
        assert!(has_note(&model, Treatment::Honoured, "skin"));
    }
}
