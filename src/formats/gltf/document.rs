//! The JSON: parsed, checked for dangling references, and for what it requires of its reader.

use std::collections::BTreeMap;

use ::gltf::json::validation::{self, Validate};
use ::gltf::json::{self, Root, mesh::Semantic, validation::Checked};
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::formats::{Ledger, Treatment};

/// A file's JSON, safe to follow: every index in it that geometry, materials, nodes, cameras and lights use exists.
/// Those of skins, animations and morph targets may dangle.
#[derive(Debug)]
pub(super) struct Document {
    /// All but what follows.
    pub root: Root,
    /// The placement of each node, as exact as the file has it; the crate rounds it to f32.
    pub placements: Vec<Placement>,
    /// The morph targets of each mesh.
    pub targets: Vec<Vec<Targets>>,
    /// The animations; the crate wants a node in each of their channels, which extensions leave out.
    pub animations: Vec<Animation>,
}

/// The morph targets of a primitive: for each the numbers of its attributes' accessors by name.
pub(super) type Targets = Vec<BTreeMap<String, serde_json::Value>>;

/// Samplers, and what they move.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    /// What it is called.
    pub name: Option<String>,
    /// Which sampler moves what.
    pub channels: Vec<Channel>,
    /// Values over time.
    pub samplers: Vec<Sampler>,
}

/// What a sampler moves.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Channel {
    /// Number of the sampler.
    pub sampler: usize,
    /// What it moves.
    pub target: Target,
}

/// A property of a node.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Target {
    /// Number of the node; `None` where an extension says what is meant.
    pub node: Option<usize>,
    /// `translation`, `rotation`, `scale` or `weights`.
    pub path: String,
}

/// Accessors of times and values.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Sampler {
    /// Times in seconds.
    pub input: u32,
    /// Values.
    pub output: u32,
    /// `LINEAR` if absent.
    pub interpolation: Option<String>,
}

/// Where a node stands relative to its parent, from the JSON in f64.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct Placement {
    /// Column-major; excludes the others.
    pub matrix: Option<[f64; 16]>,
    /// Applied last.
    pub translation: Option<[f64; 3]>,
    /// A quaternion, the scalar last; applied second.
    pub rotation: Option<[f64; 4]>,
    /// Applied first.
    pub scale: Option<[f64; 3]>,
}

/// Extensions that are read, and how well.
const EXTENSIONS: &[(&str, Treatment)] = &[
    ("EXT_mesh_gpu_instancing", Treatment::Honoured),
    ("EXT_texture_webp", Treatment::Honoured),
    ("KHR_lights_punctual", Treatment::Honoured),
    ("KHR_materials_emissive_strength", Treatment::Honoured),
    ("KHR_materials_ior", Treatment::Honoured),
    ("KHR_materials_pbrSpecularGlossiness", Treatment::Approximated),
    ("KHR_materials_specular", Treatment::Honoured),
    ("KHR_materials_transmission", Treatment::Honoured),
    ("KHR_materials_unlit", Treatment::Honoured),
    ("KHR_materials_volume", Treatment::Honoured),
    ("KHR_mesh_quantization", Treatment::Honoured),
    ("KHR_texture_transform", Treatment::Honoured),
];

impl Document {
    /// Parses and checks the JSON; what is unusual but harmless goes to the ledger.
    ///
    /// # Errors
    /// A file's error with line and column for JSON that is not glTF, or with the place of a dangling reference;
    /// unsupported for glTF 1.0 and for extensions that are required and not read.
    pub fn parse(text: &[u8], ledger: &mut Ledger) -> Result<Self> {
        let root = parse_json(text).or_else(|error| without_animations(text).ok_or(error));
        let root: Root = root.map_err(|error| old_version(text).unwrap_or(error))?;
        check_version(&root.asset.version)?;
        check_extensions(&root, ledger)?;
        check_references(&root, ledger)?;
        let rest: Rest = parse_json(text)?;
        let animation = |value| {
            serde_json::from_value(value).unwrap_or_else(|_| {
                ledger.note(Treatment::Warning, "broken animation: nothing moves in it", 1);
                Animation::default()
            })
        };
        let of_primitive = |primitive: RestOfPrimitive| primitive.targets.unwrap_or_default();
        let targets = rest.meshes.into_iter().map(|mesh| mesh.primitives.into_iter().map(of_primitive).collect());
        Ok(Self {
            root,
            placements: rest.nodes,
            targets: targets.collect(),
            animations: rest.animations.into_iter().map(animation).collect(),
        })
    }
}

/// What the crate's types do not tell.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Rest {
    nodes: Vec<Placement>,
    meshes: Vec<RestOfMesh>,
    animations: Vec<serde_json::Value>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct RestOfMesh {
    primitives: Vec<RestOfPrimitive>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct RestOfPrimitive {
    targets: Option<Targets>,
}

/// A file that the crate reads but for its animations.
fn without_animations(text: &[u8]) -> Option<Root> {
    let mut value: serde_json::Value = serde_json::from_slice(text).ok()?;
    value.as_object_mut()?.remove("animations")?;
    serde_json::from_value(value).ok()
}

/// The error for an extension that must be understood to read the file and is not.
pub(super) fn missing_extension(name: &str) -> Error {
    let error = Error::unsupported(format!("the file requires the extension {name}, which is not read"));
    error.remedy(match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "decode it first with `gltf-transform copy in.glb out.glb`"
        }
        "KHR_texture_basisu" => "decode its images first with `gltf-transform ktxdecompress in.glb out.glb`",
        _ => "export it again without that extension",
    })
}

fn check_version(version: &str) -> Result<()> {
    if version.starts_with("2.") {
        return Ok(());
    }
    Err(Error::unsupported(format!("asset.version: glTF {version} is not read, only 2"))
        .remedy("convert it with `gltf-pipeline -i in.gltf -o out.gltf`"))
}

/// The error to give instead of one about the shape of the JSON, if the file is of another version.
fn old_version(text: &[u8]) -> Option<Error> {
    #[derive(Deserialize)]
    struct Head {
        asset: Asset,
    }
    #[derive(Deserialize)]
    struct Asset {
        version: String,
    }
    let head: Head = serde_json::from_slice(text).ok()?;
    check_version(&head.asset.version).err()
}

fn parse_json<'de, T: Deserialize<'de>>(text: &'de [u8]) -> Result<T> {
    serde_json::from_slice(text).map_err(|error| {
        let (line, column) = (error.line(), error.column());
        let message = error.to_string();
        let message = message.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&message);
        Error::file(format!("not valid glTF: {message}")).at_line_column(line, column)
    })
}

fn check_extensions(root: &Root, ledger: &mut Ledger) -> Result<()> {
    let known = |name: &str| EXTENSIONS.iter().find(|(known, _)| *known == name);
    if let Some(name) = root.extensions_required.iter().find(|name| known(name).is_none()) {
        return Err(missing_extension(name));
    }
    for name in &root.extensions_used {
        let treatment = known(name).map_or(Treatment::Ignored, |(_, treatment)| *treatment);
        ledger.note(treatment, format!("extension {name}"), 1);
    }
    Ok(())
}

/// Runs the crate's validation and sorts out what does not matter here.
fn check_references(root: &Root, ledger: &mut Ledger) -> Result<()> {
    // The crate looks this one up before it checks it.
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if let Some(index) = position.filter(|index| index.value() >= root.accessors.len()) {
                let place = format!("meshes[{m}].primitives[{p}].attributes.POSITION");
                return Err(Error::file(format!("accessors[{}] does not exist", index.value())).within(place));
            }
        }
    }
    let mut first = None;
    root.validate(root, json::Path::new, &mut |path: &dyn Fn() -> json::Path, error| {
        let path = path();
        match judge(path.as_str(), error) {
            Verdict::Harmless => {}
            Verdict::Warning(text) => ledger.note(Treatment::Warning, text, 1),
            Verdict::Fatal if first.is_none() => {
                let text = match error {
                    validation::Error::IndexOutOfBounds => "refers to something that does not exist",
                    validation::Error::Invalid => "has a value that glTF does not allow",
                    validation::Error::Missing => "is missing",
                    validation::Error::Oversize => "is too large",
                    validation::Error::Unsupported => "is not supported",
                };
                first = Some(Error::file(format!("{path} {text}")).remedy("export the file again"));
            }
            Verdict::Fatal => {}
        }
    });
    first.map_or(Ok(()), Err)
}

/// What a finding of the crate's validation means here.
enum Verdict {
    Harmless,
    Warning(&'static str),
    Fatal,
}

fn judge(path: &str, error: validation::Error) -> Verdict {
    use validation::Error::{Invalid, Missing, Unsupported};
    match error {
        // Which extensions are required was checked by our own list.
        Unsupported => Verdict::Harmless,
        // These are checked where they are used.
        _ if path.starts_with("animations") || path.starts_with("skins") || path.contains(".targets") => {
            Verdict::Harmless
        }
        // The spec demands these bounds; ours come from the vertices themselves.
        _ if path.ends_with("[\"POSITION\"].min") || path.ends_with("[\"POSITION\"].max") => {
            Verdict::Warning("positions without bounds (min, max)")
        }
        Missing if path.ends_with(".attributes[\"POSITION\"]") => Verdict::Warning("primitive without positions"),
        Invalid if path.contains(".attributes[\"<invalid") => Verdict::Warning("vertex attribute of unknown name"),
        // An accessor without bytes is legal: zeros, or what an extension makes of them.
        Missing if path.starts_with("accessors") && path.ends_with(".bufferView") => Verdict::Harmless,
        Invalid if path.ends_with(".byteStride") => Verdict::Warning("stride outside 4 to 252 bytes"),
        _ if path == "scene" => Verdict::Warning("default scene that does not exist"),
        // A texture may have its image in an extension alone.
        Missing if path.starts_with("textures") && path.ends_with(".source") => Verdict::Harmless,
        _ => Verdict::Fatal,
    }
}
