//! The shading formula, shadows, mirrors and refraction against closed forms.

use glam::{DAffine3, DVec3, Vec3};
use whitted::geometry::quadric::Clip;
use whitted::geometry::{Quadric, shapes};
use whitted::scene::{Camera, Clamp, FilmSettings, Light, LightKind, Material, NamedCamera, Rgb, Scene};

use crate::common::*;

fn placed(center: DVec3, radius: f64) -> DAffine3 {
    DAffine3::from_translation(center) * DAffine3::from_scale(DVec3::splat(radius))
}

/// Adds the plane z = 0 as a large square that faces +Z.
fn add_wall(scene: &mut Scene, material: Material) {
    let wall = rectangle(Vec3::new(-9.0, -9.0, 0.0), Vec3::X * 18.0, Vec3::Y * 18.0);
    add_mesh(scene, wall, DAffine3::IDENTITY, material);
}

#[test]
fn every_term_of_the_formula_at_one_point() {
    // The plane z = 0 seen from (0, 0, 5), a light at (3, 0, 4): N.L = 0.8, R.V = 0.8.
    let material = Material {
        ambient: Some(Rgb::new(0.01, 0.02, 0.03)),
        emission: Rgb::new(0.1, 0.0, 0.0),
        diffuse: Rgb::new(0.5, 0.25, 0.125),
        specular: Rgb::new(1.0, 0.5, 0.25),
        ks: Rgb::splat(0.3),
        shininess: 3.0,
        ..black()
    };
    let mut scene = empty_scene();
    add_wall(&mut scene, material);
    let light = Rgb::new(0.9, 0.8, 0.7);
    add_light(&mut scene, DVec3::new(3.0, 0.0, 4.0), light);
    let highlight = 0.8f32.powi(3) * 0.3;
    let expected =
        Rgb::new(0.11, 0.02, 0.03) + light * (Rgb::new(0.5, 0.25, 0.125) * 0.8 + Rgb::new(1.0, 0.5, 0.25) * highlight);
    near(pixel(&scene), expected, 2e-7);

    // kt takes its share of the diffuse term; what is behind the plane is black.
    scene.materials.last_mut().unwrap().kt = Rgb::new(0.5, 0.25, 0.0);
    let expected = Rgb::new(0.11, 0.02, 0.03)
        + light * (Rgb::new(0.5 * 0.5, 0.25 * 0.75, 0.125) * 0.8 + Rgb::new(1.0, 0.5, 0.25) * highlight);
    near(pixel(&scene), expected, 2e-7);
}

#[test]
fn a_surface_is_lit_only_from_the_side_it_is_seen_from() {
    let mut scene = empty_scene();
    add_wall(&mut scene, white());
    add_light(&mut scene, DVec3::new(0.0, 0.0, 4.0), Rgb::ONE);
    near(pixel(&scene), Rgb::ONE, 1e-7);
    look(&mut scene, DVec3::new(0.0, 0.0, -5.0), DVec3::ZERO);
    assert_eq!(pixel(&scene), Rgb::ZERO, "seen from the other side");
}

#[test]
fn the_seeds_clamp_keeps_every_reflection_at_most_1() {
    let mut scene = empty_scene();
    let mirror = Material { emission: Rgb::ONE, kr: Rgb::splat(0.5), ..black() };
    let tall = |x: f32| rectangle(Vec3::new(x, -1e4, -1e4), Vec3::Y * 2e4, Vec3::Z * 2e4);
    add_mesh(&mut scene, tall(0.0), DAffine3::IDENTITY, mirror.clone());
    add_mesh(&mut scene, tall(1.0), DAffine3::IDENTITY, mirror);
    look(&mut scene, DVec3::new(0.5, 0.0, 0.0), DVec3::new(1.0, 0.01, 0.0));
    scene.film.max_depth = 5;
    near(pixel(&scene), Rgb::splat(2.0 - 0.5f32.powi(5)), 1e-6);
    scene.film.clamp = Clamp::Shade;
    near(pixel(&scene), Rgb::ONE, 0.0);
}

#[test]
fn a_glass_sphere_bends_axial_and_oblique_rays_by_snells_law() {
    // A ray that enters a unit sphere of index n at height h leaves it turned by 2 (i - r), sin i = h, sin r = h / n.
    // Two half planes of different colour far behind tell on which side of a direction the ray went.
    for (h, ior) in [(0.3f64, 1.5), (0.8, 1.5), (0.6, 1.33), (0.5, 2.4)] {
        let turn = 2.0 * (h.asin() - (h / ior).asin());
        for (offset, expected) in [(1e-4, 0.0f32), (-1e-4, 1.0)] {
            let mut scene = empty_scene();
            let glass = Material { kt: Rgb::ONE, ior: ior as f32, ..black() };
            add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, glass);
            // In the plane x = 0 the ray enters at the angle i above the z axis and leaves after the chord's angle.
            let (i, r) = (h.asin(), (h / ior).asin());
            let exit_angle = i + (std::f64::consts::PI - 2.0 * r);
            let exit = DVec3::new(0.0, exit_angle.sin(), exit_angle.cos());
            let direction = DVec3::new(0.0, -turn.sin(), -turn.cos());
            let on_line = exit + direction * 5.0;
            // An emitting half plane below `edge`, perpendicular to the outgoing ray.
            let up = DVec3::new(0.0, turn.cos(), -turn.sin());
            let edge = on_line + up * -offset;
            let corner = edge + DVec3::X * -50.0 - up * 100.0;
            let screen = rectangle(corner.as_vec3(), Vec3::X * 100.0, (up * 100.0).as_vec3());
            add_mesh(&mut scene, screen, DAffine3::IDENTITY, Material { emission: Rgb::ONE, ..black() });
            look(&mut scene, DVec3::new(0.0, h, 5.0), DVec3::new(0.0, h, 0.0));
            near(pixel(&scene), Rgb::splat(expected), 0.0);
        }
    }
}

#[test]
fn beyond_the_critical_angle_all_is_reflected_inside() {
    // From inside a cube of index 1.5 at 45 degrees: sin 45 = 0.707 > 1 / 1.5. The ray circles in the cube and never
    // sees the white world outside; at 30 degrees it does.
    for (angle, expected) in [(45.0f64, 0.0), (30.0, 1.0)] {
        let mut scene = empty_scene();
        scene.background = whitted::scene::Background::Color(Rgb::ONE);
        add_mesh(&mut scene, cube(), DAffine3::IDENTITY, Material { kt: Rgb::ONE, ior: 1.5, ..black() });
        let (sin, cos) = angle.to_radians().sin_cos();
        look(&mut scene, DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.1 + cos, sin, 0.0));
        near(pixel(&scene), Rgb::splat(expected), 0.0);
    }
}

#[test]
fn a_glass_sphere_casts_a_shadow_of_kt_squared() {
    let mut scene = empty_scene();
    add_quadric(&mut scene, shapes::plane(None), DAffine3::IDENTITY, white());
    let kt = Rgb::new(0.9, 0.5, 0.1);
    add_quadric(&mut scene, shapes::sphere(), placed(DVec3::new(0.0, 3.0, 0.0), 1.0), Material { kt, ..black() });
    add_light(&mut scene, DVec3::new(0.0, 10.0, 0.0), Rgb::ONE);
    look(&mut scene, DVec3::new(4.0, 1.0, 0.0), DVec3::ZERO);
    near(pixel(&scene), kt * kt, 1e-7);
    // An opaque sphere inside the glass ends the ray.
    add_quadric(&mut scene, shapes::sphere(), placed(DVec3::new(0.0, 3.0, 0.0), 0.5), white());
    near(pixel(&scene), Rgb::ZERO, 0.0);
}

#[test]
fn a_transparent_mesh_attenuates_once_a_surface() {
    let mut scene = empty_scene();
    add_quadric(&mut scene, shapes::plane(None), DAffine3::IDENTITY, white());
    let kt = Rgb::new(0.5, 0.25, 1.0);
    add_mesh(&mut scene, cube(), DAffine3::from_translation(DVec3::new(0.0, 3.0, 0.0)), Material { kt, ..black() });
    add_light(&mut scene, DVec3::new(0.01, 10.0, 0.003), Rgb::ONE);
    look(&mut scene, DVec3::new(4.0, 1.0, 0.0), DVec3::new(0.01, 0.0, 0.003));
    near(pixel(&scene), kt * kt, 1e-7);
}

#[test]
fn tilted_general_quadrics_look_like_upright_ones_turned() {
    // The paraboloid |p|^2 - (n.p)^2 = n.p within a box, seen along its axis into the bowl, lit from there.
    for n in [
        DVec3::new(0.0, 1.0, 0.0),
        DVec3::new(2.0, 3.0, 6.0) / 7.0,
        DVec3::new(1.0, 4.0, 8.0) / 9.0,
        DVec3::new(0.6, 0.8, 0.0),
    ] {
        let l = n * -0.5;
        let coefficients =
            [1.0 - n.x * n.x, 1.0 - n.y * n.y, 1.0 - n.z * n.z, -n.x * n.y, -n.y * n.z, -n.x * n.z, l.x, l.y, l.z, 0.0];
        // Without end it shades itself at 1e15 from any sun that is not exactly on its axis: the clip is needed.
        assert!(Quadric::new(coefficients, None, false).unwrap().bounds().is_none());
        let mut scene = empty_scene();
        let clip = Clip { min: DVec3::splat(-1.0), max: DVec3::ONE };
        let quadric = Quadric::new(coefficients, Some(clip), false).unwrap();
        add_quadric(&mut scene, quadric, DAffine3::IDENTITY, white());
        scene.lights =
            vec![Light { name: "sun".into(), kind: LightKind::Directional { direction: -n }, color: Rgb::ONE }];
        // At the radius r the height is r^2, the slope 2 r, and N.L = 1 / sqrt(1 + 4 r^2).
        let across = n.any_orthonormal_vector();
        for r in [0.0, 0.1, 0.3] {
            let point = across * r + n * (r * r);
            look(&mut scene, point + n * 5.0 + across * 0.5, point);
            near(pixel(&scene), Rgb::splat((1.0 / (1.0 + 4.0 * r * r).sqrt()) as f32), 1e-6);
        }
    }
}

#[test]
fn a_lamp_on_a_ceiling_shines_at_every_angle() {
    // 0.5488 is not a number of f32: the ceiling's plane lies 8e-9 below the lamp of the file.
    let height = 0.5488;
    let mut scene = empty_scene();
    let corner = DVec3::new(-1.0, height, -1.0).as_vec3();
    add_mesh(&mut scene, rectangle(corner, Vec3::X * 2.0, Vec3::Z * 2.0), DAffine3::IDENTITY, white());
    add_mesh(
        &mut scene,
        rectangle(Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0),
        DAffine3::IDENTITY,
        white(),
    );
    let lamp = DVec3::new(0.1, height, 0.3);
    add_light(&mut scene, lamp, Rgb::ONE);
    for drop in [0.5, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6] {
        let point = DVec3::new(0.2, height - drop, -1.0);
        look(&mut scene, DVec3::new(0.2, height - 0.3, 0.5), point);
        let n_dot_l = (lamp - point).normalize().z;
        near(pixel(&scene), Rgb::splat(n_dot_l as f32), 1e-6);
    }
}

#[test]
fn spots_and_falloff_follow_their_definitions() {
    let mut scene = empty_scene();
    add_wall(&mut scene, white());
    let spot = |angle: f64| {
        // The axis misses the lit point by `angle`.
        let (sin, cos) = angle.to_radians().sin_cos();
        Light {
            name: "spot".into(),
            kind: LightKind::Spot {
                position: DVec3::new(0.0, 0.0, 2.0),
                direction: DVec3::new(sin, 0.0, -cos),
                inner_angle: 10f64.to_radians(),
                outer_angle: 20f64.to_radians(),
                falloff: whitted::scene::Falloff::InverseSquare,
            },
            color: Rgb::splat(8.0),
        }
    };
    for (angle, share) in [
        (5.0, 1.0),
        (25.0, 0.0),
        (15.0, {
            let c = |a: f64| a.to_radians().cos();
            let ramp = (c(15.0) - c(20.0)) / (c(10.0) - c(20.0));
            ramp * ramp
        }),
    ] {
        scene.lights = vec![spot(angle)];
        near(pixel(&scene), Rgb::splat((share * 8.0 / 4.0) as f32), 1e-6);
    }
    scene.lights = vec![Light {
        name: "sun".into(),
        kind: LightKind::Directional { direction: DVec3::new(0.0, -3.0, -4.0) },
        color: Rgb::ONE,
    }];
    near(pixel(&scene), Rgb::splat(0.8), 1e-7);
}

/// A ray tracer of its own for one plane and two spheres, in f64, written from the seed's page alone.
mod seed {
    use super::*;

    pub struct Surface {
        pub center: Option<(DVec3, f64)>,
        pub oa: DVec3,
        pub od: DVec3,
        pub os: DVec3,
        pub ks: f64,
        pub n: i32,
    }

    pub const LIGHTS: [(DVec3, DVec3); 2] = [
        (DVec3::new(4.0, 6.0, 5.0), DVec3::new(0.7, 0.7, 0.6)),
        (DVec3::new(-5.0, 3.0, 4.0), DVec3::new(0.2, 0.3, 0.4)),
    ];

    pub fn surfaces() -> Vec<Surface> {
        let s = |center, oa: f64, od: DVec3, ks, n| Surface { center, oa: od * oa, od, os: DVec3::ONE, ks, n };
        vec![
            s(None, 0.1, DVec3::new(0.5, 0.5, 0.4), 0.2, 5),
            s(Some((DVec3::new(-1.1, 1.0, 0.0), 1.0)), 0.1, DVec3::new(0.6, 0.2, 0.1), 0.4, 20),
            s(Some((DVec3::new(1.2, 0.75, 0.5), 0.75)), 0.2, DVec3::new(0.1, 0.3, 0.6), 0.0, 1),
        ]
    }

    fn meet(surface: &Surface, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        match surface.center {
            None => (o.y > 1e-9 && d.y < 0.0).then(|| (-o.y / d.y, DVec3::Y)),
            Some((center, radius)) => {
                let oc = o - center;
                let b = oc.dot(d);
                let discriminant = b * b - (oc.dot(oc) - radius * radius);
                let t = -b - discriminant.max(0.0).sqrt();
                (discriminant > 0.0 && t > 1e-9).then(|| (t, (oc + d * t) / radius))
            }
        }
    }

    pub fn trace(o: DVec3, d: DVec3, depth: u32) -> DVec3 {
        let surfaces = surfaces();
        let hits = surfaces.iter().filter_map(|s| meet(s, o, d).map(|(t, n)| (t, n, s)));
        let Some((t, n, s)) = hits.min_by(|a, b| a.0.total_cmp(&b.0)) else { return DVec3::ZERO };
        let p = o + d * t;
        let mut color = s.oa;
        for (position, intensity) in LIGHTS {
            let l = (position - p).normalize();
            let nl = n.dot(l);
            if nl > 0.0
                && !surfaces
                    .iter()
                    .any(|other| meet(other, p + n * 1e-9, l).is_some_and(|(t, _)| t < (position - p).length()))
            {
                let r = n * (2.0 * nl) - l;
                color += intensity * (s.od * nl + s.os * (s.ks * r.dot(-d).max(0.0).powi(s.n)));
            }
        }
        if depth < 5 && s.ks > 0.0 {
            let r = d - n * (2.0 * n.dot(d));
            color += trace(p + n * 1e-9, r, depth + 1) * s.ks;
        }
        color.min(DVec3::ONE)
    }
}

#[test]
fn a_whole_picture_agrees_with_the_seeds_formula_to_a_millionth() {
    let (viewpoint, lower_left) = (DVec3::new(0.0, 2.0, 7.0), DVec3::new(-2.4, -0.2, 3.0));
    let (lower_right, upper_left) = (DVec3::new(2.4, -0.2, 3.0), DVec3::new(-2.4, 3.4, 3.0));
    let (width, height) = (64u32, 48u32);
    let mut scene = empty_scene();
    let camera = Camera::FourPoint { viewpoint, lower_left, lower_right, upper_left };
    scene.cameras = vec![NamedCamera::new("seed", camera)];
    scene.film =
        FilmSettings { width, height, samples: 1, max_depth: 5, clamp: Clamp::Shade, ..FilmSettings::default() };
    for s in seed::surfaces() {
        let ks = Rgb::splat(s.ks as f32);
        let material = Material {
            ambient: Some(s.oa.as_vec3()),
            diffuse: s.od.as_vec3(),
            specular: s.os.as_vec3(),
            ks,
            kr: ks,
            shininess: s.n as f32,
            ..black()
        };
        match s.center {
            None => add_quadric(&mut scene, shapes::plane(None), DAffine3::IDENTITY, material),
            Some((center, radius)) => add_quadric(&mut scene, shapes::sphere(), placed(center, radius), material),
        }
    }
    for (position, color) in seed::LIGHTS {
        add_light(&mut scene, position, color.as_vec3());
    }
    let film = render(&scene);
    let mut worst = 0.0f64;
    for row in 0..height {
        for i in 0..width {
            let j = height - 1 - row;
            let p = lower_left
                + (lower_right - lower_left) * (f64::from(i) / f64::from(width - 1))
                + (upper_left - lower_left) * (f64::from(j) / f64::from(height - 1));
            let expected = seed::trace(viewpoint, (p - viewpoint).normalize(), 0);
            let got = Vec3::from_array(film.color[(row * width + i) as usize]).as_dvec3();
            worst = worst.max((got - expected).abs().max_element());
        }
    }
    assert!(worst <= 1e-6, "off by {worst}");
    assert!(film.stats.rays.reflected > 100 && film.stats.rays.shadow > 1000, "{:?}", film.stats.rays);
}
