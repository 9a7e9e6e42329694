//! Quadrics of every rank, and a mirror of one: D31, D32.

use glam::{DAffine3, DMat3, DVec3};

use super::{Case, Context, Failure, Outcome, Rays, scene_seed};
use crate::error::Result;
use crate::geometry::Quadric;
use crate::math::random::Random;
use crate::math::transform::{apply, point, rotation_xyz};
use crate::math::vector::{cross, dot, length};
use crate::measure::dyadic::Dyadic;
use crate::measure::scenes::{self, ulp};

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D31",
        title: "planes, pairs, cylinder, cone, hyperboloids, saddle, paraboloid, point, nothing",
        bar: "the closed forms; |F| / |grad F| at most 4 ulp of the scale",
        run: canonical_set,
    },
    Case {
        id: "D32",
        title: "a parabolic mirror and its focus",
        bar: "reflected rays within 1e-6 of the focus",
        run: focus,
    },
];

/// A quadric by its coefficients in the seed's order, with lines whose crossings are known.
struct Canonical {
    name: &'static str,
    coefficients: [f64; 10],
    lines: Vec<([f64; 3], [f64; 3], Vec<f64>)>,
}

fn canonical() -> Vec<Canonical> {
    let z = 0.0;
    let root = |x: f64| x.sqrt();
    let of = |name, coefficients, lines| Canonical { name, coefficients, lines };
    let (plus_x, minus_z, plus_y) = ([1.0, z, z], [z, z, -1.0], [z, 1.0, z]);
    vec![
        of(
            "plane",
            [z, z, z, z, z, z, z, 0.5, z, z],
            vec![
                ([0.0, 2.0, 0.0], [1.0, -1.0, 0.0], vec![2.0]),
                ([0.0, 2.0, 0.0], plus_x, vec![]),
                ([0.0, 0.0, 0.0], plus_x, vec![]),
            ],
        ),
        of(
            "two planes",
            [1.0, z, z, z, z, z, z, z, z, -1.0],
            vec![([-3.0, 0.0, 0.0], plus_x, vec![2.0, 4.0]), ([0.5, 0.0, 0.0], plus_y, vec![])],
        ),
        of(
            "double plane",
            [1.0, z, z, z, z, z, z, z, z, z],
            vec![([-3.0, 1.0, 0.0], plus_x, vec![3.0]), ([-3.0, 1.0, 0.0], [2.0, 1.0, 5.0], vec![1.5])],
        ),
        of(
            "cylinder",
            [1.0, z, 1.0, z, z, z, z, z, z, -1.0],
            vec![
                ([0.5, -2.0, 0.0], plus_y, vec![]),
                ([1.0, -2.0, 0.0], plus_y, vec![]),
                ([-3.0, 0.0, 0.0], plus_x, vec![2.0, 4.0]),
                ([-3.0, 0.0, 1.0], plus_x, vec![3.0]),
            ],
        ),
        of(
            "cone",
            [1.0, -1.0, 1.0, z, z, z, z, z, z, z],
            vec![
                ([-3.0, 1.0, 0.0], plus_x, vec![2.0, 4.0]),
                ([-3.0, 0.0, 0.0], plus_x, vec![3.0]),
                // Along the surface, and beside it: parallel to a line of the cone there is one crossing.
                ([0.0, 0.0, 0.0], [1.0, 1.0, 0.0], vec![]),
                ([0.0, -1.0, 0.0], [1.0, 1.0, 0.0], vec![0.5]),
            ],
        ),
        of(
            "hyperboloid of one sheet",
            [1.0, -1.0, 1.0, z, z, z, z, z, z, -1.0],
            vec![
                ([-4.0, 0.0, 0.0], plus_x, vec![3.0, 5.0]),
                ([-4.0, 1.0, 0.0], plus_x, vec![4.0 - root(2.0), 4.0 + root(2.0)]),
                ([0.0, -1.0, 0.0], plus_y, vec![]),
                // One of its own lines.
                ([1.0, 0.0, 0.0], [0.0, 1.0, 1.0], vec![]),
            ],
        ),
        of(
            "hyperboloid of two sheets",
            [1.0, -1.0, 1.0, z, z, z, z, z, z, 1.0],
            vec![
                ([0.0, -4.0, 0.0], plus_y, vec![3.0, 5.0]),
                ([-4.0, 0.0, 0.0], plus_x, vec![]),
                ([-4.0, 2.0, 0.0], plus_x, vec![4.0 - root(3.0), 4.0 + root(3.0)]),
            ],
        ),
        of(
            "saddle z = x y",
            [z, z, z, 0.5, z, z, z, z, -0.5, z],
            vec![
                ([2.0, 3.0, 10.0], minus_z, vec![4.0]),
                ([0.0, 2.0, 1.0], plus_x, vec![0.5]),
                ([0.0, 2.0, 0.0], [1.0, 0.0, 2.0], vec![]),
                ([-3.0, -3.0, 1.0], [1.0, 1.0, 0.0], vec![2.0, 4.0]),
            ],
        ),
        of(
            "paraboloid z = x^2 + y^2",
            [1.0, 1.0, z, z, z, z, z, z, -0.5, z],
            vec![
                ([0.0, 0.0, 10.0], [1e-8, 0.0, -1.0], vec![f64::NEG_INFINITY, 10.0]),
                ([0.0, 0.0, 10.0], minus_z, vec![10.0]),
                ([2.0, 0.0, 10.0], minus_z, vec![6.0]),
                ([-3.0, 0.0, 4.0], plus_x, vec![1.0, 5.0]),
            ],
        ),
        of(
            "point",
            [1.0, 1.0, 1.0, z, z, z, z, z, z, z],
            vec![([0.0, 0.0, 5.0], minus_z, vec![5.0]), ([1e-9, 0.0, 5.0], minus_z, vec![])],
        ),
        of("line", [1.0, z, 1.0, z, z, z, z, z, z, z], vec![([-2.0, 7.0, 0.0], plus_x, vec![2.0])]),
        of("imaginary", [1.0, 1.0, 1.0, z, z, z, z, z, z, 1.0], vec![([0.0, 0.0, 5.0], minus_z, vec![])]),
        of("constant", [z, z, z, z, z, z, z, z, z, 1.0], vec![([0.0, 0.0, 5.0], minus_z, vec![])]),
        of("negative constant", [z, z, z, z, z, z, z, z, z, -7.0], vec![([0.0, 0.0, 5.0], plus_x, vec![])]),
        of(
            "sphere",
            [1.0, 1.0, 1.0, z, z, z, z, z, z, -1.0],
            vec![([0.0, 0.0, 3.0], minus_z, vec![2.0, 4.0]), ([1.0, 0.0, 3.0], minus_z, vec![3.0])],
        ),
    ]
}

/// Axes renamed in the order in which a cycle by `turn` takes them.
fn cycled(k: &[f64; 10], turn: usize) -> [f64; 10] {
    let mut k = *k;
    for _ in 0..turn {
        // x becomes y, y becomes z, z becomes x.
        let [a, b, c, d, e, f, g, h, i, j] = k;
        k = [c, a, b, f, d, e, i, g, h, j];
    }
    k
}

fn cycled_vector(v: [f64; 3], turn: usize) -> DVec3 {
    (0..turn).fold(DVec3::from_array(v), |v, _| DVec3::new(v.z, v.x, v.y))
}

/// F and its gradient at a point, exact and then rounded once.
fn value(k: &[f64; 10], p: DVec3) -> (f64, DVec3) {
    let [a, b, c, d, e, f, g, h, i, j] = k.map(Dyadic::new);
    let [x, y, z] = p.to_array().map(Dyadic::new);
    let half = [
        &a * &x + &d * &y + &f * &z + g.clone(),
        &d * &x + &b * &y + &e * &z + h.clone(),
        &f * &x + &e * &y + &c * &z + i.clone(),
    ];
    let value = &half[0] * &x + &half[1] * &y + &half[2] * &z + g * x + h * y + i * z + j;
    (value.to_f64(), DVec3::from_array(half.map(|part| 2.0 * part.to_f64())))
}

fn canonical_set(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    for (number, Canonical { name, coefficients, lines }) in (0..).zip(canonical()) {
        for turn in 0..3 {
            // The same surface times any factor, of either sign.
            for factor in [1.0, -1.0, 1e-30, -3e25, 0.7] {
                let k = cycled(&coefficients, turn).map(|k| k * factor);
                let quadric = Quadric::new(k, None, false)?;
                for (o, d, expected) in &lines {
                    let (o, d) = (cycled_vector(*o, turn), cycled_vector(*d, turn));
                    let found: Vec<f64> = quadric.intersect_quadratic(o, d).iter().map(|crossing| crossing.t).collect();
                    let near = |(t, expected): (&f64, &f64)| {
                        (expected.is_infinite() && *t < -1e15)
                            || (t - expected).abs() <= 8.0 * f64::EPSILON * expected.abs()
                    };
                    let right = found.len() == expected.len() && found.iter().zip(expected).all(near);
                    sum.check(right, || {
                        Failure::text(format!("{name} {k:?}: the line {o} + t {d} gave {found:?}, not {expected:?}"))
                    });
                }
            }
            let k = cycled(&coefficients, turn);
            let found = context.for_all(
                scene_seed(0xd31, 3 * number + turn as u64),
                context.count(60, 20_000),
                |random, number, outcome| {
                    residual(name, &k, random, number, outcome);
                },
            )?;
            sum = sum.and(found);
        }
    }
    Ok(sum)
}

/// A random line at a quadric, scaled and moved by its coefficients: every crossing lies on it, and as many as there are.
fn residual(name: &str, k: &[f64; 10], random: &mut Random, number: u64, outcome: &mut Outcome) {
    // Moved by short numbers, so that the new coefficients are exact.
    let shift = DVec3::from_array((random.in_cube() * 8.0).to_array().map(libm::rint))
        * [0.0, 1.0, 64.0][(number % 3) as usize];
    let k = moved(k, shift);
    let Ok(quadric) = Quadric::new(k, None, false) else { return };
    let origin = (shift + random.in_cube() * [2.0, 50.0][(number / 3 % 2) as usize]).as_vec3().as_dvec3();
    let goal = shift + random.in_cube() * 1.5;
    let direction = (goal - origin).as_vec3().as_dvec3();
    let crossings: Vec<_> = quadric.intersect_quadratic(origin, direction).iter().collect();
    for crossing in &crossings {
        let p = quadric.point(origin, direction, crossing.surface).position;
        let (value, gradient) = value(&k, p);
        // What counts is the size of what took part: the origin, the point, and the quadric's place.
        let scale = scenes::largest(p).max(scenes::largest(origin)).max(scenes::largest(shift)).max(1.0);
        let distance = value.abs() / length(gradient);
        // At a point, a line or an apex the gradient is 0 as F is: F itself is the square of a distance.
        let distance = if distance.is_finite() { distance.min(value.abs().sqrt()) } else { value.abs().sqrt() };
        outcome.figure("|F| / |grad F|, ulp of the scale", distance / ulp(scale), Some(4.0));
        outcome.check(distance <= 4.0 * ulp(scale), || {
            Failure::text(format!("{name} {k:?}: {p} is {distance:e} off, on the line {origin} + t {direction}"))
        });
    }
    // As many crossings as the exact quadratic along the line has roots, where that is not in doubt.
    let (a, b, c) = along(&k, origin, direction);
    let discriminant = (&b * &b - &a * &c).to_f64();
    let size = (b.to_f64() * b.to_f64()).max((a.to_f64() * c.to_f64()).abs());
    if discriminant.abs() > 1e-10 * size && a.to_f64().abs() > 1e-10 * scenes::largest(direction) {
        let expected = if discriminant > 0.0 { 2 } else { 0 };
        outcome.check(crossings.len() == expected, || {
            Failure::text(format!("{name} {k:?}: {crossings:?} on the line {origin} + t {direction}, not {expected}"))
        });
    }
}

/// The coefficients of the surface moved by a vector.
fn moved(k: &[f64; 10], by: DVec3) -> [f64; 10] {
    let [a, b, c, d, e, f, ..] = *k;
    let (constant, gradient) = value(k, -by);
    [a, b, c, d, e, f, 0.5 * gradient.x, 0.5 * gradient.y, 0.5 * gradient.z, constant]
}

/// The exact coefficients of F along a line: a t^2 + 2 b t + c.
fn along(k: &[f64; 10], o: DVec3, d: DVec3) -> (Dyadic, Dyadic, Dyadic) {
    let [xx, yy, zz, xy, yz, xz, g, h, i, j] = k.map(Dyadic::new);
    let o = o.to_array().map(Dyadic::new);
    let d = d.to_array().map(Dyadic::new);
    let bent = |v: &[Dyadic; 3]| {
        [
            &xx * &v[0] + &xy * &v[1] + &xz * &v[2],
            &xy * &v[0] + &yy * &v[1] + &yz * &v[2],
            &xz * &v[0] + &yz * &v[1] + &zz * &v[2],
        ]
    };
    let dot = |p: &[Dyadic; 3], q: &[Dyadic; 3]| &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2];
    let linear = [g, h, i];
    let a = dot(&d, &bent(&d));
    let b = dot(&o, &bent(&d)) + dot(&linear, &d);
    let c = dot(&o, &bent(&o)) + dot(&linear, &o).scaled(1) + j;
    (a, b, c)
}

fn focus(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    // 4 z = x^2 + y^2.
    let bowl = Quadric::new([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -2.0, 0.0], None, false)?;
    for number in 0..8u32 {
        let size = [1.0, 1.0, 1e-6, 1e6, 0.125, 1.0, 3.0, 1.0][number as usize];
        let turn =
            if number == 0 { DMat3::IDENTITY } else { rotation_xyz(DVec3::new(0.3, 1.1, -2.0) * f64::from(number)) };
        let mirrored = DMat3::from_diagonal(DVec3::new(if number % 2 == 1 { -size } else { size }, size, size));
        let placed = DAffine3 {
            matrix3: turn * mirrored,
            translation: DVec3::new(0.5, -0.25, 0.75) * (size * f64::from(number / 4)),
        };
        let mut scene = scenes::empty();
        scenes::add_quadric(&mut scene, bowl.clone(), placed, scenes::mirror(1.0, 0.0));
        scene.film.max_depth = 1;
        let goal = point(&placed, DVec3::Z);
        let rays = Rays { quick: 60, full: 200_000, linear: 1 };
        sum = sum.and(context.ask_all(
            &scene,
            scene_seed(0xd32, u64::from(number)),
            rays,
            |structure, random, _, outcome| {
                let (x, y) = (random.between(-2.0, 2.0), random.between(-2.0, 2.0));
                let (rays, _) = scenes::path(
                    &structure.renderer,
                    point(&placed, DVec3::new(x, y, 10.0)),
                    apply(&placed.matrix3, DVec3::NEG_Z),
                );
                let Some(reflected) = rays.get(1) else {
                    outcome.check(false, || Failure::text(format!("{structure}: no hit from ({x}, {y}, 10) down")));
                    return;
                };
                let (o, d) = (reflected.origin.as_dvec3(), reflected.direction.as_dvec3());
                let miss = length(cross(goal - o, d)) / (length(d) * size);
                // Four steps of f32 at the canonical bowl's coordinates, up to 2, are 1e-6; turned and moved ones go farther.
                let bar = (4.0 * ulp(scenes::largest(o)) / size).max(1e-6);
                if number == 0 {
                    outcome.figure("distance from the focus", miss, Some(1e-6));
                }
                outcome.figure("distance from the focus over its bar, turned and moved too", miss / bar, Some(1.0));
                outcome.check(miss <= bar && dot(goal - o, d) > 0.0, || {
                    Failure::of_ray(
                        reflected,
                        format!("{structure}: passes the focus {goal} at {miss:e}, placed {placed:?}"),
                    )
                });
            },
        )?);
    }
    Ok(sum)
}
