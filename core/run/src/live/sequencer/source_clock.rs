//! What is made of the stamps of a source whose clock is wrong.

use super::{ClockRemedy, ClockRule, Refusal, Sample};
use crate::live::Moment;
use crate::time::{Duration, Instant};

/// Of so many samples the median offset is taken.
const SAMPLES: usize = 20;

/// The clock of a source, judged by arrivals.
#[derive(Debug)]
pub(super) struct SourceClock {
    rule: Option<ClockRule>,
    /// The offset is known so long after the first held sample at the latest.
    patience: Duration,
    offset: Option<Duration>,
    /// The newest stamp, as the source gave it.
    newest: Instant,
    held: Vec<(Sample, Duration)>,
    deadline: Option<Moment>,
}

/// What becomes of a stamp.
#[derive(Debug, PartialEq)]
pub(super) enum Judged {
    Stamp(Instant),
    Refused(Refusal),
    Held,
}

/// What held samples have come to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Measured {
    /// The offset that held before goes on: what came was a backlog, not another clock.
    Same,
    /// Another offset. `went_back`: the source's clock has been set back.
    Offset { offset: Duration, went_back: bool },
}

impl SourceClock {
    pub(super) fn new(rule: Option<ClockRule>, patience: Duration) -> Self {
        Self {
            rule,
            patience,
            offset: None,
            newest: Instant::MIN,
            held: Vec::with_capacity(SAMPLES),
            deadline: None,
        }
    }

    /// Goes on with an offset, and the newest stamp that it led to.
    pub(super) fn resume(&mut self, offset: Option<Duration>, newest: Instant) {
        self.offset = offset;
        if newest > Instant::MIN {
            self.newest = newest - offset.unwrap_or_default();
        }
    }

    /// Judges a sample that came at an instant of the host's time; none where that is not known.
    ///
    /// An offset is kept as long as it fits, over reconnects too: a repeated sample then has the stamp that it had.
    pub(super) fn judge(
        &mut self,
        sample: Sample,
        arrival: Option<Instant>,
        now: Moment,
    ) -> Judged {
        let offset = self.offset.unwrap_or_default();
        let stamp = sample.stamp + offset;
        let (Some(rule), Some(arrival)) = (self.rule, arrival) else {
            return Judged::Stamp(stamp);
        };
        let off = arrival - stamp;
        let is_within = off <= rule.within && -off <= rule.within;
        match rule.otherwise {
            _ if is_within && self.held.is_empty() => {
                self.newest = self.newest.max(sample.stamp);
                Judged::Stamp(stamp)
            }
            ClockRemedy::Refuse => Judged::Refused(Refusal::Clock { off }),
            ClockRemedy::Arrival => Judged::Stamp(arrival),
            ClockRemedy::Shift if self.held.is_empty() && self.is_backlog(sample.stamp, off) => {
                self.newest = sample.stamp;
                Judged::Stamp(stamp)
            }
            ClockRemedy::Shift => {
                self.held.push((sample, arrival - sample.stamp));
                let deadline = *self.deadline.get_or_insert(now + self.patience);
                if self.held.len() >= SAMPLES {
                    self.deadline = Some(deadline.min(now));
                }
                Judged::Held
            }
        }
    }

    /// When held samples are decided on.
    pub(super) fn due(&self) -> Option<Moment> {
        self.deadline
    }

    /// Takes the median of what was held.
    pub(super) fn measure(&mut self) -> Measured {
        self.deadline = None;
        let before = self.offset.unwrap_or_default();
        let goes_on = |(sample, off): &(Sample, Duration)| {
            let within = self.rule.map_or(Duration::ZERO, |rule| rule.within);
            let off = *off - before;
            off <= within && -off <= within || self.is_backlog(sample.stamp, off)
        };
        if self.held.iter().any(goes_on) {
            return Measured::Same;
        }
        let mut offsets = [Duration::ZERO; SAMPLES];
        let offsets = &mut offsets[..self.held.len().min(SAMPLES)];
        for (offset, (_, off)) in offsets.iter_mut().zip(&self.held) {
            *offset = *off;
        }
        offsets.sort_unstable();
        let Some(&offset) = offsets.get(offsets.len() / 2) else {
            return Measured::Same;
        };
        let went_back = self.newest > Instant::MIN && offset > before;
        self.offset = Some(offset);
        self.newest = Instant::MIN;
        Measured::Offset { offset, went_back }
    }

    /// The next held sample, by the offset that holds now.
    pub(super) fn release(&mut self) -> Option<Sample> {
        if self.held.is_empty() {
            return None;
        }
        let (sample, _) = self.held.remove(0);
        self.newest = self.newest.max(sample.stamp);
        Some(Sample {
            stamp: sample.stamp + self.offset.unwrap_or_default(),
            ..sample
        })
    }

    /// Whether a stamp that is behind its arrival follows on the newest one: then it is old, and the clock as it was.
    fn is_backlog(&self, stamp: Instant, off: Duration) -> bool {
        !off.is_negative() && self.newest > Instant::MIN && stamp > self.newest
    }
}
