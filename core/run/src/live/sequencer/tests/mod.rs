//! Arrivals by hand, and what becomes of them.

mod allocation;
mod any_order;
mod clocks;
mod commands;
mod future;
mod rules;
mod settling;
mod sources;

use super::*;

/// Milliseconds as a duration.
pub(super) fn ms(ms: i64) -> Duration {
    Duration::from_ns(ms * 1_000_000)
}

/// A moment, in milliseconds.
pub(super) fn at(ms: i64) -> Moment {
    Moment::from_ns(ms * 1_000_000)
}

/// A stamp, in milliseconds.
pub(super) fn stamp(ms: i64) -> Instant {
    Instant::from_ns(ms * 1_000_000)
}

pub(super) fn sample(channel: u32, stamp_ms: i64, value: f64) -> Sample {
    Sample {
        channel,
        stamp: stamp(stamp_ms),
        value,
    }
}

/// Rules for so many channels of one source, without settling and heartbeat.
pub(super) fn plain(channels: usize) -> Rules {
    Rules {
        settle: Duration::ZERO,
        heartbeat: None,
        sources: vec![SourceRules::default()],
        channels: vec![ChannelRules::default(); channels],
        ..Rules::default()
    }
}

/// A sequencer whose sources are connected at the start.
pub(super) fn connected(rules: Rules) -> Sequencer {
    let sources = rules.sources.len();
    let mut sequencer = Sequencer::new(rules, Moment::START);
    (0..sources).for_each(|source| sequencer.connected(source, Moment::START));
    sequencer
}

/// A decision, with the bits of its row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Decided {
    Tick(Instant, Vec<Option<f64>>),
    Beat(Instant, Vec<Option<f64>>),
    Break,
    Back(Instant, Instant),
    Shift(Duration),
    Lag(Duration),
    Sample(Admission),
}

impl Decided {
    fn of(decision: Decision<'_>) -> Self {
        let row = |row: &[f64]| {
            let value = |value: &f64| Some(*value).filter(|value| !value.is_nan());
            row.iter().map(value).collect()
        };
        match decision {
            Decision::Tick { at, row: of } => Self::Tick(at, row(of)),
            Decision::Beat { at, row: of } => Self::Beat(at, row(of)),
            Decision::Break => Self::Break,
            Decision::Back { last, to } => Self::Back(last, to),
            Decision::Lag { least, .. } => Self::Lag(least),
            Decision::Shift { offset, .. } => Self::Shift(offset),
            Decision::Sample(admission) => Self::Sample(admission),
        }
    }
}

/// Lets time pass up to a moment, as a caller does that wakes whenever something is due. Lags are left out.
pub(super) fn pass(sequencer: &mut Sequencer, until: Moment) -> Vec<(Moment, Decided)> {
    let mut all = pass_all(sequencer, until);
    all.retain(|(_, decided)| !matches!(decided, Decided::Lag(_)));
    all
}

/// The same with lags.
pub(super) fn pass_all(sequencer: &mut Sequencer, until: Moment) -> Vec<(Moment, Decided)> {
    let mut decided = Vec::new();
    let mut now = Moment::START;
    while let Some(due) = sequencer.due().filter(|due| *due <= until) {
        now = now.max(due);
        let before = decided.len();
        while let Some(decision) = sequencer.pass(now) {
            decided.push((now, Decided::of(decision)));
        }
        let is_opened = sequencer.due().is_none_or(|next| next > due);
        assert!(
            decided.len() > before || is_opened,
            "due, and nothing to do"
        );
    }
    decided
}

/// The decisions alone.
pub(super) fn decided(sequencer: &mut Sequencer, until: Moment) -> Vec<Decided> {
    let all = pass(sequencer, until).into_iter();
    all.map(|(_, decided)| decided).collect()
}

pub(super) fn tick(ms: i64, row: &[Option<f64>]) -> Decided {
    Decided::Tick(stamp(ms), row.to_vec())
}
