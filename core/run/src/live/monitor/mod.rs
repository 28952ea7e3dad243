//! What a session watches beside the graph: sensors that drop out or freeze, samples out of range, outputs that stay empty.

mod output;
mod range;
mod sensor;
pub mod silence;
pub mod standstill;

pub use output::{NoOutput, OutputMonitor};
pub use range::{RangeMonitor, usual};
pub use sensor::{SensorChange, SensorFault, SensorMonitor};

use super::{Feed, Reporter};
use crate::compile::Plan;
use crate::engine::SampleRange;
use crate::recording::Samples;
use crate::time::Instant;

/// What sees each row of a session before the graph does.
pub trait Monitor {
    /// Takes a row.
    fn row(&mut self, now: Instant, samples: &Samples, reporter: &dyn Reporter);

    /// The rows that follow belong to another segment.
    fn segment(&mut self) {}

    /// Goes on with the graph that has taken over, which reads its channels among those of a feed. `usual` is where samples lay in
    /// its fit.
    fn follow(&mut self, plan: &Plan, feed: &[Feed], usual: &[SampleRange]);
}

/// Where each channel of a plan stands among those of a feed.
pub fn places<'a>(plan: &'a Plan, feed: &'a [Feed]) -> impl Iterator<Item = Option<usize>> + 'a {
    let place = |fed: Feed| feed.iter().position(|of| *of == fed);
    Feed::of(plan).into_iter().map(place)
}
