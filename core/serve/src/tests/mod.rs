//! A small machine, live: arrivals, an engine, a journal.

mod backlogs;
mod damage;
mod failures;
mod kills;
mod recoveries;
mod replays;
mod swaps;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use athermal_core::prng::Prng;
use athermal_features as _;
use athermal_run::live::Feed;
use athermal_run::live::Keep as _;
use athermal_run::model::Model;

use crate::engine::Engine;
use crate::journal::{Begin, Entry, FeedNames, JournalOptions, Log, Record, Recorder, output_hash};
use crate::moment::Moment;
use crate::replay::Replay;
use crate::sequencer::{
    Admission, ChannelRules, Decision, Rules, Sample, Sequencer, SourceRules, Timeline,
};
use crate::time::{Duration, Instant};

/// What learns from all of its past: windows, lags, filters.
pub(crate) const GRAPH: &str = r#"
schema = 1
signals.temperature = { unit = "Cel", channels = ["plate", "room", "chuck"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
nodes.before = { type = "lag", inputs.signal = "masses", lags = ["1s"] }
outputs.trend = "trend"
outputs.masses = "masses"
outputs.before = "before"
"#;

/// A folder of its own, which goes with the test.
#[derive(Debug)]
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("athermal-serve-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub(crate) fn model() -> Model {
    let folder = Folder::new();
    let path = folder.0.join("graph.toml");
    std::fs::write(&path, GRAPH).unwrap();
    Model::load(&path).unwrap()
}

pub(crate) fn engine(model: &Model) -> Engine {
    Engine::new(Arc::clone(&model.plan), &model.fitted).unwrap()
}

pub(crate) fn feed(model: &Model) -> FeedNames {
    FeedNames::new(&Feed::of(&model.plan), vec!["plc".to_owned()])
}

pub(crate) fn rules() -> Rules {
    let late = |ms: i64| ChannelRules {
        source: 0,
        late: Duration::from_ns(ms * 1_000_000),
    };
    Rules {
        settle: Duration::ZERO,
        join: Duration::from_ns(2_000_000),
        sources: vec![SourceRules::default()],
        channels: vec![late(0), late(0), late(2_000)],
        ..Rules::default()
    }
}

/// Small files, so that there are several.
pub(crate) fn small() -> JournalOptions {
    JournalOptions {
        file: 8 << 10,
        ahead: 1 << 10,
        sync: std::time::Duration::from_millis(2),
        ..JournalOptions::default()
    }
}

/// What came out, by instant and bits.
pub(crate) type Outputs = Vec<(Instant, Vec<u64>)>;

/// A machine with a journal.
pub(crate) struct Line {
    pub(crate) sequencer: Sequencer,
    pub(crate) engine: Engine,
    pub(crate) recorder: Recorder,
    pub(crate) outputs: Outputs,
    pub(crate) records: Vec<Record>,
}

impl Line {
    pub(crate) fn begin(model: &Model, folder: &Path, options: JournalOptions) -> Self {
        let timeline = Timeline::new(3, 1);
        let begin = Begin::new(feed(model), String::new(), (0, 0), false, &timeline);
        let mut sequencer = Sequencer::new(rules(), Moment::START);
        sequencer.connected(0, Moment::START);
        Self {
            sequencer,
            engine: engine(model),
            recorder: Recorder::start(folder, begin, options).unwrap(),
            outputs: Vec::new(),
            records: Vec::new(),
        }
    }

    pub(crate) fn record(&mut self, record: Record) {
        self.records.push(record.clone());
        self.recorder.record(record);
    }

    pub(crate) fn arrive(&mut self, sample: Sample, now: Moment) -> Admission {
        let admission = self.sequencer.arrive(sample, now);
        if let Some(record) = Record::of(admission) {
            self.record(record);
        }
        admission
    }

    pub(crate) fn pass(&mut self, now: Moment) {
        while let Some(decision) = self.sequencer.pass(now) {
            let (at, row, is_beat) = match decision {
                Decision::Tick { at, row } => (at, row, false),
                Decision::Beat { at, row } => (at, row, true),
                other => panic!("not with these rules: {other:?}"),
            };
            let outputs = self.engine.step(at, row).unwrap();
            let hash = output_hash(outputs);
            self.outputs.push((at, bits(outputs)));
            self.record(if is_beat {
                Record::Beat { at, hash }
            } else {
                Record::Tick { at, hash }
            });
            self.recorder.sync();
            self.recorder.mend(self.sequencer.timeline());
        }
    }

    /// Waits until the journal thread has written what there is.
    pub(crate) fn settle(&self) {
        let progress = self.recorder.progress();
        let patience = std::time::Duration::from_secs(20);
        assert!(progress.wait_written(self.recorder.event(), patience));
    }
}

pub(crate) fn bits(outputs: &[f64]) -> Vec<u64> {
    let bits = |output: &f64| if output.is_nan() { f64::NAN } else { *output }.to_bits();
    outputs.iter().map(bits).collect()
}

/// So many random samples, some of them late, repeated or lost, and breaks and freezes between.
pub(crate) fn run(line: &mut Line, seed: u64, samples: u64) {
    let mut prng = Prng::stream(seed, "serve");
    let start = 100 * seed as i64;
    for nth in 0..samples as i64 {
        let now = Moment::from_ns((start + nth) * 50_000_000);
        let delay = (prng.uniform() * if nth % 17 == 0 { 900.0 } else { 190.0 }) as i64;
        let stamp = Instant::from_ns(now.as_ns() - delay * 1_000_000);
        let sample = Sample {
            channel: (nth % 3) as u32,
            stamp,
            value: 20.0 + prng.uniform(),
        };
        // Now and then nothing comes for a while.
        if nth % 200 < 160 {
            line.arrive(sample, now);
        }
        if nth % 13 == 0 {
            line.arrive(sample, now);
        }
        line.pass(now);
        if nth % 301 == 300 {
            line.engine.freeze(nth % 2 == 0);
            line.record(Record::Freeze(nth % 2 == 0));
        }
        if nth % 503 == 502 {
            while let Some(Decision::Tick { at, row }) = line.sequencer.finish(now) {
                let hash = output_hash(line.engine.step(at, row).unwrap());
                line.outputs.push((at, bits(line.engine.outputs())));
                line.record(Record::Tick { at, hash });
            }
            line.sequencer.segment();
            line.engine.segment();
            line.record(Record::Break { afresh: true });
        }
    }
}

/// What a kill leaves of a folder.
pub(super) fn copy_tree(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_tree(&entry.path(), &to);
        } else {
            // What was to become a file may have its name by now, and an old one may be gone.
            match std::fs::copy(entry.path(), to) {
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                copied => drop(copied.unwrap()),
            }
        }
    }
}

/// All records of a folder.
pub(crate) fn read(folder: &Path) -> (Log, Vec<Record>) {
    let mut log = Log::open(folder).unwrap();
    let mut records = Vec::new();
    while let Some(entry) = log.read().unwrap() {
        if let Entry::Record(_, record) = entry {
            records.push(record);
        }
    }
    (log, records)
}

/// A folder through a fresh engine: what comes out, and what differs.
pub(crate) fn replay(model: &Model, folder: &Path) -> (Outputs, Replay) {
    let mut log = Log::open(folder).unwrap();
    let mut outputs = Vec::new();
    let mut look =
        |_, engine: &Engine| outputs.push((engine.last().unwrap(), bits(engine.outputs())));
    let mut replay: Option<Replay> = None;
    while let Some(entry) = log.read().unwrap() {
        match (entry, &mut replay) {
            (Entry::Begin(begin), None) => replay = Some(Replay::new(engine(model), &begin)),
            (Entry::Begin(begin), Some(replay)) => {
                replay.catch_up(&mut look).unwrap();
                replay.begin(&begin, !log.gaps().is_empty());
            }
            (Entry::Record(event, record), Some(replay)) => {
                replay.apply((event, 0), &record, &mut look).unwrap();
            }
            (Entry::Record(..), None) => panic!("a record before its file"),
        }
    }
    let mut replay = replay.unwrap();
    replay.catch_up(&mut look).unwrap();
    (outputs, replay)
}
