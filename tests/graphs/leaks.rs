//! What sees the future is reported, along which way it does, and which lag would not.

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
fn leaks(nodes: &str) -> Vec<String> {
    let read = Read::new(&format!("{HEAD}{nodes}"));
    let used = |code: &str| !matches!(code, "A059" | "A060");
    let found = read.diagnostics.iter().filter(|found| used(found.code));
    let text = found.map(|found| {
        assert_eq!(found.code, "A052", "{}", read.told());
        format!("{}; {}", found.message, found.help.as_deref().unwrap_or(""))
    });
    text.collect()
}

#[track_caller]
fn sound(nodes: &str) {
    assert_eq!(leaks(nodes), [] as [&str; 0], "{nodes}");
}

/// Asserts that there is one leak, with these words in its message and its help.
#[track_caller]
fn leak(nodes: &str, words: &[&str]) {
    let found = leaks(nodes);
    let has = |word: &&str| found[0].contains(*word);
    assert!(
        found.len() == 1 && words.iter().all(has),
        "{words:?} in {found:?} of\n{nodes}"
    );
}

/// An estimator of the drift of X.
fn estimating(kind: &str, features: &str, ahead: &str) -> String {
    format!(
        "[nodes.cheat]\ntype = \"{kind}\"\ninputs.features = {features}\ninputs.truth = \"drift.X\"\nahead = \"{ahead}\"\n\
         [outputs]\npredicted = \"cheat\"\n"
    )
}

/// Nodes, and a linear estimator of the drift of X on one feature.
fn linear(nodes: &str, feature: &str, ahead: &str) -> String {
    let features = format!("[\"{feature}\"]");
    format!("{nodes}{}", estimating("linear", &features, ahead))
}

/// Nodes, and an autoregression of a truth.
fn ar(nodes: &str, truth: &str, ahead: &str, lags: &str) -> String {
    format!(
        "{nodes}[nodes.ar]\ntype = \"ar\"\ninputs.truth = \"{truth}\"\nahead = \"{ahead}\"\nlags = {lags}\n\
         [outputs]\npredicted = \"ar\"\n"
    )
}

/// A node of one signal.
fn node(name: &str, kind: &str, signal: &str, parameters: &str) -> String {
    format!("[nodes.{name}]\ntype = \"{kind}\"\ninputs.signal = {signal}\n{parameters}\n")
}

const DRIFT: &str = r#""drift.X""#;
const POSITION: &str = r#""position""#;

#[test]
fn a_derived_feature_leaks_as_its_signal_does() {
    let fast = node("fast", "slope", r#""position.X""#, "windows = [\"1min\"]");
    let nodes = fast + &node("some", "pick", r#"["temperature", "fast"]"#, "");
    leak(
        &linear(&nodes, "some", "2min"),
        &[
            "`some.X` contains part of the answer: it overlaps the value of `drift.X` that is predicted; it is made of what the \
             truth is made of: `some.X` from `fast.X` from `position.X`; the truth summarises 5min and is predicted 2min ahead, \
             so the smallest lag allowed is 3min (here it is 0s)",
        ],
    );
    sound(&linear(&nodes, "some", "5min"));
}

#[test]
fn another_axis_and_a_temperature_do_not_leak() {
    sound(&linear("", "drift.Y", "0s"));
    sound(&linear("", "temperature", "0s"));
}

#[test]
fn delays_along_the_way_add_up() {
    let late = |first: &str, second: &str| {
        let first = node("a", "delay", DRIFT, &format!("delay = \"{first}\""));
        let second = node("b", "delay", "\"a\"", &format!("delay = \"{second}\""));
        linear(&(first + &second), "b", "0s")
    };
    sound(&late("2min", "3min"));
    let way = "`b.X` from `a.X` from `drift.X` from `position.X`";
    leak(
        &late("2min", "150s"),
        &[way, "allowed is 5min (here it is 270s)"],
    );
}

#[test]
fn the_shortest_of_two_ways_counts() {
    let late = node("late", "delay", DRIFT, "delay = \"1h\"");
    let names = "names = [\"late\", \"now\"]";
    let nodes = late + &node("both", "pick", r#"["late", "drift.X"]"#, names);
    sound(&linear(&nodes, "both.late", "0s"));
    leak(&linear(&nodes, "both", "0s"), &["`both.now` "]);
}

#[test]
fn feedback_brings_the_truth_back_too() {
    // The loop is closed before what it brings back is known.
    let looped = |delay: &str, from: &str, unit: &str, ahead: &str| {
        let parameters = format!("delay = \"{delay}\"\nunit = \"{unit}\"");
        let back = node("back", "delay", "\"sum.now\"", &parameters);
        let signal = format!("[\"{from}\", \"back\"]");
        let sum = node("sum", "pick", &signal, "names = [\"now\", \"before\"]");
        let features = "{ from = \"back\", max_age = \"1min\" }";
        format!("{back}{sum}{}", estimating("linear", features, ahead))
    };
    leak(
        &looped("1min", "drift.X", "nm/min", "0s"),
        &[
            "`back.value` from `sum.now` from `drift.X` from `position.X`",
            "(here it is 1min)",
        ],
    );
    sound(&looped("1min", "drift.X", "nm/min", "4min"));
    // One tick later a position is still within the window of the truth.
    leak(
        &looped("1 tick", "position.X", "nm", "0s"),
        &["`back.value` "],
    );
    sound(&looped("5min", "position.X", "nm", "0s"));
}

#[test]
fn a_module_hides_nothing() {
    let nodes = "[modules.m]\ninputs = [\"signal\"]\noutputs.slope = \"s\"\n\
        nodes.s = { type = \"slope\", inputs.signal = \"{signal}\", windows = [\"1min\"] }\n\
        [nodes.inner]\nmodule = \"m\"\ninputs.signal = \"position\"\n";
    leak(
        &linear(nodes, "inner", "0s"),
        &["`inner/s.X` from `position.X`"],
    );
}

#[test]
fn a_lag_of_the_truth_leaks_until_its_window_is_past() {
    for (ahead, leaking, allowed) in [
        ("0s", "299s", "5min"),
        ("2min", "179s", "3min"),
        ("150s", "149s", "150s"),
    ] {
        let lags = |lag: &str| format!("[\"{lag}\", \"1h\"]");
        let smallest = format!("the smallest lag allowed is {allowed} (here it is {leaking})");
        leak(&ar("", "drift.X", ahead, &lags(leaking)), &[&smallest]);
        sound(&ar("", "drift.X", ahead, &lags(allowed)));
    }
    sound(&ar("", "drift.X", "5min", "[\"0s\"]"));
    let one_of_three = ar("", "drift.X", "0s", "[\"10min\", \"4min\", \"5min\"]");
    leak(&one_of_three, &["(here it is 4min)"]);
}

#[test]
fn a_plain_sample_leaks_only_into_itself() {
    let smallest = "the smallest lag allowed is one sample";
    leak(&ar("", "position.X", "0s", "[\"0s\"]"), &[smallest]);
    sound(&ar("", "position.X", "0s", "[\"1s\"]"));
    sound(&ar("", "position.X", "1s", "[\"0s\"]"));
    let late = node("late", "delay", POSITION, "delay = \"1 tick\"");
    let of = |feature: &str| {
        let feature = format!("{{ from = \"{feature}.X\", max_age = \"1min\" }}");
        let text = estimating("linear", &feature, "0s");
        late.clone() + &text.replace("drift.X", "position.X")
    };
    leak(&of("position"), &["contains part of the answer"]);
    sound(&of("late"));
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
    let crossed = node("crossed", "test_crossed", POSITION, "");
    for channel in ["crossed.X", "crossed.Y"] {
        leak(&linear(&crossed, channel, "0s"), &["from `position.X`"]);
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
fn a_truth_keeps_lags_out_of_all_that_it_is_made_of_though_its_kind_forgets_it() {
    let bare = node("bare", "test_instantaneous", "\"drift\"", "");
    leak(&ar(&bare, "bare.X", "0s", "[\"1min\"]"), &[]);
    sound(&ar(&bare, "bare.X", "0s", "[\"5min\"]"));
    let calm = node("calm", "moving", DRIFT, "windows = [\"4min\"]");
    let smallest = "the smallest lag allowed is 9min";
    leak(&ar(&calm, "calm.X", "0s", "[\"8min\"]"), &[smallest]);
    sound(&ar(&calm, "calm.X", "0s", "[\"9min\"]"));
}

#[test]
fn a_kind_that_keeps_channels_apart_denies_none_for_another() {
    let apart = node("apart", "hampel", POSITION, "window = \"1min\"");
    sound(&linear(&apart, "apart.Y", "0s"));
    leak(&linear(&apart, "apart.X", "0s"), &[]);
}

#[test]
fn the_instants_of_a_truth_give_nothing_away_and_its_values_do() {
    let sampled = |signal: &str, instants: &str| {
        let instants = format!("inputs.instants = \"{instants}\"");
        let signal = format!("\"{signal}\"");
        linear(
            &node("sampled", "sample_at", &signal, &instants),
            "sampled",
            "0s",
        )
    };
    sound(&sampled("position.Y", "position.X"));
    leak(&sampled("position.X", "position.Y"), &["from `position.X`"]);
}

#[test]
fn looking_back_over_a_window_delays_nothing() {
    for (kind, parameters) in [
        ("moving", "windows = [\"1h\"]"),
        ("difference", "over = \"1h\""),
        ("resample", "every = \"1min\""),
        ("hampel", "window = \"1h\"\nreplace = \"median\""),
    ] {
        let nodes = node("n", kind, DRIFT, parameters);
        leak(&linear(&nodes, "n.X", "0s"), &["(here it is 0s)"]);
    }
}

#[test]
fn every_lag_counts_for_itself() {
    let lags = node("past", "lag", DRIFT, "lags = [\"2min\", \"5min\"]");
    sound(&linear(&lags, "past.X@5min", "0s"));
    leak(
        &linear(&lags, "past", "0s"),
        &["`past.X@2min` ", "(here it is 2min)"],
    );
}

/// The value of a period may come when the next one is nearly over.
#[test]
fn a_truth_of_a_regular_clock_keeps_lags_out_of_all_the_time_that_it_may_reach_back() {
    for (method, leaking, allowed) in [
        ("method = \"mean\"", "9min", "10min"),
        ("method = \"last\"", "9min", "10min"),
        ("late = \"10s\"", "5min", "310s"),
    ] {
        let graph = |lag: &str| {
            let signal = r#""position.X""#;
            let clock = node(
                "clock",
                "resample",
                signal,
                &format!("every = \"5min\"\n{method}"),
            );
            let past = node("past", "lag", signal, &format!("lags = [\"{lag}\"]"));
            linear(&(clock + &past), "past", "0s").replace("drift.X\"\nahead", "clock.X\"\nahead")
        };
        leak(
            &graph(leaking),
            &[&format!("the smallest lag allowed is {allowed}")],
        );
        sound(&graph(allowed));
    }
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
    sound(&gate("5min", "state"));
    sound(&gate("0s", "before"));
    leak(&gate("0s", "state"), &["`state.X` contains part"]);
}

#[test]
fn what_is_measured_does_not_vote_on_itself() {
    let vote = |voters: &str, kind: &str| {
        format!(
            "[nodes.ago]\ntype = \"lag\"\ninputs.signal = \"drift.X\"\nlags = [\"1min\", \"5min\"]\n\
             [nodes.linear]\ntype = \"linear\"\ninputs.features = \"temperature\"\ninputs.truth = \"drift.X\"\nahead = \"0s\"\n\
             [nodes.vote]\ntype = \"{kind}\"\ninputs.voters = {voters}\n[outputs]\npredicted = \"vote\"\n"
        )
    };
    for leaking in [r#"["linear", "drift.X"]"#, r#"["linear", "ago.X@1min"]"#] {
        leak(
            &vote(leaking, "mean"),
            &["the smallest lag allowed is 5min"],
        );
    }
    sound(&vote(r#"["linear", "ago.X@5min"]"#, "mean"));
    sound(&vote(r#"["linear", "drift.Y"]"#, "mean"));
    // What is measured, and a prediction in its place where it is not, is no prediction and is not scored as one.
    sound(&vote(r#"["drift.X", "linear"]"#, "fallback"));
}

#[test]
fn what_learns_from_a_truth_while_it_runs_is_made_of_it() {
    let behind = |follow: &str, [followed, read]: [&str; 2]| {
        let follow = format!(
            "[nodes.follow]\n{follow}\ninputs.truth = \"drift.X\"\nahead = \"{followed}\"\n"
        );
        linear(&follow, "follow", read)
    };
    let learn = "type = \"rls\"\ninputs.features = \"temperature\"";
    for node in ["type = \"kalman\"", learn] {
        let way = "`follow.X` from `drift.X` from `position.X`";
        leak(
            &behind(node, ["5min", "0s"]),
            &["contains part of the answer", way],
        );
        for ahead in ["0s", "150s", "5min"] {
            sound(&behind(node, [ahead, ahead]));
        }
        sound(&behind(node, ["0s", "5min"]));
    }
    // What stays as it was fitted has seen nothing of the truths that it predicts.
    sound(&behind(&format!("{learn}\nlearn = false"), ["5min", "0s"]));
}

#[test]
fn a_leak_through_another_estimator_is_found_and_its_truth_is_no_path() {
    let second = |lag: &str| {
        let warm = linear("", "temperature", "5min").replace("cheat", "warm");
        let [warm, motion] = [warm, ar("", "drift.X", "5min", &format!("[\"{lag}\"]"))]
            .map(|text| text.split("[outputs]").next().unwrap().to_owned());
        warm + &motion + &estimating("linear", "[\"ar\", \"warm\"]", "0s")
    };
    leak(&second("4min"), &["`ar.X` contains part of the answer"]);
    sound(&second("5min"));
}

#[test]
fn what_is_nearer_to_the_present_than_a_truth_that_is_late_itself_leaks_for_as_long_as_it_is_late()
{
    let late = |ahead: &str, feature: &str| {
        let text = linear(
            &node("late", "lag", "\"drift\"", "lags = [\"10min\"]"),
            feature,
            ahead,
        );
        text.replace("truth = \"drift.X\"", "truth = \"late.X\"")
    };
    for (ahead, allowed) in [("0s", "15min"), ("10min", "5min"), ("14min", "1min")] {
        let words = format!(
            "the truth summarises 5min, is 10min late and is predicted {ahead} ahead, so the smallest lag allowed is {allowed}"
        );
        leak(&late(ahead, "drift"), &[&words]);
    }
    sound(&late("15min", "drift"));
    // Beside the truth, as late as it is, the rule is that of a truth that is not.
    leak(&late("4min", "late"), &["contains part of the answer"]);
    sound(&late("5min", "late"));
}
