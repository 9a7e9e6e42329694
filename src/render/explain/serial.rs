//! How numbers are written: every finite f32 and f64 reads back to its bits, and what JSON has no number for is a word.

use glam::{DVec2, DVec3};
use serde::{Serialize, Serializer};

use crate::scene::Rgb;

/// An f32 that JSON may not have a number for.
struct Value(f32);

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            value if value.is_finite() => serializer.serialize_f32(value),
            value => serializer.collect_str(&value),
        }
    }
}

/// Three numbers; `"inf"`, `"-inf"` or `"NaN"` where a channel is not finite.
pub fn color<S: Serializer>(color: &Rgb, serializer: S) -> Result<S::Ok, S::Error> {
    color.to_array().map(Value).serialize(serializer)
}

/// The same, or null.
pub fn color_if_any<S: Serializer>(color: &Option<Rgb>, serializer: S) -> Result<S::Ok, S::Error> {
    color.map(|color| color.to_array().map(Value)).serialize(serializer)
}

/// Three numbers.
pub fn vector<S: Serializer>(vector: &DVec3, serializer: S) -> Result<S::Ok, S::Error> {
    vector.to_array().serialize(serializer)
}

/// Two numbers.
pub fn place<S: Serializer>(place: &DVec2, serializer: S) -> Result<S::Ok, S::Error> {
    place.to_array().serialize(serializer)
}
