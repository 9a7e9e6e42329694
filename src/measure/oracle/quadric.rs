//! Ray and quadric: the exact quadratic along the line, its exact roots, and exact comparisons with the clip box.
//!
//! The line is never brought into object space by division. With the map's linear part A and translation T, the
//! homogeneous object-space point of `o + t d` is `X(t) = (adj(A) (o - T), det A) + t (adj(A) d, 0)`: a polynomial of the
//! inputs, `det A` times the true point. `F(X(t))` is `a t^2 + 2 b t + c` up to the positive factor `det^2`.
//!
//! The surface is that of the coefficients as given. What counts as a crossing follows
//! [`Quadric::intersect_quadratic`]: roots within the clip box; for a solid the ends of the parts of the line where
//! F <= 0 within the box, of which those on the box are caps; a line within the surface crosses nothing.

use std::cmp::Ordering;

use glam::DAffine3;

use super::number::{Number, Rounded, Vector, cross, difference, dot, vector};
use super::parameter::Parameter;
use super::triangle::Line;
use crate::geometry::Quadric;
use crate::measure::dyadic::Dyadic;

/// A crossing of a line with a quadric: t, and 0 or 1 for the first or second root, 2 to 7 for a cap.
pub(super) type Crossing = (Parameter, u32);

/// A quadric in the world, in both kinds of numbers.
#[derive(Debug)]
pub(super) struct PlacedQuadric {
    exact: Placed<Dyadic>,
    rounded: Placed<Rounded>,
    /// Sides of the clip box that exist: axis, whether it is the upper one, and where.
    sides: Vec<(usize, bool, f64)>,
    solid: bool,
}

/// A quadric's coefficients and its map, ready for lines.
#[derive(Debug)]
struct Placed<N> {
    coefficients: [N; 10],
    /// Rows of the adjugate of the map's linear part.
    adjugate: [Vector<N>; 3],
    determinant: N,
    translation: Vector<N>,
}

/// A line in homogeneous object space: `start + t along`, where the last coordinate stays `determinant`.
struct HomogeneousLine<N> {
    start: Vector<N>,
    along: Vector<N>,
}

impl<N: Number> Placed<N> {
    fn new(quadric: &Quadric, to_world: &DAffine3) -> Self {
        let [x, y, z] = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(vector::<N>);
        let adjugate = [cross(&y, &z), cross(&z, &x), cross(&x, &y)];
        Self {
            coefficients: quadric.coefficients().map(N::exact),
            determinant: dot(&x, &adjugate[0]),
            adjugate,
            translation: vector(to_world.translation),
        }
    }

    fn line(&self, line: &Line<N>) -> HomogeneousLine<N> {
        let map = |v: &Vector<N>| self.adjugate.each_ref().map(|row| dot(row, v));
        HomogeneousLine { start: map(&difference(&line.origin, &self.translation)), along: map(&line.direction) }
    }

    /// `[a, b, c]` of `a t^2 + 2 b t + c`.
    fn along(&self, line: &HomogeneousLine<N>) -> [N; 3] {
        let [a, b, c, d, e, f, g, h, i, j] = &self.coefficients;
        // The symmetric form's upper part applied to (v, 0), then to u.
        let bent = |v: &Vector<N>| -> Vector<N> {
            [
                dot(&[a.clone(), d.clone(), f.clone()], v),
                dot(&[d.clone(), b.clone(), e.clone()], v),
                dot(&[f.clone(), e.clone(), c.clone()], v),
            ]
        };
        let (u, v, w) = (&line.start, &line.along, &self.determinant);
        let (bent_u, bent_v) = (bent(u), bent(v));
        let linear = [g.clone(), h.clone(), i.clone()];
        let twice = |x: &N| x.plus(x);
        let constant = twice(&w.times(&dot(&linear, u))).plus(&w.times(w).times(j));
        [dot(v, &bent_v), dot(u, &bent_v).plus(&w.times(&dot(&linear, v))), dot(u, &bent_u).plus(&constant)]
    }

    /// t at one side of the clip box, as numerator and denominator; the latter is zero for a line along the side.
    fn side(&self, line: &HomogeneousLine<N>, axis: usize, at: f64) -> (N, N) {
        (N::exact(at).times(&self.determinant).minus(&line.start[axis]), line.along[axis].clone())
    }
}

impl PlacedQuadric {
    pub fn new(quadric: &Quadric, to_world: &DAffine3) -> Self {
        let clip = quadric.clip();
        let sides = (0..3).flat_map(|axis| [(axis, false, clip.min[axis]), (axis, true, clip.max[axis])]);
        Self {
            exact: Placed::new(quadric, to_world),
            rounded: Placed::new(quadric, to_world),
            sides: sides.filter(|(_, _, at)| at.is_finite()).collect(),
            solid: quadric.is_solid(),
        }
    }

    /// Whether f64 can tell that a line crosses nothing between `near` and `far`.
    pub fn certainly_missed(&self, line: &Line<Rounded>, near: f64, far: f64) -> bool {
        let placed = &self.rounded;
        let homogeneous = placed.line(line);
        // The part of the line within the clip box, made larger.
        let (mut near, mut far) = (near, far);
        for &(axis, upper, at) in &self.sides {
            let (numerator, denominator) = placed.side(&homogeneous, axis, at);
            let (low, high) = numerator.over(&denominator).range();
            let entering = match (denominator.sign(), placed.determinant.sign()) {
                (Some(along), Some(orientation)) if along != Ordering::Equal => (along == orientation) != upper,
                _ => continue,
            };
            if entering {
                near = near.max(low);
            } else {
                far = far.min(high);
            }
        }
        if near > far {
            return true;
        }
        let [a, b, c] = placed.along(&homogeneous);
        let discriminant = b.times(&b).minus(&a.times(&c));
        // Without roots F has one sign: outside everywhere, or inside a solid that then ends at its caps.
        discriminant.sign() == Some(Ordering::Less) && (!self.solid || a.sign() == Some(Ordering::Greater))
    }

    /// All crossings of the line, ascending in t.
    pub fn crossings(&self, line: &Line<Dyadic>) -> Vec<Crossing> {
        let placed = &self.exact;
        if placed.determinant.sign() == Ordering::Equal {
            return Vec::new();
        }
        let homogeneous = placed.line(line);
        let Some((enter, leave)) = self.clip_interval(&homogeneous) else { return Vec::new() };
        let [a, b, c] = placed.along(&homogeneous);
        let roots = roots(&a, &b, &c);
        if !self.solid {
            let inside = |(t, _): &Crossing| {
                enter.as_ref().is_none_or(|(side, _)| t >= side) && leave.as_ref().is_none_or(|(side, _)| t <= side)
            };
            return roots.into_iter().filter(inside).collect();
        }
        let mut found = Vec::new();
        let mut piece = |start: Option<&Crossing>, end: Option<&Crossing>| {
            let start = match (start, &enter) {
                (Some(root), Some(side)) => Some(if root.0 > side.0 { root } else { side }),
                (one, other) => one.or(other.as_ref()),
            };
            let end = match (end, &leave) {
                (Some(root), Some(side)) => Some(if root.0 < side.0 { root } else { side }),
                (one, other) => one.or(other.as_ref()),
            };
            match (start, end) {
                (Some(start), Some(end)) if start.0 > end.0 => {}
                (Some(start), Some(end)) if start.0 == end.0 => found.push(start.clone()),
                (start, end) => found.extend(start.into_iter().chain(end).cloned()),
            }
        };
        match (roots.as_slice(), a.sign()) {
            ([], _) if c.sign() == Ordering::Less => piece(None, None),
            ([], _) => {}
            ([root], Ordering::Greater) => piece(Some(root), Some(root)),
            ([_], Ordering::Less) => piece(None, None),
            ([root], Ordering::Equal) if b.sign() == Ordering::Greater => piece(None, Some(root)),
            ([root], Ordering::Equal) => piece(Some(root), None),
            ([first, second, ..], Ordering::Greater) => piece(Some(first), Some(second)),
            ([first, second, ..], _) => {
                piece(None, Some(first));
                piece(Some(second), None);
            }
        }
        found.dedup_by(|later, earlier| later.1 == earlier.1 && later.0 == earlier.0);
        found
    }

    /// Where the line enters and leaves the clip box, `None` for an end at infinity; `None` if it stays outside.
    fn clip_interval(&self, line: &HomogeneousLine<Dyadic>) -> Option<(Option<Crossing>, Option<Crossing>)> {
        let orientation = self.exact.determinant.sign();
        let (mut enter, mut leave): (Option<Crossing>, Option<Crossing>) = (None, None);
        for &(axis, upper, at) in &self.sides {
            let (numerator, denominator) = self.exact.side(line, axis, at);
            let surface = 2 + 2 * axis as u32 + u32::from(upper);
            if denominator.sign() == Ordering::Equal {
                // `numerator` is det (side - p): outside if p lies beyond the side.
                let beyond = if upper { orientation.reverse() } else { orientation };
                if numerator.sign() == beyond {
                    return None;
                }
                continue;
            }
            let entering = (denominator.sign() == orientation) != upper;
            let t = Parameter::ratio(numerator, denominator);
            if entering {
                if enter.as_ref().is_none_or(|(latest, _)| t > *latest) {
                    enter = Some((t, surface));
                }
            } else if leave.as_ref().is_none_or(|(earliest, _)| t < *earliest) {
                leave = Some((t, surface));
            }
        }
        Some((enter, leave))
    }
}

/// The real roots of `a t^2 + 2 b t + c`, ascending, with their numbers; none if all of it is zero.
fn roots(a: &Dyadic, b: &Dyadic, c: &Dyadic) -> Vec<Crossing> {
    if a.sign() == Ordering::Equal {
        return match b.sign() {
            Ordering::Equal => Vec::new(),
            _ => vec![(Parameter::ratio(-c, b.scaled(1)), 0)],
        };
    }
    let discriminant = &(b * b) - &(a * c);
    let root = |negative: bool| Parameter::root(-b, discriminant.clone(), negative, a.clone());
    match discriminant.sign() {
        Ordering::Less => Vec::new(),
        Ordering::Equal => vec![(root(false), 0)],
        Ordering::Greater => {
            let rising = a.sign() == Ordering::Greater;
            vec![(root(rising), 0), (root(!rising), 1)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::quadric::Clip;
    use crate::geometry::{Ray, shapes};
    use glam::{DMat3, DVec3};

    /// Crossings of a line, rounded.
    fn crossings(quadric: &Quadric, map: DAffine3, origin: [f32; 3], direction: [f32; 3]) -> Vec<(f64, u32)> {
        let line = Line::new(&Ray::new(origin.into(), direction.into()));
        PlacedQuadric::new(quadric, &map).crossings(&line).iter().map(|(t, surface)| (t.to_f64(), *surface)).collect()
    }

    const HERE: DAffine3 = DAffine3::IDENTITY;

    #[test]
    fn spheres_are_touched_at_exact_points_only() {
        let sphere = shapes::sphere();
        // 3-4-5: the lines y = 1 and x = 3/5 (which f32 does not hold: scaled by 5).
        assert_eq!(crossings(&sphere, HERE, [0.0, 0.0, 3.0], [0.0, 0.0, -1.0]), [(2.0, 0), (4.0, 1)]);
        let by_five = DAffine3::from_scale(DVec3::splat(5.0));
        assert_eq!(crossings(&sphere, by_five, [3.0, 0.0, 8.0], [0.0, 0.0, -1.0]), [(4.0, 0), (12.0, 1)]);
        assert_eq!(crossings(&sphere, by_five, [5.0, 0.0, 8.0], [0.0, 0.0, -2.0]), [(4.0, 0)]);
        assert_eq!(crossings(&sphere, by_five, [5.0f32.next_up(), 0.0, 8.0], [0.0, 0.0, -2.0]), []);
        assert_eq!(crossings(&sphere, by_five, [5.0f32.next_down(), 0.0, 8.0], [0.0, 0.0, -2.0]).len(), 2);
        // The tangent at the rational point (3, 4, 0) of the sphere of radius 5: along (4, -3, 0), from 7 back.
        assert_eq!(crossings(&sphere, by_five, [-25.0, 25.0, 0.0], [4.0, -3.0, 0.0]), [(7.0, 0)]);
        // Far away, translated: nothing cancels.
        let far = DAffine3::from_translation(DVec3::new(1e7, 0.0, 0.0));
        assert_eq!(crossings(&sphere, far, [1e7, 0.0, 4.0], [0.0, 0.0, -1.0]), [(3.0, 0), (5.0, 1)]);
    }

    #[test]
    fn maps_are_applied_without_division() {
        // x' = 3 x: the inverse is not a number of f64, the roots are.
        let sphere = shapes::sphere();
        let stretched = DAffine3::from_scale(DVec3::new(3.0, 1.0, 1.0));
        assert_eq!(crossings(&sphere, stretched, [-6.0, 0.0, 0.0], [3.0, 0.0, 0.0]), [(1.0, 0), (3.0, 1)]);
        // A shear and a mirror: x' = x + 2 y, z' = -z.
        let columns = DMat3::from_cols(DVec3::X, DVec3::new(2.0, 1.0, 0.0), DVec3::NEG_Z);
        let sheared = DAffine3::from_mat3(columns);
        // At height y the sphere's x' runs from 2 y - sqrt(1 - y^2) to 2 y + sqrt(1 - y^2).
        assert_eq!(crossings(&sphere, sheared, [-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [(3.0, 0), (5.0, 1)]);
        let found = crossings(&sphere, sheared, [-4.0, 0.5, 0.0], [1.0, 0.0, 0.0]);
        let half = 0.75f64.sqrt();
        assert_eq!(found.len(), 2);
        assert!((found[0].0 - (5.0 - half)).abs() < 1e-15 && (found[1].0 - (5.0 + half)).abs() < 2e-15, "{found:?}");
    }

    #[test]
    fn caps_close_solids_as_they_do_in_the_renderer() {
        let upper = Clip::between(0.0, 2.0);
        let sphere = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
        let half = Quadric::new(sphere, Some(upper), true).unwrap();
        let found = crossings(&half, HERE, [0.5, -3.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!((found.len(), found[0], found[1].1), (2, (3.0, 4), 1));
        assert_eq!(crossings(&half, HERE, [0.0, 1.5, 0.0], [1.0, 0.0, 0.0]), []);
        let open = Quadric::new(sphere, Some(upper), false).unwrap();
        assert_eq!(crossings(&open, HERE, [0.5, -3.0, 0.0], [0.0, 1.0, 0.0]), found[1..]);
        // Mirrored upside down by a map: the cap keeps its number.
        let mirror = DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0));
        let found = crossings(&half, mirror, [0.5, -3.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!((found.len(), found[0].1, found[1]), (2, 0, (3.0, 4)));
    }

    #[test]
    fn degenerate_quadrics_follow_their_closed_forms() {
        let z = 0.0;
        let bare = |k: [f64; 10]| Quadric::new(k, None, false).unwrap();
        let plane = bare([z, z, z, z, z, z, z, 0.5, z, z]);
        assert_eq!(crossings(&plane, HERE, [0.0, 2.0, 0.0], [1.0, -1.0, 0.0]), [(2.0, 0)]);
        assert_eq!(crossings(&plane, HERE, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), []);
        let double = bare([1.0, z, z, z, z, z, z, z, z, z]);
        assert_eq!(crossings(&double, HERE, [-3.0, 1.0, 0.0], [1.0, 0.0, 0.0]), [(3.0, 0)]);
        // The cone x^2 + z^2 = y^2 through its apex and along its side.
        let cone = bare([1.0, -1.0, 1.0, z, z, z, z, z, z, z]);
        assert_eq!(crossings(&cone, HERE, [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]), [(1.0, 0)]);
        assert_eq!(crossings(&cone, HERE, [1.0, 1.0, 0.0], [1.0, 1.0, 0.0]), []);
        assert_eq!(crossings(&cone, HERE, [3.0, 1.0, 0.0], [1.0, 1.0, 0.0]), [(-2.0, 0)]);
        let saddle = bare([z, z, z, 0.5, z, z, z, z, -0.5, z]);
        assert_eq!(crossings(&saddle, HERE, [2.0, 3.0, 10.0], [0.0, 0.0, -1.0]), [(4.0, 0)]);
        assert_eq!(crossings(&bare([1.0, 1.0, 1.0, z, z, z, z, z, z, 1.0]), HERE, [0.0; 3], [1.0; 3]), []);
    }

    #[test]
    fn the_filter_never_rejects_what_is_crossed() {
        let mut random = crate::math::random::Random::new(5, 0);
        let solids = [
            shapes::sphere(),
            Quadric::new([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], Some(Clip::between(-1.0, 0.5)), true)
                .unwrap(),
        ];
        let (mut rejected, mut total) = (0, 0);
        for number in 0..2000 {
            let mut draw = || (random.in_cube() * 8.0).round() / 4.0;
            let map = DAffine3 { matrix3: DMat3::from_cols(draw(), draw(), draw()), translation: draw() };
            let (origin, direction) = (draw() * 2.0, draw());
            if direction == DVec3::ZERO {
                continue;
            }
            let ray = Ray::new(origin.as_vec3(), direction.as_vec3());
            let placed = PlacedQuadric::new(&solids[number % 2], &map);
            let found = placed.crossings(&Line::new(&ray));
            total += 1;
            if placed.certainly_missed(&Line::new(&ray), 0.0, 1e9) {
                rejected += 1;
                let ahead = |(t, _): &Crossing| t.to_f64() >= 0.0 && t.to_f64() <= 1e9;
                assert!(!found.iter().any(ahead), "{ray:?} {map:?}");
            }
        }
        assert!(rejected * 4 > total, "{rejected} of {total}");
    }
}
