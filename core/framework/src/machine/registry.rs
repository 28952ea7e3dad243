//! Decides how a machine becomes known and is looked up by name; not which machines there are.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::OnceLock;

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

inventory::collect!(KnownMachine);

/// There is no machine of a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownMachine {
    /// What was asked for.
    pub name: String,
    /// The machine that may have been meant.
    pub nearest: Option<&'static str>,
    /// The machines that there are.
    pub known: Vec<&'static str>,
}

impl fmt::Display for UnknownMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no machine `{}`", self.name)?;
        match self.nearest {
            Some(nearest) => write!(f, ", did you mean `{nearest}`?"),
            None if self.known.is_empty() => f.write_str("; this program has none"),
            None => write!(f, "; there are {}", self.known.join(", ")),
        }
    }
}

impl std::error::Error for UnknownMachine {}

/// All machines linked into this program, by name; of two crates that brought the same name, the first by crate name.
pub fn machines() -> &'static BTreeMap<&'static str, KnownMachine> {
    static MACHINES: OnceLock<BTreeMap<&'static str, KnownMachine>> = OnceLock::new();
    MACHINES.get_or_init(|| {
        let mut machines = BTreeMap::<_, KnownMachine>::new();
        for known in inventory::iter::<KnownMachine> {
            let first = machines.entry(known.machine.name()).or_insert(*known);
            if known.package < first.package {
                *first = *known;
            }
        }
        machines
    })
}

/// The machine of a name.
///
/// # Errors
/// When there is none: with the nearest name, and all that there are.
pub fn machine(name: &str) -> Result<KnownMachine, UnknownMachine> {
    machines().get(name).copied().ok_or_else(|| UnknownMachine {
        name: name.to_owned(),
        nearest: nearest(name, machines().keys().copied()),
        known: machines().keys().copied().collect(),
    })
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
