//! Materials with their images: those that `usemtl` names, as libraries define them.

use glam::Vec4;

use super::library::{Definition, Libraries};
use super::mtl::{self, Phong};
use super::textures::{Map, Textures};
use crate::formats::surroundings::Surroundings;
use crate::formats::{Ledger, Scope, Treatment};
use crate::scene::detail::{Alpha, AlphaMode, Channel, Detail, MetallicRoughness, NormalMap, Rule};
use crate::scene::{Material, Rgb, Texture, TextureRef};

use super::texels::{has_varying_alpha, shows_normals};

/// Reads the materials of these names, in this order, and the images that they use. A name without a definition gives a
/// neutral material of that name, and so does none. `has_colors` tells whether vertices have colours.
pub(super) fn read(
    names: &[Option<String>],
    libraries: &Libraries,
    surroundings: Surroundings,
    has_colors: bool,
    ledger: &mut Ledger,
) -> (Vec<Material>, Vec<Texture>) {
    let definition = |name: &Option<String>| libraries.get(name.as_deref().filter(|name| !name.is_empty())?);
    let statements = names.iter().filter_map(definition).flat_map(|definition| {
        let maps = maps(&definition.source).into_iter().flatten();
        maps.map(|statement| (definition.folder.as_path(), statement))
    });
    let mut textures = Textures::decode(statements, surroundings, ledger);
    let mut materials = Vec::with_capacity(names.len());
    for name in names {
        let number = materials.len() as u32;
        materials.push(match (definition(name), name.as_deref()) {
            (Some(definition), _) => Reading { definition, number, has_colors, textures: &mut textures, ledger }.read(),
            (None, None | Some("")) => Material::default(),
            (None, Some(name)) => {
                if !libraries.incomplete {
                    let warning = format!("material `{name}` is not defined: neutral material used");
                    ledger.note_in(Treatment::Warning, warning, Scope::Material(number));
                }
                Material { name: name.to_owned(), ..Default::default() }
            }
        });
    }
    (materials, textures.into_list())
}

/// The statements of a material that name images.
fn maps(source: &tobj::Material) -> [Option<&str>; 8] {
    let own = [&source.diffuse_texture, &source.specular_texture, &source.dissolve_texture, &source.normal_texture];
    let [diffuse, specular, alpha, bump] = own.map(|statement| statement.as_deref());
    let further = ["map_Ke", "norm", "map_Pr", "map_Pm"].map(|keyword| source.unknown_param.get(keyword));
    let [emission, normal, roughness, metalness] = further.map(|statement| statement.map(String::as_str));
    [diffuse, specular, alpha, bump, emission, normal, roughness, metalness]
}

/// A material being read.
struct Reading<'a, 'b> {
    definition: &'a Definition,
    number: u32,
    has_colors: bool,
    textures: &'b mut Textures,
    ledger: &'b mut Ledger,
}

impl<'a> Reading<'a, '_> {
    fn note(&mut self, treatment: Treatment, feature: impl Into<String>) {
        self.ledger.note_in(treatment, feature, Scope::Material(self.number));
    }

    fn read(mut self) -> Material {
        let source = &self.definition.source;
        for (treatment, statement) in &self.definition.statements {
            self.note(*treatment, statement.clone());
        }
        let phong = mtl::material(source);
        for approximation in &phong.approximations {
            self.note(Treatment::Approximated, *approximation);
        }

        let [diffuse, specular, alpha, bump, emission, normal, roughness, metalness] = maps(source);
        let diffuse = self.map(diffuse);
        let (alpha, with_alpha) = self.alpha(alpha, diffuse.as_ref(), phong.opacity);
        let diffuse_texture = diffuse.as_ref().map(|map| self.textures.color(map, with_alpha));
        let microfacet = self.metallic_roughness(&phong, roughness, metalness);
        let (opacity, neutral) = (phong.opacity, phong.material.emission);
        let (mut material, rule) = match microfacet {
            Some(model) => self.by_metallic_roughness(phong, model, diffuse_texture.as_ref()),
            None => self.by_phong(phong, specular),
        };
        material.diffuse_texture = diffuse_texture;
        let emission = self.map(emission).map(|map| self.textures.color(&map, false));
        if emission.is_some() && neutral == Rgb::ZERO {
            material.emission = Rgb::ONE;
        }
        let normal = self.normal_map(normal, bump);
        let mut detail = Detail { rule, emission, alpha, normal };
        match opacity.filter(|_| detail.alpha.is_none()) {
            Some(opacity) if detail == Detail::NONE => material = material.blended(opacity),
            Some(factor) => detail.alpha = Some(Alpha { mode: AlphaMode::Blend, factor, map: None }),
            None => {}
        }
        Material { detail: (detail != Detail::NONE).then(|| Box::new(detail)), ..material }
    }

    /// The map of a statement whose image is there; its options that are not used are told.
    fn map(&mut self, statement: Option<&'a str>) -> Option<Map<'a>> {
        let map = self.textures.map(&self.definition.folder, statement?, self.ledger)?;
        for option in &map.statement.unused {
            self.note(Treatment::Ignored, format!("texture option {option}"));
        }
        Some(map)
    }

    /// What is there of the surface, where an image tells; and whether that is the diffuse image's own alpha.
    fn alpha(
        &mut self,
        statement: Option<&'a str>,
        diffuse: Option<&Map<'a>>,
        opacity: Option<f32>,
    ) -> (Option<Alpha>, bool) {
        let Some(map) = self.map(statement) else { return (None, false) };
        let varies = || self.textures.image(&map).is_some_and(has_varying_alpha);
        let channel =
            map.statement.channel.unwrap_or_else(|| if varies() { Channel::Alpha } else { Channel::Luminance });
        let is_own = |diffuse: &&Map<'a>| {
            let (own, other) = (&map.statement, &diffuse.statement);
            diffuse.path == map.path && own.is_placed_as(other) && own.base_gain == other.base_gain
        };
        let is_own = channel == Channel::Alpha && diffuse.filter(is_own).is_some();
        let texture = (!is_own).then(|| (self.textures.data(&map), channel));
        (Some(Alpha { mode: AlphaMode::Blend, factor: opacity.unwrap_or(1.0), map: texture }), is_own)
    }

    fn by_phong(&mut self, phong: Phong, specular: Option<&'a str>) -> (Material, Rule) {
        let highlight = self.map(specular).map(|map| self.textures.color(&map, false));
        let material = phong.material;
        if highlight.is_none() && self.definition.source.specular.is_none() {
            // Only the image told where the highlight is.
            return (Material { ks: Rgb::ZERO, kr: Rgb::ZERO, ..material }, Rule::Phong { highlight });
        }
        if highlight.is_some() && material.kr != Rgb::ZERO {
            self.note(Treatment::Approximated, "map_Ks of a mirror: the highlight has it, the mirror does not");
        }
        (material, Rule::Phong { highlight })
    }

    /// What `Pr`, `Pm` and their maps say; `None` where there are none.
    fn metallic_roughness(
        &mut self,
        phong: &Phong,
        roughness: Option<&'a str>,
        metalness: Option<&'a str>,
    ) -> Option<MetallicRoughness> {
        let source = &self.definition.source;
        let number = |keyword| source.unknown_param.get(keyword).and_then(|text| text.parse::<f32>().ok());
        let (rough, metal) = (number("Pr"), number("Pm"));
        if rough.is_none() && metal.is_none() && roughness.is_none() && metalness.is_none() {
            return None;
        }
        if phong.is_glass {
            self.note(Treatment::Ignored, "Pr, Pm of glass (illum 4, 6, 7, 9)");
            return None;
        }
        if source.specular.is_some() || source.shininess.is_some() || source.specular_texture.is_some() {
            self.note(Treatment::Ignored, "Ks, Ns, map_Ks beside Pr or Pm: these are used");
        }
        if phong.material.kr != Rgb::ZERO {
            self.note(Treatment::Ignored, "illum of a mirror beside Pr or Pm: these are used");
        }
        let (rough_map, metal_map) = (self.map(roughness), self.map(metalness));
        if let (Some(rough), Some(metal)) = (&rough_map, &metal_map)
            && !rough.statement.is_placed_as(&metal.statement)
        {
            self.note(Treatment::Approximated, "map_Pm placed otherwise than map_Pr: placed as that");
        }
        Some(MetallicRoughness {
            base: phong.material.diffuse.clamp(Rgb::ZERO, Rgb::ONE),
            metallic: metal.unwrap_or(if metal_map.is_some() { 1.0 } else { 0.0 }).clamp(0.0, 1.0),
            roughness: rough.unwrap_or(1.0).clamp(0.0, 1.0),
            metallic_roughness: self.textures.packed(rough_map.as_ref(), metal_map.as_ref()),
            ior: source.optical_density.filter(|&index| index > 1.0).unwrap_or(MetallicRoughness::DEFAULT.ior),
            ..MetallicRoughness::DEFAULT
        })
    }

    /// The terms by glTF's rule: for the mean of images where they vary, and otherwise once and for all.
    fn by_metallic_roughness(
        &mut self,
        phong: Phong,
        model: MetallicRoughness,
        diffuse: Option<&TextureRef>,
    ) -> (Material, Rule) {
        let textures = &*self.textures;
        let mean = |texture: &TextureRef| textures.mean(texture);
        let base_varies = diffuse.is_some() || self.has_colors;
        // Without metal the base colour is in the diffuse term alone, which the image multiplies anyway.
        let varies = model.metallic_roughness.is_some() || (base_varies && model.metallic > 0.0);
        let color = if varies { diffuse.map_or(Vec4::ONE, mean).truncate() } else { Rgb::ONE };
        let material = Material {
            name: phong.material.name,
            emission: phong.material.emission,
            ior: model.ior,
            ..Material::default().with_phong_of(&model.surface(color, mean))
        };
        (material, if varies { Rule::MetallicRoughness(model) } else { Rule::Phong { highlight: None } })
    }

    fn normal_map(&mut self, normal: Option<&'a str>, bump: Option<&'a str>) -> Option<NormalMap> {
        if let Some(map) = self.map(normal) {
            if bump.is_some() {
                self.note(Treatment::Ignored, "map_Bump beside norm: that is used");
            }
            return Some(NormalMap { texture: self.textures.data(&map), scale: map.statement.bump as f32 });
        }
        let map = self.map(bump)?;
        if self.textures.image(&map).is_some_and(shows_normals) {
            self.note(Treatment::Approximated, "map_Bump with the colours of normals: read as norm");
            return Some(NormalMap { texture: self.textures.data(&map), scale: map.statement.bump as f32 });
        }
        Some(NormalMap { texture: self.textures.normals_of_heights(&map), scale: 1.0 })
    }
}
