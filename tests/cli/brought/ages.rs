//! Inputs that are measured rarely, beside others that are not: what they leave alone, and what a dead one ends.

use crate::workbench::{Bench, Graph, linear};

#[test]
fn a_rare_input_that_still_counts_does_not_age_what_is_predicted_now_and_a_dead_one_does() {
    let hours = |of: f64| (3600.0 * of) as u32;
    // What is fed by a voltage each 20 min, which counts for an hour: as it stands, in a sum, late, and over a window.
    for (node, regressor) in [
        ("", "voltage.battery"),
        (
            "type = 'sum'; inputs.signal = ['voltage', 'supply']",
            "made.sum",
        ),
        (
            "type = 'lag'; inputs.signal = 'voltage'; lags = ['10s']",
            "made.battery",
        ),
        (
            "type = 'slope'; inputs.signal = 'voltage'; windows = ['2h']",
            "made.battery",
        ),
    ] {
        let graph = Graph::new()
            .time("t")
            .signal("temperature", "Cel", "room chuck", "1min")
            .signal("position", "nm", "Z", "3min")
            .signal("voltage", "V", "battery", "1h")
            .signal("supply", "V", "mains", "1min")
            .slope("drift", "position", "5min", "nm/min")
            .slope("gradients", "temperature", "20min", "mK/min");
        let (graph, feature) = match node {
            "" => (graph, "voltage"),
            node => (graph.section("nodes.made", node), "made"),
        };
        let features = format!("gradients {feature}");
        let graph = graph
            .model("warm", "linear", &features, "drift.Z", "0s")
            .vote("vote", "mean", "['warm']", "")
            .model("same", "persistence", "", "drift.Z", "0s")
            .vote("result", "fallback", "vote same", "")
            .outputs("out = 'result'; mains = 'supply'");
        let fit = linear(&[("gradients.chuck", 1.0), (regressor, 1.0)], 0.0);
        let mut bench = Bench::new(&graph, &[("warm", fit)]);
        for now in (0..hours(3.5)).step_by(30) {
            let at = f64::from(now);
            let mut given = vec![
                ("temperature.room", 20.0),
                ("position.Z", at),
                ("supply.mains", 24.0),
            ];
            // The chuck's sensor dies after three hours; its slope is held for 20 min.
            if now < hours(3.0) {
                given.push(("temperature.chuck", 25.0));
            }
            if now % 1200 == 0 {
                given.push(("voltage.battery", 12.0));
            }
            bench.tick(at, &given);
            let there = !bench.value("vote.Z").is_nan();
            if (hours(2.2)..hours(3.0)).contains(&now) {
                assert!(there, "{regressor} at {now}");
                assert_eq!(bench.value("result.Z"), bench.value("vote.Z"));
            } else if now > hours(3.0) + 300 {
                assert!(!there, "{regressor} at {now}");
                assert!(!bench.value("result.Z").is_nan());
            }
        }
    }
}
