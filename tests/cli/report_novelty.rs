//! What `athermal report` says of predictions from outside of their fits and of sensors that contradict the others.

use std::path::{Path, PathBuf};

use crate::workbench::{Scratch, athermal, athermal_on, graph, simulated};
use serde_json::Value;

/// From the sixth to the ninth hour of a day, a sensor reads most of the room's air.
const LOOSE: &str = "from=6h,for=3h,size=0.7";
const EVENT_S: (f64, f64) = (6.0 * 3600.0, 9.0 * 3600.0);

/// A graph of the die tester, fitted on two days.
fn fitted(scratch: &Scratch, of: &Path) -> PathBuf {
    let days = simulated(scratch, "fit.csv", "die-tester", 2.0, 1);
    let model = scratch.path("model.json");
    athermal_on("fit", of, &days, &[&"-o", &model]).ended(0);
    model
}

/// Half a day on which a sensor comes loose.
fn loose(scratch: &Scratch, sensor: &str) -> PathBuf {
    let data = scratch.path("loose.csv");
    let disturbed = format!("loose={sensor},{LOOSE}");
    athermal(&[
        &"simulate",
        &"die-tester",
        &"--days",
        &"0.5",
        &"--seed",
        &"2",
        &"--disturb",
        &disturbed,
        &"-o",
        &data,
    ])
    .ended(0);
    data
}

fn list<'a>(facts: &'a Value, name: &str) -> &'a Vec<Value> {
    facts["novelty"][name].as_array().unwrap()
}

#[test]
fn a_report_says_which_sensor_contradicted_the_others_and_when() {
    let scratch = Scratch::new("report-contradiction");
    let model = fitted(&scratch, &graph("die-tester-compensate"));
    let (data, page) = (loose(&scratch, "holder1"), scratch.path("report.html"));
    let facts = athermal_on("report", &model, &data, &[&"--format", &"json"])
        .ended(0)
        .json();
    let found = list(&facts, "contradictions");
    assert!(!found.is_empty());
    for found in found {
        assert_eq!(found["sensor"], "temperature.holder1");
        assert_eq!(found["node"], "trusted");
        // It comes back ten minutes after it agrees again.
        let times = ["from_s", "to_s"].map(|key| found[key].as_f64().unwrap());
        assert!(
            times[0] >= EVENT_S.0 && times[0] <= EVENT_S.1 + 60.0,
            "{times:?}"
        );
        assert!(
            times[1] >= times[0] + 600.0 && times[1] <= EVENT_S.1 + 3600.0,
            "{times:?}"
        );
    }
    let first = found[0]["from_s"].as_f64().unwrap() / 3600.0;
    let sentence =
        format!("temperature.holder1 contradicts the other sensors from hour {first:.1}");
    athermal_on("report", &model, &data, &[&"-o", &page]).ended(0);
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("<h2>Outside of what was learned</h2>"));
    assert!(page.contains(&sentence));
    let text = athermal_on("report", &model, &data, &[]).ended(0).out;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains(&sentence), "{text}");
}

#[test]
fn a_report_says_how_far_predictions_went_outside_who_pushed_them_and_what_that_did_to_errors() {
    let scratch = Scratch::new("report-novelty");
    // Without the check of sensors, a loose one is read.
    let overlay = format!(
        "schema = 1\nextends = '{}'\nname = \"believing\"\nnodes.trusted = false\nnodes.gradients.inputs.signal = \"temperature\"\n",
        graph("die-tester-compensate").display()
    );
    let model = fitted(&scratch, &scratch.file("believing.toml", overlay));
    let data = loose(&scratch, "plate2");
    let facts = athermal_on("report", &model, &data, &[&"--format", &"json"])
        .ended(0)
        .json();
    assert_eq!(list(&facts, "contradictions").len(), 0);
    let of = |node: &str| {
        let found = list(&facts, "estimators")
            .iter()
            .find(|of| of["node"] == node);
        found.unwrap_or_else(|| panic!("{node} is not there"))
    };
    let expansion = of("expansion.Z2");
    assert_eq!(expansion["outside"], "absent");
    assert!(expansion["errors"]["rmse"].is_null(), "{expansion:#}");
    let side2 = of("side2.Z2");
    assert_eq!(side2["outside"], "shrink");
    let share = side2["share"].as_f64().unwrap();
    let worst = &side2["worst"];
    let times = ["from_s", "to_s"].map(|key| worst[key].as_f64().unwrap());
    assert_eq!(worst["by"], "temperature.plate2");
    assert!(
        times[0] >= EVENT_S.0 && times[1] <= EVENT_S.1 + 1800.0,
        "{times:?}"
    );
    assert!(share > 0.05 && share < 0.35, "{share}");
    assert!(worst["novelty"].as_f64().unwrap() > 1.5);
    let errors = &side2["errors"];
    let [heeded, unheeded] = ["rmse", "rmse_unheeded"].map(|key| errors[key].as_f64().unwrap());
    assert!(heeded < 0.9 * unheeded, "{errors:#}");
    // What knows only the first side is not concerned.
    let other = of("side1.Z2")["share"].as_f64().unwrap();
    assert!(other < 0.01, "{other}");
    let effects = list(&facts, "effects");
    let of_rate = |of: &&Value| of["prediction"] == "rate.Z2";
    let effect = effects.iter().find(of_rate).unwrap();
    assert!(effect["n"].as_u64().unwrap() > 20);
    let text = athermal_on("report", &model, &data, &[]).ended(0).out;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        text.contains(
            "times as far as the edge by temperature.plate2. Its predictions go to no model then."
        ),
        "{text}"
    );
}
