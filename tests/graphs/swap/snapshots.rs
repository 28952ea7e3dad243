//! An engine that goes on from a snapshot gives the same bits as one that never stopped.

use athermal::core::engine::RestoreError;
use athermal::core::prng::Prng;

use super::course::rows;
use super::model::{Happening, bits, columns, model, run, s};
use super::random_graph::{Graph, feed, happenings};

#[test]
fn any_random_graph_goes_on_with_the_same_bits_from_any_tick() {
    for seed in 0..60 {
        let mut random = Prng::stream(seed, "snapshots");
        let built = model(&Graph::random(&mut random).text(None), "0");
        let data = happenings(&mut random, 120);
        let expected = run(&built, &feed(), &data);
        let names = columns(&built.plan);
        let order: Vec<_> = built
            .plan
            .sources
            .iter()
            .map(|source| feed().iter().position(|f| *f == source.name).unwrap())
            .collect();
        let mut engine = built.engine().unwrap();
        let mut row = 0;
        for happening in &data {
            if random.uniform() < 0.2 {
                let snapshot = engine.snapshot();
                engine = built.engine().unwrap();
                engine.restore(&snapshot).unwrap();
                assert_eq!(engine.snapshot(), snapshot);
            }
            match happening {
                Happening::Break => engine.segment(),
                Happening::Row(time, samples) => {
                    let samples: Vec<_> = order.iter().map(|&place| samples[place]).collect();
                    let found = bits(&names, engine.step(*time, &samples).unwrap());
                    assert_eq!(found, expected[row], "seed {seed}, row {row}");
                    row += 1;
                }
            }
        }
    }
}

#[test]
fn every_graph_that_comes_with_the_program_goes_on_with_the_same_bits() {
    for (name, temperatures) in [
        ("die-tester", 6),
        ("die-tester-compensate", 6),
        ("die-tester-sensor", 6),
        ("linear-axis", 4),
        ("linear-axis-compensate", 4),
        ("linear-axis-sensor", 4),
        ("z-probe", 3),
    ] {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("graphs/{name}.toml"));
        let built = model(&std::fs::read_to_string(path).unwrap(), "0");
        let mut random = Prng::stream(7, name);
        let channels = built.plan.sources.len();
        let (mut whole, mut cut) = (built.engine().unwrap(), built.engine().unwrap());
        let mut predicted = 0;
        for (time, row) in rows(&mut random, channels, temperatures, 450) {
            if random.uniform() < 0.02 {
                let snapshot = cut.snapshot();
                cut = built.engine().unwrap();
                cut.restore(&snapshot).unwrap();
            }
            let expected: Vec<_> = whole
                .step(time, &row)
                .unwrap()
                .iter()
                .map(|v| v.to_bits())
                .collect();
            let found: Vec<_> = cut
                .step(time, &row)
                .unwrap()
                .iter()
                .map(|v| v.to_bits())
                .collect();
            assert_eq!(found, expected, "{name} at {time:?}");
            predicted += usize::from(!cut.outputs()[0].is_nan());
        }
        assert!(predicted > 100, "{name} predicts");
    }
}

#[test]
fn what_does_not_fit_is_refused_and_the_engine_is_as_it_was() {
    let text = Graph::random(&mut Prng::stream(1, "refused")).text(None);
    let built = model(&text, "0");
    let samples = vec![21.0; built.plan.sources.len()];
    let mut engine = built.engine().unwrap();
    engine.step(s(1), &samples).unwrap();
    let before = engine.snapshot();
    for place in 0..before.len() {
        let mut damaged = before.clone();
        damaged[place] ^= 1 << (place % 8);
        let error = engine.restore(&damaged).unwrap_err();
        let expected = if place < 16 {
            RestoreError::NotASnapshot
        } else {
            RestoreError::Damaged
        };
        assert_eq!(error, expected);
    }
    for length in 0..before.len() {
        assert!(engine.restore(&before[..length]).is_err());
    }
    let mut fitted_anew = model(&text, "1").engine().unwrap();
    assert!(matches!(
        fitted_anew.restore(&before),
        Err(RestoreError::OtherGraph { .. })
    ));
    let other = model(
        &text.replace("[\"-20 Cel\", \"200 Cel\"]", "[\"-20 Cel\", \"199 Cel\"]"),
        "0",
    );
    let error = other.engine().unwrap().restore(&before).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("load the model that it was taken of"),
        "{error}"
    );
    assert_eq!(engine.snapshot(), before);
}
