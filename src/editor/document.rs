//! The text of a scene file, changed one value at a time: what is not changed keeps its layout and comments.

use std::path::Path;

use toml::Value;
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item as Entry, Table, TableLike};

use crate::editor::item::{Item, Kind};
use crate::error::{Error, Result};
use crate::formats::atomic_file::relative_to;

/// A scene file's text with its structure.
#[derive(Debug, Clone, Default)]
pub struct Document {
    toml: DocumentMut,
}

impl Document {
    /// A text's.
    ///
    /// # Errors
    /// A text that is not TOML.
    pub fn parse(text: &str) -> Result<Self> {
        let toml = text.parse::<DocumentMut>();
        Ok(Self { toml: toml.map_err(|cause| Error::file(cause.message().to_owned()))? })
    }

    /// The text.
    pub fn text(&self) -> String {
        self.toml.to_string()
    }

    /// How many tables of a kind there are.
    pub fn count(&self, kind: Kind) -> usize {
        match self.toml.get(kind.key()) {
            Some(Entry::ArrayOfTables(tables)) => tables.len(),
            Some(Entry::Value(toml_edit::Value::Array(array))) => array.len(),
            Some(entry) if entry.is_table_like() => 1,
            _ => 0,
        }
    }

    /// A table's fields; `None` if it is not there.
    pub fn fields(&self, item: Item) -> Option<&dyn TableLike> {
        if item.kind == Kind::Scene {
            return Some(self.toml.as_table());
        }
        match self.toml.get(item.kind.key())? {
            Entry::ArrayOfTables(tables) => tables.get(item.index).map(|table| table as &dyn TableLike),
            Entry::Value(toml_edit::Value::Array(array)) => {
                array.get(item.index)?.as_inline_table().map(|table| table as &dyn TableLike)
            }
            entry => entry.as_table_like().filter(|_| item.index == 0),
        }
    }

    fn fields_mut(&mut self, item: Item) -> Option<&mut dyn TableLike> {
        if item.kind == Kind::Scene {
            return Some(self.toml.as_table_mut());
        }
        if !item.kind.is_list() && !self.toml.contains_key(item.kind.key()) {
            self.toml.insert(item.kind.key(), Entry::Table(Table::new()));
        }
        match self.toml.get_mut(item.kind.key())? {
            Entry::ArrayOfTables(tables) => tables.get_mut(item.index).map(|table| table as &mut dyn TableLike),
            Entry::Value(toml_edit::Value::Array(array)) => {
                array.get_mut(item.index)?.as_inline_table_mut().map(|table| table as &mut dyn TableLike)
            }
            entry => entry.as_table_like_mut().filter(|_| item.index == 0),
        }
    }

    /// The value of a field, or of a field of a table in it, and so on.
    pub fn value(&self, item: Item, key: &[&str]) -> Option<Value> {
        let (first, rest) = key.split_first()?;
        let mut entry = self.fields(item)?.get(first)?;
        for key in rest {
            entry = entry.as_table_like()?.get(key)?;
        }
        plain(entry)
    }

    /// A string field.
    pub fn string(&self, item: Item, key: &str) -> Option<String> {
        Some(self.fields(item)?.get(key)?.as_str()?.to_owned())
    }

    /// The names of a kind's tables, in order; empty for those that have none.
    pub fn names(&self, kind: Kind) -> Vec<String> {
        (0..self.count(kind)).map(|index| self.string(Item::new(kind, index), "name").unwrap_or_default()).collect()
    }

    /// A name that no table of the kind has, as near to the wanted one as can be: "sphere", "sphere 2", ...
    pub fn free_name(&self, kind: Kind, wanted: &str) -> String {
        let taken = self.names(kind);
        let base = wanted.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end();
        let base = if base.is_empty() { wanted } else { base };
        let numbered = (2..).map(|number| format!("{base} {number}"));
        let mut candidates = [wanted.to_owned(), base.to_owned()].into_iter().chain(numbered);
        candidates.find(|name| !taken.contains(name)).unwrap_or_default()
    }

    /// Sets a field, or takes it away; the tables on the way to it are made where they are not there. A comment behind the value
    /// stays.
    ///
    /// # Errors
    /// A table that is not there.
    pub fn set(&mut self, item: Item, key: &[String], value: Option<&Value>) -> Result<()> {
        let missing = || Error::caller(format!("there is no {} {}", item.kind.key(), item.index + 1));
        let Some((last, way)) = key.split_last() else { return Err(Error::caller("a field needs a name")) };
        let mut fields = self.fields_mut(item).ok_or_else(missing)?;
        for step in way {
            let entry = fields.entry(step).or_insert(Entry::Value(InlineTable::new().into()));
            if let Some(file) = entry.as_str().map(str::to_owned) {
                // `texture = "file"` is short for a table.
                let mut table = InlineTable::new();
                table.insert("file", file.into());
                *entry = Entry::Value(table.into());
            }
            fields = entry.as_table_like_mut().ok_or_else(|| {
                Error::caller(format!("`{step}` of {} {} is no table", item.kind.key(), item.index + 1))
            })?;
        }
        match value {
            None => {
                fields.remove(last);
            }
            Some(value) => put(fields, last, value),
        }
        Ok(())
    }

    /// Adds a table at the end of its kind's.
    pub fn add(&mut self, kind: Kind, fields: &[(String, Value)]) {
        let mut table = Table::new();
        for (key, value) in fields {
            put(&mut table, key, value);
        }
        self.push(kind, table);
    }

    fn push(&mut self, kind: Kind, mut table: Table) {
        table.set_position(None);
        let is_first = self.toml.is_empty() && table.decor().prefix().is_none();
        if !is_first && table.decor().prefix().and_then(|prefix| prefix.as_str()).is_none_or(|text| text.is_empty()) {
            table.decor_mut().set_prefix("\n");
        }
        let entry = self.toml.entry(kind.key()).or_insert_with(|| Entry::ArrayOfTables(ArrayOfTables::new()));
        match entry {
            Entry::ArrayOfTables(tables) => tables.push(table),
            Entry::Value(toml_edit::Value::Array(array)) => array.push(table.into_inline_table()),
            single => {
                // `[camera]` becomes the first `[[camera]]`.
                let mut tables = ArrayOfTables::new();
                if let Ok(first) = std::mem::take(single).into_table() {
                    tables.push(first);
                }
                tables.push(table);
                *single = Entry::ArrayOfTables(tables);
            }
        }
    }

    /// Takes a table away.
    pub fn remove(&mut self, item: Item) {
        let key = item.kind.key();
        let is_empty = match self.toml.get_mut(key) {
            Some(Entry::ArrayOfTables(tables)) => {
                if item.index < tables.len() {
                    tables.remove(item.index);
                }
                tables.is_empty()
            }
            Some(Entry::Value(toml_edit::Value::Array(array))) => {
                if item.index < array.len() {
                    array.remove(item.index);
                }
                array.is_empty()
            }
            Some(_) => item.index == 0,
            None => false,
        };
        if is_empty {
            self.toml.remove(key);
        }
    }

    /// Adds a copy of a table, with a name of its own, at the end.
    pub fn duplicate(&mut self, item: Item) {
        let name = self.string(item, "name");
        let Some(fields) = self.fields(item) else { return };
        let mut copy = Table::new();
        for (key, entry) in fields.iter() {
            copy.insert(key, entry.clone());
        }
        if let Some(name) = name {
            let free = self.free_name(item.kind, &name);
            put(&mut copy, "name", &Value::String(free));
        }
        self.push(item.kind, copy);
    }

    /// Changes the paths of files so that they lead from another scene file to the same files.
    pub fn rebase(&mut self, from: &Path, to: &Path) {
        let folder = from.parent().unwrap_or(Path::new(""));
        let moved = |path: &str| {
            let moved = relative_to(&folder.join(path), to);
            moved.to_str().map_or_else(|| path.to_owned(), |text| text.replace('\\', "/"))
        };
        let change = |fields: &mut dyn TableLike, key: &str| {
            if let Some(path) = fields.get(key).and_then(Entry::as_str) {
                let value = Value::String(moved(path));
                put(fields, key, &value);
            }
        };
        for (kind, key) in [(Kind::Object, "mesh"), (Kind::Material, "texture"), (Kind::Override, "texture")] {
            for index in 0..self.count(kind) {
                let Some(fields) = self.fields_mut(Item::new(kind, index)) else { continue };
                change(fields, key);
                if let Some(table) = fields.get_mut(key).and_then(Entry::as_table_like_mut) {
                    change(table, "file");
                }
            }
        }
        if self.count(Kind::Background) > 0
            && let Some(fields) = self.fields_mut(Item::only(Kind::Background))
        {
            change(fields, "image");
        }
    }
}

/// Sets a value and keeps what stands around the one before.
fn put(fields: &mut dyn TableLike, key: &str, value: &Value) {
    let mut new = edited(value);
    match fields.get_mut(key) {
        Some(Entry::Value(old)) => {
            *new.decor_mut() = old.decor().clone();
            *old = new;
        }
        Some(other) => *other = Entry::Value(new),
        None => {
            fields.insert(key, Entry::Value(new));
        }
    }
}

/// A value as it is written on one line.
fn edited(value: &Value) -> toml_edit::Value {
    match value {
        Value::String(text) => text.as_str().into(),
        Value::Integer(number) => (*number).into(),
        Value::Float(number) => (*number).into(),
        Value::Boolean(value) => (*value).into(),
        Value::Datetime(date) => date.to_string().into(),
        Value::Array(items) => items.iter().map(edited).collect::<Array>().into(),
        Value::Table(table) => {
            let mut inline = InlineTable::new();
            for (key, value) in table {
                inline.insert(key, edited(value));
            }
            inline.into()
        }
    }
}

/// A value without its layout.
fn plain(entry: &Entry) -> Option<Value> {
    fn of_value(value: &toml_edit::Value) -> Option<Value> {
        Some(match value {
            toml_edit::Value::String(text) => Value::String(text.value().clone()),
            toml_edit::Value::Integer(number) => Value::Integer(*number.value()),
            toml_edit::Value::Float(number) => Value::Float(*number.value()),
            toml_edit::Value::Boolean(value) => Value::Boolean(*value.value()),
            toml_edit::Value::Datetime(_) => return None,
            toml_edit::Value::Array(items) => Value::Array(items.iter().map(of_value).collect::<Option<_>>()?),
            toml_edit::Value::InlineTable(table) => {
                let fields = table.iter().map(|(key, value)| Some((key.to_owned(), of_value(value)?)));
                Value::Table(fields.collect::<Option<_>>()?)
            }
        })
    }
    match entry {
        Entry::Value(value) => of_value(value),
        Entry::Table(table) => {
            let fields = table.iter().map(|(key, entry)| Some((key.to_owned(), plain(entry)?)));
            Some(Value::Table(fields.collect::<Option<_>>()?))
        }
        Entry::ArrayOfTables(tables) => {
            let each = tables.iter().map(|table| plain(&Entry::Table(table.clone())));
            Some(Value::Array(each.collect::<Option<_>>()?))
        }
        Entry::None => None,
    }
}
