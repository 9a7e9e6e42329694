//! Every scene of ours and every real model at hand loads and renders.

use std::fs;
use std::path::{Path, PathBuf};

use whitted::accel::Params;
use whitted::formats::{LoadOptions, open};
use whitted::progress::Silent;
use whitted::render::{AovKind, Film, RenderSettings, Renderer};

/// Renders a file at one sample a pixel.
fn render(path: &Path, width: u32, height: u32) -> whitted::Result<Film> {
    let mut scene = open(path, &LoadOptions::default(), &Silent)?.scene;
    (scene.film.width, scene.film.height, scene.film.samples) = (width, height, 1);
    let settings = RenderSettings { aovs: vec![AovKind::Id], ..RenderSettings::default() };
    Renderer::build(scene, &Params::default(), &Silent)?.render(&settings, &Silent)
}

/// What is wrong with a film that shows objects: missing or bad pixels, nothing met, black on all that was met.
fn fault(film: &Film) -> Option<&'static str> {
    let instances = &film.aovs[0].channels[0];
    let met: Vec<[f32; 3]> =
        film.color.iter().zip(instances).filter(|(_, id)| id.to_bits() != 0).map(|(color, _)| *color).collect();
    if !film.complete {
        Some("not all pixels are there")
    } else if film.color.iter().flatten().any(|value| !value.is_finite() || *value < 0.0) {
        Some("a pixel is negative or not finite")
    } else if met.is_empty() {
        Some("no object is in the picture")
    } else if met.iter().all(|color| *color == [0.0; 3]) {
        Some("all objects are black")
    } else {
        None
    }
}

/// Files with one of the suffixes in a folder and, one level down, in its folders; sorted.
fn files(folder: &Path, suffixes: &[&str]) -> Vec<PathBuf> {
    let entries =
        |folder: &Path| -> Vec<PathBuf> { fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect() };
    let (folders, mut files): (Vec<_>, Vec<_>) = entries(folder).into_iter().partition(|path| path.is_dir());
    files.extend(folders.iter().flat_map(|folder| entries(folder)));
    files.retain(|file| suffixes.iter().any(|suffix| file.extension().is_some_and(|found| found == *suffix)));
    files.sort();
    files
}

#[test]
fn every_scene_renders() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scenes = files(&root.join("scenes"), &["toml"]);
    assert!(scenes.len() >= 6, "{scenes:?}");
    for scene in scenes {
        if scene.ends_with("terrain.toml") && !root.join("meshes/terrain.glb").exists() {
            eprintln!("skipped {}: its mesh is not there; the example make_meshes makes it", scene.display());
            continue;
        }
        let film = render(&scene, 32, 24).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(fault(&film), None, "{}", scene.display());
    }
}

#[test]
fn every_real_model_renders() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    if !data.exists() {
        eprintln!("skipped: {} is not there", data.display());
        return;
    }
    let mut models = files(&data.join("gltf"), &["gltf", "glb"]);
    models.extend(files(&data.join("obj"), &["obj"]));
    // A large one takes as long as all others together.
    models.retain(|model| !model.ends_with("dragon_vrip.obj"));
    assert!(models.len() >= 30, "{models:?}");
    for model in models {
        let rendered = render(&model, 16, 12);
        if model.ends_with("chess-board-draco.glb") {
            let message = rendered.expect_err("compressed with Draco").to_string();
            assert!(message.contains("draco"), "{message}");
            continue;
        }
        let film = rendered.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(fault(&film), None, "{}", model.display());
    }
}
