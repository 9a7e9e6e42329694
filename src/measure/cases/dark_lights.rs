//! Lights that light nothing: D26.

use glam::{DAffine3, DVec3};

use super::stand::Stand;
use super::{Case, Context, Failure, Outcome, meshes};
use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Quadric, shapes};
use crate::math::random::Random;
use crate::math::transform::point;
use crate::math::vector::{cross, dot, normalize};
use crate::measure::scenes;
use crate::render::Renderer;
use crate::scene::{Falloff, Light, LightKind, Rgb};

/// The cases of this file.
pub const CASES: &[Case] = &[Case {
    id: "D26",
    title: "lights at the point, behind it, in its plane, inside a ball",
    bar: "no light, no NaN, no shadow ray",
    run: lights_that_do_not_count,
}];

/// Points of planes and balls, and lights that cannot light them.
fn lights_that_do_not_count(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let rounds = context.count(6, 400);
    for params in context.params() {
        sum = sum.and(context.for_params(&params, 0xd26, rounds, |random, number, outcome| {
            if let Err(error) = plane_without_light(context, &params, random, number, outcome) {
                outcome.check(false, || Failure::text(error.to_string()));
            }
        })?);
        for as_mesh in [true, false] {
            for stand in Stand::all() {
                balls_without_light(context, &params, &stand, as_mesh, &mut sum)?;
            }
        }
    }
    Ok(sum)
}

/// Every kind of light at a place, aimed at a target where it has an aim.
fn lights_at(position: DVec3, target: DVec3) -> Vec<LightKind> {
    let spot = |direction: DVec3, falloff| LightKind::Spot {
        position,
        direction,
        inner_angle: 0.5,
        outer_angle: 1.0,
        falloff,
    };
    let aim = normalize(target - position).unwrap_or(DVec3::Y);
    vec![
        LightKind::Point { position, falloff: Falloff::None },
        LightKind::Point { position, falloff: Falloff::InverseSquare },
        spot(aim, Falloff::None),
        spot(aim, Falloff::InverseSquare),
    ]
}

fn light(kind: LightKind) -> Light {
    Light { name: "lamp".into(), kind, color: Rgb::ONE }
}

/// What a point of the scene's first object shows of a light alone: nothing, and no ray was traced to find out.
fn check_dark(renderer: &Renderer, eye: DVec3, target: DVec3, what: &str, outcome: &mut Outcome) {
    let seen = scenes::see(renderer, eye, target - eye);
    outcome.check(seen.hit.instance == 0 && seen.color == Rgb::ZERO && seen.counts.shadow == 0, || {
        Failure::text(format!("{}, {what}: {:?} from {eye:?} at {target:?}", renderer.build_stats().accelerator, seen))
    });
}

/// A plane along two axes, or tilted, with a light at the looked-at point, behind the plane, and in it.
fn plane_without_light(
    context: &Context<'_>,
    params: &Params,
    random: &mut Random,
    number: u64,
    outcome: &mut Outcome,
) -> Result<()> {
    // Numbers of few bits, so that the plane's points are exact: the light then is where the point is, or in its plane.
    let short = |x: f64| libm::ldexp(libm::rint(libm::ldexp(x, 12)), -12);
    let scale = libm::ldexp(1.0, [0, -20, 20, 7][(number % 4) as usize]);
    let axis = (number / 4 % 3) as usize;
    let side = if number.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut normal = DVec3::ZERO;
    normal[axis] = side;
    let (mut u, mut v) = (DVec3::ZERO, DVec3::ZERO);
    (u[(axis + 1) % 3], v[(axis + 2) % 3]) = (1.0, side);
    let center = DVec3::from_array(random.in_cube().to_array().map(short)) * scale;
    let on_plane = |a: f64, b: f64| center + (u * short(a) + v * short(b)) * scale;
    let corners = [on_plane(-8.0, -8.0), on_plane(8.0, -8.0), on_plane(0.0, 8.0)];
    let point = on_plane(random.between(-1.0, 1.0), random.between(-1.0, 1.0));
    let eye = point + (normal * 3.0 + random.in_cube()) * scale;
    let away = |height: f64| point + (normal * height + u * random_short(number) + v * 0.25) * scale;
    let cases =
        [("at the point", point), ("behind", away(-2.0)), ("close behind", away(-1e-3)), ("in the plane", away(0.0))];
    for as_mesh in [true, false] {
        let mut scene = scenes::empty();
        if as_mesh {
            scenes::add_mesh(
                &mut scene,
                scenes::mesh_at(&corners, vec![[0, 1, 2]])?,
                DAffine3::IDENTITY,
                scenes::white(),
            );
        } else {
            let mut coefficients = [0.0; 10];
            coefficients[6 + axis] = 0.5 * side;
            coefficients[9] = -side * center[axis];
            scenes::add_quadric(
                &mut scene,
                Quadric::new(coefficients, None, false)?,
                DAffine3::IDENTITY,
                scenes::white(),
            );
        }
        for (what, position) in cases {
            scene.lights = lights_at(position, point).into_iter().map(light).collect();
            let renderer = scenes::build(scene.clone(), params, context.progress)?;
            let origin = renderer.scene().origin;
            check_dark(&renderer, eye - origin, point - origin, what, outcome);
        }
        // From far away: behind, and along the plane. And spots that look elsewhere.
        let mut aside = lights_at(point + normal * scale, point + normal * (2.0 * scale));
        aside.drain(..2);
        aside.extend([LightKind::Directional { direction: normal }, LightKind::Directional { direction: u + v }]);
        scene.lights = aside.into_iter().map(light).collect();
        let renderer = scenes::build(scene.clone(), params, context.progress)?;
        let origin = renderer.scene().origin;
        check_dark(&renderer, eye - origin, point - origin, "aside", outcome);
    }
    tilted_plane(context, params, random, outcome)
}

fn random_short(number: u64) -> f64 {
    (number % 17) as f64 * 0.0625 - 0.5
}

/// A tilted plane, on which no number is exact: a light within rounding of the point gives nothing; one within rounding
/// of the plane no more than rounding.
fn tilted_plane(context: &Context<'_>, params: &Params, random: &mut Random, outcome: &mut Outcome) -> Result<()> {
    let corners = [0; 3].map(|_| random.direction().as_vec3().as_dvec3() * 4.0);
    let [a, b, c] = corners;
    let Some(normal) = normalize(cross(b - a, c - a)) else { return Ok(()) };
    let point = a * 0.4 + b * 0.35 + c * 0.25;
    let eye = point + normal * 2.0;
    let mut scene = scenes::empty();
    let mesh = meshes::soup([corners.map(|p| p.as_vec3())]);
    scenes::add_mesh(&mut scene, mesh, DAffine3::IDENTITY, scenes::white());
    scene.lights = lights_at(point, point).into_iter().map(light).collect();
    let renderer = scenes::build(scene.clone(), params, context.progress)?;
    check_dark(&renderer, eye, point, "at a point that is not exact", outcome);
    scene.lights = vec![light(LightKind::Point { position: a + (b - a) * 0.9, falloff: Falloff::None })];
    let renderer = scenes::build(scene, params, context.progress)?;
    let seen = scenes::see(&renderer, eye, point - eye);
    outcome.check(seen.color.is_finite() && seen.color.max_element() <= 1e-14, || {
        Failure::text(format!("a light in a tilted plane gives {}", seen.color))
    });
    Ok(())
}

/// Closed balls with the light on the other side of their surface.
fn balls_without_light(
    context: &Context<'_>,
    params: &Params,
    stand: &Stand,
    as_mesh: bool,
    outcome: &mut Outcome,
) -> Result<()> {
    let to_file = |p: DVec3| point(&stand.transform, p);
    for lamp in [DVec3::ZERO, DVec3::new(0.3, -0.5, 0.2), DVec3::new(0.0, 0.9, 0.0), DVec3::new(3.0, 1.0, -2.0)] {
        let mut scene = scenes::empty();
        if as_mesh {
            scenes::add_mesh(&mut scene, meshes::sphere(24, 48, 1.0, DVec3::ZERO), stand.transform, scenes::white());
        } else {
            scenes::add_quadric(&mut scene, shapes::sphere(), stand.transform, scenes::white());
        }
        scene.lights = lights_at(to_file(lamp), to_file(DVec3::ZERO)).into_iter().map(light).collect();
        let inside = dot(lamp, lamp) < 1.0;
        let renderer = scenes::build(scene, params, context.progress)?;
        let seen_from = |p: DVec3| stand.seen_by(&renderer, p);
        let mut random = Random::new(0xd26, 1);
        for _ in 0..context.count(10, 500) {
            let target = random.direction();
            if inside {
                check_dark(&renderer, seen_from(target * 3.0), seen_from(target * 0.9), "around a light", outcome);
            } else {
                // From within, the light outside stands in front of half of the points: rays are due, and blocked.
                let seen = scenes::see(&renderer, seen_from(target * 0.3), seen_from(target) - seen_from(target * 0.3));
                outcome.check(seen.hit.is_hit() && seen.color == Rgb::ZERO, || {
                    Failure::text(format!("inside a closed ball, light outside: {seen:?}"))
                });
            }
        }
    }
    Ok(())
}
