//! Cameras: where camera rays start and where they go.

use glam::{DVec2, DVec3};

use crate::error::{Error, Result};
use crate::math::lanes::{Flags, LANES, Vectors};
use crate::math::simd::{Level, Task};
use crate::math::vector::{cross, dot, is_safe, normalize};
use crate::scene::camera_path::CameraPath;

/// A camera with its name in the file.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NamedCamera {
    /// What `--camera` selects.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// How it moves, where frames are rendered.
    pub path: Option<CameraPath>,
}

impl NamedCamera {
    /// One that does not move.
    pub fn new(name: impl Into<String>, camera: Camera) -> Self {
        Self { name: name.into(), camera, path: None }
    }

    /// The camera in a frame.
    pub fn in_frame(&self, frame: i32) -> Camera {
        self.path.as_ref().map_or(self.camera, |path| path.camera(&self.camera, frame))
    }
}

/// A camera in the file's coordinates, f64.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Camera {
    /// Stands somewhere and looks at a point.
    LookAt {
        /// Where it stands.
        eye: DVec3,
        /// What it looks at.
        target: DVec3,
        /// Roughly up; must not point along the view.
        up: DVec3,
        /// Perspective or parallel.
        projection: Projection,
    },
    /// The seed's camera: rays from the viewpoint through a rectangle whose corner **pixels** lie at the corners, so
    /// that pixel (i, j), j counted from below, is seen through `LL + i (LR - LL) / (W - 1) + j (UL - LL) / (H - 1)`.
    FourPoint {
        /// Where all rays start.
        viewpoint: DVec3,
        /// Lower left corner.
        lower_left: DVec3,
        /// Lower right corner.
        lower_right: DVec3,
        /// Upper left corner.
        upper_left: DVec3,
    },
}

/// How a look-at camera projects.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Projection {
    /// All rays start at the eye.
    Perspective {
        /// Vertical field of view, radians, between 0 and pi.
        fov_y: f64,
    },
    /// All rays are parallel and start on the plane through the eye.
    Orthographic {
        /// Height of what is seen, in the scene's units.
        height: f64,
    },
}

/// A camera made ready for a picture of a certain size, relative to the scene's origin.
#[derive(Debug, Clone, Copy)]
pub struct CameraRays {
    kind: RayKind,
    width: f64,
    height: f64,
}

#[derive(Debug, Clone, Copy)]
enum RayKind {
    /// `direction = forward + x right + y up`, x and y in [-1, 1] from edge to edge.
    Perspective { eye: DVec3, forward: DVec3, right: DVec3, up: DVec3 },
    /// `origin = eye + x right + y up`.
    Parallel { eye: DVec3, forward: DVec3, right: DVec3, up: DVec3 },
    /// `direction = corner + i step_i + j step_j - viewpoint`.
    FourPoint { viewpoint: DVec3, corner: DVec3, step_i: DVec3, step_j: DVec3 },
}

/// A ray in f64 as shading sees it: the unit direction is that of the true ray, not of its f32 rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewRay {
    /// Where it starts, relative to the scene's origin.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Camera {
    /// Checks the camera and prepares it for pictures of this size.
    ///
    /// # Errors
    /// A caller's error if the view direction, the up vector or the picture rectangle is degenerate.
    pub fn rays(&self, width: u32, height: u32, origin: DVec3) -> Result<CameraRays> {
        let (w, h) = (f64::from(width), f64::from(height));
        let kind = match *self {
            Self::LookAt { eye, target, up, projection } => {
                let forward = normalize(target - eye)
                    .ok_or_else(|| Error::caller("the camera's eye and target are the same point, or not finite"))?;
                let right = normalize(up)
                    .and_then(|up| {
                        let right = cross(forward, up);
                        // Below 1e-9 radians between view and up the sideways direction is rounding noise.
                        (crate::math::vector::length(right) > 1e-9).then(|| normalize(right)).flatten()
                    })
                    .ok_or_else(|| Error::caller("the camera's up vector points along its view, or is zero"))?;
                let up = cross(right, forward);
                let eye = eye - origin;
                match projection {
                    Projection::Perspective { fov_y } => {
                        if !(fov_y > 0.0 && fov_y < std::f64::consts::PI) {
                            return Err(Error::caller("the camera's field of view must lie between 0 and 180 degrees"));
                        }
                        let half = libm::tan(0.5 * fov_y);
                        RayKind::Perspective { eye, forward, right: right * (half * (w / h)), up: up * half }
                    }
                    Projection::Orthographic { height: size } => {
                        if !(size > 0.0 && size < f64::INFINITY) {
                            return Err(Error::caller("the orthographic camera's height must be greater than 0"));
                        }
                        let half = 0.5 * size;
                        RayKind::Parallel { eye, forward, right: right * (half * (w / h)), up: up * half }
                    }
                }
            }
            Self::FourPoint { viewpoint, lower_left, lower_right, upper_left } => {
                let finite = [viewpoint, lower_left, lower_right, upper_left].iter().all(|p| p.is_finite());
                let (across, upward) = (lower_right - lower_left, upper_left - lower_left);
                if !finite || normalize(cross(across, upward)).is_none() {
                    return Err(Error::caller("the four-point camera's corners lie on one line"));
                }
                // A picture one pixel wide or high has its only column or row at the lower left corner.
                RayKind::FourPoint {
                    viewpoint: viewpoint - origin,
                    corner: lower_left - origin,
                    step_i: across / (w - 1.0).max(1.0),
                    step_j: upward / (h - 1.0).max(1.0),
                }
            }
        };
        Ok(CameraRays { kind, width: w, height: h })
    }
}

impl CameraRays {
    /// The ray through a point of the picture, in pixels from the top left corner: pixel (x, y) covers
    /// `[x, x + 1) x [y, y + 1)`, its centre is `(x + 0.5, y + 0.5)`.
    ///
    /// `None` where the four-point camera's rectangle passes through its viewpoint.
    #[inline]
    pub fn ray(&self, point: DVec2) -> Option<ViewRay> {
        let (origin, direction) = self.line(point.x, point.y);
        if matches!(self.kind, RayKind::Parallel { .. }) {
            return Some(ViewRay { origin, direction });
        }
        normalize(direction).map(|direction| ViewRay { origin, direction })
    }

    /// Where the ray through a point starts, and its direction, of unit length for parallel rays and else of any.
    #[inline(always)]
    pub(crate) fn line(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let across = 2.0 * x / self.width - 1.0;
        let upward = 1.0 - 2.0 * y / self.height;
        match self.kind {
            RayKind::Perspective { eye, forward, right, up } => (eye, forward + right * across + up * upward),
            RayKind::Parallel { eye, forward, right, up } => (eye + right * across + up * upward, forward),
            RayKind::FourPoint { viewpoint, corner, step_i, step_j } => {
                let (i, j) = (x - 0.5, self.height - 0.5 - y);
                (viewpoint, corner + step_i * i + step_j * j - viewpoint)
            }
        }
    }

    /// [`ray`](Self::ray) for each of some points, given by their coordinates; `each` is called in order.
    pub fn rays(&self, x: &[f64], y: &[f64], mut each: impl FnMut(Option<ViewRay>)) {
        let mut formed = Formed { origin: Vectors::ZERO, direction: Vectors::ZERO, is_odd: [0; LANES] };
        for (x, y) in x.chunks(LANES).zip(y.chunks(LANES)) {
            Level::chosen().run(Form { camera: self, x, y, formed: &mut formed });
            for (at, (&x, &y)) in x.iter().zip(y).enumerate() {
                if formed.is_odd[at] == 0 {
                    each(Some(ViewRay { origin: formed.origin.get(at), direction: formed.direction.get(at) }));
                } else {
                    each(self.ray(DVec2::new(x, y)));
                }
            }
        }
    }
}

/// How large pixels are on what they show.
#[derive(Debug, Clone, Copy)]
pub struct Pixels {
    /// Where they are seen from, relative to the scene's origin.
    eye: DVec3,
    /// The direction of all rays; `None` if they come together in the eye.
    parallel: Option<DVec3>,
    /// The side of a pixel: at a distance of 1 from the eye, or anywhere for parallel rays. 0 if there is no camera.
    side: f64,
}

impl Pixels {
    /// No camera.
    pub const NONE: Self = Self { eye: DVec3::ZERO, parallel: None, side: 0.0 };

    /// The side of a square as large as what one sees of a surface, with this unit normal, at a point.
    ///
    /// Seen in mirrors it is that of the straight line from the eye, which is shorter than the ray's way.
    pub fn side_at(&self, position: DVec3, normal: DVec3) -> f64 {
        // Beyond 16 times as long as wide samples do what is left to do.
        let stretch = |cosine: f64| 1.0 / cosine.abs().max(1.0 / 16.0).sqrt();
        match self.parallel {
            Some(direction) => self.side * stretch(dot(normal, direction)),
            None => {
                let offset = position - self.eye;
                let distance = dot(offset, offset).sqrt();
                if distance > 0.0 { self.side * distance * stretch(dot(normal, offset) / distance) } else { 0.0 }
            }
        }
    }
}

impl CameraRays {
    /// How large pixels are of which each has so many samples: a sample's share of one.
    pub fn pixels(&self, samples: u32) -> Pixels {
        let share = 1.0 / f64::from(samples).sqrt();
        let length = |v: DVec3| dot(v, v).sqrt();
        match self.kind {
            RayKind::Perspective { eye, up, .. } => {
                Pixels { eye, parallel: None, side: 2.0 * length(up) / self.height * share }
            }
            RayKind::Parallel { eye, forward, up, .. } => {
                Pixels { eye, parallel: Some(forward), side: 2.0 * length(up) / self.height * share }
            }
            RayKind::FourPoint { viewpoint, corner, step_i, step_j } => {
                let middle = corner + step_i * (0.5 * (self.width - 1.0)) + step_j * (0.5 * (self.height - 1.0));
                let side = length(cross(step_i, step_j)).sqrt() / length(middle - viewpoint);
                let side = if side.is_finite() { side * share } else { 0.0 };
                Pixels { eye: viewpoint, parallel: None, side }
            }
        }
    }
}

/// Rays number by number.
struct Formed {
    origin: Vectors,
    direction: Vectors,
    /// Where the direction's length is extreme.
    is_odd: Flags,
}

struct Form<'a> {
    camera: &'a CameraRays,
    x: &'a [f64],
    y: &'a [f64],
    formed: &'a mut Formed,
}

impl Task for Form<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { camera, x, y, formed } = self;
        let (width, height) = (camera.width, camera.height);
        // Known to the compiler in each of these, so that the loops have no branches.
        match camera.kind {
            kind @ RayKind::Perspective { .. } => form(&CameraRays { kind, width, height }, x, y, formed),
            kind @ RayKind::Parallel { .. } => form(&CameraRays { kind, width, height }, x, y, formed),
            kind @ RayKind::FourPoint { .. } => form(&CameraRays { kind, width, height }, x, y, formed),
        }
    }
}

#[inline(always)]
fn form(camera: &CameraRays, x: &[f64], y: &[f64], formed: &mut Formed) {
    let is_unit = matches!(camera.kind, RayKind::Parallel { .. });
    let count = x.len().min(y.len()).min(LANES);
    for at in 0..count {
        let (origin, direction) = camera.line(x[at], y[at]);
        let squared = dot(direction, direction);
        let is_regular = is_unit | is_safe(squared);
        formed.origin.set(at, origin);
        formed.direction.set(at, if is_unit { direction } else { direction / squared.sqrt() });
        formed.is_odd[at] = u32::from(!is_regular);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_four_point_camera_follows_the_seeds_formula() {
        let camera = Camera::FourPoint {
            viewpoint: DVec3::new(0.0, 0.0, 5.0),
            lower_left: DVec3::new(-2.0, -1.0, 0.0),
            lower_right: DVec3::new(2.0, -1.0, 0.0),
            upper_left: DVec3::new(-2.0, 1.0, 0.0),
        };
        let (w, h) = (5u32, 3u32);
        let rays = camera.rays(w, h, DVec3::ZERO).unwrap();
        for (i, j) in [(0, 0), (4, 0), (0, 2), (4, 2), (1, 1)] {
            let p = DVec3::new(-2.0 + 4.0 * i as f64 / 4.0, -1.0 + 2.0 * j as f64 / 2.0, 0.0);
            let expected = normalize(p - DVec3::new(0.0, 0.0, 5.0)).unwrap();
            let row = h - 1 - j;
            let ray = rays.ray(DVec2::new(i as f64 + 0.5, row as f64 + 0.5)).unwrap();
            assert!((ray.direction - expected).abs().max_element() < 1e-15);
        }
        assert!(camera.rays(1, 1, DVec3::ZERO).unwrap().ray(DVec2::splat(0.5)).is_some());
    }

    #[test]
    fn the_look_at_camera_is_upright_and_not_mirrored() {
        let projection = Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 };
        let camera = Camera::LookAt { eye: DVec3::new(0.0, 0.0, 3.0), target: DVec3::ZERO, up: DVec3::Y, projection };
        let rays = camera.rays(200, 100, DVec3::ZERO).unwrap();
        let right_edge = rays.ray(DVec2::new(200.0, 50.0)).unwrap().direction;
        assert!((right_edge - DVec3::new(2.0, 0.0, -1.0) / 5f64.sqrt()).abs().max_element() < 1e-15);
        let top = rays.ray(DVec2::new(100.0, 0.0)).unwrap().direction;
        assert!((top - DVec3::new(0.0, 1.0, -1.0) / 2f64.sqrt()).abs().max_element() < 1e-15);
    }

    #[test]
    fn pixels_are_as_large_as_neighbouring_rays_are_apart() {
        let eye = DVec3::new(1.0, 2.0, 8.0);
        let look = |projection| Camera::LookAt { eye, target: DVec3::new(1.0, 2.0, 0.0), up: DVec3::Y, projection };
        let four_point = Camera::FourPoint {
            viewpoint: eye,
            lower_left: DVec3::new(0.0, 1.0, 4.0),
            lower_right: DVec3::new(2.0, 1.0, 4.0),
            upper_left: DVec3::new(0.0, 3.0, 4.0),
        };
        let cameras =
            [look(Projection::Perspective { fov_y: 0.5 }), look(Projection::Orthographic { height: 3.0 }), four_point];
        for camera in cameras {
            let rays = camera.rays(101, 101, DVec3::ZERO).unwrap();
            // Where they meet the plane z = 0.
            let at = |x: f64| {
                let ray = rays.ray(DVec2::new(x, 50.5)).unwrap();
                ray.origin - ray.direction * (ray.origin.z / ray.direction.z)
            };
            let apart = at(51.0).x - at(50.0).x;
            let side = rays.pixels(1).side_at(at(50.5), DVec3::Z);
            assert!((side / apart - 1.0).abs() < 1e-3, "{camera:?}: {side} {apart}");
            assert!((rays.pixels(16).side_at(at(50.5), DVec3::Z) / apart - 0.25).abs() < 1e-3);
            let tilted = normalize(DVec3::new(0.0, 3f64.sqrt(), 1.0)).unwrap();
            assert!((rays.pixels(1).side_at(at(50.5), tilted) / side - 2f64.sqrt()).abs() < 1e-2, "half as wide");
        }
        assert_eq!(Pixels::NONE.side_at(DVec3::ONE, DVec3::Z), 0.0);
    }

    #[test]
    fn degenerate_cameras_are_errors() {
        let projection = Projection::Perspective { fov_y: 1.0 };
        let along = Camera::LookAt { eye: DVec3::ZERO, target: DVec3::Y, up: DVec3::Y, projection };
        assert!(along.rays(4, 4, DVec3::ZERO).is_err());
        let nowhere = Camera::LookAt { eye: DVec3::ONE, target: DVec3::ONE, up: DVec3::Y, projection };
        assert!(nowhere.rays(4, 4, DVec3::ZERO).is_err());
    }
}
