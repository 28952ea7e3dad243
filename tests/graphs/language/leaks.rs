//! What sees the future is a mistake in the file, and the smallest lag allowed is named.

use super::{SAMPLES, SLOPES};
use crate::workbench::{plan, problems};

fn endogenous(truth: &str, ahead: &str, lags: &str) -> String {
    format!(
        r#"{SAMPLES}{SLOPES}
[nodes.motion]
type = "ar"
inputs.truth = "{truth}"
ahead = "{ahead}"
lags = {lags}
[outputs]
out = "motion"
also = "gradients"
position = "drift"
"#
    )
}

fn check(truth: &str, ahead: &str, leaks: &str, allowed: &str, named: &str) {
    let told = problems(&endogenous(truth, ahead, &format!("[\"{leaks}\"]")));
    assert!(told.contains("contains part of the answer"), "{told}");
    assert!(
        told.contains(&format!("the smallest lag allowed is {named}")),
        "{told}"
    );
    plan(&endogenous(truth, ahead, &format!("[\"{allowed}\"]")));
}

#[test]
fn a_lag_whose_window_overlaps_the_predicted_one_is_a_leak() {
    check("drift.Z", "0s", "299999ms", "5min", "5min");
    check("drift.Z", "150s", "149s", "150s", "150s");
    check("drift.Z", "150s", "0s", "5min", "150s");
    plan(&endogenous("drift.Z", "5min", "[\"0s\"]"));
}

#[test]
fn a_plain_sample_leaks_only_into_itself() {
    check("position.Z", "0s", "0s", "1s", "one sample");
    plan(&endogenous("position.Z", "1s", "[\"0s\"]"));
}

#[test]
fn only_the_lag_that_leaks_is_pointed_at() {
    let told = problems(&endogenous(
        "drift.Z",
        "0s",
        "[\"10min\", \"4min\", \"5min\"]",
    ));
    assert_eq!(
        told.matches("contains part of the answer").count(),
        1,
        "{told}"
    );
    assert!(told.contains("(here it is 4min)"), "{told}");
}

/// A node that follows a truth, and one that reads it as a feature.
fn behind_a_learner(follow: &str, ahead: [&str; 2]) -> String {
    let [followed, read] = ahead;
    format!(
        r#"{SAMPLES}{SLOPES}
[nodes.follow]
{follow}
inputs.truth = "drift.Z"
ahead = "{followed}"
[nodes.cheat]
type = "linear"
inputs.features = ["gradients", "follow"]
inputs.truth = "drift.Z"
ahead = "{read}"
[outputs]
out = "cheat"
"#
    )
}

#[test]
fn what_learns_from_a_truth_while_it_runs_is_made_of_it() {
    let follow = "type = \"kalman\"";
    let learn = "type = \"rls\"\ninputs.features = \"gradients\"";
    for node in [follow, learn] {
        let told = problems(&behind_a_learner(node, ["5min", "0s"]));
        assert!(told.contains("contains part of the answer"), "{told}");
        assert!(
            told.contains("`follow.Z` from `drift.Z` from `position.Z`"),
            "{told}"
        );
        for ahead in ["0s", "150s", "5min"] {
            plan(&behind_a_learner(node, [ahead, ahead]));
        }
        plan(&behind_a_learner(node, ["0s", "5min"]));
    }
    // What stays as it was fitted has seen nothing of the truths that it predicts.
    let fitted = format!("{learn}\nlearn = false");
    plan(&behind_a_learner(&fitted, ["5min", "0s"]));
}

fn through(delay: &str, ahead: &str, feature: &str) -> String {
    format!(
        r#"{SAMPLES}{SLOPES}
[nodes.late]
type = "delay"
inputs.signal = "position"
delay = "{delay}"
[nodes.past]
type = "slope"
inputs.signal = "late"
windows = ["150s"]
[nodes.warm]
type = "linear"
inputs.features = ["gradients", "{feature}"]
inputs.truth = "drift.Z"
ahead = "{ahead}"
[outputs]
out = "warm"
past = "past"
"#
    )
}

#[test]
fn a_feature_made_of_the_truths_own_signal_is_held_to_the_same_rule() {
    let told = problems(&through("4min", "0s", "past"));
    assert!(
        told.contains("`past.Z` contains part of the answer"),
        "{told}"
    );
    assert!(told.contains("the smallest lag allowed is 5min"), "{told}");
    plan(&through("5min", "0s", "past"));
    plan(&through("150s", "150s", "past"));
    let told = problems(&through("5min", "0s", "drift"));
    assert!(
        told.contains("`drift.Z lag 0s` contains part of the answer"),
        "{told}"
    );
    plan(&through("5min", "5min", "drift"));
}

#[test]
fn a_leak_through_another_estimator_is_found_and_its_truth_is_no_path() {
    let text = |lag: &str| {
        format!(
            r#"{SAMPLES}{SLOPES}
[nodes.motion]
type = "ar"
inputs.truth = "drift.Z"
ahead = "5min"
lags = ["{lag}"]
[nodes.warm]
type = "linear"
inputs.features = "gradients"
inputs.truth = "drift.Z"
ahead = "5min"
[nodes.second]
type = "linear"
inputs.features = ["motion", "warm"]
inputs.truth = "drift.Z"
ahead = "0s"
[outputs]
out = "second"
"#
        )
    };
    let told = problems(&text("4min"));
    assert!(
        told.contains("`motion.Z` contains part of the answer"),
        "{told}"
    );
    assert!(!told.contains("`warm.Z"), "{told}");
    plan(&text("5min"));
}

#[test]
fn a_plain_sample_of_the_tick_before_is_none_of_what_is_predicted_now() {
    let text = |feature: &str| {
        format!(
            r#"{SAMPLES}{SLOPES}
[nodes.late]
type = "delay"
inputs.signal = "position"
delay = "1 tick"
[nodes.warm]
type = "linear"
inputs.features = {{ from = "{feature}", max_age = "1min" }}
inputs.truth = "position.Z"
ahead = "0s"
[outputs]
out = "warm"
"#
        )
    };
    let told = problems(&text("position"));
    assert!(told.contains("contains part of the answer"), "{told}");
    plan(&text("late"));
}

#[test]
fn a_leak_through_a_loop_is_found() {
    // One tick later the position is still within the window of the truth.
    let text = |delay: &str| {
        format!(
            r#"{SAMPLES}{SLOPES}
[nodes.now]
type = "pick"
inputs.signal = ["position.Z", "before"]
names = ["Z", "last"]
[nodes.before]
type = "delay"
inputs.signal = "now.Z"
delay = "{delay}"
unit = "nm"
[nodes.warm]
type = "linear"
inputs.features = {{ from = ["before", "gradients"], max_age = "1min" }}
inputs.truth = "drift.Z"
ahead = "0s"
[outputs]
out = "warm"
now = "now"
"#
        )
    };
    let told = problems(&text("1 tick"));
    assert!(
        told.contains("`before.value` contains part of the answer"),
        "{told}"
    );
    plan(&text("5min"));
}

#[test]
fn what_is_nearer_to_the_present_than_a_truth_that_is_late_itself_leaks_for_as_long_as_it_is_late()
{
    let text = |ahead: &str, feature: &str| {
        format!(
            r#"{SAMPLES}{SLOPES}
[nodes.late]
type = "lag"
inputs.signal = "drift"
lags = ["10min"]
[nodes.warm]
type = "linear"
inputs.features = ["gradients", "{feature}"]
inputs.truth = "late.Z"
ahead = "{ahead}"
[outputs]
out = "warm"
also = "drift"
"#
        )
    };
    for ahead in ["0s", "10min", "14min"] {
        let told = problems(&text(ahead, "drift"));
        assert!(told.contains("contains part of the answer"), "{told}");
        assert!(
            told.contains(&format!(
                "the truth summarises 5min, is 10min late and is predicted {ahead} ahead"
            )),
            "{told}"
        );
    }
    assert!(
        problems(&text("10min", "drift")).contains("the smallest lag allowed is 5min"),
        "{}",
        problems(&text("10min", "drift"))
    );
    plan(&text("15min", "drift"));
    // Beside the truth, as late as it is, the rule is that of a truth that is not.
    let told = problems(&text("4min", "late"));
    assert!(told.contains("contains part of the answer"), "{told}");
    plan(&text("5min", "late"));
}
