//! What an axis of a graph is made of.

use std::collections::BTreeMap;

use athermal_core::compile::{Plan, PlannedNode};
use athermal_core::node::Duty;
use athermal_serve::shown::{Shown, member};

use crate::settings::Page;

/// An axis: where the graph says what of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Axis {
    pub(crate) name: String,
    /// How it drifts.
    pub(crate) drift: Option<Shown>,
    /// What is left of that.
    pub(crate) left: Option<Shown>,
    /// Other than 0 while it is stable; or the state of a node that grades drifts, which is 0 then.
    pub(crate) stable: Option<(Shown, bool)>,
    /// Other than 0 while it may be measured; where there is none it may be while it is stable.
    pub(crate) may_measure: Option<Shown>,
    /// What holds the correction back, and what its numbers say.
    pub(crate) held: Option<(Shown, &'static athermal_core::node::Kind)>,
    /// What a picture of it shows.
    pub(crate) shown: BTreeMap<&'static str, Vec<Shown>>,
}

impl Axis {
    fn show(&mut self, what: &'static str, shown: Shown) {
        let all = self.shown.entry(what).or_default();
        if !all.contains(&shown) {
            all.push(shown);
        }
    }

    /// What it drifts by, what is left, whether it is stable, whether it may be measured, what holds its correction back.
    pub(crate) fn parts(&self) -> [Option<Shown>; 5] {
        let stable = self.stable.map(|(of, _)| of);
        let held = self.held.map(|(of, _)| of);
        [self.drift, self.left, stable, self.may_measure, held]
    }

    /// All that it is made of.
    pub(crate) fn all(&self) -> impl Iterator<Item = Shown> {
        self.parts().into_iter().flatten()
    }
}

/// The axes of a plan, in the order in which its outputs name them.
pub(crate) fn axes(plan: &Plan, settings: &Page) -> Vec<Axis> {
    let mut axes = Axes {
        plan,
        all: Vec::new(),
    };
    axes.predictions();
    for node in &plan.nodes {
        match node.kind.duty() {
            Duty::Grade { .. } => axes.grades(node),
            Duty::Correct => axes.corrects(node),
            _ => {}
        }
    }
    // What a correction leaves is what its loss is of.
    if axes.all.iter().any(|axis| axis.held.is_some()) {
        let losses = |node: &&PlannedNode| matches!(node.kind.duty(), Duty::Loss { .. });
        plan.nodes
            .iter()
            .filter(losses)
            .for_each(|of| axes.loses(of));
    }
    axes.declared(settings);
    axes.all
}

struct Axes<'a> {
    plan: &'a Plan,
    all: Vec<Axis>,
}

impl Axes<'_> {
    /// The axis of a name.
    fn axis(&mut self, name: &str) -> &mut Axis {
        let known = self.all.iter().position(|axis| axis.name == name);
        let place = known.unwrap_or_else(|| {
            self.all.push(Axis {
                name: name.to_owned(),
                ..Axis::default()
            });
            self.all.len() - 1
        });
        &mut self.all[place]
    }

    /// The axis that a channel is of.
    fn of_slot(&mut self, slot: usize) -> &mut Axis {
        let plan = self.plan;
        let name = &plan.channels[slot].name;
        match member(name) {
            "" => self.axis(name.split(':').next().unwrap_or(name)),
            member => self.axis(member),
        }
    }

    /// An output of a slot, or the channel.
    fn shown(&self, slot: usize) -> Shown {
        let output = self.plan.outputs.iter().position(|of| of.slot == slot);
        output.map_or(Shown::Channel(slot), Shown::Output)
    }

    fn predictions(&mut self) {
        let plan = self.plan;
        let outputs = plan.outputs.iter().enumerate();
        let predicts = |slot: usize| Some((plan.channels[slot].predicts?, slot));
        let mut all: Vec<_> = outputs
            .filter_map(|(nth, of)| Some((predicts(of.slot)?, Shown::Output(nth))))
            .collect();
        // What is predicted for now comes first.
        all.sort_by_key(|((_, slot), _)| plan.channels[*slot].channel.ahead);
        for ((truth, slot), shown) in all {
            let beside = self.beside(slot);
            let measured = self.shown(truth);
            let axis = self.of_slot(truth);
            axis.drift.get_or_insert(shown);
            axis.show("measured", measured);
            axis.show("predicted", shown);
            beside
                .into_iter()
                .for_each(|(what, of)| axis.show(what, of));
        }
        let names: Vec<_> = plan.outputs.iter().map(|of| of.name.clone()).collect();
        let place = |axis: &Axis| {
            let of = |name: &String| member(name) == axis.name;
            names.iter().position(of)
        };
        self.all
            .sort_by_key(|axis| place(axis).unwrap_or(usize::MAX));
    }

    /// What stands beside a prediction: both ends of its interval, its deviation, its novelty, the weights of its voters.
    fn beside(&self, slot: usize) -> Vec<(&'static str, Shown)> {
        let plan = self.plan;
        let Some(node) = plan.channels[slot].node else {
            return Vec::new();
        };
        let node = &plan.nodes[node];
        let nth = slot - node.slots.start;
        let ports = ["lower", "upper", "std_dev", "novelty", "weights"];
        let of = |port: &'static str| {
            let slots = node.port(port)?;
            let all = match port {
                "weights" => slots,
                _ => slots.clone().nth(nth).map(|of| of..of + 1)?,
            };
            Some(all.map(move |slot| (port, slot)))
        };
        let slots = ports.into_iter().filter_map(of).flatten();
        slots.map(|(port, slot)| (port, self.shown(slot))).collect()
    }

    /// The first input of a node and its first output, pairwise.
    fn pairs(&self, node: &PlannedNode) -> Vec<(usize, usize)> {
        let first = node.role.inputs().next();
        let entries = first.map_or(&[][..], |gather| &self.plan.gathers[gather].entries);
        let outputs = node.ports.first().map_or(0..0, |(_, slots)| slots.clone());
        let read = entries.iter().map(|of| of.slot);
        read.zip(outputs).collect()
    }

    fn grades(&mut self, node: &PlannedNode) {
        for (drift, state) in self.pairs(node) {
            let (state, shown) = (self.shown(state), self.shown(drift));
            let axis = self.of_slot(drift);
            axis.stable = Some((state, false));
            axis.drift = Some(shown);
            axis.show("measured", shown);
        }
    }

    fn corrects(&mut self, node: &PlannedNode) {
        let why = node.ports.get(1).map_or(0..0, |(_, slots)| slots.clone());
        for ((rate, correction), why) in self.pairs(node).into_iter().zip(why) {
            let (correction, why) = (self.shown(correction), self.shown(why));
            let axis = self.of_slot(rate);
            axis.held = Some((why, node.kind));
            axis.show("correction", correction);
            axis.show("why", why);
        }
    }

    fn loses(&mut self, node: &PlannedNode) {
        let first = node.role.inputs().next();
        let entries = first.map_or(&[][..], |gather| &self.plan.gathers[gather].entries);
        for slot in entries.iter().map(|of| of.slot) {
            let shown = self.shown(slot);
            let axis = self.of_slot(slot);
            if axis.drift != Some(shown) {
                axis.left = Some(shown);
                axis.show("left", shown);
            }
        }
    }

    fn declared(&mut self, settings: &Page) {
        for (key, name) in settings.named() {
            for (member, shown) in Shown::all_named(self.plan, name) {
                let axis = match &*member {
                    "" => self.axis(name),
                    member => self.axis(member),
                };
                match key {
                    "drift" => {
                        axis.drift = Some(shown);
                        axis.show("measured", shown);
                    }
                    "left" => {
                        axis.left = Some(shown);
                        axis.show("left", shown);
                    }
                    "stable" => axis.stable = Some((shown, true)),
                    _ => axis.may_measure = Some(shown),
                }
            }
        }
    }
}
