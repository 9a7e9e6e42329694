//! Rays that leave a surface do not meet it again, at any scale and distance.

use glam::{DAffine3, DQuat, DVec3};
use whitted::accel::Params;
use whitted::geometry::{Ray, TriangleMesh, shapes};
use whitted::math::random::{hash2, unit};
use whitted::math::vector::normalize;
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::render::surface::SurfacePoint;
use whitted::scene::camera::ViewRay;

use crate::common::*;

fn random(seed: u32, k: u32) -> f64 {
    unit(hash2(seed, k)) * 2.0 - 1.0
}

fn random_vec(seed: u32, k: u32) -> DVec3 {
    DVec3::new(random(seed, 3 * k), random(seed, 3 * k + 1), random(seed, 3 * k + 2))
}

/// Shoots rays at the scene's only convex surface or triangle, leaves each hit into the hemisphere that the ray came from, and
/// counts those that hit again. Also returns the number of rays tried and the mean clearance in ulp of the largest
/// coordinate.
fn self_hits(scene: &whitted::scene::Scene, target: impl Fn(u32) -> DVec3, size: f64, rays: u32) -> (u32, u32, f64) {
    let renderer = Renderer::build(scene.clone(), &Params::default(), &Silent).unwrap();
    let scene = renderer.scene();
    let (mut wrong, mut tried, mut clearance) = (0, 0, 0.0);
    for seed in 0..rays {
        let target = target(seed);
        // From outside of whatever there is: a convex surface is not met again from there.
        let distance = 5.0 * size * 10f64.powf(2.0 * unit(hash2(seed, 77)));
        let Some(direction) = normalize(random_vec(seed, 1)) else { continue };
        let view = ViewRay { origin: target - direction * distance, direction };
        let hit = renderer.closest(&Ray::new(view.origin.as_vec3(), direction.as_vec3()));
        if !hit.is_hit() {
            continue;
        }
        let point = SurfacePoint::of(scene, renderer.world(), &view, &hit);
        let origin = point.origin_outside();
        let moved = (origin.as_dvec3() - point.position).dot(point.geometric_normal);
        let largest = point.position.abs().max_element().max(f64::from(f32::MIN_POSITIVE)) as f32;
        clearance += moved / f64::from(largest.next_up() - largest);
        for k in 0..4 {
            let Some(leaving) = normalize(random_vec(seed, 2 + k)) else { continue };
            let leaving = if leaving.dot(point.geometric_normal) < 0.0 { -leaving } else { leaving };
            let ray = Ray { t_min: f32::MIN_POSITIVE, ..Ray::new(origin, leaving.as_vec3()) };
            tried += 1;
            wrong += u32::from(renderer.occluded(&ray));
        }
    }
    (wrong, tried, clearance / f64::from(tried.max(1)) * 4.0)
}

/// Points within a triangle.
fn within([a, b, c]: [DVec3; 3]) -> impl Fn(u32) -> DVec3 {
    move |seed| {
        let (u, v) = (unit(hash2(seed, 1000)), unit(hash2(seed, 1001)));
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        a + (b - a) * u + (c - a) * v
    }
}

fn triangle(corners: [DVec3; 3]) -> TriangleMesh {
    TriangleMesh { positions: corners.map(|p| p.as_vec3()).to_vec(), indices: vec![[0, 1, 2]], ..Default::default() }
}

#[test]
fn triangles_of_every_tilt_size_and_place() {
    let mut clearances = Vec::new();
    for k in 0..60u32 {
        let size = 10f64.powi(k as i32 % 7 - 3);
        let away = [0.0, 1.0, 1e4][k as usize % 3] * size;
        let center = normalize(random_vec(k, 5)).unwrap() * away;
        // Exactly flat, nearly flat, and any tilt.
        let flatten = DVec3::new(1.0, 1.0, [0.0, 1e-7, 1e-3, 1.0][k as usize % 4]);
        let corner = |i: u32| center + random_vec(k, 10 + i) * flatten * size;
        let mut scene = empty_scene();
        add_mesh(&mut scene, triangle([corner(0), corner(1), corner(2)]), DAffine3::IDENTITY, white());
        let (wrong, tried, clearance) = self_hits(&scene, within([corner(0), corner(1), corner(2)]), size, 2000);
        assert!(tried > 4000, "case {k}: {tried}");
        assert_eq!(wrong, 0, "case {k}: of {tried}");
        clearances.push(clearance);
    }
    // Slivers need more; the usual triangle keeps close.
    clearances.sort_by(f64::total_cmp);
    let median = clearances[clearances.len() / 2];
    assert!(median < 16.0, "a median clearance of {median} ulp");
}

#[test]
fn transformed_triangles_and_quadrics() {
    for k in 0..30u32 {
        let size = 10f64.powi(k as i32 % 5 - 2);
        let center = normalize(random_vec(k, 5)).unwrap() * size * [0.0, 1.0, 1e3][k as usize % 3];
        let axis = normalize(random_vec(k, 6)).unwrap();
        let scale = DVec3::new(1.0, [1.0, 1e-2, -3.0][k as usize % 3], 0.5) * size;
        let rotation = DQuat::from_axis_angle(axis, random(k, 99) * 3.0);
        let transform = DAffine3::from_scale_rotation_translation(scale, rotation, center);
        let corner = |i: u32| random_vec(k, 10 + i);
        let mut scene = empty_scene();
        add_mesh(&mut scene, triangle([corner(0), corner(1), corner(2)]), transform, white());
        let corners = [0, 1, 2].map(|i| transform.transform_point3(corner(i)));
        let (wrong, tried, _) = self_hits(&scene, within(corners), size, 2000);
        assert!(tried > 4000 && wrong == 0, "mesh {k}: {wrong} of {tried}");

        let mut scene = empty_scene();
        add_quadric(&mut scene, shapes::sphere(), transform, white());
        let surface = |seed: u32| transform.transform_point3(random_vec(seed, 0) * 0.5);
        let (wrong, tried, _) = self_hits(&scene, surface, size, 2000);
        assert!(tried > 7000 && wrong == 0, "sphere {k}: {wrong} of {tried}");
    }
}

#[test]
fn closed_meshes_keep_light_out_and_in() {
    // From inside a closed sphere of triangles every ray meets it, aimed at vertices, edges and anywhere.
    for center in [DVec3::ZERO, DVec3::new(148_376.0, 1234.0, -223_423.0)] {
        let mesh = sphere_mesh(2.0, center, 48, 96).finish().unwrap();
        let mut scene = empty_scene();
        let (positions, indices) = (mesh.positions.clone(), mesh.indices.clone());
        add_mesh(&mut scene, mesh, DAffine3::IDENTITY, white());
        let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
        for seed in 0..60_000u32 {
            let origin = center.as_vec3() + random_vec(seed, 0).as_vec3();
            let [a, b, c] = indices[hash2(seed, 9) as usize % indices.len()].map(|i| positions[i as usize]);
            let target = match seed % 3 {
                0 => a,
                1 => a + (b - a) * unit(hash2(seed, 8)) as f32,
                _ => (a + b + c) / 3.0,
            };
            let direction = target - origin;
            let direction = if seed % 2 == 0 { direction } else { direction.normalize() };
            let ray = Ray::new(origin, direction);
            assert!(renderer.closest(&ray).is_hit() && renderer.occluded(&ray), "{ray:?}");
        }
    }
}
