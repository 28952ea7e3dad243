//! A service that is killed at random instants, for real: this program again, as a child.

use std::fs::{self, File};
use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::{LiveGraph, LiveOptions, Output, pair_from};

use super::recoveries::{nth, steady, uninterrupted};
use super::*;
use crate::checkpoint::Checkpoints;
use crate::folder::StateFolder;
use crate::keeper::Keeper;
use crate::recovery::Recovered;

const FOLDER: &str = "ATHERMAL_SERVE_FOLDER";
const PACE: &str = "ATHERMAL_SERVE_PACE";
const SAMPLES: u64 = 12_000;

fn line(happenings: u64, at: Instant, outputs: &[f64]) -> String {
    format!(
        "{happenings} {} {:016x}\n",
        at.as_ns(),
        output_hash(outputs)
    )
}

/// A whole service with a file sink: what the parent starts and kills.
#[test]
#[ignore = "run by the test below"]
fn child() {
    let Ok(path) = std::env::var(FOLDER) else {
        return;
    };
    let pace = std::env::var(PACE).unwrap().parse().unwrap();
    let (path, model) = (PathBuf::from(path), model());
    let folder = StateFolder::open(&path).unwrap();
    let checkpoints = Checkpoints::new(folder.checkpoints(), 3);
    let file = path.join("out");
    // Half a line is no line.
    let written = fs::read_to_string(&file).unwrap_or_default();
    let written = &written[..written.rfind('\n').map_or(0, |end| end + 1)];
    let least = written.lines().count() as u64;
    let mut put = least;
    fs::write(&file, written).unwrap();
    let mut sink = File::options().append(true).open(&file).unwrap();
    let again = |happenings: u64, engine: &Engine| {
        if happenings > put {
            let text = line(happenings, engine.last().unwrap(), engine.outputs());
            sink.write_all(text.as_bytes()).unwrap();
            put = happenings;
        }
    };
    fs::write(path.join("starts"), "").unwrap();
    let names = feed(&model);
    let found = Recovered::find(
        &folder,
        &checkpoints,
        &model,
        |_| names.clone(),
        least,
        again,
    );
    let recovered = found.unwrap();
    assert!(recovered.report.difference.is_none());
    assert_eq!(
        put,
        recovered.happenings(),
        "nothing is put out before it is written"
    );
    let begin = recovered.begin();
    let mut happenings = recovered.happenings();
    // What the journal may not have comes again.
    let stepped = recovered.timeline.last().as_ns().max(0) as u64 / 40_000_000;
    let from = stepped.saturating_sub(20);
    let options = JournalOptions {
        file: 64 << 10,
        sync: Wait::from_millis(5),
        ..JournalOptions::default()
    };
    let recorder = Recorder::start(&folder.journal(), begin, options).unwrap();
    let progress = Arc::clone(recorder.progress());
    // It is later than anything in the journal came.
    let timeline = &recovered.timeline;
    let waiting = timeline.pending().map(|of| of.stamp);
    let newest = waiting.chain(timeline.stamps().iter().copied()).max();
    let now = Moment::from_ns(newest.unwrap().as_ns().max(0) + 200_000_000);
    let restarted = now;
    let mut sequencer = Sequencer::resume(steady(), recovered.timeline, now);
    sequencer.connected(0, now);
    let live = LiveOptions {
        mirrors: false,
        ..LiveOptions::default()
    };
    let (stepper, control) = pair_from(recovered.engine, live).unwrap();
    let every = Wait::from_millis(5);
    let known = Arc::clone(&progress);
    let mut keeper = Keeper::new(
        control,
        (checkpoints, folder.commits()),
        known,
        happenings,
        every,
    );
    let mut worker = LiveGraph::new(Some(sequencer), stepper, recorder);
    let mut text = String::new();
    for count in from..SAMPLES {
        let (came, sample) = nth(count);
        let now = came.max(restarted);
        let mut records = 0;
        let mut put = |of: &Output<'_>| {
            happenings += 1;
            records = of.records;
            text += &line(happenings, of.at, of.stepped.outputs);
        };
        worker.pass(now, &mut put).unwrap();
        worker.arrive(sample, now);
        worker.pass(now, &mut put).unwrap();
        if !text.is_empty() {
            assert!(progress.wait_written(records, Wait::from_secs(20)));
            sink.write_all(text.as_bytes()).unwrap();
            text.clear();
        }
        worker.rest();
        if count % 10 == 0 {
            keeper.pump().unwrap();
        }
        std::thread::sleep(Wait::from_micros(pace));
    }
    keeper.control().needs_replica();
    worker.rest();
    let (_, _, recorder) = worker.into_parts();
    recorder.finish();
    keeper.finish().unwrap();
    fs::write(path.join("done"), "").unwrap();
}

#[test]
fn a_service_that_is_killed_at_random_instants_puts_out_the_same_bits_once() {
    let kills = if std::env::var_os("ATHERMAL_LONG").is_some() {
        2_000
    } else {
        200
    };
    let (model, folder) = (model(), Folder::new());
    let mut prng = Prng::stream(1, "kills");
    let (mut killed, mut lines) = (0, 0);
    while !folder.0.join("done").exists() {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command
            .args(["--exact", "tests::kills::child", "--ignored"])
            .env(FOLDER, &folder.0)
            .env(PACE, if killed < kills { "100" } else { "0" })
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        if killed < kills {
            // Three of four are killed at work, however long the start takes; the others anywhere.
            let began = Clock::now();
            let starts = folder.0.join("starts");
            while killed % 4 != 0 && !starts.exists() && began.elapsed() < Wait::from_secs(10) {
                std::thread::sleep(Wait::from_millis(1));
            }
            let _ = fs::remove_file(starts);
            std::thread::sleep(Wait::from_micros(prng.between(1e3, 40e3) as u64));
            child.kill().unwrap();
            killed += 1;
            let out = fs::read_to_string(folder.0.join("out")).unwrap_or_default();
            lines = out.lines().count();
        }
        let ended = child.wait_with_output().unwrap();
        // Killed, or done.
        let text = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code().is_none_or(|code| code == 0), "{text}");
    }
    println!("{killed} kills within {lines} ticks");
    let mut expected = String::new();
    let (outputs, engine) = uninterrupted(&model, SAMPLES);
    for ((at, bits), happenings) in outputs.iter().zip(1..) {
        let outputs: Vec<_> = bits.iter().map(|bits| f64::from_bits(*bits)).collect();
        expected += &line(happenings, *at, &outputs);
    }
    let found = fs::read_to_string(folder.0.join("out")).unwrap();
    assert!(found == expected, "{} lines", found.lines().count());
    let checkpoints = Checkpoints::new(folder.0.join("checkpoints"), 3);
    let newest = checkpoints.read().unwrap().next().unwrap().unwrap();
    assert_eq!(newest.happenings, outputs.len() as u64);
    assert_eq!(newest.snapshot, engine.snapshot());
    assert!(
        killed == kills && lines > kills,
        "{killed} kills, {lines} ticks"
    );
}
