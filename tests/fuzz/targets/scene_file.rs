//! A scene file; the models and images that it names are not there, but for one model.
#![no_main]

use std::sync::Once;

use libfuzzer_sys::fuzz_target;
use whitted::formats::scene_file;
use whitted::progress::Silent;
use whitted_fuzz::{check_mesh, folder, options};

static WRITE_MODEL: Once = Once::new();

fuzz_target!(|bytes: &[u8]| {
    WRITE_MODEL.call_once(|| {
        let model = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
        std::fs::write(folder().join("a.obj"), model).expect("the temporary folder can be written");
    });
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(loaded) = scene_file::parse(text, &folder().join("scene.toml"), &options(0), &Silent) else { return };
    loaded.scene.meshes.iter().for_each(|mesh| check_mesh(mesh));
    assert!(loaded.scene.active_camera < loaded.scene.cameras.len());
});
