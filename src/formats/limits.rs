//! How much a file may ask for: a small one must not take all memory or time.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Limits of what is read, each with a default that honest files do not reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Limits {
    /// Bytes of a model, a material library, a buffer or an image as a file.
    pub file_bytes: u64,
    /// Vertices of all meshes together.
    pub vertices: u64,
    /// Texels of an image, of 4 bytes each once decoded; larger ones count as several.
    pub texels: u64,
    /// Nodes above a node.
    pub depth: u64,
    /// Bytes of a data URI, decoded.
    pub data_uri_bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 64 << 30,
            vertices: u64::from(u32::MAX) - 1,
            texels: 1 << 29,
            depth: 1 << 20,
            data_uri_bytes: 1 << 30,
        }
    }
}

impl Limits {
    /// The limits by name, as the command line has them.
    pub fn by_name(&mut self) -> [(&'static str, &mut u64); 5] {
        [
            ("file-bytes", &mut self.file_bytes),
            ("vertices", &mut self.vertices),
            ("texels", &mut self.texels),
            ("depth", &mut self.depth),
            ("data-uri-bytes", &mut self.data_uri_bytes),
        ]
    }

    /// Refuses a file of so many bytes.
    ///
    /// # Errors
    /// A limit.
    pub fn check_file_bytes(&self, bytes: u64) -> Result<()> {
        check("file-bytes", self.file_bytes, bytes, || format!("the file has {bytes} bytes"))
    }

    /// Refuses so many vertices in all meshes.
    ///
    /// # Errors
    /// A limit.
    pub fn check_vertices(&self, vertices: u64) -> Result<()> {
        check("vertices", self.vertices, vertices, || format!("the meshes have {vertices} vertices or more"))
    }

    /// Refuses an image of so many texels that takes so many bytes once decoded.
    ///
    /// # Errors
    /// A limit.
    pub fn check_texels(&self, width: u64, height: u64, bytes: u64) -> Result<()> {
        let texels = width.saturating_mul(height).max(bytes.div_ceil(Self::BYTES_PER_TEXEL));
        check("texels", self.texels, texels, || format!("the image has {width}x{height} texels in {bytes} bytes"))
    }

    /// Bytes of a texel by which images are counted.
    pub const BYTES_PER_TEXEL: u64 = 4;

    /// Refuses a node below so many others.
    ///
    /// # Errors
    /// A limit.
    pub fn check_depth(&self, depth: u64) -> Result<()> {
        check("depth", self.depth, depth, || format!("a node has {depth} nodes above it"))
    }

    /// Refuses a data URI of so many bytes once decoded.
    ///
    /// # Errors
    /// A limit.
    pub fn check_data_uri_bytes(&self, bytes: u64) -> Result<()> {
        check("data-uri-bytes", self.data_uri_bytes, bytes, || format!("the data URI has {bytes} bytes"))
    }

    /// Reads a whole file whose size is within the limit. The size is asked for first, and what a file or device has beyond
    /// it is not read.
    ///
    /// # Errors
    /// A limit, or the system's, both with the path.
    pub fn read_file(&self, path: &Path) -> Result<Vec<u8>> {
        let system = |cause| Error::system(path, cause);
        let file = File::open(path).map_err(system)?;
        let size = file.metadata().map_err(system)?.len();
        self.check_file_bytes(size).map_err(|error| error.at_path(path))?;
        let mut bytes = Vec::new();
        let no_memory = |_| Error::limit(format!("not enough memory for {size} bytes")).at_path(path);
        bytes.try_reserve_exact(usize::try_from(size).unwrap_or(usize::MAX)).map_err(no_memory)?;
        file.take(self.file_bytes.saturating_add(1)).read_to_end(&mut bytes).map_err(system)?;
        self.check_file_bytes(bytes.len() as u64).map_err(|error| error.at_path(path))?;
        Ok(bytes)
    }
}

/// Refuses what is beyond a limit, and says how it is raised.
fn check(name: &str, limit: u64, wanted: u64, what: impl FnOnce() -> String) -> Result<()> {
    if wanted <= limit {
        return Ok(());
    }
    Err(Error::limit(format!("{}, and the limit of {name} is {limit}", what()))
        .remedy(format!("raise it with `--limit {name}={}`", rounded_up(wanted))))
}

/// A number that is at least `wanted`, as short as the command line takes it: with units of 1024 each.
fn rounded_up(wanted: u64) -> String {
    let units = [(40, "T"), (30, "G"), (20, "M"), (10, "k")];
    match units.into_iter().find(|(shift, _)| wanted >> shift > 0) {
        Some((shift, unit)) => format!("{}{unit}", wanted.div_ceil(1 << shift)),
        None => wanted.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Fault;

    #[test]
    fn a_limit_says_its_name_and_the_flag_that_raises_it() {
        let limits = Limits { texels: 100, ..Limits::default() };
        assert!(limits.check_texels(10, 10, 400).is_ok());
        let error = limits.check_texels(101, 1, 0).unwrap_err();
        assert_eq!(error.fault(), Fault::Limit);
        let expected = "the image has 101x1 texels in 0 bytes, and the limit of texels is 100; \
                        raise it with `--limit texels=101`";
        assert_eq!(error.to_string(), expected);
        assert!(limits.check_texels(10, 10, 401).is_err(), "101 texels' worth of bytes");
        assert!(limits.check_texels(u64::MAX, u64::MAX, u64::MAX).unwrap_err().to_string().ends_with("T`"));
    }

    #[test]
    fn remedies_suffice() {
        for (wanted, text) in [(7, "7"), (1024, "1k"), (1025, "2k"), ((2 << 30) - 1, "2G"), (2 << 30, "2G")] {
            assert_eq!(rounded_up(wanted), text);
        }
    }

    #[test]
    fn files_beyond_the_limit_are_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "12345").unwrap();
        let read = |file_bytes| Limits { file_bytes, ..Limits::default() }.read_file(&path);
        assert_eq!(read(5).unwrap(), b"12345");
        let error = read(4).unwrap_err();
        assert_eq!((error.fault(), error.path()), (Fault::Limit, Some(path.as_path())));
        assert!(error.to_string().ends_with("raise it with `--limit file-bytes=5`"), "{error}");
    }

    /// A device says that it has no bytes and never ends.
    #[cfg(target_os = "linux")]
    #[test]
    fn files_that_do_not_end_are_a_limit() {
        let limits = Limits { file_bytes: 4096, ..Limits::default() };
        assert_eq!(limits.read_file(Path::new("/dev/zero")).unwrap_err().fault(), Fault::Limit);
    }
}
