//! What a service shows to those that listen: each tick and what happens, through bounded queues. Nobody is waited for.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use athermal_core::time::Instant;
use athermal_run::live::Notice;
use athermal_serve::service::{Observer, ServiceEvent};
use serde_json::{Value, json};
use tokio::sync::mpsc;

use crate::prediction_error::PredictionErrors;
use crate::words::described;

/// How many ticks and events may wait for a listener.
const WAITING: usize = 256;
/// How many of the last events are shown in a status.
const RECENT: usize = 32;

/// What a listener is given.
#[derive(Debug)]
pub enum Item {
    Tick(Tick),
    Event(Value),
}

/// A tick, and all that the graph made of it.
#[derive(Debug)]
pub struct Tick {
    pub at: Instant,
    pub revision: String,
    pub plan: Arc<Plan>,
    pub outputs: Vec<f64>,
    /// By slot.
    pub values: Vec<f64>,
}

/// A listener's end.
pub struct Listener {
    pub items: mpsc::Receiver<Arc<Item>>,
    /// How many it was too slow for.
    pub dropped: Arc<AtomicU64>,
}

/// What is known since the service started.
#[derive(Default)]
pub struct Hub {
    inner: Mutex<Inner>,
    turned_away: AtomicU64,
}

#[derive(Default)]
struct Inner {
    listeners: Vec<(mpsc::Sender<Arc<Item>>, Arc<AtomicU64>)>,
    known: Known,
}

/// What is counted, and what happened last.
#[derive(Default, Clone)]
pub struct Known {
    pub swaps: u64,
    pub missed: u64,
    pub source_failures: u64,
    pub sink_failures: u64,
    pub refused_swaps: u64,
    pub no_checkpoint: u64,
    /// The last events, with the time of day.
    pub recent: VecDeque<Value>,
    pub errors: PredictionErrors,
    /// The novelty of each estimator that gives one, by its name.
    pub novelty: Vec<(String, f64)>,
    /// Dropped for all listeners so far.
    pub dropped: u64,
    pub listeners: usize,
}

impl Hub {
    /// One more listener.
    pub fn listen(&self) -> Listener {
        let (sender, items) = mpsc::channel(WAITING);
        let dropped = Arc::<AtomicU64>::default();
        let mut inner = self.inner();
        inner.listeners.push((sender, Arc::clone(&dropped)));
        Listener { items, dropped }
    }

    /// What is known.
    pub fn known(&self) -> Known {
        let mut inner = self.inner();
        inner.listeners.retain(|(to, _)| !to.is_closed());
        inner.known.listeners = inner.listeners.len();
        inner.known.clone()
    }

    /// A connection had no room.
    pub fn turned_away(&self) {
        self.turned_away.fetch_add(1, Ordering::Relaxed);
    }

    /// How many connections had no room.
    pub fn count_turned_away(&self) -> u64 {
        self.turned_away.load(Ordering::Relaxed)
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn send(&mut self, item: impl FnOnce() -> Item) {
        if self.listeners.is_empty() {
            return;
        }
        let item = Arc::new(item());
        let dropped = &mut self.known.dropped;
        self.listeners
            .retain(|(to, count)| match to.try_send(Arc::clone(&item)) {
                Ok(()) => true,
                Err(mpsc::error::TrySendError::Full(_)) => {
                    count.fetch_add(1, Ordering::Relaxed);
                    *dropped += 1;
                    true
                }
                Err(mpsc::error::TrySendError::Closed(_)) => false,
            });
    }
}

/// Looks on at a service of these channels, and fills a hub.
pub struct Looker(pub Arc<Hub>, pub Vec<String>);

impl Observer for Looker {
    fn event(&mut self, event: &ServiceEvent) {
        let mut inner = self.0.inner();
        let known = &mut inner.known;
        match event {
            ServiceEvent::Swap(Notice::TookOver { .. }) => known.swaps += 1,
            ServiceEvent::Swap(Notice::Missed { ticks }) => known.missed += ticks,
            ServiceEvent::SourceFailed { .. } => known.source_failures += 1,
            ServiceEvent::SinkFailed { .. } => known.sink_failures += 1,
            ServiceEvent::NotTakenOver(_) | ServiceEvent::NotStaged(_) => known.refused_swaps += 1,
            ServiceEvent::NoCheckpoint(_) => known.no_checkpoint += 1,
            _ => {}
        }
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let at_s = now.map_or(0.0, |of| of.as_secs_f64());
        for (_, message) in described(event, &self.1, false) {
            let (name, facts, words) = (message.name(), message.facts(), message.to_string());
            let event =
                json!({ "event": name, "host_time_s": at_s, "message": words, "facts": facts });
            if inner.known.recent.len() == RECENT {
                inner.known.recent.pop_front();
            }
            inner.known.recent.push_back(event.clone());
            inner.send(|| Item::Event(event));
        }
    }

    fn tick(&mut self, at: Instant, engine: &Engine) {
        let mut inner = self.0.inner();
        let known = &mut inner.known;
        known.errors.look(at, engine);
        look_at_novelty(&mut known.novelty, engine);
        inner.send(|| {
            let plan = Arc::clone(engine.plan());
            Item::Tick(Tick {
                at,
                revision: engine.revision().to_owned(),
                outputs: engine.outputs().to_vec(),
                values: (0..plan.channels.len())
                    .map(|slot| engine.value(slot))
                    .collect(),
                plan,
            })
        });
    }
}

fn look_at_novelty(novelty: &mut Vec<(String, f64)>, engine: &Engine) {
    use athermal_core::compile::PlannedRole::Estimator;
    let nodes = engine.plan().nodes.iter();
    let given = nodes.filter_map(|node| match &node.role {
        Estimator {
            novelty: Some(slot),
            ..
        } => Some((node, *slot)),
        _ => None,
    });
    let mut count = 0;
    for (nth, (node, slot)) in given.enumerate() {
        count = nth + 1;
        let value = engine.value(slot);
        match novelty.get_mut(nth) {
            Some((name, known)) if *name == node.instance() => *known = value,
            Some(place) => *place = (node.instance(), value),
            None => novelty.push((node.instance(), value)),
        }
    }
    novelty.truncate(count);
}
