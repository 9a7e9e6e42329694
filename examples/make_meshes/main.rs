//! Makes the project's own meshes: every figure in them is computed here, and the same on every machine.
//!
//! ```text
//! cargo run --release --example make_meshes [-- NAME... | --all] [--out FOLDER] [--triangles COUNT]
//! ```
//!
//! Without names it writes those that are kept in `meshes/`; `--all` adds the terrain, which is too large for that.
//! `--triangles` is the terrain's size, one million unless given.

mod cornell_box;
mod gltf;
mod mesh;
mod metal_roughness;
mod obj;
mod patches;
mod picture;
mod solids;
mod teapot;
mod terrain;
mod textured_crate;
#[cfg(test)]
mod topology;

use std::path::PathBuf;
use std::process::ExitCode;

/// A file to write.
pub struct OutputFile {
    /// Within the output folder.
    pub name: &'static str,
    /// All of it.
    pub bytes: Vec<u8>,
}

impl OutputFile {
    /// A file with this content.
    pub fn new(name: &'static str, content: impl Into<Vec<u8>>) -> Self {
        Self { name, bytes: content.into() }
    }
}

/// What can be made: its name, and whether it is kept in `meshes/`.
const MODELS: [(&str, bool); 9] = [
    ("teapot", true),
    ("cornell_box", true),
    ("textured_crate", true),
    ("metal_roughness", true),
    ("checker", true),
    ("icosphere", true),
    ("torus", true),
    ("box", true),
    ("terrain", false),
];

/// Makes one model; `None` if there is none of this name.
fn make(name: &str, terrain_triangles: u32) -> Option<Vec<OutputFile>> {
    let one = |name, text: String| vec![OutputFile::new(name, text)];
    Some(match name {
        "teapot" => {
            let comment = "The Utah teapot (Martin Newell, 1975; bottom by Frank Crow, 1987): 32 Bezier patches,\n\
                           10 x 10 squares each. Stands on y = 0, spout towards +X. Made by the example make_meshes.";
            one("teapot.obj", obj::text(&teapot::mesh(10), comment, None))
        }
        "cornell_box" => {
            let comment = "The Cornell box as measured at Cornell University, in metres. Made by the example make_meshes.\n\
                           The camera of the photographs is at 0.278 0.273 -0.8 and looks along +Z, +Y up.";
            vec![
                OutputFile::new("cornell_box.obj", obj::text(&cornell_box::mesh(), comment, Some("cornell_box.mtl"))),
                OutputFile::new("cornell_box.mtl", cornell_box::MATERIALS),
            ]
        }
        "textured_crate" => textured_crate::files(),
        "metal_roughness" => metal_roughness::files(),
        "checker" => vec![OutputFile::new("checker.png", picture::checker().png())],
        "icosphere" => {
            let comment = "The unit sphere: an icosahedron cut into four twice. Made by the example make_meshes.";
            one("icosphere.obj", obj::text(&solids::icosphere(2), comment, None))
        }
        "torus" => {
            let comment = "A torus around +Y, radii 1 and 0.4. Made by the example make_meshes.";
            one("torus.obj", obj::text(&solids::torus(1.0, 0.4, 32, 16), comment, None))
        }
        "box" => {
            let comment = "The unit cube around the origin. Made by the example make_meshes.";
            one("box.obj", obj::text(&solids::cuboid(), comment, None))
        }
        "terrain" => terrain::files(terrain_triangles),
        _ => return None,
    })
}

/// What the command line asks for.
struct Order {
    names: Vec<String>,
    folder: PathBuf,
    terrain_triangles: u32,
}

impl Order {
    /// Reads the command line.
    fn parse(arguments: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut order = Self { names: Vec::new(), folder: "meshes".into(), terrain_triangles: 1_000_000 };
        let mut arguments = arguments;
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--all" => order.names.extend(MODELS.map(|(name, _)| name.to_string())),
                "--out" => order.folder = arguments.next().ok_or("--out needs a folder")?.into(),
                "--triangles" => {
                    let count = arguments.next().and_then(|count| count.parse().ok());
                    order.terrain_triangles = count.ok_or("--triangles needs a whole number")?;
                }
                name if MODELS.iter().any(|(known, _)| *known == name) => order.names.push(argument),
                other => {
                    let known = MODELS.map(|(name, _)| name).join(", ");
                    return Err(format!("`{other}` is not known; there are --all, --out, --triangles and {known}"));
                }
            }
        }
        if order.names.is_empty() {
            order.names.extend(MODELS.iter().filter(|(_, kept)| *kept).map(|(name, _)| name.to_string()));
        }
        Ok(order)
    }

    /// Makes and writes the files.
    fn carry_out(&self) -> Result<(), String> {
        std::fs::create_dir_all(&self.folder).map_err(|cause| format!("{}: {cause}", self.folder.display()))?;
        for file in self.names.iter().filter_map(|name| make(name, self.terrain_triangles)).flatten() {
            let path = self.folder.join(file.name);
            std::fs::write(&path, &file.bytes).map_err(|cause| format!("{}: {cause}", path.display()))?;
            println!("{} ({} bytes)", path.display(), file.bytes.len());
        }
        Ok(())
    }
}

fn main() -> ExitCode {
    let order = match Order::parse(std::env::args().skip(1)) {
        Ok(order) => order,
        Err(message) => {
            eprintln!("make_meshes: {message}");
            return ExitCode::from(2);
        }
    };
    match order.carry_out() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("make_meshes: {message}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a file means: PNG and JSON may be written in more than one way, and in which one depends on the crates
    /// that write them.
    fn content(file: &str, bytes: &[u8]) -> Vec<u8> {
        match file.rsplit_once('.').map(|(_, suffix)| suffix) {
            Some("png") => image::load_from_memory(bytes).unwrap().to_rgb8().into_raw(),
            Some("gltf") => {
                let value: std::collections::BTreeMap<String, serde_json::Value> =
                    serde_json::from_slice(bytes).unwrap();
                format!("{value:?}").into_bytes()
            }
            _ => bytes.to_vec(),
        }
    }

    #[test]
    fn the_kept_files_are_what_is_made() {
        let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/meshes"));
        for (name, _) in MODELS.iter().filter(|(_, kept)| *kept) {
            for file in make(name, 0).unwrap() {
                let kept = std::fs::read(folder.join(file.name)).unwrap();
                assert!(
                    content(file.name, &kept) == content(file.name, &file.bytes),
                    "meshes/{} is not what is made now; run `cargo run --release --example make_meshes`",
                    file.name
                );
            }
        }
    }

    #[test]
    fn every_name_makes_something() {
        for (name, _) in MODELS {
            assert!(!make(name, 100).unwrap().is_empty());
        }
        assert!(make("spout", 100).is_none());
    }

    #[test]
    fn mistakes_on_the_command_line_are_told() {
        let parse = |text: &str| Order::parse(text.split_whitespace().map(String::from));
        assert_eq!(parse("torus --out x").unwrap().names, ["torus"]);
        assert_eq!(parse("--all").unwrap().names.len(), MODELS.len());
        assert!(!parse("").unwrap().names.contains(&"terrain".to_string()));
        for wrong in ["spout", "--out", "--triangles many"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
