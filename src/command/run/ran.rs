//! Decides with which graph a watched run goes on: the file that is given, or what ran last, which is kept beside the state. Not what
//! it knows.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use athermal::Model;
use athermal::core::engine::EngineState;

use crate::command::aside::whole_aside;

/// The graph that runs, in a file beside the state, which is of use with it alone.
pub struct Ran {
    path: PathBuf,
    /// Where the graph before is until the state of the one after it is written: at no time is a state without its graph.
    before: PathBuf,
    /// The revision of the graph that stands in the file, once that is known.
    holds: Option<String>,
}

impl Ran {
    /// That of this state.
    pub fn beside(state: &Path) -> Self {
        let with = |ending: &str| {
            let mut path = state.as_os_str().to_owned();
            path.push(ending);
            PathBuf::from(path)
        };
        Self {
            path: with(".graph.json"),
            before: with(".graph.before.json"),
            holds: None,
        }
    }

    /// The files.
    pub fn paths(&self) -> [&Path; 2] {
        [&self.path, &self.before]
    }

    /// The graph that a state belongs to; none where there is no such state or graph.
    pub fn of_state(&self, state: &Path) -> Option<Model> {
        let state = EngineState::from_bytes(&fs::read(state).ok()?).ok()?;
        let of_state = |model: &Model| revision(model).as_deref() == Some(state.revision());
        let models = self.paths().map(|path| Model::load(path).ok());
        models.into_iter().flatten().find(of_state)
    }

    /// Keeps what runs, where it is not there yet.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn keep(&mut self, model: &Model, revision: &str) -> io::Result<()> {
        if self.holds.as_deref() == Some(revision) {
            return Ok(());
        }
        let text = model.to_text().map_err(io::Error::other)?;
        if fs::read(&self.path).ok().as_deref() != Some(text.as_bytes()) {
            if self.path.exists() && !self.before.exists() {
                fs::rename(&self.path, &self.before)?;
            }
            whole_aside(&self.path, text.as_bytes())?;
        }
        self.holds = Some(revision.to_owned());
        Ok(())
    }

    /// Lets go of the graph before, once no state belongs to it.
    pub fn let_go(&self) {
        // What is left of it is of no use, and no harm.
        let _ = fs::remove_file(&self.before);
    }
}

/// The revision of a model that can be run.
pub fn revision(model: &Model) -> Option<String> {
    Some(model.engine().ok()?.revision().to_owned())
}
