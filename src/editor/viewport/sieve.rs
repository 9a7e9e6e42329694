//! Which triangles reach a pixel at all, found by all threads before a processor draws them with one.
//!
//! Of a mesh with more triangles than the picture has pixels for, half look away and many lie between the pixels' centres.

use std::ops::Range;

use glam::{DVec4, Vec3};
use rayon::prelude::*;

use crate::editor::viewport::piece::Piece;
use crate::math::vector::dot_f32;

/// How far a corner may be from where it is drawn, in pixels: OpenGL rounds to at least a 16th, f32 at the far end of a
/// large picture to less.
const SLACK: f32 = 0.0625;

/// The least area, in pixels, for which the side that is seen is certain: what the slack may change of a triangle as long
/// as a pixel.
const CERTAIN_AREA: f32 = 2.0 * SLACK;

/// Which triangles can be left out for the side that they show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// None.
    Both,
    /// Those seen clockwise.
    CounterClockwise,
    /// Those seen counter-clockwise.
    Clockwise,
}

/// Those of a piece's indices, within some parts, whose triangles may cover the centre of a pixel; `rows` is the matrix from
/// vertices to clip space, for a picture of this size.
pub fn sift(piece: &Piece, parts: &[Range<u32>], rows: [DVec4; 4], size: (f64, f64), sides: Sides) -> Vec<u32> {
    let places = places(piece, rows, size);
    let (width, height) = (size.0 as f32, size.1 as f32);
    let reaches = |corners: &[u32]| {
        let [a, b, c] = [0, 1, 2].map(|k| places[corners[k] as usize]);
        let (left, right) = (a[0].min(b[0]).min(c[0]) - SLACK, a[0].max(b[0]).max(c[0]) + SLACK);
        let (low, high) = (a[1].min(b[1]).min(c[1]) - SLACK, a[1].max(b[1]).max(c[1]) + SLACK);
        let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let away = match sides {
            Sides::Both => false,
            Sides::CounterClockwise => twice_area < -CERTAIN_AREA,
            Sides::Clockwise => twice_area > CERTAIN_AREA,
        };
        let between = |least: f32, most: f32| (most - 0.5).floor() < (least - 0.5).ceil();
        let beside = right < 0.0 || left > width || high < 0.0 || low > height;
        // What is partly behind the eye has no place, which is NaN, and is kept.
        let is_known = (a[0] + b[0] + c[0]).is_finite();
        !is_known || !(away || beside || between(left, right) || between(low, high))
    };
    let chunks = parts.iter().flat_map(|part| piece.indices[part.start as usize..part.end as usize].chunks(3 * 4096));
    let kept: Vec<Vec<u32>> = chunks
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|chunk| chunk.chunks_exact(3).filter(|corners| reaches(corners)).flatten().copied().collect())
        .collect();
    kept.concat()
}

/// Where vertices are in the picture, in pixels from the lower left; NaN before the nearest that is seen.
fn places(piece: &Piece, rows: [DVec4; 4], (width, height): (f64, f64)) -> Vec<[f32; 2]> {
    let [x, y, z, w] = rows.map(|row| row.as_vec4());
    let (width, height) = (0.5 * width as f32, 0.5 * height as f32);
    let place = |vertex: &crate::editor::viewport::piece::Vertex| {
        let p = Vec3::from_array(vertex.position);
        let depth = dot_f32(w.truncate(), p) + w.w;
        let is_before = dot_f32(z.truncate(), p) + z.w < -depth;
        let inverse = if depth > 0.0 && !is_before { 1.0 / depth } else { f32::NAN };
        let across = (dot_f32(x.truncate(), p) + x.w) * inverse;
        let upward = (dot_f32(y.truncate(), p) + y.w) * inverse;
        [(across + 1.0) * width, (upward + 1.0) * height]
    };
    piece.vertices.par_iter().with_min_len(4096).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::editor::viewport::preview::piece_of_mesh;
    use crate::geometry::TriangleMesh;

    /// Indices left of one triangle, given in pixels of a picture of 10 x 10.
    fn left(corners: [[f32; 2]; 3], sides: Sides) -> usize {
        let positions = corners.map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        let mesh = TriangleMesh { positions, indices: vec![[0, 1, 2]], ..Default::default() };
        let piece = piece_of_mesh(&mesh.finish().unwrap(), &|_| true);
        let rows = [
            DVec4::new(0.2, 0.0, 0.0, -1.0),
            DVec4::new(0.0, 0.2, 0.0, -1.0),
            DVec4::new(0.0, 0.0, 1.0, 0.0),
            DVec4::W,
        ];
        sift(&piece, std::slice::from_ref(&(0..3)), rows, (10.0, 10.0), sides).len()
    }

    #[test]
    fn what_covers_a_centre_stays() {
        let at = |x: f32, y: f32, size: f32| [[x, y], [x + size, y], [x, y + size]];
        assert_eq!(left(at(2.0, 2.0, 3.0), Sides::Both), 3);
        assert_eq!(left(at(2.4, 2.4, 0.3), Sides::Both), 3, "around the centre at 2.5");
        assert_eq!(left(at(2.6, 2.6, 0.3), Sides::Both), 0, "between centres");
        assert_eq!(left(at(2.1, 2.6, 1.0), Sides::Both), 3, "from there to the next row");
        assert_eq!(left(at(12.0, 2.0, 3.0), Sides::Both), 0, "beside the picture");
        assert_eq!(left(at(-2.0, -2.0, 9.0), Sides::Both), 3);
    }

    #[test]
    fn sides_are_told_apart() {
        let front = [[2.0, 2.0], [5.0, 2.0], [2.0, 5.0]];
        let back = [front[1], front[0], front[2]];
        assert_eq!([left(front, Sides::CounterClockwise), left(back, Sides::CounterClockwise)], [3, 0]);
        assert_eq!([left(front, Sides::Clockwise), left(back, Sides::Clockwise)], [0, 3]);
    }
}
