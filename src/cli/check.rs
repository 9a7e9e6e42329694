//! `whitted check`.

use std::fmt::Write;
use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::arguments::LoadArguments;
use super::stats_json::timed;
use super::terminal::{self, Terminal};
use super::{arguments, values};
use super::{check_json, check_model};
use crate::accel::Kind;
use crate::error::{Error, Result};
use crate::measure::cases::{self, Case, Context, Effort, Failure, Figure, Outcome};
use crate::measure::hexadecimal::hexadecimal;
use crate::progress::Progress;

/// More are not asked about one model: some years of them.
const MOST_RAYS: u64 = 1 << 48;

/// Flags of `check`.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// Cases to run, such as D1 D13; all of them if none is named.
    #[arg(value_name = "CASE")]
    pub cases: Vec<String>,
    /// Ask as many rays as the bars call for: minutes instead of seconds.
    #[arg(long)]
    pub full: bool,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    /// Instead of the cases, compare the answers to rays of many kinds with exact ones, on this scene or model.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with_all = ["cases", "full"])]
    pub model: Option<PathBuf>,
    /// How many rays are compared on a model, at least 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_RAYS), default_value_t = 100_000)]
    #[arg(requires = "model")]
    pub rays: u64,
    /// Structures to ask; may be given more than once. All of them if it is not given.
    #[arg(long, value_name = "KIND", value_parser = values::one_of(arguments::accelerators()))]
    pub accelerator: Vec<Kind>,
    /// Number of threads; 0 is one per processor.
    #[arg(long, value_name = "N", value_parser = values::count(0..=arguments::MOST_THREADS), default_value_t = 0)]
    pub threads: u32,
    /// Draw other rays: any number.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// How a model is read.
    #[command(flatten)]
    pub load: LoadArguments,
}

/// What a case found, and how long that took.
pub struct Run {
    /// The case.
    pub case: &'static Case,
    /// What it found.
    pub outcome: Outcome,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Runs the cases one after the other, each on all threads, and prints what each found.
///
/// # Errors
/// A case that does not exist; cases that fail, once all are done; [`Error::cancelled`] after Ctrl-C, when what is
/// finished has been printed.
pub fn run(arguments: &CheckArguments) -> Result<()> {
    let cases = chosen(&arguments.cases)?;
    let kinds = kinds(&arguments.accelerator);
    super::use_threads(arguments.threads)?;
    let terminal = Terminal::new(false)?;
    if let Some(path) = &arguments.model {
        return check_model::run(path, &kinds, arguments, &terminal);
    }
    let effort = if arguments.full { Effort::Full } else { Effort::Quick };
    if !arguments.json {
        terminal::print(HEADER.as_bytes())?;
    }
    let mut runs = Vec::new();
    let mut stopped = None;
    for case in cases {
        let progress = CaseProgress { terminal: &terminal, id: case.id };
        let context = Context { effort, kinds: &kinds, progress: &progress, seed: arguments.seed };
        let (outcome, seconds) = timed(|| (case.run)(&context));
        terminal.clear();
        match outcome {
            Ok(outcome) => {
                let run = Run { case, outcome, seconds };
                if !arguments.json {
                    terminal::print(text(&run).as_bytes())?;
                }
                runs.push(run);
            }
            Err(error) => {
                stopped = Some(error);
                break;
            }
        }
    }
    if arguments.json {
        let document = check_json::document(arguments.seed, effort, &kinds, &runs, stopped.is_none());
        terminal::print((document + "\n").as_bytes())?;
    }
    match stopped {
        Some(error) => Err(error),
        None => verdict(&runs),
    }
}

/// The cases of these names, in the order of the list; all if there is no name.
fn chosen(names: &[String]) -> Result<Vec<&'static Case>> {
    for name in names {
        if cases::find(name).is_none() {
            let known: Vec<&str> = cases::all().map(|case| case.id).collect();
            return Err(Error::caller(format!("there is no case `{name}`"))
                .remedy(format!("the cases are {}", known.join(" "))));
        }
    }
    let wanted = |case: &&Case| names.is_empty() || names.iter().any(|name| name.eq_ignore_ascii_case(case.id));
    Ok(cases::all().filter(wanted).collect())
}

/// The structures of these names, each once, in the order of the list; all if there is no name.
fn kinds(named: &[Kind]) -> Vec<Kind> {
    let wanted = |kind: &Kind| named.is_empty() || named.iter().any(|named| named.resolve() == *kind);
    Kind::ALL.iter().copied().filter(wanted).collect()
}

/// An error that names the cases which failed, if any did.
fn verdict(runs: &[Run]) -> Result<()> {
    let failed: Vec<&str> = runs.iter().filter(|run| !run.outcome.passes()).map(|run| run.case.id).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let message = format!("{} of {} cases failed: {}", failed.len(), runs.len(), failed.join(" "));
    Err(Error::limit(message).remedy("do not rely on this build; `--json` has all numbers for a report"))
}

const HEADER: &str = "case          rays     wrong   distinct  95 % bound  result  seconds  what, and its bar\n";

/// One line on a case, one for each figure, and what is known of a failure.
fn text(run: &Run) -> String {
    let Run { case, outcome, seconds } = run;
    let result = if outcome.passes() { "pass" } else { "FAIL" };
    let (rays, wrong) = (outcome.rays, outcome.wrong);
    let (distinct, bound) = match outcome.bound() {
        Some((questions, rate)) => (questions.to_string(), format!("{rate:.1e}")),
        None => ("-".into(), "-".into()),
    };
    let mut text = format!(
        "{:<4} {rays:>13} {wrong:>9}  {distinct:>9}  {bound:>10}  {result:<6} {seconds:>8.1}  {}: {}\n",
        case.id, case.title, case.bar
    );
    // Writing to a string cannot fail.
    for Figure { name, value, bar } in &outcome.figures {
        let within = bar.is_none_or(|bar| *value <= bar);
        let bar = bar.map_or(String::new(), |bar| format!(" <= {}", number(bar)));
        let mark = if within { "" } else { "  FAIL" };
        let _ = writeln!(text, "{:>18} {}{bar}  {name}{mark}", "", number(*value));
    }
    if let Some(failure) = outcome.failure.as_ref().filter(|_| outcome.wrong > 0) {
        describe(failure, &mut text);
    }
    text
}

fn describe(Failure { ray, triangle, what }: &Failure, text: &mut String) {
    let _ = writeln!(text, "     {what}");
    let vector = |v: glam::Vec3| v.to_array().map(hexadecimal).join(" ");
    if let Some(ray) = ray {
        let ends = [ray.t_min, ray.t_max].map(hexadecimal).join(" ");
        let _ = writeln!(text, "     ray {} {} {ends}", vector(ray.origin), vector(ray.direction));
    }
    if let Some(corners) = triangle {
        let _ = writeln!(text, "     triangle {}", corners.map(vector).join("  "));
    }
}

/// A figure with four digits, without an exponent where that is short.
fn number(x: f64) -> String {
    let magnitude = x.abs();
    if magnitude == 0.0 || !magnitude.is_finite() || x.fract() == 0.0 && magnitude < 1e15 {
        format!("{x}")
    } else if (1e-3..1e4).contains(&magnitude) {
        let digits = (3.0 - libm::floor(libm::log10(magnitude))) as usize;
        let fixed = format!("{x:.digits$}");
        fixed.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{x:.3e}")
    }
}

/// Shows the case's name for whatever it does; the trees that it builds are no stages of their own.
struct CaseProgress<'a> {
    terminal: &'a Terminal,
    id: &'static str,
}

impl Progress for CaseProgress<'_> {
    fn begin(&self, stage: &'static str, total: u64) {
        self.terminal.begin(self.id, if stage == "rays" { total } else { 0 });
    }

    fn advance(&self, steps: u64) {
        self.terminal.advance(steps);
    }

    fn is_cancelled(&self) -> bool {
        self.terminal.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use glam::Vec3;

    #[test]
    fn figures_are_short() {
        let cases = [(0.0, "0"), (1.0, "1"), (1e8, "100000000"), (0.68151, "0.6815"), (123.456, "123.5")];
        for (x, written) in cases.into_iter().chain([(1.25e-5, "1.250e-5"), (2.5, "2.5"), (f64::NAN, "NaN")]) {
            assert_eq!(number(x), written);
        }
    }

    #[test]
    fn names_choose_cases_in_the_order_of_the_list_and_unknown_ones_are_refused() {
        let ids = |names: &[&str]| -> Vec<&str> {
            let names: Vec<String> = names.iter().map(|name| name.to_string()).collect();
            chosen(&names).unwrap().iter().map(|case| case.id).collect()
        };
        assert_eq!(ids(&["d9", "D1", "D9"]), ["D1", "D9"]);
        assert_eq!(ids(&[]).len(), cases::all().count());
        let error = chosen(&["D99".into()]).err().unwrap().to_string();
        assert!(error.contains("`D99`") && error.contains("D1 "), "{error}");
        assert_eq!(kinds(&[Kind::Auto, Kind::Linear, Kind::Linear]), [Kind::Linear, Kind::Auto.resolve()]);
        assert_eq!(kinds(&[]), Kind::ALL);
    }

    #[test]
    fn failures_are_told_with_every_bit_and_end_in_an_error() {
        let mut outcome = Outcome::default();
        let ray = Ray::new(Vec3::splat(0.1), Vec3::X);
        outcome.check(false, || Failure { ray: Some(ray), triangle: Some([Vec3::ZERO; 3]), what: "lost".into() });
        outcome.figure("large", 3.0, Some(2.0));
        let run = Run { case: cases::find("D1").unwrap(), outcome, seconds: 1.0 };
        let told = text(&run);
        for part in ["FAIL", "lost", "ray 0x1.99999ap-4 ", " inf\n", "triangle 0x0p+0", "3 <= 2  large  FAIL"] {
            assert!(told.contains(part), "{part}: {told}");
        }
        assert!(verdict(&[run]).unwrap_err().to_string().contains("1 of 1 cases failed: D1"));
    }
}
