//! `athermal evaluate`: scores a model's predictions on recorded data.

use std::num::NonZeroU32;
use std::path::PathBuf;

use athermal::core::compile::Wanted;
use athermal::core::quantity::Quantity;
use athermal::core::score::{Lack, Mode, Score, ScoreOptions, Scores, score};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::beyond;
use super::data::{self, Data};
use super::faults::{self, FaultWatch, Purpose};
use super::model::{check_limit, load_fitted};
use super::numbers;
use crate::figures::{count, counted, number, or_dash, paragraph, seconds, stated, table};
use crate::invocation::next;
use crate::terminal::{Answer, Failure, Format, Terminal};

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
    /// The model, or a graph in which nothing needs fitting
    model: PathBuf,
    #[command(flatten)]
    data: Data,
    /// Only truths whose absolute value is below count, such as "250 nm/min"
    #[arg(long, value_name = "QUANTITY", allow_hyphen_values = true)]
    abs_truth_below: Option<Quantity>,
    /// Score each prediction on all instants of its own
    #[arg(long)]
    each_on_its_own: bool,
    /// Let no estimator learn on the way; otherwise, what learns does so after each truth has been predicted. Votes go by recent
    /// errors in either case
    #[arg(long)]
    frozen: bool,
    /// From which past truths predictions are made; only what reads or follows past truths differs
    #[arg(long, value_enum, default_value = "one-step")]
    mode: Horizon,
    /// How many steps ahead `--mode k-step` predicts
    #[arg(
        long,
        value_name = "K",
        allow_negative_numbers = true,
        value_parser = numbers::read::<NonZeroU32>("a whole number of steps, 1 or more and below 2^32")
    )]
    steps: Option<NonZeroU32>,
}

/// From which past truths predictions are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Horizon {
    /// From those measured, as beside a machine: all that the horizon and the embargo allow
    OneStep,
    /// From those measured up to K steps before the predicted one; newer ones are replaced by predictions of them, and
    /// nothing is learned from them. A step is the time from the newest truth that an estimator may read to the predicted one
    KStep,
    /// From its own predictions: a measured truth is read only where there is none yet, as at the beginning of a segment, and
    /// nothing is learned from any; what follows a state is told as many as it takes to know where it is
    FreeRun,
}

impl Evaluate {
    /// Scores and prints.
    ///
    /// # Errors
    /// When the model or the data cannot be used.
    pub fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
        let model = load_fitted(&self.model, Wanted::SCORES, terminal)?;
        if let Some(limit) = &self.abs_truth_below {
            check_limit(limit, &model)?;
        }
        let mode = self.mode()?;
        let dataset = self.data.dataset();
        let options = ScoreOptions {
            abs_truth_below: self.abs_truth_below.clone(),
            each_on_its_own: self.each_on_its_own,
            frozen: self.frozen,
            mode,
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
            let mut told = json!({
                "data": files,
                "mode": self.mode.name(),
                "steps": self.steps,
                "period": period,
                "scores": scores.scores,
                "lacks": scores.lacks,
                "outside_fit": outside_fit,
            });
            faults::to_json(&faults, &mut told);
            println!("{:#}", data::with_overlaps(told, &dataset.reports()));
        } else {
            print!("{}", describe(&scores, mode));
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
        for told in Lack::told(&scores.lacks) {
            terminal.warning(told);
        }
        let none = |of: &Score| of.valid.is_some() && of.n == 0;
        if let Some(steps) = self.steps
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

    fn mode(&self) -> Result<Mode, Failure> {
        match (self.mode, self.steps) {
            (Horizon::OneStep, None) => Ok(Mode::OneStep),
            (Horizon::FreeRun, None) => Ok(Mode::FreeRun),
            (Horizon::KStep, Some(steps)) => Ok(Mode::Steps(steps)),
            (Horizon::KStep, None) => Err(Failure::Request(
                "--mode k-step needs the number of steps: `--steps 3`".to_owned(),
            )),
            (other, Some(_)) => Err(Failure::Request(format!(
                "--steps says how far `--mode k-step` predicts, and the mode is {}",
                other.name()
            ))),
        }
    }
}

impl Horizon {
    fn name(self) -> &'static str {
        match self {
            Self::OneStep => "one-step",
            Self::KStep => "k-step",
            Self::FreeRun => "free-run",
        }
    }
}

fn describe(scores: &Scores, mode: Mode) -> String {
    use std::fmt::Write as _;
    let mut text = match mode {
        Mode::OneStep => String::new(),
        Mode::Steps(steps) => format!(
            "{} ahead: no truth newer than that is read, but what was predicted of it\n\n",
            counted(steps.get(), "step")
        ),
        Mode::FreeRun => {
            "free run: no measured truth is read where there is a prediction of it\n\n".to_owned()
        }
    };
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
    let mut all: Vec<(f64, String)> = Vec::new();
    for row in rows.iter().filter(|row| !row.own_instants) {
        if all.iter().all(|(ahead_s, _)| *ahead_s != row.ahead_s) {
            all.push((row.ahead_s, or_dash(row.baseline_persistence)));
        }
    }
    let Some((_, first)) = all.first() else {
        return or_dash(rows.first().and_then(|row| row.baseline_persistence));
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
    let ahead =
        athermal::Duration::from_secs_f64(score.ahead_s).unwrap_or(athermal::Duration::ZERO);
    let mut cells = vec![
        format!("  {}", score.output),
        ahead.to_string(),
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
