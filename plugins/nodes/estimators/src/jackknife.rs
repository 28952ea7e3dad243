//! Decides how much of a linear fit is owed to the rows that it happens to have: what it says without each part of them in turn.

use std::collections::BTreeMap;

use athermal_core::node::{Figure, TrainingReport};
use athermal_numerics::{Folds, Gram, GramBlocks};

/// Into how many parts rows are cut, in their order: what follows each other hangs together, and stays together.
const PARTS: usize = 10;
/// A part has so many rows for each coefficient, at least.
const ROWS_EACH: usize = 2;
/// Of wider rows all parts together take too much memory.
const WIDEST: usize = 400;

/// The name of a regressor without its window or lag: what several regressors have in common that are made of one input.
#[must_use]
pub fn input_of(regressor: &str) -> &str {
    let name = regressor.split(" lag ").next().unwrap_or(regressor);
    name.split('@').next().unwrap_or(name)
}

/// Reports the standard errors of a fit of these regressors: of the sum of the coefficients of each input, and of the logarithm of the
/// error on the rows. `fit` gives coefficients and the sum of the squared residuals on some of the rows.
///
/// They are those of the jackknife that leaves out a part at a time (Quenouille 1956, "Notes on bias in estimation", Biometrika 43;
/// Künsch 1989, "The jackknife and the bootstrap for general stationary observations", Annals of Statistics 17). So rows whose errors hang
/// together do not count as so many.
pub(crate) fn tell(
    blocks: &GramBlocks,
    regressors: &[String],
    fit: impl Fn(&Gram) -> Option<(Vec<f64>, f64)>,
    report: &mut TrainingReport,
) {
    let fewest = PARTS * ROWS_EACH * (regressors.len() + 1);
    if blocks.width() > WIDEST || blocks.count() < fewest as u64 {
        return;
    }
    let Ok(splits) = blocks.splits(&Folds::contiguous(PARTS)) else {
        return;
    };
    let mut sums: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut logs = Vec::new();
    for split in &splits {
        let Some((coefficients, squares)) = fit(&split.train) else {
            return;
        };
        let mut of_part: BTreeMap<&str, f64> = BTreeMap::new();
        for (name, value) in regressors.iter().zip(coefficients) {
            *of_part.entry(input_of(name)).or_default() += value;
        }
        for (input, sum) in of_part {
            sums.entry(input).or_default().push(sum);
        }
        logs.push(0.5 * (squares / split.train.count() as f64).ln());
    }
    let errors = sums.iter().map(|(input, of)| (*input, standard_error(of)));
    report.figure("input_errors", Figure::named(errors));
    report.figure("log_rmse_error", standard_error(&logs));
}

/// That of what was found without each part in turn.
fn standard_error(found: &[f64]) -> f64 {
    let count = found.len() as f64;
    let mean = found.iter().sum::<f64>() / count;
    let squares: f64 = found.iter().map(|of| (of - mean).powi(2)).sum();
    (squares * (count - 1.0) / count).sqrt()
}

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;
    use athermal_numerics::{LeastSquares, Standardization};

    use super::*;

    #[test]
    fn windows_and_lags_are_no_part_of_the_name_of_an_input() {
        let names = ["gradients.room@150s", "drift.Z1 lag 5min", "room"];
        assert_eq!(names.map(input_of), ["gradients.room", "drift.Z1", "room"]);
    }

    /// What a fit says of the sum of both coefficients, and how sure it says it is; what disturbs stays for so many rows.
    fn fitted(seed: u64, stays: usize) -> (f64, f64) {
        let mut random = Prng::stream(seed, "rows that hang together");
        let mut blocks = GramBlocks::new(2);
        let (mut x, mut error) = ([0.0; 2], 0.0);
        for row in 0..2000 {
            if row % stays == 0 {
                x = [random.normal(), random.normal()];
                error = random.normal();
            }
            blocks.push(&x, x[0] + 2.0 * x[1] + error);
        }
        let scales = Standardization::of(&blocks.total()).scales;
        let fit = |gram: &Gram| {
            let of = LeastSquares::ridge(1.0)
                .solve(gram, &[0, 1], &scales, None)
                .ok()?;
            Some((of.coefficients, of.residual_sum_of_squares))
        };
        let mut report = TrainingReport::default();
        let names = ["a@1s", "a@2s"].map(str::to_owned);
        tell(&blocks, &names, fit, &mut report);
        let Some(Figure::Named(errors)) = report.figures.get("input_errors") else {
            panic!("{report:?}");
        };
        (fit(&blocks.total()).unwrap().0.iter().sum(), errors["a"].0)
    }

    #[test]
    fn standard_errors_are_those_that_fits_of_other_rows_show_whether_or_not_rows_hang_together() {
        for stays in [1, 20] {
            let fits: Vec<(f64, f64)> = (0..60).map(|seed| fitted(seed, stays)).collect();
            let (shown, said): (f64, f64) = fits.iter().fold((0.0, 0.0), |(shown, said), fit| {
                (shown + (fit.0 - 3.0).powi(2), said + fit.1.powi(2))
            });
            let ratio = (said / shown).sqrt();
            assert!((0.8..1.3).contains(&ratio), "{stays}: {ratio}");
        }
    }
}
