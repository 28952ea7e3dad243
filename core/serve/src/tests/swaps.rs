//! Graphs that take over in a running service, and what a replay makes of it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::prng::Prng;
use athermal_run::live::TickView;
use athermal_run::model::Model;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{Folder, GRAPH, bits, copy_tree};
use crate::companion::{Beside, Companion};
use crate::compile::Wanted;
use crate::connector::{
    ConnectorError, Inlet, OutRow, Outflow, Outlet, Sink, SinkWiring, Source, SourceWiring, Stamps,
    Stop,
};
use crate::deployment::Deployment;
use crate::diagnostic::{Diagnostics, Sources};
use crate::folder::StatePaths;
use crate::journal::{Entry, Log, Record};
use crate::recovery::Recovered;
use crate::service::{NoAnswer, Service, ServiceError, ServiceEvent, ServiceOptions};
use crate::time::{Duration, Instant};

/// A row each millisecond, with stamps 100 ms apart.
#[derive(Debug, Deserialize, JsonSchema)]
struct Metronome {}

crate::register_source!(Metronome, "metronome");

impl Source for Metronome {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Beats(wiring)))
    }
}

struct Beats(SourceWiring);

impl Inlet for Beats {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        let after = self.0.channels[0].after;
        for nth in (1..).filter(|nth| stamp(*nth) > after) {
            let mut prng = Prng::stream(nth as u64, "metronome");
            let values: Vec<_> = self.0.channels.iter().map(|_| prng.uniform()).collect();
            if !out.row(stamp(nth), &values, stop) || !stop.wait(Wait::from_millis(1)) {
                break;
            }
        }
        Ok(())
    }
}

pub(super) fn stamp(nth: i64) -> Instant {
    Instant::from_ns(nth * 100_000_000)
}

/// A line for each tick: its number, the revision, the bits.
#[derive(Debug, Deserialize, JsonSchema)]
struct Lines {}

crate::register_sink!(Lines, "lines");

impl Sink for Lines {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let file = fs::File::options()
            .append(true)
            .create(true)
            .open(wiring.folder.join("out"));
        Ok(Box::new(LinesOut(file.map_err(ConnectorError::new)?)))
    }
}

struct LinesOut(fs::File);

impl Outlet for LinesOut {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let line = line(row.at, row.revision, row.outputs);
        self.0
            .write_all(line.as_bytes())
            .map_err(ConnectorError::new)
    }
}

/// The same, and slow.
#[derive(Debug, Deserialize, JsonSchema)]
struct SlowLines {}

crate::register_sink!(SlowLines, "slow_lines");

impl Sink for SlowLines {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Lines {}
            .open(wiring)
            .map(|lines| Box::new(Slow(lines, 0)) as _)
    }
}

struct Slow(Box<dyn Outlet>, u32);

impl Outlet for Slow {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        self.1 += 1;
        // Now and then it fails, too.
        if self.1.is_multiple_of(10_007) {
            return Err(ConnectorError::new("not now"));
        }
        if self.1.is_multiple_of(20) {
            std::thread::sleep(Wait::from_millis(1));
        }
        self.0.put(row)
    }
}

/// Rows as fast as they are taken, and then the end.
#[derive(Debug, Deserialize, JsonSchema)]
struct Burst {
    rows: i64,
}

crate::register_source!(Burst, "burst");

impl Source for Burst {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn ends(&self) -> bool {
        true
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Bursting(self.rows, wiring.channels.len())))
    }
}

struct Bursting(i64, usize);

impl Inlet for Bursting {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        for nth in 1..=self.0 {
            let values = vec![(nth % 7) as f64; self.1];
            if !out.row(stamp(nth), &values, stop) {
                break;
            }
        }
        Ok(())
    }
}

/// The outputs of an engine as the sink has them: by the columns of the graph that the machine file gave.
fn columns(engine: &crate::engine::Engine) -> Vec<f64> {
    static GIVEN: std::sync::OnceLock<Model> = std::sync::OnceLock::new();
    let given = &GIVEN.get_or_init(super::model).plan;
    let outputs = &engine.plan().outputs;
    let value = |name: &String| {
        let place = outputs.iter().position(|of| of.name == *name);
        place.map_or(f64::NAN, |place| engine.outputs()[place])
    };
    given.outputs.iter().map(|of| value(&of.name)).collect()
}

fn line(at: Instant, revision: u64, outputs: &[f64]) -> String {
    let bits: Vec<_> = super::bits(outputs)
        .iter()
        .map(|of| format!("{of:x}"))
        .collect();
    let nth = at.as_ns() / 100_000_000;
    format!("{nth} {revision:016x} {}\n", bits.join(" "))
}

/// The state folders beside whose services the companion of the tests is lit.
static LIT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// What runs beside the services of the tests.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Beacon {
    /// Whether it does anything.
    lit: bool,
    /// Whether it does not start.
    broken: bool,
}

crate::register_companion!(Beacon, "page");

impl Companion for Beacon {
    fn start(&self, beside: &Beside) -> Result<Box<dyn Send>, ConnectorError> {
        if self.broken {
            return Err(ConnectorError::new("it is broken"));
        }
        if self.lit {
            LIT.lock().unwrap().insert(beside.state.clone());
        }
        Ok(Box::new(Lit(beside.state.clone())))
    }
}

struct Lit(PathBuf);

impl Drop for Lit {
    fn drop(&mut self) {
        LIT.lock().unwrap().remove(&self.0);
    }
}

pub(super) struct Bench {
    folder: Folder,
    pub(super) sections: &'static str,
}

const MACHINE: &str = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\ncheckpoint = \"50 ms\"\n\
                       [sources.in]\ntype = \"metronome\"\n[sinks.out]\ntype = \"lines\"\n";

impl Bench {
    pub(super) fn new() -> Self {
        Self {
            folder: Folder::new(),
            sections: MACHINE,
        }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.0.join(name)
    }

    fn read(&self, graph: &str) -> (Model, Option<Deployment>, String) {
        let path = self.path("machine.toml");
        fs::write(&path, format!("{graph}{}", self.sections)).unwrap();
        let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
        let wanted = Wanted::default();
        let model = Model::load_from(&path, wanted, &mut sources, &mut mistakes).unwrap();
        let deployment = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
        let mistakes = mistakes.render(&sources, false, 100);
        (model, deployment, mistakes)
    }

    pub(super) fn start(&self, graph: &str) -> Service {
        self.try_start(graph).unwrap()
    }

    fn try_start(&self, graph: &str) -> Result<Service, ServiceError> {
        let (model, deployment, mistakes) = self.read(graph);
        let deployment = deployment.unwrap_or_else(|| panic!("{mistakes}"));
        let options = ServiceOptions {
            machine: self.path("machine.toml"),
            ..ServiceOptions::new(self.path("state"))
        };
        Service::start(&model, deployment, &options).map(|(service, _)| service)
    }

    pub(super) fn model(&self, graph: &str) -> Model {
        let path = self.path("next.toml");
        fs::write(&path, graph).unwrap();
        Model::load(&path).unwrap()
    }

    /// Revision and bits of each tick that was put out, by its number.
    pub(super) fn out(&self) -> BTreeMap<i64, String> {
        let text = fs::read_to_string(self.path("out")).unwrap_or_default();
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        let tick = |line: &str| {
            let (nth, rest) = line.split_once(' ').unwrap();
            (nth.parse().unwrap(), rest.to_owned())
        };
        whole.lines().map(tick).collect()
    }

    /// Runs until so many more ticks are out; what happened meanwhile.
    pub(super) fn more(&self, service: &mut Service, ticks: usize) -> Vec<ServiceEvent> {
        let (began, before) = (Clock::now(), self.out().len());
        let mut events = Vec::new();
        while self.out().len() < before + ticks {
            events.extend(service.pump());
            assert!(began.elapsed() < Wait::from_secs(30), "{events:?}");
            std::thread::sleep(Wait::from_millis(2));
        }
        events
    }

    /// What a kill would leave, stepped again: it has the bits that were put out.
    pub(super) fn check_replay(&self) -> usize {
        let copy = Folder::new();
        copy_tree(&self.path("state"), &copy.0);
        // What is in the journal may not be out yet, and the other way round nothing is.
        let mut again = BTreeMap::new();
        let mut look = |_: u64, engine: &crate::engine::Engine| {
            let at = engine.last().unwrap();
            let revision = u64::from_str_radix(engine.revision(), 16).unwrap();
            let line = line(at, revision, &columns(engine));
            let (nth, rest) = line.trim_end().split_once(' ').unwrap();
            again.insert(nth.parse().unwrap(), rest.to_owned());
        };
        let found = Recovered::replay(&StatePaths::new(&copy.0), 0, &mut look).unwrap();
        assert_eq!(found.unwrap().report.difference, None);
        let out = self.out();
        let both = again.iter().filter(|(nth, _)| out.contains_key(nth));
        for (nth, bits) in both.clone() {
            assert_eq!(out[nth], *bits, "tick {nth}");
        }
        both.count()
    }
}

/// With another window: its slopes are warmed by the past, all else is carried.
pub(super) fn other_windows() -> String {
    GRAPH.replace("[\"2s\", \"7s\"]", "[\"3s\", \"7s\", \"20s\"]")
}

pub(super) fn took_over(events: &[ServiceEvent]) -> Vec<String> {
    use athermal_run::live::Notice::TookOver;
    let revision = |of: &ServiceEvent| match of {
        ServiceEvent::Swap(TookOver { revision, .. }) => Some(revision.clone()),
        _ => None,
    };
    events.iter().filter_map(revision).collect()
}

fn notes(state: &Path) -> Vec<String> {
    let mut log = Log::open(&StatePaths::new(state).journal()).unwrap();
    let mut notes = Vec::new();
    while let Some(entry) = log.read().unwrap() {
        if let Entry::Record(_, Record::Note(text)) = entry {
            notes.push(text.into());
        }
    }
    notes
}

#[test]
fn a_graph_takes_over_and_is_taken_back_with_every_tick_and_a_replay_has_the_same_bits() {
    let bench = Bench::new();
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 300);
    let first = service.running().unwrap().revision.to_owned();
    let next = bench.model(&other_windows());
    let second = next.revision().unwrap();
    let staged = service.stage(&next, "uid 7").unwrap();
    assert_eq!(staged.revision(), second);
    let second_s = Duration::from_ns(1_000_000_000);
    service.shadow(second_s, 0.0, true, "uid 7").unwrap();
    // Nothing predicts a truth here, so that there is nothing to compare: what runs goes on.
    let events = bench.more(&mut service, 30);
    let refused = events
        .iter()
        .any(|of| matches!(of, ServiceEvent::NotTakenOver(_)));
    assert!(refused && service.staged().is_none(), "{events:?}");
    service.stage(&next, "uid 7").unwrap();
    bench.more(&mut service, 20);
    service.commit("uid 7").unwrap();
    assert_eq!(took_over(&bench.more(&mut service, 100)), [&*second]);
    assert!(bench.check_replay() > 300);
    service.rollback("uid 8").unwrap();
    assert_eq!(took_over(&bench.more(&mut service, 100)), [&*first]);
    service.rollback("uid 8").unwrap();
    bench.more(&mut service, 50);
    let (ended, _) = service.stop().unwrap();
    assert!(!ended.has_failed);
    assert!(bench.check_replay() > 500);
    let out = bench.out();
    let last = *out.keys().last().unwrap();
    assert!(out.keys().copied().eq(1..=last), "a tick is missing");
    let mut revisions: Vec<_> = out.values().map(|of| &of[..16]).collect();
    revisions.dedup();
    assert_eq!(revisions, [&first, &second, &first, &second]);
    let notes = notes(&bench.path("state"));
    let by = |who: &str| notes.iter().filter(|of| of.starts_with(who)).count();
    assert_eq!((by("uid 7: "), by("uid 8: ")), (6, 2), "{notes:?}");
}

#[test]
fn what_took_over_goes_on_after_a_restart_with_the_same_file_and_another_file_takes_over() {
    let bench = Bench::new();
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 100);
    let next = bench.model(&other_windows());
    service.stage(&next, "it").unwrap();
    service.commit("it").unwrap();
    bench.more(&mut service, 50);
    service.stop().unwrap();
    let mut service = bench.start(GRAPH);
    assert_eq!(took_over(&bench.more(&mut service, 50)), [""; 0]);
    assert_eq!(
        service.running().unwrap().revision,
        next.revision().unwrap()
    );
    service.stop().unwrap();
    let third = GRAPH.replace("max_age = \"3s\"", "max_age = \"4s\"");
    let mut service = bench.start(&third);
    let revision = bench.model(&third).revision().unwrap();
    assert_eq!(took_over(&bench.more(&mut service, 50)), [revision]);
    service.stop().unwrap();
    assert!(bench.check_replay() > 200);
}

#[test]
fn a_graph_that_cannot_take_over_leaves_what_runs_and_what_is_staged_as_they_are() {
    let bench = Bench::new();
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 100);
    assert!(service.commit("it").is_err() && service.rollback("it").is_err());
    assert!(service.discard("it").is_err());
    let good = bench.model(&other_windows());
    service.stage(&good, "it").unwrap();
    let more_channels = GRAPH.replace("\"chuck\"]", "\"chuck\", \"spindle\"]");
    let refused = service
        .stage(&bench.model(&more_channels), "it")
        .unwrap_err();
    assert!(
        refused.to_string().contains("temperature.spindle"),
        "{refused}"
    );
    let staged = service.staged().map(|of| of.revision().to_owned());
    assert_eq!(staged, good.revision());
    bench.more(&mut service, 50);
    service.stop().unwrap();
    let revisions: Vec<_> = bench
        .out()
        .into_values()
        .map(|of| of[..16].to_owned())
        .collect();
    assert!(revisions.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn a_service_is_asked_from_other_threads_and_one_that_has_ended_says_so() {
    let bench = Bench::new();
    let mut service = bench.start(GRAPH);
    let handle = service.handle();
    let asker = std::thread::spawn({
        let handle = handle.clone();
        move || {
            let patience = Wait::from_secs(20);
            let channels = handle.ask(patience, |service| service.channels().len());
            handle
                .ask(patience, |service| service.ask_to_end("asker"))
                .unwrap();
            channels
        }
    });
    while !service.is_over() {
        service.pump();
        std::thread::sleep(Wait::from_millis(1));
    }
    assert_eq!(asker.join().unwrap(), Ok(3));
    assert_eq!(
        handle.ask(Wait::from_millis(1), |_| ()),
        Err(NoAnswer::TooLate)
    );
    let results: Vec<_> = (0..100).map(|_| handle.ask(Wait::ZERO, |_| ())).collect();
    assert_eq!(results.last(), Some(&Err(NoAnswer::Busy)));
    service.stop().unwrap();
    assert_eq!(handle.ask(Wait::from_secs(1), |_| ()), Err(NoAnswer::Ended));
}

#[test]
fn an_observer_sees_every_tick_and_what_happens_until_it_goes() {
    /// Each tick and whether there was a replica at it, and how many events there were.
    type Seen = (Vec<(Instant, bool)>, usize);
    struct Counts(Arc<Mutex<Seen>>, Arc<AtomicBool>);
    impl crate::service::Observer for Counts {
        fn event(&mut self, _: &ServiceEvent) {
            self.0.lock().unwrap().1 += 1;
        }
        fn tick(&mut self, tick: &TickView<'_>) {
            if let Some(engine) = tick.engine {
                assert_eq!(engine.last(), Some(tick.at));
                assert_eq!(bits(engine.outputs()), bits(tick.outputs));
            }
            let tick = (tick.at, tick.engine.is_some());
            self.0.lock().unwrap().0.push(tick);
        }
        fn looks_inside(&self) -> bool {
            self.0.lock().unwrap().0.len() > 100
        }
        fn is_gone(&self) -> bool {
            self.1.load(Ordering::SeqCst)
        }
    }
    let mut bench = Bench::new();
    bench.sections = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
                      [sources.in]\ntype = \"metronome\"\n[sinks.out]\ntype = \"lines\"\n";
    let mut service = bench.start(GRAPH);
    let (seen, gone) = (Arc::default(), Arc::default());
    service.observe(Box::new(Counts(Arc::clone(&seen), Arc::clone(&gone))));
    bench.more(&mut service, 50);
    assert!(service.replica().is_none(), "nothing needs one");
    bench.more(&mut service, 120);
    service.stage(&bench.model(&other_windows()), "it").unwrap();
    bench.more(&mut service, 50);
    service.commit("it").unwrap();
    bench.more(&mut service, 50);
    gone.store(true, Ordering::SeqCst);
    service.pump();
    let count = || seen.lock().unwrap().0.len();
    let before = count();
    bench.more(&mut service, 50);
    service.stop().unwrap();
    assert_eq!(count(), before);
    let seen = seen.lock().unwrap();
    let (ticks, again): (Vec<_>, Vec<_>) = seen.0.iter().copied().unzip();
    assert!(ticks.into_iter().eq((1..=before as i64).map(stamp)));
    // Once it looks inside all is stepped again for it, and nothing before but the first ticks.
    assert!(!again[40..=100].contains(&true), "{again:?}");
    let first = 101 + again[101..].iter().position(|of| *of).unwrap();
    assert!(first < 200 && !again[first..].contains(&false), "{again:?}");
    assert!(seen.1 >= 1, "{}", seen.1);
}

#[test]
fn a_companion_runs_as_long_as_its_service_and_its_section_is_checked() {
    let mut bench = Bench::new();
    let sections = format!("{MACHINE}[page]\nlit = true\n");
    bench.sections = sections.leak();
    let service = bench.start(GRAPH);
    let is_lit = || LIT.lock().unwrap().contains(&bench.path("state"));
    assert!(is_lit());
    service.stop().unwrap();
    assert!(!is_lit());
    let sections = format!("{MACHINE}[page]\nlid = 3\n");
    bench.sections = sections.leak();
    let (_, deployment, mistakes) = bench.read(GRAPH);
    assert!(deployment.is_none());
    assert!(
        mistakes.contains("lid = 3") && mistakes.contains("lit"),
        "{mistakes}"
    );
}

#[test]
fn a_companion_that_does_not_start_ends_the_service() {
    let mut bench = Bench::new();
    let sections = format!("{MACHINE}[page]\nbroken = true\n");
    bench.sections = sections.leak();
    let error = bench.try_start(GRAPH).unwrap_err();
    assert!(error.to_string().contains("it is broken"), "{error}");
    let before = bench.out();
    std::thread::sleep(Wait::from_millis(100));
    assert_eq!(bench.out(), before, "nothing goes on");
    bench.sections = MACHINE;
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 20);
    service.stop().unwrap();
    assert!(bench.out().keys().copied().eq(1..=bench.out().len() as i64));
}

#[test]
fn what_is_asked_for_while_a_graph_is_on_its_way_is_refused_and_a_replay_has_the_same_bits() {
    let bench = Bench::new();
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 100);
    let (one, other) = (bench.model(&other_windows()), bench.model(GRAPH));
    let mut refused = 0;
    for nth in 0..20 {
        let next = if nth % 2 == 0 { &one } else { &other };
        service.stage(next, "it").unwrap();
        bench.more(&mut service, 5);
        service.commit("it").unwrap();
        // Unless the graph has taken over by now.
        refused += usize::from(service.rollback("it").is_err());
        bench.more(&mut service, 20);
    }
    assert!(refused > 5, "{refused}");
    service.stop().unwrap();
    assert!(bench.check_replay() > 500);
}
