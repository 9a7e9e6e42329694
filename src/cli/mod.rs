//! The command line: arguments, one file a subcommand, and what they share.
//!
//! Results go to standard output, everything else to standard error. The library below never prints, reads arguments
//! or exits. The manual page is [`crate::manual::command_line`].

pub mod arguments;
mod bench;
mod build;
mod camera;
mod check;
mod check_json;
mod check_model;
mod commit;
mod completions;
mod diff;
mod doctor;
mod edit;
mod estimate;
mod explain;
mod explain_text;
mod info;
mod info_text;
mod job;
mod ledger;
mod memory_limit;
mod outputs;
mod precision;
mod query;
mod ray_input;
mod render;
mod report;
mod stats_json;
mod stream;
mod terminal;
mod values;

use std::process::ExitCode;

pub use arguments::Arguments;

use crate::error::{Error, Fault, Result};
use crate::math::simd::{Level, VARIABLE};
use arguments::Command;

/// Exit code of a command that failed.
const FAILED: u8 = 1;
/// Exit code of a command that was interrupted: 128 and the number of SIGINT, as shells have it.
const INTERRUPTED: u8 = 130;
/// Exit code of a command whose time was over: what sysexits.h has for a failure that another try may mend.
const OUT_OF_TIME: u8 = 75;

/// Runs a subcommand.
///
/// # Errors
/// Whatever stopped it; [`Fault::Cancelled`] after an interrupt.
pub fn run(arguments: &Arguments) -> Result<()> {
    if let Some(name) = Level::refused() {
        let known: Vec<_> = Level::available().map(Level::name).collect();
        let known = known.join(", ");
        terminal::report(&format!(
            "warning: {VARIABLE}: this processor has no `{name}`, but {known}; the last of them is used"
        ));
    }
    match &arguments.command {
        Command::Render(arguments) => render::run(arguments),
        Command::Build(arguments) => build::run(arguments),
        Command::Merge(arguments) => job::merge(arguments),
        Command::Info(arguments) => info::run(arguments),
        Command::Diff(arguments) => diff::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Query(arguments) => query::run(arguments),
        Command::Explain(arguments) => explain::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Bench(arguments) => bench::run(arguments),
        Command::Edit(arguments) => edit::run(arguments),
        Command::Completions { shell } => completions::run(*shell),
    }
}

/// Reports an error in one line on standard error and says what the process ends with: 0, 1, 75 or 130.
pub fn exit_code(result: Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.fault() == Fault::Cancelled && terminal::was_stopped_by_time() => {
            terminal::report("stopped: the time limit was reached");
            ExitCode::from(OUT_OF_TIME)
        }
        Err(error) if error.fault() == Fault::Cancelled => ExitCode::from(INTERRUPTED),
        Err(error) => {
            terminal::report(&format!("error: {}", one_line(&error)));
            ExitCode::from(FAILED)
        }
    }
}

/// Limits every parallel step to this many threads; 0 is one per processor.
fn use_threads(threads: u32) -> Result<()> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads as usize)
        .build_global()
        .map_err(|error| Error::limit(format!("{threads} threads cannot be started: {error}")).remedy("ask for fewer"))
}

/// The error's text on one line, whatever a parser put into its message.
fn one_line(error: &Error) -> String {
    error.to_string().lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_of_several_lines_is_reported_on_one() {
        let error = Error::file("expected a value\n  found `]`").remedy("give one");
        assert_eq!(one_line(&error), "expected a value found `]`; give one");
    }
}
