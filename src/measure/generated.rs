//! Large models that need no file: the same on every machine, for speed and memory.

use glam::{DVec3, Vec3};

use crate::error::Result;
use crate::geometry::TriangleMesh;
use crate::math::random::{Random, hash2, unit};
use crate::math::vector::{basis, cross, normalize};

/// A model that is made when it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Generated {
    /// Fractal hills, 1,048,352 triangles.
    Terrain1M,
    /// Fractal hills, 4,193,408 triangles.
    Terrain4M,
    /// A ball of 7,500 thin curling tubes, 2,880,000 triangles.
    Hairball,
}

impl Generated {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Terrain1M, Self::Terrain4M, Self::Hairball];

    /// The name on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Terrain1M => "terrain-1m",
            Self::Terrain4M => "terrain-4m",
            Self::Hairball => "hairball",
        }
    }

    /// Makes it.
    ///
    /// # Errors
    /// As [`TriangleMesh::finish`].
    pub fn mesh(self) -> Result<TriangleMesh> {
        let mesh = match self {
            Self::Terrain1M => terrain(724),
            Self::Terrain4M => terrain(1448),
            Self::Hairball => hairball(7500, 32, 6),
        };
        TriangleMesh { name: self.name().into(), ..mesh }.finish()
    }
}

/// `side` x `side` squares over [-1, 1]^2, y up, two triangles each.
fn terrain(side: u32) -> TriangleMesh {
    let place = |i: u32| 2.0 * f64::from(i) / f64::from(side) - 1.0;
    let rows = (0..=side).flat_map(|z| (0..=side).map(move |x| (x, z)));
    let positions = rows.map(|(x, z)| {
        let (x, z) = (place(x), place(z));
        DVec3::new(x, height(x, z), z).as_vec3()
    });
    let corner = |x: u32, z: u32| z * (side + 1) + x;
    let squares = (0..side).flat_map(|z| (0..side).map(move |x| (x, z)));
    let indices = squares.flat_map(|(x, z)| {
        let (a, b, c, d) = (corner(x, z), corner(x + 1, z), corner(x, z + 1), corner(x + 1, z + 1));
        [[a, c, d], [a, d, b]]
    });
    TriangleMesh { positions: positions.collect(), indices: indices.collect(), ..TriangleMesh::default() }
}

/// The terrain's height: ten octaves of value noise, each half as high and twice as fine as the one before.
pub fn height(x: f64, z: f64) -> f64 {
    let (mut sum, mut amplitude, mut frequency) = (0.0, 0.25, 2.0);
    for octave in 0..10 {
        sum += amplitude * noise(x * frequency, z * frequency, octave);
        (amplitude, frequency) = (amplitude * 0.5, frequency * 2.0);
    }
    sum
}

/// Value noise in [-1, 1]: random at whole numbers, smooth between them.
fn noise(x: f64, z: f64, salt: u32) -> f64 {
    let (floor_x, floor_z) = (libm::floor(x), libm::floor(z));
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (u, v) = (smooth(x - floor_x), smooth(z - floor_z));
    let at = |dx: i32, dz: i32| {
        let (x, z) = ((floor_x as i32 + dx) as u32, (floor_z as i32 + dz) as u32);
        2.0 * unit(hash2(hash2(x, z), salt)) - 1.0
    };
    let near = at(0, 0) + (at(1, 0) - at(0, 0)) * u;
    let far = at(0, 1) + (at(1, 1) - at(0, 1)) * u;
    near + (far - near) * v
}

/// Open tubes of `segments` parts with `sides` sides that start on a small ball and wander outwards.
fn hairball(hairs: u32, segments: u32, sides: u32) -> TriangleMesh {
    const CORE: f64 = 0.25;
    const STEP: f64 = 0.035;
    const RADIUS: f64 = 0.0016;
    const CURL: f64 = 0.45;
    let mut positions: Vec<Vec3> = Vec::with_capacity((hairs * (segments + 1) * sides) as usize);
    let mut indices = Vec::with_capacity((hairs * segments * sides * 2) as usize);
    for hair in 0..hairs {
        let random = &mut Random::new(0x6861_6972, hair.into());
        let mut along = random.direction();
        let mut place = along * CORE;
        let (mut across, _) = basis(along);
        for ring in 0..=segments {
            let first = positions.len() as u32;
            // The frame is carried along, so that the tube is not twisted.
            let up = normalize(cross(along, across)).unwrap_or_else(|| basis(along).1);
            across = cross(up, along);
            for side in 0..sides {
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(side) / f64::from(sides));
                positions.push((place + (across * cos + up * sin) * RADIUS).as_vec3());
                if ring < segments {
                    let (a, b) = (first + side, first + (side + 1) % sides);
                    indices.extend([[a, b, b + sides], [a, b + sides, a + sides]]);
                }
            }
            place += along * STEP;
            along = normalize(along + random.direction() * CURL).unwrap_or(along);
        }
    }
    TriangleMesh { positions: positions.into(), indices: indices.into(), ..TriangleMesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::{dot, length};

    #[test]
    fn models_have_the_triangles_that_are_told_and_none_without_area() {
        assert_eq!(2 * 724 * 724, 1_048_352);
        assert_eq!(2 * 1448 * 1448, 4_193_408);
        assert_eq!(7500 * 32 * 6 * 2, 2_880_000);
        for (mesh, count) in [(terrain(40), 3200), (hairball(50, 32, 6), 19_200)] {
            let mesh = mesh.finish().unwrap();
            assert_eq!((mesh.live_count(), mesh.dropped.len()), (count, 0));
        }
    }

    #[test]
    fn hills_face_up_and_are_continuous() {
        let mesh = terrain(64).finish().unwrap();
        for number in mesh.live_triangles() {
            let [a, b, c] = mesh.triangle(number).map(|p| p.as_dvec3());
            assert!(cross(b - a, c - a).y > 0.0, "{number}");
        }
        for i in 0..1000 {
            let x = f64::from(i) * 0.0137 - 7.0;
            assert!((height(x, 0.3) - height(x + 1e-9, 0.3)).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn tubes_face_outward_and_are_as_thick_everywhere() {
        let mesh = hairball(3, 32, 6).finish().unwrap();
        for ring in mesh.positions.chunks(6) {
            let middle = ring.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / 6.0;
            assert!(ring.iter().all(|p| (length(p.as_dvec3() - middle) - 0.0016).abs() < 1e-6));
        }
        for number in mesh.live_triangles() {
            let [a, b, c] = mesh.triangle(number).map(|p| p.as_dvec3());
            let ring = number as usize / 12 / 32 * 33 + number as usize / 12 % 32;
            let middle = mesh.positions[ring * 6..ring * 6 + 6].iter().map(|p| p.as_dvec3()).sum::<DVec3>() / 6.0;
            assert!(dot(cross(b - a, c - a), a - middle) > 0.0, "{number}");
        }
    }
}
