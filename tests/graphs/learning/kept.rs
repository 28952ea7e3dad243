//! What was learned goes on to the last bit: through snapshots, model files, swaps and the mirror of the control thread.

use std::collections::BTreeMap;
use std::sync::Arc;

use athermal::core::engine::Engine;
use athermal::core::node::Predictor;
use athermal::core::prng::Prng;
use athermal::run::live::{LiveOptions, Notice, pair};
use athermal::{Instant, Model};

use super::world::{RLS, SGD, engine, fitted, graph, rows, run, same};
use crate::workbench::{Scratch, secs};

/// A model in a file of a test of its own.
fn model(test: &str, text: &str) -> Model {
    let scratch = Scratch::new(&format!("learning-{test}"));
    let mut model = Model::load(scratch.file("graph.toml", text)).unwrap();
    model.fitted = fitted(text).1;
    model
}

/// The same with another fit, of which only what is predicted without learning differs.
fn refitted(model: &Model) -> Model {
    let mut anew = model.clone();
    let mut other = serde_json::to_value(&*model.fitted["model"]).unwrap();
    other["intercept"] = serde_json::json!(77.0);
    let other: Box<dyn Predictor> = serde_json::from_value(other).unwrap();
    anew.fitted.insert("model".to_owned(), Arc::from(other));
    anew
}

#[test]
fn an_engine_goes_on_from_a_snapshot_with_what_was_learned() {
    for node in [RLS, SGD] {
        let rows = rows(8, 600, 200);
        let text = graph(&format!("{node}\ninputs.freeze = \"hold\""));
        let (plan, fit) = fitted(&text);
        let whole = run(&mut Engine::new(Arc::clone(&plan), &fit).unwrap(), 0, &rows);
        let mut random = Prng::stream(8, "cuts");
        let mut cut = Engine::new(Arc::clone(&plan), &fit).unwrap();
        for (tick, row) in rows.iter().enumerate() {
            if random.uniform() < 0.05 {
                let snapshot = cut.snapshot();
                cut = Engine::new(Arc::clone(&plan), &fit).unwrap();
                cut.restore(&snapshot).unwrap();
                assert_eq!(cut.snapshot(), snapshot);
            }
            let outputs = run(&mut cut, tick, &[*row]);
            assert!(same(&outputs, &whole[tick..=tick]), "{node} at row {tick}");
        }
    }
}

#[test]
fn that_learning_is_frozen_is_part_of_a_snapshot() {
    let rows = rows(9, 300, 100);
    let text = graph(RLS);
    let mut first = engine(&text);
    run(&mut first, 0, &rows[..150]);
    first.freeze(true);
    let mut second = engine(&text);
    second.restore(&first.snapshot()).unwrap();
    assert!(second.frozen());
    assert!(same(
        &run(&mut first, 150, &rows[150..]),
        &run(&mut second, 150, &rows[150..])
    ));
}

#[test]
fn a_segment_that_ends_right_after_a_restart_is_learned_from_as_without_it() {
    let text = graph(&format!("{RLS}\ninputs.freeze = \"hold\""));
    let mut first = engine(&text);
    run(&mut first, 0, &rows(15, 300, 100));
    let mut second = engine(&text);
    second.restore(&first.snapshot()).unwrap();
    first.segment();
    second.segment();
    assert_eq!(first.snapshot(), second.snapshot());
}

#[test]
fn a_fit_that_was_written_and_read_learns_with_the_same_bits() {
    let rows = rows(10, 500, 200);
    for node in [RLS, SGD] {
        let (plan, fit) = fitted(&graph(node));
        let read = |predictor: &Arc<dyn Predictor>| -> Arc<dyn Predictor> {
            let text = serde_json::to_string(&**predictor).unwrap();
            let back: Box<dyn Predictor> = serde_json::from_str(&text).unwrap();
            Arc::from(back)
        };
        let back: BTreeMap<_, _> = fit
            .iter()
            .map(|(node, p)| (node.clone(), read(p)))
            .collect();
        let a = run(&mut Engine::new(Arc::clone(&plan), &fit).unwrap(), 0, &rows);
        let b = run(&mut Engine::new(plan, &back).unwrap(), 0, &rows);
        assert!(same(&a, &b));
    }
}

#[test]
fn a_tick_that_learns_allocates_nothing_once_warm() {
    for node in [RLS, SGD] {
        let rows = rows(11, 1200, 600);
        let mut engine = engine(&graph(node));
        run(&mut engine, 0, &rows[..400]);
        let mut learned = 0;
        let allocated = allocation_counter::measure(|| {
            for (tick, row) in rows.iter().enumerate().skip(400) {
                let outputs = engine.step(secs(10.0 * tick as f64), row).unwrap();
                learned += usize::from(outputs[1] % 10.0 == 0.0);
            }
        });
        assert_eq!(allocated.count_total, 0, "{node}: {allocated:?}");
        assert!(learned > 600, "{learned}");
    }
}

#[test]
fn a_swap_carries_what_was_learned_unless_the_fit_is_new_and_not_told_to() {
    let text = graph(RLS);
    let rows = rows(12, 900, 200);
    let old = model("carry-old", &text);
    let retuned = model("carry-retuned", &text.replace("500s", "400s"));
    // What was learned for one horizon is no answer for another.
    let farther = model(
        "carry-farther",
        &text.replace("ahead = \"20s\"", "ahead = \"30s\""),
    );
    let anew = refitted(&old);
    for (new, learned, outcome, as_before) in [
        (&farther, true, "warmed", false),
        (&old, false, "carried", true),
        (&retuned, false, "warmed", false),
        (&retuned, true, "adopted", false),
        (&anew, false, "warmed", false),
        (&anew, true, "adopted", true),
    ] {
        let (mut stepper, mut control) = pair(&old, LiveOptions::default()).unwrap();
        let mut alone = old.engine().unwrap();
        let mut unlike = 0;
        for (tick, row) in rows.iter().enumerate() {
            if tick == 600 {
                let staged = control.stage(new, learned).unwrap();
                let carry = serde_json::to_value(&staged.carry()[0].outcome).unwrap();
                assert_eq!(carry["carry"], outcome, "{carry}");
                control.commit().unwrap();
            }
            let time = secs(10.0 * tick as f64);
            let shown = stepper.step(time, row).unwrap().outputs[0];
            let expected = alone.step(time, row).unwrap()[0];
            unlike += usize::from(shown.to_bits() != expected.to_bits());
            control.pump();
        }
        assert_eq!(unlike == 0, as_before, "{outcome}: {unlike}");
    }
}

#[test]
fn a_replica_freezes_when_the_engine_does() {
    let rows = rows(14, 600, 100);
    let (mut stepper, mut control) =
        pair(&model("replica", &graph(RLS)), LiveOptions::default()).unwrap();
    for (tick, row) in rows.iter().enumerate() {
        match tick {
            200 => stepper.freeze(true),
            400 => stepper.freeze(false),
            _ => {}
        }
        let time: Instant = secs(10.0 * tick as f64);
        stepper.step(time, row).unwrap();
        control.pump();
        if tick % 50 == 0 {
            let replica = control.replica().unwrap();
            assert_eq!(replica.frozen(), (200..400).contains(&tick));
            assert_eq!(replica.snapshot(), stepper.engine().snapshot());
        }
    }
}

#[test]
fn a_graph_that_takes_over_is_frozen_although_the_command_was_missed() {
    let rows = rows(16, 60, 30);
    let model = model("missed", &graph(RLS));
    let options = LiveOptions {
        mirrored: 4,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&model, options).unwrap();
    let mut took_over = 0;
    for (tick, row) in rows.iter().enumerate() {
        match tick {
            20 => stepper.freeze(true),
            40 => {
                control.stage(&model, false).unwrap();
                control.commit().unwrap();
            }
            _ => {}
        }
        stepper.step(secs(10.0 * tick as f64), row).unwrap();
        // For a while nobody looks.
        if !(10..30).contains(&tick) {
            let notices = control.pump();
            let swaps = notices
                .iter()
                .filter(|notice| matches!(notice, Notice::TookOver { .. }));
            took_over += swaps.count();
        }
    }
    assert!(stepper.missed() > 0);
    assert_eq!(took_over, 1);
    assert!(stepper.engine().frozen());
}
