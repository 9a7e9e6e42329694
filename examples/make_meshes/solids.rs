//! A cube, a torus and a sphere.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use crate::mesh::{Corner, Mesh, UNIT_SQUARE};

/// The unit cube around the origin; every face has a whole texture, upright on its sides.
///
/// Faces come in the order front (+Z), right (+X), back, left, top, base, two triangles each.
pub fn cuboid() -> Mesh {
    // Rightwards and upwards as seen by who stands before the face.
    const FACES: [[DVec3; 2]; 6] = [
        [DVec3::X, DVec3::Y],
        [DVec3::NEG_Z, DVec3::Y],
        [DVec3::NEG_X, DVec3::Y],
        [DVec3::Z, DVec3::Y],
        [DVec3::X, DVec3::NEG_Z],
        [DVec3::X, DVec3::Z],
    ];
    let mut mesh = Mesh::default();
    for corner in 0..8 {
        let half = |axis: u32| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
        mesh.positions.push(DVec3::new(half(0), half(1), half(2)));
    }
    let number = |p: DVec3| u32::from(p.x > 0.0) | u32::from(p.y > 0.0) << 1 | u32::from(p.z > 0.0) << 2;
    for [right, up] in FACES {
        let outwards = right.cross(up);
        let corners = [-right - up, right - up, right + up, up - right];
        mesh.push_quad(corners.map(|corner| number(outwards + corner)), UNIT_SQUARE);
    }
    mesh
}

/// A torus around the Y axis: `ring` is the radius of the tube's centre line, `tube` the tube's own; the texture runs
/// once around the ring and once around the tube.
pub fn torus(ring: f64, tube: f64, ring_steps: u32, tube_steps: u32) -> Mesh {
    let angle = |step: u32, steps: u32| TAU * f64::from(step % steps) / f64::from(steps);
    let mut mesh = Mesh::default();
    for i in 0..ring_steps {
        let (sin_i, cos_i) = libm::sincos(angle(i, ring_steps));
        for j in 0..tube_steps {
            let (sin_j, cos_j) = libm::sincos(angle(j, tube_steps));
            let normal = DVec3::new(cos_j * cos_i, sin_j, -cos_j * sin_i);
            mesh.positions.push(DVec3::new(ring * cos_i, 0.0, -ring * sin_i) + normal * tube);
            mesh.normals.push(normal.normalize());
        }
    }
    for i in 0..=ring_steps {
        for j in 0..=tube_steps {
            mesh.uvs.push(DVec2::new(f64::from(i) / f64::from(ring_steps), f64::from(j) / f64::from(tube_steps)));
        }
    }
    let corner = |i: u32, j: u32| {
        let vertex = i % ring_steps * tube_steps + j % tube_steps;
        Corner { position: vertex, uv: i * (tube_steps + 1) + j, normal: vertex }
    };
    for i in 0..ring_steps {
        for j in 0..tube_steps {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// The unit sphere: an icosahedron whose triangles are cut into four `levels` times.
///
/// Texture coordinates are each vertex's place in its face of the icosahedron, so that no seam is distorted.
pub fn icosphere(levels: u32) -> Mesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut positions: Vec<DVec3> = Vec::new();
    // The cyclic permutations of (0, ±1, ±golden).
    for axis in 0..3 {
        for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
            let mut p = [0.0; 3];
            p[(axis + 1) % 3] = a;
            p[(axis + 2) % 3] = b;
            positions.push(DVec3::from_array(p).normalize());
        }
    }
    let mut mesh = Mesh::default();
    let face_uvs = [DVec2::ZERO, DVec2::X, DVec2::new(0.5, 1.0)];
    let mut triangles: Vec<[(u32, DVec2); 3]> = Vec::new();
    for face in icosahedron_faces(&positions) {
        triangles.push([0, 1, 2].map(|i| (face[i], face_uvs[i])));
    }
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    for _ in 0..levels {
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |p: (u32, DVec2), q: (u32, DVec2)| {
                let number = *middles.entry([p.0.min(q.0), p.0.max(q.0)]).or_insert_with(|| {
                    positions.push((positions[p.0 as usize] + positions[q.0 as usize]).normalize());
                    positions.len() as u32 - 1
                });
                (number, (p.1 + q.1) / 2.0)
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    let mut uv_numbers: HashMap<[u64; 2], u32> = HashMap::new();
    for triangle in triangles {
        let corners = triangle.map(|(position, uv)| {
            let uv_number = *uv_numbers.entry(uv.to_array().map(f64::to_bits)).or_insert_with(|| {
                mesh.uvs.push(uv);
                mesh.uvs.len() as u32 - 1
            });
            Corner { position, uv: uv_number, normal: position }
        });
        mesh.triangles.push(corners);
    }
    mesh.normals.clone_from(&positions);
    mesh.positions = positions;
    mesh
}

/// The twenty triples of vertices that are neighbours of each other, counter-clockwise from outside.
fn icosahedron_faces(vertices: &[DVec3]) -> Vec<[u32; 3]> {
    // Neighbours are 1.05 apart on the unit sphere, all others 1.70 and more.
    let near = |a: usize, b: usize| vertices[a].distance(vertices[b]) < 1.3;
    let mut faces = Vec::new();
    for a in 0..vertices.len() {
        for b in a + 1..vertices.len() {
            for c in b + 1..vertices.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outwards = vertices[a].dot(vertices[b].cross(vertices[c])) > 0.0;
                    let [b, c] = if outwards { [b, c] } else { [c, b] };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Part, Topology, assert_sound, capped_volume};
    use std::f64::consts::PI;

    #[test]
    fn solids_are_closed_and_have_their_volume() {
        for (mesh, part, volume, within) in [
            (cuboid(), Part { euler: 2, boundary_loops: 0, triangles: 12 }, 1.0, 1e-12),
            (icosphere(3), Part { euler: 2, boundary_loops: 0, triangles: 1280 }, 4.0 / 3.0 * PI, 0.05),
            (
                torus(1.0, 0.4, 48, 24),
                Part { euler: 0, boundary_loops: 0, triangles: 2304 },
                2.0 * PI * PI * 0.16,
                0.05,
            ),
        ] {
            assert_sound(&mesh);
            assert_eq!(Topology::of(&mesh).parts, [part]);
            let measured = capped_volume(&mesh);
            assert!(measured <= volume + 1e-12 && measured > volume * (1.0 - within), "{measured} of {volume}");
        }
    }

    #[test]
    fn the_sphere_is_round() {
        let mesh = icosphere(2);
        assert_eq!(mesh.positions.len(), 162);
        assert!(mesh.positions.iter().all(|p| (p.length() - 1.0).abs() < 1e-15));
    }
}
