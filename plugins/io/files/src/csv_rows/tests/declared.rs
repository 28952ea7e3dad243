//! What `[table]` declares is read as declared, or refused.

use athermal_core::document::{Arrangement, DecimalMark, Encoding};

use super::*;

fn of(change: impl FnOnce(&mut TableFormat)) -> TableFormat {
    let mut table = TableFormat::default();
    change(&mut table);
    table
}

#[test]
fn names_and_units_are_read_from_the_rows_that_are_declared() {
    let toa5 = of(|table| (table.skip, table.units) = (Some(1), Some(3)));
    let text = "TOA5,logger,9\nt,a,b\n,Smp,Avg\nTS,degC,um\n0,1,2.5\n1,3,\n";
    assert_eq!(declared_read(toa5, text), TWO_ROWS);
    let third = of(|table| (table.skip, table.names, table.units) = (Some(0), Some(3), Some(0)));
    let text = "t,a,b\n\nnot,these,names\nt,b,a\n0,2.5,1\n1,,3\n";
    assert_eq!(declared_read(third, text), TWO_ROWS);
    let above = of(|table| table.skip = Some(2));
    assert_eq!(
        declared_read(above.clone(), "t,a,b\n0,1,2\n7,8,9\n"),
        "f.csv:3: there are no columns `t`, `a`, `b`; found `7`, `8`, `9` in the row that `[table]` declares for them; these are \
         values: give the log with the line that names its columns, with which `tail -n +1 -f` begins"
    );
    assert_eq!(
        declared_read(above, "t,a,b\n0,1,2\n"),
        "f.csv:2: the last line stands here, other than `skip` in `[table]` declares; correct `skip`, or leave it out so that it is \
         found"
    );
    let units = of(|table| table.units = Some(2));
    assert_eq!(
        declared_read(units, "t,a,b\n0,1,2\n"),
        "f.csv:2: `0` stands here, other than `units` in `[table]` declares; correct `units`, or leave it out so that it is found"
    );
    let none = of(|table| table.units = Some(0));
    assert!(
        declared_read(none, "t,a,b\ns,nm,nm\n0,1,2\n")
            .contains("expected a decimal number, found `s`")
    );
}

#[test]
fn a_declared_decimal_mark_is_the_only_one() {
    let comma = || of(|table| table.decimal = Some(DecimalMark::Comma));
    assert_eq!(declared_read(comma(), "t;a;b\n0;1;2,5\n1;3;\n"), TWO_ROWS);
    let quoted = "t,a,b\n0,\"1,0\",\"2,5\"\n1,3,\n";
    assert_eq!(declared_read(comma(), quoted), TWO_ROWS);
    assert_eq!(
        declared_read(comma(), "t;a;b\n0;1;2.5\n"),
        "f.csv:2: column `b`: expected a number with the decimal mark `,`, as `[table]` declares, found `2.5`; write all numbers of a \
         file with one mark, or read leniently (`--lenient`) to leave out those with another"
    );
    let point = of(|table| table.decimal = Some(DecimalMark::Point));
    assert!(declared_read(point, "t;a;b\n0;1;2,5\n").contains("expected a number, found `2,5`"));
}

#[test]
fn a_declared_encoding_is_the_only_one() {
    let read = |encoding, bytes: Vec<u8>| {
        let mut layout = Layout::new("t", TimeForm::SECONDS, ["W\u{e4}rme"]);
        layout.table.base.encoding = Some(encoding);
        let mut row = Row::default();
        let bytes = std::io::Cursor::new(bytes);
        let mut reader = Reader::from_read("f.csv", bytes, layout, Options::default())?;
        reader.next_into(&mut row)?;
        Ok::<_, FileError>(row.values[0])
    };
    let text = "t;W\u{e4}rme\n0;21,5\n";
    let cp1252: Vec<u8> = text.chars().map(|c| u32::from(c) as u8).collect();
    let wide = |order: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(order).collect();
    for (encoding, bytes) in [
        (Encoding::Utf8, text.as_bytes().to_vec()),
        (Encoding::Windows1252, cp1252.clone()),
        (Encoding::Utf16Le, wide(u16::to_le_bytes)),
        (Encoding::Utf16Be, wide(u16::to_be_bytes)),
    ] {
        assert_eq!(read(encoding, bytes).unwrap(), 21.5, "{encoding:?}");
    }
    let refused = read(Encoding::Utf8, cp1252).err().unwrap().to_string();
    assert!(
        refused.starts_with("f.csv:1: these names are not in UTF-8"),
        "{refused}"
    );
}

#[test]
fn a_change_of_a_column_begins_a_segment_whose_times_may_start_again() {
    let table = || of(|table| table.segment = Some("day".to_owned()));
    let text = "t,day,a,b\n0,1,1,\n10,1,2,\n10,2,3,\n5,2,4,\n12,,5,\n0,1,6,\n";
    assert_eq!(
        declared_read(table(), text),
        "0 [1.0, NaN]; 10 [2.0, NaN]; | 10 [3.0, NaN]; 12 [5.0, NaN]; | 0 [6.0, NaN]"
    );
    // One that leaps at the end of a segment is no wrong time of the next.
    let text = "t,day,a,b\n0,1,1,\n10,1,2,\n40000,1,3,\n0,2,4,\n";
    assert!(declared_read(table(), text).ends_with("40000 [3.0, NaN]; | 0 [4.0, NaN]"));
    let lacks = declared_read(table(), "t,a,b\n0,1,2\n");
    assert!(
        lacks.starts_with("f.csv:1: there is no column `day`"),
        "{lacks}"
    );
}

#[test]
fn a_long_layout_is_read_in_order_of_time_and_refused_in_any_other() {
    let table = || {
        of(|table| {
            table.layout = Arrangement::Long;
            (table.name, table.value) = (Some("tag".to_owned()), Some("val".to_owned()));
        })
    };
    let text = "t;tag;val\n0;a;1\n0;x;9\n0;b;2,5\n1;a;3\n1;x;9\n";
    assert_eq!(declared_read(table(), text), TWO_ROWS);
    assert_eq!(
        declared_read(table(), "t,tag,val\n0,a,1\n10,a,2\n0,b,3\n"),
        "f.csv:4: the time `0` is before `10`; a long layout is read in order of time: sort the rows by their time"
    );
    let never = declared_read(table(), "t,tag,val\n0,a,1\n10,c,2\n");
    assert!(
        never.starts_with("f.csv:3: there is no column `b`; found `a`, `c` in the column that `[table]` declares for names"),
        "{never}"
    );
    let json = "{\"t\":0,\"tag\":\"a\",\"val\":1}\n{\"t\":0,\"tag\":\"b\",\"val\":2.5}\n{\"t\":1,\"tag\":\"a\",\"val\":3}\n";
    assert_eq!(declared_read(table(), json), TWO_ROWS);
}

#[test]
fn a_table_that_is_declared_lenient_needs_no_option() {
    let lenient = of(|table| table.lenient = true);
    assert_eq!(
        declared_read(lenient, "t,a,b\n0,1,2.5\n5\n1,3,off\n"),
        TWO_ROWS
    );
}

#[test]
fn some_of_several_files_have_a_layout_of_their_own() {
    let mut layout = Layout::new("t", TimeForm::SECONDS, ["a"]);
    let skip = of(|table| table.skip = Some(1));
    layout.table.files = vec![(Pattern::new("temp*.csv"), skip)];
    for (name, text) in [("temp-1.csv", "t,a\nt,a\n0,1\n"), ("z.csv", "t,a\n0,1\n")] {
        let text = std::io::Cursor::new(text);
        let mut reader = Reader::from_read(name, text, layout.clone(), Options::default()).unwrap();
        assert!(reader.next_into(&mut Row::default()).unwrap());
        assert_eq!(reader.report().headers.count, 0, "{name}");
    }
}
