//! What a scene uses, counted once after loading: the renderer pays for nothing else, and `info` prints it.

use crate::scene::{Background, Scene, Shape};

/// The features that a scene uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Needs {
    /// Objects made of triangles.
    pub mesh_objects: u64,
    /// Objects that are quadrics.
    pub quadric_objects: u64,
    /// Quadrics without a bounding box.
    pub unbounded_quadrics: u64,
    /// Objects that are moved, turned or scaled.
    pub transformed_objects: u64,
    /// Meshes with shading normals.
    pub smooth_meshes: u64,
    /// Meshes with texture coordinates.
    pub uv_meshes: u64,
    /// Materials in use that have a texture.
    pub textured_materials: u64,
    /// Materials in use that mirror.
    pub reflective_materials: u64,
    /// Materials in use that let light through: shadow rays through them are attenuated, not blocked.
    pub transmissive_materials: u64,
    /// Materials in use whose surface is not everywhere, or shown by its alpha, or only from the front.
    pub materials_with_holes: u64,
    /// Materials in use whose terms differ from point to point beside the diffuse texture.
    pub detailed_materials: u64,
    /// Materials in use with a normal map.
    pub normal_mapped_materials: u64,
    /// Meshes whose vertices have colours.
    pub colored_meshes: u64,
    /// Lights.
    pub lights: u64,
    /// Whether the background is an image.
    pub background_image: bool,
}

impl Needs {
    /// Counts what `scene` uses. A material counts if some object or triangle refers to it.
    pub fn of(scene: &Scene) -> Self {
        let mut needs = Self { lights: scene.lights.len() as u64, ..Self::default() };
        for object in &scene.objects {
            needs.transformed_objects += u64::from(object.transform != glam::DAffine3::IDENTITY);
            match object.shape {
                Shape::Mesh(_) => needs.mesh_objects += 1,
                Shape::Quadric(quadric) => {
                    needs.quadric_objects += 1;
                    needs.unbounded_quadrics += u64::from(scene.quadrics[quadric as usize].bounds().is_none());
                }
            }
        }
        for (material, _) in scene.materials.iter().zip(scene.used_materials()).filter(|(_, used)| *used) {
            needs.textured_materials += u64::from(material.textures().next().is_some());
            needs.materials_with_holes += u64::from(material.has_holes());
            needs.detailed_materials += u64::from(material.detail.is_some());
            let normal = material.detail.as_ref().and_then(|detail| detail.normal.as_ref());
            needs.normal_mapped_materials += u64::from(normal.is_some());
            needs.reflective_materials += u64::from(material.is_reflective());
            needs.transmissive_materials += u64::from(material.is_transmissive());
        }
        needs.smooth_meshes = scene.meshes.iter().filter(|mesh| mesh.normals.is_some()).count() as u64;
        needs.uv_meshes = scene.meshes.iter().filter(|mesh| mesh.uvs.is_some()).count() as u64;
        needs.colored_meshes = scene.meshes.iter().filter(|mesh| mesh.colors.is_some()).count() as u64;
        needs.background_image = matches!(scene.background, Background::Image { .. });
        needs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shapes;
    use crate::scene::{Material, Object, Rgb};

    #[test]
    fn only_materials_in_use_count() {
        let glass = Material { kt: Rgb::ONE, ..Material::default() };
        let mirror = Material { kr: Rgb::ONE, ..Material::default() };
        let object = Object {
            name: "plane".into(),
            shape: Shape::Quadric(0),
            transform: glam::DAffine3::IDENTITY,
            material: Some(1),
        };
        let scene = Scene {
            materials: vec![glass, mirror],
            quadrics: vec![shapes::plane(None)],
            objects: vec![object],
            ..Scene::default()
        };
        let needs = Needs::of(&scene);
        assert_eq!((needs.reflective_materials, needs.transmissive_materials), (1, 0));
        assert_eq!((needs.quadric_objects, needs.unbounded_quadrics, needs.transformed_objects), (1, 1, 0));
    }
}
