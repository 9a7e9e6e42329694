//! Keyframes and what lies between them (glTF 2.0, appendix C).

use std::ops::Range;

use ::gltf::json::accessor::Type;
use ::gltf::json::{Index, Root};
use glam::DVec4;

use super::accessor::Accessor;
use super::budget::Budget;
use super::buffers::Buffers;
use super::document::Sampler;
use crate::error::{Error, Result};

/// What a sampler's values are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Values {
    /// Vectors of three numbers.
    Vectors,
    /// Quaternions, which turn at a constant rate between keys.
    Rotations,
    /// So many numbers each.
    Weights(usize),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Linear,
    Step,
    CubicSpline,
}

impl Interpolation {
    fn of(sampler: &Sampler) -> Result<Self> {
        match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Ok(Self::Linear),
            Some("STEP") => Ok(Self::Step),
            Some("CUBICSPLINE") => Ok(Self::CubicSpline),
            Some(_) => Err(Error::file("has an interpolation that glTF does not have")),
        }
    }

    /// How many values stand at each key: a spline has one between its tangents.
    fn values_at_key(self) -> usize {
        if self == Self::CubicSpline { 3 } else { 1 }
    }
}

/// Where a time lies among ascending ones.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Moment {
    /// At a key, or beyond the first or last.
    At(usize),
    /// Between a key and the next: how long that is, and which share of it has passed, from 0 to 1.
    After { key: usize, length: f64, share: f64 },
}

/// The value of a sampler at a time in seconds; before its first key and after its last it stays as it is there.
///
/// # Errors
/// A file's error for times that do not ascend strictly, or not as many values as its keys want.
pub(super) fn evaluate(
    root: &Root,
    buffers: &Buffers,
    sampler: &Sampler,
    values: Values,
    time: f64,
    budget: &mut Budget,
) -> Result<Vec<f64>> {
    let interpolation = Interpolation::of(sampler)?;
    let input = Accessor::open(root, buffers, Index::new(sampler.input))?;
    if input.shape() != Type::Scalar {
        return Err(Error::file("has times that are no numbers"));
    }
    budget.take::<[f64; 2]>(input.count())?;
    let moment = find(&input.numbers(0..input.count())?, time)?;
    let output = Accessor::open(root, buffers, Index::new(sampler.output))?;
    let keys = Keys::new(&output, values, interpolation, input.count())?;
    let Moment::After { key, length, share } = moment else {
        let Moment::At(key) = moment else { unreachable!("the other case") };
        return keys.value(key);
    };
    match (interpolation, values) {
        (Interpolation::Step, _) => keys.value(key),
        (Interpolation::Linear, Values::Rotations) => {
            Ok(slerp(quaternion(&keys.value(key)?), quaternion(&keys.value(key + 1)?), share).to_array().to_vec())
        }
        (Interpolation::Linear, _) => {
            let mix = |(a, b): (f64, f64)| a * (1.0 - share) + b * share;
            Ok(keys.value(key)?.into_iter().zip(keys.value(key + 1)?).map(mix).collect())
        }
        (Interpolation::CubicSpline, _) => {
            let (start, out) = (keys.value(key)?, keys.read(key, 2)?);
            let (end, into) = (keys.value(key + 1)?, keys.read(key + 1, 0)?);
            let at = |i| hermite([start[i], out[i] * length, end[i], into[i] * length], share);
            Ok((0..start.len()).map(at).collect())
        }
    }
}

/// The values at the keys.
struct Keys<'a> {
    output: &'a Accessor<'a>,
    /// How many elements of the accessor a value has.
    elements: usize,
    interpolation: Interpolation,
}

impl<'a> Keys<'a> {
    fn new(output: &'a Accessor<'a>, values: Values, interpolation: Interpolation, keys: usize) -> Result<Self> {
        let (shape, elements) = match values {
            Values::Vectors => (Type::Vec3, 1),
            Values::Rotations => (Type::Vec4, 1),
            Values::Weights(count) => (Type::Scalar, count),
        };
        let wanted = keys.saturating_mul(elements).saturating_mul(interpolation.values_at_key());
        if output.shape() != shape || output.count() != wanted {
            let have = output.count();
            return Err(Error::file(format!(
                "has {have} values of type {:?} where its {keys} keys want {wanted} of type {shape:?}",
                output.shape()
            )));
        }
        Ok(Self { output, elements, interpolation })
    }

    /// The value at a key, tangents apart.
    fn value(&self, key: usize) -> Result<Vec<f64>> {
        self.read(key, self.interpolation.values_at_key() / 2)
    }

    /// One of what stands at a key: of a spline the incoming tangent, the value, the outgoing tangent.
    fn read(&self, key: usize, which: usize) -> Result<Vec<f64>> {
        let start = (key * self.interpolation.values_at_key() + which) * self.elements;
        let elements: Range<usize> = start..start + self.elements;
        self.output.numbers(elements)
    }
}

fn find(times: &[f64], time: f64) -> Result<Moment> {
    if !(times.iter().all(|time| time.is_finite()) && times.is_sorted_by(|a, b| a < b)) {
        return Err(Error::file("has times that do not ascend"));
    }
    let Some(last) = times.len().checked_sub(1) else { return Err(Error::file("has no keys")) };
    Ok(match times.partition_point(|&key| key <= time) {
        0 => Moment::At(0),
        passed if passed > last => Moment::At(last),
        passed => {
            let (start, length) = (times[passed - 1], times[passed] - times[passed - 1]);
            Moment::After { key: passed - 1, length, share: (time - start) / length }
        }
    })
}

fn quaternion(numbers: &[f64]) -> DVec4 {
    DVec4::from_slice(numbers)
}

/// The length of a quaternion.
pub(super) fn length(q: DVec4) -> f64 {
    (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w).sqrt()
}

/// The rotation that is a `share` of the way from one to the other, by the shorter way; both of any length but 0.
///
/// The angle is Kahan's, `2 atan2(|a - b|, |a + b|)`, which is as exact for rotations that are nearly the same as for
/// others; only where they are the same, or one has no direction, are the numbers mixed as they are.
fn slerp(a: DVec4, b: DVec4, share: f64) -> DVec4 {
    let (a_length, b_length) = (length(a), length(b));
    if !(a_length > 0.0 && b_length > 0.0) {
        return a * (1.0 - share) + b * share;
    }
    let (a, b) = (a / a_length, b / b_length);
    let cosine = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
    let b = if cosine < 0.0 { -b } else { b };
    let angle = 2.0 * libm::atan2(length(a - b), length(a + b));
    let sine = libm::sin(angle);
    if !(sine > 0.0) {
        return a * (1.0 - share) + b * share;
    }
    a * (libm::sin((1.0 - share) * angle) / sine) + b * (libm::sin(share * angle) / sine)
}

/// The cubic with these values and slopes at 0 and 1: `[value, slope, value, slope]`.
fn hermite([start, out, end, into]: [f64; 4], x: f64) -> f64 {
    let (x2, x3) = (x * x, x * x * x);
    (2.0 * x3 - 3.0 * x2 + 1.0) * start + (x3 - 2.0 * x2 + x) * out + (3.0 * x2 - 2.0 * x3) * end + (x3 - x2) * into
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn turn(axis: DVec3, degrees: f64) -> DVec4 {
        let (sin, cos) = libm::sincos(0.5 * degrees.to_radians());
        (axis * sin).extend(cos)
    }

    #[test]
    fn rotations_turn_at_a_constant_rate_by_the_shorter_way() {
        let axis = DVec3::new(0.6, -0.48, 0.64);
        for (from, to, share) in [(0.0, 90.0, 0.5), (10.0, 170.0, 0.25), (30.0, 30.0 + 1e-7, 0.75), (-60.0, 80.0, 1.0)]
        {
            let expected = turn(axis, from + (to - from) * share);
            for b in [turn(axis, to), -turn(axis, to), turn(axis, to) * 3.0] {
                let found = slerp(turn(axis, from), b, share);
                assert!((found - expected).abs().max_element() < 1e-15, "{from} {to} {share}: {found} {expected}");
            }
        }
        // From 0 to 270 degrees it is shorter to go back by 90.
        let found = slerp(turn(axis, 0.0), turn(axis, 270.0), 0.5);
        assert!((found - turn(axis, -45.0)).abs().max_element() < 1e-15);
        assert_eq!(slerp(DVec4::W, DVec4::W, 0.3), DVec4::W);
        assert_eq!(slerp(DVec4::ZERO, DVec4::W, 0.5), DVec4::W * 0.5);
    }

    #[test]
    fn splines_have_their_values_and_slopes() {
        // x^3 - x on [0, 1] has the values 0 and 0 and the slopes -1 and 2.
        for x in [0.0, 0.25, 0.5, 0.9, 1.0] {
            assert!((hermite([0.0, -1.0, 0.0, 2.0], x) - (x * x * x - x)).abs() < 1e-15);
        }
    }

    #[test]
    fn times_are_held_at_both_ends_and_must_ascend() {
        let times = [1.0, 2.0, 4.0];
        for (time, moment) in [
            (-3.0, Moment::At(0)),
            (1.0, Moment::After { key: 0, length: 1.0, share: 0.0 }),
            (2.5, Moment::After { key: 1, length: 2.0, share: 0.25 }),
            (4.0, Moment::At(2)),
            (1e9, Moment::At(2)),
        ] {
            assert_eq!(find(&times, time).unwrap(), moment);
        }
        for wrong in [vec![], vec![0.0, 0.0], vec![1.0, 0.5], vec![0.0, f64::NAN]] {
            assert!(find(&wrong, 0.5).is_err(), "{wrong:?}");
        }
    }
}
