//! The Cornell box: a room with a red and a green wall, two blocks and a lamp in the ceiling.
//!
//! Measurements: Cornell University Program of Computer Graphics, "The Cornell Box: data", in millimetres; written in
//! metres. The camera of the photographs stands at (0.278, 0.273, -0.8) and looks along +Z with +Y up: +X is on its
//! left. The published lamp lies in the plane of an unbroken ceiling; here it fills a hole of its size, so that no two
//! surfaces coincide. The blocks have no bottoms, as published.

use glam::DVec3;

use crate::mesh::{Mesh, UNIT_SQUARE};

/// The materials: linear RGB values that are in common use for the measured reflectances, and a lamp that looks lit.
pub const MATERIALS: &str = "\
# Materials of cornell_box.obj: matt paint, and a lamp that is bright by itself.
newmtl white
Kd 0.725 0.71 0.68
illum 1

newmtl red
Kd 0.63 0.065 0.05
illum 1

newmtl green
Kd 0.14 0.45 0.091
illum 1

newmtl lamp
Kd 0.78 0.78 0.78
Ke 1 0.9 0.7
illum 1
";

/// Corners of the room and of the hole in its ceiling, millimetres; the room is open towards the camera.
const ROOM: [[f64; 3]; 12] = [
    // Floor, counter-clockwise from above, from the camera's right.
    [0.0, 0.0, 0.0],
    [0.0, 0.0, 559.2],
    [549.6, 0.0, 559.2],
    [552.8, 0.0, 0.0],
    // Ceiling above them.
    [0.0, 548.8, 0.0],
    [0.0, 548.8, 559.2],
    [556.0, 548.8, 559.2],
    [556.0, 548.8, 0.0],
    // Lamp below those.
    [213.0, 548.8, 227.0],
    [213.0, 548.8, 332.0],
    [343.0, 548.8, 332.0],
    [343.0, 548.8, 227.0],
];

/// Tops of the blocks, counter-clockwise from above, and their heights.
const SHORT_BLOCK: ([[f64; 2]; 4], f64) = ([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]], 165.0);
const TALL_BLOCK: ([[f64; 2]; 4], f64) = ([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]], 330.0);

/// The whole box.
pub fn mesh() -> Mesh {
    let metres = |[x, y, z]: [f64; 3]| DVec3::new(x, y, z) / 1000.0;
    let mut mesh = Mesh { positions: ROOM.map(metres).to_vec(), ..Mesh::default() };
    mesh.begin_group("white");
    for quad in [[0, 1, 2, 3], [2, 1, 5, 6], [4, 7, 11, 8], [7, 6, 10, 11], [6, 5, 9, 10], [5, 4, 8, 9]] {
        mesh.push_quad(quad, UNIT_SQUARE);
    }
    for (top, height) in [SHORT_BLOCK, TALL_BLOCK] {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(top.iter().map(|&[x, z]| metres([x, height, z])));
        mesh.positions.extend(top.iter().map(|&[x, z]| metres([x, 0.0, z])));
        mesh.push_quad([0, 1, 2, 3].map(|i| first + i), UNIT_SQUARE);
        for i in 0..4 {
            let next = (i + 1) % 4;
            mesh.push_quad([4 + i, 4 + next, next, i].map(|i| first + i), UNIT_SQUARE);
        }
    }
    mesh.begin_group("red");
    mesh.push_quad([3, 2, 6, 7], UNIT_SQUARE);
    mesh.begin_group("green");
    mesh.push_quad([1, 0, 4, 5], UNIT_SQUARE);
    mesh.begin_group("lamp");
    mesh.push_quad([8, 11, 10, 9], UNIT_SQUARE);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::{Part, Topology, capped_volume};

    #[test]
    fn the_room_is_open_in_front_and_the_blocks_below() {
        let mesh = mesh();
        let disc = |triangles| Part { euler: 1, boundary_loops: 1, triangles };
        let mut parts = Topology::of(&mesh).parts;
        parts.sort();
        assert_eq!(parts, [disc(10), disc(10), disc(18)]);
    }

    #[test]
    fn the_room_faces_inwards_and_the_blocks_outwards() {
        let mesh = mesh();
        // The blocks' floor plans, by the shoelace formula.
        let area = |plan: [[f64; 2]; 4]| -> f64 {
            (0..4).map(|i| plan[i][1] * plan[(i + 1) % 4][0] - plan[i][0] * plan[(i + 1) % 4][1]).sum::<f64>() / 2e6
        };
        let blocks = area(SHORT_BLOCK.0) * 0.165 + area(TALL_BLOCK.0) * 0.33;
        assert!(blocks > 0.0);
        let room = blocks - capped_volume(&mesh);
        assert!((room / (0.5528 * 0.5488 * 0.5592) - 1.0).abs() < 0.005, "{room}");
    }

    #[test]
    fn the_red_wall_is_on_the_left_of_the_published_camera() {
        let mesh = mesh();
        let red = mesh.groups.iter().find(|group| group.name == "red").unwrap();
        let left = DVec3::Y.cross(DVec3::Z);
        for corner in mesh.triangles[red.first] {
            assert!((mesh.positions[corner.position as usize] - DVec3::new(0.278, 0.273, -0.8)).dot(left) > 0.0);
            assert!(mesh.normals[corner.normal as usize].dot(left) < -0.99);
        }
    }
}
