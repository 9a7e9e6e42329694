//! What the editor remembers between runs: recent files, the theme, and scenes that were not saved when it ended.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use etcetera::app_strategy::{AppStrategy as _, AppStrategyArgs, choose_native_strategy};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::formats::atomic_file::write_atomically;

/// So many recent files are remembered.
const MOST_RECENT: usize = 10;

/// What is remembered.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Settings {
    /// The latest first.
    pub recent: Vec<PathBuf>,
    /// Whether the window is light.
    pub is_light: bool,
    /// Where it is kept; nowhere for tests.
    #[serde(skip)]
    folder: Option<PathBuf>,
}

/// A scene that was being edited when the editor ended without saving it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unsaved {
    /// The file that it was of.
    pub path: Option<PathBuf>,
    /// Where its relative paths start.
    pub place: PathBuf,
    /// The scene file's text.
    pub text: String,
}

/// A file that is locked while an editor runs.
#[derive(Debug)]
pub struct Claim {
    _file: File,
    path: PathBuf,
}

impl Drop for Claim {
    fn drop(&mut self) {
        // If it stays, it is not locked any more.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Settings {
    /// Those of the user, or new ones where they cannot be read.
    pub fn load() -> Self {
        let names = AppStrategyArgs { app_name: "whitted".into(), ..AppStrategyArgs::default() };
        Self::load_from(choose_native_strategy(names).ok().map(|strategy| strategy.data_dir()))
    }

    /// Those kept in a folder.
    pub fn load_from(folder: Option<PathBuf>) -> Self {
        let text = folder.as_ref().and_then(|folder| std::fs::read_to_string(folder.join("editor.toml")).ok());
        let read: Option<Self> = text.and_then(|text| toml::from_str(&text).ok());
        Self { folder, ..read.unwrap_or_default() }
    }

    /// Remembers a file as the latest.
    pub fn note(&mut self, path: &Path) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
        self.recent.retain(|known| *known != path);
        self.recent.insert(0, path);
        self.recent.truncate(MOST_RECENT);
        self.save();
    }

    /// Writes them. What cannot be written is forgotten: it is of no importance.
    pub fn save(&self) {
        if let (Some(folder), Ok(text)) = (&self.folder, toml::to_string(self)) {
            let _ = write(folder, "editor.toml", &text);
        }
    }

    /// Tells other editors, until it is dropped, that this one runs and comes back for what it keeps.
    pub fn claim(&self) -> Option<Claim> {
        let folder = self.folder.as_ref()?;
        std::fs::create_dir_all(folder).ok()?;
        let path = folder.join(lock_of(std::process::id()));
        let file = File::create(&path).ok()?;
        file.try_lock().ok()?;
        Some(Claim { _file: file, path })
    }

    /// Keeps a scene that is not saved, in case the editor ends.
    ///
    /// # Errors
    /// The system's.
    pub fn keep(&self, unsaved: &Unsaved) -> Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let text = toml::to_string(unsaved).map_err(|cause| Error::caller(cause.to_string()))?;
        write(folder, &self.name(), &text)
    }

    /// The scene is saved, or not wanted.
    pub fn forget_unsaved(&self) {
        if let Some(folder) = &self.folder {
            let _ = std::fs::remove_file(folder.join(self.name()));
        }
    }

    /// Each running editor keeps its own.
    fn name(&self) -> String {
        format!("unsaved-{}.toml", std::process::id())
    }

    /// The scene that an editor left that no longer runs; it is taken over.
    pub fn take_left_over(&self) -> Option<Unsaved> {
        let folder = self.folder.as_ref()?;
        for entry in std::fs::read_dir(folder).ok()?.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let process = name.strip_prefix("unsaved-").and_then(|rest| rest.strip_suffix(".toml"));
            let Some(Ok(process)) = process.map(str::parse::<u32>) else { continue };
            if is_running(folder, process) {
                continue;
            }
            let _ = std::fs::remove_file(folder.join(lock_of(process)));
            let text = std::fs::read_to_string(entry.path()).ok();
            let unsaved = text.and_then(|text| toml::from_str(&text).ok());
            let _ = std::fs::remove_file(entry.path());
            if unsaved.is_some() {
                return unsaved;
            }
        }
        None
    }
}

/// The name of the file that an editor keeps locked as long as it runs.
fn lock_of(process: u32) -> String {
    format!("running-{process}.lock")
}

fn is_running(folder: &Path, process: u32) -> bool {
    let lock = File::open(folder.join(lock_of(process)));
    lock.is_ok_and(|lock| matches!(lock.try_lock(), Err(TryLockError::WouldBlock)))
}

fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|cause| Error::system(folder, cause))?;
    let path = folder.join(name);
    write_atomically(&path, |sink| sink.write_all(text.as_bytes()).map_err(|cause| Error::system(&path, cause)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recent_files_and_unsaved_scenes_are_found_again() {
        let folder = tempfile::tempdir().unwrap();
        let at = Some(folder.path().join("deeper"));
        let mut settings = Settings::load_from(at.clone());
        for number in 0..12 {
            settings.note(&folder.path().join(format!("{number}.toml")));
        }
        settings.note(&folder.path().join("5.toml"));
        let again = Settings::load_from(at.clone());
        assert_eq!(again, settings);
        assert_eq!((again.recent.len(), again.recent[0].file_name().unwrap()), (10, "5.toml".as_ref()));

        let unsaved = Unsaved { path: None, place: "a.toml".into(), text: "ambient = 0.5 # \"\"\"\n".into() };
        let claim = settings.claim();
        assert!(claim.is_some());
        settings.keep(&unsaved).unwrap();
        assert_eq!(settings.take_left_over(), None, "this editor still runs");
        drop(claim);
        assert_eq!(settings.take_left_over(), Some(unsaved));
        assert_eq!(settings.take_left_over(), None);
    }
}
