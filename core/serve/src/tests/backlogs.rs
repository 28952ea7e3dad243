//! What has queued up while a service was away: it is caught up with, however much it is, and all goes on.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration as Wait, Instant as Clock};

use athermal_run::live::Notice;
use schemars::JsonSchema;
use serde::Deserialize;

use super::GRAPH;
use super::swaps::{Bench, other_windows, stamp, took_over};
use crate::connector::{ConnectorError, Inlet, Outflow, Source, SourceWiring, Stamps, Stop};
use crate::service::{Service, ServiceEvent};

/// So many rows at once, and then one each millisecond.
#[derive(Debug, Deserialize, JsonSchema)]
struct Backlog {
    rows: i64,
    /// Whether stamps are the time of day, in any order.
    of_clock: bool,
}

crate::register_source!(Backlog, "backlog");

impl Source for Backlog {
    fn stamps(&self) -> Stamps {
        match self.of_clock {
            true => Stamps::Clock,
            false => Stamps::Order,
        }
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Giving(self.rows, wiring)))
    }
}

struct Giving(i64, SourceWiring);

impl Inlet for Giving {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        let after = self.1.channels[0].after;
        for nth in (1..).filter(|nth| stamp(*nth) > after) {
            let values = vec![(nth % 7) as f64; self.1.channels.len()];
            let is_given = out.row(stamp(nth), &values, stop);
            if !is_given || nth > self.0 && !stop.wait(Wait::from_millis(1)) {
                break;
            }
        }
        Ok(())
    }
}

fn bench(rows: i64, clock: bool) -> Bench {
    let mut bench = Bench::new();
    let sections = format!(
        "[runtime]\nwait = \"0 s\"\nsettle = \"200 ms\"\ncheckpoint = \"50 ms\"\n\
         [sources.in]\ntype = \"backlog\"\nrows = {rows}\nof_clock = {clock}\n\
         [sinks.out]\ntype = \"lines\"\n"
    );
    bench.sections = sections.leak();
    bench
}

/// Pumps until something is so; all that happened meanwhile.
fn until(
    service: &mut Service,
    what: &str,
    is: impl Fn(&Service, &[ServiceEvent]) -> bool,
) -> Vec<ServiceEvent> {
    let (began, mut events) = (Clock::now(), Vec::new());
    while !is(service, &events) {
        events.extend(service.pump());
        assert!(began.elapsed() < Wait::from_secs(300), "{what}: {events:?}");
        std::thread::sleep(Wait::from_millis(5));
    }
    events
}

fn swapped_afterwards(bench: &Bench, service: &mut Service) {
    service.stage(&bench.model(&other_windows()), "it").unwrap();
    service.commit("it").unwrap();
    until(service, "the swap", |_, events| {
        !took_over(events).is_empty()
    });
    let before = service.last_checkpoint();
    until(service, "a checkpoint", |of, _| {
        of.last_checkpoint() > before
    });
}

fn caught_up(rows: i64, clock: bool) {
    let bench = bench(rows, clock);
    let mut service = bench.start(GRAPH);
    let events = until(&mut service, "all rows", |of, _| {
        of.snapshot().happenings > rows as u64
    });
    let is_missed = |of: &ServiceEvent| matches!(of, ServiceEvent::Swap(Notice::Missed { .. }));
    assert!(!events.iter().any(is_missed), "{events:?}");
    let snapshot = service.snapshot();
    assert_eq!(snapshot.hurried, 0);
    assert!(
        snapshot
            .counts
            .iter()
            .all(|of| of.late + of.twice + of.future == 0)
    );
    swapped_afterwards(&bench, &mut service);
    // A sink may be slower, and has the rest at the next start.
    until(&mut service, "all rows out", |of, _| {
        let put = of.sinks()[0].1.put.load(Ordering::Relaxed);
        put + 1_000 > of.snapshot().happenings
    });
    let (ended, _) = service.stop().unwrap();
    assert_eq!(ended.journal.lost, 0);
    let out = bench.out();
    assert!(
        out.keys().copied().eq(1..=ended.happenings as i64),
        "each row once: {} of {}",
        out.len(),
        ended.happenings
    );
    assert!(bench.check_replay() as i64 > rows);
}

#[test]
fn a_backlog_of_any_length_is_caught_up_with_and_the_graph_swapped_afterwards() {
    for clock in [false, true] {
        caught_up(5_000, clock);
        caught_up(100_000, clock);
        if std::env::var_os("ATHERMAL_LONG").is_some() {
            caught_up(1_000_000, clock);
        }
    }
}

#[test]
fn a_replica_that_was_lost_is_made_again_by_itself() {
    let bench = bench(20_000, false);
    let mut service = bench.start(GRAPH);
    // Nobody takes in what is mirrored, for longer than it is waited for.
    std::thread::sleep(Wait::from_secs(4));
    let events = until(&mut service, "the replica", |_, events| {
        let is_back = |of: &ServiceEvent| matches!(of, ServiceEvent::Swap(Notice::Mirrored));
        events.iter().any(is_back)
    });
    let is_missed = |of: &ServiceEvent| matches!(of, ServiceEvent::Swap(Notice::Missed { .. }));
    assert!(events.iter().any(is_missed), "{events:?}");
    assert!(service.running().is_some());
    swapped_afterwards(&bench, &mut service);
    service.stop().unwrap();
    // The checkpoints behind are of what ran, to the bit.
    let mut service = bench.start(GRAPH);
    bench.more(&mut service, 50);
    service.stop().unwrap();
    assert!(bench.check_replay() > 20_000);
}

/// Rows that come as fast as they are taken, to a slow sink.
const FLOOD: &str = "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\ncheckpoint = \"50 ms\"\n\
                     [sources.in]\ntype = \"burst\"\nrows = 50000\n[sinks.out]\ntype = \"slow_lines\"\n";

#[test]
fn a_slow_sink_has_every_row_of_a_flood_once_and_the_engine_does_not_wait_for_it() {
    let mut bench = Bench::new();
    bench.sections = FLOOD;
    let mut service = bench.start(GRAPH);
    let (began, mut most) = (Clock::now(), 0);
    while !service.is_over() {
        let events = service.pump();
        let is_missed = |of: &ServiceEvent| matches!(of, ServiceEvent::Swap(Notice::Missed { .. }));
        assert!(!events.iter().any(is_missed), "a tick was missed");
        let rows = bench.out().len();
        let happenings = service.snapshot().happenings;
        most = most.max(happenings.saturating_sub(rows as u64));
        assert!(began.elapsed() < Wait::from_secs(120), "{rows}");
        std::thread::sleep(Wait::from_millis(20));
    }
    let counts = Arc::clone(&service.sinks()[0].1);
    let (ended, _) = service.stop().unwrap();
    assert_eq!((ended.happenings, ended.journal.lost), (50_000, 0));
    assert_eq!(counts.dropped.load(Ordering::Relaxed), 0);
    let written = fs::read_to_string(bench.path("out")).unwrap();
    let numbers = written
        .lines()
        .map(|line| line.split_once(' ').unwrap().0.parse::<i64>().unwrap());
    assert!(numbers.eq(1..=50_000), "each once, in order");
    assert!(most > 20_000, "the sink was never far behind: {most}");
    assert_eq!(bench.check_replay(), 50_000);
}
