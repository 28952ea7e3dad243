//! Dates and times by a clock on the wall, through the nights in which that is set.

use athermal_files::{FileError, Layout, Options, Reader, Row, TimeColumn, TimeForm};

/// 2026-10-24T22:00:00Z, midnight of summer time in Berlin; at 01:00Z the clocks go back from three to two.
const MIDNIGHT_S: i64 = 1_792_879_200;
const STEP_S: i64 = 600;

fn reader(text: String, lenient: bool) -> Reader {
    let mut layout = Layout::new("Zeit", TimeForm::Rfc3339, ["T"]);
    layout.time = TimeColumn {
        form: TimeForm::Format("%d.%m.%Y %H:%M:%S".parse().unwrap()),
        zone: Some("Europe/Berlin".parse().unwrap()),
        ..layout.time
    };
    let options = Options {
        lenient,
        ..Options::default()
    };
    Reader::from_read("plc.csv", std::io::Cursor::new(text), layout, options).unwrap()
}

/// The seconds of each row.
fn seconds(reader: &mut Reader) -> Result<Vec<i64>, FileError> {
    let (mut row, mut seconds) = (Row::default(), Vec::new());
    while reader.next_into(&mut row)? {
        seconds.push(row.time_ns / 1_000_000_000);
    }
    Ok(seconds)
}

/// A row of the day at this time since midnight, as the clock shows it.
fn cell(day: &str, since_s: i64) -> String {
    let (minutes, seconds) = (since_s / 60, since_s % 60);
    format!("{day} {:02}:{:02}:{seconds:02}", minutes / 60, minutes % 60)
}

#[test]
fn no_row_of_the_night_in_which_clocks_go_back_is_lost() {
    let shown = (0..5 * 3600).step_by(STEP_S as usize).map(|since: i64| {
        let back = if since >= 3 * 3600 { 3600 } else { 0 };
        cell("25.10.2026", since - back)
    });
    let text: String = shown.map(|time| format!("{time};20.5\n")).collect();
    let mut reader = reader(format!("Zeit;T\n{text}"), false);
    let wanted: Vec<i64> = (0..30).map(|row| MIDNIGHT_S + row * STEP_S).collect();
    assert_eq!(seconds(&mut reader).unwrap(), wanted);
    assert!(reader.report().without_zone.is_none());
    assert_eq!(reader.report().refused_time.count, 0);
}

#[test]
fn a_time_over_which_the_clock_is_set_forward_is_refused_with_what_it_may_be() {
    let text = "Zeit;T\n29.03.2026 01:59:50;1\n29.03.2026 02:00:00;2\n29.03.2026 03:00:10;3\n";
    let refused = seconds(&mut reader(text.to_owned(), false)).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "plc.csv:3: column `Zeit`: `29.03.2026 02:00:00` is no time in Europe/Berlin: the clocks are set forward over it; a logger \
         whose clock is not set forward has `zone = \"+01:00\"` in `[time]`, or read leniently (`--lenient`) to leave the row out"
    );
    let mut lenient = reader(text.to_owned(), true);
    let read = seconds(&mut lenient).unwrap();
    assert_eq!(read[1] - read[0], 20);
    assert_eq!(lenient.report().refused_rows.count, 1);
}
