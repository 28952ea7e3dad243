//! For each kind of log that is read: the starter graph declares its layout, and by that it is read to the same bits as by detection.

use athermal_combiners as _;
use athermal_control as _;
use athermal_estimators as _;
use athermal_features as _;
use std::path::{Path, PathBuf};

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, TableBase, declare, load_text};
use athermal_files::{Layout, Options, Reader, Row, layout};

use super::*;

/// A row of a machine, ten seconds apart: instant in s, temperature in °C, position in µm.
fn machine() -> impl Iterator<Item = (i64, f64, f64)> {
    (0..1500).map(|row| {
        let x = row as f64;
        let noise = (x * 12.9898).sin() * 43_758.545_3;
        let plate = 22.0 + 2.0 * (x / 170.0).sin() + 0.3 * (x / 31.0).sin();
        (10 * row, plate, 4.0 * plate + 0.1 * noise.fract())
    })
}

/// A log with these names, and a row for each sample.
fn log(names: &str, row: impl Fn(i64, f64, f64) -> String) -> String {
    let rows = machine().map(|(time, plate, z)| row(time, plate, z));
    names.to_owned() + &rows.collect::<String>()
}

/// A log of seconds, cells between commas.
fn plain() -> String {
    log("time_s,plate_degC,Z_um\n", |time, plate, z| {
        format!("{time},{plate:.3},{z:.4}\n")
    })
}

/// The same with dates, written by their hour, minute and second on the day that is given.
fn dated(names: &str, date: impl Fn(i64, i64, i64) -> String) -> String {
    log(names, |time, plate, z| {
        let date = date(time / 3600, time / 60 % 60, time % 60);
        format!("{date},{plate:.3},{z:.4}\n")
    })
}

/// With a line in front of the given one.
fn with_line(text: &str, at: usize, line: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    lines.insert(at, line);
    lines.join("\n") + "\n"
}

fn windows_1252(text: &str) -> Vec<u8> {
    text.chars().map(|c| u32::from(c) as u8).collect()
}

fn utf_16(text: &str, order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let text = format!("\u{feff}{text}");
    text.encode_utf16().flat_map(order).collect()
}

/// With semicolons between the cells and decimal commas.
fn german(text: &str) -> String {
    text.replace(',', ";").replace('.', ",")
}

/// A file that goes when the test ends.
struct Log(PathBuf);

impl Log {
    fn of(name: &str, bytes: &[u8]) -> Self {
        let name = format!("athermal-starter-{}-{name}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn plan(graph: &str) -> Plan {
    let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
    let (path, memory) = (Path::new("graph.toml"), Memory::new());
    let document = load_text(
        path,
        graph.to_owned(),
        &memory,
        &mut sources,
        &mut diagnostics,
    );
    let plan = document
        .and_then(|document| declare(document, &mut diagnostics))
        .and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
    plan.unwrap_or_else(|| panic!("{}\n{graph}", diagnostics.render(&sources, false, 120)))
}

/// All rows: the instant and the bits of each value.
fn rows(path: &Path, layout: Layout, lenient: bool) -> Vec<(i64, Vec<u64>)> {
    let options = Options {
        lenient,
        joins: true,
        ..Options::default()
    };
    let mut reader = Reader::open(path, layout, options).unwrap();
    let (mut row, mut rows) = (Row::default(), Vec::new());
    while reader.next_into(&mut row).unwrap() {
        let bits = row.values.iter().map(|value| value.to_bits());
        rows.push((row.time_ns, bits.collect()));
    }
    rows
}

/// A kind of log: its name, its bytes, and the lines of the graph that declare it, behind `[table]` or `[time]`.
type Case = (&'static str, Vec<u8>, &'static [&'static str]);

fn case(name: &'static str, text: String, keys: &'static [&'static str]) -> Case {
    (name, text.into_bytes(), keys)
}

fn cases() -> Vec<Case> {
    let first = 1_772_323_200; // 2026-03-01T00:00:00Z
    let epoch = |name: &str, per_s: i64| {
        log(&format!("{name},plate_degC,Z_um\n"), |time, plate, z| {
            format!("{},{plate:.3},{z:.4}\n", (first + time) * per_s)
        })
    };
    let clock = |h: i64, m: i64, s: i64| format!("{h:02}:{m:02}:{s:02}");
    let iso = |h, m, s| format!("2026-03-01T{}Z", clock(h, m, s));
    let warm = "time_s;W\u{e4}rme [\u{b0}C];Z [\u{b5}m]\n";
    let warm = german(&plain()).replacen("time_s;plate_degC;Z_um\n", warm, 1);
    let in_rows = |cell: &str| {
        let mut text = plain();
        for time in ["200", "5000", "9000"] {
            let row = text.find(&format!("\n{time},")).unwrap() + time.len() + 2;
            let end = row + text[row..].find(',').unwrap();
            text.replace_range(row..end, cell);
        }
        text
    };
    vec![
        case("a mark of UTF-8", format!("\u{feff}{}", plain()), &[]),
        (
            "UTF-16, low byte first",
            utf_16(&warm, u16::to_le_bytes),
            &["encoding = \"utf-16le\"", "separator = \";\""],
        ),
        (
            "UTF-16, high byte first",
            utf_16(&warm, u16::to_be_bytes),
            &["encoding = \"utf-16be\""],
        ),
        (
            "code page 1252",
            windows_1252(&warm),
            &["encoding = \"windows-1252\"", "decimal = \",\""],
        ),
        (
            "code page 1252 in the units alone",
            windows_1252(&with_line(&plain(), 1, "s,\u{b0}C,\u{b5}m")),
            &["encoding = \"windows-1252\"", "units = 2"],
        ),
        case("sep=,", format!("sep=,\n{}", plain()), &["skip = 1"]),
        case(
            "semicolons and decimal commas",
            german(&plain()),
            &["separator = \";\"", "decimal = \",\""],
        ),
        case(
            "semicolons and points",
            plain().replace(',', ";"),
            &["separator = \";\""],
        ),
        case("tabs", plain().replace(',', "\t"), &["separator = \"\\t\""]),
        case(
            "line ends of Windows and Unix mixed",
            plain().replace("0\n", "0\r\n"),
            &[],
        ),
        case(
            "lines of NUL",
            with_line(&plain(), 700, &"\0".repeat(40)),
            &["lenient = true"],
        ),
        case("bars", plain().replace(',', "|"), &["separator = \"|\""]),
        case("blanks about commas", plain().replace(',', " , "), &[]),
        case(
            "lines above the names",
            format!("Logger 3000\nSerial,12345\n\n# note\n{}", plain()),
            &["skip = 4"],
        ),
        case(
            "a row of units",
            with_line(
                &plain().replacen("time_s,plate_degC,Z_um", "time,plate,Z", 1),
                1,
                "s,degC,um",
            ),
            &["units = 2"],
        ),
        case(
            "notes among rows",
            with_line(&plain(), 900, "door open"),
            &["lenient = true"],
        ),
        case(
            "names again",
            with_line(&plain(), 900, "time_s,plate_degC,Z_um"),
            &[],
        ),
        case("a footer", format!("{}EOF\n", plain()), &["lenient = true"]),
        case(
            "summary rows",
            format!("{}Average,22.0,88.0\nMax,24.3,97.2\n", plain()),
            &["lenient = true"],
        ),
        case(
            "trailing commas",
            plain().replace('\n', ",\n").replacen(",\n", "\n", 1),
            &[],
        ),
        case(
            "trailing commas of names too",
            plain().replace('\n', ",\n"),
            &[],
        ),
        case(
            "a nameless time",
            dated(",plate_degC,Z_um\n", iso),
            &["column = \"\""],
        ),
        case(
            "a clock of twelve hours",
            dated("Time,plate_degC,Z_um\n", |h, m, s| {
                let half = if h < 12 { "AM" } else { "PM" };
                format!("03/13/2026 {} {half}", clock((h + 11) % 12 + 1, m, s))
            }),
            &["format = \"%m/%d/%Y %I:%M:%S%.f %p\""],
        ),
        case(
            "date and time apart",
            dated("Date,Time,plate_degC,Z_um\n", |h, m, s| {
                format!("01.03.2026,{}", clock(h, m, s))
            }),
            &["column = \"{Date} {Time}\""],
        ),
        case(
            "a zone in brackets",
            dated("Time,plate_degC,Z_um\n", |h, m, s| {
                format!("2026-03-01T{}+01:00[Europe/Berlin]", clock(h, m, s))
            }),
            &["unit = \"rfc3339\""],
        ),
        case("epochs in s", epoch("t", 1), &[]),
        case("epochs in ms", epoch("t", 1_000), &["unit = \"ms\""]),
        case("epochs in us", epoch("t", 1_000_000), &["unit = \"us\""]),
        case(
            "epochs in ns",
            epoch("t", 1_000_000_000),
            &["unit = \"ns\""],
        ),
        case(
            "days of a spreadsheet",
            log("time,plate_degC,Z_um\n", |time, plate, z| {
                format!(
                    "{:.8},{plate:.3},{z:.4}\n",
                    46_083.0 + time as f64 / 86_400.0
                )
            }),
            &["unit = \"d\""],
        ),
        case(
            "degrees Fahrenheit and mils",
            log("time_s,plate_degF,Z_mil\n", |time, plate, z| {
                format!("{time},{:.3},{:.5}\n", 32.0 + 1.8 * plate, z / 25.4)
            }),
            &["unit = \"[mil_i]\""],
        ),
        case(
            "a pivoted export of InfluxDB",
            dated(",result,table,_time,plate_degC,Z_um\n", |h, m, s| {
                format!(",,0,{}", iso(h, m, s))
            }),
            &["column = \"_time\""],
        ),
        case(
            "objects with numbers as text",
            log("", |time, plate, z| {
                format!("{{\"time_s\":{time},\"plate_degC\":\"{plate:.3}\",\"Z_um\":{z:.4}}}\n")
            }),
            &[],
        ),
        case("NAN", in_rows("NAN"), &[]),
        case("OL", in_rows("OL"), &["lenient = true"]),
        case("-999.25", in_rows("-999.25"), &[]),
        case("9.9e37", in_rows("9.9e37"), &[]),
        case("-127", in_rows("-127"), &[]),
    ]
}

fn started(path: &Path) -> Result<Starter, NoStarter> {
    let data = Dataset::new(vec![path.to_owned()], Options::default());
    starter(&data, &Request::default())
}

#[test]
fn each_kind_of_log_is_declared_and_read_to_the_same_bits_as_when_it_is_found() {
    for (nth, (name, bytes, keys)) in cases().into_iter().enumerate() {
        let ending = if bytes.starts_with(b"{") {
            "jsonl"
        } else {
            "csv"
        };
        let log = Log::of(&format!("{nth}.{ending}"), &bytes);
        let starter = started(&log.0).unwrap_or_else(|error| panic!("{name}: {error:?}"));
        for key in keys {
            assert!(
                starter.text.lines().any(|line| line.starts_with(key)),
                "{name}: {key}\n{}",
                starter.text
            );
        }
        let declared = layout(&plan(&starter.text));
        let lenient = declared.table.base.lenient;
        let found = Layout {
            table: TableBase::default(),
            ..declared.clone()
        };
        let by_declaration = rows(&log.0, declared, false);
        assert!(
            by_declaration.len() > 1490,
            "{name}: {}",
            by_declaration.len()
        );
        assert!(by_declaration == rows(&log.0, found, lenient), "{name}");
    }
}

#[test]
fn a_table_in_markdown_is_read_by_its_names() {
    let text = plain().replace('\n', " |\n").replace(',', " | ");
    let text: String = text.lines().map(|line| format!("| {line}\n")).collect();
    let text = with_line(&text, 1, "|---|---|---|");
    let log = Log::of("table.md", text.as_bytes());
    let starter = started(&log.0).unwrap();
    assert!(
        starter.text.contains("separator = \"|\""),
        "{}",
        starter.text
    );
    assert_eq!(
        rows(&log.0, layout(&plan(&starter.text)), false).len(),
        1500
    );
}

#[test]
fn an_hour_of_24_is_that_of_the_next_day() {
    let text = dated("Time,plate_degC,Z_um\n", |h, m, s| match h {
        0..4 if h + m + s == 0 => "2026-02-28 24:00:00".to_owned(),
        _ => format!("2026-03-01 {h:02}:{m:02}:{s:02}"),
    });
    let log = Log::of("24.csv", text.as_bytes());
    let starter = started(&log.0).unwrap();
    let lenient = starter.text.contains("lenient = true");
    let rows = rows(&log.0, layout(&plan(&starter.text)), lenient);
    assert!(rows.len() >= 1499, "{}", rows.len());
}

#[test]
fn the_long_layout_of_an_archive_is_read() {
    let text = log("VarName;TimeString;VarValue\n", |time, plate, z| {
        let clock = format!(
            "01.03.2026 {:02}:{:02}:{:02}",
            time / 3600,
            time / 60 % 60,
            time % 60
        );
        format!("plate;{clock};{plate:.3}\nZ;{clock};{z:.4}\n")
            .replace('.', ",")
            .replace("01,03,", "01.03.")
    });
    let log = Log::of("archive.csv", text.as_bytes());
    let starter = started(&log.0).unwrap();
    for declared in [
        "layout = \"long\"",
        "name = \"VarName\"",
        "channels = [\"plate\"]",
    ] {
        assert!(starter.text.contains(declared), "{}", starter.text);
    }
}

#[test]
fn the_time_of_a_long_layout_of_many_signals_is_found() {
    let text = log("time_s,tag,value\n", |time, plate, z| {
        let others = (1..30).map(|nth| format!("{time},T{nth}_degC,{plate:.3}\n"));
        others.collect::<String>() + &format!("{time},Z_um,{z:.4}\n")
    });
    let log = Log::of("many.csv", text.as_bytes());
    let starter = started(&log.0).unwrap();
    assert!(
        starter.text.contains("column = \"time_s\""),
        "{}",
        starter.text
    );
    assert_eq!(
        rows(&log.0, layout(&plan(&starter.text)), false).len(),
        1500
    );
}
