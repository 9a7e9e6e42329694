//! The scene's objects and lights made relative to its origin and ready for rays: transforms with inverses, world
//! boxes.

use glam::{DAffine3, DMat3, DVec3};

use crate::error::{Error, Result};
use crate::geometry::mesh::Materials;
use crate::geometry::ray::Interval;
use crate::geometry::{Bounds, PreparedRay, TriangleMesh};
use crate::math::Transform;
use crate::render::shadow::PreparedLight;
use crate::scene::camera::Pixels;
use crate::scene::{Material, Rgb, Scene, Shape, compiled};

/// An object as rays meet it.
#[derive(Debug, Clone)]
pub struct Instance {
    /// What it is made of.
    pub shape: Shape,
    /// From the shape's coordinates (a mesh's are relative to its own origin) to the renderer's world, whose zero is
    /// the scene's origin.
    pub transform: Transform,
    /// Whether `transform` is exactly the identity; then rays need no transforming.
    pub identity: bool,
    /// A box in the renderer's world around the object; `None` if it has no end.
    pub bounds: Option<Bounds>,
    /// Whether no part of it lets light through.
    pub opaque: bool,
    /// Whether some of its surface may not be there.
    pub has_holes: bool,
    /// Whether some of its materials have normal maps.
    pub has_normal_maps: bool,
    /// Whether its vertices have colours.
    pub has_colors: bool,
}

/// All objects and lights of a scene, prepared.
#[derive(Debug, Clone)]
pub struct World {
    /// The objects, in the scene's order.
    pub instances: Vec<Instance>,
    /// Whether no object lets light through: then a shadow ray is a yes or a no.
    pub all_opaque: bool,
    /// Whether some surface may not be there.
    pub has_holes: bool,
    /// The lights, in the scene's order.
    pub lights: Vec<PreparedLight>,
    /// How large pixels of the active camera are.
    pub pixels: Pixels,
}

/// What some of an object's materials do.
#[derive(Debug, Clone, Copy, Default)]
struct Traits {
    lets_light_through: bool,
    has_holes: bool,
    has_normal_maps: bool,
}

impl Traits {
    fn of(material: &Material) -> Self {
        Self {
            lets_light_through: material.lets_light_through(),
            has_holes: material.has_holes(),
            has_normal_maps: material.detail.as_ref().is_some_and(|detail| detail.normal.is_some()),
        }
    }

    fn or(self, other: Self) -> Self {
        Self {
            lets_light_through: self.lets_light_through | other.lets_light_through,
            has_holes: self.has_holes | other.has_holes,
            has_normal_maps: self.has_normal_maps | other.has_normal_maps,
        }
    }

    /// Those of a mesh's own materials, as far as triangles with them can be hit.
    fn of_mesh(mesh: &TriangleMesh, materials: &[Self]) -> Self {
        match &mesh.materials {
            Materials::One(material) if mesh.live_count() > 0 => materials[*material as usize],
            Materials::One(_) => Self::default(),
            Materials::PerTriangle(each) => {
                let mut used = vec![false; materials.len()];
                mesh.live_triangles().for_each(|number| used[each[number as usize] as usize] = true);
                let used = materials.iter().zip(used).filter(|(_, used)| *used);
                used.fold(Self::default(), |all, (traits, _)| all.or(*traits))
            }
        }
    }
}

impl World {
    /// Prepares the objects and lights of a scene.
    ///
    /// # Errors
    /// Names the object whose transform is singular or not finite, the quadric whose material has detail, the material that returns more light than it
    /// receives, or the light without direction.
    pub fn new(scene: &Scene) -> Result<Self> {
        let bounds: Vec<Bounds> = scene.meshes.iter().map(|mesh| mesh.hit_bounds()).collect();
        Self::with_bounds(scene, &bounds)
    }

    /// [`new`](Self::new) where the boxes around what rays meet of meshes are known.
    ///
    /// # Errors
    /// As `new`.
    pub fn with_bounds(scene: &Scene, mesh_bounds: &[Bounds]) -> Result<Self> {
        // Weights that were computed may exceed 1 by rounding.
        const MOST: f32 = 1.0 + 4.0 * f32::EPSILON;
        // NaN is not at most anything.
        let makes_light = |material: &&Material| !(material.kr + material.kt).cmple(Rgb::splat(MOST)).all();
        if let Some(material) = scene.materials.iter().find(makes_light) {
            let message = format!("material `{}`: kr + kt is more than 1 and would make light", material.name);
            return Err(Error::caller(message));
        }
        let materials: Vec<Traits> = scene.materials.iter().map(Traits::of).collect();
        let mesh_traits: Vec<Traits> = scene.meshes.iter().map(|mesh| Traits::of_mesh(mesh, &materials)).collect();
        // What a quadric without a material of its own has.
        let default_traits = materials.first().copied().unwrap_or_default();
        let prepare = |object: &crate::scene::Object| {
            let (shape_origin, scale, bounds, traits) = match object.shape {
                Shape::Mesh(mesh) => {
                    let number = mesh as usize;
                    let mesh = &scene.meshes[number];
                    (mesh.origin, mesh.scale(), Some(mesh_bounds[number]), mesh_traits[number])
                }
                Shape::Quadric(quadric) => {
                    (DVec3::ZERO, 1.0, scene.quadrics[quadric as usize].bounds(), default_traits)
                }
            };
            let transform = Transform::new(relative(&object.transform, shape_origin, scale, scene.origin))
                .map_err(|error| error.remedy(format!("object `{}`: scales must not be 0", object.name)))?;
            let traits = object.material.map_or(traits, |material| materials[material as usize]);
            let material = scene.materials.get(object.material.unwrap_or(0) as usize);
            if matches!(object.shape, Shape::Quadric(_)) && material.is_some_and(|material| material.detail.is_some()) {
                let error = Error::caller(format!("object `{}`: a quadric's material has detail", object.name));
                return Err(error.remedy("give it one without, such as `Material::at` returns"));
            }
            let has_colors = match object.shape {
                Shape::Mesh(mesh) => scene.meshes[mesh as usize].colors.is_some(),
                Shape::Quadric(_) => false,
            };
            Ok(Instance {
                shape: object.shape,
                identity: transform.is_identity(),
                bounds: bounds.map(|bounds| bounds.to_world(&transform)),
                opaque: !traits.lets_light_through,
                has_holes: traits.has_holes,
                has_normal_maps: traits.has_normal_maps,
                has_colors,
                transform,
            })
        };
        let instances = scene.objects.iter().map(prepare).collect::<Result<Vec<_>>>()?;
        let all_opaque = instances.iter().all(|instance| instance.opaque);
        let lights = scene.lights.iter().map(|light| PreparedLight::new(light, scene.origin)).collect::<Result<_>>()?;
        let has_holes = instances.iter().any(|instance| instance.has_holes);
        Ok(Self { instances, all_opaque, has_holes, lights, pixels: pixels(scene) })
    }
}

impl World {
    /// Takes the scene's camera and film as they are now.
    pub fn see(&mut self, scene: &Scene) {
        self.pixels = pixels(scene);
    }

    /// Takes the scene's lights as they are now.
    ///
    /// # Errors
    /// A light without direction.
    pub fn light(&mut self, scene: &Scene) -> Result<()> {
        self.lights =
            scene.lights.iter().map(|light| PreparedLight::new(light, scene.origin)).collect::<Result<_>>()?;
        Ok(())
    }
}

/// How large the pixels of the active camera are; its flaws are told where rays are made.
fn pixels(scene: &Scene) -> Pixels {
    let Some(named) = scene.cameras.get(scene.active_camera) else { return Pixels::NONE };
    let rays = named.camera.rays(scene.film.width, scene.film.height, scene.origin);
    rays.map_or(Pixels::NONE, |rays| rays.pixels(scene.film.samples))
}

impl Instance {
    /// Brings a world ray into the object's space; `None` if it passes the object's box by.
    ///
    /// The local ray is rounded to f32 once. Its direction keeps its length, so that t is the same in both spaces.
    #[inline]
    pub fn local_ray(&self, ray: &PreparedRay, clip: Interval) -> Option<PreparedRay> {
        let (origin, direction) = self.local_line(ray.origin.as_dvec3(), ray.direction.as_dvec3());
        PreparedRay::local(origin.as_vec3(), direction.as_vec3(), ray, clip)
    }

    /// Whether rays meet it as they are.
    #[inline(always)]
    pub fn is_unmoved(&self) -> bool {
        self.identity || !compiled::TRANSFORMS
    }

    /// Brings a world line into the object's space in f64.
    #[inline]
    pub fn local_line(&self, origin: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        if self.is_unmoved() {
            (origin, direction)
        } else {
            (self.transform.point_to_object(origin), self.transform.vector_to_object(direction))
        }
    }

    /// The part of a world ray inside the object's box; all of it if the object has no end.
    #[inline]
    pub fn clip(&self, ray: &PreparedRay) -> Interval {
        match &self.bounds {
            Some(bounds) => bounds.interval(ray, f32::NEG_INFINITY, f32::INFINITY),
            None => Interval::ALL,
        }
    }
}

/// `p -> transform (shape_origin + scale p) - scene_origin`, exactly the identity where nothing moves.
fn relative(transform: &DAffine3, shape_origin: DVec3, scale: f64, scene_origin: DVec3) -> DAffine3 {
    let m = transform.matrix3;
    let moved = m.x_axis * shape_origin.x + m.y_axis * shape_origin.y + m.z_axis * shape_origin.z;
    let scaled = DMat3::from_cols(m.x_axis * scale, m.y_axis * scale, m.z_axis * scale);
    // The difference first: for an untransformed mesh it is an exact difference of origins, usually zero.
    DAffine3 { matrix3: scaled, translation: (moved - scene_origin) + transform.translation }
}
