//! Tangents for normal maps, by the algorithm with which most programs bake these: Mikkelsen (2008), "Simulation of Wrinkled
//! Surfaces Revisited", called MikkTSpace; its code in Rust is the crate `bevy_mikktspace`.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use glam::{DVec3, Vec3, Vec4};

use crate::error::{Error, Result};
use crate::geometry::TriangleMesh;
use crate::math::vector::{cross, normalize};

impl TriangleMesh {
    /// Computes [`tangents`](Self::tangents) from positions, normals and the first texture coordinates for the triangles whose
    /// material is one that `wants` them. Before or after [`finish`](Self::finish): triangles keep the positions of their corners. A
    /// vertex that is missing must have the number 4294967295.
    ///
    /// A vertex at which tangents differ is split: copies of it go to the end of the arrays. Vertices of other triangles get
    /// zero, and so do those at which texture coordinates do not tell a direction. Where there are no shading normals the
    /// faces' are used. Triangles with a vertex that is missing or not finite are passed over. Nothing is computed, and
    /// nothing stored, for a mesh without texture coordinates or without such triangles.
    ///
    /// # Errors
    /// A limit where the copies make more than 4294967295 vertices.
    pub fn compute_tangents(&mut self, wants: impl Fn(u32) -> bool) -> Result<()> {
        let triangles = self.tangential_triangles(wants);
        if triangles.is_empty() {
            return Ok(());
        }
        self.tangents = None;
        let mut corners = Corners::new(self, &triangles);
        generate_tangents(&mut corners).map_err(|cause| Error::limit(format!("no tangents: {cause}")))?;
        let tangents = corners.tangents;
        self.store_tangents(&triangles, &tangents)
    }

    /// The triangles that can have tangents and want them.
    fn tangential_triangles(&self, wants: impl Fn(u32) -> bool) -> Vec<u32> {
        let Some(uvs) = self.uvs.as_ref().filter(|uvs| uvs.len() == self.positions.len()) else { return Vec::new() };
        let is_sound = |&vertex: &u32| {
            let vertex = vertex as usize;
            self.positions.get(vertex).is_some_and(|p| p.is_finite()) && uvs[vertex].is_finite()
        };
        let has_place = |number: &u32| self.indices[*number as usize].iter().all(is_sound);
        (0..self.indices.len() as u32).filter(|&number| wants(self.material(number))).filter(has_place).collect()
    }

    /// Gives vertices the tangents of the corners that are theirs, three a triangle.
    fn store_tangents(&mut self, triangles: &[u32], corners: &[[Vec4; 3]]) -> Result<()> {
        let mut tangents: Vec<Option<Vec4>> = vec![None; self.positions.len()];
        let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
        for (&number, corners) in triangles.iter().zip(corners) {
            for (corner, &tangent) in corners.iter().enumerate() {
                let vertex = self.indices[number as usize][corner];
                let own = *tangents[vertex as usize].get_or_insert(tangent);
                if own == tangent {
                    continue;
                }
                let key = (vertex, tangent.to_array().map(f32::to_bits));
                let copy = match copies.get(&key) {
                    Some(&copy) => copy,
                    None => {
                        let copy = self.copy_vertex(vertex)?;
                        tangents.push(Some(tangent));
                        copies.insert(key, copy);
                        copy
                    }
                };
                self.indices[number as usize][corner] = copy;
            }
        }
        self.tangents = Some(tangents.into_iter().map(Option::unwrap_or_default).collect());
        Ok(())
    }
}

/// Chosen triangles of a mesh as the algorithm asks for them, and what it answers.
struct Corners<'a> {
    mesh: &'a TriangleMesh,
    triangles: &'a [u32],
    /// What positions are multiplied by, a power of two, so that products of a few of them stay in f32.
    scale: f32,
    /// For the corners of each triangle.
    tangents: Vec<[Vec4; 3]>,
}

impl<'a> Corners<'a> {
    fn new(mesh: &'a TriangleMesh, triangles: &'a [u32]) -> Self {
        let vertices = triangles.iter().flat_map(|&number| mesh.indices[number as usize]);
        let largest = vertices.map(|vertex| mesh.positions[vertex as usize].abs().max_element()).fold(0.0, f32::max);
        // The reciprocal of the smallest numbers is not finite.
        let scale = if largest > 0.0 { libm::scalbnf(1.0, (-libm::ilogbf(largest)).min(126)) } else { 1.0 };
        Self { mesh, triangles, scale, tangents: vec![[Vec4::ZERO; 3]; triangles.len()] }
    }

    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[self.triangles[face] as usize][corner] as usize
    }

    fn face_normal(&self, face: usize) -> Vec3 {
        let [a, b, c] = self.mesh.triangle(self.triangles[face]).map(|p| p.as_dvec3());
        normalize(cross(b - a, c - a)).unwrap_or(DVec3::Z).as_vec3()
    }
}

impl Geometry<Portable> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        (self.mesh.positions[self.vertex(face, corner)] * self.scale).to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let vertex = self.vertex(face, corner);
        let own = self.mesh.normals.as_ref().and_then(|normals| normalize(normals.get(vertex)?.as_dvec3()));
        own.map_or_else(|| self.face_normal(face), |normal| normal.as_vec3()).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.mesh.uvs.as_ref().map_or([0.0; 2], |uvs| uvs[self.vertex(face, corner)].to_array())
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, corner: usize) {
        let usable = tangent.map(|tangent| Vec4::from_array(tangent.tangent_encoded()));
        let usable = usable.filter(|tangent| tangent.is_finite() && tangent.truncate() != Vec3::ZERO);
        self.tangents[face][corner] = usable.unwrap_or_default();
    }
}

/// Arithmetic that gives the same bits everywhere.
struct Portable;

impl Ops for Portable {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        libm::acos(f64::from(x)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::Materials;
    use crate::math::vector::dot;
    use glam::{DVec2, Vec2};

    /// A grid over the unit square of (s, t), placed by `position` and `uv`, without normals.
    fn grid(side: u32, position: impl Fn(DVec2) -> DVec3, uv: impl Fn(DVec2) -> DVec2) -> TriangleMesh {
        let step = f64::from(side);
        let points = (0..=side).flat_map(|j| (0..=side).map(move |i| DVec2::new(f64::from(i), f64::from(j)) / step));
        let at = |i, j| j * (side + 1) + i;
        let square = |i, j| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
        TriangleMesh {
            positions: points.clone().map(|p| position(p).as_vec3()).collect(),
            uvs: Some(points.map(|p| uv(p).as_vec2()).collect()),
            indices: (0..side).flat_map(|j| (0..side).flat_map(move |i| square(i, j))).collect(),
            ..Default::default()
        }
    }

    fn with_tangents(mut mesh: TriangleMesh) -> TriangleMesh {
        mesh.compute_tangents(|_| true).unwrap();
        mesh.finish().unwrap()
    }

    fn assert_near(found: Vec4, expected: Vec4, tolerance: f32) {
        assert!((found - expected).abs().max_element() < tolerance, "{found} instead of {expected}");
    }

    #[test]
    fn on_a_plane_the_tangent_is_the_gradient_of_u() {
        // (x, y) = A^-1 (uv): dP/du is the first column of A^-1 made a unit, whatever the plane's size.
        for (a, b, c, d) in [(2.0, 0.0, 0.0, 3.0), (1.0, 0.5, -0.25, 1.0), (0.0, 1.0, 1.0, 0.0), (-1.0, 0.0, 0.0, 1.0)]
        {
            for size in [1.0, 1e-15, 1e15] {
                let place = |p: DVec2| DVec3::new(p.x, p.y, 0.5) * size;
                let mesh = with_tangents(grid(3, place, |p| DVec2::new(a * p.x + b * p.y, c * p.x + d * p.y)));
                let determinant: f64 = a * d - b * c;
                let along_u = normalize(DVec3::new(d, -c, 0.0) / determinant).unwrap();
                let expected = along_u.as_vec3().extend(determinant.signum() as f32);
                assert_eq!(mesh.positions.len(), 16, "nothing is split");
                mesh.tangents.unwrap().iter().for_each(|&found| assert_near(found, expected, 1e-6));
            }
        }
    }

    #[test]
    fn the_bitangent_points_along_growing_v() {
        for flip in [1.0, -1.0] {
            let mesh = with_tangents(grid(2, |p| DVec3::new(p.x, 0.0, -p.y), |p| DVec2::new(p.x, flip * p.y)));
            let tangent = mesh.tangents.unwrap()[0];
            let bitangent = cross(DVec3::Y, tangent.truncate().as_dvec3()) * f64::from(tangent.w);
            assert!(dot(bitangent, DVec3::new(0.0, 0.0, -flip)) > 0.999, "{bitangent}");
        }
    }

    #[test]
    fn mirrored_halves_part_along_their_seam() {
        // u is |x|: to the right it grows along +x, to the left along -x, and the seam's vertices are two each.
        let mesh = with_tangents(grid(4, |p| DVec3::new(p.x - 0.5, p.y, 0.0), |p| DVec2::new((p.x - 0.5).abs(), p.y)));
        assert_eq!(mesh.positions.len(), 25 + 5);
        assert_eq!(mesh.uvs.as_ref().unwrap().len(), 30);
        let tangents = mesh.tangents.as_ref().unwrap();
        for triangle in &mesh.indices {
            let middle: f32 = triangle.iter().map(|&i| mesh.positions[i as usize].x).sum();
            let side = middle.signum();
            triangle.iter().for_each(|&i| assert_near(tangents[i as usize], Vec4::new(side, 0.0, 0.0, side), 1e-6));
        }
    }

    #[test]
    fn around_a_cylinder_tangents_turn_with_the_normals() {
        let angle = |p: DVec2| std::f64::consts::TAU * p.x;
        let place = |p: DVec2| DVec3::new(libm::cos(angle(p)), 2.0 * p.y, -libm::sin(angle(p)));
        let mut mesh = grid(64, place, |p| p);
        mesh.normals = Some(mesh.positions.iter().map(|p| Vec3::new(p.x, 0.0, p.z)).collect());
        let mesh = with_tangents(mesh);
        for (p, tangent) in mesh.positions.iter().zip(mesh.tangents.as_ref().unwrap()) {
            assert_near(*tangent, Vec4::new(p.z, 0.0, -p.x, 1.0), 1e-5);
        }
    }

    #[test]
    fn only_triangles_that_want_tangents_have_them_and_bad_ones_are_passed_over() {
        let mut mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::NAN].into(),
            uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE, Vec2::ONE].into()),
            colors: Some(vec![[7; 4]; 5].into()),
            indices: vec![[0, 1, 2], [0, 1, 3], [0, 1, 9], [0, 1, 4], [2, 2, 1]].into(),
            materials: Materials::PerTriangle(vec![1, 0, 1, 1, 1].into()),
            ..Default::default()
        };
        let plain = mesh.clone();
        mesh.compute_tangents(|_| false).unwrap();
        assert_eq!(mesh.tangents, None);
        mesh.compute_tangents(|material| material == 1).unwrap();
        let mesh = mesh.finish().unwrap();
        let tangents = mesh.tangents.as_ref().unwrap();
        (0..3).for_each(|vertex| assert_near(tangents[vertex], Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-6));
        assert_eq!(tangents[3..5], [Vec4::ZERO; 2]);
        assert_eq!(mesh.indices[1], [0, 1, 3]);

        let mut without = TriangleMesh { uvs: None, ..plain };
        without.compute_tangents(|_| true).unwrap();
        assert_eq!(without.tangents, None);
    }

    #[test]
    fn texture_coordinates_without_extent_tell_no_direction() {
        let mesh = with_tangents(grid(1, |p| DVec3::new(p.x, p.y, 0.0), |_| DVec2::ONE));
        assert!(mesh.tangents.unwrap().iter().all(|tangent| *tangent == Vec4::ZERO));
    }
}
