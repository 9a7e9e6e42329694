//! Every structure gives the same hits, end to end through the two levels.

use glam::{DAffine3, DQuat, DVec3, Vec3};
use whitted::accel::{Kind, Params, Preset};
use whitted::geometry::{Hit, Key, Ray, shapes};
use whitted::math::random::{hash2, unit};
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::scene::{Background, Material, Rgb, Scene};

use crate::common::*;

fn random(seed: u32, k: u32) -> f32 {
    (unit(hash2(seed, k)) * 2.0 - 1.0) as f32
}

fn random_vec(seed: u32, k: u32) -> Vec3 {
    Vec3::new(random(seed, 3 * k), random(seed, 3 * k + 1), random(seed, 3 * k + 2))
}

/// Meshes and quadrics, instanced, mirrored, sheared, stretched, overlapping, and an unbounded plane.
fn mixed_scene() -> Scene {
    let mut scene = empty_scene();
    add_mesh(&mut scene, sphere_mesh(1.0, DVec3::ZERO, 12, 24), DAffine3::IDENTITY, white());
    add_mesh(&mut scene, cube(), DAffine3::from_translation(DVec3::new(1.5, 0.25, 0.0)), white());
    let turned = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 1e-2, 2.0),
        DQuat::from_rotation_z(0.7),
        DVec3::new(-1.0, 0.5, 0.3),
    );
    add_mesh(&mut scene, cube(), turned, white());
    let mirrored = DAffine3::from_scale(DVec3::new(-0.7, 0.7, 0.7)) * DAffine3::from_translation(DVec3::splat(0.4));
    add_mesh(&mut scene, sphere_mesh(1.0, DVec3::ZERO, 8, 16), mirrored, Material { kt: Rgb::splat(0.5), ..white() });
    // The same place twice: every hit ties.
    add_mesh(&mut scene, cube(), DAffine3::from_translation(DVec3::new(1.5, 0.25, 0.0)), white());
    add_quadric(&mut scene, shapes::sphere(), DAffine3::from_translation(DVec3::new(0.0, 1.2, 0.0)), white());
    add_quadric(&mut scene, shapes::hyperboloid_one_sheet(-1.0, 1.0, false), turned, white());
    add_quadric(&mut scene, shapes::cone(false), mirrored, white());
    add_quadric(&mut scene, shapes::plane(None), DAffine3::from_translation(DVec3::new(0.0, -1.0, 0.0)), white());
    scene
}

/// Rays of many kinds: random, along axes, from and to vertices, with ends exactly at hits, and bad ones.
fn hard_rays(reference: &Renderer) -> Vec<Ray> {
    let mut rays = Vec::new();
    for seed in 0..4000 {
        let origin = random_vec(seed, 0) * 3.0;
        rays.push(Ray::new(origin, random_vec(seed, 1)));
        // At a lattice point along a lattice direction: vertices, edges and planes are met exactly.
        let lattice = (origin * 2.0).round() * 0.5;
        let direction = (random_vec(seed, 2) * 1.4).round();
        rays.push(Ray::new(lattice, direction));
        let zero = if seed % 2 == 0 { 0.0 } else { -0.0 };
        rays.push(Ray::new(lattice, Vec3::new(zero, 1.0, zero)));
        let target = sphere_mesh(1.0, DVec3::ZERO, 12, 24).positions[seed as usize % 250];
        rays.push(Ray::new(origin, target - origin));
    }
    // Ends of the interval at the hit itself, and one ulp to either side.
    for i in (0..rays.len()).step_by(5) {
        let t = reference.closest(&rays[i]).t;
        if t.is_finite() {
            rays.push(Ray { t_max: t, ..rays[i] });
            rays.push(Ray { t_max: t.next_down(), ..rays[i] });
            rays.push(Ray { t_min: t, ..rays[i] });
            rays.push(Ray { t_min: t.next_up(), ..rays[i] });
        }
    }
    let good = Ray::new(Vec3::new(0.0, 0.0, 5.0), -Vec3::Z);
    rays.push(Ray { direction: Vec3::new(f32::NAN, 0.0, 1.0), ..good });
    rays.push(Ray { origin: Vec3::splat(f32::INFINITY), ..good });
    rays.push(Ray { t_min: 2.0, t_max: 1.0, ..good });
    rays
}

fn all_hits(renderer: &Renderer, ray: &Ray) -> Vec<Hit> {
    let mut hits = Vec::new();
    let mut key = Key::BEFORE_ALL;
    loop {
        let hit = renderer.next_after(ray, key);
        if !hit.is_hit() {
            return hits;
        }
        assert!(key.is_before(&hit.key()), "the order goes on");
        key = hit.key();
        hits.push(hit);
        assert!(hits.len() < 1000, "a walk ends");
    }
}

fn bits(hit: &Hit) -> [u32; 5] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.instance, hit.primitive]
}

#[test]
fn every_structure_gives_the_references_hits_bit_for_bit() {
    let scene = mixed_scene();
    let build = |kind, preset| Renderer::build(scene.clone(), &Params { kind, preset }, &Silent).unwrap();
    let reference = build(Kind::Linear, Preset::Balanced);
    let rays = hard_rays(&reference);
    let expected: Vec<(Hit, Vec<Hit>)> =
        rays.iter().map(|ray| (reference.closest(ray), all_hits(&reference, ray))).collect();
    let found = expected.iter().filter(|(hit, _)| hit.is_hit()).count();
    assert!(found > rays.len() / 3 && found < rays.len(), "{found} of {} hit", rays.len());
    assert!(expected.iter().any(|(_, all)| all.windows(2).any(|w| w[0].t == w[1].t)), "some hits tie");

    for &kind in Kind::ALL {
        for &preset in Preset::ALL {
            let renderer = build(kind, preset);
            renderer.validate().unwrap();
            let mut batch = vec![Hit::MISS; rays.len()];
            renderer.closest_batch(&rays, &mut batch);
            let mut blocked = vec![false; rays.len()];
            renderer.occluded_batch(&rays, &mut blocked);
            for (i, ray) in rays.iter().enumerate() {
                let (closest, all) = &expected[i];
                let context = || format!("{kind:?} {preset:?} {ray:?}");
                assert_eq!(bits(&renderer.closest(ray)), bits(closest), "{}", context());
                assert_eq!(bits(&batch[i]), bits(closest), "{}", context());
                assert_eq!(renderer.occluded(ray), closest.is_hit(), "{}", context());
                assert_eq!(blocked[i], closest.is_hit(), "{}", context());
                if i % 7 == 0 {
                    let walked = all_hits(&renderer, ray);
                    assert!(walked.iter().map(bits).eq(all.iter().map(bits)), "{}", context());
                }
            }
        }
    }
}

#[test]
fn the_first_of_all_hits_is_the_closest() {
    let scene = mixed_scene();
    let renderer = Renderer::build(scene, &Params::default(), &Silent).unwrap();
    for ray in hard_rays(&renderer) {
        let first = renderer.next_after(&ray, Key::BEFORE_ALL);
        assert_eq!(bits(&first), bits(&renderer.closest(&ray)), "{ray:?}");
    }
}

#[test]
fn scaling_a_ray_by_a_power_of_two_scales_t_exactly() {
    let renderer = Renderer::build(mixed_scene(), &Params::default(), &Silent).unwrap();
    for seed in 0..500 {
        let ray = Ray::new(random_vec(seed, 0) * 3.0, random_vec(seed, 1));
        let hit = renderer.closest(&ray);
        for k in [-60, -20, 3, 60] {
            let factor = libm::ldexpf(1.0, k);
            let scaled = renderer.closest(&Ray { direction: ray.direction * factor, ..ray });
            assert_eq!((scaled.instance, scaled.primitive), (hit.instance, hit.primitive), "2^{k} {ray:?}");
            if hit.is_hit() {
                assert_eq!((scaled.t * factor).to_bits(), hit.t.to_bits(), "2^{k} {ray:?}");
            }
        }
    }
}

#[test]
fn pictures_are_the_same_bytes_for_every_structure_and_thread_count() {
    let mut scene = mixed_scene();
    scene.background = Background::Gradient { bottom: Rgb::ZERO, top: Rgb::ONE, up: DVec3::Y };
    for material in &mut scene.materials {
        material.kr = Rgb::splat(0.3);
    }
    add_light(&mut scene, DVec3::new(3.0, 5.0, 4.0), Rgb::ONE);
    look(&mut scene, DVec3::new(2.0, 2.0, 6.0), DVec3::ZERO);
    if let whitted::scene::Camera::LookAt { projection, .. } = &mut scene.cameras[0].camera {
        *projection = whitted::scene::Projection::Perspective { fov_y: 0.7 };
    }
    (scene.film.width, scene.film.height, scene.film.samples) = (70, 40, 2);
    let expected = render_with(&scene, Kind::Linear, 1);
    for &kind in Kind::ALL {
        for threads in [1, 2, 3] {
            let film = render_with(&scene, kind, threads);
            assert!(film.color == expected.color, "{kind:?} with {threads} threads");
            assert_eq!(film.stats.rays, expected.stats.rays);
        }
    }
}
