//! How long a sample takes through a service, from its source to the sink, beside two bare threads that sleep the same.
//!
//! `cargo bench --bench service` sends a row of a simulated die tester each millisecond, without `wait`, and prints percentiles of the
//! time from the hand-over by the source to the call of the sink. The journal is written between, and a checkpoint taken each second. It
//! also prints what the process took of the processor meanwhile and how much memory it held (Linux). `--test` sends a few.

mod die_tester;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration as Wait, Instant as Clock};

use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::document::{GraphFile, Memory, declare, load_text};
use athermal::serve::connector::{
    ConnectorError, Inlet, OutRow, Outflow, Outlet, Sink, SinkWiring, Source, SourceWiring, Stamps,
    Stop,
};
use athermal::serve::deployment::Deployment;
use athermal::serve::service::{Service, ServiceOptions};
use athermal::{Instant, Model};
use die_tester::{Tick, model, ticks};
use schemars::JsonSchema;
use serde::Deserialize;

/// How long the source sleeps between rows.
const PAUSE: Wait = Wait::from_millis(1);

/// What is sent, when each row was, and when each came.
#[derive(Debug, Default)]
struct Course {
    rows: Vec<Tick>,
    sent: Mutex<Vec<Clock>>,
    came: Mutex<Vec<(Instant, Clock)>>,
}

fn course() -> &'static OnceLock<Course> {
    static COURSE: OnceLock<Course> = OnceLock::new();
    &COURSE
}

/// Rows of the die tester, one a millisecond.
#[derive(Debug, Deserialize, JsonSchema)]
struct Metronome {}

athermal::serve::register_source!(Metronome, "metronome");

impl Source for Metronome {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn open(&self, _wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Beats))
    }
}

struct Beats;

impl Inlet for Beats {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        let course = course().get().expect("it was set");
        for (at, values) in &course.rows {
            std::thread::sleep(PAUSE);
            let mut sent = course.sent.lock().expect("nobody panicked");
            sent.push(Clock::now());
            drop(sent);
            if !out.row(*at, values, stop) {
                break;
            }
        }
        Ok(())
    }
}

/// Notes when rows come.
#[derive(Debug, Deserialize, JsonSchema)]
struct Clerk {}

athermal::serve::register_sink!(Clerk, "clerk");

impl Sink for Clerk {
    fn open(&self, _wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(Notes))
    }
}

struct Notes;

impl Outlet for Notes {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let now = Clock::now();
        let course = course().get().expect("it was set");
        let mut came = course.came.lock().expect("nobody panicked");
        came.push((row.at, now));
        Ok(())
    }
}

fn main() {
    let rows = if std::env::args().any(|of| of == "--test") {
        200
    } else {
        20_000
    };
    let model = model();
    let sent = ticks(9.0, 2).into_iter().take(rows).collect();
    let course = course().get_or_init(|| Course {
        rows: sent,
        ..Course::default()
    });
    let before = processor_s();
    serve(&model);
    let took = processor_s() - before;
    println!("processor {took:.2} s, memory at most {:.1} MB", peak_mb());
    let sent = course.sent.lock().expect("nobody panicked");
    let came = course.came.lock().expect("nobody panicked");
    assert_eq!(sent.len(), course.rows.len());
    let mut times: Vec<_> = came
        .iter()
        .filter_map(|(at, came)| {
            let nth = course.rows.binary_search_by_key(at, |row| row.0).ok()?;
            Some(*came - sent[nth])
        })
        .collect();
    println!(
        "{:<44}{:>10}{:>10}{:>10}{:>10}",
        format!("{} rows, from source to sink", times.len()),
        "p50",
        "p99",
        "p99.9",
        "worst"
    );
    print("through a service, with journal", &mut times);
    print("two bare threads that sleep the same", &mut bare(rows));
}

/// What this process has taken of the processor, in s.
fn processor_s() -> f64 {
    let all = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let rest = all.rsplit(')').next().unwrap_or_default();
    let ticks = rest.split_whitespace().skip(11).take(2);
    // A hundredth of a second each.
    ticks.filter_map(|of| of.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// The most memory that it has held, in MB.
fn peak_mb() -> f64 {
    let all = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = all.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|of| of.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
    kb.unwrap_or_default() / 1_000.0
}

fn serve(model: &Model) {
    let folder = std::env::temp_dir().join(format!("athermal-bench-{}", std::process::id()));
    let text = "schema = 1\nruntime = { wait = \"0 s\", settle = \"0 s\", checkpoint = \"1 s\" }\n\
         sources.metronome.type = \"metronome\"\nsinks.clerk.type = \"clerk\"\n";
    let (mut files, mut mistakes) = (Sources::new(), Diagnostics::new());
    let read = load_text(
        &folder,
        text.to_owned(),
        &Memory::default(),
        &mut files,
        &mut mistakes,
    );
    let said = read.and_then(|read| declare(read, &mut mistakes));
    let graph = GraphFile {
        deployment: said.expect("it has no mistake").deployment,
        ..(*model.graph).clone()
    };
    let deployment = Deployment::read(&graph, &model.plan, &files, &mut mistakes);
    let deployment = deployment.expect("it has no mistake");
    let options = ServiceOptions::new(folder.clone());
    let (mut service, _) =
        Service::start(model, deployment, &options).expect("the folder can be written");
    while !service.is_over() {
        service.pump();
        std::thread::sleep(Wait::from_millis(50));
    }
    let _ = service.stop();
    let _ = std::fs::remove_dir_all(folder);
}

/// The time from one thread to another that sleeps until it is woken, with nothing between.
fn bare(rows: usize) -> Vec<Wait> {
    let slot: Arc<(AtomicBool, Mutex<Option<Clock>>)> = Arc::default();
    let ends = Arc::clone(&slot);
    let is_over = Arc::new(AtomicBool::new(false));
    let over = Arc::clone(&is_over);
    let taker = std::thread::spawn(move || {
        let mut times = Vec::with_capacity(rows);
        // One that comes before the one before was taken is not counted.
        while !over.load(Ordering::Acquire) {
            if ends.0.swap(false, Ordering::AcqRel) {
                let sent = ends.1.lock().expect("nobody panicked").take();
                times.extend(sent.map(|sent| sent.elapsed()));
            } else {
                std::thread::park_timeout(Wait::from_millis(100));
            }
        }
        times
    });
    for _ in 0..rows {
        std::thread::sleep(PAUSE);
        *slot.1.lock().expect("nobody panicked") = Some(Clock::now());
        slot.0.store(true, Ordering::Release);
        taker.thread().unpark();
    }
    std::thread::sleep(Wait::from_millis(200));
    is_over.store(true, Ordering::Release);
    taker.join().expect("nobody panicked")
}

fn print(of: &str, times: &mut [Wait]) {
    times.sort_unstable();
    let at = |part: f64| {
        let nth = (part * times.len() as f64) as usize;
        format!(
            "{:.1} µs",
            times[nth.min(times.len() - 1)].as_secs_f64() * 1e6
        )
    };
    let [p50, p99, p999, worst] = [0.5, 0.99, 0.999, 1.0].map(at);
    println!("{of:<44}{p50:>10}{p99:>10}{p999:>10}{worst:>10}");
}
