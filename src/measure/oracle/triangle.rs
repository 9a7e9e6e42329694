//! Ray and triangle, by the signs of three volumes: no shear, no box, no division.
//!
//! With the vertices relative to the ray's origin, `d . (b x c)` is six times the signed volume that the ray's direction
//! spans with the edge from b to c. The ray's line meets the closed triangle if the volumes of all three edges have one
//! sign, zeros allowed; they are the barycentric weights, up to their sum. A sum of zero is a ray in the triangle's
//! plane or a triangle without area: a miss.

use std::cmp::Ordering;

use glam::{DAffine3, Vec3};

use super::number::{Number, Rounded, Vector, cross, difference, dot, sum, vector};
use super::parameter::{Parameter, quotient_f32};
use super::wide_ray::WideRay;
use crate::geometry::Ray;
use crate::measure::dyadic::{Dyadic, quotient};

/// Where a ray's line meets a triangle, exact.
#[derive(Debug, Clone)]
pub struct TriangleAnswer {
    /// Weights of A, B and C up to their sum: all of one sign.
    weights: [Dyadic; 3],
    /// The sum of the weights, not zero.
    determinant: Dyadic,
    /// t.
    pub t: Parameter,
}

impl TriangleAnswer {
    /// The weights of B and C, each rounded to the nearest f64.
    pub fn uv(&self) -> (f64, f64) {
        (quotient(&self.weights[1], &self.determinant), quotient(&self.weights[2], &self.determinant))
    }

    /// The weights of B and C, each rounded to the nearest f32 once.
    pub fn uv_f32(&self) -> (f32, f32) {
        (quotient_f32(&self.weights[1], &self.determinant), quotient_f32(&self.weights[2], &self.determinant))
    }

    /// Whether the line passes through an edge or a vertex.
    pub fn is_on_edge(&self) -> bool {
        self.weights.iter().any(|weight| weight.sign() == Ordering::Equal)
    }
}

/// Where the line of a ray meets the closed triangle `a b c`, whatever the ray's interval; `None` where it misses.
///
/// Vertices are in the ray's space and finite, and so are the ray's origin and direction.
pub fn meet_line(ray: &Ray, corners: [Vec3; 3]) -> Option<TriangleAnswer> {
    meet(&Line::new(ray), &corners.map(vector))
}

/// [`meet_line`] where t lies within the closed interval of a valid ray; `None` for rays that are not valid.
pub fn meet_ray(ray: &Ray, corners: [Vec3; 3]) -> Option<TriangleAnswer> {
    if !ray.is_valid() {
        return None;
    }
    meet_line(ray, corners).filter(|answer| is_in_range(&ray.into(), &answer.t))
}

/// Whether `t` lies in the ray's closed interval, of which what is negative does not count.
pub(super) fn is_in_range(ray: &WideRay, t: &Parameter) -> bool {
    let (near, far) = ray.interval();
    t.compare(near) != Ordering::Less && t.compare(far) != Ordering::Greater
}

/// The squared distance of a line from the segment between two points, as numerator and denominator, exact.
///
/// For |a x d|, the distance of the line from a point times |d|: at `a + s e` its square is a parabola in s, whose least
/// value is `(d . (a x e))^2 |d|^2 / |e x d|^2`; where that lies beyond an end, the end is nearest.
pub fn squared_distance(ray: &Ray, ends: [Vec3; 2]) -> (Dyadic, Dyadic) {
    squared_world_distance(ray, ends, None)
}

/// The distance of a ray's line from the segment between two points, rounded to the nearest f64 or its neighbour.
pub fn distance(ray: &Ray, ends: [Vec3; 2]) -> f64 {
    world_distance(ray, ends, None)
}

/// [`distance`] from the segment between two points that a map places in the world.
pub fn world_distance(ray: &Ray, ends: [Vec3; 2], to_world: Option<&DAffine3>) -> f64 {
    let (numerator, denominator) = squared_world_distance(ray, ends, to_world);
    // Scaled by an even power of two that keeps the square far from underflow.
    let scale = 400;
    quotient(&numerator.scaled(scale), &denominator).sqrt() * libm::ldexp(1.0, -(scale as i32) / 2)
}

fn squared_world_distance(ray: &Ray, ends: [Vec3; 2], to_world: Option<&DAffine3>) -> (Dyadic, Dyadic) {
    let Line { origin, direction: d } = Line::<Dyadic>::new(ray);
    let [a, b] = ends.map(|end| difference(&place::<Dyadic>(to_world, end), &origin));
    let e = difference(&b, &a);
    let (across, from_a) = (cross(&e, &d), cross(&a, &d));
    let steepness = dot(&across, &across);
    // The least value lies at s = slope / steepness.
    let slope = -dot(&from_a, &across);
    let end = |from_end: &Vector<Dyadic>| (dot(from_end, from_end), dot(&d, &d));
    if slope.sign() != Ordering::Greater {
        end(&from_a)
    } else if slope >= steepness {
        end(&cross(&b, &d))
    } else {
        let volume = dot(&d, &cross(&a, &e));
        (&volume * &volume, steepness)
    }
}

/// A ray's line in one kind of numbers.
#[derive(Debug, Clone)]
pub(super) struct Line<N> {
    pub origin: Vector<N>,
    pub direction: Vector<N>,
}

impl<N: Number> Line<N> {
    pub fn new(ray: impl Into<WideRay>) -> Self {
        let ray = ray.into();
        Self { origin: vector(ray.origin), direction: vector(ray.direction) }
    }
}

/// A vertex of a mesh in the world; `None` is the identity.
pub(super) fn place<N: Number>(to_world: Option<&DAffine3>, vertex: Vec3) -> Vector<N> {
    let Some(map) = to_world else { return vector(vertex) };
    let [x, y, z] = vertex.to_array().map(|k| N::exact(k.into()));
    let columns = [map.x_axis, map.y_axis, map.z_axis].map(vector::<N>);
    let scaled = |column: &Vector<N>, by: &N| column.each_ref().map(|k| k.times(by));
    let linear = sum(&sum(&scaled(&columns[0], &x), &scaled(&columns[1], &y)), &scaled(&columns[2], &z));
    sum(&linear, &vector(map.translation))
}

/// The volumes of the three edges, opposite to A, B and C.
fn weights<N: Number>(line: &Line<N>, corners: &[Vector<N>; 3]) -> [N; 3] {
    let [a, b, c] = corners.each_ref().map(|corner| difference(corner, &line.origin));
    [(&b, &c), (&c, &a), (&a, &b)].map(|(from, to)| dot(&line.direction, &cross(from, to)))
}

/// Whether the signs of the weights say hit or miss, as far as they are certain.
fn decide(signs: [Option<Ordering>; 3]) -> Option<bool> {
    let has = |sign| signs.contains(&Some(sign));
    if has(Ordering::Less) && has(Ordering::Greater) {
        return Some(false);
    }
    let all_known = signs.iter().all(Option::is_some);
    all_known.then(|| has(Ordering::Less) || has(Ordering::Greater))
}

/// Exact hit or miss of a line and a triangle in one space.
pub(super) fn meet(line: &Line<Dyadic>, corners: &[Vector<Dyadic>; 3]) -> Option<TriangleAnswer> {
    let weights = weights(line, corners);
    if decide(weights.each_ref().map(Number::sign)) != Some(true) {
        return None;
    }
    let (numerator, determinant) = plane(line, corners);
    let t = Parameter::ratio(numerator, determinant.clone());
    Some(TriangleAnswer { weights, determinant, t })
}

/// t of the triangle's plane: `n . (a - o)` and `n . d` with the normal `n = (b - a) x (c - a)`.
fn plane<N: Number>(line: &Line<N>, [a, b, c]: &[Vector<N>; 3]) -> (N, N) {
    let normal = cross(&difference(b, a), &difference(c, a));
    (dot(&normal, &difference(a, &line.origin)), dot(&normal, &line.direction))
}

/// What f64 can say of a line and a triangle.
pub(super) enum Filtered {
    /// Certainly a miss.
    Miss,
    /// Certainly a hit, with t between these.
    Hit(f64, f64),
    /// Too close to tell.
    Unknown,
}

/// Decides what f64 can decide.
pub(super) fn filter(line: &Line<Rounded>, corners: &[Vector<Rounded>; 3]) -> Filtered {
    match decide(weights(line, corners).each_ref().map(Number::sign)) {
        Some(false) => Filtered::Miss,
        Some(true) => {
            let (numerator, determinant) = plane(line, corners);
            let (low, high) = numerator.over(&determinant).range();
            Filtered::Hit(low, high)
        }
        None => Filtered::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] = [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 2.0), Vec3::new(0.0, 1.0, 2.0)];

    fn answer(origin: [f32; 3], direction: [f32; 3]) -> Option<(f64, f64, f64)> {
        let found = meet_ray(&Ray::new(origin.into(), direction.into()), CORNERS)?;
        let (u, v) = found.uv();
        Some((found.t.to_f64(), u, v))
    }

    #[test]
    fn closed_triangles_follow_their_closed_form() {
        assert_eq!(answer([0.25, 0.5, 0.0], [0.0, 0.0, 4.0]), Some((0.5, 0.25, 0.5)));
        assert_eq!(answer([0.25, 0.5, 3.0], [0.0, 0.0, -1.0]), Some((1.0, 0.25, 0.5)));
        // Slanted: from the origin through (1/2, 1/4, 2).
        assert_eq!(answer([0.0; 3], [2.0, 1.0, 8.0]), Some((0.25, 0.5, 0.25)));
        // Vertices, edges, and one ulp beside them.
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.5, 0.0)] {
            assert!(answer([x, y, 0.0], [0.0, 0.0, 1.0]).is_some(), "{x} {y}");
        }
        let (above, below) = (0.5f32.next_up(), (-0.0f32).next_down());
        for (x, y) in [(above, 0.5), (0.5, above), (below, 0.5), (0.5, below), (1.0f32.next_up(), 0.0)] {
            assert!(answer([x, y, 0.0], [0.0, 0.0, 1.0]).is_none(), "{x} {y}");
        }
        // In the plane; behind; zero area.
        assert_eq!(answer([-1.0, 0.25, 2.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(answer([0.25, 0.25, 3.0], [0.0, 0.0, 1.0]), None);
        let ray = Ray::new(Vec3::new(0.5, 0.0, 0.0), Vec3::Z);
        assert!(meet_ray(&ray, [CORNERS[0], CORNERS[1], CORNERS[1]]).is_none());
    }

    #[test]
    fn interval_ends_are_inclusive_and_negative_t_does_not_count() {
        let ray = Ray::new(Vec3::new(0.25, 0.25, 0.0), Vec3::Z);
        let hits = |t_min: f32, t_max: f32| meet_ray(&Ray { t_min, t_max, ..ray }, CORNERS).is_some();
        assert!(hits(2.0, 2.0) && hits(-1.0, 2.0) && hits(0.0, f32::INFINITY));
        assert!(!hits(2.0f32.next_up(), 9.0) && !hits(0.0, 2.0f32.next_down()) && !hits(f32::NAN, 9.0));
        let behind = Ray { origin: Vec3::new(0.25, 0.25, 3.0), t_min: -5.0, ..ray };
        assert!(meet_line(&behind, CORNERS).is_some() && meet_ray(&behind, CORNERS).is_none());
    }

    #[test]
    fn distances_from_edges_follow_their_closed_form() {
        // Past the middle of an edge of CORNERS at 3/8 to its side, beyond its end by a 3-4-5 triangle.
        let edge = [CORNERS[0], CORNERS[1]];
        let beside = Ray::new(Vec3::new(0.5, -0.375, 0.0), Vec3::Z * 3.0);
        assert_eq!(distance(&beside, edge), 0.375);
        assert_eq!(distance(&Ray { origin: Vec3::new(-3.0, 4.0, 0.0), ..beside }, edge), 5.0);
        assert_eq!(distance(&Ray { origin: Vec3::new(4.0, 4.0, 9.0), ..beside }, edge), 5.0);
        assert_eq!(distance(&Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 4.0)), edge), 0.0);
        // Skew: the line x = 1/2, along y, passes 2^-60 above the edge.
        let low = 2.0f32;
        let skew = Ray::new(Vec3::new(0.5, -7.0, low.next_up()), Vec3::Y);
        assert_eq!(distance(&skew, edge), f64::from(low.next_up() - low));
        // Parallel to the edge.
        assert_eq!(distance(&Ray::new(Vec3::new(9.0, 3.0, 6.0), Vec3::X), edge), 5.0);
    }
}
