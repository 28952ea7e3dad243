//! Files that are read twice, and files whose ending names no format.

use std::path::PathBuf;

use super::{csv, desk, rows};
use crate::workbench::{Scratch, athermal, athermal_fed, athermal_on, athermal_unread};

#[test]
fn a_file_that_is_given_twice_is_told_to_count_twice() {
    let (scratch, _, data, model) = desk("twice");
    let again = scratch.path("./").join(data.file_name().unwrap());
    let fit = |data: [&PathBuf; 2]| {
        let output = scratch.path("twice.json");
        athermal(&[&"fit", &model, &"-o", &output, &"--data", data[0], data[1]]).ended(0)
    };
    fit([&data, &again]).tells(&["this file is given more than once, and so often its rows count"]);
    let other = scratch.file("other.csv", csv(&rows(60, 60)));
    let told = fit([&data, &other]).told;
    assert!(!told.contains("more than once"), "{told}");
}

#[test]
fn files_of_the_same_days_are_told_to_overlap() {
    let (scratch, _, counted, model) = desk("overlap");
    let fitted = scratch.path("fitted.toml");
    // Seconds since 1970.
    let since = 1_700_000_000;
    let one = scratch.file("one.csv", csv(&rows(since, 60)));
    let two = scratch.file("two.csv", csv(&rows(since + 400, 60)));
    let fit = |data: [&PathBuf; 2], more: &str| {
        let output = scratch.path("overlap.json");
        let files: [&dyn AsRef<std::ffi::OsStr>; 9] = [
            &"fit",
            &fitted,
            &"-o",
            &output,
            &"--format",
            &more,
            &"--data",
            data[0],
            data[1],
        ];
        athermal(&files).ended(0)
    };
    let told = fit([&one, &two], "table");
    told.tells(&[
        "20 of its 60 rows lie in the period of",
        "one.csv; files are not merged",
    ]);
    let overlaps = serde_json::json!([
        { "file": two.display().to_string(), "with": one.display().to_string(), "rows": 20 }
    ]);
    assert_eq!(fit([&one, &two], "json").json()["overlaps"], overlaps);
    let evaluated = athermal(&[
        &"evaluate",
        &model,
        &"--format",
        &"json",
        &"--data",
        &two,
        &one,
    ])
    .ended(0);
    assert_eq!(evaluated.json()["overlaps"], overlaps);
    // Where each file counts from its own beginning, the times of one say nothing of those of another.
    let later = scratch.file("later.csv", csv(&rows(100, 60)));
    let told = fit([&counted, &later], "json");
    assert!(!told.told.contains("period"), "{}", told.told);
    assert!(told.json().get("overlaps").is_none());
}

#[test]
fn an_ending_that_names_no_format_is_refused_before_anything_is_written() {
    let (scratch, plain, data, _) = desk("ending");
    let unknown = scratch.path("out.xyz");
    let run = |output: &PathBuf| athermal(&[&"run", &plain, &"--input", &data, &"-o", output]);
    run(&unknown)
        .ended(2)
        .tells(&["`.xyz` names no format", "`.csv`", "`.jsonl`"]);
    athermal(&[&"simulate", &"linear-axis", &"-o", &unknown]).ended(2);
    assert!(!unknown.exists());
    let (log, plan) = (scratch.path("log.csv"), scratch.path("plan.jsonl"));
    let simulate: [&dyn AsRef<std::ffi::OsStr>; 4] = [&"simulate", &"die-tester", &"-o", &log];
    let planned = athermal(&[&simulate[..], &[&"--set-points", &plan]].concat());
    planned
        .ended(2)
        .tells(&["plan.jsonl: what is planned is written as CSV", "`.csv`"]);
    assert!(!plan.exists() && !log.exists());
    let without = scratch.path("out");
    run(&without).ended(0);
    let text = std::fs::read_to_string(without).unwrap();
    assert!(text.contains(','), "{text}");
}

#[test]
fn an_output_that_is_one_of_the_inputs_is_refused_and_all_stays_as_it_is() {
    let scratch = Scratch::new("command-line-same-file");
    let graph = scratch.file("graph.toml", super::plain());
    let log = scratch.file("log.csv", "time_s,room,Z\n0,20,1\n10,20.1,2\n");
    let link = scratch.path("link.csv");
    #[cfg(unix)]
    std::os::unix::fs::symlink(&log, &link).unwrap();
    #[cfg(not(unix))]
    std::fs::hard_link(&log, &link).unwrap();
    let before = [&graph, &log].map(|path| std::fs::read(path).unwrap());
    let run: [&dyn AsRef<std::ffi::OsStr>; 3] = [&"run", &graph, &"-i"];
    let with = |first: &[&dyn AsRef<std::ffi::OsStr>], more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let refused = athermal(&[first, more].concat()).ended(2);
        refused.tells(&["would be lost", "name another file"]);
        assert_eq!(refused.out, "");
    };
    with(&run, &[&log, &"-o", &log]);
    with(&run, &[&log, &"-o", &link]);
    with(&run, &[&log, &"--state", &log]);
    with(&[&"fit", &graph], &[&"--data", &log, &"-o", &log]);
    with(&[&"fit", &graph], &[&"--data", &log, &"-o", &graph]);
    with(&[&"report", &graph], &[&"--data", &log, &"-o", &log]);
    with(&[&"report", &graph], &[&"--data", &log, &"-o", &graph]);
    let after = [&graph, &log].map(|path| std::fs::read(path).unwrap());
    assert_eq!(before, after);
}

#[test]
fn times_without_a_zone_are_told_once_and_those_with_one_are_not() {
    let scratch = desk("zone").0;
    let graph = "schema = 1\nextends = \"fitted.toml\"\ntime = { column = \"time_s\", unit = \"rfc3339\" }\n";
    let graph = scratch.file("dated.toml", graph);
    let dated = |zone: &str| {
        let row = |row: &String| {
            let (seconds, rest) = row.split_once(',').unwrap();
            let seconds: u32 = seconds.parse().unwrap();
            let (minutes, seconds) = (seconds / 60, seconds % 60);
            let (hours, minutes) = (minutes / 60, minutes % 60);
            format!("2026-03-02T{hours:02}:{minutes:02}:{seconds:02}{zone},{rest}")
        };
        let half = |from| csv(&rows(from, 60).iter().map(row).collect::<Vec<_>>());
        (
            scratch.file("first.csv", half(0)),
            scratch.file("second.csv", half(60)),
        )
    };
    let model = scratch.path("dated.json");
    for (zone, times) in [("", 1), ("Z", 0)] {
        let (first, second) = dated(zone);
        let fit = athermal(&[&"fit", &graph, &"-o", &model, &"--data", &first, &second]).ended(0);
        let scores = athermal(&[&"evaluate", &model, &"--data", &first, &second]).ended(0);
        for told in [fit.told, scores.told] {
            let found = told.matches("without a zone, taken for UTC").count();
            assert_eq!(found, times, "{told}");
            assert_eq!(
                told.contains("first.csv:2: dates and times"),
                times == 1,
                "{told}"
            );
        }
    }
}

#[test]
fn times_of_a_zone_are_read_and_written_as_the_clock_shows_them() {
    let scratch = desk("zoned").0;
    let graph = |zone: &str| {
        let time = format!("time = {{ column = \"time_s\", unit = \"rfc3339\"{zone} }}");
        format!("schema = 1\nextends = \"fitted.toml\"\n{time}\n")
    };
    // From two o'clock of summer time to half past two of winter time, one and a half hours later.
    let row = |(at, row): (usize, &String)| {
        let (_, rest) = row.split_once(',').unwrap();
        let minute = at % 60;
        format!("2026-10-25 02:{minute:02}:00,{rest}")
    };
    let shown: Vec<String> = rows(0, 90).iter().enumerate().map(row).collect();
    let log = scratch.file("night.csv", csv(&shown));
    let model = scratch.path("zoned.json");
    let kept = |zone: &str| {
        let graph = scratch.file("zoned.toml", graph(zone));
        let fit = athermal(&[&"fit", &graph, &"-o", &model, &"--data", &log]).ended(0);
        let run = athermal(&[&"run", &model, &"-i", &log]).ended(0);
        (run.out.lines().count() - 1, fit.told)
    };
    let (all, told) = kept(", zone = \"Europe/Berlin\"");
    assert_eq!(all, 90);
    assert!(!told.contains("taken for UTC"), "{told}");
    let (half, told) = kept("");
    assert_eq!(half, 60);
    assert!(
        told.contains("`zone = \"Europe/Berlin\"` in `[time]`"),
        "{told}"
    );
}

#[test]
fn times_of_a_form_of_their_own_are_read_and_named_as_they_are_written() {
    let scratch = desk("dated").0;
    let graph = "schema = 1\nextends = \"fitted.toml\"\ntime = { column = \"time_s\", format = \"%d.%m.%Y %H:%M:%S\" }\n";
    let graph = scratch.file("dated.toml", graph);
    let row = |row: &String| {
        let (seconds, rest) = row.split_once(',').unwrap();
        let seconds: u32 = seconds.parse().unwrap();
        let (minutes, seconds) = (seconds / 60, seconds % 60);
        format!(
            "02.03.2026 {:02}:{:02}:{seconds:02},{rest}",
            minutes / 60,
            minutes % 60
        )
    };
    let dated: Vec<String> = rows(0, 120).iter().map(row).collect();
    let log = scratch.file("dated.csv", csv(&dated));
    let model = scratch.path("dated.json");
    let fit = athermal(&[&"fit", &graph, &"-o", &model, &"--data", &log]).ended(0);
    fit.tells(&["without a zone, taken for UTC"]);
    let (time, _) = dated[60].split_once(',').unwrap();
    let swap = format!("{time}={}", model.display());
    let run = athermal(&[&"run", &model, &"-i", &log, &"--swap-at", &swap]).ended(0);
    run.tells(&["took over before tick 61"]);
    assert!(run.out.contains(&format!("\n{time},")), "{}", run.out);
    let numbered = scratch.file("numbered.csv", csv(&rows(0, 120)));
    let refused = athermal(&[&"evaluate", &model, &"--data", &numbered]).ended(2);
    refused.tells(&["a date and time as `%d.%m.%Y %H:%M:%S` says, found `0`"]);
    let plain = scratch.path("fitted.toml");
    let refused = athermal(&[&"fit", &plain, &"-o", &model, &"--data", &log]).ended(2);
    refused.tells(&["`[time]` reads dates and times by their `format`"]);
}

/// A graph, its model and a log: the time in one column, or date and time of day in two.
fn dated_desk(scratch: &Scratch, columns: &str) -> (PathBuf, PathBuf, PathBuf) {
    let names: Vec<&str> = columns
        .split(['{', '}', ' '])
        .filter(|name| !name.is_empty())
        .collect();
    let name = names.concat();
    let row = |row: &String| {
        let (seconds, rest) = row.split_once(',').unwrap();
        let seconds: u32 = seconds.parse().unwrap();
        let (minutes, seconds) = (seconds / 60, seconds % 60);
        let between = if names.len() == 1 { " " } else { ";" };
        let time = format!("{:02}:{:02}:{seconds:02},25", minutes / 60, minutes % 60);
        let rest = rest.replace(',', ";").replace('.', ",");
        format!("02.03.2026{between}{time};{rest}\n")
    };
    let rows: String = rows(0, 700).iter().map(row).collect();
    let log = format!("{};room;Z\n{rows}", names.join(";"));
    let log = scratch.file(&format!("{name}.csv"), log);
    let graph = format!(
        "schema = 1\nextends = \"fitted.toml\"\ntime = {{ column = \"{columns}\", format = \"%d.%m.%Y %H:%M:%S%.f\" }}\n"
    );
    let graph = scratch.file(&format!("{name}.toml"), graph);
    athermal(&[&"check", &"--strict", &graph]).ended(0);
    let model = scratch.path(&format!("{name}.json"));
    athermal_on("fit", &graph, &log, &[&"-o", &model]).ended(0);
    (graph, model, log)
}

#[test]
fn date_and_time_in_two_columns_give_what_both_in_one_give() {
    let scratch = desk("two-columns").0;
    let (_, model, log) = dated_desk(&scratch, "Stamp");
    let whole = athermal(&[&"run", &model, &"-i", &log]).ended(0).out;
    let scores = athermal_on("evaluate", &model, &log, &[&"--format", &"json"]).json();
    let whole = whole.replacen("Stamp,", "Date Time,", 1);

    let (graph, model, log) = dated_desk(&scratch, "{Date} {Time}");
    let in_two = athermal_on("evaluate", &model, &log, &[&"--format", &"json"]).json();
    assert_eq!(in_two["scores"][0]["n"], 700);
    assert_eq!(in_two["scores"], scores["scores"]);
    let page = scratch.path("page.html");
    athermal_on("report", &model, &log, &[&"-o", &page]).ended(0);
    let run = |more: &[&dyn AsRef<std::ffi::OsStr>]| {
        let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"run", &model];
        arguments.extend(more);
        athermal(&arguments).ended(0)
    };
    assert_eq!(run(&[&"-i", &log]).out, whole);
    assert!(whole.contains("\n02.03.2026 00:00:10.25,"), "{whole}");

    let text = std::fs::read_to_string(&log).unwrap();
    let half = text.find("02.03.2026;01:00:00").unwrap();
    let piped: [&dyn AsRef<std::ffi::OsStr>; 4] = [&"run", &model, &"-i", &"-"];
    assert_eq!(athermal_fed(&piped, text.as_bytes()).ended(0).out, whole);

    let (state, out) = (scratch.path("state"), scratch.path("out.csv"));
    let half = scratch.file("half.csv", &text[..half]);
    for read in [&half, &log] {
        run(&[&"-i", read, &"--state", &state, &"-o", &out]);
    }
    assert_eq!(std::fs::read_to_string(&out).unwrap(), whole);

    let swap = format!("02.03.2026 00:10:00.25={}", model.display());
    let swapped = run(&[&"-i", &log, &"--swap-at", &swap]);
    swapped.tells(&["took over before tick 61"]);
    let refused = athermal(&[&"run", &model, &"-i", &scratch.path("data.csv")]).ended(2);
    refused.tells(&["there are no columns `Date`, `Time`"]);
    let one = std::fs::read_to_string(&graph).unwrap();
    let one = scratch.file("one.toml", one.replace("{Date} {Time}", "Time"));
    let refused = athermal_on("fit", &one, &log, &[&"-o", &model]).ended(2);
    refused.tells(&["name both in `[time]`, e.g. `column = \"{Date} {Time}\"`"]);
}

#[test]
fn a_model_and_the_results_of_tests_are_written_though_nobody_reads_what_is_told() {
    let (scratch, plain, counted, _) = desk("unread");
    let (graph, model) = (scratch.path("fitted.toml"), scratch.path("unread.json"));
    let told = athermal_unread(&[&"fit", &graph, &"--data", &counted, &"-o", &model]);
    assert_eq!(told, 0);
    athermal(&[&"evaluate", &model, &"--data", &counted]).ended(0);
    let test = format!(
        "[[tests]]\nname = \"far off\"\non = {counted:?}\n\
         expect = [{{ of = \"drift.Z\", at = \"5min\", equals = \"123456 nm/min\", within = 0.1 }}]\n"
    );
    let text = std::fs::read_to_string(&plain).unwrap() + &test;
    let graph = scratch.file("tested.toml", text);
    let results = scratch.path("tests.xml");
    assert_eq!(athermal_unread(&[&"test", &graph, &"--junit", &results]), 1);
    assert!(
        std::fs::read_to_string(results)
            .unwrap()
            .contains("<failure")
    );
}

#[test]
fn a_channel_whose_samples_are_mostly_out_of_range_makes_one_ask_for_its_unit() {
    let (scratch, plain, counted, _) = desk("all-out-of-range");
    let kelvins = std::fs::read_to_string(&plain).unwrap().replace(
        "range = [\"-20 Cel\", \"200 Cel\"]",
        "range = [\"250 K\", \"480 K\"]",
    );
    let kelvins = kelvins.replace("unit = \"Cel\"", "unit = \"K\"");
    let graph = scratch.file("kelvins.toml", kelvins);
    let told = athermal(&[&"evaluate", &graph, &"--data", &counted]).ended(0);
    told.tells(&[
        "temperature.room: all 60 samples are infinite or out of range",
        "is its unit that of the log?",
    ]);
    let mut gappy = rows(0, 60);
    let cells: Vec<&str> = gappy[7].split(',').collect();
    gappy[7] = format!("{},,{}", cells[0], cells[2]);
    let gappy = scratch.file("gappy.csv", csv(&gappy));
    let told = athermal(&[&"evaluate", &graph, &"--data", &gappy]).ended(0);
    told.tells(&[
        "temperature.room: 59 samples are infinite or out of range",
        "is its unit that of the log?",
    ]);
    let told = athermal(&[&"evaluate", &plain, &"--data", &counted])
        .ended(0)
        .told;
    assert!(!told.contains("out of range"), "{told}");
}

/// As the editor of another system may have saved them.
#[test]
fn a_graph_and_a_model_that_are_no_text_in_utf_8_are_told_to_be_saved_as_that_and_a_log_is_read() {
    let (scratch, graph, data, model) = desk("utf-16");
    let in_utf_16 = |name: &str, path: &PathBuf| {
        let text = std::fs::read_to_string(path).unwrap();
        let bytes = text.encode_utf16().flat_map(u16::to_le_bytes);
        scratch.file(name, [&[0xff, 0xfe], &*bytes.collect::<Vec<_>>()].concat())
    };
    let graph = in_utf_16("other-graph.toml", &graph);
    athermal(&[&"check", &graph])
        .ended(3)
        .tells(&["other-graph.toml\": it is not text in UTF-8; save it as that"]);
    let other = in_utf_16("other-model.json", &model);
    athermal(&[&"show", &other])
        .ended(3)
        .tells(&["other-model.json: it is not text in UTF-8; save it as that"]);
    let log = in_utf_16("other-log.csv", &data);
    athermal(&[&"evaluate", &model, &"--data", &log]).ended(0);
}

#[test]
fn no_output_takes_the_place_of_what_the_same_command_reads() {
    let (scratch, graph, data, model) = desk("apart");
    let schedule = scratch.file("schedule.csv", "time_s,stage_on\n0,1\n");
    let next = scratch.path("next.json");
    std::fs::copy(&model, &next).unwrap();
    let swap = format!("1h={}", next.display());
    let commands: [&[&dyn AsRef<std::ffi::OsStr>]; 4] = [
        &[&"test", &graph, &"--junit", &graph],
        &[
            &"simulate",
            &"linear-axis",
            &"--schedule",
            &schedule,
            &"-o",
            &schedule,
        ],
        &[
            &"simulate",
            &"linear-axis",
            &"--compensate",
            &model,
            &"-o",
            &model,
        ],
        &[
            &"run",
            &model,
            &"-i",
            &data,
            &"--swap-at",
            &swap,
            &"-o",
            &next,
        ],
    ];
    let read = [&graph, &schedule, &model, &next].map(|path| std::fs::read(path).unwrap());
    for command in commands {
        athermal(command).ended(2).tells(&[
            "this is the same file as",
            "would be lost",
            "name another file",
        ]);
    }
    let left = [&graph, &schedule, &model, &next].map(|path| std::fs::read(path).unwrap());
    assert!(left == read);
}

#[test]
fn data_that_can_be_read_only_once_are_refused_by_what_reads_them_again() {
    let (scratch, graph, data, model) = desk("once");
    let output = scratch.path("out.json");
    let commands: [&[&dyn AsRef<std::ffi::OsStr>]; 5] = [
        &[&"fit", &graph, &"--data", &"-", &"-o", &output],
        &[&"compare", &graph, &graph, &"--data", &data, &"--on", &"-"],
        &[&"compare", &graph, &graph, &"--data", &"-", &"--on", &data],
        &[&"report", &model, &"--data", &"-"],
        &[&"diagnose", &model, &"--data", &"-"],
    ];
    let rows = std::fs::read(&data).unwrap();
    for command in commands {
        athermal_fed(command, &rows)
            .ended(2)
            .tells(&["-: this can be read only once", "save it to a file first"]);
    }
    assert!(!output.exists());
    athermal_fed(&[&"evaluate", &model, &"--data", &"-"], &rows).ended(0);
}

#[test]
fn names_that_stand_within_a_log_as_before_are_told_once_for_each_log_and_beside_a_machine_at_once()
{
    let (scratch, _, _, model) = desk("again");
    let (all, names) = (rows(0, 60), "time_s,room,Z\n");
    let again = csv(&all[..40]) + names + &csv(&all[40..]);
    let data = scratch.file("again.csv", &again);
    let whole = scratch.file("whole.csv", csv(&all));
    let run = |data| athermal(&[&"run", &model, &"-i", data]).ended(0);
    let (ran, of_whole) = (run(&data), run(&whole));
    assert_eq!(ran.out, of_whole.out);
    let (at, stand) = (
        data.display(),
        "the names of the columns stand here again, as before; the row was left out",
    );
    assert!(
        ran.told
            .contains(&format!("warning: {at}:42: {stand}; 2 in all\n")),
        "{}",
        ran.told
    );
    let fed = athermal_fed(&[&"run", &model, &"-i", &"-"], again.as_bytes()).ended(0);
    let first = format!("warning: standard input:42: {stand}");
    assert_eq!(
        fed.told,
        format!("{first}; others like it are counted\n{first}; 2 in all\n")
    );
}

#[test]
fn a_graph_that_an_option_of_several_recordings_swallows_is_told_to_come_before_it() {
    let (_scratch, graph, data, _model) = desk("graph-as-data");
    for option in ["--data", "--on"] {
        let other = if option == "--on" { "--data" } else { "--on" };
        let compared = athermal(&[&"compare", &graph, &other, &data, &option, &data, &graph]);
        compared
            .ended(2)
            .tells(&["this is a graph and holds no data; name graphs before this option"]);
    }
    athermal(&[&"init", &graph])
        .ended(2)
        .tells(&["holds no data"]);
}
