//! Ridges over the same rows with some of their columns left out, from one factorisation.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};

use crate::{Gram, Standardization};

/// A linear prediction from a row of regressors.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Its constant.
    pub intercept: f64,
    /// A coefficient for each column; 0 for those that are left out.
    pub coefficients: Vec<f64>,
}

/// The ridge with a penalty above 0 on the squares of the coefficients of standardised columns, and that without each group of columns.
/// With `P = (ZᵀZ + αI)⁻¹` and `b = PZᵀy`, what is left without the group `G` is `b - P_·G (P_GG)⁻¹ b_G`: the inverse of a matrix
/// without some of its rows and columns is a Schur complement of its inverse. None where the rows cannot be solved.
///
/// # Panics
/// When a group has a column that there is not.
#[must_use]
pub fn ridges_left_out(gram: &Gram, alpha: f64, groups: &[Vec<usize>]) -> Option<Vec<LeftOut>> {
    let width = gram.width();
    let Standardization { means, scales, .. } = Standardization::of(gram);
    let moments = gram.moments();
    let penalised = Mat::from_fn(width, width, |i, j| {
        moments[(i, j)] / (scales[i] * scales[j]) + if i == j { alpha } else { 0.0 }
    });
    let inverse = penalised.llt(Side::Lower).ok()?;
    let inverse = inverse.solve(Mat::<f64>::identity(width, width));
    let target = Mat::from_fn(width, 1, |i, _| moments[(i, width)] / scales[i]);
    let all = &inverse * &target;
    let of = |scaled: &dyn Fn(usize) -> f64| {
        let coefficients: Vec<f64> = (0..width).map(|i| scaled(i) / scales[i]).collect();
        let terms = coefficients.iter().zip(&means);
        let intercept = terms.fold(gram.means()[width], |rest, (b, mean)| rest - b * mean);
        let is_finite = intercept.is_finite() && coefficients.iter().all(|b| b.is_finite());
        is_finite.then_some(LeftOut {
            intercept,
            coefficients,
        })
    };
    let without = |group: &Vec<usize>| {
        let size = group.len();
        let own = Mat::from_fn(size, size, |i, j| inverse[(group[i], group[j])]);
        let gone = Mat::from_fn(size, 1, |i, _| all[(group[i], 0)]);
        let gone = own.llt(Side::Lower).ok()?.solve(gone);
        of(&|i| match group.contains(&i) {
            true => 0.0,
            false => {
                let terms = group.iter().enumerate();
                let taken = terms.map(|(nth, &column)| inverse[(i, column)] * gone[(nth, 0)]);
                all[(i, 0)] - taken.sum::<f64>()
            }
        })
    };
    let first = of(&|i| all[(i, 0)]);
    std::iter::once(first)
        .chain(groups.iter().map(without))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LeastSquares;

    #[test]
    fn what_is_left_out_is_what_a_ridge_over_the_other_columns_gives() {
        let mut gram = Gram::new(5);
        for nth in 0..200 {
            let t = f64::from(nth);
            let x = [
                t.sin(),
                (1.3 * t).cos(),
                t.sin() + 0.01 * (7.0 * t).sin(),
                20.0 + t,
                3.0,
            ];
            gram.push(&x, 2.0 * x[0] - x[1] + 0.1 * x[3] + (11.0 * t).sin());
        }
        let groups = [vec![0, 2], vec![3], vec![4], vec![0, 1, 2, 3, 4]];
        let found = ridges_left_out(&gram, 1.0, &groups).unwrap();
        let scales = Standardization::of(&gram).scales;
        for (found, group) in found
            .iter()
            .zip([&[][..], &[0, 2], &[3], &[4], &[0, 1, 2, 3, 4]])
        {
            let kept: Vec<usize> = (0..5).filter(|of| !group.contains(of)).collect();
            let fit = LeastSquares::ridge(1.0)
                .solve(&gram, &kept, &scales, None)
                .unwrap();
            assert!((found.intercept - fit.intercept).abs() < 1e-9, "{group:?}");
            for (column, value) in kept.iter().zip(&fit.coefficients) {
                assert!(
                    (found.coefficients[*column] - value).abs() < 1e-9,
                    "{group:?}"
                );
            }
            assert!(group.iter().all(|&of| found.coefficients[of] == 0.0));
        }
        assert_eq!(ridges_left_out(&Gram::new(2), f64::NAN, &[]), None);
    }
}
