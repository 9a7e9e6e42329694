//! Scene files as people write them, right and wrong.

mod mistakes;

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::read::parse;
use super::{Assets, builtin_names, parse_with, save_model_scene};
use crate::error::Result;
use crate::formats::{self, LoadOptions, Loaded, NormalMode, UpAxis};
use crate::progress::Silent;
use crate::scene::film::{LARGEST_DEPTH, LARGEST_EXPOSURE, LONGEST_SIDE, MOST_SAMPLES};
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{
    Background, Camera, CameraKey, CameraPath, Clamp, Falloff, FilmSettings, Light, LightKind, NamedCamera, Projection,
    Rgb, Scene, Shape, Transfer,
};

fn parsed(text: &str) -> Result<Loaded> {
    parse(text, Path::new("s.toml"), &LoadOptions::default(), &Silent)
}

fn scene(text: &str) -> Scene {
    parsed(text).unwrap_or_else(|error| panic!("{error}\n{text}")).scene
}

#[test]
fn other_systems_line_ends_and_marks_do_no_harm() {
    let text = "\u{feff}ambient = 0.5\r\n[film]\r\nwidth = 7\r\nheigth = 3\r\n";
    let message = parsed(text).unwrap_err().to_string();
    assert!(message.starts_with("s.toml:4:1: unknown key `heigth` of the film; did you mean `height`?"), "{message}");
    assert_eq!(scene(&text.replace("heigth", "height")).film.height, 3);
}

#[test]
fn cameras_choose_the_film() {
    let look_at = scene("[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 90");
    let projection = Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 };
    let expected = Camera::LookAt { eye: DVec3::Z * 5.0, target: DVec3::ZERO, up: DVec3::Y, projection };
    assert_eq!(*look_at.camera(), expected);
    assert_eq!((look_at.film.width, look_at.film.height, look_at.film.samples), (1280, 720, 16));
    assert_eq!((look_at.film.clamp, look_at.background), (Clamp::Output, Background::Color(Rgb::ZERO)));
    assert_eq!(look_at.ambient, Rgb::splat(0.1));

    let seed =
        "[camera]\nviewpoint = [0, 0, 5]\nlower_left = [-1, -1, 0]\nlower_right = [1, -1, 0]\nupper_left = [-1, 1, 0]";
    let seed = scene(&format!("{seed}\n[film]\nmax_depth = 2\ntransfer = \"linear\"\nexposure = -1.5"));
    assert!(matches!(seed.camera(), Camera::FourPoint { .. }));
    assert_eq!((seed.film.width, seed.film.height, seed.film.samples), (640, 480, 1));
    assert_eq!((seed.film.clamp, seed.film.max_depth), (Clamp::Shade, 2));
    assert_eq!((seed.film.transfer, seed.film.exposure), (Transfer::Linear, -1.5));

    let several = scene(
        "[[camera]]\nname = \"a\"\neye = [0, 0, 5]\ntarget = [0, 0, 0]\nheight = 2\n\
         [[camera]]\nname = \"b\"\neye = [0, 0, 5]\ntarget = [0, 0, 0]",
    );
    assert_eq!(several.cameras.iter().map(|named| named.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert!(matches!(several.camera(), Camera::LookAt { projection: Projection::Orthographic { height: 2.0 }, .. }));
    assert_eq!(scene("").cameras.len(), 1, "an automatic one where the file has none");
}

#[test]
fn materials_default_to_the_seed() {
    let scene = scene(
        "[[material]]\nname = \"a\"\nks = 0.3\n[[material]]\nname = \"b\"\nks = 0.3\nkr = 0\nopacity = 0.25\n\
         [[material]]\nname = \"c\"\ndiffuse = \"#f00\"\nambient = [0, 0, 0.5]\nkt = [0, 0.5, 1]\nior = 1.33\nflat = true",
    );
    let [_, a, b, c] = scene.materials.as_slice() else { panic!() };
    assert_eq!((a.ks, a.kr, a.kt), (Rgb::splat(0.3), Rgb::splat(0.3), Rgb::ZERO), "kr is ks unless given");
    assert_eq!((b.ks, b.kr, b.kt), (Rgb::splat(0.3), Rgb::ZERO, Rgb::splat(0.75)));
    assert_eq!((a.ambient, c.ambient), (None, Some(Rgb::new(0.0, 0.0, 0.5))));
    assert_eq!((c.diffuse, c.kt, c.ior, c.flat), (Rgb::X, Rgb::new(0.0, 0.5, 1.0), 1.33, true));
}

#[test]
fn lights() {
    let scene = scene(
        "[[light]]\nkind = \"point\"\nposition = [1, 2, 3]\ncolor = [1, 0.5, 0]\nintensity = 2\n\
         [[light]]\nname = \"sun\"\nkind = \"directional\"\ndirection = [0, -1, 0]\n\
         [[light]]\nkind = \"spot\"\nposition = [0, 3, 0]\ntarget = [0, 1, 0]\nouter_angle = 90\nfalloff = \"inverse_square\"",
    );
    let kind = LightKind::Point { position: DVec3::new(1.0, 2.0, 3.0), falloff: Falloff::None };
    assert_eq!(scene.lights[0], Light { name: "light 1".into(), kind, color: Rgb::new(2.0, 1.0, 0.0) });
    let kind = LightKind::Directional { direction: DVec3::NEG_Y };
    assert_eq!(scene.lights[1], Light { name: "sun".into(), kind, color: Rgb::ONE });
    let LightKind::Spot { direction, inner_angle, outer_angle, falloff, .. } = scene.lights[2].kind else { panic!() };
    assert_eq!((direction, inner_angle), (DVec3::new(0.0, -2.0, 0.0), 0.0));
    assert_eq!((outer_angle, falloff), (std::f64::consts::FRAC_PI_2, Falloff::InverseSquare));
}

/// The places, in world space, of points of a canonical shape.
fn places<const N: usize>(text: &str, points: [[f64; 3]; N]) -> [[f64; 3]; N] {
    let scene = scene(text);
    points.map(|p| {
        let p = scene.objects[0].transform.transform_point3(DVec3::from_array(p));
        (p * 1e9).round().to_array().map(|x| x / 1e9 + 0.0)
    })
}

#[test]
fn named_quadrics_stand_where_they_are_told() {
    let bottom_top_side = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    assert_eq!(
        places("[[object]]\nsphere = { center = [1, 2, 3], radius = 2 }", bottom_top_side),
        [[1.0, 2.0, 3.0], [1.0, 4.0, 3.0], [3.0, 2.0, 3.0]]
    );
    assert_eq!(
        places("[[object]]\nellipsoid = { radii = [1, 2, 3] }", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]
    );
    assert_eq!(
        places("[[object]]\ncylinder = { base = [1, 0, 0], top = [1, 5, 0], radius = 0.5 }", bottom_top_side),
        [[1.0, 0.0, 0.0], [1.0, 5.0, 0.0], [1.5, 0.0, 0.0]],
        "upright ones are not turned"
    );
    for shape in
        ["cone = { base = [0, 0, 1], apex = [3, 4, 1] }", "paraboloid = { apex = [0, 0, 1], base = [3, 4, 1] }"]
    {
        let text = format!("[[object]]\n{shape}");
        assert_eq!(places(&text, [[0.0; 3], [0.0, 1.0, 0.0]]), [[0.0, 0.0, 1.0], [3.0, 4.0, 1.0]]);
        let matrix = scene(&text).objects[0].transform.matrix3;
        assert!((matrix.x_axis.length() - 1.0).abs() < 1e-15 && matrix.x_axis.dot(matrix.y_axis).abs() < 1e-15);
        assert!(matrix.determinant() > 0.0, "not mirrored");
    }
    let plane = places("[[object]]\nplane = { point = [0, 1, 0], normal = [0, 0, 2] }", [[0.0; 3], [0.0, 1.0, 0.0]]);
    assert_eq!(plane, [[0.0, 1.0, 0.0], [0.0, 1.0, 1.0]]);
    let sheet = "hyperboloid_one_sheet = { axis = [1, 0, 0], radius = 2, height = 3 }";
    assert_eq!(places(&format!("[[object]]\n{sheet}"), [[0.0, 1.0, 0.0]]), [[3.0, 0.0, 0.0]]);
}

#[test]
fn both_forms_of_a_general_quadric_are_one_surface() {
    let scene = scene(
        "[[object]]\nquadric = { coefficients = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10] }\n\
         [[object]]\nquadric = { matrix = [1, 4, 6, 7, 4, 2, 5, 8, 6, 5, 3, 9, 7, 8, 9, 10], clip = { max = [1, 1, inf] } }",
    );
    let expected = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0];
    assert!(scene.quadrics.iter().all(|quadric| *quadric.coefficients() == expected));
    assert_eq!(scene.objects[1].material, Some(0), "the neutral one");
}

#[test]
fn transforms_apply_in_order_and_instances_after_them() {
    let object = "[[object]]\nsphere = {}\ntransform = [{ translate = [1, 0, 0] }, { rotate = [0, 0, 90] }, { scale = [1, 2, 1] }]";
    assert_eq!(places(object, [[0.0; 3]]), [[0.0, 2.0, 0.0]]);
    let turned = "[[object]]\nsphere = {}\ntransform = { rotate = { axis = [0, 3, 0], angle = 90 } }";
    assert_eq!(places(turned, [[0.0, 0.0, 1.0]]), [[1.0, 0.0, 0.0]]);
    let matrix = "[[object]]\nsphere = {}\ntransform = { matrix = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1] }";
    assert_eq!(places(matrix, [[1.0, 0.0, 0.0]]), [[5.0, 7.0, 7.0]]);

    let scene =
        scene(&format!("{object}\nname = \"o\"\ninstances = [{{ translate = [10, 0, 0] }}, [{{ scale = 3 }}]]"));
    let names: Vec<_> = scene.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!((names, scene.quadrics.len()), (vec!["o 1", "o 2"], 1));
    let origins = [0, 1].map(|index| (scene.objects[index].transform.translation * 1e9).round() / 1e9);
    assert_eq!(origins, [DVec3::new(10.0, 2.0, 0.0), DVec3::new(0.0, 6.0, 0.0)]);
}

/// A folder with a model of two materials, one of them textured, and a scene file of the given text.
fn folder_with(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write(
        "m.obj",
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
         usemtl red\nf 1/1 2/2 3/3\nusemtl blue\nf 1/1 2/2 4/3\n",
    );
    write("m.mtl", "newmtl red\nKd 1 0 0\nNs 10\nnewmtl blue\nKd 1 1 1\nmap_Kd t.png\n");
    image::RgbImage::from_fn(2, 1, |x, _| image::Rgb([x as u8 * 200, 10, 20]))
        .save(folder.path().join("t.png"))
        .unwrap();
    write("s.toml", text);
    folder
}

fn opened(folder: &tempfile::TempDir, name: &str) -> Result<Loaded> {
    formats::open(&folder.path().join(name), &LoadOptions::default(), &Silent)
}

#[test]
fn meshes_are_shared_replaced_and_overridden() {
    let folder = folder_with(
        "[[material]]\nname = \"mine\"\ntexture = { file = \"t.png\", scale = 2, offset = [0.5, 0], wrap = [\"clamp\", \"repeat\"], filter = \"nearest\" }\n\
         [[object]]\nmesh = \"m.obj\"\nname = \"first\"\n\
         [[object]]\nmesh = \"./m.obj\"\nmaterial = \"mine\"\ntransform = { translate = [0, 0, 4] }\n\
         [[object]]\nmesh = \"m.obj\"\nnormals = \"smooth\"\nup = \"z\"\n\
         [[override]]\nmaterial = \"red\"\nkr = 0.5\n",
    );
    let Loaded { scene, ledger, .. } = opened(&folder, "s.toml").unwrap();
    let files: Vec<_> = ledger.files().filter_map(|path| path.file_name()?.to_str()).collect();
    assert!(["s.toml", "m.obj", "m.mtl", "t.png"].iter().all(|name| files.contains(name)), "{files:?}");
    let shapes: Vec<_> = scene.objects.iter().map(|object| object.shape).collect();
    assert_eq!(shapes, [Shape::Mesh(0), Shape::Mesh(0), Shape::Mesh(1)], "loaded once for each way of reading it");
    assert_eq!(scene.objects[0].name, "first/m");
    assert_eq!(scene.objects[1].transform.translation, DVec3::Z * 4.0);
    let own = scene.materials.iter().position(|material| material.name == "mine").unwrap() as u32;
    assert_eq!((scene.objects[0].material, scene.objects[1].material), (None, Some(own)));
    assert!(scene.meshes[0].normals.is_none() && scene.meshes[1].normals.is_some());

    let mine = scene.materials.iter().find(|m| m.name == "mine").unwrap().diffuse_texture.unwrap();
    let texture = &scene.textures[mine.texture as usize];
    assert_eq!((texture.wrap, texture.filter), ([Wrap::Clamp, Wrap::Repeat], Filter::Nearest));
    assert_eq!(
        mine,
        crate::scene::TextureRef::scaled(mine.texture, glam::DVec2::splat(2.0), glam::DVec2::new(0.5, 0.0))
    );

    let reds: Vec<_> = scene.materials.iter().filter(|material| material.name == "red").collect();
    assert_eq!(reds.len(), 2, "one for each way of reading the file");
    for red in reds {
        assert_eq!((red.kr, red.diffuse, red.shininess), (Rgb::splat(0.5), Rgb::X, 10.0), "the rest stays as imported");
    }
    let material = scene.meshes[0].material(1) as usize;
    let blue = &scene.materials[material];
    let texture = &scene.textures[blue.diffuse_texture.unwrap().texture as usize];
    assert!(blue.name == "blue" && texture.name.contains("t.png"), "numbers are shifted together");
}

#[test]
fn images_of_models_and_of_the_scene_are_told_apart_whatever_they_are_called() {
    let folder = folder_with("");
    let own = folder.path().join("t.png");
    // A model whose embedded image is called as the path of the scene's own.
    let data = |file: &str| {
        let bytes = std::fs::read(folder.path().join(file)).unwrap();
        bytes.iter().map(|byte| format!("%{byte:02x}")).collect::<String>()
    };
    image::RgbImage::from_pixel(1, 1, image::Rgb([255; 3])).save(folder.path().join("white.png")).unwrap();
    let mut buffer: Vec<u8> =
        [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    buffer.resize(36, 0);
    std::fs::write(folder.path().join("m.bin"), buffer).unwrap();
    let gltf = serde_json::json!({
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"name": "paper", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"name": own, "uri": format!("data:image/png,{}", data("white.png"))}],
        "buffers": [{"byteLength": 36, "uri": "m.bin"}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [0, 0, 0], "max": [1, 1, 0]}],
    });
    std::fs::write(folder.path().join("m.gltf"), gltf.to_string()).unwrap();
    let text = "[[object]]\nmesh = \"m.gltf\"\n[[object]]\nmesh = \"m.obj\"\n\
        [[override]]\nmaterial = \"paper\"\ntexture = \"t.png\"\n\
        [[override]]\nmaterial = \"red\"\ntexture = \"./t.png\"\n";
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let Loaded { scene, ledger, .. } = opened(&folder, "s.toml").unwrap();
    assert!(ledger.entries().all(|(treatment, ..)| treatment != formats::Treatment::Warning), "the image is read");
    let texture = |material: &str| {
        let material = scene.materials.iter().find(|m| m.name == material).unwrap();
        material.diffuse_texture.unwrap().texture
    };
    assert_eq!(scene.textures[texture("paper") as usize].width, 2, "the scene's image, not the model's");
    assert_eq!(texture("paper"), texture("red"), "one file is one texture, however it is written");
}

#[test]
fn an_override_lists_the_imported_names() {
    let folder = folder_with("[[object]]\nmesh = \"m.obj\"\n[[override]]\nmaterial = \"rad\"\n");
    let message = opened(&folder, "s.toml").unwrap_err().to_string();
    assert!(message.ends_with(
        "s.toml:4:12: no imported material is called `rad`; did you mean `red`? accepted are `blue`, `red`"
    ));
}

#[test]
fn a_mistake_in_a_model_is_told_by_its_own_line() {
    let folder = folder_with("[[object]]\nmesh = \"bad.obj\"\n");
    std::fs::write(folder.path().join("bad.obj"), "v 0 0 zero\n").unwrap();
    let error = opened(&folder, "s.toml").unwrap_err();
    assert!(error.path().unwrap().ends_with("bad.obj") && error.line() == Some(1), "{error}");
    std::fs::write(folder.path().join("s.toml"), "[[object]]\nmesh = \"t.png\"\n").unwrap();
    let error = opened(&folder, "s.toml").unwrap_err();
    assert_eq!((error.line(), error.column()), (Some(2), Some(8)), "{error}");
}

#[test]
fn a_saved_scene_reads_back_to_the_bit() {
    let folder = folder_with("");
    let model = folder.path().join("m.obj");
    let options = LoadOptions { normals: NormalMode::Smooth, up: UpAxis::Z, ..LoadOptions::default() };
    let mut scene = formats::open(&model, &options, &Silent).unwrap().scene;
    // Values that short digits cannot hold, and names that repeat.
    let projection = Projection::Orthographic { height: 0.1 + 0.2 };
    let eye = DVec3::new(1.0 / 3.0, -1e-300, 1e300);
    let extra = Camera::LookAt { eye, target: DVec3::ZERO, up: DVec3::Y, projection };
    let key = |frame: i32| CameraKey { frame, eye: eye * f64::from(frame), target: DVec3::ONE / 3.0, lens: 0.3 };
    let path = Some(CameraPath::Keys(vec![key(-7), key(3)]));
    scene.cameras.push(NamedCamera { name: "auto".into(), camera: extra, path });
    scene.cameras.push(NamedCamera { path: Some(CameraPath::Turntable { frames: 9 }), ..scene.cameras[0].clone() });
    let angle = |degrees: f64| degrees.to_radians();
    let kind = LightKind::Spot {
        position: DVec3::ONE / 7.0,
        direction: DVec3::NEG_Y,
        inner_angle: angle(12.3),
        outer_angle: angle(77.7),
        falloff: Falloff::InverseSquare,
    };
    scene.lights.push(Light { name: "key".into(), kind, color: Rgb::new(0.1, 1.0 / 3.0, 1e-20) });
    scene.ambient = Rgb::new(0.1, 0.2, 1.0 / 3.0);
    scene.film.exposure = 0.1;
    scene.film.samples = 3;

    let to = folder.path().join("deep/saved.toml");
    std::fs::create_dir(to.parent().unwrap()).unwrap();
    save_model_scene(&scene, &model, &options, &to).unwrap();
    let read = formats::open(&to, &LoadOptions::default(), &Silent).unwrap().scene;
    assert_eq!(read.film, scene.film);
    assert_eq!((read.ambient, &read.background), (scene.ambient, &scene.background));
    let cameras =
        |scene: &Scene| scene.cameras.iter().map(|named| (named.camera, named.path.clone())).collect::<Vec<_>>();
    assert_eq!(cameras(&read), cameras(&scene));
    let lights = |scene: &Scene| scene.lights.iter().map(|light| (light.kind, light.color)).collect::<Vec<_>>();
    assert_eq!(lights(&read), lights(&scene));
    assert_eq!(read.materials, scene.materials);
    assert_eq!(read.objects, scene.objects);
    assert_eq!(read.meshes[0].positions, scene.meshes[0].positions);
    assert_eq!(read.meshes[0].normals, scene.meshes[0].normals);
    assert_eq!(read.cameras[1].name, "auto 2");

    assert!(save_model_scene(&scene, &model, &options, &folder.path().join("a.txt")).is_err());
    let message = save_model_scene(&read, &to, &options, &folder.path().join("b.toml")).unwrap_err().to_string();
    assert!(message.contains("is a scene file already"), "{message}");
}

#[test]
fn a_saved_scene_reads_its_model_as_it_was_read() {
    let folder = folder_with("");
    let model = folder.path().join("m.gltf");
    let data = "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let text = serde_json::json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}, {"nodes": [1], "name": "the \"other\""}],
        "nodes": [{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"name": "one side"}],
        "buffers": [{"byteLength": 36, "uri": data}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    });
    std::fs::write(&model, text.to_string()).unwrap();
    let options = LoadOptions {
        scene: Some("the \"other\"".into()),
        cull_back_faces: true,
        time: Some(0.1 + 0.2),
        animation: Some("0".into()),
        crease_angle: Some(0.7),
        ..LoadOptions::default()
    };
    // Without the animation, which this file does not have.
    let scene =
        formats::open(&model, &LoadOptions { time: None, animation: None, ..options.clone() }, &Silent).unwrap().scene;
    let to = folder.path().join("saved.toml");
    save_model_scene(&scene, &model, &LoadOptions { time: None, animation: None, ..options.clone() }, &to).unwrap();
    let read = opened(&folder, "saved.toml").unwrap().scene;
    assert_eq!((read.objects[0].name.as_str(), read.materials.last().unwrap().single_sided), ("b", true));
    save_model_scene(&scene, &model, &options, &to).unwrap();
    let saved = std::fs::read_to_string(&to).unwrap();
    let value = |key: &str| {
        let line = saved.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = ")).unwrap();
        line.to_owned()
    };
    assert_eq!((value("time"), value("animation")), ("0.30000000000000004".into(), "\"0\"".into()));
    assert_eq!(value("crease_angle").parse::<f64>().unwrap().to_radians(), 0.7);
}

#[test]
fn films_at_the_limits_are_saved_and_read_back() {
    let folder = folder_with("");
    let (model, to) = (folder.path().join("m.obj"), folder.path().join("saved.toml"));
    let options = LoadOptions::default();
    let mut scene = formats::open(&model, &options, &Silent).unwrap().scene;
    for (side, samples, max_depth, exposure) in
        [(1, 1, 0, -LARGEST_EXPOSURE), (LONGEST_SIDE, MOST_SAMPLES, LARGEST_DEPTH, LARGEST_EXPOSURE)]
    {
        let film = FilmSettings { width: side, height: side, samples, max_depth, exposure, ..scene.film };
        assert!(film.check().is_ok());
        scene.film = film;
        save_model_scene(&scene, &model, &options, &to).unwrap();
        assert_eq!(formats::open(&to, &options, &Silent).unwrap().scene.film, film);
    }
}

#[test]
fn formats_are_told_by_suffix_and_content_and_others_are_refused_with_a_list() {
    let folder = folder_with("[[object]]\nsphere = {}\n");
    let copy = |from: &str, to: &str| std::fs::copy(folder.path().join(from), folder.path().join(to)).unwrap();
    copy("m.obj", "model.dat");
    copy("s.toml", "scene");
    copy("m.obj", "M2.OBJ");
    assert_eq!(opened(&folder, "model.dat").unwrap().scene.meshes.len(), 1);
    assert_eq!(opened(&folder, "M2.OBJ").unwrap().scene.lights.len(), 3, "a bare model is lit");
    assert_eq!(opened(&folder, "scene").unwrap().scene.quadrics.len(), 1);
    std::fs::write(folder.path().join("a.stl"), "solid x").unwrap();
    let message = opened(&folder, "a.stl").unwrap_err().to_string();
    let expected = "a.stl: .stl is not supported; accepted are .toml (scene), .obj, .gltf and .glb (models) and .whb (built scene)";
    assert!(message.ends_with(expected), "{message}");
    assert!(opened(&folder, "none.obj").unwrap_err().to_string().ends_with("none.obj: there is no such file"));
    assert!(opened(&folder, ".").unwrap_err().to_string().contains("is a folder; name a scene or model file in it"));
}

#[test]
fn built_in_meshes_need_no_file() {
    let names: Vec<_> = builtin_names().collect();
    assert_eq!(names, ["box", "icosphere", "torus", "teapot"]);
    let folder = folder_with("");
    for name in names {
        let text = format!("[[object]]\nbuiltin = \"{name}\"\nnormals = \"smooth\"\n");
        let loaded = parse(&text, &folder.path().join("s.toml"), &LoadOptions::default(), &Silent).unwrap();
        assert_eq!((loaded.scene.objects.len(), loaded.scene.meshes[0].normals.is_some()), (1, true), "{name}");
        assert_eq!(loaded.ledger.files().count(), 1, "{name}: the scene file alone");
    }
    let wrong = parse("[[object]]\nbuiltin = \"teepot\"\n", Path::new("s.toml"), &LoadOptions::default(), &Silent);
    let message = wrong.unwrap_err().to_string();
    assert!(message.contains("s.toml:2:11") && message.contains("did you mean `teapot`?"), "{message}");
}

#[test]
fn what_is_not_visible_is_read_and_left_out() {
    let folder = folder_with(
        "[[object]]\nmesh = \"m.obj\"\nname = \"a\"\nvisible = false\n\
         [[object]]\nsphere = {}\nname = \"b\"\nvisible = true\n\
         [[object]]\nplane = {}\nvisible = false\ninstances = [{ scale = 1 }, { scale = 2 }]\n\
         [[override]]\nmaterial = \"red\"\nkr = 0.5\n",
    );
    let scene = opened(&folder, "s.toml").unwrap().scene;
    assert_eq!(scene.objects.iter().map(|object| object.name.as_str()).collect::<Vec<_>>(), ["b"]);
    let folder = folder_with("[[object]]\nmesh = \"none.obj\"\nvisible = false\n");
    assert!(opened(&folder, "s.toml").unwrap_err().to_string().contains("`none.obj` is not there"));
}

#[test]
fn a_scene_read_again_shares_what_has_not_changed() {
    let text = "[[object]]\nmesh = \"m.obj\"\n[[object]]\nsphere = {}\n[[object]]\nmesh = \"m.obj\"\n";
    let folder = folder_with(text);
    let mut assets = Assets::default();
    let mut read = |text: &str| {
        parse_with(text, &folder.path().join("s.toml"), &LoadOptions::default(), &mut assets, &Silent).unwrap()
    };
    let first = read(text);
    assert_eq!(first.entries, [0, 1, 2]);
    let second = read(&format!("[[material]]\nname = \"new\"\ntexture = \"t.png\"\n{text}material = \"new\"\n"));
    let (a, b) = (&first.loaded.scene, &second.loaded.scene);
    assert!(Arc::ptr_eq(&a.meshes[0], &b.meshes[0]), "a material of the scene's does not change meshes");
    let image = |scene: &Scene| {
        let blue = scene.materials.iter().find(|material| material.name == "blue").unwrap();
        scene.textures[blue.diffuse_texture.unwrap().texture as usize].name.clone()
    };
    assert_eq!(image(a), image(b));
    assert_eq!(b.materials[b.objects[2].material.unwrap() as usize].name, "new");
    assert_eq!((second.imported_materials, b.materials.len()), (a.materials.len(), a.materials.len() + 1));

    std::fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(read(text).loaded.scene.meshes[0].indices.len(), 1, "a file that changed is read again");
}

/// Every block of the manual's page that is marked as TOML is a whole scene file.
#[test]
fn the_manuals_examples_are_read() {
    let page = include_str!("../../manual/scene_format.md");
    let folder = folder_with("");
    let path = folder.path().join("page.toml");
    for name in ["teapot.obj", "chair.obj"] {
        std::fs::copy(folder.path().join("m.obj"), folder.path().join(name)).unwrap();
    }
    for name in ["wood.png", "sky.png"] {
        std::fs::copy(folder.path().join("t.png"), folder.path().join(name)).unwrap();
    }
    let blocks: Vec<&str> = page.split("```toml\n").skip(1).filter_map(|rest| rest.split("```").next()).collect();
    assert!(blocks.len() > 3);
    for block in blocks {
        parse(block, &path, &LoadOptions::default(), &Silent).unwrap_or_else(|error| panic!("{error}\n{block}"));
    }
}
