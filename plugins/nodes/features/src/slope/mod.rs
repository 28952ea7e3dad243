//! Least-squares slopes over trailing windows: the thermal features, and the drift itself.

pub mod kernel;

use std::ops::Range;

use athermal_core::channel::{ABSENT, COLD, Channel};
use athermal_core::node::{
    Duty, Feature, InputPort, Inputs, Kept, KindFacts, Mistake, Operator, OutputPort, Outputs,
    Pace, PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use kernel::{Coverage, NoValue, RollingSlope};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::windows::{Cold, Windows};
use crate::windows::{half, over, three};

/// The slope of the least-squares line through the samples of each channel in trailing windows.
///
/// `Σ(x − x̄)(y − ȳ) / Σ(x − x̄)²` over the samples with time in `(t − T, t]`; times need not be regular. With
/// several windows per temperature these are the dynamic-range features of Mandelli, Dankwart and Napoli, section
/// 3.2; of a position it is the drift. Three ports say more of each line. `stderr` is the standard error of its
/// slope, from its own residuals (Draper and Smith 1998, section 1.4). `value` is its value at the end of the window,
/// a smoothed sample that lags nothing behind a steady ramp. `r2` is its coefficient of determination, the share of
/// the variance that it explains.
///
/// A value exists once the window reaches back no further than the channel's first value, holds `min_samples` samples and
/// these span `min_coverage` of it. Where times jitter, half a sample's period more than a whole number of periods keeps the oldest
/// sample from falling now into the window and now out of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slope {
    /// The lengths of the windows, such as `["150s", "5min"]`, or a dynamic range of them.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub windows: Windows,
    /// The unit of the slopes, such as `mK/min` of a temperature. Without it, that of differences of the input per minute: of Cel
    /// and K it is K/min, of \[degF\] \[degR\]/min.
    #[serde(default)]
    pub unit: Option<Unit>,
    /// The fewest samples in a window, 2 or more.
    #[serde(default = "three")]
    #[schemars(range(min = 2))]
    pub min_samples: usize,
    /// The share of the window that its samples must span, 0 to below 1: `n` regular samples a window span `1 − 1/n` of it.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0), extend("exclusiveMaximum" = 1.0))]
    pub min_coverage: f64,
    /// Whether a window that reaches back before the channel's first value has a value.
    #[serde(default)]
    pub cold: Cold,
}

impl Slope {
    /// The unit of the slopes of a channel: as stated, or per minute.
    fn unit(&self, of: &Channel) -> Option<Unit> {
        match &self.unit {
            Some(unit) => Some(unit.clone()),
            None => Some(of.unit.difference().per(&Unit::parse("min").ok()?)),
        }
    }

    /// What a slope per second of the channel is multiplied by.
    fn factor(&self, of: &Channel) -> Option<f64> {
        of.unit
            .difference()
            .per(&Unit::second())
            .factor_to(&self.unit(of)?)
    }

    /// A unit in which the slope of a channel cannot be.
    fn unit_mistake(&self, channel: &Channel) -> Option<Mistake> {
        if self.factor(channel).is_some() {
            return None;
        }
        let unit = self
            .unit
            .as_ref()
            .map_or_else(String::new, ToString::to_string);
        let natural = channel.unit.difference().per(&Unit::second());
        let message = format!(
            "the slope of `{}` ({}) cannot be in {unit}",
            channel.name, channel.unit
        );
        let help = channel
            .unit
            .scale_meant()
            .map_or_else(|| format!("a unit such as {natural}"), str::to_owned);
        Some(Mistake::at("unit", message).help(help))
    }
}

impl Feature for Slope {
    fn facts() -> KindFacts {
        KindFacts::of(Duty::Slope).change().pace(Pace::ByChannel)
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what the slope is taken of")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("slope", "the slope of the line"),
                PortSummary::new(
                    "stderr",
                    "the standard error of that, from its own residuals",
                ),
                PortSummary::new("value", "the value of the line at the end of the window"),
                PortSummary::new(
                    "r2",
                    "its coefficient of determination: the share of the variance that it explains",
                ),
            ]
        }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        self.windows.mistakes()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        if let Some(mistake) = from.iter().find_map(|channel| self.unit_mistake(channel)) {
            return Err(vec![mistake]);
        }
        let windows = self.windows.lengths().map_err(|mistake| vec![mistake])?;
        let values = over(from, &windows);
        let slope = |channel: &Channel| Channel {
            unit: self.unit(channel).unwrap_or_else(|| channel.unit.clone()),
            ..channel.clone()
        };
        let share = |channel: &Channel| Channel {
            unit: Unit::one(),
            ..channel.clone()
        };
        let slopes: Vec<Channel> = values.iter().map(slope).collect();
        let shares = values.iter().map(share).collect();
        let port = |name, channels| OutputPort { name, channels };
        Ok(vec![
            port("slope", slopes.clone()),
            port("stderr", slopes),
            port("value", values),
            port("r2", shares),
        ])
    }

    fn memory(&self) -> Duration {
        let lengths = self.windows.lengths().unwrap_or_default();
        lengths.into_iter().max().unwrap_or(Duration::ZERO)
    }

    fn keeps(&self, inputs: &Inputs, wanted: &[bool], every: Duration) -> Vec<Kept> {
        let windows = self.windows.lengths().unwrap_or_default();
        let channels = inputs.port("signal").len();
        let squares = wanted.iter().skip(1).any(|wanted| *wanted);
        kernel::keeps(&windows, channels, squares, every)
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let from = inputs.port("signal");
        let windows = self.windows.lengths().unwrap_or_default();
        let lengths: Vec<i64> = windows.iter().map(|window| window.as_ns()).collect();
        let coverage = Coverage {
            min_samples: self.min_samples,
            min_coverage: self.min_coverage,
            cold_partial: self.cold == Cold::Partial,
        };
        let tells = [1, 2, 3].map(|port| wanted.get(port).copied().unwrap_or(false));
        let squares = tells.contains(&true);
        let width = from.len() * windows.len();
        Box::new(Sloping {
            lengths: lengths.clone(),
            coverage,
            kernel: RollingSlope::new(
                &lengths,
                from.len(),
                coverage,
                NoValue {
                    absent: ABSENT,
                    cold: COLD,
                },
                squares,
            ),
            factors: from
                .iter()
                .flat_map(|channel| {
                    std::iter::repeat_n(self.factor(channel).unwrap_or(f64::NAN), windows.len())
                })
                .collect(),
            windows: windows.len(),
            tells,
            results: vec![ABSENT; width],
        })
    }
}

/// Running slopes.
struct Sloping {
    kernel: RollingSlope,
    /// What the kernel was made for; a state of another kernel is of no use.
    lengths: Vec<i64>,
    coverage: Coverage,
    /// What each slope per second is multiplied by.
    factors: Vec<f64>,
    windows: usize,
    /// Whether somebody reads the standard errors, the values at the end, the coefficients of determination.
    tells: [bool; 3],
    results: Vec<f64>,
}

impl Sloping {
    /// Gives the results of the channels that have a new sample; the others keep what they had. `scaled` says whether they are per
    /// second of the channel and still have to be brought to the unit of the slopes.
    fn give(&self, tick: &Tick<'_>, outputs: &mut Outputs<'_>, port: usize, scaled: bool) {
        let first = port * self.results.len();
        let mut give = |results: Range<usize>| {
            let given = first + results.start..first + results.end;
            let given = outputs.fill_stamped(given, tick.now);
            given.copy_from_slice(&self.results[results.clone()]);
            if scaled {
                scale(given, &self.factors[results]);
            }
        };
        let samples = tick.port(0);
        if samples.iter().all(|sample| !sample.is_nan()) {
            return give(0..self.results.len());
        }
        for (channel, sample) in samples.iter().enumerate() {
            if !sample.is_nan() {
                give(channel * self.windows..(channel + 1) * self.windows);
            }
        }
    }
}

/// Multiplies values by factors. A NaN says why there is no value, and must stay as it is.
fn scale(values: &mut [f64], factors: &[f64]) {
    for (value, factor) in values.iter_mut().zip(factors) {
        let scaled = *value * factor;
        *value = if value.is_nan() { *value } else { scaled };
    }
}

impl Operator for Sloping {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        self.kernel.push(tick.now.as_ns(), tick.port(0));
        self.kernel.slopes(&mut self.results);
        self.give(tick, outputs, 0, true);
        let [errors, values, shares] = self.tells;
        if errors {
            self.kernel.stderr(&mut self.results);
            self.give(tick, outputs, 1, true);
        }
        if values {
            self.kernel.ends(&mut self.results);
            self.give(tick, outputs, 2, false);
        }
        if shares {
            self.kernel.r_squared(&mut self.results);
            self.give(tick, outputs, 3, false);
        }
    }

    fn segment(&mut self) {
        self.kernel.reset();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Windowed {
            lengths: self.lengths.clone(),
            coverage: self.coverage,
            errors: self.tells.contains(&true),
            kernel: self.kernel.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let state = match state.known::<Windowed>() {
            Ok(state) => state,
            Err(cold) => return cold,
        };
        if state.kernel.channels() != self.kernel.channels() {
            return Restored::cold("the number of channels differs");
        }
        if (&state.lengths, state.coverage, state.errors)
            != (&self.lengths, self.coverage, self.tells.contains(&true))
        {
            return Restored::cold("the windows or what they must hold differ");
        }
        self.kernel = state.kernel;
        Restored::Accepted
    }
}

/// The state of slopes: the kernel, and what it was made for.
#[derive(Debug, Serialize, Deserialize)]
struct Windowed {
    lengths: Vec<i64>,
    coverage: Coverage,
    /// Whether the kernel keeps squares.
    errors: bool,
    kernel: RollingSlope,
}

athermal_core::state!(Windowed, "slope/1");

athermal_core::register!(Slope, Feature, "slope");
