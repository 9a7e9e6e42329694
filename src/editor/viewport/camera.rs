//! Where points of a scene are in a picture, and which points a pixel may show: the inverse of the camera's rays.

use glam::{DVec2, DVec3, DVec4, Mat4};

use crate::error::{Error, Result};
use crate::math::vector::{cross, dot, length, normalize};
use crate::scene::{Camera, Projection};

/// The nearest that is seen, as a share of the farthest: a depth buffer of 24 bits then tells apart what differs by a
/// 300th of its distance where it is farthest, and by ever less towards the eye.
const NEAREST_SHARE: f64 = 2e-5;

/// The same as a share of the distance to what the camera looks at, where that is more: there the buffer then tells apart what
/// differs by an 80000th of its distance.
const NEAREST_TO_FOCUS: f64 = 5e-3;

/// A camera and the size of its picture in pixels, in the file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The eye, or where the ray of the picture's upper left corner starts if all are parallel.
    base: DVec3,
    is_parallel: bool,
    /// Of a point relative to `base`: `x s`, `y s` and `s`, where s is 1 on the picture's rectangle; the rays are
    /// `s (corner + x step_x + y step_y)`. Of parallel rays x, y and s.
    rows: [DVec3; 3],
    /// The columns of the inverse: a pixel's step to the right, down, and the way to the upper left corner.
    columns: [DVec3; 3],
    /// The unit vector into the picture, across it.
    forward: DVec3,
    /// Depth, along `forward`, for each s.
    depth_scale: f64,
    width: f64,
    height: f64,
    /// The depths between which there is something.
    depths: (f64, f64),
    /// How far away is what the camera looks at.
    focus: f64,
}

/// A point in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projected {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the upper edge.
    pub y: f64,
    /// How far before the eye, across the picture, in the scene's units.
    pub depth: f64,
}

impl View {
    /// The camera's view of a picture of this size; it sees what is between the depths 0 and 1 until it is told
    /// [what there is](Self::around).
    ///
    /// # Errors
    /// As [`Camera::rays`], and a caller's error for a picture without pixels or a four-point camera whose viewpoint lies
    /// in its picture.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::caller("the picture needs at least one pixel"));
        }
        let rays = camera.rays(width, height, DVec3::ZERO)?;
        let (width, height) = (f64::from(width), f64::from(height));
        let ([origin, origin_x, origin_y], [corner, corner_x, corner_y]) = {
            let lines = [rays.line(0.0, 0.0), rays.line(width, 0.0), rays.line(0.0, height)];
            (lines.map(|line| line.0), lines.map(|line| line.1))
        };
        let is_parallel = matches!(camera, Camera::LookAt { projection: Projection::Orthographic { .. }, .. });
        let (step_x, step_y) = if is_parallel {
            ((origin_x - origin) / width, (origin_y - origin) / height)
        } else {
            ((corner_x - corner) / width, (corner_y - corner) / height)
        };
        let across = cross(step_x, step_y);
        let determinant = dot(across, corner);
        let inverse = [cross(step_y, corner), cross(corner, step_x), across].map(|row| row / determinant);
        let forward = normalize(across).map(|normal| if dot(normal, corner) < 0.0 { -normal } else { normal });
        match forward {
            Some(forward) if inverse.iter().all(|row| row.is_finite()) => Ok(Self {
                base: origin,
                is_parallel,
                rows: inverse,
                columns: [step_x, step_y, corner],
                forward,
                depth_scale: dot(forward, corner),
                width,
                height,
                depths: (NEAREST_SHARE, 1.0),
                focus: match *camera {
                    Camera::LookAt { eye, target, .. } => length(target - eye),
                    Camera::FourPoint { viewpoint, lower_left, .. } => length(lower_left - viewpoint),
                },
            }),
            _ => Err(Error::caller("the camera's viewpoint lies in the plane of its picture")),
        }
    }

    /// The same view of what lies between points, such as the corners of a scene's box.
    pub fn around(mut self, points: impl IntoIterator<Item = DVec3>) -> Self {
        let (mut near, mut far) = (f64::INFINITY, 0.0f64);
        for depth in points.into_iter().map(|point| self.depth(point)) {
            (near, far) = (near.min(depth), far.max(depth));
        }
        if !(far > 0.0 && far < f64::INFINITY) {
            (near, far) = (0.0, 1.0);
        }
        // A little more on both sides, so that what lies in a side of the box is seen.
        let margin = 1e-3;
        let nearest = (far * NEAREST_SHARE).max(far.min(self.focus) * NEAREST_TO_FOCUS);
        let least = if self.is_parallel { 0.0 } else { nearest };
        self.depths = ((near - far * margin).max(least), far * (1.0 + margin));
        self
    }

    /// Size of the picture in pixels.
    pub fn size(&self) -> (f64, f64) {
        (self.width, self.height)
    }

    /// The unit vector into the picture, across it.
    pub fn forward(&self) -> DVec3 {
        self.forward
    }

    /// The depths between which something is seen.
    pub fn depths(&self) -> (f64, f64) {
        self.depths
    }

    /// Where all rays start, or the direction that they share.
    pub fn eye(&self) -> Eye {
        if self.is_parallel { Eye::Parallel(self.columns[2]) } else { Eye::At(self.base) }
    }

    /// How far a point is before the eye, across the picture.
    pub fn depth(&self, point: DVec3) -> f64 {
        dot(self.rows[2], point - self.base) * self.depth_scale
    }

    /// Where a point is in the picture or beside it; `None` behind the eye.
    pub fn project(&self, point: DVec3) -> Option<Projected> {
        let [x, y, s] = self.rows.map(|row| dot(row, point - self.base));
        let depth = s * self.depth_scale;
        if self.is_parallel {
            return depth.is_finite().then_some(Projected { x, y, depth });
        }
        let (x, y) = (x / s, y / s);
        (s > 0.0 && x.is_finite() && y.is_finite()).then_some(Projected { x, y, depth })
    }

    /// The point that is at a place of the picture at some depth.
    pub fn unproject(&self, at: Projected) -> DVec3 {
        let s = at.depth / self.depth_scale;
        let [step_x, step_y, corner] = self.columns;
        if self.is_parallel {
            return self.base + step_x * at.x + step_y * at.y + corner * s;
        }
        self.base + (step_x * at.x + step_y * at.y + corner) * s
    }

    /// Start and direction, of any length, of the ray through a point of the picture.
    pub fn ray(&self, point: DVec2) -> (DVec3, DVec3) {
        let [step_x, step_y, corner] = self.columns;
        let offset = step_x * point.x + step_y * point.y;
        if self.is_parallel { (self.base + offset, corner) } else { (self.base, offset + corner) }
    }

    /// The length at a point, across the view, that a pixel shows.
    pub fn pixel_at(&self, point: DVec3) -> f64 {
        let side = dot(self.columns[1], self.columns[1]).sqrt();
        if self.is_parallel { side } else { side * (self.depth(point) / self.depth_scale).max(0.0) }
    }

    /// The rows of the matrix from points of the file, relative to `origin`, to OpenGL's clip space, y up.
    pub fn rows(&self, origin: DVec3) -> [DVec4; 4] {
        let offset = origin - self.base;
        let [x, y, s] = self.rows.map(|row| row.extend(dot(row, offset)));
        let one = if self.is_parallel { DVec4::W } else { s };
        let (near, far) = (self.depths.0 / self.depth_scale, self.depths.1 / self.depth_scale);
        let z = if self.is_parallel {
            (s * 2.0 - DVec4::W * (far + near)) / (far - near)
        } else {
            (s * (far + near) - DVec4::W * (2.0 * far * near)) / (far - near)
        };
        [x * (2.0 / self.width) - one, one - y * (2.0 / self.height), z, one]
    }

    /// The same as a matrix for OpenGL.
    pub fn matrix(&self, origin: DVec3) -> Mat4 {
        let [x, y, z, w] = self.rows(origin).map(|row| row.as_vec4());
        Mat4::from_cols(x, y, z, w).transpose()
    }
}

/// Where rays come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Eye {
    /// All start at a point.
    At(DVec3),
    /// All have one direction.
    Parallel(DVec3),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::{hash2, unit};

    fn cameras() -> [Camera; 5] {
        let eye = DVec3::new(1.0, 2.0, 8.0);
        let look = |projection, up| Camera::LookAt { eye, target: DVec3::new(0.5, 1.0, -3.0), up, projection };
        let four_point = |far: f64| Camera::FourPoint {
            viewpoint: eye + far,
            lower_left: DVec3::new(0.0, 1.0, 4.0) + far,
            lower_right: DVec3::new(2.0, 0.5, 4.5) + far,
            upper_left: DVec3::new(0.1, 3.0, 3.0) + far,
        };
        [
            look(Projection::Perspective { fov_y: 0.9 }, DVec3::Y),
            look(Projection::Perspective { fov_y: 0.01 }, DVec3::X),
            look(Projection::Orthographic { height: 3.0 }, DVec3::Y),
            four_point(0.0),
            four_point(5e6),
        ]
    }

    /// Random pixels of each camera and points on their rays.
    fn each(mut check: impl FnMut(&View, DVec2, DVec3)) {
        let (width, height) = (641, 400);
        for camera in cameras() {
            let rays = camera.rays(width, height, DVec3::ZERO).unwrap();
            let view = View::new(&camera, width, height).unwrap();
            for seed in 0..500 {
                let random = |k: u32| unit(hash2(seed, k));
                let at = DVec2::new(random(0) * f64::from(width), random(1) * f64::from(height));
                let ray = rays.ray(at).unwrap();
                check(&view, at, ray.origin + ray.direction * (0.1 + 20.0 * random(2)));
            }
        }
    }

    #[test]
    fn points_of_a_ray_are_seen_at_its_pixel() {
        each(|view, at, point| {
            let found = view.project(point).unwrap();
            // Far from the origin a pixel's step has fewer digits.
            let most = 1e-4;
            assert!((found.x - at.x).abs() < most && (found.y - at.y).abs() < most, "{view:?}: {at} {found:?}");
            assert!(found.depth > 0.0);
            let back = view.unproject(found);
            assert!((back - point).abs().max_element() < 1e-7, "{back} {point}");
            let (start, direction) = view.ray(at);
            let off = cross(point - start, normalize(direction).unwrap());
            assert!(off.abs().max_element() < 1e-6, "{off}");
        });
    }

    #[test]
    fn the_matrix_gives_the_same_pixels_and_depths_in_order() {
        each(|view, at, point| {
            let origin = point + DVec3::new(0.3, -0.2, 0.1);
            let view = view.around([point + view.forward() * 10.0, point - view.forward() * 0.05]);
            let clip = view.matrix(origin) * (point - origin).as_vec3().extend(1.0);
            let (width, height) = view.size();
            let x = f64::from(clip.x / clip.w * 0.5 + 0.5) * width;
            let y = f64::from(0.5 - clip.y / clip.w * 0.5) * height;
            assert!((x - at.x).abs() < 2e-2 && (y - at.y).abs() < 2e-2, "{view:?}: {at}, {x} {y}");
            assert!(clip.w > 0.0 && (-1.0..1.0).contains(&(clip.z / clip.w)), "{clip}");
            let farther = view.unproject(Projected { depth: view.depth(point) * 1.01, ..view.project(point).unwrap() });
            let next = view.matrix(origin) * (farther - origin).as_vec3().extend(1.0);
            assert!(next.z / next.w > clip.z / clip.w, "{clip} {next}");
        });
    }

    #[test]
    fn what_is_behind_the_eye_has_no_place() {
        for camera in cameras() {
            let view = View::new(&camera, 64, 64).unwrap();
            if let Eye::At(eye) = view.eye() {
                assert_eq!(view.project(eye - view.forward()), None);
                assert_eq!(view.project(eye), None);
                assert_eq!(view.project(DVec3::splat(f64::NAN)), None);
            }
        }
    }

    #[test]
    fn pixels_are_as_large_as_they_are() {
        let view = View::new(&cameras()[0], 300, 200).unwrap();
        let at = Projected { x: 150.0, y: 100.0, depth: 7.0 };
        let (point, next) = (view.unproject(at), view.unproject(Projected { y: 101.0, ..at }));
        let apart = dot(next - point, next - point).sqrt();
        assert!((view.pixel_at(point) / apart - 1.0).abs() < 1e-9);
    }

    #[test]
    fn flawed_cameras_are_errors() {
        let corners = (DVec3::ZERO, DVec3::X, DVec3::Y);
        let within = Camera::FourPoint {
            viewpoint: DVec3::new(0.5, 0.5, 0.0),
            lower_left: corners.0,
            lower_right: corners.1,
            upper_left: corners.2,
        };
        assert!(View::new(&within, 8, 8).is_err());
        assert!(View::new(&cameras()[0], 0, 8).is_err());
    }
}
