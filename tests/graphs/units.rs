//! Where a value is given in another unit than it has, and where that is refused.

use crate::workbench::Read;
use athermal::Instant;
use athermal::core::compile::Plan;
use athermal::core::engine::{Engine, Fitted};
use athermal::core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Tick,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Passes on what it reads, which it takes in mK/min.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Gradual {}

impl Feature for Gradual {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("rates", "rates of temperatures").in_unit("mK/min")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("rates").to_vec();
        let name = "rates";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Passing)
    }
}

struct Passing;

impl Operator for Passing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        for (i, &value) in tick.port(0).iter().enumerate() {
            outputs.set(i, value);
        }
    }

    fn segment(&mut self) {}
}

athermal::core::register!(Gradual, Feature, "gradual");

const SIGNALS: &str = "schema = 1\n\
    [signals.rate]\nunit = \"K/s\"\nchannels = [\"a\"]\nmax_age = \"1min\"\n\
    [signals.fine]\nunit = \"mK/min\"\nchannels = [\"a\"]\nmax_age = \"1min\"\n\
    [signals.point]\nunit = \"Cel\"\nchannels = [\"a\"]\nmax_age = \"1min\"\n\
    [signals.difference]\nunit = \"K\"\nchannels = [\"a\"]\nmax_age = \"1min\"\n";

fn compiled(nodes: &str) -> Result<Plan, String> {
    let mut read = Read::new(&format!("{SIGNALS}{nodes}"));
    let plan = read.plan.take();
    let texts = read
        .diagnostics
        .iter()
        .map(|found| format!("{}: {}", found.code, found.message));
    plan.ok_or_else(|| texts.collect::<Vec<_>>().join("\n"))
}

/// What comes out of one tick with a value for each signal.
fn stepped(nodes: &str, samples: [f64; 4]) -> Vec<f64> {
    let plan = compiled(nodes).unwrap_or_else(|errors| panic!("{errors}"));
    let mut engine = Engine::new(plan.into(), &Fitted::new()).unwrap();
    let outputs = engine.step(Instant::from_ns(0), &samples).unwrap();
    outputs.to_vec()
}

const GRADUAL: &str = "[nodes.n]\ntype = \"gradual\"\ninputs.rates = [\"rate\", \"fine\"]\nNAMES[outputs]\nx = \"n\"\n";

#[test]
fn a_port_is_given_its_channels_in_its_own_unit() {
    // The channels of a pick keep their units; the port's are converted one by one.
    let nodes = "[nodes.both]\ntype = \"pick\"\ninputs.signal = [\"rate\", \"fine\"]\nnames = [\"coarse\", \"fine\"]\n\
        [nodes.n]\ntype = \"gradual\"\ninputs.rates = \"both\"\n[outputs]\nx = \"n\"\n";
    let per_second_in_milli_per_minute = 1000.0 * 60.0;
    assert_eq!(
        stepped(nodes, [0.002, 7.25, 20.0, 1.0]),
        [0.002 * per_second_in_milli_per_minute, 7.25]
    );
    let plan = compiled(nodes).unwrap();
    assert_eq!(
        plan.gathers
            .iter()
            .map(|gather| gather.conversions.len())
            .max(),
        Some(1)
    );
    assert_eq!(
        plan.channels[plan.outputs[0].slot].channel.unit.to_string(),
        "mK/min"
    );
}

#[test]
fn no_value_stays_what_it_is() {
    let nodes = GRADUAL
        .replace("[\"rate\", \"fine\"]", "\"rate\"")
        .replace("NAMES", "");
    assert!(stepped(&nodes, [f64::NAN, 1.0, 1.0, 1.0])[0].is_nan());
}

#[test]
fn what_is_no_rate_of_a_temperature_is_refused() {
    let nodes = GRADUAL
        .replace("[\"rate\", \"fine\"]", "\"difference\"")
        .replace("NAMES", "");
    assert_eq!(
        compiled(&nodes).unwrap_err(),
        "A048: `inputs.rates` is in mK/min and `difference.a` in K"
    );
}

#[test]
fn votes_are_given_in_the_unit_of_the_truth() {
    let vote = |truth: &str| {
        format!(
            "[nodes.a]\ntype = \"zero\"\ninputs.truth = \"rate\"\nahead = \"1min\"\n\
             [nodes.b]\ntype = \"zero\"\ninputs.truth = \"fine\"\nahead = \"1min\"\n\
             [nodes.vote]\ntype = \"auto_weighted\"\ninputs.voters = [\"a\", \"b\"]\ninputs.truth = \"{truth}\"\nmemory = \"5min\"\n\
             [outputs]\nx = \"vote\"\n"
        )
    };
    for (truth, unit, entry) in [("rate", "K/s", 1), ("fine", "mK/min", 0)] {
        let plan = compiled(&vote(truth)).unwrap();
        assert_eq!(
            plan.channels[plan.outputs[0].slot].channel.unit.to_string(),
            unit
        );
        let all: Vec<_> = plan
            .gathers
            .iter()
            .flat_map(|gather| &gather.conversions)
            .collect();
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].entry, entry);
    }
}

#[test]
fn a_point_is_never_taken_for_a_difference() {
    let nodes = "[nodes.a]\ntype = \"zero\"\ninputs.truth = \"point\"\nahead = \"1min\"\n\
        [nodes.b]\ntype = \"zero\"\ninputs.truth = \"difference\"\nahead = \"1min\"\n\
        [nodes.vote]\ntype = \"mean\"\ninputs.voters = [\"a\", \"b\"]\n[outputs]\nx = \"vote\"\n";
    assert_eq!(
        compiled(nodes).unwrap_err(),
        "A063: `b.a` is a difference of temperatures (K), and `a.a` a temperature (Cel)"
    );
}

#[test]
fn weights_of_temperatures_make_a_temperature_or_a_difference_and_nothing_else() {
    let sum = |weights: &str, signal: &str| {
        format!(
            "[nodes.n]\ntype = \"sum\"\ninputs.signal = {signal}\n{weights}\n[outputs]\nx = \"n\"\n"
        )
    };
    let both = "[\"point\", \"warmer\"]";
    let warmer = "[nodes.warmer]\ntype = \"scale\"\ninputs.signal = \"point\"\noffset = \"10 K\"\n";
    let samples = [1.0, 1.0, 20.0, 1.0];
    for (weights, value, unit) in [
        ("weights = [0.25, 0.75]", 27.5, "Cel"),
        ("weights = [-1.0, 1.0]", 10.0, "K"),
    ] {
        let nodes = format!("{warmer}{}", sum(weights, both));
        assert_eq!(stepped(&nodes, samples), [value]);
        let plan = compiled(&nodes).unwrap();
        let found = plan.channels[plan.outputs[0].slot].channel.unit.to_string();
        assert_eq!(found, unit);
    }
    for (weights, total) in [("", 2.0), ("weights = [1.0, 0.5]", 1.5)] {
        assert_eq!(
            compiled(&format!("{warmer}{}", sum(weights, both))).unwrap_err(),
            format!(
                "A054: weights of temperatures in Cel add up to {total}, which makes neither a temperature nor a difference"
            )
        );
    }
    // From the absolute zero, 20 Cel and as much again are what they are.
    let kelvin = "[nodes.absolute]\ntype = \"scale\"\ninputs.signal = \"point\"\nunit = \"K\"\n";
    let nodes = format!("{kelvin}{}", sum("", "[\"absolute\", \"difference\"]"));
    assert_eq!(stepped(&nodes, samples), [20.0 + 273.15 + 1.0]);
}
