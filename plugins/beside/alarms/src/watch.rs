//! Looks at ticks, and takes down what became of alarms.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::compile::Plan;
use athermal_core::time::Instant;
use athermal_run::live::TickView;
use athermal_serve::companion::Beside;
use athermal_serve::connector::{ConnectorError, Stop};
use athermal_serve::host;
use athermal_serve::service::Observer;
use athermal_serve::shown::Shown;

use crate::alarm::{Became, Judge};
use crate::asked::{AlarmNow, AlarmsFacts, Change};
use crate::book::Book;
use crate::receivers;
use crate::settings::{Alarm, Alarms};

/// How many changes may wait to be taken down.
const WAITING: usize = 10_000;
/// How often is looked for what does not come.
const LOOK: Wait = Wait::from_millis(500);
/// How long the service may take to know of this.
const PATIENCE: Wait = Wait::from_secs(10);

/// All alarms of a service.
pub(crate) struct Watch {
    settings: Alarms,
    seen: Mutex<Seen>,
    pub(crate) book: Mutex<Book>,
    /// There is something to be taken.
    pub(crate) news: Condvar,
    names: Vec<String>,
    /// Why receivers do not take what waits.
    pub(crate) away: Mutex<Vec<Option<String>>>,
    missed: AtomicU64,
}

impl std::fmt::Debug for Watch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} alarms", self.settings.0.len())
    }
}

/// What has been seen of ticks.
#[derive(Default)]
struct Seen {
    plan: Option<Arc<Plan>>,
    watched: Vec<Watched>,
    looks_inside: bool,
    last: Option<Instant>,
}

/// An alarm of one channel.
pub(crate) struct Watched {
    pub(crate) name: String,
    pub(crate) alarm: Alarm,
    /// The output or channel, and its unit.
    pub(crate) of: String,
    pub(crate) unit: String,
    /// None where the graph that runs has it no longer.
    shown: Option<Shown>,
    pub(crate) value: f64,
    judge: Judge,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts it beside a service.
pub(crate) fn start(settings: &Alarms, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
    let receivers = receivers::all(settings, beside)?;
    let names: Vec<_> = receivers.iter().map(|of| of.name.clone()).collect();
    let watch = Arc::new(Watch {
        settings: settings.clone(),
        seen: Mutex::default(),
        book: Mutex::new(Book::open(&beside.state, &names)),
        news: Condvar::new(),
        away: Mutex::new(vec![None; names.len()]),
        names,
        missed: AtomicU64::new(0),
    });
    beside.shared.give(Arc::clone(&watch));
    let (changes, taken) = sync_channel(WAITING);
    beside.observe(Box::new(Looker {
        watch: Arc::clone(&watch),
        changes: changes.clone(),
    }));
    let (handle, seen) = (beside.handle.clone(), Arc::clone(&watch));
    std::thread::spawn(move || {
        handle.ask(PATIENCE, move |service| {
            service.contribute("alarms", move || AlarmsFacts::read(&seen));
        })
    });
    let stop = Stop::default();
    let failed = |error| ConnectorError::new(format_args!("[alarms] {error}"));
    let mut threads = Vec::new();
    for (nth, receiver) in receivers.into_iter().enumerate() {
        let (watch, stop) = (Arc::clone(&watch), stop.clone());
        let thread = Builder::new().name("alarms".to_owned());
        threads.push(
            thread
                .spawn(move || receiver.run(nth, &watch, &stop))
                .map_err(failed)?,
        );
    }
    let taker = (Arc::clone(&watch), stop.clone());
    let thread = Builder::new().name("alarms".to_owned());
    threads.push(
        thread
            .spawn(move || taker.0.take(&taken, &taker.1))
            .map_err(failed)?,
    );
    Ok(Box::new(Running {
        watch,
        stop,
        threads,
        _changes: changes,
    }))
}

/// Until this is dropped.
struct Running {
    watch: Arc<Watch>,
    stop: Stop,
    threads: Vec<JoinHandle<()>>,
    _changes: SyncSender<Change>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.ask();
        self.watch.news.notify_all();
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

struct Looker {
    watch: Arc<Watch>,
    changes: SyncSender<Change>,
}

impl Observer for Looker {
    fn tick(&mut self, tick: &TickView<'_>) {
        let mut seen = lock(&self.watch.seen);
        if !seen
            .plan
            .as_ref()
            .is_some_and(|of| Arc::ptr_eq(of, tick.plan))
        {
            self.watch.follow(&mut seen, tick);
        }
        seen.last = Some(tick.at);
        let now = Clock::now();
        for watched in &mut seen.watched {
            let value = watched.shown.map_or(f64::NAN, |of| of.value(tick));
            if !value.is_nan() {
                watched.value = value;
            }
            let became = watched.judge.tick(value, tick.at, now);
            let change = became.map(|became| watched.change(became, Some(tick.at)));
            if change.is_some_and(|change| self.changes.try_send(change).is_err()) {
                self.watch.missed.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    fn looks_inside(&self) -> bool {
        lock(&self.watch.seen).looks_inside
    }
}

impl Watched {
    fn change(&self, change: Became, at: Option<Instant>) -> Change {
        Change {
            number: 0,
            time_s: at.map_or(0.0, |of| of.as_ns() as f64 / 1e9),
            host_s: host::now().map_or(0.0, |of| of.as_ns() as f64 / 1e9),
            alarm: self.name.clone(),
            change,
            text: self.alarm.text.clone(),
            of: self.of.clone(),
            value: Some(self.value).filter(|of| !of.is_nan()),
            unit: self.unit.clone(),
            by: None,
        }
    }
}

impl Watch {
    /// Goes on with another graph. What it has too goes on as it was.
    fn follow(&self, seen: &mut Seen, tick: &TickView<'_>) {
        let plan = tick.plan;
        let mut before: Vec<_> = std::mem::take(&mut seen.watched);
        let book = lock(&self.book);
        for (name, alarm) in &self.settings.0 {
            for (member, shown) in Shown::all_named(plan, &alarm.of) {
                let own = shown.name(plan);
                let name = match own == alarm.of || member.is_empty() {
                    true => name.clone(),
                    false => format!("{name}.{member}"),
                };
                let Ok((limit, hysteresis)) = alarm.limit(plan, shown) else {
                    continue;
                };
                let known = before.iter().position(|of| of.name == name);
                let known = known.map(|nth| before.swap_remove(nth));
                let judge = known.as_ref().map_or_else(
                    || Judge::new(limit, alarm.lasts(), hysteresis, book.is_raised(&name)),
                    |of| of.judge.going_on(limit, hysteresis),
                );
                seen.watched.push(Watched {
                    of: own.to_owned(),
                    unit: shown.unit(plan),
                    shown: Some(shown),
                    value: known.map_or(f64::NAN, |of| of.value),
                    alarm: alarm.clone(),
                    name,
                    judge,
                });
            }
        }
        // What the graph has no longer is absent.
        seen.watched
            .extend(before.into_iter().map(|of| Watched { shown: None, ..of }));
        let shown = || seen.watched.iter().filter_map(|of| of.shown);
        seen.looks_inside = shown().any(|of| !of.is_mirrored(tick));
        seen.plan = Some(Arc::clone(plan));
    }

    /// Takes down what becomes of alarms, and looks for what does not come.
    fn take(&self, changes: &Receiver<Change>, stop: &Stop) {
        while !stop.is_asked() {
            let come = match changes.recv_timeout(LOOK) {
                Ok(change) => Some(change),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return,
            };
            let mut seen = lock(&self.seen);
            let (now, last) = (Clock::now(), seen.last);
            let absent = seen.watched.iter_mut().filter_map(|of| {
                let became = of.judge.look(now)?;
                Some(of.change(became, last))
            });
            let absent: Vec<_> = absent.collect();
            drop(seen);
            let all = come.into_iter().chain(changes.try_iter()).chain(absent);
            let mut has_news = false;
            for change in all {
                lock(&self.book).add(change);
                has_news = true;
            }
            if has_news {
                self.news.notify_all();
            }
        }
    }

    /// Somebody knows of an alarm: the change; why not otherwise.
    pub(crate) fn acknowledge(&self, name: &str, by: &str) -> Result<Change, String> {
        let seen = lock(&self.seen);
        let watched = seen.watched.iter().find(|of| of.name == name);
        let watched = watched.ok_or_else(|| {
            let known: Vec<_> = seen.watched.iter().map(|of| &*of.name).collect();
            format!(
                "there is no alarm `{name}`; there are: {}",
                known.join(", ")
            )
        })?;
        let mut book = lock(&self.book);
        match book.states.get(name).map(|of| of.change) {
            Some(Became::Raised) => {}
            Some(Became::Acknowledged) => return Err(format!("`{name}` has been acknowledged")),
            Some(Became::Gone) | None => return Err(format!("`{name}` is not raised")),
        }
        let mut change = watched.change(Became::Acknowledged, seen.last);
        change.by = Some(by.to_owned());
        book.add(change.clone());
        self.news.notify_all();
        Ok(book.states.get(name).cloned().unwrap_or(change))
    }

    pub(crate) fn now(&self) -> Vec<AlarmNow> {
        let seen = lock(&self.seen);
        let book = lock(&self.book);
        let now = |of: &Watched| of.now(book.states.get(&of.name));
        seen.watched.iter().map(now).collect()
    }

    pub(crate) fn changes(&self) -> Vec<Change> {
        lock(&self.book)
            .changes
            .iter()
            .rev()
            .take(200)
            .rev()
            .cloned()
            .collect()
    }

    /// The receivers: how much waits for each, and why.
    pub(crate) fn receivers(&self) -> Vec<(String, u64, Option<String>)> {
        let (away, book) = (lock(&self.away), lock(&self.book));
        let names = self.names.iter().zip(&*away);
        names
            .map(|(name, away)| (name.clone(), book.waiting(name, 0).1, away.clone()))
            .collect()
    }

    pub(crate) fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    pub(crate) fn failed(&self) -> Option<String> {
        lock(&self.book).failed.clone()
    }
}
