//! Decides what each node of a file says: its kind looked up, its parameters read, and where in the file each of them stands.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::learning::Learn;
use super::problem::CompileProblem;
use crate::diagnostic::{Diagnostics, Place};
use crate::document::{Data, GraphFile, InputDecl, InstanceDecl, NodeDecl, Table, Value, decode};
use crate::node::{Kind, Mistake, NodeSpec, Role, kinds};
use crate::quantity::Quantity;
use crate::time::Duration;
/// A node whose kind and parameters have been read.
pub(crate) struct ReadNode {
    pub(super) kind: Option<&'static Kind>,
    pub(super) instances: Vec<Option<ReadInstance>>,
}

/// The specification of one instance, with the keys that the framework reads itself.
#[derive(Clone)]
pub(crate) struct ReadInstance {
    pub(crate) spec: Arc<dyn NodeSpec>,
    pub(crate) estimator: EstimatorKeys,
}

/// What the framework reads of an estimator's table.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct EstimatorKeys {
    /// How far ahead of now the truth is predicted: `"5min"` is a forecast, `"0s"` a virtual sensor.
    pub(crate) ahead: Option<Duration>,
    /// Which truths it is fitted on.
    pub(crate) train: Train,
    /// Whether it goes on learning while it runs: `true`, or a table of limits.
    pub(crate) learn: Option<Learn>,
}

/// Which rows an estimator is trained on.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Train {
    /// Those whose absolute value is within these limits.
    pub(crate) abs_truth: Limits,
}

/// Limits of an absolute value.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Limits {
    /// Only those below.
    pub(crate) below: Option<Quantity>,
    /// Only those at or above.
    pub(crate) above: Option<Quantity>,
}

impl ReadNode {
    /// Whether the node takes its inputs for later ticks only.
    pub(crate) fn closes_loops(&self) -> bool {
        self.instances
            .iter()
            .flatten()
            .any(|instance| match instance.spec.role() {
                Role::Feature(feature) => feature.closes_loops(),
                _ => false,
            })
    }
}

/// Looks every node's kind up and reads its parameters.
pub(crate) fn read_kinds(graph: &GraphFile, diagnostics: &mut Diagnostics) -> Vec<ReadNode> {
    graph
        .nodes
        .iter()
        .map(|node| read_node(node, diagnostics))
        .collect()
}

fn read_node(node: &NodeDecl, diagnostics: &mut Diagnostics) -> ReadNode {
    let kind = match kinds().get(node.kind.as_str()).map(Vec::as_slice) {
        Some([kind]) => Some(*kind),
        Some(several) => {
            let packages = several.iter().map(|kind| kind.package).collect();
            let problem = CompileProblem::KindTwice {
                kind: node.kind.clone(),
                packages,
            };
            diagnostics.report(node.kind_place, problem);
            None
        }
        None => {
            let problem = CompileProblem::UnknownKind {
                kind: node.kind.clone(),
                known: kinds().keys().copied().collect(),
            };
            diagnostics.report(node.kind_place, problem);
            None
        }
    };
    let mut instances: Vec<Option<ReadInstance>> = Vec::with_capacity(node.instances.len());
    for (nth, instance) in node.instances.iter().enumerate() {
        // Members whose parameters do not name them share one table, and so one specification.
        let before = nth.checked_sub(1).map(|before| &node.instances[before]);
        let read = match (before, instances.last()) {
            (Some(before), Some(Some(read))) if is_shared(before, instance) => Some(read.clone()),
            _ => kind.and_then(|kind| read_instance(kind, node, instance, diagnostics)),
        };
        instances.push(read);
    }
    ReadNode { kind, instances }
}

fn is_shared(a: &InstanceDecl, b: &InstanceDecl) -> bool {
    match (&a.parameters.data, &b.parameters.data) {
        (Data::Table(a), Data::Table(b)) => a.is_copy_of(b),
        _ => false,
    }
}

fn read_instance(
    kind: &Kind,
    node: &NodeDecl,
    instance: &InstanceDecl,
    diagnostics: &mut Diagnostics,
) -> Option<ReadInstance> {
    let mut parameters = instance.parameters.clone();
    let mut framework = Value {
        place: parameters.place,
        data: Data::Table(Table::new()),
    };
    if let (keys, Data::Table(own), Data::Table(taken)) = (
        kind.framework_keys(),
        &mut parameters.data,
        &mut framework.data,
    ) {
        for &key in keys {
            if let Some(entry) = own.remove(key) {
                taken.insert(key, entry);
            }
        }
    }
    let context = context(node, instance);
    diagnostics.within(context, |diagnostics| {
        let estimator = decode::<EstimatorKeys>(&framework, "the node", diagnostics);
        let spec = (kind.read)(&parameters, diagnostics);
        Some(ReadInstance {
            spec: Arc::from(spec?),
            estimator: estimator?,
        })
    })
}

/// How diagnostics say which instance they speak of.
pub(super) fn context(node: &NodeDecl, instance: &InstanceDecl) -> String {
    match &instance.member {
        Some(member) => format!("node `{}`, member `{member}`", node.name),
        None => format!("node `{}`", node.name),
    }
}

/// One instance on its way into the plan.
pub(crate) struct Instance<'a> {
    pub(crate) node: &'a NodeDecl,
    pub(crate) decl: &'a InstanceDecl,
    pub(crate) kind: &'static Kind,
    pub(crate) read: ReadInstance,
}

impl Instance<'_> {
    /// The place of an input, or of the node where the input is not given.
    pub(crate) fn input_place(&self, port: &str) -> Place {
        self.input(port)
            .map_or(self.node.place, |input| input.place)
    }

    /// How diagnostics say which instance they speak of.
    pub(crate) fn context(&self) -> String {
        context(self.node, self.decl)
    }

    pub(crate) fn input(&self, port: &str) -> Option<&InputDecl> {
        self.decl.inputs.iter().find(|input| input.port == port)
    }

    /// The place of an element of a list among the parameters, or of the list.
    pub(crate) fn element_place(&self, key: &str, nth: usize) -> Place {
        let Data::Table(table) = &self.decl.parameters.data else {
            return self.node.place;
        };
        let Some(list) = table.get(key) else {
            return self.node.place;
        };
        match &list.data {
            Data::List(elements) => elements
                .get(nth)
                .map_or(list.place, |element| element.place),
            _ => list.place,
        }
    }

    /// The place of what a kind points at: an input or a parameter.
    pub(crate) fn place_of(&self, mistake: &Mistake) -> Place {
        match mistake.at.strip_prefix("inputs.") {
            Some(port) => self.input_place(port),
            None => self.parameter_place(&mistake.at),
        }
    }

    /// The place of a parameter such as `selection.folds` or `lags.0`, as near as the file has it.
    pub(crate) fn parameter_place(&self, path: &str) -> Place {
        let mut place = self.node.place;
        let mut value = &self.decl.parameters;
        for key in path.split('.') {
            let inner = match &value.data {
                Data::Table(table) => table.get(key),
                Data::List(values) => key.parse::<usize>().ok().and_then(|nth| values.get(nth)),
                _ => None,
            };
            let Some(inner) = inner else { break };
            (place, value) = (inner.place, inner);
        }
        place
    }
}
