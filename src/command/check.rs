//! `athermal check`: looks for mistakes in graph files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use athermal::Model;
use athermal::core::compile::{Plan, Wanted, compile_part};
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{self, Disk, GraphFile};
use athermal::core::engine::Fitted;
use athermal::trial::{self, Trial};
use athermal_serve::deployment::Deployment;
use clap::Args;
use serde::Serialize;
use serde_json::json;

use crate::terminal::{Answer, Failure, Format, Terminal, status_of};
use athermal_analysis::figures::counted;

/// How long a source may take to give one of everything.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(10);

/// Look for mistakes in a graph file
///
/// Reports all mistakes at once, each with its place and a way out. Nothing is fitted, and no data are read but with `--live`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal check graphs/die-tester.toml\n  athermal check --strict *.toml\n  athermal check --live machine.toml"
)]
pub struct Check {
    /// Graph files and machine files
    #[arg(required = true, value_name = "GRAPH", value_parser = athermal_jobs::path::graph_or_model())]
    graphs: Vec<PathBuf>,
    /// Fail on warnings too (exit status 1)
    #[arg(long)]
    strict: bool,
    /// Ask the sources of machine files for one of everything, and show it (exit status 1 where something is missing)
    #[arg(long)]
    live: bool,
}

/// What a graph without mistakes has.
#[derive(Debug, Serialize)]
struct Counts {
    file: String,
    channels: usize,
    nodes: usize,
    instances: usize,
    outputs: usize,
}

impl Counts {
    fn of(path: &Path, plan: &Plan) -> Self {
        let nodes: BTreeSet<_> = plan.nodes.iter().map(|node| &node.name).collect();
        Self {
            file: path.display().to_string(),
            channels: plan.sources.len(),
            nodes: nodes.len(),
            instances: plan.nodes.len(),
            outputs: plan.outputs.len(),
        }
    }
}

/// A graph and its plan; `None` after any mistake in them, all of which are reported with those of its tests.
fn graph_and_plan(
    path: &Path,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<(GraphFile, Plan)> {
    let graph = document::load(path, &Disk, sources, diagnostics)
        .and_then(|read| document::declare(read, diagnostics))?;
    let compiled = compile_part(&graph, Wanted::default(), diagnostics);
    let plan = compiled
        .map_err(|part| trial::mistakes(&graph, &part, &Disk, sources, diagnostics))
        .ok()?;
    Some((graph, plan))
}

/// The plan of a graph and its tests; `None` after any mistake in either, all of which are reported.
pub(super) fn plan_and_tests(
    path: &Path,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<(Plan, Vec<Trial>)> {
    let (graph, plan) = graph_and_plan(path, sources, diagnostics)?;
    let trials = trial::declare(&graph, &plan, &Disk, sources, diagnostics)?;
    Some((plan, trials))
}

/// A graph that can run: no mistake in it, in its tests, or in the model that it names.
fn machine(
    path: &Path,
    sources: &mut Sources,
    diagnostics: &mut Diagnostics,
) -> Option<(Model, Deployment)> {
    let (graph, plan) = graph_and_plan(path, sources, diagnostics)?;
    trial::declare(&graph, &plan, &Disk, sources, diagnostics);
    let deployment = Deployment::check(&graph, &plan, sources, diagnostics);
    let mut machine = Model {
        graph: Arc::new(graph),
        plan: Arc::new(plan),
        fitted: Fitted::new(),
        card: None,
    };
    machine.take_named(path, Wanted::default(), sources, diagnostics);
    Some((machine, deployment?)).filter(|_| !diagnostics.has_errors())
}

/// The number of mistakes in the tests of a graph that has no others, read from `sources`.
pub(super) fn mistakes_in_tests(model: &Model, sources: &mut Sources) -> usize {
    let mut diagnostics = Diagnostics::new();
    trial::declare(&model.graph, &model.plan, &Disk, sources, &mut diagnostics);
    diagnostics.error_count()
}

impl Check {
    /// Checks the files.
    ///
    /// # Errors
    /// When one has mistakes.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let (mut fine, mut looked, mut is_whole) = (Vec::new(), Vec::new(), true);
        for path in &self.graphs {
            let mut of_file = Diagnostics::new();
            let machine = machine(path, &mut sources, &mut of_file);
            diagnostics.extend(of_file);
            for found in machine
                .iter()
                .filter(|_| self.live)
                .flat_map(|of| of.1.look(&of.0.plan, &of.1.state(path), PATIENCE))
            {
                is_whole &= found.missing == 0;
                match terminal.format {
                    Format::Json => looked.push(found.to_json()),
                    Format::Table => print!("{found}"),
                }
            }
            fine.extend(machine.map(|(machine, _)| (path, machine.plan)));
        }
        if terminal.format == Format::Json {
            let mut facts = diagnostics.to_json(&sources);
            let graphs = fine.iter().map(|(path, plan)| Counts::of(path, plan));
            facts["graphs"] = json!(graphs.collect::<Vec<_>>());
            if self.live {
                facts["live"] = json!(looked);
            }
            println!("{facts:#}");
        } else {
            terminal.diagnostics(&diagnostics, &sources);
            for (path, plan) in fine {
                let of = Counts::of(path, &plan);
                terminal.note(format_args!(
                    "{}: {}, {} ({}), {}",
                    of.file,
                    counted(of.channels as u64, "measured channel"),
                    counted(of.nodes as u64, "node"),
                    counted(of.instances as u64, "instance"),
                    counted(of.outputs as u64, "output"),
                ));
            }
        }
        if diagnostics.has_errors() {
            Err(Failure::Exit(status_of(&diagnostics)))
        } else if self.strict && !diagnostics.is_empty() || !is_whole {
            Ok(Answer::No)
        } else {
            Ok(Answer::Fine)
        }
    }
}
