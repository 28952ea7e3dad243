//! What a machine file says about time.

use crate::time::Duration;

/// The rules by which samples become ticks.
#[derive(Debug, Clone)]
pub struct Rules {
    /// An instant is stepped so long after its first sample came.
    pub wait: Duration,
    /// Instants no further apart are one tick, at the last of them. An instant is held so much longer.
    pub join: Duration,
    /// After a start or a reconnect no tick is cut until every source has been connected so long, or is away for good.
    pub settle: Duration,
    /// A stamp further ahead of the newest accepted one and the time since, and of a trusted host, is of the future.
    pub future: Duration,
    /// How long nothing may be measured until time passes without samples; for ever without.
    pub heartbeat: Option<Duration>,
    /// How many samples may wait. Beyond, the oldest instants are stepped at once, and counted.
    pub most: usize,
    /// The sources.
    pub sources: Vec<SourceRules>,
    /// The channels of the feed.
    pub channels: Vec<ChannelRules>,
}

impl Default for Rules {
    fn default() -> Self {
        let ms = |ms: i64| Duration::from_ns(ms * 1_000_000);
        Self {
            wait: ms(200),
            join: Duration::ZERO,
            settle: ms(5_000),
            future: ms(5_000),
            heartbeat: Some(ms(1_000)),
            most: 1 << 16,
            sources: Vec::new(),
            channels: Vec::new(),
        }
    }
}

impl Rules {
    /// Whether the stamps of a source come in order.
    pub(super) fn is_in_order(&self, source: usize) -> bool {
        self.sources.get(source).is_some_and(|of| of.is_in_order)
    }
}

/// The rules for a source.
#[derive(Debug, Clone, Copy)]
pub struct SourceRules {
    /// A source that is away so long is not waited for.
    pub silent: Duration,
    /// How its clock is judged; not at all without.
    pub clock: Option<ClockRule>,
    /// Whether its stamps come in order, as in a recording: then a gap is no stamp from the future.
    pub is_in_order: bool,
}

impl Default for SourceRules {
    fn default() -> Self {
        Self {
            silent: Duration::from_ns(30_000_000_000),
            clock: None,
            is_in_order: false,
        }
    }
}

/// How the clock of a source is judged against the time of arrival.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockRule {
    /// How far they may be apart.
    pub within: Duration,
    /// What becomes of samples where they are further apart.
    pub otherwise: ClockRemedy,
}

/// What becomes of the samples of a source whose clock is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockRemedy {
    /// They are refused.
    Refuse,
    /// Their stamps are shifted by a fixed offset, so that distances stay.
    Shift,
    /// They are stamped with their arrival.
    Arrival,
}

/// The rules for a channel.
#[derive(Debug, Clone, Copy, Default)]
pub struct ChannelRules {
    /// Its source, by place.
    pub source: usize,
    /// A sample no later than this is given to the next tick.
    pub late: Duration,
}
