//! A decision of a graph at work, which a replay applies again.

use std::hash::Hasher;

use super::sequencer::{Admission, Refusal, Sample, Timeline};
use crate::channel::ABSENT;
use crate::time::{Duration, Instant};

/// What was decided. A replay applies it without a clock or a threshold.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A sample waits for its tick.
    Sample(Sample),
    /// A sample came after its tick.
    Late(Sample),
    /// A sample came again.
    Twice(Sample),
    /// A sample was refused.
    Refused(Sample, Refusal),
    /// A sample is too far ahead, and waits until it is decided on; what becomes of it has a record of its own.
    Waits(Sample),
    /// All that waits up to an instant was stepped.
    Tick {
        /// The instant.
        at: Instant,
        /// What came of it; see [`output_hash`].
        hash: u64,
    },
    /// Time passed without samples.
    Beat {
        /// The instant.
        at: Instant,
        /// As of a tick.
        hash: u64,
    },
    /// What follows belongs to another segment.
    Break {
        /// Whether its times may start again.
        afresh: bool,
    },
    /// Learning was frozen, or went on.
    Freeze(bool),
    /// The stamps of a source are shifted from now on.
    Shift {
        /// The source.
        source: u32,
        /// What is added to its stamps.
        offset: Duration,
    },
    /// A source lags behind the host by so much at the least.
    Lag {
        /// The source.
        source: u32,
        /// The host's time at an arrival less its stamp.
        least: Duration,
    },
    /// What a source gives next is left of so many samples, which are not in the journal themselves.
    Thinned {
        /// The source.
        source: u32,
        /// How many samples.
        samples: u64,
    },
    /// Another graph takes over before the next tick. Its model is kept beside the journal.
    Swap {
        /// The digits of its revision as a number.
        revision: u64,
    },
    /// A remark for whoever reads the journal.
    Note(Box<str>),
}

/// A hash of the bits of outputs. All that is absent counts the same, whatever a processor makes of NaN.
#[must_use]
pub fn output_hash(outputs: &[f64]) -> u64 {
    let mut hash = crate::engine::Fnv1a::default();
    for output in outputs {
        let bits = if output.is_nan() { ABSENT } else { *output }.to_bits();
        hash.write(&bits.to_le_bytes());
    }
    hash.finish()
}

impl Record {
    /// The record of what became of a sample; none while that is open.
    #[must_use]
    pub fn of(admission: Admission) -> Option<Self> {
        Some(match admission {
            Admission::Accepted(sample) => Self::Sample(sample),
            Admission::Late(sample) => Self::Late(sample),
            Admission::Twice(sample) => Self::Twice(sample),
            Admission::Refused(sample, refusal) => Self::Refused(sample, refusal),
            Admission::Waits(sample) => Self::Waits(sample),
            Admission::Held => return None,
        })
    }

    /// Does to a timeline what was decided. A tick or beat is not stepped here.
    pub fn apply(&self, timeline: &mut Timeline) {
        match self {
            Self::Sample(sample) => {
                timeline.accept(*sample);
            }
            Self::Tick { at, .. } | Self::Beat { at, .. } => {
                timeline.tick(*at);
            }
            Self::Break { afresh } => timeline.segment(*afresh),
            Self::Shift { source, offset } => timeline.shift(*source as usize, *offset),
            Self::Lag { source, least } => timeline.lag(*source as usize, *least),
            Self::Waits(sample) => timeline.wait(*sample),
            Self::Late(sample) | Self::Twice(sample) | Self::Refused(sample, _) => {
                timeline.decided(*sample);
            }
            Self::Freeze(_) | Self::Swap { .. } | Self::Note(_) | Self::Thinned { .. } => {}
        }
    }

    /// Whether an engine takes part: a tick, a beat, a break, a freeze.
    #[must_use]
    pub fn is_happening(&self) -> bool {
        matches!(
            self,
            Self::Tick { .. } | Self::Beat { .. } | Self::Break { .. } | Self::Freeze(_)
        )
    }
}
