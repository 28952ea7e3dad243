//! Decides what each node of a file says: its kind looked up, its parameters read, and where in the file each of them stands.

use std::ops::Deref;
use std::sync::Arc;

use super::guard::Panics;
use super::keys::EstimatorKeys;
use super::misplaced::{INPUTS, misplaced};
use super::problem;
use crate::diagnostic::{Diagnostics, Place, Problem};
use crate::document::problem::InputAsKey;
use crate::document::{Data, GraphFile, InputDecl, InstanceDecl, NodeDecl, Table, Value, decode};
use crate::node::{
    Kind, Mistake, NodeKind, NodeSpec, PredictorForm, Role, StateForm, out_of_range,
};
use crate::registry::{self, taken_twice};

/// A node whose kind and parameters have been read.
pub(crate) struct ReadNode {
    pub(super) kind: Option<&'static Kind>,
    pub(super) instances: Vec<ReadParts>,
}

/// What could be read of one instance.
#[derive(Clone, Default)]
pub(crate) struct ReadParts {
    /// The specification.
    pub(super) spec: Option<Arc<dyn NodeSpec>>,
    /// The keys that the framework reads itself.
    pub(super) estimator: Option<EstimatorKeys>,
    /// Whether it takes its inputs for later ticks only.
    closes_loops: bool,
}

/// The specification of one instance, with the keys that the framework reads itself.
pub(crate) struct ReadInstance {
    pub(crate) spec: Arc<dyn NodeSpec>,
    pub(crate) estimator: EstimatorKeys,
}

impl ReadParts {
    fn is_whole(&self) -> bool {
        self.spec.is_some() && self.estimator.is_some()
    }

    pub(super) fn whole(&self) -> Option<ReadInstance> {
        Some(ReadInstance {
            spec: self.spec.clone()?,
            estimator: self.estimator.clone()?,
        })
    }
}

impl ReadNode {
    /// Whether the node takes its inputs for later ticks only.
    pub(crate) fn closes_loops(&self) -> bool {
        self.instances.iter().any(|read| read.closes_loops)
    }

    /// Whether it is known of all instances what they are.
    pub(crate) fn is_known(&self) -> bool {
        self.kind.is_some() && self.instances.iter().all(|read| read.spec.is_some())
    }
}

/// Looks every node's kind up and reads its parameters.
pub(super) fn read_kinds(
    graph: &GraphFile,
    panics: Panics,
    diagnostics: &mut Diagnostics,
) -> Vec<ReadNode> {
    graph
        .nodes
        .iter()
        .map(|node| read_node(node, panics, diagnostics))
        .collect()
}

fn read_node(node: &NodeDecl, panics: Panics, diagnostics: &mut Diagnostics) -> ReadNode {
    let kind = node.kind.as_ref().and_then(|(name, place)| {
        let found = find(name);
        found
            .map_err(|problem| diagnostics.report(*place, problem))
            .ok()
    });
    let mut instances: Vec<ReadParts> = Vec::with_capacity(node.instances.len());
    for (nth, instance) in node.instances.iter().enumerate() {
        // Members whose parameters do not name them share one table, and so one specification.
        let before = nth.checked_sub(1).map(|before| &node.instances[before]);
        let read = match (before, instances.last(), kind) {
            (Some(before), Some(read), _) if read.is_whole() && is_shared(before, instance) => {
                read.clone()
            }
            (.., Some(kind)) if !node.open => {
                read_instance(kind, node, instance, panics, diagnostics)
            }
            _ => ReadParts::default(),
        };
        instances.push(read);
    }
    ReadNode { kind, instances }
}

/// The kind of a name.
fn find(name: &str) -> Result<&'static Kind, Box<dyn Problem>> {
    let kind = registry::find::<NodeKind>(name).map_err(|why| -> Box<dyn Problem> {
        match why.is_twice() {
            true => problem::KindTwice { why }.into(),
            false => problem::UnknownKind { why }.into(),
        }
    })?;
    let twice = taken_twice::<StateForm>(kind.package);
    match twice.or_else(|| taken_twice::<PredictorForm>(kind.package)) {
        None => Ok(kind),
        Some(written) => Err(problem::WrittenTwice {
            kind: kind.name,
            written,
        }
        .into()),
    }
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
    panics: Panics,
    diagnostics: &mut Diagnostics,
) -> ReadParts {
    let mut parameters = instance.parameters.clone();
    let mut keys = Table::new();
    for &key in kind.framework_keys() {
        if let Some(entry) = parameters.as_table_mut().and_then(|own| own.remove(key)) {
            keys.insert(key, entry);
        }
    }
    let framework = Value {
        place: parameters.place,
        data: Data::Table(keys),
    };
    diagnostics.within(context(node, instance), |diagnostics| {
        let is_whole = take_inputs(kind, &mut parameters, diagnostics);
        let estimator = decode::<EstimatorKeys>(&framework, "the node", diagnostics);
        let elsewhere = [&["type", "inputs", "each"], kind.framework_keys()].concat();
        let read = panics.caught(kind, (node, instance), || {
            let spec = (kind.read)(&parameters, &elsewhere, diagnostics)?;
            let wrong = out_of_range((kind.schema)(), &parameters);
            let is_sound = wrong.is_empty();
            for (place, message) in wrong {
                let help = None;
                diagnostics.report(place, problem::Parameter { message, help });
            }
            if !is_sound {
                return None;
            }
            let closes_loops = match spec.role() {
                Role::Feature(feature) => feature.closes_loops(),
                _ => false,
            };
            let spec = Arc::<dyn NodeSpec>::from(spec);
            Some((spec, closes_loops))
        });
        let read = read.unwrap_or_else(|fault| {
            diagnostics.report(node.place, problem::FaultyKind::new(kind, fault));
            None
        });
        let (spec, closes_loops) = read.filter(|_| is_whole).unzip();
        ReadParts {
            spec,
            estimator,
            closes_loops: closes_loops.unwrap_or_default(),
        }
    })
}

/// The name of an instance: `thermal.Z1`.
pub(super) fn instance_name(node: &str, member: Option<&str>) -> String {
    match member {
        Some(member) => format!("{node}.{member}"),
        None => node.to_owned(),
    }
}

/// Takes inputs out of the parameters among which they stand, and reports them; false if there are any.
fn take_inputs(kind: &Kind, parameters: &mut Value, diagnostics: &mut Diagnostics) -> bool {
    let Some(table) = parameters.as_table_mut() else {
        return true;
    };
    let mut is_whole = true;
    for (key, input) in misplaced(kind, table) {
        if input != INPUTS
            && let Some(entry) = table.remove(&key)
        {
            let (what, input) = ("the node".to_owned(), input.to_owned());
            let problem = InputAsKey { key, what, input };
            diagnostics.report(entry.key, problem);
            is_whole = false;
        }
    }
    is_whole
}

/// How diagnostics say which instance they speak of.
pub(super) fn context(node: &NodeDecl, instance: &InstanceDecl) -> String {
    match &instance.member {
        Some(member) => format!("node `{}`, member `{member}`", node.name),
        None => format!("node `{}`", node.name),
    }
}

/// One instance as it is declared, of a kind that there is.
pub(crate) struct Declared<'a> {
    pub(crate) node: &'a NodeDecl,
    pub(crate) decl: &'a InstanceDecl,
    pub(crate) kind: &'static Kind,
}

/// One instance on its way into the plan.
pub(crate) struct Instance<'a> {
    pub(crate) declared: Declared<'a>,
    pub(crate) read: ReadInstance,
}

impl<'a> Deref for Instance<'a> {
    type Target = Declared<'a>;

    fn deref(&self) -> &Declared<'a> {
        &self.declared
    }
}

impl Declared<'_> {
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

    /// The place of what a kind points at: an input or a parameter.
    pub(crate) fn place_of(&self, mistake: &Mistake) -> Place {
        debug_assert!(
            self.has(&mistake.at),
            "it finds a mistake at `{}`, which is none of its parameters and ports: {}",
            mistake.at,
            mistake.message
        );
        match mistake.at.strip_prefix("inputs.") {
            Some(port) => self.input_place(port),
            None => self.parameter_place(&mistake.at),
        }
    }

    /// Whether a kind that points at this points at something of its own.
    fn has(&self, at: &str) -> bool {
        match at.split_once('.') {
            None if at.is_empty() => true,
            Some(("inputs", port)) => (self.kind.inputs)().iter().any(|own| own.name == port),
            way => {
                let first = way.map_or(at, |(first, _)| first);
                !(self.kind.schema)()["properties"][first].is_null()
                    || self.kind.framework_keys().contains(&first)
            }
        }
    }

    /// The values on the way to a parameter, up to the first that is not given.
    fn parameter<'v>(&'v self, path: &'v str) -> impl Iterator<Item = Option<&'v Value>> {
        path.split('.')
            .scan(Some(&self.decl.parameters), |value, key| {
                let outer = (*value)?;
                *value = match &outer.data {
                    Data::Table(table) => table.get(key),
                    Data::List(values) => key.parse::<usize>().ok().and_then(|nth| values.get(nth)),
                    _ => None,
                };
                Some(*value)
            })
    }

    /// The place of a parameter such as `selection.folds` or `lags.0`, as near as the file has it.
    pub(crate) fn parameter_place(&self, path: &str) -> Place {
        let given = self.parameter(path).flatten();
        given.last().map_or(self.node.place, |inner| inner.place)
    }
}
