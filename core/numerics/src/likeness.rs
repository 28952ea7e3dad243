//! The distribution that coefficients have over machines, from the rows of each. Decides neither their scale nor what a new machine
//! makes of it.

use crate::Gram;
use crate::normal_equations::Equilibrated;
use faer::Mat;

/// So many rounds of expectation and maximisation. On simulated die testers twenty rounds change the error on machines that are left out
/// by less than 0.1 %.
const ROUNDS: usize = 3;

/// Rows as normal equations of a constant and columns, each counted from a centre and in a scale.
pub(crate) struct Normal {
    cross: Mat<f64>,
    target: Vec<f64>,
    squares: f64,
}

impl Normal {
    pub(crate) fn of(gram: &Gram, centre: &[f64], scales: &[f64]) -> Self {
        let y = gram.width();
        let (weight, means) = (gram.weight(), gram.means());
        let about: Vec<f64> = centre.iter().copied().chain([0.0]).collect();
        let moments = gram.moments_about(&about);
        let unit = |k: usize| if k == 0 { 1.0 } else { scales[k - 1] };
        let sum = |column: usize| weight * (means[column] - about[column]);
        let cross = Mat::from_fn(y + 1, y + 1, |i, j| {
            let moment = match (i, j) {
                (0, 0) => weight,
                (0, k) | (k, 0) => sum(k - 1),
                _ => moments[(i - 1, j - 1)],
            };
            moment / (unit(i) * unit(j))
        });
        let target = (0..=y).map(|k| match k {
            0 => sum(y),
            k => moments[(k - 1, y)] / unit(k),
        });
        Self {
            target: target.collect(),
            cross,
            squares: moments[(y, y)],
        }
    }

    /// The weighted sum of the squared residuals of these coefficients.
    pub(crate) fn errors(&self, theta: &[f64]) -> f64 {
        let fitted = times(&self.cross, theta);
        let terms = theta.iter().zip(fitted).zip(&self.target);
        let sum: f64 = terms.map(|((of, fitted), y)| of * (fitted - 2.0 * y)).sum();
        (self.squares + sum).max(0.0)
    }
}

/// Mean and covariance of coefficients.
#[derive(Debug, Clone)]
pub(crate) struct Distribution {
    pub(crate) mean: Vec<f64>,
    pub(crate) covariance: Mat<f64>,
    precision: Mat<f64>,
}

impl Distribution {
    /// One with this covariance; none where that is not positive definite.
    pub(crate) fn new(mean: Vec<f64>, covariance: Mat<f64>) -> Option<Self> {
        Some(Self {
            mean,
            precision: inverse(&covariance)?,
            covariance,
        })
    }

    /// What the rows of machines make of it, each with the variance of its noise: some rounds of expectation and maximisation for a
    /// linear model whose coefficients are drawn anew for each machine (Dempster, Laird and Rubin 1977; Laird and Ware 1982).
    ///
    /// In a round each machine has the coefficients of its rows and of what is known of all, `θ = H (Xᵀy / σ² + Σ⁻¹μ)`, with the doubt
    /// `H = (XᵀX / σ² + Σ⁻¹)⁻¹` that is left. Then `μ` is the mean of `θ`, and `Σ` that of `H + (θ − μ)(θ − μ)ᵀ`, of which `share` is made
    /// the same for all coefficients. Rounds end where a matrix has no inverse: there the machines are all the same but for rounding.
    pub(crate) fn of_rows(self, machines: &[(&Normal, f64)], share: f64) -> Self {
        let (mut of, order, count) = (self, machines.first(), machines.len() as f64);
        let order = order.map_or(0, |(normal, _)| normal.target.len());
        for _ in 0..ROUNDS {
            let known = times(&of.precision, &of.mean);
            let mut covariance = Mat::zeros(order, order);
            let mut all = Vec::with_capacity(machines.len());
            for &(rows, noise) in machines {
                let sum = Mat::from_fn(order, order, |i, j| {
                    rows.cross[(i, j)] / noise + of.precision[(i, j)]
                });
                let Some(doubt) = inverse(&sum) else {
                    return of;
                };
                let target = rows.target.iter().zip(&known);
                let target: Vec<f64> = target.map(|(y, known)| y / noise + known).collect();
                all.push(times(&doubt, &target));
                covariance += doubt;
            }
            let mean: Vec<f64> = (0..order)
                .map(|k| all.iter().map(|theta| theta[k]).sum::<f64>() / count)
                .collect();
            for theta in &all {
                let apart: Vec<f64> = theta
                    .iter()
                    .zip(&mean)
                    .map(|(of, mean)| of - mean)
                    .collect();
                covariance += Mat::from_fn(order, order, |i, j| apart[i] * apart[j]);
            }
            let level = (0..order).map(|i| covariance[(i, i)]).sum::<f64>() / order as f64;
            let covariance = Mat::from_fn(order, order, |i, j| {
                let alike = if i == j { level } else { 0.0 };
                // To the bit the same on both sides of the diagonal.
                let own = 0.5 * (covariance[(i, j)] + covariance[(j, i)]);
                (share * alike + (1.0 - share) * own) / count
            });
            match Self::new(mean, covariance) {
                Some(next) => of = next,
                // Machines that are all the same but for rounding.
                None => return of,
            }
        }
        of
    }

    /// The coefficients of rows with this penalty.
    pub(crate) fn fit(&self, rows: &Normal, penalty: f64) -> Option<Vec<f64>> {
        let order = self.mean.len();
        let fitted = times(&rows.cross, &self.mean);
        let rest: Vec<f64> = rows
            .target
            .iter()
            .zip(fitted)
            .map(|(y, of)| y - of)
            .collect();
        let all = Mat::from_fn(order, order, |i, j| {
            rows.cross[(i, j)] + penalty * self.precision[(i, j)]
        });
        let shift = Equilibrated::of(&all, 0.0).solve(&rest, 0.0)?;
        Some(
            self.mean
                .iter()
                .zip(shift)
                .map(|(mean, of)| mean + of)
                .collect(),
        )
    }
}

fn times(matrix: &Mat<f64>, vector: &[f64]) -> Vec<f64> {
    let row = |i: usize| {
        vector
            .iter()
            .enumerate()
            .map(move |(j, of)| matrix[(i, j)] * of)
            .sum()
    };
    (0..vector.len()).map(row).collect()
}

fn inverse(matrix: &Mat<f64>) -> Option<Mat<f64>> {
    let positive = (0..matrix.nrows()).all(|i| matrix[(i, i)] > 0.0);
    let root = positive.then(|| Equilibrated::of(matrix, 0.0).inverse_root(0.0))??;
    let inverse = root.transpose() * &root;
    let is_finite = (0..inverse.nrows()).all(|i| inverse[(i, i)].is_finite());
    is_finite.then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Rows = (&'static [f64], &'static [f64]);

    const MACHINES: [Rows; 4] = [
        (&[-1.0, 0.0, 1.0, 2.0], &[0.5, 1.0, 2.5, 3.0]),
        (&[-2.0, 0.0, 1.0], &[4.0, 2.0, 1.5]),
        (&[0.0, 1.0, 2.0, 3.0, 4.0], &[1.0, 1.0, 2.0, 1.5, 3.0]),
        (&[-1.0, 3.0], &[0.0, 5.0]),
    ];

    fn normal((x, y): Rows) -> Normal {
        let mut gram = Gram::new(1);
        for (x, y) in x.iter().zip(y) {
            gram.push(&[*x], *y);
        }
        Normal::of(&gram, &[0.5], &[2.0])
    }

    fn start() -> Distribution {
        let covariance = [[2.0, 0.5], [0.5, 1.5]];
        Distribution::new(vec![1.5, 1.0], Mat::from_fn(2, 2, |i, j| covariance[i][j])).unwrap()
    }

    #[test]
    fn three_rounds_give_what_numpy_has_from_the_covariance_of_the_rows() {
        // numpy 2.4.6, with the rows' covariance S = AΣAᵀ + σ²: θ = μ + ΣAᵀS⁻¹(y − Aμ), H = Σ − ΣAᵀS⁻¹AΣ.
        let normals = MACHINES.map(normal);
        let noise = [0.25, 0.5, 0.25, 1.0];
        let rows: Vec<(&Normal, f64)> = normals.iter().zip(noise).collect();
        let found = start().of_rows(&rows, 0.1);
        let covariance = [
            [0.273_242_571_597_418_7, -0.060_897_578_911_787_3],
            [-0.060_897_578_911_787_3, 1.961_620_775_521_333_5],
        ];
        let mean = [1.626_565_992_647_781_3, 0.842_715_390_779_230_9];
        for (i, (mean, row)) in mean.into_iter().zip(covariance).enumerate() {
            assert!((found.mean[i] - mean).abs() < 1e-12, "{:?}", found.mean);
            for (j, expected) in row.into_iter().enumerate() {
                let of = found.covariance[(i, j)];
                assert!((of - expected).abs() < 1e-12, "{of} at {i}, {j}");
            }
        }
    }

    #[test]
    fn errors_and_a_fit_are_those_of_the_rows_one_by_one() {
        let (rows, theta) = (MACHINES[2], [1.2, -0.4]);
        let normal = normal(rows);
        let squares = |theta: &[f64]| {
            let terms = rows.0.iter().zip(rows.1);
            let errors = terms.map(|(x, y)| y - theta[0] - theta[1] * (x - 0.5) / 2.0);
            errors.map(|e| e * e).sum::<f64>()
        };
        assert!((normal.errors(&theta) - squares(&theta)).abs() < 1e-12);
        // The fit is the least of the squares with the penalty; the inverse of the covariance by hand.
        let objective = |theta: &[f64]| {
            let (a, b) = (theta[0] - 1.5, theta[1] - 1.0);
            squares(theta) + 0.7 * (1.5 * a * a - a * b + 2.0 * b * b) / 2.75
        };
        let fit = start().fit(&normal, 0.7).unwrap();
        for k in 0..2 {
            for step in [-1e-3, 1e-3] {
                let mut beside = fit.clone();
                beside[k] += step;
                assert!(objective(&beside) > objective(&fit), "{k}");
            }
        }
    }

    #[test]
    fn machines_that_are_the_same_leave_a_covariance_that_has_an_inverse() {
        let normal = normal(MACHINES[0]);
        let found = start().of_rows(&[(&normal, 1e-12); 5], 0.0);
        let apart = (0..2).map(|i| found.covariance[(i, i)]);
        assert!(apart.clone().all(|of| of > 0.0 && of < 1e-9), "{found:?}");
        assert!(inverse(&found.covariance).is_some());
    }
}
