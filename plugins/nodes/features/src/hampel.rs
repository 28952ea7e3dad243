//! A filter against spikes.

use std::collections::VecDeque;

use athermal_core::channel::{ABSENT, Channel, is_unchanged};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach,
    Restored, State, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::time::{Duration, Instant};
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::rounding::rounding;
use crate::slope::kernel::LIMIT;
use crate::sorted::Sorted;
use crate::windows::three;

/// Takes out spikes: a sample far from the median of the trailing window is an outlier, and absent.
///
/// It is one where `|x − m| > threshold · S`. `m` is the median of the samples in `(t − window, t]`, the present one
/// among them, and `S = 1.4826 · median |x_i − m|`. `S` is the standard deviation of normal noise, and less than half
/// of the samples cannot move it far (Hampel 1974; Pearson 2002). Outliers stay in the window, so that a step counts
/// as outliers only until half of the samples lie beyond it. The port `outlier` says 1 where a sample was one and 0
/// where it was none; it is absent, and the sample passes, while the window holds fewer than `min_samples`.
///
/// What wanders within the window, as temperatures do, is farthest from the median at its newest end and then looks
/// like a spike. Take a window of some ten samples, and a `floor` of what does no harm. Of the reference machines'
/// bodies, sampled every 10 s, 5 minutes without a floor took out 6 to 9 % of the sound samples. 70 s with a floor of
/// 20 mK took out at most 0.1 %.
///
/// Samples that hardly ever differ make `S` zero, and then any change an outlier: give `floor`, such as one step of a coarse
/// sensor. With `replace = "median"` an outlier becomes the median instead of absent; a value is then made of the whole window,
/// and its span says so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hampel {
    /// How far the window reaches back.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub window: Duration,
    /// How many standard deviations from the median a sample may lie, above 0.
    #[serde(default = "three_deviations")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub threshold: f64,
    /// A distance from the median within which no sample is an outlier: `"5 mK"`; none by default. Of temperatures it is a
    /// difference: as anywhere, `"5 Cel"` stands for 5 K.
    #[serde(default)]
    #[schemars(extend("minimum" = 0))]
    pub floor: Option<Quantity>,
    /// The fewest samples in the window by which one is judged, 3 or more.
    #[serde(default = "three")]
    #[schemars(range(min = 3))]
    pub min_samples: usize,
    /// What becomes of an outlier.
    #[serde(default)]
    pub replace: Replacement,
}

fn three_deviations() -> f64 {
    3.0
}

/// What becomes of an outlier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Replacement {
    /// It is absent.
    #[default]
    Absent,
    /// It becomes the median of the window.
    Median,
}

/// What makes the median absolute deviation of normal noise its standard deviation: `1 / Φ⁻¹(3/4)`.
const TO_DEVIATION: f64 = 1.482_602_218_505_602;

impl Hampel {
    /// The floor in the unit of a channel.
    fn floor(&self, of: &Channel) -> Result<f64, Mistake> {
        let Some(floor) = &self.floor else {
            return Ok(0.0);
        };
        let unit = of.unit.difference();
        floor.as_difference(&unit).ok_or_else(|| {
            let message = format!(
                "`floor` is in {}, and `{}` differs in {unit}",
                floor.unit, of.name
            );
            Mistake::at("floor", message).help(format!("give it in {unit}"))
        })
    }
}

impl Feature for Hampel {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what may have spikes")] }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("signal", "each channel without its outliers"),
                PortSummary::new("outlier", "1 where a sample was one, 0 where it was none"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let from = inputs.port("signal");
        if let Some(mistake) = from.iter().find_map(|channel| self.floor(channel).err()) {
            return Err(vec![mistake]);
        }
        let span = match self.replace {
            Replacement::Absent => Duration::ZERO,
            Replacement::Median => self.window,
        };
        let passed = |channel: &Channel| Channel {
            span: channel.span + span,
            ..channel.clone()
        };
        let judged = |channel: &Channel| Channel {
            unit: Unit::one(),
            ..passed(channel)
        };
        Ok(vec![
            OutputPort {
                name: "signal",
                channels: from.iter().map(passed).collect(),
            },
            OutputPort {
                name: "outlier",
                channels: from.iter().map(judged).collect(),
            },
        ])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn memory(&self) -> Duration {
        self.window
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still ends the hold of the one before.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let channel = |channel: &Channel| Watched {
            floor: self.floor(channel).unwrap_or(ABSENT),
            samples: VecDeque::new(),
            sorted: Sorted::default(),
        };
        Box::new(Judging {
            spec: self.clone(),
            channels: inputs.port("signal").iter().map(channel).collect(),
        })
    }
}

struct Judging {
    spec: Hampel,
    channels: Vec<Watched>,
}

/// The window of one channel.
struct Watched {
    floor: f64,
    samples: VecDeque<(Instant, f64)>,
    sorted: Sorted,
}

impl Watched {
    fn take(&mut self, now: Instant, value: f64, window: Duration) {
        let limit = now - window;
        while let Some(&(at, left)) = self.samples.front()
            && at <= limit
        {
            self.samples.pop_front();
            self.sorted.remove(left);
        }
        self.samples.push_back((now, value));
        self.sorted.insert(value);
    }

    /// Whether the present sample is an outlier, and the median; nothing while there are too few samples.
    fn judge(&self, value: f64, spec: &Hampel) -> Option<(bool, f64)> {
        let median = self.sorted.median();
        let allowed = spec.threshold * TO_DEVIATION * self.sorted.deviation(median);
        let is_outlier = (value - median).abs() > allowed.max(self.floor) + rounding(value, median);
        (self.samples.len() >= spec.min_samples).then_some((is_outlier, median))
    }
}

impl Operator for Judging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let count = self.channels.len();
        let samples = tick.port(0).iter().zip(tick.stamps(0));
        for (i, (channel, (&value, &stamp))) in self.channels.iter_mut().zip(samples).enumerate() {
            if is_unchanged(value) {
                continue;
            }
            let (passed, outlier) = if value.is_nan() {
                (ABSENT, ABSENT)
            } else if value.abs() >= LIMIT {
                (ABSENT, 1.0)
            } else {
                channel.take(tick.now, value, self.spec.window);
                match (channel.judge(value, &self.spec), self.spec.replace) {
                    (None, _) => (value, ABSENT),
                    (Some((false, _)), _) => (value, 0.0),
                    (Some((true, _)), Replacement::Absent) => (ABSENT, 1.0),
                    (Some((true, median)), Replacement::Median) => (median, 1.0),
                }
            };
            outputs.set_stamped(i, passed, stamp);
            outputs.set_stamped(count + i, outlier, stamp);
        }
    }

    fn segment(&mut self) {
        for channel in &mut self.channels {
            channel.samples.clear();
            channel.sorted.clear();
        }
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let samples = |channel: &Watched| channel.samples.clone();
        Some(Box::new(Window {
            window: self.spec.window,
            samples: self.channels.iter().map(samples).collect(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let state = match state.known::<Window>() {
            Ok(state) => state,
            Err(cold) => return cold,
        };
        if state.samples.len() != self.channels.len() {
            return Restored::cold("the number of channels differs");
        }
        if state.window < self.spec.window {
            return Restored::cold("the window was shorter");
        }
        for (channel, samples) in self.channels.iter_mut().zip(state.samples) {
            channel.sorted.clear();
            // Ticks need not come as regularly as they did; the engine thread must not have to make room.
            channel.sorted.reserve(2 * samples.len().max(16));
            samples
                .iter()
                .for_each(|&(_, value)| channel.sorted.insert(value));
            channel.samples = samples;
            channel.samples.reserve(channel.samples.len().max(16));
        }
        Restored::Accepted
    }
}

/// The state of the filter: the samples in the window of each channel.
#[derive(Debug, Serialize, Deserialize)]
struct Window {
    window: Duration,
    samples: Vec<VecDeque<(Instant, f64)>>,
}

athermal_core::state!(Window, "hampel/1");
athermal_core::register!(Hampel, Feature, "hampel");
