//! Which camera the command line asks for.

use super::arguments::CameraArguments;
use crate::error::{Error, Result};
use crate::scene::{Camera, NamedCamera, Projection, Scene, auto};

/// Makes the camera that was asked for the scene's active one. The film's size must be final: framing depends on it.
///
/// # Errors
/// A camera name that the scene does not have, or a field of view for a camera that has none.
pub fn choose(scene: &mut Scene, arguments: &CameraArguments) -> Result<()> {
    if let Some(name) = &arguments.camera {
        scene.active_camera = scene
            .cameras
            .iter()
            .position(|camera| camera.name == *name)
            .ok_or_else(|| unknown_camera(name, &scene.cameras))?;
    }
    let direction =
        arguments.view.map(auto::View::angles).or(arguments.orbit.map(|orbit| (orbit.azimuth, orbit.elevation)));
    if let Some((azimuth, elevation)) = direction {
        let fov_y = arguments.fov.unwrap_or(auto::DEFAULT_FOV.to_radians());
        let camera = auto::frame(scene, azimuth, elevation, fov_y);
        scene.active_camera = scene.cameras.len();
        scene.cameras.push(NamedCamera { name: "command line".into(), camera });
    } else if let Some(fov) = arguments.fov {
        set_field_of_view(&mut scene.cameras[scene.active_camera], fov)?;
    }
    Ok(())
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
    use glam::DVec3;

    fn scene() -> Scene {
        let look = |projection| Camera::LookAt { eye: DVec3::Z, target: DVec3::ZERO, up: DVec3::Y, projection };
        let named = |name: &str, camera| NamedCamera { name: name.into(), camera };
        Scene {
            cameras: vec![
                named("wide", look(Projection::Perspective { fov_y: 1.0 })),
                named("flat", look(Projection::Orthographic { height: 2.0 })),
            ],
            ..Default::default()
        }
    }

    #[test]
    fn cameras_are_found_by_name_and_listed_if_not() {
        let mut scene = scene();
        choose(&mut scene, &CameraArguments { camera: Some("flat".into()), ..Default::default() }).unwrap();
        assert_eq!(scene.active_camera, 1);
        let error = choose(&mut scene, &CameraArguments { camera: Some("tele".into()), ..Default::default() });
        assert_eq!(error.unwrap_err().to_string(), "there is no camera `tele`; the cameras are `wide`, `flat`");
    }

    #[test]
    fn only_perspective_cameras_have_a_field_of_view() {
        let mut scene = scene();
        choose(&mut scene, &CameraArguments { fov: Some(0.5), ..Default::default() }).unwrap();
        let Camera::LookAt { projection: Projection::Perspective { fov_y }, .. } = scene.camera() else { panic!() };
        assert_eq!(*fov_y, 0.5);
        let flat = CameraArguments { camera: Some("flat".into()), fov: Some(0.5), ..Default::default() };
        assert!(choose(&mut scene, &flat).unwrap_err().message().contains("`flat`"));
    }
}
