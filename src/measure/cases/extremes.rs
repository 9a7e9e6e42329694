//! Numbers at the ends of f32, and what is no number: D19, D20.

use std::time::Instant;

use glam::{DVec3, Vec3};

use super::exact::objection;
use super::meshes;
use super::{Case, Context, Failure, Outcome, Rays, Structure};
use crate::accel::Kind;
use crate::error::Result;
use crate::geometry::mesh::FARTHEST_COORDINATE;
use crate::geometry::{Hit, Ray};
use crate::math::random::Random;
use crate::measure::oracle::Oracle;
use crate::measure::statistics::median;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D19",
        title: "vertices that are NaN, infinite, 1e-40, 2^63 and 3e38 in one mesh",
        bar: "up to 2^63 hit as exactly known, all others dropped and counted",
        run: extreme_vertices,
    },
    Case {
        id: "D20",
        title: "rays with NaN, infinity and zero direction",
        bar: "no hit, in at most 2.5 times the time of other rays",
        run: bad_rays,
    },
];

/// A sphere, and triangles with one, two or three corners at each of the values, along each axis and sign.
fn extreme_vertices(context: &Context<'_>) -> Result<Outcome> {
    const FAR: f32 = FARTHEST_COORDINATE;
    const BEYOND: f32 = FAR.next_up();
    const NONE: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -3e38, 1e20, BEYOND, -BEYOND];
    const USABLE: [f32; 8] = [FAR, -FAR, 1.8e18, -1.8e18, 1e13, 1e-40, -1e-40, 1e-20];
    let ball = meshes::icosphere(2, 1.0, DVec3::ZERO);
    let (mut positions, mut indices) = (ball.positions.clone(), ball.indices.clone());
    let mut add = |corners: [Vec3; 3]| {
        let first = positions.len() as u32;
        positions.extend(corners);
        indices.push([first, first + 1, first + 2]);
    };
    let (mut dropped, mut extreme) = (0, Vec::new());
    for value in NONE.into_iter().chain(USABLE) {
        for axis in 0..3 {
            for count in 1..=3 {
                // Corners beside each other, so that a triangle all of whose corners are extreme has an area of its own.
                let mut corners = [Vec3::new(0.5, -2.0, 0.25), Vec3::new(-1.5, 0.5, 2.0), Vec3::new(1.25, 2.0, -1.0)];
                for (number, corner) in corners.iter_mut().take(count).enumerate() {
                    if count == 3 {
                        let ratio = [[1.0, 0.0, 0.25], [0.0, 1.0, 0.5], [0.5, 0.25, 0.0]][number];
                        *corner = Vec3::from_array(ratio) * value;
                    } else {
                        corner[(axis + number) % 3] = value;
                    }
                }
                let usable = corners.iter().all(|p| p.abs().cmple(Vec3::splat(FARTHEST_COORDINATE)).all());
                if usable {
                    extreme.push(corners)
                } else {
                    dropped += 1
                }
                add(corners);
            }
        }
    }
    // From one end to the other, across all else.
    for axis in 0..3 {
        let turned = |x: f32, y: f32, z: f32| {
            let mut p = [x, y, z];
            p.rotate_right(axis);
            Vec3::from_array(p)
        };
        let corners = [turned(-FAR, -FAR, 3.0), turned(FAR, -0.5 * FAR, -2.0), turned(0.25 * FAR, FAR, FAR)];
        extreme.push(corners);
        add(corners);
    }
    let mesh = meshes::mesh(positions, indices);
    let mut sum = Outcome::default();
    let counts = mesh.dropped_counts;
    sum.check(counts.non_finite == dropped && counts.total() == dropped && mesh.exponent == 0, || {
        Failure::text(format!("{counts:?} instead of {dropped} that are not finite or too far"))
    });
    let scene = meshes::scene(vec![mesh]);
    let oracle = Oracle::new(&scene)?;
    let rays = Rays { quick: 3_000, full: 1_000_000, linear: 10 };
    Ok(sum.and(context.ask_all(&scene, 0xd19, rays, |structure, random, number, outcome| {
        // At a point of an extreme triangle or of the ball, from near it or from far out.
        let [a, b, c] = extreme[random.below(extreme.len() as u64) as usize].map(|p| p.as_dvec3());
        let (s, t) = (random.unit(), random.unit());
        let on_triangle = a + (b - a) * (s * (1.0 - t)) + (c - a) * (s * t);
        let target = if number % 4 == 0 { random.direction() } else { on_triangle };
        let distance = match number % 3 {
            0 => 3.0,
            1 => (b - a).abs().max_element(),
            _ => libm::pow(10.0, random.between(-3.0, 19.0)),
        };
        let origin = (target + random.direction() * distance).as_vec3();
        // As long as the way, where its reciprocal is a number, else 1.
        let way = (target - origin.as_dvec3()).as_vec3();
        let short = way.abs().max_element() < 2.0 * f32::MIN_POSITIVE;
        let ray = Ray::new(origin, if short { super::unit(way) } else { way });
        let answer = structure.ask(&ray);
        let objection = objection(&oracle, &ray, &answer.hit);
        let agree = answer.occluded == answer.hit.is_hit() && !answer.hit.t.is_nan();
        outcome.check(agree && objection.is_none(), || {
            Failure::of_ray(&ray, format!("{structure}: {answer}; {}", objection.unwrap_or_default()))
        });
    })?))
}

/// Each number of a ray in turn is NaN or infinite; the direction is zero; the interval is empty.
fn bad_ray(random: &mut Random) -> Ray {
    let mut ray = good_ray(random);
    let slot = random.below(3) as usize;
    let not_finite = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN][random.below(4) as usize];
    match random.below(8) {
        0 => ray.origin[slot] = not_finite,
        1 => ray.direction[slot] = not_finite,
        2 => ray.direction = [Vec3::ZERO, -Vec3::ZERO, Vec3::new(0.0, -0.0, 0.0)][slot],
        3 => ray.t_min = f32::NAN,
        4 => ray.t_max = f32::NAN,
        5 => (ray.t_min, ray.t_max) = (2.0, 1.0),
        6 => (ray.origin, ray.direction) = (Vec3::splat(not_finite), Vec3::splat(not_finite)),
        _ => ray.t_min = f32::INFINITY,
    }
    ray
}

fn good_ray(random: &mut Random) -> Ray {
    Ray::new((random.in_cube() * 2.0).as_vec3(), random.direction().as_vec3())
}

fn bad_rays(context: &Context<'_>) -> Result<Outcome> {
    let scene = meshes::scene(vec![meshes::icosphere(4, 1.0, DVec3::ZERO)]);
    let rays = Rays { quick: 6_000, full: 300_000, linear: 10 };
    let mut sum = context.ask_all(&scene, 0xd20, rays, |structure, random, _, outcome| {
        let ray = bad_ray(random);
        let answer = structure.ask(&ray);
        outcome.check(answer.is_miss(), || Failure::of_ray(&ray, format!("{structure}: {answer}")));
    })?;
    let mut random = Random::new(context.seed, 0xd20);
    let count = context.count(500, 10_000);
    let good: Vec<Ray> = (0..count).map(|_| good_ray(&mut random)).collect();
    let bad: Vec<Ray> = (0..count).map(|_| bad_ray(&mut random)).collect();
    let mut hits = vec![Hit::MISS; good.len()];
    let mut blocked = vec![false; good.len()];
    let mut seconds = |structure: &Structure, rays: &[Ray]| {
        let start = Instant::now();
        structure.renderer.closest_batch(rays, &mut hits[..rays.len()]);
        structure.renderer.occluded_batch(rays, &mut blocked[..rays.len()]);
        start.elapsed().as_secs_f64()
    };
    for structure in context.structures(&scene) {
        let structure = structure?;
        let count = if structure.params.kind == Kind::Linear { good.len() / 10 } else { good.len() };
        let (good, bad) = (&good[..count], &bad[..count]);
        let ratios: Vec<f64> = (0..9).map(|_| seconds(&structure, bad) / seconds(&structure, good)).collect();
        sum.figure("time of bad rays, in times of good ones", median(&ratios).value, context.time_bar(2.5));
    }
    Ok(sum)
}
