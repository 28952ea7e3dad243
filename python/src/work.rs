//! Work of the library on behalf of Python: on a thread of its own, while the one that called sees to signals and progress.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use athermal::core::watch::{Kept, ProgressListener, Remark, Watch};
use athermal::files::OpenTable;
use athermal::jobs::asked::{Asked, Job, done};
use athermal::jobs::remarks::WITHOUT_ZONE;
use athermal_command::Failure;
use pyo3::prelude::*;

use crate::failure::{guarded, of_failure, request};
use crate::table::Table;

/// So often Python is asked whether it was interrupted, and shown how far the work is.
const BETWEEN_LOOKS: Duration = Duration::from_millis(25);

/// So many more times after it was interrupted.
const LAST_LOOKS: u32 = 12;

/// What the thread that works has for its stack: as much as one that Python begins with.
const STACK: usize = 8 << 20;

/// What a warning is raised from: a function of the package, which a user called, and which calls this by another.
const USER: i32 = 4;

/// What Python asks for, beside the function.
#[derive(FromPyObject)]
pub struct Call {
    /// The options, those that name data included, as JSON.
    options: String,
    /// The tables in memory that names among them stand for.
    pub tables: Vec<(PathBuf, Py<Table>)>,
    /// What takes progress.
    progress: Option<Py<PyAny>>,
}

/// How far some work is: what is done, how much of it, and of how much where that is known.
type Event = (String, u64, Option<u64>);

/// What the thread that called and those that work tell each other.
#[derive(Default)]
struct Between {
    /// What ended the work from the side of Python.
    stop: Mutex<Option<PyErr>>,
    /// What is not shown yet.
    events: Mutex<Vec<Event>>,
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Between {
    fn go_on(&self) -> Result<(), String> {
        match *locked(&self.stop) {
            Some(_) => Err("stopped".to_owned()),
            None => Ok(()),
        }
    }

    /// Takes progress, and ends work that is to stop. What is newer of the same takes the place of what was not shown yet.
    fn take(&self, what: &str, done: u64, total: Option<u64>) {
        if self.go_on().is_err() {
            resume_unwind(Box::new("stopped"));
        }
        let mut events = locked(&self.events);
        match events.last_mut() {
            Some(last) if last.0 == what && last.2 == total => last.1 = done,
            _ => events.push((what.to_owned(), done, total)),
        }
    }

    /// Asks Python whether to go on, and shows it how far the work is.
    fn look(&self, listener: Option<&Py<PyAny>>) {
        let events = std::mem::take(&mut *locked(&self.events));
        let looked = Python::attach(|py| {
            py.check_signals()?;
            let Some(listener) = listener else {
                return Ok(());
            };
            let mut events = events.into_iter();
            events.try_for_each(|event| listener.call1(py, event).map(drop))
        });
        if let Err(error) = looked {
            locked(&self.stop).get_or_insert(error);
        }
    }
}

/// Does a job with the options of a call. Its warnings are raised as Python's. Work that is to stop and does not in time is left behind: it
/// ends where it next asks whether to go on.
pub fn work<J: Job, R: Send + 'static>(
    py: Python<'_>,
    call: &Call,
    work: impl FnOnce(&J, &dyn Watch) -> Result<R, Failure> + Send + 'static,
) -> PyResult<R> {
    let between = Arc::new(Between::default());
    let asks = Arc::clone(&between);
    let go_on: Arc<dyn Fn() -> Result<(), String> + Send + Sync> = Arc::new(move || asks.go_on());
    let open = |(name, table): &(PathBuf, Py<Table>)| {
        let table = table.get();
        let (schema, batches) = (Arc::clone(&table.schema), Arc::clone(&table.batches));
        let open: OpenTable = athermal_arrow::table(schema, batches, Arc::clone(&go_on));
        (name.clone(), open)
    };
    let tables = call.tables.iter().map(open).collect();
    let options =
        serde_json::from_str(&call.options).map_err(|error| request(py, &error.to_string()))?;
    let asked = Asked { options, tables };
    let takes = Arc::clone(&between);
    let takes: ProgressListener = Arc::new(move |what, done, total| takes.take(what, done, total));
    let job = move || {
        let host = Kept::with(Some(takes));
        let ended = done(&asked, &host, work);
        (ended, host.remarks())
    };
    let (gives, given) = channel();
    let begun = thread::Builder::new().stack_size(STACK).spawn(move || {
        // Nobody takes it where nobody waits any more.
        let _ = gives.send(catch_unwind(AssertUnwindSafe(job)));
    });
    begun?;
    let (listener, looks) = (call.progress.as_ref(), Arc::clone(&between));
    let done = py.detach(move || {
        let mut looks_left = LAST_LOOKS;
        loop {
            let done = given.recv_timeout(BETWEEN_LOOKS);
            looks.look(listener);
            looks_left -= u32::from(looks.go_on().is_err());
            match done {
                Err(RecvTimeoutError::Timeout) if looks_left > 0 => {}
                done => return done.ok(),
            }
        }
    });
    if let Some(error) = locked(&between.stop).take() {
        return Err(error);
    }
    let done = done.ok_or_else(|| request(py, "the work ended without a result"))?;
    let (done, remarks) = guarded(py, || done.unwrap_or_else(|panic| resume_unwind(panic)))?;
    warn(py, &remarks)?;
    done.map_err(|failure| of_failure(py, &failure))
}

/// Raises warnings, and the note that times have no zone.
fn warn(py: Python<'_>, remarks: &[Remark]) -> PyResult<()> {
    let texts = remarks.iter().filter_map(|report| {
        let text = report.message.to_string();
        let is_warning = report.level == "warning" || text.contains(WITHOUT_ZONE);
        is_warning.then_some(text)
    });
    let texts: Vec<String> = texts.collect();
    if texts.is_empty() {
        return Ok(());
    }
    let errors = py.import("athermal._errors")?;
    errors.call_method1("warn", (texts, USER))?;
    Ok(())
}
