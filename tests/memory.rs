//! How much memory it takes at its peak to build the default structure and the compact one, beside the mesh, and to load a model:
//! measured, on Linux, in a process of its own.

use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::sync::Arc;

use whitted::accel::{Compact, Params, TriangleAccelerator, Wide};
use whitted::formats::{LoadOptions, load_model};
use whitted::geometry::TriangleMesh;
use whitted::glam::Vec3;
use whitted::progress::Silent;

/// Hills of `2 side^2` triangles.
fn hills(side: u32) -> TriangleMesh {
    let height =
        |x: f32, z: f32| 0.1 * libm::sinf(9.0 * x) * libm::sinf(7.0 * z) + 0.001 * libm::sinf(900.0 * x + 500.0 * z);
    let corner = |i: u32| i as f32 / side as f32;
    let positions =
        (0..=side).flat_map(|j| (0..=side).map(move |i| Vec3::new(corner(i), height(corner(i), corner(j)), corner(j))));
    let at = |i: u32, j: u32| j * (side + 1) + i;
    let square = |i: u32, j: u32| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, c, b], [a, d, c]]
    };
    let indices = (0..side).flat_map(|j| (0..side).flat_map(move |i| square(i, j)));
    TriangleMesh { positions: positions.collect(), indices: indices.collect(), ..TriangleMesh::default() }
        .finish()
        .unwrap()
}

/// A value of this process's status in bytes.
fn status(name: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    Some(line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Bytes a triangle that a build adds to what is resident, at its peak and in the end.
fn peak_and_end<A: TriangleAccelerator>(side: u32) -> Option<(f64, f64)> {
    let mesh = Arc::new(hills(side));
    // Forget the peak so far.
    std::fs::write("/proc/self/clear_refs", "5").ok()?;
    let before = status("VmRSS")?;
    let built = A::build(&mesh, &Params::default(), &Silent).unwrap();
    let peak = status("VmHWM")?;
    let stats = built.stats();
    let triangles = mesh.live_count() as f64;
    Some((peak.saturating_sub(before) as f64 / triangles, (stats.node_bytes + stats.leaf_bytes) as f64 / triangles))
}

/// Builds in this process, in which nothing else runs, and prints what it took.
#[test]
#[ignore = "asked for by the test below, in a process of its own"]
fn alone() {
    let side = std::env::var(SIDE).unwrap().parse().unwrap();
    let kind = std::env::var(KIND).unwrap();
    let measured = if kind == Compact::NAME { peak_and_end::<Compact>(side) } else { peak_and_end::<Wide>(side) };
    match measured {
        Some((peak, end)) => println!("{PREFIX}{peak} {end}"),
        None => println!("{PREFIX}"),
    }
}

const SIDE: &str = "WHITTED_TEST_SIDE";
const KIND: &str = "WHITTED_TEST_KIND";
const PREFIX: &str = "peak and end: ";

/// What a test prints in a process of its own: the peak and the end. `None`, with a message, where the system does not tell.
fn ask(test: &str, variables: &[(&str, String)]) -> Option<[f64; 2]> {
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--ignored", "--nocapture"])
        .envs(variables.iter().map(|(name, value)| (name, value)))
        .env("RAYON_NUM_THREADS", "2")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| Some(line.split_once(PREFIX)?.1)).unwrap_or_else(|| panic!("{text}"));
    let numbers: Vec<f64> = line.split_whitespace().map(|number| number.parse().unwrap()).collect();
    let measured = numbers.try_into().ok();
    if measured.is_none() {
        eprintln!("skipped: this system does not tell how much memory a process takes");
    }
    measured
}

/// The peak is the tree, 32 bytes for boxes and numbers while it is built, and a chunk a thread, for which there is a margin.
fn check<A: TriangleAccelerator>(side: u32, limit: f64) {
    let variables = [(SIDE, side.to_string()), (KIND, A::NAME.to_owned())];
    let Some([peak, end]) = ask("memory::alone", &variables) else { return };
    println!("{}, {} triangles: {end:.1} bytes each in the end, {peak:.1} at the peak", A::NAME, 2 * side * side);
    let margin = 48.0 * f64::from(1 << 20) / f64::from(2 * side * side);
    assert!(end < limit, "{end} bytes a triangle");
    // Debug builds audit the tree as well, on a copy of its triangles.
    let audit = if cfg!(debug_assertions) { 48.0 } else { 0.0 };
    assert!(peak < end + 36.0 + margin + audit, "{peak} bytes a triangle at the peak, {end} in the end");
}

#[test]
fn a_build_takes_little_more_than_what_it_makes() {
    let both = |side: u32| {
        check::<Wide>(side, 64.0);
        check::<Compact>(side, 24.0);
    };
    both(724);
    if std::env::var_os("WHITTED_FULL_TESTS").is_some() {
        both(2237);
    } else {
        eprintln!("skipped: 10 million triangles; set WHITTED_FULL_TESTS for them");
    }
}

/// Writes hills of `2 side^2` triangles as an OBJ file: positions and faces alone, in a smoothing group, or with texture
/// coordinates and normals.
fn write_hills(path: &Path, side: u32, kind: &str) {
    let mut file = BufWriter::new(std::fs::File::create(path).unwrap());
    let at = |i: u32| f64::from(i) / f64::from(side);
    let vertices = || (0..=side).flat_map(|j| (0..=side).map(move |i| (i, j)));
    for (i, j) in vertices() {
        let height = 0.1 * libm::sin(9.0 * at(i)) * libm::sin(7.0 * at(j));
        writeln!(file, "v {:.6} {height:.6} {:.6}", at(i), at(j)).unwrap();
    }
    if kind == "full" {
        for (i, j) in vertices() {
            writeln!(file, "vt {:.6} {:.6}\nvn 0 1 {:.3}", at(i), at(j), at(i)).unwrap();
        }
    }
    if kind == "smooth" {
        writeln!(file, "s 1").unwrap();
    }
    let corner = |i: u32, j: u32| {
        let n = j * (side + 1) + i + 1;
        if kind == "full" { format!("{n}/{n}/{n}") } else { n.to_string() }
    };
    for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        if kind == "quads" {
            writeln!(file, "f {a} {d} {c} {b}").unwrap();
        } else {
            writeln!(file, "f {a} {c} {b}\nf {a} {d} {c}").unwrap();
        }
    }
}

/// Writes such hills as a `.glb` file: positions and 32-bit indices, with normals and texture coordinates too, or these with
/// 16-bit positions beside each other.
fn write_binary_hills(path: &Path, side: u32, kind: &str) {
    let at = |i: u32| i as f32 / side as f32;
    let vertices = || (0..=side).flat_map(|j| (0..=side).map(move |i| (i, j)));
    let height = |i: u32, j: u32| 0.1 * libm::sinf(9.0 * at(i)) * libm::sinf(7.0 * at(j));
    let position = |(i, j): (u32, u32)| [at(i), 0.2 + height(i, j), at(j)];
    let count = u64::from(side + 1).pow(2);
    // For each attribute its name, type, component, offset within a vertex or before all of them, and stride.
    let (attributes, stride): (&[(&str, &str, u32, u64)], u64) = match kind {
        "plain" => (&[("POSITION", "VEC3", 5126, 0)], 12),
        "full" => (
            &[
                ("POSITION", "VEC3", 5126, 0),
                ("NORMAL", "VEC3", 5126, 12 * count),
                ("TEXCOORD_0", "VEC2", 5126, 24 * count),
            ],
            32,
        ),
        _ => (&[("POSITION", "VEC3", 5123, 0), ("NORMAL", "VEC3", 5126, 8), ("TEXCOORD_0", "VEC2", 5126, 20)], 28),
    };
    let (vertex_bytes, index_bytes) = (stride * count, 24 * u64::from(side).pow(2));
    let views: Vec<String> = attributes
        .iter()
        .map(|&(_, _, _, offset)| match kind {
            "interleaved" => format!(r#"{{"buffer":0,"byteLength":{vertex_bytes},"byteStride":{stride}}}"#),
            _ => format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{}}}"#, vertex_bytes - offset),
        })
        .collect();
    let accessors: Vec<String> = attributes
        .iter()
        .enumerate()
        .map(|(view, (_, shape, component, offset))| {
            let offset = if kind == "interleaved" { *offset } else { 0 };
            format!(
                r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{component},"type":"{shape}","count":{count},
                "normalized":{},"min":[0,0,0],"max":[1,1,1]}}"#,
                *component != 5126
            )
        })
        .collect();
    let names: Vec<String> =
        attributes.iter().enumerate().map(|(number, (name, ..))| format!(r#""{name}":{number}"#)).collect();
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsUsed":["KHR_mesh_quantization"],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{{}}},"indices":{}}}]}}],"buffers":[{{"byteLength":{}}}],
        "bufferViews":[{},{{"buffer":0,"byteOffset":{vertex_bytes},"byteLength":{index_bytes}}}],
        "accessors":[{},{{"bufferView":{},"componentType":5125,"type":"SCALAR","count":{}}}]}}"#,
        names.join(","),
        attributes.len(),
        vertex_bytes + index_bytes,
        views.join(","),
        accessors.join(","),
        attributes.len(),
        index_bytes / 4
    );
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
    let mut file = BufWriter::new(std::fs::File::create(path).unwrap());
    let word = |n: u64| u32::try_from(n).unwrap().to_le_bytes();
    let json_bytes = json.len() as u64;
    file.write_all(b"glTF\x02\0\0\0").unwrap();
    file.write_all(&word(28 + json_bytes + vertex_bytes + index_bytes)).unwrap();
    file.write_all(&word(json_bytes)).unwrap();
    file.write_all(b"JSON").unwrap();
    file.write_all(json.as_bytes()).unwrap();
    file.write_all(&word(vertex_bytes + index_bytes)).unwrap();
    file.write_all(b"BIN\0").unwrap();
    let mut floats = |values: &[f32]| values.iter().for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
    match kind {
        "plain" => vertices().for_each(|vertex| floats(&position(vertex))),
        "full" => {
            vertices().for_each(|vertex| floats(&position(vertex)));
            vertices().for_each(|(i, _)| floats(&[0.1 * at(i), 1.0, 0.0]));
            vertices().for_each(|(i, j)| floats(&[at(i), at(j)]));
        }
        _ => {
            for (i, j) in vertices() {
                let [x, y, z] = position((i, j)).map(|x| (65535.0 * x) as u16);
                [x, y, z, 0].iter().for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
                [0.1 * at(i), 1.0, 0.0, at(i), at(j)].iter().for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
            }
        }
    }
    for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
        let corner = |i: u32, j: u32| j * (side + 1) + i;
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [a, c, b, a, d, c].iter().for_each(|x| file.write_all(&x.to_le_bytes()).unwrap());
    }
}

/// Loads in this process, in which nothing else runs, and prints what it took.
#[test]
#[ignore = "asked for by the tests below, in a process of its own"]
fn load_alone() {
    let path = std::env::var(FILE).unwrap();
    // What is loaded once, such as the code itself, is no part of what a model takes.
    let is_binary = path.ends_with(".glb");
    let small = Path::new(&path).with_file_name(if is_binary { "small.glb" } else { "small.obj" });
    if is_binary {
        write_binary_hills(&small, 4, "full")
    } else {
        write_hills(&small, 4, "full")
    }
    drop(load_model(&small, &LoadOptions::default(), &Silent).unwrap());
    let measured = std::fs::write("/proc/self/clear_refs", "5").ok().and_then(|()| status("VmRSS"));
    let model = load_model(Path::new(&path), &LoadOptions::default(), &Silent).unwrap();
    let end: usize = model.meshes.iter().map(TriangleMesh::bytes).sum();
    match (measured, status("VmHWM")) {
        (Some(before), Some(peak)) => println!("{PREFIX}{} {end}", peak.saturating_sub(before)),
        _ => println!("{PREFIX}"),
    }
}

const FILE: &str = "WHITTED_TEST_FILE";

/// The peak of loading is at most twice what there is in the end, and 4 MiB for buffers and a stack of threads.
fn check_load(side: u32, suffix: &str, kind: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("hills.{suffix}"));
    if suffix == "glb" {
        write_binary_hills(&path, side, kind)
    } else {
        write_hills(&path, side, kind)
    }
    let variables = [(FILE, path.to_str().unwrap().to_owned())];
    let Some([peak, end]) = ask("memory::load_alone", &variables) else { return };
    let triangles = f64::from(2 * side * side);
    println!(
        "{suffix}, {kind}, {triangles} triangles: {:.1} bytes each in the end, {:.1} at the peak",
        end / triangles,
        peak / triangles
    );
    assert!(peak < 2.0 * end + f64::from(4 << 20), "{suffix}, {kind}: {peak} bytes at the peak, {end} in the end");
}

#[test]
fn loading_an_obj_file_takes_at_most_twice_what_it_makes() {
    let all =
        |side: u32| ["plain", "quads", "smooth", "full"].into_iter().for_each(|kind| check_load(side, "obj", kind));
    all(724);
    if std::env::var_os("WHITTED_FULL_TESTS").is_some() {
        all(2237);
    } else {
        eprintln!("skipped: 10 million triangles; set WHITTED_FULL_TESTS for them");
    }
}

#[test]
fn loading_a_glb_file_takes_at_most_twice_what_it_makes() {
    let all = |side: u32| ["plain", "full", "interleaved"].into_iter().for_each(|kind| check_load(side, "glb", kind));
    all(724);
    if std::env::var_os("WHITTED_FULL_TESTS").is_some() {
        all(2237);
    } else {
        eprintln!("skipped: 10 million triangles; set WHITTED_FULL_TESTS for them");
    }
}
