//! How cost grows with the number of triangles: reads, builds and renders models, and writes a table and a plot.
//!
//! ```text
//! cargo run --release --example large_terrain -- 100000000 t100.glb       for each size
//! cargo run --release --example growth -- growth.svg t1.glb t3.glb t10.glb t30.glb t100.glb
//! ```
//!
//! The table goes to standard output: seconds of each stage, and the most memory that the process had resident in it, as Linux tells.
//! Rays a second are all rays of the picture that `whitted render` makes without options, over the time of rendering it.

use std::path::Path;
use std::time::Instant;

use whitted::accel::Params;
use whitted::formats::{LoadOptions, open};
use whitted::measure::plot::{Height, Mark, Panel, Point, Scatter, scatter};
use whitted::progress::Silent;
use whitted::render::{RenderSettings, Renderer};

/// A stage's seconds and, where the system tells, its peak in bytes.
type Stage = (f64, Option<f64>);

struct Row {
    triangles: f64,
    load: Stage,
    build: Stage,
    render: Stage,
    rays: f64,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let plot = arguments.next().ok_or("usage: growth PLOT.svg MODEL...")?;
    println!(
        "| triangles | read, s | peak, GiB | build, s | peak, GiB | render, s | peak, GiB | million rays a second |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut rows = Vec::new();
    for model in arguments {
        let row = measure(Path::new(&model))?;
        let stage = |(seconds, peak): Stage| {
            let peak = peak.map_or("-".into(), |bytes| format!("{:.2}", bytes / f64::from(1 << 30)));
            format!("{seconds:.2} | {peak}")
        };
        let [load, build, render] = [row.load, row.build, row.render].map(stage);
        println!("| {:.2} M | {load} | {build} | {render} | {:.2} |", row.triangles / 1e6, row.rays / 1e6);
        rows.push(row);
    }
    std::fs::write(&plot, scatter(&picture(&rows)))?;
    Ok(())
}

fn measure(path: &Path) -> whitted::Result<Row> {
    let (loaded, load) = stage(|| open(path, &LoadOptions::default(), &Silent));
    let scene = loaded?.scene;
    let triangles = scene.meshes.iter().map(|mesh| mesh.live_count()).sum::<usize>() as f64;
    let (renderer, build) = stage(|| Renderer::build(scene, &Params::default(), &Silent));
    let renderer = renderer?;
    let (film, render) = stage(|| renderer.render(&RenderSettings::default(), &Silent));
    Ok(Row { triangles, load, build, render, rays: film?.stats.rays.total() as f64 / render.0 })
}

/// Does some work and tells what it took.
fn stage<T>(work: impl FnOnce() -> T) -> (T, Stage) {
    // The system forgets the peak so far.
    let forgotten = std::fs::write("/proc/self/clear_refs", "5").is_ok();
    let start = Instant::now();
    let done = work();
    let seconds = start.elapsed().as_secs_f64();
    let peak = || -> Option<f64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? * 1024.0)
    };
    (done, (seconds, peak().filter(|_| forgotten)))
}

fn picture(rows: &[Row]) -> Scatter {
    let points = |label: &str, color: usize, mark: Mark, value: &dyn Fn(&Row) -> Option<f64>| -> Vec<Point> {
        let point = |row: &Row| {
            let y = value(row)?;
            let label = if row.triangles == rows.last()?.triangles { label.to_owned() } else { String::new() };
            Some(Point { label, x: [row.triangles; 3], y: Height::At(y, [y; 2]), color, mark })
        };
        rows.iter().filter_map(point).collect()
    };
    let gib = |bytes: Option<f64>| Some(bytes? / f64::from(1 << 30));
    Scatter {
        title: "How cost grows with triangles".into(),
        x_label: "triangles".into(),
        y_label: "seconds, GiB, million rays a second".into(),
        panels: vec![
            Panel {
                title: "Time, seconds".into(),
                points: [
                    points("read", 0, Mark::Circle, &|row| Some(row.load.0)),
                    points("build", 1, Mark::Square, &|row| Some(row.build.0)),
                    points("render", 2, Mark::Diamond, &|row| Some(row.render.0)),
                ]
                .concat(),
            },
            Panel {
                title: "Peak memory, GiB".into(),
                points: [
                    points("read", 0, Mark::Circle, &|row| gib(row.load.1)),
                    points("build", 1, Mark::Square, &|row| gib(row.build.1)),
                    points("render", 2, Mark::Diamond, &|row| gib(row.render.1)),
                ]
                .concat(),
            },
            Panel {
                title: "Million rays a second".into(),
                points: points("all rays", 3, Mark::Circle, &|row| Some(row.rays / 1e6)),
            },
        ],
        legend: vec![
            (Mark::Circle, "read, or all rays".into()),
            (Mark::Square, "build".into()),
            (Mark::Diamond, "render".into()),
        ],
    }
}
