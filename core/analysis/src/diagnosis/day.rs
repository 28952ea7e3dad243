//! How fits on some days of a recording are scored on the others: each day left out once, and how many are needed.
//!
//! Days that are left out are cut out of the recording, so that no window of a row that is fitted on reaches into them; scores
//! come from a pass over the whole of it. What a model learns at run time it learns there too.

use std::collections::BTreeSet;
use std::sync::Arc;

use athermal_core::compile::Plan;
use athermal_core::engine::Fitted;
use athermal_core::time::{Duration, Instant};
use athermal_run::fit::{FitError, FitOptions, fit};
use athermal_run::model::Model;
use athermal_run::recording::{Event, Recording, Samples, Source, SourceError};
use athermal_run::score::{PredictionTrace, Trace, TruthTrace, trace};
use serde::Serialize;

use super::observation::Observation;

/// Fits on fewer days are enough when their error is at most so many times that of fits on all others.
pub const ENOUGH: f64 = 1.05;
/// Days of which each is left out once, at most: each costs a fit.
pub const MOST_DAYS: usize = 60;
/// How many fits on as many days, from different places of the recording, make a point of the learning curve.
const PLACINGS: usize = 3;
/// Numbers of days that are tried; the last few would all show the same.
const NUMBERS: [usize; 12] = [1, 2, 3, 4, 5, 6, 8, 11, 15, 21, 30, 42];

/// What fits on some days are worth on others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Days {
    /// The length of a day in s, as stated.
    pub day_s: f64,
    /// How many have a truth.
    pub count: usize,
    /// Each day, predicted by a fit on all others.
    pub left_out: Vec<LeftOut>,
    /// For each number of days, fits on so many that follow each other, scored on all other days.
    pub curve: Vec<CurvePoint>,
}

/// A day that was left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeftOut {
    /// Its number, from 1, by the time since the first instant: days without a truth have a number too, and are left out here.
    pub day: usize,
    /// Its first instant in s.
    pub from_s: f64,
    /// How well it was predicted.
    pub scores: Vec<DayScore>,
    /// What the fit did without because it had a value in too few rows of the other days: `thermal.Z1: gradients.room@5min`.
    pub dropped: Vec<String>,
}

/// Fits on a number of days.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurvePoint {
    /// How many days each fit saw.
    pub days: usize,
    /// How many fits there were.
    pub fits: usize,
    /// How well they predicted the others, over all fits.
    pub scores: Vec<DayScore>,
    /// What some of them did without because it had a value in too few rows.
    pub dropped: Vec<String>,
}

/// How well a prediction did on days that its fit has not seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DayScore {
    /// The prediction: `vote.Z1`.
    pub prediction: String,
    /// Instants at which both this fit and that on all days but the one predicted had a prediction.
    pub n: usize,
    /// Root mean square error on these; none without an instant.
    pub rmse: Option<f64>,
    /// The same of fits on all days but the one predicted, on the same instants: what more days are worth.
    pub all_others: Option<f64>,
    /// The error of no model on the same instants.
    #[serde(rename = "baseline_zero")]
    pub zero: Option<f64>,
}

/// A recording cut into days.
struct Calendar {
    /// Segment and first instant of each day.
    begins: Vec<(u32, Instant)>,
    /// The number of each, from 1.
    numbers: Vec<usize>,
}

impl DayScore {
    /// How many times the error of fits on all other days the error is.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        Some(self.rmse? / self.all_others?).filter(|ratio| !ratio.is_nan())
    }
}

impl Calendar {
    /// Days without a truth are none: a pause has no day that could be predicted. The last day of a segment takes a rest of less
    /// than half a day.
    fn new(observation: &Observation, day: Duration) -> Self {
        let begin = |segment: u32, at: Instant| {
            let (from, to) = observation.segments.get(segment as usize).copied()??;
            let nth = (at - from).as_ns() / day.as_ns();
            let nth = nth.min(days_in(from, to, day) - 1);
            Some((segment, from + Duration::from_ns(nth * day.as_ns())))
        };
        let truths = observation.trace.truths.iter();
        let mut begins: Vec<(u32, Instant)> = Vec::new();
        for truth in truths {
            let mut of_truth: Vec<_> = truth
                .times
                .iter()
                .filter_map(|of| begin(of.0, of.1))
                .collect();
            of_truth.dedup();
            begins.extend(of_truth);
        }
        begins.sort_unstable();
        begins.dedup();
        let numbers = numbers(&begins, &observation.segments, day);
        Self { begins, numbers }
    }

    fn count(&self) -> usize {
        self.begins.len()
    }

    /// The day of each instant of a truth.
    fn days_of(&self, truth: &TruthTrace) -> Vec<usize> {
        let instants = truth.times.iter();
        instants
            .map(|&(segment, at)| self.day_of(segment, at))
            .collect()
    }

    fn day_of(&self, segment: u32, at: Instant) -> usize {
        let after = self.begins.partition_point(|begin| *begin <= (segment, at));
        after.saturating_sub(1)
    }
}

/// The numbers of days, from 1, by the time that has gone by since the first instant. A segment begins another day than the one
/// before it, and one whose clock starts again the next.
fn numbers(
    begins: &[(u32, Instant)],
    segments: &[Option<(Instant, Instant)>],
    day: Duration,
) -> Vec<usize> {
    let elapsed = |from: Instant, at: Instant| ((at - from).secs() / day.secs()).round() as usize;
    // The first instant of the clock, and how many days were before it; the end of the last segment, and its last day.
    let (mut clock, mut last) = ((Instant::from_ns(0), 0), None::<(Instant, usize)>);
    let mut before = Vec::new();
    for &segment in segments {
        let Some((from, to)) = segment else {
            before.push(0);
            continue;
        };
        let days = match last {
            Some((end, number)) if from > end => number.max(clock.1 + elapsed(clock.0, from)),
            _ => {
                clock = (from, last.map_or(0, |last| last.1));
                clock.1
            }
        };
        last = Some((to, days + days_in(from, to, day) as usize));
        before.push(days);
    }
    let number = |&(segment, at): &(u32, Instant)| {
        let nth = segment as usize;
        let from = segments.get(nth).copied().flatten().map_or(at, |of| of.0);
        before.get(nth).copied().unwrap_or(0) + elapsed(from, at) + 1
    };
    begins.iter().map(number).collect()
}

/// Into how many days a segment falls.
fn days_in(from: Instant, to: Instant, day: Duration) -> i64 {
    ((to - from).secs() / day.secs()).round().max(1.0) as i64
}

/// How many days of a recording have a truth.
#[must_use]
pub fn count(observation: &Observation, day: Duration) -> usize {
    Calendar::new(observation, day).count()
}

/// Fits a model's graph anew on some days and scores it on the others. `progress` gets the number of fits done, and of all.
/// None where there are fewer than two days, or more than [`MOST_DAYS`].
///
/// # Errors
/// When the recording cannot be read.
pub fn days(
    model: &Model,
    recording: &dyn Recording,
    observation: &Observation,
    day: Duration,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Option<Days>, FitError> {
    let calendar = Calendar::new(observation, day);
    let count = calendar.count();
    if !(2..=MOST_DAYS).contains(&count) {
        return Ok(None);
    }
    let numbers: Vec<usize> = NUMBERS.into_iter().filter(|&n| n + 1 < count).collect();
    let fits: usize = numbers.iter().map(|&n| placings(n, count).len()).sum();
    let (total, mut done) = ((fits + count) as u64, 0);
    let mut run = |kept: &dyn Fn(usize) -> bool| -> Result<Run, FitError> {
        let kept: Vec<bool> = (0..count).map(kept).collect();
        progress(done, total);
        done += 1;
        let (fitted, dropped) = fit_on(model, recording, &calendar, &kept)?;
        let trace = trace(&model.plan, &fitted, recording, &mut |_, _| {})?;
        let errors = errors(&trace);
        Ok(Run { errors, dropped })
    };
    let (plan, of) = (&*model.plan, &observation.trace);
    let truths = of.truths.iter();
    let days_of: Vec<Vec<usize>> = truths.map(|truth| calendar.days_of(truth)).collect();
    // Of each day the errors of the fit on all others.
    let mut others: Vec<Vec<f64>> = errors(of);
    others.iter_mut().for_each(|all| all.fill(f64::NAN));
    let mut dropped_of_each = Vec::new();
    for out in 0..count {
        let run = run(&|day| day != out)?;
        for ((to, from), days) in others.iter_mut().zip(&run.errors).zip(each(of, &days_of)) {
            let instants = to.iter_mut().zip(from).zip(days);
            let out = instants.filter(|(_, day)| **day == out);
            out.for_each(|((to, from), _)| *to = *from);
        }
        dropped_of_each.push(run.dropped);
    }
    let on = |sums: &mut Vec<Sums>, own: &[Vec<f64>], counts: &dyn Fn(usize) -> bool| {
        sums.resize(own.len(), Sums::default());
        let predictions = sums.iter_mut().zip(own.iter().zip(&others));
        let truths = each(of, &of.truths).zip(each(of, &days_of));
        for ((sums, (own, others)), (truth, days)) in predictions.zip(truths) {
            let no_model = truth.no_model.value(truth.values.iter().copied());
            let errors = own.iter().zip(others).zip(&truth.values).zip(days);
            for (((own, others), y), _) in errors.filter(|(_, day)| counts(**day)) {
                sums.add(*own, *others, *y - no_model);
            }
        }
    };
    let left_out = dropped_of_each.iter().enumerate().map(|(out, dropped)| {
        let mut sums = Vec::new();
        on(&mut sums, &others, &|day| day == out);
        LeftOut {
            day: calendar.numbers[out],
            from_s: (calendar.begins[out].1 - Instant::from_ns(0)).secs(),
            scores: scores(plan, of, &sums),
            dropped: dropped.clone(),
        }
    });
    let left_out = left_out.collect();
    let mut curve = Vec::new();
    for days in numbers {
        let (mut sums, mut dropped) = (Vec::new(), Vec::new());
        let placings = placings(days, count);
        for &from in &placings {
            let seen = from..from + days;
            let run = run(&|day| seen.contains(&day))?;
            on(&mut sums, &run.errors, &|day| !seen.contains(&day));
            dropped.extend(run.dropped);
        }
        curve.push(CurvePoint {
            days,
            fits: placings.len(),
            scores: scores(plan, of, &sums),
            dropped: once(dropped),
        });
    }
    let mut sums = Vec::new();
    on(&mut sums, &others, &|_| true);
    curve.push(CurvePoint {
        days: count - 1,
        fits: count,
        scores: scores(plan, of, &sums),
        dropped: once(dropped_of_each.into_iter().flatten()),
    });
    Ok(Some(Days {
        day_s: day.secs(),
        count,
        left_out,
        curve,
    }))
}

/// The first days of fits on so many of `count`, spread over the recording.
fn placings(days: usize, count: usize) -> Vec<usize> {
    let last = count - days;
    let places = PLACINGS.min(last + 1);
    let spread = |nth: usize| nth * last / (places - 1).max(1);
    (0..places).map(spread).collect()
}

/// What a fit on some days came to.
struct Run {
    /// For each prediction and instant of its truth; NaN where there was no prediction.
    errors: Vec<Vec<f64>>,
    dropped: Vec<String>,
}

/// Each name once, in order.
fn once(names: impl IntoIterator<Item = String>) -> Vec<String> {
    let names: BTreeSet<String> = names.into_iter().collect();
    names.into_iter().collect()
}

/// Squares at the instants at which a fit and those on all other days predicted, and how many these are.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    own: f64,
    others: f64,
    zero: f64,
    count: usize,
}

impl Sums {
    fn add(&mut self, own: f64, others: f64, truth: f64) {
        if !(own.is_nan() || others.is_nan()) {
            self.own += own * own;
            self.others += others * others;
            self.zero += truth * truth;
            self.count += 1;
        }
    }
}

/// For each prediction its errors, at all instants of its truth.
fn errors(trace: &Trace) -> Vec<Vec<f64>> {
    let predictions = trace.truths.iter().flat_map(|truth| {
        truth.predictions.iter().map(|prediction| {
            let pairs = prediction.values.iter().zip(&truth.values);
            pairs.map(|(p, y)| p - y).collect()
        })
    });
    predictions.collect()
}

/// For each prediction what there is for each truth.
fn each<'a, T>(trace: &'a Trace, of_truths: &'a [T]) -> impl Iterator<Item = &'a T> {
    let truths = trace.truths.iter().zip(of_truths);
    truths.flat_map(|(truth, of)| truth.predictions.iter().map(move |_| of))
}

fn scores(plan: &Plan, trace: &Trace, sums: &[Sums]) -> Vec<DayScore> {
    let predictions = trace.truths.iter().flat_map(|truth| &truth.predictions);
    let score = |(of, sums): (&PredictionTrace, &Sums)| {
        let rms = |squares: f64| (sums.count > 0).then(|| (squares / sums.count as f64).sqrt());
        DayScore {
            prediction: plan.channels[of.slot].name.clone(),
            n: sums.count,
            rmse: rms(sums.own),
            all_others: rms(sums.others),
            zero: rms(sums.zero),
        }
    };
    predictions.zip(sums).map(score).collect()
}

fn fit_on(
    model: &Model,
    recording: &dyn Recording,
    calendar: &Calendar,
    kept: &[bool],
) -> Result<(Fitted, Vec<String>), FitError> {
    let some = SomeDays {
        recording,
        calendar,
        kept,
    };
    let (fitted, report) = fit(
        &Arc::clone(&model.plan),
        &some,
        &FitOptions::default(),
        &mut |_| {},
    )?;
    let dropped = report.estimators.iter().flat_map(|of| {
        let names = of.dropped_candidates.iter();
        names.map(|(name, _)| format!("{}: {name}", of.node))
    });
    Ok((fitted, dropped.collect()))
}

/// The days of a recording that are kept; where one is missing, a segment ends.
struct SomeDays<'a> {
    recording: &'a dyn Recording,
    calendar: &'a Calendar,
    kept: &'a [bool],
}

struct SomeRows<'a> {
    rows: Box<dyn Source + 'a>,
    of: &'a SomeDays<'a>,
    segment: u32,
    given: bool,
    broken: bool,
    /// A row that waits until the break before it is reported.
    waiting: Option<(Instant, Vec<f64>)>,
}

impl Recording for SomeDays<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        Ok(Box::new(SomeRows {
            rows: self.recording.open(plan)?,
            of: self,
            segment: 0,
            given: false,
            broken: false,
            waiting: None,
        }))
    }
}

impl Source for SomeRows<'_> {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        if let Some((at, row)) = self.waiting.take() {
            samples.values = row;
            return Ok(Some(Event::Row(at)));
        }
        while let Some(event) = self.rows.next(samples)? {
            let Event::Row(at) = event else {
                self.segment += 1;
                self.broken = self.given;
                continue;
            };
            if !self.of.kept[self.of.calendar.day_of(self.segment, at)] {
                self.broken = self.given;
                continue;
            }
            self.given = true;
            if std::mem::take(&mut self.broken) {
                self.waiting = Some((at, samples.values.clone()));
                return Ok(Some(Event::Segment));
            }
            return Ok(Some(event));
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::super::gap::Gaps;
    use super::*;

    #[test]
    fn fits_on_a_few_days_come_from_the_whole_recording() {
        assert_eq!(placings(1, 7), [0, 3, 6]);
        assert_eq!(placings(5, 7), [0, 1, 2]);
        assert_eq!(placings(6, 7), [0, 1]);
        assert_eq!(placings(2, 3), [0, 1]);
    }

    fn at(hours: i64) -> Instant {
        Instant::from_ns(hours * 3_600_000_000_000)
    }

    /// With truths at such hours of segments.
    fn calendar(segments: Vec<Option<(Instant, Instant)>>, truths: &[(u32, i64)]) -> Calendar {
        let mut trace = Trace::default();
        trace.truths.push(TruthTrace {
            slot: 0,
            no_model: athermal_run::score::NoModel::Zero,
            times: truths.iter().map(|&(of, hour)| (of, at(hour))).collect(),
            values: vec![0.0; truths.len()],
            errors: vec![f64::NAN; truths.len()],
            persistence: BTreeMap::new(),
            predictions: Vec::new(),
        });
        let observation = Observation {
            trace,
            sources: Vec::new(),
            segments,
            rows: Gaps::default(),
            valid: Vec::new(),
        };
        Calendar::new(&observation, at(24) - at(0))
    }

    #[test]
    fn a_short_rest_belongs_to_the_day_before_and_a_segment_begins_a_day() {
        let segments = vec![Some((at(0), at(58))), None, Some((at(0), at(5)))];
        let calendar = calendar(segments, &[(0, 1), (0, 30), (0, 57), (2, 0)]);
        assert_eq!(calendar.count(), 3);
        assert_eq!(calendar.day_of(0, at(57)), 1);
        assert_eq!(calendar.day_of(2, at(1)), 2);
    }

    #[test]
    fn a_day_without_a_truth_is_no_day() {
        let segments = vec![Some((at(0), at(240)))];
        let calendar = calendar(segments, &[(0, 1), (0, 25), (0, 239)]);
        assert_eq!(calendar.count(), 3);
        assert_eq!(calendar.day_of(0, at(20)), 0);
        assert_eq!(calendar.day_of(0, at(26)), 1);
        assert_eq!(calendar.day_of(0, at(230)), 2);
        assert_eq!(calendar.numbers, [1, 2, 10]);
    }

    #[test]
    fn days_are_numbered_by_the_time_since_the_first_instant() {
        let of = |segments: &[(i64, i64)]| {
            let truths: Vec<_> = (0..).zip(segments.iter().map(|of| of.0)).collect();
            let segments = segments.iter().map(|&(from, to)| Some((at(from), at(to))));
            calendar(segments.collect(), &truths).numbers
        };
        // The file of the third day is missing; of each day there are eight hours; a clock starts again.
        assert_eq!(of(&[(0, 24), (24, 48), (72, 96)]), [1, 2, 4]);
        assert_eq!(of(&[(0, 8), (24, 32), (72, 80)]), [1, 2, 4]);
        assert_eq!(of(&[(0, 48), (0, 24), (48, 72)]), [1, 3, 5]);
    }
}
