//! What a service shows to those that listen: each tick and what happens, through bounded queues. Nobody is waited for.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use athermal_core::compile::Plan;
use athermal_core::event::Event as _;
use athermal_core::time::Instant;
use athermal_run::live::TickView;
use athermal_serve::facts::EventFacts;
use athermal_serve::service::{Observer, ServiceEvent};
use athermal_serve::{facts, host, register_facts};
use serde_json::{Value, json};
use tokio::sync::mpsc;

/// How many ticks and events may wait for a listener.
const WAITING: usize = 256;

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

/// Who listens.
#[derive(Debug, Default)]
pub struct Hub {
    inner: Mutex<Inner>,
    turned_away: AtomicU64,
}

#[derive(Debug, Default)]
struct Inner {
    listeners: Vec<(mpsc::Sender<Arc<Item>>, Arc<AtomicU64>)>,
    /// Dropped for all listeners so far.
    dropped: u64,
}

facts! {
    /// The control interface.
    ControlFacts(hub: &Hub) {
        /// Connections to the control interface that there was no room for.
        refused_connections: u64 [counter "athermal_control_refused_connections_total"] = hub.turned_away.load(Ordering::Relaxed);
        /// Streams of events that are open.
        listeners: usize [gauge "athermal_control_listeners"] = hub.inner().listening();
        /// Events and ticks that listeners were too slow for.
        dropped_items: u64 [counter "athermal_control_dropped_items_total"] = hub.inner().dropped;
    }
}

register_facts!(ControlFacts, "control");

impl Hub {
    /// One more listener.
    pub fn listen(&self) -> Listener {
        let (sender, items) = mpsc::channel(WAITING);
        let dropped = Arc::<AtomicU64>::default();
        let mut inner = self.inner();
        inner.listeners.push((sender, Arc::clone(&dropped)));
        Listener { items, dropped }
    }

    /// A connection had no room.
    pub fn turned_away(&self) {
        self.turned_away.fetch_add(1, Ordering::Relaxed);
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn listening(&mut self) -> usize {
        self.listeners.retain(|(to, _)| !to.is_closed());
        self.listeners.len()
    }

    fn send(&mut self, item: impl FnOnce() -> Item) {
        if self.listeners.is_empty() {
            return;
        }
        let item = Arc::new(item());
        let dropped = &mut self.dropped;
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

/// Looks on at a service, and fills a hub.
pub struct Looker(pub Arc<Hub>);

impl Observer for Looker {
    fn event(&mut self, event: &ServiceEvent) {
        let at_s = host::time_of_day().as_ns() as f64 / 1e9;
        for (is_fault, message) in event.messages(false) {
            let of = || Item::Event(json!(EventFacts::read(is_fault, &message, at_s)));
            self.0.inner().send(of);
        }
    }

    fn tick(&mut self, tick: &TickView<'_>) {
        let Some(engine) = tick.engine else {
            return;
        };
        self.0.inner().send(|| {
            let plan = Arc::clone(tick.plan);
            Item::Tick(Tick {
                at: tick.at,
                revision: tick.revision.to_owned(),
                outputs: tick.outputs.to_vec(),
                values: (0..plan.channels.len())
                    .map(|slot| engine.value(slot))
                    .collect(),
                plan,
            })
        });
    }

    fn looks_inside(&self) -> bool {
        self.0.inner().listening() > 0
    }
}
