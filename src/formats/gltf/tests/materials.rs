//! Materials, textures and images.

use glam::{DVec2, Vec2, Vec4};
use serde_json::json;

use super::super::uri::{Target, resolve};
use super::*;
use crate::scene::texture::{Filter, Texels, Wrap};
use crate::scene::{Rgb, TextureRef};

/// A PNG of 2 x 1 texels: pure red and black.
const RED_BLACK: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAA\
    AADElEQVR4nGP4zwACAAYBAQB/9VxdAAAAAElFTkSuQmCC";

#[test]
fn textures_are_decoded_once_and_read_as_their_samplers_say() {
    let mut file = File::default();
    let (position, uv) = (file.triangle(), file.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]]));
    let transform = json!({"KHR_texture_transform": {"scale": [2, 3], "offset": [0.5, 0.25], "texCoord": 1}});
    let model = file
        .load(json!({
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position, "TEXCOORD_1": uv}, "material": 0}]}],
            "images": [{"uri": RED_BLACK}, {"uri": "missing.png"}],
            "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9729}],
            "textures": [{"source": 0, "sampler": 0}, {"source": 0}, {"source": 1}],
            "materials": [
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": transform}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
                {"pbrMetallicRoughness": {"baseColorTexture": {"index": 2}}},
            ],
        }))
        .unwrap();
    let [first, second] = model.textures.as_slice() else { panic!("{} textures", model.textures.len()) };
    assert_eq!((first.wrap, first.filter), ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest));
    assert_eq!((second.wrap, second.filter), ([Wrap::Repeat, Wrap::Repeat], Filter::Linear));
    assert_eq!((first.levels.len(), second.levels.len()), (0, 1), "minFilter LINEAR has no mipmaps");
    let used = |material: usize| model.materials[material].diffuse_texture.map(|used| used.texture);
    assert_eq!([used(0), used(1), used(2), used(3)], [Some(0), Some(1), Some(0), None]);
    assert!(has_note(&model, Treatment::Warning, "images[1]"));

    // The texel that glTF reads at (u, v) is the one that we read at our coordinates.
    let mesh = &model.meshes[0];
    assert_eq!(mesh.second_uvs.as_deref().unwrap()[2], Vec2::new(0.0, 0.75));
    let reference = model.materials[0].diffuse_texture.unwrap();
    let ours = reference.place(mesh.second_uvs.as_deref().unwrap()[2].as_dvec2());
    let theirs = DVec2::new(0.0, 0.25) * DVec2::new(2.0, 3.0) + DVec2::new(0.5, 0.25);
    assert_eq!(ours, DVec2::new(theirs.x, 1.0 - theirs.y));
}

#[test]
fn images_may_lie_in_a_buffer() {
    let mut file = File::default();
    let position = file.triangle();
    let Target::Data(png) = resolve(RED_BLACK, &Default::default()).unwrap() else { panic!() };
    let view = file.view(&png);
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let model = file.load(rest).unwrap();
    let texture = &model.textures[0];
    assert_eq!((texture.width, texture.height), (2, 1));
    assert_eq!(texture.sample(DVec2::new(0.25, 0.5)), Rgb::X);
    // Half red, half black: the mean reflectance of the metal.
    let smooth = &model.materials[0];
    assert_eq!(smooth.specular, Rgb::X);
}

#[test]
fn images_of_numbers_and_of_light_are_read_texel_by_texel() {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"uri": RED_BLACK}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}},
        "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}}]);
    let model = file.load(rest).unwrap();
    let material = &model.materials[0];
    // Green and blue are 0: perfectly smooth and no metal.
    assert!((material.kr - 0.04).abs().max_element() < 1e-6 && material.diffuse == Rgb::ONE);
    let at = |u: f64| {
        let texel = |used: &TextureRef| {
            model.textures[used.texture as usize].sample_footprint(used.place(DVec2::new(u, 0.5)), 0.0)
        };
        material.at(Vec4::ONE, texel)
    };
    assert_eq!((at(0.25).emission, at(0.75).emission), (Rgb::X, Rgb::ZERO));
    assert!((at(0.25).kr - 0.04).abs().max_element() < 1e-6);
    assert!(
        matches!(model.textures[0].texels, Texels::Data8(_)) && matches!(model.textures[1].texels, Texels::Srgb8(_))
    );
}

#[test]
fn material_extensions_become_phong_terms() {
    let extension = |name: &str, value: Value, metallic: f32| {
        with_material(json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1], "metallicFactor": metallic,
            "roughnessFactor": 0}, "emissiveFactor": [0.5, 0, 0], "extensions": {name: value}}))
        .materials
        .remove(0)
    };
    let base = Rgb::new(0.5, 0.25, 1.0);
    let unlit = extension("KHR_materials_unlit", json!({}), 0.0);
    assert_eq!((unlit.emission, unlit.diffuse, unlit.ambient), (base, Rgb::ZERO, Some(Rgb::ZERO)));
    let bright = extension("KHR_materials_emissive_strength", json!({"emissiveStrength": 6}), 0.0);
    assert_eq!(bright.emission, Rgb::X * 3.0);
    let diamond = extension("KHR_materials_ior", json!({"ior": 2.0}), 0.0);
    assert!((diamond.kr - 1.0 / 9.0).abs().max_element() < 1e-7 && diamond.ior == 2.0);
    let tinted = json!({"specularFactor": 0.5, "specularColorFactor": [1, 4, 100]});
    let tinted = extension("KHR_materials_specular", tinted, 0.0);
    assert!((tinted.kr - Rgb::new(0.02, 0.08, 0.5)).abs().max_element() < 1e-6);
    let glass = extension("KHR_materials_transmission", json!({"transmissionFactor": 1}), 0.0);
    assert!((glass.kt - 0.96 * base).abs().max_element() < 1e-6 && glass.diffuse == Rgb::ZERO);
    assert_eq!(glass.ior, 1.0, "without a volume it is a thin wall");
    let shiny = json!({"diffuseFactor": [1, 1, 1, 1], "specularFactor": [0.5, 0, 0], "glossinessFactor": 1});
    let shiny = extension("KHR_materials_pbrSpecularGlossiness", shiny, 0.0);
    assert_eq!((shiny.kr, shiny.diffuse), (Rgb::X * 0.5, Rgb::splat(0.5)));
    assert_eq!(extension("KHR_materials_ior", json!({}), 1.0).kr, base, "a metal mirrors its colour");

    let solid = with_material(json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "extensions": {
        "KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"thicknessFactor": 1},
        "KHR_materials_ior": {"ior": 1.4}}}));
    assert!((solid.materials[0].ior - 1.4).abs() < 1e-6);
    let blend =
        with_material(json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.25]}}));
    assert_eq!((blend.materials[0].kt, blend.materials[0].ior), (Rgb::splat(0.75), 1.0));
    assert!(has_note(&blend, Treatment::Honoured, "BLEND"));
    assert!(has_note(&with_material(json!({"alphaMode": "MASK"})), Treatment::Honoured, "MASK"));
}

#[test]
fn a_blend_takes_the_alpha_of_each_texel() {
    // 2 x 1 texels whose alphas are 255 and 0.
    let half = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAYAAAD0In+KAA\
        AADElEQVR4nGP4DwEMACLmBvoI+gInAAAAAElFTkSuQmCC";
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"uri": half}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"alphaMode": "BLEND",
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5], "baseColorTexture": {"index": 0}}}]);
    let model = file.load(rest).unwrap();
    let with = |alpha: f32| move |_: &TextureRef| Vec4::new(1.0, 1.0, 1.0, alpha);
    assert_eq!(model.materials[0].at(Vec4::ONE, with(0.5)).kt, Rgb::splat(0.75));
    assert_eq!(model.materials[0].alpha_at(Vec4::ONE, with(0.0)), 0.0);
    assert!(has_note(&model, Treatment::Honoured, "BLEND"));
}

#[test]
fn texture_transforms_turn_scale_and_move() {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"uri": RED_BLACK}]);
    rest["textures"] = json!([{"source": 0}]);
    let turn = 0.4f64;
    let transform = json!({"rotation": turn, "scale": [2, 3], "offset": [0.5, 0.25], "texCoord": 2});
    let info = json!({"index": 0, "extensions": {"KHR_texture_transform": transform}});
    rest["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": info}}]);
    let model = file.load(rest).unwrap();
    assert!(has_note(&model, Treatment::Approximated, "TEXCOORD_1"), "set 2 is not read");
    let used = model.materials[0].diffuse_texture.unwrap();
    assert!(used.second_uvs);
    // The extension's own shader, in whose coordinates v goes down.
    let (sin, cos) = (f64::from(turn as f32).sin(), f64::from(turn as f32).cos());
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.25, 0.75)] {
        let (su, sv) = (2.0 * u, 3.0 * v);
        let theirs = DVec2::new(cos * su + sin * sv + 0.5, -sin * su + cos * sv + 0.25);
        let ours = used.place(DVec2::new(u, 1.0 - v));
        assert!((ours - DVec2::new(theirs.x, 1.0 - theirs.y)).abs().max_element() < 1e-12, "{ours} {theirs}");
    }
}

#[test]
fn a_volume_absorbs_by_beers_law() {
    let solid = |thickness: f32, distance: Option<f32>| {
        let mut volume = json!({"thicknessFactor": thickness, "attenuationColor": [0.5, 1, 0.25]});
        if let Some(distance) = distance {
            volume["attenuationDistance"] = json!(distance);
        }
        let transmission = json!({"transmissionFactor": 1});
        let extensions = json!({"KHR_materials_transmission": transmission, "KHR_materials_volume": volume});
        with_material(json!({ "extensions": extensions })).materials.remove(0)
    };
    let glass = solid(1.0, Some(2.0));
    // After the distance the colour is left.
    assert!((glass.left_after(2.0) - Rgb::new(0.5, 1.0, 0.25)).abs().max_element() < 1e-6);
    assert!((glass.left_after(4.0) - Rgb::new(0.25, 1.0, 0.0625)).abs().max_element() < 1e-6);
    assert!(!solid(0.0, Some(2.0)).is_absorbing(), "a thin wall has no inside");
    assert!(!solid(1.0, None).is_absorbing(), "without a distance it is clear");
}

#[test]
fn what_is_not_used_of_a_material_is_told() {
    let mut file = File::default();
    let position = file.triangle();
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["images"] = json!([{"uri": RED_BLACK}]);
    rest["textures"] = json!([{"source": 0}]);
    rest["materials"] = json!([{"occlusionTexture": {"index": 0}}, {"doubleSided": true}]);
    let json = file.json(rest);
    let load = |cull_back_faces| load_json(&json, &LoadOptions { cull_back_faces, ..LoadOptions::default() }).unwrap();
    let (both, front) = (load(false), load(true));
    assert!(has_note(&both, Treatment::Ignored, "occlusionTexture") && both.textures.is_empty());
    assert!(has_note(&both, Treatment::Honoured, "single-sided material"));
    let sides = |model: &Model| model.materials.iter().map(|material| material.single_sided).collect::<Vec<_>>();
    assert_eq!((sides(&both), sides(&front)), (vec![false, false], vec![true, false]));
}

#[test]
fn webp_images_stand_in_for_others() {
    let mut webp = Vec::new();
    let green = image::RgbImage::from_pixel(3, 2, image::Rgb([0, 255, 0]));
    green.write_to(&mut std::io::Cursor::new(&mut webp), image::ImageFormat::WebP).unwrap();
    let mut file = File::default();
    let position = file.triangle();
    let view = file.view(&webp);
    let mut rest = one(json!({"attributes": {"POSITION": position}, "material": 0}));
    rest["extensionsUsed"] = json!(["EXT_texture_webp"]);
    rest["extensionsRequired"] = json!(["EXT_texture_webp"]);
    rest["images"] = json!([{"bufferView": view, "mimeType": "image/webp"}]);
    rest["textures"] = json!([{"extensions": {"EXT_texture_webp": {"source": 0}}}]);
    rest["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    let model = file.load(rest).unwrap();
    assert_eq!((model.textures[0].width, model.textures[0].height), (3, 2));
    assert_eq!(model.textures[0].sample(DVec2::splat(0.5)), Rgb::Y);
}
