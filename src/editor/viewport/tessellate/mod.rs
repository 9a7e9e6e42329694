//! Quadrics as triangles, cut and capped as they are rendered.
//!
//! Marching tetrahedra (Doi and Koide 1991) on a grid whose outermost planes are those of the clip box, so that cuts and
//! caps are exact and share their vertices. The function is quadratic along an edge: vertices are its roots, not linear
//! estimates of them.

mod grid;

use std::collections::HashMap;

use glam::{DVec2, DVec3, DVec4, UVec3};

use crate::editor::viewport::tessellate::grid::Grid;
use crate::geometry::Quadric;
use crate::geometry::quadric::Mapping;
use crate::math::quadratic::{Roots, solve};
use crate::math::vector::{cross, dot, length, normalize};

/// Triangles in a quadric's object space.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tessellation {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Unit normals, towards F > 0 and out of caps.
    pub normals: Vec<DVec3>,
    /// Texture coordinates.
    pub uvs: Vec<DVec2>,
    /// Vertex numbers; counter-clockwise where F > 0.
    pub triangles: Vec<[u32; 3]>,
}

/// A box in object space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// The least corner.
    pub min: DVec3,
    /// The greatest corner.
    pub max: DVec3,
}

impl Extent {
    /// Where a scene has nothing of limited size.
    pub const ORDINARY: Self = Self { min: DVec3::splat(-5.0), max: DVec3::splat(5.0) };

    /// Its corners; bit k of a corner's number says which side of axis k it is on.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { self.max[axis] } else { self.min[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }
}

/// How fine, and how far where a surface has no end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// Cells along the longest side, from 2 on: more are closer to the surface.
    pub cells: u32,
    /// Where endless surfaces have cells of that size.
    pub near: Extent,
    /// Where they end; their cells grow from `near` to here.
    pub far: Extent,
}

/// The triangles of a quadric within its clip box.
pub fn tessellate(quadric: &Quadric, fineness: &Fineness) -> Tessellation {
    let Some(grid) = Grid::of(quadric, fineness) else { return Tessellation::default() };
    let mut march = March { quadric, grid: &grid, numbers: HashMap::new(), result: Tessellation::default() };
    march.surface();
    if quadric.is_solid() {
        march.caps();
    }
    let mut result = march.result;
    give_missing_normals(&mut result);
    match quadric.mapping() {
        Mapping::Spherical => close_seams(&mut result, quadric.center()),
        Mapping::Cylindrical { .. } => close_seams(&mut result, DVec3::ZERO),
        Mapping::Planar { .. } => {}
    }
    result
}

/// The six tetrahedra of a cell around its diagonal (Kuhn 1960), as corners whose bits 0, 1 and 2 say which side of the
/// cell along x, y and z they are on; each right-handed. Neighbouring cells divide their common side alike.
const TETRAHEDRA: [[u32; 4]; 6] = [[0, 1, 3, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 6, 4, 7]];

/// A node of the grid or, between two of them, the place where the function is 0: the numbers of both nodes, ascending.
type Place = (u32, u32);

struct March<'a> {
    quadric: &'a Quadric,
    grid: &'a Grid,
    /// The vertex at a place of the surface (0) or of a cap (2 to 7).
    numbers: HashMap<(Place, u32), u32>,
    result: Tessellation,
}

impl March<'_> {
    fn surface(&mut self) {
        let size = self.grid.size() - 1;
        for (x, y, z) in (0..size.z).flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| (x, y, z)))) {
            let corner = |i: u32| UVec3::new(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2 & 1));
            let inside = (0..8).filter(|&i| self.grid.is_inside(corner(i))).count();
            if inside % 8 != 0 {
                for tetrahedron in TETRAHEDRA {
                    self.tetrahedron(tetrahedron.map(corner));
                }
            }
        }
    }

    /// The triangle or two that part the corners where F <= 0 from the others.
    fn tetrahedron(&mut self, corners: [UVec3; 4]) {
        let is_inside = corners.map(|corner| self.grid.is_inside(corner));
        let [a, b, c, d] = match is_inside.iter().filter(|&&inside| inside).count() {
            0 | 4 => return,
            2 => match is_inside {
                [true, true, ..] => [0, 1, 2, 3],
                [true, _, true, _] => [0, 2, 3, 1],
                [true, ..] => [0, 3, 1, 2],
                [_, true, true, _] => [1, 2, 0, 3],
                [_, true, ..] => [1, 3, 2, 0],
                _ => [2, 3, 0, 1],
            },
            count => {
                // The corner on its own, then the others so that the permutation stays even.
                let lone = is_inside.iter().position(|&inside| inside == (count == 1)).unwrap_or(0);
                [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]][lone]
            }
        }
        .map(|i: usize| corners[i]);
        let is_lone = self.grid.is_inside(a) != self.grid.is_inside(b);
        let mut at = |from: UVec3, to: UVec3| self.crossing(from, to, 0);
        if !is_lone {
            let [p, q, r, s] = [at(a, c), at(a, d), at(b, d), at(b, c)];
            self.triangle([p, q, r]);
            self.triangle([p, r, s]);
        } else {
            let [p, q, r] = [at(a, b), at(a, c), at(a, d)];
            self.triangle(if self.grid.is_inside(a) { [p, q, r] } else { [p, r, q] });
        }
    }

    /// The parts of the clip box's sides where F <= 0.
    fn caps(&mut self) {
        for axis in 0..3 {
            let (across, upward) = ((axis + 1) % 3, (axis + 2) % 3);
            let size = self.grid.size().to_array();
            for end in (0..2).filter(|&end| self.grid.cuts[axis][end]) {
                let number = 2 + 2 * axis as u32 + end as u32;
                for (i, j) in (0..size[upward] - 1).flat_map(|j| (0..size[across] - 1).map(move |i| (i, j))) {
                    let node = |di: u32, dj: u32| {
                        let mut node = [0; 3];
                        node[axis] = if end == 0 { 0 } else { size[axis] - 1 };
                        (node[across], node[upward]) = (i + di, j + dj);
                        UVec3::from_array(node)
                    };
                    // Divided as the tetrahedra divide it, counter-clockwise seen along the axis.
                    let halves = [[node(0, 0), node(1, 0), node(1, 1)], [node(0, 0), node(1, 1), node(0, 1)]];
                    for [a, b, c] in halves {
                        self.cap(if end == 0 { [a, c, b] } else { [a, b, c] }, number);
                    }
                }
            }
        }
    }

    /// The part of a triangle of the grid where F <= 0.
    fn cap(&mut self, corners: [UVec3; 3], surface: u32) {
        let mut outline = Vec::with_capacity(4);
        for (i, corner) in corners.into_iter().enumerate() {
            let next = corners[(i + 1) % 3];
            let (here, there) = (self.grid.is_inside(corner), self.grid.is_inside(next));
            if here {
                let number = self.grid.number(corner);
                outline.push(self.vertex((number, number), self.grid.position(corner), surface));
            }
            if here != there {
                let (from, to) = if here { (corner, next) } else { (next, corner) };
                outline.push(self.crossing(from, to, surface));
            }
        }
        for i in 2..outline.len() {
            self.triangle([outline[0], outline[i - 1], outline[i]]);
        }
    }

    /// The vertex between a node where F <= 0 and one where F > 0.
    fn crossing(&mut self, one: UVec3, other: UVec3, surface: u32) -> u32 {
        let (mut from, mut to) = (self.grid.number(one), self.grid.number(other));
        let (mut a, mut b) = (self.grid.position(one), self.grid.position(other));
        // The same numbers whichever end comes first.
        if from > to {
            std::mem::swap(&mut from, &mut to);
            std::mem::swap(&mut a, &mut b);
        }
        if let Some(&number) = self.numbers.get(&((from, to), surface)) {
            return number;
        }
        let position = a + (b - a) * self.root(a, b);
        let place = match () {
            () if position == a => (from, from),
            () if position == b => (to, to),
            () => (from, to),
        };
        let number = self.vertex(place, position, surface);
        self.numbers.insert(((from, to), surface), number);
        number
    }

    /// Where F is 0 between two points at which it has different signs: the share of the way.
    fn root(&self, a: DVec3, b: DVec3) -> f64 {
        let value = |t: f64| self.quadric.value(a + (b - a) * t);
        let (start, middle, end) = (value(0.0), value(0.5), value(1.0));
        if start == 0.0 || end == 0.0 {
            return if start == 0.0 { 0.0 } else { 1.0 };
        }
        let curvature = 2.0 * (start + end - 2.0 * middle);
        let slope = end - start - curvature;
        // Which of two roots is the one between shows in what is left there; a step of Newton's method mends rounding.
        let within = |t: f64| {
            let derivative = 2.0 * curvature * t + slope;
            let step = value(t) / derivative;
            (if step.abs() < 1e-6 { t - step } else { t }).clamp(0.0, 1.0)
        };
        let off = |t: f64| (t - 0.5).abs();
        match solve(curvature, 0.5 * slope, start) {
            Roots::One(t) => within(t),
            Roots::Two(s, t) => within(if off(s) < off(t) { s } else { t }),
            Roots::None => start / (start - end),
        }
    }

    fn vertex(&mut self, place: Place, position: DVec3, surface: u32) -> u32 {
        let result = &mut self.result;
        let quadric = self.quadric;
        *self.numbers.entry((place, surface)).or_insert_with(|| {
            let normal = match surface {
                0 => normal_at(quadric, position).unwrap_or(DVec3::ZERO),
                cap => DVec3::AXES[(cap as usize - 2) / 2] * if cap % 2 == 1 { 1.0 } else { -1.0 },
            };
            result.positions.push(position);
            result.normals.push(normal);
            result.uvs.push(quadric.uv(position, surface));
            result.positions.len() as u32 - 1
        })
    }

    /// Adds a triangle unless it has shrunk to an edge or a point.
    fn triangle(&mut self, [a, b, c]: [u32; 3]) {
        if a != b && b != c && c != a {
            self.result.triangles.push([a, b, c]);
        }
    }
}

/// The unit normal; `None` at an apex.
fn normal_at(quadric: &Quadric, p: DVec3) -> Option<DVec3> {
    /// Some roundings of f64: sums of terms that cancel to less have no direction.
    const ROUNDING: f64 = 64.0 * f64::EPSILON;
    let &[a, b, c, d, e, f, g, h, i, _] = quadric.coefficients();
    let rows = [DVec4::new(a, d, f, g), DVec4::new(d, b, e, h), DVec4::new(f, e, c, i)];
    let half_gradient = DVec3::from_array(rows.map(|row| dot(row.truncate(), p) + row.w));
    let terms = rows.map(|row| dot(row.truncate().abs(), p.abs()) + row.w.abs());
    let is_certain = half_gradient.abs().max_element() > ROUNDING * DVec3::from_array(terms).max_element();
    normalize(half_gradient).filter(|_| is_certain)
}

/// Gives apexes, where the surface has no normal, one for each triangle there.
fn give_missing_normals(mesh: &mut Tessellation) {
    for at in 0..mesh.triangles.len() {
        let corners = mesh.triangles[at];
        for k in 0..3 {
            let corner = corners[k] as usize;
            if mesh.normals[corner] == DVec3::ZERO {
                let others = mesh.normals[corners[(k + 1) % 3] as usize] + mesh.normals[corners[(k + 2) % 3] as usize];
                let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
                let face = || normalize(cross(b - a, c - a)).unwrap_or(DVec3::Y);
                let normal = normalize(others).unwrap_or_else(face);
                mesh.triangles[at][k] = mesh.copy(corner, |mesh, copy| mesh.normals[copy] = normal);
            }
        }
    }
}

/// Where longitude starts anew, lets it go on within a triangle; poles get that of what is next to them.
fn close_seams(mesh: &mut Tessellation, center: DVec3) {
    let mut beyond: HashMap<u32, u32> = HashMap::new();
    for at in 0..mesh.triangles.len() {
        let corners = mesh.triangles[at];
        let is_pole = corners.map(|corner| {
            let p = mesh.positions[corner as usize] - center;
            p.x == 0.0 && p.z == 0.0
        });
        let u = corners.map(|corner| mesh.uvs[corner as usize].x);
        let others = || (0..3).filter(|&k| !is_pole[k]);
        let least = others().map(|k| u[k]).fold(f64::INFINITY, f64::min);
        let greatest = others().map(|k| u[k]).fold(f64::NEG_INFINITY, f64::max);
        let wraps = greatest - least > 0.5;
        for k in others().filter(|&k| wraps && u[k] < 0.5) {
            let copy = *beyond
                .entry(corners[k])
                .or_insert_with(|| mesh.copy(corners[k] as usize, |mesh, copy| mesh.uvs[copy].x += 1.0));
            mesh.triangles[at][k] = copy;
        }
        if let Some(pole) = (0..3).find(|&k| is_pole[k])
            && others().count() == 2
        {
            let sum: f64 = others().map(|k| mesh.uvs[mesh.triangles[at][k] as usize].x).sum();
            let corner = corners[pole] as usize;
            mesh.triangles[at][pole] = mesh.copy(corner, |mesh, copy| mesh.uvs[copy].x = 0.5 * sum);
        }
    }
}

impl Tessellation {
    /// Appends a copy of a vertex, changed.
    fn copy(&mut self, vertex: usize, change: impl FnOnce(&mut Self, usize)) -> u32 {
        let copy = self.positions.len();
        self.positions.push(self.positions[vertex]);
        self.normals.push(self.normals[vertex]);
        self.uvs.push(self.uvs[vertex]);
        change(self, copy);
        copy as u32
    }

    /// The area of all triangles.
    pub fn area(&self) -> f64 {
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * length(cross(b - a, c - a));
        self.triangles.iter().map(|triangle| area(triangle.map(|corner| self.positions[corner as usize]))).sum()
    }
}

#[cfg(test)]
mod tests;
