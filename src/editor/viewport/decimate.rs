//! A coarse stand-in for a large piece, shown while the camera moves: vertex clustering (Rossignac and Borrel 1993).

use std::collections::HashSet;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::editor::viewport::piece::{Piece, Source, unpacked};
use crate::math::vector::{cross, dot, length};

/// A piece of at most so many triangles that looks like `piece`: each vertex is the mean of those in its cell of a grid.
///
/// Where normals of a cell point along different axes they stay apart, so that thin walls keep their shading.
pub fn decimate(piece: &Piece, most: usize) -> Piece {
    let mut cell = first_cell(piece, most);
    let mut coarse = Coarse::of(piece, cell);
    // The first guess may be too coarse or too fine: triangles are as many as cells have area.
    let share = (coarse.triangles.len() as f64 / most.max(1) as f64).sqrt();
    if share < 0.75 && share > 0.0 {
        cell *= share * 1.05;
        coarse = Coarse::of(piece, cell);
    }
    while coarse.triangles.len() > most {
        cell *= (coarse.triangles.len() as f64 / most.max(1) as f64).sqrt().max(1.05);
        coarse = Coarse::of(piece, cell);
    }
    let mut result = Piece::of(&coarse, piece.origin, piece.scale);
    // What is closed stays so, but for where its own sides meet.
    (result.is_closed, result.is_inside_out) = (piece.is_closed, piece.is_inside_out);
    if piece.is_inside_out {
        result.clusters.iter_mut().for_each(|cluster| cluster.axis = -cluster.axis);
    }
    result
}

/// The side of cells for about so many triangles: a surface passes about one and a half cells for each that would cover it, with
/// two triangles in each.
fn first_cell(piece: &Piece, most: usize) -> f64 {
    let at = |index: u32| Vec3::from_array(piece.vertices[index as usize].position).as_dvec3();
    let area = |corners: &[u32]| {
        let [a, b, c] = [0, 1, 2].map(|k| at(corners[k]));
        0.5 * length(cross(b - a, c - a))
    };
    let area: f64 = piece.indices.par_chunks_exact(3).map(area).sum();
    (3.0 * area / most.max(1) as f64).sqrt()
}

/// Triangles between cells.
struct Coarse<'a> {
    piece: &'a Piece,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// For each vertex, one of the piece's that has its texture coordinates and colour.
    originals: Vec<u32>,
    triangles: Vec<([u32; 3], u32)>,
}

impl<'a> Coarse<'a> {
    fn of(piece: &'a Piece, cell: f64) -> Self {
        let min = piece.bounds.0.as_dvec3();
        // 20 bits an axis and 3 for the direction of the normal.
        let number = |p: DVec3| {
            let steps = ((p - min) / cell).clamp(DVec3::ZERO, DVec3::splat(1_048_575.0)).as_u64vec3();
            steps.x | steps.y << 20 | steps.z << 40
        };
        let mut places: Vec<(u64, u32)> = piece
            .vertices
            .par_iter()
            .enumerate()
            .map(|(vertex, v)| {
                let cell = number(Vec3::from_array(v.position).as_dvec3());
                (cell << 3 | facing(unpacked(v.normal)), vertex as u32)
            })
            .collect();
        places.par_sort_unstable();

        let mut coarse =
            Self { piece, positions: Vec::new(), normals: Vec::new(), originals: Vec::new(), triangles: Vec::new() };
        // Vertices of one cell, whatever their normals, stand at one place, or there would be gaps.
        let mut vertex_of = vec![0u32; piece.vertices.len()];
        let mut cell_of_vertex = Vec::new();
        let at = |vertex: u32| Vec3::from_array(piece.vertices[vertex as usize].position).as_dvec3();
        for (cell_number, cell) in places.chunk_by(|a, b| a.0 >> 3 == b.0 >> 3).enumerate() {
            let mean = cell.iter().map(|&(_, vertex)| at(vertex)).sum::<DVec3>() / cell.len() as f64;
            for side in cell.chunk_by(|a, b| a.0 == b.0) {
                let new = coarse.positions.len() as u32;
                let normal = side.iter().map(|&(_, v)| unpacked(piece.vertices[v as usize].normal)).sum::<Vec3>();
                let apart = |vertex: u32| dot(at(vertex) - mean, at(vertex) - mean);
                let nearest = side.iter().map(|place| place.1).min_by(|&a, &b| apart(a).total_cmp(&apart(b)));
                coarse.positions.push(mean.as_vec3());
                coarse.normals.push(normal);
                coarse.originals.extend(nearest);
                cell_of_vertex.push(cell_number as u32);
                side.iter().for_each(|&(_, vertex)| vertex_of[vertex as usize] = new);
            }
        }

        let mut seen = HashSet::new();
        for cluster in &piece.clusters {
            let indices = &piece.indices[cluster.indices.start as usize..cluster.indices.end as usize];
            for corners in indices.chunks_exact(3) {
                let corners = [corners[0], corners[1], corners[2]].map(|vertex| vertex_of[vertex as usize]);
                // Of thin walls both sides stay, and each of their triangles once, whichever corner comes first.
                let mut cells = corners.map(|vertex| cell_of_vertex[vertex as usize]);
                let least = (0..3).min_by_key(|&k| cells[k]).unwrap_or(0);
                cells.rotate_left(least);
                let [a, b, c] = corners.map(|vertex| coarse.positions[vertex as usize].as_dvec3());
                let is_thin = cross(b - a, c - a) == DVec3::ZERO;
                let is_whole = cells[0] != cells[1] && cells[1] != cells[2] && cells[2] != cells[0];
                if is_whole && !is_thin && seen.insert(cells) {
                    coarse.triangles.push((corners, cluster.material));
                }
            }
        }
        coarse
    }
}

/// Along which axis a normal points most: 0 to 5.
fn facing(normal: Vec3) -> u64 {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis as u64 + u64::from(normal[axis] < 0.0)
}

impl Source for Coarse<'_> {
    fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    fn corners(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle].0
    }

    fn material(&self, triangle: usize) -> u32 {
        self.triangles[triangle].1
    }

    fn is_flat(&self, _: usize) -> bool {
        false
    }

    fn position(&self, vertex: u32) -> Vec3 {
        self.positions[vertex as usize]
    }

    fn normal(&self, vertex: u32) -> Vec3 {
        self.normals[vertex as usize]
    }

    fn uv(&self, vertex: u32) -> Option<[f32; 4]> {
        self.piece.uvs.as_ref().map(|uvs| uvs[self.originals[vertex as usize] as usize])
    }

    fn color(&self, vertex: u32) -> Option<[u16; 4]> {
        self.piece.colors.as_ref().map(|colors| colors[self.originals[vertex as usize] as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::viewport::preview::piece_of_mesh;
    use crate::geometry::TriangleMesh;

    /// A torus of 2 n^2 triangles.
    fn torus(n: u32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for i in 0..n * n {
            let angle = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
            let ((sin_a, cos_a), (sin_b, cos_b)) = (libm::sincos(angle(i / n)), libm::sincos(angle(i % n)));
            let ring = 1.0 + 0.4 * cos_b;
            mesh.positions.push(DVec3::new(ring * cos_a, 0.4 * sin_b, ring * sin_a).as_vec3());
            let at = |di: u32, dj: u32| (i / n + di) % n * n + (i % n + dj) % n;
            mesh.indices.extend([[at(0, 0), at(0, 1), at(1, 0)], [at(1, 0), at(0, 1), at(1, 1)]]);
        }
        let mut mesh = mesh.finish().unwrap();
        mesh.compute_normals();
        mesh
    }

    #[test]
    fn stand_ins_are_bounded_near_the_surface_and_without_degenerate_triangles() {
        let piece = piece_of_mesh(&torus(200), &|_| false);
        assert_eq!(piece.triangle_count(), 80_000);
        for most in [20_000, 5_000, 300] {
            let stand_in = decimate(&piece, most);
            let count = stand_in.triangle_count();
            assert!(count <= most && count > most / 3, "{count} of {most}");
            // No cell is larger than the one the search began with, times what it may have grown.
            let cell = 2.0 * first_cell(&piece, most);
            for vertex in &stand_in.vertices {
                let p = Vec3::from_array(vertex.position).as_dvec3();
                let ring = DVec3::new(p.x, 0.0, p.z) * (1.0 - 1.0 / length(DVec3::new(p.x, 0.0, p.z)));
                let from_surface = (length(DVec3::new(length(ring), p.y, 0.0)) - 0.4).abs();
                assert!(from_surface < cell, "{p}: {from_surface} of {cell}");
            }
            for corners in stand_in.indices.chunks_exact(3) {
                let [a, b, c] =
                    [0, 1, 2].map(|k| Vec3::from_array(stand_in.vertices[corners[k] as usize].position).as_dvec3());
                assert!(length(cross(b - a, c - a)) > 0.0);
            }
        }
    }

    #[test]
    fn closed_bodies_are_found_whichever_way_they_look() {
        let mut mesh = torus(60);
        let closed = |mesh: &TriangleMesh| {
            let mut piece = piece_of_mesh(mesh, &|_| false);
            piece.find_whether_closed();
            let outward = piece.clusters.iter().filter(|cluster| cluster.spread < 1.0).all(|cluster| {
                let p = cluster.center.as_dvec3();
                let ring = DVec3::new(p.x, 0.0, p.z) / length(DVec3::new(p.x, 0.0, p.z));
                dot(p - ring, cluster.axis.as_dvec3()) > 0.0
            });
            (piece.is_closed, outward)
        };
        assert_eq!(closed(&mesh), (true, true));
        mesh.indices.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        assert_eq!(closed(&mesh), (true, true));
        mesh.indices.update(|indices| indices.truncate(indices.len() / 2));
        assert!(!closed(&mesh).0);
    }
}
