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
//! 4. Of the future: **refused**, or without a trusted host kept until it is known what it was (`judge.rs`): **waits**.
//! 5. Else it is **accepted**, and waits for its tick.
//!
//! A stamp is of the future where it is more than `future` ahead of the trusted host and of the newest stamp and the time since. **The
//! mirror** comes before 2 and 3: where the last tick was of the future by the trusted host, or the majority of sources has gone on
//! before it for a minute, a segment begins, whose times start again ([`Decision::Back`]). No in-order source may be beside.

mod age;
mod decision;
mod gate;
mod judge;
mod pace;
mod rules;
mod source_clock;
mod timeline;
mod turn;

use std::collections::VecDeque;

pub use decision::{Admission, Counts, Decision, Leader, Refusal, Sample};
pub use rules::{ChannelRules, ClockRemedy, ClockRule, Rules, SourceRules};
pub use timeline::Timeline;

use crate::live::Moment;
use crate::time::{Duration, Instant};
use age::Age;
use gate::Gate;
use judge::{Judge, Verdict};
use source_clock::{Judged, Measured, SourceClock};
use turn::Turn;

/// Makes ticks of samples.
#[derive(Debug)]
pub struct Sequencer {
    rules: Rules,
    timeline: Timeline,
    gate: Gate,
    judge: Judge,
    ages: Vec<Age>,
    clocks: Vec<SourceClock>,
    /// The samples that wait, in the order of their arrival, with those that have gone since.
    arrivals: VecDeque<(Moment, Instant)>,
    /// All instants up to here are due.
    due_to: Instant,
    /// The last tick that samples made, and when it was cut.
    measured: Option<(Instant, Moment)>,
    /// The source of its last sample.
    source: usize,
    /// When the last tick or beat was cut.
    cut: Moment,
    /// The latest moment that a caller named.
    now: Moment,
    /// What is being decided of the samples that wait for that.
    turn: Option<Turn>,
    /// The source whose least lag is to be kept anew.
    lagged: Option<usize>,
    /// The source whose held samples are being released, and whether a segment ends before.
    release: Option<(usize, bool)>,
    counts: Vec<Counts>,
    hurried: u64,
}

impl Sequencer {
    /// One that begins now.
    #[must_use]
    pub fn new(rules: Rules, now: Moment) -> Self {
        let timeline = Timeline::new(rules.channels.len(), rules.sources.len());
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
        let mut arrivals = VecDeque::new();
        arrivals.extend(timeline.pending().map(|of| (now, of.stamp)));
        let stamps = timeline.stamps().iter().zip(&rules.channels);
        let newest = stamps.max_by_key(|(stamp, _)| **stamp);
        let source = newest.map_or(0, |(_, of)| of.source);
        let mut judge = Judge::new(&rules);
        let waiting = timeline.waiting().iter();
        waiting.for_each(|of| judge.waits(of.channel as usize));
        Self {
            judge,
            ages: Age::all(&timeline),
            clocks: rules.sources.iter().enumerate().map(clock).collect(),
            gate: Gate::new(&rules, now),
            arrivals,
            due_to: Instant::MIN,
            measured: (last > Instant::MIN).then_some((last, now)),
            source,
            cut: now,
            now,
            turn: None,
            lagged: None,
            release: None,
            counts: vec![Counts::default(); rules.channels.len()],
            hurried: 0,
            timeline,
            rules,
        }
    }

    /// Gives the host's time, read once, where it is known to be right. Until then clocks are not judged by it.
    pub fn synchronise(&mut self, host: Instant, now: Moment) {
        self.set_host(host, now, true);
        self.turn = self.turn.or(self.again());
    }

    /// Gives the host's time as it is, right or not: where sources do not agree it decides between them, and lags are kept by it.
    pub fn guess(&mut self, host: Instant, now: Moment) {
        self.set_host(host, now, false);
    }

    fn set_host(&mut self, host: Instant, now: Moment, is_trusted: bool) {
        self.judge.set_host(host, now, is_trusted);
        for (age, kept) in self.ages.iter_mut().zip(self.timeline.lags()) {
            age.set_host(*kept, host, now);
        }
    }

    /// A source is connected.
    pub fn connected(&mut self, source: usize, now: Moment) {
        self.gate.connected(source, now);
    }

    /// A source has lost its connection.
    pub fn away(&mut self, source: usize, now: Moment) {
        let last = self.timeline.last();
        let channels = &self.rules.channels;
        let mut pending = self.timeline.pending();
        let is_amid =
            pending.any(|of| of.stamp > last && channels[of.channel as usize].source == source);
        self.gate.away(source, is_amid, now);
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
        let source = channel.source;
        self.now = self.now.max(now);
        self.gate.gave(source, now);
        let arrival = self.judge.trusted(now);
        let judged = match self.clocks.get_mut(source) {
            Some(clock) => clock.judge(sample, arrival, now),
            None => Judged::Stamp(sample.stamp),
        };
        if let Judged::Stamp(stamp) = judged {
            self.look(Sample { stamp, ..sample }, source, now);
        }
        let admission = match judged {
            Judged::Held => Admission::Held,
            Judged::Refused(refusal) => Admission::Refused(sample, refusal),
            Judged::Stamp(stamp) => self.admit(Sample { stamp, ..sample }, now, false),
        };
        self.count(sample, admission)
    }

    /// Looks at the stamp of a sample that came, whatever becomes of it.
    fn look(&mut self, sample: Sample, source: usize, now: Moment) {
        let is_known_anew = self.judge.look(sample.channel as usize, sample.stamp, now);
        let Some(age) = self.ages.get_mut(source) else {
            return;
        };
        let lags = is_known_anew && age.lags(sample.stamp, now);
        let lasting = if lags {
            self.judge.lasting(source, now)
        } else {
            None
        };
        age.look(sample.stamp, now, lasting);
        if is_known_anew && age.is_news(self.timeline.lags()[source], &self.judge, now) {
            self.lagged = Some(source);
        }
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
        (self.due_to, self.measured) = (Instant::MIN, None);
        self.judge.begin();
    }

    /// When something is to be decided, if nothing arrives before.
    #[must_use]
    pub fn due(&self) -> Option<Moment> {
        let held = self.clocks.iter().filter_map(SourceClock::due).min();
        let is_deciding = self.release.is_some() || self.turn.is_some() || self.lagged.is_some();
        let first = if is_deciding || self.is_full() || self.is_behind() {
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
                let admission = self.admit(sample, now, false);
                return Some(Decision::Sample(self.count(sample, admission)));
            }
            self.release = None;
        }
        if let Some(source) = self.lagged.take()
            && let Some(least) = self.ages[source].least(&self.judge, now)
        {
            self.timeline.lag(source, least);
            return Some(Decision::Lag { source, least });
        }
        if let Some(Turn::Back(to)) = self.turn {
            return self.go_back(to, now);
        }
        if let Some(admission) = self.take_turn(now) {
            return Some(Decision::Sample(admission));
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
        self.judge.newest(now)
    }

    /// How old the last tick or beat is as a command: by how much more its source lags behind the host than it did at the least.
    #[must_use]
    pub fn age(&self, now: Moment) -> Duration {
        let age = self.ages.get(self.source);
        age.map_or(Duration::ZERO, |age| age.of(self.timeline.last(), now))
    }

    /// Whether a newer tick is due than the last one, so that it is no command. Of recordings and simulations each is one.
    #[must_use]
    pub fn is_superseded(&self) -> bool {
        !self.rules.is_in_order(self.source) && self.is_behind()
    }

    /// Whose clock is ahead of that of a sample that came late or is of the future, where it is one.
    #[must_use]
    pub fn leader(&self, admission: Admission, now: Moment) -> Option<Leader> {
        match admission {
            Admission::Late(sample) => {
                let leader = self.judge.leader(sample.channel as usize, now);
                leader.map(|(source, channel, ahead)| Leader {
                    source,
                    channel,
                    ahead,
                })
            }
            Admission::Refused(sample, Refusal::Future { ahead }) => {
                let channel = sample.channel as usize;
                let source = self.rules.channels.get(channel)?.source;
                Some(Leader {
                    source,
                    channel,
                    ahead,
                })
            }
            _ => None,
        }
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
        self.judge.is_trusted()
    }

    /// Whether so many samples wait that what can be held back is better held back.
    #[must_use]
    pub fn is_crowded(&self) -> bool {
        self.timeline.len() >= self.rules.most / 2
    }

    fn count(&mut self, sample: Sample, admission: Admission) -> Admission {
        if let Some(counts) = self.counts.get_mut(sample.channel as usize) {
            counts.count(admission);
        }
        admission
    }

    /// Decides on a sample, by the rules 2 to 5. `has_waited`: it comes from those that wait.
    fn admit(&mut self, sample: Sample, now: Moment, has_waited: bool) -> Admission {
        let channel = sample.channel as usize;
        let last = self.timeline.last();
        let is_twice = sample.stamp <= self.timeline.stamps()[channel];
        let is_late = sample.stamp <= last;
        let late = self.rules.channels[channel].late;
        let is_too_late = || late.is_zero() || last - sample.stamp > late;
        let is_full = self.timeline.len() >= self.rules.most;
        let can_turn = self.turn.is_none() && !self.is_waiting_full();
        let is_past = is_late && is_too_late() && can_turn;
        if is_past && self.judge.shows_future((channel, sample.stamp), last, now) {
            self.turn = Some(Turn::Back(sample.stamp));
            return self.wait(sample);
        }
        if is_twice {
            return Admission::Twice(sample);
        }
        if is_late && (is_too_late() || is_full) {
            return Admission::Late(sample);
        }
        if let Some(ahead) = self.judge.ahead(channel, sample.stamp, now) {
            match self.weigh(sample, now) {
                Verdict::Open if has_waited || !self.is_waiting_full() => return self.wait(sample),
                Verdict::Gap => {
                    self.judge.set(sample.stamp, now);
                    self.turn = self.again();
                }
                Verdict::Wrong | Verdict::Open => {
                    let source = self.rules.channels[channel].source;
                    let waiting = self.timeline.waiting().len();
                    let is_alone = self.turn.is_some() || waiting == 0;
                    self.turn = self
                        .turn
                        .or((!is_alone).then_some(Turn::WrongClock(source, ahead, waiting)));
                    return Admission::Refused(sample, Refusal::Future { ahead });
                }
            }
        }
        if !self.timeline.accept(sample) {
            return Admission::Twice(sample);
        }
        if !is_late {
            self.arrivals.push_back((now, sample.stamp));
        }
        self.judge.accepted(channel, sample.stamp, now);
        if !has_waited && self.turn.is_none() && self.judge.has_waiting(channel) {
            let waiting = self.timeline.waiting().len();
            self.turn = Some(Turn::WrongStamps(sample, waiting));
        }
        Admission::Accepted(sample)
    }

    fn weigh(&mut self, sample: Sample, now: Moment) -> Verdict {
        if self.judge.is_trusted() {
            return Verdict::Wrong;
        }
        let is_full = self.is_waiting_full();
        let of = (sample.channel as usize, sample.stamp);
        self.judge.weigh(of, now, is_full)
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
        let (_, newest) = self.timeline.next(self.rules.join)?;
        let at = newest.stamp;
        self.source = self.rules.channels[newest.channel as usize].source;
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
