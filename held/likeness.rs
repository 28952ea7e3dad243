//! The distribution that coefficients have over machines, from the rows of each. Decides neither their scale nor what a new machine
//! makes of it.

use crate::Gram;
use crate::normal_equations::Equilibrated;
use faer::Mat;

/// So many rounds change the covariance by no more than its own doubt.
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
#[derive(Clone)]
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

    /// What the rows of machines make of it, each with the variance of its noise: some rounds of expectation and maximisation of a
    /// linear model whose coefficients are drawn anew for each machine (Dempster, Laird and Rubin 1977; Laird and Ware 1982). In a
    /// round each machine's coefficients are those of its rows and of what is known of all, with the doubt that is left; mean and
    /// covariance are those of these. So what the rows of a machine do not say is no difference between machines. `share` of the covariance is made the same
    /// for all coefficients.
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
