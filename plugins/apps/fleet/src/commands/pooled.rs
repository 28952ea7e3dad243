//! `athermal fleet fit --pooled`: what the machines of a fleet have in common, as a prior for new ones.

use athermal_core::watch::Watch;
use std::collections::BTreeMap;
use std::path::Path;

use athermal_analysis::figures::{counted, number};
use athermal_command::{Answer, Failure, Format, Terminal, print, println};
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::time::Duration;
use athermal_estimators::{PoolErrors, PoolFit, Pooling};
use athermal_files::Dataset;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::live::store::write_whole;
use athermal_run::model::Model;
use serde_json::json;

use super::{few, warn_failed};
use crate::found::Machines;
use crate::unlike::other_units;
use athermal_jobs::data::Reading;

/// What is pooled, and from where to where.
pub(super) struct Pooled<'a> {
    pub graph: &'a Path,
    pub machines: &'a Machines,
    pub reading: &'a Reading,
    pub output: &'a Path,
    /// How long the data of a new machine are thought to be.
    pub stretch: Duration,
    /// How many bytes of rows a fit may keep.
    pub memory: usize,
    /// How many estimators are fitted at a time.
    pub threads: usize,
}

impl Pooled<'_> {
    /// Fits each machine, pools and writes.
    ///
    /// # Errors
    /// When the graph has mistakes or nothing that can be pooled, too few machines could be fitted, or the prior cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        if self.stretch <= Duration::ZERO {
            return Err(Failure::Request(format!(
                "--stretch {}: the data of a new machine are longer than that, such as 2h",
                self.stretch
            )));
        }
        let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
        let graph = Model::load_to_fit(self.graph, Wanted::default(), &mut sources, &mut doubts)?;
        terminal.doubts(&doubts, &sources);
        let mut pooling = Pooling::new(self.machines.len(), self.stretch);
        let options = FitOptions {
            memory: self.memory,
            threads: self.threads,
            ..FitOptions::default()
        };
        let mut progress = terminal.begin("pooling", Some(self.machines.len() as u64));
        let (mut failed, mut ranges) = (BTreeMap::new(), BTreeMap::new());
        for (nth, (machine, files)) in self.machines.iter().enumerate() {
            let Some(watch) = pooling.watched(&graph.plan) else {
                return Err(Failure::Request(format!(
                    "{}: nothing can be pooled: none of its nodes is a `linear`, `ar` or `arx` with the solver `ridge`",
                    self.graph.display()
                )));
            };
            let dataset = Dataset::new(files.clone(), self.reading.options(files));
            match fit(&watch.plan, &dataset, &options, &mut |_| {}) {
                Ok((_, report)) => {
                    ranges.insert(machine.clone(), report.ranges);
                    pooling.add(machine, watch);
                }
                Err(error) => _ = failed.insert(machine.clone(), error.to_string()),
            }
            progress.set(nth as u64 + 1);
        }
        drop(progress);
        for (machine, why) in other_units(&ranges) {
            pooling.leave_out(&machine);
            failed.insert(machine, why);
        }
        warn_failed(terminal, &failed);
        let (prior, fits) = pooling.finish();
        if prior.estimators().is_empty() {
            let first = fits.iter().find_map(|of| of.outcome.as_ref().err());
            let why = first.map_or("no machine could be fitted".to_owned(), ToString::to_string);
            return Err(Failure::Request(format!(
                "nothing was pooled: {why}; a prior needs {} machines or more",
                athermal_estimators::Watch::fewest_machines()
            )));
        }
        let text = serde_json::to_string(&prior);
        let text = text.map_err(|error| Failure::Outside(error.to_string()))? + "\n";
        write_whole(self.output, text.as_bytes()).map_err(|error| {
            Failure::Outside(format!("cannot write {}: {error}", self.output.display()))
        })?;
        self.report(&fits, failed.len(), terminal);
        let poor = fits.iter().any(|of| of.outcome.is_err());
        Ok(if poor || !failed.is_empty() {
            Answer::No
        } else {
            Answer::Fine
        })
    }

    fn report(&self, fits: &[PoolFit], failed: usize, terminal: &Terminal) {
        if terminal.format == Format::Json {
            let of_fits = fits.iter().map(|of| {
                let errors = of.outcome.as_ref().ok();
                json!({
                    "node": of.instance,
                    "machines": of.machines,
                    "left_out": of.left_out,
                    "unit": of.unit,
                    "error": of.outcome.as_ref().err().map(ToString::to_string),
                    "rmse_with_prior": errors.map(|of| of.with_prior),
                    "rmse_of_mean": errors.map(|of| of.of_mean),
                    "rmse_without": errors.map(|of| of.without),
                    "penalty": errors.map(|of| of.penalty),
                    "penalty_at_edge": errors.map(|of| of.at_edge),
                })
            });
            println!(
                "{:#}",
                json!({
                    "prior": self.output,
                    "graph": self.graph,
                    "stretch": self.stretch,
                    "failed": failed,
                    "estimators": of_fits.collect::<Vec<_>>(),
                })
            );
            return;
        }
        if !terminal.quiet {
            print!("{}", table(fits, self.stretch));
        }
        for of in fits.iter().filter(|_| terminal.quiet) {
            if let Err(error) = &of.outcome {
                terminal.warning(format_args!("{} could not be pooled: {error}", of.instance));
            }
        }
        for of in fits.iter().filter(|of| !of.left_out.is_empty()) {
            terminal.warning(format_args!(
                "{}: without {}, which lack regressors that the others have",
                of.instance,
                few(&of.left_out)
            ));
        }
        terminal.note(format_args!(
            "wrote {}: {} of {}",
            self.output.display(),
            counted(
                fits.iter().filter(|of| of.outcome.is_ok()).count() as u64,
                "estimator"
            ),
            counted(self.machines.len() as u64, "machine")
        ));
    }
}

/// Of each estimator the errors on a machine's other rows of a fit to one stretch of them.
fn table(fits: &[PoolFit], stretch: Duration) -> String {
    let width = fits
        .iter()
        .map(|of| of.instance.len())
        .max()
        .unwrap_or(0)
        .max(9);
    let mut text = format!(
        "error after {stretch} of own data, over machines that were left out\n{:width$} {:>8} {:>10} {:>10} {:>10}\n",
        "estimator", "machines", "with prior", "its mean", "without"
    );
    for of in fits {
        let row = match &of.outcome {
            Ok(PoolErrors {
                with_prior,
                of_mean,
                without,
                at_edge,
                ..
            }) => {
                let remark = if *at_edge {
                    "; the penalty is at the edge of those tried"
                } else {
                    ""
                };
                let [with_prior, of_mean, without] =
                    [with_prior, of_mean, without].map(|of| number(*of));
                format!(
                    "{:>8} {with_prior:>10} {of_mean:>10} {without:>10} {}{remark}",
                    of.machines, of.unit
                )
            }
            Err(error) => format!("{:>8} could not be pooled: {error}", of.machines),
        };
        text.push_str(&format!("{:width$} {row}\n", of.instance));
    }
    text
}
