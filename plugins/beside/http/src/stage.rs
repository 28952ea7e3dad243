//! From a file to a graph that can take over, or to all of its mistakes with their places.

use std::path::{Path, PathBuf};

use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_run::model::{Model, ModelError};
use athermal_serve::deployment::Deployment;
use hyper::StatusCode;
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::json;

use crate::answer::Refused;

/// What is to be staged: a file that the service reads, or the text of a model.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Given {
    /// A graph or a model on this machine, from the root on.
    pub path: Option<PathBuf>,
    /// The text of a model.
    pub model: Option<String>,
    /// The text of a graph, read as if it stood beside the machine file.
    pub graph: Option<String>,
}

/// A graph with all its fits, and what is doubtful in it.
pub struct Loaded {
    pub model: Model,
    pub doubts: String,
}

/// Reads what is given. What is not fitted in it and means the same in what runs takes that fit.
pub fn load(given: Given, machine: &Path, running: Option<&Model>) -> Result<Loaded, Refused> {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let (name, read) = match given {
        Given {
            path: Some(path),
            model: None,
            graph: None,
        } if path.is_absolute() => {
            let read = Model::load_from(&path, Wanted::default(), &mut sources, &mut doubts);
            (path, read)
        }
        Given {
            path: None,
            model: Some(text),
            graph: None,
        } => {
            let name = PathBuf::from("model");
            let read = Model::from_text(&name, text);
            (name, read)
        }
        Given {
            path: None,
            model: None,
            graph: Some(text),
        } => {
            let name = machine.with_file_name("graph.toml");
            let read = Model::load_text(&name, &text, &mut sources, &mut doubts);
            (name, read)
        }
        _ => {
            return Err(Refused::new(
                StatusCode::BAD_REQUEST,
                "give `path`, from the root on, or `model`, or `graph`",
            ));
        }
    };
    let mut model = read.map_err(refused)?;
    // A machine file is checked as a whole, although its sources and sinks stay as they are.
    let _ = Deployment::check(&model.graph, &model.plan, &sources, &mut doubts);
    if doubts.has_errors() {
        return Err(mistakes(&doubts, &sources));
    }
    if let Some(running) = running {
        model.take_fits_of(running);
    }
    let nodes = model.unfitted();
    if model.card.is_none() && !nodes.is_empty() {
        return Err(refused(ModelError::NotFitted { path: name, nodes }));
    }
    let doubts = match doubts.is_empty() {
        true => String::new(),
        false => doubts.render(&sources, false, 100),
    };
    Ok(Loaded { model, doubts })
}

/// The file of a service, whose graph is to be staged.
pub fn of_file(path: &Path) -> Given {
    Given {
        path: Some(path.to_owned()),
        model: None,
        graph: None,
    }
}

fn refused(error: ModelError) -> Refused {
    match error {
        ModelError::Graph {
            diagnostics,
            sources,
        } => mistakes(&diagnostics, &sources),
        other => Refused::new(StatusCode::UNPROCESSABLE_ENTITY, &other.to_string()),
    }
}

fn mistakes(diagnostics: &Diagnostics, sources: &Sources) -> Refused {
    let count = diagnostics.error_count();
    let mut body = diagnostics.to_json(sources);
    body["error"] = json!(match count {
        1 => "the graph has a mistake".to_owned(),
        count => format!("the graph has {count} mistakes"),
    });
    body["text"] = json!(diagnostics.render(sources, false, 100));
    Refused {
        status: StatusCode::UNPROCESSABLE_ENTITY,
        body,
    }
}
