//! An engine thread that steps while a control thread replaces the graph a hundred times.

use std::sync::atomic::{AtomicBool, Ordering};

use athermal::core::prng::Prng;
use athermal::run::live::{LiveOptions, Notice, pair};

use super::course::rows;
use super::model::{columns, d, model};

const GRAPH: &str = include_str!("../../../graphs/linear-axis.toml");

#[test]
fn a_hundred_swaps_from_another_thread_lose_nothing() {
    let with = |memory: &str| {
        let text = GRAPH.replace("memory = \"15min\"", &format!("memory = \"{memory}\""));
        model(
            &text.replace(
                "predicted = \"vote\"",
                "predicted = \"vote\"\ndrift = \"drift\"\nboth = \"both\"",
            ),
            "0",
        )
    };
    let graphs = [with("15min"), with("20min")];
    // Far more than a hundred swaps take, however slow the machine.
    let count = 4_000_000;
    let data = rows(&mut Prng::stream(3, "rows"), 7, 4, 4000);
    let mut alone = graphs[0].engine().unwrap();
    let names = columns(&graphs[0].plan);
    let untouched: Vec<_> = (0..names.len())
        .filter(|&i| !names[i].starts_with("predicted"))
        .collect();
    let (mut stepper, mut control) = pair(
        &graphs[0],
        LiveOptions {
            retain: d(600),
            ..LiveOptions::default()
        },
    )
    .unwrap();
    let done = AtomicBool::new(false);
    let ticks = std::thread::scope(|scope| {
        let engine = scope.spawn(|| {
            let mut ticks = 0u64;
            for turn in 0..count / data.len() {
                for (time, row) in &data {
                    let time = *time + d(turn as i64 * 40_000);
                    let expected = alone.step(time, row).unwrap();
                    let stepped = stepper.step(time, row).unwrap();
                    for &i in &untouched {
                        assert_eq!(
                            stepped.outputs[i].to_bits(),
                            expected[i].to_bits(),
                            "{} at tick {ticks}",
                            names[i]
                        );
                    }
                    ticks += 1;
                    std::thread::sleep(std::time::Duration::from_micros(500));
                    if done.load(Ordering::Acquire) {
                        return ticks;
                    }
                }
            }
            ticks
        });
        let mut taken = Vec::new();
        let mut turn = 0;
        while taken.len() < 100 && !engine.is_finished() {
            let mut told = control.pump();
            if control.staged().is_none() && control.stage(&graphs[(turn + 1) % 2], false).is_ok() {
                turn += 1;
            }
            if control.staged().is_some() {
                // One that was sent back is committed again.
                let _ = control.commit();
            }
            told.extend(control.pump());
            taken.extend(told.into_iter().filter_map(|notice| match notice {
                Notice::TookOver { tick, .. } => Some(tick),
                Notice::SentBack | Notice::Mirrored => None,
                Notice::Missed { ticks } => panic!("{ticks} ticks were missed"),
            }));
        }
        done.store(true, Ordering::Release);
        let ticks = engine.join().unwrap();
        assert!(taken.len() >= 100, "{}", taken.len());
        assert!(taken.is_sorted_by(|a, b| a < b));
        ticks
    });
    control.pump();
    assert_eq!(stepper.engine().state().tick(), ticks);
    assert_eq!(stepper.missed(), 0);
    assert_eq!(
        control.replica().unwrap().snapshot(),
        stepper.engine().snapshot()
    );
}
