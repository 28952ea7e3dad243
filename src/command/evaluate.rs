//! `athermal evaluate`: scores a model's predictions on recorded data.

use std::path::PathBuf;

use athermal::core::compile::Wanted;
use athermal::run::score::{Lack, Score, ScoreOptions, Scores, score};
use clap::Args;
use serde_json::json;

use super::beyond;
use super::data::{self, Data};
use super::doubtful::Doubtful;
use super::faults::{self, FaultWatch, Purpose};
use super::model::load_fitted;
use super::scored::Scored;
use super::unscored;
use crate::invocation::next;
use crate::terminal::{Answer, Failure, Format, Terminal};
use athermal_analysis::figures::{
    count, counted, number, or_dash, paragraph, seconds, stated, table,
};

/// Score a model's predictions on recorded data
///
/// Each prediction is compared with the truth measured later, beside no model (predicting zero), persistence (the last
/// truth that shares nothing with the predicted one; K steps ahead that of K steps before, in a free run none), and the
/// standard error of the truth itself. All predictions of a truth are scored on the instants at which all of them are valid.
///
/// The standard error of a truth that is a slope is that of its line, from the residuals about it (root mean square over
/// the instants). Scatter of the samples and curvature of the drift within the window both count there, so that it may be
/// more than the noise of the measurement, and a prediction may come below it.
///
/// R² is against no model, 1 − SSE / Σ y², and tells little of a truth that is never near zero; R²mean is against the truth's
/// mean, 1 − SSE / Σ (y − ȳ)², the R² of scikit-learn. Fit is the share of the truth's spread that is told,
/// 1 − √(SSE / Σ (y − ȳ)²), as identification has it.
///
/// Ahead is how far ahead of the measured truths that it may go by a prediction was made; with `--mode k-step` that is K − 1 steps
/// more, where past truths change it, and in a free run without bound. Bias is the mean error, prediction less truth: above zero,
/// more is predicted than comes. Largest is the largest error in size, and valid the share of the instants at which the truth was
/// measured that have a prediction.
///
/// Where predictions have intervals (bounds, as of `conformal`, or a standard deviation, of which 1.645 to either side are
/// to cover nine tenths), a second table tells which share of the truths they cover, how wide they are on average, and
/// their interval score: the width plus 2/(1 − share to cover) times the mean distance of truths outside, small being good.
///
/// `--mode` tells how far the model reaches by itself: one step from measured past truths, several steps with its own
/// predictions in between, or freely, from features alone and its own past. Features made of what the truth is made of
/// stay as they were measured, and so do the weights of votes. Standard deviations are those of as many steps as there are
/// since the newest measured truth, as far as the noise is what the model takes it for.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal evaluate model.json --data test.csv\n  \
                        athermal evaluate model.json --data test.csv --format json \\\n      \
                        --abs-truth-below \"250 nm/min\"\n  \
                        athermal evaluate model.json --data test.csv --mode free-run"
)]
pub struct Evaluate {
    /// The model, or a graph that names one or in which nothing needs fitting
    model: PathBuf,
    #[command(flatten)]
    data: Data,
    /// Score each prediction on all instants of its own
    #[arg(long)]
    each_on_its_own: bool,
    #[command(flatten)]
    scored: Scored,
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// When the model or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(&self.model, Wanted::SCORES, terminal)?;
        self.scored.check(&model)?;
        let dataset = self.data.dataset();
        let options = ScoreOptions {
            each_on_its_own: self.each_on_its_own,
            ..self.scored.options()?
        };
        let watch = FaultWatch::new(&dataset, Purpose::Scores);
        let mut progress = terminal.progress("evaluating");
        let scores = score(&model.plan, &model.fitted, &watch, &options, &mut |ticks| {
            progress.tell(ticks)
        })?;
        drop(progress);
        let faults = watch.found();
        let outside_fit = beyond::beyond(model.sample_ranges(), &scores.ranges);
        if terminal.format == Format::Json {
            let files: Vec<_> = dataset
                .paths()
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            let period = scores.period.map(|(from, to)| {
                json!({ "from_s": seconds(from), "to_s": seconds(to), "ticks": scores.ticks })
            });
            let mut told = json!({ "data": files });
            self.scored.tell(&mut told);
            told["each_on_its_own"] = self.each_on_its_own.into();
            told["period"] = json!(period);
            told["scores"] = json!(scores.scores);
            told["unscored"] = json!(scores.unscored);
            told["lacks"] = json!(scores.lacks);
            let doubtful = Doubtful {
                faults: &faults,
                outside_fit: &outside_fit,
                reports: &dataset.reports(),
            };
            doubtful.tell(&mut told);
            println!("{told:#}");
        } else {
            print!("{}", describe(&scores, &self.in_words()));
        }
        data::tell(
            terminal,
            &model.plan,
            &dataset.reports(),
            scores.refused,
            &scores.rejected,
        );
        beyond::tell(terminal, &outside_fit);
        faults::tell(terminal, &faults);
        let period = scores.period.map(|(from, to)| (seconds(from), seconds(to)));
        self.data.tell_fitted_on(terminal, &model, period);
        unscored::tell(terminal, &scores.unscored);
        for told in Lack::told(&scores.lacks) {
            terminal.warning(told);
        }
        let none = |of: &Score| of.valid.is_some() && of.n == 0;
        if let Some(steps) = self.scored.steps()
            && scores.scores.iter().any(none)
        {
            terminal.warning(format_args!(
                "where no truth was predicted {steps} steps ahead, no stretch of the data may be that long: try fewer `--steps`"
            ));
        }
        if scores.scores.is_empty() {
            terminal.warning(
                "the graph has no prediction of a measured truth, so there is nothing to score",
            );
        } else if terminal.format == Format::Table && scores.scores.iter().any(|of| of.n > 0) {
            // Why the scores are what they are.
            terminal.note(next(&self.data.words_with("diagnose", &self.model)));
        }
        Ok(Answer::Fine)
    }

    /// How it is scored, where otherwise than usual.
    fn in_words(&self) -> Vec<String> {
        let mut words = self.scored.in_words();
        if self.each_on_its_own {
            words.push("each prediction is scored on all instants of its own".to_owned());
        }
        words
    }
}

/// The tables of all truths, below what was asked for.
fn describe(scores: &Scores, asked: &[String]) -> String {
    use std::fmt::Write as _;
    let mut text: String = asked.iter().map(|line| format!("{line}\n")).collect();
    if !asked.is_empty() {
        text.push('\n');
    }
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
            "{truth} in {}, {}",
            first.unit,
            counted(first.n as u64, "instant")
        );
        let _ = writeln!(
            text,
            "  no model {}, persistence {}, standard error of the truth {}",
            or_dash(first.baseline_zero),
            persistence(&rows),
            or_dash(first.truth_noise)
        );
        text.push_str(&left_out(&rows));
        let header = [
            "  prediction",
            "ahead",
            "RMSE",
            "R²",
            "R²mean",
            "fit",
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

/// How far off the truth of before is, for each horizon where that differs.
fn persistence(rows: &[&Score]) -> String {
    let of = |row: &Score| match row.persistence_on_few() {
        Some(few) => format!(
            "{} on {} of them",
            or_dash(row.baseline_persistence),
            count(few)
        ),
        None => or_dash(row.baseline_persistence),
    };
    let mut all: Vec<(f64, String)> = Vec::new();
    for row in rows.iter().filter(|row| !row.own_instants) {
        if all.iter().all(|(ahead_s, _)| *ahead_s != row.ahead_s) {
            all.push((row.ahead_s, of(row)));
        }
    }
    let Some((_, first)) = all.first() else {
        return rows.first().map_or_else(|| or_dash(None), |row| of(row));
    };
    if all.iter().all(|(_, error)| error == first) {
        return first.clone();
    }
    let told = all
        .iter()
        .map(|(ahead_s, error)| format!("{error} at {}", stated(*ahead_s)));
    told.collect::<Vec<_>>().join(" and ")
}

/// What is told where many instants are not scored, since some prediction has no value there.
fn left_out(rows: &[&Score]) -> String {
    let scored_together = || rows.iter().filter(|row| !row.own_instants);
    let Some(most) = scored_together().max_by_key(|row| row.left_out) else {
        return String::new();
    };
    let valid = |row: &Score| row.valid.unwrap_or(f64::NEG_INFINITY);
    let lacking = scored_together().min_by(|a, b| valid(a).total_cmp(&valid(b)));
    match lacking {
        Some(lacking) if most.leaves_many_out() => {
            let words = format!(
                "{} of {} instants at which {} is there are left out, since others are not, such as {}; --each-on-its-own scores each \
                 wherever it is",
                count(most.left_out),
                count(most.n + most.left_out),
                most.output,
                lacking.output
            );
            paragraph("  ", 2, &words)
        }
        _ => String::new(),
    }
}

fn interval(score: &Score) -> Option<Vec<String>> {
    let interval = score.interval.as_ref()?;
    Some(vec![
        format!("  {}", score.output),
        interval.from.to_owned(),
        percent(100.0 * interval.stated),
        percent(100.0 * interval.covered),
        number(interval.width),
        number(interval.score),
    ])
}

/// How much of a truth is told, 1 being all of it. What is far off is not written out.
fn share(value: f64) -> String {
    if value.abs() < 1e3 {
        format!("{value:.3}")
    } else {
        number(value)
    }
}

fn percent(value: f64) -> String {
    if value.abs() < 1e5 {
        format!("{value:.1}%")
    } else {
        format!("{}%", number(value))
    }
}

fn line(score: &Score) -> Vec<String> {
    let ratio = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), share);
    // Nothing that is measured bounds how far a free run is ahead.
    let ahead = score.horizon_s.map_or_else(|| "free".to_owned(), stated);
    let mut cells = vec![
        format!("  {}", score.output),
        ahead,
        or_dash(score.rmse),
        ratio(score.r2_zero),
        ratio(score.r2_mean),
        score.fit.map_or_else(|| "-".to_owned(), percent),
        or_dash(score.bias),
        or_dash(score.max_abs),
        score
            .valid
            .map_or_else(|| "-".to_owned(), |valid| percent(100.0 * valid)),
    ];
    let mut remarks = Vec::new();
    if score.is_worse_than_nothing() {
        remarks.push("worse than no model".to_owned());
    }
    if score.valid.is_none() {
        remarks.push("no truth to compare with".to_owned());
    } else if score.n == 0 {
        remarks.push("no prediction of any truth".to_owned());
    } else if score.own_instants {
        remarks.push(format!(
            "on its own {} (no model {})",
            counted(score.n as u64, "instant"),
            score.baseline_zero.map_or("-".into(), number)
        ));
    }
    if !remarks.is_empty() {
        cells.push(remarks.join(", "));
    }
    cells
}
