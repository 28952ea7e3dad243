//! A bundle of chosen channels under one name.

use athermal_core::channel::is_unchanged;
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Reach, Tick,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Passes channels on as they are, under one node's name: a sensor subset that several nodes read.
///
/// `y = x`. The reference says which channels:
/// `inputs.signal = ["gradients.{plate1,holder1}@*", "gradients.room@*"]`. Values, stamps and absence pass unchanged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pick {
    /// New names for the channels, in order; without it they keep theirs.
    #[serde(default)]
    pub names: Option<Vec<String>>,
}

impl Feature for Pick {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "the channels to pass on")] }
    }

    fn ports() -> &'static [PortSummary] {
        const { &[PortSummary::new("signal", "the channels as they are")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut channels = inputs.port("signal").to_vec();
        if let Some(names) = &self.names {
            if names.len() != channels.len() {
                let message = format!(
                    "`names` has {} names for {} channels",
                    names.len(),
                    channels.len()
                );
                let now: Vec<_> = channels
                    .iter()
                    .map(|channel| channel.name.as_str())
                    .collect();
                return Err(vec![
                    Mistake::at("names", message)
                        .help(format!("the channels are {}", now.join(", "))),
                ]);
            }
            for (channel, name) in channels.iter_mut().zip(names) {
                channel.name.clone_from(name);
            }
        }
        Ok(vec![OutputPort {
            name: "signal",
            channels,
        }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Passing)
    }

    fn every_tick(&self) -> bool {
        // A run of the producer that gave nothing is no new value, and still has to be passed on.
        true
    }
}

struct Passing;

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, (&value, &stamp)) in tick.port(0).iter().zip(tick.stamps(0)).enumerate() {
            if !is_unchanged(value) {
                outputs.set_stamped(i, value, stamp);
            }
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Pick, Feature, "pick");
