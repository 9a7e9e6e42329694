//! What can be done to a scene. Every change of it is one of these.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};
use toml::Value;

use crate::editor::document::Document;
use crate::editor::item::{Item, Kind};
use crate::editor::numbers::tidy_vector;
use crate::editor::placement::{Place, Placement, number, read_vector, vector};
use crate::error::{Error, Result};
use crate::math::transform::{apply, compose, point};

/// A change of a scene file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Sets a field, or takes it away where there is no value.
    Set {
        /// Whose.
        item: Item,
        /// The field; several names for one of a table in it.
        key: Vec<String>,
        /// What it becomes.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        value: Option<Value>,
    },
    /// Adds a camera, light, material, object or override at the end of its list.
    Add {
        /// What.
        kind: Kind,
        /// Its fields, in the order in which they are written.
        fields: Vec<(String, Value)>,
    },
    /// Takes items away, and the objects' references to materials that go.
    Remove(Vec<Item>),
    /// Adds copies of items, with names of their own.
    Duplicate(Vec<Item>),
    /// Gives an item another name; what refers to it follows.
    Rename {
        /// Which.
        item: Item,
        /// The name, which none of its kind may have.
        name: String,
    },
    /// Moves, turns or scales objects and lights in the scene.
    Move {
        /// What is moved.
        items: Vec<Item>,
        /// The map, column by column: what it does to x, y and z, and where it takes the origin.
        by: [f64; 12],
    },
    /// Several, one after the other.
    All(Vec<Self>),
}

impl Command {
    /// Sets a field.
    pub fn set(item: Item, key: &[&str], value: impl Into<Value>) -> Self {
        Self::Set { item, key: owned(key), value: Some(value.into()) }
    }

    /// Takes a field away.
    pub fn unset(item: Item, key: &[&str]) -> Self {
        Self::Set { item, key: owned(key), value: None }
    }

    /// Moves items by a map.
    pub fn moving(items: Vec<Item>, by: &DAffine3) -> Self {
        Self::Move { items, by: by.to_cols_array() }
    }

    /// A few words for menus: "Undo ...".
    pub fn label(&self) -> String {
        match self {
            Self::Set { item, key, .. } => {
                let field = key.last().map_or("", String::as_str).replace('_', " ");
                match item.kind {
                    Kind::Scene => format!("Set {field}"),
                    kind => format!("Set {field} of {}", kind.key()),
                }
            }
            Self::Add { kind, .. } => format!("Add {}", kind.key()),
            Self::Remove(items) => counted("Delete", items),
            Self::Duplicate(items) => counted("Duplicate", items),
            Self::Rename { item, .. } => format!("Rename {}", item.kind.key()),
            Self::Move { items, .. } => counted("Move", items),
            Self::All(commands) => commands.first().map_or_else(|| "Nothing".into(), Self::label),
        }
    }

    /// Changes a document.
    ///
    /// # Errors
    /// An item that is not there, a name that is taken, a map that is singular.
    pub fn apply(&self, document: &mut Document) -> Result<()> {
        match self {
            Self::Set { item, key, value } => document.set(*item, key, value.as_ref()),
            Self::Add { kind, .. } if !kind.is_list() => {
                Err(Error::caller(format!("there can be only one `{}`", kind.key())))
            }
            Self::Add { kind, fields } => {
                document.add(*kind, fields);
                Ok(())
            }
            Self::Remove(items) => remove(document, items),
            Self::Duplicate(items) => {
                for &item in items {
                    check(document, item)?;
                    document.duplicate(item);
                }
                Ok(())
            }
            Self::Rename { item, name } => rename(document, *item, name),
            Self::Move { items, by } => {
                let by = DAffine3::from_cols_array(by);
                items.iter().try_for_each(|&item| {
                    check(document, item)?;
                    match item.kind {
                        Kind::Object => move_object(document, item, &by),
                        Kind::Light => move_light(document, item, &by),
                        kind => Err(Error::caller(format!("a {} cannot be moved", kind.key()))),
                    }
                })
            }
            Self::All(commands) => commands.iter().try_for_each(|command| command.apply(document)),
        }
    }
}

fn owned(key: &[&str]) -> Vec<String> {
    key.iter().map(|&name| name.to_owned()).collect()
}

fn counted(what: &str, items: &[Item]) -> String {
    match items {
        [one] => format!("{what} {}", one.kind.key()),
        several => format!("{what} {} items", several.len()),
    }
}

fn check(document: &Document, item: Item) -> Result<()> {
    if item.kind.is_list() && item.index < document.count(item.kind) {
        return Ok(());
    }
    Err(Error::caller(format!("there is no {} {}", item.kind.key(), item.index + 1)))
}

fn remove(document: &mut Document, items: &[Item]) -> Result<()> {
    let mut items = items.to_vec();
    items.sort_unstable();
    items.dedup();
    items.iter().try_for_each(|&item| check(document, item))?;
    // From the end, so that positions stay.
    for &item in items.iter().rev() {
        if item.kind == Kind::Material
            && let Some(name) = document.string(item, "name")
        {
            each_user(document, &name, |document, user| document.set(user, &["material".into()], None))?;
        }
        document.remove(item);
    }
    Ok(())
}

/// Calls `change` for each object that has the material of a name.
fn each_user(
    document: &mut Document,
    material: &str,
    mut change: impl FnMut(&mut Document, Item) -> Result<()>,
) -> Result<()> {
    for index in 0..document.count(Kind::Object) {
        let object = Item::object(index);
        if document.string(object, "material").as_deref() == Some(material) {
            change(document, object)?;
        }
    }
    Ok(())
}

fn rename(document: &mut Document, item: Item, name: &str) -> Result<()> {
    check(document, item)?;
    let before = document.string(item, "name");
    if before.as_deref() == Some(name) {
        return Ok(());
    }
    if document.names(item.kind).iter().any(|taken| taken == name) {
        let error = Error::caller(format!("a second {} would be called `{name}`", item.kind.key()));
        return Err(error.remedy("names must differ"));
    }
    let name = Value::from(name);
    document.set(item, &["name".into()], Some(&name))?;
    match before.filter(|_| item.kind == Kind::Material) {
        Some(before) => {
            each_user(document, &before, |document, user| document.set(user, &["material".into()], Some(&name)))
        }
        None => Ok(()),
    }
}

/// Where an object stands: its own transform, which is what moves, and that of its first instance, which comes after.
pub fn place_of(document: &Document, object: Item) -> Result<(Place, DAffine3)> {
    let place = Place::read(document.value(object, &["transform"]).as_ref())?;
    let instance = match document.value(object, &["instances"]) {
        Some(Value::Array(instances)) => Place::read(instances.first())?.affine(),
        _ => DAffine3::IDENTITY,
    };
    Ok((place, instance))
}

fn move_object(document: &mut Document, object: Item, by: &DAffine3) -> Result<()> {
    let (place, instance) = place_of(document, object)?;
    let inverse = *crate::math::Transform::new(instance)?.to_object();
    // What the map does to the first instance, done to the object before.
    let own = compose(&inverse, &compose(by, &instance));
    let moved = match place {
        Place::Simple(placement) if own.matrix3 == DMat3::IDENTITY => {
            let translate = tidy_vector(placement.translate + own.translation);
            Place::Simple(Placement { translate, ..placement })
        }
        place => {
            let map = compose(&own, &place.affine());
            crate::math::Transform::new(map)?;
            match Place::of(&map) {
                Place::Simple(placement) => {
                    Place::Simple(Placement { translate: tidy_vector(placement.translate), ..placement })
                }
                sheared => sheared,
            }
        }
    };
    document.set(object, &["transform".into()], moved.write().as_ref())
}

fn move_light(document: &mut Document, light: Item, by: &DAffine3) -> Result<()> {
    for (key, is_place) in [("position", true), ("target", true), ("direction", false)] {
        let Some(before) = document.value(light, &[key]).as_ref().and_then(read_vector) else { continue };
        let after: DVec3 = if is_place { point(by, before) } else { apply(&by.matrix3, before) };
        if after != before {
            document.set(light, &[key.into()], Some(&vector(tidy_vector(after))))?;
        }
    }
    Ok(())
}

/// Whether two values are written differently but mean the same: 1 and 1.0.
pub(super) fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (Value::Table(a), Value::Table(b)) => {
            a.len() == b.len() && a.iter().all(|(key, a)| b.get(key).is_some_and(|b| same(a, b)))
        }
        _ => match (number(a), number(b)) {
            (Some(a), Some(b)) => a.to_bits() == b.to_bits() || a == b && a != 0.0,
            _ => a == b,
        },
    }
}
