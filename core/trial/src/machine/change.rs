//! What of a machine becomes another for good, such as `expansion=30%@2d`. Decides how that is written and when it is how far, not what
//! follows from it.

use std::fmt;
use std::str::FromStr;

use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::Deserialize;

/// What changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Changing {
    /// How much all bodies grow with their temperature: another material, other levers.
    Expansion,
    /// How well heat passes the joints between bodies.
    Contact,
    /// How much the motors heat.
    Load,
    /// The temperature of the room.
    Season,
}

const KINDS: [(&str, Changing); 4] = [
    ("expansion", Changing::Expansion),
    ("contact", Changing::Contact),
    ("load", Changing::Load),
    ("season", Changing::Season),
];

const FORMS: &str = "expected `expansion=30%@2d`, `contact` or `load` likewise (more than -100%, at most 1000%), or `season=4 K@2d` (at most \
                     20 K to either side); `@2d..5d` is a ramp";

/// A change for good: a step, `expansion=30%@2d`, or a ramp, `season=4 K@2d..9d`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub struct Change {
    text: String,
    kind: Changing,
    /// A share, or K.
    size: f64,
    from_ns: i64,
    until_ns: i64,
}

impl FromStr for Change {
    type Err = ChangeError;

    fn from_str(text: &str) -> Result<Self, ChangeError> {
        let wrong = || ChangeError(text.to_owned());
        let (what, when) = text.split_once('@').ok_or_else(wrong)?;
        let (kind, size) = what.split_once('=').ok_or_else(wrong)?;
        let (_, kind) = *KINDS
            .iter()
            .find(|(name, _)| *name == kind.trim())
            .ok_or_else(wrong)?;
        let size = size.trim();
        let share = |text: &str| {
            let percent = text.strip_suffix('%')?.trim_end().parse::<f64>().ok()?;
            Some(percent / 100.0).filter(|share| *share > -1.0 && *share <= 10.0)
        };
        let kelvins = |text: &str| {
            let found = text
                .parse::<Quantity>()
                .ok()?
                .in_unit(&Unit::parse("K").ok()?)?;
            Some(found).filter(|of| of.abs() <= 20.0)
        };
        let size = match kind {
            Changing::Season => kelvins(size),
            _ => share(size),
        };
        let time = |text: &str| {
            let time = text.trim().parse::<Duration>().ok()?.as_ns();
            Some(time).filter(|time| *time >= 0)
        };
        let (from, until) = when.split_once("..").unwrap_or((when, when));
        let (from_ns, until_ns) = time(from).zip(time(until)).ok_or_else(wrong)?;
        if until_ns < from_ns {
            return Err(wrong());
        }
        Ok(Self {
            text: text.to_owned(),
            kind,
            size: size.ok_or_else(wrong)?,
            from_ns,
            until_ns,
        })
    }
}

impl TryFrom<String> for Change {
    type Error = ChangeError;

    fn try_from(text: String) -> Result<Self, ChangeError> {
        text.parse()
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Change {
    /// How far it has gone at an instant.
    fn at(&self, time_ns: i64) -> f64 {
        if time_ns >= self.until_ns {
            self.size
        } else if time_ns <= self.from_ns {
            0.0
        } else {
            let gone = (time_ns - self.from_ns) as f64 / (self.until_ns - self.from_ns) as f64;
            self.size * gone
        }
    }

    /// How far all of a kind have gone at an instant: a share of what it was, or K.
    #[must_use]
    pub fn of(all: &[Self], kind: Changing, time_ns: i64) -> f64 {
        let of_kind = all.iter().filter(|change| change.kind == kind);
        of_kind.map(|change| change.at(time_ns)).sum::<f64>() + 0.0
    }
}

/// A change is none: what was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangeError(String);

impl fmt::Display for ChangeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no change: {FORMS}", self.0)
    }
}

impl std::error::Error for ChangeError {}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: i64 = 3_600_000_000_000;

    #[test]
    fn a_change_is_a_step_or_a_ramp_of_a_share_or_of_kelvins() {
        let of = |text: &str, kind, hours: i64| {
            let change: Change = text.parse().unwrap();
            assert_eq!(change.to_string(), text);
            Change::of(&[change], kind, hours * HOUR)
        };
        assert_eq!(of("expansion=30%@2d", Changing::Expansion, 47), 0.0);
        assert_eq!(of("expansion=30%@2d", Changing::Expansion, 48), 0.3);
        assert_eq!(of("expansion=30%@2d", Changing::Contact, 48), 0.0);
        assert_eq!(of("load=-50 %@1h..3h", Changing::Load, 2), -0.25);
        assert_eq!(of("season=4 K@0s..4h", Changing::Season, 1), 1.0);
        for wrong in [
            "expansion=30%",
            "expansion@2d",
            "stiffness=30%@2d",
            "expansion=30@2d",
            "contact=-100%@2d",
            "load=nan%@2d",
            "season=4 Cel@2d",
            "season=40 K@2d",
            "season=4 K@3d..2d",
            "season=4 K@-2d",
        ] {
            let error = wrong.parse::<Change>().unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("`{wrong}` is no change")),
                "{error}"
            );
        }
    }
}
