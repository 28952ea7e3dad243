//! Tables that were damaged, or whose rows stand in stretches: what is read is what was written, or what is left out is reported.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use athermal_core::document::Arrangement;
use athermal_files::{Layout, Options, Reader, Row, TimeForm};
use proptest::prelude::*;

/// Many more cases where there is time for them.
pub(super) fn cases() -> ProptestConfig {
    let long = std::env::var_os("ATHERMAL_LONG").is_some();
    ProptestConfig::with_cases(if long { 100_000 } else { 300 })
}

/// What becomes of a line.
#[derive(Debug, Clone)]
pub(super) enum Damage {
    /// It ends behind so many bytes.
    Cut(usize),
    /// Behind it stands a text.
    Note,
    /// It stands there twice.
    Twice,
    /// It is gone.
    Gone,
    /// Bytes of no meaning stand in its place.
    Noise(Vec<u8>),
}

pub(super) fn damages() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (0..20_usize).prop_map(Damage::Cut),
        Just(Damage::Note),
        Just(Damage::Twice),
        Just(Damage::Gone),
        prop::collection::vec(any::<u8>(), 0..20).prop_map(Damage::Noise),
    ]
}

fn layout(form: TimeForm) -> Layout {
    Layout::new("t", form, ["a", "b"])
}

/// All rows by their time, with how many things the report says were left out or taken as missing.
fn read(mut reader: Reader) -> (BTreeMap<i64, Vec<f64>>, u64) {
    let (mut row, mut rows) = (Row::default(), BTreeMap::new());
    while let Ok(true) = reader.next_into(&mut row) {
        rows.insert(row.time_ns, row.values.clone());
    }
    let report = reader.report();
    let counts = [
        &report.bad_cells,
        &report.refused_rows,
        &report.refused_time,
        &report.repeated_time,
        &report.short_rows,
        &report.notes,
        &report.headers,
        &report.headers_moved,
    ];
    let cut = u64::from(report.truncated.is_some());
    (rows, counts.iter().map(|of| of.count).sum::<u64>() + cut)
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_damaged_table_gives_what_was_written_or_reports_what_it_left_out(
        damaged in prop::collection::btree_map(0..30_usize, damages(), 0..4),
        form in 0..4_usize, separator in 0..2_usize,
    ) {
        let separator = [',', ';'][separator];
        let (unit, write): (TimeForm, fn(usize) -> String) = match form {
            0 => (TimeForm::SECONDS, |nth| format!("{}", 60 * nth)),
            1 => (TimeForm::Elapsed, |nth| format!("{}:{:02}:00", nth, 0)),
            2 => (TimeForm::Rfc3339, |nth| format!("2026-03-02 {:02}:{:02}:00 UTC", nth / 60, nth % 60)),
            _ => (
                TimeForm::Since { ns_per_unit: 100, origin_ns: 11_644_473_600_000_000_000 },
                |nth| format!("{}", 134_168_832_000_000_000_u64 + 600_000_000 * nth as u64),
            ),
        };
        let values = |nth: usize| [nth as f64 + 0.5, 100.0 + nth as f64];
        let mut text = format!("t{separator}a{separator}b\n").into_bytes();
        for nth in 0..30 {
            let [a, b] = values(nth);
            let line = format!("{}{separator}{a}{separator}{b}", write(nth)).into_bytes();
            match damaged.get(&nth) {
                None => text.extend(&line),
                // A number that lacks digits is another number: lines are cut between cells.
                Some(Damage::Cut(at)) => {
                    let cut = line.iter().take(*at).rposition(|byte| *byte == separator as u8);
                    text.extend(&line[..cut.unwrap_or(0)]);
                }
                Some(Damage::Note) => text.extend([&line[..], &[separator as u8], b"door"].concat()),
                Some(Damage::Twice) => text.extend([&line[..], b"\n", &line[..]].concat()),
                Some(Damage::Gone) => continue,
                Some(Damage::Noise(bytes)) => text.extend(bytes.iter().filter(|byte| !byte.is_ascii_digit() && !b"\n\"+-.".contains(byte))),
            }
            text.push(b'\n');
        }
        let form = unit.clone();
        let options = Options { lenient: true, joins: true, ..Options::default() };
        let reader = Reader::from_read("hostile.csv", Cursor::new(text), layout(unit), options);
        let Ok(reader) = reader else { return Ok(()) };
        let (rows, reported) = read(reader);
        let mut lost = 0;
        for nth in 0..30 {
            let is_gone = matches!(damaged.get(&nth), Some(Damage::Gone));
            let at = form.read(write(nth).as_bytes()).unwrap();
            let Some(read) = rows.get(&at) else {
                let is_blank = matches!(damaged.get(&nth), Some(Damage::Cut(_) | Damage::Noise(_)));
                lost += u64::from(!is_gone && !is_blank);
                continue;
            };
            for (read, written) in read.iter().zip(values(nth)) {
                prop_assert!(read.is_nan() || *read == written, "{} at {}", read, nth);
                lost += u64::from(read.is_nan());
            }
        }
        prop_assert!(lost == 0 || reported > 0, "{} lost, and nothing reported", lost);
    }

    #[test]
    fn stretches_of_a_long_table_are_merged_as_if_they_were_sorted(
        runs in prop::collection::vec((0..3_usize, prop::collection::btree_set(0..50_u32, 1..20)), 1..8),
        quoted in any::<bool>(), whole in any::<bool>(),
    ) {
        let names = ["a", "b", "x"];
        let mut lines: Vec<(u32, String)> = Vec::new();
        for (nth, (name, times)) in runs.iter().enumerate() {
            for time in times {
                let name = if quoted { format!("\"{}\"", names[*name]) } else { names[*name].to_owned() };
                lines.push((*time, format!("{time},{name},{}.5", 100 * nth as u32 + time)));
            }
        }
        // Rows of one time and name contradict each other; of these the first counts.
        let text = |lines: &[(u32, String)]| {
            let lines: Vec<&str> = lines.iter().map(|(_, line)| line.as_str()).collect();
            format!("t,n,v\n{}{}", lines.join("\n"), if whole { "\n" } else { "" })
        };
        let mut sorted = lines.clone();
        sorted.sort_by_key(|(time, _)| *time);
        let mut layout = layout(TimeForm::SECONDS);
        layout.channels.iter_mut().for_each(|channel| channel.optional = true);
        layout.table.base.layout = Arrangement::Long;
        layout.table.base.name = Some("n".to_owned());
        layout.table.base.value = Some("v".to_owned());
        let ordered = Reader::from_read("s.csv", Cursor::new(text(&sorted) + "\n"), layout.clone(), Options::default());
        let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("runs-{:?}.csv", std::thread::current().id()));
        std::fs::write(&file, text(&lines) + "\n").unwrap();
        let merged = Reader::open(&file, layout, Options::default());
        let (ordered, _) = read(ordered.unwrap());
        let (merged, _) = read(merged.unwrap());
        let bits = |rows: BTreeMap<i64, Vec<f64>>| {
            let rows = rows.into_iter();
            rows.map(|(at, values)| (at, values.iter().map(|value| value.to_bits()).collect::<Vec<_>>())).collect::<Vec<_>>()
        };
        prop_assert_eq!(bits(merged), bits(ordered));
    }
}
