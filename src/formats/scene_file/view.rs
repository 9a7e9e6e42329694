//! `[camera]`, `[film]` and `[background]`: how the scene is looked at.

use glam::DVec3;

use crate::error::Result;
use crate::formats::scene_file::read::Reader;
use crate::formats::scene_file::value::{Fields, Value};
use crate::math::vector::normalize;
use crate::scene::film::{LARGEST_DEPTH, LARGEST_EXPOSURE, LONGEST_SIDE, MOST_SAMPLES};
use crate::scene::{Background, Camera, CameraKey, CameraPath, Clamp, FilmSettings, Projection, Transfer};

/// Vertical field of view where a perspective camera gives none, degrees.
const DEFAULT_FOV: f64 = 40.0;

/// The last frame that there can be, and with a minus the first.
const LAST_FRAME: u32 = 1_000_000;

#[derive(Clone, Copy)]
enum CameraKind {
    Perspective,
    Orthographic,
    FourPoint,
}

/// A camera; `kind` may be left out where a key tells it.
pub fn read_camera(fields: &Fields<'_>) -> Result<Camera> {
    let words = [
        ("perspective", CameraKind::Perspective),
        ("orthographic", CameraKind::Orthographic),
        ("four_point", CameraKind::FourPoint),
    ];
    let kind = match fields.get("kind") {
        Some(kind) => kind.choice(&words)?,
        None if fields.has("viewpoint") => CameraKind::FourPoint,
        None if fields.has("height") => CameraKind::Orthographic,
        None => CameraKind::Perspective,
    };
    let up = |fields: &Fields<'_>| fields.or("up", DVec3::Y, Value::direction);
    let camera = match kind {
        CameraKind::Perspective => {
            fields.accept(&["name", "kind", "eye", "target", "up", "fov", "turntable", "path"])?;
            let fov = fields.or("fov", DEFAULT_FOV, field_of_view)?;
            Camera::LookAt {
                eye: fields.require("eye")?.vector()?,
                target: fields.require("target")?.vector()?,
                up: up(fields)?,
                projection: Projection::Perspective { fov_y: fov.to_radians() },
            }
        }
        CameraKind::Orthographic => {
            fields.accept(&["name", "kind", "eye", "target", "up", "height", "turntable", "path"])?;
            Camera::LookAt {
                eye: fields.require("eye")?.vector()?,
                target: fields.require("target")?.vector()?,
                up: up(fields)?,
                projection: Projection::Orthographic { height: fields.require("height")?.positive()? },
            }
        }
        CameraKind::FourPoint => {
            fields.accept(&["name", "kind", "viewpoint", "lower_left", "lower_right", "upper_left"])?;
            Camera::FourPoint {
                viewpoint: fields.require("viewpoint")?.vector()?,
                lower_left: fields.require("lower_left")?.vector()?,
                lower_right: fields.require("lower_right")?.vector()?,
                upper_left: fields.require("upper_left")?.vector()?,
            }
        }
    };
    camera.rays(2, 2, DVec3::ZERO).map_err(|error| fields.error(error.message()))?;
    Ok(camera)
}

/// Degrees, between 0 and 180.
fn field_of_view(value: &Value<'_>) -> Result<f64> {
    let degrees = value.positive()?;
    if degrees < 180.0 { Ok(degrees) } else { Err(value.error("`fov` must be less than 180 degrees")) }
}

/// How a camera moves, if it does: `turntable`, or the keys of `path`.
pub fn read_camera_path(fields: &Fields<'_>, camera: &Camera) -> Result<Option<CameraPath>> {
    let Camera::LookAt { target, projection, .. } = *camera else { return Ok(None) };
    if let Some(turntable) = fields.get("turntable") {
        if let Some(path) = fields.get("path") {
            return Err(path.error("the camera moves in two ways").remedy("give `turntable` or `path`"));
        }
        return Ok(Some(CameraPath::Turntable { frames: turntable.whole(1..=LAST_FRAME)? }));
    }
    let Some(path) = fields.get("path") else { return Ok(None) };
    let mut keys: Vec<CameraKey> = Vec::new();
    for key in path.tables("a key of the camera's path")? {
        let (lens_name, lens) = match projection {
            Projection::Perspective { fov_y } => ("fov", fov_y),
            Projection::Orthographic { height } => ("height", height),
        };
        key.accept(&["frame", "eye", "target", lens_name])?;
        let number = key.require("frame")?;
        let frame = number.between(-f64::from(LAST_FRAME)..=f64::from(LAST_FRAME))?;
        if frame.fract() != 0.0 {
            return Err(number.error("`frame` must be a whole number"));
        }
        if keys.last().is_some_and(|last| f64::from(last.frame) >= frame) {
            return Err(number.error("the keys of a camera's path must be in the order of their frames"));
        }
        let lens = key.or(lens_name, lens, |value| match projection {
            Projection::Perspective { .. } => Ok(field_of_view(value)?.to_radians()),
            Projection::Orthographic { .. } => value.positive(),
        })?;
        let (eye, target) = (key.require("eye")?.vector()?, key.or("target", target, Value::vector)?);
        keys.push(CameraKey { frame: frame as i32, eye, target, lens });
    }
    if keys.is_empty() {
        return Err(path.error("the camera's path has no keys").remedy("give some, or leave `path` out"));
    }
    Ok(Some(CameraPath::Keys(keys)))
}

/// What the film is where the file does not say: the seed's for the seed's camera.
pub fn default_film(camera: Option<&Camera>) -> FilmSettings {
    match camera {
        Some(Camera::FourPoint { .. }) => {
            FilmSettings { width: 640, height: 480, samples: 1, clamp: Clamp::Shade, ..Default::default() }
        }
        _ => FilmSettings::default(),
    }
}

/// The film.
pub fn read_film(fields: &Fields<'_>, default: FilmSettings) -> Result<FilmSettings> {
    const SIDE: std::ops::RangeInclusive<u32> = 1..=LONGEST_SIDE;
    fields.accept(&["width", "height", "size", "samples", "max_depth", "clamp", "transfer", "exposure"])?;
    let mut film = default;
    if let Some(size) = fields.get("size") {
        if let Some(twice) = fields.get("width").or_else(|| fields.get("height")) {
            return Err(twice.error("the film has its size twice").remedy("give `size`, or `width` and `height`"));
        }
        let [width, height] = size.list()?.try_into().map_err(|_| size.error("`size` must be [width, height]"))?;
        (film.width, film.height) = (width.whole(SIDE)?, height.whole(SIDE)?);
    }
    film.width = fields.or("width", film.width, |value| value.whole(SIDE))?;
    film.height = fields.or("height", film.height, |value| value.whole(SIDE))?;
    film.samples = fields.or("samples", film.samples, |value| value.whole(1..=MOST_SAMPLES))?;
    film.max_depth = fields.or("max_depth", film.max_depth, |value| value.whole(0..=LARGEST_DEPTH))?;
    let clamps = [("shade", Clamp::Shade), ("output", Clamp::Output)];
    film.clamp = fields.or("clamp", film.clamp, |value| value.choice(&clamps))?;
    let transfers = [("srgb", Transfer::Srgb), ("linear", Transfer::Linear)];
    film.transfer = fields.or("transfer", film.transfer, |value| value.choice(&transfers))?;
    let exposures = f64::from(-LARGEST_EXPOSURE)..=f64::from(LARGEST_EXPOSURE);
    let exposure = fields.or("exposure", f64::from(film.exposure), |value| value.between(exposures))?;
    film.exposure = exposure as f32;
    Ok(film)
}

/// The background.
pub fn read_background(fields: &Fields<'_>, reader: &mut Reader<'_>) -> Result<Background> {
    const KINDS: [&str; 4] = ["color", "gradient", "image", "transparent"];
    fields.accept(&["color", "gradient", "image", "intensity", "transparent"])?;
    let mut given = KINDS.iter().filter_map(|key| fields.get(key));
    if let (Some(_), Some(second)) = (given.next(), given.next()) {
        let error = second.error("the background is given twice");
        return Err(error.remedy("keep one of `color`, `gradient`, `image`, `transparent`"));
    }
    if let (Some(intensity), false) = (fields.get("intensity"), fields.has("image")) {
        return Err(intensity.error("`intensity` belongs to a background `image`"));
    }
    if let Some(color) = fields.get("color") {
        return Ok(Background::Color(color.color()?));
    }
    if let Some(gradient) = fields.get("gradient") {
        let gradient = gradient.table("a gradient")?;
        gradient.accept(&["bottom", "top", "up"])?;
        let up = gradient.or("up", DVec3::Y, Value::direction)?;
        return Ok(Background::Gradient {
            bottom: gradient.require("bottom")?.color()?,
            top: gradient.require("top")?.color()?,
            up: normalize(up).unwrap_or(DVec3::Y),
        });
    }
    if let Some(image) = fields.get("image") {
        let intensity = fields.or("intensity", 1.0, Value::non_negative)?;
        return Ok(Background::Image { texture: reader.image(&image)?, intensity: intensity as f32 });
    }
    match fields.or("transparent", false, Value::boolean)? {
        true => Ok(Background::Transparent),
        false => Ok(Background::default()),
    }
}
