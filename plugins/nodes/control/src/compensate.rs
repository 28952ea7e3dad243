//! The correction of an axis: minus the integral of its predicted rate of drift.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::limit;
use crate::stability::StabilityState;

/// The correction: minus the integral of the predicted rate, within limits.
///
/// `c(t) = c(t') − ∫ r dt` by the trapezoidal rule over the ticks at whose both ends the prediction `r` is valid. Otherwise the
/// correction is frozen: it does not move by anything that happens while there is no prediction. Rates beyond `max_rate`
/// are cut, those below `deadband` are taken as none. The integral stops at `± range` and leaves it at once when the rate turns
/// (no windup). What is put out follows the integral by at most `max_slew`.
///
/// A slope over a trailing window is the rate in the middle of it. So the prediction should look ahead by half the
/// span of the truth; other horizons are warned of. (Mandelli, Dankwart and Napoli integrate without, which lags by
/// half a window.)
///
/// The correction stops in the states named by `stop_in` of a `stability` node, and where the predicted rate stays
/// below `stop.below` until it exceeds `stop.above`. A fresh value of `realigned` other than 0 says that the machine
/// has measured and removed the drift itself. The correction then starts again from 0 at once, which is no motion but
/// a new reference. When the graph is replaced, the correction goes on from where it stands, whatever predicts the
/// rate then.
///
/// A correction moves the positions that are measured. A predictor of the rate that goes by past positions, with
/// lags, by votes or as it learns, must not take that for drift. An `uncorrected` node between position and drift
/// puts it back.
///
/// The port `why` says what held it back: 0 nothing, 1 no valid prediction, 2 stable, 3 below the deadband. 4 is a
/// rate that was cut, 5 the end of the range, 6 slewing. Runs at every tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compensate {
    /// The largest correction to either side: `"20 um"`. The correction is in this unit.
    #[schemars(extend("minimum" = 0))]
    pub range: Quantity,
    /// The largest predicted rate that is believed: `"1000 nm/min"`.
    #[schemars(extend("minimum" = 0))]
    pub max_rate: Quantity,
    /// The fastest motion of the correction: `"50 nm/s"`; at least `max_rate`, so that it always catches up.
    #[schemars(extend("minimum" = 0))]
    pub max_slew: Quantity,
    /// Rates below are not followed: `"1 nm/min"`; none by default.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub deadband: Option<Quantity>,
    /// Stops while the predicted rate is small.
    #[serde(default)]
    pub stop: Option<Stop>,
    /// Stops in these states of the input `state`.
    #[serde(default)]
    pub stop_in: Vec<StabilityState>,
    /// The longest time between two ticks that is integrated over.
    #[serde(default = "limit::minute")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_gap: Duration,
}

/// Where a correction stops, and from where on it goes on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Stops when the absolute rate falls below: `"3 nm/min"`.
    #[schemars(extend("minimum" = 0))]
    pub below: Quantity,
    /// Goes on when the absolute rate exceeds this: `"6 nm/min"`; not less than `below`.
    #[schemars(extend("minimum" = 0))]
    pub above: Quantity,
}

/// Why a correction did not follow the prediction, as numbers of the port `why`.
mod why {
    pub(super) const FOLLOWS: f64 = 0.0;
    pub(super) const INVALID: f64 = 1.0;
    pub(super) const STABLE: f64 = 2.0;
    pub(super) const DEADBAND: f64 = 3.0;
    pub(super) const RATE: f64 = 4.0;
    pub(super) const RANGE: f64 = 5.0;
    pub(super) const SLEW: f64 = 6.0;
    /// What held a correction back, by the number.
    pub(super) const WORDS: [&str; 7] = [
        "",
        "no valid prediction",
        "stable",
        "below the deadband",
        "rate cut",
        "at the end of its range",
        "slewing",
    ];
}

/// The limits in the unit of the correction and seconds.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// What a rate is multiplied by.
    factor: f64,
    range: f64,
    rate: f64,
    slew: f64,
    deadband: f64,
    stop: Option<(f64, f64)>,
}

impl Compensate {
    fn limits(&self, rate: &Channel) -> Result<Limits, Vec<Mistake>> {
        let unit = &self.range.unit;
        let mut speed = limit::per_second(unit);
        let mut mistakes = Vec::new();
        let factor = rate.unit.factor_to(&speed);
        if factor.is_none() {
            let message = format!(
                "`{}` is in {}, and its integral cannot be in {unit}",
                rate.name, rate.unit
            );
            let natural = rate.unit.per(&Unit::one());
            mistakes.push(Mistake::at("range", message).help(format!(
                "the rate is a change per time ({natural}); give `range` in what changes"
            )));
            // Where another limit fits the rate, it is the range that does not belong here.
            let mut limits = [&self.max_rate, &self.max_slew].into_iter();
            if limits.any(|limit| limit.unit.measures_same(&rate.unit)) {
                speed = rate.unit.clone();
            }
        }
        let mut read = |quantity: Option<&Quantity>, unit: &Unit, at: &str| {
            limit::size_or_none(quantity, unit, at, &mut mistakes)
        };
        let range = read(Some(&self.range), unit, "range");
        let max_rate = read(Some(&self.max_rate), &speed, "max_rate");
        let slew = read(Some(&self.max_slew), &speed, "max_slew");
        let deadband = read(self.deadband.as_ref(), &speed, "deadband").unwrap_or(0.0);
        let below = read(
            self.stop.as_ref().map(|stop| &stop.below),
            &speed,
            "stop.below",
        );
        let above = read(
            self.stop.as_ref().map(|stop| &stop.above),
            &speed,
            "stop.above",
        );
        if let (Some(max_rate), Some(slew)) = (max_rate, slew)
            && slew < max_rate
        {
            let message = format!(
                "`max_slew` ({}) is slower than `max_rate` ({}), so the correction would fall behind",
                self.max_slew, self.max_rate
            );
            let mistake = Mistake::at("max_slew", message).help("allow at least the largest rate");
            mistakes.push(mistake);
        }
        if let (Some(below), Some(above)) = (below, above)
            && above < below
        {
            let message = "`stop.above` lies under `stop.below`";
            mistakes.push(Mistake::at("stop.above", message));
        }
        match (factor, range, max_rate, slew) {
            (Some(factor), Some(range), Some(rate), Some(slew)) if mistakes.is_empty() => {
                Ok(Limits {
                    factor,
                    range,
                    rate,
                    slew,
                    deadband,
                    stop: below.zip(above),
                })
            }
            _ => Err(mistakes),
        }
    }
}

impl Feature for Compensate {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Correct).change().reasons(&why::WORDS)
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held(
                    "rate",
                    "the predicted rates of drift, half their span ahead",
                ),
                InputPort::held(
                    "state",
                    "the states of a stability node: one, or one per rate",
                )
                .in_unit("1")
                .or_none(),
                InputPort::fresh(
                    "realigned",
                    "other than 0 where the machine has aligned itself anew: one, or one per rate",
                )
                .in_unit("1")
                .or_none(),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("correction", "what is to be added to each position"),
                PortSummary::new(
                    "why",
                    "what held it back: 0 nothing, 1 no valid prediction, 2 stable, 3 below the deadband, 4 rate cut, 5 at the end of the range, 6 slewing",
                ),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let rate = inputs.port("rate");
        let mut mistakes = Vec::new();
        if let Some(first) = rate.first() {
            mistakes.extend(self.limits(first).err().into_iter().flatten());
            if let Some(other) = rate
                .iter()
                .position(|channel| !channel.unit.measures_same(&first.unit))
            {
                let message = format!(
                    "`{}` is in {} and `{}` in {}",
                    inputs.reference("rate", 0),
                    first.unit,
                    inputs.reference("rate", other),
                    rate[other].unit
                );
                mistakes.push(Mistake::at("inputs.rate", message));
            }
        }
        for port in ["state", "realigned"] {
            let channels = inputs.port(port);
            if !matches!(channels.len(), 0 | 1) {
                mistakes.extend(limit::same_count(port, channels, "rate", rate));
            }
        }
        if !self.stop_in.is_empty() && inputs.port("state").is_empty() {
            let message = "`stop_in` needs to know the state";
            mistakes.push(
                Mistake::at("stop_in", message).help("add `inputs.state`, a `stability` node"),
            );
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let correction = |channel: &Channel| Channel {
            name: channel.name.clone(),
            unit: self.range.unit.clone(),
            span: Duration::ZERO,
            ahead: Duration::ZERO,
            max_age: channel.default_max_age(),
        };
        let channels: Vec<Channel> = rate.iter().map(correction).collect();
        let reasons = channels.iter().map(limit::numbered).collect();
        Ok(vec![
            OutputPort {
                name: "correction",
                channels,
            },
            OutputPort {
                name: "why",
                channels: reasons,
            },
        ])
    }

    fn warnings(&self, inputs: &Inputs) -> Vec<Mistake> {
        let odd = |channel: &&Channel| {
            channel.span > Duration::ZERO && channel.ahead.as_ns() != channel.span.as_ns() / 2
        };
        let channel = inputs.port("rate").iter().find(odd);
        let doubt = |channel: &Channel| {
            let half = Duration::from_ns(channel.span.as_ns() / 2);
            let message = format!(
                "`{}` looks {} ahead, so what is integrated is not the rate at the present instant",
                channel.name, channel.ahead
            );
            let help = format!(
                "predict `ahead = \"{half}\"`, half of the {} that the drift summarises",
                channel.span
            );
            Mistake::at("inputs.rate", message).help(help)
        };
        channel.map(doubt).into_iter().collect()
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let nothing = Limits {
            factor: ABSENT,
            range: 0.0,
            rate: 0.0,
            slew: 0.0,
            deadband: 0.0,
            stop: None,
        };
        let rate = inputs.port("rate");
        let mut stops = [false; 3];
        for state in &self.stop_in {
            stops[state.number() as usize] = true;
        }
        Box::new(Compensating {
            limits: rate
                .iter()
                .map(|channel| self.limits(channel).unwrap_or(nothing))
                .collect(),
            stops,
            max_gap: self.max_gap,
            known: Known {
                last: None,
                unit: Some(self.range.unit.clone()),
                axes: vec![Axis::default(); rate.len()],
            },
        })
    }

    fn every_tick(&self) -> bool {
        true
    }
}

struct Compensating {
    limits: Vec<Limits>,
    stops: [bool; 3],
    max_gap: Duration,
    known: Known,
}

/// The state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Known {
    last: Option<Instant>,
    /// The unit of the correction; none in a state that was written before it was kept.
    #[serde(default)]
    unit: Option<Unit>,
    axes: Vec<Axis>,
}

/// What is known of one axis, in the unit of the correction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
struct Axis {
    /// Minus the integral, within the range.
    target: f64,
    /// What has been put out.
    given: f64,
    /// The rate per second at the last tick, if it was valid.
    rate: Option<f64>,
    stopped: bool,
}

impl Axis {
    /// The same in another unit.
    fn brought(self, from: Option<&Unit>, to: Option<&Unit>) -> Option<Self> {
        let brought = |value| limit::brought(value, from, to);
        let rate = match self.rate {
            Some(rate) => Some(brought(rate)?),
            None => None,
        };
        Some(Self {
            target: brought(self.target)?,
            given: brought(self.given)?,
            rate,
            stopped: self.stopped,
        })
    }

    /// Goes on by `dt` seconds to a tick with this rate, and says what held it back.
    fn follow(&mut self, limits: &Limits, rate: f64, dt: f64, stable: bool) -> f64 {
        if rate.is_nan() {
            self.rate = None;
            return why::INVALID;
        }
        let (size, mut reason) = (rate.abs(), why::FOLLOWS);
        if let Some((below, above)) = limits.stop {
            self.stopped = if self.stopped {
                size <= above
            } else {
                size < below
            };
        }
        let rate = if stable || self.stopped {
            reason = why::STABLE;
            0.0
        } else if size < limits.deadband {
            reason = why::DEADBAND;
            0.0
        } else if size > limits.rate {
            reason = why::RATE;
            limits.rate.copysign(rate)
        } else {
            rate
        };
        let Some(before) = self.rate.replace(rate) else {
            return reason;
        };
        let wanted = self.target - 0.5 * (before + rate) * dt;
        self.target = wanted.clamp(-limits.range, limits.range);
        if self.target != wanted {
            reason = why::RANGE;
        }
        let step = limits.slew * dt;
        let missing = self.target - self.given;
        if missing.abs() > step {
            reason = why::SLEW;
            self.given += step.copysign(missing);
        } else {
            self.given = self.target;
        }
        reason
    }
}

impl Operator for Compensating {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let (rates, states, realigned) = (tick.port(0), tick.port(1), tick.port(2));
        let count = self.limits.len();
        let passed = self.known.last.map(|last| tick.now - last);
        let bridged = passed.is_some_and(|passed| passed <= self.max_gap);
        let dt = passed.map_or(0.0, Duration::secs);
        self.known.last = Some(tick.now);
        for (i, (axis, limits)) in self.known.axes.iter_mut().zip(&self.limits).enumerate() {
            let of = |port: &[f64]| port.get(if port.len() == 1 { 0 } else { i }).copied();
            let state = of(states).filter(|state| (0.0..3.0).contains(state));
            let stable = state.is_some_and(|state| self.stops[state as usize]);
            if !bridged {
                axis.rate = None;
            }
            // A rate beyond all numbers is none.
            let rate = rates[i] * limits.factor;
            let rate = if rate.is_finite() { rate } else { ABSENT };
            let reason = axis.follow(limits, rate, dt, stable);
            if of(realigned).is_some_and(|mark| !mark.is_nan() && mark != 0.0) {
                (axis.target, axis.given) = (0.0, 0.0);
            }
            outputs.set_stamped(i, axis.given, tick.now);
            outputs.set_stamped(count + i, reason, tick.now);
        }
    }

    fn segment(&mut self) {
        self.known.last = None;
        self.known.axes.fill(Axis::default());
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let mut known = match state.known::<Known>() {
            Ok(known) if known.axes.len() == self.known.axes.len() => known,
            Ok(_) => return Restored::cold("the number of axes differs"),
            Err(cold) => return cold,
        };
        for (axis, limits) in known.axes.iter_mut().zip(&self.limits) {
            let Some(brought) = axis.brought(known.unit.as_ref(), self.known.unit.as_ref()) else {
                return Restored::cold("the correction is of another quantity");
            };
            *axis = brought;
            // Limits may be tighter than those under which the state arose; the output then comes back by its slew.
            axis.target = axis.target.clamp(-limits.range, limits.range);
        }
        known.unit.clone_from(&self.known.unit);
        self.known = known;
        Restored::Accepted
    }

    fn outlives_changes(&self) -> bool {
        true
    }
}

athermal_core::state!(Known, "compensate/1");

athermal_core::register!(Compensate, Feature, "compensate");
