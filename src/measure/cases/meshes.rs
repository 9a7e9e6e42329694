//! Meshes that several cases share.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::array::Array;
use crate::geometry::TriangleMesh;
use crate::math::vector::normalize;
use crate::measure::scenes::sphere_points;
use crate::scene::{Material, Object, Scene, Shape};

/// A scene of meshes where they are, each an object of its own.
pub fn scene(meshes: Vec<TriangleMesh>) -> Scene {
    let object = |number: usize| Object {
        name: format!("mesh {number}"),
        shape: Shape::Mesh(number as u32),
        transform: glam::DAffine3::IDENTITY,
        material: Some(0),
    };
    let objects = (0..meshes.len()).map(object).collect();
    Scene {
        materials: vec![Material::default()],
        meshes: meshes.into_iter().map(Arc::new).collect(),
        objects,
        ..Scene::default()
    }
}

/// A finished mesh of vertices and triangles.
pub fn mesh(positions: Array<Vec3>, indices: Array<[u32; 3]>) -> TriangleMesh {
    let mesh = TriangleMesh { positions, indices, ..TriangleMesh::default() };
    mesh.finish().expect("test meshes are small and have no attributes")
}

/// A mesh of triangles that share no vertices.
pub fn soup(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> TriangleMesh {
    let positions: Array<Vec3> = triangles.into_iter().flatten().collect();
    let indices = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(positions, indices)
}

/// The mesh with every vertex moved; triangles that lose their area are dropped.
pub fn moved(of: &TriangleMesh, to: impl Fn(Vec3) -> Vec3) -> TriangleMesh {
    mesh(of.positions.iter().map(|&p| to(p)).collect(), of.indices.clone())
}

/// A closed sphere of `rings` x `segments` quads cut into triangles, poles shared, about `center`, along y; faces
/// outward. Vertices are computed in f64 and rounded once.
pub fn sphere(rings: u32, segments: u32, radius: f64, center: DVec3) -> TriangleMesh {
    let (points, indices) = sphere_points(rings, segments);
    mesh(points.into_iter().map(|out| (center + out * radius).as_vec3()).collect(), indices.into())
}

/// An icosahedron whose faces were quartered `level` times and its vertices put on the sphere; 20 * 4^level triangles,
/// faces outward. Vertices are computed in f64 and rounded once.
pub fn icosphere(level: u32, radius: f64, center: DVec3) -> TriangleMesh {
    let golden = 0.5 * (1.0 + 5f64.sqrt());
    let mut directions = Vec::new();
    for axis in 0..3 {
        for (short, long) in [(-1.0, -golden), (-1.0, golden), (1.0, -golden), (1.0, golden)] {
            let mut p = [0.0; 3];
            (p[(axis + 1) % 3], p[(axis + 2) % 3]) = (short, long);
            directions.push(unit(DVec3::from_array(p)));
        }
    }
    // Corners whose distance is the shortest there is form the faces.
    let mut faces = Vec::new();
    let near = |a: DVec3, b: DVec3| {
        let d = a - b;
        d.x * d.x + d.y * d.y + d.z * d.z < 1.2
    };
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| directions[i as usize]);
                if near(p, q) && near(q, r) && near(r, p) {
                    let outward = crate::math::vector::dot(crate::math::vector::cross(q - p, r - p), p) > 0.0;
                    faces.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..level {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                directions.push(unit(directions[a as usize] + directions[b as usize]));
                directions.len() as u32 - 1
            })
        };
        let mut quarters = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            quarters.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = quarters;
    }
    mesh(directions.iter().map(|&d| (center + d * radius).as_vec3()).collect(), faces.into())
}

fn unit(v: DVec3) -> DVec3 {
    normalize(v).expect("directions are not zero")
}

/// A flat grid of `n` x `n` quads cut into triangles, over [-1, 1]^2 in the plane z = 0, facing +z.
pub fn grid(n: u32) -> TriangleMesh {
    let side = |i: u32| (2.0 * f64::from(i) / f64::from(n) - 1.0) as f32;
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| Vec3::new(side(i), side(j), 0.0))).collect();
    let mut indices = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh(positions, indices.into())
}

/// The unit square of two triangles, [0, 1]^2 in the plane z = 0, facing +z.
pub fn square() -> TriangleMesh {
    mesh(vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y].into(), vec![[0, 1, 2], [0, 2, 3]].into())
}

/// The cube [0, 1]^3 of twelve triangles, faces outward.
pub fn cube() -> TriangleMesh {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    mesh((0..8).map(corner).collect(), indices)
}

/// One of the 48 ways to put the axes onto each other, mirrored ones included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    axes: [usize; 3],
    negative: [bool; 3],
}

impl Turn {
    /// The turn of that number, modulo 48; 0 leaves everything where it is.
    pub fn new(number: u64) -> Self {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        let signs = number % 8;
        Self { axes: ORDERS[(number / 8 % 6) as usize], negative: [signs & 1 != 0, signs & 2 != 0, signs & 4 != 0] }
    }

    /// How many there are.
    pub const COUNT: u64 = 48;

    /// A vector turned, exactly.
    pub fn apply(&self, v: Vec3) -> Vec3 {
        let part = |axis: usize| if self.negative[axis] { -v[self.axes[axis]] } else { v[self.axes[axis]] };
        Vec3::new(part(0), part(1), part(2))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::math::vector::{cross, dot};

    /// Every edge is walked once in each direction, and the volume inside, faces outward, is positive.
    fn assert_closed(mesh: &TriangleMesh) -> f64 {
        assert!(mesh.dropped.is_empty());
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        let mut volume = 0.0;
        for number in mesh.live_triangles() {
            let [a, b, c] = mesh.indices[number as usize];
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((from, to)).or_default() += 1;
            }
            let [a, b, c] = mesh.triangle(number).map(|p| p.as_dvec3());
            volume += dot(a, cross(b, c)) / 6.0;
        }
        assert!(edges.iter().all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1)));
        volume
    }

    #[test]
    fn solids_are_closed_and_face_outward() {
        assert!((assert_closed(&cube()) - 1.0).abs() < 1e-12);
        let ball = 4.0 / 3.0 * std::f64::consts::PI;
        for (mesh, triangles, share) in [
            (sphere(48, 96, 1.0, DVec3::ZERO), 9024, 0.99),
            (icosphere(0, 1.0, DVec3::ZERO), 20, 0.6),
            (icosphere(3, 1.0, DVec3::ZERO), 1280, 0.98),
        ] {
            assert_eq!(mesh.triangle_count(), triangles);
            let volume = assert_closed(&mesh);
            assert!(volume < ball && volume > share * ball, "{triangles}: {volume}");
        }
    }

    #[test]
    fn grids_cover_their_square() {
        let area = |mesh: &TriangleMesh| -> f64 {
            let twice = |n| {
                let [a, b, c] = mesh.triangle(n).map(|p| p.as_dvec3());
                cross(b - a, c - a).z
            };
            mesh.live_triangles().map(twice).sum::<f64>() / 2.0
        };
        assert!((area(&grid(100)) - 4.0).abs() < 1e-6);
        assert_eq!(area(&square()), 1.0);
    }

    #[test]
    fn turns_are_all_different_and_start_with_none() {
        let v = Vec3::new(1.0, 2.0, 3.0);
        assert_eq!(Turn::new(0).apply(v), v);
        let images: Vec<_> = (0..Turn::COUNT).map(|n| Turn::new(n).apply(v).to_array().map(f32::to_bits)).collect();
        assert!(images.iter().enumerate().all(|(i, a)| !images[..i].contains(a)));
    }
}
