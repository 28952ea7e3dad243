//! What is kept in mind of a service while it runs: how many events there were, the last ones, the last ticks of each output, the errors
//! of predictions.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use athermal_run::live::{Slots as _, TickView};

use super::prediction_error::PredictionErrors;
use super::{Observer, ServiceEvent};
use crate::compile::{Plan, PlannedRole};
use crate::event::Event as _;
use crate::message::Message;
use crate::time::Instant;

/// How many of the last events are kept.
const EVENTS: usize = 32;
/// How many of the last ticks.
const TICKS: usize = 256;

/// Keeps in mind what happens. It is looked at from the control thread, which alone fills it.
#[derive(Debug, Clone, Default)]
pub struct Watcher(Arc<Mutex<Seen>>);

/// What has been seen since the start.
#[derive(Debug, Default)]
pub struct Seen {
    /// How many events there were, by their names.
    pub counts: BTreeMap<&'static str, u64>,
    /// The last events, the oldest first: whether each is a fault, and when the host's clock said so, in s since 1970.
    pub recent: VecDeque<(bool, Message, f64)>,
    /// The last ticks of each output.
    pub last: LastTicks,
    /// The errors of predictions.
    pub errors: PredictionErrors,
    /// The novelty of each estimator that gives one, by its name.
    pub novelty: Vec<(String, f64)>,
    /// The slots of these.
    novelty_slots: Vec<usize>,
    /// What the port `learning` of each learner said last, by its name, and its slot.
    pub learning: Vec<(String, usize, f64)>,
}

/// The last ticks of each output, of graphs before included.
#[derive(Debug, Default)]
pub struct LastTicks {
    plan: Option<Arc<Plan>>,
    /// The outputs of the graph that runs.
    pub outputs: Vec<String>,
    /// Instants, and the values of the outputs, NaN where one had none; the oldest first.
    pub ticks: VecDeque<(Instant, Vec<f64>)>,
}

impl Watcher {
    /// What has been seen.
    pub fn seen(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Watcher {
    fn event(&mut self, event: &ServiceEvent) {
        let host_time_s = crate::host::now().map_or(0.0, |of| of.as_ns() as f64 / 1e9);
        let mut seen = self.seen();
        for (is_fault, message) in event.messages(false) {
            *seen.counts.entry(message.name()).or_default() += message.count();
            if seen.recent.len() == EVENTS {
                seen.recent.pop_front();
            }
            seen.recent.push_back((is_fault, message, host_time_s));
        }
    }

    fn tick(&mut self, tick: &TickView<'_>) {
        let seen = &mut *self.seen();
        let plan = tick.plan;
        if !seen
            .last
            .plan
            .as_ref()
            .is_some_and(|of| Arc::ptr_eq(of, plan))
        {
            seen.last.follow(plan);
            (seen.novelty, seen.novelty_slots) = novelties(plan).unzip();
            let learners = plan.nodes.iter();
            let learners =
                learners.filter_map(|of| Some((of.instance(), of.says_of_learning()?, f64::NAN)));
            seen.learning = learners.collect();
        }
        seen.last.tick(tick);
        seen.errors.look(tick);
        for ((_, value), slot) in seen.novelty.iter_mut().zip(&seen.novelty_slots) {
            *value = tick.value(*slot);
        }
        for (_, slot, said) in &mut seen.learning {
            if tick.ran(*slot) {
                *said = tick.value(*slot);
            }
        }
    }
}

impl LastTicks {
    /// The value of an output at the last tick.
    #[must_use]
    pub fn value(&self, output: &str) -> Option<f64> {
        let place = self.outputs.iter().position(|of| of == output)?;
        let value = self.ticks.back()?.1[place];
        (!value.is_nan()).then_some(value)
    }

    fn tick(&mut self, tick: &TickView<'_>) {
        let room = (self.ticks.len() == TICKS).then(|| self.ticks.pop_front());
        let mut values = room.flatten().map_or_else(Vec::new, |(_, values)| values);
        values.clear();
        values.extend_from_slice(tick.outputs);
        self.ticks.push_back((tick.at, values));
    }

    /// Goes on with the outputs of another graph.
    fn follow(&mut self, plan: &Arc<Plan>) {
        let outputs: Vec<_> = plan.outputs.iter().map(|of| of.name.clone()).collect();
        let place = |name: &String| self.outputs.iter().position(|of| of == name);
        let places: Vec<_> = outputs.iter().map(place).collect();
        for (_, values) in &mut self.ticks {
            let value = |place: &Option<usize>| place.map_or(f64::NAN, |place| values[place]);
            *values = places.iter().map(value).collect();
        }
        self.outputs = outputs;
        self.plan = Some(Arc::clone(plan));
    }
}

/// The estimators of a graph that give a novelty, without it, and where it stands.
fn novelties(plan: &Plan) -> impl Iterator<Item = ((String, f64), usize)> + '_ {
    plan.nodes.iter().filter_map(|node| match &node.role {
        PlannedRole::Estimator { novelty, .. } => Some(((node.instance(), f64::NAN), (*novelty)?)),
        _ => None,
    })
}
