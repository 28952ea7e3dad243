//! Decides what the author of a sink implements: what a graph puts out, tick by tick; not when it does.

use std::error::Error;

use crate::time::Instant;

/// Where outputs go: a file, a screen, a controller.
///
/// A sink is given a [`Frame`] for every tick that the engine took, in order. A whole sink, which keeps the largest
/// value of the first output:
///
/// ```
/// use athermal_run::live::{Frame, Sink, SinkError};
/// use athermal_core::time::Instant;
///
/// /// The largest value so far of the first output.
/// struct Peak(f64);
///
/// impl Sink for Peak {
///     fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError> {
///         // NaN, which is no output at this tick, is not larger than anything.
///         self.0 = self.0.max(frame.outputs[0]);
///         Ok(())
///     }
/// }
///
/// let mut peak = Peak(f64::NEG_INFINITY);
/// for (second, value) in [2.0, f64::NAN, 7.0].into_iter().enumerate() {
///     let time = Instant::from_ns(second as i64 * 1_000_000_000);
///     peak.put(&Frame { time, time_text: "", revision: "", outputs: &[value] })?;
/// }
/// peak.finish()?;
/// assert_eq!(peak.0, 7.0);
/// # Ok::<(), SinkError>(())
/// ```
pub trait Sink {
    /// Takes the outputs of a tick.
    ///
    /// # Errors
    /// When they cannot be put out, and why; what a sink gets over by itself (a lost connection) is none.
    fn put(&mut self, frame: &Frame<'_>) -> Result<(), SinkError>;

    /// Puts out what is still held back, so that it lasts: what the engine knows is about to be kept, and a run that goes on from
    /// there does not put out again what came before.
    ///
    /// # Errors
    /// As [`put`](Sink::put).
    fn flush(&mut self) -> Result<(), SinkError> {
        Ok(())
    }

    /// Puts out what is still held back, by default as [`flush`](Sink::flush) does. Nothing is put after it.
    ///
    /// # Errors
    /// As [`put`](Sink::put).
    fn finish(&mut self) -> Result<(), SinkError> {
        self.flush()
    }
}

/// What went wrong with a sink; its text says what, where and what to do.
pub type SinkError = Box<dyn Error + Send + Sync>;

/// What came of a tick.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The instant.
    pub time: Instant,
    /// The instant as the source wrote it; empty where it has numbers only.
    pub time_text: &'a str,
    /// The revision of the graph that made the outputs.
    pub revision: &'a str,
    /// The outputs in the order of [`Plan::outputs`](crate::compile::Plan::outputs); NaN where a node did not run or gave nothing.
    pub outputs: &'a [f64],
}
