//! Files of a sink that are wrong, moved, truncated, full, or were written when the program was killed.

use std::collections::BTreeSet;

use athermal_serve::connector::{Outlet, Place};
use athermal_serve::testkit::{open_sink, put};

use super::*;
use crate::file_sink::{CsvSink, JsonLinesSink};

fn csv_sink(more: &str) -> CsvSink {
    serde_json::from_str(&format!("{{\"path\": \"rows.csv\"{more}}}")).unwrap()
}

fn open(folder: &Folder, more: &str) -> Box<dyn Outlet> {
    open_sink(&csv_sink(more), &folder.0, &["a"]).unwrap()
}

fn put_all(outlet: &mut dyn Outlet, seconds: impl IntoIterator<Item = i64>) {
    seconds
        .into_iter()
        .for_each(|second| put(outlet, second, 1).unwrap());
    outlet.flush().unwrap();
}

fn end(outlet: &mut dyn Outlet) -> Place {
    outlet.kept().unwrap().end().unwrap()
}

/// The seconds of the rows of a file, whose first line has the names.
fn seconds(path: &Path) -> Vec<i64> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,a,revision"), "{path:?}");
    let second = |line: &str| line.split(',').next().unwrap().parse().unwrap();
    lines.map(second).collect()
}

/// The seconds of all files of a folder, by their names, the one that is written last.
fn all(folder: &Folder) -> Vec<(String, Vec<i64>)> {
    let names = fs::read_dir(&folder.0).unwrap();
    let names = names.map(|of| of.unwrap().file_name().into_string().unwrap());
    let names: BTreeSet<_> = names.filter(|name| name.starts_with("rows")).collect();
    let of = |name: String| {
        let rows = seconds(&folder.file(&name));
        (name, rows)
    };
    names.into_iter().map(of).collect()
}

fn once(folder: &Folder) -> Vec<i64> {
    all(folder).into_iter().flat_map(|of| of.1).collect()
}

/// What a service does after a kill: rows behind the place are counted, and put again from there on.
fn go_on(folder: &Folder, more: &str, place: Place, known: i64, to: i64) -> Box<dyn Outlet> {
    let mut outlet = open(folder, more);
    let rows = outlet.kept().unwrap().rows_after(place).unwrap().unwrap();
    put_all(&mut *outlet, known + rows as i64..to);
    outlet
}

#[test]
fn files_that_are_full_keep_the_rules_of_sinks() {
    for more in [
        ", \"rotate\": \"1s\"",
        ", \"rotate\": \"40 B\", \"keep\": 1",
    ] {
        let folder = Folder::new();
        athermal_serve::testkit::assert_sink(&csv_sink(more), &folder.0, &["a", "b"]);
        let folder = Folder::new();
        let text = format!("{{\"path\": \"rows.jsonl\"{more}}}");
        let sink: JsonLinesSink = serde_json::from_str(&text).unwrap();
        athermal_serve::testkit::assert_sink(&sink, &folder.0, &["a", "b"]);
    }
}

#[test]
fn a_file_is_full_where_its_time_is_over_or_with_so_many_bytes_and_so_many_are_kept() {
    let folder = Folder::new();
    let mut outlet = open(&folder, ", \"rotate\": \"1d\"");
    put_all(&mut *outlet, (0..50).map(|nth| nth * 3_600));
    let names: Vec<_> = all(&folder)
        .into_iter()
        .map(|of| (of.0, of.1.len()))
        .collect();
    let name = |name: &str| name.to_owned();
    let expected = [
        (name("rows-1970-01-01-000001.csv"), 24),
        (name("rows-1970-01-02-000002.csv"), 24),
        (name("rows.csv"), 2),
    ];
    assert_eq!(names, expected);
    drop(outlet);
    // A restart goes on in the file of the day, and the day after in the next.
    let mut outlet = open(&folder, ", \"rotate\": \"1d\"");
    put_all(&mut *outlet, (50..80).map(|nth| nth * 3_600));
    let last = &all(&folder)[2];
    assert_eq!((&*last.0, last.1.len()), ("rows-1970-01-03-000003.csv", 24));

    let folder = Folder::new();
    let mut outlet = open(&folder, ", \"rotate\": \"1 kB\", \"keep\": 3");
    put_all(&mut *outlet, 0..1_000);
    assert!(all(&folder).len() > 10, "what may be asked for is kept");
    let rows = once(&folder);
    assert_eq!(rows, (0..1_000).collect::<Vec<_>>());
    let place = end(&mut *outlet);
    outlet.kept().unwrap().forget(place);
    let files = all(&folder);
    assert_eq!(files.len(), 4);
    assert_eq!(files[3].1.last(), Some(&999));
    for (name, _) in &files[..3] {
        let length = fs::metadata(folder.file(name)).unwrap().len();
        assert!((1_000..1_100).contains(&length), "{name}: {length}");
    }
}

#[test]
fn a_place_counts_rows_over_all_files_wherever_the_program_was_killed() {
    let more = ", \"rotate\": \"300 B\"";
    for kept in [0, 1, 7, 8, 20, 21, 40] {
        for written in [kept, kept + 1, kept + 9, kept + 40] {
            let folder = Folder::new();
            let mut outlet = open(&folder, more);
            put_all(&mut *outlet, 0..kept);
            let place = end(&mut *outlet);
            put_all(&mut *outlet, kept..written);
            drop(outlet);
            drop(go_on(&folder, more, place, kept, 100));
            let expected: Vec<_> = (0..100).collect();
            assert_eq!(once(&folder), expected, "{kept} of {written}");
            // The journal knows fewer than were written.
            let mut outlet = open(&folder, more);
            let known = outlet.kept().unwrap();
            let rows = known.rows_after(place).unwrap();
            assert_eq!(rows, Some(100 - kept as u64), "{kept} of {written}");
            known.cut(place, 5).unwrap();
            assert_eq!(once(&folder), (0..kept + 5).collect::<Vec<_>>());
            put_all(&mut *outlet, kept + 5..60);
            assert_eq!(once(&folder), (0..60).collect::<Vec<_>>());
        }
    }
}

#[test]
fn a_kill_between_the_name_of_a_full_file_and_the_next_one_loses_nothing() {
    let (folder, more) = (Folder::new(), ", \"rotate\": \"1d\"");
    let mut outlet = open(&folder, more);
    put_all(&mut *outlet, 0..5);
    let place = end(&mut *outlet);
    put_all(&mut *outlet, 5..9);
    drop(outlet);
    let full = folder.file("rows-1970-01-01-000001.csv");
    fs::rename(folder.file("rows.csv"), &full).unwrap();
    let mut outlet = go_on(&folder, more, place, 5, 20);
    assert_eq!(once(&folder), (0..20).collect::<Vec<_>>());
    // What is full is taken away to an archive.
    let place = end(&mut *outlet);
    fs::rename(&full, folder.file("archive")).unwrap();
    drop(outlet);
    let mut outlet = go_on(&folder, more, place, 20, 90_000);
    outlet.flush().unwrap();
    let names: Vec<_> = all(&folder).into_iter().map(|of| of.0).collect();
    assert_eq!(names, ["rows-1970-01-01-000002.csv", "rows.csv"]);
}

#[test]
fn a_file_that_is_moved_or_truncated_is_gone_on_with_in_a_new_one_and_has_no_nul_bytes() {
    for copies in [false, true] {
        let folder = Folder::new();
        let (path, moved) = (folder.file("rows.csv"), folder.file("rows.csv.1"));
        let mut outlet = open(&folder, "");
        put_all(&mut *outlet, 0..100);
        let place = end(&mut *outlet);
        put_all(&mut *outlet, 100..110);
        if copies {
            fs::copy(&path, &moved).unwrap();
            fs::File::options()
                .write(true)
                .open(&path)
                .unwrap()
                .set_len(0)
                .unwrap();
        } else {
            fs::rename(&path, &moved).unwrap();
        }
        put_all(&mut *outlet, 110..150);
        assert_eq!(seconds(&moved), (0..110).collect::<Vec<_>>());
        assert_eq!(seconds(&path), (110..150).collect::<Vec<_>>());
        drop(outlet);
        // Killed before the place was kept again: what was moved is known by its first row.
        let mut outlet = go_on(&folder, "", place, 100, 200);
        assert_eq!(seconds(&path), (110..200).collect::<Vec<_>>());
        let place = end(&mut *outlet);
        drop(outlet);
        drop(go_on(&folder, "", place, 200, 210));
        assert_eq!(seconds(&path), (110..210).collect::<Vec<_>>());
    }
}

#[test]
fn a_folder_that_was_removed_is_reported_and_written_to_once_it_is_back() {
    let folder = Folder::new();
    let sink: CsvSink = serde_json::from_str("{\"path\": \"in/rows.csv\"}").unwrap();
    let inner = folder.file("in");
    fs::create_dir(&inner).unwrap();
    let mut outlet = open_sink(&sink, &folder.0, &["a"]).unwrap();
    put_all(&mut *outlet, 0..3);
    fs::remove_dir_all(&inner).unwrap();
    put(&mut *outlet, 3, 1).unwrap();
    let error = outlet.flush().unwrap_err().to_string();
    assert!(
        error.contains("rows.csv") && error.contains("No such file"),
        "{error}"
    );
    fs::create_dir(&inner).unwrap();
    put_all(&mut *outlet, 4..6);
    assert_eq!(seconds(&inner.join("rows.csv")), [3, 4, 5]);
}

#[test]
fn what_is_no_file_of_the_sink_is_refused_and_left_as_it_is() {
    let nul = [&[0; 5_000][..], b"1,2,3\n"].concat();
    for (text, words) in [
        (&b"a,b\n1,2\n"[..], "its columns are"),
        (b"a,b\n1,2\nthree", "its columns are"),
        (b"no line", "no whole line"),
        (&nul, "NUL bytes"),
        (b"\xff\xfe\x00\x01\n\x80", ""),
    ] {
        let folder = Folder::new();
        let path = folder.file("rows.csv");
        fs::write(&path, text).unwrap();
        let refused = open_sink(&csv_sink(""), &folder.0, &["a"]).err().unwrap();
        assert!(
            refused.contains(words) && refused.contains("away"),
            "{refused}"
        );
        assert!(refused.len() < 600, "{refused}");
        assert_eq!(fs::read(&path).unwrap(), text);
    }
    // What is left of the names is not another's.
    let folder = Folder::new();
    fs::write(folder.file("rows.csv"), "time_s,").unwrap();
    put_all(&mut *open(&folder, ""), 0..2);
    assert_eq!(once(&folder), [0, 1]);
}

#[test]
fn a_sink_that_is_wrong_at_the_start_is_a_state_and_has_each_row_once_it_is_right() {
    let folder = Folder::new();
    let rows = rows(9, 300);
    let (log, out) = (folder.file("log.csv"), folder.file("out.csv"));
    for (nth, wrong) in ["a,b\n1,2\n", "\0\0\0"].into_iter().enumerate() {
        let count = 100 * (nth + 1);
        fs::write(&out, wrong).unwrap();
        fs::write(&log, HEADER.to_owned() + &csv(&rows[..count])).unwrap();
        let sinks = format!("{KEPT}\n[sinks.other]\ntype = \"csv\"\npath = \"other.csv\"");
        let mut service = folder.start(FOLLOWED, &sinks).unwrap();
        let counts = Arc::clone(&service.sinks()[0].1);
        let other = folder.file("other.csv");
        until("the other sink", Some(&mut service), || {
            found(&other).len() == count && counts.error().is_some()
        });
        assert!(counts.failures.load(Ordering::Relaxed) > 0);
        assert_eq!(fs::read_to_string(&out).unwrap(), wrong);
        if nth == 0 {
            fs::rename(&out, folder.file("away")).unwrap();
            until("the rows", Some(&mut service), || {
                found(&out).len() == count
            });
            assert_eq!(counts.error(), None);
            assert!(found(&out) == expected(&folder.model(), &rows[..count]));
            service.stop().unwrap();
        } else {
            // It ends before anybody looked; the next start has all that came.
            service.stop().unwrap();
            fs::remove_file(&out).unwrap();
            let mut service = folder.start(FOLLOWED, &sinks).unwrap();
            until("the rows", Some(&mut service), || found(&out).len() == 100);
            service.stop().unwrap();
            assert!(found(&out) == expected(&folder.model(), &rows[..count])[100..]);
        }
    }
}

#[test]
fn a_sink_that_never_opened_in_its_first_run_has_all_rows_of_it_in_the_next() {
    let folder = Folder::new();
    let rows = rows(10, 100);
    let (log, out) = (folder.file("log.csv"), folder.file("out.csv"));
    fs::write(&log, HEADER.to_owned() + &csv(&rows)).unwrap();
    fs::write(&out, "a,b\n1,2\n").unwrap();
    let mut service = folder.start(FOLLOWED, KEPT).unwrap();
    until("a tick", Some(&mut service), || {
        fs::exists(folder.file("state/sinks/out.json")).unwrap()
    });
    until("all ticks", None, || {
        service.pump();
        service.snapshot().happenings == 100
    });
    service.stop().unwrap();
    fs::remove_file(&out).unwrap();
    let mut service = folder.start(FOLLOWED, KEPT).unwrap();
    until("the rows", Some(&mut service), || found(&out).len() == 100);
    service.stop().unwrap();
    assert!(found(&out) == expected(&folder.model(), &rows));
}

#[test]
fn a_rotation_that_means_nothing_is_refused() {
    let read = |more: &str| serde_json::from_str::<CsvSink>(&format!("{{\"path\": \"a\"{more}}}"));
    for wrong in ["\"0s\"", "\"10 ms\"", "\"0 B\"", "\"daily\"", "7"] {
        let error = read(&format!(", \"rotate\": {wrong}")).unwrap_err();
        println!("{error}");
    }
    let remarks = |more: &str| {
        let sink: Box<dyn athermal_serve::connector::Sink> = Box::new(read(more).unwrap());
        sink.remarks().len()
    };
    assert_eq!(remarks(", \"keep\": 3"), 1);
    assert_eq!(remarks(", \"keep\": 3, \"rotate\": \"1d\""), 0);
}
