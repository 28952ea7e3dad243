//! `athermal demo`: the whole way from a machine to a scored prediction, on a simulated machine.

mod folder;

use athermal_core::watch::Watch;
use std::path::{Path, PathBuf};

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::registry::find;
use athermal::run::score::{Score, ScoreOptions, Scores, score};
use athermal::trial::machine::{KnownMachine, Setup, Simulated};
use clap::Args;
use serde_json::json;

use super::aside::write_aside;
use super::simulate::write_recording;
use crate::invocation::{command, program, quoted};
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::{count, or_dash, table};
use athermal_jobs::data::{Data, Reading};
use athermal_jobs::fit::{Fit, text_of};

const GRAPH: &str = include_str!("../../graphs/die-tester.toml");
const MACHINE: &str = "die-tester";
/// Days and seed of the recording to learn from, and of the one to be tested on.
const TRAIN: (f64, u64) = (7.0, 1);
const TEST: (f64, u64) = (2.0, 2);
/// Beyond it the chuck has just been stepped, and nobody measures.
const LIMIT: &str = "250 nm/min";

/// See what athermal does, on a simulated machine
///
/// Simulates a die tester for nine days, fits a graph on seven of them, and scores its predictions on the other two. Graph,
/// data and model are left in a folder to play with. It takes a second, and needs nothing but this program.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  athermal demo\n  athermal demo /tmp/die-tester")]
pub struct Demo {
    /// The folder; it is made, or was made by an earlier demo
    #[arg(default_value = "athermal-demo")]
    folder: PathBuf,
}

impl Demo {
    /// Simulates, fits, scores and prints.
    ///
    /// # Errors
    /// When the folder is somebody's, or cannot be written.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let files = ["die-tester.toml", "train.csv", "test.csv", "model.json"];
        folder::open(&self.folder, &files)?;
        let [graph, train, test, model] = files.map(|file| self.folder.join(file));
        let people = terminal.format == Format::Table;
        if people {
            terminal.note("A simulated die tester: two fibre holders about a chip on a heated chuck,\nsix temperatures every 10 s, six positions about every 75 s.\n");
        }
        let note = |path: &Path, text: &str| {
            if people {
                terminal.note(format_args!("  {:<30}  {text}", path.display().to_string()));
            }
        };
        write_aside(&graph, GRAPH)?;
        note(&graph, "the graph: what is computed from what");
        for (path, (days, seed), what) in
            [(&train, TRAIN, "to fit on"), (&test, TEST, "to test on")]
        {
            let rows = count(simulate(days, seed, path, terminal)?);
            note(
                path,
                &format!("{days} days {what}, seed {seed}, {rows} rows"),
            );
        }
        let fitted = fit_model(&graph, &train, &model, terminal)?;
        folder::mark(&self.folder, &files)?;
        let estimators = fitted.card.as_ref().map_or(0, |card| card.estimators.len());
        note(
            &model,
            &format!("the graph and what {estimators} of its nodes have learned"),
        );

        let scores = evaluate(&model, &test, terminal)?;
        if people {
            println!("\n{}", describe(&scores));
            terminal.note(next(&self.folder));
        } else {
            println!(
                "{:#}",
                json!({ "folder": self.folder, "files": files, "scores": scores.scores })
            );
        }
        Ok(Answer::Fine)
    }
}

fn simulate(days: f64, seed: u64, path: &Path, host: &dyn Watch) -> Result<u64, Failure> {
    let known =
        find::<KnownMachine>(MACHINE).map_err(|error| Failure::Request(error.to_string()))?;
    let setup = Setup {
        days,
        seed,
        ..Setup::default()
    };
    let recording = Simulated::new(known.machine, setup);
    write_recording(&recording, known.machine, false, path, host)
}

fn fit_model(
    graph: &Path,
    train: &Path,
    output: &Path,
    host: &dyn Watch,
) -> Result<Model, Failure> {
    let mut model = Model::load(graph)?;
    let data = Data::of(vec![train.to_owned()], Reading::default());
    Fit::on(data).fit(&mut model, host)?;
    write_aside(output, text_of(&model)?)?;
    Ok(model)
}

fn evaluate(model: &Path, test: &Path, host: &dyn Watch) -> Result<Scores, Failure> {
    let wanted = Wanted {
        standard_errors: true,
        intervals: false,
    };
    let model = Model::load_for(model, wanted)?;
    let dataset = Data::of(vec![test.to_owned()], Reading::default()).dataset();
    let options = ScoreOptions {
        abs_truth_below: LIMIT.parse().ok(),
        ..ScoreOptions::default()
    };
    let mut progress = host.progress("evaluating");
    let mut show = |ticks| progress.set(ticks);
    let scores = score(&model.plan, &model.fitted, &dataset, &options, &mut show)?;
    Ok(scores)
}

/// One axis, as it was predicted by the vote.
struct Axis<'a> {
    name: &'a str,
    vote: &'a Score,
}

impl Axis<'_> {
    /// By which share the error is smaller than without a model.
    fn gain(&self) -> Option<f64> {
        Some(1.0 - self.vote.rmse? / self.vote.baseline_zero?)
    }
}

fn describe(scores: &Scores) -> String {
    let votes = scores
        .scores
        .iter()
        .filter(|of| of.node.starts_with("vote"));
    let axes = votes.map(|vote| Axis {
        name: vote.output.rsplit('.').next().unwrap_or(&vote.output),
        vote,
    });
    let axes: Vec<Axis> = axes.collect();
    let baseline = |name: &str, of: fn(&Score) -> Option<f64>| {
        let cells = axes.iter().map(|axis| or_dash(of(axis.vote)));
        std::iter::once(name.to_owned()).chain(cells).collect()
    };
    let node = |label: &str, node: &str| {
        let cells = axes.iter().map(|axis| {
            let output = format!("{node}.{}", axis.name);
            let found = scores.scores.iter().find(|score| score.output == output);
            or_dash(found.and_then(|score| score.rmse))
        });
        std::iter::once(label.to_owned()).chain(cells).collect()
    };
    let rows: Vec<Vec<String>> = vec![
        baseline("no model", |score| score.baseline_zero),
        baseline("persistence", |score| score.baseline_persistence),
        node("from temperatures (thermal)", "thermal"),
        node("from past drift (motion)", "motion"),
        node("from both (both)", "both"),
        node("vote of the three", "vote"),
        baseline("standard error of the truth", |score| score.truth_noise),
    ];
    let header: Vec<&str> = std::iter::once("")
        .chain(axes.iter().map(|axis| axis.name))
        .collect();
    format!(
        "Error (RMSE, nm/min) of the drift predicted 5 min ahead, on days never seen,\n\
         where it is below {LIMIT}:\n\n{}\n{}",
        table(&header, &rows),
        meaning(&axes)
    )
}

/// Two sentences on what the figures mean.
fn meaning(axes: &[Axis]) -> String {
    let errors = axes.iter().filter_map(|axis| axis.vote.truth_noise);
    let error = errors.reduce(f64::min);
    let gains = || axes.iter().filter_map(|axis| Some((axis, axis.gain()?)));
    let by_gain = |a: &(&Axis, f64), b: &(&Axis, f64)| a.1.total_cmp(&b.1);
    let (Some((_, least)), Some((best, most))) = (gains().min_by(by_gain), gains().max_by(by_gain))
    else {
        return "There are too few instants for a verdict.\n".to_owned();
    };
    let (with, without) = (
        best.vote.rmse.unwrap_or(f64::NAN),
        best.vote.baseline_zero.unwrap_or(f64::NAN),
    );
    format!(
        "The vote foresees the drift of the next five minutes with {:.0} to {:.0} % less error\n\
         than no model: on {}, {:.0} nm in five minutes are left of {:.0} nm.\n\
         What is left comes mostly from what cannot be known five minutes before, such\n\
         as the next step of the chuck; and the drift itself is known to {} nm/min at\n\
         best, its standard error, since positions are measured to 12 nm.\n",
        100.0 * least,
        100.0 * most,
        best.name,
        5.0 * with,
        5.0 * without,
        or_dash(error),
    )
}

/// What to try next.
fn next(folder: &Path) -> String {
    let program = program();
    let [graph, test, model, faulty, picture] = [
        "die-tester.toml",
        "test.csv",
        "model.json",
        "faulty.csv",
        "graph.svg",
    ]
    .map(|file| quoted(&folder.join(file).display().to_string()));
    let limit = format!("--abs-truth-below \"{LIMIT}\"");
    let fault = "--fault temperature.plate1=missing,from=6h";
    let lines = [
        command(&[&program, "show", &graph, "--format svg", ">", &picture]),
        command(&[&program, "nodes slope"]),
        command(&[&program, "run", &model, "--input", &test, "| tail -3"]),
        command(&[
            &program,
            "simulate",
            MACHINE,
            "--days 2 --seed 2 -o",
            &faulty,
            fault,
        ]),
        command(&[&program, "evaluate", &model, "--data", &faulty, &limit]),
        "and with a log of a machine of yours:".to_owned(),
        command(&[&program, "init LOG.csv -o graph.toml"]),
    ];
    format!("Try next:\n{}", lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_analysis::figures::number;

    #[test]
    fn the_meaning_is_told_with_the_figures_of_the_best_axis() {
        let score = |output: &str, rmse, zero| Score {
            output: output.to_owned(),
            node: output.to_owned(),
            kind: "auto_weighted",
            truth: String::new(),
            unit: "nm/min".to_owned(),
            ahead_s: 300.0,
            horizon_s: Some(300.0),
            n: 100,
            rmse: Some(rmse),
            r2_zero: None,
            r2_mean: None,
            fit: None,
            bias: None,
            max_abs: None,
            valid: None,
            no_model: Some(0.0),
            no_model_is: athermal::run::score::NoModel::Zero,
            baseline_zero: Some(zero),
            baseline_persistence: None,
            persistence_n: 0,
            truth_noise: Some(3.85),
            own_instants: false,
            left_out: 0,
            interval: None,
        };
        let (x1, z1) = (score("vote.X1", 8.0, 10.0), score("vote.Z1", 25.0, 50.0));
        let axes = [
            Axis {
                name: "X1",
                vote: &x1,
            },
            Axis {
                name: "Z1",
                vote: &z1,
            },
        ];
        let text = meaning(&axes);
        assert!(text.contains("with 20 to 50 % less error"), "{text}");
        let left = "on Z1, 125 nm in five minutes are left of 250 nm";
        assert!(text.contains(left), "{text}");
        assert!(text.contains(&number(3.85)), "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 80));
    }
}
