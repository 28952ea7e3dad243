//! A source that hangs, and a host whose clock is not right.

use std::sync::atomic::AtomicU64;

use athermal_serve::connector::{
    ConnectorError, Inlet, LeftOut, OutRow, Outflow, Outlet, Sink, SinkWiring, Source,
    SourceWiring, Stop,
};
use athermal_serve::facts::{ChannelsFacts, Known as _, Look, metrics};
use athermal_serve::{register_sink, register_source};
use schemars::JsonSchema;
use serde::Deserialize;

use super::*;

/// A bus that gives ten samples a connection, and then hangs although it is connected.
#[derive(Debug, Deserialize, JsonSchema)]
struct Bus {
    /// After how many connections it ends.
    connections: u64,
    /// Whether it says that it lives while it hangs, and for how long it does then.
    #[serde(default)]
    lives_ms: u64,
}

register_source!(Bus, "test_bus");

struct Hanging {
    left: u64,
    lives: Wait,
    given: i64,
}

impl Source for Bus {
    fn ends(&self) -> bool {
        true
    }

    fn open(&self, _: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Hanging {
            left: self.connections,
            lives: Wait::from_millis(self.lives_ms),
            given: 0,
        }))
    }
}

impl Inlet for Hanging {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        for _ in 0..10 {
            self.given += 1;
            let at = Instant::from_ns(self.given * 100_000_000);
            out.sample(0, at, self.given as f64);
            out.sample(1, at, 20.0);
        }
        let began = Clock::now();
        while began.elapsed() < self.lives {
            out.alive();
            if !stop.wait(Wait::from_millis(20)) {
                return Ok(());
            }
        }
        self.left -= 1;
        while self.left > 0 && stop.wait(Wait::from_millis(10)) {}
        Ok(())
    }
}

const RUNTIME: &str = "[runtime]\nwait = \"20 ms\"\nsettle = \"0 s\"\n";

/// What a service reports of a bus that is silent for 300 ms, and how often it was dropped for that.
fn silences(bus: &str) -> (Folder, Vec<String>, u64) {
    let folder = Folder::new();
    let sections = format!(
        "{RUNTIME}[sources.bus]\ntype = \"test_bus\"\nsilent = \"300 ms\"\n{bus}\n[sinks.out]\n{KEPT}\n"
    );
    let service = folder.serve(&sections, &ServiceOptions::new(folder.file("state")));
    let service = service.unwrap();
    let counts = Arc::clone(&service.sources()[0].1);
    let (_, events) = serve_to_the_end(service);
    let failed = events.into_iter().filter_map(|event| match event {
        ServiceEvent::SourceFailed { error, .. } => Some(error.to_string()),
        _ => None,
    });
    let failed = failed.collect();
    (folder, failed, counts.restarts.load(Ordering::Relaxed))
}

#[test]
fn a_source_that_is_connected_and_silent_is_dropped_started_over_counted_and_reported() {
    let (folder, failed, silences) = silences("connections = 3");
    assert_eq!(silences, 2);
    let words = "connected, and silent for 300ms: the connection is dropped and made anew";
    assert_eq!(failed, [words, words]);
    assert_eq!(found(&folder.file("out.csv")).len(), 30);
}

#[test]
fn a_source_that_says_that_nothing_has_changed_is_not_silent() {
    let (folder, failed, silences) = silences("connections = 1\nlives_ms = 900");
    assert_eq!((failed.len(), silences), (0, 0));
    assert_eq!(found(&folder.file("out.csv")).len(), 10);
}

/// A plant that says how its channel is, and cannot be reached at first.
#[derive(Debug, Deserialize, JsonSchema)]
struct Plant {
    /// How often it cannot be reached.
    #[serde(default)]
    fails: u64,
    /// How its channel is.
    says: String,
}

register_source!(Plant, "test_plant");

struct Reached(u64, String);

impl Source for Plant {
    fn open(&self, _: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        Ok(Box::new(Reached(self.fails, self.says.clone())))
    }
}

impl Inlet for Reached {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        if self.0 > 0 {
            self.0 -= 1;
            return Err(ConnectorError::new("nobody is there"));
        }
        out.connected();
        out.state(0, &self.1);
        out.left_out(Some(0), LeftOut::Uncertain, 3);
        for nth in 1.. {
            out.sample(0, Instant::from_ns(nth * 10_000_000), 20.0);
            if !stop.wait(Wait::from_millis(10)) {
                break;
            }
        }
        Ok(())
    }
}

/// A log that writes whether each row says that the service is degraded, and that fails at first.
#[derive(Debug, Deserialize, JsonSchema)]
struct Witness {
    path: PathBuf,
}

register_sink!(Witness, "test_witness");

struct Witnessed(PathBuf, u64);

impl Sink for Witness {
    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        Ok(Box::new(Witnessed(wiring.folder.join(&self.path), 4)))
    }
}

impl Outlet for Witnessed {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        if self.1 > 0 {
            self.1 -= 1;
            return Err(ConnectorError::new("no room"));
        }
        let mut text = fs::read_to_string(&self.0).unwrap_or_default();
        text.push(if row.is_degraded { '1' } else { '0' });
        fs::write(&self.0, text).map_err(ConnectorError::new)
    }
}

#[test]
fn the_longest_pause_is_what_the_file_says_rows_say_when_the_service_is_degraded_and_channels_how_they_are()
 {
    let folder = Folder::new();
    let late = "waiting: BadNodeIdUnknown since 10:31";
    let sections = format!(
        "[runtime]\nwait = \"0 s\"\nsettle = \"0 s\"\n\
         [sources.here]\ntype = \"test_plant\"\nsays = \"granted 100 ms, queue 20\"\nchannels = [\"temperature.plate\"]\n\
         [sources.there]\ntype = \"test_plant\"\nsays = \"{late}\"\nfails = 40\nsilent = \"200 ms\"\nretry = \"20 ms\"\nchannels = [\"temperature.room\"]\n\
         [sinks.out]\ntype = \"test_witness\"\npath = \"rows\"\nretry = \"20 ms\"\n"
    );
    let began = Clock::now();
    let service = folder.serve(&sections, &ServiceOptions::new(folder.file("state")));
    let mut service = service.unwrap();
    let rows = || fs::read_to_string(folder.file("rows")).unwrap_or_default();
    // With pauses that double up to half a minute these would be twenty minutes.
    until("both are there", Some(&mut service), || {
        rows().ends_with("000")
    });
    assert!(
        began.elapsed() < Wait::from_secs(10),
        "{:?}",
        began.elapsed()
    );
    let rows = rows();
    assert!(rows.starts_with('1') && !rows.contains("01"), "{rows}");
    assert_eq!(service.sources()[1].1.restarts.load(Ordering::Relaxed), 40);
    assert_eq!(service.sinks()[0].1.failures.load(Ordering::Relaxed), 4);
    let facts = serde_json::to_value(ChannelsFacts::read(&Look::at(&service))).unwrap();
    let of = |nth: usize, key: &str| facts["channels"][nth][key].clone();
    assert_eq!(of(0, "state"), "granted 100 ms, queue 20");
    assert_eq!(
        (of(1, "state"), of(1, "uncertain")),
        (late.into(), 3.into())
    );
    let words = ChannelsFacts::declared().unwrap().words(&facts);
    for part in [late, "left out 3 uncertain", "granted 100 ms, queue 20"] {
        assert!(words.contains(part), "{words}");
    }
    let line = "source=\"there\",channel=\"temperature.room\",reason=\"uncertain\"} 3";
    let text = metrics(&service).text();
    assert!(text.contains(line), "{text}");
    service.stop().unwrap();
}

static ASKED: AtomicU64 = AtomicU64::new(0);

/// A host that is synchronised after a while, and whose clock is stepped from then on each time that it is looked at.
fn late_and_stepped() -> Option<Instant> {
    let asked = ASKED.fetch_add(1, Ordering::Relaxed) as i64;
    (asked > 0).then(|| Instant::from_ns(asked * 1_000_000_000_000))
}

#[test]
fn the_host_s_time_is_asked_for_until_it_is_known_and_never_again() {
    let folder = Folder::new();
    let bus = "[sources.bus]\ntype = \"test_bus\"\nconnections = 2\n";
    let sections = format!("{RUNTIME}{bus}[sinks.out]\n{KEPT}\n");
    let options = ServiceOptions {
        host_time: late_and_stepped,
        ..ServiceOptions::new(folder.file("state"))
    };
    let mut service = folder.serve(&sections, &options).unwrap();
    let mut states = Vec::new();
    let began = Clock::now();
    while began.elapsed() < Wait::from_millis(2_600) {
        states.extend(service.pump().into_iter().filter_map(|event| match event {
            ServiceEvent::HostClock { is_synchronised } => Some(is_synchronised),
            _ => None,
        }));
        std::thread::sleep(Wait::from_millis(10));
    }
    assert_eq!(states, [false, true]);
    assert_eq!(ASKED.load(Ordering::Relaxed), 2);
    assert!(service.snapshot().is_synchronised);
    service.stop().unwrap();
    assert_eq!(found(&folder.file("out.csv")).len(), 10);
    // A recording says what time it was: nobody asks the host.
    let folder = Folder::new();
    fs::write(
        folder.file("log.csv"),
        HEADER.to_owned() + &csv(&rows(1, 20)),
    )
    .unwrap();
    let sections = format!("{RUNTIME}[sources.in]\n{FOLLOWED}\n[sinks.out]\n{KEPT}\n");
    let options = ServiceOptions {
        host_time: || panic!("it is asked"),
        ..ServiceOptions::new(folder.file("state"))
    };
    folder.serve(&sections, &options).unwrap().stop().unwrap();
}
