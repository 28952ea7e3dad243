//! Sequential forward selection by cross-validation. Decides the order in which regressors are taken and when to stop;
//! does not decide how rows are cut into folds, nor the final coefficients.

use crate::fold_state::FoldState;
use crate::{GramBlocks, NumericsError, Split, leave_one_out};
use serde::{Deserialize, Serialize};

/// What is averaged over the folds; larger is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectionScore {
    /// `1 − Σe² / Σ(y − ȳ)²` with the mean of the test rows; where the target is constant in them, 1 without any
    /// error and else 0.
    #[default]
    R2,
    /// Minus the root of the mean squared error, in the target's unit.
    NegativeRmse,
}

/// Takes, step by step, the regressor that improves the mean test score most.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForwardSelection {
    /// The ridge penalty on the sum of squares in the scaled columns; 0 for ordinary least squares.
    pub alpha: f64,
    /// Stop before a step that gains less; without it go on to the end.
    pub tolerance: Option<f64>,
    /// Take at most so many; without it, all.
    pub max_features: Option<usize>,
    /// What is averaged over the folds.
    pub score: SelectionScore,
}

/// A candidate's score at one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CandidateScore {
    /// The candidate's column.
    pub column: usize,
    /// Its mean score over the folds; NaN when it is a combination of the chosen ones or constant in all folds.
    pub mean: f64,
}

/// One step: the best candidate, and all that were tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SelectionStep {
    /// The best candidate's column, the lowest one on a tie.
    pub column: usize,
    /// Its mean score over the folds.
    pub mean: f64,
    /// Its score in each fold.
    pub folds: Vec<f64>,
    /// All candidates of this step, by column.
    pub candidates: Vec<CandidateScore>,
}

/// What a selection took, and why it stopped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    /// The steps taken, in order.
    pub steps: Vec<SelectionStep>,
    /// The step that was not taken because it gained less than the tolerance.
    pub refused: Option<SelectionStep>,
}

impl Selection {
    /// The chosen columns in the order in which they were taken.
    pub fn order(&self) -> Vec<usize> {
        self.steps.iter().map(|step| step.column).collect()
    }
}

impl ForwardSelection {
    /// Ordinary least squares, R², all regressors in order of merit.
    pub fn ordinary() -> Self {
        Self {
            alpha: 0.0,
            tolerance: None,
            max_features: None,
            score: SelectionScore::R2,
        }
    }

    /// Selects with `folds` contiguous folds, each scored by a model of the others (at least two folds).
    /// `scales` has one positive value per regressor, the same in all folds; see [`crate::Standardization`].
    ///
    /// # Errors
    /// See [`ForwardSelection::over`]; also [`NumericsError::Folds`] when there are too few rows.
    pub fn run(
        &self,
        blocks: &GramBlocks,
        folds: usize,
        scales: &[f64],
    ) -> Result<Selection, NumericsError> {
        self.over(&leave_one_out(&blocks.folds(folds)?)?, scales)
    }

    /// Selects over any pairs of training and test statistics. Each fold's model has its own intercept.
    ///
    /// # Errors
    /// [`NumericsError::Parameter`] for a penalty or tolerance out of range, [`NumericsError::Scale`],
    /// [`NumericsError::Width`], [`NumericsError::NotFinite`], [`NumericsError::Folds`] without any fold or with an empty
    /// one.
    pub fn over(&self, splits: &[Split], scales: &[f64]) -> Result<Selection, NumericsError> {
        self.check(splits, scales)?;
        let mut folds: Vec<FoldState> = splits
            .iter()
            .map(|split| FoldState::new(split, scales, self.alpha))
            .collect();
        let mut remaining: Vec<usize> = (0..scales.len()).collect();
        let most = self.max_features.unwrap_or(usize::MAX);
        let mut selection = Selection {
            steps: Vec::new(),
            refused: None,
        };
        let mut reached = f64::NEG_INFINITY;
        while selection.steps.len() < most {
            let Some(step) = self.best(&folds, &remaining) else {
                break;
            };
            // Negated so that a gain of NaN stops too.
            let gains_enough = |tolerance: f64| step.mean - reached >= tolerance;
            if !self.tolerance.is_none_or(gains_enough) {
                selection.refused = Some(step);
                break;
            }
            reached = step.mean;
            remaining.retain(|&column| column != step.column);
            for fold in &mut folds {
                fold.include(step.column);
            }
            selection.steps.push(step);
        }
        Ok(selection)
    }

    fn best(&self, folds: &[FoldState], remaining: &[usize]) -> Option<SelectionStep> {
        let mut candidates = Vec::with_capacity(remaining.len());
        let mut best: Option<CandidateScore> = None;
        for &column in remaining {
            let mean = if folds.iter().any(|fold| fold.varies(column)) {
                let sum: f64 = folds.iter().map(|f| f.score(column, self.score)).sum();
                sum / folds.len() as f64
            } else {
                f64::NAN
            };
            let candidate = CandidateScore { column, mean };
            if mean.is_finite() && best.is_none_or(|b| mean > b.mean) {
                best = Some(candidate);
            }
            candidates.push(candidate);
        }
        best.map(|CandidateScore { column, mean }| SelectionStep {
            column,
            mean,
            folds: folds.iter().map(|f| f.score(column, self.score)).collect(),
            candidates,
        })
    }

    fn check(&self, splits: &[Split], scales: &[f64]) -> Result<(), NumericsError> {
        if !(self.alpha >= 0.0 && self.alpha.is_finite()) {
            return Err(NumericsError::Parameter {
                name: "alpha",
                value: self.alpha,
                allowed: "finite and not negative",
            });
        }
        if let Some(tolerance) = self.tolerance.filter(|t| t.is_nan()) {
            return Err(NumericsError::Parameter {
                name: "tolerance",
                value: tolerance,
                allowed: "a number",
            });
        }
        for (column, &scale) in scales.iter().enumerate() {
            if !(scale > 0.0 && scale.is_finite()) {
                return Err(NumericsError::Scale { column, scale });
            }
        }
        if splits.is_empty() {
            return Err(NumericsError::Folds { folds: 0, rows: 0 });
        }
        for gram in splits.iter().flat_map(|split| [&split.train, &split.test]) {
            if gram.width() != scales.len() {
                return Err(NumericsError::Width {
                    expected: gram.width(),
                    found: scales.len(),
                });
            }
            if gram.count() == 0 {
                return Err(NumericsError::Folds {
                    folds: splits.len(),
                    rows: 0,
                });
            }
            if !gram.is_finite() {
                return Err(NumericsError::NotFinite);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LeastSquares, oracle};

    fn oracle_blocks(row_memory: usize) -> Option<GramBlocks> {
        let input = oracle::table("sfs/input.csv")?;
        let mut blocks = GramBlocks::with_row_memory(12, row_memory);
        for row in input.numbers() {
            blocks.push(&row[..12], row[12]);
        }
        Some(blocks)
    }

    fn named(config: &str) -> ForwardSelection {
        let mut how = ForwardSelection::ordinary();
        if config == "ols_negrmse" {
            how.score = SelectionScore::NegativeRmse;
        }
        if config == "ridge10_r2" {
            how.alpha = 10.0;
        }
        how
    }

    #[test]
    fn every_score_of_every_step_is_that_of_the_oracle() {
        let Some(blocks) = oracle_blocks(1 << 20) else {
            return;
        };
        let steps = oracle::table("sfs/steps.csv").unwrap();
        assert_eq!(steps.header[3..6], ["fold0", "fold1", "fold2"]);
        let mut compared = 0;
        for config in ["ols_r2", "ols_negrmse", "ridge10_r2"] {
            let found = named(config).run(&blocks, 3, &[1.0; 12]).unwrap();
            assert_eq!(found.steps.len(), 12);
            for (record, numbers) in steps.records.iter().zip(steps.numbers()) {
                if record[0] != config {
                    continue;
                }
                let step = &found.steps[numbers[1] as usize];
                let column = numbers[2] as usize;
                let candidate = step.candidates.iter().find(|c| c.column == column).unwrap();
                assert!((candidate.mean - numbers[6]).abs() < 1e-10);
                assert_eq!(step.column == column, numbers[7] == 1.0);
                if step.column == column {
                    for (score, wanted) in step.folds.iter().zip(&numbers[3..6]) {
                        assert!((score - wanted).abs() < 1e-10);
                    }
                }
                compared += 1;
            }
        }
        assert_eq!(compared, 3 * 12 * 13 / 2);
    }

    #[test]
    fn a_tolerance_stops_where_the_oracle_stops() {
        let Some(blocks) = oracle_blocks(1 << 20) else {
            return;
        };
        // `auto` of sfs/selected.json, in columns.
        let expected: [(&str, f64, &[usize]); 6] = [
            ("ols_r2", 0.01, &[0, 2, 5, 7, 9]),
            ("ols_r2", 0.001, &[0, 2, 4, 5, 7, 9]),
            ("ols_r2", 0.0001, &[0, 2, 4, 5, 6, 7, 9]),
            ("ols_negrmse", 0.01, &[0, 2, 4, 5, 7, 9]),
            ("ridge10_r2", 0.01, &[0, 2, 5, 7, 9]),
            ("ridge10_r2", 0.0001, &[0, 2, 4, 5, 7, 9]),
        ];
        for (config, tolerance, columns) in expected {
            let how = ForwardSelection {
                tolerance: Some(tolerance),
                max_features: Some(11),
                ..named(config)
            };
            let found = how.run(&blocks, 3, &[1.0; 12]).unwrap();
            let mut order = found.order();
            order.sort_unstable();
            assert_eq!(order, columns, "{config} {tolerance}");
            let refused = found.refused.unwrap();
            assert!(refused.mean - found.steps[columns.len() - 1].mean < tolerance);
        }
    }

    fn sine(i: u32, rate: f64) -> f64 {
        (rate * f64::from(i) * (1.0 + 1e-3 * f64::from(i))).sin()
    }

    #[test]
    fn each_step_scores_what_a_fit_of_the_training_folds_predicts() {
        let scales = [0.5, 2.0, 1.5];
        let rows: Vec<([f64; 3], f64)> = (0..900)
            .map(|i| {
                let x = [
                    sine(i, 0.37),
                    sine(i, 0.11) + 3.0,
                    sine(i, 0.023) - 0.5 * sine(i, 0.37),
                ];
                (x, x[0] - 2.0 * x[2] + 0.3 * sine(i, 1.7))
            })
            .collect();
        let mut blocks = GramBlocks::new(3);
        for (x, y) in &rows {
            blocks.push(x, *y);
        }
        let how = ForwardSelection {
            alpha: 40.0,
            score: SelectionScore::NegativeRmse,
            ..ForwardSelection::ordinary()
        };
        let found = how.run(&blocks, 3, &scales).unwrap();
        let splits = leave_one_out(&blocks.folds(3).unwrap()).unwrap();
        for (taken, step) in found.steps.iter().enumerate() {
            let columns = &found.order()[..=taken];
            for (fold, split) in splits.iter().enumerate() {
                let fit = LeastSquares::ridge(40.0);
                let fit = fit.solve(&split.train, columns, &scales, None).unwrap();
                let test = &rows[fold * 300..(fold + 1) * 300];
                let squares: f64 = test.iter().map(|(x, y)| (fit.predict(x) - y).powi(2)).sum();
                assert!((step.folds[fold] + (squares / 300.0).sqrt()).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_copy_of_a_chosen_column_is_never_chosen_and_the_lower_index_wins_the_tie() {
        let mut blocks = GramBlocks::new(4);
        for i in 0..600 {
            let (a, b) = (sine(i, 0.37), sine(i, 0.11));
            blocks.push(&[b, a, a, 5.0], 3.0 * a + b + 0.1 * sine(i, 1.9));
        }
        let found = ForwardSelection::ordinary()
            .run(&blocks, 3, &[1.0; 4])
            .unwrap();
        assert_eq!(found.order(), [1, 0]);
        let copy = found.steps[1].candidates.iter().find(|c| c.column == 2);
        assert!(copy.unwrap().mean.is_nan());
    }

    #[test]
    fn a_column_that_is_constant_in_one_training_set_counts_nothing_there() {
        let mut blocks = GramBlocks::new(2);
        for i in 0..600 {
            let step = if i < 200 { sine(i, 0.37) } else { 0.25 };
            blocks.push(&[step, sine(i, 0.11)], 2.0 * step + sine(i, 0.11));
        }
        let found = ForwardSelection::ordinary()
            .run(&blocks, 3, &[1.0; 2])
            .unwrap();
        assert_eq!(found.order(), [1, 0]);
        assert_eq!(found.steps[1].folds[0], found.steps[0].folds[0]);
        assert!(found.steps[1].folds[1] > found.steps[0].folds[1]);
    }

    #[test]
    fn wrong_requests_are_refused() {
        let mut blocks = GramBlocks::new(1);
        for i in 0..10 {
            blocks.push(&[sine(i, 0.37)], sine(i, 0.11));
        }
        let how = ForwardSelection::ordinary();
        assert!(how.run(&blocks, 11, &[1.0]).is_err());
        assert!(how.run(&blocks, 2, &[1.0, 1.0]).is_err());
        assert!(how.run(&blocks, 2, &[0.0]).is_err());
        let bad = ForwardSelection {
            alpha: f64::NAN,
            ..how
        };
        assert!(bad.run(&blocks, 2, &[1.0]).is_err());
        blocks.push(&[f64::NAN], 1.0);
        assert_eq!(how.run(&blocks, 2, &[1.0]), Err(NumericsError::NotFinite));
    }
}
