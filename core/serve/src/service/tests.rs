//! The engine thread as a whole.

use std::sync::Arc;
use std::sync::mpsc::channel;

use athermal_run::live::{LiveOptions, pair};
use rtrb::RingBuffer;

use super::engine_thread::{EngineThread, Sinks};
use super::frames::{SinkCounts, frames};
use super::status::Shared;
use crate::connector::{Remarks, Stamps, WiredChannel, link};
use crate::journal::{Begin, JournalOptions, Recorder};
use crate::moment::MonotonicClock;
use crate::sequencer::{Rules, Sequencer, Timeline};
use crate::tests::{Folder, feed, model, rules};
use crate::time::{Duration, Instant};
use crate::worker::Worker;

/// How often memory is asked for by an engine thread that is given so many rows and then the end, and how many rows come out.
fn allocations(rows: usize) -> (u64, u64) {
    let (model, folder) = (model(), Folder::new());
    let timeline = Timeline::new(3, 1, 0);
    let begin = Begin::new(feed(&model), String::new(), (0, 0), false, &timeline);
    let recorder = Recorder::start(&folder.0, begin, JournalOptions::default()).unwrap();
    let progress = Arc::clone(recorder.progress());
    let clock = MonotonicClock::start();
    let rules = Rules {
        wait: Duration::ZERO,
        join: Duration::ZERO,
        ..rules()
    };
    let sequencer = Sequencer::new(rules, clock.now());
    let (stepper, mut control) = pair(&model, LiveOptions::default()).unwrap();
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
            Remarks::new("it", &channel().0),
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
    let (sender, mut receiver) = frames(rows + 8, columns.len(), &counts);
    let (_orders, orders) = RingBuffer::new(8);
    let (remarks, _remarks) = RingBuffer::new(8);
    let (events, _events) = channel();
    let mut sinks = Sinks::default();
    sinks.add(sender, columns, std::thread::current());
    let thread = EngineThread {
        worker: Worker::new(sequencer, stepper, recorder),
        clock,
        sources: vec![source],
        sinks,
        orders,
        remarks,
        shared: Arc::new(Shared::new(3)),
        events,
    };
    let mut left = None;
    let counted = allocation_counter::measure(|| left = Some(thread.run()));
    control.pump();
    drop(left);
    let mut came = 0;
    while receiver.take() {
        came += 1;
    }
    (counted.count_total, came)
}

#[test]
fn the_engine_thread_asks_for_no_memory_however_long_it_runs() {
    let (few, some) = (allocations(1_000), allocations(3_000));
    assert_eq!((few.1, some.1), (1_000, 3_000));
    // What it asks for is for the start and the end.
    assert_eq!(few.0, some.0);
}
