//! How much a file may ask for: a small one must not take all memory or time.

/// Limits of what is read, each with a default that honest files do not reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a model, a buffer or an image as a file.
    pub file_bytes: u64,
    /// Vertices of all meshes together.
    pub vertices: u64,
    /// Texels of an image.
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
}
