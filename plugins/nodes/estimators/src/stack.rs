//! One prediction of several, by weights that a fit has found.

use athermal_core::node::numbers;
use athermal_core::node::{
    Coefficients, Estimator, Factor, Figure, InputPort, Mistake, Of, Predictor, Regressors, Term,
    Trained, Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_numerics::{
    Gram, GramBlocks, Novelty, NumericsError, Standardization, non_negative_least_squares,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::features::{present_features, too_many_at};
use crate::novelty::{novelty_at, novelty_mistakes, novelty_of};

/// Stacked regression: the sum of several predictions, by weights that are not negative and found by least squares in the fit.
///
/// `ŷ = Σ w_i ŷ_i` with the `w ≥ 0` that minimise `Σ (y − Σ w_i ŷ_i)²` (Breiman 1996; solved as Lawson and Hanson
/// 1974). There is no intercept, and the weights need not add up to one: voters that all promise too much are scaled
/// down. They add up to one only where the truth is a thousand times as large as it varies, such as a position that
/// is counted from far away. There they nearly do so anyway. Predictions of the rows that an estimator was itself
/// fitted on would flatter the one that fits them closest. So weights are found on out-of-fold predictions: each
/// third of the data is predicted by voters fitted on the rest. The thirds have as many instants at which there is a
/// truth. Nothing is left out between a third and the rest, so that thirds should be long against windows and
/// horizons. So voters are fitted four times, and those of a voter that is a stack itself 13 times.
///
/// Unlike a vote it needs a fit and learns nothing while it runs. A voter without a prediction drops out, and the
/// others go by the weights that are the best without it. Where two say nearly the same, one may have all their
/// weight, and the other takes it over. Where all weights are 0 there is no prediction. Only rows with all
/// predictions take part in the fit, and a voter that lacks more than a tenth of them is left out. At most 10 voters.
///
/// The port `novelty` shows how far predictions are outside of those of the fit, as that of `linear` does of features: voters that
/// disagree as they never did. There is none while a voter is absent, nor where the rows of the fit do not fit in memory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stack {}

/// Squares of the truth that are so many times those of its distances from the mean leave nothing of the voters' errors in sums of
/// products; the weights then follow from the errors.
const FAR: f64 = 1e6;
/// The least squared error of a voter, as a share of the largest: one without any would have no weight that is finite.
const LEAST_ERROR: f64 = 1e-12;

/// The most voters: there are weights for any of them being absent.
const MOST: usize = 10;

impl Estimator for Stack {
    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("voters", "predictions of the same truth"),
                InputPort::truth("what they predict"),
            ]
        }
    }

    fn regressors(&self) -> Regressors {
        present_features()
    }

    fn needs_constants(&self) -> bool {
        true
    }

    fn has_novelty(&self) -> bool {
        true
    }

    fn mistakes_for(&self, voters: usize) -> Vec<Mistake> {
        too_many_at("inputs.voters", voters, 1)
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let names = setup.regressors.iter();
        let names: Vec<String> = names.map(|voter| voter.name.clone()).collect();
        Box::new(Stacking {
            blocks: GramBlocks::with_row_memory(names.len(), setup.memory),
            names,
        })
    }
}

struct Stacking {
    names: Vec<String>,
    blocks: GramBlocks,
}

impl Trainer for Stacking {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.blocks.push(regressors, truth);
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let voters = self.names.len();
        if voters == 0 || voters > MOST {
            return Err(TrainingError::Unsolvable {
                reason: format!("{voters} voters, and a stack takes from 1 to {MOST}"),
            });
        }
        let total = self.blocks.total();
        let sums = Sums::of(&total);
        let all: Vec<usize> = (0..voters).collect();
        let novelty = novelty_of(&self.blocks, &Standardization::of(&total), &all);
        let saved = sums.saved(self.names, novelty);
        let stacked = Stacked::try_from(saved).map_err(|error| TrainingError::Unsolvable {
            reason: error.to_string(),
        })?;
        let weights = stacked.weights((1 << voters) - 1);
        if weights.iter().all(|&weight| weight == 0.0) {
            return Err(TrainingError::Unsolvable {
                reason: "every weight is 0, since no voter says more of the truth than 0 does; look at the fits of the voters"
                    .to_owned(),
            });
        }
        let squares = sums.left(weights);
        let named = stacked.saved.regressors.iter().zip(weights.iter().copied());
        let texts: Vec<String> = named
            .clone()
            .map(|(name, weight)| format!("{name} {weight:.3}"))
            .collect();
        let mut report = TrainingReport {
            in_sample_rmse: Some((squares / total.count() as f64).sqrt()),
            notes: vec![format!("weights: {}", texts.join(", "))],
            ..TrainingReport::default()
        };
        report.figure("weights", Figure::named(named));
        Ok(Trained {
            predictor: Box::new(stacked),
            report,
        })
    }
}

/// Sums over the rows of products of votes and the truth; or, where they are `of_errors`, of the votes' errors, whose truth is 0.
struct Sums {
    /// Of two votes, row by row.
    products: Vec<f64>,
    /// Of each with the truth.
    with_truth: Vec<f64>,
    /// Of the truth with itself.
    of_truth: f64,
    of_errors: bool,
}

impl Sums {
    fn of(rows: &Gram) -> Self {
        let y = rows.width();
        let about = |centre: f64| rows.moments_about(&vec![centre; y + 1]);
        let (plain, apart) = (about(0.0), about(rows.means()[y]));
        let pairs = (0..y).flat_map(|i| (0..y).map(move |j| (i, j)));
        if plain[(y, y)] <= FAR * apart[(y, y)] {
            return Self {
                products: pairs.map(|at| plain[at]).collect(),
                with_truth: (0..y).map(|i| plain[(i, y)]).collect(),
                of_truth: plain[(y, y)],
                of_errors: false,
            };
        }
        let of_errors = |(i, j): (usize, usize)| {
            (apart[(i, j)] - apart[(i, y)]) - (apart[(y, j)] - apart[(y, y)])
        };
        Self {
            products: pairs.map(of_errors).collect(),
            with_truth: vec![0.0; y],
            of_truth: 0.0,
            of_errors: true,
        }
    }

    /// What weights follow from.
    fn saved(&self, regressors: Vec<String>, novelty: Option<Novelty>) -> Saved {
        let voters = regressors.len();
        let (mut products, mut with_truth) = (self.products.clone(), self.with_truth.clone());
        if self.of_errors {
            let own = products.iter().step_by(voters + 1).copied();
            let most = own.fold(0.0, f64::max);
            let least = if most > 0.0 { LEAST_ERROR * most } else { 1.0 };
            let own = products.iter_mut().step_by(voters + 1);
            own.for_each(|own| *own += least);
            // The weights that add up to one and leave the least squares are those of this right side, scaled.
            with_truth.fill(1.0);
        }
        Saved {
            regressors,
            products,
            with_truth,
            adds_to_one: self.of_errors,
            novelty,
        }
    }

    /// The sum of squares that weights leave.
    fn left(&self, weights: &[f64]) -> f64 {
        let explained = self.products.chunks(weights.len()).enumerate();
        let explained = explained.map(|(i, products)| {
            let mixed: f64 = weights.iter().zip(products).map(|(w, p)| w * p).sum();
            weights[i] * (2.0 * self.with_truth[i] - mixed)
        });
        (self.of_truth - explained.sum::<f64>()).max(0.0)
    }
}

/// A fitted stack: the sums that weights follow from, whichever voters are there.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Saved", into = "Saved")]
struct Stacked {
    saved: Saved,
    /// The weights of all voters for each set of those that are there, a bit each.
    table: Vec<f64>,
}

/// A stack as a model file has it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Saved {
    /// The voters.
    regressors: Vec<String>,
    /// Sums of the products of their predictions, or of their errors, row by row.
    #[serde(with = "numbers")]
    products: Vec<f64>,
    /// Sums of the products of each with the truth.
    #[serde(with = "numbers")]
    with_truth: Vec<f64>,
    /// Whether the products are those of their errors, and weights are scaled to add up to one.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    adds_to_one: bool,
    /// How far votes are from those of the fit, where its rows say so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    novelty: Option<Novelty>,
}

impl From<Stacked> for Saved {
    fn from(stacked: Stacked) -> Self {
        stacked.saved
    }
}

impl TryFrom<Saved> for Stacked {
    type Error = NumericsError;

    fn try_from(saved: Saved) -> Result<Self, NumericsError> {
        let voters = saved.regressors.len();
        if voters > MOST {
            let (expected, found) = (MOST, voters);
            return Err(NumericsError::Width { expected, found });
        }
        for (name, expected, found) in [
            ("with_truth", voters, saved.with_truth.len()),
            ("products", voters * voters, saved.products.len()),
        ] {
            if found != expected {
                return Err(NumericsError::Length {
                    name,
                    expected,
                    found,
                });
            }
        }
        let mut table = vec![0.0; voters << voters];
        for (set, weights) in table.chunks_exact_mut(voters.max(1)).enumerate() {
            let there: Vec<usize> = (0..voters).filter(|voter| set >> voter & 1 == 1).collect();
            let own = there
                .iter()
                .flat_map(|i| there.iter().map(move |j| i * voters + j));
            let products: Vec<f64> = own.map(|place| saved.products[place]).collect();
            let with_truth: Vec<f64> = there.iter().map(|&i| saved.with_truth[i]).collect();
            let mut solution = non_negative_least_squares(&products, &with_truth)?;
            let sum: f64 = solution.iter().sum();
            if saved.adds_to_one && sum > 0.0 {
                solution.iter_mut().for_each(|weight| *weight /= sum);
            }
            for (voter, weight) in there.into_iter().zip(solution) {
                weights[voter] = weight;
            }
        }
        Ok(Self { saved, table })
    }
}

impl Stacked {
    /// The weights while these voters are there.
    fn weights(&self, set: usize) -> &[f64] {
        let voters = self.saved.regressors.len();
        &self.table[set * voters..(set + 1) * voters]
    }
}

impl Predictor for Stacked {
    fn uses(&self) -> &[String] {
        &self.saved.regressors
    }

    fn mistakes(&self) -> Vec<Mistake> {
        novelty_mistakes(self.saved.novelty.as_ref(), self.saved.regressors.len())
    }

    fn novelty(&self, votes: &[f64]) -> f64 {
        novelty_at(self.saved.novelty.as_ref(), votes)
    }

    fn centre(&self) -> f64 {
        let weights = self.weights((1 << self.saved.regressors.len()) - 1);
        let novelty = self.saved.novelty.as_ref();
        novelty.map_or(0.0, |of| of.centre(0.0, weights))
    }

    fn predict(&self, votes: &[f64]) -> f64 {
        let set = votes
            .iter()
            .enumerate()
            .filter(|(_, vote)| !vote.is_nan())
            .fold(0, |set, (voter, _)| set | 1 << voter);
        let weights = self.weights(set);
        if weights.iter().all(|&weight| weight == 0.0) {
            // Who is there has nothing to say, which is not the same as 0.
            return f64::NAN;
        }
        let terms = weights.iter().zip(votes);
        terms
            .filter(|(_, vote)| !vote.is_nan())
            .map(|(weight, vote)| weight * vote)
            .sum()
    }

    fn coefficients(&self) -> Option<Coefficients> {
        let all = (1 << self.saved.regressors.len()) - 1;
        let weights = self.weights(all).iter().enumerate();
        let terms =
            weights.map(|(voter, &weight)| Term::new(Of::Product(vec![Factor::of(voter)]), weight));
        Some(Coefficients {
            terms: terms.collect(),
            ..Coefficients::default()
        })
    }

    fn takes_absent(&self) -> bool {
        true
    }
}

athermal_core::predictor!(Stacked, "stack");

athermal_core::register!(Stack, Estimator, "stack");

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use athermal_core::time::Duration;

    use super::*;
    use athermal_core::node::{LearningLimits, Regressor};

    fn stack(rows: &[(&[f64], f64)]) -> Result<Trained, TrainingError> {
        let regressor = |i: usize| Regressor {
            name: format!("voter{i}"),
            unit: "nm/min".to_owned(),
            sensors: Vec::new(),
            lag: Duration::ZERO,
            of_truth: false,
        };
        let setup = TrainingSetup {
            instance: "stack".to_owned(),
            regressors: (0..rows[0].0.len()).map(regressor).collect(),
            places: (0..rows[0].0.len()).collect(),
            error_unit: "nm/min".to_owned(),
            memory: 1 << 20,
            ahead: Duration::ZERO,
            span: Duration::ZERO,
            learns: false,
            limits: LearningLimits::NONE,
        };
        let mut trainer = Stack {}.trainer(&setup);
        for (row, truth) in rows {
            trainer.row(row, *truth);
        }
        trainer.finish()
    }

    /// Votes that are wrong in different ways, and the truth.
    fn rows() -> Vec<([f64; 3], f64)> {
        let row = |i: i32| {
            let truth = (0.3 * f64::from(i)).sin();
            let noise = (1.7 * f64::from(i)).sin();
            (
                [2.0 * truth, truth + noise, 2.0 * truth + 0.01 * noise],
                truth,
            )
        };
        (0..200).map(row).collect()
    }

    fn fitted() -> Box<dyn Predictor> {
        let rows = rows();
        let rows: Vec<(&[f64], f64)> = rows.iter().map(|(row, truth)| (&row[..], *truth)).collect();
        stack(&rows).unwrap().predictor
    }

    #[test]
    fn a_voter_that_promises_twice_as_much_counts_half() {
        let stacked = fitted();
        let predicted = stacked.predict(&[2.0, 5.0, 2.0]);
        assert!((predicted - 1.0).abs() < 0.02, "{predicted}");
    }

    #[test]
    fn another_takes_over_from_an_absent_voter() {
        let stacked = fitted();
        let without = stacked.predict(&[f64::NAN, 5.0, 2.0]);
        assert!((without - 1.0).abs() < 0.02, "{without}");
        let alone = stacked.predict(&[f64::NAN, 1.0, f64::NAN]);
        assert!(alone > 0.2 && alone < 0.8, "half of it is noise: {alone}");
    }

    #[test]
    fn where_every_weight_is_zero_there_is_no_prediction() {
        let stacked = fitted();
        assert!(stacked.predict(&[f64::NAN; 3]).is_nan());
        let mut rows = rows();
        for (row, truth) in &mut rows {
            row[1] = -*truth;
        }
        let rows: Vec<(&[f64], f64)> = rows.iter().map(|(row, truth)| (&row[..], *truth)).collect();
        let wrong_way = stack(&rows).unwrap().predictor;
        assert!(wrong_way.predict(&[f64::NAN, 1.0, f64::NAN]).is_nan());
        assert!(wrong_way.predict(&[2.0, 1.0, 2.0]).is_finite());
        let alone: Vec<(&[f64], f64)> = rows
            .iter()
            .map(|(row, truth)| (&row[1..2], *truth))
            .collect();
        let error = stack(&alone).unwrap_err().to_string();
        assert!(error.starts_with("every weight is 0"), "{error}");
    }

    #[test]
    fn weights_are_those_of_the_errors_however_far_away_a_position_is_counted_from() {
        let wave = |i: i32, step: f64| (step * f64::from(i)).sin();
        let error = |i: i32| [0.1 * wave(i, 1.7), 0.2 * wave(i, 2.9), 3.0 * wave(i, 0.7)];
        let mixed =
            |a: usize, b: usize| -> f64 { (0..500).map(|i| error(i)[a] * error(i)[b]).sum() };
        // Of two voters the weights that add up to one; the third has nothing to give.
        let apart = mixed(0, 0) + mixed(1, 1) - 2.0 * mixed(0, 1);
        let expected = (mixed(1, 1) - mixed(0, 1)) / apart;
        for level in [1e4, 5e5, 1e8, -1e8] {
            let row = |i: i32| {
                let truth = level + wave(i, 0.3);
                (error(i).map(|error| truth + error), truth)
            };
            let rows: Vec<([f64; 3], f64)> = (0..500).map(row).collect();
            let rows: Vec<(&[f64], f64)> = rows.iter().map(|(x, y)| (&x[..], *y)).collect();
            let Trained { predictor, report } = stack(&rows).unwrap();
            let weight = predictor.predict(&[level + 1.0, level, level]) - level;
            assert!(
                (weight - expected).abs() < 1e-3,
                "{level}: {weight} {expected}"
            );
            let without = predictor.predict(&[f64::NAN, level + 1.0, f64::NAN]) - level;
            assert!((without - 1.0).abs() < 1e-6, "{without}");
            let left = mixed(0, 0) * mixed(1, 1) - mixed(0, 1) * mixed(0, 1);
            let rmse = (left / apart / 500.0).sqrt();
            let told = report.in_sample_rmse.unwrap();
            assert!((told - rmse).abs() < 1e-3 * rmse, "{told} {rmse}");
            let text = serde_json::to_string(&predictor).unwrap();
            let back: Box<dyn Predictor> = serde_json::from_str(&text).unwrap();
            let votes = [level + 0.3, level - 0.2, level];
            assert_eq!(predictor.predict(&votes), back.predict(&votes));
        }
        // One that is never wrong has all weight.
        let right: Vec<[f64; 2]> = (0..9).map(|i| [1e8 + f64::from(i), 1e8]).collect();
        let rows: Vec<(&[f64], f64)> = right.iter().map(|x| (&x[..], x[0])).collect();
        let told = stack(&rows).unwrap().predictor.predict(&[1.0, 0.0]);
        assert!((told - 1.0).abs() < 1e-9, "{told}");
    }

    #[test]
    fn what_is_read_back_gives_the_same_bits() {
        let stacked = fitted();
        let text = serde_json::to_string(&stacked).unwrap();
        let back: Box<dyn Predictor> = serde_json::from_str(&text).unwrap();
        for votes in [[0.1, 0.2, 0.3], [f64::NAN, 0.2, 0.3], [0.7, f64::NAN, 0.1]] {
            assert_eq!(
                stacked.predict(&votes).to_bits(),
                back.predict(&votes).to_bits()
            );
        }
    }

    #[test]
    fn more_voters_than_there_can_be_are_told() {
        let rows: Vec<f64> = (0..11).map(f64::from).collect();
        let error = stack(&[(&rows, 1.0)]).unwrap_err();
        assert!(error.to_string().contains("11 voters"), "{error}");
    }
}
