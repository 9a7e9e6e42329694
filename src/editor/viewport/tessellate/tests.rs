use super::*;
use crate::geometry::quadric::Clip;
use crate::geometry::shapes;
use crate::math::random::{hash2, unit};
use crate::math::vector::dot;

const FINENESS: Fineness = Fineness {
    cells: 24,
    near: Extent { min: DVec3::splat(-2.0), max: DVec3::splat(2.0) },
    far: Extent { min: DVec3::splat(-40.0), max: DVec3::splat(40.0) },
};

/// A tilted ellipsoid, cut at one corner of its box.
fn tilted(solid: bool) -> Quadric {
    let clip = Clip { min: DVec3::new(-0.9, -0.6, -2.0), max: DVec3::new(2.0, 2.0, 0.55) };
    Quadric::new([1.0, 2.0, 1.5, 0.3, -0.4, 0.2, 0.1, -0.2, 0.1, -1.0], Some(clip), solid).unwrap()
}

fn all() -> Vec<(&'static str, Quadric)> {
    let endless = |coefficients| Quadric::new(coefficients, None, false).unwrap();
    vec![
        ("sphere", shapes::sphere()),
        ("cylinder", shapes::cylinder(false)),
        ("open cylinder", shapes::cylinder(true)),
        ("cone", shapes::cone(false)),
        ("open cone", shapes::cone(true)),
        ("paraboloid", shapes::paraboloid(false)),
        ("one sheet", shapes::hyperboloid_one_sheet(-1.0, 0.5, false)),
        ("two sheets", shapes::hyperboloid_two_sheets(2.0, false)),
        ("saddle", shapes::saddle(1.0)),
        ("square", shapes::plane(Some(2.0))),
        ("plane", shapes::plane(None)),
        ("tilted", tilted(true)),
        ("tilted, open", tilted(false)),
        ("endless cylinder", endless([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])),
        ("tilted plane", endless([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.5, -0.2, 0.1])),
    ]
}

/// How far over the surface and its caps vertices are from where they should be.
fn off(quadric: &Quadric, p: DVec3) -> f64 {
    let clip = quadric.clip();
    let cap = (0..3).any(|axis| p[axis] == clip.min[axis] || p[axis] == clip.max[axis]);
    let value = quadric.value(p);
    if quadric.is_solid() && cap { value.max(0.0) } else { value.abs() }
}

#[test]
fn vertices_are_on_the_surface_and_in_the_clip_box() {
    for (name, quadric) in all() {
        let mesh = tessellate(&quadric, &FINENESS);
        assert!(mesh.triangles.len() > 100, "{name}: {} triangles", mesh.triangles.len());
        assert_eq!((mesh.positions.len(), mesh.positions.len()), (mesh.normals.len(), mesh.uvs.len()));
        for corner in mesh.triangles.iter().flatten().map(|&corner| corner as usize) {
            let (p, n, uv) = (mesh.positions[corner], mesh.normals[corner], mesh.uvs[corner]);
            let size = 1.0 + dot(p, p);
            assert!(off(&quadric, p) < 1e-13 * size, "{name}: {} at {p}", off(&quadric, p));
            assert!(quadric.clip().min.cmple(p).all() && quadric.clip().max.cmpge(p).all(), "{name}: {p}");
            assert!((length(n) - 1.0).abs() < 1e-12 && uv.is_finite(), "{name}: {p} {n} {uv}");
        }
    }
}

#[test]
fn faces_look_to_where_the_function_is_positive() {
    for (name, quadric) in all() {
        let mesh = tessellate(&quadric, &FINENESS);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let face = cross(b - a, c - a);
            let mean = triangle.iter().fold(DVec3::ZERO, |sum, &corner| sum + mesh.normals[corner as usize]);
            // Slivers turn by the curvature of the surface over their own width.
            if length(face) > 1e-4 {
                assert!(dot(face, mean) > 0.0, "{name}: {a} {b} {c}");
            }
        }
    }
}

#[test]
fn solids_are_closed() {
    for (name, quadric) in all() {
        if !(quadric.is_solid() || name == "sphere") {
            continue;
        }
        let mesh = tessellate(&quadric, &FINENESS);
        let key = |corner: u32| (mesh.positions[corner as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
        let mut edges: HashMap<_, i32> = HashMap::new();
        for triangle in &mesh.triangles {
            let corners = triangle.map(key);
            for k in 0..3 {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        let open = edges.values().filter(|&&balance| balance != 0).count();
        assert_eq!(open, 0, "{name}: {open} of {} edges", edges.len());
    }
}

#[test]
fn areas_and_volumes_are_those_of_the_formulas() {
    use std::f64::consts::PI;
    let volume = |mesh: &Tessellation| {
        let corner = |corner: u32| mesh.positions[corner as usize];
        let sixth = |[a, b, c]: [DVec3; 3]| dot(a, cross(b, c)) / 6.0;
        mesh.triangles.iter().map(|triangle| sixth(triangle.map(corner))).sum::<f64>()
    };
    let fine = Fineness { cells: 40, ..FINENESS };
    let cases = [
        ("sphere", shapes::sphere(), 4.0 * PI, Some(4.0 / 3.0 * PI)),
        ("cylinder", shapes::cylinder(false), 4.0 * PI, Some(PI)),
        ("open cylinder", shapes::cylinder(true), 2.0 * PI, None),
        ("cone", shapes::cone(false), PI * (1.0 + 2f64.sqrt()), Some(PI / 3.0)),
        ("square", shapes::plane(Some(2.0)), 16.0, None),
        ("paraboloid", shapes::paraboloid(false), PI * (1.0 + (5f64.powf(1.5) - 1.0) / 6.0), Some(PI / 2.0)),
    ];
    for (name, quadric, area, expected) in cases {
        let mesh = tessellate(&quadric, &fine);
        assert!((mesh.area() / area - 1.0).abs() < 2e-3, "{name}: area {} {area}", mesh.area());
        if let Some(expected) = expected {
            assert!((volume(&mesh) / expected - 1.0).abs() < 3e-3, "{name}: volume {} {expected}", volume(&mesh));
        }
    }
}

#[test]
fn rays_meet_the_surface_where_its_triangles_are() {
    for (name, quadric) in all() {
        let mesh = tessellate(&quadric, &FINENESS);
        for seed in 0..400 {
            let random = |k: u32| unit(hash2(seed, k));
            let triangle = mesh.triangles[(random(0) * mesh.triangles.len() as f64) as usize];
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let (u, v) = (random(1) * 0.5, random(2) * 0.5);
            let p = a + (b - a) * u + (c - a) * v;
            let n = mesh.normals[triangle[0] as usize];
            let nearest = quadric.intersect_quadratic(p + n * 0.5, -n).into_iter().map(|hit| (hit.t - 0.5).abs());
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            // A chord's height is an eighth of its length squared times the curvature, here at most 3; but at apexes.
            let longest = length(b - a).max(length(c - a)).max(length(c - b));
            let height = if name.contains("cone") { longest } else { 3.0 * longest * longest / 8.0 };
            let at_rim = nearest == f64::INFINITY
                && (0..3).any(|axis| {
                    let (clip, cell) = (quadric.clip(), 4.0 / 24.0);
                    (p[axis] - clip.min[axis]).abs() < cell || (p[axis] - clip.max[axis]).abs() < cell
                });
            assert!(nearest <= height + 1e-9 || at_rim, "{name}: {nearest} > {height} at {p}");
        }
    }
}

#[test]
fn textures_go_on_across_the_seam() {
    let mesh = tessellate(&shapes::sphere(), &FINENESS);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| mesh.uvs[corner as usize].x);
        assert!(a.max(b).max(c) - a.min(b).min(c) <= 0.5, "{a} {b} {c}");
    }
}

#[test]
fn what_has_no_extent_gives_nothing() {
    let flat = Clip { min: DVec3::new(-1.0, 0.25, -1.0), max: DVec3::new(1.0, 0.25, 1.0) };
    let coefficients = *shapes::sphere().coefficients();
    assert!(tessellate(&Quadric::new(coefficients, Some(flat), true).unwrap(), &FINENESS).triangles.is_empty());
    let imaginary = Quadric::new([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], None, true).unwrap();
    assert!(tessellate(&imaginary, &FINENESS).triangles.is_empty());
    let nowhere = Fineness { far: Extent { min: DVec3::NAN, max: DVec3::NAN }, ..FINENESS };
    assert!(tessellate(&shapes::plane(None), &nowhere).triangles.is_empty());
}
