//! A graph with its fits, as a Python object.

use arrow_schema::DataType;
use athermal::core::compile::Plan;
use athermal::core::document::{TimeBase, Value as Tree};
use athermal::jobs::compare::Compare;
use athermal::jobs::diagnose::Diagnose;
use athermal::jobs::evaluate::Evaluate;
use athermal::jobs::predict::Predict;
use athermal::jobs::report::Report;
use athermal::jobs::{Found, model::for_scores};
use athermal::report::page;
use athermal::run::model::Model as Run;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde_json::Value;

use crate::engine::Engine;
use crate::failure::{guarded, of_model, request};
use crate::graph::Graph;
use crate::json::to_python;
use crate::predictions::Predictions;
use crate::table::Table;
use crate::work::{Call, work};

/// A model.
#[pyclass(frozen, module = "athermal._athermal")]
pub struct Model {
    pub inner: Run,
}

/// The columns of the time that a plan reads, and all columns.
pub fn columns(plan: &Plan) -> (Vec<String>, Vec<String>) {
    let TimeBase::Column { column, .. } = &plan.time;
    let times: Vec<String> = column.names().to_vec();
    let mut all = times.clone();
    all.extend(plan.sources.iter().map(|of| of.column.clone()));
    let tables = std::iter::once(&plan.table.base).chain(plan.table.files.iter().map(|of| &of.1));
    for table in tables {
        let cells = [&table.segment, &table.machine, &table.name, &table.value];
        all.extend(cells.into_iter().flatten().cloned());
        all.extend(table.rename.keys().cloned());
    }
    (times, all)
}

/// The graph of a model as declared.
pub fn tree(model: &Run) -> Value {
    Tree::to_json(&model.graph.tree)
}

/// A table of facts as Python has it: for people, and for programs.
fn found<'py>(py: Python<'py>, found: &Found) -> PyResult<(String, Bound<'py, PyAny>)> {
    Ok((found.text.clone(), to_python(py, &found.facts)?))
}

#[pymethods]
impl Model {
    /// Reads the text of a model; `name` stands for its path.
    #[staticmethod]
    fn of_json(py: Python<'_>, name: &str, text: String) -> PyResult<Self> {
        let inner = guarded(py, || py.detach(|| Run::from_text(name, text)))?;
        let inner = inner.map_err(|error| of_model(py, error))?;
        Ok(Self { inner })
    }

    /// The model as `athermal fit` writes it.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        let text = py.detach(|| self.inner.to_text());
        text.map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Its graph.
    fn graph(&self) -> Graph {
        let (graph, plan) = (self.inner.graph.clone(), self.inner.plan.clone());
        Graph {
            inner: Run {
                graph,
                plan,
                fitted: Default::default(),
                card: None,
            },
        }
    }

    /// The card: where it comes from and how its fit went; `None` for a plain graph.
    #[getter]
    fn card<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &serde_json::json!(self.inner.card))
    }

    /// Its coefficients.
    #[getter]
    fn coefficients<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &serde_json::json!(self.inner.estimators()))
    }

    /// The revision of its graph and fits.
    #[getter]
    fn revision(&self) -> Option<String> {
        self.inner.revision()
    }

    /// An engine that runs it, cold.
    fn engine(&self, py: Python<'_>) -> PyResult<Engine> {
        self.check_fitted(py)?;
        let engine = guarded(py, || self.inner.engine())?;
        engine
            .map(|engine| Engine::new(py, engine))
            .map_err(|error| of_model(py, error))
    }

    /// What it puts out, with the options of `athermal run`. `time` is the name of the column of the time.
    fn predict(&self, py: Python<'_>, call: Call, time: String) -> PyResult<Table> {
        self.check_fitted(py)?;
        let outputs = self.inner.plan.outputs.iter();
        let outputs = outputs.map(|of| of.name.clone()).collect();
        let like = self.time_type(&call);
        let sink = Predictions::new(time, like.as_ref(), outputs);
        let model = self.inner.clone();
        let sink = work(py, &call, move |job: &Predict, host| {
            let mut sink = sink.followed(host.progress("predicting"));
            job.run(&model, &mut sink, host)?;
            Ok(sink)
        })?;
        sink.table()
            .map_err(|error| PyValueError::new_err(error.to_string()))
    }

    /// Scores, with the options of `athermal evaluate`.
    fn evaluate<'py>(&self, py: Python<'py>, call: Call) -> PyResult<(String, Bound<'py, PyAny>)> {
        self.check_fitted(py)?;
        let model = self.inner.clone();
        let of = work(py, &call, move |job: &Evaluate, host| {
            job.find(&for_scores(&model)?, host)
        })?;
        found(py, &of)
    }

    /// A diagnosis, with the options of `athermal diagnose`.
    fn diagnose<'py>(&self, py: Python<'py>, call: Call) -> PyResult<(String, Bound<'py, PyAny>)> {
        self.check_fitted(py)?;
        let model = self.inner.clone();
        let of = work(py, &call, move |job: &Diagnose, host| {
            Ok(job.find(&model, false, host)?.0)
        })?;
        found(py, &of)
    }

    /// A report, with the options of `athermal report`; the last part is the page.
    fn report<'py>(
        &self,
        py: Python<'py>,
        call: Call,
    ) -> PyResult<(String, Bound<'py, PyAny>, String)> {
        self.check_fitted(py)?;
        let model = self.inner.clone();
        let (of, page) = work(py, &call, move |job: &Report, host| {
            let (found, facts) = job.find(&for_scores(&model)?, host)?;
            Ok((found, page(&facts)))
        })?;
        let (text, facts) = found(py, &of)?;
        Ok((text, facts, page))
    }
}

impl Model {
    /// Refuses a graph that needs a fit.
    fn check_fitted(&self, py: Python<'_>) -> PyResult<()> {
        let nodes = self.inner.unfitted();
        if self.inner.card.is_some() || nodes.is_empty() {
            return Ok(());
        }
        let nodes = nodes.join(", ");
        let text = format!("the graph needs a fit of {nodes}: `Graph.fit(data)` gives its model");
        Err(request(py, &text))
    }

    /// The type of the one column of the time in tables.
    fn time_type(&self, call: &Call) -> Option<DataType> {
        let (times, _) = columns(&self.inner.plan);
        let [time] = &*times else { return None };
        let (_, table) = call.tables.first()?;
        let field = table.get().schema.field_with_name(time).ok()?;
        Some(field.data_type().clone())
    }
}

/// Graphs fitted on the same data and scored on others, with the options of `athermal compare`.
#[pyfunction]
pub fn compare<'py>(
    py: Python<'py>,
    graphs: Vec<(String, Py<Graph>)>,
    call: Call,
) -> PyResult<(String, Bound<'py, PyAny>)> {
    let graphs = graphs.into_iter();
    let graphs = graphs.map(|(name, graph)| (name, graph.get().inner.clone()));
    let graphs: Vec<_> = graphs.collect();
    found(
        py,
        &work(py, &call, move |job: &Compare, host| {
            Ok(job.find(graphs, host)?.0)
        })?,
    )
}
