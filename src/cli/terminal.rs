//! What meets the user: standard output and error, the progress bar, and Ctrl-C.

use std::borrow::Cow;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use crate::error::{Error, Result};
use crate::progress::Progress;

/// Whether Ctrl-C was pressed.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// When the work is to stop.
static DEADLINE: OnceLock<Instant> = OnceLock::new();

/// Lets the work stop after a time from now.
pub fn set_time_limit(limit: Duration) {
    let _ = DEADLINE.set(Instant::now() + limit);
}

/// Whether the time is over.
pub fn is_out_of_time() -> bool {
    DEADLINE.get().is_some_and(|deadline| Instant::now() >= *deadline)
}

/// Whether it was the time that stopped the work, not Ctrl-C.
pub fn was_stopped_by_time() -> bool {
    !INTERRUPTED.load(Ordering::Relaxed) && is_out_of_time()
}

/// Writes a result to standard output. A reader that went away wanted no more, which is no error.
///
/// # Errors
/// When the operating system refuses for another reason, such as a full disk.
pub fn print(bytes: &[u8]) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::system(Path::new("standard output"), error))
        }
        _ => Ok(()),
    }
}

/// Writes a line to standard error; nothing can be done where that is closed.
pub fn report(line: &str) {
    let _ = writeln!(io::stderr(), "{}", printable(line));
}

/// The text with control characters escaped: names from files must not end a line or steer the terminal.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let escape = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    Cow::Owned(text.chars().map(escape).collect())
}

/// Shows how far the work is on standard error, where that is a terminal, and stops the work after Ctrl-C.
///
/// The first Ctrl-C asks the work to stop; the second ends the process at once.
#[derive(Debug)]
pub struct Terminal {
    bar: ProgressBar,
}

impl Terminal {
    /// Takes over Ctrl-C. `quiet` shows no bar.
    ///
    /// # Errors
    /// When the operating system refuses the handler.
    pub fn new(quiet: bool) -> Result<Self> {
        ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(i32::from(super::INTERRUPTED));
            }
        })
        .map_err(|error| Error::caller(format!("Ctrl-C cannot be handled: {error}")))?;
        let shown = !quiet && io::stderr().is_terminal();
        Ok(Self { bar: if shown { ProgressBar::no_length() } else { ProgressBar::hidden() } })
    }

    /// Takes the bar off the terminal, so that lines can be printed.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &'static str, total: u64) {
        let template = if total == 0 { "{prefix:8} {elapsed}" } else { "{prefix:8} {wide_bar} {percent:>3} %{left}" };
        let style = ProgressStyle::with_template(template).expect("the templates are valid");
        self.bar.reset();
        self.bar.set_style(style.with_key("left", write_time_left));
        self.bar.set_prefix(stage);
        if total == 0 {
            self.bar.unset_length();
        } else {
            self.bar.set_length(total);
        }
        self.bar.tick();
    }

    fn advance(&self, steps: u64) {
        self.bar.inc(steps);
    }

    fn is_cancelled(&self) -> bool {
        INTERRUPTED.load(Ordering::Relaxed) || is_out_of_time()
    }
}

/// The time left, once there is a pace to tell it from.
fn write_time_left(state: &ProgressState, out: &mut dyn std::fmt::Write) {
    if state.pos() > 0 {
        // A bar has nowhere to report an error to.
        let _ = write!(out, ", {:#} left", HumanDuration(state.eta()));
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_steer_the_terminal() {
        assert_eq!(printable("Böden 2"), "Böden 2");
        assert_eq!(printable("a\x1b[2Jb\nc"), "a\\u{1b}[2Jb\\nc");
    }
}
