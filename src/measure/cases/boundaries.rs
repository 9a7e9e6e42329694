//! Where a hit begins and ends: triangles without area, rays that start on a surface, ends of intervals: D5, D10, D11.

use glam::{DVec3, Vec3};

use super::meshes::{self, Turn};
use super::{Answer, Case, Context, Failure, Outcome, Rays};
use crate::error::Result;
use crate::geometry::{Hit, Ray, TriangleMesh};
use crate::math::random::Random;
use crate::progress::Silent;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D5",
        title: "triangles without area among others",
        bar: "never hit, all else to the bit as without them, no NaN",
        run: zero_area,
    },
    Case {
        id: "D10",
        title: "rays that start exactly on a triangle",
        bar: "t = 0 if t_min is 0, else no hit",
        run: start_on_a_triangle,
    },
    Case {
        id: "D11",
        title: "intervals that end exactly at a hit, an ulp before and an ulp behind",
        bar: "both ends count, exactly",
        run: interval_ends,
    },
];

/// A sphere into which triangles without area were mixed, and the same sphere without them.
///
/// They have a vertex twice, three times, or three vertices on a line: of the sphere, and of lines along the axes and
/// askew, through its inside.
fn zero_area(context: &Context<'_>) -> Result<Outcome> {
    let mut random = Random::new(context.seed, 0xd5);
    let plain = meshes::icosphere(2, 1.0, DVec3::ZERO);
    let (mut mixed, mut numbers) = (TriangleMesh::default(), Vec::new());
    mixed.positions.clone_from(&plain.positions);
    let mut flat = Vec::new();
    for (number, &corners) in plain.indices.iter().enumerate() {
        if random.below(2) == 0 {
            let first = mixed.positions.len() as u32;
            let [a, b, _] = corners;
            let line = |step: Vec3| [0.0, 1.0, 2.0].map(|k| step * k);
            let (corners, new) = match random.below(6) {
                0 => ([a, b, b], vec![]),
                1 => ([a, a, a], vec![]),
                2 => ([first, first + 1, first + 2], line(Vec3::X).to_vec()),
                3 => ([first, first + 2, first + 1], line(Vec3::new(-0.25, 0.5, 0.125)).to_vec()),
                4 => ([first + 1, first, first + 2], line(Vec3::new(0.1, 0.7, -0.3)).to_vec()),
                _ => ([first, first + 1, a], vec![mixed.positions[a as usize]; 2]),
            };
            flat.push(corners);
            mixed.positions.extend(new);
            mixed.indices.push(corners);
            numbers.push(None);
        }
        mixed.indices.push(corners);
        numbers.push(Some(number as u32));
    }
    let mixed = meshes::mesh(mixed.positions, mixed.indices);
    let mut sum = Outcome::default();
    let counted =
        mixed.dropped_counts.zero_area == flat.len() as u64 && mixed.dropped_counts.total() == flat.len() as u64;
    sum.check(counted, || Failure::text(format!("{:?} of {} were dropped", mixed.dropped_counts, flat.len())));
    let (scene, plain) = (meshes::scene(vec![mixed]), meshes::scene(vec![plain]));
    let reference = context.reference(&plain)?;
    let rays = Rays { quick: 9_000, full: 1_000_000, linear: 10 };
    let positions = &scene.meshes[0].positions;
    Ok(sum.and(context.ask_all(&scene, 0xd5, rays, |structure, random, _, outcome| {
        // At points of the flat ones, from anywhere.
        let [a, b, c] = flat[random.below(flat.len() as u64) as usize].map(|i| positions[i as usize].as_dvec3());
        let (s, t) = (random.unit(), random.unit());
        let target = (a + (b - a) * s + (c - a) * t * (1.0 - s)).as_vec3();
        let ray = Ray::new((random.in_cube() * 2.0).as_vec3(), Vec3::ZERO);
        let ray = Ray { direction: target - ray.origin, ..ray };
        let (answer, expected) = (structure.ask(&ray), reference.ask(&ray));
        let number = numbers.get(answer.hit.primitive as usize).copied().flatten();
        // What is hit is one of the sphere's, under its number there.
        let found = number.map(|primitive| Answer { hit: Hit { primitive, ..answer.hit }, ..answer });
        outcome.check(found.unwrap_or(answer) == expected && found.is_some() == answer.hit.is_hit(), || {
            Failure::of_ray(&ray, format!("{structure}: {answer}, without them {expected}"))
        });
    })?))
}

/// Triangles in planes whose arithmetic is exact, with rays along their normals from points on them.
fn start_on_a_triangle(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    // In the planes z = 0, x + y + z = 2 and x + 2 y + 4 z = 4: the normals' components have powers of two for ratios.
    let planes = [
        ([Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0], Vec3::Z),
        ([Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0], Vec3::ONE),
        ([Vec3::X * 4.0, Vec3::Y * 2.0, Vec3::Z], Vec3::new(1.0, 2.0, 4.0)),
    ];
    for number in 0..Turn::COUNT {
        let turn = Turn::new(number);
        for (corners, normal) in planes {
            for exponent in [-20, 0, 20] {
                let scale = libm::ldexpf(1.0, exponent);
                let corners = corners.map(|p| turn.apply(p) * scale);
                let normal = turn.apply(normal);
                let scene = meshes::scene(vec![meshes::soup([corners])]);
                for structure in context.structures(&scene) {
                    let structure = structure?;
                    let weights =
                        [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5), (0.25, 0.25), (0.125, 0.5)];
                    for ((u, v), side) in weights.into_iter().flat_map(|w| [(w, 1.0), (w, -1.0)]) {
                        let [a, b, c] = corners;
                        let origin = a * (1.0 - u - v) + b * u + c * v;
                        for t_min in [0.0, -0.0, -1.0, f32::from_bits(1), f32::MIN_POSITIVE, 1e-30, 1.0] {
                            let ray = Ray { t_min, ..Ray::new(origin, normal * side) };
                            let answer = structure.ask(&ray);
                            let right = if t_min > 0.0 {
                                answer.is_miss()
                            } else {
                                answer.is_hit() && answer.hit.t.to_bits() == 0
                            };
                            sum.check(right, || Failure {
                                ray: Some(ray),
                                triangle: Some(corners),
                                what: format!("{structure}: {answer}, from a point on the triangle"),
                            });
                        }
                    }
                }
            }
        }
    }
    Ok(sum)
}

/// A triangle that is met at t = 2 exactly, and any hits on a sphere, under intervals with ends there.
fn interval_ends(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let neighbours = |t: f32| [t.next_down(), t, t.next_up()];
    for number in 0..Turn::COUNT {
        let turn = Turn::new(number);
        let corners = [Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0].map(|p| turn.apply(p));
        let scene = meshes::scene(vec![meshes::soup([corners])]);
        for structure in context.structures(&scene) {
            let structure = structure?;
            let ray = Ray::new(turn.apply(Vec3::new(1.0, 1.0, -2.0)), turn.apply(Vec3::Z));
            let ends = neighbours(2.0).into_iter().chain([f32::NAN, 0.0, f32::INFINITY, f32::NEG_INFINITY, 3.0]);
            for (t_min, t_max) in ends.clone().flat_map(|t_min| ends.clone().map(move |t_max| (t_min, t_max))) {
                let ray = Ray { t_min, t_max, ..ray };
                let answer = structure.ask(&ray);
                let right = if t_min <= 2.0 && 2.0 <= t_max {
                    answer.is_hit() && answer.hit.t == 2.0
                } else {
                    answer.is_miss()
                };
                sum.check(right, || Failure {
                    ray: Some(ray),
                    triangle: Some(corners),
                    what: format!("{structure}: {answer}, where t is 2"),
                });
            }
        }
    }
    let scene = meshes::scene(vec![meshes::icosphere(2, 1.0, DVec3::ZERO)]);
    let rays = Rays { quick: 1_200, full: 1_000_000, linear: 10 };
    Ok(sum.and(context.ask_all(&scene, 0xd11, rays, |structure, random, _, outcome| {
        let ray = Ray::new(random.in_cube().as_vec3(), random.direction().as_vec3());
        let first = structure.ask(&ray);
        if !first.is_hit() {
            return;
        }
        let t = first.hit.t;
        for end in neighbours(t) {
            let until = structure.ask(&Ray { t_max: end, ..ray });
            let right = if end >= t { until == first } else { until.is_miss() };
            outcome
                .check(right, || Failure::of_ray(&ray, format!("{structure}: {until} up to {end:?}, in all {first}")));
            let from = structure.ask(&Ray { t_min: end, ..ray });
            let right = if end <= t { from == first } else { !from.hit.is_hit() || from.hit.t >= end };
            outcome.check(right, || Failure::of_ray(&ray, format!("{structure}: {from} from {end:?}, in all {first}")));
        }
    })?))
}

impl Context<'_> {
    /// The scene without a tree: what all structures must agree with.
    ///
    /// # Errors
    /// A build that was refused.
    pub fn reference(&self, scene: &crate::scene::Scene) -> Result<super::Structure> {
        let params = crate::accel::Params { kind: crate::accel::Kind::Linear, ..Default::default() };
        super::Structure::build(scene, params, &Silent)
    }
}
