//! What `check --json` writes. Documented in the manual's page on the command line, and stable: a change that breaks a
//! reader raises `schema`.

use glam::Vec3;
use serde::Serialize;

use super::check::Run;
use super::stats_json::SCHEMA;
use crate::accel::Kind;
use crate::measure::cases::{Effort, Figure};
use crate::measure::hexadecimal::hexadecimal;
use crate::measure::machine::Machine;

/// The whole document.
#[derive(Serialize)]
struct Document<'a> {
    schema: u32,
    version: &'static str,
    machine: Machine,
    effort: Effort,
    seed: u64,
    accelerators: Vec<&'static str>,
    /// False if Ctrl-C came before the last case.
    complete: bool,
    passed: bool,
    cases: Vec<CaseResult<'a>>,
}

/// What a case found.
#[derive(Serialize)]
struct CaseResult<'a> {
    id: &'static str,
    title: &'static str,
    bar: &'static str,
    rays: u64,
    wrong: u64,
    /// Different random questions put to the kind of structure that was asked the fewest; null where all are listed.
    distinct: Option<u64>,
    /// Upper end of the 95 % interval of the rate of those answered wrongly; null where all are listed.
    bound: Option<f64>,
    passed: bool,
    seconds: f64,
    figures: &'a [Figure],
    failure: Option<FailureText<'a>>,
}

/// A wrong answer, its numbers hexadecimal.
#[derive(Serialize)]
struct FailureText<'a> {
    what: &'a str,
    origin: Option<[String; 3]>,
    direction: Option<[String; 3]>,
    t_min: Option<String>,
    t_max: Option<String>,
    triangle: Option<[[String; 3]; 3]>,
}

/// The document as text.
pub fn document(seed: u64, effort: Effort, kinds: &[Kind], runs: &[Run], complete: bool) -> String {
    let document = Document {
        schema: SCHEMA,
        version: env!("CARGO_PKG_VERSION"),
        machine: Machine::this(),
        effort,
        seed,
        accelerators: kinds.iter().map(|kind| kind.name()).collect(),
        complete,
        passed: complete && runs.iter().all(|run| run.outcome.passes()),
        cases: runs.iter().map(result).collect(),
    };
    serde_json::to_string_pretty(&document).expect("names and numbers have a JSON form")
}

fn result(Run { case, outcome, seconds }: &Run) -> CaseResult<'_> {
    let vector = |v: Vec3| v.to_array().map(hexadecimal);
    let failure = outcome.failure.as_ref().map(|failure| FailureText {
        what: &failure.what,
        origin: failure.ray.map(|ray| vector(ray.origin)),
        direction: failure.ray.map(|ray| vector(ray.direction)),
        t_min: failure.ray.map(|ray| hexadecimal(ray.t_min)),
        t_max: failure.ray.map(|ray| hexadecimal(ray.t_max)),
        triangle: failure.triangle.map(|corners| corners.map(vector)),
    });
    CaseResult {
        id: case.id,
        title: case.title,
        bar: case.bar,
        rays: outcome.rays,
        wrong: outcome.wrong,
        distinct: outcome.bound().map(|(questions, _)| questions),
        bound: outcome.bound().map(|(_, rate)| rate),
        passed: outcome.passes(),
        seconds: *seconds,
        figures: &outcome.figures,
        failure,
    }
}
