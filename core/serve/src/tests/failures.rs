//! A disk that does not take what is written.

use std::fs;
use std::process::Command;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::Keep as _;

use super::*;

fn patient(done: impl Fn() -> bool, what: &str) {
    let began = Clock::now();
    while !done() {
        assert!(began.elapsed() < Wait::from_secs(20), "{what}");
        std::thread::sleep(Wait::from_millis(1));
    }
}

/// What is read of a journal with a gap is right up to it, and the ticks behind it have the rows that they had.
fn check_around_the_gap(line: Line, model: &Model, folder: &Path) {
    let Line {
        recorder,
        records,
        outputs,
        ..
    } = line;
    let status = recorder.progress().status();
    recorder.finish();
    let (log, read) = read(folder);
    let lost: u64 = log.gaps().iter().map(|gap| gap.records).sum();
    assert!(lost > 0, "no gap");
    assert_eq!(lost, status.lost);
    assert_eq!(read.len() as u64 + lost, records.len() as u64);
    let first = log.gaps()[0].from as usize;
    assert_eq!(read[..first], records[..first]);
    let last = log.gaps().last().unwrap();
    let behind = (last.from + last.records) as usize;
    assert_eq!(
        read[read.len() - (records.len() - behind)..],
        records[behind..]
    );
    // Rows behind the gap hold the samples that were accepted within it.
    let (replayed, replay) = replay(model, folder);
    assert!(replayed.len() <= outputs.len());
    let last = (
        replay.timeline().last(),
        replay.timeline().stamps().to_vec(),
    );
    let mut whole = Timeline::new(3, 1);
    records.iter().for_each(|record| record.apply(&mut whole));
    assert_eq!(last, (whole.last(), whole.stamps().to_vec()));
    assert!(replay.timeline().pending().eq(whole.pending()));
}

#[test]
fn a_queue_that_is_full_makes_a_gap_that_is_counted_and_the_journal_goes_on_behind_it() {
    let (model, folder) = (model(), Folder::new());
    let options = JournalOptions {
        queue: 256,
        ..small()
    };
    let mut line = Line::begin(&model, &folder.0, options);
    run(&mut line, 1, 50);
    line.settle();
    // So many at once that no thread keeps up.
    for nth in 0..50_000 {
        line.record(Record::Note(format!("{nth}").into()));
    }
    assert!(line.recorder.has_gap());
    patient(
        || line.recorder.progress().written() + 10 > 50,
        "what was in the queue is written",
    );
    let began = Clock::now();
    while line.recorder.has_gap() {
        assert!(began.elapsed() < Wait::from_secs(20), "does not go on");
        std::thread::sleep(Wait::from_millis(1));
        line.recorder.mend(line.sequencer.timeline());
    }
    for seed in 2..6 {
        run(&mut line, seed, 20);
        assert!(!line.recorder.has_gap(), "{seed}");
        line.settle();
    }
    check_around_the_gap(line, &model, &folder.0);
}

#[test]
fn a_folder_that_goes_away_is_reported_and_the_journal_goes_on_once_it_is_back() {
    let (model, folder) = (model(), Folder::new());
    let path = folder.0.join("journal");
    let options = JournalOptions {
        retry: Wait::from_millis(20),
        ..small()
    };
    let mut line = Line::begin(&model, &path, options);
    run(&mut line, 1, 100);
    line.settle();
    fs::rename(&path, folder.0.join("away")).unwrap();
    run(&mut line, 2, 1_000);
    patient(
        || line.recorder.progress().status().failures > 0,
        "the next file cannot be made",
    );
    let status = line.recorder.progress().status();
    assert!(status.error.is_some());
    assert!(!line.recorder.progress().wait_written(u64::MAX, Wait::ZERO));
    fs::rename(folder.0.join("away"), &path).unwrap();
    let mut seed = 12;
    let began = Clock::now();
    // It may fail once more just before the folder is back.
    let is_written =
        |line: &Line| line.recorder.progress().status().written >= line.recorder.event();
    while line.recorder.has_gap() || seed < 14 || !is_written(&line) {
        run(&mut line, seed, 20);
        seed += 1;
        std::thread::sleep(Wait::from_millis(10));
        assert!(began.elapsed() < Wait::from_secs(20), "does not go on");
    }
    check_around_the_gap(line, &model, &path);
}

#[test]
fn a_full_disk_is_reported_and_the_journal_goes_on_once_there_is_room() {
    let (model, folder) = (model(), Folder::new());
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", "size=256k", "tmpfs"])
        .arg(&folder.0)
        .output();
    if !mounted.is_ok_and(|of| of.status.success()) {
        println!("skipped: a small file system cannot be mounted here");
        return;
    }
    let path = folder.0.join("journal");
    let options = JournalOptions {
        retry: Wait::from_millis(20),
        ..small()
    };
    let ballast = folder.0.join("ballast");
    fs::write(&ballast, vec![1; 200 << 10]).unwrap();
    let mut line = Line::begin(&model, &path, options);
    let mut seed = 1;
    while line.recorder.progress().status().failures == 0 {
        run(&mut line, seed, 100);
        seed += 1;
        std::thread::sleep(Wait::from_millis(1));
        assert!(seed < 2_000, "the disk does not fill");
    }
    let status = line.recorder.progress().status();
    let error = status.error.unwrap_or_default();
    assert!(error.contains("No space left"), "{error}");
    fs::remove_file(&ballast).unwrap();
    let more = seed + 3;
    let began = Clock::now();
    while line.recorder.has_gap() || seed < more {
        run(&mut line, seed, 20);
        seed += 1;
        std::thread::sleep(Wait::from_millis(10));
        assert!(began.elapsed() < Wait::from_secs(20), "does not go on");
    }
    line.settle();
    check_around_the_gap(line, &model, &path);
    let unmounted = Command::new("umount").arg("-l").arg(&folder.0).status();
    assert!(unmounted.unwrap().success());
}

#[test]
fn a_folder_that_cannot_be_written_is_reported_at_the_start() {
    let folder = Folder::new();
    let file = folder.0.join("file");
    fs::write(&file, "").unwrap();
    let timeline = Timeline::new(3, 1);
    let begin = Begin::new(feed(&model()), String::new(), (0, 0), false, &timeline);
    let error = Recorder::start(&file.join("journal"), begin, small()).unwrap_err();
    assert!(error.to_string().starts_with("cannot write "), "{error}");
}

#[test]
fn what_is_written_is_soon_synced() {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    run(&mut line, 1, 100);
    line.settle();
    let event = line.recorder.event();
    let progress = Arc::clone(line.recorder.progress());
    patient(|| progress.synced() == event, "synced");
    let status = progress.status();
    assert_eq!((status.written, status.lost), (event, 0));
    assert!(!status.is_degraded);
}

#[test]
fn the_engine_thread_allocates_nothing_for_records() {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    let sample = Sample {
        channel: 0,
        stamp: Instant::from_ns(0),
        value: 1.0,
    };
    let mut recorder = line.recorder;
    let counted = allocation_counter::measure(|| {
        for nth in 0..10_000 {
            recorder.record(Record::Sample(sample));
            let at = Instant::from_ns(nth);
            recorder.record(Record::Tick { at, hash: 1 });
            recorder.sync();
            recorder.mend(line.sequencer.timeline());
        }
    });
    assert_eq!(counted.count_total, 0);
    line.records.clear();
}
