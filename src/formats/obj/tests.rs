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
    assert_eq!(mesh.materials, Materials::PerTriangle(vec![0, 1, 1, 2, 2, 1]));
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
    assert_eq!(faces(true), Some(vec![0, 0, 2, 2, 2, 3]));
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
