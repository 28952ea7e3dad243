//! Any log, applied again.

use athermal_run::recording::{Event, Recording, Samples, pass};
use proptest::prelude::*;

use super::*;
use crate::journal::JournalRecording;
use crate::sequencer::Refusal;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_log_replays_to_the_same_bits(seed in 1..10_000_u64, samples in 1..2_000_u64) {
        let (model, folder) = (model(), Folder::new());
        let mut line = Line::begin(&model, &folder.0, small());
        run(&mut line, seed, samples);
        let Line { recorder, outputs, records, .. } = line;
        recorder.finish();
        let (log, read) = read(&folder.0);
        prop_assert_eq!(read, records);
        prop_assert!(log.torn().is_none() && log.gaps().is_empty());
        let (replayed, replay) = replay(&model, &folder.0);
        prop_assert_eq!(replay.stepped(), outputs.len() as u64);
        prop_assert_eq!(replayed, outputs);
        prop_assert_eq!(replay.difference(), None);
    }
}

#[test]
fn the_first_tick_that_differs_is_found() {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    run(&mut line, 7, 300);
    // A processor that computes another last bit.
    let wrong = line.records.len() as u64;
    let at = Instant::from_ns(line.engine.last().unwrap().as_ns() + 1);
    let hash = output_hash(line.engine.step(at, &[f64::NAN; 3]).unwrap()) ^ 1;
    line.record(Record::Beat { at, hash });
    let Line { recorder, .. } = line;
    recorder.finish();
    let (_, replay) = replay(&model, &folder.0);
    let found = replay.difference().unwrap();
    assert_eq!((found.event, found.at), (wrong, at));
}

#[test]
fn every_kind_of_record_is_read_as_it_was_written() {
    let sample = |value| Sample {
        channel: 2,
        stamp: Instant::from_ns(-5),
        value,
    };
    let ns = Duration::from_ns;
    let written = [
        Record::Sample(sample(1.5)),
        Record::Late(sample(-0.0)),
        Record::Twice(sample(f64::INFINITY)),
        Record::Refused(sample(2.0), Refusal::Future { ahead: ns(7) }),
        Record::Refused(sample(2.0), Refusal::Clock { off: ns(-7) }),
        Record::Refused(sample(2.0), Refusal::NoChannel),
        Record::Waits(sample(3.0)),
        Record::Thinned {
            source: 1,
            samples: 1_000,
        },
        Record::Lag {
            source: 3,
            least: ns(-9),
        },
        Record::Tick {
            at: Instant::from_ns(i64::MAX),
            hash: u64::MAX,
        },
        Record::Beat {
            at: Instant::from_ns(0),
            hash: 0,
        },
        Record::Break { afresh: false },
        Record::Freeze(true),
        Record::Shift {
            source: 0,
            offset: ns(-3_600_000_000_000),
        },
        Record::Swap {
            revision: 0x0123_4567_89ab_cdef,
        },
        Record::Note("offset of plc: −3600 s".into()),
        Record::Note("".into()),
    ];
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    written.iter().for_each(|of| line.record(of.clone()));
    let Line { recorder, .. } = line;
    recorder.finish();
    assert_eq!(read(&folder.0).1, written);
}

#[test]
fn a_journal_is_a_recording_of_its_ticks() {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    run(&mut line, 3, 1_500);
    let Line {
        recorder, outputs, ..
    } = line;
    recorder.finish();
    let recording = JournalRecording::in_state(&folder.0);
    let (mut fresh, mut again) = (engine(&model), Vec::new());
    let mut breaks = 0;
    let passed = pass(&mut fresh, &recording, |engine, event, _| match event {
        Event::Row(time) => again.push((time, bits(engine.outputs()))),
        Event::Segment => breaks += 1,
    });
    assert_eq!(passed.unwrap().ticks, outputs.len() as u64);
    assert_eq!(again, outputs);
    assert_eq!(breaks, 2);
    let empty = Folder::new();
    let recording = JournalRecording::in_state(&empty.0);
    let refused = recording.open(&model.plan).err().unwrap().to_string();
    assert!(refused.ends_with("there is no journal in this folder"));
}

#[test]
fn a_graph_that_reads_other_channels_takes_what_there_is() {
    let (model, folder) = (model(), Folder::new());
    let mut line = Line::begin(&model, &folder.0, small());
    run(&mut line, 3, 100);
    let Line { recorder, .. } = line;
    recorder.finish();
    let graph = folder.0.join("other.toml");
    let text = "schema = 1\n\
        signals.temperature = { unit = \"Cel\", channels = [\"outside\", \"room\"], optional = [\"outside\"], max_age = \"3s\" }\n\
        nodes.trend = { type = \"slope\", inputs.signal = \"temperature\", windows = [\"2s\"] }\n\
        outputs.trend = \"trend\"\n";
    std::fs::write(&graph, text).unwrap();
    let other = Model::load(&graph).unwrap();
    let recording = JournalRecording::in_state(&folder.0);
    let mut source = recording.open(&other.plan).unwrap();
    let mut samples = Samples::default();
    let mut known = 0;
    while let Some(event) = source.next(&mut samples).unwrap() {
        if event != Event::Segment {
            assert!(samples.values[0].is_nan());
            known += usize::from(!samples.values[1].is_nan());
        }
    }
    assert!(known > 20, "{known}");
}
