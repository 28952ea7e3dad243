//! What a machine file thins of its sources: commands that read recordings thin them as its service does.

use std::path::Path;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{GraphFile, Table, Value};
use athermal::run::recording::{Left, ThinnedChannels};
use athermal::serve::deployment::Deployment;

use crate::terminal::Failure;

/// The channels that are thinned, of a graph that was read from a file.
///
/// # Errors
/// When the file says so, and has mistakes in what says it.
pub fn of(path: &Path, graph: &GraphFile) -> Result<Vec<ThinnedChannels>, Failure> {
    if !says(graph) {
        return Ok(Vec::new());
    }
    // Read again, with its places, whatever model it names.
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let model = Model::load_to_fit(path, Wanted::default(), &mut sources, &mut doubts)?;
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
