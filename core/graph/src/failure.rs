//! Why work that somebody asked for was not done, and whose fault that is. What each error means is said beside that error.

use std::error::Error;
use std::fmt;

use crate::diagnostic::{Diagnostic, Diagnostics, Severity, Sources};
use crate::registry::{Sort, all};

/// Why work could not be done.
#[derive(Debug)]
pub enum Failure {
    /// What was asked for makes no sense.
    Request(String),
    /// A graph has mistakes.
    Graph {
        /// The mistakes.
        diagnostics: Box<Diagnostics>,
        /// The texts that they point into.
        sources: Box<Sources>,
    },
    /// Something outside did not work.
    Outside(String),
    /// It was reported before; the program ends with this status.
    Exit(u8),
}

impl Failure {
    /// The exit status: 2 where the request was wrong, 3 where something outside failed.
    #[must_use]
    pub fn status(&self) -> u8 {
        match self {
            Self::Request(_) => 2,
            Self::Graph { diagnostics, .. } => status_of(diagnostics),
            Self::Outside(_) => 3,
            Self::Exit(code) => *code,
        }
    }
}

/// The exit status of mistakes: 3 where the only ones are files of the command line that cannot be read, else 2.
#[must_use]
pub fn status_of(mistakes: &Diagnostics) -> u8 {
    let is_unread = |of: &Diagnostic| of.code == UNREADABLE && of.place.is_none();
    let mut errors = mistakes.iter().filter(|of| of.severity == Severity::Error);
    if errors.all(is_unread) { 3 } else { 2 }
}

/// A file that cannot be read; one that another names has a place.
const UNREADABLE: &str = "A002";

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Request(words) | Self::Outside(words) => f.write_str(words),
            Self::Graph {
                diagnostics,
                sources,
            } => f.write_str(&diagnostics.render(sources, false, 100)),
            Self::Exit(_) => Ok(()),
        }
    }
}

impl Error for Failure {}

/// An error of any type.
pub type BoxedError = Box<dyn Error + Send + Sync>;

/// A type of error that is a failure of its own where it comes in a box, as that of a source.
#[derive(Debug)]
pub struct ErrorKind(pub fn(BoxedError) -> Result<Failure, BoxedError>);

impl Sort for ErrorKind {
    const ONE: &'static str = "error";
    const MANY: &'static str = "errors";
}

/// An error of a type that becomes a failure, where it is of that type; [`register_error!`](crate::register_error) makes use of it.
#[doc(hidden)]
pub fn of_type<E: Error + Send + Sync + 'static>(error: BoxedError) -> Result<Failure, BoxedError>
where
    Failure: From<E>,
{
    error.downcast::<E>().map(|error| (*error).into())
}

/// The failure of a source, a sink or a recording.
#[must_use]
pub fn outside(error: BoxedError) -> Failure {
    let begun = Err(error);
    let known = all::<ErrorKind>().fold(begun, |error, kind| error.or_else(kind.0));
    known.unwrap_or_else(|error| Failure::Outside(error.to_string()))
}

/// Makes a type of error, which becomes a [`Failure`](crate::failure::Failure), known to whoever has one in a box.
#[macro_export]
macro_rules! register_error {
    ($error:ty) => {
        $crate::list!(
            $crate::failure::ErrorKind,
            stringify!($error),
            $crate::registry::no_schema,
            $crate::failure::ErrorKind($crate::failure::of_type::<$error>)
        );
    };
}
