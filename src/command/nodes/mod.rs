//! `athermal nodes`: lists the node types of this program, or explains one.

mod connectors;
mod parameters;
mod settings;

use athermal::core::node::{
    FREEZE, Kind, Learns, NodeKind, PredictorForm, Read, Role, RoleName, StateForm,
};
use athermal::core::registry::{NotFound, Registered, Sort, Why, all, find};
use athermal_serve::connector::{SinkKind, SourceKind};
use clap::Args;
use serde_json::{Value, json};

use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::{page, paragraph};
use settings::settings;

/// List the node types and the kinds of sources and sinks, or explain one
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  athermal nodes\n  athermal nodes slope\n  athermal nodes csv")]
pub struct Nodes {
    /// The type or kind to explain
    name: Option<String>,
}

impl Nodes {
    /// Lists or explains.
    ///
    /// # Errors
    /// When there is no type of the name.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        match &self.name {
            None => list(terminal),
            Some(name) => match find::<NodeKind>(name) {
                Ok(kind) => explain(terminal, kind),
                Err(_) if connectors::explain(terminal, name) => {}
                Err(why) => return Err(unknown(why)),
            },
        }
        Ok(Answer::Fine)
    }
}

/// Of what has a name that no node type has: it may be meant as one of a source or sink.
fn unknown(why: NotFound) -> Failure {
    let name = &why.name;
    let others = [find::<SourceKind>(name).err(), find::<SinkKind>(name).err()];
    let is_better = |of: &NotFound| !matches!(of.why, Why::Unknown { nearest: None, .. });
    let better = [Some(why.clone()), others[0].clone(), others[1].clone()];
    let better = better.into_iter().flatten().find(is_better);
    let help = better.map_or_else(String::new, |of| format!(", {}", of.help()));
    Failure::Request(format!(
        "there is no node type, source or sink `{name}`{help} (`athermal nodes` lists them all)"
    ))
}

fn list(terminal: &Terminal) {
    if terminal.format == Format::Json {
        let nodes: Vec<Value> = all::<NodeKind>().map(describe).collect();
        let written = [
            written::<StateForm>("state"),
            written::<PredictorForm>("predictor"),
        ];
        println!(
            "{:#}",
            json!({
                "nodes": nodes,
                "sources": connectors::describe_all::<SourceKind>(),
                "sinks": connectors::describe_all::<SinkKind>(),
                "written": written.concat(),
            })
        );
        return;
    }
    let group = |kind: &Kind| (kind.role, kind.package, kind.version);
    let mut groups: Vec<_> = all::<NodeKind>().map(group).collect();
    groups.sort();
    groups.dedup();
    for of in groups {
        let (role, package, version) = of;
        println!("{role}s, from {package} {version}");
        for kind in all::<NodeKind>().filter(|kind| group(kind) == of) {
            let name = format!("  {:<18} ", kind.name);
            print!("{}", paragraph(&name, name.len(), &kind.summary()));
        }
    }
    connectors::list();
}

/// The names under which something is written into snapshots or models.
fn written<T: Sort>(role: &str) -> Vec<Value> {
    let name = |of: &Registered<T>| json!({ "role": role, "name": of.name, "package": of.package, "version": of.version });
    all::<T>().map(name).collect()
}

fn explain(terminal: &Terminal, kind: &Kind) {
    if terminal.format == Format::Json {
        println!("{:#}", describe(kind));
        return;
    }
    println!(
        "{} ({}, from {} {})\n",
        kind.name, kind.role, kind.package, kind.version
    );
    println!("{}", page(kind.documentation()));
    println!("Inputs:");
    for port in (kind.inputs)() {
        let read = match port.read {
            Read::Fresh => "new values only",
            Read::Held => "the last value, up to its maximum age",
            Read::Truth => "paired with predictions",
        };
        let optional = match port.optional {
            true => ", may be left out",
            false => "",
        };
        let unit = port.unit.map(|unit| format!(", in {unit}"));
        let unit = unit.unwrap_or_default();
        let name = format!("  inputs.{:<10} ", port.name);
        let what = format!("{} ({read}{unit}{optional})", port.summary);
        print!("{}", paragraph(&name, 6, &what));
    }
    let outputs = outputs(kind);
    if !outputs.is_empty() {
        println!("\nOutput ports, the first where none is named:");
    }
    for (port, what) in &outputs {
        let name = format!("  {port:<17} ");
        print!("{}", paragraph(&name, 6, what));
    }
    let schema = (kind.schema)();
    println!("\nParameters:");
    if kind.framework_keys().contains(&"ahead") {
        let truth = match kind.role {
            RoleName::Feature => "that it is fitted on is measured",
            RoleName::Estimator | RoleName::Combiner => "is predicted",
        };
        let line = |what: &str| print!("{}", paragraph("  ", 6, what));
        line(&format!(
            "ahead (duration) – how far ahead of now the truth {truth}; required"
        ));
        line(
            "train.abs_truth (table) – `{ below = \"…\", above = \"…\" }`: the truths that are fitted on",
        );
        if outputs.iter().any(|(port, _)| *port == "novelty") {
            line(
                "outside (\"shrink\", \"absent\" or \"pass\") – what becomes of predictions where `novelty` is above 1: their distance from \
                 the middle of the fit is divided by it, which is the default, there are none, or they stay, which is the default with \
                 `learn`",
            );
        }
        if (kind.inputs)().iter().any(|port| port.name == FREEZE) {
            line(
                "learn (true, false or table) – whether it goes on learning while it runs; `{ outliers = 6.0, margin = 1.0 }`: not from \
                 truths that miss by more than so many times the recent error (both in units of `std_dev` where the kind has it), \
                 nor so many widths outside the range of the fit, for kinds that keep one; not as of `armax`",
            );
        }
    }
    let explained = parameters::explain(schema);
    print!("{explained}");
    if explained.is_empty() && kind.framework_keys().is_empty() {
        println!("  none");
    }
}

/// The output ports that nodes of a kind may have, each with its meaning.
fn outputs(kind: &Kind) -> Vec<(&'static str, String)> {
    let settings = settings(kind);
    let specs: Vec<Role<'_>> = settings.iter().map(|spec| spec.role()).collect();
    let port = |name, what: &str, has: fn(&Role<'_>) -> bool| {
        let with = specs.iter().filter(|spec| has(spec)).count();
        // Where no setting can be made up, they may be there.
        let (any, all) = (with > 0 || specs.is_empty(), with == specs.len());
        let when = if all && !specs.is_empty() {
            ""
        } else {
            " (not with all parameters)"
        };
        any.then(|| (name, format!("{what}{when}")))
    };
    let prediction = (
        "prediction",
        "what the truth will be, in its unit".to_owned(),
    );
    match kind.role {
        RoleName::Feature => {
            let ports = (kind.ports)().iter();
            let ports = ports.map(|port| (port.name, port.summary.to_owned()));
            ports.collect()
        }
        RoleName::Estimator => {
            let ports = [
                Some(prediction),
                port(
                    "learning",
                    "with `learn`: what became of the newest truth. 0 learned, 1 frozen on command, 2 frozen by a channel, 3 an \
                     outlier, 4 outside the range of the fit. 5 is outside `train.abs_truth`, 6 a missing regressor",
                    |spec| matches!(spec, Role::Estimator(of) if !matches!(of.learns(), Learns::Never { .. })),
                ),
                port(
                    "std_dev",
                    "the standard deviation of the truth about the prediction",
                    |spec| matches!(spec, Role::Estimator(of) if of.has_std_dev()),
                ),
                port(
                    "novelty",
                    "how far its regressors are outside of those of the fit, 1 at the edge",
                    |spec| matches!(spec, Role::Estimator(of) if of.has_novelty()),
                ),
            ];
            ports.into_iter().flatten().collect()
        }
        RoleName::Combiner => {
            let weighs = |spec: &Role<'_>| matches!(spec, Role::Combiner(of) if of.has_weights());
            let covers =
                |spec: &Role<'_>| matches!(spec, Role::Combiner(of) if of.coverage().is_some());
            let ports = [
                Some(prediction),
                port("weights", "the weight of each voter, by its name", weighs),
                port(
                    "reason",
                    "the number of its reason, as listed above",
                    |spec| matches!(spec, Role::Combiner(of) if of.has_reason()),
                ),
                port("lower", "where the interval begins", covers),
                port("upper", "where it ends", covers),
                port(
                    "std_dev",
                    "where all voters have one: that of the truth about the prediction",
                    weighs,
                ),
                port(
                    "novelty",
                    "where voters have one: its mean by their weights",
                    weighs,
                ),
            ];
            ports.into_iter().flatten().collect()
        }
    }
}

fn describe(kind: &Kind) -> Value {
    let inputs = (kind.inputs)().iter().map(|port| {
        let read = match port.read {
            Read::Fresh => "fresh",
            Read::Held => "held",
            Read::Truth => "truth",
        };
        json!({ "name": port.name, "summary": port.summary, "read": read, "unit": port.unit, "optional": port.optional })
    });
    let outputs = outputs(kind).into_iter();
    let outputs = outputs.map(|(name, summary)| json!({ "name": name, "summary": summary }));
    json!({
        "name": kind.name,
        "role": kind.role,
        "summary": kind.summary(),
        "package": kind.package,
        "version": kind.version,
        "inputs": inputs.collect::<Vec<_>>(),
        "outputs": outputs.collect::<Vec<_>>(),
        "parameters": (kind.schema)(),
    })
}
