//! A graph that is to be fitted, as a Python object.

use std::path::{Path, PathBuf};

use athermal::core::compile::Wanted;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::drawing::{diagram, svg};
use athermal::jobs::fit::Fit;
use athermal::jobs::init::Init;
use athermal::run::model::{Model as Run, ModelError};
use pyo3::prelude::*;

use crate::failure::{guarded, of_model, unfitted};
use crate::json;
use crate::model::{Model, columns, tree};
use crate::work::{Call, work};

/// A graph that was read and compiled, without a fit.
#[pyclass(frozen, module = "athermal._athermal")]
pub struct Graph {
    pub inner: Run,
}

/// A graph, and what is doubtful in its file.
fn read(
    py: Python<'_>,
    read: impl FnOnce(&mut Sources, &mut Diagnostics) -> Result<Run, ModelError>,
) -> PyResult<Graph> {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let inner = guarded(py, || read(&mut sources, &mut doubts))?;
    let inner = inner.map_err(|error| of_model(py, error))?;
    if !doubts.is_empty() {
        let text = doubts.render(&sources, false, 100).trim_end().to_owned();
        let errors = py.import("athermal._errors")?;
        errors.call_method1("warn", (vec![text], 3))?;
    }
    Ok(Graph { inner })
}

#[pymethods]
impl Graph {
    /// Reads a graph file, or the graph of a model.
    #[staticmethod]
    fn of_path(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        read(py, |sources, doubts| {
            Run::load_to_fit(&path, Wanted::default(), sources, doubts)
        })
    }

    /// Reads the text of a graph file; `name` stands for its path.
    #[staticmethod]
    fn of_text(py: Python<'_>, name: &str, text: &str) -> PyResult<Self> {
        read(py, |sources, doubts| {
            Run::graph_of_text(name, text, sources, doubts)
        })
    }

    /// Reads a graph from its tree as JSON.
    #[staticmethod]
    fn of_json(py: Python<'_>, name: &str, text: &str) -> PyResult<Self> {
        let tree = json::read(text)?;
        read(py, |sources, doubts| {
            Run::graph_of_tree(name, &tree, sources, doubts)
        })
    }

    /// The tree as JSON.
    fn to_json(&self) -> String {
        tree(&self.inner).to_string()
    }

    /// Its name, where it has one.
    #[getter]
    fn name(&self) -> Option<String> {
        self.inner.plan.name.clone()
    }

    /// The columns of its time.
    #[getter]
    fn time_columns(&self) -> Vec<String> {
        columns(&self.inner.plan).0
    }

    /// All columns that it reads of a table.
    #[getter]
    fn columns(&self) -> Vec<String> {
        columns(&self.inner.plan).1
    }

    /// The measured channels.
    #[getter]
    fn channels(&self) -> Vec<String> {
        let sources = self.inner.plan.sources.iter();
        sources.map(|of| of.name.clone()).collect()
    }

    /// What it puts out.
    #[getter]
    fn outputs(&self) -> Vec<String> {
        let outputs = self.inner.plan.outputs.iter();
        outputs.map(|of| of.name.clone()).collect()
    }

    /// Of each output that predicts a truth: its name, that of the prediction in scores, and the truth.
    #[getter]
    fn predictions(&self) -> Vec<(String, String, String)> {
        let plan = &self.inner.plan;
        let outputs = plan.outputs.iter().filter_map(|output| {
            let of = &plan.channels[output.slot];
            let truth = &plan.channels[of.predicts?];
            Some((output.name.clone(), of.name.clone(), truth.name.clone()))
        });
        outputs.collect()
    }

    /// A picture as SVG.
    fn svg(&self) -> String {
        svg::text(&diagram(&self.inner.plan, false))
    }

    /// Fits it, with the options of `athermal fit`. Gives the model, and how the fit went in words.
    fn fit(&self, py: Python<'_>, call: Call) -> PyResult<(Model, String)> {
        let graph = self.inner.clone();
        let (inner, outcome) = work(py, &call, move |job: &Fit, host| {
            let mut model = graph;
            let outcome = job.fit(&mut model, host)?;
            Ok((model, outcome))
        })?;
        if outcome.is_nothing() {
            return Err(unfitted(py, &outcome.failed()));
        }
        Ok((Model { inner }, outcome.text(false)))
    }

    /// The model of it, where nothing needs a fit.
    fn model(&self) -> Model {
        let inner = self.inner.clone();
        Model { inner }
    }

    /// The model of a graph in which nothing needs a fit, or with the fits of the model that its file names.
    #[staticmethod]
    fn model_of_path(py: Python<'_>, path: PathBuf) -> PyResult<Model> {
        let graph = read(py, |sources, doubts| {
            Run::load_from(Path::new(&path), Wanted::default(), sources, doubts)
        })?;
        Ok(Model { inner: graph.inner })
    }
}

/// A starter graph, with the options of `athermal init`: its text, and what was found and guessed.
#[pyfunction]
pub fn init(py: Python<'_>, call: Call) -> PyResult<(String, Vec<String>)> {
    let starter = work(py, &call, |job: &Init, _| job.find())?;
    Ok((starter.text, starter.remarks))
}
