//! Instanced meshes against the same meshes with the transform baked into their vertices, and the boxes around them.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use whitted::accel::Params;
use whitted::geometry::{Ray, TriangleMesh};
use whitted::math::float::UNIT_ROUNDOFF;
use whitted::math::random::{hash2, unit};
use whitted::progress::Silent;
use whitted::render::Renderer;
use whitted::render::surface::SurfacePoint;
use whitted::scene::camera::ViewRay;

use crate::common::*;

fn random_vec(seed: u32, k: u32) -> DVec3 {
    let component = |axis| unit(hash2(seed, 3 * k + axis)) * 2.0 - 1.0;
    DVec3::new(component(0), component(1), component(2))
}

/// The largest singular value, by power iteration.
fn spectral_norm(m: DMat3) -> f64 {
    let square = m.transpose() * m;
    let mut v = DVec3::new(0.6, 0.5, 0.62);
    for _ in 0..500 {
        v = (square * v).normalize();
    }
    (m * v).length()
}

/// The mesh with its vertices transformed in f64 and rounded to f32. A mirror would turn the faces inside out, so their
/// winding is turned as well.
fn baked(mesh: &TriangleMesh, transform: &DAffine3) -> TriangleMesh {
    let turn = transform.matrix3.determinant() < 0.0;
    TriangleMesh {
        positions: mesh.positions.iter().map(|p| transform.transform_point3(p.as_dvec3()).as_vec3()).collect(),
        indices: mesh.indices.iter().map(|&[a, b, c]| if turn { [a, c, b] } else { [a, b, c] }).collect(),
        ..TriangleMesh::default()
    }
}

fn renderer(mesh: TriangleMesh, transform: DAffine3) -> Renderer {
    let mut scene = empty_scene();
    add_mesh(&mut scene, mesh, transform, white());
    Renderer::build(scene, &Params::default(), &Silent).unwrap()
}

/// Shoots rays from inside and outside at an instanced ball and at the baked one, and compares t, normal and side.
///
/// What the rounding of baked vertices explains is added to the bounds: a vertex moves by at most u of its coordinates,
/// a point of the plane by no more than the vertices around it.
fn compare_with_baked(name: &str, transform: DAffine3) {
    let ball = sphere_mesh(1.0, DVec3::ZERO, 12, 24);
    let condition = spectral_norm(transform.matrix3) * spectral_norm(transform.matrix3.inverse());
    let instanced = renderer(ball.clone(), transform);
    let reference = renderer(baked(&ball, &transform), DAffine3::IDENTITY);
    let world_corners = |primitive: u32| {
        ball.indices[primitive as usize].map(|i| transform.transform_point3(ball.positions[i as usize].as_dvec3()))
    };
    let (mut compared, mut worst) = (0, 0.0f64);
    for seed in 0..20_000 {
        let outside = seed % 2 == 0;
        let leaving = random_vec(seed, 1).normalize();
        // Directions are chosen in the world: a stretch by 1e6 would turn all others into grazing ones.
        let (origin, direction) = if outside {
            let [a, b, c] = world_corners(hash2(seed, 9) % ball.indices.len() as u32);
            let target = a + (b - a) * 0.3 + (c - a) * (0.6 * unit(hash2(seed, 8)));
            let outward = (b - a).cross(c - a) * transform.matrix3.determinant();
            let leaving = if leaving.dot(outward) < 0.0 { -leaving } else { leaving };
            ((target + leaving * 3.0).as_vec3(), -leaving.as_vec3())
        } else {
            (transform.transform_point3(random_vec(seed, 0) * 0.1).as_vec3(), leaving.as_vec3())
        };
        let ray = Ray::new(origin, direction);
        let view = ViewRay { origin: origin.as_dvec3(), direction: direction.as_dvec3().normalize() };
        let (found, expected) = (instanced.closest(&ray), reference.closest(&ray));
        // Near edges and silhouettes rounding may choose the neighbour, or nothing.
        if !found.is_hit() || !expected.is_hit() || found.primitive != expected.primitive {
            continue;
        }
        let corners = world_corners(found.primitive);
        let [a, b, c] = corners;
        let face = (b - a).cross(c - a);
        let normal = face.normalize();
        let slope = normal.dot(view.direction).abs();
        if slope < 0.02 {
            continue;
        }
        compared += 1;
        let context = || format!("{name}, seed {seed}, {ray:?}, {found:?}, {expected:?}");
        let moved = corners.iter().fold(DVec3::ZERO, |most, p| most.max(p.abs())) * UNIT_ROUNDOFF;

        let t = f64::from(expected.t);
        let difference = (f64::from(found.t) - t).abs();
        let allowed = 32.0 * UNIT_ROUNDOFF * condition * t + normal.abs().dot(moved) / slope;
        assert!(difference <= allowed, "t differs by {difference:e}, not {allowed:e}: {}", context());
        worst = worst.max(difference / allowed);

        let point = SurfacePoint::of(instanced.scene(), instanced.world(), &view, &found);
        let other = SurfacePoint::of(reference.scene(), reference.world(), &view, &expected);
        let angle = point.geometric_normal.cross(other.geometric_normal).length();
        let tilt = 2.0 * moved.length() * ((b - a).length() + (c - a).length()) / face.length();
        assert!(angle <= 1e-6 + tilt, "normals {angle:e} apart, not {tilt:e}: {}", context());
        assert!(point.geometric_normal.dot(other.geometric_normal) > 0.0, "{}", context());
        assert_eq!((point.from_outside, other.from_outside), (outside, outside), "{}", context());
    }
    eprintln!("{name}: {compared} compared, at worst {worst:.2} of what is allowed");
    assert!(compared > 10_000, "{name}: only {compared} compared");
}

#[test]
fn instances_agree_with_baked_meshes() {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.9);
    let shift = DVec3::new(3.0, -2.0, 5.0);
    let stretch = DVec3::new(1.0, 1e-3, 1e3);
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(10.0, 1.0, 0.0), DVec3::Z);
    let sheared = DAffine3 { matrix3: shear, translation: shift };
    compare_with_baked("rotation", DAffine3::from_rotation_translation(turn, shift));
    compare_with_baked("mirror", DAffine3::from_scale_rotation_translation(DVec3::new(-1.0, 1.0, 1.0), turn, shift));
    compare_with_baked("shear", sheared);
    compare_with_baked("stretch", DAffine3::from_scale_rotation_translation(stretch, DQuat::IDENTITY, shift));
    compare_with_baked("all", DAffine3::from_scale(DVec3::new(1.0, -2.0, 0.1)) * sheared * DAffine3::from_quat(turn));
}

#[test]
fn the_box_of_a_turned_quad_far_away_holds_its_exact_corners() {
    const AWAY: f64 = 1e4;
    let quad = rectangle(glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y);
    let transform =
        DAffine3::from_rotation_translation(DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4), DVec3::splat(AWAY));
    let renderer = renderer(quad, transform);
    let bounds = renderer.world().instances[0].bounds.unwrap();
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    // In closed form, with more margin than f64 can be off at this distance.
    let half_diagonal = std::f64::consts::FRAC_1_SQRT_2;
    let margin = 1e-11;
    let exact_min = DVec3::new(AWAY - half_diagonal, AWAY, AWAY);
    let exact_max = DVec3::new(AWAY + half_diagonal, AWAY + 2.0 * half_diagonal, AWAY);
    assert!(min.cmple(exact_min - margin).all() && max.cmpge(exact_max + margin).all(), "{bounds:?}");
    // Not by much: a pad of 3 gamma of the coordinates and their rounding, so 4 of these steps.
    let ulp = f64::from((AWAY as f32).next_up()) - AWAY;
    assert!((exact_min - min).max(max - exact_max).max_element() < 4.0 * ulp, "{bounds:?}");
}
