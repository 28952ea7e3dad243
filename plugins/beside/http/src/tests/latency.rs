//! How long a row takes through a service, from its source to its sink, in quiet and under attack.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::time::Instant;
use athermal_serve::connector::{
    ConnectorError, Inlet, OutRow, Outflow, Outlet, Sink, SinkWiring, Source, SourceWiring, Stamps,
    Stop,
};
use athermal_serve::{register_sink, register_source};
use schemars::JsonSchema;
use serde::Deserialize;

use super::Bench;
use crate::client::Address;

/// When each row was sent, and when each came, by number.
static SENT: Mutex<Vec<Clock>> = Mutex::new(Vec::new());
static TOOK: Mutex<Vec<Wait>> = Mutex::new(Vec::new());

/// The two tests here measure in turns.
static TURN: Mutex<()> = Mutex::new(());

/// A row each so many milliseconds.
#[derive(Debug, Deserialize, JsonSchema)]
struct Pulse {
    every_ms: u64,
}

register_source!(Pulse, "pulse");

impl Source for Pulse {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Pulsing(wiring.channels.len(), self.every_ms)))
    }
}

struct Pulsing(usize, u64);

impl Inlet for Pulsing {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        let mut nth = 0_i64;
        while !stop.is_asked() {
            std::thread::sleep(Wait::from_millis(self.1));
            let values: Vec<_> = (0..self.0)
                .map(|of| 20.0 + (nth as usize * 7 + of) as f64 % 3.0)
                .collect();
            SENT.lock().unwrap().push(Clock::now());
            if !out.row(Instant::from_ns(nth * 100_000_000), &values, stop) {
                break;
            }
            nth += 1;
        }
        Ok(())
    }
}

/// Notes how long each row took.
#[derive(Debug, Deserialize, JsonSchema)]
struct Watch {}

register_sink!(Watch, "watch");

impl Sink for Watch {
    fn open(&self, _wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(Watching))
    }
}

struct Watching;

impl Outlet for Watching {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let nth = (row.at.as_ns() / 100_000_000) as usize;
        let sent = SENT.lock().unwrap()[nth];
        TOOK.lock().unwrap().push(sent.elapsed());
        Ok(())
    }
}

const MACHINE: &str = r#"
[runtime]
wait = "0 s"
settle = "0 s"
[sources.log]
type = "pulse"
every_ms = EVERY
[sinks.out]
type = "watch"
"#;

/// How long each row of so many seconds took.
fn measured(seconds: u64) -> Vec<Wait> {
    TOOK.lock().unwrap().clear();
    std::thread::sleep(Wait::from_secs(seconds));
    TOOK.lock().unwrap().clone()
}

/// The median and the 99.9th percentile.
fn figures(mut took: Vec<Wait>) -> (Wait, Wait) {
    took.sort();
    assert!(took.len() > 1_000, "{} rows", took.len());
    (took[took.len() / 2], took[took.len() * 999 / 1000])
}

/// Some that never read, and one that asks and sends rubbish without a pause, until they are to end. How much it sent.
fn attack(path: &Path, over: &AtomicBool) -> u64 {
    let deaf: Vec<_> = (0..6)
        .filter_map(|_| {
            let mut stream = UnixStream::connect(path).ok()?;
            let ask = b"GET /v1/events?channel=* HTTP/1.1\r\nHost: x\r\n\r\n";
            stream.write_all(ask).ok().map(|()| stream)
        })
        .collect();
    let mut count = 0;
    while !over.load(Ordering::Relaxed) {
        let Ok(mut stream) = UnixStream::connect(path) else {
            continue;
        };
        let text: &[u8] = match count % 3 {
            0 => b"GET /metrics HTTP/1.0\r\n\r\n",
            1 => b"POST /v1/stage HTTP/1.0\r\nContent-Length: 7\r\n\r\n{\"a\": 1",
            _ => b"\0\x01rubbish\r\n\r\n",
        };
        let _ = stream.write_all(text);
        count += 1;
        std::thread::sleep(Wait::from_millis(1));
    }
    drop(deaf);
    count
}

/// A service with a row each so many milliseconds.
fn bench(every_ms: u64) -> Bench {
    SENT.lock().unwrap().clear();
    Bench::start_with(
        super::GRAPH,
        &MACHINE.replace("EVERY", &every_ms.to_string()),
    )
}

/// Seconds of processor that this process has taken, and bytes of memory that it has.
fn taken() -> (f64, f64) {
    let read = |of: &str| std::fs::read_to_string(of).unwrap();
    let stat = read("/proc/self/stat");
    let fields: Vec<f64> = stat
        .rsplit(')')
        .next()
        .unwrap()
        .split_whitespace()
        .map(|of| of.parse().unwrap_or(0.0))
        .collect();
    let pages: f64 = read("/proc/self/statm")
        .split(' ')
        .nth(1)
        .unwrap()
        .parse()
        .unwrap();
    ((fields[11] + fields[12]) / 100.0, pages * 4096.0)
}

#[test]
fn rows_are_no_later_with_fifty_pages_open_and_one_that_reads_nothing() {
    let _turn = TURN.lock().unwrap_or_else(|of| of.into_inner());
    let bench = bench(10);
    let Address::Socket(path) = bench.address() else {
        panic!("it is a socket")
    };
    let (mut alone, mut looked_at) = (Vec::new(), Vec::new());
    let (mut costs, mut bytes) = (Vec::new(), Vec::new());
    for _ in 0..2 {
        let before = taken();
        alone.extend(measured(6));
        let between = taken();
        let over = AtomicBool::new(false);
        let open = || {
            let mut stream = UnixStream::connect(&path).unwrap();
            let ask = b"GET /v1/events?ticks=1&channel=* HTTP/1.1\r\nHost: x\r\n\r\n";
            stream.write_all(ask).unwrap();
            stream.set_nonblocking(true).unwrap();
            stream
        };
        let deaf = open();
        let read = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut pages: Vec<_> = (0..50).map(|_| open()).collect();
                let mut part = [0; 65_536];
                while !over.load(Ordering::Relaxed) {
                    for page in &mut pages {
                        read.fetch_add(page.read(&mut part).unwrap_or(0), Ordering::Relaxed);
                    }
                    std::thread::sleep(Wait::from_millis(20));
                }
            });
            looked_at.extend(measured(6));
            let after = taken();
            costs.push([(between.0 - before.0) / 6.0, (after.0 - between.0) / 6.0]);
            bytes.push([between.1, after.1]);
            over.store(true, Ordering::Relaxed);
        });
        drop(deaf);
        assert!(
            read.load(Ordering::Relaxed) > 50 * 100_000,
            "{read:?} bytes were read"
        );
    }
    let (alone, looked_at) = (figures(alone), figures(looked_at));
    println!("median and 99.9 %: {alone:?} alone, {looked_at:?} with 51 streams at 100 Hz");
    println!(
        "cores without and with them, readers too: {costs:.2?}; MB: {:.1?}",
        bytes
            .iter()
            .map(|of| of.map(|of| of / 1e6))
            .collect::<Vec<_>>()
    );
    let limit = 3 * alone.1 + Wait::from_millis(10);
    assert!(looked_at.1 < limit, "{looked_at:?} against {alone:?}");
    assert!(
        bytes.iter().all(|[without, with]| with - without < 64e6),
        "{bytes:?}"
    );
}

#[test]
fn rows_are_no_later_under_attack() {
    let is_long = std::env::var_os("ATHERMAL_LONG").is_some();
    let _turn = TURN.lock().unwrap_or_else(|of| of.into_inner());
    let bench = bench(2);
    let Address::Socket(path) = bench.address() else {
        panic!("it is a socket")
    };
    // In turns, so that what else the host does falls on both.
    let (mut quiet, mut attacked, mut count) = (Vec::new(), Vec::new(), 0);
    for _ in 0..if is_long { 20 } else { 2 } {
        quiet.extend(measured(2));
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let attacker = scope.spawn(|| attack(&path, &over));
            attacked.extend(measured(2));
            over.store(true, Ordering::Relaxed);
            count += attacker.join().unwrap();
        });
    }
    let (quiet, attacked) = (figures(quiet), figures(attacked));
    println!("median and 99.9 %: {quiet:?} in quiet, {attacked:?} under {count} requests");
    assert!(count > 500, "{count} requests");
    // Two shared cores are noisy: what must not be is a row that waits for a listener.
    let limit = 3 * quiet.1 + Wait::from_millis(10);
    assert!(attacked.1 < limit, "{attacked:?} against {quiet:?}");
}
