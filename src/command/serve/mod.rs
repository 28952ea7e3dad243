//! `athermal serve`: a machine file as a service.

pub(super) mod events;

use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::serve::connector::LeftOut;
use athermal::serve::deployment::Deployment;
use athermal::serve::service::{Ended, Service, ServiceError, ServiceOptions};
use clap::Args;
use serde_json::json;

use super::run::stop;
use crate::message::Message;
use crate::terminal::{Answer, Failure, Terminal};
use athermal_analysis::figures::counted;
use athermal_command::findings;
use athermal_jobs::model::check_fitted;

/// Run a machine file as a service: sources in, corrections out, nothing lost
///
/// Takes what the sources of the file give, steps its graph, and hands every tick to its sinks. What was accepted is in a journal
/// before its outputs leave, so that a service that was killed goes on as if it had not been. A source or sink that fails is tried
/// again; a bad row or message is counted and left out. Ends when all sources have, or at Ctrl-C.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal serve machine.toml\n  athermal serve machine.toml --dry-run"
)]
pub struct Serve {
    /// A graph with `[sources]`, `[sinks]` and `[runtime]`, and the `model` that it names
    machine: PathBuf,
    /// Keep the state in this folder, and not where the file says or beside it
    #[arg(long, value_name = "FOLDER")]
    state: Option<PathBuf>,
    /// Do everything but send commands
    #[arg(long)]
    dry_run: bool,
    /// Let no estimator learn while it runs; votes still go by recent errors
    #[arg(long)]
    frozen: bool,
}

impl Serve {
    /// Serves until all sources have ended, or a signal comes.
    ///
    /// # Errors
    /// When the file has mistakes, or the state cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let (model, deployment) = self.load(terminal)?;
        let state = self.state.clone();
        let state = state.unwrap_or_else(|| deployment.state(&self.machine));
        let options = ServiceOptions {
            is_dry: self.dry_run,
            frozen: self.frozen,
            machine: self.machine.clone(),
            ..ServiceOptions::new(state.clone())
        };
        stop::listen_for_the_end();
        let started = Service::start(&model, deployment, &options);
        let (mut service, report) = started.map_err(refused)?;
        events::recovered(terminal, &state, &report);
        let reports = events::Events(*terminal);
        while !service.is_over() && !stop::is_stopped() {
            for event in service.pump() {
                reports.report(event);
            }
            service.wait();
        }
        let sinks = service.sinks().to_vec();
        let (ended, events) = service.stop().map_err(refused)?;
        for event in events {
            reports.report(event);
        }
        summary(terminal, &ended);
        events::sinks(terminal, &sinks);
        if ended.has_failed {
            return Err(Failure::Outside(format!(
                "the service ended early; what was accepted is in {}",
                state.display()
            )));
        }
        Ok(Answer::Fine)
    }

    fn load(&self, terminal: &Terminal) -> Result<(Model, Deployment), Failure> {
        let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
        let wanted = Wanted::default();
        let model = Model::load_from(&self.machine, wanted, &mut sources, &mut doubts)?;
        let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut doubts);
        let Some(deployment) = deployment.filter(|_| !doubts.has_errors()) else {
            return Err(Failure::Graph {
                diagnostics: Box::new(doubts),
                sources: Box::new(sources),
            });
        };
        terminal.doubts(&doubts, &sources);
        check_fitted(&model, &self.machine)?;
        athermal_jobs::model::warn_unfitted(terminal, &model, &self.machine);
        athermal_jobs::model::warn_without_novelty(terminal, &model, &self.machine);
        Ok((model, deployment))
    }
}

fn refused(error: ServiceError) -> Failure {
    match error {
        ServiceError::Source { .. } | ServiceError::Unfit(_) => Failure::Request(error.to_string()),
        other => Failure::Outside(other.to_string()),
    }
}

fn summary(terminal: &Terminal, ended: &Ended) {
    for of in &ended.channels {
        let left_out = of.left_out.iter();
        let some = left_out.filter(|(why, count)| *count > 0 && *why != LeftOut::OutOfRange);
        let words: Vec<_> = some
            .map(|(why, count)| format!("{count} {}", why.name().replace('_', " ")))
            .collect();
        if !words.is_empty() {
            terminal.warning(format_args!(
                "{}: left out {} beside {} accepted",
                of.channel,
                words.join(", "),
                counted(of.accepted, "sample")
            ));
        }
    }
    for of in &ended.channels {
        let samples = of.left_out(LeftOut::OutOfRange);
        if samples > 0 {
            terminal.warning(findings::rejected(&of.channel, samples, ended.ticks));
        }
    }
    if ended.hurried > 0 {
        terminal.warning(format_args!(
            "{} cut before `wait` was over, because too many samples waited",
            counted(ended.hurried, "tick")
        ));
    }
    if ended.journal.lost > 0 {
        terminal.warning(format_args!(
            "{} never written to the journal",
            counted(ended.journal.lost, "record")
        ));
    }
    let facts = json!({
        "ticks": ended.ticks,
        "happenings": ended.happenings,
        "records_lost": ended.journal.lost,
        "hurried": ended.hurried,
    });
    let words = format!("{} so far", counted(ended.ticks, "tick"));
    terminal.note(Message::new("ended", facts, words));
}
