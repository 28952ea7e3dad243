//! Selection of regressors by cross-validation. Decides what a search is asked for and what it tells; how rows are cut into
//! folds and the final coefficients are found elsewhere.

mod candidates;
mod fold_state;
mod search;
mod stepwise;

pub use candidates::Candidates;
pub use search::{Direction, Search};
pub use stepwise::{Stepwise, StepwiseSelection, StepwiseStep};

use serde::{Deserialize, Serialize};

/// What is averaged over the folds; larger is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SelectionScore {
    /// `1 − Σe² / Σ(y − ȳ)²` with the mean of the test rows, over the folds in which the target has a spread beside that of all test
    /// rows; where it is constant in each, 1 without any error and else 0.
    #[default]
    R2,
    /// Minus the root of the mean squared error, in the target's unit.
    NegativeRmse,
}

/// Whether a step adds or takes away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// A candidate joined.
    Added,
    /// A unit was taken out.
    Removed,
}

/// A candidate's score at one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CandidateScore {
    /// The candidate, as [`Candidates`] counts them; the column where columns stand for themselves.
    pub candidate: usize,
    /// Its mean score over the folds; NaN when it is a combination of the chosen ones or constant in all folds.
    pub mean: f64,
}

/// One step: the best candidate, and all that were tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SelectionStep {
    /// The best candidate, the lowest one on a tie.
    pub candidate: usize,
    /// What was done with it.
    pub change: Change,
    /// The mean score over the folds once that is done.
    pub mean: f64,
    /// The score in each fold.
    pub folds: Vec<f64>,
    /// All candidates of this step, in their order.
    pub candidates: Vec<CandidateScore>,
}

/// What a selection did, and why it stopped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Selection {
    /// The score of what was there before the first step: of all units together on the way back, else of the columns that
    /// need none; nothing where there are no such columns.
    pub start: Option<Start>,
    /// The steps taken, in order.
    pub steps: Vec<SelectionStep>,
    /// The step that was not taken because of the tolerance.
    pub refused: Option<SelectionStep>,
    /// The columns chosen by all steps, in the order in which they came.
    pub columns: Vec<usize>,
    /// The columns chosen after each step, the start counted where there is one.
    path: Vec<Vec<usize>>,
    /// The folds that have no part in any mean, since the target has no spread in their test rows beside that of all.
    pub quiet: Vec<usize>,
    /// How many sets at the beginning of the path have more units than were asked for.
    too_large: usize,
}

/// The score from which a search starts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// The mean over the folds.
    pub mean: f64,
    /// The score in each fold.
    pub folds: Vec<f64>,
    /// Columns left out from the start, since they are combinations of those before them.
    pub left_out: Vec<usize>,
}

/// The smallest set on the way that is as good as the best.
#[derive(Debug, Clone, PartialEq)]
pub struct Smallest {
    /// The columns.
    pub columns: Vec<usize>,
    /// After how many steps they were chosen.
    pub steps: usize,
    /// The mean score of the best set on the way.
    pub best: f64,
    /// The standard error of that mean over its folds.
    pub standard_error: f64,
}

impl Selection {
    /// The smallest set on the way whose mean score is within one standard error of the best (Breiman et al. 1984, section
    /// 3.4.3); of several as small the best. Nothing without a step.
    ///
    /// A search backwards comes to the smaller sets last, so it must have gone on to its end, without a tolerance.
    pub fn within_one_standard_error(&self) -> Option<Smallest> {
        let start = self.start.iter().map(|start| (start.mean, &start.folds));
        let steps = self.steps.iter().map(|step| (step.mean, &step.folds));
        let scores: Vec<(f64, &Vec<f64>)> = start.chain(steps).collect();
        let &(best, folds) = scores
            .get(self.too_large..)?
            .iter()
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        let n = folds.len() as f64;
        let spread: f64 = folds.iter().map(|score| (score - best).powi(2)).sum();
        let standard_error = if folds.len() > 1 {
            (spread / (n - 1.0) / n).sqrt()
        } else {
            0.0
        };
        let near =
            (self.too_large..scores.len()).filter(|&at| scores[at].0 >= best - standard_error);
        let smallest = near.min_by(|&a, &b| {
            let size = self.path[a].len().cmp(&self.path[b].len());
            size.then(scores[b].0.total_cmp(&scores[a].0))
        })?;
        Some(Smallest {
            columns: self.path[smallest].clone(),
            steps: smallest + usize::from(self.start.is_none()),
            best,
            standard_error,
        })
    }
}

#[cfg(test)]
mod tests;
