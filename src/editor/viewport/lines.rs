//! Lines over the picture: the grid on the ground, the axes, and boxes around what is selected.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use crate::editor::numbers::round_size;
use crate::editor::viewport::tessellate::Extent;

/// One of a line's four vertices, as the shader takes them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct LineVertex {
    /// The end where it is.
    pub position: [f32; 3],
    /// The other end.
    pub other: [f32; 3],
    /// On which side of the line, seen towards the other end: 1 or -1.
    pub side: f32,
    /// Encoded colour and opacity.
    pub color: [f32; 4],
}

/// Lines that are drawn together.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines {
    /// Six vertices a line: two triangles.
    pub vertices: Vec<LineVertex>,
}

/// Half as many lines of the grid each way.
const GRID_LINES: i32 = 20;

impl Lines {
    /// Adds a line between points relative to the lines' origin.
    pub fn add(&mut self, from: Vec3, to: Vec3, color: [f32; 4]) {
        let at = |position: Vec3, other: Vec3, side: f32| LineVertex {
            position: position.to_array(),
            other: other.to_array(),
            side,
            color,
        };
        // Seen from the other end, left and right are exchanged.
        let corners = [at(from, to, 1.0), at(from, to, -1.0), at(to, from, 1.0), at(to, from, -1.0)];
        self.vertices.extend([0, 1, 2, 2, 3, 0].map(|k| corners[k]));
    }

    /// The grid on the plane y = 0 under a scene, and the axes: x red, y green, z blue.
    pub fn add_grid(&mut self, extent: &Extent, origin: DVec3) {
        let size = (extent.max - extent.min).max_element();
        // About ten steps are the scene.
        let step = round_size(size / 10.0);
        let middle = (extent.min + extent.max) * 0.5;
        let snapped = |x: f64| (x / (10.0 * step)).round() * 10.0 * step;
        let (x, z) = (snapped(middle.x), snapped(middle.z));
        let reach = f64::from(GRID_LINES) * step;
        let mut line =
            |from: DVec3, to: DVec3, color| self.add((from - origin).as_vec3(), (to - origin).as_vec3(), color);
        for i in -GRID_LINES..=GRID_LINES {
            let offset = f64::from(i) * step;
            let color = if i % 10 == 0 { [0.55, 0.55, 0.55, 0.7] } else { [0.5, 0.5, 0.5, 0.35] };
            // The axes have colours of their own.
            if x + offset != 0.0 {
                line(DVec3::new(x + offset, 0.0, z - reach), DVec3::new(x + offset, 0.0, z + reach), color);
            }
            if z + offset != 0.0 {
                line(DVec3::new(x - reach, 0.0, z + offset), DVec3::new(x + reach, 0.0, z + offset), color);
            }
        }
        line(DVec3::new(x - reach, 0.0, 0.0), DVec3::new(x + reach, 0.0, 0.0), [0.85, 0.25, 0.25, 0.9]);
        line(DVec3::ZERO, DVec3::new(0.0, 0.5 * reach, 0.0), [0.35, 0.75, 0.3, 0.9]);
        line(DVec3::new(0.0, 0.0, z - reach), DVec3::new(0.0, 0.0, z + reach), [0.3, 0.45, 0.95, 0.9]);
    }

    /// The edges of a box, given by its corners: bit k of a corner's number says which side of axis k it is on.
    pub fn add_box(&mut self, corners: &[DVec3; 8], origin: DVec3, color: [f32; 4]) {
        for (corner, axis) in (0..8).flat_map(|corner| (0..3).map(move |axis| (corner, axis))) {
            let other = corner | 1 << axis;
            if other != corner {
                self.add((corners[corner] - origin).as_vec3(), (corners[other] - origin).as_vec3(), color);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_twelve_edges() {
        let mut lines = Lines::default();
        lines.add_box(&[DVec3::ZERO; 8], DVec3::ZERO, [1.0; 4]);
        assert_eq!(lines.vertices.len(), 12 * 6);
    }
}
