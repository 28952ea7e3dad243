//! The arithmetic of the die tester's graph as one would write it for this machine alone: fixed arrays, no absence but
//! that of positions, no graph. It gives the same bits, and the ratio to it is what the engine costs.

mod learner;

use std::collections::VecDeque;

use athermal::Model;
use athermal::core::channel::{ABSENT, COLD};
use athermal_features::slope::kernel::{Coverage, NoValue, RollingSlope};
use serde_json::Value;

use self::learner::Learner;
use super::{AXES, Tick};

const NAMES: [&str; AXES] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
const NODES: [&str; 3] = ["thermal", "motion", "both"];
const MINUTE: i64 = 60_000_000_000;
/// The lags of the drift, the horizon, the span of the drift and the memory of the vote.
const LAGS: [i64; 3] = [0, 5 * MINUTE, 10 * MINUTE];
const AHEAD: i64 = 5 * MINUTE;
const SPAN: i64 = 5 * MINUTE;
const MEMORY: i64 = 15 * MINUTE;

/// A sum of weighted regressors: slopes first, then the lags of the drift.
struct Linear {
    intercept: f64,
    terms: Vec<(f64, usize)>,
}

impl Linear {
    fn read(fit: &Value, slopes: &[&str]) -> Self {
        let list = |key: &str| {
            // One that can go on learning keeps the names with their scales.
            let found = fit[key].as_array().or(fit["frame"][key].as_array());
            found.expect("a linear fit lists its terms")
        };
        let place = |name: &Value| {
            let name = name.as_str().expect("regressors have names");
            match slopes.iter().position(|slope| *slope == name) {
                Some(place) => place,
                None if name.ends_with("lag 0s") => slopes.len(),
                None if name.ends_with("lag 5min") => slopes.len() + 1,
                None if name.ends_with("lag 10min") => slopes.len() + 2,
                None => panic!("`{name}` is no regressor of the die tester"),
            }
        };
        let number = |value: &Value| value.as_f64().expect("coefficients are finite");
        let coefficients = list("coefficients").iter().map(number);
        Self {
            intercept: number(&fit["intercept"]),
            terms: coefficients
                .zip(list("regressors").iter().map(place))
                .collect(),
        }
    }

    /// NaN where a regressor is absent, since NaN travels through sums. In strands, as the engine's models sum.
    fn predict(&self, regressors: &[f64]) -> f64 {
        let of = |&(b, place): &(f64, usize)| b * regressors[place];
        let (fours, rest) = self.terms.as_chunks::<4>();
        let mut sums = [0.0; 4];
        for four in fours {
            for (sum, term) in sums.iter_mut().zip(four) {
                *sum += of(term);
            }
        }
        let rest: f64 = rest.iter().map(of).sum();
        self.intercept + ((sums[0] + sums[2]) + (sums[1] + sums[3]) + rest)
    }
}

type Votes = [[f64; 3]; AXES];

/// The shipped graph.
pub type Shipped = ByHand<6, 42, 45, false>;

/// The one in which nothing is selected.
pub type Dense = ByHand<8, 64, 67, false>;

/// The same that goes on learning.
pub type Learning = ByHand<8, 64, 67, true>;

pub struct ByHand<
    const SENSORS: usize,
    const SLOPES: usize,
    const REGRESSORS: usize,
    const LEARNS: bool,
> {
    gradients: RollingSlope,
    drift: RollingSlope,
    models: [[Linear; 3]; AXES],
    /// How they go on learning, in the same order; none where they do not.
    learners: Vec<Learner>,
    slopes: [f64; SLOPES],
    drifts: [f64; AXES],
    /// Drifts as they were measured, newest last, and for each lag the first that is too new for it.
    past: VecDeque<(i64, [f64; AXES])>,
    next: [usize; 3],
    /// Votes by tick, newest last.
    runs: VecDeque<(i64, Votes)>,
    /// What they were made of, where models learn: slopes, then the drifts of each lag.
    rows: VecDeque<([f64; SLOPES], [[f64; AXES]; 3])>,
    /// Truths to learn from at the next tick, with the oldest run.
    truths: Option<[f64; AXES]>,
    /// Squared errors by the arrival of their truth, newest last, and those that count from the next tick on.
    errors: VecDeque<(i64, Votes)>,
    arrived: bool,
    mean_squares: Votes,
}

impl<const SENSORS: usize, const SLOPES: usize, const REGRESSORS: usize, const LEARNS: bool>
    ByHand<SENSORS, SLOPES, REGRESSORS, LEARNS>
{
    pub fn new(model: &Model) -> Self {
        let text = model.to_text().expect("a model can be written");
        let json: Value = serde_json::from_str(&text).expect("a model is JSON");
        let channels = model.plan.channels.iter();
        let gradients: Vec<_> = channels
            .filter(|channel| channel.name.starts_with("gradients."))
            .collect();
        let names: Vec<_> = gradients.iter().map(|channel| &*channel.name).collect();
        let windows: Vec<_> = gradients[..SLOPES / SENSORS]
            .iter()
            .map(|channel| channel.channel.span.as_ns())
            .collect();
        let coverage = Coverage {
            min_samples: 3,
            min_coverage: 0.5,
            cold_partial: false,
        };
        let no_value = NoValue {
            absent: ABSENT,
            cold: COLD,
        };
        let fit = |name: &String| &json["fitted"][name];
        let read = |name: String| Linear::read(fit(&name), &names[..SLOPES]);
        let learner = |name: String| {
            let node = model.plan.nodes.iter().find(|node| node.instance() == name);
            let Some(planned) = node.and_then(|node| node.role.fit()) else {
                panic!("`{name}` is an estimator");
            };
            Learner::read(fit(&name), planned.training.below)
        };
        let of_axis = |axis: &str| NODES.map(|node| format!("{node}.{axis}"));
        let all = NAMES.iter().flat_map(|axis| of_axis(axis));
        Self {
            gradients: RollingSlope::new(&windows, SENSORS, coverage, no_value, false),
            drift: RollingSlope::new(&[SPAN], AXES, coverage, no_value, false),
            models: NAMES.map(|axis| of_axis(axis).map(read)),
            learners: all.filter(|_| LEARNS).map(learner).collect(),
            slopes: [f64::NAN; SLOPES],
            drifts: [f64::NAN; AXES],
            past: VecDeque::with_capacity(128),
            next: [0; 3],
            runs: VecDeque::with_capacity(128),
            rows: VecDeque::with_capacity(128),
            truths: None,
            errors: VecDeque::with_capacity(128),
            arrived: false,
            mean_squares: [[f64::NAN; 3]; AXES],
        }
    }

    /// The predictions of the six axes.
    pub fn step(&mut self, (time, samples): &Tick) -> [f64; AXES] {
        let now = time.as_ns();
        let (temperatures, positions) = samples.split_at(SENSORS);
        let mut admitted = [f64::NAN; SENSORS];
        for (admitted, &temperature) in admitted.iter_mut().zip(temperatures) {
            if (-20.0..=200.0).contains(&temperature) {
                *admitted = temperature;
            }
        }
        self.gradients.push(now, &admitted);
        self.gradients.slopes(&mut self.slopes);
        let has_truth = !positions[0].is_nan();
        if has_truth {
            self.drift.push(now, positions);
            self.drift.slopes(&mut self.drifts);
            self.drifts.iter_mut().for_each(|drift| *drift *= 60.0);
            self.past.push_back((now, self.drifts));
        }

        if LEARNS && let Some(truths) = self.truths.take() {
            self.learn(&truths);
        }
        let mut regressors = [f64::NAN; REGRESSORS];
        for (to, slope) in regressors.iter_mut().zip(&self.slopes) {
            *to = slope * 60_000.0;
        }
        let lagged = [0, 1, 2].map(|lag| self.lagged(now, lag));
        let mut votes = [[f64::NAN; 3]; AXES];
        for axis in 0..AXES {
            for lag in 0..3 {
                regressors[SLOPES + lag] = lagged[lag].map_or(f64::NAN, |drifts| drifts[axis]);
            }
            votes[axis] = [0, 1, 2].map(|node| self.models[axis][node].predict(&regressors));
        }
        self.forget(now);
        let predicted = [0, 1, 2, 3, 4, 5].map(|axis| self.vote(&votes, axis));
        self.runs.push_back((now, votes));
        if LEARNS {
            let slopes = std::array::from_fn(|slope| regressors[slope]);
            let lagged = lagged.map(|drifts| drifts.unwrap_or([f64::NAN; AXES]));
            self.rows.push_back((slopes, lagged));
        }
        if has_truth {
            self.observe(now);
        }
        predicted
    }

    /// The drifts that were held a lag ago, if they were not too old then.
    fn lagged(&mut self, now: i64, lag: usize) -> Option<[f64; AXES]> {
        let at = now - LAGS[lag];
        while self
            .past
            .get(self.next[lag])
            .is_some_and(|past| past.0 <= at)
        {
            self.next[lag] += 1;
        }
        let &(measured, drifts) = self.past.get(self.next[lag].checked_sub(1)?)?;
        if lag == 2 && self.next[2] > 1 {
            // Nothing asks for anything older than the longest lag.
            self.past.pop_front();
            self.next.iter_mut().for_each(|next| *next -= 1);
        }
        (at - measured <= SPAN).then_some(drifts)
    }

    fn observe(&mut self, now: i64) {
        let due = now - AHEAD;
        while self.runs.get(1).is_some_and(|run| run.0 <= due) {
            self.runs.pop_front();
            if LEARNS {
                self.rows.pop_front();
            }
        }
        if let Some(&(at, mut errors)) = self.runs.front()
            && at <= due
            && due - at <= SPAN
        {
            for (errors, truth) in errors.iter_mut().zip(&self.drifts) {
                for error in errors {
                    *error = (*error - truth) * (*error - truth);
                }
            }
            self.errors.push_back((now, errors));
            self.arrived = true;
            self.truths = LEARNS.then_some(self.drifts);
        }
    }

    fn learn(&mut self, truths: &[f64; AXES]) {
        let Some((slopes, lagged)) = self.rows.front() else {
            return;
        };
        let mut regressors = [f64::NAN; REGRESSORS];
        regressors[..SLOPES].copy_from_slice(slopes);
        let learners = self.learners.as_chunks_mut::<3>().0;
        for (axis, (models, learners)) in self.models.iter_mut().zip(learners).enumerate() {
            for lag in 0..3 {
                regressors[SLOPES + lag] = lagged[lag][axis];
            }
            for (model, learner) in models.iter_mut().zip(learners) {
                learner.learn(model, &regressors, truths[axis]);
            }
        }
    }

    /// Forgets what is too old, and takes the means of what is left.
    fn forget(&mut self, now: i64) {
        let mut changed = std::mem::take(&mut self.arrived);
        while self
            .errors
            .front()
            .is_some_and(|error| error.0 <= now - MEMORY)
        {
            self.errors.pop_front();
            changed = true;
        }
        if !changed {
            return;
        }
        for axis in 0..AXES {
            for voter in 0..3 {
                let known = self.errors.iter().map(|(_, errors)| errors[axis][voter]);
                let known = known.filter(|error| !error.is_nan());
                let (sum, count) = known.fold((0.0, 0.0), |(sum, n), error| (sum + error, n + 1.0));
                self.mean_squares[axis][voter] = sum / count;
            }
        }
    }

    fn vote(&self, votes: &Votes, axis: usize) -> f64 {
        let (votes, squares) = (&votes[axis], &self.mean_squares[axis]);
        let there = votes.iter().zip(squares).filter(|(vote, _)| !vote.is_nan());
        let best = there
            .clone()
            .filter(|(_, square)| !square.is_nan())
            .fold(f64::INFINITY, |best, (_, square)| best.min(*square))
            .max(f64::MIN_POSITIVE);
        let weight = |square: f64| best / square.max(f64::MIN_POSITIVE);
        let known = there.clone().filter(|(_, square)| !square.is_nan());
        let (sum, count) = known.fold((0.0, 0.0), |(sum, count), (_, square)| {
            (sum + weight(*square), count + 1.0)
        });
        let of_new = if count > 0.0 { sum / count } else { 1.0 };
        let (mut weights, mut weighted) = (0.0, 0.0);
        for (vote, square) in there {
            let weight = if square.is_nan() {
                of_new
            } else {
                weight(*square)
            };
            weights += weight;
            weighted += weight * vote;
        }
        weighted / weights
    }
}
