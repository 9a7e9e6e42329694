//! glTF materials, as the Phong terms that come closest.

use std::collections::HashSet;

use ::gltf::json::material::{AlphaMode as SourceAlpha, Material as Source};
use ::gltf::json::mesh::Semantic;
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Root, Texture, texture};
use glam::Vec4;

use super::images::{Encoding, Textures};
use crate::formats::{Ledger, Scope, Treatment};
use crate::scene::detail::{Alpha, AlphaMode, Detail, MetallicRoughness, NormalMap, Rule, SpecularGlossiness};
use crate::scene::{Material, Rgb, TextureRef};

/// What materials are read with.
pub(super) struct MaterialReader<'a, 'b> {
    pub textures: &'b mut Textures<'a>,
    pub ledger: &'b mut Ledger,
    /// The materials of primitives whose vertices have colours.
    pub colored: &'b HashSet<usize>,
    /// Whether backs of single-sided materials are left out.
    pub cull_back_faces: bool,
}

/// A material being read.
struct Reading<'a, 'b, 'c> {
    reader: &'c mut MaterialReader<'a, 'b>,
    source: &'c Source,
    number: usize,
}

impl MaterialReader<'_, '_> {
    /// Reads a material. One whose numbers overflow becomes the neutral one, with a warning.
    pub fn read(&mut self, number: usize, source: &Source) -> Material {
        let name = source.name.clone().unwrap_or_else(|| format!("material {number}"));
        let single_sided = self.cull_back_faces && !source.double_sided;
        let mut reading = Reading { reader: self, source, number };
        // Light must find its way out of a solid.
        let single_sided = single_sided && !reading.is_solid();
        reading.note_what_is_plain();
        let material = if is_unlit(source) { reading.unlit() } else { reading.shaded() };
        let Material { emission, diffuse, specular, ks, kr, kt, absorption, .. } = &material;
        let colors = [emission, diffuse, specular, ks, kr, kt, absorption];
        if colors.iter().all(|color| color.is_finite()) && material.ior.is_finite() {
            return Material { name, single_sided, ..material };
        }
        reading.note(Treatment::Warning, "material with numbers out of range: neutral material used");
        Material { name, single_sided, ..Material::default() }
    }
}

/// The textures that reading a material will ask for.
pub(super) fn textures_of(source: &Source) -> impl Iterator<Item = Index<Texture>> {
    let lit = (!is_unlit(source)).then_some(source);
    let emits = source.emissive_factor.0.iter().any(|&channel| channel > 0.0);
    let specular_glossiness = specular_glossiness(source);
    let metallic = lit.filter(|_| specular_glossiness.is_none());
    let extensions = metallic.and_then(|source| source.extensions.as_ref());
    let specular = extensions.and_then(|extensions| extensions.specular.as_ref());
    let transmission = extensions.and_then(|extensions| extensions.transmission.as_ref());
    let infos = [
        base_texture(source),
        lit.and(specular_glossiness).and_then(|specular| specular.specular_glossiness_texture.as_ref()),
        metallic.and_then(|source| source.pbr_metallic_roughness.metallic_roughness_texture.as_ref()),
        lit.filter(|_| emits).and_then(|source| source.emissive_texture.as_ref()),
        specular.and_then(|specular| specular.specular_texture.as_ref()),
        specular.and_then(|specular| specular.specular_color_texture.as_ref()),
        transmission.and_then(|transmission| transmission.transmission_texture.as_ref()),
    ];
    let normal = lit.and_then(|source| source.normal_texture.as_ref());
    infos.into_iter().flatten().map(|info| info.index).chain(normal.map(|normal| normal.index))
}

/// The materials of primitives whose vertices have colours, by number; that of those without one follows the last.
pub(super) fn colored(root: &Root) -> HashSet<usize> {
    let has_colors = |key: &Checked<Semantic>| matches!(key, Checked::Valid(Semantic::Colors(0)));
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let colored = primitives.filter(|primitive| primitive.attributes.keys().any(has_colors));
    let default = root.materials.len();
    colored.map(|primitive| primitive.material.map_or(default, |material| material.value())).collect()
}

fn specular_glossiness(source: &Source) -> Option<&::gltf::json::extensions::material::PbrSpecularGlossiness> {
    source.extensions.as_ref()?.pbr_specular_glossiness.as_ref()
}

fn base_texture(source: &Source) -> Option<&texture::Info> {
    match specular_glossiness(source) {
        Some(specular) => specular.diffuse_texture.as_ref(),
        None => source.pbr_metallic_roughness.base_color_texture.as_ref(),
    }
}

/// Base colour and alpha factors.
fn base_factor(source: &Source) -> (Rgb, f32) {
    let [r, g, b, a] = match specular_glossiness(source) {
        Some(specular) => specular.diffuse_factor.0,
        None => source.pbr_metallic_roughness.base_color_factor.0,
    };
    (Rgb::new(r, g, b).clamp(Rgb::ZERO, Rgb::ONE), a.clamp(0.0, 1.0))
}

fn is_unlit(source: &Source) -> bool {
    source.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some())
}

impl Reading<'_, '_, '_> {
    fn note(&mut self, treatment: Treatment, feature: impl Into<String>) {
        self.reader.ledger.note_in(treatment, feature, Scope::Material(self.number as u32));
    }

    /// A texture that is there, and a line in the ledger.
    fn refer(&mut self, info: Option<&texture::Info>, encoding: Encoding, feature: &str) -> Option<TextureRef> {
        let info = info?;
        let found = self.reader.textures.refer(info, encoding, self.reader.ledger)?;
        self.note(Treatment::Honoured, feature);
        Some(found)
    }

    fn shaded(&mut self) -> Material {
        let (mut material, mut detail) = match specular_glossiness(self.source) {
            Some(_) => self.specular_glossiness(),
            None => self.metallic_roughness(),
        };
        let strength = self.source.extensions.as_ref().and_then(|extensions| extensions.emissive_strength.as_ref());
        let strength = strength.map_or(1.0, |strength| strength.emissive_strength.0);
        material.emission = Rgb::from_array(self.source.emissive_factor.0).max(Rgb::ZERO) * strength;
        if material.emission != Rgb::ZERO {
            detail.emission = self.refer(self.source.emissive_texture.as_ref(), Encoding::Srgb, "emissiveTexture");
            if self.source.emissive_texture.is_some() && detail.emission.is_none() {
                // Such a texture is black but for a few spots: without it nothing can be said of where the light is.
                material.emission = Rgb::ZERO;
            }
        }
        detail.normal = self.normal_map();
        self.finish(material, detail)
    }

    /// KHR_materials_unlit: the base colour as it is, whatever the lights.
    fn unlit(&mut self) -> Material {
        let color = base_factor(self.source).0;
        let diffuse_texture = self.refer(base_texture(self.source), self.base_encoding(), "baseColorTexture");
        let varies = diffuse_texture.is_some() || self.reader.colored.contains(&self.number);
        let rule = if varies { Rule::Unlit { color } } else { Rule::Phong { highlight: None } };
        let material = Material {
            ambient: Some(Rgb::ZERO),
            emission: color,
            diffuse: Rgb::ZERO,
            diffuse_texture,
            ior: 1.0,
            ..Material::default()
        };
        self.finish(material, Detail { rule, ..Detail::NONE })
    }

    fn metallic_roughness(&mut self) -> (Material, Detail) {
        let source = self.source;
        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.as_ref();
        let ior = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |ior| ior.ior.0);
        let specular = extensions.and_then(|e| e.specular.as_ref());
        let transmission = extensions.and_then(|e| e.transmission.as_ref());
        let model = MetallicRoughness {
            base: base_factor(source).0,
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            metallic_roughness: self.refer(
                pbr.metallic_roughness_texture.as_ref(),
                Encoding::Numbers,
                "metallicRoughnessTexture",
            ),
            ior,
            specular: specular.map_or(1.0, |specular| specular.specular_factor.0),
            specular_map: self.refer(
                specular.and_then(|specular| specular.specular_texture.as_ref()),
                Encoding::Numbers,
                "specularTexture",
            ),
            specular_color: specular.map_or(Rgb::ONE, |specular| Rgb::from_array(specular.specular_color_factor.0)),
            specular_color_map: self.refer(
                specular.and_then(|specular| specular.specular_color_texture.as_ref()),
                Encoding::Srgb,
                "specularColorTexture",
            ),
            transmission: transmission.map_or(0.0, |transmission| transmission.transmission_factor.0),
            transmission_map: self.refer(
                transmission.and_then(|transmission| transmission.transmission_texture.as_ref()),
                Encoding::Numbers,
                "transmissionTexture",
            ),
        };
        let diffuse_texture = self.refer(base_texture(source), self.base_encoding(), "baseColorTexture");
        // What is neither metal nor lets light through has its base colour in the diffuse term alone.
        let base_varies = diffuse_texture.is_some() || self.reader.colored.contains(&self.number);
        let is_simple = model.metallic == 0.0 && model.transmission == 0.0;
        let has_maps =
            [&model.metallic_roughness, &model.specular_map, &model.specular_color_map, &model.transmission_map]
                .into_iter()
                .any(Option::is_some);
        let mean = self.mean(diffuse_texture.as_ref());
        let rule = Rule::MetallicRoughness(model);
        let (material, rule) = self.by_rule(rule, mean, has_maps || (base_varies && !is_simple));
        let mut material = Material { diffuse_texture, ior: ior.max(1.0), ..material };
        if !self.is_solid() {
            // What is thin lets rays through unbent.
            material.ior = if transmission.is_some() { 1.0 } else { material.ior };
        } else if let Some(volume) = extensions.and_then(|extensions| extensions.volume.as_ref()) {
            // Beer's law: after the attenuation distance the attenuation colour is left of white.
            let distance = volume.attenuation_distance.0;
            if distance > 0.0 && distance < f32::INFINITY {
                let log = |channel: f32| -(libm::log(f64::from(channel.clamp(1e-6, 1.0))) / f64::from(distance)) as f32;
                material.absorption = Rgb::from_array(volume.attenuation_color.0.map(log));
            }
        }
        (material, Detail { rule, ..Detail::NONE })
    }

    /// KHR_materials_pbrSpecularGlossiness.
    fn specular_glossiness(&mut self) -> (Material, Detail) {
        let source = self.source;
        let specular = specular_glossiness(source).expect("asked before");
        self.note(
            Treatment::Approximated,
            "KHR_materials_pbrSpecularGlossiness: what reflects more than a dielectric counts as metal",
        );
        let map =
            self.refer(specular.specular_glossiness_texture.as_ref(), Encoding::Srgb, "specularGlossinessTexture");
        let model = SpecularGlossiness {
            diffuse: base_factor(source).0,
            specular: Rgb::from_array(specular.specular_factor.0),
            glossiness: specular.glossiness_factor.0,
            map,
        };
        let diffuse_texture = self.refer(base_texture(source), self.base_encoding(), "diffuseTexture");
        let mean = self.mean(diffuse_texture.as_ref());
        let (material, rule) = self.by_rule(Rule::SpecularGlossiness(model), mean, map.is_some());
        (Material { diffuse_texture, ..material }, Detail { rule, ..Detail::NONE })
    }

    /// A material with the terms that a rule gives: for the mean of its images where they vary, and otherwise once and
    /// for all.
    fn by_rule(&self, rule: Rule, mean: Vec4, varies: bool) -> (Material, Rule) {
        let texel = |texture: &TextureRef| self.reader.textures.mean(texture);
        let surface = |color: Rgb| match &rule {
            Rule::MetallicRoughness(model) => model.surface(color, texel),
            Rule::SpecularGlossiness(model) => model.surface(color, texel),
            Rule::Phong { .. } | Rule::Unlit { .. } => unreachable!("these are no microfacet models"),
        };
        if varies {
            (Material::default().with_phong_of(&surface(mean.truncate())), rule)
        } else {
            (Material::default().with_phong_of(&surface(Rgb::ONE)), Rule::Phong { highlight: None })
        }
    }

    /// Of a base texture: its alpha matters where the surface is masked or blended, and nowhere else.
    fn base_encoding(&self) -> Encoding {
        match self.source.alpha_mode {
            Checked::Valid(SourceAlpha::Blend | SourceAlpha::Mask) => Encoding::SrgbWithAlpha,
            _ => Encoding::Srgb,
        }
    }

    /// The mean of what a texture has.
    fn mean(&self, texture: Option<&TextureRef>) -> Vec4 {
        texture.map_or(Vec4::ONE, |texture| self.reader.textures.mean(texture))
    }

    fn normal_map(&mut self) -> Option<NormalMap> {
        let normal = self.source.normal_texture.as_ref()?;
        let transform =
            normal.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let info = texture::Info {
            index: normal.index,
            tex_coord: normal.tex_coord,
            extensions: transform.and_then(|transform| {
                let texture_transform = serde_json::from_value(transform.clone()).ok()?;
                Some(::gltf::json::extensions::texture::Info {
                    texture_transform: Some(texture_transform),
                    ..Default::default()
                })
            }),
            extras: Default::default(),
        };
        let texture = self.refer(Some(&info), Encoding::Numbers, "normalTexture")?;
        Some(NormalMap { texture, scale: normal.scale })
    }

    /// Adds what is there of the surface, and the detail where there is any.
    fn finish(&mut self, material: Material, mut detail: Detail) -> Material {
        let factor = base_factor(self.source).1;
        let mean = self.mean(material.diffuse_texture.as_ref()).w;
        let varies = mean < 1.0 || self.reader.colored.contains(&self.number);
        let mode = match self.source.alpha_mode {
            Checked::Valid(SourceAlpha::Blend) => Some(AlphaMode::Blend),
            Checked::Valid(SourceAlpha::Mask) => {
                Some(AlphaMode::Mask { cutoff: self.source.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0) })
            }
            _ => None,
        };
        let mut material = material;
        match mode {
            Some(AlphaMode::Blend) => self.note(Treatment::Honoured, "alphaMode BLEND"),
            Some(AlphaMode::Mask { .. }) => self.note(Treatment::Honoured, "alphaMode MASK"),
            None => {}
        }
        if mode == Some(AlphaMode::Blend) && !varies && factor > 0.0 {
            if detail == Detail::NONE {
                material = material.blended(factor);
            } else if factor < 1.0 {
                detail.alpha = Some(Alpha { mode: AlphaMode::Blend, factor, map: None });
            }
        } else if let Some(mode) = mode {
            detail.alpha = Some(Alpha { mode, factor, map: None });
        }
        Material { detail: (detail != Detail::NONE).then(|| Box::new(detail)), ..material }
    }

    /// Whether the surface bounds a solid that bends light: KHR_materials_volume with a thickness. Without, glTF means a
    /// thin wall, through which light goes straight.
    fn is_solid(&self) -> bool {
        let volume = self.source.extensions.as_ref().and_then(|extensions| extensions.volume.as_ref());
        volume.is_some_and(|volume| volume.thickness_factor.0 > 0.0)
    }

    /// Notes what is read as it is, or not at all.
    fn note_what_is_plain(&mut self) {
        let volume = self.source.extensions.as_ref().and_then(|extensions| extensions.volume.as_ref());
        if self.source.occlusion_texture.is_some() {
            self.note(Treatment::Ignored, "occlusionTexture: shadows are traced");
        }
        if volume.is_some_and(|volume| volume.thickness_texture.is_some()) {
            self.note(Treatment::Ignored, "thicknessTexture: the thickness of the mesh counts");
        }
        if !self.source.double_sided && !self.reader.cull_back_faces {
            self.note(
                Treatment::Honoured,
                "single-sided material: seen from both sides unless --cull-back-faces is given",
            );
        }
        if self.source.double_sided || self.reader.cull_back_faces {
            self.note(Treatment::Honoured, "doubleSided");
        }
    }
}
