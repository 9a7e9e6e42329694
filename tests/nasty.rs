//! Files that lie, are damaged or ask for too much, given to the program as a user would: it tells what is wrong with them, in
//! little time and memory.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde_json::json;

use crate::command_line::Workshop;
use crate::common::shared;

/// What any of the files may take.
const MOST_TIME: Duration = Duration::from_secs(10);
/// Address space in KiB, which bounds resident memory from above: 1 GiB.
const MOST_KIB: usize = 1 << 20;

/// All models below a folder.
fn models_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_model = |suffix| ["obj", "gltf", "glb"].into_iter().any(|model| suffix == model);
        if path.is_dir() {
            models_below(&path, found);
        } else if path.extension().is_some_and(is_model) {
            found.push(path);
        }
    }
}

/// The program in a shell that limits its memory, where the system can do that.
fn limited() -> Command {
    let program = env!("CARGO_BIN_EXE_whitted");
    if !cfg!(target_os = "linux") {
        return Command::new(program);
    }
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("ulimit -v {MOST_KIB} && exec \"$0\" \"$@\""), program]);
    shell
}

/// Runs the program on a model in an empty folder. The exit code, or what is wrong with how it ended.
fn run(model: &Path, command: &[&str]) -> Result<i32, String> {
    let folder = tempfile::tempdir().unwrap();
    let told = folder.path().join("told");
    let work = folder.path().join("work");
    fs::create_dir(&work).unwrap();
    let mut process = limited();
    process.arg(command[0]).arg(model).args(&command[1..]).args(["--threads", "2"]).current_dir(&work);
    process.stdin(Stdio::null()).stdout(Stdio::null()).stderr(File::create(&told).unwrap());
    let start = Instant::now();
    let mut child = process.spawn().unwrap();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > MOST_TIME {
            child.kill().unwrap();
            child.wait().unwrap();
            return Err(format!("took more than {MOST_TIME:?}"));
        }
        std::thread::sleep(Duration::from_millis(4));
    };
    let told = fs::read_to_string(&told).unwrap();
    let written: Vec<_> = fs::read_dir(&work).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let is_picture = || fs::read(work.join("out.png")).is_ok_and(|bytes| bytes.starts_with(b"\x89PNG"));
    match status.code() {
        Some(0) if command[0] == "render" && !(written == ["out.png"] && is_picture()) => {
            Err(format!("succeeded and wrote {written:?}"))
        }
        Some(0) => Ok(0),
        Some(1) if !written.is_empty() => Err(format!("failed and wrote {written:?}: {told}")),
        Some(1) => {
            let name = model.file_name().unwrap().to_str().unwrap();
            let error = told.lines().last().and_then(|line| line.strip_prefix("error: "));
            let cause = error.and_then(|error| error.split_once(name)).map(|(_, cause)| cause);
            let is_told = cause.is_some_and(|cause| cause.starts_with(':') && cause.len() > 10);
            if is_told { Ok(1) } else { Err(format!("does not tell file and cause: {told}")) }
        }
        _ => Err(format!("{status}: {told}")),
    }
}

#[test]
fn every_nasty_model_is_shown_or_refused_in_little_time_and_memory() {
    let mut models = Vec::new();
    for folder in ["nasty-obj", "nasty-gltf"] {
        let Some(folder) = shared(folder) else { return };
        models_below(&folder, &mut models);
    }
    models.sort();
    assert!(models.len() >= 140, "{} models", models.len());
    let commands: [&[&str]; 2] = [&["info"], &["render", "--size", "32x32", "--spp", "1", "--quiet", "-o", "out.png"]];
    let work: Vec<_> = models.iter().flat_map(|model| commands.map(|command| (model, command))).collect();
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut outcomes = Vec::new();
        while let Some((model, command)) = work.get(next.fetch_add(1, Ordering::Relaxed)) {
            outcomes.push(run(model, command).map_err(|wrong| format!("{} {}: {wrong}", command[0], model.display())));
        }
        outcomes
    };
    let threads = std::thread::available_parallelism().map_or(2, |count| count.get().max(2));
    let outcomes: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    let wrong: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.as_ref().err()).collect();
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), outcomes.len());
    let count = |code| outcomes.iter().filter(|outcome| **outcome == Ok(code)).count();
    println!("{} models, {} runs: {} ended with 0, {} with 1", models.len(), outcomes.len(), count(0), count(1));
    assert!(count(0) > outcomes.len() / 2, "only {} succeeded", count(0));
}

/// One triangle whose only node lies below another, with its bytes and an image of 3x2 texels as data URIs.
fn write_small_model(workshop: &Workshop) {
    let image = workshop.path("a.png");
    image::RgbImage::new(3, 2).save(&image).unwrap();
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("%{byte:02x}")).collect::<String>();
    let positions: Vec<u8> = [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|x| x.to_le_bytes()).collect();
    let model = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1]}, {"mesh": 0}],
        "buffers": [{"byteLength": 36, "uri": format!("data:,{}", hex(&positions))}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0]}],
        "images": [{"uri": "a.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    });
    workshop.write("small.gltf", &model.to_string());
}

#[test]
fn limits_are_told_with_the_flag_that_raises_them() {
    let workshop = Workshop::new();
    write_small_model(&workshop);
    workshop.succeed("info small.gltf --limit data-uri-bytes=108 --limit vertices=3 --limit depth=1 --limit texels=6");
    for (file, limit, enough) in [
        ("model.obj", "file-bytes=99", "file-bytes="),
        ("model.obj", "vertices=14", "vertices=15"),
        ("small.gltf", "file-bytes=99", "file-bytes="),
        ("small.gltf", "vertices=2", "vertices=3"),
        ("small.gltf", "data-uri-bytes=107", "data-uri-bytes=108"),
    ] {
        let error = workshop.fail(&format!("info {file} --limit {limit}"));
        assert!(
            error.contains(file) && error.contains(&format!("raise it with `--limit {enough}")),
            "{limit}: {error}"
        );
    }
    let told = |arguments: &str| String::from_utf8(workshop.run(arguments).stderr).unwrap();
    let texels = told("info small.gltf --limit texels=5");
    assert!(texels.starts_with("warning: images[0]: the image has 3x2 texels"), "{texels}");
    let external = "[[object]]\nmesh = \"model.obj\"\n[background]\nimage = \"a.png\"\n";
    workshop.write("scene.toml", external);
    let error = workshop.fail("info scene.toml --limit texels=5");
    assert!(error.contains("a.png: the image has 3x2 texels"), "{error}");
}

#[test]
fn nodes_too_deep_are_a_limit_and_very_deep_ones_are_no_trouble() {
    let workshop = Workshop::new();
    let nodes: Vec<_> = (1..=100_000).map(|child| json!({"children": [child]})).chain([json!({})]).collect();
    let model = json!({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes});
    workshop.write("deep.gltf", &model.to_string());
    workshop.succeed("info deep.gltf");
    let error = workshop.fail("info deep.gltf --limit depth=99999");
    assert!(
        error.ends_with(
            "has 100000 nodes above it, and the limit of depth is 99999; raise it with `--limit depth=98k`\n"
        )
    );
}

#[test]
fn models_read_nothing_outside_their_folder_unless_that_is_allowed() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.path("in")).unwrap();
    image::RgbImage::new(2, 2).save(workshop.path("a.png")).unwrap();
    fs::write(workshop.path("a.bin"), [0u8; 36]).unwrap();
    let obj = "mtllib ../a.mtl\nmtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    workshop.write("in/model.obj", obj);
    workshop.write("in/m.mtl", "newmtl m\nmap_Kd ../a.png\n");
    workshop.write("a.mtl", "newmtl other\n");
    let gltf = json!({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36, "uri": "../a.bin"}]});
    workshop.write("in/model.gltf", &gltf.to_string());

    let run = |arguments: &str| {
        let output = workshop.run(arguments);
        (output.status.code(), String::from_utf8(output.stderr).unwrap(), String::from_utf8(output.stdout).unwrap())
    };
    let outside = "lies outside the model's folder and is not read without --allow-external";
    let (code, warnings, told) = run("info in/model.obj --json");
    assert_eq!(code, Some(0));
    for name in ["material library `../a.mtl`", "texture `../a.png`"] {
        assert!(warnings.contains(&format!("warning: {name} {outside}")), "{warnings}");
    }
    assert!(!told.contains("\"width\": 2"), "no texture");
    let (code, warnings, told) = run("info in/model.obj --json --allow-external");
    assert_eq!((code, warnings.as_str()), (Some(0), ""));
    assert!(told.contains("\"width\": 2"));

    let error = workshop.fail("info in/model.gltf");
    assert!(error.contains(&format!("model.gltf: buffers[0]: `../a.bin` {outside}")), "{error}");
    workshop.succeed("info in/model.gltf --allow-external");

    // A scene file is its user's own: it may name anything, but what it names may not.
    workshop.write("in/scene.toml", "[background]\nimage = \"../a.png\"\n[[object]]\nmesh = \"model.obj\"\n");
    let (code, warnings, _) = run("info in/scene.toml");
    assert_eq!(code, Some(0));
    assert!(warnings.contains(&format!("texture `../a.png` {outside}")), "{warnings}");
}
