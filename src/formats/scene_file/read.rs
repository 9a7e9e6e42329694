//! From a scene file to a scene.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DAffine3;
use toml::de::DeTable;

use crate::error::{Error, Fault, Result};
use crate::formats::model::Contents;
use crate::formats::scene_file::assets::{Assets, builtin_names, identity};
use crate::formats::scene_file::value::{Fields, Source, Value, suggestion};
use crate::formats::scene_file::{light, material, object, view};
use crate::formats::{Ledger, LoadOptions, Loaded};
use crate::geometry::Quadric;
use crate::progress::Progress;
use crate::scene::auto::{self, Automatic};
use crate::scene::extent::{Extents, Misfit};
use crate::scene::texture::Filter;
use crate::scene::{Material, NamedCamera, Object, Scene, Texture, exposure};

/// Larger files are no scene files: meshes are files of their own.
const MOST_BYTES: u64 = 64 << 20;

/// Reads a scene file. `options` are for meshes that do not say otherwise.
///
/// Cameras and lights of its models are used where the file has none of its own; without any camera the scene is
/// framed automatically.
///
/// # Errors
/// The first mistake, with line, column and what would be accepted, or the error of a file that the scene refers to.
pub fn read(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    let size = std::fs::metadata(path).map_err(|cause| Error::system(path, cause))?.len();
    if size > MOST_BYTES {
        return Err(Error::limit("the scene file is larger than 64 MiB").at_path(path));
    }
    let bytes = std::fs::read(path).map_err(|cause| Error::system(path, cause))?;
    let text = String::from_utf8(bytes).map_err(|cause| {
        let good = &cause.as_bytes()[..cause.utf8_error().valid_up_to()];
        let line = good.iter().filter(|&&byte| byte == b'\n').count() + 1;
        Error::file("the scene file is not UTF-8 text").at_path(path).at_line(line)
    })?;
    parse(&text, path, options, progress)
}

/// Reads the text of a scene file that lies, or would lie, at `path`.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    parse_with(text, path, options, &mut Assets::default(), progress).map(|parsed| parsed.loaded)
}

/// A scene, and what its parts come from.
pub struct Parsed {
    /// The scene, without an origin.
    pub loaded: Loaded,
    /// Of each of the scene's objects, which `[[object]]` it belongs to, from 0.
    pub entries: Vec<u32>,
    /// How many of the first materials are neutral or of models; the scene file's own follow, in its order.
    pub imported_materials: usize,
    /// Whether the lights are those of models, the scene file having none.
    pub imports_lights: bool,
    /// The boxes of the scene's meshes.
    pub extents: Extents,
}

/// [`parse`] with images and models as they were read before.
///
/// # Errors
/// As [`read`].
pub fn parse_with(
    text: &str,
    path: &Path,
    options: &LoadOptions,
    assets: &mut Assets,
    progress: &dyn Progress,
) -> Result<Parsed> {
    let source = Source { path, text };
    let table = DeTable::parse(text).map_err(|cause| {
        let message = cause.message().split_whitespace().collect::<Vec<_>>().join(" ");
        source.error(cause.span().map_or(0, |span| span.start), message)
    })?;
    assets.begin();
    let mut reader = Reader {
        folder: path.parent().unwrap_or(Path::new("")),
        options,
        progress,
        assets,
        scene: Scene::default(),
        own_materials: Vec::new(),
        entries: Vec::new(),
        ledger: Ledger::default(),
        names: HashMap::new(),
        models: Vec::new(),
        imported: Contents::default(),
        imports_lights: false,
        extents: Extents::default(),
    };
    reader.ledger.note_file(path);
    let automatic = reader.read_scene(&Fields::root(&source, table.get_ref()))?;
    let imported_materials = reader.scene.materials.len() - reader.own_materials.len();
    let Reader { scene, ledger, entries, imports_lights, extents, .. } = reader;
    Ok(Parsed {
        loaded: Loaded { scene, ledger, automatic, built: None },
        entries,
        imported_materials,
        imports_lights,
        extents,
    })
}

/// What marks the number of an object's material as a position in [`Reader::own_materials`] until all models are read.
const OWN: u32 = 1 << 31;

/// A scene as far as it is read, and what has been read of other files.
pub struct Reader<'a> {
    folder: &'a Path,
    options: &'a LoadOptions,
    progress: &'a dyn Progress,
    assets: &'a mut Assets,
    scene: Scene,
    /// Those of `[[material]]`. They follow those of models, so that the numbers in meshes stay when one is added.
    own_materials: Vec<Material>,
    /// Of each object, the number of its `[[object]]`.
    entries: Vec<u32>,
    ledger: Ledger,
    /// Names that were given, by kind of thing, and for materials their number.
    names: HashMap<(&'static str, String), u32>,
    /// What the scene has of models, by what tells them apart.
    models: Vec<(ModelKey, Contents)>,
    /// Cameras and lights of models, placed.
    imported: Contents,
    imports_lights: bool,
    /// Of the scene as far as it is read.
    extents: Extents,
}

/// What tells models apart: the file or name, whether that is of a built-in one, and how they are read.
#[derive(Debug, Clone, PartialEq)]
struct ModelKey {
    path: PathBuf,
    is_builtin: bool,
    options: LoadOptions,
}

impl Reader<'_> {
    fn read_scene(&mut self, root: &Fields<'_>) -> Result<Automatic> {
        root.accept(&["camera", "film", "background", "ambient", "light", "material", "object", "override"])?;
        self.read_cameras(root)?;
        if let Some(background) = root.get("background") {
            self.scene.background = view::read_background(&background.table("the background")?, self)?;
        }
        self.scene.ambient = root.or("ambient", self.scene.ambient, Value::weight)?;
        for (index, fields) in tables(root, "light", "a light")?.iter().enumerate() {
            fields.get("name").map(|name| self.claim_name("light", &name)).transpose()?;
            self.scene.lights.push(light::read_light(fields, format!("light {}", index + 1))?);
        }
        for fields in tables(root, "material", "a material")? {
            let name = fields.require("name")?;
            self.claim_name("material", &name)?;
            let material = material::read_material(&fields, self)?;
            self.own_materials.push(material);
        }
        for (index, fields) in tables(root, "object", "an object")?.iter().enumerate() {
            object::read_object(fields, index + 1, self)?;
            self.entries.resize(self.scene.objects.len(), index as u32);
        }
        for fields in tables(root, "override", "an override")? {
            self.read_override(&fields)?;
        }
        let imported = self.scene.materials.len() as u32;
        self.scene.materials.extend(self.own_materials.iter().cloned());
        for material in self.scene.objects.iter_mut().filter_map(|object| object.material.as_mut()) {
            *material = if *material & OWN == 0 { *material } else { imported + (*material & !OWN) };
        }

        if self.scene.cameras.is_empty() {
            self.scene.cameras = std::mem::take(&mut self.imported.cameras);
        }
        self.imports_lights = self.scene.lights.is_empty() && !self.imported.lights.is_empty();
        if self.imports_lights {
            self.scene.lights = std::mem::take(&mut self.imported.lights);
        }
        // The automatic camera frames the scene for the film's size.
        let mut default = view::default_film(self.scene.cameras.first().map(|named| &named.camera));
        if self.imports_lights && self.imported.physical_lights {
            default.exposure = exposure::automatic(&self.scene);
        }
        self.scene.film = match root.get("film") {
            Some(film) => view::read_film(&film.table("the film")?, default)?,
            None => default,
        };
        Ok(auto::complete_camera(&mut self.scene))
    }

    fn read_cameras(&mut self, root: &Fields<'_>) -> Result<()> {
        let cameras = tables(root, "camera", "a camera")?;
        for fields in &cameras {
            let camera = view::read_camera(fields)?;
            let name = match fields.get("name") {
                Some(name) => self.claim_name("camera", &name)?,
                None if cameras.len() == 1 => "camera",
                None => return Err(fields.error("a camera needs `name` where there are several")),
            };
            let path = view::read_camera_path(fields, &camera)?;
            self.scene.cameras.push(NamedCamera { name: name.to_owned(), camera, path });
        }
        Ok(())
    }

    /// Changes every imported material of a name.
    fn read_override(&mut self, fields: &Fields<'_>) -> Result<()> {
        /// The first of a scene is the neutral one.
        const FIRST: usize = 1;
        let wanted = fields.require("material")?;
        let name = wanted.string()?;
        let mut found = false;
        for index in FIRST..self.scene.materials.len() {
            if self.scene.materials[index].name == name {
                let imported = self.scene.materials[index].clone();
                self.scene.materials[index] = material::read_override(fields, &imported, self)?;
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        let mut known: Vec<&str> = self.scene.materials[FIRST..].iter().map(|m| m.name.as_str()).collect();
        known.sort_unstable();
        known.dedup();
        let error = wanted.error(format!("no imported material is called `{name}`"));
        Err(error.remedy(suggestion(name, &known)))
    }

    /// Options for meshes that do not say otherwise.
    pub fn options(&self) -> &LoadOptions {
        self.options
    }

    /// Takes a name for a kind of thing; it must be free.
    pub fn claim_name<'v>(&mut self, kind: &'static str, value: &Value<'v>) -> Result<&'v str> {
        let name = value.name()?;
        let number = self.own_materials.len() as u32;
        if self.names.insert((kind, name.to_owned()), number).is_some() {
            return Err(value.error(format!("a second {kind} is called `{name}`")).remedy("names must differ"));
        }
        Ok(name)
    }

    /// The scene's own material of a name, as objects refer to it until all is read.
    pub fn material(&self, value: &Value<'_>) -> Result<u32> {
        let name = value.string()?;
        if let Some(&number) = self.names.get(&("material", name.to_owned())) {
            return Ok(OWN | number);
        }
        let mut known: Vec<_> =
            self.names.keys().filter(|(kind, _)| *kind == "material").map(|(_, name)| name.as_str()).collect();
        known.sort_unstable();
        let error = value.error(format!("there is no [[material]] called `{name}`"));
        Err(error.remedy(suggestion(name, &known)))
    }

    /// The file that a value names, relative to the scene file.
    fn file(&self, value: &Value<'_>) -> Result<PathBuf> {
        let name = value.string()?;
        let path = self.folder.join(name);
        if path.is_file() {
            return Ok(path);
        }
        let what = if path.is_dir() { "is a folder" } else { "is not there" };
        let error = value.error(format!("the file `{name}` {what}"));
        Err(error.remedy("paths are relative to the scene file"))
    }

    /// The image that a value names.
    pub fn image(&mut self, value: &Value<'_>) -> Result<Texture> {
        let path = self.file(value)?;
        self.ledger.note_file(&path);
        self.assets.image(&path, &self.options.limits)
    }

    /// Adds a texture made of an [`image`](Self::image) unless the scene has it; its number.
    ///
    /// The texels tell, which this reader's textures share if they are of one file. A name tells nothing: an image
    /// embedded in a model may be called anything.
    pub fn add_texture(&mut self, texture: Texture) -> u32 {
        let same = |other: &Texture| {
            other.texels.is_shared_with(&texture.texels) && (other.wrap, other.filter) == (texture.wrap, texture.filter)
        };
        let number = self.scene.textures.iter().position(same).unwrap_or_else(|| {
            // Who wants single texels wants them at any distance.
            let has_levels = texture.filter == Filter::Linear;
            self.scene.textures.push(if has_levels { texture.with_levels() } else { texture });
            self.scene.textures.len() - 1
        });
        number as u32
    }

    /// Adds a quadric; its number.
    pub fn add_quadric(&mut self, quadric: Quadric) -> u32 {
        self.scene.quadrics.push(quadric);
        self.scene.quadrics.len() as u32 - 1
    }

    /// The contents of the model file, or of the built-in mesh, that a value names. Its meshes, materials and textures are
    /// added to the scene the first time.
    pub fn model(&mut self, value: &Value<'_>, is_builtin: bool, options: &LoadOptions) -> Result<Contents> {
        let name = value.string()?;
        let path = if is_builtin { PathBuf::from(name) } else { identity(&self.folder.join(name)) };
        let key = ModelKey { path, is_builtin, options: options.clone() };
        if let Some((_, contents)) = self.models.iter().find(|(known, _)| *known == key) {
            return Ok(contents.clone());
        }
        let imported = if is_builtin {
            self.assets.builtin(name, options, self.progress).ok_or_else(|| {
                let known: Vec<&str> = builtin_names().collect();
                value.error(format!("there is no built-in mesh called `{name}`")).remedy(suggestion(name, &known))
            })??
        } else {
            let path = self.file(value)?;
            self.assets.model(&path, options, self.progress).map_err(|error| match error.fault() {
                // An unknown format is the scene file's mistake; all else is told by the model's own place.
                Fault::Unsupported if error.line().is_none() => value.error(error.to_string()),
                _ => error,
            })?
        };
        let (contents, ledger) = imported.append_assets(&mut self.scene, &mut self.extents);
        self.ledger.merge(ledger);
        let vertices = self.scene.meshes.iter().map(|mesh| mesh.positions.len() as u64).sum();
        options.limits.check_vertices(vertices).map_err(|error| error.at_path(&self.folder.join(name)))?;
        self.models.push((key, contents.clone()));
        Ok(contents)
    }

    /// Fails where an object is too large, too far or too small to be rendered; `what` and `culprit` are what to blame.
    pub fn check_extent(&self, objects: &[Object], what: &str, culprit: &Value<'_>) -> Result<()> {
        match objects.iter().find_map(|object| self.extents.misfit(&self.scene, object)) {
            None => Ok(()),
            Some(Misfit::TooFar) => Err(culprit
                .error(format!("{what} reaches beyond 2^40"))
                .remedy("make it smaller, or move it nearer to the origin")),
            Some(Misfit::TooSmall) => {
                Err(culprit.error(format!("{what} is too small")).remedy("sizes must lie between 2^-40 and 2^40"))
            }
        }
    }

    /// Contents moved to a place; `number` tells instances apart by name, `culprit` is what gave the place.
    pub fn placed(
        &self,
        contents: Contents,
        place: &DAffine3,
        number: Option<usize>,
        culprit: &Value<'_>,
    ) -> Result<Contents> {
        let mut placed = contents.transformed(place);
        if let Some(number) = number {
            for object in &mut placed.objects {
                object.name = format!("{} {number}", object.name);
            }
        }
        self.check_extent(&placed.objects, "the object", culprit)?;
        Ok(placed)
    }

    /// Puts contents into the scene.
    pub fn add(&mut self, mut placed: Contents) {
        self.scene.objects.append(&mut placed.objects);
        self.imported.cameras.append(&mut placed.cameras);
        self.imported.lights.append(&mut placed.lights);
        self.imported.physical_lights |= placed.physical_lights;
    }
}

/// The tables of `[[key]]`, none where there are none.
fn tables<'a>(root: &Fields<'a>, key: &str, what: &'a str) -> Result<Vec<Fields<'a>>> {
    root.get(key).map_or(Ok(Vec::new()), |value| value.tables(what))
}
