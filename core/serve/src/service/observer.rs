//! Who looks on at a service.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use athermal_run::live::TickView;

use super::ServiceEvent;

/// Looks on at a service, on its control thread: it must not wait. What is slow takes copies away through a bounded queue.
pub trait Observer: Send {
    /// Something happened.
    fn event(&mut self, event: &ServiceEvent) {
        let _ = event;
    }

    /// A tick. Ticks that the control thread missed are not seen.
    fn tick(&mut self, tick: &TickView<'_>) {
        let _ = tick;
    }

    /// Whether it looks at more of a tick than outputs, predictions, truths and novelties. What runs is stepped again for it, from one
    /// of the next ticks on: its [engine](TickView::engine) is there then.
    fn looks_inside(&self) -> bool {
        false
    }

    /// Whether it looks on no longer.
    fn is_gone(&self) -> bool {
        false
    }
}

/// All that look on.
#[derive(Clone, Default)]
pub(crate) struct Observers(Arc<Mutex<Vec<Box<dyn Observer>>>>);

impl std::fmt::Debug for Observers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} look on", self.all().len())
    }
}

impl Observers {
    pub(crate) fn add(&self, observer: Box<dyn Observer>) {
        self.all().push(observer);
    }

    pub(super) fn tick(&self, tick: &TickView<'_>) {
        self.all().iter_mut().for_each(|of| of.tick(tick));
    }

    pub(super) fn look_inside(&self) -> bool {
        self.all().iter().any(|of| of.looks_inside())
    }

    pub(super) fn events(&self, events: &[ServiceEvent]) {
        let mut all = self.all();
        all.retain(|of| !of.is_gone());
        for observer in &mut *all {
            events.iter().for_each(|event| observer.event(event));
        }
    }

    /// They are called by the control thread alone, so that nobody waits here.
    fn all(&self) -> MutexGuard<'_, Vec<Box<dyn Observer>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
