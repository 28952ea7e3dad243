//! A die tester whose world changes after the fit: a door stands open, a lamp shines on a stage, two sensors come loose. What was
//! learned is then hardly worse than no model, and the sensors that contradict the others are named.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};

use crate::workbench::{Read, data, graph};
use athermal::Engine;
use athermal::chart::{Chart, Layer};
use athermal::core::compile::Plan;
use athermal::core::engine::Fitted;
use athermal::files::{Dataset, Options};
use athermal::run::fit::{FitOptions, fit};
use athermal::run::recording::{Event, Table};

const AXES: [&str; 6] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
const LIMIT: f64 = 250.0;

/// The folder of the changed world, or nothing, with a remark, where this machine lacks it.
fn changed_world() -> Option<PathBuf> {
    let folder = data()?.with_file_name("changed-world");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: {} is not there", folder.display());
    None
}

fn dataset(file: PathBuf) -> Dataset {
    Dataset::new(vec![file], Options::default())
}

/// What happens, by name, from and to which second.
fn events(folder: &Path) -> Vec<(String, f64, f64)> {
    let text = std::fs::read_to_string(folder.join("events.txt")).unwrap();
    let lines = text.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let hours = |nth: usize| cells[nth].parse::<f64>().unwrap() * 3600.0;
        (cells[0].to_owned(), hours(1), hours(2))
    });
    lines.collect()
}

/// Steps over a recording, and hands on what the outputs of each tick are, by the names of their columns.
fn run(
    plan: &Arc<Plan>,
    fitted: &Fitted,
    table: &Table,
    mut tick: impl FnMut(f64, &dyn Fn(&str) -> f64),
) {
    let mut engine = Engine::new(Arc::clone(plan), fitted).unwrap();
    for (event, values) in table.events() {
        let Event::Row(time) = *event else {
            panic!("one segment")
        };
        let outputs = engine.step(time, values).unwrap();
        let output = |name: &str| {
            let place = plan.outputs.iter().position(|output| output.name == name);
            outputs[place.unwrap_or_else(|| panic!("there is no output {name}"))]
        };
        tick(time.as_ns() as f64 / 1e9, &output);
    }
}

/// A plan of a graph file that shows its drift too.
fn plan(extends: &str, more: &str) -> Arc<Plan> {
    let text = format!(
        "schema = 1\nextends = '{}'\nname = \"changed-world\"\n[outputs]\ndrift = \"drift\"\n{more}",
        graph(extends).display()
    );
    let mut read = Read::new(&text);
    let plan = read.plan.take();
    Arc::new(plan.unwrap_or_else(|| panic!("{}", read.told())))
}

/// By what a graph extends, what it has besides, and the file that it is fitted on.
type Fits = BTreeMap<(String, String, PathBuf), Arc<OnceLock<Arc<(Arc<Plan>, Fitted)>>>>;

/// The plan of a graph file and what it is fitted to: once for all tests.
fn fitted(extends: &str, more: &str, file: PathBuf) -> Arc<(Arc<Plan>, Fitted)> {
    static FITS: Mutex<Fits> = Mutex::new(BTreeMap::new());
    let key = (extends.to_owned(), more.to_owned(), file.clone());
    let cell = Arc::clone(FITS.lock().unwrap().entry(key).or_default());
    let found = cell.get_or_init(|| {
        let plan = plan(extends, more);
        let options = FitOptions::default();
        let (fitted, _) = fit(&plan, &dataset(file), &options, &mut |_| {}).unwrap();
        Arc::new((plan, fitted))
    });
    Arc::clone(found)
}

/// The virtual sensor of the die tester, with its uncertainty.
const SENSOR: (&str, &str) = (
    "die-tester-virtual-sensor",
    "deviation = \"sensor:std_dev\"\n",
);

/// The instant, the truth and the error of each prediction of an axis of which there is a truth below the limit.
type Errors = [Vec<(f64, f64, f64)>; 6];

fn errors(name: &str, train: PathBuf, test: &Table, limit: f64, of: &str, more: &str) -> Errors {
    let found = fitted(name, more, train);
    let (plan, fitted) = &*found;
    let mut errors = Errors::default();
    run(plan, fitted, test, |now, output| {
        for (errors, axis) in errors.iter_mut().zip(AXES) {
            let truth = output(&format!("drift.{axis}"));
            let error = output(&format!("{of}.{axis}")) - truth;
            if truth.abs() < limit && !error.is_nan() {
                errors.push((now, truth, error));
            }
        }
    });
    errors
}

fn root_mean_square(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|value| value * value).sum::<f64>() / values.count() as f64).sqrt()
}

#[test]
fn reference_what_was_learned_is_hardly_worse_than_no_model_whatever_becomes_of_the_world() {
    let Some(folder) = changed_world() else {
        return;
    };
    let train = || folder.with_file_name("data").join("die-tester/train.csv");
    let plain = plan("die-tester-sensor", "");
    let test = Table::read(&dataset(folder.join("test.csv")), &plain).unwrap();
    let (name, more) = SENSOR;
    let of_sensor = errors(name, train(), &test, LIMIT, "predicted", more);
    let of_vote = errors("die-tester-sensor", train(), &test, LIMIT, "predicted", "");
    let mut wrong = Vec::new();
    for ((axis, own), vote) in AXES.iter().zip(&of_sensor).zip(&of_vote) {
        let rmse = |errors: &[(f64, f64, f64)]| {
            root_mean_square(errors.iter().map(|(_, _, error)| *error))
        };
        let largest = own
            .iter()
            .map(|(_, _, error)| error.abs())
            .fold(0.0, f64::max);
        let (sensor, vote) = (rmse(own), rmse(vote));
        println!(
            "{axis}: RMSE {sensor:.2} beside {vote:.2} of the plain vote, at most {largest:.1} nm/min"
        );
        if sensor > 1.05 * vote {
            wrong.push(format!(
                "{axis} has {sensor} over all, the plain vote {vote}"
            ));
        }
        if axis.starts_with('Z') && largest > 80.0 {
            wrong.push(format!("{axis} is off by {largest} nm/min"));
        }
        for (event, from, to) in events(&folder) {
            let within = own
                .iter()
                .filter(|(at, _, _)| (from..=to + 1800.0).contains(at));
            let error = root_mean_square(within.clone().map(|(_, _, error)| *error));
            let ratio = error / root_mean_square(within.map(|(_, truth, _)| *truth));
            println!("  {event}: {ratio:.2} of no model");
            if ratio.is_nan() || ratio > 1.05 {
                wrong.push(format!("{axis} has {ratio} of no model while: {event}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn reference_what_a_correction_integrates_is_no_worse_than_none_whatever_becomes_of_the_world() {
    let Some(folder) = changed_world() else {
        return;
    };
    // It is of half a window ahead: given when its truth comes, it stands beside that.
    let late = r#"
        late = "late"
        [nodes.late]
        type = "delay"
        inputs.signal = "rate"
        delay = "150s"
        "#;
    let name = "die-tester-compensate";
    let test = Table::read(&dataset(folder.join("test.csv")), &plan(name, late)).unwrap();
    let train = folder.with_file_name("data").join("die-tester/train.csv");
    let all = errors(name, train, &test, LIMIT, "late", late);
    let mut wrong = Vec::new();
    for (axis, of_axis) in AXES.iter().zip(&all) {
        for (event, from, to) in events(&folder) {
            let within = of_axis
                .iter()
                .filter(|(at, ..)| (from..=to + 1800.0).contains(at));
            let error = root_mean_square(within.clone().map(|(_, _, error)| *error));
            let ratio = error / root_mean_square(within.map(|(_, truth, _)| *truth));
            println!("{axis} while {event}: {ratio:.2} of no model");
            if ratio.is_nan() || ratio > 1.05 {
                wrong.push(format!("{axis} has {ratio} of no model while: {event}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn reference_to_shrink_costs_little_at_chuck_steps_beyond_those_of_the_fit() {
    let Some(folder) = data() else { return };
    let folder = folder.join("die-tester");
    let graph = |outside: &str| {
        format!(
            r#"
            everything = "everything"
            [nodes.everything]
            type = "linear"
            each = "axis"
            inputs.features = "gradients"
            inputs.truth = "drift.{{axis}}"
            ahead = "0s"
            train.abs_truth = {{ below = "850 nm/min" }}
            outside = "{outside}"
            "#
        )
    };
    let test = Table::read(
        &dataset(folder.join("test.csv")),
        &plan("die-tester-sensor", ""),
    )
    .unwrap();
    let [shrink, pass] = ["shrink", "pass"].map(|outside| {
        let train = folder.join("train.csv");
        errors(
            "die-tester-sensor",
            train,
            &test,
            f64::INFINITY,
            "everything",
            &graph(outside),
        )
    });
    for (axis, (shrink, pass)) in AXES.iter().zip(shrink.iter().zip(&pass)) {
        let rmse = |errors: &[(f64, f64, f64)]| {
            root_mean_square(errors.iter().map(|(_, _, error)| *error))
        };
        let (shrink, pass) = (rmse(shrink), rmse(pass));
        println!("{axis}: {shrink:.2} nm/min where predictions shrink, {pass:.2} where they pass");
        assert!(shrink <= 1.05 * pass, "{axis}: {shrink} and {pass}");
    }
}

/// The instants at which `cross_check` begins to name a channel, as a graph has its signal; fitted on one file, run over another.
fn named(
    graph: &str,
    channels: &[&str],
    truth: &str,
    train: PathBuf,
    test: PathBuf,
) -> Vec<(f64, String)> {
    let more = format!(
        r#"
        why = "compared:reason"
        [nodes.compared]
        type = "cross_check"
        inputs.signal = "temperature"
        inputs.truth = "{truth}"
        ahead = "0s"
        "#
    );
    let found = fitted(graph, &more, train);
    let (plan, fitted) = &*found;
    let test = Table::read(&dataset(test), plan).unwrap();
    let (mut found, mut before) = (Vec::new(), vec![0.0; channels.len()]);
    run(plan, fitted, &test, |now, output| {
        for (channel, before) in channels.iter().zip(&mut before) {
            let reason = output(&format!("why.{channel}"));
            if reason == 1.0 && *before == 0.0 {
                found.push((now, (*channel).to_owned()));
            }
            *before = reason;
        }
    });
    found
}

const DIE_TESTER: [&str; 6] = ["plate1", "holder1", "plate2", "holder2", "room", "chuck"];

#[test]
fn reference_loose_sensors_are_named_and_no_other() {
    let Some(folder) = changed_world() else {
        return;
    };
    let train = folder.with_file_name("data").join("die-tester/train.csv");
    let found = named(
        "die-tester-sensor",
        &DIE_TESTER,
        "drift.Z1",
        train,
        folder.join("test.csv"),
    );
    println!("{found:?}");
    let loose = events(&folder)
        .into_iter()
        .filter_map(|(event, from, to)| Some((event.strip_prefix("loose ")?.to_owned(), from, to)));
    let mut left = found.clone();
    for (sensor, from, to) in loose {
        let latest = if sensor == "holder1" {
            from + 120.0
        } else {
            to
        };
        let first = found
            .iter()
            .find(|(at, name)| *name == sensor && *at >= from);
        assert!(
            first.is_some_and(|(at, _)| *at <= latest),
            "{sensor} is not named by {latest} s: {found:?}"
        );
        left.retain(|(at, name)| *name != sensor || !(from..=to).contains(at));
    }
    assert!(left.is_empty(), "these are named and were sound: {left:?}");
}

#[test]
fn reference_no_sensor_is_named_on_undisturbed_days() {
    let Some(folder) = data() else { return };
    let train_and_test = |machine: &str| {
        let file = |name: &str| folder.join(machine).join(name);
        (file("train.csv"), file("test.csv"))
    };
    let (train, test) = train_and_test("die-tester");
    assert_eq!(
        named("die-tester-sensor", &DIE_TESTER, "drift.Z1", train, test),
        []
    );
    let (train, test) = train_and_test("linear-axis");
    let sensors = ["t1", "t2", "t3", "t4"];
    assert_eq!(
        named("linear-axis-sensor", &sensors, "drift.Z", train, test),
        []
    );
    for (train, test) in [
        ("GX-H12A.csv", "GX-H12A-covered.csv"),
        ("superpinda.csv", "superpinda-covered.csv"),
    ] {
        let file = |name: &str| folder.join("z-probe").join(name);
        let sensors = ["bed", "chamber", "extruder"];
        assert_eq!(
            named("z-probe", &sensors, "drift.z", file(train), file(test)),
            []
        );
    }
}

/// How much of the truths lies within the 90 % intervals of a graph's predictions, by axis; of all, and within each event.
fn covered(train: PathBuf, test: PathBuf, events: &[(String, f64, f64)]) -> Vec<(String, f64)> {
    /// Half of an interval that holds 90 % of what is normally distributed, in standard deviations.
    const HALF: f64 = 1.644_853_626_951_472_7;
    let (name, more) = SENSOR;
    let sensor = fitted(name, more, train);
    let (plan, fitted) = &*sensor;
    let test = Table::read(&dataset(test), plan).unwrap();
    let mut found: Vec<Vec<(f64, bool)>> = vec![Vec::new(); AXES.len()];
    run(plan, fitted, &test, |now, output| {
        for (found, axis) in found.iter_mut().zip(AXES) {
            let of = |output: &dyn Fn(&str) -> f64, name: &str| output(&format!("{name}.{axis}"));
            let (truth, predicted) = (of(output, "drift"), of(output, "predicted"));
            let half = HALF * of(output, "deviation");
            if truth.abs() < LIMIT && half.is_finite() && predicted.is_finite() {
                found.push((now, (predicted - truth).abs() <= half));
            }
        }
    });
    let mut shares = Vec::new();
    for (axis, found) in AXES.iter().zip(&found) {
        let mut share = |name: String, from: f64, to: f64| {
            let within: Vec<_> = found
                .iter()
                .filter(|(at, _)| (from..=to).contains(at))
                .collect();
            let hits = within.iter().filter(|(_, holds)| *holds).count();
            assert!(within.len() > 30, "{name}: {} truths", within.len());
            shares.push((name, hits as f64 / within.len() as f64));
        };
        share((*axis).to_owned(), 0.0, f64::INFINITY);
        for (event, from, to) in events {
            share(format!("{axis} while {event}"), *from, to + 1800.0);
        }
    }
    shares
}

#[test]
fn reference_intervals_of_90_percent_hold_85_to_95_on_undisturbed_days_and_80_while_the_world_is_another()
 {
    let Some(folder) = changed_world() else {
        return;
    };
    let tester = folder.with_file_name("data").join("die-tester");
    let train = || tester.join("train.csv");
    let mut wrong = Vec::new();
    for (axis, share) in covered(train(), tester.join("test.csv"), &[]) {
        println!("{axis}: {:.1} %", 100.0 * share);
        if !(0.85..=0.95).contains(&share) {
            wrong.push(format!("{axis}: {share}"));
        }
    }
    let events = events(&folder);
    for (of, share) in covered(train(), folder.join("test.csv"), &events) {
        println!("{of}: {:.1} %", 100.0 * share);
        if of.contains(" while ") && share < 0.8 {
            wrong.push(format!("{of}: {share}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The virtual sensor as it was before it knew what it does not know.
const UNAWARE: &str = r#"
predicted = "believing"
[nodes]
trusted = false
gradients.inputs.signal = "temperature"
masses.inputs.signal = "temperature"
aligned.inputs.signal = ["temperature", "masses"]
expansion.outside = "pass"
creeping.outside = "pass"
[nodes.believing]
type = "fallback"
each = "axis"
inputs.voters = ["creeping.{axis}", "plain.{axis}"]
"#;

/// The numbers in a text.
fn numbers(text: &str) -> Vec<f64> {
    let is_part = |letter: char| letter.is_ascii_digit() || letter == '.' || letter == '-';
    let words = text.split(|letter| !is_part(letter));
    words.filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn reference_the_picture_of_a_day_with_a_loose_sensor_is_that_of_the_guide() {
    let Some(folder) = changed_world() else {
        return;
    };
    let train = || folder.with_file_name("data").join("die-tester/train.csv");
    let ((name, more), all) = (SENSOR, f64::INFINITY);
    let test = Table::read(&dataset(folder.join("test.csv")), &plan(name, "")).unwrap();
    let day = |more: &str| -> (Vec<f64>, Vec<f64>) {
        let axis = errors(name, train(), &test, all, "predicted", more)[2].clone();
        let of_day = axis
            .iter()
            .filter(|(at, ..)| (20.0..37.5).contains(&(at / 3600.0)));
        of_day.map(|(at, _, error)| (*at, *error)).unzip()
    };
    let ((at, with), (at_without, without)) = (day(more), day(UNAWARE));
    let loose = events(&folder)
        .into_iter()
        .find(|(event, ..)| event == "loose holder1");
    let (_, from, to) = loose.unwrap();
    let chart = Chart {
        title: "Errors of a virtual sensor on a day on which a temperature sensor comes loose"
            .to_owned(),
        x_label: "hours".to_owned(),
        y_label: "error on Z1 in nm/min".to_owned(),
        layers: vec![
            Layer::line(
                &at_without,
                &without,
                "c3",
                "without novelty and cross_check",
            ),
            Layer::line(
                &at,
                &with,
                "c2",
                "with (graphs/die-tester-virtual-sensor.toml)",
            ),
        ],
        bands: vec![(from, to, "s1")],
        time: true,
        ..Chart::default()
    };
    let drawn = chart.file();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/src/loose-sensor.svg");
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        std::fs::write(&kept, &drawn).unwrap();
    }
    let (drawn, kept) = (
        numbers(&drawn),
        numbers(&std::fs::read_to_string(&kept).unwrap()),
    );
    assert_eq!(drawn.len(), kept.len(), "INSTA_UPDATE=always draws it anew");
    // Other processors round otherwise.
    let worst = drawn
        .iter()
        .zip(&kept)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(
        worst <= 1.0,
        "a figure differs by {worst}: INSTA_UPDATE=always draws it anew"
    );
}
