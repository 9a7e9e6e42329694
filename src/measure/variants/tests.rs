//! That the variants are honest implementations, and what each is known to get wrong.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::baldwin_weber::BaldwinWeber;
use super::moller_trumbore::{MollerTrumbore, MollerTrumboreF64};
use super::slab::{Ize, Padded, Plain};
use super::sphere::{Sphere, SphereTest};
use super::tree::{Skeleton, VariantTree};
use super::woop::{Kahan, Narrow, Published, Wide, Woop, WoopClamped};
use super::{BoxTest, TriangleTest};
use crate::accel::Params;
use crate::geometry::{Bounds, Ray, TriangleMesh};
use crate::math::random::Random;
use crate::measure::cases::meshes;
use crate::progress::Silent;

fn intersect<T: TriangleTest>(ray: &Ray, corners: [Vec3; 3]) -> Option<[f32; 3]> {
    let test = T::new(&Bounds::of(corners));
    T::intersect(&test.ray(ray), &test.triangle(corners)).map(|hit| [hit.t, hit.u, hit.v])
}

/// The answers of all triangle tests, with their names.
fn all_answers(ray: &Ray, corners: [Vec3; 3]) -> [(&'static str, Option<[f32; 3]>); 8] {
    macro_rules! answers {
        ($($test:ty),+) => { [$((<$test>::NAME, intersect::<$test>(ray, corners))),+] };
    }
    answers!(
        MollerTrumbore,
        BaldwinWeber,
        WoopClamped,
        Woop<Published>,
        Woop<Narrow>,
        Woop<Wide>,
        Woop<Kahan>,
        MollerTrumboreF64
    )
}

fn near(random: &mut Random, scale: f64) -> Vec3 {
    (random.in_cube() * scale).as_vec3()
}

#[test]
fn all_triangle_tests_agree_on_rays_that_keep_away_from_edges() {
    let mut random = Random::new(11, 0);
    let mut tried = 0;
    while tried < 2000 {
        let corners = [near(&mut random, 1.0), near(&mut random, 1.0), near(&mut random, 1.0)];
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let normal = (b - a).cross(c - a);
        let origin = near(&mut random, 3.0);
        let (u, v) = (random.between(-0.5, 1.5), random.between(-0.5, 1.5));
        let weights = [1.0 - u - v, u, v];
        let target = a * weights[0] + b * u + c * v;
        let direction = target - origin.as_dvec3();
        let cosine = normal.dot(direction).abs() / (normal.length() * direction.length());
        let clear = weights.iter().all(|w| w.abs() > 0.05) && normal.length() > 0.2 && cosine > 0.2;
        if !clear || direction.length() < 0.5 {
            continue;
        }
        tried += 1;
        let inside = weights.iter().all(|&w| w > 0.0);
        let ray = Ray::new(origin, direction.as_vec3());
        for (name, answer) in all_answers(&ray, corners) {
            assert_eq!(answer.is_some(), inside, "{name}: {ray:?} {corners:?}");
            if let Some([t, hit_u, hit_v]) = answer {
                let error = (f64::from(t) - 1.0).abs().max((f64::from(hit_u) - u).abs());
                assert!(error.max((f64::from(hit_v) - v).abs()) < 1e-4, "{name}: {error:e} {ray:?} {corners:?}");
            }
        }
        // Behind the end of the ray, and before its start, nothing counts.
        for short in [Ray { t_max: 0.5, ..ray }, Ray { t_min: 1.5, ..ray }] {
            assert!(all_answers(&short, corners).iter().all(|(_, answer)| answer.is_none()));
        }
    }
}

/// Rays from around the middle of a closed sphere of radius 2 at its vertices.
fn at_vertices(mesh: &Arc<TriangleMesh>, count: usize) -> Vec<Ray> {
    let mut random = Random::new(5, 0);
    let ray = |_| {
        let origin = near(&mut random, 1.0);
        Ray::new(origin, mesh.positions[random.below(mesh.positions.len() as u64) as usize] - origin)
    };
    (0..count).map(ray).collect()
}

/// How many of the rays a combination misses.
fn misses<T: TriangleTest, B: BoxTest>(mesh: &Arc<TriangleMesh>, rays: &[Ray]) -> usize {
    let skeleton = Skeleton::build(mesh, &Params::default(), &Silent).unwrap();
    let tree = VariantTree::<T, B>::new(&skeleton);
    rays.iter().filter(|ray| !tree.closest(ray).is_hit()).count()
}

#[test]
fn rays_at_the_vertices_of_a_closed_sphere_pass_through_the_tests_that_are_not_watertight() {
    let mesh = Arc::new(meshes::sphere(48, 96, 2.0, DVec3::ZERO));
    let rays = at_vertices(&mesh, 20_000);
    // The hard cases' own measurement says 10 % and 16 %; f64 leaves gaps too where a ray meets a vertex exactly.
    let leaky = [
        misses::<MollerTrumbore, Padded>(&mesh, &rays),
        misses::<BaldwinWeber, Padded>(&mesh, &rays),
        misses::<MollerTrumboreF64, Padded>(&mesh, &rays),
    ];
    assert!(leaky[0] > 1000 && leaky[1] > 1000 && leaky[2] > 0 && leaky[2] < 200, "{leaky:?}");
    assert_eq!(misses::<WoopClamped, Padded>(&mesh, &rays), 0);
    assert_eq!(misses::<Woop<Published>, Padded>(&mesh, &rays), 0);
    assert_eq!(misses::<Woop<Narrow>, Padded>(&mesh, &rays), 0);
    assert_eq!(misses::<Woop<Wide>, Padded>(&mesh, &rays), 0);
    assert_eq!(misses::<Woop<Kahan>, Padded>(&mesh, &rays), 0);
}

#[test]
fn trees_find_what_every_triangle_asked_one_by_one_gives() {
    fn check<T: TriangleTest, B: BoxTest>(mesh: &Arc<TriangleMesh>, rays: &[Ray]) {
        let skeleton = Skeleton::build(mesh, &Params::default(), &Silent).unwrap();
        let tree = VariantTree::<T, B>::new(&skeleton);
        let test = T::new(&skeleton.bounds());
        for ray in rays {
            let for_triangles = test.ray(ray);
            let mut best = (f32::INFINITY, u32::MAX);
            for number in mesh.live_triangles() {
                if let Some(hit) = T::intersect(&for_triangles, &test.triangle(mesh.triangle(number)))
                    && (hit.t, number) < best
                {
                    best = (hit.t, number);
                }
            }
            let hit = tree.closest(ray);
            assert_eq!((hit.t, hit.primitive), best, "{} {}: {ray:?}", T::NAME, B::NAME);
            assert_eq!(tree.occluded(ray), hit.is_hit());
        }
    }
    let mesh = Arc::new(meshes::sphere(48, 96, 2.0, DVec3::ZERO));
    let mut random = Random::new(3, 0);
    let rays: Vec<Ray> = (0..50).map(|_| Ray::new(near(&mut random, 3.0), near(&mut random, 1.0))).collect();
    check::<MollerTrumbore, Plain>(&mesh, &rays);
    check::<WoopClamped, Padded>(&mesh, &rays);
    check::<MollerTrumboreF64, Padded>(&mesh, &rays);
    check::<WoopClamped, Ize>(&mesh, &rays);
}

#[test]
fn the_plain_box_test_loses_rays_at_the_edges_of_boxes_and_the_padded_ones_do_not() {
    fn lost<B: BoxTest>() -> usize {
        let mut random = Random::new(21, 0);
        // Differences of multiples of 2^-10 are exact: the ray passes exactly through the place aimed at.
        let mut on_lattice = |low: i32, high: i32| {
            let steps = random.below((high - low) as u64 * 1024) as i32 + low * 1024;
            steps as f32 / 1024.0
        };
        let mut lost = 0;
        for _ in 0..20_000 {
            let [height, side, along] = [on_lattice(-2, 2), on_lattice(-2, 2), on_lattice(-1, 1)];
            let flat = Bounds { min: Vec3::new(-1.0, side - 1.0, height), max: Vec3::new(1.0, side, height) };
            let origin = Vec3::new(on_lattice(-3, 3), on_lattice(-3, 3), on_lattice(3, 8));
            let ray = Ray::new(origin, Vec3::new(along, side, height) - origin);
            lost += usize::from(B::interval(&B::ray(&ray), &flat, 0.0, f32::INFINITY).is_empty());
        }
        lost
    }
    assert!(lost::<Plain>() > 20_000 / 100, "{}", lost::<Plain>());
    assert_eq!((lost::<Ize>(), lost::<Padded>()), (0, 0));
}

#[test]
fn the_published_padding_is_two_ulp() {
    let far = Ize::ray(&Ray::new(Vec3::ZERO, Vec3::new(1.0, -2.0, 0.0))).inverse_far;
    assert_eq!(far, glam::Vec3A::new(1.0 + 2.0 * f32::EPSILON, -0.5 - f32::EPSILON, f32::INFINITY));
}

#[test]
fn f32_edges_alone_lose_slivers_that_f64_finds() {
    // The edge functions around the ray are -1, -1 and -2 times 2^-46, next to products of 1.
    const E: f32 = f32::EPSILON;
    let corners = [[1.0, 1.0 + E], [1.0 + 2.0 * E, 1.0 + 3.0 * E], [-1.0 - E, -1.0 - 2.0 * E]];
    let corners = corners.map(|[x, y]| Vec3::new(x, y, 4.0));
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert_eq!(intersect::<Woop<Narrow>>(&ray, corners), None);
    for found in [intersect::<WoopClamped>(&ray, corners), intersect::<Woop<Published>>(&ray, corners)] {
        assert_eq!(found, Some([4.0, 0.25, 0.5]));
    }
}

#[test]
fn sphere_tests_agree_near_by_and_the_textbook_fails_far_away() {
    let hit = |test: SphereTest, distance: f32, beside: f32| {
        let sphere = Sphere::new(Vec3::new(0.3, beside, distance), 1.0);
        test.intersect(&sphere, &Ray::new(Vec3::ZERO, Vec3::Z))
    };
    for test in SphereTest::ALL {
        assert!((hit(test, 5.0, 0.0).unwrap() - (5.0 - (1.0f32 - 0.09).sqrt())).abs() < 1e-5, "{test:?}");
        assert_eq!(hit(test, 5.0, 1.5), None);
        // From inside, the far side counts.
        assert!(hit(test, 0.0, 0.0).unwrap() > 0.9);
    }
    let exact = 1e4 - (1.0f64 - 0.09).sqrt();
    let error = |test| (f64::from(hit(test, 1e4, 0.0).unwrap_or(f32::INFINITY)) - exact).abs();
    assert!(error(SphereTest::Textbook) > 0.04, "{}", error(SphereTest::Textbook));
    assert!(error(SphereTest::ClosestApproach) < 0.01);
    // Half an ulp at 1e4.
    assert!(error(SphereTest::Quadric) <= 0.5 * 2f64.powi(-10));
}
