//! The rows of a simulated machine, by itself or under the correction of a fitted graph.

use std::ops::Deref;
use std::path::PathBuf;

use athermal_command::numbers;
use athermal_core::compile::Wanted;
use athermal_core::document::{NO_FILE, lasts};
use athermal_core::failure::Failure;
use athermal_core::registry::find;
use athermal_core::watch::{Progress, Watch};
use athermal_simulation::{Disturbance, disturbed, table_columns};
use athermal_trial::fault::FaultSpec;
use athermal_trial::machine::{
    Change, ClosedLoop, Individual, KnownMachine, Machine, Row, Schedule, Setup, Simulated,
    Simulation, Spread,
};
use clap::Args;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::asked::{all_by_text, by_text};
use crate::model::load_fitted;

/// Which machine is simulated, and how.
#[derive(Debug, Args, Deserialize, JsonSchema)]
#[group(skip)]
pub struct Simulate {
    /// The machine; all are listed when none is named
    pub machine: Option<String>,
    /// Length of the recording in days
    #[arg(
        long,
        default_value_t = a_week(),
        allow_negative_numbers = true,
        requires = "machine",
        value_parser = numbers::read::<f64>("a number of days, such as 0.5")
    )]
    #[serde(default = "a_week")]
    pub days: f64,
    /// Another seed is another week of weather, motions and noise
    #[arg(
        long,
        default_value_t = first(),
        allow_negative_numbers = true,
        requires = "machine",
        value_parser = numbers::read::<u64>("a whole number, 0 or more and below 2^64")
    )]
    #[serde(default = "first")]
    pub seed: u64,
    /// One machine of a fleet: its parameters lie around those of the design, by so much
    ///
    /// Each parameter is multiplied with exp(SPREAD n), `n` standard normal: a log-normal distribution. These are expansion, conductivity
    /// and heat capacity of each body, its skin, joints and views, the time constant of the chuck, the power of motors, and creep. Sensors of temperature
    /// have offsets of SPREAD times 0.5 K. Measures are those of the drawing. 0% is the design.
    #[arg(long, default_value = "0%", requires = "machine")]
    #[serde(default = "of_design", deserialize_with = "by_text")]
    #[schemars(with = "String")]
    pub spread: Spread,
    /// Which machine of the fleet it is; weather, motions and noise follow `--seed`
    #[arg(
        long,
        default_value_t = first(),
        allow_negative_numbers = true,
        requires = "spread",
        value_parser = numbers::read::<u64>("a whole number, 0 or more and below 2^64")
    )]
    #[serde(default = "first")]
    pub machine_seed: u64,
    /// Add the true drift of each axis as a column
    #[arg(long, requires = "machine")]
    #[serde(default)]
    pub truth: bool,
    /// Set points over time; the machine has a schedule of its own
    #[arg(long, value_name = "FILE", requires = "machine")]
    #[serde(default)]
    pub schedule: Option<PathBuf>,
    /// Let a fitted graph correct the axes; what they applied is recorded as {axis}_applied_nm
    #[arg(long, value_name = "MODEL", requires = "machine")]
    #[serde(default)]
    pub compensate: Option<PathBuf>,
    /// A fault of a sensor, or of each of a signal: CHANNEL=KIND[,from=…][,for=…][,size=…]
    #[arg(long = "fault", value_name = "SPEC", requires = "machine")]
    #[serde(default, rename = "fault", deserialize_with = "all_by_text")]
    #[schemars(with = "Vec<String>")]
    faults: Vec<FaultSpec>,
    /// The world changes: `door,from=8h,for=3h,size=3`, `lamp,size=0.6 mK/s` or `loose=SENSOR,size=0.5`
    ///
    /// While a door stands open, the air couples to all bodies so many times as strongly. A lamp heats all of a stage. A loose sensor reads
    /// so much of the room instead of its body.
    #[arg(long = "disturb", value_name = "SPEC", requires = "machine")]
    #[serde(default, rename = "disturb", deserialize_with = "all_by_text")]
    #[schemars(with = "Vec<String>")]
    disturbances: Vec<Disturbance>,
    /// The machine becomes another for good: `expansion=30%@2d`, `contact` (of joints), `load` (of motors), `season=4 K@2d..9d`
    ///
    /// `@2d` is a step two days after the start, `@2d..5d` a ramp. Comments at the beginning of a CSV file say what was changed.
    #[arg(long = "change", value_name = "SPEC", requires = "machine")]
    #[serde(default, rename = "change")]
    pub changes: Vec<Change>,
}

/// Takes a row, by its time in ns and its values.
pub type PutRow<'a> = dyn FnMut(i64, &[f64]) -> Result<(), Failure> + 'a;

/// A machine of the registry, or one whose world changes.
pub enum OneMachine {
    /// As it is known.
    Known(&'static dyn Machine),
    /// With disturbances.
    Disturbed(Box<dyn Machine>),
}

impl Deref for OneMachine {
    type Target = dyn Machine;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Known(machine) => *machine,
            Self::Disturbed(machine) => &**machine,
        }
    }
}

fn a_week() -> f64 {
    7.0
}

fn first() -> u64 {
    1
}

fn of_design() -> Spread {
    Spread::default()
}

impl Simulate {
    /// The machine.
    ///
    /// # Errors
    /// When there is none of that name, or a disturbance does not fit it.
    pub fn machine(&self) -> Result<OneMachine, Failure> {
        let name = self.machine.as_deref().unwrap_or_default();
        let machine = find::<KnownMachine>(name)
            .map_err(|error| refused(format!("{error} (`athermal simulate` lists them all)")))?
            .machine;
        let disturbed = disturbed(name, &self.disturbances).map_err(refused)?;
        Ok(disturbed.map_or(OneMachine::Known(machine), OneMachine::Disturbed))
    }

    /// What is simulated of the machine.
    ///
    /// # Errors
    /// When the schedule does not fit it.
    pub fn recording<'a>(&self, machine: &'a dyn Machine) -> Result<Simulated<'a>, Failure> {
        Ok(Simulated::new(machine, self.setup(machine)?).with_faults(self.faults.clone()))
    }

    /// The names of the columns behind the time.
    #[must_use]
    pub fn columns(&self, machine: &dyn Machine) -> Vec<String> {
        let channels = machine.channels();
        let mut columns = table_columns(channels, self.truth);
        if self.compensate.is_some() {
            let axes = channels.iter().filter(|channel| channel.is_axis());
            columns.extend(axes.map(|axis| format!("{}_applied_nm", axis.name)));
        }
        columns
    }

    /// Simulates: each row with its time in ns goes to `put`.
    ///
    /// # Errors
    /// When the schedule, a fault or the graph that corrects does not fit the machine; and those of `put`.
    pub fn rows(
        &self,
        machine: &dyn Machine,
        host: &dyn Watch,
        put: &mut PutRow<'_>,
    ) -> Result<(), Failure> {
        let recording = self.recording(machine)?;
        let engine = self.compensate.as_ref().map(|model| {
            let model = load_fitted(model, Wanted::default(), host)?;
            Ok::<_, Failure>(model.engine()?)
        });
        let engine = engine.transpose()?;
        let mut simulation = started(&recording, host)?;
        let (mut row, mut values) = (Row::empty(machine.channels()), Vec::new());
        let take = |row: &Row, values: &mut Vec<f64>| {
            values.clear();
            values.extend_from_slice(&row.values);
            values.extend(row.true_drift.iter().filter(|_| self.truth));
        };
        let Some(engine) = engine else {
            while simulation.next(&mut row) {
                take(&row, &mut values);
                put(row.time_ns, &values)?;
            }
            return Ok(());
        };
        let closed = ClosedLoop::new(machine, recording.setup(), simulation, engine);
        let mut closed = closed.map_err(refused)?;
        while closed.next(&mut row) {
            take(&row, &mut values);
            values.extend_from_slice(closed.applied());
            put(row.time_ns, &values)?;
        }
        Ok(())
    }

    /// The length, seed, schedule and individual.
    ///
    /// # Errors
    /// When the schedule cannot be read, or does not fit the machine.
    pub fn setup(&self, machine: &dyn Machine) -> Result<Setup, Failure> {
        Ok(Setup {
            days: self.days,
            seed: self.seed,
            schedule: self.schedule(machine)?,
            individual: Individual {
                spread: self.spread,
                seed: self.machine_seed,
            },
            changes: self.changes.clone(),
        })
    }

    fn schedule(&self, machine: &dyn Machine) -> Result<Option<Schedule>, Failure> {
        let Some(path) = &self.schedule else {
            return Ok(None);
        };
        // What a shell has opened for this command, as `<(…)`, comes to an end.
        let is_open = path.starts_with("/dev/fd");
        if !(is_open || lasts(path)) {
            let message = format!("--schedule {}: {NO_FILE}", path.display());
            return Err(Failure::Request(message));
        }
        let text = std::fs::read_to_string(path).map_err(|error| {
            Failure::Outside(format!("cannot read {}: {error}", path.display()))
        })?;
        let schedule = Schedule::parse(&text, machine.set_points());
        schedule.map(Some).map_err(|errors| {
            let lines = errors
                .iter()
                .map(|error| format!("{}: {error}", path.display()));
            Failure::Request(lines.collect::<Vec<_>>().join("\n  "))
        })
    }
}

/// A simulation that has begun, whose progress is followed.
///
/// # Errors
/// When a fault does not fit the machine.
pub fn started(recording: &Simulated, host: &dyn Watch) -> Result<Box<dyn Simulation>, Failure> {
    let simulation = recording.start().map_err(refused)?;
    let days = recording.setup().days;
    Ok(Box::new(Watched {
        simulation,
        // Days are counted in thousandths, since how many rows there will be is the machine's business.
        progress: host.progress_to("simulating", (days * 1000.0) as u64),
    }))
}

fn refused(error: impl ToString) -> Failure {
    Failure::Request(error.to_string())
}

/// A simulation that shows its progress.
struct Watched {
    simulation: Box<dyn Simulation>,
    progress: Box<dyn Progress>,
}

impl Simulation for Watched {
    fn next(&mut self, row: &mut Row) -> bool {
        let more = self.simulation.next(row);
        self.progress.set((row.time_ns as f64 / 86_400e6) as u64);
        more
    }

    fn correct(&mut self, asked: &[f64], applied: &mut [f64]) {
        self.simulation.correct(asked, applied);
    }
}
