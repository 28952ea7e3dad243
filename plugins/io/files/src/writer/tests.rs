use std::sync::Mutex;

use super::*;
use crate::{Layout, Options, Reader, Row, TimeForm};

/// A stream that can still be seen after the writer has taken it.
#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Shared {
    fn text(&self) -> String {
        String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
    }
}

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn writer(shared: &Shared, format: Format, columns: &[&str], flush: Flush) -> Writer {
    let columns: Vec<String> = columns.iter().map(|&name| name.to_owned()).collect();
    Writer::to_write("out", shared.clone(), format, "time", &columns, flush).unwrap()
}

#[test]
fn csv_has_names_times_as_given_and_empty_cells_for_no_value() {
    let shared = Shared::default();
    let mut writer = writer(&shared, Format::Csv, &["a", "b, \"c\""], Flush::Buffered);
    writer.write_row("0.50", 0, &[0.1, f64::NAN]).unwrap();
    writer
        .write_row(
            "2013-07-04 00:00:00",
            0,
            &[f64::INFINITY, f64::NEG_INFINITY],
        )
        .unwrap();
    writer.finish().unwrap();
    assert_eq!(
        shared.text(),
        "time,a,\"b, \"\"c\"\"\"\n0.50,0.1,\n2013-07-04 00:00:00,inf,-inf\n"
    );
}

#[test]
fn json_lines_are_valid_json_whatever_the_value() {
    let shared = Shared::default();
    let mut writer = writer(
        &shared,
        Format::JsonLines,
        &["a \"b\"", "c"],
        Flush::Buffered,
    );
    writer.write_row("0.50", 0, &[0.1, f64::NAN]).unwrap();
    writer
        .write_row("1970-01-01", 0, &[f64::INFINITY, f64::NEG_INFINITY])
        .unwrap();
    writer.write_row("+.5", 0, &[1e300, -0.0]).unwrap();
    drop(writer);
    let text = shared.text();
    let objects: Vec<serde_json::Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(
        objects[0],
        serde_json::json!({"time": 0.5, "a \"b\"": 0.1, "c": null})
    );
    assert_eq!(
        objects[1],
        serde_json::json!({"time": "1970-01-01", "a \"b\"": "inf", "c": "-inf"})
    );
    assert_eq!(
        objects[2],
        serde_json::json!({"time": "+.5", "a \"b\"": 1e300, "c": -0.0})
    );
    assert!(text.starts_with("{\"time\":0.50,"), "{text}");
}

#[test]
fn a_file_that_another_program_empties_is_begun_again() {
    let folder = std::env::temp_dir().join(format!("athermal-emptied-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let columns = ["a".to_owned()];
    let time = Layout::new("t", TimeForm::SECONDS, ["a"]).time;
    for (name, header) in [("out.csv", "t,a\n"), ("out.jsonl", "")] {
        let path = folder.join(name);
        let create = || Writer::create(&path, "t", &columns, Flush::EachRow).unwrap();
        let resume = || Writer::resume(&path, &time, &columns, None, Flush::EachRow).unwrap();
        for open in [&create as &dyn Fn() -> Writer, &resume] {
            let mut writer = open();
            writer.write_row("1", 1_000_000_000, &[1.0]).unwrap();
            let before = std::fs::read_to_string(&path).unwrap();
            File::create(&path).unwrap();
            for second in [2, 3] {
                let row = writer.write_row(&second.to_string(), second * 1_000_000_000, &[1.0]);
                row.unwrap();
            }
            let after = std::fs::read_to_string(&path).unwrap();
            let rows = before.strip_prefix(header).unwrap();
            let (two, three) = (rows.replacen('1', "2", 1), rows.replacen('1', "3", 1));
            assert_eq!(after, format!("{header}{two}{three}"), "{name}");
            std::fs::write(&path, before).unwrap();
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_time_without_text_is_written_as_exact_seconds() {
    let shared = Shared::default();
    let mut writer = writer(&shared, Format::Csv, &[], Flush::Buffered);
    for time_ns in [
        0,
        300_000_000,
        -1,
        1_700_000_000_123_456_789,
        20_000_000_000,
    ] {
        writer.write_row("", time_ns, &[]).unwrap();
    }
    writer.finish().unwrap();
    assert_eq!(
        shared.text(),
        "time\n0\n0.3\n-0.000000001\n1700000000.123456789\n20\n"
    );
}

#[test]
fn a_row_leaves_at_once_only_when_asked_to() {
    for format in [Format::Csv, Format::JsonLines] {
        let (at_once, later) = (Shared::default(), Shared::default());
        let mut eager = writer(&at_once, format, &["a"], Flush::EachRow);
        let mut buffered = writer(&later, format, &["a"], Flush::Buffered);
        for writer in [&mut eager, &mut buffered] {
            writer.write_row("7", 0, &[1.5]).unwrap();
        }
        assert!(at_once.text().ends_with('\n') && at_once.text().contains("1.5"));
        assert_eq!(later.text(), "");
        drop(buffered);
        assert_eq!(later.text(), at_once.text());
    }
}

/// A pipe whose reader went away.
struct Closed;

impl Write for Closed {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        Err(io::ErrorKind::BrokenPipe.into())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_closed_pipe_is_told_from_other_failures() {
    for format in [Format::Csv, Format::JsonLines] {
        let mut writer = Writer::to_write(
            "out",
            Closed,
            format,
            "t",
            &["a".to_owned()],
            Flush::Buffered,
        )
        .unwrap();
        let failed = (0..100_000).find_map(|_| writer.write_row("0", 0, &[1.0]).err());
        assert!(
            failed.is_some_and(|error| error.is_closed_pipe()),
            "{format:?}"
        );
        assert!(
            writer.finish().is_err_and(|error| error.is_closed_pipe()),
            "{format:?}"
        );
    }
}

#[test]
fn a_row_of_another_length_is_refused_and_not_written() {
    let shared = Shared::default();
    let mut writer = writer(&shared, Format::Csv, &["a"], Flush::EachRow);
    assert!(matches!(
        writer.write_row("0", 0, &[1.0, 2.0]),
        Err(FileError::ValueCount {
            expected: 1,
            found: 2,
            ..
        })
    ));
    assert_eq!(shared.text(), "time,a\n");
}

#[test]
fn what_is_written_reads_back_to_the_same_bits() {
    let numbers = [
        0.1,
        1.0 / 3.0,
        f64::MAX,
        f64::MIN_POSITIVE,
        5e-324,
        -0.0,
        1e16,
        123_456_789.125,
    ];
    for format in [Format::Csv, Format::JsonLines] {
        let shared = Shared::default();
        let mut writer = writer(&shared, format, &["#a", "b"], Flush::Buffered);
        for (index, &number) in numbers.iter().enumerate() {
            writer
                .write_row("", index as i64, &[number, f64::NAN])
                .unwrap();
        }
        writer.finish().unwrap();
        let layout = Layout::new("time", TimeForm::SECONDS, ["#a", "b"]);
        let text = std::io::Cursor::new(shared.text());
        let mut reader = Reader::from_read("out", text, layout, Options::default()).unwrap();
        let mut row = Row::default();
        for (index, &number) in numbers.iter().enumerate() {
            assert!(reader.next_into(&mut row).unwrap());
            assert_eq!(row.time_ns, index as i64);
            assert_eq!(row.values[0].to_bits(), number.to_bits());
            assert!(row.values[1].is_nan());
        }
        assert!(!reader.next_into(&mut row).unwrap());
    }
}
