//! Which rows and candidates a fit takes, and what estimators fed by estimators learn from.

use std::sync::Arc;

use athermal::core::compile::Plan;
use athermal::run::fit::{EstimatorFit, FitOptions, Outcome, fit};
use athermal::run::recording::{Event, Table};
use athermal::{Engine, Instant};

use super::{samples, slopes};
use crate::workbench::{Graph, plan, problems, slot};

/// A number between −1 and 1 that looks random.
fn noise(seed: u32) -> f64 {
    let mut bits = seed.wrapping_add(0x9e37_79b9).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    bits ^= bits >> 16;
    f64::from(bits >> 8) / f64::from(1_u32 << 23) - 1.0
}

/// 2,000 rows, ten seconds apart: two wandering temperatures, and a position that follows them.
pub(super) fn recording() -> Table {
    let mut table = Table::default();
    let (mut room, mut chuck) = (21.0, 30.0);
    for tick in 0..2000_u32 {
        room += 0.1 * noise(3 * tick);
        chuck += 0.2 * noise(3 * tick + 1);
        let position = 40.0 * room - 25.0 * chuck + 5.0 * noise(3 * tick + 2);
        table.push(
            Instant::from_ns(i64::from(tick) * 10_000_000_000),
            &[room, chuck, position],
        );
    }
    table
}

fn fitted(plan: &Arc<Plan>, table: &Table) -> EstimatorFit {
    let (_, mut report) = fit(plan, table, &FitOptions::default(), &mut |_| {}).unwrap();
    report.estimators.remove(0)
}

fn thermal() -> Arc<Plan> {
    plan(
        &slopes()
            .model("thermal", "linear", "gradients", "drift.Z", "0s")
            .with("train.abs_truth = { below = '1 m/min', above = '0.5 nm/min' }")
            .outputs("out = 'thermal'"),
    )
}

#[test]
fn a_column_of_nothing_costs_no_rows_and_is_named() {
    let plan = thermal();
    let whole = fitted(&plan, &recording());
    assert!(
        whole.dropped_candidates.is_empty() && whole.rows > 1500,
        "{whole:?}"
    );
    // 195 of 2,000 samples: two in three windows of 150 s keep a value, and no row is lost for the third.
    for alive in [0, 3] {
        let mut table = recording();
        for (tick, (_, values)) in table.events_mut().iter_mut().enumerate() {
            if alive == 0 || tick / 200 % alive == 0 {
                values[1] = f64::NAN;
            }
        }
        let holed = fitted(&plan, &table);
        assert_eq!(holed.rows, whole.rows, "not a row less");
        assert_eq!(holed.dropped, whole.dropped);
        let names: Vec<_> = holed
            .dropped_candidates
            .iter()
            .map(|(name, _)| name.as_str())
            .collect();
        assert_eq!(names, ["gradients.chuck"]);
        let share = holed.dropped_candidates[0].1;
        assert!(share < 0.9 && (alive == 0) == (share == 0.0), "{share}");
    }
}

fn notes(fit: &EstimatorFit) -> &[String] {
    match &fit.outcome {
        Outcome::Fitted(report) => &report.notes,
        Outcome::Failed(error) => panic!("{error}"),
    }
}

#[test]
fn a_candidate_there_in_nine_of_ten_rows_stays_and_costs_the_tenth() {
    let plan = thermal();
    let whole = fitted(&plan, &recording());
    let mut table = recording();
    for (_, values) in &mut table.events_mut()[1000..1080] {
        values[1] = f64::NAN;
    }
    let holed = fitted(&plan, &table);
    assert!(holed.dropped_candidates.is_empty(), "{holed:?}");
    assert_eq!(
        holed.rows + holed.dropped.incomplete,
        whole.rows + whole.dropped.incomplete
    );
    assert!(holed.dropped.incomplete > 40, "{holed:?}");
    let told = format!(
        "many rows are incomplete for want of a value from temperature.chuck ({})",
        holed.dropped.incomplete
    );
    assert_eq!(notes(&holed), [told]);
    assert_eq!(notes(&whole), [""; 0]);
}

#[test]
fn a_window_that_is_still_cold_does_not_speak_against_its_candidate() {
    // Windows of 150 s and of an hour: a fifth of the rows comes before the long one is warm.
    let text = slopes()
        .model("thermal", "linear", "gradients", "drift.Z", "0s")
        .outputs("out = 'thermal'")
        .replace("[\"150s\"]", "[\"150s\", \"1h\"]");
    let fit = fitted(&plan(&text), &recording());
    assert!(fit.dropped_candidates.is_empty(), "{fit:?}");
    // Drift exists from 300 s, the long slopes from 3,600 s.
    assert_eq!((fit.rows, fit.dropped.incomplete), (2000 - 360, 330));
    assert_eq!(notes(&fit), [""; 0]);
}

#[test]
fn only_truths_within_the_limits_are_fitted_on() {
    let text = |limits: &str| {
        slopes()
            .model("thermal", "linear", "gradients", "drift.Z", "0s")
            .with(&format!("train.abs_truth = {limits}"))
            .outputs("out = 'thermal'")
    };
    let all = fitted(&plan(&text("{}")), &recording());
    let below = fitted(&plan(&text("{ below = \"0.005 um/min\" }")), &recording());
    let above = fitted(&plan(&text("{ above = \"5 nm/min\" }")), &recording());
    assert!(
        below.rows > 100 && above.rows > 100,
        "{} {}",
        below.rows,
        above.rows
    );
    assert_eq!(
        below.rows + above.rows,
        all.rows,
        "5 nm/min belong to one side, whatever the unit"
    );
    assert_eq!(below.dropped.outside_limits, above.rows);
}

#[test]
fn an_estimator_fed_by_another_learns_from_predictions_of_rows_that_the_other_has_not_seen() {
    let of = |graph: Graph, name: &str, features: &str| {
        let model = graph.model(name, "linear", features, "position.Z", "0s");
        model.with("solver = { type = 'ols' }")
    };
    let first = of(samples(), "first", "temperature");
    let second = of(first.clone(), "second", "first");
    let both = plan(&second.outputs("out = 'second'"));
    let alone = plan(&first.outputs("out = 'first'"));
    // Few rows and steps between the folds, so that it matters whose rows the first has seen.
    let mut table = Table::default();
    for (tick, (event, values)) in recording().events()[..60].iter().enumerate() {
        let Event::Row(now) = *event else {
            unreachable!()
        };
        let step = [0.0, 40.0, -15.0][tick / 20];
        table.push(now, &[values[0], values[1], values[2] + step]);
    }
    let (model, report) = fit(&both, &table, &FitOptions::default(), &mut |_| {}).unwrap();
    assert_eq!(report.estimators.len(), 2);

    // By hand: for each third, the first is fitted on a recording in which the truths of that third are missing.
    let mut rows = Vec::new();
    for third in 0..3 {
        let inside = 20 * third..20 * (third + 1);
        let mut without = table.clone();
        for (_, values) in &mut without.events_mut()[inside.clone()] {
            values[2] = f64::NAN;
        }
        let (part, _) = fit(&alone, &without, &FitOptions::default(), &mut |_| {}).unwrap();
        let mut engine = Engine::new(Arc::clone(&alone), &part).unwrap();
        for (tick, (event, values)) in table.events().iter().enumerate() {
            let Event::Row(now) = *event else {
                unreachable!()
            };
            engine.step(now, values).unwrap();
            if inside.contains(&tick) {
                rows.push((engine.value(slot(&alone, "first.Z")), values[2]));
            }
        }
    }
    let n = rows.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|row| row.0), mean(|row| row.1));
    let slope = rows
        .iter()
        .map(|row| (row.0 - x) * (row.1 - y))
        .sum::<f64>()
        / rows.iter().map(|row| (row.0 - x).powi(2)).sum::<f64>();
    let intercept = y - slope * x;
    let second = &model["second"];
    let found = [
        second.predict(&[0.0]),
        second.predict(&[1.0]) - second.predict(&[0.0]),
    ];
    assert!(
        (found[1] - slope).abs() < 1e-6 * slope.abs(),
        "{found:?} for {slope}"
    );
    assert!(
        (found[0] - intercept).abs() < 1e-6 * intercept.abs(),
        "{found:?} for {intercept}"
    );
    assert!(
        (slope - 1.0).abs() > 1e-3,
        "in-sample predictions would give a slope of one"
    );
}

#[test]
fn any_number_of_threads_gives_the_same_fit_even_when_rows_hardly_fit_in_memory() {
    let text = slopes()
        .section("sets", "alpha = ['1', '2', '3', '5', '8', '13']")
        .model(
            "thermal",
            "linear",
            "gradients temperature",
            "drift.Z",
            "0s",
        )
        .with("each = 'alpha'; selection = { method = 'forward', folds = 3, tolerance = 1e-9 }")
        .outputs("out = 'thermal'");
    let plan = plan(&text);
    let table = recording();
    let fits = |threads: usize, memory: usize| {
        let options = FitOptions {
            threads,
            memory,
            ..FitOptions::default()
        };
        let (fitted, report) = fit(&plan, &table, &options, &mut |_| {}).unwrap();
        (format!("{fitted:?}"), format!("{:?}", report.estimators))
    };
    for memory in [64 << 20, 250_000, 100_000, 1000] {
        let one = fits(1, memory);
        assert_eq!(one, fits(2, memory), "with {memory} bytes of rows");
        assert_eq!(one, fits(6, memory), "with {memory} bytes of rows");
    }
}

#[test]
fn a_misspelt_key_that_the_framework_reads_is_put_right_too() {
    let node = "[nodes.model]\ntype = \"rls\"\ninputs = { features = \"gradients\", truth = \"drift.Z\" }\nahead = \"5min\"\n";
    for (wrong, right) in [
        ("lean = true", "learn"),
        ("trian.abs_truth = \"1 nm/min\"", "train"),
        ("eech = \"axis\"", "each"),
    ] {
        let outputs = "[outputs]\nmodel = \"model\"\n";
        let told = problems(&format!("{}{node}{wrong}\n{outputs}", slopes()));
        let help = format!("did you mean \"{right}\"?");
        assert!(told.contains(&help), "{told}");
    }
}
