//! Accessors and meshes.

use glam::{Vec2, Vec3};
use serde_json::json;

use super::*;
use crate::error::Fault;
use crate::formats::NormalMode;
use crate::geometry::mesh::Materials;
use crate::scene::Rgb;

#[test]
fn indices_of_every_width_and_none_make_the_same_triangle() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    for (component, bytes) in
        [(5121, vec![0u8, 1, 2]), (5123, vec![0, 0, 1, 0, 2, 0]), (5125, vec![0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0])]
    {
        let mut file = File::default();
        let (position, indices) = (file.triangle(), file.accessor(&bytes, component, "SCALAR", 3));
        let model = file.load(one(json!({"attributes": {"POSITION": position}, "indices": indices}))).unwrap();
        assert_eq!(model.meshes[0].triangle(0), corners, "{component}");
    }
    let mut file = File::default();
    let position = file.triangle();
    let model = file.load(one(json!({"attributes": {"POSITION": position}}))).unwrap();
    assert_eq!(model.meshes[0].triangle(0), corners);
    assert_eq!((model.objects.len(), model.materials.len()), (1, 1), "the default material is appended");
    assert_eq!(model.materials[0].diffuse, Rgb::ONE, "a rough white metal scatters");
}

#[test]
fn strips_and_fans_become_triangles_and_lines_are_reported() {
    let mut file = File::default();
    let position = file.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]]);
    let load = |mode: u32| file.load(one(json!({"attributes": {"POSITION": position}, "mode": mode}))).unwrap();
    assert_eq!(load(5).meshes[0].indices, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
    assert_eq!(load(6).meshes[0].indices, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
    let lines = load(1);
    assert!(lines.meshes.is_empty() && lines.objects.is_empty() && has_note(&lines, Treatment::Ignored, "lines"));
    assert!(has_note(&load(4), Treatment::Warning, "left over"));
}

#[test]
fn interleaved_and_normalised_attributes_are_read_in_place() {
    // Per vertex: position as 3 floats, normal as 3 bytes and padding, coordinates as 2 shorts.
    let mut bytes = Vec::new();
    for (position, normal, uv) in [
        ([0.0f32, 0.0, 0.0], [0i8, 0, 127], [0u16, 0]),
        ([1.0, 0.0, 0.0], [-127, 0, 0], [65535, 0]),
        ([0.0, 1.0, 0.0], [-128, 64, 0], [0, 13107]),
    ] {
        bytes.extend(position.iter().flat_map(|value| value.to_le_bytes()));
        bytes.extend(normal.map(|value| value as u8));
        bytes.push(0);
        bytes.extend(uv.iter().flat_map(|value| value.to_le_bytes()));
    }
    let mut file = File::default();
    let view = file.view(&bytes);
    file.views[view]["byteStride"] = json!(20);
    for (offset, component, kind) in [(0, 5126, "VEC3"), (12, 5120, "VEC3"), (16, 5123, "VEC2")] {
        file.accessors.push(json!({"bufferView": view, "byteOffset": offset, "componentType": component, "type": kind,
            "count": 3, "normalized": component != 5126, "min": [0, 0, 0], "max": [1, 1, 0]}));
    }
    let mut rest = one(json!({"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}}));
    rest["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let model = file.load(rest.clone()).unwrap();
    let mesh = &model.meshes[0];
    assert_eq!(mesh.triangle(0), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.normals.as_ref().unwrap()[..2], [Vec3::Z, Vec3::NEG_X]);
    assert_eq!(mesh.normals.as_ref().unwrap()[2], Vec3::new(-1.0, 64.0 / 127.0, 0.0));
    assert_eq!(mesh.uvs.as_deref().unwrap(), [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.8)]);

    let normals = |normals| {
        let options = LoadOptions { normals, ..Default::default() };
        load_json(&file.json(rest.clone()), &options).unwrap().meshes.remove(0).normals
    };
    assert_eq!(normals(NormalMode::Flat), None);
    assert_eq!(normals(NormalMode::Smooth), Some([Vec3::Z; 3].into()));

    // One byte too far is an error that names the accessor.
    file.accessors[2]["count"] = json!(4);
    let error = file.load(rest).unwrap_err();
    assert!(error.to_string().contains("accessors[2]"), "{error}");
}

#[test]
fn sparse_accessors_replace_elements_of_their_base_or_of_zeros() {
    let mut file = File::default();
    let base = file.triangle();
    let (numbers, values) = (file.view(&[1, 2]), file.view(bytes_of(&[[5.0, 0.0, 0.0], [0.0, 7.0, 0.0]]).as_slice()));
    let sparse = json!({"count": 2, "indices": {"bufferView": numbers, "componentType": 5121},
        "values": {"bufferView": values}});
    file.accessors[base]["sparse"] = sparse.clone();
    file.accessors.push(json!({"componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse,
        "min": [0, 0, 0], "max": [5, 7, 0]}));
    for accessor in [0, 1] {
        let model = file.load(one(json!({"attributes": {"POSITION": accessor}}))).unwrap();
        assert_eq!(model.meshes[0].triangle(0), [Vec3::ZERO, Vec3::X * 5.0, Vec3::Y * 7.0]);
    }
    // Zeros without end take no memory, and numbers beyond the base are refused.
    file.accessors[1]["count"] = json!(1u64 << 40);
    assert_eq!(file.load(one(json!({"attributes": {"POSITION": 1}}))).unwrap_err().fault(), Fault::Limit);
    file.accessors[0]["count"] = json!(2);
    let error = file.load(one(json!({"attributes": {"POSITION": 0}}))).unwrap_err();
    assert!(error.to_string().contains("accessors[0]: sparse.indices"), "{error}");
}

fn bytes_of(values: &[[f32; 3]]) -> Vec<u8> {
    values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn primitives_of_a_mesh_are_joined_in_order() {
    let mut file = File::default();
    let (first, second) = (file.triangle(), file.floats(&[[0.0, 0.0, 9.0], [1.0, 0.0, 9.0], [0.0, 1.0, 9.0]]));
    let normal = file.floats(&[[0.0, 0.0, 2.0]; 3]);
    // The last corner does not exist in its primitive, though it would in the next one.
    let indices = file.accessor(&[0, 1, 2, 0, 1, 3], 5121, "SCALAR", 6);
    let model = file
        .load(json!({"nodes": [{"mesh": 0}], "materials": [{"name": "red"}, {}], "meshes": [{"primitives": [
            {"attributes": {"POSITION": first}, "indices": indices, "material": 1},
            {"attributes": {"POSITION": second, "NORMAL": normal}},
        ]}]}))
        .unwrap();
    let mesh = &model.meshes[0];
    assert_eq!(mesh.materials, Materials::PerTriangle(vec![1, 1, 2].into()));
    assert_eq!((mesh.dropped.as_slice(), mesh.dropped_counts.bad_index), ([1u32].as_slice(), 1));
    assert_eq!(mesh.triangle(2)[0], Vec3::Z * 9.0);
    let normals = mesh.normals.as_ref().unwrap();
    assert_eq!((normals[0], normals[3]), (Vec3::ZERO, Vec3::Z * 2.0), "zero stands for the face's normal");
    let names: Vec<_> = model.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["red", "material 1", "default"]);
}

#[test]
fn few_vertices_of_a_large_array_are_taken_alone() {
    let mut file = File::default();
    let many: Vec<[f32; 3]> = (0..100).map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let (position, indices) = (file.floats(&many), file.accessor(&[99, 7, 50, 7, 99, 200], 5121, "SCALAR", 6));
    let model = file.load(one(json!({"attributes": {"POSITION": position}, "indices": indices}))).unwrap();
    let mesh = &model.meshes[0];
    assert_eq!(mesh.positions.len(), 3);
    assert_eq!(mesh.triangle(0), [99usize, 7, 50].map(|i| Vec3::from_array(many[i])));
    assert_eq!(mesh.dropped, [1]);
}
