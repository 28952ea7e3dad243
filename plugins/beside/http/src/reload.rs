//! The machine file as it is now, in the place of what runs.

use std::time::Duration as Wait;

use athermal_core::engine::NodeCarry;
use athermal_run::model::Model;
use athermal_serve::companion::Beside;
use athermal_serve::folder::StatePaths;
use athermal_serve::service::{NoAnswer, Service};

use crate::stage::{load, of_file};

/// How long the service may take.
const PATIENCE: Wait = Wait::from_secs(60);

/// The revision of what runs.
fn revision(service: &mut Service) -> Option<String> {
    service.running().map(|of| of.revision.to_owned())
}

/// What runs: its revision, and its model where that can be read.
pub(crate) fn running(beside: &Beside) -> Result<(Option<String>, Option<Model>), NoAnswer> {
    let runs = beside.handle.ask(PATIENCE, revision)?;
    let read = |of: &String| StatePaths::new(&beside.state).model(of).ok();
    let model = runs.as_ref().and_then(read);
    Ok((runs, model))
}

/// Stages the machine file as it is now and commits it: the revision that takes over, and what becomes of each node. None where it is
/// what runs.
///
/// # Errors
/// All mistakes of the file with their places, or why it cannot take over; what runs goes on.
pub fn reload(beside: &Beside, by: &str) -> Result<Option<(String, Vec<NodeCarry>)>, String> {
    let (runs, model) = running(beside).map_err(|error| error.to_string())?;
    let loaded = load(of_file(&beside.machine), &beside.machine, model.as_ref());
    let loaded = loaded.map_err(|refused| {
        let words = |key: &str| refused.body[key].as_str().map(str::to_owned);
        words("text").or(words("error")).unwrap_or_default()
    })?;
    if loaded.model.revision() == runs {
        return Ok(None);
    }
    let by = by.to_owned();
    let done = beside.handle.ask(PATIENCE, move |service| {
        let staged = service.stage(&loaded.model, &by)?;
        let taken = (staged.revision().to_owned(), staged.carry().to_vec());
        service.commit(&by).map(|()| taken)
    });
    let done = done.map_err(|error| error.to_string())?;
    done.map(Some).map_err(|error| error.to_string())
}
