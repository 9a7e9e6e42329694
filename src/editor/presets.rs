//! Materials to begin with, and what new objects and lights are.

use glam::DVec3;
use toml::Value;

use crate::editor::Command;
use crate::editor::document::Document;
use crate::editor::item::Kind;
use crate::editor::numbers::tidy_vector;
use crate::editor::placement::vector;
use crate::editor::window::actions::{NewLight, NewObject};

/// A material by name, with the fields that make it.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// What it is called.
    pub name: &'static str,
    /// Its fields, as a scene file has them.
    fields: &'static str,
}

/// Materials to begin with.
///
/// Gold's colour is its reflectance at normal incidence in linear Rec. 709, as glTF's sample materials have it; indices of refraction
/// are those of crown glass and of water at 20 degrees.
pub const PRESETS: [Preset; 6] = [
    Preset {
        name: "matte",
        fields: "diffuse = 0.8\nspecular = 1.0\nks = 0.0\nshininess = 32.0\nkr = 0.0\nkt = 0.0\nior = 1.5",
    },
    Preset {
        name: "plastic",
        fields: "diffuse = 0.6\nspecular = 1.0\nks = 0.5\nshininess = 60.0\nkr = 0.04\nkt = 0.0\nior = 1.5",
    },
    Preset {
        name: "chrome",
        fields: "diffuse = 0.05\nspecular = 1.0\nks = 0.6\nshininess = 200.0\nkr = 0.75\nkt = 0.0\nior = 1.5",
    },
    Preset {
        name: "gold",
        fields: "diffuse = [0.25, 0.16, 0.04]\nspecular = [1.0, 0.77, 0.34]\nks = 0.7\nshininess = 80.0\nkr = [0.6, 0.46, 0.2]\nkt = 0.0\nior = 1.5",
    },
    Preset {
        name: "glass",
        fields: "diffuse = 0.02\nspecular = 1.0\nks = 0.3\nshininess = 200.0\nkr = 0.1\nkt = 0.85\nior = 1.52",
    },
    Preset {
        name: "water",
        fields: "diffuse = [0.01, 0.02, 0.03]\nspecular = 1.0\nks = 0.2\nshininess = 120.0\nkr = 0.05\nkt = [0.85, 0.9, 0.92]\nior = 1.333",
    },
];

impl Preset {
    /// Its fields.
    pub fn fields(&self) -> Vec<(String, Value)> {
        lines(self.fields)
    }
}

/// Fields given as lines, in their order.
fn lines(text: &str) -> Vec<(String, Value)> {
    let field = |line: &str| {
        let table: toml::Table = line.parse().ok()?;
        table.into_iter().next()
    };
    text.lines().filter_map(field).collect()
}

/// What adds an object of some size at a place.
pub fn add_object(document: &Document, object: NewObject, place: DVec3, size: f64) -> Command {
    let s = size;
    let text = match object {
        NewObject::Sphere => format!("sphere = {{ radius = {s:?} }}"),
        NewObject::Ellipsoid => format!("ellipsoid = {{ radii = [{:?}, {:?}, {:?}] }}", 1.5 * s, s, 0.75 * s),
        NewObject::Cylinder => {
            format!("cylinder = {{ base = [0.0, {:?}, 0.0], top = [0.0, {s:?}, 0.0], radius = {:?} }}", -s, 0.6 * s)
        }
        NewObject::Cone => {
            format!("cone = {{ base = [0.0, {:?}, 0.0], apex = [0.0, {s:?}, 0.0], radius = {:?} }}", -s, 0.8 * s)
        }
        NewObject::Paraboloid => {
            format!("paraboloid = {{ apex = [0.0, {:?}, 0.0], base = [0.0, {s:?}, 0.0], radius = {:?} }}", -s, 0.8 * s)
        }
        NewObject::HyperboloidOneSheet => format!(
            "hyperboloid_one_sheet = {{ radius = {0:?}, height = {0:?}, from = {1:?}, to = {2:?} }}",
            0.5 * s,
            -s,
            s
        ),
        NewObject::HyperboloidTwoSheets => {
            format!("hyperboloid_two_sheets = {{ radius = {0:?}, height = {0:?}, limit = {1:?} }}", 0.4 * s, s)
        }
        NewObject::Plane => format!("plane = {{ size = {:?} }}", 4.0 * s),
        // An ellipsoid, whose numbers are to be changed.
        NewObject::Quadric => format!(
            "quadric = {{ coefficients = [1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, {:?}], clip = {{ min = [{1:?}, {1:?}, {1:?}], max = [{2:?}, {2:?}, {2:?}] }} }}",
            -s * s,
            -2.0 * s,
            2.0 * s
        ),
        NewObject::Box => "builtin = \"box\"".into(),
        NewObject::Torus => "builtin = \"torus\"".into(),
        NewObject::Teapot => "builtin = \"teapot\"".into(),
    };
    let title = NewObject::ALL.iter().find(|(known, _)| *known == object).map_or("object", |(_, title)| title);
    let wanted = title.split(',').next().unwrap_or(title).to_lowercase();
    let mut fields = vec![("name".to_owned(), Value::from(document.free_name(Kind::Object, &wanted)))];
    fields.extend(lines(&text));
    // Meshes are about 2 long; the teapot is 6.
    let scale = match object {
        NewObject::Teapot => 0.35 * s,
        NewObject::Box | NewObject::Torus => s,
        _ => 1.0,
    };
    let step = |key: &str, value: Value| Value::Table([(key.to_owned(), value)].into_iter().collect());
    let mut steps = Vec::new();
    if scale != 1.0 {
        steps.push(step("scale", Value::Float(scale)));
    }
    if place != DVec3::ZERO {
        steps.push(step("translate", vector(tidy_vector(place))));
    }
    if !steps.is_empty() {
        fields.push(("transform".to_owned(), Value::Array(steps)));
    }
    Command::Add { kind: Kind::Object, fields }
}

/// The fields of a light that shines at a place from some distance.
pub fn light(document: &Document, light: NewLight, target: DVec3, distance: f64) -> Vec<(String, Value)> {
    let position = tidy_vector(target + DVec3::new(0.6, 1.0, 0.4) * distance);
    let text = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let (name, text) = match light {
        NewLight::Point => ("point", format!("kind = \"point\"\nposition = {}", text(position))),
        NewLight::Directional => ("sun", "kind = \"directional\"\ndirection = [-0.5, -1.0, -0.4]".to_owned()),
        NewLight::Spot => (
            "spot",
            format!(
                "kind = \"spot\"\nposition = {}\ntarget = {}\ninner_angle = 15.0\nouter_angle = 25.0",
                text(position),
                text(tidy_vector(target))
            ),
        ),
    };
    let mut fields = vec![("name".to_owned(), Value::from(document.free_name(Kind::Light, name)))];
    fields.extend(lines(&text));
    fields.extend(lines("color = [0.6, 0.6, 0.6]"));
    fields
}
