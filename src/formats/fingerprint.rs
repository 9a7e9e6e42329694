//! What tells one scene from another: the content of its files.

use std::fmt;
use std::path::Path;

use crate::error::{Error, Result};

/// A BLAKE3 hash of the names and contents of some files, whatever folder they are in.
#[derive(Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Fingerprint([u8; 32]);

impl Fingerprint {
    /// That of the files that were read for a scene, of which `input` is the one that names the others. Their order does not
    /// count, and of a file's path only its own name does: a copy elsewhere is the same scene.
    ///
    /// # Errors
    /// The system's, with the path of a file that cannot be read.
    pub fn of_files<'a>(input: &Path, files: impl IntoIterator<Item = &'a Path>) -> Result<Self> {
        let others = files.into_iter().filter(|path| *path != input);
        let others = others.map(|path| Ok((path, content(path)?))).collect::<Result<Vec<_>>>()?;
        Ok(Self::of_contents(content(input)?, others))
    }

    /// The same where the contents' hashes are known: that of the input, and of the others with their paths.
    pub fn of_contents<'a>(input: [u8; 32], others: impl IntoIterator<Item = (&'a Path, [u8; 32])>) -> Self {
        let mut parts: Vec<_> = others.into_iter().map(|(path, content)| (own_name(path), content)).collect();
        parts.sort_unstable();
        parts.dedup();
        let mut all = blake3::Hasher::new();
        all.update(&input);
        for (name, content) in parts {
            all.update(&(name.len() as u64).to_le_bytes());
            all.update(name.as_bytes());
            all.update(&content);
        }
        Self(*all.finalize().as_bytes())
    }
}

fn own_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The BLAKE3 of a file's content, found by all threads.
///
/// # Errors
/// The system's, with the path.
pub fn content(path: &Path) -> Result<[u8; 32]> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_mmap_rayon(path).map_err(|cause| Error::system(path, cause))?;
    Ok(*hasher.finalize().as_bytes())
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl From<Fingerprint> for String {
    fn from(fingerprint: Fingerprint) -> Self {
        fingerprint.to_string()
    }
}

impl TryFrom<String> for Fingerprint {
    type Error = &'static str;

    fn try_from(text: String) -> std::result::Result<Self, Self::Error> {
        blake3::Hash::from_hex(text).map(|hash| Self(*hash.as_bytes())).map_err(|_| "a fingerprint is 64 digits")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_and_names_count_and_folders_do_not() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let write = |folder: usize, name: &str, content: &str| {
            let path = folders[folder].path().join(name);
            std::fs::write(&path, content).unwrap();
            path
        };
        let (scene, a, b) = (write(0, "s.toml", "scene"), write(0, "a.png", "one"), write(0, "b.png", "two"));
        let of = |files: &[&Path]| Fingerprint::of_files(files[0], files.iter().copied()).unwrap();
        let first = of(&[&scene, &a, &b]);
        assert_eq!(first, of(&[&scene, &b, &a, &a]));
        assert_eq!(String::from(first).parse::<String>().map(Fingerprint::try_from).unwrap(), Ok(first));
        let copies = (write(1, "s.toml", "scene"), write(1, "a.png", "one"), write(1, "b.png", "two"));
        assert_eq!(first, of(&[&copies.0, &copies.1, &copies.2]));
        assert_ne!(first, of(&[&copies.1, &copies.0, &copies.2]), "another input");
        write(1, "a.png", "two");
        write(1, "b.png", "one");
        assert_ne!(first, of(&[&copies.0, &copies.1, &copies.2]), "images changed places");
        let missing = folders[0].path().join("none");
        assert_eq!(Fingerprint::of_files(&missing, []).unwrap_err().path(), Some(missing.as_path()));
    }
}
