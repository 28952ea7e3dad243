//! What the author of a source implements: samples in.

use std::error::Error;

use crate::time::Instant;

/// Where samples come from: a file, a bus, a broker, a controller.
///
/// A source is asked for the next samples and may wait for them. It gives them as they were measured: one call, one instant, NaN
/// where a channel has no new value. The graph checks ranges, ages and absence. The engine refuses and counts instants that do not
/// rise. A source ends when there will be nothing more.
///
/// What it needs of a graph, it takes when it is made: [`Plan::sources`](crate::compile::Plan::sources) has the channels, in order and
/// with their columns, [`Plan::time`](crate::compile::Plan::time) the form of time. A whole source, which reads a counter once a second:
///
/// ```
/// use athermal_run::recording::{Event, Samples, Source, SourceError};
/// use athermal_core::time::{Duration, Instant};
///
/// /// Counts from 0 to below its end, one number a second.
/// struct Counter {
///     next: u32,
///     end: u32,
/// }
///
/// impl Source for Counter {
///     fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
///         if self.next == self.end {
///             return Ok(None);
///         }
///         let time = Instant::from_ns(i64::from(self.next) * 1_000_000_000);
///         samples.values.clear();
///         samples.values.push(f64::from(self.next));
///         self.next += 1;
///         Ok(Some(Event::Row(time)))
///     }
/// }
///
/// let (mut counter, mut samples) = (Counter { next: 0, end: 2 }, Samples::default());
/// let mut times = Vec::new();
/// while let Some(Event::Row(time)) = counter.next(&mut samples)? {
///     times.push((time.as_ns(), samples.values[0]));
/// }
/// assert_eq!(times, [(0, 0.0), (1_000_000_000, 1.0)]);
/// # Ok::<(), SourceError>(())
/// ```
pub trait Source {
    /// Goes on to the next samples, which may have to be waited for; nothing once there will be no more.
    ///
    /// `samples` are used again from call to call, so that reading need not allocate.
    ///
    /// # Errors
    /// When the source can give no more, and why; what a source gets over by itself (a lost connection) is none.
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError>;
}

impl<S: Source + ?Sized> Source for &mut S {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        (**self).next(samples)
    }
}

/// What went wrong with a source; its text says what, where and what to do.
pub type SourceError = Box<dyn Error + Send + Sync>;

/// What comes next from a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// A row.
    Row(Instant),
    /// The rows that follow belong to another segment, whose times may start again.
    Segment,
}

/// What was measured at an instant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// The instant as the source wrote it, for sinks that write it again; empty where the source has numbers only.
    pub time_text: String,
    /// One value for each of [`Plan::sources`](crate::compile::Plan::sources), in its unit; NaN where there is none.
    pub values: Vec<f64>,
}
