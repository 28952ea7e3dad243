//! Decides how a simulated machine serves as a recording of a graph: channels matched by name, units converted; not what is simulated.

use std::fmt;

use super::planned::Announced;
use super::{Faulty, Machine, Row, Setup, SetupError, Simulation, plans};
use crate::compile::Plan;
use crate::fault::{FaultError, FaultSpec, Faults};
use crate::recording::{Event, Recording, Samples, Source, SourceError};
use crate::time::Instant;
use crate::unit::Unit;

/// A machine as a recording: it is simulated anew each time that the recording is opened, with the same rows.
///
/// A measured channel `temperature.plate1` of the graph is the channel of that signal and name of the machine, in the unit of the graph.
/// A planned channel `set_point.chuck` is the set point of that name, each step of the schedule announced as long before as it is known.
pub struct Simulated<'a> {
    machine: &'a dyn Machine,
    setup: Setup,
    faults: Vec<FaultSpec>,
}

impl<'a> Simulated<'a> {
    /// A recording of `machine`.
    #[must_use]
    pub fn new(machine: &'a dyn Machine, setup: Setup) -> Self {
        Self {
            machine,
            setup,
            faults: Vec::new(),
        }
    }

    /// The same with faults of the machine's sensors.
    #[must_use]
    pub fn with_faults(mut self, faults: Vec<FaultSpec>) -> Self {
        self.faults = faults;
        self
    }

    /// What the simulation is asked for.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The simulation from its start, faults included.
    ///
    /// # Errors
    /// The machine refuses the setup, or a fault does not fit the machine.
    pub fn start(&self) -> Result<Box<dyn Simulation>, MachineError> {
        if !(self.setup.changes.is_empty() || self.machine.can_change()) {
            let machine = self.machine.name();
            return Err(SetupError::Unchanging { machine }.into());
        }
        let simulation = self.machine.start(&self.setup)?;
        if self.faults.is_empty() {
            return Ok(simulation);
        }
        let units: Vec<(String, Unit)> = self
            .machine
            .channels()
            .iter()
            .map(|channel| Ok((channel.reference(), unit_of(channel.unit)?)))
            .collect::<Result<_, MachineError>>()?;
        let channels: Vec<(&str, &Unit)> = units
            .iter()
            .map(|(name, unit)| (name.as_str(), unit))
            .collect();
        let faults = self.faults.iter().map(|fault| fault.resolve(&channels));
        let faults = faults.collect::<Result<Vec<_>, _>>()?.concat();
        let faults = Faults::new(faults, channels.len(), self.setup.seed)?;
        Ok(Box::new(Faulty::new(simulation, faults)))
    }
}

impl Recording for Simulated<'_> {
    fn open(&self, plan: &Plan) -> Result<Box<dyn Source + '_>, SourceError> {
        let channels = self.machine.channels();
        let mut picks = Vec::with_capacity(plan.sources.len());
        let mut missing = Vec::new();
        let mut announced = Vec::new();
        for (source, planned) in plan.sources.iter().zip(&plan.channels) {
            let of = (picks.len(), source);
            let plan = Announced::of(self.machine, &self.setup, of, &planned.channel.unit)?;
            announced.extend(plan);
            if plans(self.machine, source) {
                picks.push(None);
                continue;
            }
            let found = channels
                .iter()
                .position(|channel| channel.reference() == source.name);
            let Some(index) = found else {
                if !source.optional {
                    missing.push(source.name.clone());
                }
                picks.push(None);
                continue;
            };
            let from = unit_of(channels[index].unit)?;
            if !from.measures_same(&planned.channel.unit) {
                return Err(Box::new(MachineError::Unit {
                    channel: source.name.clone(),
                    machine: Box::new(from),
                    graph: Box::new(planned.channel.unit.clone()),
                }));
            }
            picks.push(Some((index, from, planned.channel.unit.clone())));
        }
        if !missing.is_empty() {
            return Err(Box::new(MachineError::Missing {
                machine: self.machine.name(),
                missing,
                known: channels.iter().map(super::Channel::reference).collect(),
            }));
        }
        Ok(Box::new(Running {
            simulation: self.start()?,
            row: Row::empty(channels),
            picks,
            announced,
        }))
    }
}

pub(super) fn unit_of(text: &'static str) -> Result<Unit, MachineError> {
    Unit::parse(text).map_err(|_| MachineError::UnknownUnit { unit: text })
}

/// For each measured channel of the graph: which of the machine, its unit and the graph's.
type Picks = Vec<Option<(usize, Unit, Unit)>>;

struct Running {
    simulation: Box<dyn Simulation>,
    row: Row,
    picks: Picks,
    announced: Vec<Announced>,
}

impl Source for Running {
    fn next(&mut self, samples: &mut Samples) -> Result<Option<Event>, SourceError> {
        if !self.simulation.next(&mut self.row) {
            return Ok(None);
        }
        samples.values.resize(self.picks.len(), f64::NAN);
        for (value, pick) in samples.values.iter_mut().zip(&self.picks) {
            *value = match pick {
                None => f64::NAN,
                Some((index, from, to)) => {
                    let sample = self.row.values[*index];
                    from.convert(sample, to).unwrap_or(f64::NAN)
                }
            };
        }
        for plan in &mut self.announced {
            plan.put(self.row.time_ns, &mut samples.values);
        }
        Ok(Some(Event::Row(Instant::from_ns(self.row.time_ns))))
    }
}

/// Why a machine cannot be the recording of a graph.
#[derive(Debug, Clone, PartialEq)]
pub enum MachineError {
    /// The setup is refused.
    Setup(SetupError),
    /// A fault makes no sense for this machine.
    Fault(FaultError),
    /// The machine lacks channels that the graph measures.
    Missing {
        /// The machine.
        machine: &'static str,
        /// What the graph measures.
        missing: Vec<String>,
        /// What the machine has.
        known: Vec<String>,
    },
    /// A channel is another quantity in the machine than in the graph.
    Unit {
        /// The channel.
        channel: String,
        /// Its unit in the machine.
        machine: Box<Unit>,
        /// Its unit in the graph.
        graph: Box<Unit>,
    },
    /// The graph asks for no correction.
    NoCorrection {
        /// The axes that could be corrected.
        axes: Vec<String>,
    },
    /// The machine gives a channel a unit that there is not.
    UnknownUnit {
        /// That unit.
        unit: &'static str,
    },
}

impl From<SetupError> for MachineError {
    fn from(error: SetupError) -> Self {
        Self::Setup(error)
    }
}

impl From<FaultError> for MachineError {
    fn from(error: FaultError) -> Self {
        Self::Fault(error)
    }
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Setup(error) => error.fmt(f),
            Self::Fault(error) => error.fmt(f),
            Self::Missing {
                machine,
                missing,
                known,
            } => write!(
                f,
                "the machine `{machine}` does not measure {}; it measures {}",
                missing.join(", "),
                known.join(", ")
            ),
            Self::Unit {
                channel,
                machine,
                graph,
            } => write!(
                f,
                "the graph measures `{channel}` in {graph}, the machine in {machine}"
            ),
            Self::NoCorrection { axes } => write!(
                f,
                "the graph has no output `correction.AXIS` for any of {}; add `correction = \"NODE\"` to `[outputs]`",
                axes.join(", ")
            ),
            Self::UnknownUnit { unit } => {
                write!(f, "the machine measures in `{unit}`, which is no unit")
            }
        }
    }
}

impl std::error::Error for MachineError {}
