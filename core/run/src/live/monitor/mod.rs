//! What is watched beside a graph at work: sensors that drop out or freeze, samples out of range or far outside of the fit, outputs that
//! stay empty. Whoever runs a graph shows its rows to a [`Watch`], and reports what that finds.

mod finding;
mod output;
mod range;
mod sensor;
pub mod silence;
pub mod standstill;
mod watch;
pub mod words;

pub use finding::Finding;
pub use output::{NoOutput, OutputMonitor};
pub use range::{OutsideFit, RangeMonitor, usual};
pub use sensor::{SensorChange, SensorFault, SensorMonitor};
pub use watch::Watch;

use super::{Feed, TickView};
use crate::compile::Plan;
use crate::engine::{Engine, SampleRange};
use crate::time::Instant;

/// What sees each row of a graph at work.
pub trait Monitor {
    /// Takes a row, before it is stepped.
    fn row(&mut self, now: Instant, values: &[f64], found: &mut Vec<Finding>);

    /// The row was stepped.
    fn stepped(&mut self, _tick: &TickView<'_>, _found: &mut Vec<Finding>) {}

    /// No row follows.
    fn end(&mut self, _engine: &Engine, _found: &mut Vec<Finding>) {}

    /// The rows that follow belong to another segment.
    fn segment(&mut self) {}

    /// Goes on with the graph that has taken over, which reads its channels among those of a feed. `usual` is where samples lay in
    /// its fit.
    fn follow(
        &mut self,
        plan: &Plan,
        feed: &[Feed],
        usual: &[SampleRange],
        found: &mut Vec<Finding>,
    );
}

/// Where each channel of a plan stands among those of a feed.
pub fn places<'a>(plan: &'a Plan, feed: &'a [Feed]) -> impl Iterator<Item = Option<usize>> + 'a {
    let place = |fed: Feed| feed.iter().position(|of| *of == fed);
    Feed::of(plan).into_iter().map(place)
}
