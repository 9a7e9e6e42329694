//! Independent checks of a mesh: is it closed, is it oriented, does it face outwards.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use crate::mesh::Mesh;

/// How the triangles of a mesh hang together, by position.
pub struct Topology {
    /// Connected parts, each in terms of [`Part`].
    pub parts: Vec<Part>,
}

/// A connected part of a mesh.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    /// Vertices minus edges plus faces: 2 for a sphere, 1 for a disc, 0 for a tube or torus.
    pub euler: i64,
    /// How many closed curves bound it; 0 is watertight.
    pub boundary_loops: usize,
    /// Its triangles.
    pub triangles: usize,
}

impl Topology {
    /// Looks at a mesh.
    ///
    /// # Panics
    /// If an edge has more than two triangles, or two that disagree on which side is out.
    pub fn of(mesh: &Mesh) -> Self {
        let directed = directed_edges(mesh);
        let mut part_of: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        for &(a, b) in &directed {
            let (a, b) = (root(&mut part_of, a), root(&mut part_of, b));
            part_of[a as usize] = b;
        }
        let mut vertices: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
        let mut edges: BTreeMap<u32, i64> = BTreeMap::new();
        let mut triangles: BTreeMap<u32, usize> = BTreeMap::new();
        for &(a, b) in &directed {
            let part = root(&mut part_of, a);
            vertices.entry(part).or_default().insert(a);
            if a < b || !directed.contains(&(b, a)) {
                *edges.entry(part).or_default() += 1;
            }
        }
        for triangle in &mesh.triangles {
            *triangles.entry(root(&mut part_of, triangle[0].position)).or_default() += 1;
        }
        let loops = boundary_loops(mesh);
        let parts = triangles
            .iter()
            .map(|(part, &count)| Part {
                euler: vertices[part].len() as i64 - edges[part] + count as i64,
                boundary_loops: loops.iter().filter(|curve| root(&mut part_of, curve[0]) == *part).count(),
                triangles: count,
            })
            .collect();
        Self { parts }
    }
}

/// Every edge of every triangle, in its direction.
fn directed_edges(mesh: &Mesh) -> BTreeSet<(u32, u32)> {
    let mut edges = BTreeSet::new();
    for triangle in &mesh.triangles {
        for i in 0..3 {
            let edge = (triangle[i].position, triangle[(i + 1) % 3].position);
            assert!(edges.insert(edge), "edge {edge:?} is used twice in one direction");
        }
    }
    edges
}

/// The closed curves along which the mesh ends, each vertex once.
fn boundary_loops(mesh: &Mesh) -> Vec<Vec<u32>> {
    let edges = directed_edges(mesh);
    let mut next: BTreeMap<u32, u32> = BTreeMap::new();
    for &(a, b) in edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a))) {
        assert!(next.insert(a, b).is_none(), "two boundaries meet at vertex {a}");
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut curve = Vec::new();
        let mut at = start;
        while let Some(following) = next.remove(&at) {
            curve.push(at);
            at = following;
        }
        loops.push(curve);
    }
    loops
}

/// The representative of a vertex's part.
fn root(part_of: &mut [u32], mut vertex: u32) -> u32 {
    while part_of[vertex as usize] != vertex {
        let parent = part_of[vertex as usize];
        part_of[vertex as usize] = part_of[parent as usize];
        vertex = parent;
    }
    vertex
}

/// The volume inside, by the divergence theorem; boundaries are closed by fans around their mean. Positive if the
/// triangles are counter-clockwise seen from outside.
pub fn capped_volume(mesh: &Mesh) -> f64 {
    let p = |vertex: u32| mesh.positions[vertex as usize];
    let tetrahedron = |a: DVec3, b: DVec3, c: DVec3| a.dot(b.cross(c)) / 6.0;
    let faces: f64 = mesh
        .triangles
        .iter()
        .map(|corners| corners.map(|corner| p(corner.position)))
        .map(|[a, b, c]| tetrahedron(a, b, c))
        .sum();
    let caps: f64 = boundary_loops(mesh)
        .iter()
        .map(|curve| {
            let mean = curve.iter().map(|&v| p(v)).sum::<DVec3>() / curve.len() as f64;
            let following = curve.iter().cycle().skip(1);
            curve.iter().zip(following).map(|(&a, &b)| tetrahedron(p(b), p(a), mean)).sum::<f64>()
        })
        .sum();
    faces + caps
}

/// Checks what holds for every mesh: no degenerate triangle, unit normals on the faces' side, pictures not mirrored.
pub fn assert_sound(mesh: &Mesh) {
    for (number, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner.position as usize]);
        let face = (b - a).cross(c - a);
        assert!(face.length() > 1e-12, "triangle {number} has no area");
        for corner in corners {
            let normal = mesh.normals[corner.normal as usize];
            assert!((normal.length() - 1.0).abs() < 1e-12, "triangle {number} has a normal of another length than 1");
            assert!(normal.dot(face) > 0.0, "triangle {number} has a normal on its back");
        }
        let [a, b, c] = corners.map(|corner| mesh.uvs[corner.uv as usize]);
        assert!((b - a).perp_dot(c - a) > 0.0, "triangle {number} shows its texture mirrored");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solids;

    #[test]
    fn a_cube_is_a_sphere_and_an_open_cube_a_disc() {
        let mut cube = solids::cuboid();
        assert_eq!(Topology::of(&cube).parts, [Part { euler: 2, boundary_loops: 0, triangles: 12 }]);
        assert!((capped_volume(&cube) - 1.0).abs() < 1e-12);
        cube.triangles.truncate(10);
        assert_eq!(Topology::of(&cube).parts, [Part { euler: 1, boundary_loops: 1, triangles: 10 }]);
        assert!((capped_volume(&cube) - 1.0).abs() < 1e-12);
    }

    #[test]
    #[should_panic(expected = "used twice")]
    fn a_turned_triangle_is_found() {
        let mut cube = solids::cuboid();
        cube.triangles[3].swap(0, 1);
        Topology::of(&cube);
    }

    #[test]
    #[should_panic(expected = "on its back")]
    fn a_mesh_inside_out_is_found() {
        let mut cube = solids::cuboid();
        for triangle in &mut cube.triangles {
            triangle.swap(0, 1);
        }
        assert_sound(&cube);
    }
}
