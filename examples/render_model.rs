//! Renders a model or a scene file into a PNG, with progress and a time limit of its own.
//!
//! ```text
//! cargo run --release --example render_model -- INPUT [OUT.png] [SECONDS]
//! cargo run --release --example render_model -- meshes/teapot.obj
//! ```
//!
//! It is a preview: half the size and four samples a pixel. Once the seconds are over, work that has not come to
//! rendering fails as cancelled; a picture that was begun is saved with the tiles that are finished.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use whitted::accel::Params;
use whitted::formats::{self, LoadOptions, picture};
use whitted::progress::Progress;
use whitted::render::{RenderSettings, Renderer};

/// Prints a line a tenth of each stage, and cancels the work at the deadline.
struct Reporter {
    /// The stage's name, and its steps: those done and all.
    stage: Mutex<(&'static str, u64, u64)>,
    deadline: Instant,
}

impl Progress for Reporter {
    fn begin(&self, stage: &'static str, total: u64) {
        *self.stage.lock().unwrap() = (stage, 0, total);
    }

    fn advance(&self, steps: u64) {
        let (stage, done, total) = &mut *self.stage.lock().unwrap();
        let before = *done * 10 / (*total).max(1);
        *done += steps;
        let after = *done * 10 / (*total).max(1);
        if after > before {
            eprintln!("{stage:6} {:3} %", after * 10);
        }
    }

    fn is_cancelled(&self) -> bool {
        Instant::now() >= self.deadline
    }
}

fn render(input: &Path, output: &Path, progress: &Reporter) -> whitted::Result<()> {
    let mut scene = formats::open(input, &LoadOptions::default(), progress)?.scene;
    scene.film.width = scene.film.width.div_ceil(2);
    scene.film.height = scene.film.height.div_ceil(2);
    scene.film.samples = 4;

    let renderer = Renderer::build(scene, &Params::default(), progress)?;
    let film = renderer.render(&RenderSettings::default(), progress)?;
    picture::save(&film, output)?;
    let how = if film.complete { "" } else { ", cut short" };
    println!("{}: {} rays{how}", output.display(), film.stats.rays.total());
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [input, rest @ ..] = &arguments[..] else {
        eprintln!("usage: render_model INPUT [OUT.png] [SECONDS]");
        return ExitCode::from(2);
    };
    let output = rest.first().map_or("render_model.png", String::as_str);
    let seconds = rest.get(1).and_then(|text| text.parse().ok()).unwrap_or(3600);
    let reporter = Reporter { stage: Mutex::default(), deadline: Instant::now() + Duration::from_secs(seconds) };
    match render(input.as_ref(), output.as_ref(), &reporter) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
