//! Shading normals for meshes that come without: smooth within groups of triangles, or up to an angle between faces.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::TriangleMesh;
use crate::geometry::numbering::Numbering;
use crate::math::vector::{cross, dot, normalize};

/// Stands for corners that have the normal of their face.
const FLAT: u32 = u32::MAX;

/// Stands for vertices that no corner has claimed. There are at most as many fans as corners, fewer than this.
const UNCLAIMED: u32 = u32::MAX - 1;

impl TriangleMesh {
    /// Gives vertices without a normal, or with one of zero, the mean of the faces of their group: of all triangles in the
    /// same group at the same place, weighted by their angle there as in [`compute_normals`](Self::compute_normals). A vertex
    /// at which groups meet is split. Group 0 is flat.
    ///
    /// `runs` are, ascending, triangles from which on triangles are in a group, and the group.
    ///
    /// # Errors
    /// A limit where splitting makes more than 4294967295 vertices.
    pub fn smooth_groups(&mut self, runs: &[(u32, u32)]) -> Result<()> {
        let places = places(&self.positions);
        let mut fans = Numbering::new(self.positions.len());
        let mut run = 0;
        self.give_normals(self.positions.len(), |triangle, _, vertex| {
            if triangle == 0 {
                run = 0;
            }
            while runs.get(run).is_some_and(|&(first, _)| first <= triangle) {
                run += 1;
            }
            match run.checked_sub(1).map_or(0, |run| runs[run].1) {
                0 => FLAT,
                group => fans.number(places[vertex as usize], group),
            }
        })
    }

    /// Gives vertices without a normal, or with one of zero, the mean of the faces around them that can be reached over edges
    /// at which two faces meet whose normals are less than `angle` apart, in radians. Other edges, and those of more than two
    /// faces, are sharp, and vertices at them are split.
    ///
    /// # Errors
    /// A limit for more than 1431655765 triangles, or where splitting makes more than 4294967295 vertices.
    pub fn smooth_creases(&mut self, angle: f64) -> Result<()> {
        if self.indices.len() > (u32::MAX / 3) as usize {
            return Err(Error::limit(format!("mesh `{}` has too many triangles to be smoothed", self.name)));
        }
        let fans = fans(self, libm::cos(angle.clamp(0.0, std::f64::consts::PI)));
        let count = fans.iter().max().map_or(0, |last| *last as usize + 1);
        self.give_normals(count, |triangle, corner, _| fans[3 * triangle as usize + corner])
    }

    /// Gives vertices that lack a normal one for each fan of corners that they are part of. `fan` tells the fan of a corner by
    /// its triangle, its position there and its vertex; it is asked twice for all corners, in the order of triangles. There are
    /// about `count` fans.
    fn give_normals(&mut self, count: usize, mut fan: impl FnMut(u32, usize, u32) -> u32) -> Result<()> {
        let vertices = self.positions.len();
        let is_whole = |triangle: &[u32; 3]| triangle.iter().all(|&vertex| (vertex as usize) < vertices);
        // A vector that grows leaves holes behind, which count as memory in use.
        let mut sums: Vec<DVec3> = Vec::with_capacity(count);
        for (number, triangle) in self.indices.iter().enumerate().filter(|(_, triangle)| is_whole(triangle)) {
            let p = triangle.map(|vertex| self.positions[vertex as usize].as_dvec3());
            let face = normalize(cross(p[1] - p[0], p[2] - p[0]));
            let angles = angles(&p);
            for (corner, &vertex) in triangle.iter().enumerate() {
                let fan = fan(number as u32, corner, vertex);
                if fan != FLAT {
                    if fan as usize >= sums.len() {
                        sums.resize(fan as usize + 1, DVec3::ZERO);
                    }
                    sums[fan as usize] += face.map_or(DVec3::ZERO, |face| face * angles[corner]);
                }
            }
        }
        let of_fans: Vec<Vec3> = sums.iter().map(|&sum| normalize(sum).unwrap_or(DVec3::ZERO).as_vec3()).collect();
        drop(sums);
        let normal = |fan: u32| of_fans.get(fan as usize).copied().unwrap_or(Vec3::ZERO);

        // The fan that a vertex belongs to, and the copies that belong to others.
        let mut own = vec![UNCLAIMED; vertices];
        let mut copies: HashMap<(u32, u32), u32> = HashMap::new();
        self.normals.get_or_insert_with(|| vec![Vec3::ZERO; vertices].into());
        for number in 0..self.indices.len() {
            let triangle = self.indices[number];
            if !is_whole(&triangle) {
                continue;
            }
            for (corner, vertex) in triangle.into_iter().enumerate() {
                let fan = fan(number as u32, corner, vertex);
                let own = &mut own[vertex as usize];
                let given = self.normals.as_ref().map_or(Vec3::ZERO, |normals| normals[vertex as usize]);
                if *own == fan || (*own == UNCLAIMED && given != Vec3::ZERO) {
                    continue;
                }
                let place = if *own == UNCLAIMED {
                    *own = fan;
                    vertex
                } else if let Some(&copy) = copies.get(&(vertex, fan)) {
                    copy
                } else {
                    let copy = self.copy_vertex(vertex)?;
                    copies.insert((vertex, fan), copy);
                    copy
                };
                self.indices[number][corner] = place;
                if let Some(normals) = &mut self.normals {
                    normals[place as usize] = normal(fan);
                }
            }
        }
        Ok(())
    }
}

/// The angles of a triangle; 0 where an edge has no length.
pub(super) fn angles(p: &[DVec3; 3]) -> [f64; 3] {
    let edges: [Option<DVec3>; 3] = std::array::from_fn(|i| normalize(p[(i + 1) % 3] - p[i]));
    std::array::from_fn(|i| match (edges[i], edges[(i + 2) % 3]) {
        (Some(to_next), Some(from_last)) => libm::acos(dot(to_next, -from_last).clamp(-1.0, 1.0)),
        _ => 0.0,
    })
}

/// For each vertex the first at the same place, bit for bit but for the sign of zeros.
pub(super) fn places(positions: &[Vec3]) -> Vec<u32> {
    let key = |vertex: u32| (positions[vertex as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&vertex| (key(vertex), vertex));
    let mut places = vec![0; positions.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&vertex| places[vertex as usize] = same[0]);
    }
    places
}

/// For each corner, three a triangle, the number of its fan: corners at one place are in one where faces that meet at an
/// edge with a cosine above `least` lead from one to the other.
fn fans(mesh: &TriangleMesh, least: f64) -> Vec<u32> {
    let places = places(&mesh.positions);
    let place = |corner: u32| places.get(mesh.indices[corner as usize / 3][corner as usize % 3] as usize).copied();
    let next = |corner: u32| corner - corner % 3 + (corner + 1) % 3;
    let mut edges: Vec<(u32, u32, u32)> = (0..3 * mesh.indices.len() as u32)
        .into_par_iter()
        .filter_map(|corner| {
            let (from, to) = (place(corner)?, place(next(corner))?);
            (from != to).then_some((from.min(to), from.max(to), corner))
        })
        .collect();
    edges.par_sort_unstable();
    let normal = |corner: u32| {
        let [a, b, c] = mesh.triangle(corner / 3).map(|p| p.as_dvec3());
        normalize(cross(b - a, c - a))
    };
    let is_whole = |corner: u32| place(next(next(corner))).is_some();
    let mut fans = Fans((0..3 * mesh.indices.len() as u32).collect());
    for pair in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let &[(low, _, a), (_, _, b)] = pair else { continue };
        if !(is_whole(a) && is_whole(b)) {
            continue;
        }
        if let (Some(normal_a), Some(normal_b)) = (normal(a), normal(b))
            && dot(normal_a, normal_b) > least
        {
            let ends =
                |corner| if place(corner) == Some(low) { (corner, next(corner)) } else { (next(corner), corner) };
            let ((low_a, high_a), (low_b, high_b)) = (ends(a), ends(b));
            fans.join(low_a, low_b);
            fans.join(high_a, high_b);
        }
    }
    fans.into_numbers()
}

/// Sets of corners: each has one of lower number, or itself (Tarjan 1975).
struct Fans(Vec<u32>);

impl Fans {
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn first(&mut self, mut corner: u32) -> u32 {
        while self.0[corner as usize] != corner {
            let lower = self.0[corner as usize];
            self.0[corner as usize] = self.0[lower as usize];
            corner = lower;
        }
        corner
    }

    /// The number of each corner's set, counted from 0 in the order of their first corners.
    fn into_numbers(mut self) -> Vec<u32> {
        for corner in 0..self.0.len() {
            self.0[corner] = self.0[self.0[corner] as usize];
        }
        let mut sets = 0;
        for corner in 0..self.0.len() {
            let first = self.0[corner] as usize;
            // Those of lower number already hold that of their set.
            self.0[corner] = if first == corner { sets } else { self.0[first] };
            sets += u32::from(first == corner);
        }
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::length;

    /// A cube of twelve triangles over eight vertices.
    fn cube() -> TriangleMesh {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        TriangleMesh {
            positions: (0..8).map(corner).collect(),
            indices: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
            ..Default::default()
        }
    }

    /// The shading normal of each corner, the face's where there is none.
    fn corner_normals(mesh: &TriangleMesh) -> Vec<[Vec3; 3]> {
        let of = |(number, triangle): (usize, &[u32; 3])| {
            let [a, b, c] = mesh.triangle(number as u32).map(|p| p.as_dvec3());
            let face = normalize(cross(b - a, c - a)).unwrap().as_vec3();
            triangle.map(|vertex| {
                let own = mesh.normals.as_ref().unwrap()[vertex as usize];
                if own == Vec3::ZERO { face } else { own }
            })
        };
        mesh.indices.iter().enumerate().map(of).collect()
    }

    #[test]
    fn one_group_over_all_is_what_compute_normals_gives() {
        let mut mesh = cube();
        mesh.smooth_groups(&[(0, 7)]).unwrap();
        let mut expected = cube();
        expected.compute_normals();
        assert_eq!(mesh.indices, expected.indices);
        assert_eq!(mesh.normals, expected.normals);
    }

    #[test]
    fn groups_part_at_their_borders_and_group_0_is_flat() {
        // The lower and the upper face are groups of their own, of the sides two are one group and two are flat.
        let mut mesh = cube();
        mesh.smooth_groups(&[(0, 1), (2, 2), (4, 3), (8, 0)]).unwrap();
        let normals = corner_normals(&mesh);
        for (triangle, z) in [(0, -1.0), (1, -1.0), (2, 1.0), (3, 1.0)] {
            assert_eq!(normals[triangle], [Vec3::new(0.0, 0.0, z); 3]);
        }
        // The faces of group 3 look along -y and y and do not touch: each keeps its own normal.
        assert_eq!((normals[4], normals[7]), ([Vec3::NEG_Y; 3], [Vec3::Y; 3]));
        assert_eq!((normals[8], normals[11]), ([Vec3::NEG_X; 3], [Vec3::X; 3]));
        assert_eq!(mesh.positions.len(), 24);
    }

    #[test]
    fn groups_hold_together_vertices_that_lie_at_one_place() {
        let mut mesh = cube();
        mesh.positions = mesh.indices.iter().flatten().map(|&vertex| mesh.positions[vertex as usize]).collect();
        mesh.indices = (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        mesh.smooth_groups(&[(0, 1)]).unwrap();
        for (p, n) in mesh.positions.iter().zip(mesh.normals.as_ref().unwrap()) {
            let outward = normalize((*p - Vec3::splat(0.5)).as_dvec3()).unwrap();
            assert!(length(n.as_dvec3() - outward) < 1e-6, "{p} {n}");
        }
    }

    #[test]
    fn normals_of_the_file_stay() {
        let mut mesh = cube();
        mesh.normals = Some((0..8).map(|i| if i == 0 { Vec3::X * 3.0 } else { Vec3::ZERO }).collect());
        mesh.smooth_groups(&[(0, 1)]).unwrap();
        let normals = mesh.normals.as_ref().unwrap();
        assert_eq!((normals[0], normals.len()), (Vec3::X * 3.0, 8));
        assert!(normals[1..].iter().all(|normal| (length(normal.as_dvec3()) - 1.0).abs() < 1e-6));
    }

    #[test]
    fn edges_are_sharp_from_the_crease_angle_on() {
        let right = std::f64::consts::FRAC_PI_2;
        let mut sharp = cube();
        sharp.smooth_creases(right - 0.01).unwrap();
        for ([a, b, c], normals) in sharp.indices.iter().zip(corner_normals(&sharp)) {
            let [a, b, c] = [a, b, c].map(|&vertex| sharp.positions[vertex as usize].as_dvec3());
            let face = normalize(cross(b - a, c - a)).unwrap().as_vec3();
            assert_eq!(normals, [face; 3]);
        }
        assert_eq!(sharp.positions.len(), 24, "the two triangles of a side share vertices");
        let mut round = cube();
        round.smooth_creases(right + 0.01).unwrap();
        let mut expected = cube();
        expected.compute_normals();
        assert_eq!((round.normals, round.indices), (expected.normals, expected.indices));
    }

    #[test]
    fn bad_triangles_and_crowded_edges_do_no_harm() {
        let mut mesh = cube();
        mesh.indices.extend([[0, 1, 99], [99, 0, 1], [0, 0, 0], [0, 1, 2], [1, 0, 3], [0, 1, 7]]);
        mesh.positions.push(Vec3::NAN);
        mesh.indices.push([0, 1, 8]);
        let mut groups = mesh.clone();
        groups.smooth_groups(&[(0, 1)]).unwrap();
        mesh.smooth_creases(3.2).unwrap();
        for mesh in [mesh, groups] {
            let mesh = mesh.finish().unwrap();
            assert_eq!(mesh.live_count(), 15);
        }
    }
}
