//! Decides how an identified model is followed while it runs: when it goes on by a step, from which inputs, and what it makes of
//! truths.

use std::cell::RefCell;
use std::collections::VecDeque;

use athermal_core::node::{Learner, Restored, State};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Beginning, Novelty, Stepper};
use serde::{Deserialize, Serialize};

use super::model::Identified;
use crate::novelty::novelty_at;
use crate::scaling::Scaling;

/// After more steps than that without inputs a model begins anew, unless it reaches further back itself. A mode that hardly
/// decays would go anywhere with inputs that stay as they last were.
pub(super) const UNSEEN: usize = 10;
/// Of what lies more steps back nothing is left.
pub(super) const MOST_STEPS: i64 = 10_000;
/// How many runs within a step are kept.
const RUNS_PER_STEP: i64 = 16;
/// For how many runs room is made at most, however far ahead is predicted.
const MOST_RUNS: f64 = 4_096.0;
/// How unsure filters are at most where they begin, as a variance in that of an innovation: beyond, rounding would count more than
/// innovations, and the first truths tell all in any case.
const MOST_UNSURE: f64 = 1e8;

/// One of the interleaved series that a model is followed in.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Followed {
    stepper: Stepper,
    /// The instant of its last sample.
    at: Instant,
    /// How many truths have come since the segment began, as far as that counts.
    truths: u32,
}

/// What is known since the segment began.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Known {
    regressors: Vec<String>,
    scaling: Scaling,
    step: Duration,
    series: Vec<Followed>,
    /// Whether there has been a run.
    begun: bool,
    /// What each run predicts, and its inputs, since the oldest sample of the series.
    runs: VecDeque<Instant>,
    inputs: VecDeque<f64>,
}

athermal_core::state!(Known, "identified/4");

/// Follows a model.
#[derive(Debug)]
pub(super) struct Following {
    known: Known,
    deviations: Vec<f64>,
    novelty: Option<Novelty>,
    begins: Begins,
    /// For predictions, which leave no trace.
    scratch: RefCell<Stepper>,
    /// To work out in how unsure they are.
    room: RefCell<Vec<f64>>,
}

/// What is taken for the past of a segment.
#[derive(Debug)]
struct Begins {
    /// What the filter of each input gave, in times of the input.
    times: Vec<f64>,
    /// The variance of that, in that of an innovation.
    squares: Vec<f64>,
    /// The same of noise that is followed; infinite where it may be anywhere.
    noise: f64,
}

impl Following {
    pub(super) fn new(of: &Identified) -> Self {
        let stepper = Stepper::new(of.model.clone());
        let followed = Followed {
            stepper: stepper.clone(),
            at: Instant::MIN,
            truths: 0,
        };
        Self {
            known: Known {
                regressors: of.regressors.clone(),
                scaling: of.scaling.clone(),
                step: of.step,
                series: vec![followed; of.series],
                begun: false,
                runs: VecDeque::new(),
                inputs: VecDeque::new(),
            },
            deviations: of.deviations.clone(),
            novelty: of.novelty.clone(),
            begins: Begins::of(of),
            room: RefCell::new(vec![0.0; stepper.remembers()]),
            scratch: RefCell::new(stepper),
        }
    }
}

/// Where the filters of the inputs begin; at rest, each is taken to be as far off as all inputs as in the fit, staying as they are
/// for long, bring them on average.
fn beginnings(of: &Identified) -> Vec<Beginning> {
    if !of.beginnings.is_empty() {
        return of.beginnings.clone();
    }
    let inputs = &of.model.inputs;
    let filters = || inputs.iter().filter(|input| !input.f.is_empty());
    let squares: f64 = filters().map(|input| input.gain().powi(2)).sum();
    let each = squares / filters().count().max(1) as f64;
    let at_rest = inputs.iter().map(|input| Beginning {
        times: input.gain(),
        square: if input.f.is_empty() { 0.0 } else { each },
    });
    at_rest.collect()
}

impl Begins {
    fn of(of: &Identified) -> Self {
        let beginnings = beginnings(of);
        let innovation = of.deviations.first().map_or(0.0, |first| first.powi(2));
        // Nothing of nothing is nothing.
        let unsure = |square: f64| {
            if square > 0.0 {
                square / innovation
            } else {
                0.0
            }
        };
        let squares = beginnings.iter().map(|of| unsure(of.square));
        let all: f64 = squares.clone().sum();
        let scale = if all > MOST_UNSURE {
            MOST_UNSURE / all
        } else {
            1.0
        };
        let noise = of
            .deviations
            .last()
            .map_or(0.0, |last| unsure(last.powi(2)));
        Self {
            times: beginnings.iter().map(|of| of.times).collect(),
            squares: squares
                .map(|square| (scale * square).min(MOST_UNSURE))
                .collect(),
            noise: if of.model.differences > 0 {
                f64::INFINITY
            } else {
                scale * noise
            },
        }
    }
}

impl Known {
    /// Begins a step before what the first run predicts, with filters as far as its inputs tell of them.
    fn begin(&mut self, row: &[f64], of: Instant, begins: &Begins) {
        let Self {
            scaling,
            series,
            step,
            ..
        } = self;
        let count = series.len() as i64;
        for (nth, followed) in series.iter_mut().enumerate() {
            let input = scaling.of(row);
            let before = |nth: usize| begins.times[nth] * input(nth);
            followed
                .stepper
                .begin(&input, before, |nth| begins.squares[nth]);
            followed.at = of - *step + part(*step, nth as i64, count);
            followed.truths = 0;
        }
        self.begun = true;
    }

    /// Makes room for the runs that are kept where truths are missing, of which the next may come so long after its run.
    fn make_room(&mut self, after: Duration) {
        let steps = after.secs() / self.step.secs() + 2.0;
        let runs = (RUNS_PER_STEP as f64 * steps).min(MOST_RUNS) as usize;
        self.runs.reserve(runs.saturating_sub(self.runs.len()));
        let inputs = runs * self.regressors.len();
        self.inputs
            .reserve(inputs.saturating_sub(self.inputs.len()));
    }

    /// The inputs of the last run that predicted this instant or one before; those of `row` where there was none.
    fn inputs_at<'a>(&'a self, at: Instant, row: &'a [f64]) -> impl Fn(usize) -> f64 + 'a {
        let count = self.runs.partition_point(|&of| of <= at);
        let run = count.checked_sub(1);
        let Scaling { means, scales, .. } = &self.scaling;
        move |nth| {
            let input = match run {
                Some(run) => self.inputs[run * means.len() + nth],
                None => row[nth],
            };
            (input - means[nth]) / scales[nth]
        }
    }

    /// The instants between two that are so many steps apart.
    fn between(&self, from: Instant, to: Instant) -> impl Iterator<Item = Instant> + use<> {
        let steps = self.steps(from, to);
        (1..steps).map(move |nth| from + part(to - from, nth, steps))
    }

    /// Whether too long ago there was a run, of a model that has inputs.
    fn lost(&self, of: Instant) -> bool {
        let inputs = self
            .series
            .first()
            .map(|followed| &followed.stepper.model().inputs);
        let reaches = inputs
            .into_iter()
            .flatten()
            .map(|input| input.delay + input.b.len());
        let longest = reaches.max().map(|reach| reach.max(UNSEEN) as i64);
        let last = self.runs.back();
        last.zip(longest)
            .is_some_and(|(&last, longest)| self.steps(last, of) > longest)
    }

    /// Forgets where it was.
    fn end(&mut self) {
        self.begun = false;
        self.runs.clear();
        self.inputs.clear();
    }

    /// How many steps lie between two instants.
    fn steps(&self, from: Instant, to: Instant) -> i64 {
        steps(to - from, self.step)
    }

    /// The series whose newest sample is the newest that lies a step before an instant.
    fn nearest(&self, of: Instant) -> &Followed {
        let before = of - part(self.step, 1, 2);
        let key = |followed: &&Followed| (followed.at <= before, followed.truths > 0, followed.at);
        self.series
            .iter()
            .max_by_key(key)
            .expect("there is a series at least")
    }
}

/// How many steps a duration takes.
pub(super) fn steps(of: Duration, step: Duration) -> i64 {
    let steps = (of.secs() / step.secs()).round();
    (steps as i64).clamp(1, MOST_STEPS)
}

/// So many parts of a duration.
pub(super) fn part(of: Duration, count: i64, parts: i64) -> Duration {
    let ns = i128::from(of.as_ns()) * i128::from(count) / i128::from(parts.max(1));
    Duration::from_ns(i64::try_from(ns).unwrap_or(i64::MAX))
}

impl Learner for Following {
    fn tracks_state(&self) -> bool {
        true
    }

    fn is_settled(&self) -> bool {
        let mut series = self.known.series.iter();
        // As many truths as tell what filters gave, or how far the model looks back.
        let needed = |of: &Stepper| of.model().a.len().max(of.model().starts()).max(1);
        series.all(|followed| followed.truths as usize >= needed(&followed.stepper))
    }

    fn run(&mut self, regressors: &[f64], of: Instant, arrived: Instant) {
        let known = &mut self.known;
        if regressors.iter().any(|value| value.is_nan()) {
            return;
        }
        if known.lost(of) {
            known.end();
        }
        if !known.begun {
            known.begin(regressors, of, &self.begins);
            known.make_room(of - arrived);
        }
        // A truth that has not come by now never will.
        for nth in 0..known.series.len() {
            let Followed { at, .. } = known.series[nth];
            let mut next = at + known.step;
            let overdue = arrived - part(known.step, 1, 2);
            if next > overdue {
                continue;
            }
            let steps = ((overdue - at).secs() / known.step.secs()) as i64;
            if steps > MOST_STEPS {
                next = next + part(known.step, steps - MOST_STEPS, 1);
            }
            let stepper = self.scratch.get_mut();
            std::mem::swap(stepper, &mut known.series[nth].stepper);
            let mut last = at;
            while next <= overdue {
                stepper.step(known.inputs_at(next, regressors), None);
                last = next;
                next = next + known.step;
            }
            std::mem::swap(stepper, &mut known.series[nth].stepper);
            known.series[nth].at = last;
        }
        let width = known.scaling.means.len();
        let oldest = known.series.iter().map(|followed| followed.at).min();
        while known.runs.get(1).is_some_and(|&next| Some(next) <= oldest) {
            known.runs.pop_front();
            known.inputs.drain(..width);
        }
        let apart = part(known.step, 1, RUNS_PER_STEP);
        if known.runs.back().is_none_or(|&last| of - last >= apart) {
            known.runs.push_back(of);
            known.inputs.extend(regressors);
        }
    }

    fn predict(&self, regressors: &[f64], of: Instant) -> f64 {
        let followed = self.known.nearest(of);
        let blind = followed.truths == 0 && followed.stepper.model().follows();
        if !self.known.begun || blind {
            return f64::NAN;
        }
        let mut ahead = self.scratch.borrow_mut();
        ahead.take_past(&followed.stepper);
        for at in self.known.between(followed.at, of) {
            ahead.foresee(self.known.inputs_at(at, regressors));
        }
        ahead.foresee(self.known.scaling.of(regressors))
    }

    fn std_dev(&self, _regressors: &[f64], of: Instant) -> f64 {
        let followed = self.known.nearest(of);
        let known = |nth: usize| self.deviations.get(nth).copied().unwrap_or(f64::NAN);
        let last = self.deviations.len().saturating_sub(1);
        if followed.truths == 0 && followed.stepper.model().follows() {
            return known(last);
        }
        let steps = usize::try_from(self.known.steps(followed.at, of)).unwrap_or(usize::MAX);
        let doubt = followed.stepper.doubt(steps, &mut self.room.borrow_mut());
        // The first is that of an innovation.
        (known(last.min(steps - 1)).powi(2) + doubt * known(0).powi(2)).sqrt()
    }

    fn novelty(&self, regressors: &[f64]) -> f64 {
        novelty_at(self.novelty.as_ref(), regressors)
    }

    fn centre(&self, of: Instant) -> f64 {
        self.predict(&self.known.scaling.means, of)
    }

    fn learn(&mut self, regressors: &[f64], truth: f64, at: Instant) {
        if !self.known.begun {
            self.known.begin(regressors, at, &self.begins);
        }
        let oldest = self
            .known
            .series
            .iter()
            .enumerate()
            .min_by_key(|(_, of)| of.at);
        let Some((nth, followed)) = oldest else {
            return;
        };
        // Not sooner than a step after it, as far as truths that come anyhow can keep to that.
        let series = self.known.series.len() as i64;
        let soonest = followed.at + part(self.known.step, (series - 1).max(1), series.max(2));
        if at < soonest {
            return;
        }
        let (from, is_first) = (followed.at, followed.truths == 0);
        let (known, stepper) = (&mut self.known, self.scratch.get_mut());
        std::mem::swap(stepper, &mut known.series[nth].stepper);
        for between in known.between(from, at) {
            stepper.step(known.inputs_at(between, regressors), None);
        }
        let input = known.scaling.of(regressors);
        if is_first {
            stepper.first(input, truth, self.begins.noise);
        } else {
            stepper.step(input, Some(truth));
        }
        let followed = &mut known.series[nth];
        std::mem::swap(stepper, &mut followed.stepper);
        followed.at = at;
        followed.truths = followed.truths.saturating_add(1);
    }

    fn segment(&mut self, _shift: Duration) {
        self.known.end();
    }

    fn snapshot(&self) -> Box<dyn State> {
        Box::new(self.known.clone())
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let known = match state.known::<Known>() {
            Ok(known) => known,
            Err(cold) => return cold,
        };
        if known.regressors != self.known.regressors {
            return Restored::cold("it was followed with other inputs");
        }
        if known.scaling != self.known.scaling {
            return Restored::cold("its inputs were on another scale");
        }
        if known.step != self.known.step || known.series.len() != self.known.series.len() {
            return Restored::cold("it was followed in other steps");
        }
        if known.inputs.len() != known.runs.len() * known.regressors.len() {
            return Restored::cold("its runs have other inputs");
        }
        let mut series = self.known.series.clone();
        for (own, other) in series.iter_mut().zip(&known.series) {
            if !own.stepper.resume(&other.stepper) {
                return Restored::cold("it was followed with other orders");
            }
            (own.at, own.truths) = (other.at, other.truths);
        }
        self.known.series = series;
        self.known.begun = known.begun;
        self.known.runs = known.runs;
        self.known.inputs = known.inputs;
        // The engine thread must not have to make room.
        let Known { runs, inputs, .. } = &mut self.known;
        runs.reserve(runs.len().max(16));
        inputs.reserve(inputs.len().max(16));
        Restored::Accepted
    }
}

#[cfg(test)]
mod tests;
