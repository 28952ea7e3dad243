use crate::{FileError, Layout, Options, Reader, Row, TimeForm};

fn read_with(text: &str, lenient: bool) -> Result<(String, Reader), FileError> {
    let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    let options = Options {
        lenient,
        ..Options::default()
    };
    let input = std::io::Cursor::new(text.to_owned());
    let mut reader = Reader::from_read("standard input", input, layout, options)?;
    let mut row = Row::default();
    let mut reported = Vec::new();
    while reader.next_into(&mut row)? {
        reported.push(format!("{} {:?}", row.time_text, row.values));
    }
    Ok((reported.join("; "), reader))
}

fn read(text: &str) -> String {
    read_with(text, false).unwrap().0
}

fn error(text: &str) -> String {
    read_with(text, false).err().unwrap().to_string()
}

#[test]
fn an_object_is_known_by_its_brace_and_its_keys_may_stand_in_any_order() {
    assert_eq!(
        read(
            "{\"t\": 0.3, \"a\": 1, \"b\": 2.5}\n\n{\"x\": {\"a\": [7]}, \"b\": 3e0, \"t\": 1, \"a\": -1}\r\n"
        ),
        "0.3 [1.0, 2.5]; 1 [-1.0, 3.0]"
    );
}

#[test]
fn files_with_a_mark_that_are_put_behind_each_other_are_read_as_one() {
    let line = |t: u32| format!("\u{feff}{{\"t\":{t},\"a\":1,\"b\":2}}\n");
    assert_eq!(read(&(line(0) + &line(1))), "0 [1.0, 2.0]; 1 [1.0, 2.0]");
}

#[test]
fn null_and_a_missing_key_are_no_value() {
    assert_eq!(
        read("{\"t\":0,\"a\":null}\n{\"t\":1,\"b\":2,\"a\":1}\n{\"t\":2}\n"),
        "0 [NaN, NaN]; 1 [1.0, 2.0]; 2 [NaN, NaN]"
    );
}

#[test]
fn non_finite_numbers_are_read_as_text_and_as_python_writes_them() {
    assert_eq!(
        read(
            "{\"t\":0,\"a\":\"-inf\",\"b\":\"NaN\"}\n{\"t\":1,\"a\":-Infinity,\"b\":NaN,\"n\":\"\\\"NaN\"}\n"
        ),
        "0 [-inf, NaN]; 1 [-inf, NaN]"
    );
}

#[test]
fn text_with_escapes_is_the_same_text() {
    assert_eq!(
        read("{\"\\u0074\":\"\\u0030\",\"a\":1,\"b\":\"2\"}"),
        "0 [1.0, 2.0]"
    );
}

#[test]
fn a_flag_is_one_or_zero() {
    assert_eq!(
        read("{\"t\":0,\"a\":true,\"b\":\"False\"}\n"),
        "0 [1.0, 0.0]"
    );
}

#[test]
fn a_value_that_is_no_number_is_an_error_with_line_and_key() {
    for value in ["[1]", "{}", "\"off\""] {
        let text = format!("{{\"t\":0,\"a\":1,\"b\":2}}\n{{\"t\":1,\"a\":{value}}}\n");
        let found = value.trim_matches('"');
        assert!(
            error(&text).starts_with(&format!(
                "standard input:2: column `a`: expected a number, found `{found}`"
            )),
            "{value}"
        );
        let (rows, reader) = read_with(&text, true).unwrap();
        assert_eq!(rows, "0 [1.0, 2.0]; 1 [NaN, NaN]");
        assert_eq!(reader.report().bad_cells.count, 1);
    }
}

#[test]
fn a_line_that_is_no_object_is_an_error_or_left_out() {
    let text = "{\"t\":0,\"a\":1,\"b\":2}\n{\"t\":1 \"a\":1}\n[1]\n{\"t\":1} {}\n{\"t\":2,\"t\":3}\n{\"t\":4}\n";
    assert_eq!(
        error(text),
        "standard input:2: expected one JSON object on the line: expected `,` or `}` at column 8; write one object per line, or read leniently (`--lenient`) to leave the line out"
    );
    let (rows, reader) = read_with(text, true).unwrap();
    assert_eq!(rows, "0 [1.0, 2.0]; 4 [NaN, NaN]");
    let refused = &reader.report().refused_rows;
    assert_eq!(refused.count, 4);
    assert!(matches!(&refused.first, Some(FileError::BadObject { place, .. }) if place.line == 2));
}

#[test]
fn an_array_is_an_error_that_asks_for_one_object_a_line() {
    let object = "{\"t\":0,\"a\":1,\"b\":2}";
    let long = format!("[{}{object}]", format!("{object},").repeat(50_000));
    let arrays = [
        format!("[{object},{object}]"),
        format!("[{object}]\n"),
        format!("[\n  {object},\n  {object}\n]\n"),
        "[[0,1,2]]".to_owned(),
        long,
    ];
    for text in arrays {
        for lenient in [false, true] {
            let reported = read_with(&text, lenient).err().unwrap().to_string();
            assert!(
                reported.starts_with("standard input:1: a JSON array begins here, where one object a line is expected"),
                "{reported}"
            );
        }
    }
    let layout = Layout::new("[s]", TimeForm::SECONDS, ["a"]);
    let header = &b"[s],a\n0,1\n"[..];
    assert!(Reader::from_read("f", header, layout, Options::default()).is_ok());
}

#[test]
fn a_line_without_time_is_an_error_or_left_out() {
    let text = "{\"t\":0,\"a\":1,\"b\":2}\n{\"a\":1}\n";
    assert!(
        error(text)
            .starts_with("standard input:2: column `t`: expected a decimal number, found nothing")
    );
    assert_eq!(
        read_with(text, true).unwrap().1.report().refused_rows.count,
        1
    );
}

#[test]
fn a_first_line_without_time_is_left_out_as_any_other() {
    let text = "{\"a\":1}\n{\"t\":0,\"a\":1,\"b\":2}\n{\"b\":1}\n";
    assert!(error(text).starts_with("standard input:1: there is no column `t`; found `a`"));
    let (rows, reader) = read_with(text, true).unwrap();
    assert_eq!(rows, "0 [1.0, 2.0]");
    assert_eq!(reader.report().refused_rows.count, 2);
    let never = read_with("{\"a\":1}\n{\"a\":1}\n", true).err().unwrap();
    assert!(
        never
            .to_string()
            .starts_with("standard input:2: there are no columns `t`, `b`")
    );
}

#[test]
fn keys_that_never_come_are_an_error_that_lists_those_found() {
    assert_eq!(
        error("{\"time\":0,\"a\":1}\n"),
        "standard input:1: there is no column `t`; found `time`, `a`; correct the name, or make it optional if it is a channel"
    );
    assert_eq!(
        error("{\"t\":0,\"a\":1,\"bb\":1}\n{\"t\":1}\n"),
        "standard input:2: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"
    );
    assert_eq!(
        error("{\"t\":0,\"aa\":1,\"bb\":1}\n{\"t\":1}\n"),
        "standard input:2: there are no columns `a`, `b`; found `t`, `aa`, `bb`; did you mean `aa` for `a`, `bb` for `b`?"
    );
}

#[test]
fn keys_that_the_first_object_lacks_are_told_at_once_where_that_is_asked_for() {
    use std::sync::{Arc, Mutex};
    let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
    let text = &b"{\"t\":0,\"a\":1,\"bb\":1}\n{\"t\":1}\n{\"t\":2,\"b\":1}\n"[..];
    let mut reader = Reader::from_read("pipe", text, layout, Options::default()).unwrap();
    let reported = Arc::new(Mutex::new(Vec::new()));
    reader.report_first({
        let reported = Arc::clone(&reported);
        move |first| reported.lock().unwrap().push(first.to_string())
    });
    let expected = ["pipe:1: there is no column `b`; found `t`, `a`, `bb`; did you mean `bb`?"];
    let mut row = Row::default();
    while reader.next_into(&mut row).unwrap() {
        assert_eq!(*reported.lock().unwrap(), expected);
    }
}

#[test]
fn a_line_that_is_too_long_is_an_error_or_left_out_and_the_next_is_read() {
    for long in ["{\"x\":\"", "["] {
        let long = long.to_owned() + &"y".repeat(3_000_000);
        let text = format!("{{\"t\":0,\"a\":1,\"b\":2}}\n{long}\n{{\"t\":1,\"a\":3,\"b\":4}}\n");
        assert!(read_with(&text, false).is_err());
        let (rows, reader) = read_with(&text, true).unwrap();
        assert_eq!(rows, "0 [1.0, 2.0]; 1 [3.0, 4.0]");
        assert_eq!(reader.report().refused_rows.count, 1);
    }
}

#[test]
fn a_last_object_that_was_cut_off_is_reported_and_the_rest_used() {
    let (rows, reader) = read_with("{\"t\":0,\"a\":1,\"b\":2}\n{\"t\":1,\"a\"", false).unwrap();
    assert_eq!(rows, "0 [1.0, 2.0]");
    assert_eq!(
        reader.report().truncated.as_ref().map(|place| place.line),
        Some(2)
    );
    let (rows, reader) = read_with("{\"t\":0,\"a\":1,\"b\":2}", false).unwrap();
    assert_eq!(rows, "0 [1.0, 2.0]");
    assert!(reader.report().truncated.is_none());
}

#[test]
fn a_last_object_without_a_line_end_is_left_out_where_more_comes_later() {
    let options = Options {
        goes_on: true,
        ..Options::default()
    };
    let layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
    let text = &b"{\"t\":0,\"a\":1}\n{\"t\":1,\"a\":2}"[..];
    let mut reader = Reader::from_read("pipe", text, layout, options).unwrap();
    let mut row = Row::default();
    assert!(reader.next_into(&mut row).unwrap());
    assert!(!reader.next_into(&mut row).unwrap());
    assert_eq!(reader.report().truncated.as_ref().unwrap().line, 2);
}
