//! How large a scene will be in memory, told from little of its files: before it is read.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::formats::{Format, LoadOptions, format_of, gltf};

/// So many pieces of a text file are looked at.
const PIECES: u64 = 64;

/// Bytes of each.
const PIECE: u64 = 1 << 16;

/// The numbers on which memory depends.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outline {
    /// Triangles of each mesh.
    pub triangles: Vec<usize>,
    /// Bytes of vertices and indices.
    pub geometry_bytes: u64,
}

impl Outline {
    /// The outline of a scene or a model. Of glTF the counts in its JSON are taken, of OBJ a sample of its lines; images are not looked at.
    ///
    /// # Errors
    /// A file that is not there, cannot be read, or is malformed where it is looked at.
    pub fn of(path: &Path, options: &LoadOptions) -> Result<Self> {
        match format_of(path)? {
            Format::Obj => Self::of_obj(path),
            Format::Gltf => gltf::outline(path, options),
            Format::Built => Err(crate::error::Error::unsupported("a built scene has no outline").at_path(path)),
            Format::Scene => {
                let mut all = Self::default();
                for model in models_of(path) {
                    // What is wrong with one is told when it is read, with the line that names it.
                    let Ok(own) = Self::of(&model, options) else { continue };
                    all.triangles.extend(own.triangles);
                    all.geometry_bytes += own.geometry_bytes;
                }
                Ok(all)
            }
        }
    }

    /// Adds a mesh of so many triangles and vertices, which take so many bytes each.
    pub fn add(&mut self, triangles: u64, vertices: u64, bytes_a_vertex: u64) {
        self.triangles.push(triangles as usize);
        self.geometry_bytes = self
            .geometry_bytes
            .saturating_add(triangles.saturating_mul(size_of::<[u32; 3]>() as u64))
            .saturating_add(vertices.saturating_mul(bytes_a_vertex));
    }

    fn of_obj(path: &Path) -> Result<Self> {
        let system = |cause| crate::error::Error::system(path, cause);
        let mut file = File::open(path).map_err(system)?;
        let size = file.metadata().map_err(system)?.len();
        let mut seen = Lines::default();
        let mut piece = Vec::new();
        let pieces = if size <= PIECES * PIECE { size.div_ceil(PIECE) } else { PIECES };
        for number in 0..pieces {
            let start = (u128::from(size) * u128::from(number) / u128::from(pieces)) as u64;
            piece.clear();
            file.seek(SeekFrom::Start(start)).map_err(system)?;
            (&mut file).take(PIECE.min(size.div_ceil(pieces.max(1)))).read_to_end(&mut piece).map_err(system)?;
            seen.look(&piece);
        }
        let share = size as f64 / (seen.bytes as f64).max(1.0);
        let all = |count: u64| (count as f64 * share) as u64;
        let mut outline = Self::default();
        let vertices = all(seen.positions.max(seen.normals).max(seen.uvs));
        let bytes = 12 + if seen.normals > 0 { 12 } else { 0 } + if seen.uvs > 0 { 8 } else { 0 };
        outline.add(all(seen.triangles), vertices, bytes);
        Ok(outline)
    }
}

/// What lines of an OBJ file are.
#[derive(Default)]
struct Lines {
    bytes: u64,
    positions: u64,
    normals: u64,
    uvs: u64,
    triangles: u64,
}

impl Lines {
    /// Counts the lines of a piece; the first and the last one may be cut.
    fn look(&mut self, piece: &[u8]) {
        self.bytes += piece.len() as u64;
        for line in piece.split(|&byte| byte == b'\n') {
            let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
            match words.next() {
                Some(b"v") => self.positions += 1,
                Some(b"vn") => self.normals += 1,
                Some(b"vt") => self.uvs += 1,
                Some(b"f") => self.triangles += (words.count() as u64).saturating_sub(2),
                _ => {}
            }
        }
    }
}

/// The models that a scene file names; none if it cannot be read.
fn models_of(path: &Path) -> BTreeSet<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let table: toml::Table = text.parse().unwrap_or_default();
    let objects = table.get("object").and_then(toml::Value::as_array).into_iter().flatten();
    let models = objects.filter_map(|object| object.get("mesh")?.as_str());
    models.map(|model| folder.join(model)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats;
    use crate::progress::Silent;

    /// A wavy sheet of `side` x `side` squares as an OBJ file.
    fn sheet(side: usize) -> String {
        let mut text = String::new();
        for at in 0..(side + 1) * (side + 1) {
            let (x, z) = (at % (side + 1), at / (side + 1));
            text += &format!("v {} {} {}\n", x as f64 * 0.37, (x * z % 7) as f64 * 0.1, z);
        }
        for at in 0..side * side {
            let a = at / side * (side + 1) + at % side + 1;
            text += &format!("f {} {} {} {}\n", a, a + 1, a + side + 2, a + side + 1);
        }
        text
    }

    #[test]
    fn outlines_are_near_what_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let options = LoadOptions::default();
        for side in [10, 600] {
            let path = folder.path().join("sheet.obj");
            std::fs::write(&path, sheet(side)).unwrap();
            std::fs::write(folder.path().join("s.toml"), "[[object]]\nmesh = \"sheet.obj\"\n").unwrap();
            let scene = formats::open(&path, &options, &Silent).unwrap().scene;
            let (triangles, bytes) = (scene.meshes[0].triangle_count() as f64, scene.meshes[0].bytes() as f64);
            for name in ["sheet.obj", "s.toml"] {
                let outline = Outline::of(&folder.path().join(name), &options).unwrap();
                let near =
                    |estimate: f64, truth: f64| assert!((estimate / truth - 1.0).abs() < 0.1, "{estimate} {truth}");
                assert_eq!(outline.triangles.len(), 1);
                near(outline.triangles[0] as f64, triangles);
                near(outline.geometry_bytes as f64, bytes);
            }
        }
        let glb = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes");
        for path in std::fs::read_dir(glb).unwrap().map(|entry| entry.unwrap().path()) {
            if !path.extension().is_some_and(|suffix| suffix == "glb" || suffix == "gltf") {
                continue;
            }
            let scene = formats::open(&path, &options, &Silent).unwrap().scene;
            let outline = Outline::of(&path, &options).unwrap();
            let all = scene.meshes.iter().map(|mesh| mesh.triangle_count()).sum::<usize>();
            assert_eq!(outline.triangles.iter().sum::<usize>(), all, "{}", path.display());
        }
        assert!(Outline::of(&folder.path().join("none.obj"), &options).is_err());
    }
}
