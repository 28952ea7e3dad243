//! A feature that is sound, and needs many ticks or quick ones to have anything to say.

use super::*;

/// Passes its input on after so many ticks, where the last is not longer ago than that.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Patient {
    /// After how many ticks.
    #[serde(default)]
    after: u64,
    /// How long ago the last tick may be.
    #[schemars(extend("exclusiveMinimum" = 0))]
    within: Duration,
}

impl Feature for Patient {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is passed on")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "signal";
        Ok(vec![OutputPort { name, channels }])
    }

    fn reach(&self, _port: &str) -> Reach {
        Reach::Own
    }

    fn is_endless(&self) -> bool {
        true
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Waiting {
            after: self.after,
            within: self.within,
            known: Known::default(),
        })
    }
}

struct Waiting {
    after: u64,
    within: Duration,
    known: Known,
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Known {
    ticks: u64,
    last: Option<Instant>,
}

impl Operator for Waiting {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let known = &mut self.known;
        let soon = known
            .last
            .is_some_and(|last| tick.now - last <= self.within);
        known.ticks = known.ticks.saturating_add(1);
        known.last = Some(tick.now);
        for (i, &value) in tick.port(0).iter().enumerate() {
            if !value.is_nan() && soon && known.ticks > self.after {
                outputs.set(i, value);
            }
        }
    }

    fn segment(&mut self) {
        self.known = Known::default();
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(Box::new(self.known.clone()))
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        state.replace(&mut self.known)
    }
}

athermal_core::state!(Known, "sabotaged_pace/1");
athermal_core::register!(Patient, Feature, "sabotaged_pace");

#[test]
fn a_node_that_takes_long_is_given_the_ticks() {
    let case = || Case::new("after = 900\nwithin = \"1min\"");
    breaks::<Patient>(case(), Rule::Answers, "in 600 ticks about 10s apart");
    breaks_only::<Patient>(case().ticks(2400), &[]);
}

#[test]
fn a_node_for_quick_ticks_is_given_such() {
    let case = || Case::new("within = \"1500ms\"");
    breaks::<Patient>(case(), Rule::Answers, "in 600 ticks about 10s apart");
    breaks_only::<Patient>(case().every("1s"), &[]);
    breaks_only::<Patient>(Case::new("within = \"1h\"").every("30min"), &[]);
}

#[test]
#[should_panic(expected = "`fast` is no time from 10 µs to a day, such as \"1s\"")]
fn a_pace_that_is_no_time_is_told() {
    let _ = Case::new("").every("fast");
}
