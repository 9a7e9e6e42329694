//! How fast OBJ files load, beside tobj's reader alone, and how much memory that takes: `cargo bench --bench load`.
//!
//! Hills of a million triangles are written as text and read by each in turn, several rounds; what is printed is the median.
//! `whitted` cleans lines, keeps f64, unifies corners, chooses an origin, looks for triangles that cannot be hit; `tobj` reads
//! into f32 vectors. `tobj, one index` unifies corners too, as is needed for a mesh.

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use whitted::formats::{LoadOptions, load_model};
use whitted::progress::Silent;

/// Squares along a side: two triangles each.
const SIDE: u32 = 708;

/// Rounds of all readers.
const ROUNDS: usize = 7;

/// What a file has beside positions and faces.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Plain,
    Smoothed,
    Full,
}

/// The text of hills.
fn hills(side: u32, kind: Kind) -> String {
    let mut text = String::new();
    let at = |i: u32| f64::from(i) / f64::from(side);
    for (j, i) in (0..=side).flat_map(|j| (0..=side).map(move |i| (j, i))) {
        let height = 0.1 * libm::sin(9.0 * at(i)) * libm::sin(7.0 * at(j));
        writeln!(text, "v {:.6} {height:.6} {:.6}", at(i), at(j)).unwrap();
    }
    if kind == Kind::Full {
        for (j, i) in (0..=side).flat_map(|j| (0..=side).map(move |i| (j, i))) {
            writeln!(text, "vt {:.6} {:.6}\nvn {:.4} 0.9800 {:.4}", at(i), at(j), 0.1 * at(j), 0.1 * at(i)).unwrap();
        }
    }
    if kind == Kind::Smoothed {
        text += "s 1\n";
    }
    let vertex = |i: u32, j: u32| j * (side + 1) + i + 1;
    let corner = |n: u32| if kind == Kind::Full { format!("{n}/{n}/{n}") } else { n.to_string() };
    for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
        let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)].map(corner);
        writeln!(text, "f {a} {c} {b}\nf {a} {d} {c}").unwrap();
    }
    text
}

/// Loads by whitted; the bytes of the mesh.
fn by_whitted(path: &Path) -> usize {
    let model = load_model(path, &LoadOptions::default(), &Silent).unwrap();
    black_box(&model).meshes[0].bytes()
}

fn by_tobj(path: &Path, single_index: bool) -> usize {
    let options = tobj::LoadOptions { single_index, triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options).unwrap();
    black_box(&models).len()
}

fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

/// How often each is timed: once where `cargo bench -- --test` asks whether it runs at all.
fn runs() -> usize {
    if std::env::args().any(|argument| argument == "--test") { 1 } else { ROUNDS }
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    for (name, kind) in
        [("positions", Kind::Plain), ("positions, s 1", Kind::Smoothed), ("positions, vt, vn", Kind::Full)]
    {
        let path = folder.path().join("hills.obj");
        let text = hills(SIDE, kind);
        let megabytes = text.len() as f64 / 1e6;
        std::fs::write(&path, &text).unwrap();
        drop(text);

        let readers: [(&str, &dyn Fn() -> usize); 3] = [
            ("whitted", &|| by_whitted(&path)),
            ("tobj", &|| by_tobj(&path, false)),
            ("tobj, one index", &|| by_tobj(&path, true)),
        ];
        let mut seconds = [const { Vec::new() }; 3];
        for _ in 0..runs() {
            for ((_, read), seconds) in readers.iter().zip(&mut seconds) {
                let start = Instant::now();
                black_box(read());
                seconds.push(start.elapsed().as_secs_f64());
            }
        }
        for ((reader, _), seconds) in readers.iter().zip(seconds) {
            let seconds = median(seconds);
            println!("{name}, {megabytes:.0} MB: {reader} {seconds:.3} s, {:.0} MB/s", megabytes / seconds);
        }
    }
}
