//! Pictures of a graph: boxes, what stands in them, and arrows.

pub mod dot;
mod layout;
pub mod mermaid;
pub mod plan;
pub mod svg;

pub use layout::Layout;

use std::collections::{BTreeMap, BTreeSet};

use crate::diagnosis::text::grouped;
use athermal_core::compile::{Plan, PlannedNode, PlannedRole};
use athermal_core::node::RoleName;
use athermal_core::time::Duration;
use serde::Serialize;

use crate::figures::{counted, length};

/// A graph as boxes and arrows, from what is measured to what comes out.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Diagram {
    /// The name of the graph.
    pub name: String,
    /// The boxes.
    pub boxes: Vec<Box>,
    /// The arrows.
    pub arrows: Vec<Arrow>,
}

/// A signal, a node or an output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Box {
    /// Its name.
    #[serde(rename = "name")]
    pub title: String,
    /// What it is.
    pub class: Class,
    /// The text in it, line by line.
    pub lines: Vec<String>,
}

/// What a box stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Something measured.
    Signal,
    /// Channels from channels.
    Feature,
    /// A prediction.
    Estimator,
    /// One prediction of several.
    Combiner,
    /// What comes out.
    Output,
}

impl Class {
    /// Its name among the classes of a picture.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Signal => "signal",
            Self::Feature => "feature",
            Self::Estimator => "estimator",
            Self::Combiner => "combiner",
            Self::Output => "output",
        }
    }
}

/// From one box to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Arrow {
    /// The number of the box it comes from.
    pub from: usize,
    /// The number of the box it goes to.
    pub to: usize,
    /// What travels.
    pub kind: Flow,
}

/// What travels along an arrow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Flow {
    /// Values of this tick.
    Data,
    /// Values of earlier ticks, which close a loop.
    Delayed,
    /// What is predicted, once it has been measured.
    Truth,
}

impl Flow {
    /// Its name among the classes of a picture.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Data => "data",
            Self::Delayed => "delayed",
            Self::Truth => "truth",
        }
    }
}

/// The boxes and arrows of a plan; instances of one node share a box unless `expand`.
#[must_use]
pub fn diagram(plan: &Plan, expand: bool) -> Diagram {
    let mut drawn = Drawn {
        plan,
        diagram: Diagram {
            name: plan.name.clone().unwrap_or_default(),
            ..Diagram::default()
        },
        of_slot: vec![None; plan.channels.len()],
        arrows: BTreeSet::new(),
    };
    drawn.signals();
    drawn.nodes(expand);
    drawn.outputs();
    drawn.diagram.arrows = drawn.arrows.into_iter().collect();
    drawn.diagram
}

struct Drawn<'a> {
    plan: &'a Plan,
    diagram: Diagram,
    /// The box that gives each slot its values.
    of_slot: Vec<Option<usize>>,
    arrows: BTreeSet<Arrow>,
}

impl Drawn<'_> {
    fn add(&mut self, title: &str, class: Class, lines: Vec<String>) -> usize {
        self.diagram.boxes.push(Box {
            title: title.to_owned(),
            class,
            lines,
        });
        self.diagram.boxes.len() - 1
    }

    fn signals(&mut self) {
        let sources = self.plan.sources.iter().enumerate();
        let signals = by_owner(sources.map(|(slot, source)| (&*source.name, slot)));
        for (signal, slots) in signals {
            let unit = &self.plan.channels[slots[0]].channel.unit;
            let lines = vec![format!(
                "{} in {unit}",
                counted(slots.len() as u64, "channel")
            )];
            let number = self.add(signal, Class::Signal, lines);
            for slot in slots {
                self.of_slot[slot] = Some(number);
            }
        }
    }

    fn nodes(&mut self, expand: bool) {
        let mut instances: BTreeMap<&str, usize> = BTreeMap::new();
        for node in &self.plan.nodes {
            *instances.entry(&node.name).or_default() += 1;
        }
        let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
        let title = |node: &PlannedNode| match expand {
            true => node.instance(),
            false => node.name.clone(),
        };
        for node in &self.plan.nodes {
            let several = if expand { 1 } else { instances[&*node.name] };
            let title = title(node);
            let known = numbers.get(&title).copied();
            let number = known.unwrap_or_else(|| self.node(&title, node, several));
            numbers.insert(title, number);
            for slot in node.slots.clone() {
                self.of_slot[slot] = Some(number);
            }
        }
        for node in &self.plan.nodes {
            self.arrows_to(node, numbers[&title(node)]);
        }
    }

    fn node(&mut self, title: &str, node: &PlannedNode, instances: usize) -> usize {
        let mut lines = vec![if instances > 1 {
            format!("{} × {instances}", node.kind.name)
        } else {
            node.kind.name.to_owned()
        }];
        lines.extend(self.lines_of(node));
        let class = match node.kind.role {
            RoleName::Feature => Class::Feature,
            RoleName::Estimator => Class::Estimator,
            RoleName::Combiner => Class::Combiner,
        };
        self.add(title, class, lines)
    }

    fn lines_of(&self, node: &PlannedNode) -> Vec<String> {
        let first_port = node.ports.first().map(|(_, slots)| slots.clone());
        let slots = first_port.unwrap_or_else(|| node.slots.clone());
        let channels = || slots.clone().map(|slot| &self.plan.channels[slot].channel);
        let mut lines = Vec::new();
        let unit = channels().next().map(|channel| channel.unit.to_string());
        match &node.role {
            PlannedRole::Feature { .. } => {
                let count = counted(slots.len() as u64, "channel");
                lines.push(unit.map_or(count.clone(), |unit| format!("{count} in {unit}")));
                let spans: BTreeSet<Duration> = channels().map(|channel| channel.span).collect();
                match (spans.first(), spans.last()) {
                    (Some(&first), Some(&last)) if first != last => {
                        lines.push(format!("over {} … {}", length(first), length(last)));
                    }
                    (Some(&only), _) if only > Duration::ZERO => {
                        lines.push(format!("over {}", length(only)))
                    }
                    _ => {}
                }
            }
            PlannedRole::Estimator { fit, .. } => {
                let count = counted(fit.regressors.len() as u64, "regressor");
                lines.push(format!("from {count}"));
                lines.push(format!("{} ahead", length(fit.truth.ahead)));
            }
            PlannedRole::Combiner { voters, .. } => {
                let voters = self.plan.gathers[*voters].entries.len();
                lines.push(format!("of {}", counted(voters as u64, "voter")));
                lines.extend(unit.map(|unit| format!("in {unit}")));
            }
        }
        lines
    }

    fn arrows_to(&mut self, node: &PlannedNode, to: usize) {
        let kind = match &node.role {
            PlannedRole::Feature {
                closes_loops: true, ..
            } => Flow::Delayed,
            _ => Flow::Data,
        };
        for gather in node.role.gathers() {
            for entry in &self.plan.gathers[gather].entries {
                self.arrow(entry.slot, to, kind);
            }
        }
        if let Some(truth) = node.role.truth() {
            self.arrow(truth.slot, to, Flow::Truth);
        }
    }

    fn arrow(&mut self, slot: usize, to: usize, kind: Flow) {
        if let Some(from) = self.of_slot[slot] {
            self.arrows.insert(Arrow { from, to, kind });
        }
    }

    fn outputs(&mut self) {
        let outputs = self.plan.outputs.iter();
        let groups = by_owner(outputs.map(|output| (&*output.name, output.slot)));
        for (name, slots) in groups {
            let unit = &self.plan.channels[slots[0]].channel.unit;
            let lines = vec![format!(
                "{} in {unit}",
                counted(slots.len() as u64, "column")
            )];
            let number = self.add(name, Class::Output, lines);
            for slot in slots {
                self.arrow(slot, number, Flow::Data);
            }
        }
    }
}

/// The slots of channels by what stands before the dot of their names, each in the order in which it first comes.
fn by_owner<'a>(channels: impl Iterator<Item = (&'a str, usize)>) -> Vec<(&'a str, Vec<usize>)> {
    let owned =
        channels.map(|(channel, slot)| (channel.split('.').next().unwrap_or(channel), slot));
    let groups = grouped(owned, |(owner, _)| *owner).into_iter();
    let slots = |group: Vec<(&'a str, usize)>| group.into_iter().map(|(_, slot)| slot).collect();
    groups.map(|group| (group[0].0, slots(group))).collect()
}
