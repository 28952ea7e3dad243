//! Decides which fits are doubted for the rows that they stand on; not which rows those are.

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::channel::is_cold;
use crate::diagnostic::{count, counted};
use crate::node::{Figure, Noise, Of, Predictor, Regressor, Term, TrainingError, TrainingReport};

/// A fit whose error is larger than that of the mean by this factor is no better than none.
const WORSE_THAN_MEAN: f64 = 1.1;
/// The share of a mean that rounding may make up.
const ROUNDING: f64 = 1e-9;

/// From this share of incomplete rows on, the report says what they lack.
const MANY_INCOMPLETE: f64 = 0.01;
/// So many of what they lack are named.
const NAMED: usize = 3;

/// What incomplete rows lack, but for windows that were still cold; by sensor, since what is made of one often lacks a value with
/// the others.
#[derive(Debug, Clone)]
pub(super) struct Lacking {
    rows: u64,
    /// The rows that lack a value from each sensor, or of each regressor that is made of several.
    sources: IndexMap<String, u64>,
    /// The source of each regressor.
    of: Vec<usize>,
    /// Whether each source is lacking in a row.
    row: Vec<bool>,
}

impl Lacking {
    /// Nothing yet, of these regressors.
    pub(super) fn new<'a>(regressors: impl Iterator<Item = &'a Regressor>) -> Self {
        let mut sources = IndexMap::new();
        let source = |regressor: &Regressor| {
            let source = match &regressor.sensors[..] {
                [sensor] => sensor,
                _ => &regressor.name,
            };
            sources.insert_full(source.clone(), 0).0
        };
        let of = regressors.map(source).collect();
        Self {
            rows: 0,
            row: vec![false; sources.len()],
            sources,
            of,
        }
    }

    /// So many incomplete rows that lack the same.
    pub(super) fn count(&mut self, row: &[f64], rows: u64) {
        self.row.fill(false);
        for (&source, value) in self.of.iter().zip(row) {
            self.row[source] |= value.is_nan() && !is_cold(*value);
        }
        self.rows += rows * u64::from(self.row.contains(&true));
        for (count, &lacks) in self.sources.values_mut().zip(&self.row) {
            *count += rows * u64::from(lacks);
        }
    }

    /// The sources that are lacking, the one that is most often first, with the rows that it costs.
    pub(super) fn named(&self) -> Vec<(String, u64)> {
        let sources = self.sources.iter().filter(|(_, rows)| **rows > 0);
        let mut named: Vec<_> = sources.map(|(name, rows)| (name.clone(), *rows)).collect();
        named.sort_by_key(|(_, rows)| std::cmp::Reverse(*rows));
        named
    }

    /// Notes where values were missing that cost a fit many of its rows, of which so many are complete.
    pub(super) fn note(&self, complete: u64, report: &mut TrainingReport) {
        let many = MANY_INCOMPLETE * (complete + self.rows) as f64;
        if self.rows == 0 || (self.rows as f64) < many {
            return;
        }
        let named = self.named();
        report.notes.push(format!(
            "many rows are incomplete for want of a value from {}",
            in_words(&named)
        ));
        let each = named.iter().map(|(name, rows)| (&**name, *rows as f64));
        report.figure("lacking", Figure::named(each));
    }

    /// Fewer rows than are needed, with what others lack.
    pub(super) fn too_few(&self, error: TrainingError, incomplete: u64) -> TrainingError {
        match error {
            TrainingError::TooFewRows { rows, needed } if incomplete > 0 => {
                let named = self.named();
                TrainingError::TooFewComplete {
                    rows,
                    needed,
                    cold: incomplete - self.rows,
                    lacking: (self.rows > 0).then(|| (self.rows, in_words(&named))),
                }
            }
            other => other,
        }
    }
}

/// The first of them, with their rows.
fn in_words(named: &[(String, u64)]) -> String {
    let first = named.iter().take(NAMED);
    let first = first.map(|(name, rows)| format!("{name} ({})", count(*rows)));
    let others = (named.len() > NAMED).then(|| "and others".to_owned());
    first.chain(others).collect::<Vec<_>>().join(", ")
}

/// Notes the regressors that were left out since they stay the same.
pub(super) fn note_constant<'a>(names: impl Iterator<Item = &'a str>, report: &mut TrainingReport) {
    let names: Vec<&str> = names.collect();
    if !names.is_empty() {
        let all = names.join(", ");
        report
            .notes
            .push(format!("constant, so without effect: {all}"));
        report.figure("constant", Figure::names(names));
    }
}

/// Whether a model follows the truth: by polynomials, or a level that wanders.
fn looks_back(predictor: &dyn Predictor) -> bool {
    predictor.coefficients().is_some_and(|model| {
        let wanders = |noise: &Noise| noise.per_s.is_some() && noise.deviation > 0.0;
        let is_power = |term: &Term| matches!(term.of, Of::Power { .. });
        model.differences > 0
            || model.terms.iter().any(is_power)
            || model.noises.iter().any(wanders)
    })
}

/// The note of a model that has no regressor left, and yet predicts no constant.
pub(super) const FROM_PAST_ALONE: &str =
    "no regressor is left, so it predicts from the past of the truth alone";

/// The truths of the complete rows.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Truths {
    pub(super) rows: u64,
    first: f64,
    /// Whether another one differs from the first.
    changes: bool,
    mean: f64,
    /// The sum of the squares about the mean.
    squares: f64,
}

impl Truths {
    /// One more (Welford 1962).
    pub(super) fn count(&mut self, truth: f64) {
        if self.rows == 0 {
            self.first = truth;
        }
        self.changes |= truth != self.first;
        self.rows += 1;
        let off = truth - self.mean;
        self.mean += off / self.rows as f64;
        self.squares += off * (truth - self.mean);
    }

    /// Those of other rows, which come after (Chan, Golub and LeVeque 1979).
    pub(super) fn merge(&mut self, other: &Self) {
        if self.rows == 0 || other.rows == 0 {
            if other.rows > 0 {
                *self = *other;
            }
            return;
        }
        self.changes |= other.changes || other.first != self.first;
        let rows = self.rows + other.rows;
        let (off, share) = (other.mean - self.mean, other.rows as f64 / rows as f64);
        self.squares += other.squares + off * off * self.rows as f64 * share;
        self.mean += off * share;
        self.rows = rows;
    }

    /// Notes a fit that says little, for all that its error may be small; `asked_for` is how many regressors its node has, and
    /// `learns` whether it sees truths while it runs.
    pub(super) fn doubt(
        self,
        predictor: &dyn Predictor,
        (asked_for, learns): (usize, bool),
        report: &mut TrainingReport,
    ) {
        if asked_for > 0 && predictor.uses().is_empty() {
            report.figure("regressors_left", 0_usize);
            let note = if learns && looks_back(predictor) {
                FROM_PAST_ALONE
            } else {
                "no regressor is left to predict from"
            };
            report.notes.push(note.to_owned());
        }
        if !self.changes {
            report.figure("constant_truth", self.first);
            report.notes.push(
                "the truth never changes in these rows, so nothing is learned of what moves it"
                    .to_owned(),
            );
        }
        self.doubt_few_rows(predictor, report);
        self.doubt_large_error(report);
    }

    /// Notes a fit with so many coefficients that it can meet its rows whatever they are.
    fn doubt_few_rows(self, predictor: &dyn Predictor, report: &mut TrainingReport) {
        let terms = predictor.coefficients().map_or(Vec::new(), |all| all.terms);
        let fitted = terms.iter().filter(|term| term.value != 0.0).count();
        if self.changes && fitted as u64 >= self.rows {
            report.figure("fitted_coefficients", fitted);
            report.notes.push(format!(
                "{} for {}, so the error on these rows says nothing of others: a fit needs more rows",
                counted(self.rows, "row"),
                counted(fitted as u64, "coefficient"),
            ));
        }
    }

    /// Notes a fit that is clearly worse on its rows than their mean.
    fn doubt_large_error(self, report: &mut TrainingReport) {
        let Some(rmse) = report.in_sample_rmse else {
            return;
        };
        let of_mean = (self.squares / self.rows as f64).sqrt();
        let clearly = rmse > WORSE_THAN_MEAN * of_mean + ROUNDING * self.mean.abs();
        let has_outliers = |error: f64| error <= WORSE_THAN_MEAN;
        if clearly && !report.robust_error.is_some_and(has_outliers) {
            let times = rmse / of_mean;
            report.figure("rmse_over_that_of_mean", times);
            let times = match times {
                few if few < 1e4 => format!("{few:.1}"),
                many => format!("{many:.0e}"),
            };
            report.notes.push(format!(
                "the error on the rows of the fit is {times} times that of predicting their mean, so this fit is of no use"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Duration;

    #[test]
    fn truths_in_two_parts_are_those_of_all_rows() {
        let truths: Vec<f64> = (0..40).map(|i| 100.0 + f64::from(i).sin()).collect();
        let of = |truths: &[f64]| {
            let mut all = Truths::default();
            truths.iter().for_each(|truth| all.count(*truth));
            all
        };
        let (whole, mut parts) = (of(&truths), Truths::default());
        for part in [&truths[..7], &[], &truths[7..]] {
            parts.merge(&of(part));
        }
        assert_eq!((parts.rows, parts.first, parts.changes), (40, 100.0, true));
        assert!((parts.mean - whole.mean).abs() < 1e-12);
        assert!((parts.squares - whole.squares).abs() < 1e-12);
        let mut same = of(&[3.0, 3.0]);
        same.merge(&of(&[3.0]));
        assert!(!same.changes);
        same.merge(&of(&[4.0]));
        assert!(same.changes);
    }

    #[test]
    fn a_fit_that_outliers_cannot_pull_is_judged_by_most_of_its_rows() {
        let mut truths = Truths::default();
        for truth in [-1.0, 1.0, -1.0, 1.0] {
            truths.count(truth);
        }
        for (robust_error, doubted) in [(None, true), (Some(0.3), false), (Some(2.0), true)] {
            let mut report = TrainingReport {
                in_sample_rmse: Some(1.5),
                robust_error,
                ..TrainingReport::default()
            };
            truths.doubt_large_error(&mut report);
            assert_eq!(!report.notes.is_empty(), doubted, "{robust_error:?}");
        }
    }

    #[test]
    fn a_row_counts_for_a_sensor_whichever_of_its_regressors_is_missing() {
        let regressor = |name: &str, sensor: &str| Regressor {
            name: name.to_owned(),
            unit: "K".to_owned(),
            sensors: vec![sensor.to_owned()],
            lag: Duration::ZERO,
            of_truth: false,
        };
        let regressors = [
            regressor("a", "t.a"),
            regressor("a lag 1min", "t.a"),
            regressor("b", "t.b"),
        ];
        let mut lacking = Lacking::new(regressors.iter());
        for row in [
            [f64::NAN, 1.0, f64::NAN],
            [1.0, f64::NAN, 1.0],
            [f64::NAN; 3],
        ] {
            lacking.count(&row, 1);
        }
        let expected = [("t.a".to_owned(), 3), ("t.b".to_owned(), 2)];
        assert_eq!(lacking.named(), expected);
    }
}
