//! Decides of which faults of sensors in recorded data people are told, and in what words; what a fault is, is decided elsewhere.

use std::cell::RefCell;

use athermal::Instant;
use athermal::core::compile::origins::{health_reasons, of_truths};
use athermal::core::compile::{Plan, SourceChannel};
use athermal::core::engine::SampleRange;
use athermal::diagnosis::leap::{self, Leaps};
use athermal::run::live::monitor::silence::{self, Silence};
use athermal::run::live::monitor::standstill::{self, Standstill};
use athermal::run::live::monitor::{Monitor, places};
use athermal::run::live::{Feed, Reporter};
use athermal::run::recording::{Event, Recording, Samples, Source, SourceError};

use serde::Serialize;
use serde_json::{Value, json};

use crate::message::Message;
use crate::terminal::Terminal;
use athermal_analysis::figures::{count, counted, instant, number, seconds};

/// What a recording is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Models learn from it.
    Fit,
    /// Models are set against it.
    Scores,
    /// Models predict from it.
    Run,
}

/// What is wrong with a channel.
#[derive(Debug)]
pub struct Faulty {
    purpose: Purpose,
    /// Its name.
    pub(super) channel: String,
    /// Whether a truth is made of it, so that its faults look like drift.
    pub(super) of_truth: bool,
    /// Where it leaps.
    pub(super) leaps: Option<Leaps>,
    /// Where it stands still.
    pub(super) stuck: Option<Standstill>,
    /// Where it has no sample.
    pub(super) silent: Option<Silence>,
}

impl Faulty {
    fn is_sound(&self) -> bool {
        self.leaps.is_none() && self.stuck.is_none() && self.silent.is_none()
    }

    /// What programs are told of one of its faults.
    pub(super) fn facts(&self, fault: &impl Serialize) -> Value {
        facts(&self.channel, self.of_truth, fault)
    }

    fn signal(&self) -> &str {
        let name = self.channel.split_once('.');
        name.map_or(&self.channel, |(signal, _)| signal)
    }
}

/// What programs are told of a fault of a channel.
pub fn facts(channel: &str, of_truth: bool, fault: &impl Serialize) -> Value {
    let mut facts = json!({ "channel": channel, "of_truth": of_truth });
    if let (Value::Object(all), Value::Object(found)) = (&mut facts, json!(fault)) {
        all.extend(found);
    }
    facts
}

/// A recording whose channels are looked at when it is first read.
pub struct FaultWatch<'a> {
    recording: &'a dyn Recording,
    purpose: Purpose,
    state: RefCell<State>,
}

enum State {
    Unread,
    Read(Looks),
}

/// The channels of a plan, which are looked at row by row.
pub struct Looks {
    channels: Vec<Looked>,
    /// Where in a row the value of each stands; nowhere once a graph has taken over that does not read it.
    places: Vec<Option<usize>>,
}

/// A channel that is looked at, with what is looked for.
struct Looked {
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
    pub fn found(self) -> Vec<Faulty> {
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
        *state = State::Read(Looks::at(plan));
        Ok(Box::new(Looking {
            rows,
            state: &self.state,
        }))
    }
}

impl Looks {
    /// Looks at the channels of this plan.
    pub fn at(plan: &Plan) -> Self {
        let watched = health_reasons(plan);
        let channels = plan.sources.iter().zip(leap::finders(plan));
        let channels = channels.zip(of_truths(plan)).enumerate();
        let looked = channels.map(|(slot, ((source, leaps), of_truth))| {
            let rests = source.optional;
            // Such a node takes out what is stuck.
            let stuck = !rests && !watched.contains_key(&slot);
            Looked {
                source: source.clone(),
                of_truth,
                leaps,
                stuck: stuck.then(Default::default),
                silent: (!rests).then(Default::default),
            }
        });
        let channels: Vec<Looked> = looked.collect();
        Self {
            places: (0..channels.len()).map(Some).collect(),
            channels,
        }
    }

    /// The channels of which something is wrong, in the order of the plan.
    pub fn found(self, purpose: Purpose) -> Vec<Faulty> {
        let all = self.channels.into_iter().map(|of| {
            let stuck = of.stuck.and_then(|finder| {
                // What never changes is named by a fit, and as a truth by its scores.
                let counts = finder.changes() > 0 || (purpose != Purpose::Fit && !of.of_truth);
                finder.found().filter(|_| counts)
            });
            let leaps = of.leaps.and_then(|finder| finder.found());
            Faulty {
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

impl Monitor for Looks {
    fn row(&mut self, now: Instant, samples: &Samples, _reporter: &dyn Reporter) {
        let at_s = seconds(now);
        for (of, place) in self.channels.iter_mut().zip(&self.places) {
            if let Some(&value) = place.and_then(|place| samples.values.get(place)) {
                of.row(at_s, value);
            }
        }
    }

    fn segment(&mut self) {
        self.channels.iter_mut().for_each(Looked::interrupt);
    }

    fn follow(&mut self, plan: &Plan, feed: &[Feed], _usual: &[SampleRange]) {
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

impl Looked {
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
                Some(Event::Row(now)) => looks.row(now, samples, &()),
                Some(Event::Segment) => looks.segment(),
                None => {}
            }
        }
        Ok(event)
    }
}

/// Tells of them.
pub fn tell(terminal: &Terminal, all: &[Faulty]) {
    for told in told(all) {
        terminal.warning(told);
    }
}

/// What is told of them, a sentence for each fault.
pub fn told(all: &[Faulty]) -> Vec<Message> {
    let mut told = Vec::new();
    for faulty in all {
        let channel = &faulty.channel;
        let mut tell = |name, facts: Value, words| told.push(Message::new(name, facts, words));
        if let Some(leaps) = &faulty.leaps {
            let (at, then) = (instant(leaps.first.at_s), of_leaps(faulty, leaps));
            let words = format!("{channel} {leaps}, at {at}: {then}");
            tell("leaps", faulty.facts(leaps), words);
        }
        if let Some(stuck) = &faulty.stuck {
            let words = format!(
                "{channel} is {} in {} samples one after the other, from {} to {}: {}",
                number(stuck.value),
                count(stuck.samples),
                instant(stuck.from_s),
                instant(stuck.to_s),
                of_standstill(faulty.of_truth, faulty.purpose)
            );
            tell("stuck", faulty.facts(stuck), words);
        }
        if let Some(silent) = &faulty.silent {
            let words = format!("{channel} has no sample in {}", of_silence(faulty, silent));
            tell("silent", faulty.facts(silent), words);
        }
    }
    told
}

fn of_silence(faulty: &Faulty, silent: &Silence) -> String {
    let never = silent.rows == silent.of_rows;
    let rows = if never {
        format!("any of {}", counted(silent.rows, "row"))
    } else {
        format!(
            "{} of {} rows, from {} to {}",
            count(silent.rows),
            count(silent.of_rows),
            instant(silent.from_s),
            instant(silent.to_s)
        )
    };
    let asked = match (faulty.of_truth, never) {
        (true, _) => "is it not measured any more?",
        (false, true) => "is the sensor connected, and its column the right one?",
        (false, false) => "did the sensor fail?",
    };
    let then = match (faulty.of_truth, faulty.purpose) {
        (true, Purpose::Fit) => "Nothing is learned of it there",
        (true, Purpose::Scores) => {
            "Nothing is scored there, and what goes by it or by errors has none"
        }
        (true, Purpose::Run) => "What goes by it or by errors has none there",
        (false, Purpose::Fit) => "What needs it learns nothing there",
        (false, Purpose::Scores | Purpose::Run) => "What needs it predicts nothing there",
    };
    format!("{rows}: {asked} {then}")
}

fn of_leaps(faulty: &Faulty, leaps: &Leaps) -> String {
    if faulty.of_truth {
        let then = match faulty.purpose {
            Purpose::Fit => {
                "That is learned as drift: begin another file there and give all of them with `--segments`, or leave the rows of \
                 the largest drifts out by `train.abs_truth`"
            }
            Purpose::Scores => {
                "That counts as drift: begin another file there and give all of them with `--segments`"
            }
            Purpose::Run => "That was taken for drift",
        };
        return format!("was it moved, or zeroed anew? {then}");
    }
    let then = match faulty.purpose {
        Purpose::Fit => "That is learned too",
        Purpose::Scores | Purpose::Run => "Predictions from that mean nothing",
    };
    let (low, high) = leaps.usual;
    let usual = low..=high;
    if usual.contains(&leaps.first.from) && usual.contains(&leaps.first.to) {
        return format!(
            "did the sensor fail? {then}: no `range` tells such samples from others, so leave these rows out"
        );
    }
    format!(
        "did the sensor fail? {then}: leave such samples out by a `range` in [signals.{}]; nine in ten are between {} and {}",
        faulty.signal(),
        number(low),
        number(high)
    )
}

/// What to think of a standstill.
pub fn of_standstill(of_truth: bool, purpose: Purpose) -> &'static str {
    match (of_truth, purpose) {
        (true, Purpose::Fit) => {
            "is its measurement stuck? That is learned as no drift: leave these rows out"
        }
        (true, Purpose::Scores) => "is its measurement stuck? That counts as no drift",
        (true, Purpose::Run) => "is its measurement stuck? That is taken for no drift",
        (false, Purpose::Fit) => {
            "is the sensor stuck? That is learned too: leave these rows out, or have a `health` node take them out"
        }
        (false, Purpose::Scores | Purpose::Run) => {
            "is the sensor stuck? Predictions from that mean little; a `health` node takes such samples out"
        }
    }
}
