//! Instruction sets against each other, leaves and nodes of all sizes, and degenerate trees.

use std::sync::Arc;

use glam::Vec3;

use super::collapse::Collapse;
use super::leaf::GrowingLeaves;
use super::*;
use crate::accel::leaf::LeafTriangle;
use crate::accel::topology::Topology;
use crate::accel::{Bvh2, Kind, Linear};
use crate::geometry::Ray;
use crate::geometry::triangle::hit_bounds;
use crate::math::random::Random;
use crate::math::simd::Level;
use crate::progress::Silent;

fn soup(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Arc<TriangleMesh> {
    let positions: Vec<Vec3> = triangles.into_iter().flatten().collect();
    let indices = (0..positions.len() as u32 / 3).map(|n| [3 * n, 3 * n + 1, 3 * n + 2]).collect();
    TriangleMesh { positions: positions.into(), indices, ..TriangleMesh::default() }.finish().unwrap().into()
}

fn confetti(count: usize, size: f64, random: &mut Random) -> Arc<TriangleMesh> {
    soup((0..count).map(|_| {
        let center = random.in_cube();
        [(); 3].map(|()| (center + random.in_cube() * size).as_vec3())
    }))
}

/// Rays across and from within the cube, some along axes and some with bounded intervals.
fn rays(count: usize, random: &mut Random) -> Vec<Ray> {
    (0..count)
        .map(|number| {
            let mut direction = random.direction().as_vec3();
            if number % 5 == 0 {
                direction[random.below(3) as usize] = [0.0, -0.0][number / 5 % 2];
            }
            let ray = Ray::new((random.in_cube() * 2.0).as_vec3(), direction);
            if number % 3 == 0 { Ray { t_min: 0.2, t_max: 1.5, ..ray } } else { ray }
        })
        .collect()
}

/// Whether an instance's box is the whole of space, or begins behind the ray's origin, or before it.
fn prepared(ray: &Ray, number: usize) -> Option<PreparedRay> {
    let mut prepared = PreparedRay::new(ray)?;
    match number % 4 {
        0 => prepared.clip.near = 0.5,
        1 => prepared.clip.far = 1.0,
        _ => {}
    }
    Some(prepared)
}

/// Compares single rays with the reference, and counts those that hit and those that hit twice.
fn compare_alone<const COMPACT: bool>(
    mesh: &Arc<TriangleMesh>,
    level: Level,
    linear: &Linear,
    rays: &[Ray],
) -> [usize; 2] {
    let wide = WideTree::<COMPACT>::build(mesh, &Params::default(), &Silent).unwrap().with_level(level);
    let (mut hits, mut second) = (0, 0);
    for (number, ray) in rays.iter().enumerate() {
        assert_eq!(wide.closest_alone(ray), linear.closest_alone(ray), "{} {ray:?}", level.name());
        assert_eq!(wide.occluded_alone(ray), linear.occluded_alone(ray), "{} {ray:?}", level.name());
        let Some(ray) = prepared(ray, number) else { continue };
        let closest = |tree: &dyn Fn(&mut Hit)| {
            let mut hit = Hit::MISS;
            tree(&mut hit);
            hit
        };
        let hit = closest(&|hit| linear.closest(&ray, 7, hit));
        assert_eq!(closest(&|hit| wide.closest(&ray, 7, hit)), hit, "{} {ray:?}", level.name());
        assert_eq!(wide.occluded(&ray), hit.is_hit(), "{} {ray:?}", level.name());
        let next = closest(&|next| linear.next_after(&ray, 7, hit.key(), next));
        assert_eq!(closest(&|next| wide.next_after(&ray, 7, hit.key(), next)), next, "{} {ray:?}", level.name());
        hits += usize::from(hit.is_hit());
        second += usize::from(next.is_hit());
    }
    [hits, second]
}

#[test]
fn all_instruction_sets_give_the_hits_of_the_reference() {
    let mut random = Random::new(4, 0x51d);
    // One leaf of each size, and trees.
    for count in (1..=9).chain([40, 300, 3000]) {
        let mesh = confetti(count, if count > 100 { 0.2 } else { 0.7 }, &mut random);
        let params = Params { kind: Kind::Wide, ..Params::default() };
        let linear = Linear::build(&mesh, &params, &Silent).unwrap();
        let rays = rays(600, &mut random);
        for level in Level::available() {
            let [hits, second] = compare_alone::<false>(&mesh, level, &linear, &rays);
            assert_eq!(compare_alone::<true>(&mesh, level, &linear, &rays), [hits, second]);
            assert!(count < 40 || hits > 20 && second > 3, "{hits} and {second} of {} rays hit", rays.len());
        }
    }
}

/// Rays from about one place to about another.
fn bundles(count: usize, random: &mut Random) -> Vec<Ray> {
    let mut bundles = Vec::new();
    while bundles.len() < count {
        let (origin, target, spread) = (random.in_cube() * 2.0, random.in_cube(), random.unit() * 0.3);
        bundles.extend((0..20).map(|number| {
            let start = origin + random.in_cube() * (spread * 0.1);
            let ray = Ray::new(start.as_vec3(), (target + random.in_cube() * spread - start).as_vec3());
            if number % 3 == 0 { Ray { t_min: 0.2, t_max: 1.0, ..ray } } else { ray }
        }));
    }
    bundles
}

/// Compares whole packets, and what is left over, with the reference's hits.
fn compare_batches<const COMPACT: bool>(
    mesh: &Arc<TriangleMesh>,
    level: Level,
    asked: &[Ray],
    clips: &[Interval],
    expected: &[Hit],
) {
    let wide = WideTree::<COMPACT>::build(mesh, &Params::default(), &Silent).unwrap().with_level(level);
    let large = WideTree::<COMPACT>::build(mesh, &Params::default(), &Silent).unwrap().with_level(level).with_turns();
    // Whole packets, and what is left over.
    for (wide, size) in [(&wide, asked.len()), (&wide, 16), (&wide, 21), (&large, asked.len()), (&large, 3)] {
        let mut hits = vec![Hit::MISS; asked.len()];
        let mut occluded = vec![false; asked.len()];
        for (at, rays) in asked.chunks(size).enumerate() {
            let part = at * size..at * size + rays.len();
            let clips = if clips.is_empty() { clips } else { &clips[part.clone()] };
            wide.closest_batch(rays, clips, 3, &mut hits[part.clone()]);
            wide.occluded_batch(rays, clips, &mut occluded[part]);
        }
        for (((ray, expected), hit), occluded) in asked.iter().zip(expected).zip(&hits).zip(occluded) {
            assert_eq!(bytemuck::bytes_of(hit), bytemuck::bytes_of(expected), "{} {ray:?}", level.name());
            assert_eq!(occluded, expected.is_hit(), "{} {ray:?}", level.name());
        }
    }
}

#[test]
fn packets_give_the_hits_of_the_reference() {
    let mut random = Random::new(15, 0x51d);
    for count in [1, 3, 8, 40, 3000] {
        let mesh = confetti(count, if count > 100 { 0.2 } else { 0.7 }, &mut random);
        let params = Params { kind: Kind::Wide, ..Params::default() };
        let linear = Linear::build(&mesh, &params, &Silent).unwrap();
        let mut asked = bundles(700, &mut random);
        asked.extend(rays(1300, &mut random));
        let clips: Vec<_> = asked
            .iter()
            .enumerate()
            .map(|(number, ray)| prepared(ray, number).map_or(Interval::ALL, |ray| ray.clip))
            .collect();
        for clips in [&[][..], &clips] {
            let mut expected = vec![Hit::MISS; asked.len()];
            linear.closest_batch(&asked, clips, 3, &mut expected);
            assert!(
                expected.iter().filter(|hit| hit.is_hit()).count() > count.min(300),
                "{} hits of {count} triangles",
                expected.iter().filter(|hit| hit.is_hit()).count()
            );
            for level in Level::available() {
                compare_batches::<false>(&mesh, level, &asked, clips, &expected);
                compare_batches::<true>(&mesh, level, &asked, clips, &expected);
            }
        }
    }
}

#[test]
fn nested_triangles_make_a_tree_of_bounded_depth() {
    // Each encloses all before it: binary trees become chains.
    let nested = (0..3000).map(|n| {
        let size = 1.0 + n as f32;
        [Vec3::new(-size, -size, 0.0), Vec3::new(size, -size, 0.0), Vec3::new(0.0, size, 0.0)]
    });
    let wide = Wide::build(&soup(nested), &Params::default(), &Silent).unwrap();
    assert_eq!(wide.validate(), Ok(()));
    assert!(wide.stats().max_depth as usize <= MOST_DEPTH);
    let mut hit = Hit::MISS;
    let ray = Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::NEG_Z);
    wide.closest(&PreparedRay::new(&ray).unwrap(), 0, &mut hit);
    assert_eq!((hit.t, hit.primitive), (1.0, 0));
}

#[test]
fn deep_ends_are_cut_evenly() {
    let mut random = Random::new(9, 0x51d);
    let mesh = confetti(5000, 0.1, &mut random);
    let live: Vec<u32> = mesh.live_triangles().collect();
    let boxes: Vec<Bounds> = live.iter().map(|&number| hit_bounds(mesh.triangle(number))).collect();
    // A chain: each inner node has one leaf and the next inner node.
    let count = boxes.len();
    let mut nodes = Vec::new();
    let around = |from: usize| boxes[from..].iter().fold(Bounds::EMPTY, |all, &one| all.union(one));
    nodes.push(crate::accel::topology::Node { bounds: around(0), first: 1, count: 0 });
    for item in 0..count - 1 {
        let leaf = |item: usize| crate::accel::topology::Node { bounds: boxes[item], first: item as u32, count: 1 };
        let next = nodes.len() as u32 + 2;
        nodes.push(leaf(item));
        nodes.push(if item + 2 < count {
            crate::accel::topology::Node { bounds: around(item + 1), first: next, count: 0 }
        } else {
            leaf(item + 1)
        });
    }
    let topology = Topology { nodes, order: (0..count as u32).collect() };
    let triangles: Vec<_> = live.iter().map(|&number| LeafTriangle::new(&mesh, number)).collect();
    let mut collapse = Collapse::new(&topology, &triangles, GrowingLeaves::default());
    let root = collapse.run(0);
    let tree = Tree::new(collapse.nodes.into(), collapse.leaves.finish(), root);
    let wide = Wide { tree, bounds: topology.nodes[0].bounds, level: Level::chosen() };
    assert_eq!(wide.validate(), Ok(()));
    assert!(wide.stats().max_depth > 30 && wide.stats().max_depth as usize <= MOST_DEPTH);
}

#[test]
fn trees_of_many_chunks_are_sound_and_the_same_on_any_number_of_threads() {
    let mut random = Random::new(17, 0x51d);
    let mesh = confetti(6 * chunks::MOST, 0.02, &mut random);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Wide::build(&mesh, &Params::default(), &Silent)).unwrap()
    };
    let wide = build(3);
    assert_eq!(wide.validate(), Ok(()));
    let alone = build(1);
    assert_eq!(wide.tree.leaves.words(), alone.tree.leaves.words());
    let parts = |wide: &Wide| wide.tree.nodes.iter().map(|node| (node.planes, node.children)).collect::<Vec<_>>();
    assert!(parts(&wide) == parts(&alone));
    let other = Bvh2::build(&mesh, &Params::default(), &Silent).unwrap();
    for ray in rays(2000, &mut random) {
        assert_eq!(wide.closest_alone(&ray), other.closest_alone(&ray), "{ray:?}");
    }
}

#[test]
fn a_build_of_many_chunks_can_be_stopped() {
    use std::sync::atomic::{AtomicU64, Ordering};
    /// Counts triangles and says to stop once more than so many are done.
    struct Stopping(AtomicU64, u64);
    impl Progress for Stopping {
        fn advance(&self, steps: u64) {
            self.0.fetch_add(steps, Ordering::Relaxed);
        }
        fn is_cancelled(&self) -> bool {
            self.0.load(Ordering::Relaxed) > self.1
        }
    }
    let mesh = confetti(6 * chunks::MOST, 0.02, &mut Random::new(18, 0x51d));
    let progress = Stopping(AtomicU64::new(0), 30_000);
    assert!(Wide::build(&mesh, &Params::default(), &progress).is_err());
    assert!(progress.0.into_inner() < 60_000);
    let progress = Stopping(AtomicU64::new(0), u64::MAX);
    Wide::build(&mesh, &Params::default(), &progress).unwrap();
    assert_eq!(progress.0.into_inner(), mesh.live_count() as u64);
}

#[test]
fn triangles_take_at_most_64_bytes_with_their_nodes() {
    let mut random = Random::new(5, 0x51d);
    let wide = Wide::build(&confetti(20_000, 0.05, &mut random), &Params::default(), &Silent).unwrap();
    let stats = wide.stats();
    let bytes = (stats.node_bytes + stats.leaf_bytes) as f64 / stats.triangles as f64;
    assert!(bytes < 64.0, "{bytes} bytes a triangle");
}
