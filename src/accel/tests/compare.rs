//! Asks every structure and preset the same and compares with `linear`, bit for bit.

use std::sync::Arc;

use glam::Vec3;

use super::meshes::Random;
use crate::accel::{Counting, Kind, Linear, Params, Preset, Tests, TreeStats, TriangleAccelerator, dispatch_kind};
use crate::geometry::ray::Interval;
use crate::geometry::{Hit, Key, PreparedRay, Ray, TriangleMesh};
use crate::math::random::hash2;
use crate::progress::Silent;

/// Rays at, past and along a mesh: towards corners, edge points and inner points from outside, inside and on it, with
/// raw and axis-parallel directions.
pub fn rays_at(mesh: &Arc<TriangleMesh>, random: &mut Random, count: usize) -> Vec<Ray> {
    let bounds = mesh.bounds();
    let (center, size) = (bounds.center().as_vec3(), bounds.size().as_vec3().max_element().max(1e-30));
    let live: Vec<u32> = mesh.live_triangles().collect();
    let pick = |random: &mut Random| {
        let [a, b, c] = mesh.triangle(live[random.below(live.len())]);
        let (u, v) = (random.unit(), random.unit());
        match random.below(4) {
            0 => a,
            1 => a + (b - a) * u,
            2 => a + (c - a) * 0.5,
            _ => a + (b - a) * (u * (1.0 - v)) + (c - a) * (v * (1.0 - u)),
        }
    };
    (0..count)
        .map(|number| {
            let target = pick(random);
            let origin = match random.below(3) {
                0 => center + random.vector() * size,
                1 => center + random.vector() * size * 0.1,
                _ => pick(random),
            };
            let direction = match number % 4 {
                0 => random.vector() * size,
                1 => {
                    let zero = if random.below(2) == 0 { 0.0 } else { -0.0 };
                    let mut along = Vec3::splat(zero);
                    along[random.below(3)] = if random.below(2) == 0 { 1.0 } else { -2.5 };
                    return Ray::new(target - along * size * random.unit(), along);
                }
                _ => target - origin,
            };
            let mut ray = Ray::new(origin, direction);
            if number % 5 == 0 {
                ray.t_min = random.unit();
                ray.t_max = ray.t_min + random.unit();
            }
            ray
        })
        .collect()
}

/// The rays that can meet anything, some of them as rays local to an instance with a clip interval.
pub fn prepare(rays: &[Ray], random: &mut Random) -> Vec<PreparedRay> {
    let mut prepared: Vec<_> = rays.iter().filter_map(PreparedRay::new).collect();
    for number in (0..prepared.len()).step_by(3) {
        let ray = prepared[number];
        let (a, b) = (random.unit() * 1.5 - 0.25, random.unit());
        let clip = match random.below(6) {
            0 => Interval { near: a, far: a },
            1 => Interval { near: 0.0, far: b },
            2 => Interval { near: f32::NEG_INFINITY, far: b },
            3 => Interval { near: a, far: f32::INFINITY },
            4 => Interval { near: ray.t_min, far: ray.t_min + b },
            _ => Interval { near: a, far: a + b },
        };
        prepared[number] = PreparedRay::local(ray.origin.into(), ray.direction.into(), &ray, clip).unwrap();
    }
    prepared
}

/// Everything a structure says about one ray: the closest hit, whether there is one, and all hits in order.
#[derive(Debug, Clone, PartialEq)]
struct Answer {
    closest: [u8; size_of::<Hit>()],
    occluded: bool,
    walk: Vec<[u8; size_of::<Hit>()]>,
}

const INSTANCE: u32 = 7;

fn answer<A: Counting>(accelerator: &A, ray: &PreparedRay) -> Answer {
    let mut closest = Hit::MISS;
    accelerator.closest(ray, INSTANCE, &mut closest);
    let mut walk = Vec::new();
    let mut key = Key::BEFORE_ALL;
    loop {
        let mut next = Hit::MISS;
        accelerator.next_after(ray, INSTANCE, key, &mut next);
        if !next.is_hit() {
            break;
        }
        assert!(key.is_before(&next.key()), "{key:?} {next:?}");
        key = next.key();
        walk.push(bytemuck::cast(next));
    }
    let occluded = accelerator.occluded(ray);
    check_counts(accelerator, ray, &closest, occluded);
    Answer { closest: bytemuck::cast(closest), occluded, walk }
}

/// Searches that count must come to the same, and count what they need to get there.
fn check_counts<A: Counting>(accelerator: &A, ray: &PreparedRay, closest: &Hit, occluded: bool) {
    let mut counted = [(Hit::MISS, Tests::default()); 2];
    for (any, (hit, tests)) in counted.iter_mut().enumerate() {
        accelerator.count(ray, any == 1, hit, tests);
    }
    let [(first, all), (some, few)] = counted;
    let expected = if closest.is_hit() { Hit { instance: 0, ..*closest } } else { *closest };
    assert_eq!((first, some.is_hit()), (expected, occluded), "{} {ray:?} counted", A::NAME);
    let stats = accelerator.stats();
    assert!(all.triangles.max(few.triangles) <= stats.triangles, "{}: {all:?} {few:?}", A::NAME);
    assert!(!occluded || all.triangles.min(few.triangles) > 0, "{}: {all:?} {few:?}", A::NAME);
    assert!(stats.nodes < 2 || all.boxes.min(few.boxes) > 0, "{}: {all:?} {few:?}", A::NAME);
    // Without a hit nothing is culled but by the ray's own ends.
    assert!(occluded || all == few, "{}: {all:?} {few:?}", A::NAME);
}

fn answers<A: Counting>(mesh: &Arc<TriangleMesh>, preset: Preset, rays: &[PreparedRay]) -> (Vec<Answer>, TreeStats) {
    let params = Params { preset, ..Params::default() };
    let accelerator = A::build(mesh, &params, &Silent).unwrap();
    accelerator.validate().unwrap_or_else(|violation| panic!("{} {preset:?}: {violation}", A::NAME));
    assert_eq!(accelerator.bounds(), mesh.hit_bounds(), "{}", A::NAME);
    assert_eq!(accelerator.stats().triangles, mesh.live_count() as u64, "{}", A::NAME);
    let answers: Vec<Answer> = rays.iter().map(|ray| answer(&accelerator, ray)).collect();
    check_batches(&accelerator, rays, &answers);
    (answers, accelerator.stats())
}

/// Batches must give what single rays do, from nothing and from what is known already.
fn check_batches<A: TriangleAccelerator>(accelerator: &A, rays: &[PreparedRay], answers: &[Answer]) {
    let clips: Vec<Interval> = rays.iter().map(|ray| ray.clip).collect();
    let rays: Vec<Ray> = rays
        .iter()
        .map(|ray| Ray {
            origin: ray.origin.into(),
            t_min: ray.t_min,
            direction: ray.direction.into(),
            t_max: ray.t_max,
        })
        .collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    accelerator.closest_batch(&rays, &clips, INSTANCE, &mut hits);
    // A flag that is set stays so.
    let mut occluded: Vec<bool> = (0..rays.len()).map(|number| number % 7 == 0).collect();
    accelerator.occluded_batch(&rays, &clips, &mut occluded);
    for (number, ((ray, answer), (hit, occluded))) in
        rays.iter().zip(answers).zip(hits.iter().zip(occluded)).enumerate()
    {
        assert_eq!(bytemuck::bytes_of(hit), answer.closest, "{} {ray:?} in a batch", A::NAME);
        assert_eq!(occluded, answer.occluded || number % 7 == 0, "{} {ray:?} in a batch", A::NAME);
    }
    let mut again = hits.clone();
    accelerator.closest_batch(&rays, &clips, INSTANCE + 1, &mut again);
    assert_eq!(again, hits, "{}: ties go to the first instance", A::NAME);
    accelerator.closest_batch(&rays, &clips, INSTANCE - 1, &mut again);
    for (hit, again) in hits.iter().zip(&again) {
        let expected = if hit.is_hit() { Hit { instance: INSTANCE - 1, ..*hit } } else { *hit };
        assert_eq!(bytemuck::bytes_of(again), bytemuck::bytes_of(&expected), "{}", A::NAME);
    }
}

/// Compares all structures and presets with `linear`; returns how many rays hit.
pub fn compare(name: &str, mesh: &Arc<TriangleMesh>, rays: &[PreparedRay]) -> usize {
    let (expected, _) = answers::<Linear>(mesh, Preset::Balanced, rays);
    for &kind in &Kind::ALL[1..] {
        for &preset in Preset::ALL {
            let (found, _) = dispatch_kind!(kind, A => answers::<A>(mesh, preset, rays));
            for ((ray, expected), found) in rays.iter().zip(&expected).zip(&found) {
                assert_eq!(found, expected, "{name}, {} {preset:?}, {ray:?}", kind.name());
            }
        }
    }
    for Answer { closest, occluded, walk } in &expected {
        assert_eq!(!walk.is_empty(), *occluded);
        assert_eq!(walk.first().unwrap_or(bytemuck::bytes_of(&Hit::MISS).try_into().unwrap()), closest);
    }
    expected.iter().filter(|answer| answer.occluded).count()
}

/// Compares on rays made for the mesh; at least a quarter must hit for the test to mean anything.
pub fn compare_on_hard_rays(name: &str, mesh: &Arc<TriangleMesh>, count: usize) {
    let mut random = Random::new(hash2(count as u32, mesh.indices.len() as u32));
    let rays = prepare(&rays_at(mesh, &mut random, count), &mut random);
    let hits = compare(name, mesh, &rays);
    assert!(4 * hits >= rays.len(), "{name}: only {hits} of {} rays hit", rays.len());
}
