//! Decides what each declaration of a graph stands for, in order: kinds read, inputs looked up, outputs given slots.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use indexmap::IndexSet;
use schemars::JsonSchema;
use serde::Deserialize;

use super::leak::Suspect;
use super::order::Order;
use super::plan::{
    Conversion, Entry, Gather, Plan, PlannedChannel, PlannedNode, PlannedOutput, PlannedRole,
    SourceChannel,
};
use super::problem::CompileProblem;
use super::provenance::Provenance;
use super::scope::{Found, Scopes};
use super::{Wanted, conversion, steps};
use crate::channel::Channel;
use crate::diagnostic::{Diagnostics, Place};
use crate::document::{Data, GraphFile, InputDecl, InstanceDecl, NodeDecl, Table, Value, decode};
use crate::node::{
    InputPort, Inputs, Kind, Mistake, NodeSpec, OutputPort, Read, Role, RoleName, kinds,
};
use crate::quantity::Quantity;
use crate::time::Duration;
use crate::unit::Unit;

/// A node whose kind and parameters have been read.
pub(crate) struct ReadNode {
    kind: Option<&'static Kind>,
    instances: Vec<Option<ReadInstance>>,
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
    if let (RoleName::Estimator, Data::Table(own), Data::Table(taken)) =
        (kind.role, &mut parameters.data, &mut framework.data)
    {
        for key in ["ahead", "train"] {
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
fn context(node: &NodeDecl, instance: &InstanceDecl) -> String {
    match &instance.member {
        Some(member) => format!("node `{}`, member `{member}`", node.name),
        None => format!("node `{}`", node.name),
    }
}

/// The name of a channel among those of all members; the only one of an instance has its member's name.
fn outward_name(member: Option<&str>, single: bool, channel: &str) -> String {
    match member {
        Some(member) if single => member.to_owned(),
        Some(member) => format!("{member}/{channel}"),
        None => channel.to_owned(),
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

/// The state of resolving a graph.
pub(crate) struct Resolver<'g> {
    pub(crate) graph: &'g GraphFile,
    pub(crate) diagnostics: &'g mut Diagnostics,
    pub(crate) channels: Vec<PlannedChannel>,
    pub(crate) provenance: Vec<Provenance>,
    scopes: Scopes,
    sources: Vec<SourceChannel>,
    pub(super) gathers: IndexSet<Gather>,
    pub(super) nodes: Vec<PlannedNode>,
    /// Features whose leaks are looked for once all is known.
    pub(super) suspects: Vec<Suspect>,
    /// Slots that somebody refers to.
    read: BTreeSet<usize>,
}

impl<'g> Resolver<'g> {
    pub(crate) fn new(graph: &'g GraphFile, diagnostics: &'g mut Diagnostics) -> Self {
        let mut resolver = Self {
            graph,
            diagnostics,
            channels: Vec::new(),
            provenance: Vec::new(),
            scopes: Scopes::default(),
            sources: Vec::new(),
            gathers: IndexSet::new(),
            nodes: Vec::new(),
            suspects: Vec::new(),
            read: BTreeSet::new(),
        };
        resolver.take_signals();
        resolver
    }

    pub(crate) fn resolve(mut self, read: &[ReadNode], order: &Order, wanted: Wanted) -> Plan {
        for node in &self.graph.nodes {
            self.scopes.declare(&node.name);
        }
        for &node in &order.looping {
            self.scopes.get_mut(&self.graph.nodes[node].name).broken = true;
        }
        let mut closing = Vec::new();
        for &position in &order.nodes {
            let node = &self.graph.nodes[position];
            let closes = order.closing.contains(&position);
            for (instance, decl) in read[position].instances.iter().zip(&node.instances) {
                let (Some(kind), Some(read)) = (read[position].kind, instance) else {
                    self.scopes.get_mut(&node.name).broken = true;
                    continue;
                };
                let instance = Instance {
                    node,
                    decl,
                    kind,
                    read: read.clone(),
                };
                let before = self.nodes.len();
                let context = context(node, decl);
                let outer = self.diagnostics.scope(Some(context));
                if self.instance(&instance, closes).is_none() {
                    self.scopes.get_mut(&node.name).broken = true;
                }
                self.diagnostics.scope(outer);
                if closes && self.nodes.len() > before {
                    closing.push((before, instance));
                }
            }
        }
        let has_loops = !closing.is_empty();
        for (index, instance) in closing {
            self.close(index, &instance);
        }
        if has_loops {
            self.follow_loops();
        }
        self.find_leaks();
        let outputs = self.outputs();
        self.finish(outputs, wanted)
    }

    fn take_signals(&mut self) {
        for signal in &self.graph.signals {
            for (channel, _) in &signal.channels {
                let name = format!("{}.{channel}", signal.name);
                self.sources.push(SourceChannel {
                    name: name.clone(),
                    column: signal.column.replace("{channel}", channel),
                    optional: signal.optional.contains(channel),
                    range: signal.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY)),
                });
                let slot = self.channels.len();
                self.channels.push(PlannedChannel {
                    name,
                    channel: Channel {
                        name: channel.clone(),
                        unit: signal.unit.clone(),
                        span: Duration::ZERO,
                        ahead: Duration::ZERO,
                        max_age: signal.max_age,
                    },
                    node: None,
                    history: None,
                    predicts: None,
                });
                self.provenance.push(Provenance::source(slot));
                let scope = self.scopes.get_mut(&signal.name);
                scope
                    .ports
                    .entry("")
                    .or_default()
                    .insert(channel.clone(), slot);
            }
        }
    }

    /// Resolves one instance; `None` when an error about it has been told.
    fn instance(&mut self, instance: &Instance<'_>, closes: bool) -> Option<()> {
        let ports = (instance.kind.inputs)();
        for input in &instance.decl.inputs {
            if !ports.iter().any(|port| port.name == input.port) {
                let known = ports.iter().map(|port| port.name).collect();
                let problem = CompileProblem::UnknownInput {
                    kind: instance.kind.name,
                    input: input.port.clone(),
                    known,
                };
                self.diagnostics.report(input.place, problem);
            }
        }
        let spec = Arc::clone(&instance.read.spec);
        match spec.role() {
            Role::Feature(feature) => self.feature(instance, feature, closes),
            Role::Estimator(estimator) => self.estimator(instance, estimator),
            Role::Combiner(combiner) => self.combiner(instance, combiner),
        }
    }

    /// Looks up what an input refers to: slots in order, none for an optional input left out.
    pub(crate) fn slots(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
    ) -> Option<Vec<usize>> {
        let Some(input) = instance.input(port.name) else {
            if port.optional {
                return Some(Vec::new());
            }
            let problem = CompileProblem::MissingInput {
                kind: instance.kind.name,
                input: port.name,
                summary: port.summary,
            };
            self.diagnostics.report(instance.node.place, problem);
            return None;
        };
        let mut slots = Vec::new();
        let mut whole = true;
        for (text, place) in &input.references {
            match self.look_up(text, *place) {
                Some(found) => slots.extend(found),
                None => whole = false,
            }
        }
        whole.then_some(slots)
    }

    fn look_up(&mut self, text: &str, place: Place) -> Option<Vec<usize>> {
        match self.scopes.look_up(text) {
            Ok(Found::Slots(slots)) => {
                self.read.extend(&slots);
                Some(slots)
            }
            Ok(Found::Broken) => None,
            Err(problem) => {
                self.diagnostics.report(place, *problem);
                None
            }
        }
    }

    /// The one slot of an input that takes a single channel.
    pub(crate) fn single(&mut self, instance: &Instance<'_>, port: &InputPort) -> Option<usize> {
        let slots = self.slots(instance, port)?;
        if let [slot] = slots[..] {
            return Some(slot);
        }
        let found = slots
            .iter()
            .map(|&slot| self.channels[slot].name.clone())
            .collect();
        let problem = CompileProblem::ChannelCount {
            input: port.name,
            found,
            expected: "one channel",
        };
        self.diagnostics
            .report(instance.input_place(port.name), problem);
        None
    }

    /// How long a held value of each slot counts at an input.
    pub(crate) fn max_age(
        &mut self,
        instance: &Instance<'_>,
        port: &str,
        slot: usize,
    ) -> Option<Duration> {
        let stated = instance
            .input(port)
            .and_then(|input| input.max_age)
            .map(|(age, _)| age);
        let age = stated.or_else(|| self.channels[slot].channel.default_max_age());
        if age.is_none() {
            let channel = self.channels[slot].name.clone();
            let problem = CompileProblem::NoMaxAge {
                channel,
                input: port.to_owned(),
            };
            self.diagnostics.report(instance.input_place(port), problem);
        }
        age
    }

    /// The gather that reads these slots at one lag.
    pub(crate) fn gather(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
        slots: &[usize],
        lags: &[Duration],
        unit: Option<&Unit>,
    ) -> Option<usize> {
        let conversions = self.conversions(instance, port, slots, lags.len(), unit)?;
        let mut entries = Vec::with_capacity(slots.len() * lags.len());
        for &lag in lags {
            for &slot in slots {
                let max_age = match port.read {
                    Read::Fresh => Some(Duration::ZERO),
                    Read::Held | Read::Truth => self.max_age(instance, port.name, slot),
                };
                entries.push(Entry {
                    slot,
                    lag,
                    max_age: max_age?,
                });
                if lag > Duration::ZERO {
                    let history = &mut self.channels[slot].history;
                    *history = Some(history.map_or(lag, |deepest| deepest.max(lag)));
                }
            }
        }
        let read = if port.read == Read::Fresh {
            Read::Fresh
        } else {
            Read::Held
        };
        let gather = Gather {
            read,
            entries,
            conversions,
        };
        Some(self.gathers.insert_full(gather).0)
    }

    /// What it takes to give slots, at so many lags, in a unit; `None` when one does not convert, which has been told.
    fn conversions(
        &mut self,
        instance: &Instance<'_>,
        port: &InputPort,
        slots: &[usize],
        lags: usize,
        unit: Option<&Unit>,
    ) -> Option<Vec<Conversion>> {
        let Some(unit) = unit else {
            return Some(Vec::new());
        };
        let channels = slots.iter().map(|&slot| &self.channels[slot]);
        let channels = channels.map(|from| (from.name.as_str(), &from.channel.unit));
        let wanted_by = format!("inputs.{}", port.name);
        match conversion::conversions(channels, unit, &wanted_by) {
            Ok(conversions) => {
                let at_lag = |lag: usize| {
                    conversions.iter().map(move |conversion| {
                        Conversion::new(lag * slots.len() + conversion.entry, conversion.factor())
                    })
                };
                Some((0..lags).flat_map(at_lag).collect())
            }
            Err(problems) => {
                for problem in problems {
                    let place = instance.input_place(port.name);
                    self.diagnostics.report(place, problem);
                }
                None
            }
        }
    }

    /// The unit that an input port declares.
    pub(crate) fn port_unit(port: &InputPort) -> Option<Unit> {
        let unit = port.unit.and_then(|unit| unit.parse().ok());
        debug_assert_eq!(unit.is_some(), port.unit.is_some(), "a kind declares units");
        unit
    }

    /// The channels of slots, as kinds see them.
    pub(crate) fn inputs(
        &self,
        instance: &Instance<'_>,
        ports: Vec<(InputPort, Vec<usize>)>,
    ) -> Inputs {
        let channels = |port: InputPort, slots: Vec<usize>| {
            let unit = Self::port_unit(&port);
            let channels = slots.into_iter().map(|slot| {
                let channel = self.channels[slot].channel.clone();
                let unit = unit.clone().unwrap_or_else(|| channel.unit.clone());
                Channel { unit, ..channel }
            });
            (port, channels.collect())
        };
        Inputs {
            ports: ports
                .into_iter()
                .map(|(port, slots)| channels(port, slots))
                .collect(),
            member: instance.decl.member.clone(),
        }
    }

    pub(crate) fn mistakes(&mut self, instance: &Instance<'_>, mistakes: Vec<Mistake>) {
        for mistake in mistakes {
            let place = instance.place_of(&mistake);
            let problem = CompileProblem::Parameter {
                message: mistake.message,
                help: mistake.help,
            };
            self.diagnostics.report(place, problem);
        }
    }

    /// Tells what the kind finds odd and can live with.
    pub(crate) fn doubts(&mut self, instance: &Instance<'_>, doubts: Vec<Mistake>) {
        for doubt in doubts {
            let place = instance.place_of(&doubt);
            let problem = CompileProblem::Doubt {
                message: doubt.message,
                help: doubt.help,
            };
            self.diagnostics.report(place, problem);
        }
    }

    /// Gives outputs their slots and names, and the node its place in the plan.
    pub(crate) fn add(
        &mut self,
        instance: &Instance<'_>,
        ports: Vec<OutputPort>,
        role: PlannedRole,
        behind: Vec<Provenance>,
        predicts: Option<usize>,
    ) -> Option<()> {
        let index = self.nodes.len();
        let start = self.channels.len();
        let mut ranges: Vec<(&'static str, Range<usize>)> = Vec::new();
        let mut behind = behind.into_iter();
        let mut whole = true;
        for port in ports {
            let first = self.channels.len();
            let single = port.channels.len() == 1;
            for channel in port.channels {
                let own = channel.name.clone();
                let outward = outward_name(instance.decl.member.as_deref(), single, &own);
                let slot = self.channels.len();
                let named = if ranges.is_empty() {
                    format!("{}.{outward}", instance.node.name)
                } else {
                    format!("{}:{}.{outward}", instance.node.name, port.name)
                };
                self.channels.push(PlannedChannel {
                    name: named,
                    channel,
                    node: Some(index),
                    history: None,
                    // Only what a node gives first is a prediction; the other ports tell of it.
                    predicts: predicts.filter(|_| ranges.is_empty()),
                });
                self.provenance.push(behind.next().unwrap_or_default());
                let scope = self.scopes.get_mut(&instance.node.name);
                if scope
                    .ports
                    .entry(port.name)
                    .or_default()
                    .insert(outward.clone(), slot)
                    .is_some()
                {
                    let problem = CompileProblem::DuplicateName {
                        name: outward,
                        what: "output channels",
                    };
                    self.diagnostics.report(instance.node.place, problem);
                    whole = false;
                }
                for (scope, member) in &instance.decl.scopes {
                    let outward = outward_name(member.as_deref(), single, &own);
                    let ports = &mut self.scopes.get_mut(scope).ports;
                    ports.entry(port.name).or_default().insert(outward, slot);
                }
            }
            ranges.push((port.name, first..self.channels.len()));
        }
        self.nodes.push(PlannedNode {
            name: instance.node.name.clone(),
            member: instance.decl.member.clone(),
            kind: instance.kind,
            spec: Arc::clone(&instance.read.spec),
            role,
            slots: start..self.channels.len(),
            ports: ranges,
        });
        whole.then_some(())
    }

    /// Gives a node that closes a loop the inputs that were not known when its outputs were.
    fn close(&mut self, index: usize, instance: &Instance<'_>) {
        let mut gathers = Vec::new();
        for port in (instance.kind.inputs)() {
            let Some(slots) = self.slots(instance, port) else {
                return;
            };
            // What it gives was described before what it reads was known.
            let own = self.nodes[index].slots.clone().next();
            let unit = own.map(|slot| self.channels[slot].channel.unit.clone());
            let lags = [Duration::ZERO];
            let Some(gather) = self.gather(instance, port, &slots, &lags, unit.as_ref()) else {
                return;
            };
            if slots.len() != self.nodes[index].slots.len() {
                let found = slots
                    .iter()
                    .map(|&slot| self.channels[slot].name.clone())
                    .collect();
                let problem = CompileProblem::ChannelCount {
                    input: port.name,
                    found,
                    expected: "one channel, since it closes a loop,",
                };
                self.diagnostics
                    .report(instance.input_place(port.name), problem);
            }
            gathers.push(gather);
        }
        if let PlannedRole::Feature {
            gathers: planned, ..
        } = &mut self.nodes[index].role
        {
            *planned = gathers;
        }
    }

    fn outputs(&mut self) -> Vec<PlannedOutput> {
        let graph = self.graph;
        let mut outputs = Vec::new();
        let mut names = BTreeSet::new();
        for output in &graph.outputs {
            for (text, place) in &output.from {
                for slot in self.look_up(text, *place).unwrap_or_default() {
                    let channel = self.channels[slot]
                        .name
                        .split_once('.')
                        .map_or("", |(_, channel)| channel);
                    let name = format!("{}.{channel}", output.name);
                    if !names.insert(name.clone()) {
                        let problem = CompileProblem::DuplicateName {
                            name: name.clone(),
                            what: "output columns",
                        };
                        self.diagnostics.report(*place, problem);
                    }
                    outputs.push(PlannedOutput {
                        name,
                        slot,
                        blend: output.blend.clone(),
                    });
                }
            }
        }
        outputs
    }

    fn finish(self, outputs: Vec<PlannedOutput>, wanted: Wanted) -> Plan {
        let mut plan = Plan {
            name: self.graph.name.clone(),
            time: self.graph.time.clone(),
            sources: self.sources,
            channels: self.channels,
            gathers: self.gathers.into_iter().collect(),
            nodes: self.nodes,
            steps: Vec::new(),
            outputs,
            warm_up: Duration::ZERO,
        };
        steps::mark_wanted(&mut plan, &self.read, wanted);
        plan.steps = steps::steps(&plan);
        plan.warm_up = steps::warm_up(&plan);
        if !self.diagnostics.has_errors() {
            steps::warn(self.graph, &plan, self.diagnostics);
        }
        plan
    }
}
