//! A worker: reads jobs from standard input and answers on standard output, one after the other, until there are no more.

use std::io::{self, BufRead, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};

use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources, panic_text};
use athermal_core::watch::Kept;
use athermal_files::{Dataset, Options};
use athermal_jobs::beyond::beyond;
use athermal_jobs::blocks::{OfFiles, Sums};
use athermal_jobs::doubts::Doubts;
use athermal_jobs::faults::{FaultWatch, Purpose};
use athermal_jobs::{RowsId, Summed};
use athermal_run::fit::FitOptions;
use athermal_run::model::{Card, Model, ModelError};
use athermal_run::score::{ScoreOptions, score};

use crate::doubts::Doubt;
use crate::figure::Figure;
use crate::job::{Evaluated, Fitted, Job, Reply, Setup, Task, Unfitted, graph_hash};
use crate::machine::{MachineError, MachineFit, fit_machine};

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
    let reading = setup.reading.options(&job.files);
    let dataset = Dataset::new(job.files.clone(), reading.clone());
    let failed = |error: MachineError| error.to_string();
    let fit = match (&job.task, graph, setup.blocks.blocks) {
        (Task::Evaluate { model }, ..) => {
            let model = Model::load_for(model, Wanted::SCORES).map_err(|error| words(&error))?;
            return evaluated(setup, &model, &dataset);
        }
        (Task::Fit { .. }, None, _) => return Err("no graph was given".to_owned()),
        (Task::Fit { created, known }, Some(graph), Some(cut)) => {
            let kept = setup.blocks.keep_blocks.as_ref();
            let kept = kept.map(|folder| folder.join(&job.machine));
            let of = OfFiles {
                cut,
                files: Some(job.files.clone()),
                reading: format!("{:?}", setup.reading),
                data: &|files, within| {
                    let reading = reading.clone();
                    Dataset::new(files, Options { within, ..reading })
                },
            };
            let sums = Sums::of(&graph.plan, kept.as_deref(), &of, &Kept::default());
            let sums = sums.map_err(|error| error.to_string())?;
            let rows = sums.rows().map_err(|error| error.to_string())?;
            if known.as_ref() == Some(&rows) {
                return Ok(Reply::Same);
            }
            let outcome = sums.fit(&graph.plan, &options(setup.memory));
            let outcome = outcome.map_err(|error| error.to_string())?;
            MachineFit::of(graph, outcome, rows, created.clone()).map_err(failed)?
        }
        (Task::Fit { created, known }, Some(graph), None) => {
            if let Some(known) = known {
                let rows = RowsId::of(&dataset, &graph.plan).map_err(|error| error.to_string())?;
                if rows == *known {
                    return Ok(Reply::Same);
                }
            }
            let (options, created) = (options(setup.memory), created.clone());
            let fit = fit_machine(graph, &dataset, &options, created, &Kept::default());
            let mut fit = fit.map_err(failed)?;
            fit.outcome = fit.outcome.read_from(&dataset);
            fit
        }
    };
    Ok(Reply::Fitted(Box::new(whole(fit).map_err(failed)?)))
}

pub(crate) fn options(memory: usize) -> FitOptions {
    FitOptions {
        memory,
        threads: 1,
        ..FitOptions::default()
    }
}

pub(crate) fn whole(fit: MachineFit) -> Result<Fitted, MachineError> {
    let MachineFit {
        model,
        rows,
        outcome,
    } = fit;
    let unfitted = outcome.report.failed().map(|(node, error)| Unfitted {
        node: node.to_owned(),
        error: error.to_string(),
    });
    let bare = outcome.bare.iter().filter(|of| !of.has_others);
    Ok(Fitted {
        scores: model.card.as_ref().map_or_else(Vec::new, Figure::of_card),
        unfitted: unfitted.collect(),
        constant: bare.map(|of| of.output.clone()).collect(),
        doubts: Doubt::all(&outcome.doubts(&model.plan), &outcome.files),
        rows,
        model: model.to_text()?,
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
    let doubts = Doubts {
        plan: &model.plan,
        dataset,
        refused: scores.refused,
        rejected: &scores.rejected,
        faults: watch.found(),
        outside_fit: beyond(model.sample_ranges(), &scores.ranges),
    };
    Ok(Reply::Evaluated(Box::new(Evaluated {
        fitted_on: model.card.as_ref().is_some_and(of_fit),
        scores: found,
        doubts: Doubt::all(&doubts.messages(), &dataset.reports()),
        rows,
    })))
}
