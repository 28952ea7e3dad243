//! A machine that ages: the coefficients of its drift change by a fifth in a week.

use athermal_core::compile::Plan;
use athermal_core::engine::SampleRange;
use athermal_core::message::Message;
use athermal_core::prng::Prng;
use athermal_core::time::{Duration, Instant};
use athermal_core::watch::Kept;
use athermal_estimators as _;
use athermal_features as _;
use athermal_jobs::fit::FitOutcome;
use athermal_run::fit::{FitOptions, fit};
use athermal_run::live::{LiveOptions, pair};
use athermal_run::model::{Card, Model};
use athermal_run::recording::{Event, Table};

use crate::propose::{NotProposed, Terms, propose};
use crate::sensors::{Fault, broken};

const GRAPH: &str = r#"
schema = 1
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "5min" }
signals.position = { unit = "nm", channels = ["Z"], max_age = "5min" }
nodes.gradients = { type = "slope", inputs.signal = "temperature", windows = ["10min"], unit = "K/min" }
nodes.drift = { type = "slope", inputs.signal = "position", windows = ["10min"], unit = "nm/min" }
nodes.thermal = { type = "linear", inputs.features = "gradients", inputs.truth = "drift.Z", ahead = "0s" }
outputs.drift = "drift"
outputs.thermal = "thermal"
"#;

const DAY: i64 = 1_440;

fn at(minute: i64) -> Instant {
    Instant::from_ns(minute * 60_000_000_000)
}

fn graph(seed: u64) -> Model {
    let path = std::env::temp_dir().join(format!(
        "athermal-retrain-{}-{seed}.toml",
        std::process::id()
    ));
    std::fs::write(&path, GRAPH).unwrap();
    let model = Model::load(&path).unwrap_or_else(|error| panic!("{error}"));
    std::fs::remove_file(path).unwrap();
    model
}

/// So many days of a machine, a row a minute. Its position follows its temperatures by coefficients that grow by a fifth in a week.
fn machine(seed: u64, days: i64) -> Table {
    let mut prng = Prng::stream(seed, "ageing");
    let mut table = Table::default();
    let mut normal = move || (0..12).map(|_| prng.uniform()).sum::<f64>() - 6.0;
    // Temperatures that pass to others and back, smoothly.
    let (mut plate, mut room, mut target, mut z) = (20.0, 20.0, 20.0, 0.0);
    for minute in 0..days * DAY {
        if minute % 180 == 0 {
            target = 20.0 + 3.0 * normal();
        }
        let age = 1.0 + 0.2 * minute as f64 / (7 * DAY) as f64;
        let before: (f64, f64) = (plate, room);
        plate += (target - plate) / 40.0;
        room += (20.0 + 0.3 * (target - 20.0) - room) / 120.0 + 0.002 * normal();
        z += age * (900.0 * (plate - before.0) - 700.0 * (room - before.1));
        let row = [
            plate + 0.002 * normal(),
            room + 0.002 * normal(),
            z + 2.0 * normal(),
        ];
        table.push(at(minute), &row);
    }
    table
}

fn part(data: &Table, from: i64, to: i64) -> Table {
    let mut part = Table::default();
    for (event, row) in data.events() {
        if let Event::Row(time) = event
            && *time >= at(from)
            && *time < at(to)
        {
            part.push(*time, row);
        }
    }
    part
}

fn fitted(graph: &Model, data: &Table) -> Model {
    let mut model = graph.clone();
    let (fits, report) = fit(&graph.plan, data, &FitOptions::default(), &mut |_| {}).unwrap();
    model.fitted = fits;
    model.card = Some(Card::of(&report, Vec::new(), None));
    model
}

fn terms(days: i64) -> Terms {
    Terms {
        on: Duration::from_ns(days * DAY * 60_000_000_000),
        margin: 0.0,
    }
}

/// What the shadow finds of a candidate beside what runs, over so many minutes of data.
fn shadowed(running: &Model, candidate: &Model, data: &Table, minutes: i64) -> Option<bool> {
    let options = LiveOptions {
        mirrored: 64,
        ..LiveOptions::default()
    };
    let (mut stepper, mut control) = pair(running, options).unwrap();
    let mut rows = data.events().iter().filter_map(|(event, row)| match event {
        Event::Row(time) => Some((*time, row)),
        Event::Segment => None,
    });
    let mut step = |control: &mut athermal_run::live::Control, count: i64| {
        for (time, row) in rows.by_ref().take(count as usize) {
            stepper.step(time, row).unwrap();
            control.pump();
        }
    };
    step(&mut control, 120);
    control.stage(candidate, false).unwrap();
    let length = Duration::from_ns(minutes * 60_000_000_000);
    control.shadow(length, 0.0).unwrap();
    step(&mut control, minutes + 1);
    let verdict = control.verdict().unwrap();
    assert!(verdict.over, "{verdict:?}");
    verdict.passes
}

#[test]
fn a_proposal_is_the_fit_of_whoever_fits_on_the_same_rows_with_the_same_remarks() {
    let graph = graph(1);
    let data = machine(1, 9);
    let old = fitted(&graph, &part(&data, 0, DAY));
    let (rows, host) = (part(&data, 0, 8 * DAY), Kept::default());
    let proposal = propose(&old, &rows, &terms(14), None, &host).unwrap();
    let job = FitOutcome::of(&graph.plan, &rows, &FitOptions::default(), &Kept::default()).unwrap();
    let texts = |all: Vec<Message>| all.iter().map(ToString::to_string).collect::<Vec<_>>();
    let remarks = host.remarks().into_iter().map(|of| of.message).collect();
    assert_eq!(texts(remarks), texts(job.doubts(&graph.plan)));
    let as_model = Model {
        fitted: job.fitted,
        ..proposal.model.clone()
    };
    assert_eq!(
        as_model.to_text().unwrap(),
        proposal.model.to_text().unwrap()
    );
}

const SEEDS: u64 = 20;

#[test]
fn of_a_machine_that_ages_a_better_fit_is_proposed_within_a_day_and_the_shadow_takes_it_and_refuses_a_worse_one()
 {
    for seed in 1..=SEEDS {
        let graph = graph(seed);
        let data = machine(seed, 9);
        // Fitted on its first day, and run for a week.
        let old = fitted(&graph, &part(&data, 0, DAY));
        let proposed = propose(
            &old,
            &part(&data, 0, 8 * DAY),
            &terms(1),
            None,
            &Kept::default(),
        );
        let proposal = proposed.unwrap_or_else(|reason| panic!("seed {seed}: {reason}"));
        println!("seed {seed}: {:.3} times the error", proposal.ratio);
        assert!(proposal.ratio < 0.95, "seed {seed}: {}", proposal.ratio);
        // The ninth day, on the same ticks.
        let day = part(&data, 8 * DAY, 9 * DAY);
        let better = shadowed(&old, &proposal.model, &day, 720);
        let worse = shadowed(&proposal.model, &old, &day, 720);
        assert_eq!((better, worse), (Some(true), Some(false)), "seed {seed}");
    }
}

#[test]
fn a_fit_that_is_worse_on_what_it_has_not_seen_is_not_proposed() {
    for seed in 1..=SEEDS {
        let graph = graph(100 + seed);
        let data = machine(seed, 3);
        let running = fitted(&graph, &data);
        // A day in which the truth has nothing to do with the temperatures, but for its end.
        let mut wrong = part(&data, DAY, 3 * DAY);
        let mut prng = Prng::stream(seed, "wrong");
        let rows = wrong.events_mut();
        let count = rows.len() * 3 / 4;
        let mut z = 0.0;
        for (_, row) in &mut rows[..count] {
            z += 60.0 * (prng.uniform() - 0.5);
            row[2] = z;
        }
        let refused = propose(&running, &wrong, &terms(14), None, &Kept::default());
        assert!(
            matches!(refused, Err(NotProposed::Worse { ratio }) if ratio > 1.0),
            "seed {seed}"
        );
    }
}

fn sources(plan: &Plan) -> Vec<&str> {
    plan.sources.iter().map(|of| &*of.name).collect()
}

#[test]
fn a_broken_sensor_in_the_data_is_refused_with_the_reason() {
    let graph = graph(200);
    assert_eq!(
        sources(&graph.plan),
        ["temperature.plate", "temperature.room", "position.Z"]
    );
    let data = machine(7, 3);
    let running = fitted(&graph, &part(&data, 0, DAY));
    let with = |change: &dyn Fn(usize, &mut Vec<f64>)| {
        let mut data = part(&data, DAY, 3 * DAY);
        for (nth, (_, row)) in data.events_mut().iter_mut().enumerate() {
            change(nth, row);
        }
        match propose(&running, &data, &terms(14), None, &Kept::default()) {
            Err(NotProposed::Broken(all)) => all,
            other => panic!("{other:?}"),
        }
    };
    let silent = with(&|nth, row| {
        if nth > 1_500 {
            row[1] = f64::NAN;
        }
    });
    assert!(
        matches!(&*silent, [of] if of.channel == "temperature.room" && matches!(of.fault, Fault::Silent(_))),
        "{silent:?}"
    );
    let still = with(&|nth, row| {
        if nth > 1_000 && nth < 2_000 {
            row[0] = 21.5;
        }
    });
    assert!(
        matches!(&*still, [of] if of.channel == "temperature.plate" && matches!(of.fault, Fault::Still { .. })),
        "{still:?}"
    );
    let words = still[0].to_string();
    assert!(words.contains("stood still at 21.5 for"), "{words}");
    let beyond = with(&|nth, row| {
        if nth % 50 == 0 {
            row[1] = 850.0;
        }
    });
    assert!(
        matches!(&*beyond, [of] if matches!(of.fault, Fault::Beyond { .. })),
        "{beyond:?}"
    );
    // Of few rows nothing is proposed either.
    let few = propose(
        &fitted(&graph, &data),
        &part(&data, DAY, DAY + 400),
        &terms(14),
        None,
        &Kept::default(),
    );
    assert!(matches!(few, Err(NotProposed::FewRows { .. })), "{few:?}");
}

const PLANNED: &str = r#"
schema = 1
signals.set_point = { unit = "Cel", channels = ["chuck"], known_ahead = "10min", max_age = "1h" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], range = ["0 Cel", "60 Cel"], max_age = "5min" }
nodes.held = { type = "sum", inputs.signal = ["set_point", "temperature.plate", "temperature.room"], weights = [1.0, 1.0, -1.0] }
outputs.held = "held"
"#;

#[test]
fn a_plan_may_rest_and_a_value_out_of_range_is_none() {
    let path = std::env::temp_dir().join(format!("athermal-rests-{}.toml", std::process::id()));
    std::fs::write(&path, PLANNED).unwrap();
    let plan = Model::load(&path).unwrap().plan;
    std::fs::remove_file(path).unwrap();
    assert_eq!(
        sources(&plan),
        [
            "set_point.chuck",
            "temperature.plate",
            "temperature.room",
            "set_point:applies_at.chuck"
        ]
    );
    let mut data = Table::default();
    for minute in 0..DAY {
        // One set point for the whole day. A plate that says 850 for a third of it, as one that is not connected does.
        let wave = (minute as f64 / 90.0).sin();
        let plate = if minute > 900 { 850.0 } else { 20.0 + wave };
        let (chuck, applies) = match minute {
            0 => (50.0, 0.0),
            _ => (f64::NAN, f64::NAN),
        };
        // The room has a spike now and then.
        let room = if minute % 100 == 0 {
            -273.0
        } else {
            21.0 + wave
        };
        data.push(at(minute), &[chuck, plate, room, applies]);
    }
    let ranges = ["temperature.plate", "temperature.room"].map(|channel| SampleRange {
        channel: channel.to_owned(),
        lowest: 19.0,
        highest: 22.0,
    });
    let broken = broken(&plan, &data, &ranges);
    assert!(
        matches!(&*broken, [of] if of.channel == "temperature.plate" && matches!(of.fault, Fault::Silent(_))),
        "{broken:?}"
    );
}
