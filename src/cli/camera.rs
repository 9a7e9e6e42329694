//! Which camera the command line asks for.

use super::arguments::CameraArguments;
use crate::error::{Error, Result};
use crate::scene::auto::{self, Automatic, View};
use crate::scene::{Camera, NamedCamera, Projection, Scene};

/// What the camera of `--view` and `--orbit` is called.
const NAME: &str = "command line";

/// Makes the camera that was asked for the scene's active one, and has automatic lights follow it.
///
/// The film's size must be final, since framing depends on it; `resized` says whether it differs from the file's. A camera that `turns`
/// around the scene, and is to show all of it, leaves room for that.
///
/// # Errors
/// A camera name that the scene does not have, or a field of view for a camera that has none.
pub fn choose(
    scene: &mut Scene,
    automatic: Automatic,
    arguments: &CameraArguments,
    resized: bool,
    turns: bool,
) -> Result<()> {
    let frame = if turns { auto::frame_turning } else { auto::frame };
    if let Some(name) = &arguments.camera {
        scene.active_camera = scene
            .cameras
            .iter()
            .position(|camera| camera.name == *name)
            .ok_or_else(|| unknown_camera(name, &scene.cameras))?;
    }
    let orbit = arguments.orbit.map(|orbit| (orbit.azimuth, orbit.elevation));
    if let Some((azimuth, elevation)) = arguments.view.map(View::angles).or(orbit) {
        let camera = frame(scene, azimuth, elevation, arguments.fov.unwrap_or(default_fov()));
        scene.active_camera = scene.cameras.len();
        scene.cameras.push(NamedCamera::new(NAME, camera));
    } else if automatic.camera && turns {
        let (azimuth, elevation) = auto::DEFAULT_ANGLES;
        scene.cameras[scene.active_camera].camera =
            frame(scene, azimuth.to_radians(), elevation.to_radians(), arguments.fov.unwrap_or(default_fov()));
    } else if automatic.camera {
        if resized || arguments.fov.is_some() {
            scene.cameras[scene.active_camera].camera =
                automatic.default_camera(scene, arguments.fov.unwrap_or(default_fov()));
        }
    } else if let Some(fov) = arguments.fov {
        set_field_of_view(&mut scene.cameras[scene.active_camera], fov)?;
    }
    if automatic.lights {
        automatic.light_from_camera(scene);
    }
    Ok(())
}

/// Radians.
fn default_fov() -> f64 {
    auto::DEFAULT_FOV.to_radians()
}

fn unknown_camera(name: &str, cameras: &[NamedCamera]) -> Error {
    let names: Vec<String> = cameras.iter().map(|camera| format!("`{}`", camera.name)).collect();
    Error::caller(format!("there is no camera `{name}`")).remedy(format!("the cameras are {}", names.join(", ")))
}

fn set_field_of_view(camera: &mut NamedCamera, radians: f64) -> Result<()> {
    match &mut camera.camera {
        Camera::LookAt { projection: Projection::Perspective { fov_y }, .. } => {
            *fov_y = radians;
            Ok(())
        }
        _ => Err(Error::caller(format!("the camera `{}` has no field of view", camera.name))
            .remedy("leave out --fov, or choose another camera with --camera, --view or --orbit")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::TriangleMesh;
    use crate::scene::{LightKind, Object, Shape};
    use glam::{DVec3, Vec3};

    fn scene() -> Scene {
        let look = |projection| Camera::LookAt { eye: DVec3::Z, target: DVec3::ZERO, up: DVec3::Y, projection };
        let named = |name: &str, camera| NamedCamera::new(name, camera);
        Scene {
            cameras: vec![
                named("wide", look(Projection::Perspective { fov_y: 1.0 })),
                named("flat", look(Projection::Orthographic { height: 2.0 })),
            ],
            ..Default::default()
        }
    }

    const NOTHING: Automatic = Automatic { camera: false, lights: false, room: None };

    fn asked(scene: &mut Scene, arguments: CameraArguments) -> Result<()> {
        choose(scene, NOTHING, &arguments, false, false)
    }

    #[test]
    fn cameras_are_found_by_name_and_listed_if_not() {
        let mut scene = scene();
        asked(&mut scene, CameraArguments { camera: Some("flat".into()), ..Default::default() }).unwrap();
        assert_eq!(scene.active_camera, 1);
        let error = asked(&mut scene, CameraArguments { camera: Some("tele".into()), ..Default::default() });
        assert_eq!(error.unwrap_err().to_string(), "there is no camera `tele`; the cameras are `wide`, `flat`");
    }

    #[test]
    fn only_perspective_cameras_have_a_field_of_view() {
        let mut scene = scene();
        asked(&mut scene, CameraArguments { fov: Some(0.5), ..Default::default() }).unwrap();
        let Camera::LookAt { projection: Projection::Perspective { fov_y }, .. } = scene.camera() else { panic!() };
        assert_eq!(*fov_y, 0.5);
        let flat = CameraArguments { camera: Some("flat".into()), fov: Some(0.5), ..Default::default() };
        assert!(asked(&mut scene, flat).unwrap_err().message().contains("`flat`"));
    }

    /// A quadrilateral 8 wide and 2 high about the origin, as a model file gives it.
    fn bare_model() -> (Scene, Automatic) {
        let positions = [[-4.0, -1.0], [4.0, -1.0], [4.0, 1.0], [-4.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
        let mesh = TriangleMesh {
            positions: positions.to_vec().into(),
            indices: vec![[0, 1, 2], [0, 2, 3]].into(),
            ..Default::default()
        };
        let object =
            Object { name: String::new(), shape: Shape::Mesh(0), transform: glam::DAffine3::IDENTITY, material: None };
        let mut scene =
            Scene { meshes: vec![mesh.finish().unwrap().into()], objects: vec![object], ..Default::default() };
        let automatic = auto::complete(&mut scene);
        (scene, automatic)
    }

    fn eye(scene: &Scene) -> DVec3 {
        let Camera::LookAt { eye, .. } = *scene.camera() else { panic!() };
        eye
    }

    #[test]
    fn an_automatic_camera_frames_again_and_a_given_one_stays() {
        let (mut scene, automatic) = bare_model();
        let before = eye(&scene);
        scene.film.width = 360;
        choose(&mut scene, automatic, &CameraArguments::default(), true, false).unwrap();
        // A quarter of the width holds as much from four times as far, but for the model's depth.
        let ratio = eye(&scene).length() / before.length();
        assert!((3.0..4.5).contains(&ratio), "{ratio}");

        let before = eye(&scene);
        choose(&mut scene, NOTHING, &CameraArguments::default(), true, false).unwrap();
        assert_eq!(eye(&scene), before);
    }

    #[test]
    fn automatic_lights_follow_the_view_and_given_ones_stay() {
        let (mut scene, automatic) = bare_model();
        let key = |scene: &Scene| match scene.lights[0].kind {
            LightKind::Directional { direction } => direction,
            _ => panic!(),
        };
        choose(&mut scene, automatic, &CameraArguments { view: Some(View::Front), ..Default::default() }, false, false)
            .unwrap();
        assert!(key(&scene).z < 0.0, "the key light comes from the camera's side");
        let back = CameraArguments { view: Some(View::Back), ..Default::default() };
        choose(&mut scene, automatic, &back, false, false).unwrap();
        assert!(key(&scene).z > 0.0);
        let front = CameraArguments { view: Some(View::Front), ..Default::default() };
        choose(&mut scene, Automatic { lights: false, ..automatic }, &front, false, false).unwrap();
        assert!(key(&scene).z > 0.0);
    }
}
