//! The program, run as a process.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

/// The manual's page on the command line.
const MANUAL: &str = include_str!("../src/manual/command_line.md");

/// A folder to run the program in.
pub struct Workshop {
    folder: TempDir,
}

impl Workshop {
    /// A folder with `model.obj`: a floor with a box and a slanted face on it, in two materials.
    pub fn new() -> Self {
        let workshop = Self { folder: tempfile::tempdir().unwrap() };
        workshop.write(
            "model.obj",
            "mtllib model.mtl\n\
             v -2 0 -2\nv 2 0 -2\nv 2 0 2\nv -2 0 2\n\
             v -1 0 0\nv 0 0 0\nv 0 1 0\nv -1 1 0\nv -1 0 -1\nv 0 0 -1\nv 0 1 -1\nv -1 1 -1\n\
             v 0.3 0 1\nv 1.5 0 0.6\nv 0.9 1.25 0.2\n\
             usemtl floor\nf 4 3 2 1\n\
             usemtl box\nf 5 6 7 8\nf 6 10 11 7\nf 10 9 12 11\nf 9 5 8 12\nf 8 7 11 12\n\
             usemtl floor\nf 13 14 15\n",
        );
        workshop
            .write("model.mtl", "newmtl floor\nKd 0.7 0.7 0.6\nnewmtl box\nKd 0.6 0.1 0.1\nKs 0.5 0.5 0.5\nillum 3\n");
        workshop
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    pub fn names(&self) -> BTreeSet<String> {
        fs::read_dir(self.folder.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect()
    }

    /// The program with arguments separated by blanks, in this folder.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_whitted"));
        command.args(arguments.split_whitespace()).current_dir(self.folder.path()).stdin(Stdio::null());
        // What the tests' user has set must not take part.
        command.env_remove("WHITTED_EMBREE");
        command
    }

    pub fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs the program, which must succeed, and gives its standard output.
    pub fn succeed(&self, arguments: &str) -> Vec<u8> {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
        output.stdout
    }

    /// Runs the program, which must end with 1, silent on standard output, and gives its one line of standard error.
    pub fn fail(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {stderr}");
        assert!(output.stdout.is_empty(), "{arguments}");
        assert_eq!(stderr.lines().count(), 1, "{arguments}: {stderr}");
        assert!(stderr.starts_with("error: "), "{arguments}: {stderr}");
        stderr
    }

    /// The PNG that a rendering of the model with these flags streams.
    pub fn png(&self, flags: &str) -> Vec<u8> {
        self.succeed(&format!("render model.obj -o - {flags}"))
    }
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Every key of an object, nested ones with dots; lists are not looked into.
fn keys(value: &Value) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for (key, value) in value.as_object().into_iter().flatten() {
        all.insert(key.clone());
        all.extend(keys(value).into_iter().map(|inner| format!("{key}.{inner}")));
    }
    all
}

/// The document has these keys, no others, and the manual names each.
pub fn assert_documented(document: &Value, expected: &[&str]) {
    let expected: BTreeSet<String> = expected.iter().map(|key| key.to_string()).collect();
    assert_eq!(keys(document), expected);
    for key in &expected {
        let name = key.rsplit('.').next().unwrap();
        assert!(MANUAL.contains(&format!("`{name}`")) || MANUAL.contains(&format!("\"{name}\"")), "`{key}` is missing");
    }
}

#[test]
fn the_picture_is_named_after_the_input_and_its_name_is_printed() {
    let workshop = Workshop::new();
    let printed = workshop.succeed("render model.obj --size 8x6 --spp 1");
    assert_eq!(text(&printed), "model.png\n");
    let picture = image::open(workshop.path("model.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (8, 6));
    assert_eq!(workshop.names().len(), 3, "no temporary file stays: {:?}", workshop.names());
}

#[test]
fn a_streamed_picture_is_alone_on_standard_output() {
    let workshop = Workshop::new();
    let streamed = workshop.png("--size 8x6 --spp 1");
    workshop.succeed("render model.obj --size 8x6 --spp 1");
    assert_eq!(streamed, fs::read(workshop.path("model.png")).unwrap());
}

#[test]
fn every_format_is_written_by_its_suffix() {
    let workshop = Workshop::new();
    for (name, magic) in [("a.png", &b"\x89PNG"[..]), ("a.JPG", b"\xff\xd8\xff"), ("a.exr", b"\x76\x2f\x31\x01")] {
        workshop.succeed(&format!("render model.obj --size 4x4 --spp 1 -o {name}"));
        assert!(fs::read(workshop.path(name)).unwrap().starts_with(magic), "{name}");
    }
    assert!(workshop.fail("render model.obj -o a.gif").contains(".png"));
}

#[test]
fn extra_values_go_into_an_exr_or_beside_another_picture() {
    let workshop = Workshop::new();
    workshop.succeed("render model.obj --size 4x4 --spp 1 --aov depth,normal -o layers.exr");
    workshop.succeed("render model.obj --size 4x4 --spp 1 --aov depth,normal -o beside.png");
    assert!(workshop.path("beside.aov.exr").exists());
    assert!(!workshop.path("layers.aov.exr").exists());
    let bytes = fs::read(workshop.path("layers.exr")).unwrap();
    assert!(bytes.windows(5).any(|part| part == b"depth"));
    assert!(workshop.fail("render model.obj -o - --aov depth").contains("--aov"));
}

#[test]
fn wrong_usage_ends_with_2() {
    let workshop = Workshop::new();
    for arguments in [
        "",
        "paint model.obj",
        "render",
        "render model.obj --size 5",
        "render model.obj --spp 0",
        "render model.obj --max-depth 1001",
        "render model.obj --crop 5,5,5,9",
        "render model.obj --view left --orbit 1,2",
        "render model.obj --quiet --verbose",
        "render model.obj --fov 180",
        "render model.obj --colour",
        "completions tcsh",
    ] {
        let output = workshop.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{arguments}");
    }
    assert_eq!(workshop.run("--help").status.code(), Some(0));
    assert!(text(&workshop.succeed("--version")).contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn failures_are_one_line_that_names_the_file() {
    let workshop = Workshop::new();
    assert!(workshop.fail("render missing.obj").contains("missing.obj"));
    assert!(workshop.fail("info missing.glb").contains("missing.glb"));
    workshop.write("bad.toml", "[camera\n");
    assert!(workshop.fail("info bad.toml").contains("bad.toml:1"));
    assert!(workshop.fail("render model.obj --camera nobody").contains("nobody"));
    let crop = workshop.fail("render model.obj --size 8x6 --crop 0,0,9,6");
    assert!(crop.contains("8x6"), "{crop}");
}

#[test]
fn an_output_that_cannot_be_written_is_found_out_before_rendering() {
    let workshop = Workshop::new();
    // At this size a rendering would take hours.
    let started = Instant::now();
    assert!(workshop.fail("render model.obj --size 60000x60000 -o nowhere/out.png").contains("nowhere"));
    fs::create_dir(workshop.path("folder.png")).unwrap();
    assert!(workshop.fail("render model.obj --size 60000x60000 -o folder.png").contains("folder.png"));
    assert!(started.elapsed() < Duration::from_secs(10));
}

#[test]
fn existing_files_are_replaced_unless_that_is_refused() {
    let workshop = Workshop::new();
    workshop.write("out.png", "old");
    let refused = workshop.fail("render model.obj --size 4x4 --spp 1 -o out.png --no-clobber");
    assert!(refused.contains("out.png") && refused.contains("--no-clobber"), "{refused}");
    assert_eq!(fs::read(workshop.path("out.png")).unwrap(), b"old");
    workshop.succeed("render model.obj --size 4x4 --spp 1 -o out.png");
    assert!(fs::read(workshop.path("out.png")).unwrap().starts_with(b"\x89PNG"));
    workshop.succeed("render model.obj --size 4x4 --spp 1 -o new.png --no-clobber");
}

#[test]
fn inputs_are_never_overwritten() {
    let workshop = Workshop::new();
    let model = fs::read(workshop.path("model.obj")).unwrap();
    for flags in ["--stats-json model.obj", "--save-scene ./model.obj", "-o model.obj"] {
        workshop.fail(&format!("render model.obj --size 4x4 --spp 1 {flags}"));
        assert_eq!(fs::read(workshop.path("model.obj")).unwrap(), model, "{flags}");
    }
}

#[test]
fn files_that_an_input_refers_to_are_never_overwritten() {
    let workshop = Workshop::new();
    image::RgbImage::from_pixel(2, 2, image::Rgb([200, 90, 20])).save(workshop.path("wood.png")).unwrap();
    let wood = fs::read(workshop.path("wood.png")).unwrap();
    workshop.write("model.mtl", "newmtl floor\nmap_Kd wood.png\nnewmtl box\n");
    workshop.write(
        "model.gltf",
        r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}], "images": [{"uri": "wood.png"}],
            "buffers": [{"byteLength": 36, "uri":
                "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}]}"#,
    );
    workshop.write(
        "scene.toml",
        "[[material]]\nname = \"wood\"\ntexture = \"wood.png\"\n[[object]]\nsphere = {}\nmaterial = \"wood\"\n",
    );
    workshop.write("outer.toml", "[[object]]\nmesh = \"model.gltf\"\n");
    for input in ["model.obj", "model.gltf", "scene.toml", "outer.toml"] {
        let refused = workshop.fail(&format!("render {input} --size 4x4 --spp 1 -o wood.png --quiet"));
        assert!(refused.contains("wood.png"), "{refused}");
        assert_eq!(fs::read(workshop.path("wood.png")).unwrap(), wood, "{input}");
        workshop.succeed(&format!("render {input} --size 4x4 --spp 1 -o other.png --quiet"));
    }
}

#[test]
fn a_crop_has_the_pixels_of_the_full_picture() {
    let workshop = Workshop::new();
    let decode = |png: Vec<u8>| image::load_from_memory(&png).unwrap().to_rgb8();
    let full = decode(workshop.png("--size 40x30 --spp 4"));
    let crop = decode(workshop.png("--size 40x30 --spp 4 --crop 11,7,29,30"));
    assert_eq!(crop.dimensions(), (18, 23));
    for (x, y, pixel) in crop.enumerate_pixels() {
        assert_eq!(pixel, full.get_pixel(x + 11, y + 7), "{x} {y}");
    }
    assert!(full.pixels().any(|pixel| pixel != full.get_pixel(0, 0)), "the picture shows something");
}

#[test]
fn threads_and_accelerators_do_not_change_a_byte() {
    let workshop = Workshop::new();
    let reference = workshop.png("--size 40x30 --spp 2 --threads 1 --accelerator linear");
    for flags in [
        "--threads 2 --accelerator linear",
        "--threads 1 --accelerator bvh2",
        "--threads 2 --accelerator bvh2 --preset best",
        "--threads 2 --accelerator cwbvh --preset fast",
        "--accelerator compact",
        "--accelerator auto",
    ] {
        assert!(workshop.png(&format!("--size 40x30 --spp 2 {flags}")) == reference, "{flags}");
    }
    for simd in ["portable", "avx2", "avx512"] {
        let mut command = workshop.command("render model.obj --size 40x30 --spp 2 -o -");
        let output = command.env("WHITTED_SIMD", simd).output().unwrap();
        assert!(output.status.success() && output.stdout == reference, "{simd}");
    }
    let output = workshop.command("render model.obj --size 4x3 -o -").env("WHITTED_SIMD", "avx-512").output().unwrap();
    assert!(output.status.success() && text(&output.stderr).contains("avx-512"), "{}", text(&output.stderr));
}

/// The first and last column and row, from 0, in which a ray hits something.
fn box_of_hits(workshop: &Workshop, flags: &str, width: usize) -> [usize; 4] {
    workshop.succeed(&format!("render model.obj --spp 1 --aov id -o view.png {flags}"));
    let image = exr::prelude::read_first_flat_layer_from_file(workshop.path("view.aov.exr")).unwrap();
    let ids = image.layer_data.channel_data.list.iter().find(|channel| channel.name.to_string() == "id.instance");
    let ids: Vec<u32> = match &ids.unwrap().sample_data {
        exr::prelude::FlatSamples::U32(ids) => ids.clone(),
        other => panic!("{other:?}"),
    };
    let hits = || ids.iter().enumerate().filter(|(_, id)| **id != 0).map(|(at, _)| (at % width, at / width));
    let (xs, ys) = (|| hits().map(|hit| hit.0), || hits().map(|hit| hit.1));
    [xs().min().unwrap(), xs().max().unwrap(), ys().min().unwrap(), ys().max().unwrap()]
}

#[test]
fn views_differ_and_fill_the_picture() {
    let workshop = Workshop::new();
    let (width, height) = (120, 90);
    // The margin is 6 % of each side. Of a sharp tip the last pixels may be missing, since their centres lie beside it.
    const TIP: f64 = 3.0;
    let (beside, above) = (0.06 * width as f64, 0.06 * height as f64);
    let touches = |border: usize, margin: f64| (border as f64 - margin).abs() <= TIP;
    let mut seen = BTreeSet::new();
    for flags in ["", "--view front", "--view back", "--view top", "--orbit -40,10", "--orbit -40,40 --fov 80"] {
        let [left, right, top, bottom] = box_of_hits(&workshop, &format!("--size {width}x{height} {flags}"), width);
        let (right, bottom) = (width - 1 - right, height - 1 - bottom);
        let fills_width = touches(left, beside) && touches(right, beside);
        let fills_height = touches(top, above) && touches(bottom, above);
        assert!(fills_width || fills_height, "{flags}: {left} {right} {top} {bottom}");
        let least_beside = left.min(right) as f64;
        let least_above = top.min(bottom) as f64;
        assert!(least_beside >= beside - TIP && least_above >= above - TIP, "{flags}: {left} {right} {top} {bottom}");
        assert!(seen.insert(fs::read(workshop.path("view.png")).unwrap()), "{flags}");
    }
}

#[test]
fn quiet_is_silent_and_verbose_is_not() {
    let workshop = Workshop::new();
    workshop.write("lost.obj", "mtllib lost.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let quiet = workshop.run("render lost.obj --size 4x4 --spp 1 --quiet");
    assert!(quiet.status.success());
    assert_eq!((text(&quiet.stdout), text(&quiet.stderr)), (String::new(), String::new()));
    let normal = text(&workshop.run("render lost.obj --size 4x4 --spp 1").stderr);
    assert!(normal.lines().all(|line| line.starts_with("warning: ")) && normal.contains("lost.mtl"), "{normal}");
    let verbose = text(&workshop.run("render lost.obj --size 4x4 --spp 1 --verbose").stderr);
    for stage in ["load", "build", "render", "write", "rays"] {
        assert!(verbose.lines().any(|line| line.starts_with(stage)), "{stage}: {verbose}");
    }
}

#[test]
fn a_closed_standard_output_is_no_panic() {
    let workshop = Workshop::new();
    for (arguments, code) in [
        ("info model.obj", 0),
        ("completions bash", 0),
        ("render model.obj --size 4x4 --spp 1", 0),
        ("render model.obj --size 4x4 --spp 1 -o -", 1),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = workshop.command(arguments).stdout(writer).stderr(Stdio::piped()).output().unwrap();
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {stderr}");
        assert!(!stderr.contains("panicked"), "{arguments}: {stderr}");
    }
}

/// A rendering that began half a second ago and takes much longer than any test, and its further lines of
/// diagnostics.
#[cfg(unix)]
fn begin_rendering(workshop: &Workshop, what: &str) -> (Child, impl Iterator<Item = String>) {
    let arguments = format!("render {what} --verbose");
    let mut child = workshop.command(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    lines.find(|line| line.starts_with("build")).expect("rendering begins");
    std::thread::sleep(Duration::from_millis(500));
    (child, lines)
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
}

#[cfg(unix)]
#[test]
fn an_interrupt_saves_what_is_finished_and_leaves_the_picture() {
    let workshop = Workshop::new();
    workshop.write("out.png", "old");
    // On a busy machine the first tile may take seconds: wait longer until there is one.
    let some_tiles = [0, 1, 3, 9].into_iter().any(|seconds| {
        let (child, lines) =
            begin_rendering(&workshop, "model.obj --accelerator linear --size 3000x3000 --spp 16 -o out.png");
        std::thread::sleep(Duration::from_secs(seconds));
        interrupt_and_check(&workshop, child, lines)
    });
    assert!(some_tiles, "some tiles are finished");
}

/// Interrupts a rendering to `out.png`, checks what it leaves, and tells whether any tile was finished.
#[cfg(unix)]
fn interrupt_and_check(workshop: &Workshop, child: Child, lines: impl Iterator<Item = String>) -> bool {
    interrupt(&child);
    let told = lines.last().unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(output.stdout.is_empty());
    assert!(told.contains("out.partial.png"), "{told}");
    assert_eq!(fs::read(workshop.path("out.png")).unwrap(), b"old");
    let partial = image::open(workshop.path("out.partial.png")).unwrap().to_rgb8();
    assert_eq!(partial.dimensions(), (3000, 3000));
    assert_eq!(workshop.names().len(), 4, "{:?}", workshop.names());
    partial.pixels().any(|pixel| pixel.0 != [0; 3])
}

#[cfg(unix)]
#[test]
fn a_second_interrupt_ends_at_once() {
    let workshop = Workshop::new();
    // The first interrupt takes effect between batches of rays. In a mirrored room each meeting with the glass makes two of one.
    workshop.write(
        "glass.toml",
        "film.max_depth = 60\n[camera]\neye = [0, 0, 3]\ntarget = [0, 0, 0]\n[[material]]\nname = \"glass\"\n\
         kr = 0.5\nkt = 0.5\nior = 1.5\n[[material]]\nname = \"room\"\nkr = 1\n[[object]]\nsphere = {}\nmaterial = \"glass\"\n\
         [[object]]\nsphere = {}\nmaterial = \"room\"\ntransform = { scale = 4 }\n",
    );
    let (mut child, _lines) = begin_rendering(&workshop, "glass.toml -o out.png");
    interrupt(&child);
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(child.try_wait().unwrap(), None);
    interrupt(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(workshop.names().len(), 3, "{:?}", workshop.names());
}

#[test]
fn every_shell_gets_completions() {
    let workshop = Workshop::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = text(&workshop.succeed(&format!("completions {shell}")));
        assert!(script.contains("save-scene") && script.contains("whitted"), "{shell}");
    }
}

#[test]
fn info_is_readable_and_its_json_is_stable() {
    let workshop = Workshop::new();
    let readable = text(&workshop.succeed("info model.obj --tree"));
    for part in ["triangles", "13", "floor", "wide", "180 B", "auto (used)", "1.25"] {
        assert!(readable.contains(part), "{part}: {readable}");
    }
    let json: Value = serde_json::from_slice(&workshop.succeed("info model.obj --json")).unwrap();
    assert_eq!(json["schema"], 1);
    assert_eq!(json["triangles"]["unique"], 13);
    assert_eq!(json["bounds"]["min"], serde_json::json!([-2.0, 0.0, -2.0]));
    assert_eq!(json["bounds"]["max"], serde_json::json!([2.0, 1.25, 2.0]));
    assert_eq!(json["tree"], Value::Null);
    let mut expected = vec![
        "schema",
        "input",
        "files",
        "triangles",
        "triangles.unique",
        "triangles.instanced",
        "triangles.dropped",
        "triangles.dropped.non_finite",
        "triangles.dropped.zero_area",
        "triangles.dropped.bad_index",
        "meshes",
        "groups",
        "instances",
        "quadrics",
        "materials",
        "textures",
        "lights",
        "cameras",
        "active_camera",
        "film",
        "film.width",
        "film.height",
        "film.samples",
        "film.max_depth",
        "film.clamp",
        "film.transfer",
        "film.exposure",
        "bounds",
        "bounds.min",
        "bounds.max",
        "origin",
        "rounding",
        "rounding.mesh",
        "rounding.coordinate_loss",
        "rounding.finest_edge",
        "needs",
        "needs.mesh_objects",
        "needs.quadric_objects",
        "needs.unbounded_quadrics",
        "needs.transformed_objects",
        "needs.smooth_meshes",
        "needs.uv_meshes",
        "needs.textured_materials",
        "needs.reflective_materials",
        "needs.transmissive_materials",
        "needs.lights",
        "needs.background_image",
        "needs.colored_meshes",
        "needs.detailed_materials",
        "needs.materials_with_holes",
        "needs.normal_mapped_materials",
        "bytes",
        "bytes.positions",
        "bytes.indices",
        "bytes.normals",
        "bytes.uvs",
        "bytes.materials",
        "bytes.textures",
        "bytes_per_triangle",
        "bytes_per_triangle.positions",
        "bytes_per_triangle.indices",
        "bytes_per_triangle.normals",
        "bytes_per_triangle.uvs",
        "bytes_per_triangle.materials",
        "ledger",
        "doctor",
        "tree",
        "estimate",
    ];
    assert_documented(&json, &expected);
    let json: Value = serde_json::from_slice(&workshop.succeed("info model.obj --json --validate")).unwrap();
    assert_eq!(json["tree"]["validated"], true);
    expected.extend([
        "tree.accelerator",
        "tree.seconds",
        "tree.node_bytes",
        "tree.leaf_bytes",
        "tree.top_level_bytes",
        "tree.nodes",
        "tree.leaves",
        "tree.max_depth",
        "tree.bytes_per_triangle",
        "tree.validated",
        "doctor.seconds",
        "doctor.flaws",
        "doctor.size",
        "doctor.scaled_meshes",
    ]);
    assert_documented(&json, &expected);
}

#[test]
fn strict_fails_on_what_is_not_honoured_and_lists_it() {
    let workshop = Workshop::new();
    workshop.succeed("info model.obj --strict");
    workshop.succeed("render model.obj --size 8x8 --spp 1 --strict");
    workshop.write("model.mtl", "newmtl floor\nKd 1 1 1\nKa 1 1 1\nodd 1\nnewmtl box\nKa 1 1 1\nKd 1 0 0\n");
    let before = workshop.names();
    for command in ["info", "render --quiet", "render --verbose"] {
        let output = workshop.run(&format!("{command} model.obj --strict"));
        assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{command}");
        let message = text(&output.stderr);
        let lines: Vec<_> = message.lines().collect();
        let (last, listed) = lines.split_last().unwrap();
        assert!(
            last.starts_with("error: model.obj: 2 features are ") && last.ends_with("leave out --strict to do without")
        );
        let ignored: Vec<_> = listed.iter().filter(|line| line.starts_with("ignored: ")).collect();
        assert_eq!(ignored.len(), 2, "{message}");
        assert!(ignored.iter().any(|line| line.contains("odd")), "{message}");
        assert!(ignored.iter().any(|line| line.contains("Ka") && line.contains("2 times")), "{message}");
    }
    assert_eq!(workshop.names(), before, "nothing is written");
    let verbose = text(&workshop.run("render model.obj --size 8x8 --spp 1 --verbose").stderr);
    let odd = verbose.lines().find(|line| line.contains("odd")).unwrap();
    assert!(odd.contains("1 material") && odd.contains(" pixel") && !odd.contains(" 0 pixels"), "{odd}");
}

#[test]
fn flaws_of_meshes_are_told_with_their_places_and_are_no_failure() {
    let workshop = Workshop::new();
    let flaws = |name: &str| {
        let json: Value = serde_json::from_slice(&workshop.succeed(&format!("info {name} --json --validate"))).unwrap();
        json["doctor"]["flaws"].clone()
    };
    // A tetrahedron in map coordinates, one face turned round; and a quad before it, so that faces are not triangles.
    let rest = "f 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 7 8\n";
    let vertices = "v 9e6 0 0\nv 9e6 0 1\nv 9e6 1 1\nv 9e6 1 0\nv 5e6 0 0\nv 5000001 0 0\nv 5e6 1 0\nv 5e6 0 1\n";
    workshop.write("turned.obj", &format!("{vertices}f 1 2 3 4\n{rest}"));
    let found = flaws("turned.obj");
    assert_eq!(found.as_array().unwrap().len(), 2, "{found}");
    assert_eq!((&found[0]["flaw"], &found[0]["count"]), (&"inconsistent_winding".into(), &3.into()));
    assert_eq!((&found[1]["flaw"], &found[1]["count"]), (&"open_edge".into(), &4.into()), "around the quad");
    let turned = &found[0]["places"][0];
    assert_eq!((&turned["triangle"], &turned["face"]), (&2.into(), &1.into()));
    assert_eq!(turned["mesh"], "turned");
    assert_eq!(found[1]["places"][0]["position"][0], 9e6, "in the file's coordinates");
    let told = text(&workshop.succeed("info turned.obj --validate"));
    assert!(told.contains("open edges: 4\n    mesh `turned`, triangle 0, face 0, vertex "), "{told}");
    assert!(told.contains("huge, 4.000e6 units across; likely in units of a millimetre"), "{told}");
    workshop.write("closed.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
    assert_eq!(flaws("closed.obj"), serde_json::json!([]));
}

#[test]
fn textures_are_named_as_seen_from_the_model() {
    let workshop = Workshop::new();
    let folder = workshop.path("maps");
    fs::create_dir(&folder).unwrap();
    for path in [folder.join("wood.png"), workshop.path("tin.png")] {
        image::RgbImage::from_pixel(2, 2, image::Rgb([200, 90, 20])).save(path).unwrap();
    }
    let absolute = folder.join("wood.png");
    workshop.write("model.mtl", &format!("newmtl floor\nmap_Kd {}\nnewmtl box\nmap_Kd tin.png\n", absolute.display()));
    let model = workshop.path("model.obj");
    for input in ["model.obj", "./model.obj", model.to_str().unwrap()] {
        let json: Value = serde_json::from_slice(&workshop.succeed(&format!("info {input} --json"))).unwrap();
        let names: Vec<_> = json["textures"].as_array().unwrap().iter().map(|texture| &texture["name"]).collect();
        assert_eq!(names, ["maps/wood.png", "tin.png"], "{input}");
    }
}

#[test]
fn the_statistics_of_a_rendering_are_stable() {
    let workshop = Workshop::new();
    workshop.succeed("render model.obj --size 9x7 --spp 3 --crop 1,1,9,7 --threads 2 --stats-json stats.json");
    let json: Value = serde_json::from_slice(&fs::read(workshop.path("stats.json")).unwrap()).unwrap();
    assert_eq!(json["schema"], 1);
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(json["rays"]["camera"], 8 * 6 * 3);
    assert_eq!(json["settings"]["threads"], 2);
    assert_eq!(json["bytes"]["film"], 8 * 6 * 12);
    let seconds = |name: &str| json["thread_seconds"][name].as_f64().unwrap();
    assert!(seconds("traversal") > 0.0 && seconds("shading") > 0.0);
    let all = seconds("traversal") + seconds("shading") + seconds("rest");
    assert!(all <= 2.0 * json["seconds"]["render"].as_f64().unwrap() + 1e-9);
    assert_eq!(json["settings"]["accelerator"], "wide");
    #[cfg(target_os = "linux")]
    assert!(json["bytes"]["peak_resident"].as_u64().unwrap() > 1 << 20);
    assert_documented(
        &json,
        &[
            "schema",
            "version",
            "input",
            "output",
            "settings",
            "settings.width",
            "settings.height",
            "settings.samples",
            "settings.max_depth",
            "settings.clamp",
            "settings.transfer",
            "settings.exposure",
            "settings.camera",
            "settings.crop",
            "settings.crop.x0",
            "settings.crop.y0",
            "settings.crop.x1",
            "settings.crop.y1",
            "settings.aov",
            "settings.precision",
            "settings.accelerator",
            "settings.preset",
            "settings.threads",
            "rays",
            "rays.camera",
            "rays.shadow",
            "rays.reflected",
            "rays.refracted",
            "rays.total",
            "rays_per_second",
            "seconds",
            "seconds.load",
            "seconds.build",
            "seconds.render",
            "seconds.write",
            "thread_seconds",
            "thread_seconds.traversal",
            "thread_seconds.shading",
            "thread_seconds.rest",
            "bytes",
            "bytes.geometry",
            "bytes.textures",
            "bytes.tree_nodes",
            "bytes.tree_leaves",
            "bytes.top_level",
            "bytes.film",
            "bytes.peak_resident",
        ],
    );
}

#[test]
fn a_limit_of_memory_chooses_the_compact_structure_or_refuses() {
    use std::fmt::Write;
    let workshop = Workshop::new();
    const SIDE: u64 = 50;
    let mut hills = String::new();
    for (x, z) in (0..=SIDE).flat_map(|z| (0..=SIDE).map(move |x| (x, z))) {
        writeln!(hills, "v {x} {} {z}", x * z % 7).unwrap();
    }
    for (x, z) in (0..SIDE).flat_map(|z| (0..SIDE).map(move |x| (x, z))) {
        let corner = z * (SIDE + 1) + x + 1;
        writeln!(hills, "f {} {} {} {}", corner, corner + SIDE + 1, corner + SIDE + 2, corner + 1).unwrap();
    }
    workshop.write("hills.obj", &hills);
    let render = |flags: &str| {
        workshop
            .succeed(&format!("render hills.obj --size 20x10 --spp 1 -o hills.png --stats-json stats.json {flags}"));
        let json: Value = serde_json::from_slice(&fs::read(workshop.path("stats.json")).unwrap()).unwrap();
        (json, fs::read(workshop.path("hills.png")).unwrap())
    };
    let (json, picture) = render("");
    assert_eq!(json["settings"]["accelerator"], "wide");
    let (json, same) = render("--memory-limit 2G");
    assert_eq!(json["settings"]["accelerator"], "wide");
    assert!(same == picture);
    // Between what the two take while they are built.
    let triangles = 2 * SIDE * SIDE;
    let others = json["bytes"]["geometry"].as_u64().unwrap() + 40 * 20 * 10;
    let limit = others + triangles * (36 + 512 + 35);
    let (json, same) = render(&format!("--memory-limit {limit}"));
    assert_eq!(json["settings"]["accelerator"], "compact");
    assert!(json["bytes"]["tree_leaves"].as_u64().unwrap() < 5 * triangles);
    assert!(same == picture);
    let info: Value =
        serde_json::from_slice(&workshop.succeed(&format!("info hills.obj --tree --json --memory-limit {limit}")))
            .unwrap();
    assert_eq!(info["tree"]["accelerator"], "compact");
    assert!(info["tree"]["bytes_per_triangle"].as_f64().unwrap() < 24.0);
    // Before it is read: its last line is wrong.
    workshop.write("flawed.obj", &format!("{hills}f 1 2\n"));
    for flags in ["hills.obj", "flawed.obj", "hills.obj --turntable 3"] {
        let refused = workshop.fail(&format!("render {flags} --memory-limit 1M"));
        assert!(refused.contains("MiB") && refused.contains("raise the limit"), "{refused}");
        assert!(refused.contains("--accelerator compact"), "{refused}");
    }
    let exact = workshop.fail("render hills.obj --memory-limit 2G --precision f64");
    assert!(exact.contains("--precision f64"), "{exact}");
    let both = workshop.run("render hills.obj --memory-limit 1M --accelerator wide");
    assert_eq!(both.status.code(), Some(2), "{}", text(&both.stderr));
}

#[test]
fn estimates_are_near_what_rendering_takes() {
    let workshop = Workshop::new();
    let info = |flags: &str| -> Value {
        let text = workshop.succeed(&format!("info model.obj --json --estimate --size 320x200 {flags}"));
        serde_json::from_slice(&text).unwrap()
    };
    let json = info("--spp 20 --machines 3 --cores 1");
    let estimate = &json["estimate"];
    let keys =
        ["peak_bytes", "measured", "load", "build", "render", "write", "seconds", "tiles", "tried", "tried_samples"];
    let keys = keys.into_iter().chain(["threads", "shared", "worthwhile"]);
    assert!(keys.clone().all(|key| !estimate[key].is_null()), "{estimate}");
    let page = &MANUAL[MANUAL.find("### `info --json`").unwrap()..];
    assert!(keys.into_iter().all(|key| page.contains(&format!("\"{key}\""))));
    assert_eq!(estimate["tiles"].as_u64(), Some(70));
    assert!([4, 20].contains(&estimate["tried_samples"].as_u64().unwrap()), "{estimate}");
    assert_eq!(json["tree"]["accelerator"], "wide");
    let text = text(&workshop.succeed("info model.obj --estimate --size 320x200 --spp 20 --machines 3"));
    assert!(
        ["memory at most", "rendering", "the longest part", "worthwhile"].iter().all(|row| text.contains(row)),
        "{text}"
    );

    // Other tests run beside this one: what is told must be of the size of what is.
    workshop.succeed("render model.obj --size 320x200 --spp 20 -o a.png --stats-json stats.json");
    let stats: Value = serde_json::from_slice(&fs::read(workshop.path("stats.json")).unwrap()).unwrap();
    let ratio = estimate["render"].as_f64().unwrap() / stats["seconds"]["render"].as_f64().unwrap();
    assert!((0.2..5.0).contains(&ratio), "{ratio}");
    if let Some(peak) = stats["bytes"]["peak_resident"].as_f64() {
        let ratio = estimate["peak_bytes"].as_f64().unwrap() / peak;
        assert!((0.8..1.25).contains(&ratio), "{ratio}");
    }
    assert_eq!(workshop.run("info model.obj --machines 3").status.code(), Some(2));
}

#[test]
fn a_saved_scene_renders_the_same_picture() {
    let workshop = Workshop::new();
    for flags in ["", "--view iso --fov 33.3", "--orbit -100,-7.7 --exposure 0.3 --max-depth 2 --normals smooth --up z"]
    {
        let from_model = workshop.png(&format!("--size 24x18 --spp 2 {flags} --save-scene saved.toml"));
        let from_scene = workshop.succeed("render saved.toml -o -");
        assert!(from_model == from_scene, "{flags}");
    }
    assert!(workshop.fail("render saved.toml --save-scene again.toml").contains("scene file already"));
    assert!(workshop.fail("render model.obj --save-scene saved.toml --no-clobber").contains("saved.toml"));
}
