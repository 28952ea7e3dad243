//! Decides how columns that say nothing new are reported; what is made of them is each estimator's.

use athermal_core::node::{Figure, TrainingReport};
use athermal_numerics::{Gram, LeastSquares, LinearFit, Standardization};

/// Names the columns of a fit that are nearly a combination of others.
pub(crate) fn name_columns<'a>(
    fit: &LinearFit,
    name: impl Fn(usize) -> &'a str,
    report: &mut TrainingReport,
) {
    let names: Vec<&str> = fit.collinear.iter().map(|&column| name(column)).collect();
    if !names.is_empty() {
        let all = names.join(", ");
        report
            .notes
            .push(format!("nearly a combination of the others: {all}"));
        report.figure("collinear", Figure::names(names));
    }
}

/// The same of all columns of some rows, with their condition number, for a fit that is not made by least squares.
pub(crate) fn tell_columns<'a>(
    gram: &Gram,
    name: impl Fn(usize) -> &'a str,
    report: &mut TrainingReport,
) {
    if gram.width() == 0 {
        return;
    }
    let all: Vec<usize> = (0..gram.width()).collect();
    let scales = Standardization::of(gram).scales;
    if let Ok(fit) = LeastSquares::ridge(1.0).solve(gram, &all, &scales, None) {
        report.condition = Some(fit.condition);
        name_columns(&fit, name, report);
    }
}

/// The same of rows that stand one after the other.
pub(crate) fn tell_rows(
    names: &[String],
    rows: &[f64],
    truths: impl Iterator<Item = f64>,
    report: &mut TrainingReport,
) {
    let mut gram = Gram::new(names.len());
    for (row, truth) in rows.chunks_exact(names.len().max(1)).zip(truths) {
        gram.push(row, truth);
    }
    tell_columns(&gram, |column| &names[column], report);
}
