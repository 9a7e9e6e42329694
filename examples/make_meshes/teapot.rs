//! Cuts the teapot's patches into triangles.
//!
//! Positions are computed exactly: control points are whole numbers, parameters are fractions with one denominator, so
//! a cubic in them is a whole number over its cube. Points on borders that patches share are therefore equal whichever
//! patch they are computed from, and the mesh has no cracks.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use crate::mesh::{Corner, Mesh};
use crate::patches::{self, Part, Patch, UNITS};

/// The teapot, +Y up, standing on y = 0, spout towards +X; every patch is cut into `steps` times `steps` squares.
///
/// `steps` from 1 to 100 keeps the whole numbers below 2^63.
pub fn mesh(steps: i64) -> Mesh {
    let mut mesh = Mesh::default();
    // The picture stands upright on every patch: both parameters run against it.
    let fraction = |i: i64| (steps - i) as f64 / steps as f64;
    for j in 0..=steps {
        for i in 0..=steps {
            mesh.uvs.push(DVec2::new(fraction(i), fraction(j)));
        }
    }
    // A corner of the handle lies exactly on the body: parts share no vertices.
    let mut numbers: HashMap<(Part, [i64; 3]), u32> = HashMap::new();
    let scale = (UNITS * steps.pow(6)) as f64;
    for (part, patch) in &patches::teapot() {
        let mut vertex = |i: i64, j: i64| {
            let exact = combine(patch, bernstein(i, steps), bernstein(j, steps));
            *numbers.entry((*part, exact)).or_insert_with(|| {
                mesh.positions.push(y_up(exact) / scale);
                mesh.normals.push(y_up_normal(patch, i, j, steps));
                mesh.positions.len() as u32 - 1
            })
        };
        for j in 0..steps {
            for i in 0..steps {
                let corner = |(i, j): (i64, i64)| {
                    let number = vertex(i, j);
                    Corner { position: number, uv: (j * (steps + 1) + i) as u32, normal: number }
                };
                let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(corner);
                // At a pole one of the two triangles has no area.
                for triangle in [[a, b, c], [a, c, d]] {
                    let [p, q, r] = triangle.map(|corner| corner.position);
                    if p != q && q != r && r != p {
                        mesh.triangles.push(triangle);
                    }
                }
            }
        }
    }
    mesh
}

/// The unit normal of a patch at `(i, j) / steps`, pointing outwards.
fn y_up_normal(patch: &Patch, i: i64, j: i64, steps: i64) -> DVec3 {
    let along_v = y_up(combine(patch, bernstein(i, steps), slope(j, steps)));
    let mut along_u = y_up(combine(patch, slope(i, steps), bernstein(j, steps)));
    if along_u == DVec3::ZERO {
        // At a pole all of a row is one point. Close to it the surface runs as the next row of control points does.
        let next_row = if j == 0 { [0, 1, 0, 0] } else { [0, 0, 1, 0] };
        along_u = y_up(combine(patch, slope(i, steps), next_row));
    }
    along_u.cross(along_v).normalize()
}

/// Weighted sum of control points: exact, in units of 1 / (UNITS * the weights' denominators).
fn combine(patch: &Patch, across: [i64; 4], down: [i64; 4]) -> [i64; 3] {
    let mut sum = [0; 3];
    for (row, v) in patch.iter().zip(down) {
        for (point, u) in row.iter().zip(across) {
            for axis in 0..3 {
                sum[axis] += u * v * point[axis];
            }
        }
    }
    sum
}

/// The cubic Bernstein polynomials at `i / n`, times n^3.
fn bernstein(i: i64, n: i64) -> [i64; 4] {
    let j = n - i;
    [j * j * j, 3 * i * j * j, 3 * i * i * j, i * i * i]
}

/// Their derivatives, times n^2 / 3.
fn slope(i: i64, n: i64) -> [i64; 4] {
    let j = n - i;
    [-j * j, j * j - 2 * i * j, 2 * i * j - i * i, i * i]
}

/// Turns +Z up into +Y up.
fn y_up([x, y, z]: [i64; 3]) -> DVec3 {
    DVec3::new(x as f64, z as f64, -y as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{self, Topology, assert_sound, capped_volume};

    #[test]
    fn the_pot_is_whole_except_where_the_original_is_open() {
        let mesh = mesh(10);
        assert_sound(&mesh);
        assert_eq!(mesh.triangles.len(), 32 * 200 - 8 * 10);
        let mut parts = Topology::of(&mesh).parts;
        parts.sort();
        let part = |euler, boundary_loops, triangles| topology::Part { euler, boundary_loops, triangles };
        // Handle and spout are tubes; the lid, and the body up to its rim, are discs.
        assert_eq!(parts, [part(0, 2, 800), part(0, 2, 800), part(1, 1, 1560), part(1, 1, 3160)]);
    }

    #[test]
    fn it_stands_upright_and_faces_outwards() {
        let mesh = mesh(10);
        let low = mesh.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = mesh.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        // Heights and widths where a curve's extreme is one of its end points.
        assert_eq!((low.y, high.y), (0.0, 3.15));
        assert_eq!((low.z, high.z), (-2.0, 2.0));
        assert_eq!(low.x, -3.0);
        assert!(high.x > 3.4 && high.x < 3.525);
        let volume = capped_volume(&mesh);
        assert!(volume > 20.0 && volume < 30.0, "{volume}");
        let top = mesh.positions.iter().position(|p| p.y == 3.15).unwrap();
        let bottom = mesh.positions.iter().position(|p| *p == DVec3::ZERO).unwrap();
        assert_eq!((mesh.normals[top], mesh.normals[bottom]), (DVec3::Y, DVec3::NEG_Y));
    }

    #[test]
    fn patches_agree_on_the_normals_of_their_seams() {
        let steps = 10;
        let mut normals: HashMap<(Part, [i64; 3]), DVec3> = HashMap::new();
        for (part, patch) in &patches::teapot() {
            for (i, j) in (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j))) {
                let exact = combine(patch, bernstein(i, steps), bernstein(j, steps));
                let normal = y_up_normal(patch, i, j, steps);
                let first = *normals.entry((*part, exact)).or_insert(normal);
                assert!(first.distance(normal) < 1e-12, "{exact:?}: {first} and {normal}");
            }
        }
    }

    #[test]
    fn the_polynomials_are_bernsteins() {
        for i in 0..=7 {
            assert_eq!(bernstein(i, 7).iter().sum::<i64>(), 343);
            assert_eq!(slope(i, 7).iter().sum::<i64>(), 0);
            let h = 1e-6;
            let cubic = |t: f64| 3.0 * t * t * (1.0 - t);
            let t = i as f64 / 7.0;
            let numeric = (cubic(t + h) - cubic(t - h)) / (2.0 * h);
            assert!((slope(i, 7)[2] as f64 * 3.0 / 49.0 - numeric).abs() < 1e-9);
        }
    }
}
