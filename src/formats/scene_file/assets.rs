//! Images and models that scene files refer to, kept so that a scene that changes is read again without reading them again.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::error::Result;
use crate::formats::image_file::read_texture;
use crate::formats::model::Imported;
use crate::formats::{Limits, LoadOptions, load_model, obj};
use crate::progress::Progress;
use crate::scene::Texture;

/// What has been read of other files. A file that changed since is read again.
#[derive(Default)]
pub struct Assets {
    images: HashMap<PathBuf, Kept<Texture>>,
    models: Vec<((PathBuf, LoadOptions), Kept<Imported>)>,
    /// Counts the readings of scene files: in each, a file is looked at once.
    reading: u64,
}

/// A thing, and the files that it was read from as they were.
struct Kept<T> {
    thing: T,
    files: Vec<(PathBuf, Stamp)>,
    looked_at: u64,
}

/// What tells that a file has changed: its length and time, where it is there.
type Stamp = Option<(u64, Option<SystemTime>)>;

fn stamps<'a>(files: impl IntoIterator<Item = &'a Path>) -> Vec<(PathBuf, Stamp)> {
    files.into_iter().map(|path| (path.to_path_buf(), stamp(path))).collect()
}

fn stamp(path: &Path) -> Stamp {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.len(), metadata.modified().ok()))
}

impl<T> Kept<T> {
    fn new(thing: T, files: Vec<(PathBuf, Stamp)>, reading: u64) -> Self {
        Self { thing, files, looked_at: reading }
    }

    fn is_fresh(&mut self, reading: u64) -> bool {
        if self.looked_at != reading {
            if self.files.iter().any(|(path, before)| stamp(path) != *before) {
                return false;
            }
            self.looked_at = reading;
        }
        true
    }
}

/// Meshes that need no file.
const BUILTIN: [(&str, &[u8]); 4] = [
    ("box", include_bytes!("../../../meshes/box.obj")),
    ("icosphere", include_bytes!("../../../meshes/icosphere.obj")),
    ("torus", include_bytes!("../../../meshes/torus.obj")),
    ("teapot", include_bytes!("../../../meshes/teapot.obj")),
];

/// The names of the meshes that need no file.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTIN.iter().map(|(name, _)| *name)
}

impl Assets {
    /// A scene file is read from its beginning: files may have changed.
    pub(super) fn begin(&mut self) {
        self.reading += 1;
    }

    /// Takes over what was read elsewhere.
    pub fn adopt(&mut self, other: Self) {
        // Files are looked at again at the next reading.
        let unseen = u64::MAX;
        self.images.extend(other.images.into_iter().map(|(key, kept)| (key, Kept { looked_at: unseen, ..kept })));
        for (key, kept) in other.models {
            self.models.retain(|(known, _)| *known != key);
            self.models.push((key, Kept { looked_at: unseen, ..kept }));
        }
    }

    /// An image.
    ///
    /// # Errors
    /// Those of [`read_texture`].
    pub(super) fn image(&mut self, path: &Path, limits: &Limits) -> Result<Texture> {
        let key = identity(path);
        if let Some(kept) = self.images.get_mut(&key)
            && kept.is_fresh(self.reading)
        {
            // As if it was read again, by what it is called now.
            return Ok(Texture { name: path.display().to_string(), ..kept.thing.clone() });
        }
        let texture = read_texture(path, limits)?;
        self.images.insert(key, Kept::new(texture.clone(), stamps([path]), self.reading));
        Ok(texture)
    }

    /// A model file's contents.
    ///
    /// # Errors
    /// Those of [`load_model`].
    pub fn model(&mut self, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<&mut Imported> {
        self.kept_model(identity(path), options, |_| load_model(path, options, progress).map(Imported::new))
    }

    /// A mesh that needs no file, by name; `None` if there is none of that name.
    pub(super) fn builtin(
        &mut self,
        name: &str,
        options: &LoadOptions,
        progress: &dyn Progress,
    ) -> Option<Result<&mut Imported>> {
        let (name, text) = BUILTIN.iter().find(|(known, _)| *known == name)?;
        // No file is called so: a name with a slash at its end.
        let key = PathBuf::from(format!("builtin {name}/"));
        Some(self.kept_model(key, options, |_| {
            let mut model = obj::read(*text, Path::new(name), options, progress)?;
            model.ledger.forget_files();
            Ok(Imported::new(model))
        }))
    }

    fn kept_model(
        &mut self,
        path: PathBuf,
        options: &LoadOptions,
        load: impl FnOnce(&Path) -> Result<Imported>,
    ) -> Result<&mut Imported> {
        let reading = self.reading;
        let known = self.models.iter().position(|((known, how), _)| *known == path && how == options);
        let number = match known {
            Some(number) if self.models[number].1.is_fresh(reading) => number,
            _ => {
                let imported = load(&path)?;
                let files = stamps(imported.ledger.files());
                let kept = Kept::new(imported, files, reading);
                match known {
                    Some(number) => self.models[number].1 = kept,
                    None => self.models.push(((path, options.clone()), kept)),
                }
                known.unwrap_or(self.models.len() - 1)
            }
        };
        Ok(&mut self.models[number].1.thing)
    }
}

/// What tells whether two paths lead to the same file.
pub(super) fn identity(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}
