//! Sources and sinks in a whole service.

mod conformance;
mod faults;
mod kept;
mod planned;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration as Wait, Instant as Clock};

use athermal_core::compile::Wanted;
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::engine::Engine;
use athermal_core::prng::Prng;
use athermal_core::time::Instant;
use athermal_features as _;
use athermal_run::model::Model;
use athermal_serve::deployment::Deployment;
use athermal_serve::service::{Ended, Service, ServiceError, ServiceEvent, ServiceOptions};

const GRAPH: &str = r#"
schema = 1
time = { column = "time_s", unit = "s" }
signals.temperature = { unit = "Cel", channels = ["plate", "room"], max_age = "3s" }
nodes.trend = { type = "slope", inputs.signal = "temperature", windows = ["2s", "7s"] }
nodes.masses = { type = "first_order", inputs.signal = "temperature", time_constants = ["3s", "1min"] }
outputs.trend = "trend"
outputs.masses = "masses"
"#;

/// A folder of its own, which goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("athermal-connectors-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("graph.toml"), GRAPH).unwrap();
        Self(path)
    }

    fn model(&self) -> Model {
        Model::load(self.0.join("graph.toml")).unwrap()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Starts a service with the keys of its source and its sink.
    fn start(&self, source: &str, sink: &str) -> Result<Service, ServiceError> {
        // A row of a recording is whole by itself.
        let wait = if source.contains("replay") { 0 } else { 20 };
        let sections = format!(
            "[runtime]\nwait = \"{wait} ms\"\nsettle = \"0 s\"\n\
             [sources.in]\n{source}\n[sinks.out]\n{sink}\n"
        );
        self.serve(&sections, &ServiceOptions::new(self.file("state")))
    }

    /// Starts a service with these sections of its machine file.
    fn serve(&self, sections: &str, options: &ServiceOptions) -> Result<Service, ServiceError> {
        let text = format!("schema = 1\nextends = \"graph.toml\"\n{sections}");
        let path = self.file("machine.toml");
        fs::write(&path, text).unwrap();
        let (mut sources, mut mistakes) = (Sources::new(), Diagnostics::new());
        let model = Model::load_from(&path, Wanted::default(), &mut sources, &mut mistakes);
        let model = model.unwrap();
        let declared = Deployment::read(&model.graph, &model.plan, &sources, &mut mistakes);
        let declared =
            declared.unwrap_or_else(|| panic!("{}", mistakes.render(&sources, false, 100)));
        Ok(Service::start(&model, declared, options)?.0)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const FOLLOWED: &str = "type = \"csv\"\npath = \"log.csv\"";
const KEPT: &str = "type = \"csv\"\npath = \"out.csv\"";

/// Rows of a recording, some of them with holes, one after a break of an hour.
fn rows(seed: u64, count: usize) -> Vec<(i64, [f64; 2])> {
    let mut prng = Prng::stream(seed, "rows");
    let row = |nth: usize| {
        let gap = if nth > count / 2 { 3_600_000 } else { 0 };
        let hole = |value: f64, every: usize| if nth % every == 3 { f64::NAN } else { value };
        let plate = 20.0 + prng.uniform();
        let room = 21.0 + prng.uniform();
        (nth as i64 * 500 + gap, [hole(plate, 7), hole(room, 11)])
    };
    (0..count).map(row).collect()
}

const HEADER: &str = "time_s,plate,room\n";

fn csv(rows: &[(i64, [f64; 2])]) -> String {
    let cell = |value: f64| {
        if value.is_nan() {
            String::new()
        } else {
            value.to_string()
        }
    };
    let line = |(ms, values): &(i64, [f64; 2])| {
        let (seconds, ms) = (ms / 1000, ms % 1000);
        format!(
            "{seconds}.{ms:03},{},{}\n",
            cell(values[0]),
            cell(values[1])
        )
    };
    rows.iter().map(line).collect()
}

/// What the engine gives by itself.
fn expected(model: &Model, rows: &[(i64, [f64; 2])]) -> Vec<(String, Vec<u64>)> {
    let mut engine = Engine::new(Arc::clone(&model.plan), &model.fitted).unwrap();
    let step = |(ms, values): &(i64, [f64; 2])| {
        let at = Instant::from_ns(ms * 1_000_000);
        let outputs = engine.step(at, values).unwrap();
        let bits = |value: &f64| if value.is_nan() { f64::NAN } else { *value }.to_bits();
        (at.to_string(), outputs.iter().map(bits).collect())
    };
    rows.iter().map(step).collect()
}

/// What stands in a file that a sink wrote.
fn found(path: &Path) -> Vec<(String, Vec<u64>)> {
    let text = fs::read_to_string(path).unwrap_or_default();
    let row = |line: &str| {
        let mut cells = line.split(',');
        let time = cells.next().unwrap().to_owned();
        let mut values: Vec<_> = cells.collect();
        values.pop();
        let number = |cell: &&str| match *cell {
            "" => f64::NAN,
            text => text.parse().unwrap(),
        };
        (
            time,
            values.iter().map(|cell| number(cell).to_bits()).collect(),
        )
    };
    text.lines().skip(1).map(row).collect()
}

fn until(what: &str, mut service: Option<&mut Service>, mut holds: impl FnMut() -> bool) {
    let began = Clock::now();
    while !holds() {
        for event in service.iter_mut().flat_map(|of| of.pump()) {
            println!("{event:?}");
        }
        assert!(
            began.elapsed() < Wait::from_secs(20),
            "{what} takes too long"
        );
        std::thread::sleep(Wait::from_millis(2));
    }
}

fn serve_to_the_end(mut service: Service) -> (Ended, Vec<ServiceEvent>) {
    let began = Clock::now();
    let mut events = Vec::new();
    while !service.is_over() {
        events.extend(service.pump());
        assert!(began.elapsed() < Wait::from_secs(20), "{events:?}");
        std::thread::sleep(Wait::from_millis(2));
    }
    let (ended, last) = service.stop().unwrap();
    events.extend(last);
    (ended, events)
}

#[test]
fn a_recording_that_is_replayed_gives_the_bits_of_the_engine() {
    let folder = Folder::new();
    let rows = rows(1, 2_000);
    fs::write(folder.file("log.csv"), HEADER.to_owned() + &csv(&rows)).unwrap();
    let source = "type = \"replay\"\npath = \"log.csv\"\nspeed = \"fastest\"";
    let service = folder.start(source, KEPT).unwrap();
    let (ended, events) = serve_to_the_end(service);
    assert!(
        found(&folder.file("out.csv")) == expected(&folder.model(), &rows),
        "{events:?}"
    );
    assert_eq!(ended.happenings, 2_000);
    let is_late = |of: &athermal_serve::service::ChannelSamples| {
        of.left_out(athermal_serve::connector::LeftOut::Late) > 0
    };
    assert!(!ended.channels.iter().any(is_late), "no row is torn apart");
    assert_eq!(ended.journal.lost, 0);
}

#[test]
fn a_file_is_followed_as_it_grows_and_when_it_is_rotated() {
    let folder = Folder::new();
    let rows = rows(2, 300);
    let (log, out) = (folder.file("log.csv"), folder.file("out.csv"));
    let mut service = folder.start(FOLLOWED, KEPT).unwrap();
    // It is not there yet; then half a row stands in it; then it is moved away.
    fs::write(&log, HEADER.to_owned() + &csv(&rows[..100]) + "50.000,2").unwrap();
    until("the first file", Some(&mut service), || {
        found(&out).len() == 100
    });
    let whole = HEADER.to_owned() + &csv(&rows[..150]);
    fs::write(&log, whole).unwrap();
    until("its rest", Some(&mut service), || found(&out).len() >= 149);
    fs::rename(&log, folder.file("log.1.csv")).unwrap();
    fs::write(&log, HEADER.to_owned() + &csv(&rows[150..])).unwrap();
    until("the next file", Some(&mut service), || {
        found(&out).len() >= 299
    });
    let (ended, events) = service.stop().unwrap();
    assert!(
        found(&out) == expected(&folder.model(), &rows),
        "{events:?}"
    );
    assert!(!ended.has_failed);
}

#[test]
fn a_service_goes_on_where_it_was_stopped_without_a_row_twice() {
    let folder = Folder::new();
    let rows = rows(3, 900);
    let (log, out) = (folder.file("log.csv"), folder.file("out.csv"));
    for end in [300, 500, 900] {
        fs::write(&log, HEADER.to_owned() + &csv(&rows[..end])).unwrap();
        let mut service = folder.start(FOLLOWED, KEPT).unwrap();
        until("the file", Some(&mut service), || found(&out).len() >= end);
        service.stop().unwrap();
        // What a power cut left: half a row, and one that the journal does not know.
        let mut text = fs::read_to_string(&out).unwrap();
        text += "9999.5,1,2,3,4,5,6,7,8,0\n77";
        fs::write(&out, text).unwrap();
    }
    folder.start(FOLLOWED, KEPT).unwrap().stop().unwrap();
    assert!(found(&out) == expected(&folder.model(), &rows));
}
