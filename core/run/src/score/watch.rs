//! Decides what is written down while an engine is driven, so that predictions can be scored.

use std::collections::BTreeMap;

use super::evidence::Tally;
use super::fallback::Fallen;
use super::interval::Intervals;
use super::paired::link;
use crate::compile::{Plan, TruthLink, persistence_lag};
use crate::engine::{Cursor, Engine, History, Mode, Pairing, StepLength, times};
use crate::recording::Event;
use crate::time::{Duration, Instant};

/// Everything scored of one plan.
#[derive(Debug)]
pub struct Watch {
    /// The truths that are predicted.
    pub truths: Vec<Truth>,
    pub(super) tallies: Vec<Tally>,
    pub(super) fallen: Vec<Fallen>,
}

/// A truth and all predictions of it.
#[derive(Debug)]
pub struct Truth {
    pub(crate) slot: usize,
    /// The slot of its standard error, where its node gives one.
    error_slot: Option<usize>,
    /// Its values, in the order of time.
    pub values: Vec<f64>,
    pub(crate) errors: Vec<f64>,
    /// When the last one of the segment was measured, and how long after the one before each was.
    last: Option<Instant>,
    between: Vec<Duration>,
    /// What predicts it.
    pub predictions: Vec<Prediction>,
    /// Persistence for each horizon.
    pub persistences: BTreeMap<Duration, Persistence>,
}

/// A predicted channel.
#[derive(Debug)]
pub struct Prediction {
    /// Its slot.
    pub slot: usize,
    pub(crate) node: usize,
    /// Its horizon.
    pub ahead: Duration,
    pairing: Pairing,
    /// What was predicted for each value of the truth; NaN where nothing was.
    pub values: Vec<f64>,
    /// At how many ticks it was there.
    pub(super) given: u64,
    /// Where its intervals come from, if it has any.
    pub(crate) intervals: Option<Intervals>,
    /// Both ends of each.
    pub(crate) ends: Vec<[f64; 2]>,
}

/// The newest truth that a prediction of one horizon may read in a mode: in one step that at the smallest lag that sees
/// nothing of the answer.
#[derive(Debug)]
pub struct Persistence {
    lag: Duration,
    ahead: Duration,
    mode: Mode,
    step: StepLength,
    max_age: Duration,
    history: History,
    cursor: Cursor,
    pairing: Pairing,
    /// The persisted value for each value of the truth; NaN where there is none.
    pub values: Vec<f64>,
}

impl Watch {
    /// Watches all that a plan predicts.
    pub fn new(plan: &Plan, mode: Mode) -> Self {
        let mut truths: BTreeMap<usize, Truth> = BTreeMap::new();
        for (slot, channel) in plan.channels.iter().enumerate() {
            let (Some(link), Some(node)) = (link(plan, slot), channel.node) else {
                continue;
            };
            let (of, ahead) = (link.slot, link.ahead);
            let truth = truths.entry(of).or_insert_with(|| Truth::new(plan, of));
            let intervals = Intervals::of(&plan.nodes[node]);
            let pairing = Pairing::new(&link, if intervals.is_some() { 3 } else { 1 });
            truth.predictions.push(Prediction {
                slot,
                node,
                ahead,
                pairing,
                values: Vec::new(),
                given: 0,
                intervals,
                ends: Vec::new(),
            });
            truth
                .persistences
                .entry(ahead)
                .or_insert_with(|| Persistence::new(&link, mode));
        }
        Self {
            truths: truths.into_values().collect(),
            tallies: Tally::all(plan),
            fallen: Fallen::all(plan),
        }
    }

    /// Looks at what a tick did.
    pub fn look(&mut self, engine: &Engine, event: Event) {
        for truth in &mut self.truths {
            match event {
                Event::Row(now) => truth.look(engine, now),
                Event::Segment => truth.segment(),
            }
        }
        if let Event::Row(_) = event {
            self.tallies.iter_mut().for_each(|tally| tally.look(engine));
            self.fallen.iter_mut().for_each(|of| of.look(engine));
        }
    }
}

impl Truth {
    fn new(plan: &Plan, slot: usize) -> Self {
        let error_slot = plan.channels[slot].node.and_then(|node| {
            let ports = &plan.nodes[node].ports;
            let place = slot - ports.first()?.1.start;
            let (_, errors) = ports.iter().find(|(name, _)| *name == "stderr")?;
            errors.clone().nth(place)
        });
        Self {
            slot,
            error_slot,
            values: Vec::new(),
            errors: Vec::new(),
            last: None,
            between: Vec::new(),
            predictions: Vec::new(),
            persistences: BTreeMap::new(),
        }
    }

    fn look(&mut self, engine: &Engine, now: Instant) {
        for prediction in &mut self.predictions {
            if engine.ran(prediction.slot) {
                let value = engine.value(prediction.slot);
                prediction.given += u64::from(!value.is_nan());
                let intervals = prediction.intervals.as_ref();
                let ends = intervals.map(|intervals| intervals.read(engine, value));
                let ends = ends.as_ref().map_or(&[][..], |ends| &ends[..]);
                prediction.pairing.run(now, [&[value][..], ends]);
            }
        }
        let measured = engine.ran(self.slot);
        for persistence in self.persistences.values_mut() {
            if measured {
                persistence.step.truth(now);
                persistence
                    .history
                    .push(now, engine.value(self.slot), engine.stamp(self.slot));
            }
            let asked = persistence.asked(now);
            persistence.history.go_back(asked, &mut persistence.cursor);
            let (value, _) =
                persistence
                    .history
                    .at(asked, persistence.max_age, &mut persistence.cursor);
            persistence.pairing.run(now, [&[value][..]]);
        }
        let value = engine.value(self.slot);
        if value.is_nan() {
            return;
        }
        self.between
            .extend(self.last.replace(now).map(|last| now - last));
        self.values.push(value);
        self.errors
            .push(self.error_slot.map_or(f64::NAN, |slot| engine.value(slot)));
        for prediction in &mut self.predictions {
            let paired = prediction.pairing.truth(now).map(|paired| paired.row);
            prediction
                .values
                .push(paired.map_or(f64::NAN, |row| row[0]));
            if prediction.intervals.is_some() {
                let ends = paired.map_or([f64::NAN; 2], |row| [row[1], row[2]]);
                prediction.ends.push(ends);
            }
        }
        for persistence in self.persistences.values_mut() {
            let paired = persistence
                .pairing
                .truth(now)
                .map_or(f64::NAN, |paired| paired.row[0]);
            persistence.values.push(paired);
        }
    }

    /// The median time from one truth to the next; nothing where there are no two.
    pub(crate) fn typical_gap(&self) -> Duration {
        let mut between = self.between.clone();
        between.sort_unstable();
        let middle = between.get(between.len() / 2);
        middle.copied().unwrap_or(Duration::ZERO)
    }

    fn segment(&mut self) {
        self.last = None;
        for prediction in &mut self.predictions {
            prediction.pairing.clear();
        }
        for persistence in self.persistences.values_mut() {
            persistence.pairing.clear();
            persistence.history.clear();
            persistence.step.segment();
            persistence.cursor = 0;
        }
    }
}

impl Persistence {
    fn new(link: &TruthLink, mode: Mode) -> Self {
        let lag = persistence_lag(link.span, link.ahead);
        let step = StepLength::new(lag + link.ahead);
        let depth = match (mode, step.planned()) {
            (Mode::Steps(steps), Some(step)) => times(step, steps.get().into()) - link.ahead,
            // How far apart truths will lie is not known. Scoring keeps them all anyway.
            (Mode::Steps(steps), None) if steps.get() > 1 => Duration::MAX,
            _ => lag,
        };
        Self {
            lag,
            ahead: link.ahead,
            mode,
            step,
            max_age: link.limit,
            history: History::new(depth),
            cursor: 0,
            pairing: Pairing::new(link, 1),
            values: Vec::new(),
        }
    }

    /// The instant whose truth a run at `now` repeats.
    fn asked(&self, now: Instant) -> Instant {
        let newest = now - self.lag;
        match self.mode {
            Mode::Steps(steps) => {
                let back = times(self.step.length(), steps.get().into());
                newest.min(now + self.ahead - back)
            }
            Mode::OneStep | Mode::FreeRun => newest,
        }
    }
}
