//! From a bare model's scene to a scene file.

use std::fmt::Display;
use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::formats::atomic_file::{relative_to, write_atomically};
use crate::formats::{self, LoadOptions, NormalMode, UpAxis};
use crate::scene::{
    Background, Camera, CameraKey, CameraPath, Clamp, Falloff, FilmSettings, Light, LightKind, NamedCamera, Projection,
    Rgb, Scene, Transfer,
};

/// Writes a scene that was opened from the bare model file `model` as the scene file `to`, in one piece.
///
/// Film, ambient, background, cameras (the active one first) and lights are written as they are in `scene`; the meshes
/// and materials stay in the model, which the file names relative to itself. Read back, the scene renders to the same
/// bytes, given the same limits and permission to read files elsewhere: these a file does not grant itself.
///
/// # Errors
/// A caller's error for another suffix than `.toml`, for a `model` that is a scene file itself, and for paths that are
/// not UTF-8; the system's.
pub fn save_model_scene(scene: &Scene, model: &Path, options: &LoadOptions, to: &Path) -> Result<()> {
    if !to.extension().is_some_and(|suffix| suffix.eq_ignore_ascii_case("toml")) {
        return Err(Error::caller("a scene file's name must end in .toml").at_path(to));
    }
    if formats::format_of(model)? == formats::Format::Scene {
        return Err(Error::caller("is a scene file already").at_path(model).remedy("save scenes of bare models"));
    }
    let text = model_scene(scene, model, options, to)?;
    write_atomically(to, |sink| sink.write_all(text.as_bytes()).map_err(|cause| Error::system(to, cause)))
}

/// The text of a scene file as it grows.
#[derive(Default)]
struct Text(String);

impl Text {
    fn comment(&mut self, line: &str) {
        self.0 += &format!("# {line}\n");
    }

    fn table(&mut self, header: &str) {
        self.0 += &format!("\n{header}\n");
    }

    fn key(&mut self, key: &str, value: impl Display) {
        self.0 += &format!("{key} = {value}\n");
    }
}

/// The text that [`save_model_scene`] writes.
///
/// # Errors
/// Paths that are not UTF-8.
pub fn model_scene(scene: &Scene, model: &Path, options: &LoadOptions, to: &Path) -> Result<String> {
    let mut out = Text::default();
    let name = model.file_name().unwrap_or_default().to_string_lossy();
    out.comment(&format!("The scene that whitted made for {}.", quoted(&name)));
    out.comment("Angles are degrees, colours linear; the manual's page on scene files explains every key.\n");
    out.key("ambient", weight(scene.ambient));
    write_film(&mut out, &scene.film);
    write_background(&mut out, &scene.background, to)?;
    out.table("[[object]]");
    out.key("mesh", relative(model, to)?);
    match options.normals {
        NormalMode::File => {}
        NormalMode::Flat => out.key("normals", quoted("flat")),
        NormalMode::Smooth => out.key("normals", quoted("smooth")),
    }
    match options.up {
        UpAxis::Y => {}
        UpAxis::Z => out.key("up", quoted("z")),
    }
    if let Some(radians) = options.crease_angle {
        out.key("crease_angle", number(degrees(radians)));
    }
    if let Some(name) = &options.scene {
        out.key("scene", quoted(name));
    }
    if let Some(seconds) = options.time {
        out.key("time", number(seconds));
    }
    if let Some(name) = &options.animation {
        out.key("animation", quoted(name));
    }
    if options.cull_back_faces {
        out.key("cull_back_faces", true);
    }
    let mut names = Names::default();
    let others = scene.cameras.iter().enumerate().filter(|(index, _)| *index != scene.active_camera);
    for named in scene.cameras.get(scene.active_camera).into_iter().chain(others.map(|(_, named)| named)) {
        write_camera(&mut out, named, &mut names);
    }
    let mut names = Names::default();
    for light in &scene.lights {
        write_light(&mut out, light, &mut names);
    }
    Ok(out.0)
}

/// A camera's table, as a text of its own.
pub fn camera_text(named: &NamedCamera) -> String {
    let mut out = Text::default();
    write_camera(&mut out, named, &mut Names::default());
    out.0
}

/// A light's table, as a text of its own.
pub fn light_text(light: &Light) -> String {
    let mut out = Text::default();
    write_light(&mut out, light, &mut Names::default());
    out.0
}

fn write_film(out: &mut Text, film: &FilmSettings) {
    out.table("[film]");
    out.key("size", format_args!("[{}, {}]", film.width, film.height));
    out.key("samples", film.samples);
    out.key("max_depth", film.max_depth);
    out.key(
        "clamp",
        match film.clamp {
            Clamp::Shade => quoted("shade"),
            Clamp::Output => quoted("output"),
        },
    );
    out.key(
        "transfer",
        match film.transfer {
            Transfer::Srgb => quoted("srgb"),
            Transfer::Linear => quoted("linear"),
        },
    );
    out.key("exposure", number_f32(film.exposure));
}

fn write_background(out: &mut Text, background: &Background, to: &Path) -> Result<()> {
    out.table("[background]");
    match background {
        Background::Color(rgb) => out.key("color", color(*rgb)),
        Background::Gradient { bottom, top, up } => {
            let (bottom, top, up) = (color(*bottom), color(*top), vector(*up));
            out.key("gradient", format_args!("{{ bottom = {bottom}, top = {top}, up = {up} }}"));
        }
        Background::Image { texture, intensity } => {
            out.key("image", relative(Path::new(&texture.name), to)?);
            out.key("intensity", number_f32(*intensity));
        }
        Background::Transparent => out.key("transparent", true),
    }
    Ok(())
}

fn write_camera(out: &mut Text, named: &NamedCamera, names: &mut Names) {
    out.table("[[camera]]");
    out.key("name", quoted(&names.unique(&named.name, "camera")));
    match named.camera {
        Camera::LookAt { eye, target, up, projection } => {
            match projection {
                Projection::Perspective { fov_y } => out.key("fov", number(degrees(fov_y))),
                Projection::Orthographic { height } => out.key("height", number(height)),
            }
            out.key("eye", vector(eye));
            out.key("target", vector(target));
            out.key("up", vector(up));
        }
        Camera::FourPoint { viewpoint, lower_left, lower_right, upper_left } => {
            out.key("viewpoint", vector(viewpoint));
            out.key("lower_left", vector(lower_left));
            out.key("lower_right", vector(lower_right));
            out.key("upper_left", vector(upper_left));
        }
    }
    match &named.path {
        None => {}
        Some(CameraPath::Turntable { frames }) => out.key("turntable", frames),
        Some(CameraPath::Keys(keys)) => {
            let key = |key: &CameraKey| {
                let lens = match named.camera {
                    Camera::LookAt { projection: Projection::Perspective { .. }, .. } => {
                        format!("fov = {}", number(degrees(key.lens)))
                    }
                    _ => format!("height = {}", number(key.lens)),
                };
                let (frame, eye, target) = (key.frame, vector(key.eye), vector(key.target));
                format!("{{ frame = {frame}, eye = {eye}, target = {target}, {lens} }}")
            };
            out.key("path", format_args!("[{}]", keys.iter().map(key).collect::<Vec<_>>().join(", ")));
        }
    }
}

fn write_light(out: &mut Text, light: &Light, names: &mut Names) {
    out.table("[[light]]");
    out.key("name", quoted(&names.unique(&light.name, "light")));
    let falloff = |falloff| match falloff {
        Falloff::None => quoted("none"),
        Falloff::InverseSquare => quoted("inverse_square"),
    };
    match light.kind {
        LightKind::Point { position, falloff: kind } => {
            out.key("kind", quoted("point"));
            out.key("position", vector(position));
            out.key("falloff", falloff(kind));
        }
        LightKind::Directional { direction } => {
            out.key("kind", quoted("directional"));
            out.key("direction", vector(direction));
        }
        LightKind::Spot { position, direction, inner_angle, outer_angle, falloff: kind } => {
            out.key("kind", quoted("spot"));
            out.key("position", vector(position));
            out.key("direction", vector(direction));
            out.key("inner_angle", number(degrees(inner_angle)));
            out.key("outer_angle", number(degrees(outer_angle)));
            out.key("falloff", falloff(kind));
        }
    }
    out.key("color", color(light.color));
}

/// Names that were used: those of a model may repeat or be empty, those of a scene file may not.
#[derive(Default)]
struct Names(std::collections::HashSet<String>);

impl Names {
    fn unique(&mut self, wanted: &str, otherwise: &str) -> String {
        let base = if wanted.is_empty() { otherwise } else { wanted };
        let numbered = (2..).map(|number| format!("{base} {number}"));
        let free = std::iter::once(base.to_owned()).chain(numbered).find(|name| !self.0.contains(name));
        let free = free.unwrap_or_default();
        self.0.insert(free.clone());
        free
    }
}

/// The angle in degrees that reads back as exactly this one, if there is one: degrees are coarser than radians, so that
/// angles that did not come from degrees may lie between two.
fn degrees(radians: f64) -> f64 {
    let near = radians.to_degrees();
    let (mut below, mut above) = (near, near);
    // Both conversions are correct to an ulp or two.
    for _ in 0..4 {
        if let Some(exact) = [below, above].into_iter().find(|candidate| candidate.to_radians() == radians) {
            return exact;
        }
        (below, above) = (below.next_down(), above.next_up());
    }
    near
}

/// The shortest digits that read back as the same f64, as a float.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn vector(v: DVec3) -> String {
    format!("[{}, {}, {}]", number(v.x), number(v.y), number(v.z))
}

/// The shortest digits that read back as the same f32, by way of f64 as the reader goes.
fn number_f32(value: f32) -> String {
    let short = format!("{value:?}");
    if short.parse::<f64>().is_ok_and(|read| read as f32 == value) { short } else { number(f64::from(value)) }
}

fn color(rgb: Rgb) -> String {
    format!("[{}, {}, {}]", number_f32(rgb.x), number_f32(rgb.y), number_f32(rgb.z))
}

fn weight(rgb: Rgb) -> String {
    if rgb == Rgb::splat(rgb.x) { number_f32(rgb.x) } else { color(rgb) }
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A path as seen from the scene file, quoted, with `/` between its parts.
fn relative(path: &Path, to: &Path) -> Result<String> {
    let relative = relative_to(path, to);
    let text = relative.to_str().ok_or_else(|| Error::caller("the path is not UTF-8").at_path(path))?;
    Ok(quoted(&if std::path::MAIN_SEPARATOR == '/' { text.to_owned() } else { text.replace('\\', "/") }))
}
