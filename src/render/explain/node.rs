//! What is told of a ray: where it went, what it met, and what that adds up to.

use glam::DVec3;
use serde::Serialize;

use super::serial;
use crate::scene::Rgb;

/// A ray and what it saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RayNode {
    /// The ray that it came of, by its position in the list; `None` for the camera's.
    pub parent: Option<usize>,
    /// Why it was traced.
    pub way: Way,
    /// Reflections and refractions before it.
    pub depth: u32,
    /// Where it starts.
    #[serde(serialize_with = "serial::vector")]
    pub origin: DVec3,
    /// Unit direction.
    #[serde(serialize_with = "serial::vector")]
    pub direction: DVec3,
    /// What it went past, since the surface is not there.
    pub holes: Vec<Found>,
    /// Where it ends.
    pub end: End,
    /// What it saw.
    #[serde(serialize_with = "serial::color")]
    pub color: Rgb,
}

/// Why a ray was traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// It comes from the camera.
    Camera,
    /// By a mirror.
    Reflected,
    /// Through a surface, by Snell's law.
    Refracted,
    /// It met a surface that light goes through, but at an angle at which all of it is reflected.
    TotalReflection,
}

/// Where a ray ends.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Nowhere.
    Background {
        /// What the scene has behind everything.
        kind: BackgroundKind,
        /// What is seen of it.
        #[serde(serialize_with = "serial::color")]
        color: Rgb,
    },
    /// On a surface.
    Surface(Box<Surface>),
}

/// What a scene has behind everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BackgroundKind {
    /// One colour.
    Color,
    /// From one colour to another.
    Gradient,
    /// An image all around.
    Image,
    /// Nothing: black, and not counted into alpha.
    Transparent,
}

/// What was hit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// The object's name; empty if it has none.
    pub object: String,
    /// The object's number, in the order of the file.
    pub instance: u32,
    /// The triangle's or surface's number.
    pub primitive: u32,
    /// The name that the file gives to this part of the mesh, if it gives any.
    pub part: Option<String>,
    /// The material's name.
    pub material: String,
    /// Where along the ray, as the search found it: in units of the ray's direction, which is of unit length but for shadow
    /// rays to a light at a place, which is at 1.
    pub t: f32,
}

/// A point of a surface and its sum.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Surface {
    /// What was hit.
    pub found: Found,
    /// What was found first, where that is a surface by which the ray leaves a solid that it entered here, nearer than
    /// rounding can tell.
    pub instead_of: Option<Found>,
    /// Where, solved again in f64.
    #[serde(serialize_with = "serial::vector")]
    pub point: DVec3,
    /// Unit normal of the true surface, on the side that the ray came from.
    #[serde(serialize_with = "serial::vector")]
    pub geometric_normal: DVec3,
    /// Unit normal that shades, on the same side.
    #[serde(serialize_with = "serial::vector")]
    pub normal: DVec3,
    /// Whether the ray came from outside.
    pub from_outside: bool,
    /// What is done to 0, in this order.
    pub terms: Vec<Term>,
}

/// One step of a sum, per channel, in f32.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "term", rename_all = "snake_case")]
pub enum Term {
    /// Oa is what the sum begins with.
    Ambient {
        /// Oa.
        #[serde(serialize_with = "serial::color")]
        color: Rgb,
    },
    /// What the surface emits is added.
    Emission {
        /// That.
        #[serde(serialize_with = "serial::color")]
        color: Rgb,
    },
    /// What a light adds.
    Light(LightTerm),
    /// What is seen over a way is added, times a weight.
    Seen {
        /// By mirror or through the surface.
        way: Way,
        /// kr or kt.
        #[serde(serialize_with = "serial::color")]
        weight: Rgb,
        /// The ray, by its position in the list; `None` where the largest depth is reached: then nothing is added.
        ray: Option<usize>,
        /// The weight times the ray's colour.
        #[serde(serialize_with = "serial::color")]
        added: Rgb,
    },
    /// The ray came through what absorbs: the sum is multiplied by what that leaves (Beer's law).
    Absorbed {
        /// How far the ray came.
        length: f64,
        /// `exp(-absorption length)`
        #[serde(serialize_with = "serial::color")]
        left: Rgb,
    },
    /// The sum is clamped to 1: the film's `clamp = "shade"`. Told even where it changes nothing.
    Clamped {
        /// The sum before.
        #[serde(serialize_with = "serial::color")]
        from: Rgb,
        /// And after.
        #[serde(serialize_with = "serial::color")]
        to: Rgb,
    },
}

/// What a light adds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LightTerm {
    /// The light's number, in the order of the file.
    pub number: usize,
    /// Its name.
    pub light: String,
    /// How it reaches the point.
    pub lighting: Lighting,
    /// What it adds; 0 where nothing is added.
    #[serde(serialize_with = "serial::color")]
    pub added: Rgb,
}

/// How a light reaches a point.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lighting {
    /// It does not shine there.
    Dark(Dark),
    /// It does, unless something is between.
    Shines(Box<Arrival>),
}

/// Why a light does not shine at a point; no shadow ray is traced then.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dark {
    /// It is behind the surface.
    Behind {
        /// N.L, not greater than 0.
        n_dot_l: f64,
    },
    /// The point is outside the cone of a spot.
    OutsideCone,
    /// The light is at the point: they cannot be told apart.
    AtThePoint,
    /// It is so near that f32 has no number for its brightness.
    TooBright,
}

/// What comes of a light that shines at a point: `Si Ipi [(1 - kt) Od (N.L) + ks Os (R.V)^n]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Arrival {
    /// L, a unit vector.
    #[serde(serialize_with = "serial::vector")]
    pub to_light: DVec3,
    /// How far the light is; `None` if it is infinitely far.
    pub distance: Option<f64>,
    /// Ipi, weakened by distance and cone.
    #[serde(serialize_with = "serial::color")]
    pub color: Rgb,
    /// N.L
    pub n_dot_l: f64,
    /// R.V, where the material has a highlight.
    pub r_dot_v: Option<f64>,
    /// `(1 - kt) Od (N.L)`
    #[serde(serialize_with = "serial::color")]
    pub diffuse: Rgb,
    /// `ks Os (R.V)^n`, where R.V is positive; else there is nothing to add.
    #[serde(serialize_with = "serial::color_if_any")]
    pub specular: Option<Rgb>,
    /// Si. Where it is 0 nothing is added.
    #[serde(serialize_with = "serial::color")]
    pub visible: Rgb,
    /// What is between that is not opaque as a whole, in the order in which Si is multiplied; not looked for where something
    /// opaque is between.
    pub crossed: Vec<Crossing>,
    /// What keeps all of the light away.
    pub blocked_by: Option<Stop>,
}

/// Something between a light and a point that lets light through, all of it where it is not there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Crossing {
    /// What is there, and how far on the way.
    #[serde(flatten)]
    pub stop: Stop,
    /// kt, by which Si is multiplied.
    #[serde(serialize_with = "serial::color")]
    pub passes: Rgb,
    /// How far the light went inside before this, where that is absorbed.
    pub length: Option<f64>,
    /// What is left after that, by which Si is multiplied next.
    #[serde(serialize_with = "serial::color_if_any")]
    pub left: Option<Rgb>,
}

/// A surface on the way to a light.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stop {
    /// The surface. Its t is the share of the way to the light, 0 at the point and 1 at the light; where the light is
    /// infinitely far it is the distance.
    pub found: Found,
    /// How far it is from the point.
    pub distance: f64,
}
