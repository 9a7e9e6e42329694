//! `[[material]]`, and `[[override]]`, which changes single fields of an imported one.

use glam::DVec2;

use crate::error::Result;
use crate::formats::scene_file::read::Reader;
use crate::formats::scene_file::value::{Fields, Value};
use crate::scene::detail::{Detail, Rule};
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{Material, Rgb, TextureRef};

/// The fields that materials and overrides share.
const FIELDS: [&str; 14] = [
    "ambient",
    "emission",
    "diffuse",
    "texture",
    "specular",
    "ks",
    "shininess",
    "kr",
    "kt",
    "opacity",
    "ior",
    "absorption",
    "flat",
    "name",
];

/// Those that glTF's models of surfaces give.
const TERMS: [&str; 7] = ["diffuse", "specular", "ks", "shininess", "kr", "kt", "opacity"];

/// Weights that sum to 1 in the file may exceed it by their rounding to f32.
const WEIGHT_ROUNDING: f32 = 2.0 * f32::EPSILON;

/// A material of the scene's own.
pub fn read_material(fields: &Fields<'_>, reader: &mut Reader<'_>) -> Result<Material> {
    fields.accept(&FIELDS)?;
    let name = fields.require("name")?.name()?.to_owned();
    let mut material = Material { name, ..Default::default() };
    // In the seed the weight of the highlight is the mirror's too.
    material.kr = fields.or("ks", material.kr, Value::weight)?;
    change(&mut material, fields, reader)?;
    Ok(material)
}

/// What an override does, given the material as imported. The name was looked up by the caller.
pub fn read_override(fields: &Fields<'_>, imported: &Material, reader: &mut Reader<'_>) -> Result<Material> {
    let own: Vec<&str> = FIELDS.iter().copied().filter(|&key| key != "name").chain(["material"]).collect();
    fields.accept(&own)?;
    let mut material = imported.clone();
    if let Some(mut detail) = material.detail.take() {
        // What is set by hand is not computed from images; the rest is what the model says without them.
        if let Some(surface) = detail.rule.plain_surface()
            && TERMS.iter().any(|key| fields.has(key))
        {
            detail.rule = Rule::Phong { highlight: None };
            material = material.with_phong_of(&surface);
        }
        if matches!(detail.rule, Rule::Unlit { .. }) && fields.has("emission") {
            detail.rule = Rule::Phong { highlight: None };
        }
        if fields.has("kt") || fields.has("opacity") {
            detail.alpha = None;
        }
        material.detail = (*detail != Detail::NONE).then_some(detail);
    }
    change(&mut material, fields, reader)?;
    Ok(material)
}

/// Sets the fields that are given.
fn change(material: &mut Material, fields: &Fields<'_>, reader: &mut Reader<'_>) -> Result<()> {
    if let Some(ambient) = fields.get("ambient") {
        material.ambient = Some(ambient.weight()?);
    }
    material.emission = fields.or("emission", material.emission, Value::weight)?;
    material.diffuse = fields.or("diffuse", material.diffuse, Value::weight)?;
    material.specular = fields.or("specular", material.specular, Value::weight)?;
    material.ks = fields.or("ks", material.ks, Value::weight)?;
    material.kr = fields.or("kr", material.kr, Value::weight)?;
    material.kt = fields.or("kt", material.kt, Value::weight)?;
    if let Some(opacity) = fields.get("opacity") {
        if fields.has("kt") {
            return Err(opacity.error("`opacity` and `kt` say the same").remedy("keep one: kt = 1 - opacity"));
        }
        let weight = opacity.weight()?;
        if weight.max_element() > 1.0 {
            return Err(opacity.error("`opacity` must not exceed 1"));
        }
        material.kt = Rgb::ONE - weight;
    }
    material.shininess = fields.or("shininess", f64::from(material.shininess), |v| v.between(0.0..=1e6))? as f32;
    material.ior = fields.or("ior", f64::from(material.ior), |value| value.between(0.01..=100.0))? as f32;
    material.absorption = fields.or("absorption", material.absorption, Value::weight)?;
    material.flat = fields.or("flat", material.flat, Value::boolean)?;
    if let Some(texture) = fields.get("texture") {
        material.diffuse_texture = read_texture(&texture, reader)?;
    }
    check_weights(material, fields)
}

/// Mirror and transmission together must not make light.
fn check_weights(material: &Material, fields: &Fields<'_>) -> Result<()> {
    let sum = (material.kr + material.kt).max_element();
    if sum > 1.0 + WEIGHT_ROUNDING {
        let message = format!("`kr` + `kt` is {sum} in a channel, more than 1 (`kr` is `ks` unless given)");
        let culprit = ["kr", "kt", "opacity", "ks"].iter().find_map(|key| fields.get(key));
        return Err(match culprit {
            Some(value) => value.error(message),
            None => fields.error(message),
        });
    }
    Ok(())
}

/// "file", `{ file, scale, offset, wrap, filter }`, or false for none.
fn read_texture(value: &Value<'_>, reader: &mut Reader<'_>) -> Result<Option<TextureRef>> {
    if value.is_string() {
        let texture = reader.image(value)?;
        return Ok(Some(TextureRef::new(reader.add_texture(texture))));
    }
    if !value.is_table() {
        let wanted = value.boolean().map_err(|_| value.error("`texture` must be a file, a table or false"))?;
        return match wanted {
            false => Ok(None),
            true => Err(value.error("`texture` must be a file, a table or false")),
        };
    }
    let fields = value.table("a texture")?;
    fields.accept(&["file", "scale", "offset", "wrap", "filter"])?;
    let mut texture = reader.image(&fields.require("file")?)?;
    let words = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
    texture.wrap = fields.or("wrap", texture.wrap, |value| match value.is_list() {
        false => value.choice(&words).map(|wrap| [wrap; 2]),
        true => match value.list()?.as_slice() {
            [u, v] => Ok([u.choice(&words)?, v.choice(&words)?]),
            _ => Err(value.error("`wrap` must be one word, or two: along u and along v")),
        },
    })?;
    let filters = [("linear", Filter::Linear), ("nearest", Filter::Nearest)];
    texture.filter = fields.or("filter", texture.filter, |value| value.choice(&filters))?;
    let scale = fields.or("scale", DVec2::ONE, Value::pair)?;
    let offset = fields.or("offset", DVec2::ZERO, Value::pair)?;
    Ok(Some(TextureRef::scaled(reader.add_texture(texture), scale, offset)))
}
