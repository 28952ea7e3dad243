//! What runs beside a service and asks it things: a control interface, a watchdog, whoever fits anew. A crate brings its kind.

use std::any::Any;
use std::fmt::Debug;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::compile::Plan;
use crate::connector::{ConnectorError, Sink, SinkWiring};
use crate::deployment::{DeclaredSink, read_keys};
use crate::diagnostic::Diagnostics;
use crate::document::Value;
use crate::registry::Sort;
use crate::service::{Observer, Observers, ServiceHandle};

/// What runs beside a service: the parameters of one, as a machine file gives them.
pub trait Companion: Debug + Send {
    /// Starts it, beside a service that has started. It ends when what this gives is dropped.
    ///
    /// # Errors
    /// When it cannot start; the service ends again.
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError>;

    /// Reports what its section says that does not belong to the graph, or to the sinks that are declared. A section that is not there
    /// says nothing.
    fn check(
        &self,
        section: &Value,
        plan: &Plan,
        sinks: &[DeclaredSink],
        diagnostics: &mut Diagnostics,
    ) {
        let _ = (section, plan, sinks, diagnostics);
    }
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
    /// How many ticks, beats, breaks and freezes there were when it started.
    pub happenings: u64,
    /// What companions have for each other.
    pub shared: Shared,
    /// The sinks that are declared, with what each is given.
    pub sinks: Vec<(Arc<dyn Sink>, SinkWiring)>,
    pub(crate) observers: Observers,
}

impl Beside {
    /// Lets somebody look on: from the first tick on where it is called at the start.
    pub fn observe(&self, observer: Box<dyn Observer>) {
        self.observers.add(observer);
    }
}

/// What companions have for each other, and for routes of the control interface.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<Mutex<Vec<Arc<dyn Any + Send + Sync>>>>);

impl Shared {
    /// Gives something, which others find by its type.
    pub fn give<T: Any + Send + Sync>(&self, of: Arc<T>) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(of);
    }

    /// What another has given.
    #[must_use]
    pub fn find<T: Any + Send + Sync>(&self) -> Option<Arc<T>> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.iter().find_map(|of| Arc::clone(of).downcast().ok())
    }
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
