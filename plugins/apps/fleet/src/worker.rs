//! A worker: reads jobs from standard input and answers on standard output, one after the other, until there are no more.

use std::io::{self, BufRead, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use athermal_analysis::diagnosis::watch::{ChannelFaults, FaultWatch, Purpose};
use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources, panic_text};
use athermal_files::Dataset;
use athermal_run::fit::{FitOptions, Outcome};
use athermal_run::model::{Card, Model, ModelError};
use athermal_run::recording::Recording;
use athermal_run::score::{ScoreOptions, score};

use crate::blocks::{self, OnBlocks};
use crate::doubts::{of_channels, of_reading};
use crate::figure::Figure;
use crate::job::{Evaluated, Fitted, Job, Reply, Setup, Task, Unfitted, graph_hash};
use crate::machine::{MachineError, MachineFit, fit_machine};
use athermal_jobs::{RowsId, Summed};

/// Works until the input ends.
///
/// # Errors
/// When the input cannot be read, is none of jobs, or nobody reads the answers.
pub fn work(input: impl BufRead, mut output: impl Write) -> io::Result<()> {
    let mut lines = input.lines();
    let Some(setup) = lines.next() else {
        return Ok(());
    };
    let setup: Setup = serde_json::from_str(&setup?)?;
    let graph = setup.graph.as_ref().map(|_| load_graph(&setup));
    for line in lines {
        let job: Job = serde_json::from_str(&line?)?;
        let reply = catch_unwind(AssertUnwindSafe(|| match &graph {
            Some(Err(error)) => Err(error.clone()),
            Some(Ok(graph)) => done(&setup, Some(graph), &job),
            None => done(&setup, None, &job),
        }));
        let reply = reply.unwrap_or_else(|panic| Err(panic_text(&*panic)));
        let reply = reply.unwrap_or_else(|error| Reply::Failed { error });
        let line = serde_json::to_string(&reply)? + "\n";
        output.write_all(line.as_bytes())?;
        output.flush()?;
    }
    Ok(())
}

/// The words of an error of a graph or model: of mistakes as they stand beside the file.
pub(crate) fn words(error: &ModelError) -> String {
    match error {
        ModelError::Graph {
            diagnostics,
            sources,
        } => diagnostics
            .render(sources, false, 100)
            .trim_end()
            .to_owned(),
        other => other.to_string(),
    }
}

fn load_graph(setup: &Setup) -> Result<Model, String> {
    let Some((path, hash)) = &setup.graph else {
        return Err("no graph was given".to_owned());
    };
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let graph = Model::load_to_fit(path, Wanted::default(), &mut sources, &mut doubts);
    let graph = graph.map_err(|error| words(&error))?;
    match graph_hash(&graph) {
        Ok(found) if found == *hash => Ok(graph),
        Ok(_) => Err(format!(
            "{} changed while the fleet was fitted: fit once more",
            path.display()
        )),
        Err(error) => Err(error.to_string()),
    }
}

fn done(setup: &Setup, graph: Option<&Model>, job: &Job) -> Result<Reply, String> {
    let dataset = Dataset::new(job.files.clone(), setup.reading.options(&job.files));
    match (&job.task, graph) {
        (Task::Fit { created, known }, Some(graph)) if setup.blocks.blocks.is_some() => {
            let kept = setup.blocks.keep_blocks.as_ref();
            let on_blocks = OnBlocks {
                graph,
                files: &job.files,
                reading: &setup.reading.options(&job.files),
                kept: kept.map(|folder| folder.join(&job.machine)),
            };
            let fit = on_blocks.fit(known.as_ref(), &options(setup.memory), created.clone());
            match fit.map_err(|error| error.to_string())? {
                blocks::Outcome::Same => Ok(Reply::Same),
                blocks::Outcome::Fitted(fit, faults, doubts) => {
                    let mut fitted = whole(*fit, &faults).map_err(|error| error.to_string())?;
                    fitted.doubts.extend(doubts);
                    Ok(Reply::Fitted(Box::new(fitted)))
                }
            }
        }
        (Task::Fit { created, known }, Some(graph)) => {
            if let Some(known) = known {
                let rows = RowsId::of(&dataset, &graph.plan).map_err(|error| error.to_string())?;
                if rows == *known {
                    return Ok(Reply::Same);
                }
            }
            let fitted = fitted(graph, &dataset, setup.memory, created.clone());
            let mut fitted = fitted.map_err(|error| error.to_string())?;
            fitted.doubts.extend(of_reading(&dataset.reports()));
            Ok(Reply::Fitted(Box::new(fitted)))
        }
        (Task::Fit { .. }, None) => Err("no graph was given".to_owned()),
        (Task::Evaluate { model }, _) => {
            let model = Model::load_for(model, Wanted::SCORES).map_err(|error| words(&error))?;
            evaluated(setup, &model, &dataset)
        }
    }
}

/// Fits a graph on the rows of one machine, with all that the manifest of a fleet says of it: for whoever spreads machines over processes,
/// each of which works on one at a time. So the fit has one thread.
///
/// # Errors
/// As of [`fit_machine`].
pub fn fitted(
    graph: &Model,
    rows: &dyn Recording,
    memory: usize,
    created: Option<String>,
) -> Result<Fitted, MachineError> {
    let watch = FaultWatch::new(rows, Purpose::Fit);
    let fit = fit_machine(graph, &watch, &options(memory), created, &mut |_| {})?;
    whole(fit, &watch.found())
}

fn options(memory: usize) -> FitOptions {
    FitOptions {
        memory,
        threads: 1,
        ..FitOptions::default()
    }
}

fn whole(fit: MachineFit, faults: &[ChannelFaults]) -> Result<Fitted, MachineError> {
    let failed = fit.report.estimators.iter();
    let unfitted = failed.filter_map(|of| match &of.outcome {
        Outcome::Failed(error) => Some(Unfitted {
            node: of.node.clone(),
            error: error.to_string(),
        }),
        Outcome::Fitted(_) => None,
    });
    let bare = fit.bare.iter().filter(|of| !of.has_others);
    Ok(Fitted {
        model: fit.model.to_text()?,
        scores: fit
            .model
            .card
            .as_ref()
            .map_or_else(Vec::new, Figure::of_card),
        unfitted: unfitted.collect(),
        constant: bare.map(|of| of.output.clone()).collect(),
        doubts: of_channels(faults, &fit.report.rejected, fit.report.refused),
        rows: fit.rows,
    })
}

fn evaluated(setup: &Setup, model: &Model, dataset: &Dataset) -> Result<Reply, String> {
    let options = ScoreOptions {
        abs_truth_below: setup.abs_truth_below.clone(),
        levels: model.levels(),
        ..ScoreOptions::default()
    };
    let watch = FaultWatch::new(dataset, Purpose::Scores);
    let summed = Summed::new(&watch);
    let scores = score(&model.plan, &model.fitted, &summed, &options, &mut |_| {});
    let scores = scores.map_err(|error| error.to_string())?;
    let rows = summed.id().unwrap_or_default();
    let of_fit = |card: &Card| card.data.iter().any(|data| data.hash == rows.hash);
    let mut found = Figure::of_scores(&scores);
    // What stands in outputs is what counts; where none does, all predictions do.
    let is_put_out = |of: &Figure| {
        let mut outputs = model.plan.outputs.iter();
        outputs.any(|output| model.plan.channels[output.slot].name == of.of)
    };
    if found.iter().any(is_put_out) {
        found.retain(is_put_out);
    }
    Ok(Reply::Evaluated(Box::new(Evaluated {
        fitted_on: model.card.as_ref().is_some_and(of_fit),
        scores: found,
        doubts: [
            of_channels(&watch.found(), &scores.rejected, scores.refused),
            of_reading(&dataset.reports()),
        ]
        .concat(),
        rows,
    })))
}
