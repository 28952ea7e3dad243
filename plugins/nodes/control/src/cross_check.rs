//! Whether a sensor contradicts the others.

use athermal_core::channel::ABSENT;
use athermal_core::diagnostic::counted;
use athermal_core::node::{
    Duty, Encoder, Feature, Hindsight, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort,
    Outputs, Pace, PortSummary, Predictor, Reach, Regressor, Restored, State, Tick, Trained,
    Trainer, TrainingError, TrainingReport, TrainingSetup,
};
use athermal_core::time::{Duration, Instant};
use athermal_numerics::{Agreement, GramBlocks, Look};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::verdict::{Answer, Answers, Seen, Verdict};
use crate::limit;

/// Learns in the fit how sensors go together, and lets through only those that still do.
///
/// A sensor that comes loose, or is moved or swapped while it reads, gives what is possible, and what the others do not. Its channel is
/// then absent, as that of a sensor that is dead, and estimators on other sensors go on. The port `reason` says why: 0 it agrees,
/// 1 it contradicts the others, 2 it has not agreed for `recover` yet, 3 nothing was learned, so that all pass. 4 says that it contradicts
/// them and is right by the truths.
///
/// `d = zᵀMz` with `M = 10⁻⁶ (ZᵀZ / n + 10⁻⁶ I)⁻¹`, over its 99.9 % quantile in the fit, is compared with `limit`. `z`
/// are the standardised channels, now and `lag` ago, and `Z` those of the `n` rows of the fit, at the instants of the
/// truth, whatever that is. Of each row it takes the part in directions that the fit hardly took. It finds the sensor
/// without which nothing of that part is left (the contribution by reconstruction of Alcala and Qin 2009). Where it is
/// more than `limit` times what is usual in the fit, for as long as `after`, and falls below that without the sensor,
/// the sensor contradicts the others. Where two are wrong at once, or the machine itself has changed so that no sensor
/// alone explains it, none is named; a fast machine moves all that hang together.
///
/// A load that the fit never saw makes the sensor nearest to its heat contradict the others too, and that sensor is right. Heat comes
/// and goes slowly; a sensor that comes off leaps, and in air it is restless. So a tenth of a contradiction has to be sudden:
/// `m s² ≥ d / 10`, with `s² = Σ (x - 2x₁ + x₂)²` over its standardised samples, faded over `lag`, and `m` its own element of `M`.
/// What contradicts the others slowly, or from the first sample on, passes, and so does a sensor with less than a sample each `lag`.
///
/// One sensor is left out at a time, and only while half of all channels stay, since others have to go on. It is given back when it
/// agrees again, and after `longest` in any case.
///
/// With `hindsight` the fit also predicts the truth, by a ridge from all sensors and by one without each. It takes them as they are, as
/// they were `lag` ago, and as they were at the beginning of the window that the truth is of. From the run on at which a sensor has been
/// left out, one truth of each window is set against both, once it is known. After three of them the sensor is given back where
/// `Σ (y - ŷ)² < Σ (y - ŷ₋)²`, `ŷ₋` without it, and for as long as that stays so. Each window counts a tenth less than the next. What was
/// found counts when the same sensor contradicts the others again, up to `longest` later.
///
/// A sensor can be named only as far as others know of it: of two that see nothing in common, neither contradicts the
/// other. The rows of the fit must reach over 30 times `lag`, 5 hours, or nothing is learned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CrossCheck {
    /// How far back all channels are looked at beside the present: about as long as heat takes from one sensor to the next.
    #[serde(default = "ten_minutes")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub lag: Duration,
    /// How many times as far apart as is usual in the fit, 1 or more. It is the square of a distance, of which one row of a thousand
    /// has more than 1.
    #[serde(default = "six")]
    #[schemars(range(min = 1.0))]
    pub limit: f64,
    /// For how long a sensor must contradict the others.
    #[serde(default = "minute")]
    pub after: Duration,
    /// For how long it must have agreed with them again. Below `lag` its past may still contradict.
    #[serde(default = "ten_minutes")]
    pub recover: Duration,
    /// For how long a sensor is left out at most. After that it is left out anew only where it leaps again.
    #[serde(default = "day")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub longest: Duration,
    /// Whether truths decide if a sensor that contradicts the others is right: it is given back where predictions with it have been better.
    /// Not for a machine that a correction moves by what is made of it, unless the truth is `uncorrected`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub hindsight: bool,
}

fn ten_minutes() -> Duration {
    Duration::from_ns(600_000_000_000)
}

fn minute() -> Duration {
    Duration::from_ns(60_000_000_000)
}

fn day() -> Duration {
    Duration::from_ns(86_400_000_000_000)
}

fn six() -> f64 {
    6.0
}

/// So many times the lag the rows of a fit must reach over.
const LEAST_LAGS: i64 = 30;

/// A contradiction is no heat where what was sudden, so many times, has as much in it.
const SUDDEN: f64 = 10.0;

/// The numbers of the port `reason`.
mod reason {
    pub(super) const AGREES: f64 = 0.0;
    pub(super) const CONTRADICTS: f64 = 1.0;
    pub(super) const RECOVERING: f64 = 2.0;
    pub(super) const UNKNOWN: f64 = 3.0;
    pub(super) const BELIEVED: f64 = 4.0;
}

impl Feature for CrossCheck {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Compare).pace(Pace::Passes)
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("signal", "the sensors that are compared"),
                InputPort::truth(
                    "at whose instants it learns; what it is matters to `hindsight` alone",
                ),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("signal", "each channel while it agrees with the others"),
                PortSummary::new(
                    "reason",
                    "0 agrees, 1 contradicts the others, 2 recovering, 3 nothing was learned, 4 right by truths",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let signal = inputs.port("signal");
        if signal.len() < 3 {
            let message = format!(
                "it compares {}, and needs three",
                counted(signal.len() as u64, "channel")
            );
            let help = "of two that differ neither is known to be wrong";
            return Err(vec![Mistake::at("inputs.signal", message).help(help)]);
        }
        Ok(limit::with_reasons(signal))
    }

    /// The others only say whether a value is there.
    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn encoder(&self) -> Option<&dyn Encoder> {
        Some(self)
    }

    fn memory(&self) -> Duration {
        self.lag + self.after + self.recover
    }

    fn every_tick(&self) -> bool {
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let count = inputs.port("signal").len();
        let fit = inputs.fit::<Learned>();
        let learned = fit.and_then(|(fit, places)| {
            // One that compares what is only predicted from was made by nobody.
            let is_own = |of: &Agreement| {
                let mut compared = places.iter().take(of.means.len());
                compared.all(|&place| place < 2 * count)
            };
            let agreement = fit.agreement.clone().filter(is_own)?;
            Some(Known::new(agreement, &fit.answers, places, count))
        });
        Box::new(Checking {
            spec: self.clone(),
            is_fitted: fit.is_some(),
            learned,
            hindsight: inputs.hindsight,
            sensors: vec![Sensor::default(); count],
            verdict: Verdict::default(),
        })
    }
}

impl Encoder for CrossCheck {
    fn lags(&self) -> Vec<Duration> {
        vec![Duration::ZERO, self.lag]
    }

    fn looks_back(&self) -> bool {
        self.hindsight
    }

    fn trainer(&self, setup: &TrainingSetup) -> Box<dyn Trainer> {
        let is_compared = |of: &&Regressor| of.lag.is_zero() || of.lag == self.lag;
        Box::new(Learning {
            compared: setup.regressors.iter().take_while(is_compared).count(),
            regressors: setup.regressors.clone(),
            predicts: self.hindsight,
            least: Duration::from_ns(self.lag.as_ns().saturating_mul(LEAST_LAGS)),
            blocks: GramBlocks::with_row_memory(setup.regressors.len(), setup.memory),
            reached: Duration::ZERO,
            last: None,
        })
    }
}

/// Takes the rows of a fit.
struct Learning {
    regressors: Vec<Regressor>,
    /// How many of them go together; from the others the truth is predicted.
    compared: usize,
    /// Whether it learns to predict the truth too.
    predicts: bool,
    /// Over how much time the rows must reach.
    least: Duration,
    blocks: GramBlocks,
    reached: Duration,
    last: Option<Instant>,
}

impl Trainer for Learning {
    fn row(&mut self, regressors: &[f64], truth: f64) {
        self.blocks.push(regressors, truth);
    }

    fn row_at(&mut self, at: Instant, regressors: &[f64], truth: f64) {
        if let Some(last) = self.last.replace(at) {
            self.reached += at - last;
        }
        self.row(regressors, truth);
    }

    fn segment(&mut self) {
        self.last = None;
    }

    fn finish(self: Box<Self>) -> Result<Trained, TrainingError> {
        let mut report = TrainingReport::default();
        let (mut agreement, mut answers) = (None, Vec::new());
        if self.reached < self.least {
            report.notes.push(format!(
                "the rows reach over {} and it takes {} to learn how sensors go together, so all will pass",
                self.reached, self.least
            ));
        } else if let Some(rows) = self.blocks.rows() {
            let total = self.blocks.total();
            let compared: Vec<usize> = (0..self.compared).collect();
            let own = total.of_columns(&compared).ok();
            agreement = own.and_then(|own| Agreement::of(&own, rows));
            if self.predicts && agreement.is_some() {
                match Answer::all(&total, &self.regressors) {
                    Some(found) => answers = found,
                    None => report.notes.push(
                        "no ridge predicts the truth from the sensors, so no truth will decide"
                            .to_owned(),
                    ),
                }
            }
        } else {
            report.notes.push(
                "the rows did not fit in memory, so nothing is learned and all will pass"
                    .to_owned(),
            );
        }
        report.figure("learned", agreement.is_some());
        let uses = self.regressors.into_iter().map(|of| of.name);
        let predictor = Box::new(Learned {
            uses: uses.collect(),
            agreement,
            answers,
        });
        Ok(Trained { predictor, report })
    }
}

/// How sensors go together, as a model file has it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Learned {
    /// Channels, now and a lag ago.
    uses: Vec<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    agreement: Option<Agreement>,
    /// What the truth was predicted from, where truths decide.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    answers: Vec<Answer>,
}

impl Predictor for Learned {
    fn uses(&self) -> &[String] {
        &self.uses
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let Some(agreement) = &self.agreement else {
            return Vec::new();
        };
        let width = self.uses.len();
        let lists = [("agreement.means", agreement.means.len())];
        // What is only predicted from is behind.
        let needed = match self.answers.is_empty() {
            true => width,
            false => agreement.means.len().min(width),
        };
        let mut mistakes = Mistake::of_lengths(needed, &lists);
        if !agreement.is_sound() {
            let message = "`agreement` has not as many finite values as its parts need";
            mistakes.push(Mistake::at("agreement", message));
        }
        mistakes.extend(Answer::mistakes(&self.answers, width));
        mistakes
    }

    fn predict(&self, _regressors: &[f64]) -> f64 {
        f64::NAN
    }
}

athermal_core::predictor!(Learned, "cross_check");

/// What was learned, at work.
struct Known {
    agreement: Agreement,
    /// Where each column is among the values of the port.
    places: Vec<usize>,
    /// The columns of each channel; none of one that had no values in the fit.
    columns: Vec<Option<(usize, Option<usize>)>>,
    look: Look,
    answers: Option<Answers>,
}

impl Known {
    fn new(agreement: Agreement, answers: &[Answer], places: &[usize], count: usize) -> Self {
        let columns = (0..count).map(|channel| {
            let compared = 0..agreement.means.len();
            let mut own = compared.filter(|&column| places[column] % count == channel);
            own.next().map(|first| (first, own.next()))
        });
        let columns: Vec<_> = columns.collect();
        let firsts: Vec<_> = columns
            .iter()
            .map(|own| own.map(|(first, _)| first))
            .collect();
        Self {
            answers: Answers::of(answers, &firsts),
            columns,
            places: places.to_vec(),
            look: agreement.look(),
            agreement,
        }
    }

    /// How far values are apart.
    fn apart(&mut self, values: &[f64]) -> f64 {
        let column = |nth: usize| values[self.places[nth]];
        self.agreement.apart(column, &mut self.look)
    }

    /// The channel that alone, and suddenly, makes values that are so far apart be so, by a limit.
    fn alone(&self, apart: f64, limit: f64, sensors: &[Sensor]) -> Option<usize> {
        let share = |columns: Option<_>| {
            columns.map_or(0.0, |columns| self.agreement.share(columns, &self.look))
        };
        let shares = self
            .columns
            .iter()
            .map(|columns| share(*columns))
            .enumerate();
        let (most, share) =
            shares.reduce(|most, next| if next.1 > most.1 { next } else { most })?;
        let (first, _) = self.columns[most]?;
        let sudden = (self.agreement).share_of_one(first, sensors[most].sudden, &self.look);
        (apart > limit && apart - share <= limit && SUDDEN * sudden >= share).then_some(most)
    }
}

struct Checking {
    spec: CrossCheck,
    is_fitted: bool,
    /// How sensors go together, where the rows of the fit said so.
    learned: Option<Known>,
    hindsight: Option<Hindsight>,
    sensors: Vec<Sensor>,
    /// On the sensor that is out.
    verdict: Verdict,
}

/// What is known of one sensor. A state of before leaps were looked for has less of it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
struct Sensor {
    /// The stamp of the last sample that was looked at.
    last: Option<Instant>,
    /// Its value, and how much more that was than the one before.
    value: f64,
    change: f64,
    /// The sum of the squares of what its changes differed by, which fades.
    sudden: f64,
    /// Since when it has been the one that contradicts the others.
    since: Option<Instant>,
    /// Since when it has been left out.
    out: Option<Instant>,
    /// Whether its last value was let through.
    passes: bool,
    /// Since when it agrees, after it did not.
    agrees_since: Option<Instant>,
    /// Whether it has a new sample at this tick.
    #[serde(skip)]
    is_new: bool,
}

impl Sensor {
    /// Takes what it reads at a tick.
    fn read(&mut self, value: f64, stamp: Instant, lag: Duration) {
        self.is_new = !value.is_nan() && self.last.is_none_or(|last| last < stamp);
        if !self.is_new {
            return;
        }
        match self.last.replace(stamp) {
            Some(last) if stamp - last <= lag => {
                let change = value - self.value;
                let jump = change - self.change;
                let (lag, gone) = (lag.secs(), (stamp - last).secs());
                self.sudden = self.sudden * (lag / (lag + gone)) + jump * jump;
                self.change = change;
            }
            // Over a hole heat may have moved it as far as it likes.
            _ => (self.change, self.sudden) = (0.0, 0.0),
        }
        self.value = value;
    }
}

impl Checking {
    /// Finds which sensor contradicts the others at a tick.
    fn judge(&mut self, values: &[f64], now: Instant) {
        let Self {
            spec,
            learned,
            sensors,
            verdict,
            ..
        } = self;
        let Some(known) = learned else { return };
        let apart = known.apart(values);
        if let Some(nth) = sensors.iter().position(|sensor| sensor.out.is_some()) {
            let sensor = &mut sensors[nth];
            let agrees = if values[nth].is_nan() {
                false
            } else if apart > spec.limit {
                sensor.agrees_since = None;
                false
            } else {
                now - *sensor.agrees_since.get_or_insert(now) >= spec.recover
            };
            if agrees || sensor.out.is_some_and(|at| now - at >= spec.longest) {
                (sensor.out, sensor.agrees_since) = (None, None);
            }
            return;
        }
        let count = sensors.len();
        let there = values[..count].iter().filter(|value| !value.is_nan());
        // Half of all have to stay without it.
        let suspect = (2 * there.count() >= count + 2)
            .then(|| known.alone(apart, spec.limit, sensors))
            .flatten();
        for (nth, sensor) in sensors.iter_mut().enumerate() {
            if suspect != Some(nth) {
                sensor.since = None;
            } else if now - *sensor.since.get_or_insert(now) >= spec.after {
                (sensor.out, sensor.since) = (Some(now), None);
                verdict.begin(nth, now, spec.longest);
            }
        }
    }

    /// Sets what is known by now against predictions with the sensor that is out, and without it.
    fn know_better(&mut self, tick: &Tick<'_>) {
        let out = self.sensors.iter().enumerate();
        let mut out = out.filter_map(|(nth, sensor)| Some((nth, sensor.out?)));
        let Some((channel, began)) = out.next() else {
            return;
        };
        let known = self.learned.as_ref();
        let known = known.and_then(|known| Some((&known.places, known.answers.as_ref()?)));
        let (Some((places, answers)), Some(hindsight)) = (known, self.hindsight) else {
            return;
        };
        let (before, later) = (tick.port(hindsight.port), hindsight.port + 1);
        let column = |nth: usize| before[places[nth]];
        let seen = Seen {
            truth: tick.port(later)[0],
            known: tick.stamps(later)[0],
            hindsight,
            column: &column,
        };
        self.verdict.look(answers, channel, began, &seen);
    }
}

impl Operator for Checking {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        if !self.is_fitted {
            return;
        }
        let (values, stamps) = (tick.port(0), tick.stamps(0));
        for (nth, sensor) in self.sensors.iter_mut().enumerate() {
            sensor.read(values[nth], stamps[nth], self.spec.lag);
        }
        self.judge(values, tick.now);
        self.know_better(tick);
        let believes = self.verdict.believes();
        let count = self.sensors.len();
        for (nth, sensor) in self.sensors.iter_mut().enumerate() {
            let passes = !values[nth].is_nan() && (sensor.out.is_none() || believes);
            if passes && sensor.is_new {
                outputs.set_stamped(nth, values[nth], stamps[nth]);
            } else if !passes && sensor.passes {
                outputs.set_stamped(nth, ABSENT, tick.now);
            }
            sensor.passes = passes;
            let reason = match (&self.learned, sensor.out, sensor.agrees_since) {
                (None, ..) => reason::UNKNOWN,
                (_, None, _) => reason::AGREES,
                (_, Some(_), _) if believes => reason::BELIEVED,
                (_, Some(_), None) => reason::CONTRADICTS,
                (_, Some(_), Some(_)) => reason::RECOVERING,
            };
            outputs.set_stamped(count + nth, reason, tick.now);
        }
    }

    fn segment(&mut self) {
        self.sensors.fill(Sensor::default());
        self.verdict = Verdict::default();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Checked {
            sensors: self.sensors.clone(),
            verdict: self.verdict.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Checked| {
            if state.sensors.len() != self.sensors.len() {
                return Err("the number of channels differs");
            }
            (self.sensors, self.verdict) = (state.sensors, state.verdict);
            Ok(())
        })
    }
}

/// The state of all channels.
#[derive(Debug, Serialize, Deserialize)]
struct Checked {
    sensors: Vec<Sensor>,
    #[serde(default)]
    verdict: Verdict,
}

athermal_core::state!(Checked, "cross_check/1");

athermal_core::register!(CrossCheck, Feature, "cross_check");

mod verdict;

#[cfg(test)]
mod tests;
