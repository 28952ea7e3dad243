//! What runs beside a service and asks it things: a control interface, a watchdog, whoever fits anew. A crate brings its kind.

use std::fmt::Debug;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::connector::ConnectorError;
use crate::deployment::read_keys;
use crate::diagnostic::Diagnostics;
use crate::document::Value;
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

/// A kind of companion, as registered.
#[derive(Debug)]
pub struct CompanionKind {
    /// The section of a machine file that is read for it, or `""`. Without the section it runs with what that has by default.
    pub section: &'static str,
    /// Reads the section, or reports its mistakes.
    #[allow(clippy::type_complexity)] // it is this once
    pub read: fn(Option<&Value>, &str, &mut Diagnostics) -> Option<Box<dyn Companion>>,
    /// The JSON Schema of the section.
    pub schema: fn() -> serde_json::Value,
}

inventory::collect!(CompanionKind);

/// All kinds of companions in this program.
pub fn companion_kinds() -> impl Iterator<Item = &'static CompanionKind> {
    let mut kinds: Vec<_> = inventory::iter::<CompanionKind>.into_iter().collect();
    kinds.sort_by_key(|kind| kind.section);
    kinds.into_iter()
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
        $crate::__private::inventory::submit! {
            $crate::__private::Section($section)
        }
        $crate::__private::inventory::submit! {
            $crate::companion::CompanionKind {
                section: $section,
                read: $crate::companion::read_companion::<$spec>,
                schema: || $crate::__private::schemars::schema_for!($spec).into(),
            }
        }
    };
}
