//! `athermal evaluate`: scores a model's predictions on recorded data.

use std::path::PathBuf;

use athermal::Model;
use athermal::core::compile::Wanted;
use athermal::core::model::ModelError;
use athermal::core::quantity::Quantity;
use athermal::core::score::{Score, ScoreOptions, Scores, score};
use clap::Args;
use serde_json::json;

use super::data::{self, Data};
use crate::figures::{count, number, or_dash, table};
use crate::terminal::{Answer, Failure, Format, Terminal};

/// Score a model's predictions on recorded data
///
/// Each prediction is compared with the truth measured later, beside no model (predicting zero), persistence (the last
/// truth that shares nothing with the predicted one), and the noise of the truth itself. All predictions of a truth are
/// scored on the instants at which all of them are valid.
///
/// Where predictions have intervals (bounds, as of `conformal`, or a standard deviation, of which 1.645 to either side are
/// to cover nine tenths), a second table tells which share of the truths they cover, how wide they are on average, and
/// their interval score: the width plus 2/(1 − share to cover) times the mean distance of truths outside, small being good.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal evaluate model.json --data test.csv\n  \
                        athermal evaluate model.json --data test.csv --format json \\\n      \
                        --abs-truth-below \"250 nm/min\""
)]
pub struct Evaluate {
    /// The model, or a graph in which nothing needs fitting
    model: PathBuf,
    #[command(flatten)]
    data: Data,
    /// Only truths whose absolute value is below count, such as "250 nm/min"
    #[arg(long, value_name = "QUANTITY")]
    abs_truth_below: Option<Quantity>,
    /// Score each prediction on all instants of its own
    #[arg(long)]
    each_on_its_own: bool,
    /// Let nothing learn on the way; otherwise, what learns does so after each truth has been predicted
    #[arg(long)]
    frozen: bool,
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// When the model or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(
            &self.model,
            Wanted {
                standard_errors: true,
                intervals: true,
            },
        )?;
        if let Some(limit) = &self.abs_truth_below {
            check_limit(limit, &model)?;
        }
        let dataset = self.data.dataset();
        let options = ScoreOptions {
            abs_truth_below: self.abs_truth_below.clone(),
            each_on_its_own: self.each_on_its_own,
            frozen: self.frozen,
        };
        let mut progress = terminal.progress("evaluating");
        let scores = score(
            &model.plan,
            &model.fitted,
            &dataset,
            &options,
            &mut |ticks| progress.tell(ticks),
        )?;
        drop(progress);
        if terminal.format == Format::Json {
            let files: Vec<_> = dataset
                .paths()
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            let period = scores.period.map(|(from, to)| {
                json!({ "from_s": from.as_ns() as f64 / 1e9, "to_s": to.as_ns() as f64 / 1e9, "ticks": scores.ticks })
            });
            println!(
                "{:#}",
                json!({ "data": files, "period": period, "scores": scores.scores })
            );
        } else {
            print!("{}", describe(&scores));
        }
        data::tell(
            terminal,
            &dataset.reports(),
            scores.refused,
            &scores.rejected,
        );
        if scores.scores.is_empty() {
            terminal.warning(
                "the graph has no prediction of a measured truth, so there is nothing to score",
            );
        }
        Ok(Answer::Fine)
    }
}

/// Whether a limit can be compared with every truth of a model.
///
/// # Errors
/// When a truth is in a unit that measures something else.
pub fn check_limit(limit: &Quantity, model: &Model) -> Result<(), Failure> {
    let truths = model
        .plan
        .channels
        .iter()
        .filter_map(|channel| channel.predicts);
    for slot in truths {
        let truth = &model.plan.channels[slot];
        if limit.in_unit(&truth.channel.unit).is_none() {
            return Err(Failure::Request(format!(
                "--abs-truth-below is in {}, and `{}` is in {}",
                limit.unit, truth.name, truth.channel.unit
            )));
        }
    }
    Ok(())
}

/// A model in which everything that needs a fit has one.
///
/// # Errors
/// When it cannot be loaded, or is a graph that needs fitting.
pub fn load_fitted(path: &std::path::Path, wanted: Wanted) -> Result<Model, Failure> {
    let model = Model::load_for(path, wanted)?;
    let nodes = model.unfitted();
    if model.card.is_none() && !nodes.is_empty() {
        return Err(ModelError::NotFitted {
            path: path.to_owned(),
            nodes,
        }
        .into());
    }
    Ok(model)
}

fn describe(scores: &Scores) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    let mut truths: Vec<&str> = scores
        .scores
        .iter()
        .map(|score| score.truth.as_str())
        .collect();
    truths.dedup();
    for truth in truths {
        let rows: Vec<&Score> = scores
            .scores
            .iter()
            .filter(|score| score.truth == truth)
            .collect();
        let Some(first) = rows.iter().find(|row| !row.own_instants).or(rows.first()) else {
            continue;
        };
        let _ = writeln!(
            text,
            "{truth} in {}, {} instants",
            first.unit,
            count(first.n as u64)
        );
        let _ = writeln!(
            text,
            "  no model {}, persistence {}, noise of the truth {}",
            or_dash(first.baseline_zero),
            or_dash(first.baseline_persistence),
            or_dash(first.truth_noise)
        );
        let header = [
            "  prediction",
            "ahead",
            "RMSE",
            "R²",
            "R²mean",
            "bias",
            "largest",
            "valid",
        ];
        let cells: Vec<Vec<String>> = rows.iter().map(|row| line(row)).collect();
        text.push_str(&table(&header, &cells));
        let cells: Vec<Vec<String>> = rows.iter().filter_map(|row| interval(row)).collect();
        if !cells.is_empty() {
            let header = ["  interval", "from", "to cover", "covers", "width", "score"];
            text.push_str(&table(&header, &cells));
        }
        text.push('\n');
    }
    text
}

fn interval(score: &Score) -> Option<Vec<String>> {
    let interval = score.interval.as_ref()?;
    let percent = |share: f64| format!("{:.1}%", 100.0 * share);
    Some(vec![
        format!("  {}", score.output),
        interval.from.to_owned(),
        percent(interval.stated),
        percent(interval.covered),
        number(interval.width),
        number(interval.score),
    ])
}

fn line(score: &Score) -> Vec<String> {
    let ratio =
        |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
    let ahead =
        athermal::Duration::from_secs_f64(score.ahead_s).unwrap_or(athermal::Duration::ZERO);
    let mut cells = vec![
        format!("  {}", score.output),
        ahead.to_string(),
        or_dash(score.rmse),
        ratio(score.r2_zero),
        ratio(score.r2_mean),
        or_dash(score.bias),
        or_dash(score.max_abs),
        score
            .valid
            .map_or_else(|| "-".to_owned(), |valid| format!("{:.1}%", 100.0 * valid)),
    ];
    let mut remarks = Vec::new();
    if score.is_worse_than_nothing() {
        remarks.push("worse than no model".to_owned());
    }
    if score.own_instants {
        remarks.push(format!(
            "on its own {} instants (no model {})",
            score.n,
            score.baseline_zero.map_or("-".into(), number)
        ));
    }
    if !remarks.is_empty() {
        cells.push(remarks.join(", "));
    }
    cells
}
