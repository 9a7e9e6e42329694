//! A model far from zero, or of another size by far, renders like the same model near it.

use std::fmt::Write;
use std::path::Path;

use glam::DVec3;
use whitted::accel::Params;
use whitted::formats::{LoadOptions, open};
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
