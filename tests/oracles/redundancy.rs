//! `graphs/die-tester-redundant.toml` outlives any one of its sensors, and the positions for a while: the vote goes on, at
//! most half as large again in its error, and what does not depend on the lost sensor keeps its bits.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use crate::workbench::{data, graph, slot};
use athermal::core::compile::Plan;
use athermal::core::engine::Fitted;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Table};
use athermal::{Engine, Model};

const SENSORS: [&str; 6] = ["plate1", "holder1", "plate2", "holder2", "room", "chuck"];
const AXES: [&str; 6] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
const VOTERS: [&str; 3] = ["side2", "surroundings", "motion"];
const AHEAD: f64 = 300.0;
const LIMIT: f64 = 250.0;

struct Setting {
    plan: Arc<Plan>,
    fitted: Fitted,
    test: Table,
    undisturbed: Outcome,
}

/// All that the estimators and the vote said, by channel: the instant and value of each run.
struct Outcome {
    runs: BTreeMap<String, Vec<(f64, f64)>>,
    drifts: BTreeMap<&'static str, Vec<(f64, f64)>>,
    rejected: u64,
}

fn setting() -> Option<&'static Setting> {
    static SETTING: OnceLock<Option<Setting>> = OnceLock::new();
    let setting = SETTING.get_or_init(|| {
        let folder = data()?.join("die-tester");
        let plan = Model::load(graph("die-tester-redundant")).unwrap().plan;
        let file = |name: &str| Dataset::new(vec![folder.join(name)], Options::default());
        let (fitted, _) = fit(
            &plan,
            &file("train.csv"),
            &FitOptions::default(),
            &mut |_| {},
        )
        .unwrap();
        let test = Table::read(&file("test.csv"), &plan).unwrap();
        let undisturbed = run(&plan, &fitted, &test);
        Some(Setting {
            plan,
            fitted,
            test,
            undisturbed,
        })
    });
    setting.as_ref()
}

fn run(plan: &Arc<Plan>, fitted: &Fitted, table: &Table) -> Outcome {
    let mut engine = Engine::new(Arc::clone(plan), fitted).unwrap();
    let watched: Vec<(String, usize)> = plan
        .channels
        .iter()
        .enumerate()
        .filter(|(_, channel)| channel.predicts.is_some())
        .map(|(slot, channel)| (channel.name.clone(), slot))
        .collect();
    let truths = AXES.map(|axis| (axis, slot(plan, &format!("drift.{axis}"))));
    let mut runs: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
    let mut drifts: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for (event, values) in table.events() {
        let Event::Row(time) = *event else {
            panic!("one segment")
        };
        engine.step(time, values).unwrap();
        let now = time.as_ns() as f64 / 1e9;
        for (name, slot) in &watched {
            if engine.ran(*slot) {
                runs.entry(name.clone())
                    .or_default()
                    .push((now, engine.value(*slot)));
            }
        }
        for (axis, slot) in truths {
            if !engine.value(slot).is_nan() {
                drifts
                    .entry(axis)
                    .or_default()
                    .push((now, engine.value(slot)));
            }
        }
    }
    Outcome {
        runs,
        drifts,
        rejected: engine.rejected().iter().sum(),
    }
}

/// The share of truths below the limit for which there is a vote, and the vote's root mean square error.
fn vote(outcome: &Outcome, axis: &str) -> (f64, f64) {
    let runs = &outcome.runs[&format!("vote.{axis}")];
    let (mut counted, mut errors) = (0, Vec::new());
    for &(at, truth) in outcome.drifts[axis]
        .iter()
        .filter(|(_, truth)| truth.abs() < LIMIT)
    {
        counted += 1;
        let before = runs.partition_point(|(ran, _)| *ran <= at - AHEAD);
        let last = before.checked_sub(1).map(|nth| runs[nth]);
        let valid = last.filter(|(ran, value)| at - AHEAD - ran <= 300.0 && !value.is_nan());
        errors.extend(valid.map(|(_, value)| value - truth));
    }
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    (
        errors.len() as f64 / f64::from(counted),
        (squares / errors.len() as f64).sqrt(),
    )
}

/// The test recording with one sensor changed: `change` is given the instant and the value.
fn changed(setting: &Setting, channel: &str, change: impl Fn(f64, f64) -> f64) -> Outcome {
    let mut table = setting.test.clone();
    let slot = slot(&setting.plan, channel);
    for (event, values) in table.events_mut() {
        let Event::Row(time) = *event else {
            panic!("one segment")
        };
        values[slot] = change(time.as_ns() as f64 / 1e9, values[slot]);
    }
    run(&setting.plan, &setting.fitted, &table)
}

#[track_caller]
fn check_vote(setting: &Setting, disturbed: &Outcome, worse: f64, what: &str) {
    for axis in AXES {
        let (valid, rmse) = vote(disturbed, axis);
        let (_, undisturbed) = vote(&setting.undisturbed, axis);
        println!("{what}: vote.{axis} valid {valid:.4}, RMSE {rmse:.2} of {undisturbed:.2}");
        assert!(
            valid >= 0.99,
            "{what}: vote.{axis} is valid at {valid} of the instants"
        );
        assert!(
            rmse <= worse * undisturbed,
            "{what}: vote.{axis} has {rmse}, undisturbed {undisturbed}"
        );
    }
}

fn bits(outcome: &Outcome, channel: &str) -> Vec<(u64, u64)> {
    outcome.runs[channel]
        .iter()
        .map(|(at, value)| (at.to_bits(), value.to_bits()))
        .collect()
}

/// Whether an instance uses a sensor.
fn uses(setting: &Setting, instance: &str, sensor: &str) -> bool {
    let predictor = &setting.fitted[instance];
    predictor
        .uses()
        .iter()
        .any(|regressor| regressor.contains(&format!(".{sensor}@")))
}

#[test]
fn reference_undisturbed_the_redundant_vote_is_as_good_as_the_plain_one() {
    let Some(setting) = setting() else { return };
    // The vote of the plain forecast on the page of the data; it has an ARX voter beside.
    let plain = [6.77, 7.13, 31.93, 6.79, 6.17, 26.93];
    for (axis, plain) in AXES.into_iter().zip(plain) {
        let (valid, rmse) = vote(&setting.undisturbed, axis);
        assert!(
            valid >= 0.99 && rmse <= 1.05 * plain,
            "vote.{axis}: {rmse} against {plain}, valid {valid}"
        );
    }
}

#[test]
fn no_sensor_feeds_two_voters_and_each_feeds_one() {
    let model = Model::load(graph("die-tester-redundant")).unwrap();
    for sensor in SENSORS {
        let name = format!(".{sensor}@");
        let mut fed = Vec::new();
        for node in model
            .plan
            .nodes
            .iter()
            .filter(|node| node.member.as_deref() == Some("Z1"))
        {
            if let athermal::core::compile::PlannedRole::Estimator { fit, .. } = &node.role
                && fit
                    .regressors
                    .iter()
                    .any(|regressor| regressor.name.contains(&name))
            {
                fed.push(node.name.as_str());
            }
        }
        assert_eq!(fed.len(), 1, "{sensor} feeds {fed:?}");
    }
}

#[test]
fn reference_any_one_sensor_may_be_dead_from_the_start() {
    let Some(setting) = setting() else { return };
    let (mut kept, mut lost) = (0, 0);
    for sensor in SENSORS {
        let dead = changed(setting, &format!("temperature.{sensor}"), |_, _| f64::NAN);
        check_vote(setting, &dead, 1.5, &format!("{sensor} dead"));
        for voter in VOTERS {
            for axis in AXES {
                let instance = format!("{voter}.{axis}");
                if uses(setting, &instance, sensor) {
                    assert!(
                        dead.runs[&instance].iter().all(|(_, value)| value.is_nan()),
                        "{instance} without {sensor}"
                    );
                    lost += 1;
                } else {
                    let same = bits(&dead, &instance) == bits(&setting.undisturbed, &instance);
                    assert!(same, "{instance} does not depend on {sensor}");
                    kept += 1;
                }
            }
        }
    }
    assert_eq!(kept + lost, 6 * 6 * 3);
    assert!(lost >= 12 && kept >= 72, "{lost} lost and {kept} kept");
}

#[test]
fn reference_a_constant_far_out_of_range_is_as_good_as_a_dead_sensor() {
    let Some(setting) = setting() else { return };
    for sensor in ["chuck", "holder2"] {
        let channel = format!("temperature.{sensor}");
        let dead = changed(setting, &channel, |_, _| f64::NAN);
        let broken = changed(setting, &channel, |_, value| {
            if value.is_nan() { value } else { -180.0 }
        });
        check_vote(setting, &broken, 1.5, &format!("{sensor} at −180 °C"));
        assert!(broken.rejected > 20_000);
        for channel in dead.runs.keys() {
            assert!(bits(&dead, channel) == bits(&broken, channel), "{channel}");
        }
    }
}

#[test]
fn reference_a_sensor_that_sticks_within_its_range_does_not_lead_the_vote_astray() {
    let Some(setting) = setting() else { return };
    for sensor in SENSORS {
        let channel = format!("temperature.{sensor}");
        let stuck = changed(
            setting,
            &channel,
            |_, value| if value.is_nan() { value } else { 21.5 },
        );
        check_vote(setting, &stuck, 1.5, &format!("{sensor} stuck"));
    }
}

#[test]
fn reference_a_spike_or_an_infinity_costs_one_sample() {
    let Some(setting) = setting() else { return };
    for wrong in [1e9, f64::INFINITY] {
        let spiked = changed(setting, "temperature.chuck", |now, value| {
            if now == 90_000.0 { wrong } else { value }
        });
        let missing = changed(setting, "temperature.chuck", |now, value| {
            if now == 90_000.0 { f64::NAN } else { value }
        });
        assert_eq!(spiked.rejected, 1);
        check_vote(setting, &spiked, 1.01, &format!("{wrong} of the chuck"));
        for channel in spiked.runs.keys() {
            assert!(
                bits(&spiked, channel) == bits(&missing, channel),
                "{channel} after {wrong}"
            );
        }
    }
}

#[test]
fn reference_positions_may_be_gone_for_six_hours() {
    let Some(setting) = setting() else { return };
    let (from, to) = (80_000.0, 80_000.0 + 6.0 * 3600.0);
    let mut table = setting.test.clone();
    let slots = AXES.map(|axis| slot(&setting.plan, &format!("position.{axis}")));
    for (event, values) in table.events_mut() {
        let Event::Row(time) = *event else {
            panic!("one segment")
        };
        if (from..to).contains(&(time.as_ns() as f64 / 1e9)) {
            slots.iter().for_each(|&slot| values[slot] = f64::NAN);
        }
    }
    let gone = run(&setting.plan, &setting.fitted, &table);
    check_vote(setting, &gone, 1.5, "positions gone");
    for axis in AXES {
        for voter in ["side2", "surroundings"] {
            let channel = format!("{voter}.{axis}");
            let values = |outcome: &Outcome| {
                outcome.runs[&channel]
                    .iter()
                    .map(|(_, value)| value.to_bits())
                    .collect::<Vec<_>>()
            };
            assert!(
                values(&gone) == values(&setting.undisturbed),
                "{channel} does not depend on positions"
            );
        }
        // All through the gap there is a vote, from the temperatures alone, against the drift that was there all the same.
        let runs = &gone.runs[&format!("vote.{axis}")];
        let within = runs.iter().filter(|(at, _)| (from..to).contains(at));
        let (ran, valid) = within.fold((0, 0), |(ran, valid), (_, value)| {
            (ran + 1, valid + u32::from(!value.is_nan()))
        });
        assert!(ran >= 2160 && valid == ran, "vote.{axis}: {valid} of {ran}");
        let unseen = Outcome {
            runs: gone.runs.clone(),
            drifts: BTreeMap::from([(
                axis,
                setting.undisturbed.drifts[axis]
                    .iter()
                    .copied()
                    .filter(|(at, _)| (from + AHEAD..to).contains(at))
                    .collect(),
            )]),
            rejected: 0,
        };
        let seen = Outcome {
            runs: setting.undisturbed.runs.clone(),
            drifts: unseen.drifts.clone(),
            rejected: 0,
        };
        let ((_, blind), (_, sighted)) = (vote(&unseen, axis), vote(&seen, axis));
        assert!(
            blind <= 1.5 * sighted,
            "vote.{axis} within the gap: {blind} against {sighted}"
        );
    }
}
