//! Decides how a machine becomes known; not which machines there are.

use std::fmt;

use serde_json::{Value, json};

use super::Machine;
use crate::registry::{Registered, Sort};

/// A machine, as registered.
#[derive(Clone, Copy)]
pub struct KnownMachine {
    /// The machine.
    pub machine: &'static dyn Machine,
}

impl fmt::Debug for KnownMachine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.machine.name())
    }
}

impl Sort for KnownMachine {
    const ONE: &'static str = "simulated machine";
    const MANY: &'static str = "simulated machines";
}

/// What a machine measures and what a schedule can set, for programs.
#[must_use]
pub fn facts(known: &Registered<KnownMachine>) -> Value {
    let machine = known.machine;
    let channels = machine.channels().iter().map(|channel| {
        json!({ "channel": channel.reference(), "column": channel.column(), "unit": channel.unit })
    });
    let set_points = machine.set_points().iter().map(
        |what| json!({ "name": what.name, "default_degC": what.default, "range_degC": what.range }),
    );
    let (channels, set_points): (Value, Value) = (channels.collect(), set_points.collect());
    json!({
        "name": known.name,
        "summary": machine.summary(),
        "package": known.package,
        "version": known.version,
        "channels": channels,
        "set_points": set_points,
    })
}

/// Makes a machine known: a constant expression that is a [`Machine`], such as the name of a unit struct, and what
/// [`name`](Machine::name) it has.
#[macro_export]
macro_rules! register_machine {
    ($machine:expr, $name:literal) => {
        $crate::__private::list!(
            $crate::machine::KnownMachine,
            $name,
            $crate::__private::no_schema,
            $crate::machine::KnownMachine { machine: &$machine }
        );
    };
}
