//! `[history]`, and the threads: one takes rows and writes, one brings back what was before.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::compile::Plan;
use athermal_core::engine::Engine;
use athermal_core::time::Instant;
use athermal_run::live::TickView;
use athermal_serve::companion::{Beside, Companion};
use athermal_serve::connector::ConnectorError;
use athermal_serve::deployment::Size;
use athermal_serve::folder::StatePaths;
use athermal_serve::recovery::Recovered;
use athermal_serve::service::Observer;
use athermal_serve::{facts, register_facts};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::columns::Columns;
use crate::files::Files;
use crate::store::Store;

/// How many rows may wait to be taken.
const WAITING: usize = 4096;
/// How often what is kept is written.
const WRITE: Wait = Wait::from_secs(60);
/// How long the service may take to know of this.
const PATIENCE: Wait = Wait::from_secs(10);
/// So many ticks are stepped again where nothing has been written yet, as within the first minute.
const AT_ONCE: u64 = 100_000;
/// The folder beside the journal.
const FOLDER: &str = "history";
/// How many bytes a channel takes on the disk, over a day in stretches.
const OF_CHANNEL: u64 = 8_640 * 3 * 8;

/// What a service keeps of what it gave: ten minutes whole, and a day in stretches of 10 s.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct History {
    /// How much of the disk it may take; outputs and what is measured come first. With "0 B" nothing is written, and a restart forgets it.
    pub disk: Size,
}

impl Default for History {
    fn default() -> Self {
        Self {
            disk: Size(64_000_000),
        }
    }
}

facts! {
    /// What is kept of what the service gave.
    HistoryFacts(of: &Kept) {
        /// Rows that are kept whole.
        rows: usize = of.store().counts().0;
        /// Stretches of 10 s.
        stretches: usize = of.store().counts().1;
        /// How many bytes they take on the disk.
        bytes: u64 [gauge "athermal_history_bytes"] = of.bytes.load(Ordering::Relaxed);
        /// Rows that were left out since they came faster than they could be taken.
        missed: u64 [counter "athermal_history_missed_total"] = of.missed.load(Ordering::Relaxed);
        /// Why it cannot be written.
        failed: Option<String> [line "the history cannot be written: {failed}"] = of.failed();
    }
}

register_facts!(HistoryFacts, "history");

/// What is kept, for whoever asks.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    store: Mutex<Store>,
    failed: Mutex<Option<String>>,
    /// Whether what was before is there. Until then nothing is written, or that would be lost.
    is_back: AtomicBool,
    bytes: AtomicU64,
    missed: AtomicU64,
}

impl Kept {
    pub(crate) fn store(&self) -> MutexGuard<'_, Store> {
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn failed(&self) -> Option<String> {
        self.failed
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

/// A row on its way.
struct Row {
    columns: Arc<Columns>,
    at: i64,
    /// How many ticks, beats, breaks and freezes there were with it.
    happenings: u64,
    values: Box<[f64]>,
}

impl Companion for History {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        let kept = Arc::<Kept>::default();
        beside.shared.give(Arc::clone(&kept));
        let (rows, taken) = sync_channel(WAITING);
        beside.observe(Box::new(Looker {
            rows: rows.clone(),
            made: Made::new(self.channels()),
            begin: beside.happenings,
            kept: Arc::clone(&kept),
        }));
        let (handle, seen) = (beside.handle.clone(), Arc::clone(&kept));
        std::thread::spawn(move || {
            handle.ask(PATIENCE, move |service| {
                service.contribute("history", move || HistoryFacts::read(&seen));
            })
        });
        let taker = Taker {
            kept,
            limit: self.disk.0,
            folder: beside.state.join(FOLDER),
            most: self.channels(),
            beside: beside.clone(),
        };
        let thread = std::thread::Builder::new().name("history".to_owned());
        let thread = thread.spawn(move || taker.run(&taken));
        let failed = |error| ConnectorError::new(format_args!("[history] {error}"));
        Ok(Box::new(Running(Some((thread.map_err(failed)?, rows)))))
    }
}

impl History {
    /// How many channels have room.
    fn channels(&self) -> usize {
        let disk = if self.disk.0 == 0 {
            Self::default().disk.0
        } else {
            self.disk.0
        };
        (disk / 2 / OF_CHANNEL).max(1) as usize
    }
}

/// Until this is dropped: what is kept is written then.
struct Running(Option<(JoinHandle<()>, SyncSender<Option<Row>>)>);

impl Drop for Running {
    fn drop(&mut self) {
        if let Some((thread, rows)) = self.0.take() {
            let _ = rows.send(None);
            let _ = thread.join();
        }
    }
}

/// The columns of what runs.
struct Made {
    most: usize,
    of: Option<(Arc<Plan>, Arc<Columns>)>,
}

impl Made {
    fn new(most: usize) -> Self {
        Self { most, of: None }
    }

    fn columns(&mut self, plan: &Arc<Plan>) -> Arc<Columns> {
        let known = self.of.take().filter(|(of, _)| Arc::ptr_eq(of, plan));
        let (_, columns) = self.of.insert(
            known.unwrap_or_else(|| (Arc::clone(plan), Arc::new(Columns::of(plan, self.most)))),
        );
        Arc::clone(columns)
    }
}

/// Looks on, and hands rows over. Where there is no room one is left out and counted.
struct Looker {
    rows: SyncSender<Option<Row>>,
    made: Made,
    begin: u64,
    kept: Arc<Kept>,
}

impl Observer for Looker {
    fn tick(&mut self, tick: &TickView<'_>) {
        let columns = self.made.columns(tick.plan);
        let row = Row {
            at: tick.at.as_ns(),
            happenings: self.begin + tick.event,
            values: columns.values(tick),
            columns,
        };
        if self.rows.try_send(Some(row)).is_err() {
            self.kept.missed.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Takes rows, and writes.
struct Taker {
    kept: Arc<Kept>,
    limit: u64,
    folder: PathBuf,
    most: usize,
    beside: Beside,
}

impl Taker {
    fn run(self, rows: &Receiver<Option<Row>>) {
        let mut files = (self.limit > 0).then(|| {
            let (files, before, happenings) = Files::open(self.folder.clone(), self.limit);
            self.bring_back(before, happenings);
            files
        });
        let mut happenings = self.beside.happenings;
        let mut written = Clock::now();
        loop {
            let row = rows.recv_timeout(WRITE.saturating_sub(written.elapsed()));
            let has_ended = match row {
                Ok(Some(row)) => {
                    let mut store = self.kept.store();
                    let mut has_ended = false;
                    for row in std::iter::once(Some(row)).chain(rows.try_iter().take(WAITING)) {
                        let Some(row) = row else {
                            has_ended = true;
                            continue;
                        };
                        store.push(&row.columns, row.at, &row.values);
                        happenings = row.happenings;
                    }
                    has_ended
                }
                Err(RecvTimeoutError::Timeout) => false,
                Ok(None) | Err(RecvTimeoutError::Disconnected) => true,
            };
            if let Some(files) = &mut files
                && self.kept.is_back.load(Ordering::Acquire)
                && (has_ended || written.elapsed() >= WRITE)
            {
                written = Clock::now();
                let done = files.write(&mut self.kept.store(), happenings, has_ended);
                let mut failed = self
                    .kept
                    .failed
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner);
                *failed = match done {
                    Ok(bytes) => {
                        self.kept.bytes.store(bytes, Ordering::Relaxed);
                        None
                    }
                    Err(error) => Some(error.to_string()),
                };
            }
            if has_ended {
                return;
            }
        }
    }

    /// Puts what was written in front of what comes, once what came after it has been stepped again: on a thread of its own, so that
    /// what comes is taken.
    fn bring_back(&self, mut before: Store, least: u64) {
        let (kept, until) = (Arc::clone(&self.kept), self.beside.happenings);
        let (state, most) = (self.beside.state.clone(), self.most);
        let work = move || {
            let mut made = Made::new(most);
            if least < until && (least > 0 || until <= AT_ONCE) {
                let look = |seen, engine: &Engine| {
                    if (least + 1..=until).contains(&seen) {
                        let at = engine.last().unwrap_or(Instant::MIN);
                        let tick = TickView::of(at, engine);
                        let columns = made.columns(tick.plan);
                        before.push(&columns, at.as_ns(), &columns.values(&tick));
                    }
                };
                // What the journal has no longer is a hole.
                let _ = Recovered::replay(&StatePaths::new(&state), least, look);
            }
            kept.store().after(before);
            kept.is_back.store(true, Ordering::Release);
        };
        let _ = std::thread::Builder::new()
            .name("history".to_owned())
            .spawn(work);
    }
}
