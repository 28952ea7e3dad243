//! Decides whether the fitted model that a machine file names (`model = "X.json"`) is one for its graph; how that is said is decided
//! elsewhere.

use std::path::{Path, PathBuf};

use indexmap::IndexMap;

use super::problem;
use super::{Model, ModelError};
use crate::compile::{Change, Plan, PlanDiff, Wanted, diff};
use crate::diagnostic::{Diagnostics, Place, Sources};
use crate::document::{Value, unreadable};
use crate::engine::SampleRange;

/// The model that a graph names at its top, relative to the file in which it does, and where; none where it names none.
#[must_use]
pub fn named_model(tree: &Value, sources: &Sources) -> Option<(PathBuf, Place)> {
    let named = tree.as_table()?.get("model")?;
    Some((sources.resolve(named.place, named.as_text()?), named.place))
}

impl Model {
    /// Takes the fits and the card of the model that the graph, which stands at `graph` and is compiled for `wanted`, names. Every estimator must have the parameters and inputs that it has
    /// there; those that have not are reported, as is a model that cannot be used. A graph that names none stays as it is.
    pub fn take_named(
        &mut self,
        graph: &Path,
        wanted: Wanted,
        sources: &Sources,
        diagnostics: &mut Diagnostics,
    ) {
        let Some((path, named)) = named_model(&self.graph.tree, sources) else {
            return;
        };
        let other = match Self::load_fitted(&path, wanted) {
            Ok(other) => other,
            Err(error) => {
                let problem = problem::Unusable {
                    path: path.display().to_string(),
                    reason: in_words(&error),
                    machine: graph.display().to_string(),
                    is_free: !path.exists(),
                };
                diagnostics.report(named, problem);
                return;
            }
        };
        let path = path.display().to_string();
        let between = diff(&other.plan, &self.plan);
        let doubtful = self.take_fits_unless(&other, &between);
        self.report_unlike(&between, graph, (&path, named), diagnostics);
        if let Some(first) = doubtful.first() {
            let mut nodes = self.plan.nodes.iter();
            let node = nodes.find(|node| node.instance() == *first);
            let place = node.and_then(|node| self.place_of(&node.name));
            let problem = problem::ReadsOther {
                instances: doubtful,
                path,
                named,
            };
            diagnostics.report(place, problem);
        }
        self.card = other.card;
        if let Some(card) = &mut self.card {
            let in_own_unit = |range| in_unit_of(range, &other.plan, &self.plan);
            card.ranges = card.ranges.iter().filter_map(in_own_unit).collect();
        }
    }

    /// Reports each node of which an instance needs a fit and is another than in the model at a path, which is named at a place.
    fn report_unlike(
        &self,
        between: &PlanDiff,
        graph: &Path,
        (path, named): (&str, Place),
        diagnostics: &mut Diagnostics,
    ) {
        let mut unlike: IndexMap<&str, (String, usize, &Change)> = IndexMap::new();
        for node in self.plan.nodes.iter().filter(|node| node.rows().is_some()) {
            let instance = node.instance();
            if let Some(change) = between
                .node(&instance)
                .filter(|change| **change != Change::Unchanged)
            {
                let known = unlike.entry(&node.name);
                known
                    .and_modify(|(_, more, _)| *more += 1)
                    .or_insert((instance, 0, change));
            }
        }
        for (name, (instance, more, change)) in unlike {
            let problem = problem::Unlike {
                instance,
                more,
                change: change.clone(),
                path: path.to_owned(),
                named,
                machine: graph.display().to_string(),
            };
            diagnostics.report(self.place_of(name), problem);
        }
    }

    fn place_of(&self, node: &str) -> Option<Place> {
        let mut nodes = self.graph.nodes.iter();
        nodes.find(|decl| decl.name == node).map(|decl| decl.place)
    }
}

/// A range of samples in the unit that another plan has for the channel; none where it has no such channel.
fn in_unit_of(range: &SampleRange, of: &Plan, to: &Plan) -> Option<SampleRange> {
    let unit = |plan: &'_ Plan| {
        let mut channels = plan.channels.iter();
        let found = channels.find(|found| found.name == range.channel);
        found.map(|found| found.channel.unit.clone())
    };
    let (of, to) = (unit(of)?, unit(to)?);
    Some(SampleRange {
        channel: range.channel.clone(),
        lowest: of.convert(range.lowest, &to)?,
        highest: of.convert(range.highest, &to)?,
    })
}

/// Why a model cannot be used, to stand after its path.
fn in_words(error: &ModelError) -> String {
    match error {
        ModelError::Unreadable { source, .. } => unreadable(source),
        ModelError::NotAModel { source, .. } => format!("it is no fitted model ({source})"),
        ModelError::Graph { diagnostics, .. } => {
            let first = diagnostics.iter().next();
            let first = first.map_or("it has mistakes", |first| &first.message);
            format!("of its graph, {first}")
        }
        ModelError::Fits { refused, .. } => {
            let nodes: Vec<_> = refused
                .iter()
                .map(|(node, _)| format!("`{node}`"))
                .collect();
            format!("the fit of {} is not as it was written", nodes.join(", "))
        }
        ModelError::TooNew { version, .. } => {
            format!("it was written by a later athermal, in format {version}")
        }
        ModelError::NotFitted { .. } | ModelError::Engine(_) => error.to_string(),
    }
}
