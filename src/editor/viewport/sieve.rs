//! Which triangles reach a pixel at all, found by all threads before a processor draws them with one.
//!
//! Of a mesh with more triangles than the picture has pixels for, half look away and many lie between the pixels' centres.

use std::ops::Range;

use glam::{DVec4, Vec3, Vec4};
use rayon::prelude::*;

use crate::editor::viewport::piece::{Cluster, Piece, Vertex};

/// How far a corner may be from where it is drawn, in pixels: what draws by processors rounds to a 256th, and f32 at the far
/// end of a picture of 4096 pixels to less.
const SLACK: f32 = 1.0 / 64.0;

/// The least area, in pixels, for which the side that is seen is certain: what the slack may change of a triangle as long
/// as a pixel.
const CERTAIN_AREA: f32 = 2.0 * SLACK;

/// Of so many pixels' centres along each side of its box it is looked whether a triangle covers one.
const MOST_CENTRES: i32 = 3;

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
/// vertices to clip space, for a picture of this size. Parts are ascending, and made of whole clusters.
pub fn sift(piece: &Piece, parts: &[Range<u32>], rows: [DVec4; 4], size: (f64, f64), sides: Sides) -> Vec<u32> {
    let lens = Lens::of(rows, size);
    let mut parts = parts.iter().peekable();
    let is_in_parts = |cluster: &&Cluster| {
        while parts.next_if(|part| part.end <= cluster.indices.start).is_some() {}
        parts.peek().is_some_and(|part| part.start <= cluster.indices.start)
    };
    let clusters: Vec<&Cluster> = piece.clusters.iter().filter(is_in_parts).collect();
    let kept: Vec<Vec<u32>> = clusters
        .par_chunks(16)
        .map(|clusters| {
            let (mut kept, mut places) = (Vec::new(), Vec::new());
            clusters.iter().for_each(|cluster| lens.sift(piece, cluster, sides, &mut places, &mut kept));
            kept
        })
        .collect();
    kept.concat()
}

/// What brings vertices into the picture, in pixels from the lower left.
struct Lens {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    w: Vec4,
    half_size: [f32; 2],
}

impl Lens {
    fn of(rows: [DVec4; 4], (width, height): (f64, f64)) -> Self {
        let [x, y, z, w] = rows.map(|row| row.as_vec4());
        Self { x, y, z, w, half_size: [0.5 * width as f32, 0.5 * height as f32] }
    }

    /// Where a vertex is; NaN before the nearest that is seen.
    #[inline(always)]
    fn place(&self, vertex: &Vertex) -> [f32; 2] {
        let p = Vec3::from_array(vertex.position);
        let along = |row: Vec4| row.x * p.x + row.y * p.y + row.z * p.z + row.w;
        let depth = along(self.w);
        let inverse = if (along(self.z) >= -depth) & (depth > 0.0) { 1.0 / depth } else { f32::NAN };
        let [width, height] = self.half_size;
        [(along(self.x) * inverse + 1.0) * width, (along(self.y) * inverse + 1.0) * height]
    }

    /// Appends the indices of those of a cluster's triangles that may cover a centre; `places` is room for its vertices.
    fn sift(&self, piece: &Piece, cluster: &Cluster, sides: Sides, places: &mut Vec<[f32; 2]>, kept: &mut Vec<u32>) {
        let first = cluster.vertices.start;
        let vertices = &piece.vertices[first as usize..cluster.vertices.end as usize];
        places.clear();
        places.extend(vertices.iter().map(|vertex| self.place(vertex)));
        let indices = &piece.indices[cluster.indices.start as usize..cluster.indices.end as usize];
        for corners in indices.chunks_exact(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]].map(|corner| places[(corner - first) as usize]);
            if self.may_cover([a, b, c], sides) {
                kept.extend_from_slice(corners);
            }
        }
    }

    /// Whether a triangle may cover the centre of a pixel.
    #[inline(always)]
    fn may_cover(&self, [a, b, c]: [[f32; 2]; 3], sides: Sides) -> bool {
        let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let away = match sides {
            Sides::Both => false,
            Sides::CounterClockwise => twice_area < -CERTAIN_AREA,
            Sides::Clockwise => twice_area > CERTAIN_AREA,
        };
        if away {
            return false;
        }
        // What is partly behind the eye has no place, which is NaN, and is kept.
        if twice_area.is_nan() {
            return true;
        }
        let [width, height] = self.half_size;
        let span =
            |axis: usize| (lesser(lesser(a[axis], b[axis]), c[axis]), -lesser(lesser(-a[axis], -b[axis]), -c[axis]));
        let ((left, right), (low, high)) = (span(0), span(1));
        if (right < -SLACK) | (left > 2.0 * width + SLACK) | (high < -SLACK) | (low > 2.0 * height + SLACK) {
            return false;
        }
        // Centres beside the picture do not count, and whole numbers hold the others.
        let (left, right) = (left.max(-1.0), right.min(2.0 * width + 1.0));
        let (low, high) = (low.max(-1.0), high.min(2.0 * height + 1.0));
        // The first and the last centre that is not outside; large triangles have many.
        let (first_x, last_x) = (-floor(0.5 + SLACK - left), floor(right - 0.5 + SLACK));
        let (first_y, last_y) = (-floor(0.5 + SLACK - low), floor(high - 0.5 + SLACK));
        if (last_x < first_x) | (last_y < first_y) {
            return false;
        }
        if (last_x - first_x >= MOST_CENTRES) | (last_y - first_y >= MOST_CENTRES) {
            return true;
        }
        let side = if twice_area < 0.0 { -1.0 } else { 1.0 };
        (first_y..=last_y)
            .any(|y| (first_x..=last_x).any(|x| is_within([a, b, c], side, [x as f32 + 0.5, y as f32 + 0.5])))
    }
}

/// Whether a point is left of all three edges of a triangle, or hardly right of one; `side` is -1 for clockwise ones.
#[inline(always)]
fn is_within(corners: [[f32; 2]; 3], side: f32, [x, y]: [f32; 2]) -> bool {
    (0..3).all(|k| {
        let ([from_x, from_y], [to_x, to_y]) = (corners[k], corners[(k + 1) % 3]);
        let (dx, dy) = ((to_x - from_x) * side, (to_y - from_y) * side);
        dx * (y - from_y) - dy * (x - from_x) >= -SLACK * (dx.abs() + dy.abs())
    })
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greatest whole number that is not above a number, without a call.
#[inline(always)]
fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut.saturating_sub(i32::from(x < cut as f32))
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
        assert_eq!(left(at(2.3, 2.3, 0.3), Sides::Both), 0, "the box alone is around a centre");
        assert_eq!(left(at(2.4, 2.4, 1.0), Sides::Both), 3);
        assert_eq!(left([[0.0, 2.6], [9.0, 2.6], [0.0, 2.7]], Sides::Both), 0, "between rows");
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
