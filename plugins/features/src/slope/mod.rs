//! Least-squares slopes over trailing windows: the thermal features, and the drift itself.

pub mod kernel;
mod windows;

use athermal_core::channel::{ABSENT, COLD, Channel};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Restored, State, Tick,
};
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use kernel::{Coverage, NoValue, RollingSlope};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use windows::Windows;

/// The slope of the least-squares line through the samples of each channel in trailing windows.
///
/// `Σ(x − x̄)(y − ȳ) / Σ(x − x̄)²` over the samples with time in `(t − T, t]`; times need not be regular. With several
/// windows per temperature these are the dynamic-range features of Mandelli, Dankwart and Napoli, section 3.2; of a
/// position it is the drift. The port `stderr` gives the standard error of each slope from the residuals of its own line.
///
/// A value exists once the window reaches back no further than the channel's first value, holds `min_samples` samples and
/// these span `min_coverage` of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Slope {
    /// The lengths of the windows, such as `["150s", "5min"]`, or a dynamic range of them.
    pub windows: Windows,
    /// The unit of the slopes; without it, that of the input per minute. Of a temperature it is in kelvin: `mK/min`.
    #[serde(default)]
    pub unit: Option<Unit>,
    /// The fewest samples in a window, 2 or more.
    #[serde(default = "three")]
    #[schemars(range(min = 2))]
    pub min_samples: usize,
    /// The share of the window that its samples must span, 0 to 1.
    #[serde(default = "half")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_coverage: f64,
    /// Whether a window that reaches back before the channel's first value has a value.
    #[serde(default)]
    pub cold: Cold,
}

/// What a window does that reaches back before the first value of its channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Cold {
    /// It has no value.
    #[default]
    Absent,
    /// It makes do with what there is.
    Partial,
}

fn three() -> usize {
    3
}

fn half() -> f64 {
    0.5
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

    fn mistakes(&self, channels: &[Channel], windows: &[Duration]) -> Vec<Mistake> {
        let mut mistakes = Vec::new();
        for channel in channels {
            if self.factor(channel).is_none() {
                let unit = self
                    .unit
                    .as_ref()
                    .map_or_else(String::new, ToString::to_string);
                let natural = channel.unit.difference().per(&Unit::second());
                let message = format!(
                    "the slope of `{}` ({}) cannot be in {unit}",
                    channel.name, channel.unit
                );
                mistakes
                    .push(Mistake::at("unit", message).help(format!("a unit such as {natural}")));
                break;
            }
        }
        if self.min_samples < 2 {
            let message = format!(
                "`min_samples` is {} and must be 2 or more",
                self.min_samples
            );
            mistakes.push(Mistake::at("min_samples", message).help("a slope needs two samples"));
        }
        if !(0.0..=1.0).contains(&self.min_coverage) {
            let message = format!(
                "`min_coverage` is {} and must be from 0 to 1",
                self.min_coverage
            );
            mistakes.push(Mistake::at("min_coverage", message));
        }
        if windows.is_empty() {
            mistakes.push(
                Mistake::at("windows", "there is no window")
                    .help("give one or more, such as [\"5min\"]"),
            );
        }
        for (i, window) in windows.iter().enumerate() {
            let at = format!("windows.{i}");
            if *window <= Duration::ZERO {
                mistakes.push(Mistake::at(
                    at.as_str(),
                    format!("a window of {window} is no window"),
                ));
            }
            if windows[..i].contains(window) {
                mistakes.push(Mistake::at(at, format!("the window {window} stands twice")));
            }
        }
        mistakes
    }
}

impl Feature for Slope {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what the slope is taken of")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        let windows = self.windows.lengths().map_err(|mistake| vec![mistake])?;
        let mistakes = self.mistakes(from, &windows);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let of = |channel: &Channel, window: Duration| Channel {
            name: if windows.len() == 1 {
                channel.name.clone()
            } else {
                format!("{}@{}", channel.name, seconds(window))
            },
            unit: self.unit(channel).unwrap_or_else(|| channel.unit.clone()),
            span: window,
            ..channel.clone()
        };
        let channels: Vec<Channel> = from
            .iter()
            .flat_map(|channel| windows.iter().map(move |&window| of(channel, window)))
            .collect();
        Ok(vec![
            OutputPort {
                name: "slope",
                channels: channels.clone(),
            },
            OutputPort {
                name: "stderr",
                channels,
            },
        ])
    }

    fn memory(&self) -> Duration {
        let lengths = self.windows.lengths().unwrap_or_default();
        lengths.into_iter().max().unwrap_or(Duration::ZERO)
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
        let errors = wanted.get(1).copied().unwrap_or(false);
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
                errors,
            ),
            factors: from
                .iter()
                .map(|channel| self.factor(channel).unwrap_or(f64::NAN))
                .collect(),
            windows: windows.len(),
            errors,
            results: vec![ABSENT; width],
        })
    }
}

/// A window's length in seconds, rounded to the millisecond, in its shortest form.
fn seconds(window: Duration) -> String {
    let milliseconds = (window.as_ns() + 500_000) / 1_000_000;
    format!("{}s", milliseconds as f64 / 1000.0)
}

/// Running slopes.
struct Sloping {
    kernel: RollingSlope,
    /// What the kernel was made for; a state of another kernel is of no use.
    lengths: Vec<i64>,
    coverage: Coverage,
    /// What a slope per second of each channel is multiplied by.
    factors: Vec<f64>,
    windows: usize,
    errors: bool,
    results: Vec<f64>,
}

impl Sloping {
    /// Gives the results of the channels that have a new sample; the others keep what they had.
    fn give(&self, tick: &Tick<'_>, outputs: &mut Outputs<'_>, offset: usize) {
        for (channel, (&sample, &factor)) in tick.port(0).iter().zip(&self.factors).enumerate() {
            if sample.is_nan() {
                continue;
            }
            let windows = channel * self.windows..(channel + 1) * self.windows;
            let slopes = &self.results[windows.clone()];
            let given =
                outputs.fill_stamped(offset + windows.start..offset + windows.end, tick.now);
            for (given, &slope) in given.iter_mut().zip(slopes) {
                // A NaN says why there is no value, and must stay as it is.
                *given = if slope.is_nan() {
                    slope
                } else {
                    slope * factor
                };
            }
        }
    }
}

impl Operator for Sloping {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        self.kernel.push(tick.now.as_ns(), tick.port(0));
        self.kernel.slopes(&mut self.results);
        self.give(tick, outputs, 0);
        if self.errors {
            self.kernel.stderr(&mut self.results);
            self.give(tick, outputs, self.results.len());
        }
    }

    fn segment(&mut self) {
        self.kernel.reset();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Windowed {
            lengths: self.lengths.clone(),
            coverage: self.coverage,
            errors: self.errors,
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
            != (&self.lengths, self.coverage, self.errors)
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
    errors: bool,
    kernel: RollingSlope,
}

athermal_core::state!(Windowed, "slope/1");

athermal_core::register!(Slope, Feature, "slope");
