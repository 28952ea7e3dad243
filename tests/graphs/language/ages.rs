//! How long a held value counts: by its stamp, which is the oldest among what it was made of.

use super::{samples, slopes};
use crate::workbench::{Bench, Graph, Read, linear, problems};

/// An estimator on both temperatures, held, and a vote that holds its answer.
fn held(vote: &str) -> Graph {
    samples()
        .model("warm", "linear", "temperature", "position.Z", "0s")
        .model("still", "zero", "", "position.Z", "0s")
        .vote("vote", "mean", vote, "")
        .outputs("out = 'vote'; still = 'still'")
}

fn sum() -> [(
    &'static str,
    std::sync::Arc<dyn athermal::core::node::Predictor>,
); 1] {
    [(
        "warm",
        linear(
            &[("temperature.room", 1.0), ("temperature.chuck", 1.0)],
            0.0,
        ),
    )]
}

#[test]
fn a_held_input_counts_up_to_its_maximum_age_and_its_stamp_is_handed_on() {
    let mut bench = Bench::new(&held(r#"{ from = ["warm"], max_age = "30s" }"#), &sum());
    bench.tick(
        0.0,
        &[("temperature.room", 1.0), ("temperature.chuck", 10.0)],
    );
    for tick in 1..=10 {
        let now = 10.0 * f64::from(tick);
        bench.tick(now, &[("temperature.chuck", 10.0 + now)]);
        // The room is one minute old at 60 s, the signal's maximum; the vote takes nothing older than 30 s.
        assert_eq!(bench.value("warm.Z").is_nan(), now > 60.0, "at {now}");
        assert!(bench.ran("warm.Z"));
        if now <= 60.0 {
            assert_eq!(bench.value("warm.Z"), 11.0 + now);
            assert_eq!(bench.stamp("warm.Z"), 0.0, "the oldest of what it used");
        }
        assert_eq!(bench.value("vote.Z").is_nan(), now > 30.0, "at {now}");
    }
}

#[test]
fn by_default_a_sample_counts_as_long_as_its_signal_says_and_a_slope_for_its_window() {
    let text = slopes()
        .model("warm", "linear", "gradients", "drift.Z", "0s")
        .outputs("out = 'warm'");
    let fit = linear(&[("gradients.room", 1.0), ("gradients.chuck", 1.0)], 0.0);
    let mut bench = Bench::new(&text, &[("warm", fit)]);
    let mut answers = Vec::new();
    for tick in 0..60 {
        let now = 10.0 * f64::from(tick);
        let room = ("temperature.room", 20.0 + now / 60.0);
        let chuck = ("temperature.chuck", 30.0);
        // The room's last sample is at 200 s; its slope counts for the 150 s of its window.
        if now <= 200.0 {
            bench.tick(now, &[room, chuck]);
        } else {
            bench.tick(now, &[chuck]);
        }
        if !bench.value("warm.Z").is_nan() {
            assert!(
                (bench.value("warm.Z") - 1000.0).abs() < 1e-6,
                "1 K/min is 1000 mK/min"
            );
            answers.push(now);
        }
    }
    assert_eq!((answers[0], answers[answers.len() - 1]), (150.0, 350.0));
}

#[test]
fn a_hold_bridges_ticks_without_fresh_inputs_and_ends_with_a_run_that_gives_nothing() {
    let mut bench = Bench::new(
        &held(r#"{ from = ["warm", "still"], max_age = "5min" }"#),
        &sum(),
    );
    bench.tick(
        0.0,
        &[("temperature.room", 1.0), ("temperature.chuck", 10.0)],
    );
    assert_eq!(bench.value("vote.Z"), 5.5);
    // Nothing fresh for `warm`: it does not run, and its answer holds, though the temperatures themselves are too old.
    bench.tick(100.0, &[("position.Z", 0.0)]);
    assert!(!bench.ran("warm.Z"));
    assert_eq!(bench.value("vote.Z"), 5.5);
    // A run without an answer, since the room is too old, ends the hold.
    bench.tick(110.0, &[("temperature.chuck", 10.0)]);
    assert!(bench.ran("warm.Z") && bench.value("warm.Z").is_nan());
    assert_eq!(bench.value("vote.Z"), 0.0);
    bench.tick(120.0, &[("position.Z", 0.0)]);
    assert_eq!(bench.value("vote.Z"), 0.0);
}

#[test]
fn truth_alone_makes_nothing_run_but_what_changes_with_time() {
    let mut bench = Bench::new(&held(r#"["warm"]"#), &sum());
    bench.tick(
        0.0,
        &[("temperature.room", 1.0), ("temperature.chuck", 10.0)],
    );
    bench.tick(10.0, &[("position.Z", 3.0)]);
    assert!(!bench.ran("warm.Z") && !bench.ran("vote.Z"));
    assert!(bench.ran("still.Z"));
}

#[test]
fn at_a_tick_without_any_sample_only_what_changes_with_time_runs() {
    let text = slopes()
        .model("motion", "ar", "", "drift.Z", "5min")
        .with("lags = ['0s']")
        .model("both", "arx", "gradients", "drift.Z", "5min")
        .with("lags = ['0s']")
        .model("same", "persistence", "", "drift.Z", "5min")
        .model("warm", "linear", "gradients", "drift.Z", "5min")
        .outputs("out = ['motion']; both = 'both'; same = 'same'; warm = 'warm'");
    let fits = [
        ("motion", linear(&[("drift.Z lag 0s", 1.0)], 0.0)),
        (
            "both",
            linear(&[("drift.Z lag 0s", 1.0), ("gradients.room", 1.0)], 0.0),
        ),
        ("warm", linear(&[("gradients.room", 1.0)], 0.0)),
    ];
    let mut bench = Bench::new(&text, &fits);
    for tick in 0..=60 {
        let now = 10.0 * f64::from(tick);
        bench.tick(
            now,
            &[
                ("temperature.room", 20.0 + now / 60.0),
                ("position.Z", now / 6.0),
            ],
        );
    }
    let silent = bench.tick(601.0, &[]);
    for name in ["motion.Z", "both.Z", "same.Z"] {
        assert!(bench.ran(name) && bench.value(name).is_finite(), "{name}");
    }
    for name in ["warm.Z", "drift.Z", "gradients.room"] {
        assert!(!bench.ran(name), "{name}");
    }
    assert_eq!(silent.iter().filter(|value| value.is_finite()).count(), 3);
    // Held drift counts for its span of five minutes: at 900 s it does, after that it does not.
    bench.tick(900.0, &[]);
    assert!((bench.value("motion.Z") - 10.0).abs() < 1e-9);
    bench.tick(900.1, &[]);
    assert!(bench.ran("motion.Z") && bench.value("motion.Z").is_nan());
}

#[test]
fn a_held_sample_that_nothing_bounds_is_a_mistake() {
    let told = problems(&held("warm").replace("max_age = \"1min\"", ""));
    assert!(
        told.contains("nothing defines how long a value of `temperature.room` counts"),
        "{told}"
    );
    let advice = "set `max_age` on the signal `temperature`, or `inputs.";
    assert!(told.contains(advice), "{told}");
}

#[test]
fn a_value_of_a_regular_clock_counts_until_the_next_is_due() {
    for method in ["mean", "last"] {
        let text = samples()
            .node("clock", "resample", "temperature")
            .with(&format!("every = '1min'; method = '{method}'"))
            .model("warm", "linear", "clock", "position.Z", "0s")
            .outputs("out = 'warm'");
        let fit = linear(&[("clock.room", 1.0), ("clock.chuck", 1.0)], 0.0);
        let mut bench = Bench::new(&text, &[("warm", fit)]);
        for tick in 1..=100 {
            // Once a minute, now just before the end of a period and now just after.
            let jitter = f64::from(tick * 7 % 11 - 5) * 0.3;
            let now = 60.0 * f64::from(tick) + jitter;
            let both = [("temperature.room", 1.0), ("temperature.chuck", 2.0)];
            let given = bench.tick(now, &both);
            let held = bench.value("clock.room");
            assert_eq!(given[0].is_nan(), held.is_nan(), "{method} at {now}");
        }
    }
}

#[test]
fn an_age_at_a_port_that_holds_nothing_is_doubted_with_the_reason() {
    let read = Read::new(
        &samples()
            .slope(
                "drift",
                "{ from = 'position', max_age = '1min' }",
                "5min",
                "",
            )
            .node("all", "sum", "{ from = 'position', max_age = '1min' }")
            .outputs("out = 'drift'; all = 'all'"),
    );
    let told = read.told();
    assert!(read.plan.is_some(), "{told}");
    let doubt = "warning[A065]: `max_age` does nothing here: `inputs.signal` takes new values only";
    assert_eq!(told.matches(doubt).count(), 1, "{told}");
    assert!(told.contains("node `drift`"), "{told}");
    assert!(told.contains("leave `max_age` out"), "{told}");
}

#[test]
fn a_feature_that_holds_a_value_which_has_ended_has_none_either() {
    let text = samples()
        .node("sound", "hampel", "temperature.room")
        .with("window = '2min'; replace = 'absent'; min_samples = 3")
        .node("total", "sum", "['sound']")
        .outputs("out = 'total'");
    let mut bench = Bench::new(&text, &[]);
    for (now, room) in [(0.0, 20.0), (10.0, 20.1), (20.0, 20.2), (30.0, 20.1)] {
        bench.tick(now, &[("temperature.room", room)]);
    }
    assert_eq!(bench.value("total.sum"), 20.1);
    bench.tick(40.0, &[("temperature.room", 90.0)]);
    for name in ["sound.room", "total.sum"] {
        assert!(bench.ran(name) && bench.value(name).is_nan(), "{name}");
    }
    // A tick without a sample brings nothing back.
    bench.tick(50.0, &[("position.Z", 0.0)]);
    assert!(!bench.ran("total.sum"));
    bench.tick(60.0, &[("temperature.room", 20.2)]);
    assert_eq!(bench.value("total.sum"), 20.2);
}
