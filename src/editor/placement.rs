//! Where an object stands, as its `transform` says it and as people edit it.

use glam::{DAffine3, DMat3, DVec3};
use toml::Value;

use crate::editor::numbers::{tidy, tidy_vector};
use crate::error::Result;
use crate::formats::scene_file::parse_transform;
use crate::math::transform::rotation_xyz;
use crate::math::vector::{cross, dot, length};

/// Scaled, then turned about the x, the y and the z axis, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Where the object's origin is.
    pub translate: DVec3,
    /// Degrees.
    pub rotate: DVec3,
    /// Factors along the object's axes; none is 0.
    pub scale: DVec3,
}

/// An object's `transform`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// As the fields of a panel.
    Simple(Placement),
    /// Sheared, which no three fields say.
    Matrix(DAffine3),
}

impl Placement {
    /// Where the object's shape itself is.
    pub const NONE: Self = Self { translate: DVec3::ZERO, rotate: DVec3::ZERO, scale: DVec3::ONE };

    /// The map from the object's coordinates to the scene's.
    pub fn affine(&self) -> DAffine3 {
        let radians = DVec3::from_array(self.rotate.to_array().map(f64::to_radians));
        let matrix3 = rotation_xyz(radians) * DMat3::from_diagonal(self.scale);
        DAffine3 { matrix3, translation: self.translate }
    }

    /// The placement that a map is, unless it shears.
    pub fn of(map: &DAffine3) -> Option<Self> {
        /// A few roundings of f64, beyond which axes are not at right angles.
        const ROUNDING: f64 = 64.0 * f64::EPSILON;
        let m = &map.matrix3;
        let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
        let mut scale = DVec3::new(length(x), length(y), length(z));
        let is_square = |a: DVec3, b: DVec3, size: f64| dot(a, b).abs() <= ROUNDING * size;
        if !(is_square(x, y, scale.x * scale.y)
            && is_square(y, z, scale.y * scale.z)
            && is_square(z, x, scale.z * scale.x)
            && scale.min_element() > 0.0)
        {
            return None;
        }
        if dot(x, cross(y, z)) < 0.0 {
            scale = -scale;
        }
        let (x, y, z) = (x / scale.x, y / scale.y, z / scale.z);
        // Of Rz Ry Rx the first column is (cz cy, sz cy, -sy).
        let about_y = libm::asin((-x.z).clamp(-1.0, 1.0));
        let (about_x, about_z) = if x.x == 0.0 && x.y == 0.0 {
            // Straight up or down, x and z turn about the same line.
            (0.0, libm::atan2(-y.x, y.y))
        } else {
            (libm::atan2(y.z, z.z), libm::atan2(x.y, x.x))
        };
        // Angles that rounding keeps from 0.
        let degrees = |radians: f64| if radians.abs() < ROUNDING { 0.0 } else { tidy(radians.to_degrees()) };
        let rotate = DVec3::new(about_x, about_y, about_z).to_array().map(degrees);
        Some(Self { translate: map.translation, rotate: DVec3::from_array(rotate), scale: tidy_vector(scale) })
    }
}

impl Place {
    /// What the value of `transform` says.
    ///
    /// # Errors
    /// A value that a scene file may not have.
    pub fn read(value: Option<&Value>) -> Result<Self> {
        let Some(value) = value else { return Ok(Self::Simple(Placement::NONE)) };
        if let Some(simple) = simple(value) {
            return Ok(Self::Simple(simple));
        }
        parse_transform(&format!("transform = {value}")).map(|map| Self::of(&map))
    }

    /// A map.
    pub fn of(map: &DAffine3) -> Self {
        Placement::of(map).map_or(Self::Matrix(*map), Self::Simple)
    }

    /// The map from the object's coordinates to the scene's, or to those of its instances.
    pub fn affine(&self) -> DAffine3 {
        match self {
            Self::Simple(placement) => placement.affine(),
            Self::Matrix(map) => *map,
        }
    }

    /// The value of `transform`; nothing for an object that stands where its shape is.
    pub fn write(&self) -> Option<Value> {
        let step = |key: &str, value: Value| Value::Table([(key.to_owned(), value)].into_iter().collect());
        let steps = match self {
            Self::Matrix(map) => {
                let (m, t) = (&map.matrix3, map.translation);
                let columns = [(m.x_axis, 0.0), (m.y_axis, 0.0), (m.z_axis, 0.0), (t, 1.0)];
                let numbers = columns.iter().flat_map(|(column, last)| [column.x, column.y, column.z, *last]);
                vec![step("matrix", Value::Array(numbers.map(Value::Float).collect()))]
            }
            Self::Simple(Placement { translate, rotate, scale }) => {
                let mut steps = Vec::new();
                if *scale == DVec3::splat(scale.x) && scale.x != 1.0 {
                    steps.push(step("scale", Value::Float(scale.x)));
                } else if *scale != DVec3::ONE {
                    steps.push(step("scale", vector(*scale)));
                }
                if *rotate != DVec3::ZERO {
                    steps.push(step("rotate", vector(*rotate)));
                }
                if *translate != DVec3::ZERO {
                    steps.push(step("translate", vector(*translate)));
                }
                steps
            }
        };
        match steps.len() {
            0 => None,
            1 => steps.into_iter().next(),
            _ => Some(Value::Array(steps)),
        }
    }
}

/// Steps that are a placement as they stand: each at most once, in its order.
fn simple(value: &Value) -> Option<Placement> {
    let steps = match value {
        Value::Array(steps) => steps.as_slice(),
        one => std::slice::from_ref(one),
    };
    let mut placement = Placement::NONE;
    let mut before = 0;
    for step in steps {
        let table = step.as_table()?;
        let (key, value) = table.iter().next().filter(|_| table.len() == 1)?;
        let (order, field) = match key.as_str() {
            "scale" => (1, &mut placement.scale),
            "rotate" => (2, &mut placement.rotate),
            "translate" => (3, &mut placement.translate),
            _ => return None,
        };
        if order <= before {
            return None;
        }
        before = order;
        *field = match (key.as_str(), number(value)) {
            ("scale", Some(factor)) => DVec3::splat(factor),
            _ => read_vector(value)?,
        };
    }
    Some(placement)
}

/// Three numbers as a value.
pub fn vector(v: DVec3) -> Value {
    Value::Array(v.to_array().map(Value::Float).to_vec())
}

/// A number, whole or not.
pub fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

/// Three numbers.
pub fn read_vector(value: &Value) -> Option<DVec3> {
    match value.as_array()?.as_slice() {
        [x, y, z] => Some(DVec3::new(number(x)?, number(y)?, number(z)?)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Place {
        let table: toml::Table = text.parse().unwrap();
        Place::read(table.get("transform")).unwrap()
    }

    #[test]
    fn steps_in_their_order_are_the_fields() {
        let placement = Placement {
            translate: DVec3::new(1.0, 2.0, 3.0),
            rotate: DVec3::new(10.0, 20.0, 30.0),
            scale: DVec3::splat(2.0),
        };
        let text = "transform = [{ scale = 2 }, { rotate = [10, 20, 30] }, { translate = [1, 2, 3] }]";
        assert_eq!(read(text), Place::Simple(placement));
        assert_eq!(Place::read(Place::Simple(placement).write().as_ref()).unwrap(), Place::Simple(placement));
        assert_eq!(read(""), Place::Simple(Placement::NONE));
        assert_eq!(Place::Simple(Placement::NONE).write(), None);
        assert_eq!(parse_transform(text).unwrap(), placement.affine());
    }

    #[test]
    fn maps_come_apart_into_the_fields_that_make_them() {
        for (rotate, scale) in [
            ([10.0, 20.0, 30.0], [1.0, 2.0, 3.0]),
            ([-170.0, 80.0, 12.5], [-1.0, -1.0, -1.0]),
            ([0.0, 90.0, 45.0], [1.0, 1.0, 1.0]),
            ([0.0, -90.0, 30.0], [2.0, 1.0, 1.0]),
            ([0.0, 0.0, 180.0], [1e-9, 1e9, 1.0]),
        ] {
            let made = Placement { translate: DVec3::X, rotate: rotate.into(), scale: scale.into() };
            let map = made.affine();
            let found = Placement::of(&map).unwrap();
            let again = found.affine();
            let error = |a: DVec3, b: DVec3| length(a - b) / length(a);
            assert!(error(map.matrix3.x_axis, again.matrix3.x_axis) < 1e-14, "{made:?} {found:?}");
            assert!(error(map.matrix3.y_axis, again.matrix3.y_axis) < 1e-14, "{made:?} {found:?}");
            assert!(error(map.matrix3.z_axis, again.matrix3.z_axis) < 1e-14, "{made:?} {found:?}");
        }
    }

    #[test]
    fn other_orders_and_shears_are_read_as_they_are() {
        let moved_then_scaled = read("transform = [{ translate = [1, 0, 0] }, { scale = 2 }]");
        let expected = Placement { translate: DVec3::X * 2.0, scale: DVec3::splat(2.0), ..Placement::NONE };
        assert_eq!(moved_then_scaled, Place::Simple(expected));
        let text = "transform = [{ rotate = [0, 0, 45] }, { scale = [1, 2, 1] }]";
        let sheared = read(text);
        assert!(matches!(sheared, Place::Matrix(_)));
        assert_eq!(sheared.affine(), parse_transform(text).unwrap());
        assert_eq!(Place::read(sheared.write().as_ref()).unwrap(), sheared);
        assert!(Place::read(Some(&Value::Boolean(true))).is_err());
    }
}
