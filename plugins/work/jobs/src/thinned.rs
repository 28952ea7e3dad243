//! What a machine file thins of its sources: commands that read recordings thin them as its service does.

use std::path::Path;

use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{GraphFile, Table, Value};
use athermal_run::model::Model;
use athermal_run::recording::{Left, ThinnedChannels};
use athermal_serve::deployment::Deployment;

use athermal_core::failure::Failure;

/// The channels that are thinned, by a graph: one that was read from a file is read again, so that mistakes have places.
///
/// # Errors
/// When it says so, and has mistakes in what says it.
pub fn of(path: Option<&Path>, model: &Model) -> Result<Vec<ThinnedChannels>, Failure> {
    if !says(&model.graph) {
        return Ok(Vec::new());
    }
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let again = path.map(|path| {
        // Whatever model it names.
        Model::load_to_fit(path, Wanted::default(), &mut sources, &mut doubts)
    });
    let again = again.transpose()?;
    let model = again.as_ref().unwrap_or(model);
    match Deployment::check(&model.graph, &model.plan, &sources, &mut doubts) {
        Some(deployment) => Ok(deployment.thinned()),
        None => Err(Failure::Graph {
            diagnostics: Box::new(doubts),
            sources: Box::new(sources),
        }),
    }
}

/// Whether a graph says that something is thinned.
pub fn says(graph: &GraphFile) -> bool {
    let ways = [Left::Mean, Left::Last, Left::Median];
    let is_thinned = |of: &Value| {
        let keys = of.as_table();
        keys.is_some_and(|keys| ways.iter().any(|way| keys.get(way.name()).is_some()))
    };
    let named = graph.deployment.get("sources").and_then(Value::as_table);
    let mut named = named.into_iter().flat_map(Table::iter);
    named.any(|(_, of)| is_thinned(&of.value))
}
