//! What is mirrored of a tick where it is not stepped again.

use std::sync::{Arc, Mutex};

use athermal::core::prng::Prng;
use athermal::run::live::{LiveOptions, Slots, pair};
use athermal::run::score::link;
use athermal::serve::service::PredictionErrors;

use super::course::rows;
use super::model::model;

const DIE_TESTER: &str = include_str!("../../../graphs/die-tester.toml");

/// What is put out, and all that predicts with its truths, to the bit.
fn made(outputs: &[f64], plan: &athermal::core::compile::Plan, at: &impl Slots) -> Vec<u64> {
    let slots = (0..plan.channels.len()).filter_map(|slot| Some([slot, link(plan, slot)?.slot]));
    let slots = slots.flatten();
    let values = slots.flat_map(|slot| [at.value(slot), f64::from(u8::from(at.ran(slot)))]);
    outputs
        .iter()
        .copied()
        .chain(values)
        .map(f64::to_bits)
        .collect()
}

#[test]
fn what_is_mirrored_of_a_tick_is_what_the_engine_made_and_it_is_stepped_again_only_for_what_is_staged()
 {
    let (first, second) = (model(DIE_TESTER, "0"), model(DIE_TESTER, "1"));
    let options = LiveOptions {
        mirrors: false,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&first, options).unwrap();
    let seen = Arc::<Mutex<Vec<(Vec<u64>, bool)>>>::default();
    let errors = Arc::<Mutex<(PredictionErrors, PredictionErrors)>>::default();
    let (looking, scoring) = (Arc::clone(&seen), Arc::clone(&errors));
    control.look_on(move |tick| {
        let values = made(tick.outputs, tick.plan, tick);
        looking
            .lock()
            .unwrap()
            .push((values, tick.engine.is_some()));
        scoring.lock().unwrap().0.look(tick);
    });
    let mut expected = Vec::new();
    let channels = stepper.feed().len();
    for (nth, (time, row)) in rows(&mut Prng::stream(9, "rows"), channels, 6, 900)
        .into_iter()
        .enumerate()
    {
        match nth {
            400 => {
                while control.stage(&second, false).is_err() {
                    assert!(stepper.mirror());
                }
                control.commit().unwrap();
            }
            600 => stepper.segment(),
            _ => {}
        }
        stepper.step(time, &row).unwrap();
        control.pump();
        let engine = stepper.engine();
        expected.push(made(engine.outputs(), engine.plan(), engine));
        let tick = athermal::run::live::TickView::of(time, engine);
        errors.lock().unwrap().1.look(&tick);
    }
    let (values, again): (Vec<_>, Vec<_>) = seen.lock().unwrap().iter().cloned().unzip();
    assert_eq!(values.len(), expected.len());
    let differs = values
        .iter()
        .zip(&expected)
        .position(|(one, other)| one != other);
    assert_eq!(differs, None);
    assert!(!again[399] && again[401], "{again:?}");
    let errors = errors.lock().unwrap();
    let rmse = |of: &PredictionErrors| {
        of.iter()
            .map(|of| (of.name.clone(), of.rmse()))
            .collect::<Vec<_>>()
    };
    assert_eq!(rmse(&errors.0), rmse(&errors.1));
    assert!(rmse(&errors.0).iter().any(|(_, of)| of.is_some()));
}

#[test]
fn where_ticks_come_fast_they_get_more_room_and_none_is_missed_on_the_way() {
    let graph = model(DIE_TESTER, "0");
    let options = LiveOptions {
        mirrors: false,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&graph, options).unwrap();
    let seen = Arc::<Mutex<Vec<athermal::Instant>>>::default();
    let looking = Arc::clone(&seen);
    control.look_on(move |tick| looking.lock().unwrap().push(tick.at));
    let channels = stepper.feed().len();
    let data = rows(&mut Prng::stream(4, "rows"), channels, 6, 5_000);
    let times: Vec<_> = data.iter().map(|(at, _)| *at).collect();
    let mut notices = Vec::new();
    std::thread::scope(|scope| {
        let engine = scope.spawn(|| {
            for (nth, (at, row)) in data.iter().enumerate() {
                stepper.step(*at, row).unwrap();
                if nth < 2_000 {
                    std::thread::sleep(std::time::Duration::from_micros(100));
                }
            }
        });
        while seen.lock().unwrap().len() < 1_500 {
            notices.extend(control.pump());
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        // Nobody looks for thousands of ticks.
        engine.join().unwrap();
    });
    notices.extend(control.pump());
    notices.extend(control.pump());
    assert_eq!(notices, []);
    assert!(*seen.lock().unwrap() == times);
    assert_eq!(stepper.missed(), 0);
}

#[test]
fn whoever_looks_on_sees_weights_and_deviations_that_nothing_reads_and_outputs_keep_their_bits() {
    let (first, second) = (model(DIE_TESTER, "0"), model(DIE_TESTER, "1"));
    let options = LiveOptions {
        mirrors: true,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(&first, options).unwrap();
    let mut alone = first.engine().unwrap();
    let seen = Arc::<Mutex<(usize, usize, usize, usize)>>::default();
    let looking = Arc::clone(&seen);
    control.look_on(move |tick| {
        let mut seen = looking.lock().unwrap();
        let Some(engine) = tick.engine else { return };
        let slots = |port: &str| {
            let of = tick.plan.nodes.iter().filter_map(|node| node.port(port));
            of.flatten().collect::<Vec<_>>()
        };
        let has_value = |slot: &&usize| !engine.value(**slot).is_nan();
        seen.0 += slots("weights").iter().filter(has_value).count();
        // These fits know of no deviation, which is asked for all the same.
        let ran = |slot: &&usize| engine.ran(**slot);
        seen.1 += slots("std_dev").iter().filter(ran).count();
        for output in &tick.plan.outputs {
            let Some(parts) = engine.contributions(output.slot) else {
                continue;
            };
            let sum: f64 = parts.iter().map(|of| of.value).sum();
            let size: f64 = parts.iter().map(|of| of.value.abs()).sum();
            assert!(
                (sum - engine.value(output.slot)).abs() <= 1e-12 * size,
                "{parts:?}"
            );
            let explained = parts.iter().filter(|of| of.regressor.is_some());
            seen.2 += explained.count();
            let voters: std::collections::BTreeSet<_> = parts.iter().map(|of| of.node).collect();
            seen.3 += usize::from(voters.len() > 1);
        }
    });
    let channels = stepper.feed().len();
    let data = rows(&mut Prng::stream(9, "rows"), channels, 6, 900);
    for (nth, (time, row)) in data.into_iter().enumerate() {
        match nth {
            400 => {
                control.stage(&second, false).unwrap();
                control.commit().unwrap();
            }
            600 => control.rollback().unwrap(),
            _ => {}
        }
        let outputs = stepper.step(time, &row).unwrap().outputs.to_vec();
        let expected = alone.step(time, &row).unwrap();
        let bits = |of: &[f64]| of.iter().map(|of| of.to_bits()).collect::<Vec<_>>();
        // The graph that was taken back is as if it had never been replaced.
        if !(400..601).contains(&nth) {
            assert_eq!(bits(&outputs), bits(expected), "at row {nth}");
        }
        control.pump();
        if [399, 599, 899].contains(&nth) {
            let (weights, deviations, parts, votes) = std::mem::take(&mut *seen.lock().unwrap());
            assert!(
                weights > 100 && deviations > 100,
                "{nth}: {weights} {deviations}"
            );
            assert!(parts > 100 && votes > 10, "{nth}: {parts} {votes}");
        }
    }
}
