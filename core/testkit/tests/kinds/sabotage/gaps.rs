//! A feature that bridges gaps and is sound, and the same with one fault at a time.

use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Reach, Restored, State,
    Tick,
};
use athermal_core::time::Instant;
use athermal_testkit::{Case, Rule};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{breaks, breaks_only};

/// Each channel, and where that has no value its last one, as old as it is.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Bridge {
    /// What is wrong with it; nothing by default.
    #[serde(default)]
    #[schemars(with = "String")]
    fault: Fault,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Fault {
    #[default]
    None,
    /// Gives the last value as if it were of now.
    Now,
    /// As old as what other channels have.
    Others,
    /// Gives zero.
    Zero,
}

impl Feature for Bridge {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "bridged";
        Ok(vec![OutputPort { name, channels }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn is_endless(&self) -> bool {
        true
    }

    fn build(&self, inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Bridging {
            fault: self.fault,
            last: vec![None; inputs.port("signal").len()],
        })
    }
}

struct Bridging {
    fault: Fault,
    last: Vec<Option<(f64, Instant)>>,
}

impl Operator for Bridging {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let samples = tick.port(0).iter().zip(tick.stamps(0)).enumerate();
        for (i, (&value, &stamp)) in samples {
            if value.is_finite() {
                self.last[i] = Some((value, stamp));
                outputs.set_stamped(i, value, stamp);
            } else if let Some((last, stamp)) = self.last[i] {
                match self.fault {
                    Fault::None => outputs.set_stamped(i, last, stamp),
                    Fault::Now => outputs.set_stamped(i, last, tick.now),
                    Fault::Others => outputs.set(i, last),
                    Fault::Zero => outputs.set_stamped(i, 0.0, tick.now),
                }
            }
        }
    }

    fn segment(&mut self) {
        self.last.fill(None);
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        let last = self.last.clone();
        Some(Box::new(Known { last }))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        match state.known::<Known>() {
            Ok(known) if known.last.len() == self.last.len() => {
                self.last = known.last;
                Restored::Accepted
            }
            Ok(_) => Restored::cold("the number of channels differs"),
            Err(cold) => cold,
        }
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Known {
    last: Vec<Option<(f64, Instant)>>,
}

athermal_core::state!(Known, "sabotaged_gaps/1");
athermal_core::register!(Bridge, Feature, "sabotaged_gaps");

fn with(fault: &str) -> Case {
    Case::new(format!("fault = \"{fault}\""))
}

#[test]
fn a_gap_may_be_bridged_by_a_value_that_is_as_old_as_it_is() {
    breaks_only::<Bridge>(with("none"), &[]);
}

#[test]
fn what_bridges_a_gap_as_if_it_were_new_is_found() {
    for fault in ["now", "others", "zero"] {
        breaks_only::<Bridge>(with(fault), &[Rule::Stamps]);
        breaks::<Bridge>(
            with(fault),
            Rule::Stamps,
            "is made of has been measured after",
        );
    }
}
