//! The shadow of a ball, and shadows and mirrors at any scale and place: D25.

use glam::DVec3;

use super::stand::Stand;
use super::{Case, Context, Failure, Outcome, meshes, scene_seed};
use crate::accel::Params;
use crate::error::Result;
use crate::geometry::{Hit, Quadric, shapes};
use crate::math::random::Random;
use crate::math::transform::point;
use crate::measure::light_paths::{self, LightPaths};
use crate::measure::scenes::{self, Seen};
use crate::render::Renderer;
use crate::scene::{Rgb, Scene};

/// The cases of this file.
pub const CASES: &[Case] = &[Case {
    id: "D25",
    title: "the shadow of a ball on a floor: its edge, and where they touch",
    bar: "radius 10 / sqrt 80 to 1e-5, attached down to 1e-3 of the contact; no acne, no leak at any scale",
    run: ball_on_floor,
}];

/// A unit ball that rests on a floor under a light at height 10: points of the floor are in its shadow within
/// 10 / sqrt 80 of the contact. The floor is a rectangle of triangles, a square quadric or a plane without end; the
/// ball is a quadric or, for the contact alone, of triangles.
fn ball_on_floor(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let turns = context.count(3, 200);
    let mut number = 0;
    for stand in Stand::all() {
        for floor in 0..3 {
            for as_mesh in [false, true] {
                number += 1;
                let seed = scene_seed(0xd25, number);
                let (scene, floor) = shadow_scene(&stand, floor, as_mesh)?;
                for params in context.params() {
                    let renderer = scenes::build(scene.clone(), &params, context.progress)?;
                    sum = sum.and(context.for_params(&params, seed, turns, |random, _, outcome| {
                        shadow_radii(&renderer, &stand, floor, as_mesh, random, outcome);
                    })?);
                }
            }
        }
    }
    for params in context.params() {
        sum = sum.and(any_scale_and_place(context, &params)?);
    }
    Ok(sum)
}

/// The scene, and what is hit on its floor.
fn shadow_scene(stand: &Stand, floor: u32, as_mesh: bool) -> Result<(Scene, Hit)> {
    let mut scene = scenes::empty();
    let instance = match floor {
        0 => {
            // One triangle, so that no point has to say on which it lies.
            let corners = [DVec3::new(-30.0, 0.0, -20.0), DVec3::new(0.0, 0.0, 40.0), DVec3::new(30.0, 0.0, -20.0)];
            let mesh = scenes::mesh_at(&corners, vec![[0, 1, 2]])?;
            scenes::add_mesh(&mut scene, mesh, stand.transform, scenes::white())
        }
        1 => scenes::add_quadric(&mut scene, shapes::plane(Some(9.0)), stand.transform, scenes::white()),
        _ => scenes::add_quadric(&mut scene, shapes::plane(None), stand.transform, scenes::white()),
    };
    if as_mesh {
        // Its lowest vertex is its pole: it touches the floor as the ball does.
        let ball = meshes::sphere(24, 48, 1.0, DVec3::Y);
        scenes::add_mesh(&mut scene, ball, stand.transform, scenes::black());
    } else {
        let coefficients = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0];
        let ball = Quadric::new(coefficients, None, false)?;
        scenes::add_quadric(&mut scene, ball, stand.transform, scenes::black());
    }
    scenes::add_light(&mut scene, point(&stand.transform, DVec3::Y * 10.0));
    let hit = Hit { t: 1.0, u: 0.0, v: 0.0, instance, primitive: 0 };
    Ok((scene, hit))
}

/// What the floor looks like at a distance from the contact, in a random direction from it.
fn floor_at(renderer: &Renderer, stand: &Stand, hit: &Hit, rho: f64, angle: f64) -> Seen {
    let (sin, cos) = libm::sincos(angle);
    let to_world = |p: DVec3| stand.seen_by(renderer, p);
    let point = to_world(DVec3::new(rho * cos, 0.0, rho * sin));
    let above = to_world(DVec3::new(rho * cos, 1.0, rho * sin));
    scenes::shade(renderer, above, point - above, hit)
}

fn shadow_radii(
    renderer: &Renderer,
    stand: &Stand,
    floor: Hit,
    as_mesh: bool,
    random: &mut Random,
    outcome: &mut Outcome,
) {
    let radius = 10.0 / 80f64.sqrt();
    let angle = random.between(0.0, std::f64::consts::TAU);
    // A ball of triangles lies within the true one; its shadow's edge is its own.
    let (inner, outer) = if as_mesh { (0.98, 1.0) } else { (1.0 - 1e-5, 1.0 + 1e-5) };
    let mut check = |rho: f64, shadow: bool| {
        let seen = floor_at(renderer, stand, &floor, rho, angle);
        let n_dot_l = 10.0 / (100.0 + rho * rho).sqrt();
        let right = if shadow {
            seen.color == Rgb::ZERO
        } else {
            (f64::from(seen.color.x) - n_dot_l).abs() < 1e-6 && seen.color == Rgb::splat(seen.color.x)
        };
        outcome.check(right && seen.counts.shadow == 1, || {
            Failure::text(format!(
                "{}: {} at {rho:?} from the contact (scale {:?}, place {}), where {}",
                renderer.build_stats().accelerator,
                seen.color,
                stand.scale,
                stand.transform.translation,
                if shadow { "the shadow is" } else { "the light is" }
            ))
        });
    };
    check(radius * inner, true);
    check(radius * (outer + 1e-5 * random.unit()), false);
    check(radius * random.between(0.0, inner), true);
    check(radius * random.between(outer, 6.0), false);
    check(libm::pow(10.0, random.between(-3.0, 0.0)), true);
    check(1e-3, true);
}

/// Acne, leaks, contact gaps and mirrored positions over scales and distances.
fn any_scale_and_place(context: &Context<'_>, params: &Params) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let points = context.count(40, 4000);
    for scale in light_paths::SCALES {
        for distance in light_paths::DISTANCES {
            let found = light_paths::measure(params, scale, distance, points, context.progress)?;
            sum.rays += found.lit + found.walled;
            sum.check(found.passes(), || Failure::text(format!("{params:?}: {found:?}")));
            sum.figure("acne, points", found.acne as f64, Some(0.0));
            sum.figure("leaks, points", found.leaks as f64, Some(0.0));
            sum.figure("contact gap over its bound", found.contact_gap / found.contact_gap_bound, Some(1.0));
            let bar = Some(LightPaths::POSITION_ERROR_BAR);
            sum.figure("mirrored position error, ulp a bounce", found.position_error_per_bounce, bar);
        }
    }
    Ok(sum)
}
