//! `whitted completions SHELL`.

use clap::CommandFactory;
use clap_complete::Shell;

use super::arguments::Arguments;
use super::terminal;
use crate::error::Result;

/// Prints the completion script of a shell.
pub fn run(shell: Shell) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "whitted", &mut script);
    terminal::print(&script)
}
