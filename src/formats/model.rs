//! What a model file holds, and how it becomes part of a scene.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::formats::Ledger;
use crate::geometry::mesh::Materials;
use crate::geometry::{Bounds, TriangleMesh};
use crate::math::transform::{apply, compose};
use crate::math::vector::length;
use crate::scene::extent::Extents;
use crate::scene::{Camera, Light, LightKind, Material, NamedCamera, Object, Projection, Scene, Shape, Texture};

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
    /// Whether the lights are in physical units.
    pub physical_lights: bool,
}

impl Model {
    /// Adds everything to a scene; the ledger, with the numbers that meshes and materials have there.
    pub fn append_to(self, scene: &mut Scene) -> Ledger {
        let (contents, ledger) = Imported::new(self).append_assets(scene, &mut Extents::default());
        scene.objects.extend(contents.objects);
        scene.cameras.extend(contents.cameras);
        scene.lights.extend(contents.lights);
        ledger
    }
}

/// A model that scenes are given, several of them and again and again: they share its meshes.
#[derive(Debug, Clone)]
pub struct Imported {
    meshes: Vec<Arc<TriangleMesh>>,
    /// Their boxes.
    bounds: Vec<Bounds>,
    /// The number that the first material has in the meshes.
    first_material: u32,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    contents: Contents,
    /// What was honoured, approximated and ignored, with the model's own numbers.
    pub ledger: Ledger,
}

impl Imported {
    /// A model's.
    pub fn new(model: Model) -> Self {
        let Model { meshes, materials, textures, objects, cameras, lights, physical_lights, ledger } = model;
        Self {
            bounds: meshes.iter().map(TriangleMesh::bounds).collect(),
            meshes: meshes.into_iter().map(Arc::new).collect(),
            first_material: 0,
            materials,
            textures,
            contents: Contents { objects, cameras, lights, physical_lights },
            ledger,
        }
    }

    /// Adds meshes, materials and textures to a scene, and the meshes' boxes to those of the scene's; what is to be placed in it, and
    /// the ledger, with the numbers that meshes and materials have there.
    ///
    /// Meshes are the same ones as last time if as many materials come before the model's.
    pub fn append_assets(&mut self, scene: &mut Scene, extents: &mut Extents) -> (Contents, Ledger) {
        let first_mesh = scene.meshes.len() as u32;
        let first_material = scene.materials.len() as u32;
        let first_texture = scene.textures.len() as u32;
        self.number_materials_from(first_material);
        scene.textures.extend(self.textures.iter().cloned());
        scene.materials.extend(self.materials.iter().cloned().map(|mut material| {
            material.textures_mut().for_each(|texture| texture.texture += first_texture);
            material
        }));
        scene.meshes.extend(self.meshes.iter().cloned());
        extents.add(&self.bounds);
        let mut contents = self.contents.clone();
        for object in &mut contents.objects {
            if let Shape::Mesh(mesh) = &mut object.shape {
                *mesh += first_mesh;
            }
            object.material = object.material.map(|material| material + first_material);
        }
        let mut ledger = self.ledger.clone();
        ledger.shift(first_material, first_mesh);
        (contents, ledger)
    }

    fn number_materials_from(&mut self, first: u32) {
        if self.first_material == first {
            return;
        }
        let shifted = |material: u32| material - self.first_material + first;
        for mesh in &mut self.meshes {
            match &mut Arc::make_mut(mesh).materials {
                Materials::One(material) => *material = shifted(*material),
                Materials::PerTriangle(each) => each.iter_mut().for_each(|material| *material = shifted(*material)),
            }
        }
        self.first_material = first;
    }
}

impl Contents {
    /// Everything moved by `transform`. Fields of view, cone angles and the intensities of lights stay; the height of
    /// an orthographic camera is scaled as its up vector is.
    pub fn transformed(mut self, transform: &DAffine3) -> Self {
        if *transform == DAffine3::IDENTITY {
            return self;
        }
        let vector = |v: DVec3| apply(&transform.matrix3, v);
        let point = |p: DVec3| vector(p) + transform.translation;
        for object in &mut self.objects {
            object.transform = compose(transform, &object.transform);
        }
        for named in &mut self.cameras {
            match &mut named.camera {
                Camera::LookAt { eye, target, up, projection } => {
                    if let Projection::Orthographic { height } = projection {
                        *height *= length(vector(*up)) / length(*up);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::texture::Texels;
    use crate::scene::{Falloff, Rgb, TextureRef};

    #[test]
    fn appended_numbers_are_shifted_together() {
        let texture = |name: &str| Texture::new(name, 1, 1, Texels::Srgb8(vec![[0; 4]].into()));
        let material = Material { diffuse_texture: Some(TextureRef::new(0)), ..Default::default() };
        let mesh = |materials| TriangleMesh { materials, ..Default::default() };
        let object = |mesh| Object {
            name: String::new(),
            shape: Shape::Mesh(mesh),
            transform: DAffine3::IDENTITY,
            material: Some(1),
        };
        let model = Model {
            meshes: vec![mesh(Materials::One(1)), mesh(Materials::PerTriangle(vec![0, 1].into()))],
            materials: vec![Material::default(), material],
            textures: vec![texture("a")],
            objects: vec![object(1)],
            ..Default::default()
        };
        let mut scene = Scene::default();
        model.clone().append_to(&mut scene);
        model.append_to(&mut scene);
        assert_eq!(
            scene.objects.iter().map(|o| (o.shape, o.material)).collect::<Vec<_>>(),
            [(Shape::Mesh(1), Some(2)), (Shape::Mesh(3), Some(4)),]
        );
        assert_eq!(scene.meshes[2].materials, Materials::One(4));
        assert_eq!(scene.meshes[3].materials, Materials::PerTriangle(vec![3, 4].into()));
        assert_eq!(scene.materials[4].diffuse_texture, Some(TextureRef::new(1)));
    }

    #[test]
    fn cameras_and_lights_move_with_their_model() {
        let projection = Projection::Orthographic { height: 3.0 };
        let camera = Camera::LookAt { eye: DVec3::Z, target: DVec3::ZERO, up: DVec3::Y, projection };
        let kind = LightKind::Spot {
            position: DVec3::X,
            direction: DVec3::NEG_Y,
            inner_angle: 0.1,
            outer_angle: 0.2,
            falloff: Falloff::None,
        };
        let contents = Contents {
            cameras: vec![NamedCamera::new("c", camera)],
            lights: vec![Light { name: "l".into(), kind, color: Rgb::ONE }],
            ..Default::default()
        };
        let shift = DVec3::new(1e9, 0.0, 0.0);
        let moved = contents
            .transformed(&DAffine3 { matrix3: glam::DMat3::from_diagonal(DVec3::splat(2.0)), translation: shift });
        let projection = Projection::Orthographic { height: 6.0 };
        let camera = Camera::LookAt { eye: shift + DVec3::Z * 2.0, target: shift, up: DVec3::Y * 2.0, projection };
        assert_eq!(moved.cameras[0].camera, camera);
        let LightKind::Spot { position, direction, .. } = moved.lights[0].kind else { panic!() };
        assert_eq!((position, direction), (shift + DVec3::X * 2.0, DVec3::Y * -2.0));
    }
}
