//! Scenes that several tests share, built through the public API.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3, Vec3};
use whitted::accel::{Kind, Params};
use whitted::geometry::{Quadric, TriangleMesh};
use whitted::progress::Silent;
use whitted::render::{Film, RenderSettings, Renderer};
use whitted::scene::{
    Background, Camera, Falloff, FilmSettings, Light, LightKind, Material, NamedCamera, Object, Projection, Rgb, Scene,
    Shape,
};

/// A scene of 1x1 pixel with nothing in it, black all around.
pub fn empty_scene() -> Scene {
    let mut scene = Scene { ambient: Rgb::ZERO, background: Background::Color(Rgb::ZERO), ..Scene::default() };
    scene.film = FilmSettings { width: 1, height: 1, samples: 1, ..FilmSettings::default() };
    look(&mut scene, DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO);
    scene
}

/// Points the scene's only camera; 1 degree wide, so that the one pixel's ray is all there is.
pub fn look(scene: &mut Scene, eye: DVec3, target: DVec3) {
    let forward = (target - eye).normalize();
    let up = if forward.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let projection = Projection::Perspective { fov_y: 1f64.to_radians() };
    scene.cameras = vec![NamedCamera::new("test", Camera::LookAt { eye, target, up, projection })];
}

/// Adds a quadric with a material of its own.
pub fn add_quadric(scene: &mut Scene, quadric: Quadric, transform: DAffine3, material: Material) {
    let shape = Shape::Quadric(scene.quadrics.len() as u32);
    scene.quadrics.push(quadric);
    add_object(scene, shape, transform, material);
}

/// Adds a mesh with a material of its own.
pub fn add_mesh(scene: &mut Scene, mesh: TriangleMesh, transform: DAffine3, material: Material) {
    let shape = Shape::Mesh(scene.meshes.len() as u32);
    scene.meshes.push(mesh.finish().unwrap().into());
    add_object(scene, shape, transform, material);
}

fn add_object(scene: &mut Scene, shape: Shape, transform: DAffine3, material: Material) {
    let material_number = scene.materials.len() as u32;
    scene.materials.push(material);
    let name = format!("object {}", scene.objects.len());
    scene.objects.push(Object { name, shape, transform, material: Some(material_number) });
}

/// Adds a point light without falloff.
pub fn add_light(scene: &mut Scene, position: DVec3, color: Rgb) {
    let kind = LightKind::Point { position, falloff: Falloff::None };
    scene.lights.push(Light { name: "light".into(), kind, color });
}

/// Black, without highlight: what a test does not set contributes nothing.
pub fn black() -> Material {
    Material { ambient: Some(Rgb::ZERO), diffuse: Rgb::ZERO, ks: Rgb::ZERO, kr: Rgb::ZERO, ..Material::default() }
}

/// Matt white.
pub fn white() -> Material {
    Material { diffuse: Rgb::ONE, ..black() }
}

/// A rectangle of two triangles: `corner`, `corner + across`, ..., facing `across x up`.
pub fn rectangle(corner: Vec3, across: Vec3, up: Vec3) -> TriangleMesh {
    TriangleMesh {
        positions: vec![corner, corner + across, corner + across + up, corner + up].into(),
        indices: vec![[0, 1, 2], [0, 2, 3]].into(),
        ..TriangleMesh::default()
    }
}

/// The cube [-1, 1]^3, faces outward.
pub fn cube() -> TriangleMesh {
    let positions = (0..8).map(|i| {
        let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        Vec3::new(side(0), side(1), side(2))
    });
    let indices = vec![
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    TriangleMesh { positions: positions.collect(), indices: indices.into(), ..TriangleMesh::default() }
}

/// A closed sphere of `rings` x `segments` quads cut into triangles, poles shared; faces outward.
pub fn sphere_mesh(radius: f64, center: DVec3, rings: u32, segments: u32) -> TriangleMesh {
    let (points, indices) = whitted::measure::scenes::sphere_points(rings, segments);
    let positions = points.into_iter().map(|p| (p * radius + center).as_vec3()).collect();
    TriangleMesh { positions, indices: indices.into(), ..TriangleMesh::default() }
}

/// Renders with the default structure and one thread.
pub fn render(scene: &Scene) -> Film {
    render_with(scene, Kind::Auto, 1)
}

/// Renders with a structure and a number of threads.
pub fn render_with(scene: &Scene, kind: Kind, threads: usize) -> Film {
    let params = Params { kind, ..Params::default() };
    let renderer = Renderer::build(scene.clone(), &params, &Silent).unwrap();
    renderer.render(&RenderSettings { threads, ..RenderSettings::default() }, &Silent).unwrap()
}

/// The colour of the scene's one pixel.
pub fn pixel(scene: &Scene) -> Rgb {
    Rgb::from_array(render(scene).color[0])
}

/// Fails where two colours are farther apart than `tolerance` in a channel.
pub fn near(a: Rgb, b: Rgb, tolerance: f32) {
    assert!((a - b).abs().max_element() <= tolerance, "{a} is not {b}");
}

/// A file or folder of models that others made, which are not part of the project; `None`, with a message, where it is absent.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is absent", path.display());
    None
}
