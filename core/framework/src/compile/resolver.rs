//! What each declaration of a graph stands for, in order: kinds read, inputs looked up, outputs given slots.

use std::collections::{BTreeSet, HashSet};
use std::ops::Range;
use std::sync::Arc;

use indexmap::IndexSet;

use super::guard::Panics;
use super::instance::{Declared, Instance, ReadNode, context};
use super::kind_fault::KindFault;
use super::order::Order;
use super::plan::{
    Gather, Plan, Planned, PlannedChannel, PlannedNode, PlannedOutput, PlannedRole, SourceChannel,
    TruthLink,
};
use super::problem;
use super::provenance::Provenance;
use super::scope::Scopes;
use super::{Wanted, steps};
use crate::channel::Channel;
use crate::diagnostic::{Diagnostics, Place, Problem};
use crate::document::{GraphFile, InstanceDecl, NodeDecl};
use crate::node::{Kind, Mistake, OutputPort, Role, RoleName};
use crate::time::Duration;
use crate::unit::Unit;

/// The most channels that a graph may have; a few hundred bytes each.
const MOST_CHANNELS: usize = 1_000_000;

/// The name of a channel among those of all members; the only one of an instance has its member's name.
fn outward_name(member: Option<&str>, single: bool, channel: &str) -> String {
    match member {
        Some(member) if single => member.to_owned(),
        Some(member) => format!("{member}/{channel}"),
        None => channel.to_owned(),
    }
}

/// The state of resolving a graph.
pub(crate) struct Resolver<'g> {
    pub(crate) graph: &'g GraphFile,
    panics: Panics,
    pub(crate) diagnostics: &'g mut Diagnostics,
    pub(crate) channels: Vec<PlannedChannel>,
    pub(crate) provenance: Vec<Provenance>,
    pub(super) scopes: Scopes,
    sources: Vec<SourceChannel>,
    pub(super) gathers: IndexSet<Gather>,
    pub(super) nodes: Vec<PlannedNode>,
    /// Features whose leaks are looked for once all is known.
    pub(super) suspects: Vec<Suspect>,
    /// Slots that somebody refers to.
    pub(super) read: Vec<usize>,
}

/// Features of an estimator that are still to be looked at.
#[derive(Debug)]
pub(super) struct Suspect {
    pub(super) place: Place,
    pub(super) context: String,
    /// The slots that are read.
    pub(super) features: Vec<usize>,
    /// The lag at which they are read.
    pub(super) lag: Duration,
    /// The truth that is predicted.
    pub(super) link: TruthLink,
}

impl<'g> Resolver<'g> {
    pub(super) fn new(
        graph: &'g GraphFile,
        panics: Panics,
        diagnostics: &'g mut Diagnostics,
    ) -> Self {
        Self {
            graph,
            panics,
            diagnostics,
            channels: Vec::new(),
            provenance: Vec::new(),
            scopes: Scopes::default(),
            sources: Vec::new(),
            gathers: IndexSet::new(),
            nodes: Vec::new(),
            suspects: Vec::new(),
            read: Vec::new(),
        }
    }

    /// Makes every name known that a reference may name, and hides those of which a mistake has been reported.
    pub(super) fn name_all(&mut self, order: &Order) {
        self.take_signals();
        for node in &self.graph.nodes {
            self.scopes.declare(&node.name);
        }
        self.scopes.removed.clone_from(&self.graph.removed);
        for name in &self.graph.broken {
            self.scopes.get_mut(name).broken = true;
        }
        for &node in &order.looping {
            self.scopes.get_mut(&self.graph.nodes[node].name).broken = true;
        }
    }

    /// Resolves every node in order; gives those that close a loop, which are given their inputs [later](Self::close_loops).
    pub(super) fn resolve_nodes(
        &mut self,
        read: &[ReadNode],
        order: &Order,
    ) -> Vec<(usize, Instance<'g>)> {
        let mut closing = Vec::new();
        for &position in order.nodes.iter().chain(&order.looping) {
            let node = &self.graph.nodes[position];
            let closes = order.closing.contains(&position);
            let sound = !node.faulty && !order.looping.contains(&position);
            for (parts, decl) in read[position].instances.iter().zip(&node.instances) {
                let outer = self.diagnostics.scope(Some(context(node, decl)));
                let kind = read[position].kind;
                let whole = parts.whole().filter(|_| sound);
                if let Some((kind, read)) = kind.zip(whole) {
                    let declared = Declared { node, decl, kind };
                    let instance = Instance { declared, read };
                    let before = self.nodes.len();
                    let resolved = self.guarded(Some(kind), (node, decl), |resolver| {
                        resolver.instance(&instance, closes)
                    });
                    if resolved.is_none() {
                        self.scopes.get_mut(&node.name).broken = true;
                    }
                    if closes && self.nodes.len() > before {
                        closing.push((before, instance));
                    }
                } else {
                    self.scopes.get_mut(&node.name).broken = true;
                    self.guarded(kind, (node, decl), |resolver| {
                        resolver.survey(node, decl, kind, parts);
                        Some(())
                    });
                }
                self.diagnostics.scope(outer);
            }
        }
        closing
    }

    /// Gives the nodes that close a loop their inputs, and takes into account what these bring back.
    pub(super) fn close_loops(&mut self, closing: Vec<(usize, Instance<'_>)>) {
        let has_loops = !closing.is_empty();
        for (index, instance) in closing {
            self.close(index, &instance);
        }
        if has_loops {
            self.follow_loops();
        }
    }

    fn take_signals(&mut self) {
        let channels = self.graph.signals.iter().map(|of| of.channels.len());
        let mut behind = channels.sum();
        for signal in &self.graph.signals {
            for (channel, _) in &signal.channels {
                let planned = signal.known_ahead.map(|known_ahead| {
                    let applies_at = behind;
                    behind += 1;
                    Planned {
                        known_ahead,
                        applies_at,
                    }
                });
                let source = SourceChannel {
                    name: format!("{}.{channel}", signal.name),
                    column: signal.column.replace("{channel}", channel),
                    optional: signal.optional.contains(channel),
                    range: signal.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY)),
                    planned,
                    is_instant: false,
                };
                let slot = self.source(source, channel, &signal.unit, signal.max_age);
                let scope = self.scopes.get_mut(&signal.name);
                scope
                    .ports
                    .entry("")
                    .or_default()
                    .insert(channel.clone(), slot);
            }
        }
        // From when planned values apply stands behind all that graphs refer to, since none refers to it.
        let signals = self.graph.signals.iter();
        for signal in signals.filter(|of| of.known_ahead.is_some()) {
            for (channel, _) in &signal.channels {
                let source = SourceChannel {
                    name: format!("{}:applies_at.{channel}", signal.name),
                    column: signal.applies_at.replace("{channel}", channel),
                    optional: signal.optional.contains(channel),
                    range: (f64::NEG_INFINITY, f64::INFINITY),
                    planned: None,
                    is_instant: true,
                };
                let seconds = Unit::parse("s").expect("the second is a unit");
                self.source(source, channel, &seconds, signal.max_age);
            }
        }
    }

    /// Gives a measured channel its slot.
    fn source(
        &mut self,
        source: SourceChannel,
        channel: &str,
        unit: &Unit,
        max_age: Option<Duration>,
    ) -> usize {
        let slot = self.channels.len();
        self.channels.push(PlannedChannel {
            name: source.name.clone(),
            channel: Channel {
                name: channel.to_owned(),
                unit: unit.clone(),
                span: Duration::ZERO,
                ahead: Duration::ZERO,
                max_age,
            },
            node: None,
            history: source.planned.map(|_| Duration::ZERO),
            predicts: None,
        });
        self.sources.push(source);
        self.provenance.push(Provenance::source(slot));
        slot
    }

    /// What is known of a slot ahead of time, where it is a planned channel.
    pub(super) fn planned(&self, slot: usize) -> Option<Planned> {
        self.sources.get(slot)?.planned
    }

    /// Resolves one instance; `None` when an error about it has been reported.
    fn instance(&mut self, instance: &Instance<'_>, closes: bool) -> Option<()> {
        self.known_inputs(instance);
        self.idle_ages(instance);
        self.sound(instance, KindFault::of_ports((instance.kind.inputs)()))?;
        let spec = Arc::clone(&instance.read.spec);
        match spec.role() {
            Role::Feature(feature) => self.feature(instance, feature, closes),
            Role::Estimator(estimator) => self.estimator(instance, estimator),
            Role::Combiner(combiner) => self.combiner(instance, combiner),
        }
    }

    /// Does what takes code of a kind, for an instance of a node; nothing comes of it where that panics, which is reported.
    fn guarded(
        &mut self,
        kind: Option<&'static Kind>,
        (node, decl): (&NodeDecl, &InstanceDecl),
        work: impl FnOnce(&mut Self) -> Option<()>,
    ) -> Option<()> {
        let Some(kind) = kind else {
            return work(self);
        };
        let done = self.panics.caught(kind, (node, decl), || work(self));
        done.unwrap_or_else(|fault| {
            self.diagnostics
                .report(node.place, problem::FaultyKind::new(kind, fault));
            None
        })
    }

    /// Tells what is wrong with a kind itself, at a node of it; none where nothing is.
    pub(super) fn sound(
        &mut self,
        instance: &Instance<'_>,
        faults: impl IntoIterator<Item = KindFault>,
    ) -> Option<()> {
        let mut sound = Some(());
        for fault in faults {
            let problem = problem::FaultyKind::new(instance.kind, fault);
            self.diagnostics.report(instance.node.place, problem);
            sound = None;
        }
        sound
    }

    /// Reports what the kind refuses.
    pub(crate) fn mistakes(&mut self, instance: &Declared<'_>, mistakes: Vec<Mistake>) {
        self.report_each(instance, mistakes, |message, help| {
            problem::Parameter { message, help }.into()
        });
    }

    /// Reports what the kind finds odd and can live with.
    pub(crate) fn doubts(&mut self, instance: &Declared<'_>, doubts: Vec<Mistake>) {
        self.report_each(instance, doubts, |message, help| {
            problem::Doubt { message, help }.into()
        });
    }

    fn report_each(
        &mut self,
        instance: &Declared<'_>,
        mistakes: Vec<Mistake>,
        problem: fn(String, Option<String>) -> Box<dyn Problem>,
    ) {
        for mistake in mistakes {
            let place = instance.place_of(&mistake);
            let problem = problem(mistake.message, mistake.help);
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
        let more: usize = ports.iter().map(|port| port.channels.len()).sum();
        if start.saturating_add(more) > MOST_CHANNELS {
            let message = format!(
                "with its channels the graph has {}, more than {MOST_CHANNELS}",
                start.saturating_add(more)
            );
            let help = "give it or the nodes before it fewer windows, lags or inputs";
            let port = (instance.kind.inputs)()
                .first()
                .map_or("", |port| port.name);
            let at = format!("inputs.{port}");
            self.mistakes(instance, vec![Mistake::at(at, message).help(help)]);
            return None;
        }
        let mut ranges: Vec<(&'static str, Range<usize>)> = Vec::new();
        let mut behind = behind.into_iter();
        let mut whole = true;
        for port in ports {
            debug_assert!(
                instance.kind.role == RoleName::Feature
                    || instance.kind.outputs().contains(&port.name),
                "the ports of estimators and combiners are those that their kinds declare"
            );
            let first = self.channels.len();
            let single = port.channels.len() == 1;
            for channel in port.channels {
                let own = channel.name.clone();
                let outward = outward_name(instance.decl.member.as_deref(), single, &own);
                let (slot, span) = (self.channels.len(), channel.span);
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
                    // Only what a node gives first is a prediction; the other ports describe it.
                    predicts: predicts.filter(|_| ranges.is_empty()),
                });
                let behind = behind.next().unwrap_or_default();
                self.provenance.push(behind.spanning(span));
                let scope = self.scopes.get_mut(&instance.node.name);
                if scope
                    .ports
                    .entry(port.name)
                    .or_default()
                    .insert(outward.clone(), slot)
                    .is_some()
                {
                    let problem = problem::DuplicateName {
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
        let (memory, endless) = match instance.read.spec.role() {
            Role::Feature(feature) => (feature.memory(), feature.is_endless()),
            Role::Combiner(combiner) => (combiner.memory(), combiner.is_endless()),
            Role::Estimator(_) => (Duration::ZERO, false),
        };
        self.sound(instance, KindFault::of_memory(memory))?;
        self.nodes.push(PlannedNode {
            name: instance.node.name.clone(),
            member: instance.decl.member.clone(),
            kind: instance.kind,
            spec: Arc::clone(&instance.read.spec),
            role,
            memory,
            endless,
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
                let expected = "one channel, since it closes a loop,";
                self.wrong_count(instance, port.name, &slots, expected);
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

    pub(super) fn outputs(&mut self) -> Vec<PlannedOutput> {
        let graph = self.graph;
        let mut outputs = Vec::new();
        let mut names = HashSet::new();
        for output in &graph.outputs {
            for (text, place) in &output.from {
                let mut taken = Vec::new();
                let mut blends = true;
                for slot in self.look_up(text, *place).unwrap_or_default() {
                    let channel = self.channels[slot]
                        .name
                        .split_once('.')
                        .map_or("", |(_, channel)| channel);
                    let name = format!("{}.{channel}", output.name);
                    if !names.insert(name.clone()) {
                        taken.push(name.clone());
                    }
                    if let Some((rate, place)) = &output.blend {
                        let unit = &self.channels[slot].channel.unit;
                        let per_second = unit.difference().per(&Unit::second());
                        let is_rate = rate.in_unit(&per_second).is_some_and(|rate| rate > 0.0);
                        if std::mem::replace(&mut blends, is_rate) && !is_rate {
                            let problem = problem::Blend {
                                output: name.clone(),
                                found: rate.clone(),
                                expected: per_second,
                            };
                            self.diagnostics.report(*place, problem);
                        }
                    }
                    outputs.push(PlannedOutput {
                        name,
                        slot,
                        blend: output.blend.as_ref().map(|(rate, _)| rate.clone()),
                    });
                }
                if let [first, more @ ..] = &taken[..] {
                    let node = text.split(['.', ':']).next().unwrap_or_default();
                    let is_free = graph.outputs.iter().all(|other| other.name != node);
                    let problem = problem::DuplicateColumns {
                        first: first.clone(),
                        more: more.len(),
                        alone: is_free.then(|| format!("{node} = \"{text}\"")),
                    };
                    self.diagnostics.report(*place, problem);
                }
            }
        }
        outputs
    }

    /// The plan, and the names of which something is missing in it.
    pub(super) fn finish(
        self,
        outputs: Vec<PlannedOutput>,
        wanted: Wanted,
    ) -> (Plan, BTreeSet<String>) {
        let mut broken = self.scopes.broken();
        broken.extend(self.graph.outputs.iter().map(|output| output.name.clone()));
        let mut plan = Plan {
            name: self.graph.name.clone(),
            time: self.graph.time.clone(),
            table: self.graph.table.clone(),
            sources: self.sources,
            channels: self.channels,
            gathers: self.gathers.into_iter().collect(),
            nodes: self.nodes,
            steps: Vec::new(),
            outputs,
            warm_up: Duration::ZERO,
        };
        steps::lay_out(&mut plan, self.read, wanted);
        (plan, broken)
    }
}
