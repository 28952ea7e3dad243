//! Features in a running graph against tables made with pandas and scipy, see `tests/oracles/windows/generate.py`, and with HiGHS,
//! see `tests/oracles/minimum_difference/generate.py`.

use std::path::Path;
use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, Fitted};
use athermal_core::time::Instant;
use athermal_features as _;

/// A graph of one node on two signals, running.
struct Bench {
    plan: Arc<Plan>,
    engine: Engine,
}

impl Bench {
    /// A node that is called `n`; `ports` are all that is read of it.
    fn new(node: &str, ports: &[&str]) -> Self {
        Self::in_unit("mm", node, ports)
    }

    fn in_unit(unit: &str, node: &str, ports: &[&str]) -> Self {
        Self::reading("s", unit, node, ports)
    }

    fn reading(signal: &str, unit: &str, node: &str, ports: &[&str]) -> Self {
        let outputs: String = ports
            .iter()
            .map(|port| format!("{port} = \"n:{port}\"\n"))
            .collect();
        let text = format!(
            "schema = 1\n[signals.s]\nunit = \"{unit}\"\nchannels = [\"y\", \"z\"]\nmax_age = \"10s\"\n\
             [nodes.n]\ninputs.signal = \"{signal}\"\n{node}\n[outputs]\n{outputs}"
        );
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let files = Memory::new();
        let document = load_text("graph.toml", text, &files, &mut sources, &mut diagnostics);
        let graph = document.and_then(|document| declare(document, &mut diagnostics));
        let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
        let plan = plan.unwrap_or_else(|| panic!("{}", diagnostics.render(&sources, false, 100)));
        let plan = Arc::new(plan);
        let engine = Engine::new(Arc::clone(&plan), &Fitted::new()).unwrap();
        Self { plan, engine }
    }

    fn tick(&mut self, row: &[f64]) {
        let now = Instant::from_ns((row[0] * 1e9).round() as i64);
        self.engine.step(now, &row[1..]).unwrap();
    }

    fn output(&self, name: &str) -> f64 {
        let outputs = &self.plan.outputs;
        let place = outputs.iter().position(|output| output.name == name);
        self.engine.outputs()[place.unwrap_or_else(|| panic!("no {name}"))]
    }
}

/// Rows of a table as text, without the header.
fn table(file: &str) -> Vec<Vec<String>> {
    rows_of(&format!("windows/{file}"))
}

fn rows_of(path: &str) -> Vec<Vec<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/oracles");
    let text = std::fs::read_to_string(folder.join(path)).unwrap();
    let row = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().skip(1).map(row).collect()
}

fn number(cell: &str) -> f64 {
    if cell.is_empty() {
        f64::NAN
    } else {
        cell.parse().unwrap()
    }
}

fn input() -> Vec<Vec<f64>> {
    let rows = table("input.csv");
    rows.iter()
        .map(|row| row.iter().map(|cell| number(cell)).collect())
        .collect()
}

/// Runs the input through a node, and compares what it gives with the rows of a table that begin as stated: the channel, the keys, the
/// number of the row, the values. `values` names the outputs, each with the column after the row's number.
fn compare(node: &str, file: &str, keys: &[&str], values: &[(&str, usize)], tolerance: f64) {
    let expected = table(file);
    let ports: Vec<&str> = values.iter().map(|(port, _)| *port).collect();
    let mut bench = Bench::new(node, &ports);
    let mut compared = 0;
    for (row, samples) in input().iter().enumerate() {
        bench.tick(samples);
        let is_here = |line: &&Vec<String>| {
            line[1..=keys.len()] == *keys && line[1 + keys.len()] == row.to_string()
        };
        for line in expected.iter().filter(is_here) {
            for (port, column) in values {
                let expected = number(&line[2 + keys.len() + column]);
                let found = bench.output(&format!("{port}.{}", line[0]));
                let close = (found - expected).abs() <= tolerance * expected.abs().max(1.0);
                assert!(
                    close || (found.is_nan() && expected.is_nan()),
                    "{file} {line:?}, {port}: {found} for {expected}"
                );
                compared += usize::from(!expected.is_nan());
            }
        }
    }
    assert!(compared > 250, "{file} {keys:?}: {compared}");
}

/// A window makes do with what there is, as pandas does.
const PARTIAL: &str = "cold = \"partial\"\nmin_coverage = 0.0\n";

#[test]
fn oracle_of_moving_statistics() {
    let ports = [
        ("mean", 0),
        ("std", 1),
        ("min", 2),
        ("max", 3),
        ("median", 4),
        ("count", 5),
    ];
    for window in ["20", "60", "150"] {
        let node =
            format!("type = \"moving\"\nwindows = [\"{window}s\"]\nmin_samples = 1\n{PARTIAL}");
        compare(&node, "moving.csv", &[window], &ports, 1e-11);
    }
}

#[test]
fn oracle_of_the_values_and_shares_of_slopes() {
    let ports = [("slope", 0), ("stderr", 1), ("value", 2), ("r2", 3)];
    for window in ["20", "60", "150"] {
        let node = format!(
            "type = \"slope\"\nunit = \"mm/s\"\nwindows = [\"{window}s\"]\nmin_samples = 3\n{PARTIAL}"
        );
        compare(&node, "lines.csv", &[window], &ports, 1e-9);
    }
}

#[test]
fn oracle_of_the_hampel_filter() {
    let cases = [
        ("60", "3.0", "0.0"),
        ("60", "3.0", "0.02"),
        ("150", "4.5", "0.0"),
    ];
    for (window, threshold, floor) in cases {
        let node = format!(
            "type = \"hampel\"\nwindow = \"{window}s\"\nthreshold = {threshold}\nfloor = \"{floor} mm\"\n"
        );
        let keys = [window, threshold, floor];
        compare(&node, "hampel.csv", &keys, &[("outlier", 1)], 0.0);
        replaced(&format!("{node}replace = \"median\""), &keys);
        absent(&node, &keys);
    }
}

/// An outlier becomes the median of its window, and what is none passes.
fn replaced(node: &str, keys: &[&str]) {
    judged(
        node,
        keys,
        |sample, median, outlier| {
            if outlier { median } else { sample }
        },
    );
}

/// An outlier is absent, and what is none passes.
fn absent(node: &str, keys: &[&str]) {
    judged(
        node,
        keys,
        |sample, _, outlier| {
            if outlier { f64::NAN } else { sample }
        },
    );
}

fn judged(node: &str, keys: &[&str], expected: impl Fn(f64, f64, bool) -> f64) {
    let lines = table("hampel.csv");
    let mut bench = Bench::new(node, &["signal"]);
    let (mut outliers, mut others) = (0, 0);
    for (row, samples) in input().iter().enumerate() {
        bench.tick(samples);
        for line in lines
            .iter()
            .filter(|line| line[1..4] == *keys && line[4] == row.to_string())
        {
            let sample = samples[if line[0] == "y" { 1 } else { 2 }];
            let outlier = number(&line[6]) == 1.0;
            let expected = expected(sample, number(&line[5]), outlier);
            let found = bench.output(&format!("signal.{}", line[0]));
            assert!(
                (found - expected).abs() < 1e-12 || (found.is_nan() && expected.is_nan()),
                "{line:?}: {found} for {expected}"
            );
            *(if outlier { &mut outliers } else { &mut others }) += 1;
        }
    }
    assert!(outliers > 5 && others > 300, "{outliers} {others}");
}

#[test]
fn oracle_of_lags() {
    for (lag, age) in [("0", "10"), ("7", "10"), ("30", "10"), ("30", "4")] {
        let node = format!("type = \"lag\"\nlags = [\"{lag}s\"]\nmax_age = \"{age}s\"\n");
        compare(&node, "lag.csv", &[lag, age], &[("lagged", 0)], 0.0);
    }
}

#[test]
fn oracle_of_differences() {
    for (over, age) in [("7", "10"), ("30", "10"), ("30", "4")] {
        let node = format!("type = \"difference\"\nover = \"{over}s\"\nmax_age = \"{age}s\"\n");
        compare(
            &node,
            "difference.csv",
            &[over, age],
            &[("difference", 0)],
            1e-12,
        );
    }
    let node = "type = \"difference\"\n";
    compare(
        node,
        "difference.csv",
        &["0", "10"],
        &[("difference", 0)],
        1e-12,
    );
}

#[test]
fn oracle_of_first_order_lags() {
    for tau in ["5", "60", "900"] {
        for (output, column) in [("value", 0), ("difference", 1)] {
            let node = format!(
                "type = \"first_order\"\ntime_constants = [\"{tau}s\"]\noutput = \"{output}\"\n"
            );
            compare(
                &node,
                "first_order.csv",
                &[tau],
                &[("lagged", column)],
                1e-12,
            );
        }
    }
}

#[test]
fn oracle_of_minimum_differences() {
    for least in ["0.005", "0.3"] {
        let node = format!("type = \"minimum_difference\"\ndifference = \"{least} mm\"\n");
        compare(
            &node,
            "minimum_difference.csv",
            &[least],
            &[("signal", 0)],
            0.0,
        );
    }
}

#[test]
fn oracle_of_minimum_differences_as_an_integer_program() {
    let rows = rows_of("minimum_difference/cases.csv");
    let (mut compared, mut kept_back) = (0, 0);
    for case in rows.chunk_by(|row, next| row[0] == next[0]) {
        let least = &case[0][1];
        let node = format!("type = \"minimum_difference\"\ndifference = \"{least} mm\"\n");
        let mut bench = Bench::new(&node, &["signal"]);
        for (nth, row) in case.iter().enumerate() {
            let (sample, kept) = (number(&row[2]), number(&row[3]));
            bench.tick(&[nth as f64, sample, f64::NAN]);
            if !sample.is_nan() {
                assert_eq!(bench.output("signal.y"), kept, "{row:?}");
                compared += 1;
                kept_back += usize::from(sample != kept);
            }
        }
    }
    assert!(compared > 600 && kept_back > 300, "{compared}, {kept_back}");
}

#[test]
fn oracle_of_a_factor_and_an_offset_in_another_unit() {
    let node = "type = \"scale\"\nfactor = 2.5\noffset = \"-0.1 [in_i]\"\nunit = \"[in_i]\"\n";
    compare(node, "scale.csv", &[], &[("scaled", 0)], 1e-14);
}

#[test]
fn oracle_of_sums_and_products_of_held_values() {
    let expected = table("together.csv");
    for (node, output, column) in [
        ("type = \"sum\"\nweights = [0.5, -2.5]\n", "sum", 1),
        ("type = \"product\"\nunit = \"mm2\"\n", "product", 2),
    ] {
        let mut bench = Bench::new(node, &[output]);
        let (mut compared, mut too_old) = (0, 0);
        for (row, samples) in input().iter().enumerate() {
            bench.tick(samples);
            let line = expected.iter().find(|line| line[0] == row.to_string());
            let Some(line) = line else {
                continue;
            };
            let (expected, found) = (
                number(&line[column]),
                bench.output(&format!("{output}.{output}")),
            );
            assert!(
                (found - expected).abs() <= 1e-13 * expected.abs()
                    || (found.is_nan() && expected.is_nan()),
                "{output} in row {row}: {found} for {expected}"
            );
            compared += usize::from(!expected.is_nan());
            too_old += usize::from(expected.is_nan());
        }
        assert!(compared > 300 && too_old > 0, "{compared}, {too_old}");
    }
}

#[test]
fn oracle_of_a_regular_clock() {
    let rows = input();
    for (every, method, column) in [(10, "mean", 3), (10, "last", 4), (30, "mean", 3)] {
        let node = format!("type = \"resample\"\nevery = \"{every}s\"\nmethod = \"{method}\"\n");
        let mut bench = Bench::new(&node, &["signal"]);
        let expected = table("resample.csv");
        let periods = |channel: &str, end: f64| {
            let line = expected.iter().find(|line| {
                line[0] == channel && line[1] == every.to_string() && number(&line[2]) == end
            });
            line.map_or(f64::NAN, |line| number(&line[column]))
        };
        let mut compared = 0;
        let mut before = f64::NEG_INFINITY;
        for samples in &rows {
            let now = samples[0];
            bench.tick(samples);
            let period = f64::from(every);
            // The newest period that has ended by now gives a value when it ended since the tick before.
            let end = (now / period).floor() * period;
            for channel in ["y", "z"] {
                let found = bench.output(&format!("signal.{channel}"));
                let expected = if end > before {
                    periods(channel, end)
                } else {
                    f64::NAN
                };
                assert!(
                    (found - expected).abs() < 1e-12 || (found.is_nan() && expected.is_nan()),
                    "{every} {method} {channel} at {now}: {found} for {expected}"
                );
                compared += usize::from(!expected.is_nan());
            }
            before = now;
        }
        assert!(compared > 40, "{compared}");
    }
}

#[test]
fn a_value_of_a_slow_clock_differs_from_the_one_before() {
    // No row is at the end of a minute, so that the value before is older than one by up to two rows.
    let chain = |method: &str| {
        format!(
            "type = \"difference\"\n[nodes.c]\ntype = \"resample\"\nevery = \"1min\"\nmethod = \"{method}\"\n\
             inputs.signal = \"s\"\n"
        )
    };
    for method in ["mean", "last"] {
        let mut bench = Bench::reading("c", "mm", &chain(method), &["difference"]);
        let mut changes = 0;
        for row in 0..150 {
            let now = 3.0 + 4.3 * f64::from(row);
            bench.tick(&[now, 2.0 * now, 0.0]);
            let change = bench.output("difference.y");
            if !change.is_nan() {
                assert!(
                    (change - 120.0).abs() < 2.0 * 4.3 + 1e-9,
                    "{method}: {change}"
                );
                changes += 1;
            }
        }
        // The ends of ten minutes are passed, and the first value has none before it.
        assert_eq!(changes, 9, "{method}");
    }
}

#[test]
fn oracle_of_samples_at_the_instants_of_another_channel() {
    let mut bench = Bench::new(
        "type = \"sample_at\"\ninputs.instants = \"s.z\"\n",
        &["signal"],
    );
    let expected = table("sampled.csv");
    let (mut compared, mut too_old) = (0, 0);
    for (row, samples) in input().iter().enumerate() {
        bench.tick(samples);
        let line = expected.iter().find(|line| line[0] == row.to_string());
        for (channel, column) in [("y", 1), ("z", 2)] {
            let found = bench.output(&format!("signal.{channel}"));
            let expected = line.map_or(f64::NAN, |line| number(&line[column]));
            assert!(
                found == expected || (found.is_nan() && expected.is_nan()),
                "{channel} in row {row}: {found} for {expected}"
            );
            compared += usize::from(!expected.is_nan());
            too_old += usize::from(line.is_some() && expected.is_nan());
        }
    }
    assert!(compared > 400 && too_old > 0, "{compared}, {too_old}");
}

#[test]
fn a_change_below_the_minimum_difference_is_kept_back_and_a_slow_one_comes_in_steps() {
    let node = "type = \"minimum_difference\"\ndifference = \"30 um\"";
    let mut bench = Bench::new(node, &["signal"]);
    let nan = f64::NAN;
    // In mm, so that the difference is 0.03; the second channel drifts by 0.01 in each row.
    let rows = [
        (1.00, 1.00, 0.00, 0.00),
        (1.02, 1.00, 0.01, 0.00),
        (0.98, 1.00, 0.02, 0.00),
        (1.50, 1.50, 0.035, 0.035),
        (1.48, 1.50, 0.04, 0.035),
        (nan, nan, 0.05, 0.035),
        (1.44, 1.44, 0.07, 0.07),
    ];
    for (nth, (y, y_kept, z, z_kept)) in rows.into_iter().enumerate() {
        bench.tick(&[nth as f64, y, z]);
        if y.is_nan() {
            continue;
        }
        assert_eq!(bench.output("signal.y"), y_kept, "row {nth}");
        assert_eq!(bench.output("signal.z"), z_kept, "row {nth}");
    }
}

/// Steps as a coarse sensor takes them: as binary numbers most of them are a little more or less than 0.01.
fn staircase() -> impl Iterator<Item = f64> {
    (0..200).map(|step| f64::from(2000 + step) / 100.0)
}

#[test]
fn a_step_of_just_the_minimum_difference_is_passed_on() {
    let mut bench = Bench::new(
        "type = \"minimum_difference\"\ndifference = \"10 um\"",
        &["signal"],
    );
    for (nth, y) in staircase().enumerate() {
        bench.tick(&[nth as f64, y, f64::NAN]);
        assert_eq!(bench.output("signal.y"), y, "row {nth}");
    }
}

#[test]
fn a_step_of_just_the_floor_is_no_outlier() {
    let node = "type = \"hampel\"\nwindow = \"8s\"\nfloor = \"10 um\"";
    let mut bench = Bench::new(node, &["outlier"]);
    let stairs = staircase().flat_map(|y| [y; 8]);
    for (nth, y) in stairs.enumerate() {
        // The window then lies within one step.
        let is_spike = nth % 8 == 7;
        let spike = if is_spike { 0.0101 } else { 0.0 };
        bench.tick(&[nth as f64, y, y + spike]);
        assert_ne!(bench.output("outlier.y"), 1.0, "row {nth}");
        if is_spike {
            assert_eq!(bench.output("outlier.z"), 1.0, "row {nth}");
        }
    }
}

#[test]
fn a_difference_of_temperatures_may_be_given_in_their_own_unit() {
    for (unit, one) in [("Cel", "1 Cel"), ("Cel", "1 K"), ("[degF]", "1 [degF]")] {
        let scaled = |node: &str, port: &str, rows: &[f64]| {
            let mut bench = Bench::in_unit(unit, node, &[port]);
            for (nth, &y) in rows.iter().enumerate() {
                bench.tick(&[nth as f64, y, f64::NAN]);
            }
            bench.output(&format!("{port}.y"))
        };
        let offset = format!("type = \"scale\"\noffset = \"{one}\"");
        assert!((scaled(&offset, "scaled", &[20.0]) - 21.0).abs() < 1e-9);
        let difference = format!("type = \"minimum_difference\"\ndifference = \"{one}\"");
        assert_eq!(scaled(&difference, "signal", &[20.0, 20.9]), 20.0);
        assert_eq!(scaled(&difference, "signal", &[20.0, 21.1]), 21.1);
        let floor = format!("type = \"hampel\"\nwindow = \"9s\"\nfloor = \"{one}\"");
        assert_eq!(scaled(&floor, "outlier", &[20.0, 20.0, 20.0, 20.9]), 0.0);
        assert_eq!(scaled(&floor, "outlier", &[20.0, 20.0, 20.0, 21.1]), 1.0);
    }
}

#[test]
fn the_sample_before_counts_as_long_as_its_signal_says() {
    let mut bench = Bench::new("type = \"difference\"\n", &["difference"]);
    for (now, value, expected) in [(0.0, 1.0, None), (10.0, 2.0, Some(1.0)), (20.1, 4.0, None)] {
        bench.tick(&[now, value, 0.0]);
        let change = bench.output("difference.y");
        assert_eq!((!change.is_nan()).then_some(change), expected, "at {now}");
    }
}

#[test]
fn what_comes_later_than_it_may_does_not_come() {
    let node = "type = \"resample\"\nevery = \"10s\"\nlate = \"2s\"\n";
    let mut bench = Bench::new(node, &["signal"]);
    for (now, expected) in [
        (9.0, None),
        (12.0, Some(9.0)),
        (22.1, None),
        (30.0, Some(26.05)),
    ] {
        bench.tick(&[now, now, 0.0]);
        let found = bench.output("signal.y");
        assert_eq!((!found.is_nan()).then_some(found), expected, "at {now}");
    }
}
