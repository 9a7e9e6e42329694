//! Every structure and preset against `linear`, bit for bit, on ordinary and on hard rays.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use glam::Vec3;

use super::{BoxTree, Kind, Params, Preset, TreeStats, TriangleAccelerator, dispatch_kind};
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, Hit, Key, PreparedRay, Ray, TriangleMesh};
use crate::math::random::{hash2, unit};
use crate::progress::{Progress, Silent};

/// A repeatable sequence of numbers.
struct Random(u32, u32);

impl Random {
    fn new(seed: u32) -> Self {
        Self(seed, 0)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.1 += 1;
        (unit(hash2(self.1, self.0)) as f32).min(1f32.next_down())
    }

    fn below(&mut self, end: usize) -> usize {
        (f64::from(self.unit()) * end as f64) as usize
    }

    /// Components in [-1, 1).
    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

fn mesh(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> TriangleMesh {
    TriangleMesh { positions, indices, ..TriangleMesh::default() }.finish().unwrap()
}

/// Triangles that share nothing.
fn soup(triangles: &[[Vec3; 3]]) -> TriangleMesh {
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(triangles.concat(), indices)
}

fn random_soup(random: &mut Random, count: usize, size: f32) -> TriangleMesh {
    let triangle = |random: &mut Random| {
        let center = random.vector();
        [(); 3].map(|()| center + random.vector() * size)
    };
    soup(&(0..count).map(|_| triangle(random)).collect::<Vec<_>>())
}

/// A closed sphere of `rows` by `columns` quadrilaterals, radius 2, around the origin.
fn sphere(rows: u32, columns: u32) -> TriangleMesh {
    let mut positions = vec![Vec3::new(0.0, 0.0, 2.0)];
    for row in 1..rows {
        let polar = std::f64::consts::PI * f64::from(row) / f64::from(rows);
        for column in 0..columns {
            let azimuth = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let (x, y) = (polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin());
            positions.push(Vec3::new(2.0 * x as f32, 2.0 * y as f32, 2.0 * polar.cos() as f32));
        }
    }
    positions.push(Vec3::new(0.0, 0.0, -2.0));
    let last = positions.len() as u32 - 1;
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == rows => last,
        row => 1 + (row - 1) * columns + column % columns,
    };
    let mut indices = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            indices.extend([[a, c, d], [a, d, b]].into_iter().filter(|[i, j, k]| i != j && j != k && i != k));
        }
    }
    mesh(positions, indices)
}

/// An axis-flat grid of unit squares around the origin in the plane where coordinate `axis` is `height`.
fn grid(cells: u32, axis: usize, height: f32) -> TriangleMesh {
    let side = cells + 1;
    let point = |i: u32| {
        let (x, y) = ((i % side) as f32 - cells as f32 / 2.0, (i / side) as f32 - cells as f32 / 2.0);
        let mut p = Vec3::splat(height);
        p[(axis + 1) % 3] = x;
        p[(axis + 2) % 3] = y;
        p
    };
    let corner = |x: u32, y: u32| y * side + x;
    let cell = |x: u32, y: u32| {
        let (a, b, c, d) = (corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1));
        [[a, b, d], [a, d, c]]
    };
    mesh((0..side * side).map(point).collect(), (0..cells * cells).flat_map(|i| cell(i % cells, i / cells)).collect())
}

fn transformed(mesh: &TriangleMesh, scale: f32, shift: Vec3) -> TriangleMesh {
    let positions = mesh.positions.iter().map(|&p| p * scale + shift).collect();
    TriangleMesh { positions, ..mesh.clone() }.finish().unwrap()
}

/// Rays at, past and along a mesh: towards corners, edge points and inner points from outside, inside and on it, with
/// raw and axis-parallel directions.
fn rays_at(mesh: &TriangleMesh, random: &mut Random, count: usize) -> Vec<Ray> {
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
fn prepare(rays: &[Ray], random: &mut Random) -> Vec<PreparedRay> {
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
        prepared[number] = PreparedRay::local(ray.origin, ray.direction, &ray, clip).unwrap();
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

fn answer<A: TriangleAccelerator>(accelerator: &A, ray: &PreparedRay) -> Answer {
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
    Answer { closest: bytemuck::cast(closest), occluded: accelerator.occluded(ray), walk }
}

fn answers<A: TriangleAccelerator>(
    mesh: &TriangleMesh,
    preset: Preset,
    rays: &[PreparedRay],
) -> (Vec<Answer>, TreeStats) {
    let params = Params { preset, ..Params::default() };
    let accelerator = A::build(mesh, &params, &Silent).unwrap();
    accelerator.validate().unwrap_or_else(|violation| panic!("{} {preset:?}: {violation}", A::NAME));
    assert_eq!(accelerator.bounds(), mesh.bounds(), "{}", A::NAME);
    assert_eq!(accelerator.stats().triangles, mesh.live_count() as u64, "{}", A::NAME);
    (rays.iter().map(|ray| answer(&accelerator, ray)).collect(), accelerator.stats())
}

/// Compares all structures and presets with `linear`; returns how many rays hit.
fn compare(name: &str, mesh: &TriangleMesh, rays: &[PreparedRay]) -> usize {
    let (expected, _) = answers::<super::Linear>(mesh, Preset::Balanced, rays);
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
fn compare_on_hard_rays(name: &str, mesh: &TriangleMesh, count: usize) {
    let mut random = Random::new(hash2(count as u32, mesh.indices.len() as u32));
    let rays = prepare(&rays_at(mesh, &mut random, count), &mut random);
    let hits = compare(name, mesh, &rays);
    assert!(4 * hits >= rays.len(), "{name}: only {hits} of {} rays hit", rays.len());
}

#[test]
fn random_soups_of_all_sizes() {
    let mut random = Random::new(1);
    for count in [1, 2, 3, 4, 5, 8, 9, 17, 40, 400] {
        let soup = random_soup(&mut random, count, 0.4);
        compare_on_hard_rays(&format!("soup of {count}"), &soup, 200);
    }
}

#[test]
fn scales_and_places_far_from_the_origin() {
    let soup = random_soup(&mut Random::new(2), 150, 0.4);
    for scale in [1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e11] {
        compare_on_hard_rays(&format!("scale {scale}"), &transformed(&soup, scale, Vec3::ZERO), 150);
    }
    let ball = sphere(8, 12);
    for shift in [Vec3::new(1e4, -3e4, 2e4), Vec3::new(148_376.0, 1234.0, -223_423.0), Vec3::splat(3e6)] {
        compare_on_hard_rays(&format!("sphere at {shift}"), &transformed(&ball, 1.0, shift), 300);
    }
}

#[test]
fn axis_flat_grids() {
    for axis in 0..3 {
        for height in [0.0, 0.1, -1000.1] {
            compare_on_hard_rays(&format!("grid {axis} at {height}"), &grid(12, axis, height), 200);
        }
    }
}

#[test]
fn slivers() {
    let mut random = Random::new(3);
    let sliver = |random: &mut Random| {
        let (a, along) = (random.vector(), random.vector());
        [a, a + along, a + along * random.unit() + random.vector() * 1e-4]
    };
    let slivers: Vec<_> = (0..200).map(|_| sliver(&mut random)).collect();
    compare_on_hard_rays("slivers", &soup(&slivers), 400);
}

#[test]
fn one_huge_triangle_among_tiny_ones() {
    let mut random = Random::new(4);
    let mut triangles: Vec<_> = (0..200).map(|_| [(); 3].map(|()| random.vector() * 1e-3)).collect();
    triangles.push([Vec3::new(-1e8, -1e8, 0.0), Vec3::new(1e8, -1e8, 0.0), Vec3::new(0.0, 1e8, 0.0)]);
    let soup = soup(&triangles);
    let mut rays = rays_at(&soup, &mut random, 200);
    rays.extend((0..200).map(|_| Ray::new(random.vector(), random.vector())));
    assert!(compare("huge among tiny", &soup, &prepare(&rays, &mut random)) > 50);
}

/// A ray whose interval ends exactly at a hit, or just before or after it.
#[test]
fn interval_ends_at_exact_hit_distances() {
    let mut random = Random::new(5);
    let soup = random_soup(&mut random, 100, 0.6);
    let linear = super::Linear::build(&soup, &Params::default(), &Silent).unwrap();
    let mut rays = Vec::new();
    for ray in rays_at(&soup, &mut random, 200) {
        let Some(prepared) = PreparedRay::new(&ray) else { continue };
        let mut hit = Hit::MISS;
        linear.closest(&prepared, 0, &mut hit);
        if hit.is_hit() {
            for t in [hit.t.next_down(), hit.t, hit.t.next_up()] {
                rays.extend([
                    Ray { t_min: t, t_max: f32::INFINITY, ..ray },
                    Ray { t_max: t, ..ray },
                    Ray { t_min: t, t_max: t, ..ray },
                ]);
            }
        }
    }
    let rays: Vec<_> = rays.iter().filter_map(PreparedRay::new).collect();
    assert!(compare("interval ends", &soup, &rays) > rays.len() / 4);
}

/// A better hit that is known already must survive, and ties go by instance.
#[test]
fn hits_that_are_known_already() {
    let mut random = Random::new(6);
    let soup = random_soup(&mut random, 100, 0.6);
    let rays: Vec<_> = rays_at(&soup, &mut random, 300).iter().filter_map(PreparedRay::new).collect();
    let mut first = vec![Hit::MISS; rays.len()];
    let linear = super::Linear::build(&soup, &Params::default(), &Silent).unwrap();
    linear.closest_batch(&rays, 5, &mut first);
    for &kind in Kind::ALL {
        for (instance, expected) in [(4, 4), (6, 5)] {
            let mut best = first.clone();
            dispatch_kind!(kind, A => {
                A::build(&soup, &Params::default(), &Silent).unwrap().closest_batch(&rays, instance, &mut best);
            });
            for (best, first) in best.iter().zip(&first) {
                let expected = if first.is_hit() { Hit { instance: expected, ..*first } } else { Hit::MISS };
                assert_eq!(best, &expected, "{}", kind.name());
            }
        }
    }
}

/// The 48 by 96 sphere whose vertices and edges other tracers leak through: nothing may get out.
#[test]
fn a_closed_sphere_has_no_leaks() {
    const RAYS: usize = 120_000;
    let ball = sphere(48, 96);
    let mut random = Random::new(7);
    let rays: Vec<Ray> = (0..RAYS)
        .map(|number| {
            let origin = random.vector();
            let [a, b, _] = ball.triangle(random.below(ball.indices.len()) as u32);
            let target = if number % 2 == 0 { a } else { a + (b - a) * random.unit() };
            let direction = target - origin;
            Ray::new(origin, if number % 4 < 2 { direction } else { direction.normalize() })
        })
        .collect();
    let prepared: Vec<_> = rays.iter().map(|ray| PreparedRay::new(ray).unwrap()).collect();
    let mut hits = Vec::new();
    for &kind in &Kind::ALL[1..] {
        dispatch_kind!(kind, A => {
            let accelerator = A::build(&ball, &Params::default(), &Silent).unwrap();
            let mut best = vec![Hit::MISS; RAYS];
            accelerator.closest_batch(&prepared, 0, &mut best);
            let mut occluded = vec![false; RAYS];
            accelerator.occluded_batch(&prepared, &mut occluded);
            let missed = best.iter().filter(|hit| !hit.is_hit()).count();
            let free = occluded.iter().filter(|occluded| !**occluded).count();
            assert_eq!((missed, free), (0, 0), "{}", kind.name());
            hits.push(best);
        });
    }
    assert!(hits.windows(2).all(|pair| pair[0] == pair[1]));
    compare("sphere", &ball, &prepared[..300]);
}

/// Builds, and fails where that takes unreasonably long or the tree is unreasonably deep.
fn build_in_time<A: TriangleAccelerator>(name: &str, mesh: &TriangleMesh, preset: Preset) -> A {
    let start = Instant::now();
    let accelerator = A::build(mesh, &Params { preset, ..Params::default() }, &Silent).unwrap();
    let (took, stats) = (start.elapsed(), accelerator.stats());
    eprintln!("{name} {} {preset:?} {took:?} {stats:?}", A::NAME);
    assert!(took < Duration::from_secs(10), "{name}, {} {preset:?}: {took:?}", A::NAME);
    assert!(stats.max_depth <= 1000, "{name}, {} {preset:?}: {stats:?}", A::NAME);
    accelerator.validate().unwrap();
    accelerator
}

/// What makes builders that merge neighbours slow and deep: boxes that coincide, share their centre, or tie in a row.
#[test]
fn coincident_and_regular_triangles_build_quickly() {
    const COUNT: usize = 10_000;
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0)];
    let identical = soup(&vec![triangle; COUNT]);
    let shell = |i: usize| {
        let size = 1.001f32.powi(i as i32);
        [Vec3::new(-size, -size, 0.0), Vec3::new(size, -size, 0.0), Vec3::new(size, size, 0.0)]
    };
    let nested = soup(&(0..COUNT).map(shell).collect::<Vec<_>>());
    let strip = soup(&(0..COUNT).map(|i| triangle.map(|p| p + Vec3::X * i as f32)).collect::<Vec<_>>());
    let ray = PreparedRay::new(&Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z)).unwrap();
    for &kind in &Kind::ALL[1..] {
        for &preset in Preset::ALL {
            dispatch_kind!(kind, A => {
                build_in_time::<A>("nested", &nested, preset);
                build_in_time::<A>("strip", &strip, preset);
                let accelerator: A = build_in_time("identical", &identical, preset);
                let mut best = Hit::MISS;
                accelerator.closest(&ray, 0, &mut best);
                assert_eq!((best.t, best.primitive), (1.0, 0));
                let mut next = Hit::MISS;
                accelerator.next_after(&ray, 0, best.key(), &mut next);
                assert_eq!((next.t, next.primitive), (1.0, 1));
            });
        }
    }
}

#[test]
fn meshes_without_live_triangles() {
    let flat = soup(&[[Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::splat(f32::NAN); 3]]);
    let rays: Vec<_> =
        (0..20).filter_map(|i| PreparedRay::new(&Ray::new(Vec3::ZERO, Random::new(i).vector()))).collect();
    for empty in [TriangleMesh::default(), flat] {
        assert_eq!(compare("empty", &empty, &rays), 0);
    }
}

#[test]
fn dropped_triangles_do_not_shift_numbers() {
    let mut random = Random::new(8);
    let mut soup = random_soup(&mut random, 60, 0.5);
    for number in [0, 7, 8, 59] {
        soup.indices[number][1] = soup.indices[number][0];
    }
    let soup = soup.finish().unwrap();
    assert_eq!(soup.live_count(), 56);
    compare_on_hard_rays("dropped", &soup, 300);
}

#[test]
fn cancelled_builds_stop() {
    struct Cancelled;
    impl Progress for Cancelled {
        fn is_cancelled(&self) -> bool {
            true
        }
    }
    for &kind in Kind::ALL {
        dispatch_kind!(kind, A => assert!(A::build(&sphere(4, 4), &Params::default(), &Cancelled).is_err()));
    }
}

/// The boxes that a ray crosses, and the first of them: against a loop over all boxes.
#[test]
fn box_trees_visit_the_boxes_that_rays_cross() {
    let mut random = Random::new(9);
    for count in [0, 1, 2, 3, 100] {
        let boxes: Vec<Bounds> = (0..count)
            .map(|number| {
                let center = random.vector();
                let corners = [(); 2].map(|()| center + random.vector() * 0.2);
                if number % 7 == 3 { Bounds::EMPTY } else { Bounds::of(corners) }
            })
            .collect();
        for &preset in Preset::ALL {
            let tree = BoxTree::build(&boxes, &Params { preset, ..Params::default() });
            tree.validate(&boxes).unwrap();
            assert_eq!(tree.bounds(), boxes.iter().fold(Bounds::EMPTY, |total, &bounds| total.union(bounds)));
            for _ in 0..300 {
                let ray = PreparedRay::new(&Ray::new(random.vector() * 2.0, random.vector())).unwrap();
                let entry = |bounds: &Bounds| bounds.interval(&ray, 0.0, f32::INFINITY);
                let expected: Vec<u32> =
                    (0..count).filter(|&number| !entry(&boxes[number as usize]).is_empty()).collect();
                let mut visited = Vec::new();
                let mut nearest = f32::INFINITY;
                let _ = tree.traverse(&ray, 0.0, f32::INFINITY, |number| {
                    visited.push(number);
                    ControlFlow::Continue(f32::INFINITY)
                });
                let _ = tree.traverse(&ray, 0.0, f32::INFINITY, |number| {
                    nearest = nearest.min(entry(&boxes[number as usize]).near);
                    ControlFlow::Continue(nearest)
                });
                visited.sort_unstable();
                assert_eq!(visited, expected);
                let first = boxes.iter().map(&entry).filter(|interval| !interval.is_empty());
                assert_eq!(nearest, first.fold(f32::INFINITY, |nearest, interval| nearest.min(interval.near)));
                let stopped = tree.traverse(&ray, 0.0, f32::INFINITY, |_| ControlFlow::Break(()));
                assert_eq!(stopped.is_break(), !expected.is_empty());
            }
        }
    }
}

#[test]
fn huge_boxes_and_coincident_boxes_make_shallow_trees() {
    let huge = Bounds { min: Vec3::splat(-1e30), max: Vec3::splat(1e30) };
    let unit = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    let boxes = [vec![huge; 500], vec![unit; 500], vec![Bounds::of([Vec3::splat(f32::MAX)]); 5]].concat();
    let tree = BoxTree::build(&boxes, &Params::default());
    tree.validate(&boxes).unwrap();
    assert!(tree.stats().max_depth <= 128, "{:?}", tree.stats());
}

#[test]
fn kinds_have_their_names() {
    for &kind in Kind::ALL {
        assert_eq!(dispatch_kind!(kind, A => A::NAME), kind.name());
        assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
    }
    assert!(Kind::ALL.contains(&Kind::Auto.resolve()));
}
