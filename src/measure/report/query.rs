//! The query plane: rays a second against wrong answers.

use rayon::prelude::*;

use super::choices::{Answers, Choice, Label};
use super::judge::{Judge, Truth, Verdict};
use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::measure::ray_set::{Answered, Group, Question, RaySet};
use crate::measure::speed::{interleaved, millions_per_second};
use crate::measure::statistics::Median;
use crate::measure::sweep::{Cost, Range, Rate, dominated};
use crate::progress::Progress;

/// Rays that are worked on together: few enough to stop soon.
const PIECE: usize = 1024;

/// One choice on one set of rays.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct QueryRow {
    /// The set of rays.
    pub ray_kind: String,
    /// Whether it is made to be hard.
    pub group: Group,
    /// What was asked.
    pub question: Question,
    /// What answered.
    #[serde(flatten)]
    pub label: Label,
    /// Million rays a second on one thread, one ray after the other, set-up included; null if not timed.
    pub mrays_per_s: Option<Median>,
    /// Rays that were timed: the first ones of those judged.
    pub rays_timed: usize,
    /// Surfaces that were missed, of the rays that meet one.
    pub misses: Rate,
    /// Surfaces that were hit without being there, of all rays.
    pub false_hits: Rate,
    /// Answers that rounding alone decides, which are not counted as wrong.
    pub borderline: u64,
    /// Rays that were answered by a hit.
    pub hits: u64,
    /// Hash of all answers.
    pub hit_hash: String,
    /// Whether another choice is no slower and no less right, and better in one.
    pub dominated: bool,
}

impl QueryRow {
    /// Wrong answers of either kind, of all rays.
    pub fn wrong(&self) -> Rate {
        Rate::new(self.misses.wrong + self.false_hits.wrong, self.false_hits.total)
    }
}

/// How much is timed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Of each set these many rays.
    pub rays_timed: usize,
    /// How often; 0 leaves timing out.
    pub repetitions: u32,
}

/// What was asked of a set and what came: everything that rows are made of.
pub struct Asked<'a> {
    /// The rays.
    pub set: &'a RaySet,
    /// The exact answers.
    pub truths: Vec<Option<Truth>>,
    /// The answers of every choice.
    pub answers: Vec<Answered>,
    /// The rates of every choice.
    pub speeds: Vec<Option<Median>>,
    /// How many rays were timed.
    pub rays_timed: usize,
}

/// Finds the exact answers to a set and those of all choices, and times them.
///
/// # Errors
/// A cancellation.
pub fn ask<'a>(
    choices: &[Choice<'_>],
    set: &'a RaySet,
    judge: &Judge<'_>,
    effort: Effort,
    progress: &dyn Progress,
) -> Result<Asked<'a>> {
    progress.begin("judge", set.rays.len() as u64);
    let truths = in_pieces(&set.rays, progress, |rays| rays.iter().map(|ray| judge.truth(ray)).collect())?;
    let answers = choices.iter().map(|choice| answers(choice.answers.as_ref(), set)).collect::<Vec<_>>();
    let speeds = time(choices, set, &answers, effort, progress)?;
    let rays_timed = if effort.repetitions == 0 { 0 } else { effort.rays_timed.min(set.rays.len()) };
    Ok(Asked { set, truths, answers, speeds, rays_timed })
}

/// Applies `body` to all rays, a piece at a time on all threads.
fn in_pieces<T: Send + Clone>(
    rays: &[Ray],
    progress: &dyn Progress,
    body: impl Fn(&[Ray]) -> Vec<T> + Sync,
) -> Result<Vec<T>> {
    let pieces: Result<Vec<Vec<T>>> = rays
        .par_chunks(PIECE)
        .map(|rays| {
            progress.check()?;
            let found = body(rays);
            progress.advance(rays.len() as u64);
            Ok(found)
        })
        .collect();
    Ok(pieces?.concat())
}

fn answers(answers: &dyn Answers, set: &RaySet) -> Answered {
    match set.question {
        Question::Closest => {
            let mut hits = vec![Hit::MISS; set.rays.len()];
            let pieces = set.rays.par_chunks(PIECE).zip(hits.par_chunks_mut(PIECE));
            pieces.for_each(|(rays, hits)| answers.closest(rays, hits));
            Answered::Closest(hits)
        }
        Question::Occluded => {
            let mut flags = vec![false; set.rays.len()];
            let pieces = set.rays.par_chunks(PIECE).zip(flags.par_chunks_mut(PIECE));
            pieces.for_each(|(rays, flags)| answers.occluded(rays, flags));
            Answered::Occluded(flags)
        }
    }
}

/// Times all choices on the first rays of a set, in turn.
///
/// # Panics
/// If a choice answers otherwise than it did when it was judged.
fn time(
    choices: &[Choice<'_>],
    set: &RaySet,
    judged: &[Answered],
    effort: Effort,
    progress: &dyn Progress,
) -> Result<Vec<Option<Median>>> {
    let rays = &set.rays[..effort.rays_timed.min(set.rays.len())];
    if effort.repetitions == 0 || rays.is_empty() {
        return Ok(vec![None; choices.len()]);
    }
    progress.begin("time", u64::from(effort.repetitions + 1) * choices.len() as u64);
    let empty = match set.question {
        Question::Closest => Answered::Closest(vec![Hit::MISS; rays.len()]),
        Question::Occluded => Answered::Occluded(vec![false; rays.len()]),
    };
    let mut timed = vec![empty; choices.len()];
    let mut work: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for (choice, slots) in choices.iter().zip(&mut timed) {
        let answers = choice.answers.as_ref();
        work.push(match slots {
            Answered::Closest(hits) => Box::new(move || answers.closest(rays, hits)),
            Answered::Occluded(flags) => Box::new(move || answers.occluded(rays, flags)),
        });
    }
    let mut pieces: Vec<&mut dyn FnMut()> = Vec::new();
    for work in &mut work {
        pieces.push(work.as_mut());
    }
    let seconds = interleaved(&mut pieces, effort.repetitions, progress)?;
    drop(work);
    for ((timed, judged), choice) in timed.iter().zip(judged).zip(choices) {
        assert!(judged.begins_with(timed), "{} answers otherwise when it is timed", choice.label.name);
    }
    Ok(seconds.into_iter().map(|seconds| Some(millions_per_second(rays.len(), seconds))).collect())
}

/// Judges what was answered: one row a choice.
///
/// # Errors
/// A cancellation.
pub fn rows(
    choices: &[Choice<'_>],
    asked: &Asked<'_>,
    judge: &Judge<'_>,
    progress: &dyn Progress,
) -> Result<Vec<QueryRow>> {
    let set = asked.set;
    progress.begin("judge", (set.rays.len() * choices.len()) as u64);
    let mut rows = Vec::new();
    for ((choice, answers), speed) in choices.iter().zip(&asked.answers).zip(&asked.speeds) {
        let [misses, false_hits, borderline] = count(choice, set, &asked.truths, answers, judge, progress)?;
        let total = set.rays.len() as u64;
        rows.push(QueryRow {
            ray_kind: set.name.clone(),
            group: set.group,
            question: set.question,
            label: choice.label.clone(),
            mrays_per_s: *speed,
            rays_timed: asked.rays_timed,
            misses: Rate::new(misses, asked.truths.iter().flatten().count() as u64),
            false_hits: Rate::new(false_hits, total),
            borderline,
            hits: answers.hits_in_first(set.rays.len()),
            hit_hash: answers.hash(),
            dominated: false,
        });
    }
    let cost = |row: &QueryRow| {
        let untimed = Median { value: 0.0, low: 0.0, high: 0.0 };
        let errors = [&row.misses, &row.false_hits].map(Range::of_rate);
        Cost { speed: row.mrays_per_s.unwrap_or(untimed), errors }
    };
    let dominated = dominated(&rows.iter().map(cost).collect::<Vec<_>>());
    rows.iter_mut().zip(dominated).for_each(|(row, dominated)| row.dominated = dominated);
    Ok(rows)
}

/// Misses, false hits, borderline answers.
fn count(
    choice: &Choice<'_>,
    set: &RaySet,
    truths: &[Option<Truth>],
    answers: &Answered,
    judge: &Judge<'_>,
    progress: &dyn Progress,
) -> Result<[u64; 3]> {
    let verdict = |number: usize| {
        let (ray, truth) = (&set.rays[number], truths[number].as_ref());
        match answers {
            Answered::Closest(hits) => judge.closest(ray, truth, &hits[number]),
            Answered::Occluded(flags) => judge.occluded(ray, truth.is_some(), flags[number], || {
                let mut hit = [Hit::MISS];
                choice.answers.closest(std::slice::from_ref(ray), &mut hit);
                hit[0]
            }),
        }
    };
    let piece = |start: usize| {
        progress.check()?;
        let mut found = [0; 3];
        let end = (start + PIECE).min(set.rays.len());
        for number in start..end {
            match verdict(number) {
                Verdict::Right => {}
                Verdict::Missed => found[0] += 1,
                Verdict::False => found[1] += 1,
                Verdict::Borderline => found[2] += 1,
            }
        }
        progress.advance((end - start) as u64);
        Ok(found)
    };
    let starts: Vec<usize> = (0..set.rays.len()).step_by(PIECE).collect();
    let add = |a: [u64; 3], b: [u64; 3]| Ok(std::array::from_fn(|k| a[k] + b[k]));
    starts.into_par_iter().map(piece).try_reduce(|| [0; 3], add)
}
