//! What there is to see, as plain data without input or output: every loader makes it, the renderer reads it.

pub mod auto;
pub mod background;
pub mod camera;
pub mod camera_path;
pub mod compiled;
pub mod detail;
pub mod exposure;
pub mod extent;
pub mod film;
pub mod light;
pub mod material;
pub mod microfacet;
pub mod needs;
pub mod object;
pub mod origin;
mod outline;
pub mod quantize;
pub mod room;
pub mod texture;

use std::sync::Arc;

pub use background::Background;
pub use camera::{Camera, NamedCamera, Projection};
pub use camera_path::{CameraKey, CameraPath};
pub use film::{Clamp, FilmSettings, Transfer};
pub use light::{Falloff, Light, LightKind};
pub use material::{Material, TextureRef};
pub use object::{Object, Shape};
pub use texture::Texture;

use glam::DVec3;

use crate::geometry::mesh::Materials;
use crate::geometry::{Quadric, TriangleMesh};

/// A linear colour or weight, red, green, blue (Rec. 709 primaries).
pub type Rgb = glam::Vec3;

/// Luminance of a linear colour (Rec. 709).
pub fn luminance(color: Rgb) -> f64 {
    0.2126 * f64::from(color.x) + 0.7152 * f64::from(color.y) + 0.0722 * f64::from(color.z)
}

/// A whole scene.
///
/// Positions of cameras and lights and the transforms of objects are f64 in the file's coordinates; they are made
/// relative to [`origin`](Self::origin) when the scene is built.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Where the renderer's f32 world has its zero, in the file's coordinates.
    pub origin: DVec3,
    /// Scene-wide ambient factor: materials without an ambient colour of their own have this times their base colour.
    pub ambient: Rgb,
    /// What rays that hit nothing see.
    pub background: Background,
    /// All cameras; never empty once a loader returned it.
    pub cameras: Vec<NamedCamera>,
    /// Which camera to render through.
    pub active_camera: usize,
    /// Picture size, samples, depth, clamp and encoding.
    pub film: FilmSettings,
    /// Lights, in file order.
    pub lights: Vec<Light>,
    /// Materials that meshes and objects refer to by position; never empty.
    pub materials: Vec<Material>,
    /// Images that materials refer to by position.
    pub textures: Vec<Texture>,
    /// Meshes that objects refer to by position.
    pub meshes: Vec<Arc<TriangleMesh>>,
    /// Quadrics that objects refer to by position.
    pub quadrics: Vec<Quadric>,
    /// What there is to hit, in file order: an object's position is its instance number.
    pub objects: Vec<Object>,
}

impl Default for Scene {
    /// An empty scene with one neutral material and no camera.
    fn default() -> Self {
        Self {
            origin: DVec3::ZERO,
            ambient: Rgb::splat(0.1),
            background: Background::default(),
            cameras: Vec::new(),
            active_camera: 0,
            film: FilmSettings::default(),
            lights: Vec::new(),
            materials: vec![Material::default()],
            textures: Vec::new(),
            meshes: Vec::new(),
            quadrics: Vec::new(),
            objects: Vec::new(),
        }
    }
}

impl Scene {
    /// The camera to render through.
    ///
    /// # Panics
    /// If the scene has no camera; loaders always give one.
    pub fn camera(&self) -> &Camera {
        &self.cameras[self.active_camera].camera
    }

    /// The material at a hit, as a position in `materials`: the object's own, else the triangle's, else the first.
    #[inline]
    pub fn material_of(&self, instance: u32, primitive: u32) -> u32 {
        let object = &self.objects[instance as usize];
        object.material.unwrap_or_else(|| match object.shape {
            Shape::Mesh(mesh) => self.meshes[mesh as usize].material(primitive),
            Shape::Quadric(_) => 0,
        })
    }

    /// Which materials some object or triangle refers to, by position.
    pub fn used_materials(&self) -> Vec<bool> {
        self.materials_used_by(self.objects.iter())
    }

    /// Which materials these of the scene's objects, or their triangles, refer to, by position.
    pub fn materials_used_by<'a>(&self, objects: impl Iterator<Item = &'a Object>) -> Vec<bool> {
        let mut used = vec![false; self.materials.len()];
        for object in objects {
            match (object.material, object.shape) {
                (Some(material), _) => used[material as usize] = true,
                (None, Shape::Mesh(mesh)) => {
                    let mesh = &self.meshes[mesh as usize];
                    mesh.live_triangles().for_each(|number| used[mesh.material(number) as usize] = true);
                }
                (None, Shape::Quadric(_)) => used[0] = true,
            }
        }
        used
    }

    /// Whether every number that names something names what there is, and settings are within their limits. What meshes say of
    /// themselves is for [`TriangleMesh::check_numbers`].
    ///
    /// # Errors
    /// Says what names something that is not there.
    pub fn check_numbers(&self) -> Result<(), String> {
        let names = |is_there: bool, what: &str, of: &str| {
            if is_there { Ok(()) } else { Err(format!("{of} names a {what} that is not there")) }
        };
        names(self.active_camera < self.cameras.len(), "camera", "the scene")?;
        names(!self.materials.is_empty(), "material", "the scene")?;
        for material in &self.materials {
            let mut textures = material.textures();
            let is_there = textures.all(|texture| (texture.texture as usize) < self.textures.len());
            names(is_there, "texture", &format!("the material `{}`", material.name))?;
        }
        let is_material = |number: u32| (number as usize) < self.materials.len();
        for object in &self.objects {
            let is_there = match object.shape {
                Shape::Mesh(number) => (number as usize) < self.meshes.len(),
                Shape::Quadric(number) => (number as usize) < self.quadrics.len(),
            };
            names(is_there, "shape", &format!("the object `{}`", object.name))?;
            names(object.material.is_none_or(is_material), "material", &format!("the object `{}`", object.name))?;
        }
        for mesh in &self.meshes {
            let is_there = match &mesh.materials {
                Materials::One(material) => is_material(*material),
                Materials::PerTriangle(materials) => materials.iter().all(|&material| is_material(material)),
            };
            names(is_there, "material", &format!("the mesh `{}`", mesh.name))?;
        }
        self.film.check().map_err(|error| error.to_string())
    }

    /// Number of triangles with every instance counted, dropped ones left out.
    pub fn instanced_triangles(&self) -> u64 {
        let count = |object: &Object| match object.shape {
            Shape::Mesh(mesh) => self.meshes[mesh as usize].live_count() as u64,
            Shape::Quadric(_) => 0,
        };
        self.objects.iter().map(count).sum()
    }
}
