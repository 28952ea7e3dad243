//! What machines of one type have in common. Decides the mean and covariance of their coefficients, and how much those count beside
//! a new machine's own rows; does not decide which machines are of a type.

use crate::likeness::{Distribution, Normal};
use crate::prior::CoefficientPrior;
use crate::{Gram, LeastSquares, NumericsError, Standardization};
use faer::Mat;

/// So many machines say how machines differ.
pub const FEWEST_MACHINES: usize = 4;

/// How much of the share of Ledoit and Wolf the covariance is shrunk by in each round, as is tried.
const SHARES: [f64; 3] = [0.0, 0.1, 1.0];

/// So many groups of machines are left out in turn, at most.
const GROUPS: usize = 30;

/// The rows of one machine.
#[derive(Debug, Clone)]
pub struct MachineRows {
    /// All of them.
    pub total: Gram,
    /// Short stretches of them, each as long as what a new machine may have.
    pub stretches: Vec<Gram>,
}

/// What machines have in common.
#[derive(Debug, Clone, PartialEq)]
pub struct Pooled {
    /// Mean and covariance of their coefficients.
    pub prior: CoefficientPrior,
    /// How much of the covariance is the same for all coefficients, 0 to 1.
    pub shrinkage: f64,
    /// The best penalty of those that were tried, in squares of the target's unit.
    pub penalty: f64,
    /// Its place among them.
    pub place: usize,
    /// Of each penalty tried the geometric mean, over machines and stretches, of the root mean square error on the machine's other rows
    /// of a fit to the stretch, towards a prior of the other machines.
    pub errors: Vec<f64>,
    /// The same of the other machines' mean, without a fit.
    pub error_of_mean: f64,
}

/// Pools machines whose rows have the same columns.
///
/// Columns are in the scale `s` of all machines: of `z = (a, s b)` with `M` machines mean and covariance are found in two steps.
///
/// 1. Each machine's coefficients are those of ridge with the penalty `alpha`. The mean is the arithmetic one and the covariance the
///    sample's, shrunk towards a multiple of the unit matrix by the share of Ledoit and Wolf (2004), lemma 3.2 and equations 14 to 17:
///    `Σ = ρ m I + (1 − ρ) S` with `m = tr S / p`, `d² = ‖S − mI‖²`, `ρ = min(d², Σ ‖z zᵀ − S‖² / M²) / d²`.
/// 2. That covariance also holds the doubt of each machine's own fit. Rounds of expectation and maximisation from there (Dempster, Laird
///    and Rubin 1977; Laird and Ware 1982) leave what differs beyond it. In each round it is shrunk by `ρ`, a tenth of `ρ`, or nothing.
///
/// That share and the penalty towards the prior, one of `variances`, in variances of the residuals of the machines' own fits, are those
/// whose fits to single stretches of a machine that is left out have the smallest error on its other rows. Of more than 30 machines each
/// thirtieth is left out at a time.
///
/// # Errors
/// [`NumericsError::TooFewRows`] for fewer than [`FEWEST_MACHINES`] machines, [`NumericsError::Width`],
/// [`NumericsError::NoConvergence`], and those of [`LeastSquares::solve`].
pub fn pool(
    machines: &[MachineRows],
    alpha: f64,
    variances: &[f64],
) -> Result<Pooled, NumericsError> {
    if machines.len() < FEWEST_MACHINES {
        return Err(NumericsError::TooFewRows {
            needed: FEWEST_MACHINES as u64,
            found: machines.len() as u64,
        });
    }
    let scale = CommonScale::of(machines)?;
    let known = machines
        .iter()
        .map(|machine| scale.machine(machine, alpha))
        .collect::<Result<Vec<Machine>, NumericsError>>()?;
    let noise = known.iter().map(|of| of.noise).sum::<f64>() / known.len() as f64;
    let penalties: Vec<f64> = variances.iter().map(|variance| variance * noise).collect();
    let mut tried = SHARES.map(|_| (vec![0.0; penalties.len()], 0.0));
    let mut tests = 0.0;
    let groups = GROUPS.min(machines.len());
    for group in 0..groups {
        let (left_out, others): (Vec<usize>, Vec<usize>) =
            (0..machines.len()).partition(|place| place % groups == group);
        let others: Vec<&Machine> = others.iter().map(|&place| &known[place]).collect();
        let mut of_machines = Vec::new();
        for place in left_out {
            let MachineRows { total, stretches } = &machines[place];
            for stretch in stretches {
                let rest = total.weight() - stretch.weight();
                if stretch.count() > 0 && rest > 0.0 {
                    of_machines.push((&known[place].rows, scale.normal(stretch), rest));
                }
            }
        }
        tests += of_machines.len() as f64;
        for (share, (logs, of_mean)) in SHARES.iter().zip(&mut tried) {
            let (prior, _) = distribution(&others, *share)?;
            for (total, stretch, rest) in &of_machines {
                let error = |theta: &[f64]| {
                    let left = total.errors(theta) - stretch.errors(theta);
                    0.5 * (left.max(f64::MIN_POSITIVE) / rest).ln()
                };
                *of_mean += error(&prior.mean);
                for (&penalty, log) in penalties.iter().zip(&mut *logs) {
                    let fit = prior.fit(stretch, penalty);
                    *log += error(&fit.ok_or(NumericsError::NoConvergence)?);
                }
            }
        }
    }
    let places = (0..SHARES.len()).flat_map(|s| (0..penalties.len()).map(move |p| (s, p)));
    let log = |(share, place): (usize, usize)| tried[share].0[place];
    let better = |a, b| if log(b) < log(a) { b } else { a };
    let (Some((share, place)), true) = (places.reduce(better), tests > 0.0) else {
        return Err(NumericsError::TooFewRows {
            needed: 1,
            found: 0,
        });
    };
    let all: Vec<&Machine> = known.iter().collect();
    let (prior, shrinkage) = distribution(&all, SHARES[share])?;
    let (logs, of_mean) = &tried[share];
    Ok(Pooled {
        prior: scale.prior(&prior),
        shrinkage,
        penalty: penalties[place],
        place,
        errors: logs.iter().map(|log| (log / tests).exp()).collect(),
        error_of_mean: (of_mean / tests).exp(),
    })
}

/// What is known of one machine, in the common scale.
struct Machine {
    rows: Normal,
    /// The coefficients of its own fit.
    own: Vec<f64>,
    /// The variance of what that leaves.
    noise: f64,
}

/// The distribution of machines' coefficients, and how much of its covariance is the same for all coefficients.
fn distribution(machines: &[&Machine], share: f64) -> Result<(Distribution, f64), NumericsError> {
    let estimates: Vec<&[f64]> = machines.iter().map(|of| of.own.as_slice()).collect();
    let (start, shrinkage) = shrunk(&estimates).ok_or(NumericsError::NoConvergence)?;
    let rows: Vec<(&Normal, f64)> = machines.iter().map(|of| (&of.rows, of.noise)).collect();
    let shrinkage = share * shrinkage;
    Ok((start.of_rows(&rows, shrinkage), shrinkage))
}

/// Where columns are counted from and in what, for all machines alike.
struct CommonScale {
    centre: Vec<f64>,
    scales: Vec<f64>,
}

impl CommonScale {
    /// The means over machines of their columns' means and variances.
    fn of(machines: &[MachineRows]) -> Result<Self, NumericsError> {
        let width = machines[0].total.width();
        let (mut centre, mut variances) = (vec![0.0; width], vec![0.0; width]);
        let share = 1.0 / machines.len() as f64;
        for machine in machines {
            let found = machine.total.width();
            if found != width {
                return Err(NumericsError::Width {
                    expected: width,
                    found,
                });
            }
            let own = Standardization::of(&machine.total);
            for column in 0..width {
                centre[column] += share * own.means[column];
                variances[column] += share * own.variances[column];
            }
        }
        let scale = |&variance: &f64| if variance > 0.0 { variance.sqrt() } else { 1.0 };
        Ok(Self {
            centre,
            scales: variances.iter().map(scale).collect(),
        })
    }

    fn normal(&self, gram: &Gram) -> Normal {
        Normal::of(gram, &self.centre, &self.scales)
    }

    fn machine(&self, machine: &MachineRows, alpha: f64) -> Result<Machine, NumericsError> {
        let columns: Vec<usize> = (0..self.centre.len()).collect();
        let total = &machine.total;
        let fit = LeastSquares::ridge(alpha).solve(total, &columns, &self.scales, None)?;
        let terms = fit.coefficients.iter().zip(&self.centre);
        let constant = terms.fold(fit.intercept, |sum, (b, c)| sum + b * c);
        let scaled = fit.coefficients.iter().zip(&self.scales);
        // Rows without any error have to be pulled by something.
        let least = 1e-12 * total.variances().last().copied().unwrap_or(0.0);
        let noise = fit.residual_sum_of_squares / total.weight();
        Ok(Machine {
            rows: self.normal(total),
            own: [constant]
                .into_iter()
                .chain(scaled.map(|(b, s)| b * s))
                .collect(),
            noise: noise.max(least).max(f64::MIN_POSITIVE.sqrt()),
        })
    }

    /// The same in the units of the columns.
    fn prior(&self, of: &Distribution) -> CoefficientPrior {
        let unit = |k: usize| if k == 0 { 1.0 } else { self.scales[k - 1] };
        let cells = (0..of.mean.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        CoefficientPrior {
            centre: self.centre.clone(),
            covariance: cells
                .map(|(i, j)| of.covariance[(i, j)] / (unit(i) * unit(j)))
                .collect(),
            mean: of
                .mean
                .iter()
                .enumerate()
                .map(|(k, z)| z / unit(k))
                .collect(),
        }
    }
}

/// Mean and shrunk covariance of machines' own coefficients, and the share of what was shrunk.
fn shrunk(estimates: &[&[f64]]) -> Option<(Distribution, f64)> {
    let (order, machines) = (estimates[0].len(), estimates.len() as f64);
    let mean: Vec<f64> = (0..order)
        .map(|k| estimates.iter().map(|of| of[k]).sum::<f64>() / machines)
        .collect();
    let apart: Vec<Vec<f64>> = estimates
        .iter()
        .map(|of| of.iter().zip(&mean).map(|(z, m)| z - m).collect())
        .collect();
    let sample = Mat::from_fn(order, order, |i, j| {
        apart.iter().map(|of| of[i] * of[j]).sum::<f64>() / machines
    });
    let level = (0..order).map(|i| sample[(i, i)]).sum::<f64>() / order as f64;
    let norm = |cell: &dyn Fn(usize, usize) -> f64| {
        let cells = (0..order).flat_map(|i| (0..order).map(move |j| (i, j)));
        cells.map(|(i, j)| cell(i, j).powi(2)).sum::<f64>()
    };
    let unit = |i: usize, j: usize| if i == j { level } else { 0.0 };
    let distance = norm(&|i, j| sample[(i, j)] - unit(i, j));
    let errors = apart
        .iter()
        .map(|of| norm(&|i, j| of[i] * of[j] - sample[(i, j)]));
    let error = (errors.sum::<f64>() / (machines * machines)).min(distance);
    let shrinkage = if distance > 0.0 {
        error / distance
    } else {
        1.0
    };
    // Of a sample about its own mean.
    let unbiased = machines / (machines - 1.0);
    // Machines that are all the same leave something to divide by.
    let level = level.max(f64::MIN_POSITIVE.sqrt());
    let covariance = Mat::from_fn(order, order, |i, j| {
        let target = if i == j { level } else { 0.0 };
        unbiased * (shrinkage * target + (1.0 - shrinkage) * sample[(i, j)])
    });
    Some((Distribution::new(mean, covariance)?, shrinkage))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draws;

    #[test]
    fn the_covariance_is_that_of_ledoit_and_wolf_in_scikit_learn() {
        // scikit-learn 1.9.1, `LedoitWolf().fit(rows)`, which divides by the number of rows.
        let rows = [
            [-1.5, -3.0, 3.0],
            [0.5, 2.0, -0.75],
            [-1.5, -2.0, 2.5],
            [-1.0, -2.0, 3.25],
            [-1.25, -1.75, 1.75],
            [1.0, 2.5, -2.25],
            [-0.75, -0.875, 1.125],
            [0.0, 1.125, -1.125],
            [0.0, 0.625, 0.625],
            [-0.75, -1.0, 1.5],
            [1.0, 2.75, -1.5],
            [-1.25, -2.5, 2.5],
        ];
        let expected = [
            0.943_281_274_631_086_7,
            1.571_262_560_126_603,
            3.741_707_450_275_448_4,
            -1.377_191_153_054_524_4,
            -3.112_996_837_517_341,
            3.179_377_594_537_909_2,
        ];
        let scale = CommonScale {
            centre: vec![0.0; 2],
            scales: vec![1.0, 4.0],
        };
        let estimates: Vec<&[f64]> = rows.iter().map(<[f64; 3]>::as_slice).collect();
        let (found, shrinkage) = shrunk(&estimates).unwrap();
        let prior = scale.prior(&found);
        assert!(
            (shrinkage - 0.083_728_438_741_662).abs() < 1e-12,
            "{shrinkage}"
        );
        let units = [1.0, 1.0, 1.0, 4.0, 4.0, 16.0];
        for ((found, expected), unit) in prior.covariance.iter().zip(expected).zip(units) {
            let found = found * unit * 11.0 / 12.0;
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
        assert!((prior.mean[2] - 0.885_416_666_666_666_6 / 4.0).abs() < 1e-12);
        prior.check().unwrap();
    }

    /// So many machines whose coefficients differ in one direction only, with 600 rows each and stretches of 20.
    fn fleet(machines: u64, apart: f64) -> Vec<MachineRows> {
        let mut of_machine = draws::normal(77);
        let machine = |seed| {
            let mut normal = draws::normal(seed);
            let along = apart * of_machine();
            let slopes = [2.0 + along, -1.0 + along, 0.5];
            let mut rows = MachineRows {
                total: Gram::new(3),
                stretches: vec![Gram::new(3); 30],
            };
            for row in 0..600 {
                let x: [f64; 3] = [normal(), normal(), normal()];
                let y: f64 = x.iter().zip(slopes).map(|(x, b)| x * b).sum();
                let y = y + 5.0 + 3.0 * normal();
                rows.total.push(&x, y);
                rows.stretches[row / 20].push(&x, y);
            }
            rows
        };
        (1..=machines).map(machine).collect()
    }

    const VARIANCES: [f64; 7] = [1e-3, 0.1, 1.0, 10.0, 100.0, 1e4, 1e7];

    #[test]
    fn a_prior_of_machines_is_better_than_their_mean_and_than_no_prior() {
        let pooled = pool(&fleet(24, 2.0), 1.0, &VARIANCES).unwrap();
        let best = pooled.errors[pooled.place];
        // The noise of the rows is 3, its variance 9; rows are independent, so that is the right penalty.
        assert_eq!(pooled.place, 2, "{:?}", pooled.errors);
        assert!((pooled.penalty - 9.0).abs() < 0.5, "{}", pooled.penalty);
        assert!(best < 3.15, "{best}");
        assert!(
            pooled.error_of_mean > 1.15 * best,
            "{}",
            pooled.error_of_mean
        );
        assert!(pooled.errors[0] > 1.03 * best, "{:?}", pooled.errors);
        // So large a penalty leaves the mean.
        assert!((pooled.errors[6] / pooled.error_of_mean - 1.0).abs() < 1e-3);
        // The first two differ from machine to machine, by the same.
        let mean = &pooled.prior.mean;
        assert!((mean[0] - 5.0).abs() < 0.1, "{mean:?}");
        assert!((mean[1] - mean[2] - 3.0).abs() < 0.15, "{mean:?}");
        assert!((mean[3] - 0.5).abs() < 0.1, "{mean:?}");
    }

    #[test]
    fn machines_that_are_alike_are_pulled_to_their_mean() {
        let pooled = pool(&fleet(12, 0.0), 1.0, &VARIANCES).unwrap();
        assert!(pooled.place >= 2, "{:?}", pooled.errors);
        assert!(pooled.errors[pooled.place] < 3.05);
    }

    #[test]
    fn the_covariance_of_machines_with_few_rows_is_nearer_the_true_one_than_that_of_their_fits() {
        let slopes_differ_by = [1.0, 0.5, 0.1];
        let (mut of_machine, mut normal) = (draws::normal(31), draws::normal(32));
        let machines: Vec<MachineRows> = (0..60)
            .map(|_| {
                let slopes = slopes_differ_by.map(|by| 2.0 + by * of_machine());
                let mut rows = MachineRows {
                    total: Gram::new(3),
                    stretches: vec![Gram::new(3); 2],
                };
                for row in 0..20 {
                    let x = [normal(), normal(), normal()];
                    let y: f64 = x.iter().zip(slopes).map(|(x, b)| x * b).sum();
                    let y = y + 2.0 * normal();
                    rows.total.push(&x, y);
                    rows.stretches[row / 10].push(&x, y);
                }
                rows
            })
            .collect();
        let pooled = pool(&machines, 1.0, &VARIANCES).unwrap();
        let fits = machines.iter().map(|of| {
            let scales = Standardization::of(&of.total).scales;
            let fit = LeastSquares::ridge(1.0).solve(&of.total, &[0, 1, 2], &scales, None);
            fit.unwrap().coefficients
        });
        let fits: Vec<Vec<f64>> = fits.collect();
        let mean = |k: usize| fits.iter().map(|of| of[k]).sum::<f64>() / 60.0;
        let sample = |i: usize, j: usize| {
            let terms = fits.iter().map(|of| (of[i] - mean(i)) * (of[j] - mean(j)));
            terms.sum::<f64>() / 59.0
        };
        let distance = |covariance: &dyn Fn(usize, usize) -> f64| {
            let cells = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
            let apart = cells.map(|(i, j)| {
                let truth = if i == j {
                    slopes_differ_by[i].powi(2)
                } else {
                    0.0
                };
                (covariance(i, j) - truth).powi(2)
            });
            apart.sum::<f64>().sqrt()
        };
        // Behind the constant.
        let own = |i: usize, j: usize| {
            let (low, high) = (i.min(j) + 1, i.max(j) + 1);
            pooled.prior.covariance[high * (high + 1) / 2 + low]
        };
        let (own, sample) = (distance(&own), distance(&sample));
        assert!(own < 0.7 * sample, "{own} beside {sample}");
    }

    #[test]
    fn three_machines_are_too_few() {
        let error = pool(&fleet(3, 1.0), 1.0, &VARIANCES).unwrap_err();
        let expected = NumericsError::TooFewRows {
            needed: 4,
            found: 3,
        };
        assert_eq!(error, expected);
    }
}
