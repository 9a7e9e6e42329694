//! A quadratic form in three variables, centred and turned to its own axes.

use glam::DVec3;

use crate::math::eigen::eigen;
use crate::math::vector::dot;

/// `F(p) = sum_k squares_k y_k^2 + 2 linear . y + constant` with `y` the coordinates of `p - center` along `axes`.
///
/// Coefficients are scaled by a power of two so that the largest is near 1. What rounding leaves where the rank is
/// lower (a cylinder's curvature along its axis, a centred form's linear part) is cleared: a tilted cylinder must not
/// be an ellipsoid 1e8 long.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct QuadricForm {
    /// Object-space point where `y` is 0: the centre, or the point of the axis nearest to the object's origin.
    center: DVec3,
    /// Object-space unit vectors; `None` where they are x, y and z.
    axes: Option<[DVec3; 3]>,
    squares: DVec3,
    linear: DVec3,
    constant: f64,
    /// The axis k of a plane counted twice, `squares_k y_k^2 = 0`: what rounding leaves of a discriminant that is 0 on
    /// every line must not decide whether it is met.
    double_plane: Option<usize>,
}

/// The quadratic `a s^2 + 2 b s + c` of F along a line, s counted from the closest approach to the centre.
#[derive(Debug, Clone, Copy)]
pub struct Along {
    /// The line's parameter at the closest approach.
    pub t0: f64,
    /// The line's point and direction there, along the form's axes.
    start: DVec3,
    direction: DVec3,
    /// Half the second derivative.
    pub a: f64,
    /// Half the slope at the closest approach.
    pub b: f64,
    /// The value at the closest approach.
    pub c: f64,
}

/// Of quantities that should cancel, what is below this share of the largest is rounding: four digits above that of
/// f64, since coefficients may have been rotated before they were given.
const RANK_TOLERANCE: f64 = 1e-12;

impl QuadricForm {
    /// The form `a x^2 + b y^2 + c z^2 + 2 d xy + 2 e yz + 2 f xz + 2 g x + 2 h y + 2 i z + j`, coefficients in that
    /// order, finite and not all zero.
    pub fn new(coefficients: [f64; 10]) -> Self {
        let largest = coefficients.iter().fold(0.0f64, |largest, c| largest.max(c.abs()));
        let scale = libm::ldexp(1.0, -libm::ilogb(largest));
        let [a, b, c, d, e, f, g, h, i, j] = coefficients.map(|k| k * scale);
        let (mut squares, vectors) = eigen(DVec3::new(a, b, c), DVec3::new(d, e, f));
        let axes = (vectors != [DVec3::X, DVec3::Y, DVec3::Z]).then_some(vectors);
        let given = DVec3::new(g, h, i);
        let mut form =
            Self { center: DVec3::ZERO, axes, squares, linear: DVec3::ZERO, constant: j, double_plane: None };
        let mut linear = form.to_axes(given);

        // Complete the square along each axis that bends; along the others the form stays linear.
        let bend = squares.abs().max_element();
        let slope = given.abs().max_element();
        let mut center = DVec3::ZERO;
        for k in 0..3 {
            if squares[k].abs() > RANK_TOLERANCE * bend {
                center[k] = -linear[k] / squares[k];
                form.constant += linear[k] * center[k];
                linear[k] = 0.0;
            } else {
                squares[k] = 0.0;
                if linear[k].abs() <= RANK_TOLERANCE * slope {
                    linear[k] = 0.0;
                }
            }
        }
        if linear == DVec3::ZERO
            && let [Some(k), None, None] = bent_axes(squares)
        {
            // The constant is what is left of `j` and the completed square; each of them was rounded.
            let size = j.abs() + (squares[k] * center[k] * center[k]).abs();
            if form.constant.abs() <= 4.0 * f64::EPSILON * size {
                form.constant = 0.0;
                form.double_plane = Some(k);
            }
        }
        form.center = form.to_object(center);
        form.squares = squares;
        form.linear = linear;
        form
    }

    /// The centre, object space.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// F at an object-space point, up to a positive factor.
    pub fn value(&self, p: DVec3) -> f64 {
        let y = self.to_axes(p - self.center);
        dot(self.squares * y, y) + 2.0 * dot(self.linear, y) + self.constant
    }

    /// F along the object-space line `origin + t direction`; `None` for a line without direction, and for one within
    /// the surface.
    #[inline]
    pub fn along(&self, origin: DVec3, direction: DVec3) -> Option<Along> {
        let from_center = self.to_axes(origin - self.center);
        let direction = self.to_axes(direction);
        let mut t0 = -dot(from_center, direction) / dot(direction, direction);
        if !t0.is_finite() {
            return None;
        }
        let mut start = from_center + direction * t0;
        if let Some(k) = self.double_plane {
            // Count from the plane itself, where a line meets it.
            let crossing = -from_center[k] / direction[k];
            if crossing.is_finite() {
                t0 = crossing;
                start = from_center + direction * t0;
                start[k] = 0.0;
            }
        }
        let bent = self.squares * direction;
        let along = Along {
            t0,
            start,
            direction,
            a: dot(direction, bent),
            b: dot(start, bent) + dot(self.linear, direction),
            c: dot(self.squares * start, start) + 2.0 * dot(self.linear, start) + self.constant,
        };
        (!self.holds(&along, from_center)).then_some(along)
    }

    /// Whether a line lies within the surface: all three coefficients are what rounding leaves of 0.
    fn holds(&self, along: &Along, from_center: DVec3) -> bool {
        const ROUNDING: f64 = 8.0 * f64::EPSILON;
        let Along { t0, start, direction, a, b, c } = *along;
        let (curved, steep) = ((self.squares * direction).abs(), self.linear.abs());
        if a.abs() > ROUNDING * dot(direction.abs(), curved) {
            return false;
        }
        // Of each product its own rounding, and that of the start, which comes from as far away as the line does.
        let (start, moved) = (start.abs(), (from_center.abs() + (direction * t0).abs()) * ROUNDING);
        let slope = self.squares.abs() * start + steep;
        b.abs() <= ROUNDING * (dot(start, curved) + dot(steep, direction.abs())) + dot(moved, curved)
            && c.abs()
                <= ROUNDING * (dot(slope, start) + dot(steep, start) + self.constant.abs()) + 2.0 * dot(moved, slope)
    }

    /// The object-space point at `s` on a line.
    #[inline]
    pub fn point(&self, along: &Along, s: f64) -> DVec3 {
        self.center + self.to_object(along.start + along.direction * s)
    }

    /// The point of the surface next to the one at `s` on a line, object space: one step of Newton's method along the
    /// gradient, after which a plane along two axes has its points exactly there.
    pub fn surface_point(&self, along: &Along, s: f64) -> DVec3 {
        let y = along.start + along.direction * s;
        let half_gradient = self.squares * y + self.linear;
        let value = dot(self.squares * y, y) + 2.0 * dot(self.linear, y) + self.constant;
        let step = half_gradient * (0.5 * value / dot(half_gradient, half_gradient));
        // At a singular point there is no gradient, and near one the step is longer than what rounding can be off.
        let longest = f64::from(f32::EPSILON) * y.abs().max_element();
        let y = if step.abs().max_element() <= longest { y - step } else { y };
        self.center + self.to_object(y)
    }

    /// Half the gradient at `s` on a line, object space.
    pub fn gradient(&self, along: &Along, s: f64) -> DVec3 {
        if let Some(k) = self.double_plane {
            return self.to_object(DVec3::AXES[k]);
        }
        self.to_object(self.squares * (along.start + along.direction * s) + self.linear)
    }

    /// The box around `F = 0` if that is an ellipsoid: least and greatest corner, object space.
    pub fn ellipsoid_bounds(&self) -> Option<(DVec3, DVec3)> {
        let positive = self.squares.cmpgt(DVec3::ZERO).all();
        let negative = self.squares.cmplt(DVec3::ZERO).all();
        if !(positive || negative) {
            return None;
        }
        // Half extents of { sum_k squares_k y_k^2 = -j }: sqrt(-j (Q^-1)_ii), Q^-1 = sum_k v_k v_k^T / squares_k. An
        // imaginary ellipsoid has the extent of a point and is never hit.
        let axes = self.axes.unwrap_or([DVec3::X, DVec3::Y, DVec3::Z]);
        let inverse_diagonal = (0..3).fold(DVec3::ZERO, |sum, k| sum + axes[k] * axes[k] / self.squares[k]);
        let half = (inverse_diagonal * -self.constant).max(DVec3::ZERO).map(f64::sqrt);
        // The axes are good to about 1e-15; allow for that.
        let half = half * (1.0 + RANK_TOLERANCE);
        Some((self.center - half, self.center + half))
    }

    #[inline(always)]
    fn to_axes(&self, v: DVec3) -> DVec3 {
        match &self.axes {
            None => v,
            Some([x, y, z]) => DVec3::new(dot(*x, v), dot(*y, v), dot(*z, v)),
        }
    }

    #[inline(always)]
    fn to_object(&self, y: DVec3) -> DVec3 {
        match &self.axes {
            None => y,
            Some([x_axis, y_axis, z_axis]) => *x_axis * y.x + *y_axis * y.y + *z_axis * y.z,
        }
    }
}

/// The axes along which a form bends, in their order.
fn bent_axes(squares: DVec3) -> [Option<usize>; 3] {
    let mut bent = (0..3).filter(|&k| squares[k] != 0.0);
    [bent.next(), bent.next(), bent.next()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::quadratic::{Roots, solve};
    use crate::math::random::{hash2, unit};

    #[test]
    fn the_form_has_the_values_of_its_coefficients() {
        for seed in 0..300 {
            let random = |k: u32| unit(hash2(seed, k)) * 2.0 - 1.0;
            let k: [f64; 10] = std::array::from_fn(|i| random(i as u32));
            let form = QuadricForm::new(k);
            let naive = |p: DVec3| {
                k[0] * p.x * p.x
                    + k[1] * p.y * p.y
                    + k[2] * p.z * p.z
                    + 2.0 * (k[3] * p.x * p.y + k[4] * p.y * p.z + k[5] * p.x * p.z)
                    + 2.0 * (k[6] * p.x + k[7] * p.y + k[8] * p.z)
                    + k[9]
            };
            let (p, q) =
                (DVec3::new(random(20), random(21), random(22)), DVec3::new(random(23), random(24), random(25)));
            // Equal up to one positive factor.
            let (a, b) = (form.value(p) * naive(q), form.value(q) * naive(p));
            assert!((a - b).abs() < 1e-9 * (1.0 + form.center().length_squared()), "{seed}: {a} {b}");
            assert!(form.value(p) * naive(p) >= 0.0 || naive(p).abs() < 1e-9);
        }
    }

    #[test]
    fn planes_counted_twice_are_met_once_by_every_line() {
        // (n.p - h)^2 = 0.
        for seed in 0..300 {
            let random = |k: u32| unit(hash2(seed, k)) * 2.0 - 1.0;
            let (n, h) = (DVec3::new(random(0), random(1), random(2)), random(3) * 10.0);
            let l = n * -h;
            let form = QuadricForm::new([
                n.x * n.x,
                n.y * n.y,
                n.z * n.z,
                n.x * n.y,
                n.y * n.z,
                n.x * n.z,
                l.x,
                l.y,
                l.z,
                h * h,
            ]);
            let (o, d) = (DVec3::new(random(4), random(5), random(6)), DVec3::new(random(7), random(8), random(9)));
            let along = form.along(o, d).unwrap();
            let Roots::One(s) = solve(along.a, along.b, along.c) else { panic!("{seed}: {along:?}") };
            let expected = (h - dot(n, o)) / dot(n, d);
            assert!((along.t0 + s - expected).abs() < 1e-10 * (1.0 + expected.abs() / dot(n, d).abs()), "{seed}");
            let gradient = form.gradient(&along, s);
            assert!(gradient.cross(n).length() < 1e-12 && gradient.length() > 0.9, "{seed}: {gradient}");
        }
    }

    #[test]
    fn tilted_cylinders_and_paraboloids_are_no_ellipsoids() {
        for (x, y, z) in [(2.0, 1.0, 2.0), (2.0, 3.0, 6.0), (1.0, 4.0, 8.0), (0.6, 0.8, 0.0), (0.0, 1.0, 0.0)] {
            let n = DVec3::new(x, y, z) / DVec3::new(x, y, z).length();
            let across = |h: f64, j: f64| {
                let l = n * h;
                [
                    1.0 - n.x * n.x,
                    1.0 - n.y * n.y,
                    1.0 - n.z * n.z,
                    -n.x * n.y,
                    -n.y * n.z,
                    -n.x * n.z,
                    l.x,
                    l.y,
                    l.z,
                    j,
                ]
            };
            // |p|^2 - (n.p)^2 = 1: a line along the axis crosses nothing, inside or outside.
            let cylinder = QuadricForm::new(across(0.0, -1.0));
            assert!(cylinder.ellipsoid_bounds().is_none(), "{n}");
            let along = cylinder.along(DVec3::splat(0.1), n).unwrap();
            assert!(along.a.abs() < 1e-30 && along.b.abs() < 1e-15, "{n}: {along:?}");
            // |p|^2 - (n.p)^2 = n.p: a line along the axis meets it once, near.
            let paraboloid = QuadricForm::new(across(-0.5, 0.0));
            assert!(paraboloid.ellipsoid_bounds().is_none(), "{n}");
            let origin = n * 10.0 + n.any_orthonormal_vector() * 2.0;
            let along = paraboloid.along(origin, -n).unwrap();
            // The direction is rounded: where it is not quite the axis there is another root, out of all reach.
            let root = match solve(along.a, along.b, along.c) {
                Roots::One(s) => s,
                Roots::Two(far, s) if far < -1e25 => s,
                Roots::Two(s, far) if far > 1e25 => s,
                other => panic!("{n}: {other:?}"),
            };
            assert!((along.t0 + root - 6.0).abs() < 1e-12, "{n}: {}", along.t0 + root);
        }
    }
}
