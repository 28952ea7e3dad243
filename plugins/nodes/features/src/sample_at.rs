//! Samples taken when another channel is measured.

use athermal_core::node::{
    Feature, InputPort, Inputs, KindFacts, Mistake, Operator, OutputPort, Outputs, Pace,
    PortSummary, Reach, Tick,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Each channel as it is at the instants at which another one is measured.
///
/// `y(t_k) = x(t_k)`: with every new value under `instants` it gives the last value of each channel, unless that is too
/// old. What is measured at irregular instants thus meets temperatures of the same instants. A line through four
/// positions follows other instants than one through thirty temperatures in the same window, and the difference looks
/// like drift.
///
/// Only the instants count, not what was measured at them, so that the positions of an axis may say when without giving their
/// drift away.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleAt {}

impl Feature for SampleAt {
    fn facts() -> KindFacts {
        KindFacts::default().pace(Pace::BySecond)
    }

    fn inputs() -> &'static [InputPort] {
        const {
            &[
                InputPort::held("signal", "what is sampled"),
                InputPort::fresh("instants", "the channels whose new values say when"),
            ]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("signal", "each channel at those instants")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        Ok(vec![OutputPort {
            name: "signal",
            channels: inputs.port("signal").to_vec(),
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::First(1)
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Sampling)
    }
}

struct Sampling;

impl Operator for Sampling {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        if !tick.port(1).iter().any(|value| value.is_finite()) {
            return;
        }
        for (i, (&value, &stamp)) in tick.port(0).iter().zip(tick.stamps(0)).enumerate() {
            outputs.set_stamped(i, value, stamp);
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(SampleAt, Feature, "sample_at");
