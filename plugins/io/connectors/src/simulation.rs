//! `simulation`: a simulated machine, which takes corrections back.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use athermal_core::registry::find;
use athermal_core::time::Instant;
use athermal_core::unit::Unit;
use athermal_serve::connector::{
    ConnectorError, Inlet, OutRow, Outflow, Outlet, Purpose, Sink, SinkWiring, Source,
    SourceWiring, Stamps, Stop,
};
use athermal_serve::{register_sink, register_source};
use athermal_trial::machine::{
    Announcements, KnownMachine, Machine, Row, Setup, Simulation, plans,
};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::pace::{Pace, Speed};

/// A simulated machine, as `athermal simulate` has it. A sink of this kind hands corrections to it; what it applies are its channels
/// `applied.AXIS`. Its time begins at 0. The service ends when its days are over.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct SimulationSource {
    /// The machine, such as "die-tester": `athermal simulate` lists them.
    machine: String,
    /// How fast its time passes: 1 is as the clock on the wall, 100 a hundred times as fast, "fastest" as fast as it goes.
    #[serde(default)]
    speed: Speed,
    /// How long it goes on, in days.
    #[serde(default = "a_week")]
    days: f64,
    /// Another seed is another week of weather, motions and noise.
    #[serde(default = "one")]
    seed: u64,
}

/// The corrections of a simulated machine, one for each axis: from outputs whose channel is the axis, as `correction.Z1`.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct SimulationSink {
    /// The source of kind `simulation` that they are for.
    source: String,
}

register_source!(SimulationSource, "simulation");
register_sink!(SimulationSink, "simulation");

fn a_week() -> f64 {
    7.0
}

fn one() -> u64 {
    1
}

/// What stands between the threads of a source and a sink: the machine's axes, what is asked of them and what they apply, in nm.
#[derive(Debug, Default)]
struct Axes {
    names: Vec<&'static str>,
    asked: Vec<f64>,
    applied: Vec<f64>,
}

type SharedAxes = Arc<Mutex<Axes>>;

/// The axes of a source, by its name. A machine outlives the service that runs it.
fn axes(source: &str) -> SharedAxes {
    static ALL: OnceLock<Mutex<BTreeMap<String, SharedAxes>>> = OnceLock::new();
    let mut all = ALL
        .get_or_init(Mutex::default)
        .lock()
        .unwrap_or_else(PoisonError::into_inner);
    Arc::clone(all.entry(source.to_owned()).or_default())
}

fn with<T>(axes: &SharedAxes, work: impl FnOnce(&mut Axes) -> T) -> T {
    work(&mut axes.lock().unwrap_or_else(PoisonError::into_inner))
}

impl Source for SimulationSource {
    fn stamps(&self) -> Stamps {
        Stamps::Order
    }

    fn ends(&self) -> bool {
        true
    }

    fn open(&self, wiring: SourceWiring) -> Result<Box<dyn Inlet>, ConnectorError> {
        let known = find::<KnownMachine>(&self.machine)
            .map_err(ConnectorError::new)?
            .machine;
        let setup = Setup {
            days: self.days,
            seed: self.seed,
            ..Setup::default()
        };
        let mut simulation = known.start(&setup).map_err(ConnectorError::new)?;
        let axes = axes(&wiring.name);
        let names = known.channels().iter().filter(|of| of.is_axis());
        let names: Vec<_> = names.map(|of| of.name).collect();
        let mut applied = Vec::new();
        with(&axes, |axes| {
            if axes.names != names {
                axes.asked = vec![f64::NAN; names.len()];
                axes.applied = vec![0.0; names.len()];
                axes.names.clone_from(&names);
            }
            // Its axes stand where they stood.
            applied.clone_from(&axes.applied);
            simulation.correct(&applied, &mut axes.applied);
        });
        Ok(Box::new(MachineInlet {
            feeds: feeds(known, &setup, &names, &wiring)?,
            simulation,
            row: Row::empty(known.channels()),
            known: wiring.channels.iter().map(|of| of.after).max(),
            pace: Pace::new(self.speed),
            values: vec![f64::NAN; wiring.channels.len()],
            from_s: vec![f64::NAN; wiring.channels.len()],
            applied,
            axes,
        }))
    }
}

/// Where a channel comes from, and the units on the way.
struct Feed {
    from: Origin,
    machine: Unit,
    graph: Unit,
}

enum Origin {
    Channel(usize),
    Applied(usize),
    /// A set point, as it is announced.
    SetPoint(Box<Announcements>),
    /// From when on that of the feed of this number applies.
    AppliesAt(usize),
}

fn feeds(
    machine: &dyn Machine,
    setup: &Setup,
    axes: &[&str],
    wiring: &SourceWiring,
) -> Result<Vec<Feed>, ConnectorError> {
    let unit = |text: &str| Unit::parse(text).map_err(|of| ConnectorError::new(of.reason()));
    let channels = machine.channels();
    let feed = |wired: &athermal_serve::connector::WiredChannel| {
        let name = &wired.channel.name;
        let measured = channels.iter().position(|of| of.reference() == *name);
        let applied = name
            .strip_prefix("applied.")
            .and_then(|axis| axes.iter().position(|of| *of == axis));
        let planned = Announcements::of(machine, setup, &wired.channel);
        let (from, machine_unit) = match (measured, applied, planned) {
            (Some(nth), ..) => (Origin::Channel(nth), unit(channels[nth].unit)?),
            (None, Some(nth), _) => (Origin::Applied(nth), unit("nm")?),
            (.., Some(planned)) => (Origin::SetPoint(Box::new(planned)), unit("Cel")?),
            _ if plans(machine, &wired.channel) => {
                let planned = name.replacen(":applies_at.", ".", 1);
                let place = wiring
                    .channels
                    .iter()
                    .position(|of| of.channel.name == planned);
                (Origin::AppliesAt(place.unwrap_or(usize::MAX)), unit("s")?)
            }
            _ => {
                let known: Vec<_> = channels.iter().map(|of| of.reference()).collect();
                return Err(ConnectorError::new(format_args!(
                    "`{}` has no channel `{name}`; it has {}, and `applied.AXIS`",
                    machine.name(),
                    known.join(", ")
                )));
            }
        };
        if !machine_unit.measures_same(&wired.unit) {
            return Err(ConnectorError::new(format_args!(
                "`{name}` is in {} on the machine, and in {} in the graph",
                machine_unit.text(),
                wired.unit.text()
            )));
        }
        Ok(Feed {
            from,
            machine: machine_unit,
            graph: wired.unit.clone(),
        })
    };
    wiring.channels.iter().map(feed).collect()
}

struct MachineInlet {
    simulation: Box<dyn Simulation>,
    row: Row,
    feeds: Vec<Feed>,
    /// Up to where the service knows it.
    known: Option<Instant>,
    pace: Pace,
    values: Vec<f64>,
    /// By feed: from when on the set point of this row applies.
    from_s: Vec<f64>,
    /// What is in force while the row is measured.
    applied: Vec<f64>,
    axes: SharedAxes,
}

impl Inlet for MachineInlet {
    fn run(&mut self, out: &mut Outflow, stop: &Stop) -> Result<(), ConnectorError> {
        out.connected();
        while !stop.is_asked() && self.simulation.next(&mut self.row) {
            let at = Instant::from_ns(self.row.time_ns);
            let is_known = self.known.is_some_and(|known| at <= known);
            if !is_known && !self.pace.wait(at, stop) {
                break;
            }
            // From when on a set point applies stands behind it.
            let feeds = self.feeds.iter_mut().enumerate();
            for (value, (nth, feed)) in self.values.iter_mut().zip(feeds) {
                let measured = match &mut feed.from {
                    Origin::Channel(nth) => self.row.values[*nth],
                    Origin::Applied(nth) => self.applied[*nth],
                    Origin::SetPoint(planned) => {
                        let announced = planned.next(self.row.time_ns);
                        self.from_s[nth] = announced.map_or(f64::NAN, |(_, from_s)| from_s);
                        announced.map_or(f64::NAN, |(set_point, _)| set_point)
                    }
                    Origin::AppliesAt(of) => self.from_s.get(*of).copied().unwrap_or(f64::NAN),
                };
                let converted = feed.machine.convert(measured, &feed.graph);
                *value = converted.unwrap_or(f64::NAN);
            }
            if !is_known && !out.row(at, &self.values, stop) {
                break;
            }
            let simulation = &mut self.simulation;
            let applied = &mut self.applied;
            with(&self.axes, |axes| {
                simulation.correct(&axes.asked, &mut axes.applied);
                applied.copy_from_slice(&axes.applied);
            });
        }
        Ok(())
    }
}

impl Sink for SimulationSink {
    fn purpose(&self) -> Purpose {
        Purpose::Command
    }

    fn open(&self, wiring: SinkWiring) -> Result<Box<dyn Outlet>, ConnectorError> {
        let nm = Unit::parse("nm").map_err(|of| ConnectorError::new(of.reason()))?;
        let ask = |of: &athermal_serve::connector::WiredOutput| {
            let (_, axis) = of.name.rsplit_once('.')?;
            let unit = Unit::parse(of.unit.as_deref()?).ok()?;
            Some((axis.to_owned(), unit.factor_to(&nm)?))
        };
        let asks: Vec<_> = wiring.outputs.iter().map(ask).collect();
        if let Some(place) = asks.iter().position(Option::is_none) {
            return Err(ConnectorError::new(format_args!(
                "`{}` is no length of an axis: name outputs such as `correction`, whose channels are axes",
                wiring.outputs[place].name
            )));
        }
        Ok(Box::new(MachineOutlet {
            axes: axes(&self.source),
            asks: asks.into_iter().flatten().collect(),
        }))
    }
}

struct MachineOutlet {
    axes: SharedAxes,
    /// By output: the axis, and how many nm its unit has.
    asks: Vec<(String, f64)>,
}

impl Outlet for MachineOutlet {
    fn put(&mut self, row: &OutRow<'_>) -> Result<(), ConnectorError> {
        with(&self.axes, |axes| {
            for ((axis, factor), value) in self.asks.iter().zip(row.outputs) {
                let place = axes.names.iter().position(|of| of == axis);
                let Some(place) = place else {
                    let names = axes.names.join(", ");
                    return Err(ConnectorError::new(format_args!(
                        "the machine has no axis `{axis}`; it has {names}"
                    )));
                };
                axes.asked[place] = value * factor;
            }
            Ok(())
        })
    }

    fn applied(&mut self) -> Option<Vec<f64>> {
        with(&self.axes, |axes| {
            let applied = self.asks.iter().map(|(axis, factor)| {
                let place = axes.names.iter().position(|of| of == axis)?;
                Some(axes.applied[place] / factor)
            });
            applied.collect()
        })
    }
}
