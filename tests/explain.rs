//! Explanations of pixels: terms that add up to the picture's bits, and what they say in scenes where that is known.

use std::collections::BTreeSet;
use std::path::Path;

use glam::{DAffine3, DVec2, DVec3, Vec3};
use whitted::accel::{Kind, Params};
use whitted::error::Fault;
use whitted::formats::{self, LoadOptions};
use whitted::geometry::shapes;
use whitted::progress::Silent;
use whitted::render::explain::{
    Arrival, BackgroundKind, Dark, End, Explanation, LightTerm, Lighting, RayNode, Samples, Surface, Term, Way,
};
use whitted::render::explain::{MOST_RECORDS, replay};
use whitted::render::trace::Tracer;
use whitted::render::{Crop, RenderSettings, Renderer};
use whitted::scene::detail::{Alpha, AlphaMode, Detail};
use whitted::scene::film::LARGEST_DEPTH;
use whitted::scene::{Background, Camera, Clamp, Falloff, Light, LightKind, Material, NamedCamera, Rgb, Scene};

use crate::common::*;

fn scene_file(name: &str) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    formats::open(&file, &LoadOptions::default(), &Silent).unwrap().scene
}

fn build(scene: Scene) -> Renderer {
    Renderer::build(scene, &Params::default(), &Silent).unwrap()
}

fn bits(color: Rgb) -> [u32; 3] {
    color.to_array().map(f32::to_bits)
}

fn all(renderer: &Renderer, x: u32, y: u32) -> Explanation {
    renderer.explain(x, y, Samples::All, &Silent).unwrap()
}

/// The rays of the one sample of a scene's one pixel.
fn rays(scene: &Scene) -> Vec<RayNode> {
    let explanation = all(&build(scene.clone()), 0, 0);
    assert_eq!(bits(explanation.color), bits(pixel(scene)));
    explanation.samples.into_iter().next().unwrap().rays.unwrap()
}

fn surface(ray: &RayNode) -> &Surface {
    match &ray.end {
        End::Surface(surface) => surface,
        End::Background { .. } => panic!("{ray:?} hits nothing"),
    }
}

fn lights(surface: &Surface) -> Vec<&LightTerm> {
    let mut lights = Vec::new();
    for term in &surface.terms {
        if let Term::Light(light) = term {
            lights.push(light);
        }
    }
    lights
}

fn arrival(light: &LightTerm) -> &Arrival {
    match &light.lighting {
        Lighting::Shines(arrival) => arrival,
        Lighting::Dark(dark) => panic!("`{}` is dark: {dark:?}", light.light),
    }
}

/// What explanations spoke of.
type Seen = BTreeSet<&'static str>;

fn note(seen: &mut Seen, ray: &RayNode) {
    seen.insert(match ray.way {
        Way::Camera => "camera",
        Way::Reflected => "reflected",
        Way::Refracted => "refracted",
        Way::TotalReflection => "total",
    });
    seen.extend((!ray.holes.is_empty()).then_some("hole"));
    let End::Surface(surface) = &ray.end else {
        seen.insert("background");
        return;
    };
    seen.extend((!surface.from_outside).then_some("inside"));
    for term in &surface.terms {
        match term {
            Term::Absorbed { left, .. } => seen.extend((*left != Rgb::ONE).then_some("absorbed")),
            Term::Clamped { from, to } => seen.extend((from != to).then_some("clamped")),
            Term::Emission { color } => seen.extend((*color != Rgb::ZERO).then_some("emission")),
            Term::Seen { ray: None, .. } => seen.extend(["depth"]),
            Term::Light(LightTerm { lighting: Lighting::Dark(dark), .. }) => seen.extend([match dark {
                Dark::Behind { .. } => "behind",
                Dark::OutsideCone => "outside cone",
                Dark::AtThePoint => "at the point",
                Dark::TooBright => "too bright",
            }]),
            Term::Light(LightTerm { lighting: Lighting::Shines(arrival), added, .. }) => {
                let is_blocked = arrival.blocked_by.is_some();
                assert_eq!(is_blocked, arrival.visible == Rgb::ZERO, "{arrival:?}");
                assert!(!is_blocked || *added == Rgb::ZERO);
                seen.insert(if is_blocked { "blocked" } else { "lit" });
                seen.extend(arrival.specular.is_some().then_some("specular"));
                seen.extend((!arrival.crossed.is_empty()).then_some("crossed"));
                seen.extend(arrival.crossed.iter().any(|crossing| crossing.left.is_some()).then_some("left"));
            }
            Term::Ambient { .. } | Term::Seen { .. } => {}
        }
    }
}

/// Explains pixels of a small picture all over: each ray's terms add up to its colour, each sample is what the recursion
/// sees, and the pixel is that of the film, rendered as a whole and alone.
fn check(mut scene: Scene, step: u32, name: &str) -> Seen {
    (scene.film.width, scene.film.height, scene.film.samples) = (41, 27, 3);
    let renderer = build(scene);
    let film = renderer.render(&RenderSettings::default(), &Silent).unwrap();
    let scene = renderer.scene();
    let camera = scene.camera().rays(41, 27, scene.origin).unwrap();
    let tracer = Tracer::new(scene, renderer.world(), &renderer);
    let mut seen = Seen::new();
    for number in (0..41 * 27).step_by(step as usize) {
        let (x, y) = (number % 41, number / 41);
        let explanation = all(&renderer, x, y);
        let at = format!("{name}, pixel {x}, {y}");
        assert_eq!(explanation.samples.len(), 3);
        for sample in &explanation.samples {
            let rays = sample.rays.as_ref().unwrap();
            for (number, (ray, again)) in rays.iter().zip(replay(rays)).enumerate() {
                assert_eq!(bits(ray.color), bits(again), "{at}, ray {number}: {ray:?}");
                assert!(ray.parent.is_none_or(|parent| parent < number), "{at}");
                note(&mut seen, ray);
            }
            assert_eq!(sample.replay().map(bits), Some(bits(sample.color)), "{at}");
            let place = DVec2::new(x.into(), y.into()) + sample.position;
            let traced = tracer.trace(&whitted::render::trace::TracedRay::camera(camera.ray(place).unwrap()), 0);
            assert_eq!(bits(sample.color), bits(traced), "{at}");
        }
        assert_eq!(bits(explanation.color), film.color[number as usize].map(f32::to_bits), "{at}");
        assert_eq!(bits(explanation.replay()), bits(explanation.color), "{at}");
        assert_eq!(explanation.alpha, film.alpha.as_ref().map(|alpha| alpha[number as usize]), "{at}");
        if number % 7 == 0 {
            let crop = Some(Crop { x0: x, y0: y, x1: x + 1, y1: y + 1 });
            let alone = renderer.render(&RenderSettings { crop, ..Default::default() }, &Silent).unwrap();
            assert_eq!(bits(explanation.color), alone.color[0].map(f32::to_bits), "{at}, alone");
        }
    }
    seen
}

#[test]
fn terms_add_up_to_the_bits_of_the_picture() {
    let shown = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")).unwrap();
    let shown = shown.map(|entry| format!("scenes/{}", entry.unwrap().file_name().to_string_lossy()));
    // The mesh of the terrain is made by an example and not always there.
    let has_mesh = |name: &String| !name.ends_with("terrain.toml") || Path::new("meshes/terrain.glb").exists();
    let shown: Vec<String> = shown.filter(|name| name.ends_with(".toml")).filter(has_mesh).collect();
    assert!(shown.len() >= 7, "{shown:?}");
    let golden = ["spot_cone", "orthographic", "instances", "normals", "gltf_import", "transparent_shadow"];
    let more = ["total_internal_reflection", "transparent_background", "panorama", "refraction"];
    let golden = golden.into_iter().chain(more).map(|name| format!("tests/golden/{name}.toml"));
    let mut seen = Seen::new();
    for (number, name) in shown.into_iter().chain(golden).enumerate() {
        for clamp in [Clamp::Shade, Clamp::Output] {
            let mut scene = scene_file(&name);
            scene.film.clamp = clamp;
            seen.extend(check(scene, if number % 2 == 0 { 5 } else { 6 }, &format!("{name}, {clamp:?}")));
        }
    }
    let told = ["camera", "reflected", "refracted", "total", "background", "inside", "clamped", "depth", "behind"];
    for what in told.into_iter().chain(["outside cone", "blocked", "lit", "specular", "crossed"]) {
        assert!(seen.contains(what), "no {what} among {seen:?}");
    }
}

#[test]
fn details_holes_and_absorption_add_up_too() {
    for clamp in [Clamp::Shade, Clamp::Output] {
        let mut scene = crate::detail::everything();
        scene.film.clamp = clamp;
        let seen = check(scene, 1, &format!("detail, {clamp:?}"));
        for what in ["hole", "absorbed", "left", "crossed", "emission", "inside"] {
            assert!(seen.contains(what), "no {what} among {seen:?}");
        }
        let mut scene = crate::detail::coloured_and_plain_squares(100);
        scene.film.clamp = clamp;
        check(scene, 3, "squares");
    }
}

/// A replay that did not look at the terms would be of no use.
#[test]
fn a_changed_bit_of_a_term_is_noticed() {
    let mut scene = scene_file("scenes/glass_over_checker.toml");
    (scene.film.width, scene.film.height, scene.film.samples) = (41, 27, 1);
    let rays = all(&build(scene), 20, 13).samples.swap_remove(0).rays.unwrap();
    let deepest = rays.iter().rposition(|ray| matches!(ray.end, End::Surface(_))).unwrap();
    assert!(rays.len() > 8 && deepest > 0);
    let up = |value: &mut Rgb| *value *= 1.001;
    for number in [0, deepest] {
        let count = surface(&rays[number]).terms.len();
        let mut noticed = 0;
        for term in 0..count {
            let mut changed = rays.clone();
            let End::Surface(surface) = &mut changed[number].end else { unreachable!() };
            match &mut surface.terms[term] {
                Term::Ambient { color } | Term::Emission { color } => up(color),
                Term::Light(LightTerm { lighting: Lighting::Shines(arrival), .. }) => up(&mut arrival.color),
                Term::Seen { weight, .. } => up(weight),
                _ => continue,
            }
            noticed += usize::from(bits(replay(&changed)[number]) != bits(rays[number].color));
        }
        assert!(noticed > 0, "ray {number} of {count} terms");
    }
}

#[test]
fn every_structure_is_explained_alike() {
    let mut scene = scene_file("scenes/mirrors.toml");
    (scene.film.width, scene.film.height, scene.film.samples) = (41, 27, 2);
    let explain = |kind| {
        let renderer = Renderer::build(scene.clone(), &Params { kind, ..Params::default() }, &Silent).unwrap();
        renderer.explain(20, 14, Samples::All, &Silent).unwrap()
    };
    let first = explain(Kind::Auto);
    for kind in Kind::ALL {
        assert_eq!(explain(*kind), first, "{kind:?}");
    }
}

#[test]
fn the_shadow_of_the_red_sphere_is_its() {
    // The ground where the line from the light through the sphere's middle meets it, through the seed's camera.
    let (light, center) = (DVec3::new(4.0, 7.0, 6.0), DVec3::new(-1.6, 1.0, 0.0));
    let renderer = build(scene_file("scenes/seed_camera.toml"));
    let explanation = all(&renderer, 158, 335);
    let ray = &explanation.samples[0].rays.as_ref().unwrap()[0];
    let surface = surface(ray);
    assert_eq!((surface.found.object.as_str(), surface.found.material.as_str()), ("ground/box", "ground"));
    assert!(surface.from_outside && surface.normal == DVec3::Y && surface.point.y == 0.0);
    let expected = DVec3::new(-2.533, 0.0, -1.0);
    assert!((surface.point - expected).length() < 0.05, "{}", surface.point);

    let lights = lights(surface);
    assert_eq!(lights.len(), 1);
    let arrival = arrival(lights[0]);
    let blocker = arrival.blocked_by.as_ref().unwrap();
    assert_eq!((blocker.found.object.as_str(), blocker.found.instance), ("red sphere", 0));
    assert_eq!((arrival.visible, lights[0].added), (Rgb::ZERO, Rgb::ZERO));
    // |p + t (l - p) - c| = 1
    let (way, from) = (light - surface.point, surface.point - center);
    let (a, b, c) = (way.dot(way), way.dot(from), from.dot(from) - 1.0);
    let t = (-b - (b * b - a * c).sqrt()) / a;
    assert!((f64::from(blocker.found.t) - t).abs() < 1e-5, "{} is not {t}", blocker.found.t);
    assert!((blocker.distance - t * way.length()).abs() < 1e-4 && arrival.distance == Some(way.length()));
    assert!((arrival.n_dot_l - way.normalize().y).abs() < 1e-12);
    // What is left is the ground's own colour.
    assert_eq!(explanation.color, Rgb::splat(0.05));
}

#[test]
fn a_mirror_shows_a_reflected_ray_until_the_depth_ends() {
    let mut scene = scene_file("scenes/mirrors.toml");
    scene.film.samples = 1;
    let renderer = build(scene.clone());
    // The middle of the left mirror, with nothing before it.
    let explanation = all(&renderer, 250, 260);
    let rays = explanation.samples[0].rays.as_ref().unwrap();
    let first = surface(&rays[0]);
    assert_eq!((first.found.object.as_str(), first.found.material.as_str()), ("left mirror", "mirror"));
    assert_eq!(rays[1].way, Way::Reflected);
    assert_eq!((rays[1].parent, rays[1].depth, rays[1].origin), (Some(0), 1, first.point));
    let mirrored = rays[0].direction * DVec3::new(-1.0, 1.0, 1.0);
    assert!((rays[1].direction - mirrored).length() < 1e-12, "{} is not {mirrored}", rays[1].direction);
    let kr = Rgb::new(0.86, 0.93, 0.89);
    let branch = |surface: &Surface| surface.terms.iter().find(|term| matches!(term, Term::Seen { .. })).cloned();
    let expected = Term::Seen { way: Way::Reflected, weight: kr, ray: Some(1), added: kr * rays[1].color };
    assert_eq!(branch(first), Some(expected));
    let last = rays.last().unwrap();
    assert!(rays.len() > 2 && last.depth == rays.len() as u32 - 1, "each mirror sends one ray on");

    scene.film.max_depth = 0;
    let explanation = all(&build(scene), 250, 260);
    let rays = explanation.samples[0].rays.as_ref().unwrap();
    let ended = Term::Seen { way: Way::Reflected, weight: kr, ray: None, added: Rgb::ZERO };
    assert_eq!((rays.len(), branch(surface(&rays[0]))), (1, Some(ended)));
}

#[test]
fn glass_reflects_and_refracts_by_snells_law() {
    let mut scene = scene_file("scenes/glass_over_checker.toml");
    scene.film.samples = 1;
    let renderer = build(scene);
    let explanation = all(&renderer, 440, 200);
    let rays = explanation.samples[0].rays.as_ref().unwrap();
    let first = surface(&rays[0]);
    assert_eq!((first.found.object.as_str(), first.from_outside), ("ball", true));
    let ways: Vec<_> = rays.iter().filter(|ray| ray.parent == Some(0)).map(|ray| ray.way).collect();
    assert_eq!(ways, [Way::Reflected, Way::Refracted]);
    let inner = rays.iter().find(|ray| ray.parent == Some(0) && ray.way == Way::Refracted).unwrap();
    let sine = |direction: DVec3| direction.cross(first.normal).length();
    assert!((sine(rays[0].direction) - 1.5 * sine(inner.direction)).abs() < 1e-12);
    assert_eq!((surface(inner).found.object.as_str(), surface(inner).from_outside), ("ball", false));
}

#[test]
fn light_comes_through_glass_by_the_surfaces_it_crosses() {
    let mut scene = scene_file("scenes/glass_over_checker.toml");
    (scene.film.width, scene.film.height, scene.film.samples) = (96, 54, 1);
    let renderer = build(scene);
    let mut found = 0;
    for number in 0..96 * 54 {
        let explanation = all(&renderer, number % 96, number / 96);
        let ray = &explanation.samples[0].rays.as_ref().unwrap()[0];
        let End::Surface(surface) = &ray.end else { continue };
        let Lighting::Shines(arrival) = &lights(surface)[0].lighting else { continue };
        let names: Vec<_> = arrival.crossed.iter().map(|crossing| crossing.stop.found.object.as_str()).collect();
        if surface.found.object != "floor" || names != ["ball", "ball"] {
            continue;
        }
        found += 1;
        assert_eq!(arrival.visible, Rgb::splat(0.86f32 * 0.86));
        let at: Vec<f32> = arrival.crossed.iter().map(|crossing| crossing.stop.found.t).collect();
        assert!(at[0] > 0.0 && at[0] < at[1] && at[1] < 1.0, "{at:?}");
    }
    assert!(found > 20, "{found} points in the shadow of the ball");
}

#[test]
fn both_clamps_are_told() {
    let mut scene = empty_scene();
    let bright = Material { emission: Rgb::new(2.0, 0.5, 0.0), ambient: Some(Rgb::splat(0.25)), ..black() };
    add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, bright);
    let sum = Rgb::new(2.25, 0.75, 0.25);
    for (clamp, seen) in [(Clamp::Shade, Rgb::new(1.0, 0.75, 0.25)), (Clamp::Output, sum)] {
        scene.film.clamp = clamp;
        let rays = rays(&scene);
        let clamped = Term::Clamped { from: sum, to: seen };
        assert_eq!(surface(&rays[0]).terms.contains(&clamped), clamp == Clamp::Shade, "{clamp:?}");
        assert_eq!(rays[0].color, seen);
    }
}

#[test]
fn holes_are_passed_by_eyes_and_by_light() {
    let mut scene = empty_scene();
    scene.film.clamp = Clamp::Output;
    add_quadric(&mut scene, shapes::plane(None), DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2), white());
    let alpha = Some(Alpha { mode: AlphaMode::Mask { cutoff: 0.5 }, factor: 0.2, map: None });
    let masked = Material { detail: Some(Box::new(Detail { alpha, ..Detail::NONE })), ..white() };
    let square = |z: f32| rectangle(Vec3::new(-1.0, -1.0, z), Vec3::X * 2.0, Vec3::Y * 2.0);
    add_mesh(&mut scene, square(2.0), DAffine3::IDENTITY, masked);
    add_light(&mut scene, DVec3::new(0.25, 0.5, 4.0), Rgb::ONE);
    // Beside the diagonal between the square's triangles.
    look(&mut scene, DVec3::new(0.3, 0.1, 5.0), DVec3::new(0.3, 0.1, 0.0));
    let rays = rays(&scene);
    assert_eq!(rays[0].holes.len(), 1);
    assert_eq!((rays[0].holes[0].instance, rays[0].holes[0].t), (1, 3.0));
    let wall = surface(&rays[0]);
    assert_eq!(wall.found.instance, 0);
    let arrival = arrival(lights(wall)[0]);
    assert_eq!(arrival.visible, Rgb::ONE);
    let crossed: Vec<_> = arrival.crossed.iter().map(|c| (c.stop.found.instance, c.stop.found.t, c.passes)).collect();
    assert_eq!(crossed, [(1, 0.5, Rgb::ONE)], "half the way to the light");
    assert!((arrival.crossed[0].stop.distance - 0.5 * arrival.distance.unwrap()).abs() < 1e-12);
}

#[test]
fn absorption_is_told_of_rays_and_of_light() {
    let mut scene = empty_scene();
    scene.film.clamp = Clamp::Output;
    let absorption = Rgb::new(0.1, 0.5, 0.0);
    let glass = Material { kt: Rgb::ONE, ior: 1.0, absorption, ..black() };
    add_mesh(&mut scene, cube(), DAffine3::IDENTITY, glass);
    let floor = DAffine3::from_translation(DVec3::Z * -3.0) * DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    add_quadric(&mut scene, shapes::plane(None), floor, white());
    add_light(&mut scene, DVec3::new(0.1, 0.2, 9.0), Rgb::ONE);
    look(&mut scene, DVec3::new(0.1, 0.2, 5.0), DVec3::new(0.1, 0.2, 0.0));
    let rays = rays(&scene);
    assert_eq!(rays.len(), 3, "into the cube, out of it, to the floor");
    let two = absorption.to_array().map(|a| (-f64::from(a) * 2.0).exp() as f32);
    let absorbed = surface(&rays[1]).terms.iter().find_map(|term| match term {
        Term::Absorbed { length, left } => Some((*length, *left)),
        _ => None,
    });
    let (length, left) = absorbed.unwrap();
    assert!((length - 2.0).abs() < 1e-9, "{length}");
    near(left, Rgb::from_array(two), 1e-6);
    let arrival = arrival(lights(surface(&rays[2]))[0]);
    assert_eq!(arrival.crossed.len(), 2);
    assert_eq!((arrival.crossed[0].length, arrival.crossed[0].left), (None, None), "light comes into this side last");
    near(arrival.crossed[1].left.unwrap(), Rgb::from_array(two), 1e-5);
    near(arrival.visible, Rgb::from_array(two), 1e-5);
}

#[test]
fn lights_that_do_not_shine_say_why() {
    let mut scene = empty_scene();
    add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, white());
    let spot = |direction| LightKind::Spot {
        position: DVec3::Z * 3.0,
        direction,
        inner_angle: 0.2,
        outer_angle: 0.2,
        falloff: Falloff::None,
    };
    let kinds = [
        LightKind::Directional { direction: DVec3::Z },
        spot(DVec3::Z),
        spot(DVec3::NEG_Z),
        LightKind::Point { position: DVec3::Z, falloff: Falloff::None },
        LightKind::Point { position: DVec3::Z * (1.0 + 1e-10), falloff: Falloff::InverseSquare },
    ];
    for (number, kind) in kinds.into_iter().enumerate() {
        scene.lights.push(Light { name: format!("lamp {number}"), kind, color: Rgb::splat(1e30) });
    }
    let rays = rays(&scene);
    let lights = lights(surface(&rays[0]));
    let names: Vec<&str> = lights.iter().map(|light| light.light.as_str()).collect();
    assert_eq!(names, ["lamp 0", "lamp 1", "lamp 2", "lamp 3", "lamp 4"]);
    let dark = |number: usize| match &lights[number].lighting {
        Lighting::Dark(dark) => *dark,
        Lighting::Shines(arrival) => panic!("{arrival:?}"),
    };
    assert_eq!(dark(0), Dark::Behind { n_dot_l: -1.0 });
    assert_eq!(dark(1), Dark::OutsideCone);
    assert_eq!(arrival(lights[2]).visible, Rgb::ONE);
    assert_eq!(dark(3), Dark::AtThePoint);
    assert_eq!(dark(4), Dark::TooBright);
}

#[test]
fn places_are_in_the_files_coordinates() {
    let far = DVec3::new(1e6, -2e6, 3e6);
    let mut scene = empty_scene();
    let place = DAffine3::from_translation(far);
    add_quadric(&mut scene, shapes::sphere(), place, white());
    look(&mut scene, far + DVec3::Z * 5.0, far);
    scene.origin = whitted::scene::origin::choose(&scene);
    assert_ne!(scene.origin, DVec3::ZERO);
    let rays = rays(&scene);
    assert!((rays[0].origin - far - DVec3::Z * 5.0).length() < 1e-9, "{}", rays[0].origin);
    assert!((surface(&rays[0]).point - far - DVec3::Z).length() < 1e-6, "{}", surface(&rays[0]).point);
}

#[test]
fn what_lies_behind_everything_is_named() {
    let mut scene = empty_scene();
    let backgrounds = [
        (Background::Color(Rgb::splat(0.5)), BackgroundKind::Color, 0.5),
        (Background::Gradient { bottom: Rgb::ZERO, top: Rgb::ONE, up: DVec3::Y }, BackgroundKind::Gradient, 0.5),
        (Background::Transparent, BackgroundKind::Transparent, 0.0),
    ];
    for (background, kind, value) in backgrounds {
        let is_transparent = kind == BackgroundKind::Transparent;
        scene.background = background;
        let explanation = all(&build(scene.clone()), 0, 0);
        let ray = &explanation.samples[0].rays.as_ref().unwrap()[0];
        assert_eq!(ray.end, End::Background { kind, color: Rgb::splat(value) });
        assert_eq!(explanation.alpha, is_transparent.then_some(0.0));
    }
}

#[test]
fn one_sample_can_be_asked_for() {
    let mut scene = scene_file("scenes/quadrics.toml");
    (scene.film.width, scene.film.height, scene.film.samples) = (41, 27, 5);
    let renderer = build(scene);
    let whole = all(&renderer, 20, 12);
    let one = renderer.explain(20, 12, Samples::One(3), &Silent).unwrap();
    assert_eq!((one.color, one.replay()), (whole.color, whole.color));
    for (number, (one, all)) in one.samples.iter().zip(&whole.samples).enumerate() {
        assert_eq!((one.color, one.position), (all.color, all.position));
        assert_eq!(one.rays, all.rays.clone().filter(|_| number == 3));
    }
}

#[test]
fn what_is_not_there_cannot_be_explained() {
    let renderer =
        build(Scene { film: whitted::scene::FilmSettings { samples: 2, ..empty_scene().film }, ..empty_scene() });
    for (x, y) in [(1, 0), (0, 1), (u32::MAX, u32::MAX)] {
        let error = renderer.explain(x, y, Samples::All, &Silent).unwrap_err();
        assert_eq!(error.fault(), Fault::Caller);
        let message = error.to_string();
        assert!(message.contains(&format!("{x},{y}")) && message.contains("1x1"), "{message}");
    }
    let error = renderer.explain(0, 0, Samples::One(2), &Silent).unwrap_err();
    assert_eq!(error.to_string(), "there is no sample 2: pixels have 2; samples are numbered from 0 to 1");
}

/// At the corner of its rectangle that the viewpoint lies in, the seed's camera looks nowhere.
#[test]
fn a_camera_without_a_ray_is_black() {
    let mut scene = empty_scene();
    scene.background = Background::Color(Rgb::ONE);
    (scene.film.width, scene.film.height) = (2, 2);
    let camera = Camera::FourPoint {
        viewpoint: DVec3::ZERO,
        lower_left: DVec3::ZERO,
        lower_right: DVec3::X,
        upper_left: DVec3::Y,
    };
    scene.cameras = vec![NamedCamera::new("corner", camera)];
    let film = render(&scene);
    let renderer = build(scene);
    let blind = all(&renderer, 0, 1);
    assert_eq!((blind.color, blind.replay(), film.color[2]), (Rgb::ZERO, Rgb::ZERO, [0.0; 3]));
    assert_eq!(blind.samples[0].rays, Some(Vec::new()));
    assert_eq!(all(&renderer, 1, 1).color, Rgb::ONE);
}

#[test]
fn the_deepest_recursion_is_explained() {
    let mut scene = empty_scene();
    let mirror = || Material { kr: Rgb::ONE, emission: Rgb::splat(0.25), ..black() };
    add_quadric(&mut scene, shapes::sphere(), DAffine3::from_scale(DVec3::splat(9.0)), mirror());
    (scene.film.clamp, scene.film.max_depth) = (Clamp::Output, LARGEST_DEPTH);
    let rays = rays(&scene);
    assert_eq!(rays.len() as u32, LARGEST_DEPTH + 1);
    assert_eq!(rays[0].color, Rgb::splat(0.25 * rays.len() as f32));
}

#[test]
fn more_than_can_be_told_is_an_error() {
    let mut scene = empty_scene();
    let glass = Material { kr: Rgb::splat(0.5), kt: Rgb::splat(0.5), ..black() };
    add_quadric(&mut scene, shapes::sphere(), DAffine3::IDENTITY, glass);
    let room = Material { kr: Rgb::ONE, ..black() };
    add_quadric(&mut scene, shapes::sphere(), DAffine3::from_scale(DVec3::splat(6.0)), room);
    look(&mut scene, DVec3::new(0.3, 0.2, 5.0), DVec3::new(0.4, 0.1, 0.0));
    scene.film.max_depth = 100;
    let error = build(scene).explain(0, 0, Samples::All, &Silent).unwrap_err();
    assert_eq!(error.fault(), Fault::Limit);
    assert!(error.to_string().contains(&MOST_RECORDS.to_string()), "{error}");
}
