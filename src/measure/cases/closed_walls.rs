//! Light inside closed solids: D27.

use glam::{DAffine3, DVec3};

use super::stand::Stand;
use super::{Case, Context, Failure, Outcome, Rays, Structure, meshes, scene_seed};
use crate::error::Result;
use crate::geometry::quadric::Clip;
use crate::geometry::{Quadric, TriangleMesh, shapes};
use crate::math::random::Random;
use crate::math::transform::{apply, point};
use crate::math::vector::length;
use crate::measure::scenes;
use crate::scene::{Rgb, Scene};

/// The cases of this file.
pub const CASES: &[Case] = &[Case {
    id: "D27",
    title: "light inside closed solids, seen within 1e-6 of their edges and beyond them",
    bar: "exactly 0",
    run: closed_walls,
}];

/// A solid that light cannot leave, with a light inside and a room around it.
struct Walled {
    name: &'static str,
    stand: Stand,
    scene: Scene,
    /// The light, in the solid's own coordinates.
    lamp: DVec3,
    /// A point within 1e-6 of where the solid has edges, in its own coordinates.
    near_edge: fn(&mut Random) -> DVec3,
}

fn closed_walls(context: &Context<'_>) -> Result<Outcome> {
    let mut sum = Outcome::default();
    for (number, walled) in (0..).zip(walls()?) {
        let full = if number == 0 { 10_000_000 } else { 1_000_000 };
        let linear = if walled.name == "ball of triangles" { 1000 } else { 10 };
        let rays = Rays { quick: 300, full, linear };
        let found =
            context.ask_all(&walled.scene, scene_seed(0xd27, number), rays, |structure, random, number, outcome| {
                look_at_wall(structure, &walled, random, number, outcome);
            })?;
        sum = sum.and(found);
    }
    Ok(sum)
}

fn walls() -> Result<Vec<Walled>> {
    let rounded_cube = Quadric::new(
        [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.69],
        Some(Clip { min: DVec3::NEG_ONE, max: DVec3::ONE }),
        true,
    )?;
    let half_ball =
        Quadric::new([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], Some(Clip::between(-0.5, 0.25)), true)?;
    let cube = || meshes::moved(&meshes::cube(), |p| p * 2.0 - 1.0);
    let upright = || Stand::new(1.0, 0.0, DVec3::ZERO);
    let turned = || Stand::new(0.37, 0.7, DVec3::new(3.0, -20.0, 7.0));
    let far = Stand::new(1.0, 2.0, DVec3::new(4_512_344.0, 1024.0, -5_432_104.0));
    let ball = meshes::sphere(48, 96, 1.0, DVec3::ZERO);
    let (aside, low) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(0.1, 0.15, 0.2));
    let cylinder = || Solid::Quadric(shapes::cylinder(false));
    Ok(vec![
        Walled::new("cube", Solid::Mesh(cube()), upright(), aside, cube_edge),
        Walled::new("cube, turned", Solid::Mesh(cube()), turned(), aside, cube_edge),
        Walled::new("cube, far away", Solid::Mesh(cube()), far, aside, cube_edge),
        Walled::new("ball of triangles", Solid::Mesh(ball), turned(), aside, ball_edge),
        Walled::new("cylinder", cylinder(), upright(), low, rim),
        Walled::new("cylinder, turned", cylinder(), turned(), low, rim),
        Walled::new("cone", Solid::Quadric(shapes::cone(false)), turned(), low, rim),
        Walled::new("rounded cube", Solid::Quadric(rounded_cube), turned(), low, rounded_edge),
        Walled::new("slice of a ball", Solid::Quadric(half_ball), upright(), low, slice_rim),
    ])
}

/// What a wall is made of.
enum Solid {
    Mesh(TriangleMesh),
    Quadric(Quadric),
}

impl Walled {
    fn new(name: &'static str, solid: Solid, stand: Stand, lamp: DVec3, near_edge: fn(&mut Random) -> DVec3) -> Self {
        let mut scene = scenes::empty();
        match solid {
            Solid::Mesh(mesh) => scenes::add_mesh(&mut scene, mesh, stand.transform, scenes::white()),
            Solid::Quadric(quadric) => scenes::add_quadric(&mut scene, quadric, stand.transform, scenes::white()),
        };
        let room = DAffine3 { matrix3: stand.transform.matrix3 * 20.0, translation: stand.transform.translation };
        scenes::add_quadric(&mut scene, shapes::sphere(), room, scenes::white());
        scenes::add_light(&mut scene, point(&stand.transform, lamp));
        scene.origin = crate::scene::origin::choose(&scene);
        Self { name, stand, scene, lamp, near_edge }
    }
}

/// Within 1e-6 of zero, of either sign, at any order of magnitude; sometimes zero.
fn hair(random: &mut Random) -> f64 {
    let size = libm::pow(10.0, random.between(-9.0, -6.0));
    [0.0, size, -size][random.below(3) as usize]
}

/// Near an edge of the cube [-1, 1]^3, every third time near a corner.
fn cube_edge(random: &mut Random) -> DVec3 {
    let mut p = random.in_cube();
    let axis = random.below(3) as usize;
    for k in 1..=2 + usize::from(random.below(3) == 0) {
        p[(axis + k) % 3] = 1f64.copysign(p[(axis + k) % 3]) + hair(random);
    }
    p
}

/// Near an edge or a corner of the ball of 48 x 96 triangles.
fn ball_edge(random: &mut Random) -> DVec3 {
    let at = |ring: f64, segment: f64| {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * ring / 48.0);
        let (z, x) = libm::sincos(std::f64::consts::TAU * segment / 96.0);
        DVec3::new(sin * x, cos, sin * z)
    };
    let (ring, segment) = (random.below(48) as f64, random.below(96) as f64);
    let (a, b) = (at(ring, segment), [at(ring + 1.0, segment), at(ring, segment + 1.0)][random.below(2) as usize]);
    let share = [0.0, random.unit()][random.below(2) as usize];
    (a + (b - a) * share) * (1.0 + hair(random))
}

/// Near the rims of the unit cylinder, the lower of which is the cone's.
fn rim(random: &mut Random) -> DVec3 {
    let (sin, cos) = libm::sincos(random.between(0.0, std::f64::consts::TAU));
    let r = 1.0 + hair(random);
    DVec3::new(r * cos, random.below(2) as f64 + hair(random), r * sin)
}

/// Near where the sphere of radius 1.3 leaves the cube [-1, 1]^3.
fn rounded_edge(random: &mut Random) -> DVec3 {
    let axis = random.below(3) as usize;
    let (sin, cos) = libm::sincos(random.between(0.0, std::f64::consts::TAU));
    let r = (1.69f64 - 1.0).sqrt() + hair(random);
    let mut p = DVec3::ZERO;
    p[axis] = [1.0, -1.0][random.below(2) as usize] + hair(random);
    (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (r * cos, r * sin);
    p
}

/// Near the rims of the slice of the unit ball between y = -0.5 and 0.25.
fn slice_rim(random: &mut Random) -> DVec3 {
    let y = [-0.5f64, 0.25][random.below(2) as usize];
    let (sin, cos) = libm::sincos(random.between(0.0, std::f64::consts::TAU));
    let r = (1.0 - y * y).sqrt() + hair(random);
    DVec3::new(r * cos, y + hair(random), r * sin)
}

/// Looks at the solid from outside near its edges, and at the room behind them as the light would see it.
fn look_at_wall(structure: &Structure, walled: &Walled, random: &mut Random, number: u64, outcome: &mut Outcome) {
    let renderer = &structure.renderer;
    let m = walled.stand.transform;
    let seen_from = |p: DVec3| walled.stand.seen_by(renderer, p);
    let target = (walled.near_edge)(random);
    let (eye, what) = if number.is_multiple_of(2) {
        // From anywhere outside: beyond a ball around the solid.
        (random.direction() * random.between(2.0, 9.0), "outside")
    } else {
        let along = target - walled.lamp;
        (walled.lamp + along * (random.between(3.0, 9.0) / length(along)), "beyond")
    };
    // Towards the solid, or away from the light: the wall of the room where the light would come through the edge.
    let along = if what == "outside" { target - eye } else { target - walled.lamp };
    let seen = scenes::see(renderer, seen_from(eye), apply(&m.matrix3, along));
    let due = what == "outside" || (seen.hit.instance == 1 && seen.counts.shadow == 1);
    outcome.check(seen.hit.is_hit() && due && seen.color == Rgb::ZERO, || {
        Failure::text(format!(
            "{structure}, {}: light {what} near {target:?}, seen from {eye:?}: {seen:?}",
            walled.name
        ))
    });
}
