//! Decides what the values of a fleet's machines have in common and how far machines differ, each value as sure as it is.

use athermal_numerics::{median, robust_deviation};

/// What lies further from the others, in standard deviations, has no part in what is said of the fleet.
const CUT: f64 = 3.0;
/// The variance of a standard normal variable within that.
const WITHIN: f64 = 0.973_337;
/// Below so much of the values a spread is one of rounding alone.
const ROUNDING: f64 = 1e-9;

/// A value, and its standard error; 0 where none is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

impl Measured {
    /// One of which no error is known.
    #[must_use]
    pub fn exactly(value: f64) -> Self {
        Self { value, error: 0.0 }
    }
}

/// The values of a fleet: what they are about, and how far machines are apart beside the errors of their values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Fleet {
    pub centre: f64,
    /// The variance of a machine's true value about the centre, and that of the centre itself.
    variance: f64,
    /// How many values it was found from, less one.
    pub freedom: f64,
}

impl Fleet {
    /// Of values of machines, those far from the others left out; none where there are too few, or they do not differ.
    ///
    /// Centre and variance are the mean and the variance between machines of a random-effects model, by Paule and Mandel (1982, "Consensus
    /// values and weighting factors", J. Res. NBS 87): the variance with which the squares of the standardised distances add up to what they
    /// are expected to.
    pub fn of(all: &[Measured], fewest: usize) -> Option<Self> {
        let all: Vec<Measured> = all
            .iter()
            .filter(|of| of.value.is_finite())
            .copied()
            .collect();
        if all.len() < fewest {
            return None;
        }
        let mut values: Vec<f64> = all.iter().map(|of| of.value).collect();
        let centre = median(&mut values)?;
        values
            .iter_mut()
            .for_each(|value| *value = (*value - centre).abs());
        let mut fleet = Self {
            centre,
            variance: robust_deviation(&mut values)?.powi(2),
            freedom: 0.0,
        };
        let mut kept = Vec::new();
        for _ in 0..20 {
            let size = |of: &Measured| ((of.value - fleet.centre).abs(), of.error);
            let is_near = |of: &&Measured| {
                let (size, error) = size(of);
                size <= CUT * (fleet.variance + error * error).sqrt()
            };
            let near: Vec<Measured> = all.iter().filter(is_near).copied().collect();
            // More than half of the machines are as they should be.
            if near == kept || 2 * near.len() <= all.len() {
                break;
            }
            fleet = Self::among(&near);
            kept = near;
        }
        let mut errors: Vec<f64> = kept.iter().map(|of| of.error).collect();
        let error = median(&mut errors)?;
        let width = (fleet.variance + error * error).sqrt();
        (kept.len() + 1 >= fewest && width > ROUNDING * fleet.centre.abs()).then_some(fleet)
    }

    fn among(near: &[Measured]) -> Self {
        let freedom = near.len() as f64 - 1.0;
        let at = |variance: f64| {
            let weights = near.iter().map(|of| 1.0 / (variance + of.error * of.error));
            let (mut sum, mut weighted) = (0.0, 0.0);
            for (of, weight) in near.iter().zip(weights.clone()) {
                sum += weight;
                weighted += weight * of.value;
            }
            let centre = weighted / sum;
            let squares = near
                .iter()
                .zip(weights)
                .map(|(of, weight)| weight * (of.value - centre).powi(2));
            (centre, squares.sum::<f64>(), 1.0 / sum)
        };
        let farthest = near.iter().map(|of| (of.value - near[0].value).powi(2));
        let farthest = farthest.fold(f64::MIN_POSITIVE, f64::max);
        // Values without errors are weighted too.
        let (mut low, mut high) = (1e-18 * farthest, 4.0 * farthest);
        if at(low).1 > freedom * WITHIN {
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                match at(middle).1 > freedom * WITHIN {
                    true => low = middle,
                    false => high = middle,
                }
            }
        } else {
            high = low;
        }
        let (centre, _, of_centre) = at(high);
        Self {
            centre,
            variance: high + of_centre,
            freedom,
        }
    }

    /// How far a machine is from the others, in standard deviations of one machine more.
    pub fn score(&self, of: Measured) -> f64 {
        (of.value - self.centre) / (self.variance + of.error * of.error).sqrt()
    }

    /// The value that one machine more exceeds with this chance.
    pub fn exceeded(&self, chance: f64) -> f64 {
        self.centre + student_quantile(chance, self.freedom) * self.variance.sqrt()
    }
}

/// The median of the variances of the errors that are known.
pub(crate) fn usual_error(all: &[Measured]) -> Option<f64> {
    let known = all.iter().map(|of| of.error.powi(2));
    median(&mut known.filter(|of| *of > 0.0).collect::<Vec<f64>>())
}

/// A value whose standard error is made surer by what those of the others are: the mean of its variance and theirs (as Smyth 2004, "Linear
/// models and empirical Bayes methods", moderates variances).
pub(crate) fn moderated(of: Measured, usual: Option<f64>) -> Measured {
    match usual {
        Some(usual) if of.error > 0.0 => Measured {
            error: (0.5 * (of.error.powi(2) + usual)).sqrt(),
            ..of
        },
        _ => of,
    }
}

/// The value that Student's t exceeds with this chance, by halving an interval.
pub(crate) fn student_quantile(chance: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while student_tail(high, freedom) > chance && high < 1e9 {
        high *= 2.0;
    }
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        match student_tail(middle, freedom) > chance {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

/// The chance that Student's t is larger than t > 0: half the regularised incomplete beta function of ν / (ν + t²) with ν/2 and 1/2
/// (Abramowitz & Stegun 26.7.1, 26.5.27).
fn student_tail(t: f64, freedom: f64) -> f64 {
    let x = freedom / (freedom + t * t);
    let (a, b) = (0.5 * freedom, 0.5);
    // The continued fraction converges fast below this; above it stands for the rest.
    match x < (a + 1.0) / (a + b + 2.0) {
        true => 0.5 * incomplete_beta(x, a, b),
        false => 0.5 * (1.0 - incomplete_beta(1.0 - x, b, a)),
    }
}

/// The regularised incomplete beta function by its continued fraction (Abramowitz & Stegun 26.5.8), from the front as Lentz does
/// (Press et al. 2007, "Numerical Recipes", section 6.4).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let kept = |value: f64| if value.abs() < TINY { TINY } else { value };
    let front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = libm::exp(front + a * libm::log(x) + b * libm::log1p(-x)) / a;
    let mut c = 1.0;
    let mut d = 1.0 / kept(1.0 - (a + b) * x / (a + 1.0));
    let mut fraction = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let before = fraction;
        for term in [even, odd] {
            d = 1.0 / kept(1.0 + term * d);
            c = kept(1.0 + term / c);
            fraction *= c * d;
        }
        if (fraction / before - 1.0).abs() < 1e-14 {
            break;
        }
    }
    front * fraction
}

#[cfg(test)]
mod tests {
    use athermal_core::prng::Prng;

    use super::*;

    #[test]
    fn the_tail_of_students_t_is_that_of_published_tables() {
        // Abramowitz & Stegun, table 26.10: t of one-sided chances 0.05, 0.005 and 0.0005.
        let table = [
            (1.0, [6.314, 63.657, 636.619]),
            (5.0, [2.015, 4.032, 6.869]),
            (30.0, [1.697, 2.750, 3.646]),
        ];
        for (freedom, quantiles) in table {
            for (chance, expected) in [0.05, 0.005, 0.0005].into_iter().zip(quantiles) {
                let found = student_quantile(chance, freedom);
                assert!(
                    (found - expected).abs() < 6e-4,
                    "{freedom} {chance}: {found}"
                );
            }
        }
    }

    #[test]
    fn errors_of_values_are_no_difference_between_machines_and_outliers_are_no_part_of_the_fleet() {
        let mut random = Prng::stream(3, "values of a fleet");
        for (between, error) in [(0.0, 1.0), (1.0, 0.3), (1.0, 2.0)] {
            let mut all: Vec<Measured> = (0..400)
                .map(|_| Measured {
                    value: 7.0 + between * random.normal() + error * random.normal(),
                    error,
                })
                .collect();
            all[..40].iter_mut().for_each(|of| of.value += 50.0);
            let fleet = Fleet::of(&all, 5).unwrap();
            assert!((fleet.centre - 7.0).abs() < 0.3, "{fleet:?}");
            let apart = fleet.variance - between * between;
            assert!(
                apart.abs() < 0.2 * (between * between + error * error),
                "{fleet:?}"
            );
            assert!(fleet.score(all[0]) > 15.0);
        }
        let same = [Measured {
            value: 2.5,
            error: 0.0,
        }; 9];
        assert_eq!(Fleet::of(&same, 5), None);
        assert_eq!(Fleet::of(&same[..4], 5), None);
    }
}
