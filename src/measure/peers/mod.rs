//! Other programs' structures, asked the same rays.

use crate::error::Result;
use crate::geometry::{Hit, Ray};
use crate::render::world::World;
use crate::scene::{Scene, Shape};

#[cfg(feature = "peers")]
pub mod bounding_volumes;
#[cfg(feature = "embree")]
pub mod embree;
#[cfg(feature = "peers")]
pub mod obvhs;
#[cfg(feature = "peers")]
pub mod parry;

/// A structure that answers one ray a call; rays must be valid.
pub trait Peer: Send + Sync {
    /// The closest hit, with the renderer's numbers.
    fn closest(&self, ray: &Ray) -> Hit;

    /// Whether there is any hit.
    fn occluded(&self, ray: &Ray) -> bool;
}

/// What a peer built.
pub struct Built<P> {
    /// It.
    pub peer: P,
    /// Wall-clock seconds.
    pub seconds: f64,
    /// Bytes of nodes and of what leaves hold; vertices and indices that are shared with others do not count.
    pub bytes: u64,
}

/// An object's triangles in the renderer's world, as peers take them.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// The object's number.
    pub instance: u32,
    /// Coordinates of the vertices, three each, and a last one without meaning: some peers read vertices as four numbers.
    pub coordinates: Vec<f32>,
    /// Vertex numbers, three a triangle, all of them below the number of vertices. Triangles that cannot be hit have no
    /// area, so that the others keep their numbers.
    pub indices: Vec<[u32; 3]>,
}

impl Surface {
    /// The objects of a scene that are meshes, every instance brought into the world in f64 and rounded once: exactly the
    /// renderer's triangles where nothing is transformed.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn all(scene: &Scene) -> Result<Vec<Self>> {
        let mut all = Vec::new();
        for (instance, object) in (0..).zip(World::new(scene)?.instances) {
            let Shape::Mesh(number) = object.shape else { continue };
            let mesh = &scene.meshes[number as usize];
            if mesh.live_count() == 0 {
                continue;
            }
            let place = |p: &glam::Vec3| {
                let identity = object.identity;
                if identity { *p } else { object.transform.point_to_world(p.as_dvec3()).as_vec3() }
            };
            let mut coordinates: Vec<f32> = Vec::with_capacity(3 * mesh.positions.len() + 1);
            coordinates.extend(mesh.positions.iter().flat_map(|p| place(p).to_array()));
            coordinates.push(0.0);
            let mut indices = mesh.indices.to_vec();
            for &dropped in &mesh.dropped {
                indices[dropped as usize] = [0; 3];
            }
            all.push(Self { instance, coordinates, indices });
        }
        Ok(all)
    }

    /// The triangles that can be hit: instance, number and corners.
    pub fn triangles(&self) -> impl Iterator<Item = (u32, u32, [glam::Vec3; 3])> + '_ {
        let corner = |index: u32| glam::Vec3::from_slice(&self.coordinates[3 * index as usize..]);
        let live = (0..).zip(&self.indices).filter(|(_, indices)| **indices != [0; 3]);
        live.map(move |(number, indices)| (self.instance, number, indices.map(corner)))
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.coordinates.len() / 3
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3, Vec3};

    use super::*;
    use crate::geometry::TriangleMesh;
    use crate::measure::scenes;

    #[test]
    fn surfaces_are_where_the_objects_stand_and_keep_numbers() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let indices = vec![[0, 1, 2], [0, 0, 1], [0, 9, 1], [1, 2, 3]];
        let mesh = TriangleMesh { positions: positions.into(), indices: indices.into(), ..TriangleMesh::default() }
            .finish()
            .unwrap();
        let mut scene = scenes::empty();
        scenes::add_quadric(&mut scene, crate::geometry::shapes::sphere(), DAffine3::IDENTITY, scenes::white());
        let moved = DAffine3::from_translation(DVec3::new(0.0, 0.0, 5.0));
        scenes::add_mesh(&mut scene, mesh, moved, scenes::white());
        let surfaces = Surface::all(&scene).unwrap();
        assert_eq!(surfaces.len(), 1);
        let Surface { instance, coordinates, indices } = &surfaces[0];
        assert_eq!((*instance, surfaces[0].vertex_count(), coordinates.len()), (1, 4, 13));
        assert_eq!(coordinates[3..6], [1.0, 0.0, 5.0]);
        assert_eq!(indices[..], [[0, 1, 2], [0; 3], [0; 3], [1, 2, 3]]);
        let live: Vec<_> = surfaces[0].triangles().map(|(instance, number, [a, ..])| (instance, number, a)).collect();
        assert_eq!(live, [(1, 0, Vec3::Z * 5.0), (1, 3, Vec3::new(1.0, 0.0, 5.0))]);
    }
}
