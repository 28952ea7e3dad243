//! The die tester under a correction that `serve` puts out: killed, begun cold, cut off from its machine, given other graphs. Its axes
//! never move faster than stated.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant as Clock};

use athermal::core::compile::Wanted;
use athermal::core::diagnostic::{Diagnostics, Sources};
use athermal::core::prng::Prng;
use athermal::serve::connector::{ConnectorError, OutRow, Outlet, Purpose, Sink, SinkWiring};
use athermal::serve::deployment::Deployment;
use athermal::serve::service::{Service, ServiceEvent, ServiceOptions};
use athermal::{Instant, Model};
use athermal_connectors::SimulationSink;
use schemars::JsonSchema;
use serde::Deserialize;

use super::Looped;
use crate::workbench::{Scratch, graph};

/// How fast an axis may move: as written, and in the unit of the correction per second.
const WRITTEN: &str = "20 nm/s";
const RATE: f64 = 0.02;
/// The machine's time from row to row.
const PERIOD_S: f64 = 10.0;
/// The farthest that the machine corrects, in the unit of the correction.
const END: f64 = 100.0;
/// The axes of a simulated machine, at the end of a line that can be cut.
#[derive(Debug, Deserialize, JsonSchema)]
struct CutLine {
    source: String,
}

athermal_serve::register_sink!(CutLine, "test_cut_line");

/// What went through a line.
#[derive(Debug, Default)]
struct Line {
    /// Whether nothing comes back through it; and whether commands get there all the same.
    is_cut: bool,
    takes: bool,
    /// The service that it belongs to: one that was killed moves nothing any more.
    session: usize,
    commands: Vec<Command>,
}

#[derive(Debug)]
struct Command {
    session: usize,
    at: Instant,
    /// What the machine said to have applied, where the service asked for that just before.
    reported: Option<Vec<f64>>,
    /// What the axes had applied when it came, and what it asks for.
    applied: Vec<f64>,
    asked: Vec<f64>,
}

fn line(source: &str) -> Arc<Mutex<Line>> {
    static LINES: OnceLock<Mutex<HashMap<String, Arc<Mutex<Line>>>>> = OnceLock::new();
    let mut lines = LINES.get_or_init(Mutex::default).lock().unwrap();
    Arc::clone(lines.entry(source.to_owned()).or_default())
}

impl Sink for CutLine {
    fn purpose(&self) -> Purpose {
        Purpose::Command
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let parameters = serde_json::json!({ "source": self.source });
        let axes: SimulationSink = serde_json::from_value(parameters).unwrap();
        let line = line(&self.source);
        let session = line.lock().unwrap().session;
        Ok(Box::new(Through {
            axes: axes.open(wiring)?,
            line,
            session,
            reported: None,
        }))
    }
}

struct Through {
    axes: Box<dyn Outlet>,
    line: Arc<Mutex<Line>>,
    session: usize,
    reported: Option<Vec<f64>>,
}

impl Outlet for Through {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        let mut line = self.line.lock().unwrap();
        let is_there = line.session == self.session && (!line.is_cut || line.takes);
        if is_there && row.outputs.iter().all(|of| of.is_finite()) {
            let command = Command {
                session: self.session,
                at: row.at,
                reported: self.reported.take(),
                applied: self.axes.applied().unwrap(),
                asked: row.outputs.to_vec(),
            };
            line.commands.push(command);
            self.axes.put(row)?;
        }
        match line.is_cut || line.session != self.session {
            true => Err(ConnectorError::new("nothing comes back")),
            false => Ok(()),
        }
    }

    fn applied(&mut self) -> Option<Vec<f64>> {
        self.reported = self.axes.applied();
        self.reported.clone()
    }
}

/// A graph that asks for far too much, with a machine of this name whose corrections pass over at the rate.
fn model(
    scratch: &Scratch,
    fitted: &Model,
    name: &str,
    factor: f64,
    by_rate: bool,
) -> (Model, Deployment) {
    let (blend, rate) = match by_rate {
        true => (String::new(), format!("rate = \"{WRITTEN}\"\n")),
        false => (format!(", blend = \"{WRITTEN}\""), String::new()),
    };
    let text = format!(
        "schema = 1\nextends = {:?}\nname = \"served\"\nruntime = {{ wait = \"0 s\", settle = \"0 s\", checkpoint = \"50ms\" }}\n\
         [nodes.boast]\ntype = \"scale\"\ninputs.signal = \"rate\"\nfactor = {factor:.1}\n\
         [nodes.compensate]\ninputs.rate = {{ from = \"boast\", max_age = \"1min\" }}\nmax_rate = \"10000 nm/min\"\nmax_slew = \"500 nm/s\"\n\
         [outputs]\ncorrection = {{ from = \"compensate\"{blend} }}\n\
         [sources.{name}]\ntype = \"simulation\"\nmachine = \"die-tester\"\nspeed = 4000\ndays = 1.0\n\
         [sinks.axes]\ntype = \"test_cut_line\"\nsource = \"{name}\"\noutputs = [\"correction\"]\nbehind = \"1min\"\n{rate}",
        graph("die-tester-control"),
    );
    let path = scratch.file(&format!("{name}.toml"), text);
    let (mut files, mut mistakes) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(&path, Wanted::default(), &mut files, &mut mistakes);
    let mut model = model.unwrap();
    model.fitted.clone_from(&fitted.fitted);
    let deployment = Deployment::read(&model.graph, &model.plan, &files, &mut mistakes);
    let deployment = deployment.filter(|_| mistakes.is_empty());
    let deployment =
        deployment.unwrap_or_else(|| panic!("{}", mistakes.render(&files, false, 100)));
    (model, deployment)
}

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq)]
enum End {
    Stopped,
    Killed,
    /// Killed, and its state with it.
    Lost,
}

/// Runs a service on a state folder for a while, with what may happen to it meanwhile.
fn session(
    fitted: &Model,
    scratch: &Scratch,
    (name, by_rate, state): (&str, bool, &Path),
    end: End,
    prng: &mut Prng,
) -> usize {
    let (model, deployment) = self::model(scratch, fitted, name, 1e5, by_rate);
    let options = ServiceOptions::new(state.to_owned());
    let (mut service, _) = Service::start(&model, deployment, &options).unwrap();
    let line = line(name);
    let came = || line.lock().unwrap().commands.len();
    let (began, before) = (Clock::now(), came());
    let least = before + 10 + prng.between(0.0, 150.0) as usize;
    let (mut asked, mut swaps, mut other) = (0, 0, 1.0);
    // A graph that is on its way has taken over before the end, however slow the machine.
    while came() < least || swaps < asked {
        for event in service.pump() {
            swaps += usize::from(matches!(event, ServiceEvent::Swap(_)));
        }
        assert!(
            began.elapsed() < Duration::from_secs(30),
            "{name}: {} of {least}",
            came()
        );
        match prng.uniform() {
            // An outage of the line, during which commands may get there all the same.
            chance if chance < 0.04 => {
                let mut of = line.lock().unwrap();
                (of.is_cut, of.takes) = (true, prng.uniform() < 0.5);
                drop(of);
                std::thread::sleep(Duration::from_micros(prng.between(1e3, 60e3) as u64));
                line.lock().unwrap().is_cut = false;
            }
            chance if chance < 0.06 => {
                other = -other;
                let factor = if other < 0.0 { -1e5 } else { 1e5 };
                let (next, _) = self::model(scratch, fitted, name, factor, by_rate);
                // One that is still on its way is not overtaken.
                let is_sent = service.stage(&next, "test").is_ok();
                asked += usize::from(is_sent && service.commit("test").is_ok());
            }
            _ => std::thread::sleep(Duration::from_millis(3)),
        }
    }
    // From here on what it does reaches nobody.
    line.lock().unwrap().session += 1;
    if end == End::Killed {
        let copy = state.with_extension("copy");
        copy_tree(state, &copy);
        service.stop().unwrap();
        std::fs::remove_dir_all(state).unwrap();
        std::fs::rename(&copy, state).unwrap();
    } else {
        service.stop().unwrap();
        if end == End::Lost {
            std::fs::remove_dir_all(state).unwrap();
        }
    }
    swaps
}

/// What a kill leaves: what is being written may have its name by now, or not.
fn copy_tree(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.file_type().is_ok_and(|of| of.is_dir()) {
            copy_tree(&entry.path(), &to);
        } else {
            let _ = std::fs::copy(entry.path(), to);
        }
    }
}

/// What a history comes to: how far the axes went, and how often a service ended, was cut off or given another graph.
#[derive(Debug, Default)]
struct History {
    farthest: f64,
    ends: usize,
    /// How often it began while an axis stood more than 1 um from zero.
    afar: usize,
    failures: usize,
    swaps: usize,
    commands: usize,
}

/// A random history of a machine, in which no axis moves faster than it may.
fn history(fitted: &Model, nth: usize) -> History {
    let scratch = Scratch::new(&format!("served-{nth}"));
    let (name, state) = (format!("served{nth}"), scratch.path("state"));
    let mut prng = Prng::stream(nth as u64, "histories");
    let mut history = History::default();
    let ends = [End::Stopped, End::Killed, End::Killed, End::Lost];
    for _ in 0..3 + (prng.uniform() * 3.0) as usize {
        let end = ends[(prng.uniform() * 4.0) as usize % 4];
        // Every other machine is bounded by the rate of its sink, the others by the blend of their output.
        let machine = (&*name, nth.is_multiple_of(2), &*state);
        history.swaps += session(fitted, &scratch, machine, end, &mut prng);
        history.ends += 1;
    }
    let line = line(&name);
    let line = line.lock().unwrap();
    history.commands = line.commands.len();
    for (nth, pair) in line.commands.windows(2).enumerate() {
        let [before, command] = pair else {
            unreachable!()
        };
        let is_first = before.session != command.session;
        // The first that is whole comes a row after the first at the latest.
        let passed = if is_first {
            PERIOD_S
        } else {
            (command.at - before.at).secs()
        };
        history.failures += usize::from(!is_first && command.reported.is_some());
        assert!(command.reported.is_some() || !is_first, "{name}: {pair:?}");
        let is_afar = |of: &Vec<f64>| of.iter().any(|applied| applied.abs() > 1.0);
        history.afar += usize::from(is_first && command.reported.as_ref().is_some_and(is_afar));
        for axis in 0..command.asked.len() {
            // After a start or a failure a command begins where the machine says that it is, else where the last one was.
            let from = command.reported.as_ref().unwrap_or(&before.asked)[axis];
            let step = (command.asked[axis] - from).abs();
            assert!(
                step <= RATE * passed + 1e-9,
                "{name}, axis {axis}: {step} um\n{pair:?}"
            );
            // The axis is nowhere but where it was commanded to, or at the end of what it can correct.
            let applied = command.applied[axis];
            let mut commanded = line.commands[..=nth].iter().rev();
            let is_there = commanded.any(|of| (of.asked[axis] - applied).abs() < 1e-9);
            let is_at_end = applied.abs() == END;
            assert!(
                is_there || is_at_end || applied == 0.0,
                "{name}, axis {axis}: {pair:?}"
            );
            history.farthest = history.farthest.max(applied.abs());
        }
    }
    history
}

#[test]
fn over_random_kills_outages_and_swaps_no_axis_moves_faster_than_its_rate() {
    let cases = if std::env::var_os("ATHERMAL_LONG").is_some() {
        100
    } else {
        8
    };
    let looped = Looped::new("die-tester", &graph("die-tester-control"), 200_000.0, 50.0);
    let (next, all) = (Mutex::new(0), Mutex::new(History::default()));
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                loop {
                    let nth = {
                        let mut next = next.lock().unwrap();
                        *next += 1;
                        *next - 1
                    };
                    if nth >= cases {
                        return;
                    }
                    let history = history(&looped.model, nth);
                    let mut all = all.lock().unwrap();
                    all.farthest = all.farthest.max(history.farthest);
                    all.ends += history.ends;
                    all.afar += history.afar;
                    all.failures += history.failures;
                    all.swaps += history.swaps;
                    all.commands += history.commands;
                }
            });
        }
    });
    let all = all.into_inner().unwrap();
    println!("{cases} histories: {all:?}");
    // Each of these would have been a step.
    assert!(all.farthest > 10.0 && all.afar > cases, "{all:?}");
    assert!(
        all.ends >= 3 * cases && all.swaps > cases / 2 && all.failures > cases / 2,
        "{all:?}"
    );
}
