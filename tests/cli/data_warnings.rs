//! What is told of data that make an answer worth less than it looks: that they are those of the fit, that a correction moved them,
//! that none of them is new.

use std::fmt::Write as _;

use crate::workbench::{Graph, Scratch, athermal, athermal_on};

/// A drift by one temperature: of which signal or node it is the slope, and in which unit time is. `RATE` stands for what is integrated.
fn graph(position: &str, time: &str) -> Graph {
    Graph::named("stage")
        .time("time")
        .with(&format!("unit = '{time}'"))
        .signal("temperature", "Cel", "t", "1min")
        .signal("position", "nm", "Z", "1min")
        .signal("applied", "nm", "Z", "1min")
        .with("column = 'applied'; optional = ['Z']")
        .section("nodes.free", "type = 'uncorrected'")
        .with("inputs = { position = 'position', applied = 'applied' }; until_first = 'zero'")
        .section("nodes.beside", "type = 'uncorrected'")
        .with("inputs.position = 'position'")
        .slope("drift", position, "5min", "nm/min")
        .slope("gradient", "temperature", "5min", "mK/min")
        .model("thermal", "linear", "gradient", "drift.Z", "150s")
        .vote("vote", "auto_weighted", "['thermal']", "drift.Z")
        .with("memory = '15min'")
        .section("nodes.correction", "type = 'compensate'")
        .with("inputs.rate = 'RATE'; range = '50 um'; max_rate = '1000 nm/min'")
        .with("max_slew = '50 nm/s'")
        .outputs("predicted = 'vote'; correction = 'correction'")
}

/// Six hours, one row a minute, from an instant in min on; its time as seconds or as a date of 2026.
fn log(from: i64, rows: i64, dated: bool) -> String {
    let mut text = String::from("time,t,Z\n");
    for minute in from..from + rows {
        let t = 20.0 + (minute as f64 / 40.0).sin();
        let noise = ((minute * 7919) % 13) as f64;
        let time = if dated {
            let (day, of_day) = (1 + minute / 1440, minute % 1440);
            format!("2026-03-{day:02}T{:02}:{:02}:00Z", of_day / 60, of_day % 60)
        } else {
            (60 * minute).to_string()
        };
        let _ = writeln!(text, "{time},{t:.4},{:.1}", 500.0 * t + noise);
    }
    text
}

#[test]
fn a_correction_that_goes_by_positions_which_it_moves_is_a_mistake_in_its_graph() {
    let scratch = Scratch::new("feedback");
    let told =
        "error[A162]: the correction goes by past drifts of `position.Z`, which it moves itself";
    for (position, rate, moved) in [
        ("position", "vote", true),
        ("position", "thermal", false),
        ("free", "vote", false),
        ("beside", "vote", false),
    ] {
        let text = graph(position, "s").replace("RATE", rate);
        let check = athermal(&[&"check", &scratch.file("graph.toml", text)]);
        let (code, what) = (if moved { 2 } else { 0 }, format!("{position} {rate}"));
        let check = check.ended(code);
        assert_eq!(check.told.contains(told), moved, "{what}: {}", check.told);
        assert_eq!(
            check.told.contains("put an `uncorrected` node"),
            moved,
            "{what}"
        );
    }
    // A learner or a lag is a past truth as a vote is.
    for model in ["rls", "persistence"] {
        let text = graph("position", "s")
            .to_string()
            .replace("RATE", "thermal");
        let text = text.replace("type = \"linear\"", &format!("type = \"{model}\""));
        let text = match model {
            "persistence" => text.replace("inputs.features = \"gradient\"\n", ""),
            _ => text,
        };
        let check = athermal(&[&"check", &scratch.file("graph.toml", text)]).ended(2);
        assert!(check.told.contains(told), "{model}: {}", check.told);
    }
    // Nor may truths say which sensor is right.
    let shipped = crate::workbench::graph("die-tester-compensate");
    for (hindsight, code) in [(true, 2), (false, 0)] {
        let text = format!(
            "schema = 1\nextends = '{}'\nname = \"judged\"\nnodes.trusted.hindsight = {hindsight}\n",
            shipped.display()
        );
        let check = athermal(&[&"check", &scratch.file("judged.toml", text)]).ended(code);
        assert_eq!(
            check.told.contains("error[A162]"),
            hindsight,
            "{}",
            check.told
        );
    }
}

#[test]
fn a_prediction_that_is_sent_as_a_command_must_not_go_by_what_it_moves() {
    let scratch = Scratch::new("feedback-command");
    for (position, outputs, moved) in [
        ("position", "predicted", true),
        ("free", "predicted", false),
        ("position", "drift", false),
    ] {
        let text = graph(position, "s").to_string().replace("RATE", "thermal");
        let text = text.replace("[outputs]\n", "[outputs]\ndrift = \"drift\"\n");
        scratch.file("graph.toml", text);
        let machine = scratch.file(
            "line.toml",
            format!(
                "schema = 1\nextends = \"graph.toml\"\n[sources.log]\ntype = \"csv\"\npath = \"log.csv\"\n\
                 [sinks.plc]\ntype = \"mqtt\"\nbroker = \"mqtt://localhost\"\ntopic = \"drift\"\noutputs = [\"{outputs}\"]\n\
                 rate = \"1 nm/min/s\"\n"
            ),
        );
        let check = athermal(&[&"check", &machine]).ended(if moved { 2 } else { 0 });
        let told = "error[A215]: `predicted.Z` is sent as a command and goes by past drifts of `position.Z`, which it moves";
        assert_eq!(
            check.told.contains(told),
            moved,
            "{position} {outputs}: {}",
            check.told
        );
    }
}

#[test]
fn dated_data_of_the_time_of_the_fit_are_told_to_be_that() {
    let scratch = Scratch::new("told-overlap");
    let graph = scratch.file(
        "graph.toml",
        graph("position", "rfc3339").replace("RATE", "thermal"),
    );
    let model = scratch.path("model.json");
    let data = scratch.file("log.csv", log(0, 360, true));
    athermal_on("fit", &graph, &data, &[&"-o", &model]).ended(0);
    let told = "the data of the fit are of the time from 2026-03-01T04:00:00Z to 2026-03-01T05:59:00Z too: there the scores show how well \
                it fits, not how well it predicts";
    let grown = scratch.file("grown.csv", log(240, 400, true));
    for command in ["evaluate", "report"] {
        athermal_on(command, &model, &grown, &[])
            .ended(0)
            .tells(&[told]);
    }
    let compared = athermal_on("compare", &graph, &data, &[&"--on", &grown]).ended(0);
    compared.tells(&["the data of the fit are of the time from 2026-03-01T04:"]);
    let compared = athermal_on("compare", &graph, &data, &[&"--on", &data]).ended(0);
    compared.tells(&["log.csv: the graphs are fitted on this file and scored on it"]);
    let later = scratch.file("later.csv", log(400, 360, true));
    let scored = athermal_on("evaluate", &model, &later, &[]).ended(0);
    assert!(!scored.told.contains("the time of"), "{}", scored.told);
}

#[test]
fn a_run_that_goes_on_with_nothing_new_says_so() {
    let scratch = Scratch::new("told-nothing-new");
    let text = graph("position", "s").replace("RATE", "thermal");
    let (graph, model) = (scratch.file("graph.toml", text), scratch.path("model.json"));
    let days = ["one.csv", "two.csv"].map(|name| scratch.file(name, log(0, 360, false)));
    athermal_on("fit", &graph, &days[0], &[&"-o", &model]).ended(0);
    let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
    let run =
        |day| athermal(&[&"run", &model, &"-i", day, &"-o", &out, &"--state", &state]).ended(0);
    run(&days[0]);
    run(&days[1]).tells(&["no row is after what the run before saw last: nothing was predicted"]);
}

#[test]
fn a_run_of_which_nothing_comes_out_says_so_and_where_it_ends() {
    let scratch = Scratch::new("nothing-comes-out");
    let graph = scratch.file(
        "graph.toml",
        "schema = 1\n[time]\ncolumn = \"time_s\"\n[signals.position]\nunit = \"nm\"\nchannels = [\"Z\"]\nmax_age = \"1min\"\n\
         [nodes.drift]\ntype = \"slope\"\ninputs.signal = \"position\"\nwindows = [\"5min\"]\nunit = \"nm/min\"\n\
         [nodes.calm]\ntype = \"moving\"\ninputs.signal = \"drift\"\nwindows = [\"5min\"]\n[outputs]\ncalm = \"calm\"\n",
    );
    let rows = |apart: u32| -> String {
        let rows = (0..200).map(|row| format!("{},{}\n", row * apart, row % 7));
        std::iter::once("time_s,Z\n".to_owned())
            .chain(rows)
            .collect()
    };
    // In milliseconds, as if they were seconds.
    let (far, near) = (
        scratch.file("far.csv", rows(10_000)),
        scratch.file("near.csv", rows(10)),
    );
    let out = scratch.path("out.csv");
    let run = |log: &std::path::Path| {
        athermal(&[&"run", &graph, &"--input", &log, &"--output", &out]).ended(0)
    };
    run(&far).tells(&[
        "no output has a value in any of 200 rows, which are 2.78 h apart; the first to lack one is drift",
    ]);
    assert!(!run(&near).told.contains("no output"));
}
