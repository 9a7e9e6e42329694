//! How the view moves: cameras turned, shifted and brought nearer.

use glam::DVec3;

use crate::math::transform::{apply, rotation_about};
use crate::math::vector::{cross, dot, length, normalize};
use crate::scene::auto::View;
use crate::scene::{Camera, Projection};

/// Nearer than this to straight up or down, in radians, the view does not tilt: `up` would no longer say where up is.
const POLE: f64 = 0.01;

/// What one looks at and through: a look-at camera's parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looking {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at and turns about.
    pub target: DVec3,
    /// Roughly up.
    pub up: DVec3,
    /// Perspective or orthographic.
    pub projection: Projection,
}

impl Looking {
    /// A camera's. The four-point camera becomes a perspective one of the same height, looking at its rectangle's middle.
    pub fn of(camera: &Camera) -> Self {
        match *camera {
            Camera::LookAt { eye, target, up, projection } => Self { eye, target, up, projection },
            Camera::FourPoint { viewpoint, lower_left, lower_right, upper_left } => {
                let up = upper_left - lower_left;
                let target = lower_left + (lower_right - lower_left) * 0.5 + up * 0.5;
                let fov_y = 2.0 * libm::atan2(0.5 * length(up), length(target - viewpoint));
                Self { eye: viewpoint, target, up, projection: Projection::Perspective { fov_y } }
            }
        }
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        let Self { eye, target, up, projection } = *self;
        Camera::LookAt { eye, target, up, projection }
    }

    /// Unit vectors forward, to the right and up; `None` for a camera that sees nothing.
    fn axes(&self) -> Option<(DVec3, DVec3, DVec3)> {
        let forward = normalize(self.target - self.eye)?;
        let right = normalize(cross(forward, self.up))?;
        Some((forward, right, cross(right, forward)))
    }

    /// The height of what is seen at the target's distance.
    pub fn height(&self) -> f64 {
        match self.projection {
            Projection::Perspective { fov_y } => 2.0 * length(self.target - self.eye) * libm::tan(0.5 * fov_y),
            Projection::Orthographic { height } => height,
        }
    }

    /// Turns about the target by angles in radians: what is seen turns to the right, and the eye rises.
    pub fn orbit(&mut self, right: f64, up: f64) {
        if let Some(backward) = self.turned(self.eye - self.target, right, up) {
            self.eye = self.target + backward;
        }
    }

    /// Turns the head by angles in radians: to the right, and up.
    pub fn look(&mut self, right: f64, up: f64) {
        if let Some(forward) = self.turned(self.target - self.eye, right, up) {
            self.target = self.eye + forward;
        }
    }

    /// A vector turned about up, clockwise as seen from above, and raised, but not past the poles.
    fn turned(&self, vector: DVec3, clockwise: f64, raise: f64) -> Option<DVec3> {
        let limit = std::f64::consts::FRAC_PI_2 - POLE;
        let up = normalize(self.up)?;
        let elevation = libm::asin(dot(normalize(vector)?, up).clamp(-1.0, 1.0));
        let raise = (elevation + raise).clamp(-limit, limit) - elevation;
        let raised = apply(&rotation_about(normalize(cross(vector, up))?, raise), vector);
        Some(apply(&rotation_about(up, -clockwise), raised))
    }

    /// Shifts the view by parts of its height: to the right and up.
    pub fn pan(&mut self, right: f64, up: f64) {
        let Some((_, to_right, upward)) = self.axes() else { return };
        let by = (to_right * right + upward * up) * self.height();
        self.eye += by;
        self.target += by;
    }

    /// Comes nearer to the target by a factor less than 1, or goes away.
    pub fn dolly(&mut self, factor: f64) {
        if !(factor > 0.0 && factor.is_finite()) {
            return;
        }
        if let Projection::Orthographic { height } = &mut self.projection {
            *height *= factor;
        }
        self.eye = self.target + (self.eye - self.target) * factor;
    }

    /// Flies by parts of the distance to the target: forward, to the right, up.
    pub fn fly(&mut self, by: DVec3) {
        let Some((forward, right, up)) = self.axes() else { return };
        let way = (forward * by.z + right * by.x + up * by.y) * length(self.target - self.eye);
        self.eye += way;
        self.target += way;
    }

    /// Looks along an axis, from as far away.
    pub fn look_from(&mut self, view: View) {
        let (azimuth, elevation) = view.angles();
        let (sin_a, cos_a) = libm::sincos(azimuth);
        let (sin_e, cos_e) = libm::sincos(elevation);
        let backward = DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
        let is_vertical = cos_e.abs() < POLE;
        self.up = if is_vertical { DVec3::new(-sin_a, 0.0, -cos_a) * sin_e.signum() } else { DVec3::Y };
        self.eye = self.target + backward * length(self.eye - self.target);
        // Sines of straight angles are not quite 0.
        let round =
            |v: DVec3, size: f64| DVec3::from_array(v.to_array().map(|x| if x.abs() < 1e-12 * size { 0.0 } else { x }));
        self.up = round(self.up, 1.0);
        self.eye = self.target + round(self.eye - self.target, length(self.eye - self.target));
    }

    /// From perspective to orthographic or back; what is at the target keeps its size.
    pub fn toggle_projection(&mut self, fov_y: f64) {
        let height = self.height();
        match self.projection {
            Projection::Perspective { .. } => self.projection = Projection::Orthographic { height },
            Projection::Orthographic { .. } => {
                let distance = 0.5 * height / libm::tan(0.5 * fov_y);
                let backward = normalize(self.eye - self.target).unwrap_or(DVec3::Z);
                self.eye = self.target + backward * distance;
                self.projection = Projection::Perspective { fov_y };
            }
        }
    }

    /// Looks at a box from the same direction, so that all of it is seen in a picture so much wider than high.
    pub fn frame(&mut self, min: DVec3, max: DVec3, aspect: f64) {
        let radius = 0.5 * length(max - min);
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let narrow = aspect.min(1.0);
        let backward = normalize(self.eye - self.target).unwrap_or(DVec3::Z);
        self.target = min + (max - min) * 0.5;
        let distance = match &mut self.projection {
            Projection::Perspective { fov_y } => radius / libm::sin(libm::atan(libm::tan(0.5 * *fov_y) * narrow)),
            Projection::Orthographic { height } => {
                *height = 2.0 * radius / narrow;
                4.0 * radius
            }
        };
        self.eye = self.target + backward * distance;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looking() -> Looking {
        let projection = Projection::Perspective { fov_y: 0.7 };
        Looking { eye: DVec3::new(3.0, 2.0, 6.0), target: DVec3::new(0.0, 1.0, 0.0), up: DVec3::Y, projection }
    }

    #[test]
    fn orbits_keep_the_distance_and_come_back() {
        let start = looking();
        let mut moved = start;
        moved.orbit(0.4, 0.2);
        assert!((length(moved.eye - moved.target) - length(start.eye - start.target)).abs() < 1e-12);
        assert!(moved.eye.y > start.eye.y, "up looks from higher");
        let (_, right, _) = start.axes().unwrap();
        assert!(dot(moved.eye - start.eye, right) < 0.0, "what is seen turns to the right: the eye goes left");
        moved.orbit(-0.4, -0.2);
        assert!(length(moved.eye - start.eye) < 1e-12);
        moved.orbit(0.0, 100.0);
        assert!(moved.axes().is_some() && moved.eye.y > 0.0, "not past the pole");
        moved.orbit(1.0, -200.0);
        assert!(moved.axes().is_some() && moved.eye.y < 0.0);
    }

    #[test]
    fn looking_turns_the_head() {
        let mut moved = looking();
        moved.look(0.3, 0.1);
        assert_eq!(moved.eye, looking().eye);
        let (_, right, up) = looking().axes().unwrap();
        let by = moved.target - looking().target;
        assert!(dot(by, right) > 0.0 && dot(by, up) > 0.0);
    }

    #[test]
    fn panning_shifts_the_view_by_parts_of_the_picture() {
        let mut moved = looking();
        moved.pan(0.5, 0.0);
        assert!((length(moved.eye - looking().eye) - 0.5 * looking().height()).abs() < 1e-12);
        assert!(length((moved.target - moved.eye) - (looking().target - looking().eye)) < 1e-12);
    }

    #[test]
    fn a_framed_box_is_in_the_picture() {
        for aspect in [0.5, 1.0, 16.0 / 9.0] {
            for orthographic in [false, true] {
                let mut view = looking();
                if orthographic {
                    view.toggle_projection(0.7);
                }
                let (min, max) = (DVec3::new(-1.0, 0.0, -3.0), DVec3::new(2.0, 5.0, 1.0));
                view.frame(min, max, aspect);
                let (forward, right, up) = view.axes().unwrap();
                for corner in 0..8 {
                    let pick = |bit: usize, a: f64, b: f64| if corner & bit == 0 { a } else { b };
                    let p = DVec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z)) - view.eye;
                    let half = match view.projection {
                        Projection::Perspective { fov_y } => dot(p, forward) * libm::tan(0.5 * fov_y),
                        Projection::Orthographic { height } => 0.5 * height,
                    };
                    assert!(dot(p, up).abs() <= half && dot(p, right).abs() <= half * aspect);
                }
            }
        }
    }

    #[test]
    fn the_projection_changes_what_is_at_the_target_not() {
        let mut view = looking();
        view.toggle_projection(0.7);
        assert!(matches!(view.projection, Projection::Orthographic { .. }));
        assert!((view.height() - looking().height()).abs() < 1e-12);
        view.toggle_projection(0.7);
        assert!(length(view.eye - looking().eye) < 1e-12);
    }

    #[test]
    fn axis_views_look_along_axes() {
        let mut view = looking();
        for (from, backward) in [(View::Front, DVec3::Z), (View::Right, DVec3::X), (View::Top, DVec3::Y)] {
            view.look_from(from);
            assert!(length(normalize(view.eye - view.target).unwrap() - backward) < 1e-15);
            assert!(view.axes().is_some());
        }
        assert_eq!(view.up, DVec3::NEG_Z);
    }

    #[test]
    fn the_seeds_camera_becomes_one_that_can_be_moved() {
        let four_point = Camera::FourPoint {
            viewpoint: DVec3::new(0.0, 0.0, 5.0),
            lower_left: DVec3::new(-1.6, -1.2, 0.0),
            lower_right: DVec3::new(1.6, -1.2, 0.0),
            upper_left: DVec3::new(-1.6, 1.2, 0.0),
        };
        let view = Looking::of(&four_point);
        assert_eq!((view.eye, view.target), (DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO));
        assert!((view.height() - 2.4).abs() < 1e-12);
    }
}
