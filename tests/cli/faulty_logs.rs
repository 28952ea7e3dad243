//! Logs in which a sensor failed or a position was zeroed anew, and doubtful graphs: who fits, scores or reports is told before
//! anything is learned from them unseen.

use std::fmt::Write as _;

use crate::workbench::{Graph, Scratch, athermal, athermal_on};

/// A position that follows one temperature at once.
fn thermal() -> Graph {
    Graph::new()
        .time("time_s")
        .signal("temperature", "Cel", "plate room", "1min")
        .with("column = '{channel}_degC'")
        .signal("position", "nm", "Z", "1min")
        .with("column = '{channel}_nm'")
        .model("thermal", "linear", "temperature", "position.Z", "0s")
        .outputs("predicted = 'thermal'")
}

/// Between -1 and 1, in no order.
fn noise(row: usize, of: f64) -> f64 {
    let x = (row as f64 * 12.9898 + of).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

/// Temperatures of a plate and a room that go up and down within hours; a value a minute.
fn temperatures(row: usize) -> (f64, f64) {
    let minutes = row as f64;
    (
        22.0 + 2.0 * (minutes / 170.0).sin() + 0.01 * noise(row, 1.0),
        21.0 + (minutes / 60.0).cos() + 0.01 * noise(row, 2.0),
    )
}

/// A log of two days with what `fault` makes of plate, room and position.
fn log(fault: impl Fn(usize, &mut [f64; 3])) -> String {
    let mut text = String::from("time_s,plate_degC,room_degC,Z_nm\n");
    for row in 0..2880 {
        let (plate, room) = temperatures(row);
        let mut values = [plate, room, 400.0 * plate - 150.0 * room + noise(row, 3.0)];
        fault(row, &mut values);
        let [plate, room, z] = values;
        let room = if room.is_nan() {
            String::new()
        } else {
            format!("{room:.3}")
        };
        let _ = writeln!(text, "{},{plate:.3},{room},{z:.1}", 60 * row);
    }
    text
}

/// The plate's sensor broken for an hour.
fn broken(row: usize, values: &mut [f64; 3]) {
    if (1000..1060).contains(&row) {
        values[0] = 850.0;
    }
}

fn in_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_fit_names_the_sensor_that_failed_in_its_data() {
    let scratch = Scratch::new("faulty-sensor");
    let (graph, data) = (
        scratch.file("graph.toml", thermal()),
        scratch.file("log.csv", log(broken)),
    );
    let model = scratch.path("model.json");
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    let line = fitted
        .told
        .lines()
        .find(|line| line.contains("leaps"))
        .unwrap();
    assert!(
        line.starts_with("warning: temperature.plate leaps 2 times, first from 21.")
            && line.contains("to 850.0 within one sample, at 60000 s: did the sensor fail?")
            && line.contains("a `range` in [signals.temperature]"),
        "{line}"
    );
    let json = athermal_on("fit", &graph, &data, &[&"-o", &model, &"--format", &"json"]).ended(0);
    let leaps = &json.json()["leaps"];
    assert_eq!(leaps.as_array().unwrap().len(), 1);
    assert_eq!(leaps[0]["channel"], "temperature.plate");
    assert_eq!(leaps[0]["first"]["to"], 850.0);

    let ranged = thermal().replacen("max_age", "range = [\"-30 Cel\", \"75 Cel\"]\nmax_age", 1);
    let graph = scratch.file("ranged.toml", ranged);
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    fitted.tells(&["temperature.plate: 60 samples are infinite or out of range"]);
    assert!(!fitted.told.contains("leaps"), "{}", fitted.told);
}

#[test]
fn a_fit_names_the_position_that_was_zeroed_anew_and_says_nothing_of_sound_data() {
    let scratch = Scratch::new("faulty-zero");
    let graph = scratch.file("graph.toml", thermal());
    let zeroed = log(|row, values| values[2] -= if row < 2000 { 0.0 } else { 900.0 });
    let (zeroed, sound) = (
        scratch.file("zeroed.csv", zeroed),
        scratch.file("sound.csv", log(|_, _| ())),
    );
    let model = scratch.path("model.json");
    let fitted = athermal_on("fit", &graph, &zeroed, &[&"-o", &model]).ended(0);
    fitted.tells(&[
        "warning: position.Z leaps once from ",
        "at 120000 s: was it moved, or zeroed anew? That is no drift: truths whose window holds it are left out",
    ]);
    let fitted = athermal_on("fit", &graph, &sound, &[&"-o", &model]).ended(0);
    assert!(!fitted.told.contains("warning"), "{}", fitted.told);
}

#[test]
fn a_log_that_is_split_where_its_position_was_zeroed_anew_has_no_leap_in_segments_of_its_own() {
    let scratch = Scratch::new("split");
    let graph = scratch.file("graph.toml", thermal());
    let whole = log(|row, values| values[2] -= if row < 1500 { 0.0 } else { 4000.0 });
    let (header, rows) = whole.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let part =
        |name: &str, rows: &[&str]| scratch.file(name, format!("{header}\n{}\n", rows.join("\n")));
    let (one, two) = (
        part("one.csv", &rows[..1500]),
        part("two.csv", &rows[1500..]),
    );
    let fit = |more: &[&str]| {
        let model = scratch.path("model.json");
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> =
            vec![&"fit", &graph, &"--data", &two, &one, &"-o", &model];
        arguments.extend(more.iter().map(|of| of as &dyn AsRef<std::ffi::OsStr>));
        athermal(&arguments).ended(0)
    };
    let joined = fit(&[]);
    joined.tells(&["position.Z leaps once"]);
    joined.tells(&["`--segments`"]);
    let apart = fit(&["--segments"]);
    assert!(!apart.told.contains("leaps"), "{}", apart.told);
    // Long paths wrap the command that is advised.
    let words: Vec<&str> = apart.told.split_whitespace().collect();
    assert!(
        words.join(" ").contains("--segments --data"),
        "{}",
        apart.told
    );
    assert_eq!(
        fit(&["--segments", "--format", "json"]).json()["segments"],
        2
    );
}

#[test]
fn a_leap_between_usual_values_is_nothing_that_a_range_takes_out() {
    let scratch = Scratch::new("leap-within");
    // The contact is bad for an hour: what it says is off by a kelvin and a half, as warm as the plate is now and then.
    let data = log(|row, values| {
        if (1000..1060).contains(&row) {
            values[0] += if values[0] < 22.0 { 1.5 } else { -1.5 };
        }
    });
    let data = scratch.file("data.csv", data);
    let (graph, model) = (
        scratch.file("graph.toml", thermal()),
        scratch.path("model.json"),
    );
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    fitted.tells(&[
        "temperature.plate leaps",
        "no `range` takes out such samples alone, so leave these rows out",
    ]);
    assert!(!fitted.told.contains("nine in ten"), "{}", fitted.told);
}

#[test]
fn a_starter_graph_keeps_what_a_failed_sensor_says_out_of_the_fit() {
    let scratch = Scratch::new("faulty-start");
    let data = scratch.file("log.csv", log(broken));
    let graph = scratch.path("graph.toml");
    let mut begun = athermal(&[&"init", &data, &"-o", &graph]).ended(0);
    begun.told = in_one_line(&begun.told);
    begun.tells(&[
        "plate_degC: temperature",
        "it leaps 2 times, first from 21.",
        "60 values far from all others are taken for faults",
    ]);
    let text = std::fs::read_to_string(&graph).unwrap();
    let range = text
        .lines()
        .find(|line| line.starts_with("range ="))
        .unwrap();
    assert!(
        range.starts_with("range = [\"-81 Cel\", \"125 Cel\"]  # seen: 19.99 to 24.01;"),
        "{range}"
    );
    let model = scratch.path("model.json");
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    fitted.tells(&["temperature.plate: 60 samples are infinite or out of range"]);
    assert!(!fitted.told.contains("leaps"), "{}", fitted.told);
}

#[test]
fn a_report_says_which_sensors_leap_or_lie_where_the_fit_saw_none() {
    let scratch = Scratch::new("faulty-report");
    let (graph, sound) = (
        scratch.file("graph.toml", thermal()),
        scratch.file("sound.csv", log(|_, _| ())),
    );
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &sound, &[&"-o", &model]).ended(0);
    let faulty = scratch.file("faulty.csv", log(broken));
    let page = scratch.path("page.html");
    let report = athermal_on("report", &model, &faulty, &[&"-o", &page]).ended(0);
    let told = in_one_line(&report.out);
    assert!(
        told.contains("Sensors to look at: temperature.plate: the same value 60 times; leaps 2 times, first from 21.")
            && told.contains("to 850.0 within one sample; from 20.0 to 850, far outside of what the fit saw, 20.0 to 24.0"),
        "{told}"
    );
    let page = std::fs::read_to_string(&page).unwrap();
    assert_eq!(page.matches("in order</td>").count(), 2);
}

/// The room's sensor that says the same from a third of the log on.
fn frozen(row: usize, values: &mut [f64; 3]) {
    values[1] = temperatures(row.min(960)).1;
}

/// The same that says nothing from there on.
fn dead(row: usize, values: &mut [f64; 3]) {
    if row > 960 {
        values[1] = f64::NAN;
    }
}

#[test]
fn whoever_reads_a_log_is_told_of_a_sensor_that_froze_or_fell_silent_in_it() {
    let scratch = Scratch::new("faulty-silent");
    let graph = scratch.file("graph.toml", thermal());
    let file = |name: &str, text: String| scratch.file(name, text);
    let sound = file("sound.csv", log(|_, _| ()));
    let (sound_model, model) = (scratch.path("sound.json"), scratch.path("model.json"));
    athermal_on("fit", &graph, &sound, &[&"-o", &sound_model]).ended(0);
    for (name, fault, expected, in_fit, in_scores) in [
        (
            "frozen.csv",
            frozen as fn(usize, &mut [f64; 3]),
            "warning: temperature.room is 20.036 in 1,920 samples one after the other, from 57600 s to 172740 s: \
             is the sensor stuck?",
            "That is learned too: leave these rows out",
            "Predictions from that mean little",
        ),
        (
            "dead.csv",
            dead,
            "warning: temperature.room has no sample in 1,919 of 2,880 rows, from 57660 s to 172740 s: did the sensor fail?",
            "What needs it learns nothing there",
            "What needs it predicts nothing there",
        ),
    ] {
        let data = file(name, log(fault));
        let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
        fitted.tells(&[expected, in_fit]);
        for command in ["evaluate", "diagnose"] {
            athermal_on(command, &sound_model, &data, &[])
                .ended(0)
                .tells(&[expected, in_scores]);
        }
        let other = file("other.toml", thermal().replace("linear", "rls"));
        let compared =
            athermal_on("compare", &graph, &sound, &[&"--on", &data, &"--", &other]).ended(0);
        assert_eq!(
            compared.told.matches(expected).count(),
            1,
            "{}",
            compared.told
        );
        let told = athermal_on("evaluate", &sound_model, &data, &[&"--format", &"json"]).ended(0);
        let told = told.json();
        let found = [&told["stuck"], &told["silent"]].map(|found| found[0]["channel"].as_str());
        let of = (name == "frozen.csv", name == "dead.csv");
        assert_eq!((found[0].is_some(), found[1].is_some()), of, "{told}");
    }
    let revived = |row: usize, values: &mut [f64; 3]| {
        if row < 1920 {
            frozen(row, values);
        }
    };
    let revived = file("revived.csv", log(revived));
    let fitted = athermal_on("fit", &graph, &revived, &[&"-o", &model]).ended(0);
    fitted.tells(&["warning: temperature.room is 20.036 in 960 samples one after the other"]);
    // That it goes on is no failure of its own.
    assert!(!fitted.told.contains("leaps"), "{}", fitted.told);
    let watched = thermal().replace(
        "inputs.features = \"temperature\"",
        "inputs.features = \"watched\"",
    );
    let watched = watched.replace(
        "[nodes.thermal]",
        "[nodes.watched]\ntype = \"health\"\ninputs.signal = \"temperature\"\nstuck_after = \"10min\"\n[nodes.thermal]",
    );
    let watched = file("watched.toml", watched);
    let fitted = athermal_on(
        "fit",
        &watched,
        &scratch.path("frozen.csv"),
        &[&"-o", &model],
    );
    let fitted = fitted.ended(0);
    assert!(!fitted.told.contains("stuck"), "{}", fitted.told);
}

#[test]
fn a_sensor_without_any_sample_and_positions_that_stop_are_told_by_whoever_scores_or_runs() {
    let scratch = Scratch::new("faulty-from-the-start");
    let graph = scratch.file("graph.toml", thermal());
    let (sound, model) = (
        scratch.file("sound.csv", log(|_, _| ())),
        scratch.path("model.json"),
    );
    athermal_on("fit", &graph, &sound, &[&"-o", &model]).ended(0);
    let never = |_: usize, values: &mut [f64; 3]| values[1] = f64::NAN;
    let stops = |row: usize, values: &mut [f64; 3]| {
        if row > 960 {
            values[2] = f64::NAN;
        }
    };
    let told_of = |log: String, expected: &str| {
        let data = scratch.file("log.csv", log);
        let scored = athermal_on("evaluate", &model, &data, &[]);
        let ran = athermal(&[&"run", &model, &"-i", &data]);
        for told in [scored.told, ran.told] {
            assert!(in_one_line(&told).contains(expected), "{told}");
        }
    };
    told_of(
        log(never),
        "temperature.room has no sample in any of 2,880 rows: is the sensor connected, and its column the right one?",
    );
    told_of(
        log(stops),
        "position.Z has no sample in 1,919 of 2,880 rows, from 57660 s to 172740 s: is it not measured any more?",
    );
    // Where positions are measured for the fit alone, that is as it should be.
    let unmeasured = log(|_, values| values[2] = f64::NAN);
    let data = scratch.file("unmeasured.csv", unmeasured);
    let ran = athermal(&[&"run", &model, &"-i", &data]).ended(0);
    assert!(!ran.told.contains("no sample"), "{}", ran.told);
}

#[test]
fn a_coarse_sensor_that_freezes_looks_stuck_though_it_often_repeats_its_value() {
    let scratch = Scratch::new("faulty-coarse");
    let coarse = |frozen: bool| {
        log(move |row, values| {
            let at = if frozen {
                row.min(1500).max(row.saturating_sub(900))
            } else {
                row
            };
            values[1] = (10.0 * temperatures(at).1).round() / 10.0;
        })
    };
    let graph = scratch.file("graph.toml", thermal());
    let (sound, frozen) = (
        scratch.file("sound.csv", coarse(false)),
        scratch.file("frozen.csv", coarse(true)),
    );
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &sound, &[&"-o", &model]).ended(0);
    let of_sound = athermal_on("report", &model, &sound, &[]).ended(0);
    assert!(!of_sound.out.contains("the same value"), "{}", of_sound.out);
    let of_frozen = athermal_on("report", &model, &frozen, &[]).ended(0);
    assert!(
        of_frozen.out.contains("temperature.room: the same value 9"),
        "{}",
        of_frozen.out
    );
}

#[test]
fn what_is_doubtful_in_a_graph_is_told_by_the_fit_too() {
    let scratch = Scratch::new("faulty-unit");
    let graph = thermal().replace("unit = \"nm\"", "unit = \"um\"");
    let (graph, data) = (
        scratch.file("graph.toml", graph),
        scratch.file("log.csv", log(|_, _| ())),
    );
    let model = scratch.path("model.json");
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model, &"--format", &"json"]).ended(0);
    fitted.tells(&["warning[A069]", "graph.toml:"]);
    assert!(fitted.json()["ticks"].is_u64());
    let scored = athermal_on("evaluate", &model, &data, &[]).ended(0);
    assert!(!scored.told.contains("A069"), "{}", scored.told);
}

#[test]
fn a_unit_below_the_name_of_a_column_that_is_not_that_of_its_signal_is_told() {
    let scratch = Scratch::new("faulty-unit-row");
    let graph = thermal().replace("column = \"{channel}_nm\"", "column = \"{channel}\"");
    let log = log(|_, _| ()).replacen("Z_nm\n", "Z\ns,degC,degC,um\n", 1);
    let (graph, data) = (
        scratch.file("graph.toml", graph),
        scratch.file("log.csv", log),
    );
    let model = scratch.path("model.json");
    let fitted = athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    fitted.tells(&[
        "log.csv: `um` stands below the name of the column `Z`, and position.Z takes its numbers for nm: correct `unit`",
    ]);
    assert_eq!(
        fitted.told.matches("stands below").count(),
        1,
        "{}",
        fitted.told
    );
}

#[test]
fn scores_on_the_data_of_the_fit_are_told_to_be_that() {
    let scratch = Scratch::new("faulty-seen");
    let (graph, data) = (
        scratch.file("graph.toml", thermal()),
        scratch.file("log.csv", log(|_, _| ())),
    );
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    let copied = scratch.file("copy.csv", std::fs::read(&data).unwrap());
    let told = "copy.csv: the model was fitted on this file";
    athermal_on("evaluate", &model, &copied, &[])
        .ended(0)
        .tells(&[told]);
    athermal_on("report", &model, &copied, &[])
        .ended(0)
        .tells(&[told]);
    let other = scratch.file("other.csv", log(|_, values| values[2] += 0.1));
    let scored = athermal_on("evaluate", &model, &other, &[]).ended(0);
    assert!(!scored.told.contains("fitted on"), "{}", scored.told);
}

#[test]
fn scores_say_how_much_they_leave_out_where_one_of_several_predictions_fell_silent() {
    let scratch = Scratch::new("faulty-left-out");
    let several = thermal().replace(
        "[outputs]",
        "[nodes.last]\ntype = \"persistence\"\ninputs.truth = \"position.Z\"\nahead = \"0s\"\n\
         [nodes.fall]\ntype = \"fallback\"\ninputs.voters = [\"thermal\", \"last\"]\n[outputs]",
    );
    let several = several.replace("predicted = \"thermal\"", "predicted = \"fall\"");
    let graph = scratch.file("graph.toml", several);
    let silent_late = |row: usize, values: &mut [f64; 3]| {
        if row >= 1600 {
            values[1] = f64::NAN;
        }
    };
    let (sound, data) = (
        scratch.file("sound.csv", log(|_, _| ())),
        scratch.file("silent.csv", log(silent_late)),
    );
    let model = scratch.path("model.json");
    athermal_on("fit", &graph, &sound, &[&"-o", &model]).ended(0);
    let mut scored = athermal_on("evaluate", &model, &data, &[]).ended(0);
    scored.told = in_one_line(&scored.out);
    scored.tells(&["1,279 of 2,879 instants at which last.Z is there are left out, since others are not, such as thermal.Z"]);
    let rmse = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let scores = athermal_on("evaluate", &model, &data, more).ended(0).json();
        let scores = scores["scores"].as_array().unwrap().clone();
        let fall = scores.iter().find(|score| score["node"] == "fall").unwrap();
        fall["rmse"].as_f64().unwrap()
    };
    let together = rmse(&[&"--format", &"json"]);
    let alone = rmse(&[&"--each-on-its-own", &"--format", &"json"]);
    assert_eq!(alone, together, "what is put out counts whenever it is");
    let facts = athermal_on("report", &model, &data, &[&"--format", &"json"]).ended(0);
    assert_eq!(facts.json()["verdicts"][0]["rmse"].as_f64().unwrap(), alone);
    athermal_on("compare", &graph, &sound, &[&"--on", &data])
        .ended(0)
        .tells(&[
            "position.Z: 1,280 instants are left out at which others predict and thermal of ",
        ]);
}
