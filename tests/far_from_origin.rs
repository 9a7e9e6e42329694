//! A model far from zero, or of another size by far, renders like the same model near it.

use std::fmt::Write;
use std::path::Path;

use glam::{DVec3, Vec3};
use whitted::accel::{Kind, Params};
use whitted::formats::{LoadOptions, Loaded, Treatment, UpAxis, open};
use whitted::progress::Silent;
use whitted::render::{Film, RenderSettings, Renderer};

use crate::common::sphere_mesh;

/// A ball around `center` as an OBJ with the digits that f64 has.
fn ball(folder: &Path, center: DVec3, radius: f64) -> std::path::PathBuf {
    let mesh = sphere_mesh(1.0, DVec3::ZERO, 12, 24);
    let mut text = String::new();
    for p in &mesh.positions {
        let p = p.as_dvec3() * radius + center;
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for [a, b, c] in &mesh.indices {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).unwrap();
    }
    let path = folder.join(format!("{} {radius}.obj", center.x));
    std::fs::write(&path, text).unwrap();
    path
}

fn render(path: &Path) -> (Film, DVec3, u64) {
    let mut loaded = open(path, &LoadOptions::default(), &Silent).unwrap();
    (loaded.scene.film.width, loaded.scene.film.height, loaded.scene.film.samples) = (64, 48, 1);
    let origin = loaded.scene.origin;
    let renderer = Renderer::build(loaded.scene, &Params::default(), &Silent).unwrap();
    (renderer.render(&RenderSettings::default(), &Silent).unwrap(), origin, renderer.build_stats().top_level_bytes)
}

#[test]
fn a_ball_in_map_coordinates_looks_like_one_at_zero() {
    let folder = tempfile::tempdir().unwrap();
    let (near, origin, bytes) = render(&ball(folder.path(), DVec3::ZERO, 1.0));
    assert_eq!(origin, DVec3::ZERO);
    // On the grid of the origin the same numbers come out, and so the same picture.
    let (far, origin, far_bytes) = render(&ball(folder.path(), DVec3::new(4_512_344.0, 1024.0, 5_432_104.0), 1.0));
    assert_eq!((origin, bytes), (DVec3::new(4_512_344.0, 1024.0, 5_432_104.0), far_bytes));
    assert!(far.stats.rays.shadow > 500);
    let differ = near.color.iter().zip(&far.color).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 1e-6));
    assert_eq!(differ.count(), 0);
    // Off the grid only rounding differs.
    let (far, origin, _) = render(&ball(folder.path(), DVec3::new(4_512_345.123, 1000.1, 5_432_100.987), 1.0));
    assert!((origin - DVec3::new(4_512_345.123, 1000.1, 5_432_100.987)).abs().max_element() <= 2.0, "{origin}");
    let differ = near.color.iter().zip(&far.color).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 0.01));
    assert!(differ.count() <= 3, "a pixel at an edge may fall on its other side");
}

#[test]
fn a_ball_of_any_size_looks_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (usual, ..) = render(&ball(folder.path(), DVec3::ZERO, 1.0));
    for exponent in [-80, -45, -30, 30, 45, 60, 100] {
        let (film, origin, _) = render(&ball(folder.path(), DVec3::ZERO, libm::ldexp(1.0, exponent)));
        assert_eq!(origin, DVec3::ZERO);
        let difference = |(a, b): (&[f32; 3], &[f32; 3])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-6);
        let differ = usual.color.iter().zip(&film.color).filter(|&pair| difference(pair)).count();
        assert!(differ <= 3, "2^{exponent}: {differ} pixels differ");
    }
}

/// Where maps have their numbers: east, north and height in metres, all multiples of a power of two.
const ON_GRID: DVec3 = DVec3::new(458_752.0, 5_431_296.0, 64.0);
const OFF_GRID: DVec3 = DVec3::new(456_789.123, 5_432_100.987, 12.3);

/// The pieces of a small site as quads over millimetres (multiples of 2^-10): a slab, a block, and a ramp of steps of one
/// millimetre, each a group of its own.
fn site() -> Vec<(&'static str, Vec<[DVec3; 4]>)> {
    let unit = 1.0 / 1024.0;
    let cuboid = |low: DVec3, high: DVec3| {
        let at = |x: bool, y: bool, z: bool| {
            DVec3::new(if x { high.x } else { low.x }, if y { high.y } else { low.y }, if z { high.z } else { low.z })
        };
        let (f, t) = (false, true);
        vec![
            [at(f, f, f), at(f, t, f), at(t, t, f), at(t, f, f)],
            [at(f, f, t), at(t, f, t), at(t, t, t), at(f, t, t)],
            [at(f, f, f), at(t, f, f), at(t, f, t), at(f, f, t)],
            [at(f, t, f), at(f, t, t), at(t, t, t), at(t, t, f)],
            [at(f, f, f), at(f, f, t), at(f, t, t), at(f, t, f)],
            [at(t, f, f), at(t, t, f), at(t, t, t), at(t, f, t)],
        ]
    };
    let steps = (0..64u32).map(f64::from).flat_map(|i| {
        let near = DVec3::new(-0.5, 0.25 + i * unit, 0.125 + i * unit);
        let edge = |p: DVec3, step: DVec3| [p, p + DVec3::X, p + DVec3::X + step, p + step];
        [edge(near, DVec3::Z * unit), edge(near + DVec3::Z * unit, DVec3::Y * unit)]
    });
    vec![
        ("slab", cuboid(DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.125))),
        ("block", cuboid(DVec3::new(-0.75, -0.5, 0.125), DVec3::new(-0.25, 0.0, 0.5 + unit))),
        ("ramp", steps.collect()),
    ]
}

/// Writes the site, moved, as an OBJ with the digits that f64 has; every quad has corners of its own.
fn write_site(folder: &Path, shift: DVec3) {
    let mut text = String::from("# a stray point that no face uses must not matter\nv 0 0 0\n");
    for (group, quads) in site() {
        writeln!(text, "g {group}").unwrap();
        for corners in quads {
            for p in corners.map(|p| p + shift) {
                writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
            }
            text += "f -4 -3 -2 -1\n";
        }
    }
    std::fs::write(folder.join("site.obj"), text).unwrap();
}

/// A scene file with the site, a turned instance beside it, a sphere on it, a lamp and a camera.
fn write_scene(folder: &Path, shift: DVec3) -> std::path::PathBuf {
    let list = |p: DVec3| format!("[{}, {}, {}]", p.x, p.y, p.z);
    let at = |x: f64, y: f64, z: f64| list(DVec3::new(x, y, z) + shift);
    let text = format!(
        "[camera]\neye = {}\ntarget = {}\nup = [0, 0, 1]\nfov = 40\n\
         [film]\nsize = [96, 72]\nsamples = 1\n\
         [background]\ncolor = [0.2, 0.3, 0.4]\n\
         [[light]]\nkind = \"point\"\nposition = {}\nintensity = 0.7\n\
         [[material]]\nname = \"steel\"\ndiffuse = [0.3, 0.3, 0.3]\nks = [0.4, 0.4, 0.4]\nshininess = 40\n\
         [[object]]\nmesh = \"site.obj\"\n\
         [[object]]\nmesh = \"site.obj\"\n\
         transform = [{{ translate = {} }}, {{ rotate = [0, 0, 30] }}, {{ translate = {} }}]\n\
         [[object]]\nsphere = {{}}\nmaterial = \"steel\"\n\
         transform = [{{ scale = 0.25 }}, {{ translate = {} }}]\n",
        at(1.5, -2.5, 1.75),
        at(0.5, 0.25, 0.25),
        at(-1.0, -1.5, 2.5),
        list(-shift),
        at(2.25, 0.5, 0.0),
        at(0.5, -0.25, 0.375),
    );
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn site_pictures(shift: DVec3) -> Vec<Film> {
    let folder = tempfile::tempdir().unwrap();
    write_site(folder.path(), shift);
    let path = write_scene(folder.path(), shift);
    let loaded = open(&path, &LoadOptions::default(), &Silent).unwrap();
    assert_eq!(warnings(&loaded), Vec::<String>::new());
    let film = |&kind: &Kind| {
        let params = Params { kind, ..Params::default() };
        let renderer = Renderer::build(loaded.scene.clone(), &params, &Silent).unwrap();
        renderer.render(&RenderSettings::default(), &Silent).unwrap()
    };
    Kind::ALL.iter().map(film).collect()
}

fn warnings(loaded: &Loaded) -> Vec<String> {
    let warning = |(treatment, text, _): (Treatment, &str, u64)| (treatment == Treatment::Warning).then(|| text.into());
    loaded.ledger.entries().filter_map(warning).collect()
}

/// Pixels of which a channel differs by more than `most`.
fn differing(a: &Film, b: &Film, most: f32) -> usize {
    let differs = |(a, b): (&[f32; 3], &[f32; 3])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > most);
    a.color.iter().zip(&b.color).filter(|&pair| differs(pair)).count()
}

#[test]
fn a_site_in_map_coordinates_gives_the_bytes_that_it_gives_at_zero() {
    let near = site_pictures(DVec3::ZERO);
    let distinct: std::collections::HashSet<_> = near[0].color.iter().map(|color| color.map(f32::to_bits)).collect();
    let rays = near[0].stats.rays;
    assert!(distinct.len() > 500 && rays.shadow > 2500 && rays.reflected > 100, "{} {rays:?}", distinct.len());
    for (far, &kind) in site_pictures(ON_GRID).iter().zip(Kind::ALL) {
        assert_eq!(far.color, near[0].color, "{kind:?}");
    }
    // Off the grid coordinates are rounded elsewhere: by 6e-8 at most, on pixels of 0.03. Shading follows the point; an
    // edge or the end of a shadow may fall to the other side of a ray.
    for (far, &kind) in site_pictures(OFF_GRID).iter().zip(Kind::ALL) {
        assert!(differing(far, &near[0], 1e-4) <= 5, "{kind:?}: {}", differing(far, &near[0], 1e-4));
    }
}

#[test]
fn coordinates_that_f32_holds_are_brought_near_too() {
    // Whole metres: f32 holds these at 5e6, but neither the camera beside them nor the rays.
    let folder = tempfile::tempdir().unwrap();
    let picture = |shift: DVec3| {
        let mut text = String::new();
        for p in [[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2], [0, 1, 0], [2, 1, 0], [2, 1, 2], [0, 1, 2]] {
            let p = DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])) + shift;
            writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
        }
        text += "f 1 2 3 4\nf 8 7 6 5\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";
        let path = folder.path().join("box.obj");
        std::fs::write(&path, text).unwrap();
        render(&path)
    };
    let (near, origin, _) = picture(DVec3::ZERO);
    assert_eq!(origin, DVec3::ZERO);
    let shift = DVec3::new(4_194_304.0, 64.0, 524_288.0);
    let (far, origin, _) = picture(shift);
    assert_eq!(origin, shift);
    // The automatic camera is found in f64 at each place: its last digits differ.
    assert!(differing(&near, &far, 1e-5) <= 2, "{}", differing(&near, &far, 1e-5));
}

#[test]
fn a_model_that_is_turned_upright_stays_sharp() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |shift: DVec3| {
        write_site(folder.path(), shift);
        let options = LoadOptions { up: UpAxis::Z, ..LoadOptions::default() };
        let mut loaded = open(&folder.path().join("site.obj"), &options, &Silent).unwrap();
        (loaded.scene.film.width, loaded.scene.film.height, loaded.scene.film.samples) = (64, 48, 1);
        let origin = loaded.scene.origin;
        let renderer = Renderer::build(loaded.scene, &Params::default(), &Silent).unwrap();
        (renderer.render(&RenderSettings::default(), &Silent).unwrap(), origin)
    };
    let (near, _) = picture(DVec3::ZERO);
    let (far, origin) = picture(ON_GRID);
    assert_eq!(origin, DVec3::new(ON_GRID.x, ON_GRID.z, -ON_GRID.y));
    assert!(differing(&near, &far, 1e-4) <= 3, "{}", differing(&near, &far, 1e-4));
}

/// A glTF file with one triangle at `corners`, moved by its node.
fn write_gltf(folder: &Path, corners: [Vec3; 3], translation: DVec3) -> std::path::PathBuf {
    let bytes: Vec<u8> = corners.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect();
    std::fs::write(folder.join("a.bin"), bytes).unwrap();
    let document = serde_json::json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": 36, "uri": "a.bin" }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": corners[0].min(corners[1]).min(corners[2]).to_array(),
            "max": corners[0].max(corners[1]).max(corners[2]).to_array() }],
        "meshes": [{ "name": "triangle", "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "nodes": [{ "mesh": 0, "translation": translation.to_array() }],
        "scenes": [{ "nodes": [0] }], "scene": 0
    });
    let path = folder.join("a.gltf");
    std::fs::write(&path, document.to_string()).unwrap();
    path
}

#[test]
fn gltf_far_away_by_its_nodes_or_by_its_vertices_renders_as_at_zero() {
    let folder = tempfile::tempdir().unwrap();
    let corners = [Vec3::ZERO, Vec3::new(2.0, 0.5, 0.0), Vec3::new(0.5, 1.5, 1.0)];
    let (near, ..) = render(&write_gltf(folder.path(), corners, DVec3::ZERO));
    assert!(near.color.iter().any(|color| *color != near.color[0]));
    let by_node = [ON_GRID, OFF_GRID, DVec3::new(4_194_304.0, 0.0, 0.0)];
    for translation in by_node {
        let (far, origin, _) = render(&write_gltf(folder.path(), corners, translation));
        assert!((origin - translation).abs().max_element() < 4.0, "{origin}");
        assert!(differing(&near, &far, 1e-4) <= 2, "{translation}: {}", differing(&near, &far, 1e-4));
    }
    let shift = Vec3::new(4_194_304.0, 0.0, 524_288.0);
    let (far, origin, _) = render(&write_gltf(folder.path(), corners.map(|p| p + shift), DVec3::ZERO));
    assert_eq!(origin, shift.as_dvec3());
    assert!(differing(&near, &far, 1e-4) <= 2, "{}", differing(&near, &far, 1e-4));
}

#[test]
fn a_loss_beyond_the_finest_edge_is_told_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let fine = |far: f64| {
        let text = format!(
            "v {far} 0 0\nv {} 0 0\nv {far} 0.001 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n",
            far + 0.001
        );
        std::fs::write(&path, text).unwrap();
        let loaded = open(&path, &LoadOptions::default(), &Silent).unwrap();
        (loaded.scene.meshes[0].rounding, warnings(&loaded))
    };
    // Two parts of one file 1e6 apart: f32 holds sixteenths there.
    let (rounding, told) = fine(1_000_000.03);
    assert!((rounding.largest_loss - 0.03).abs() < 0.0011, "{rounding:?}");
    assert!((rounding.finest_edge.unwrap() - 0.001).abs() < 1e-9, "{rounding:?}");
    assert_eq!(told.len(), 1);
    assert!(told[0].starts_with("`a` loses detail: coordinates are stored up to 3."), "{told:?}");
    // A hundred away the loss is a thousandth of the edge.
    let (rounding, told) = fine(100.03);
    assert!(rounding.largest_loss > 0.0 && rounding.largest_loss < 1e-5 && told.is_empty(), "{rounding:?} {told:?}");
}
