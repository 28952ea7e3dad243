//! What is known ahead: a plan is read before it applies, by a negative lag and by nothing else, and its channel is stepped like others.

use std::sync::Arc;

use crate::workbench::{Read, plan, secs};
use athermal::Engine;
use athermal::core::engine::Fitted;

const GRAPH: &str = r#"
schema = 1
signals.set_point = { unit = "Cel", channels = ["chuck"], known_ahead = "10min", max_age = "1h" }
signals.temperature = { unit = "Cel", channels = ["room"], max_age = "1min" }

[nodes.recipe]
type = "lag"
inputs.signal = "set_point"
lags = ["-5min", "0s", "5min"]

[nodes.held]                             # what applies, as held values are read
type = "sum"
inputs.signal = ["set_point", "temperature"]
weights = [0.5, 0.5]

[outputs]
recipe = "recipe"
held = "held"
"#;

/// The graph stepped at each of these seconds, with what the plan announces then: a set point, and from which second on.
fn stepped(engine: &mut Engine, rows: &[(i64, Option<(f64, f64)>)]) -> Vec<Vec<f64>> {
    let step = |&(second, announced): &(i64, Option<(f64, f64)>)| {
        let (set_point, from) = announced.unwrap_or((f64::NAN, f64::NAN));
        let samples = [set_point, 20.0, from];
        engine.step(secs(second as f64), &samples).unwrap().to_vec()
    };
    rows.iter().map(step).collect()
}

fn engine() -> Engine {
    Engine::new(plan(GRAPH), &Fitted::new()).unwrap()
}

/// Rows a minute apart, and what two of them announce.
fn rows(minutes: i64, announced: &[(i64, (f64, f64))]) -> Vec<(i64, Option<(f64, f64)>)> {
    let at = |minute: i64| announced.iter().find(|(at, _)| *at == minute);
    let row = |minute| (60 * minute, at(minute).map(|&(_, what)| what));
    (0..minutes).map(row).collect()
}

#[test]
fn a_planned_step_is_read_ahead_applies_when_it_is_due_and_is_looked_back_at() {
    let mut engine = engine();
    let outputs = stepped(
        &mut engine,
        &rows(30, &[(0, (20.0, 0.0)), (3, (50.0, 720.0))]),
    );
    for (minute, found) in outputs.iter().enumerate() {
        // Announced in the fourth minute, for the thirteenth.
        let ahead = if minute >= 7 { 50.0 } else { 20.0 };
        let now = if minute >= 12 { 50.0 } else { 20.0 };
        assert_eq!(found[..2], [ahead, now], "minute {minute}");
        match minute {
            0..5 => assert!(found[2].is_nan(), "minute {minute}"),
            _ => assert_eq!(found[2], if minute >= 17 { 50.0 } else { 20.0 }),
        }
        assert_eq!(found[3], 0.5 * (now + 20.0), "minute {minute}");
    }
}

#[test]
fn a_plan_that_comes_late_is_known_from_then_on_and_one_for_now_applies_at_once() {
    let mut engine = engine();
    let announced = [
        (0, (20.0, 0.0)),
        (10, (50.0, 660.0)),
        (15, (30.0, 300.0)),
        (20, (40.0, f64::NAN)),
    ];
    let outputs = stepped(&mut engine, &rows(30, &announced));
    let ahead = |minute: usize| outputs[minute][0];
    let now = |minute: usize| outputs[minute][1];
    assert_eq!([ahead(9), ahead(10)], [20.0, 50.0]);
    assert_eq!([now(10), now(11)], [20.0, 50.0]);
    // What is announced after it applies is known no earlier.
    assert_eq!([now(14), now(15)], [50.0, 30.0]);
    assert_eq!([now(19), now(20)], [30.0, 40.0]);
    assert_eq!(outputs[20][2], 30.0, "five minutes ago it was known so");
}

#[test]
fn a_new_plan_replaces_what_was_planned_from_its_instant_on() {
    let mut engine = engine();
    let announced = [
        (0, (20.0, 0.0)),
        (1, (30.0, 600.0)),
        (2, (40.0, 900.0)),
        (3, (25.0, 600.0)),
    ];
    let outputs = stepped(&mut engine, &rows(30, &announced));
    assert_eq!(outputs[6][0], 25.0);
    assert_eq!(
        outputs[29][1], 25.0,
        "40 was planned for after what was replaced"
    );
}

#[test]
fn a_plan_too_old_is_absent() {
    let mut engine = engine();
    let outputs = stepped(&mut engine, &rows(70, &[(0, (20.0, 0.0))]));
    assert_eq!(outputs[55][0], 20.0);
    assert!(outputs[56][0].is_nan(), "an hour after it began to apply");
    assert_eq!(outputs[60][1], 20.0);
    assert!(outputs[61][1].is_nan());
}

#[test]
fn an_engine_that_goes_on_from_a_snapshot_knows_the_plan() {
    let announced = [(0, (20.0, 0.0)), (3, (50.0, 720.0)), (4, (35.0, 900.0))];
    let rows = rows(40, &announced);
    let mut whole = engine();
    let expected = stepped(&mut whole, &rows);
    for cut in [1, 4, 5, 8, 13, 17, 25] {
        let mut first = engine();
        let mut found = stepped(&mut first, &rows[..cut]);
        let mut second = engine();
        second.restore(&first.snapshot()).unwrap();
        found.extend(stepped(&mut second, &rows[cut..]));
        let bits = |of: &[Vec<f64>]| -> Vec<u64> {
            of.iter().flatten().map(|value| value.to_bits()).collect()
        };
        assert_eq!(bits(&found), bits(&expected), "cut before row {cut}");
    }
}

#[test]
fn a_segment_begins_without_a_plan() {
    let mut engine = engine();
    stepped(
        &mut engine,
        &rows(5, &[(0, (20.0, 0.0)), (1, (50.0, 600.0))]),
    );
    engine.segment();
    let outputs = stepped(&mut engine, &rows(20, &[]));
    assert!(outputs.iter().all(|row| row[0].is_nan() && row[1].is_nan()));
}

/// Codes, messages and helps of what is wrong with a graph in which these are replaced.
fn refused(replaced: &[(&str, &str)]) -> Vec<String> {
    let text = replaced.iter().fold(GRAPH.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let read = Read::new(&text);
    let found = read.diagnostics.iter();
    let text = found.map(|of| {
        let help = of.help.as_deref().unwrap_or_default();
        format!("{}: {}; {help}", of.code, of.message)
    });
    text.collect()
}

#[track_caller]
fn is_refused(replaced: &[(&str, &str)], words: &[&str]) {
    let found = refused(replaced);
    let has = |word: &&str| found[0].contains(*word);
    assert!(
        found.len() == 1 && words.iter().all(has),
        "{words:?} in {found:?}"
    );
}

#[test]
fn what_is_measured_is_not_read_ahead_and_the_reason_is_given() {
    is_refused(
        &[(
            "inputs.signal = \"set_point\"",
            "inputs.signal = \"temperature\"",
        )],
        &[
            "A161",
            "`temperature.room` is measured",
            "5min ahead",
            "known_ahead",
        ],
    );
}

#[test]
fn what_is_computed_from_a_plan_is_not_read_ahead_either() {
    let nodes =
        "[nodes.rise]\ntype = \"difference\"\ninputs.signal = \"set_point\"\n\n[nodes.recipe]";
    is_refused(
        &[
            ("[nodes.recipe]", nodes),
            ("lags = [\"-5min\"", "max_age = \"1h\"\nlags = [\"-5min\""),
            (
                "type = \"lag\"\ninputs.signal = \"set_point\"",
                "type = \"lag\"\ninputs.signal = \"rise\"",
            ),
        ],
        &["A161", "`rise.chuck` is computed"],
    );
}

#[test]
fn a_plan_is_read_no_further_ahead_than_it_is_known() {
    is_refused(
        &[("-5min", "-11min")],
        &["A161", "read 11min ahead", "known 10min ahead"],
    );
}

#[test]
fn no_other_lag_may_be_negative_and_the_reason_is_given() {
    let more = "[nodes.next]\ntype = \"arx\"\ninputs.features = \"recipe\"\ninputs.truth = \"temperature.room\"\nahead = \"5min\"\n\
                lags = [\"0s\"]\nfeature_lags = [\"-1min\"]\n\n[outputs]\nnext = \"next\"\n";
    is_refused(&[("[outputs]\n", more)], &["plans alone", "`lag`"]);
}

#[test]
fn what_a_plan_says_of_the_future_is_no_part_of_the_answer() {
    let more = "[nodes.next]\ntype = \"linear\"\ninputs.features = \"recipe\"\ninputs.truth = \"temperature.room\"\nahead = \"5min\"\n\n\
                [outputs]\nnext = \"next\"\n";
    assert_eq!(refused(&[("[outputs]\n", more)]), [] as [&str; 0]);
    // A measured regressor that is read at the instant predicted still is.
    let cheat = more
        .replace("\"5min\"", "\"0s\"")
        .replace("\"recipe\"", "[\"recipe\", \"temperature\"]");
    is_refused(&[("[outputs]\n", &cheat)], &["A052", "temperature.room"]);
}

#[test]
fn the_instants_of_a_plan_stand_behind_what_is_measured() {
    let plan: Arc<_> = plan(GRAPH);
    let names: Vec<_> = plan.sources.iter().map(|of| of.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "set_point.chuck",
            "temperature.room",
            "set_point:applies_at.chuck"
        ]
    );
    assert_eq!(plan.sources[2].column, "applies_at");
}
