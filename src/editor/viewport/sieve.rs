//! Which triangles reach a pixel at all, found by all threads before a processor draws them with one.
//!
//! Of a mesh with more triangles than the picture has pixels for, half look away and many lie between the pixels' centres.

use std::ops::Range;

use glam::{DVec4, Vec4};
use rayon::prelude::*;

use crate::editor::viewport::piece::{CLUSTER, Cluster, Piece, Vertex};
use crate::math::simd::{Level, Task};

/// How far a corner may be from where it is drawn, in pixels: what draws by processors rounds to a 256th, and f32 at the far
/// end of a picture of 4096 pixels to less.
const SLACK: f32 = 1.0 / 64.0;

/// The least area, in pixels, for which the side that is seen is certain: what the slack may change of a triangle as long
/// as a pixel.
const CERTAIN_AREA: f32 = 2.0 * SLACK;

/// Of so many pixels' centres along each side of its box it is looked whether a triangle covers one.
const MOST_CENTRES: u32 = 3;

/// Clusters that one thread takes at once.
const AT_ONCE: usize = 16;

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
    sift_by(Level::chosen(), piece, parts, rows, size, sides)
}

fn sift_by(
    level: Level,
    piece: &Piece,
    parts: &[Range<u32>],
    rows: [DVec4; 4],
    size: (f64, f64),
    sides: Sides,
) -> Vec<u32> {
    let lens = Lens::of(rows, size, sides);
    let mut parts = parts.iter().peekable();
    let is_in_parts = |cluster: &&Cluster| {
        while parts.next_if(|part| part.end <= cluster.indices.start).is_some() {}
        parts.peek().is_some_and(|part| part.start <= cluster.indices.start)
    };
    let clusters: Vec<&Cluster> = piece.clusters.iter().filter(is_in_parts).collect();
    let kept: Vec<Vec<u32>> = clusters
        .par_chunks(AT_ONCE)
        .map(|clusters| {
            let mut kept = Vec::new();
            level.run(Sifting { lens: &lens, piece, clusters, kept: &mut kept });
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
    /// Twice the areas of triangles that are certain to be seen from the other side are below the first or above the second.
    areas: [f32; 2],
}

impl Lens {
    fn of(rows: [DVec4; 4], (width, height): (f64, f64), sides: Sides) -> Self {
        let [x, y, z, w] = rows.map(|row| row.as_vec4());
        let areas = match sides {
            Sides::Both => [f32::NEG_INFINITY, f32::INFINITY],
            Sides::CounterClockwise => [-CERTAIN_AREA, f32::INFINITY],
            Sides::Clockwise => [f32::NEG_INFINITY, CERTAIN_AREA],
        };
        Self { x, y, z, w, half_size: [0.5 * width as f32, 0.5 * height as f32], areas }
    }
}

/// Numbers of as many triangles as a cluster has, in columns.
type Column = [f32; CLUSTER];

/// Numbers of as many vertices as a cluster has at most.
type Places = [f32; 3 * CLUSTER];

struct Sifting<'a> {
    lens: &'a Lens,
    piece: &'a Piece,
    clusters: &'a [&'a Cluster],
    kept: &'a mut Vec<u32>,
}

impl Task for Sifting<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { lens, piece, clusters, kept } = self;
        let (mut x, mut y, mut z): (Places, Places, Places) = ([0.0; _], [0.0; _], [0.0; _]);
        let mut corners: [[Column; 2]; 3] = [[[0.0; _]; 2]; 3];
        let mut covers = [0u8; CLUSTER];
        for cluster in clusters {
            let first = cluster.vertices.start;
            let vertices = &piece.vertices[first as usize..cluster.vertices.end as usize];
            let indices = &piece.indices[cluster.indices.start as usize..cluster.indices.end as usize];
            let (vertex_count, count) = (vertices.len(), indices.len() / 3);
            spread(vertices, &mut x, &mut y, &mut z);
            place(lens, vertex_count, &mut x, &mut y, &z);
            for (triangle, own) in indices.chunks_exact(3).enumerate() {
                for (k, column) in corners.iter_mut().enumerate() {
                    let vertex = (own[k] - first) as usize;
                    (column[0][triangle], column[1][triangle]) = (x[vertex], y[vertex]);
                }
            }
            look(lens, count, &corners, &mut covers);
            // Written whether it is kept or not, since a processor cannot guess which is.
            let start = kept.len();
            kept.resize(start + indices.len() + 3, 0);
            let mut at = start;
            for (own, &covers) in indices.chunks_exact(3).zip(&covers) {
                kept[at..at + 3].copy_from_slice(own);
                at += 3 * usize::from(covers);
            }
            kept.truncate(at);
        }
    }
}

/// The positions of vertices in columns.
#[inline(always)]
fn spread(vertices: &[Vertex], x: &mut Places, y: &mut Places, z: &mut Places) {
    for (((vertex, x), y), z) in vertices.iter().zip(x).zip(y).zip(z) {
        [*x, *y, *z] = vertex.position;
    }
}

/// Where vertices are in the picture, instead of `x` and `y`; NaN before the nearest that is seen.
#[inline(always)]
fn place(lens: &Lens, count: usize, x: &mut Places, y: &mut Places, z: &Places) {
    let [width, height] = lens.half_size;
    let Lens { x: to_x, y: to_y, z: to_z, w: to_w, .. } = *lens;
    let count = count.min(x.len());
    for ((x, y), &z) in x[..count].iter_mut().zip(&mut y[..count]).zip(&z[..count]) {
        let p = [*x, *y, z];
        let depth = along(to_w, p);
        let is_before = (along(to_z, p) >= -depth) & (depth > 0.0);
        let inverse = 1.0 / if is_before { depth } else { f32::NAN };
        *x = (along(to_x, p) * inverse + 1.0) * width;
        *y = (along(to_y, p) * inverse + 1.0) * height;
    }
}

#[inline(always)]
fn along(row: Vec4, [x, y, z]: [f32; 3]) -> f32 {
    row.x * x + row.y * y + row.z * z + row.w
}

/// Which of so many triangles may cover the centre of a pixel: 1 for those.
#[inline(always)]
fn look(lens: &Lens, count: usize, corners: &[[Column; 2]; 3], covers: &mut [u8; CLUSTER]) {
    let [width, height] = lens.half_size.map(|half| 2.0 * half);
    let [least, greatest] = lens.areas;
    let [[ax, ay], [bx, by], [cx, cy]] = corners;
    let count = count.min(CLUSTER);
    let (ax, ay, bx, by, cx, cy) = (&ax[..count], &ay[..count], &bx[..count], &by[..count], &cx[..count], &cy[..count]);
    for k in 0..count {
        let (a, b, c) = ([ax[k], ay[k]], [bx[k], by[k]], [cx[k], cy[k]]);
        let twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        // What is partly behind the eye has no place, which is NaN, and is kept.
        let has_place = !twice_area.is_nan();
        let is_away = (twice_area < least) | (twice_area > greatest);

        // The first and the last centre that is not outside, as numbers with a half; of large triangles they are far apart.
        let (left, right) = extent(a[0], b[0], c[0], width);
        let (low, high) = extent(a[1], b[1], c[1], height);
        let is_between = (right < left) | (high < low);
        let is_large = (right - left >= MOST_CENTRES as f32) | (high - low >= MOST_CENTRES as f32);

        let side = if twice_area < 0.0 { -1.0 } else { 1.0 };
        let edges = [edge(a, b, side, left, low), edge(b, c, side, left, low), edge(c, a, side, left, low)];
        let mut is_covered = false;
        for row in 0..MOST_CENTRES {
            for column in 0..MOST_CENTRES {
                let (i, j) = (column as f32, row as f32);
                let is_in_box = (left + i <= right) & (low + j <= high);
                let is_left_of = |[at, dx, dy]: [f32; 3]| dx * j - dy * i >= at;
                is_covered |= is_in_box & is_left_of(edges[0]) & is_left_of(edges[1]) & is_left_of(edges[2]);
            }
        }
        covers[k] = u8::from(!has_place | (!is_away & !is_between & (is_large | is_covered)));
    }
}

/// The first and the last pixel's centre along one axis that is not outside of a triangle, in a picture of so many pixels.
#[inline(always)]
fn extent(a: f32, b: f32, c: f32, pixels: f32) -> (f32, f32) {
    let least = lesser(lesser(a, b), c);
    let greatest = -lesser(lesser(-a, -b), -c);
    let first = -floor(0.5 + SLACK - least) + 0.5;
    let last = floor(greatest - 0.5 + SLACK) + 0.5;
    // Centres beside the picture do not count.
    (if first < 0.5 { 0.5 } else { first }, lesser(last, pixels - 0.5))
}

/// Of an edge: how far its left side must reach beyond a centre, and what each step to other centres adds.
///
/// A centre `(x + i, y + j)` is left of it, or hardly right, where `dx j - dy i` is at least the first.
#[inline(always)]
fn edge(from: [f32; 2], to: [f32; 2], side: f32, x: f32, y: f32) -> [f32; 3] {
    let (dx, dy) = ((to[0] - from[0]) * side, (to[1] - from[1]) * side);
    let slack = SLACK * (dx.abs() + dy.abs());
    [dy * (x - from[0]) - dx * (y - from[1]) - slack, dx, dy]
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greatest whole number that is not above a number; what f32 holds no halves of is as it is.
#[inline(always)]
fn floor(x: f32) -> f32 {
    // Numbers of this size have no fractions.
    const WHOLE: f32 = 12_582_912.0;
    let rounded = (x + WHOLE) - WHOLE;
    let whole = rounded - if rounded > x { 1.0 } else { 0.0 };
    if x.abs() < 4_194_304.0 { whole } else { x }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, Vec3};

    use super::*;
    use crate::editor::viewport::preview::piece_of_mesh;
    use crate::geometry::TriangleMesh;
    use crate::math::random::{hash2, unit};

    /// Which of some triangles, given in pixels of a picture of 10 x 10, are kept.
    fn kept(triangles: &[[[f32; 2]; 3]], sides: Sides) -> Vec<bool> {
        let positions = triangles.iter().flatten().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect();
        let indices = (0..triangles.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = TriangleMesh { positions, indices, ..Default::default() };
        let piece = piece_of_mesh(&mesh.finish().unwrap(), &|_| true);
        let rows = [
            DVec4::new(0.2, 0.0, 0.0, -1.0),
            DVec4::new(0.0, 0.2, 0.0, -1.0),
            DVec4::new(0.0, 0.0, 1.0, 0.0),
            DVec4::W,
        ];
        let all = 0..piece.indices.len() as u32;
        let left = |level| sift_by(level, &piece, std::slice::from_ref(&all), rows, (10.0, 10.0), sides);
        let indices = left(Level::PORTABLE);
        for level in Level::available() {
            assert_eq!(left(level), indices, "{}", level.name());
        }
        // Pieces have their triangles in another order.
        let corners = |indices: &[u32]| -> Vec<[[f32; 2]; 3]> {
            let at = |&vertex: &u32| {
                [piece.vertices[vertex as usize].position[0], piece.vertices[vertex as usize].position[1]]
            };
            indices.chunks_exact(3).map(|own| [at(&own[0]), at(&own[1]), at(&own[2])]).collect()
        };
        let left = corners(&indices);
        triangles.iter().map(|triangle| left.contains(triangle)).collect()
    }

    /// Indices left of one triangle.
    fn left(corners: [[f32; 2]; 3], sides: Sides) -> usize {
        if kept(&[corners], sides)[0] { 3 } else { 0 }
    }

    #[test]
    fn of_random_triangles_those_that_cover_centres_are_kept_and_hardly_another() {
        // How far inside all edges the point of a triangle's centres is that is farthest inside; below 0 outside.
        let depth = |corners: &[[f32; 2]; 3]| {
            let at = |k: usize| DVec2::from_array(corners[k % 3].map(f64::from));
            let area = (at(1) - at(0)).perp_dot(at(2) - at(0));
            let inside = |p: DVec2| {
                let of_edge = |k: usize| {
                    let along = at(k + 1) - at(k);
                    along.perp_dot(p - at(k)) * area.signum() / (along.x.abs() + along.y.abs())
                };
                (0..3).map(of_edge).fold(f64::INFINITY, f64::min)
            };
            let centres = (0..100).map(|k| DVec2::new(f64::from(k % 10) + 0.5, f64::from(k / 10) + 0.5));
            (centres.map(inside).fold(f64::NEG_INFINITY, f64::max), area)
        };
        let random = |seed: u32, k: u32| unit(hash2(seed, k)) as f32;
        let triangles: Vec<[[f32; 2]; 3]> = (0..3000)
            .map(|seed| {
                let size = 0.5 * 20f32.powf(random(seed, 0));
                let from = [random(seed, 1) * 14.0 - 2.0, random(seed, 2) * 14.0 - 2.0];
                [3, 5, 7].map(|k| [from[0] + size * random(seed, k), from[1] + size * random(seed, k + 1)])
            })
            .collect();
        let slack = f64::from(SLACK);
        for sides in [Sides::Both, Sides::CounterClockwise, Sides::Clockwise] {
            let (mut wanted, mut dropped) = (0, 0);
            for (corners, is_kept) in triangles.iter().zip(kept(&triangles, sides)) {
                let (inside, area) = depth(corners);
                let is_seen = match sides {
                    Sides::Both => true,
                    Sides::CounterClockwise => area > 0.0,
                    Sides::Clockwise => area < 0.0,
                };
                let span = (0..2).map(|axis| {
                    let column = corners.map(|corner| corner[axis]);
                    column.into_iter().fold(f32::NEG_INFINITY, f32::max)
                        - column.into_iter().fold(f32::INFINITY, f32::min)
                });
                if inside >= 0.0 && is_seen {
                    assert!(is_kept, "{corners:?} covers a centre");
                    wanted += 1;
                } else if inside < -2.0 * slack && span.fold(0.0, f32::max) < MOST_CENTRES as f32 - 2.0 * SLACK {
                    assert!(!is_kept, "{corners:?} is kept, {inside}");
                    dropped += 1;
                } else if !is_seen && area.abs() > 2.0 * f64::from(CERTAIN_AREA) {
                    assert!(!is_kept, "{corners:?} is kept, but looks away");
                }
            }
            assert!(wanted > 200 && dropped > 500, "{wanted} {dropped}");
        }
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
