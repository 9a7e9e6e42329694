//! Rays that leave a surface: D24.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::{Case, Context, Failure, Outcome, Rays, Structure, meshes, scene_seed};
use crate::error::Result;
use crate::geometry::{Ray, TriangleMesh, shapes};
use crate::math::random::Random;
use crate::math::transform::{compose, rotation_about};
use crate::math::vector::{cross, dot, length, normalize};
use crate::measure::scenes::{self, largest, ulp};
use crate::render::surface::SurfacePoint;
use crate::scene::{Scene, Shape};

/// The cases of this file.
pub const CASES: &[Case] = &[Case {
    id: "D24",
    title: "rays that leave a surface, near and far, placed, and off slivers at grazing angles",
    bar: "none meets the surface that it leaves, clearance at most 16 ulp",
    run: spawned_rays,
}];

/// From how far surfaces are looked at, in their size.
#[derive(Clone, Copy)]
struct Distances {
    from: f64,
    to: f64,
}

fn spawned_rays(context: &Context<'_>) -> Result<Outcome> {
    let scales = [1.0, 1e-6, 1e6, 1e-3, 1e3, 0.125, 700.0];
    let scales = &scales[..context.count(3, 7) as usize];
    let each =
        |configurations: u64| Rays { quick: 1200 / configurations, full: 1_000_000 / configurations, linear: 10 };
    let (mut sum, mut scenes_asked) = (Outcome::default(), 0);
    let mut ask = |name: &str, scene: &Scene, distances: Distances, rays: Rays| -> Result<()> {
        scenes_asked += 1;
        let found =
            context.ask_all(scene, scene_seed(0xd24, scenes_asked), rays, |structure, random, _, outcome| {
                leave(structure, random, distances, name, outcome);
            })?;
        sum = std::mem::take(&mut sum).and(found);
        Ok(())
    };
    let near = Distances { from: 1.0, to: 1.0 };
    let count = scales.len() as u64;
    for &scale in scales {
        let ball = |center: DVec3, radius: f64| alone(meshes::icosphere(1, radius, center), DAffine3::IDENTITY);
        ask("at 0", &ball(DVec3::ZERO, scale), near, each(count))?;
        let away = Distances { from: 1e4, to: 1e4 };
        ask("at 0 from 1e4 away", &ball(DVec3::ZERO, scale), away, each(count))?;
        let far = DVec3::new(1e4, -1e4, 1e4) * scale;
        ask("at 1e4", &ball(far, scale), Distances { from: 10.0, to: 10.0 }, each(count))?;
        // At 1e7 f32 is whole numbers: of these a ball of radius 1000 is convex.
        ask("at 1e7", &ball(far * 1e3, 1e3 * scale), near, each(count))?;
        for number in 0..4 {
            let placed = placement(number, scale);
            ask("placed", &alone(meshes::icosphere(1, 1.0, DVec3::ZERO), placed), near, each(8 * count))?;
            let mut scene = scenes::empty();
            scenes::add_quadric(&mut scene, shapes::sphere(), placed, scenes::white());
            ask("placed", &scene, near, each(8 * count))?;
        }
    }
    let triangles = context.count(24, 480);
    let mut random = Random::new(0xd24, 1);
    for number in 0..triangles {
        let corners = sliver(&mut random, number);
        let mesh = meshes::soup([corners.map(|p| p.as_vec3())]);
        if mesh.live_count() == 1 {
            ask("slivers", &alone(mesh, DAffine3::IDENTITY), Distances { from: 1.0, to: 1e3 }, each(triangles))?;
        }
    }
    Ok(sum)
}

fn alone(mesh: TriangleMesh, transform: DAffine3) -> Scene {
    let mut scene = scenes::empty();
    scenes::add_mesh(&mut scene, mesh, transform, scenes::white());
    scene
}

/// Turned, stretched, mirrored and moved.
fn placement(number: u64, scale: f64) -> DAffine3 {
    let stretch = [DVec3::ONE, DVec3::new(1.0, 0.01, 0.5), DVec3::new(-3.0, 1.0, 0.2), DVec3::new(30.0, -30.0, -1.0)];
    let moved = [DVec3::ZERO, DVec3::new(2.0, 1.0, -1.0), DVec3::new(-100.0, 30.0, 70.0), DVec3::new(0.0, 1e3, 0.0)];
    let axis = normalize(DVec3::new(1.0, number as f64 - 1.5, 0.7)).unwrap_or(DVec3::X);
    let number = number as usize % 4;
    let turn = DAffine3 { matrix3: rotation_about(axis, 1.1), translation: moved[number] * scale };
    compose(&turn, &DAffine3::from_mat3(DMat3::from_diagonal(stretch[number] * scale)))
}

/// Triangles of every shape: any, flat, nearly flat along an axis, and slivers 11.2 long and 1e-4 rad thin.
fn sliver(random: &mut Random, number: u64) -> [DVec3; 3] {
    let size = [1.0, 1e-6, 1e-3, 1e3, 1e6][(number / 4 % 5) as usize];
    let center = random.direction() * [0.0, 1.0, 100.0, 1e4][(number / 20 % 4) as usize] * size;
    let corners = if number.is_multiple_of(2) {
        let flatten = DVec3::new(1.0, 1.0, [0.0, 1e-7, 1e-3, 1.0][(number / 2 % 4) as usize]);
        [0; 3].map(|_| random.in_cube() * flatten)
    } else {
        let along = random.direction() * 11.2;
        let across = cross(along, random.direction()) * [1e-3, 1e-4][(number / 2 % 2) as usize];
        [DVec3::ZERO, along, along * random.unit() + across]
    };
    corners.map(|corner| center + corner * size)
}

/// Looks at a random point of the scene's one object from outside, leaves it four times in random directions on that
/// side, some of them grazing, and counts those that hit anything.
fn leave(structure: &Structure, random: &mut Random, distances: Distances, name: &str, outcome: &mut Outcome) {
    let scene = structure.renderer.scene();
    let instance = &structure.renderer.world().instances[0];
    // A point of the surface, its outward normal and how large the object is, all in the world.
    let (target, outward, corners) = match instance.shape {
        Shape::Mesh(_) => {
            let mesh = &scene.meshes[0];
            let number = random.below(mesh.triangle_count() as u64) as u32;
            let corners = mesh.triangle(number).map(|p| instance.transform.point_to_world(p.as_dvec3()));
            let [a, b, c] = corners;
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let outward = cross(b - a, c - a) * if instance.transform.is_mirroring() { -1.0 } else { 1.0 };
            (a + (b - a) * u + (c - a) * v, outward, corners)
        }
        Shape::Quadric(_) => {
            let p = random.direction();
            let world = instance.transform.point_to_world(p);
            (world, instance.transform.normal_to_world(p), [world; 3])
        }
    };
    let Some(outward) = normalize(outward) else { return };
    let is_mesh = matches!(instance.shape, Shape::Mesh(_));
    let [a, b, c] = corners;
    let size = if !is_mesh {
        length(target - instance.transform.to_world().translation)
    } else {
        length(b - a).max(length(c - a)).max(length(c - b))
    };
    let mut from = random.direction();
    if dot(from, outward) < 0.0 {
        from = -from;
    }
    if random.unit() < 0.25 {
        // Grazing: down to a thousandth of a radian above the surface.
        from = normalize(from - outward * (dot(from, outward) * (1.0 - 1e-3))).unwrap_or(outward);
    }
    let distance = size * distances.from * libm::pow(distances.to / distances.from, random.unit());
    let view = scenes::view(target + from * distance, -from);
    let hit = structure.renderer.closest(&Ray::new(view.origin.as_vec3(), view.direction.as_vec3()));
    if !hit.is_hit() {
        return;
    }
    let point = SurfacePoint::of(scene, structure.renderer.world(), &view, &hit);
    let origin = point.origin_outside();
    let moved = dot(origin.as_dvec3() - point.position, point.geometric_normal);
    // The unit is that of the largest coordinate or length at hand: a triangle near zero is no better known than its size.
    let coordinate = corners.iter().fold(largest(point.position), |most, &corner| most.max(largest(corner)));
    let coordinate = coordinate.max(if is_mesh { size } else { 0.0 });
    // What the f32 test knows of a place grows with a triangle's length over its height; 1.2 for an equilateral one.
    let thinness = if !is_mesh { 1.0 } else { (size * size / (1.2 * length(cross(b - a, c - a)))).max(1.0) };
    outcome.figure(format!("{name}: largest clearance, ulp"), moved / (ulp(coordinate) * thinness), Some(16.0));
    for _ in 0..4 {
        let mut leaving = random.direction();
        let height = dot(leaving, point.geometric_normal);
        leaving -= point.geometric_normal * (if height < 0.0 { 2.0 * height } else { 0.0 });
        if random.unit() < 0.25 {
            let height = dot(leaving, point.geometric_normal);
            leaving -= point.geometric_normal * (height * (1.0 - 1e-4));
        }
        // What t_min the renderer gives to rays that leave a surface.
        let ray = Ray { t_min: f32::MIN_POSITIVE, ..Ray::new(origin, leaving.as_vec3()) };
        let answer = structure.ask(&ray);
        // From farther away than f32 can tell front from back, the far side may be what is met: the ray then leaves into
        // the object and meets it elsewhere.
        let right = answer.is_miss() || (!point.from_outside && is_mesh && answer.hit.primitive != hit.primitive);
        outcome.check(right, || Failure {
            ray: Some(ray),
            triangle: is_mesh.then(|| corners.map(|p: DVec3| Vec3::new(p.x as f32, p.y as f32, p.z as f32))),
            what: format!("{structure}, {name}: {answer} for a ray that leaves {:?}", point.position),
        });
    }
}
