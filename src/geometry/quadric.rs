//! General quadric surfaces: `X^T A X = 0` in homogeneous object-space coordinates, in f64 throughout.
//!
//! A ray is brought into object space in f64 and moved to its closest approach to the quadric's centre, where the
//! quadratic along the ray has its digits where they matter; the discriminant is Kahan's (`math::quadratic`).

use glam::{DVec2, DVec3};

use crate::error::{Error, Result};
use crate::geometry::bounds::Bounds;
use crate::geometry::quadric_form::QuadricForm;
use crate::math::float::{round_down_vec, round_up_vec};
use crate::math::quadratic::{Roots, solve};
use crate::math::vector::{length, normalize};

/// A closed object-space box that cuts a quadric; sides may be infinite.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Clip {
    /// The least corner.
    pub min: DVec3,
    /// The greatest corner.
    pub max: DVec3,
}

impl Clip {
    /// No clipping at all.
    pub const NONE: Self = Self { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };

    /// Between two heights.
    pub const fn between(y0: f64, y1: f64) -> Self {
        Self {
            min: DVec3::new(f64::NEG_INFINITY, y0, f64::NEG_INFINITY),
            max: DVec3::new(f64::INFINITY, y1, f64::INFINITY),
        }
    }

    fn contains(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && self.max.cmpge(p).all()
    }
}

/// How texture coordinates lie on a quadric; u, v from the lower left of the image, not mirrored seen from outside.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Mapping {
    /// Longitude and latitude around the centre; the image's middle faces +Z, its top +Y.
    Spherical,
    /// Longitude, and height between `y0` and `y1`.
    Cylindrical {
        /// Height where v is 0.
        y0: f64,
        /// Height where v is 1.
        y1: f64,
    },
    /// x and -z; one image over `[-half_size, half_size]`.
    Planar {
        /// Half the side of one image.
        half_size: f64,
    },
}

/// A quadric surface, possibly clipped by a box, either as a bare surface or as the boundary of the solid
/// `{ F <= 0 }` within the box.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Quadric {
    form: QuadricForm,
    clip: Clip,
    solid: bool,
    bounds: Option<Bounds>,
    mapping: Mapping,
    /// The ten coefficients as given, for `info` and saving.
    coefficients: [f64; 10],
}

/// A point where a line crosses a quadric.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Line parameter.
    pub t: f64,
    /// 0 or 1: the first or second root along the line; 2 to 7: the cap at -x, +x, -y, +y, -z, +z.
    pub surface: u32,
}

/// The crossings of a line with a quadric, ascending in t: at most four.
#[derive(Debug, Clone, Copy, Default)]
pub struct Crossings {
    list: [Option<Crossing>; 4],
    count: usize,
}

impl Crossings {
    fn push(&mut self, t: f64, surface: u32) {
        let repeats = self.count > 0 && self.list[self.count - 1] == Some(Crossing { t, surface });
        if t.is_finite() && !repeats {
            self.list[self.count] = Some(Crossing { t, surface });
            self.count += 1;
        }
    }

    /// In ascending order.
    pub fn iter(&self) -> impl Iterator<Item = Crossing> + '_ {
        self.into_iter()
    }
}

impl IntoIterator for Crossings {
    type Item = Crossing;
    type IntoIter = std::iter::Flatten<std::array::IntoIter<Option<Crossing>, 4>>;

    fn into_iter(self) -> Self::IntoIter {
        self.list.into_iter().flatten()
    }
}

/// What shading needs of a point on a quadric, object space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadricPoint {
    /// The point.
    pub position: DVec3,
    /// Unit normal, towards F > 0: outward for solids.
    pub normal: DVec3,
    /// A bound on the distance of `position` from the true surface.
    pub error: f64,
    /// Whether the line comes from where F is positive, where the order of the roots tells: near a tangent the normal
    /// does not. `None` where there is one root, or a cap.
    pub from_outside: Option<bool>,
}

impl Quadric {
    /// The surface `a x^2 + b y^2 + c z^2 + 2 d xy + 2 e yz + 2 f xz + 2 g x + 2 h y + 2 i z + j = 0`, coefficients
    /// in that order (the seed's), optionally clipped; `solid` closes the clip's cuts with caps, which bound the
    /// solid where the left side is negative.
    ///
    /// # Errors
    /// A caller's error for coefficients that are all zero or not finite, and for a clip box that is empty or NaN.
    pub fn new(coefficients: [f64; 10], clip: Option<Clip>, solid: bool) -> Result<Self> {
        let clip = clip.unwrap_or(Clip::NONE);
        if !coefficients.iter().all(|c| c.is_finite()) {
            return Err(Error::caller("a quadric's coefficients must be finite"));
        }
        if coefficients.iter().all(|&c| c == 0.0) {
            return Err(Error::caller("all coefficients of the quadric are 0").remedy("at least one must not be"));
        }
        if !clip.min.cmple(clip.max).all() {
            return Err(Error::caller("the quadric's clip box is empty").remedy("min must not exceed max"));
        }

        let form = QuadricForm::new(coefficients);
        let bounds = bounds_of(&form, &clip);
        Ok(Self { form, clip, solid, bounds, mapping: Mapping::Spherical, coefficients })
    }

    /// The surface `X^T A X = 0` for a 4x4 matrix stored column by column (the seed's `coeffMatrix`). What `A` has
    /// beyond its symmetric part does not change the surface and is ignored.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_matrix(column_major: [f64; 16], clip: Option<Clip>, solid: bool) -> Result<Self> {
        let m = |row: usize, column: usize| column_major[4 * column + row];
        let mean = |row: usize, column: usize| 0.5 * m(row, column) + 0.5 * m(column, row);
        let off = [mean(0, 1), mean(1, 2), mean(0, 2), mean(0, 3), mean(1, 3), mean(2, 3)];
        let [d, e, f, g, h, i] = off;
        Self::new([m(0, 0), m(1, 1), m(2, 2), d, e, f, g, h, i, m(3, 3)], clip, solid)
    }

    /// A quadric whose extent and texture mapping are known; `bounds` must contain the clipped surface.
    pub(crate) fn shaped(
        coefficients: [f64; 10],
        clip: Clip,
        solid: bool,
        bounds: Option<(DVec3, DVec3)>,
        mapping: Mapping,
    ) -> Self {
        let quadric = Self::new(coefficients, Some(clip), solid).expect("named shapes have valid coefficients");
        let bounds = bounds.map(|(min, max)| Bounds { min: round_down_vec(min), max: round_up_vec(max) });
        Self { bounds, mapping, ..quadric }
    }

    /// The coefficients as given, in the seed's order.
    pub fn coefficients(&self) -> &[f64; 10] {
        &self.coefficients
    }

    /// The box that cuts the surface; [`Clip::NONE`] if none does.
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// The centre, object space; where there is none, the point of the axis nearest to the object's origin.
    pub fn center(&self) -> DVec3 {
        self.form.center()
    }

    /// A box around the clipped surface in object space; `None` if it goes to infinity.
    pub fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// Whether cuts are closed by caps.
    pub fn is_solid(&self) -> bool {
        self.solid
    }

    /// All crossings of the line `origin + t direction` (object space, any length) with the clipped surface or, for a
    /// solid, with its boundary; also those at negative t. A line within the surface crosses nothing.
    #[doc(alias = "IntersectQuadratic")]
    pub fn intersect_quadratic(&self, origin: DVec3, direction: DVec3) -> Crossings {
        let mut crossings = Crossings::default();
        let Some(along) = self.form.along(origin, direction) else { return crossings };
        let roots = solve(along.a, along.b, along.c);
        if !self.solid {
            let mut push = |s: f64, surface: u32| {
                if self.clip.contains(self.form.point(&along, s)) {
                    crossings.push(along.t0 + s, surface);
                }
            };
            match roots {
                Roots::None => {}
                Roots::One(s) => push(s, 0),
                Roots::Two(s0, s1) => {
                    push(s0, 0);
                    push(s1, 1);
                }
            }
            return crossings;
        }

        // The solid: the parts of the line where F <= 0, each cut by the clip box; an end is a root or a cap.
        let (enter, leave) = self.clip_interval(origin, direction);
        let mut piece = |start: (f64, u32), end: (f64, u32)| {
            let start = if start.0 > enter.0 { start } else { enter };
            let end = if end.0 < leave.0 { end } else { leave };
            if start.0 <= end.0 {
                crossings.push(start.0, start.1);
                if start.0 < end.0 {
                    crossings.push(end.0, end.1);
                }
            }
        };
        const START: (f64, u32) = (f64::NEG_INFINITY, 0);
        const END: (f64, u32) = (f64::INFINITY, 0);
        match roots {
            Roots::None if along.c < 0.0 => piece(START, END),
            Roots::None => {}
            Roots::One(s) => {
                let root = (along.t0 + s, 0);
                let slope = along.a * s + along.b;
                // One root: a tangent, or a linear equation; scaled coefficients leave no root to overflow.
                if along.a > 0.0 && slope.abs() <= f64::EPSILON * along.b.abs() {
                    piece(root, root);
                } else if along.a < 0.0 {
                    piece(START, END);
                } else if slope > 0.0 {
                    piece(START, root);
                } else {
                    piece(root, END);
                }
            }
            Roots::Two(s0, s1) => {
                let (first, second) = ((along.t0 + s0, 0), (along.t0 + s1, 1));
                if along.a > 0.0 {
                    piece(first, second);
                } else {
                    piece(START, first);
                    piece(second, END);
                }
            }
        }
        crossings
    }

    /// The point that a crossing found, solved again for a line that may differ from the one that found it by
    /// rounding: object space, unit normal. At a singular point (a cone's apex) the normal is `-direction`.
    pub fn point(&self, origin: DVec3, direction: DVec3, surface: u32) -> QuadricPoint {
        let against = || normalize(-direction).unwrap_or(DVec3::Y);
        if surface >= 2 {
            let axis = (surface as usize - 2) / 2;
            let upper = surface % 2 == 1;
            let plane = if upper { self.clip.max[axis] } else { self.clip.min[axis] };
            let t = (plane - origin[axis]) / direction[axis];
            let mut position = origin + direction * t;
            position[axis] = plane;
            let mut normal = DVec3::ZERO;
            normal[axis] = if upper { 1.0 } else { -1.0 };
            return QuadricPoint { position, normal, error: rounding(origin, position), from_outside: None };
        }
        let Some(along) = self.form.along(origin, direction) else {
            let error = rounding(origin, origin);
            return QuadricPoint { position: origin, normal: against(), error, from_outside: None };
        };
        let roots = solve(along.a, along.b, along.c);
        // Between the roots F has the sign of -a. A line that slipped past a tangent was taken for one with two roots.
        let from_outside = match roots {
            Roots::Two(..) => Some((surface == 0) == (along.a > 0.0)),
            Roots::None if along.a != 0.0 => Some((surface == 0) == (along.a > 0.0)),
            Roots::None | Roots::One(_) => None,
        };
        let s = match (roots, surface) {
            (Roots::Two(_, s), 1) => s,
            (Roots::Two(s, _) | Roots::One(s), _) => s,
            // The line slipped past a tangent: take the closest point.
            (Roots::None, _) if along.a != 0.0 => -along.b / along.a,
            (Roots::None, _) => 0.0,
        };
        let normal = normalize(self.form.gradient(&along, s)).unwrap_or_else(against);
        let position = self.form.surface_point(&along, s);
        let center = self.form.center();
        let error = rounding(origin - center, position - center) + rounding(center, position);
        QuadricPoint { position, normal, error, from_outside }
    }

    /// Texture coordinates of a point found on `surface`.
    pub fn uv(&self, position: DVec3, surface: u32) -> DVec2 {
        let longitude = |p: DVec3| 0.5 + libm::atan2(p.x, p.z) / std::f64::consts::TAU;
        if let (Mapping::Cylindrical { .. }, Some(bounds), true) = (self.mapping, &self.bounds, surface >= 2) {
            // A cap shows the image inscribed in the square around it, upright seen from outside.
            let half = f64::from(bounds.max.x);
            let up = if surface == 4 { 0.5 } else { -0.5 };
            return DVec2::new(0.5 + 0.5 * position.x / half, 0.5 + up * position.z / half);
        }
        match self.mapping {
            Mapping::Spherical => {
                let p = position - self.form.center();
                let latitude = libm::asin((p.y / length(p).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0));
                DVec2::new(longitude(p), 0.5 + latitude / std::f64::consts::PI)
            }
            Mapping::Cylindrical { y0, y1 } => DVec2::new(longitude(position), (position.y - y0) / (y1 - y0)),
            Mapping::Planar { half_size } => {
                DVec2::new(0.5 + 0.5 * position.x / half_size, 0.5 - 0.5 * position.z / half_size)
            }
        }
    }

    /// How texture coordinates lie on it.
    pub fn mapping(&self) -> Mapping {
        self.mapping
    }

    /// The value of F at a point of object space, up to a positive factor.
    pub fn value(&self, p: DVec3) -> f64 {
        self.form.value(p)
    }

    /// Where a line enters and leaves the clip box, with the numbers of the caps; empty if the first is larger.
    fn clip_interval(&self, origin: DVec3, direction: DVec3) -> ((f64, u32), (f64, u32)) {
        let (mut enter, mut leave) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
        for axis in 0..3 {
            let inverse = 1.0 / direction[axis];
            let (lower, upper) = (2 + 2 * axis as u32, 3 + 2 * axis as u32);
            let (near, far) = if inverse.is_sign_negative() {
                ((self.clip.max[axis], upper), (self.clip.min[axis], lower))
            } else {
                ((self.clip.min[axis], lower), (self.clip.max[axis], upper))
            };
            let (t_near, t_far) = ((near.0 - origin[axis]) * inverse, (far.0 - origin[axis]) * inverse);
            // NaN (a line within a side) keeps the running bound.
            if t_near > enter.0 {
                enter = (t_near, near.1);
            }
            if t_far < leave.0 {
                leave = (t_far, far.1);
            }
        }
        (enter, leave)
    }
}

/// The box around the clipped surface: an ellipsoid's cut by the clip box, else the clip box, if it ends.
fn bounds_of(form: &QuadricForm, clip: &Clip) -> Option<Bounds> {
    let (min, max) = form.ellipsoid_bounds().unwrap_or((DVec3::NEG_INFINITY, DVec3::INFINITY));
    let (min, max) = (min.max(clip.min), max.min(clip.max));
    // An ellipsoid outside its clip box leaves nothing; keep a box that is not inside out.
    let max = max.max(min);
    (min.is_finite() && max.is_finite()).then(|| Bounds { min: round_down_vec(min), max: round_up_vec(max) })
}

/// What the some thirty f64 operations between a line's origin and a point on it may have lost, and a second line that
/// starts there may lose again: 64 roundings of the largest coordinate.
fn rounding(origin: DVec3, position: DVec3) -> f64 {
    64.0 * f64::EPSILON * origin.abs().max_element().max(position.abs().max_element())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hits(q: &Quadric, o: [f64; 3], d: [f64; 3]) -> Vec<(f64, u32)> {
        q.intersect_quadratic(o.into(), d.into()).iter().map(|c| (c.t, c.surface)).collect()
    }

    const SPHERE: [f64; 10] = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];

    #[test]
    fn a_sphere_is_crossed_twice_touched_once_or_missed() {
        let sphere = Quadric::new(SPHERE, None, false).unwrap();
        assert_eq!(hits(&sphere, [0.0, 0.0, 3.0], [0.0, 0.0, -1.0]), [(2.0, 0), (4.0, 1)]);
        assert_eq!(hits(&sphere, [1.0, 0.0, 3.0], [0.0, 0.0, -1.0]), [(3.0, 0)]);
        assert_eq!(hits(&sphere, [1.0f64.next_up(), 0.0, 3.0], [0.0, 0.0, -1.0]), []);
        assert_eq!(hits(&sphere, [0.0, 0.0, 0.0], [0.0, 2.0, 0.0]), [(-0.5, 0), (0.5, 1)]);
    }

    #[test]
    fn the_matrix_form_is_column_major_and_symmetrised() {
        // The paraboloid x^2 + z^2 = y with all of 2h in one half of the matrix.
        let mut m = [0.0; 16];
        (m[0], m[10], m[13]) = (1.0, 1.0, -1.0);
        let q = Quadric::from_matrix(m, None, false).unwrap();
        assert_eq!(hits(&q, [2.0, 10.0, 0.0], [0.0, -1.0, 0.0]), [(6.0, 0)]);
    }

    #[test]
    fn a_far_sphere_given_by_coefficients_is_recentred() {
        let d = 1e4;
        let q = Quadric::new([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, -d, 0.0, 0.0, d * d - 1.0], None, false).unwrap();
        let found = hits(&q, [d, 0.0, 5.0], [0.0, 0.0, -1.0]);
        assert!((found[0].0 - 4.0).abs() < 1e-8 && (found[1].0 - 6.0).abs() < 1e-8, "{found:?}");
        let bounds = q.bounds().unwrap();
        assert!((bounds.center() - DVec3::new(d, 0.0, 0.0)).abs().max_element() < 1e-3);
    }

    #[test]
    fn a_solid_half_sphere_has_a_cap() {
        let upper = Clip::between(0.0, 2.0);
        let half = Quadric::new(SPHERE, Some(upper), true).unwrap();
        let found = hits(&half, [0.5, -3.0, 0.0], [0.0, 1.0, 0.0]);
        assert_eq!((found.len(), found[0], found[1].1), (2, (3.0, 4), 1));
        assert!((found[1].0 - (3.0 + 0.75f64.sqrt())).abs() < 1e-15 * 4.0);
        let open = Quadric::new(SPHERE, Some(upper), false).unwrap();
        assert_eq!(hits(&open, [0.5, -3.0, 0.0], [0.0, 1.0, 0.0]), found[1..]);
        assert_eq!(hits(&half, [0.0, 1.5, 0.0], [1.0, 0.0, 0.0]), []);
        let point = half.point(DVec3::new(0.5, -3.0, 0.0), DVec3::Y, 4);
        assert_eq!((point.position, point.normal), (DVec3::new(0.5, 0.0, 0.0), -DVec3::Y));
    }

    #[test]
    fn ellipsoid_bounds_come_from_the_dual() {
        // x^2/4 + y^2/9 + z^2 = 1, rotated by 45 degrees in the xy plane.
        let (a, b) = (0.25, 1.0 / 9.0);
        let (mean, difference) = (0.5 * (a + b), 0.5 * (a - b));
        let q = Quadric::new([mean, mean, 1.0, difference, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0], None, false).unwrap();
        let bounds = q.bounds().unwrap();
        let half = (0.5 * (4.0 + 9.0f64)).sqrt();
        assert!((bounds.max.x as f64 - half).abs() < 1e-5 && (bounds.min.y as f64 + half).abs() < 1e-5);
        assert!((bounds.max.z - 1.0).abs() < 1e-5);
    }
}
