//! Files that lie, are damaged, or want what is not there.

use serde_json::json;

use super::models::{models_below, open, shared};
use super::*;
use crate::error::Fault;

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

#[test]
fn numbers_beyond_f32_do_no_harm() {
    let model = with_material(json!({"emissiveFactor": [1e300, 0, 0],
        "pbrMetallicRoughness": {"roughnessFactor": 1e300, "baseColorFactor": [1e300, 0, 0, 1]}}));
    assert!(model.materials[0].emission.is_finite() && has_note(&model, Treatment::Warning, "out of range"));
    let light = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1e300}]}});
    let node = json!({"extensions": {"KHR_lights_punctual": {"light": 0}}});
    let model = File::default().load(json!({"extensions": light, "nodes": [node]})).unwrap();
    assert!(model.lights.is_empty() && has_note(&model, Treatment::Warning, "light"));
}

#[test]
fn names_that_come_often_take_no_time() {
    let camera = json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}});
    let nodes = vec![json!({"camera": 0}); 20_000];
    let model = File::default().load(json!({"cameras": [camera], "nodes": nodes})).unwrap();
    assert_eq!(model.cameras[19_999].name, "camera 0 (20000)");
}

#[test]
fn compressed_views_without_a_copy_are_refused_by_name() {
    let compressed = json!({"EXT_meshopt_compression": {"buffer": 0, "byteLength": 1, "byteStride": 12, "count": 3}});
    let rest = json!({
        "extensionsUsed": ["EXT_meshopt_compression"],
        "buffers": [{"byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36, "extensions": compressed}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    });
    let error = File::default().load(rest).unwrap_err().to_string();
    assert!(error.contains("EXT_meshopt_compression") && error.contains("gltf-transform"), "{error}");
}
