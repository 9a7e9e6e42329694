//! Mirrors: D28, D29.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::{Case, Context, Failure, Outcome, meshes, scene_seed};
use crate::accel::Params;
use crate::error::{Fault, Result};
use crate::geometry::{Quadric, shapes};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::random::Random;
use crate::math::transform::{apply, compose, point, rotation_about, rotation_xyz};
use crate::math::vector::{basis, cross, dot, normalize};
use crate::measure::scenes::{self, largest, ulp};
use crate::render::{RenderSettings, Renderer};
use crate::scene::{Camera, FilmSettings, Light, LightKind, Material, NamedCamera, Projection, Rgb, Scene};

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D28",
        title: "facing mirrors: what they add up to, and where a ray is after many of them",
        bar: "2 (1 - 2^-(N+1)) to 4u; place after bounce i to 4 (i + 1) ulp; 1000 bounces; more than 1 refused",
        run: facing_mirrors,
    },
    Case {
        id: "D29",
        title: "mirrors whose interpolated normals lean, seen at grazing angles",
        bar: "reflected rays rise above the surface, finite, and true where the formula is",
        run: leaning_normals,
    },
];

/// How mirrors are made.
#[derive(Clone, Copy, PartialEq)]
enum Made {
    /// Two rectangles in one mesh.
    Mesh,
    /// Two quadric planes.
    Planes,
    /// One quadric, x^2 = x.
    Pair,
}

/// The mirrors x = 0 and x = 1 in their own coordinates, placed.
fn mirrors(made: Made, placed: DAffine3, material: &Material) -> Result<Scene> {
    let mut scene = scenes::empty();
    match made {
        Made::Mesh => {
            let wall = |x: f32, side: f32| {
                [(-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)].map(|(y, z)| Vec3::new(x, y, z * side))
            };
            let positions = wall(0.0, 1.0).into_iter().chain(wall(1.0, -1.0)).collect();
            let mesh = meshes::mesh(positions, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]].into());
            scenes::add_mesh(&mut scene, mesh, placed, material.clone());
        }
        Made::Planes => {
            // The plane x = 0, and its copy at 1, turned back to face it.
            let upright = DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::NEG_Z);
            let back = DAffine3 { matrix3: DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z), translation: DVec3::X };
            for wall in [DAffine3::from_mat3(upright), back] {
                scenes::add_quadric(&mut scene, shapes::plane(None), compose(&placed, &wall), material.clone());
            }
        }
        Made::Pair => {
            let pair = Quadric::new([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0, 0.0], None, false)?;
            scenes::add_quadric(&mut scene, pair, placed, material.clone());
        }
    }
    Ok(scene)
}

/// Along the axes, turned, mirrored, of other sizes and elsewhere.
fn placements() -> Vec<DAffine3> {
    let turn = rotation_about(DVec3::new(2.0, 3.0, -6.0) / 7.0, 0.8);
    let plain = |matrix3, translation| DAffine3 { matrix3, translation };
    let cyclic = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    vec![
        DAffine3::IDENTITY,
        plain(cyclic, DVec3::ZERO),
        plain(cyclic.transpose() * -1.0, DVec3::ZERO),
        plain(turn, DVec3::ZERO),
        plain(turn * -1e-6, DVec3::ZERO),
        plain(DMat3::IDENTITY * libm::ldexp(1.0, 20), DVec3::ZERO),
        plain(turn * 3.0, DVec3::new(30.0, -20.0, 10.0)),
        plain(turn, DVec3::new(4_512_345.123, 1000.1, -5_432_100.987)),
    ]
}

fn facing_mirrors(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let paths = context.count(4, 300);
    for params in context.params() {
        for (number, made) in (0..).zip([Made::Mesh, Made::Planes, Made::Pair]) {
            for (place, placed) in (0..).zip(placements()) {
                // Planes without end have no place from which the scene's origin could be chosen.
                if made != Made::Mesh && largest(placed.translation) > 1e3 {
                    continue;
                }
                // Deep enough to see many bounces; the recursion fits any thread's stack.
                const BOUNCES: u32 = 24;
                let mut scene = mirrors(made, placed, &scenes::mirror(1.0, 0.0))?;
                scene.film.max_depth = BOUNCES;
                let renderer = scenes::build(scene, &params, context.progress)?;
                let seed = scene_seed(0xd28, 256 * number + place);
                sum = sum.and(context.for_params(&params, seed, paths, |random, _, outcome| {
                    bounce(&renderer, &placed, BOUNCES, random, outcome);
                })?);
            }
            for depth in [0, 1, 2, 5, 24] {
                series(context, &params, made, depth, 0.5, &mut sum)?;
            }
            for (depth, share) in [(1000, 0.5), (1000, 1.0), (999, 1.0), (0, 1.0)] {
                series(context, &params, made, depth, share, &mut sum)?;
            }
        }
        for (kr, kt) in
            [(1.001, 0.0), (2.0, 0.0), (0.6, 0.6), (0.0, 1.5), (f32::INFINITY, 0.0), (f32::NAN, 0.0), (0.0, f32::NAN)]
        {
            for channel in [Rgb::ONE, Rgb::Y] {
                let part = |weight: f32| Rgb::select(channel.cmpeq(Rgb::ONE), Rgb::splat(weight), Rgb::ZERO);
                let material = Material { kr: part(kr), kt: part(kt), ..scenes::black() };
                let scene = mirrors(Made::Mesh, DAffine3::IDENTITY, &material)?;
                let refused = Renderer::build(scene, &params, context.progress).err().map(|error| error.fault());
                sum.check(refused == Some(Fault::Caller), || {
                    Failure::text(format!("mirrors of kr {:?} and kt {:?} gave {refused:?}", material.kr, material.kt))
                });
            }
        }
    }
    Ok(sum)
}

/// One path between the mirrors against the unfolded straight line.
fn bounce(renderer: &Renderer, placed: &DAffine3, bounces: u32, random: &mut Random, outcome: &mut Outcome) {
    let start = DVec3::new(random.between(0.05, 0.95), random.between(-1.0, 1.0), random.between(-1.0, 1.0));
    let slope = DVec3::new(1.0, random.between(-1.7, 1.7), random.between(-1.7, 1.7));
    let seen_from = |p: DVec3| (placed.translation - renderer.scene().origin) + apply(&placed.matrix3, p);
    let (rays, _) = scenes::path(renderer, seen_from(start), apply(&placed.matrix3, slope));
    outcome.check(rays.len() == bounces as usize + 1, || {
        Failure::text(format!("{} rays, not {}: {}", rays.len(), bounces + 1, renderer.build_stats().accelerator))
    });
    let normal = normalize(placed.matrix3.x_axis).unwrap_or(DVec3::X);
    for (number, ray) in rays.iter().enumerate().skip(1) {
        let run = number as f64 - start.x;
        let expected = seen_from((start + slope * run).with_x((number % 2) as f64));
        // Off the mirror the ray begins where rounding cannot put it behind; along the mirror it must be right.
        let off = ray.origin.as_dvec3() - expected;
        let error = largest(off - normal * dot(off, normal)) / ulp(largest(expected));
        outcome.figure("error of place, ulp over bounces + 1", error / number as f64, Some(4.0));
        outcome.check(error <= 4.0 * number as f64, || {
            Failure::of_ray(ray, format!("bounce {number} is {error} ulp off, at {placed:?}"))
        });
    }
}

/// The mirrors shine by 1 and reflect a share; rendered, since a picture's threads have the stack for 1000 of them.
fn series(
    context: &Context<'_>,
    params: &Params,
    made: Made,
    depth: u32,
    share: f32,
    outcome: &mut Outcome,
) -> Result<()> {
    let mut scene = mirrors(made, DAffine3::IDENTITY, &scenes::mirror(share, 1.0))?;
    scene.film = FilmSettings { width: 1, height: 1, samples: 1, max_depth: depth, ..FilmSettings::default() };
    let camera = Camera::LookAt {
        eye: DVec3::new(0.5, 0.0, 0.1),
        target: DVec3::new(1.0, 0.001, 0.1),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 0.01 },
    };
    scene.cameras = vec![NamedCamera::new("between", camera)];
    let renderer = Renderer::build(scene, params, context.progress)?;
    let film = renderer.render(&RenderSettings { threads: 1, ..RenderSettings::default() }, context.progress)?;
    context.progress.check()?;
    let expected =
        if share == 1.0 { f64::from(depth) + 1.0 } else { 2.0 * (1.0 - libm::exp2(-f64::from(depth) - 1.0)) };
    let found = film.color.first().map_or(f64::NAN, |color| f64::from(color[0]));
    let error = (found - expected).abs() / expected;
    outcome.figure("error of the sum, u", error / UNIT_ROUNDOFF, Some(4.0));
    outcome.check(error <= 4.0 * UNIT_ROUNDOFF, || {
        Failure::text(format!("{params:?}: {found:?} after {depth} reflections of {share}, not {expected:?}"))
    });
    Ok(())
}

fn leaning_normals(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    let rounds = context.count(60, 20_000);
    for params in context.params() {
        sum = sum.and(context.for_params(&params, 0xd29, rounds, |random, number, outcome| {
            lean(context, &params, random, number, outcome).unwrap_or_else(|error| {
                outcome.check(false, || Failure::text(error.to_string()));
            });
        })?);
    }
    terminator(context, &mut sum)?;
    Ok(sum)
}

/// A triangle whose normals lean by up to 85 degrees, placed anyhow, seen at an angle of its own from either side.
fn lean(context: &Context<'_>, params: &Params, random: &mut Random, number: u64, outcome: &mut Outcome) -> Result<()> {
    let tilt = [60.0, 0.0, 85.0, 30.0][(number % 4) as usize];
    let height = [1.0, 5.0, 30.0, 89.0, 0.1, 1e-3][(number / 4 % 6) as usize];
    let radians = |degrees: f64| degrees * (std::f64::consts::PI / 180.0);
    let (sin, cos) = libm::sincos(radians(tilt));
    let mut mesh = meshes::soup([[Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.0)]]);
    // All leaning the same way, or each its own.
    let normals = (0..3).map(|corner| {
        let turn = if number.is_multiple_of(2) { 0.0 } else { 2.0 * f64::from(corner) };
        DVec3::new(sin * libm::cos(turn), cos, sin * libm::sin(turn)).as_vec3()
    });
    mesh.normals = Some(normals.collect());
    let stretch = [DVec3::ONE, DVec3::new(3.0, 0.2, -1.0)][(number / 24 % 2) as usize];
    let turn = DAffine3 { matrix3: rotation_xyz(random.in_cube() * 3.0), translation: random.in_cube() };
    let placed = compose(&turn, &DAffine3::from_mat3(DMat3::from_diagonal(stretch)));
    let mut scene = scenes::empty();
    scenes::add_mesh(&mut scene, mesh, placed, scenes::mirror(1.0, 0.0));
    scene.film.max_depth = 1;
    let renderer = Renderer::build(scene, params, context.progress)?;

    let face = normalize(cross(apply(&placed.matrix3, DVec3::X), apply(&placed.matrix3, DVec3::Z))).unwrap_or(DVec3::Y);
    let side = if random.unit() < 0.5 { face } else { -face };
    let (u, v) = basis(side);
    let (sin, cos) = libm::sincos(random.between(0.0, std::f64::consts::TAU));
    let (rise, along) = libm::sincos(radians(height));
    let toward_eye = side * rise + (u * cos + v * sin) * along;
    let target = point(&placed, DVec3::new(random.between(-0.1, 0.1), 0.0, random.between(-0.1, 0.3)));
    let (rays, color) = scenes::path(&renderer, target + toward_eye * 3.0, -toward_eye);
    let Some(reflected) = rays.get(1) else {
        // At a thousandth of a degree rounding may lift the ray over the triangle's edge.
        outcome.check(height < 0.01, || Failure::text(format!("no hit at {height} degrees: {placed:?}")));
        return Ok(());
    };
    let direction = reflected.direction.as_dvec3();
    let rises = dot(direction, side);
    let least = (0.9 * rise).min(0.01);
    outcome.check(direction.is_finite() && rises > 0.0 && rises >= 0.99 * least - 1e-7 && color.is_finite(), || {
        Failure::of_ray(
            reflected,
            format!(
                "reflected {rises:e} above the surface at {height} degrees, normals leaning {tilt}; at least {least:e}"
            ),
        )
    });
    if tilt == 0.0 {
        // A true normal needs no lifting: the seed's formula to the rounding of a direction.
        let mirrored = side * (2.0 * dot(toward_eye, side)) - toward_eye;
        outcome.check(largest(direction - mirrored) <= 4.0 * UNIT_ROUNDOFF, || {
            Failure::of_ray(reflected, format!("reflected to {direction}, not {mirrored}, without leaning normals"))
        });
    }
    Ok(())
}

/// How a coarse ball with smooth normals differs from a smooth ball where light ends: its faces shade themselves.
/// Reported without a bar: it is what the model is, and not what a renderer should hide.
fn terminator(context: &Context<'_>, sum: &mut Outcome) -> Result<()> {
    let mut ball = meshes::icosphere(1, 1.0, DVec3::ZERO);
    ball.normals = Some(ball.positions.clone());
    let mut scene = scenes::empty();
    scenes::add_mesh(&mut scene, ball, DAffine3::IDENTITY, scenes::white());
    let lamp = |direction| Light { name: "sun".into(), kind: LightKind::Directional { direction }, color: Rgb::ONE };
    let total = context.count(200, 50_000);
    for light in 0..5 {
        let to_light = normalize(DVec3::new(1.0, 0.3 * f64::from(light), -0.2)).unwrap_or(DVec3::X);
        scene.lights = vec![lamp(-to_light)];
        let renderer = Renderer::build(scene.clone(), &Params::default(), context.progress)?;
        let found = context.for_all(0xd29, total, |random, _, outcome| {
            let toward_eye = random.direction();
            let eye = toward_eye * 4.0;
            let seen = scenes::see(&renderer, eye, random.direction() * 0.8 - eye);
            if !seen.hit.is_hit() {
                return;
            }
            let brightness = f64::from(seen.color.x);
            outcome.check(brightness.is_finite() && brightness >= 0.0, || Failure::text(format!("{seen:?}")));
            outcome.figure("brightest point of a coarse ball", brightness, Some(1.0 + 4.0 * UNIT_ROUNDOFF));
            // Its interpolated normal faces the light, and its own face does not, or another face is in the way.
            let dark_but_facing = seen.counts.shadow == 1 && brightness == 0.0;
            outcome.figure(
                "coarse ball: steepest light that its faces keep off, N.L",
                if dark_but_facing { smooth(&renderer, &seen, to_light) } else { 0.0 },
                None,
            );
        })?;
        *sum = std::mem::take(sum).and(found);
    }
    Ok(())
}

/// N.L of the interpolated normal at what was seen.
fn smooth(renderer: &Renderer, seen: &scenes::Seen, to_light: DVec3) -> f64 {
    let mesh = &renderer.scene().meshes[0];
    let [a, b, c] = mesh.triangle(seen.hit.primitive).map(Vec3::as_dvec3);
    let (u, v) = (f64::from(seen.hit.u), f64::from(seen.hit.v));
    let normal = a * (1.0 - u - v) + b * u + c * v;
    normalize(normal).map_or(0.0, |normal| dot(normal, to_light))
}
