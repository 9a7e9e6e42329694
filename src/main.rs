//! The program `whitted`: parse, run, exit code.

use std::process::ExitCode;

use clap::Parser;
use whitted::cli::{self, Arguments};

fn main() -> ExitCode {
    // Wrong usage ends here, with exit code 2.
    let arguments = Arguments::parse();
    cli::exit_code(cli::run(&arguments))
}
