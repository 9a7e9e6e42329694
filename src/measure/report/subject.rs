//! What a report is about: the triangles of a scene, baked into one mesh, with a camera and lights to make rays from.

use glam::{DAffine3, DVec3};

use crate::error::{Error, Result};
use crate::geometry::{Ray, TriangleMesh};
use crate::math::random::Random;
use crate::math::vector::basis;
use crate::measure::cases::meshes;
use crate::measure::ray_file::FileRay;
use crate::render::world::World;
use crate::scene::{Camera, LightKind, NamedCamera, Object, Projection, Scene, Shape, auto};

/// The most triangles: all choices are held in memory at once, about 2 KiB a triangle.
pub const MOST_TRIANGLES: u64 = 4_000_000;

/// What is measured.
#[derive(Debug, Clone)]
pub struct Subject {
    /// What it is called: the stem of its file's name, or the name of the hard set.
    pub name: String,
    /// One untransformed mesh whose coordinates are the renderer's own, a camera, and lights. Materials are plain.
    pub scene: Scene,
    /// The scene as it was loaded, for pictures.
    pub original: Scene,
    /// Quadrics of the original, which are not in the mesh.
    pub quadrics: usize,
    /// The length of 1 of the mesh's coordinates in those of the original: a power of two, nearly always 1.
    unit: f64,
}

/// Meshes that are made to be hard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HardSet {
    /// A closed sphere of 48 x 96 parts and radius 2 around the origin.
    Sphere,
    /// The same far from the origin, where f32 numbers are 1/64 apart, without an origin of its own.
    FarSphere,
    /// 2000 triangles 11.2 long and 0.05 to 0.35 wide.
    Slivers,
    /// A flat grid of 100 x 100 squares.
    Grid,
}

impl HardSet {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Sphere, Self::FarSphere, Self::Slivers, Self::Grid];

    /// The name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::FarSphere => "far-sphere",
            Self::Slivers => "slivers",
            Self::Grid => "grid",
        }
    }

    fn mesh(self) -> TriangleMesh {
        let sphere = |center: DVec3| meshes::sphere(48, 96, 2.0, center);
        let mesh = match self {
            Self::Sphere => sphere(DVec3::ZERO),
            // Far along no axis and no diagonal.
            Self::FarSphere => sphere(DVec3::new(148_376.0, 1234.0, -223_423.0)),
            Self::Slivers => slivers(2000),
            Self::Grid => meshes::grid(100),
        };
        TriangleMesh { name: self.name().into(), ..mesh }
    }
}

/// Thin triangles, 11.2 long and 0.05 to 0.35 wide, their middles within 500 of the origin.
fn slivers(count: u32) -> TriangleMesh {
    let mut random = Random::new(0x736c_6976, 0);
    meshes::soup((0..count).map(|_| {
        let (middle, along) = (random.in_cube() * 500.0, random.direction() * 5.6);
        let across = basis(along / 5.6).0 * random.between(0.025, 0.175);
        [middle - along, middle + along - across, middle + along + across].map(|corner| corner.as_vec3())
    }))
}

impl Subject {
    /// A hard set.
    pub fn hard(set: HardSet) -> Self {
        let mut scene = of_mesh(set.mesh());
        auto::complete(&mut scene);
        Self { name: set.name().into(), original: scene.clone(), scene, quadrics: 0, unit: 1.0 }
    }

    /// The triangles of a loaded scene, every instance brought into the world in f64 and rounded once: exactly the
    /// renderer's where nothing is transformed.
    ///
    /// # Errors
    /// A scene without triangles or with more than [`MOST_TRIANGLES`]; as [`World::new`].
    pub fn of_scene(name: String, original: Scene) -> Result<Self> {
        let count = original.instanced_triangles();
        if count == 0 {
            return Err(Error::unsupported("there are no triangles to measure").remedy("choose a scene with a mesh"));
        }
        if count > MOST_TRIANGLES {
            return Err(Error::limit(format!(
                "{count} triangles are more than the {MOST_TRIANGLES} that a report holds"
            ))
            .remedy("choose a smaller model"));
        }
        let mut baked = TriangleMesh { name: name.clone(), ..TriangleMesh::default() };
        for instance in World::new(&original)?.instances {
            let Shape::Mesh(number) = instance.shape else { continue };
            let mesh = &original.meshes[number as usize];
            let first = baked.positions.len() as u32;
            let place = |p: &glam::Vec3| {
                if instance.identity { *p } else { instance.transform.point_to_world(p.as_dvec3()).as_vec3() }
            };
            baked.positions.extend(mesh.positions.iter().map(place));
            baked.indices.extend(mesh.live_triangles().map(|n| mesh.indices[n as usize].map(|i| first + i)));
        }
        let mut baked = baked.finish()?;
        // Huge and tiny scenes were scaled by a power of two; here their unit is that.
        let unit = baked.scale();
        baked.exponent = 0;
        let mut scene = of_mesh(baked);
        let moved = |p: DVec3| (p - original.origin) / unit;
        scene.cameras = original.cameras.iter().map(|named| moved_camera(named, moved, unit)).collect();
        scene.active_camera = original.active_camera;
        scene.lights = original.lights.clone();
        for light in &mut scene.lights {
            if let LightKind::Point { position, .. } | LightKind::Spot { position, .. } = &mut light.kind {
                *position = moved(*position);
            }
        }
        scene.film = original.film;
        auto::complete(&mut scene);
        Ok(Self { name, quadrics: original.quadrics.len(), scene, original, unit })
    }

    /// A ray in the file's coordinates as the mesh has it.
    pub fn ray(&self, ray: &FileRay) -> Ray {
        let relative = FileRay { origin: (ray.origin - self.original.origin) / self.unit, ..*ray };
        let Ray { origin, t_min, direction, t_max } = relative.relative_to(DVec3::ZERO);
        Ray { origin, t_min, direction: (direction.as_dvec3() / self.unit).as_vec3(), t_max }
    }

    /// The one mesh.
    pub fn mesh(&self) -> &TriangleMesh {
        &self.scene.meshes[0]
    }
}

/// A scene of one mesh in the renderer's coordinates, without camera and lights.
pub fn of_mesh(mesh: TriangleMesh) -> Scene {
    let object =
        Object { name: mesh.name.clone(), shape: Shape::Mesh(0), transform: DAffine3::IDENTITY, material: None };
    Scene { meshes: vec![mesh.into()], objects: vec![object], ..Scene::default() }
}

fn moved_camera(named: &NamedCamera, moved: impl Fn(DVec3) -> DVec3, unit: f64) -> NamedCamera {
    let camera = match named.camera {
        Camera::LookAt { eye, target, up, projection } => {
            let projection = match projection {
                Projection::Orthographic { height } => Projection::Orthographic { height: height / unit },
                Projection::Perspective { .. } => projection,
            };
            Camera::LookAt { eye: moved(eye), target: moved(target), up, projection }
        }
        Camera::FourPoint { viewpoint, lower_left, lower_right, upper_left } => Camera::FourPoint {
            viewpoint: moved(viewpoint),
            lower_left: moved(lower_left),
            lower_right: moved(lower_right),
            upper_left: moved(upper_left),
        },
    };
    NamedCamera { camera, ..named.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instances_are_baked_where_they_stand_and_untransformed_meshes_bit_for_bit() {
        let mut scene = of_mesh(meshes::grid(100));
        let place = DAffine3::from_translation(DVec3::new(0.0, 0.3, 0.0));
        scene.objects.push(Object { name: "copy".into(), shape: Shape::Mesh(0), transform: place, material: None });
        let grid = scene.meshes[0].clone();
        let subject = Subject::of_scene("grids".into(), scene).unwrap();
        assert_eq!(subject.mesh().live_count(), 40_000);
        assert_eq!(subject.mesh().triangle(7), grid.triangle(7));
        let lifted = grid.triangle(7).map(|p| glam::Vec3::new(p.x, p.y + 0.3, p.z));
        assert_eq!(subject.mesh().triangle(20_007), lifted);
        assert!(!subject.scene.lights.is_empty() && !subject.scene.cameras.is_empty());
    }

    #[test]
    fn rays_of_files_meet_what_they_meet_in_the_file() {
        let far = DVec3::new(5e6, 4e6, 100.0);
        let mut scene = of_mesh(TriangleMesh { origin: far, ..meshes::grid(2) });
        scene.origin = far;
        let subject = Subject::of_scene("far".into(), scene).unwrap();
        let origin = far + DVec3::new(0.25, 0.5, 1.0);
        let ray = FileRay { origin, direction: -glam::Vec3::Z, t_min: 0.0, t_max: 2.0 };
        let expected = Ray { t_max: 2.0, ..Ray::new(glam::Vec3::new(0.25, 0.5, 1.0), -glam::Vec3::Z) };
        assert_eq!(subject.ray(&ray), expected);
    }

    #[test]
    fn scenes_without_triangles_are_refused() {
        assert!(Subject::of_scene("empty".into(), Scene::default()).is_err());
    }
}
