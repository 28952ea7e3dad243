//! In the steady state a tick of a shipped graph allocates nothing.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use crate::workbench::graphs;
use athermal::core::compile::Plan;
use athermal::core::node::NodeKind;
use athermal::core::registry::all;
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::Table;
use athermal::{Duration, Instant, Model};

/// The time between ticks: ten seconds, or so much that the longest window is long over when a graph counts as warm.
fn step(plan: &Plan) -> Duration {
    let spans = plan.channels.iter().map(|channel| channel.channel.span);
    let longest = spans.max().unwrap_or(Duration::ZERO);
    Duration::from_ns((longest.as_ns() / 200).max(10_000_000_000))
}

fn at(plan: &Plan, tick: i64) -> Instant {
    Instant::from_ns(tick * step(plan).as_ns())
}

/// Temperatures swing at every tick; everything else follows them and is measured at every third.
fn samples(plan: &Plan, tick: i64) -> Vec<f64> {
    let t = tick as f64 / 100.0;
    let swing = |i: usize| ((1.0 + 0.3 * i as f64) * t).sin() + ((0.21 + 0.1 * i as f64) * t).cos();
    let sources = plan.sources.iter().enumerate();
    sources
        .map(|(i, source)| {
            if source.name.starts_with("temperature") {
                25.0 + swing(i)
            } else if tick % 3 == 0 {
                0.1 * swing(0) + 0.01 * swing(i)
            } else {
                f64::NAN
            }
        })
        .collect()
}

fn fitted(path: &Path) -> Model {
    let mut model = Model::load(path).unwrap();
    let plan = Arc::clone(&model.plan);
    let mut log = Table::default();
    for tick in 0..3_000 {
        log.push(at(&plan, tick), &samples(&plan, tick));
    }
    model.fitted = fit(&plan, &log, &FitOptions::default(), &mut |_| ())
        .unwrap()
        .0;
    model
}

#[test]
fn a_tick_of_every_shipped_graph_allocates_nothing_once_warm() {
    let graphs = graphs("graphs");
    assert!(!graphs.is_empty());
    let mut stepped = BTreeSet::new();
    for path in graphs {
        let model = fitted(&path);
        stepped.extend(model.plan.nodes.iter().map(|node| node.kind.name));
        let mut engine = model.engine().unwrap();
        let ticks: Vec<_> = (0..4_000)
            .map(|tick| (at(&model.plan, tick), samples(&model.plan, tick)))
            .collect();
        let (warm, steady) = ticks.split_at(2_000);
        for (time, samples) in warm {
            engine.step(*time, samples).unwrap();
        }
        let mut predicted = 0_u64;
        let allocated = allocation_counter::measure(|| {
            for (time, samples) in steady {
                let outputs = engine.step(*time, samples).unwrap();
                predicted += u64::from(outputs.iter().any(|output| output.is_finite()));
            }
        });
        assert!(
            predicted > 1_500,
            "{}: only {predicted} predictions",
            path.display()
        );
        assert_eq!(
            allocated.count_total,
            0,
            "{}: {allocated:?}",
            path.display()
        );
    }
    // What stands between a prediction and a motor is shown in full.
    let of_control = all::<NodeKind>();
    for kind in of_control.filter(|kind| kind.package == "athermal-control") {
        assert!(
            stepped.contains(kind.name),
            "no shipped graph has a `{}`",
            kind.name
        );
    }
}
