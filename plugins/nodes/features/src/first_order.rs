//! First-order lags: the thermal masses between a sensor and what it explains.

use athermal_core::node::{
    Feature, Forms, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, Pace,
    PortSummary, Reach, Restored, State, Tick,
};
use athermal_core::time::{Duration, Instant};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// A bank of first-order lags: each channel as thermal masses of several time constants would follow it.
///
/// `τ ẏ = u − y`, exactly for an input that is constant between samples: `y ← y + (1 − e^(−Δt/τ)) (u_before − y)`
/// (Ljung 1999, section 2.3). With `output = "difference"` it gives `u − y`, which is zero at rest and follows changes: a
/// slope of about one time constant. It starts from the first value of a segment as if it had always been there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FirstOrder {
    /// The time constants: a list, or a logarithmic grid `{ from = "1min", to = "1h", steps = 5 }`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub time_constants: TimeConstants,
    /// What is given: the lagged value, or how far the input is from it.
    #[serde(default)]
    pub output: FirstOrderOutput,
    /// How much of the past one value is taken to summarise, greater than 0. A truth can be made of it only where this
    /// is stated, since a lag forgets nothing entirely. Three time constants leave 5 %, five less than 1 %.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub span: Option<Duration>,
}

/// The time constants of a bank.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum TimeConstants {
    /// These.
    List(#[schemars(length(min = 1))] Vec<Duration>),
    /// Evenly spaced on a logarithmic scale.
    Grid(Grid),
}

/// A logarithmic grid of durations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// The shortest.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub from: Duration,
    /// The longest.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub to: Duration,
    /// How many, both ends counted; 2 to 100.
    #[schemars(range(min = 2, max = 100))]
    pub steps: u32,
}

/// What a first-order lag gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FirstOrderOutput {
    /// The input less the lagged value.
    #[default]
    Difference,
    /// The lagged value.
    Value,
}

impl<'de> Deserialize<'de> for TimeConstants {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Forms::new("a list of durations or a logarithmic grid of them")
            .list(Self::List)
            .table(Self::Grid)
            .read(deserializer)
    }
}

impl TimeConstants {
    /// Them, in order.
    ///
    /// # Errors
    /// When a grid is none, or one stands twice.
    pub fn list(&self) -> Result<Vec<Duration>, Mistake> {
        let list = match self {
            Self::List(list) => list.clone(),
            Self::Grid(grid) => grid.list()?,
        };
        match list
            .iter()
            .enumerate()
            .find(|(i, constant)| list[..*i].contains(constant))
        {
            Some((_, twice)) => {
                let message = format!("the time constant {twice} stands twice");
                Err(Mistake::at("time_constants", message))
            }
            None => Ok(list),
        }
    }
}

impl Grid {
    fn list(&self) -> Result<Vec<Duration>, Mistake> {
        if self.from >= self.to {
            let message = format!("`to` is {} and must be longer than {}", self.to, self.from);
            let help = "a grid goes from a shorter to a longer duration";
            return Err(Mistake::at("time_constants", message).help(help));
        }
        let ratio = self.to.secs() / self.from.secs();
        let last = f64::from(self.steps - 1);
        let constant = |step: u32| {
            Duration::from_secs_f64(self.from.secs() * ratio.powf(f64::from(step) / last))
        };
        (0..self.steps)
            .map(constant)
            .collect::<Option<_>>()
            .ok_or_else(|| Mistake::at("time_constants", "the time constants are too long"))
    }
}

impl Feature for FirstOrder {
    fn facts() -> KindFacts {
        KindFacts::default().pace(Pace::ByChannel)
    }

    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is followed")] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("lagged", "each channel behind each lag")] }
    }

    fn mistakes(&self) -> Vec<Mistake> {
        Vec::from_iter(self.time_constants.list().err())
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let constants = self
            .time_constants
            .list()
            .map_err(|mistake| vec![mistake])?;
        let mut channels = Vec::new();
        for from in inputs.port("signal") {
            for constant in &constants {
                let mut channel = from.clone();
                if constants.len() > 1 {
                    channel.name = format!("{}@{constant}", from.name);
                }
                if self.output == FirstOrderOutput::Difference {
                    channel.unit = from.unit.difference();
                }
                channel.span += self.span.unwrap_or_default();
                channels.push(channel);
            }
        }
        Ok(vec![OutputPort {
            name: "lagged",
            channels,
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let constants = self.time_constants.list().unwrap_or_default();
        Box::new(Following {
            rates: constants
                .iter()
                .map(|constant| 1.0 / constant.secs())
                .collect(),
            output: self.output,
            last: vec![None; inputs.port("signal").len()],
            values: vec![f64::NAN; inputs.port("signal").len() * constants.len()],
        })
    }

    fn is_endless(&self) -> bool {
        self.span.is_none()
    }

    fn memory(&self) -> Duration {
        // After ten time constants less than 5e-5 of the start is left.
        let longest = self
            .time_constants
            .list()
            .unwrap_or_default()
            .into_iter()
            .max();
        longest.map_or(Duration::ZERO, |longest| {
            Duration::from_ns(longest.as_ns().saturating_mul(10))
        })
    }
}

struct Following {
    /// The reciprocals of the time constants, per second.
    rates: Vec<f64>,
    output: FirstOrderOutput,
    /// For each channel the instant and value of its last sample.
    last: Vec<Option<(Instant, f64)>>,
    values: Vec<f64>,
}

impl Operator for Following {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let bank = self.rates.len();
        for (channel, &input) in tick.port(0).iter().enumerate() {
            if input.is_nan() {
                continue;
            }
            let values = &mut self.values[channel * bank..(channel + 1) * bank];
            match self.last[channel] {
                None => values.fill(input),
                Some((at, before)) => {
                    let elapsed = (tick.now - at).secs();
                    for (value, rate) in values.iter_mut().zip(&self.rates) {
                        *value -= libm::expm1(-elapsed * rate) * (before - *value);
                        if !value.is_finite() {
                            *value = input;
                        }
                    }
                }
            }
            self.last[channel] = Some((tick.now, input));
            for (i, &value) in values.iter().enumerate() {
                let given = match self.output {
                    FirstOrderOutput::Difference => input - value,
                    FirstOrderOutput::Value => value,
                };
                outputs.set_stamped(channel * bank + i, given, tick.now);
            }
        }
    }

    fn segment(&mut self) {
        self.last.fill(None);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(Lagged {
            rates: self.rates.clone(),
            last: self.last.clone(),
            values: self.values.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|lagged: Lagged| {
            let fits = lagged.rates == self.rates && lagged.last.len() == self.last.len();
            fits.then(|| (self.last, self.values) = (lagged.last, lagged.values))
                .ok_or("the time constants or channels differ")
        })
    }
}

/// The state of a bank of first-order lags.
#[derive(Debug, Serialize, Deserialize)]
struct Lagged {
    rates: Vec<f64>,
    last: Vec<Option<(Instant, f64)>>,
    values: Vec<f64>,
}

athermal_core::state!(Lagged, "first_order/1");
athermal_core::register!(FirstOrder, Feature, "first_order");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_is_even_on_a_logarithmic_scale() {
        let second = Duration::from_secs_f64(1.0).unwrap();
        let grid = Grid {
            from: second,
            to: Duration::from_secs_f64(100.0).unwrap(),
            steps: 3,
        };
        let list = TimeConstants::Grid(grid).list().unwrap();
        let seconds: Vec<f64> = list.iter().map(|constant| constant.secs()).collect();
        assert_eq!(seconds, [1.0, 10.0, 100.0]);
    }

    #[test]
    fn a_time_constant_twice_is_a_mistake() {
        let minute = Duration::from_secs_f64(60.0).unwrap();
        assert!(TimeConstants::List(vec![minute, minute]).list().is_err());
    }
}
