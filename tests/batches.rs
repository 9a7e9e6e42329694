//! Pictures are made of batches of rays, depth by depth; the recursion must see the same, bit for bit.

use std::path::Path;

use glam::DVec2;
use whitted::accel::Params;
use whitted::formats::{self, LoadOptions};
use whitted::progress::Silent;
use whitted::render::trace::Tracer;
use whitted::render::{RenderSettings, Renderer, sampling};
use whitted::scene::Scene;
use whitted::scene::film::Clamp;

#[test]
fn batches_see_what_the_recursion_sees() {
    let shown = ["cornell_box", "glass_over_checker", "mirrors", "quadrics", "seed_camera", "teapot", "textured_crate"];
    let golden = ["spot_cone", "orthographic", "instances", "normals", "gltf_import", "transparent_shadow"];
    let scenes = shown.map(|name| format!("scenes/{name}.toml"));
    for name in scenes.into_iter().chain(golden.map(|name| format!("tests/golden/{name}.toml"))) {
        for clamp in [Clamp::Shade, Clamp::Output] {
            let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(&name);
            let mut scene = formats::open(&file, &LoadOptions::default(), &Silent).unwrap().scene;
            scene.film.clamp = clamp;
            check(scene, &format!("{name}, {clamp:?}"));
        }
    }
}

#[test]
fn batches_see_details_as_the_recursion_does() {
    for clamp in [Clamp::Shade, Clamp::Output] {
        let mut scene = crate::detail::everything();
        scene.film.clamp = clamp;
        check(scene, &format!("detail, {clamp:?}"));
    }
}

/// So many objects that they share blocks, of one material, every other one with colours at its vertices.
#[test]
fn batches_tell_coloured_meshes_from_others_of_the_same_material() {
    let mut scene = crate::detail::coloured_and_plain_squares(100);
    scene.film.clamp = Clamp::Output;
    check(scene, "squares");
}

/// Renders a small picture in both ways.
fn check(mut scene: Scene, name: &str) {
    // Neither size is a multiple of the side of a block of pixels.
    (scene.film.width, scene.film.height, scene.film.samples) = (41, 27, 3);
    let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
    let film = renderer.render(&RenderSettings::default(), &Silent).unwrap();
    let scene = renderer.scene();
    let camera = scene.camera().rays(41, 27, scene.origin).unwrap();
    let tracer = Tracer::new(scene, renderer.world(), &renderer);
    for (number, found) in film.color.iter().enumerate() {
        let (x, y) = (number as u32 % 41, number as u32 / 41);
        let mut sum = [0.0f64; 3];
        for sample in 0..3 {
            let at = DVec2::new(x.into(), y.into()) + sampling::position(x, y, sample, 3);
            let (color, _) = tracer.trace_camera(camera.ray(at).unwrap());
            for (sum, value) in sum.iter_mut().zip(color.to_array()) {
                *sum += f64::from(value);
            }
        }
        assert_eq!(*found, sum.map(|sum| (sum / 3.0) as f32), "{name}, pixel {x}, {y}");
    }
    assert_eq!(film.stats.rays, tracer.counts(), "{name}");
}
