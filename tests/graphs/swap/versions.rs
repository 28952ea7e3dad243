//! A node whose state has had three forms: the one before is taken, the oldest is not, which is reported.

use std::cell::Cell;

use athermal::core::engine::{Carry, RestoreError};
use athermal::core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Restored, State, Tick,
};
use athermal::core::state;
use athermal::run::live::{LiveOptions, pair};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::model::{model, s};

/// Counts the samples of its channel.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Count {}

impl Feature for Count {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "what is counted")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        Ok(vec![OutputPort {
            name: "count",
            channels,
        }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Counting(0))
    }
}

struct Counting(u64);

/// How the first program kept it, which nobody can make use of any more.
#[derive(Debug, Serialize, Deserialize)]
struct First {
    seen: bool,
}
state!(First, "test_count/1");

#[derive(Debug, Serialize, Deserialize)]
struct Second {
    count: f64,
}
state!(Second, "test_count/2");

#[derive(Debug, Serialize, Deserialize)]
struct Third {
    count: u64,
}
state!(Third, "test_count/3");

thread_local! {
    /// The form in which states are written: that of an older program, when a test says so.
    static FORM: Cell<u8> = const { Cell::new(3) };
}

impl Operator for Counting {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        self.0 += u64::from(!tick.port(0)[0].is_nan());
        outputs.set(0, self.0 as f64);
    }

    fn segment(&mut self) {
        self.0 = 0;
    }

    fn snapshot(&self) -> Option<Box<dyn State>> {
        Some(match FORM.get() {
            1 => Box::new(First { seen: self.0 > 0 }),
            2 => Box::new(Second {
                count: self.0 as f64,
            }),
            _ => Box::new(Third { count: self.0 }),
        })
    }

    fn restore(&mut self, state: Box<dyn State>) -> Restored {
        let state = match state.into_any().downcast::<Third>() {
            Ok(third) => {
                self.0 = third.count;
                return Restored::Accepted;
            }
            Err(older) => older,
        };
        match state.downcast::<Second>() {
            Ok(second) => {
                self.0 = second.count as u64;
                Restored::Accepted
            }
            Err(_) => Restored::cold("its first form did not say how many there were"),
        }
    }
}

athermal::core::register!(Count, Feature, "test_count");

const GRAPH: &str = "schema = 1\n[time]\ncolumn = \"t\"\n[signals.command]\nunit = \"nm\"\nchannels = [\"x\"]\nmax_age = \"1min\"\n\
    [nodes.count]\ntype = \"test_count\"\ninputs.signal = \"command\"\n\
    [nodes.next]\ntype = \"pick\"\ninputs.signal = \"count\"\n[outputs]\ncount = \"next\"\n";

#[test]
fn a_snapshot_of_the_form_before_goes_on_and_one_of_the_oldest_is_refused() {
    let graph = model(GRAPH, "0");
    let mut old = graph.engine().unwrap();
    for tick in 1..=5 {
        old.step(s(tick), &[0.0]).unwrap();
    }
    let written_in = |form| {
        FORM.set(form);
        let snapshot = old.snapshot();
        FORM.set(3);
        snapshot
    };
    for form in [3, 2] {
        let mut new = graph.engine().unwrap();
        new.restore(&written_in(form)).unwrap();
        assert_eq!(new.step(s(6), &[0.0]).unwrap(), [6.0], "form {form}");
    }
    let mut new = graph.engine().unwrap();
    assert_eq!(
        new.restore(&written_in(1)),
        Err(RestoreError::Refused {
            node: "count".to_owned(),
            reason: "its first form did not say how many there were".to_owned(),
        })
    );
    assert_eq!(new.step(s(6), &[0.0]).unwrap(), [1.0], "it is as it was");
}

#[test]
fn a_swap_takes_the_form_before_and_reports_what_begins_afresh_with_all_that_hangs_on_it() {
    let graph = model(GRAPH, "0");
    let reason = "its first form did not say how many there were".to_owned();
    let behind = Carry::Adopted {
        reason: "`count.x`, which it reads, does not go on as it was".to_owned(),
    };
    // The fifth tick is the one after the swap; the retained past has four.
    for (form, outcome, after, count) in [
        (3, Carry::Carried, Carry::Carried, 5.0),
        (2, Carry::Carried, Carry::Carried, 5.0),
        (1, Carry::Warmed { reason }, behind, 5.0),
    ] {
        let (mut stepper, mut control) = pair(&graph, LiveOptions::default()).unwrap();
        for tick in 1..=4 {
            stepper.step(s(tick), &[0.0]).unwrap();
        }
        control.pump();
        FORM.set(form);
        let carry = control.stage(&graph, false).unwrap().carry().to_vec();
        FORM.set(3);
        assert_eq!(carry[0].outcome, outcome, "form {form}");
        assert_eq!(carry[1].outcome, after, "form {form}");
        control.commit().unwrap();
        assert_eq!(stepper.step(s(5), &[0.0]).unwrap().outputs, [count]);
    }
    // Without a past there is nothing to warm with.
    let (_, mut control) = pair(&graph, LiveOptions::default()).unwrap();
    FORM.set(1);
    let carry = control.stage(&graph, false).unwrap().carry().to_vec();
    FORM.set(3);
    assert!(
        matches!(carry[0].outcome, Carry::Cold { .. }),
        "{:?}",
        carry[0]
    );
}
