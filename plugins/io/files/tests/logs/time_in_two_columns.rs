//! Date and time in two columns, as controllers log them, and put together by a template. Decides nothing about how dates are written.

use athermal_files::{
    ChannelColumn, Event, FileError, Flush, Layout, Options, Reader, Recording, Row, TimeColumn,
    TimeForm, Writer,
};

/// 2026-03-01T08:00:00Z: 20,513 days and eight hours after 1970-01-01.
const EIGHT: i64 = (20_513 * 24 + 8) * 3_600_000_000_000;
const SECOND: i64 = 1_000_000_000;

fn time(columns: &str, form: TimeForm) -> TimeColumn {
    let columns = columns.parse().unwrap();
    TimeColumn {
        columns,
        form,
        zone: None,
    }
}

fn german() -> TimeColumn {
    let format = "%d.%m.%Y %H:%M:%S%.f".parse().unwrap();
    time("{Date} {Time}", TimeForm::Format(format))
}

fn layout(time: TimeColumn) -> Layout {
    let channels = ["T1", "T2"].map(|column| ChannelColumn {
        column: column.to_owned(),
        optional: false,
        is_instant: false,
    });
    let channels = channels.into();
    Layout {
        time,
        channels,
        ..Layout::new("", TimeForm::SECONDS, [""; 0])
    }
}

fn reader(time: TimeColumn, text: &str, lenient: bool) -> Result<Reader, FileError> {
    let options = Options {
        lenient,
        ..Options::default()
    };
    let text = std::io::Cursor::new(text.to_owned());
    Reader::from_read("plc.csv", text, layout(time), options)
}

fn rows(reader: &mut Reader) -> Result<Vec<Row>, FileError> {
    let mut rows = Vec::new();
    let mut row = Row::default();
    while reader.next_into(&mut row)? {
        rows.push(row.clone());
    }
    Ok(rows)
}

fn row(after_eight_ns: i64, text: &str, values: [f64; 2]) -> Row {
    Row {
        time_ns: EIGHT + after_eight_ns,
        time_text: text.to_owned(),
        values: values.to_vec(),
        begins_segment: false,
    }
}

fn error(text: &str) -> String {
    let read = reader(german(), text, false).and_then(|mut reader| rows(&mut reader));
    read.err().unwrap().to_string()
}

#[test]
fn cells_are_put_together_wherever_they_stand() {
    let expected = [
        row(10 * SECOND, "01.03.2026 08:00:10", [20.5, 21.0]),
        row(20 * SECOND, "01.03.2026 08:00:20", [20.25, 22.0]),
    ];
    for text in [
        "Date;Time;T1;T2\n01.03.2026;08:00:10;20,5;21\n01.03.2026;08:00:20;20,25;22\n",
        "Time,T2,T1,Date\n08:00:10,21,20.5,01.03.2026\n08:00:20,22,20.25,01.03.2026\n",
        // Lines above the names, units below them, spaces and quotes around cells, a mark of comments before the names.
        "Export;01.03.2026\nDate;of the export\n\nDate;Time;T1;T2\n01.03.2026;08:00:10;20,5;21\n01.03.2026;08:00:20;20,25;22\n",
        "Date;Time;T1;T2\nDD.MM.YYYY;hh:mm:ss;°C;°C\n01.03.2026 ; \"08:00:10\";20,5;21\n01.03.2026; 08:00:20 ;20,25;22\n",
        "# Date;Time;T1;T2\n01.03.2026;08:00:10;20,5;21\n01.03.2026;08:00:20;20,25;22\n",
        // Names within the rows, in another order.
        "Date;Time;T1;T2\n01.03.2026;08:00:10;20,5;21\nT2;x;Time;T1;Date\n22;9;08:00:20;20,25;01.03.2026\n",
    ] {
        let mut reader = reader(german(), text, false).unwrap();
        assert_eq!(rows(&mut reader).unwrap(), expected, "{text}");
    }
}

#[test]
fn a_decimal_comma_of_a_time_is_none_of_its_date() {
    let text = "Date;Time;T1;T2\n01.03.2026;08:00:10,5;1;2\n";
    let read = rows(&mut reader(german(), text, false).unwrap()).unwrap();
    let expected = row(10_500_000_000, "01.03.2026 08:00:10.5", [1.0, 2.0]);
    assert_eq!(read, [expected]);
}

#[test]
fn what_stands_around_the_cells_makes_dates_of_other_standards() {
    let text = "Date,Time,T1,T2\n2026-03-01,08:00:10,1,2\n";
    let time = time("{Date}T{Time}Z", TimeForm::Rfc3339);
    let mut reader = reader(time, text, false).unwrap();
    let expected = row(10 * SECOND, "2026-03-01T08:00:10Z", [1.0, 2.0]);
    assert_eq!(rows(&mut reader).unwrap(), [expected]);
    assert!(reader.report().without_zone.is_none());
}

#[test]
fn keys_of_objects_are_put_together_too() {
    let first = "{\"Date\":\"01.03.2026\",\"Time\":\"08:00:10\",\"T1\":1,\"T2\":2}\n";
    let second = "{\"T1\":3,\"Time\":\" 08:00:20\",\"Date\":\"01.03.2026\"}\n";
    let read = rows(&mut reader(german(), &[first, second].concat(), false).unwrap()).unwrap();
    assert_eq!(read[0], row(10 * SECOND, "01.03.2026 08:00:10", [1.0, 2.0]));
    assert_eq!(read[1].time_ns, EIGHT + 20 * SECOND);
    assert!(read[1].values[1].is_nan());
    let without_date = "{\"Time\":\"08:00:30\",\"T1\":1,\"T2\":2}\n";
    assert!(error(&[first, without_date].concat()).contains("found nothing"));
    assert_eq!(
        error(without_date),
        "plc.csv:1: there is no column `Date`; found `Time`, `T1`, `T2`; correct the name, or make it optional if it is a channel"
    );
}

#[test]
fn a_row_that_lacks_one_of_the_cells_has_no_time() {
    let text = "Date;Time;T1;T2\n01.03.2026;08:00:10;1;2\n;08:00:20;1;2\n01.03.2026; ;1;2\n01.03.2026;08:00:30;1;2\n";
    assert_eq!(
        error(text),
        "plc.csv:3: column `{Date} {Time}`: expected a date and time as `%d.%m.%Y %H:%M:%S%.f` says, found nothing; correct the time \
         or how it is to be read, or read leniently (`--lenient`) to leave the row out"
    );
    let mut reader = reader(german(), text, true).unwrap();
    assert_eq!(rows(&mut reader).unwrap().len(), 2);
    assert_eq!(reader.report().refused_rows.count, 2);
}

#[test]
fn a_time_that_cannot_be_read_is_quoted_as_it_was_put_together() {
    assert_eq!(
        error("Date;Time;T1;T2\n1 March;08:00:10;1;2\n"),
        "plc.csv:2: column `{Date} {Time}`: expected a date and time as `%d.%m.%Y %H:%M:%S%.f` says, found `1 March 08:00:10`; correct \
         the time or how it is to be read, or read leniently (`--lenient`) to leave the row out"
    );
    let text = "Date;Time;T1;T2\n01.03.2026;08:00:10;1;2\n01.03.2026;08:00:05;1;2\n";
    let mut reader = reader(german(), text, false).unwrap();
    rows(&mut reader).unwrap();
    assert_eq!(
        reader
            .report()
            .refused_time
            .first
            .as_ref()
            .unwrap()
            .to_string(),
        "plc.csv:3: the time `01.03.2026 08:00:05` is not after `01.03.2026 08:00:10`; the row was left out"
    );
}

#[test]
fn each_column_that_lacks_is_named() {
    assert_eq!(
        error("Datum;Uhrzeit;T1;T2\n01.03.2026;08:00:10;1;2\n"),
        "plc.csv:1: there are no columns `Date`, `Time`; found `Datum`, `Uhrzeit`, `T1`, `T2`; did you mean `Datum` for `Date`? otherwise \
         correct the names, or make optional those that are channels"
    );
    let lost =
        "Date;Time;T1;T2\n01.03.2026;08:00:10;1;2\nDate;Zeit;T1;T2\n01.03.2026;08:00:20;1;2\n";
    assert!(error(lost).starts_with("plc.csv:3: there is no column `Time`"));
}

#[test]
fn files_are_joined_by_their_dates() {
    let folder = std::env::temp_dir().join(format!("athermal-two-columns-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |day: u32| {
        let path = folder.join(format!("{day}.csv"));
        let text = format!("Date;Time;T1;T2\n0{day}.03.2026;08:00:00;{day};0\n");
        std::fs::write(&path, text).unwrap();
        path
    };
    let paths = [file(2), file(1)];
    let mut recording = Recording::join(paths, layout(german()), Options::default()).unwrap();
    let mut row = Row::default();
    for day in [1.0, 2.0] {
        assert_eq!(recording.next_into(&mut row).unwrap(), Event::Row);
        assert_eq!(row.values[0], day);
    }
    assert_eq!(recording.next_into(&mut row).unwrap(), Event::End);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn an_output_has_the_whole_time_in_one_column_and_is_gone_on_with_by_that() {
    let folder = std::env::temp_dir().join(format!("athermal-one-column-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let columns = ["drift".to_owned()];
    for (name, written) in [
        (
            "out.csv",
            "Date Time,drift\n01.03.2026 08:00:10,1.0\n01.03.2026 08:00:20,2.0\n",
        ),
        (
            "out.jsonl",
            "{\"Date Time\":\"01.03.2026 08:00:10\",\"drift\":1.0}\n{\"Date Time\":\"01.03.2026 08:00:20\",\"drift\":2.0}\n",
        ),
    ] {
        let path = folder.join(name);
        let write = |seconds: &[i64]| {
            let mut writer =
                Writer::resume(&path, &german(), &columns, None, Flush::Buffered).unwrap();
            for second in seconds {
                let text = format!("01.03.2026 08:00:{second}");
                let value = *second as f64 / 10.0;
                writer
                    .write_row(&text, EIGHT + second * SECOND, &[value])
                    .unwrap();
            }
            writer.finish().unwrap();
        };
        write(&[10]);
        // What stands there already is passed over.
        write(&[10, 20]);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), written);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
