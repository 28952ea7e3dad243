//! Decides how a user states the penalty of ridge, and how the best of several is found.

use athermal_core::node::{Forms, Mistake, TrainingReport};
use athermal_numerics::{
    GramBlocks, NumericsError, cross_validated_penalties, generalised_cross_validation,
    logarithmic_grid, quiet_folds,
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::folds::{Folds, tell_moved, tell_quiet};

/// The penalty of ridge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Penalty {
    /// This one, at least 0.
    Fixed(#[schemars(range(min = 0.0))] f64),
    /// The best of a range.
    Chosen(Choice),
}

/// How the best penalty of a logarithmic range is found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "by", rename_all = "snake_case", deny_unknown_fields)]
pub enum Choice {
    /// By the mean R² over folds, but those in which the truth hardly changes.
    CrossValidation {
        /// How the rows are cut: a number of contiguous folds, or a table.
        #[serde(default = "Folds::three")]
        folds: Folds,
        /// The smallest penalty tried, above 0.
        #[serde(default = "smallest")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        smallest: f64,
        /// The largest penalty tried, above the smallest.
        #[serde(default = "largest")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        largest: f64,
        /// How many are tried to each factor of ten, 1 to 1000.
        #[serde(default = "four")]
        #[schemars(range(min = 1, max = 1000))]
        per_decade: u32,
    },
    /// By the error of leaving out each row in turn, worked out from all rows at once (Golub, Heath and Wahba 1979). It takes
    /// rows for independent, which those of a drift are not: it tends to penalties that are too small.
    GeneralisedCrossValidation {
        /// The smallest penalty tried, above 0.
        #[serde(default = "smallest")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        smallest: f64,
        /// The largest penalty tried, above the smallest.
        #[serde(default = "largest")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        largest: f64,
        /// How many are tried to each factor of ten, 1 to 1000.
        #[serde(default = "four")]
        #[schemars(range(min = 1, max = 1000))]
        per_decade: u32,
    },
}

fn smallest() -> f64 {
    1e-3
}

fn largest() -> f64 {
    1e6
}

fn four() -> u32 {
    4
}

impl<'de> Deserialize<'de> for Penalty {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a number or a table with `by`")
            .number(Self::Fixed)
            .table(Self::Chosen)
            .read(deserializer)
    }
}

/// A penalty, and where it was chosen what there is to tell about it.
pub(crate) struct Settled {
    pub(crate) alpha: f64,
    chosen: Option<Chosen>,
}

/// How a penalty came out as the best.
struct Chosen {
    by: Choice,
    tried: usize,
    /// Its place among those that were tried.
    place: usize,
    /// The mean R² over the folds, where there are any.
    r2: Option<f64>,
    /// The folds that have no part in it.
    quiet: Vec<usize>,
}

/// The mean of each penalty's scores over the folds.
pub(crate) fn means(folds: &[Vec<f64>]) -> Vec<f64> {
    let mean = |scores: &Vec<f64>| scores.iter().sum::<f64>() / scores.len() as f64;
    folds.iter().map(mean).collect()
}

/// The place of the best score; of several as good that of the largest penalty.
pub(crate) fn best_of(scores: &[f64]) -> usize {
    let better = |a, b| if scores[b] >= scores[a] { b } else { a };
    (0..scores.len()).reduce(better).unwrap_or(0)
}

impl Settled {
    /// What there is to tell goes into the report; the rows are those of the choice.
    pub(crate) fn tell(&self, blocks: &GramBlocks, report: &mut TrainingReport) {
        let Some(Chosen {
            by,
            tried,
            place,
            r2,
            quiet,
        }) = &self.chosen
        else {
            return;
        };
        let (smallest, largest, _) = by.range();
        report.figure("penalty", self.alpha);
        report.figure("penalties_tried", *tried);
        report.figure("smallest_penalty", smallest);
        report.figure("largest_penalty", largest);
        let how = match by {
            Choice::CrossValidation { folds, .. } => {
                tell_moved(blocks, report);
                tell_quiet(quiet, folds.cut().count(), report);
                "cross-validation"
            }
            Choice::GeneralisedCrossValidation { .. } => "generalised cross-validation",
        };
        let score = r2.map_or_else(String::new, |r2| {
            report.figure("penalty_r2", r2);
            format!(", R² {r2:.4}")
        });
        let edge = match place {
            0 => "; it is the smallest tried, a smaller one may be better",
            _ if *place == tried - 1 => "; it is the largest tried, a larger one may be better",
            _ => "",
        };
        report.notes.push(format!(
            "penalty {:.3e} chosen by {how} from {tried} between {smallest:e} and {largest:e}{score}{edge}",
            self.alpha
        ));
    }
}

impl Penalty {
    /// A range of penalties that is none; `place` is the key that holds the penalty.
    pub(crate) fn mistakes(&self, place: &str) -> Vec<Mistake> {
        let Self::Chosen(choice) = self else {
            return Vec::new();
        };
        let (smallest, largest, _) = choice.range();
        let message = format!("`largest` is {largest} and must be above `smallest`");
        let mistake = Mistake::at(format!("{place}.largest"), message);
        Vec::from_iter((largest <= smallest).then_some(mistake))
    }

    /// Into how many parts it cuts the rows.
    pub(crate) fn parts(&self) -> usize {
        match self {
            Self::Chosen(Choice::CrossValidation { folds, .. }) => folds.cut().parts(),
            Self::Chosen(Choice::GeneralisedCrossValidation { .. }) | Self::Fixed(_) => 1,
        }
    }

    /// The penalty for these columns of the rows.
    pub(crate) fn settle(
        &self,
        blocks: &GramBlocks,
        columns: &[usize],
        scales: &[f64],
    ) -> Result<Settled, NumericsError> {
        let choice = match *self {
            Self::Fixed(alpha) => {
                return Ok(Settled {
                    alpha,
                    chosen: None,
                });
            }
            Self::Chosen(choice) => choice,
        };
        let (smallest, largest, per_decade) = choice.range();
        let alphas = logarithmic_grid(smallest, largest, per_decade);
        let mut quiet = Vec::new();
        let scores: Vec<f64> = match choice {
            Choice::CrossValidation { folds, .. } => {
                let splits = blocks.splits(&folds.cut())?;
                quiet = quiet_folds(&splits);
                let folds = cross_validated_penalties(&splits, columns, scales, &alphas)?;
                means(&folds)
            }
            Choice::GeneralisedCrossValidation { .. } => {
                let scores =
                    generalised_cross_validation(&blocks.total(), columns, scales, &alphas)?;
                scores.iter().map(|score| -score).collect()
            }
        };
        let best = best_of(&scores);
        let r2 = match choice {
            Choice::CrossValidation { .. } => Some(scores[best]),
            Choice::GeneralisedCrossValidation { .. } => None,
        };
        Ok(Settled {
            alpha: alphas[best],
            chosen: Some(Chosen {
                by: choice,
                tried: alphas.len(),
                place: best,
                r2,
                quiet,
            }),
        })
    }
}

impl Choice {
    fn range(&self) -> (f64, f64, u32) {
        match *self {
            Self::CrossValidation {
                smallest,
                largest,
                per_decade,
                ..
            }
            | Self::GeneralisedCrossValidation {
                smallest,
                largest,
                per_decade,
            } => (smallest, largest, per_decade),
        }
    }
}
