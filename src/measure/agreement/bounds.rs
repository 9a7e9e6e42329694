//! How far the renderer's answers may be from the exact ones: bounds that are proven here, evaluated per ray and surface.
//!
//! Let u = 2^-24 and gamma_n = n u / (1 - n u) (Higham 2002). Hats are computed values.
//!
//! # The edge bound of triangles
//!
//! With `R = p - o` for a vertex p, and s = d_x / d_z the shear, Woop's test computes `x = R_x - s R_z` in f32. One rounding is in
//! R_x, three are in s R_z (R_z, s, the product), and one more is of the difference: with
//! `e = u |R_x| + gamma_3 |s R_z| + 2^-150 (1 + |R_z|)`, the last for underflow of s and of the product,
//! `|x^ - x| <= e + u (|x| + e)`, and the same for y. So the test sees a triangle T^ whose sheared corners are moved
//! by at most h, the largest of the lengths of (error of x, error of y). That is `2 u |R_x| + 4 u |s R_z|` at most, so that
//! `h <= 2 u |(R_x, R_y)| + 4 sqrt(2) u |R_z| <= 6 u max|p - o|`, but for what is below 1e-6 of it, and underflow.
//!
//! From there on the test errs no more: products of f32 are rounded monotonely where they reject, and exact in f64 where
//! they decide; a rounded difference keeps its sign. Three weights of one sign, not all 0, mean that T^ has an area and the
//! line in it. Hence *it reports a hit only of a line that passes T^, and a miss only of one that does not, or where T^ has
//! no area*. That f32 could lose the line's part of the triangle's box to rounding is not excused here.
//!
//! *If the ray's line passes T and not T^, or T^ and not T, it passes within h of an edge of T, as a segment.* Move the corners
//! from T to T^ evenly. The line is inside at one end and outside at the other, so at some time it lies on an edge, at
//! `(1 - l) a' + l b'` with l in [0, 1] and corners moved by at most h; the same l on T's own edge is within h. A triangle
//! without area, T seen edge-on or T^, is nothing but edges.
//! Distances in the sheared plane are taken at a fixed z and so are no smaller than those from the line in space.
//!
//! # The bound of t of triangles
//!
//! With weights w_i (twice the areas of sheared triangles) and t_i = R_z / d_z of the corners, the line meets the plane at
//! t = sum w_i t_i / sum w_i, inside the triangle or not. Let w^_i be the weights of T^. Since sum w_i (t_i - t) = 0,
//!
//! ```text
//! sum w^_i t_i / sum w^_i - t = sum (w^_i - w_i) (t_i - t) / sum w^_i
//! ```
//!
//! exactly. A weight is off by at most `D = e_ax |b_y| + e_ay |b_x| + e_bx |a_y| + e_by |a_x| + e_ax e_by + e_ay e_bx`, so that the mean
//! lies within `sum D_i |t_i - t| / (|sum w_i| - sum D_i)` of t. That grows without end as a triangle is seen edge-on; but w^_i
//! have one sign, and their mean lies between the least and the largest t_i. Both hold. What remains is relative: R_z carries
//! one rounding, which weights of one sign pass on as u |t|, or u max|t_i| where the t_i differ in sign; f64 adds 9
//! of its own roundings, less than 2^-49; t is rounded to f32 once: u |t| + 2^-150.
//!
//! Then t is clamped into the interval of the triangle's [`hit_bounds`]. Its near end carries 3 roundings (a difference, a
//! reciprocal, a product): gamma_3. The far end's reciprocal is made [`PADDING`] ulp larger, n of which are n u to 2 n u: it is
//! off by at most gamma_(3 + 2 n), away from 0. Clamping is monotone in t and in both ends, so that bounds of these give bounds of the result.
//!
//! All of it for directions whose components are 0 or lie between 2^-126 and 2^126, in the world and in the instance's
//! space; beyond, no bound is claimed.
//!
//! # Instances
//!
//! The local ray `M^-1 o, M^-1 d` is rounded to f32: by u of each component, and by what f64 lost before. For that let B be the
//! computed inverse and r = |B A - I| + 8 eps |B| |A| (norms of largest row sums): `|(M^-1 - B) v| <= r |B| |v|`. These errors
//! add to those of x, y and t_i as they stand in the formulas. A distance in local space is one in the world times at
//! most the Frobenius norm of A. Which component is the largest is asked of the rounded direction, as the renderer does. In
//! the end t is clamped into the interval of the instance's box in the world.
//!
//! # Quadrics
//!
//! The form is centred and turned in f64, and clears what lies 1e-12 below its largest coefficient; with some 60 roundings
//! of f64 the quadratic is that of a surface F + f with |f| <= Phi = 2^-39 sum |q_ij| m_i m_j, m = |p| + |centre|, plus |grad F|
//! 2^-47 (|o| + |t d| + |centre|) for where the point is. A root moves to where |F| <= Phi: by
//! `2 Phi / (|F'| + sqrt(F'^2 - 4 |a| Phi))` if that is real, else (a tangent) it may be gone, or be `(|F'| + sqrt(F'^2 + 4
//! |a| Phi)) / (2 |a|)` off. Rounding t to f32 adds u |t| + 2^-150, and it is clamped into the interval of the instance's box,
//! as above. On a cap t is a quotient of f64.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::geometry::ray::{Interval, PADDING, PreparedRay};
use crate::geometry::triangle::hit_bounds;
use crate::geometry::{Bounds, Quadric, Ray};
use crate::math::float::{UNIT_ROUNDOFF, gamma};
use crate::math::vector::{dot, length};
use crate::render::world::Instance;

/// What f32 loses at most where a result underflows: half of the least number, 2^-150.
const UNDERFLOW: f64 = 7.006_492_321_624_085e-46;

/// What evaluating these bounds in f64 may lose of them: some ten roundings of terms that are 2^29 times smaller.
const OWN_ROUNDING: f64 = 1.0 + 1e-7;

/// A ray in the space of an instance, and what rounding it there may have done.
struct LocalRay {
    origin: DVec3,
    direction: DVec3,
    /// Bounds on what the renderer's f32 origin and direction are off, per component.
    origin_error: DVec3,
    direction_error: DVec3,
    /// How much longer distances can be in the world.
    stretch: f64,
}

fn local(ray: &Ray, instance: &Instance) -> LocalRay {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let (origin, direction) = instance.local_line(o, d);
    if instance.identity {
        let zero = DVec3::ZERO;
        return LocalRay { origin, direction, origin_error: zero, direction_error: zero, stretch: 1.0 };
    }
    let lost = inverse_error(instance.transform.to_world(), instance.transform.to_object());
    let moved = o.abs().max_element() + instance.transform.to_world().translation.abs().max_element();
    let rounded = |v: DVec3, lost: f64| v.abs() * UNIT_ROUNDOFF * (1.0 + UNIT_ROUNDOFF) + lost + UNDERFLOW;
    let m = instance.transform.to_world().matrix3;
    let stretch = (dot(m.x_axis, m.x_axis) + dot(m.y_axis, m.y_axis) + dot(m.z_axis, m.z_axis)).sqrt();
    LocalRay {
        origin,
        direction,
        origin_error: rounded(origin, lost * moved),
        direction_error: rounded(direction, lost * d.abs().max_element()),
        stretch,
    }
}

/// What multiplies a vector's largest component to bound what the computed inverse loses on it, with the rounding of
/// applying it.
fn inverse_error(to_world: &DAffine3, to_object: &DAffine3) -> f64 {
    let (a, b) = (&to_world.matrix3, &to_object.matrix3);
    let norm = |m: &DMat3| {
        let rows = m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs();
        rows.max_element()
    };
    let product = DMat3::from_cols(
        crate::math::transform::apply(b, a.x_axis) - DVec3::X,
        crate::math::transform::apply(b, a.y_axis) - DVec3::Y,
        crate::math::transform::apply(b, a.z_axis) - DVec3::Z,
    );
    let residual = norm(&product) + 8.0 * f64::EPSILON * norm(b) * norm(a);
    (residual + 8.0 * f64::EPSILON) * norm(b)
}

/// Numbers of which only the ends are known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// The least.
    pub least: f64,
    /// The largest.
    pub largest: f64,
}

impl Span {
    /// No bound.
    pub const ALL: Self = Self { least: f64::NEG_INFINITY, largest: f64::INFINITY };

    fn around(t: f64, error: f64) -> Self {
        Self { least: t - error, largest: t + error }
    }

    /// The numbers in both.
    fn and(self, other: Self) -> Self {
        Self { least: self.least.max(other.least), largest: self.largest.min(other.largest) }
    }

    fn magnitude(self) -> f64 {
        self.least.abs().max(self.largest.abs())
    }

    /// After each was rounded to f32.
    fn rounded(self) -> Self {
        let Self { least, largest } = self;
        let error = |t: f64| UNIT_ROUNDOFF * t.abs() * OWN_ROUNDING + UNDERFLOW;
        Self { least: least - error(least), largest: largest + error(largest) }
    }

    /// After each was clamped into an interval whose ends are known so well; it is not empty, or there is no hit.
    fn clamped(self, near: Self, far: Self) -> Self {
        Self {
            least: self.least.max(near.least).min(far.least).max(near.least),
            largest: self.largest.max(near.largest).min(far.largest),
        }
    }
}

/// Where the renderer takes a line to enter a box, and to leave it.
fn box_interval(bounds: &Bounds, line: &LocalRay) -> (Span, Span) {
    /// Roundings of the far end, an ulp of the padding being two at most.
    const FAR: u32 = 3 + 2 * PADDING;
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let none = Span { least: f64::NEG_INFINITY, largest: f64::NEG_INFINITY };
    let (mut near, mut far) = (none, Span { least: f64::INFINITY, largest: f64::INFINITY });
    for axis in 0..3 {
        let (d, lost) = (line.direction[axis], line.direction_error[axis]);
        if d == 0.0 && lost == 0.0 {
            continue;
        }
        let (mut entry, mut exit) = (Span::ALL, Span::ALL);
        if d.abs() > lost {
            let (first, last) = if d < 0.0 { (max[axis], min[axis]) } else { (min[axis], max[axis]) };
            let crossing = |at: f64| {
                let t = (at - line.origin[axis]) / d;
                Span::around(t, (line.origin_error[axis] + t.abs() * lost) / (d.abs() - lost) * OWN_ROUNDING)
            };
            let rounding = |t: f64, count: u32| gamma(count) * t.abs() * OWN_ROUNDING + UNDERFLOW;
            let (a, b) = (crossing(first), crossing(last));
            entry = Span { least: a.least - rounding(a.least, 3), largest: a.largest + rounding(a.largest, 3) };
            // Away from 0 by more than roundings lead back to it.
            exit = Span {
                least: b.least - if b.least < 0.0 { rounding(b.least, FAR) } else { UNDERFLOW },
                largest: b.largest + if b.largest > 0.0 { rounding(b.largest, FAR) } else { UNDERFLOW },
            };
        }
        near = Span { least: near.least.max(entry.least), largest: near.largest.max(entry.largest) };
        far = Span { least: far.least.min(exit.least), largest: far.largest.min(exit.largest) };
    }
    (near, far)
}

/// What becomes of t in the interval of the instance's box.
fn clipped(t: Span, ray: &Ray, instance: &Instance) -> Span {
    let Some(bounds) = instance.bounds else { return t };
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let zero = DVec3::ZERO;
    let line = LocalRay { origin, direction, origin_error: zero, direction_error: zero, stretch: 1.0 };
    let (near, far) = box_interval(&bounds, &line);
    t.clamped(near, far)
}

/// Whether bounds are claimed for a direction.
fn is_usual(direction: Vec3) -> bool {
    let usual = libm::ldexpf(1.0, -126)..=libm::ldexpf(1.0, 126);
    direction.to_array().into_iter().all(|component| component == 0.0 || usual.contains(&component.abs()))
}

/// Bounds for one ray and one triangle.
#[derive(Debug, Clone, Copy)]
pub struct TriangleBounds {
    /// World distance of the ray's line from an edge within which hit and miss may be confused.
    pub edge: f64,
    /// Whether the triangle is seen so nearly edge-on that rounding can turn it around.
    pub edge_on: bool,
    /// Where t lies if the renderer reports a hit.
    pub t: Span,
}

impl TriangleBounds {
    /// Nothing is claimed.
    const NONE: Self = Self { edge: f64::INFINITY, edge_on: true, t: Span::ALL };
}

/// The bounds for a ray and a triangle of an instance, whose exact t is given if the line passes it.
pub fn triangle(ray: &Ray, instance: &Instance, corners: [Vec3; 3], t: Option<f64>) -> TriangleBounds {
    let rounded = PreparedRay::new(ray).and_then(|ray| instance.local_ray(&ray, Interval::ALL));
    let Some(rounded) = rounded.filter(|local| is_usual(ray.direction) && is_usual(local.direction.into())) else {
        return TriangleBounds::NONE;
    };
    let line = local(ray, instance);
    let LocalRay { origin, direction: d, origin_error, direction_error, stretch } = line;
    let [kx, ky, z] = rounded.axes;
    let along = d[z].abs() - direction_error[z];
    if !(along > 0.0) {
        return TriangleBounds::NONE;
    }

    // The sheared corners, and how far the renderer's may be from them.
    let relative = corners.map(|p| p.as_dvec3() - origin);
    let sheared = |r: DVec3, k: usize| {
        let s = d[k] / d[z];
        let x = r[k] - s * r[z];
        let own = UNIT_ROUNDOFF * r[k].abs() + gamma(3) * (s * r[z]).abs() + UNDERFLOW * (1.0 + r[z].abs());
        let own = own + UNIT_ROUNDOFF * (x.abs() + own);
        let shear_error = (direction_error[k] + s.abs() * direction_error[z]) / along;
        let inherited = origin_error[k] + s.abs() * origin_error[z] + shear_error * (r[z].abs() + origin_error[z]);
        (x, (own + inherited * (1.0 + gamma(8))) * OWN_ROUNDING)
    };
    let points = relative.map(|r| [sheared(r, kx), sheared(r, ky)]);
    let shift = points.map(|[(_, ex), (_, ey)]| (ex * ex + ey * ey).sqrt()).into_iter().fold(0.0, f64::max);

    // The weights, and how far the renderer's may be from them.
    let weight = |a: [(f64, f64); 2], b: [(f64, f64); 2]| {
        let [(ax, eax), (ay, eay)] = a;
        let [(bx, ebx), (by, eby)] = b;
        let moved = eax * by.abs() + eay * bx.abs() + ebx * ay.abs() + eby * ax.abs() + eax * eby + eay * ebx;
        (ax * by - ay * bx, moved * OWN_ROUNDING)
    };
    let [a, b, c] = points;
    let weights = [weight(b, c), weight(c, a), weight(a, b)];
    let error_sum: f64 = weights.iter().map(|(_, error)| error).sum();
    let sum: f64 = weights.iter().map(|(weight, _)| weight).sum();
    let edge_on = sum.abs() <= error_sum;

    // The mean of the corners' t, by what weights are off and by their having one sign.
    let times = relative.map(|r| r[z] / d[z]);
    let hull = Span {
        least: times.into_iter().fold(f64::INFINITY, f64::min),
        largest: times.into_iter().fold(f64::NEG_INFINITY, f64::max),
    };
    let mut mean = hull;
    if !edge_on {
        let t = t.unwrap_or_else(|| times.iter().zip(&weights).map(|(ti, (w, _))| ti * w).sum::<f64>() / sum);
        let moved: f64 = times.iter().zip(&weights).map(|(ti, (_, error))| error * (ti - t).abs()).sum();
        let near = Span::around(t, moved / (sum.abs() - error_sum) * OWN_ROUNDING);
        let both = hull.and(near);
        // A line that is far from the triangle has no common part.
        mean = if both.least <= both.largest { both } else { hull };
    }
    let one_sign = hull.least >= 0.0 || hull.largest <= 0.0;
    let scale = if one_sign { mean.magnitude() } else { hull.magnitude() };
    let relative_error = UNIT_ROUNDOFF + libm::ldexp(1.0, -49);
    let inherited = (origin_error[z] + scale * direction_error[z]) / along;
    let lost = (relative_error * scale + inherited * (1.0 + gamma(2))) * OWN_ROUNDING;
    let mean = Span { least: mean.least - lost, largest: mean.largest + lost }.rounded();

    let (near, far) = box_interval(&hit_bounds(corners), &line);
    let own = mean.clamped(near, far);
    let t = if instance.identity { own } else { clipped(own, ray, instance) };
    TriangleBounds { edge: stretch * shift * OWN_ROUNDING, edge_on, t }
}

/// Bounds for one ray and one surface of a quadric.
#[derive(Debug, Clone, Copy)]
pub struct QuadricBounds {
    /// Whether rounding can make or lose this crossing: a tangent, or a root beside a side of the clip box.
    pub near_edge: bool,
    /// Where t lies if the renderer reports a hit.
    pub t: Span,
}

/// The bounds for a ray and a quadric of an instance on surface `surface`: at its exact t if the line crosses it there, or
/// else for the crossing nearest to `near` that rounding could make.
pub fn quadric(
    ray: &Ray,
    instance: &Instance,
    quadric: &Quadric,
    surface: u32,
    t: Option<f64>,
    near: f64,
) -> QuadricBounds {
    if !is_usual(ray.direction) {
        return QuadricBounds { near_edge: true, t: Span::ALL };
    }
    let line = QuadricLine::new(ray, instance, quadric);
    let (roots, sides) = (line.roots(), line.sides());
    let own: Option<(f64, f64)> = if surface >= 2 {
        sides.iter().find(|(_, number)| *number == surface).map(|(side, _)| *side)
    } else {
        let by_distance = |a: &&(f64, f64), b: &&(f64, f64)| (a.0 - near).abs().total_cmp(&(b.0 - near).abs());
        t.map(|t| (t, line.root_error(t))).or_else(|| roots.iter().min_by(by_distance).copied())
    };
    // A cap that the line runs along, or a surface that it is nowhere near.
    let Some(own) = own else { return QuadricBounds { near_edge: t.is_some(), t: Span::ALL } };
    let is_near = |other: &(f64, f64)| (own.0 - other.0).abs() <= own.1 + other.1;
    let beside = sides.iter().any(|(side, number)| *number != surface && is_near(side));
    let rim = surface >= 2 && roots.iter().any(is_near);
    let tangent = surface < 2 && line.is_near_tangent();
    let near_edge = tangent || line.is_in_side(own.0) || beside || rim;
    let computed = Span::around(t.unwrap_or(own.0), own.1).rounded();
    QuadricBounds { near_edge, t: clipped(computed, ray, instance) }
}

/// A quadric's form along a line, in f64.
struct QuadricLine<'a> {
    quadric: &'a Quadric,
    origin: DVec3,
    direction: DVec3,
    /// Where |p - centre| is least.
    t0: f64,
    /// `a s^2 + 2 b s + c`, s = t - t0.
    a: f64,
    b: f64,
    c: f64,
    /// What f64 lost of the local ray, per unit of t and at t = 0.
    local_error: (f64, f64),
}

impl<'a> QuadricLine<'a> {
    fn new(ray: &Ray, instance: &Instance, quadric: &'a Quadric) -> Self {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (origin, direction) = instance.local_line(o, d);
        let local_error = if instance.identity {
            (0.0, 0.0)
        } else {
            let to_world = instance.transform.to_world();
            let lost = inverse_error(to_world, instance.transform.to_object());
            let moved = o.abs().max_element() + to_world.translation.abs().max_element();
            (lost * d.abs().max_element(), lost * moved)
        };
        let t0 = dot(quadric.center() - origin, direction) / dot(direction, direction);
        let mut line = Self { quadric, origin, direction, t0, a: 0.0, b: 0.0, c: 0.0, local_error };
        let start = line.point(t0);
        (line.a, line.b, line.c) = (
            dot(direction, line.bent(direction)),
            dot(direction, line.half_gradient(start)),
            dot(start, line.bent(start)) + 2.0 * dot(line.linear(), start) + quadric.coefficients()[9],
        );
        line
    }

    fn point(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    fn bent(&self, v: DVec3) -> DVec3 {
        let [a, b, c, d, e, f, ..] = *self.quadric.coefficients();
        DVec3::new(a * v.x + d * v.y + f * v.z, d * v.x + b * v.y + e * v.z, f * v.x + e * v.y + c * v.z)
    }

    fn linear(&self) -> DVec3 {
        let k = self.quadric.coefficients();
        DVec3::new(k[6], k[7], k[8])
    }

    fn half_gradient(&self, p: DVec3) -> DVec3 {
        self.bent(p) + self.linear()
    }

    /// Phi: how far from 0 the form that the renderer solves may be at a true root, or the true one at its root.
    fn tolerance(&self, t: f64) -> f64 {
        let (p, center) = (self.point(t), self.quadric.center());
        let m = p.abs() + center.abs();
        let [a, b, c, d, e, f, g, h, i, j] = self.quadric.coefficients().map(f64::abs);
        let squares = a * m.x * m.x + b * m.y * m.y + c * m.z * m.z;
        let mixed = d * m.x * m.y + e * m.y * m.z + f * m.x * m.z;
        let terms = squares + 2.0 * mixed + 2.0 * (g * m.x + h * m.y + i * m.z) + j;
        let lost = self.local_error.0 * t.abs() + self.local_error.1;
        let reach = length(self.origin) + length(self.direction) * t.abs() + length(center);
        let place = libm::ldexp(reach, -47) + 2.0 * lost;
        libm::ldexp(terms, -39) + 2.0 * length(self.half_gradient(p)) * place
    }

    /// How far a root near t may be moved.
    fn root_error(&self, t: f64) -> f64 {
        let s = t - self.t0;
        let (slope, bend, phi) = ((2.0 * (self.a * s + self.b)).abs(), self.a.abs(), self.tolerance(t));
        let least = slope * slope - 4.0 * bend * phi;
        if least > 0.0 {
            2.0 * phi / (slope + least.sqrt())
        } else if bend > 0.0 {
            (slope + (slope * slope + 4.0 * bend * phi).sqrt()) / (2.0 * bend)
        } else {
            f64::INFINITY
        }
    }

    /// Whether the two roots may have become none, or none two.
    fn is_near_tangent(&self) -> bool {
        if self.a == 0.0 {
            return self.b == 0.0;
        }
        let nearest = -self.b / self.a;
        let value = self.c - self.b * self.b / self.a;
        !(value.abs() > self.tolerance(self.t0 + nearest))
    }

    /// The roots with their errors; a tangent's is the point nearest to the surface.
    fn roots(&self) -> Vec<(f64, f64)> {
        let found = match crate::math::quadratic::solve(self.a, self.b, self.c) {
            crate::math::quadratic::Roots::None if self.a != 0.0 && self.is_near_tangent() => vec![-self.b / self.a],
            crate::math::quadratic::Roots::None => Vec::new(),
            crate::math::quadratic::Roots::One(s) => vec![s],
            crate::math::quadratic::Roots::Two(r, s) => vec![r, s],
        };
        found.into_iter().map(|s| (self.t0 + s, self.root_error(self.t0 + s))).collect()
    }

    /// Whether the line runs along the sides of an axis, as far as rounding can tell.
    fn is_parallel(&self, axis: usize) -> bool {
        let lost = self.local_error.0 + libm::ldexp(self.direction.abs().max_element(), -49);
        self.direction[axis].abs() <= 2.0 * lost
    }

    /// Whether rounding can put the line on either side of one of the clip box's, along which it runs.
    fn is_in_side(&self, t: f64) -> bool {
        let clip = self.quadric.clip();
        let lost = self.local_error.0 * t.abs() + self.local_error.1;
        (0..3).any(|axis| {
            let d = self.direction[axis].abs();
            let p = self.origin[axis];
            let terms = p.abs() + (length(self.direction) * t).abs();
            let is_beside = |at: f64| (at - p).abs() <= d * t.abs() + lost + libm::ldexp(at.abs() + terms, -49);
            self.is_parallel(axis)
                && [clip.min[axis], clip.max[axis]].into_iter().any(|at| at.is_finite() && is_beside(at))
        })
    }

    /// Where the line crosses the sides of the clip box, with the errors of that, and the numbers of their caps.
    fn sides(&self) -> Vec<((f64, f64), u32)> {
        let clip = self.quadric.clip();
        let mut found = Vec::new();
        for axis in 0..3 {
            for (side, at) in [(0, clip.min[axis]), (1, clip.max[axis])] {
                if at.is_finite() && !self.is_parallel(axis) {
                    let t = (at - self.origin[axis]) / self.direction[axis];
                    let lost = self.local_error.0 * t.abs() + self.local_error.1;
                    let terms = at.abs() + self.origin[axis].abs() + (self.direction[axis] * t).abs();
                    // The direction is off by half of itself at most.
                    let error = 2.0 * (libm::ldexp(terms, -49) + lost) / self.direction[axis].abs();
                    found.push(((t, error), 2 + 2 * axis as u32 + side));
                }
            }
        }
        found
    }
}
