//! Errors of a machine's predictions, and how they stand beside those of the fleet.

use std::collections::BTreeMap;

use athermal_numerics::median;
use athermal_run::model::Card;
use athermal_run::score::{Score, Scores};
use serde::{Deserialize, Serialize};

/// How far off one prediction is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What predicts: the estimator of a fit, `thermal.Z1`, or the channel that was scored, `vote.Z1`.
    pub of: String,
    /// What is predicted.
    pub truth: String,
    /// The unit of the error.
    pub unit: String,
    /// On how many rows or instants.
    pub n: u64,
    /// The root mean square error.
    pub rmse: Option<f64>,
    /// That of no model, where it was scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_model: Option<f64>,
    /// That of persistence, where it was scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub persistence: Option<f64>,
    /// The mean error, where it was scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bias: Option<f64>,
    /// The largest error, where it was scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_abs: Option<f64>,
    /// The share of instants that have a prediction, where it was scored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub valid: Option<f64>,
}

impl Figure {
    /// Those of a fit: each estimator on the rows that it was fitted on.
    #[must_use]
    pub fn of_card(card: &Card) -> Vec<Self> {
        let estimators = card.estimators.iter();
        let figures = estimators.map(|of| Self {
            of: of.node.clone(),
            truth: of.truth.clone(),
            unit: of.unit.clone(),
            n: of.rows,
            rmse: of.report.in_sample_rmse,
            no_model: None,
            persistence: None,
            bias: None,
            max_abs: None,
            valid: None,
        });
        figures.collect()
    }

    /// Those of predictions that were scored.
    #[must_use]
    pub fn of_scores(scores: &Scores) -> Vec<Self> {
        let figures = scores.scores.iter().map(|of: &Score| Self {
            of: of.output.clone(),
            truth: of.truth.clone(),
            unit: of.unit.clone(),
            n: of.n as u64,
            rmse: of.rmse,
            no_model: of.baseline_zero,
            persistence: of.baseline_persistence,
            bias: of.bias,
            max_abs: of.max_abs,
            valid: of.valid,
        });
        figures.collect()
    }
}

/// The errors of one machine, and where they stand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    /// The machine.
    pub machine: String,
    /// Its figures, each with its error relative to the median of the fleet.
    pub figures: Vec<Relative>,
    /// The place of the largest among these ratios; none where it has none.
    pub worst: Option<usize>,
    /// The geometric mean of these ratios.
    pub mean_ratio: Option<f64>,
}

/// A figure beside those of the fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Relative {
    /// The figure.
    #[serde(flatten)]
    pub figure: Figure,
    /// Its error over the median of the same figure over all machines.
    pub ratio: Option<f64>,
}

impl Standing {
    /// The largest ratio with its figure.
    #[must_use]
    pub fn worst(&self) -> Option<(&Figure, f64)> {
        let of = &self.figures[self.worst?];
        Some((&of.figure, of.ratio?))
    }
}

/// The machines of a fleet, the worst first: by the largest error relative to the median of the fleet. Those without a figure come first
/// of all.
#[must_use]
pub fn standings(fleet: &BTreeMap<String, Vec<Figure>>) -> Vec<Standing> {
    let medians = medians(fleet);
    let mut all: Vec<Standing> = fleet
        .iter()
        .map(|(machine, figures)| standing(machine, figures, &medians))
        .collect();
    let by = |of: &Standing| of.worst().map_or(f64::INFINITY, |(_, ratio)| ratio);
    all.sort_by(|one, other| by(other).total_cmp(&by(one)));
    all
}

fn standing(machine: &str, figures: &[Figure], medians: &BTreeMap<String, f64>) -> Standing {
    let relative = figures.iter().map(|figure| Relative {
        ratio: figure.rmse.and_then(|rmse| {
            let median = medians.get(&figure.of).copied()?;
            (median > 0.0).then(|| rmse / median)
        }),
        figure: figure.clone(),
    });
    let figures: Vec<Relative> = relative.collect();
    let ratios = figures.iter().enumerate();
    let ratios = ratios.filter_map(|(nth, of)| Some((nth, of.ratio?)));
    let ratios: Vec<(usize, f64)> = ratios.collect();
    let worst = ratios.iter().max_by(|one, other| one.1.total_cmp(&other.1));
    let logs: f64 = ratios.iter().map(|(_, ratio)| libm::log(*ratio)).sum();
    Standing {
        machine: machine.to_owned(),
        worst: worst.map(|(nth, _)| *nth),
        mean_ratio: (!ratios.is_empty()).then(|| libm::exp(logs / ratios.len() as f64)),
        figures,
    }
}

/// The median error of each figure over all machines that have it.
fn medians(fleet: &BTreeMap<String, Vec<Figure>>) -> BTreeMap<String, f64> {
    let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for figure in fleet.values().flatten() {
        if let Some(rmse) = figure.rmse {
            all.entry(figure.of.clone()).or_default().push(rmse);
        }
    }
    let medians = all
        .into_iter()
        .map(|(of, mut errors)| (of, median(&mut errors)));
    medians
        .filter_map(|(of, median)| Some((of, median?)))
        .collect()
}

#[cfg(test)]
pub(crate) fn figure(of: &str, rmse: Option<f64>) -> Figure {
    Figure {
        of: of.to_owned(),
        truth: "drift".to_owned(),
        unit: "nm/min".to_owned(),
        n: 10,
        rmse,
        no_model: None,
        persistence: None,
        bias: None,
        max_abs: None,
        valid: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_machine_is_the_one_whose_largest_error_beside_the_fleet_is_largest() {
        let machine = |x, y| vec![figure("x", Some(x)), figure("y", y)];
        let fleet = [
            ("a", machine(1.0, Some(100.0))),
            ("b", machine(2.0, Some(100.0))),
            ("c", machine(1.0, Some(400.0))),
            ("d", machine(1.0, None)),
            ("e", vec![]),
        ];
        let fleet = fleet.map(|(name, of)| (name.to_owned(), of)).into();
        let all = standings(&fleet);
        let order: Vec<&str> = all.iter().map(|of| &*of.machine).collect();
        assert_eq!(order, ["e", "c", "b", "a", "d"]);
        let (worst, ratio) = all[1].worst().unwrap();
        assert_eq!((&*worst.of, ratio), ("y", 4.0));
        assert_eq!(all[1].mean_ratio, Some(2.0));
    }
}
