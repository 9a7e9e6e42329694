//! Single triangles at the ends of what numbers hold: D4, D8, D12.

use glam::Vec3;

use super::meshes::{self, Turn};
use super::{Case, Context, Failure, Outcome, Rays};
use crate::error::Result;
use crate::geometry::Ray;
use crate::math::float::UNIT_ROUNDOFF;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D4",
        title: "right triangles with legs from 1 to 1e-15",
        bar: "all hit, t = 1 to 4u",
        run: small_triangles,
    },
    Case {
        id: "D8",
        title: "a square split where no number of few bits lies, met on the split",
        bar: "all hit, t = 1",
        run: split_square,
    },
    Case {
        id: "D12",
        title: "directions times powers of two",
        bar: "same primitive, t to the bit",
        run: scaled_directions,
    },
];

/// Triangles (0,0,0), (s,0,0), (0,s,0) turned every way, met from a distance of 1.
fn small_triangles(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let sizes = [1.0, 2e-4, 1e-6, 1e-9, 1e-15].into_iter().chain((-53..=0).map(|k| libm::ldexp(1.0, k)));
    for size in sizes.map(|size| size as f32) {
        for number in 0..Turn::COUNT {
            let turn = Turn::new(number);
            let corners = [Vec3::ZERO, Vec3::X * size, Vec3::Y * size].map(|p| turn.apply(p));
            let scene = meshes::scene(vec![meshes::soup([corners])]);
            for structure in context.structures(&scene) {
                let structure = structure?;
                // The mesh may be stored divided by a power of two; rays stay in the world.
                for side in [-1.0, 1.0] {
                    for (u, v) in [(1.0 / 3.0, 1.0 / 3.0), (0.25, 0.5), (0.0625, 0.0625), (0.0, 0.0), (0.5, 0.5)] {
                        let origin = turn.apply(Vec3::new(size * u, size * v, side));
                        let ray = Ray::new(origin, turn.apply(Vec3::new(0.0, 0.0, -side)));
                        let answer = structure.ask(&ray);
                        let error = (f64::from(answer.hit.t) - 1.0).abs();
                        sum.check(answer.is_hit() && error <= 4.0 * UNIT_ROUNDOFF, || Failure {
                            ray: Some(ray),
                            triangle: Some(corners),
                            what: format!("{structure}: {answer}, where t is 1"),
                        });
                    }
                }
            }
        }
    }
    Ok(sum)
}

/// Squares whose two halves share an edge at x = X, met exactly there from 1 above: at the boxes' common face, too.
fn split_square(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    for x in [0.0f32, 0.1, 0.7, 3.3, 1000.1, -0.3, 1e-6, 16_777_215.0, 123_456.79] {
        // A little to both sides, in steps that x can be told from.
        let half = (x.abs() * 0.5).max(1.0);
        for number in 0..Turn::COUNT {
            let turn = Turn::new(number);
            let at = |x: f32, y: f32| turn.apply(Vec3::new(x, y, 0.0));
            let corners = [(x - half, 0.0), (x, 0.0), (x + half, 0.0), (x - half, 1.0), (x, 1.0), (x + half, 1.0)];
            let positions = corners.map(|(x, y)| at(x, y)).to_vec();
            let mesh = meshes::mesh(positions.into(), vec![[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]].into());
            let scene = meshes::scene(vec![mesh]);
            for structure in context.structures(&scene) {
                let structure = structure?;
                for side in [-1.0, 1.0] {
                    for y in [0.0, 0.1, 0.5, 0.7, 1.0] {
                        let origin = turn.apply(Vec3::new(x, y, side));
                        let ray = Ray::new(origin, turn.apply(Vec3::new(0.0, 0.0, -side)));
                        let answer = structure.ask(&ray);
                        sum.check(answer.is_hit() && answer.hit.t == 1.0, || {
                            Failure::of_ray(
                                &ray,
                                format!("{structure}: {answer}, on the split at x = {x}, where t is 1"),
                            )
                        });
                    }
                }
            }
        }
    }
    Ok(sum)
}

/// Rays at a sphere, hits and misses, and the same rays with directions 2^-60 to 2^60 times as long: nothing rounds
/// differently.
fn scaled_directions(context: &Context<'_>) -> Result<Outcome> {
    let scene = meshes::scene(vec![meshes::icosphere(2, 1.0, glam::DVec3::ZERO)]);
    let rays = Rays { quick: 600, full: 60_000, linear: 10 };
    context.ask_all(&scene, 0xd12, rays, |structure, random, number, outcome| {
        let origin = (random.direction() * random.between(0.0, 3.0)).as_vec3();
        let target = (random.in_cube() * 1.1).as_vec3();
        // Some directions have components that are 0 or much smaller than the others.
        let mut direction = target - origin;
        match number % 4 {
            0 => direction[random.below(3) as usize] = 0.0,
            1 => direction[random.below(3) as usize] *= 1e-6,
            _ => {}
        }
        if direction == Vec3::ZERO {
            return;
        }
        let ray = Ray::new(origin, direction);
        let answer = structure.ask(&ray);
        for k in -60..=60 {
            let factor = libm::ldexpf(1.0, k);
            let scaled = structure.ask(&Ray { direction: direction * factor, ..ray });
            let same = scaled.occluded == answer.occluded
                && (scaled.hit.instance, scaled.hit.primitive) == (answer.hit.instance, answer.hit.primitive)
                && (scaled.hit.t * factor).to_bits() == answer.hit.t.to_bits();
            outcome.check(same, || {
                Failure::of_ray(&ray, format!("{structure}: {answer}, but with the direction times 2^{k}: {scaled}"))
            });
        }
    })
}
