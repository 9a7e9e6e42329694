//! Values of a scene file with their places, and every way in which one can be wrong.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::Path;

use glam::{DVec2, DVec3};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, Result};
use crate::scene::Rgb;
use crate::scene::texture::srgb_to_linear;

/// The text of a scene file and its path.
#[derive(Debug)]
pub struct Source<'a> {
    /// For messages.
    pub path: &'a Path,
    /// All of it.
    pub text: &'a str,
}

impl Source<'_> {
    /// An error at a byte of the text: line and column count from 1, the column in characters.
    pub fn error(&self, at: usize, message: impl Into<String>) -> Error {
        let (line, column) = self.line_column(at);
        Error::file(message).at_path(self.path).at_line_column(line, column)
    }

    fn line_column(&self, at: usize) -> (usize, usize) {
        let before = self.text.get(..at).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// A value, the key it belongs to, and its place.
#[derive(Debug, Clone, Copy)]
pub struct Value<'a> {
    source: &'a Source<'a>,
    key: &'a str,
    at: usize,
    value: &'a DeValue<'a>,
}

impl<'a> Value<'a> {
    fn new(source: &'a Source<'a>, key: &'a str, value: &'a Spanned<DeValue<'a>>) -> Self {
        Self { source, key, at: value.span().start, value: value.get_ref() }
    }

    /// An error at this value.
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.source.error(self.at, message)
    }

    /// "`key` must be `expected`, not ...".
    fn mismatch(&self, expected: impl Display) -> Error {
        let found = match self.value {
            DeValue::String(text) => format!("{text:?}"),
            DeValue::Integer(number) => number.to_string(),
            DeValue::Float(number) => number.to_string(),
            DeValue::Boolean(value) => value.to_string(),
            DeValue::Datetime(_) => "a date".to_owned(),
            DeValue::Array(items) => format!("a list of {}", items.len()),
            DeValue::Table(_) => "a table".to_owned(),
        };
        self.error(format!("`{}` must be {expected}, not {found}", self.key))
    }

    /// The number, where this is one; whole numbers count, and so do infinities and NaN.
    fn as_number(&self) -> Option<f64> {
        match self.value {
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok().map(|n| n as f64),
            DeValue::Float(number) => number.as_str().parse().ok(),
            _ => None,
        }
    }

    /// Whether this is a table.
    pub fn is_table(&self) -> bool {
        matches!(self.value, DeValue::Table(_))
    }

    /// Whether this is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.value, DeValue::Array(_))
    }

    /// Whether this is a string.
    pub fn is_string(&self) -> bool {
        matches!(self.value, DeValue::String(_))
    }

    /// A finite number for which `accepts` holds; `expected` names it, as in "a number greater than 0".
    fn number_where(&self, expected: &str, accepts: impl Fn(f64) -> bool) -> Result<f64> {
        self.as_number().filter(|&n| n.is_finite() && accepts(n)).ok_or_else(|| self.mismatch(expected))
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64> {
        self.number_where("a number", |_| true)
    }

    /// A number, possibly infinite.
    pub fn extended_number(&self) -> Result<f64> {
        self.as_number().filter(|n| !n.is_nan()).ok_or_else(|| self.mismatch("a number or inf"))
    }

    /// A finite number greater than 0.
    pub fn positive(&self) -> Result<f64> {
        self.number_where("a number greater than 0", |n| n > 0.0)
    }

    /// A finite number, 0 or greater.
    pub fn non_negative(&self) -> Result<f64> {
        self.number_where("a number, 0 or greater", |n| n >= 0.0)
    }

    /// A number between two others, ends included.
    pub fn between(&self, range: RangeInclusive<f64>) -> Result<f64> {
        let expected = format!("a number from {} to {}", range.start(), range.end());
        self.number_where(&expected, |n| range.contains(&n))
    }

    /// A whole number between two others, ends included.
    pub fn whole(&self, range: RangeInclusive<u32>) -> Result<u32> {
        let number = match self.value {
            DeValue::Integer(number) => u32::from_str_radix(number.as_str(), number.radix()).ok(),
            _ => None,
        };
        let expected = || format!("a whole number from {} to {}", range.start(), range.end());
        number.filter(|n| range.contains(n)).ok_or_else(|| self.mismatch(expected()))
    }

    /// True or false.
    pub fn boolean(&self) -> Result<bool> {
        match self.value {
            DeValue::Boolean(value) => Ok(*value),
            _ => Err(self.mismatch("true or false")),
        }
    }

    /// A string.
    pub fn string(&self) -> Result<&'a str> {
        match self.value {
            DeValue::String(text) => Ok(text),
            _ => Err(self.mismatch("a string")),
        }
    }

    /// A string that is not empty.
    pub fn name(&self) -> Result<&'a str> {
        self.string().ok().filter(|text| !text.is_empty()).ok_or_else(|| self.mismatch("a name"))
    }

    /// One of some words.
    pub fn choice<T: Copy>(&self, words: &[(&str, T)]) -> Result<T> {
        let expected = || alternatives(words.iter().map(|(word, _)| format!("{word:?}")));
        let DeValue::String(text) = self.value else { return Err(self.mismatch(expected())) };
        words.iter().find(|(word, _)| word == text).map(|(_, value)| *value).ok_or_else(|| self.mismatch(expected()))
    }

    /// The values of a list; their key is the list's.
    pub fn list(&self) -> Result<Vec<Self>> {
        match self.value {
            DeValue::Array(items) => Ok(items.iter().map(|item| Value::new(self.source, self.key, item)).collect()),
            _ => Err(self.mismatch("a list")),
        }
    }

    /// A list of `N` finite numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N]> {
        let wrong = || self.mismatch(format_args!("{N} numbers"));
        let DeValue::Array(items) = self.value else { return Err(wrong()) };
        if items.len() != N {
            return Err(wrong());
        }
        let mut numbers = [0.0; N];
        for (number, item) in numbers.iter_mut().zip(items.iter()) {
            *number = Value::new(self.source, self.key, item).number()?;
        }
        Ok(numbers)
    }

    /// Three numbers.
    pub fn vector(&self) -> Result<DVec3> {
        self.numbers().map(DVec3::from_array)
    }

    /// Three numbers, not all 0.
    pub fn direction(&self) -> Result<DVec3> {
        let vector = self.vector()?;
        if vector == DVec3::ZERO {
            return Err(self.error(format!("`{}` must be a direction, not zero", self.key)));
        }
        Ok(vector)
    }

    /// Three numbers that may be infinite.
    pub fn extended_vector(&self) -> Result<DVec3> {
        match self.list()?.as_slice() {
            [x, y, z] => Ok(DVec3::new(x.extended_number()?, y.extended_number()?, z.extended_number()?)),
            _ => Err(self.mismatch("3 numbers")),
        }
    }

    /// Two numbers, or one that stands for both.
    pub fn pair(&self) -> Result<DVec2> {
        match self.as_number() {
            Some(_) => self.number().map(DVec2::splat),
            None => self.numbers().map(DVec2::from_array),
        }
    }

    /// A colour: three linear numbers, 0 or greater, or "#rrggbb" or "#rgb" in sRGB.
    pub fn color(&self) -> Result<Rgb> {
        const EXPECTED: &str = "a colour, as [r, g, b] in linear light or \"#rrggbb\"";
        match self.value {
            DeValue::String(text) => parse_hex_color(text).ok_or_else(|| self.mismatch(EXPECTED)),
            DeValue::Array(items) if items.len() == 3 => {
                let mut color = Rgb::ZERO;
                for (channel, item) in self.list()?.iter().enumerate() {
                    color[channel] = finite_f32(item, item.non_negative()?)?;
                }
                Ok(color)
            }
            _ => Err(self.mismatch(EXPECTED)),
        }
    }

    /// A colour, or a number for all three channels.
    pub fn weight(&self) -> Result<Rgb> {
        match self.as_number() {
            Some(_) => Ok(Rgb::splat(finite_f32(self, self.non_negative()?)?)),
            None => self.color(),
        }
    }

    /// A table with fields; `what` names it in messages, as in "a light".
    pub fn table(&self, what: &'a str) -> Result<Fields<'a>> {
        match self.value {
            DeValue::Table(table) => Ok(Fields { source: self.source, what, at: self.at, table }),
            _ => Err(self.mismatch("a table")),
        }
    }

    /// The tables of `[[key]]`, or the one of `[key]`.
    pub fn tables(&self, what: &'a str) -> Result<Vec<Fields<'a>>> {
        match self.value {
            DeValue::Array(_) => self.list()?.iter().map(|item| item.table(what)).collect(),
            _ => Ok(vec![self.table(what)?]),
        }
    }
}

/// A number that is finite as f32 too.
fn finite_f32(value: &Value<'_>, number: f64) -> Result<f32> {
    let narrow = number as f32;
    if narrow.is_finite() { Ok(narrow) } else { Err(value.mismatch("a number below 3e38")) }
}

/// "#rrggbb" or "#rgb" as linear values.
fn parse_hex_color(text: &str) -> Option<Rgb> {
    let digits: Vec<u32> = text.strip_prefix('#')?.chars().map(|c| c.to_digit(16)).collect::<Option<_>>()?;
    let bytes = match *digits.as_slice() {
        [r, g, b] => [r * 17, g * 17, b * 17],
        [r1, r0, g1, g0, b1, b0] => [r1 * 16 + r0, g1 * 16 + g0, b1 * 16 + b0],
        _ => return None,
    };
    Some(Rgb::from_array(bytes.map(|byte| srgb_to_linear(f64::from(byte) / 255.0) as f32)))
}

/// The fields of a table.
#[derive(Debug, Clone, Copy)]
pub struct Fields<'a> {
    source: &'a Source<'a>,
    what: &'a str,
    at: usize,
    table: &'a DeTable<'a>,
}

impl<'a> Fields<'a> {
    /// The whole file.
    pub fn root(source: &'a Source<'a>, table: &'a DeTable<'a>) -> Self {
        Self { source, what: "a scene", at: 0, table }
    }

    /// An error at the table's beginning.
    pub fn error(&self, message: impl Into<String>) -> Error {
        self.source.error(self.at, message)
    }

    /// Refuses fields other than these: the first in the file that is.
    pub fn accept(&self, keys: &[&str]) -> Result<()> {
        let unknown = self.table.iter().filter(|(key, _)| !keys.contains(&key.get_ref().as_ref()));
        let Some((key, _)) = unknown.min_by_key(|(key, _)| key.span().start) else { return Ok(()) };
        let error = self.source.error(key.span().start, format!("unknown key `{}` of {}", key.get_ref(), self.what));
        Err(error.remedy(suggestion(key.get_ref(), keys)))
    }

    /// Whether there is such a field.
    pub fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// The field, if it is there.
    pub fn get(&self, key: &str) -> Option<Value<'a>> {
        let (name, value) = self.table.iter().find(|(name, _)| name.get_ref() == key)?;
        Some(Value::new(self.source, name.get_ref(), value))
    }

    /// The field, which must be there.
    pub fn require(&self, key: &str) -> Result<Value<'a>> {
        self.get(key).ok_or_else(|| self.error(format!("{} needs `{key}`", self.what)))
    }

    /// The field read by `read`, or `default` where it is not there.
    pub fn or<T>(&self, key: &str, default: T, read: impl FnOnce(&Value<'a>) -> Result<T>) -> Result<T> {
        self.get(key).map_or(Ok(default), |value| read(&value))
    }
}

/// The known name that an unknown one may be meant for, and all that there are.
pub fn suggestion(unknown: &str, known: &[&str]) -> String {
    if known.is_empty() {
        return "there are none".to_owned();
    }
    let listed = known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    // Half of the letters wrong is another word.
    let closest = known.iter().min_by_key(|name| edit_distance(unknown, name));
    match closest.filter(|name| 2 * edit_distance(unknown, name) < unknown.len().max(3)) {
        Some(name) => format!("did you mean `{name}`? accepted are {listed}"),
        None => format!("accepted are {listed}"),
    }
}

/// How many letters must be inserted, deleted or replaced to turn one word into the other (Levenshtein).
fn edit_distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.chars().count()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.chars().enumerate() {
            let replaced = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[row.len() - 1]
}

/// "a, b or c".
fn alternatives(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => words.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_colors_are_srgb() {
        assert_eq!(parse_hex_color("#fff"), Some(Rgb::ONE));
        assert_eq!(parse_hex_color("#000000"), Some(Rgb::ZERO));
        // IEC 61966-2-1: 188 / 255 is 0.5029 in linear light.
        let grey = parse_hex_color("#bcBCbc").unwrap();
        assert!((grey - Rgb::splat(0.5029)).abs().max_element() < 1e-4);
        for wrong in ["fff", "#ff", "#gggggg", "#fffffff", "#+12345", ""] {
            assert_eq!(parse_hex_color(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn distances_and_suggestions() {
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(suggestion("colour", &["color", "kind"]), "did you mean `color`? accepted are `color`, `kind`");
        assert_eq!(suggestion("xyz", &["color", "kind"]), "accepted are `color`, `kind`");
    }

    #[test]
    fn columns_count_characters() {
        let source = Source { path: Path::new("a"), text: "é = 1\nxé = 2" };
        assert_eq!(source.line_column(source.text.find("= 2").unwrap()), (2, 4));
        assert_eq!(source.line_column(usize::MAX), (2, 7));
    }
}
