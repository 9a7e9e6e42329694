//! `whitted query`, run as a process: formats, errors, and answers that are known.

use std::fs;
use std::io::{Read, Write};
use std::process::Stdio;

use whitted::math::random::Random;

use crate::command_line::{Workshop, text};

const STRUCTURES: [&str; 4] = ["linear", "bvh2", "cwbvh", "auto"];

/// The workshop with two unit squares, at z = 0 and z = -1 (two triangles each), and a scene of them and a unit sphere
/// at (5, 0, 0), on its side of a plane y = -3 without end.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    let squares = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 -1\nv 1 0 -1\nv 1 1 -1\nv 0 1 -1\nf 1 2 3 4\nf 5 6 7 8\n";
    workshop.write("squares.obj", squares);
    workshop.write(
        "scene.toml",
        "[[object]]\nmesh = \"squares.obj\"\n[[object]]\nsphere = { center = [5, 0, 0], radius = 1 }\n\
         [[object]]\nplane = {}\ntransform = { translate = [0, -3, 0] }\n",
    );
    workshop
}

/// The answers to rays given on standard input.
fn ask(workshop: &Workshop, arguments: &str, rays: &[u8]) -> Vec<u8> {
    let mut command = workshop.command(&format!("query {arguments} --ray-file -"));
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let rays = rays.to_vec();
    let feeder = std::thread::spawn(move || stdin.write_all(&rays).unwrap());
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    output.stdout
}

/// Rays between points of a lattice around the scene and between random points, as text.
fn many_rays(count: usize) -> String {
    let mut random = Random::new(17, 0);
    let mut lines = String::from("# origin, direction\n");
    for number in 0..count {
        let mut point = || {
            let p = random.in_cube() * 6.0;
            (if number % 2 == 0 { p.round() * 0.5 } else { p }).as_vec3()
        };
        let (from, to) = (point(), point());
        let d = to - from;
        lines += &format!("{} {} {}  {:?} {:?} {:?}\n", from.x, from.y, from.z, d.x, d.y, d.z);
    }
    lines
}

#[test]
fn closed_forms_are_answered_by_everyone() {
    let workshop = workshop();
    let rays = "0.75 0.25 2  0 0 -2\n# the other half, from between, and only behind\n0.25 0.75 -0.5 0 0 0x1p-1\n\
                0.75 0.25 2  0 0 -1  2.5 inf\n0.75 0.25 2 0 0 -1 0 1.5\n5 0 4 0 0 -1\n5 1 4 0 0 -1\n4 0.5 3 0 -1 0\n\
                nan 0 0 1 0 0\n";
    let expected = "1.0 0.5 0.25 0 0\n1.0 0.25 0.5 0 1\n3.0 0.5 0.25 0 2\nmiss\n3.0 0.0 0.0 1 0\n4.0 0.0 0.0 1 0\n\
                    3.5 0.0 0.0 2 0\nmiss\n";
    // The diagonal of a square runs from its first corner: (0.75, 0.25) has weights 1/4, 1/2, 1/4 of (0, 0), (1, 0), (1, 1).
    for structure in STRUCTURES {
        let answers = ask(&workshop, &format!("scene.toml --accelerator {structure}"), rays.as_bytes());
        assert_eq!(text(&answers), expected, "{structure}");
    }
    assert_eq!(text(&ask(&workshop, "scene.toml --precision exact", rays.as_bytes())), expected);
    assert_eq!(text(&ask(&workshop, "scene.toml --mode occluded", rays.as_bytes())), "1\n1\n1\n0\n1\n1\n1\n0\n");
}

#[test]
fn all_hits_come_in_the_order_of_their_keys() {
    let workshop = workshop();
    // Through both squares on their diagonals: both triangles of each, the lower number first; then nothing.
    let rays = b"0.5 0.5 2 0 0 -1\n0.5 0.5 2 0 0 1\n5 0 4 0 0 -1\n";
    for precision in ["f32", "exact"] {
        let answers = text(&ask(&workshop, &format!("scene.toml --mode all --precision {precision}"), rays));
        let expected = "4\n2.0 0.0 0.5 0 0\n2.0 0.5 0.0 0 1\n3.0 0.0 0.5 0 2\n3.0 0.5 0.0 0 3\n0\n\
                        2\n3.0 0.0 0.0 1 0\n5.0 0.0 0.0 1 1\n";
        // A weight of nothing may be negative.
        assert_eq!(answers.replace("-0.0", "0.0"), expected, "{precision}");
    }
    // On many rays: ascending, and the first is the closest.
    let rays = many_rays(800);
    let closest = text(&ask(&workshop, "scene.toml", rays.as_bytes()));
    let all = text(&ask(&workshop, "scene.toml --mode all", rays.as_bytes()));
    let mut lines = all.lines();
    for closest in closest.lines() {
        let count: usize = lines.next().unwrap().parse().unwrap();
        let hits: Vec<&str> = lines.by_ref().take(count).collect();
        assert_eq!(*hits.first().unwrap_or(&"miss"), closest);
        let key = |hit: &&str| {
            let words: Vec<&str> = hit.split(' ').collect();
            (words[0].parse::<f32>().unwrap(), words[3].parse::<u32>().unwrap(), words[4].parse::<u32>().unwrap())
        };
        assert!(hits.is_sorted_by(|a, b| key(a) < key(b)), "{hits:?}");
    }
    assert_eq!(lines.next(), None);
}

#[test]
fn structures_presets_and_threads_change_no_byte_and_any_hit_agrees_with_the_closest() {
    let workshop = workshop();
    let rays = many_rays(3000);
    let reference = ask(&workshop, "scene.toml --accelerator linear --threads 1", rays.as_bytes());
    for flags in
        ["--accelerator bvh2 --preset fast --threads 2", "--accelerator bvh2 --preset best", "--accelerator cwbvh"]
    {
        assert!(ask(&workshop, &format!("scene.toml {flags}"), rays.as_bytes()) == reference, "{flags}");
    }
    let reference = text(&reference);
    let hits = reference.lines().filter(|line| *line != "miss").count();
    assert!(hits > 800 && hits < 2900, "{hits}");
    for precision in ["f32", "exact"] {
        let flags = format!("scene.toml --precision {precision}");
        let closest = text(&ask(&workshop, &flags, rays.as_bytes()));
        let occluded = text(&ask(&workshop, &format!("{flags} --mode occluded"), rays.as_bytes()));
        let expected: Vec<&str> = closest.lines().map(|line| if line == "miss" { "0" } else { "1" }).collect();
        assert_eq!(occluded.lines().collect::<Vec<_>>(), expected, "{precision}");
    }
}

#[test]
fn words_and_text_are_the_same_answers() {
    let workshop = workshop();
    let rays = many_rays(500);
    let words: Vec<u8> = rays
        .lines()
        .skip(1)
        .flat_map(|line| {
            let k: Vec<f32> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
            [k[0], k[1], k[2], 0.0, k[3], k[4], k[5], f32::INFINITY].into_iter().flat_map(f32::to_le_bytes)
        })
        .collect();
    let printed = text(&ask(&workshop, "scene.toml --faces", rays.as_bytes()));
    let binary = ask(&workshop, "scene.toml --faces --format f32", &words);
    assert_eq!(binary.len(), 24 * 500);
    for (line, record) in printed.lines().zip(binary.as_chunks::<24>().0) {
        let word = |k: usize| u32::from_le_bytes(record[4 * k..4 * k + 4].try_into().unwrap());
        if line == "miss" {
            assert_eq!(std::array::from_fn(word), [f32::INFINITY.to_bits(), 0, 0, u32::MAX, u32::MAX, u32::MAX]);
            continue;
        }
        let words: Vec<&str> = line.split(' ').collect();
        for (k, text) in words.iter().enumerate().take(3) {
            assert_eq!(text.parse::<f32>().unwrap().to_bits(), word(k), "{line}");
        }
        assert_eq!((words[3].parse(), words[4].parse()), (Ok(word(3)), Ok(word(4))), "{line}");
        // Two triangles a square; spheres and planes have no faces.
        let face = if words[3] == "0" { Some(word(4) / 2) } else { None };
        assert_eq!(word(5), face.unwrap_or(u32::MAX));
        assert_eq!(words[5].to_owned(), face.map_or("-".to_owned(), |face| face.to_string()));
    }
    let yes_or_no = ask(&workshop, "scene.toml --mode occluded --format f32", &words);
    assert!(
        yes_or_no.len() == 4 * 500
            && yes_or_no.as_chunks::<4>().0.iter().all(|word| word[0] <= 1 && word[1..] == [0; 3])
    );
    let all = ask(&workshop, "scene.toml --mode all --format f32", &words[..32]);
    assert_eq!(all.len(), 4 + 20 * u32::from_le_bytes(all[..4].try_into().unwrap()) as usize);
}

#[test]
fn origins_are_read_in_the_coordinates_of_the_file() {
    let workshop = workshop();
    let far =
        "v 500000.001 5000000.001 0.001\nv 500001.001 5000000.001 0.001\nv 500000.001 5000001.001 0.001\nf 1 2 3\n";
    workshop.write("far.obj", far);
    let answer = text(&ask(&workshop, "far.obj", b"500000.251 5000000.501 3.001 0 0 -1\n"));
    let numbers: Vec<f64> = answer.split_whitespace().map(|word| word.parse().unwrap()).collect();
    for (number, expected) in numbers.iter().zip([3.0, 0.25, 0.5, 0.0, 0.0]) {
        // f32 has 0.03 at 500000; made relative first, millimetres are kept.
        assert!((number - expected).abs() < 1e-6, "{answer}");
    }
}

#[test]
fn bad_rays_end_with_line_and_column_after_the_answers_before_them() {
    let workshop = workshop();
    for (rays, place, answers) in [
        ("0.75 0.25 2 0 0 -2\n0 0 1 0 zero -1\n0.75 0.25 2 0 0 -2\n", "rays.txt:2:9: ", "1.0 0.5 0.25 0 0\n"),
        ("0 0 1 0 0\n", "rays.txt:1:10: ", ""),
        ("\n\n0 0 1 0 0 -1 0 1 2\n", "rays.txt:3:18: ", ""),
        ("0 0 1 0 0 0x\n", "rays.txt:1:11: ", ""),
    ] {
        workshop.write("rays.txt", rays);
        let output = workshop.run("query squares.obj --ray-file rays.txt");
        let error = text(&output.stderr);
        assert_eq!((output.status.code(), text(&output.stdout).as_str()), (Some(1), answers), "{rays}: {error}");
        assert_eq!(error.lines().count(), 1, "{rays}: {error}");
        assert!(error.contains(place) && error.contains("ox oy oz dx dy dz"), "{rays}: {error}");
        let error = workshop.fail("query squares.obj --ray-file rays.txt -o out.txt");
        assert!(error.contains(place) && !workshop.path("out.txt").exists(), "{rays}: {error}");
    }
    fs::write(workshop.path("rays.f32"), [0; 40]).unwrap();
    let output = workshop.run("query squares.obj --ray-file rays.f32 --format f32");
    let error = text(&output.stderr);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 20), "a miss, then {error}");
    assert!(error.contains("rays.f32: ") && error.contains("byte 32"), "{error}");
    assert!(workshop.fail("query squares.obj --ray-file none.txt").contains("none.txt"));
    assert!(workshop.fail("query none.obj --ray-file rays.txt").contains("none.obj"));
    assert!(workshop.fail("query squares.obj --ray-file .").contains("folder"));
    assert_eq!(workshop.run("query squares.obj").status.code(), Some(2));
    assert_eq!(workshop.run("query squares.obj --ray-file rays.txt --mode any").status.code(), Some(2));
}

#[test]
fn answers_go_to_a_file_that_is_no_input() {
    let workshop = workshop();
    workshop.write("rays.txt", "0.75 0.25 2 0 0 -2\n");
    assert!(workshop.succeed("query squares.obj --ray-file rays.txt -o out.txt").is_empty());
    assert_eq!(fs::read_to_string(workshop.path("out.txt")).unwrap(), "1.0 0.5 0.25 0 0\n");
    for input in ["rays.txt", "squares.obj", "scene.toml"] {
        let before = fs::read(workshop.path(input)).unwrap();
        let refused = workshop.fail(&format!("query scene.toml --ray-file rays.txt -o ./{input}"));
        assert!(refused.contains(input), "{refused}");
        assert_eq!(fs::read(workshop.path(input)).unwrap(), before);
    }
    assert!(workshop.succeed("query squares.obj --ray-file rays.txt -o -").starts_with(b"1.0"));
}

#[test]
fn a_pipe_is_answered_as_it_is_filled_and_may_be_closed() {
    let workshop = workshop();
    let mut command = workshop.command("query squares.obj --ray-file -");
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (mut stdin, mut stdout) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
    for _ in 0..3 {
        stdin.write_all(b"0.75 0.25 2 0 0 -2\n").unwrap();
        let mut answer = [0; 17];
        stdout.read_exact(&mut answer).unwrap();
        assert_eq!(&answer, b"1.0 0.5 0.25 0 0\n");
    }
    // The reader goes away: no failure, and no panic.
    drop(stdout);
    let _ = stdin.write_all(b"0.75 0.25 2 0 0 -2\n");
    drop(stdin);
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
}

#[test]
fn a_model_is_compared_with_exact_answers() {
    let workshop = workshop();
    let table = text(&workshop.succeed("check --model scene.toml --rays 900"));
    let words: Vec<&str> = table.lines().find(|line| line.starts_with("all ")).unwrap().split_whitespace().collect();
    // Rays, hits, seven classes of which the last is `wrong`, the worst t, those outside their bound, structures that differ.
    assert_eq!((words.len(), words[1], words[9], words[11], words[12]), (13, "900", "0", "0", "0"), "{table}");
    assert_eq!(table, text(&workshop.succeed("check --model scene.toml --rays 900 --threads 1")));
    let document = text(&workshop.succeed("check --model scene.toml --rays 90 --json"));
    let document: serde_json::Value = serde_json::from_str(&document).unwrap();
    assert_eq!(
        (&document["schema"], &document["passed"], &document["all"]["rays"]),
        (&1.into(), &true.into(), &90.into())
    );
    assert!(document["structures"].as_array().unwrap().contains(&"bvh2 best".into()));
    assert_eq!(workshop.run("check --model scene.toml --rays 0").status.code(), Some(2));
    assert!(workshop.fail("check --model none.obj").contains("none.obj"));
    assert_eq!(workshop.run("check D1 --model scene.toml").status.code(), Some(2));
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_query_that_waits_for_rays() {
    let workshop = workshop();
    workshop.write("out.txt", "old");
    let mut command = workshop.command("query squares.obj --ray-file - -o out.txt");
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    // Waiting for a child closes its input unless that is held.
    let _held = child.stdin.take();
    std::thread::sleep(std::time::Duration::from_millis(500));
    let interrupted = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupted.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(fs::read_to_string(workshop.path("out.txt")).unwrap(), "old");
}
