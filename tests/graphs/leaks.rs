//! What sees the future is told, along which way it does, and which lag would not.

use crate::workbench::Read;
use athermal::core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, Tick,
};
use athermal::core::time::Duration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const HEAD: &str = "schema = 1\n\
    [signals.position]\nunit = \"nm\"\nchannels = [\"X\", \"Y\"]\nmax_age = \"3min\"\n\
    [signals.temperature]\nunit = \"Cel\"\nchannels = [\"room\"]\nmax_age = \"1min\"\n\
    [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"5min\"]\n";

/// Message and help of every mistake but those of what is unused.
fn told(nodes: &str) -> Vec<(String, String)> {
    let read = Read::new(&format!("{HEAD}{nodes}"));
    let errors = read
        .diagnostics
        .iter()
        .filter(|found| !matches!(found.code, "A059" | "A060"));
    errors
        .map(|found| {
            assert_eq!(found.code, "A052", "{}", read.told());
            (
                found.message.clone(),
                found.help.clone().unwrap_or_default(),
            )
        })
        .collect()
}

/// A linear estimator of the drift of X on one feature.
fn estimator(feature: &str, ahead: &str) -> String {
    format!(
        "[nodes.linear]\ntype = \"linear\"\ninputs.features = \"{feature}\"\ninputs.truth = \"drift.X\"\nahead = \"{ahead}\"\n\
         [outputs]\npredicted = \"linear\"\n"
    )
}

const TRUTH: &str = "the truth summarises 5min and is predicted";

#[test]
fn a_derived_feature_leaks_as_its_signal_does() {
    let pick = "[nodes.fast]\ntype = \"slope\"\ninputs.signal = \"position.X\"\nwindows = [\"1min\"]\n\
        [nodes.some]\ntype = \"pick\"\ninputs.signal = [\"temperature\", \"fast\"]\n";
    let leak = told(&format!("{pick}{}", estimator("some", "2min")));
    assert_eq!(
        leak,
        [(
            "`some.X` contains part of the answer: it overlaps the value of `drift.X` that is predicted".to_owned(),
            format!(
                "it is made of what the truth is made of: `some.X` from `fast.X` from `position.X`; {TRUTH} 2min ahead, \
                 so the smallest lag allowed is 3min (here it is 0s)"
            )
        )]
    );
    assert_eq!(told(&format!("{pick}{}", estimator("some", "5min"))), []);
}

#[test]
fn another_axis_and_a_temperature_do_not_leak() {
    assert_eq!(told(&estimator("drift.Y", "0s")), []);
    assert_eq!(told(&estimator("temperature", "0s")), []);
}

#[test]
fn delays_along_the_way_add_up() {
    let late = |first: &str, second: &str| {
        format!(
            "[nodes.a]\ntype = \"delay\"\ninputs.signal = \"drift.X\"\ndelay = \"{first}\"\n\
             [nodes.b]\ntype = \"delay\"\ninputs.signal = \"a\"\ndelay = \"{second}\"\n{}",
            estimator("b", "0s")
        )
    };
    assert_eq!(told(&late("2min", "3min")), []);
    let leak = told(&late("2min", "150s"));
    assert_eq!(
        leak[0].1,
        format!(
            "it is made of what the truth is made of: `b.X` from `a.X` from `drift.X` from `position.X`; {TRUTH} 0s ahead, \
             so the smallest lag allowed is 5min (here it is 4m30s)"
        )
        .replace("4m30s", "270s")
    );
}

#[test]
fn the_shortest_of_two_ways_counts() {
    let nodes = "[nodes.late]\ntype = \"delay\"\ninputs.signal = \"drift.X\"\ndelay = \"1h\"\n\
        [nodes.both]\ntype = \"pick\"\ninputs.signal = [\"late\", \"drift.X\"]\nnames = [\"late\", \"now\"]\n";
    assert_eq!(
        told(&format!("{nodes}{}", estimator("both.late", "0s"))),
        []
    );
    let leak = told(&format!("{nodes}{}", estimator("both", "0s")));
    assert!(leak[0].0.starts_with("`both.now` "), "{}", leak[0].0);
}

#[test]
fn feedback_brings_the_truth_back_too() {
    // The loop is closed before what it brings back is known.
    let nodes = "[nodes.back]\ntype = \"delay\"\ninputs.signal = \"sum.now\"\ndelay = \"1min\"\nunit = \"nm/min\"\n\
        [nodes.sum]\ntype = \"pick\"\ninputs.signal = [\"drift.X\", \"back\"]\nnames = [\"now\", \"before\"]\n";
    let held = "{ from = \"back\", max_age = \"1min\" }";
    let held = |ahead: &str| estimator("back", ahead).replace("\"back\"", held);
    let leak = told(&format!("{nodes}{}", held("0s")));
    assert_eq!(leak.len(), 1);
    assert!(
        leak[0]
            .1
            .contains("`back.value` from `sum.now` from `drift.X` from `position.X`")
            && leak[0].1.ends_with("(here it is 1min)"),
        "{}",
        leak[0].1
    );
    assert_eq!(told(&format!("{nodes}{}", held("4min"))), []);
}

#[test]
fn a_module_hides_nothing() {
    let nodes = "[modules.m]\ninputs = [\"signal\"]\noutputs.slope = \"s\"\n\
        nodes.s = { type = \"slope\", inputs.signal = \"{signal}\", windows = [\"1min\"] }\n\
        [nodes.inner]\nmodule = \"m\"\ninputs.signal = \"position\"\n";
    let leak = told(&format!("{nodes}{}", estimator("inner", "0s")));
    assert!(
        leak[0].1.contains("`inner/s.X` from `position.X`"),
        "{}",
        leak[0].1
    );
}

#[test]
fn a_lag_of_the_truth_leaks_until_its_window_is_past() {
    let ar = |lag: &str| {
        format!(
            "[nodes.ar]\ntype = \"ar\"\ninputs.truth = \"drift.X\"\nahead = \"2min\"\nlags = [\"{lag}\", \"1h\"]\n[outputs]\npredicted = \"ar\"\n"
        )
    };
    assert_eq!(told(&ar("3min")), []);
    assert_eq!(
        told(&ar("179s"))[0].1,
        format!("{TRUTH} 2min ahead, so the smallest lag allowed is 3min (here it is 179s)")
    );
}

/// Gives two channels, each made of the other one's input, and says nothing about it.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Crossed {}

impl Feature for Crossed {
    fn inputs() -> &'static [InputPort] {
        const { &[InputPort::fresh("signal", "two channels")] }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let channels = inputs.port("signal").to_vec();
        let name = "crossed";
        Ok(vec![OutputPort { name, channels }])
    }

    fn build(&self, _inputs: &Inputs, _wanted: &[bool]) -> Box<dyn Operator> {
        Box::new(Crossing)
    }
}

struct Crossing;

impl Operator for Crossing {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        outputs.set(0, tick.port(0)[1]);
        outputs.set(1, tick.port(0)[0]);
    }

    fn segment(&mut self) {}
}

athermal::core::register!(Crossed, Feature, "test_crossed");

#[test]
fn a_kind_that_mixes_as_many_channels_as_it_reads_hides_nothing() {
    let crossed = "[nodes.crossed]\ntype = \"test_crossed\"\ninputs.signal = \"position\"\n";
    for channel in ["crossed.X", "crossed.Y"] {
        let leak = told(&format!("{crossed}{}", estimator(channel, "0s")));
        assert!(leak[0].1.contains("from `position.X`"), "{}", leak[0].1);
    }
}

/// Passes its input on as if each value were one of an instant.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Instantaneous {}

impl Feature for Instantaneous {
    fn inputs() -> &'static [InputPort] {
        Crossed::inputs()
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let mut ports = Crossed {}.outputs(inputs)?;
        for channel in &mut ports[0].channels {
            channel.span = Duration::ZERO;
        }
        Ok(ports)
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        Crossed {}.build(inputs, wanted)
    }
}

athermal::core::register!(Instantaneous, Feature, "test_instantaneous");

#[test]
fn a_truth_is_held_to_the_span_of_what_it_is_made_of_though_its_kind_forgets_it() {
    let ar = |lag: &str| {
        format!(
            "[nodes.bare]\ntype = \"test_instantaneous\"\ninputs.signal = \"drift\"\n\
             [nodes.ar]\ntype = \"ar\"\ninputs.truth = \"bare.X\"\nahead = \"0s\"\nlags = [\"{lag}\"]\n\
             [outputs]\npredicted = \"ar\"\n"
        )
    };
    assert_eq!(told(&ar("1min")).len(), 1);
    assert_eq!(told(&ar("5min")), []);
}

#[test]
fn a_kind_that_keeps_channels_apart_denies_none_for_another() {
    let apart =
        "[nodes.apart]\ntype = \"hampel\"\ninputs.signal = \"position\"\nwindow = \"1min\"\n";
    assert_eq!(told(&format!("{apart}{}", estimator("apart.Y", "0s"))), []);
    assert_eq!(
        told(&format!("{apart}{}", estimator("apart.X", "0s"))).len(),
        1
    );
}

#[test]
fn the_instants_of_a_truth_give_nothing_away_and_its_values_do() {
    let sampled = |signal: &str, instants: &str| {
        format!(
            "[nodes.sampled]\ntype = \"sample_at\"\ninputs.signal = \"{signal}\"\ninputs.instants = \"{instants}\"\n{}",
            estimator("sampled", "0s")
        )
    };
    assert_eq!(told(&sampled("position.Y", "position.X")), []);
    let leak = told(&sampled("position.X", "position.Y"));
    assert!(leak[0].1.contains("from `position.X`"), "{}", leak[0].1);
}

#[test]
fn looking_back_over_a_window_delays_nothing() {
    let nodes = [
        "type = \"moving\"\nwindows = [\"1h\"]",
        "type = \"difference\"\nover = \"1h\"",
        "type = \"resample\"\nevery = \"1min\"",
        "type = \"hampel\"\nwindow = \"1h\"\nreplace = \"median\"",
    ];
    for node in nodes {
        let node = format!("[nodes.n]\n{node}\ninputs.signal = \"drift.X\"\n");
        let leak = told(&format!("{node}{}", estimator("n.X", "0s")));
        assert!(leak[0].1.ends_with("(here it is 0s)"), "{}", leak[0].1);
    }
}

#[test]
fn every_lag_counts_for_itself() {
    let lags =
        "[nodes.past]\ntype = \"lag\"\ninputs.signal = \"drift.X\"\nlags = [\"2min\", \"5min\"]\n";
    assert_eq!(
        told(&format!("{lags}{}", estimator("past.X@5min", "0s"))),
        []
    );
    let leak = told(&format!("{lags}{}", estimator("past", "0s")));
    assert!(leak[0].0.starts_with("`past.X@2min` "), "{}", leak[0].0);
    assert!(leak[0].1.ends_with("(here it is 2min)"), "{}", leak[0].1);
}

#[test]
fn a_truth_made_of_windows_over_windows_keeps_lags_out_of_both() {
    let ar = |lag: &str| {
        format!(
            "[nodes.calm]\ntype = \"moving\"\ninputs.signal = \"drift.X\"\nwindows = [\"4min\"]\n\
             [nodes.ar]\ntype = \"ar\"\ninputs.truth = \"calm.X\"\nahead = \"0s\"\nlags = [\"{lag}\"]\n[outputs]\npredicted = \"ar\"\n"
        )
    };
    assert_eq!(told(&ar("9min")), []);
    assert!(
        told(&ar("8min"))[0]
            .1
            .contains("the smallest lag allowed is 9min")
    );
}

/// The value of a period may come when the next one is nearly over.
#[test]
fn a_truth_of_a_regular_clock_keeps_lags_out_of_all_the_time_that_it_may_reach_back() {
    let graph = |method: &str, lag: &str| {
        format!(
            "[nodes.clock]\ntype = \"resample\"\ninputs.signal = \"position.X\"\nevery = \"5min\"\n{method}\n\
             [nodes.past]\ntype = \"lag\"\ninputs.signal = \"position.X\"\nlags = [\"{lag}\"]\n\
             [nodes.n]\ntype = \"linear\"\ninputs.features = \"past\"\ninputs.truth = \"clock.X\"\nahead = \"0s\"\n\
             [outputs]\npredicted = \"n\"\n"
        )
    };
    for method in ["method = \"mean\"", "method = \"last\""] {
        assert_eq!(told(&graph(method, "10min")), []);
        let leak = told(&graph(method, "9min"));
        let smallest = "the smallest lag allowed is 10min";
        assert!(leak[0].1.contains(smallest), "{}", leak[0].1);
    }
    assert_eq!(told(&graph("late = \"10s\"", "5min10s")), []);
    let leak = told(&graph("late = \"10s\"", "5min"));
    assert!(leak[0].1.contains("allowed is 310s"), "{}", leak[0].1);
}

#[test]
fn a_gate_may_not_go_by_the_state_of_what_its_voters_predict() {
    let gate = |ahead: &str, state: &str| {
        format!(
            "[nodes.state]\ntype = \"stability\"\ninputs.drift = \"drift.X\"\nstable_below = \"30 nm/min\"\ntransient_above = \"80 nm/min\"\n\
             [nodes.before]\ntype = \"delay\"\ninputs.signal = \"state\"\ndelay = \"5min\"\n\
             [nodes.zero]\ntype = \"zero\"\ninputs.truth = \"drift.X\"\nahead = \"{ahead}\"\n\
             [nodes.same]\ntype = \"persistence\"\ninputs.truth = \"drift.X\"\nahead = \"{ahead}\"\n\
             [nodes.gate]\ntype = \"state_gate\"\ninputs.voters = [\"zero\", \"same\"]\ninputs.state = \"{state}\"\n\
             [outputs]\npredicted = \"gate\"\nwhy = \"gate:reason\"\n"
        )
    };
    assert_eq!(told(&gate("5min", "state")), []);
    assert_eq!(told(&gate("0s", "before")), []);
    let leak = told(&gate("0s", "state"));
    assert!(
        leak[0].0.starts_with("`state.X` contains part"),
        "{}",
        leak[0].0
    );
}

#[test]
fn what_is_measured_does_not_vote_on_itself() {
    let vote = |voter: &str, kind: &str| {
        format!(
            "[nodes.ago]\ntype = \"lag\"\ninputs.signal = \"drift.X\"\nlags = [\"1min\", \"5min\"]\n\
             [nodes.linear]\ntype = \"linear\"\ninputs.features = \"temperature\"\ninputs.truth = \"drift.X\"\nahead = \"0s\"\n\
             [nodes.vote]\ntype = \"{kind}\"\ninputs.voters = {voter}\n[outputs]\npredicted = \"vote\"\n"
        )
    };
    for leaking in [r#"["linear", "drift.X"]"#, r#"["linear", "ago.X@1min"]"#] {
        let leak = told(&vote(leaking, "mean"));
        assert_eq!(leak.len(), 1, "{leaking}: {leak:?}");
        assert!(
            leak[0].1.contains("the smallest lag allowed is 5min"),
            "{leak:?}"
        );
    }
    for fine in [r#"["linear", "ago.X@5min"]"#, r#"["linear", "drift.Y"]"#] {
        let leak = told(&vote(fine, "mean"));
        assert!(leak.is_empty(), "{fine}: {leak:?}");
    }
    // What is measured, and a prediction in its place where it is not, is no prediction and is not scored as one.
    let instead = told(&vote(r#"["drift.X", "linear"]"#, "fallback"));
    assert!(instead.is_empty(), "{instead:?}");
}
