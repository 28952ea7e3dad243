//! Exports fitted graphs to controllers, where this program has no place.
//!
//! A graph with its fit is [lowered](lower()) to constant tables: which slots there are, what is read at what age and lag, which nodes run
//! in which order, and how much room their past takes at a stated time between samples. [`export_c`] writes these as C99 for a
//! runtime that was written once by hand (`c/athermal_rt.c`). It takes sums in the order of the engine, so that results are the same to the
//! bit; a self test of 200 ticks within the exported files says whether a compiler kept that. [`st::export`] writes Structured Text, whose
//! results are within 1e-9.
//!
//! What has no counterpart on a controller is refused by the name of its node, with a way: kinds of third parties, fits that are no linear
//! form, and what goes on learning unless it is exported as it was fitted ([`Options::frozen`]).

pub mod c;
mod command;
mod error;
pub mod fmu;
mod form;
mod lower;
pub mod onnx;
pub mod st;
pub mod state;
mod ticks;

pub use athermal_core::compile::Rates;
use athermal_core::engine::Engine;

pub use error::{ExportError, Refusal};
pub use form::{Bundle, Entry, Field, Form, History, Layout, Port, Record, Step};
pub use lower::{Options, identifier, lower};
pub use ticks::{TICKS, Ticks, self_test};

/// A graph as files.
#[derive(Debug, Clone)]
pub struct Exported {
    /// The graph, lowered.
    pub form: Form,
    /// The ticks of its self test.
    pub ticks: Ticks,
    /// The files.
    pub files: Vec<c::File>,
}

/// A graph in C99. `float`: whether its recipes build it in single precision; the sources are the same.
///
/// # Errors
/// As [`lower()`].
pub fn export_c(engine: &Engine, options: &Options, float: bool) -> Result<Exported, ExportError> {
    let form = lower(engine, options)?;
    let ticks = self_test(engine, &form, options.frozen)?;
    let files = c::files(&form, &ticks, float);
    Ok(Exported { form, ticks, files })
}
