//! How a kind of source or sink becomes known.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use super::{Sink, Source};
use crate::diagnostic::Diagnostics;
use crate::document::{Value, decode_beside};
use crate::registry::Sort;

/// A kind of source or sink, by the name that a machine file says as `type`. `S` is [`dyn Source`](Source) or [`dyn Sink`](Sink).
#[derive(Debug)]
pub struct ConnectorKind<S: ?Sized + 'static> {
    /// Reads its parameters, or reports their mistakes: the table, how it is named in texts, and its keys that are read elsewhere.
    #[allow(clippy::type_complexity)] // it is this once
    pub read: fn(&Value, &str, &[&str], &mut Diagnostics) -> Option<Box<S>>,
}

/// A kind of source.
pub type SourceKind = ConnectorKind<dyn Source>;
/// A kind of sink.
pub type SinkKind = ConnectorKind<dyn Sink>;

impl Sort for SourceKind {
    const ONE: &'static str = "kind of source";
    const MANY: &'static str = "kinds of sources";
}

impl Sort for SinkKind {
    const ONE: &'static str = "kind of sink";
    const MANY: &'static str = "kinds of sinks";
}

/// Reads the parameters of a source; [`register_source!`](crate::register_source) makes use of it.
#[doc(hidden)]
pub fn read_source<T: Source + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Source>> {
    let read = decode_beside::<T>(value, what, elsewhere, diagnostics)?;
    Some(Box::new(read))
}

/// Reads the parameters of a sink; [`register_sink!`](crate::register_sink) makes use of it.
#[doc(hidden)]
pub fn read_sink<T: Sink + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    what: &str,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Sink>> {
    let read = decode_beside::<T>(value, what, elsewhere, diagnostics)?;
    Some(Box::new(read))
}

/// Makes a kind of source known: its parameters' type, which implements [`Source`](crate::connector::Source), `Deserialize` and
/// `JsonSchema`, and the name that machine files use. Its doc comments become the documentation of the kind.
#[macro_export]
macro_rules! register_source {
    ($spec:ty, $name:literal) => {
        $crate::register_source!(@ $spec, $name, SourceKind, read_source);
    };
    (@ $spec:ty, $name:literal, $kind:ident, $read:ident) => {
        $crate::__private::list!(
            $crate::connector::$kind,
            $name,
            $crate::__private::schema_of!($spec),
            $crate::connector::ConnectorKind { read: $crate::connector::$read::<$spec> }
        );
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
