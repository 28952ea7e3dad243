//! Which samples make a tick, and when it is cut. A pure state machine: it reads no clock and waits for nothing.
//!
//! A caller hands over what arrives, asks when something is due, and lets time pass:
//!
//! ```text
//!  arrive(sample, now) ─▶ Admission        accepted · late · twice · refused · held
//!  due() ───────────────▶ Moment           when to call `pass` again
//!  pass(now) ───────────▶ Decision …       tick · beat · break · shift, until there is none
//! ```
//!
//! `now` is monotonic and decides only *when* ticks are cut. What they hold follows from stamps alone: with delays below
//! [`Rules::wait`], any order of arrival gives the same ticks. The decisions are what is journalled; a [`Timeline`] applies them again.
//!
//! The rules for a sample, in order:
//!
//! 1. Its source's clock is judged ([`ClockRule`]).
//! 2. Not after its channel's last stamp, or waiting already: **twice**.
//! 3. Not after the last tick: **late**, or within the channel's `late` given to the next tick.
//! 4. Further than `future` ahead of the newest stamp and the time since: **refused**, unless its source gives stamps in order.
//! 5. Else it is **accepted**, and waits.

mod decision;
mod gate;
mod rules;
mod source_clock;
mod timeline;

use std::collections::VecDeque;

pub use decision::{Admission, Counts, Decision, Refusal, Sample};
pub use rules::{ChannelRules, ClockRemedy, ClockRule, Rules, SourceRules};
pub use timeline::Timeline;

use crate::moment::Moment;
use crate::time::{Duration, Instant};
use gate::Gate;
use source_clock::{Judged, Measured, SourceClock};

/// How much faster than the host a source's clock is allowed to fall behind until its newest stamp no longer counts: 100 ppm.
const DRIFT: i64 = 10_000;

/// Makes ticks of samples.
#[derive(Debug)]
pub struct Sequencer {
    rules: Rules,
    timeline: Timeline,
    gate: Gate,
    clocks: Vec<SourceClock>,
    /// The samples that wait, in the order of their arrival, with those that have gone since.
    arrivals: VecDeque<(Moment, Instant)>,
    /// All instants up to here are due.
    due_to: Instant,
    /// The newest stamp that was accepted, and when.
    newest: Option<(Instant, Moment)>,
    /// The last tick that samples made, and when it was cut.
    measured: Option<(Instant, Moment)>,
    /// When the last tick or beat was cut.
    cut: Moment,
    /// The latest moment that a caller named.
    now: Moment,
    /// The host's time at the start of the monotonic clock.
    epoch: Option<Instant>,
    /// The source whose held samples are being released, and whether a segment ends before.
    release: Option<(usize, bool)>,
    counts: Vec<Counts>,
    hurried: u64,
}

impl Sequencer {
    /// One that begins now.
    #[must_use]
    pub fn new(rules: Rules, now: Moment) -> Self {
        let timeline = Timeline::new(rules.channels.len(), rules.sources.len(), rules.most);
        Self::resume(rules, timeline, now)
    }

    /// One that goes on from a place in a log. What waits there waits anew.
    #[must_use]
    pub fn resume(rules: Rules, mut timeline: Timeline, now: Moment) -> Self {
        timeline.fit(rules.channels.len(), rules.sources.len(), rules.most);
        let patience = rules.settle.max(rules.wait);
        let clock = |(nth, source): (usize, &SourceRules)| {
            let mut clock = SourceClock::new(source.clock, patience);
            let channels = rules.channels.iter().zip(timeline.stamps());
            let own = channels.filter(|(of, _)| of.source == nth);
            let newest = own.map(|(_, &stamp)| stamp).max();
            clock.resume(timeline.offsets()[nth], newest.unwrap_or(Instant::MIN));
            clock
        };
        let last = timeline.last();
        let mut arrivals = VecDeque::with_capacity(rules.most);
        arrivals.extend(timeline.pending().map(|of| (now, of.stamp)));
        Self {
            clocks: rules.sources.iter().enumerate().map(clock).collect(),
            gate: Gate::new(&rules, now),
            arrivals,
            due_to: Instant::MIN,
            newest: None,
            measured: (last > Instant::MIN).then_some((last, now)),
            cut: now,
            now,
            epoch: None,
            release: None,
            counts: vec![Counts::default(); rules.channels.len()],
            hurried: 0,
            timeline,
            rules,
        }
    }

    /// Gives the host's time, read once, where it is known to be right. Until then clocks are not judged, and the first stamp may be
    /// any. From the first stamp on, it is the newest one that others are compared with: a source may be slow.
    pub fn synchronise(&mut self, host: Instant, now: Moment) {
        self.epoch = Some(host - (now - Moment::START));
    }

    /// A source is connected.
    pub fn connected(&mut self, source: usize, now: Moment) {
        self.gate.connected(source, now);
    }

    /// A source has lost its connection.
    pub fn away(&mut self, source: usize, now: Moment) {
        self.gate.away(source, now);
    }

    /// A source has come to its end.
    pub fn ended(&mut self, source: usize) {
        self.gate.ended(source);
    }

    /// Takes a sample.
    pub fn arrive(&mut self, sample: Sample, now: Moment) -> Admission {
        let Some(channel) = self.rules.channels.get(sample.channel as usize) else {
            return Admission::Refused(sample, Refusal::NoChannel);
        };
        self.now = self.now.max(now);
        let arrival = self.host_time(now);
        let judged = match self.clocks.get_mut(channel.source) {
            Some(clock) => clock.judge(sample, arrival, now),
            None => Judged::Stamp(sample.stamp),
        };
        let admission = match judged {
            Judged::Held => Admission::Held,
            Judged::Refused(refusal) => Admission::Refused(sample, refusal),
            Judged::Stamp(stamp) => self.admit(Sample { stamp, ..sample }, now),
        };
        self.count(sample, admission)
    }

    /// Whether samples of a source are held until the offset of its clock is known.
    #[must_use]
    pub fn holds(&self, source: usize) -> bool {
        let clock = self.clocks.get(source);
        clock.is_some_and(|clock| clock.due().is_some())
    }

    /// The times of what follows may start again. What waits is to be taken with [`finish`](Self::finish) before.
    pub fn segment(&mut self) {
        self.timeline.segment(true);
        self.arrivals.clear();
        (self.due_to, self.newest, self.measured) = (Instant::MIN, None, None);
    }

    /// When something is to be decided, if nothing arrives before.
    #[must_use]
    pub fn due(&self) -> Option<Moment> {
        let held = self.clocks.iter().filter_map(SourceClock::due).min();
        let first = if self.release.is_some() || self.is_full() || self.is_behind() {
            Some(self.now)
        } else if held.is_some() {
            None
        } else {
            let waiting = self.waits_since().map(|since| since + self.hold());
            let first = waiting.or_else(|| self.beat_due());
            first.map(|first| first.max(self.gate.due().unwrap_or(self.now)))
        };
        [held, first].into_iter().flatten().min()
    }

    /// Decides what is due, one after the other; none once there is no more.
    pub fn pass(&mut self, now: Moment) -> Option<Decision<'_>> {
        self.now = self.now.max(now);
        if let Some((source, ends_segment)) = self.release {
            if ends_segment {
                return Some(self.end_segment(now));
            }
            if let Some(sample) = self.clocks.get_mut(source).and_then(SourceClock::release) {
                let admission = self.admit(sample, now);
                return Some(Decision::Sample(self.count(sample, admission)));
            }
            self.release = None;
        }
        let mut clocks = self.clocks.iter();
        let held = clocks.position(|clock| clock.due().is_some_and(|due| due <= now));
        if let Some(source) = held {
            let measured = self.clocks[source].measure();
            self.release = Some((source, false));
            if let Measured::Offset { offset, went_back } = measured {
                self.release = Some((source, went_back));
                self.timeline.shift(source, offset);
                return Some(Decision::Shift { source, offset });
            }
            return self.pass(now);
        }
        let is_held = self.clocks.iter().any(|clock| clock.due().is_some());
        let is_open = self.gate.is_open(now) && !is_held;
        if is_open {
            self.find_due(now);
        }
        if self.is_behind() {
            return self.cut(now);
        }
        if self.is_full() {
            self.hurried += 1;
            return self.cut(now);
        }
        if is_open && self.waits_since().is_none() && self.beat_due()? <= now {
            return self.beat(now);
        }
        None
    }

    /// Takes all that waits, without waiting any longer; none once there is no more. For the end.
    pub fn finish(&mut self, now: Moment) -> Option<Decision<'_>> {
        let held = self.clocks.iter().position(|clock| clock.due().is_some());
        if self.release.is_some() || held.is_some() {
            return self.pass(Moment::from_ns(i64::MAX));
        }
        self.cut(now)
    }

    /// The newest stamp that was accepted and the time since: what time it is at the sources. None before the first.
    #[must_use]
    pub fn newest(&self, now: Moment) -> Option<Instant> {
        self.newest.map(|(newest, when)| newest + (now - when))
    }

    /// What waits, and where the log is.
    #[must_use]
    pub fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// What became of the samples of each channel.
    #[must_use]
    pub fn counts(&self) -> &[Counts] {
        &self.counts
    }

    /// How many ticks were cut early because too many samples waited.
    #[must_use]
    pub fn hurried(&self) -> u64 {
        self.hurried
    }

    /// Whether the host's time has been given.
    #[must_use]
    pub fn is_synchronised(&self) -> bool {
        self.epoch.is_some()
    }

    fn host_time(&self, now: Moment) -> Option<Instant> {
        self.epoch.map(|epoch| epoch + (now - Moment::START))
    }

    fn count(&mut self, sample: Sample, admission: Admission) -> Admission {
        if let Some(counts) = self.counts.get_mut(sample.channel as usize) {
            counts.count(admission);
        }
        admission
    }

    fn admit(&mut self, sample: Sample, now: Moment) -> Admission {
        let channel = sample.channel as usize;
        let last = self.timeline.last();
        if sample.stamp <= self.timeline.stamps()[channel] {
            return Admission::Twice(sample);
        }
        let is_late = sample.stamp <= last;
        let late = self.rules.channels[channel].late;
        let is_too_late = || late.is_zero() || last - sample.stamp > late;
        if is_late && (is_too_late() || self.timeline.len() >= self.rules.most) {
            return Admission::Late(sample);
        }
        let source = self.rules.sources.get(self.rules.channels[channel].source);
        let is_in_order = source.is_some_and(|source| source.is_in_order);
        let known = || self.newest(now).or_else(|| self.host_time(now));
        if !is_in_order && let Some(newest) = known() {
            let ahead = sample.stamp - newest;
            if ahead > self.rules.future {
                return Admission::Refused(sample, Refusal::Future { ahead });
            }
        }
        if !self.timeline.accept(sample) {
            return Admission::Twice(sample);
        }
        if !is_late {
            self.arrivals.push_back((now, sample.stamp));
        }
        // A backlog does not move what is the newest; a clock that is slow by no more than its drift does.
        let is_newest = self.newest.is_none_or(|(newest, when)| {
            let since = now - when;
            sample.stamp >= newest + since - Duration::from_ns(since.as_ns() / DRIFT)
        });
        if is_newest {
            self.newest = Some((sample.stamp, now));
        }
        Admission::Accepted(sample)
    }

    /// An instant is held until its last sample has come, whatever the order.
    fn hold(&self) -> Duration {
        self.rules.wait + self.rules.join
    }

    /// Since when something waits that is not due.
    fn waits_since(&self) -> Option<Moment> {
        let passed = self.timeline.last().max(self.due_to);
        let mut waiting = self.arrivals.iter();
        waiting
            .find(|(_, stamp)| *stamp > passed)
            .map(|&(when, _)| when)
    }

    fn find_due(&mut self, now: Moment) {
        let hold = self.hold();
        while let Some(&(when, stamp)) = self.arrivals.front() {
            if when + hold > now && stamp > self.timeline.last() {
                break;
            }
            self.due_to = self.due_to.max(stamp);
            self.arrivals.pop_front();
        }
    }

    /// Whether an instant waits that is due.
    fn is_behind(&self) -> bool {
        self.timeline
            .next(self.rules.join)
            .is_some_and(|(first, _)| first <= self.due_to)
    }

    fn is_full(&self) -> bool {
        self.timeline.len() >= self.rules.most && self.timeline.next(self.rules.join).is_some()
    }

    fn cut(&mut self, now: Moment) -> Option<Decision<'_>> {
        let (_, at) = self.timeline.next(self.rules.join)?;
        self.measured = Some((at, now));
        self.cut = now;
        let row = self.timeline.tick(at);
        Some(Decision::Tick { at, row })
    }

    fn beat_due(&self) -> Option<Moment> {
        let (measured, when) = self.measured?;
        let regular = self.cut + self.rules.heartbeat?;
        // Before, the beat would not be after the last one.
        let ahead = self.timeline.last() - measured + self.hold() + Duration::from_ns(1);
        Some(regular.max(when + ahead))
    }

    /// A beat is never ahead of a sample that is on its way for less than `wait`.
    fn beat(&mut self, now: Moment) -> Option<Decision<'_>> {
        let (measured, when) = self.measured?;
        let at = measured + ((now - when) - self.hold());
        self.cut = now;
        let row = self.timeline.tick(at);
        Some(Decision::Beat { at, row })
    }

    fn end_segment(&mut self, now: Moment) -> Decision<'_> {
        if self.timeline.next(self.rules.join).is_none() {
            if let Some((_, ends_segment)) = &mut self.release {
                *ends_segment = false;
            }
            self.timeline.segment(false);
            return Decision::Break;
        }
        self.cut(now).unwrap_or(Decision::Break)
    }
}

#[cfg(test)]
mod tests;
