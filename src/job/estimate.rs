//! What a rendering will take, told from a small part of it.
//!
//! Reading and building are done, and timed. Of the picture every 16th tile along a curve is rendered, and then others, until there
//! is no more time for that: what each cost stands for its neighbours. From the costs of all tiles follows how long machines take
//! that share them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::error::Result;
use crate::progress::Progress;
use crate::render::{Film, RenderSettings, Renderer, Tile, Tiles};
use crate::scene::{Background, FilmSettings};

/// In how many steps all tiles are tried.
const STEPS: u32 = 16;

/// Samples of a pixel that are tried, where there are more.
const SAMPLES: u32 = 4;

/// This part of the tiles is to be tried with all samples, or few samples are taken.
const LEAST_TRIED: f64 = 0.125;

/// Another machine pays if it saves this part of the time.
const WORTHWHILE: f64 = 0.05;

/// The most machines that are looked at.
const MOST_MACHINES: u32 = 4096;

/// What each tile of a picture costs.
#[derive(Debug, Clone, PartialEq)]
pub struct Pilot {
    /// Seconds of one thread, by the tile's number.
    pub costs: Vec<f64>,
    /// How many tiles were tried.
    pub tried: u32,
    /// With how many samples a pixel.
    pub samples: u32,
    /// With how many threads.
    pub threads: usize,
    /// The picture of them, the rest black.
    pub film: Film,
}

impl Pilot {
    /// Tries tiles of the picture for about a time. The renderer keeps its film.
    ///
    /// # Errors
    /// As [`Renderer::render`], or a cancellation.
    pub fn fly(renderer: &mut Renderer, threads: usize, time: Duration, progress: &dyn Progress) -> Result<Self> {
        let film = renderer.scene().film;
        let few = film.samples.min(SAMPLES);
        renderer.set_film(FilmSettings { samples: few, ..film });
        // Fewer samples are dearer each: all of them are tried where there is time for some tiles.
        let first = Self::try_tiles(renderer, threads, Duration::ZERO, progress);
        let is_quick = first.as_ref().is_ok_and(|first| {
            let whole =
                first.costs.iter().sum::<f64>() / first.threads as f64 * f64::from(film.samples) / f64::from(few);
            whole * LEAST_TRIED < time.as_secs_f64()
        });
        let samples = if is_quick { film.samples } else { few };
        renderer.set_film(FilmSettings { samples, ..film });
        let tried = first.and_then(|_| Self::try_tiles(renderer, threads, time, progress));
        renderer.set_film(film);
        let mut pilot = tried?;
        let share = f64::from(film.samples) / f64::from(samples);
        pilot.costs.iter_mut().for_each(|cost| *cost *= share);
        Ok(pilot)
    }

    /// Tries tiles of the picture that the renderer makes now.
    fn try_tiles(renderer: &Renderer, threads: usize, time: Duration, progress: &dyn Progress) -> Result<Self> {
        let film = renderer.scene().film;
        let tiles = Tiles::of(&film, None)?;
        let transparent = renderer.scene().background == Background::Transparent;
        let mut picture = Film::blank(film, None, &[], transparent)?;
        let finished = Mutex::new(Vec::new());
        let (mut wall, mut used, start) = (0.0, 0, Instant::now());
        for step in 0..STEPS {
            // Far from those before: the bits of the step's number, turned round.
            let numbers = tiles.share(step.reverse_bits() >> (u32::BITS - STEPS.ilog2()), STEPS);
            if numbers.is_empty() {
                continue;
            }
            let settings = RenderSettings { threads, tiles: Some(numbers), ..RenderSettings::default() };
            let note = |tile: &Tile| finished.lock().unwrap_or_else(PoisonError::into_inner).push(tile.clone());
            let stats = renderer.render_tiles(&settings, progress, &note)?.stats;
            progress.check()?;
            wall += stats.seconds;
            used = stats.threads;
            if start.elapsed() > time {
                break;
            }
        }
        let mut costs = vec![None; tiles.count() as usize];
        for tile in finished.into_inner().unwrap_or_else(PoisonError::into_inner) {
            costs[tile.number as usize] = Some(tile.seconds.traversal + tile.seconds.shading);
            picture.put(&tile);
        }
        // What threads did besides belongs to all tiles alike.
        let sum: f64 = costs.iter().flatten().sum();
        let whole = if sum > 0.0 { wall * used as f64 / sum } else { 1.0 };
        let tried = costs.iter().flatten().count() as u32;
        let mut last = costs.iter().flatten().next().copied().unwrap_or(0.0);
        let mut all = vec![0.0; costs.len()];
        for number in tiles.along_curve() {
            last = costs[number as usize].unwrap_or(last);
            all[number as usize] = last * whole;
        }
        // Neighbours may be dearer or cheaper: as a whole those that were tried count.
        let mean = sum * whole / f64::from(tried.max(1));
        let total: f64 = all.iter().sum();
        let correction = if total > 0.0 { mean * all.len() as f64 / total } else { 1.0 };
        let costs = all.into_iter().map(|cost| cost * correction).collect();
        Ok(Self { costs, tried, samples: film.samples, threads: used, film: picture })
    }

    /// Seconds for all tiles on so many threads, which take the next tile as soon as they are free.
    pub fn seconds(&self, threads: usize) -> f64 {
        schedule(self.costs.iter().copied(), threads)
    }
}

/// When the last of some works ends, which so many threads take in turn.
fn schedule(costs: impl Iterator<Item = f64>, threads: usize) -> f64 {
    // Whole nanoseconds have an order.
    let mut free: BinaryHeap<Reverse<u64>> = (0..threads.max(1)).map(|_| Reverse(0)).collect();
    let mut last = 0;
    for cost in costs {
        let Some(Reverse(start)) = free.pop() else { break };
        let end = start + (cost * 1e9) as u64;
        free.push(Reverse(end));
        last = last.max(end);
    }
    last as f64 * 1e-9
}

/// What each machine does besides its tiles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Overhead {
    /// Seconds from the start to a scene that is read: on one thread.
    pub load: f64,
    /// Seconds of building, all threads together.
    pub build: f64,
    /// Seconds that the picture's bytes take in the end, on one machine.
    pub write: f64,
}

/// How long machines take that share a picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shared {
    /// How many.
    pub machines: u32,
    /// Threads of each.
    pub cores: u32,
    /// Seconds until the picture is there: reading, building, the longest share of the tiles, merging.
    pub seconds: f64,
    /// Seconds of the longest share of the tiles.
    pub longest: f64,
    /// The longest share over the mean of all.
    pub imbalance: f64,
}

impl Shared {
    /// Predicts the time of machines that each read and build the scene and render a share of the tiles.
    pub fn predict(pilot: &Pilot, tiles: &Tiles, overhead: &Overhead, machines: u32, cores: u32) -> Self {
        Self::along(pilot, &tiles.along_curve(), overhead, machines, cores)
    }

    /// The same, for tiles in the order in which they are dealt out.
    fn along(pilot: &Pilot, curve: &[u32], overhead: &Overhead, machines: u32, cores: u32) -> Self {
        let share = |number: u32| {
            let own = curve.iter().skip(number as usize).step_by(machines.max(1) as usize);
            schedule(own.map(|&tile| pilot.costs.get(tile as usize).copied().unwrap_or(0.0)), cores as usize)
        };
        let shares: Vec<f64> = (0..machines).map(share).collect();
        let longest = shares.iter().copied().fold(0.0, f64::max);
        let mean = shares.iter().sum::<f64>() / f64::from(machines.max(1));
        Self {
            machines,
            cores,
            seconds: overhead.load + overhead.build / f64::from(cores.max(1)) + longest + overhead.write,
            longest,
            imbalance: if mean > 0.0 { longest / mean } else { 1.0 },
        }
    }

    /// The number of such machines from which on twice as many save less than a twentieth of the time.
    pub fn worthwhile(pilot: &Pilot, tiles: &Tiles, overhead: &Overhead, cores: u32) -> u32 {
        let curve = tiles.along_curve();
        let seconds = |machines: u32| Self::along(pilot, &curve, overhead, machines, cores).seconds;
        let mut machines = 1;
        let mut now = seconds(machines);
        while machines < MOST_MACHINES {
            let next = seconds(2 * machines);
            if next > now * (1.0 - WORTHWHILE) {
                break;
            }
            (machines, now) = (2 * machines, next);
        }
        machines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_take_the_next_work_when_they_are_free() {
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
        close(schedule([3.0, 1.0, 1.0, 1.0].into_iter(), 2), 3.0);
        close(schedule([1.0, 1.0, 1.0, 3.0].into_iter(), 2), 4.0);
        close(schedule([1.0; 10].into_iter(), 4), 3.0);
        close(schedule([1.0; 10].into_iter(), 1), 10.0);
        close(schedule([].into_iter(), 3), 0.0);
    }

    #[test]
    fn machines_pay_until_reading_takes_most() {
        let film = FilmSettings { width: 640, height: 640, ..FilmSettings::default() };
        let tiles = Tiles::of(&film, None).unwrap();
        let film = Film::blank(film, None, &[], false).unwrap();
        let pilot = Pilot { costs: vec![1.0; 400], tried: 400, samples: 1, threads: 2, film };
        let overhead = Overhead { load: 2.0, build: 8.0, write: 1.0 };
        let predicted = Shared::predict(&pilot, &tiles, &overhead, 4, 2);
        assert!((predicted.seconds - (2.0 + 4.0 + 50.0 + 1.0)).abs() < 1e-6, "{predicted:?}");
        assert!((predicted.imbalance - 1.0).abs() < 1e-9);
        // 400 / 2 / m + 7: 64 machines take 11 s, 128 take 9, 256 take 8, and no share is shorter than a tile.
        assert_eq!(Shared::worthwhile(&pilot, &tiles, &overhead, 2), 256);
        let slow = Overhead { load: 1000.0, ..overhead };
        // 1205 s, 1105 and 1055.
        assert_eq!(Shared::worthwhile(&pilot, &tiles, &slow, 2), 2);
        assert!((pilot.seconds(2) - 200.0).abs() < 1e-6);
    }
}
