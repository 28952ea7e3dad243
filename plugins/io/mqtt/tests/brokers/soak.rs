//! A minute of a thousand ticks a second (ten in the long mode, or as many as `ATHERMAL_SOAK` says), with swaps and outages: nothing is
//! lost that the broker kept, memory is flat, and a message is an output `wait` and a few milliseconds after it was sent, beside a bare
//! client that sleeps as long.

use std::fs;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, OnceLock};
use std::thread::{sleep, spawn};
use std::time::{Duration, Instant};

use athermal_serve::connector::{ConnectorError, OutRow, Outlet, Sink, SinkWiring};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::peer::{Peer, publish_each};
use crate::server::{Broker, Folder};
use crate::service::{Running, TOGETHER, machine};

const WAIT: Duration = Duration::from_millis(20);
const SETTLE: Duration = Duration::from_millis(500);
const PACE: Duration = Duration::from_millis(1);
/// A broker that is killed has what it saved within the last second.
const AGAIN: usize = 2_000;
/// For so long there are swaps twice a second, so that the allocator has all that hand-overs take; then one each ten seconds.
const BEGIN: Duration = Duration::from_secs(24);
/// What may come above `wait`, of a service and of a bare client.
const SLACK: Duration = Duration::from_millis(5);
/// What memory may grow by, in kB.
const GROWTH: u64 = 1024;

/// When each message was sent, when its tick was put out, and when the bare client had it: ns since the beginning.
struct Course {
    began: Instant,
    sent: Vec<AtomicU64>,
    came: Vec<AtomicU64>,
    bare: Vec<AtomicU64>,
}

static COURSE: OnceLock<Course> = OnceLock::new();
const NEVER: u64 = u64::MAX;

impl Course {
    fn new(count: usize) -> Self {
        // Written to at once, so that memory does not grow by it later.
        let never = || (0..count).map(|_| AtomicU64::new(NEVER)).collect();
        Self {
            began: Instant::now(),
            sent: never(),
            came: never(),
            bare: never(),
        }
    }

    fn note(&self, of: &[AtomicU64], nth: usize) {
        let now = self.began.elapsed().as_nanos() as u64;
        let _ = of[nth].compare_exchange(NEVER, now, Ordering::Relaxed, Ordering::Relaxed);
    }
}

/// Notes when rows come.
#[derive(Debug, Deserialize, JsonSchema)]
struct Clerk {}

athermal_serve::register_sink!(Clerk, "test_clerk");

impl Sink for Clerk {
    fn open(&self, _: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(Notes))
    }
}

struct Notes;

impl Outlet for Notes {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let course = COURSE.get().expect("it has begun");
        if !row.is_beat {
            course.note(&course.came, (row.at.as_ns() / 1_000_000 - 1) as usize);
        }
        Ok(())
    }
}

fn message(nth: usize) -> (String, String) {
    let x = nth as f64 / 1000.0;
    let (plate, room) = (20.0 + x.sin(), 21.0 + (x / 7.0).cos());
    let ms = nth + 1;
    let text = format!(
        "{{\"time\": {ms}, \"n\": {nth}, \"T\": {{\"plate\": {plate}, \"room\": {room}}}}}"
    );
    ("plant/all".to_owned(), text)
}

/// A client that does nothing but sleep for as long as the service waits.
fn bare_client(port: u16, stop: &Arc<AtomicBool>) {
    let (give, take) = channel::<(usize, Instant)>();
    spawn(move || {
        let course = COURSE.get().expect("it has begun");
        for (nth, came) in take {
            sleep((came + WAIT).saturating_duration_since(Instant::now()));
            course.note(&course.bare, nth);
        }
    });
    let stop = Arc::clone(stop);
    spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            let Ok(mut peer) = Peer::connect(port, "bare", true) else {
                sleep(Duration::from_millis(20));
                continue;
            };
            peer.subscribe("plant/all");
            while !stop.load(Ordering::Relaxed) {
                match peer.receive(Duration::from_millis(100)) {
                    Ok(Some(of)) => {
                        let text = String::from_utf8(of.payload).unwrap();
                        let number = text.split(&[':', ',']).nth(3).unwrap();
                        let _ = give.send((number.trim().parse().unwrap(), Instant::now()));
                    }
                    Ok(None) => {}
                    Err(_) => break,
                }
            }
        }
    });
}

/// What this process has in memory, in kB.
fn resident() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|of| of.starts_with("VmRSS:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// The time of which so many of a thousand are no longer.
fn quantile(sorted: &[u64], of_thousand: usize) -> Duration {
    Duration::from_nanos(sorted[(sorted.len() - 1) * of_thousand / 1000])
}

/// A graph that looks back for no longer than `retain`, since it keeps what it needs to warm up besides.
fn text(port: u16, max_age: &str) -> String {
    let max_age = format!("max_age = \"{max_age}\"");
    let mut text = machine(port, TOGETHER, "");
    for (old, new) in [
        (
            "settle = \"0 s\"",
            "settle = \"500 ms\"\njoin = \"0s\"\nretain = \"10s\"",
        ),
        (
            "type = \"csv\"\npath = \"history.csv\"",
            "type = \"test_clerk\"",
        ),
        ("[\"3s\", \"1min\"]", "[\"100ms\", \"300ms\"]"),
        ("[\"2s\", \"7s\"]", "[\"1s\", \"3s\"]"),
        ("max_age = \"1min\"", max_age.as_str()),
    ] {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    text
}

#[test]
#[ignore = "runs alone, so that its times and its memory are its own: `cargo test -p athermal-mqtt --test brokers soak -- --ignored`"]
fn a_thousand_ticks_a_second_for_a_minute_with_swaps_and_outages() {
    let minutes = match (
        std::env::var("ATHERMAL_SOAK"),
        std::env::var("ATHERMAL_LONG"),
    ) {
        (Ok(minutes), _) => minutes.parse().expect("minutes of the soak"),
        (_, Ok(long)) if long == "1" => 10,
        _ => 1,
    };
    // What it has is saved each second, and not with each message.
    let Some(mut broker) = Broker::mosquitto("autosave_interval 1\nmax_queued_messages 0\n") else {
        return;
    };
    let count = minutes * 60_000;
    let course = COURSE.get_or_init(|| Course::new(count));
    let folder = Folder::new("soak");
    let mut service = Running::start(&folder, &text(broker.port, "1min"));
    service.settle();
    service.settle();
    let stop = Arc::new(AtomicBool::new(false));
    bare_client(broker.port, &stop);
    sleep(Duration::from_millis(300));
    let publisher = {
        let (stop, port) = (Arc::clone(&stop), broker.port);
        spawn(move || {
            publish_each(
                port,
                count,
                message,
                PACE,
                AGAIN,
                &stop,
                |nth, is_answered| {
                    if !is_answered {
                        course.note(&course.sent, nth);
                    }
                },
            );
        })
    };
    let began = Instant::now();
    let (mut swaps, mut next, mut seconds) = (0, Duration::from_secs(2), 0);
    let mut memory = Vec::with_capacity(minutes * 700);
    // Each with its begin and its end, `settle` included, as `sent` has it.
    let mut outages: Vec<(u64, u64)> = Vec::new();
    let end = Duration::from_secs(60 * minutes as u64);
    let now = |course: &Course| course.began.elapsed().as_nanos() as u64;
    while began.elapsed() < end || course.came[count - 1].load(Ordering::Relaxed) == NEVER {
        assert!(
            began.elapsed() < end + Duration::from_secs(60),
            "{} came; {:#?}",
            course
                .came
                .iter()
                .filter(|of| of.load(Ordering::Relaxed) != NEVER)
                .count(),
            service.events
        );
        service.pump();
        sleep(Duration::from_millis(5));
        if began.elapsed().as_millis() as usize / 100 > memory.len() {
            memory.push(resident());
        }
        if began.elapsed() >= next && next < end {
            next += match next < BEGIN {
                true => Duration::from_millis(500),
                false => Duration::from_secs(10),
            };
            let max_age = if swaps % 2 == 0 { "50 s" } else { "1min" };
            // Without a tick since the last one, as in an outage, there is nothing to hand over.
            swaps += usize::from(service.swap(&folder, &text(broker.port, max_age)));
        }
        if began.elapsed().as_secs() == seconds {
            continue;
        }
        seconds += 1;
        // Two come before memory is looked at: each of them takes from the allocator what those after it find there.
        if matches!(seconds % 60, 8 | 16 | 38) && began.elapsed() < end {
            // A moment before the end it may be slow already.
            let from = now(course).saturating_sub(100_000_000);
            match seconds % 60 {
                8 => broker.terminate(),
                _ => broker.kill(),
            }
            sleep(Duration::from_millis(300));
            broker.start();
            service.until("that it is away", |of| !of.is_connected());
            service.until("that it is back", Running::is_connected);
            let settled = SETTLE + Duration::from_millis(500);
            outages.push((from, now(course) + settled.as_nanos() as u64));
        }
    }
    publisher.join().unwrap();
    stop.store(true, Ordering::Relaxed);
    sleep(3 * WAIT);
    let events = service.stop();

    let lost = course
        .came
        .iter()
        .filter(|of| of.load(Ordering::Relaxed) == NEVER)
        .count();
    let (mut served, mut bare) = (Vec::new(), Vec::new());
    for nth in 0..count {
        let at = |of: &[AtomicU64]| of[nth].load(Ordering::Relaxed);
        let sent = at(&course.sent);
        if outages
            .iter()
            .any(|(from, to)| (*from..*to).contains(&sent))
        {
            continue;
        }
        served.push(at(&course.came).saturating_sub(sent));
        // Where it had no connection for a moment it has no time.
        bare.extend((at(&course.bare) != NEVER).then(|| at(&course.bare).saturating_sub(sent)));
    }
    served.sort_unstable();
    bare.sort_unstable();
    // `retain` is full, and there were swaps and outages; in a long run so many that the allocator has all that they take.
    let begin = if minutes > 3 { 1800 } else { 240 };
    let at_the_end = memory.len() - 100;
    let (first, last) = memory.split_at_mut(at_the_end);
    let first = &first[begin..begin + 110];
    let before = *first.iter().max().unwrap();
    // A checkpoint is there twice for a moment, each minute: that is no growth.
    let after = *last.select_nth_unstable(50).1;
    println!(
        "{count} messages, {lost} lost, {swaps} swaps, {} outages; memory {before} kB, then {after} kB",
        outages.len()
    );
    for (name, times) in [("service", &served), ("bare client", &bare)] {
        let [p50, p99, p999] = [500, 990, 999].map(|of| quantile(times, of));
        let worst = quantile(times, 1000);
        println!(
            "{name}: {} outside of outages, p50 {p50:.2?}, p99 {p99:.2?}, p99.9 {p999:.2?}, worst {worst:.2?}",
            times.len()
        );
    }
    assert_eq!(lost, 0, "{events:#?}");
    assert_eq!(outages.len(), 3 * minutes);
    assert!(swaps >= 30 + 6 * (minutes - 1) + 3, "{swaps} swaps");
    assert!(
        !events.iter().any(|of| of.contains("gap from")),
        "{events:#?}"
    );
    assert!(served.len() > count * 7 / 10 && bare.len() > count * 7 / 10);
    assert!(
        after.saturating_sub(before) <= GROWTH,
        "{first:?}, then {last:?}"
    );
    // A machine that is in use by others wakes a bare client late too.
    let bound = (WAIT + SLACK).max(quantile(&bare, 990) + SLACK);
    let p99 = quantile(&served, 990);
    assert!(p99 <= bound, "{p99:?} is more than {bound:?}");
}
