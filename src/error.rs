//! One error type, sorted by whose fault it is.
//!
//! Every error a user can meet is one line: where it is (path, line, column), what is wrong, and what to do about it.
//! A miss is `None`, never an error; a panic is a broken invariant of ours.

use std::fmt;
use std::path::{Path, PathBuf};

/// Shorthand for results of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Whose fault an [`Error`] is, and so who can mend it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fault {
    /// The file is malformed or refers to something that is not there.
    File,
    /// The caller (command line or library user) asked for something impossible.
    Caller,
    /// A limit of this program or of the machine was reached.
    Limit,
    /// The input is valid but uses something this program does not do.
    Unsupported,
    /// The operating system refused (permissions, a full disk, a broken pipe).
    System,
    /// The work was cancelled on request; nothing is wrong.
    Cancelled,
}

/// What went wrong, where, and what would mend it.
///
/// [`fmt::Display`] writes one line: `path:line:column: message; remedy`. Parts that are not known are left out.
#[derive(Clone, thiserror::Error)]
pub struct Error {
    fault: Fault,
    message: String,
    path: Option<PathBuf>,
    /// 1-based line and, where known, 1-based column.
    position: Option<(usize, Option<usize>)>,
    remedy: Option<String>,
}

impl Error {
    /// An error of the given fault; prefer the named constructors.
    pub fn new(fault: Fault, message: impl Into<String>) -> Self {
        Self { fault, message: message.into(), path: None, position: None, remedy: None }
    }

    /// The file is at fault.
    pub fn file(message: impl Into<String>) -> Self {
        Self::new(Fault::File, message)
    }

    /// The caller is at fault.
    pub fn caller(message: impl Into<String>) -> Self {
        Self::new(Fault::Caller, message)
    }

    /// A limit was reached.
    pub fn limit(message: impl Into<String>) -> Self {
        Self::new(Fault::Limit, message)
    }

    /// Valid input that this program does not handle.
    pub fn unsupported(message: impl Into<String>) -> Self {
        Self::new(Fault::Unsupported, message)
    }

    /// The operating system refused an operation on `path`.
    pub fn system(path: &Path, cause: std::io::Error) -> Self {
        Self::new(Fault::System, cause.to_string()).at_path(path)
    }

    /// The work was cancelled on request.
    pub fn cancelled() -> Self {
        Self::new(Fault::Cancelled, "cancelled")
    }

    /// Names the file; a path that is already set stays, so the innermost reader wins.
    pub fn at_path(mut self, path: &Path) -> Self {
        self.path.get_or_insert_with(|| path.to_path_buf());
        self
    }

    /// Puts a place within the file before the message: `accessors[3]: message`.
    pub fn within(mut self, place: impl fmt::Display) -> Self {
        self.message = format!("{place}: {}", self.message);
        self
    }

    /// Names the 1-based line.
    pub fn at_line(mut self, line: usize) -> Self {
        self.position.get_or_insert((line, None));
        self
    }

    /// Names the 1-based line and column.
    pub fn at_line_column(mut self, line: usize, column: usize) -> Self {
        self.position.get_or_insert((line, Some(column)));
        self
    }

    /// Says what would mend it.
    pub fn remedy(mut self, remedy: impl Into<String>) -> Self {
        self.remedy.get_or_insert_with(|| remedy.into());
        self
    }

    /// Whose fault it is.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// The file concerned, if any.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The message alone, without place and remedy.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The 1-based line, if known.
    pub fn line(&self) -> Option<usize> {
        self.position.map(|(line, _)| line)
    }

    /// The 1-based column, if known.
    pub fn column(&self) -> Option<usize> {
        self.position.and_then(|(_, column)| column)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(path) = &self.path {
            write!(f, "{}:", path.display())?;
        }
        if let Some((line, column)) = self.position {
            write!(f, "{line}:")?;
            if let Some(column) = column {
                write!(f, "{column}:")?;
            }
        }
        if self.path.is_some() || self.position.is_some() {
            f.write_str(" ")?;
        }
        f.write_str(&self.message)?;
        if let Some(remedy) = &self.remedy {
            write!(f, "; {remedy}")?;
        }
        Ok(())
    }
}

/// As [`fmt::Display`], so that a program whose `main` returns this error prints the one line.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_is_one_line_with_place_and_remedy() {
        let error = Error::file("unknown key `colour`")
            .at_path(Path::new("a.toml"))
            .at_line_column(3, 5)
            .remedy("accepted keys are `color`, `kind`");
        assert_eq!(error.to_string(), "a.toml:3:5: unknown key `colour`; accepted keys are `color`, `kind`");
    }

    #[test]
    fn the_innermost_place_wins() {
        let error = Error::file("x").at_path(Path::new("inner")).at_line(2).at_path(Path::new("outer")).at_line(9);
        assert_eq!(error.to_string(), "inner:2: x");
    }
}
