//! Triangles as the graphics card takes them: packed vertices, in clusters that can be left out.

use std::collections::HashMap;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::math::vector::{cross, dot, length, normalize};

/// Triangles of a cluster at most: enough that each is worth a decision, few enough that their normals agree.
pub const CLUSTER: usize = 512;

/// A vertex: 20 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// Relative to the piece's origin, divided by its scale.
    pub position: [f32; 3],
    /// Unit normal in fractions of 32767, and 0. Mesa's software takes three times ten bits one by one, these together.
    pub normal: [i16; 4],
}

/// Neighbouring triangles of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Position of its material in the scene's list.
    pub material: u32,
    /// Which of the piece's indices are its triangles'.
    pub indices: Range<u32>,
    /// Which of the piece's vertices are its own.
    pub vertices: Range<u32>,
    /// The middle of its box.
    pub center: Vec3,
    /// The farthest vertex from there.
    pub radius: f32,
    /// The mean of the faces' normals.
    pub axis: Vec3,
    /// The sine of the largest angle between `axis` and a face's normal; 1 where that is a right angle or more.
    pub spread: f32,
}

/// A shape's triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Where positions are relative to, in the shape's coordinates.
    pub origin: DVec3,
    /// What multiplies positions.
    pub scale: f64,
    /// The vertices.
    pub vertices: Vec<Vertex>,
    /// Texture coordinates, the second set after the first.
    pub uvs: Option<Vec<[f32; 4]>>,
    /// Colours and alpha, linear.
    pub colors: Option<Vec<[u16; 4]>>,
    /// Vertex numbers, three a triangle, counter-clockwise from the front.
    pub indices: Vec<u32>,
    /// Ascending by material.
    pub clusters: Vec<Cluster>,
    /// The least and the greatest corner of the vertices' box.
    pub bounds: (Vec3, Vec3),
    /// Whether its triangles are the whole outside of a body, so that those seen from behind are hidden.
    pub is_closed: bool,
    /// Whether the fronts of a closed piece look inward.
    pub is_inside_out: bool,
}

/// Where a piece comes from: triangles over vertices.
pub trait Source: Sync {
    /// Number of triangles.
    fn triangle_count(&self) -> usize;
    /// Its vertices.
    fn corners(&self, triangle: usize) -> [u32; 3];
    /// Its material.
    fn material(&self, triangle: usize) -> u32;
    /// Whether the face's normal counts, not the vertices'.
    fn is_flat(&self, triangle: usize) -> bool;
    /// Where a vertex is.
    fn position(&self, vertex: u32) -> Vec3;
    /// Its normal, of any length; zero for the face's.
    fn normal(&self, vertex: u32) -> Vec3;
    /// Its texture coordinates, both sets; `None` if there are none.
    fn uv(&self, vertex: u32) -> Option<[f32; 4]>;
    /// Its colour; `None` if there are none.
    fn color(&self, vertex: u32) -> Option<[u16; 4]>;
}

/// One cluster before all are put together.
struct Part {
    material: u32,
    vertices: Vec<Vertex>,
    uvs: Vec<[f32; 4]>,
    colors: Vec<[u16; 4]>,
    indices: Vec<u32>,
}

impl Piece {
    /// The triangles of a source, whose positions are relative to `origin` and divided by `scale`.
    pub fn of(source: &impl Source, origin: DVec3, scale: f64) -> Self {
        let count = source.triangle_count();
        let middle = |triangle: usize| {
            let [a, b, c] = source.corners(triangle).map(|vertex| source.position(vertex));
            (a + b + c) / 3.0
        };
        let (min, max) = (0..count)
            .into_par_iter()
            .map(|triangle| (middle(triangle), middle(triangle)))
            .reduce(|| (Vec3::INFINITY, Vec3::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let cells = Vec3::splat(1023.0) / (max - min).max(Vec3::splat(f32::MIN_POSITIVE));
        let mut order: Vec<(u64, u32)> = (0..count)
            .into_par_iter()
            .map(|triangle| {
                let cell = ((middle(triangle) - min) * cells).as_uvec3().to_array();
                let curve = (0..10).fold(0, |code, bit| {
                    (0..3).fold(code, |code, axis| code | u64::from(cell[axis] >> bit & 1) << (3 * bit + axis))
                });
                (u64::from(source.material(triangle)) << 32 | curve, triangle as u32)
            })
            .collect();
        order.par_sort_unstable();

        let runs: Vec<&[(u64, u32)]> =
            order.chunk_by(|a, b| a.0 >> 32 == b.0 >> 32).flat_map(|run| run.chunks(CLUSTER)).collect();
        let parts: Vec<Part> = runs.into_par_iter().map(|run| Part::of(source, run)).collect();
        let mut piece = Self {
            origin,
            scale,
            vertices: Vec::new(),
            uvs: None,
            colors: None,
            indices: Vec::new(),
            clusters: Vec::new(),
            bounds: (Vec3::ZERO, Vec3::ZERO),
            is_closed: false,
            is_inside_out: false,
        };
        parts.into_iter().for_each(|part| piece.append(part));
        piece.bounds = bounds_of(&piece.vertices);
        piece
    }

    fn append(&mut self, part: Part) {
        let first = self.vertices.len() as u32;
        let start = self.indices.len() as u32;
        let (min, max) = bounds_of(&part.vertices);
        let center = min + (max - min) * 0.5;
        let place = |vertex: &Vertex| Vec3::from_array(vertex.position);
        let apart = |vertex: &Vertex| length((place(vertex) - center).as_dvec3()) as f32;
        let radius = part.vertices.iter().map(apart).fold(0.0, f32::max);
        let faces: Vec<DVec3> = part
            .indices
            .chunks_exact(3)
            .filter_map(|corners| {
                let at = |k: usize| place(&part.vertices[corners[k] as usize]).as_dvec3();
                normalize(cross(at(1) - at(0), at(2) - at(0)))
            })
            .collect();
        let axis = normalize(faces.iter().sum()).unwrap_or(DVec3::ZERO);
        let cosine = faces.iter().map(|&face| dot(face, axis)).fold(1.0, f64::min);
        let spread = if cosine > 0.0 { (1.0 - cosine * cosine).max(0.0).sqrt() } else { 1.0 };
        self.indices.extend(part.indices.iter().map(|&index| first + index));
        self.clusters.push(Cluster {
            material: part.material,
            indices: start..self.indices.len() as u32,
            vertices: first..first + part.vertices.len() as u32,
            center,
            radius,
            axis: axis.as_vec3(),
            spread: spread as f32,
        });
        self.vertices.extend(part.vertices);
        if !part.uvs.is_empty() {
            self.uvs.get_or_insert_default().extend(part.uvs);
        }
        if !part.colors.is_empty() {
            self.colors.get_or_insert_default().extend(part.colors);
        }
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.indices.len() / 3
    }

    /// Looks whether it is [closed](Self::is_closed), and turns the clusters' axes outward where fronts look inward.
    pub fn find_whether_closed(&mut self) {
        let mut places: Vec<([u32; 3], u32)> =
            self.vertices.iter().map(|v| v.position.map(|x| (x + 0.0).to_bits())).zip(0..).collect();
        places.par_sort_unstable();
        let mut welded = vec![0u32; self.vertices.len()];
        for same in places.chunk_by(|a, b| a.0 == b.0) {
            same.iter().for_each(|&(_, vertex)| welded[vertex as usize] = same[0].1);
        }
        let mut edges: Vec<(u32, u32, i8)> = self
            .indices
            .par_chunks_exact(3)
            .flat_map_iter(|corners| {
                let welded = [corners[0], corners[1], corners[2]].map(|corner| welded[corner as usize]);
                (0..3).map(move |k| {
                    let (from, to) = (welded[k], welded[(k + 1) % 3]);
                    if from < to { (from, to, 1) } else { (to, from, -1) }
                })
            })
            .collect();
        edges.par_sort_unstable();
        let balance = |same: &[(u32, u32, i8)]| same.iter().map(|edge| i64::from(edge.2)).sum::<i64>().unsigned_abs();
        let open: u64 = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(balance).sum();
        let corner = |index: u32| Vec3::from_array(self.vertices[index as usize].position).as_dvec3();
        let middle = ((self.bounds.0 + self.bounds.1) * 0.5).as_dvec3();
        let volume = |corners: &[u32]| {
            let [a, b, c] = [0, 1, 2].map(|k| corner(corners[k]) - middle);
            dot(a, cross(b, c))
        };
        let volume: f64 = self.indices.par_chunks_exact(3).map(volume).sum();
        // Scans have pinholes, through which nothing is seen of the inside.
        self.is_closed = open * 1000 < edges.len() as u64;
        self.is_inside_out = volume < 0.0;
        if self.is_inside_out {
            self.clusters.iter_mut().for_each(|cluster| cluster.axis = -cluster.axis);
        }
    }
}

impl Part {
    /// Some triangles, by material and number, with vertices of their own.
    fn of(source: &impl Source, triangles: &[(u64, u32)]) -> Self {
        let material = triangles.first().map_or(0, |first| (first.0 >> 32) as u32);
        let mut part =
            Self { material, vertices: Vec::new(), uvs: Vec::new(), colors: Vec::new(), indices: Vec::new() };
        let mut numbers: HashMap<(u32, [i16; 4]), u32> = HashMap::with_capacity(triangles.len());
        for &(_, triangle) in triangles {
            let triangle = triangle as usize;
            let corners = source.corners(triangle);
            let [a, b, c] = corners.map(|vertex| source.position(vertex).as_dvec3());
            let face = normalize(cross(b - a, c - a)).unwrap_or(DVec3::Y);
            let is_flat = source.is_flat(triangle);
            for vertex in corners {
                let own = (!is_flat).then(|| normalize(source.normal(vertex).as_dvec3())).flatten();
                let normal = packed(own.unwrap_or(face));
                let number = *numbers.entry((vertex, normal)).or_insert_with(|| {
                    part.vertices.push(Vertex { position: source.position(vertex).to_array(), normal });
                    part.uvs.extend(source.uv(vertex));
                    part.colors.extend(source.color(vertex));
                    part.vertices.len() as u32 - 1
                });
                part.indices.push(number);
            }
        }
        part
    }
}

fn bounds_of(vertices: &[Vertex]) -> (Vec3, Vec3) {
    let all = vertices.iter().map(|vertex| Vec3::from_array(vertex.position));
    let bounds = all.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
    if vertices.is_empty() { (Vec3::ZERO, Vec3::ZERO) } else { bounds }
}

/// A unit vector as [`Vertex::normal`] holds it.
fn packed(normal: DVec3) -> [i16; 4] {
    let [x, y, z] = (normal * 32767.0).round().to_array().map(|x| x as i16);
    [x, y, z, 0]
}

/// What [`Vertex::normal`] holds, not quite of unit length.
pub fn unpacked([x, y, z, _]: [i16; 4]) -> Vec3 {
    Vec3::new(f32::from(x), f32::from(y), f32::from(z)) / 32767.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash2, unit};

    #[test]
    fn normals_keep_their_direction() {
        for seed in 0..200 {
            let random = |k: u32| unit(hash2(seed, k)) * 2.0 - 1.0;
            let Some(normal) = normalize(DVec3::new(random(0), random(1), random(2))) else { continue };
            let back = unpacked(packed(normal)).as_dvec3();
            assert!((back - normal).abs().max_element() < 2e-5, "{normal} {back}");
        }
    }
}
