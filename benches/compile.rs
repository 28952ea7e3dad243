//! How long a graph takes from text to plan, and that it grows linearly with the number of nodes.

#![allow(clippy::unwrap_used)]

use std::fmt::Write;

use athermal as _;
use athermal::core::compile::{Plan, Wanted, compile};
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{Memory, declare, load_text};

fn main() {
    divan::main();
}

fn plan(text: &str) -> Plan {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let files = Memory::new();
    let document = load_text("graph.toml", text, &files, &mut sources, &mut diagnostics);
    let graph = document.and_then(|document| declare(document, &mut diagnostics));
    let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    plan.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 100)))
}

const HEAD: &str = "schema = 1\n[signals.temperature]\nunit = \"Cel\"\nchannels = [\"a\", \"b\", \"c\", \"d\"]\nmax_age = \"1min\"\n";

/// Every node written out: a slope of a position, two estimators and a vote for each axis.
fn written(nodes: usize) -> String {
    let mut text = HEAD.to_owned();
    let axes = nodes / 4;
    let names: Vec<_> = (0..axes).map(|axis| format!("\"p{axis}\"")).collect();
    let _ = writeln!(
        text,
        "[signals.position]\nunit = \"nm\"\nmax_age = \"3min\"\nchannels = [{}]",
        names.join(", ")
    );
    for axis in 0..axes {
        let _ = write!(
            text,
            "[nodes.drift{axis}]\ntype = \"slope\"\ninputs.signal = \"position.p{axis}\"\nwindows = [\"5min\"]\n\
             [nodes.thermal{axis}]\ntype = \"linear\"\ninputs.features = \"temperature\"\ninputs.truth = \"drift{axis}\"\nahead = \"5min\"\n\
             [nodes.motion{axis}]\ntype = \"ar\"\ninputs.truth = \"drift{axis}\"\nahead = \"5min\"\nlags = [\"0s\", \"5min\"]\n\
             [nodes.vote{axis}]\ntype = \"auto_weighted\"\ninputs.voters = [\"thermal{axis}\", \"motion{axis}\"]\ninputs.truth = \"drift{axis}\"\nmemory = \"15min\"\n"
        );
    }
    text.push_str("[outputs]\n");
    for axis in 0..axes {
        let _ = writeln!(text, "v{axis} = \"vote{axis}\"");
    }
    text
}

/// The same by `each`, alone or inside a module.
fn expanded(nodes: usize, module: bool) -> String {
    let members: Vec<_> = (0..nodes / 4).map(|axis| format!("\"p{axis}\"")).collect();
    let body = |signal: &str, features: &str, axis: &str, each: &str| {
        format!(
            "drift = {{ type = \"slope\", {each}inputs.signal = \"{signal}\", windows = [\"5min\"] }}\n\
             thermal = {{ type = \"linear\", {each}inputs.features = \"{features}\", inputs.truth = \"drift{axis}\", ahead = \"5min\" }}\n\
             motion = {{ type = \"ar\", {each}inputs.truth = \"drift{axis}\", ahead = \"5min\", lags = [\"0s\", \"5min\"] }}\n\
             vote = {{ type = \"auto_weighted\", {each}inputs.voters = [\"thermal{axis}\", \"motion{axis}\"], inputs.truth = \"drift{axis}\", memory = \"15min\" }}\n"
        )
    };
    let nodes = if module {
        let body = body("{signal}", "{features}", "", "");
        format!(
            "[modules.m]\ninputs = [\"signal\", \"features\"]\noutputs.vote = \"vote\"\n[modules.m.nodes]\n{body}[nodes.vote]\nmodule = \"m\"\neach = \"axis\"\n\
             inputs.signal = \"position.{{axis}}\"\ninputs.features = \"temperature\"\n"
        )
    } else {
        let body = body(
            "position.{axis}",
            "temperature",
            ".{axis}",
            "each = \"axis\", ",
        );
        format!("[nodes]\n{body}")
    };
    format!(
        "{HEAD}[sets]\naxis = [{}]\n[signals.position]\nunit = \"nm\"\nmax_age = \"3min\"\nchannels = \"axis\"\n{nodes}[outputs]\nv = \"vote\"\n",
        members.join(", ")
    )
}

#[divan::bench(args = [1_000, 10_000, 40_000])]
fn from_text(bencher: divan::Bencher, nodes: usize) {
    let text = written(nodes);
    bencher.bench(|| plan(&text).nodes.len());
}

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn from_each(bencher: divan::Bencher, nodes: usize) {
    let text = expanded(nodes, false);
    bencher.bench(|| plan(&text).nodes.len());
}

#[divan::bench(args = [1_000, 10_000, 100_000])]
fn from_a_module(bencher: divan::Bencher, nodes: usize) {
    let text = expanded(nodes, true);
    bencher.bench(|| plan(&text).nodes.len());
}
