//! Decides which of several forms a parameter is written in; not what any of them means.

use std::fmt;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer, StrDeserializer};
use serde::de::{Error, IgnoredAny, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};

/// The forms in which one parameter may be written, such as a number or a table: what a kind's own `Deserialize` reads
/// where a derived untagged enum would forget what was wrong with either form, and where.
///
/// ```
/// use athermal_core::node::Forms;
/// use serde::{Deserialize, Deserializer};
///
/// #[derive(Debug, PartialEq)]
/// enum Penalty {
///     Fixed(f64),
///     Chosen(Choice),
/// }
///
/// #[derive(Debug, PartialEq, Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Choice {
///     folds: usize,
/// }
///
/// impl<'de> Deserialize<'de> for Penalty {
///     fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
///         Forms::new("a number or a table with `folds`")
///             .number(Self::Fixed)
///             .table(Self::Chosen)
///             .read(deserializer)
///     }
/// }
///
/// let read = |text| serde_json::from_str::<Penalty>(text);
/// assert_eq!(read("2").unwrap(), Penalty::Fixed(2.0));
/// assert_eq!(read(r#"{"folds": 3}"#).unwrap(), Penalty::Chosen(Choice { folds: 3 }));
/// let wrong = read("true").unwrap_err().to_string();
/// assert!(wrong.contains("expected a number or a table with `folds`"), "{wrong}");
/// ```
pub struct Forms<T, Text = IgnoredAny, List = IgnoredAny, Table = IgnoredAny> {
    plain: Plain<T>,
    text: Option<fn(Text) -> T>,
    list: Option<fn(List) -> T>,
    table: Option<fn(Table) -> T>,
}

/// The forms that need no reading of their own, and what names all.
struct Plain<T> {
    expected: &'static str,
    truth: Option<fn(bool) -> T>,
    whole: Option<fn(usize) -> T>,
    number: Option<fn(f64) -> T>,
}

impl<T> Forms<T> {
    /// None yet; `expected` names all of them, as a message ends that finds another.
    #[must_use]
    pub fn new(expected: &'static str) -> Self {
        Self {
            plain: Plain {
                expected,
                truth: None,
                whole: None,
                number: None,
            },
            text: None,
            list: None,
            table: None,
        }
    }
}

impl<T, Text, List, Table> Forms<T, Text, List, Table> {
    /// And `true` or `false`.
    #[must_use]
    pub fn truth(mut self, of: fn(bool) -> T) -> Self {
        self.plain.truth = Some(of);
        self
    }

    /// And a whole number, 0 or more.
    #[must_use]
    pub fn whole(mut self, of: fn(usize) -> T) -> Self {
        self.plain.whole = Some(of);
        self
    }

    /// And a number.
    #[must_use]
    pub fn number(mut self, of: fn(f64) -> T) -> Self {
        self.plain.number = Some(of);
        self
    }

    /// And a text, which is read as any type that a text says.
    #[must_use]
    pub fn text<X>(self, of: fn(X) -> T) -> Forms<T, X, List, Table> {
        Forms {
            plain: self.plain,
            text: Some(of),
            list: self.list,
            table: self.table,
        }
    }

    /// And a list.
    #[must_use]
    pub fn list<X>(self, of: fn(X) -> T) -> Forms<T, Text, X, Table> {
        Forms {
            plain: self.plain,
            text: self.text,
            list: Some(of),
            table: self.table,
        }
    }

    /// And a table.
    #[must_use]
    pub fn table<X>(self, of: fn(X) -> T) -> Forms<T, Text, List, X> {
        Forms {
            plain: self.plain,
            text: self.text,
            list: self.list,
            table: Some(of),
        }
    }

    /// What is written.
    ///
    /// # Errors
    ///
    /// None of these forms, or a mistake within the one that is there.
    pub fn read<'de, D: Deserializer<'de>>(self, deserializer: D) -> Result<T, D::Error>
    where
        Text: Deserialize<'de>,
        List: Deserialize<'de>,
        Table: Deserialize<'de>,
    {
        deserializer.deserialize_any(self)
    }
}

impl<T> Plain<T> {
    fn number<E: Error>(&self, number: f64, found: Unexpected<'_>) -> Result<T, E> {
        match self.number {
            Some(of) => Ok(of(number)),
            None => Err(E::invalid_type(found, &self.expected)),
        }
    }
}

impl<'de, T, Text, List, Table> Visitor<'de> for Forms<T, Text, List, Table>
where
    Text: Deserialize<'de>,
    List: Deserialize<'de>,
    Table: Deserialize<'de>,
{
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.plain.expected)
    }

    fn visit_bool<E: Error>(self, truth: bool) -> Result<T, E> {
        match self.plain.truth {
            Some(of) => Ok(of(truth)),
            None => Err(E::invalid_type(Unexpected::Bool(truth), &self)),
        }
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<T, E> {
        match self.plain.whole {
            Some(of) => Ok(of(usize::try_from(number).unwrap_or(usize::MAX))),
            None => self
                .plain
                .number(number as f64, Unexpected::Unsigned(number)),
        }
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<T, E> {
        let found = Unexpected::Signed(number);
        match (self.plain.whole, u64::try_from(number)) {
            (Some(_), Ok(number)) => self.visit_u64(number),
            (Some(_), Err(_)) if self.plain.number.is_none() => Err(E::invalid_value(found, &self)),
            _ => self.plain.number(number as f64, found),
        }
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<T, E> {
        self.plain.number(number, Unexpected::Float(number))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        match self.text {
            Some(of) => Text::deserialize(StrDeserializer::new(text)).map(of),
            None => Err(E::invalid_type(Unexpected::Str(text), &self)),
        }
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T, A::Error> {
        match self.list {
            Some(of) => List::deserialize(SeqAccessDeserializer::new(list)).map(of),
            None => Err(A::Error::invalid_type(Unexpected::Seq, &self)),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<T, A::Error> {
        match self.table {
            Some(of) => Table::deserialize(MapAccessDeserializer::new(table)).map(of),
            None => Err(A::Error::invalid_type(Unexpected::Map, &self)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    #[derive(Debug, PartialEq)]
    enum Any {
        Truth(bool),
        Whole(usize),
        Number(f64),
        Text(Duration),
        List(Vec<usize>),
    }

    fn read(json: &str) -> Result<Any, String> {
        let forms = Forms::new("what fits")
            .whole(Any::Whole)
            .text(Any::Text)
            .list(Any::List);
        let read = forms.read(&mut serde_json::Deserializer::from_str(json));
        read.map_err(|error| error.to_string())
    }

    #[test]
    fn each_form_is_read_as_what_it_is() {
        assert_eq!(read("3"), Ok(Any::Whole(3)));
        assert_eq!(
            read("\"5min\""),
            Ok(Any::Text(Duration::from_ns(300_000_000_000)))
        );
        assert_eq!(read("[1, 2]"), Ok(Any::List(vec![1, 2])));
        let numbers = |json| {
            let forms = Forms::new("what fits")
                .truth(Any::Truth)
                .number(Any::Number);
            forms.read(&mut serde_json::Deserializer::from_str(json))
        };
        assert_eq!(numbers("true").unwrap(), Any::Truth(true));
        assert_eq!(numbers("-1").unwrap(), Any::Number(-1.0));
        assert_eq!(numbers("1").unwrap(), Any::Number(1.0));
        assert_eq!(numbers("0.5").unwrap(), Any::Number(0.5));
        let both = |json| {
            let forms = Forms::new("what fits")
                .whole(Any::Whole)
                .number(Any::Number);
            forms.read(&mut serde_json::Deserializer::from_str(json))
        };
        assert_eq!(both("1").unwrap(), Any::Whole(1));
        assert_eq!(both("-1").unwrap(), Any::Number(-1.0));
    }

    #[test]
    fn a_form_that_is_not_there_is_answered_by_those_that_are() {
        for other in ["true", "0.5", "-1", "{}"] {
            let error = read(other).unwrap_err();
            assert!(error.contains("expected what fits"), "{other}: {error}");
        }
    }

    #[test]
    fn a_mistake_within_a_form_is_told_as_its_own() {
        let error = read("\"5 minuets\"").unwrap_err();
        assert!(error.contains("minuets"), "{error}");
        let error = read("[1, true]").unwrap_err();
        assert!(error.contains("boolean `true`"), "{error}");
    }
}
