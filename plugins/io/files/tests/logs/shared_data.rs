//! The measured and simulated recordings beside the project are read whole.

use std::path::{Path, PathBuf};

use athermal_files::{Layout, Options, Reader, Report, Row, TimeForm};

/// The folder that has `data`, or `None` where this machine lacks it.
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared");
    let folder = std::env::var_os("ATHERMAL_SHARED").map_or(beside, PathBuf::from);
    if folder.join("data").is_dir() {
        return Some(folder.join("data"));
    }
    eprintln!("skipped: ATHERMAL_SHARED names no folder with data");
    None
}

/// Reads all columns and counts the values in each.
fn read(path: &Path, time: &str, form: TimeForm, columns: &[&str]) -> (Vec<usize>, Report) {
    let layout = Layout::new(time, form, columns.iter().copied());
    let mut reader = Reader::open(path, layout, Options::default()).unwrap();
    let mut row = Row::default();
    let mut present = vec![0; columns.len()];
    while reader.next_into(&mut row).unwrap() {
        for (count, value) in present.iter_mut().zip(&row.values) {
            *count += usize::from(!value.is_nan());
        }
    }
    (present, reader.report().clone())
}

/// What a naive split of the text says: rows, and non-empty cells per column.
fn counted(text: &str, columns: &[&str]) -> (u64, Vec<usize>) {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let filled = columns.iter().map(|name| {
        let at = header.iter().position(|h| h == name).unwrap();
        rows.iter().filter(|row| !row[at].is_empty()).count()
    });
    (rows.len() as u64, filled.collect())
}

#[test]
fn oracle_every_recording_is_read_whole() {
    let Some(data) = shared() else { return };
    let mut files = 0;
    for folder in std::fs::read_dir(&data)
        .unwrap()
        .map(|entry| entry.unwrap().path())
    {
        if !folder.is_dir() {
            continue;
        }
        for path in std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
        {
            if path.extension().is_none_or(|extension| extension != "csv") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
            let time = header[0];
            let form = match time {
                "sample" => TimeForm::Samples {
                    step_ns: 80_000_000,
                },
                _ => TimeForm::SECONDS,
            };
            let columns: Vec<&str> = header[1..]
                .iter()
                .copied()
                .filter(|&name| name != "timestamp")
                .collect();
            let (present, report) = read(&path, time, form, &columns);
            let (rows, filled) = counted(&text, &columns);
            assert_eq!(
                report.rows + report.refused_time.count + report.repeated_time.count,
                rows,
                "{}",
                path.display()
            );
            if report.refused_time.count + report.repeated_time.count == 0 {
                assert_eq!(present, filled, "{}", path.display());
            }
            assert!(report.truncated.is_none(), "{}", path.display());
            files += 1;
        }
    }
    assert_eq!(files, 15);
}

#[test]
fn oracle_the_machine_temperature_can_be_read_by_its_timestamps() {
    let Some(data) = shared() else { return };
    let path = data.join("temperature-faults/nab_machine_temperature_system_failure.csv");
    let column = ["t_machine_degF"];
    let (_, by_seconds) = read(&path, "time_s", TimeForm::SECONDS, &column);
    let (_, by_text) = read(&path, "timestamp", TimeForm::Rfc3339, &column);
    assert_eq!(by_text.rows, by_seconds.rows);
    assert_eq!(by_text.refused_time.count, by_seconds.refused_time.count);
    // The data set has one backward step of the clock.
    assert!(by_text.refused_time.count > 0);
}
