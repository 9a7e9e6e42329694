//! Golden images of models that others made to show whether a reader of glTF is right. The models are not part of the project;
//! where they are absent the tests are skipped. What each must show was seen with the eye before its picture was kept.

use whitted::formats::{LoadOptions, open};
use whitted::progress::Silent;
use whitted::scene::auto::{self, View};

use crate::common::shared;
use crate::golden::{compare, png};

/// Renders a model from a side and compares the picture with the one that is kept.
fn check(name: &str, file: &str, view: View) {
    let Some(path) = shared(&format!("gltf/{file}")) else { return };
    let options = LoadOptions { cull_back_faces: true, ..LoadOptions::default() };
    let mut scene = open(&path, &options, &Silent).unwrap().scene;
    (scene.film.width, scene.film.height, scene.film.samples) = (200, 150, 9);
    let (azimuth, elevation) = view.angles();
    scene.cameras[scene.active_camera].camera = auto::frame(&scene, azimuth, elevation, 0.6);
    compare(&format!("models/{name}"), &png(scene));
}

/// Arrows on the faces of a cube lie beside arrows on the ground that the file's matrices, rotations and scales have
/// turned in the same way.
#[test]
fn orientation() {
    check("orientation", "OrientationTest.glb", View::Iso);
}

/// Each of four squares shows its own quarter of one image, whose chequered corner points outwards. The model looks
/// to -Z, so that it is seen from there.
#[test]
fn texture_coordinates() {
    check("texture_coordinates", "TextureCoordinateTest/TextureCoordinateTest.gltf", View::Back);
}

/// The left column has the same ticks as the right one: single- and double-sided squares, and images that are clamped, repeated
/// and mirrored along each axis.
#[test]
fn texture_settings() {
    check("texture_settings", "TextureSettingsTest/TextureSettingsTest.gltf", View::Front);
}

/// Half spheres of triangles beside flat squares with normal maps of such: light and reflections fall from the same
/// side, however the coordinates of the images are turned.
#[test]
fn normal_tangents() {
    check("normal_tangents", "NormalTangentTest/NormalTangentTest.glb", View::Front);
}

/// Black spheres that reflect more from left to right, by a factor in one row and by an image in the next, which must look
/// the same.
#[test]
fn specular() {
    check("specular", "SpecularTest.glb", View::Front);
}
