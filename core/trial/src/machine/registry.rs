//! Decides how a machine becomes known and is looked up by name; not which machines there are.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::OnceLock;

use serde_json::{Value, json};

use super::Machine;
use crate::diagnostic::nearest;

/// A machine, as registered.
#[derive(Clone, Copy)]
pub struct KnownMachine {
    /// The machine.
    pub machine: &'static dyn Machine,
    /// The crate that brings it.
    pub package: &'static str,
    /// The version of that crate.
    pub version: &'static str,
}

impl fmt::Debug for KnownMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({} {})",
            self.machine.name(),
            self.package,
            self.version
        )
    }
}

impl KnownMachine {
    /// What it measures and what a schedule can set, for programs.
    #[must_use]
    pub fn facts(&self) -> Value {
        let machine = self.machine;
        let channels = machine.channels().iter().map(|channel| {
            json!({ "channel": channel.reference(), "column": channel.column(), "unit": channel.unit })
        });
        let set_points = machine.set_points().iter().map(
            |what| json!({ "name": what.name, "default_degC": what.default, "range_degC": what.range }),
        );
        let (channels, set_points): (Value, Value) = (channels.collect(), set_points.collect());
        json!({
            "name": machine.name(),
            "summary": machine.summary(),
            "package": self.package,
            "version": self.version,
            "channels": channels,
            "set_points": set_points,
        })
    }
}

inventory::collect!(KnownMachine);

/// A name does not stand for one machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnknownMachine {
    /// There is no machine of the name.
    None {
        /// What was asked for.
        name: String,
        /// The machine that may have been meant.
        nearest: Option<&'static str>,
        /// The machines that there are.
        known: Vec<&'static str>,
    },
    /// Several crates bring a machine of the name.
    Several {
        /// What was asked for.
        name: String,
        /// The crates.
        packages: Vec<&'static str>,
    },
}

impl fmt::Display for UnknownMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None {
                name,
                nearest,
                known,
            } => {
                write!(f, "there is no machine `{name}`")?;
                match nearest {
                    Some(nearest) => write!(f, ", did you mean `{nearest}`?"),
                    None if known.is_empty() => f.write_str("; this program has none"),
                    None => write!(f, "; there are {}", known.join(", ")),
                }
            }
            Self::Several { name, packages } => write!(
                f,
                "the machine `{name}` is in {}: leave one of these crates out of the program, or rename its machine",
                packages.join(" and in ")
            ),
        }
    }
}

impl std::error::Error for UnknownMachine {}

/// All machines linked into this program, by name; where two crates brought the same name, both.
pub fn machines() -> &'static BTreeMap<&'static str, Vec<KnownMachine>> {
    static MACHINES: OnceLock<BTreeMap<&'static str, Vec<KnownMachine>>> = OnceLock::new();
    MACHINES.get_or_init(|| by_name(inventory::iter::<KnownMachine>.into_iter().copied()))
}

fn by_name(all: impl Iterator<Item = KnownMachine>) -> BTreeMap<&'static str, Vec<KnownMachine>> {
    let mut machines = BTreeMap::<_, Vec<_>>::new();
    for known in all {
        machines
            .entry(known.machine.name())
            .or_default()
            .push(known);
    }
    for same in machines.values_mut() {
        same.sort_by_key(|known| known.package);
    }
    machines
}

/// The machine of a name.
///
/// # Errors
/// When there is none: with the nearest name, and all that there are; or several: with the crates that bring them.
pub fn machine(name: &str) -> Result<KnownMachine, UnknownMachine> {
    among(machines(), name)
}

fn among(
    machines: &BTreeMap<&'static str, Vec<KnownMachine>>,
    name: &str,
) -> Result<KnownMachine, UnknownMachine> {
    match machines.get(name).map(Vec::as_slice) {
        Some([known]) => Ok(*known),
        Some(several) => Err(UnknownMachine::Several {
            name: name.to_owned(),
            packages: several.iter().map(|known| known.package).collect(),
        }),
        None => Err(UnknownMachine::None {
            name: name.to_owned(),
            nearest: nearest(name, machines.keys().copied()),
            known: machines.keys().copied().collect(),
        }),
    }
}

/// Makes a machine known: a constant expression that is a [`Machine`], such as the name of a unit struct.
#[macro_export]
macro_rules! register_machine {
    ($machine:expr) => {
        $crate::inventory::submit! {
            $crate::machine::KnownMachine {
                machine: &$machine,
                package: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Channel, SetPoint, Setup, SetupError, Simulation};

    struct Plate;

    impl Machine for Plate {
        fn name(&self) -> &'static str {
            "plate"
        }
        fn summary(&self) -> &'static str {
            "A plate."
        }
        fn channels(&self) -> &[Channel] {
            &[]
        }
        fn set_points(&self) -> &[SetPoint] {
            &[]
        }
        fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
            Err(SetupError::Days { days: setup.days })
        }
    }

    fn brought_by(packages: &[&'static str]) -> BTreeMap<&'static str, Vec<KnownMachine>> {
        let known = |&package| KnownMachine {
            machine: &Plate,
            package,
            version: "1.0.0",
        };
        by_name(packages.iter().map(known))
    }

    #[test]
    fn a_machine_that_two_crates_bring_is_an_error_that_names_both() {
        let told = |packages: &[&'static str], name: &str| {
            among(&brought_by(packages), name).unwrap_err().to_string()
        };
        assert_eq!(
            told(&["plates-b", "plates-a"], "plate"),
            "the machine `plate` is in plates-a and in plates-b: leave one of these crates out of the program, or rename its machine"
        );
        assert_eq!(
            told(&["plates-a"], "plaet"),
            "there is no machine `plaet`, did you mean `plate`?"
        );
        assert!(among(&brought_by(&["plates-a"]), "plate").is_ok());
    }
}
