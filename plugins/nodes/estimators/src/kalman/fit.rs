//! Decides what a structural model learns from its rows; not how it is followed afterwards.

use std::collections::VecDeque;

use athermal_core::channel::Extremes;
use athermal_core::diagnostic::digits;
use athermal_core::node::{
    Figure, Learner, LearningGate, LearningLimits, Trained, TrainedRange, Trainer, TrainingError,
    TrainingReport, TrainingSetup,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use athermal_numerics::{
    Movement, NumericsError, Passage, Series, Standardizer, Structural, follow, most_likely,
};

use super::coefficients::Hourly;
use super::follow::{Following, variance};
use super::{Kalman, KalmanPredictor, Noises};
use crate::conditioning::tell_rows;
use crate::novelty::novelty_of_rows;
use crate::rls::LITTLE;
use crate::scaling::Scaling;

/// The most rows that the search for variances goes through, again and again.
const MOST_ROWS: usize = 20_000;

/// Of smaller variances than this, what is left after a truth has not all its digits any more.
const LEAST_VARIANCE: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// Takes rows, fewer of them the more there are.
#[derive(Debug)]
pub(super) struct KalmanTrainer {
    parameters: Kalman,
    names: Vec<String>,
    unit: String,
    every: Duration,
    ahead: Duration,
    span: Duration,
    /// How much earlier than a truth the newest one arrived that its prediction knows of.
    earlier: Duration,
    /// Whether it will follow truths while it runs, and which of them not.
    follows: bool,
    limits: LearningLimits,
    /// Whether there are no features.
    alone: bool,
    most: usize,
    /// Of the rows, one in so many is kept.
    stride: usize,
    rows: usize,
    last: Option<Instant>,
    segment_pending: bool,
    kept: Vec<Kept>,
    regressors: Vec<f64>,
    /// Of the regressors in all rows.
    range: TrainedRange,
}

#[derive(Debug, Clone, Copy)]
struct Kept {
    at: Instant,
    truth: f64,
    /// Whether a segment begins with it, or one has between the row before and it.
    begins: bool,
}

impl KalmanTrainer {
    pub(super) fn new(setup: &TrainingSetup, parameters: Kalman) -> Self {
        let names: Vec<_> = setup
            .regressors
            .iter()
            .map(|regressor| regressor.name.clone())
            .collect();
        let bytes = size_of::<Kept>() + names.len() * size_of::<f64>();
        Self {
            every: parameters.every.unwrap_or(setup.span),
            earlier: setup.span.max(setup.ahead).max(Duration::from_ns(1)),
            follows: setup.learns,
            limits: setup.limits,
            alone: names.is_empty(),
            ahead: setup.ahead,
            span: setup.span,
            parameters,
            unit: setup.error_unit.clone(),
            most: (setup.memory / bytes).clamp(16, MOST_ROWS),
            range: TrainedRange::new(names.len()),
            names,
            stride: 1,
            rows: 0,
            last: None,
            segment_pending: true,
            kept: Vec::new(),
            regressors: Vec::new(),
        }
    }

    /// Lets every second row go.
    fn thin(&mut self) {
        let width = self.names.len();
        let mut begins = false;
        let mut kept = Vec::with_capacity(self.most);
        let mut regressors = Vec::with_capacity(self.most * width);
        for (nth, row) in self.kept.iter().enumerate() {
            begins |= row.begins;
            if nth % 2 == 0 {
                kept.push(Kept { begins, ..*row });
                regressors.extend_from_slice(&self.regressors[nth * width..(nth + 1) * width]);
                begins = false;
            }
        }
        (self.kept, self.regressors) = (kept, regressors);
        self.segment_pending |= begins;
        self.stride *= 2;
    }

    /// Lets go of regressors that stay the same in the rows that are followed, though not in all: nothing is learned of them, and
    /// without one of their values there would be no prediction.
    fn leave_out_constant(&mut self, report: &mut TrainingReport) {
        let width = self.names.len();
        if self.stride == 1 || width == 0 {
            return;
        }
        let varies = |nth: usize| {
            let mut extremes = Extremes::NONE;
            let values = self.regressors.iter().skip(nth).step_by(width);
            values.for_each(|&value| extremes.include(value));
            !extremes.is_one_value()
        };
        let varying: Vec<bool> = (0..width).map(varies).collect();
        if !varying.contains(&false) {
            return;
        }
        let places: Vec<usize> = (0..width).filter(|&nth| varying[nth]).collect();
        self.range = self.range.of(&places);
        let mut places = varying.iter().cycle();
        self.regressors.retain(|_| places.next() == Some(&true));
        let names = std::mem::take(&mut self.names).into_iter().zip(&varying);
        let (left, constant): (Vec<_>, Vec<_>) = names.partition(|(_, varies)| **varies);
        self.names = left.into_iter().map(|(name, _)| name).collect();
        let constant: Vec<String> = constant.into_iter().map(|(name, _)| name).collect();
        report.notes.push(format!(
            "the same in the rows that are followed, though not in all, so left out: {}",
            constant.join(", ")
        ));
        let constant = constant.iter().map(String::as_str);
        report.figure("constant_in_rows_followed", Figure::names(constant));
    }

    fn solve(&self, report: &mut TrainingReport) -> Result<KalmanPredictor, TrainingError> {
        let width = self.names.len();
        let mut standard = Standardizer::new(width);
        for nth in 0..self.kept.len() {
            standard.partial_fit(&self.regressors[nth * width..(nth + 1) * width]);
        }
        let standard = standard.standardization();
        let mut scaled = self.regressors.clone();
        if width > 0 {
            for row in scaled.chunks_exact_mut(width) {
                standard.apply(row);
            }
        }
        let before = std::iter::once(None).chain(self.kept.iter().map(|row| Some(row.at)));
        let times: Vec<f64> = self
            .kept
            .iter()
            .zip(before)
            .map(|(row, before)| match before {
                Some(before) if !row.begins => (row.at - before).secs(),
                _ => f64::NAN,
            })
            .collect();
        let sum: f64 = self.kept.iter().map(|row| row.truth).sum();
        let mean = sum / self.kept.len() as f64;
        let truths: Vec<f64> = self.kept.iter().map(|row| row.truth - mean).collect();
        let series = Series {
            times: &times,
            observations: &truths,
            regressors: &scaled,
            prior: prior(self.parameters.penalty),
            shared: self.every.secs(),
        };
        let movement = if self.parameters.trend {
            Movement::Trend
        } else {
            Movement::Returns
        };
        let followed = match &self.parameters.noises {
            Some(noises) => follow(noises.model(&self.unit)?, &series),
            None => most_likely(movement, Passage::Continuous, &series),
        };
        let followed = followed.map_err(|error| match error {
            NumericsError::TooFewRows { needed, found } => TrainingError::TooFewRows {
                rows: usize::try_from(found).unwrap_or(usize::MAX),
                needed: usize::try_from(needed).unwrap_or(usize::MAX),
            },
            NumericsError::NoConvergence => unsolvable(
                "the truths are predicted without any error, so there are no noises to find",
            ),
            error => unsolvable(&error.to_string()),
        })?;
        if followed.filter.is_diffuse() {
            return Err(unsolvable(
                "the rows do not determine all coefficients; with a `penalty` above 0 they need not",
            ));
        }
        self.tell_thinned(report);
        tell_rows(&self.names, &scaled, truths.iter().copied(), report);
        self.tell(followed.model, report);
        let mut filter = followed.filter;
        let beyond_numbers = || {
            unsolvable(
                "the truths or the noises are so small or so large, or the rows so far apart, that variances are beyond what numbers hold",
            )
        };
        let variances = followed.at_large.iter().map(|(_, variance)| *variance);
        let largest = variances.fold(followed.model.observation, f64::max);
        if !filter.can_restart(&followed.at_large) || largest < LEAST_VARIANCE {
            return Err(beyond_numbers());
        }
        filter.restart_level(&followed.at_large);
        if !filter.is_sound() {
            return Err(beyond_numbers());
        }
        let scaling = Scaling {
            means: standard.means,
            scales: standard.scales,
            truth: mean,
        };
        let rows = self.regressors.chunks_exact(width.max(1));
        let mut said: Vec<f64> = rows
            .map(|row| variance(&filter, width, scaling.of(row)))
            .collect();
        said.sort_by(f64::total_cmp);
        let predictor = KalmanPredictor {
            memory: self.parameters.memory,
            little: LITTLE * said.get(said.len() / 2).copied().unwrap_or(0.0),
            regressors: self.names.clone(),
            scaling,
            filter,
            at_large: followed.at_large,
            every: self.every,
            range: Some(self.range.clone()),
            novelty: novelty_of_rows(width, &self.regressors),
        };
        report.in_sample_rmse = self.in_sample_rmse(&predictor);
        Ok(predictor)
    }

    /// The error of predicting each row as `evaluate` does: the horizon ahead, from the truths that the embargo lets through and that
    /// are no outliers; none where no row is predicted.
    fn in_sample_rmse(&self, predictor: &KalmanPredictor) -> Option<f64> {
        let width = self.names.len();
        let row = |nth: usize| &self.regressors[nth * width..(nth + 1) * width];
        let mut following = Following::new(predictor);
        let mut gate = LearningGate::new(self.limits, self.span, &mut following);
        let mut withheld = VecDeque::<usize>::new();
        let (mut squares, mut count) = (0.0, 0_u64);
        let mut first = Instant::MIN;
        for (nth, kept) in self.kept.iter().enumerate() {
            let newest = if kept.begins {
                Instant::MAX
            } else {
                kept.at - self.earlier
            };
            while let Some(&next) = withheld.front()
                && self.kept[next].at <= newest
            {
                let Kept { at, truth, .. } = self.kept[next];
                gate.offer(&mut following, predictor, row(next), truth, at);
                withheld.pop_front();
            }
            if kept.begins {
                let shift = nth.checked_sub(1).map(|last| kept.at - self.kept[last].at);
                following.segment(shift.unwrap_or(Duration::ZERO));
                gate.segment(shift.unwrap_or(Duration::ZERO));
                first = kept.at + self.ahead;
            }
            // Without features rows are truths, of which the first ones come before what the first run predicts.
            if self.alone && kept.at < first {
                continue;
            }
            let predicted = gate.speaker(&following, kept.at).predict(row(nth), kept.at);
            squares += (predicted - kept.truth).powi(2);
            count += 1;
            if self.follows {
                withheld.push_back(nth);
            }
        }
        (count > 0).then(|| (squares / count as f64).sqrt())
    }

    fn tell(&self, model: Structural, report: &mut TrainingReport) {
        if self.parameters.noises.is_none() {
            let unit = self.unit.parse::<Unit>().map(|unit| unit.difference());
            let unit = unit.map_or_else(|_| self.unit.clone(), |unit| unit.to_string());
            let hourly = Hourly::of(&model);
            report.figure("noises", hourly.figure());
            let noises = hourly.as_given(&unit);
            report
                .notes
                .push(format!("most likely are noises = {noises}"));
            if let Some(all) = hourly.fades_within(self.typical_gap_s()) {
                report.figure("observation_with_level", all);
                report.notes.push(format!(
                    "the level is gone before the next truth, so that only what it makes with the observation is known, {} {unit}",
                    digits(all, 3)
                ));
            }
            if hourly.is_still() {
                report.notes.push(
                    "the level does not move: the rows are as likely without a noise of it"
                        .to_owned(),
                );
            }
        }
    }

    /// The typical time from one row to the next.
    fn typical_gap_s(&self) -> f64 {
        let pairs = self.kept.windows(2).filter(|pair| !pair[1].begins);
        let mut gaps: Vec<Duration> = pairs.map(|pair| pair[1].at - pair[0].at).collect();
        gaps.sort_unstable();
        gaps.get(gaps.len() / 2).map_or(f64::NAN, |gap| gap.secs())
    }

    /// All that is reported of the fit is of the rows that it goes through.
    fn tell_thinned(&self, report: &mut TrainingReport) {
        if self.stride == 1 {
            return;
        }
        report.figure("rows_apart", self.stride);
        report.figure("rows_followed", self.kept.len());
        let found = match &self.parameters.noises {
            Some(_) => "coefficients",
            None => "variances and coefficients",
        };
        let more = match self.most {
            MOST_ROWS => "",
            _ => "; a larger `--memory` lets it follow more",
        };
        report.notes.push(format!(
            "{found} were found on {} rows, one in {} of all; RMSE, condition number and what is said of regressors are of these alone{more}",
            self.kept.len(),
            self.stride
        ));
    }
}

impl Trainer for KalmanTrainer {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        // Without an instant, rows lie as far apart as they must.
        let at = self
            .last
            .map_or(Instant::from_ns(0), |last| last + self.every);
        self.row_at(at, regressors, truth);
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        self.last = Some(at);
        self.rows += 1;
        self.range.include(regressors);
        if !(self.rows - 1).is_multiple_of(self.stride) {
            return;
        }
        if self.kept.len() == self.most {
            self.thin();
        }
        let begins = std::mem::take(&mut self.segment_pending);
        self.kept.push(Kept { at, truth, begins });
        self.regressors.extend_from_slice(regressors);
    }

    fn segment(&mut self) {
        self.segment_pending = true;
        self.last = None;
    }

    fn finish(mut self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        self.leave_out_constant(&mut report);
        let predictor = self.solve(&mut report)?;
        Ok(Trained {
            predictor: Box::new(predictor),
            report,
        })
    }
}

/// The prior variance of coefficients; beyond a bound nothing is known of them, since the filter takes differences of variances.
fn prior(penalty: f64) -> f64 {
    const LEAST: f64 = 1e-10;
    if penalty < LEAST {
        f64::INFINITY
    } else {
        1.0 / penalty
    }
}

fn unsolvable(reason: &str) -> TrainingError {
    TrainingError::Unsolvable {
        reason: reason.to_owned(),
    }
}

impl Noises {
    /// The model that has these noises, its unit of time the second.
    fn model(&self, unit: &str) -> Result<Structural, TrainingError> {
        let of_truth: Unit = unit
            .parse()
            .map_err(|_| unsolvable("the unit of the truth is not known"))?;
        let in_unit = |given: &Quantity| {
            given
                .as_difference(&of_truth)
                .ok_or_else(|| unsolvable("a noise is in another unit than the truth"))
        };
        let per = self.per.secs();
        let level = in_unit(&self.level)?;
        let trend = self.trend.as_ref();
        let trend = trend.map(in_unit).transpose()?;
        Ok(Structural {
            observation: in_unit(&self.observation)?.powi(2),
            level: level * level / per,
            trend: trend.map(|trend| (trend / per).powi(2) / per),
            returning: self.returns.map_or(0.0, |returns| 1.0 / returns.secs()),
            passage: Passage::Continuous,
        })
    }
}

#[cfg(test)]
mod tests {
    use athermal_core::node::{Estimator, LearningLimits, Regressor};

    use super::*;

    fn setup(regressors: &[&str]) -> TrainingSetup {
        let regressor = |name: &&str| Regressor {
            name: (*name).to_owned(),
            unit: "K".to_owned(),
            sensors: vec![(*name).to_owned()],
            lag: Duration::ZERO,
            of_truth: false,
        };
        TrainingSetup {
            instance: "thermal".to_owned(),
            regressors: regressors.iter().map(regressor).collect(),
            places: (0..regressors.len()).collect(),
            error_unit: "nm".to_owned(),
            memory: 0,
            ahead: Duration::ZERO,
            span: Duration::ZERO,
            learns: true,
            limits: LearningLimits::NONE,
        }
    }

    /// A fit of forty truths, 300 s apart.
    fn fitted(parameters: &Kalman, truth: impl Fn(f64) -> f64) -> Result<Trained, TrainingError> {
        let mut trainer = parameters.trainer(&TrainingSetup {
            memory: 1 << 20,
            ..setup(&[])
        });
        for nth in 0..40_i32 {
            let at = Instant::from_ns(i64::from(nth) * 300_000_000_000);
            trainer.row_at(at, &[], truth(f64::from(nth)));
        }
        trainer.finish()
    }

    #[test]
    fn whatever_noises_are_given_a_fit_ends_in_a_model_or_in_words() {
        let quantity = |value: f64| Quantity {
            value,
            unit: "nm".parse().unwrap(),
        };
        for observation in [1e-170, 1e-6, 1.0, 1e170] {
            for trend in [0.0, 1e3, 1e6, 1e12, 1e170] {
                let parameters = Kalman {
                    trend: true,
                    noises: Some(Noises {
                        observation: quantity(observation),
                        level: quantity(0.0),
                        trend: Some(quantity(trend)),
                        per: Duration::from_ns(1_000_000_000),
                        returns: None,
                    }),
                    penalty: 1.0,
                    every: None,
                    memory: Duration::from_ns(86_400_000_000_000),
                };
                for truth in [|_: f64| 12.0, f64::sin] {
                    match fitted(&parameters, truth) {
                        Ok(trained) => assert!(trained.predictor.mistakes().is_empty()),
                        Err(error) => assert!(error.to_string().contains(' ')),
                    }
                }
            }
        }
    }

    #[test]
    fn truths_whose_squares_are_no_numbers_are_refused() {
        let parameters = Kalman {
            trend: true,
            noises: None,
            penalty: 1.0,
            every: None,
            memory: Duration::from_ns(86_400_000_000_000),
        };
        let refused = fitted(&parameters, |nth| 1e-160 * (7.0 * nth * nth).sin());
        let told = refused.map(|_| ()).unwrap_err().to_string();
        assert!(told.contains("so small or so large"), "{told}");
    }

    #[test]
    fn what_is_the_same_in_the_rows_that_are_kept_is_not_needed_to_predict() {
        let parameters = Kalman {
            trend: false,
            noises: None,
            penalty: 1.0,
            every: None,
            memory: Duration::from_ns(86_400_000_000_000),
        };
        let mut trainer = parameters.trainer(&setup(&["a", "seldom"]));
        for nth in 0..100_i32 {
            let a = f64::from(nth * 37 % 11);
            // Rows with an odd number are the first to go.
            let seldom = f64::from(nth % 2);
            let noise = f64::from(nth * 7919 % 23) / 23.0;
            let at = Instant::from_ns(i64::from(nth) * 1_000_000_000);
            trainer.row_at(at, &[a, seldom], 2.0 * a + noise);
        }
        let Trained { predictor, report } = trainer.finish().unwrap();
        assert_eq!(predictor.uses(), ["a"]);
        assert_eq!(
            report.figures.get("constant_in_rows_followed"),
            Some(&Figure::names(["seldom"]))
        );
        assert!(predictor.predict(&[3.0]).is_finite());
    }

    #[test]
    fn a_level_that_is_gone_before_the_next_truth_is_told_as_part_of_the_observation() {
        // 6 nm in an hour that return within 4 s: a variance of 6² / 3600 · 4 / 2 = 0.02 nm², beside 0.05² nm².
        let model = Structural {
            observation: 0.0025,
            level: 36.0 / 3600.0,
            trend: None,
            returning: 0.25,
            passage: Passage::Continuous,
        };
        let hourly = Hourly::of(&model);
        let all = hourly.fades_within(420.0).unwrap();
        assert!((all - 0.15).abs() < 1e-12, "{all}");
        assert_eq!(hourly.fades_within(10.0), None);
        assert_eq!(hourly.fades_within(f64::NAN), None);
    }
}
