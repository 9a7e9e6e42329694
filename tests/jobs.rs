//! Work that outlives a process: kept tiles, parts, frames.

use std::fs;
use std::io::Read;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::command_line::{Workshop, text};

/// A small generator, so that every run of the tests damages and kills alike (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// The model, a transparent background and a camera that moves.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    workshop.write(
        "scene.toml",
        "[film]\nsize = [150, 100]\nsamples = 4\n[background]\ntransparent = true\n\
         [[camera]]\nname = \"way\"\neye = [1, 2, 5]\ntarget = [0, 0.5, 0]\n\
         path = [{ frame = 1, eye = [1, 2, 5] }, { frame = 5, eye = [4, 2, 3], target = [0, 0, 0], fov = 50 }]\n\
         [[camera]]\nname = \"table\"\neye = [1, 2, 5]\ntarget = [0, 0.5, 0]\nturntable = 8\n\
         [[camera]]\nname = \"still\"\neye = [1, 2, 5]\ntarget = [0, 0.5, 0]\n\
         [[light]]\nkind = \"point\"\nposition = [3, 5, 4]\n[[object]]\nmesh = \"model.obj\"\n",
    );
    workshop
}

#[test]
fn parts_make_the_picture_of_one_machine() {
    let workshop = workshop();
    for (name, flags) in [("a.png", ""), ("a.exr", "--aov depth,id"), ("b.png", "--aov normal --crop 33,1,140,70")] {
        workshop.succeed(&format!("render scene.toml -o whole-{name} {flags}"));
        // More parts than tiles: some are empty.
        for of in [1, 3, 40] {
            let width = of.to_string().len();
            let file = |number: u32| format!("{name}.{number:0width$}of{of}.part");
            for number in 1..=of {
                let printed =
                    workshop.succeed(&format!("render scene.toml -o {name} {flags} --part {number}/{of} --threads 1"));
                assert_eq!(text(&printed).trim(), file(number));
            }
            assert!(!workshop.path(name).exists());
            let parts: Vec<String> = (1..=of).rev().map(file).collect();
            // One that was rendered twice changes nothing.
            fs::copy(workshop.path(&file(1)), workshop.path("again.part")).unwrap();
            workshop.succeed(&format!("merge again.part {} -o {name}", parts.join(" ")));
            let same = |name: &str| {
                let read = |name: &str| fs::read(workshop.path(name)).unwrap();
                assert!(read(name) == read(&format!("whole-{name}")), "{name} of {of} parts");
            };
            same(name);
            if name == "b.png" {
                same("b.aov.exr");
            }
            parts.iter().for_each(|part| fs::remove_file(workshop.path(part)).unwrap());
            fs::remove_file(workshop.path(name)).unwrap();
        }
    }
}

#[test]
fn merge_refuses_what_does_not_belong_together_and_names_it() {
    let workshop = workshop();
    for number in 1..=3 {
        workshop.succeed(&format!("render scene.toml -o a.png --part {number}/3"));
    }
    let refused = |parts: &str, told: &[&str]| {
        let message = workshop.fail(&format!("merge {parts} -o out.png"));
        told.iter().for_each(|told| assert!(message.contains(told), "{parts}: {message}"));
        assert!(!workshop.path("out.png").exists());
    };
    refused("a.png.1of3.part a.png.3of3.part", &["of 3 parts 2 is missing"]);
    refused("a.png.2of3.part", &["1 and 3 are missing"]);

    workshop.succeed("render scene.toml -o settings.png --part 2/3 --spp 5");
    refused(
        "a.png.1of3.part settings.png.2of3.part a.png.3of3.part",
        &["settings.png", "film.samples is 5 here and 4 there"],
    );
    workshop.succeed("render scene.toml -o camera.png --part 2/3 --camera still");
    refused("a.png.1of3.part camera.png.2of3.part a.png.3of3.part", &["camera.png", "settings.camera"]);
    workshop.succeed("render scene.toml -o parts.png --part 2/4");
    refused("a.png.1of3.part parts.png.2of4.part a.png.3of3.part", &["parts.png", "one of 4 parts and one of 3"]);
    let model = fs::read_to_string(workshop.path("model.obj")).unwrap();
    workshop.write("model.obj", &model.replace("0.9 1.25 0.2", "0.9 1.25 0.21"));
    workshop.succeed("render scene.toml -o scene.png --part 2/3");
    refused("a.png.1of3.part scene.png.2of3.part a.png.3of3.part", &["scene.png", "scene is"]);
    workshop.write("model.obj", &model);

    refused("scene.toml", &["scene.toml", "no file of tiles"]);
    refused("missing.part", &["missing.part"]);
    let whole = fs::read(workshop.path("a.png.2of3.part")).unwrap();
    let mut random = Random(7);
    for kind in 0..40 {
        let mut bytes = whole.clone();
        let at = match kind % 4 {
            // In the header, anywhere, and what a full disk leaves.
            0 => random.below(300),
            _ => random.below(bytes.len()),
        };
        if kind % 4 == 3 {
            bytes.truncate(at)
        } else {
            bytes[at] ^= 1 << random.below(8)
        }
        fs::write(workshop.path("flawed.part"), bytes).unwrap();
        refused("a.png.1of3.part flawed.part a.png.3of3.part", &["flawed.part"]);
    }
    workshop.succeed("merge a.png.1of3.part a.png.2of3.part a.png.3of3.part -o out.png");
    let message = workshop.fail("merge a.png.1of3.part a.png.2of3.part a.png.3of3.part -o a.png.1of3.part");
    assert!(message.contains("cannot be written as `.part`"), "{message}");
    let message = workshop.fail("merge a.png.1of3.part a.png.2of3.part a.png.3of3.part -o out.png --no-clobber");
    assert!(message.contains("--no-clobber"), "{message}");
}

/// Starts a rendering that keeps its tiles, and kills it after a time. Says whether it ended before.
fn killed(workshop: &Workshop, arguments: &str, after: Duration) -> bool {
    let mut child = workshop.command(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(after);
    let ended = child.try_wait().unwrap().is_some();
    // SIGKILL, where there are signals.
    let _ = child.kill();
    child.wait().unwrap();
    ended
}

#[test]
fn a_picture_that_was_killed_again_and_again_is_the_same() {
    let workshop = workshop();
    const ARGUMENTS: &str = "render scene.toml -o a.exr --spp 300 --aov depth --resume --threads 1";
    let start = Instant::now();
    workshop.succeed("render scene.toml -o whole.exr --spp 300 --aov depth --threads 1");
    let whole_time = start.elapsed();
    let whole = fs::read(workshop.path("whole.exr")).unwrap();
    let mut random = Random(1);
    let (mut kills, mut tries, mut damaged, mut grown) = (0, 0, 0, 0);
    while kills < 20 {
        tries += 1;
        assert!(tries < 200, "rendering ends before it can be killed");
        let before = fs::metadata(workshop.path("a.exr.tiles")).map_or(0, |kept| kept.len());
        let after = whole_time * random.below(300) as u32 / 1000;
        if killed(&workshop, ARGUMENTS, after) || workshop.path("a.exr").exists() {
            assert!(fs::read(workshop.path("a.exr")).unwrap() == whole);
            assert!(!workshop.path("a.exr.tiles").exists());
            fs::remove_file(workshop.path("a.exr")).unwrap();
            continue;
        }
        kills += 1;
        let Ok(mut bytes) = fs::read(workshop.path("a.exr.tiles")) else { continue };
        grown += usize::from(bytes.len() as u64 > before);
        // Some of what was kept is damaged besides: a flipped bit, a lost end.
        let header = bytes.windows(4).position(|word| word == b"TILE").unwrap_or(bytes.len());
        if kills % 3 == 0 && bytes.len() > header + 5000 {
            let at = header + random.below(bytes.len() - header);
            if kills % 2 == 0 {
                bytes[at] ^= 1 << random.below(8)
            } else {
                bytes.truncate(at)
            }
            fs::write(workshop.path("a.exr.tiles"), bytes).unwrap();
            damaged += 1;
        }
    }
    assert!(damaged >= 3 && grown >= 8, "{damaged} damaged, {grown} grown");
    workshop.succeed(ARGUMENTS);
    assert!(fs::read(workshop.path("a.exr")).unwrap() == whole);
    let names = workshop.names();
    assert!(!names.iter().any(|name| name.contains(".tiles") || name.contains(".tmp")), "{names:?}");
}

/// A rendering that the time limit stopped, with some tiles kept.
fn stopped(workshop: &Workshop, arguments: &str) -> String {
    let output = workshop.run(&format!("{arguments} --time-limit 1s --spp 20000"));
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(75), "{stderr}");
    assert!(stderr.contains("the time limit was reached"), "{stderr}");
    stderr
}

#[test]
fn the_time_limit_stops_in_good_order() {
    let workshop = workshop();
    let told = stopped(&workshop, "render scene.toml -o a.png");
    assert!(told.contains("a.partial.png has what was finished"), "{told}");
    let told = stopped(&workshop, "render scene.toml -o b.png --resume");
    assert!(told.contains("finished tiles are kept in b.png.tiles; the same command goes on"), "{told}");
    let message = workshop.fail("render scene.toml -o b.png --resume --spp 20001");
    assert!(
        message.contains("b.png.tiles") && message.contains("film.samples is 20000 here and 20001 there"),
        "{message}"
    );
    let names = workshop.names();
    assert!(!names.contains("b.partial.png") && !names.contains("b.png"), "{names:?}");
}

#[test]
fn kept_tiles_are_checked() {
    let workshop = workshop();
    workshop.succeed("render scene.toml -o whole.png --spp 20");
    let whole = fs::read(workshop.path("whole.png")).unwrap();
    // A part has the tiles that a process kept which was killed at the last moment.
    workshop.succeed("render scene.toml -o a.png --spp 20 --part 1/1");
    let part = fs::read(workshop.path("a.png.1of1.part")).unwrap();
    let header = part.windows(4).position(|word| word == b"TILE").unwrap();
    const RESUME: &str = "render scene.toml -o a.png --spp 20 --part 1/1 --resume";
    let mut random = Random(3);
    for round in 0..30 {
        let mut bytes = part.clone();
        let at = header + random.below(bytes.len() - header);
        if round % 2 == 0 {
            bytes[at] ^= 1 << random.below(8)
        } else {
            bytes.truncate(at)
        }
        fs::write(workshop.path("a.png.1of1.part.tiles"), bytes).unwrap();
        let output = workshop.run(RESUME);
        let stderr = text(&output.stderr);
        assert!(output.status.success(), "{stderr}");
        let is_cut_between = !stderr.contains("damaged");
        assert!(!is_cut_between || round % 2 == 1, "byte {at} was not missed");
        assert!(is_cut_between || stderr.contains("a.png.1of1.part.tiles: the record at byte"), "{stderr}");
        workshop.succeed("merge a.png.1of1.part -o a.png");
        assert!(fs::read(workshop.path("a.png")).unwrap() == whole, "round {round}");
    }
    for at in [3, 20, 40, header - 1] {
        let mut bytes = part.clone();
        bytes[at] ^= 4;
        fs::write(workshop.path("a.png.1of1.part.tiles"), bytes).unwrap();
        let message = workshop.fail(RESUME);
        assert!(message.contains("a.png.1of1.part.tiles"), "{message}");
    }
    // The same picture's, but another share's.
    fs::write(workshop.path("b.png.tiles"), &part).unwrap();
    let message = workshop.fail("render scene.toml -o b.png --spp 20 --resume");
    assert!(message.contains("another share"), "{message}");
}

#[test]
fn two_processes_do_not_keep_tiles_in_one_file() {
    let workshop = workshop();
    const ARGUMENTS: &str = "render scene.toml -o a.png --spp 100000 --resume";
    let mut first = workshop.command(ARGUMENTS).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    while !workshop.path("a.png.tiles").exists() && start.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(300));
    let message = workshop.fail(ARGUMENTS);
    first.kill().unwrap();
    let mut told = String::new();
    first.stderr.take().unwrap().read_to_string(&mut told).unwrap();
    first.wait().unwrap();
    assert!(message.contains("another process keeps the tiles"), "{message}; the first: {told}");
}

#[test]
fn slurm_tells_the_part() {
    let workshop = workshop();
    let task = |id: &str| {
        let mut command = workshop.command("render scene.toml -o a.png --part auto");
        command.env("SLURM_ARRAY_TASK_ID", id).env("SLURM_ARRAY_TASK_MIN", "0").env("SLURM_ARRAY_TASK_COUNT", "2");
        command.output().unwrap()
    };
    for (id, part) in [("0", "a.png.1of2.part"), ("1", "a.png.2of2.part")] {
        let output = task(id);
        assert!(output.status.success() && text(&output.stdout).trim() == part, "{}", text(&output.stderr));
    }
    workshop.succeed("merge a.png.1of2.part a.png.2of2.part -o a.png");
    assert_eq!(task("5").status.code(), Some(2));
    let told = text(
        &workshop.command("render scene.toml --part auto").env_remove("SLURM_ARRAY_TASK_ID").output().unwrap().stderr,
    );
    assert!(told.contains("SLURM_ARRAY_TASK_ID"), "{told}");
}

#[test]
fn frames_follow_the_path_alone_or_in_shares() {
    let workshop = workshop();
    let read = |name: &str| fs::read(workshop.path(name)).unwrap();
    let printed = workshop.succeed("render scene.toml --frames 1..6 -o way.{frame}.png");
    assert_eq!(text(&printed).lines().collect::<Vec<_>>()[..2], ["way.0001.png", "way.0002.png"]);
    workshop.succeed("render scene.toml -o start.png");
    assert!(read("way.0001.png") == read("start.png"), "the first key is where the camera stands");
    assert!(read("way.0005.png") == read("way.0006.png"), "it rests behind the last key");
    assert!(read("way.0002.png") != read("way.0003.png"));
    for number in 1..=4 {
        workshop.succeed(&format!("render scene.toml --frames 1..6 -o share.{{frame}}.png --part {number}/4 --resume"));
    }
    for frame in 1..=6 {
        assert!(read(&format!("way.000{frame}.png")) == read(&format!("share.000{frame}.png")), "{frame}");
    }
    // What is there stays, what is not comes.
    fs::remove_file(workshop.path("way.0003.png")).unwrap();
    workshop.write("way.0004.png", "kept");
    let printed = workshop.succeed("render scene.toml --frames 1..6 -o way.{frame}.png --skip-existing");
    assert_eq!((text(&printed).trim(), read("way.0004.png").as_slice()), ("way.0003.png", b"kept".as_slice()));
    assert!(read("way.0003.png") == read("share.0003.png"));

    workshop.succeed("render scene.toml --camera table --frames -8..-8 -o t.{frame}.png");
    workshop.succeed("render scene.toml --camera table -o t.png");
    workshop.succeed("render model.obj --size 60x40 --spp 1 --turntable 3");
    assert!(read("t.-008.png") == read("t.png"), "a whole turn back");
    assert!(["model.0000.png", "model.0001.png", "model.0002.png"].iter().all(|name| workshop.path(name).exists()));

    for (flags, told) in [
        ("--camera still --frames 1..2 -o a.{frame}.png", "the camera `still` does not move"),
        ("--frames 1..2 -o a.png", "put {frame} into the name"),
        ("-o a.{frame}.png", "say --frames"),
    ] {
        let message = workshop.fail(&format!("render scene.toml {flags}"));
        assert!(message.contains(told), "{message}");
    }
    let message = workshop.fail("render scene.toml --frames 3..6 -o way.{frame}.png --no-clobber");
    assert!(message.contains("way.0003.png"), "{message}");
}

#[test]
fn a_frame_is_the_picture_of_a_camera_that_stands_there() {
    let workshop = workshop();
    // Images are read by how large pixels are, which the camera decides; lights of a model follow it.
    workshop.write("t.mtl", "newmtl t\nKd 1 1 1\nmap_Kd t.png\n");
    workshop.write(
        "t.obj",
        "mtllib t.mtl\nv -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nvt 0 0\nvt 9 0\nvt 9 9\nvt 0 9\nusemtl t\nf 4/4 3/3 2/2 1/1\n",
    );
    let checker =
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([if (x / 4 + y / 4) % 2 == 0 { 255 } else { 20 }; 3]));
    checker.save(workshop.path("t.png")).unwrap();
    let scene = |eye: &str, path: &str| {
        format!(
            "[film]\nsize = [90, 60]\nsamples = 1\n[camera]\neye = {eye}\ntarget = [0, 0, 0]\n{path}\n\
             [[light]]\nkind = \"point\"\nposition = [3, 5, 4]\n[[object]]\nmesh = \"t.obj\"\n"
        )
    };
    workshop.write(
        "way.toml",
        &scene("[0, 0.5, 2]", "path = [{ frame = 1, eye = [0, 0.5, 2] }, { frame = 2, eye = [0, 9, 60] }]"),
    );
    workshop.write("there.toml", &scene("[0, 9, 60]", ""));
    workshop.succeed("render way.toml --frames 1..2 -o way.{frame}.png");
    workshop.succeed("render there.toml -o there.png");
    let read = |name: &str| fs::read(workshop.path(name)).unwrap();
    assert!(read("way.0002.png") == read("there.png"));

    // Half-way around, the back: as bright as the front of a model that is the same from both sides.
    workshop.write(
        "cube.obj",
        "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n",
    );
    workshop.succeed("render cube.obj --size 60x60 --spp 1 --turntable 4 -o cube.{frame}.png");
    let sum = |name: &str| -> u64 {
        let picture = image::open(workshop.path(name)).unwrap().to_rgb8();
        picture.pixels().map(|pixel| u64::from(pixel.0[0])).sum()
    };
    let (front, back) = (sum("cube.0000.png"), sum("cube.0002.png"));
    assert!(front.abs_diff(back) * 200 < front, "{front} {back}");
}

#[test]
fn tiles_need_a_file() {
    let workshop = workshop();
    for flag in ["--resume", "--part 1/2"] {
        let message = workshop.fail(&format!("render scene.toml -o - {flag}"));
        assert!(message.contains("name a file with -o"), "{message}");
    }
}
