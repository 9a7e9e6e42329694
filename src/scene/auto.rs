//! The camera, lights and background of a bare model: what makes a good picture with no set-up.

use glam::DVec3;

use crate::math::vector::{cross, dot, normalize};
use crate::scene::outline;
use crate::scene::room::Room;
use crate::scene::{Background, Camera, Light, LightKind, NamedCamera, Projection, Rgb, Scene};

/// A named direction to look from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// From +Z.
    Front,
    /// From -Z.
    Back,
    /// From -X.
    Left,
    /// From +X.
    Right,
    /// From +Y, -Z pointing up in the picture.
    Top,
    /// From -Y.
    Bottom,
    /// From between +X, +Y and +Z.
    Iso,
}

impl View {
    /// Azimuth and elevation in radians, as [`frame`] takes them.
    pub fn angles(self) -> (f64, f64) {
        let (azimuth, elevation): (f64, f64) = match self {
            Self::Front => (0.0, 0.0),
            Self::Back => (180.0, 0.0),
            Self::Left => (-90.0, 0.0),
            Self::Right => (90.0, 0.0),
            Self::Top => (0.0, 90.0),
            Self::Bottom => (0.0, -90.0),
            Self::Iso => (45.0, ISO_ELEVATION),
        };
        (azimuth.to_radians(), elevation.to_radians())
    }
}

/// The elevation in degrees from which a cube's three visible faces look alike: atan(1 / sqrt 2).
const ISO_ELEVATION: f64 = 35.264_389_682_754_654;

/// From where a bare model is seen: a little from the right and above, degrees.
pub const DEFAULT_ANGLES: (f64, f64) = (30.0, 18.0);

/// Vertical field of view of the automatic camera, degrees: that of a portrait lens.
pub const DEFAULT_FOV: f64 = 35.0;

/// Empty border around the model, as a share of the picture on each side.
const MARGIN: f64 = 0.06;

/// The name of the automatic camera.
pub const CAMERA_NAME: &str = "auto";

/// What of a scene was chosen automatically, and so is chosen again for another view of it.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct Automatic {
    /// The only camera.
    pub camera: bool,
    /// The lights.
    pub lights: bool,
    /// The room that the scene is, which camera and lights are chosen for; looked for where one of them is automatic.
    pub room: Option<Room>,
}

impl Automatic {
    /// A camera that frames the scene from a little to the right and above, or looks straight into a room that is open
    /// on one side, for the film's current size; `fov_y` in radians.
    pub fn default_camera(&self, scene: &Scene, fov_y: f64) -> Camera {
        let (azimuth, elevation) = match &self.room {
            Some(room) => (room.azimuth, 0.0),
            None => (DEFAULT_ANGLES.0.to_radians(), DEFAULT_ANGLES.1.to_radians()),
        };
        frame(scene, azimuth, elevation, fov_y)
    }

    /// Replaces the lights by a key, a fill and a rim light for the active camera; in a room that is open on one side,
    /// by a lamp under the ceiling and a fill light at the camera.
    pub fn light_from_camera(&self, scene: &mut Scene) {
        scene.lights = self.lights_of(scene.camera());
    }

    /// The lights for a camera.
    pub fn lights_of(&self, camera: &Camera) -> Vec<Light> {
        match &self.room {
            Some(room) => room.lights(camera),
            None => studio_lights(camera),
        }
    }
}

/// Gives a scene that came from a bare model what it lacks: a camera that frames it, lights, a background.
pub fn complete(scene: &mut Scene) -> Automatic {
    // Lights in physical units come with an exposure, which is not meant for the background.
    let level = libm::exp2f(-scene.film.exposure);
    let (bottom, top) = (Rgb::splat(0.32) * level, Rgb::new(0.80, 0.84, 0.90) * level);
    scene.background = Background::Gradient { bottom, top, up: DVec3::Y };
    let lights = scene.lights.is_empty();
    add_missing(scene, lights)
}

/// Gives a scene without a camera one that frames it.
pub fn complete_camera(scene: &mut Scene) -> Automatic {
    add_missing(scene, false)
}

/// Adds a camera if there is none, and lights if `lights` says so.
fn add_missing(scene: &mut Scene, lights: bool) -> Automatic {
    let camera = scene.cameras.is_empty();
    let room = if camera || lights { Room::of(scene) } else { None };
    let automatic = Automatic { camera, lights, room };
    if camera {
        let camera = automatic.default_camera(scene, DEFAULT_FOV.to_radians());
        scene.cameras.push(NamedCamera::new(CAMERA_NAME, camera));
    }
    if lights {
        automatic.light_from_camera(scene);
    }
    automatic
}

/// A camera that sees the whole scene from a direction and fills the picture with it.
///
/// Angles in radians: azimuth 0 looks from +Z and grows towards +X, elevation grows towards +Y; `fov_y` is vertical.
/// For the film's current size, two opposite sides of the picture touch the model's vertices, up to a margin, and the
/// other two have room left. Where there are very many instances, the corners of their boxes stand for vertices.
pub fn frame(scene: &Scene, azimuth: f64, elevation: f64, fov_y: f64) -> Camera {
    let (sin_a, cos_a) = libm::sincos(azimuth);
    let (sin_e, cos_e) = libm::sincos(elevation);
    let backward = DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
    // Straight up or down, the horizon gives no direction: keep the azimuth's.
    let up_hint = if cos_e.abs() < 1e-6 { DVec3::new(-sin_a, 0.0, -cos_a) * sin_e.signum() } else { DVec3::Y };
    let right = normalize(cross(up_hint, backward)).unwrap_or(DVec3::X);
    let up = cross(backward, right);

    let aspect = f64::from(scene.film.width) / f64::from(scene.film.height);
    let slope_y = libm::tan(0.5 * fov_y) * (1.0 - 2.0 * MARGIN);
    let slope_x = slope_y * aspect;

    // A point at depth z before the eye is in the picture if |x| <= slope_x z and |y| <= slope_y z. Each of the four
    // sides bounds a linear function of the eye; the nearest eye that satisfies all has this closed form.
    let mut sides = [f64::NEG_INFINITY; 4];
    let mut nearest = f64::NEG_INFINITY;
    let (mut depths, mut count) = (0.0, 0u64);
    outline::visit(scene, |p| {
        let (x, y, z) = (dot(p, right), dot(p, up), dot(p, backward));
        let limits = [x + slope_x * z, -x + slope_x * z, y + slope_y * z, -y + slope_y * z];
        for (side, limit) in sides.iter_mut().zip(limits) {
            *side = side.max(limit);
        }
        nearest = nearest.max(z);
        depths += z;
        count += 1;
    });
    if count == 0 {
        sides = [slope_x, slope_x, slope_y, slope_y];
        nearest = 0.0;
    }
    let center = if count == 0 { 0.0 } else { depths / count as f64 };
    let [right_side, left_side, top_side, bottom_side] = sides;
    let (x, y) = (0.5 * (right_side - left_side), 0.5 * (top_side - bottom_side));
    let z = (0.5 * (right_side + left_side) / slope_x).max(0.5 * (top_side + bottom_side) / slope_y);
    // A point-like model leaves no distance at all; stand one unit away.
    let z = if z > nearest { z } else { nearest + 1.0 };
    let eye = right * x + up * y + backward * z;
    let target = eye - backward * (z - 0.5 * (nearest + center));
    Camera::LookAt { eye, target, up, projection: Projection::Perspective { fov_y } }
}

/// A camera that looks at the axis of a turntable from a direction, and sees the whole scene on every way around it.
///
/// As [`frame`], for the circles about the upward axis, through the middle of the scene's box, that its vertices turn on: each may touch a side
/// of the picture somewhere on its way.
pub fn frame_turning(scene: &Scene, azimuth: f64, elevation: f64, fov_y: f64) -> Camera {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    outline::visit(scene, |p| (min, max) = (min.min(p), max.max(p)));
    let middle = if min.cmple(max).all() { (min + max) * 0.5 } else { DVec3::ZERO };
    // Straight from above or below, the axis would be no direction for upward.
    let steepest = 89f64.to_radians();
    let (sin_e, cos_e) = libm::sincos(elevation.clamp(-steepest, steepest));
    let (sin_a, cos_a) = libm::sincos(azimuth);
    let aspect = f64::from(scene.film.width) / f64::from(scene.film.height);
    let slope_y = libm::tan(0.5 * fov_y) * (1.0 - 2.0 * MARGIN);
    let slope_x = slope_y * aspect;
    // What bounds the eye for a point, as in `frame`, at its largest on the point's way around.
    let [mut beside, mut above, mut below, mut nearest] = [f64::NEG_INFINITY; 4];
    outline::visit(scene, |p| {
        let (x, y, z) = (p.x - middle.x, p.y - middle.y, p.z - middle.z);
        let radius = (x * x + z * z).sqrt();
        let (height, depth) = (y * cos_e, y * sin_e);
        beside = f64::max(beside, radius * (1.0 + slope_x * slope_x * cos_e * cos_e).sqrt() + slope_x * depth);
        above = above.max(height + slope_y * depth + radius * (slope_y * cos_e - sin_e).abs());
        below = below.max(-height + slope_y * depth + radius * (slope_y * cos_e + sin_e).abs());
        nearest = f64::max(nearest, depth + radius * cos_e);
    });
    let distance = (beside / slope_x).max(0.5 * (above + below) / slope_y);
    let y = if nearest.is_finite() { 0.5 * (above - below) } else { 0.0 };
    // A point-like model leaves no distance at all, and none has none; stand one unit away.
    let distance = if distance > nearest { distance } else { nearest.max(0.0) + 1.0 };
    let backward = DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
    let upward = DVec3::new(-sin_a * sin_e, cos_e, -cos_a * sin_e);
    let eye = middle + upward * y + backward * distance;
    // Where the view meets the axis.
    let target = eye - backward * (distance - y * sin_e / cos_e);
    Camera::LookAt { eye, target, up: DVec3::Y, projection: Projection::Perspective { fov_y } }
}

/// Key, fill and rim light, fixed to the camera: from the upper left, the right and behind.
fn studio_lights(camera: &Camera) -> Vec<Light> {
    let (forward, up) = match *camera {
        Camera::LookAt { eye, target, up, .. } => (normalize(target - eye), up),
        Camera::FourPoint { .. } => (None, DVec3::Y),
    };
    let forward = forward.unwrap_or(DVec3::NEG_Z);
    let right = normalize(cross(forward, up)).unwrap_or(DVec3::X);
    let up = cross(right, forward);
    let light = |name: &str, direction: DVec3, color: Rgb| Light {
        name: name.into(),
        kind: LightKind::Directional { direction },
        color,
    };
    vec![
        light("key", forward * 0.75 + right * 0.65 - up * 0.9, Rgb::new(0.80, 0.78, 0.74)),
        light("fill", forward * 0.8 - right * 0.9 - up * 0.15, Rgb::new(0.22, 0.24, 0.27)),
        light("rim", -forward * 0.8 - right * 0.35 - up * 0.6, Rgb::splat(0.30)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;
    use crate::scene::{CameraPath, Object, Shape};
    use glam::{DAffine3, Vec3};

    fn cube() -> Scene {
        let positions = crate::geometry::Bounds { min: Vec3::splat(-1.0), max: Vec3::ONE }.corners().to_vec();
        let indices = vec![[0, 1, 2], [3, 2, 1], [4, 5, 6], [7, 6, 5], [0, 1, 4], [2, 3, 6]];
        let mesh = TriangleMesh { positions: positions.into(), indices: indices.into(), ..Default::default() }
            .finish()
            .unwrap();
        let object = |x: f64| Object {
            name: String::new(),
            shape: Shape::Mesh(0),
            transform: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
            material: None,
        };
        Scene { meshes: vec![mesh.into()], objects: vec![object(0.0), object(5.0)], ..Default::default() }
    }

    #[test]
    fn every_vertex_is_framed_and_the_frame_is_tight() {
        let scene = cube();
        for (azimuth, elevation) in [(0.0, 0.0), (0.5, 0.3), (2.0, -1.0), View::Top.angles(), View::Bottom.angles()] {
            let camera = frame(&scene, azimuth, elevation, 0.6);
            let Camera::LookAt { eye, target, up, .. } = camera else { panic!() };
            let forward = normalize(target - eye).unwrap();
            let right = normalize(cross(forward, up)).unwrap();
            let up = cross(right, forward);
            let half = (0.3f64).tan();
            let mut extent = 0.0f64;
            for p in outline::sample(&scene) {
                let d = p - eye;
                let z = dot(d, forward);
                assert!(z > 0.0);
                extent =
                    extent.max((dot(d, right) / (z * half * 16.0 / 9.0)).abs()).max((dot(d, up) / (z * half)).abs());
            }
            assert!((extent - (1.0 - 2.0 * MARGIN)).abs() < 1e-9, "{azimuth} {elevation}: {extent}");
        }
    }

    #[test]
    fn turning_cameras_see_everything_and_are_no_farther_than_that_needs() {
        let mut scene = cube();
        for (size, azimuth, elevation) in [(1.0, 0.0, 0.0), (1.0, 0.5, 0.3), (0.01, 2.0, -0.9), (100.0, 1.0, 1.6)] {
            scene.objects.iter_mut().for_each(|object| object.transform = DAffine3::from_scale(DVec3::splat(size)));
            let camera = frame_turning(&scene, azimuth, elevation, 0.6);
            let half = (0.3f64).tan();
            let mut most = 0.0f64;
            for step in 0..720 {
                let turned = CameraPath::Turntable { frames: 720 }.camera(&camera, step);
                let Camera::LookAt { eye, target, up, .. } = turned else { panic!() };
                let forward = normalize(target - eye).unwrap();
                let right = normalize(cross(forward, up)).unwrap();
                let up = cross(right, forward);
                for p in outline::sample(&scene) {
                    let d = p - eye;
                    let z = dot(d, forward);
                    assert!(z > 0.0);
                    most =
                        most.max((dot(d, right) / (z * half * 16.0 / 9.0)).abs()).max((dot(d, up) / (z * half)).abs());
                }
            }
            let tight = 1.0 - 2.0 * MARGIN;
            assert!(most <= tight + 1e-9 && most > tight - 0.01, "{azimuth} {elevation}: {most}");
        }
    }

    #[test]
    fn a_single_tip_of_a_large_model_is_in_the_picture() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(9.0, 9.0, 1.0)];
        let eye = |base: usize| {
            let mut indices = vec![[0, 1, 2]; base];
            // Neither the first nor the last corner.
            indices.insert(base / 2, [0, 3, 1]);
            let mesh =
                TriangleMesh { positions: positions.clone().into(), indices: indices.into(), ..Default::default() };
            let object = Object { shape: Shape::Mesh(0), ..cube().objects[0].clone() };
            let scene =
                Scene { meshes: vec![mesh.finish().unwrap().into()], objects: vec![object], ..Default::default() };
            let Camera::LookAt { eye, .. } = frame(&scene, 0.5, 0.3, 0.6) else { panic!() };
            eye
        };
        assert_eq!(eye(1_500_000), eye(1));
    }

    #[test]
    fn views_look_from_where_they_say() {
        let scene = cube();
        let from = |view: View| {
            let (azimuth, elevation) = view.angles();
            let Camera::LookAt { eye, target, .. } = frame(&scene, azimuth, elevation, 0.6) else { panic!() };
            normalize(eye - target).unwrap()
        };
        let near = |a: DVec3, b: DVec3| assert!((a - b).abs().max_element() < 1e-12, "{a} {b}");
        near(from(View::Front), DVec3::Z);
        near(from(View::Right), DVec3::X);
        near(from(View::Left), -DVec3::X);
        near(from(View::Back), -DVec3::Z);
        near(from(View::Top), DVec3::Y);
        near(from(View::Bottom), -DVec3::Y);
        near(from(View::Iso), DVec3::ONE / 3f64.sqrt());
    }

    #[test]
    fn an_empty_scene_still_has_a_camera_and_lights() {
        let mut scene = Scene::default();
        complete(&mut scene);
        assert_eq!(scene.lights.len(), 3);
        assert!(scene.camera().rays(8, 8, DVec3::ZERO).is_ok());
    }
}
