//! Decides in which folds R² says nothing, since the target hardly changes there; not what is made of the others.

use crate::Split;

/// A target whose variance in a fold is below this share of that of all test rows has no spread there: one such R² would rule the
/// mean.
const QUIET_SHARE: f64 = 1e-12;

/// The folds without a spread of the target beside that of all test rows; none where all are. They have no part in a mean of R².
pub fn quiet_folds(splits: &[Split]) -> Vec<usize> {
    let moments = splits.iter().map(|Split { test, .. }| {
        let target = test.width();
        (
            test.weight(),
            test.means()[target],
            test.variances()[target],
        )
    });
    let moments: Vec<(f64, f64, f64)> = moments.collect();
    let weight: f64 = moments.iter().map(|(weight, ..)| weight).sum();
    let sum: f64 = moments.iter().map(|(weight, mean, _)| weight * mean).sum();
    let centre = sum / weight;
    let squares = moments
        .iter()
        .map(|(weight, mean, variance)| weight * (variance + (mean - centre).powi(2)));
    let whole = squares.sum::<f64>() / weight;
    let folds = (0..splits.len()).filter(|&fold| moments[fold].2 <= QUIET_SHARE * whole);
    let quiet: Vec<usize> = folds.collect();
    if quiet.len() < splits.len() {
        quiet
    } else {
        Vec::new()
    }
}

/// The folds that are not quiet.
pub(crate) fn telling(splits: &[Split]) -> impl Iterator<Item = &Split> {
    let quiet = quiet_folds(splits);
    let folds = splits.iter().enumerate();
    folds.filter_map(move |(fold, split)| (!quiet.contains(&fold)).then_some(split))
}
