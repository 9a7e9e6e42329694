//! The box test is written three times: for one box, for the pairs of binary nodes and for the eight of wide nodes. All
//! must give the same bits, else trees would cull by other rules than those that hits are clamped by.

use glam::Vec3;

use super::meshes::Random;
use crate::accel::cwbvh::{WIDTH, WideNode};
use crate::accel::pair_tree::Pair;
use crate::accel::topology::Node;
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, PreparedRay, Ray};

/// Coordinates and directions that make products NaN, infinite, denormal or a zero of either sign.
const HARD: [f32; 12] = [0.0, -0.0, 1.0, -1.0, 0.3, 16_777_216.0, -3e6, 1e-30, -1e-42, f32::MIN_POSITIVE, 1e30, -3e38];

fn hard(random: &mut Random) -> Vec3 {
    let component = |random: &mut Random| HARD[random.below(HARD.len())];
    Vec3::new(component(random), component(random), component(random))
}

/// Hard or ordinary rays and limits of t.
fn ray(random: &mut Random) -> (PreparedRay, f32, f32) {
    loop {
        let pick = |random: &mut Random| if random.below(2) == 0 { hard(random) } else { random.vector() };
        let (origin, direction) = (pick(random), pick(random));
        let limits = [f32::NEG_INFINITY, -0.0, 0.0, random.unit(), 1e30, f32::INFINITY];
        let (near, far) = (limits[random.below(5)], limits[1 + random.below(5)]);
        if let Some(ray) = PreparedRay::new(&Ray::new(origin, direction)) {
            return (ray, near, far);
        }
    }
}

fn bits(interval: Interval) -> [u32; 2] {
    [interval.near.to_bits(), interval.far.to_bits()]
}

#[test]
fn pairs_cross_their_boxes_as_single_boxes_do() {
    let mut random = Random::new(21);
    let mut crossed = 0;
    for round in 0..200_000 {
        let (ray, near, far) = ray(&mut random);
        let children = [0, 1].map(|child| {
            let bounds = match (round + child) % 5 {
                0 => Bounds::of([random.vector(), random.vector()]),
                1 => Bounds::of([hard(&mut random), random.vector()]),
                // The ray's own origin, so that planes go through it; flat along some axes.
                2 => Bounds::of([ray.origin.into(), hard(&mut random)]),
                // Without end, or nothing at all.
                3 => Bounds { min: Vec3::NEG_INFINITY, max: hard(&mut random) },
                _ => [Bounds::EMPTY, Bounds { min: Vec3::NAN, max: Vec3::NAN }][random.below(2)],
            };
            Node { bounds, first: 0, count: 1 }
        });
        let [entry, exit] = Pair::new(children).intervals(&ray, near, far);
        for child in [0, 1] {
            let expected = children[child].bounds.interval(&ray, near, far);
            let found = Interval { near: entry[child], far: exit[child] };
            assert_eq!(bits(found), bits(expected), "{:?} {ray:?} [{near}, {far}]", children[child].bounds);
            crossed += u32::from(!expected.is_empty());
        }
    }
    assert!(crossed > 40_000, "only {crossed} boxes are crossed");
}

#[test]
fn wide_nodes_cross_their_quantised_boxes_as_single_boxes_do() {
    let mut random = Random::new(22);
    let mut crossed = 0;
    for round in 0..40_000 {
        let (ray, near, far) = ray(&mut random);
        let boxes: Vec<Bounds> = (0..WIDTH)
            .map(|child| match (round + child) % 3 {
                0 => Bounds::of([random.vector(), random.vector()]),
                1 => Bounds::of([ray.origin.into(), random.vector()]),
                _ => Bounds::of([hard(&mut random).clamp(Vec3::splat(-1e30), Vec3::splat(1e30)), ray.origin.into()]),
            })
            .take(if round % 2 == 0 { WIDTH } else { 2 })
            .collect();
        let mut node = WideNode::covering(&boxes.iter().fold(Bounds::EMPTY, |total, &bounds| total.union(bounds)));
        for bounds in &boxes {
            node.push(bounds, 0);
        }
        let [entry, exit] = node.intervals(&ray, near, far);
        for (child, bounds) in boxes.iter().enumerate() {
            assert!(node.bounds(child).contains(bounds), "{bounds:?} in {node:?}");
            let expected = node.bounds(child).interval(&ray, near, far);
            let found = Interval { near: entry[child], far: exit[child] };
            assert_eq!(bits(found), bits(expected), "child {child} of {node:?}, {ray:?} [{near}, {far}]");
            crossed += u32::from(!expected.is_empty());
        }
    }
    assert!(crossed > 20_000, "only {crossed} boxes are crossed");
}
