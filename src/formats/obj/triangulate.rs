//! Polygons into triangles.

use std::collections::HashMap;

use earcut::Earcut;
use glam::DVec3;

use crate::math::vector::cross;

/// Polygons with more corners are cut into a fan. Ear clipping takes time between n log n and n^2: some seconds for a
/// polygon of this size that crosses itself everywhere, measured on random corners.
pub(super) const MOST_CORNERS: usize = 1 << 16;

/// Cuts polygons of n corners into n - 2 triangles, always, so that the number of a triangle depends on the counts of
/// corners alone.
///
/// The winding is kept. A quad that is convex is cut along the diagonal from its first corner; other polygons by
/// ear clipping, on the coordinate plane that they cover best. Corners that lie on a straight line between their
/// neighbours stay corners of triangles, so that no T-junction arises beside a polygon that shares them. A polygon
/// that has no area, crosses itself beyond repair or is not finite is cut into a fan.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    /// The polygon on its plane, counter-clockwise.
    plane: Vec<[f64; 2]>,
    cut: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl Triangulator {
    /// The triangles of a polygon, as positions in `corners`, of which there are at least 3.
    pub fn triangulate(&mut self, corners: &[DVec3]) -> &[[u32; 3]] {
        self.triangles.clear();
        let count = corners.len() as u32;
        let done = count > 3
            && corners.len() <= MOST_CORNERS
            && self.project(corners)
            && !self.is_convex_quad()
            && self.clip_ears();
        if !done {
            self.triangles.clear();
            self.triangles.extend((2..count).map(|i| [0, i - 1, i]));
        }
        &self.triangles
    }

    /// Drops the coordinate along which the polygon is widest seen, which rounds nothing; false if there is no area.
    fn project(&mut self, corners: &[DVec3]) -> bool {
        // Twice the polygon's area vector, from its first corner so that a place far from zero costs no digits.
        let relative = |i: usize| corners[i] - corners[0];
        let area = (1..corners.len() - 1).fold(DVec3::ZERO, |sum, i| sum + cross(relative(i), relative(i + 1)));
        let size = area.abs();
        let (i, j) = match (size.x >= size.y && size.x >= size.z, size.y >= size.z) {
            (true, _) => (1, 2),
            (false, true) => (2, 0),
            (false, false) => (0, 1),
        };
        let normal = area[3 - i - j];
        let (i, j) = if normal < 0.0 { (j, i) } else { (i, j) };
        self.plane.clear();
        self.plane.extend((0..corners.len()).map(|corner| [relative(corner)[i], relative(corner)[j]]));
        area.is_finite() && normal != 0.0
    }

    /// Twice the signed area of a triangle on the plane.
    fn area(&self, [a, b, c]: [u32; 3]) -> f64 {
        let [a, b, c] = [a, b, c].map(|i| self.plane[i as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }

    fn is_convex_quad(&self) -> bool {
        self.plane.len() == 4 && [[0, 1, 2], [1, 2, 3], [2, 3, 0], [3, 0, 1]].iter().all(|&t| self.area(t) > 0.0)
    }

    /// Cuts by earcut; false if that does not give the full number of triangles.
    fn clip_ears(&mut self) -> bool {
        let Self { earcut, plane, cut, triangles } = self;
        earcut.earcut_slice(plane, &[], cut);
        triangles.extend(cut.as_chunks::<3>().0);
        // Earcut has a winding of its own; the projection is counter-clockwise.
        if self.triangles.iter().map(|&triangle| self.area(triangle)).sum::<f64>() < 0.0 {
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self.restore_straight_corners();
        self.triangles.len() == self.plane.len() - 2
    }

    /// Puts corners back that earcut left out because they lie on the line between their neighbours.
    fn restore_straight_corners(&mut self) {
        let count = self.plane.len();
        if self.triangles.len() == count - 2 {
            return;
        }
        let mut used = vec![false; count];
        self.triangles.as_flattened().iter().for_each(|&corner| used[corner as usize] = true);
        let Some(first) = used.iter().position(|&used| used) else { return };
        let mut edges = Edges::new();
        for (number, &[a, b, c]) in self.triangles.iter().enumerate() {
            edges.extend([((a, b), (number, c)), ((b, c), (number, a)), ((c, a), (number, b))]);
        }
        let mut start = first;
        while start < first + count {
            let end = (start + 1..).find(|&i| used[i % count]).unwrap_or(first + count);
            let chain: Vec<u32> = (start..=end).map(|i| (i % count) as u32).collect();
            self.divide_side(&chain, &mut edges);
            start = end;
        }
    }

    /// Divides the triangle over the side from the chain's first corner to its last into a fan over the chain.
    fn divide_side(&mut self, chain: &[u32], edges: &mut Edges) {
        let &[a, _, .., b] = chain else { return };
        let [from, to] = [a, b].map(|i| self.plane[i as usize]);
        let along = |&i: &u32| {
            let p = self.plane[i as usize];
            (p[0] - from[0]) * (to[0] - from[0]) + (p[1] - from[1]) * (to[1] - from[1])
        };
        let forward = chain.is_sorted_by_key(along);
        let Some((number, apex)) = edges.remove(&(a, b)).filter(|_| forward) else {
            // A spike out and back covers nothing: flat triangles keep the count.
            self.triangles.extend(chain[1..].windows(2).map(|pair| [a, pair[0], pair[1]]));
            return;
        };
        for (step, pair) in chain.windows(2).enumerate() {
            let (from, to) = (pair[0], pair[1]);
            let place = if step == 0 { number } else { self.triangles.len() };
            if step > 0 {
                self.triangles.push([0; 3]);
            }
            self.triangles[place] = [from, to, apex];
            edges.extend([((from, to), (place, apex)), ((to, apex), (place, from)), ((apex, from), (place, to))]);
        }
    }
}

/// For each directed edge, the number of the triangle on its left and the corner opposite.
type Edges = HashMap<(u32, u32), (usize, u32)>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::{dot, length};

    fn cut(corners: &[[f64; 3]]) -> Vec<[u32; 3]> {
        let corners: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
        Triangulator::default().triangulate(&corners).to_vec()
    }

    fn flat(corners: &[[f64; 2]]) -> Vec<[f64; 3]> {
        corners.iter().map(|&[x, y]| [x, y, 0.0]).collect()
    }

    /// Every side of the polygon bounds one triangle, every other edge two in opposite directions, no triangle is
    /// turned round, and the areas add up.
    fn check(corners: &[[f64; 3]]) {
        let triangles = cut(corners);
        let count = corners.len() as u32;
        assert_eq!(triangles.len(), corners.len() - 2);
        let mut edges = std::collections::BTreeMap::new();
        for [a, b, c] in &triangles {
            for edge in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry(edge).or_insert(0) += 1;
            }
        }
        for (&(a, b), &times) in &edges {
            assert_eq!(times, 1, "{a} {b}");
            assert_ne!((a + 1) % count == b, edges.contains_key(&(b, a)), "{a} {b} of {triangles:?}");
        }
        let p: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
        let whole = (0..p.len()).fold(DVec3::ZERO, |sum, i| sum + cross(p[i], p[(i + 1) % p.len()]));
        let mut sum = 0.0;
        for [a, b, c] in triangles.iter().map(|t| t.map(|i| p[i as usize])) {
            let area = cross(b - a, c - a);
            assert!(dot(area, whole) >= 0.0, "turned round");
            sum += length(area);
        }
        assert!((sum - length(whole)).abs() < 1e-9 * sum, "{sum} {}", length(whole));
    }

    #[test]
    fn convex_quads_are_cut_from_their_first_corner() {
        let quad = flat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(cut(&quad), [[0, 1, 2], [0, 2, 3]]);
        let clockwise: Vec<_> = quad.iter().rev().copied().collect();
        assert_eq!(cut(&clockwise), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_are_covered_once_in_every_orientation() {
        let arrow = [[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]];
        let comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let star: Vec<[f64; 2]> = (0..100)
            .map(|i| (f64::from(i) * std::f64::consts::TAU / 100.0, if i % 2 == 0 { 1.0 } else { 0.3 }))
            .map(|(angle, radius)| [libm::cos(angle) * radius, libm::sin(angle) * radius])
            .collect();
        for shape in [&arrow[..], &comb, &star] {
            for shift in 0..4 {
                let mut shape = shape.to_vec();
                shape.rotate_left(shift);
                for turned in [false, true] {
                    if turned {
                        shape.reverse();
                    }
                    check(&flat(&shape));
                    check(&shape.iter().map(|&[x, y]| [x + 100.0, 7.0 + 0.1 * x, y]).collect::<Vec<_>>());
                    check(&shape.iter().map(|&[x, y]| [x + y, y, x]).collect::<Vec<_>>());
                }
            }
        }
    }

    #[test]
    fn corners_on_straight_sides_stay() {
        check(&flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0], [3.0, 3.0], [0.0, 3.0], [0.0, 1.0]]));
        check(&flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 5.0]]));
        check(&flat(&[[1.0, 0.0], [2.0, 0.0], [1.0, 5.0], [0.0, 0.0]]));
    }

    #[test]
    fn hopeless_polygons_still_give_their_number_of_triangles() {
        let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4]];
        assert_eq!(cut(&[[0.0; 3]; 5]), fan);
        assert_eq!(cut(&flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [1.5, 0.0]])), fan);
        let mut bad = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 1.0], [1.0, 2.0], [0.0, 1.0]]);
        bad[3][1] = f64::NAN;
        assert_eq!(cut(&bad), fan);
        bad[3][1] = 1e300;
        bad[2][0] = -1e300;
        assert_eq!(cut(&bad).len(), 3);
        let bow_tie = flat(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 1.0]]);
        assert_eq!(cut(&bow_tie).len(), 2);
        let repeated = flat(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(cut(&repeated).len(), 4);
    }
}
