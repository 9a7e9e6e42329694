//! Meshes that tests are made of, and the random numbers behind them.

use std::sync::Arc;

use glam::Vec3;

use crate::geometry::TriangleMesh;
use crate::math::random::{hash2, unit};

/// A repeatable sequence of numbers.
pub struct Random(u32, u32);

impl Random {
    pub fn new(seed: u32) -> Self {
        Self(seed, 0)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.1 += 1;
        (unit(hash2(self.1, self.0)) as f32).min(1f32.next_down())
    }

    pub fn below(&mut self, end: usize) -> usize {
        (f64::from(self.unit()) * end as f64) as usize
    }

    /// Components in [-1, 1).
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

pub fn mesh(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Arc<TriangleMesh> {
    TriangleMesh { positions: positions.into(), indices: indices.into(), ..TriangleMesh::default() }
        .finish()
        .unwrap()
        .into()
}

/// Triangles that share nothing.
pub fn soup(triangles: &[[Vec3; 3]]) -> Arc<TriangleMesh> {
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(triangles.concat(), indices)
}

pub fn random_soup(random: &mut Random, count: usize, size: f32) -> Arc<TriangleMesh> {
    let triangle = |random: &mut Random| {
        let center = random.vector();
        [(); 3].map(|()| center + random.vector() * size)
    };
    soup(&(0..count).map(|_| triangle(random)).collect::<Vec<_>>())
}

/// A closed sphere of `rows` by `columns` quadrilaterals, radius 2, around the origin.
pub fn sphere(rows: u32, columns: u32) -> Arc<TriangleMesh> {
    let mut positions = vec![Vec3::new(0.0, 0.0, 2.0)];
    for row in 1..rows {
        let polar = std::f64::consts::PI * f64::from(row) / f64::from(rows);
        for column in 0..columns {
            let azimuth = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let (x, y) = (polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin());
            positions.push(Vec3::new(2.0 * x as f32, 2.0 * y as f32, 2.0 * polar.cos() as f32));
        }
    }
    positions.push(Vec3::new(0.0, 0.0, -2.0));
    let last = positions.len() as u32 - 1;
    let at = |row: u32, column: u32| match row {
        0 => 0,
        row if row == rows => last,
        row => 1 + (row - 1) * columns + column % columns,
    };
    let mut indices = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            indices.extend([[a, c, d], [a, d, b]].into_iter().filter(|[i, j, k]| i != j && j != k && i != k));
        }
    }
    mesh(positions, indices)
}

/// An axis-flat grid of unit squares around the origin in the plane where coordinate `axis` is `height`.
pub fn grid(cells: u32, axis: usize, height: f32) -> Arc<TriangleMesh> {
    let side = cells + 1;
    let point = |i: u32| {
        let (x, y) = ((i % side) as f32 - cells as f32 / 2.0, (i / side) as f32 - cells as f32 / 2.0);
        let mut p = Vec3::splat(height);
        p[(axis + 1) % 3] = x;
        p[(axis + 2) % 3] = y;
        p
    };
    let corner = |x: u32, y: u32| y * side + x;
    let cell = |x: u32, y: u32| {
        let (a, b, c, d) = (corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1));
        [[a, b, d], [a, d, c]]
    };
    mesh((0..side * side).map(point).collect(), (0..cells * cells).flat_map(|i| cell(i % cells, i / cells)).collect())
}

pub fn transformed(mesh: &Arc<TriangleMesh>, scale: f32, shift: Vec3) -> Arc<TriangleMesh> {
    let positions = mesh.positions.iter().map(|&p| p * scale + shift).collect();
    TriangleMesh { positions, ..(**mesh).clone() }.finish().unwrap().into()
}
