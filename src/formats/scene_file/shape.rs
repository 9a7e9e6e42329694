//! The shapes of `[[object]]` that are quadrics: each becomes a canonical quadric and a transform that places it.

use glam::{DAffine3, DMat3, DVec3};

use crate::error::Result;
use crate::formats::scene_file::value::{Fields, Value};
use crate::geometry::mesh::LARGEST_COORDINATE;
use crate::geometry::quadric::{Clip, Quadric};
use crate::geometry::shapes;
use crate::math::vector::{basis, length, normalize};

/// The keys that give an object's shape.
pub const SHAPES: [&str; 12] = [
    "mesh",
    "builtin",
    "sphere",
    "ellipsoid",
    "cylinder",
    "cone",
    "paraboloid",
    "hyperboloid_one_sheet",
    "hyperboloid_two_sheets",
    "saddle",
    "plane",
    "quadric",
];

/// A quadric and the transform from its canonical space to the object's.
pub type PlacedQuadric = (Quadric, DAffine3);

/// The quadric that `key`, one of [`SHAPES`] but `mesh` and `builtin`, describes.
///
/// # Errors
/// The first mistake, and radii and heights below 2^-40: in units of theirs the rest of the shape may be beyond what
/// numbers hold. Whether the shape is too large is for the caller to find.
pub fn read_quadric(key: &str, value: &Value<'_>) -> Result<PlacedQuadric> {
    const SMALLEST: f64 = 1.0 / LARGEST_COORDINATE as f64;
    let (quadric, transform) = read_shape(key, value)?;
    let axes = transform.matrix3;
    if [axes.x_axis, axes.y_axis, axes.z_axis].map(length).iter().any(|&size| size < SMALLEST) {
        let error = value.error(format!("the shape `{key}` is too small"));
        return Err(error.remedy("sizes must lie between 2^-40 and 2^40"));
    }
    Ok((quadric, transform))
}

fn read_shape(key: &str, value: &Value<'_>) -> Result<PlacedQuadric> {
    match key {
        "sphere" => sphere(&value.table("a sphere")?),
        "ellipsoid" => ellipsoid(&value.table("an ellipsoid")?),
        "cylinder" => cylinder(&value.table("a cylinder")?),
        "cone" => cone(&value.table("a cone")?),
        "paraboloid" => paraboloid(&value.table("a paraboloid")?),
        "hyperboloid_one_sheet" => hyperboloid_one_sheet(&value.table("a hyperboloid of one sheet")?),
        "hyperboloid_two_sheets" => hyperboloid_two_sheets(&value.table("a hyperboloid of two sheets")?),
        "saddle" => saddle(&value.table("a saddle")?),
        "plane" => plane(&value.table("a plane")?),
        _ => general(&value.table("a quadric")?),
    }
}

fn sphere(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["center", "radius"])?;
    let radius = fields.or("radius", 1.0, Value::positive)?;
    Ok((shapes::sphere(), scaled(DVec3::splat(radius), center(fields)?)))
}

fn ellipsoid(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["center", "radii"])?;
    let radii = fields.require("radii")?;
    let size = radii.vector()?;
    if size.min_element() <= 0.0 {
        return Err(radii.error("`radii` must be greater than 0"));
    }
    Ok((shapes::sphere(), scaled(size, center(fields)?)))
}

fn cylinder(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["base", "top", "radius", "open"])?;
    Ok((shapes::cylinder(open(fields)?), between(fields, "base", "top")?))
}

fn cone(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["base", "apex", "radius", "open"])?;
    Ok((shapes::cone(open(fields)?), between(fields, "base", "apex")?))
}

fn paraboloid(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["apex", "base", "radius", "open"])?;
    Ok((shapes::paraboloid(open(fields)?), between(fields, "apex", "base")?))
}

fn hyperboloid_one_sheet(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["center", "axis", "radius", "height", "from", "to", "open"])?;
    let (transform, height) = revolved(fields)?;
    let from = fields.or("from", -1.0, Value::number)?;
    let to = fields.or("to", 1.0, |value| {
        let to = value.number()?;
        if to > from { Ok(to) } else { Err(value.error("`to` must be greater than `from`")) }
    })?;
    Ok((shapes::hyperboloid_one_sheet(from / height, to / height, open(fields)?), transform))
}

fn hyperboloid_two_sheets(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["center", "axis", "radius", "height", "limit", "open"])?;
    let (transform, height) = revolved(fields)?;
    let limit = fields.or("limit", 2.0 * height, |value| {
        let limit = value.number()?;
        if limit > height { Ok(limit) } else { Err(value.error("`limit` must be greater than `height`")) }
    })?;
    Ok((shapes::hyperboloid_two_sheets(limit / height, open(fields)?), transform))
}

fn saddle(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["center", "half_size"])?;
    let half_size = fields.or("half_size", 1.0, Value::positive)?;
    Ok((shapes::saddle(half_size), scaled(DVec3::ONE, center(fields)?)))
}

fn plane(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["point", "normal", "size"])?;
    let point = fields.or("point", DVec3::ZERO, Value::vector)?;
    let normal = fields.or("normal", DVec3::Y, Value::direction)?;
    let half_size = fields.get("size").map(|size| size.positive()).transpose()?.map(|size| 0.5 * size);
    Ok((shapes::plane(half_size), upright(1.0, normalize(normal).unwrap_or(DVec3::Y), 1.0, point)))
}

fn general(fields: &Fields<'_>) -> Result<PlacedQuadric> {
    fields.accept(&["coefficients", "matrix", "clip", "solid"])?;
    let clip = fields.get("clip").map(|clip| read_clip(&clip)).transpose()?;
    let solid = fields.or("solid", false, Value::boolean)?;
    let quadric = match (fields.get("coefficients"), fields.get("matrix")) {
        (Some(coefficients), None) => Quadric::new(coefficients.numbers()?, clip, solid),
        (None, Some(matrix)) => Quadric::from_matrix(matrix.numbers()?, clip, solid),
        _ => return Err(fields.error("a quadric needs either `coefficients` or `matrix`")),
    };
    Ok((quadric.map_err(|error| fields.error(error.message()))?, DAffine3::IDENTITY))
}

/// A box whose sides may be left out or infinite.
fn read_clip(value: &Value<'_>) -> Result<Clip> {
    let fields = value.table("a clip box")?;
    fields.accept(&["min", "max"])?;
    let min = fields.or("min", Clip::NONE.min, Value::extended_vector)?;
    let max = fields.or("max", Clip::NONE.max, Value::extended_vector)?;
    if !min.cmplt(max).all() {
        return Err(value.error("the clip box is empty").remedy("`min` must be less than `max` along each axis"));
    }
    Ok(Clip { min, max })
}

fn center(fields: &Fields<'_>) -> Result<DVec3> {
    fields.or("center", DVec3::ZERO, Value::vector)
}

fn open(fields: &Fields<'_>) -> Result<bool> {
    fields.or("open", false, Value::boolean)
}

fn scaled(size: DVec3, translation: DVec3) -> DAffine3 {
    DAffine3 { matrix3: DMat3::from_diagonal(size), translation }
}

/// Takes the y axis to `height` times the unit vector `axis` and the others to a length of `radius`; axes along +Y stay
/// where they are.
fn upright(radius: f64, axis: DVec3, height: f64, translation: DVec3) -> DAffine3 {
    let (x, minus_z) = basis(axis);
    DAffine3 { matrix3: DMat3::from_cols(x * radius, axis * height, minus_z * -radius), translation }
}

/// Places y = 0 at the point `start` and y = 1 at the point `end`, radius 1 at `radius`.
fn between(fields: &Fields<'_>, start: &str, end: &str) -> Result<DAffine3> {
    let (from, to) = (fields.require(start)?.vector()?, fields.require(end)?);
    let along = to.vector()? - from;
    let radius = fields.or("radius", 1.0, Value::positive)?;
    let axis = normalize(along).ok_or_else(|| to.error(format!("`{start}` and `{end}` are the same point")))?;
    Ok(upright(radius, axis, length(along), from))
}

/// The placement of a hyperboloid of revolution and its `height`.
fn revolved(fields: &Fields<'_>) -> Result<(DAffine3, f64)> {
    let axis = fields.or("axis", DVec3::Y, Value::direction)?;
    let radius = fields.or("radius", 1.0, Value::positive)?;
    let height = fields.or("height", 1.0, Value::positive)?;
    Ok((upright(radius, normalize(axis).unwrap_or(DVec3::Y), height, center(fields)?), height))
}
