//! Whether several signals go together as they did in a fit, and which of them does not. Decides the measure and what each signal
//! has in it; what follows from that is its user's.

use crate::{Gram, Rows, Standardization};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use serde::{Deserialize, Serialize};

/// A direction in which the rows vary by less than a thousandth of a column's standard deviation counts as one that they never took.
const NEVER: f64 = 1e-6;
/// The share of the rows of the fit that are usual.
const USUAL: f64 = 0.999;

/// How signals went together in the rows of a fit.
///
/// With the standardised columns `z` of a row it is `d = zᵀMz`, `M = 10⁻⁶ (ZᵀZ / n + 10⁻⁶ I)⁻¹`: what of the row lies in directions
/// that the rows of the fit hardly took. What one signal, of one column or more, has in it is by how much `d` falls where the signal is
/// free to be what fits the others best, `gᵀ (M_BB)⁻¹ g` with `g = (Mz)_B` (the contribution by reconstruction of Alcala and Qin
/// 2009): of a row in which one signal alone is wrong that signal has the most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Agreement {
    /// The mean of each column.
    pub means: Vec<f64>,
    /// The standard deviation of each column, 1 for a constant one.
    pub scales: Vec<f64>,
    /// `M`, a lower triangle row by row.
    pub matrix: Vec<f64>,
    /// The 99.9 % quantile of `d` over the rows of the fit.
    pub usual: f64,
}

/// Room for looking at a row.
#[derive(Debug, Clone)]
pub struct Look {
    /// `M` of the columns that are there, zeros for the others.
    matrix: Vec<f64>,
    z: Vec<f64>,
    /// `Mz`.
    pull: Vec<f64>,
}

impl Agreement {
    /// That of rows; none where they say nothing of how their columns go together.
    #[must_use]
    pub fn of(gram: &Gram, rows: Rows<'_>) -> Option<Self> {
        let order = gram.width();
        let Standardization { means, scales, .. } = Standardization::of(gram);
        let (moments, count) = (gram.moments(), gram.count() as f64);
        if order == 0 || count <= order as f64 {
            return None;
        }
        let variance = |i: usize, j: usize| moments[(i, j)] / (count * scales[i] * scales[j]);
        let ridged = Mat::from_fn(order, order, |i, j| {
            (variance(i, j) + if i == j { NEVER } else { 0.0 }) / NEVER
        });
        let inverse = ridged
            .llt(Side::Lower)
            .ok()?
            .solve(Mat::<f64>::identity(order, order));
        let lower = (0..order).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let mut agreement = Self {
            means,
            scales,
            matrix: lower.map(|place| inverse[place]).collect(),
            usual: 1.0,
        };
        let mut look = agreement.look();
        let mut all: Vec<f64> = rows
            .iter()
            .map(|(x, _, _)| agreement.apart(|nth| x[nth], &mut look))
            .collect();
        let usual = ((all.len() as f64 * USUAL).ceil() as usize).saturating_sub(1);
        let (_, usual, _) = all.select_nth_unstable_by(usual, f64::total_cmp);
        agreement.usual = *usual;
        agreement.is_sound().then_some(agreement)
    }

    /// Whether its parts fit together and can be divided by.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let order = self.means.len();
        let finite = self
            .means
            .iter()
            .chain(&self.matrix)
            .all(|value| value.is_finite());
        let above_zero = |value: &f64| *value > 0.0 && value.is_finite();
        let whole = self.scales.len() == order && self.matrix.len() == order * (order + 1) / 2;
        order > 0 && whole && finite && self.scales.iter().chain([&self.usual]).all(above_zero)
    }

    /// Room for looking at its rows.
    #[must_use]
    pub fn look(&self) -> Look {
        let order = self.means.len();
        Look {
            matrix: vec![0.0; order * order],
            z: vec![0.0; order],
            pull: vec![0.0; order],
        }
    }

    /// How far the columns of a row are apart, in multiples of what is usual; those that are NaN may be anything.
    pub fn apart(&self, column: impl Fn(usize) -> f64, look: &mut Look) -> f64 {
        let order = self.means.len();
        let Look { matrix, z, pull } = look;
        let mut lower = self.matrix.iter();
        for i in 0..order {
            for (j, value) in lower.by_ref().take(i + 1).enumerate() {
                matrix[i * order + j] = *value;
                matrix[j * order + i] = *value;
            }
        }
        for (nth, z) in z.iter_mut().enumerate() {
            *z = (column(nth) - self.means[nth]) / self.scales[nth];
            if z.is_nan() {
                *z = 0.0;
                free(matrix, order, nth);
            }
        }
        for (pull, row) in pull.iter_mut().zip(matrix.chunks_exact(order)) {
            *pull = row.iter().zip(&*z).map(|(m, z)| m * z).sum();
        }
        let sum: f64 = pull.iter().zip(&*z).map(|(pull, z)| pull * z).sum();
        sum.max(0.0) / self.usual
    }

    /// How much of that one signal has in it, by its columns: one, or two.
    #[must_use]
    pub fn share(&self, (first, second): (usize, Option<usize>), look: &Look) -> f64 {
        let order = self.means.len();
        let Look { matrix, pull, .. } = look;
        let at = |i: usize, j: usize| matrix[i * order + j];
        let part = |pull: f64, own: f64| if own > 0.0 { pull * pull / own } else { 0.0 };
        let mut sum = part(pull[first], at(first, first));
        if let Some(second) = second {
            let along = if at(first, first) > 0.0 {
                at(first, second) / at(first, first)
            } else {
                0.0
            };
            sum += part(
                pull[second] - along * pull[first],
                at(second, second) - along * at(first, second),
            );
        }
        sum / self.usual
    }

    /// How much a signal would have in it of which one column alone were off, by the square of how far.
    #[must_use]
    pub fn share_of_one(&self, column: usize, square: f64, look: &Look) -> f64 {
        let (own, scale) = (
            look.matrix[column * self.means.len() + column],
            self.scales[column],
        );
        own * (square / (scale * scale)) / self.usual
    }
}

/// Takes a column out of a symmetric form: it is then whatever makes the form smallest.
fn free(matrix: &mut [f64], order: usize, column: usize) {
    let own = matrix[column * order + column];
    if own <= 0.0 {
        return;
    }
    for i in (0..order).filter(|&i| i != column) {
        let along = matrix[i * order + column] / own;
        for j in 0..order {
            matrix[i * order + j] -= along * matrix[column * order + j];
        }
    }
    for i in 0..order {
        matrix[i * order + column] = 0.0;
        matrix[column * order + i] = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GramBlocks;

    fn row(t: f64) -> [f64; 4] {
        let (one, other) = ((0.11 * t).sin(), (0.37 * t).cos());
        let noise = |nth: f64| 0.001 * (t * (7.1 + nth)).sin();
        [
            one + noise(0.0),
            one + other + noise(1.0),
            20.0 + one - other + noise(2.0),
            other + noise(3.0),
        ]
    }

    fn agreement() -> Agreement {
        let mut blocks = GramBlocks::new(4);
        (0..5000).for_each(|t| blocks.push(&row(f64::from(t)), 0.0));
        Agreement::of(&blocks.total(), blocks.rows().unwrap()).unwrap()
    }

    fn shares(agreement: &Agreement, row: [f64; 4]) -> (f64, Vec<f64>) {
        let mut look = agreement.look();
        let apart = agreement.apart(|nth| row[nth], &mut look);
        let share = |nth| agreement.share((nth, None), &look);
        (apart, (0..4).map(share).collect())
    }

    #[test]
    fn the_signal_that_is_wrong_has_all_of_what_is_apart_and_the_others_less() {
        let agreement = agreement();
        assert!(shares(&agreement, row(7000.5)).0 < 2.0);
        for wrong in 0..4 {
            let mut row = row(7000.5);
            row[wrong] += 0.1;
            let (apart, shares) = shares(&agreement, row);
            assert!(apart > 20.0, "{apart}");
            let most = (0..4).max_by(|&a, &b| shares[a].total_cmp(&shares[b]));
            assert_eq!(most, Some(wrong), "{shares:?}");
            assert!(apart - shares[wrong] < 2.0, "{apart} and {shares:?}");
        }
    }

    #[test]
    fn a_signal_that_is_not_there_is_as_one_that_fits() {
        let agreement = agreement();
        for (gone, wrong) in [(0, 2), (3, 1)] {
            let mut row = row(7000.5);
            row[wrong] += 0.1;
            row[gone] = f64::NAN;
            let (apart, shares) = shares(&agreement, row);
            assert!(apart > 5.0, "{apart}");
            assert_eq!(shares[gone], 0.0);
            assert!(apart - shares[wrong] < 2.0, "{apart} and {shares:?}");
            row[wrong] = f64::NAN;
            assert!(self::shares(&agreement, row).0 < 2.0);
        }
    }

    #[test]
    fn the_share_of_two_columns_is_what_is_gone_without_both() {
        let agreement = agreement();
        let mut row = row(7000.5);
        (row[1], row[2]) = (row[1] + 0.3, row[2] - 0.2);
        let mut look = agreement.look();
        let apart = agreement.apart(|nth| row[nth], &mut look);
        let share = agreement.share((1, Some(2)), &look);
        (row[1], row[2]) = (f64::NAN, f64::NAN);
        let without = agreement.apart(|nth| row[nth], &mut look);
        assert!(
            (apart - share - without).abs() < 1e-6 * apart,
            "{apart} {share} {without}"
        );
    }
}
