//! `whitted edit`.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::arguments::LoadArguments;
use crate::error::Result;

/// Flags of `edit`.
#[derive(Debug, Args)]
pub struct EditArguments {
    /// Scene file or model; without it a new scene.
    #[arg(value_hint = ValueHint::FilePath)]
    pub input: Option<PathBuf>,

    /// How the input is read.
    #[command(flatten)]
    pub load: LoadArguments,
}

/// Opens the editor's window.
///
/// # Errors
/// Those of reading the input, and where no window can be opened.
#[cfg(feature = "editor")]
pub fn run(arguments: &EditArguments) -> Result<()> {
    crate::editor::window::run(arguments.input.as_deref(), &arguments.load.options())
}

/// Says how to get the editor.
///
/// # Errors
/// Always.
#[cfg(not(feature = "editor"))]
pub fn run(_: &EditArguments) -> Result<()> {
    use crate::error::Error;
    Err(Error::unsupported("this build has no editor")
        .remedy("build it with `cargo build --release --features editor`"))
}
