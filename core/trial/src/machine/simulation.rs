//! Decides what the author of a machine implements: what it measures, and how it goes from row to row; not who runs it.

use super::{Channel, Row, Schedule, SetPoint, Setup, SetupError};

/// A machine that can be simulated.
///
/// A whole one, a plate that warms by a millikelvin in each second and grows with it:
///
/// ```
/// use athermal_trial::machine::{Channel, Machine, Row, SECOND_NS, SetPoint, Setup, SetupError, Simulation, rows_of};
///
/// struct Plate;
///
/// impl Machine for Plate {
///     fn name(&self) -> &'static str {
///         "plate"
///     }
///     fn summary(&self) -> &'static str {
///         "A plate that warms steadily: one axis, one temperature."
///     }
///     fn channels(&self) -> &[Channel] {
///         const { &[Channel::temperature("plate"), Channel::position("Z")] }
///     }
///     fn set_points(&self) -> &[SetPoint] {
///         &[]
///     }
///     fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
///         let rows = rows_of(self.name(), self.set_points(), setup, SECOND_NS)?;
///         Ok(Box::new(Warming { row: 0, rows }))
///     }
/// }
///
/// struct Warming {
///     row: u64,
///     rows: u64,
/// }
///
/// impl Simulation for Warming {
///     fn next(&mut self, row: &mut Row) -> bool {
///         if self.row == self.rows {
///             return false;
///         }
///         let warmer = 0.001 * self.row as f64;
///         row.time_ns = self.row as i64 * SECOND_NS;
///         row.values.copy_from_slice(&[20.0 + warmer, 1000.0 * warmer]);
///         // 1 nm a second; there is no drift over five minutes before they are over.
///         row.true_drift[0] = if self.row < 300 { f64::NAN } else { 60.0 };
///         self.row += 1;
///         true
///     }
/// }
///
/// athermal_trial::register_machine!(Plate, "plate");
/// # fn main() {
/// let plate = athermal_core::registry::find::<athermal_trial::machine::KnownMachine>("plate");
/// let plate = plate.expect("it has just been registered").machine;
/// assert_eq!(plate.channels()[1].reference(), "position.Z");
/// let mut simulation = plate.start(&Setup { days: 0.01, ..Setup::default() }).expect("it is short");
/// let mut row = Row::empty(plate.channels());
/// while simulation.next(&mut row) {}
/// assert_eq!((row.time_ns, row.true_drift[0]), (863 * SECOND_NS, 60.0));
/// # }
/// ```
pub trait Machine: Sync {
    /// Its name on the command line and in graph files, for example `die-tester`.
    fn name(&self) -> &'static str;

    /// What it is, in one line.
    fn summary(&self) -> &'static str;

    /// What it measures, in the order of the columns of a recording.
    fn channels(&self) -> &[Channel];

    /// What a schedule can set.
    fn set_points(&self) -> &[SetPoint];

    /// Its set points over time where a setup with this seed says nothing else; none where each keeps its default.
    fn schedule(&self, _seed: u64) -> Option<Schedule> {
        None
    }

    /// Whether it follows the [changes](Setup::changes) of a setup; where it does not, a setup with any is refused.
    fn can_change(&self) -> bool {
        false
    }

    /// A simulation at time 0, settled as if the machine had stood there for half a day.
    ///
    /// # Errors
    /// [`SetupError`] if the length is not positive or the schedule is another machine's.
    fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError>;
}

/// A running simulation, advanced row by row.
pub trait Simulation: Send {
    /// Advances to the next row and fills `row`, which must be as wide as the machine's channels ([`Row::empty`]). `false` at the end; `row` is then unchanged.
    fn next(&mut self, row: &mut Row) -> bool;

    /// Asks the axes for corrections in nm, in the order of the axes among the channels; NaN leaves an axis as it is.
    ///
    /// They act from now on, as far as the axes can; what is applied is written to `applied`. A machine whose axes cannot be
    /// corrected applies nothing.
    fn correct(&mut self, _asked: &[f64], applied: &mut [f64]) {
        applied.fill(0.0);
    }
}
