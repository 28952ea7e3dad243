//! Combiners that go by a state or give reasons, in a running graph.

use super::slopes;
use crate::workbench::{Bench, Graph, plan, problems};

fn bench() -> Bench {
    let text = slopes()
        .section("nodes.state", "type = 'stability'")
        .with("inputs.drift = 'drift.Z'")
        .with("stable_below = '30 nm/min'; transient_above = '80 nm/min'")
        .model("still", "zero", "", "drift.Z", "5min")
        .model("same", "persistence", "", "drift.Z", "5min")
        .section("nodes.gate", "type = 'state_gate'")
        .with("inputs.voters = ['still', 'same']")
        .with("inputs.state = 'state'")
        .vote("guard", "guard", "same", "drift.Z")
        .with("memory = { truths = 4 }; min_truths = 2")
        .outputs("gate = ['gate', 'gate:weights']; why = 'gate:reason'")
        .with("guard = ['guard', 'guard:weights']; held = 'guard:reason'");
    Bench::new(&text, &[])
}

/// Moves the machine by a constant drift for ten minutes, a position every minute.
fn move_on(bench: &mut Bench, from: f64, position: &mut f64, drift: f64) {
    for minute in 1..=10 {
        *position += drift;
        let at = from + 60.0 * f64::from(minute);
        bench.tick(at, &[("position.Z", *position), ("temperature.room", 20.0)]);
    }
}

fn values(bench: &Bench, names: [&str; 3]) -> [f64; 3] {
    names.map(|name| bench.value(name))
}

#[test]
fn a_gate_follows_the_state_and_shows_whose_vote_it_is() {
    let (mut bench, mut position) = (bench(), 0.0);
    let weights = [
        "gate:weights.weight-still",
        "gate:weights.weight-same",
        "gate:reason.Z",
    ];
    move_on(&mut bench, 0.0, &mut position, 10.0);
    assert_eq!(bench.value("gate.Z"), 0.0);
    assert_eq!(values(&bench, weights), [1.0, 0.0, 0.0]);
    move_on(&mut bench, 600.0, &mut position, 200.0);
    assert!((bench.value("gate.Z") - 200.0).abs() < 1e-6);
    assert_eq!(values(&bench, weights), [0.0, 1.0, 0.0]);
}

#[test]
fn a_guard_says_why_it_holds_a_prediction_back() {
    let (mut bench, mut position) = (bench(), 0.0);
    let told = ["guard.Z", "guard:weights.weight-same", "guard:reason.Z"];
    move_on(&mut bench, 0.0, &mut position, 20.0);
    let [vote, weight, reason] = values(&bench, told);
    assert!((vote - 20.0).abs() < 1e-6, "{vote}");
    assert_eq!(
        [weight, reason],
        [1.0, 2.0],
        "five minutes ahead, nothing is compared yet"
    );
    move_on(&mut bench, 600.0, &mut position, 20.0);
    assert_eq!(values(&bench, told)[1..], [1.0, 0.0]);
    // To and fro: what was is the worst guess of what will be.
    for turn in 0..4 {
        let drift = if turn % 2 == 0 { -50.0 } else { 50.0 };
        for minute in 1..=5 {
            position += drift;
            let at = 1200.0 + 300.0 * f64::from(turn) + 60.0 * f64::from(minute);
            bench.tick(at, &[("position.Z", position)]);
        }
    }
    assert_eq!(values(&bench, told), [0.0, 0.0, 1.0]);
}

#[test]
fn predictions_of_one_axis_are_not_put_together_with_those_of_another() {
    let text = |still: &str, judge: &str| {
        slopes()
            .model("still", "zero", "", &format!("drift.{still}"), "5min")
            .model("same", "persistence", "", "drift.Z", "5min")
            .vote(
                "vote",
                "auto_weighted",
                "same still",
                &format!("drift.{judge}"),
            )
            .with("memory = '15min'")
            .outputs("out = 'vote'; also = 'drift'")
            .replace("[\"Z\"]", "[\"X\", \"Z\"]")
    };
    let told = problems(&text("X", "Z"));
    assert!(told.contains("A066"), "{told}");
    let both = "`same.Z` predicts `drift.Z` and `still.X` `drift.X`";
    assert!(told.contains(both), "{told}");
    let told = problems(&text("Z", "X"));
    let judged = "`same.Z` predicts `drift.Z` and is to be judged by `drift.X`";
    assert!(told.contains(judged), "{told}");
    plan(&text("Z", "Z"));
}

/// A graph with two predictions of one drift, and this node that votes.
fn voting(vote: &str) -> Graph {
    slopes()
        .model("thermal", "rls", "gradients", "drift.Z", "5min")
        .model("same", "persistence", "", "drift.Z", "5min")
        .section("nodes.sure", "type = 'conformal'")
        .with("inputs.prediction = 'same'")
        .with("inputs.truth = 'drift.Z'; memory = '1d'")
        .vote("first", "mean", "thermal same", "")
        .node("half", "scale", "thermal")
        .with("factor = 0.5")
        .with(vote)
        .outputs("out = 'vote'; first = 'first'; sure = 'sure'; half = 'half'")
}

#[test]
fn what_a_node_gives_beside_its_prediction_has_no_vote() {
    let mean = "[nodes.vote]\ntype = \"mean\"\ninputs.voters = ";
    let stack = "[nodes.vote]\ntype = \"stack\"\nahead = \"5min\"\ninputs.truth = \"drift.Z\"\ninputs.voters = ";
    for (voter, instead) in [
        ("thermal:std_dev", "`thermal`"),
        ("thermal:std_dev.Z", "`thermal.Z`"),
        ("sure:upper", "`sure`"),
        ("first:weights.weight-same", "`first.Z`"),
    ] {
        for kind in [mean, stack] {
            let told = problems(&voting(&format!("{kind}[\"same\", \"{voter}\"]")));
            assert_eq!(told.matches("error[").count(), 1, "{told}");
            assert!(told.contains("error[A067]"), "{told}");
            assert!(
                told.contains(&format!("let the prediction vote: {instead}")),
                "{told}"
            );
        }
    }
    let alone = "[nodes.vote]\ntype = \"conformal\"\nmemory = \"1d\"\ninputs.truth = \"drift.Z\"\n";
    let told = problems(&voting(&format!(
        "{alone}inputs.prediction = \"first:weights.weight-same\""
    )));
    assert!(told.contains("A067"), "{told}");
    for voter in [
        "thermal",
        "thermal:prediction",
        "sure",
        "first",
        "half",
        "drift.Z",
    ] {
        plan(&voting(&format!("{mean}[\"{voter}\"]")));
    }
}

#[test]
fn regressors_and_votes_stand_once_and_factors_may_stand_twice() {
    let mean = "[nodes.vote]\ntype = \"mean\"\ninputs.voters = ";
    let told = problems(&voting(&format!(
        "{mean}[\"same\", \"thermal\", \"same.Z\"]"
    )));
    assert_eq!(told.matches("error[").count(), 1, "{told}");
    assert!(told.contains("error[A068]"), "{told}");
    assert!(told.contains("`same.Z` stands twice in `voters`"), "{told}");
    let of = |features: &str, node: &str| {
        voting(&format!("{mean}[\"same\", \"thermal\"]{node}")).replace(
            "inputs.features = \"gradients\"",
            &format!("inputs.features = {features}"),
        )
    };
    let told = problems(&of("[\"gradients\", \"gradients\"]", ""));
    assert!(told.contains("A068"), "{told}");
    let squared = "\n[nodes.squared]\ntype = \"product\"\nunit = \"nm2/min2\"\ninputs.signal = [\"drift\", \"drift\"]\n";
    plan(&of("[\"gradients\", \"squared\"]", squared));
}
