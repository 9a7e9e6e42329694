//! Meshes that trees find hard, and the audit of their boxes: D14, D15, D18.

use std::time::Instant;

use glam::{DVec3, Vec3};

use super::exact::objection;
use super::meshes;
use super::watertight::FAR;
use super::{Case, Context, Failure, Outcome, Rays, Structure, scene_seed};
use crate::accel::Kind;
use crate::error::Result;
use crate::geometry::{Hit, Ray, TriangleMesh};
use crate::math::random::Random;
use crate::measure::oracle::Oracle;
use crate::measure::statistics::median;
use crate::scene::Scene;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D14",
        title: "one triangle 1e8 wide among 1e5 of a thousandth",
        bar: "hits as without a tree, and exact ones",
        run: large_among_small,
    },
    Case {
        id: "D15",
        title: "1e5 times the same triangle",
        bar: "the lowest number is hit; a build takes at most 10 times that of a usual mesh",
        run: identical,
    },
    Case {
        id: "D18",
        title: "every box contains what is below it, as rays see it",
        bar: "0 violations, and the same list of all hits as without a tree",
        run: audit,
    },
];

/// Triangles of a size at random places of the cube [-1, 1]^3.
fn confetti(count: u64, size: f64, random: &mut Random) -> Vec<[Vec3; 3]> {
    let triangle = |random: &mut Random| {
        let center = random.in_cube();
        [(); 3].map(|()| (center + random.in_cube() * size).as_vec3())
    };
    (0..count).map(|_| triangle(random)).collect()
}

/// A ray at one of the triangles, from around.
fn at_one(triangles: &[[Vec3; 3]], random: &mut Random) -> Ray {
    let [a, b, c] = triangles[random.below(triangles.len() as u64) as usize].map(|p| p.as_dvec3());
    let (s, t) = (random.unit(), random.unit());
    let target = a + (b - a) * (s * (1.0 - t)) + (c - a) * (s * t);
    let origin = (random.direction() * 3.0).as_vec3();
    Ray::new(origin, target.as_vec3() - origin)
}

/// The large triangle lies behind the small ones for rays from above, and across all their boxes in every tree.
fn large_among_small(context: &Context<'_>) -> Result<Outcome> {
    let mut random = Random::new(context.seed, 0xd14);
    let mut triangles = confetti(context.count(2_000, 100_000), 1e-3, &mut random);
    let without = meshes::scene(vec![meshes::soup(triangles.iter().copied())]);
    let small = triangles.len();
    let wide = [Vec3::new(-5e7, -3e7, -0.25), Vec3::new(5e7, -2e7, -0.125), Vec3::new(1e7, 6e7, 0.5)];
    triangles.insert(small / 2, wide);
    let scene = meshes::scene(vec![meshes::soup(triangles.iter().copied())]);
    let (reference, oracle) = (context.reference(&scene)?, Oracle::new(&scene)?);
    // Without a tree 1e5 triangles take a millisecond a ray.
    let rays = Rays { quick: 600, full: 30_000, linear: 100 };
    let mut sum = context.ask_all(&scene, 0xd14, rays, |structure, random, number, outcome| {
        let ray = at_one(&triangles, random);
        let answer = structure.ask(&ray);
        let objection = objection(&oracle, &ray, &answer.hit);
        outcome.check(objection.is_none() && answer.occluded == answer.hit.is_hit(), || {
            Failure::of_ray(&ray, format!("{structure}: {answer}; {}", objection.unwrap_or_default()))
        });
        if number % 10 == 0 {
            let expected = reference.ask(&ray);
            outcome
                .check(answer == expected, || Failure::of_ray(&ray, format!("{structure}: {answer}, not {expected}")));
        }
    })?;
    for (with, without) in context.structures(&scene).zip(context.structures(&without)) {
        let (with, without) = (with?, without?);
        // Without a tree every ray costs the same.
        let rays = if with.params.kind == Kind::Linear { 20 } else { context.count(200, 2_000) };
        let slowdown = slowdown(&with, &without, &triangles, rays);
        sum.figure(format!("{with}: slower than without the wide one, times"), slowdown, None);
    }
    Ok(sum)
}

/// How much longer one structure takes for the same rays than another, the median of interleaved repeats.
fn slowdown(a: &Structure, b: &Structure, triangles: &[[Vec3; 3]], rays: u64) -> f64 {
    let mut random = Random::new(1, 0);
    let rays: Vec<Ray> = (0..rays).map(|_| at_one(triangles, &mut random)).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut seconds = |structure: &Structure| {
        let start = Instant::now();
        structure.renderer.closest_batch(&rays, &mut hits);
        start.elapsed().as_secs_f64()
    };
    let ratios: Vec<f64> = (0..9).map(|_| seconds(a) / seconds(b)).collect();
    median(&ratios).value
}

/// All copies are hit at one t: the order of hits alone says which is first.
fn identical(context: &Context<'_>) -> Result<Outcome> {
    let count = context.count(2_000, 100_000);
    let corners = [Vec3::new(-1.0, -1.0, 0.25), Vec3::new(1.5, -0.5, -0.25), Vec3::new(0.0, 1.0, 0.5)];
    let scene = meshes::scene(vec![meshes::soup((0..count).map(|_| corners))]);
    let usual = confetti(count, 0.02, &mut Random::new(context.seed, 0x1_00d15));
    let usual = meshes::scene(vec![meshes::soup(usual)]);
    let rays = Rays { quick: 60, full: 300, linear: 1 };
    let mut sum = context.ask_all(&scene, 0xd15, rays, |structure, random, _, outcome| {
        let ray = at_one(&[corners], random);
        let answer = structure.ask(&ray);
        outcome.check(answer.is_hit() && answer.hit.primitive == 0, || {
            Failure::of_ray(&ray, format!("{structure}: {answer}, of {count} identical triangles"))
        });
    })?;
    for params in context.params() {
        let seconds = |scene: &Scene| -> Result<f64> {
            Ok(Structure::build(scene, params, context.progress)?.renderer.build_stats().seconds)
        };
        let mut ratios = Vec::new();
        for _ in 0..5 {
            ratios.push(seconds(&scene)? / seconds(&usual)?);
        }
        sum.figure(
            "build, in builds of a usual mesh of as many triangles",
            median(&ratios).value,
            context.time_bar(10.0),
        );
    }
    Ok(sum)
}

/// Meshes of all kinds: nodes are audited as they stand, and rays must find every triangle through them, however late it
/// comes.
fn audit(context: &Context<'_>) -> Result<Outcome> {
    let mut random = Random::new(context.seed, 0xd18);
    let mut mixed_sizes = Vec::new();
    for k in -12..=6 {
        mixed_sizes.extend(confetti(context.count(8, 500), libm::pow(10.0, f64::from(k)), &mut random));
    }
    let stretched = |axis: usize| {
        let mut triangles = confetti(context.count(60, 3_000), 0.05, &mut random);
        for p in triangles.iter_mut().flatten() {
            p[axis] *= 1e6;
        }
        triangles
    };
    let mut all: Vec<TriangleMesh> = (0..3).map(stretched).map(meshes::soup).collect();
    all.extend([
        meshes::soup(mixed_sizes),
        meshes::sphere(12, 24, 2.0, FAR),
        meshes::sphere(48, 96, 1e-9, DVec3::ZERO),
        meshes::icosphere(2, 1.0, DVec3::splat(1e7)),
        meshes::grid(20),
        meshes::cube(),
        meshes::soup((0..40).map(|_| [Vec3::ZERO, Vec3::X, Vec3::Y])),
    ]);
    let mut sum = Outcome::default();
    for (number, mesh) in (0..).zip(all) {
        let triangles: Vec<[Vec3; 3]> = mesh.live_triangles().map(|n| mesh.triangle(n)).collect();
        let (exponent, origin) = (mesh.exponent, mesh.bounds().center());
        let scene = meshes::scene(vec![mesh]);
        let reference = context.reference(&scene)?;
        for structure in context.structures(&scene) {
            let structure = structure?;
            let violation = structure.renderer.validate();
            sum.check(violation.is_ok(), || Failure::text(format!("{structure}, mesh {number}: {violation:?}")));
            let (seed, total) = (scene_seed(0xd18, number), context.count(60, 500));
            sum = sum.and(context.for_params(&structure.params, seed, total, |random, _, outcome| {
                let ray = at_one(&triangles, random);
                // About the mesh's middle, in the scale of the world.
                let scale = libm::ldexp(1.0, exponent);
                let target = (ray.origin.as_dvec3() + ray.direction.as_dvec3()) * scale;
                let size = triangles[0].map(|p| (p.as_dvec3() - origin).abs().max_element())[0].max(1e-3) * scale;
                let start = (origin * scale + random.direction() * (2.0 * size)).as_vec3();
                let ray = Ray::new(start, target.as_vec3() - start);
                let walks = [&structure, &reference]
                    .map(|structure| structure.renderer.hits(&ray).take(64).collect::<Vec<Hit>>());
                outcome.check(walks[0] == walks[1], || {
                    Failure::of_ray(
                        &ray,
                        format!("{structure}, mesh {number}: {} hits of {}", walks[0].len(), walks[1].len()),
                    )
                });
            })?);
        }
    }
    Ok(sum)
}
