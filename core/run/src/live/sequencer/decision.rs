//! What is decided of samples and of time: the alphabet of the journal.

use crate::time::{Duration, Instant};

/// A value of a channel, as a source gave it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The place of the channel in the feed.
    pub channel: u32,
    /// When it was measured.
    pub stamp: Instant,
    /// The value in the channel's unit; NaN where the source says that there is none.
    pub value: f64,
}

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Admission {
    /// It waits for its tick, with the stamp that it has by the rule of its source's clock.
    Accepted(Sample),
    /// It is not after the last tick.
    Late(Sample),
    /// Its channel has a sample of this or a later stamp.
    Twice(Sample),
    /// Its stamp cannot be used.
    Refused(Sample, Refusal),
    /// It is too far ahead, and waits in the journal until it is known what it is; [`Sequencer::pass`](super::Sequencer::pass) decides
    /// on it then.
    Waits(Sample),
    /// It waits until the offset of its source's clock is known; [`Sequencer::pass`](super::Sequencer::pass) decides on it then.
    Held,
}

/// Why a stamp cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// It is too far ahead of a trusted host, or of the newest accepted stamp and the time since.
    Future {
        /// By how much it is ahead of the host where that is trusted, else of the newest stamp.
        ahead: Duration,
    },
    /// It is too far from the time of arrival, and its source's `clock` says to refuse it.
    Clock {
        /// Time of arrival less stamp.
        off: Duration,
    },
    /// The feed has no such channel.
    NoChannel,
}

/// What is decided as time passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Decision<'a> {
    /// A sample that was held is decided on.
    Sample(Admission),
    /// The samples of an instant are together.
    Tick {
        /// The instant.
        at: Instant,
        /// A value for each channel of the feed; NaN where there is no new one.
        row: &'a [f64],
    },
    /// Nothing was measured for the time of a heartbeat.
    Beat {
        /// The instant.
        at: Instant,
        /// As of a tick; it has values only where a channel's sample came late.
        row: &'a [f64],
    },
    /// What follows belongs to another segment.
    Break,
    /// The last tick was of the future: another segment begins, whose times start again.
    Back {
        /// The last tick.
        last: Instant,
        /// A stamp of the time that it is.
        to: Instant,
    },
    /// A source lags behind the host by so much at the least.
    Lag {
        /// The source.
        source: usize,
        /// The host's time at an arrival less its stamp.
        least: Duration,
    },
    /// The stamps of a source are shifted from now on.
    Shift {
        /// The source.
        source: usize,
        /// What is added to its stamps.
        offset: Duration,
    },
}

/// Whose clock is ahead of that of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leader {
    /// The source.
    pub source: usize,
    /// The channel that shows it.
    pub channel: usize,
    /// By how much it is ahead.
    pub ahead: Duration,
}

/// What became of the samples of a channel so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Those that were accepted, but for those that say that there is no value.
    pub accepted: u64,
    /// Those that came after their tick.
    pub late: u64,
    /// Those that came again.
    pub twice: u64,
    /// Those from the future, by what the host or the majority of sources says that it is.
    pub future: u64,
    /// Those that the rule for the source's clock refused.
    pub clock: u64,
}

impl Counts {
    /// How many there were of what became of a sample.
    #[must_use]
    pub fn of(&self, admission: Admission) -> u64 {
        match admission {
            Admission::Accepted(_) => self.accepted,
            Admission::Late(_) => self.late,
            Admission::Twice(_) => self.twice,
            Admission::Refused(_, Refusal::Future { .. }) => self.future,
            Admission::Refused(_, Refusal::Clock { .. }) => self.clock,
            Admission::Refused(_, Refusal::NoChannel) => 0,
            Admission::Waits(_) | Admission::Held => 0,
        }
    }

    pub(super) fn count(&mut self, admission: Admission) {
        match admission {
            Admission::Accepted(of) => self.accepted += u64::from(!of.value.is_nan()),
            Admission::Late(_) => self.late += 1,
            Admission::Twice(_) => self.twice += 1,
            Admission::Refused(_, Refusal::Future { .. }) => self.future += 1,
            Admission::Refused(_, Refusal::Clock { .. }) => self.clock += 1,
            Admission::Refused(_, Refusal::NoChannel) => {}
            Admission::Waits(_) | Admission::Held => {}
        }
    }
}
