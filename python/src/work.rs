//! Work of the library on behalf of Python: without its lock, with its signals, progress and warnings.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use athermal::core::watch::{Kept, ProgressListener, Remark, Watch};
use athermal::files::OpenTable;
use athermal::jobs::asked::{Asked, Job, done};
use athermal::jobs::remarks::WITHOUT_ZONE;
use athermal_command::Failure;
use pyo3::prelude::*;

use crate::failure::{guarded, of_failure, request};
use crate::table::Table;

/// So often Python is asked whether it was interrupted.
const BETWEEN_SIGNALS: Duration = Duration::from_millis(50);

/// What a warning is raised from: a function of the package, which a user called.
const USER: i32 = 3;

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

/// What ended the work from the side of Python.
#[derive(Clone, Default)]
struct Stop(Arc<Mutex<Option<PyErr>>>);

impl Stop {
    fn set(&self, error: PyErr) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get_or_insert(error);
    }

    fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn is_set(&self) -> bool {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .is_some()
    }

    /// Asks Python now and then whether to go on.
    fn check(self) -> Arc<dyn Fn() -> Result<(), String> + Send + Sync> {
        let asked = Mutex::new(Instant::now());
        Arc::new(move || {
            let mut asked = asked.lock().unwrap_or_else(PoisonError::into_inner);
            if asked.elapsed() >= BETWEEN_SIGNALS {
                *asked = Instant::now();
                if let Err(error) = Python::attach(|py| py.check_signals()) {
                    self.set(error);
                }
            }
            match self.is_set() {
                true => Err("stopped".to_owned()),
                false => Ok(()),
            }
        })
    }

    /// Hands progress to a Python function; what that raises ends the work.
    fn progress(self, listener: Py<PyAny>) -> ProgressListener {
        Arc::new(move |what, done, total| {
            if self.is_set() {
                return;
            }
            let called = Python::attach(|py| listener.call1(py, (what, done, total)).map(drop));
            if let Err(error) = called {
                self.set(error);
            }
        })
    }
}

/// Does a job with the options of a call. Its warnings are raised as Python's.
pub fn work<J: Job, R: Send>(
    py: Python<'_>,
    call: &Call,
    work: impl FnOnce(&J, &dyn Watch) -> Result<R, Failure> + Send,
) -> PyResult<R> {
    let stop = Stop::default();
    let go_on = stop.clone().check();
    let open = |(name, table): &(PathBuf, Py<Table>)| {
        let table = table.get();
        let (schema, batches) = (Arc::clone(&table.schema), Arc::clone(&table.batches));
        let open: OpenTable = athermal_arrow::table(schema, batches, Arc::clone(&go_on));
        (name.clone(), open)
    };
    let tables = call.tables.iter().map(open).collect();
    let progress = call.progress.as_ref().map(|of| of.clone_ref(py));
    let progress = progress.map(|listener| stop.clone().progress(listener));
    let options =
        serde_json::from_str(&call.options).map_err(|error| request(py, &error.to_string()))?;
    let asked = Asked { options, tables };
    let host = Kept::with(progress);
    let done = guarded(py, || py.detach(|| done(&asked, &host, work)));
    if let Some(error) = stop.take() {
        return Err(error);
    }
    let result = done?;
    warn(py, &host.remarks())?;
    result.map_err(|failure| of_failure(py, &failure))
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
