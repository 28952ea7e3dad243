//! Serde's view of the tree: each value with the keys to it, unknown keys noted on the side.

use std::cell::RefCell;

use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeSeed, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use super::error::{Cause, DecodeError, Mistake};
use crate::document::problem::UnknownKey;
use crate::document::tree::{Data, Entry, Table, Value};

/// The keys from the decoded value to one inside it, as a list on the stack; the elements of a list have those of the list.
#[derive(Clone, Copy)]
struct Way<'a> {
    above: Option<&'a Way<'a>>,
    key: &'a str,
}

impl Way<'_> {
    fn keys(&self) -> Vec<String> {
        let mut keys = self.above.map_or_else(Vec::new, Way::keys);
        keys.push(self.key.to_owned());
        keys
    }
}

/// A value to be read.
#[derive(Clone, Copy)]
pub(super) struct TreeDeserializer<'a> {
    value: &'a Value,
    way: Option<&'a Way<'a>>,
    unknown: &'a RefCell<Vec<Mistake>>,
}

impl<'a> TreeDeserializer<'a> {
    /// Reads a value; unknown keys go to `unknown`.
    pub(super) fn new(value: &'a Value, unknown: &'a RefCell<Vec<Mistake>>) -> Self {
        let way = None;
        Self {
            value,
            way,
            unknown,
        }
    }

    fn keys(&self) -> Vec<String> {
        self.way.map_or_else(Vec::new, Way::keys)
    }

    /// Reads a value inside of this one.
    fn inside<T>(
        &self,
        key: &str,
        value: &Value,
        read: impl FnOnce(TreeDeserializer<'_>) -> Result<T, DecodeError>,
    ) -> Result<T, DecodeError> {
        let way = Way {
            above: self.way,
            key,
        };
        let inner = TreeDeserializer {
            value,
            way: Some(&way),
            unknown: self.unknown,
        };
        inner.located(read(inner))
    }

    fn located<T>(&self, result: Result<T, DecodeError>) -> Result<T, DecodeError> {
        result.map_err(|error| self.locate(error))
    }

    fn locate(&self, error: DecodeError) -> DecodeError {
        error.at(self.value, || self.keys())
    }

    fn wrong_type<T>(&self, expected: &str) -> Result<T, DecodeError> {
        let found = self.value.found();
        self.located(Err(DecodeError::wrong_type(found, expected, None)))
    }

    fn any<'de, V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, DecodeError> {
        match &self.value.data {
            Data::Text(text) | Data::Time(text) => visitor.visit_str(text),
            Data::Integer(number) => visitor.visit_i64(*number),
            Data::Float(number) => visitor.visit_f64(*number),
            Data::Bool(truth) => visitor.visit_bool(*truth),
            Data::List(values) => visitor.visit_seq(ListAccess {
                of: self,
                values: values.iter(),
            }),
            Data::Table(table) => visitor.visit_map(self.entries(table, None)),
        }
    }

    /// The entries of a table; of a struct those that are none of its `fields` are noted, and passed over.
    fn entries<'b>(
        &'b self,
        table: &'b Table,
        fields: Option<&'static [&'static str]>,
    ) -> TableAccess<'b> {
        let is_known = move |key: &str| fields.is_none_or(|fields| fields.contains(&key));
        for (key, entry) in table.iter().filter(|(key, _)| !is_known(key)) {
            let known = fields.into_iter().flatten();
            let unknown = UnknownKey {
                key: key.to_owned(),
                what: String::new(),
                known: known.map(|field| (*field).to_owned()).collect(),
            };
            self.unknown.borrow_mut().push(Mistake {
                keys: self.keys(),
                place: entry.key,
                cause: Cause::UnknownKey(unknown),
            });
        }
        TableAccess {
            of: self,
            entries: Box::new(table.iter().filter(move |(key, _)| is_known(key))),
            current: None,
        }
    }
}

impl<'de> de::Deserializer<'de> for TreeDeserializer<'_> {
    type Error = DecodeError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        self.located(self.any(visitor))
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        match &self.value.data {
            Data::Text(text) | Data::Time(text) => self.located(visitor.visit_str(text)),
            _ => self.wrong_type("a text in quotes"),
        }
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        self.deserialize_str(visitor)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        // Models store these three as texts, since JSON has no other way.
        let number = match self.value.as_text() {
            Some("NaN") => f64::NAN,
            Some("inf") => f64::INFINITY,
            Some("-inf") => f64::NEG_INFINITY,
            _ => return self.deserialize_any(visitor),
        };
        self.located(visitor.visit_f64(number))
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, DecodeError> {
        self.located(visitor.visit_some(self))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        match DecodeError::in_place_of(name, self.value) {
            Some(error) => self.located(Err(error)),
            None => self.located(visitor.visit_newtype_struct(self)),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        match &self.value.data {
            Data::Table(table) => {
                self.located(visitor.visit_map(self.entries(table, Some(fields))))
            }
            _ => self.wrong_type("a table"),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        let access = match &self.value.data {
            Data::Text(name) => EnumAccess {
                of: &self,
                name,
                content: None,
            },
            Data::Table(table) => match table.iter().next() {
                Some((name, entry)) if table.len() == 1 => EnumAccess {
                    of: &self,
                    name,
                    content: Some(entry),
                },
                _ => return self.wrong_type("the name of a choice, or a table with one key"),
            },
            _ => return self.wrong_type("the name of a choice"),
        };
        self.located(visitor.visit_enum(access))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 char bytes byte_buf unit unit_struct seq tuple tuple_struct map identifier ignored_any
    }
}

struct ListAccess<'b> {
    of: &'b TreeDeserializer<'b>,
    values: std::slice::Iter<'b, Value>,
}

impl<'de> de::SeqAccess<'de> for ListAccess<'_> {
    type Error = DecodeError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, DecodeError> {
        let Some(value) = self.values.next() else {
            return Ok(None);
        };
        let inner = TreeDeserializer { value, ..*self.of };
        inner.located(seed.deserialize(inner)).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len())
    }
}

struct TableAccess<'b> {
    of: &'b TreeDeserializer<'b>,
    entries: Box<dyn Iterator<Item = (&'b str, &'b Entry)> + 'b>,
    current: Option<(&'b str, &'b Entry)>,
}

impl<'de> de::MapAccess<'de> for TableAccess<'_> {
    type Error = DecodeError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, DecodeError> {
        self.current = self.entries.next();
        let Some((key, entry)) = self.current else {
            return Ok(None);
        };
        let deserializer: StrDeserializer<'_, DecodeError> = key.into_deserializer();
        let read = seed.deserialize(deserializer).map(Some);
        read.map_err(|error| at_key(error, key, entry, || self.of.keys()))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<S::Value, DecodeError> {
        let Some((key, entry)) = self.current.take() else {
            return Err(de::Error::custom("a value was asked for before its key"));
        };
        self.of
            .inside(key, &entry.value, |inner| seed.deserialize(inner))
    }
}

/// Places an error at a key.
fn at_key(
    error: DecodeError,
    key: &str,
    entry: &Entry,
    keys: impl FnOnce() -> Vec<String>,
) -> DecodeError {
    error.at(&Value::new(entry.key, Data::Text(key.to_owned())), keys)
}

struct EnumAccess<'b> {
    of: &'b TreeDeserializer<'b>,
    name: &'b str,
    content: Option<&'b Entry>,
}

impl<'de> de::EnumAccess<'de> for EnumAccess<'_> {
    type Error = DecodeError;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(
        self,
        seed: V,
    ) -> Result<(V::Value, Self), DecodeError> {
        let deserializer: StrDeserializer<'_, DecodeError> = self.name.into_deserializer();
        let name = seed
            .deserialize(deserializer)
            .map_err(|error| match self.content {
                Some(entry) => at_key(error, self.name, entry, || self.of.keys()),
                None => error,
            })?;
        Ok((name, self))
    }
}

impl EnumAccess<'_> {
    fn content<T>(
        &self,
        expected: &str,
        read: impl FnOnce(TreeDeserializer<'_>) -> Result<T, DecodeError>,
    ) -> Result<T, DecodeError> {
        let Some(entry) = self.content else {
            let found = "its name alone".to_owned();
            let error = DecodeError::wrong_type(found, expected, None);
            return self.of.located(Err(error));
        };
        self.of.inside(self.name, &entry.value, read)
    }
}

impl<'de> de::VariantAccess<'de> for EnumAccess<'_> {
    type Error = DecodeError;

    fn unit_variant(self) -> Result<(), DecodeError> {
        match self.content {
            None => Ok(()),
            Some(_) => self.content("the name of this choice alone", |inner| {
                inner.wrong_type("the name of this choice alone")
            }),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(
        self,
        seed: T,
    ) -> Result<T::Value, DecodeError> {
        self.content("a table with this choice and its value", |inner| {
            seed.deserialize(inner)
        })
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, DecodeError> {
        self.content("a table with this choice and its values", |inner| {
            de::Deserializer::deserialize_any(inner, visitor)
        })
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        self.content("a table with this choice and its keys", |inner| {
            de::Deserializer::deserialize_struct(inner, "", fields, visitor)
        })
    }
}
