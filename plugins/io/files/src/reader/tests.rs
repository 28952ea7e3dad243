use std::io;
use std::sync::Arc;

use super::*;
use crate::TimeForm;

fn layout(form: TimeForm) -> Layout {
    Layout::new("t", form, ["a"])
}

fn lenient() -> Options {
    Options {
        lenient: true,
        ..Options::default()
    }
}

/// Reads a file of seconds and one channel.
fn open(text: &'static str, options: Options) -> Reader {
    Reader::from_read("f.csv", text.as_bytes(), layout(TimeForm::SECONDS), options).unwrap()
}

fn rows(reader: &mut Reader) -> Vec<(i64, String)> {
    let mut row = Row::default();
    let mut rows = Vec::new();
    while reader.next_into(&mut row).unwrap() {
        rows.push((row.time_ns, row.time_text.clone()));
    }
    rows
}

#[test]
fn a_row_whose_time_repeats_or_steps_back_is_left_out_and_counted() {
    let text = "t,a\n0,1\n10,1\n10,off\n5,1\n10.5,1\n";
    let mut reader = open(text, Options::default());
    let times: Vec<String> = rows(&mut reader)
        .into_iter()
        .map(|(_, text)| text)
        .collect();
    assert_eq!(times, ["0", "10", "10.5"]);
    let reported = |count: &crate::Count| (count.count, count.first.as_ref().unwrap().to_string());
    let report = reader.report();
    assert_eq!(
        reported(&report.repeated_time),
        (
            1,
            "f.csv:4: the time `10` is that of the row before; the row was left out: where rows are taken as they come, what belongs to \
             one time must stand in one"
                .to_owned()
        )
    );
    assert_eq!(
        reported(&report.refused_time),
        (
            1,
            "f.csv:5: the time `5` is not after `10`; the row was left out".to_owned()
        )
    );
}

/// Rows of two channels as they are given where those of one time are put together, and what was met.
fn joined(text: &'static str) -> (String, crate::Report, Option<String>) {
    let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    let options = Options {
        joins: true,
        ..Options::default()
    };
    let mut reader = Reader::from_read("f.csv", text.as_bytes(), layout, options).unwrap();
    let (mut row, mut given, mut error) = (Row::default(), Vec::new(), None);
    loop {
        match reader.next_into(&mut row) {
            Ok(true) => given.push(format!(
                "{}={},{}",
                row.time_text, row.values[0], row.values[1]
            )),
            Ok(false) => break,
            Err(failed) => error = Some(failed.to_string()),
        }
    }
    assert!(
        !reader.next_into(&mut row).unwrap(),
        "the end stays the end"
    );
    (given.join(" "), reader.report().clone(), error)
}

#[test]
fn rows_of_one_time_are_one_where_no_two_contradict_each_other() {
    let (given, report, _) =
        joined("t,a,b\n0,1,\n0,,2\n10,3,\n10.0,3,4\n20,5,6\n20,,\n30,,7\n30,8,\n");
    assert_eq!(given, "0=1,2 10=3,4 20=5,6 30=8,7");
    assert_eq!((report.rows, report.joined), (4, 3));
    assert_eq!(
        (report.refused_time.count, report.repeated_time.count),
        (0, 1)
    );
    assert_eq!(
        report.repeated_time.first.unwrap().to_string(),
        "f.csv:7: the time `20` is that of the row before, which has all that it has; the row was left out"
    );
}

#[test]
fn a_row_that_contradicts_the_one_of_its_time_is_left_out_whole() {
    let (given, report, _) = joined("t,a,b\n0,1,\n0,1.5,2\n0,,3\n10,4,\n5,4,4\n10,,5\n");
    assert_eq!(given, "0=1,3 10=4,5");
    assert_eq!((report.rows, report.joined), (2, 2));
    assert_eq!(
        report.repeated_time.first.unwrap().to_string(),
        "f.csv:3: the time `0` is that of the row before, and the two have different values of `a`; the row was left out"
    );
    assert_eq!(report.refused_time.count, 1);
}

#[test]
fn rows_of_one_time_are_one_behind_a_gap_and_behind_a_wrong_time_too() {
    let (given, report, _) =
        joined("t,a,b\n0,1,\n10,1,\n40000,2,\n40000,,3\n40000,4,\n40010,5,\n90000,6,\n40010,,7\n");
    assert_eq!(given, "0=1,NaN 10=1,NaN 40000=2,3 40010=5,7");
    assert_eq!((report.rows, report.joined), (4, 2));
    let first = report.repeated_time.first.unwrap().to_string();
    assert!(first.starts_with("f.csv:6: the time `40000`"), "{first}");
    assert_eq!(report.refused_time.count, 1, "the wrong time");
}

#[test]
fn the_row_before_an_error_is_given_first_where_rows_are_put_together() {
    let (given, _, error) = joined("t,a,b\n0,1,\n0,,off\n10,2,\n");
    assert_eq!(given, "0=1,NaN 10=2,NaN");
    assert!(error.unwrap().starts_with("f.csv:3: column `b`"));
}

#[test]
fn a_time_that_steps_back_is_told_as_the_file_has_it() {
    let reported = |text: &'static str, form| {
        let mut reader =
            Reader::from_read("f.csv", text.as_bytes(), layout(form), Options::default()).unwrap();
        assert_eq!(rows(&mut reader).len(), 1);
        let refused = &reader.report().refused_time;
        refused.first.as_ref().unwrap().to_string()
    };
    assert_eq!(
        reported(
            "t,a\n2026-03-02T08:30:00+01:00,1\n2026-03-02T07:29:30+01:00,1\n",
            TimeForm::Rfc3339
        ),
        "f.csv:3: the time `2026-03-02T07:29:30+01:00` is not after `2026-03-02T08:30:00+01:00`; the row was left out"
    );
    assert_eq!(
        reported("t;a\n1,50;1\n 1,25 ;1\n", TimeForm::SECONDS),
        "f.csv:3: the time `1,25` is not after `1,50`; the row was left out"
    );
}

#[test]
fn the_text_of_the_time_is_kept_for_every_form() {
    let cases: [(TimeForm, &str, i64, i64); 4] = [
        (
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
            "t,a\n 0.50,1\n1e3 ,1\n",
            500_000,
            1_000_000_000,
        ),
        (
            TimeForm::Samples { step_ns: 80 },
            "t,a\n1,1\n2,1\n",
            80,
            160,
        ),
        (
            TimeForm::Rfc3339,
            "t,a\n1970-01-01 00:00:01,1\n\"1970-01-01T00:00:02Z\",1\n",
            1_000_000_000,
            2_000_000_000,
        ),
        (
            TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap()),
            "t,a\n01.01.1970 00:00:01,1\n\"01.01.1970 00:00:02.0\",1\n",
            1_000_000_000,
            2_000_000_000,
        ),
    ];
    for (form, text, first, second) in cases {
        let mut reader =
            Reader::from_read("f", text.as_bytes(), layout(form), Options::default()).unwrap();
        let rows = rows(&mut reader);
        assert_eq!([rows[0].0, rows[1].0], [first, second]);
        for (_, time) in rows {
            assert!(
                text.contains(&time) && time.trim() == time && !time.contains('"'),
                "{time}"
            );
        }
    }
}

#[test]
fn a_time_that_cannot_be_read_is_an_error_or_the_row_is_left_out() {
    let text = "t,a\n0,1\n,1\nnan,1\nsoon,1\n1,1\n";
    let mut reader = open(text, Options::default());
    let mut row = Row::default();
    assert!(reader.next_into(&mut row).unwrap());
    let error = reader.next_into(&mut row).unwrap_err().to_string();
    assert!(
        error.starts_with("f.csv:3: column `t`: expected a decimal number, found nothing"),
        "{error}"
    );
    let mut reader = open(text, lenient());
    assert_eq!(rows(&mut reader).len(), 2);
    assert_eq!(reader.report().refused_rows.count, 3);
}

#[test]
fn a_lenient_reader_takes_bad_cells_as_absent_and_keeps_the_first() {
    let text = "t,a\n0,1\n1,NA\n2,-\n3,4\n";
    let mut reader = open(text, lenient());
    assert_eq!(rows(&mut reader).len(), 4);
    let bad = &reader.report().bad_cells;
    assert_eq!(bad.count, 2);
    assert!(
        matches!(&bad.first, Some(FileError::BadCell { place, found, .. }) if place.line == 3 && found == "NA")
    );
    let of_channel = &reader.report().bad_cells_of[0];
    assert_eq!(of_channel.count, 2);
    assert!(of_channel.first.is_some());
}

#[test]
fn the_first_cell_of_each_channel_that_cannot_be_read_is_told_at_once() {
    let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    let text = &b"t,a,b\n0,ERR,1\n1,ERR,1\n2,ERR,FAIL\n3,ERR,FAIL\n"[..];
    let mut reader = Reader::from_read("pipe", text, layout, lenient()).unwrap();
    let reported = Arc::new(std::sync::Mutex::new(Vec::new()));
    reader.report_first({
        let reported = Arc::clone(&reported);
        move |error| reported.lock().unwrap().push(error.to_string())
    });
    assert_eq!(rows(&mut reader).len(), 4);
    let reported = reported.lock().unwrap();
    assert_eq!(reported.len(), 2);
    assert!(reported[0].starts_with("pipe:2: column `a`: expected a number, found `ERR`"));
    assert!(reported[1].starts_with("pipe:4: column `b`: expected a number, found `FAIL`"));
    assert_eq!(reader.report().bad_cells.count, 6);
}

/// Gives one line after the other, and knows how many it has begun to give.
struct LineByLine {
    lines: std::array::IntoIter<&'static str, 4>,
    rest: &'static [u8],
    given: Arc<std::sync::atomic::AtomicUsize>,
}

impl Read for LineByLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.rest.is_empty() {
            self.rest = self.lines.next().unwrap_or_default().as_bytes();
            self.given
                .fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        }
        self.rest.read(buffer)
    }
}

#[test]
fn a_row_is_given_as_soon_as_its_line_is_there() {
    let csv = ["t,a\n", "0,1\n", "1,2\r\n", "2,3\n"];
    let json = [
        "\n",
        "{\"t\":0,\"a\":1}\n",
        "{\"t\":1,\"a\":2}\r\n",
        "{\"t\":2,\"a\":3}\n",
    ];
    for lines in [csv, json] {
        let given = Arc::new(std::sync::atomic::AtomicUsize::new(0));
        let input = LineByLine {
            lines: lines.into_iter(),
            rest: &[],
            given: given.clone(),
        };
        let mut reader =
            Reader::from_read("pipe", input, layout(TimeForm::SECONDS), Options::default())
                .unwrap();
        let mut row = Row::default();
        for lines_needed in [2, 3, 4] {
            assert!(reader.next_into(&mut row).unwrap());
            assert_eq!(
                given.load(std::sync::atomic::Ordering::Relaxed),
                lines_needed
            );
            assert_eq!(row.values, [lines_needed as f64 - 1.0]);
        }
    }
}

/// The times that are given, what was left out, and the error at the end, if there was one.
fn given(text: &'static str) -> (String, Vec<String>, String) {
    let mut reader = open(text, Options::default());
    let reported = Arc::new(std::sync::Mutex::new(Vec::new()));
    reader.report_first({
        let reported = Arc::clone(&reported);
        move |error| reported.lock().unwrap().push(error.to_string())
    });
    let (mut times, mut row) = (Vec::new(), Row::default());
    let end = loop {
        match reader.next_into(&mut row) {
            Ok(true) => times.push(format!("{}={}", row.time_text, row.values[0])),
            Ok(false) => break String::new(),
            Err(error) => break error.to_string(),
        }
    };
    assert_eq!(reader.report().rows, times.len() as u64);
    let reported = reported.lock().unwrap().clone();
    (times.join(" "), reported, end)
}

#[test]
fn a_single_time_far_ahead_is_left_out_and_the_rows_after_it_are_not() {
    let (times, reported, end) = given("t,a\n0,1\n10,2\n4102444800,3\n20,4\n30,5\n");
    assert_eq!((&*times, &*end), ("0=1 10=2 20=4 30=5", ""));
    assert_eq!(
        reported,
        [
            "f.csv:4: the time `4102444800` is far after `10`, and the next one, `20`, is not; the row was left out"
        ]
    );
    let (times, ..) = given("t,a\n0,1\n10,2\n9e9,3\n8e9,4\n7,5\n20,6\n30,7\n");
    assert_eq!(times, "0=1 10=2 20=6 30=7", "each ahead of the next");
}

#[test]
fn rows_after_a_gap_are_all_given() {
    let (times, reported, end) = given("t,a\n0,1\n10,2\n40000,3\n40010,4\n90000,5\n90010,6\n");
    let all = "0=1 10=2 40000=3 40010=4 90000=5 90010=6";
    assert_eq!((&*times, &*end), (all, ""));
    assert!(reported.is_empty(), "{reported:?}");
    let (times, reported, _) = given("t,a\n0,1\n10,2\n40000,3\n40000,4\n40010,5\n");
    assert_eq!(times, "0=1 10=2 40000=3 40010=5");
    assert!(
        reported[0].starts_with("f.csv:5: the time `40000` is that of the row before"),
        "{reported:?}"
    );
}

#[test]
fn a_last_row_far_ahead_is_left_out_since_it_may_be_a_wrong_time_as_well_as_one_after_a_gap() {
    let left_out = "f.csv:4: the time `40000` is far after `10`, and no row follows that decides between a gap and a wrong time; the \
                    row was left out";
    let (times, reported, end) = given("t,a\n0,1\n10,2\n40000,3\n");
    assert_eq!((&*times, &*end), ("0=1 10=2", ""));
    assert_eq!(reported, [left_out]);
    let (times, reported, end) = given("t,a\n0,1\n10,2\n40000,3\n40010,off\n");
    assert_eq!(
        (&*times, &*reported),
        ("0=1 10=2", &[left_out.to_owned()][..])
    );
    assert!(end.starts_with("f.csv:5: column `a`"), "{end}");
    let (times, reported, _) = given("t,a\n0,1\n10,2\n90000,3\n40000,4\n");
    assert_eq!(
        (&*times, reported.len()),
        ("0=1 10=2", 1),
        "others are counted"
    );
    let two = "t,a\n0,1\n3600,2\n";
    assert_eq!(given(two).0, "0=1 3600=2", "nothing says that it leaps");
    let goes_on = Options {
        goes_on: true,
        ..Options::default()
    };
    assert_eq!(rows(&mut open(two, goes_on)).len(), 1);
}

#[test]
fn a_row_waits_for_the_next_only_where_it_leaps() {
    let lines = ["t,a\n", "0,1\n", "3600,2\n", "7200,3\n"];
    let given = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let input = LineByLine {
        lines: lines.into_iter(),
        rest: &[],
        given: given.clone(),
    };
    let layout = layout(TimeForm::SECONDS);
    let mut reader = Reader::from_read("pipe", input, layout, Options::default()).unwrap();
    let mut row = Row::default();
    for (time, lines_needed) in [(0, 2), (3600, 4), (7200, 4)] {
        assert!(reader.next_into(&mut row).unwrap());
        assert_eq!(row.time_ns, time * 1_000_000_000);
        let given = given.load(std::sync::atomic::Ordering::Relaxed);
        assert_eq!(given, lines_needed, "a row each hour is no leap");
    }
}

#[test]
fn a_file_that_is_not_there_is_an_error_that_names_it() {
    let opened = Reader::open(
        "no-such-file.csv",
        layout(TimeForm::SECONDS),
        Options::default(),
    );
    let error = opened.err().unwrap().to_string();
    assert!(
        error.starts_with("no-such-file.csv: cannot be opened: "),
        "{error}"
    );
}

/// Rows of a plan in a text: the values and instants of each, in s.
fn planned(text: &str, time: TimeForm, options: Options) -> Result<Vec<[f64; 2]>, String> {
    let mut layout = Layout::new("t", time, ["a", "from"]);
    layout.channels[1].is_instant = true;
    let input = io::Cursor::new(text.to_owned().into_bytes());
    let mut reader = Reader::from_read("f.csv", input, layout, options).unwrap();
    let (mut row, mut rows) = (Row::default(), Vec::new());
    while reader
        .next_into(&mut row)
        .map_err(|error| error.to_string())?
    {
        rows.push([row.values[0], row.values[1]]);
    }
    Ok(rows)
}

#[test]
fn an_instant_beside_the_time_is_read_as_the_time_is_whatever_its_decimal_mark() {
    let strict = Options::default();
    let seconds = "t;a;from\n0,5;1,5;12,25\n1,5;;\n2,5;2,5;NaN\n3,5;3;14\n";
    let read = planned(seconds, TimeForm::SECONDS, strict.clone()).unwrap();
    assert_eq!((read[0], read[3]), ([1.5, 12.25], [3.0, 14.0]));
    assert!(read[1][1].is_nan() && read[2][1].is_nan());
    // A date of points is no number with another mark.
    let form: TimeForm = TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap());
    let dates = "t;a;from\n01.01.1970 00:00:01,5;1,5;01.01.1970 00:00:02,25\n\
                 01.01.1970 00:00:03,5;2,5;01.01.1970 00:00:04.5\n";
    let read = planned(dates, form, strict.clone()).unwrap();
    assert_eq!(read, [[1.5, 2.25], [2.5, 4.5]]);
    let mixed = "t;a;from\n0,5;1,5;12,25\n1,5;1,5;12.75\n";
    let error = planned(mixed, TimeForm::SECONDS, strict).unwrap_err();
    assert!(
        error.contains("f.csv:3: column `from`") && error.contains("decimal mark `,`"),
        "{error}"
    );
}

#[test]
fn a_cell_beside_the_time_that_is_no_instant_says_what_one_looks_like() {
    let text =
        "t,a,from\n1970-01-01T00:00:00Z,1,soon\n1970-01-01T00:00:01Z,2,1970-01-01T00:00:09Z\n";
    let error = planned(text, TimeForm::Rfc3339, Options::default()).unwrap_err();
    assert_eq!(
        error,
        "f.csv:2: column `from`: expected a date and time such as 2013-07-04T00:00:00Z, found `soon`; correct the time or how it is to \
         be read, or read leniently (`--lenient`) to take it as absent"
    );
    let read = planned(text, TimeForm::Rfc3339, lenient()).unwrap();
    assert!(read[0][0] == 1.0 && read[0][1].is_nan() && read[1] == [2.0, 9.0]);
}
