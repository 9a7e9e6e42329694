//! Quadrics far away and without end: D33, D34.

use glam::{DAffine3, DVec3, Vec3};

use super::{Case, Context, Failure, Outcome, Rays, Structure, meshes, scene_seed};
use crate::accel::{Kind, Params};
use crate::error::Result;
use crate::geometry::{Key, Quadric, Ray, shapes};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::random::Random;
use crate::math::transform::rotation_xyz;
use crate::math::vector::{cross, dot, length, normalize};
use crate::measure::dyadic::Dyadic;
use crate::measure::oracle::Oracle;
use crate::measure::scenes::{self, ulp};
use crate::render::surface::SurfacePoint;

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D33",
        title: "spheres far away, from outside, inside and on them, and behind the ray",
        bar: "points to 2 ulp of the radius, no false hit or miss but within 4u of a tangent",
        run: far_spheres,
    },
    Case {
        id: "D34",
        title: "a plane and a saddle without end beside a large mesh",
        bar: "every hit as in the list without a tree and in exact arithmetic, no NaN in a tree",
        run: without_end,
    },
];

fn far_spheres(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    for (number, distance) in [0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7].into_iter().enumerate() {
        let center = DVec3::from_array((DVec3::new(0.6, -0.48, 0.64) * distance).to_array().map(libm::rint));
        for radius in [1.0, 0.3, 50.0] {
            for by_coefficients in [false, true] {
                let mut scene = scenes::empty();
                if by_coefficients {
                    let c = dot(center, center) - radius * radius;
                    let k = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, -center.x, -center.y, -center.z, c];
                    // Where f64 cannot hold the constant the file itself says another radius.
                    if Dyadic::new(c) != square(center) - square(DVec3::X * radius) {
                        continue;
                    }
                    scenes::add_quadric(&mut scene, Quadric::new(k, None, false)?, DAffine3::IDENTITY, scenes::white());
                } else {
                    scenes::add_quadric(&mut scene, shapes::sphere(), scenes::placed(center, radius), scenes::white());
                }
                let rays = Rays { quick: 90, full: 60_000, linear: 1 };
                sum = sum.and(context.ask_all(
                    &scene,
                    scene_seed(0xd33, number as u64),
                    rays,
                    |structure, random, number, outcome| {
                        let oracle = Oracle::new(structure.renderer.scene());
                        let Ok(oracle) = oracle else { return };
                        far_sphere(structure, &oracle, center, radius, random, number, outcome);
                    },
                )?);
            }
        }
    }
    Ok(sum)
}

fn square(v: DVec3) -> Dyadic {
    v.to_array().map(Dyadic::new).iter().fold(Dyadic::ZERO, |sum, x| sum + x * x)
}

fn far_sphere(
    structure: &Structure,
    oracle: &Oracle,
    center: DVec3,
    radius: f64,
    random: &mut Random,
    number: u64,
    outcome: &mut Outcome,
) {
    let away = random.direction();
    let origin = match number % 6 {
        0 | 1 => random.in_cube(),
        2 => center + away * (radius * random.between(1.01, 30.0)),
        3 => center + away * (radius * random.between(0.0, 0.99)),
        4 => center + away * radius,
        _ => center + away * (radius * random.between(1.5, 4.0)),
    }
    .as_vec3();
    // Near the tangents, anywhere on the ball, or away from it.
    let from = center - origin.as_dvec3();
    let across = normalize(cross(from, random.direction())).unwrap_or(DVec3::X);
    let lift = match number % 3 {
        0 => 1.0 + libm::pow(10.0, random.between(-9.0, -2.0)) * if random.unit() < 0.5 { -1.0 } else { 1.0 },
        _ => random.between(-1.2, 1.2),
    };
    let mut direction = from + across * (radius * lift);
    if number % 6 == 5 {
        direction = -direction;
    }
    let ray = Ray::new(origin, direction.as_vec3());
    let answer = structure.ask(&ray);
    let expected = oracle.closest(&ray);
    let wrong = answer.hit.is_hit() != expected.is_some() || answer.occluded != expected.is_some();
    // How far from the ball's edge the line passes, and the ray starts.
    let (o, d) = (ray.origin.as_dvec3() - center, ray.direction.as_dvec3());
    let passes = (length(cross(o, d)) / length(d) - radius).abs();
    let starts = (length(o) - radius).abs();
    let band = 4.0 * UNIT_ROUNDOFF * radius;
    if passes <= band || starts <= band {
        return;
    }
    outcome.check(!wrong, || {
        Failure::of_ray(
            &ray,
            format!(
                "{structure}: {answer} of the ball of radius {radius} at {center}; exactly: {:?}",
                expected.as_ref().map(|hit| hit.t.to_f64())
            ),
        )
    });
    let (true, Some(expected)) = (answer.hit.is_hit(), expected) else { return };
    let t = expected.t.to_f64();
    let error = (f64::from(answer.hit.t) - t).abs() / ulp(t);
    // One rounding of t, and three of the box of the object, into which it is clamped.
    outcome.figure("error of t, ulp", error, Some(4.0));
    let view = scenes::view(ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let found = SurfacePoint::of(structure.renderer.scene(), structure.renderer.world(), &view, &answer.hit);
    let off = (length(found.position - center) - radius).abs() / ulp(radius);
    outcome.figure("distance of the point from the ball, ulp of the radius", off, Some(2.0));
}

fn without_end(context: &Context<'_>) -> Result<Outcome> {
    let mut scene = scenes::empty();
    let (rings, segments) = if context.count(0, 1) == 0 { (50, 100) } else { (160, 320) };
    scenes::add_mesh(&mut scene, meshes::sphere(rings, segments, 2.0, DVec3::Y), DAffine3::IDENTITY, scenes::white());
    let floor = DAffine3 { matrix3: rotation_xyz(DVec3::new(0.1, 0.0, 0.2)), translation: DVec3::Y * -1.5 };
    scenes::add_quadric(&mut scene, shapes::plane(None), floor, scenes::white());
    // y = x z without end.
    let saddle = Quadric::new([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.5, 0.0, 0.0], None, false)?;
    scenes::add_quadric(&mut scene, saddle, scenes::placed(DVec3::new(0.5, 1.0, 0.25), 3.0), scenes::white());
    scenes::add_quadric(&mut scene, shapes::sphere(), scenes::placed(DVec3::new(4.0, 0.0, 1.0), 0.5), scenes::white());
    let reference = Structure::build(&scene, Params { kind: Kind::Linear, ..Params::default() }, context.progress)?;
    let mut sum = Outcome::default();
    for structure in context.structures(&scene) {
        let structure = structure?;
        let valid = structure.renderer.validate();
        sum.check(valid.is_ok(), || Failure::text(format!("{structure}: {valid:?}")));
        let boxes = structure
            .renderer
            .world()
            .instances
            .iter()
            .all(|instance| instance.bounds.is_none_or(|bounds| bounds.min.is_finite() && bounds.max.is_finite()));
        sum.check(boxes, || Failure::text("a box is not finite"));
    }
    let rays = Rays { quick: 400, full: 20_000, linear: 20 };
    let oracle = Oracle::new(&scene)?;
    let found = context.ask_all(&scene, 0xd34, rays, |structure, random, number, outcome| {
        let far = libm::pow(10.0, random.between(-1.0, 6.0));
        let origin = (random.direction() * far).as_vec3();
        let mut direction = (random.in_cube() * 3.0).as_vec3() - origin;
        if number % 4 == 3 {
            // Within the plane of two axes, or along one.
            direction[random.below(3) as usize] = [0.0, -0.0][random.below(2) as usize];
            direction[random.below(3) as usize] = 0.0;
        }
        if direction == Vec3::ZERO {
            return;
        }
        let ray = Ray::new(origin, direction);
        let (answer, expected) = (structure.ask(&ray), reference.ask(&ray));
        let mut same = answer == expected;
        // And all that follow, in their order.
        let (mut hit, mut other) = (Key::BEFORE_ALL, Key::BEFORE_ALL);
        for _ in 0..6 {
            let (a, b) = (structure.renderer.next_after(&ray, hit), reference.renderer.next_after(&ray, other));
            same &= a == b && !a.t.is_nan();
            if !a.is_hit() || !b.is_hit() {
                break;
            }
            (hit, other) = (a.key(), b.key());
        }
        outcome.check(same, || Failure::of_ray(&ray, format!("{structure}: {answer}; without a tree: {expected}")));
        if number < 200 {
            check_exactly(&oracle, &ray, structure, outcome);
        }
    })?;
    Ok(sum.and(found))
}

/// A hit on a quadric is one in exact arithmetic, and none before the closest hit was missed.
fn check_exactly(oracle: &Oracle, ray: &Ray, structure: &Structure, outcome: &mut Outcome) {
    let answer = structure.ask(ray);
    let is_mesh = |instance: u32| instance == 0;
    if answer.hit.is_hit() && !is_mesh(answer.hit.instance) {
        let t = f64::from(answer.hit.t);
        let crossings = oracle.on_line(ray, answer.hit.instance, answer.hit.primitive);
        outcome.check(crossings.iter().any(|crossing| (crossing.t.to_f64() - t).abs() <= ulp(t)), || {
            Failure::of_ray(ray, format!("{structure}: {answer}, which exact arithmetic does not find"))
        });
    }
    if let Some(first) = oracle.closest(ray).filter(|first| !is_mesh(first.instance)) {
        let t = first.t.to_f64();
        outcome.check(answer.is_hit() && f64::from(answer.hit.t) <= t + ulp(t), || {
            Failure::of_ray(ray, format!("{structure}: {answer}, and not object {} at {t:?}", first.instance))
        });
    }
}
