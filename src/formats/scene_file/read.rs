//! From a scene file to a scene.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DAffine3;
use toml::de::DeTable;

use crate::error::{Error, Fault, Result};
use crate::formats::image_file::read_texture;
use crate::formats::model::Contents;
use crate::formats::scene_file::value::{Fields, Source, Value, suggestion};
use crate::formats::scene_file::{light, material, object, view};
use crate::formats::{Ledger, LoadOptions, Loaded, load_model};
use crate::geometry::Quadric;
use crate::progress::Progress;
use crate::scene::auto::{self, Automatic};
use crate::scene::extent::{Extents, Misfit};
use crate::scene::texture::Filter;
use crate::scene::{NamedCamera, Object, Scene, Texture, exposure};

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
    let source = Source { path, text };
    let table = DeTable::parse(text).map_err(|cause| {
        let message = cause.message().split_whitespace().collect::<Vec<_>>().join(" ");
        source.error(cause.span().map_or(0, |span| span.start), message)
    })?;
    let mut reader = Reader {
        folder: path.parent().unwrap_or(Path::new("")),
        options,
        progress,
        scene: Scene::default(),
        ledger: Ledger::default(),
        names: HashMap::new(),
        images: HashMap::new(),
        models: Vec::new(),
        imported: Contents::default(),
        extents: Extents::default(),
    };
    reader.ledger.note_file(path);
    let automatic = reader.read_scene(&Fields::root(&source, table.get_ref()))?;
    Ok(Loaded { scene: reader.scene, ledger: reader.ledger, automatic })
}

/// A scene as far as it is read, and what has been read of other files.
pub struct Reader<'a> {
    folder: &'a Path,
    options: &'a LoadOptions,
    progress: &'a dyn Progress,
    scene: Scene,
    ledger: Ledger,
    /// Names that were given, by kind of thing, and for materials their number.
    names: HashMap<(&'static str, String), u32>,
    /// By the path that [`identity`] gives.
    images: HashMap<PathBuf, Texture>,
    models: Vec<((PathBuf, LoadOptions), Contents)>,
    /// Cameras and lights of models, placed.
    imported: Contents,
    /// Of the scene as far as it is read.
    extents: Extents,
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
            self.scene.materials.push(material);
        }
        let own_materials = self.scene.materials.len();
        for (index, fields) in tables(root, "object", "an object")?.iter().enumerate() {
            object::read_object(fields, index + 1, self)?;
        }
        for fields in tables(root, "override", "an override")? {
            self.read_override(&fields, own_materials)?;
        }

        if self.scene.cameras.is_empty() {
            self.scene.cameras = std::mem::take(&mut self.imported.cameras);
        }
        let imports_lights = self.scene.lights.is_empty() && !self.imported.lights.is_empty();
        if imports_lights {
            self.scene.lights = std::mem::take(&mut self.imported.lights);
        }
        // The automatic camera frames the scene for the film's size.
        let mut default = view::default_film(self.scene.cameras.first().map(|named| &named.camera));
        if imports_lights && self.imported.physical_lights {
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
            self.scene.cameras.push(NamedCamera { name: name.to_owned(), camera });
        }
        Ok(())
    }

    /// Changes every imported material of a name.
    fn read_override(&mut self, fields: &Fields<'_>, own_materials: usize) -> Result<()> {
        let wanted = fields.require("material")?;
        let name = wanted.string()?;
        let mut found = false;
        for index in own_materials..self.scene.materials.len() {
            if self.scene.materials[index].name == name {
                let imported = self.scene.materials[index].clone();
                self.scene.materials[index] = material::read_override(fields, &imported, self)?;
                found = true;
            }
        }
        if found {
            return Ok(());
        }
        let mut known: Vec<&str> = self.scene.materials[own_materials..].iter().map(|m| m.name.as_str()).collect();
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
        let number = self.scene.materials.len() as u32;
        if self.names.insert((kind, name.to_owned()), number).is_some() {
            return Err(value.error(format!("a second {kind} is called `{name}`")).remedy("names must differ"));
        }
        Ok(name)
    }

    /// The number of the scene's own material of a name.
    pub fn material(&self, value: &Value<'_>) -> Result<u32> {
        let name = value.string()?;
        if let Some(&number) = self.names.get(&("material", name.to_owned())) {
            return Ok(number);
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
        let key = identity(&path);
        if let Some(texture) = self.images.get(&key) {
            return Ok(texture.clone());
        }
        self.ledger.note_file(&path);
        let texture = read_texture(&path, &self.options.limits)?;
        self.images.insert(key, texture.clone());
        Ok(texture)
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

    /// The contents of the model file that a value names. Its meshes, materials and textures are added to the scene the
    /// first time.
    pub fn model(&mut self, value: &Value<'_>, options: &LoadOptions) -> Result<Contents> {
        let path = self.file(value)?;
        let key = (identity(&path), options.clone());
        if let Some((_, contents)) = self.models.iter().find(|(known, _)| *known == key) {
            return Ok(contents.clone());
        }
        let model = load_model(&path, options, self.progress).map_err(|error| match error.fault() {
            // An unknown format is the scene file's mistake; all else is told by the model's own place.
            Fault::Unsupported if error.line().is_none() => value.error(error.to_string()),
            _ => error,
        })?;
        let (contents, ledger) = model.append_assets(&mut self.scene);
        self.ledger.merge(ledger);
        let vertices = self.scene.meshes.iter().map(|mesh| mesh.positions.len() as u64).sum();
        options.limits.check_vertices(vertices).map_err(|error| error.at_path(&path))?;
        self.extents.add_new(&self.scene);
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

    /// Puts contents into the scene; `number` tells instances apart by name, `culprit` is what gave the place.
    pub fn place(
        &mut self,
        contents: Contents,
        place: &DAffine3,
        number: Option<usize>,
        culprit: &Value<'_>,
    ) -> Result<()> {
        let mut placed = contents.transformed(place);
        if let Some(number) = number {
            for object in &mut placed.objects {
                object.name = format!("{} {number}", object.name);
            }
        }
        self.check_extent(&placed.objects, "the object", culprit)?;
        self.scene.objects.append(&mut placed.objects);
        self.imported.cameras.append(&mut placed.cameras);
        self.imported.lights.append(&mut placed.lights);
        self.imported.physical_lights |= placed.physical_lights;
        Ok(())
    }
}

/// What tells whether two paths lead to the same file.
fn identity(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

/// The tables of `[[key]]`, none where there are none.
fn tables<'a>(root: &Fields<'a>, key: &str, what: &'a str) -> Result<Vec<Fields<'a>>> {
    root.get(key).map_or(Ok(Vec::new()), |value| value.tables(what))
}
