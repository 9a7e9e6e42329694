//! What is said to be hit lies where the ray passes, held against exact arithmetic: D2, D3, D6, D7.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};

use super::exact::{self, T_TIGHTNESS, TIGHTNESS};
use super::meshes::{self, Turn};
use super::watertight::{FAR, outward_ray};
use super::{Case, Context, Failure, Outcome, Rays, scene_seed};
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::random::Random;
use crate::measure::oracle::Oracle;
use crate::measure::oracle::triangle::meet_ray;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D2",
        title: "how near a ray passes to what it hits, and how many at an edge",
        bar: "ray to triangle <= 8u max|v - o|; two hits on <= 1 % of edge rays",
        run: tight_hits,
    },
    Case {
        id: "D3",
        title: "slivers far away under grazing rays",
        bar: "0 hits more than 1e-3 off the triangle; the exact triangle but within 8u of an edge",
        run: slivers,
    },
    Case {
        id: "D6",
        title: "rays within a plane and almost within it",
        bar: "within: 0 hits; almost: all hit, t within 4u / sin",
        run: along_a_plane,
    },
    Case {
        id: "D7",
        title: "a cube from on, and an ulp beside, its faces, edges and corners",
        bar: "0 that differ from exact hits on closed triangles",
        run: around_a_cube,
    },
];

/// The rays of D1: each hit's triangle is as near to the ray, exactly, as rounding the numbers that enter allows.
fn tight_hits(context: &Context<'_>) -> Result<Outcome> {
    const EACH: Rays = Rays { quick: 3_000, full: 1_000_000, linear: 50 };
    let mut sum = Outcome::default();
    // The bar is for the sphere at the origin. Far away, points of edges are rounded to 1/64, and many lie on them exactly
    // until the direction is rounded.
    let places = [
        (0, DVec3::ZERO, "edge rays with two hits or more, in %", Some(1.0)),
        (1, FAR, "the same far from the origin, in %", None),
    ];
    for (place, center, name, bar) in places {
        let (edge_rays, double_hits) = (AtomicU64::new(0), AtomicU64::new(0));
        let scene = meshes::scene(vec![meshes::sphere(48, 96, 2.0, center)]);
        let mesh = &scene.meshes[0];
        sum =
            sum.and(context.ask_all(&scene, scene_seed(0xd2, place), EACH, |structure, random, number, outcome| {
                let ray = outward_ray(mesh, center, 1.0, random, number);
                let hits: Vec<Hit> = structure.renderer.hits(&ray).collect();
                for hit in &hits {
                    let corners = mesh.triangle(hit.primitive);
                    let apart = exact::apart(&ray, corners);
                    outcome.figure("ray to triangle, in u max|v - o|", apart / UNIT_ROUNDOFF, Some(8.0));
                    outcome.check(apart <= TIGHTNESS, || Failure {
                        ray: Some(ray),
                        triangle: Some(corners),
                        what: format!("{structure}: hit although {apart:e} max|v - o| apart"),
                    });
                }
                outcome.check(!hits.is_empty(), || Failure::of_ray(&ray, format!("{structure}: no hit")));
                // At an edge, not at its ends. A ray along an axis would meet the edge itself, and so both triangles, exactly.
                if matches!(number % 8, 1 | 3) {
                    edge_rays.fetch_add(1, Ordering::Relaxed);
                    double_hits.fetch_add(u64::from(hits.len() > 1), Ordering::Relaxed);
                }
            })?);
        let share = double_hits.into_inner() as f64 / edge_rays.into_inner() as f64;
        sum.figure(name, 100.0 * share, bar);
    }
    Ok(sum)
}

/// Triangles 11.2 long and 0.05 to 0.35 wide, about points up to 500 from the origin per axis, met from 20 to 580 away
/// at 0.0091 and 0.0001 radians to their planes.
fn slivers(context: &Context<'_>) -> Result<Outcome> {
    const COUNT: u64 = 64;
    const EACH: Rays = Rays { quick: 6_000, full: 3_000_000, linear: 10 };
    let mut random = Random::new(context.seed, 0xd3);
    let sliver = |random: &mut Random| loop {
        let (center, along) = (random.in_cube() * 500.0, random.direction());
        let Some(across) = crate::math::vector::normalize(crate::math::vector::cross(along, random.direction())) else {
            continue;
        };
        let (length, width) = (11.2, random.between(0.05, 0.35));
        let at = |x: f64, y: f64| (center + along * (x * length) + across * (y * width)).as_vec3();
        return [at(-0.5, -0.5), at(0.5, -0.5), at(random.between(-0.5, 0.5), 0.5)];
    };
    let triangles: Vec<[Vec3; 3]> = (0..COUNT).map(|_| sliver(&mut random)).collect();
    let scene = meshes::scene(vec![meshes::soup(triangles.iter().copied())]);
    let oracle = Oracle::new(&scene)?;
    let (there, missed) = (AtomicU64::new(0), AtomicU64::new(0));
    let mut sum = context.ask_all(&scene, 0xd3, EACH, |structure, random, number, outcome| {
        let aimed_at = random.below(COUNT) as usize;
        let ray = grazing_ray(triangles[aimed_at], if number % 2 == 0 { 9.1e-3 } else { 1e-4 }, number % 4 < 2, random);
        let answer = structure.ask(&ray);
        let hit = answer.hit;
        if meet_ray(&ray, triangles[aimed_at]).is_some() {
            there.fetch_add(1, Ordering::Relaxed);
            missed.fetch_add(u64::from(!hit.is_hit()), Ordering::Relaxed);
        }
        let objection = exact::objection(&oracle, &ray, &hit);
        outcome.check(objection.is_none(), || Failure {
            ray: Some(ray),
            triangle: Some(triangles[aimed_at]),
            what: format!("{structure}: {answer}; {}", objection.unwrap_or_default()),
        });
        if !hit.is_hit() {
            outcome.check(!answer.occluded, || Failure::of_ray(&ray, format!("{structure}: {answer}")));
            return;
        }
        let corners = triangles[hit.primitive as usize];
        let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * f64::from(hit.t);
        let off = exact::point_to_triangle(point, corners);
        outcome.figure("largest distance of a hit from its triangle", off, Some(1e-3));
        outcome.check(off <= 1e-3 && answer.occluded, || Failure {
            ray: Some(ray),
            triangle: Some(corners),
            what: format!("{structure}: {answer}, {off:e} off the triangle"),
        });
    })?;
    let share = missed.into_inner() as f64 / there.into_inner().max(1) as f64;
    sum.figure("exact hits on slivers that stand alone, missed, in %", 100.0 * share, None);
    Ok(sum)
}

/// A ray at a point of the triangle, at an angle to its plane.
fn grazing_ray(corners: [Vec3; 3], angle: f64, as_long_as_the_way: bool, random: &mut Random) -> Ray {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let (s, t) = (random.unit().sqrt(), random.unit());
    let target = a + (b - a) * (s * (1.0 - t)) + (c - a) * (s * t);
    let n = exact::normal(corners);
    let (x, y) = crate::math::vector::basis(n);
    let turn = random.between(0.0, std::f64::consts::TAU);
    let level = x * libm::cos(turn) + y * libm::sin(turn);
    let way = level * libm::cos(angle) + n * libm::sin(angle);
    let origin = (target - way * random.between(20.0, 580.0)).as_vec3();
    let direction = (target - origin.as_dvec3()).as_vec3();
    Ray::new(origin, if as_long_as_the_way { direction } else { super::unit(direction) })
}

/// The unit square: rays in its plane miss it; rays that sink by 2^-40 to 1/2 of their way hit it where they should.
fn along_a_plane(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let square = meshes::square();
    for number in 0..Turn::COUNT {
        let turn = Turn::new(number);
        let scene = meshes::scene(vec![meshes::moved(&square, |p| turn.apply(p))]);
        let oracle = Oracle::new(&scene)?;
        for structure in context.structures(&scene) {
            let structure = structure?;
            let mut random = Random::new(context.seed, 0xd6 + number);
            for _ in 0..context.count(20, 2000) {
                // Within the plane: along an edge, along the diagonal, and every other way.
                let level = match random.below(4) {
                    0 => Vec3::X,
                    1 => Vec3::new(1.0, 1.0, 0.0),
                    _ => {
                        super::unit(Vec3::new(random.between(-1.0, 1.0) as f32, random.between(-1.0, 1.0) as f32, 0.0))
                    }
                };
                let start = match random.below(3) {
                    0 => Vec3::new(-1.0, 0.5, 0.0),
                    1 => Vec3::new(0.25, 0.0, 0.0),
                    _ => Vec3::new(random.between(-2.0, 2.0) as f32, random.between(-2.0, 2.0) as f32, 0.0),
                };
                let ray = Ray::new(turn.apply(start), turn.apply(level));
                let answer = structure.ask(&ray);
                sum.check(answer.is_miss(), || {
                    Failure::of_ray(&ray, format!("{structure}: {answer}, of a ray in the plane"))
                });
            }
            for number in 0..context.count(40, 4000) {
                let sink = if number == 0 { 1e-6 } else { libm::exp2(random.between(-40.0, -1.0)) as f32 };
                let start = if number == 0 {
                    Vec3::new(-1.0, 0.5, 1.5 * 1e-6)
                } else {
                    Vec3::new(
                        -1.0,
                        random.between(0.3, 0.7) as f32,
                        (f64::from(sink) * random.between(1.1, 1.9)) as f32,
                    )
                };
                let ray = Ray::new(turn.apply(start), turn.apply(Vec3::new(1.0, 0.0, -sink)));
                let answer = structure.ask(&ray);
                let exact = oracle.closest(&ray).map_or(f64::NAN, |hit| hit.t.to_f64());
                let allowed = 4.0 * UNIT_ROUNDOFF / f64::from(sink);
                let error = (f64::from(answer.hit.t) - exact).abs();
                sum.figure("largest error of t, in u / sin", error * f64::from(sink) / UNIT_ROUNDOFF, Some(4.0));
                sum.check(answer.is_hit() && error <= allowed, || {
                    Failure::of_ray(&ray, format!("{structure}: {answer}, exactly t {exact}"))
                });
            }
        }
    }
    tilted_planes(context, sum)
}

/// The same on squares that do not lie along axes: the error of t, measured across the plane.
fn tilted_planes(context: &Context<'_>, mut sum: Outcome) -> Result<Outcome> {
    for number in 0..context.count(6, 100) {
        let mut random = Random::new(context.seed, 0x1_00d6 + number);
        let normal = random.direction();
        let (x, y) = crate::math::vector::basis(normal);
        let center = random.in_cube();
        let place = |p: Vec3| (center + x * f64::from(p.x) + y * f64::from(p.y) + normal * f64::from(p.z)).as_vec3();
        let scene = meshes::scene(vec![meshes::moved(&meshes::square(), place)]);
        let oracle = Oracle::new(&scene)?;
        for structure in context.structures(&scene) {
            let structure = structure?;
            for _ in 0..context.count(60, 3000) {
                let sink = libm::exp2(random.between(-16.0, -1.0));
                let target = Vec3::new(random.between(0.2, 0.8) as f32, random.between(0.2, 0.8) as f32, 0.0);
                let origin = place(target + Vec3::new(-1.5, 0.0, (1.5 * sink) as f32));
                let ray = Ray::new(origin, place(target) - origin);
                let answer = structure.ask(&ray);
                let exact = oracle.closest(&ray);
                if let Some(objection) = exact::objection(&oracle, &ray, &answer.hit) {
                    sum.check(false, || Failure::of_ray(&ray, format!("{structure}: {objection}")));
                } else if let (true, Some(exact)) = (answer.hit.is_hit(), exact) {
                    let corners = scene.meshes[0].triangle(answer.hit.primitive);
                    let error = exact::t_error(&ray, corners, answer.hit.t, exact.t.to_f64());
                    sum.figure("largest error of t across a tilted plane, in u max|v - o|", error, Some(T_TIGHTNESS));
                    sum.check(answer.occluded, || Failure::of_ray(&ray, format!("{structure}: {answer}")));
                }
            }
        }
    }
    Ok(sum)
}

/// From every place on the cube [0, 1]^3 whose coordinates are 0, 1/2 or 1, and an ulp to either side, along all 26
/// directions of -1, 0 and 1.
fn around_a_cube(context: &Context<'_>) -> Result<Outcome> {
    let scene = meshes::scene(vec![meshes::cube()]);
    let oracle = Oracle::new(&scene)?;
    // Beside 0 the ulp of 1, the smallest number with a reciprocal, and the smallest of all.
    let beside = [f32::EPSILON, f32::MIN_POSITIVE, f32::from_bits(1)];
    let coordinates: Vec<f32> = [0.0f32, 0.5, 1.0]
        .into_iter()
        .flat_map(|x| if x == 0.0 { vec![x] } else { vec![x.next_down(), x, x.next_up()] })
        .chain(beside.into_iter().flat_map(|x| [-x, x]))
        .chain([-1.0, 2.0])
        .collect();
    let n = coordinates.len() as u64;
    let rays = n * n * n * 26;
    let step = context.count(19, 1);
    let mut sum = Outcome::default();
    for structure in context.structures(&scene) {
        let structure = structure?;
        sum = sum.and(context.for_all(0xd7, rays / step, |_, number, outcome| {
            let number = number * step;
            let (place, way) = (number / 26, number % 26);
            // 27 ways of which the one in the middle is none.
            let way = if way < 13 { way } else { way + 1 };
            let at = |i: u64| coordinates[(place / n.pow(i as u32) % n) as usize];
            let along = |i: u64| (way / 3u64.pow(i as u32) % 3) as f32 - 1.0;
            let ray = Ray::new(Vec3::new(at(0), at(1), at(2)), Vec3::new(along(0), along(1), along(2)));
            let answer = structure.ask(&ray);
            let exact = oracle.closest(&ray);
            let corners = oracle.triangle(answer.hit.instance, answer.hit.primitive).map(|(corners, _)| corners);
            let same = match &exact {
                // Numbers that vanish beside 1 even in f64 may vanish: a ray may pass an edge by these and hit it.
                None => {
                    let grazed = |corners| exact::apart(&ray, corners) <= 2.0 * f64::from(f32::MIN_POSITIVE);
                    let placed = |corners| exact::off_plane(&ray, corners, answer.hit.t) <= T_TIGHTNESS;
                    answer.is_miss()
                        || answer.is_hit() && corners.is_some_and(|corners| grazed(corners) && placed(corners))
                }
                Some(exact) => {
                    let t = f64::from(answer.hit.t);
                    // Of triangles that meet there it may be any that the ray passes as D2 asks.
                    let touches = |corners| exact::apart(&ray, corners) <= TIGHTNESS;
                    answer.is_hit()
                        && (t - exact.t.to_f64()).abs() <= 4.0 * UNIT_ROUNDOFF * t.max(1.0)
                        && corners.is_some_and(touches)
                }
            };
            outcome.check(same, || {
                Failure::of_ray(&ray, format!("{structure}: {answer}, exactly {:?}", exact.map(|exact| exact.hit())))
            });
        })?);
    }
    Ok(sum.of_a_list())
}
