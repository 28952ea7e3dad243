//! Waking whoever waits: nobody looks now and then whether something has come.

use std::fmt;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

type Wake = dyn Fn() + Send + Sync;

/// Wakes somebody. Whoever waits by it looks again what there is: it may ring for nothing.
#[derive(Clone)]
pub struct Bell(Arc<Wake>);

impl Bell {
    /// One that does this, which must not wait.
    #[must_use]
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self(Arc::new(wake))
    }

    /// One that unparks the thread that asks for it.
    #[must_use]
    pub fn here() -> Self {
        thread_local! {
            static OWN: Bell = {
                let thread = std::thread::current();
                Bell::new(move || thread.unpark())
            };
        }
        OWN.with(Self::clone)
    }

    /// Rings.
    pub fn ring(&self) {
        (self.0)();
    }

    fn is(&self, other: &Weak<Wake>) -> bool {
        std::ptr::addr_eq(other.as_ptr(), Arc::as_ptr(&self.0))
    }
}

impl fmt::Debug for Bell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Bell")
    }
}

/// The bells of all that wait for something. One that is dropped elsewhere is let go.
#[derive(Default)]
pub(crate) struct Bells(Mutex<Vec<Weak<Wake>>>);

impl Bells {
    pub(crate) fn add(&self, bell: &Bell) {
        let mut all = self.all();
        all.retain(|of| of.strong_count() > 0);
        if !all.iter().any(|of| bell.is(of)) {
            all.push(Arc::downgrade(&bell.0));
        }
    }

    pub(crate) fn remove(&self, bell: &Bell) {
        self.all().retain(|of| !bell.is(of));
    }

    pub(crate) fn ring(&self) {
        for bell in self.all().iter().filter_map(Weak::upgrade) {
            bell();
        }
    }

    fn all(&self) -> MutexGuard<'_, Vec<Weak<Wake>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Bells {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Bells")
    }
}

/// A way to somebody who is woken by what comes.
#[derive(Debug)]
pub(crate) struct Mailbox<T> {
    to: Sender<T>,
    bell: Bell,
}

impl<T> Clone for Mailbox<T> {
    fn clone(&self) -> Self {
        Self::new(self.to.clone(), &self.bell)
    }
}

impl<T> Mailbox<T> {
    pub(crate) fn new(to: Sender<T>, bell: &Bell) -> Self {
        let bell = bell.clone();
        Self { to, bell }
    }

    /// Sends; whoever has ended has nothing to hear.
    pub(crate) fn send(&self, what: T) {
        let _ = self.to.send(what);
        self.bell.ring();
    }
}
