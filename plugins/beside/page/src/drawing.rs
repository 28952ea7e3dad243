//! The graph as boxes and arrows, with their places.

use athermal_analysis::drawing::{Class, Flow, diagram, svg};
use athermal_core::compile::Plan;
use athermal_http::{Asked, Refused, Reply};
use athermal_serve::service::Service;
use schemars::JsonSchema;
use serde::Serialize;

/// The graph that runs, as a picture of it shows it.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Drawn {
    /// The revision of the graph.
    revision: String,
    /// Width and height.
    size: [f64; 2],
    /// Signals, nodes and outputs.
    boxes: Vec<DrawnBox>,
    /// What flows from one to another.
    arrows: Vec<DrawnArrow>,
}

/// A signal, a node with all of its instances, or an output with all of its columns.
#[derive(Debug, Serialize, JsonSchema)]
struct DrawnBox {
    /// Its name.
    name: String,
    /// What it is: `signal`, `feature`, `estimator`, `combiner` or `output`.
    class: &'static str,
    /// The kind of a node.
    kind: Option<&'static str>,
    /// Left, top, width and height.
    place: [f64; 4],
    /// The text in it, line by line.
    lines: Vec<String>,
    /// The instances of a node.
    nodes: Vec<String>,
    /// What it gives, by the names that streams and histories know.
    channels: Vec<String>,
}

/// From one box to another.
#[derive(Debug, Serialize, JsonSchema)]
struct DrawnArrow {
    /// The number of the box it comes from.
    from: usize,
    /// The number of the box it goes to.
    to: usize,
    /// What flows: `data`, `delayed` or `truth`.
    flow: &'static str,
    /// Its way.
    points: Vec<[f64; 2]>,
}

pub(crate) fn answer(service: &mut Service, _: &Asked) -> Result<Reply, Refused> {
    let runs = service.running();
    let runs =
        runs.ok_or_else(|| Refused::not_now("ticks were missed; it is not known what runs"))?;
    Ok(Reply::json(&drawn(runs.plan, runs.revision)))
}

fn drawn(plan: &Plan, revision: &str) -> Drawn {
    let diagram = diagram(plan, false);
    let places = svg::places(&diagram);
    let boxes = diagram.boxes.iter().zip(&places.boxes);
    let arrows = diagram.arrows.iter().zip(&places.arrows);
    Drawn {
        revision: revision.to_owned(),
        size: places.size,
        boxes: boxes
            .map(|(of, place)| drawn_box(plan, of, *place))
            .collect(),
        arrows: arrows
            .map(|(of, points)| DrawnArrow {
                from: of.from,
                to: of.to,
                flow: Flow::word(of.kind),
                points: points.clone(),
            })
            .collect(),
    }
}

fn drawn_box(plan: &Plan, of: &athermal_analysis::drawing::Box, place: [f64; 4]) -> DrawnBox {
    let is_own = |name: &str| name.split('.').next() == Some(&*of.title);
    let nodes = || plan.nodes.iter().filter(|node| node.name == of.title);
    let channel = |slot: usize| plan.channels[slot].name.clone();
    let (nodes, channels): (Vec<_>, Vec<_>) = match of.class {
        Class::Signal => {
            let sources = plan.sources.iter().map(|of| of.name.clone());
            (Vec::new(), sources.filter(|name| is_own(name)).collect())
        }
        Class::Output => {
            let outputs = plan.outputs.iter().map(|of| of.name.clone());
            (Vec::new(), outputs.filter(|name| is_own(name)).collect())
        }
        Class::Feature | Class::Estimator | Class::Combiner => (
            nodes().map(|node| node.instance()).collect(),
            nodes()
                .flat_map(|node| node.slots.clone())
                .map(channel)
                .collect(),
        ),
    };
    let kind = (!nodes.is_empty()).then(|| plan.nodes.iter().find(|node| node.name == of.title));
    DrawnBox {
        name: of.title.clone(),
        class: of.class.word(),
        kind: kind.flatten().map(|node| node.kind.name),
        place,
        lines: of.lines.clone(),
        nodes,
        channels,
    }
}
