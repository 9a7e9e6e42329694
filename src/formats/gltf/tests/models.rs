//! Models of `shared/data`, with the triangle counts that its table states.

use std::path::PathBuf;

use glam::DVec3;

use super::super::load;
use super::*;
use crate::scene::{Camera, Object, Projection, Shape};

/// A folder of the shared models, if present.
pub(super) fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(folder);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}

pub(super) fn open(path: &Path) -> Result<Model> {
    load(path, &LoadOptions::default(), &Silent)
}

fn triangles(model: &Model) -> usize {
    let count = |object: &Object| match object.shape {
        Shape::Mesh(mesh) => model.meshes[mesh as usize].triangle_count(),
        Shape::Quadric(_) => 0,
    };
    model.objects.iter().map(count).sum()
}

/// All glTF files below a folder.
pub(super) fn models_below(folder: &Path, found: &mut Vec<PathBuf>) {
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
    assert!(helmet.textures.len() == 15 && helmet.meshes.iter().all(|mesh| mesh.normals.is_some()));
    assert!(has_note(&helmet, Treatment::Honoured, "normalTexture"));
    // The JSON, the buffer, and for five materials a base colour, metallic-roughness and normals.
    assert_eq!(helmet.ledger.files().count(), 17);
    let teapots = open(&folder.join("teapots_galore/teapots_galore.gltf")).unwrap();
    assert!(teapots.objects.len() > 1890 && teapots.meshes.len() <= 3);

    let error = open(&folder.join("chess-board-draco.glb")).unwrap_err().to_string();
    for part in ["chess-board-draco.glb", "KHR_draco_mesh_compression", "gltf-transform"] {
        assert!(error.contains(part), "{error}");
    }
}
