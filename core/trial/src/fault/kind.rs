//! The ways in which a sensor fails. Decides their names and usual sizes, not what they do to a value.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::unit::Unit;

/// How a sensor fails. A fault changes the values that there are: where a channel has none, it has none with the fault either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FaultKind {
    /// There are no values.
    Missing,
    /// The last value before the fault stays; if there was none, the first one.
    Stuck,
    /// The size is added.
    Offset,
    /// One value in twenty, at random, is off by the size, up or down.
    Spike,
    /// A deviation grows from 0 by the size per hour.
    Drift,
    /// Normal noise with the size as standard deviation is added.
    Noise,
}

impl FaultKind {
    /// All of them, in the order of the documentation.
    pub const ALL: [Self; 6] = [
        Self::Missing,
        Self::Stuck,
        Self::Offset,
        Self::Spike,
        Self::Drift,
        Self::Noise,
    ];

    /// Its name in a graph file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Stuck => "stuck",
            Self::Offset => "offset",
            Self::Spike => "spike",
            Self::Drift => "drift",
            Self::Noise => "noise",
        }
    }

    /// The kind of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Whether it has a size: all but `missing` and `stuck` do.
    #[must_use]
    pub(crate) const fn has_size(self) -> bool {
        !matches!(self, Self::Missing | Self::Stuck)
    }

    /// The size where none is given, in the unit of the channel (per hour for `drift`): 1 K for a temperature, 100 nm for a length, and shares and multiples of it; other units have none.
    #[must_use]
    pub(crate) fn usual_size(self, unit: &Unit) -> Option<f64> {
        let of = |text: &str, size: f64| {
            let usual = Unit::parse(text).ok()?;
            Some(size * usual.factor_to(unit)?)
        };
        let scale = of("K", 1.0).or_else(|| of("nm", 100.0))?;
        Some(match self {
            Self::Missing | Self::Stuck => 0.0,
            Self::Offset => scale,
            Self::Spike => 5.0 * scale,
            Self::Drift => 0.5 * scale,
            Self::Noise => 0.05 * scale,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_found_by_their_names() {
        for kind in FaultKind::ALL {
            assert_eq!(FaultKind::named(kind.name()), Some(kind));
        }
        assert_eq!(FaultKind::named("mising"), None);
    }

    #[test]
    fn usual_sizes_are_in_the_unit_of_the_channel() {
        let size = |kind: FaultKind, unit: &str| kind.usual_size(&Unit::parse(unit).unwrap());
        assert_eq!(size(FaultKind::Offset, "Cel"), Some(1.0));
        assert_eq!(size(FaultKind::Noise, "nm"), Some(5.0));
        assert_eq!(size(FaultKind::Offset, "um"), Some(0.1));
        assert_eq!(size(FaultKind::Spike, "V"), None);
        for kind in FaultKind::ALL {
            let size = size(kind, "Cel");
            assert_eq!(kind.has_size(), size.is_some_and(|size| size > 0.0));
        }
    }
}
