mod declared;
mod lines;

use athermal_core::document::{Pattern, Separator, TableBase, TableFormat};

use crate::{FileError, Layout, Options, Reader, Row, TimeForm};

fn reader(text: &str, options: Options) -> Result<Reader, FileError> {
    let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    Reader::from_read(
        "f.csv",
        std::io::Cursor::new(text.to_owned()),
        layout,
        options,
    )
}

/// All rows as text, the way `{:?}` shows numbers, and the reader for its report.
fn read_with(text: &str, options: Options) -> (String, Reader) {
    let mut reader = reader(text, options).unwrap();
    let mut row = Row::default();
    let mut reported = Vec::new();
    while reader.next_into(&mut row).unwrap() {
        reported.push(format!("{} {:?}", row.time_text, row.values));
    }
    (reported.join("; "), reader)
}

/// The rows of a text whose layout is declared, or the message of the error.
fn declared_read(base: TableFormat, text: &str) -> String {
    let layout = Layout {
        table: TableBase {
            base,
            ..TableBase::default()
        },
        ..Layout::new("t", TimeForm::SECONDS, ["a", "b"])
    };
    let text = std::io::Cursor::new(text.as_bytes().to_vec());
    let mut rows = Vec::new();
    let mut row = Row::default();
    let read = || {
        let mut reader = Reader::from_read("f.csv", text, layout, Options::default())?;
        while reader.next_into(&mut row)? {
            let begins = if row.begins_segment { "| " } else { "" };
            rows.push(format!("{begins}{} {:?}", row.time_text, row.values));
        }
        Ok(())
    };
    match read() {
        Ok(()) => rows.join("; "),
        Err::<(), FileError>(error) => error.to_string(),
    }
}

fn read(text: &str) -> String {
    read_with(text, Options::default()).0
}

/// The message of the first error.
fn error(text: &str) -> String {
    let mut reader = match reader(text, Options::default()) {
        Ok(reader) => reader,
        Err(error) => return error.to_string(),
    };
    let mut row = Row::default();
    loop {
        match reader.next_into(&mut row) {
            Ok(true) => {}
            Ok(false) => panic!("there was no error"),
            Err(error) => return error.to_string(),
        }
    }
}

fn lenient() -> Options {
    Options {
        lenient: true,
        ..Options::default()
    }
}

const TWO_ROWS: &str = "0 [1.0, 2.5]; 1 [3.0, NaN]";

#[test]
fn every_delimiter_is_recognised() {
    for delimiter in [",", ";", "\t", "|"] {
        let text = "t,b,skipped,a\n0,2.5,x,1\n1,,y,3\n".replace(',', delimiter);
        assert_eq!(read(&text), TWO_ROWS, "{delimiter:?}");
    }
}

#[test]
fn a_declared_separator_is_taken() {
    let declared = TableFormat {
        separator: Some(Separator(b'/')),
        ..TableFormat::default()
    };
    assert_eq!(declared_read(declared, "t/a/b\n0/1/2.5\n"), "0 [1.0, 2.5]");
}

#[test]
fn a_decimal_comma_is_read_where_something_else_than_a_comma_separates() {
    for delimiter in [";", "\t", "|"] {
        let text = "t;a;b\n0,5;1,5;-2,25e1\n".replace(';', delimiter);
        assert_eq!(read(&text), "0.5 [1.5, -22.5]", "{delimiter:?}");
        let mixed = "t;a;b\n0;1,5;2\n1;1.5;2\n".replace(';', delimiter);
        assert!(error(&mixed).contains("with the decimal mark `,`"));
    }
    assert!(error("t,a,b\n0,\"1,5\",2\n").contains("`1,5`"));
}

#[test]
fn a_file_has_one_decimal_mark() {
    let mixed = "t;a;b\n0;1,5;2\n1;1;1.234\n2;7;2,5\n";
    assert_eq!(
        error(mixed),
        "f.csv:3: column `b`: expected a number with the decimal mark `,`, as in line 2, found `1.234`; write all numbers of a file with one mark, or read leniently (`--lenient`) to leave out those with another"
    );
    let (rows, reader) = read_with(mixed, lenient());
    assert_eq!(rows, "0 [1.5, 2.0]; 1 [1.0, NaN]; 2 [7.0, 2.5]");
    assert_eq!(reader.report().bad_cells.count, 1);
    let times = "t;a;b\n0.5;1.5;2\n1,5;1;1\n2.5;7;3\n";
    assert!(error(times).starts_with("f.csv:3: column `t`: expected a number with the decimal mark `.`, as in line 2, found `1,5`"));
    let (rows, reader) = read_with(times, lenient());
    assert_eq!(rows, "0.5 [1.5, 2.0]; 2.5 [7.0, 3.0]");
    assert_eq!(reader.report().refused_rows.count, 1);
    assert_eq!(
        read("t;a;b\n0.5;1.5;2\n1;1;2.5\n"),
        "0.5 [1.5, 2.0]; 1 [1.0, 2.5]"
    );
}

#[test]
fn times_may_have_another_mark_than_values() {
    assert_eq!(
        read("t;a;b\n0.5;1,5;2\n1.5;1;2,5\n"),
        "0.5 [1.5, 2.0]; 1.5 [1.0, 2.5]"
    );
}

#[test]
fn the_seconds_of_a_date_may_have_another_mark_than_numbers() {
    let layout = Layout::new("t", TimeForm::Rfc3339, ["a"]);
    let text = &b"t;a\n2013-07-04T00:00:00.5Z;1,5\n"[..];
    let mut reader = Reader::from_read("f", text, layout, Options::default()).unwrap();
    let mut row = Row::default();
    assert!(reader.next_into(&mut row).unwrap());
    assert_eq!(row.values, [1.5]);
}

#[test]
fn marks_of_other_programs_do_no_harm() {
    assert_eq!(read("\u{feff}t,a,b\r\n0,1,2.5\r\n1,3,\r\n"), TWO_ROWS);
    assert_eq!(
        read("# note\n\nt,a,b\n\n0,1,2.5\n  \n# 1,1,1\n1,3,\n\n"),
        TWO_ROWS
    );
    assert_eq!(read(" t , \"a\" ,b\n 0 , 1, 2.5 \n1,3, \n"), TWO_ROWS);
}

#[test]
fn quoted_names_and_cells_are_read() {
    let text = "\"t\",\"a\",\"b\",\"a, \"\"quoted\"\" note\"\n\"0\",\"1\",2.5,\"x, y\nz\"\n1,3,\"\",\"\"\n";
    assert_eq!(read(text), TWO_ROWS);
}

#[test]
fn a_row_keeps_its_line_after_comments_and_quoted_line_breaks() {
    assert_eq!(
        error("# one\nt,a,b\n0,\"1\n\",2\n\n# six\n1,off,2\n"),
        "f.csv:7: column `a`: expected a number, found `off`; leave the cell empty where there is no value, or read leniently (`--lenient`) to take it as absent"
    );
}

#[test]
fn a_doubled_name_is_an_error() {
    assert!(error("t,a,b,a\n").starts_with("f.csv:1: the name `a` stands at columns 2 and 4"));
}

#[test]
fn a_missing_column_is_an_error_that_lists_those_found() {
    assert_eq!(
        error("t,a,bb\n0,1,2\n"),
        "f.csv:1: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"
    );
    assert!(
        error("time,a,b\n").starts_with("f.csv:1: there is no column `t`; found `time`, `a`, `b`")
    );
}

#[test]
fn all_missing_columns_are_told_at_once_and_an_optional_one_is_not() {
    let mut layout = Layout::new("t", TimeForm::SECONDS, ["room", "plate", "chuck", "room"]);
    layout.channels[1].optional = true;
    let file = &b"time,chuk,rooms\n0,1,2\n"[..];
    let error = Reader::from_read("f.csv", file, layout, Options::default()).err();
    assert_eq!(
        error.unwrap().to_string(),
        "f.csv:1: there are no columns `t`, `room`, `chuck`; found `time`, `chuk`, `rooms`; did you mean `rooms` for `room`, `chuk` for `chuck`? otherwise correct the names, or make optional those that are channels"
    );
}

#[test]
fn an_optional_column_that_is_missing_is_absent_throughout() {
    let mut layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    layout.channels[0].optional = true;
    let mut reader =
        Reader::from_read("f.csv", &b"t,b\n0,1\n1,2\n"[..], layout, Options::default()).unwrap();
    let mut row = Row::default();
    for expected in [1.0, 2.0] {
        assert!(reader.next_into(&mut row).unwrap());
        assert!(row.values[0].is_nan());
        assert_eq!(row.values[1], expected);
    }
}

#[test]
fn a_row_of_another_length_is_an_error_or_left_out() {
    let text = "t,a,b\n0,1,2.5\n5\n6,1,2,3\n,1\n1,3,\n";
    assert_eq!(
        error(text),
        "f.csv:3: 1 cells where the header has 3; correct the row, or read leniently (`--lenient`) to leave it out"
    );
    let (rows, reader) = read_with(text, lenient());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(reader.report().refused_rows.count, 3);
    assert_eq!(reader.report().rows, 2);
}

#[test]
fn a_row_may_end_behind_its_last_value_and_is_counted() {
    let (rows, reader) = read_with("t,a,b\n0,1,2.5\n1,3\n", Options::default());
    assert_eq!(rows, TWO_ROWS);
    let short = &reader.report().short_rows;
    let first = short.first.as_ref().unwrap().to_string();
    assert_eq!(short.count, 1);
    assert_eq!(
        first,
        "f.csv:3: 2 cells where the header has 3; those behind them are taken as missing"
    );
    // Cells of the row before are none of this one.
    assert_eq!(read("t,b,a\n0,2.5,1\n1\t,,3\n"), TWO_ROWS);
    let (rows, reader) = read_with("t,b,a\n0,2.5,1\n1,7\n2,8,9\n", Options::default());
    assert_eq!(rows, "0 [1.0, 2.5]; 1 [NaN, 7.0]; 2 [9.0, 8.0]");
    assert_eq!(reader.report().short_rows.count, 1);
}

#[test]
fn a_note_behind_the_named_columns_is_passed_over_where_the_first_row_has_one() {
    let (rows, reader) = read_with("t,a,b\n0,1,2.5,began\n1,3,,\n", Options::default());
    assert_eq!(rows, TWO_ROWS);
    let first = reader.report().notes.first.as_ref().unwrap().to_string();
    assert!(
        first.starts_with("f.csv:2: `began` stands behind the last column"),
        "{first}"
    );
    assert!(error("t,a,b\n0,1,2.5\n1,3,5,note\n").contains("4 cells where the header has 3"));
}

#[test]
fn an_empty_file_and_one_without_rows_differ() {
    assert!(matches!(
        reader("", Options::default()),
        Err(FileError::Empty { .. })
    ));
    assert!(matches!(
        reader("# only\n\n", Options::default()),
        Err(FileError::Empty { .. })
    ));
    assert_eq!(read("t,a,b\n"), "");
    assert_eq!(read("t,a,b"), "");
}

#[test]
fn names_as_a_windows_program_writes_them_are_read() {
    let layout = |name| Layout::new("t", TimeForm::SECONDS, [name]);
    let log = &b"t;W\xe4rme [\xb0C]\n0;21,5\n"[..];
    let read = |name| Reader::from_read("f.csv", log, layout(name), Options::default());
    let mut row = Row::default();
    assert!(read("Wärme [°C]").unwrap().next_into(&mut row).unwrap());
    assert_eq!(row.values, [21.5]);
    assert_eq!(
        read("温度").err().unwrap().to_string(),
        "f.csv:1: there is no column `温度`; found `t`, `Wärme [°C]` (read as Windows-1252, since they are not in UTF-8); \
         correct the name, or make it optional if it is a channel"
    );
}

#[test]
fn two_byte_text_without_a_mark_is_refused_with_advice() {
    let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
    let utf16 = b"t\0,\0a\0\n\0";
    let refused = Reader::from_read("f.csv", &utf16[..], layout, Options::default());
    assert!(matches!(refused, Err(FileError::NotText { place }) if place.line == 1));
}

/// What was reported of rows that name the columns again.
fn headers(reader: &Reader) -> (u64, String) {
    let report = reader.report();
    let headers = match report.headers_moved.count {
        0 => &report.headers,
        _ => &report.headers_moved,
    };
    let first = headers.first.as_ref();
    (
        headers.count,
        first.map_or(String::new(), ToString::to_string),
    )
}

#[test]
fn a_header_within_the_log_moves_the_columns_and_is_told() {
    for moved in [
        "t,a,b\n0,1,2.5\nb,t,a\n,1,3\n",
        "t,a,b\n0,1,2.5\nb,new,t,a\n,7,1,3\n",
        "t,x,a,b\n0,9,1,2.5\nb,t,a\n,1,3\n",
        "t,x,a,b\n0,9,1,2.5\n\"t\", b ,a\n1,,3\n",
        "#t,a,b\n# note\n0,1,2.5\n# b,t,a\n,1,3\n",
        "t,a,b\n0,1,2.5,\nt,b,a\ns,nm,nm\n1,,3\n",
    ] {
        for options in [Options::default(), lenient()] {
            let (rows, reader) = read_with(moved, options);
            assert_eq!(rows, TWO_ROWS, "{moved}");
            let line = moved.lines().count() - 1 - usize::from(moved.contains("nm"));
            let reported = format!(
                "f.csv:{line}: the names of the columns stand here again, in other places; from here on values are taken by them"
            );
            assert_eq!(headers(&reader), (1, reported), "{moved}");
            assert_eq!(reader.report().refused_rows.count, 0);
        }
    }
}

#[test]
fn a_header_that_says_the_same_again_is_left_out_and_told_once_and_each_that_does_not_is_told() {
    let text = "t,a,b\nt,a,b\n0,1,2.5\nt,a,b\n1,3,\nt,b,a\n2,5,6\nt,b,a\nt,a,b\n3,7,8\n";
    let mut reader = reader(text, Options::default()).unwrap();
    let reported = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    reader.report_first({
        let reported = reported.clone();
        move |error| reported.lock().unwrap().push(error.to_string())
    });
    let mut row = Row::default();
    while reader.next_into(&mut row).unwrap() {}
    let again = |line: u8, how: &str| {
        format!("f.csv:{line}: the names of the columns stand here again, {how}")
    };
    let moved = "in other places; from here on values are taken by them";
    assert_eq!(
        *reported.lock().unwrap(),
        [
            again(2, "as before; the row was left out"),
            again(6, moved),
            again(9, moved)
        ]
    );
    let report = reader.report();
    assert_eq!((report.rows, report.headers.count), (4, 3));
    assert_eq!(report.headers_moved.count, 0, "each was reported");
}

#[test]
fn a_header_within_the_log_that_lacks_a_channel_is_an_error_and_leniently_the_channel_is_absent() {
    let text = "t,a,b\n0,1,2.5\nt,a,c\n1,3,4\n";
    assert_eq!(
        error(text),
        "f.csv:3: there is no column `b`; found `t`, `a`, `c`; correct the name, or make it optional if it is a channel"
    );
    let (rows, read) = read_with(text, lenient());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(
        headers(&read).1,
        "f.csv:3: the names of the columns stand here again, in other places; from here on values are taken by them, and without `b`, \
         of which there are none"
    );
}

#[test]
fn a_header_within_the_log_that_cannot_be_used_is_an_error_or_left_out_and_the_columns_stay() {
    for (header, reported) in [
        ("time,a,b", "f.csv:3: there is no column `t`"),
        ("t,a,b,a", "f.csv:3: the name `a` stands at columns 2 and 4"),
    ] {
        let text = format!("t,a,b\n0,1,2.5\n{header}\n1,3,\n");
        let failed = error(&text);
        assert!(failed.starts_with(reported), "{failed}");
        let (rows, reader) = read_with(&text, lenient());
        assert_eq!(rows, TWO_ROWS);
        let refused = &reader.report().refused_rows;
        assert_eq!((refused.count, headers(&reader).0), (1, 0));
        assert!(
            refused
                .first
                .as_ref()
                .unwrap()
                .to_string()
                .starts_with(reported)
        );
    }
    let other_places = "t,a,b\n0,1,2.5\ntime,b,a\n5,6,7\nt,b,a\n1,,3\n";
    let (rows, reader) = read_with(other_places, lenient());
    assert_eq!(rows, TWO_ROWS, "no value is taken for another");
    assert_eq!(reader.report().refused_rows.count, 2);
}

#[test]
fn a_header_that_was_cut_off_within_the_log_is_an_error_or_left_out_and_the_columns_stay() {
    for header in ["t", "t,a", "t,b"] {
        let text = format!("t,a,b\n0,1,2.5\n{header}\n1,3,\n");
        assert!(error(&text).starts_with("f.csv:3: there "));
        let (rows, reader) = read_with(&text, lenient());
        assert_eq!(rows, TWO_ROWS, "{header}");
        let refused = &reader.report().refused_rows;
        assert_eq!((refused.count, headers(&reader).0), (1, 0));
        let reported = "f.csv:3: there ";
        assert!(
            refused
                .first
                .as_ref()
                .unwrap()
                .to_string()
                .starts_with(reported)
        );
    }
}

#[test]
fn a_header_that_was_cut_off_at_the_end_lacks_nothing() {
    for cut in ["t,a", "t,a,", "t,a,c"] {
        let (rows, reader) = read_with(&format!("t,a,b\n0,1,2.5\n1,3,\n{cut}"), Options::default());
        assert_eq!(rows, TWO_ROWS);
        let truncated = reader.report().truncated.as_ref();
        assert_eq!(truncated.map(|place| place.line), Some(4), "{cut}");
        assert_eq!(headers(&reader).0, 0);
    }
}

#[test]
fn a_row_with_a_text_that_is_a_name_too_is_no_header() {
    let text = "t,a,b,axis\n0,1,2.5,a\nx,,,a\n1,3,,t\n";
    let (rows, reader) = read_with(text, lenient());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(headers(&reader).0, 0);
    assert_eq!(reader.report().refused_rows.count, 1);
}

#[test]
fn what_stands_above_the_names_is_passed_over() {
    for above in [
        "sep=,\n",
        "sep=\n",
        "\"sep=,\"\r\n",
        "Logger 3000\nSerial,12345\n\n",
        "t,12:00\na,5\n",
        "# t\n#a\n",
    ] {
        assert_eq!(
            read(&format!("{above}t,a,b\n0,1,2.5\n1,3,\n")),
            TWO_ROWS,
            "{above}"
        );
    }
    let text = "sep=;\r\nDevice;x, y, z\r\n# t;a;b\r\n0;1;2,5\r\n1;3;\r\n";
    assert_eq!(read(text), TWO_ROWS);
}

#[test]
fn names_that_are_nowhere_are_told_of_the_line_that_has_the_most() {
    assert_eq!(
        error("Device,5\nt,a,c\n0,1,2\n"),
        "f.csv:2: there is no column `b`; found `t`, `a`, `c`; correct the name, or make it optional if it is a channel"
    );
    assert!(
        error("x,y\n0,1\n")
            .starts_with("f.csv:1: there are no columns `t`, `a`, `b`; found `x`, `y`")
    );
    let far = format!("{}t,a,b\n0,1,2\n", "x\n".repeat(50));
    assert!(error(&far).starts_with("f.csv:1: there are no columns"));
}

#[test]
fn the_header_is_not_waited_for_beyond_its_own_line() {
    struct Ends(&'static [u8]);
    impl std::io::Read for Ends {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            assert!(!self.0.is_empty(), "it would wait here");
            self.0.read(into)
        }
    }
    let layout = || Layout::new("t", TimeForm::SECONDS, ["a"]);
    let open = |text| Reader::from_read("pipe", Ends(text), layout(), Options::default());
    assert!(open(b"t,a\n").is_ok());
    assert!(open(b"#t,a\n0,1\n").is_ok());
}

#[test]
fn a_row_of_units_below_the_names_is_no_data() {
    for units in ["s,nm,nm", ",°C,-", "[s],[°C],[nm]", "hh:mm:ss,(%),um"] {
        assert_eq!(
            read(&format!("t,a,b\n{units}\n0,1,2.5\n1,3,\n")),
            TWO_ROWS,
            "{units}"
        );
    }
    assert!(error("t,a,b\n0,1,2.5\ns,nm,nm\n").contains("expected a decimal number, found `s`"));
    assert!(error("t,a,b\ns,on,off\n0,1,2.5\n").contains("expected a decimal number, found `s`"));
}

#[test]
fn rows_may_end_in_a_delimiter_that_the_names_lack() {
    assert_eq!(read("t,a,b\n0,1,2.5,\n1,3,,\n"), TWO_ROWS);
    assert_eq!(read("t,a,b\r\n0,1,2.5, \r\n1,3,\r\n"), TWO_ROWS);
    let reported = "4 cells where the header has 3";
    assert!(error("t,a,b\n0,1,2.5,\n1,3,5,7\n").contains(reported));
    // The first row says how all end: here one number has a comma that was meant to be decimal.
    assert!(error("t,a,b\n0,1,2.5\n1,3,5,\n").contains(reported));
}

#[test]
fn a_log_in_long_format_is_refused_as_that() {
    let text = "t;tag;value\n0;a;1\n0;b;2,5\n";
    let reported = error(text);
    assert!(
        reported.starts_with("f.csv:1: the log is in long format: `tag` says"),
        "{reported}"
    );
    let text = "wann;was;wieviel\n0;a;1\n0;b;2,5\n";
    assert!(error(text).contains(".pivot(index=\"wann\", columns=\"was\", values=\"wieviel\")"));
}

#[test]
fn seconds_of_a_date_with_points_may_have_a_decimal_comma() {
    let format = TimeForm::Format("%d.%m.%Y %H:%M:%S%.f".parse().unwrap());
    let layout = Layout::new("t", format, ["a"]);
    let text = &b"t;a\n04.07.2013 00:00:00,5;1,5\n"[..];
    let mut reader = Reader::from_read("f", text, layout, Options::default()).unwrap();
    let mut row = Row::default();
    assert!(reader.next_into(&mut row).unwrap());
    assert_eq!(row.time_text, "04.07.2013 00:00:00.5");
}

#[test]
fn a_logger_that_begins_anew_writes_all_that_stood_above_its_table_again() {
    let above = "sep=;\nDevice;Logger 3000;;\nExported;01.03.2026\n";
    let text = format!("{above}t;a;b\ns;nm;nm\n0;1;2,5\n{above}t;b;a\ns;nm;nm\n1;;3\n");
    let (rows, reader) = read_with(&text, Options::default());
    assert_eq!(rows, TWO_ROWS);
    assert_eq!(headers(&reader).0, 1);
    let like_a_name = "t;12:00;\nt;a;b\n0;1;2,5\nt;13:00;\nt;b;a\n1;;3\n";
    assert_eq!(read(like_a_name), TWO_ROWS);
    let numbered = "1;Plate\nt;a;b\n0;1;2,5\n1;3\n";
    assert_eq!(read(numbered), TWO_ROWS);
    let unknown = "Device;5\nt;a;b\n0;1;2,5\nSerial;7\n";
    assert!(error(unknown).contains("2 cells where the header has 3"));
}
