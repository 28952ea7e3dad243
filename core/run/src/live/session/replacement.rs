//! How the graph of a session may be replaced, and by what.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Report, Reporter, WatchedGraph};
use crate::compile::{Plan, Wanted};
use crate::diagnostic::{Diagnostics, Sources};
use crate::live::Feed;
use crate::model::{Model, ModelError};
use crate::time::{Duration, Instant};

/// How the graph of a session may be replaced.
#[derive(Debug, Default)]
pub struct Replacement {
    /// Graphs that take over at a time.
    pub swaps: Vec<Swap>,
    /// A graph on disk that takes over when it has changed.
    pub watched: Option<WatchedGraph>,
    /// How long a graph is compared with what runs before it takes over.
    pub shadow: Option<Duration>,
    /// By how much its error may be larger: 0.05 for 5 %.
    pub margin: f64,
}

/// A graph that takes over at a time.
#[derive(Debug)]
pub struct Swap {
    /// When.
    pub at: SwapTime,
    /// Its file.
    pub path: PathBuf,
    /// The graph, with fits.
    pub model: Model,
}

/// When a graph takes over.
#[derive(Debug, Clone, Copy)]
pub enum SwapTime {
    /// At this instant.
    At(Instant),
    /// So long after the first row.
    After(Duration),
}

impl SwapTime {
    /// The instant, where the first row is at `first`.
    pub(super) fn instant(self, first: Instant) -> Instant {
        match self {
            Self::At(at) => at,
            Self::After(after) => first + after,
        }
    }
}

/// A graph or model that is to replace others, with the fits of what means the same in one that is known.
///
/// # Errors
/// When it cannot be loaded, or something needs fitting that is fitted in none of them.
pub fn load_replacement<'a>(
    path: &Path,
    known: impl Iterator<Item = &'a Model>,
    reporter: &dyn Reporter,
) -> Result<Model, ModelError> {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let mut model = Model::load_from(path, Wanted::default(), &mut sources, &mut doubts)?;
    reporter.report(Report::Doubts(doubts, sources));
    // A graph goes by the fits of what runs; a model in which some are missing was to bring its own.
    let mut kept = model
        .card
        .as_ref()
        .map_or_else(Vec::new, |_| model.unfitted());
    let doubtful: Vec<String> = known.flat_map(|known| model.take_fits_of(known)).collect();
    let nodes = model.unfitted();
    if model.card.is_none() && !nodes.is_empty() {
        let path = path.to_owned();
        return Err(ModelError::NotFitted { path, nodes });
    }
    kept.retain(|node| model.fitted.contains_key(node));
    if !kept.is_empty() {
        reporter.report(Report::FitsKept(path.to_owned(), kept));
    }
    if !nodes.is_empty() {
        reporter.report(Report::Unfitted(path.to_owned(), nodes));
    }
    if !doubtful.is_empty() {
        reporter.report(Report::DoubtfulFits(path.to_owned(), doubtful));
    }
    Ok(model)
}

/// All channels that a model or one of its replacements reads, and all outputs that one of them gives.
pub(super) fn union<'a>(models: impl Iterator<Item = &'a Model>) -> (Vec<Feed>, Vec<String>) {
    let mut feed = Vec::new();
    let mut columns = Vec::new();
    for model in models {
        for channel in Feed::of(&model.plan) {
            if !feed.contains(&channel) {
                feed.push(channel);
            }
        }
        for output in &model.plan.outputs {
            if !columns.contains(&output.name) {
                columns.push(output.name.clone());
            }
        }
    }
    (feed, columns)
}

/// The plan whose sources are all channels of a feed, for laying out the columns that are read.
pub(super) fn reading<'a>(
    running: &Model,
    models: impl Iterator<Item = &'a Model> + Clone,
    feed: &[Feed],
) -> Plan {
    let mut plan = (*Arc::clone(&running.plan)).clone();
    let source = |channel: &Feed| {
        let mut read = models
            .clone()
            .filter_map(|model| channel.source(&model.plan));
        read.next().cloned()
    };
    plan.sources = feed.iter().filter_map(source).collect();
    plan
}
