//! What a model may read beside itself: files in its own folder, of limited size.

use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};
use crate::formats::{Limits, LoadOptions};

/// The folder of a model, and what is read from it. A model that came from elsewhere must not make a program read, or tell of,
/// what is none of its business.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Surroundings {
    /// Where relative names start from; empty for the current folder.
    pub folder: PathBuf,
    /// Whether files outside the folder are read.
    pub allow_external: bool,
    /// How much the model may ask for.
    pub limits: Limits,
}

impl Surroundings {
    /// Those of a model in a folder.
    pub fn new(folder: &Path, options: &LoadOptions) -> Self {
        Self { folder: folder.to_owned(), allow_external: options.allow_external, limits: options.limits }
    }

    /// Those of the model at `path`.
    pub fn of(path: &Path, options: &LoadOptions) -> Self {
        Self::new(path.parent().unwrap_or(Path::new("")), options)
    }

    /// Whether a file, named from the current folder, may be read: by its name, without looking at the disk, so that links
    /// in the folder may lead anywhere.
    pub fn admits(&self, path: &Path) -> bool {
        if self.allow_external {
            return true;
        }
        match (plain(&self.folder), plain(path)) {
            (Some(folder), Some(path)) => path.starts_with(folder),
            _ => false,
        }
    }

    /// Fails for a file that must not be read; `name` is what the model calls it.
    ///
    /// # Errors
    /// A file's error.
    pub fn check(&self, path: &Path, name: &str) -> Result<()> {
        if self.admits(path) {
            return Ok(());
        }
        Err(Error::file(format!("`{name}` {OUTSIDE}")).remedy("keep the files of a model together"))
    }
}

/// What is wrong with a file that is not [admitted](Surroundings::admits).
pub const OUTSIDE: &str = "lies outside the model's folder and is not read without --allow-external";

/// The absolute path without `.` and `..`; `None` where the current folder is not known.
fn plain(path: &Path) -> Option<PathBuf> {
    // An empty path has no absolute form.
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut plain = PathBuf::new();
    for component in std::path::absolute(path).ok()?.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            component => plain.push(component),
        }
    }
    Some(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn admits(folder: &str, path: &str) -> bool {
        Surroundings::new(Path::new(folder), &LoadOptions::default()).admits(Path::new(path))
    }

    #[test]
    fn names_must_not_lead_out_of_the_folder() {
        for folder in ["", ".", "a", "a/../a", "../a", "/a/b"] {
            let inside = |name: &str| admits(folder, Path::new(folder).join(name).to_str().unwrap());
            for name in ["x", "./x", "b/x", "b/../x", "b/c/../../x"] {
                assert!(inside(name), "{folder}: {name}");
            }
            for name in ["../x", "b/../../x", "..", "/etc/passwd", "/", "../../../../../../../../../../x"] {
                assert!(!inside(name), "{folder}: {name}");
            }
        }
        assert!(!admits("/a/b", "/a/bc/x"), "a name that only begins alike");
        assert!(admits("/a/b", "/a/b/c.png"), "an absolute name that leads into the folder");
    }

    #[test]
    fn external_files_may_be_allowed() {
        let options = LoadOptions { allow_external: true, ..Default::default() };
        assert!(Surroundings::new(Path::new("a"), &options).admits(Path::new("/x")));
        let error = Surroundings::default().check(Path::new("../x"), "../x").unwrap_err();
        assert!(error.to_string().contains("`../x` lies outside") && error.to_string().contains("--allow-external"));
    }
}
