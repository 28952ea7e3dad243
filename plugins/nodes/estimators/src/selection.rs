//! Decides how a user asks for a selection of regressors, and how it is run and reported.

use athermal_core::node::{CandidateScore, Figure, Regressor, SelectionStep, TrainingReport};
use athermal_numerics::{
    Candidates, Change, Direction, GramBlocks, NumericsError, Search, SelectionScore, Stepwise,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::folds::{Folds, tell_moved, tell_quiet};

/// How regressors are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "method", rename_all = "snake_case", deny_unknown_fields)]
pub enum Selection {
    /// From nothing on, the regressor that raises the mean R² over the folds most is added, of several equal ones the
    /// first, until the gain is below the tolerance. One is always taken, whatever it gains. A fold in which the variance of the truth
    /// is below 1e-12 of that in all of them has no part in the mean.
    Forward(CrossValidated),
    /// From all regressors on, the one that is missed least is taken out, until that loses more than the tolerance.
    Backward(CrossValidated),
    /// Forward, and after each step back for as long as that gives a better set than any of that size before. A set
    /// that came past that size, with several sensors at once, stands there too (Pudil, Novovičová and Kittler 1994).
    Floating(CrossValidated),
    /// By F-tests on all rows: the most significant regressor enters, those that have lost their significance leave
    /// (Efroymson 1960; for thermal errors Chen 1996). It takes rows for independent, which those of a drift are not: it
    /// tends to take too many.
    Stepwise {
        /// The least F with which a regressor enters.
        #[serde(default = "four")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        f_enter: f64,
        /// A regressor whose F is below this share of `f_enter` leaves; above 0 up to 1.
        #[serde(default = "a_little_below")]
        #[schemars(range(max = 1.0), extend("exclusiveMinimum" = 0.0))]
        leave_share: f64,
        /// The most regressors to choose; without it there is no limit.
        #[serde(default)]
        #[schemars(range(min = 1))]
        most: Option<usize>,
    },
}

/// How a cross-validated selection goes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
pub struct CrossValidated {
    /// How the rows are cut: a number of contiguous folds, 2 to 1000, or a table such as
    /// `{ type = "blocked", count = 5, gap_rows = 4, embargo_rows = 8 }` or `{ type = "expanding", count = 5 }`.
    #[serde(default = "Folds::three")]
    pub folds: Folds,
    /// The smallest gain that is worth another regressor or sensor, or the largest loss at which one is taken out. Sensors that
    /// come together must gain so much each, and that much more than fewer of them.
    #[serde(default = "thousandth")]
    pub tolerance: f64,
    /// The most regressors or sensors to end with; without it there is no limit.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub most: Option<usize>,
    /// What comes and goes at a time: a `regressor`, or a `sensor` with all regressors that are made from it.
    #[serde(default)]
    pub by: By,
    /// Go back to the smallest set on the way whose score is within one standard error of the best (Breiman et al. 1984).
    /// Backwards the way then goes on to the last one, whatever the tolerance, since smaller sets come later.
    #[serde(default)]
    pub one_standard_error: bool,
}

/// What a selection takes or leaves at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum By {
    /// One regressor.
    #[default]
    Regressor,
    /// A measured channel, with all regressors that are made from it; one made from several needs them all.
    Sensor,
}

fn thousandth() -> f64 {
    1e-3
}

fn four() -> f64 {
    4.0
}

fn a_little_below() -> f64 {
    0.975
}

impl Selection {
    /// By F-tests with the usual thresholds.
    pub(crate) fn stepwise() -> Self {
        Self::Stepwise {
            f_enter: four(),
            leave_share: a_little_below(),
            most: None,
        }
    }

    /// Into how many parts it cuts the rows.
    pub(crate) fn parts(&self) -> usize {
        match self {
            Self::Forward(how) | Self::Backward(how) | Self::Floating(how) => {
                how.folds.cut().parts()
            }
            Self::Stepwise { .. } => 1,
        }
    }

    /// The columns chosen with this penalty, in order; the steps go into the report.
    pub(crate) fn run(
        &self,
        regressors: &[Regressor],
        blocks: &GramBlocks,
        scales: &[f64],
        alpha: f64,
        report: &mut TrainingReport,
    ) -> Result<Vec<usize>, NumericsError> {
        let (direction, how) = match *self {
            Self::Forward(how) => (Direction::Forward, how),
            Self::Backward(how) => (Direction::Backward, how),
            Self::Floating(how) => (Direction::Floating, how),
            Self::Stepwise {
                f_enter,
                leave_share,
                most,
            } => {
                let how = Stepwise {
                    enter: f_enter,
                    remove: leave_share * f_enter,
                    most,
                };
                return stepwise(how, regressors, blocks, scales, report);
            }
        };
        let to_the_end = direction == Direction::Backward && how.one_standard_error;
        let search = Search {
            direction,
            alpha,
            tolerance: (!to_the_end).then_some(how.tolerance),
            most: how.most,
            score: SelectionScore::R2,
        };
        let (candidates, names) = how.by.candidates(regressors);
        let splits = blocks.splits(&how.folds.cut())?;
        let selected = search.over(&splits, scales, &candidates)?;
        tell_moved(blocks, report);
        tell_quiet(&selected.quiet, splits.len(), report);
        let name = |candidate: usize| {
            let units = candidates.units_of(candidate).iter();
            let names: Vec<&str> = units.map(|&unit| names[unit].as_str()).collect();
            names.join(" + ")
        };
        let of_step = |step: &athermal_numerics::SelectionStep| SelectionStep {
            regressor: name(step.candidate),
            removed: step.change == Change::Removed,
            score: step.mean,
            folds: step.folds.clone(),
            candidates: tried(&step.candidates, &name),
        };
        report.selection = selected.steps.iter().map(of_step).collect();
        report.refused = selected.refused.as_ref().map(of_step);
        if let Some(start) = &selected.start {
            let (figure, of) = match direction {
                Direction::Backward => ("r2_of_all_regressors", "all regressors together have"),
                _ => (
                    "r2_without_sensors",
                    "regressors that read no sensor are always there and alone have",
                ),
            };
            report.figure(figure, start.mean);
            report.notes.push(format!("{of} R² {:.4}", start.mean));
            if !start.left_out.is_empty() {
                let names: Vec<&str> = start
                    .left_out
                    .iter()
                    .map(|&column| regressors[column].name.as_str())
                    .collect();
                report.notes.push(format!(
                    "combinations of the regressors before them, so left out from the start: {}",
                    names.join(", ")
                ));
                report.figure("left_out_from_start", Figure::names(names));
            }
        }
        if !regressors.is_empty() {
            tell_worse_than_mean(&selected, report);
        }
        if how.one_standard_error
            && let Some(smallest) = selected.within_one_standard_error()
        {
            let after = match smallest.steps {
                0 => "before the first step".to_owned(),
                1 => "after the first step".to_owned(),
                steps => format!("after {steps} of {} steps", selected.steps.len()),
            };
            report.figure("steps_taken", smallest.steps);
            report.figure("standard_error_of_best", smallest.standard_error);
            report.figure("best_r2", smallest.best);
            report.notes.push(format!(
                "the set {after} is the smallest within one standard error ({:.4}) of the best R² {:.4}",
                smallest.standard_error, smallest.best
            ));
            return Ok(smallest.columns);
        }
        Ok(selected.columns)
    }
}

/// Tells of a search in which nothing was better than no regressor at all.
fn tell_worse_than_mean(selected: &athermal_numerics::Selection, report: &mut TrainingReport) {
    let start = selected.start.iter().map(|start| start.mean);
    let steps = selected.steps.iter().map(|step| step.mean);
    let best = start.chain(steps).reduce(f64::max);
    if let Some(best) = best.filter(|best| *best < 0.0) {
        report.figure("best_r2", best);
        report.notes.push(format!(
            "no choice of regressors that was tried predicts the folds better than their mean does: R² is {best:.4} at best"
        ));
    }
}

impl By {
    /// The candidates, and the names of their units.
    fn candidates(self, regressors: &[Regressor]) -> (Candidates, Vec<String>) {
        if self == Self::Regressor {
            let names = regressors.iter().map(|regressor| regressor.name.clone());
            return (Candidates::columns(regressors.len()), names.collect());
        }
        let mut sensors: Vec<String> = Vec::new();
        let mut needs = Vec::new();
        for regressor in regressors {
            let of = regressor.sensors.iter().map(|sensor| {
                sensors
                    .iter()
                    .position(|known| known == sensor)
                    .unwrap_or_else(|| {
                        sensors.push(sensor.clone());
                        sensors.len() - 1
                    })
            });
            needs.push(of.collect());
        }
        (Candidates::of_units(needs), sensors)
    }
}

fn tried(
    candidates: &[athermal_numerics::CandidateScore],
    name: &impl Fn(usize) -> String,
) -> Vec<CandidateScore> {
    let scored = candidates.iter().filter(|tried| tried.mean.is_finite());
    let mut scored: Vec<CandidateScore> = scored
        .map(|tried| CandidateScore {
            name: name(tried.candidate),
            score: tried.mean,
        })
        .collect();
    scored.sort_by(|a, b| b.score.total_cmp(&a.score));
    scored
}

fn stepwise(
    how: Stepwise,
    regressors: &[Regressor],
    blocks: &GramBlocks,
    scales: &[f64],
    report: &mut TrainingReport,
) -> Result<Vec<usize>, NumericsError> {
    let selected = how.run(&blocks.total(), scales)?;
    let name = |column: usize| regressors[column].name.clone();
    let of_step = |step: &athermal_numerics::StepwiseStep| SelectionStep {
        regressor: name(step.column),
        removed: step.change == Change::Removed,
        score: step.r2,
        folds: Vec::new(),
        candidates: tried(&step.candidates, &name),
    };
    report.selection = selected.steps.iter().map(of_step).collect();
    report.refused = selected.refused.as_ref().map(of_step);
    report.notes.push(
        "chosen by F-tests: the R² are of the rows of the fit, the candidates' figures are their F"
            .to_owned(),
    );
    Ok(selected.columns)
}
