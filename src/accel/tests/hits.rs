//! Structures give the same hits as `linear`, bit for bit, on ordinary and on hard rays.

use std::sync::Arc;

use std::ops::ControlFlow;

use glam::{DVec3, Quat, Vec3};

use super::compare::{compare, compare_on_hard_rays, prepare, rays_at};
use super::meshes::{Random, grid, mesh, random_soup, soup, sphere, transformed};
use crate::accel::triangle_tree::TriangleTree;
use crate::accel::{Bvh2, CwBvh, Kind, Linear, Params, TriangleAccelerator, dispatch_kind};
use crate::geometry::{Hit, PreparedRay, Ray, TriangleMesh};
use crate::progress::Silent;

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
    let linear = Linear::build(&soup, &Params::default(), &Silent).unwrap();
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
    let mut hits = Vec::new();
    for &kind in &Kind::ALL[1..] {
        dispatch_kind!(kind, A => {
            let accelerator = A::build(&ball, &Params::default(), &Silent).unwrap();
            let mut best = vec![Hit::MISS; RAYS];
            accelerator.closest_batch(&rays, &[], 0, &mut best);
            let mut occluded = vec![false; RAYS];
            accelerator.occluded_batch(&rays, &[], &mut occluded);
            let missed = best.iter().filter(|hit| !hit.is_hit()).count();
            let free = occluded.iter().filter(|occluded| !**occluded).count();
            assert_eq!((missed, free), (0, 0), "{}", kind.name());
            hits.push(best);
        });
    }
    assert!(hits.windows(2).all(|pair| pair[0] == pair[1]));
    let prepared: Vec<_> = rays[..300].iter().filter_map(PreparedRay::new).collect();
    compare("sphere", &ball, &prepared);
}

/// The leaves that a ray visits within `[near, far]`.
fn leaves_visited<T: TriangleTree>(mesh: &Arc<TriangleMesh>, ray: &PreparedRay, near: f32, far: f32) -> u32 {
    let tree = <T as TriangleAccelerator>::build(mesh, &Params::default(), &Silent).unwrap();
    let mut visited = 0;
    let _ = tree.traverse(
        ray,
        near,
        far,
        |_| {},
        |_| {
            visited += 1;
            ControlFlow::Continue(far)
        },
    );
    visited
}

/// Both ends of the interval cull nodes: what lies before t_min costs as little as what lies beyond t_max.
#[test]
fn nodes_outside_the_interval_are_not_visited() {
    fn check<T: TriangleTree>() {
        let ball = sphere(16, 32);
        // Through both walls, at t = 1 and 5; one wall's leaves lie within half a unit of it.
        let ray = PreparedRay::new(&Ray::new(Vec3::new(-3.0, 0.1, 0.2), Vec3::X)).unwrap();
        let visited = |near, far| leaves_visited::<T>(&ball, &ray, near, far);
        let name = <T as TriangleTree>::NAME;
        let all = visited(0.0, f32::INFINITY);
        let (first, middle, second) = (visited(0.0, 2.0), visited(2.5, 3.5), visited(4.0, f32::INFINITY));
        assert!(first > 0 && second > 0 && first + second <= all, "{name}: {first} + {second} of {all}");
        assert_eq!((middle, visited(6.0, f32::INFINITY), visited(0.0, 0.5)), (0, 0, 0), "{name}");
    }
    check::<Bvh2>();
    check::<CwBvh>();
}

/// A tetrahedron or a box of any proportions, turned or along the axes.
fn solid(random: &mut Random) -> Arc<TriangleMesh> {
    let size = |random: &mut Random| 10f32.powf(random.unit() * 3.0 - 2.0);
    let scale = Vec3::new(size(random), size(random), size(random));
    if random.below(3) == 0 {
        let corners = [(); 4].map(|()| random.vector() * scale);
        return mesh(corners.to_vec(), vec![[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]);
    }
    let turn = if random.below(2) == 0 {
        Quat::IDENTITY
    } else {
        Quat::from_euler(glam::EulerRot::XYZ, random.unit() * 6.0, random.unit() * 6.0, random.unit() * 6.0)
    };
    let corner =
        |i: usize| turn * (Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0) * scale;
    let faces = [[0, 2, 1, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 6, 3, 7], [0, 4, 2, 6], [1, 3, 5, 7]];
    mesh((0..8).map(corner).collect(), faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [b, d, c]]).collect())
}

/// Faces that are large beside the ray's way to them: what rounding of their corners moves does not shrink with t. Rays
/// from within pass an edge by a few units of it.
#[test]
fn closed_solids_of_large_faces_have_no_leaks() {
    let mut random = Random::new(9);
    for number in 0..600 {
        let solid = solid(&mut random);
        let center = solid.positions.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / solid.positions.len() as f64;
        let largest = solid.bounds().size().max_element();
        let vector = |random: &mut Random| random.vector().as_dvec3();
        let rays: Vec<Ray> = (0..400)
            .map(|_| {
                let [a, b, _] = solid.triangle(random.below(solid.indices.len()) as u32).map(|p| p.as_dvec3());
                let on_edge = |at: f64| a + (b - a) * at;
                let at = f64::from(random.unit());
                let near = 10f64.powf(-3.0 * f64::from(random.unit()));
                let beside = on_edge((at + (f64::from(random.unit()) - 0.5) * near).clamp(0.0, 1.0));
                let inward = near * 10f64.powf(-f64::from(random.unit()));
                let origin = (beside + (center - beside) * inward).as_vec3();
                let target = on_edge(at) + vector(&mut random) * (largest * 2f64.powi(-22));
                Ray::new(origin, (target - origin.as_dvec3()).as_vec3())
            })
            .collect();
        let rays: Vec<Ray> = rays.into_iter().filter(Ray::is_valid).collect();
        for &kind in Kind::ALL {
            let mut best = vec![Hit::MISS; rays.len()];
            dispatch_kind!(kind, A => {
                A::build(&solid, &Params::default(), &Silent).unwrap().closest_batch(&rays, &[], 0, &mut best);
            });
            if let Some(leak) = best.iter().position(|hit| !hit.is_hit()) {
                panic!("{}: {:?} leaks out of solid {number} {:?}", kind.name(), rays[leak], solid.positions);
            }
        }
    }
}

#[test]
fn meshes_without_live_triangles() {
    let flat = soup(&[[Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::splat(f32::NAN); 3]]);
    let rays: Vec<_> =
        (0..20).filter_map(|i| PreparedRay::new(&Ray::new(Vec3::ZERO, Random::new(i).vector()))).collect();
    for empty in [TriangleMesh::default().into(), flat] {
        assert_eq!(compare("empty", &empty, &rays), 0);
    }
}

#[test]
fn dropped_triangles_do_not_shift_numbers() {
    let mut random = Random::new(8);
    let mut soup = Arc::unwrap_or_clone(random_soup(&mut random, 60, 0.5));
    for number in [0, 7, 8, 59] {
        soup.indices[number][1] = soup.indices[number][0];
    }
    let soup = Arc::new(soup.finish().unwrap());
    assert_eq!(soup.live_count(), 56);
    compare_on_hard_rays("dropped", &soup, 300);
}
