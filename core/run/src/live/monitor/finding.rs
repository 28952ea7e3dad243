//! What a monitor finds. Whoever runs the graph puts it into words.

use super::{NoOutput, SensorChange, SensorFault};
use crate::engine::SampleRange;

/// What was found at a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Finding {
    /// A sample does not count, the first in an hour.
    Rejected {
        /// Its channel.
        channel: String,
        /// Between which values samples count.
        range: (f64, f64),
        /// The sample.
        value: f64,
    },
    /// A sample lies far outside of those of the fit, the first in an hour.
    OutsideFit {
        /// The channel, and where its samples lay in the fit.
        usual: SampleRange,
        /// The sample.
        value: f64,
    },
    /// Sensors fail, or are in order again.
    Sensors(Vec<SensorChange>),
    /// No output has had a value.
    NoOutput(NoOutput),
}

impl Finding {
    /// The warnings in it: of what kind, and of which channel; none of a whole graph.
    pub fn warnings(&self) -> impl Iterator<Item = (&'static str, Option<&str>)> {
        let (one, changes) = match self {
            Self::Rejected { channel, .. } => {
                (Some(("rejected_samples", Some(&**channel))), &[][..])
            }
            Self::OutsideFit { usual, .. } => {
                (Some(("outside_fit", Some(&*usual.channel))), &[][..])
            }
            Self::Sensors(changes) => (None, &changes[..]),
            Self::NoOutput(_) => (Some(("no_output", None)), &[][..]),
        };
        let fails = changes.iter().filter(|of| !of.is_over);
        let fails = fails.map(|of| (of.fault.kind(), Some(&*of.channel)));
        one.into_iter().chain(fails)
    }
}

impl SensorFault {
    /// Of what kind it is.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Silent { .. } => "silent",
            Self::Stuck(_) => "stuck",
        }
    }
}
