//! `athermal report`: its figures against the same worked out by hand from what the program runs, and a page that needs nothing else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::workbench::{Finished, Scratch, athermal, athermal_on, graph, simulated};
use serde_json::Value;

const AXES: [&str; 6] = ["X1", "Y1", "Z1", "X2", "Y2", "Z2"];
/// dB min²/µm² as the article prints them for X, Y and Z.
const LOSS: [f64; 3] = [2.09059, 59.4658, 133.798];

/// Fits a graph on two days of its machine.
fn fitted(scratch: &Scratch, name: &str, machine: &str) -> PathBuf {
    let days = simulated(scratch, "fit.csv", machine, 2.0, 1);
    let model = scratch.path("model.json");
    athermal_on("fit", &graph(name), &days, &[&"-o", &model]).ended(0);
    model
}

fn report(model: &Path, data: &Path, more: &[&dyn AsRef<std::ffi::OsStr>]) -> Finished {
    athermal_on("report", model, data, more).ended(0)
}

/// The columns of a table; NaN where a cell is empty.
fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for line in lines {
        for (name, cell) in names.iter().zip(line.split(',')) {
            let value = if cell.is_empty() {
                f64::NAN
            } else {
                cell.parse().unwrap()
            };
            columns.entry((*name).to_owned()).or_default().push(value);
        }
    }
    columns
}

/// Five-minute least-squares slopes per minute, where a slope node gives one: full windows with three samples over half of it.
fn drift(aligned: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut drifts = Vec::new();
    for (nth, (now, _)) in aligned.iter().enumerate() {
        let window: Vec<_> = aligned[..=nth]
            .iter()
            .filter(|(t, _)| *t > now - 300.0)
            .collect();
        let spans = now - window[0].0;
        if now - 300.0 < aligned[0].0 || window.len() < 3 || spans < 150.0 {
            continue;
        }
        let count = window.len() as f64;
        let (mt, mp) = window
            .iter()
            .fold((0.0, 0.0), |m, w| (m.0 + w.0 / count, m.1 + w.1 / count));
        let above: f64 = window.iter().map(|w| (w.0 - mt) * (w.1 - mp)).sum();
        let below: f64 = window.iter().map(|w| (w.0 - mt).powi(2)).sum();
        drifts.push((*now, 60.0 * above / below));
    }
    drifts
}

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().map(|v| v * v).sum::<f64>() / values.count() as f64).sqrt()
}

fn numbers(value: &Value) -> Vec<f64> {
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    value.as_array().unwrap().iter().map(number).collect()
}

#[track_caller]
fn close(found: &[f64], expected: &[f64], within: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!(
            (found - expected).abs() <= within * expected.abs().max(1.0),
            "{found} is not {expected}"
        );
    }
}

#[test]
fn what_a_correction_is_worth_agrees_with_a_calculation_by_hand() {
    let scratch = Scratch::new("what_a_correction_is_worth");
    let model = fitted(&scratch, "die-tester-compensate", "die-tester");
    let days = simulated(&scratch, "days.csv", "die-tester", 0.6, 2);
    let run = scratch.path("run.csv");
    athermal(&[&"run", &model, &"--input", &days, &"--output", &run]).ended(0);
    let (measured, run) = (columns(&days), columns(&run));
    let facts = report(&model, &days, &[&"--format", &"json"]).json();
    let worth = &facts["worth"];

    let mut losses = [BTreeMap::new(), BTreeMap::new()];
    let mut begun_all = 0;
    for (i, axis) in AXES.iter().enumerate() {
        let position = &measured[&format!("{axis}_nm")];
        let correction = &run[&format!("correction.{axis}")];
        // Without a prediction, in the first minutes, there is no correction to be judged.
        let begun = run[&format!("why.{axis}")]
            .iter()
            .position(|why| *why != 1.0)
            .unwrap();
        let there = |with: f64| {
            (0..position.len())
                .filter(move |&row| !position[row].is_nan() && (with == 0.0 || row >= begun))
        };
        let at = |row: usize, with: f64| {
            (
                measured["time_s"][row],
                // The correction is in µm.
                position[row] + 1000.0 * with * correction[row],
            )
        };
        let ways =
            [0.0, 1.0].map(|with| drift(&there(with).map(|row| at(row, with)).collect::<Vec<_>>()));
        for (way, name) in ["drift_without", "drift_with"].iter().enumerate() {
            let expected: Vec<f64> = ways[way].iter().map(|d| d.1).collect();
            let given = numbers(&worth[name][i]["value"]);
            let given: Vec<f64> = given.into_iter().filter(|v| !v.is_nan()).collect();
            close(&given, &expected, 1e-6);
            for (t, v) in &ways[way] {
                *losses[way].entry(*t as i64).or_insert(0.0) += LOSS[i % 3] * (v / 1000.0).powi(2);
            }
        }
        let verdict = &facts["verdicts"][i];
        assert_eq!(verdict["axis"], *axis);
        let figures =
            ["without_correction", "with_correction"].map(|name| verdict[name].as_f64().unwrap());
        // Both over the instants at which there is a correction.
        let first = ways[1][0].0;
        begun_all = begun_all.max(first as i64);
        let expected = [0, 1].map(|way| {
            let compared = ways[way].iter().filter(|d| d.0 >= first);
            rms(compared.map(|d| d.1))
        });
        close(&figures, &expected, 1e-6);
    }
    // A loss is of all axes, of which some have a correction before others.
    for losses in &mut losses {
        losses.retain(|t, _| *t >= begun_all);
    }
    for (way, name) in ["loss_without", "loss_with"].iter().enumerate() {
        let expected: Vec<f64> = losses[way].values().copied().collect();
        close(&numbers(&worth[name]["value"]), &expected, 1e-5);
        let low = expected.iter().filter(|loss| **loss < 0.2).count() as f64;
        close(
            &[worth["below_limit"][way].as_f64().unwrap()],
            &[low / expected.len() as f64],
            1e-12,
        );
    }
    // The chuck goes from 20 to 30 °C after four hours, to 50 °C after eight, and back to 20 °C after twelve.
    let settling = worth["settling"].as_array().unwrap();
    let changes: Vec<f64> = settling
        .iter()
        .map(|s| s["at_s"].as_f64().unwrap())
        .collect();
    assert_eq!(changes.len(), 3);
    for (nth, at) in changes.iter().enumerate() {
        assert!((at - 14_400.0 * (nth + 1) as f64).abs() < 120.0, "{at} s");
        let next = changes.get(nth + 1).copied().unwrap_or(f64::INFINITY);
        for (way, name) in ["without", "with"].iter().enumerate() {
            let since: Vec<(f64, f64)> = losses[way]
                .iter()
                .map(|(t, loss)| (*t as f64, *loss))
                .filter(|(t, _)| *t >= *at)
                .collect();
            let stable = |from: f64| {
                since
                    .iter()
                    .filter(|(t, _)| (from..=from + 600.0).contains(t))
                    .all(|(_, loss)| *loss < 0.2)
            };
            let end = since.last().unwrap().0;
            let settled = since
                .iter()
                .find(|(t, _)| *t + 600.0 <= end.min(next) && stable(*t));
            let minutes = settling[nth][format!("{name}_min")].as_f64();
            assert_eq!(minutes.is_some(), settled.is_some(), "{nth} {name}");
            if let (Some(minutes), Some((t, _))) = (minutes, settled) {
                close(&[minutes], &[(t - at) / 60.0], 1e-9);
            }
            let largest = since
                .iter()
                .filter(|(t, _)| *t < next)
                .fold(0.0_f64, |most, (_, loss)| most.max(*loss));
            close(
                &[settling[nth][format!("largest_{name}")].as_f64().unwrap()],
                &[largest],
                1e-5,
            );
        }
    }
    let steps: Vec<_> = worth["steps"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| [&s["from"], &s["to"]].map(|v| v.as_f64().unwrap().round()))
        .collect();
    assert_eq!(
        steps,
        [[20.0, 20.0], [20.0, 30.0], [30.0, 50.0], [50.0, 20.0]]
    );
}

#[test]
fn corrections_of_different_units_are_each_worth_what_they_are_in_one() {
    let scratch = Scratch::new("corrections_of_different_units");
    let model = |name: &str, units: [&str; 2]| {
        let node = |nth: usize, axes: &str| {
            let range = if units[nth] == "um" { 50 } else { 50_000 };
            format!(
                "[nodes.c{nth}]\ntype = \"compensate\"\ninputs.rate = \"rate.{axes}\"\n\
                 range = \"{range} {}\"\nmax_rate = \"1000 nm/min\"\nmax_slew = \"50 nm/s\"\n",
                units[nth]
            )
        };
        let nodes = node(0, "{X,Y}") + &node(1, "Z");
        let base = graph("linear-axis-compensate");
        let extends = serde_json::Value::from(base.display().to_string());
        let text = format!(
            "schema = 1\nextends = {extends}\nname = \"{name}\"\n{nodes}[outputs]\nx = \"c0\"\nz = \"c1\"\n"
        );
        let file = scratch.file(&format!("{name}.toml"), text);
        let days = simulated(&scratch, "fit.csv", "linear-axis", 1.0, 1);
        let model = scratch.path(&format!("{name}.json"));
        athermal_on("fit", &file, &days, &[&"-o", &model]).ended(0);
        model
    };
    let days = simulated(&scratch, "days.csv", "linear-axis", 0.5, 2);
    let told = |units: [&str; 2]| {
        let model = model(&units[1..].concat(), units);
        report(&model, &days, &[&"--format", &"json"]).json()["verdicts"].clone()
    };
    let (alike, mixed) = (told(["um", "um"]), told(["um", "nm"]));
    for nth in 0..3 {
        for figure in ["without_correction", "with_correction"] {
            let of = |told: &Value| told[nth][figure].as_f64().unwrap();
            close(&[of(&mixed)], &[of(&alike)], 1e-9);
        }
        let of = |figure: &str| mixed[nth][figure].as_f64().unwrap();
        assert!(of("with_correction") < 0.7 * of("without_correction"));
    }
}

#[test]
fn a_correction_at_the_end_of_its_range_is_told_and_moves_its_axis_no_further() {
    let scratch = Scratch::new("a_correction_at_the_end_of_its_range");
    let base = graph("linear-axis-compensate");
    let extends = serde_json::Value::from(base.display().to_string());
    let text = format!(
        "schema = 1\nextends = {extends}\n[nodes.c]\ntype = \"compensate\"\ninputs.rate = \"rate.*\"\nrange = \"100 nm\"\n\
         max_rate = \"1000 nm/min\"\nmax_slew = \"50 nm/s\"\n[outputs]\nc = \"c\"\n"
    );
    let file = scratch.file("narrow.toml", text);
    let [first, second] = [("fit.csv", 1), ("days.csv", 2)]
        .map(|(name, seed)| simulated(&scratch, name, "linear-axis", 0.5, seed));
    let model = scratch.path("model.json");
    athermal_on("fit", &file, &first, &[&"-o", &model]).ended(0);
    let told = report(&model, &second, &[]).out;
    let facts = report(&model, &second, &[&"--format", &"json"]).json();
    for departure in facts["worth"]["departures"].as_array().unwrap() {
        let axis = departure["axis"].as_str().unwrap();
        let share = departure["held_back"]["at the end of its range"]
            .as_f64()
            .unwrap();
        let sentence = format!(
            "The correction of {axis} is at the end of its range {:.0} % of the time.",
            100.0 * share
        );
        assert!(
            share > 0.1 && told.contains(&sentence),
            "{sentence}\n{told}"
        );
        let [without, with] =
            ["largest_without", "largest_with"].map(|of| departure[of].as_f64().unwrap());
        assert_eq!(departure["unit"], "nm");
        assert!(
            without > 500.0 && (with - without).abs() <= 200.0,
            "{axis}: {without}, {with}"
        );
    }
}

#[test]
fn the_page_has_all_its_sections_and_asks_for_nothing_from_elsewhere() {
    let scratch = Scratch::new("the_page_has_all_its_sections");
    let model = fitted(&scratch, "die-tester-control", "die-tester");
    let days = simulated(&scratch, "days.csv", "die-tester", 0.5, 2);
    let (page, plots) = (scratch.path("report.html"), scratch.path("plots"));
    let told = report(&model, &days, &[&"-o", &page, &"--plots", &plots]);
    assert!(
        told.out.contains("Z1: rate predicts the drift")
            && told.out.contains("Five-minute losses below 0.2 dB")
    );
    assert!(
        told.out.lines().all(|line| line.chars().count() <= 80),
        "{}",
        told.out
    );
    let html = std::fs::read_to_string(&page).unwrap();
    for section in [
        "What the correction is worth",
        "Largest loss per temperature step",
        "Scores",
        "Drift over time",
        "Votes, features and errors",
        "Correlation of features with drift.Z1",
        "Outside of what was learned",
        "Step response of thermal.Z1",
        "Impulse response of thermal.Z1",
        "Z1 weights in vote",
        "Chosen features",
        "Sensors",
        "Model card",
    ] {
        assert!(html.contains(section), "`{section}` is missing");
    }
    let plain = html.replace("http://www.w3.org/2000/svg", "");
    for from_elsewhere in [
        "http:",
        "https:",
        "src=",
        "url(",
        "@import",
        "<link rel=\"stylesheet\"",
        "fetch(",
    ] {
        assert!(
            !plain.contains(from_elsewhere),
            "`{from_elsewhere}` is on the page"
        );
    }
    let mut pictures: Vec<String> = std::fs::read_dir(&plots)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    pictures.sort();
    for name in [
        "drift-Z1",
        "votes-X2",
        "weights-Y1",
        "scatter-Z2",
        "histogram-Z2",
        "autocorrelation-Z2",
        "loss",
    ] {
        assert!(
            pictures.contains(&format!("{name}.svg")),
            "{name}: {pictures:?}"
        );
    }
}

#[test]
fn a_week_fits_on_a_page_of_three_megabytes() {
    let scratch = Scratch::new("a_week_fits_on_a_page");
    let model = fitted(&scratch, "die-tester-control", "die-tester");
    // Of a week the page has a quarter more than of two days: what is drawn is thinned.
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let (days, bound) = if is_long {
        (7.0, 3_000_000)
    } else {
        (2.0, 2_400_000)
    };
    let data = simulated(&scratch, "days.csv", "die-tester", days, 2);
    let page = report(&model, &data, &[&"-o", &"-"]).out;
    assert!(page.ends_with("</html>"));
    assert!(page.len() < bound, "{} bytes", page.len());
}

#[test]
fn weights_of_a_vote_add_up_to_one_at_every_truth() {
    let scratch = Scratch::new("weights_of_a_vote");
    let model = fitted(&scratch, "linear-axis", "linear-axis");
    let days = simulated(&scratch, "days.csv", "linear-axis", 0.5, 2);
    let facts = report(&model, &days, &[&"--format", &"json"]).json();
    let axis = &facts["course"]["axes"][1];
    let weights: Vec<Vec<f64>> = axis["weights"]
        .as_array()
        .unwrap()
        .iter()
        .map(|w| numbers(&w["value"]))
        .collect();
    assert_eq!(weights.len(), 3);
    let sums: Vec<f64> = (0..weights[0].len())
        .map(|i| weights.iter().map(|w| w[i]).filter(|w| !w.is_nan()).sum())
        .collect();
    let given: Vec<f64> = sums.into_iter().filter(|sum| *sum > 0.0).collect();
    assert!(given.len() > 400);
    close(&given, &vec![1.0; given.len()], 1e-9);
    // There is no correction.
    assert!(facts["worth"].is_null());
}

#[test]
fn a_sensor_that_failed_is_told_with_what_was_wrong() {
    let scratch = Scratch::new("a_sensor_that_failed");
    let model = fitted(&scratch, "linear-axis-control", "linear-axis");
    let days = scratch.path("days.csv");
    athermal(&[
        &"simulate",
        &"linear-axis",
        &"--days",
        &"0.5",
        &"--seed",
        &"2",
        &"-o",
        &days,
        &"--fault",
        &"temperature.t1=missing,from=2h,for=1h",
        &"--fault",
        &"temperature.t2=stuck,from=4h,for=1h",
    ])
    .ended(0);
    // A reading of 900 °C is out of range, and an infinite one is none.
    let text = std::fs::read_to_string(&days).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for (line, reading) in [(100, "900"), (200, "900"), (300, "inf")] {
        let mut cells: Vec<&str> = lines[line].split(',').collect();
        cells[3] = reading;
        lines[line] = cells.join(",");
    }
    let days = scratch.file("odd.csv", lines.join("\n"));
    let told = report(&model, &days, &[]).out;
    let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
    for expected in [
        "temperature.t1: 1 gap, the longest 60.2 min",
        "temperature.t3: 2 out of range; 1 infinite",
        "stuck at",
    ] {
        assert!(told.contains(expected), "`{expected}` is not in: {told}");
    }
    let facts = report(&model, &days, &[&"--format", &"json"]).json();
    let sensor = |name: &str| {
        let sensors = facts["course"]["sensors"].as_array().unwrap();
        sensors
            .iter()
            .find(|s| s["name"] == format!("temperature.{name}"))
            .unwrap()
            .clone()
    };
    let (stuck, sound) = (sensor("t2"), sensor("t4"));
    // An hour of 10 s samples, the first five minutes of which are not yet suspicious.
    let ticks = stuck["health"]["stuck"].as_f64().unwrap();
    assert!((ticks - 330.0).abs() < 3.0, "{ticks}");
    assert!(stuck["most_unchanged"].as_f64().unwrap() >= 360.0);
    assert_eq!(sound["health"].as_object().unwrap().len(), 1);
    // The column is slow, so that what differs from sample to sample is the noise of 1 mK.
    let noise = sensor("t3")["noise"].as_f64().unwrap();
    assert!((0.9e-3..1.1e-3).contains(&noise), "{noise}");
    // Axes drift, and far in some minutes; the scatter of a position is 12 nm.
    let sensors = facts["course"]["sensors"].as_array().unwrap();
    let position = sensors
        .iter()
        .find(|of| of["name"] == "position.X")
        .unwrap();
    let noise = position["noise"].as_f64().unwrap();
    assert!((11.0..14.0).contains(&noise), "{noise}");
    assert_eq!(sensor("t3")["rejected"], 3);
}

#[test]
fn data_without_a_channel_are_a_wrong_request_to_report_as_to_evaluate() {
    let scratch = Scratch::new("data_without_a_channel");
    let data = scratch.file("data.csv", "time_s,room_degC\n0,20\n10,21\n");
    let model = fitted(&scratch, "linear-axis", "linear-axis");
    for command in ["evaluate", "report"] {
        athermal_on(command, &model, &data, &[]).ended(2);
    }
}

#[test]
fn a_graph_without_a_prediction_is_told_so() {
    let scratch = Scratch::new("a_graph_without_a_prediction");
    let text = "schema = 1\nname = \"air\"\n[time]\ncolumn = \"time_s\"\n[signals.air]\nunit = \"Cel\"\nchannels = [\"room\"]\ncolumn = \"room_degC\"\n\
                [nodes.slope]\ntype = \"slope\"\ninputs.signal = \"air\"\nwindows = [\"5min\"]\n[outputs]\nslope = \"slope\"\n";
    let graph = scratch.file("air.toml", text);
    let days = simulated(&scratch, "days.csv", "die-tester", 0.05, 2);
    let page = scratch.path("air.html");
    let told = report(&graph, &days, &[&"-o", &page]);
    told.tells(&["no prediction of a measured truth"]);
    assert!(std::fs::read_to_string(page).unwrap().contains("air.room"));
}

#[test]
fn the_verdict_tells_the_errors_of_the_table() {
    let scratch = Scratch::new("the_verdict_tells_the_errors_of_the_table");
    let model = fitted(&scratch, "linear-axis", "linear-axis");
    let days = simulated(&scratch, "days.csv", "linear-axis", 0.5, 2);
    let facts = report(&model, &days, &[&"--format", &"json"]).json();
    for verdict in facts["verdicts"].as_array().unwrap() {
        let (axis, node) = (verdict["axis"].as_str().unwrap(), &verdict["node"]);
        let scores = facts["scores"].as_array().unwrap().iter();
        let mut of_axis = scores.filter(|of| of["truth"] == format!("drift.{axis}"));
        let score = of_axis.find(|of| of["node"] == *node).unwrap();
        assert_eq!(verdict["rmse"], score["rmse"], "{axis}");
        assert_eq!(verdict["baseline_zero"], score["baseline_zero"], "{axis}");
    }
}

#[test]
fn the_scores_of_a_report_are_those_of_an_evaluation() {
    let scratch = Scratch::new("report-scores");
    let model = fitted(&scratch, "linear-axis", "linear-axis");
    let days = simulated(&scratch, "days.csv", "linear-axis", 0.5, 2);
    let facts = report(&model, &days, &[&"--format", &"json"]).json();
    let more: [&dyn AsRef<std::ffi::OsStr>; 2] = [&"--format", &"json"];
    let scores = athermal_on("evaluate", &model, &days, &more)
        .ended(0)
        .json();
    assert!(facts["scores"][0]["interval"].is_object());
    assert_eq!(facts["scores"], scores["scores"]);
}

#[test]
fn dates_are_shown_as_hours_since_the_first_and_nothing_is_shaded_without_limits() {
    let scratch = Scratch::new("dates_are_shown_as_hours");
    let text = "schema = 1\nname = \"dated\"\n[time]\ncolumn = \"time\"\nunit = \"rfc3339\"\n\
                [signals.position]\nunit = \"nm\"\nchannels = [\"z\"]\nmax_age = \"1min\"\n\
                [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"5min\"]\nunit = \"nm/min\"\n\
                [nodes.predicted]\ntype = \"persistence\"\ninputs.truth = \"drift.z\"\nahead = \"5min\"\n\
                [outputs]\npredicted = \"predicted\"\n";
    let graph = scratch.file("dated.toml", text);
    let rows = (0..480).map(|minute| {
        let position = 4000.0 * (f64::from(minute) / 60.0).sin();
        format!(
            "2026-03-15T{:02}:{:02}:00Z,{position}\n",
            8 + minute / 60,
            minute % 60
        )
    });
    let data = scratch.file("log.csv", format!("time,z\n{}", rows.collect::<String>()));
    let (page, plots) = (scratch.path("page.html"), scratch.path("plots"));
    report(&graph, &data, &[&"-o", &page, &"--plots", &plots]);
    let page = std::fs::read_to_string(page).unwrap();
    let plot = std::fs::read_to_string(plots.join("drift-z.svg")).unwrap();
    for shown in [&page, &plot] {
        assert!(shown.contains("hours since 2026-03-15T08:00:00Z"));
        // 492680 hours have passed since 1970.
        assert!(
            !shown.contains(">4926") && shown.contains(">4</text>"),
            "{plot}"
        );
        assert!(!shown.contains("class=\"s1\"") && !shown.contains("class=\"s2\""));
    }
    assert!(!page.contains("Shaded"), "no limits are given");
    let from: f64 = (page
        .split("data-x0=\"")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap())
    .parse()
    .unwrap();
    assert!((0.0..3600.0).contains(&from), "{from}");
}
