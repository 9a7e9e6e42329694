//! The images that an MTL file names, each decoded once, and the textures made of them.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use glam::{DVec2, Vec4};
use rayon::prelude::*;

use super::find_file::{absence, find_file};
use super::maps::MapStatement;
use super::texels;
use crate::formats::image_file::read_texture;
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Treatment};
use crate::scene::detail::Channel;
use crate::scene::texture::Wrap;
use crate::scene::{Texture, TextureRef};

/// The images and textures of a model.
#[derive(Default)]
pub(super) struct Textures {
    surroundings: Surroundings,
    /// As decoded; `None` for an image that could not be read.
    images: HashMap<PathBuf, Option<Texture>>,
    /// What materials refer to, in the order of first use.
    made: Vec<Texture>,
    known: HashMap<(Recipe, bool), u32>,
}

/// A `map_` statement whose image is there.
#[derive(Debug, Clone)]
pub(super) struct Map<'a> {
    /// What the statement says.
    pub statement: MapStatement<'a>,
    /// The image's file.
    pub path: PathBuf,
}

/// How a texture comes from images.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Recipe {
    /// Colours without alpha.
    Color(Source),
    /// Colours with alpha.
    ColorAndAlpha(Source),
    /// Numbers, as they are stored.
    Data(Source),
    /// Normals of heights: of which channel, by what the slopes are multiplied, and whether the image ends at its border.
    Heights(Source, Channel, u64, bool),
    /// Roughness and metalness, of which channels.
    Packed(Option<(Source, Channel)>, Option<(Source, Channel)>),
}

/// An image and the bits of what `-mm` says.
type Source = (PathBuf, [u64; 2]);

impl Textures {
    /// Decodes the images of statements, each seen from a folder, on all threads. What is missing is told when it is asked for.
    pub fn decode<'a>(
        statements: impl Iterator<Item = (&'a Path, &'a str)>,
        surroundings: Surroundings,
        ledger: &mut Ledger,
    ) -> Self {
        let find = |(folder, statement)| find_file(folder, MapStatement::parse(statement).file, &surroundings);
        let paths: BTreeSet<PathBuf> = statements.filter_map(find).collect();
        let paths: Vec<PathBuf> = paths.into_iter().collect();
        let outcomes: Vec<_> = paths.par_iter().map(|path| read_texture(path, &surroundings.limits)).collect();
        let mut images = HashMap::new();
        for (path, outcome) in paths.into_iter().zip(outcomes) {
            ledger.note_file(&path);
            let warn = |error| ledger.note(Treatment::Warning, format!("{error}: plain colour used"), 1);
            images.insert(path, outcome.map_err(warn).ok());
        }
        Self { surroundings, images, ..Self::default() }
    }

    /// The map of a statement; `None`, with a warning, for an image that is missing or could not be read.
    pub fn map<'a>(&self, folder: &Path, statement: &'a str, ledger: &mut Ledger) -> Option<Map<'a>> {
        let statement = MapStatement::parse(statement);
        let Some(path) = find_file(folder, statement.file, &self.surroundings) else {
            let why = absence(folder, statement.file, &self.surroundings);
            let warning = format!("texture `{}` {why}: plain colour used", statement.file);
            ledger.note(Treatment::Warning, warning, 1);
            return None;
        };
        self.images.get(&path)?.as_ref()?;
        Some(Map { statement, path })
    }

    /// The map's colours, with their alpha or opaque.
    pub fn color(&mut self, map: &Map<'_>, with_alpha: bool) -> TextureRef {
        let source = source(map);
        let recipe = if with_alpha { Recipe::ColorAndAlpha(source) } else { Recipe::Color(source) };
        self.refer(recipe, &map.statement)
    }

    /// The map's numbers.
    pub fn data(&mut self, map: &Map<'_>) -> TextureRef {
        self.refer(Recipe::Data(source(map)), &map.statement)
    }

    /// Normals of the map's heights.
    pub fn normals_of_heights(&mut self, map: &Map<'_>) -> TextureRef {
        let MapStatement { channel, bump, clamp, .. } = map.statement;
        let channel = channel.unwrap_or(Channel::Luminance);
        self.refer(Recipe::Heights(source(map), channel, bump.to_bits(), clamp), &map.statement)
    }

    /// One texture with roughness and metalness, placed as the first that there is.
    pub fn packed(&mut self, roughness: Option<&Map<'_>>, metalness: Option<&Map<'_>>) -> Option<TextureRef> {
        let first = roughness.or(metalness)?;
        let is_one = |rough: &Map<'_>, metal: &Map<'_>| rough.path == metal.path;
        let speaks_of_channels = |map: &Map<'_>| map.statement.channel.is_some();
        if let (Some(rough), Some(metal)) = (roughness, metalness)
            && is_one(rough, metal)
            && !speaks_of_channels(rough)
            && !speaks_of_channels(metal)
        {
            return Some(self.data(first));
        }
        let part = |map: &Map<'_>| (source(map), map.statement.channel.unwrap_or(Channel::Luminance));
        Some(self.refer(Recipe::Packed(roughness.map(part), metalness.map(part)), &first.statement))
    }

    /// The image of a map as it was decoded.
    pub fn image(&self, map: &Map<'_>) -> Option<&Texture> {
        self.images.get(&map.path)?.as_ref()
    }

    /// The mean of what a texture has, linear.
    pub fn mean(&self, texture: &TextureRef) -> Vec4 {
        self.made[texture.texture as usize].sample_footprint(DVec2::splat(0.5), f32::INFINITY)
    }

    /// All textures, in the order of their first use.
    pub fn into_list(self) -> Vec<Texture> {
        self.made
    }

    fn refer(&mut self, recipe: Recipe, statement: &MapStatement<'_>) -> TextureRef {
        let clamp = statement.clamp;
        let place = match self.known.get(&(recipe.clone(), clamp)) {
            Some(&known) => known,
            None => {
                // The same image wrapped otherwise shares its texels.
                let texture = match self.known.get(&(recipe.clone(), !clamp)) {
                    Some(&other) => self.made[other as usize].clone(),
                    None => self.make(&recipe).with_levels(),
                };
                let wrap = [if clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
                self.made.push(Texture { wrap, ..texture });
                let place = (self.made.len() - 1) as u32;
                self.known.insert((recipe, clamp), place);
                place
            }
        };
        TextureRef::scaled(place, statement.scale, statement.offset)
    }

    fn make(&self, recipe: &Recipe) -> Texture {
        let image = |source: &Source| self.images[&source.0].as_ref().expect("maps have images that could be read");
        let adjust = |image, source: &Source| texels::adjusted(image, source.1.map(f64::from_bits));
        match recipe {
            Recipe::Color(source) => adjust(texels::opaque(image(source)), source),
            Recipe::ColorAndAlpha(source) => adjust(image(source).clone(), source),
            Recipe::Data(source) => adjust(texels::data(image(source)), source),
            Recipe::Heights(source, channel, scale, clamp) => {
                let heights = adjust(texels::data(image(source)), source);
                texels::normals_of_heights(&heights, *channel, f64::from_bits(*scale), *clamp)
            }
            Recipe::Packed(roughness, metalness) => {
                let part = |part: &Option<(Source, Channel)>| {
                    let (source, channel) = part.as_ref()?;
                    Some((adjust(texels::data(image(source)), source), *channel))
                };
                let (roughness, metalness) = (part(roughness), part(metalness));
                texels::packed(lend(&roughness), lend(&metalness)).expect("one of the two is there")
            }
        }
    }
}

/// The image of a map and how its values are adjusted.
fn source(map: &Map<'_>) -> Source {
    (map.path.clone(), map.statement.base_gain.map(f64::to_bits))
}

fn lend(part: &Option<(Texture, Channel)>) -> Option<(&Texture, Channel)> {
    part.as_ref().map(|(image, channel)| (image, *channel))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn here(folder: &tempfile::TempDir) -> Surroundings {
        Surroundings::new(folder.path(), &Default::default())
    }

    #[test]
    fn an_image_is_decoded_once() {
        let folder = tempfile::tempdir().unwrap();
        image::RgbImage::new(2, 3).save(folder.path().join("a.png")).unwrap();
        std::fs::write(folder.path().join("bad.png"), "x").unwrap();
        let statements = ["a.png", "-clamp on A.png", "-s 2 2 .\\a.png", "bad.png", "-clamp on bad.png", "none.png"];
        let mut ledger = Ledger::default();
        let mut textures =
            Textures::decode(statements.iter().map(|&text| (folder.path(), text)), here(&folder), &mut ledger);
        let mut get = |statement| {
            let map = textures.map(folder.path(), statement, &mut ledger)?;
            Some(textures.color(&map, false).texture)
        };
        assert_eq!(statements.map(&mut get), [Some(0), Some(1), Some(0), None, None, None]);
        let list = textures.into_list();
        assert_eq!((list.len(), list[0].height, list[0].levels.len()), (2, 3, 1));
        assert!(list[0].texels.is_shared_with(&list[1].texels));
        assert_eq!((list[0].wrap, list[1].wrap), ([Wrap::Repeat; 2], [Wrap::Clamp; 2]));
        let warnings: Vec<_> = ledger.entries().filter(|entry| entry.0 == Treatment::Warning).collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings.contains(&(Treatment::Warning, "texture `none.png` is missing: plain colour used", 1)));
    }

    #[test]
    fn colours_and_numbers_of_an_opaque_image_share_memory() {
        let folder = tempfile::tempdir().unwrap();
        image::RgbImage::new(4, 4).save(folder.path().join("a.png")).unwrap();
        let mut ledger = Ledger::default();
        let mut textures = Textures::decode([(folder.path(), "a.png")].into_iter(), here(&folder), &mut ledger);
        let map = textures.map(folder.path(), "a.png", &mut ledger).unwrap();
        let refs = [textures.color(&map, false), textures.data(&map), textures.normals_of_heights(&map)];
        assert_eq!(refs.map(|texture| texture.texture), [0, 1, 2]);
        assert_eq!(textures.mean(&refs[2]), Vec4::new(0.5, 0.5, 1.0, 1.0));
    }
}
