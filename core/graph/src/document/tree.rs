//! A file as a tree of values that know where they stand; what the values mean is decided by the reader of each table.

use std::sync::Arc;

use indexmap::IndexMap;

use crate::diagnostic::Place;

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// Where it stands; for a table with a header, the header.
    pub place: Place,
    /// What it is.
    pub data: Data,
}

/// What a value is.
#[derive(Debug, Clone, PartialEq)]
pub enum Data {
    /// A text.
    Text(String),
    /// A whole number.
    Integer(i64),
    /// A number with a fraction or an exponent; may be NaN or infinite.
    Float(f64),
    /// True or false.
    Bool(bool),
    /// A date or time as TOML writes it, without quotes.
    Time(String),
    /// A list.
    List(Vec<Value>),
    /// A table.
    Table(Table),
}

impl Data {
    /// What was found, for an error: `the number 5`, `the text "abc"`, `a list`.
    pub(crate) fn found(&self) -> String {
        match self {
            Data::Text(text) => match text.char_indices().nth(60) {
                Some((end, _)) => format!("the text \"{}\u{2026}\"", &text[..end]),
                None => format!("the text \"{text}\""),
            },
            Data::Integer(number) => format!("the number {number}"),
            Data::Float(number) => format!("the number {number}"),
            Data::Bool(truth) => format!("{truth}"),
            Data::Time(time) => format!("the time {time}"),
            Data::List(_) => "a list".to_owned(),
            Data::Table(_) => "a table".to_owned(),
        }
    }

    /// Whether it is a number of either sort.
    pub fn is_number(&self) -> bool {
        matches!(self, Self::Integer(_) | Self::Float(_))
    }
}

/// A key of a table with its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Where the key stands.
    pub key: Place,
    /// The value.
    pub value: Value,
}

/// Keys and values in the order of the file. Copies share their entries until one of them is changed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    entries: Arc<IndexMap<String, Entry>>,
}

impl Table {
    /// An empty table.
    pub fn new() -> Self {
        Self::default()
    }

    /// The value of a key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.entries.get(key).map(|entry| &entry.value)
    }

    /// The value of a key, to be changed.
    pub fn get_mut(&mut self, key: &str) -> Option<&mut Value> {
        Arc::make_mut(&mut self.entries)
            .get_mut(key)
            .map(|entry| &mut entry.value)
    }

    /// A key's place and value.
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.get(key)
    }

    /// Puts a value under a key; one that is there already keeps its position in the order.
    pub fn insert(&mut self, key: impl Into<String>, entry: Entry) -> Option<Entry> {
        Arc::make_mut(&mut self.entries).insert(key.into(), entry)
    }

    /// Takes a key out; the order of the others stays.
    pub fn remove(&mut self, key: &str) -> Option<Entry> {
        Arc::make_mut(&mut self.entries).shift_remove(key)
    }

    /// True if both are copies of one table, neither changed since.
    pub fn is_copy_of(&self, other: &Table) -> bool {
        Arc::ptr_eq(&self.entries, &other.entries)
    }

    /// True if the key is there.
    pub fn contains(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    /// Keys and values in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Entry)> {
        self.entries
            .iter()
            .map(|(key, entry)| (key.as_str(), entry))
    }

    /// Keys and values in order, the values to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (&str, &mut Entry)> {
        Arc::make_mut(&mut self.entries)
            .iter_mut()
            .map(|(key, entry)| (key.as_str(), entry))
    }

    /// Keys in order.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// Number of keys.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True without any key.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

impl IntoIterator for Table {
    type Item = (String, Entry);
    type IntoIter = indexmap::map::IntoIter<String, Entry>;
    fn into_iter(self) -> Self::IntoIter {
        Arc::unwrap_or_clone(self.entries).into_iter()
    }
}

impl FromIterator<(String, Entry)> for Table {
    fn from_iter<I: IntoIterator<Item = (String, Entry)>>(entries: I) -> Self {
        Table {
            entries: Arc::new(entries.into_iter().collect()),
        }
    }
}

impl Value {
    /// A value at a place.
    pub fn new(place: Place, data: Data) -> Self {
        Value { place, data }
    }

    /// Where the value of a key stands; the value itself, where it is no table or has no such key.
    pub fn place_of(&self, key: &str) -> Place {
        let value = self.as_table().and_then(|keys| keys.get(key));
        value.map_or(self.place, |value| value.place)
    }

    /// The same tree with another value in the place of each text.
    pub(super) fn with_texts(&self, of: &mut dyn FnMut(&str, Place) -> Value) -> Value {
        let data = match &self.data {
            Data::Text(text) => return of(text, self.place),
            Data::List(values) => {
                let values = values.iter().map(|value| value.with_texts(&mut *of));
                Data::List(values.collect())
            }
            Data::Table(table) => {
                let entries = table.iter().map(|(key, entry)| {
                    let value = entry.value.with_texts(&mut *of);
                    let place = entry.key;
                    (key.to_owned(), Entry { key: place, value })
                });
                Data::Table(entries.collect())
            }
            other => other.clone(),
        };
        Value::new(self.place, data)
    }

    /// Whether one of the texts in it fits; each is given with its place, up to that one.
    pub(super) fn any_text(&self, fits: &mut dyn FnMut(&str, Place) -> bool) -> bool {
        match &self.data {
            Data::Text(text) => fits(text, self.place),
            Data::List(values) => values.iter().any(|value| value.any_text(&mut *fits)),
            Data::Table(table) => {
                let mut entries = table.iter();
                entries.any(|(_, entry)| entry.value.any_text(&mut *fits))
            }
            _ => false,
        }
    }

    /// Whether a table in it has one of these keys.
    pub(super) fn has_key(&self, keys: &[&str]) -> bool {
        let table = self.as_table().into_iter().flat_map(Table::iter);
        table
            .into_iter()
            .any(|(key, entry)| keys.contains(&key) || entry.value.has_key(keys))
    }

    /// The text, if it is one.
    pub fn as_text(&self) -> Option<&str> {
        match &self.data {
            Data::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The whole number, if it is one.
    pub fn as_integer(&self) -> Option<i64> {
        match self.data {
            Data::Integer(number) => Some(number),
            _ => None,
        }
    }

    /// The truth value, if it is one.
    pub fn as_bool(&self) -> Option<bool> {
        match self.data {
            Data::Bool(truth) => Some(truth),
            _ => None,
        }
    }

    /// The list, if it is one.
    pub fn as_list(&self) -> Option<&[Value]> {
        match &self.data {
            Data::List(values) => Some(values),
            _ => None,
        }
    }

    /// The table, if it is one.
    pub fn as_table(&self) -> Option<&Table> {
        match &self.data {
            Data::Table(table) => Some(table),
            _ => None,
        }
    }

    /// The table, if it is one, to be changed.
    pub fn as_table_mut(&mut self) -> Option<&mut Table> {
        match &mut self.data {
            Data::Table(table) => Some(table),
            _ => None,
        }
    }

    /// As `Data::found`.
    pub fn found(&self) -> String {
        self.data.found()
    }
}
