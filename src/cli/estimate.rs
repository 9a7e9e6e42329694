//! `whitted info --estimate`: what rendering will take.

use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;

use super::arguments::ValueArguments;
use super::memory_limit::picture_bytes;
use super::stats_json::{peak_resident_bytes, resident_bytes};
use super::values;
use crate::error::Result;
use crate::formats::picture;
use crate::job::estimate::{Overhead, Pilot, Shared};
use crate::progress::Progress;
use crate::render::{Renderer, Tiles};

/// For so long tiles are tried.
const TIME: Duration = Duration::from_secs(4);

/// Flags of `info` about what rendering takes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Estimate")]
pub struct EstimateArguments {
    /// Also build the acceleration structures, try a part of the picture, and tell how much memory and time rendering will take.
    #[arg(long)]
    pub estimate: bool,
    /// How long so many machines will take that share the picture, and how many pay.
    #[arg(long, value_name = "M", value_parser = values::count(1..=4096), requires = "estimate")]
    pub machines: Option<u32>,
    /// Processors that each of the machines has; without it, as many as this one.
    #[arg(long, value_name = "N", value_parser = values::count(1..=4096), requires = "machines")]
    pub cores: Option<u32>,
    /// What is estimated.
    #[command(flatten)]
    pub values: ValueArguments,
}

/// What rendering will take.
#[derive(Debug, Serialize)]
pub struct Estimate {
    /// The most memory that the process will have, in bytes.
    pub peak_bytes: u64,
    /// Whether the system told how much reading and building took; else it is what their arrays take.
    pub measured: bool,
    /// Seconds of reading, as it took here.
    pub load: f64,
    /// Seconds of building, as it took here.
    pub build: f64,
    /// Seconds of rendering on as many threads as here.
    pub render: f64,
    /// Seconds of writing a PNG.
    pub write: f64,
    /// All of them.
    pub seconds: f64,
    /// Tiles of the picture.
    pub tiles: u32,
    /// How many of them were tried.
    pub tried: u32,
    /// Samples a pixel that they were tried with.
    pub tried_samples: u32,
    /// Threads that were used.
    pub threads: usize,
    /// How long machines take that share it; null unless `--machines` was given.
    pub shared: Option<Shared>,
    /// The number of such machines from which on twice as many save less than a twentieth; null unless `--machines` was given.
    pub worthwhile: Option<u32>,
}

impl Estimate {
    /// Tries a part of the picture of a scene that took so many seconds to read. `needed` are the bytes of the structures while they are
    /// built, and of all else.
    ///
    /// # Errors
    /// Those of rendering, or a cancellation.
    pub fn of(
        renderer: &mut Renderer,
        load: f64,
        needed: u64,
        arguments: &EstimateArguments,
        threads: usize,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let film = renderer.scene().film;
        let tiles = Tiles::of(&film, None)?;
        let measured = peak_resident_bytes().zip(resident_bytes());
        let pilot = Pilot::fly(renderer, threads, TIME, progress)?;
        let start = Instant::now();
        picture::write_png(&pilot.film, &mut std::io::sink())?;
        let write = start.elapsed().as_secs_f64();
        let build = renderer.build_stats().seconds;
        let render = pilot.seconds(pilot.threads);
        let picture = picture_bytes(renderer.scene(), None, &[]);
        let peak_bytes = measured.map_or(needed + picture, |(peak, now)| peak.max(now + picture));
        let overhead = Overhead { load, build: build * pilot.threads as f64, write };
        let cores = arguments.cores.unwrap_or(pilot.threads as u32);
        Ok(Self {
            peak_bytes,
            measured: measured.is_some(),
            load,
            build,
            render,
            write,
            seconds: load + build + render + write,
            tiles: tiles.count(),
            tried: pilot.tried,
            tried_samples: pilot.samples,
            threads: pilot.threads,
            shared: arguments.machines.map(|machines| Shared::predict(&pilot, &tiles, &overhead, machines, cores)),
            worthwhile: arguments.machines.map(|_| Shared::worthwhile(&pilot, &tiles, &overhead, cores)),
        })
    }
}
