//! Sensors that leap, stand still or fall silent, found while a recording is read.

use std::cell::RefCell;

use athermal_core::compile::origins::{applied, health_reasons, of_truths};
use athermal_core::compile::{Plan, SourceChannel};
use athermal_core::engine::SampleRange;
use athermal_core::time::Instant;
use athermal_run::live::Feed;
use athermal_run::live::monitor::silence::{self, Silence};
use athermal_run::live::monitor::standstill::{self, Standstill};
pub use athermal_run::live::monitor::words::{Purpose, facts};
use athermal_run::live::monitor::{Finding, Monitor, places};
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};
use serde::Serialize;
use serde_json::Value;

use super::leap::{self, Leaps};
use crate::figures::seconds;

/// What is wrong with a channel.
#[derive(Debug)]
pub struct ChannelFaults {
    /// What the recording was read for.
    pub purpose: Purpose,
    /// Its name.
    pub channel: String,
    /// Whether a truth is made of it, so that its faults look like drift.
    pub of_truth: bool,
    /// Where it leaps.
    pub leaps: Option<Leaps>,
    /// Where it stands still.
    pub stuck: Option<Standstill>,
    /// Where it has no sample.
    pub silent: Option<Silence>,
}

impl ChannelFaults {
    fn is_sound(&self) -> bool {
        self.leaps.is_none() && self.stuck.is_none() && self.silent.is_none()
    }

    /// One of its faults, as JSON.
    #[must_use]
    pub fn facts(&self, fault: &impl Serialize) -> Value {
        facts(&self.channel, self.of_truth, fault)
    }
}

/// A recording whose channels are looked at when it is first read.
pub struct FaultWatch<'a> {
    recording: &'a dyn Recording,
    purpose: Purpose,
    state: RefCell<State>,
}

enum State {
    Unread,
    Read(ChannelWatch),
}

/// The channels of a plan, which are looked at row by row.
pub struct ChannelWatch {
    channels: Vec<WatchedChannel>,
    /// Where in a row the value of each stands; nowhere once a graph has taken over that does not read it.
    places: Vec<Option<usize>>,
}

/// A channel that is looked at, with what is looked for.
struct WatchedChannel {
    source: SourceChannel,
    of_truth: bool,
    leaps: Option<leap::Finder>,
    stuck: Option<standstill::Finder>,
    silent: Option<silence::Finder>,
}

impl<'a> FaultWatch<'a> {
    /// Watches over this recording.
    pub fn new(recording: &'a dyn Recording, purpose: Purpose) -> Self {
        Self {
            recording,
            purpose,
            state: RefCell::new(State::Unread),
        }
    }

    /// The channels of which something is wrong, in the order of the plan.
    pub fn found(self) -> Vec<ChannelFaults> {
        match self.state.into_inner() {
            State::Unread => Vec::new(),
            State::Read(looks) => looks.found(self.purpose),
        }
    }
}

/// Whether the only leap is that of a sensor which goes on after it was stuck at a usual value.
fn ends(leaps: &Leaps, stuck: &Standstill) -> bool {
    let (low, high) = leaps.usual;
    let is_usual = (low..=high).contains(&stuck.value);
    leaps.count == 1 && is_usual && leaps.first.from == stuck.value
}

impl Recording for FaultWatch<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let rows = self.recording.open(plan)?;
        let mut state = self.state.borrow_mut();
        if let State::Read(_) = *state {
            return Ok(rows);
        }
        *state = State::Read(ChannelWatch::at(plan));
        Ok(Box::new(Looking {
            rows,
            state: &self.state,
        }))
    }
}

impl ChannelWatch {
    /// Watches the channels of this plan.
    pub fn at(plan: &Plan) -> Self {
        let (watched, applied) = (health_reasons(plan), applied(plan));
        let channels = plan.sources.iter().zip(leap::finders(plan));
        let channels = channels.zip(of_truths(plan)).enumerate();
        let looked = channels.map(|(slot, ((source, leaps), of_truth))| {
            let rests = source.rests();
            let steps = source.planned.is_some() || source.is_instant || applied[slot];
            // Such a node takes out what is stuck.
            let stuck = !rests && !applied[slot] && !watched.contains_key(&slot);
            WatchedChannel {
                source: source.clone(),
                of_truth,
                leaps: leaps.filter(|_| !steps),
                stuck: stuck.then(Default::default),
                silent: (!rests).then(Default::default),
            }
        });
        let channels: Vec<WatchedChannel> = looked.collect();
        Self {
            places: (0..channels.len()).map(Some).collect(),
            channels,
        }
    }

    /// The channels of which something is wrong, in the order of the plan.
    pub fn found(self, purpose: Purpose) -> Vec<ChannelFaults> {
        let all = self.channels.into_iter().map(|of| {
            let stuck = of.stuck.and_then(|finder| {
                // What never changes is named by a fit, and as a truth by its scores.
                let counts = finder.changes() > 0 || (purpose != Purpose::Fit && !of.of_truth);
                finder.found().filter(|_| counts)
            });
            let leaps = of.leaps.and_then(|finder| finder.found());
            ChannelFaults {
                purpose,
                channel: of.source.name,
                of_truth: of.of_truth,
                leaps: leaps.filter(|leaps| !stuck.is_some_and(|stuck| ends(leaps, &stuck))),
                stuck,
                // A position that is only measured now and then, or in the fit alone, is none that fails.
                silent: of.silent.and_then(|finder| {
                    if of.of_truth {
                        finder.lasting()
                    } else {
                        finder.found()
                    }
                }),
            }
        });
        all.filter(|of| !of.is_sound()).collect()
    }
}

impl Monitor for ChannelWatch {
    fn row(&mut self, now: Instant, values: &[f64], _: &mut Vec<Finding>) {
        let at_s = seconds(now);
        for (of, place) in self.channels.iter_mut().zip(&self.places) {
            if let Some(&value) = place.and_then(|place| values.get(place)) {
                of.row(at_s, value);
            }
        }
    }

    fn segment(&mut self) {
        self.channels.iter_mut().for_each(WatchedChannel::interrupt);
    }

    fn follow(&mut self, plan: &Plan, feed: &[Feed], _: &[SampleRange], _: &mut Vec<Finding>) {
        let mut before = std::mem::take(&mut self.places);
        let mut added = Vec::new();
        for (new, place) in Self::at(plan).channels.into_iter().zip(places(plan, feed)) {
            let known = before.iter().position(|of| of.is_some() && *of == place);
            match known {
                Some(nth) if self.channels[nth].is_looked_at_as(&new) => {
                    self.channels[nth].source = new.source;
                }
                // What was found of it until now is reported as it was looked at then.
                known => {
                    known.into_iter().for_each(|nth| before[nth] = None);
                    added.push((new, place));
                }
            }
        }
        let read: Vec<_> = places(plan, feed).collect();
        before
            .iter_mut()
            .filter(|place| !read.contains(place))
            .for_each(|place| *place = None);
        self.places = before;
        for (new, place) in added {
            self.channels.push(new);
            self.places.push(place);
        }
    }
}

impl WatchedChannel {
    /// Whether the same is looked for as in another.
    fn is_looked_at_as(&self, other: &Self) -> bool {
        let what = |of: &Self| {
            let finders = (of.leaps.is_some(), of.stuck.is_some(), of.silent.is_some());
            (of.of_truth, finders)
        };
        what(self) == what(other)
    }

    fn row(&mut self, at_s: f64, value: f64) {
        let admitted = self.source.admits(value);
        if let Some(silent) = &mut self.silent {
            silent.push(at_s, admitted);
        }
        if admitted {
            if let Some(leaps) = &mut self.leaps {
                leaps.push(at_s, value);
            }
            if let Some(stuck) = &mut self.stuck {
                stuck.push(at_s, value);
            }
        }
    }

    fn interrupt(&mut self) {
        if let Some(leaps) = &mut self.leaps {
            leaps.interrupt();
        }
        if let Some(stuck) = &mut self.stuck {
            stuck.interrupt();
        }
        if let Some(silent) = &mut self.silent {
            silent.interrupt();
        }
    }
}

struct Looking<'a> {
    rows: Box<dyn Source + 'a>,
    state: &'a RefCell<State>,
}

impl Source for Looking<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        let event = self.rows.next(samples)?;
        if let State::Read(looks) = &mut *self.state.borrow_mut() {
            match event {
                Some(Event::Row(now)) => looks.row(now, &samples.values, &mut Vec::new()),
                Some(Event::Segment) => looks.segment(),
                None => {}
            }
        }
        Ok(event)
    }
}
