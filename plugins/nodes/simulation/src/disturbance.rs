//! A world that changes after the fit: what can be disturbed on a machine, and when. Decides how that is written, not what heat does.

use std::fmt;
use std::str::FromStr;

use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_trial::machine::{Change, Changing, Channel, Machine};

use crate::bar::Bar;
use crate::{DieTester, LinearAxis};

/// What is another than it was while the machine was learned.
#[derive(Debug, Clone, PartialEq)]
enum Kind {
    /// The air couples to all bodies so many times as strongly.
    Door(f64),
    /// A source of heat in all cells of the first stage, in K/s.
    Lamp(f64),
    /// The sensor of that name reads so much of the room instead of its body.
    Loose(String, f64),
}

/// Something that changes for a while: on the command line `door,from=8h,for=3h,size=3`, `lamp,from=15h,for=3h,size=0.6 mK/s` or
/// `loose=holder1,from=24h,for=3h,size=0.5`. Without `from` it is so from the start, without `for` to the end.
#[derive(Debug, Clone, PartialEq)]
pub struct Disturbance {
    kind: Kind,
    from_ns: i64,
    until_ns: i64,
}

const FORMS: &str = "expected `door,size=3` (how many times as strongly the air couples, 0.1 to 10), `lamp,size=0.6 mK/s` (at most 10 mK/s) or \
                     `loose=SENSOR,size=0.5` (how much of the room it reads, 0 to 1), with `from` and `for` as in `from=8h,for=3h`";

impl FromStr for Disturbance {
    type Err = DisturbanceError;

    fn from_str(text: &str) -> Result<Self, DisturbanceError> {
        let mut parts = text.split(',').map(str::trim);
        let (kind, sensor) = two(parts.next().unwrap_or_default());
        let (mut from, mut lasting, mut size) = (Duration::ZERO, None, "");
        for part in parts {
            let span = |value: &str| match value.parse::<Duration>() {
                Ok(span) if span < Duration::ZERO => Err(wrong(part, "is before the start")),
                Ok(span) => Ok(span),
                Err(error) => Err(wrong(part, error)),
            };
            match two(part) {
                ("from", value) => from = span(value)?,
                ("for", value) => lasting = Some(span(value)?),
                ("size", value) => size = value,
                _ => return Err(wrong(part, "expected `from`, `for` or `size`")),
            }
        }
        let within = |from: f64, to: f64| size.parse().ok().filter(|of| (from..=to).contains(of));
        let heating = || {
            size.parse::<Quantity>()
                .ok()?
                .in_unit(&Unit::parse("K/s").ok()?)
        };
        let kind = match (kind, sensor) {
            ("door", "") => within(0.1, 10.0).map(Kind::Door),
            ("lamp", "") => heating().filter(|of| of.abs() <= 0.01).map(Kind::Lamp),
            ("loose", "") => None,
            ("loose", of) => within(0.0, 1.0).map(|size| Kind::Loose(of.to_owned(), size)),
            _ => None,
        };
        let from_ns = from.as_ns();
        Ok(Self {
            kind: kind.ok_or_else(|| wrong(text, FORMS))?,
            from_ns,
            until_ns: from_ns.saturating_add(lasting.map_or(i64::MAX, Duration::as_ns)),
        })
    }
}

fn two(part: &str) -> (&str, &str) {
    let (key, value) = part.split_once('=').unwrap_or((part, ""));
    (key.trim(), value.trim())
}

/// Why a machine cannot be disturbed so: the part that is wrong, and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DisturbanceError {
    part: String,
    reason: String,
}

fn wrong(part: &str, reason: impl fmt::Display) -> DisturbanceError {
    DisturbanceError {
        part: part.to_owned(),
        reason: reason.to_string(),
    }
}

impl fmt::Display for DisturbanceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "disturbance `{}`: {}", self.part, self.reason)
    }
}

impl std::error::Error for DisturbanceError {}

/// What happens to a machine, in a form that it steps with.
#[derive(Debug, Clone)]
pub(crate) struct World {
    disturbances: Vec<Disturbance>,
    changes: Vec<Change>,
}

impl World {
    /// One that stays as it is.
    pub(crate) const SAME: Self = Self {
        disturbances: Vec::new(),
        changes: Vec::new(),
    };

    /// The same in which a machine changes.
    pub(crate) fn with(&self, changes: &[Change]) -> Self {
        Self {
            changes: changes.to_vec(),
            ..self.clone()
        }
    }

    /// How far something of the machine has changed.
    pub(crate) fn changed(&self, kind: Changing, time_ns: i64) -> f64 {
        Change::of(&self.changes, kind, time_ns)
    }

    /// Lets bodies grow by more than they are made to, once they have changed.
    pub(crate) fn swell<'a>(&self, time_ns: i64, bodies: impl IntoIterator<Item = &'a mut Bar>) {
        if !self.changes.is_empty() {
            let share = self.changed(Changing::Expansion, time_ns);
            bodies.into_iter().for_each(|body| body.swell(share));
        }
    }

    fn at(&self, time_ns: i64) -> impl Iterator<Item = &Kind> {
        let of = move |of: &&Disturbance| (of.from_ns..of.until_ns).contains(&time_ns);
        self.disturbances.iter().filter(of).map(|of| &of.kind)
    }

    /// How many times as strongly the air couples to all bodies, and how the first stage is heated in K/s.
    pub(crate) fn couples_and_heats(&self, time_ns: i64) -> (f64, f64) {
        let both = |(door, lamp): (f64, f64), kind: &Kind| match kind {
            Kind::Door(size) => (door * size, lamp),
            Kind::Lamp(size) => (door, lamp + size),
            Kind::Loose(..) => (door, lamp),
        };
        self.at(time_ns).fold((1.0, 0.0), both)
    }

    /// What the sensors of `channels` read, where some are loose in air of `air` °C.
    pub(crate) fn loosen(&self, time_ns: i64, air: f64, channels: &[Channel], read: &mut [f64]) {
        for kind in self.at(time_ns) {
            for (channel, value) in channels.iter().zip(&mut *read) {
                if let Kind::Loose(sensor, size) = kind
                    && channel.name == sensor
                {
                    *value = (1.0 - size) * *value + size * air;
                }
            }
        }
    }
}

/// A machine of this crate, by its name, in a world that changes; none where nothing does.
///
/// # Errors
/// It is no machine of this crate, or lacks the sensor that is to come loose.
pub fn disturbed(
    name: &str,
    by: &[Disturbance],
) -> Result<Option<Box<dyn Machine>>, DisturbanceError> {
    let world = World {
        disturbances: by.to_vec(),
        ..World::SAME
    };
    let machine: Box<dyn Machine> = match name {
        _ if by.is_empty() => return Ok(None),
        "die-tester" => Box::new(DieTester { world }),
        "linear-axis" => Box::new(LinearAxis { world }),
        _ => return Err(wrong(name, "die-tester and linear-axis can be disturbed")),
    };
    // The sensor of the air itself reads the room in any case.
    let is_on_body = |of: &&Channel| !of.is_axis() && !["room", "t4"].contains(&of.name);
    let on_bodies = machine.channels().iter().filter(is_on_body);
    let known: Vec<_> = on_bodies.map(|channel| channel.name).collect();
    for disturbance in by {
        if let Kind::Loose(sensor, _) = &disturbance.kind
            && !known.contains(&&**sensor)
        {
            let reason = format!("these can come loose: {}", known.join(", "));
            return Err(wrong(sensor, reason));
        }
    }
    Ok(Some(machine))
}
