//! What a model file holds, and how it becomes part of a scene.

use glam::{DAffine3, DVec3};

use crate::formats::Ledger;
use crate::geometry::TriangleMesh;
use crate::geometry::mesh::Materials;
use crate::math::transform::compose;
use crate::scene::{Camera, Light, LightKind, Material, NamedCamera, Object, Scene, Shape, Texture};

/// What a model file holds. Positions in its lists are local to it; [`Material`]s, [`Texture`]s and meshes are appended
/// to a scene's lists by [`Model::append_to`].
#[derive(Debug, Clone, Default)]
pub struct Model {
    /// Meshes, finished.
    pub meshes: Vec<TriangleMesh>,
    /// Materials that meshes refer to; never empty.
    pub materials: Vec<Material>,
    /// Images that materials refer to.
    pub textures: Vec<Texture>,
    /// Placed meshes, in file order.
    pub objects: Vec<Object>,
    /// Cameras, in file order.
    pub cameras: Vec<NamedCamera>,
    /// Lights, in file order.
    pub lights: Vec<Light>,
    /// Whether the lights are in physical units (candela, lux), so that a picture needs an exposure.
    pub physical_lights: bool,
    /// What was honoured, approximated and ignored.
    pub ledger: Ledger,
}

/// What a model places in a scene, with the numbers that its meshes and materials have there.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    /// Placed meshes, in file order.
    pub objects: Vec<Object>,
    /// Cameras, in file order.
    pub cameras: Vec<NamedCamera>,
    /// Lights, in file order.
    pub lights: Vec<Light>,
}

impl Model {
    /// Adds everything to a scene; the ledger is dropped.
    pub fn append_to(self, scene: &mut Scene) {
        let mut contents = self.append_assets(scene);
        scene.objects.append(&mut contents.objects);
        scene.cameras.append(&mut contents.cameras);
        scene.lights.append(&mut contents.lights);
    }

    /// Adds meshes, materials and textures to a scene and returns what is to be placed in it.
    pub fn append_assets(self, scene: &mut Scene) -> Contents {
        let first_mesh = scene.meshes.len() as u32;
        let first_material = scene.materials.len() as u32;
        let first_texture = scene.textures.len() as u32;
        scene.textures.extend(self.textures);
        scene.materials.extend(self.materials.into_iter().map(|mut material| {
            if let Some(texture) = &mut material.diffuse_texture {
                texture.texture += first_texture;
            }
            material
        }));
        scene.meshes.extend(self.meshes.into_iter().map(|mut mesh| {
            match &mut mesh.materials {
                Materials::One(material) => *material += first_material,
                Materials::PerTriangle(materials) => materials.iter_mut().for_each(|m| *m += first_material),
            }
            mesh
        }));
        let objects = self.objects.into_iter().map(|mut object| {
            if let Shape::Mesh(mesh) = &mut object.shape {
                *mesh += first_mesh;
            }
            object.material = object.material.map(|material| material + first_material);
            object
        });
        Contents { objects: objects.collect(), cameras: self.cameras, lights: self.lights }
    }
}

impl Contents {
    /// Everything moved by `transform`. Fields of view, cone angles and the intensities of lights stay; the height of
    /// an orthographic camera is scaled as its up vector is.
    pub fn transformed(mut self, transform: &DAffine3) -> Self {
        if *transform == DAffine3::IDENTITY {
            return self;
        }
        let point = |p: DVec3| compose(transform, &DAffine3::from_translation(p)).translation;
        let vector = |v: DVec3| point(v) - transform.translation;
        for object in &mut self.objects {
            object.transform = compose(transform, &object.transform);
        }
        for named in &mut self.cameras {
            match &mut named.camera {
                Camera::LookAt { eye, target, up, projection } => {
                    if let crate::scene::Projection::Orthographic { height } = projection {
                        *height *= vector(*up).length() / up.length();
                    }
                    (*eye, *target, *up) = (point(*eye), point(*target), vector(*up));
                }
                Camera::FourPoint { viewpoint, lower_left, lower_right, upper_left } => {
                    for corner in [viewpoint, lower_left, lower_right, upper_left] {
                        *corner = point(*corner);
                    }
                }
            }
        }
        for light in &mut self.lights {
            match &mut light.kind {
                LightKind::Point { position, .. } => *position = point(*position),
                LightKind::Directional { direction } => *direction = vector(*direction),
                LightKind::Spot { position, direction, .. } => {
                    (*position, *direction) = (point(*position), vector(*direction));
                }
            }
        }
        self
    }
}
