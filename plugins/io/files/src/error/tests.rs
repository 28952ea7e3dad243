use super::*;

fn place() -> Place {
    Place {
        file: "run.csv".into(),
        line: 12,
    }
}

#[test]
fn messages_say_what_where_and_what_to_do() {
    let bad = FileError::BadCell {
        place: place(),
        column: "room".into(),
        found: "off".into(),
        fault: CellFault::NoNumber,
    };
    assert_eq!(
        bad.to_string(),
        "run.csv:12: column `room`: expected a number, found `off`; leave the cell empty where there is no value, or read leniently (`--lenient`) to take it as absent"
    );
    let time = FileError::BadCell {
        place: place(),
        column: "time_s".into(),
        found: String::new(),
        fault: CellFault::NoTime {
            expected: "a decimal number".to_owned(),
        },
    };
    assert_eq!(
        time.to_string(),
        "run.csv:12: column `time_s`: expected a decimal number, found nothing; correct the time or how it is to be read, or read leniently (`--lenient`) to leave the row out"
    );
    let beyond = FileError::BadCell {
        place: place(),
        column: "time_s".into(),
        found: "9223372046".into(),
        fault: CellFault::TimeBeyond,
    };
    assert_eq!(
        beyond.to_string(),
        "run.csv:12: column `time_s`: the time `9223372046` is more than 292 years from the origin of time, and no such instant fits; correct the time or its `unit` in `[time]`, or read leniently (`--lenient`) to leave the row out"
    );
    let dated = FileError::BadCell {
        place: place(),
        column: "time_s".into(),
        found: "2026-03-01 10:00".into(),
        fault: CellFault::NoTime {
            expected: "a decimal number".to_owned(),
        },
    };
    assert_eq!(
        dated.to_string(),
        "run.csv:12: column `time_s`: expected a decimal number, found `2026-03-01 10:00`; `unit = \"rfc3339\"` in `[time]` reads such times"
    );
    for expected in [
        "a decimal number",
        "a date and time such as 2013-07-04T00:00:00Z",
    ] {
        let elsewhere = FileError::BadCell {
            place: place(),
            column: "time_s".into(),
            found: "01.03.2026 10:00".into(),
            fault: CellFault::NoTime {
                expected: expected.to_owned(),
            },
        };
        assert_eq!(
            elsewhere.to_string(),
            format!(
                "run.csv:12: column `time_s`: expected {expected}, found `01.03.2026 10:00`; `[time]` reads dates and times by \
                 their `format`, e.g. `format = \"%d.%m.%Y %H:%M:%S\"` for 31.12.2026 23:59:59"
            )
        );
    }
    let of_day = FileError::BadCell {
        place: place(),
        column: "Time".into(),
        found: "12:00:00,5".into(),
        fault: CellFault::NoTime {
            expected: "a date and time such as 2013-07-04T00:00:00Z".to_owned(),
        },
    };
    assert_eq!(
        of_day.to_string(),
        "run.csv:12: column `Time`: expected a date and time such as 2013-07-04T00:00:00Z, found `12:00:00,5`; a time of day alone is \
         no instant: where its date stands in another column, name both in `[time]`, e.g. `column = \"{Date} {Time}\"`, else write it \
         before the time"
    );
    let count = FileError::CellCount {
        place: place(),
        expected: 3,
        found: 2,
    };
    assert_eq!(
        count.to_string(),
        "run.csv:12: 2 cells where the header has 3; correct the row, or read leniently (`--lenient`) to leave it out"
    );
}

#[test]
fn all_missing_columns_stand_in_one_message() {
    let reported = |missing: &[(&str, Option<&str>)]| {
        let column = |(name, nearest): &(&str, Option<&str>)| MissingColumn {
            name: (*name).into(),
            nearest: nearest.map(Into::into),
        };
        let error = FileError::MissingColumns {
            place: place(),
            missing: missing.iter().map(column).collect(),
            found: vec!["time_s".into(), "room".into()],
            note: "",
        };
        error.to_string()
    };
    let (time, room, plate) = (
        ("tme_s", Some("time_s")),
        ("rom", Some("room")),
        ("plate", None),
    );
    assert_eq!(
        reported(&[room]),
        "run.csv:12: there is no column `rom`; found `time_s`, `room`; did you mean `room`?"
    );
    assert_eq!(
        reported(&[plate]),
        "run.csv:12: there is no column `plate`; found `time_s`, `room`; correct the name, or make it optional if it is a channel"
    );
    assert_eq!(
        reported(&[time, room]),
        "run.csv:12: there are no columns `tme_s`, `rom`; found `time_s`, `room`; did you mean `time_s` for `tme_s`, `room` for `rom`?"
    );
    assert_eq!(
        reported(&[plate, room]),
        "run.csv:12: there are no columns `plate`, `rom`; found `time_s`, `room`; did you mean `room` for `rom`? otherwise correct the names, or make optional those that are channels"
    );
}

#[test]
fn an_excerpt_is_short_and_never_cuts_a_character() {
    assert_eq!(excerpt("21,5 °C".as_bytes()), "21,5 °C");
    let long = "é".repeat(500);
    assert_eq!(excerpt(long.as_bytes()), "é".repeat(EXCERPT) + "…");
}

#[test]
fn what_would_clear_a_screen_or_break_a_line_is_told_as_its_number() {
    let bad = FileError::BadCell {
        place: place(),
        column: "a\u{7}".into(),
        found: excerpt(b"\x1b[2J1\n2\xe2\x80\xae\xc2\xb0C"),
        fault: CellFault::NoNumber,
    };
    let reported = bad.to_string();
    assert!(
        reported.starts_with(
            "run.csv:12: column `a\\u{7}`: expected a number, found `\\u{1b}[2J1\\n2\\u{202e}°C`; leave the cell empty"
        ),
        "{reported}"
    );
    let excerpt = excerpt("x\n".repeat(500).as_bytes());
    assert!(excerpt.len() < 200, "{excerpt}");
}

#[test]
fn a_log_without_its_header_is_told_to_have_lost_it() {
    let missing = FileError::MissingColumns {
        place: place(),
        missing: vec![MissingColumn {
            name: "time_s".to_owned(),
            nearest: None,
        }],
        found: ["2026-03-01T00:00:00Z", "21.5", "", "-0.3"]
            .map(str::to_owned)
            .to_vec(),
        note: "",
    };
    assert_eq!(
        missing.to_string(),
        "run.csv:12: there is no column `time_s`; found `2026-03-01T00:00:00Z`, `21.5`, ``, `-0.3`; these are values: give the log with the line that names its columns, with which `tail -n +1 -f` begins"
    );
}
