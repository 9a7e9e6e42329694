//! How far the renderer's answers may be from the exact ones: bounds that are proven here, evaluated per ray and surface.
//!
//! Let u = 2^-24 and gamma_n = n u / (1 - n u) (Higham 2002). Hats are computed values.
//!
//! # The edge bound of triangles
//!
//! With `R = p - o` for a vertex p, and s = d_x / d_z the shear, Woop's test computes `x = R_x - s R_z`. R_x and R_z carry one
//! rounding each, s one, the product one, the difference one: `|x^ - x| <= gamma_4 (|R_x| + |s R_z|)`, the same for y, and
//! 2^-149 (1 + |R_z|) where s or the product underflows. So the test sees a triangle T^ whose sheared corners are moved
//! by at most h, the largest of the lengths of (error of x, error of y). Since |s| <= 1, h < 12 u max|p - o|.
//!
//! *If the ray's line passes T and not T^, or T^ and not T, it passes within h of an edge of T, as a segment.* Move the corners
//! from T to T^ evenly. The line is inside at one end and outside at the other, so at some time it lies on an edge, at
//! `(1 - l) a' + l b'` with l in [0, 1] and corners moved by at most h; the same l on T's own edge is within h.
//! Distances in the sheared plane are taken at a fixed z and so are no smaller than those from the line in space.
//!
//! The signs that the test takes are those of `fl(a_x b_y) - fl(a_y b_x)`. Rounding is monotone, so a product that is larger stays
//! no smaller: a sign is right or becomes 0, and zeros are inside. Hence *no miss comes from this*, and an extra hit
//! needs an edge with `|a x b| <= 1.01 u |a| |b|`: one seen from the ray at an angle of nearly 0 or pi. At pi the ray passes
//! between its ends, within `|a x b| / |a - b| <= 1.01 u min(|a|, |b|)`. At 0 the ray passes the edge's line beyond
//! its end; it is then outside of another edge as well, unless that is seen at an angle of nearly 0 or pi too; both at 0, all
//! of T^ is seen within 2 u: [`TriangleBounds::needle`], for which the box that t is clamped to is the only bound. No such hit
//! has been seen, and it would be counted as wrong.
//!
//! # The bound of t of triangles
//!
//! With weights w_i (twice the areas of sheared triangles) and t_i = R_z / d_z of the corners, t = sum w_i t_i / sum w_i. Since
//! sum w_i (t_i - t) = 0,
//!
//! ```text
//! sum w^_i t_i / sum w^_i - t = sum (w^_i - w_i) (t_i - t) / sum w^_i
//! ```
//!
//! exactly. A weight is off by at most `D = e_ax |b_y| + e_ay |b_x| + e_bx |a_y| + e_by |a_x| + 2 e e + gamma_2 (|a_x b_y| + |a_y
//! b_x|) + 2^-148`. So the first bound is `sum D_i |t_i - t| / (|sum w_i| - sum D_i)`. It grows without end as a triangle is
//! seen edge-on; but computed weights have one sign, so that their mean of the t_i cannot leave these: the second bound
//! is `max |t_i - t|`. The smaller holds. What remains is relative: t^_i carry 3 roundings (d_z's reciprocal, R_z, the
//! product), products and sums 3, the determinant 2, the quotient 1: gamma_9 max|t_i|. Clamping into an interval whose ends
//! are computed moves t towards the true value or to an end that is off by at most gamma_7 of itself (a difference, a
//! reciprocal 2 ulp larger, a product): less than that. Underflow of weights times t adds 6 2^-149 / |sum w_i|.
//!
//! All of it for directions whose largest component lies between 2^-126 and 2^126; beyond, no bound is claimed.
//!
//! # Instances
//!
//! The local ray `M^-1 o, M^-1 d` is rounded to f32: by u of each component, and by what f64 lost before. For that let B be the
//! computed inverse and r = |B A - I| + 8 eps |B| |A| (norms of largest row sums): `|(M^-1 - B) v| <= r |B| |v|`. These errors
//! add to those of x, y and t_i as they stand in the formulas. A distance in local space is one in the world times at
//! most the Frobenius norm of A.
//!
//! # Quadrics
//!
//! The form is centred and turned in f64, and clears what lies 1e-12 below its largest coefficient; with some 60 roundings
//! of f64 the quadratic is that of a surface F + f with |f| <= Phi = 2^-39 sum |q_ij| m_i m_j, m = |p| + |centre|, plus |grad F|
//! 2^-47 (|o| + |t d| + |centre|) for where the point is. A root moves to where |F| <= Phi: by
//! `2 Phi / (|F'| + sqrt(F'^2 - 4 |a| Phi))` if that is real, else (a tangent) it may be gone, or be `(|F'| + sqrt(F'^2 + 4
//! |a| Phi)) / (2 |a|)` off. Rounding t to f32 adds u |t|, clamping gamma_7 |t|. On a cap t is a quotient of f64.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::geometry::{Quadric, Ray};
use crate::math::float::{UNIT_ROUNDOFF, gamma};
use crate::math::vector::{dot, length};
use crate::render::world::Instance;

/// What f32 loses where numbers underflow.
const UNDERFLOW: f64 = 1.401_298_464_324_817e-45;

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

/// Bounds for one ray and one triangle.
#[derive(Debug, Clone, Copy)]
pub struct TriangleBounds {
    /// World distance of the ray's line from an edge within which hit and miss may be confused.
    pub edge: f64,
    /// Whether the triangle is seen so nearly edge-on that an extra hit is bounded by its box alone.
    pub needle: bool,
    /// Largest error of t; infinite where none is claimed. NaN if t was not given.
    pub t: f64,
}

/// The bounds for a ray and a triangle of an instance, whose exact t is given if there is one.
pub fn triangle(ray: &Ray, instance: &Instance, corners: [Vec3; 3], t: Option<f64>) -> TriangleBounds {
    let LocalRay { origin, direction: d, origin_error, direction_error, stretch } = local(ray, instance);
    let magnitude = d.abs();
    let z = if magnitude.x > magnitude.y && magnitude.x > magnitude.z {
        0
    } else if magnitude.y > magnitude.z {
        1
    } else {
        2
    };
    let (kx, ky) = ((z + 1) % 3, (z + 2) % 3);
    let along = magnitude[z] - direction_error[z];
    let usual = libm::ldexp(1.0, -126)..=libm::ldexp(1.0, 126);
    if !usual.contains(&along) {
        return TriangleBounds { edge: f64::INFINITY, needle: true, t: f64::INFINITY };
    }

    // The sheared corners, and how far the renderer's may be from them.
    let relative = corners.map(|p| p.as_dvec3() - origin);
    let sheared = |r: DVec3, k: usize| {
        let s = d[k] / d[z];
        let shear_error = (direction_error[k] + s.abs() * direction_error[z]) / along;
        let own = gamma(4) * (r[k].abs() + (s * r[z]).abs()) + UNDERFLOW * (1.0 + r[z].abs());
        let inherited = origin_error[k] + s.abs() * origin_error[z] + shear_error * r[z].abs();
        (r[k] - s * r[z], own + inherited)
    };
    let points = relative.map(|r| [sheared(r, kx), sheared(r, ky)]);
    let radius = |[(x, _), (y, _)]: [(f64, f64); 2]| (x * x + y * y).sqrt();
    let shift = points.map(|[(_, ex), (_, ey)]| (ex * ex + ey * ey).sqrt()).into_iter().fold(0.0, f64::max);
    let far = points.map(radius).into_iter().fold(0.0, f64::max);
    let edge = stretch * (shift + 1.01 * UNIT_ROUNDOFF * (far + shift)) * (1.0 + 1e-9);

    // The weights, and how far the renderer's may be from them.
    let weight = |a: [(f64, f64); 2], b: [(f64, f64); 2]| {
        let [(ax, eax), (ay, eay)] = a;
        let [(bx, ebx), (by, eby)] = b;
        let products = (ax * by).abs() + (ay * bx).abs();
        let moved = eax * by.abs() + eay * bx.abs() + ebx * ay.abs() + eby * ax.abs() + eax * eby + eay * ebx;
        (ax * by - ay * bx, (moved + gamma(2) * (products + moved) + 2.0 * UNDERFLOW) * (1.0 + 1e-6))
    };
    let [a, b, c] = points;
    let weights = [weight(b, c), weight(c, a), weight(a, b)];
    let error_sum: f64 = weights.iter().map(|(_, error)| error).sum();
    let determinant = (weights[0].0 + weights[1].0 + weights[2].0).abs();
    let needle = determinant <= error_sum;

    let t_bound = t.map_or(f64::NAN, |t| {
        let times = relative.map(|r| r[z] / d[z]);
        let by_weights: f64 = times.iter().zip(&weights).map(|(ti, (_, error))| error * (ti - t).abs()).sum();
        let least = determinant - error_sum;
        let by_weights = if least > 0.0 { (by_weights + 6.0 * UNDERFLOW) / least } else { f64::INFINITY };
        let by_hull = times.map(|ti| (ti - t).abs()).into_iter().fold(0.0, f64::max);
        let largest = times.map(f64::abs).into_iter().fold(t.abs(), f64::max);
        let inherited = (origin_error[z] + largest * direction_error[z]) / along;
        (by_weights.min(by_hull) + inherited) * (1.0 + gamma(9)) + gamma(9) * largest + UNDERFLOW
    });
    TriangleBounds { edge, needle, t: t_bound }
}

/// Bounds for one ray and one quadric.
#[derive(Debug, Clone, Copy)]
pub struct QuadricBounds {
    /// Whether rounding can make or lose a crossing: a tangent, or a root beside a side of the clip box.
    pub near_edge: bool,
    /// Largest error of t at the t that was given.
    pub t: f64,
}

/// The bounds for a ray and a quadric of an instance, at t on surface `surface`.
pub fn quadric(ray: &Ray, instance: &Instance, quadric: &Quadric, t: f64, surface: u32) -> QuadricBounds {
    let line = QuadricLine::new(ray, instance, quadric);
    let sides = line.sides();
    let is_near = |a: &(f64, f64), b: &(f64, f64)| (a.0 - b.0).abs() <= a.1 + b.1;
    let roots = line.roots();
    let beside_side = roots.iter().any(|root| sides.iter().any(|(side, _)| is_near(root, side)));
    let at_corner = (0..sides.len()).any(|i| (0..i).any(|j| is_near(&sides[i].0, &sides[j].0)));
    let own = if surface >= 2 {
        let at = sides.iter().find(|(_, number)| *number == surface);
        at.map_or(f64::INFINITY, |((_, error), _)| *error)
    } else {
        line.root_error(t)
    };
    let rounded = own + (UNIT_ROUNDOFF + gamma(7)) * t.abs() + UNDERFLOW;
    let near_edge = line.is_near_tangent() || line.is_in_side(t) || beside_side || at_corner;
    QuadricBounds { near_edge, t: rounded }
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
