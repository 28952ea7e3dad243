//! Logs in every form that is read, damaged: each number that is read is one that was written, and what is lost is reported or refused.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use athermal_core::document::{Arrangement, DecimalMark};
use athermal_files::{
    Description, Event, Joint, Layout, Options, Report, Row, TimeForm, apart, other_time,
};
use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;

use super::hostile::{Damage, cases, damages};

const ROWS: usize = 30;
/// Longer than such a log can take on any machine, and shorter than a hang.
const TOO_LONG: Duration = Duration::from_secs(10);

/// A line of a log: its text, the row that it is of, and which values of that.
struct Line(String, usize, Vec<usize>);

/// A form of logs, with two values in a row.
struct Form {
    layout: Layout,
    /// For each file its name, what stands above its rows, and its lines.
    files: Vec<(&'static str, String, Vec<Line>)>,
    separator: char,
    /// When a row is, in s from the first.
    at: fn(usize) -> i64,
}

fn values(nth: usize) -> [f64; 2] {
    [nth as f64 + 0.5, 100.25 + nth as f64]
}

fn minutes(nth: usize) -> i64 {
    60 * nth as i64
}

fn clock(nth: usize) -> String {
    format!("2026-03-02 {:02}:{:02}:00", nth / 60, nth % 60)
}

/// A line of both values for each row.
fn wide(line: impl Fn(usize, f64, f64) -> String) -> Vec<Line> {
    let line = |nth| {
        let [a, b] = values(nth);
        Line(line(nth, a, b), nth, vec![0, 1])
    };
    (0..ROWS).map(line).collect()
}

fn layout(time: &str, form: TimeForm) -> Layout {
    Layout::new(time, form, ["a", "b"])
}

fn form(nth: usize) -> Form {
    let plain = |file: &'static str, layout: Layout, head: &str, lines: Vec<Line>| Form {
        layout,
        files: vec![(file, head.to_owned(), lines)],
        separator: ',',
        at: minutes,
    };
    match nth {
        0 => {
            let mut layout = layout("t", TimeForm::SECONDS);
            layout.table.base.layout = Arrangement::Long;
            layout.table.base.name = Some("n".to_owned());
            layout.table.base.value = Some("v".to_owned());
            let line = |of: usize| {
                let (nth, which) = (of / 2, of % 2);
                let name = ["a", "b"][which];
                let text = format!("{},{name},{}", minutes(nth), values(nth)[which]);
                Line(text, nth, vec![which])
            };
            plain(
                "long.csv",
                layout,
                "t,n,v\n",
                (0..2 * ROWS).map(line).collect(),
            )
        }
        1 => Form {
            separator: '\t',
            ..plain(
                "stage.lvm",
                layout("X_Value", TimeForm::SECONDS),
                "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nX_Columns\tOne\nDate\t2026/03/02\n***End_of_Header***\n\t\n\
                 Channels\t2\t\t\nSamples\t1\t1\t\nX0\t0.0E+0\t0.0E+0\t\n***End_of_Header***\t\t\nX_Value\ta\tb\tComment\n",
                wide(|nth, a, b| format!("{}.000000\t{a}\t{b}", minutes(nth))),
            )
        },
        2 => plain(
            "table.dat",
            layout("TIMESTAMP", TimeForm::Rfc3339),
            "\"TOA5\",\"stage\",\"CR1000X\",\"12345\"\n\"TIMESTAMP\",\"RECORD\",\"a\",\"b\"\n\"TS\",\"RN\",\"Deg C\",\"um\"\n\
             \"\",\"\",\"Avg\",\"Smp\"\n",
            wide(|nth, a, b| format!("\"{}\",{nth},{a},{b}", clock(nth))),
        ),
        3 => {
            let mut layout = layout("", TimeForm::Format("%d.%m.%Y %H:%M".parse().unwrap()));
            layout.time.columns = "{Date} {Time}".parse().unwrap();
            plain(
                "apart.csv",
                layout,
                "Date,a,Time,b\n",
                wide(|nth, a, b| format!("02.03.2026,{a},{:02}:{:02},{b}", nth / 60, nth % 60)),
            )
        }
        4 => {
            let mut layout = layout("t", TimeForm::SECONDS);
            layout.table.base.decimal = Some(DecimalMark::Comma);
            let comma = |value: f64| value.to_string().replace('.', ",");
            plain(
                "sheet.csv",
                layout,
                "t,a,b\n",
                wide(|nth, a, b| format!("{},\"{}\",\"{}\"", minutes(nth), comma(a), comma(b))),
            )
        }
        5 => {
            let mut layout = layout("t", TimeForm::SECONDS);
            layout.table.base.segment = Some("run".to_owned());
            let line = |nth: usize, a, b| format!("R{},{},{a},{b}", nth / 15, minutes(nth % 15));
            Form {
                at: |nth| minutes(nth % 15),
                ..plain("runs.csv", layout, "run,t,a,b\n", wide(line))
            }
        }
        6 => plain(
            "log.csv.gz",
            layout("t", TimeForm::SECONDS),
            "t,a,b\n",
            wide(|nth, a, b| format!("{},{a},{b}", minutes(nth))),
        ),
        _ => {
            let file = |which: usize, time: fn(usize) -> String| {
                let line = |nth| {
                    Line(
                        format!("{},{}", time(nth), values(nth)[which]),
                        nth,
                        vec![which],
                    )
                };
                (0..ROWS).map(line).collect::<Vec<_>>()
            };
            let other: fn(usize) -> String = |nth| format!("{}", 1_772_409_600 + minutes(nth));
            Form {
                layout: layout("t", TimeForm::Rfc3339),
                files: vec![
                    ("one.csv", "t,a\n".to_owned(), file(0, clock)),
                    match nth {
                        7 => ("two.csv", "t,b\n".to_owned(), file(1, clock)),
                        _ => ("two.csv", "time_s,b\n".to_owned(), file(1, other)),
                    },
                ],
                separator: ',',
                at: minutes,
            }
        }
    }
}

/// Writes the bytes of a log; packed and with one byte changed where its name says so.
fn write(path: &Path, bytes: &[u8], changed: Option<(usize, u8)>) {
    let is_packed = path.extension().is_some_and(|ending| ending == "gz");
    let bytes = match is_packed {
        true => {
            let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
            packer.write_all(bytes).unwrap();
            let mut packed = packer.finish().unwrap();
            if let Some((at, by)) = changed {
                let at = at % packed.len();
                packed[at] ^= by;
            }
            packed
        }
        false => bytes.to_vec(),
    };
    std::fs::write(path, bytes).unwrap();
}

/// How many things a report counts as left out or taken as missing.
fn reported(report: &Report) -> u64 {
    let counts = [
        &report.bad_cells,
        &report.refused_rows,
        &report.refused_time,
        &report.repeated_time,
        &report.short_rows,
        &report.notes,
        &report.headers,
        &report.headers_moved,
    ];
    counts.iter().map(|of| of.count).sum::<u64>() + u64::from(report.truncated.is_some())
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn each_form_of_log_gives_what_was_written_or_reports_or_refuses(
        which in 0..9_usize,
        damaged in prop::collection::btree_map(0..2 * ROWS, damages(), 0..4),
        with_quotes in any::<bool>(),
        changed in prop::option::of((any::<usize>(), 1..=255_u8)),
    ) {
        let begun = Instant::now();
        let form = form(which);
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("forms-{:?}", std::thread::current().id()));
        std::fs::create_dir_all(&folder).unwrap();
        let separator = form.separator as u8;
        // Values whose line was taken away, or may be a line of nothing.
        let mut gone: Vec<(usize, usize)> = Vec::new();
        let (mut paths, mut place) = (Vec::new(), 0);
        for (name, head, lines) in &form.files {
            let mut text = head.clone().into_bytes();
            for Line(line, nth, which) in lines {
                let damage = damaged.get(&place);
                place += 1;
                let line = line.as_bytes();
                let mut lose = || gone.extend(which.iter().map(|which| (*nth, *which)));
                match damage {
                    None => text.extend(line),
                    Some(Damage::Cut(at)) => {
                        let cuts = line.iter().take(*at).rposition(|byte| *byte == separator);
                        // Between quotes a comma parts nothing.
                        let cut = cuts.filter(|cut| line[..*cut].iter().filter(|byte| **byte == b'"').count() % 2 == 0);
                        let kept = &line[..cut.unwrap_or(0)];
                        if kept.is_empty() || !kept.contains(&separator) {
                            lose();
                        }
                        text.extend(kept);
                    }
                    Some(Damage::Note) => text.extend([line, &[separator], b"door"].concat()),
                    Some(Damage::Twice) => text.extend([line, b"\n", line].concat()),
                    Some(Damage::Gone) => {
                        lose();
                        continue;
                    }
                    Some(Damage::Noise(bytes)) => {
                        lose();
                        let is_noise = |byte: &&u8| !byte.is_ascii_digit() && !b"\n+-.".contains(*byte) && (with_quotes || **byte != b'"');
                        text.extend(bytes.iter().filter(is_noise));
                    }
                }
                text.push(b'\n');
            }
            let path = folder.join(name);
            write(&path, &text, changed);
            let described = Description::of(&path, 20).into_iter();
            let described: Vec<_> = described.map(|of| (name.to_string(), of.columns)).collect();
            let _ = (apart(&described, &[]), other_time(&path, &form.layout.time, &athermal_files::Tables::default()));
            paths.push(path);
        }
        let options = Options { lenient: true, ..Options::default() };
        let is_sound = damaged.is_empty() && (which != 6 || changed.is_none());
        let Ok(mut joint) = Joint::open(&paths, form.layout.clone(), options) else {
            prop_assert!(!is_sound);
            return Ok(());
        };
        let (mut row, mut read, mut segments) = (Row::default(), Vec::new(), 1);
        let mut is_refused = false;
        loop {
            match joint.next_into(&mut row) {
                Ok(Event::Row) => read.push((row.time_ns, row.values.clone())),
                Ok(Event::Segment) => segments += 1,
                Ok(Event::End) => break,
                Err(_) => {
                    is_refused = true;
                    break;
                }
            }
        }
        prop_assert!(begun.elapsed() < TOO_LONG);
        prop_assert!(segments <= 2);
        if is_refused {
            prop_assert!(!is_sound);
            return Ok(());
        }
        let first = match which {
            2 | 3 | 7 | 8 => 1_772_409_600,
            _ => 0,
        };
        let mut found: BTreeSet<(usize, usize)> = BTreeSet::new();
        for (time_ns, values_read) in &read {
            // Times may come once in each segment; one of the rows that have this time was read.
            let at = |nth: &usize| (first + (form.at)(*nth)) * 1_000_000_000 == *time_ns;
            let is_it = |nth: &usize| {
                let pairs = values_read.iter().zip(values(*nth));
                pairs.clone().all(|(read, written)| read.is_nan() || *read == written)
            };
            let nth = (0..ROWS).filter(at).find(is_it);
            prop_assert!(nth.is_some(), "{:?} at {} s was never written in form {}", values_read, time_ns / 1_000_000_000, which);
            let there = (0..2).filter(|which| !values_read[*which].is_nan());
            found.extend(there.map(|which| (nth.unwrap(), which)));
        }
        let all = (0..ROWS).flat_map(|nth| [(nth, 0), (nth, 1)]);
        let lost = all.filter(|of| !found.contains(of) && !gone.contains(of)).count();
        let counted: u64 = joint.reports().iter().map(|(_, report)| reported(report)).sum();
        prop_assert!(!is_sound || lost == 0, "{} lost of a sound log in form {}", lost, which);
        prop_assert!(lost == 0 || counted > 0, "{} lost in form {}, and nothing reported", lost, which);
    }
}
