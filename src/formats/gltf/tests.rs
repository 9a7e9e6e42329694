//! Whole files: small ones written here, one a feature, and the models of `shared/data` where they are present.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3, Vec2, Vec3};
use serde_json::{Value, json};

use super::{load, read};
use crate::error::{Fault, Result};
use crate::formats::{LoadOptions, Model, NormalMode, Treatment, UpAxis};
use crate::geometry::mesh::Materials;
use crate::progress::Silent;
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{Camera, Falloff, LightKind, Projection, Rgb};

/// Builds a file around bytes: each array becomes a buffer view and an accessor of its own.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl File {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let bound = [0.0; 3];
        self.accessors.push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count,
            "min": bound, "max": bound}));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(&bytes, 5126, ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1], values.len())
    }

    /// The unit triangle (0, 0), (1, 0), (0, 1) at z = 0.
    fn triangle(&mut self) -> usize {
        self.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    /// The JSON with a data URI; `rest` has the other members.
    fn json(&self, rest: Value) -> Value {
        let mut file = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": self.bytes.len(), "uri": data_uri(&self.bytes)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        if self.bytes.is_empty() {
            file = json!({"asset": {"version": "2.0"}});
        }
        file.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        file
    }

    fn load(&self, rest: Value) -> Result<Model> {
        load_json(&self.json(rest), &LoadOptions::default())
    }
}

fn data_uri(bytes: &[u8]) -> String {
    let hex: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    format!("data:application/octet-stream,{hex}")
}

fn load_json(json: &Value, options: &LoadOptions) -> Result<Model> {
    read(json.to_string().as_bytes(), Path::new("nowhere"), options, &Silent)
}

/// One node that shows one mesh of one primitive.
fn one(primitive: Value) -> Value {
    json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})
}

/// A file with one triangle of one material.
fn with_material(material: Value) -> Model {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["materials"] = json!([material]);
    file.load(rest).unwrap()
}

fn has_note(model: &Model, treatment: Treatment, text: &str) -> bool {
    model.ledger.entries().any(|(found, feature, _)| found == treatment && feature.contains(text))
}

fn near(a: DVec3, b: DVec3) -> bool {
    (a - b).abs().max_element() < 1e-12
}

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
    assert_eq!(normals(NormalMode::Smooth), Some(vec![Vec3::Z; 3]));

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
    assert_eq!(mesh.materials, Materials::PerTriangle(vec![1, 1, 2]));
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

/// A PNG of 2 x 1 texels: pure red and black.
const RED_BLACK: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAA\
    AADElEQVR4nGP4zwACAAYBAQB/9VxdAAAAAElFTkSuQmCC";

#[test]
fn textures_are_decoded_once_and_read_as_their_samplers_say() {
    let mut file = File::default();
    let (position, uv) = (file.triangle(), file.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]]));
    let transform = json!({"KHR_texture_transform": {"scale": [2, 3], "offset": [0.5, 0.25], "texCoord": 1}});
    let model = file
        .load(json!({
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position, "TEXCOORD_1": uv}, "material": 0}]}],
            "images": [{"uri": RED_BLACK}, {"uri": "missing.png"}],
            "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
            "textures": [{"source": 0, "sampler": 0}, {"source": 0}, {"source": 1}],
            "materials": [
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": transform}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}},
            ],
        }))
        .unwrap();
    let [first, second] = model.textures.as_slice() else { panic!("{} textures", model.textures.len()) };
    assert_eq!((first.wrap, first.filter), ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest));
    assert_eq!((second.wrap, second.filter), ([Wrap::Repeat, Wrap::Repeat], Filter::Linear));
    let used = |material: usize| model.materials[material].diffuse_texture.map(|used| used.texture);
    assert_eq!([used(0), used(1), used(2), used(3)], [Some(0), Some(1), Some(0), None]);
    assert!(has_note(&model, Treatment::Warning, "images[1]"));

    // The texel that glTF reads at (u, v) is the one that we read at our coordinates.
    let mesh = &model.meshes[0];
    assert_eq!(mesh.uvs.as_deref().unwrap()[2], Vec2::new(0.0, 0.75));
    let reference = model.materials[0].diffuse_texture.unwrap();
    let ours = mesh.uvs.as_deref().unwrap()[2].as_dvec2() * reference.scale + reference.offset;
    let theirs = DVec2::new(0.0, 0.25) * DVec2::new(2.0, 3.0) + DVec2::new(0.5, 0.25);
    assert_eq!(ours, DVec2::new(theirs.x, 1.0 - theirs.y));
}

#[test]
fn images_may_lie_in_a_buffer() {
    let mut file = File::default();
    let position = file.triangle();
    let super::uri::Target::Data(png) = super::uri::resolve(RED_BLACK, Path::new("")).unwrap() else { panic!() };
    let view = file.view(&png);
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let model = file.load(rest).unwrap();
    let texture = &model.textures[0];
    assert_eq!((texture.width, texture.height), (2, 1));
    assert_eq!(texture.sample(DVec2::new(0.25, 0.5)), Rgb::X);
    // Half red, half black: the mean reflectance of the metal.
    let smooth = &model.materials[0];
    assert_eq!(smooth.specular, Rgb::X);
}

#[test]
fn data_textures_act_by_their_mean() {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"uri": RED_BLACK}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}]);
    let model = file.load(rest).unwrap();
    let material = &model.materials[0];
    // Green and blue are 0: perfectly smooth and no metal.
    assert!((material.kr - 0.04).abs().max_element() < 1e-6 && material.diffuse == Rgb::ONE);
    assert_eq!(material.emission, Rgb::X * 0.5);
}

#[test]
fn material_extensions_become_phong_terms() {
    let extension = |name: &str, value: Value, metallic: f32| {
        with_material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": metallic,
            "roughnessFactor": 0}, "emissiveFactor": [0.5, 0, 0], "extensions": {name: value}}))
        .materials
        .remove(0)
    };
    let base = Rgb::new(0.5, 0.25, 1.0);
    let unlit = extension("KHR_materials_unlit", json!({}), 0.0);
    assert_eq!((unlit.emission, unlit.diffuse, unlit.ambient), (base, Rgb::ZERO, Some(Rgb::ZERO)));
    let bright = extension("KHR_materials_emissive_strength", json!({"emissiveStrength": 6}), 0.0);
    assert_eq!(bright.emission, Rgb::X * 3.0);
    let diamond = extension("KHR_materials_ior", json!({"ior": 2.0}), 0.0);
    assert!((diamond.kr - 1.0 / 9.0).abs().max_element() < 1e-7);
    let tinted = json!({"specularFactor": 0.5, "specularColorFactor": [1, 4, 100]});
    let tinted = extension("KHR_materials_specular", tinted, 0.0);
    assert!((tinted.kr - Rgb::new(0.02, 0.08, 0.5)).abs().max_element() < 1e-6);
    let glass = extension("KHR_materials_transmission", json!({"transmissionFactor": 1}), 0.0);
    assert!((glass.kt - 0.96 * base).abs().max_element() < 1e-6 && glass.diffuse == Rgb::ZERO);
    assert_eq!(glass.ior, 1.0, "without a volume it is a thin wall");
    let shiny = json!({"diffuseFactor": [1, 1, 1, 1], "specularFactor": [0.5, 0, 0], "glossinessFactor": 1});
    let shiny = extension("KHR_materials_pbrSpecularGlossiness", shiny, 0.0);
    assert_eq!((shiny.kr, shiny.diffuse), (Rgb::X * 0.5, Rgb::splat(0.5)));
    assert_eq!(extension("KHR_materials_ior", json!({}), 1.0).kr, base, "a metal mirrors its colour");

    let solid = with_material(json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1},
        "KHR_materials_ior": {"ior": 1.4}}}));
    assert!((solid.materials[0].ior - 1.4).abs() < 1e-6);
    let blend =
        with_material(json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}}));
    assert_eq!((blend.materials[0].kt, blend.materials[0].ior), (Rgb::splat(0.75), 1.0));
    assert!(has_note(&blend, Treatment::Approximated, "BLEND"));
    assert!(has_note(&with_material(json!({"alphaMode": "MASK"})), Treatment::Ignored, "MASK"));
}

#[test]
fn extensions_are_refused_by_name_only_when_required() {
    let load = |key: &str, name: &str| File::default().load(json!({key: [name]}));
    assert!(has_note(&load("extensionsUsed", "VENDOR_odd").unwrap(), Treatment::Ignored, "VENDOR_odd"));
    for name in ["VENDOR_odd", "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu"] {
        let error = load("extensionsRequired", name).unwrap_err();
        assert!(error.fault() == Fault::Unsupported && error.to_string().contains(name), "{error}");
    }
}

#[test]
fn malformed_files_say_where() {
    let text = |text: &str| read(text.as_bytes(), Path::new(""), &LoadOptions::default(), &Silent).unwrap_err();
    let syntax = text("{\n \"asset\": {,}");
    assert_eq!((syntax.line(), syntax.column()), (Some(2), Some(12)));
    assert!(text(r#"{"asset": {"version": "1.0"}, "accessors": {}}"#).to_string().contains("1.0"));
    let dangling = json!({"meshes": [{"primitives": [{"attributes": {"POSITION": 7}}]}]});
    let error = File::default().load(dangling).unwrap_err();
    assert!(error.to_string().contains("meshes[0].primitives[0].attributes.POSITION"), "{error}");
    let error = File::default().load(json!({"buffers": [{"uri": "none.bin", "byteLength": 4}]})).unwrap_err();
    assert!(error.fault() == Fault::File && error.to_string().contains("buffers[0]"), "{error}");
    let short = json!({"buffers": [{"uri": "data:;base64,AAAA", "byteLength": 4}]});
    assert!(File::default().load(short).unwrap_err().to_string().contains("3 bytes"));
}

#[test]
fn small_files_do_not_unfold_without_end() {
    let mut file = File::default();
    let indices = file.accessor(&vec![0; 1 << 20], 5121, "SCALAR", 1 << 20);
    let position = file.triangle();
    let primitive = json!({"attributes": {"POSITION": position}, "indices": indices, "mode": 5});
    let rest = json!({"meshes": [{"primitives": vec![primitive; 1000]}], "nodes": [{"mesh": 0}]});
    assert_eq!(file.load(rest).unwrap_err().fault(), Fault::Limit);
}

fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(folder);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

fn open(path: &Path) -> Result<Model> {
    load(path, &LoadOptions::default(), &Silent)
}

fn triangles(model: &Model) -> usize {
    let count = |object: &crate::scene::Object| match object.shape {
        crate::scene::Shape::Mesh(mesh) => model.meshes[mesh as usize].triangle_count(),
        crate::scene::Shape::Quadric(_) => 0,
    };
    model.objects.iter().map(count).sum()
}

#[test]
fn known_models_have_their_known_triangles() {
    let Some(folder) = shared("gltf") else { return };
    for (name, expected) in [
        ("teapots_galore/teapots_galore.gltf", 7_656_770),
        ("dream-apartment.glb", 177_934),
        ("2CylinderEngine.glb", 121_496),
        ("FlightHelmet/FlightHelmet.gltf", 94_722),
        ("SpecularTest.glb", 44_828),
        ("PalmTree/PalmTree.gltf", 10_124),
        ("NormalTangentTest/NormalTangentTest.glb", 7_774),
        ("CesiumMan/CesiumMan.gltf", 4_672),
        ("Duck/Duck.gltf", 4_212),
        ("OrientationTest.glb", 524),
        ("TextureSettingsTest/TextureSettingsTest.gltf", 72),
        ("Box/Box.glb", 12),
        ("BoxTextured/BoxTextured.gltf", 12),
        ("BoxInterleaved/BoxInterleaved.gltf", 12),
        ("BoxVertexColors/BoxVertexColors.glb", 12),
        ("SimpleSparseAccessor/SimpleSparseAccessor.gltf", 12),
        ("Lights.glb", 12),
        ("TextureCoordinateTest/TextureCoordinateTest.gltf", 10),
        ("Cameras/Cameras.gltf", 2),
        ("SimpleMeshes/SimpleMeshes.gltf", 2),
        ("SimpleMorph/SimpleMorph.gltf", 1),
        ("TriangleWithoutIndices/TriangleWithoutIndices.gltf", 1),
    ] {
        let model = open(&folder.join(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(triangles(&model), expected, "{name}");
        assert!(!model.materials.is_empty(), "{name}");
        let materials = model.materials.len() as u32;
        for mesh in &model.meshes {
            assert!((0..mesh.triangle_count() as u32).all(|triangle| mesh.material(triangle) < materials), "{name}");
        }
        for used in model.materials.iter().filter_map(|material| material.diffuse_texture) {
            assert!((used.texture as usize) < model.textures.len(), "{name}");
        }
    }
}

#[test]
fn known_models_have_their_cameras_lights_and_textures() {
    let Some(folder) = shared("gltf") else { return };
    let cameras = open(&folder.join("Cameras/Cameras.gltf")).unwrap().cameras;
    let Camera::LookAt { eye, projection: Projection::Orthographic { height }, .. } = cameras[1].camera else {
        panic!("{cameras:?}")
    };
    assert_eq!((eye, height, cameras[0].name.as_str()), (DVec3::new(0.5, 0.5, 3.0), 2.0, "camera 0"));
    let lights = open(&folder.join("Lights.glb")).unwrap();
    assert!(lights.physical_lights && !lights.lights.is_empty() && !lights.cameras.is_empty());
    let helmet = open(&folder.join("FlightHelmet/FlightHelmet.gltf")).unwrap();
    assert!(helmet.textures.len() == 5 && helmet.meshes.iter().all(|mesh| mesh.normals.is_some()));
    assert!(has_note(&helmet, Treatment::Ignored, "normalTexture"));
    let teapots = open(&folder.join("teapots_galore/teapots_galore.gltf")).unwrap();
    assert!(teapots.objects.len() > 1890 && teapots.meshes.len() <= 3);

    let error = open(&folder.join("chess-board-draco.glb")).unwrap_err().to_string();
    for part in ["chess-board-draco.glb", "KHR_draco_mesh_compression", "gltf-transform"] {
        assert!(error.contains(part), "{error}");
    }
}

fn models_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            models_below(&path, found);
        } else if path.extension().is_some_and(|suffix| suffix == "gltf" || suffix == "glb") {
            found.push(path);
        }
    }
}

#[test]
fn nasty_files_load_or_say_why_not() {
    let Some(folder) = shared("nasty-gltf") else { return };
    let mut found = Vec::new();
    models_below(&folder, &mut found);
    assert!(found.len() >= 60, "{} files", found.len());
    for path in found {
        if let Err(error) = open(&path) {
            let name = path.file_name().unwrap().to_str().unwrap();
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let Some(folder) = shared("gltf") else { return };
    for name in ["SimpleMeshes/SimpleMeshes.gltf", "SimpleSparseAccessor/SimpleSparseAccessor.gltf", "Lights.glb"] {
        let path = folder.join(name);
        let (whole, folder) = (std::fs::read(&path).unwrap(), path.parent().unwrap());
        let digits: Vec<usize> = (0..whole.len()).filter(|&at| whole[at].is_ascii_digit()).collect();
        for at in digits {
            for replacement in [b'9', b'-', b'0'] {
                let mut damaged = whole.clone();
                damaged[at] = replacement;
                let _ = read(&damaged, folder, &LoadOptions::default(), &Silent);
            }
        }
        for end in (0..whole.trim_ascii_end().len()).step_by(7) {
            assert!(read(&whole[..end], folder, &LoadOptions::default(), &Silent).is_err(), "{name} cut at {end}");
        }
    }
}
