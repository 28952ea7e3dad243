//! Decides which variances make a series of observations most likely.

use super::matrix::diagonal;
use super::simplex::minimum;
use super::{Kalman, Movement, Passage, Structural};
use crate::NumericsError;
use crate::checks::check_parameter;

/// The logarithms of variances, relative to that of an observation and per typical step, that are tried before the search.
const TRIED: [f64; 7] = [-14.0, -9.0, -6.0, -3.5, -1.5, 1.0, 5.0];
const BOUNDS: (f64, f64) = (-25.0, 25.0);
/// A variance that adds less than this to the logarithm of the likelihood is none.
const WORTH: f64 = 1e-6;
/// So much must a rate of return add to the logarithm of the likelihood, for the rate that is found is above 0 for nearly every
/// random walk. Half the square of −2.86, below which the statistic `τ_μ` of one falls in a twentieth of all series (Dickey
/// and Fuller 1979; Fuller 1976, table 8.5.2). Among 400 simulated walks with noise of 200 to 800 rows each, the
/// twentieth that gained most did so by 4.1 to 4.7.
const WORTH_OF_RETURN: f64 = 4.1;

/// After so many rounds variances and coefficients agree well enough.
const MOST_ROUNDS: usize = 5;

/// Observations in order.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// The time since the observation before. NaN where the level starts afresh: at the first one, and after a break.
    pub times: &'a [f64],
    /// The observations; NaN where one is missing.
    pub observations: &'a [f64],
    /// The regressors of each observation, row by row.
    pub regressors: &'a [f64],
    /// What is known of each coefficient beforehand: that it is around 0 with this variance, in multiples of the sum of
    /// the model's variances over a typical step. Infinite where nothing is. For a level that stays, `1 / α` is what ridge
    /// with a penalty of `α` says.
    pub prior: f64,
    /// The time within which observations share their noise, 0 where none do: one that comes sooner after the one before
    /// counts for its share of that time.
    pub shared: f64,
}

/// A series as a model follows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// The model.
    pub model: Structural,
    /// The logarithm of the likelihood; where the level was diffuse, the diffuse one.
    pub log_likelihood: f64,
    /// The filter after the last observation.
    pub filter: Kalman,
    /// The root mean square of the errors of predictions from one observation to the next.
    pub innovation_rms: f64,
    /// What is known of the level and, where there is one, the trend at any time: mean and variance of each over the
    /// series, the filter's own uncertainty included.
    pub at_large: Vec<(f64, f64)>,
}

impl Series<'_> {
    fn width(&self) -> usize {
        self.regressors
            .len()
            .checked_div(self.observations.len())
            .unwrap_or(0)
    }

    fn check(&self) -> Result<(), NumericsError> {
        let rows = self.observations.len();
        for (expected, found) in [
            (rows, self.times.len()),
            (rows * self.width(), self.regressors.len()),
        ] {
            if expected != found {
                return Err(NumericsError::Width { expected, found });
            }
        }
        check_parameter("prior", self.prior, self.prior > 0.0, "positive")?;
        let fine = self.shared >= 0.0 && self.shared.is_finite();
        check_parameter("shared", self.shared, fine, "finite and not negative")?;
        let infinite = |values: &[f64]| values.iter().any(|value| value.is_infinite());
        let negative = self.times.iter().any(|time| *time < 0.0);
        let unknown = self.regressors.iter().any(|x| x.is_nan());
        if negative || unknown || infinite(self.times) || infinite(self.regressors) {
            return Err(NumericsError::NotFinite);
        }
        Ok(())
    }

    /// The mean time between observations.
    fn typical(&self) -> f64 {
        let (sum, count) = self
            .times
            .iter()
            .filter(|time| !time.is_nan())
            .fold((0.0, 0.0), |(sum, count), time| (sum + time, count + 1.0));
        if sum > 0.0 { sum / count } else { 1.0 }
    }

    /// For how much of one an observation counts, this time after the one before.
    fn share(&self, since: f64) -> f64 {
        if since > 0.0 && since < self.shared {
            since / self.shared
        } else {
            1.0
        }
    }

    /// The times and observations, less what these coefficients explain of them, that share no noise.
    fn apart(&self, coefficients: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let width = self.width();
        let (mut times, mut left) = (Vec::new(), Vec::new());
        let mut since = f64::NAN;
        for (nth, (&time, &y)) in self.times.iter().zip(self.observations).enumerate() {
            since = if time.is_nan() { time } else { since + time };
            if y.is_nan() || since < self.shared {
                continue;
            }
            let x = &self.regressors[nth * width..(nth + 1) * width];
            let explained = x.iter().zip(coefficients).map(|(x, b)| x * b);
            times.push(since);
            left.push(y - explained.sum::<f64>());
            since = 0.0;
        }
        (times, left)
    }
}

/// What a run of the filter over a series adds up to.
struct Passed {
    filter: Kalman,
    /// Observations that were predicted, and those of which nothing was known.
    predicted: f64,
    unknown: f64,
    /// The sums of `v²/F`, `ln F` and `v²` over the predicted ones, and of `ln F` over the others.
    squares: f64,
    logarithms: f64,
    errors: f64,
    diffuse: f64,
    /// Sums over the predicted ones of level and trend, their squares and their variances.
    moving: [(f64, f64, f64); 2],
}

impl Passed {
    fn over(model: Structural, series: &Series<'_>) -> Result<Self, NumericsError> {
        let moving = model.moving();
        let typical = series.typical();
        let of_trend = model.trend.unwrap_or(0.0) * typical.powi(3);
        let of_one = model.observation / series.share(typical);
        let total = of_one + model.level * typical + of_trend;
        let mut variances = vec![f64::INFINITY; moving];
        variances.resize(moving + series.width(), series.prior * total);
        let start = vec![0.0; variances.len()];
        let mut passed = Self {
            filter: Kalman::starting_at(model, start, &diagonal(&variances))?,
            predicted: 0.0,
            unknown: 0.0,
            squares: 0.0,
            logarithms: 0.0,
            errors: 0.0,
            diffuse: 0.0,
            moving: [(0.0, 0.0, 0.0); 2],
        };
        let width = series.width();
        let rows = series.times.iter().zip(series.observations).enumerate();
        let mut since = 0.0;
        for (nth, (&time, &y)) in rows {
            if !time.is_nan() {
                passed.filter.advance(time);
                since += time;
            } else {
                since = 0.0;
                if nth > 0 {
                    passed.filter.forget_level();
                }
            }
            let x = &series.regressors[nth * width..(nth + 1) * width];
            let brought = passed.filter.observe_share(x, y, series.share(since));
            if brought.is_some() {
                since = 0.0;
            }
            match brought {
                None => {}
                Some(known) if known.diffuse => {
                    passed.unknown += 1.0;
                    passed.diffuse += known.variance.ln();
                }
                Some(known) => {
                    passed.predicted += 1.0;
                    passed.squares += known.error * known.error / known.variance;
                    passed.logarithms += known.variance.ln();
                    passed.errors += known.error * known.error;
                    passed.note_level();
                }
            }
        }
        Ok(passed)
    }

    fn note_level(&mut self) {
        let order = self.filter.state().len();
        let moving = self.filter.model().moving();
        for (nth, (sum, squares, variances)) in self.moving[..moving].iter_mut().enumerate() {
            let state = self.filter.state()[nth];
            *sum += state;
            *squares += state * state;
            *variances += self.filter.covariance()[nth * order + nth];
        }
    }

    fn followed(self, scale: f64) -> Followed {
        let count = self.predicted;
        let moving = &self.moving[..self.filter.model().moving()];
        let at_large = moving.iter().map(|(sum, squares, variances)| {
            let mean = sum / count;
            let spread = (squares / count - mean * mean).max(0.0);
            (mean, spread + variances / count)
        });
        Followed {
            model: self.filter.model(),
            log_likelihood: self.log_likelihood(scale),
            innovation_rms: (self.errors / count).sqrt(),
            at_large: at_large.collect(),
            filter: self.filter,
        }
    }

    /// The scale of all variances that makes the series most likely, and the logarithm of the likelihood with it.
    fn concentrated(&self) -> (f64, f64) {
        let scale = self.squares / self.predicted;
        (scale, self.log_likelihood(scale))
    }

    fn log_likelihood(&self, scale: f64) -> f64 {
        let two_pi = (2.0 * std::f64::consts::PI).ln();
        let predicted = self.predicted * (two_pi + scale.ln()) + self.logarithms;
        -0.5 * (predicted + self.squares / scale + self.unknown * two_pi + self.diffuse)
    }
}

/// Follows a series with a model whose variances are given.
///
/// # Errors
/// [`NumericsError::TooFewRows`] when no observation can be predicted, [`NumericsError::Parameter`],
/// [`NumericsError::Width`] and [`NumericsError::NotFinite`] for what does not fit.
pub fn follow(model: Structural, series: &Series<'_>) -> Result<Followed, NumericsError> {
    series.check()?;
    let passed = Passed::over(model, series)?;
    if passed.predicted == 0.0 {
        return Err(NumericsError::TooFewRows {
            needed: passed.unknown as u64 + 1,
            found: passed.unknown as u64,
        });
    }
    Ok(passed.followed(1.0))
}

/// Finds the variances that make a series most likely, and the rate at which a level that returns does.
///
/// The scale of all variances is found in closed form; their ratios are looked for on a coarse grid of logarithms, and
/// from the best place there by a simplex. A variance that adds nothing is exactly 0, and so is a rate that adds no more than
/// it does for most levels that do not return.
///
/// Where observations share noise, the coefficients are those of all, each counted for its share, and the variances those of
/// observations so far apart that they share none, less what the coefficients explain of them; each goes by the other until
/// they agree. The likelihood and the errors are of those far apart.
///
/// # Errors
/// [`NumericsError::TooFewRows`] when fewer observations can be predicted than there are variances;
/// [`NumericsError::NoConvergence`] where all observations are predicted exactly; and as [`follow`].
pub fn most_likely(
    movement: Movement,
    passage: Passage,
    series: &Series<'_>,
) -> Result<Followed, NumericsError> {
    series.check()?;
    if series.shared > 0.0 {
        return most_likely_apart(movement, passage, series);
    }
    let found = searched(movement, passage, series)?;
    if found.model.returning > 0.0 {
        let stays = searched(Movement::Wanders, passage, series)?;
        if found.log_likelihood < stays.log_likelihood + WORTH_OF_RETURN {
            return Ok(stays);
        }
    }
    Ok(found)
}

/// The same where none share noise, and whatever a rate of return is worth.
fn searched(
    movement: Movement,
    passage: Passage,
    series: &Series<'_>,
) -> Result<Followed, NumericsError> {
    let typical = series.typical();
    let trend = movement == Movement::Trend;
    // The second is the trend's, or the rate.
    let model = |level: f64, second: f64| {
        let slope = if trend { second } else { 0.0 };
        // The trend's variance is per step of its own effect on the level, so that both logarithms have one meaning.
        let total = 1.0 + level + slope;
        Structural {
            observation: 1.0 / total,
            level: level / total / typical,
            trend: trend.then(|| slope / total / typical.powi(3)),
            returning: if movement == Movement::Returns {
                second / typical
            } else {
                0.0
            },
            passage,
        }
    };
    let pass = |level: f64, second: f64| Passed::over(model(level, second), series);
    let both = movement != Movement::Wanders;
    let needed = 3 + u64::from(both);
    let first = pass(1.0, if both { 1.0 } else { 0.0 })?;
    if first.predicted < needed as f64 {
        return Err(NumericsError::TooFewRows {
            needed: needed + first.unknown as u64,
            found: (first.predicted + first.unknown) as u64,
        });
    }
    let loss = |at: &[f64]| {
        let second = at.get(1).map_or(0.0, |second| second.exp());
        pass(at[0].exp(), second).map_or(f64::INFINITY, |passed| -passed.concentrated().1)
    };
    let mut best = (Vec::new(), f64::INFINITY);
    for level in TRIED {
        let places: Vec<Vec<f64>> = if both {
            TRIED.iter().map(|&second| vec![level, second]).collect()
        } else {
            vec![vec![level]]
        };
        for place in places {
            let found = loss(&place);
            if found < best.1 {
                best = (place, found);
            }
        }
    }
    if best.0.is_empty() {
        return Err(NumericsError::NoConvergence);
    }
    let (at, _) = minimum(loss, &best.0, 1.0, BOUNDS);
    let mut ratios = [at[0].exp(), at.get(1).map_or(0.0, |second| second.exp())];
    let mut passed = pass(ratios[0], ratios[1])?;
    for which in 0..at.len() {
        let mut without = ratios;
        without[which] = 0.0;
        let other = pass(without[0], without[1])?;
        if other.concentrated().1 >= passed.concentrated().1 - WORTH {
            (ratios, passed) = (without, other);
        }
    }
    let (scale, log_likelihood) = passed.concentrated();
    if !(scale > 0.0 && log_likelihood.is_finite()) {
        return Err(NumericsError::NoConvergence);
    }
    let relative = model(ratios[0], ratios[1]);
    let model = Structural {
        observation: scale * relative.observation,
        level: scale * relative.level,
        trend: relative.trend.map(|trend| scale * trend),
        ..relative
    };
    follow(model, series)
}

/// The same where observations share noise.
fn most_likely_apart(
    movement: Movement,
    passage: Passage,
    series: &Series<'_>,
) -> Result<Followed, NumericsError> {
    let mut model = Structural {
        observation: 1.0,
        level: 0.0,
        trend: (movement == Movement::Trend).then_some(0.0),
        returning: 0.0,
        passage,
    };
    let mut rounds = 0;
    loop {
        let passed = Passed::over(model, series)?;
        let coefficients = &passed.filter.state()[model.moving()..];
        let (times, left) = series.apart(coefficients);
        let apart = Series {
            times: &times,
            observations: &left,
            regressors: &[],
            prior: f64::INFINITY,
            shared: 0.0,
        };
        let found = most_likely(movement, passage, &apart)?;
        rounds += 1;
        if rounds == MOST_ROUNDS || series.width() == 0 || found.model.is_near(&model) {
            let passed = Passed::over(found.model, series)?;
            return Ok(Followed {
                filter: passed.filter,
                ..found
            });
        }
        model = found.model;
    }
}
