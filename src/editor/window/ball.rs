//! A small ray-traced sphere of a material.

use eframe::egui::{self, Ui};
use glam::{DAffine3, DVec3};

use crate::accel::Params;
use crate::error::Result;
use crate::formats::picture::{exposure_factor, pixel_bytes};
use crate::geometry::shapes;
use crate::progress::Silent;
use crate::render::{RenderSettings, Renderer};
use crate::scene::{
    Background, Camera, FilmSettings, Light, LightKind, Material, NamedCamera, Object, Projection, Rgb, Scene, Shape,
};

/// Side of the picture, in pixels.
const SIDE: u32 = 112;

/// The picture of the material that was last shown.
#[derive(Default)]
pub struct Ball {
    shown: Option<(Material, egui::TextureHandle)>,
}

impl Ball {
    /// Shows a material; the picture is made again when it differs.
    pub fn show(&mut self, ui: &mut Ui, material: &Material) {
        if self.shown.as_ref().is_none_or(|(known, _)| known != material) {
            let Ok(pixels) = picture(material) else { return };
            let image = egui::ColorImage::from_rgba_unmultiplied([SIDE as usize; 2], pixels.as_flattened());
            let texture = ui.ctx().load_texture("material", image, egui::TextureOptions::LINEAR);
            self.shown = Some((material.clone(), texture));
        }
        if let Some((_, texture)) = &self.shown {
            ui.add(
                egui::Image::new((texture.id(), egui::Vec2::splat(SIDE as f32))).alt_text("the material on a sphere"),
            );
        }
    }
}

/// A sphere of a material, without its images, on a floor of two greys.
fn picture(material: &Material) -> Result<Vec<[u8; 4]>> {
    let plain = Material { diffuse_texture: None, detail: None, ..material.clone() };
    let grey = |level: f32| Material { diffuse: Rgb::splat(level), ..Material::default() };
    let eye = DVec3::new(0.0, 1.2, 4.5);
    let camera =
        Camera::LookAt { eye, target: DVec3::ZERO, up: DVec3::Y, projection: Projection::Perspective { fov_y: 0.55 } };
    let place = |shape: u32, material: u32, translation: DVec3| Object {
        name: String::new(),
        shape: Shape::Quadric(shape),
        transform: DAffine3::from_translation(translation),
        material: Some(material),
    };
    let tiles = [(-1.0, 2), (1.0, 3)].into_iter().flat_map(|(x, first)| {
        [(-1.0, first), (1.0, 5 - first)].map(|(z, material)| place(1, material, DVec3::new(x, -1.0, z)))
    });
    let scene = Scene {
        background: Background::Gradient { bottom: Rgb::splat(0.2), top: Rgb::new(0.5, 0.6, 0.8), up: DVec3::Y },
        cameras: vec![NamedCamera::new("ball", camera)],
        film: FilmSettings { width: SIDE, height: SIDE, samples: 4, ..FilmSettings::default() },
        lights: vec![Light {
            name: String::new(),
            kind: LightKind::Directional { direction: DVec3::new(-1.0, -1.6, -1.2) },
            color: Rgb::splat(0.9),
        }],
        materials: vec![Material::default(), plain, grey(0.6), grey(0.25)],
        quadrics: vec![shapes::sphere(), shapes::plane(Some(1.0))],
        objects: std::iter::once(place(0, 1, DVec3::ZERO)).chain(tiles).collect(),
        ..Scene::default()
    };
    let film = Renderer::build(scene, &Params::default(), &Silent)?
        .render(&RenderSettings { threads: 1, ..RenderSettings::default() }, &Silent)?;
    let exposure = exposure_factor(&film.settings);
    Ok(film.color.iter().map(|color| pixel_bytes(color, None, exposure, film.settings.transfer)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sphere_has_the_materials_colour_before_a_checked_floor() {
        let red = Material { diffuse: Rgb::new(0.8, 0.05, 0.05), ..Material::default() };
        let pixels = picture(&red).unwrap();
        let at = |x: u32, y: u32| pixels[(y * SIDE + x) as usize];
        let middle = at(SIDE / 2, SIDE / 2);
        assert!(middle[0] > 2 * middle[1], "{middle:?}");
        let floor: std::collections::BTreeSet<u8> = (0..SIDE).map(|x| at(x, SIDE - 4)[0]).collect();
        assert!(floor.len() > 1, "two greys");
    }
}
