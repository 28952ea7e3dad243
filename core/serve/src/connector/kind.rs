//! How a kind of source or sink becomes known and is looked up by name.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use super::{Sink, Source};
use crate::diagnostic::Diagnostics;
use crate::document::{Value, decode_beside};
use crate::node::first_paragraph;

/// A kind of source or sink, as registered. `S` is [`dyn Source`](Source) or [`dyn Sink`](Sink).
#[derive(Debug)]
pub struct ConnectorKind<S: ?Sized + 'static> {
    /// What a machine file says as `type`.
    pub name: &'static str,
    /// The crate that brings it.
    pub package: &'static str,
    /// The version of that crate.
    pub version: &'static str,
    /// Reads its parameters, or reports their mistakes: the table, how it is named in texts, and its keys that are read elsewhere.
    #[allow(clippy::type_complexity)] // it is this once
    pub read: fn(&Value, &str, &[&str], &mut Diagnostics) -> Option<Box<S>>,
    /// The JSON Schema of its parameters, with their documentation.
    pub schema: fn() -> &'static serde_json::Value,
}

/// A kind of source.
pub type SourceKind = ConnectorKind<dyn Source>;
/// A kind of sink.
pub type SinkKind = ConnectorKind<dyn Sink>;

inventory::collect!(SourceKind);
inventory::collect!(SinkKind);

impl<S: ?Sized> ConnectorKind<S> {
    /// The documentation of the parameters' struct.
    #[must_use]
    pub fn documentation(&self) -> &'static str {
        (self.schema)()["description"].as_str().unwrap_or_default()
    }

    /// The first paragraph of the documentation.
    #[must_use]
    pub fn summary(&self) -> String {
        first_paragraph(self.documentation())
    }
}

/// The kinds of sources or of sinks in this program.
#[derive(Debug)]
pub(crate) struct Kinds<S: ?Sized + 'static> {
    /// One of each name.
    pub(crate) by_name: BTreeMap<&'static str, &'static ConnectorKind<S>>,
    /// The crates that bring a name, where there are several.
    pub(crate) ambiguous: BTreeMap<&'static str, Vec<&'static str>>,
}

/// All kinds of sources in this program, by name.
pub fn source_kinds() -> &'static BTreeMap<&'static str, &'static SourceKind> {
    &all_sources().by_name
}

/// All kinds of sinks in this program, by name.
pub fn sink_kinds() -> &'static BTreeMap<&'static str, &'static SinkKind> {
    &all_sinks().by_name
}

pub(crate) fn all_sources() -> &'static Kinds<dyn Source> {
    static KINDS: OnceLock<Kinds<dyn Source>> = OnceLock::new();
    KINDS.get_or_init(|| Kinds::of(inventory::iter::<SourceKind>.into_iter()))
}

pub(crate) fn all_sinks() -> &'static Kinds<dyn Sink> {
    static KINDS: OnceLock<Kinds<dyn Sink>> = OnceLock::new();
    KINDS.get_or_init(|| Kinds::of(inventory::iter::<SinkKind>.into_iter()))
}

/// The kind of source of a name, if there is one.
#[must_use]
pub fn source_kind(name: &str) -> Option<&'static SourceKind> {
    source_kinds().get(name).copied()
}

/// The kind of sink of a name, if there is one.
#[must_use]
pub fn sink_kind(name: &str) -> Option<&'static SinkKind> {
    sink_kinds().get(name).copied()
}

impl<S: ?Sized> Kinds<S> {
    fn of(kinds: impl Iterator<Item = &'static ConnectorKind<S>>) -> Self {
        let (mut by_name, mut packages) = (BTreeMap::new(), BTreeMap::<_, Vec<_>>::new());
        for kind in kinds {
            by_name.insert(kind.name, kind);
            packages.entry(kind.name).or_default().push(kind.package);
        }
        packages.values_mut().for_each(|of| of.sort_unstable());
        packages.retain(|_, of| of.len() > 1);
        Self {
            by_name,
            ambiguous: packages,
        }
    }
}

fn read<T: DeserializeOwned + JsonSchema>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<T> {
    let advice = |key: &str| {
        let schema = serde_json::Value::from(schemars::schema_for!(T));
        let description = schema["properties"][key]["description"].as_str()?;
        Some(format!("add `{key}`: {}", first_paragraph(description)))
    };
    decode_beside::<T>(value, what, elsewhere, &advice, diagnostics)
}

/// Reads the parameters of a source; [`register_source!`](crate::register_source) makes use of it.
#[doc(hidden)]
pub fn read_source<T: Source + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Source>> {
    Some(Box::new(read::<T>(value, what, elsewhere, diagnostics)?))
}

/// Reads the parameters of a sink; [`register_sink!`](crate::register_sink) makes use of it.
#[doc(hidden)]
pub fn read_sink<T: Sink + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Sink>> {
    Some(Box::new(read::<T>(value, what, elsewhere, diagnostics)?))
}

/// Makes a kind of source known: its parameters' type, which implements [`Source`](crate::connector::Source), `Deserialize` and
/// `JsonSchema`, and the name that machine files use. Its doc comments become the documentation of the kind.
#[macro_export]
macro_rules! register_source {
    ($spec:ty, $name:literal) => {
        $crate::register_source!(@ $spec, $name, SourceKind, read_source);
    };
    (@ $spec:ty, $name:literal, $kind:ident, $read:ident) => {
        $crate::__private::inventory::submit! {
            $crate::connector::$kind {
                name: $name,
                package: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
                read: $crate::connector::$read::<$spec>,
                schema: || {
                    use $crate::__private::{schemars::schema_for, serde_json::Value};
                    static SCHEMA: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
                    SCHEMA.get_or_init(|| schema_for!($spec).into())
                },
            }
        }
    };
}

/// Makes a kind of sink known: as [`register_source!`](crate::register_source), for a type that implements
/// [`Sink`](crate::connector::Sink).
#[macro_export]
macro_rules! register_sink {
    ($spec:ty, $name:literal) => {
        $crate::register_source!(@ $spec, $name, SinkKind, read_sink);
    };
}
