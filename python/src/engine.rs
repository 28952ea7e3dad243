//! A running model, as a Python object: one step a call.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use athermal::core::diagnostic::nearest;
use athermal::core::document::TimeBase;
use athermal::{Engine as Run, Instant};
use pyo3::exceptions::{PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::MutexExt as _;
use pyo3::types::{PyBytes, PyDict, PyString};

use crate::failure::{guarded, request};

/// An engine.
#[pyclass(frozen, module = "athermal._athermal")]
pub struct Engine {
    running: Mutex<Running>,
    /// The place of each channel among the samples, by its name and by that of its column.
    places: HashMap<String, usize>,
    outputs: Vec<Py<PyString>>,
    zone: Option<String>,
}

struct Running {
    engine: Run,
    samples: Vec<f64>,
}

impl Engine {
    /// An engine that runs.
    pub fn new(py: Python<'_>, engine: Run) -> Self {
        let plan = engine.plan();
        let sources = || plan.sources.iter().enumerate();
        let mut places: HashMap<String, usize> = HashMap::new();
        for (place, source) in sources() {
            places.insert(source.column.clone(), place);
        }
        // A channel's own name comes first.
        for (place, source) in sources() {
            places.insert(source.name.clone(), place);
        }
        let outputs = plan.outputs.iter();
        let outputs = outputs.map(|of| PyString::intern(py, &of.name).unbind());
        let TimeBase::Column { zone, .. } = &plan.time;
        Self {
            places,
            outputs: outputs.collect(),
            zone: zone.as_ref().map(ToString::to_string),
            running: Mutex::new(Running {
                samples: vec![f64::NAN; plan.sources.len()],
                engine,
            }),
        }
    }

    /// What runs. A node of Python may let another thread ask for it meanwhile, which then waits without Python's lock.
    fn running(&self, py: Python<'_>) -> MutexGuard<'_, Running> {
        let running = self.running.lock_py_attached(py);
        running.unwrap_or_else(PoisonError::into_inner)
    }

    fn unknown(&self, name: &str) -> PyErr {
        let known = self.places.keys().map(String::as_str);
        let near = nearest(name, known);
        let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
        PyKeyError::new_err(format!("the graph has no measured channel `{name}`{near}"))
    }
}

#[pymethods]
impl Engine {
    /// Takes the measurements of one instant, given in ns, and gives what the graph puts out; `None` where there is nothing. What is
    /// not given, `None` and NaN are no new values.
    fn step<'py>(
        &self,
        py: Python<'py>,
        t_ns: i64,
        values: &Bound<'py, PyDict>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut running = self.running(py);
        let Running { engine, samples } = &mut *running;
        samples.fill(f64::NAN);
        for (name, value) in values {
            let name = name.cast::<PyString>()?;
            let name = name.to_str()?;
            let Some(&place) = self.places.get(name) else {
                return Err(self.unknown(name));
            };
            if !value.is_none() {
                samples[place] = value.extract().map_err(|_| {
                    let kind = value.get_type();
                    PyTypeError::new_err(format!("`{name}` takes a number, not {kind}"))
                })?;
            }
        }
        let outputs = guarded(py, move || engine.step(Instant::from_ns(t_ns), samples))?;
        let outputs = outputs.map_err(|error| request(py, &error.to_string()))?;
        let given = PyDict::new(py);
        for (name, value) in self.outputs.iter().zip(outputs) {
            let value = (!value.is_nan()).then_some(*value);
            given.set_item(name.bind(py), value)?;
        }
        Ok(given)
    }

    /// The next step belongs to another segment: windows, lags and filters start afresh.
    fn segment(&self, py: Python<'_>) -> PyResult<()> {
        guarded(py, || self.running(py).engine.segment())
    }

    /// Freezes what is learned while it runs, or lets it go on.
    fn freeze(&self, py: Python<'_>, frozen: bool) {
        self.running(py).engine.freeze(frozen);
    }

    /// All that it knows, as bytes.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let snapshot = guarded(py, || self.running(py).engine.snapshot())?;
        Ok(PyBytes::new(py, &snapshot))
    }

    /// Goes on from a snapshot of the same model, with the same bits.
    fn restore(&self, py: Python<'_>, snapshot: &[u8]) -> PyResult<()> {
        let restored = guarded(py, || self.running(py).engine.restore(snapshot))?;
        restored.map_err(|error| request(py, &error.to_string()))
    }

    /// The instant of the last step in ns; `None` before the first.
    #[getter]
    fn last_ns(&self, py: Python<'_>) -> Option<i64> {
        self.running(py).engine.last().map(Instant::as_ns)
    }

    /// The measured channels.
    #[getter]
    fn channels(&self, py: Python<'_>) -> Vec<String> {
        let running = self.running(py);
        let sources = running.engine.plan().sources.iter();
        sources.map(|of| of.name.clone()).collect()
    }

    /// What the graph puts out.
    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> Vec<Bound<'py, PyString>> {
        let outputs = self.outputs.iter();
        outputs.map(|of| of.bind(py).clone()).collect()
    }

    /// The zone by which dates without one go, where the graph says one.
    #[getter]
    fn zone(&self) -> Option<&str> {
        self.zone.as_deref()
    }
}
