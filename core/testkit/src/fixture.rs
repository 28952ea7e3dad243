//! Decides the graph around a node under test: its signals, the node, and outputs for all of its ports.

use std::ops::Range;
use std::sync::Arc;

use super::case::Given;
use crate::compile::{Plan, PlannedRole, Wanted, compile};
use crate::diagnostic::{Diagnostics, Sources};
use crate::document::{GraphFile, Memory, declare, load_text};
use crate::engine::{Engine, Fitted};
use crate::node::{Kind, Role};

/// The name of the node in its graph.
pub(super) const NODE: &str = "node";

/// A node in a graph of its own, compiled.
#[derive(Debug)]
pub(super) struct Fixture {
    pub(super) graph: GraphFile,
    pub(super) plan: Arc<Plan>,
}

impl Fixture {
    /// The graph of a node with these parameters.
    ///
    /// # Errors
    /// All that is wrong with it, as a user would read it.
    pub(super) fn new(
        kind: &Kind,
        parameters: &toml::Table,
        given: &[Given],
    ) -> Result<Self, String> {
        let ports = Self::reading(kind, parameters, given, &[])?.ports();
        Self::reading(kind, parameters, given, &ports)
    }

    /// The same, where beside the default port only these are read.
    ///
    /// # Errors
    /// As for [`Fixture::new`].
    pub(super) fn reading(
        kind: &Kind,
        parameters: &toml::Table,
        given: &[Given],
        ports: &[String],
    ) -> Result<Self, String> {
        compiled(&graph(kind, parameters, given, ports))
    }

    /// An engine for it, cold.
    pub(super) fn engine(&self, fitted: &Fitted) -> Engine {
        Engine::new(Arc::clone(&self.plan), fitted).expect("what was fitted belongs to this graph")
    }

    /// The slots of the node.
    pub(super) fn slots(&self) -> Range<usize> {
        self.plan.sources.len()..self.plan.channels.len()
    }

    /// The name of the output port that a slot belongs to.
    pub(super) fn port(&self, slot: usize) -> &str {
        match port(&self.plan.channels[slot].name) {
            "" => self.default_port(),
            name => name,
        }
    }

    pub(super) fn default_port(&self) -> &'static str {
        let node = &self.plan.nodes[0];
        match (node.spec.role(), &node.role) {
            (Role::Feature(feature), PlannedRole::Feature { inputs, .. }) => feature
                .outputs(inputs)
                .ok()
                .and_then(|ports| ports.first().map(|port| port.name))
                .unwrap_or_default(),
            _ => "prediction",
        }
    }

    /// All output ports but the default one.
    pub(super) fn ports(&self) -> Vec<String> {
        let mut ports: Vec<String> = self
            .slots()
            .map(|slot| port(&self.plan.channels[slot].name).to_owned())
            .collect();
        ports.dedup();
        ports.retain(|port| !port.is_empty());
        ports
    }
}

/// The port in a channel's name: `why` of `node:why.a`.
fn port(name: &str) -> &str {
    match name.split_once(':') {
        Some((_, rest)) => rest.split('.').next().unwrap_or(rest),
        None => "",
    }
}

/// Names for so many channels: `a`, `b` ….
pub(super) fn channel(number: usize) -> String {
    let letter = char::from(b'a' + (number % 26) as u8);
    match number / 26 {
        0 => letter.to_string(),
        round => format!("{letter}{round}"),
    }
}

fn graph(kind: &Kind, parameters: &toml::Table, given: &[Given], ports: &[String]) -> String {
    let text = |text: &str| toml::Value::String(text.to_owned());
    let (mut signals, mut inputs) = (toml::Table::new(), toml::Table::new());
    for input in given {
        let mut signal = toml::Table::new();
        let channels = (0..input.channels).map(|number| text(&channel(number)));
        signal.insert("unit".to_owned(), text(&input.unit));
        signal.insert(
            "channels".to_owned(),
            toml::Value::Array(channels.collect()),
        );
        signal.insert("max_age".to_owned(), text(&input.max_age.to_string()));
        signals.insert(input.port.clone(), toml::Value::Table(signal));
        inputs.insert(input.port.clone(), text(&input.port));
    }
    let mut node = toml::Table::new();
    node.insert("type".to_owned(), text(kind.name));
    node.insert("inputs".to_owned(), toml::Value::Table(inputs));
    node.extend(parameters.clone());
    let mut outputs = toml::Table::new();
    outputs.insert("out".to_owned(), text(NODE));
    for port in ports {
        outputs.insert(port.clone(), text(&format!("{NODE}:{port}")));
    }
    let mut nodes = toml::Table::new();
    nodes.insert(NODE.to_owned(), toml::Value::Table(node));
    let mut graph = toml::Table::new();
    graph.insert("schema".to_owned(), toml::Value::Integer(1));
    graph.insert("signals".to_owned(), toml::Value::Table(signals));
    graph.insert("nodes".to_owned(), toml::Value::Table(nodes));
    graph.insert("outputs".to_owned(), toml::Value::Table(outputs));
    toml::to_string(&graph).expect("a table of tables, texts and numbers can be written as TOML")
}

fn compiled(text: &str) -> Result<Fixture, String> {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let graph = load_text(
        "graph.toml",
        text,
        &Memory::new(),
        &mut sources,
        &mut diagnostics,
    )
    .and_then(|document| declare(document, &mut diagnostics));
    let plan = graph
        .as_ref()
        .and_then(|graph| compile(graph, Wanted::default(), &mut diagnostics));
    match (graph, plan) {
        (Some(graph), Some(plan)) => Ok(Fixture {
            graph,
            plan: Arc::new(plan),
        }),
        _ => Err(diagnostics.render(&sources, false, 120)),
    }
}
