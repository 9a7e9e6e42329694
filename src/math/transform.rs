//! Affine transforms in f64, with the inverse computed once.

use glam::{DAffine3, DMat3, DVec3, DVec4};

use crate::error::{Error, Result};
use crate::math::vector::{cross, dot};

/// A non-singular affine map from object space to world space and its inverse, both f64.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform {
    to_world: DAffine3,
    to_object: DAffine3,
}

impl Transform {
    /// The identity.
    pub const IDENTITY: Self = Self { to_world: DAffine3::IDENTITY, to_object: DAffine3::IDENTITY };

    /// Inverts `to_world`.
    ///
    /// # Errors
    /// A caller's error for a matrix that is singular, or that rounding its numbers may have made so, or that has a
    /// component that is infinite or NaN.
    pub fn new(to_world: DAffine3) -> Result<Self> {
        let m = to_world.matrix3;
        let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
        let yz = cross(y, z);
        let determinant = dot(x, yz);
        let singular = || Error::caller("the transform is singular or not finite").remedy("scales must not be 0");
        // The six products with no sign: three roundings of the matrix's numbers and five of the computation may be off
        // by their share of this. It grows with rows and columns as the determinant does, so that flat and long
        // objects pass.
        let unsigned = |a: DVec3, b: DVec3| {
            let (a, b) = (a.abs(), b.abs());
            DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
        };
        let rounding = 4.0 * f64::EPSILON * dot(x.abs(), unsigned(y, z));
        if !(to_world.is_finite() && determinant.abs() > rounding && determinant.abs() < f64::INFINITY) {
            return Err(singular());
        }
        let inverse =
            DMat3::from_cols(yz / determinant, cross(z, x) / determinant, cross(x, y) / determinant).transpose();
        let t = to_world.translation;
        let translation = -apply(&inverse, t);
        let to_object = DAffine3 { matrix3: inverse, translation };
        if !to_object.is_finite() {
            return Err(singular());
        }
        Ok(Self { to_world, to_object })
    }

    /// Object space to world space.
    pub fn to_world(&self) -> &DAffine3 {
        &self.to_world
    }

    /// World space to object space.
    pub fn to_object(&self) -> &DAffine3 {
        &self.to_object
    }

    /// Whether this is exactly the identity, which costs nothing to apply.
    pub fn is_identity(&self) -> bool {
        self.to_world == DAffine3::IDENTITY
    }

    /// Whether the map mirrors, so that it turns a counter-clockwise triangle clockwise.
    pub fn is_mirroring(&self) -> bool {
        let m = &self.to_world.matrix3;
        dot(m.x_axis, cross(m.y_axis, m.z_axis)) < 0.0
    }

    /// A point from object to world space.
    #[inline(always)]
    pub fn point_to_world(&self, p: DVec3) -> DVec3 {
        point(&self.to_world, p)
    }

    /// A direction from object to world space, not normalised.
    #[inline(always)]
    pub fn vector_to_world(&self, v: DVec3) -> DVec3 {
        apply(&self.to_world.matrix3, v)
    }

    /// A point from world to object space.
    ///
    /// The translation goes first: between a point and an object far away the difference is exact where products are not.
    #[inline(always)]
    pub fn point_to_object(&self, p: DVec3) -> DVec3 {
        apply(&self.to_object.matrix3, p - self.to_world.translation)
    }

    /// A direction from world to object space, not normalised: t is the same in both spaces.
    #[inline(always)]
    pub fn vector_to_object(&self, v: DVec3) -> DVec3 {
        apply(&self.to_object.matrix3, v)
    }

    /// A normal from object to world space by the inverse transpose, not normalised.
    ///
    /// The orientation follows the surface: outward stays outward under a mirror too.
    #[inline(always)]
    pub fn normal_to_world(&self, n: DVec3) -> DVec3 {
        let m = &self.to_object.matrix3;
        DVec3::new(dot(m.x_axis, n), dot(m.y_axis, n), dot(m.z_axis, n))
    }
}

/// `m v`, each component summed left to right.
#[inline(always)]
pub fn apply(m: &DMat3, v: DVec3) -> DVec3 {
    m.x_axis * v.x + m.y_axis * v.y + m.z_axis * v.z
}

/// A point mapped by `m`: [`apply`], then the translation.
#[inline(always)]
pub fn point(m: &DAffine3, p: DVec3) -> DVec3 {
    apply(&m.matrix3, p) + m.translation
}

/// The map that applies `inner`, then `outer`.
pub fn compose(outer: &DAffine3, inner: &DAffine3) -> DAffine3 {
    let (m, n) = (&outer.matrix3, &inner.matrix3);
    let matrix3 = DMat3::from_cols(apply(m, n.x_axis), apply(m, n.y_axis), apply(m, n.z_axis));
    DAffine3 { matrix3, translation: point(outer, inner.translation) }
}

/// The rotation by a unit quaternion, scalar last.
pub fn rotation_by(q: DVec4) -> DMat3 {
    let DVec4 { x, y, z, w } = q;
    let (x2, y2, z2) = (2.0 * x, 2.0 * y, 2.0 * z);
    DMat3::from_cols(
        DVec3::new(1.0 - (y * y2 + z * z2), x * y2 + w * z2, x * z2 - w * y2),
        DVec3::new(x * y2 - w * z2, 1.0 - (x * x2 + z * z2), y * z2 + w * x2),
        DVec3::new(x * z2 + w * y2, y * z2 - w * x2, 1.0 - (x * x2 + y * y2)),
    )
}

/// A rotation by `angle` radians about the unit vector `axis` through the origin, right-handed (Rodrigues).
pub fn rotation_about(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    let turn = |v: DVec3| v * cos + cross(axis, v) * sin + axis * (dot(axis, v) * (1.0 - cos));
    DMat3::from_cols(turn(DVec3::X), turn(DVec3::Y), turn(DVec3::Z))
}

/// A rotation about the x, then the y, then the z axis (fixed axes); radians.
///
/// Uses `libm`, so that a rotated scene is the same on every machine.
pub fn rotation_xyz(angles: DVec3) -> DMat3 {
    let (sx, cx) = libm::sincos(angles.x);
    let (sy, cy) = libm::sincos(angles.y);
    let (sz, cz) = libm::sincos(angles.z);
    let x = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cx, sx), DVec3::new(0.0, -sx, cx));
    let y = DMat3::from_cols(DVec3::new(cy, 0.0, -sy), DVec3::Y, DVec3::new(sy, 0.0, cy));
    let z = DMat3::from_cols(DVec3::new(cz, sz, 0.0), DVec3::new(-sz, cz, 0.0), DVec3::Z);
    let product = |a: &DMat3, b: &DMat3| DMat3::from_cols(apply(a, b.x_axis), apply(a, b.y_axis), apply(a, b.z_axis));
    product(&z, &product(&y, &x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn singular_and_nan_matrices_are_typed_errors() {
        assert!(Transform::new(DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0))).is_err());
        assert!(Transform::new(DAffine3::from_translation(DVec3::new(0.0, f64::NAN, 0.0))).is_err());
        assert!(Transform::new(DAffine3::from_scale(DVec3::splat(f64::INFINITY))).is_err());
        // One column is the sum of the others, whatever the rounded determinant is.
        let (x, y) = (DVec3::new(0.1, 0.7, 0.3), DVec3::new(-0.4, 0.2, -0.6));
        let flat = DMat3::from_cols(x, y, x + y);
        assert!(Transform::new(DAffine3::from_mat3(flat)).is_err());
        assert!(Transform::new(DAffine3::from_mat3(flat.transpose())).is_err());
        // Flattened between two turns.
        let (turn, back) = (rotation_xyz(DVec3::new(0.3, 1.0, 2.0)), rotation_xyz(DVec3::new(1.1, -0.2, 0.4)));
        let squeezed = |by| DAffine3::from_mat3(turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, by)) * back);
        assert!(Transform::new(squeezed(0.0)).is_err());
        assert!(Transform::new(squeezed(1e-9)).is_ok());
        // Thin and long ones are as they should be.
        for scale in [DVec3::new(1.0, 1.0, 1e-30), DVec3::new(1e-20, 1e20, 1.0)] {
            assert!(Transform::new(DAffine3::from_mat3(turn * DMat3::from_diagonal(scale))).is_ok());
            assert!(Transform::new(DAffine3::from_mat3(DMat3::from_diagonal(scale) * turn)).is_ok());
        }
    }

    #[test]
    fn points_go_there_and_back_and_normals_stay_perpendicular() {
        let m = DMat3::from_cols(DVec3::new(2.0, 0.1, 0.0), DVec3::new(10.0, 1e-3, 0.5), DVec3::new(0.0, 3.0, -1.0));
        let t = Transform::new(DAffine3 { matrix3: m, translation: DVec3::new(5.0, -7.0, 9.0) }).unwrap();
        let p = DVec3::new(0.3, -0.7, 1.1);
        assert!((t.point_to_object(t.point_to_world(p)) - p).abs().max_element() < 1e-12);
        let (u, v) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 2.0));
        let n = t.normal_to_world(cross(u, v));
        assert!(dot(n, t.vector_to_world(u)).abs() < 1e-12 && dot(n, t.vector_to_world(v)).abs() < 1e-12);
    }

    #[test]
    fn rotations_turn_by_the_right_hand_rule() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let near = |a: DVec3, b: DVec3| (a - b).abs().max_element() < 1e-15;
        assert!(near(rotation_xyz(DVec3::new(quarter, 0.0, 0.0)) * DVec3::Y, DVec3::Z));
        assert!(near(rotation_xyz(DVec3::new(0.0, quarter, 0.0)) * DVec3::Z, DVec3::X));
        assert!(near(rotation_xyz(DVec3::new(0.0, 0.0, quarter)) * DVec3::X, DVec3::Y));
        assert!(near(rotation_about(DVec3::Y, quarter) * DVec3::Z, DVec3::X));
        let diagonal = DVec3::ONE / 3f64.sqrt();
        assert!(near(rotation_about(diagonal, 4.0 * quarter / 3.0) * DVec3::X, DVec3::Y));
    }

    #[test]
    fn quaternions_turn_as_their_axis_and_angle_do() {
        for (axis, angle) in [(DVec3::X, 0.3), (DVec3::new(0.6, -0.48, 0.64), 2.9), (DVec3::NEG_Z, -1.0)] {
            let (sin, cos) = libm::sincos(0.5 * angle);
            let (turn, expected) = (rotation_by((axis * sin).extend(cos)), rotation_about(axis, angle));
            for v in [DVec3::X, DVec3::Y, DVec3::Z] {
                assert!((turn * v - expected * v).abs().max_element() < 1e-15, "{axis} {angle}");
            }
        }
        assert_eq!(rotation_by(DVec4::W), DMat3::IDENTITY);
    }

    #[test]
    fn the_inner_map_of_a_composition_comes_first() {
        let (turn, shift) = (rotation_xyz(DVec3::new(0.1, -0.7, 2.0)), DVec3::new(1.0, 2.0, -3.0));
        let outer = DAffine3 { matrix3: turn, translation: shift };
        let inner = DAffine3::from_scale_rotation_translation(DVec3::new(2.0, 1.0, -0.5), glam::DQuat::IDENTITY, shift);
        let p = DVec3::new(0.3, 0.7, 9.0);
        let expected = outer.transform_point3(inner.transform_point3(p));
        assert!((point(&outer, point(&inner, p)) - expected).abs().max_element() < 1e-14);
        assert!((compose(&outer, &inner).transform_point3(p) - expected).abs().max_element() < 1e-14);
    }
}
