//! What differs in meaning between two plans, node by node.
//!
//! Plans are compared as resolved: comments, order, spelling, and how a duration or unit is written make no difference. A
//! node is unchanged when its kind, its parameters with their defaults, and what its inputs read are; that a node further
//! up has changed does not change it.

mod facts;

use std::collections::BTreeMap;

use indexmap::IndexMap;
use serde::Serialize;
use serde_json::{Value, json};

use super::plan::Plan;
use facts::{Facts, Texts};

/// What differs between two plans.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanDiff {
    /// How tabular sources give time.
    pub time: Vec<ParameterChange>,
    /// Every measured channel of either plan: those of the second in its order, then those that it lacks.
    pub signals: Vec<SignalChange>,
    /// Every instance of every node of either plan: those of the second in its order, then those that it lacks.
    pub nodes: Vec<NodeChange>,
    /// Every column of what comes out of either plan: those of the second in its order, then those that it lacks.
    pub outputs: Vec<OutputChange>,
}

/// A measured channel and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SignalChange {
    /// Signal and channel: `temperature.plate1`.
    pub channel: String,
    /// What became of it.
    #[serde(flatten)]
    pub change: Change,
}

/// An instance of a node and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodeChange {
    /// The instance: `thermal.Z1`.
    pub instance: String,
    /// What became of it.
    #[serde(flatten)]
    pub change: Change,
}

/// A column of what comes out and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutputChange {
    /// The column: `predicted.Z1`.
    pub output: String,
    /// What became of it.
    #[serde(flatten)]
    pub change: Change,
}

/// What became of something from one plan to another.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "change", content = "parameters", rename_all = "snake_case")]
pub enum Change {
    /// Only the second has it.
    Added,
    /// Only the first has it.
    Removed,
    /// Both have it, and these of its properties differ.
    Changed(Vec<ParameterChange>),
    /// Both have it, alike.
    Unchanged,
}

/// A property that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterChange {
    /// The property, its keys joined by dots: `type`, `ahead`, `solver.alpha`, `inputs.features`, `inputs.truth.unit`.
    pub path: String,
    /// What it was; none where the first has no such property.
    pub from: Option<Value>,
    /// What it is; none where the second has no such property.
    pub to: Option<Value>,
}

impl PlanDiff {
    /// Whether both plans mean the same.
    #[must_use]
    pub fn is_same(&self) -> bool {
        let changes = self.signals.iter().map(|signal| &signal.change);
        let changes = changes.chain(self.nodes.iter().map(|node| &node.change));
        let mut changes = changes.chain(self.outputs.iter().map(|output| &output.change));
        self.time.is_empty() && changes.all(|change| *change == Change::Unchanged)
    }

    /// What became of an instance; `None` where neither plan has it.
    #[must_use]
    pub fn node(&self, instance: &str) -> Option<&Change> {
        let node = self.nodes.iter().find(|node| node.instance == instance)?;
        Some(&node.change)
    }
}

/// Compares two plans.
#[must_use]
pub fn diff(from: &Plan, to: &Plan) -> PlanDiff {
    let texts = &mut Texts::default();
    let time = facts::time(from).changes_to(&facts::time(to), texts);
    let signals = changes(facts::signals(from), facts::signals(to), texts);
    let signals = signals.map(|(channel, change)| SignalChange { channel, change });
    let nodes = changes(facts::nodes(from), facts::nodes(to), texts);
    let nodes = nodes.map(|(instance, change)| NodeChange { instance, change });
    let outputs = changes(facts::outputs(from), facts::outputs(to), texts);
    let outputs = outputs.map(|(output, change)| OutputChange { output, change });
    PlanDiff {
        time,
        signals: signals.collect(),
        nodes: nodes.collect(),
        outputs: outputs.collect(),
    }
}

/// What a plan means, as data: the same for two plans between which [`diff`] finds nothing.
///
/// Units and quantities stand in base units, in twelve significant digits, so that a rounding in converting them is none.
#[must_use]
pub fn meaning(plan: &Plan) -> Value {
    let mut texts = Texts::default();
    let mut all = |facts: IndexMap<String, Facts>| -> BTreeMap<String, Value> {
        let meaning = |(name, facts): (String, Facts)| (name, facts.meaning(&mut texts));
        facts.into_iter().map(meaning).collect()
    };
    let time = IndexMap::from([("base".to_owned(), facts::time(plan))]);
    json!({
        "time": all(time),
        "signals": all(facts::signals(plan)),
        "nodes": all(facts::nodes(plan)),
        "outputs": all(facts::outputs(plan)),
    })
}

fn changes(
    from: IndexMap<String, Facts>,
    to: IndexMap<String, Facts>,
    texts: &mut Texts,
) -> impl Iterator<Item = (String, Change)> + use<> {
    let compared = |(name, after): (&String, &Facts)| {
        let before = from.get(name);
        let change = match before.map(|before| before.changes_to(after, texts)) {
            None => Change::Added,
            Some(differing) if differing.is_empty() => Change::Unchanged,
            Some(differing) => Change::Changed(differing),
        };
        (name.clone(), change)
    };
    let mut changes: Vec<_> = to.iter().map(compared).collect();
    let removed = from.into_keys().filter(|name| !to.contains_key(name));
    changes.extend(removed.map(|name| (name, Change::Removed)));
    changes.into_iter()
}
