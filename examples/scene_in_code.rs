//! Builds a scene in code, without any file: a mirror sphere and a triangle on a checkered floor, under two lights.
//!
//! ```text
//! cargo run --release --example scene_in_code [-- OUT.png]
//! ```

use glam::{DAffine3, DVec2, DVec3, Vec3};
use whitted::accel::Params;
use whitted::formats::picture;
use whitted::geometry::{TriangleMesh, shapes};
use whitted::progress::Silent;
use whitted::render::{RenderSettings, Renderer};
use whitted::scene::texture::{Filter, Texels};
use whitted::scene::{
    Background, Camera, Falloff, FilmSettings, Light, LightKind, Material, NamedCamera, Object, Projection, Rgb, Scene,
    Shape, Texture, TextureRef,
};

/// Two by two squares; the floor repeats them.
fn checker() -> Texture {
    let (dark, light) = ([60, 70, 90, 255], [225, 220, 205, 255]);
    let texels = Texels::Srgb8(vec![dark, light, light, dark].into());
    Texture { filter: Filter::Nearest, ..Texture::new("checker", 2, 2, texels) }
}

/// One triangle, counter-clockwise seen from the camera.
fn triangle() -> whitted::Result<TriangleMesh> {
    let positions = vec![Vec3::new(-2.6, 0.0, -0.6), Vec3::new(-0.6, 0.0, -1.4), Vec3::new(-1.7, 2.2, -1.2)];
    TriangleMesh {
        name: "triangle".into(),
        positions: positions.into(),
        indices: [[0, 1, 2]].into(),
        ..TriangleMesh::default()
    }
    .finish()
}

fn scene() -> whitted::Result<Scene> {
    let tiles = TextureRef::scaled(0, DVec2::splat(8.0), DVec2::ZERO);
    let material = |name: &str, diffuse: Rgb, kr: f32| {
        let (ks, kr) = (Rgb::splat(0.4), Rgb::splat(kr));
        Material { name: name.into(), diffuse, ks, shininess: 60.0, kr, ..Material::default() }
    };
    let object = |name: &str, shape: Shape, position: DVec3, material: u32| {
        let transform = DAffine3::from_translation(position);
        Object { name: name.into(), shape, transform, material: Some(material) }
    };
    let light = |name: &str, kind: LightKind, color: Rgb| Light { name: name.into(), kind, color };
    let lamp = LightKind::Point { position: DVec3::new(3.0, 5.0, 4.0), falloff: Falloff::None };
    let sun = LightKind::Directional { direction: DVec3::new(1.0, -1.0, -0.5) };
    let camera = Camera::LookAt {
        eye: DVec3::new(0.0, 2.2, 7.0),
        target: DVec3::new(-0.2, 0.9, 0.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y: 36f64.to_radians() },
    };
    Ok(Scene {
        film: FilmSettings { width: 480, height: 320, samples: 4, ..FilmSettings::default() },
        background: Background::Gradient { bottom: Rgb::ONE, top: Rgb::new(0.15, 0.3, 0.6), up: DVec3::Y },
        cameras: vec![NamedCamera::new("main", camera)],
        lights: vec![light("lamp", lamp, Rgb::splat(0.7)), light("sun", sun, Rgb::new(0.3, 0.28, 0.22))],
        materials: vec![
            Material { diffuse_texture: Some(tiles), ..material("floor", Rgb::ONE, 0.05) },
            material("mirror", Rgb::splat(0.1), 0.8),
            material("red", Rgb::new(0.75, 0.08, 0.05), 0.0),
        ],
        textures: vec![checker()],
        meshes: vec![triangle()?.into()],
        quadrics: vec![shapes::plane(Some(8.0)), shapes::sphere()],
        objects: vec![
            object("floor", Shape::Quadric(0), DVec3::ZERO, 0),
            object("ball", Shape::Quadric(1), DVec3::new(0.8, 1.0, 0.0), 1),
            object("sail", Shape::Mesh(0), DVec3::ZERO, 2),
        ],
        ..Scene::default()
    })
}

fn main() -> whitted::Result<()> {
    let output = std::env::args().nth(1).unwrap_or("scene_in_code.png".into());
    let renderer = Renderer::build(scene()?, &Params::default(), &Silent)?;
    picture::save(&renderer.render(&RenderSettings::default(), &Silent)?, output.as_ref())
}
