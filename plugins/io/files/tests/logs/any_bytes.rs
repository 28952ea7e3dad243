//! Whatever bytes come, reading ends in rows or an error, and how they are cut into pieces changes nothing.

use std::io::{self, Read};

use athermal_files::{Format, Layout, Options, Reader, Row, TimeColumn, TimeForm};
use proptest::prelude::*;

/// Gives the bytes in pieces of the given lengths, over and over.
struct Pieces {
    bytes: Vec<u8>,
    at: usize,
    lengths: Vec<usize>,
    turn: usize,
}

impl Read for Pieces {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = self.lengths[self.turn % self.lengths.len()].min(buffer.len());
        self.turn += 1;
        let taken = (&self.bytes[self.at..]).read(&mut buffer[..length])?;
        self.at += taken;
        Ok(taken)
    }
}

/// Everything that reading gives, as text.
fn outcome(bytes: &[u8], lengths: Vec<usize>, time: &TimeColumn, options: &Options) -> String {
    let input = Pieces {
        bytes: bytes.to_vec(),
        at: 0,
        lengths,
        turn: 0,
    };
    let layout = Layout {
        time: time.clone(),
        ..Layout::new("", TimeForm::SECONDS, ["a", "b"])
    };
    let mut reader = match Reader::from_read("any", input, layout, options.clone()) {
        Ok(reader) => reader,
        Err(error) => return error.to_string(),
    };
    let mut row = Row::default();
    let mut told = String::new();
    loop {
        match reader.next_into(&mut row) {
            Ok(true) => told += &format!("{row:?}\n"),
            Ok(false) => return told + &format!("{:?}", reader.report()),
            Err(error) => return told + &error.to_string(),
        }
    }
}

fn times() -> impl Strategy<Value = TimeColumn> {
    let columns = prop_oneof![Just("t"), Just("{t} {a}"), Just("1{b}{t}")];
    let forms = prop_oneof![
        Just(TimeForm::SECONDS),
        Just(TimeForm::Rfc3339),
        Just(TimeForm::Format("%d.%m.%Y %H:%M".parse().unwrap())),
        any::<i64>().prop_map(|step_ns| TimeForm::Samples { step_ns }),
    ];
    let zones = prop_oneof![
        Just(None),
        Just(Some("Europe/Berlin")),
        Just(Some("-03:30"))
    ];
    (columns, forms, zones).prop_map(|(columns, form, zone)| TimeColumn {
        columns: columns.parse().unwrap(),
        form,
        zone: zone.map(|zone| zone.parse().unwrap()),
    })
}

fn options() -> impl Strategy<Value = Options> {
    let formats = prop_oneof![
        Just(None),
        Just(Some(Format::Csv)),
        Just(Some(Format::JsonLines))
    ];
    (formats, any::<[bool; 4]>()).prop_map(|(format, [lenient, joins, goes_on, segments])| {
        Options {
            format,
            lenient,
            joins,
            goes_on,
            segments,
            ..Options::default()
        }
    })
}

/// Bytes that look like a recording often enough to get past the header.
fn nearly_recordings() -> impl Strategy<Value = Vec<u8>> {
    let pieces = prop::collection::vec(
        prop_oneof![
            Just("\n"),
            Just("\r\n"),
            Just(","),
            Just(";"),
            Just("\""),
            Just("\\"),
            Just("0"),
            Just("1.5"),
            Just("1,5"),
            Just("9e99"),
            Just("-"),
            Just("NaN"),
            Just("#"),
            Just(" "),
            Just("null"),
            Just("{\"t\":"),
            Just("\"a\":"),
            Just("}\n"),
            Just("2013-07-04 00:00:00"),
            Just("°"),
            Just("\u{feff}"),
        ],
        0..60,
    );
    let starts = prop_oneof![
        Just("t,a,b\n"),
        Just("t;b;a\r\n"),
        Just("{\"t\":0,\"a\":1,\"b\":2}\n"),
        Just("")
    ];
    (starts, pieces).prop_map(|(start, pieces)| (start.to_owned() + &pieces.concat()).into_bytes())
}

proptest! {
    #[test]
    fn any_bytes_end_in_rows_or_an_error(
        bytes in prop::collection::vec(any::<u8>(), 0..300), time in times(), options in options(),
    ) {
        outcome(&bytes, vec![64], &time, &options);
        let with_header = [b"t,a,b\n", bytes.as_slice()].concat();
        outcome(&with_header, vec![64], &time, &options);
    }

    #[test]
    fn the_pieces_in_which_bytes_come_change_nothing(
        bytes in nearly_recordings(), time in times(), options in options(),
        lengths in prop::collection::vec(1..20_usize, 1..5),
    ) {
        let whole = outcome(&bytes, vec![usize::MAX], &time, &options);
        prop_assert_eq!(outcome(&bytes, lengths, &time, &options), whole);
    }

    #[test]
    fn every_double_survives_text(bits in any::<u64>()) {
        let number = f64::from_bits(bits);
        prop_assume!(!number.is_nan());
        let text = format!("t,a,b\n0,{number:?},{number}\n");
        let layout = Layout::new("t", TimeForm::SECONDS, ["a", "b"]);
        let mut reader = Reader::from_read("any", io::Cursor::new(text), layout, Options::default()).unwrap();
        let mut row = Row::default();
        prop_assert!(reader.next_into(&mut row).unwrap());
        prop_assert_eq!(row.values[0].to_bits(), bits);
        prop_assert_eq!(row.values[1].to_bits(), bits);
    }
}
