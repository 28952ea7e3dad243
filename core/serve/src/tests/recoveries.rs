//! A service that ends anywhere, and goes on.

use std::fs;
use std::time::Duration as Wait;

use athermal_run::live::{Keep as _, LiveGraph, LiveOptions, Output, pair_from};

use super::*;
use crate::checkpoint::{Checkpoint, Checkpoints};
use crate::folder::{FolderError, StateFolder};
use crate::journal::{Keep, retire};
use crate::keeper::Keeper;
use crate::recovery::{Recovered, RecoveryError, Start};

/// The nth of many samples, and when it comes: always within `wait`.
pub(super) fn nth(nth: u64) -> (Moment, Sample) {
    let mut prng = Prng::stream(nth, "arrival");
    let now = nth as i64 * 40_000_000;
    let delay = (prng.uniform() * 190.0) as i64 * 1_000_000;
    let sample = Sample {
        channel: (nth % 3) as u32,
        stamp: Instant::from_ns(now - delay),
        value: 20.0 + prng.uniform(),
    };
    (Moment::from_ns(now), sample)
}

/// Rules by which ticks follow from stamps alone.
pub(super) fn steady() -> Rules {
    let mut rules = rules();
    rules.heartbeat = None;
    rules.channels[2].late = Duration::ZERO;
    rules
}

/// A service with its state in a folder.
struct Service {
    worker: LiveGraph<Recorder>,
    keeper: Keeper,
    outputs: Outputs,
    _folder: StateFolder,
}

fn checkpoints(folder: &StateFolder) -> Checkpoints {
    Checkpoints::new(folder.checkpoints(), 3)
}

fn recover(path: &Path, model: &Model) -> (StateFolder, Recovered, Outputs) {
    let folder = StateFolder::open(path).unwrap();
    let mut again = Vec::new();
    let look =
        |_: u64, engine: &Engine| again.push((engine.last().unwrap(), bits(engine.outputs())));
    let recovered = Recovered::find(
        &folder,
        &checkpoints(&folder),
        model,
        |_| feed(model),
        u64::MAX,
        look,
    )
    .unwrap();
    (folder, recovered, again)
}

impl Service {
    /// Goes on from a folder, at the moment of a sample.
    fn start(path: &Path, model: &Model, now: Moment) -> Self {
        let (folder, recovered, _) = recover(path, model);
        let revision = recovered.engine.revision().to_owned();
        folder.keep_model(&recovered.model, &revision).unwrap();
        let begin = recovered.begin();
        let recorder = Recorder::start(&folder.journal(), begin, small()).unwrap();
        let before = recovered.happenings();
        let (stepper, control) = pair_from(recovered.engine, LiveOptions::default()).unwrap();
        let mut sequencer = Sequencer::resume(steady(), recovered.timeline, now);
        sequencer.connected(0, now);
        let progress = Arc::clone(recorder.progress());
        let every = Wait::from_millis(1);
        Self {
            keeper: Keeper::new(
                control,
                (checkpoints(&folder), folder.commits()),
                progress,
                before,
                every,
            ),
            worker: LiveGraph::new(Some(sequencer), stepper, recorder),
            outputs: Vec::new(),
            _folder: folder,
        }
    }

    fn work(&mut self, samples: std::ops::Range<u64>) {
        let outputs = &mut self.outputs;
        for (count, (now, sample)) in samples.map(nth).enumerate() {
            if count % 100 == 99 {
                // As much time as a checkpoint takes.
                let recorder = self.worker.keep();
                let event = recorder.event();
                while recorder.progress().synced() < event {
                    std::thread::sleep(Wait::from_millis(1));
                    self.keeper.pump().unwrap();
                }
                self.keeper.pump().unwrap();
            }
            let mut put = |of: &Output<'_>| {
                outputs.push((of.at, bits(of.stepped.outputs)));
            };
            self.worker.pass(now, &mut put).unwrap();
            self.worker.arrive(sample, now);
            self.worker.pass(now, &mut put).unwrap();
            self.keeper.pump().unwrap();
        }
    }

    /// What a kill leaves: all that was written, and nothing else.
    fn kill(mut self, path: &Path) -> (Folder, Outputs) {
        let recorder = self.worker.keep();
        assert!(
            recorder
                .progress()
                .wait_written(recorder.event(), Wait::from_secs(20))
        );
        self.keeper.saving.wait(Wait::from_secs(20));
        let copy = Folder::new();
        copy_tree(path, &copy.0);
        (copy, self.outputs)
    }
}

/// The outputs of a run that nothing interrupts, without a journal.
pub(super) fn uninterrupted(model: &Model, samples: u64) -> (Outputs, Engine) {
    let (mut engine, mut outputs) = (engine(model), Vec::new());
    let mut sequencer = Sequencer::new(steady(), Moment::START);
    sequencer.connected(0, Moment::START);
    let mut pass = |sequencer: &mut Sequencer, now| {
        while let Some(Decision::Tick { at, row }) = sequencer.pass(now) {
            outputs.push((at, bits(engine.step(at, row).unwrap())));
        }
    };
    for (now, sample) in (0..samples).map(nth) {
        pass(&mut sequencer, now);
        sequencer.arrive(sample, now);
        pass(&mut sequencer, now);
    }
    (outputs, engine)
}

#[test]
fn a_service_that_ends_anywhere_goes_on_with_the_same_bits() {
    let model = model();
    let mut prng = Prng::stream(1, "ends");
    for _ in 0..20 {
        let mut folder = Folder::new();
        let (mut outputs, mut from) = (Outputs::new(), 0);
        for _ in 0..5 {
            let to = from + 1 + (prng.uniform() * 300.0) as u64;
            let mut service = Service::start(&folder.0, &model, nth(from).0);
            // What came shortly before the end comes again.
            service.work(from.saturating_sub(40)..to);
            let (left, of) = service.kill(&folder.0);
            outputs.extend(of);
            (folder, from) = (left, to);
        }
        assert!(outputs.len() as u64 > from / 2);
        assert_eq!(outputs, uninterrupted(&model, from).0);
    }
}

#[test]
fn a_start_steps_what_the_journal_has_behind_the_newest_checkpoint() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..600);
    let (left, outputs) = service.kill(&folder.0);
    let (_, recovered, again) = recover(&left.0, &model);
    let Start::Checkpoint(at) = recovered.report.start else {
        panic!("{:?}", recovered.report.start);
    };
    assert!(at > 0 && at <= outputs.len() as u64);
    assert_eq!(again, outputs[at as usize..]);
    assert_eq!(recovered.report.stepped, again.len() as u64);
    assert_eq!(recovered.happenings(), outputs.len() as u64);
    assert!(recovered.report.refused.is_empty() && recovered.report.difference.is_none());
    assert_eq!(recovered.report.ahead, 0);
}

#[test]
fn what_a_sink_lacks_is_stepped_again_from_an_older_checkpoint_or_the_beginning() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..600);
    let (left, outputs) = service.kill(&folder.0);
    let folder = StateFolder::open(&left.0).unwrap();
    let mut again = Vec::new();
    let look = |happenings, engine: &Engine| again.push((happenings, bits(engine.outputs())));
    let recovered = Recovered::find(
        &folder,
        &checkpoints(&folder),
        &model,
        |_| feed(&model),
        7,
        look,
    )
    .unwrap();
    assert_eq!(recovered.report.start, Start::Beginning);
    for ((happenings, bits), (nth, (_, expected))) in again.iter().zip((1..).zip(&outputs)) {
        assert_eq!((*happenings, bits), (nth, expected));
    }
    assert_eq!(again.len(), outputs.len());
}

#[test]
fn a_damaged_checkpoint_is_passed_over_for_an_older_one_and_named() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..900);
    let (left, outputs) = service.kill(&folder.0);
    let expected = engine_after(&left, &model);
    let mut files: Vec<_> = fs::read_dir(left.0.join("checkpoints"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    assert_eq!(files.len(), 3, "so many are kept");
    let mut prng = Prng::stream(3, "damage");
    let newest = files.pop().unwrap();
    let bytes = fs::read(&newest).unwrap();
    for nth in 0..300 {
        let mut damaged = bytes.clone();
        let place = (prng.uniform() * bytes.len() as f64) as usize;
        match nth % 3 {
            0 => damaged[place] ^= 1 << (nth % 8),
            1 => damaged.truncate(place),
            _ => damaged[place..].fill(0),
        }
        if damaged == bytes {
            continue;
        }
        fs::write(&newest, &damaged).unwrap();
        let (_, recovered, _) = recover(&left.0, &model);
        let [refused] = &recovered.report.refused[..] else {
            panic!("{:?}", recovered.report);
        };
        assert!(
            refused.to_string().contains(newest.to_str().unwrap()),
            "{refused}"
        );
        assert_eq!(recovered.happenings(), outputs.len() as u64);
        assert_eq!(recovered.engine.snapshot(), expected);
    }
    // Without any checkpoint the whole journal is stepped.
    fs::remove_dir_all(left.0.join("checkpoints")).unwrap();
    let (_, recovered, again) = recover(&left.0, &model);
    assert_eq!(recovered.report.start, Start::Beginning);
    assert_eq!(again, outputs);
    assert_eq!(recovered.engine.snapshot(), expected);
}

fn engine_after(folder: &Folder, model: &Model) -> Vec<u8> {
    recover(&folder.0, model).1.engine.snapshot()
}

#[test]
fn a_checkpoint_of_another_release_is_refused_with_the_reason() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..100);
    let (left, _) = service.kill(&folder.0);
    for entry in fs::read_dir(left.0.join("checkpoints")).unwrap() {
        let path = entry.unwrap().path();
        let mut bytes = fs::read(&path).unwrap();
        // Behind magic, checksum and number: the release, by its length.
        bytes[21] = b'9';
        let crc = crc32fast::hash(&bytes[12..]).to_le_bytes();
        bytes[8..12].copy_from_slice(&crc);
        fs::write(&path, &bytes).unwrap();
    }
    let (_, recovered, _) = recover(&left.0, &model);
    assert_eq!(recovered.report.start, Start::Beginning);
    let refused = recovered.report.refused[0].to_string();
    assert!(refused.contains(" is of release 9"), "{refused}");
}

#[test]
fn a_damaged_journal_is_refused_and_left_as_it_is() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..900);
    let (left, _) = service.kill(&folder.0);
    fs::remove_dir_all(left.0.join("checkpoints")).unwrap();
    let mut files: Vec<_> = fs::read_dir(left.0.join("journal"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    let mut bytes = fs::read(&files[1]).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    fs::write(&files[1], &bytes).unwrap();
    let folder = StateFolder::open(&left.0).unwrap();
    let found = Recovered::find(
        &folder,
        &checkpoints(&folder),
        &model,
        |_| feed(&model),
        0,
        |_, _| (),
    );
    let error = found.unwrap_err();
    assert!(matches!(error, RecoveryError::Journal(_)), "{error}");
    assert!(
        error.to_string().contains(" is damaged at byte "),
        "{error}"
    );
    assert_eq!(fs::read(&files[1]).unwrap(), bytes);
}

#[test]
fn a_checkpoint_ahead_of_the_journal_goes_on_and_old_samples_are_late() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..300);
    let (left, outputs) = service.kill(&folder.0);
    // As after a power cut while nothing could be journalled.
    fs::remove_dir_all(left.0.join("journal")).unwrap();
    let (kept, recovered, again) = recover(&left.0, &model);
    assert!(again.is_empty());
    let Start::Checkpoint(at) = recovered.report.start else {
        panic!("{:?}", recovered.report.start);
    };
    assert_eq!(recovered.report.ahead, at);
    let last = outputs[at as usize - 1].0;
    assert_eq!(recovered.timeline.last(), last);
    // The journal that begins now says that something is missing before it.
    let begin = recovered.begin();
    assert!(begin.after_failure);
    assert_eq!(begin.happenings, at);
    drop(kept);
    let mut service = Service::start(&left.0, &model, nth(300).0);
    service.work(300..400);
    let (left, _) = service.kill(&left.0);
    let (_, recovered, _) = recover(&left.0, &model);
    assert_eq!(recovered.report.ahead, 0);
    assert!(recovered.report.difference.is_none());
}

#[test]
fn another_graph_goes_on_from_the_state_of_the_one_that_ran() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..300);
    let (left, mut outputs) = service.kill(&folder.0);
    let file = left.0.join("next.toml");
    fs::write(&file, GRAPH.replace("\"7s\"", "\"5s\"")).unwrap();
    let next = Model::load(&file).unwrap();
    // What ran is what is found, whatever is given; to go on with another is the caller's decision.
    let (_, recovered, _) = recover(&left.0, &next);
    assert_eq!(recovered.engine.revision(), model.revision().unwrap());
    assert_eq!(recovered.model.revision(), model.revision());
    let mut service = Service::start(&left.0, &next, nth(300).0);
    let revision = next.revision().unwrap();
    service._folder.keep_model(&next, &revision).unwrap();
    // It is committed at once, and the one before comes back and goes again; what each is warmed by is another past.
    service.keeper.control().stage(&next, false).unwrap();
    service.keeper.commit().unwrap();
    service.work(300..430);
    service.keeper.rollback().unwrap();
    service.work(430..470);
    service.keeper.control().stage(&next, false).unwrap();
    service.work(470..520);
    service.keeper.commit().unwrap();
    service.work(520..700);
    let (again, after) = service.kill(&left.0);
    outputs.extend(after);
    let (_, recovered, _) = recover(&again.0, &model);
    assert_eq!(recovered.engine.revision(), revision);
    let expected = recovered.engine.snapshot();
    // Without the checkpoints each takes over again as it did, to the same bits.
    fs::remove_dir_all(again.0.join("checkpoints")).unwrap();
    let (_, recovered, stepped) = recover(&again.0, &model);
    assert_eq!(recovered.report.difference, None);
    assert_eq!(recovered.engine.snapshot(), expected);
    assert!(stepped == outputs);
    let before = model.revision().unwrap();
    assert_eq!(
        recovered.report.swaps,
        [revision.clone(), before, revision.clone()]
    );
    // Where it is not known how they took over, they do so from what the journal has, and what differs is reported.
    fs::remove_dir_all(again.0.join("checkpoints")).unwrap();
    fs::remove_dir_all(again.0.join("swaps")).unwrap();
    let (_, recovered, _) = recover(&again.0, &model);
    assert_eq!(recovered.engine.revision(), revision);
    assert!(recovered.report.difference.is_some());
}

#[test]
fn of_two_services_one_holds_the_folder_and_the_other_is_refused_with_its_number() {
    let folder = Folder::new();
    let held = StateFolder::open(&folder.0).unwrap();
    let error = StateFolder::open(&folder.0).unwrap_err();
    let FolderError::Held { by, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(*by, Some(std::process::id()));
    assert!(
        error
            .to_string()
            .contains("another service keeps its state there")
    );
    drop(held);
    StateFolder::open(&folder.0).unwrap();
}

#[test]
fn a_folder_that_cannot_be_made_is_refused() {
    let folder = Folder::new();
    let file = folder.0.join("file");
    fs::write(&file, "").unwrap();
    let error = StateFolder::open(&file).unwrap_err();
    assert!(error.to_string().starts_with("cannot write "), "{error}");
}

#[test]
fn old_files_of_the_journal_go_but_none_that_a_checkpoint_needs() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..1_500);
    let (left, outputs) = service.kill(&folder.0);
    let expected = engine_after(&left, &model);
    let folder = StateFolder::open(&left.0).unwrap();
    let nothing = Keep {
        age: Wait::from_secs(3_600),
        at_most: 1 << 30,
    };
    let needed = checkpoints(&folder).oldest().unwrap().unwrap();
    assert_eq!(retire(&folder.journal(), nothing, needed).unwrap(), 0);
    let least = Keep {
        at_most: 0,
        ..nothing
    };
    assert_eq!(retire(&folder.journal(), least, 0).unwrap(), 0);
    let gone = retire(&folder.journal(), least, needed).unwrap();
    assert!(gone > 2, "{gone}");
    drop(folder);
    let (_, recovered, _) = recover(&left.0, &model);
    assert!(matches!(recovered.report.start, Start::Checkpoint(_)));
    assert_eq!(recovered.happenings(), outputs.len() as u64);
    assert_eq!(recovered.engine.snapshot(), expected);
    // Without them it begins cold, and says so.
    fs::remove_dir_all(left.0.join("checkpoints")).unwrap();
    let (_, recovered, _) = recover(&left.0, &model);
    assert_eq!(recovered.report.start, Start::Cold);
}

#[test]
fn a_checkpoint_waits_for_the_journal() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..200);
    let all = checkpoints(&service._folder);
    let saved = all.read().unwrap();
    let newest = saved.map(|of| of.unwrap().happenings).max().unwrap_or(0);
    assert!(newest <= service.worker.keep().progress().synced_happenings());
    let (_, _, recorder) = service.worker.into_parts();
    let happenings = recorder.happenings();
    recorder.finish();
    service.keeper.finish().unwrap();
    let newest = all.read().unwrap().next();
    assert_eq!(newest.unwrap().unwrap().happenings, happenings);
    let kept = Checkpoint::of(&engine(&model), 5);
    assert_eq!(
        (kept.happenings, Some(kept.revision)),
        (5, model.revision())
    );
}

#[test]
fn the_engine_thread_allocates_nothing_in_the_steady_state() {
    let (model, folder) = (model(), Folder::new());
    let mut service = Service::start(&folder.0, &model, Moment::START);
    service.work(0..2_000);
    let samples: Vec<_> = (2_000..3_000).map(nth).collect();
    let mut ticks = 0;
    let worker = &mut service.worker;
    let counted = allocation_counter::measure(|| {
        for &(now, sample) in &samples {
            worker.pass(now, |_| ticks += 1).unwrap();
            worker.arrive(sample, now);
            worker.pass(now, |_| ticks += 1).unwrap();
        }
    });
    assert_eq!(counted.count_total, 0);
    assert!(ticks > 500, "{ticks}");
}

#[test]
fn where_nothing_happened_since_the_last_checkpoint_the_engine_thread_is_not_asked_for_one() {
    let (path, model) = (Folder::new(), model());
    let (folder, recovered, _) = recover(&path.0, &model);
    let recorder = Recorder::start(&folder.journal(), recovered.begin(), small()).unwrap();
    let progress = Arc::clone(recorder.progress());
    let live = LiveOptions {
        mirrors: false,
        ..LiveOptions::default()
    };
    let (stepper, control) = pair_from(recovered.engine, live).unwrap();
    let checkpoints = (checkpoints(&folder), folder.commits());
    let every = Wait::from_millis(1);
    let mut keeper = Keeper::new(control, checkpoints, Arc::clone(&progress), 0, every);
    let mut graph = LiveGraph::new(None, stepper, recorder);
    let is_asked = |keeper: &mut Keeper| {
        std::thread::sleep(Wait::from_millis(2));
        keeper.pump().unwrap();
        progress.desk.is_asked()
    };
    assert!(!is_asked(&mut keeper) && !is_asked(&mut keeper));
    graph.row(Instant::from_ns(1), &[20.0; 3]).unwrap();
    assert!(is_asked(&mut keeper));
    let began = std::time::Instant::now();
    while keeper.last() == 0 {
        graph.keep().sync();
        graph.rest();
        is_asked(&mut keeper);
        assert!(began.elapsed() < Wait::from_secs(10));
    }
    // What was asked for while that one was saved is of no more use.
    graph.rest();
    is_asked(&mut keeper);
    assert!(!is_asked(&mut keeper) && !is_asked(&mut keeper));
}
