//! Serde's view of the tree: each value with the way to it, unknown keys noted on the side; it repairs nothing.

use std::cell::RefCell;

use serde::de::value::StrDeserializer;
use serde::de::{self, DeserializeSeed, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use super::error::{DecodeError, Mistake, Step};
use crate::document::problem::DocumentProblem;
use crate::document::tree::{Data, Entry, Table, Value};

/// The way from the decoded value to one inside it, as a list on the stack.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) above: Option<&'a Place<'a>>,
    pub(super) step: Option<StepRef<'a>>,
}

#[derive(Clone, Copy)]
pub(super) enum StepRef<'a> {
    Key(&'a str),
    Index(usize),
}

impl<'a> Place<'a> {
    fn path(&self) -> Vec<Step> {
        let mut path = self.above.map_or_else(Vec::new, Place::path);
        path.extend(self.step.map(|step| match step {
            StepRef::Key(key) => Step::Key(key.to_owned()),
            StepRef::Index(index) => Step::Index(index),
        }));
        path
    }

    fn below(&'a self, step: StepRef<'a>) -> Place<'a> {
        Place {
            above: Some(self),
            step: Some(step),
        }
    }
}

/// A value to be read.
#[derive(Clone, Copy)]
pub(super) struct TreeDeserializer<'a> {
    pub(super) value: &'a Value,
    pub(super) place: Place<'a>,
    pub(super) unknown: &'a RefCell<Vec<Mistake>>,
}

impl<'a> TreeDeserializer<'a> {
    fn located<T>(&self, result: Result<T, DecodeError>) -> Result<T, DecodeError> {
        result.map_err(|error| self.locate(error))
    }

    fn locate(&self, error: DecodeError) -> DecodeError {
        error.at(self.value, || self.place.path())
    }

    fn wrong_type<T>(&self, expected: &dyn de::Expected) -> Result<T, DecodeError> {
        self.located(Err(DecodeError::not_of(self.value, expected)))
    }

    fn any<'de, V: Visitor<'de>>(&self, visitor: V) -> Result<V::Value, DecodeError> {
        match &self.value.data {
            Data::Text(text) | Data::Time(text) => visitor.visit_str(text),
            Data::Integer(number) => visitor.visit_i64(*number),
            Data::Float(number) => visitor.visit_f64(*number),
            Data::Bool(truth) => visitor.visit_bool(*truth),
            Data::List(values) => visitor.visit_seq(ListAccess {
                of: self,
                values: values.iter().enumerate(),
            }),
            Data::Table(table) => visitor.visit_map(self.entries(table, None)),
        }
    }

    fn entries<'b>(
        &'b self,
        table: &'b Table,
        fields: Option<&'static [&'static str]>,
    ) -> TableAccess<'b> {
        TableAccess {
            of: self,
            entries: Box::new(table.iter()),
            fields,
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
            _ => self.wrong_type(&visitor),
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
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        self.located(visitor.visit_newtype_struct(self))
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
            _ => self.wrong_type(&visitor),
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
                _ => return self.wrong_type(&"the name of a choice, or a table with one key"),
            },
            _ => return self.wrong_type(&"the name of a choice"),
        };
        self.located(visitor.visit_enum(access))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 char bytes byte_buf unit unit_struct seq tuple tuple_struct map identifier ignored_any
    }
}

struct ListAccess<'b> {
    of: &'b TreeDeserializer<'b>,
    values: std::iter::Enumerate<std::slice::Iter<'b, Value>>,
}

impl<'de> de::SeqAccess<'de> for ListAccess<'_> {
    type Error = DecodeError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, DecodeError> {
        let Some((index, value)) = self.values.next() else {
            return Ok(None);
        };
        let place = self.of.place.below(StepRef::Index(index));
        let inner = TreeDeserializer {
            value,
            place,
            unknown: self.of.unknown,
        };
        inner.located(seed.deserialize(inner)).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len())
    }
}

struct TableAccess<'b> {
    of: &'b TreeDeserializer<'b>,
    entries: Box<dyn Iterator<Item = (&'b str, &'b Entry)> + 'b>,
    /// The keys that a struct has; other keys are noted and passed over.
    fields: Option<&'static [&'static str]>,
    current: Option<(&'b str, &'b Entry)>,
}

impl<'b> TableAccess<'b> {
    /// The next entry that is not of an unknown key.
    fn next_known(&mut self) -> Option<(&'b str, &'b Entry)> {
        for (key, entry) in self.entries.by_ref() {
            let Some(fields) = self.fields.filter(|fields| !fields.contains(&key)) else {
                return Some((key, entry));
            };
            let known = fields.iter().map(|field| (*field).to_owned()).collect();
            let problem = DocumentProblem::UnknownKey {
                key: key.to_owned(),
                what: String::new(),
                known,
            };
            self.of.unknown.borrow_mut().push(Mistake {
                path: self.of.place.below(StepRef::Key(key)).path(),
                place: entry.key,
                problem,
            });
        }
        None
    }

    fn at_key(&self, error: DecodeError, key: &str, entry: &Entry) -> DecodeError {
        let at_key = Value::new(entry.key, Data::Text(key.to_owned()));
        error.at(&at_key, || self.of.place.below(StepRef::Key(key)).path())
    }
}

impl<'de> de::MapAccess<'de> for TableAccess<'_> {
    type Error = DecodeError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, DecodeError> {
        self.current = self.next_known();
        let Some((key, entry)) = self.current else {
            return Ok(None);
        };
        let deserializer: StrDeserializer<'_, DecodeError> = key.into_deserializer();
        let read = seed.deserialize(deserializer).map(Some);
        read.map_err(|error| self.at_key(error, key, entry))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(
        &mut self,
        seed: S,
    ) -> Result<S::Value, DecodeError> {
        let Some((key, entry)) = self.current.take() else {
            return Err(de::Error::custom("a value was asked for before its key"));
        };
        let place = self.of.place.below(StepRef::Key(key));
        let inner = TreeDeserializer {
            value: &entry.value,
            place,
            unknown: self.of.unknown,
        };
        inner.located(seed.deserialize(inner))
    }
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
                Some(entry) => {
                    let at_key = Value::new(entry.key, Data::Text(self.name.to_owned()));
                    error.at(&at_key, || self.of.place.path())
                }
                None => error,
            })?;
        Ok((name, self))
    }
}

impl EnumAccess<'_> {
    fn content<T>(
        &self,
        expected: &dyn de::Expected,
        read: impl FnOnce(TreeDeserializer<'_>) -> Result<T, DecodeError>,
    ) -> Result<T, DecodeError> {
        let Some(entry) = self.content else {
            return self.of.located(Err(DecodeError::wrong_type(
                "its name alone".to_owned(),
                expected,
            )));
        };
        let place = self.of.place.below(StepRef::Key(self.name));
        let inner = TreeDeserializer {
            value: &entry.value,
            place,
            unknown: self.of.unknown,
        };
        inner.located(read(inner))
    }
}

impl<'de> de::VariantAccess<'de> for EnumAccess<'_> {
    type Error = DecodeError;

    fn unit_variant(self) -> Result<(), DecodeError> {
        match self.content {
            None => Ok(()),
            Some(_) => self.content(&"the name of this choice alone", |inner| {
                inner.wrong_type(&"the name of this choice alone")
            }),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(
        self,
        seed: T,
    ) -> Result<T::Value, DecodeError> {
        self.content(&"a table with this choice and its value", |inner| {
            seed.deserialize(inner)
        })
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, DecodeError> {
        self.content(&"a table with this choice and its values", |inner| {
            de::Deserializer::deserialize_any(inner, visitor)
        })
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, DecodeError> {
        self.content(&"a table with this choice and its keys", |inner| {
            de::Deserializer::deserialize_struct(inner, "", fields, visitor)
        })
    }
}
