//! A feature of athermal: the mean of the last samples of each channel.

use std::collections::VecDeque;

use athermal_core::node::prelude::*;

/// The mean of the last samples of each channel.
///
/// It has a value as soon as there is a sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MyNode {
    /// How many samples the mean is taken of, 1 to 10,000: the compiler checks the range.
    #[schemars(range(min = 1, max = 10_000))]
    pub samples: usize,
}

impl Feature for MyNode {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what the mean is taken of")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        Ok(vec![OutputPort {
            name: "mean",
            channels,
        }])
    }

    fn is_endless(&self) -> bool {
        // So many samples reach back as long as they please. A window in time would be the `span` of the channels instead.
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        let room = || VecDeque::with_capacity(self.samples + 1);
        Box::new(Averaging {
            samples: self.samples,
            last: inputs.port("signal").iter().map(|_| room()).collect(),
        })
    }
}

/// What runs.
struct Averaging {
    samples: usize,
    /// The last samples of each channel.
    last: Vec<VecDeque<f64>>,
}

impl Operator for Averaging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, (&value, last)) in tick.port(0).iter().zip(&mut self.last).enumerate() {
            // NaN is "no value": never take it for zero.
            if value.is_nan() {
                continue;
            }
            last.push_back(value);
            if last.len() > self.samples {
                last.pop_front();
            }
            outputs.set(i, last.iter().sum::<f64>() / last.len() as f64);
        }
    }

    fn segment(&mut self) {
        self.last.iter_mut().for_each(VecDeque::clear);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(LastSamples {
            last: self.last.clone(),
        }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.accept(|state: LastSamples| {
            if state.last.len() != self.last.len() {
                return Err("the number of channels differs");
            }
            for (last, from) in self.last.iter_mut().zip(state.last) {
                last.clear();
                // Into the room that is there, so that no tick has to make any; of too many the newest.
                last.extend(from.iter().skip(from.len().saturating_sub(self.samples)));
            }
            Ok(())
        })
    }
}

/// The state. Give it another name, "my_node/2", when its form changes, and keep this one to be read.
#[derive(Debug, Serialize, Deserialize)]
struct LastSamples {
    last: Vec<VecDeque<f64>>,
}

athermal_core::state!(LastSamples, "my_node/1");
athermal_core::register!(MyNode, Feature, "my_node");

#[cfg(test)]
mod tests {
    use super::*;
    use athermal_testkit::Bench;

    #[test]
    fn the_mean_is_that_of_the_last_samples() {
        let mut bench = Bench::of(&MyNode { samples: 2 }).input("signal", 1, "K");
        bench.feed([(0.0, [1.0]), (10.0, [2.0]), (20.0, [6.0])]);
        assert_eq!(bench.output("node.a"), [1.0, 1.5, 4.0]);
    }

    #[test]
    fn a_gap_gives_nothing_and_spoils_nothing() {
        let mut bench = Bench::of(&MyNode { samples: 2 }).input("signal", 1, "K");
        bench.feed([(0.0, [1.0]), (10.0, [f64::NAN]), (20.0, [3.0])]);
        let outputs = bench.output("node.a");
        assert!(outputs[0] == 1.0 && outputs[1].is_nan() && outputs[2] == 2.0);
    }
}
