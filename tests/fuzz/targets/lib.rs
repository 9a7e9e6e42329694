//! What the targets share: limits that keep a run quick, and what must hold of everything that loads.

use std::path::PathBuf;
use std::sync::LazyLock;

use tempfile::TempDir;
use whitted::formats::{Limits, LoadOptions, Model, NormalMode, UpAxis};
use whitted::geometry::TriangleMesh;

/// An empty folder that models are in, so that what they name is not there. One a process.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a temporary folder"));

/// The folder that models are in.
pub fn folder() -> PathBuf {
    FOLDER.path().to_owned()
}

/// Options with small limits; a byte of the input chooses the rest.
pub fn options(choice: u8) -> LoadOptions {
    LoadOptions {
        normals: [NormalMode::File, NormalMode::Flat, NormalMode::Smooth][usize::from(choice % 3)],
        up: if choice & 4 == 0 { UpAxis::Y } else { UpAxis::Z },
        faces: choice & 8 != 0,
        crease_angle: (choice & 16 != 0).then_some(0.7),
        time: (choice & 32 != 0).then_some(0.5),
        limits: Limits { file_bytes: 1 << 20, vertices: 1 << 16, texels: 1 << 16, depth: 1 << 12, data_uri_bytes: 1 << 16 },
        ..LoadOptions::default()
    }
}

/// What rendering relies on.
pub fn check(model: &Model) {
    for mesh in &model.meshes {
        check_mesh(mesh);
        let materials = model.materials.len();
        assert!((0..mesh.triangle_count() as u32).all(|number| (mesh.material(number) as usize) < materials));
    }
    for texture in model.materials.iter().flat_map(|material| material.textures()) {
        assert!((texture.texture as usize) < model.textures.len());
    }
}

/// Every triangle that can be hit has vertices, and they are finite.
pub fn check_mesh(mesh: &TriangleMesh) {
    for number in mesh.live_triangles() {
        assert!(mesh.triangle(number).iter().all(|vertex| vertex.is_finite()));
    }
}
