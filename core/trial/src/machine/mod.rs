//! Decides what a simulated machine is to those who run it, and how it becomes known; not any machine's physics.
//!
//! Whoever brings a machine implements [`Machine`] and [`Simulation`], and makes it known with
//! [`register_machine!`](crate::register_machine): the documentation of [`Machine`] has a whole one. From then on it can be
//! simulated by its name from the command line and from the tests of graph files. [`Simulated`] is a recording of it,
//! [`ClosedLoop`] the machine under the correction of a graph.

mod change;
mod closed_loop;
mod faulty;
mod individual;
mod planned;
mod recording;
mod registry;
pub mod schedule;
mod simulation;

pub use change::{Change, ChangeError, Changing};
pub use closed_loop::ClosedLoop;
pub use faulty::Faulty;
pub use individual::{Individual, Spread, SpreadError};
pub use planned::{Announcements, plans};
pub use recording::{MachineError, Simulated};
pub use registry::{KnownMachine, facts};
pub use schedule::{Schedule, ScheduleError};
pub use simulation::{Machine, Simulation};

use std::fmt;

/// Nanoseconds in a second.
pub const SECOND_NS: i64 = 1_000_000_000;

/// One measured channel of a machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// The signal that it belongs to: `temperature` or `position`.
    pub signal: &'static str,
    /// Its name within the signal.
    pub name: &'static str,
    /// UCUM unit: `Cel` for temperatures, `nm` for positions.
    pub unit: &'static str,
    /// Decimal places of its values: the sensor's resolution is the last one.
    pub decimals: u32,
}

impl Channel {
    /// A temperature in °C, resolved to 0.1 mK.
    #[must_use]
    pub const fn temperature(name: &'static str) -> Self {
        Self {
            signal: "temperature",
            name,
            unit: "Cel",
            decimals: 4,
        }
    }

    /// The position of an axis in nm, resolved to 0.1 nm.
    #[must_use]
    pub const fn position(name: &'static str) -> Self {
        Self {
            signal: "position",
            name,
            unit: "nm",
            decimals: 1,
        }
    }

    /// Whether it is the position of an axis, which has a true drift.
    #[must_use]
    pub fn is_axis(&self) -> bool {
        self.signal == "position"
    }

    /// Its column in a table: `plate1_degC`, `Z1_nm`.
    #[must_use]
    pub fn column(&self) -> String {
        let unit = if self.unit == "Cel" {
            "degC"
        } else {
            self.unit
        };
        format!("{}_{unit}", self.name)
    }

    /// Its name in a graph: `temperature.plate1`.
    #[must_use]
    pub fn reference(&self) -> String {
        format!("{}.{}", self.signal, self.name)
    }
}

/// A quantity that a schedule sets, in °C.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint {
    /// Its name; its column in a schedule file is `{name}_degC`.
    pub name: &'static str,
    /// Its value where a schedule does not set it.
    pub default: f64,
    /// Lowest and highest value that the machine takes.
    pub range: [f64; 2],
}

/// What a simulation is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// Length of the recording in days.
    pub days: f64,
    /// Seed: the same seed gives the same rows, bit for bit, on every platform.
    pub seed: u64,
    /// Set points over time; `None` is the machine's own schedule.
    pub schedule: Option<Schedule>,
    /// Which machine of its type it is.
    pub individual: Individual,
    /// What of it becomes another, of [machines that can change](Machine::can_change).
    pub changes: Vec<Change>,
}

impl Default for Setup {
    /// Seven days of seed 1 with the machine's own schedule, as designed.
    fn default() -> Self {
        Self {
            days: 7.0,
            seed: 1,
            schedule: None,
            individual: Individual::DESIGN,
            changes: Vec::new(),
        }
    }
}

/// Why a simulation cannot start.
#[derive(Debug, Clone, PartialEq)]
pub enum SetupError {
    /// The length is not a positive number of days within [`LONGEST_DAYS`].
    Days {
        /// What was asked for.
        days: f64,
    },
    /// The machine cannot change.
    Unchanging {
        /// The machine.
        machine: &'static str,
    },
    /// The schedule sets something that the machine does not have.
    UnknownSetPoint {
        /// The machine.
        machine: &'static str,
        /// What the schedule sets.
        name: String,
        /// What the machine has.
        known: Vec<&'static str>,
    },
}

/// The longest recording: ten years.
pub const LONGEST_DAYS: f64 = 3653.0;

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Days { days } => write!(
                f,
                "a recording of {days} days: the length must be above 0 and at most {LONGEST_DAYS} days"
            ),
            Self::Unchanging { machine } => {
                write!(f, "`{machine}` cannot change: leave `change` out")
            }
            Self::UnknownSetPoint {
                machine,
                name,
                known,
            } => write!(
                f,
                "the schedule sets `{name}`, which `{machine}` does not have; it has {}",
                known.join(", ")
            ),
        }
    }
}

impl std::error::Error for SetupError {}

/// One row of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Time since the start in ns.
    pub time_ns: i64,
    /// One value per channel, in the order of [`Machine::channels`]; NaN where there is none.
    pub values: Vec<f64>,
    /// True drift per axis in nm/min over the trailing five minutes, in the order of the axes among the channels; NaN where there is none.
    pub true_drift: Vec<f64>,
}

impl Row {
    /// A row without any value, as wide as `channels`.
    #[must_use]
    pub fn empty(channels: &[Channel]) -> Self {
        let axes = channels.iter().filter(|channel| channel.is_axis()).count();
        Self {
            time_ns: 0,
            values: vec![f64::NAN; channels.len()],
            true_drift: vec![f64::NAN; axes],
        }
    }
}

/// Checks what every machine demands of a setup, and gives the number of rows `period_ns` apart.
///
/// # Errors
/// See [`Machine::start`].
pub fn rows_of(
    machine: &'static str,
    set_points: &[SetPoint],
    setup: &Setup,
    period_ns: i64,
) -> Result<u64, SetupError> {
    if !(setup.days > 0.0 && setup.days <= LONGEST_DAYS) {
        return Err(SetupError::Days { days: setup.days });
    }
    if let Some(schedule) = &setup.schedule {
        let foreign = schedule
            .names()
            .find(|name| set_points.iter().all(|known| known.name != *name));
        if let Some(name) = foreign {
            return Err(SetupError::UnknownSetPoint {
                machine,
                name: name.to_owned(),
                known: set_points.iter().map(|known| known.name).collect(),
            });
        }
    }
    let rows = setup.days * 86_400.0 * SECOND_NS as f64 / period_ns as f64;
    // A thousandth of a row is rounding of the days, not another row.
    Ok(((rows - 1e-3).ceil() as u64).max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_become_rows_whatever_their_rounding() {
        let rows = |days| {
            let setup = Setup {
                days,
                ..Setup::default()
            };
            rows_of("any", &[], &setup, 10 * SECOND_NS)
        };
        assert_eq!(rows(7.0), Ok(60_480));
        // 0.7 / 7 and 0.1 + 0.2 are not quite 0.1 and 0.3.
        assert_eq!(rows(0.7 / 7.0), Ok(864));
        assert_eq!(rows(0.1 + 0.2), Ok(2592));
        assert_eq!(rows(1e-9), Ok(1));
    }

    #[test]
    fn channels_have_the_names_of_tables_and_of_graphs() {
        let plate = Channel::temperature("plate1");
        let axis = Channel::position("Z1");
        assert_eq!(plate.column(), "plate1_degC");
        assert_eq!(axis.column(), "Z1_nm");
        assert_eq!(plate.reference(), "temperature.plate1");
        assert!(axis.is_axis() && !plate.is_axis());
    }
}
