//! Samples of any clock brought to a regular one.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Brings each channel to a regular clock: one value for every period, made of the samples within it.
///
/// `y_k = Σ x_i / n` of the `n` samples in the `k`th period, or the last of them by `method`. Periods are
/// `(k · every, (k + 1) · every]`, counted from the origin of time whatever the first sample, so that several nodes and
/// several starts agree. A value comes at the first tick at or after the end of its period. There is none where that
/// tick is later than `late`, nor where a period holds no sample. The stamp is that of the newest sample within. Runs
/// at every tick.
///
/// A value that comes late has no part in the time since the end of its period, and reaches back as much further. So its span is
/// `every` and `late`, by default two periods, so that a held value counts until the next one is due. Where it is a truth, the
/// embargo and the search for leaks go by that. Where ticks come at the ends of periods or often, a short `late` withholds less.
///
/// Thinning out without averaging folds fast noise into slow: `mean`, the default, does not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resample {
    /// The length of a period.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub every: Duration,
    /// How late after the end of its period a value may come, 0 to `every`; by default until the next period ends.
    #[serde(default)]
    pub late: Option<Duration>,
    /// What is made of the samples of a period.
    #[serde(default)]
    pub method: ResampleMethod,
}

impl Resample {
    /// How late a value may come.
    fn late(&self) -> Duration {
        self.late.unwrap_or(self.every)
    }
}

/// What is made of the samples of a period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ResampleMethod {
    /// Their mean.
    #[default]
    Mean,
    /// The last one.
    Last,
}

impl Feature for Resample {
    fn inputs() -> &'static [InputPort] {
        const {
            &[InputPort::fresh(
                "signal",
                "what is brought to a regular clock",
            )]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[PortSummary::new(
                "signal",
                "each channel at regular instants",
            )]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        let late = self.late();
        let message = format!("`late` is {late} and must be from 0 s to {}", self.every);
        Vec::from_iter((late > self.every).then(|| Mistake::at("late", message)))
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let regular = |channel: &Channel| Channel {
            span: channel.span + self.every + self.late(),
            ..channel.clone()
        };
        Ok(vec![OutputPort {
            name: "signal",
            channels: inputs.port("signal").iter().map(regular).collect(),
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn memory(&self) -> Duration {
        self.every
    }

    fn every_tick(&self) -> bool {
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Resampling {
            spec: self.clone(),
            known: Periods {
                every: self.every,
                end: Instant::MIN,
                channels: vec![Period::EMPTY; inputs.port("signal").len()],
            },
        })
    }
}

struct Resampling {
    spec: Resample,
    known: Periods,
}

/// The state of resampling: the period that is open.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Periods {
    every: Duration,
    /// The end of the open period.
    end: Instant,
    channels: Vec<Period>,
}

/// What the open period holds of one channel.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Period {
    count: f64,
    mean: f64,
    last: f64,
    stamp: Instant,
}

impl Period {
    const EMPTY: Period = Period {
        count: 0.0,
        mean: 0.0,
        last: 0.0,
        stamp: Instant::MIN,
    };
}

impl Periods {
    /// The end of the period that an instant belongs to.
    fn end_of(&self, now: Instant) -> Instant {
        let every = self.every.as_ns().max(1);
        let whole = now.as_ns().div_euclid(every) * every;
        let end = Instant::from_ns(whole);
        if end == now { end } else { end + self.every }
    }
}

impl Resampling {
    fn close(&mut self, outputs: &mut Outputs<'_>, in_time: bool) {
        for (i, period) in self.known.channels.iter_mut().enumerate() {
            if period.count > 0.0 && in_time {
                let value = match self.spec.method {
                    ResampleMethod::Mean => period.mean,
                    ResampleMethod::Last => period.last,
                };
                outputs.set_stamped(i, value, period.stamp);
            } else {
                outputs.set(i, ABSENT);
            }
            *period = Period::EMPTY;
        }
    }
}

impl Operator for Resampling {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let end = self.known.end_of(tick.now);
        let is_open = self.known.end != Instant::MIN;
        if is_open && self.known.end < end {
            let late = tick.now - self.known.end;
            let in_time = late < self.spec.every && late <= self.spec.late();
            self.close(outputs, in_time);
        }
        self.known.end = end;
        let inputs = tick.port(0).iter().zip(tick.stamps(0));
        for (period, (&value, &stamp)) in self.known.channels.iter_mut().zip(inputs) {
            if value.is_finite() {
                period.count += 1.0;
                period.mean += (value - period.mean) / period.count;
                (period.last, period.stamp) = (value, stamp);
            }
        }
        if end == tick.now {
            self.close(outputs, true);
            self.known.end = end + self.known.every;
        }
    }

    fn segment(&mut self) {
        self.known.end = Instant::MIN;
        self.known.channels.fill(Period::EMPTY);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: Periods| {
            if state.channels.len() != self.known.channels.len() {
                return Err("the number of channels differs");
            }
            if state.every != self.known.every {
                return Err("the length of the periods differs");
            }
            self.known = state;
            Ok(())
        })
    }
}

athermal_core::state!(Periods, "resample/1");
athermal_core::register!(Resample, Feature, "resample");
