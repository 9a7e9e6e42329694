//! One answer, however it is asked for: D16, D17.

use bytemuck::cast_slice;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::meshes;
use super::{Case, Context, Failure, Outcome, Rays, Structure};
use crate::error::{Error, Result};
use crate::geometry::{Hit, Quadric, Ray, shapes};
use crate::math::random::Random;
use crate::render::{Crop, RenderSettings};
use crate::scene::{
    Background, Camera, Falloff, Light, LightKind, Material, NamedCamera, Object, Projection, Rgb, Scene, Shape,
};

/// The cases of this file.
pub const CASES: &[Case] = &[
    Case {
        id: "D16",
        title: "threads, tiles and rebuilds",
        bar: "hits and pictures are the same bytes",
        run: same_bytes,
    },
    Case {
        id: "D17",
        title: "any hit is reported exactly where there is a closest one",
        bar: "0 disagreements in 1e7",
        run: any_and_closest,
    },
];

/// Meshes and quadrics in the way of each other: turned, stretched, mirrored, twice in one place, one without end.
fn mixed_scene() -> Scene {
    let mut scene = meshes::scene(vec![
        meshes::icosphere(2, 1.0, DVec3::ZERO),
        meshes::cube(),
        meshes::grid(8),
        meshes::sphere(8, 16, 0.7, DVec3::new(0.4, 0.0, 0.2)),
    ]);
    scene.materials = vec![
        Material::default(),
        Material { kr: Rgb::splat(0.4), ..Material::default() },
        Material { kt: Rgb::splat(0.5), kr: Rgb::splat(0.1), ior: 1.5, ..Material::default() },
    ];
    let turn = |angle: f64, scale: DVec3, at: DVec3| {
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        let columns = [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z];
        let [x, y, z] = columns;
        DAffine3 { matrix3: DMat3::from_cols(x * scale.x, y * scale.y, z * scale.z), translation: at }
    };
    let mut place = |shape: Shape, transform: DAffine3, material: u32| {
        scene.objects.push(Object { name: String::new(), shape, transform, material: Some(material) });
    };
    let moved = turn(0.0, DVec3::ONE, DVec3::new(1.5, 0.25, 0.0));
    place(Shape::Mesh(1), moved, 0);
    place(Shape::Mesh(1), moved, 0);
    place(Shape::Mesh(1), turn(0.7, DVec3::new(1.0, 1e-2, 2.0), DVec3::new(-1.0, 0.5, 0.3)), 1);
    place(Shape::Mesh(3), turn(2.0, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(0.0, -0.5, 0.5)), 2);
    let quadrics: [(Quadric, DAffine3, u32); 5] = [
        (shapes::sphere(), turn(0.0, DVec3::ONE, DVec3::new(0.0, 1.2, 0.0)), 2),
        (shapes::cone(false), turn(0.5, DVec3::new(0.5, 1.0, 0.7), DVec3::new(-0.6, -0.4, 0.9)), 0),
        (shapes::hyperboloid_one_sheet(-1.0, 1.0, false), turn(1.0, DVec3::splat(0.3), DVec3::new(1.0, -0.8, 0.4)), 1),
        (shapes::cylinder(true), turn(-0.3, DVec3::splat(0.4), DVec3::new(-1.2, -0.2, -0.8)), 0),
        (shapes::plane(None), turn(0.0, DVec3::ONE, DVec3::new(0.0, -1.0, 0.0)), 0),
    ];
    for (number, (quadric, transform, material)) in (0..).zip(quadrics) {
        place(Shape::Quadric(number), transform, material);
        scene.quadrics.push(quadric);
    }
    scene
}

/// Rays of all kinds in that scene: anywhere, on a lattice along its lines, within the plane, and with every kind of
/// interval.
fn any_ray(random: &mut Random) -> Ray {
    let (mut origin, mut direction) = ((random.in_cube() * 3.0).as_vec3(), random.direction().as_vec3());
    match random.below(4) {
        0 => {
            let whole = |random: &mut Random| random.below(3) as f32 - 1.0;
            origin = Vec3::new(whole(random), whole(random), whole(random)) * 0.5 + Vec3::new(0.0, 0.25, 0.0);
            direction = Vec3::new(whole(random), whole(random), whole(random));
        }
        1 => direction = (random.in_cube() * 2.0).as_vec3() - origin,
        _ => {}
    }
    let ray = Ray::new(origin, direction);
    match random.below(4) {
        0 => Ray { t_min: random.between(-1.0, 2.0) as f32, ..ray },
        1 => Ray { t_max: random.between(0.0, 4.0) as f32, ..ray },
        2 => Ray { t_min: random.between(0.0, 2.0) as f32, t_max: random.between(0.0, 4.0) as f32, ..ray },
        _ => ray,
    }
}

/// Every structure against the first of them: buffers of hits from 1 to 8 threads in pieces of many sizes, and
/// pictures as a whole and in tiles.
fn same_bytes(context: &Context<'_>) -> Result<Outcome> {
    let mut scene = mixed_scene();
    look_at(&mut scene, context.count(24, 160) as u32);
    let mut random = Random::new(context.seed, 0xd16);
    let rays: Vec<Ray> = (0..context.count(1_000, 200_000)).map(|_| any_ray(&mut random)).collect();
    let mut sum = Outcome::default();
    let mut expected: Option<(Vec<Hit>, Vec<[f32; 3]>)> = None;
    for params in context.params() {
        for threads in [1, 2, 3, 8] {
            context.progress.check()?;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|error| Error::limit(format!("{threads} threads cannot be started: {error}")))?;
            // Built anew for each number of threads, by as many.
            let structure = pool.install(|| Structure::build(&scene, params, context.progress))?;
            let mut hits = vec![Hit::MISS; rays.len()];
            let piece = [rays.len(), 7, 64, 1000][threads % 4];
            pool.install(|| {
                let pieces = rays.par_chunks(piece).zip(hits.par_chunks_mut(piece));
                pieces.for_each(|(rays, hits)| structure.renderer.closest_batch(rays, hits));
            });
            let settings = RenderSettings { threads, ..RenderSettings::default() };
            let film = structure.renderer.render(&settings, context.progress)?;
            let (hits_before, film_before) = expected.get_or_insert_with(|| (hits.clone(), film.color.clone()));
            sum.check(cast_slice::<_, u8>(hits_before) == cast_slice::<_, u8>(&hits), || {
                Failure::text(format!("{structure}, {threads} threads: the hits of {} rays differ", rays.len()))
            });
            sum.check(cast_slice::<_, u8>(film_before) == cast_slice::<_, u8>(&film.color), || {
                Failure::text(format!("{structure}, {threads} threads: the picture differs"))
            });
            let (width, height) = (scene.film.width, scene.film.height);
            let crop = Crop { x0: width / 3, y0: height / 5, x1: width - 3, y1: height - 2 };
            let tile = structure.renderer.render(&RenderSettings { crop: Some(crop), ..settings }, context.progress)?;
            let rows = (crop.y0..crop.y1)
                .flat_map(|y| film_before[(y * width + crop.x0) as usize..(y * width + crop.x1) as usize].iter());
            sum.check(rows.eq(tile.color.iter()), || {
                Failure::text(format!("{structure}, {threads} threads: a tile differs from its part of the picture"))
            });
        }
    }
    Ok(sum)
}

/// A camera, two lights and a background.
fn look_at(scene: &mut Scene, width: u32) {
    let (eye, target) = (DVec3::new(2.0, 1.5, 5.0), DVec3::ZERO);
    let camera = Camera::LookAt { eye, target, up: DVec3::Y, projection: Projection::Perspective { fov_y: 0.8 } };
    scene.cameras = vec![NamedCamera::new("case", camera)];
    scene.background = Background::Gradient { bottom: Rgb::ZERO, top: Rgb::ONE, up: DVec3::Y };
    for (position, color) in [(DVec3::new(3.0, 5.0, 4.0), Rgb::ONE), (DVec3::new(-4.0, 2.0, 1.0), Rgb::splat(0.5))] {
        let kind = LightKind::Point { position, falloff: Falloff::None };
        scene.lights.push(Light { name: "light".into(), kind, color });
    }
    (scene.film.width, scene.film.height, scene.film.samples) = (width, width * 3 / 4, 2);
}

/// The scene's own rays, and rays whose interval ends at, or an ulp beside, what they hit.
fn any_and_closest(context: &Context<'_>) -> Result<Outcome> {
    let scene = mixed_scene();
    let rays = Rays { quick: 12_000, full: 10_000_000, linear: 10 };
    context.ask_all(&scene, 0xd17, rays, |structure, random, number, outcome| {
        let mut ray = any_ray(random);
        let mut answer = structure.ask(&ray);
        if number % 3 == 0 && answer.hit.is_hit() {
            let t = answer.hit.t;
            match number / 3 % 4 {
                0 => ray.t_max = t,
                1 => ray.t_max = t.next_down(),
                2 => ray.t_min = t,
                _ => ray.t_min = t.next_up(),
            }
            answer = structure.ask(&ray);
        }
        let agree = answer.hit.is_hit() == answer.occluded;
        outcome.check(agree, || Failure::of_ray(&ray, format!("{structure}: {answer}")));
    })
}
