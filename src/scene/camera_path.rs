//! How a camera moves from frame to frame.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::math::vector::{cross, dot, normalize};
use crate::scene::camera::{Camera, Projection};

/// The way of a look-at camera.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum CameraPath {
    /// Around the target and the upward axis, counter-clockwise seen from above: once in so many frames, from where the camera
    /// stands in frame 0.
    Turntable {
        /// How many frames a turn has.
        frames: u32,
    },
    /// Smoothly through keys, of which there is at least one, ascending by frame. Before the first and after the last it rests.
    Keys(Vec<CameraKey>),
}

/// Where a camera is in one frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraKey {
    /// The frame.
    pub frame: i32,
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at.
    pub target: DVec3,
    /// Its vertical field of view in radians, or its height where it is orthographic.
    pub lens: f64,
}

impl CameraPath {
    /// The camera in a frame. One through four points stays where it is.
    pub fn camera(&self, camera: &Camera, frame: i32) -> Camera {
        let Camera::LookAt { eye, target, up, projection } = *camera else { return *camera };
        match self {
            Self::Turntable { frames } => {
                let turned = turn(eye - target, up, TAU * f64::from(frame) / f64::from((*frames).max(1)));
                Camera::LookAt { eye: target + turned, target, up, projection }
            }
            Self::Keys(keys) => {
                let at = |value: fn(&CameraKey) -> DVec3| interpolated(keys, frame, value);
                let lens = at(|key| DVec3::splat(key.lens)).x;
                let projection = match projection {
                    Projection::Perspective { .. } => Projection::Perspective { fov_y: lens },
                    Projection::Orthographic { .. } => Projection::Orthographic { height: lens },
                };
                Camera::LookAt { eye: at(|key| key.eye), target: at(|key| key.target), up, projection }
            }
        }
    }
}

/// A vector turned about an axis by an angle in radians (Rodrigues 1840).
fn turn(vector: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let Some(axis) = normalize(axis) else { return vector };
    let (sin, cos) = libm::sincos(angle);
    vector * cos + cross(axis, vector) * sin + axis * (dot(axis, vector) * (1.0 - cos))
}

/// A value between keys: a cubic through them, whose slope at each is that between its neighbours (Catmull and Rom 1974, for
/// keys that are not evenly apart).
fn interpolated(keys: &[CameraKey], frame: i32, value: fn(&CameraKey) -> DVec3) -> DVec3 {
    let next = keys.partition_point(|key| key.frame <= frame);
    let (Some(from), Some(to)) = (next.checked_sub(1).and_then(|at| keys.get(at)), keys.get(next)) else {
        return keys.get(next).or(keys.last()).map_or(DVec3::ZERO, value);
    };
    let time = |key: &CameraKey| f64::from(key.frame);
    let slope = |at: usize| {
        let (before, after) = (&keys[at.saturating_sub(1)], &keys[(at + 1).min(keys.len() - 1)]);
        (value(after) - value(before)) / (time(after) - time(before))
    };
    let span = time(to) - time(from);
    let s = (f64::from(frame) - time(from)) / span;
    let (square, cube) = (s * s, s * s * s);
    value(from) * (2.0 * cube - 3.0 * square + 1.0)
        + slope(next - 1) * (span * (cube - 2.0 * square + s))
        + value(to) * (3.0 * square - 2.0 * cube)
        + slope(next) * (span * (cube - square))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera::LookAt {
        eye: DVec3::new(0.0, 2.0, 5.0),
        target: DVec3::new(0.0, 1.0, 0.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y: 0.7 },
    };

    fn eye(path: &CameraPath, frame: i32) -> DVec3 {
        match path.camera(&CAMERA, frame) {
            Camera::LookAt { eye, .. } => eye,
            Camera::FourPoint { viewpoint, .. } => viewpoint,
        }
    }

    #[test]
    fn a_turntable_turns_once_around_the_target() {
        let path = CameraPath::Turntable { frames: 8 };
        assert_eq!(path.camera(&CAMERA, 0), CAMERA);
        for (frame, expected) in
            [(2, [5.0, 2.0, 0.0]), (4, [0.0, 2.0, -5.0]), (-2, [-5.0, 2.0, 0.0]), (8, [0.0, 2.0, 5.0])]
        {
            assert!((eye(&path, frame) - DVec3::from_array(expected)).abs().max_element() < 1e-14, "{frame}");
        }
    }

    #[test]
    fn keys_are_met_and_straight_ways_are_even() {
        let key = |frame: i32, x: f64| CameraKey {
            frame,
            eye: DVec3::new(x, x * 2.0, 1.0),
            target: DVec3::ZERO,
            lens: 0.5 + 0.1 * x,
        };
        let even = CameraPath::Keys(vec![key(-4, 0.0), key(0, 4.0), key(10, 14.0), key(12, 16.0)]);
        for frame in -4..=12 {
            let x = f64::from(frame) + 4.0;
            assert!((eye(&even, frame) - DVec3::new(x, 2.0 * x, 1.0)).abs().max_element() < 1e-13, "{frame}");
        }
        assert_eq!([eye(&even, -9), eye(&even, 99)], [eye(&even, -4), eye(&even, 12)]);
        let curved = CameraPath::Keys(vec![key(0, 0.0), key(10, 7.0), key(20, 3.0)]);
        assert_eq!(eye(&curved, 10).x, 7.0);
        // No jump of speed at a key: the steps before and after it are alike.
        let step = |frame: i32| eye(&curved, frame + 1).x - eye(&curved, frame).x;
        assert!((step(9) - step(10)).abs() < 0.35 && step(5) > 0.5 && step(15) < -0.3, "{} {}", step(9), step(10));
        assert_eq!(eye(&CameraPath::Keys(vec![key(5, 1.0)]), 3).x, 1.0);
        match curved.camera(&CAMERA, 10) {
            Camera::LookAt { projection: Projection::Perspective { fov_y }, .. } => {
                assert_eq!(fov_y, key(10, 7.0).lens)
            }
            _ => panic!("another camera"),
        }
    }
}
