//! What `init` tells of a log that was exported or written otherwise than meant: before a graph is made of half of it, unseen.

use std::fmt::Write as _;

use crate::workbench::Folder;

/// What a command says, its lines joined, and whether it was content.
fn said(folder: &Folder, arguments: &[&str]) -> (bool, String) {
    let output = folder.run(arguments);
    let told = String::from_utf8(output.stderr).unwrap();
    // A command that is proposed may go on in a second line.
    let words = told.split_whitespace().filter(|word| *word != "\\");
    let words: Vec<&str> = words.collect();
    (output.status.success(), words.join(" "))
}

/// What `init` says of a log, and the graph that it writes.
fn init(folder: &Folder, name: &str, log: &str) -> (bool, String, String) {
    let graph = format!("{name}.toml");
    std::fs::write(folder.0.join(name), log).unwrap();
    let (fine, told) = said(folder, &["init", name, "-o", &graph]);
    let graph = std::fs::read_to_string(folder.0.join(graph)).unwrap_or_default();
    (fine, told, graph)
}

/// Rows of a machine, ten seconds apart: its temperature in °C and its position in µm.
fn machine(rows: usize) -> impl Iterator<Item = (usize, f64, f64)> {
    (0..rows).map(|row| {
        let x = row as f64;
        let noise = |of: f64| {
            let wild = (x * 12.9898 + of).sin() * 43_758.545_3;
            2.0 * (wild - wild.floor()) - 1.0
        };
        let plate = 22.0 + 2.0 * (x / 170.0).sin() + 0.3 * (x / 31.0).sin() + 0.005 * noise(1.0);
        (10 * row, plate, 4.0 * plate + 0.05 * noise(2.0))
    })
}

/// The drift window that was chosen.
fn window(told: &str) -> &str {
    let (_, rest) = told.split_once("drift window: ").unwrap();
    rest.split_once(',').unwrap().0
}

#[test]
fn positions_in_rows_of_their_own_at_the_time_of_others_are_not_lost() {
    let folder = Folder::new("tells-joined");
    let (mut one, mut two) = (String::new(), String::new());
    for text in [&mut one, &mut two] {
        text.push_str("time_s,plate_degC,Z_um\n");
    }
    for (time, plate, z) in machine(3000) {
        let _ = writeln!(one, "{time},{plate:.4},{z:.4}");
        let _ = writeln!(two, "{time},{plate:.4},\n{time},,{z:.4}");
    }
    let (fine, together, _) = init(&folder, "one.csv", &one);
    assert!(fine, "{together}");
    let (fine, told, _) = init(&folder, "two.csv", &two);
    assert!(fine, "{told}");
    assert!(
        told.contains(
            "3,000 of 6,000 rows have the time of the row before, and are put together with it"
        ),
        "{told}"
    );
    assert_eq!(window(&told), window(&together));
    let figures = |log: &str| {
        let (fine, told) = said(
            &folder,
            &["fit", "one.csv.toml", "--data", log, "-o", "m.json"],
        );
        assert!(fine && !told.contains("left out;"), "{told}");
        let scored = folder.run(&["evaluate", "m.json", "--data", log, "--format", "json"]);
        let mut facts: serde_json::Value = serde_json::from_slice(&scored.stdout).unwrap();
        let run = folder.run(&["run", "m.json", "--input", log]);
        assert!(run.status.success());
        (
            facts["scores"].take(),
            String::from_utf8(run.stdout).unwrap(),
        )
    };
    assert_eq!(figures("two.csv"), figures("one.csv"));
}

#[test]
fn rows_whose_seconds_were_cut_off_are_counted() {
    let folder = Folder::new("tells-minutes");
    let mut text = "Zeit;plate_degC;Z_um\n".to_owned();
    for (time, plate, z) in machine(8000) {
        let (day, minute) = (1 + time / 86_400, time / 60 % 1440);
        let _ = writeln!(
            text,
            "{day:02}.03.2026 {:02}:{:02};{};{}",
            minute / 60,
            minute % 60,
            format!("{plate:.4}").replace('.', ","),
            format!("{z:.4}").replace('.', ",")
        );
    }
    let (fine, told, _) = init(&folder, "minutes.csv", &text);
    assert!(fine, "{told}");
    assert!(told.contains("6,666 of 8,000 rows have the time of the row before, and are left out; the first: minutes.csv:3: the time `01.03.2026 00:00` is that of the row before, and the two have different values of `plate_degC`; the row was left out"), "{told}");
    let (_, told) = said(
        &folder,
        &[
            "fit",
            "minutes.csv.toml",
            "--data",
            "minutes.csv",
            "-o",
            "m.json",
        ],
    );
    assert!(
        told.contains("6,666 × row whose time is that of the row before, left out"),
        "{told}"
    );
}

#[test]
fn times_that_start_again_within_a_log_are_told_with_the_line() {
    let folder = Folder::new("tells-again");
    let mut text = "time_s,plate_degC,Z_um\n".to_owned();
    for (time, plate, z) in machine(5000) {
        let _ = writeln!(text, "{},{plate:.4},{z:.4}", time % 30_000);
    }
    let (fine, told, _) = init(&folder, "again.csv", &text);
    assert!(fine, "{told}");
    assert!(
        told.contains("segments: the times start again by themselves, as after a reboot, 2 in all"),
        "{told}"
    );
}

#[test]
fn a_log_whose_newest_row_comes_first_is_told_to_be_sorted() {
    let folder = Folder::new("tells-back");
    let rows: Vec<_> = machine(3000).collect();
    for (name, header, dated) in [("n.csv", "time_s", false), ("d.csv", "Time", true)] {
        let mut text = format!("{header},plate_degC,Z_um\n");
        for (time, plate, z) in rows.iter().rev() {
            let time = match dated {
                true => format!(
                    "2026-03-01T{:02}:{:02}:{:02}Z",
                    time / 3600,
                    time / 60 % 60,
                    time % 60
                ),
                false => time.to_string(),
            };
            let _ = writeln!(text, "{time},{plate:.4},{z:.4}");
        }
        let (fine, told, _) = init(&folder, name, &text);
        assert!(!fine && told.contains("oldest first"), "{told}");
    }
}

#[test]
fn rows_with_a_note_behind_them_are_counted_by_init_and_read_by_its_graph() {
    let folder = Folder::new("tells-cells");
    let mut text = "time_s,plate_degC,Z_um,Alarm\n".to_owned();
    for (time, plate, z) in machine(3000) {
        let alarm = if time % 5000 == 0 {
            "Door open,E12"
        } else {
            ""
        };
        let _ = writeln!(text, "{time},{plate:.4},{z:.4},{alarm}");
    }
    let (fine, told, graph) = init(&folder, "cells.csv", &text);
    assert!(fine, "{told}");
    assert!(!graph.contains("lenient = true"), "{graph}");
    assert!(
        told.contains("6 of 3,000 rows stand with a note behind them, which are passed over; the first: cells.csv:2: `E12` stands"),
        "{told}"
    );
}

#[test]
fn columns_with_times_of_their_own_are_refused_with_a_way_out() {
    let folder = Folder::new("tells-own");
    let dated = |time: usize| {
        format!(
            "01.03.2026 {:02}:{:02}:{:02}",
            time / 3600,
            time / 60 % 60,
            time % 60
        )
    };
    let rows: Vec<_> = machine(3000).collect();
    let mut text = "plate_degC Time;plate_degC Value;Z_um Time;Z_um Value\n".to_owned();
    let mut same = text.clone();
    for (at, (time, plate, z)) in rows.iter().enumerate() {
        let (time, plate, z) = (dated(*time), comma(*plate), comma(*z));
        let _ = writeln!(same, "{time};{plate};{time};{z}");
        let own = match rows.get(6 * at) {
            Some((time, _, z)) => format!("{};{}", dated(*time), comma(*z)),
            None => ";".to_owned(),
        };
        let _ = writeln!(text, "{time};{plate};{own}");
    }
    let (fine, told, _) = init(&folder, "own.csv", &text);
    assert!(!fine, "{told}");
    assert!(
        told.contains(
            "`Z_um Time` is a time of its own, other than `plate_degC Time`: in one row stand"
        ),
        "{told}"
    );
    assert!(
        told.contains("export it with one time for all columns"),
        "{told}"
    );
    let (fine, told) = said(
        &folder,
        &[
            "init",
            "own.csv",
            "--time",
            "plate_degC Time",
            "-o",
            "named.toml",
        ],
    );
    assert!(fine, "{told}");
    let (fine, told, _) = init(&folder, "same.csv", &same);
    assert!(fine, "{told}");
    let numbers = text.replace("01.03.2026 ", "").replace(':', "");
    let (fine, told, _) = init(&folder, "numbers.csv", &numbers.replace("Time", "time"));
    assert!(
        !fine && told.contains("`Z_um time` is a time of its own"),
        "{told}"
    );
}

fn comma(value: f64) -> String {
    format!("{value:.4}").replace('.', ",")
}

#[test]
fn windows_are_chosen_by_the_changes_of_a_position_that_a_register_holds() {
    let folder = Folder::new("tells-held");
    let header = "time_s,plate_degC,Z_um\n";
    let (mut rare, mut held, mut last) = (header.to_owned(), header.to_owned(), 0.0);
    for (time, plate, z) in machine(6000) {
        let is_new = time % 90 == 0;
        last = if is_new { z } else { last };
        let _ = writeln!(held, "{time},{plate:.4},{last:.4}");
        let z = if is_new {
            format!("{z:.4}")
        } else {
            String::new()
        };
        let _ = writeln!(rare, "{time},{plate:.4},{z}");
    }
    let (_, expected, _) = init(&folder, "rare.csv", &rare);
    let (fine, told, graph) = init(&folder, "held.csv", &held);
    assert!(fine, "{told}");
    assert!(
        told.contains("Z_um: drifts, in um; a length; each value stands 9 times, as in a register that is read oftener than it is written; windows are chosen for its changes, one every 90 s"),
        "{told}"
    );
    assert_eq!(window(&told), window(&expected));
    assert!(graph.contains("# a new value every 90 s"), "{graph}");
    let (fine, said) = said(
        &folder,
        &["fit", "held.csv.toml", "--data", "held.csv", "-o", "m.json"],
    );
    assert!(fine, "{said}\n{graph}");
}

#[test]
fn dates_that_the_whole_log_decides_are_read_so() {
    let folder = Folder::new("tells-us");
    let log = |days: std::ops::Range<usize>| {
        let mut text = "Time,plate_degC,Z_um\n".to_owned();
        for (row, (_, plate, z)) in machine(2000 * days.len()).enumerate() {
            let (day, second) = (days.start + row / 2000, row % 2000 * 43);
            let _ = writeln!(
                text,
                "03/{day:02}/2026 {:02}:{:02}:{:02},{plate:.4},{z:.4}",
                second / 3600,
                second / 60 % 60,
                second % 60
            );
        }
        text
    };
    for (name, days) in [("beyond.csv", 11..14), ("leaps.csv", 8..11)] {
        let (fine, told, graph) = init(&folder, name, &log(days));
        assert!(fine, "{told}");
        assert!(
            graph.contains("format = \"%m/%d/%Y %H:%M:%S%.f\""),
            "{graph}"
        );
        assert!(!told.contains("may as well"), "{told}");
    }
    let (fine, told, _) = init(&folder, "one.csv", &log(8..9));
    assert!(
        fine && told.contains("they may as well be `%m/%d/%Y %H:%M:%S%.f`"),
        "{told}"
    );
}

#[test]
fn an_axis_that_is_measured_rarely_does_not_widen_the_windows_of_the_others() {
    let folder = Folder::new("tells-slow");
    let mut text = "time_s,plate_degC,X_um,Y_um,Z_um\n".to_owned();
    for (time, plate, z) in machine(9000) {
        let x = if time % 3600 == 0 {
            format!("{z:.4}")
        } else {
            String::new()
        };
        let _ = writeln!(text, "{time},{plate:.4},{x},{:.4},{z:.4}", 2.0 * z);
    }
    let (fine, told, _) = init(&folder, "slow.csv", &text);
    assert!(fine, "{told}");
    assert!(
        told.contains(
            "X_um: left out, it has a value every 60 min, most others that drift one every 10 s"
        ),
        "{told}"
    );
    assert!(told.contains("give --drifts \"X_um\""), "{told}");
    let seconds = window(&told).strip_suffix('s').map(str::parse::<u32>);
    assert!(matches!(seconds, Some(Ok(..120))), "{told}");
}

#[test]
fn cells_that_stand_for_no_value_do_not_cost_the_column() {
    let folder = Folder::new("tells-none");
    let mut text = "time_s,plate_degC,Z_um\n".to_owned();
    for (time, plate, z) in machine(6000) {
        let z = if time % 30 == 0 {
            format!("{z:.4}")
        } else {
            "#N/A".to_owned()
        };
        let _ = writeln!(text, "{time},{plate:.4},{z}");
    }
    let (fine, told, _) = init(&folder, "none.csv", &text);
    assert!(fine, "{told}");
    assert!(
        told.contains(
            "4,000 cells of 6,000 cannot be read, the first `#N/A` in line 3; taken as missing"
        ),
        "{told}"
    );
    let (fine, told) = said(
        &folder,
        &["fit", "none.csv.toml", "--data", "none.csv", "-o", "m.json"],
    );
    assert!(fine, "{told}");
}

#[test]
fn a_log_in_long_format_that_is_sorted_by_names_is_read() {
    let folder = Folder::new("tells-long");
    let mut text = "VarName;TimeString;VarValue\n".to_owned();
    for name in ["plate_degC", "Z_um"] {
        for (time, plate, _) in machine(1000) {
            let _ = writeln!(
                text,
                "{name};01.03.2026 {:02}:{:02}:{:02};{}",
                time / 3600,
                time / 60 % 60,
                time % 60,
                comma(plate)
            );
        }
    }
    let (fine, told, graph) = init(&folder, "long.csv", &text);
    assert!(fine && told.contains("a long layout"), "{told}");
    assert!(graph.contains("name = \"VarName\""), "{graph}");
}

#[test]
fn lengths_in_inches_and_mils_are_taken_for_what_they_are() {
    let folder = Folder::new("tells-inch");
    for (name, unit, um) in [("inch", "[in_i]", 25_400.0), ("mil", "[mil_i]", 25.4)] {
        let mut text = format!("time_s,plate_degC,X_{name}\n");
        for (time, plate, z) in machine(3000) {
            let _ = writeln!(text, "{time},{plate:.4},{:.10}", z / um);
        }
        let (fine, told, graph) = init(&folder, name, &text);
        assert!(fine, "{told}");
        assert!(
            told.contains(&format!("X_{name}: drifts, in {unit}; a length")),
            "{told}"
        );
        assert!(graph.contains(&format!("unit = \"{unit}\"")), "{graph}");
        let (fine, told) = said(&folder, &["check", "--strict", &format!("{name}.toml")]);
        assert!(fine, "{told}");
        let told = graph.replace(&format!("unit = \"{unit}\""), "unit = \"mil\"");
        std::fs::write(folder.0.join("word.toml"), told).unwrap();
        let (fine, told) = said(&folder, &["check", "word.toml"]);
        assert!(
            !fine && told.contains("write the unit as \"[mil_i]\""),
            "{told}"
        );
    }
}

#[test]
fn revolutions_and_torque_are_inputs_in_their_units() {
    let folder = Folder::new("tells-rpm");
    let mut text = "time_s,plate_degC,spindle_rpm,torque_Nm,Z_um\n".to_owned();
    for (time, plate, z) in machine(3000) {
        let (rpm, torque) = (3000.0 + 100.0 * plate, 0.1 * plate);
        let _ = writeln!(text, "{time},{plate:.4},{rpm:.1},{torque:.4},{z:.4}");
    }
    let (fine, told, graph) = init(&folder, "spindle.csv", &text);
    assert!(fine, "{told}");
    assert!(told.contains("spindle_rpm: input, in /min;"), "{told}");
    assert!(told.contains("torque_Nm: input, in N.m;"), "{told}");
    assert!(graph.contains("unit = \"/min\""), "{graph}");
    let (fine, told) = said(&folder, &["check", "--strict", "spindle.csv.toml"]);
    assert!(fine, "{told}");
}

#[test]
fn a_number_that_stands_for_no_value_is_no_position() {
    let folder = Folder::new("tells-placeholder");
    let log = |nothing: &str, every: usize| {
        let mut text = "time_s,plate_degC,Z_um\n".to_owned();
        for (time, plate, z) in machine(6000) {
            let z = if time % every == 0 {
                format!("{z:.4}")
            } else {
                nothing.to_owned()
            };
            let _ = writeln!(text, "{time},{plate:.4},{z}");
        }
        text
    };
    let (fine, empty, _) = init(&folder, "empty.csv", &log("", 90));
    assert!(fine, "{empty}");
    let (fine, told, graph) = init(&folder, "nines.csv", &log("-9999", 90));
    assert!(fine, "{told}");
    assert_eq!(window(&told), window(&empty));
    let expected = "-9999 in 5,333 of 6,000 rows stands for no value, and is taken for none here; leave such cells empty";
    assert!(told.contains(expected), "{told}");
    let range = graph
        .lines()
        .rfind(|line| line.starts_with("range ="))
        .unwrap();
    assert!(
        range.ends_with("-9999 stands for no value, and is left out"),
        "{range}"
    );
    let fit = [
        "fit",
        "nines.csv.toml",
        "--data",
        "nines.csv",
        "-o",
        "m.json",
    ];
    let (fine, told) = said(&folder, &fit);
    assert!(
        fine && told.contains("position.Z: 5,333 samples are infinite or out of range"),
        "{told}"
    );
    let (_, told, _) = init(&folder, "ninety.csv", &log("80", 20));
    assert!(
        told.contains("80.00 in 3,000 of 6,000 rows stands for no value"),
        "{told}"
    );
    assert!(
        told.contains("a graph cannot know them from others"),
        "{told}"
    );
}

#[test]
fn humidity_explains_and_does_not_drift_with_a_focus_in_its_unit() {
    let folder = Folder::new("tells-humidity");
    let mut text = "time_s,tube_degF,hum_pct,speed [1/min],focus_steps,\n".to_owned();
    for (time, plate, z) in machine(3000) {
        let (humid, speed) = (45.0 + (z / 9.0).sin(), 3000.0 + 100.0 * plate);
        let _ = writeln!(
            text,
            "{time},{plate:.4},{humid:.3},{speed:.0},{:.2},",
            9.0 * z
        );
    }
    let (fine, told, graph) = init(&folder, "scope.tsv", &text.replace(',', "\t"));
    assert!(fine, "{told}");
    for expected in [
        "hum_pct: input, in %; by its name, may explain the drift",
        "speed [1/min]: input, in 1/min;",
        "focus_steps: drifts, in 1; neither a temperature nor a length, so it is taken as what drifts",
        "the 6th column, which has no name: left out, it has 0 values",
        "the last fifth of the log, from ",
        "--data scope.tsv",
    ] {
        assert!(told.contains(expected), "{expected}: {told}");
    }
    assert!(graph.contains("unit = \"1/min\""), "{graph}");
    assert!(!graph.contains("the names do not say"), "{graph}");
    let (fine, told) = said(&folder, &["check", "--strict", "scope.tsv.toml"]);
    assert!(fine, "{told}");
    let fit = [
        "fit",
        "scope.tsv.toml",
        "--data",
        "scope.tsv",
        "-o",
        "m.json",
    ];
    let (fine, told) = said(&folder, &fit);
    assert!(fine, "{told}");
}
