//! Handles in the view by which what is selected is moved, turned and scaled.

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::editor::viewport::camera::{Projected, View};
use crate::math::transform::{apply, rotation_about};
use crate::math::vector::{basis, dot, normalize};

/// What dragging does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tool {
    /// Selects.
    #[default]
    Select,
    /// Moves.
    Move,
    /// Turns.
    Rotate,
    /// Scales.
    Scale,
}

/// What is taken hold of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Handle {
    /// One of the scene's axes, 0 to 2.
    Axis(usize),
    /// The middle: across the view, or all axes alike.
    Middle,
}

/// The handles of a tool at a point of the scene.
#[derive(Debug, Clone, Copy)]
pub struct Gizmo {
    /// What it does.
    pub tool: Tool,
    /// What it turns and scales about.
    pub pivot: DVec3,
    /// How the scene is seen.
    pub view: View,
    /// Pixels to a point of the window: handles look as large on any screen.
    pub pixels_per_point: f64,
}

/// Length of the handles, in points of the window.
const LENGTH: f64 = 80.0;
/// Within so many points of a handle it is taken hold of.
const REACH: f64 = 7.0;
/// Half the side of the middle's square, in points.
const MIDDLE: f64 = 7.0;

const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

impl Gizmo {
    /// All handles, those first that are taken hold of first.
    pub fn handles(&self) -> Vec<Handle> {
        let axes = [Handle::Axis(0), Handle::Axis(1), Handle::Axis(2)];
        match self.tool {
            Tool::Select => Vec::new(),
            Tool::Rotate => axes.to_vec(),
            Tool::Move | Tool::Scale => [&[Handle::Middle][..], &axes].concat(),
        }
    }

    /// A handle as a line of points in pixels; nothing if it is behind the eye.
    pub fn line(&self, handle: Handle) -> Vec<DVec2> {
        let Some(middle) = self.view.project(self.pivot) else { return Vec::new() };
        let at = |p: Projected| DVec2::new(p.x, p.y);
        let length = LENGTH * self.pixels_per_point * self.view.pixel_at(self.pivot);
        match (handle, self.tool) {
            (Handle::Axis(axis), Tool::Rotate) => {
                let (a, b) = basis(AXES[axis]);
                let on_ring = |step: u32| {
                    let (sin, cos) = libm::sincos(f64::from(step) * std::f64::consts::TAU / 64.0);
                    self.view.project(self.pivot + (a * cos + b * sin) * length).map(at)
                };
                (0..=64).filter_map(on_ring).collect()
            }
            (Handle::Axis(axis), _) => {
                let end = self.view.project(self.pivot + AXES[axis] * length);
                end.map_or_else(Vec::new, |end| vec![at(middle), at(end)])
            }
            (Handle::Middle, _) => {
                let (half, middle) = (MIDDLE * self.pixels_per_point, at(middle));
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
                corners.iter().map(|&(x, y)| middle + DVec2::new(x, y) * half).collect()
            }
        }
    }

    /// The handle at a place of the picture, in pixels.
    pub fn pick(&self, place: DVec2) -> Option<Handle> {
        let reach = REACH * self.pixels_per_point;
        let distance = |handle: Handle| {
            let line = self.line(handle);
            line.windows(2).map(|ends| distance_to_segment(place, ends[0], ends[1])).fold(f64::INFINITY, f64::min)
        };
        let handles = self.handles();
        if handles.first() == Some(&Handle::Middle)
            && let [a, _, b, ..] = self.line(Handle::Middle).as_slice()
            && place.cmpge(*a).all()
            && place.cmple(*b).all()
        {
            return Some(Handle::Middle);
        }
        let near = handles.into_iter().map(|handle| (handle, distance(handle))).filter(|(_, far)| *far <= reach);
        near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(handle, _)| handle)
    }

    /// What dragging a handle from one place of the picture to another, in pixels, does to the scene; in whole steps if `snap` says so.
    pub fn drag(&self, handle: Handle, from: DVec2, to: DVec2, snap: bool) -> DAffine3 {
        match (self.tool, handle) {
            (Tool::Select, _) => DAffine3::IDENTITY,
            (Tool::Move, Handle::Axis(axis)) => {
                let by = self.along(axis, to) - self.along(axis, from);
                DAffine3::from_translation(AXES[axis] * self.rounded(by, snap))
            }
            (Tool::Move, Handle::Middle) => {
                let depth = self.view.depth(self.pivot);
                let at = |p: DVec2| self.view.unproject(Projected { x: p.x, y: p.y, depth });
                let by = at(to) - at(from);
                DAffine3::from_translation(DVec3::from_array(by.to_array().map(|part| self.rounded(part, snap))))
            }
            (Tool::Rotate, handle) => {
                let Handle::Axis(axis) = handle else { return DAffine3::IDENTITY };
                self.about_pivot(rotation_about(AXES[axis], self.angle(axis, from, to, snap).to_radians()))
            }
            (Tool::Scale, Handle::Axis(axis)) => {
                let before = self.along(axis, from);
                let factor = if before == 0.0 { 1.0 } else { self.along(axis, to) / before };
                let mut factors = DVec3::ONE;
                factors[axis] = rounded_factor(factor, snap);
                self.about_pivot(DMat3::from_diagonal(factors))
            }
            (Tool::Scale, Handle::Middle) => {
                let right = (to.x - from.x - to.y + from.y) / (LENGTH * self.pixels_per_point);
                self.about_pivot(DMat3::from_diagonal(DVec3::splat(rounded_factor(libm::exp(right), snap))))
            }
        }
    }

    fn about_pivot(&self, matrix3: DMat3) -> DAffine3 {
        DAffine3 { matrix3, translation: self.pivot - apply(&matrix3, self.pivot) }
    }

    /// How far along an axis from the pivot a place of the picture is: where the axis comes nearest to its ray.
    fn along(&self, axis: usize, place: DVec2) -> f64 {
        let (origin, direction) = self.view.ray(place);
        let (axis, Some(direction)) = (AXES[axis], normalize(direction)) else { return 0.0 };
        let offset = self.pivot - origin;
        let cosine = dot(axis, direction);
        let denominator = 1.0 - cosine * cosine;
        // Along the view an axis is a point: it cannot be said how far.
        if denominator < 1e-4 {
            return 0.0;
        }
        (cosine * dot(offset, direction) - dot(offset, axis)) / denominator
    }

    /// The angle in degrees by which a drag turns about an axis.
    fn angle(&self, axis: usize, from: DVec2, to: DVec2, snap: bool) -> f64 {
        let Some(middle) = self.view.project(self.pivot) else { return 0.0 };
        let around = |p: DVec2| libm::atan2(middle.y - p.y, p.x - middle.x);
        let (_, direction) = self.view.ray(DVec2::new(middle.x, middle.y));
        // Seen from the front, counter-clockwise is positive.
        let sign = if dot(direction, AXES[axis]) > 0.0 { -1.0 } else { 1.0 };
        let turned = (around(to) - around(from)).to_degrees() * sign;
        let turned = turned - 360.0 * (turned / 360.0).round();
        let step = if snap { 15.0 } else { 0.5 };
        (turned / step).round() * step
    }

    /// A length as a number of few digits: finer than a pixel shows, or coarse.
    fn rounded(&self, length: f64, snap: bool) -> f64 {
        let pixel = self.view.pixel_at(self.pivot) * if snap { 20.0 } else { 0.2 };
        let digits = libm::floor(libm::log10(pixel.max(f64::MIN_POSITIVE))).clamp(-300.0, 300.0) as i32;
        // Divided by a power of ten that is exact, a number has as many digits as it should.
        if digits >= 0 {
            let step = libm::pow(10.0, f64::from(digits));
            (length / step).round() * step
        } else {
            let parts = libm::pow(10.0, f64::from(-digits));
            (length * parts).round() / parts
        }
    }
}

/// A factor in hundredths or tenths, never 0.
fn rounded_factor(factor: f64, snap: bool) -> f64 {
    let parts = if snap { 10.0 } else { 100.0 };
    let rounded = (factor.clamp(-1e3, 1e3) * parts).round() / parts;
    if rounded == 0.0 { 1.0 / parts } else { rounded }
}

fn distance_to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let (along, offset) = (b - a, p - a);
    let squared = along.x * along.x + along.y * along.y;
    let share = (offset.x * along.x + offset.y * along.y) / squared;
    let near = if share.is_finite() { a + along * share.clamp(0.0, 1.0) } else { a };
    let off = p - near;
    (off.x * off.x + off.y * off.y).sqrt()
}

/// The unit vector of an axis.
pub fn axis(number: usize) -> DVec3 {
    AXES[number]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::transform::point;
    use crate::math::vector::length;
    use crate::scene::{Camera, Projection};

    fn gizmo(tool: Tool, is_parallel: bool) -> Gizmo {
        let projection = match is_parallel {
            true => Projection::Orthographic { height: 6.0 },
            false => Projection::Perspective { fov_y: 0.6 },
        };
        let camera = Camera::LookAt { eye: DVec3::new(4.0, 3.0, 8.0), target: DVec3::ZERO, up: DVec3::Y, projection };
        let view = View::new(&camera, 800, 600).unwrap();
        Gizmo { tool, pivot: DVec3::new(0.5, 0.25, -0.5), view, pixels_per_point: 1.0 }
    }

    fn at(gizmo: &Gizmo, p: DVec3) -> DVec2 {
        let p = gizmo.view.project(p).unwrap();
        DVec2::new(p.x, p.y)
    }

    #[test]
    fn a_dragged_axis_follows_the_pointer() {
        for is_parallel in [false, true] {
            let gizmo = gizmo(Tool::Move, is_parallel);
            for number in 0..3 {
                let from = gizmo.line(Handle::Axis(number))[1];
                assert_eq!(gizmo.pick(from), Some(Handle::Axis(number)));
                let wanted = axis(number) * 0.7;
                let start = gizmo.pivot + axis(number) * gizmo.along(number, from);
                let by = gizmo.drag(Handle::Axis(number), from, at(&gizmo, start + wanted), false);
                assert!(length(by.translation - wanted) < 1e-9, "{by:?}");
                assert_eq!(by.matrix3, DMat3::IDENTITY);
            }
        }
    }

    #[test]
    fn the_middle_moves_across_the_view() {
        let gizmo = gizmo(Tool::Move, false);
        let from = at(&gizmo, gizmo.pivot);
        assert_eq!(gizmo.pick(from), Some(Handle::Middle));
        let to = from + DVec2::new(100.0, -50.0);
        let by = gizmo.drag(Handle::Middle, from, to, false).translation;
        let off = at(&gizmo, gizmo.pivot + by) - to;
        assert!(off.abs().max_element() < 0.5, "within the rounding: {off}");
        assert!(dot(by, gizmo.view.forward()).abs() < 1e-2);
    }

    #[test]
    fn rings_turn_the_way_the_pointer_goes() {
        let gizmo = gizmo(Tool::Rotate, false);
        for number in 0..3 {
            let ring = gizmo.line(Handle::Axis(number));
            let by = gizmo.drag(Handle::Axis(number), ring[0], ring[4], false);
            let (a, b) = basis(axis(number));
            // What was at the first point of the ring is now on the way to the fifth.
            let turned = apply(&by.matrix3, a);
            assert!(dot(turned, b) > 0.1, "{number}: {turned}");
            assert!(length(point(&by, gizmo.pivot) - gizmo.pivot) < 1e-12);
            let snapped = gizmo.drag(Handle::Axis(number), ring[0], ring[20], true);
            let degrees = libm::acos(dot(apply(&snapped.matrix3, a), a)).to_degrees();
            assert!((degrees / 15.0 - (degrees / 15.0).round()).abs() < 1e-9);
        }
    }

    #[test]
    fn scaling_is_about_the_pivot_and_never_to_nothing() {
        let gizmo = gizmo(Tool::Scale, false);
        let from = gizmo.line(Handle::Axis(0))[1];
        let middle = at(&gizmo, gizmo.pivot);
        let double =
            gizmo.drag(Handle::Axis(0), from, at(&gizmo, gizmo.pivot + DVec3::X * 2.0 * gizmo.along(0, from)), false);
        assert!((double.matrix3.x_axis.x - 2.0).abs() < 1e-9 && double.matrix3.y_axis == DVec3::Y);
        assert!(length(point(&double, gizmo.pivot) - gizmo.pivot) < 1e-12);
        let nothing = gizmo.drag(Handle::Axis(0), from, middle, false);
        assert!(nothing.matrix3.x_axis.x > 0.0);
        let all = gizmo.drag(Handle::Middle, middle, middle + DVec2::new(80.0, 0.0), true);
        assert_eq!(all.matrix3, DMat3::from_diagonal(DVec3::splat(2.7)));
    }

    #[test]
    fn what_is_not_touched_is_not_taken() {
        let gizmo = gizmo(Tool::Move, false);
        assert_eq!(gizmo.pick(DVec2::new(5.0, 5.0)), None);
        assert_eq!(Gizmo { tool: Tool::Select, ..gizmo }.pick(at(&gizmo, gizmo.pivot)), None);
    }
}
