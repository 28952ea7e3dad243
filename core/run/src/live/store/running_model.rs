//! The graph that runs, in a file beside the state.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::write_whole;
use crate::engine::EngineState;
use crate::model::Model;

/// The graph that runs, in a file beside the state, which is of use with it alone.
#[derive(Debug)]
pub(super) struct RunningModel {
    path: PathBuf,
    /// Where the graph before is until the state of the one after it is written: at no time is a state without its graph.
    before: PathBuf,
    /// The revision of the graph that stands in the file, once that is known.
    holds: Option<String>,
}

impl RunningModel {
    /// That of this state.
    pub(super) fn beside(state: &Path) -> Self {
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
    pub(super) fn paths(&self) -> [PathBuf; 2] {
        [self.path.clone(), self.before.clone()]
    }

    /// The graph that a state belongs to; none where there is no such state or graph.
    pub(super) fn of_state(&self, state: &Path) -> Option<Model> {
        let state = EngineState::from_bytes(&fs::read(state).ok()?).ok()?;
        let of_state = |model: &Model| model.revision().as_deref() == Some(state.revision());
        let models = self.paths().map(|path| Model::load(path).ok());
        models.into_iter().flatten().find(of_state)
    }

    /// Saves what runs, where it is not there yet.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(super) fn save(&mut self, model: &Model, revision: &str) -> io::Result<()> {
        if self.holds.as_deref() == Some(revision) {
            return Ok(());
        }
        let text = model.to_text().map_err(io::Error::other)?;
        if fs::read(&self.path).ok().as_deref() != Some(text.as_bytes()) {
            if self.path.exists() && !self.before.exists() {
                fs::rename(&self.path, &self.before)?;
            }
            write_whole(&self.path, text.as_bytes())?;
        }
        self.holds = Some(revision.to_owned());
        Ok(())
    }

    /// Removes the graph before, once no state belongs to it.
    pub(super) fn remove_before(&self) {
        // What is left of it is of no use, and no harm.
        let _ = fs::remove_file(&self.before);
    }
}
