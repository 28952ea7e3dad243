//! Recordings in Parquet and Arrow beside the same recordings as text.

#![allow(clippy::unwrap_used)]

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::types::Int32Type;
use arrow_array::{
    ArrayRef, BooleanArray, Date32Array, Decimal128Array, DictionaryArray, Float32Array,
    Float64Array, Int64Array, ListArray, RecordBatch, StringArray, TimestampMicrosecondArray,
    TimestampMillisecondArray, UInt8Array,
};
use arrow_ipc::writer::{FileWriter, StreamWriter};
use athermal_arrow as _;
use athermal_files::{
    Bound, Description, FileError, Flush, Format, Layout, Options, Reader, Row, Stretch, TimeForm,
    Writer,
};
use parquet::arrow::ArrowWriter;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use proptest::prelude::*;

/// A folder of a test's own, which goes with it.
struct Folder(PathBuf);

impl Folder {
    fn of(test: &str) -> Self {
        let path =
            std::env::temp_dir().join(format!("athermal-arrow-{}-{test}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn batch(columns: &[(&str, ArrayRef)]) -> RecordBatch {
    RecordBatch::try_from_iter_with_nullable(
        columns
            .iter()
            .map(|(name, array)| (*name, array.clone(), true)),
    )
    .unwrap()
}

fn write_parquet(path: &Path, batch: &RecordBatch) {
    let rows = WriterProperties::builder()
        .set_max_row_group_row_count(Some(3))
        .build();
    let mut writer =
        ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), Some(rows)).unwrap();
    writer.write(batch).unwrap();
    writer.close().unwrap();
}

fn rows_of(path: &Path, layout: Layout, options: Options) -> Result<Vec<Row>, FileError> {
    let mut reader = Reader::open(path, layout, options)?;
    let (mut rows, mut row) = (Vec::new(), Row::default());
    while reader.next_into(&mut row)? {
        rows.push(row.clone());
    }
    Ok(rows)
}

fn read(path: &Path, layout: Layout) -> Vec<Row> {
    rows_of(path, layout, Options::default()).unwrap()
}

fn bits(rows: &[Row]) -> Vec<(i64, Vec<u64>)> {
    let values = |row: &Row| row.values.iter().map(|value| value.to_bits()).collect();
    rows.iter().map(|row| (row.time_ns, values(row))).collect()
}

fn seconds(columns: &[&str]) -> Layout {
    Layout::new("time_s", TimeForm::SECONDS, columns.to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_is_written_as_parquet_and_as_csv_reads_back_to_the_same_bits(
        start in prop_oneof![Just(0_i64), Just(1_772_409_600_000_000_000)],
        table in prop::collection::vec((1..5_000_000_000_i64, prop::array::uniform3(
            prop_oneof![3 => prop::num::f64::NORMAL, 1 => Just(f64::NAN), 1 => -50.0..50.0_f64])), 0..200),
        nth in 0..u32::MAX,
    ) {
        let folder = Folder::of(&format!("same-{nth}"));
        let names: Vec<String> = ["a", "b", "c"].map(str::to_owned).to_vec();
        let [csv, parquet] = ["of.csv", "of.parquet"].map(|name| {
            let path = folder.file(name);
            let mut writer = Writer::create(&path, "time_s", &names, Flush::Buffered).unwrap();
            let mut at = start;
            for (step, values) in &table {
                at += step;
                writer.write_row("", at, values).unwrap();
            }
            writer.finish().unwrap();
            read(&path, seconds(&["c", "a"]))
        });
        prop_assert_eq!(bits(&csv), bits(&parquet));
        prop_assert_eq!(csv.len(), table.len());
    }

    #[test]
    fn a_damaged_file_is_refused_or_ends_with_a_reason_and_never_panics(
        at in 0..4000_usize, with in 1..=255_u8, length in prop::option::of(0..4000_usize), nth in 0..u32::MAX,
    ) {
        let folder = Folder::of(&format!("damaged-{nth}"));
        let path = folder.file("of.parquet");
        let numbers = || Arc::new(Float64Array::from_iter_values((0..40).map(f64::from))) as ArrayRef;
        write_parquet(&path, &batch(&[("time_s", numbers()), ("a", numbers())]));
        let mut bytes = std::fs::read(&path).unwrap();
        bytes.truncate(length.unwrap_or(usize::MAX));
        let end = bytes.len();
        if let Some(byte) = bytes.get_mut(at % end.max(1)) {
            *byte ^= with;
        }
        std::fs::write(&path, bytes).unwrap();
        if let Err(error) = rows_of(&path, seconds(&["a"]), Options::default()) {
            prop_assert!(error.to_string().contains("of.parquet"), "{error}");
        }
    }
}

#[test]
fn columns_of_any_type_of_number_give_what_their_texts_give() {
    let folder = Folder::of("types");
    let path = folder.file("of.parquet");
    let words =
        DictionaryArray::<Int32Type>::from_iter([Some("1.5"), None, Some("-2e3"), Some("1.5")]);
    let decimals = Decimal128Array::from(vec![
        Some(215_375),
        Some(-1),
        None,
        Some(i128::pow(10, 30) + 1),
    ]);
    let decimals = decimals.with_precision_and_scale(38, 3).unwrap();
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Int64Array::from(vec![0, 1, 2, 3]))),
        (
            "whole",
            Arc::new(Int64Array::from(vec![
                Some(i64::MAX),
                None,
                Some(-7),
                Some(0),
            ])),
        ),
        ("small", Arc::new(UInt8Array::from(vec![255, 0, 1, 2]))),
        (
            "single",
            Arc::new(Float32Array::from(vec![0.1, f32::NAN, 2.5, f32::INFINITY])),
        ),
        (
            "flag",
            Arc::new(BooleanArray::from(vec![
                Some(true),
                Some(false),
                None,
                Some(true),
            ])),
        ),
        (
            "text",
            Arc::new(StringArray::from(vec![
                Some("21.5"),
                Some(""),
                Some("NaN"),
                Some("true"),
            ])),
        ),
        ("words", Arc::new(words)),
        ("decimal", Arc::new(decimals)),
    ];
    write_parquet(&path, &batch(&columns));
    let names: Vec<&str> = columns[1..].iter().map(|(name, _)| *name).collect();
    let found = read(&path, seconds(&names));
    let nan = f64::NAN;
    let expected = [
        [
            i64::MAX as f64,
            255.0,
            f64::from(0.1_f32),
            1.0,
            21.5,
            1.5,
            215.375,
        ],
        [nan, 0.0, nan, 0.0, nan, nan, -0.001],
        [-7.0, 1.0, 2.5, nan, nan, -2000.0, nan],
        [0.0, 2.0, f64::INFINITY, 1.0, 1.0, 1.5, 1e27],
    ];
    for (row, expected) in found.iter().zip(expected) {
        for (value, expected) in row.values.iter().zip(expected) {
            assert!(
                *value == expected || value.is_nan() && expected.is_nan(),
                "{row:?}"
            );
        }
    }
    assert_eq!(found.len(), 4);
}

#[test]
fn instants_are_taken_as_they_are_whatever_their_unit_and_whatever_form_is_declared() {
    let folder = Folder::of("instants");
    let values: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.0]));
    let ms = vec![1_772_409_600_000, 1_772_409_600_250];
    let us = TimestampMicrosecondArray::from(ms.iter().map(|ms| ms * 1000).collect::<Vec<_>>());
    let expected = [1_772_409_600_000_000_000, 1_772_409_600_250_000_000];
    let stamps: [ArrayRef; 2] = [
        Arc::new(TimestampMillisecondArray::from(ms).with_timezone("Europe/Zurich")),
        Arc::new(us.with_timezone("UTC")),
    ];
    for (nth, stamps) in stamps.into_iter().enumerate() {
        let path = folder.file(&format!("{nth}.parquet"));
        write_parquet(&path, &batch(&[("at", stamps), ("x", values.clone())]));
        for form in [TimeForm::Rfc3339, TimeForm::SECONDS] {
            let rows = read(&path, Layout::new("at", form, ["x"]));
            let times: Vec<i64> = rows.iter().map(|row| row.time_ns).collect();
            assert_eq!(times, expected);
            assert_eq!(rows[1].time_text, "2026-03-02T00:00:00.25Z");
        }
    }
}

#[test]
fn instants_without_a_zone_go_by_that_of_the_graph_else_by_utc_and_that_is_reported() {
    let folder = Folder::of("naive");
    let path = folder.file("of.parquet");
    // The clock of Zurich goes from 02:00 to 03:00 on 29 March 2026.
    let at = |minutes: i64| (1_774_742_400 + 60 * minutes) * 1_000_000;
    let stamps = TimestampMicrosecondArray::from(vec![at(110), at(150), at(180)]);
    let values: ArrayRef = Arc::new(Float64Array::from(vec![1.0, 2.0, 3.0]));
    write_parquet(&path, &batch(&[("at", Arc::new(stamps)), ("x", values)]));
    let layout = Layout::new("at", TimeForm::Rfc3339, ["x"]);
    let mut reader = Reader::open(&path, layout.clone(), Options::default()).unwrap();
    let mut row = Row::default();
    assert!(reader.next_into(&mut row).unwrap());
    assert_eq!(row.time_text, "2026-03-29T01:50:00");
    assert!(reader.report().without_zone.is_some());
    let mut zoned = layout;
    zoned.time.zone = Some("Europe/Zurich".parse().unwrap());
    let error = rows_of(&path, zoned.clone(), Options::default()).unwrap_err();
    assert!(error.to_string().contains("of.parquet:2"), "{error}");
    let lenient = Options {
        lenient: true,
        ..Options::default()
    };
    let rows = rows_of(&path, zoned, lenient).unwrap();
    let times: Vec<i64> = rows
        .iter()
        .map(|row| row.time_ns / 60_000_000_000)
        .collect();
    assert_eq!(times, [1_774_742_400 / 60 + 50, 1_774_742_400 / 60 + 60]);
}

#[test]
fn a_text_that_is_no_number_is_refused_by_its_row_and_counted_where_that_is_asked_for() {
    let folder = Folder::of("no-number");
    let path = folder.file("of.parquet");
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Float64Array::from(vec![0.0, 1.0, 2.0]))),
        ("a", Arc::new(StringArray::from(vec!["1", "off", "3"]))),
    ];
    write_parquet(&path, &batch(&columns));
    let error = rows_of(&path, seconds(&["a"]), Options::default()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("of.parquet:2") && text.contains("`off`"),
        "{text}"
    );
    let lenient = Options {
        lenient: true,
        ..Options::default()
    };
    let rows = rows_of(&path, seconds(&["a"]), lenient.clone()).unwrap();
    assert!(rows[1].values[0].is_nan() && rows[2].values[0] == 3.0);
    // Of a row that is left out for its time no cell is counted.
    let columns: Vec<(&str, ArrayRef)> = vec![
        (
            "time_s",
            Arc::new(StringArray::from(vec!["0", "soon", "2"])),
        ),
        ("a", Arc::new(StringArray::from(vec!["1", "off", "off"]))),
    ];
    write_parquet(&path, &batch(&columns));
    let mut reader = Reader::open(&path, seconds(&["a"]), lenient).unwrap();
    while reader.next_into(&mut Row::default()).unwrap() {}
    let report = reader.report();
    assert_eq!((report.bad_cells.count, report.refused_rows.count), (1, 1));
}

#[test]
fn a_column_without_numbers_or_one_that_is_missing_is_named() {
    let folder = Folder::of("missing");
    let path = folder.file("of.parquet");
    let lists = ListArray::from_iter_primitive::<Int32Type, _, _>([Some([Some(1), Some(2)])]);
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Float64Array::from(vec![0.0]))),
        ("room_degC", Arc::new(Float64Array::from(vec![0.0]))),
        ("day", Arc::new(Date32Array::from(vec![1]))),
        ("list", Arc::new(lists)),
    ];
    write_parquet(&path, &batch(&columns));
    for (column, words) in [
        ("Room_degc", "did you mean `room_degC`"),
        ("day", "the column `day` has times"),
        ("list", "the column `list` has lists"),
    ] {
        let error = rows_of(&path, seconds(&[column]), Options::default()).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("of.parquet: ") && text.contains(words),
            "{text}"
        );
        // The request is wrong, and not the file or its disk.
        let is_of_request = |of: &FileError| {
            matches!(
                of,
                FileError::Unfit { .. } | FileError::MissingColumns { .. }
            )
        };
        assert!(is_of_request(&error), "{error:?}");
    }
}

#[test]
fn folders_named_as_keys_are_columns() {
    let folder = Folder::of("keys");
    let path = folder.file("line=4/machine=dt07/of.parquet");
    let numbers: ArrayRef = Arc::new(Float64Array::from(vec![0.0, 1.0]));
    write_parquet(
        &path,
        &batch(&[("time_s", numbers.clone()), ("a", numbers)]),
    );
    let rows = read(&path, seconds(&["line", "a"]));
    assert_eq!(rows[1].values, [4.0, 1.0]);
    let described = Description::of(&path, 1).unwrap();
    assert_eq!(described.columns, ["time_s", "a", "line", "machine"]);
    assert_eq!(described.rows, [["0.0", "0.0", "4", "dt07"]]);
}

#[test]
fn what_init_sees_of_a_file_are_names_and_texts() {
    let folder = Folder::of("described");
    let path = folder.file("without-ending");
    let stamps = TimestampMillisecondArray::from(vec![1_772_409_600_000, 1_772_409_600_250]);
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("at", Arc::new(stamps.with_timezone("UTC"))),
        ("x_nm", Arc::new(Float64Array::from(vec![Some(0.1), None]))),
    ];
    write_parquet(&path, &batch(&columns));
    let described = Description::of(&path, 10).unwrap();
    assert_eq!(described.format, Format::Typed);
    assert_eq!(
        described.rows,
        [
            ["2026-03-02T00:00:00Z", "0.1"],
            ["2026-03-02T00:00:00.25Z", ""]
        ]
    );
}

#[test]
fn files_and_streams_of_arrow_are_read_too() {
    let folder = Folder::of("ipc");
    let numbers: ArrayRef = Arc::new(Float64Array::from(vec![0.0, 1.0]));
    let batch = batch(&[("a", numbers.clone()), ("time_s", numbers)]);
    let file = folder.file("of.arrow");
    let mut writer = FileWriter::try_new(File::create(&file).unwrap(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    let stream = folder.file("of.arrows");
    let mut writer =
        StreamWriter::try_new(File::create(&stream).unwrap(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    for path in [file, stream] {
        assert_eq!(
            bits(&read(&path, seconds(&["a"]))),
            [(0, vec![0]), (1_000_000_000, vec![1.0_f64.to_bits()])]
        );
    }
}

#[test]
fn a_kind_that_is_only_read_and_a_file_that_cannot_be_added_to_are_refused_and_left_as_they_are() {
    let folder = Folder::of("refused");
    let columns = ["a".to_owned()];
    let time = seconds(&["a"]).time;
    let create = |path: &Path| Writer::create(path, "time_s", &columns, Flush::Buffered).err();
    let resume = |path: &Path| Writer::resume(path, &time, &columns, None, Flush::Buffered).err();
    let refused = |error: Option<FileError>, words: &str| {
        let error = error.unwrap();
        assert!(matches!(error, FileError::Unfit { .. }), "{error:?}");
        assert!(error.to_string().contains(words), "{error}");
    };
    let [arrow, parquet] = ["of.arrow", "of.parquet"].map(|name| folder.file(name));
    for there in [false, true] {
        if there {
            std::fs::write(&arrow, "what stands there").unwrap();
            std::fs::write(&parquet, "what stands there").unwrap();
        }
        refused(create(&arrow), "Arrow is read, but not written");
        refused(
            resume(&parquet),
            "nothing can be added to a file of Parquet",
        );
        refused(resume(&parquet), "leave out `--state`");
        for path in [&arrow, &parquet] {
            assert_eq!(path.exists(), there);
            assert!(!there || std::fs::read(path).unwrap() == b"what stands there");
        }
    }
}

#[test]
fn of_a_file_of_arrow_columns_may_be_read_in_any_order_and_beside_those_of_other_types() {
    let folder = Folder::of("projected");
    let lists = ListArray::from_iter_primitive::<Int32Type, _, _>([Some([Some(1)]), None]);
    let column = |first: f64| Arc::new(Float64Array::from(vec![first, first + 1.0])) as ArrayRef;
    let batch = batch(&[
        ("list", Arc::new(lists)),
        ("b", column(10.0)),
        ("time_s", column(0.0)),
        ("a", column(20.0)),
    ]);
    let path = folder.file("of.arrow");
    let mut writer = FileWriter::try_new(File::create(&path).unwrap(), &batch.schema()).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    let rows = read(&path, seconds(&["a", "b"]));
    assert_eq!(rows[1].values, [21.0, 11.0]);
    assert_eq!(rows[1].time_ns, 1_000_000_000);
}

#[test]
fn a_table_with_a_row_for_each_value_is_read_by_its_names() {
    let folder = Folder::of("long");
    let path = folder.file("of.parquet");
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("time_s", Arc::new(Float64Array::from(vec![0.0, 0.0, 1.0]))),
        ("id", Arc::new(StringArray::from(vec!["a", "b", "a"]))),
        (
            "value",
            Arc::new(Float64Array::from(vec![0.1, f64::INFINITY, 0.3])),
        ),
    ];
    write_parquet(&path, &batch(&columns));
    let mut layout = seconds(&["a", "b"]);
    layout.table.base.layout = athermal_core::document::Arrangement::Long;
    layout.table.base.name = Some("id".to_owned());
    layout.table.base.value = Some("value".to_owned());
    let rows = read(&path, layout);
    assert_eq!(rows[0].values, [0.1, f64::INFINITY]);
    assert!(rows[1].values[0] == 0.3 && rows[1].values[1].is_nan());
}

#[test]
fn groups_of_rows_outside_of_a_stretch_of_time_are_not_read() {
    let folder = Folder::of("within");
    let day = 86_400_000_i64;
    let instants = || (0..30).map(|nth| 20_000 * day + nth * day / 2);
    let rows = |zone: Option<&str>, within: Option<(i64, i64)>| {
        let path = folder.file("log.parquet");
        let time = TimestampMillisecondArray::from_iter_values(instants());
        let time = time.with_timezone_opt(zone);
        let values = Float64Array::from_iter_values((0..30).map(f64::from));
        write_parquet(
            &path,
            &batch(&[("t", Arc::new(time)), ("x", Arc::new(values))]),
        );
        let layout = Layout::new("t", TimeForm::Rfc3339, ["x"]);
        let options = Options {
            within,
            ..Options::default()
        };
        let rows = rows_of(&path, layout, options).unwrap();
        rows.iter().map(|row| row.values[0]).collect::<Vec<_>>()
    };
    let numbers = |from: u32, to: u32| (from..to).map(f64::from).collect::<Vec<_>>();
    let at = |nth: usize| instants().nth(nth).unwrap() * 1_000_000;
    // A group has three rows.
    assert_eq!(rows(Some("UTC"), None), numbers(0, 30));
    assert_eq!(rows(Some("UTC"), Some((at(10), at(12)))), numbers(9, 15));
    assert_eq!(
        rows(Some("UTC"), Some((at(0) - 5, at(0) - 1))),
        numbers(0, 0)
    );
    // Where it is not said where a clock stands, a day more is read on either side.
    assert_eq!(rows(None, Some((at(10), at(12)))), numbers(6, 15));
}

/// Writes over the values of the groups of rows that are not named, so that reading them fails.
fn spoil(path: &Path, but: &[usize]) {
    let reader = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let mut bytes = std::fs::read(path).unwrap();
    for (nth, group) in reader.metadata().row_groups().iter().enumerate() {
        for column in group.columns().iter().filter(|_| !but.contains(&nth)) {
            let (from, length) = column.byte_range();
            bytes[from as usize..(from + length) as usize].fill(0xff);
        }
    }
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn of_a_stretch_no_other_group_is_read_also_where_times_are_numbers_and_rows_are_counted_all_the_same()
 {
    let folder = Folder::of("stretch");
    let path = folder.file("log.parquet");
    let forms = [
        (TimeForm::SECONDS, 1.0, 0.0),
        (
            TimeForm::Numbers {
                ns_per_unit: 1_000_000,
            },
            1000.0,
            0.0,
        ),
        // Julian days.
        (
            TimeForm::Since {
                ns_per_unit: 86_400_000_000_000,
                origin_ns: 210_866_760_000_000_000_000,
            },
            1.0 / 86_400.0,
            2_440_587.5,
        ),
    ];
    for (form, of_second, origin) in forms {
        let time = |nth: u32| origin + f64::from(1_700_000_000 + 60 * nth) * of_second;
        let times = Float64Array::from_iter_values((0..30).map(time));
        let cells = (0..30).map(|nth| match nth {
            13 => "warm".to_owned(),
            nth => nth.to_string(),
        });
        let columns: [(&str, ArrayRef); 2] = [
            ("time_s", Arc::new(times)),
            ("x", Arc::new(StringArray::from_iter_values(cells))),
        ];
        write_parquet(&path, &batch(&columns));
        let bound = |nth: u32| Some(Bound::Text(format!("{:?}", time(nth))));
        let read = |from: u32, to: u32| {
            let options = Options {
                stretch: Stretch {
                    from: bound(from),
                    to: bound(to),
                },
                ..Options::default()
            };
            let rows = rows_of(&path, Layout::new("time_s", form.clone(), ["x"]), options);
            let values = |rows: Vec<Row>| rows.iter().map(|row| row.values[0]).collect::<Vec<_>>();
            rows.map(values).map_err(|error| error.to_string())
        };
        assert_eq!(read(7, 11).unwrap(), [7.0, 8.0, 9.0, 10.0], "{form:?}");
        // A group has three rows.
        spoil(&path, &[2, 3, 4]);
        assert_eq!(read(7, 11).unwrap(), [7.0, 8.0, 9.0, 10.0], "{form:?}");
        let wrong = read(7, 14).unwrap_err();
        assert!(
            wrong.contains("log.parquet:14: ") && wrong.contains("warm"),
            "{wrong}"
        );
        assert!(read(4, 11).is_err(), "the second group cannot be read");
    }
}
