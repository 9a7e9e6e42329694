//! parry3d's triangle meshes. They know no smallest t: rays start where they start. Hits come without weights.

use std::time::Instant;

use parry3d::math::Vector;
use parry3d::query::{Ray as TheirRay, RayCast};
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::{Built, Peer, Surface};
use crate::error::{Error, Result};
use crate::geometry::{Hit, Ray};

/// A mesh of all triangles.
pub struct Parry {
    mesh: TriMesh,
    /// Instance and number of each triangle.
    numbers: Vec<[u32; 2]>,
}

impl Parry {
    /// Builds a mesh; it takes one thread.
    ///
    /// # Errors
    /// What it does not take.
    pub fn build(surfaces: &[Surface]) -> Result<Built<Self>> {
        let (mut vertices, mut indices, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        for surface in surfaces {
            let first = vertices.len() as u32;
            vertices.extend(surface.coordinates.chunks_exact(3).map(|c| Vector::new(c[0], c[1], c[2])));
            let live = (0..).zip(&surface.indices).filter(|(_, corners)| **corners != [0; 3]);
            for (number, corners) in live {
                indices.push(corners.map(|index| first + index));
                numbers.push([surface.instance, number]);
            }
        }
        let start = Instant::now();
        let mesh = TriMesh::new(vertices, indices)
            .map_err(|error| Error::unsupported(format!("parry3d cannot build this mesh: {error}")))?;
        let seconds = start.elapsed().as_secs_f64();
        let bytes = mesh.bvh().total_memory_size() as u64;
        Ok(Built { peer: Self { mesh, numbers }, seconds, bytes })
    }
}

impl Peer for Parry {
    #[inline]
    fn closest(&self, ray: &Ray) -> Hit {
        match CompositeShapeRef(&self.mesh).cast_local_ray(&theirs(ray), ray.t_max, false) {
            None => Hit::MISS,
            Some((place, t)) => {
                let [instance, primitive] = self.numbers[place as usize];
                Hit { t, u: 0.0, v: 0.0, instance, primitive }
            }
        }
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.mesh.intersects_local_ray(&theirs(ray), ray.t_max)
    }
}

#[inline(always)]
fn theirs(ray: &Ray) -> TheirRay {
    let vector = |v: glam::Vec3| Vector::new(v.x, v.y, v.z);
    TheirRay::new(vector(ray.origin), vector(ray.direction))
}
