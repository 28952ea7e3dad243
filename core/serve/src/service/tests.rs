//! The engine thread as a whole.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

use athermal_run::live::{LiveGraph, LiveOptions, pair};
use rtrb::RingBuffer;

use super::engine_thread::{EngineThread, Sinks};
use super::frames::{SinkCounts, frames};
use super::status::Shared;
use crate::bell::{Bell, Mailbox};
use crate::connector::{Remarks, Stamps, WiredChannel, link};
use crate::journal::{Begin, JournalOptions, Recorder};
use crate::moment::MonotonicClock;
use crate::sequencer::{Rules, Sequencer, Timeline};
use crate::tests::{Folder, feed, model, rules};
use crate::time::{Duration, Instant};

/// What an engine thread does that is given so many rows and then the end.
struct Work {
    /// How often it asks for memory, and how often it waits.
    allocations: u64,
    waits: u64,
    /// How many rows come out.
    rows: u64,
}

/// How often this thread has given the processor away to wait for something.
fn waits() -> u64 {
    let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
    let count = |line: &str| {
        line.strip_prefix("voluntary_ctxt_switches:")?
            .trim()
            .parse()
            .ok()
    };
    status.lines().find_map(count).unwrap()
}

fn work(rows: usize) -> Work {
    let (model, folder) = (model(), Folder::new());
    let timeline = Timeline::new(3, 1);
    let begin = Begin::new(feed(&model), String::new(), (0, 0), false, &timeline);
    let options = JournalOptions {
        queue: 8 * rows,
        ..JournalOptions::default()
    };
    let recorder = Recorder::start(&folder.0, begin, options).unwrap();
    let progress = Arc::clone(recorder.progress());
    let clock = MonotonicClock::start();
    let rules = Rules {
        wait: Duration::ZERO,
        join: Duration::ZERO,
        ..rules()
    };
    let sequencer = Sequencer::new(rules, clock.now());
    // Nobody takes in what is mirrored meanwhile, and it is not waited for.
    let live = LiveOptions {
        mirrored: 4 * rows,
        ..LiveOptions::default()
    };
    let (stepper, mut control) = pair(&model, live).unwrap();
    let wired = model.plan.sources.iter().map(|of| WiredChannel {
        mapped: None,
        unit: crate::unit::Unit::kelvin(),
        address: of.column.clone(),
        channel: of.clone(),
        conversion: None,
        after: Instant::MIN,
    });
    let wired: Vec<_> = wired.collect();
    let (mut out, source) = link(
        3 * rows + 8,
        &wired,
        &[0, 1, 2],
        Stamps::Order,
        (
            std::thread::current(),
            progress,
            Remarks::new("it", &Mailbox::new(channel().0, &Bell::here())),
        ),
    );
    out.connected();
    for nth in 0..rows {
        for channel in 0..3 {
            let at = Instant::from_ns(nth as i64 * 100_000_000);
            assert!(out.sample(channel, at, 20.0 + (nth % 7) as f64));
        }
    }
    out.end();
    let counts = Arc::<SinkCounts>::default();
    let columns: Vec<_> = model
        .plan
        .outputs
        .iter()
        .map(|of| of.name.clone())
        .collect();
    let (sender, mut receiver) = frames(rows + 8, columns.len(), true, &counts);
    let (_orders, orders) = RingBuffer::new(8);
    let (remarks, _remarks) = RingBuffer::new(8);
    let (events, _events) = channel();
    let mut sinks = Sinks::default();
    sinks.add(sender, columns, std::thread::current());
    let shared = Arc::new(Shared::new(3));
    let thread = EngineThread {
        graph: LiveGraph::new(Some(sequencer), stepper, recorder),
        clock,
        sources: vec![source],
        sinks,
        orders,
        remarks,
        shared: Arc::clone(&shared),
        events: Mailbox::new(events, &Bell::here()),
        control: Bell::here(),
    };
    // Somebody asks for its status all the time.
    let is_over = Arc::new(AtomicBool::new(false));
    let over = Arc::clone(&is_over);
    let reader = std::thread::spawn(move || {
        while !over.load(Ordering::Relaxed) {
            std::hint::black_box(shared.read());
        }
    });
    let mut left = None;
    let before = waits();
    let counted = allocation_counter::measure(|| left = Some(thread.run()));
    let waits = waits() - before;
    is_over.store(true, Ordering::Relaxed);
    reader.join().unwrap();
    control.pump();
    drop(left);
    let mut came = 0;
    while receiver.take() {
        came += 1;
    }
    Work {
        allocations: counted.count_total,
        waits,
        rows: came,
    }
}

#[test]
fn the_engine_thread_asks_for_no_memory_however_long_it_runs() {
    let (few, some) = (work(1_000), work(3_000));
    assert_eq!((few.rows, some.rows), (1_000, 3_000));
    // What it asks for is for the start and the end.
    assert_eq!(few.allocations, some.allocations);
}

#[test]
#[cfg(target_os = "linux")]
fn the_engine_thread_waits_for_nobody_in_a_burst_of_rows_while_its_status_is_read() {
    let burst = work(10_000);
    assert_eq!(burst.rows, 10_000);
    println!("10,000 rows, {} waits", burst.waits);
    // A page that is not there yet may cost one; a lock, a write or a sleep would be one for each row.
    assert!(burst.waits <= 10, "{}", burst.waits);
}
