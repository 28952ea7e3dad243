//! What the correction of the die tester is worth on data that it has not seen.

use std::path::Path;

use crate::workbench::{Read, data};
use athermal::Model;
use athermal::files::{Dataset, Options};
use athermal::report::{Facts, Worth, gather, rms};
use athermal::run::fit::{FitOptions, fit};

fn facts(graph: &str, data: &Path) -> Facts {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    let mut model = Model::load(root.join(graph)).unwrap();
    let set = |name: &str| Dataset::new(vec![data.join(name)], Options::default());
    let (fitted, _) = fit(
        &model.plan,
        &set("train.csv"),
        &FitOptions::default(),
        &mut |_| {},
    )
    .unwrap();
    model.fitted = fitted;
    gather(&model, &set("test.csv"), vec!["test.csv".into()]).unwrap()
}

/// Root mean square of the drift without and with the correction, where the first is below a limit in nm/min.
fn left(worth: &Worth, axis: &str, limit: f64) -> (f64, f64) {
    let i = worth.axes.iter().position(|name| name == axis).unwrap();
    let (without, with) = (&worth.drift_without[i], &worth.drift_with[i]);
    let both = without.value.iter().zip(&with.value);
    let counted: Vec<_> = both
        .filter(|(y, r)| y.abs() < limit && !r.is_nan())
        .collect();
    let rms_of = |pick: fn(&(&f64, &f64)) -> f64| rms(counted.iter().map(pick)).unwrap();
    (rms_of(|(y, _)| **y), rms_of(|(_, r)| **r))
}

#[test]
fn the_correction_takes_three_quarters_of_the_drift_and_half_of_the_waiting_by_either_graph() {
    let Some(data) = data().map(|data| data.join("die-tester")) else {
        return;
    };
    let worth = facts("die-tester-compensate.toml", &data).worth.unwrap();
    // On a recording without a correction the graph that closes the loop is worth the same.
    let of_control = facts("die-tester-control.toml", &data).worth.unwrap();
    let [one, other] = [&worth, &of_control].map(|of| serde_json::to_string(of).unwrap());
    assert!(one == other, "the two graphs differ");
    for axis in worth.axes.clone() {
        for limit in [250.0, f64::INFINITY] {
            let (without, with) = left(&worth, &axis, limit);
            println!(
                "{axis} |y| < {limit}: {without:.2} → {with:.2} nm/min, {:.1} % less",
                100.0 * (1.0 - with / without)
            );
        }
    }
    for axis in ["Z1", "Z2"] {
        let (without, with) = left(&worth, axis, 250.0);
        assert!(with <= 0.25 * without, "{axis}: {without} → {with}");
        let (without, with) = left(&worth, axis, f64::INFINITY);
        assert!(
            with <= 0.20 * without,
            "{axis} over all: {without} → {with}"
        );
    }
    let cool = |losses: &[f64]| {
        let counted: Vec<f64> = losses
            .iter()
            .zip(&worth.light.set_point)
            .filter(|(_, chuck)| **chuck <= 71.0)
            .map(|(loss, _)| *loss)
            .collect();
        let low = counted.iter().filter(|loss| **loss < 0.2).count();
        low as f64 / counted.len() as f64
    };
    let (without, with) = (
        cool(&worth.light.loss_without.value),
        cool(&worth.light.loss_with.value),
    );
    println!("share of losses below 0.2 dB: {without:.3} → {with:.3}");
    assert!(with >= 0.97 && without < 0.7, "{without} → {with}");
    println!("{:#?}", worth.light.settling);
    assert_eq!(worth.light.settling.len(), 7);
    let minutes = |pick: fn(&athermal::report::Settling) -> Option<f64>| {
        let mut minutes: Vec<f64> = worth
            .light
            .settling
            .iter()
            .map(|s| pick(s).unwrap())
            .collect();
        minutes.sort_by(f64::total_cmp);
        minutes
    };
    let (without, with) = (minutes(|s| s.without_min), minutes(|s| s.with_min));
    // data/README.md, "Compensation": minutes without a correction, found by another program.
    for (settling, reference) in worth
        .light
        .settling
        .iter()
        .zip([24.0, 40.0, 57.0, 48.0, 92.0, 50.0, 62.0])
    {
        let found = settling.without_min.unwrap();
        assert!(
            (found - reference).abs() < 1.0,
            "{found} min, the reference is {reference} min"
        );
    }
    assert!(with[6] <= 0.5 * without[6], "{without:?} → {with:?}");
    assert!(with[3] <= 10.0, "{with:?}");
}

/// What is told of the die tester's graph when the correction's rate looks another time ahead.
fn told_of(ahead: &str) -> String {
    let read = Read::new(&format!(
        "schema = 1\nextends = \"die-tester-control.toml\"\nnodes.compensate.inputs.rate = {{ from = \"other\", max_age = \"1min\" }}\n\
         [nodes.other]\ntype = \"linear\"\neach = \"axis\"\nahead = \"{ahead}\"\n\
         inputs = {{ features = {{ from = \"gradients\", max_age = \"1min\" }}, truth = \"drift.{{axis}}\" }}\n"
    ));
    assert!(read.plan.is_some() && !read.diagnostics.has_errors());
    read.told()
}

#[test]
fn integrating_another_horizon_than_half_the_span_is_warned_of() {
    assert_eq!(told_of("150s"), "");
    let told = told_of("0s");
    assert!(told.starts_with("warning[A065]"), "{told}");
    assert!(
        told.contains("looks 0s ahead") && told.contains("predict `ahead = \"150s\"`"),
        "{told}"
    );
}
