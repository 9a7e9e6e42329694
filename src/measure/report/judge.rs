//! Whether an answer is right, by the exact oracle; and what is a matter of rounding.
//!
//! Coordinates relative to a ray's origin are rounded to f32 once, so that no f32 test can know a ray's line better
//! than to some ulp of them. Where a line passes that near to an edge, either side may be answered: a neighbour across
//! an edge is right, a closed surface never lets it through, and at the rim of the surface as the ray sees it (an open
//! edge, or one where the surface turns away) a hit or a miss is borderline. All else is exact.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use crate::geometry::{Hit, Ray, TriangleMesh};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::vector::{cross, dot, length};
use crate::measure::oracle::{ExactHit, Oracle};

/// How near to an edge is a matter of rounding, in f32 roundoffs of the farthest corner's distance from the ray's
/// origin: the bar of D2 in the hard cases.
pub const NEAR: f64 = 8.0;

/// What an answer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The exact answer, or a neighbour of it across an edge that the ray meets.
    Right,
    /// Another answer where only rounding decides: at the rim of a surface, or at the ray's end.
    Borderline,
    /// A surface was missed that the ray certainly meets: a leak.
    Missed,
    /// A surface was hit that the ray certainly does not meet.
    False,
}

/// The exact closest hit, rounded to f64.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Triangle number.
    pub primitive: u32,
    /// Ray parameter.
    pub t: f64,
    /// Weights of B and C.
    pub uv: (f64, f64),
}

impl From<&ExactHit> for Truth {
    fn from(hit: &ExactHit) -> Self {
        Self { primitive: hit.primitive, t: hit.t.to_f64(), uv: hit.uv() }
    }
}

/// Judges answers on one mesh.
pub struct Judge<'a> {
    mesh: &'a TriangleMesh,
    oracle: &'a Oracle,
    /// The triangles around a place, by the bits of its coordinates.
    around: HashMap<[u32; 3], Vec<u32>>,
}

/// A ray in f64.
struct Line {
    origin: DVec3,
    direction: DVec3,
    length: f64,
}

impl Line {
    fn of(ray: &Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        Self { origin: ray.origin.as_dvec3(), direction, length: length(direction) }
    }
}

impl<'a> Judge<'a> {
    /// Prepares to judge. The oracle is of a scene whose only object is the mesh, untransformed.
    pub fn new(mesh: &'a TriangleMesh, oracle: &'a Oracle) -> Self {
        let mut around: HashMap<[u32; 3], Vec<u32>> = HashMap::new();
        for number in mesh.live_triangles() {
            for corner in mesh.triangle(number) {
                around.entry(key(corner)).or_default().push(number);
            }
        }
        Self { mesh, oracle, around }
    }

    /// The exact answer.
    pub fn truth(&self, ray: &Ray) -> Option<Truth> {
        self.oracle.closest(ray).as_ref().map(Truth::from)
    }

    /// Judges a closest hit.
    pub fn closest(&self, ray: &Ray, truth: Option<&Truth>, hit: &Hit) -> Verdict {
        match truth {
            None if !hit.is_hit() => Verdict::Right,
            Some(truth) if hit.primitive == truth.primitive => Verdict::Right,
            _ if hit.is_hit() => self.other_hit(ray, truth, hit.primitive),
            _ => self.missed(ray, f64::INFINITY),
        }
    }

    /// Judges a yes or no; `found` is the hit behind a yes, if it is known.
    pub fn occluded(&self, ray: &Ray, truth: bool, answer: bool, found: impl FnOnce() -> Hit) -> Verdict {
        match (truth, answer) {
            (true, false) => self.missed(ray, f64::INFINITY),
            (false, true) => self.closest(ray, None, &found()),
            _ => Verdict::Right,
        }
    }

    /// A triangle was answered that is not the exact one.
    fn other_hit(&self, ray: &Ray, truth: Option<&Truth>, answered: u32) -> Verdict {
        let line = Line::of(ray);
        let near = self.near(&line, answered);
        let exact = self.oracle.on_line(ray, 0, answered).first().map(|hit| hit.t.to_f64());
        let Some(place) = exact.or_else(|| self.nearest_edge(&line, answered, near)) else { return Verdict::False };
        // A surface behind the ray's start was avoided by whoever made the ray; beyond its end only by a rounding.
        let (start, end) = (f64::from(ray.t_min).max(0.0), f64::from(ray.t_max));
        if place < start {
            return Verdict::False;
        }
        if exact.is_some() && place > end {
            let within = (place - end) * line.length * self.cosine_to(&line, answered) <= 2.0 * near;
            return if within { Verdict::Borderline } else { Verdict::False };
        }
        let Some(truth) = truth else { return Verdict::Borderline };
        let reach = 2.0 * near.max(self.near(&line, truth.primitive));
        let cosine = self.cosine_to(&line, answered).min(self.cosine_to(&line, truth.primitive));
        let (around, at_rim) = self.surroundings(&line, truth.primitive, 0.5 * reach);
        if (place - truth.t).abs() * line.length * cosine <= reach {
            Verdict::Right
        } else if around.contains(&answered) {
            // A line moved by no more than rounding passes from the one to the other without leaving the surface.
            if at_rim { Verdict::Borderline } else { Verdict::Right }
        } else if place < truth.t {
            Verdict::Borderline
        } else {
            self.missed(ray, place)
        }
    }

    /// No hit was answered before `until`: a leak unless rounding can move the ray past every surface up to there.
    fn missed(&self, ray: &Ray, until: f64) -> Verdict {
        let line = Line::of(ray);
        let certain = self.oracle.all(ray).iter().map(Truth::from).take_while(|truth| truth.t < until).any(|truth| {
            let near = self.near(&line, truth.primitive);
            let from_end = (f64::from(ray.t_max) - truth.t) * line.length * self.cosine_to(&line, truth.primitive);
            from_end > 2.0 * near && !self.surroundings(&line, truth.primitive, near).1
        });
        if certain { Verdict::Missed } else { Verdict::Borderline }
    }

    /// The triangles around one that a line meets, from edge to edge as long as the line passes near to them, and whether
    /// one of these edges is at the rim of the surface as the line sees it.
    ///
    /// Where the surface is seen nearly edge-on, these may be several triangles in a row.
    fn surroundings(&self, line: &Line, triangle: u32, near: f64) -> (HashSet<u32>, bool) {
        let mut seen = HashSet::from([triangle]);
        let mut pending = vec![triangle];
        let mut at_rim = false;
        while let Some(next) = pending.pop() {
            let corners = self.mesh.triangle(next);
            for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (corners[from], corners[to])) {
                let [from, to] = [a, b].map(|end| end.as_dvec3() - line.origin);
                if distance(line, from, to).0 > near {
                    continue;
                }
                at_rim |= self.is_rim(line, a, b);
                for neighbour in [a, b].iter().flat_map(|end| &self.around[&key(*end)]) {
                    if seen.insert(*neighbour) {
                        pending.push(*neighbour);
                    }
                }
            }
        }
        (seen, at_rim)
    }

    /// Whether the surface ends at an edge as a line sees it: a single triangle is there, or all lie on one side. One that
    /// is seen exactly edge-on lies on both.
    fn is_rim(&self, line: &Line, a: Vec3, b: Vec3) -> bool {
        let across = cross(line.direction, b.as_dvec3() - a.as_dvec3());
        let (mut count, mut one, mut other) = (0, false, false);
        for &triangle in &self.around[&key(a)] {
            let corners = self.mesh.triangle(triangle);
            if !corners.iter().any(|corner| key(*corner) == key(b)) {
                continue;
            }
            count += 1;
            for corner in corners.iter().filter(|corner| key(**corner) != key(a) && key(**corner) != key(b)) {
                let side = dot(across, corner.as_dvec3() - a.as_dvec3());
                one |= side >= 0.0;
                other |= side <= 0.0;
            }
        }
        count == 1 || !(one && other)
    }

    /// What counts as near for a triangle, as a distance.
    fn near(&self, line: &Line, triangle: u32) -> f64 {
        let far = |corner: Vec3| (corner.as_dvec3() - line.origin).abs().max_element();
        NEAR * UNIT_ROUNDOFF * self.mesh.triangle(triangle).map(far).into_iter().fold(0.0, f64::max)
    }

    /// Where a line passes nearest to an edge of a triangle, if that is near.
    fn nearest_edge(&self, line: &Line, triangle: u32, near: f64) -> Option<f64> {
        let corners = self.mesh.triangle(triangle).map(|corner| corner.as_dvec3() - line.origin);
        let edges = (0..3).map(|edge| distance(line, corners[edge], corners[(edge + 1) % 3]));
        edges.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(distance, _)| *distance <= near).map(|(_, t)| t)
    }

    /// |cos| of the angle between a ray and a triangle's normal.
    pub fn cosine(&self, ray: &Ray, triangle: u32) -> f64 {
        self.cosine_to(&Line::of(ray), triangle)
    }

    fn cosine_to(&self, line: &Line, triangle: u32) -> f64 {
        let [a, b, c] = self.mesh.triangle(triangle).map(|corner| corner.as_dvec3());
        let normal = cross(b - a, c - a);
        dot(normal, line.direction).abs() / (length(normal) * line.length)
    }
}

/// Zeros of both signs are one place.
fn key(p: Vec3) -> [u32; 3] {
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

/// The distance of a line from a segment whose ends are relative to its origin, and the line's parameter there.
fn distance(line: &Line, a: DVec3, b: DVec3) -> (f64, f64) {
    let direction = line.direction / line.length;
    let edge = b - a;
    // With what is along the line taken away, the question is how far the origin is from a segment in a plane.
    let flat = |v: DVec3| v - direction * dot(v, direction);
    let (from, along) = (flat(a), flat(edge));
    let squared = dot(along, along);
    let share = if squared > 0.0 { (-dot(from, along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    let place = a + edge * share;
    (length(flat(place)), dot(place, direction) / line.length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::report::subject::of_mesh;
    use crate::scene::Scene;

    /// Two triangles that make the unit square at z = 1, and a smaller one behind it at z = 2.
    fn scene() -> Scene {
        let square = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
        let behind = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
        let positions = square.into_iter().chain(behind).map(Vec3::from).collect();
        let mesh = TriangleMesh {
            positions,
            indices: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]].into(),
            ..TriangleMesh::default()
        };
        of_mesh(mesh.finish().unwrap())
    }

    fn judge(x: f32, y: f32, answer: Option<u32>) -> Verdict {
        let scene = scene();
        let oracle = Oracle::new(&scene).unwrap();
        let judge = Judge::new(&scene.meshes[0], &oracle);
        let ray = Ray::new(Vec3::new(x, y, 0.0), Vec3::Z);
        let hit = answer.map_or(Hit::MISS, |primitive| Hit { t: 1.0, instance: 0, primitive, ..Hit::MISS });
        judge.closest(&ray, judge.truth(&ray).as_ref(), &hit)
    }

    #[test]
    fn answers_inside_are_right_or_wrong() {
        assert_eq!(judge(0.5, 0.25, Some(0)), Verdict::Right);
        assert_eq!(judge(0.5, 0.25, Some(1)), Verdict::False);
        assert_eq!(judge(0.5, 0.25, None), Verdict::Missed);
        assert_eq!(judge(0.5, 0.25, Some(2)), Verdict::Missed);
        assert_eq!(judge(1.5, 0.25, None), Verdict::Right);
        assert_eq!(judge(1.5, 0.25, Some(0)), Verdict::False);
    }

    #[test]
    fn a_neighbour_across_an_edge_is_right_and_a_leak_there_is_not() {
        let beside = 0.5f32.next_up();
        for (x, y) in [(0.5, 0.5), (beside, 0.5), (0.5, beside)] {
            assert_eq!(judge(x, y, Some(0)), Verdict::Right, "{x} {y}");
            assert_eq!(judge(x, y, Some(1)), Verdict::Right, "{x} {y}");
            assert_eq!(judge(x, y, None), Verdict::Missed, "{x} {y}");
        }
        assert_eq!(judge(0.5 + 1e-4, 0.5, Some(1)), Verdict::False);
        // The diagonal's end is at the rim of the square, its middle is not.
        assert_eq!(judge(0.25, 0.25, Some(2)), Verdict::Missed);
        assert_eq!(judge(0.0, 0.0, Some(2)), Verdict::Borderline);
    }

    #[test]
    fn at_the_rim_rounding_decides() {
        let (inside, outside) = (1.0f32.next_down(), 1.0f32.next_up());
        assert_eq!(judge(inside, 0.5, None), Verdict::Borderline);
        assert_eq!(judge(inside, 0.5, Some(0)), Verdict::Right);
        assert_eq!(judge(outside, 0.5, Some(0)), Verdict::Borderline);
        assert_eq!(judge(1.0 - 1e-4, 0.5, None), Verdict::Missed);
    }

    #[test]
    fn the_far_side_of_a_triangle_seen_edge_on_is_a_neighbour() {
        // Found on the sphere far from zero: the exact ray meets a step's near side one ulp from its edge; the step
        // itself is seen edge-on, and f32 sees the wall at its other end.
        let edge = [[1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 2.0], [1.0, 1.0, 2.0]].map(Vec3::from);
        let ends = [[0.0, -1.0, 1.0], [0.0, 1.0, 1.0], [2.0, -1.0, 2.0], [2.0, 1.0, 2.0]].map(Vec3::from);
        let positions = edge.into_iter().chain(ends).collect();
        let indices = vec![[0, 1, 4], [1, 5, 4], [0, 2, 1], [1, 2, 3], [2, 6, 3], [3, 6, 7]];
        let mesh = TriangleMesh { positions, indices: indices.into(), ..TriangleMesh::default() };
        let scene = of_mesh(mesh.finish().unwrap());
        let oracle = Oracle::new(&scene).unwrap();
        let judge = Judge::new(&scene.meshes[0], &oracle);
        let verdict = |x: f32, primitive: u32| {
            let ray = Ray::new(Vec3::new(x, 0.25, 0.0), Vec3::Z);
            let hit = Hit { t: 2.0, instance: 0, primitive, ..Hit::MISS };
            judge.closest(&ray, judge.truth(&ray).as_ref(), &hit)
        };
        let inside = 1.0f32.next_down();
        assert_eq!(judge.truth(&Ray::new(Vec3::new(inside, 0.25, 0.0), Vec3::Z)).unwrap().t, 1.0);
        assert_eq!(verdict(inside, 4), Verdict::Right);
        assert_eq!(verdict(0.999, 4), Verdict::False);
        assert_eq!(verdict(inside, 5), Verdict::False);
    }

    #[test]
    fn a_rim_several_triangles_away_is_near_where_the_surface_is_seen_edge_on() {
        // Steps that lead away from the ray, each as wide as one ulp; a wall far to the other side.
        let mut positions = vec![Vec3::new(-1.0, 0.0, 1.0), Vec3::new(-1.0, 1.0, 1.0)];
        let mut x = 1.0f32;
        for step in 0..4 {
            let depth = 1.0 + step as f32;
            positions.extend([Vec3::new(x, 0.0, depth), Vec3::new(x, 1.0, depth)]);
            x = x.next_up();
        }
        let quad = |i: u32| [[i, i + 1, i + 3], [i, i + 3, i + 2]];
        let indices = [0, 2, 4, 6].into_iter().flat_map(quad).collect();
        let mesh = TriangleMesh { positions: positions.into(), indices, ..TriangleMesh::default() };
        let scene = of_mesh(mesh.finish().unwrap());
        let oracle = Oracle::new(&scene).unwrap();
        let judge = Judge::new(&scene.meshes[0], &oracle);
        let verdict = |x: f32| {
            let ray = Ray::new(Vec3::new(x, 0.5, 0.0), Vec3::Z);
            judge.closest(&ray, judge.truth(&ray).as_ref(), &Hit::MISS)
        };
        assert_eq!(verdict(1.0), Verdict::Borderline);
        assert_eq!(verdict(1.0f32.next_down()), Verdict::Borderline);
        assert_eq!(verdict(0.99), Verdict::Missed);
    }

    #[test]
    fn the_start_of_a_ray_is_exact_and_its_end_is_rounded() {
        let scene = scene();
        let oracle = Oracle::new(&scene).unwrap();
        let judge = Judge::new(&scene.meshes[0], &oracle);
        let yes = || Hit { t: 1.0, instance: 0, primitive: 0, ..Hit::MISS };
        let ray = Ray::new(Vec3::new(0.5, 0.25, 0.0), Vec3::Z);
        let ending = |t_max: f32| Ray { t_max, ..ray };
        let off_by_one = ending(1.0f32.next_down());
        assert_eq!(judge.occluded(&off_by_one, false, true, yes), Verdict::Borderline);
        assert_eq!(judge.occluded(&ending(0.999), false, true, yes), Verdict::False);
        assert_eq!(judge.occluded(&ending(1.0f32.next_up()), true, false, yes), Verdict::Borderline);
        assert_eq!(judge.occluded(&ending(1.001), true, false, yes), Verdict::Missed);
        let after = Ray { origin: Vec3::new(0.5, 0.25, 1.0f32.next_up()), t_max: 0.5, ..ray };
        assert_eq!(judge.occluded(&after, false, true, yes), Verdict::False);
    }
}
