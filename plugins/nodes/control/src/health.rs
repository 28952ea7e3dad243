//! Whether a sensor may be trusted.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, Pace,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;

/// Watches each channel and lets only trustworthy samples through.
///
/// A faulty channel is absent, and the port `reason` says why: 0 healthy, 1 out of range, 2 changes too fast, 3 stuck.
/// 4 is too little noise, 5 too much noise, 6 silent, 7 recovering. After a fault a channel must have been in order for
/// `recover` before its samples pass again. Only the checks that are given are made. The noise is that of single
/// samples, `√(Σ (x_i − x_{i−1})² / 2n)` of their `n` differences (von Neumann 1941), over the last `noise_samples`.
/// Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Health {
    /// Lowest and highest trusted value, such as `["-20 Cel", "200 Cel"]`. A `range` of the signal itself takes samples away before
    /// they come here: then `reason` does not become 1, but 6 after `max_gap`. Give one of the two.
    #[serde(default)]
    pub range: Option<[Quantity; 2]>,
    /// The fastest change from one sample to the next, such as `"2 K/s"`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub max_rate: Option<Quantity>,
    /// For how long the very same value may come again and again. A silence longer than this, or than `max_gap`, ends the count.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub stuck_after: Option<Duration>,
    /// The least noise of a living sensor, such as `"0.1 mK"`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub noise_above: Option<Quantity>,
    /// The most noise of a sound one, such as `"20 mK"`.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub noise_below: Option<Quantity>,
    /// Over how many samples noise is judged, 3 to 100,000.
    #[serde(default = "thirty")]
    #[schemars(range(min = 3, max = 100_000))]
    pub noise_samples: usize,
    /// The longest silence.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: Option<Duration>,
    /// For how long a channel must have been in order again.
    #[serde(default)]
    pub recover: Duration,
}

fn thirty() -> usize {
    30
}

/// The numbers of the port `reason`.
mod reason {
    pub(super) const HEALTHY: u8 = 0;
    pub(super) const RANGE: u8 = 1;
    pub(super) const RATE: u8 = 2;
    pub(super) const STUCK: u8 = 3;
    pub(super) const QUIET: u8 = 4;
    pub(super) const NOISY: u8 = 5;
    pub(super) const SILENT: u8 = 6;
    pub(super) const RECOVERING: u8 = 7;
    /// Each by its number.
    pub(super) const WORDS: [&str; 8] = [
        "healthy",
        "out of range",
        "changes too fast",
        "stuck",
        "too little noise",
        "too much noise",
        "silent",
        "recovering",
    ];
}

/// The limits in the unit of a channel and seconds; infinite or 0 where nothing is checked.
#[derive(Debug, Clone, Copy)]
struct Limits {
    range: (f64, f64),
    rate: f64,
    noise: (f64, f64),
}

impl Health {
    fn limits(&self, channel: &Channel) -> Result<Limits, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let unit = &channel.unit;
        let point = |quantity: &Quantity| {
            quantity.in_unit(unit).ok_or_else(|| {
                let message = format!(
                    "`range` is in {}, and `{}` in {unit}",
                    quantity.unit, channel.name
                );
                Mistake::at("range", message)
            })
        };
        let range = match &self.range {
            None => (f64::NEG_INFINITY, f64::INFINITY),
            Some([low, high]) => match (point(low), point(high)) {
                (Ok(low), Ok(high)) if low < high => (low, high),
                (Ok(_), Ok(_)) => {
                    mistakes.push(Mistake::at(
                        "range",
                        "the lowest value is not below the highest",
                    ));
                    (f64::NEG_INFINITY, f64::INFINITY)
                }
                (low, high) => {
                    mistakes.extend(low.err().or(high.err()));
                    (f64::NEG_INFINITY, f64::INFINITY)
                }
            },
        };
        let difference = unit.difference();
        let mut read = |quantity: Option<&Quantity>, unit: &Unit, at: &str| {
            limit::size_or_none(quantity, unit, at, &mut mistakes)
        };
        let rate = read(self.max_rate.as_ref(), &limit::per_second(unit), "max_rate");
        let least = read(self.noise_above.as_ref(), &difference, "noise_above").unwrap_or(0.0);
        let most =
            read(self.noise_below.as_ref(), &difference, "noise_below").unwrap_or(f64::INFINITY);
        if least > most {
            let message = "`noise_below` lies under `noise_above`";
            mistakes.push(Mistake::at("noise_below", message));
        }
        if mistakes.is_empty() {
            Ok(Limits {
                range,
                rate: rate.unwrap_or(f64::INFINITY),
                noise: (least, most),
            })
        } else {
            Err(mistakes)
        }
    }

    fn watches_noise(&self) -> bool {
        self.noise_above.is_some() || self.noise_below.is_some()
    }
}

impl Feature for Health {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Watch)
            .reasons(&reason::WORDS)
            .pace(Pace::Passes)
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "the channels to watch")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("signal", "each channel while it can be trusted"),
                PortSummary::new(
                    "reason",
                    "0 healthy, 1 out of range, 2 changes too fast, 3 stuck, 4 too little noise, 5 too much noise, 6 silent, 7 recovering",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let signal = inputs.port("signal");
        for channel in signal {
            self.limits(channel)?;
        }
        Ok(limit::with_reasons(signal))
    }

    fn warnings(&self, _inputs: &Inputs) -> Vec<Mistake> {
        let checks = self.range.is_some()
            || self.max_rate.is_some()
            || self.stuck_after.is_some()
            || self.max_gap.is_some()
            || self.watches_noise();
        if checks {
            return Vec::new();
        }
        let help =
            "give `range`, `max_rate`, `stuck_after`, `noise_above`, `noise_below` or `max_gap`";
        vec![Mistake::at("", "no check is made, so every sample passes").help(help)]
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let all = Limits {
            range: (f64::NEG_INFINITY, f64::INFINITY),
            rate: f64::INFINITY,
            noise: (0.0, f64::INFINITY),
        };
        let signal = inputs.port("signal");
        let kept = if self.watches_noise() {
            self.noise_samples.clamp(3, 100_000) - 1
        } else {
            0
        };
        Box::new(Watching {
            limits: signal
                .iter()
                .map(|channel| self.limits(channel).unwrap_or(all))
                .collect(),
            spec: self.clone(),
            sensors: vec![Sensor::new(kept); signal.len()],
        })
    }

    fn every_tick(&self) -> bool {
        true
    }
}

struct Watching {
    spec: Health,
    limits: Vec<Limits>,
    sensors: Vec<Sensor>,
}

/// Where the sum of all squares stands.
const ALL: usize = 1;

/// What is known of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Sensor {
    /// When the last sample was, whatever its value.
    heard: Option<Instant>,
    /// The last sample within the range.
    newest: Option<(Instant, f64)>,
    /// Since when the value has been the same.
    same_since: Option<Instant>,
    /// When the first tick was, so that silence from the start is noticed.
    begun: Option<Instant>,
    fault: u8,
    /// Since when all has been in order after a fault.
    in_order_since: Option<Instant>,
    /// Squared successive differences, as a ring.
    squares: Vec<f64>,
    next: usize,
    full: bool,
    /// Their sums, as a tree: the `i`th is that of the two at `2 i` and `2 i + 1`, the squares standing behind the sums. So a
    /// square is put in by as many additions as the tree is deep, and none is ever subtracted: the sum of all, the first,
    /// follows from the ring alone, and of what has left it nothing remains.
    #[serde(skip)]
    sums: Vec<f64>,
}

impl Sensor {
    fn new(kept: usize) -> Self {
        Self {
            heard: None,
            newest: None,
            same_since: None,
            begun: None,
            fault: reason::HEALTHY,
            in_order_since: None,
            squares: vec![0.0; kept],
            next: 0,
            full: false,
            sums: vec![0.0; kept],
        }
    }

    fn forget(&mut self) {
        (self.heard, self.newest, self.same_since) = (None, None, None);
        (self.begun, self.in_order_since) = (None, None);
        (self.fault, self.next, self.full) = (reason::HEALTHY, 0, false);
    }

    /// The noise of single samples, once there are enough of them.
    fn noise(&self) -> Option<f64> {
        let mean = || self.sums[ALL] / self.squares.len() as f64;
        self.full.then(|| (0.5 * mean()).sqrt())
    }

    /// The sums of a ring that comes without them.
    fn sum_up(&mut self) {
        self.sums.clear();
        self.sums.resize(self.squares.len(), 0.0);
        (ALL..self.sums.len()).rev().for_each(|at| self.sum(at));
    }

    fn sum(&mut self, at: usize) {
        let part = |at: usize| match self.sums.get(at) {
            Some(&sum) => sum,
            None => self.squares[at - self.sums.len()],
        };
        self.sums[at] = part(2 * at) + part(2 * at + 1);
    }

    fn note(&mut self, difference: f64) {
        if self.squares.is_empty() {
            return;
        }
        self.squares[self.next] = difference * difference;
        let mut at = (self.next + self.squares.len()) / 2;
        while at >= ALL {
            self.sum(at);
            at /= 2;
        }
        self.next += 1;
        if self.next == self.squares.len() {
            (self.next, self.full) = (0, true);
        }
    }

    /// What is wrong with a new sample.
    fn examine(&mut self, spec: &Health, limits: &Limits, value: f64, now: Instant) -> u8 {
        let silence = self.heard.replace(now).map(|then| now - then);
        let before = self.newest;
        // Written so that an infinite value is out of range even where there is no limit.
        if !value.is_finite() || value < limits.range.0 || value > limits.range.1 {
            return reason::RANGE;
        }
        self.newest = Some((now, value));
        if let Some((then, last)) = before {
            let difference = value - last;
            self.note(difference);
            let longest = spec.stuck_after.into_iter().chain(spec.max_gap).min();
            let went_on = silence.is_none_or(|silence| longest.is_none_or(|most| silence <= most));
            if difference != 0.0 || !went_on {
                self.same_since = Some(now);
            }
            if difference.abs() > limits.rate * (now - then).secs() {
                return reason::RATE;
            }
        }
        let same_since = *self.same_since.get_or_insert(now);
        if spec
            .stuck_after
            .is_some_and(|limit| now - same_since >= limit)
        {
            return reason::STUCK;
        }
        match self.noise() {
            Some(noise) if noise < limits.noise.0 => reason::QUIET,
            Some(noise) if noise > limits.noise.1 => reason::NOISY,
            _ => reason::HEALTHY,
        }
    }

    /// Goes from what was found to what is given: a channel in order again is waited for.
    fn conclude(&mut self, found: u8, recover: Duration, now: Instant) -> u8 {
        if found != reason::HEALTHY {
            self.in_order_since = None;
            self.fault = found;
        } else if self.fault != reason::HEALTHY {
            let since = *self.in_order_since.get_or_insert(now);
            self.fault = if now - since >= recover {
                reason::HEALTHY
            } else {
                reason::RECOVERING
            };
            if self.fault == reason::HEALTHY {
                self.in_order_since = None;
            }
        }
        self.fault
    }
}

impl Operator for Watching {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let count = self.sensors.len();
        for (i, (&value, sensor)) in tick.port(0).iter().zip(&mut self.sensors).enumerate() {
            let begun = *sensor.begun.get_or_insert(tick.now);
            if value.is_nan() {
                let heard = sensor.heard.unwrap_or(begun);
                let silent = self
                    .spec
                    .max_gap
                    .is_some_and(|limit| tick.now - heard > limit);
                if silent && sensor.fault != reason::SILENT {
                    sensor.conclude(reason::SILENT, self.spec.recover, tick.now);
                    outputs.set_stamped(i, ABSENT, tick.now);
                }
            } else {
                let found = sensor.examine(&self.spec, &self.limits[i], value, tick.now);
                let fault = sensor.conclude(found, self.spec.recover, tick.now);
                let passed = if fault == reason::HEALTHY {
                    value
                } else {
                    ABSENT
                };
                outputs.set_stamped(i, passed, tick.stamps(0)[i]);
            }
            outputs.set_stamped(count + i, f64::from(sensor.fault), tick.now);
        }
    }

    fn segment(&mut self) {
        self.sensors.iter_mut().for_each(Sensor::forget);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Watched {
            sensors: self.sensors.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let state = match state.known::<Watched>() {
            Ok(state) if state.sensors.len() == self.sensors.len() => state,
            Ok(_) => return Restored::cold("the number of channels differs"),
            Err(cold) => return cold,
        };
        let same = |(old, new): (&Sensor, &Sensor)| old.squares.len() == new.squares.len();
        if !state.sensors.iter().zip(&self.sensors).all(same) {
            return Restored::cold("the number of samples over which noise is judged differs");
        }
        self.sensors = state.sensors;
        self.sensors.iter_mut().for_each(Sensor::sum_up);
        Restored::Accepted
    }
}

/// The state of all channels.
#[derive(Debug, Serialize, Deserialize)]
struct Watched {
    sensors: Vec<Sensor>,
}

athermal_core::state!(Watched, "health/2");

athermal_core::register!(Health, Feature, "health");
