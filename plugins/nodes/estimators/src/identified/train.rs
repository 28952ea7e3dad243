//! Decides how rows become the evenly spaced samples that a model is identified from, and what is reported of the fit; not which
//! orders it has.

use athermal_core::diagnostic::{count, digits};
use athermal_core::node::{Trained, Trainer, TrainingError, TrainingReport, TrainingSetup};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{
    Beginning, Polynomials, PredictionError, PredictionErrorFit, Samples, Standardizer,
};

use super::Asked;
use super::follow::{UNSEEN, steps};
use super::model::Identified;
use super::rehearse::{self, Reach};
use super::rows::{Bridges, Pace, Rows};
use crate::conditioning::tell_rows;
use crate::novelty::novelty_of_rows;
use crate::scaling::Scaling;

/// How many steps ahead the variance of a prediction is known; beyond, it grows no more.
const STEPS_AHEAD: usize = 256;

/// How many times as large as one step ahead an error of a run is about which there is something to tell.
const WORTH_TELLING: f64 = 1.05;

/// How a model is found from evenly spaced samples.
pub(crate) trait Identify: std::fmt::Debug + Send {
    /// How long a step is, where that is stated.
    fn every(&self) -> Option<Duration>;

    /// Over how many steps without a run at most inputs stay as they last were where truths are missing; none where a truth that
    /// is missing ends a piece.
    fn bridges(&self) -> Option<usize> {
        None
    }

    /// The model, from samples of so many interleaved series; what there is to tell goes into the report. Where orders are
    /// compared, and calls with which of how many it goes to.
    ///
    /// # Errors
    /// When the samples do not allow one.
    fn identify(
        &self,
        samples: &Samples,
        series: usize,
        report: &mut TrainingReport,
        order: &mut dyn FnMut(usize, usize),
    ) -> Result<Found, TrainingError>;
}

/// A model, and how far its one-step predictions were off.
#[derive(Debug)]
pub(crate) struct Found {
    pub(crate) model: Polynomials,
    /// The standard errors of its coefficients, where they are known; of a polynomial that has none, an empty list.
    pub(crate) errors: Option<Polynomials>,
    /// The sum of their squares.
    pub(crate) squared_errors: f64,
    /// How many are in it.
    pub(crate) rows: usize,
    /// The variance of an innovation.
    pub(crate) variance: f64,
    /// Where the filter of each input begins in a run; nothing where there is none.
    pub(crate) beginnings: Vec<Beginning>,
    /// Whether its level is the mean of its rows, which do not tell it.
    pub(crate) mean_level: bool,
}

/// Keeps all rows, which are gone through again and again.
#[derive(Debug)]
pub(crate) struct IdentifiedTrainer<Kind> {
    asked: Kind,
    names: Vec<String>,
    span: Duration,
    unit: String,
    reach: Reach,
    memory: usize,
    rows: Rows,
    count: usize,
    /// Whether runs between rows are kept: not once there is no room for them beside the rows.
    keeps_runs: bool,
}

impl<Kind: Identify> IdentifiedTrainer<Kind> {
    pub(crate) fn new(setup: &TrainingSetup, asked: Kind) -> Self {
        let names = setup
            .regressors
            .iter()
            .map(|regressor| regressor.name.clone());
        Self {
            asked,
            names: names.collect(),
            span: setup.span,
            unit: setup.error_unit.clone(),
            reach: Reach {
                ahead: setup.ahead,
                earlier: setup.span.max(setup.ahead).max(Duration::from_ns(1)),
                follows: setup.learns,
                limits: setup.limits,
                window: setup.span,
            },
            memory: setup.memory,
            rows: Rows::new(setup.regressors.len()),
            count: 0,
            keeps_runs: true,
        }
    }

    fn bytes_per_row(&self) -> usize {
        Rows::bytes_per_row(self.names.len())
    }

    fn fits(&self) -> bool {
        self.count * self.bytes_per_row() <= self.memory
    }

    /// Lets go of runs where they do not fit beside the rows.
    fn make_room(&mut self) {
        // A run takes no more than a row.
        let all = self.count + self.rows.runs();
        if all * self.bytes_per_row() > self.memory {
            self.keeps_runs = false;
            self.rows.forget_runs();
        }
    }

    fn solve(
        &self,
        report: &mut TrainingReport,
        order: &mut dyn FnMut(usize, usize),
    ) -> Result<Identified, TrainingError> {
        let unsolvable = |reason: String| TrainingError::Unsolvable { reason };
        if !self.fits() {
            let bytes = (self.count * self.bytes_per_row()) as f64;
            return Err(unsolvable(format!(
                "it goes over its rows several times, and they did not fit in memory: they take {:.0} MB of the `--memory` that all \
                 estimators share",
                (bytes / f64::from(1 << 20)).ceil() + 1.0
            )));
        }
        let apart = || match self.rows.count() {
            rows @ ..3 => TrainingError::TooFewRows { rows, needed: 3 },
            rows => unsolvable(format!(
                "there is a gap before each of the {rows} rows, and the model needs rows that follow each other"
            )),
        };
        let between = self.rows.between().ok_or_else(apart)?;
        let pace = Pace::of(self.asked.every(), self.span, between);
        let mut standard = Standardizer::new(self.names.len());
        if !self.names.is_empty() {
            let regressors = self.rows.regressors();
            regressors
                .chunks_exact(self.names.len())
                .for_each(|row| standard.partial_fit(row));
        }
        let standard = standard.standardization();
        let bridges = self.asked.bridges().filter(|_| self.keeps_runs);
        let bridges = bridges.map(|unseen| Bridges {
            unseen,
            missing: self.memory / self.bytes_per_row(),
        });
        let samples = self.rows.samples(pace, &standard, bridges);
        let found = self.asked.identify(&samples, pace.series, report, order)?;
        tell_rows(
            &self.names,
            self.rows.regressors(),
            self.rows.truths(),
            report,
        );
        pace.tell(report);
        let one_step = (found.squared_errors / found.rows as f64).sqrt();
        let variance = found.variance;
        let variances = found.model.variances(STEPS_AHEAD);
        let identified = Identified {
            regressors: self.names.clone(),
            scaling: Scaling {
                means: standard.means,
                scales: standard.scales,
                truth: 0.0,
            },
            deviations: variances
                .iter()
                .map(|sum| (variance * sum).sqrt())
                .collect(),
            model: found.model,
            beginnings: found.beginnings,
            errors: found.errors,
            mean_level: found.mean_level,
            step: pace.step,
            series: pace.series,
            novelty: novelty_of_rows(self.names.len(), self.rows.regressors()),
        };
        self.tell_error(one_step, &identified, report);
        Ok(identified)
    }

    /// A model is found by its errors one step ahead, and may know less than that when it predicts.
    fn tell_error(&self, one_step: f64, of: &Identified, report: &mut TrainingReport) {
        let Reach {
            earlier, follows, ..
        } = self.reach;
        let ahead = steps(earlier, of.step);
        let further = of.model.follows() && ahead > 1;
        // The fit finds where filters begin, which a run learns from its truths; and a run is kept from truths that miss by too much.
        let error = rehearse::error(&self.rows, of, self.reach);
        report.in_sample_rmse = Some(error.unwrap_or(one_step));
        let Some(error) = error else {
            return;
        };
        if follows && !further && error <= WORTH_TELLING * one_step {
            return;
        }
        report.figure("rmse_one_step_ahead", one_step);
        let predicts = if !follows {
            "it will not follow truths".to_owned()
        } else if further {
            format!("it predicts {ahead} steps after the newest truth")
        } else {
            "in each piece its first truths tell where its filters are".to_owned()
        };
        report.notes.push(format!(
            "it was found by its errors one step ahead, which are {} {}; {predicts}, and the in-sample RMSE is that of this",
            digits(one_step, 3),
            self.unit
        ));
    }
}

impl Identify for Asked {
    fn every(&self) -> Option<Duration> {
        self.every
    }

    fn bridges(&self) -> Option<usize> {
        let order = self.order.unwrap_or_default();
        let tried = order.combinations(self.given()).into_iter();
        let inputs = tried.flat_map(|one| self.orders(&one, 0).inputs);
        let longest = inputs.map(|input| input.nk + input.nb).max().unwrap_or(0);
        Some(longest.max(UNSEEN))
    }

    fn identify(
        &self,
        samples: &Samples,
        _series: usize,
        report: &mut TrainingReport,
        order: &mut dyn FnMut(usize, usize),
    ) -> Result<Found, TrainingError> {
        // In units of their spread, or the search would depend on the unit of the truth.
        let spread = samples.spread();
        let divided = samples.divided(spread);
        let mut fit = self.fit(&divided, spread, report, order)?;
        let mut search = PredictionError {
            penalty: self.penalty,
            ..PredictionError::default()
        };
        let mut errors = search.standard_errors(&fit, &divided);
        let mean = divided.mean();
        let mut mean_level = false;
        if !tell_level(&fit, errors.as_ref(), mean) {
            search.level = Some(mean);
            let orders = fit.model.orders();
            let with_level = PredictionError {
                level: search.level,
                ..self.search(&orders, self.penalty, fit.measured)
            };
            if let Ok(found) = with_level.fit(&orders, &divided, fit.first) {
                errors = search.standard_errors(&found, &divided);
                (fit, mean_level) = (found, true);
                report.notes.push(format!(
                    "its rows do not tell the level that it returns to, which is taken to be their mean, {}",
                    digits(spread * mean, 4)
                ));
            }
        }
        if let Some(errors) = errors.as_mut().filter(|_| mean_level) {
            // None is known, and it is no number.
            errors.level = 0.0;
        }
        fit.model.rescale(spread);
        if let Some(errors) = &mut errors {
            errors.rescale(spread);
        }
        fit.residual_sum_of_squares *= spread * spread;
        fit.squared_errors *= spread * spread;
        for beginning in &mut fit.beginnings {
            beginning.times *= spread;
            beginning.square *= spread * spread;
        }
        tell_missing(samples, report);
        tell_pieces(samples, &fit.model, report);
        tell_starts(samples.pieces(), fit.starts, fit.rows, report);
        report.figure("converged", fit.converged);
        report.figure("steps_of_search", fit.steps);
        if !fit.converged {
            report.notes.push(format!(
                "the search had not ended after {} steps: the data hardly tell some coefficients from others, which fewer features or lower orders would settle",
                fit.steps
            ));
        }
        Ok(Found {
            squared_errors: fit.squared_errors,
            rows: fit.rows,
            variance: fit.variance(),
            beginnings: fit.beginnings,
            model: fit.model,
            errors,
            mean_level,
        })
    }
}

/// Whether samples, in units of their spread, tell the level of a model better than one of them does by itself. Without standard
/// errors it must be among them.
fn tell_level(fit: &PredictionErrorFit, errors: Option<&Polynomials>, mean: f64) -> bool {
    let unsure = match errors {
        Some(errors) => errors.level,
        None => (fit.model.level - mean).abs() / FAR,
    };
    // Written so that NaN fails.
    fit.model.differences > 0 || unsure <= 1.0
}

/// A level that is so many spreads from the mean is not among samples.
const FAR: f64 = 5.0;

/// Tells of samples through which a model goes without a truth.
fn tell_missing(samples: &Samples, report: &mut TrainingReport) {
    let (missing, all) = (samples.missing(), samples.missing() + samples.count());
    if missing == 0 {
        return;
    }
    report.figure("missing_truths", missing);
    report.figure("samples", all);
    report.notes.push(format!(
        "at {} of its samples the truth is missing, {} in all: the model is followed through them, as while it runs",
        count(missing),
        count(all)
    ));
}

/// In pieces of fewer samples on average, polynomials are found less exactly than the theory says.
const SHORT_PIECE: usize = 50;

/// Tells of pieces that are too short for filters and for a model of the noise.
fn tell_pieces(samples: &Samples, model: &Polynomials, report: &mut TrainingReport) {
    let pieces = samples.pieces();
    let length = samples.count() / pieces.max(1);
    let filtered = model.inputs.iter().any(|input| !input.f.is_empty());
    let has_c = !model.c.is_empty();
    // Without `C`, `A` is found by least squares on what was measured, whatever was before a piece.
    let blurred = [
        ("`A`", has_c && !model.a.is_empty()),
        ("`F`", filtered),
        ("`C`", has_c),
        ("`D`", !model.d.is_empty()),
    ];
    let names: Vec<&str> = blurred
        .iter()
        .filter_map(|&(name, is)| is.then_some(name))
        .collect();
    let names = match &names[..] {
        [] => return,
        [name] => format!("{name} is"),
        [others @ .., last] => format!("{} and {last} are", others.join(", ")),
    };
    if pieces < 2 || length >= SHORT_PIECE {
        return;
    }
    report.figure("pieces", pieces);
    report.figure("samples_per_piece", length);
    report.notes.push(format!(
        "its samples are in {pieces} pieces of {length} on average, each of which begins without a past: in so short ones {names} \
         found less exactly than the standard errors say"
    ));
}

/// The share of the rows from which it is reported that so many of them show where filters begin.
const STARTS: f64 = 0.1;

/// Tells of rows that go into where filters begin in each piece.
fn tell_starts(pieces: usize, starts: usize, rows: usize, report: &mut TrainingReport) {
    let share = starts as f64 / rows as f64;
    if pieces < 2 || share < STARTS {
        return;
    }
    report.figure("starts", starts);
    report.notes.push(format!(
        "{:.0} % of what its rows tell goes into where its filters begin in each of {pieces} pieces, which a run does not know before \
         its truths tell it: there it errs more; `arx` and `armax` begin with truths instead",
        100.0 * share,
    ));
}

impl<Kind: Identify> Trainer for IdentifiedTrainer<Kind> {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        let second = Duration::from_ns(1_000_000_000);
        let last = self.rows.last();
        self.row_at(
            last.map_or(Instant::from_ns(0), |last| last + second),
            regressors,
            truth,
        );
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        self.count += 1;
        if !self.fits() {
            self.rows = Rows::new(self.names.len());
            return;
        }
        self.rows.push(at, regressors, truth);
        self.make_room();
    }

    fn run_at(&mut self, of: Instant, regressors: &[f64]) {
        if self.keeps_runs && self.fits() {
            self.rows.run(of, regressors);
            self.make_room();
        }
    }

    fn segment(&mut self) {
        self.rows.segment();
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        self.finish_telling(&mut |_, _| {})
    }

    fn finish_telling(
        self: Box<Self>,
        order: &mut dyn FnMut(usize, usize),
    ) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let predictor = self.solve(&mut report, order)?;
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_numerics::{InputOrders, Orders};

    #[test]
    fn short_pieces_are_told_with_the_polynomials_that_they_blur() {
        let mut samples = Samples::new(0);
        for _ in 0..3 {
            samples.segment();
            (0..20).for_each(|nth| samples.push([], f64::from(nth % 2)));
        }
        let told = |na: usize, nf: usize, nc: usize, nd: usize| {
            let model = Polynomials::zero(&Orders {
                na,
                inputs: vec![InputOrders { nb: 1, nk: 0, nf }],
                nc,
                nd,
                ..Orders::default()
            });
            let mut report = TrainingReport::default();
            tell_pieces(&samples, &model, &mut report);
            report.notes
        };
        let expected = |of: &str| {
            format!(
                "its samples are in 3 pieces of 20 on average, each of which begins without a past: in so short ones {of} found \
                 less exactly than the standard errors say"
            )
        };
        assert_eq!(told(0, 0, 1, 0), [expected("`C` is")]);
        assert_eq!(told(2, 0, 1, 0), [expected("`A` and `C` are")]);
        assert_eq!(told(0, 1, 0, 0), [expected("`F` is")]);
        assert_eq!(told(0, 2, 1, 2), [expected("`F`, `C` and `D` are")]);
        assert!(told(2, 0, 0, 0).is_empty());
    }

    #[test]
    fn errors_that_rest_on_where_filters_begin_in_many_pieces_are_told() {
        let told = |pieces: usize, starts: usize| {
            let mut report = TrainingReport::default();
            tell_starts(pieces, starts, 200, &mut report);
            report.notes
        };
        assert_eq!(
            told(60, 70),
            [
                "35 % of what its rows tell goes into where its filters begin in each of 60 pieces, which a run does not know before \
                 its truths tell it: there it errs more; `arx` and `armax` begin with truths instead"
            ]
        );
        assert!(told(60, 15).is_empty() && told(1, 70).is_empty());
    }

    /// An autoregression about 20 with so much more in each step, of which so many samples are known.
    fn identified(pole: f64, drift: f64, count: usize) -> (Found, Vec<String>) {
        let (mut state, mut value, mut samples) = (12_345_u64, 0.0, Samples::new(0));
        for _ in 0..count {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            value = pole * value + drift + (state >> 33) as f64 / f64::from(1 << 30) - 1.0;
            samples.push([], 20.0 + value);
        }
        let asked = Asked {
            na: Some(1),
            nc: Some(1),
            ..Asked::default()
        };
        let mut report = TrainingReport::default();
        let found = asked
            .identify(&samples, 1, &mut report, &mut |_, _| {})
            .unwrap();
        let off = (found.model.level - samples.mean()).abs();
        assert!(!found.mean_level || off < 1e-9, "{off}");
        (found, report.notes)
    }

    #[test]
    fn a_level_that_rows_do_not_tell_is_their_mean_and_the_report_says_so() {
        let (found, notes) = identified(1.0, 0.1, 300);
        assert!(found.mean_level);
        let told =
            "its rows do not tell the level that it returns to, which is taken to be their mean, ";
        assert!(notes.iter().any(|note| note.starts_with(told)), "{notes:?}");
        let (found, notes) = identified(0.9, 0.0, 1000);
        assert!(!found.mean_level && notes.is_empty(), "{notes:?}");
        let error = found.errors.unwrap().level;
        assert!((found.model.level - 20.0).abs() < 3.0 * error && error < 0.5);
    }
}
