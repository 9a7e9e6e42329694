//! Colours and tangents of vertices, and attributes that are not read.

use glam::{Vec3, Vec4};
use serde_json::json;

use super::*;
use crate::formats::{NormalMode, Scope};

/// What the ledger tells of the first mesh, as honoured.
fn honoured_in_first_mesh(model: &Model) -> Vec<&str> {
    let entries = model
        .ledger
        .all()
        .filter(|(treatment, _, entry)| *treatment == Treatment::Honoured && entry.scopes.contains(&Scope::Mesh(0)));
    entries.map(|(_, feature, _)| feature).collect()
}

#[test]
fn colours_of_every_kind_are_fractions_of_65535() {
    let whole = u16::MAX;
    let floats = [[0.0f32, 0.5, 1.0], [1.0, 0.25, 0.0], [0.2, 0.4, 0.6]];
    let with_alpha = floats.map(|[r, g, b]| [r, g, b, 0.5]);
    // 0.5 lies between 32767 and 32768, to the latter of which it is rounded.
    let expected = [[0, 32768, whole, whole], [whole, 16384, 0, whole], [13107, 26214, 39321, whole]];
    let load = |file: &File, accessor: usize| {
        file.load(one(json!({"attributes": {"POSITION": 0, "COLOR_0": accessor}}))).unwrap()
    };
    let mut file = File::default();
    file.triangle();
    let (opaque, half) = (file.floats(&floats), file.floats(&with_alpha));
    let model = load(&file, opaque);
    assert_eq!(model.meshes[0].colors.as_deref().unwrap(), expected);
    assert_eq!(honoured_in_first_mesh(&model), ["vertex colours (COLOR_0)"]);
    let colors = load(&file, half).meshes.remove(0).colors.unwrap();
    assert_eq!(colors, expected.map(|[r, g, b, _]| [r, g, b, 32768]));

    // Bytes b are b / 255 = 257 b / 65535; shorts are what is stored.
    let bytes = file.accessor(&[0, 1, 128, 255, 7, 8, 9, 0, 255, 254, 2, 3], 5121, "VEC4", 3);
    let shorts: Vec<u8> = [0u16, 1, 2, 3, 40_000, 65_535, 9, 8, 7].iter().flat_map(|x| x.to_le_bytes()).collect();
    let shorts = file.accessor(&shorts, 5123, "VEC3", 3);
    for accessor in [bytes, shorts] {
        file.accessors[accessor]["normalized"] = json!(true);
    }
    let colors = load(&file, bytes).meshes.remove(0).colors.unwrap();
    assert_eq!(colors, [[0, 1, 128, 255], [7, 8, 9, 0], [255, 254, 2, 3]].map(|color| color.map(|x: u16| 257 * x)));
    let colors = load(&file, shorts).meshes.remove(0).colors.unwrap();
    assert_eq!(colors, [[0, 1, 2, whole], [3, 40_000, 65_535, whole], [9, 8, 7, whole]]);
    file.accessors[shorts]["normalized"] = json!(false);
    let model = load(&file, shorts);
    assert!(model.meshes[0].colors.as_ref().unwrap() == &colors && has_note(&model, Treatment::Warning, "COLOR_0"));

    let beyond = file.floats(&[[2.0, -1.0, f32::NAN], [0.0; 3], [1.0; 3]]);
    let model = load(&file, beyond);
    assert_eq!(model.meshes[0].colors.as_ref().unwrap()[0], [whole, 0, 0, whole]);
    assert!(has_note(&model, Treatment::Approximated, "beyond 0 to 1"));
}

#[test]
fn vertices_without_colours_beside_others_are_white() {
    let mut file = File::default();
    let (position, color) = (file.triangle(), file.floats(&[[0.0f32; 3]; 3]));
    let (plain, black) = (json!({"POSITION": position}), json!({"POSITION": position, "COLOR_0": color}));
    let load =
        |primitives: Value| file.load(json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": primitives}]})).unwrap();
    let colors =
        load(json!([{"attributes": plain}, {"attributes": black}, {"attributes": plain}])).meshes.remove(0).colors;
    let (white, black) = ([u16::MAX; 4], [0, 0, 0, u16::MAX]);
    assert_eq!(colors.unwrap(), [white, white, white, black, black, black, white, white, white]);
    assert_eq!(load(json!([{"attributes": plain}])).meshes[0].colors, None);
}

#[test]
fn attributes_without_a_use_are_told() {
    let mut file = File::default();
    let (position, uv, color) = (file.triangle(), file.floats(&[[0.0f32; 2]; 3]), file.floats(&[[0.0f32; 3]; 3]));
    let joints = file.accessor(&[0; 12], 5121, "VEC4", 3);
    let model = file
        .load(one(
            json!({"attributes": {"POSITION": position, "TEXCOORD_2": uv, "COLOR_1": color, "_TEMPERATURE": color,
            "JOINTS_0": joints}}),
        ))
        .unwrap();
    for text in ["TEXCOORD_2", "COLOR_1", "_TEMPERATURE", "JOINTS_0"] {
        assert!(has_note(&model, Treatment::Ignored, text), "{text}");
    }
}

/// A file of one square in the plane z = 0, whose u grows along x and v, in the image downwards, along -y; with a normal
/// map.
fn mapped(file: &mut File) -> Value {
    let corners = [[0.0f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let position = file.floats(&corners.map(|[x, y]| [x, y, 0.0]));
    let (normal, uv) = (file.floats(&[[0.0f32, 0.0, 1.0]; 4]), file.floats(&corners.map(|[x, y]| [x, 1.0 - y])));
    let indices = file.accessor(&[0, 1, 2, 0, 2, 3], 5121, "SCALAR", 6);
    let image = image::RgbImage::from_pixel(1, 1, image::Rgb([128, 128, 255]));
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut rest = one(json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv},
        "indices": indices, "material": 0}));
    rest["materials"] = json!([{"normalTexture": {"index": 0}}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["images"] = json!([{"uri": data_uri(png.get_ref()).replace("octet-stream", "png")}]);
    rest
}

#[test]
fn tangents_are_those_of_the_file_or_computed_where_a_normal_map_wants_them() {
    let mut file = File::default();
    let mut rest = mapped(&mut file);
    let model = file.load(rest.clone()).unwrap();
    // u grows along +x, v as it is stored along +y, which is cross(z, x): w is 1, as in the file's convention.
    assert_eq!(model.meshes[0].tangents.as_deref().unwrap(), [Vec4::new(1.0, 0.0, 0.0, 1.0); 4]);
    assert!(has_note(&model, Treatment::Honoured, "tangents computed"));

    let own = [Vec4::new(0.6, 0.8, 0.0, -1.0), Vec4::X, Vec4::Y, Vec4::NEG_X];
    let tangent = file.floats(&own.map(|tangent| tangent.to_array()));
    rest["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangent);
    let model = file.load(rest.clone()).unwrap();
    assert_eq!(model.meshes[0].tangents.as_deref().unwrap(), own);
    assert_eq!(honoured_in_first_mesh(&model), ["tangents (TANGENT)"]);
    // A node that mirrors changes nothing in the mesh.
    rest["nodes"][0]["scale"] = json!([-1, 1, 1]);
    assert_eq!(file.load(rest.clone()).unwrap().meshes[0].tangents.as_deref().unwrap(), own);

    let mut plain = rest.clone();
    plain["materials"] = json!([{}]);
    assert_eq!(file.load(plain).unwrap().meshes[0].tangents, None);
    for (normals, expected) in [(NormalMode::Flat, None), (NormalMode::Smooth, Some(Vec4::new(1.0, 0.0, 0.0, 1.0)))] {
        let options = LoadOptions { normals, ..Default::default() };
        let mesh = load_json(&file.json(rest.clone()), &options).unwrap().meshes.remove(0);
        assert_eq!(mesh.tangents.map(|tangents| tangents[0]), expected);
        assert_eq!(mesh.normals.map(|normals| normals[0]), expected.map(|_| Vec3::Z));
    }
}
