//! Whole files through [`load`].

use std::path::PathBuf;

use glam::{DAffine3, DVec3, Vec3};

use super::*;
use crate::formats::{NormalMode, UpAxis};
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::Materials;
use crate::progress::Silent;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data");

/// Writes files into a folder of their own and loads the first.
fn load_files(files: &[(&str, &str)], options: &LoadOptions) -> Result<Model> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    load(&folder.path().join(files[0].0), options, &Silent)
}

fn load_text(text: &str) -> Model {
    load_files(&[("a.obj", text)], &LoadOptions::default()).unwrap()
}

/// The triangles' corners in the file's coordinates.
fn corners(mesh: &TriangleMesh) -> Vec<[[f64; 3]; 3]> {
    let corner = |i: u32| (mesh.origin + mesh.positions[i as usize].as_dvec3()).to_array();
    mesh.indices.iter().map(|triangle| triangle.map(corner)).collect()
}

fn warnings(model: &Model) -> Vec<&str> {
    model.ledger.entries().filter(|entry| entry.0 == Treatment::Warning).map(|entry| entry.1).collect()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn one_mesh_one_object_named_after_the_file() {
    let model = load_text(&format!("{SQUARE}o first\nf 1 2 3\ng second\nf 1 3 4\n"));
    assert_eq!((model.meshes.len(), model.objects.len(), model.materials.len()), (1, 1, 1));
    assert_eq!((model.objects[0].name.as_str(), model.objects[0].shape), ("a", Shape::Mesh(0)));
    assert_eq!(model.objects[0].transform, DAffine3::IDENTITY);
    let mesh = &model.meshes[0];
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!((mesh.positions.len(), &mesh.normals, &mesh.uvs), (4, &None, &None));
    assert_eq!(mesh.materials, Materials::One(0));
    assert_eq!(model.materials, [Material::default()]);
}

#[test]
fn triangles_keep_the_order_of_the_file_across_materials_and_count_bad_ones() {
    let text = format!(
        "{SQUARE}f 1 2 3\nusemtl a\nf 1 2 3 4\nusemtl unused\nusemtl b\nf 1 2 99\nf 1 1 2\nusemtl a\nf 2 3 4\n"
    );
    let model = load_text(&text);
    let mesh = &model.meshes[0];
    let names: Vec<_> = model.materials.iter().map(|material| material.name.as_str()).collect();
    assert_eq!(names, ["default", "a", "b"]);
    assert_eq!(mesh.materials, Materials::PerTriangle(vec![0, 1, 1, 2, 2, 1].into()));
    assert_eq!(mesh.dropped, [3, 4]);
    assert_eq!((mesh.dropped_counts.bad_index, mesh.dropped_counts.zero_area), (1, 1));
    assert_eq!(
        warnings(&model),
        [
            "corner whose vertex is not in the file: its triangles are dropped",
            "material `a` is not defined: neutral material used",
            "material `b` is not defined: neutral material used",
        ]
    );
}

#[test]
fn corners_that_agree_in_everything_are_one_vertex() {
    let text = format!(
        "{SQUARE}vt 0 0\nvt 1 0\nvn 0 0 2\nvn 1 0 0\nf 1/1/1 2/2/1 3/1/1\nf 1/1/1 3/2/1 4\nf 4//2 1/1/1 2/2/1\n"
    );
    let mesh = &load_text(&text).meshes[0];
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 3, 4], [5, 0, 1]]);
    let (x, z, none) = (Vec3::X, Vec3::Z * 2.0, Vec3::ZERO);
    assert_eq!(mesh.normals.as_deref().unwrap(), [z, z, z, z, none, x]);
    let us: Vec<f32> = mesh.uvs.as_ref().unwrap().iter().map(|uv| uv.x).collect();
    assert_eq!(us, [0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(mesh.positions[2], mesh.positions[3]);
}

#[test]
fn attribute_numbers_outside_the_file_are_warned_of() {
    let model = load_text(&format!("{SQUARE}vn 0 0 1\nf 1//1 2//7 3//-9\nf 1/5 2/5 3/5"));
    let mesh = &model.meshes[0];
    assert_eq!(mesh.normals.as_ref().unwrap().iter().filter(|n| **n == Vec3::Z).count(), 1);
    assert_eq!(mesh.uvs, None);
    assert_eq!(warnings(&model), ["corner whose vt or vn is not in the file: it has none"]);
    assert_eq!(mesh.dropped, [0; 0]);
}

#[test]
fn normals_follow_the_option() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 1 1\nf 1//1 2//1 3//1\nf 1 4 2\n";
    let normals = |normals| {
        let model = load_files(&[("a.obj", text)], &LoadOptions { normals, ..Default::default() }).unwrap();
        model.meshes[0].normals.clone()
    };
    assert_eq!(normals(NormalMode::File).unwrap()[..4], [Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::ZERO]);
    assert_eq!(normals(NormalMode::Flat), None);
    let smooth = normals(NormalMode::Smooth).unwrap();
    // Faces that point along +z and +y meet at right angles along the x axis.
    let between = Vec3::new(0.0, 1.0, 1.0).normalize();
    assert_eq!(smooth.len(), 4);
    assert!((smooth[0] - between).length() < 1e-6 && (smooth[2] - Vec3::Z).length() < 1e-6, "{smooth:?}");
}

#[test]
fn source_faces_are_kept_when_asked_for() {
    // A square, a line that is no face, a pentagon and a triangle.
    let text = format!("{SQUARE}v 0.5 2 0\nf 1 2 3 4\nf 1 2\nf 1 2 3 5 4\nf 1 2 3\n");
    let faces = |faces| {
        let model = load_files(&[("a.obj", &text)], &LoadOptions { faces, ..Default::default() }).unwrap();
        model.meshes[0].source_faces.clone()
    };
    assert_eq!(faces(true), Some([0, 0, 2, 2, 2, 3].into()));
    assert_eq!(faces(false), None);
}

#[test]
fn z_up_models_are_turned_exactly() {
    let text = format!("{SQUARE}f 1 2 3");
    let model = load_files(&[("a.obj", &text)], &LoadOptions { up: UpAxis::Z, ..Default::default() }).unwrap();
    let transform = model.objects[0].transform;
    assert_eq!(transform.transform_point3(DVec3::Z), DVec3::Y);
    assert_eq!(transform.transform_point3(DVec3::X), DVec3::X);
    assert_eq!(transform.transform_point3(DVec3::Y), DVec3::NEG_Z);
}

#[test]
fn far_away_models_keep_their_digits() {
    let text = "v 4512345.123 0.25 -700000.03\nv 4512346.123 1.25 -700000.02\nv 4512345.123 0.5 -700000.01\nf 1 2 3\n";
    let model = load_text(text);
    let found = corners(&model.meshes[0])[0];
    let expected = [[4512345.123, 0.25, -700000.03], [4512346.123, 1.25, -700000.02], [4512345.123, 0.5, -700000.01]];
    for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }
    assert_eq!(model.meshes[0].origin.y, 0.0, "exact without an origin");
}

#[test]
fn polygons_are_cut_without_losing_area() {
    // An L: a fan from its first corner would leave it.
    let text = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\nf 3 4 5 6 1 2\nf 1 2 3";
    let mesh = &load_text(text).meshes[0];
    assert_eq!(mesh.indices.len(), 5);
    let area = |[a, b, c]: [[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let areas: Vec<f64> = corners(mesh)[..4].iter().map(|&triangle| area(triangle)).collect();
    assert!(areas.iter().all(|&area| area > 0.0), "{areas:?}");
    assert_eq!(areas.iter().sum::<f64>(), 6.0);
}

#[test]
fn errors_name_the_line() {
    let message = |text: &str| {
        let error = load_files(&[("a.obj", text)], &LoadOptions::default()).unwrap_err().to_string();
        error[error.find("a.obj").unwrap()..].split(';').next().unwrap().to_owned()
    };
    assert_eq!(message("v 0 0 0\n\n# c\nv 0 \\\n x 0"), "a.obj:4: `x` is not a number");
    assert_eq!(message("v 0 0 0\nf 1 1 0\n"), "a.obj:2: `0` has the index 0");
    assert_eq!(message(""), "a.obj: the file has no faces");
    assert_eq!(message("v 1 2 3\np 1\n"), "a.obj: the file has no faces");
    let missing = load(Path::new("no/such.obj"), &LoadOptions::default(), &Silent).unwrap_err();
    assert_eq!(missing.fault(), crate::Fault::System);
    assert!(missing.to_string().starts_with("no/such.obj: "));
}

#[test]
fn a_cancelled_load_stops() {
    struct Stop;
    impl Progress for Stop {
        fn is_cancelled(&self) -> bool {
            true
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, format!("{SQUARE}f 1 2 3\n")).unwrap();
    assert_eq!(load(&path, &LoadOptions::default(), &Stop).unwrap_err().fault(), crate::Fault::Cancelled);
}

#[test]
fn materials_and_textures_are_found_and_their_absence_is_told() {
    let obj = format!(
        "mtllib Lib.mtl\nmtllib none.mtl\n{SQUARE}vt 0 0\nusemtl red\nf 1/1 2/1 3/1\nusemtl pic\nf 1/1 3/1 4/1\nusemtl gone\nf 1 2 4\n"
    );
    let mtl = "newmtl red\nKd 1 0 0\nKe 10 10 10\nnewmtl pic\nKd 1 1 1\nmap_Kd .\\none.png\n";
    let model = load_files(&[("a.obj", &obj), ("lib.mtl", mtl)], &LoadOptions::default()).unwrap();
    assert_eq!(model.materials[0].diffuse, Vec3::X);
    assert_eq!(model.materials[0].emission, Vec3::splat(10.0));
    assert_eq!((model.materials[1].diffuse, model.materials[1].diffuse_texture), (Vec3::ONE, None));
    assert_eq!(model.materials[2], Material { name: "gone".into(), ..Default::default() });
    assert_eq!(
        warnings(&model),
        [
            "material library `none.mtl` is missing (line 2): neutral material used",
            "texture `.\\none.png` is missing: plain colour used",
        ]
    );
}

#[test]
fn textures_belong_to_the_library_s_folder() {
    let folder = tempfile::tempdir().unwrap();
    let sub = folder.path().join("sub");
    std::fs::create_dir(&sub).unwrap();
    image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 0])).save(sub.join("a b.png")).unwrap();
    std::fs::write(sub.join("m.mtl"), "newmtl a\nmap_Kd -s 2 2 a b.png\nnewmtl b\nmap_Kd A B.png\n").unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(
        &path,
        format!("mtllib sub\\m.mtl\n{SQUARE}vt 0 0\nusemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 3/1 4/1\n"),
    )
    .unwrap();
    let model = load(&path, &LoadOptions::default(), &Silent).unwrap();
    assert_eq!(warnings(&model), [""; 0]);
    assert_eq!(model.textures.len(), 1);
    let used = model.materials[0].diffuse_texture.unwrap();
    assert_eq!(used, crate::scene::TextureRef::scaled(0, glam::DVec2::splat(2.0), glam::DVec2::ZERO));
    assert_eq!(model.materials[1].diffuse_texture.unwrap().texture, 0);
    assert_eq!(model.textures[0].sample(glam::DVec2::ZERO), Vec3::X);
}

/// All files below a folder with this suffix, sorted.
fn files_below(folder: PathBuf, suffix: &str) -> Vec<PathBuf> {
    let (mut open, mut found) = (vec![folder], Vec::new());
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == suffix) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn nasty_files_load_or_say_why_not() {
    let folder = PathBuf::from(DATA).join("nasty-obj");
    if !folder.is_dir() {
        eprintln!("skipped: no {}", folder.display());
        return;
    }
    let files = files_below(folder, "obj");
    assert!(files.len() > 80);
    let mut refused = Vec::new();
    for path in files {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        match load(&path, &LoadOptions::default(), &Silent) {
            Ok(model) => {
                let mesh = &model.meshes[0];
                assert!(mesh.triangle_count() > 0, "{name}");
                let used = (0..mesh.triangle_count() as u32).map(|triangle| mesh.material(triangle)).max();
                assert!((used.unwrap() as usize) < model.materials.len(), "{name}");
            }
            Err(error) => {
                assert!(error.to_string().contains(&name), "{error}");
                refused.push(format!("{name}: {}", error.message()));
            }
        }
    }
    refused.sort();
    assert_eq!(
        refused,
        [
            "invalid-face-definition.obj: the file has no faces",
            "issue-140-zero-face-idx.obj: `0/0/0` has the index 0",
            "line-prim.obj: the file has no faces",
            "lines.obj: the file has no faces",
            "points-prim.obj: the file has no faces",
        ]
    );
}

#[test]
fn the_cornell_box_s_spheres_are_a_mirror_and_glass() {
    let path = PathBuf::from(DATA).join("scenes/cornell-box/CornellBox-Sphere.obj");
    if !path.is_file() {
        eprintln!("skipped: no {}", path.display());
        return;
    }
    let model = load(&path, &LoadOptions::default(), &Silent).unwrap();
    assert_eq!(model.meshes[0].triangle_count(), 2188);
    let material = |name: &str| model.materials.iter().find(|material| material.name == name).unwrap();
    assert_eq!(material("leftSphere").kr, Vec3::splat(0.95));
    assert!(material("rightSphere").kt.min_element() > 0.8 && material("rightSphere").ior == 2.5);
    assert_eq!(material("light").emission, Vec3::splat(10.0));
    assert_eq!(warnings(&model), [""; 0]);
}

#[test]
fn real_models_have_their_known_numbers_of_triangles() {
    // Counted by another program, which cuts polygons into fans; n - 2 per polygon is the same.
    let known = [
        ("obj/stanford-bunny.obj", 69_451),
        ("obj/sword-quad-dominant.obj", 44_582),
        ("obj/fish_control_mesh.obj", 220),
        ("obj/suzanne.obj", 968),
        ("scenes/dabrovic-sponza/sponza.obj", 66_450),
        ("scenes/cornell-box/CornellBox-Original.obj", 36),
        ("scenes/cornell-box/CornellBox-Glossy.obj", 1_112),
    ];
    for (file, triangles) in known {
        let path = PathBuf::from(DATA).join(file);
        if !path.is_file() {
            eprintln!("skipped: no {}", path.display());
            continue;
        }
        let model = load(&path, &LoadOptions::default(), &Silent).unwrap();
        assert_eq!(model.meshes[0].triangle_count(), triangles, "{file}");
    }
}

/// Two squares that meet at a right angle along the x axis, and a third in the plane of the first.
const FOLDED: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 1\nv 0 0 1\nv 1 2 0\nv 0 2 0\n";

/// The shading normals of the triangles' corners; zero for the face's.
fn corner_normals(mesh: &TriangleMesh) -> Vec<[Vec3; 3]> {
    let normal = |vertex: u32| mesh.normals.as_ref().map_or(Vec3::ZERO, |normals| normals[vertex as usize]);
    mesh.indices.iter().map(|triangle| triangle.map(normal)).collect()
}

#[test]
fn smoothing_groups_are_smooth_within_and_sharp_without() {
    let between = Vec3::new(0.0, 1.0, 1.0).normalize();
    let near = |found: Vec3, expected: Vec3| (found - expected).abs().max_element() < 1e-6;

    let one = load_text(&format!("{FOLDED}s 4\nf 1 2 3 4\nf 1 6 5 2\ns off\nf 4 3 7 8\n"));
    let normals = corner_normals(&one.meshes[0]);
    assert!(near(normals[0][0], between) && near(normals[0][1], between) && near(normals[0][2], Vec3::Z));
    assert_eq!(normals[4..], [[Vec3::ZERO; 3]; 2]);
    assert_eq!(one.meshes[0].positions.len(), 8 + 2, "split between the group and what is flat");
    assert!(one.ledger.entries().any(|entry| entry == (Treatment::Honoured, "smoothing groups (s)", 2)));

    let two = load_text(&format!("{FOLDED}s 1\nf 1 2 3 4\ns 2\nf 1 6 5 2\n"));
    for (normals, face) in corner_normals(&two.meshes[0]).iter().zip([Vec3::Z, Vec3::Z, Vec3::Y, Vec3::Y]) {
        assert!(normals.iter().all(|&normal| near(normal, face)), "{normals:?}");
    }
    let flat = load_text(&format!("{FOLDED}s off\nf 1 2 3 4\nf 1 6 5 2\n"));
    assert_eq!(flat.meshes[0].normals, None);
}

#[test]
fn only_corners_without_a_normal_are_smoothed() {
    let text = format!("{FOLDED}vn 1 2 3\ns 1\nf 1//1 2//1 3 4\nf 1 6 5 2\n");
    let normals = corner_normals(&load_text(&text).meshes[0]);
    let given = Vec3::new(1.0, 2.0, 3.0);
    assert_eq!((normals[0][0], normals[0][1]), (given, given));
    assert!((normals[0][2] - Vec3::Z).abs().max_element() < 1e-6);
    assert!((normals[2][0] - Vec3::new(0.0, 1.0, 1.0).normalize()).abs().max_element() < 1e-6);
}

#[test]
fn a_crease_angle_is_for_files_with_neither_normals_nor_groups() {
    let smooth = |text: &str, degrees: f64| {
        let options = LoadOptions { crease_angle: Some(degrees.to_radians()), ..Default::default() };
        load_files(&[("a.obj", text)], &options).unwrap().meshes.remove(0)
    };
    let faces = "f 1 2 3 4\nf 1 6 5 2\nf 4 3 7 8\n";
    let sharp = corner_normals(&smooth(&format!("{FOLDED}{faces}"), 89.0));
    let near = |found: Vec3, expected: Vec3| (found - expected).abs().max_element() < 1e-6;
    assert!(near(sharp[0][0], Vec3::Z) && near(sharp[2][0], Vec3::Y) && near(sharp[4][0], Vec3::Z));
    let round = corner_normals(&smooth(&format!("{FOLDED}{faces}"), 91.0));
    assert!(near(round[0][0], Vec3::new(0.0, 1.0, 1.0).normalize()) && near(round[4][0], Vec3::Z));
    assert_eq!(smooth(&format!("{FOLDED}s off\n{faces}"), 91.0).normals, None);
    assert_eq!(load_text(&format!("{FOLDED}{faces}")).meshes[0].normals, None);
}

#[test]
fn colours_belong_to_positions_and_are_linear() {
    let model = load_text("v 0 0 0 1 0 0\nv 1 0 0 0 1 0.5\nv 0 1 0\nvt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 3/2 2/2 1/2\n");
    let mesh = &model.meshes[0];
    let colors = mesh.colors.as_ref().unwrap();
    let of = |triangle: usize| mesh.indices[triangle].map(|vertex| colors[vertex as usize]);
    let (red, green, white) = ([65_535, 0, 0, 65_535], [0, 65_535, 14_027, 65_535], [65_535; 4]);
    assert_eq!((of(0), of(1)), ([red, green, white], [white, green, red]));
    assert_eq!(warnings(&model), ["v without a colour that can be read beside others: white"]);
}

#[test]
fn names_of_objects_and_groups_are_kept() {
    let model = load_text(&format!("{SQUARE}f 1 2 3\no a\ng b c\nf 1 2 3 4\no d\nf 1 2 3\n"));
    let names: Vec<_> = model.meshes[0].named_runs().collect();
    assert_eq!(names, [("default", 0, 1), ("a/b c", 1, 2), ("d", 3, 1)]);
    assert!(load_text(&format!("{SQUARE}f 1 2 3\n")).meshes[0].groups.is_empty());
}

/// A file with texture coordinates and a material `m`, whose images are made by `images`.
fn load_material(mtl: &str, images: &[(&str, image::DynamicImage)]) -> Model {
    let folder = tempfile::tempdir().unwrap();
    for (name, image) in images {
        image.save(folder.path().join(name)).unwrap();
    }
    let obj = format!(
        "mtllib m.mtl\n{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n"
    );
    std::fs::write(folder.path().join("m.mtl"), format!("newmtl m\n{}\n", mtl.replace("; ", "\n"))).unwrap();
    std::fs::write(folder.path().join("a.obj"), obj).unwrap();
    load(&folder.path().join("a.obj"), &LoadOptions::default(), &Silent).unwrap()
}

fn filled(color: [u8; 4]) -> image::DynamicImage {
    image::RgbaImage::from_pixel(4, 4, image::Rgba(color)).into()
}

/// An image whose left half has this alpha, and whose right half is opaque.
fn half_there(alpha: u8) -> image::DynamicImage {
    let texel = |x: u32, _| image::Rgba([255, 0, 0, if x < 2 { alpha } else { 255 }]);
    image::RgbaImage::from_fn(4, 4, texel).into()
}

/// The terms of the model's only material at texture coordinates.
fn terms_at(model: &Model, uv: [f64; 2]) -> Material {
    let texel = |texture: &crate::scene::TextureRef| {
        let place = texture.place(glam::DVec2::from_array(uv));
        model.textures[texture.texture as usize].sample_footprint(place, 0.0)
    };
    model.materials[0].at(glam::Vec4::ONE, texel)
}

fn near(found: Vec3, expected: Vec3) -> bool {
    (found - expected).abs().max_element() < 1e-5
}

#[test]
fn images_of_highlights_and_light_multiply() {
    let images = [("a.png", filled([255, 0, 188, 255]))];
    let model = load_material("Kd 0.1 0.2 0.3; Ks 0.5 0.5 0.5; map_Ks a.png; Ke 2 2 2; map_Ke a.png", &images);
    let terms = terms_at(&model, [0.5, 0.5]);
    // 188 in sRGB is 0.5029 in linear light.
    assert!(near(terms.ks, Vec3::new(0.5, 0.0, 0.5 * 0.502_886)) && near(terms.emission, 4.0 * terms.ks));
    assert_eq!((terms.diffuse, model.textures.len()), (Vec3::new(0.1, 0.2, 0.3), 1));
    // Black under an image of light is what exporters write who mean the image; no Ks means that the image tells all.
    let model = load_material("Ke 0 0 0; map_Ke a.png; map_Ks a.png; illum 2", &images);
    let terms = terms_at(&model, [0.5, 0.5]);
    assert!(near(terms.emission, Vec3::new(1.0, 0.0, 0.502_886)) && near(terms.ks, terms.emission));
    let missing = load_material("map_Ke none.png; map_Ks none.png; illum 3", &[]);
    assert_eq!((terms_at(&missing, [0.5, 0.5]).emission, terms_at(&missing, [0.5, 0.5]).kr), (Vec3::ZERO, Vec3::ZERO));
}

#[test]
fn an_image_of_opacity_makes_a_blend() {
    let grey = image::GrayImage::from_fn(4, 4, |x, _| image::Luma([if x < 2 { 51 } else { 255 }])).into();
    let model = load_material("Kd 1 1 1; d 0.5; map_d grey.png", &[("grey.png", grey)]);
    assert!(near(terms_at(&model, [0.25, 0.5]).kt, Vec3::splat(0.9)), "luminance 0.2 times 0.5 is there");
    assert!(near(terms_at(&model, [0.75, 0.5]).kt, Vec3::splat(0.5)));
    assert!(model.materials[0].lets_light_through());

    // The alpha of the diffuse image counts where map_d names it, and nowhere else.
    let images = [("a.png", half_there(51))];
    let plain = load_material("map_Kd a.png", &images);
    assert!(!plain.materials[0].lets_light_through());
    assert_eq!(plain.textures[0].sample_footprint(glam::DVec2::new(0.25, 0.5), 0.0).w, 1.0);
    let same = load_material("map_Kd a.png; map_d a.png", &images);
    assert_eq!(same.textures.len(), 1, "one image for both");
    let other = load_material("map_Kd a.png; map_d -imfchan m -clamp on a.png", &images);
    for model in [same, other] {
        assert!(near(terms_at(&model, [0.25, 0.5]).kt, Vec3::splat(0.8)));
        assert!(near(terms_at(&model, [0.75, 0.5]).kt, Vec3::ZERO));
    }
    let red = load_material("map_d -imfchan g a.png", &images);
    assert!(near(terms_at(&red, [0.75, 0.5]).kt, Vec3::ONE), "green is 0 everywhere");
    let gain = load_material("map_d -mm 0.2 0.5 -imfchan m a.png", &images);
    assert!(near(terms_at(&gain, [0.75, 0.5]).kt, Vec3::ZERO), "alpha is not adjusted");
}

#[test]
fn bumps_are_told_from_normals_and_get_tangents() {
    let normals = || ("n.png", filled([128, 128, 255, 255]));
    let ramp = image::GrayImage::from_fn(8, 8, |x, _| image::Luma([20 * x as u8]));
    for (mtl, scale) in [("norm n.png", 1.0), ("map_Bump -bm 0.5 n.png", 0.5), ("bump n.png; norm n.png", 1.0)] {
        let model = load_material(mtl, &[normals()]);
        let normal = model.materials[0].detail.as_ref().unwrap().normal.unwrap();
        assert_eq!(normal.scale, scale, "{mtl}");
        assert!(matches!(model.textures[0].texels, crate::scene::texture::Texels::Data8(_)));
        let tangents = model.meshes[0].tangents.as_ref().unwrap();
        assert!(tangents.iter().all(|tangent| (*tangent - glam::Vec4::new(1.0, 0.0, 0.0, 1.0)).length() < 1e-6));
    }
    let model = load_material("bump -bm 2 h.png", &[("h.png", ramp.into())]);
    let normal = model.materials[0].detail.as_ref().unwrap().normal.unwrap();
    let texel = model.textures[normal.texture.texture as usize].sample_footprint(glam::DVec2::splat(0.5), 0.0);
    // Heights grow by 20/255 a texel, times 2.
    let expected = Vec3::new(-40.0 / 255.0, 0.0, 1.0).normalize();
    assert!(near(texel.truncate() * 2.0 - 1.0, expected), "{texel}");
    assert_eq!(load_material("Kd 1 1 1", &[]).meshes[0].tangents, None);
}

#[test]
fn metalness_and_roughness_follow_gltf_s_rule() {
    use crate::scene::detail::MetallicRoughness;
    let surface = |metallic, roughness, base| {
        let model = MetallicRoughness { base, metallic, roughness, ..MetallicRoughness::DEFAULT };
        Material::default().with_phong_of(&model.surface(Vec3::ONE, |_| glam::Vec4::ONE))
    };
    let assert_same = |found: &Material, expected: &Material| {
        assert!(near(found.diffuse, expected.diffuse) && near(found.ks, expected.ks) && near(found.kr, expected.kr));
        assert!(
            (found.shininess / expected.shininess - 1.0).abs() < 1e-3,
            "{} {}",
            found.shininess,
            expected.shininess
        );
    };
    let base = Vec3::new(0.9, 0.5, 0.1);
    let plain = load_material("Kd 0.9 0.5 0.1; Pm 0.5; Pr 0.2; Ks 1 1 1; Ns 7; illum 3", &[]);
    assert_same(&plain.materials[0], &surface(0.5, 0.2, base));
    assert_eq!(plain.materials[0].detail, None);
    assert!(plain.ledger.all().any(|(treatment, feature, entry)| {
        treatment == Treatment::Ignored && feature.starts_with("Ks, Ns") && entry.scopes.contains(&Scope::Material(0))
    }));

    // Two images become one, of which each is a fifth.
    let images = [("r.png", filled([51, 51, 51, 255])), ("m.png", filled([102, 102, 102, 255]))];
    let mapped = load_material("Kd 0.9 0.5 0.1; map_Pr r.png; map_Pm m.png", &images);
    assert_same(&terms_at(&mapped, [0.5, 0.5]), &surface(0.4, 0.2, base));
    assert_same(&mapped.materials[0], &surface(0.4, 0.2, base));
    assert_eq!(mapped.textures.len(), 1);
    let packed = load_material(
        "Kd 0.9 0.5 0.1; Pm 1; Pr 1; map_Pr p.png; map_Pm p.png; map_Kd white.png; d 0.5",
        &[("p.png", filled([0, 51, 102, 255])), ("white.png", filled([255; 4]))],
    );
    assert_same(&terms_at(&packed, [0.5, 0.5]), &surface(0.4, 0.2, base).blended(0.5));
    // Glass keeps its own rule.
    let glass = load_material("Kd 0 0 0; Ks 1 1 1; Pr 0.1; illum 7; Ni 1.5", &[]);
    assert!(glass.materials[0].is_transmissive());
}
