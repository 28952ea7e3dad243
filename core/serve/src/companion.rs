//! What runs beside a service and asks it things: a control interface, a watchdog, whoever fits anew. A crate brings its kind.

use std::fmt::Debug;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::connector::ConnectorError;
use crate::deployment::read_keys;
use crate::diagnostic::Diagnostics;
use crate::document::Value;
use crate::registry::Sort;
use crate::service::ServiceHandle;

/// What runs beside a service: the parameters of one, as a machine file gives them.
pub trait Companion: Debug + Send {
    /// Starts it, beside a service that has started. It ends when what this gives is dropped.
    ///
    /// # Errors
    /// When it cannot start; the service ends again.
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError>;
}

/// The service beside which a companion runs.
#[derive(Debug, Clone)]
pub struct Beside {
    /// The name of the machine.
    pub name: String,
    /// Its file, from the root on.
    pub machine: PathBuf,
    /// The state folder, from the root on.
    pub state: PathBuf,
    /// To ask it.
    pub handle: ServiceHandle,
}

/// A kind of companion, by the name of the section of a machine file that is read for it, or `""`. Without the section it runs with what
/// that has by default.
#[derive(Debug)]
pub struct CompanionKind {
    /// Reads the section, or reports its mistakes.
    #[allow(clippy::type_complexity)] // it is this once
    pub read: fn(Option<&Value>, &str, &mut Diagnostics) -> Option<Box<dyn Companion>>,
}

impl Sort for CompanionKind {
    const ONE: &'static str = "section";
    const MANY: &'static str = "sections";
}

/// Reads the section of a companion; [`register_companion!`](crate::register_companion) makes use of it.
#[doc(hidden)]
pub fn read_companion<T: Companion + Default + DeserializeOwned + JsonSchema + 'static>(
    section: Option<&Value>,
    what: &str,
    diagnostics: &mut Diagnostics,
) -> Option<Box<dyn Companion>> {
    let read = section.map_or_else(
        || Some(T::default()),
        |section| read_keys::<T>(section, what, diagnostics),
    );
    Some(Box::new(read?))
}

/// Makes a kind of companion known: its parameters' type, which implements [`Companion`](crate::companion::Companion), `Default`,
/// `Deserialize` and `JsonSchema`, and the section of a machine file that it is read from.
#[macro_export]
macro_rules! register_companion {
    ($spec:ty, $section:literal) => {
        $crate::__private::list!(
            $crate::__private::Section,
            $section,
            $crate::__private::no_schema,
            $crate::__private::Section
        );
        $crate::__private::list!(
            $crate::companion::CompanionKind,
            $section,
            $crate::__private::schema_of!($spec),
            $crate::companion::CompanionKind {
                read: $crate::companion::read_companion::<$spec>
            }
        );
    };
}
