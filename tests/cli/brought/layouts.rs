//! A file for each sensor, and machines side by side in one log: `init` writes the layout, and all commands read by it what the same
//! values in one table, or in a file for each machine, give.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::PathBuf;

use athermal::core::prng::Prng;
use serde_json::Value;

use super::cases::{Fitted, score};
use crate::workbench::{Scratch, athermal, case};

/// Minutes, two temperatures and the position of a machine.
type Rows = Vec<(u32, [f64; 3])>;

fn rows(seed: u64, count: u32, step: u32) -> Rows {
    let random = &mut Prng::stream(seed, "rows");
    let (mut heat, mut plate, mut room) = (0.0, 21.0 + seed as f64, 20.0);
    let row = |nth: u32| {
        if random.between(0.0, 1.0) < 0.01 {
            heat = 8.0 - heat;
        }
        for _ in 0..step {
            plate += (21.0 + seed as f64 + heat - plate) / 60.0;
        }
        room += random.between(-0.05, 0.05);
        let z = 3.0 * (plate - 21.0) + room + random.between(-0.01, 0.01);
        (
            nth * step,
            [plate, room, z].map(|of| (of * 1000.0_f64).round() / 1000.0),
        )
    };
    (0..count).map(row).collect()
}

fn date(minute: u32, form: &str) -> String {
    let (day, hour, minute) = (2 + minute / 1440, minute / 60 % 24, minute % 60);
    match form {
        "iso" => format!("2026-03-{day:02}T{hour:02}:{minute:02}:00Z"),
        "german" => format!("{day:02}.03.2026 {hour:02}:{minute:02}"),
        _ => format!(
            "3/{day}/26 {}:{minute:02}:00 {}",
            (hour + 11) % 12 + 1,
            ["AM", "PM"][hour as usize / 12]
        ),
    }
}

/// The scores by a graph that `init` writes for files, fitted on them, without what differs by rounding; and that graph.
#[track_caller]
fn scores(scratch: &Scratch, files: &[PathBuf], more: &[&str]) -> (Value, String) {
    let (graph, model) = (scratch.path("g.toml"), scratch.path("m.json"));
    let of = |words: &[&dyn AsRef<OsStr>]| {
        let files = files.iter().map(|file| file as &dyn AsRef<OsStr>);
        let words: Vec<&dyn AsRef<OsStr>> = words.iter().copied().chain(files).collect();
        athermal(&words).ended(0)
    };
    of(&[&"init", &"--force", &"-o", &graph]);
    let mut words: Vec<&dyn AsRef<OsStr>> = vec![&"check", &"--strict", &graph];
    athermal(&words).ended(0);
    words = vec![&"fit", &graph, &"-o", &model];
    words.extend(more.iter().map(|word| word as &dyn AsRef<OsStr>));
    words.push(&"--data");
    of(&words);
    let facts = of(&[&"evaluate", &model, &"--format", &"json", &"--data"]).json();
    (facts, std::fs::read_to_string(&graph).unwrap())
}

/// The figures of two evaluations of the same rows, whatever the channels are called.
#[track_caller]
fn are_alike(one: &Value, other: &Value, what: &str) {
    let figures = |facts: &Value| -> Vec<(String, u64, f64)> {
        let scores = facts["scores"].as_array().unwrap().iter();
        let of = |score: &Value| {
            let node = score["node"].as_str().unwrap().to_owned();
            (
                node,
                score["n"].as_u64().unwrap(),
                score["rmse"].as_f64().unwrap(),
            )
        };
        scores.map(of).collect()
    };
    let (one, other) = (figures(one), figures(other));
    assert_eq!(one.len(), other.len(), "{what}: {one:?} {other:?}");
    for (one, other) in one.iter().zip(&other) {
        let is_near = (one.2 - other.2).abs() <= 1e-6 * one.2.abs();
        assert!(
            one.0 == other.0 && one.1 == other.1 && is_near,
            "{what}: {one:?} {other:?}"
        );
    }
}

#[test]
fn a_file_for_each_sensor_is_read_as_one_table_of_all() {
    if let Some(of) = Fitted::of(
        "a-file-for-each-sensor",
        &["spindle.csv", "bed.csv", "positions.csv"],
    ) {
        let graph = of.graph();
        for part in [
            "match = \"spindle.csv\"",
            "rename = { \"Value\" = \"spindle_degC\" }",
            "rename = { \"Value\" = \"bed_degC\" }",
        ] {
            assert!(graph.contains(part), "{part} is not in {graph}");
        }
        let files = ["spindle.csv", "bed.csv", "positions.csv"].map(|file| of.folder.join(file));
        let (facts, _) = scores(&of.scratch, &files, &[]);
        assert!(score(&facts, "now/result", "r2_zero") > 0.95, "{facts}");
        // The same in one table.
        let values = |file: &PathBuf, skip: usize, column: usize| -> Vec<String> {
            let text = std::fs::read_to_string(file).unwrap();
            let cell = |line: &str| line.split(',').nth(column).unwrap().to_owned();
            text.lines().skip(skip).map(cell).collect()
        };
        let [spindle, bed] = [0, 1].map(|of| values(&files[of], 6, 2));
        let [times, z] = [0, 1].map(|of| values(&files[2], 1, of));
        let mut table = "time,spindle_degC,bed_degC,Z_um\n".to_owned();
        for (nth, time) in times.iter().enumerate() {
            let cell = |of: &[String]| of.get(nth).cloned().unwrap_or_default();
            let _ = writeln!(table, "{time},{},{},{}", cell(&spindle), cell(&bed), z[nth]);
        }
        let table = of.scratch.file("table.csv", table);
        are_alike(&facts, &scores(&of.scratch, &[table], &[]).0, "the case");
        // Without the positions nothing drifts, and that is said of sensors that have names of their own.
        let graph = of.scratch.path("none.toml");
        let refused = athermal(&[&"init", &files[0], &files[1], &"-o", &graph]).ended(2);
        refused.tells(&["nothing in it drifts: spindle_degC, bed_degC may explain a drift"]);
    }
    let scratch = Scratch::new("sensors");
    let all = rows(1, 900, 5);
    // Names of files, of columns, and how each is written: units in the names of files, other orders of columns, tags with dates, and
    // sensors that log for other times, at other rates and with holes.
    type Member = (
        &'static str,
        [&'static str; 3],
        &'static str,
        &'static str,
        [u32; 3],
    );
    let members: [Member; 5] = [
        (
            "units",
            ["plate_degC.csv", "room_degC.csv", "Z_um.csv"],
            "time,value",
            "iso",
            [1, 1, 1],
        ),
        (
            "orders",
            ["plate.csv", "room.csv", "probe.csv"],
            "Unit;Zeit;Wert",
            "german",
            [1, 1, 1],
        ),
        (
            "tags",
            [
                "TT101_2026-03-02.csv",
                "TT102_2026-03-02.csv",
                "ZT201_2026-03-02.csv",
            ],
            "Timestamp,PV",
            "iso",
            [1, 1, 1],
        ),
        (
            "rates",
            ["plate_degC.csv", "room_degC.csv", "Z_um.csv"],
            "time,value,battery_V",
            "us",
            [1, 3, 1],
        ),
        (
            "serials",
            ["21345678.csv", "21345679.csv", "gap_um.csv"],
            "No.,Date,Temperature (°C)",
            "iso",
            [1, 1, 1],
        ),
    ];
    for (what, files, header, form, every) in members {
        let folder = Scratch::new(&format!("sensors-{what}"));
        let is_hole = |sensor: usize, minute: u32| {
            what == "rates"
                && (sensor == 0 && minute > 4400 || sensor == 2 && (600..900).contains(&minute))
        };
        let is_there = |sensor: usize, nth: usize, minute: u32| {
            (nth as u32).is_multiple_of(every[sensor]) && !is_hole(sensor, minute)
        };
        let paths: Vec<PathBuf> = files
            .iter()
            .enumerate()
            .map(|(sensor, file)| {
                let is_z = sensor == 2;
                let separator = if header.contains(';') { ";" } else { "," };
                let header = if is_z {
                    header.replace("Temperature (°C)", "Length (µm)")
                } else {
                    header.to_owned()
                };
                let mut text = header.clone() + "\n";
                for (nth, (minute, values)) in all
                    .iter()
                    .enumerate()
                    .filter(|(nth, row)| is_there(sensor, *nth, row.0))
                {
                    let value = format!("{:.3}", values[sensor]);
                    let cell = |name: &str| match name {
                        "No." => nth.to_string(),
                        "battery_V" => format!("{:.2}", 3.6 - nth as f64 / 1e4),
                        "Unit" => {
                            if is_z {
                                "um".to_owned()
                            } else {
                                "C".to_owned()
                            }
                        }
                        "time" | "Zeit" | "Timestamp" | "Date" => date(*minute, form),
                        _ if separator == ";" => value.replace('.', ","),
                        _ => value.clone(),
                    };
                    text += &(header
                        .split(separator)
                        .map(cell)
                        .collect::<Vec<_>>()
                        .join(separator)
                        + "\n");
                }
                folder.file(file, text)
            })
            .collect();
        let (facts, graph) = scores(&folder, &paths, &[]);
        assert!(
            score(&facts, "now/result", "r2_zero") > 0.9,
            "{what}: {facts}\n{graph}"
        );
        if what == "tags" {
            assert!(graph.contains("match = \"TT101_*.csv\""), "{graph}");
        }
        // The same in one table, with another battery for each.
        let names = ["plate_degC", "room_degC", "Z_um"];
        let mut table = format!(
            "time,{},{}\n",
            names.join(","),
            ["a_V", "b_V", "c_V"].join(",")
        );
        for (nth, (minute, values)) in all.iter().enumerate() {
            let there = |sensor: usize| is_there(sensor, nth, *minute);
            let cells = [0, 1, 2].map(|of| {
                if there(of) {
                    format!("{:.3}", values[of])
                } else {
                    String::new()
                }
            });
            let battery = |of: usize| match what == "rates" && there(of) {
                true => format!("{:.2}", 3.6 - nth as f64 / 1e4),
                false => String::new(),
            };
            let _ = writeln!(
                table,
                "{},{},{}",
                date(*minute, "iso"),
                cells.join(","),
                [0, 1, 2].map(battery).join(",")
            );
        }
        let table = folder.file("table.csv", table);
        are_alike(&facts, &scores(&folder, &[table], &[]).0, what);
    }
    // Of folders with files of one name it is not known which sensor each is.
    let text = |sensor: usize| -> String {
        let rows = all
            .iter()
            .map(|(minute, of)| format!("{},{}\n", date(*minute, "iso"), of[sensor]));
        std::iter::once("time,value\n".to_owned())
            .chain(rows)
            .collect()
    };
    let files = ["a", "b"].map(|name| {
        let folder = scratch.path(name);
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("log.csv");
        std::fs::write(&file, text(usize::from(name == "b"))).unwrap();
        file
    });
    let refused = athermal(&[
        &"init",
        &files[0],
        &files[1],
        &"-o",
        &scratch.path("g.toml"),
    ])
    .ended(2);
    refused.tells(&["several sensors", "one name", "by its sensor"]);
}

/// The text of a log of machines, one row a line, in the order given.
fn log(names: &str, rows: impl Iterator<Item = (u32, String, [f64; 3])>) -> String {
    let mut text = format!("{names}\n");
    for (minute, machine, [plate, room, z]) in rows {
        let _ = writeln!(
            text,
            "{},{machine},{plate:.3},{room:.3},{z:.3}",
            date(minute, "iso")
        );
    }
    text
}

#[test]
fn machines_side_by_side_are_read_as_a_file_of_each() {
    let scratch = Scratch::new("machines");
    if let Some(folder) = case("two-machines-in-one-log") {
        let line = folder.join("line.csv");
        let (facts, graph) = scores(&scratch, std::slice::from_ref(&line), &[]);
        assert!(graph.contains("machine = \"machine\""), "{graph}");
        assert!(graph.contains("4,032 rows"), "{graph}");
        assert!(score(&facts, "now/result", "r2_zero") > 0.9, "{facts}");
        let text = std::fs::read_to_string(&line).unwrap();
        let files = ["A", "B"].map(|machine| {
            let mut lines = text.lines();
            let first = lines.next().unwrap().to_owned() + "\n";
            let own = lines.filter(|line| line.contains(&format!(",{machine},")));
            let own: String = own.map(|line| format!("{line}\n")).collect();
            scratch.file(&format!("{machine}.csv"), first + &own)
        });
        are_alike(
            &facts,
            &scores(&scratch, &files, &["--segments"]).0,
            "the case",
        );
        // A service, a pipe and who asks for one machine read that one.
        let (graph, model) = (scratch.path("g.toml"), scratch.path("one.json"));
        athermal(&[&"init", &line, &"--force", &"-o", &graph]).ended(0);
        let one = scratch.file(
            "one.toml",
            "schema = 1\nextends = \"g.toml\"\ntable.only = \"B\"\n",
        );
        let of_one = |graph: &PathBuf, data: &PathBuf| {
            let words: [&dyn AsRef<OsStr>; 8] = [
                &"fit",
                graph,
                &"--data",
                data,
                &"-o",
                &model,
                &"--format",
                &"json",
            ];
            athermal(&words).ended(0).json()["ticks"].clone()
        };
        assert_eq!(of_one(&graph, &line), 4032);
        assert_eq!(of_one(&one, &line), 2016);
        let out = scratch.path("out.csv");
        athermal(&[&"run", &model, &"--input", &line, &"--output", &out]).ended(0);
        let run = std::fs::read_to_string(&out).unwrap();
        assert_eq!(run.lines().count(), 2017);
    }
    // By number, by text, three, one that appears late or ends early, irregularly interleaved, in blocks, and not in step.
    let of = |machine: u64| rows(machine, 700, 5).into_iter();
    let named = |name: &str, rows: Rows| {
        let name = name.to_owned();
        rows.into_iter()
            .map(move |(minute, values)| (minute, name.clone(), values))
            .collect::<Vec<_>>()
    };
    let sorted = |mut all: Vec<(u32, String, [f64; 3])>| {
        all.sort_by_key(|row| row.0);
        all
    };
    let members = [
        (
            "numbers",
            "machine_no",
            sorted([named("1", of(1).collect()), named("2", of(2).collect())].concat()),
        ),
        (
            "three",
            "Anlage",
            sorted(
                [
                    named("A", of(1).collect()),
                    named("B", of(2).collect()),
                    named("C", of(4).collect()),
                ]
                .concat(),
            ),
        ),
        (
            "late",
            "station",
            sorted(
                [
                    named("west", of(1).collect()),
                    named("east", of(2).skip(600).collect()),
                    named("north", of(3).take(100).collect()),
                ]
                .concat(),
            ),
        ),
        ("interleaved", "asset", {
            let shifted = of(4).map(|(minute, values)| (minute + 1 + minute % 3, values));
            sorted(
                [
                    named("MX-1", of(1).collect()),
                    named("MX-2", shifted.collect()),
                ]
                .concat(),
            )
        }),
        ("blocks", "line", {
            let blocks = (0..7).flat_map(|block| [1, 2].map(|machine| (block, machine)));
            let blocks = blocks.flat_map(|(block, machine)| {
                named(
                    ["a", "b"][machine as usize - 1],
                    of(machine).skip(100 * block).take(100).collect(),
                )
            });
            blocks.collect()
        }),
    ];
    for (what, column, all) in members {
        let folder = Scratch::new(&format!("machines-{what}"));
        let names = format!("time,{column},plate_degC,room_degC,Z_um");
        let one = folder.file("all.csv", log(&names, all.iter().cloned()));
        let (facts, graph) = scores(&folder, &[one], &[]);
        assert!(
            graph.contains(&format!("machine = \"{column}\"")),
            "{what}: {graph}"
        );
        let mut machines: Vec<&String> = Vec::new();
        for (_, machine, _) in &all {
            if !machines.contains(&machine) {
                machines.push(machine);
            }
        }
        let files = machines.iter().enumerate().map(|(nth, machine)| {
            let own = all.iter().filter(|row| row.1 == **machine).cloned();
            folder.file(&format!("{nth}.csv"), log(&names, own))
        });
        let files: Vec<PathBuf> = files.collect();
        // The graph is that of all: a file is read by the same windows.
        let model = folder.path("m.json");
        let graph = folder.file(
            "files.toml",
            graph.replace(&format!("machine = \"{column}\""), ""),
        );
        let mut words: Vec<&dyn AsRef<OsStr>> =
            vec![&"fit", &graph, &"-o", &model, &"--segments", &"--data"];
        words.extend(files.iter().map(|file| file as &dyn AsRef<OsStr>));
        athermal(&words).ended(0);
        let mut words: Vec<&dyn AsRef<OsStr>> = vec![
            &"evaluate",
            &model,
            &"--format",
            &"json",
            &"--segments",
            &"--data",
        ];
        words.extend(files.iter().map(|file| file as &dyn AsRef<OsStr>));
        are_alike(&facts, &athermal(&words).ended(0).json(), what);
    }
    // A state, a shift and days in a column are no machines.
    let state = of(1)
        .enumerate()
        .map(|(nth, (minute, values))| (minute, ["on", "off"][nth / 3 % 2].to_owned(), values));
    let shift = of(1).map(|(minute, values)| {
        (
            minute,
            ["early", "late"][minute as usize / 480 % 2].to_owned(),
            values,
        )
    });
    for (column, rows) in [
        ("heater", state.collect::<Vec<_>>()),
        ("shift", shift.collect()),
    ] {
        let file = scratch.file(
            "none.csv",
            log(
                &format!("time,{column},plate_degC,room_degC,Z_um"),
                rows.into_iter(),
            ),
        );
        let graph = scratch.path("none.toml");
        athermal(&[&"init", &file, &"--force", &"-o", &graph]).ended(0);
        let graph = std::fs::read_to_string(graph).unwrap();
        assert!(!graph.contains("machine = "), "{column}: {graph}");
    }
    // Where each stands once, that is a segment as it stands.
    let each = [1, 2].map(|machine| {
        let rows = of(machine).map(move |(minute, values)| (minute, machine.to_string(), values));
        rows.collect::<Vec<_>>()
    });
    let names = "time,unit_no,plate_degC,room_degC,Z_um";
    let file = scratch.file("sorted.csv", log(names, each.concat().into_iter()));
    let graph = scratch.path("sorted.toml");
    athermal(&[&"init", &file, &"-o", &graph]).ended(0);
    let graph = std::fs::read_to_string(graph).unwrap();
    assert!(graph.contains("segment = \"unit_no\""), "{graph}");
}
