//! Small scenes whose answers are known, and what the renderer did with a ray through them.

use std::sync::Mutex;

use glam::{DAffine3, DMat3, DVec3};

use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Hit, Key, Quadric, Ray, TriangleMesh};
use crate::math::origin::choose_origin;
use crate::progress::Progress;
use crate::render::trace::Tracer;
use crate::render::{Intersect, RayCounts, Renderer};
use crate::scene::camera::ViewRay;
use crate::scene::{Background, Falloff, Light, LightKind, Material, Object, Rgb, Scene, Shape};

/// A scene with nothing in it: no ambient light, black all around.
pub fn empty() -> Scene {
    Scene { ambient: Rgb::ZERO, background: Background::Color(Rgb::ZERO), ..Scene::default() }
}

/// Contributes nothing: what a case does not set is black.
pub fn black() -> Material {
    Material { ambient: Some(Rgb::ZERO), diffuse: Rgb::ZERO, ks: Rgb::ZERO, kr: Rgb::ZERO, ..Material::default() }
}

/// Matt white: its brightness is the sum of N.L over the lights that it sees.
pub fn white() -> Material {
    Material { diffuse: Rgb::ONE, ..black() }
}

/// Mirrors a share of what it sees and adds `emission` of its own.
pub fn mirror(share: f32, emission: f32) -> Material {
    Material { kr: Rgb::splat(share), emission: Rgb::splat(emission), ..black() }
}

/// A mesh of positions in f64, stored as the loaders store them: relative to an origin of its own.
///
/// # Errors
/// As [`TriangleMesh::finish`].
pub fn mesh_at(positions: &[DVec3], indices: Vec<[u32; 3]>) -> Result<TriangleMesh> {
    let origin = choose_origin(positions.iter().copied());
    let positions = positions.iter().map(|&p| (p - origin).as_vec3()).collect();
    TriangleMesh { origin, positions, indices: indices.into(), ..TriangleMesh::default() }.finish()
}

/// Adds a finished mesh with a material of its own; gives its instance number.
pub fn add_mesh(scene: &mut Scene, mesh: TriangleMesh, transform: DAffine3, material: Material) -> u32 {
    let shape = Shape::Mesh(scene.meshes.len() as u32);
    scene.meshes.push(mesh.into());
    add_object(scene, shape, transform, material)
}

/// Adds a quadric with a material of its own; gives its instance number.
pub fn add_quadric(scene: &mut Scene, quadric: Quadric, transform: DAffine3, material: Material) -> u32 {
    let shape = Shape::Quadric(scene.quadrics.len() as u32);
    scene.quadrics.push(quadric);
    add_object(scene, shape, transform, material)
}

fn add_object(scene: &mut Scene, shape: Shape, transform: DAffine3, material: Material) -> u32 {
    let number = scene.objects.len() as u32;
    scene.materials.push(material);
    let material = Some(scene.materials.len() as u32 - 1);
    scene.objects.push(Object { name: format!("object {number}"), shape, transform, material });
    number
}

/// Adds a white point light without falloff.
pub fn add_light(scene: &mut Scene, position: DVec3) {
    let kind = LightKind::Point { position, falloff: Falloff::None };
    scene.lights.push(Light { name: format!("light {}", scene.lights.len()), kind, color: Rgb::ONE });
}

/// The map that scales by `size`, then moves by `to`.
pub fn placed(to: DVec3, size: f64) -> DAffine3 {
    DAffine3 { matrix3: DMat3::from_diagonal(DVec3::splat(size)), translation: to }
}

/// The scene relative to the origin that a loader would choose, with its structures.
///
/// # Errors
/// As [`Renderer::build`].
pub fn build(mut scene: Scene, params: &Params, progress: &dyn Progress) -> Result<Renderer> {
    scene.origin = crate::scene::origin::choose(&scene);
    Renderer::build(scene, params, progress)
}

/// What a camera ray saw and cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// The linear colour.
    pub color: Rgb,
    /// What the camera ray itself hit.
    pub hit: Hit,
    /// The rays that it took.
    pub counts: RayCounts,
}

/// Traces one camera ray, which is relative to the scene's origin; its direction may have any length but 0.
pub fn see(renderer: &Renderer, origin: DVec3, direction: DVec3) -> Seen {
    let tracer = Tracer::new(renderer.scene(), renderer.world(), renderer);
    let (color, hit) = tracer.trace_camera(view(origin, direction));
    Seen { color, hit, counts: tracer.counts() }
}

/// The colour of a point, given what is hit there: as [`see`] without looking for the hit.
pub fn shade(renderer: &Renderer, origin: DVec3, direction: DVec3, hit: &Hit) -> Seen {
    let tracer = Tracer::new(renderer.scene(), renderer.world(), renderer);
    let color = tracer.shade(&view(origin, direction), hit, 0);
    Seen { color, hit: *hit, counts: tracer.counts() }
}

/// The rays that a camera ray became on its way through mirrors, itself first, as the structures were asked them, and
/// what it saw.
pub fn path(renderer: &Renderer, origin: DVec3, direction: DVec3) -> (Vec<Ray>, Rgb) {
    let recorder = Recorder { renderer, asked: Mutex::default() };
    let tracer = Tracer::new(renderer.scene(), renderer.world(), &recorder);
    let (color, _) = tracer.trace_camera(view(origin, direction));
    (recorder.asked.into_inner().unwrap_or_default(), color)
}

/// The view ray with that direction made a unit vector; a direction of length 0 stays.
pub fn view(origin: DVec3, direction: DVec3) -> ViewRay {
    ViewRay { origin, direction: crate::math::vector::normalize(direction).unwrap_or(direction) }
}

/// Remembers the rays whose closest hits were asked for.
struct Recorder<'a> {
    renderer: &'a Renderer,
    asked: Mutex<Vec<Ray>>,
}

impl Intersect for Recorder<'_> {
    fn closest(&self, ray: &Ray) -> Hit {
        if let Ok(mut asked) = self.asked.lock() {
            asked.push(*ray);
        }
        self.renderer.closest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.renderer.occluded(ray)
    }

    fn occluded_by_opaque(&self, ray: &Ray) -> bool {
        self.renderer.occluded_by_opaque(ray)
    }

    fn next_after(&self, ray: &Ray, key: Key) -> Hit {
        self.renderer.next_after(ray, key)
    }

    fn next_transmissive_after(&self, ray: &Ray, key: Key) -> Hit {
        self.renderer.next_transmissive_after(ray, key)
    }
}

/// A closed sphere of `rings` x `segments` quads cut into triangles, poles shared, faces outward: unit positions in
/// f64, to be placed by the caller.
pub fn sphere_points(rings: u32, segments: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut positions = vec![DVec3::Y];
    for ring in 1..rings {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(ring) / f64::from(rings));
        for segment in 0..segments {
            let (z, x) = libm::sincos(std::f64::consts::TAU * f64::from(segment) / f64::from(segments));
            positions.push(DVec3::new(sin * x, cos, sin * z));
        }
    }
    positions.push(DVec3::NEG_Y);
    let last = positions.len() as u32 - 1;
    let at = |ring: u32, segment: u32| 1 + (ring - 1) * segments + segment % segments;
    let mut indices = Vec::new();
    for s in 0..segments {
        indices.push([0, at(1, s + 1), at(1, s)]);
        indices.push([last, at(rings - 1, s), at(rings - 1, s + 1)]);
        for ring in 1..rings - 1 {
            let (a, b, c, d) = (at(ring, s), at(ring, s + 1), at(ring + 1, s + 1), at(ring + 1, s));
            indices.push([a, b, c]);
            indices.push([a, c, d]);
        }
    }
    (positions, indices)
}

/// The cube [-1, 1]^3, faces outward.
pub fn cube_points() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
        DVec3::new(side(0), side(1), side(2))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    ((0..8).map(corner).collect(), quads.into_iter().flat_map(halves).collect())
}

/// A rectangle of two triangles from `corner` along `across` and `up`, facing `across x up`.
pub fn rectangle_points(corner: DVec3, across: DVec3, up: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    (vec![corner, corner + across, corner + across + up, corner + up], vec![[0, 1, 2], [0, 2, 3]])
}

/// The f32 spacing at a number's magnitude: the unit of most bars.
pub fn ulp(x: f64) -> f64 {
    let x = (x.abs() as f32).max(f32::MIN_POSITIVE);
    f64::from(x.next_up()) - f64::from(x)
}

/// A vector's largest coordinate in magnitude.
pub fn largest(p: DVec3) -> f64 {
    p.abs().max_element()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::math::vector::{cross, dot};
    use crate::progress::Silent;

    #[test]
    fn spheres_and_cubes_are_closed_and_face_outward() {
        for (positions, indices) in [sphere_points(5, 7), cube_points()] {
            let mut edges = std::collections::HashMap::new();
            for &[a, b, c] in &indices {
                let [p, q, r] = [a, b, c].map(|i| positions[i as usize]);
                assert!(dot(cross(q - p, r - p), p) > 0.0, "{a} {b} {c}");
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((from.min(to), from.max(to))).or_insert(0) += if from < to { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&sum| sum == 0));
            assert_eq!(positions.len() + indices.len(), edges.len() + 2, "Euler's formula");
        }
    }

    #[test]
    fn a_path_is_the_rays_that_were_asked() {
        let mut scene = empty();
        let (positions, indices) = rectangle_points(DVec3::new(-1.0, -1.0, 0.0), DVec3::X * 2.0, DVec3::Y * 2.0);
        add_mesh(&mut scene, mesh_at(&positions, indices).unwrap(), DAffine3::IDENTITY, mirror(0.5, 0.25));
        let renderer = build(scene, &Params::default(), &Silent).unwrap();
        let (rays, color) = path(&renderer, DVec3::new(0.1, 0.2, 3.0), DVec3::NEG_Z);
        assert_eq!(rays.len(), 2);
        assert_eq!((rays[1].origin, rays[1].direction), (Vec3::new(0.1, 0.2, 0.0), Vec3::Z));
        assert_eq!(color, Rgb::splat(0.25));
        let seen = see(&renderer, DVec3::new(0.1, 0.2, 3.0), DVec3::NEG_Z * 7.0);
        assert_eq!((seen.color, seen.counts.reflected), (color, 1));
    }
}
