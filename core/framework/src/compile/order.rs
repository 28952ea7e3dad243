//! The order in which nodes are resolved and run. The [gate](super::gate) checks it.

use std::collections::{BTreeSet, HashMap};

use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};
use petgraph::visit::EdgeRef;

use super::instance::ReadNode;
use super::problem;
use super::reference::Reference;
use crate::diagnostic::Diagnostics;
use crate::document::GraphFile;

/// The order of nodes (positions in [`GraphFile::nodes`]), and which of them close a loop.
#[derive(Debug, Default)]
pub(crate) struct Order {
    pub(crate) nodes: Vec<usize>,
    /// Nodes that take inputs from nodes after them.
    pub(crate) closing: BTreeSet<usize>,
    /// Nodes in a loop that nothing breaks; an error has been reported.
    pub(crate) looping: BTreeSet<usize>,
}

/// Orders the nodes so that each comes after those that it reads, and in the order of the file where that leaves a choice.
pub(crate) fn order(graph: &GraphFile, read: &[ReadNode], diagnostics: &mut Diagnostics) -> Order {
    let mut edges = edges(graph);
    let mut order = Order::default();
    let mut component_of = HashMap::new();
    for (number, component) in loops(&edges).into_iter().enumerate() {
        for node in component.iter().map(|node| node.index()) {
            component_of.insert(node, number);
            if read[node].closes_loops() {
                order.closing.insert(node);
            }
        }
    }
    if !order.closing.is_empty() {
        // A node that closes a loop waits for none of the nodes in it.
        edges.retain_edges(|edges, edge| {
            edges.edge_endpoints(edge).is_none_or(|(from, to)| {
                !order.closing.contains(&to.index())
                    || component_of.get(&from.index()) != component_of.get(&to.index())
            })
        });
    }
    for component in loops(&edges) {
        order.looping.extend(component.iter().map(|n| n.index()));
        // Whether one of them closes the loop is not known of a node with mistakes.
        if !component.iter().all(|node| read[node.index()].is_known()) {
            continue;
        }
        let path = path(&edges, &component);
        let names = path
            .iter()
            .chain(&path[..1])
            .map(|&node| graph.nodes[node].name.clone())
            .collect();
        diagnostics.report(graph.nodes[path[0]].place, problem::Cycle { path: names });
    }
    order.nodes = sorted(&edges, &order.looping);
    order
}

/// An edge from each node to those that read it.
fn edges(graph: &GraphFile) -> DiGraph<(), ()> {
    let position: HashMap<&str, usize> = graph
        .nodes
        .iter()
        .enumerate()
        .map(|(position, node)| (node.name.as_str(), position))
        .collect();
    let mut edges = DiGraph::with_capacity(graph.nodes.len(), graph.nodes.len());
    for _ in &graph.nodes {
        edges.add_node(());
    }
    for (to, node) in graph.nodes.iter().enumerate() {
        let mut from = BTreeSet::new();
        for input in node.instances.iter().flat_map(|instance| &instance.inputs) {
            let heads = input
                .references
                .iter()
                .map(|(text, _)| Reference::parse(text).whole_node());
            from.extend(heads.filter_map(|head| position.get(&*head).copied()));
        }
        for from in from {
            edges.add_edge(NodeIndex::new(from), NodeIndex::new(to), ());
        }
    }
    edges
}

fn loops(edges: &DiGraph<(), ()>) -> Vec<Vec<NodeIndex>> {
    let mut loops: Vec<_> = tarjan_scc(edges)
        .into_iter()
        .filter(|component| component.len() > 1 || edges.contains_edge(component[0], component[0]))
        .collect();
    for component in &mut loops {
        component.sort();
    }
    loops.sort();
    loops
}

/// A shortest loop through the first node of a component.
fn path(edges: &DiGraph<(), ()>, component: &[NodeIndex]) -> Vec<usize> {
    let start = component[0];
    let mut came_from = HashMap::new();
    let mut queue = std::collections::VecDeque::from([start]);
    while let Some(node) = queue.pop_front() {
        let mut next: Vec<_> = edges.neighbors(node).collect();
        next.sort();
        for next in next {
            if next == start {
                let mut path = vec![node.index()];
                let mut at = node;
                while let Some(&before) = came_from.get(&at) {
                    let before: NodeIndex = before;
                    path.push(before.index());
                    at = before;
                }
                path.reverse();
                return path;
            }
            if component.binary_search(&next).is_ok() && !came_from.contains_key(&next) {
                came_from.insert(next, node);
                queue.push_back(next);
            }
        }
    }
    vec![start.index()]
}

/// Kahn's algorithm (1962), taking the first of the file among those that are ready.
fn sorted(edges: &DiGraph<(), ()>, looping: &BTreeSet<usize>) -> Vec<usize> {
    let mut waiting: Vec<usize> = edges
        .node_indices()
        .map(|node| {
            edges
                .edges_directed(node, petgraph::Direction::Incoming)
                .filter(|edge| !looping.contains(&edge.source().index()))
                .count()
        })
        .collect();
    let mut ready: BTreeSet<usize> = (0..waiting.len())
        .filter(|&node| waiting[node] == 0 && !looping.contains(&node))
        .collect();
    let mut sorted = Vec::with_capacity(waiting.len());
    while let Some(node) = ready.pop_first() {
        sorted.push(node);
        for next in edges.neighbors(NodeIndex::new(node)) {
            waiting[next.index()] -= 1;
            if waiting[next.index()] == 0 && !looping.contains(&next.index()) {
                ready.insert(next.index());
            }
        }
    }
    sorted
}
