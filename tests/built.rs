//! Built scenes: the same answers as what they were built from, and refusals.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command_line::{Workshop, text};
use crate::common::shared;

/// The project's scenes that need no model made by an example.
fn scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|suffix| suffix == "toml") && !path.ends_with("terrain.toml"))
        .collect()
}

#[test]
fn pictures_of_built_scenes_are_the_same_bytes() {
    let workshop = Workshop::new();
    let models = [
        "gltf/OrientationTest.glb",
        "gltf/2CylinderEngine.glb",
        "gltf/TextureSettingsTest/TextureSettingsTest.gltf",
        "gltf/Lights.glb",
        "obj/spot.obj",
    ]
    .iter()
    .filter_map(|name| shared(name));
    let inputs: Vec<PathBuf> = scenes().into_iter().chain([workshop.path("model.obj")]).chain(models).collect();
    assert!(inputs.len() >= 8);
    for input in inputs {
        let input = input.display();
        const FLAGS: &str = "--size 90x60 --spp 2";
        let plain = workshop.succeed(&format!("render {input} -o - {FLAGS}"));
        for flags in ["", "--accelerator compact", "--preset best"] {
            workshop.succeed(&format!("build {input} -o scene.whb --quiet {flags}"));
            let built = workshop.succeed(&format!("render scene.whb -o - {FLAGS}"));
            assert!(built == plain, "{input} {flags}");
        }
    }
}

#[test]
fn every_command_answers_as_for_what_was_built() {
    let workshop = Workshop::new();
    let printed = workshop.succeed("build model.obj");
    assert_eq!(text(&printed).trim(), "model.whb");
    workshop.write("rays.txt", "0 5 0  0 -1 0\n-0.5 0.5 5  0 0 -1\n9 9 9  0 1 0\n");
    for (command, flags) in [
        ("render", "-o - --view left --spp 2 --size 80x60"),
        ("render", "-o - --orbit 20,30 --size 60x80 --spp 1 --accelerator bvh2"),
        ("render", "-o - --precision f64 --spp 1 --size 40x30"),
        ("query", "--ray-file rays.txt --faces"),
        ("query", "--ray-file rays.txt --precision exact"),
        ("explain", "--pixel 30,20 --size 60x40"),
    ] {
        let answers = ["model.obj", "model.whb"].map(|input| {
            let printed = workshop.succeed(&format!("{command} {input} {flags}"));
            String::from_utf8_lossy(&printed).replace("model.whb", "model.obj")
        });
        assert_eq!(answers[0], answers[1], "{command} {flags}");
    }
    let info = text(&workshop.succeed("info model.whb --validate --tree"));
    assert!(info.contains("13") && info.contains("sound"), "{info}");
    workshop.succeed("render model.whb -o turn.{frame}.png --turntable 3 --size 40x30 --spp 1");
    workshop.succeed("render model.obj -o plain.{frame}.png --turntable 3 --size 40x30 --spp 1");
    for frame in 0..3 {
        let read = |name: &str| fs::read(workshop.path(&format!("{name}.{frame:04}.png"))).unwrap();
        assert!(read("turn") == read("plain"), "frame {frame}");
    }
    // Parts of both make one picture.
    workshop.succeed("render model.obj -o whole.png --size 80x60 --spp 2");
    workshop.succeed("render model.obj -o a.png --size 80x60 --spp 2 --part 1/2");
    workshop.succeed("render model.whb -o a.png --size 80x60 --spp 2 --part 2/2");
    workshop.succeed("merge a.png.1of2.part a.png.2of2.part -o a.png");
    assert!(fs::read(workshop.path("a.png")).unwrap() == fs::read(workshop.path("whole.png")).unwrap());
}

#[test]
fn warnings_of_reading_are_told_again() {
    let workshop = Workshop::new();
    fs::remove_file(workshop.path("model.mtl")).unwrap();
    let output = workshop.run("build model.obj");
    assert!(text(&output.stderr).contains("model.mtl"), "{}", text(&output.stderr));
    let output = workshop.run("render model.whb -o a.png --size 20x10");
    assert!(output.status.success() && text(&output.stderr).contains("model.mtl"), "{}", text(&output.stderr));
    assert_eq!(workshop.run("render model.whb -o a.png --strict").status.code(), Some(1));
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let workshop = Workshop::new();
    workshop.succeed("build model.obj -o scene.whb --quiet --up z");
    let refused = |arguments: &str, told: &[&str]| {
        let message = workshop.fail(arguments);
        told.iter().for_each(|told| assert!(message.contains(told), "{arguments}: {message}"));
    };
    refused("render scene.whb --up y", &["scene.whb", "say them to `whitted build`"]);
    refused("render scene.whb --normals smooth", &["scene.whb"]);
    workshop.succeed("render scene.whb -o a.png --up z --normals file --size 20x10");
    refused("render scene.whb --memory-limit 1K", &["--memory-limit allows 1.0 KiB", "--accelerator compact"]);
    refused("render scene.whb --save-scene a.toml", &["scene.whb", "--save-scene"]);
    refused("build scene.whb -o b.whb", &["scene.whb", "built already"]);
    refused("build scene.whb", &["scene.whb", "built already"]);
    for name in ["model.obj", "model.mtl", "-", "a.glb"] {
        refused(&format!("build model.obj -o {name}"), &[name, "ends in .whb"]);
    }
    refused("build model.obj -o scene.whb --no-clobber", &["scene.whb", "--no-clobber"]);
    refused("build model.obj -o a.whb --accelerator bvh2", &["`bvh2` cannot be kept", "wide, compact"]);
    refused("build none.obj", &["none.obj"]);
    workshop.write("scene.toml", "[[object]]\nmesh = \"scene.whb\"\n");
    refused("render scene.toml", &["scene.whb", "cannot be used as a mesh"]);
    assert!(!workshop.names().iter().any(|name| name == "a.whb" || name == "b.whb" || name.ends_with(".tmp")));

    let whole = fs::read(workshop.path("scene.whb")).unwrap();
    let with = |at: usize, bytes: &[u8]| {
        let mut all = whole.clone();
        all[at..at + bytes.len()].copy_from_slice(bytes);
        fs::write(workshop.path("flawed.whb"), all).unwrap();
    };
    with(14, b"2");
    refused("render flawed.whb", &["flawed.whb", "another version of the format", "build it again"]);
    with(16, b"9.9.9");
    refused("render flawed.whb", &["flawed.whb", "built by whitted 9.9.9", env!("CARGO_PKG_VERSION")]);
    with(whole.len() - 300, &[whole[whole.len() - 300] ^ 1]);
    refused("render flawed.whb", &["flawed.whb", "damaged"]);
    fs::write(workshop.path("flawed.whb"), &whole[..whole.len() / 2]).unwrap();
    refused("info flawed.whb", &["flawed.whb", &format!("{} bytes instead of {}", whole.len() / 2, whole.len())]);
    fs::write(workshop.path("flawed.whb"), "").unwrap();
    refused("info flawed.whb", &["flawed.whb", "no built scene"]);

    let material = fs::read_to_string(workshop.path("model.mtl")).unwrap();
    workshop.write("model.mtl", &material.replace("0.6", "0.5"));
    refused("render scene.whb -o a.png", &["scene.whb", "model.mtl", "build it again"]);
    workshop.write("model.mtl", &material);
    workshop.succeed("render scene.whb -o a.png --size 20x10");
    // Whole without what it was built from, under any name.
    for name in ["model.obj", "model.mtl"] {
        fs::remove_file(workshop.path(name)).unwrap();
    }
    fs::rename(workshop.path("scene.whb"), workshop.path("scene.data")).unwrap();
    workshop.succeed("render scene.data -o b.png --size 20x10");
    assert!(fs::read(workshop.path("a.png")).unwrap() == fs::read(workshop.path("b.png")).unwrap());
}
