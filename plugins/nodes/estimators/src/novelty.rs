//! How far rows are from those of a fit: what kinds of estimators share about the port `novelty`.

use athermal_core::node::Mistake;
use athermal_numerics::{GramBlocks, Novelty, Standardization};

/// How far rows are from those of a fit by some of their columns, where its rows were kept and say so.
pub(crate) fn novelty_of(
    blocks: &GramBlocks,
    standard: &Standardization,
    columns: &[usize],
) -> Option<Novelty> {
    Novelty::of(&blocks.total(), standard, columns, blocks.rows()?)
}

/// The same of rows that lie one after the other, by all their columns.
pub(crate) fn novelty_of_rows(width: usize, rows: &[f64]) -> Option<Novelty> {
    if width == 0 {
        return None;
    }
    let mut blocks = GramBlocks::new(width);
    rows.chunks_exact(width)
        .for_each(|row| blocks.push(row, 0.0));
    let standard = Standardization::of(&blocks.total());
    let columns: Vec<usize> = (0..width).collect();
    novelty_of(&blocks, &standard, &columns)
}

/// What of it, as a model file has it, does not fit so many columns.
pub(crate) fn novelty_mistakes(novelty: Option<&Novelty>, width: usize) -> Vec<Mistake> {
    novelty.map_or_else(Vec::new, |novelty| {
        Mistake::of_lengths(width, &[("novelty.means", novelty.width())])
    })
}

/// How far a row is outside; NaN where the fit does not say.
#[inline]
pub(crate) fn novelty_at(novelty: Option<&Novelty>, row: &[f64]) -> f64 {
    novelty.map_or(f64::NAN, |novelty| novelty.at(row))
}

/// How far a row is outside of what is known after learning went on: of what lies beyond the edge of the fit, as much as its variance
/// has become, `1 + (ν − 1) √(v / v₀)`, with the variance `v` that the coefficients bring into the prediction, and `v₀` that of the fit.
pub(crate) fn after_learning(novelty: f64, variances: impl FnOnce() -> [f64; 2]) -> f64 {
    if novelty > 1.0 {
        let [now, of_fit] = variances();
        let share = (now / of_fit).sqrt();
        if share.is_finite() {
            return 1.0 + (novelty - 1.0) * share;
        }
    }
    novelty
}

#[cfg(test)]
mod tests {
    use athermal_core::node::{Estimator, LearningLimits, Predictor, Regressor, TrainingSetup};
    use athermal_core::time::{Duration, Instant};
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn what_has_been_learned_beyond_the_edge_is_no_longer_new_and_what_has_been_forgotten_newer() {
        let after = |novelty: f64, now: f64| after_learning(novelty, || [now, 4.0]);
        assert_eq!(after(3.0, 4.0), 3.0);
        assert_eq!(after(3.0, 1.0), 2.0);
        assert_eq!(after(3.0, 0.0), 1.0);
        assert_eq!(after(3.0, 16.0), 5.0);
        assert_eq!(after(0.7, 0.0), 0.7);
        assert!(after(f64::NAN, 1.0).is_nan());
        assert_eq!(after_learning(3.0, || [0.0, 0.0]), 3.0);
    }

    const ROWS: i64 = 600;

    /// Two regressors that hardly leave their common direction, and a truth that is their sum and a wave.
    fn row(nth: i64) -> ([f64; 2], f64) {
        let t = nth as f64;
        let (along, across) = ((0.11 * t).sin(), 0.02 * (0.37 * t).cos());
        let row = [20.0 + along + across, 21.0 + along - across];
        (row, row[0] + row[1] + 0.1 * (0.71 * t).sin())
    }

    fn at(nth: i64) -> Instant {
        Instant::from_ns(nth * 10_000_000_000)
    }

    fn fitted<Kind: Estimator + serde::de::DeserializeOwned>(
        parameters: Value,
    ) -> Box<dyn Predictor> {
        let kind: Kind = serde_json::from_value(parameters).unwrap();
        let regressor = |name: &str| Regressor {
            name: name.to_owned(),
            unit: "K".to_owned(),
            sensors: vec![name.to_owned()],
            lag: Duration::ZERO,
            of_truth: false,
        };
        let mut trainer = kind.trainer(&TrainingSetup {
            instance: "one".to_owned(),
            regressors: vec![regressor("a"), regressor("b")],
            places: vec![0, 1],
            error_unit: "nm".to_owned(),
            memory: 1 << 20,
            ahead: Duration::ZERO,
            span: Duration::ZERO,
            learns: true,
            limits: LearningLimits::NONE,
        });
        for nth in 0..ROWS {
            let (row, truth) = row(nth);
            trainer.row_at(at(nth), &row, truth);
        }
        trainer.finish().unwrap().predictor
    }

    const APART: [f64; 2] = [20.4, 20.6];

    fn all() -> Vec<(&'static str, Box<dyn Predictor>)> {
        vec![
            ("linear", fitted::<crate::Linear>(json!({}))),
            ("rls", fitted::<crate::Rls>(json!({}))),
            ("kalman", fitted::<crate::Kalman>(json!({}))),
            (
                "narx",
                fitted::<crate::Narx>(json!({ "lags": ["0s"], "tolerance": 0.0, "degree": 1 })),
            ),
            ("stack", fitted::<crate::Stack>(json!({}))),
            (
                "state_space",
                fitted::<crate::StateSpace>(json!({ "states": 1 })),
            ),
            ("armax", fitted::<crate::Armax>(json!({}))),
        ]
    }

    #[test]
    fn every_kind_finds_the_rows_of_its_fit_inside_and_a_new_direction_outside() {
        for (kind, predictor) in all() {
            assert_eq!(predictor.uses(), ["a", "b"], "{kind}");
            let rows = (0..ROWS).map(|nth| predictor.novelty(&row(nth).0));
            assert!(rows.filter(|novelty| *novelty > 1.0).count() <= 1, "{kind}");
            let apart = predictor.novelty(&APART);
            assert!(apart > 3.0, "{kind}: {apart}");
            // A model of before has none, and predicts the same.
            let mut written = serde_json::to_value(&predictor).unwrap();
            assert!(
                written.as_object_mut().unwrap().remove("novelty").is_some(),
                "{kind}"
            );
            let older: Box<dyn Predictor> = serde_json::from_value(written).unwrap();
            assert!(
                older.mistakes().is_empty() && older.novelty(&APART).is_nan(),
                "{kind}"
            );
            assert_eq!(older.predict(&APART), predictor.predict(&APART), "{kind}");
        }
    }

    #[test]
    fn the_centre_is_what_is_predicted_in_the_middle_of_the_rows() {
        let mut means = [0.0; 2];
        for nth in 0..ROWS {
            let (row, _) = row(nth);
            means
                .iter_mut()
                .zip(row)
                .for_each(|(mean, x)| *mean += x / ROWS as f64);
        }
        for (kind, predictor) in all() {
            let (centre, middle) = (predictor.centre(), predictor.predict(&means));
            assert!(
                (centre - middle).abs() < 1e-6,
                "{kind}: {centre} and {middle}"
            );
        }
    }

    #[test]
    fn a_direction_that_was_learned_since_is_new_no_longer_to_what_knows_how_sure_it_is() {
        for (kind, predictor) in all() {
            let Some(mut learner) = predictor.learner() else {
                continue;
            };
            let along = [22.0, 23.0];
            assert_eq!(learner.novelty(&APART), predictor.novelty(&APART), "{kind}");
            let before = learner.novelty(&along);
            for nth in 0..60 {
                let off = 0.3 * (0.9 * nth as f64).sin();
                learner.learn(&[20.0 + off, 21.0 - off], 41.0, at(ROWS + nth));
            }
            let (new, fit) = (learner.novelty(&APART), predictor.novelty(&APART));
            match kind {
                "rls" | "kalman" => assert!(1.0 < new && new < 0.6 * fit, "{kind}: {fit} → {new}"),
                _ => assert_eq!(new, fit, "{kind}"),
            }
            assert!(learner.novelty(&along) <= before, "{kind}");
        }
    }
}
