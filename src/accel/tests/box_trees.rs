//! The tree over boxes against a loop over all boxes.

use std::ops::ControlFlow;

use glam::Vec3;

use super::meshes::Random;
use crate::accel::{BoxTree, Params, Preset};
use crate::geometry::{Bounds, PreparedRay, Ray};
use crate::progress::Silent;

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
            let tree = BoxTree::build(&boxes, &Params { preset, ..Params::default() }, &Silent).unwrap();
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
    let tree = BoxTree::build(&boxes, &Params::default(), &Silent).unwrap();
    tree.validate(&boxes).unwrap();
    assert!(tree.stats().max_depth <= 128, "{:?}", tree.stats());
}

#[test]
fn boxes_without_end_are_in_the_tree() {
    let all = Bounds { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
    let half = Bounds { min: Vec3::new(1.0, f32::NEG_INFINITY, -1.0), max: Vec3::INFINITY };
    let unit = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
    let beyond = Bounds::of([Vec3::INFINITY]);
    let boxes = [unit, all, half, beyond, unit, all];
    for &preset in Preset::ALL {
        let tree = BoxTree::build(&boxes, &Params { preset, ..Params::default() }, &Silent).unwrap();
        tree.validate(&boxes).unwrap();
        let ray = PreparedRay::new(&Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X)).unwrap();
        let mut visited = Vec::new();
        let _ = tree.traverse(&ray, 0.0, f32::INFINITY, |number| {
            visited.push(number);
            ControlFlow::Continue(f32::INFINITY)
        });
        visited.sort_unstable();
        // The one beyond everything is entered at infinity, where the ray ends.
        assert_eq!(visited, [0, 1, 2, 3, 4, 5], "{preset:?}");
    }
}
