//! Dot, cross, length and normalise with the order of every sum spelled out.
//!
//! `glam` offers these too, but may evaluate them differently on different platforms; what decides a hit or a pixel
//! uses these.

use glam::{DVec3, Vec3};

/// `a.x b.x + a.y b.y + a.z b.z`, summed left to right, f32.
#[inline(always)]
pub fn dot_f32(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// `a.x b.x + a.y b.y + a.z b.z`, summed left to right, f64.
#[inline(always)]
pub fn dot(a: DVec3, b: DVec3) -> f64 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Cross product, f64.
#[inline(always)]
pub fn cross(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// Squares of lengths of which the root loses nothing.
pub const SAFE: std::ops::Range<f64> = 1e-200..1e200;

/// Whether a square is [`SAFE`], without a branch.
#[expect(clippy::manual_range_contains, reason = "that has a branch")]
#[inline(always)]
pub fn is_safe(squared: f64) -> bool {
    (squared >= SAFE.start) & (squared < SAFE.end)
}

/// Euclidean length, f64. Does not guard against overflow: components beyond 1e150 give infinity.
#[inline(always)]
pub fn length(a: DVec3) -> f64 {
    dot(a, a).sqrt()
}

/// The unit vector along `a`, or `None` for zero, infinite and NaN vectors.
#[inline(always)]
pub fn normalize(a: DVec3) -> Option<DVec3> {
    normal_and_length(a).map(|(unit, _)| unit)
}

/// The unit vector along `a` and its [`length`], which may have over- or underflowed; or `None` for zero, infinite and NaN vectors.
#[inline(always)]
pub fn normal_and_length(a: DVec3) -> Option<(DVec3, f64)> {
    let squared = dot(a, a);
    let length = squared.sqrt();
    if SAFE.contains(&squared) {
        return Some((a / length, length));
    }
    normalize_scaled(a).map(|unit| (unit, length))
}

/// The vector is first scaled by its largest component, so that no square under- or overflows.
#[cold]
fn normalize_scaled(a: DVec3) -> Option<DVec3> {
    let largest = a.x.abs().max(a.y.abs()).max(a.z.abs());
    if !(largest > 0.0 && largest < f64::INFINITY) {
        return None;
    }
    let scaled = a / largest;
    let unit = scaled / length(scaled);
    // A NaN component hides from `max`; it does not hide from this comparison.
    (unit.x.abs() <= 1.0 && unit.y.abs() <= 1.0 && unit.z.abs() <= 1.0).then_some(unit)
}

/// Two unit vectors that, with the unit vector `n`, form a right-handed orthonormal basis (Duff et al. 2017).
pub fn basis(n: DVec3) -> (DVec3, DVec3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalize_handles_the_extremes() {
        assert_eq!(normalize(DVec3::ZERO), None);
        assert_eq!(normalize(DVec3::new(f64::NAN, 1.0, 0.0)), None);
        assert_eq!(normalize(DVec3::new(1.0, f64::INFINITY, 0.0)), None);
        for scale in [1e-300, 1e-160, 1.0, 1e160, 1e300] {
            let n = normalize(DVec3::new(3.0, 0.0, 4.0) * scale).unwrap();
            assert!((n - DVec3::new(0.6, 0.0, 0.8)).abs().max_element() < 1e-15);
        }
    }

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for n in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::new(0.6, -0.48, -0.64)] {
            let (t, b) = basis(n);
            assert!((cross(n, t) - b).abs().max_element() < 1e-15, "{n}");
            assert!(dot(t, n).abs() < 1e-15 && (length(t) - 1.0).abs() < 1e-15, "{n}");
        }
    }
}
